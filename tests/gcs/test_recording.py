"""A log of a ground station is a recording that `replay` takes."""

import csv
import os
import pty
import subprocess

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY
from station import command, connect, messages_of, set_to

mavlink = mavutil.mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


def replay(path, *parameters):
    """The rows of `replay`, and what it says of the drive."""
    arguments = [argument for parameter in parameters for argument in ("--param", parameter)]
    run = ["cargo", "run", "--quiet", "--bin", "replay", "--", *arguments, str(path)]
    done = subprocess.run(run, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    return list(csv.DictReader(done.stdout.splitlines())), done.stderr


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


def test_a_log_of_a_ground_station_is_replayed(start_simulator, tmp_path):
    vehicle = connect(start_simulator().url)
    log = tmp_path / "mav.tlog"
    vehicle.setup_logfile(str(log))
    for name, value in [("SR0_EXTRA1", 10), ("BATT_CELLS", 3)]:
        set_to(vehicle, name, value)
    messages_of(vehicle, 1)
    assert command(vehicle, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == ACCEPTED
    # Half-way between two tenths, whatever the noise.
    set_to(vehicle, "SIM_BATT_VOLTAGE", 9.95)
    messages_of(vehicle, 4)
    vehicle.logfile.close()
    vehicle.close()

    recorded, said = replay(log, "BATT_LOW_VOLT=10.5", "BATT_LOW_TIMER=1")
    reader = mavutil.mavlink_connection(str(log))
    counted = 0
    while reader.recv_match(type="BATTERY_STATUS", condition="BATTERY_STATUS.id==0"):
        counted += 1
    assert len(recorded) == counted and 40 <= counted <= 80
    known = [float(row["voltage_v"]) for row in recorded if row["voltage_v"]]
    assert max(known) > 12.4 and known[-1] < 10.1
    (event,) = [row["events"] for row in recorded if row["events"].startswith("is low")]
    assert event.startswith("is low 9.9")
    assert "rover" in said.splitlines()[0]
