#!/usr/bin/env python3
"""Feeds a pack of the rover with what its JBD BMS reports: voltage, current, cells, charge, temperature, faults, cycles.

The BMS (Jiabaida, also sold as Xiaoxiang, Overkill Solar, LLT Power) is read at its UART or RS-485 port through an
isolated adapter; docs/packs.md says why. The pack's BATT_MONITOR has to be 29:

    bms_pack.py tcp:127.0.0.1:5760 /dev/ttyUSB0
    bms_pack.py /dev/ttyACM0 /dev/ttyUSB0 --pack 2

A BMS that is silent, or whose answers are damaged, is asked again; what it has said before is not repeated, so the rover
notices after two seconds. Ctrl-C ends it.

Exit codes: 0; 1 if nothing was sent; 2 if it could not be tried.
"""

import socket
import sys
import time
from typing import NamedTuple

import serial

from external_pack import CONNECT_TIMEOUT_S, TEMPERATURE_UNKNOWN, VOLTAGE_UNKNOWN_MV, Rover, link_parser, mavlink, parse_link

BAUD = 9600
RATE_HZ = 4
# An answer takes some 40 ms on the line, and the BMS a while to begin.
ANSWER_S = 0.3
# One that sleeps ignores the first request.
TRIES = 3
HEALTH_INTERVAL_S = 5

START, READ, END = 0xDD, 0xA5, 0x77
BASIC, CELLS = 0x03, 0x04
# Around the data: start, register, status, length; checksum, end.
HEAD, TAIL = 4, 3
BASIC_BYTES = 23

FIELDS, FIELDS_EXT = 10, 4
MOST_CA = 0x7FFF
ABSOLUTE_ZERO_DC = 2731

# Bits of the protections that are active.
CELL_HIGH, CELL_LOW, PACK_HIGH, PACK_LOW = 1, 2, 4, 8
HOT = 1 << 4 | 1 << 6
COLD = 1 << 5 | 1 << 7
OVER_CURRENT = 1 << 8 | 1 << 9
SHORT_CIRCUIT, FRONT_END_ERROR = 1 << 10, 1 << 11
DISCHARGES = 2

FAULTS = [
    (CELL_LOW | PACK_LOW, mavlink.MAV_BATTERY_FAULT_DEEP_DISCHARGE),
    (CELL_HIGH | PACK_HIGH, mavlink.MAV_BATTERY_FAULT_SPIKES),
    (OVER_CURRENT | SHORT_CIRCUIT, mavlink.MAV_BATTERY_FAULT_OVER_CURRENT),
    (HOT, mavlink.MAV_BATTERY_FAULT_OVER_TEMPERATURE),
    (COLD, mavlink.MAV_BATTERY_FAULT_UNDER_TEMPERATURE),
]


class Basic(NamedTuple):
    """Register 3; the current is that drawn from the pack."""

    voltage_mv: int
    current_ca: int
    left_mah: int
    full_mah: int
    cycles: int
    balancing: bool
    protections: int
    remaining_pct: int
    switches: int
    temperature_cdegc: int | None

    @classmethod
    def parse(cls, data):
        """Raises ValueError for data that are too short."""
        if len(data) < BASIC_BYTES or len(data) < BASIC_BYTES + 2 * data[22]:
            raise ValueError("too short")

        def word(at, signed=False):
            return int.from_bytes(data[at : at + 2], "big", signed=signed)

        thermistors = [word(BASIC_BYTES + 2 * number) for number in range(data[22])]
        return cls(
            voltage_mv=10 * word(0),
            # The BMS has a discharge negative.
            current_ca=-word(2, signed=True),
            left_mah=10 * word(4),
            full_mah=10 * word(6),
            cycles=word(8),
            balancing=data[12:16] != bytes(4),
            protections=word(16),
            remaining_pct=data[19],
            switches=data[20],
            temperature_cdegc=10 * (max(thermistors) - ABSOLUTE_ZERO_DC) if thermistors else None,
        )

    def charge_state(self):
        """As MAVLink has it. A protection of charging alone lets the pack be used."""
        if self.protections & FRONT_END_ERROR:
            return mavlink.MAV_BATTERY_CHARGE_STATE_FAILED
        if self.protections & (CELL_LOW | PACK_LOW):
            return mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
        if self.protections and not self.switches & DISCHARGES:
            return mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY
        return mavlink.MAV_BATTERY_CHARGE_STATE_CHARGING if self.current_ca < 0 else mavlink.MAV_BATTERY_CHARGE_STATE_OK

    def faults(self):
        return sum(fault for bits, fault in FAULTS if self.protections & bits)


class Reading(NamedTuple):
    basic: Basic
    cells_mv: list[int]


def checksum(content):
    """Of all between the start and itself, but for the first of them."""
    return (0x10000 - sum(content[1:])) & 0xFFFF


def request(register):
    content = bytes([READ, register, 0])
    return bytes([START]) + content + checksum(content).to_bytes(2, "big") + bytes([END])


def answer(received, register):
    """The data of the first whole answer about this register; `None` if there is none. Raises ValueError if the BMS refuses."""
    for start, byte in enumerate(received):
        frame = received[start:]
        if byte != START or len(frame) < HEAD or frame[1] != register:
            continue
        length = frame[3]
        frame = frame[: HEAD + length + TAIL]
        if len(frame) < HEAD + length + TAIL or frame[-1] != END:
            continue
        if checksum(frame[1:-TAIL]) != int.from_bytes(frame[-TAIL:-1], "big"):
            continue
        if frame[2] != 0:
            raise ValueError("refused")
        return frame[HEAD:-TAIL]
    return None


class Bms:
    """Raises OSError if its port can't be opened."""

    def __init__(self, port):
        self.port = serial.Serial(port, BAUD, timeout=ANSWER_S / 10)

    def ask(self, register):
        """The data of a register. What comes late answers no later request. Raises ValueError if it refuses, TimeoutError."""
        for _ in range(TRIES):
            self.port.reset_input_buffer()
            self.port.write(request(register))
            received = b""
            end = time.monotonic() + ANSWER_S
            while time.monotonic() < end:
                received += self.port.read(self.port.in_waiting or 1)
                if (data := answer(received, register)) is not None:
                    return data
        raise TimeoutError("the BMS does not answer")

    def read(self):
        """Raises ValueError for what does not fit, TimeoutError."""
        basic = Basic.parse(self.ask(BASIC))
        data = self.ask(CELLS)
        cells_mv = [int.from_bytes(data[at : at + 2], "big") for at in range(0, len(data) - 1, 2)]
        return Reading(basic, cells_mv)


def cell_fields(reading):
    """The cells in the fields of BATTERY_STATUS; of one cell, or of more than there are fields, the pack's voltage."""
    cells_mv = reading.cells_mv
    if not 1 < len(cells_mv) <= FIELDS + FIELDS_EXT:
        cells_mv = [reading.basic.voltage_mv]
    fields = cells_mv[:FIELDS] + [VOLTAGE_UNKNOWN_MV] * (FIELDS - len(cells_mv))
    return fields, (cells_mv[FIELDS:] + [0] * FIELDS_EXT)[:FIELDS_EXT]


def send(link, pack, reading):
    basic = reading.basic
    fields, fields_ext = cell_fields(reading)
    current_ca = max(-MOST_CA, min(basic.current_ca, MOST_CA))
    link.mav.battery_status_send(
        pack - 1,
        mavlink.MAV_BATTERY_FUNCTION_ALL,
        mavlink.MAV_BATTERY_TYPE_UNKNOWN,
        TEMPERATURE_UNKNOWN if basic.temperature_cdegc is None else basic.temperature_cdegc,
        fields,
        # -1 is unknown.
        0 if current_ca == -1 else current_ca,
        max(basic.full_mah - basic.left_mah, 0),
        -1,
        min(basic.remaining_pct, 100),
        0,
        basic.charge_state(),
        fields_ext,
        mavlink.MAV_BATTERY_MODE_UNKNOWN,
        basic.faults(),
    )


class BatteryInfo(mavlink.MAVLink_message):
    """BATTERY_INFO, which pymavlink 2.4.50 does not know, with the cycles alone."""

    ID, CRC_EXTRA, BYTES = 372, 26, 140
    CYCLES_AT, PACK_AT, HEALTH_AT = 40, 44, 47
    HEALTH_UNKNOWN = 255

    def __init__(self, pack, cycles):
        super().__init__(self.ID, "BATTERY_INFO")
        self.content = bytearray(self.BYTES)
        self.content[self.CYCLES_AT : self.CYCLES_AT + 2] = cycles.to_bytes(2, "little")
        self.content[self.PACK_AT] = pack - 1
        self.content[self.HEALTH_AT] = self.HEALTH_UNKNOWN

    def pack(self, mav, force_mavlink1=False):
        return self._pack(mav, self.CRC_EXTRA, bytes(self.content), force_mavlink1)


def send_health(link, pack, reading):
    link.mav.send(BatteryInfo(pack, reading.basic.cycles))


def feed(rover, bms):
    """Sends what the BMS says until Ctrl-C; returns how often."""
    sent = 0
    due_at = health_at = time.monotonic()
    was_silent = False
    try:
        while True:
            rover.attend()
            if time.monotonic() < due_at:
                time.sleep(0.02)
                continue
            due_at = time.monotonic() + 1 / RATE_HZ
            try:
                reading = bms.read()
            except (TimeoutError, ValueError) as error:
                if not was_silent:
                    print(f"No reading of the BMS: {error}.", file=sys.stderr, flush=True)
                was_silent = True
                continue
            was_silent = False
            sent += rover.feed(reading, send)
            if sent and time.monotonic() >= health_at and rover.feed(reading, send_health):
                health_at = time.monotonic() + HEALTH_INTERVAL_S
    except KeyboardInterrupt:
        return sent


def main():
    parser = link_parser(__doc__)
    parser.add_argument("bms", help="port of the BMS, such as /dev/ttyUSB0")
    arguments = parse_link(parser)
    # Otherwise an address without a computer holds it up for minutes.
    socket.setdefaulttimeout(CONNECT_TIMEOUT_S)
    opened = arguments.bms
    try:
        bms = Bms(arguments.bms)
        opened = arguments.connection
        rover = Rover(arguments)
    except OSError as error:
        print(f"Can't open {opened}: {error.strerror or error}", file=sys.stderr)
        return 2
    try:
        return 0 if feed(rover, bms) else 1
    except serial.SerialException as error:
        print(f"Lost {arguments.bms}: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(1)
