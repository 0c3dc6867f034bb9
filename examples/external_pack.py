#!/usr/bin/env python3
"""Feeds a pack of the rover from a companion computer: sends what it measures as BATTERY_STATUS.

The pack's BATT_MONITOR has to be 29. Readings come from the command line, or line by line from a file or a pipe:

    external_pack.py tcp:127.0.0.1:5760 --voltage 11.8 --current 2.5 --remaining 70
    external_pack.py /dev/ttyUSB0 --baud 115200 --pack 2 --readings discharge.csv
    my_sensor | external_pack.py tcp:127.0.0.1:5760 --readings -

A line is VOLTS[,AMPERES[,PERCENT]]; what is left empty, or can't be sent, is unknown, and a line without volts sends nothing.
A file's lines are sent at --rate, a pipe's as they come. Without a rover it waits for one, and after a restart of the rover
it goes on; a pipe's readings of that time are left out. Ctrl-C ends it.

Exit codes: 0; 1 if nothing was sent; 2 if it could not be tried.
"""

import argparse
import collections
import contextlib
import hashlib
import itertools
import os
import socket
import sys
import threading
import time
from typing import NamedTuple

# pymavlink reads this when it is imported. A signature needs MAVLink 2.
os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil  # noqa: E402

mavlink = mavutil.mavlink

EXTERNAL = 29
AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
HEARTBEAT_INTERVAL_S = 1
# The rover drops a source that is silent for longer.
STALE_S = 2
SLOWEST_RATE_HZ, FASTEST_RATE_HZ = 1, 100
# A link without a heartbeat of the rover for as long is opened again.
SILENCE_S = 5
CONNECT_TIMEOUT_S = 3
# Requests without an answer until it is said: a slow radio loses some.
PATIENT_REQUESTS = 3
POLL_S = 0.02
# Lines of a pipe that are kept, the latest.
KEPT_LINES = 100

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
        """Raises TypeError or ValueError for a line that is no reading."""
        return cls(*(float(value) if value.strip() else None for value in line.split(",")))

    def sendable(self):
        """The reading with what BATTERY_STATUS can't carry unknown, and these fields by name."""
        limits = zip(self._fields, LEAST, self, MOST)
        # Not a number is within no limits.
        wrong = [name for name, least, value, most in limits if value is not None and not least <= value <= most]
        return self._replace(**dict.fromkeys(wrong)), wrong


# BATTERY_STATUS has no negative voltage: such a one, as sensors read without a pack, is sent as 0.
LEAST = Reading(-650.0, -327.0, 0.0)
MOST = Reading(650.0, 327.0, 100.0)
OPTIONS = {"voltage_v": "--voltage", "current_a": "--current", "remaining_pct": "--remaining"}


def voltage_fields(voltage_v):
    """One field; what does not fit goes into the next."""
    whole, rest_mv = divmod(max(round(voltage_v * 1000), 0), VOLTAGE_UNKNOWN_MV - 1)
    used = [VOLTAGE_UNKNOWN_MV - 1] * whole + [rest_mv]
    return (used + [VOLTAGE_UNKNOWN_MV] * CELLS)[:CELLS]


def current_field(current_a):
    """In 10 mA. The one value that means unknown is sent as its neighbour."""
    current_ca = round(current_a * 100)
    return 0 if current_ca == UNKNOWN else current_ca


def send(link, pack, reading):
    link.mav.battery_status_send(
        pack - 1,
        mavlink.MAV_BATTERY_FUNCTION_ALL,
        mavlink.MAV_BATTERY_TYPE_UNKNOWN,
        TEMPERATURE_UNKNOWN,
        voltage_fields(reading.voltage_v),
        UNKNOWN if reading.current_a is None else current_field(reading.current_a),
        # The rover counts what was consumed from the current.
        UNKNOWN,
        UNKNOWN,
        UNKNOWN if reading.remaining_pct is None else round(reading.remaining_pct),
    )


def closed():
    raise ConnectionError("the connection was closed")


def open_link(arguments):
    """Raises OSError, whatever the reason."""
    if os.path.isfile(arguments.connection):
        raise OSError("it is a file")
    try:
        link = mavutil.mavlink_connection(
            arguments.connection,
            baud=arguments.baud,
            source_system=arguments.system,
            source_component=arguments.component,
            retries=1,
        )
    except OSError:
        raise
    except Exception as error:
        # Each kind of link has errors of its own.
        raise OSError(error) from error
    # Otherwise pymavlink prints each time that it reads the end of a TCP connection, and goes on.
    link.handle_eof = closed
    return link


class Rover:
    """The link to the rover, which is opened again when it is lost. Raises OSError if it can't be opened at first."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.monitor_name = "BATT_MONITOR" if arguments.pack == 1 else f"BATT{arguments.pack}_MONITOR"
        self.said = None
        self.was_lost = False
        self.signed_until = 0
        self.open()

    def open(self):
        """A heartbeat goes first, and another one each second while none of the rover's comes: by UDP the rover may look for
        any station, and with a key its time may be behind ours, so that pymavlink drops all that it sends until it has
        heard us."""
        self.link = None
        self.monitor = None
        self.is_heard = False
        self.requests = 0
        self.heard_at = self.next_at = time.monotonic()
        self.link = open_link(self.arguments)
        if self.arguments.passphrase:
            key = hashlib.sha256(self.arguments.passphrase.encode()).digest()
            # With one number for all links, so that the rover knows us again.
            self.link.setup_signing(key, sign_outgoing=True, link_id=0)
            signing = self.link.mav.signing
            signing.timestamp = max(signing.timestamp, self.signed_until)
        self.send_each_second()

    @property
    def takes_readings(self):
        return self.monitor == EXTERNAL

    def attend(self):
        """Does what is due: needed several times a second."""
        try:
            # pymavlink prints, too, of a serial port that is lost.
            with contextlib.redirect_stdout(None):
                self.receive_and_send()
        except OSError as error:
            self.lose(error)
            return
        if self.takes_readings:
            again = " again" if self.was_lost else ""
            self.say(f"Feeding pack {self.arguments.pack} of system {self.arguments.system}{again}. Ctrl-C ends it.")
        elif missing := self.missing():
            self.say(missing)

    def receive_and_send(self):
        if self.link is None:
            if time.monotonic() >= self.next_at:
                self.open()
            return
        while message := self.link.recv_match(blocking=False):
            self.take(message)
        if time.monotonic() >= self.next_at:
            self.send_each_second()
        if time.monotonic() >= self.heard_at + SILENCE_S:
            raise TimeoutError(f"no heartbeat for {SILENCE_S} s")

    def take(self, message):
        if (message.get_srcSystem(), message.get_srcComponent()) != (self.arguments.system, AUTOPILOT):
            return
        if message.get_type() == "HEARTBEAT":
            self.is_heard = True
            self.heard_at = time.monotonic()
        elif message.get_type() == "PARAM_VALUE" and message.param_id == self.monitor_name:
            self.monitor = round(message.param_value)

    def send_each_second(self):
        self.next_at = time.monotonic() + HEARTBEAT_INTERVAL_S
        self.link.mav.heartbeat_send(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE
        )
        if not self.takes_readings:
            self.link.mav.param_request_read_send(self.arguments.system, AUTOPILOT, self.monitor_name.encode(), -1)
            self.requests += self.is_heard

    def lose(self, error):
        reason = error.strerror or error
        if self.takes_readings:
            self.say(f"Lost {self.arguments.connection} ({reason}), and opening it again.")
            self.was_lost = True
        elif not self.was_lost:
            self.say(f"No rover with system id {self.arguments.system} at {self.arguments.connection}: {reason}.")
        if self.link is not None:
            self.signed_until = self.link.mav.signing.timestamp
            self.link.close()
        self.link = None
        self.monitor = None
        self.next_at = time.monotonic() + HEARTBEAT_INTERVAL_S

    def missing(self):
        """What has to change before the rover takes readings, if that is known."""
        if self.monitor is not None:
            return f"{self.monitor_name} is {self.monitor}, and has to be {EXTERNAL}."
        if self.requests > PATIENT_REQUESTS:
            return f"The rover does not say its {self.monitor_name}: has it a signing key (--passphrase)?"
        return None

    def say(self, line):
        """Each line once, until there is another one to say."""
        if line != self.said:
            print(line, flush=True)
        self.said = line

    def feed(self, reading, send=send):
        """Whether the reading was sent, by a function of link, pack and reading."""
        if self.link is None or not self.takes_readings:
            return False
        try:
            with contextlib.redirect_stdout(None):
                send(self.link, self.arguments.pack, reading)
        except OSError as error:
            self.lose(error)
            return False
        return True


class Pipe:
    """The latest lines of a pipe, read as they come, so that old ones don't pile up in it while there is no rover."""

    def __init__(self):
        self.lines = collections.deque(maxlen=KEPT_LINES)
        self.is_over = False
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        # It may be closed, and ends then.
        with contextlib.suppress(OSError):
            # A file of this thread's own: Python can't end while another thread reads sys.stdin.
            with open(0, encoding="utf-8", errors="replace", closefd=False) as pipe:
                for line in pipe:
                    self.lines.append((time.monotonic(), line))
        self.is_over = True

    def due_lines(self):
        """Each line that is not stale; `None` if there is none for now."""
        while True:
            is_over = self.is_over
            while self.lines:
                come_at, line = self.lines.popleft()
                if time.monotonic() < come_at + STALE_S:
                    yield line
            if is_over:
                return
            yield None
            time.sleep(POLL_S)


def at_rate(items, rate_hz):
    """Each of the items when it is due, `None` in between."""
    due_at = time.monotonic()
    for item in items:
        yield item
        # After a pause of this computer nothing is made up for.
        due_at = max(due_at + 1 / rate_hz, time.monotonic())
        while (left_s := due_at - time.monotonic()) > 0:
            time.sleep(min(left_s, POLL_S))
            yield None


class Trouble:
    """Says on standard error, once of each kind, what is wrong with readings."""

    def __init__(self):
        self.said = set()

    def say(self, kind, text):
        if kind not in self.said:
            print(f"{text} It is unknown to the rover.", file=sys.stderr, flush=True)
        self.said.add(kind)

    def parse(self, line):
        """What can be sent of a line."""
        if line is None:
            return None
        try:
            reading = Reading.parse(line)
        except (TypeError, ValueError):
            self.say("line", f"No reading: {line.strip()!r}.")
            return None
        reading, wrong = reading.sendable()
        for name in wrong:
            self.say(name, f"The {name.partition('_')[0]} in {line.strip()!r} can't be sent.")
        return reading


def due_lines(arguments):
    """Lines when they are due, `None` in between. A sensor that has nothing new must not repeat the last: the rover would
    trust it."""
    if arguments.readings == "-":
        return Pipe().due_lines()
    return at_rate(arguments.readings, arguments.rate)


def feed(rover, readings):
    """Sends readings until there are no more; returns how many."""
    sent = 0
    try:
        while not rover.takes_readings:
            time.sleep(POLL_S)
            rover.attend()
        for reading in readings:
            rover.attend()
            if reading is not None and reading.voltage_v is not None:
                sent += rover.feed(reading)
    except KeyboardInterrupt:
        pass
    return sent


def rate(text):
    rate_hz = float(text)
    if not SLOWEST_RATE_HZ <= rate_hz <= FASTEST_RATE_HZ:
        raise argparse.ArgumentTypeError(f"at least {SLOWEST_RATE_HZ} Hz, at most {FASTEST_RATE_HZ}")
    return rate_hz


def source(text):
    """A file's lines, or - of a pipe."""
    if text == "-":
        return text
    try:
        return open(text, encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise argparse.ArgumentTypeError(f"{text}: {error.strerror}") from error


def link_parser(description):
    """The arguments of the link to the rover, and of the pack."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("connection", help="as pymavlink has it: tcp:127.0.0.1:5760, udpin:…, /dev/ttyUSB0")
    parser.add_argument("--baud", type=int, default=115200)
    parser.add_argument("--pack", type=int, default=1, choices=range(1, 10), help="1 is BATT_, 2 is BATT2_")
    parser.add_argument("--system", type=int, default=1, help="the rover's SYSID_THISMAV (%(default)s)")
    parser.add_argument(
        "--component",
        type=int,
        default=mavlink.MAV_COMP_ID_ONBOARD_COMPUTER,
        help="of this sender, none but 1, the rover's (%(default)s)",
    )
    parser.add_argument("--passphrase", help="of the signing key, where the rover has one")
    return parser


def parse_link(parser):
    arguments = parser.parse_args()
    if not 1 <= arguments.system <= 255:
        parser.error("--system: 1 to 255")
    if not 2 <= arguments.component <= 255:
        parser.error("--component: 2 to 255")
    return arguments


def parse_arguments():
    parser = link_parser(__doc__)
    readings = parser.add_mutually_exclusive_group(required=True)
    readings.add_argument("--voltage", type=float, help="V, always the same")
    readings.add_argument("--readings", type=source, metavar="FILE", help="a line for each reading; - for a pipe")
    parser.add_argument("--current", type=float, help="A, beside --voltage")
    parser.add_argument("--remaining", type=float, help="percent, beside --voltage")
    parser.add_argument("--rate", type=rate, default=10, help="readings a second (%(default)s)")
    arguments = parse_link(parser)
    fixed = Reading(arguments.voltage, arguments.current, arguments.remaining)
    for name in fixed.sendable()[1]:
        parser.error(f"{OPTIONS[name]}: {getattr(fixed, name)} can't be sent")
    if arguments.readings is not None and fixed != Reading(None):
        parser.error("--current and --remaining: beside --voltage only")
    return arguments, fixed


def main():
    arguments, fixed = parse_arguments()
    # Otherwise an address without a computer holds it up for minutes.
    socket.setdefaulttimeout(CONNECT_TIMEOUT_S)
    if arguments.readings is None:
        readings = at_rate(itertools.repeat(fixed), arguments.rate)
    else:
        readings = map(Trouble().parse, due_lines(arguments))
    try:
        rover = Rover(arguments)
    except OSError as error:
        print(f"Can't open {arguments.connection}: {error.strerror or error}", file=sys.stderr)
        return 2
    return 0 if feed(rover, readings) else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(1)
