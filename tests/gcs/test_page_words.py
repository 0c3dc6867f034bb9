"""What the page says of a rover, by the messages that it hears: nothing that it does not know."""

import hashlib
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
    # Its end was lost with a connection: to a new one the rover says whether it still limits.
    page.announce("Battery 1 limits the motors: over 20W")
    page.wait_for("It drives slower")
    for is_said in (True, False):
        page.run("window.hang_up()")
        time.sleep(1.5)
        if is_said:
            page.announce("Battery 1 limits the motors: over 20W")
        time.sleep(5)
        assert ("It drives slower" in page.text()) == is_said


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
    page.wait_for("Move the stick to drive.")
    # The first touch permits sound.
    touch(page, "#manual")
    time.sleep(0.3)
    assert alarms() == []
    for state in (LOW, CRITICAL):
        page.pack(charge_state=state)
        time.sleep(1.2)
        assert alarms() == ["vibrate", "beep"], state
    touch(page, "#stop")
    page.wait_for("No answer: it may drive on. Switch it off.")
    assert alarms() == ["vibrate", "beep"]


def test_the_drivers_room_hints_at_the_screens_time_out_once(stage):
    page = stage()
    page.enter("drive")
    page.wait_for("A dark screen stops the rover: set the phone’s screen time-out long.")
    page.enter("battery")
    page.enter("drive")
    page.wait_for("screen time-out")
    # Once it was read: a driver goes on to arm.
    page.hold_to_arm()
    page.drive(True)
    page.wait_until_gone("screen time-out")
    page.drive(False)
    page.enter("battery")
    page.enter("drive")
    page.wait_for("To drive, arm and choose Manual.")
    assert "screen time-out" not in page.text()
    page.resize(DESKTOP)
    assert not page.element("#screen").is_displayed()


# Logs.

PASSPHRASE = "a good passphrase"
FILE_TRANSFER_PROTOCOL, LOG_REQUEST_LIST, LOG_REQUEST_DATA = 110, 117, 119
LOG_BYTES = 200


def requests(page, message):
    """Payloads of this message that have left."""
    frames = page.run("return window.sent.filter(([, ...frame]) => frame[7] == arguments[0])", message)
    return [bytes(frame[11 : 11 + frame[2]]).ljust(255, b"\0") for frame in frames]


@pytest.fixture
def signed_logs(stage, tmp_path):
    """A rover with a key and two logs of 200 bytes, 7 and 9, to be downloaded by the page."""
    page = stage()
    page.devtools("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    page.sender.signing.secret_key, page.sender.signing.sign_outgoing = hashlib.sha256(PASSPHRASE.encode()).digest(), True
    page.drive(False)
    page.enter("about")
    page.element("#passphrase").send_keys(PASSPHRASE + "\n")
    page.wait_for("this page signs")
    page.enter("logs")
    for asked, (opcode, entries) in enumerate(((128, b"F00000007.BIN\t200\0F00000009.BIN\t200\0"), (129, b"\x06"))):
        page.wait(lambda: len(requests(page, FILE_TRANSFER_PROTOCOL)) > asked)
        sequence = requests(page, FILE_TRANSFER_PROTOCOL)[asked][3] + 1
        page.hear(dialect.MAVLink_file_transfer_protocol_message(0, 0, 0, [sequence, 0, 0, opcode, len(entries), *[0] * 7, *entries.ljust(239, b"\0")]))
    page.wait(lambda: requests(page, LOG_REQUEST_LIST))
    page.hear(*(dialect.MAVLink_log_entry_message(place, 2, 2, 1_795_694_400, LOG_BYTES) for place in (1, 2)))
    page.wait_for("Log 9, ")
    page.files = lambda: list(tmp_path.glob("*.BIN"))
    return page


def data_of(place, offset, count):
    return dialect.MAVLink_log_data_message(place, offset, count, [byte % 256 for byte in range(offset, offset + 90)])


def test_a_download_has_the_bytes_that_count(signed_logs):
    page = signed_logs
    page.press("Download")
    page.wait(lambda: requests(page, LOG_REQUEST_DATA))
    # The newest is the first row; those of another log are not of this one.
    page.hear(data_of(2, 0, 90), data_of(1, 90, 90), data_of(2, 90, 30), data_of(2, 120, 80))
    (file,) = page.wait(page.files)
    assert file.read_bytes() == bytes(range(LOG_BYTES)) and file.name.endswith("-2026-11-26-00000009.BIN")


@pytest.mark.parametrize("sent", [[], [(0, 90), (90, 90)]])
def test_a_log_that_is_gone_is_no_file_of_zeros(signed_logs, sent):
    page = signed_logs
    page.press("Download")
    page.wait(lambda: requests(page, LOG_REQUEST_DATA))
    page.hear(*(data_of(2, *one) for one in sent), data_of(2, 90 * len(sent), 0))
    page.wait_for("Broken off")
    assert page.files() == [] and len(requests(page, LOG_REQUEST_DATA)) == 1


def test_a_refused_erase_is_said(stage):
    page = stage()
    page.run("window.files['/logs/'] = [{ number: 1, bytes: 200, name: 'rover.BIN' }]")
    page.enter("logs")
    for text in ("Log download in use by another station", None):
        page.press("Erase all logs")
        page.press("Press again to erase all for good")
        page.wait_for("Erasing…")
        if text:
            page.announce(text)
        page.wait(lambda: page.read("logs-state") == (text or "Not erased"))
    page.run("window.files['/logs/'] = []")
    page.press("Erase all logs")
    page.press("Press again to erase all for good")
    page.wait_for("No logs: recorded from arming on.")


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


# The layout: five sizes, at rest, driven with two packs at critical, and refused with them; each with the longest texts.
# `--pictures` draws what is in tests/gcs/pictures, where `pngquant --nofs 16` has made it smaller.

SIZES = [(320, 568), (390, 780), (780, 360), (820, 1180), (1440, 900)]
WITHIN = """
const box = (css) => document.querySelector(css).getBoundingClientRect();
const [outer, inner] = [box(arguments[0]), box(arguments[1])];
return inner.top >= outer.top - 1 && inner.bottom <= outer.bottom + 1 && inner.height > arguments[2];
"""
LOUD = "rgb(204, 34, 34)"
LEVELS = {
    **{f"BATT_{level}": value for level, value in (("MONITOR", 4), ("FS_PCT_EN", 1), ("LOW_VOLT", 43.2), ("CRT_VOLT", 40.8), ("LOW_MAH", 3300))},
    **{f"BATT_{level}": value for level, value in (("CRT_MAH", 1100), ("LOW_PCT", 15), ("CRT_PCT", 10), ("FS_LOW_ACT", 2), ("FS_CRT_ACT", 2))},
    **{"BATT2_MONITOR": 4, "BATT2_LOW_TIMER": 0, "BATT2_CAPACITY": 12000},
}


def drive_for_ten_minutes(page):
    """What the plot shows: the charge falls, and is less and less sure; the voltage sags under each load."""
    page.run("window.ahead = 0; const now = performance.now.bind(performance); performance.now = () => now() + window.ahead")
    for step in range(150):
        page.run("window.ahead += 4000")
        amps = 18 if step % 12 > 6 else 2
        page.drive(False)
        page.value("BAT1_SIGMA", 1 + step / 40)
        page.value("BAT1_USABL", 93 - step // 3)
        page.pack(volts=49.6 - step / 45 - amps / 14, amps=amps, percent=97 - step // 3, drawn=40 * step, left=1500)
    # A slow answer to a ping is forgotten.
    time.sleep(1.5)


def critical_twice(page):
    page.value("BAT1_USABL", 2)
    for number in (1, 2):
        page.pack(number, CRITICAL, 40.1, amps=18.2, percent=6, drawn=11900, left=60)
        page.info(number, cells=12, design_ah=12)
        page.announce(f"Battery {number} is critical 40.10V used 11900 mAh", 2)


def drive_at_critical(page):
    page.drive(True)
    critical_twice(page)
    page.announce("Arm: Battery 1 below minimum arming capacity")
    page.wait_for("Battery 2 is critical 40.10V used 11900 mAh. Nothing stops the rover: drive home, and charge the pack.")


def refuse_to_arm(page):
    page.drive(False)
    page.ready(False)
    for number in (1, 2):
        page.state(f"obstacle {number}", dialect.MAVLink_statustext_message(4, f"PreArm: Battery {number} below minimum arming capacity".encode(), 0, 0))
    page.announce("Arm: Battery 1 below minimum arming capacity")
    page.wait_for("Does not arm: Battery 2 below minimum arming capacity.")


# How the page gets there, the line of a failsafe, whether the answer to the driver is seen, too, and whether something can move.
STATES = {
    "rest": (lambda page: page.drive(False), "#when-low", "#hint", False),
    "critical": (drive_at_critical, "#texts .notices", "#hint", True),
    "refused": (refuse_to_arm, "#when-low", "#texts li", False),
}


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_layout(stage, size, pytestconfig):
    page = stage(LEVELS, size=size)
    pictures = pytestconfig.getoption("--pictures")
    page.pack(volts=49.6)
    page.info(cells=12, design_ah=12)
    drive_for_ten_minutes(page)
    for state, (begin, failsafe, answer, can_move) in STATES.items():
        begin(page)
        # Loud where something can move only.
        page.wait(lambda: (page.run("return getComputedStyle(document.getElementById('stop')).backgroundColor") == LOUD) == can_move)
        for room in ("battery", "drive", "setup"):
            page.enter(room)
            time.sleep(0.4)
            if state == "refused":
                # It is asked for why every few seconds.
                page.wait(lambda: page.run("return document.querySelectorAll('#texts li').length") == 2)
            if pictures and (state, room) not in (("refused", "battery"), ("refused", "setup")):
                page.picture(pathlib.Path(pictures) / f"{size[0]}x{size[1]}-{state}-{room}.png", 1)
            assert page.run("const main = document.querySelector('main'); return main.scrollWidth <= main.clientWidth"), (state, room)
            assert page.run(WITHIN, "body", "#stop", 43), (state, room)
        # Three screens, also of what is between strip and Stop where a phone is as high as most.
        if size != (1440, 900) and size != (820, 1180):
            place, height = page.run("const main = document.querySelector('main'); return [document.getElementById('list').parentNode.offsetTop - main.offsetTop, main.clientHeight]")
            assert place <= 3 * (height if size == (390, 780) else size[1]), state
        page.enter("drive")
        assert page.run(WITHIN, "main", "#pad", 99), state
        for seen in (failsafe, answer):
            assert page.run(WITHIN, "#texts", seen, 10), (state, seen, page.read("texts"))
        page.enter("battery")
        assert_edges_are_in_line(page)
        page.run("document.getElementById('history').scrollIntoView()")
        if pictures and state == "critical":
            page.picture(pathlib.Path(pictures) / f"{size[0]}x{size[1]}-plot.png", 1)


def assert_edges_are_in_line(page):
    """Cards stand in one column or two; those beside one another begin and end together, also beside the plot."""
    cards = page.run("return [...document.querySelectorAll('#battery .card, #battery .notices li')].map((one) => one.getBoundingClientRect().toJSON())")
    cards = [{edge: round(at) for edge, at in card.items()} for card in cards if card["height"] and card["width"] > 200]
    lefts, rights = ({card[edge] for card in cards} for edge in ("left", "right"))
    assert len(lefts) <= 2 and len(rights) <= 2, (lefts, rights)
    for card in cards:
        beside = [other for other in cards if other["left"] != card["left"] and other["top"] < card["bottom"] and card["top"] < other["bottom"]]
        assert all((other["top"], other["bottom"]) == (card["top"], card["bottom"]) for other in beside), cards
        # No hole: a row is as wide as the room.
        assert {card["left"], *(other["left"] for other in beside)} >= {min(lefts)}, cards
        assert {card["right"], *(other["right"] for other in beside)} >= {max(rights)}, cards


def test_the_plot_has_numbers_at_its_axes_and_a_band_of_what_is_not_sure(stage):
    page = stage({"BATT_MONITOR": 4}, size=DESKTOP)
    for percent in (70, 69, 68):
        page.pack(percent=percent, volts=12)
        page.value("BAT1_SIGMA", 5)
        time.sleep(0.5)
    page.wait(lambda: page.read("range1").split("\n") == ["100 %", "75 %", "50 %", "25 %", "0 %"])
    assert page.read("range0").split("\n") == ["12.10 V", "12.05 V", "12.00 V", "11.95 V", "11.90 V"]
    assert page.read("axes").endswith("10 min\n8\n6\n4\n2\nnow")

    def is_drawn():
        """68 % with ten to each side, as the height is that of 100 %."""
        band = page.run("return document.querySelector('.band').getAttribute('d')")
        return [float(y) for y in re.findall(r" ([\d.]+)V([\d.]+)", band)[-1]] == pytest.approx((42, 22))

    page.wait(is_drawn)
