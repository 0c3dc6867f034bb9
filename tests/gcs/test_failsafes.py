"""A failsafe from a ground station, once. What levels, timers and actions do is shown on the core: `tests/stories/`,
`tests/host/failsafe.rs` and `tests/host/rover.rs`.
"""

import time

import pytest
from pymavlink import mavutil

from station import Background, command, connect, fresh, result_of, set_to, sticks

mavlink = mavutil.mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
FAILED = mavlink.MAV_RESULT_FAILED

ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
FORCE = 21196

# ArduPilot Rover's numbers.
MANUAL = 0
HOLD = 4

ACTIVE = mavlink.MAV_STATE_ACTIVE
STANDBY = mavlink.MAV_STATE_STANDBY


class Rover:
    """The simulated rover, with a ground station that remembers what it has said. Times are simulated seconds."""

    def __init__(self, simulator, speedup):
        self.simulator = simulator
        self.url = simulator.url
        self.speedup = speedup
        self.texts = []
        self.link = connect(self.url)
        # A text may come while another answer is waited for.
        self.link.message_hooks.append(self.remember)

    def remember(self, _, message):
        if message.get_type() == "STATUSTEXT":
            self.texts.append(message.text)

    def now(self):
        return time.monotonic() * self.speedup

    def let_pass(self, seconds):
        end = self.now() + seconds
        while (left := end - self.now()) > 0:
            self.link.recv_match(blocking=True, timeout=left / self.speedup)

    def hears(self, text, within):
        """Waits for a text that begins like this."""
        end = self.now() + within
        while not self.has_said(text):
            left = end - self.now()
            assert left > 0, f"it never said {text!r}, but {self.texts}"
            self.link.recv_match(blocking=True, timeout=left / self.speedup)

    def comes_to(self, state):
        """Waits until mode, armed and system status are so. A text leaves before the tick that sets the status."""
        end = self.now() + 2
        while self.state() != state:
            assert self.now() < end, f"{self.state()} instead of {state}"

    def has_said(self, text):
        return any(heard.startswith(text) for heard in self.texts)

    def set(self, **values):
        for name, value in values.items():
            assert set_to(self.link, name, value).param_value == pytest.approx(value), name

    def set_mode(self, mode):
        return command(self.link, mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)

    def start_driving(self):
        assert command(self.link, ARM_DISARM, 1) == ACCEPTED
        assert self.set_mode(MANUAL) == ACCEPTED
        assert self.state() == (MANUAL, True, ACTIVE)

    def state(self):
        """Mode, whether it is armed, and how it is."""
        heartbeat = fresh(self.link, "HEARTBEAT")
        armed = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        return heartbeat.custom_mode, armed, heartbeat.system_status

    def battery_is_healthy(self):
        health = fresh(self.link, "SYS_STATUS").onboard_control_sensors_health
        return bool(health & mavlink.MAV_SYS_STATUS_SENSOR_BATTERY)


@pytest.fixture
def start_rover(start_simulator):
    def start(speedup, **parameters):
        rover = Rover(start_simulator("--speedup", str(speedup)), speedup)
        # A fraction of a second of this machine is a long silence for a fast simulator.
        rover.set(FS_TIMEOUT=1.5 if speedup == 1 else 50, **parameters)
        return rover

    return start


# Requirement: AP-16
def test_a_low_pack_stops_the_rover_until_the_battery_is_reset(start_rover):
    rover = start_rover(5, BATT_LOW_VOLT=10.5, BATT_LOW_TIMER=2, BATT_FS_LOW_ACT=2)
    rover.start_driving()
    with Background(sticks(rover.url, throttle=300)):
        rover.set(SIM_BATT_VOLTAGE=10.2)
        rover.hears("Battery 1 is low 10.", within=8)
        rover.comes_to((HOLD, True, STANDBY))
        rover.set(SIM_BATT_VOLTAGE=11.5)
        rover.let_pass(2)
        assert not rover.battery_is_healthy()
        assert command(rover.link, mavlink.MAV_CMD_BATTERY_RESET, 65535, 97) == ACCEPTED
        # The next tick takes it up.
        rover.let_pass(0.3)
        assert rover.battery_is_healthy()
        assert fresh(rover.link, "BATTERY_STATUS").battery_remaining == 97
        assert rover.state() == (HOLD, True, STANDBY), "it stays where it is"
        assert rover.set_mode(MANUAL) == ACCEPTED


# Requirement: L-1
def test_orders_that_waited_while_the_simulator_stood_still_move_nothing(start_rover):
    rover = start_rover(1)
    push = sticks(rover.url, throttle=1000)
    rover.start_driving()
    rover.simulator.suspend()
    for _ in range(5):
        push()
    rover.link.mav.command_long_send(1, 1, ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0)
    rover.link.mav.command_long_send(1, 1, ARM_DISARM, 0, 1, FORCE, 0, 0, 0, 0, 0)
    time.sleep(2)
    rover.simulator.resume()
    # Disarming is obeyed, however late.
    assert result_of(rover.link, ARM_DISARM) == ACCEPTED
    assert result_of(rover.link, ARM_DISARM) == FAILED
    assert rover.has_said("Command waited for too long: refused")
    assert rover.state() == (MANUAL, False, STANDBY)
