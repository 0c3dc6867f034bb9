"""What an owner sees and hears of the rover, by the oracle, in one situation after the other.

Each situation is one of an emulated board with the release firmware, where `tests/firmware/shown.rs` records it. The first
is played on the simulator, too, where ground stations answer what they see. There are two links: one with a ground station
that is content with BATTERY_STATUS, one with a QGroundControl that moves over to BATTERY_STATUS_V2.
"""

import functools
import select
import shutil
import subprocess
import time

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY, Simulator
from oracle import BATTERY, WITH_STATE_OF_CHARGE, Oracle, QGroundControl
from station import command, connect, read, set_to

mavlink = mavutil.mavlink

# A situation is played once, by one worker.
pytestmark = pytest.mark.xdist_group("shown")

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
FAILED = mavlink.MAV_RESULT_FAILED

ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL

EMERGENCY = mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY
FAILED_PACK = mavlink.MAV_BATTERY_CHARGE_STATE_FAILED

READ_BY_GROUND_STATIONS = [
    "BATT_MONITOR",
    "BATT_CAPACITY",
    "BATT_LOW_VOLT",
    "BATT_CRT_VOLT",
    "BATT_LOW_MAH",
    "BATT_CRT_MAH",
]


class Link:
    """A link with ground stations at its end, which see everything that comes."""

    def __init__(self, **stations):
        self.oracle = Oracle(**stations)
        # Of the last of each command.
        self.results = {}

    def take(self, message, at):
        self.oracle.take(message, at)
        if message.get_type() == "COMMAND_ACK":
            self.results[message.command] = message.result

    @property
    def planner(self):
        return self.oracle.mission_planner.shows(self.oracle.at)

    @property
    def planner_spoken(self):
        return self.oracle.mission_planner.spoken

    @property
    def ground(self):
        return self.oracle.qgroundcontrol.shows(self.oracle.at)

    @property
    def ground_spoken(self):
        return self.oracle.qgroundcontrol.spoken

    @property
    def proxy(self):
        return self.oracle.mavproxy.shows(self.oracle.at)

    @property
    def proxy_said(self):
        return self.oracle.mavproxy.said

    @property
    def proxy_printed(self):
        return self.oracle.mavproxy.printed


class LiveLink(Link):
    """A link to the simulator. Times are simulated seconds."""

    def __init__(self, connection, speedup, **stations):
        super().__init__(**stations)
        self.connection = connection
        self.speedup = speedup
        self.connection.message_hooks.append(lambda _, message: self.take(message, self.now()))
        for name in READ_BY_GROUND_STATIONS:
            read(self.connection, name)

    def now(self):
        return time.monotonic() * self.speedup

    def receive(self):
        while self.connection.recv_match(blocking=False):
            pass


class RecordedLink(Link):
    """What a board sent."""

    def __init__(self, file, **stations):
        super().__init__(**stations)
        recording = mavutil.mavlink_connection(str(file))
        while (message := recording.recv_match()) is not None:
            self.take(message, message._timestamp)


def newer_qgroundcontrol():
    return QGroundControl(layout=WITH_STATE_OF_CHARGE)


class Situation:
    """A simulated rover and the two links."""

    def __init__(self, speedup=5, **parameters):
        self.speedup = speedup
        self.simulator = Simulator("--speedup", str(speedup))
        if parameters:
            # They take a restart, before the ground stations look.
            setting = connect(self.simulator.url)
            for name, value in parameters.items():
                assert set_to(setting, name, value).param_value == pytest.approx(value), name
            assert command(setting, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
            while setting.recv_match(blocking=True, timeout=0.5) is not None:
                pass
            setting.close()
        self.old = LiveLink(connect(self.simulator.url), speedup)
        self.new = LiveLink(connect(self.simulator.url), speedup, qgroundcontrol=newer_qgroundcontrol())

    def command(self, number, *parameters):
        return command(self.old.connection, number, *parameters)

    def let_pass(self, seconds):
        end = time.monotonic() + seconds / self.speedup
        while time.monotonic() < end:
            self.old.receive()
            self.new.receive()
            intervals = self.new.oracle.qgroundcontrol.intervals
            while intervals:
                assert command(self.new.connection, SET_INTERVAL, *intervals.pop(0)) == ACCEPTED
            select.select([self.old.connection.fd, self.new.connection.fd], [], [], 0.05)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.simulator.kill()


class Recorded:
    """A situation of the board."""

    def __init__(self, folder, name):
        self.folder = folder
        self.name = name

    @functools.cached_property
    def old(self):
        return RecordedLink(self.folder / f"{self.name}.old.tlog")

    @functools.cached_property
    def new(self):
        return RecordedLink(self.folder / f"{self.name}.new.tlog", qgroundcontrol=newer_qgroundcontrol())


@pytest.fixture(scope="session")
def recordings():
    """The folder with what boards sent, made again."""
    folder = REPOSITORY / "target" / "tmp" / "shown"
    shutil.rmtree(folder, ignore_errors=True)
    subprocess.run(["cargo", "test", "--quiet", "--test", "firmware", "shown::"], cwd=REPOSITORY, check=True)
    return folder


def situation(name):
    """A fixture: what a board sent in this situation."""

    @pytest.fixture(scope="module", name=name)
    def fixture(recordings):
        return Recorded(recordings, name)

    return fixture


# With the number of cells its charge is known from the first moment: an unknown one is 0 % to Mission Planner, and a
# warning to MAVProxy.
CURRENT_SENSOR = {
    "BATT_MONITOR": 4,
    "BATT_CURR_PIN": 27,
    "BATT_CELLS": 3,
    "BATT_CAPACITY": 1000,
    "SIM_BATT_CAP_AH": 1,
}


# Said after the start while no threshold is set.
WITHOUT_THRESHOLDS = {
    "Battery failsafes are off: set BATT_LOW_VOLT",
    "Set BATT_LOW_VOLT 10.50, BATT_CRT_VOLT 10.20",
}


def spoken_of(station, *words):
    """Whether each of the words was in some text about the first pack."""
    texts = [text.lower() for text in station if text.startswith("Battery 1 ")]
    return [any(word in text for text in texts) for word in words] == [True] * len(words)


# ---------------------------------------------------------------- healthy


@pytest.fixture(scope="module", params=["simulator", "board"])
def healthy(request):
    if request.param == "board":
        yield Recorded(request.getfixturevalue("recordings"), "healthy")
        return
    with Situation(**CURRENT_SENSOR) as situation:
        # What is said at the start has been read.
        situation.let_pass(20)
        yield situation


# Requirement: FR-6
def test_healthy(healthy):
    planner = healthy.old.planner
    assert (planner.internal_error, planner.message, planner.failsafe) == (None, None, False)
    assert (planner.prearm, planner.battery_colour) == ("Ready to Arm", "white")
    assert planner.batteries[0].voltage_v == pytest.approx(12.5, abs=0.2)
    assert planner.batteries[0].remaining_pct >= 95
    for link, judges_by in ((healthy.old, 147), (healthy.new, 369)):
        assert (link.ground.status, link.ground.judges_by) == ("Ready To Fly", judges_by)
        assert link.ground.batteries[0].colour == "green"
        assert (link.ground.sensor_errors, link.ground.errors) == (0, [])
    assert healthy.old.proxy.battery.startswith("Batt1: ")


def test_healthy_nothing_alarms(healthy):
    assert not any("warning" in said for said in healthy.old.proxy_said)
    for link in (healthy.old, healthy.new):
        assert set(link.ground_spoken) <= WITHOUT_THRESHOLDS
        assert set(link.planner_spoken) <= WITHOUT_THRESHOLDS


def test_healthy_no_safety_switch_is_shown(healthy):
    assert healthy.old.planner.safety is None and not healthy.old.proxy.safety_is_on


def test_healthy_no_word_of_a_fence(healthy):
    assert [said for said in healthy.old.proxy_said if "fence" in said] == []


def test_healthy_the_console_shows_that_it_may_arm(healthy):
    assert healthy.old.proxy.prearm_colour == "green"
    assert "pre-arm good" in healthy.old.proxy_said


armed = situation("armed")


def test_armed(armed):
    assert armed.old.planner.armed and armed.old.planner.prearm is None
    assert armed.old.ground.status == "Armed"
    assert "ARMED" in armed.old.proxy_said


def test_armed_no_message_of_a_safety_switch(armed):
    assert armed.old.planner.safety is None
    assert "(SAFETY)" not in armed.old.planner_spoken


# ---------------------------------------------------------------- below the arming voltage


below_arming_voltage = situation("below_arming_voltage")


REASON = "PreArm: Battery 1 below minimum arming voltage"


def test_below_arming_voltage_the_reason_comes_on_request(below_arming_voltage):
    old = below_arming_voltage.old
    assert old.planner.message == REASON and old.planner.message_colour == "red"
    assert REASON in old.ground.errors and REASON in old.ground_spoken
    assert f"AP: {REASON}" in old.proxy_printed


def test_below_arming_voltage_mission_planner_is_not_ready(below_arming_voltage):
    planner = below_arming_voltage.old.planner
    assert (planner.prearm, planner.prearm_reasons) == ("Not Ready to Arm", [REASON])


def test_below_arming_voltage_qgroundcontrol_is_not_ready(below_arming_voltage):
    assert below_arming_voltage.old.ground.status == "Not Ready"


def test_below_arming_voltage_mavproxy_says_so(below_arming_voltage):
    assert below_arming_voltage.old.proxy.prearm_colour == "red"
    assert "pre-arm fail" in below_arming_voltage.old.proxy_said


# ---------------------------------------------------------------- a flooded link


# A slow line, on which a lot is requested.
flooded = situation("flooded")


def test_flooded_it_is_counted(flooded):
    assert any(flooded.old.oracle.mission_planner.errors)


def test_flooded_no_internal_error(flooded):
    assert flooded.old.planner.internal_error is None and flooded.old.planner.internal_error_count == 0


def test_flooded_no_critical_failure(flooded):
    assert not any("Critical failure" in said for said in flooded.old.proxy_said)


# ---------------------------------------------------------------- strangers without the key


# A radio on which a station without the key sends, beside the ground station that has it.
strangers = situation("strangers")


def test_strangers_are_announced(strangers):
    assert any("not signed with the key" in text for text in strangers.old.proxy_printed)


def test_strangers_no_internal_error(strangers):
    planner = strangers.old.planner
    assert planner.internal_error is None and planner.internal_error_count == 0


def test_strangers_no_critical_failure(strangers):
    assert not any("Critical failure" in said for said in strangers.old.proxy_said)


# ---------------------------------------------------------------- drained, without thresholds


# From a fifth until it is an emergency.
drained = situation("drained")


# Requirement: FR-6
def test_drained_is_seen_by_charge_state(drained):
    assert drained.old.planner.batteries[0].remaining_pct <= 8
    assert drained.old.ground.batteries[0].colour == "red"
    assert drained.new.ground.batteries[0].charge_state == EMERGENCY
    spoken = drained.old.ground_spoken
    for words in ("battery  level low", "battery  level is critical", "battery  level emergency"):
        assert spoken.count(words) == 1, spoken
    assert "Flight battery warning" in drained.old.proxy_said


LEVELS = ("low", "critical", "emergency")


def test_drained_mission_planner_speaks_of_each_level(drained):
    assert spoken_of(drained.old.planner_spoken, *LEVELS), drained.old.planner_spoken


def test_drained_qgroundcontrol_speaks_of_each_level_after_the_switch(drained):
    assert spoken_of(drained.new.ground_spoken, *LEVELS), drained.new.ground_spoken


def test_drained_mavproxy_prints_each_level(drained):
    printed = [text.removeprefix("AP: ") for text in drained.old.proxy_printed]
    assert spoken_of(printed, *LEVELS), printed


def test_drained_is_not_ready(drained):
    assert drained.new.planner.prearm == "Not Ready to Arm"
    assert drained.new.ground.status == "Not Ready"


# ---------------------------------------------------------------- its sensor lost


sensor_lost = situation("sensor_lost")


def test_sensor_lost(sensor_lost):
    old, new = sensor_lost.old, sensor_lost.new
    assert spoken_of(old.planner_spoken, "unhealthy") and spoken_of(new.ground_spoken, "unhealthy")
    assert "battery  unhealthy" in old.ground_spoken
    assert old.planner.message == "Bad Battery"
    for link in (old, new):
        assert link.ground.batteries[0].colour == "red"
        assert link.ground.status == "Not Ready" and link.ground.sensor_errors & BATTERY
    assert "AP: PreArm: Battery 1 unhealthy: no reading in time" in old.proxy_printed


def test_sensor_lost_is_not_ready(sensor_lost):
    planner = sensor_lost.old.planner
    reason = "PreArm: Battery 1 unhealthy: no reading in time"
    assert (planner.prearm, planner.prearm_reasons) == ("Not Ready to Arm", [reason])
    assert "pre-arm fail" in sensor_lost.old.proxy_said


# ---------------------------------------------------------------- a cell failed


smart_battery_healthy = situation("smart_battery_healthy")


def test_smart_battery_is_no_bad_battery_until_it_is_read(smart_battery_healthy):
    assert set(smart_battery_healthy.old.planner_spoken) <= WITHOUT_THRESHOLDS


# A smart battery as the first pack.
cell_failed = situation("cell_failed")


def test_cell_failed(cell_failed):
    old, new = cell_failed.old, cell_failed.new
    assert "Bad Battery" in old.planner_spoken
    assert "battery  failed" in old.ground_spoken
    for link in (old, new):
        pack = link.ground.batteries[0]
        assert (pack.charge_state, pack.colour) == (FAILED_PACK, "red")
        assert link.ground.status == "Not Ready" and link.ground.sensor_errors & BATTERY


def test_cell_failed_is_announced(cell_failed):
    for spoken in (cell_failed.old.planner_spoken, cell_failed.new.ground_spoken):
        assert spoken_of(spoken, "cell"), spoken


def test_cell_failed_it_does_not_arm(cell_failed):
    planner = cell_failed.old.planner
    assert (planner.prearm, planner.prearm_reasons) == ("Not Ready to Arm", ["PreArm: Battery 1 has failed"])
    assert cell_failed.old.results[ARM_DISARM] == FAILED
    assert "Arm: Battery 1 has failed" in cell_failed.old.ground.errors


# ---------------------------------------------------------------- unplugged


unplugged = situation("unplugged")


def test_unplugged(unplugged):
    old = unplugged.old
    pack = old.ground.batteries[0]
    assert (pack.colour, pack.icon, pack.voltage_v) == ("text", "plain", None)
    assert old.planner.batteries[0].voltage_v < 0.1
    assert not any("emergency" in words for words in old.ground_spoken)
    assert "AP: PreArm: Battery 1 unhealthy" in old.proxy_printed


def test_unplugged_is_no_emergency_by_the_newer_message(unplugged):
    assert unplugged.new.ground.batteries[0].colour == "text"


def test_unplugged_is_not_ready(unplugged):
    assert unplugged.old.planner.prearm == "Not Ready to Arm"


# ---------------------------------------------------------------- USB power only


# Half a volt comes back through the board.
usb_only = situation("usb_only")


def test_usb_only(usb_only):
    old = usb_only.old
    assert old.ground.batteries[0].colour == "text" and old.ground.batteries[0].text == "n/a"
    for link in (old, usb_only.new):
        assert set(link.ground_spoken) <= WITHOUT_THRESHOLDS, "a desk is quiet"
        assert set(link.planner_spoken) <= WITHOUT_THRESHOLDS
    assert old.planner.internal_error is None
    assert old.planner.batteries[0].voltage_v == 0


def test_usb_only_is_no_emergency_by_the_newer_message(usb_only):
    assert usb_only.new.ground.batteries[0].colour == "text"


def test_usb_only_is_not_ready(usb_only):
    assert usb_only.old.planner.prearm == "Not Ready to Arm"
