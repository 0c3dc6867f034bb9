"""Logs of other autopilots: `replay` finds the readings that pymavlink and pyulog count, and the charge of the log."""

import csv
import struct
import subprocess

import pytest
from pymavlink import DFReader, mavutil
from pyulog import ULog

from conftest import REPOSITORY

mavlink = mavutil.mavlink

READINGS = 600
ARMED = range(100, 400)
AMPERES = 6.0
# Begins after 1 s, ten readings a second.
TIMES_US = [1_000_000 + 100_000 * reading for reading in range(READINGS)]
BYTES_OF = {"B": 1, "h": 2, "H": 2, "c": 2, "I": 4, "f": 4, "Q": 8, "n": 4, "N": 16, "Z": 64}
PACKED = {"c": "h", "n": "4s", "N": "16s", "Z": "64s"}


def volts(reading):
    return 12.3 - 0.002 * reading


def drawn_mah(reading):
    return AMPERES * 0.1 * reading / 3.6


def replay(path, pack=1):
    """How many readings `replay` finds, and what it says of them."""
    run = ["cargo", "run", "--quiet", "--bin", "replay", "--", "--pack", str(pack), str(path)]
    done = subprocess.run(run, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    return len(list(csv.DictReader(done.stdout.splitlines()))), done.stderr


def check(path, counted, pack=1):
    readings, said = replay(path, pack)
    assert readings == counted == READINGS
    assert "armed for 30 s" in said
    assert f"Drawn: {drawn_mah(READINGS - 1):.0f} mAh" in said


def described(number, name, types, columns):
    length = 3 + sum(BYTES_OF[of] for of in types)
    texts = struct.pack("<4s16s64s", name.encode(), types.encode(), columns.encode())
    return b"\xa3\x95\x80" + bytes([number, length]) + texts


def record(number, types, *fields):
    packed = "<" + "".join(PACKED.get(of, of) for of in types)
    return b"\xa3\x95" + bytes([number]) + struct.pack(packed, *fields)


def hundredths(value):
    return round(100 * value)


# Name, types, columns and fields of a reading.
VERSIONS = {
    "3.2": ("CURR", "IhIhhhf", "TimeMS,ThrOut,ThrInt,Volt,Curr,Vcc,CurrTot",
            lambda us, v, a, mah: (us // 1000, 0, 0, hundredths(v), hundredths(a), 5000, mah)),
    "3.3": ("CURR", "QhhhHfh", "TimeUS,Throttle,Volt,Curr,Vcc,CurrTot,Volt2",
            lambda us, v, a, mah: (us, 0, hundredths(v), hundredths(a), 5000, mah, 0)),
    "3.4": ("CURR", "Qfff", "TimeUS,Volt,Curr,CurrTot", lambda *fields: fields),
    "4.0": ("BAT", "Qffff", "TimeUS,Volt,VoltR,Curr,CurrTot", lambda us, v, a, mah: (us, v, v, a, mah)),
    "4.2": ("BAT", "QBffff", "TimeUS,Instance,Volt,VoltR,Curr,CurrTot",
            lambda us, v, a, mah: (us, 0, v, v, a, mah)),
    "4.6": ("BAT", "QBffffcBBB", "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,Temp,RemPct,H,SH",
            lambda us, v, a, mah: (us, 0, v, v, a, mah, 2500, 50, 1, 0)),
}  # fmt: skip


def dataflash(version):
    name, types, columns, fields = VERSIONS[version]
    log = [
        described(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        described(3, "EV", "QB", "TimeUS,Id"),
        described(10, name, types, columns),
    ]
    for reading, us in enumerate(TIMES_US):
        if reading in (ARMED.start, ARMED.stop):
            log.append(record(3, "QB", us, 10 if reading == ARMED.start else 11))
        log.append(record(10, types, *fields(us, volts(reading), AMPERES, drawn_mah(reading))))
    return name, b"".join(log)


def count(reader, name):
    counted = 0
    while found := reader.recv_msg():
        counted += found.get_type() == name
    return counted


@pytest.mark.parametrize("version", VERSIONS)
def test_ardupilots_log(version, tmp_path):
    path = tmp_path / "flight.bin"
    name, log = dataflash(version)
    path.write_bytes(log)
    check(path, count(DFReader.DFReader_binary(str(path)), name))


@pytest.mark.parametrize("version", VERSIONS)
def test_ardupilots_log_as_text(version, tmp_path):
    binary, text = tmp_path / "flight.bin", tmp_path / "flight.log"
    name, log = dataflash(version)
    binary.write_bytes(log)
    reader = DFReader.DFReader_binary(str(binary))
    with open(text, "w") as lines:
        while found := reader.recv_msg():
            fields = [found.get_type(), *(getattr(found, column) for column in found.fmt.columns)]
            lines.write(", ".join(map(str, fields)) + "\r\n")
    check(text, count(DFReader.DFReader_text(str(text)), name))


def test_a_ground_stations_log(tmp_path):
    path = tmp_path / "mav.tlog"
    vehicle, other, station = (mavlink.MAVLink(None, system, 1) for system in (1, 2, 255))
    with open(path, "wb") as log:

        def write(reading, message, sender):
            log.write(struct.pack(">Q", 1_700_000_000_000_000 + 100_000 * reading) + message.pack(sender))

        for reading in range(READINGS):
            mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if reading in ARMED else 0
            if reading % 10 == 0:
                write(reading, vehicle.heartbeat_encode(mavlink.MAV_TYPE_QUADROTOR, 3, mode, 0, 4), vehicle)
                write(reading, other.heartbeat_encode(mavlink.MAV_TYPE_FIXED_WING, 12, 128, 0, 4), other)
                write(reading, station.heartbeat_encode(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4), station)
            write(reading, vehicle.ahrs2_encode(0, 0, 0, 0, 0, 0), vehicle)
            cells = [3900 - reading] * 14
            pack = (cells[:10], hundredths(AMPERES), round(drawn_mah(reading)), -1, 50, 0, 1, cells[10:])
            write(reading, vehicle.battery_status_encode(0, 0, 1, 2500, *pack), vehicle)
            write(reading, other.battery_status_encode(0, 0, 1, 2500, *pack), other)
    reader = mavutil.mavlink_connection(str(path))
    counted = 0
    while found := reader.recv_match(type="BATTERY_STATUS"):
        counted += found.get_srcSystem() == 1
    check(path, counted)
    assert f"Replayed vehicle 1; the log also has 2 ({READINGS} readings) (--system)\n" in replay(path)[1]


def message(kind, content):
    return struct.pack("<HB", len(content), ord(kind)) + content


def parameter(key, value):
    return message("P", bytes([len(key)]) + key.encode() + value)


def test_px4s_log(tmp_path):
    path = tmp_path / "flight.ulg"
    formats = [
        "battery_status:uint64_t timestamp;float voltage_v;float current_a;float discharged_mah;float remaining;"
        "float[14] voltage_cell_v;bool connected;uint8_t[3] _padding0;",
        "actuator_armed:uint64_t timestamp;bool armed;bool prearmed;uint8_t[6] _padding0;",
        "esc_report:uint64_t timestamp;float esc_current;",
        "esc_status:uint64_t timestamp;esc_report[8] esc;uint8_t esc_count;",
    ]
    log = [b"ULog\x01\x12\x35\x01" + bytes(8), message("B", bytes(40))]
    log += [message("F", fields.encode()) for fields in formats]
    log.append(parameter("int32_t BAT1_N_CELLS", struct.pack("<i", 3)))
    topics = [(0, "battery_status"), (1, "battery_status"), (0, "actuator_armed"), (0, "esc_status")]
    for number, (instance, name) in enumerate(topics):
        log.append(message("A", struct.pack("<BH", instance, number) + name.encode()))
    for reading, us in enumerate(TIMES_US):
        log.append(message("D", struct.pack("<HQBB", 2, us, reading in ARMED, 0)))
        log.append(message("D", struct.pack("<HQ", 3, us) + bytes(8 * 12 + 1)))
        for pack in (0, 1):
            values = (volts(reading), AMPERES, drawn_mah(reading), 0.5)
            cells = [volts(reading) / 3] * 3 + [0.0] * 11
            log.append(message("D", struct.pack("<HQ18f?", pack, us, *values, *cells, True)))
        if reading == 300:
            log.append(message("O", struct.pack("<H", 120)))
    path.write_bytes(b"".join(log))
    batteries = [topic for topic in ULog(str(path)).data_list if topic.name == "battery_status"]
    assert len(batteries) == 2
    for battery in batteries:
        check(path, len(battery.data["timestamp"]), battery.multi_id + 1)
