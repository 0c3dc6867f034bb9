"""Logs and parameters as files: what the flash holds is what real ground stations download, over every link."""

import concurrent.futures
import contextlib
import datetime
import queue
import struct
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.ftp import Ftp, FtpResult
from mavsdk.plugins.log_files import LogFiles, LogFilesResult
from pymavlink import DFReader, mavftp

import log_ring
from conftest import EmulatedBoard, Simulator, failed_start
from station import (
    connect,
    fresh,
    mavlink,
    messages_of,
    read,
    read_list,
    receive,
    set_to,
    say_time,
    unread_messages_of,
    volts,
)
from test_mavproxy import MavProxy, values_in

# One board at a time.
pytestmark = pytest.mark.xdist_group("emulated_board")

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
LINKS = ["uart", "usb"]
# Each link has its own rates. The pack is low at the second step of its voltage.
SERIAL_NUMBER = 4711
SETTINGS = {"SR0_EXTRA1": 20, "SR1_EXTRA1": 20, "BATT_CELLS": 3, "BATT_LOW_VOLT": 12.46, "BATT_LOW_TIMER": 1}
# Its pack has three cells.
SETTINGS |= {"BATT_SERIAL_NUM": SERIAL_NUMBER, "MOT_DRV_VOLT": 0}
BLOCK_BYTES = 90
TO_THE_END = 0xFFFF_FFFF
RECORDED = 520
NOTHING_RECORDED = 0
A_DATE = r"\w{3} \w{3} +\d+ \d\d:\d\d:\d\d 20\d\d$"
# A telemetry port has 115200 Bd; it takes five seconds there.
LONG_LOG = bytes(i * i >> 8 & 0xFF for i in range(50_000))
OLD_LOG = bytes(i % 256 for i in range(5000))


class Vehicle:
    """The simulator or the emulated board, on one flash chip as long as the tests of it last."""

    def __init__(self, kind, folder, ring):
        self.kind, self.folder, self.flash = kind, folder, folder / "flash"
        chip = log_ring.chip_with(ring)
        # The simulator has no program in its chip.
        self.flash.write_bytes(chip if kind == "board" else chip[log_ring.IMAGE_START :])
        self.switch_on()

    def switch_on(self):
        if self.kind == "board":
            self.process = EmulatedBoard(self.flash)
            self.urls = {"uart": self.process.uart_url, "usb": self.process.usb_url}
        else:
            self.process = Simulator("--flash", str(self.flash))
            self.urls = {"tcp": self.process.url}

    def switch_off(self):
        """Ends it; its flash file is complete then."""
        if self.kind == "board":
            self.process.switch_off()
        else:
            assert self.process.interrupt()[0] == 0

    def ring(self):
        """The bytes of the ring in the flash file."""
        return log_ring.ring_of(self.flash.read_bytes())


class Drive:
    """A drive that was recorded, and what was on the wire meanwhile."""

    def __init__(self, vehicle):
        self.vehicle = vehicle
        link = connect(vehicle.urls.get("usb") or vehicle.urls["tcp"])
        for name, value in SETTINGS.items():
            set_to(link, name, value)
        messages_of(link, 1)
        self.offset_s = wall_minus_boot_s(link)
        self.armed_at = time.time()
        messages = armed(link)
        # In the middle of the file.
        messages += unread_messages_of(link, 0.5)
        say_time(link)
        messages += messages_of_drive(link)
        link.mav.command_long_send(1, 1, ARM, 0, 0, 0, 0, 0, 0, 0, 0)
        messages += ended(link)
        self.values = read_list(link)
        self.board_id = f"{fresh(link, 'AUTOPILOT_VERSION').uid:016X}"
        self.readings = [(m._timestamp - self.offset_s, volts(m)) for m in messages if m.get_type() == "BATTERY_STATUS"]
        self.texts = [m.text for m in messages if m.get_type() == "STATUSTEXT"]
        # A second file, of next to nothing.
        self.second_at = time.time()
        set_to(link, "LOG_DISARMED", 1)
        set_to(link, "LOG_BITMASK", RECORDED)
        messages_of(link, 1)
        ended(link)
        set_to(link, "LOG_DISARMED", 0)
        link.close()
        vehicle.switch_off()
        self.files = log_ring.read_files(vehicle.ring())
        vehicle.switch_on()

    @property
    def log(self):
        """The bytes of the drive's file, as the ring has them."""
        return self.files[7]

    @property
    def dates(self):
        """When each file began, in seconds since 1970; 0 is unknown."""
        return [0, self.armed_at, self.second_at]


def wall_minus_boot_s(link):
    """What the wall clock is ahead of the vehicle's."""
    sent = time.time()
    link.mav.timesync_send(0, int(sent * 1e9))
    answer = receive(link, ["TIMESYNC"])
    return (sent + time.time()) / 2 - answer.tc1 / 1e9


def armed(link):
    """Arms; what came with it."""
    link.mav.command_long_send(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    messages = []
    while not messages or messages[-1].get_type() != "COMMAND_ACK":
        messages.append(link.recv_match(blocking=True, timeout=3))
    assert messages[-1].result == ACCEPTED
    return messages


def messages_of_drive(link):
    """Steps of the voltage, by parameter: the log and the wire have both."""
    messages = []
    for multiplier in (3.95, 3.9, 3.85):
        link.param_set_send("BATT_VOLT_MULT", multiplier)
        messages += unread_messages_of(link, 1.2)
    return messages


def ended(link):
    """Ends the log at once; what came until it was written."""
    link.param_set_send("LOG_BITMASK", NOTHING_RECORDED)
    return unread_messages_of(link, 1.5)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    # Behind an older log, and over the end of the ring.
    ring = log_ring.ring_with({6: OLD_LOG}, 2 * log_ring.SECTORS - 4, erased=100)
    drive = Drive(Vehicle("board", tmp_path_factory.mktemp("board"), ring))
    yield drive
    drive.vehicle.process.kill()


@pytest.fixture(params=LINKS)
def reached(request, drive):
    """The drive and the link by which it is downloaded."""
    return drive, drive.vehicle.urls[request.param]


# What is in the log


# Requirement: AP-21
def test_it_is_read_without_a_warning(drive, tmp_path, capfd):
    path = tmp_path / "drive.BIN"
    path.write_bytes(drive.log)
    records = records_of(path)
    assert capfd.readouterr() == ("", "")
    types = {record.get_type() for record in records}
    assert {"FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG", "ARM", "EV", "BAT", "BATX", "BRD", "PACK", "FSTM"} <= types
    dump = subprocess.run(
        [Path(sys.executable).parent / "mavlogdump.py", path], check=True, capture_output=True, text=True
    )
    assert dump.stderr == "" and len(dump.stdout.splitlines()) == len(records)


def records_of(path):
    reader = DFReader.DFReader_binary(str(path))
    records = []
    while record := reader.recv_msg():
        records.append(record)
    reader.close()
    return records


@pytest.fixture
def records(drive, tmp_path):
    path = tmp_path / "drive.BIN"
    path.write_bytes(drive.log)
    return records_of(path)


def test_all_of_it_is_dated(drive, records):
    (arming,) = [record for record in records if record.get_type() == "ARM" and record.ArmState == 1]
    assert arming._timestamp == pytest.approx(drive.armed_at, abs=1)
    # All but the formats, which have no time, are as far from it as the board says.
    for record in records:
        if "TimeUS" in record.get_fieldnames():
            apart_s = (record.TimeUS - arming.TimeUS) / 1e6
            assert record._timestamp - arming._timestamp == pytest.approx(apart_s, abs=0.001)


def test_no_viewer_draws_a_position(records):
    """read: mavflightview.py, message_to_latlon; LogBrowse.cs of Mission Planner, getPointLatLng;
    dataflashDataExtractor.js of UAV Log Viewer, extractTrajectory."""
    (gps,) = [record for record in records if record.get_type() == "GPS"]
    assert gps.Status < 2 and gps.NSats < 5
    assert (gps.Lat, gps.Lng) == (0, 0)


def test_mission_planner_finds_its_date(records):
    """read: DFLog.cs, GetTimeGPS: it compares texts, and takes no time from a fix that is not of three dimensions."""
    (gps,) = [record for record in records if record.get_type() == "GPS"]
    assert str(gps.Status) not in ("0", "1", "2")
    assert 0 <= gps.GWk <= 5000 and 0 <= gps.GMS / 1000 <= 7 * 24 * 3600


# Downloads


def test_mavproxy_downloads(reached, tmp_path):
    drive, url = reached
    mavproxy = MavProxy(url, tmp_path, "--streamrate=-1")
    try:
        mavproxy.ask("log list", rf"Log 3  numLogs 3 lastLog 3 size {len(drive.files[8])} {A_DATE}")
        for log, number in [("1", 6), ("2", 7), ("latest", 8)]:
            mavproxy.ask(f"log download {log} {number}.BIN", rf"Finished downloading {number}.BIN", timeout=15)
            assert (tmp_path / f"{number}.BIN").read_bytes() == drive.files[number], log
        mavproxy.ask("ftp list /LOGS", rf"00000007.BIN\s+{len(drive.log)}$")
        mavproxy.ask("ftp get /LOGS/00000007.BIN ftp.BIN", rf"Wrote {len(drive.log)} bytes to ftp.BIN", timeout=15)
        mavproxy.ask("ftp status", "No transfer in progress")
        assert (tmp_path / "ftp.BIN").read_bytes() == drive.log
    finally:
        mavproxy.kill()


@contextlib.contextmanager
def mavsdk_system(url):
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    mavsdk.add_any_connection(url.replace("tcp:", "tcpout://").replace("udpin:", "udpin://"))
    system = mavsdk.first_autopilot(timeout_s=10)
    try:
        assert system is not None
        yield system
    finally:
        mavsdk.destroy()


def finished(download, *arguments, running):
    """The result of a download that reports its progress."""
    results = queue.Queue()
    download(*arguments, lambda result, *_: results.put(result))
    while (result := results.get(timeout=15)) == running:
        pass
    return result


# Requirement: AP-27
def test_mavsdk_downloads(reached, tmp_path):
    drive, url = reached
    with mavsdk_system(url) as system:
        logs = LogFiles(system)
        entries = logs.get_entries()
        assert [entry.size_bytes for entry in entries] == [len(content) for content in drive.files.values()]
        dates = [datetime.datetime.fromisoformat(entry.date).timestamp() for entry in entries]
        assert dates == pytest.approx(drive.dates, abs=2)
        path = tmp_path / "drive.BIN"
        downloaded = finished(logs.download_log_file_async, entries[1], str(path), running=LogFilesResult.NEXT)
        assert downloaded == LogFilesResult.SUCCESS
        assert path.read_bytes() == drive.log

        ftp = Ftp(system)
        listed = {file.name: file.size_bytes for file in ftp.list_directory("/LOGS").entries}
        assert listed == {f"{number:08}.BIN": len(content) for number, content in drive.files.items()}
        for use_burst in (False, True):
            arguments = "/LOGS/00000007.BIN", str(tmp_path), use_burst
            assert finished(ftp.download_async, *arguments, running=FtpResult.NEXT) == FtpResult.SUCCESS
            (tmp_path / "00000007.BIN").rename(path)
            assert path.read_bytes() == drive.log


def log_list(link):
    entries = [first_entry(link)]
    while entries[-1].id < entries[-1].last_log_num:
        entries.append(receive(link, ["LOG_ENTRY"]))
    return entries


def first_entry(link):
    """Asked for until it comes: a station that has just ended without saying so holds the line for five seconds."""
    for _ in range(8):
        link.mav.log_request_list_send(1, 1, 0, 0xFFFF)
        if entry := link.recv_match(type="LOG_ENTRY", blocking=True, timeout=1):
            return entry
    raise AssertionError("no list came")


def download(link, log):
    """By LOG_REQUEST_DATA."""
    link.mav.log_request_data_send(1, 1, log, 0, TO_THE_END)
    content = b""
    while True:
        part = receive(link, ["LOG_DATA"])
        assert (part.id, part.ofs) == (log, len(content))
        content += bytes(part.data[: part.count])
        if part.count < BLOCK_BYTES:
            return content


def ftp_get(link, remote, local):
    ftp = mavftp.MAVFTP(link, 1, 1)
    ftp.cmd_get([remote, str(local)])
    assert ftp.process_ftp_reply("OpenFileRO", timeout=40).return_code == 0
    return local.read_bytes()


def test_pymavlink_downloads(reached, tmp_path):
    drive, url = reached
    with closing(connect(url)) as link:
        entries = log_list(link)
        assert [entry.size for entry in entries] == [len(content) for content in drive.files.values()]
        assert [entry.time_utc for entry in entries] == pytest.approx(drive.dates, abs=2)
        for log, content in enumerate(drive.files.values(), start=1):
            assert download(link, log) == content
        assert ftp_get(link, "/LOGS/00000007.BIN", tmp_path / "ftp.BIN") == drive.log


# Parameters as a file


@pytest.mark.parametrize("defaults", [False, True])
def test_parameters_are_downloaded_as_a_file(drive, tmp_path, defaults):
    path = "@PARAM/param.pck" + "?withdefaults=1" * defaults
    with closing(connect(drive.vehicle.urls["uart"])) as link:
        packed = mavftp.MAVFTP.ftp_param_decode(ftp_get(link, path, tmp_path / "param.pck"))
        values = read_list(link)
    assert {name.decode(): value for name, value, _ in packed.params} == pytest.approx(values)
    if defaults:
        by_default = {name.decode(): value for name, value, _ in packed.defaults}
        assert by_default.keys() == values.keys()
        assert by_default["BATT_VOLT_MULT"] == pytest.approx(3.95) and by_default["LOG_BITMASK"] == RECORDED
        assert values["BATT_VOLT_MULT"] == pytest.approx(3.85) and values["LOG_BITMASK"] == NOTHING_RECORDED


# Requirement: AP-27
def test_mavproxy_downloads_and_uploads_parameters_by_ftp(drive, tmp_path):
    mavproxy = MavProxy(drive.vehicle.urls["uart"], tmp_path, "--streamrate=-1")
    try:
        assert mavproxy.start_up.string.endswith("(ftp)")
        count = mavproxy.start_up[1]
        mavproxy.ask("param ftp", rf"Received {count} parameters \(ftp\)")
        mavproxy.wait_for(rf"Saved {count} defaults to ")
        assert len(values_in(tmp_path / "mav.parm")) == len(values_in(tmp_path / "defaults.parm")) == int(count)
        (tmp_path / "some.param").write_text("BATT_LOW_VOLT 10.5\nBATT_LOW_TIMER 3\n")
        mavproxy.ask("param ftpload some.param", "Parameter upload done")
        assert mavproxy.show("BATT_LOW_VOLT") == 10.5 and mavproxy.show("BATT_LOW_TIMER") == 3
    finally:
        mavproxy.kill()


def test_an_uploaded_file_sets_parameters(drive, tmp_path):
    file = tmp_path / "param.pck"
    records = [record("BATT_CRT_VOLT", 9.75), record("BATT_LOW_VOLT", 10.25)]
    content = b"".join(records)
    file.write_bytes(struct.pack("<HHH", 0x671B, len(records), 6 + len(content)) + content)
    with closing(connect(drive.vehicle.urls["uart"])) as link:
        ftp = mavftp.MAVFTP(link, 1, 1)
        ftp.cmd_put([str(file), "@PARAM/param.pck"])
        assert ftp.process_ftp_reply("put", timeout=20).return_code == 0
        assert read(link, "BATT_CRT_VOLT").param_value == 9.75
        assert read(link, "BATT_LOW_VOLT").param_value == 10.25


def record(name, value):
    """A parameter in a packed file, its name in full."""
    return struct.pack("<BB", 4, len(name) - 1 << 4) + name.encode() + struct.pack("<f", value)


# While a download runs


@pytest.fixture
def vehicle_with_long_log(tmp_path):
    """Starts a vehicle with a log that takes a while, and ends it after the test."""
    started = []

    def start(kind):
        ring = log_ring.ring_with({6: LONG_LOG}, 2 * log_ring.SECTORS - 4, erased=100)
        started.append(Vehicle(kind, tmp_path, ring))
        return started[-1]

    yield start
    for vehicle in started:
        vehicle.process.kill()


def test_two_stations_on_two_links_download_at_once(vehicle_with_long_log):
    urls = vehicle_with_long_log("board").urls
    with (
        closing(connect(urls["uart"])) as uart,
        closing(connect(urls["usb"])) as usb,
        concurrent.futures.ThreadPoolExecutor() as executor,
    ):
        over_uart = executor.submit(watched_download, uart)
        log_list(usb)
        for _ in range(2):
            assert download(usb, 1) == LONG_LOG
        content, heartbeats, answers = over_uart.result(timeout=60)
    assert content == LONG_LOG
    # What else is on the link keeps its times.
    gaps = [after - before for before, after in zip(heartbeats, heartbeats[1:])]
    assert len(gaps) >= 3 and all(0.7 < gap < 1.3 for gap in gaps), gaps
    assert len(answers) >= 3 and max(answers) < 0.5, answers


def watched_download(link):
    """The content; when heartbeats came; how long a parameter took that was requested each second."""
    log_list(link)
    link.mav.log_request_data_send(1, 1, 1, 0, TO_THE_END)
    content, heartbeats, answers, asked = b"", [], [], None
    next_question = time.monotonic() + 0.5
    while True:
        message = receive(link, ["LOG_DATA", "HEARTBEAT", "PARAM_VALUE"])
        now = time.monotonic()
        if message.get_type() == "HEARTBEAT":
            heartbeats.append(now)
        elif message.get_type() == "PARAM_VALUE":
            answers.append(now - asked)
            asked = None
        else:
            assert message.ofs == len(content)
            content += bytes(message.data[: message.count])
            if message.count < BLOCK_BYTES:
                return content, heartbeats, answers
        if asked is None and now >= next_question:
            link.mav.param_request_read_send(1, 1, b"BATT_MONITOR", -1)
            asked, next_question = now, now + 1
        assert asked is None or now - asked < 2, "no answer"


# Logs of the simulator as files


def test_the_simulator_copies_its_logs_into_a_folder(start_simulator, tmp_path):
    folder, flash = tmp_path / "logs", tmp_path / "flash"
    for run in (1, 2):
        simulator = start_simulator("--flash", str(flash), "--log", str(folder))
        with closing(connect(simulator.url)) as link:
            messages_of(link, 1)
            say_time(link)
            began_at = time.time()
            armed(link)
            messages_of(link, 2.5)
            (*_, newest) = sorted(folder.iterdir())
            assert newest.stat().st_size > 1000, "while it runs"
            assert records_of(newest)[0]._timestamp == pytest.approx(began_at, abs=1)
        assert simulator.interrupt()[0] == 0
        files = [path.read_bytes() for path in sorted(folder.iterdir())]
        assert [path.name for path in sorted(folder.iterdir())] == ["00000001.BIN", "00000002.BIN"][:run]
        assert files == list(log_ring.read_files(log_ring.ring_of(flash.read_bytes())).values())


def test_a_log_folder_that_can_not_be_one_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    assert "Can't use the log folder" in failed_start("--log", str(tmp_path / "file"))
