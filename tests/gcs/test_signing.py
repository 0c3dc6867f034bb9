"""Message signing with the other ends that do it: pymavlink and MAVProxy.

TCP stands for the cable, UDP for the radio.
"""

import hashlib
import time

import pytest
from pymavlink import mavutil

from conftest import free_port
from station import connect, messages_of, read, receive, set_to, unread_messages_of
from test_mavproxy import MavProxy

mavlink = mavutil.mavlink

KEY = hashlib.sha256(b"a good passphrase").digest()
OTHER_KEY = hashlib.sha256(b"a guess").digest()
NO_KEY = bytes(32)

START_OF_2015 = 1_420_070_400


def ticks_now():
    """The time as signatures have it."""
    return int((time.time() - START_OF_2015) * 100_000)


class Vehicle:
    """A simulator, a cable to it, and a radio."""

    def __init__(self, start_simulator, *arguments):
        self.udp_port = free_port()
        self.simulator = start_simulator("--udp", f"127.0.0.1:{self.udp_port}", *arguments)
        self.cable = connect(self.simulator.url)
        self.radio = connect(f"udpin:127.0.0.1:{self.udp_port}")

    def set_up(self, key):
        self.cable.mav.setup_signing_send(1, 1, list(key), ticks_now() if any(key) else 0)
        text = "Signing key set" if any(key) else "Signing key removed"
        wait_for_text(self.cable, text)


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


def test_another_key_opens_nothing(vehicle):
    vehicle.radio.setup_signing(OTHER_KEY, sign_outgoing=True, allow_unsigned_callback=lambda *_: True)
    vehicle.radio.mav.param_request_read_send(1, 1, b"BATT_LOW_VOLT", -1)
    # What comes is signed with a key this station does not have.
    messages = unread_messages_of(vehicle.radio, 2)
    assert "PARAM_VALUE" not in {message.get_type() for message in messages}
    texts = [message.text for message in messages if message.get_type() == "STATUSTEXT"]
    assert any(text.endswith("not signed with the key, ignored: 1") for text in texts), texts


def test_everything_that_comes_is_signed_and_its_time_only_grows(vehicle):
    sign_with(vehicle.radio, KEY)
    messages = messages_of(vehicle.radio, 3)
    assert len(messages) > 10
    assert all(message.get_signed() for message in messages)
    links = {message.get_link_id() for message in messages}
    assert len(links) == 1
    assert "BAD_DATA" not in {message.get_type() for message in messages}, "pymavlink checks the times, too"


def test_a_recording_is_not_obeyed(vehicle):
    sign_with(vehicle.radio, KEY)
    recorded = vehicle.radio.mav.param_set_encode(1, 1, b"BATT_LOW_VOLT", 10.5, 9).pack(vehicle.radio.mav)
    vehicle.radio.write(recorded)
    assert receive(vehicle.radio, ["PARAM_VALUE"]).param_value == 10.5
    assert set_to(vehicle.radio, "BATT_LOW_VOLT", 10.75).param_value == 10.75
    vehicle.radio.write(recorded)
    assert "PARAM_VALUE" not in {message.get_type() for message in messages_of(vehicle.radio, 1)}
    assert read(vehicle.radio, "BATT_LOW_VOLT").param_value == 10.75


def test_a_key_is_set_up_by_cable_only_and_goes_nowhere_else(start_simulator):
    vehicle = Vehicle(start_simulator)
    vehicle.radio.mav.setup_signing_send(1, 1, list(OTHER_KEY), ticks_now())
    wait_for_text(vehicle.radio, "Signing is set up by USB only")
    assert not is_deaf(vehicle.radio)
    vehicle.set_up(KEY)
    heard = messages_of(vehicle.radio, 2)
    assert "SETUP_SIGNING" not in {message.get_type() for message in heard}
    assert all(KEY[:8] not in bytes(message.get_msgbuf()) for message in heard)


def test_the_key_and_the_time_outlast_a_restart(start_simulator, tmp_path):
    flash = str(tmp_path / "flash")
    vehicle = Vehicle(start_simulator, "--flash", flash)
    vehicle.set_up(KEY)
    sign_with(vehicle.radio, KEY)
    recorded = vehicle.radio.mav.param_set_encode(1, 1, b"BATT_LOW_VOLT", 10.5, 9).pack(vehicle.radio.mav)
    vehicle.radio.write(recorded)
    assert receive(vehicle.radio, ["PARAM_VALUE"]).param_value == 10.5
    # Values are live before they are saved.
    messages_of(vehicle.radio, 1)
    # pymavlink's time follows the vehicle's.
    latest = vehicle.radio.mav.signing.timestamp
    vehicle.simulator.interrupt()
    vehicle.radio.close()

    again = Vehicle(start_simulator, "--flash", flash)
    assert is_deaf(again.radio), "the key is still there"
    again.radio.write(recorded)
    assert "PARAM_VALUE" not in {message.get_type() for message in messages_of(again.radio, 1)}
    sign_with(again.radio, KEY)
    # It has to hear from the vehicle first: its own time may be behind.
    assert again.radio.wait_heartbeat(timeout=3) is not None
    assert again.radio.mav.signing.timestamp > latest, "the vehicle's time went on"
    assert read(again.radio, "BATT_LOW_VOLT").param_value == 10.5


def test_a_key_that_was_removed_protects_nothing_any_more(vehicle):
    vehicle.set_up(NO_KEY)
    assert not is_deaf(vehicle.radio)
    assert not any(message.get_signed() for message in messages_of(vehicle.radio, 2))


def test_a_ground_station_without_the_key_is_warned_once_a_minute(vehicle):
    texts = []
    for _ in range(20):
        vehicle.radio.mav.param_request_read_send(1, 1, b"BATT_LOW_VOLT", -1)
        said = vehicle.radio.recv_match(type="STATUSTEXT", blocking=True, timeout=0.1)
        texts += [said.text] if said else []
    assert [text for text in texts if "ignored" in text] == ["UDP: not signed with the key, ignored: 1"]


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
