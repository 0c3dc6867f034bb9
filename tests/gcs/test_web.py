"""The simulator's page, its logs and its WebSocket, as browsers and pymavlink use them."""

from contextlib import closing

import pytest

from conftest import failed_start, free_port
from station import command, connect, is_about, mavlink, rate_of, read, read_list, set_to

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
FORCED = 21196

# More than by default; at 50 Hz a busy computer is what limits.
RATE_HZ = 10


class Site:
    """A simulator with a page."""

    def __init__(self, start_simulator, *arguments):
        self.port = free_port()
        self.simulator = start_simulator("--web", f"127.0.0.1:{self.port}", *arguments)

    @property
    def ws_url(self):
        return f"ws:127.0.0.1:{self.port}"


@pytest.fixture
def site(start_simulator):
    return Site(start_simulator)


def test_parameters_commands_and_rates_are_those_of_tcp(site):
    with closing(connect(site.simulator.url)) as tcp, closing(connect(site.ws_url)) as web:
        assert read_list(web) == read_list(tcp)
        set_to(web, "BATT_LOW_VOLT", 10.5)
        assert read(tcp, "BATT_LOW_VOLT").param_value == 10.5
        for vehicle in (tcp, web):
            message = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
            assert command(vehicle, SET_INTERVAL, message, 1e6 / RATE_HZ) == ACCEPTED
            assert is_about(rate_of(vehicle, "BATTERY_STATUS"), RATE_HZ)
            assert vehicle.mav_loss == 0
            assert command(vehicle, ARM, 1, FORCED) == ACCEPTED
            assert command(vehicle, ARM, 0) == ACCEPTED


def test_a_port_that_is_taken_is_an_error_if_it_was_asked_for_and_off_serves_nothing(start_simulator):
    site = Site(start_simulator)
    assert "Can't serve the page" in failed_start("--web", f"127.0.0.1:{site.port}")
    without = start_simulator("--web", "off")
    code, output = without.interrupt()
    assert code == 0 and "page" not in output
