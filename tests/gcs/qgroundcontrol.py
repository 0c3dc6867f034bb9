"""QGroundControl as a script: it sends what the program sends to an ArduPilot rover, with its timers.

The sequence is that of December 2023 (e0e8c496c); beside each rule stands its source, as in `oracle.py`, which derives
from the answers what is shown. `Script` takes messages and times and does no I/O, so that it also runs against what was
recorded; `Station` is a script at the end of a link.
"""

import json
import lzma
import re
import struct
import time

from pymavlink import mavftp, mavutil

import oracle
from station import opened

mavlink = mavutil.mavlink

SYSTEM, COMPONENT = 255, mavlink.MAV_COMP_ID_MISSIONPLANNER
VEHICLE = (1, 1)

REQUEST_MESSAGE = mavlink.MAV_CMD_REQUEST_MESSAGE
SET_MESSAGE_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
AUTOPILOT_VERSION = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
HOME_POSITION = mavlink.MAVLINK_MSG_ID_HOME_POSITION
# pymavlink 2.4.50 does not know these two.
COMPONENT_INFORMATION, COMPONENT_METADATA = 395, 397
COMP_METADATA_TYPE_PARAMETER = 1

# read: Vehicle.h: until a command is sent again, and how often it is sent.
COMMAND_S, COMMAND_TRIES = 3, 4
# read: PlanManager.h, _ackTimeoutMilliseconds and _maxRetryCount; recorded: seven requests.
LIST_S, LIST_TRIES = 1.5, 7
# read: ParameterManager.cc, _initialRequestTimeoutTimer.
PARAMETERS_S = 5
# read: FTPManager.h.
FILE_S = 1

# read: APMFirmwarePlugin.cc, initializeStreamRates. recorded: the rates.
STREAMS = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: 2,
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: 2,
    mavlink.MAV_DATA_STREAM_RC_CHANNELS: 2,
    mavlink.MAV_DATA_STREAM_POSITION: 3,
    mavlink.MAV_DATA_STREAM_EXTRA1: 10,
    mavlink.MAV_DATA_STREAM_EXTRA2: 10,
    mavlink.MAV_DATA_STREAM_EXTRA3: 3,
}
# read: Vehicle.h, _sendMessageMultipleRetries and _sendMessageMultipleIntraMessageDelay.
STREAM_TRIES, STREAM_S = 5, 0.5
# read: APMFirmwarePlugin.cc, adjustIncomingMavlinkMessage: more than ten whole seconds without one of the two.
MISSED_S = 11

# The operations and errors of MAVLink FTP that occur.
RESET_SESSIONS, OPEN_FOR_READING, BURST_READ, ACK, NAK = 2, 4, 15, 128, 129
END_OF_FILE, FILE_NOT_FOUND = 6, 10
PART_BYTES = 239


def is_named(*names):
    return lambda message: message.get_type() in names


def unread(_):
    return False


def error_of(data):
    """The error in a refusal. read: FTPManager.cc, _errorMsgFromNak: of one byte, else it is none that is known."""
    return data[0] if len(data) == 1 else None


class Script:
    """What QGroundControl sends from the first heartbeat on. Times are in seconds of any origin."""

    def __init__(self, at):
        self.encoder = mavlink.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
        # To be sent now.
        self.outgoing = []
        self.at = self.begun_at = at
        self.connected_at = None
        # What it has read.
        self.version = None
        self.capabilities = 0
        self.descriptions = None
        self.parameters = {}
        # The error of the refusal to open the file of parameters, if it was refused.
        self.file_error = None
        self.mission_failed = False

        self.sequence = 0
        self.streams, self.next_stream = [], 0
        self.stream_at = at + STREAM_S
        self.seen_at = {"BATTERY_STATUS": at, "HOME_POSITION": at}
        self.until, self.wanted = at, None
        self.steps = self.connect()
        self.advance(None)
        self.request_streams()

    @property
    def shows(self):
        return oracle.connected(self.parameters, self.mission_failed)

    @property
    def connecting_s(self):
        return self.connected_at - self.begun_at

    def take(self, message, at):
        self.at = at
        if message.get_type() in self.seen_at:
            self.seen_at[message.get_type()] = at
        if self.wanted is not None and self.wanted(message):
            self.advance(message)

    def tick(self, at):
        """Has to be called every few milliseconds."""
        self.at = at
        if self.wanted is not None and at >= self.until:
            self.advance(None)
        if at - min(self.seen_at.values()) >= MISSED_S:
            self.request_streams()
        if at >= self.stream_at:
            self.stream_at += STREAM_S
            self.request_next_stream()

    def advance(self, answer):
        """Goes on with the sequence until it waits for the next answer."""
        try:
            seconds, self.wanted = self.steps.send(answer)
            self.until = self.at + seconds
        except StopIteration:
            self.wanted, self.connected_at = None, self.at

    # ------------------------------------------------------------ rates

    def request_streams(self):
        # read: APMFirmwarePlugin.cc, initializeStreamRates.
        self.seen_at = dict.fromkeys(self.seen_at, self.at)
        self.command(SET_MESSAGE_INTERVAL, HOME_POSITION, 1e6)
        self.streams += [(stream, STREAM_TRIES) for stream in STREAMS]

    def request_next_stream(self):
        # read: Vehicle.cc, _sendMessageMultipleNext: each in its turn, until it has been sent often enough.
        if not self.streams:
            return
        stream, tries = self.streams.pop(self.next_stream)
        self.outgoing.append(self.encoder.request_data_stream_encode(*VEHICLE, stream, STREAMS[stream], 1))
        if tries > 1:
            self.streams.insert(self.next_stream, (stream, tries - 1))
            self.next_stream += 1
        if self.next_stream >= len(self.streams):
            self.next_stream = 0

    # ------------------------------------------------------------ the sequence

    def connect(self):
        # read: InitialConnectStateMachine.cc. recorded: it asks neither for PROTOCOL_VERSION nor for AVAILABLE_MODES.
        version = yield from self.message(AUTOPILOT_VERSION, "AUTOPILOT_VERSION")
        if version is not None:
            self.version, self.capabilities = oracle.flight_version(version), version.capabilities
        yield from self.read_descriptions()
        self.parameters = yield from self.read_parameters()
        for _ in range(2):
            # read: Vehicle.cc, _parametersReady.
            self.outgoing.append(self.encoder.system_time_encode(int(time.time() * 1e6), 0))
        for kind in self.lists():
            yield from self.read_list(kind)

    def lists(self):
        """The lists that are read. read: GeoFenceManager.cc and RallyPointManager.cc, supported."""
        yield mavlink.MAV_MISSION_TYPE_MISSION
        if self.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE:
            yield mavlink.MAV_MISSION_TYPE_FENCE
        if self.capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_RALLY:
            yield mavlink.MAV_MISSION_TYPE_RALLY

    def read_list(self, kind):
        # read: PlanManager.cc.
        for _ in range(LIST_TRIES):
            self.outgoing.append(self.encoder.mission_request_list_encode(*VEHICLE, kind))
            count = yield LIST_S, lambda m: m.get_type() == "MISSION_COUNT" and m.mission_type == kind
            if count is not None:
                # A rover without missions: items are not read here.
                assert count.count == 0, count
                accepted = mavlink.MAV_MISSION_ACCEPTED
                self.outgoing.append(self.encoder.mission_ack_encode(*VEHICLE, accepted, kind))
                return
        self.mission_failed = True

    def read_descriptions(self):
        # read: RequestMetaDataTypeStateMachine.cc: the older message is asked for if the newer one is refused.
        metadata = yield from self.message(COMPONENT_METADATA, f"UNKNOWN_{COMPONENT_METADATA}")
        if metadata is None:
            yield from self.message(COMPONENT_INFORMATION, f"UNKNOWN_{COMPONENT_INFORMATION}")
            return
        # The file's address comes after the time and the checksum.
        payload = metadata.data[10 : 10 + metadata.data[1]]
        general = yield from self.read_json(bytes(payload[8:]).rstrip(b"\0").decode())
        for entry in (general or {}).get("metadataTypes", []):
            if entry["type"] == COMP_METADATA_TYPE_PARAMETER:
                self.descriptions = yield from self.read_json(entry["uri"])

    def read_json(self, uri):
        # read: FTPManager.cc, _parseURI.
        path = re.sub(r"^mftp://(\[;comp=\d+\])?", "", uri)
        content, _ = yield from self.download(path)
        if content is None:
            return None
        return json.loads(lzma.decompress(content) if path.endswith(".xz") else content)

    def read_parameters(self):
        # read: ParameterManager.cc, _ftpDownloadComplete. Only "file not found", and only at the first try, leads to
        # the list at once.
        for is_first in (True, False):
            content, error = yield from self.download("@PARAM/param.pck")
            if content is not None:
                return {name.decode(): value for name, value, _ in mavftp.MAVFTP.ftp_param_decode(content).params}
            self.file_error = error
            if is_first and error == FILE_NOT_FOUND:
                break
            yield PARAMETERS_S, unread
        return (yield from self.list_parameters())

    def list_parameters(self):
        listed = {}
        self.outgoing.append(self.encoder.param_request_list_encode(VEHICLE[0], mavlink.MAV_COMP_ID_ALL))
        while (message := (yield PARAMETERS_S, is_named("PARAM_VALUE"))) is not None:
            listed[message.param_index] = (message.param_id, message.param_value)
            if len(listed) == message.param_count:
                break
        return dict(listed.values())

    # ------------------------------------------------------------ requests

    def command(self, number, *parameters):
        parameters = list(parameters) + [0] * (7 - len(parameters))
        self.outgoing.append(self.encoder.command_long_encode(*VEHICLE, number, 0, *parameters))

    def message(self, number, name):
        """A message that is asked for, `None` if it is refused or does not come."""

        def is_answer(message):
            if message.get_type() == "COMMAND_ACK":
                return message.command == REQUEST_MESSAGE and message.result != mavlink.MAV_RESULT_ACCEPTED
            return message.get_type() == name

        for _ in range(COMMAND_TRIES):
            self.command(REQUEST_MESSAGE, number)
            answer = yield COMMAND_S, is_answer
            if answer is not None:
                return answer if answer.get_type() == name else None
        return None

    def download(self, path):
        """The content of a file, or `None` and the error of the refusal."""
        # read: FTPManager.cc. Links of tests lose nothing: parts that are missing are not modelled.
        opcode, session, _, data = yield from self.file_request(OPEN_FOR_READING, data=path.encode())
        if opcode != ACK:
            return None, error_of(data)
        content = b""
        while True:
            answer = yield from self.file_request(BURST_READ, session, len(content), PART_BYTES)
            while answer[0] == ACK:
                content += answer[3]
                if answer[2]:
                    break
                answer = yield from self.file_answer(BURST_READ)
            if answer[0] != ACK:
                break
        error = error_of(answer[3])
        yield from self.file_request(RESET_SESSIONS)
        return (content, None) if error == END_OF_FILE else (None, error)

    def file_request(self, opcode, session=0, offset=0, size=None, data=b""):
        size = len(data) if size is None else size
        header = struct.pack("<HBBBBBBI", self.sequence, session, opcode, size, 0, 0, 0, offset)
        self.sequence += 2
        payload = (header + data).ljust(251, b"\0")
        self.outgoing.append(self.encoder.file_transfer_protocol_encode(0, *VEHICLE, payload))
        return (yield from self.file_answer(opcode))

    def file_answer(self, request):
        """Opcode, session, whether a burst is complete, and data; no opcode if none came."""

        def is_answer(message):
            # read: FTPManager.cc: others are disregarded. In a burst the numbers go on.
            if message.get_type() != "FILE_TRANSFER_PROTOCOL" or message.target_system != SYSTEM:
                return False
            number, _, _, _, requested = struct.unpack_from("<HBBBB", bytes(message.payload))
            is_next = number >= self.sequence - 1 if request == BURST_READ else number == self.sequence - 1
            return requested == request and is_next

        message = yield FILE_S, is_answer
        if message is None:
            return None, 0, False, b""
        payload = bytes(message.payload)
        _, session, opcode, size, _, is_complete, _, _ = struct.unpack_from("<HBBBBBBI", payload)
        return opcode, session, bool(is_complete), payload[12 : 12 + size]


class Station:
    """QGroundControl at the end of a link, and all that has come."""

    def __init__(self, url):
        self.link = opened(url)
        self.link.mav.srcComponent = COMPONENT
        self.shown = oracle.QGroundControl()
        self.script = None
        # With the time at which they came.
        self.received = []
        self.heartbeat_at = 0
        self.link.message_hooks.append(self.take)

    def take(self, _, message):
        if oracle.source_of(message) != VEHICLE:
            return
        at = time.monotonic()
        self.received.append((at, message))
        self.shown.take(message, at)
        if self.script is None and message.get_type() == "HEARTBEAT":
            self.script = Script(at)
        if self.script is not None:
            self.script.take(message, at)

    def step(self):
        self.link.recv_match(blocking=True, timeout=0.02)
        at = time.monotonic()
        if at >= self.heartbeat_at:
            self.heartbeat_at = at + 1
            gcs, none = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
            self.link.mav.heartbeat_send(gcs, none, 0, 0, mavlink.MAV_STATE_ACTIVE)
        if self.script is not None:
            self.script.tick(at)
            while self.script.outgoing:
                self.link.mav.send(self.script.outgoing.pop(0))

    def run_for(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.step()

    def connect(self, seconds=30):
        """Until it has connected; returns what is then shown."""
        end = time.monotonic() + seconds
        while self.script is None or self.script.connected_at is None:
            assert time.monotonic() < end, "it did not connect in time"
            self.step()
        return self.script.shows

    def answer(self, send, wanted, seconds=3):
        """What comes to a request: the first message after it that is wanted."""
        begin, end = len(self.received), time.monotonic() + seconds
        send(self.link.mav)
        while time.monotonic() < end:
            self.step()
            for _, message in self.received[begin:]:
                if wanted(message):
                    return message
        raise AssertionError("no answer came")

    def command(self, number, *parameters):
        """Sends a command and returns its result."""
        parameters = list(parameters) + [0] * (7 - len(parameters))
        return self.answer(
            lambda mav: mav.command_long_send(*VEHICLE, number, 0, *parameters),
            lambda message: message.get_type() == "COMMAND_ACK" and message.command == number,
        ).result

    def set(self, name, value):
        """Sets a parameter; the answer is a PARAM_VALUE or a PARAM_ERROR."""
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        return self.answer(
            lambda mav: mav.param_set_send(*VEHICLE, name.encode(), value, kind),
            lambda message: message.get_type() in ("PARAM_VALUE", "PARAM_ERROR") and message.param_id == name,
        )

    def since(self, at, *names):
        """What has come since then, of these kinds."""
        return [message for time_s, message in self.received if time_s >= at and message.get_type() in names]

    def hears(self, send, pattern, seconds=3):
        """What `send` returns, and whether a text like this follows it."""
        begin = time.monotonic()
        returned, is_wanted = send(), re.compile(pattern, re.IGNORECASE).search
        while time.monotonic() < begin + seconds:
            if any(is_wanted(message.text) for message in self.since(begin, "STATUSTEXT")):
                return returned, True
            self.step()
        return returned, False

    def close(self):
        self.link.close()
