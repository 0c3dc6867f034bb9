"""examples/record.py makes recordings that `replay` takes."""

import csv
import os
import pty
import signal
import subprocess
import sys
import time

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY
from station import command, connect, messages_of, set_to

mavlink = mavutil.mavlink

SCRIPT = REPOSITORY / "examples" / "record.py"
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def replay(path, *parameters):
    """What `replay` says of the drive."""
    arguments = [argument for parameter in parameters for argument in ("--param", parameter)]
    run = ["cargo", "run", "--quiet", "--bin", "replay", "--", *arguments, str(path)]
    output = subprocess.run(run, cwd=REPOSITORY, check=True, capture_output=True, text=True).stdout
    return [row["events"] for row in csv.DictReader(output.splitlines()) if row["events"]]


def test_a_terminal_is_shown_words_and_no_rows():
    trace = REPOSITORY / "tests" / "data" / "traces" / "trace_failsafe_voltage.csv"
    run = ["cargo", "run", "--quiet", "--bin", "replay", "--", str(trace)]
    terminal, program = pty.openpty()
    ends = {"stdout": program, "stderr": subprocess.PIPE}
    said = subprocess.run(run, cwd=REPOSITORY, check=True, timeout=60, text=True, **ends).stderr
    os.close(program)
    with pytest.raises(OSError):  # Nothing was written before the other end was closed.
        os.read(terminal, 1)
    os.close(terminal)
    assert said.startswith("1 min 10 s, ")


def test_a_log_of_a_ground_station_becomes_a_recording(start_simulator, tmp_path):
    vehicle = connect(start_simulator().url)
    vehicle.setup_logfile(str(tmp_path / "mav.tlog"))
    for name, value in [("SR0_EXTRA1", 10), ("BATT_CELLS", 3)]:
        set_to(vehicle, name, value)
    messages_of(vehicle, 1)
    assert command(vehicle, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ACCEPTED
    # Half-way between two tenths, whatever the noise.
    set_to(vehicle, "SIM_BATT_VOLTAGE", 9.95)
    messages_of(vehicle, 4)
    vehicle.logfile.close()
    vehicle.close()

    drive = tmp_path / "drive.csv"
    subprocess.run([sys.executable, SCRIPT, tmp_path / "mav.tlog", drive], check=True, timeout=20)
    recorded = rows(drive)
    assert 40 <= len(recorded) <= 80
    assert (recorded[0]["armed"], recorded[-1]["armed"]) == ("0", "1")
    assert all(row["current_a"] == "" for row in recorded)
    known = [float(row["voltage_v"]) for row in recorded if row["voltage_v"]]
    assert max(known) > 12.4 and known[-1] < 10.1
    (event,) = replay(drive, "BATT_CELLS=3", "BATT_LOW_VOLT=10.5", "BATT_LOW_TIMER=1")
    assert event.startswith("is low 9.9")


def test_a_link_is_recorded_until_ctrl_c(start_simulator, tmp_path):
    drive = tmp_path / "drive.csv"
    run = [sys.executable, SCRIPT, start_simulator().url, drive]
    with subprocess.Popen(run, env={**os.environ, "PYTHONUNBUFFERED": "1"}) as recorder:
        time.sleep(5)
        recorder.send_signal(signal.SIGINT)
        assert recorder.wait(timeout=10) == 0
    assert len(rows(drive)) >= 4
