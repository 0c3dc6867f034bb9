"""Message signing with the other ends that do it: pymavlink and MAVProxy.

TCP stands for the cable, UDP for the radio. Whose frames count is shown on the core, `tests/host/signing.rs`; what flash keeps,
on the release firmware, `tests/firmware/signing.rs`.
"""

import hashlib
import time

import pytest
from pymavlink import mavutil

from conftest import free_port
from station import connect, messages_of, read, receive, set_to
from test_mavproxy import MavProxy

mavlink = mavutil.mavlink

KEY = hashlib.sha256(b"a good passphrase").digest()

START_OF_2015 = 1_420_070_400


def ticks_now():
    """The time as signatures have it."""
    return int((time.time() - START_OF_2015) * 100_000)


class Vehicle:
    """A simulator, a cable to it, and a radio."""

    def __init__(self, start_simulator):
        self.udp_port = free_port()
        self.simulator = start_simulator("--udp", f"127.0.0.1:{self.udp_port}")
        self.cable = connect(self.simulator.url)
        self.radio = connect(f"udpin:127.0.0.1:{self.udp_port}")

    def set_up(self, key):
        self.cable.mav.setup_signing_send(1, 1, list(key), ticks_now())
        wait_for_text(self.cable, "Signing key set")


def wait_for_text(connection, text):
    end = time.monotonic() + 3
    while time.monotonic() < end:
        if text in receive(connection, ["STATUSTEXT"]).text:
            return
    raise AssertionError(f"{text} was never said")


def sign_with(connection, key):
    connection.setup_signing(key, sign_outgoing=True, allow_unsigned_callback=lambda *_: False)
    # What was sent unsigned before the key was known.
    messages_of(connection, 0.5)


def is_deaf(connection, seconds=1):
    """Whether a parameter can't even be read."""
    connection.mav.param_request_read_send(1, 1, b"BATT_LOW_VOLT", -1)
    names = [message.get_type() for message in messages_of(connection, seconds)]
    assert "SYS_STATUS" in names, "telemetry goes on"
    return "PARAM_VALUE" not in names


@pytest.fixture
def vehicle(start_simulator):
    vehicle = Vehicle(start_simulator)
    vehicle.set_up(KEY)
    return vehicle


def test_only_signed_commands_are_obeyed(vehicle):
    assert is_deaf(vehicle.radio), "without a key"
    sign_with(vehicle.radio, KEY)
    assert set_to(vehicle.radio, "BATT_LOW_VOLT", 10.5).param_value == 10.5
    vehicle.radio.disable_signing()
    assert is_deaf(vehicle.radio), "without a key again"


def test_everything_that_comes_is_signed_and_its_time_only_grows(vehicle):
    sign_with(vehicle.radio, KEY)
    messages = messages_of(vehicle.radio, 2)
    assert len(messages) > 6
    assert all(message.get_signed() for message in messages)
    links = {message.get_link_id() for message in messages}
    assert len(links) == 1
    assert "BAD_DATA" not in {message.get_type() for message in messages}, "pymavlink checks the times, too"


@pytest.mark.xdist_group("mavproxy")
def test_mavproxy_sets_up_signing_and_removes_it(start_simulator, tmp_path):
    udp_port = free_port()
    simulator = start_simulator("--udp", f"127.0.0.1:{udp_port}")
    radio = connect(f"udpin:127.0.0.1:{udp_port}")
    mavproxy = MavProxy(simulator.url, tmp_path, "--streamrate=-1")
    try:
        mavproxy.ask("signing setup secret", r"Signing key set", timeout=10)
        assert is_deaf(radio)
        mavproxy.type("param set BATT_LOW_VOLT 10.5")
        time.sleep(1)
        assert mavproxy.show("BATT_LOW_VOLT") == 10.5, "MAVProxy signs and reads what is signed"
        sign_with(radio, hashlib.sha256(b"secret").digest())
        assert read(radio, "BATT_LOW_VOLT").param_value == 10.5, "the same passphrase is the same key"
        radio.disable_signing()

        mavproxy.type("signing remove")
        # On a busy machine it takes MAVProxy a while.
        assert any(not is_deaf(radio) for _ in range(10))
    finally:
        mavproxy.kill()
