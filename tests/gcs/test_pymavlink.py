"""What pymavlink sees of the simulator."""

import collections
import re
import time

import pytest
from pymavlink import mavutil


def listen(url, seconds):
    """Connects and returns the connection and all messages of the given time, by type."""
    connection = mavutil.mavlink_connection(url)
    # Start at a whole heartbeat, so that every message has its full share of the time.
    connection.wait_heartbeat(timeout=10)
    messages = collections.defaultdict(list)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        message = connection.recv_match(blocking=True, timeout=0.1)
        if message is not None:
            messages[message.get_type()].append(message)
    return connection, messages


def assert_clean(connection, messages):
    assert "BAD_DATA" not in messages
    assert connection.mav_loss == 0


def assert_rate(messages, name, seconds, hertz):
    assert abs(len(messages[name]) - seconds * hertz) <= 1, (name, len(messages[name]))


@pytest.mark.board
def test_default_rates_without_loss(start_simulator):
    simulator = start_simulator()
    connection, messages = listen(simulator.url, 5)
    assert_clean(connection, messages)
    assert_rate(messages, "HEARTBEAT", 5, 1)
    assert_rate(messages, "SYS_STATUS", 5, 2)
    assert_rate(messages, "BATTERY_STATUS", 5, 2)


# Requirement: FR-1
def test_fields_decode(start_simulator):
    simulator = start_simulator()
    # Longer than the 2 s it takes to count the cells.
    _, messages = listen(simulator.url, 3.5)

    heartbeat = messages["HEARTBEAT"][-1]
    assert heartbeat.type == mavutil.mavlink.MAV_TYPE_GROUND_ROVER
    assert heartbeat.autopilot == mavutil.mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    assert not heartbeat.base_mode & mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert (heartbeat.get_srcSystem(), heartbeat.get_srcComponent()) == (1, 1)

    battery = messages["BATTERY_STATUS"][-1]
    assert battery.id == 0
    assert battery.battery_function == mavutil.mavlink.MAV_BATTERY_FUNCTION_ALL
    assert battery.type == mavutil.mavlink.MAV_BATTERY_TYPE_LIPO
    assert 12_000 < battery.voltages[0] < 12_650
    assert battery.voltages[1:] == [65535] * 9
    assert battery.voltages_ext == [0] * 4
    assert battery.temperature == 32767
    assert battery.charge_state == mavutil.mavlink.MAV_BATTERY_CHARGE_STATE_OK
    assert (battery.mode, battery.fault_bitmask, battery.time_remaining) == (0, 0, 0)
    assert battery.current_battery == battery.current_consumed == battery.energy_consumed == -1
    assert 95 <= battery.battery_remaining <= 100

    status = messages["SYS_STATUS"][-1]
    mavlink = mavutil.mavlink
    sensors = (
        mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
        | mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
        | mavlink.MAV_SYS_STATUS_PREARM_CHECK
        | mavlink.MAV_SYS_STATUS_LOGGING
    )
    assert status.onboard_control_sensors_present == sensors
    assert status.onboard_control_sensors_enabled == sensors
    assert status.onboard_control_sensors_health == sensors | mavlink.MAV_SYS_STATUS_GEOFENCE
    assert abs(status.voltage_battery - battery.voltages[0]) < 100
    assert (status.current_battery, status.battery_remaining) == (-1, battery.battery_remaining)
    assert (status.load, status.errors_count1, status.errors_count2, status.errors_count4) == (0, 0, 0, 0)


def test_ctrl_c_ends_it_cleanly(start_simulator):
    simulator = start_simulator()
    # It prints a line a second.
    listen(simulator.url, 2.5)
    code, output = simulator.interrupt()
    assert code == 0, output
    assert output.endswith("Stopped.\n"), output
    assert re.search(r"^pack 12\.\d\d V .* % \| .* \| HOLD, disarmed \| 1 ground station \| ", output, re.MULTILINE), output
