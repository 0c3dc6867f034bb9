"""MAVProxy as its user runs it, without a window: commands go in, its answers come out."""

import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from conftest import MAVPROXY, PARAMS, REPOSITORY
from station import connect, is_about, receive, restarted, set_to

# One MAVProxy at a time: what it repeats in time, it repeats late on a machine that starts others.
pytestmark = pytest.mark.xdist_group("mavproxy")


class MavProxy:
    """A running MAVProxy that has downloaded the parameters."""

    def __init__(self, url, home, *arguments, **environment):
        self.lines = queue.Queue()
        self.process = subprocess.Popen(
            [sys.executable, MAVPROXY, "--master", url, "--state-basedir", home, *arguments],
            cwd=home,
            # No start-up script of the user's.
            env={**os.environ, "HOME": str(home), "PYTHONUNBUFFERED": "1", **environment},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        threading.Thread(target=self.read_lines, daemon=True).start()
        self.start_up = self.wait_for(r"Received (\d+) parameters", timeout=20)

    def read_lines(self):
        for line in self.process.stdout:
            self.lines.put(line.rstrip("\n"))

    def wait_for(self, pattern, timeout=5):
        """Waits for a line with the pattern; returns the match."""
        seen = []
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            try:
                seen.append(self.lines.get(timeout=left))
            except queue.Empty:
                break
            if match := re.search(pattern, seen[-1]):
                return match
        raise AssertionError(f"MAVProxy never said {pattern}, but:\n" + "\n".join(seen))

    def type(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def ask(self, line, pattern, timeout=5):
        """Types a command and waits for its answer."""
        while not self.lines.empty():
            self.lines.get()
        self.type(line)
        return self.wait_for(pattern, timeout)

    def show(self, name):
        """A parameter, as the vehicle has it now."""
        self.ask(f"param fetch {name}", rf"Requested parameter {name}")
        time.sleep(0.5)
        return float(self.ask(f"param show {name}", rf"{name} +(\S+)")[1])

    def received(self, name):
        """How many of these messages have come since MAVProxy was started."""
        return int(self.ask(f"status {name}", rf"(\d+): {name} ")[1])

    def rate_of(self, name, seconds=5):
        before, started = self.received(name), time.monotonic()
        time.sleep(seconds)
        return (self.received(name) - before) / (time.monotonic() - started)

    def kill(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


def values_in(file):
    """The parameters in a file, by name."""
    lines = (re.split(r"[,\s]+", line.strip()) for line in file.read_text().splitlines() if line and line[0] != "#")
    return {name: float(value) for name, value, *_ in lines}


@pytest.fixture
def start_mavproxy(start_simulator, tmp_path):
    """Starts MAVProxy on a simulator of its own."""
    started = []

    def start(*arguments):
        started.append(MavProxy(start_simulator().url, tmp_path, *arguments))
        return started[-1]

    yield start
    for mavproxy in started:
        mavproxy.kill()


@pytest.fixture
def mavproxy(start_mavproxy):
    """MAVProxy that leaves the rates alone."""
    return start_mavproxy("--streamrate=-1")


@pytest.mark.board
def test_it_downloads_all_parameters(mavproxy, tmp_path):
    assert mavproxy.start_up[1] == mavproxy.ask("param status", r"Have (\d+)/\1 params")[1]
    saved = values_in(tmp_path / "mav.parm")
    assert len(saved) == int(mavproxy.start_up[1])
    assert saved["SR0_EXTRA1"] == 2


@pytest.mark.board
def test_it_starts_without_waiting_for_a_file_transfer(start_mavproxy):
    started = time.monotonic()
    start_mavproxy()
    # It gives a vehicle that doesn't answer its file transfer twelve seconds.
    assert time.monotonic() - started < 11


@pytest.mark.board
def test_it_shows_and_sets_parameters(mavproxy):
    assert mavproxy.show("SR0_EXTRA1") == 2
    mavproxy.type("param set BATT_VOLT_MULT 7.9")
    assert mavproxy.show("BATT_VOLT_MULT") == pytest.approx(7.9)
    assert voltage(mavproxy) > 24


@pytest.mark.board
def test_it_says_that_a_value_was_refused(mavproxy):
    refused = r"Failed to set BATT_VOLT_MULT to 1000 \(invalid returned value"
    mavproxy.ask("param set BATT_VOLT_MULT 1000", refused)
    assert mavproxy.show("BATT_VOLT_MULT") == pytest.approx(3.95)


def voltage(mavproxy):
    return int(mavproxy.ask("status BATTERY_STATUS", r"voltages : \[(\d+), 65535")[1]) / 1000


# Requirement: FR-6
def test_it_shows_the_battery(mavproxy):
    assert 12.0 < voltage(mavproxy) < 12.65
    mavproxy.type("set numcells 3")
    time.sleep(1)
    cell = mavproxy.ask("bat", r"Bat1 (\S+) V/cell for 3 cells")
    assert 4.0 < float(cell[1]) < 4.22
    mavproxy.ask("long MAV_CMD_BATTERY_RESET -1 50 0 0 0 0 0", r"Got COMMAND_ACK: BATTERY_RESET: ACCEPTED")


@pytest.mark.board
def test_it_loses_nothing(mavproxy):
    time.sleep(3)
    link = mavproxy.ask("link", r"link 1 OK \((\d+) packets, .* (\d+) lost")
    assert int(link[1]) > 15
    assert link[2] == "0"


@pytest.mark.board
def test_its_stream_rate_is_followed_and_not_saved(start_mavproxy):
    mavproxy = start_mavproxy("--streamrate=8")
    assert is_about(mavproxy.rate_of("BATTERY_STATUS"), 8)
    mavproxy.type("set streamrate 4")
    time.sleep(0.5)
    assert is_about(mavproxy.rate_of("SYS_STATUS"), 4)
    assert mavproxy.show("SR0_EXTRA1") == 2


@pytest.mark.board
def test_it_asks_for_the_version(mavproxy):
    mavproxy.ask("version", r"Got COMMAND_ACK: REQUEST_MESSAGE: ACCEPTED")
    time.sleep(0.5)
    mavproxy.ask("status AUTOPILOT_VERSION", r"AUTOPILOT_VERSION \{capabilities : \d+")


def test_it_restarts_into_the_boot_loader_which_ends_the_simulator(start_simulator, tmp_path):
    simulator = start_simulator()
    mavproxy = MavProxy(simulator.url, tmp_path)
    try:
        mavproxy.ask("reboot bootloader", r"Got COMMAND_ACK: PREFLIGHT_REBOOT_SHUTDOWN: ACCEPTED")
        code, output = simulator.wait()
    finally:
        mavproxy.kill()
    assert code == 0 and output.endswith("for another firmware.\nStopped.\n"), output


def test_it_arms_and_drives(mavproxy):
    mavproxy.type("param set BATT_ARM_VOLT 13")
    assert mavproxy.show("BATT_ARM_VOLT") == 13
    mavproxy.ask("arm throttle", r"AP: Arm: Battery 1 below minimum arming voltage")
    mavproxy.wait_for(r"Got COMMAND_ACK: COMPONENT_ARM_DISARM: FAILED")
    mavproxy.ask("arm prearms", r"AP: PreArm: Battery 1 below minimum arming voltage")
    mavproxy.type("param set BATT_ARM_VOLT 0")
    assert mavproxy.show("BATT_ARM_VOLT") == 0
    mavproxy.ask("arm throttle", r"^ARMED")
    mavproxy.ask("mode MANUAL", r"Mode MANUAL")
    mavproxy.ask("mode AUTO", r"AP: No such mode 10")
    mavproxy.ask("rc 3 1700", r"AP: Centre the throttle \(RC3\) first")
    mavproxy.type("rc 3 1500")
    mavproxy.type("rc 1 1500")
    mavproxy.type("rc 3 1700")
    time.sleep(2)

    # It repeats the override: as long as it runs nothing is missed.
    os.kill(mavproxy.process.pid, signal.SIGSTOP)
    time.sleep(2.5)
    os.kill(mavproxy.process.pid, signal.SIGCONT)
    mavproxy.wait_for(r"AP: Radio Failsafe: Hold")
    mavproxy.wait_for(r"Mode HOLD")
    # The failsafe lasts until the next override.
    for _ in range(10):
        if mavproxy.ask("mode MANUAL", r"Mode MANUAL|mode change denied").group() == "Mode MANUAL":
            break
        time.sleep(0.5)
    else:
        raise AssertionError("the mode was denied after the controls were back")
    mavproxy.ask("mode HOLD", r"Mode HOLD")
    mavproxy.ask("disarm", r"^DISARMED")


# What the pack gives with the motors at rest, at most, in A: the board's own load, and the noise of the sensor.
AT_REST_A = 0.6


def current_a(watcher):
    """Of the BATTERY_STATUS that comes next."""
    while watcher.recv_match(blocking=False):
        pass
    return receive(watcher, ["BATTERY_STATUS"]).current_battery / 100


def printed_drive():
    page = (REPOSITORY / "docs" / "getting-started.md").read_text()
    return page.split("### MAVProxy\n```text\n")[1].split("\n```")[0].splitlines()


def test_the_printed_drive_moves_the_rover(start_simulator, tmp_path):
    simulator = start_simulator()
    watcher = connect(simulator.url)
    for name, value in (("BATT_MONITOR", 4), ("BATT_CURR_PIN", 27), ("BATT_CELLS", 3), ("SR0_EXTRA1", 10)):
        set_to(watcher, name, value)
    watcher = restarted(watcher, simulator.url)
    mavproxy = MavProxy(simulator.url, tmp_path, "--streamrate=-1")
    answers = {"mode MANUAL": "Mode MANUAL", "arm throttle": "^ARMED", "disarm": "^DISARMED"}
    moved = []
    try:
        for step in printed_drive():
            if answer := answers.get(step):
                mavproxy.ask(step, answer)
            else:
                mavproxy.type(step)
            time.sleep(1)
            if current_a(watcher) > AT_REST_A:
                moved.append(step)
    finally:
        mavproxy.kill()
    assert moved == ["rc 3 1600", "rc 1 1600"]


def test_it_loads_a_ready_file(mavproxy, tmp_path):
    file = PARAMS / "3s-lipo.param"
    saved = tmp_path / "before.parm"
    mavproxy.ask(f"param save {saved}", r"Saved \d+ parameters to .*before.parm")
    values, before = values_in(file), values_in(saved)
    changed = sum(before[name] != pytest.approx(value) for name, value in values.items())
    mavproxy.ask(f"param load {file}", rf"Loaded {len(values)} parameters from .*3s-lipo.param \(changed {changed}\)")
    assert mavproxy.show("BATT_LOW_VOLT") == 10.5


@pytest.mark.board
def test_it_loads_what_it_has_not_read_by_force_only(mavproxy):
    file = PARAMS / "fuel-level.param"
    mavproxy.ask(f"param load {file}", r"Unknown parameter BATT2_CAPACITY")
    mavproxy.ask(f"param forceload {file}", rf"Loaded {len(values_in(file))} parameters from .*fuel-level.param")
    assert mavproxy.show("BATT2_CAPACITY") == 1500
