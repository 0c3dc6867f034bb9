"""The release firmware on an emulated Pico W: what ground stations on its Wi-Fi see of it, by UDP and by TCP."""

import os
import re
import signal
import socket
import time
from contextlib import closing

import pytest
from mavsdk.plugins.action import Action
from mavsdk.plugins.ftp import Ftp, FtpResult
from mavsdk.plugins.log_files import LogFiles, LogFilesResult
from mavsdk.plugins.manual_control import ManualControl
from mavsdk.plugins.param import Param
from mavsdk.plugins.telemetry import Telemetry

import log_ring
from conftest import WifiBoard
from station import (
    Background,
    command,
    connect,
    fresh,
    is_about,
    mavlink,
    messages_of,
    read_list,
    restarted,
    set_to,
)
from test_log_download import download, finished, ftp_get, log_list, mavsdk_system
from test_mavproxy import MavProxy

# A board for each link, one after the other.
pytestmark = pytest.mark.xdist_group("wifi")

LINKS = ["udp", "tcp"]

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
CUSTOM_MODE = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED

# ArduPilot Rover's numbers.
MANUAL = 0
HOLD = 4

PACKS = 4
# Nothing is recorded: the log in the chip stays the only one.
SETTINGS = {"MOT_DRV_VOLT": 0, **{f"BATT{number}_MONITOR": 3 for number in range(2, PACKS + 1)}, "LOG_BITMASK": 0}
FS_TIMEOUT_S = 1.5
LOG = bytes(i * i >> 8 & 0xFF for i in range(20_000))
FILE = "/LOGS/00000006.BIN"

FASTEST_HZ = 50
FASTEST_US = 1_000_000 // FASTEST_HZ
BY_DEFAULT = 0
DEFAULT_HZ = 2
RATE_SECONDS = 3
FAST_MESSAGES = [mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, mavlink.MAVLINK_MSG_ID_SYS_STATUS]

# From the start of the emulated board; the firmware's promise is 3 s of emulated time, which a slow machine stretches.
FOUND_WITHIN_S = 10


class Wifi:
    """A board with four packs and a log, its link over Wi-Fi, and a second one over USB that watches."""

    def __init__(self, board, link):
        self.board, self.link = board, link
        self.url = {"udp": board.udp_urls[0], "tcp": board.tcp_url}[link]
        self.found = first_datagram(board.udp_ports[0]) if link == "udp" else None
        with closing(connect(board.usb_url)) as usb:
            for name, value in SETTINGS.items():
                assert set_to(usb, name, value).param_value == value
            restarted(usb, board.usb_url).close()
        with closing(connect(self.url)) as wifi:
            self.parameters = read_list(wifi)


def first_datagram(port):
    """What comes to the port first, with the seconds until then; nothing is sent."""
    started = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", port))
        station.settimeout(FOUND_WITHIN_S)
        return station.recv(300), time.monotonic() - started


@pytest.fixture(scope="module", params=LINKS)
def wifi(request, tmp_path_factory):
    flash = tmp_path_factory.mktemp(request.param) / "flash"
    flash.write_bytes(log_ring.chip_with(log_ring.ring_with({6: LOG}, log_ring.SECTORS, erased=100)))
    board = WifiBoard(flash)
    try:
        yield Wifi(board, request.param)
        assert_quiet(board.switch_off())
    finally:
        board.kill()


# As ground stations on Wi-Fi do if nothing else is chosen. That the rover stops when its driver is gone, and the rates of
# four packs, are shown on both kinds of links by `tests/firmware/wifi/`.
by_udp = pytest.mark.parametrize("wifi", ["udp"], indirect=True)


def assert_quiet(log):
    """Ground stations ask for what a rover does not have, and are refused. Of nothing else the board warns."""
    for line in log.splitlines():
        assert " Error " not in line and (" Warn " not in line or "CommandRefused" in line), line


@pytest.fixture
def watcher(wifi):
    """A connection over USB. It leaves the rover disarmed, and in HOLD, as it was."""
    with closing(connect(wifi.board.usb_url)) as watcher:
        yield watcher
        command(watcher, ARM, 0)
        # The last control inputs are not those of the next test.
        messages_of(watcher, FS_TIMEOUT_S)
        command(watcher, SET_MODE, CUSTOM_MODE, HOLD)


def state(watcher):
    """Mode, and whether it is armed."""
    heartbeat = fresh(watcher, "HEARTBEAT")
    return heartbeat.custom_mode, bool(heartbeat.base_mode & ARMED)


def seconds_until(watcher, text):
    """The seconds until the text comes."""
    started = time.monotonic()
    while (waited := time.monotonic() - started) < 3 * FS_TIMEOUT_S:
        message = watcher.recv_match(type="STATUSTEXT", blocking=True, timeout=0.1)
        if message is not None and message.text.startswith(text):
            return waited
    raise AssertionError(f"{text} never came")


def assert_stops_in_time(watcher):
    """What drove it has just fallen silent."""
    assert FS_TIMEOUT_S - 0.3 < seconds_until(watcher, "Radio Failsafe: Hold") < FS_TIMEOUT_S + 0.5
    assert state(watcher) == (HOLD, True)


def drive_again(watcher):
    """Asks until the first control input has ended the failsafe."""
    for _ in range(20):
        if command(watcher, SET_MODE, CUSTOM_MODE, MANUAL) == ACCEPTED:
            break
        time.sleep(0.1)
    assert state(watcher) == (MANUAL, True)
    messages_of(watcher, FS_TIMEOUT_S + 0.5)
    assert state(watcher) == (MANUAL, True)


# pymavlink


def assert_reports(reports):
    """`reports` has the number of the pack for each report."""
    for pack in range(PACKS):
        assert is_about(reports.count(pack) / RATE_SECONDS, FASTEST_HZ), (pack, reports.count(pack))


def test_pymavlink_downloads_the_log(wifi, tmp_path):
    with closing(connect(wifi.url)) as link:
        assert [entry.size for entry in log_list(link)] == [len(LOG)]
        assert download(link, 1) == LOG
        assert ftp_get(link, FILE, tmp_path / "ftp.BIN") == LOG


# MAVProxy. It reads last: by UDP the station before, which does not say that it ends, has the log for some seconds.


@pytest.fixture
def mavproxy(wifi, tmp_path):
    started = MavProxy(wifi.url, tmp_path, "--streamrate=-1")
    yield started
    started.kill()


@by_udp
def test_mavproxy_receives_four_packs_at_the_highest_rate(mavproxy):
    set_intervals(mavproxy, FASTEST_US)
    assert is_about(mavproxy.rate_of("BATTERY_STATUS", RATE_SECONDS), PACKS * FASTEST_HZ)
    assert mavproxy.ask("link", r"link 1 OK \(\d+ packets, .* (\d+) lost")[1] == "0"
    set_intervals(mavproxy, BY_DEFAULT)


def set_intervals(mavproxy, interval_us):
    for message in FAST_MESSAGES:
        mavproxy.ask(
            f"long SET_MESSAGE_INTERVAL {message} {interval_us} 0 0 0 0 0",
            r"Got COMMAND_ACK: SET_MESSAGE_INTERVAL: ACCEPTED",
        )


# MAVProxy ends first: what it repeats does not last into the next test.
@by_udp
def test_mavproxy_drives_is_lost_and_returns(watcher, mavproxy):
    mavproxy.ask("arm throttle", r"^ARMED")
    mavproxy.ask("mode MANUAL", r"Mode MANUAL")
    # It repeats the override.
    for override in ("rc 3 1500", "rc 1 1500", "rc 3 1700"):
        mavproxy.type(override)
    messages_of(watcher, FS_TIMEOUT_S + 0.5)
    assert state(watcher) == (MANUAL, True)
    os.kill(mavproxy.process.pid, signal.SIGSTOP)
    assert_stops_in_time(watcher)
    os.kill(mavproxy.process.pid, signal.SIGCONT)
    drive_again(watcher)


def test_mavproxy_reads_parameters_and_the_log(wifi, mavproxy, tmp_path):
    assert mavproxy.start_up[1] == str(len(wifi.parameters))
    mavproxy.ask("log list", rf"Log 1  numLogs 1 lastLog 1 size {len(LOG)} ")
    mavproxy.ask("log download 1 log.BIN", "Finished downloading log.BIN", timeout=15)
    assert (tmp_path / "log.BIN").read_bytes() == LOG
    mavproxy.ask(f"ftp get {FILE} ftp.BIN", rf"Wrote {len(LOG)} bytes to ftp.BIN", timeout=15)
    # It closes the file after it has said so.
    mavproxy.ask("ftp status", "No transfer in progress")
    assert (tmp_path / "ftp.BIN").read_bytes() == LOG


# MAVSDK. It reads last, too.


@by_udp
def test_mavsdk_receives_four_packs_at_the_highest_rate(wifi):
    with mavsdk_system(wifi.url) as system:
        telemetry = Telemetry(system)
        telemetry.set_rate_battery(float(FASTEST_HZ))
        reports = []
        handle = telemetry.subscribe_battery(lambda battery, _: reports.append(battery.id))
        time.sleep(RATE_SECONDS)
        telemetry.unsubscribe_battery(handle)
        assert_reports(reports)
        telemetry.set_rate_battery(float(DEFAULT_HZ))
        telemetry.destroy()


@by_udp
def test_mavsdk_drives_is_lost_and_returns(wifi, watcher):
    with mavsdk_system(wifi.url) as system:
        Action(system).arm()
        assert command(watcher, SET_MODE, CUSTOM_MODE, MANUAL) == ACCEPTED
        sticks = ManualControl(system)
        sticks.set_manual_control_input(0.0, 0.0, 0.0, 0.0)
        with Background(lambda: push_by(sticks)):
            messages_of(watcher, FS_TIMEOUT_S + 0.5)
            assert state(watcher) == (MANUAL, True)
        assert_stops_in_time(watcher)
        with Background(lambda: push_by(sticks)):
            drive_again(watcher)


def push_by(sticks):
    """Pushes the throttle, 25 times a second."""
    sticks.set_manual_control_input(0.0, 0.0, 0.3, 0.0)
    time.sleep(0.04)


def test_mavsdk_reads_parameters_and_the_log(wifi, tmp_path):
    with mavsdk_system(wifi.url) as system:
        param = Param(system)
        everything = param.get_all_params()
        names = {parameter.name for parameter in [*everything.int_params, *everything.float_params]}
        assert names == set(wifi.parameters)
        param.destroy()

        logs = LogFiles(system)
        (entry,) = logs.get_entries()
        path = tmp_path / "log.BIN"
        result = finished(logs.download_log_file_async, entry, str(path), running=LogFilesResult.NEXT)
        assert result == LogFilesResult.SUCCESS
        assert path.read_bytes() == LOG

        result = finished(Ftp(system).download_async, FILE, str(tmp_path), True, running=FtpResult.NEXT)
        assert result == FtpResult.SUCCESS
        assert (tmp_path / re.sub(".*/", "", FILE)).read_bytes() == LOG


# All of them
