"""The rules of QGroundControl's connecting and arming, beside what the program sent and showed when it ran.

`tests/data/qgc-connect.log` is what QGroundControl of December 2023 (V vehicle, Q QGroundControl, seconds) and this rover
exchanged before the rover answered as one is expected to: three dialogs, Vehicle Setup, "Flying". Heartbeats, batteries,
parameters and files are not in it.
"""

import json
import lzma
import re
import struct

import pytest

from conftest import REPOSITORY
from oracle import (
    FLY_VIEW,
    FORCE,
    MISSION_FAILED,
    PAGES,
    PARAMETERS_MISSING,
    SETUP_REQUIRED,
    VEHICLE_SETUP,
    QGroundControl,
    connected,
    described_kinds,
    flight_version,
    log_date,
    missing_on_page,
)
from qgroundcontrol import (
    ACK,
    BURST_READ,
    COMPONENT_METADATA,
    END_OF_FILE,
    FILE_NOT_FOUND,
    NAK,
    OPEN_FOR_READING,
    Script,
)
from test_oracle import battery, ground, heartbeat, mavlink, text

LOG = REPOSITORY / "tests" / "data" / "qgc-connect.log"

# Of the parameters that were there when it was recorded, those of which QGroundControl's pages ask.
RECORDED_PARAMETERS = {"BATT_MONITOR": 3, "BATT_CAPACITY": 3300, "ARMING_CHECK": 1}

# Read from the dialog that was shown.
RECORDED_MISSING = {
    *("RCMAP_ROLL", "RCMAP_PITCH", "RCMAP_YAW", "RCMAP_THROTTLE", "RC0_MIN", "RC0_MAX", "RC0_TRIM"),
    *("COMPASS_DEV_ID", "COMPASS_DEV_ID2", "COMPASS_DEV_ID3", "COMPASS_DEC"),
    *("INS_ACCOFFS_X", "INS_ACCOFFS_Y", "INS_ACCOFFS_Z"),
    *(f"FLTMODE{slot}" for slot in range(1, 7)),
    *(f"COMPASS_OFS{number}_{axis}" for number in ("", 2, 3) for axis in "XYZ"),
}

LIMITS = {"MIN": 1000, "MAX": 2000, "TRIM": 1500}

# Added by a relay between the two: no dialog, the Fly View, all green.
RELAYED_PARAMETERS = RECORDED_PARAMETERS | {
    **{"RCMAP_ROLL": 1, "RCMAP_PITCH": 2, "RCMAP_THROTTLE": 3, "RCMAP_YAW": 4},
    **{f"RC{channel}_{name}": value for channel in range(1, 5) for name, value in LIMITS.items()},
    **{f"COMPASS_DEV_ID{number}": 0 for number in ("", 2, 3)},
    **{f"COMPASS_USE{number}": 0 for number in ("", 2, 3)},
    **{f"COMPASS_OFS{number}_{axis}": 0 for number in ("", 2, 3) for axis in "XYZ"},
    **{"COMPASS_DEC": 0, "INS_ACCOFFS_X": 0.01, "INS_ACCOFFS_Y": 0.01, "INS_ACCOFFS_Z": 0.01},
    **{"AHRS_ORIENTATION": 0, "MODE_CH": 8, "MODE1": 0} | {f"MODE{slot}": 4 for slot in range(2, 7)},
}


def recorded(sender):
    """The first connection in the log: time, kind of message, and its fields in text."""
    for line in LOG.read_text(encoding="utf-8").splitlines():
        at, by, kind, fields = line.split(maxsplit=3)
        if float(at) > 60:
            return
        if by == sender:
            yield float(at), kind, dict(re.findall(r"(\w+) : (\[[^]]*\]|[^,}]*)", fields))


def numbers(fields, *names):
    return [int(float(fields[name])) for name in names]


def answers():
    """What the vehicle answered, as far as the script waits for it, in reverse order."""
    messages = []
    for at, kind, fields in recorded("V"):
        if kind == "COMMAND_ACK":
            messages.append((at, mavlink.MAVLink_command_ack_message(*numbers(fields, "command", "result"))))
        elif kind == "AUTOPILOT_VERSION":
            messages.append((at, autopilot_version(*numbers(fields, "capabilities", "flight_sw_version"))))
    return messages[::-1]


def autopilot_version(capabilities, flight_sw_version):
    none = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(capabilities, flight_sw_version, 0, 0, 0, none, none, none, 0, 0, 0)


def file_message(request, opcode, data=b"", offset=0, is_complete=0):
    number, _, requested = struct.unpack_from("<HBB", bytes(request.payload))
    header = struct.pack("<HBBBBBBI", number + 1, 0, opcode, len(data), requested, is_complete, 0, offset)
    return mavlink.MAVLink_file_transfer_protocol_message(0, 255, 190, (header + data).ljust(251, b"\0"))


class Vehicle:
    """Answers what is not in the log, at once."""

    def __init__(self, parameters, file_error=FILE_NOT_FOUND, missions=False, version=None):
        self.parameters = parameters
        self.file_error = file_error
        self.missions = missions
        self.version = version

    def answer(self, message):
        kind = message.get_type()
        if kind == "FILE_TRANSFER_PROTOCOL":
            return [file_message(message, NAK, bytes([self.file_error]))]
        if kind == "PARAM_REQUEST_LIST":
            count = len(self.parameters)
            return [
                mavlink.MAVLink_param_value_message(name.encode(), value, 9, count, index)
                for index, (name, value) in enumerate(self.parameters.items())
            ]
        if kind == "MISSION_REQUEST_LIST" and self.missions:
            return [mavlink.MAVLink_mission_count_message(255, 190, 0, message.mission_type)]
        if kind == "COMMAND_LONG" and self.version is not None:
            if message.param1 == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
                return [autopilot_version(0, int.from_bytes(bytes(self.version), "big"))]
            return [mavlink.MAVLink_command_ack_message(message.command, mavlink.MAV_RESULT_UNSUPPORTED)]
        return []


def played(vehicle, seconds, answers=(), begin=2.94):
    """The script after it has played so long, and what it sent at which time."""
    script, sent, answers = Script(begin), [], list(answers)
    for step in range(round(seconds * 100)):
        at = begin + step / 100
        if step % 50 == 0:
            script.take(mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 0), at)
        while answers and answers[-1][0] <= at:
            script.take(answers.pop()[1], at)
        script.tick(at)
        while script.outgoing:
            message = script.outgoing.pop(0)
            sent.append((at, message))
            for answer in vehicle.answer(message):
                script.take(answer, at)
    return script, sent


@pytest.fixture(scope="module")
def replay():
    return played(Vehicle(RECORDED_PARAMETERS), 55.6 - 2.94, answers())


# ---------------------------------------------------------------- what it sends


def test_requests_are_those_recorded_at_their_times(replay):
    _, sent = replay
    ours = [
        (at, m.get_type(), m.command if hasattr(m, "command") else m.mission_type)
        for at, m in sent
        if m.get_type() in ("COMMAND_LONG", "MISSION_REQUEST_LIST")
    ]
    theirs = [
        (at, kind, *numbers(fields, "command" if kind == "COMMAND_LONG" else "mission_type"))
        for at, kind, fields in recorded("Q")
        if kind != "REQUEST_DATA_STREAM"
    ]
    assert [entry[1:] for entry in ours] == [entry[1:] for entry in theirs]
    assert [at for at, *_ in ours] == pytest.approx([at for at, *_ in theirs], abs=0.2)


def test_messages_that_are_asked_for_are_those_recorded(replay):
    _, sent = replay
    theirs = [numbers(fields, "param1") for _, kind, fields in recorded("Q") if kind == "COMMAND_LONG"]
    assert [[int(m.param1)] for _, m in sent if m.get_type() == "COMMAND_LONG"] == theirs


def test_stream_requests_are_those_recorded(replay):
    _, sent = replay
    ours = [(m.req_stream_id, m.req_message_rate) for _, m in sent if m.get_type() == "REQUEST_DATA_STREAM"]
    theirs = [
        tuple(numbers(fields, "req_stream_id", "req_message_rate"))
        for _, kind, fields in recorded("Q")
        if kind == "REQUEST_DATA_STREAM"
    ]
    assert abs(len(ours) - len(theirs)) <= 1
    assert ours[: len(theirs)] == theirs[: len(ours)]


def test_it_has_not_connected_before_the_list_is_given_up(replay):
    script, _ = replay
    assert script.connected_at - script.begun_at == pytest.approx(10.5, abs=0.3)


@pytest.mark.parametrize(
    ("error", "seconds"),
    [
        (FILE_NOT_FOUND, 0),
        # Recorded: ten seconds longer.
        (1, 10),
    ],
)
def test_how_the_file_of_parameters_is_refused_decides_how_long_it_takes(error, seconds):
    script, _ = played(Vehicle(RELAYED_PARAMETERS, error, missions=True, version=(4, 6, 0, 0)), 20)
    assert script.connecting_s == pytest.approx(seconds, abs=0.1)
    assert script.file_error == error and script.parameters.keys() == RELAYED_PARAMETERS.keys()


def test_lists_of_fences_and_rally_points_are_read_if_they_are_announced():
    vehicle = Vehicle(RELAYED_PARAMETERS, missions=True)
    both = mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY
    refused = mavlink.MAVLink_command_ack_message(512, mavlink.MAV_RESULT_UNSUPPORTED)
    answers = [(2.96, refused), (2.95, refused), (2.94, autopilot_version(both, 0))]
    _, sent = played(vehicle, 1, answers)
    assert [m.mission_type for _, m in sent if m.get_type() == "MISSION_REQUEST_LIST"] == [0, 1, 2]


class Files(Vehicle):
    """A vehicle with files, which it sends in bursts of two messages."""

    def __init__(self, files, described_by=None):
        super().__init__({}, missions=True, version=(4, 6, 0, 0))
        self.files = files
        self.described_by = described_by

    def answer(self, message):
        if message.get_type() == "COMMAND_LONG" and message.param1 == COMPONENT_METADATA and self.described_by:
            return [component_metadata(self.described_by)]
        if message.get_type() != "FILE_TRANSFER_PROTOCOL":
            return super().answer(message)
        payload = bytes(message.payload)
        opcode, (offset,) = payload[3], struct.unpack_from("<I", payload, 8)
        if opcode == OPEN_FOR_READING:
            path = payload[12 : 12 + payload[4]].decode()
            if path not in self.files:
                return [file_message(message, NAK, bytes([FILE_NOT_FOUND]))]
            self.content = self.files[path]
            return [file_message(message, ACK, struct.pack("<I", len(self.content)))]
        if opcode != BURST_READ:
            return [file_message(message, ACK)]
        if offset >= len(self.content):
            return [file_message(message, NAK, bytes([END_OF_FILE]))]
        parts = [self.content[start : start + 10] for start in (offset, offset + 10)]
        return [file_message(message, ACK, parts[0], offset), file_message(message, ACK, parts[1], offset + 10, 1)]


def component_metadata(uri):
    """The message as it is received. Its CRC_EXTRA is 182; pymavlink does not know it, and does not check it."""
    payload = (struct.pack("<II", 1000, 0) + uri.encode()).rstrip(b"\0")
    header = bytes([0xFD, len(payload), 0, 0, 0, 1, 1, 397 & 255, 397 >> 8, 0])
    crc = mavlink.x25crc(header[1:] + payload)
    crc.accumulate(bytes([182]))
    (message,) = mavlink.MAVLink(None).parse_buffer(header + payload + struct.pack("<H", crc.crc))
    return message


def test_parameters_are_read_from_their_file():
    # One float each, the second with one letter in common with the first.
    entries = struct.pack("<BB", 4, 3 << 4) + b"ABCD" + struct.pack("<f", 1.5)
    entries += struct.pack("<BB", 4, 1 | 2 << 4) + b"XYZ" + struct.pack("<f", 2.5)
    content = struct.pack("<HHH", 0x671B, 2, 2) + entries
    script, _ = played(Files({"@PARAM/param.pck": content}), 1)
    assert script.parameters == {"ABCD": 1.5, "AXYZ": 2.5}


@pytest.mark.parametrize(("suffix", "pack"), [("", bytes), (".xz", lzma.compress)])
def test_descriptions_are_read_from_the_vehicles_files(suffix, pack):
    descriptions = {"version": 1, "parameters": [{"name": "BATT_MONITOR", "values": [{"value": 32}]}]}
    general = {"version": 1, "metadataTypes": [{"type": 1, "uri": f"mftp://[;comp=1]/parameters.json{suffix}"}]}
    files = {"/general.json": json.dumps(general).encode(), "@PARAM/param.pck": struct.pack("<HHH", 0x671B, 0, 0)}
    files[f"/parameters.json{suffix}"] = pack(json.dumps(descriptions).encode())
    script, _ = played(Files(files, "mftp:///general.json"), 1)
    assert script.connected_at is not None
    assert described_kinds(script.version, script.descriptions) == {32}


# ---------------------------------------------------------------- what it shows


def test_the_recorded_traffic_leads_to_the_three_dialogs_and_vehicle_setup(replay):
    shows = replay[0].shows
    assert shows.view == VEHICLE_SETUP
    assert shows.dialogs[0] == SETUP_REQUIRED and shows.dialogs[2] == MISSION_FAILED and len(shows.dialogs) == 3
    assert shows.dialogs[1].startswith(PARAMETERS_MISSING + "1:RCMAP_ROLL, 1:RCMAP_PITCH, 1:RCMAP_YAW, ")
    assert shows.summary == {"Radio": "red", "Flight Modes": "green", "Sensors": "red"}
    assert set(shows.missing) == RECORDED_MISSING


def test_the_recorded_version_is_described_as_a_much_older_rover(replay):
    version = replay[0].version
    assert version == (0, 1, 0, 0)
    assert len(described_kinds(version)) == 7 and 21 not in described_kinds(version)


def test_what_the_relay_answered_leads_to_no_dialog():
    script, _ = played(Vehicle(RELAYED_PARAMETERS, missions=True, version=(4, 2, 3, 0)), 5)
    shows = script.shows
    assert (shows.dialogs, shows.view) == ([], FLY_VIEW)
    assert set(shows.summary.values()) == {"green"}
    assert len(described_kinds(script.version)) == 22


@pytest.mark.parametrize("page", PAGES)
def test_pages_that_were_opened_on_what_was_recorded(page):
    # Recorded: "again at each opening of Vehicle Setup, Radio, Flight Modes, Sensors"; Power and Safety worked.
    has_missing = page in ("Summary", "Radio", "Flight Modes", "Sensors")
    assert bool(missing_on_page(page, RECORDED_PARAMETERS)) == has_missing


def test_a_rovers_mode_makes_safety_ask_for_its_failsafes():
    missing = missing_on_page("Safety", RELAYED_PARAMETERS)
    assert missing == ["FS_GCS_ENABLE", "FS_THR_ENABLE", "FS_THR_VALUE", "FS_ACTION", "FS_CRASH_CHECK"]
    options = [f"RC{channel}_OPTION" for channel in range(6, 17)]
    assert missing_on_page("Flight Modes", RELAYED_PARAMETERS) == options


@pytest.mark.parametrize(
    ("changed", "red"),
    [
        ({"RCMAP_YAW": 0}, {"Radio"}),
        ({f"RC{n}_{name}": value for n in range(1, 5) for name, value in (("MIN", 1100), ("MAX", 1900))}, {"Radio"}),
        ({"RC1_MIN": 1100}, set()),
        ({"INS_ACCOFFS_X": 0, "INS_ACCOFFS_Y": 0}, set()),
        ({"INS_ACCOFFS_X": 0, "INS_ACCOFFS_Y": 0, "INS_ACCOFFS_Z": 0}, {"Sensors"}),
        ({"COMPASS_DEV_ID2": 7}, set()),
        ({"COMPASS_DEV_ID2": 7, "COMPASS_USE2": 1}, {"Sensors"}),
    ],
)
def test_what_makes_a_component_red(changed, red):
    shows = connected(RELAYED_PARAMETERS | changed)
    assert {name for name, colour in shows.summary.items() if colour == "red"} == red
    assert shows.view == (VEHICLE_SETUP if red else FLY_VIEW)
    assert (SETUP_REQUIRED in shows.dialogs) == bool(red)


def test_a_missing_parameter_is_a_dialog_without_vehicle_setup():
    without = {name: value for name, value in RELAYED_PARAMETERS.items() if name != "RC2_TRIM"}
    shows = connected(without)
    assert shows.dialogs == [PARAMETERS_MISSING + "1:RC2_TRIM"] and shows.view == FLY_VIEW


@pytest.mark.parametrize(
    ("version", "kinds"), [((3, 5, 0, 0), 7), ((4, 2, 0, 255), 22), ((4, 6, 0, 0), 22), ((0, 0, 0, 0), 7)]
)
def test_descriptions_that_are_built_in(version, kinds):
    assert len(described_kinds(version)) == kinds


def test_descriptions_of_the_vehicle_replace_those_that_are_built_in():
    monitor = {"name": "BATT_MONITOR", "values": [{"value": 0, "description": "Disabled"}]}
    assert described_kinds((4, 2, 0, 0), {"version": 1, "parameters": [monitor]}) == {0}


def test_version_bytes():
    assert flight_version(autopilot_version(0, 0x04060100)) == (4, 6, 1, 0)


@pytest.mark.parametrize(
    ("state", "status", "disarm"),
    [
        # Recorded, also in HOLD.
        (mavlink.MAV_STATE_ACTIVE, "Flying", (0, FORCE)),
        (mavlink.MAV_STATE_CRITICAL, "Flying", (0, FORCE)),
        (mavlink.MAV_STATE_STANDBY, "Armed", (0, 0)),
    ],
)
def test_armed_is_flying_by_the_state_of_the_heartbeat(state, status, disarm):
    shows = ground(heartbeat(armed=True, status=state)).shows(0)
    assert (shows.status, shows.disarm) == (status, disarm)
    assert ground(heartbeat(status=state)).shows(0).disarm is None


@pytest.mark.parametrize(("severity", "opens"), [(4, False), (3, True), (2, True)])
def test_severity_that_opens_a_box(severity, opens):
    # Recorded: 4 opens none, 2 does.
    assert bool(ground(battery(), text("Battery 1 is low", severity)).errors) == opens


def test_dates_of_logs():
    assert log_date(0) == "Date Unknown" and log_date(1_795_543_200) == "2026-11-24"
    assert QGroundControl().shows(0).disarm is None
