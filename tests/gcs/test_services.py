"""What ground stations ask for beside parameters: rates, single messages, versions, the time. Which request has which
answer is shown on the core: `tests/host/endpoint.rs` and `src/mavlink/`.
"""

import math
import struct
import time

import pytest
from pymavlink import mavutil

from conftest import free_port
from station import command, command_int, connect, count, is_about, messages_of, receive

mavlink = mavutil.mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED

SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
GET_INTERVAL = mavlink.MAV_CMD_GET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE

BATTERY_STATUS = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
ATTITUDE = mavlink.MAVLINK_MSG_ID_ATTITUDE
AUTOPILOT_VERSION = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
# pymavlink 2.4.50 doesn't know these by name.
PROTOCOL_VERSION = 300


@pytest.fixture
def vehicle(start_simulator):
    return connect(start_simulator().url)


def payload_of(unknown, length):
    """The payload of a message pymavlink doesn't know: MAVLink 2 leaves zeros at its end out."""
    frame = unknown.data
    return bytes(frame[mavlink.HEADER_LEN_V2 : mavlink.HEADER_LEN_V2 + frame[1]]).ljust(length, b"\0")


def interval_of(vehicle, message_id):
    assert command(vehicle, GET_INTERVAL, message_id) == ACCEPTED
    answer = receive(vehicle, ["MESSAGE_INTERVAL"])
    assert answer.message_id == message_id
    return answer.interval_us


@pytest.mark.board
def test_a_set_interval_is_kept_reported_and_put_back(vehicle):
    assert interval_of(vehicle, BATTERY_STATUS) == 500_000
    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS, 100_000) == ACCEPTED
    assert interval_of(vehicle, BATTERY_STATUS) == 100_000
    messages = messages_of(vehicle, 4)
    assert is_about(count(messages, "BATTERY_STATUS") / 4, 10), "the new rate"
    assert count(messages, "SYS_STATUS") in (7, 8, 9), "the other message keeps its own"
    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS, 0) == ACCEPTED
    assert interval_of(vehicle, BATTERY_STATUS) == 500_000


@pytest.mark.board
def test_what_can_not_be_is_refused(vehicle):
    for send in (command, command_int):
        for value in (math.nan, math.inf, -math.inf):
            assert send(vehicle, SET_INTERVAL, BATTERY_STATUS, value) == DENIED, value
            assert send(vehicle, SET_INTERVAL, value, 100_000) == DENIED, value
        assert send(vehicle, SET_INTERVAL, ATTITUDE, 100_000) == UNSUPPORTED
        assert send(vehicle, REQUEST, ATTITUDE) == UNSUPPORTED


@pytest.mark.board
def test_versions(vehicle):
    assert command(vehicle, mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 1) == ACCEPTED
    version = receive(vehicle, ["AUTOPILOT_VERSION"])
    for capability in (
        mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2,
        mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST,
        mavlink.MAV_PROTOCOL_CAPABILITY_FTP,
    ):
        assert version.capabilities & capability
    assert not version.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert version.flight_sw_version != 0

    assert command(vehicle, REQUEST, PROTOCOL_VERSION) == ACCEPTED
    versions = struct.unpack_from("<3H", payload_of(receive(vehicle, ["UNKNOWN_300"]), 6))
    assert versions == (200, 100, 200), "2 is sent, 1 is understood"

    # DroneKit asks everyone.
    vehicle.mav.command_long_send(0, 0, mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES, 0, 1, 0, 0, 0, 0, 0, 0)
    receive(vehicle, ["AUTOPILOT_VERSION"])


@pytest.mark.board
def test_ping(vehicle):
    vehicle.mav.ping_send(123_456_789_012, 7, 0, 0)
    answer = receive(vehicle, ["PING"])
    assert (answer.time_usec, answer.seq) == (123_456_789_012, 7)
    assert (answer.target_system, answer.target_component) == (vehicle.mav.srcSystem, vehicle.mav.srcComponent)


@pytest.mark.board
def test_timesync(vehicle):
    times = []
    for sent in (2**62, 123):
        vehicle.mav.timesync_send(0, sent)
        answer = receive(vehicle, ["TIMESYNC"])
        assert answer.ts1 == sent
        times.append((answer.tc1, time.monotonic_ns()))
        time.sleep(1)
    vehicle_time, wall_time = (times[-1][i] - times[0][i] for i in (0, 1))
    assert vehicle_time == pytest.approx(wall_time, rel=0.15)


def test_a_ground_station_on_udp_may_come_late_and_come_back(start_simulator):
    udp_port = free_port()
    start_simulator("--udp", f"127.0.0.1:{udp_port}")
    time.sleep(1)  # No station listens.
    for _ in range(2):
        connection = connect(f"udpin:127.0.0.1:{udp_port}")
        assert count(messages_of(connection, 1), "BATTERY_STATUS") in (1, 2, 3)
        assert connection.mav_loss == 0
        assert command(connection, GET_INTERVAL, BATTERY_STATUS) == ACCEPTED
        connection.close()
        time.sleep(1)
