"""Arming, driving and the failsafes, from a ground station."""

import time

import pytest
from pymavlink import mavutil

from station import Background, command, connect, fresh, receive, result_of, set_to, sticks

mavlink = mavutil.mavlink

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
FAILED = mavlink.MAV_RESULT_FAILED

ARM_DISARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
RUN_PREARM_CHECKS = mavlink.MAV_CMD_RUN_PREARM_CHECKS
FORCE = 21196

# ArduPilot Rover's numbers.
MANUAL = 0
HOLD = 4

ACTIVE = mavlink.MAV_STATE_ACTIVE
CRITICAL = mavlink.MAV_STATE_CRITICAL
EMERGENCY = mavlink.MAV_STATE_EMERGENCY

UNKNOWN_MV = 65535


class Rover:
    """The simulated rover, with a ground station that remembers what it has said. Times are simulated seconds."""

    def __init__(self, simulator, speedup):
        self.simulator = simulator
        self.url = simulator.url
        self.speedup = speedup
        self.texts = []
        self.connect()

    def connect(self):
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
        """Waits for a text that begins like this, and returns it whole."""
        end = self.now() + within
        while True:
            for heard in self.texts:
                if heard.startswith(text):
                    return heard
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

    def arm(self, *force):
        return command(self.link, ARM_DISARM, 1, *force)

    def disarm(self):
        return command(self.link, ARM_DISARM, 0)

    def set_mode(self, mode):
        return command(self.link, mavlink.MAV_CMD_DO_SET_MODE, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode)

    def start_driving(self):
        assert self.arm() == ACCEPTED
        assert self.set_mode(MANUAL) == ACCEPTED
        assert self.state() == (MANUAL, True, ACTIVE)

    def reset_batteries(self, percent):
        assert command(self.link, mavlink.MAV_CMD_BATTERY_RESET, 65535, percent) == ACCEPTED
        # The next tick takes it up.
        self.let_pass(0.3)

    def restart(self):
        assert command(self.link, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == ACCEPTED
        # The connection ends with the vehicle that has been switched off.
        while self.link.recv_match(blocking=True, timeout=0.5) is not None:
            pass
        self.link.close()
        self.connect()

    def state(self):
        """Mode, whether it is armed, and how it is."""
        heartbeat = fresh(self.link, "HEARTBEAT")
        armed = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        return heartbeat.custom_mode, armed, heartbeat.system_status

    def battery(self):
        return fresh(self.link, "BATTERY_STATUS")

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


@pytest.fixture
def start_rover_with_current_sensor(start_rover):
    """The current sensor takes a restart; the pack's model has the capacity that is set, so that both agree."""

    def start(speedup, **parameters):
        sensor = {"BATT_MONITOR": 4, "BATT_CURR_PIN": 27, "BATT_CAPACITY": 1000, "SIM_BATT_CAP_AH": 1}
        rover = start_rover(speedup, **sensor, **parameters)
        rover.restart()
        assert rover.battery().current_consumed != -1
        return rover

    return start


def driven(rover, throttle=0):
    return Background(sticks(rover.url, throttle))


def test_a_low_voltage_counts_after_the_timer_and_until_the_battery_is_reset(start_rover):
    rover = start_rover(5, BATT_LOW_VOLT=10.5, BATT_LOW_TIMER=10, BATT_FS_LOW_ACT=2)
    rover.start_driving()
    with driven(rover, throttle=300):
        assert rover.battery_is_healthy()
        dropped = rover.now()
        rover.set(SIM_BATT_VOLTAGE=10.2)
        text = rover.hears("Battery 1 is low 10.", within=16)
        assert rover.now() - dropped > 10, text
        assert rover.state() == (HOLD, True, CRITICAL)
        assert not rover.battery_is_healthy()

        rover.set(SIM_BATT_VOLTAGE=11.5)
        # A charge state has to last for 3 s before it is reported.
        rover.let_pass(5)
        battery = rover.battery()
        assert battery.voltages[0] > 11_300
        assert battery.charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_LOW
        assert rover.state() == (HOLD, True, CRITICAL)
        assert not rover.battery_is_healthy()
        assert rover.set_mode(MANUAL) == ACCEPTED, "the driver decides"
        assert rover.state() == (MANUAL, True, CRITICAL)
        assert rover.disarm() == ACCEPTED
        assert rover.arm() == FAILED
        assert rover.has_said("Arm: Battery 1 low voltage failsafe")


def test_dips_shorter_than_the_timer_do_not_add_up(start_rover):
    rover = start_rover(5, BATT_LOW_VOLT=10.5, BATT_LOW_TIMER=10, BATT_FS_LOW_ACT=2)
    with driven(rover):
        rover.start_driving()
        for _ in range(2):
            rover.set(SIM_BATT_VOLTAGE=10.2)
            rover.let_pass(6)
            assert rover.battery().voltages[0] < 10_500
            rover.set(SIM_BATT_VOLTAGE=11.5)
            rover.let_pass(2)
        assert not rover.has_said("Battery 1 is")
        assert rover.state() == (MANUAL, True, ACTIVE)
        assert rover.battery_is_healthy()


def test_a_critical_voltage_takes_the_same_timer(start_rover):
    rover = start_rover(5, BATT_LOW_VOLT=10.5, BATT_CRT_VOLT=9.9, BATT_LOW_TIMER=10, BATT_FS_CRT_ACT=2)
    with driven(rover):
        rover.start_driving()
        dropped = rover.now()
        rover.set(SIM_BATT_VOLTAGE=9.5)
        rover.hears("Battery 1 is critical 9.", within=16)
        assert rover.now() - dropped > 10
        assert rover.state() == (HOLD, True, CRITICAL)
        rover.let_pass(4)
        assert rover.battery().charge_state == mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL
        assert not rover.has_said("Battery 1 is low"), "only the worse is said"


@pytest.mark.parametrize(
    ["low_action", "when_low", "critical_action", "when_critical"],
    [
        (0, (MANUAL, True, CRITICAL), 2, (HOLD, True, CRITICAL)),
        (2, (HOLD, True, CRITICAL), 5, (HOLD, False, EMERGENCY)),
        # What was done when it was low is not taken back by a milder action.
        (2, (HOLD, True, CRITICAL), 0, (HOLD, True, CRITICAL)),
    ],
)
def test_low_becomes_critical(start_rover, low_action, when_low, critical_action, when_critical):
    rover = start_rover(
        5,
        BATT_LOW_VOLT=10.5,
        BATT_CRT_VOLT=9.9,
        BATT_LOW_TIMER=3,
        BATT_FS_LOW_ACT=low_action,
        BATT_FS_CRT_ACT=critical_action,
    )
    with driven(rover):
        rover.start_driving()
        rover.set(SIM_BATT_VOLTAGE=10.2)
        rover.hears("Battery 1 is low", within=9)
        rover.comes_to(when_low)
        assert not rover.has_said("Battery 1 is critical")
        rover.set(SIM_BATT_VOLTAGE=9.5)
        rover.hears("Battery 1 is critical", within=9)
        rover.comes_to(when_critical)


@pytest.mark.parametrize(
    ["action", "state", "text"],
    [
        (0, (MANUAL, True, CRITICAL), None),
        (1, (HOLD, True, CRITICAL), "RTL needs a position: Hold"),
        (2, (HOLD, True, CRITICAL), None),
        (3, (HOLD, True, CRITICAL), "SmartRTL needs a position: Hold"),
        (4, (HOLD, True, CRITICAL), "SmartRTL needs a position: Hold"),
        (5, (MANUAL, False, EMERGENCY), "Terminated by battery failsafe"),
        (6, (HOLD, True, CRITICAL), "Loiter needs a position: Hold"),
    ],
)
def test_actions(start_rover, action, state, text):
    rover = start_rover(10, BATT_LOW_VOLT=10.5, BATT_LOW_TIMER=2, BATT_FS_LOW_ACT=action)
    rover.start_driving()
    with driven(rover, throttle=300):
        rover.set(SIM_BATT_VOLTAGE=10.2)
        rover.hears("Battery 1 is low", within=12)
        # Whatever it says beside comes right behind.
        rover.let_pass(2)
        said = [heard for heard in rover.texts if "position" in heard or "Terminated" in heard]
        assert said == ([text] if text else [])
        assert rover.state() == state


def test_terminated_is_terminated_until_the_battery_is_reset(start_rover):
    rover = start_rover(10, BATT_LOW_VOLT=10.5, BATT_LOW_TIMER=2, BATT_FS_LOW_ACT=5)
    with driven(rover):
        rover.start_driving()
        rover.set(SIM_BATT_VOLTAGE=10.2)
        rover.hears("Terminated by battery failsafe", within=12)
        rover.set(SIM_BATT_VOLTAGE=10.6)
        # Forced or not.
        for force in ([], [FORCE]):
            rover.texts.clear()
            assert rover.arm(*force) == FAILED
            assert rover.has_said("Arm: Terminated"), rover.texts
        assert rover.state()[1:] == (False, EMERGENCY)
        rover.reset_batteries(100)
        rover.start_driving()


# Not beside clients that flood a simulator: a tick that comes late counts too much.
@pytest.mark.xdist_group("unruly")
def test_a_low_charge_counts_at_once(start_rover_with_current_sensor):
    # The timer is for voltages: with one of two minutes nothing would happen here if it counted.
    rover = start_rover_with_current_sensor(
        5, BATT_LOW_MAH=900, BATT_CRT_MAH=800, BATT_LOW_TIMER=120, BATT_FS_LOW_ACT=0, BATT_FS_CRT_ACT=2
    )
    rover.reset_batteries(100)
    with driven(rover):
        rover.start_driving()
        before = rover.battery().current_consumed
        # 36 A draw 10 mAh a second.
        started = rover.now()
        rover.set(SIM_BATT_CURRENT=36)
        low = rover.hears("Battery 1 is low", within=16)
        assert 100 <= used_mah(low) <= 105, low
        rover.comes_to((MANUAL, True, CRITICAL))
        critical = rover.hears("Battery 1 is critical", within=16)
        assert 200 <= used_mah(critical) <= 205, critical
        assert rover.now() - started < 30
        assert rover.state() == (HOLD, True, CRITICAL)
        assert rover.battery().current_consumed > before + 190
        assert rover.disarm() == ACCEPTED
        assert rover.arm() == FAILED
        assert rover.has_said("Arm: Battery 1 low capacity failsafe")


def used_mah(text):
    # "Battery 1 is low 10.20V used 101 mAh"
    return int(text.split()[-2])


def test_the_load_follows_the_throttle(start_rover_with_current_sensor):
    rover = start_rover_with_current_sensor(5, MOT_SLEWRATE=0)
    rover.start_driving()
    standing = rover.battery().current_battery
    with driven(rover, throttle=1000):
        rover.let_pass(1)
        full = rover.battery().current_battery
        assert rover.set_mode(HOLD) == ACCEPTED
        rover.let_pass(1)
        holding = rover.battery().current_battery
    # Hundredths of an ampere: the electronics alone, and with four motors.
    assert standing == pytest.approx(20, abs=3)
    assert full == pytest.approx(420, abs=10)
    assert holding == pytest.approx(20, abs=3)


def test_checks_before_arming(start_rover):
    rover = start_rover(5, BATT_ARM_VOLT=11.5, SIM_BATT_VOLTAGE=11.0)
    rover.let_pass(1)
    assert rover.arm() == FAILED
    assert "Arm: Battery 1 below minimum arming voltage" in rover.texts
    assert not rover.has_said("PreArm")
    assert command(rover.link, RUN_PREARM_CHECKS) == ACCEPTED
    assert "PreArm: Battery 1 below minimum arming voltage" in rover.texts
    assert not rover.state()[1]

    rover.set(SIM_BATT_VOLTAGE=12.0)
    rover.let_pass(1)
    rover.texts.clear()
    assert command(rover.link, RUN_PREARM_CHECKS) == ACCEPTED
    assert not rover.has_said("PreArm")
    assert rover.arm() == ACCEPTED
    assert rover.state() == (HOLD, True, ACTIVE)


@pytest.mark.parametrize("number", [21196, 2989])
def test_arming_by_force_asks_no_check(start_rover, number):
    rover = start_rover(5, BATT_ARM_VOLT=11.5, SIM_BATT_VOLTAGE=11.0)
    rover.let_pass(1)
    assert rover.arm(1) == FAILED, "that is no such number"
    assert rover.arm(number) == ACCEPTED
    assert rover.state() == (HOLD, True, ACTIVE)


def test_a_battery_reset_ends_the_failsafe(start_rover):
    rover = start_rover(5, BATT_LOW_VOLT=10.5, BATT_LOW_TIMER=2, BATT_FS_LOW_ACT=2)
    with driven(rover):
        rover.start_driving()
        rover.set(SIM_BATT_VOLTAGE=10.2)
        rover.hears("Battery 1 is low", within=8)
        rover.set(SIM_BATT_VOLTAGE=11.5)
        rover.let_pass(2)
        assert not rover.battery_is_healthy()
        rover.reset_batteries(100)
        assert rover.battery_is_healthy()
        assert rover.battery().battery_remaining == 100
        assert rover.state() == (HOLD, True, ACTIVE), "it stays where it is"
        rover.texts.clear()
        for percent in (56, 97):
            rover.reset_batteries(percent)
            assert rover.battery().battery_remaining == percent
            assert fresh(rover.link, "SYS_STATUS").battery_remaining == percent
        assert rover.set_mode(MANUAL) == ACCEPTED

        # It is as watchful as before.
        rover.set(SIM_BATT_VOLTAGE=10.2)
        rover.hears("Battery 1 is low", within=8)
        rover.comes_to((HOLD, True, CRITICAL))


@pytest.mark.parametrize(
    ["fault", "charge_state", "last"],
    [
        # The converter stalls: the last good voltage stays.
        (1, mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY, "12."),
        # The wire is off: there is no voltage.
        (2, mavlink.MAV_BATTERY_CHARGE_STATE_UNDEFINED, "12."),
    ],
)
def test_a_measurement_that_fails(start_rover, fault, charge_state, last):
    # At the speed of the wall clock: a second of it is what is asked for.
    rover = start_rover(1, SR0_EXTRA1=10, BATT_LOW_VOLT=10.5, BATT_FS_LOW_ACT=2, BATT_CRT_VOLT=9.9, BATT_FS_CRT_ACT=5)
    with driven(rover):
        rover.start_driving()
        failed = rover.now()
        rover.set(SIM_BATT_FAULT=fault)
        while (battery := receive(rover.link, ["BATTERY_STATUS"])).charge_state != charge_state:
            assert rover.now() - failed < 1, battery
        assert (battery.voltages[0] == UNKNOWN_MV) == (fault == 2)
        assert not rover.battery_is_healthy()
        assert rover.state() == (MANUAL, True, ACTIVE)

        rover.hears(f"Battery 1 is missing, last: {last}", within=6.5)
        # The 5 s begin with the last good reading, one tick before.
        assert rover.now() - failed > 4.8
        # It is only announced: a missing voltage is not a low one.
        assert rover.state() == (MANUAL, True, ACTIVE)

        rover.set(SIM_BATT_FAULT=0)
        rover.let_pass(0.5)
        assert rover.battery().voltages[0] == pytest.approx(12_500, abs=200)
        assert not rover.battery_is_healthy(), "until it is reset"
        rover.reset_batteries(100)
        assert rover.battery_is_healthy()


def test_it_holds_when_the_stick_input_times_out(start_rover):
    rover = start_rover(1)
    rover.start_driving()
    with driven(rover, throttle=300):
        rover.let_pass(2)
        assert rover.state() == (MANUAL, True, ACTIVE), "as long as they come"
    silent = rover.now()
    rover.hears("Radio Failsafe: Hold", within=2)
    # The last message was sent a moment earlier.
    assert rover.now() - silent > 1.3
    assert rover.state() == (HOLD, True, CRITICAL)
    assert rover.set_mode(MANUAL) == FAILED
    assert rover.has_said("Failsafe active: mode change denied")

    with driven(rover, throttle=300):
        rover.let_pass(0.3)
        assert rover.state() == (HOLD, True, ACTIVE), "they don't end it by themselves"
        assert rover.set_mode(MANUAL) == ACCEPTED
        assert rover.state() == (MANUAL, True, ACTIVE)
    assert rover.texts.count("Radio Failsafe: Hold") == 1


def test_it_is_not_armed_while_the_throttle_is_pushed(start_rover):
    rover = start_rover(1)
    with driven(rover, throttle=1000):
        rover.let_pass(0.5)
        assert rover.arm() == FAILED
        assert rover.has_said("Arm: Throttle (RC3) is not neutral")
    rover.let_pass(1.7)
    assert rover.arm() == ACCEPTED


def test_orders_that_waited_while_the_simulator_stood_still_move_nothing(start_rover):
    rover = start_rover(1)
    push = sticks(rover.url, throttle=1000)
    rover.start_driving()
    rover.simulator.suspend()
    for _ in range(5):
        push()
    rover.link.mav.command_long_send(1, 1, ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0)
    rover.link.mav.command_long_send(1, 1, ARM_DISARM, 0, 1, FORCE, 0, 0, 0, 0, 0)
    time.sleep(3)
    rover.simulator.resume()
    # Disarming is obeyed, however late.
    assert result_of(rover.link, ARM_DISARM) == ACCEPTED
    assert result_of(rover.link, ARM_DISARM) == FAILED
    assert rover.has_said("Command waited for too long: refused")
    assert rover.state() == (MANUAL, False, mavlink.MAV_STATE_STANDBY)


def test_a_driving_rover_is_not_restarted(start_rover):
    rover = start_rover(1)
    rover.start_driving()
    assert command(rover.link, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == FAILED
    assert command(rover.link, mavlink.MAV_CMD_PREFLIGHT_STORAGE, 2) == FAILED
    assert rover.has_said("Not while armed: disarm first")
    assert rover.state() == (MANUAL, True, ACTIVE)


def test_it_holds_when_the_ground_station_falls_silent(start_rover):
    rover = start_rover(1)

    def heartbeat():
        rover.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    heartbeat()
    rover.start_driving()
    rover.let_pass(1)
    silent = rover.now()
    heartbeat()
    # A few heartbeats may be lost: FS_GCS_TIMEOUT is 5 s.
    rover.hears("GCS Failsafe: Hold", within=6)
    assert rover.now() - silent > 5
    assert rover.state() == (HOLD, True, CRITICAL)
    assert not rover.has_said("Radio"), "no stick input was received"
    heartbeat()
    assert rover.state() == (HOLD, True, ACTIVE)
    assert rover.set_mode(MANUAL) == ACCEPTED
