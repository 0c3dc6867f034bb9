"""Clients that misbehave: another one notices nothing of them."""

import contextlib
import random
import socket
import struct
import time

import pytest
from pymavlink import mavutil

from station import Background, connect, count, is_about, messages_of, read, set_to

mavlink = mavutil.mavlink

# One at a time: several of them would leave the watcher no processor.
pytestmark = pytest.mark.xdist_group("unruly")

WATCHED_SECONDS = 5
RATE_HZ = 10


@pytest.fixture
def simulator(start_simulator):
    return start_simulator()


def open_socket(simulator, receive_buffer=None):
    client = socket.socket()
    if receive_buffer:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    client.connect(("127.0.0.1", simulator.port))
    return client


def some_requests():
    """Every request that is answered, as bytes."""
    station = mavlink.MAVLink(None, srcSystem=254, srcComponent=190)
    return [
        message.pack(station)
        for message in (
            station.param_request_list_encode(1, 1),
            station.param_request_read_encode(1, 1, b"SR0_EXTRA1", -1),
            station.param_set_encode(1, 1, b"BATT_VOLT_MULT", 1000.0, mavlink.MAV_PARAM_TYPE_REAL32),
            station.command_long_encode(1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, 148, 0, 0, 0, 0, 0, 0),
            station.command_long_encode(1, 1, 65535, 0, 0, 0, 0, 0, 0, 0, 0),
            station.ping_encode(1, 1, 0, 0),
            station.timesync_encode(0, 1),
            station.file_transfer_protocol_encode(0, 1, 1, bytes(251)),
        )
    ]


def well_served(simulator):
    """A connection that watches at a rate of its own."""
    connection = connect(simulator.url)
    assert set_to(connection, "SR0_EXTRA1", RATE_HZ).param_value == RATE_HZ
    return connection


def assert_well_served(connection):
    messages = messages_of(connection, WATCHED_SECONDS)
    assert count(messages, "BAD_DATA") == 0
    numbers = [message.get_seq() for message in messages]
    expected = [(numbers[0] + i) % 256 for i in range(len(numbers))]
    assert numbers == expected
    for name in ("BATTERY_STATUS", "SYS_STATUS"):
        hertz = count(messages, name) / WATCHED_SECONDS
        assert is_about(hertz, RATE_HZ), (name, hertz)
    assert 4 <= count(messages, "HEARTBEAT") <= 6
    assert read(connection, "SR0_EXTRA1").param_value == RATE_HZ


def test_one_that_stops_reading(simulator):
    watcher = well_served(simulator)
    stuck = open_socket(simulator, receive_buffer=4096)
    stuck.setblocking(False)
    requests = b"".join(some_requests())

    def ask_and_never_read():
        try:
            stuck.send(requests)
        except BlockingIOError:
            pass
        time.sleep(0.001)

    with Background(ask_and_never_read):
        assert_well_served(watcher)
    # It is served again when it reads again. A request is repeated: one that fell into a part of another is lost with it.
    stuck.settimeout(1)
    parser = mavlink.MAVLink(None, srcSystem=254, srcComponent=190)
    parser.robust_parsing = True
    answer = None
    end = time.monotonic() + 15
    while answer is None and time.monotonic() < end:
        with contextlib.suppress(BlockingIOError, TimeoutError):
            stuck.sendall(parser.ping_encode(1, 4711, 0, 0).pack(parser))
        with contextlib.suppress(TimeoutError):
            messages = parser.parse_buffer(stuck.recv(65536)) or []
            pings = (message for message in messages if message.get_type() == "PING")
            answer = next((ping for ping in pings if ping.seq == 4711), None)
    assert answer
    stuck.close()


MAX_CLIENTS = 8

ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED


def arm_and_drive():
    station = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    arm = station.command_long_encode(1, 1, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)
    drives = [station.manual_control_encode(1, 0, 0, throttle, 0, 0) for throttle in (0, 1000)]
    return b"".join(message.pack(station) for message in (arm, *drives))


def received_until_the_end(client):
    """The messages that come until the other end closes the connection."""
    client.settimeout(3)
    received = b""
    while part := client.recv(4096):
        received += part
    return mavlink.MAVLink(None).parse_buffer(received) or []


def test_one_too_many_is_refused_with_a_reason_and_never_obeyed(simulator):
    served = [open_socket(simulator) for _ in range(MAX_CLIENTS)]
    for client in served:
        client.settimeout(3)
        assert client.recv(4096), "it is served"

    for _ in range(3):
        refused = open_socket(simulator)
        refused.sendall(arm_and_drive())
        (text,) = received_until_the_end(refused)
        assert text.get_type() == "STATUSTEXT", text
        assert (text.text, text.severity) == ("Simulator: all 8 links are in use", mavlink.MAV_SEVERITY_ERROR)
        assert (text.get_srcSystem(), text.get_srcComponent()) == (1, 1)

    served[0].close()
    time.sleep(0.5)
    watcher = connect(simulator.url)
    states = [message.base_mode for message in messages_of(watcher, 2) if message.get_type() == "HEARTBEAT"]
    assert states and not any(state & ARMED for state in states), states
    assert read(watcher, "SR0_EXTRA1").get_type() == "PARAM_VALUE"


@pytest.mark.parametrize("abruptly", [False, True])
def test_one_that_disconnects_in_the_middle_of_a_frame(simulator, abruptly):
    watcher = well_served(simulator)
    requests = some_requests()
    dice = random.Random(2)

    def connect_and_go():
        client = open_socket(simulator)
        if abruptly:  # A reset instead of a proper end.
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        frame = dice.choice(requests)
        client.sendall(frame[: dice.randrange(1, len(frame))])
        time.sleep(dice.choice([0, 0.02]))
        client.close()
        time.sleep(0.02)

    with Background(connect_and_go):
        assert_well_served(watcher)
    # Half a frame of one client isn't continued by the next.
    assert read(connect(simulator.url), "SR0_EXTRA1").param_value == RATE_HZ
