"""The Wi-Fi of a Pico W, set by examples/wifi_config.py. The simulator has no radio, which it answers."""

import contextlib
import os
import pty
import signal
import socket
import subprocess
import sys
import time

import pytest

from conftest import REPOSITORY

SCRIPT = REPOSITORY / "examples" / "wifi_config.py"


@pytest.mark.parametrize("network", [["my network"], ["--own"]])
def test_a_rover_without_a_radio_refuses(start_simulator, network):
    command = [sys.executable, SCRIPT, *network, "--link", start_simulator().url]
    ended = subprocess.run(command, input="a password\n", capture_output=True, text=True, timeout=30)
    assert (ended.returncode, ended.stderr) == (1, "refused: no radio, or no such mode\n")


def test_a_network_is_needed():
    ended = subprocess.run([sys.executable, SCRIPT], capture_output=True, text=True, timeout=30)
    assert ended.returncode == 2 and "name" in ended.stderr


@pytest.mark.parametrize(
    ("network", "password", "error"),
    [
        ("", "a password", "a name has 1 to 32 bytes, this one 0"),
        ("n" * 33, "a password", "a name has 1 to 32 bytes, this one 33"),
        ("ö" * 17, "a password", "a name has 1 to 32 bytes, this one 34"),
        ("a network", "p" * 64, "a password has 63 bytes at most, this one 64"),
    ],
)
def test_what_is_too_long_is_refused_before_the_rover_is_asked(network, password, error):
    with socket.create_server(("127.0.0.1", 0)) as rover:
        command = [sys.executable, SCRIPT, network, "--link", f"tcp:127.0.0.1:{rover.getsockname()[1]}"]
        ended = subprocess.run(command, input=f"{password}\n", capture_output=True, text=True, timeout=30)
        assert ended.returncode == 2 and ended.stderr.endswith(f"{error}\n"), ended
        rover.setblocking(False)
        with pytest.raises(BlockingIOError):
            rover.accept()


def test_a_port_without_a_rover_is_named():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        port = f"tcp:127.0.0.1:{silent.getsockname()[1]}"
        command = [sys.executable, SCRIPT, "a network", "--link", port]
        ended = subprocess.run(command, input="a password\n", capture_output=True, text=True, timeout=30)
    assert (ended.returncode, ended.stderr) == (2, f"No rover at {port}.\n")


@pytest.mark.parametrize("port", ["no-such-port", "tcp:127.0.0.1:1", "tcp:port", str(SCRIPT)])
def test_a_port_that_does_not_open_is_named(port):
    command = [sys.executable, SCRIPT, "a network", "--link", port]
    ended = subprocess.run(command, input="a password\n", capture_output=True, text=True, timeout=30)
    assert ended.returncode == 2 and ended.stderr.startswith(f"Can't open {port}: "), ended
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize(("key", "code"), [(b"\x03", 1), (b"\x04", 2)])
def test_leaving_the_question_for_the_password_ends_it(key, code):
    """Ctrl-C and Ctrl-D on a terminal."""
    process, terminal = pty.fork()
    if process == 0:
        os.execv(sys.executable, [sys.executable, SCRIPT, "a network", "--link", "tcp:127.0.0.1:1"])
    shown = b""
    while b"Password: " not in shown:
        shown += os.read(terminal, 1024)
    # It reads the terminal from a moment later on.
    time.sleep(0.2)
    os.write(terminal, key)
    # Its end is an error here.
    with contextlib.suppress(OSError):
        while more := os.read(terminal, 1024):
            shown += more
    os.close(terminal)
    _, status = os.waitpid(process, 0)
    assert os.waitstatus_to_exitcode(status) == code and b"Traceback" not in shown, shown


def test_ctrl_c_while_no_rover_answers():
    with socket.create_server(("127.0.0.1", 0)) as silent:
        command = [sys.executable, SCRIPT, "a network", "--link", f"tcp:127.0.0.1:{silent.getsockname()[1]}"]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as script:
            script.stdin.write("a password\n")
            script.stdin.flush()
            silent.accept()
            script.send_signal(signal.SIGINT)
            assert (script.wait(timeout=5), script.stderr.read()) == (1, "")
