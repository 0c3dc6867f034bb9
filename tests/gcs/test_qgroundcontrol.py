"""What an owner sees with QGroundControl: a script that sends what it sends, the rules of the oracle for what it shows.

One session on the simulator and one on the emulated board: it connects, a rate is typed, the rover is armed in HOLD,
another QGroundControl connects to it, it is disarmed, and the requests are repeated until a minute has passed. Requests
that need no time follow on the same rover.
"""

import time

import pytest

from conftest import EmulatedBoard, Simulator, parameter_metadata
from oracle import FLY_VIEW, PAGES, described_kinds, description_of, missing_on_page
from qgroundcontrol import (
    FILE_NOT_FOUND,
    VEHICLE,
    Station,
    is_named,
    mavlink,
)
from station import Background, is_about
from test_oracle_qgroundcontrol import RECORDED_PARAMETERS, RELAYED_PARAMETERS

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM

HOLD, MANUAL = 4, 0

TYPED_HZ = 1


class Session:
    """A minute with QGroundControl, and the link that is left."""

    COUNTED_S = 10

    def __init__(self, url, other_url):
        self.station = Station(url)
        self.connected = self.station.connect()
        self.script = self.station.script
        self.station.run_for(4)
        self.ready = self.station.shown.shows(0)
        assert self.station.set("SR0_EXTRA1", TYPED_HZ).param_value == TYPED_HZ
        typed_at = time.monotonic()
        # Before others are refused: the texts are limited.
        refused = self.station.hears(lambda: self.station.set("BATT_CELLS", 99), r"BATT_CELLS\b.*\b0\b.*\b16\b")
        self.refusal, self.refusal_is_explained = refused
        self.drive_nowhere(other_url)
        self.station.run_for(typed_at + 60 - self.COUNTED_S - time.monotonic())
        counted_at = time.monotonic()
        self.station.run_for(self.COUNTED_S)
        self.counted = self.station.since(counted_at, "SYS_STATUS", "BATTERY_STATUS")

    def drive_nowhere(self, other_url):
        """Arms in HOLD and disarms as a click on *Disarm* does, with a QGroundControl that connects between."""
        self.armed_at = time.time()
        assert self.station.command(ARM_DISARM, 1) == ACCEPTED
        self.station.run_for(2)
        self.armed = self.station.shown.shows(0)
        other = Station(other_url)
        with Background(self.station.step):
            self.connected_armed, self.script_armed = other.connect(), other.script
        other.close()
        self.disarm_result = self.station.command(ARM_DISARM, *self.armed.disarm)
        self.station.run_for(2)
        self.disarmed = self.station.shown.shows(0)

    @property
    def parameters(self):
        return self.script.parameters

    def rate_hz(self, name):
        return sum(message.get_type() == name for message in self.counted) / self.COUNTED_S


# Each is played once, by one worker, both at the same time: a minute that is mostly waiting.
VEHICLES = [
    pytest.param("simulator", marks=pytest.mark.xdist_group("qgroundcontrol")),
    pytest.param("board", marks=pytest.mark.xdist_group("qgroundcontrol_board")),
]


@pytest.fixture(scope="module", params=VEHICLES)
def session(request, tmp_path_factory):
    if request.param == "simulator":
        vehicle = Simulator()
        urls = (vehicle.url, vehicle.url)
    else:
        vehicle = EmulatedBoard(tmp_path_factory.mktemp("board") / "flash")
        urls = (vehicle.uart_url, vehicle.usb_url)
    try:
        yield Session(*urls)
    finally:
        vehicle.kill()


# ---------------------------------------------------------------- connecting


def test_it_connects_without_a_dialog(session):
    assert session.connected.dialogs == []
    assert session.script.connecting_s < 3


# Requirement: FR-6
def test_it_shows_the_fly_view(session):
    assert session.connected.view == FLY_VIEW


def test_the_summary_is_green(session):
    assert set(session.connected.summary.values()) == {"green"}


@pytest.mark.parametrize("page", PAGES)
def test_every_page_of_vehicle_setup_opens_without_a_dialog(session, page):
    assert missing_on_page(page, session.parameters) == []


def test_no_box_is_open(session):
    assert session.ready.errors == []


def test_it_is_ready_to_fly(session):
    assert (session.ready.status, session.ready.status_colour) == ("Ready To Fly", "green")


def test_the_version_is_that_of_the_release_whose_names_are_kept(session):
    assert session.script.version[:2] == (4, 6) and session.script.version[3] == mavlink.FIRMWARE_VERSION_TYPE_DEV


def test_every_kind_of_monitor_has_a_name(session):
    (monitor,) = [param for param in parameter_metadata().iter("param") if param.get("name") == "Rover:BATT_MONITOR"]
    kinds = {int(value.get("code")) for value in monitor.iter("value")}
    assert kinds - described_kinds(session.script.version, session.script.descriptions) == set()


def test_every_parameter_has_a_description(session):
    # Also those that are listed once a pack is monitored.
    for name in [*session.parameters, "BATT2_CELLS", "BATT9_FS_VOLTSRC"]:
        row = description_of(session.script.descriptions, name)
        assert row is not None, name
        # read: FactMetaData.cc, createFromJsonObject: without these a row is not taken.
        assert row["type"] in ("Int8", "Int16", "Int32", "Float") and row["shortDesc"], row
    assert {name for name in session.parameters if name.startswith("WIFI_")}


# ---------------------------------------------------------------- arming


def test_armed_in_hold_it_is_not_flying(session):
    assert session.armed.status == "Armed"


def test_disarming_in_hold_is_no_emergency_stop(session):
    assert session.armed.disarm == (0, 0)
    assert session.disarm_result == ACCEPTED and session.disarmed.status == "Ready To Fly"


def test_connecting_to_an_armed_rover_takes_no_longer(session):
    assert session.connected_armed.dialogs == []
    assert session.script_armed.file_error in (None, FILE_NOT_FOUND)
    assert session.script_armed.connecting_s < 3


def test_the_log_has_the_date_that_was_given_on_connecting(session):
    entry = session.station.answer(lambda mav: mav.log_request_list_send(*VEHICLE, 0, 0xFFFF), is_named("LOG_ENTRY"))
    assert (entry.id, entry.num_logs) == (1, 1)
    assert entry.time_utc == pytest.approx(session.armed_at, abs=2)


# ---------------------------------------------------------------- rates


@pytest.mark.parametrize("name", ["SYS_STATUS", "BATTERY_STATUS"])
def test_rates_are_as_typed_after_a_minute_of_its_requests(session, name):
    assert is_about(session.rate_hz(name), TYPED_HZ)


# ---------------------------------------------------------------- parameters


def test_what_the_pages_ask_for_has_the_values_with_which_they_were_tried(session):
    tried = {name: value for name, value in RELAYED_PARAMETERS.items() if name not in RECORDED_PARAMETERS}
    modes = {name for name in tried if name.startswith("MODE")}
    assert tried.keys() <= session.parameters.keys()
    assert {name: session.parameters[name] for name in tried.keys() - modes} == pytest.approx(
        {name: tried[name] for name in tried.keys() - modes}
    )
    assert {session.parameters[name] for name in modes - {"MODE_CH"}} <= {MANUAL, HOLD}


def test_a_refused_parameter_is_explained_with_its_range(session):
    assert session.refusal.get_type() == "PARAM_ERROR"
    assert session.refusal_is_explained


# ---------------------------------------------------------------- a battery failsafe


@pytest.fixture(scope="module")
def failsafe():
    """Armed, with a pack that becomes low and then critical: what is shown after each."""
    simulator = Simulator()
    try:
        station = Station(simulator.url)
        station.connect()
        thresholds = {"BATT_LOW_VOLT": 10.8, "BATT_CRT_VOLT": 10.2, "BATT_FS_LOW_ACT": 2, "BATT_FS_CRT_ACT": 2}
        for name, value in {**thresholds, "BATT_LOW_TIMER": 1, "BATT_CELLS": 3}.items():
            assert station.set(name, value).param_value == pytest.approx(value)
        assert station.command(ARM_DISARM, 1) == ACCEPTED
        shows = []
        for volts in (10.5, 10.0):
            assert station.set("SIM_BATT_VOLTAGE", volts).param_value == volts
            station.run_for(5)
            shows.append(station.shown.shows(0))
        yield station, *shows
    finally:
        simulator.kill()


@pytest.mark.xdist_group("qgroundcontrol")
def test_a_critical_pack_opens_a_box_and_a_low_one_none(failsafe):
    _, low, critical = failsafe
    assert low.errors == []
    assert any("critical" in text for text in critical.errors)


@pytest.mark.xdist_group("qgroundcontrol")
def test_after_a_battery_failsafe_it_is_disarmed_as_ever(failsafe):
    station, low, critical = failsafe
    assert (low.status, critical.status) == ("Armed", "Armed")
    assert critical.disarm == (0, 0)
    assert station.command(ARM_DISARM, *critical.disarm) == ACCEPTED
    station.run_for(2)
    assert station.shown.shows(0).disarm is None
