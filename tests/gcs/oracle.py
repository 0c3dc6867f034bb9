"""What ground stations show and speak of a vehicle, derived from its frames.

Not the ground stations: their rules, for what concerns a battery monitor, so that a test on the simulator or the board
can ask what its owner sees. Beside each rule stands where it was read:

  read:     read in the source of that project; the file, and the function or the version where it matters
  package:  read in the package that `requirements.txt` installs
  recorded: seen when that program ran against this rover; its traffic is in `tests/data/qgc-connect.log`
  unread:   not found in a source; taken from the project's documents or from other programs that follow it

Versions: of Mission Planner those files that know `safetyactive` and `prearmstatus` (CurrentState.cs) and
`criticalvoltagealert` (HUD.cs); of QGroundControl those that know BATTERY_STATUS_V2, and for connecting and arming
those between December 2023 (e0e8c496c, which was recorded) and mid 2026; MAVProxy 1.8.74. Settings have their defaults
unless a constructor takes them. Each link to a ground station needs an oracle of its own.

Time is what the caller gives, in seconds of any origin.
"""

import datetime
import math
import re
import struct
from dataclasses import dataclass, field, replace

from pymavlink import mavutil

mavlink = mavutil.mavlink

BATTERY = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
GEOFENCE = mavlink.MAV_SYS_STATUS_GEOFENCE
MOTOR_OUTPUTS = mavlink.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
PREARM_CHECK = mavlink.MAV_SYS_STATUS_PREARM_CHECK
RC_RECEIVER = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER

OK, LOW, CRITICAL, EMERGENCY, FAILED, UNHEALTHY, CHARGING = range(1, 8)
UNDEFINED = 0

ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
FLYING_STATES = (mavlink.MAV_STATE_ACTIVE, mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY)
# Parameter 2 of MAV_CMD_COMPONENT_ARM_DISARM that skips every check.
FORCE = 21196
UNKNOWN_MV = 65535


def is_set(mask, bit):
    return mask & bit == bit


@dataclass(frozen=True)
class Text:
    """A text and how urgent it is, as MAV_SEVERITY."""

    text: str
    severity: int


class Statustexts:
    """Joins the parts of long texts.

    read: QGroundControl StatusTextHandler.cc, _handleStatusText. package: MAVProxy mavproxy_link.py, PendingText.
    Both give up waiting for a part after a second; that is not modelled: links of tests lose nothing.
    """

    def __init__(self):
        self.parts = {}

    def take(self, message):
        """The whole text, once its last part has come."""
        parts = self.parts.setdefault(message.id, [])
        parts.append(message.text)
        if message.id != 0 and len(message.text) == 50:
            return None
        del self.parts[message.id]
        return Text("".join(parts), message.severity)


# ---------------------------------------------------------------- BATTERY_STATUS_V2

FLAG_NOT_READY = 1
FLAG_CHARGING = 2
# read: the mask in QGroundControl BatteryFactGroupListModel.cc, the numbers in MAVLink's development.xml. In it: cell
# imbalance, protection, voltage over and under, temperature over and under, over-current, short circuit, and the wrong
# voltage, firmware and cells. Not in it: REQUIRES_SERVICE, BAD_BATTERY.
FLAGS_FAULT = 8 | sum(1 << bit for bit in range(8, 18))

# The layouts of message 369 by their CRC_EXTRA: a ground station built with one drops the frames of the other.
WITH_STATE_OF_CHARGE = 145
WITH_PERCENT_REMAINING = 151


@dataclass(frozen=True)
class BatteryStatusV2:
    """Message 369, which pymavlink 2.4.50 does not know."""

    layout: int
    id: int
    voltage: float
    current: float
    percent: float | None
    flags: int


def battery_status_v2(frame):
    """The content of a MAVLink 2 frame of message 369 by the layout that its checksum fits, else `None`."""
    length = frame[1]
    payload, (checksum,) = frame[10 : 10 + length], struct.unpack_from("<H", frame, 10 + length)
    for layout in (WITH_STATE_OF_CHARGE, WITH_PERCENT_REMAINING):
        crc = mavlink.x25crc(bytes(frame[1 : 10 + length]))
        crc.accumulate(bytes([layout]))
        if crc.crc != checksum:
            continue
        if layout == WITH_STATE_OF_CHARGE:
            voltage, current, _, _, charge, flags, _, number = struct.unpack("<5fIhB", filled(payload, 27))
            percent = None if math.isnan(charge) else charge
        else:
            voltage, current, _, _, flags, _, number, charge = struct.unpack("<4fIhBB", filled(payload, 24))
            percent = None if charge == 255 else float(charge)
        return BatteryStatusV2(layout, number, voltage, current, percent, flags)
    return None


def filled(payload, length):
    """MAVLink 2 leaves zeros at the end of a payload out."""
    return bytes(payload).ljust(length, b"\0")


# ---------------------------------------------------------------- Mission Planner


@dataclass(frozen=True)
class HudBattery:
    """A battery in Mission Planner's *Status* tab; of 0 and 1 also in the head-up display."""

    voltage_v: float
    current_a: float
    remaining_pct: int


@dataclass(frozen=True)
class MissionPlannerShows:
    # "InternalError 0x…"; the count of errors is in `errors_count4`, which is shown in the *Status* tab only.
    internal_error: str | None
    internal_error_count: int
    # "SAFE" in red below the artificial horizon.
    safety: str | None
    # "Ready to Arm" or "Not Ready to Arm"; nothing while armed.
    prearm: str | None
    # What the window behind it lists.
    prearm_reasons: list
    # The large text in the middle and its colour.
    message: str | None
    message_colour: str | None
    failsafe: bool
    armed: bool
    batteries: dict
    battery_colour: str


# The texts for sensors that are present, enabled and not healthy; the first that fits is shown.
# read: the order and conditions in CurrentState.cs, SYS_STATUS; the texts in Strings.Designer.cs, but those marked +,
# which are unread.
UNHEALTHY_SENSORS = [
    (mavlink.MAV_SYS_STATUS_SENSOR_GPS, "Bad GPS Signal Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO, "Bad Gyro Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL, "Bad Accel Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG, "Bad Compass Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE, "Bad Baro Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_LASER_POSITION, "Bad LiDAR Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW, "Bad OptFlow Health"),
    (mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION, "Bad Vision Position"),
    (mavlink.MAV_SYS_STATUS_TERRAIN, "Bad or No Terrain Data"),
    (GEOFENCE, "Geofence Breach"),  # +
    (mavlink.MAV_SYS_STATUS_AHRS, "Bad AHRS"),
    (RC_RECEIVER, "No RC Receiver"),  # +
    (BATTERY, "Bad Battery"),  # +
    (mavlink.MAV_SYS_STATUS_SENSOR_PROXIMITY, "Bad Proximity"),  # +
    (mavlink.MAV_SYS_STATUS_SENSOR_SATCOM, "Bad SatCom"),  # +
    (mavlink.MAV_SYS_STATUS_SENSOR_DIFFERENTIAL_PRESSURE, "Bad Airspeed"),  # +
]

# read: CurrentState.cs, messageHigh.
MESSAGE_LASTS_S = 10


class MissionPlanner:
    """Mission Planner's main window.

    Speech is off there unless its owner turns it on; `spoken` is what is spoken once it is. The low-battery speech has
    a switch and two limits of its own, of the ground station and not of the vehicle.
    """

    def __init__(self, speech_battery=False, speech_volt=0.0, speech_percent=0.0):
        self.speech_battery = speech_battery
        self.speech_volt = speech_volt
        self.speech_percent = speech_percent
        self.parameters = {}
        self.present = self.enabled = self.health = None
        self.errors = (0, 0, 0, 0)
        self.armed = False
        self.failsafe = False
        self.texts = []
        self.good_prearm_at = None
        self.message = Text("", mavlink.MAV_SEVERITY_EMERGENCY)
        self.message_at = -math.inf
        self.last_spoken_message = ""
        self.spoken_battery_at = None
        self.batteries = {}
        self.spoken = []

    def take(self, message, at):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.take_heartbeat(message, at)
        elif kind == "SYS_STATUS":
            self.take_sys_status(message, at)
        elif kind == "BATTERY_STATUS":
            self.take_battery_status(message)
        elif kind == "STATUSTEXT":
            self.take_text(message, at)
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value
        self.speak(at)

    def take_heartbeat(self, heartbeat, at):
        # read: CurrentState.cs, HEARTBEAT.
        self.armed = is_set(heartbeat.base_mode, ARMED)
        if self.armed and self.enabled is not None and not is_set(self.enabled, MOTOR_OUTPUTS):
            self.show("(SAFETY)", at)
        self.failsafe = heartbeat.system_status == mavlink.MAV_STATE_CRITICAL

    def take_sys_status(self, status, at):
        # read: CurrentState.cs, SYS_STATUS. It takes neither `voltage_battery` nor `errors_comm` from here.
        self.present = status.onboard_control_sensors_present
        self.enabled = status.onboard_control_sensors_enabled
        self.health = status.onboard_control_sensors_health
        self.errors = tuple(getattr(status, f"errors_count{number}") for number in range(1, 5))
        self.set_battery(0, remaining_pct=shown_percent(status.battery_remaining))
        # read: the setter of `current`: −1 is no sensor, shown as 0.
        current_ca = status.current_battery
        self.set_battery(0, current_a=0.0 if current_ca == -1 else current_ca / 100)

        if self.internal_error():
            self.show(self.internal_error(), at)
        unhealthy = next((text for bit, text in UNHEALTHY_SENSORS if self.is_unhealthy(bit)), None)
        if unhealthy:
            self.show(unhealthy, at)
        elif self.is_unhealthy(PREARM_CHECK):
            # In older versions this came first, and every earlier text counted.
            reasons = self.prearm_reasons()
            if reasons:
                self.show(reasons[-1], at)
        prearm_is_good = is_set(self.health, PREARM_CHECK) or not is_set(self.enabled & self.present, PREARM_CHECK)
        if self.good_prearm_at is None or prearm_is_good:
            self.good_prearm_at = at

    def take_battery_status(self, status):
        # read: CurrentState.cs, BATTERY_STATUS: every entry that is not 65535, of both arrays, is added.
        if status.id > 8:
            return
        total_v = sum(mv for mv in [*status.voltages, *status.voltages_ext] if mv != UNKNOWN_MV) / 1000
        if status.id <= 1 and status.id in self.batteries and self.batteries[status.id].voltage_v != 0:
            # read: the setters of battery_voltage and battery_voltage2; those of the others don't filter.
            total_v = 0.4 * total_v + 0.6 * self.batteries[status.id].voltage_v
        percent = status.battery_remaining
        self.set_battery(
            status.id,
            voltage_v=total_v,
            # Here −1 is not taken for "no sensor".
            current_a=status.current_battery / 100,
            # read: only battery_remaining, of the first, has a setter that makes 0 of what is not a percentage.
            remaining_pct=shown_percent(percent) if status.id == 0 else percent,
        )

    def set_battery(self, number, **fields):
        before = self.batteries.get(number, HudBattery(0.0, 0.0, 0))
        self.batteries[number] = replace(before, **fields)

    def take_text(self, message, at):
        # read: MAVLinkInterface.cs, STATUSTEXT, with its setting "severity" at 4. Parts are not joined.
        self.texts.append((at, message.text))
        is_urgent = message.severity <= mavlink.MAV_SEVERITY_WARNING
        if not (is_urgent or message.text.startswith(("Tuning:", "PreArm:", "Arm:"))):
            return
        self.show(message.text, at, message.severity if is_urgent else mavlink.MAV_SEVERITY_EMERGENCY)
        if not message.text.startswith("PreArm:"):
            self.spoken.append(message.text)
            # The loop below would speak it once more.
            self.last_spoken_message = message.text

    def show(self, text, at, severity=None):
        # read: CurrentState.cs, messageHigh: the time is set each time, the severity only if the text changed.
        if text != self.shown_message(at):
            self.message = Text(text, mavlink.MAV_SEVERITY_EMERGENCY)
        if severity is not None:
            self.message = Text(text, severity)
        self.message_at = at

    def shown_message(self, at):
        return self.message.text if at <= self.message_at + MESSAGE_LASTS_S else ""

    def speak(self, at):
        # read: MainV2.cs, SerialReader; that texts beginning with "PreArm:" are not repeated aloud, in a later version.
        message = self.shown_message(at)
        if message != self.last_spoken_message and not message.startswith("PreArm:"):
            self.last_spoken_message = message
            if message:
                self.spoken.append(message)
        # read: the same, "speech for battery alerts", every 30 s. Not BATT_LOW_VOLT: the settings of the ground
        # station. An empty pack, at 0 %, is silent by the percentage; and so is one below 5 V.
        battery = self.batteries.get(0)
        if not (self.speech_battery and battery and battery.voltage_v >= 5):
            return
        if self.spoken_battery_at is not None and at <= self.spoken_battery_at + 30:
            return
        is_low = battery.voltage_v <= self.speech_volt or 0 != battery.remaining_pct < self.speech_percent
        if is_low:
            self.spoken_battery_at = at
            self.spoken.append("WARNING, Battery")

    def is_unhealthy(self, bit):
        return is_set(self.present & self.enabled, bit) and not is_set(self.health, bit)

    def internal_error(self):
        # read: CurrentState.cs, SYS_STATUS: ArduPilot's mask of internal errors, in two halves.
        mask = self.errors[0] | self.errors[1] << 16
        return f"InternalError 0x{mask:X}" if mask else None

    def prearm_reasons(self):
        # read: CurrentState.cs, SYS_STATUS: texts since the last time it was ready.
        since = math.inf if self.good_prearm_at is None else self.good_prearm_at
        return [text for at, text in self.texts if at > since and "prearm" in text.lower()]

    def battery_colour(self):
        # unread in Mission Planner's own repository (stored versions are older), read in two programs derived from it:
        # FlightData.cs, mainloop. The same in HUD.cs: read. Thresholds of 0 are those of the ground station, 0 too.
        battery = self.batteries.get(0, HudBattery(0.0, 0.0, 0))
        low_v = self.parameters.get("BATT_LOW_VOLT", 0) or self.speech_volt
        critical_v = self.parameters.get("BATT_CRT_VOLT", 0) or low_v
        low_pct = self.percent_of_capacity("BATT_LOW_MAH") or self.speech_percent
        critical_pct = self.percent_of_capacity("BATT_CRT_MAH") or low_pct
        if battery.voltage_v <= critical_v or battery.remaining_pct < critical_pct:
            return "red"
        if battery.voltage_v <= low_v or battery.remaining_pct < low_pct:
            return "orange"
        return "white"

    def percent_of_capacity(self, name):
        capacity_mah = self.parameters.get("BATT_CAPACITY", 0)
        return 100 * self.parameters.get(name, 0) / capacity_mah if capacity_mah else 0

    def shows(self, at):
        message = self.shown_message(at) or None
        knows = self.enabled is not None
        # read: CurrentState.cs, prearmstatus. The texts of HUDT.resx are unread, its names are SAFE, ReadyToArm and
        # NotReadyToArm.
        is_ready = not knows or is_set(self.health, PREARM_CHECK) or not is_set(self.enabled, PREARM_CHECK)
        prearm = "Ready to Arm" if is_ready else "Not Ready to Arm"
        return MissionPlannerShows(
            internal_error=self.internal_error(),
            internal_error_count=self.errors[3],
            # read: CurrentState.cs, safetyactive; HUD.cs draws it armed or not.
            safety="SAFE" if knows and not is_set(self.enabled, MOTOR_OUTPUTS) else None,
            # read: HUD.cs, displayprearm: not while armed.
            prearm=None if self.armed else prearm,
            # read: PrearmStatus.cs, which sends RUN_PREARM_CHECKS again and again while it is not ready.
            prearm_reasons=[] if is_ready else list(dict.fromkeys(self.prearm_reasons())),
            message=message,
            message_colour=hud_colour(self.message.severity) if message else None,
            failsafe=self.failsafe,
            armed=self.armed,
            batteries=dict(self.batteries),
            battery_colour=self.battery_colour(),
        )


def shown_percent(percent):
    """read: CurrentState.cs, battery_remaining."""
    return percent if 0 <= percent <= 100 else 0


def hud_colour(severity):
    """read: HUD.cs, doPaint."""
    if severity <= mavlink.MAV_SEVERITY_ERROR:
        return "red"
    return "yellow" if severity <= mavlink.MAV_SEVERITY_WARNING else "white"


# ---------------------------------------------------------------- QGroundControl


@dataclass(frozen=True)
class ToolbarBattery:
    """A battery in QGroundControl's toolbar."""

    voltage_v: float | None = None
    current_a: float | None = None
    percent: float | None = None
    charge_state: int = UNDEFINED
    # The message its values are from.
    source: int = 147

    # read: BatteryIndicator.SettingsGroup.json, threshold1 and threshold2: settings with these defaults.
    GOOD_PCT = 80
    FAIR_PCT = 60

    @property
    def colour(self):
        """read: BatteryIndicator.qml, getBatteryColor. "text" is the colour of ordinary text, no judgement."""
        if self.charge_state == OK:
            return "text" if self.percent is None else self.colour_by_percent
        return {LOW: "orange", CRITICAL: "red", EMERGENCY: "red", FAILED: "red", UNHEALTHY: "red"}.get(
            self.charge_state, "text"
        )

    @property
    def colour_by_percent(self):
        if self.percent > self.GOOD_PCT:
            return "green"
        return "yellow-green" if self.percent > self.FAIR_PCT else "yellow"

    @property
    def icon(self):
        """read: BatteryIndicator.qml, getBatterySvgSource. OK of unknown percentage falls through to the icon of LOW,
        drawn in the colour of text."""
        if self.charge_state == OK:
            return "orange" if self.percent is None else self.colour_by_percent
        return {
            LOW: "orange",
            CRITICAL: "critical",
            EMERGENCY: "exclamation mark",
            FAILED: "exclamation mark",
            UNHEALTHY: "exclamation mark",
        }.get(self.charge_state, "plain")

    @property
    def text(self):
        """read: BatteryIndicator.qml, getBatteryPercentageText, the default display. The number of decimals and the
        names of the charge states are of BatteryFact.json: unread."""
        if self.percent is not None:
            return "100%" if self.percent > 98.9 else f"{self.percent:.0f}%"
        if self.voltage_v is not None:
            return f"{self.voltage_v:.2f}V"
        names = ["n/a", "Ok", "Low", "Critical", "Emergency", "Failed", "Unhealthy", "Charging"]
        return names[self.charge_state]


@dataclass(frozen=True)
class QGroundControlShows:
    # "Ready To Fly", "Not Ready", "Armed" or "Flying", and the colour behind it.
    status: str
    status_colour: str
    # What a click on *Disarm* sends: parameters 1 and 2 of MAV_CMD_COMPONENT_ARM_DISARM. `None` while disarmed.
    disarm: tuple | None
    # 147, or 369 once one could be decoded.
    judges_by: int
    batteries: dict
    # The sensors listed behind the status that are present, enabled and not healthy.
    sensor_errors: int
    # Texts of errors open over the map until they are closed.
    errors: list


class QGroundControl:
    """QGroundControl's toolbar and voice.

    `layout` is the layout of message 369 it is built with. The version that was read has the older one; what a later
    one does with `state_of_charge` is unread, and taken to be the same.
    """

    def __init__(self, layout=WITH_PERCENT_REMAINING):
        self.layout = layout
        self.armed = False
        self.is_flying = False
        self.knows_prearm = False
        self.is_ready = False
        self.all_healthy = False
        self.sensor_errors = 0
        self.judges_by = 147
        self.batteries = {}
        self.announced = {}
        self.statustexts = Statustexts()
        self.prearm_spoken_at = {}
        self.errors = []
        self.spoken = []
        # What it asks of the vehicle: SET_MESSAGE_INTERVAL for these messages, in microseconds.
        # read: BatteryFactGroupListModel.cc, startV2Negotiation.
        self.intervals = [(369, 2_000_000), (372, 10_000_000)]

    def take(self, message, at):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.take_heartbeat(message)
        elif kind == "SYS_STATUS":
            self.take_sys_status(message)
        elif kind == "BATTERY_STATUS":
            self.take_battery_status(message)
        elif kind == "UNKNOWN_369":
            self.take_battery_status_v2(battery_status_v2(message.data))
        elif kind == "STATUSTEXT":
            whole = self.statustexts.take(message)
            if whole:
                self.take_text(whole, at)

    def take_heartbeat(self, heartbeat):
        armed = is_set(heartbeat.base_mode, ARMED)
        if armed and not self.armed:
            # read: Vehicle.cc, _updateArmed.
            self.announced.clear()
        self.armed = armed
        # read: APMFirmwarePlugin.cc, _handleIncomingHeartbeat. The mode does not matter.
        self.is_flying = armed and heartbeat.system_status in FLYING_STATES

    def take_sys_status(self, status):
        # read: Vehicle.cc, _handleSysStatus. The four counters of errors are not used.
        enabled, health = status.onboard_control_sensors_enabled, status.onboard_control_sensors_health
        if is_set(enabled, PREARM_CHECK):
            self.knows_prearm = True
            self.is_ready = is_set(health, PREARM_CHECK)
        self.all_healthy = enabled & health == enabled
        # read: SysStatusSensorInfo.cc.
        self.sensor_errors = status.onboard_control_sensors_present & enabled & ~health

    def take_battery_status(self, status):
        # Even once 369 is what it judges by: the voice has no such condition.
        self.announce(status)
        if self.judges_by == 369:
            # read: BatteryFactGroupListModel.cc, handleMessage.
            return
        # read: the same, _handleBatteryStatus: voltages until the first 65535, voltages_ext until the first 0, where
        # 65535 counts.
        millivolts = before(UNKNOWN_MV, status.voltages)
        if millivolts:
            millivolts = millivolts + before(0, status.voltages_ext)
        self.batteries[status.id] = ToolbarBattery(
            voltage_v=sum(millivolts) / 1000 if millivolts else None,
            current_a=None if status.current_battery == -1 else status.current_battery / 100,
            percent=None if status.battery_remaining == -1 else float(status.battery_remaining),
            charge_state=status.charge_state,
        )

    def take_battery_status_v2(self, status):
        if status is None or status.layout != self.layout:
            # Its parser drops the frame for its checksum.
            return
        if self.judges_by != 369:
            # read: the same, _activateV2.
            self.judges_by = 369
            self.intervals.append((147, -1))
        self.batteries[status.id] = ToolbarBattery(
            voltage_v=known(status.voltage),
            current_a=known(status.current),
            percent=status.percent,
            charge_state=charge_state_by_flags(status),
            source=369,
        )

    def announce(self, status):
        # read: Vehicle.cc, _handleBatteryStatus. Only 147 is spoken of: once it is off, nothing is. The first state
        # since the connection or since arming is taken as known. UNDEFINED and CHARGING change nothing.
        state, number = status.charge_state, status.id
        before_it = self.announced.setdefault(number, state)
        if state == OK:
            self.announced[number] = OK
        texts = {
            LOW: "battery {} level low",
            CRITICAL: "battery {} level is critical",
            EMERGENCY: "battery {} level emergency",
            FAILED: "battery {} failed",
            UNHEALTHY: "battery {} unhealthy",
        }
        if state in texts and state > before_it:
            self.announced[number] = state
            which = number if len(self.batteries) > 1 else ""
            self.spoken += ["warning", texts[state].format(which)]

    def take_text(self, text, at):
        # read: Vehicle.cc, _textMessageReceived.
        is_aloud = text.severity <= mavlink.MAV_SEVERITY_NOTICE or text.text.startswith("#")
        if text.text.startswith("PreArm"):
            if at < self.prearm_spoken_at.get(text.text, -math.inf) + 10:
                is_aloud = False
            else:
                self.prearm_spoken_at[text.text] = at
        if is_aloud:
            self.spoken.append(text.text.removeprefix("#"))
        # read: StatusTextHandler.cc, severityIsError; Vehicle.cc, _errorMessageReceived.
        if text.severity <= mavlink.MAV_SEVERITY_ERROR:
            self.errors.append(text.text)

    def disarm(self):
        # read: GuidedActionsController.qml, showDisarm and showEmergenyStop; Vehicle.cc, emergencyStop.
        if not self.armed:
            return None
        return (0, FORCE) if self.is_flying else (0, 0)

    def shows(self, at):
        del at
        # read: MainStatusIndicator.qml, mainStatusText, of a vehicle without PX4's health reports. Without the pre-arm
        # bit "Ready To Fly" also needs the vehicle's setup to be complete: taken for granted.
        is_ready = self.is_ready if self.knows_prearm else self.all_healthy
        if self.armed:
            status, colour = "Flying" if self.is_flying else "Armed", "green"
        elif is_ready:
            status, colour = "Ready To Fly", "green"
        else:
            status, colour = "Not Ready", "yellow"
        return QGroundControlShows(
            status=status,
            status_colour=colour,
            disarm=self.disarm(),
            judges_by=self.judges_by,
            batteries=dict(self.batteries),
            sensor_errors=self.sensor_errors,
            errors=list(self.errors),
        )


def charge_state_by_flags(status):
    """read: BatteryFactGroupListModel.cc, _handleBatteryStatusV2.

    The limits of LOW and CRITICAL are those of the toolbar's colours: a pack at 80 % reads as LOW.
    """
    if status.flags & FLAGS_FAULT:
        return FAILED
    if status.flags & FLAG_NOT_READY:
        return EMERGENCY
    if status.flags & FLAG_CHARGING:
        return CHARGING
    if status.percent is None or status.percent > ToolbarBattery.GOOD_PCT:
        return OK
    return CRITICAL if status.percent <= ToolbarBattery.FAIR_PCT else LOW


def before(end, values):
    values = list(values)
    return values[: values.index(end)] if end in values else values


def known(value):
    return None if math.isnan(value) else value


# ---------------------------------------------------------------- QGroundControl: connecting

# Dialogs.
MISSION_FAILED = "Mission transfer failed. Error: Mission request list failed, maximum retries exceeded."
SETUP_REQUIRED = "One or more vehicle components require setup prior to flight."
PARAMETERS_MISSING = (
    "Parameters are missing from firmware. You may be running a version of firmware which is not fully supported or your "
    "firmware has a bug in it. Missing params: "
)

FLY_VIEW = "Fly View"
VEHICLE_SETUP = "Vehicle Setup"

RC_MAP = ("RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_YAW", "RCMAP_THROTTLE")
ACCELEROMETER_OFFSETS = ("INS_ACCOFFS_X", "INS_ACCOFFS_Y", "INS_ACCOFFS_Z")
# read: APMRadioComponent.cc: with these on every mapped channel the radio is not calibrated.
NOT_CALIBRATED = {"MIN": 1100, "MAX": 1900, "TRIM": 1500}


class Facts:
    """Parameters as QGroundControl's components and pages read them."""

    def __init__(self, parameters):
        self.parameters = parameters
        self.asked = {}

    def read(self, name):
        # read: ParameterManager.cc, getParameter: one that is missing is reported and reads as 0.
        self.asked[name] = None
        return self.parameters.get(name, 0)

    def exists(self, name):
        return name in self.parameters

    @property
    def missing(self):
        """In the order in which they were asked for."""
        return [name for name in self.asked if name not in self.parameters]


def radio_is_set_up(facts):
    # read: APMRadioComponent.cc, constructor and setupComplete.
    channels = [int(facts.read(name)) for name in RC_MAP]
    limits = [{limit: facts.read(f"RC{channel}_{limit}") for limit in NOT_CALIBRATED} for channel in channels]
    return min(channels) > 0 and any(limit != NOT_CALIBRATED for limit in limits)


def sensors_are_set_up(facts):
    # read: APMSensorsComponent.cc, compassSetupNeeded and accelSetupNeeded.
    if any(compass_needs_calibration(facts, number) for number in ("", 2, 3)):
        return False
    return any([facts.read(name) for name in ACCELEROMETER_OFFSETS])


def compass_needs_calibration(facts, number):
    if facts.read(f"COMPASS_DEV_ID{number}") == 0 or facts.read(f"COMPASS_USE{number}") == 0:
        return False
    return any(facts.read(f"COMPASS_OFS{number}_{axis}") == 0 for axis in "XYZ")


# The components with a mark in the Summary. recorded: Power, Motors and Safety have none. Flight Modes are always green:
# read, APMFlightModesComponent.cc.
COMPONENTS = {
    "Radio": radio_is_set_up,
    "Flight Modes": lambda facts: True,
    "Sensors": sensors_are_set_up,
}


def read_modes(facts):
    # read: APMFlightModesComponentSummary.qml, APMFlightModesComponentController.cc: a rover is recognised by MODE1.
    prefix = "MODE" if facts.exists("MODE1") else "FLTMODE"
    for slot in range(1, 7):
        facts.read(f"{prefix}{slot}")


def read_sensors(facts):
    # read: APMSensorParams.qml.
    for number in ("", 2, 3):
        facts.read(f"COMPASS_DEV_ID{number}")
        for axis in "XYZ":
            facts.read(f"COMPASS_OFS{number}_{axis}")
    facts.read("COMPASS_DEC")


def open_summary(facts):
    # read: the ComponentSummary.qml of Radio, Flight Modes, Sensors, Power and Safety, in which the failsafes of the
    # rover are shown empty, not reported, if they are missing.
    for name in RC_MAP:
        facts.read(name)
    read_modes(facts)
    read_sensors(facts)
    facts.read("BATT_MONITOR")
    facts.read("ARMING_CHECK")


def open_radio(facts):
    # read: RadioComponentController.cc, _setInternalCalibrationValuesFromParameters: channels that are not there are
    # left out.
    for name in RC_MAP:
        facts.read(name)
    reversal = "REVERSED" if facts.exists("RC1_REVERSED") else "REV"
    for channel in range(1, 19):
        if facts.exists(f"RC{channel}_MIN"):
            for field_name in (*NOT_CALIBRATED, reversal):
                facts.read(f"RC{channel}_{field_name}")


def open_flight_modes(facts):
    # read: APMFlightModesComponent.qml. The channel of the modes is asked for only if it is there.
    read_modes(facts)
    for channel in range(6, 17):
        facts.read(f"RC{channel}_OPTION")


def open_sensors(facts):
    # read: APMSensorsComponent.qml.
    facts.read("AHRS_ORIENTATION")
    read_sensors(facts)
    sensors_are_set_up(facts)


def open_power(facts):
    # read: APMPowerComponent.qml. The rest of a pack is asked for only if it is there.
    facts.read("BATT_MONITOR")


def open_safety(facts):
    # read: APMSafetyComponent.qml; recorded: the failsafes of a rover only with MODE1.
    facts.read("BATT_MONITOR")
    facts.read("ARMING_CHECK")
    if facts.exists("MODE1"):
        for name in ("FS_GCS_ENABLE", "FS_THR_ENABLE", "FS_THR_VALUE", "FS_ACTION", "FS_CRASH_CHECK"):
            facts.read(name)


# The pages of Vehicle Setup that read parameters by name.
PAGES = {
    "Summary": open_summary,
    "Radio": open_radio,
    "Flight Modes": open_flight_modes,
    "Sensors": open_sensors,
    "Power": open_power,
    "Safety": open_safety,
}


def missing_on_page(page, parameters):
    """The parameters that are reported as missing when a page of Vehicle Setup is opened."""
    facts = Facts(parameters)
    PAGES[page](facts)
    return facts.missing


@dataclass(frozen=True)
class Connected:
    """What is shown once QGroundControl has connected."""

    dialogs: list
    # Those in the dialog about missing parameters.
    missing: list
    view: str
    # "green" or "red" by component.
    summary: dict


def connected(parameters, mission_failed=False):
    """What is shown after it has read these parameters."""
    # read: AutoPilotPlugin.cc, parametersReadyPreChecks.
    facts = Facts(parameters)
    summary = {name: "green" if is_set_up(facts) else "red" for name, is_set_up in COMPONENTS.items()}
    is_set_up = "red" not in summary.values()
    if not is_set_up:
        open_summary(facts)
    # read: QGCApplication.cc, reportMissingParameter: the dialog waits a second for further ones.
    missing = facts.missing
    dialogs = [] if is_set_up else [SETUP_REQUIRED]
    if missing:
        dialogs.append(PARAMETERS_MISSING + ", ".join(f"1:{name}" for name in missing))
    if mission_failed:
        dialogs.append(MISSION_FAILED)
    return Connected(dialogs, missing, FLY_VIEW if is_set_up else VEHICLE_SETUP, summary)


# The kinds of BATT_MONITOR in descriptions that are built in, by the release of Rover that they describe; others lie
# between. recorded: seven and 22; the numbers are those of ArduPilot's lists in these releases.
BUILT_IN_KINDS = {(3, 4): {0, *range(3, 9)}, (4, 2): {0, *range(3, 24)}}


def described_kinds(version, descriptions=None):
    """The kinds of BATT_MONITOR that have a name; others are shown as "Unknown" and their number.

    `descriptions` is what the vehicle itself gives, the content of its file for COMP_METADATA_TYPE_PARAMETER.
    """
    if descriptions is not None:
        # read: CompInfoParam.cc: it replaces what is built in, for all parameters.
        (monitor,) = [entry for entry in descriptions["parameters"] if entry["name"] == "BATT_MONITOR"]
        return {entry["value"] for entry in monitor.get("values", [])}
    # read: APMFirmwarePlugin.cc, _internalParameterMetaDataFile: the newest that is not newer than the vehicle's
    # release, else the oldest.
    older = [release for release in BUILT_IN_KINDS if release <= version[:2]]
    return BUILT_IN_KINDS[max(older, default=min(BUILT_IN_KINDS))]


def description_of(descriptions, name):
    """The row of a parameter in the file for COMP_METADATA_TYPE_PARAMETER, or `None`."""
    # read: CompInfoParam.cc, factMetaDataForName: the row with the name, else the last whose name with an index is found in it.
    rows = descriptions["parameters"]
    by_index = [
        row
        for row in rows
        if "{n}" in row["name"] and re.search(row["name"].replace("{n}", r"(\d+)"), name)
    ]
    return next((row for row in rows if row["name"] == name), by_index[-1] if by_index else None)


def flight_version(autopilot_version):
    """Major, minor, patch and type. read: InitialConnectStateMachine.cc; type 0 is a development version."""
    return tuple(autopilot_version.flight_sw_version.to_bytes(4, "big"))


def log_date(time_utc):
    """The date in the list of logs. read: LogDownloadController.cc; recorded: the text."""
    date = datetime.datetime.fromtimestamp(time_utc, datetime.timezone.utc)
    return "Date Unknown" if date.year < 2010 else f"{date:%Y-%m-%d}"


# ---------------------------------------------------------------- MAVProxy


@dataclass(frozen=True)
class MavProxyShows:
    # What the command `bat` prints.
    bat: str
    # The battery's entry in the console window.
    battery: str
    # The fence's entry there is black, grey, green or red.
    fence_colour: str
    # "PRE" there: `None` if it is not shown.
    prearm_colour: str | None
    safety_is_on: bool


@dataclass
class MavProxy:
    """MAVProxy 1.8.74. What it says is printed, and spoken by its module `speech`.

    The modules that say something of a battery monitor are loaded by themselves, but for `console`.
    """

    console: bool = True
    parameters: dict = field(default_factory=dict)
    # What it has said.
    said: list = field(default_factory=list)
    # What it has printed of the vehicle's texts, beginning with "AP: ".
    printed: list = field(default_factory=list)

    def __post_init__(self):
        self.online = self.armed = False
        self.mode = "MAV"
        self.mode_said_at = -math.inf
        self.fence = dict(present=False, enabled=False, healthy=True)
        self.health = 0
        self.prearm_colour = None
        self.safety_is_on = False
        self.critical_said_at = -math.inf
        self.batteries = {}
        self.battery_said_at = -math.inf
        self.statustexts = Statustexts()
        self.last_text, self.last_text_at = None, -math.inf

    def take(self, message, at):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.take_heartbeat(message, at)
        elif kind == "SYS_STATUS":
            self.take_sys_status(message, at)
        elif kind == "BATTERY_STATUS":
            self.take_battery_status(message)
        elif kind == "STATUSTEXT":
            whole = self.statustexts.take(message)
            if whole:
                self.take_text(whole, at)
        elif kind == "PARAM_VALUE":
            self.parameters[message.param_id] = message.param_value
        # package: mavproxy_battery.py, battery_report, five times a second with any message.
        self.report_battery(at)

    def take_heartbeat(self, heartbeat, at):
        # package: mavproxy_link.py, master_msg_handling.
        if not self.online:
            self.online = True
            self.said.append("online system 1")
        armed = is_set(heartbeat.base_mode, ARMED)
        if armed != self.armed:
            self.armed = armed
            self.said.append("ARMED" if armed else "DISARMED")
        mode = mavutil.mode_string_v10(heartbeat)
        if mode != self.mode and at > self.mode_said_at + 2:
            self.mode, self.mode_said_at = mode, at
            self.said.append(f"Mode {mode}")

    def take_sys_status(self, status, at):
        self.take_fence(status)
        if self.console:
            self.take_console(status, at)

    def take_fence(self, status):
        # package: mavproxy_fence.py, handle_sys_status. Each of the three bits for itself, from one message to the
        # next; before the first the fence is absent, disabled and healthy. So the health bit alone decides on "fence
        # breach", present or not.
        masks = {
            "present": status.onboard_control_sensors_present,
            "enabled": status.onboard_control_sensors_enabled,
            "healthy": status.onboard_control_sensors_health,
        }
        words = {
            "present": ("fence removed", "fence present"),
            "enabled": ("fence disabled", "fence enabled"),
            "healthy": ("fence breach", "fence OK"),
        }
        for name, mask in masks.items():
            now = is_set(mask, GEOFENCE)
            if now != self.fence[name]:
                self.said.append(words[name][now])
            self.fence[name] = now

    def take_console(self, status, at):
        # package: mavproxy_console.py, check_critical_error, every 30 s: of ArduPilot only, whose number we have.
        mask = status.errors_count1 | status.errors_count2 << 16
        if mask and at > self.critical_said_at + 30:
            self.critical_said_at = at
            self.said.append(f"Critical failure 0x{mask:x} sysid=1 compid=1")
        # package: the same, handle_sys_status. Before the first message nothing was healthy.
        present, enabled = status.onboard_control_sensors_present, status.onboard_control_sensors_enabled
        health = status.onboard_control_sensors_health
        for bit, name in ((RC_RECEIVER, "RC"), (PREARM_CHECK, "pre-arm")):
            if is_set(enabled, bit) and is_set(self.health, bit) and not is_set(health, bit):
                self.said.append(f"{name} fail")
        if is_set(enabled & health, PREARM_CHECK) and not is_set(self.health, PREARM_CHECK):
            self.said.append("pre-arm good")
        self.health = health
        if is_set(present, PREARM_CHECK):
            colour = "green" if is_set(health, PREARM_CHECK) else "red"
            self.prearm_colour = colour if is_set(enabled, PREARM_CHECK) else "grey"
        # The same rule for the command `arm safetystatus`: mavproxy_arm.py.
        self.safety_is_on = not is_set(enabled, MOTOR_OUTPUTS)

    def take_battery_status(self, status):
        # package: mavproxy_battery.py, battery_update: `voltages` only, without `voltages_ext`.
        volts = sum(mv for mv in status.voltages if mv != UNKNOWN_MV) * 0.001
        self.batteries[status.id] = (status.battery_remaining, volts, status.current_battery * 0.01)

    def report_battery(self, at):
        # package: mavproxy_battery.py, battery_report. Only of the first pack, only with BATT_MONITOR of 4 or more,
        # at most once a minute. The level said last is never kept, so a level is said each time unless it is 0. An
        # unknown charge, −1, is rounded to 0, and warned of.
        if 0 not in self.batteries or self.parameters.get("BATT_MONITOR", 0) < 4 or at <= self.battery_said_at + 60:
            return
        percent = self.batteries[0][0]
        rounded = int((percent + 5) / 10) * 10
        if rounded != 0:
            self.said.append(f"Flight battery {rounded} percent")
        if rounded <= 20:
            self.said.append("Flight battery warning")
        self.battery_said_at = at

    def take_text(self, text, at):
        # package: mavproxy_link.py, emit_accumulated_statustext. The severity only colours it.
        if text.text != self.last_text or at > self.last_text_at + 2:
            self.printed.append(f"AP: {text.text}")
            self.last_text, self.last_text_at = text.text, at

    def shows(self, at):
        del at
        return MavProxyShows(
            # package: mavproxy_battery.py, cmd_bat, while `numcells` is 0.
            bat=f"Flight battery:   {self.batteries[0][0]}%" if 0 in self.batteries else "No battery information",
            battery=self.battery_entry(),
            fence_colour=self.fence_colour(),
            prearm_colour=self.prearm_colour,
            safety_is_on=self.safety_is_on,
        )

    def battery_entry(self):
        # package: mavproxy_battery.py, battery_report, while `numcells` is 0.
        entries = []
        for number, (percent, volts, amperes) in sorted(self.batteries.items()):
            monitor = self.parameters.get(f"BATT{number + 1 if number else ''}_MONITOR", 0)
            if monitor == 3:
                entries.append(f"Batt{number + 1}: {volts:.2f}V ")
            elif monitor >= 4:
                entries.append(f"Batt{number + 1}: {percent}%/{volts:.2f}V {amperes:.1f}A ")
        return "".join(entries)

    def fence_colour(self):
        # package: mavproxy_fence.py, handle_sys_status.
        if not self.fence["present"]:
            return "black"
        if not self.fence["enabled"]:
            return "grey"
        return "green" if self.fence["healthy"] else "red"


# ---------------------------------------------------------------- all of them


class Oracle:
    """All ground stations on one link to the autopilot of `system`."""

    def __init__(self, system=1, component=1, mission_planner=None, qgroundcontrol=None, mavproxy=None):
        self.source = (system, component)
        self.mission_planner = mission_planner or MissionPlanner()
        self.qgroundcontrol = qgroundcontrol or QGroundControl()
        self.mavproxy = mavproxy or MavProxy()
        self.at = 0.0

    def take(self, message, at):
        """A message that came at a time that does not go back; others' messages are none of its business."""
        if source_of(message) != self.source:
            return
        self.at = at
        for station in (self.mission_planner, self.qgroundcontrol, self.mavproxy):
            station.take(message, at)


def source_of(message):
    if message.get_type().startswith("UNKNOWN_"):
        # pymavlink leaves the sender of a message it doesn't know out.
        return message.data[5], message.data[6]
    return message.get_srcSystem(), message.get_srcComponent()
