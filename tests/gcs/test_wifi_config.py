"""The Wi-Fi of a Pico W, set by examples/wifi_config.py. The simulator has no radio, which it answers."""

import subprocess
import sys

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
