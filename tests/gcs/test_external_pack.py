"""A pack that a companion computer feeds: examples/external_pack.py, as its user starts it."""

import contextlib
import hashlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import tty

import pytest
from pymavlink import mavutil

from conftest import REPOSITORY, Simulator, free_port
from station import Background, connect, fresh, knows_its_voltage, messages_of, restarted, set_to, unread_messages_of, volts
from test_board_check import carry
from test_signing import Vehicle, ticks_now, wait_for_text

mavlink = mavutil.mavlink

SCRIPT = REPOSITORY / "examples" / "external_pack.py"

EXTERNAL = 29

OK = mavlink.MAV_BATTERY_CHARGE_STATE_OK
UNHEALTHY = mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY


class Script:
    """The script, with all that it has printed so far."""

    def __init__(self, *command, **streams):
        streams = {"stdin": subprocess.DEVNULL} | streams
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, **streams)
        self.said, self.complaints = [], []
        for stream, lines in ((self.process.stdout, self.said), (self.process.stderr, self.complaints)):
            threading.Thread(target=lines.extend, args=(iter(stream),), daemon=True).start()

    def wait_for(self, text, seconds=10):
        """Waits until a line begins with this."""
        end = time.monotonic() + seconds
        while not any(line.startswith(text) for line in self.said):
            assert time.monotonic() < end and self.process.poll() is None, (text, self.said, self.complaints)
            time.sleep(0.02)

    def interrupt(self):
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout=10)

    def kill(self):
        self.process.kill()
        self.process.wait()


@contextlib.contextmanager
def running(*arguments, minutes_ahead=0, **streams):
    """The script, by a clock that is ahead."""
    moved = f"import runpy, sys, time; now = time.time; time.time = lambda: now() + {60 * minutes_ahead}; del sys.argv[0]; "
    command = [sys.executable, "-c", moved + "runpy.run_path(sys.argv[0], run_name='__main__')"]
    started = Script(*command, SCRIPT, *arguments, **streams)
    try:
        yield started
    finally:
        started.kill()


class Companion(Script):
    """The script, to which a sensor writes a line ten times a second."""

    def __init__(self, url, line, *arguments):
        self.line = line
        command = [sys.executable, SCRIPT, url, "--readings", "-", *arguments]
        super().__init__(*command, stdin=subprocess.PIPE, errors="surrogateescape")
        self.sensor = Background(self.measure)
        self.sensor.__enter__()
        self.wait_for("Feeding pack 1 of system 1.")

    def measure(self):
        self.process.stdin.write(f"{self.line}\n")
        self.process.stdin.flush()
        time.sleep(0.1)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.sensor.__exit__(*error)
        self.process.stdin.close()
        assert self.process.wait(timeout=5) == 0


def texts_within(connection, seconds):
    return [m.text for m in messages_of(connection, seconds) if m.get_type() == "STATUSTEXT"]


def set_up(connection, url):
    parameters = {"BATT_MONITOR": EXTERNAL, "BATT_CELLS": 3}
    for name, value in parameters.items():
        assert set_to(connection, name, value).param_value == value, name
    return restarted(connection, url)


# Requirement: AP-11
def test_readings_and_silence_of_a_pack_that_the_script_feeds(start_simulator):
    simulator = start_simulator()
    station = set_up(connect(simulator.url), simulator.url)
    with Companion(simulator.url, "12.0,2.5,70") as companion:
        time.sleep(1)
        status = fresh(station, "BATTERY_STATUS")
        assert (volts(status), status.current_battery, status.battery_remaining) == (12.0, 250, 70)
        assert status.charge_state == OK and status.current_consumed >= 0
        companion.line = "11.9,1.0,68"
        time.sleep(0.5)
        assert volts(fresh(station, "BATTERY_STATUS")) == 11.9
        # The sensor is lost, the script goes on.
        companion.line = ",,"
        texts = texts_within(station, 3.5)
        assert "Battery 1 unhealthy: no reading in time" in texts
        status = fresh(station, "BATTERY_STATUS")
        assert (volts(status), status.charge_state) == (11.9, UNHEALTHY)


def test_with_a_key_only_the_script_that_has_it_feeds_the_pack(start_simulator):
    vehicle = Vehicle(start_simulator)
    vehicle.radio.close()
    vehicle.cable = set_up(vehicle.cable, vehicle.simulator.url)
    vehicle.set_up(hashlib.sha256(b"a good passphrase").digest())
    radio = f"udpin:127.0.0.1:{vehicle.udp_port}"
    with running(radio, "--voltage", "12") as script:
        script.wait_for("The rover does not say its BATT_MONITOR: has it a signing key (--passphrase)?")
        texts = [m.text for m in unread_messages_of(vehicle.cable, 1) if m.get_type() == "STATUSTEXT"]
        assert any("not signed with the key, ignored" in text for text in texts), texts
        assert fresh(vehicle.cable, "BATTERY_STATUS").voltages[0] == 65535
    with Companion(radio, "12.0", "--passphrase", "a good passphrase"):
        time.sleep(1.5)
        assert volts(fresh(vehicle.cable, "BATTERY_STATUS")) == 12.0


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["--voltage", "12", "--pack", "10"], "--pack"),
        (["--voltage", "12", "--rate", "0.5"], "at least 1 Hz"),
        (["--voltage", "12", "--rate", "inf"], "at most 100"),
        (["--voltage", "nan"], "--voltage"),
        (["--voltage", "12", "--current", "328"], "--current"),
        (["--voltage", "12", "--remaining", "200"], "--remaining"),
        (["--voltage", "12", "--system", "256"], "--system"),
        (["--voltage", "12", "--component", "1"], "--component"),
        (["--readings", "-", "--current", "1"], "--current"),
        (["--readings", "no-such-file"], "no-such-file: No such file or directory"),
        ([], "--voltage"),
    ],
)
def test_wrong_arguments_are_refused(arguments, error):
    ended = subprocess.run(
        [sys.executable, SCRIPT, "tcp:127.0.0.1:1", *arguments], capture_output=True, text=True, timeout=20
    )
    assert ended.returncode == 2 and error in ended.stderr


def test_voltage_above_one_field_goes_on_in_the_next():
    fields = "import external_pack; print(external_pack.voltage_fields(74.0), external_pack.voltage_fields(0.0))"
    ended = subprocess.run(
        [sys.executable, "-B", "-c", fields], cwd=SCRIPT.parent, capture_output=True, text=True, timeout=20
    )
    unknown = ", 65535"
    assert ended.stdout == f"[65534, 8466{unknown * 8}] [0{unknown * 9}]\n", ended


@pytest.mark.parametrize("connection", ["tcp:127.0.0.1:1", "tcp:127.0.0.1", "udpin:127.0.0.1:port", "no-such-port", str(SCRIPT)])
def test_a_connection_that_does_not_open_is_named(connection):
    ended = subprocess.run(
        [sys.executable, SCRIPT, connection, "--voltage", "12"], capture_output=True, text=True, timeout=20
    )
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(f"Can't open {connection}: ") and ended.stderr.count("\n") == 1, ended.stderr


@pytest.fixture
def external_rover(tmp_path):
    """Ports of a rover whose pack is an external one, and how it is switched on and off."""
    rover = Rover(tmp_path / "flash")
    yield rover
    rover.switch_off()


class Rover:
    def __init__(self, flash):
        self.flash = flash
        self.tcp_port, self.udp_port = free_port(), free_port()
        self.simulator = None
        self.switch_on()
        station = set_up(connect(self.tcp), self.tcp)
        # A moment to save them.
        time.sleep(0.5)
        station.close()

    @property
    def tcp(self):
        return f"tcp:127.0.0.1:{self.tcp_port}"

    @property
    def udpin(self):
        return f"udpin:127.0.0.1:{self.udp_port}"

    def switch_on(self):
        udp = ("--udp", f"127.0.0.1:{self.udp_port}", "--flash", str(self.flash))
        self.simulator = Simulator(*udp, port=self.tcp_port)

    def switch_off(self):
        self.simulator.kill()

    def set_up_key(self, passphrase):
        with contextlib.closing(connect(self.tcp)) as cable:
            cable.mav.setup_signing_send(1, 1, list(hashlib.sha256(passphrase).digest()), ticks_now())
            wait_for_text(cable, "Signing key set")
            # A moment to save it.
            time.sleep(0.5)

    def voltage(self):
        """The voltage that is fed, once there is one."""
        with contextlib.closing(connect(self.tcp)) as station:
            while not knows_its_voltage(status := fresh(station, "BATTERY_STATUS")):
                time.sleep(0.1)
            return volts(status)


def plug_in(port, rover):
    """A serial port that is the rover's, and vanishes when that is switched off."""
    board = socket.create_connection(("127.0.0.1", rover.tcp_port))
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    port.symlink_to(os.ttyname(theirs))

    def serve():
        # The connection may be reset.
        with board, contextlib.suppress(ConnectionError):
            carry(board, ours)
        port.unlink()
        os.close(theirs)
        os.close(ours)

    threading.Thread(target=serve, daemon=True).start()


@pytest.mark.parametrize("link", ["tcp", "udpin", "serial"])
def test_the_script_feeds_on_after_a_restart_of_the_rover(external_rover, tmp_path, link):
    port = tmp_path / "ttyACM0"
    if link == "serial":
        plug_in(port, external_rover)
    connection = getattr(external_rover, link, str(port))
    with running(connection, "--voltage", "11.5") as script:
        script.wait_for("Feeding pack 1 of system 1. ")
        assert external_rover.voltage() == 11.5
        external_rover.switch_off()
        script.wait_for(f"Lost {connection} ")
        time.sleep(1.5)
        external_rover.switch_on()
        if link == "serial":
            plug_in(port, external_rover)
        script.wait_for("Feeding pack 1 of system 1 again. ")
        assert external_rover.voltage() == 11.5
        assert (len(script.said), script.complaints) == (3, []), "a line on loss, and one on return"
        assert script.interrupt() == 0
    assert script.complaints == []


def test_a_rover_that_was_off_for_minutes_is_found_by_its_key(external_rover):
    """Its time is behind, so that pymavlink drops what it sends until it has heard of the later one."""
    external_rover.set_up_key(b"a good passphrase")
    external_rover.switch_off()
    options = ["--voltage", "11.5", "--passphrase", "a good passphrase"]
    with running(external_rover.udpin, *options, minutes_ahead=10) as script:
        script.wait_for("No rover with system id 1 at udpin:")
        external_rover.switch_on()
        script.wait_for("Feeding pack 1 of system 1. ")
        assert external_rover.voltage() == 11.5
        assert len(script.said) == 2


def test_the_guides_script_finds_a_rover_that_was_off_for_minutes(external_rover):
    external_rover.set_up_key(b"PASSPHRASE")
    page = (REPOSITORY / "docs/wifi.md").read_text(encoding="utf-8")
    (script,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    script = script.replace("udpin:127.0.0.1:14550", external_rover.udpin)
    later = "import time; now = time.time; time.time = lambda: now() + 600\n"
    found = "assert rover.target_system == 1\n"
    subprocess.run([sys.executable, "-c", later + script + found], timeout=20, check=True)


@pytest.mark.parametrize("options", [["--voltage", "12"], ["--readings", "-"]])
def test_heartbeats_come_first_and_readings_only_after_an_answer(options):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as rover:
        rover.bind(("127.0.0.1", 0))
        rover.settimeout(5)
        with running(f"udpout:127.0.0.1:{rover.getsockname()[1]}", *options, stdin=subprocess.PIPE) as script:
            script.process.stdin.write("12\n" * 10)
            script.process.stdin.flush()
            parser = mavlink.MAVLink(None)
            names = [parser.parse_char(rover.recv(300)).get_type() for _ in range(6)]
    assert names == ["HEARTBEAT", "PARAM_REQUEST_READ"] * 3


def test_a_rover_is_asked_whether_it_takes_readings(start_simulator):
    url = start_simulator().url
    with running(url, "--voltage", "11.5", "--system", "2") as other, running(url, "--voltage", "11.5", "--pack", "2") as script:
        script.wait_for("BATT2_MONITOR is 0, and has to be 29.")
        other.wait_for("No rover with system id 2 at tcp:")
        station = connect(url)
        assert set_to(station, "BATT2_MONITOR", EXTERNAL).param_value == EXTERNAL
        script.wait_for("Feeding pack 2 of system 1. ")
        assert other.interrupt() == 1, "nothing was sent"
        assert script.interrupt() == 0


def test_the_readings_of_a_pipe_are_not_sent_late(external_rover):
    external_rover.switch_off()
    with running(external_rover.udpin, "--readings", "-", stdin=subprocess.PIPE) as script:
        for _ in range(20):
            script.process.stdin.write("11.1\n" * 1000)
            script.process.stdin.flush()
        time.sleep(2)
        external_rover.switch_on()
        script.wait_for("Feeding pack 1 of system 1. ")
        script.process.stdin.write("11.5\n")
        script.process.stdin.close()
        assert external_rover.voltage() == 11.5
        assert script.process.wait(timeout=5) == 0


def test_what_cannot_be_sent_of_a_reading_is_unknown(external_rover):
    lines = [
        ("12.0,400,70", (12.0, -1, 70)),
        ("12.1,nan,200", (12.1, -1, -1)),
        ("12.3,327,100", (12.3, 32700, 100)),
        ("-0.01,-0.01,", (0.0, -1, -1)),
        ("12.2,-0.01,", (12.2, 0, -1)),
        ("x,1,2", (12.2, 0, -1)),
        ("\udcff", (12.2, 0, -1)),
        ("1,2,3,4", (12.2, 0, -1)),
        ("12.3,-327", (12.3, -32700, -1)),
    ]
    with Companion(external_rover.tcp, "12.0,-400,70") as companion:
        station = connect(external_rover.tcp)
        for companion.line, expected in lines:
            time.sleep(0.4)
            status = fresh(station, "BATTERY_STATUS")
            assert (volts(status), status.current_battery) == expected[:2], companion.line
            if expected[2] >= 0:
                assert status.battery_remaining == expected[2], companion.line
        station.close()
    assert [line.split(" can't")[0] for line in companion.complaints] == [
        "The current in '12.0,-400,70'",
        "The remaining in '12.1,nan,200'",
        "No reading: 'x,1,2'. It is unknown to the rover.\n",
    ]


def test_a_pipe_that_ends_ends_it_and_ctrl_c_while_it_waits(external_rover):
    with running(external_rover.tcp, "--readings", "-", stdin=subprocess.PIPE) as script:
        script.wait_for("Feeding ")
        # The thread that reads the pipe waits in it.
        assert script.interrupt() == 1
    assert script.complaints == []
