"""A power monitor and a smart battery on the simulator's I2C bus, as a ground station sets them up and sees them."""

import pytest

from station import connect, pack, restarted, set_to, volts

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
