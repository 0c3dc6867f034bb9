"""Many rovers driven at once by examples/drive_fleet.py: whatever ends it, none stays armed."""

import contextlib
import re
import signal
import subprocess
import sys
import time

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY, free_port

SCRIPT = REPOSITORY / "examples" / "drive_fleet.py"
ROVERS = 3


@pytest.fixture
def fleet(start_simulator):
    port = free_port()
    simulator = start_simulator("--rovers", str(ROVERS), "--udp", f"127.0.0.1:{port}")
    simulator.udp = f"udpin:127.0.0.1:{port}"
    return simulator


def armed(simulator):
    """How many rovers are armed by the latest line."""
    counts = [found[1] for line in simulator.output if (found := re.match(rf"{ROVERS} rovers: (\d+) armed", line))]
    return int(counts[-1]) if counts else None


def wait_until_armed(simulator, count):
    end = time.monotonic() + 20
    while armed(simulator) != count:
        assert time.monotonic() < end, simulator.output
        time.sleep(0.1)


@contextlib.contextmanager
def driving(link, *arguments):
    command = [sys.executable, SCRIPT, "--rovers", str(ROVERS), "--link", link, *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=pipe, stderr=pipe, text=True) as script:
        try:
            yield script
        finally:
            script.kill()


def test_each_drives_and_is_disarmed(fleet):
    with driving(fleet.udp, "--seconds", "2") as script:
        wait_until_armed(fleet, ROVERS)
        assert script.communicate(timeout=20) == (f"{ROVERS} rovers have recorded a drive\n", "")
        assert script.returncode == 0
    wait_until_armed(fleet, 0)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_none_stays_armed_after_ctrl_c(fleet, number):
    with driving(fleet.udp) as script:
        wait_until_armed(fleet, ROVERS)
        script.send_signal(number)
        time.sleep(0.3)
        script.send_signal(number)
        assert script.communicate(timeout=15) == ("", "Interrupted.\n")
        assert script.returncode == 1
    wait_until_armed(fleet, 0)


def test_none_stays_armed_beside_one_that_refuses(fleet):
    station = mavutil.mavlink_connection(fleet.udp, source_system=255)
    answer = None
    # It is known where a rover is once it has been heard.
    while not answer:
        station.mav.param_set_send(2, 1, b"BATT_ARM_VOLT", 20, mavutil.mavlink.MAV_PARAM_TYPE_REAL32)
        answer = station.recv_match(type="PARAM_VALUE", blocking=True, timeout=0.5)
    station.close()
    with driving(fleet.udp) as script:
        wait_until_armed(fleet, ROVERS - 1)
        assert script.communicate(timeout=40) == ("", "not armed: rover 2\n")
        assert script.returncode == 1
    wait_until_armed(fleet, 0)


def test_a_rover_that_may_still_be_armed_is_named(fleet):
    with driving(fleet.udp) as script:
        wait_until_armed(fleet, ROVERS)
        fleet.suspend()
        script.send_signal(signal.SIGINT)
        begin = time.monotonic()
        _, errors = script.communicate(timeout=15)
        assert 9 < time.monotonic() - begin < 12
        named = "rover 1, rover 2, rover 3"
        assert errors == f"Interrupted.\nSTILL ARMED, or not heard any more: {named}\n"
        assert script.returncode == 1
    fleet.resume()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--rovers", "0"], "1 to 255"),
        (["--seconds", "nan"], "more than 0 s"),
        (["--link", "tcp:127.0.0.1:1"], "Can't open tcp:127.0.0.1:1: "),
        (["--link", "udpin:port"], "Can't open udpin:port: "),
    ],
)
def test_what_does_not_fit_is_explained(arguments, expected):
    with driving("udpin:127.0.0.1:0", *arguments) as script:
        _, errors = script.communicate(timeout=20)
        assert script.returncode == 2 and expected in errors and "Traceback" not in errors, errors


def test_ctrl_c_while_none_is_heard():
    with driving("udpin:127.0.0.1:0") as script:
        time.sleep(1.5)
        script.send_signal(signal.SIGINT)
        assert script.communicate(timeout=5) == ("", "Interrupted.\n")
        assert script.returncode == 1
