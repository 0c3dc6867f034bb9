"""The oracle's rules on hand-made frames: each is shown to hold, and to make a difference."""

import math
import struct

import pytest
from pymavlink import mavutil

from oracle import (
    BATTERY,
    GEOFENCE,
    MOTOR_OUTPUTS,
    PREARM_CHECK,
    RC_RECEIVER,
    WITH_PERCENT_REMAINING,
    WITH_STATE_OF_CHARGE,
    MavProxy,
    MissionPlanner,
    Oracle,
    QGroundControl,
)

mavlink = mavutil.mavlink

VEHICLE = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
UNKNOWN = 65535

INFO = mavlink.MAV_SEVERITY_INFO
NOTICE = mavlink.MAV_SEVERITY_NOTICE
WARNING = mavlink.MAV_SEVERITY_WARNING
ERROR = mavlink.MAV_SEVERITY_ERROR
CRITICAL = mavlink.MAV_SEVERITY_CRITICAL

# What ArduPilot's Rover sends of these when all is well: GCS.cpp, update_sensor_status_flags. Without a fence only its
# health bit is set.
WELL = BATTERY | MOTOR_OUTPUTS | PREARM_CHECK
WELL_HEALTH = WELL | GEOFENCE


def received(message, sender=VEHICLE):
    """The message as it comes out of the other end of the wire."""
    (message,) = mavlink.MAVLink(None).parse_buffer(message.pack(sender))
    return message


def heartbeat(armed=False, mode=4, status=mavlink.MAV_STATE_STANDBY):
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
    rover, ardupilot = mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    return received(VEHICLE.heartbeat_encode(rover, ardupilot, base, mode, status))


def sys_status(enabled=WELL, health=WELL_HEALTH, present=None, percent=90, current=100, errors=(0, 0, 0, 0)):
    present = enabled if present is None else present
    return received(
        VEHICLE.sys_status_encode(present, enabled, health, 0, 12000, current, percent, 0, 0, *errors),
    )


def battery(state=1, percent=90, number=0, volts=(12000,), ext=(0, 0, 0, 0), current=100):
    voltages = [*volts, *[UNKNOWN] * (10 - len(volts))]
    return received(
        VEHICLE.battery_status_encode(number, 0, 1, 2500, voltages, current, 10, -1, percent, 0, state, ext, 0, 0),
    )


def battery_v2(flags=0, charge=90.0, number=0, layout=WITH_STATE_OF_CHARGE, checksum=None):
    if layout == WITH_STATE_OF_CHARGE:
        payload = struct.pack("<5fIhB", 12.0, 1.0, 0.1, 2.0, charge, flags, 2500, number)
    else:
        percent = 255 if math.isnan(charge) else int(charge)
        payload = struct.pack("<4fIhBB", 12.0, 1.0, 0.1, 2.0, flags, 2500, number, percent)
    payload = payload.rstrip(b"\0")
    header = bytes([0xFD, len(payload), 0, 0, 0, 1, 1, 369 & 255, 369 >> 8, 0])
    crc = mavlink.x25crc(header[1:] + payload)
    crc.accumulate(bytes([layout if checksum is None else checksum]))
    (message,) = mavlink.MAVLink(None).parse_buffer(header + payload + struct.pack("<H", crc.crc))
    assert message.get_type() == "UNKNOWN_369"
    return message


def text(words, severity=WARNING, number=0, part=0):
    return received(VEHICLE.statustext_encode(severity, words.encode(), number, part))


def parameter(name, value):
    return received(VEHICLE.param_value_encode(name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32, 1, 0))


def after(station, *messages, at=0.0, every=0.0):
    """The station after the messages."""
    for message in messages:
        station.take(message, at)
        at += every
    return station


def planner(*messages, at=0.0):
    return after(MissionPlanner(), *messages, at=at).shows(at)


def ground(*messages, **settings):
    return after(QGroundControl(**settings), *messages)


def proxy(*messages, every=0.0, **settings):
    return after(MavProxy(**settings), *messages, every=every)


# ---------------------------------------------------------------- Mission Planner


def test_mission_planner_is_content_with_a_sound_ardupilot():
    shows = planner(heartbeat(), sys_status(), battery())
    assert (shows.internal_error, shows.safety, shows.prearm, shows.message) == (None, None, "Ready to Arm", None)
    assert not shows.failsafe


@pytest.mark.parametrize(
    ("errors", "shown", "counted"),
    [
        ((1, 0, 0, 0), "InternalError 0x1", 0),
        ((0, 1, 0, 7), "InternalError 0x10000", 7),
        ((0x2A, 2, 0, 0), "InternalError 0x2002A", 0),
        ((0, 0, 9, 0), None, 0),
    ],
)
def test_the_first_two_counters_are_an_internal_error(errors, shown, counted):
    shows = planner(sys_status(errors=errors))
    assert (shows.internal_error, shows.message, shows.internal_error_count) == (shown, shown, counted)


def test_a_counter_does_not_stop_being_an_internal_error():
    station = MissionPlanner()
    for second in range(100):
        station.take(sys_status(errors=(3, 0, 0, 0)), second)
    assert station.shows(100).message == "InternalError 0x3"
    assert station.spoken == ["InternalError 0x3"]


def test_an_armed_rover_in_standby_is_no_failsafe():
    shows = planner(heartbeat(armed=True, status=mavlink.MAV_STATE_STANDBY), sys_status())
    assert shows.armed and not shows.failsafe
    assert "ARMED" in proxy(heartbeat(), heartbeat(armed=True, status=mavlink.MAV_STATE_STANDBY)).said


def test_safe_is_drawn_while_the_motor_outputs_are_not_enabled():
    # Neither present nor healthy helps.
    for health in (WELL_HEALTH, 0):
        assert planner(sys_status(enabled=WELL & ~MOTOR_OUTPUTS, present=WELL, health=health)).safety == "SAFE"
    assert planner(sys_status(health=0)).safety is None
    assert planner(heartbeat()).safety is None, "nothing is known yet"


def test_armed_with_outputs_not_enabled_is_a_message():
    shows = planner(sys_status(enabled=BATTERY, health=BATTERY), heartbeat(armed=True))
    assert (shows.message, shows.safety) == ("(SAFETY)", "SAFE")
    assert planner(sys_status(), heartbeat(armed=True)).message is None


@pytest.mark.parametrize(
    ("enabled", "health", "shown"),
    [
        (WELL, WELL, "Ready to Arm"),
        (WELL, WELL & ~PREARM_CHECK, "Not Ready to Arm"),
        # What is not enabled is ready, whatever its health.
        (WELL & ~PREARM_CHECK, BATTERY, "Ready to Arm"),
    ],
)
def test_ready_to_arm(enabled, health, shown):
    assert planner(sys_status(enabled=enabled, health=health)).prearm == shown
    assert planner(heartbeat(armed=True), sys_status(enabled=enabled, health=health)).prearm is None


def test_the_reasons_are_those_since_it_was_ready():
    station = MissionPlanner()
    station.take(text("PreArm: long ago", CRITICAL), 0)
    station.take(sys_status(), 10)
    station.take(sys_status(health=BATTERY), 20)
    assert station.shows(20).message is None
    station.take(text("PreArm: Battery 1 unhealthy", CRITICAL), 21)
    station.take(text("PreArm: Battery 1 unhealthy", CRITICAL), 22)
    station.take(sys_status(health=BATTERY), 40)
    shows = station.shows(40)
    assert shows.prearm_reasons == ["PreArm: Battery 1 unhealthy"]
    assert shows.message == "PreArm: Battery 1 unhealthy", "longer than the text by itself"
    assert station.spoken == []

    # What is not present is good, too.
    station.take(sys_status(health=BATTERY, present=BATTERY), 50)
    assert station.shows(50).prearm_reasons == []


@pytest.mark.parametrize(
    ("bit", "shown"),
    [
        (BATTERY, "Bad Battery"),
        (GEOFENCE, "Geofence Breach"),
        (RC_RECEIVER, "No RC Receiver"),
        (MOTOR_OUTPUTS, None),
    ],
)
def test_a_sensor_that_is_present_enabled_and_not_healthy_is_a_message(bit, shown):
    assert planner(sys_status(enabled=WELL | bit, health=(WELL | GEOFENCE) & ~bit)).message == shown
    assert planner(sys_status(enabled=WELL & ~bit, present=WELL | bit, health=0)).message != (shown or "x")
    assert planner(sys_status(enabled=WELL | bit, present=WELL & ~bit, health=WELL & ~bit)).message != (shown or "x")


def test_a_bad_sensor_covers_the_internal_error_and_the_prearm_text():
    shows = planner(
        sys_status(),
        text("PreArm: Battery 1 unhealthy", CRITICAL),
        sys_status(health=0, errors=(1, 0, 0, 0)),
    )
    assert (shows.message, shows.internal_error) == ("Bad Battery", "InternalError 0x1")


@pytest.mark.parametrize(
    ("words", "severity", "colour", "is_spoken"),
    [
        ("Battery 1 is low", WARNING, "yellow", True),
        ("Battery 1 failed", ERROR, "red", True),
        ("Battery 1 failed", CRITICAL, "red", True),
        ("Battery 1 has 3 cells", NOTICE, None, False),
        ("Arm: no", INFO, "red", True),
        ("PreArm: no", CRITICAL, "red", False),
    ],
)
def test_urgent_texts_are_large_and_spoken(words, severity, colour, is_spoken):
    station = after(MissionPlanner(), text(words, severity))
    assert station.shows(0).message == (words if colour else None)
    assert station.shows(0).message_colour == colour
    assert station.spoken == ([words] if is_spoken else [])
    assert station.shows(10.1).message is None


def test_voltages_are_summed_and_smoothed():
    station = after(MissionPlanner(), battery(volts=(4000, 4000, 4000), ext=(1000, UNKNOWN, 0, 0)))
    assert station.shows(0).batteries[0].voltage_v == pytest.approx(13.0)
    station.take(battery(volts=()), 0)
    assert station.shows(0).batteries[0].voltage_v == pytest.approx(7.8), "an unknown voltage is 0 V"
    after(station, battery(number=2, volts=(12000,)), battery(number=2, volts=(10000,)))
    assert station.shows(0).batteries[2].voltage_v == pytest.approx(10)
    after(station, battery(number=1, volts=(12000,)), battery(number=1, volts=(10000,)))
    assert station.shows(0).batteries[1].voltage_v == pytest.approx(11.2)
    after(station, battery(number=8), battery(number=9))
    assert set(station.shows(0).batteries) == {0, 1, 2, 8}


def test_what_is_unknown_is_nought():
    shows = planner(sys_status(percent=-1, current=-1))
    assert (shows.batteries[0].remaining_pct, shows.batteries[0].current_a) == (0, 0)
    shows = planner(battery(percent=-1, current=-1))
    assert (shows.batteries[0].remaining_pct, shows.batteries[0].current_a) == (0, -0.01)
    for percent in (0, 1, 100):
        assert planner(sys_status(percent=percent)).batteries[0].remaining_pct == percent
    assert planner(sys_status(percent=101)).batteries[0].remaining_pct == 0
    assert planner(sys_status(current=150)).batteries[0].current_a == 1.5


def test_the_batterys_colour_is_by_thresholds_of_the_vehicle():
    def colour(volts, percent=90, **parameters):
        settings = [parameter(name, value) for name, value in parameters.items()]
        return planner(*settings, battery(volts=(volts,), percent=percent)).battery_colour

    limits = {"BATT_LOW_VOLT": 10.5, "BATT_CRT_VOLT": 9.75}
    assert [colour(mv, **limits) for mv in (10_501, 10_500, 9_751, 9_750)] == ["white", "orange", "orange", "red"]
    charge = {"BATT_CAPACITY": 1000, "BATT_LOW_MAH": 200, "BATT_CRT_MAH": 100}
    assert [colour(12_000, percent, **charge) for percent in (20, 19, 10, 9)] == ["white", "orange", "orange", "red"]
    # A low threshold alone is a critical one, too.
    assert colour(10_000, BATT_LOW_VOLT=10.5) == "red"
    # Without thresholds an empty pack is white.
    assert colour(9_000, percent=0) == "white"


def test_the_low_battery_speech_is_the_ground_stations_own():
    limits = [parameter("BATT_LOW_VOLT", 11), parameter("BATT_CRT_VOLT", 10)]
    low = battery(volts=(9_500,), percent=5)
    assert after(MissionPlanner(), *limits, low).spoken == []

    def spoken(message):
        station = MissionPlanner(speech_battery=True, speech_volt=9.6, speech_percent=20)
        return len(after(station, message, message, message, every=20).spoken)

    assert spoken(low) == 2, "every 30 s"
    assert spoken(battery(volts=(12_000,), percent=19)) == 2
    assert spoken(battery(volts=(12_000,), percent=20)) == 0
    assert spoken(battery(volts=(12_000,), percent=0)) == 0, "an empty pack is silent"
    assert spoken(battery(volts=(4_900,), percent=5)) == 0, "and one that is hardly there"


def test_a_critical_vehicle_is_a_failsafe():
    assert planner(heartbeat(armed=True, status=mavlink.MAV_STATE_CRITICAL)).failsafe
    assert not planner(heartbeat(armed=True, status=mavlink.MAV_STATE_EMERGENCY)).failsafe


# ---------------------------------------------------------------- QGroundControl


@pytest.mark.parametrize(
    ("state", "percent", "colour", "icon", "shown"),
    [
        (1, 90, "green", "green", "90%"),
        (1, 99, "green", "green", "100%"),
        (1, 80, "yellow-green", "yellow-green", "80%"),
        (1, 60, "yellow", "yellow", "60%"),
        (1, 3, "yellow", "yellow", "3%"),
        (1, -1, "text", "orange", "12.00V"),
        (2, 90, "orange", "orange", "90%"),
        (3, 90, "red", "critical", "90%"),
        (4, 90, "red", "exclamation mark", "90%"),
        (5, 90, "red", "exclamation mark", "90%"),
        (6, 90, "red", "exclamation mark", "90%"),
        (7, 90, "text", "plain", "90%"),
        (0, 90, "text", "plain", "90%"),
    ],
)
def test_the_toolbars_battery(state, percent, colour, icon, shown):
    pack = ground(battery(state, percent)).shows(0).batteries[0]
    assert (pack.colour, pack.icon, pack.text) == (colour, icon, shown)


def test_the_text_of_a_pack_of_which_nothing_is_known():
    assert ground(battery(0, -1, volts=())).shows(0).batteries[0].text == "n/a"
    assert ground(battery(6, -1, volts=())).shows(0).batteries[0].text == "Unhealthy"
    for current, amperes in [(-1, None), (0, 0), (-200, -2), (150, 1.5)]:
        assert ground(battery(current=current)).shows(0).batteries[0].current_a == amperes


def test_voltages_end_at_the_first_unknown_one():
    def voltage(**fields):
        return ground(battery(**fields)).shows(0).batteries[0].voltage_v

    assert voltage(volts=(4000, 4000)) == 8
    assert voltage(volts=(4000, UNKNOWN, 4000)) == 4
    assert voltage(volts=[4000] * 10, ext=(4000, 0, 4000, 0)) == 44
    assert voltage(volts=(4000,), ext=(UNKNOWN, 0, 0, 0)) == pytest.approx(69.535), "a stray one is added"
    assert voltage(volts=()) is None


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (2, "battery  level low"),
        (3, "battery  level is critical"),
        (4, "battery  level emergency"),
        (5, "battery  failed"),
        (6, "battery  unhealthy"),
        (7, None),
        (0, None),
    ],
)
def test_a_worse_charge_state_is_spoken_once(state, words):
    station = ground(battery(1), battery(state), battery(state))
    assert station.spoken == (["warning", words] if words else [])
    # The state it is connected in is not spoken.
    assert ground(battery(state), battery(state)).spoken == []


def test_only_ok_and_arming_let_a_state_be_spoken_again():
    station = ground(battery(1), battery(3), battery(2), battery(3))
    assert station.spoken == ["warning", "battery  level is critical"]
    after(station, battery(1), battery(2))
    assert station.spoken[-1] == "battery  level low"
    after(station, heartbeat(armed=True), battery(2), battery(3))
    assert station.spoken[-1] == "battery  level is critical"
    spoken = len(station.spoken)
    # Not by each message of an armed vehicle, nor by disarming.
    after(station, heartbeat(armed=True), battery(2), heartbeat(), battery(2), battery(3))
    assert len(station.spoken) == spoken


def test_with_several_packs_the_number_is_spoken():
    station = ground(battery(1), battery(1, number=1), battery(2, number=1))
    assert station.spoken == ["warning", "battery 1 level low"]


def test_it_asks_for_the_newer_message_and_turns_the_older_off_once_it_comes():
    station = ground(battery(), layout=WITH_STATE_OF_CHARGE)
    assert station.intervals == [(369, 2_000_000), (372, 10_000_000)]
    after(station, battery_v2(charge=85.0), battery_v2(), battery(percent=10))
    assert station.intervals[2:] == [(147, -1)]
    shows = station.shows(0)
    assert (shows.judges_by, shows.batteries[0].percent, shows.batteries[0].source) == (369, 90, 369)


@pytest.mark.parametrize("layout", [WITH_STATE_OF_CHARGE, WITH_PERCENT_REMAINING])
def test_a_frame_of_the_other_layout_is_not_seen(layout):
    (other,) = {WITH_STATE_OF_CHARGE, WITH_PERCENT_REMAINING} - {layout}
    station = ground(battery(), battery_v2(layout=other), battery_v2(layout=layout, checksum=1), layout=layout)
    assert station.shows(0).judges_by == 147 and len(station.intervals) == 2
    assert after(station, battery_v2(layout=layout)).shows(0).judges_by == 369


@pytest.mark.parametrize("layout", [WITH_STATE_OF_CHARGE, WITH_PERCENT_REMAINING])
@pytest.mark.parametrize(
    ("flags", "charge", "state"),
    [
        (0, 90.0, 1),
        (0, math.nan, 1),
        (0, 81.0, 1),
        (0, 61.0, 2),
        (0, 80.0, 2),
        (0, 60.0, 3),
        (1, 90.0, 4),
        (2, 50.0, 7),
        (1 | 2, 90.0, 4),
        (8 | 1, 90.0, 5),
        (1 << 8, 90.0, 5),
        (1 << 17, 90.0, 5),
        # To be serviced, a bad battery, balancing, protections that are on, and counted from full.
        (4 | 16 | 32 | 64 | 128 | 1 << 18, 90.0, 1),
    ],
)
def test_the_newer_message_is_judged_by_its_flags(layout, flags, charge, state):
    station = ground(battery_v2(flags, charge, layout=layout), layout=layout)
    assert station.shows(0).batteries[0].charge_state == state
    assert station.spoken == []


def test_the_voice_knows_the_older_message_only():
    ok, bad = battery_v2(), battery_v2(flags=1)
    assert ground(battery(), ok, bad, layout=WITH_STATE_OF_CHARGE).spoken == []
    station = ground(battery(), ok, battery(4), layout=WITH_STATE_OF_CHARGE)
    assert station.spoken == ["warning", "battery  level emergency"], "even if the older one is not shown any more"


@pytest.mark.parametrize(
    ("enabled", "health", "status"),
    [
        (WELL, WELL, "Ready To Fly"),
        (WELL, WELL & ~PREARM_CHECK, "Not Ready"),
        # The pre-arm bit decides alone.
        (WELL, PREARM_CHECK, "Ready To Fly"),
        # Without it, all that is enabled.
        (BATTERY, BATTERY, "Ready To Fly"),
        (BATTERY, 0, "Not Ready"),
    ],
)
def test_readiness(enabled, health, status):
    assert ground(sys_status(enabled=enabled, health=health)).shows(0).status == status
    assert ground(sys_status(enabled=enabled, health=health), heartbeat(armed=True)).shows(0).status == "Armed"


def test_sensors_in_error_are_listed():
    assert ground(sys_status()).shows(0).sensor_errors == 0
    assert ground(sys_status(health=WELL & ~BATTERY)).shows(0).sensor_errors == BATTERY
    assert ground(sys_status(errors=(1, 2, 3, 4))).shows(0).sensor_errors == 0


@pytest.mark.parametrize(
    ("words", "severity", "spoken", "is_error"),
    [
        ("Battery 1 is low", WARNING, "Battery 1 is low", False),
        ("cells", NOTICE, "cells", False),
        ("cells", INFO, None, False),
        ("#cells", INFO, "cells", False),
        ("Battery 1 failed", ERROR, "Battery 1 failed", True),
    ],
)
def test_texts_are_spoken_down_to_a_notice(words, severity, spoken, is_error):
    station = ground(text(words, severity))
    assert station.spoken == ([spoken] if spoken else [])
    assert station.shows(0).errors == ([words] if is_error else [])


def test_a_prearm_text_is_spoken_every_ten_seconds():
    repeated = [text("PreArm: no", CRITICAL)] * 12
    assert len(after(QGroundControl(), *repeated, every=1).spoken) == 2
    repeated = [text("Arm: no", CRITICAL)] * 12
    assert len(after(QGroundControl(), *repeated, every=1).spoken) == 12


def test_the_parts_of_a_long_text_are_joined():
    parts = [text("a" * 50, WARNING, 7, 0), text("b" * 50, WARNING, 7, 1), text("c", WARNING, 7, 2)]
    whole = "a" * 50 + "b" * 50 + "c"
    assert ground(*parts).spoken == [whole]
    assert proxy(*parts).printed == [f"AP: {whole}"]
    assert proxy(parts[0]).printed == []


# ---------------------------------------------------------------- MAVProxy


@pytest.mark.parametrize(
    ("present", "enabled", "health", "said", "colour"),
    [
        # ArduPilot without a fence.
        (0, 0, GEOFENCE, [], "black"),
        (0, 0, 0, ["fence breach"], "black"),
        (GEOFENCE, 0, GEOFENCE, ["fence present"], "grey"),
        (GEOFENCE, GEOFENCE, GEOFENCE, ["fence present", "fence enabled"], "green"),
        (GEOFENCE, GEOFENCE, 0, ["fence present", "fence enabled", "fence breach"], "red"),
    ],
)
def test_the_fence(present, enabled, health, said, colour):
    status = sys_status(present=present, enabled=enabled, health=health)
    station = proxy(status, status)
    assert station.said == said
    assert station.shows(0).fence_colour == colour


def test_the_fence_from_one_message_to_the_next():
    station = proxy(sys_status(), sys_status(health=WELL), sys_status(), console=False)
    assert station.said == ["fence breach", "fence OK"]


def test_a_low_battery_is_spoken_once_a_minute():
    def said(monitor, percent, count=1):
        messages = [parameter("BATT_MONITOR", monitor), *[battery(percent=percent)] * count]
        return [words for words in proxy(*messages, every=10).said if "battery" in words]

    assert said(4, 20) == ["Flight battery 20 percent", "Flight battery warning"]
    assert said(4, 24) == ["Flight battery 20 percent", "Flight battery warning"]
    assert said(4, 25) == ["Flight battery 30 percent"]
    assert said(4, 4) == ["Flight battery warning"]
    assert said(4, -1) == ["Flight battery warning"], "an unknown charge"
    assert said(3, 4) == [], "of a voltage alone nothing is said"
    assert said(4, 4, count=7) == ["Flight battery warning"]
    assert said(4, 4, count=8) == ["Flight battery warning"] * 2


def test_only_the_first_battery_is_spoken_of():
    settings = [parameter("BATT_MONITOR", 4), parameter("BATT2_MONITOR", 4)]
    assert proxy(*settings, battery(percent=5, number=1)).said == []


def test_the_console_shows_the_batteries():
    station = proxy(parameter("BATT_MONITOR", 3), battery(percent=-1, current=-1))
    assert station.shows(0).battery == "Batt1: 12.00V "
    assert station.shows(0).bat == "Flight battery:   -1%"
    settings = [parameter("BATT_MONITOR", 4), parameter("BATT2_MONITOR", 7)]
    station = proxy(*settings, battery(), battery(number=1, ext=[9] * 4))
    assert station.shows(0).battery == "Batt1: 90%/12.00V 1.0A Batt2: 90%/12.00V 1.0A "


def test_counters_of_errors_are_a_critical_failure_in_the_console():
    status = sys_status(errors=(1, 2, 0, 0))
    assert proxy(status).said == ["Critical failure 0x20001 sysid=1 compid=1", "pre-arm good"]
    said = proxy(*[status] * 33, every=1).said
    assert sum("Critical failure" in words for words in said) == 2
    assert proxy(status, console=False).said == []
    assert proxy(sys_status(errors=(0, 0, 3, 4))).said == ["pre-arm good"]


def test_the_console_says_when_the_checks_pass_and_fail():
    good, bad = sys_status(), sys_status(health=WELL_HEALTH & ~PREARM_CHECK)
    station = proxy(bad)
    assert (station.said, station.shows(0).prearm_colour) == ([], "red")
    after(station, good, bad)
    assert station.said == ["pre-arm good", "pre-arm fail"]
    assert proxy(sys_status(enabled=BATTERY, health=BATTERY | GEOFENCE)).shows(0).prearm_colour is None
    assert proxy(sys_status(enabled=BATTERY, present=WELL)).shows(0).prearm_colour == "grey"


def test_safety_by_the_motor_outputs():
    assert proxy(sys_status(enabled=BATTERY)).shows(0).safety_is_on
    assert not proxy(sys_status()).shows(0).safety_is_on


def test_modes_and_arming_are_said():
    hold, driving = heartbeat(mode=4, armed=True), heartbeat(mode=0, armed=True)
    station = proxy(heartbeat(mode=4), hold, driving, heartbeat(), every=3)
    assert station.said == ["online system 1", "Mode HOLD", "ARMED", "Mode MANUAL", "DISARMED", "Mode HOLD"]
    assert proxy(heartbeat(mode=4), heartbeat(mode=0), every=2).said == ["online system 1", "Mode HOLD"]


def test_a_text_is_not_printed_again_within_two_seconds():
    assert proxy(*[text("low")] * 4, every=1).printed == ["AP: low", "AP: low"]
    assert proxy(text("low"), text("high"), text("low")).printed == ["AP: low", "AP: high", "AP: low"]


# ---------------------------------------------------------------- all of them


def test_other_vehicles_and_components_are_not_listened_to():
    oracle = Oracle()
    stranger = mavlink.MAVLink(None, srcSystem=2, srcComponent=1)
    gimbal = mavlink.MAVLink(None, srcSystem=1, srcComponent=154)
    for sender in (stranger, gimbal):
        oracle.take(received(sender.statustext_encode(CRITICAL, b"low"), sender), 0)
    assert oracle.mavproxy.printed == oracle.qgroundcontrol.spoken == oracle.mission_planner.spoken == []
    oracle.take(text("low"), 0)
    assert oracle.mavproxy.printed == ["AP: low"]
    assert oracle.qgroundcontrol.spoken == oracle.mission_planner.spoken == ["low"]
    oracle.qgroundcontrol.layout = WITH_STATE_OF_CHARGE
    oracle.take(battery_v2(), 0)
    assert oracle.qgroundcontrol.shows(0).judges_by == 369
