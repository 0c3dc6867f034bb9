"""What the page says of a rover, by the messages that it hears: nothing that it does not know."""

import pathlib
import re
import time

import pytest
from pymavlink.dialects.v20 import all as dialect

from browser import DESKTOP, Stage

# Browsers wait for one another on a small machine.
pytestmark = pytest.mark.xdist_group("browser")

MANUAL, HOLD = 0, 4
OK, LOW, CRITICAL, UNHEALTHY = 1, 2, 3, 6


@pytest.fixture(scope="module")
def browser():
    page = Stage()
    yield page
    page.close()


@pytest.fixture
def stage(browser):
    yield browser.start
    assert browser.errors() == []


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
    page.release_stick()


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
    page.wait(lambda: page.read("texts").find("Battery 2: critical, 10.10 V, 6 %. Charge the pack.") in range(page.read("texts").find("Battery 1: low, 10.40 V")))


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
    page.wait_for("set the phone’s screen time-out long")
    page.wait_for("Move the stick to drive.")
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
        page.wait(lambda: "Not a clear number" in field_text(page))
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
    page.wait_for("Not a clear number")
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


# What an owner asks of the pack.


def test_how_long_it_still_drives(stage):
    page = stage({"BATT_MONITOR": 3})
    page.pack(amps=-0.01)
    page.wait_for("Time left: after two minutes of driving.")
    page.pack(left=1500)
    page.wait(lambda: "Time left\n25 min" in page.read("packs"))
    page.pack(left=1)
    page.wait(lambda: "Time left\nnone" in page.read("packs"))
    # One with a current sensor.
    page.parameters({"BATT_MONITOR": 4})
    page.pack()
    page.wait_for("Time left: after a minute of driving.")


def test_a_chip_says_why_it_is_low_at_19_percent(stage):
    page = stage({"BATT_MONITOR": 4})
    page.pack(charge_state=LOW, percent=19)
    page.value("BAT1_SIGMA", 3)
    page.value("BAT1_USABL", 9.4)
    page.wait(lambda: "Low: 9 % usable" in page.read("packs"))
    page.wait(lambda: "± 6 %, 9 % usable" in page.read("packs"))
    page.value("BAT1_USABL", float("nan"))
    page.wait(lambda: "usable" not in page.read("packs"))


def test_what_no_owner_has_set_is_assumed(stage):
    page = stage({"BATT_MONITOR": 4, "BATT_LOW_VOLT": 10.5, "BATT_FS_LOW_ACT": 2})
    page.pack()
    page.info()
    page.wait_for("assumed: 3 cells, LiPo, 3300 mAh")
    page.wait_for("Below 10.50 V for 10 s it stops in Hold.")
    page.parameters({"BATT_MONITOR": 4, "BATT_CELLS": 3, "BATT_CHEM": 3, "BATT_CAPACITY": 2200, "BATT_LOW_VOLT": 0})
    page.info(chemistry=3, design_ah=2.2, full_ah=2.05, health=93)
    page.wait_for("3 cells, Li-ion, 2200 mAh; learnt 2050 mAh")
    page.wait(lambda: "Health\n93 %" in page.read("packs"))
    assert "assumed" not in page.text()


def test_health_needs_a_current_sensor(stage):
    page = stage({"BATT_MONITOR": 3})
    page.pack(amps=-0.01)
    page.info()
    page.wait_for("Current, Power, Drawn, Health: no current sensor.")


def test_a_pack_without_a_voltage_is_not_measured_and_a_tank_has_litres(stage):
    page = stage({"BATT_MONITOR": 31, "BATT2_MONITOR": 11, "BATT2_CAPACITY": 5000})
    page.pack(1, volts=None, amps=4.2, percent=-1)
    page.pack(2, volts=None, amps=1.5, percent=60, drawn=2000)
    page.wait_for("Voltage, Power: not measured.")
    page.wait_for("1.5 l/h")
    page.wait_for("2000 ml")
    assert "No pack" not in page.read("packs") and "no pack is connected" not in page.text() and "Not connected" not in page.text()
    page.pack(1, volts=None, percent=-1)
    page.wait_for("no pack is connected")


def test_figures_are_rounded_before_their_sign(stage):
    page = stage({"BATT_MONITOR": 4})
    page.pack(amps=-0.04)
    page.wait_for("0.0 A")
    assert "−0.0" not in page.text()


@pytest.mark.parametrize("cause", ["no pin set", "no capacity set", "pin already in use", "port not set up", "over range"])
def test_what_is_set_up_wrongly_leads_to_set_up(stage, cause):
    page = stage({"BATT_MONITOR": 4})
    page.pack()
    page.ready(False)
    page.announce(f"PreArm: Battery 1 unhealthy: {cause}")
    page.wait_for(f"Does not arm: Battery 1 unhealthy: {cause}. Check pins, capacity and kind of sensor under Set up.")
    assert "plug" not in page.text()


def test_parameters_are_sorted_by_use(forms):
    page = forms
    page.parameters({"BATT_MONITOR": 3, "BATT3_MONITOR": 0, "FS_ACTION": 0, "AHRS_ORIENTATION": 0, "SYSID_THISMAV": 1, "FS_TIMEOUT": 1.5, "BATT_LRN_CAP": 0})
    page.wait(lambda: page.run("return document.querySelector('#form-pack select').value") == "3")
    kinds = page.run("return [...document.querySelector('#form-pack [name=BATT_MONITOR]').options].slice(0, 5).map((one) => one.value)")
    assert kinds == ["3", "4", "21", "9", "7"]
    described = page.run("return document.getElementById('form-thresholds').textContent")
    assert "executes FS_LOW_ACT" not in described and "executes “Action when low”" in described
    search = page.element("#search")
    names = "return [...document.querySelectorAll('#list code')].map((one) => one.innerText)"
    for words, expected in (("system id", "SYSID_THISMAV"), (" ", "BATT_MONITOR")):
        search.clear()
        search.send_keys(words)
        page.wait(lambda: page.run(names)[0] == expected)
    search.send_keys("monitor")
    page.wait(lambda: page.run(names)[-1] == "BATT3_MONITOR")
    # Its text is folded.
    last = page.run("return [...document.querySelectorAll('#list .field')].at(-1).innerText")
    assert "Kind of sensor" not in last and "Battery monitoring" in last
    search.clear()
    search.send_keys("for ground")
    page.wait(lambda: page.run(names) == ["FS_ACTION", "AHRS_ORIENTATION"])


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
    page.release_stick()


def test_the_rover_follows_only_a_hand_that_was_at_the_centre(stage):
    page = stage()
    page.enter("drive")
    page.pack()
    page.wait_for("To drive, arm and choose Manual.")
    page.push_stick()
    page.drive(True)
    page.wait_for("Let go of the stick first.")
    page.release_stick()
    page.wait_for("Move the stick to drive.")
    page.push_stick()
    page.wait_for("The rover follows the stick.")
    page.drive(True, HOLD)
    page.wait_for("In Hold it stands")
    page.drive(True)
    page.wait_for("Let go of the stick first.")
    page.release_stick()


# The layout: five sizes, at rest and with two packs at critical, the longest texts and a refusal.

SIZES = [(320, 568), (390, 780), (780, 360), (820, 1180), (1440, 900)]
WITHIN = """
const box = (css) => document.querySelector(css).getBoundingClientRect();
const [outer, inner] = [box(arguments[0]), box(arguments[1])];
return inner.top >= outer.top - 1 && inner.bottom <= outer.bottom + 1 && inner.height > arguments[2];
"""


def critical_twice(page):
    page.drive(True)
    for number in (1, 2):
        page.pack(number, CRITICAL, 10.1, amps=3.2, percent=6, drawn=900, left=60)
        page.info(number)
        page.announce(f"Battery {number} is critical 10.10V used 900 mAh", 2)
    page.announce("Arm: Battery 1 below minimum arming capacity")


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_layout(stage, size, pytestconfig):
    page = stage({"BATT_MONITOR": 4, "BATT_LOW_VOLT": 10.5, "BATT_CRT_VOLT": 10.2, "BATT_FS_LOW_ACT": 2, "BATT_FS_CRT_ACT": 2, "BATT2_MONITOR": 4, "BATT2_LOW_TIMER": 0}, size=size)
    pictures = pytestconfig.getoption("--pictures")
    page.pack(amps=3.2, drawn=900, left=1500)
    page.info()
    page.value("BAT1_SIGMA", 4)
    loud = lambda: page.run("return getComputedStyle(document.getElementById('stop')).backgroundColor") == "rgb(204, 34, 34)"
    for state in ("rest", "critical"):
        if state == "critical":
            critical_twice(page)
            page.wait_for("Battery 2 is critical")
        # Loud where something can move only.
        page.wait(lambda: loud() == (state == "critical"))
        for room in ("battery", "drive", "setup"):
            page.enter(room)
            time.sleep(0.4)
            if pictures:
                page.picture(pathlib.Path(pictures) / f"{size[0]}x{size[1]}-{state}-{room}.png")
            assert page.run("const main = document.querySelector('main'); return main.scrollWidth <= main.clientWidth"), (state, room)
            assert page.run(WITHIN, "body", "#stop", 43), (state, room)
        page.enter("drive")
        assert page.run(WITHIN, "main", "#pad", 99), state
        for failsafe in ("#texts .notices",) if state == "critical" else ("#when-low",):
            assert page.run(WITHIN, "#texts", failsafe, 10), (state, page.read("texts"))
        page.enter("battery")
        edges = page.run("return [...document.querySelectorAll('#packs > *')].map((one) => one.getBoundingClientRect()).map(({ top, bottom }) => [top, bottom])")
        in_a_row = [bottom for top, bottom in edges if top == edges[0][0]]
        assert max(in_a_row) - min(in_a_row) < 1
        # No hole beside the plot: it is as wide as the room, or something as high stands beside it.
        assert page.run(
            """
            const box = (one) => one.getBoundingClientRect();
            const plot = document.getElementById('history');
            const isBeside = (one) => one != plot && Math.abs(box(one).top - box(plot).top) < 1 && Math.abs(box(one).bottom - box(plot).bottom) < 1;
            return box(plot).width > 0.95 * box(document.getElementById('battery')).width || [...document.querySelectorAll('#battery .card')].some(isBeside);
            """
        ), state
    page.enter("setup")
    if size[0] < 500:
        assert page.run("return document.getElementById('list').parentNode.offsetTop - document.querySelector('main').offsetTop") <= 3 * max(size[1], 780)


def test_the_plot_has_numbers_at_its_axes_and_a_band_of_what_is_not_sure(stage):
    page = stage({"BATT_MONITOR": 4}, size=DESKTOP)
    for percent in (70, 69, 68):
        page.pack(percent=percent, volts=12)
        page.value("BAT1_SIGMA", 5)
        time.sleep(0.5)
    page.wait(lambda: page.read("range1").split("\n") == ["100 %", "75 %", "50 %", "25 %", "0 %"])
    assert page.read("range0").split("\n") == ["12.10 V", "12.05 V", "12.00 V", "11.95 V", "11.90 V"]
    assert page.read("axes").endswith("10 min\n8\n6\n4\n2\nnow")
    band = page.run("return document.querySelector('.band').getAttribute('d')")
    heights = [tuple(float(y) for y in re.findall(r" ([\d.]+)V([\d.]+)", line)[0]) for line in band.split("M")[1:]]
    assert heights[-1] == pytest.approx((42, 22))
