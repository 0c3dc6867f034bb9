"""What the page says of a rover, by the messages that it hears: nothing that it does not know."""

import time

import pytest
from pymavlink.dialects.v20 import all as dialect

from browser import DESKTOP, Stage

# Browsers wait for one another on a small machine.
pytestmark = pytest.mark.xdist_group("browser")

MANUAL, HOLD = 0, 4
OK, LOW, CRITICAL, UNHEALTHY = 1, 2, 3, 6


@pytest.fixture
def stage():
    opened = []

    def start(*arguments, **how):
        opened.append(Stage(*arguments, **how))
        return opened[-1]

    yield start
    for page in opened:
        assert [error for error in page.errors() if "file:" not in error] == []
        page.close()


def touch(page, css):
    x, y, _ = page.middle(css)
    page.touch("touchStart", (x, y))
    page.touch("touchEnd")


# What is not known is not "none".


def test_unknown_parameters_are_no_missing_failsafe(stage):
    page = stage()
    page.enter("drive")
    page.pack(charge_state=LOW, volts=10.4)
    page.drive(True, HOLD)
    page.announce("Battery 1 is low 10.40V used 900 mAh")
    page.wait_for("Battery 1 is low 10.40V used 900 mAh. Charge the pack.")
    assert page.read("when-low") == ""
    page.parameters({"BATT_FS_LOW_ACT": 2, "BATT_LOW_VOLT": 10.5})
    page.wait_for("Battery 1 is low 10.40V used 900 mAh. The rover stops to spare the pack: charge it.")


def test_a_failsafe_by_percent_stops_the_rover(stage):
    page = stage({"BATT_FS_PCT_EN": 1, "BATT_FS_LOW_ACT": 2, "BATT_FS_CRT_ACT": 2, "BATT_LOW_PCT": 15, "BATT_CRT_PCT": 3, "BATT_EMR_PCT": 5, "BATT_LOW_VOLT": 0})
    page.enter("drive")
    page.pack()
    page.wait_for("Below 15 % it stops in Hold. Below 5 % it stops in Hold.")
    page.parameters({"BATT_FS_PCT_EN": 0, "BATT_LOW_VOLT": 0})
    page.wait_for("A low pack does not stop the rover.")


def test_a_longer_list_of_parameters_does_not_take_the_stick(stage):
    page = stage()
    page.sender.signing.secret_key, page.sender.signing.sign_outgoing = bytes(32), True
    page.parameters({"SIGN_WIFI_ALLOW": 2, "BATT_LOW_VOLT": 0})
    page.enter("drive")
    page.pack()
    page.drive(True)
    page.wait_for("Move the stick to drive.")
    page.push_stick()
    page.wait_for("The rover follows the stick.")
    page.run("window.hints = new Set(); setInterval(() => hints.add(document.getElementById('hint').innerText), 20)")
    # Another pack is set up.
    page.hear(dialect.MAVLink_param_value_message(b"BATT2_MONITOR", 4, 9, 250, 249))
    time.sleep(1)
    assert page.run("return [...hints]") == ["The rover follows the stick."]
    assert page.read("when-low").startswith("A low pack does not stop the rover.")


# Each pack has its own notice.


def test_each_pack_has_its_own_notice(stage):
    page = stage({"BATT_LOW_VOLT": 0})
    page.pack(1, LOW)
    page.pack(2)
    page.drive(True)
    page.announce("Battery 1 is low 10.40V used 900 mAh")
    page.announce("Battery 2 unhealthy: no reading in time")
    page.pack(2, UNHEALTHY)
    page.wait_for("Battery 2 unhealthy: no reading in time. Check the plug")
    page.wait_for("Battery 1 is low 10.40V used 900 mAh. Nothing stops the rover: drive home, and charge the pack.")
    page.announce("Battery 2 healthy again")
    page.pack(2)
    page.wait_until_gone("Check the plug")
    assert "Nothing stops the rover" in page.text()
    # The reset of a battery has no text.
    page.pack(1)
    page.wait_until_gone("Nothing stops the rover")


def test_a_page_that_is_opened_after_a_failsafe_shows_the_worst_level_with_its_cause(stage):
    page = stage({"BATT_FS_CRT_ACT": 2, "BATT_CRT_VOLT": 10.2})
    page.enter("drive")
    page.pack(1, LOW, 10.4, percent=14)
    page.pack(2, CRITICAL, 10.1, percent=6)
    page.drive(True, HOLD)
    page.wait(lambda: page.read("texts").find("Battery 2 is critical: 10.10 V, 6 %. Charge the pack.") in range(page.read("texts").find("Battery 1 is low: 10.40 V")))


def test_a_power_limit_is_shown_as_long_as_the_rover_limits(stage):
    page = stage()
    page.pack()
    page.drive(True)
    page.announce("Battery 1 limits the motors: over 20W")
    page.wait_for("Battery 1 limits the motors: over 20W. It drives slower")
    page.run("const now = performance.now.bind(performance); performance.now = () => now() + 60000")
    page.pack()
    time.sleep(1)
    assert "It drives slower" in page.text()
    page.announce("Battery 1 no longer limits the motors")
    page.wait_until_gone("It drives slower")


ALARMS = """
window.alarms = [];
navigator.vibrate = (pattern) => window.alarms.push('vibrate');
const { start } = OscillatorNode.prototype;
OscillatorNode.prototype.start = function () { window.alarms.push('beep'); return start.call(this); };
"""


def test_the_phone_vibrates_and_beeps_at_low_and_critical_and_if_stop_is_not_confirmed(stage):
    page = stage({"BATT_LOW_VOLT": 0})
    page.run(ALARMS)
    alarms = lambda: page.run("return window.alarms.splice(0)")
    page.enter("drive")
    page.pack()
    page.drive(True)
    page.wait_for("lengthen the phone’s screen time-out")
    touch(page, "#manual")
    page.wait_until_gone("screen time-out")
    assert alarms() == []
    for state in (LOW, CRITICAL):
        page.pack(charge_state=state)
        time.sleep(1.2)
        assert alarms() == ["vibrate", "beep"], state
    touch(page, "#stop")
    page.wait_for("No answer: it may drive on. Switch it off.")
    assert alarms() == ["vibrate", "beep"]


# Forms show what is.


def value_of(name, value, count=65535, index=65535):
    return dialect.MAVLink_param_value_message(name.encode(), value, 9, count, index)


@pytest.fixture
def forms(stage):
    page = stage({"BATT_MONITOR": 4, "BATT_CAPACITY": 2200})
    page.pack()
    page.enter("setup")
    page.wait_for("Battery monitoring")
    page.count = page.run("return Number(document.getElementById('found').innerText.match(/of (\\d+)/)[1])")
    return page


def type_into(page, css, text):
    page.run("const input = document.querySelector(arguments[0]); input.focus(); input.value = arguments[1]; input.dispatchEvent(new Event('input')); input.onchange?.()", css, text)


CAPACITY = "#form-pack [name=BATT_CAPACITY]"


def field_text(page, css=CAPACITY):
    return page.run("return document.querySelector(arguments[0]).closest('.field').innerText", css)


def test_a_field_follows_another_station_but_not_over_what_is_typed(forms):
    page = forms
    page.hear(value_of("BATT_CAPACITY", 1300, page.count), value_of("BATT_CHEM", 3, page.count))
    assert page.run("return document.querySelector(arguments[0]).value", CAPACITY) == "1300"
    assert page.run("return document.querySelector('[name=BATT_CHEM]').selectedOptions[0].text") == "Li-ion"
    page.run("document.querySelector(arguments[0]).value = '15'", CAPACITY)
    page.hear(value_of("BATT_CAPACITY", 1400, page.count))
    assert page.run("return document.querySelector(arguments[0]).value", CAPACITY) == "15"


@pytest.mark.parametrize("typed, sent", [("2,200", None), ("12,345", None), ("2200,5", 2200.5), ("0,125", 0.125), ("−0,125", -0.125), ("1.234", 1.234), ("", None)])
def test_a_comma_before_three_digits_is_asked_for_again(forms, typed, sent):
    page = forms
    type_into(page, CAPACITY, typed)
    if sent is None:
        page.wait(lambda: ("Unclear" if typed else "Not a number") in field_text(page))
        assert not values_set(page)
    else:
        assert values_set(page) == [pytest.approx(sent)]


def values_set(page):
    return page.run(
        "return window.sent.filter(([, ...frame]) => frame[7] == 23).map(([, ...frame]) => new DataView(Uint8Array.from(frame).buffer).getFloat32(10, true))"
    )


def test_an_unclear_figure_of_the_multimeter_is_not_used(forms):
    page = forms
    type_into(page, "#voltage input", "12,345")
    page.wait_for("Unclear: leave the comma out, or write a point")
    assert page.run("return document.querySelector('#voltage button').disabled")


def test_saved_is_the_answer_to_what_was_sent(forms):
    page = forms
    type_into(page, CAPACITY, "2000")
    page.hear(value_of("BATT_CAPACITY", 1300, page.count))
    time.sleep(0.6)
    assert "Saved" not in field_text(page)
    page.hear(value_of("BATT_CAPACITY", 2000, page.count))
    page.wait(lambda: "Saved: 2000" in field_text(page))
    # Never glued to what stands before it.
    assert "\nSaved: 2000" in field_text(page)


def test_saved_names_the_choice(forms):
    page = forms
    type_into(page, "[name=BATT_CHEM]", "3")
    page.hear(value_of("BATT_CHEM", 3, page.count))
    page.wait_for("Saved: Li-ion")


# Browsers that block a site's data.


def test_a_browser_that_blocks_site_data_shows_the_rover(stage):
    blocked = "for (const name of ['localStorage', 'sessionStorage']) Object.defineProperty(window, name, { get() { throw new DOMException('denied', 'SecurityError'); } });"
    page = stage({"BATT_LOW_VOLT": 0}, script=blocked)
    page.pack()
    page.wait_for("rover-A2C")
    page.wait_for("80 %")


# Keys, fingers and sticks.


def test_keys_drive_after_a_pointer_has_moved_the_speed_limit(stage):
    page = stage(size=DESKTOP)
    page.enter("drive")
    page.pack()
    page.drive(True)
    page.wait_for("Move the stick to drive.")
    x, y, width = page.middle("#limit")
    for kind, at in (("mousePressed", x), ("mouseMoved", x + width / 4), ("mouseReleased", x + width / 4)):
        page.mouse(kind, at, y)
    limit = page.run("return document.getElementById('limit').value")
    page.key("keyDown", "ArrowUp", "ArrowUp")
    page.wait_for(f"Throttle {limit} %")
    page.key("keyUp", "ArrowUp", "ArrowUp")
    # Reached by Tab, the arrows are its own.
    page.run("document.getElementById('disarm').focus()")
    page.devtools("Input.dispatchKeyEvent", type="keyDown", code="Tab", key="Tab", windowsVirtualKeyCode=9)
    page.devtools("Input.dispatchKeyEvent", type="keyDown", code="ArrowLeft", key="ArrowLeft", windowsVirtualKeyCode=37)
    assert page.run("return [document.activeElement.id, document.getElementById('limit').value]") == ["limit", str(int(limit) - 1)]
    page.wait_for("Throttle 0 %, steering 0 %")


def test_stop_can_not_be_pinched_or_pulled_off_the_screen(stage):
    page = stage()
    page.enter("drive")
    page.devtools("Input.synthesizePinchGesture", x=200, y=300, scaleFactor=2, gestureSourceType="touch")
    assert page.run("return visualViewport.scale") == 1
    assert page.run("return getComputedStyle(document.documentElement).overscrollBehaviorY") == "contain"


def test_sticks_ignored_goes_when_they_are_not(stage):
    page = stage()
    page.enter("drive")
    page.pack()
    page.drive(True)
    page.wait_for("Move the stick to drive.")
    page.push_stick()
    page.announce("Sticks ignored: another station drives")
    page.wait(lambda: "Sticks ignored: another station drives" in page.read("drive"))
    page.wait(lambda: "Sticks ignored" not in page.read("drive"), 8)


def test_the_rover_follows_only_a_hand_that_was_at_the_centre(stage):
    page = stage()
    page.enter("drive")
    page.pack()
    page.push_stick()
    page.drive(True)
    page.wait_for("Let go of the stick first.")
    page.release_stick()
    page.push_stick()
    page.wait_for("The rover follows the stick.")
    page.drive(True, HOLD)
    page.wait_for("In Hold it stands")
    page.drive(True)
    page.wait_for("Let go of the stick first.")
