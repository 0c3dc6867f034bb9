"""A JBD BMS that a companion computer reads: examples/bms_pack.py, as its user starts it."""

import contextlib
import json
import os
import re
import struct
import subprocess
import sys
import threading
import time
import tty

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY
from station import connect, fresh, receive, volts
from test_external_pack import Script, set_up, texts_within

mavlink = mavutil.mavlink

SCRIPT = REPOSITORY / "examples" / "bms_pack.py"

OK = mavlink.MAV_BATTERY_CHARGE_STATE_OK
UNHEALTHY = mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY
FAILED = mavlink.MAV_BATTERY_CHARGE_STATE_FAILED

# What others have published, each an answer about registers 3 and 4, and what it says.
PUBLISHED = [
    # The maker's "Software Board General Protocol", V4 and V13; 15 cells, of which it gives no sum.
    (
        "dd 03 00 1b 17 00 00 00 02 d0 03 e8 00 00 20 78 00 00 00 00 00 00 10 48 03 0f 02 0b 76 0b 82 fb ff 77",
        "dd 04 00 1e 0f 66 0f 63 0f 63 0f 64 0f 3e 0f 63 0f 37 0f 5b 0f 65 0f 3b 0f 63 0f 63 0f 3c 0f 66 0f 3d f9 f9 77",
        [58_880, 0, 7_200, 10_000, 0, 72, 2150],
        [3942, 3939, 3939, 3940, 3902, 3939, 3895, 3931, 3941, 3899, 3939, 3939, 3900, 3942, 3901],
    ),
    # Of an owner, by Bluetooth: a comment in a program for LEDs that reads it with gatttool.
    (
        "dd 03 00 1b 05 28 00 00 1b b2 2a ef 00 02 29 0a 00 00 00 00 00 00 25 41 03 04 02 0b 74 0b 6b fc 39 77",
        "dd 04 00 08 0c e5 0c e3 0c e5 0c e8 fc 33 77",
        [13_200, 0, 70_900, 109_910, 2, 65, 2010],
        [3301, 3299, 3301, 3304],
    ),
    # Of an owner, from the tests of aiobmsble: 2.87 A are drawn, three thermistors.
    (
        "dd 03 00 1d 06 18 fe e1 01 f2 01 f4 00 2a 2c 7c 00 00 00 00 00 00 80 64 03 04 03 0b 8b 0b 8a 0b 84 f8 84 77",
        "dd 04 00 08 0d 66 0d 61 0d 68 0d 59 fe 3c 77",
        [15_600, 287, 4_980, 5_000, 42, 100, 2240],
        [3430, 3425, 3432, 3417],
    ),
]


def parsed(frames):
    """What the script makes of answers."""
    parse = (
        "import json, sys, bms_pack as b; frames = json.load(sys.stdin);"
        "basic, cells = (b.answer(bytes.fromhex(frame), register) for frame, register in zip(frames, (3, 4)));"
        "n = b.Basic.parse(basic);"
        "numbers = [n.voltage_mv, n.current_ca, n.left_mah, n.full_mah, n.cycles, n.remaining_pct, n.temperature_cdegc];"
        "print(json.dumps([numbers, [cells[i] << 8 | cells[i + 1] for i in range(0, len(cells), 2)]]))"
    )
    ended = subprocess.run(
        [sys.executable, "-B", "-c", parse],
        input=json.dumps(frames), cwd=SCRIPT.parent, capture_output=True, text=True, timeout=20,
    )
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


@pytest.mark.parametrize(("basic", "cells", "numbers", "cells_mv"), PUBLISHED)
def test_published_answers_are_read_as_they_are_meant(basic, cells, numbers, cells_mv):
    assert parsed([basic, cells]) == [numbers, cells_mv]
    # Behind noise, behind the end of another answer, and with a byte too many.
    assert parsed([f"00 dd 03 77 {basic} 77", f"{basic[-8:]} {cells} dd"]) == [numbers, cells_mv]


class Model:
    """A BMS on a pseudo-terminal, built from the maker's document alone."""

    def __init__(self, cells_mv, amperes=0.0):
        self.cells_mv, self.amperes = cells_mv, amperes
        self.percent, self.left_mah, self.full_mah, self.cycles = 80, 2080, 2600, 17
        self.protections, self.discharges = 0, True
        # Requests that a sleeping one ignores; what is done to an answer.
        self.ignored, self.spoil = 0, bytes
        self.delay_s, self.answers = 0.02, True
        self.requests = 0
        self.ours, self.theirs = os.openpty()
        tty.setraw(self.theirs)
        self.port = os.ttyname(self.theirs)
        self.is_over = False
        # Its number is another file's once it is closed.
        self.writing = threading.Lock()
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def serve(self):
        pending = b""
        while not self.is_over:
            try:
                pending += os.read(self.ours, 64)
            except OSError:
                return
            while match := re.search(rb"\xdd\xa5([\x03\x04])\x00(..)\x77", pending, re.DOTALL):
                pending = pending[match.end() :]
                self.requests += 1
                register = match[1][0]
                assert struct.unpack(">H", match[2])[0] == 0x10000 - register
                if self.ignored > 0:
                    self.ignored -= 1
                elif self.answers:
                    threading.Thread(target=self.reply, args=(register,), daemon=True).start()

    def reply(self, register):
        time.sleep(self.delay_s)
        body = self.basic() if register == 3 else struct.pack(f">{len(self.cells_mv)}H", *self.cells_mv)
        checked = bytes([0, len(body)]) + body
        frame = bytes([0xDD, register]) + checked + struct.pack(">H", -sum(checked) & 0xFFFF) + b"\x77"
        # 9600 baud.
        for byte in self.spoil(frame):
            with self.writing:
                if self.is_over:
                    return
                os.write(self.ours, bytes([byte]))
            time.sleep(0.001)

    def basic(self):
        return struct.pack(
            ">HhHHHHHHHBBBBBHH",
            sum(self.cells_mv) // 10, round(-100 * self.amperes), self.left_mah // 10, self.full_mah // 10,
            self.cycles, 0x2C7C, 0, 0, self.protections, 0x20, self.percent, 1 | self.discharges << 1, len(self.cells_mv),
            2, 2731 + 215, 2731 + 198,
        )  # fmt: skip

    def close(self):
        with self.writing:
            self.is_over = True
        # Without another end there is nothing more to read.
        os.close(self.theirs)
        self.thread.join(timeout=5)
        os.close(self.ours)


@pytest.fixture
def fed(start_simulator):
    """A rover that the script feeds from a model, its station, and the script; the model is made awake."""
    simulator = start_simulator()
    station = set_up(connect(simulator.url), simulator.url)
    with contextlib.ExitStack() as stack:

        def start(model):
            stack.callback(model.close)
            script = Script(sys.executable, SCRIPT, simulator.url, model.port)
            stack.callback(script.kill)
            script.wait_for("Feeding pack 1 of system 1.")
            return station, script

        yield start


def status_after(station, seconds):
    time.sleep(seconds)
    return fresh(station, "BATTERY_STATUS")


# Requirement: AP-11
def test_a_bms_feeds_its_pack_with_cells_charge_faults_and_cycles(fed):
    model = Model([3900, 3910, 3890], amperes=2.5)
    station, script = fed(model)
    status = status_after(station, 1.5)
    assert status.voltages[:4] == [3900, 3910, 3890, 65535]
    assert (status.current_battery, status.battery_remaining, status.temperature) == (250, 80, 2150)
    assert (status.current_consumed, status.charge_state, status.fault_bitmask) == (520, OK, 0)
    station.mav.command_long_send(1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, 370, 0, 0, 0, 0, 0, 0)
    assert receive(station, "SMART_BATTERY_INFO").cycle_count == 17
    # Too hot, it switches its output off; and its converter fails.
    model.protections, model.discharges, model.amperes = 1 << 6, False, 0.0
    status = status_after(station, 1)
    assert (status.charge_state, status.fault_bitmask) == (UNHEALTHY, mavlink.MAV_BATTERY_FAULT_OVER_TEMPERATURE)
    model.protections = 1 << 11
    assert status_after(station, 1).charge_state == FAILED
    model.protections, model.discharges = 0, True
    assert status_after(station, 1).charge_state == OK
    assert script.interrupt() == 0


def flipped(frame):
    """A bit of the voltage."""
    return frame[:5] + bytes([frame[5] ^ 1]) + frame[6:]


def shortened(frame):
    return frame[:-4]


def silent(_):
    return b""


@pytest.mark.parametrize("spoil", [flipped, shortened, silent])
def test_damaged_and_missing_answers_are_no_readings_until_a_good_one_comes(fed, spoil):
    model = Model([4000, 4000, 4000])
    station, script = fed(model)
    assert volts(status_after(station, 1)) == 12.0
    model.spoil, model.cells_mv = spoil, [3500, 3500, 3500]
    assert "Battery 1 unhealthy: no reading in time" in texts_within(station, 4)
    status = fresh(station, "BATTERY_STATUS")
    assert (volts(status), status.charge_state) == (12.0, UNHEALTHY)
    assert script.complaints == ["No reading of the BMS: the BMS does not answer.\n"]
    model.spoil = bytes
    assert volts(status_after(station, 1.5)) == 10.5


@pytest.mark.parametrize("before", [slice(6), slice(-9, None)], ids=["a begin", "an end"])
def test_a_whole_answer_behind_a_part_of_one_is_a_reading(fed, before):
    model = Model([3500, 3500, 3500])
    model.spoil = lambda frame: frame[before] + frame
    station, script = fed(model)
    assert volts(status_after(station, 1.5)) == 10.5
    assert script.complaints == []


def test_a_bms_that_sleeps_is_woken_by_the_first_request(fed):
    model = Model([3700, 3700, 3700])
    model.ignored = 1
    station, script = fed(model)
    assert volts(status_after(station, 1)) == pytest.approx(11.1)
    model.ignored = 2
    before = model.requests
    assert volts(status_after(station, 2)) == pytest.approx(11.1)
    assert model.requests > before + 4
    assert "Battery 1 unhealthy: no reading in time" not in texts_within(station, 1)
    assert script.complaints == []


def test_an_answer_that_comes_late_is_not_taken_for_one_about_something_else(fed):
    model = Model([3800, 3800, 3800], amperes=1.0)
    station, script = fed(model)
    assert volts(status_after(station, 1)) == pytest.approx(11.4)
    # Each comes when the next is asked for already.
    model.delay_s = 0.45
    end = time.monotonic() + 5
    while time.monotonic() < end:
        status = fresh(station, "BATTERY_STATUS")
        assert (status.voltages[:4], status.current_battery) == ([3800] * 3 + [65535], 100)
        assert (status.battery_remaining, status.fault_bitmask) == (80, 0)
    # Later than it is waited for at all.
    model.delay_s = 5
    assert "Battery 1 unhealthy: no reading in time" in texts_within(station, 4)
    assert script.complaints == ["No reading of the BMS: the BMS does not answer.\n"]


def test_what_does_not_open_is_named():
    model = Model([3700, 3700])
    for arguments, said in [
        (["tcp:127.0.0.1:1", model.port], "Can't open tcp:127.0.0.1:1: "),
        (["tcp:127.0.0.1:1", "/dev/no-such-port"], "Can't open /dev/no-such-port: "),
    ]:
        ended = subprocess.run([sys.executable, SCRIPT, *arguments], capture_output=True, text=True, timeout=20)
        assert (ended.returncode, ended.stdout) == (2, "")
        assert ended.stderr.startswith(said) and ended.stderr.count("\n") == 1, ended.stderr
    model.close()
