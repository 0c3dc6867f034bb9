#!/usr/bin/env python3
"""Feeds a pack of the rover from a companion computer: sends what it measures as BATTERY_STATUS.

The pack's BATT_MONITOR has to be 29. Readings come from the command line, or line by line from a file or a pipe:

    external_pack.py tcp:127.0.0.1:5760 --voltage 11.8 --current 2.5 --remaining 70
    external_pack.py /dev/ttyUSB0 --baud 115200 --pack 2 --readings discharge.csv
    my_sensor | external_pack.py tcp:127.0.0.1:5760 --readings -

A line is VOLTS[,AMPERES[,PERCENT]]; what is left empty is unknown, and a line without volts sends nothing. A file's lines
are sent at --rate, a pipe's as they come.
"""

import argparse
import hashlib
import itertools
import os
import sys
import time
from typing import NamedTuple

# pymavlink reads this when it is imported. A signature needs MAVLink 2.
os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil  # noqa: E402

mavlink = mavutil.mavlink

HEARTBEAT_INTERVAL_S = 1
# The rover drops a source that is silent for longer than 2 s.
SLOWEST_RATE_HZ = 1

# MAVLink's values for what is unknown or not used.
VOLTAGE_UNKNOWN_MV = 0xFFFF
TEMPERATURE_UNKNOWN = 0x7FFF
UNKNOWN = -1
CELLS = 10


class Reading(NamedTuple):
    """Volts, amperes drawn, percent left; `None` is unknown."""

    voltage_v: float | None
    current_a: float | None = None
    remaining_pct: float | None = None

    @classmethod
    def parse(cls, line):
        try:
            return cls(*(float(value) if value.strip() else None for value in line.split(",")))
        except (TypeError, ValueError):
            sys.exit(f"No reading: {line.strip()!r}")


def voltage_fields(voltage_v):
    """One field; what does not fit goes into the next."""
    whole, rest_mv = divmod(round(voltage_v * 1000), VOLTAGE_UNKNOWN_MV - 1)
    used = [VOLTAGE_UNKNOWN_MV - 1] * whole + [rest_mv]
    return (used + [VOLTAGE_UNKNOWN_MV] * CELLS)[:CELLS]


def send(link, pack, reading):
    link.mav.battery_status_send(
        pack - 1,
        mavlink.MAV_BATTERY_FUNCTION_ALL,
        mavlink.MAV_BATTERY_TYPE_UNKNOWN,
        TEMPERATURE_UNKNOWN,
        voltage_fields(reading.voltage_v),
        UNKNOWN if reading.current_a is None else round(reading.current_a * 100),
        # The rover counts what was consumed from the current.
        UNKNOWN,
        UNKNOWN,
        UNKNOWN if reading.remaining_pct is None else round(reading.remaining_pct),
    )


def send_heartbeat(link):
    link.mav.heartbeat_send(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE
    )


def readings(arguments):
    """Each reading when it is due. A sensor that has nothing new must not repeat the last: the rover would trust it."""
    if arguments.readings == "-":
        yield from map(Reading.parse, sys.stdin)
        return
    if arguments.readings is None:
        fixed = Reading(arguments.voltage, arguments.current, arguments.remaining)
        source = itertools.repeat(fixed)
    else:
        source = map(Reading.parse, open(arguments.readings))
    for reading in source:
        yield reading
        time.sleep(1 / arguments.rate)


def feed(link, arguments):
    heartbeat_at = time.monotonic()
    for reading in readings(arguments):
        if time.monotonic() >= heartbeat_at:
            send_heartbeat(link)
            heartbeat_at += HEARTBEAT_INTERVAL_S
        if reading.voltage_v is not None:
            send(link, arguments.pack, reading)
        # What the rover sends is not needed, but must not pile up; a signature's time follows it.
        while link.recv_match(blocking=False):
            pass


def connect(arguments):
    link = mavutil.mavlink_connection(
        arguments.connection,
        baud=arguments.baud,
        source_system=arguments.system,
        source_component=arguments.component,
    )
    if arguments.passphrase:
        key = hashlib.sha256(arguments.passphrase.encode()).digest()
        link.setup_signing(key, sign_outgoing=True)
    link.wait_heartbeat()
    return link


def rate(text):
    rate_hz = float(text)
    if not rate_hz >= SLOWEST_RATE_HZ:
        raise argparse.ArgumentTypeError(f"at least {SLOWEST_RATE_HZ} Hz")
    return rate_hz


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("connection", help="as pymavlink has it: tcp:127.0.0.1:5760, udpin:…, /dev/ttyUSB0")
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--pack", type=int, default=1, choices=range(1, 10), help="1 is BATT_, 2 is BATT2_")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--voltage", type=float, help="V, always the same")
    source.add_argument("--readings", metavar="FILE", help="a line for each reading; - for a pipe")
    parser.add_argument("--current", type=float, help="A, beside --voltage")
    parser.add_argument("--remaining", type=float, help="percent, beside --voltage")
    parser.add_argument("--rate", type=rate, default=10, help="readings a second (%(default)s)")
    parser.add_argument("--system", type=int, default=1, help="the rover's SYSID_THISMAV (%(default)s)")
    parser.add_argument(
        "--component",
        type=int,
        default=mavlink.MAV_COMP_ID_ONBOARD_COMPUTER,
        help="of this sender, none but 1, the rover's (%(default)s)",
    )
    parser.add_argument("--passphrase", help="of the signing key, where the rover has one")
    return parser.parse_args()


def main():
    arguments = parse_arguments()
    link = connect(arguments)
    print(f"Feeding pack {arguments.pack} of system {arguments.system}. Ctrl-C ends it.", flush=True)
    feed(link, arguments)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
