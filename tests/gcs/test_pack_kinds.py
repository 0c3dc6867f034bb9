"""The ready parameter files of docs/params/, loaded as an owner does; those whose sensors the simulator has."""

import pytest
from pymavlink import mavutil

from conftest import PARAMS
from station import connect, messages_of, pack, restarted, set_to, volts

mavlink = mavutil.mavlink

UNKNOWN = -1


def settings(file):
    lines = (PARAMS / file).read_text().splitlines()
    pairs = (line.split(",") for line in lines if line and not line.startswith("#"))
    return {name: float(value) for name, value in pairs}


@pytest.fixture
def vehicle_with(start_simulator):
    """A vehicle that was given a file of docs/params/ and restarted, and draws 4 A beside its own 0.2 A."""

    def load(file, **more):
        simulator = start_simulator()
        connection = connect(simulator.url)
        for name, value in {**settings(file), "SIM_BATT_CURRENT": 4, **more}.items():
            answer = set_to(connection, name, value)
            assert answer.get_type() == "PARAM_VALUE" and answer.param_value == pytest.approx(value), name
        vehicle = restarted(connection, simulator.url)
        # The charge is known a quarter of a second after the voltage.
        messages_of(vehicle, 1)
        return vehicle

    return load


def charge_states(connection, instances):
    return [pack(connection, instance).charge_state for instance in instances]


OK = mavlink.MAV_BATTERY_CHARGE_STATE_OK


@pytest.mark.parametrize("file", ["analog-current.param", "ina226.param", "smart-battery.param"])
def test_a_current_is_measured_and_counted(vehicle_with, file):
    status = pack(vehicle_with(file), 0)
    assert 11.5 < volts(status) < 12.6
    assert status.current_battery == pytest.approx(420, abs=10)
    assert status.current_consumed >= 0 and status.battery_remaining >= 95
    assert status.charge_state == OK


def test_a_synthetic_current_is_what_the_rover_takes_at_rest(vehicle_with):
    status = pack(vehicle_with("synthetic-current.param"), 0)
    assert status.current_battery == 20, "the 0.2 A of BATT_AMP_OFFSET: the simulator's load is not seen"


@pytest.mark.parametrize(
    ("file", "full_v", "percent"),
    [
        ("3s-lipo.param", 12.6, range(90, 101)),
        ("2s-18650.param", 8.4, range(90, 101)),
        ("3s-life.param", 10.6, range(90, 101)),
        ("6s-nimh.param", 8.4, range(85, 101)),
    ],
)
def test_of_a_voltage_alone_no_current_is_made_up(vehicle_with, file, full_v, percent):
    status = pack(vehicle_with(file, SIM_BATT_CURRENT=0, SIM_BATT_VOLTAGE=full_v), 0)
    assert status.current_battery == UNKNOWN and status.current_consumed == UNKNOWN
    assert status.battery_remaining in percent
    assert (status.charge_state, status.fault_bitmask) == (OK, 0)
    assert status.type == settings(file)["BATT_CHEM"]


def test_two_packs_and_their_sum(vehicle_with):
    vehicle = vehicle_with("two-packs-and-sum.param")
    divider, monitor, both = (pack(vehicle, instance) for instance in range(3))
    assert charge_states(vehicle, range(3)) == [OK] * 3
    assert volts(both) == pytest.approx((volts(divider) + volts(monitor)) / 2, abs=0.05)
    assert divider.current_battery == both.current_battery == UNKNOWN, "of one of them it is not known"
    assert monitor.current_battery == pytest.approx(420, abs=10)


def test_a_tank_is_reported_in_millilitres(vehicle_with):
    # The simulator has no tank. Its current sensor's pin has 0.25 V at 4.2 A: a level for other ends than the file's.
    vehicle = vehicle_with("fuel-level.param", BATT2_FL_PIN=27, BATT2_FL_VLT_MIN=0.01, BATT2_FL_V_MULT=2)
    status = pack(vehicle, 1, is_known=lambda status: status.battery_remaining >= 0)
    assert volts(status) == 0 and status.current_battery == UNKNOWN
    assert status.battery_remaining == pytest.approx(49, abs=3)
    assert status.current_consumed == pytest.approx(1500 * 0.51, abs=50)
