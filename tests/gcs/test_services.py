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
SMART_BATTERY_INFO = mavlink.MAVLINK_MSG_ID_SMART_BATTERY_INFO
# pymavlink 2.4.50 doesn't know these by name.
PROTOCOL_VERSION = 300
BATTERY_STATUS_V2 = 369
BATTERY_INFO = 372


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


def test_what_is_not_streamed_comes_on_request(vehicle):
    for send in (command, command_int):
        for message_id, name in [
            (AUTOPILOT_VERSION, "AUTOPILOT_VERSION"),
            (PROTOCOL_VERSION, "UNKNOWN_300"),
            (BATTERY_STATUS_V2, "UNKNOWN_369"),
            (SMART_BATTERY_INFO, "SMART_BATTERY_INFO"),
            (BATTERY_INFO, "UNKNOWN_372"),
        ]:
            assert send(vehicle, REQUEST, message_id, 0) == ACCEPTED, name
            receive(vehicle, [name])
        assert send(vehicle, REQUEST, BATTERY_STATUS, 1) == DENIED, "there is no second battery"


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


@pytest.fixture
def two_links(start_simulator):
    udp_port = free_port()
    simulator = start_simulator("--udp", f"127.0.0.1:{udp_port}")
    return connect(simulator.url), connect(f"udpin:127.0.0.1:{udp_port}")


def test_answers_go_only_where_the_request_came_from(two_links):
    for asking, other in (two_links, two_links[::-1]):
        while other.recv_match(blocking=False):
            pass
        asking.mav.ping_send(1, 1, 0, 0)
        receive(asking, ["PING"])
        asking.mav.timesync_send(0, 1)
        receive(asking, ["TIMESYNC"])
        assert command(asking, GET_INTERVAL, BATTERY_STATUS) == ACCEPTED
        receive(asking, ["MESSAGE_INTERVAL"])
        assert command(asking, REQUEST, AUTOPILOT_VERSION) == ACCEPTED
        receive(asking, ["AUTOPILOT_VERSION"])
        asking.mav.param_request_read_send(1, 1, b"SR0_EXTRA1", -1)
        receive(asking, ["PARAM_VALUE"])
        time.sleep(0.5)
        while message := other.recv_match(blocking=False):
            assert message.get_type() in ("HEARTBEAT", "SYS_STATUS", "BATTERY_STATUS", "STATUSTEXT"), message


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
