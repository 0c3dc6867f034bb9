"""A pack that a companion computer feeds: examples/external_pack.py, as its user starts it."""

import hashlib
import subprocess
import sys
import time

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY
from station import Background, connect, fresh, messages_of, restarted, set_to, volts
from test_signing import Vehicle

mavlink = mavutil.mavlink

SCRIPT = REPOSITORY / "examples" / "external_pack.py"

EXTERNAL = 29

OK = mavlink.MAV_BATTERY_CHARGE_STATE_OK
UNHEALTHY = mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY


class Companion:
    """The script, to which a sensor writes a line ten times a second."""

    def __init__(self, url, line, *arguments):
        self.line = line
        self.process = subprocess.Popen(
            [sys.executable, SCRIPT, url, "--readings", "-", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout.readline().startswith("Feeding pack 1 of system 1.")
        self.sensor = Background(self.measure)

    def measure(self):
        self.process.stdin.write(f"{self.line}\n")
        self.process.stdin.flush()
        time.sleep(0.1)

    def __enter__(self):
        self.sensor.__enter__()
        return self

    def __exit__(self, *error):
        self.sensor.__exit__(*error)
        self.process.stdin.close()
        assert self.process.wait(timeout=5) == 0


def texts_within(connection, seconds):
    return [m.text for m in messages_of(connection, seconds) if m.get_type() == "STATUSTEXT"]


def set_up(connection, url):
    parameters = {"BATT_MONITOR": EXTERNAL, "BATT_CELLS": 3}
    for name, value in parameters.items():
        assert set_to(connection, name, value).param_value == value, name
    return restarted(connection, url)


# Requirement: AP-11
def test_readings_and_silence_of_a_pack_that_the_script_feeds(start_simulator):
    simulator = start_simulator()
    station = set_up(connect(simulator.url), simulator.url)
    with Companion(simulator.url, "12.0,2.5,70") as companion:
        time.sleep(1)
        status = fresh(station, "BATTERY_STATUS")
        assert (volts(status), status.current_battery, status.battery_remaining) == (12.0, 250, 70)
        assert status.charge_state == OK and status.current_consumed >= 0
        companion.line = "11.9,1.0,68"
        time.sleep(0.5)
        assert volts(fresh(station, "BATTERY_STATUS")) == 11.9
        # The sensor is lost, the script goes on.
        companion.line = ",,"
        texts = texts_within(station, 3.5)
        assert "Battery 1 unhealthy: no reading in time" in texts
        status = fresh(station, "BATTERY_STATUS")
        assert (volts(status), status.charge_state) == (11.9, UNHEALTHY)


def test_with_a_key_only_the_script_that_has_it_feeds_the_pack(start_simulator):
    vehicle = Vehicle(start_simulator)
    vehicle.radio.close()
    vehicle.cable = set_up(vehicle.cable, vehicle.simulator.url)
    vehicle.set_up(hashlib.sha256(b"a good passphrase").digest())
    radio = f"udpin:127.0.0.1:{vehicle.udp_port}"
    with Companion(radio, "12.0"):
        texts = texts_within(vehicle.cable, 4)
        assert any("not signed with the key, ignored" in text for text in texts), texts
        assert fresh(vehicle.cable, "BATTERY_STATUS").voltages[0] == 65535
    with Companion(radio, "12.0", "--passphrase", "a good passphrase"):
        time.sleep(1.5)
        assert volts(fresh(vehicle.cable, "BATTERY_STATUS")) == 12.0


@pytest.mark.parametrize(
    ("arguments", "error"),
    [(["--voltage", "12", "--pack", "10"], "--pack"), (["--voltage", "12", "--rate", "0.5"], "at least 1 Hz"), ([], "--voltage")],
)
def test_wrong_arguments_are_refused(arguments, error):
    ended = subprocess.run(
        [sys.executable, SCRIPT, "tcp:127.0.0.1:1", *arguments], capture_output=True, text=True, timeout=20
    )
    assert ended.returncode == 2 and error in ended.stderr


def test_voltage_above_one_field_goes_on_in_the_next():
    fields = "import external_pack; print(external_pack.voltage_fields(74.0), external_pack.voltage_fields(0.0))"
    ended = subprocess.run(
        [sys.executable, "-B", "-c", fields], cwd=SCRIPT.parent, capture_output=True, text=True, timeout=20
    )
    unknown = ", 65535"
    assert ended.stdout == f"[65534, 8466{unknown * 8}] [0{unknown * 9}]\n", ended
