"""A power monitor and a smart battery on the simulator's I2C bus, as a ground station sets them up and sees them."""

import pytest
from pymavlink import mavutil

from station import command, connect, pack, receive, restarted, set_to, volts

mavlink = mavutil.mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
FAILED = mavlink.MAV_RESULT_FAILED

# What the simulated power monitor has.
SHUNT_OHM = 0.002


@pytest.fixture
def vehicle(start_simulator):
    simulator = start_simulator()
    connection = connect(simulator.url)
    parameters = {"BATT2_MONITOR": 21, "BATT2_SHUNT": SHUNT_OHM, "BATT3_MONITOR": 7, "SIM_BATT_CURRENT": 4}
    for name, value in parameters.items():
        assert set_to(connection, name, value).param_value == pytest.approx(value)
    return restarted(connection, simulator.url)


def test_all_three_see_the_same_pack(vehicle):
    divider, monitor, battery = (pack(vehicle, instance) for instance in range(3))
    assert volts(monitor) == pytest.approx(volts(divider), abs=0.05)
    assert volts(battery) == pytest.approx(volts(divider), abs=0.05)
    assert monitor.current_battery == pytest.approx(battery.current_battery, abs=5)
    assert monitor.current_battery >= 400
    assert len([mv for mv in battery.voltages if mv != 65535]) == 3
    assert battery.battery_remaining >= 95
    assert monitor.energy_consumed >= 0 and battery.energy_consumed >= 0


def test_a_smart_battery_identifies_itself(vehicle):
    pack(vehicle, 2)
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    number = mavlink.MAVLINK_MSG_ID_SMART_BATTERY_INFO
    assert command(vehicle, request, number, 2) == ACCEPTED
    info = receive(vehicle, ["SMART_BATTERY_INFO"])
    assert (info.id, info.cells_in_series) == (2, 3)
    assert info.capacity_full == pytest.approx(2200, abs=1)
    assert info.device_name and info.serial_number


def test_a_smart_battery_is_not_reset(vehicle):
    pack(vehicle, 2)
    assert command(vehicle, mavlink.MAV_CMD_BATTERY_RESET, 0b100, 50) == FAILED
    assert command(vehicle, mavlink.MAV_CMD_BATTERY_RESET, 0b010, 50) == ACCEPTED
