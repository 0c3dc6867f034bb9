"""What ground stations ask for beside parameters: rates, single messages, versions, the time."""

import math
import struct
import time

import pytest
from pymavlink import mavutil

from conftest import free_port
from station import command, command_int, connect, count, is_about, messages_of, rate_of, receive, set_to

mavlink = mavutil.mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED

SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
GET_INTERVAL = mavlink.MAV_CMD_GET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE

SYS_STATUS = mavlink.MAVLINK_MSG_ID_SYS_STATUS
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
def test_a_set_interval_is_kept_and_reported(vehicle):
    assert interval_of(vehicle, BATTERY_STATUS) == 500_000
    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS, 100_000) == ACCEPTED
    assert interval_of(vehicle, BATTERY_STATUS) == 100_000
    messages = messages_of(vehicle, 4)
    assert is_about(count(messages, "BATTERY_STATUS") / 4, 10), "the new rate"
    assert is_about(count(messages, "SYS_STATUS") / 4, 2), "the other message keeps its own"


@pytest.mark.board
def test_minus_one_turns_off_and_zero_restores_the_default(vehicle):
    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS, -1) == ACCEPTED
    assert interval_of(vehicle, BATTERY_STATUS) == -1
    messages = messages_of(vehicle, 2)
    assert count(messages, "BATTERY_STATUS") == 0
    assert count(messages, "SYS_STATUS") >= 3

    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS, 0) == ACCEPTED
    assert interval_of(vehicle, BATTERY_STATUS) == 500_000
    assert is_about(rate_of(vehicle, "BATTERY_STATUS"), 2)


@pytest.mark.board
@pytest.mark.parametrize("send", [command, command_int])
def test_bad_intervals_are_denied_and_change_nothing(vehicle, send):
    for interval_us in (-2, 1, math.nan, math.inf, -math.inf):
        assert send(vehicle, SET_INTERVAL, BATTERY_STATUS, interval_us) == DENIED, interval_us
    for message_id in (-1, 0.5, math.nan, 1e9):
        assert send(vehicle, SET_INTERVAL, message_id, 100_000) == DENIED, message_id
    assert interval_of(vehicle, BATTERY_STATUS) == 500_000


@pytest.mark.board
@pytest.mark.parametrize("send", [command, command_int])
def test_messages_it_does_not_send_are_unsupported(vehicle, send):
    for message_id in (ATTITUDE, mavlink.MAVLINK_MSG_ID_HOME_POSITION):
        assert send(vehicle, SET_INTERVAL, message_id, 100_000) == UNSUPPORTED, message_id
        assert send(vehicle, REQUEST, message_id) == UNSUPPORTED, message_id
    assert interval_of(vehicle, ATTITUDE) == 0, "not available"


@pytest.mark.board
def test_a_ground_station_moves_over_to_battery_status_v2(vehicle):
    """What QGroundControl does."""
    newer = ("UNKNOWN_369", "UNKNOWN_372", "SMART_BATTERY_INFO")
    messages = messages_of(vehicle, 2)
    assert count(messages, "BATTERY_STATUS") >= 3
    assert sum(count(messages, name) for name in newer) == 0, "nothing new comes unasked"

    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS_V2, 100_000) == ACCEPTED
    assert command(vehicle, SET_INTERVAL, BATTERY_INFO, 500_000) == ACCEPTED
    messages = messages_of(vehicle, 4)
    for name, hertz in [("UNKNOWN_369", 10), ("UNKNOWN_372", 2), ("BATTERY_STATUS", 2), ("SMART_BATTERY_INFO", 0)]:
        assert is_about(count(messages, name) / 4, hertz), name

    assert command(vehicle, SET_INTERVAL, BATTERY_STATUS, -1) == ACCEPTED
    messages = messages_of(vehicle, 4)
    assert count(messages, "BATTERY_STATUS") == 0
    assert is_about(count(messages, "UNKNOWN_369") / 4, 10)


@pytest.fixture
def vehicle_with_current_sensor(start_simulator):
    """The current sensor takes a restart."""
    url = start_simulator().url
    vehicle = connect(url)
    for name, value in [("BATT_CURR_PIN", 27), ("BATT_CAPACITY", 2200), ("BATT_MONITOR", 4)]:
        assert set_to(vehicle, name, value).param_value == value
    assert command(vehicle, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
    # The connection ends with the vehicle that has been switched off.
    while vehicle.recv_match(blocking=True, timeout=0.5) is not None:
        pass
    vehicle.close()
    return connect(url)


def test_both_battery_statuses_agree(vehicle_with_current_sensor):
    vehicle = vehicle_with_current_sensor
    while receive(vehicle, ["BATTERY_STATUS"]).battery_remaining == -1:
        pass  # Nothing has been measured yet.
    assert command(vehicle, REQUEST, BATTERY_STATUS) == ACCEPTED
    old = receive(vehicle, ["BATTERY_STATUS"])
    assert command(vehicle, REQUEST, BATTERY_STATUS_V2) == ACCEPTED
    fields = struct.unpack("<5fIhB", payload_of(receive(vehicle, ["UNKNOWN_369"]), 27))
    voltage, current, consumed, remaining, charge, flags, temperature, instance = fields
    assert voltage == pytest.approx(old.voltages[0] / 1000, abs=0.05)
    assert old.current_battery > 0
    assert current == pytest.approx(old.current_battery / 100, abs=0.1)
    assert consumed == pytest.approx(old.current_consumed / 1000, abs=0.01)
    assert charge == pytest.approx(old.battery_remaining, abs=1)
    assert remaining == pytest.approx(2.2 * charge / 100, rel=1e-3)
    assert (flags, temperature, instance) == (0, old.temperature, old.id)


@pytest.mark.parametrize("send", [command, command_int])
def test_every_message_can_be_requested(vehicle, send):
    # Nothing comes unasked.
    for message_id in (SYS_STATUS, BATTERY_STATUS):
        assert command(vehicle, SET_INTERVAL, message_id, -1) == ACCEPTED
    assert count(messages_of(vehicle, 1), "BATTERY_STATUS") == 0

    for message_id, name in [
        (AUTOPILOT_VERSION, "AUTOPILOT_VERSION"),
        (PROTOCOL_VERSION, "UNKNOWN_300"),
        (SYS_STATUS, "SYS_STATUS"),
    ]:
        assert send(vehicle, REQUEST, message_id) == ACCEPTED, name
        receive(vehicle, [name])

    for message_id, name in [
        (BATTERY_STATUS_V2, "UNKNOWN_369"),
        (SMART_BATTERY_INFO, "SMART_BATTERY_INFO"),
        (BATTERY_INFO, "UNKNOWN_372"),
    ]:
        assert send(vehicle, REQUEST, message_id, 0) == ACCEPTED, name
        receive(vehicle, [name])
        assert send(vehicle, REQUEST, message_id, 1) == DENIED, name

    for instance in (0, math.nan):
        assert send(vehicle, REQUEST, BATTERY_STATUS, instance) == ACCEPTED
        battery = receive(vehicle, ["BATTERY_STATUS"])
        assert (battery.id, 12_000 < battery.voltages[0] < 12_650) == (0, True)
    assert send(vehicle, REQUEST, BATTERY_STATUS, 1) == DENIED, "there is no second battery"
    assert send(vehicle, REQUEST, -1) == DENIED
    assert count(messages_of(vehicle, 1), "BATTERY_STATUS") == 0, "one answer each"


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
@pytest.mark.parametrize("stream", [mavlink.MAV_DATA_STREAM_ALL, mavlink.MAV_DATA_STREAM_EXTRA1])
def test_a_data_stream_request_holds_until_the_parameter_is_set(vehicle, stream):
    vehicle.mav.request_data_stream_send(1, 1, stream, 8, 1)
    messages = messages_of(vehicle, 4)
    assert is_about(count(messages, "BATTERY_STATUS") / 4, 8)
    assert is_about(count(messages, "SYS_STATUS") / 4, 8)
    vehicle.mav.param_request_read_send(1, 1, b"SR0_EXTRA1", -1)
    assert receive(vehicle, ["PARAM_VALUE"]).param_value == 2, "nothing is saved"

    assert set_to(vehicle, "SR0_EXTRA1", 4).param_value == 4
    assert is_about(rate_of(vehicle, "BATTERY_STATUS"), 4)


@pytest.mark.board
def test_the_streams_of_ardupilot_move_their_messages(vehicle):
    vehicle.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_EXTENDED_STATUS, 8, 1)
    vehicle.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_EXTRA3, 5, 1)
    messages = messages_of(vehicle, 4)
    assert is_about(count(messages, "SYS_STATUS") / 4, 8)
    assert is_about(count(messages, "BATTERY_STATUS") / 4, 5)


@pytest.mark.board
def test_data_streams_are_stopped_and_others_ignored(vehicle):
    vehicle.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_POSITION, 10, 1)
    assert is_about(rate_of(vehicle, "BATTERY_STATUS"), 2)
    vehicle.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 4, 0)
    messages = messages_of(vehicle, 2)
    assert count(messages, "BATTERY_STATUS") == count(messages, "SYS_STATUS") == 0
    assert count(messages, "HEARTBEAT") >= 1, "the heartbeat goes on"
    # What MAVProxy, DroneKit and Mission Planner do: to everyone.
    vehicle.mav.request_data_stream_send(0, 0, mavlink.MAV_DATA_STREAM_ALL, 4, 1)
    assert is_about(rate_of(vehicle, "BATTERY_STATUS"), 4)


@pytest.mark.board
def test_ping(vehicle):
    vehicle.mav.ping_send(123_456_789_012, 7, 0, 0)
    answer = receive(vehicle, ["PING"])
    assert (answer.time_usec, answer.seq) == (123_456_789_012, 7)
    assert (answer.target_system, answer.target_component) == (vehicle.mav.srcSystem, vehicle.mav.srcComponent)
    # An answer is not answered.
    vehicle.mav.ping_send(1, 8, 1, 1)
    assert count(messages_of(vehicle, 1), "PING") == 0


@pytest.mark.board
def test_timesync(vehicle):
    times = []
    for sent in (1, 2**62, 123):
        vehicle.mav.timesync_send(0, sent)
        answer = receive(vehicle, ["TIMESYNC"])
        assert answer.ts1 == sent
        times.append((answer.tc1, time.monotonic_ns()))
        time.sleep(0.5)
    vehicle_time, wall_time = (times[-1][i] - times[0][i] for i in (0, 1))
    assert vehicle_time == pytest.approx(wall_time, rel=0.15)
    vehicle.mav.timesync_send(5, 6)
    assert count(messages_of(vehicle, 1), "TIMESYNC") == 0, "an answer is not answered"


@pytest.fixture
def two_links(start_simulator):
    udp_port = free_port()
    simulator = start_simulator("--udp", f"127.0.0.1:{udp_port}")
    return connect(simulator.url), connect(f"udpin:127.0.0.1:{udp_port}")


def test_each_link_has_its_own_rates(two_links):
    tcp, udp = two_links
    assert command(tcp, SET_INTERVAL, BATTERY_STATUS, 100_000) == ACCEPTED
    udp.mav.request_data_stream_send(1, 1, mavlink.MAV_DATA_STREAM_ALL, 5, 1)
    # Both receive at the same time; what comes by UDP waits in its socket.
    end = time.monotonic() + 4
    counts = {tcp: 0, udp: 0}
    for connection in two_links:
        while connection.recv_match(blocking=False):
            pass
    while time.monotonic() < end:
        for connection in two_links:
            counts[connection] += connection.recv_match(type="BATTERY_STATUS", blocking=False) is not None
        time.sleep(0.005)
    assert is_about(counts[tcp] / 4, 10), counts[tcp]
    assert is_about(counts[udp] / 4, 5), counts[udp]


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
    time.sleep(2)  # No station listens.
    for _ in range(2):
        connection = connect(f"udpin:127.0.0.1:{udp_port}")
        messages = messages_of(connection, 2)
        assert count(messages, "BATTERY_STATUS") in (3, 4, 5)
        assert connection.mav_loss == 0
        assert command(connection, GET_INTERVAL, BATTERY_STATUS) == ACCEPTED
        connection.close()
        time.sleep(1)
