"""The release firmware at an emulated CAN bus, with PyPI dronecan as another node on it."""

import queue
import threading
import time
from concurrent.futures import Future
from contextlib import closing

import dronecan
import pytest
from dronecan.app.dynamic_node_id import CentralizedServer
from dronecan.app.node_monitor import NodeMonitor

from conftest import CanBoard
from slcan_pty import SlcanPort
from station import connect, messages_of, pack, restarted, set_to, volts

# One board at a time.
pytestmark = pytest.mark.xdist_group("dronecan")

BIT_RATE = 1_000_000
BOARD, PEER = 10, 42
NAME = "org.rover-battmon"
DRONECAN = 8
SETTINGS = {
    "CAN_P1_DRIVER": 1,
    "BATT2_MONITOR": DRONECAN,
    "BATT2_SERIAL_NUM": 1,
    "BATT3_MONITOR": DRONECAN,
    "BATT3_SERIAL_NUM": 2,
}

# Steps of half-precision numbers at these values: 1/128 V below 16 V, 1/256 A below 8 A, 1/4 K.
STEP_V, STEP_A, STEP_K = 1 / 128, 1 / 256, 1 / 4
LOST_AFTER_S = 5
KELVIN = 273.15

POWER = dronecan.uavcan.equipment.power


class Peer:
    """A node in a thread of its own, which sends what its batteries measure ten times a second."""

    def __init__(self, tcp_port):
        self.port = SlcanPort(tcp_port)
        self.node = dronecan.make_node(f"slcan:{self.port.name}", node_id=PEER, bitrate=BIT_RATE, baudrate=115200)
        self.node.mode = dronecan.uavcan.protocol.NodeStatus().MODE_OPERATIONAL
        self.monitor = NodeMonitor(self.node)
        self.batteries = {}
        self.node.periodic(0.1, self.send)
        self.calls = queue.SimpleQueue()
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while not self.over.is_set():
            self.node.spin(0.02)
            while not self.calls.empty():
                function, future = self.calls.get()
                future.set_result(function())

    def call(self, function):
        """The result of what is done in the thread of the node."""
        future = Future()
        self.calls.put((function, future))
        return future.result(timeout=10)

    def send(self):
        for number, values in list(self.batteries.items()):
            self.node.broadcast(POWER.BatteryInfo(battery_id=number, **values))

    def measure(self, number, volts, amperes, celsius=25, percent=50):
        self.batteries[number] = {
            "voltage": volts,
            "current": amperes,
            "temperature": celsius + KELVIN,
            "state_of_charge_pct": percent,
            "remaining_capacity_wh": 50,
            "full_charge_capacity_wh": 100,
        }

    def close(self):
        self.over.set()
        self.thread.join()
        self.node.close()
        self.port.close()


def wait_for(condition, seconds=10):
    end = time.monotonic() + seconds
    while not (result := condition()):
        assert time.monotonic() < end, "it never came"
        time.sleep(0.1)
    return result


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    board = CanBoard(tmp_path_factory.mktemp("can") / "flash")
    try:
        with closing(connect(board.usb_url)) as usb:
            for name, value in SETTINGS.items():
                assert set_to(usb, name, value).param_value == value
            restarted(usb, board.usb_url).close()
        yield board
        assert " Error " not in board.switch_off()
    finally:
        board.kill()


@pytest.fixture
def vehicle(board):
    with closing(connect(board.usb_url)) as vehicle:
        yield vehicle


@pytest.fixture
def peer(board):
    with closing(Peer(board.can_port)) as peer:
        yield peer
        for trouble in ("load 0", "noise 0", "wires sound"):
            board.trouble(trouble)


def assert_measured(vehicle, instance, values):
    def agrees():
        status = pack(vehicle, instance)
        return (
            abs(volts(status) - values["voltage"]) <= STEP_V + 0.001
            and abs(status.current_battery / 100 - values["current"]) <= STEP_A + 0.01
            and abs(status.temperature / 100 + KELVIN - values["temperature"]) <= STEP_K + 0.01
            and status.battery_remaining == values["state_of_charge_pct"]
        )

    wait_for(agrees)


def texts(vehicle, seconds):
    return [message.text for message in messages_of(vehicle, seconds) if message.get_type() == "STATUSTEXT"]


def test_a_node_monitor_sees_the_board(board, peer):
    def board_info():
        exists = peer.call(lambda: peer.monitor.exists(BOARD))
        return exists and peer.call(lambda: peer.monitor.get(BOARD).info)

    info = wait_for(board_info)
    assert info.name.decode() == NAME
    assert info.status.health == info.status.HEALTH_OK
    assert info.status.mode == info.status.MODE_OPERATIONAL
    assert any(info.hardware_version.unique_id)


def test_two_batteries_reach_the_wire_within_a_step(peer, vehicle):
    for step in range(3):
        peer.measure(1, 12.5 + 0.3 * step, 3.3 + step, 20.2 + step, 80 - step)
        peer.measure(2, 11.1 - 0.2 * step, 0.7 * step, 30.3 - step, 33 + step)
        for number in (1, 2):
            assert_measured(vehicle, number, peer.batteries[number])


def test_a_battery_is_lost_and_found_again(peer, vehicle):
    peer.measure(1, 12.5, 1)
    assert_measured(vehicle, 1, peer.batteries[1])
    values = peer.batteries.pop(1)
    assert any(text.startswith("Battery 2 unhealthy") for text in texts(vehicle, LOST_AFTER_S + 3))
    peer.batteries[1] = values
    assert "Battery 2 healthy again" in texts(vehicle, 4)


@pytest.mark.parametrize("trouble", ["load 0.9", "noise 0.1"])
def test_readings_come_through(board, peer, vehicle, trouble):
    peer.measure(1, 12.5, 1)
    assert_measured(vehicle, 1, peer.batteries[1])
    board.trouble(trouble)
    peer.measure(1, 13.25, 2)
    assert_measured(vehicle, 1, peer.batteries[1])
    assert not any("unhealthy" in text for text in texts(vehicle, LOST_AFTER_S + 2))


def test_after_bus_off_everything_works_again(board, peer, vehicle):
    peer.measure(1, 12.5, 1)
    assert_measured(vehicle, 1, peer.batteries[1])
    board.trouble("wires shorted")
    assert any(text.startswith("CAN bus off") for text in texts(vehicle, 4))
    board.trouble("wires sound")
    peer.measure(1, 13.25, 2)
    assert_measured(vehicle, 1, peer.batteries[1])


def test_the_board_gets_its_id_from_an_allocator(board, peer, vehicle):
    """The last one: the board keeps its setting."""
    server = peer.call(lambda: CentralizedServer(peer.node, peer.monitor))
    assert set_to(vehicle, "CAN_D1_UC_NODE", 0).param_value == 0
    with closing(restarted(vehicle, board.usb_url)):
        table = wait_for(lambda: [row for row in peer.call(server.get_allocation_table) if row[1] != PEER], 20)
        number = table[0][1]
        wait_for(lambda: peer.call(lambda: number in peer.monitor.get_all_node_id()))
        info = wait_for(lambda: peer.call(lambda: peer.monitor.get(number).info))
        assert info.name.decode() == NAME
    peer.call(server.close)
