"""What the oracle expects MAVProxy to say, beside what MAVProxy itself says."""

import os
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from pymavlink import mavutil

from oracle import MavProxy as MavProxyRules
from station import command, connect
from test_mavproxy import MavProxy
from test_shown import CURRENT_SENSOR, LiveLink, Situation

mavlink = mavutil.mavlink

# One MAVProxy at a time, but for these.
pytestmark = pytest.mark.xdist_group("mavproxy")

# MAVProxy speaks by this command of a Mac if it finds no library for it.
SAY = """#!/bin/sh
echo "$1" >> "$SPOKEN"
"""


class SpeakingMavProxy(MavProxy):
    """An unmodified MAVProxy, and the file of what it speaks."""

    def __init__(self, url, folder):
        self.spoken = folder / "spoken"
        say = folder / "bin" / "say"
        say.parent.mkdir()
        say.write_text(SAY)
        say.chmod(0o755)
        path = f"{say.parent}{os.pathsep}{os.environ['PATH']}"
        super().__init__(url, folder, "--speech", PATH=path, SPOKEN=str(self.spoken))


def spoken_by_both(folder, percent, **parameters):
    """What MAVProxy speaks of a rover whose charge was set to so much and that is armed, and what the oracle expects."""
    with Situation(speedup=1, **parameters) as situation:
        if percent is not None:
            assert situation.command(mavlink.MAV_CMD_BATTERY_RESET, 65535, percent) == mavlink.MAV_RESULT_ACCEPTED
        situation.let_pass(1)
        link = LiveLink(connect(situation.simulator.url), speedup=1, mavproxy=MavProxyRules(console=False))
        mavproxy = SpeakingMavProxy(situation.simulator.url, folder)
        mavproxy.type("arm throttle force")
        try:
            end = time.monotonic() + 4
            while time.monotonic() < end:
                link.receive()
                time.sleep(0.05)
        finally:
            mavproxy.kill()
        # First nothing is spoken, to see whether it can.
        spoken = filter(None, mavproxy.spoken.read_text().splitlines())
        return sorted(spoken), sorted(link.proxy_said)


# The charge that is set, and the parameters of the pack.
BESIDE_MAVPROXY = {
    "full": (None, CURRENT_SENSOR),
    "drained": (10, CURRENT_SENSOR),
    "unknown": (None, {"BATT_MONITOR": 31, "BATT_CURR_PIN": 27}),
}


@pytest.fixture(scope="module")
def beside_mavproxy(tmp_path_factory):
    """All of them at the same time: MAVProxy takes its time to start."""

    folders = [tmp_path_factory.mktemp(case) for case in BESIDE_MAVPROXY]

    def play(folder, charge_and_parameters):
        percent, parameters = charge_and_parameters
        return spoken_by_both(folder, percent, **parameters)

    with ThreadPoolExecutor() as pool:
        return dict(zip(BESIDE_MAVPROXY, pool.map(play, folders, BESIDE_MAVPROXY.values())))


@pytest.mark.parametrize("case", BESIDE_MAVPROXY)
def test_mavproxy_speaks_what_the_oracle_expects(beside_mavproxy, case):
    spoken, expected = beside_mavproxy[case]
    assert spoken == expected


def test_mavproxy_speaks_of_no_fence_and_of_a_low_battery_only(beside_mavproxy):
    spoken = {case: spoken for case, (spoken, _) in beside_mavproxy.items()}
    assert spoken["full"] == ["ARMED", "Flight battery 100 percent", "Mode HOLD", "online system 1"]
    assert "Flight battery warning" in spoken["drained"]
    assert not any("fence" in text for texts in spoken.values() for text in texts)
