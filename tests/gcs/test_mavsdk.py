"""What MAVSDK makes of the simulator."""

import math
import queue
import time

import pytest
from mavsdk import Autopilot, ComponentType, Configuration, Mavsdk, Vehicle
from mavsdk.plugins.param import Param, ParamError, ParamResult
from mavsdk.plugins.telemetry import BatteryFunction, Telemetry

from conftest import free_port
from station import is_about


@pytest.fixture
def link(request):
    return getattr(request, "param", "udp")


@pytest.fixture
def system(link, start_simulator):
    """The vehicle as MAVSDK finds it."""
    udp_port = free_port()
    simulator = start_simulator("--udp", f"127.0.0.1:{udp_port}")
    urls = {"udp": f"udpin://0.0.0.0:{udp_port}", "tcp": f"tcpout://127.0.0.1:{simulator.port}"}
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(urls[link])
    system = mavsdk.first_autopilot(timeout_s=10)
    assert system is not None
    yield system
    mavsdk.destroy()


@pytest.fixture
def telemetry(system):
    telemetry = Telemetry(system)
    yield telemetry
    telemetry.destroy()


@pytest.fixture
def batteries(telemetry):
    """A queue of what MAVSDK reports from now on."""
    reports = queue.Queue()
    handle = telemetry.subscribe_battery(lambda battery, _: reports.put(battery))
    yield reports
    telemetry.unsubscribe_battery(handle)


@pytest.fixture
def param(system):
    param = Param(system)
    yield param
    param.destroy()


def rate_of(batteries, seconds=4):
    while not batteries.empty():
        batteries.get()
    time.sleep(seconds)
    return batteries.qsize() / seconds


def test_it_is_an_ardupilot_rover(system):
    assert system.autopilot_type() == Autopilot.ARDUPILOT
    assert system.vehicle_type() == Vehicle.ROVER


@pytest.mark.parametrize("link", ["udp", "tcp"], indirect=True)
def test_what_is_unknown_is_nan(batteries):
    # The first report may come from SYS_STATUS, which knows no function. From the first BATTERY_STATUS on, that counts.
    reports = [batteries.get(timeout=5) for _ in range(4)]
    battery = reports[-1]
    assert battery.id == 0
    assert battery.battery_function == BatteryFunction.ALL
    assert 12.0 < battery.voltage_v < 12.65
    assert math.isnan(battery.temperature_degc)
    assert math.isnan(battery.current_battery_a)
    assert math.isnan(battery.capacity_consumed_ah)
    assert math.isnan(battery.time_remaining_s)


# Requirement: FR-6
def test_the_remaining_charge_of_a_full_pack(batteries):
    # Known as soon as the cells are counted: 2 s after the start.
    reports = [batteries.get(timeout=5) for _ in range(8)]
    assert 95 <= reports[-1].remaining_percent <= 100


def test_the_rate_is_set(telemetry, batteries):
    assert batteries.get(timeout=5)
    telemetry.set_rate_battery(10.0)
    assert is_about(rate_of(batteries), 10)
    telemetry.set_rate_battery(4.0)
    assert is_about(rate_of(batteries), 4)


def test_parameters_are_read_and_set(param):
    assert param.get_param_int("SR0_EXTRA1") == 2
    param.set_param_int("SR0_EXTRA1", 5)
    assert param.get_param_int("SR0_EXTRA1") == 5
    assert param.get_param_float("BATT_VOLT_MULT") == pytest.approx(3.95)
    param.set_param_float("BATT_VOLT_MULT", 4.02)
    assert param.get_param_float("BATT_VOLT_MULT") == pytest.approx(4.02)


def test_a_refused_parameter_is_said_at_once(param):
    started = time.monotonic()
    with pytest.raises(ParamError) as refused:
        param.set_param_float("BATT_VOLT_MULT", 1000.0)
    assert refused.value.result == ParamResult.VALUE_OUT_OF_RANGE
    assert param.get_param_float("BATT_VOLT_MULT") == pytest.approx(3.95)
    with pytest.raises(ParamError) as unknown:
        param.get_param_int("NOPE")
    assert unknown.value.result == ParamResult.DOES_NOT_EXIST
    assert time.monotonic() - started < 2


def test_all_parameters_are_listed(param):
    everything = param.get_all_params()
    integers = {parameter.name: parameter.value for parameter in everything.int_params}
    floats = {parameter.name: parameter.value for parameter in everything.float_params}
    assert integers["SR0_EXTRA1"] == 2
    assert integers["SERIAL0_BAUD"] == 115
    assert floats["BATT_VOLT_MULT"] == pytest.approx(3.95)
