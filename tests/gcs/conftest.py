"""Starts the simulator, or the emulated board, for the tests that talk to it with real ground-station software.

With `--board PORT` they talk to the board, or to a simulator that runs already, at that port instead: those tests that
are marked `board`, each from default parameters. The parameters it had are set again at the end.
"""

import functools
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from xml.etree import ElementTree

import pytest

# pymavlink reads this when it is imported: without it, it would answer in MAVLink 1.
os.environ["MAVLINK20"] = "1"

# After it: pymavlink reads it.
import station  # noqa: E402

# What a shell starts in the background ignores Ctrl-C, and so would each program that is started here.
signal.signal(signal.SIGINT, signal.default_int_handler)

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
PARAMS = REPOSITORY / "docs" / "params"
MAVPROXY = pathlib.Path(sys.executable).parent / "mavproxy.py"


@functools.cache
def parameter_metadata():
    """The descriptions of parameters that a release has for ground stations."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["cargo", "run", "--quiet", "--example", "parameter_docs", "--", folder]
        subprocess.run(command, cwd=REPOSITORY, check=True)
        return ElementTree.parse(pathlib.Path(folder, "apm.pdef.xml"))


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def simulator_command(port, *arguments):
    if "--web" not in arguments:
        # Of several simulators one would have the default port.
        arguments = ("--web", "off", *arguments)
    return ["cargo", "run", "--quiet", "--", "--tcp", f"127.0.0.1:{port}", *arguments]


def failed_start(*arguments):
    """What the simulator prints when it refuses to start."""
    command = simulator_command(free_port(), *arguments)
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1 and ended.stdout == "", ended
    return ended.stderr


class Program:
    """A program in a process group of its own, whose output is read all the time: it never waits for a full pipe."""

    def __init__(self, command, first_line, **streams):
        self.process = subprocess.Popen(
            command,
            cwd=REPOSITORY,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
            **streams,
        )
        line = self.process.stdout.readline()
        assert re.match(first_line, line), line
        self.output = []
        self.reader = threading.Thread(target=lambda: self.output.extend(self.process.stdout), daemon=True)
        self.reader.start()

    def wait(self):
        """Waits until it ends; returns the exit code and what it had printed since the first line."""
        self.process.wait(timeout=20)
        self.reader.join(timeout=20)
        return self.process.returncode, "".join(self.output)

    def suspend(self):
        """The machine goes to sleep, or the process gets no time."""
        os.killpg(self.process.pid, signal.SIGSTOP)

    def resume(self):
        os.killpg(self.process.pid, signal.SIGCONT)

    def kill(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


class Simulator(Program):
    """The simulator as its user starts it."""

    def __init__(self, *arguments, port=None):
        self.port = port or free_port()
        super().__init__(simulator_command(self.port, *arguments), r"MAVLink on tcp:", stderr=subprocess.STDOUT)

    @property
    def url(self):
        return f"tcp:127.0.0.1:{self.port}"

    def interrupt(self):
        """Presses Ctrl-C; returns the exit code and what it had printed since the first line."""
        os.killpg(self.process.pid, signal.SIGINT)
        return self.wait()


class EmulatedBoard(Program):
    """The release firmware on an emulated RP2040, in step with the wall clock."""

    def __init__(self, flash, *more):
        self.flash = flash
        self.uart_port, self.usb_port = free_port(), free_port()
        ports = {"--uart": self.uart_port, "--usb": self.usb_port}
        arguments = [word for name, port in ports.items() for word in (name, f"127.0.0.1:{port}")]
        command = [*"cargo test --quiet --test emulated_board --".split(), *arguments, "--flash", str(flash), *more]
        # The first line comes once it is built.
        super().__init__(command, r"UART0 on tcp:", stdin=subprocess.PIPE)

    @property
    def uart_url(self):
        return f"tcp:127.0.0.1:{self.uart_port}"

    @property
    def usb_url(self):
        return f"tcp:127.0.0.1:{self.usb_port}"

    def switch_off(self):
        """Ends it, so that its flash file is written; returns what it had printed since the first line."""
        self.process.stdin.close()
        code, output = self.wait()
        assert code == 0
        return output


class WifiBoard(EmulatedBoard):
    """The same with the radio of a Pico W: each port is one of a laptop that has joined the board's network.

    By UDP a ground station waits at the port until the board finds it; to the one by TCP several can connect.
    """

    UDP_LAPTOPS = 2

    def __init__(self, flash):
        self.udp_ports = [free_port() for _ in range(self.UDP_LAPTOPS)]
        self.tcp_port = free_port()
        udp = [word for port in self.udp_ports for word in ("--wifi-udp", f"127.0.0.1:{port}")]
        super().__init__(flash, *udp, "--wifi-tcp", f"127.0.0.1:{self.tcp_port}")

    @property
    def udp_urls(self):
        return [f"udpin:127.0.0.1:{port}" for port in self.udp_ports]

    @property
    def tcp_url(self):
        return f"tcp:127.0.0.1:{self.tcp_port}"


class PageBoard(EmulatedBoard):
    """The same with the radio of a Pico W, and a laptop in the board's network for browsers."""

    URL = "http://192.168.4.1/"

    def __init__(self, flash):
        self.http_port = free_port()
        super().__init__(flash, "--wifi-http", f"127.0.0.1:{self.http_port}")

    @property
    def route(self):
        """The argument by which Chromium finds the board at its own address."""
        return f"--host-resolver-rules=MAP 192.168.4.1:80 127.0.0.1:{self.http_port}"

    def motors(self):
        """Whether the motors are driven, and the emulated time in seconds."""
        begin = len(self.output)
        self.process.stdin.write("motors\n")
        self.process.stdin.flush()
        while self.process.poll() is None:
            for line in self.output[begin:]:
                if shown := re.match(r"Motors (.+) at (\d+) us", line):
                    return shown[1] == "driven", int(shown[2]) / 1e6
            time.sleep(0.001)
        raise AssertionError("it has ended")


class CanBoard(EmulatedBoard):
    """The same with a CAN controller, and an adapter at its bus that speaks slcan over TCP."""

    def __init__(self, flash):
        self.can_port = free_port()
        super().__init__(flash, "--can", f"127.0.0.1:{self.can_port}")

    def trouble(self, words):
        """Makes trouble on the bus, as the emulated board's help says."""
        self.process.stdin.write(f"can {words}\n")
        self.process.stdin.flush()


def pytest_addoption(parser):
    parser.addoption("--board", metavar="PORT", help="a serial port, or tcp:HOST:PORT: what runs there is tested")
    parser.addoption("--long", action="store_true", help="also what .ci/web runs: every way of letting go of the stick")
    parser.addoption("--pictures", metavar="FOLDER", help="where the page in the browser is painted")


def pytest_configure(config):
    config.addinivalue_line("markers", "board: needs nothing that only the simulator has")
    config.addinivalue_line("markers", "long: for .ci/web")


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--long"):
        long = [item for item in items if item.get_closest_marker("long")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if not item.get_closest_marker("long")]
    if config.getoption("--board"):
        others = [item for item in items if not item.get_closest_marker("board")]
        config.hook.pytest_deselected(items=others)
        items[:] = [item for item in items if item.get_closest_marker("board")]


class Board:
    """What runs already and goes on after the test."""

    def __init__(self, url):
        self.url = url
        vehicle = station.connect(url)
        reset = station.command(vehicle, station.mavlink.MAV_CMD_PREFLIGHT_STORAGE, 2)
        assert reset == station.mavlink.MAV_RESULT_ACCEPTED
        station.restarted(vehicle, url).close()

    def kill(self):
        pass


@pytest.fixture(scope="session", autouse=True)
def boards_parameters(pytestconfig):
    """Sets what was set on the board before the tests."""
    url = pytestconfig.getoption("--board")
    if not url:
        yield
        return
    before = station.read_list(station.connect(url))
    yield
    vehicle = station.connect(url)
    # Of a pack that is enabled again, the others become visible first.
    for name in sorted(before, key=lambda name: not name.endswith("_MONITOR")):
        station.set_to(vehicle, name, before[name])
    station.restarted(vehicle, url).close()


@pytest.fixture
def start_simulator(pytestconfig):
    """Starts simulators with the given arguments and ends them after the test."""
    started = []

    def start(*arguments):
        board = pytestconfig.getoption("--board")
        started.append(Board(board, *arguments) if board else Simulator(*arguments))
        return started[-1]

    yield start
    for simulator in started:
        simulator.kill()


@pytest.fixture
def start_emulated_board(tmp_path):
    """Starts the emulated board, each time with the same flash file, and ends it after the test."""
    started = []

    def start():
        started.append(EmulatedBoard(tmp_path / "flash"))
        return started[-1]

    yield start
    for board in started:
        board.kill()


@pytest.fixture
def emulated_board(start_emulated_board):
    """The emulated board with a chip that has the firmware and nothing else."""
    return start_emulated_board()
