"""The release firmware at an emulated CAN bus, with PyPI dronecan as the other nodes on it. Faults of wires, nodes and
controller are in `tests/firmware/can/`.
"""

import math
import time
from contextlib import closing, contextmanager

import pytest
from dronecan.app.dynamic_node_id import CentralizedServer

from conftest import CanBoard
from dronecan_peer import KELVIN, Charger, Newcomer, Peer, auxiliary, battery, controller
from station import command, connect, mavlink, receive, restarted, set_to, volts

# Two emulated boards at a time, this one and that of Wi-Fi, keep up with the wall clock on two processors.
pytestmark = pytest.mark.xdist_group("emulated_board")

BOARD, PEER = 10, 42
NAME = "org.rover-battmon"
NODE_A, NODE_B = 43, 44
# What allocators give away first.
HIGHEST_ID = CentralizedServer.DEFAULT_NODE_ID_RANGE[1]
CONTROLLERS = 50
FIRST, SECOND, DRIVE, SOLAR = range(1, 5)

DRONECAN, ESC = 8, 9
# Motor controllers 1 to 3.
CONTROLLER_MASK = 0b1110
SETTINGS = {
    "CAN_P1_DRIVER": 1,
    "CAN_D1_UC_NODE": BOARD,
    "BATT2_MONITOR": DRONECAN,
    "BATT2_SERIAL_NUM": 1,
    "BATT3_MONITOR": DRONECAN,
    "BATT3_SERIAL_NUM": 2,
    "BATT4_MONITOR": ESC,
    "BATT4_ESC_MASK": CONTROLLER_MASK,
    "BATT5_MONITOR": DRONECAN,
    "BATT5_SERIAL_NUM": PEER,
}
CHARGER_INPUT, OFF_AT_DISARM, ON_AT_ARM, OFF_AT_BOOT, DYNAMIC_NODE = (1 << bit for bit in (1, 2, 3, 4, 10))

LOST_AFTER_S = 5
UNKNOWN = 65535

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
# Without checks: packs that no peer measures are unhealthy.
BY_FORCE = 21196


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


@pytest.fixture(scope="module")
def connected_peer(board):
    with closing(Peer(board.can_port, PEER)) as peer:
        yield peer


@pytest.fixture
def peer(connected_peer):
    yield connected_peer
    connected_peer.reports.clear()


@pytest.fixture
def vehicle(board):
    with closing(connect(board.usb_url)) as vehicle:
        yield vehicle


@contextmanager
def trouble(board, words, end):
    board.trouble(words)
    yield
    board.trouble(end)


def wait_for(condition, seconds=10):
    end = time.monotonic() + seconds
    while not (result := condition()):
        assert time.monotonic() < end, "it never came"
        time.sleep(0.1)
    return result


def wait_for_text(vehicle, beginning, seconds=10):
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        message = vehicle.recv_match(type="STATUSTEXT", blocking=True, timeout=left)
        if message and message.text.startswith(beginning):
            return
    raise AssertionError(f"it never said {beginning!r}")


def reported(vehicle, instance, name="BATTERY_STATUS"):
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    assert command(vehicle, mavlink.MAV_CMD_REQUEST_MESSAGE, number, instance) == ACCEPTED
    while True:
        message = receive(vehicle, [name])
        if message.id == instance:
            return message


def step_at(value):
    """From a half-precision number to the next one: it has a mantissa of 11 bits."""
    return 2.0 ** (math.floor(math.log2(abs(value))) - 10) if value else 2.0**-24


def assert_reports(vehicle, instance, volts_sent, amperes, celsius, percent=None, seconds=5):
    """Waits until what was sent has arrived, to a step of each number on the bus, and one on the wire."""
    expected = [
        (lambda status: volts(status), volts_sent, step_at(volts_sent) + 0.001),
        (lambda status: status.current_battery / 100, amperes, step_at(amperes) + 0.01),
        (lambda status: status.temperature / 100, celsius, step_at(celsius + KELVIN) + 0.01),
    ]
    if percent is not None:
        expected.append((lambda status: status.battery_remaining, percent, 0))
    end = time.monotonic() + seconds
    while True:
        status = reported(vehicle, instance)
        if all(abs(field(status) - value) <= step for field, value, step in expected):
            return
        assert time.monotonic() < end, f"{status} instead of {[value for _, value, _ in expected]}"


def test_a_node_monitor_sees_the_board(peer):
    info = wait_for(lambda: peer.info(BOARD))
    assert info.name.decode() == NAME
    assert info.status.health == info.status.HEALTH_OK
    assert info.status.mode == info.status.MODE_OPERATIONAL
    assert any(info.hardware_version.unique_id)
    assert info.software_version.image_crc
    # Its NodeStatus goes on, once a second.
    uptime = info.status.uptime_sec
    wait_for(lambda: peer.info(BOARD).status.uptime_sec >= uptime + 2, 3)


def test_two_batteries_reach_the_wire_by_their_ids(peer, vehicle):
    for step in range(2):
        first = 12.5 + 0.3 * step, 3.3 + step, 20.2 + step, 80 - step
        second = 11.1 - 0.2 * step, 0.7 * step, -3.3 - step, 33 + step
        peer.report(NODE_A, battery(1, *first))
        peer.report(NODE_B, battery(2, *second))
        assert_reports(vehicle, FIRST, *first)
        assert_reports(vehicle, SECOND, *second)


def test_a_battery_reports_cells_cycles_and_capacity(peer, vehicle):
    cells, cycles, nominal_volts, watt_hours, percent = [4.1, 4.05, 4.02, 4.15], 321, 14.8, 74, 75
    reading = battery(2, sum(cells), 2, percent=percent, watt_hours=watt_hours)
    # Not the first: what is sent here is used for 12 s.
    peer.report(NODE_B, auxiliary(2, cells, cycles, nominal_volts), reading)
    wait_for(lambda: reported(vehicle, SECOND, "SMART_BATTERY_INFO").cycle_count == cycles)
    status, info = reported(vehicle, SECOND), reported(vehicle, SECOND, "SMART_BATTERY_INFO")
    measured = [mv / 1000 for mv in status.voltages if mv != UNKNOWN]
    assert info.cells_in_series == len(measured) == len(cells)
    assert all(abs(volts - sent) <= step_at(sent) + 0.001 for volts, sent in zip(measured, cells)), measured
    full_mah = 1000 * watt_hours / nominal_volts
    # Of two numbers.
    step = 2 * 2**-10
    assert info.capacity_full == pytest.approx(full_mah, rel=step)
    assert status.current_consumed == pytest.approx(full_mah * (100 - percent) / 100, rel=5 * step)
    assert status.battery_remaining == pytest.approx(percent, abs=1)


# Requirement: AP-8
def test_motor_controllers_measure_a_pack_together(peer, vehicle):
    sent = {1: (24.0, 3.5, 40), 2: (24.25, 4.5, 50), 3: (24.5, 6, 60), 4: (30.0, 9, 90)}
    for index, values in sent.items():
        peer.report(CONTROLLERS + index, controller(index, *values))
    # The mean of the first three, and the sum of their currents: the fourth is not in the mask.
    assert_reports(vehicle, DRIVE, 24.25, 14, 50)


# Requirement: AP-8
def test_a_charger_measures_a_pack_and_is_switched(peer, vehicle):
    assert set_to(vehicle, "BATT5_OPTIONS", OFF_AT_BOOT | ON_AT_ARM | OFF_AT_DISARM).param_id == "BATT5_OPTIONS"
    # The node takes over its settings ten times a second.
    time.sleep(0.3)
    source, output = (18.5, 2), (14, 2.5)
    with closing(Charger(peer)) as charger:
        charger.is_stuck = True
        charger.report(source, output, celsius=35)
        # It is asked until it confirms.
        wait_for(lambda: charger.requested[1:] == ["off"])
        charger.is_stuck = False
        assert_reports(vehicle, SOLAR, *output, 35)
        wait_for(lambda: not charger.is_on)
        del charger.requested[:]
        for arm, power in [(1, "on"), (0, "off")]:
            assert command(vehicle, ARM_DISARM, arm, BY_FORCE) == ACCEPTED
            wait_for_text(vehicle, f"Battery 5 charger switched {power}")
            wait_for(lambda: charger.requested[-1:] == [power])
        charger.report(source, output, celsius=60, faults=8)
        wait_for_text(vehicle, "Battery 5 reports: over temperature")
        assert set_to(vehicle, "BATT5_OPTIONS", CHARGER_INPUT).param_value == CHARGER_INPUT
        assert_reports(vehicle, SOLAR, *source, 60)
        assert charger.requested == ["on", "off"]


def test_readings_come_through_noise(board, peer, vehicle):
    assert wait_for(lambda: peer.info(BOARD))
    peer.report(NODE_A, battery(1, 12.5, 1))
    assert_reports(vehicle, FIRST, 12.5, 1, 25, 50)
    with trouble(board, "noise 0.1", "noise 0"):
        for step in range(1, 6):
            peer.report(NODE_A, battery(1, 12.5 + 0.1 * step, step))
            assert_reports(vehicle, FIRST, 12.5 + 0.1 * step, step, 25, 50, seconds=1)
            time.sleep(0.5)
        # The monitor forgets a node that is silent for three seconds.
        assert peer.info(BOARD)


def test_a_node_without_an_id_gets_one_from_the_board(peer, vehicle):
    ids = []
    for unique_id in (b"battery of A rov", b"battery of B rov", b"battery of A rov"):
        newcomer = peer.call(lambda: Newcomer(peer, unique_id))
        ids.append(wait_for(lambda: newcomer.node_id))
    assert ids[0] == ids[2], "the same battery has the same id again"
    assert len({*ids, BOARD, PEER}) == 4
    # It takes the place of the battery before, which is lost.
    assert set_to(vehicle, "BATT2_OPTIONS", DYNAMIC_NODE).param_value == DYNAMIC_NODE
    peer.report(ids[0], battery(1, 12.75, 1))
    assert_reports(vehicle, FIRST, 12.75, 1, 25, 50, seconds=LOST_AFTER_S + 2)


def test_the_board_gets_its_id_from_an_allocator(board, peer, vehicle):
    """The last one: the board keeps its setting."""
    assert set_to(vehicle, "CAN_D1_UC_NODE", 0).param_value == 0
    with closing(restarted(vehicle, board.usb_url)) as vehicle:
        # Without an id it is not a node, and the monitor forgets the one before.
        wait_for(lambda: not peer.call(lambda: peer.monitor.exists(BOARD)))
        server = peer.call(lambda: CentralizedServer(peer.node, peer.monitor))
        wait_for_text(vehicle, f"CAN node id {HIGHEST_ID} assigned to this board")
        assert wait_for(lambda: peer.info(HIGHEST_ID)).name.decode() == NAME
        peer.report(NODE_A, battery(1, 12.5, 1))
        assert_reports(vehicle, FIRST, 12.5, 1, 25, 50)
    peer.call(server.close)
