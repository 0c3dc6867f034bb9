"""The page in the browser and a network that stalls, loses connections or leads to another rover: nothing drives unasked, no
Stop is forgotten, and what the page says is true.

Motion is judged by the motors' current.
"""

import time

import pytest
from pymavlink import mavutil

from browser import DESKTOP, with_board_id
from station import Background, command, receive, set_to
from test_page import parameter, rover, start_rover  # noqa: F401
from test_signing import KEY, sign_with, ticks_now, wait_for_text

mavlink = mavutil.mavlink

# Browsers wait for one another on a small machine.
pytestmark = pytest.mark.xdist_group("browser")

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_MODE = mavlink.MAV_CMD_DO_SET_MODE
COMMAND_LONG, PARAM_SET = 76, 23
MANUAL, HOLD = 0, 4
FS_TIMEOUT_S = 1.5


@pytest.fixture
def page(rover):
    """The page in its room of the driver, by a network of its own."""
    rover.measure_current()
    page = rover.open(url=rover.network.url)
    page.enter("drive")
    page.wait(lambda: not page.run("return document.getElementById('arm').disabled"))
    return page


def drive(page):
    page.hold_to_arm()
    page.wait_for("Armed")
    page.press("Manual")
    page.wait_for("Move the stick to drive")


def set_mode(rover, mode):
    assert command(rover.station, SET_MODE, 1, mode) == mavlink.MAV_RESULT_ACCEPTED


def rests(rover, samples=30):
    """Whether no motor turns, for a second and a half."""
    return not any(rover.turns() for _ in range(samples))


def touch(page, element_id):
    """A finger on a button, and off it, without waiting for what comes of it."""
    x, y, _ = page.middle("#" + element_id)
    page.mouse("mousePressed", x, y)
    page.mouse("mouseReleased", x, y)


# 1. A stick drives from its own neutral position on.


def test_a_stick_held_before_another_station_arms_moves_nothing(rover, page):
    page.push_stick()
    rover.arm()
    set_mode(rover, MANUAL)
    page.wait_for("Centre the throttle (RC3) first")
    assert rests(rover) and "The rover follows" not in page.text()
    page.release_stick()
    page.push_stick()
    rover.seconds_until(rover.turns, 3)
    page.wait_for("The rover follows the stick")


@pytest.mark.long
def test_a_stick_held_while_a_station_lets_go_of_its_override_moves_nothing(rover, page):
    drive(page)
    # The page's stick has been neutral for long enough for another driver.
    time.sleep(1.5)
    with Background(lambda: override(rover, 1500)):
        time.sleep(1)
    with Background(lambda: override(rover, 1700)):
        rover.seconds_until(rover.turns, 3)
        page.push_stick()
        page.wait_for("Sticks ignored: another station drives")
        # The hint follows with the next drawing.
        page.wait_until_gone("The rover follows")
        assert "The rover follows" not in page.text()
    for _ in range(5):
        override(rover, 0)
    rover.seconds_until(lambda: not rover.turns(), 1)
    assert rests(rover)


def override(rover, throttle):
    """A tenth of a second of RC_CHANNELS_OVERRIDE; 0 lets go."""
    unchanged = 65535
    rover.station.mav.rc_channels_override_send(1, 1, unchanged, unchanged, throttle, *[unchanged] * 5)
    time.sleep(0.1)


# 3. Commands have an age.


def test_arm_does_not_act_after_a_stall(rover, page):
    x, y, _ = page.middle("#arm")
    page.touch("touchStart", (x, y))
    time.sleep(0.8)
    rover.network.deafen()
    time.sleep(0.5)
    page.touch("touchEnd")
    page.wait_for("Not armed: no answer", 4)
    assert "The link is too slow to drive" in page.text()
    rover.network.mend()
    page.wait_for("Not armed: Command waited for too long: refused")
    assert not rover.is_armed


@pytest.mark.long
def test_manual_does_not_act_after_a_stall(rover, page):
    drive(page)
    set_mode(rover, HOLD)
    page.wait_for("In Hold it stands")
    rover.network.deafen()
    touch(page, "manual")
    page.wait_for("Not in Manual: no answer", 5)
    rover.network.mend()
    page.wait_for("Not in Manual: Command waited for too long: refused")
    assert rover.mode == "Hold"


def search_low_volt(page):
    page.enter("setup")
    page.wait_for("The rover counts 3 cells")
    page.element("#search").send_keys("batt_low_volt")
    page.wait(lambda: page.read("found").startswith("1 of "))


def enter_in_list(page, value):
    """Enters a value for the first parameter that was found."""
    page.run("const input = document.querySelector('#list input'); input.value = arguments[0]; input.onchange()", value)


def test_a_slow_link_is_said_and_then_takes_the_stick(rover, page):
    drive(page)
    rover.network.up.delay_s = rover.network.down.delay_s = 0.6
    page.wait_for("Slow link: rover 1")
    page.push_stick()
    rover.seconds_until(rover.turns, 3)
    page.wait_for("The rover follows the stick")
    rover.network.up.delay_s = rover.network.down.delay_s = 0.9
    page.wait_for("The link is too slow to drive. The rover stops by itself.")
    rover.seconds_until(lambda: not rover.turns(), FS_TIMEOUT_S + 1)
    assert [throttle for _, throttle in page.sticks_sent()][-1] == 0
    rover.network.up.delay_s = rover.network.down.delay_s = 0
    page.wait_for("Live: rover 1")


def drive_on(rover):
    """The rover has long time-outs: it drives on without a driver."""
    for name in ("FS_TIMEOUT", "FS_GCS_TIMEOUT"):
        assert set_to(rover.station, name, 100).param_value == 100


# 6. Stop is wanted until the rover has obeyed.


def test_stop_is_not_undone_by_a_manual_before_it(rover, page):
    drive(page)
    set_mode(rover, HOLD)
    page.wait_for("In Hold it stands")
    # A heartbeat of the mode before is on its way all the time, and no answer comes within a second.
    rover.network.down.delay_s = 1.2
    time.sleep(2)
    for _ in range(2):
        touch(page, "manual")
        time.sleep(0.3)
        touch(page, "stop")
        time.sleep(3)
        assert rover.mode == "Hold"
        page.wait_for("Stopped: Hold")


@pytest.mark.long
def test_a_heartbeat_from_before_stop_does_not_confirm_it(rover, page):
    drive_on(rover)
    drive(page)
    set_mode(rover, HOLD)
    page.wait_for("In Hold it stands")
    # A heartbeat is on its way all the time.
    rover.network.down.delay_s = 1.2
    time.sleep(2)
    touch(page, "manual")
    page.wait(lambda: rover.mode == "Manual", 2)
    rover.network.deafen()
    touch(page, "stop")
    time.sleep(2)
    assert rover.mode == "Manual" and "Stopped" not in page.text()
    rover.network.mend()
    page.wait_for("Stopped: Hold")
    assert rover.mode == "Hold"


def test_stop_survives_a_lost_connection(rover, page):
    drive_on(rover)
    drive(page)
    page.push_stick()
    rover.seconds_until(rover.turns, 3)
    rover.network.lose()
    touch(page, "stop")
    page.wait_for("Stopping…")
    # However often it is touched.
    for _ in range(2):
        time.sleep(2)
        touch(page, "stop")
    page.wait_for("No answer: it may drive on. Switch it off.", 3)
    assert "stops by itself" not in page.text() and rover.turns()
    time.sleep(3)
    assert "No answer: it may drive on. Switch it off." in page.text()
    rover.network.mend()
    page.wait_for("Stopped: Hold", 15)
    assert rover.mode == "Hold"
    rover.seconds_until(lambda: not rover.turns(), 1)


@pytest.mark.long
def test_stop_is_sent_five_times_a_second_and_then_once(rover, page):
    drive(page)
    rover.network.deafen()
    since = page.now_ms()
    touch(page, "stop")
    time.sleep(8.5)
    sent = [at - since for at in stops_sent(page)]
    rover.network.mend()
    assert sent[0] < 300
    assert 20 <= sum(at < 5000 for at in sent) <= 27, sent
    assert 2 <= sum(5300 < at < 8300 for at in sent) <= 4, sent
    page.wait_for("Stopped: Hold")
    done = len(stops_sent(page))
    time.sleep(2)
    assert len(stops_sent(page)) == done


@pytest.mark.long
def test_stop_cancels_what_is_pending_but_disarm(rover, page):
    search_low_volt(page)
    rover.network.mute()
    enter_in_list(page, 9.5)
    touch(page, "stop")
    time.sleep(3.5)
    assert page.run("return window.sent.filter(([, ...frame]) => frame[7] == arguments[0]).length", PARAM_SET) == 1
    rover.network.mend()
    page.enter("drive")
    page.wait_for("Stopped: Hold")
    drive(page)
    rover.network.mute()
    touch(page, "disarm")
    touch(page, "stop")
    time.sleep(3.5)
    rover.network.mend()
    assert sum((number, value) == (ARM, 0) for _, number, value, _ in commands_sent(page)) == 3


def stops_sent(page):
    """The times of commands for Hold."""
    return [at for at, command, _, mode in commands_sent(page) if (command, mode) == (SET_MODE, HOLD)]


def commands_sent(page):
    """Time in ms, number and two parameters of each command that has left."""
    return page.run(
        """
        return window.sent.filter(([, ...frame]) => frame[7] == arguments[0]).map(([at, ...frame]) => {
            const view = new DataView(Uint8Array.from([...frame.slice(10, 10 + frame[1]), ...Array(40).fill(0)]).buffer);
            return [at, view.getUint16(28, true), view.getFloat32(0, true), view.getFloat32(4, true)];
        })
        """,
        COMMAND_LONG,
    )


@pytest.mark.long
def test_manual_takes_stop_back(rover, page):
    drive(page)
    rover.network.down.delay_s = 0.5
    touch(page, "stop")
    touch(page, "manual")
    time.sleep(2)
    sent = len(stops_sent(page))
    time.sleep(2)
    assert rover.mode == "Manual" and len(stops_sent(page)) == sent and page.read("stop-state") == ""


@pytest.mark.long
def test_a_stop_without_the_key_is_refused_and_goes_with_the_key(rover, page):
    rover.station.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
    wait_for_text(rover.station, "Signing key set")
    sign_with(rover.station, KEY)
    rover.arm()
    set_mode(rover, MANUAL)
    page.wait_for("Without the key nothing is obeyed.")
    touch(page, "stop")
    page.wait_for("Not stopped: Without the key nothing is obeyed.")
    sent = len(stops_sent(page))
    time.sleep(3)
    assert len(stops_sent(page)) == sent and "Not stopped: Without the key nothing is obeyed." in page.text()
    assert rover.mode == "Manual" and "stops by itself" not in page.text()
    page.enter("about")
    page.element("#passphrase").send_keys("a good passphrase\n")
    page.wait_for("Stopped: Hold")
    assert rover.mode == "Hold"


@pytest.mark.long
def test_a_stop_is_not_sent_a_minute_after_the_connection_was_lost(rover, page):
    drive_on(rover)
    drive(page)
    rover.network.lose()
    touch(page, "stop")
    page.wait_for("No answer: it may drive on.", 8)
    page.wait_for("Stop is not confirmed: touch again.", 70)
    sent = len(stops_sent(page))
    rover.network.mend()
    page.wait_for("Live", 15)
    time.sleep(3)
    assert len(stops_sent(page)) == sent and rover.mode == "Manual"
    assert "Stop is not confirmed" in page.text()
    touch(page, "stop")
    page.wait_for("Stopped: Hold")
    assert rover.mode == "Hold"


@pytest.mark.long
def test_without_the_key_the_page_drives_where_everything_is_allowed(rover, page):
    set_to(rover.station, "SIGN_WIFI_ALLOW", 2)
    rover.station.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
    wait_for_text(rover.station, "Signing key set")
    page.driver.refresh()
    page.wait_for("Live: rover 1, rover-0001")
    page.wait_until_gone("Without the key")
    drive(page)
    page.push_stick()
    rover.seconds_until(rover.turns, 3)


@pytest.mark.long
def test_a_stop_long_after_the_connection_was_lost_is_sent_with_the_next(rover, page):
    drive_on(rover)
    drive(page)
    rover.network.lose()
    time.sleep(65)
    touch(page, "stop")
    time.sleep(1)
    rover.network.mend()
    page.wait_for("Stopped: Hold", 15)
    assert rover.mode == "Hold"


# 7. What the page says is true.


@pytest.mark.long
def test_only_a_page_that_drives_says_that_the_rover_stops_by_itself(rover, page):
    rover.arm()
    set_mode(rover, MANUAL)
    page.wait_for("Move the stick to drive.")
    rover.network.cut()
    page.wait_for("The rover is not heard.")
    assert "stops by itself" not in page.text()


@pytest.mark.long
def test_a_refused_arm_stays_on_the_page(rover, page):
    set_to(rover.station, "BATT_ARM_VOLT", 13)
    page.hold_to_arm()
    page.wait_for("Not armed: Battery 1")
    refusal = page.read("drive-answer")
    set_to(rover.station, "SIM_BATT_VOLTAGE", 9)
    # The rover says something else.
    page.wait(lambda: "Arm:" not in page.run("return document.querySelector('#messages li').textContent"), 20)
    assert page.read("drive-answer") == refusal


def test_saved_is_what_was_stored(rover, page):
    page.enter("setup")
    page.wait_for("The rover counts 3 cells")
    field = page.element("[name=BATT_CAPACITY]")
    field.clear()
    field.send_keys("1800.7\t")
    page.wait_for("Saved: 1800")
    assert field.get_attribute("value") == "1800" and parameter(rover, "BATT_CAPACITY") == 1800


# 8. Arm and Manual are sent once.


@pytest.mark.long
def test_arm_and_manual_are_sent_once_and_late_answers_are_shown(rover, page):
    rover.network.mute()
    page.hold_to_arm()
    page.wait_for("Not armed: no answer", 4)
    rover.network.mend()
    page.wait(lambda: page.read("armed") == "Armed")
    page.wait_until_gone("Not armed")
    page.wait(lambda: not page.run("return document.getElementById('manual').disabled"))
    rover.network.mute()
    touch(page, "manual")
    page.wait_for("Not in Manual: no answer", 4)
    rover.network.mend()
    page.wait_until_gone("Not in Manual")
    changes = [(number, value, mode) for _, number, value, mode in commands_sent(page) if number in (ARM, SET_MODE)]
    assert changes == [(ARM, 1, 0), (SET_MODE, 1, MANUAL)]


def test_arming_through_a_delay_is_no_radio_failsafe(rover, page):
    # A heartbeat that says disarmed is always on its way.
    rover.network.down.delay_s = 1.1
    time.sleep(2)
    page.hold_to_arm()
    page.wait(lambda: page.read("armed") == "Armed")
    time.sleep(4)
    rover.network.down.delay_s = 0
    assert "Failsafe" not in page.text() and rover.is_armed


LETTING_GO_OF_ARM = {
    "hidden": "Object.defineProperty(document, 'hidden', { get: () => true }); document.dispatchEvent(new Event('visibilitychange'))",
    "blurred": "document.hasFocus = () => false; dispatchEvent(new Event('blur'))",
    "stopped": "document.getElementById('stop').click()",
    "another room": "location.hash = '#battery'",
}


@pytest.mark.parametrize("how", [pytest.param(how, marks=[] if how == "hidden" else pytest.mark.long) for how in LETTING_GO_OF_ARM])
def test_arm_is_let_go(rover, page, how):
    x, y, _ = page.middle("#arm")
    page.touch("touchStart", (x, y))
    time.sleep(0.5)
    page.run(LETTING_GO_OF_ARM[how])
    time.sleep(1.5)
    page.touch("touchEnd")
    assert not rover.is_armed and ARM not in [number for _, number, value, _ in commands_sent(page) if value == 1]


@pytest.mark.parametrize("onto", ["#stop", "#hint", "#manual"])
def test_a_finger_that_slides_off_arm_lets_go_of_it(rover, page, onto):
    x, y, _ = page.middle("#arm")
    page.touch("touchStart", (x, y))
    time.sleep(0.3)
    page.touch("touchMove", page.middle(onto)[:2])
    time.sleep(1.5)
    page.touch("touchEnd")
    assert not rover.is_armed and not arms_sent(page)


def arms_sent(page):
    return [number for _, number, value, _ in commands_sent(page) if number == ARM and value == 1]


# 9. Lost releases let go.


LOST_RELEASES = {
    "modifier": lambda page: page.devtools("Input.dispatchKeyEvent", type="keyDown", code="MetaLeft", key="Meta", modifiers=4),
    "menu": lambda page: page.run("document.body.dispatchEvent(new MouseEvent('contextmenu', { bubbles: true, cancelable: true }))"),
    "menu bar": lambda page: page.run("document.dispatchEvent(new MouseEvent('mouseleave'))"),
    "blur": lambda page: page.run("dispatchEvent(new Event('blur'))"),
}


@pytest.mark.parametrize("how", [pytest.param(how, marks=[] if how == "modifier" else pytest.mark.long) for how in LOST_RELEASES])
def test_a_key_whose_release_is_lost_lets_go(rover, page, how):
    page.resize(DESKTOP)
    drive_by_mouse(page)
    page.key("keyDown", "KeyW", "w")
    rover.seconds_until(rover.turns, 3)
    LOST_RELEASES[how](page)
    rover.seconds_until(lambda: not rover.turns(), 1)
    assert [throttle for _, throttle in page.sticks_sent()][-1] == 0
    assert rests(rover)


def drive_by_mouse(page):
    x, y, _ = page.middle("#arm")
    page.mouse("mousePressed", x, y)
    time.sleep(1.3)
    page.mouse("mouseReleased", x, y)
    page.wait_for("Armed")
    page.press("Manual")
    page.wait_for("Move the stick to drive")


def move_pads(page, *pads):
    """Game pads by their index: x and y of each, or None without it."""
    page.run(
        "const pads = arguments[0].map((pad, index) => pad && { connected: true, index, axes: pad, buttons: [] });"
        "navigator.getGamepads = () => pads",
        [list(pad) if pad else None for pad in pads],
    )


def test_a_second_game_pad_does_not_take_over_deflected(rover, page):
    page.resize(DESKTOP)
    drive_by_mouse(page)
    move_pads(page, (0, 0))
    time.sleep(0.2)
    move_pads(page, (0, -1))
    page.wait_for("Throttle 60 %")
    # Another one is switched on, with a stick that is held back or was neutral before.
    for other in ((0, 1), (0, 0), (0, 1)):
        move_pads(page, (0, -1), other)
        time.sleep(0.3)
        assert "Throttle 60 %" in page.text()
    # The first one's battery is empty.
    move_pads(page, None, (0, 1))
    rover.seconds_until(lambda: not rover.turns(), 1)
    assert rests(rover)
    move_pads(page, None, (0, 0))
    time.sleep(0.2)
    move_pads(page, None, (0, 1))
    page.wait_for("Throttle −60 %")


@pytest.mark.long
def test_a_game_pad_drives_in_the_room_of_the_driver_only(rover, page):
    page.resize(DESKTOP)
    drive_by_mouse(page)
    page.enter("battery")
    move_pads(page, (0, 0))
    time.sleep(0.2)
    move_pads(page, (0, -1))
    assert rests(rover)
    page.enter("drive")
    assert rests(rover)
    move_pads(page, (0, 0))
    time.sleep(0.2)
    move_pads(page, (0, -1))
    rover.seconds_until(rover.turns, 3)


# 10. Which rover it is.


def calibrate(page):
    page.enter("setup")
    page.wait_for("The rover counts 3 cells")
    page.element("#voltage input").send_keys("12.00")
    page.press("Calibrate")
    page.wait_for("Undo: back to 3.95")


def test_another_rover_at_the_same_address_is_a_new_start(start_rover, rover, page):
    other = start_rover()
    other.measure_current()
    calibrate(page)
    assert "Live: rover 1, rover-0001" in page.text()
    page.run("window.isOld = 1")

    rover.network.down.change = with_board_id(0xE661_0A2C_0000_BEEF)
    rover.network.lead_to(other.web_port)
    page.wait(lambda: not page.run("return window.isOld"), 20)
    page.wait_for("rover-BEEF", 10)
    page.enter("setup")
    page.wait_for("The rover counts 3 cells")
    assert "Undo: back to" not in page.text() and parameter(other, "BATT_VOLT_MULT") == pytest.approx(3.95)


def test_until_it_is_known_which_rover_it_is_only_stop_and_disarm_act(rover, page):
    calibrate(page)
    page.enter("drive")
    drive_on(rover)
    drive(page)
    rover.network.down.change = with_board_id(None)
    page.run("window.sockets.forEach((socket) => socket.close())")
    page.wait_for("Asking which rover it is.")
    assert "Live: rover 1\n" in page.text() and rover.mode == "Manual"
    page.push_stick()
    assert rests(rover)
    page.release_stick()
    page.enter("setup")
    assert page.run("return [...document.querySelectorAll('#arm, #manual, #voltage button')].every((button) => button.disabled)")
    page.enter("drive")
    touch(page, "stop")
    page.wait_for("Stopped: Hold")
    assert rover.mode == "Hold"
    touch(page, "disarm")
    page.wait(lambda: page.read("armed") == "Disarmed")
    rover.network.down.change = lambda data: data
    page.wait_for("Live: rover 1, rover-0001")
    page.wait(lambda: not page.run("return document.getElementById('arm').disabled"))


@pytest.mark.long
def test_a_rover_without_an_id_is_the_same(rover, page):
    page.run("window.isOld = 1")
    rover.network.down.change = with_board_id(0)
    page.run("window.sockets.forEach((socket) => socket.close())")
    page.wait_until_gone("rover-0001")
    page.wait(lambda: not page.run("return document.getElementById('arm').disabled"))
    assert page.run("return window.isOld")


@pytest.mark.long
def test_a_key_is_forgotten_at_another_rover(start_rover, rover, page):
    # Both have the same passphrase.
    other = start_rover()
    for one in (rover, other):
        one.station.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
        wait_for_text(one.station, "Signing key set")
    page.enter("about")
    page.element("#passphrase").send_keys("a good passphrase\n")
    page.wait_for("Live: rover 1, rover-0001")
    page.wait_for("this page signs")
    rover.network.down.change = with_board_id(0xBEEF, KEY)
    rover.network.lead_to(other.web_port)
    page.wait_for("the rover signs, this page does not", 20)
    page.element("#passphrase").send_keys("a good passphrase\n")
    page.wait_for("Live: rover 1, rover-BEEF")
