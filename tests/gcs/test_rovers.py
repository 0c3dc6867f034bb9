"""Twenty simulated rovers and one ground station, which hears all of them at one port."""

import time
from collections import defaultdict

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.telemetry import Telemetry
from pymavlink import mavutil

from conftest import free_port
from station import mavlink

ROVERS = range(1, 21)
# The one that is armed, and has a failsafe.
ONE = 7
EVERY = 0
RATES_HZ = {"HEARTBEAT": 1, "SYS_STATUS": 2, "BATTERY_STATUS": 2}
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED


@pytest.fixture
def start_fleet(start_simulator):
    """Starts the rovers, and returns the port that they send to."""

    def start(*arguments):
        port = free_port()
        simulator = start_simulator("--rovers", str(len(ROVERS)), "--udp", f"127.0.0.1:{port}", *arguments)
        return port, simulator

    return start


class Station:
    """A ground station of pymavlink's that keeps what each rover has sent."""

    def __init__(self, port):
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", source_system=255)
        self.heard = defaultdict(list)

    def listen(self, seconds):
        """What each rover has sent within this time."""
        begins = {rover: len(messages) for rover, messages in self.heard.items()}
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if (message := self.link.recv_match(blocking=True, timeout=left)) is not None:
                assert message.get_type() != "BAD_DATA"
                self.heard[message.get_srcSystem()].append(message)
        return {rover: messages[begins.get(rover, 0) :] for rover, messages in self.heard.items()}

    def listen_for_all(self):
        end = time.monotonic() + 10
        while set(self.heard) != set(ROVERS) and time.monotonic() < end:
            self.listen(0.5)
        assert set(self.heard) == set(ROVERS)

    def command(self, target, number, *parameters):
        parameters = list(parameters) + [0] * (7 - len(parameters))
        self.link.mav.command_long_send(target, 1, number, 0, *parameters)

    def lost(self):
        """How many messages of each rover have not come, by their sequence numbers."""
        return {rover: missing([m.get_seq() for m in messages]) for rover, messages in self.heard.items()}


def missing(numbers):
    return sum((after - before - 1) % 256 for before, after in zip(numbers, numbers[1:]))


def is_at(expected_hz, rate_hz, seconds):
    """Whether a rate is as expected: on a busy machine a simulated rover leaves some out; one more may fall into the time."""
    return expected_hz / 2 <= rate_hz <= expected_hz + 1.1 / seconds


def of_kind(messages, name):
    """Of each rover the messages of this kind, if it has sent any."""
    found = {rover: [m for m in sent if m.get_type() == name] for rover, sent in messages.items()}
    return {rover: sent for rover, sent in found.items() if sent}


def armed(messages):
    """The rovers that are armed, by their latest heartbeats."""
    return {rover for rover, sent in of_kind(messages, "HEARTBEAT").items() if sent[-1].base_mode & ARMED}


def test_a_station_of_pymavlink_hears_all_arms_one_and_sees_one_failsafe(start_fleet, tmp_path):
    port, simulator = start_fleet("--log", str(tmp_path))
    station = Station(port)
    station.listen_for_all()
    seconds = 4
    heard = station.listen(seconds)
    for name, expected_hz in RATES_HZ.items():
        hertz = {rover: len(sent) / seconds for rover, sent in of_kind(heard, name).items()}
        assert set(hertz) == set(ROVERS)
        assert all(is_at(expected_hz, rate, seconds) for rate in hertz.values()), (name, hertz)
    packs = of_kind(heard, "BATTERY_STATUS")
    assert {status.id for sent in packs.values() for status in sent} == {0}
    assert len({sent[-1].battery_remaining for sent in packs.values()}) >= 8

    station.command(ONE, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
    heard = station.listen(4)
    answers = of_kind(heard, "COMMAND_ACK")
    assert {rover: [answer.result for answer in sent] for rover, sent in answers.items()} == {ONE: [ACCEPTED]}
    assert armed(heard) == {ONE}

    for name, value in [("BATT_LOW_TIMER", 1), ("BATT_FS_LOW_ACT", 2), ("BATT_LOW_VOLT", 12.9)]:
        station.link.mav.param_set_send(ONE, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
    heard = station.listen(5)
    assert set(of_kind(heard, "PARAM_VALUE")) == {ONE}
    texts = {rover: [m.text for m in sent] for rover, sent in of_kind(heard, "STATUSTEXT").items()}
    assert set(texts) == {ONE} and any(text.startswith("Battery 1 is low ") for text in texts[ONE]), texts

    # To all: each answers for itself.
    station.command(EVERY, mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
    heard = station.listen(3)
    ids = {rover: sent[-1].uid for rover, sent in of_kind(heard, "AUTOPILOT_VERSION").items()}
    assert set(ids) == set(ROVERS) and len(set(ids.values())) == len(ROVERS)
    assert station.lost() == dict.fromkeys(ROVERS, 0)

    assert simulator.interrupt()[0] == 0
    lines = [line for line in simulator.output if line.startswith("20 rovers: ")]
    assert lines[0].startswith("20 rovers: 0 armed, 0 in failsafe"), lines
    assert lines[-1].startswith("20 rovers: 1 armed, 1 in failsafe"), lines
    assert any(f"rover {ONE}: Battery 1 is low" in line for line in simulator.output), simulator.output
    # Only the one that was armed has recorded something.
    assert {path.name for path in tmp_path.iterdir()} == {f"rover-{rover:02}" for rover in ROVERS}
    (path,) = tmp_path.glob("*/*.BIN")
    assert path.parent.name == f"rover-{ONE:02}"
    assert int(mavutil.mavlink_connection(str(path)).recv_match(type="BRD").Id, 16) == ids[ONE]


def test_a_station_of_mavsdk_hears_all_and_arms_one(start_fleet):
    port, _ = start_fleet()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(f"udpin://0.0.0.0:{port}")
    end = time.monotonic() + 10
    while len(mavsdk.get_systems()) < len(ROVERS) and time.monotonic() < end:
        time.sleep(0.2)
    systems = {system.get_system_id(): system for system in mavsdk.get_systems()}
    assert set(systems) == set(ROVERS)
    telemetry = {rover: Telemetry(system) for rover, system in systems.items()}
    counts = dict.fromkeys(ROVERS, 0)

    def count(_, rover):
        counts[rover] += 1

    for rover, plugin in telemetry.items():
        plugin.subscribe_battery(count, rover)
    time.sleep(1.5)
    before, seconds = dict(counts), 4
    time.sleep(seconds)
    hertz = {rover: (counts[rover] - before[rover]) / seconds for rover in ROVERS}
    assert all(is_at(RATES_HZ["BATTERY_STATUS"], rate, seconds) for rate in hertz.values()), hertz
    Action(systems[ONE]).arm()
    # Each has sent a heartbeat since.
    time.sleep(4)
    assert {rover for rover, plugin in telemetry.items() if plugin.armed()} == {ONE}
    mavsdk.destroy()
