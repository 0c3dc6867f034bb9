"""The page in the browser, in Chromium: each room by what a person reads and touches.

`.ci/web` runs what is marked `long`, too: pictures, and every way of letting go of the stick.
"""

import hashlib
import os
import pathlib
import re
import struct
import time

import pytest
from pymavlink import mavutil
from pymavlink.dialects.v20 import all as dialect

from browser import DESKTOP, FIREFOX, LANDSCAPE, PHONE, REPOSITORY, SMALL_PHONE, Firefox, Network, Page
from conftest import PageBoard, free_port
from station import Background, command, connect, receive, restarted, set_to
from test_signing import KEY, sign_with, ticks_now, wait_for_text

mavlink = mavutil.mavlink

# Browsers wait for one another on a small machine.
pytestmark = pytest.mark.xdist_group("browser")

ROOMS = ["battery", "drive", "setup", "logs", "about"]
WEB = REPOSITORY / "web"

# What the pack gives with the motors at rest, at most, in A: the board's own load, and the noise of the sensor.
AT_REST_A = 0.6

# Noon in UTC of 26 November 2026: the same day wherever this runs, but for some islands.
LOG_TIME_S = 1_795_694_400


class Rover:
    """A simulator that serves the page, and a ground station at its cable. Its current shows what the motors do."""

    def __init__(self, start_simulator, *arguments):
        self.web_port = free_port()
        self.simulator = start_simulator("--web", f"127.0.0.1:{self.web_port}", "--udp", f"127.0.0.1:{free_port()}", *arguments)
        self.network = Network(self.web_port)
        self.station = connect(self.simulator.url)
        self.pages = []

    @property
    def url(self):
        return f"http://127.0.0.1:{self.web_port}/"

    def measure_current(self):
        for name, value in (("BATT_MONITOR", 4), ("BATT_CURR_PIN", 27), ("BATT_CELLS", 3), ("BATT_CAPACITY", 2200), ("SR0_EXTRA1", 20), ("MOT_SLEWRATE", 0)):
            set_to(self.station, name, value)
        self.station = restarted(self.station, self.simulator.url)

    def arm(self):
        # Until the pack is measured, it does not arm.
        while command(self.station, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) != mavlink.MAV_RESULT_ACCEPTED:
            time.sleep(0.5)

    def disarm(self):
        assert command(self.station, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == mavlink.MAV_RESULT_ACCEPTED

    def record_a_drive(self):
        """Returns how its file is named: by the simulator's board id and the day."""
        self.station.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        self.station.mav.system_time_send(LOG_TIME_S * 1_000_000, 0)
        # A drive that begins with the first heartbeat may have no log.
        time.sleep(0.5)
        self.arm()
        time.sleep(2)
        self.disarm()
        return "rover-53494D0000000001-2026-11-26-00000001.BIN"

    def open(self, **how):
        """The page, once it shows the pack."""
        page = Page(how.pop("url", self.url), **how)
        self.pages.append(page)
        page.wait(lambda: "Live" in page.text() and re.search(r"\d V", page.text()))
        return page

    def current_a(self):
        """Of the latest BATTERY_STATUS."""
        while self.station.recv_match(blocking=False):
            pass
        return receive(self.station, ["BATTERY_STATUS"]).current_battery / 100

    def turns(self):
        return self.current_a() > AT_REST_A

    def seconds_until(self, condition, limit):
        start = time.monotonic()
        while not condition():
            assert time.monotonic() - start < limit, f"not within {limit} s"
        return time.monotonic() - start

    def heartbeat(self):
        while self.station.recv_match(blocking=False):
            pass
        return receive(self.station, ["HEARTBEAT"])

    @property
    def is_armed(self):
        return bool(self.heartbeat().base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def mode(self):
        return {0: "Manual", 4: "Hold"}[self.heartbeat().custom_mode]

    def close(self):
        for page in self.pages:
            page.close()
        self.network.close()


@pytest.fixture
def start_rover(start_simulator):
    started = []

    def start(*arguments):
        started.append(Rover(start_simulator, *arguments))
        return started[-1]

    yield start
    for rover in started:
        rover.close()


@pytest.fixture
def rover(start_rover):
    return start_rover()


def drive(page):
    """Arms and chooses Manual, as the hint on the page says."""
    page.enter("drive")
    # Once it is known which rover it is.
    page.wait(lambda: page.run("return !document.getElementById('arm').disabled"))
    page.hold_to_arm()
    page.wait_for("Armed")
    page.press("Manual")
    page.wait_for("Move the stick to drive")


# The table and the codec, against pymavlink.


def rows_of_the_table():
    table = (WEB / "messages.js").read_text().split("= `")[1].split("`")[0].strip().splitlines()
    for row in table:
        name, message_id, extra, *fields = row.split()
        yield name, int(message_id), int(extra), [re.fullmatch(r"(\w+):(\w)(\d+)x?(\d*)", one).groups() for one in fields]


def test_the_table_of_messages_is_pymavlinks():
    for name, message_id, extra, fields in rows_of_the_table():
        if message_id not in dialect.mavlink_map:
            # pymavlink 2.4.50 does not know it.
            assert name == "BATTERY_INFO"
            continue
        theirs = dialect.mavlink_map[message_id]
        assert (theirs.msgname, theirs.crc_extra) == (name, extra)
        at, theirs_are = 0, {}
        # Its format has a letter for each field, and before it how many there are.
        letters = re.findall(r"(\d*)([a-zA-Z])", theirs.unpacker.format)
        for field, (count, letter) in zip(theirs.ordered_fieldnames, letters, strict=True):
            theirs_are[field] = (letter, str(at), count)
            at += struct.calcsize(f"<{count}{letter}")
        for key, *ours in fields:
            if key == "flight_custom_version":
                # Bytes there, read as text here.
                ours[0] = "B"
            assert tuple(ours) == theirs_are[key], (name, key)


@pytest.fixture(scope="module")
def codec():
    """The scripts of the codec in a page of their own."""
    page = Page("data:text/html,")
    scripts = "".join((WEB / f"{name}.js").read_text() for name in ("messages", "codec", "signing"))

    def run(script, *arguments):
        return page.run(scripts + script, *arguments)

    yield run
    page.close()


VALUES = {
    "PARAM_SET": dict(target_system=1, param_id="BATT_LOW_VOLT", param_value=10.5, param_type=9),
    "COMMAND_LONG": dict(target_system=1, command=400, param1=1.0, param2=21196.0),
    "MANUAL_CONTROL": dict(target=1, y=-1000, z=1000),
    "HEARTBEAT": dict(type=6, autopilot=8, system_status=4, mavlink_version=3),
    "PARAM_REQUEST_READ": dict(target_system=1, param_index=-1, param_id="A234567890123456"),
    "LOG_REQUEST_DATA": dict(target_system=1, id=3, ofs=90_000, count=900),
}


@pytest.mark.parametrize("name", VALUES)
def test_frames_of_the_page_are_read_by_pymavlink(codec, name):
    frame = codec("return [...encode(arguments[0], arguments[1], 77, 190, 5)]", name, VALUES[name])
    (message,) = dialect.MAVLink(None).parse_buffer(bytes(frame))
    assert message.get_type() == name
    assert (message.get_srcSystem(), message.get_srcComponent(), message.get_seq()) == (77, 190, 5)
    for key, value in VALUES[name].items():
        assert getattr(message, key) == value, key


def frames_of_pymavlink(sender):
    cells = [4100, 4050, 4000, 3950, *[65535] * 6]
    return [
        dialect.MAVLink_heartbeat_message(10, 3, 209, 4, 4, 3),
        dialect.MAVLink_battery_status_message(1, 0, 1, 2500, cells, -250, 1234, -1, 55, 3600, 2, [4000, 0, 0, 0]),
        dialect.MAVLink_param_value_message(b"BATT_LOW_VOLT", 10.5, 9, 120, 7),
        dialect.MAVLink_statustext_message(4, "ä Battery 1 low: 10.95V 15% left".encode("latin-1"), 0, 0),
        dialect.MAVLink_log_data_message(3, 180, 90, list(range(90))),
        dialect.MAVLink_command_ack_message(400, 4),
        # One that the page does not know.
        dialect.MAVLink_attitude_message(1, 0.5, 0, 0, 0, 0, 0),
    ]


def test_frames_of_pymavlink_are_read_by_the_page_however_they_are_cut(codec):
    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    stream = b"\xfdnoise\xfe" + b"".join(bytes(message.pack(sender)) for message in frames_of_pymavlink(sender))
    damaged = bytearray(frames_of_pymavlink(sender)[1].pack(sender))
    damaged[20] ^= 1
    stream += bytes(damaged) + bytes(frames_of_pymavlink(sender)[0].pack(sender))
    script = """
        const found = [];
        const parse = parser(({ name, fields }) => found.push([name, fields]));
        for (let at = 0; at < arguments[0].length; at += arguments[1]) parse(Uint8Array.from(arguments[0].slice(at, at + arguments[1])));
        return found;
    """
    for piece in (1, 7, 64, 10_000):
        found = codec(script, list(stream), piece)
        names = [name for name, _ in found]
        assert names == ["HEARTBEAT", "BATTERY_STATUS", "PARAM_VALUE", "STATUSTEXT", "LOG_DATA", "COMMAND_ACK", None, "HEARTBEAT"], piece
    fields = dict((name, fields) for name, fields in found if name)
    battery = fields["BATTERY_STATUS"]
    assert battery["voltages"] == [4100, 4050, 4000, 3950, *[65535] * 6] and battery["voltages_ext"] == [4000, 0, 0, 0]
    assert (battery["current_battery"], battery["temperature"], battery["battery_remaining"], battery["charge_state"]) == (-250, 2500, 55, 2)
    assert (fields["PARAM_VALUE"]["param_id"], fields["PARAM_VALUE"]["param_value"]) == ("BATT_LOW_VOLT", 10.5)
    assert fields["LOG_DATA"]["data"] == list(range(90)) and fields["LOG_DATA"]["ofs"] == 180
    assert fields["STATUSTEXT"]["text"].endswith("15% left")


def test_sha_256_is_pythons(codec):
    for length in (0, 1, 55, 56, 63, 64, 65, 119, 120, 300):
        data = bytes(index * 7 % 256 for index in range(length))
        assert bytes(codec("return [...sha256(Uint8Array.from(arguments[0]))]", list(data))) == hashlib.sha256(data).digest(), length
    assert bytes(codec("return [...keyOf('Schlüssel 1')]")) == hashlib.sha256("Schlüssel 1".encode()).digest()


def test_signatures_of_the_page_and_of_pymavlink_are_each_others(codec):
    frames = codec(
        "const signer = newSigner(arguments[0]);"
        "return [0, 1, 2].map((sequence) => [...encode('PARAM_REQUEST_LIST', { target_system: 1 }, 77, 190, sequence, signer.sign)])",
        list(KEY),
    )
    receiver = dialect.MAVLink(None)
    receiver.signing.secret_key = KEY
    receiver.signing.timestamp = ticks_now() - 6_000_000
    receiver.signing.allow_unsigned_callback = None
    assert len(receiver.parse_buffer(b"".join(map(bytes, frames)))) == 3

    sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    sender.signing.secret_key, sender.signing.sign_outgoing, sender.signing.timestamp = KEY, True, ticks_now()
    signed = [list(frames_of_pymavlink(sender)[0].pack(sender)) for _ in range(2)]
    accepts = """
        const signer = newSigner(arguments[0]);
        const found = [];
        const parse = parser((frame) => found.push(!!signer.accepts(frame)));
        for (const frame of arguments[1]) parse(Uint8Array.from(frame));
        return found;
    """
    unsigned = list(frames_of_pymavlink(sender)[0].pack(dialect.MAVLink(None)))
    assert codec(accepts, list(KEY), [*signed, unsigned]) == [True, True, False]
    assert codec(accepts, [*KEY[:-1], KEY[-1] ^ 1], signed) == [False, False]

    # Each counts once, by the times of its own stream, whatever the page's clock is and another stream's times are.
    sender.signing.timestamp -= 1_000_000_000
    sender.signing.link_id = 7
    late = [list(frames_of_pymavlink(sender)[0].pack(sender)) for _ in range(2)]
    one, two = signed
    assert codec(accepts, list(KEY), [one, late[0], late[1], one, two, late[0], two]) == [True, True, True, False, True, False, False]


def test_each_page_signs_by_a_link_of_its_own(codec):
    signed = "return encode('HEARTBEAT', {}, 77, 190, 0, newSigner(arguments[0]).sign).at(-13)"
    assert len({codec(signed, list(KEY)) for _ in range(20)}) > 10


# The rooms.


def test_the_pack_and_what_is_unknown_of_it(rover):
    page = rover.open()
    page.wait_for("100 %")
    page.wait_for("Current, Power, Drawn, Health: no current sensor. Time left: after two minutes of driving. Temperature: no sensor for it.")
    page.wait_for("3 cells, LiPo, 3300 mAh")
    # Two standard deviations, as the rover estimates it.
    page.wait(lambda: re.search(r"100 %\s*± \d+ %", page.read("packs")))
    shown = page.text()
    assert re.search(r"12\.\d\d V", shown) and "OK" in shown and "Disarmed" in shown
    assert shown.count("no current sensor") == 1
    # What it says to a new station is shown once.
    assert page.read("messages").count("Battery failsafes are off") == 1
    page.wait(lambda: re.search(r"Now: Voltage 12\.\d\d V, Charge 100 %", page.text()))
    set_to(rover.station, "SIM_BATT_FAULT", 2)
    page.wait_for("no pack is connected")
    assert page.run("return document.querySelector('.bar i').offsetWidth") == 0
    page.wait_for("Does not arm: Battery 1 unhealthy. Check the plug and the wires of the pack.")
    set_to(rover.station, "SIM_BATT_FAULT", 0)
    page.wait_until_gone("Does not arm")
    set_to(rover.station, "SIM_BATT_VOLTAGE", 10.9)
    page.wait_for("Battery 1", 10)
    assert page.errors() == []


def test_damaged_parameters_are_confirmed_by_a_button(start_rover, tmp_path):
    # An erased image of the chip from the log on, with something else where the parameters are.
    image = b"\xff" * 1264 * 1024 + b"\x5a" * 16 * 1024
    flash = tmp_path / "flash.bin"
    flash.write_bytes(image)
    page = start_rover("--flash", str(flash)).open()
    page.wait_for("Does not arm: Parameters damaged: check them, then set PARAM_CHECKED 1")
    page.run("[...document.querySelectorAll('.notices button')].find((one) => one.offsetParent).click()")
    page.wait_until_gone("Does not arm")


def test_cells_and_temperature_of_a_smart_battery(rover):
    set_to(rover.station, "BATT_MONITOR", 7)
    rover.station = restarted(rover.station, rover.simulator.url)
    page = rover.open()
    page.wait_for("Cell 3")
    page.wait(lambda: re.search(r"Temperature\s+\d+ °C", page.text()))
    page.wait(lambda: len(re.findall(r"\d\.\d\d V", page.read("packs"))) >= 4)
    assert page.errors() == []


def test_arming_needs_a_second_and_stop_one_touch(rover):
    rover.measure_current()
    page = rover.open()
    page.enter("drive")
    page.hold_to_arm(0.5)
    time.sleep(1)
    assert not rover.is_armed
    drive(page)
    assert rover.is_armed and rover.mode == "Manual"
    page.push_stick()
    rover.seconds_until(rover.turns, 3)
    x, y, _ = page.middle("#stop")
    page.mouse("mousePressed", x, y)
    rover.seconds_until(lambda: not rover.turns(), 1)
    page.mouse("mouseReleased", x, y)
    page.wait_for("Stopped: Hold")
    assert rover.mode == "Hold" and rover.is_armed
    page.release_stick()
    page.press("Disarm")
    page.wait_for("Disarmed")
    assert not rover.is_armed and page.errors() == []


def test_a_lifted_thumb_stays_in_manual_without_a_failsafe(rover):
    rover.measure_current()
    page = rover.open()
    drive(page)
    page.push_stick()
    rover.seconds_until(rover.turns, 3)
    page.release_stick()
    assert rover.seconds_until(lambda: not rover.turns(), 1) < 1
    since = page.now_ms()
    time.sleep(10)
    sent = [throttle for at, throttle in page.sticks_sent() if at > since]
    assert 150 <= len(sent) <= 220 and not any(sent)
    assert rover.mode == "Manual" and "Failsafe" not in page.text()


# What takes the driver's hand or eyes away, and whether the page can still say so.
LETTING_GO = {
    "released": lambda rover, page: page.release_stick(),
    "cancelled": lambda rover, page: page.touch("touchCancel"),
    "blurred": lambda rover, page: page.run("document.hasFocus = () => false; dispatchEvent(new Event('blur'))"),
    "hidden": lambda rover, page: page.run(
        "Object.defineProperty(document, 'hidden', { get: () => true }); document.dispatchEvent(new Event('visibilitychange'))"
    ),
    "left": lambda rover, page: page.run("dispatchEvent(new Event('pagehide'))"),
    "another room": lambda rover, page: page.enter("battery"),
    "closed": lambda rover, page: page.driver.close(),
    "killed": lambda rover, page: page.kill(),
    "cut": lambda rover, page: rover.network.cut(),
    "not heard": lambda rover, page: rover.network.mute(),
    "not drained": lambda rover, page: page.run(
        "Object.defineProperty(WebSocket.prototype, 'bufferedAmount', { get: () => 100 })"
    ),
}

# Those that the page notices at once. The others end by FS_TIMEOUT, or by the page's own look at the rover's heartbeats.
AT_ONCE = {"released", "cancelled", "blurred", "hidden", "left", "another room", "not drained"}
FS_TIMEOUT_S = 1.5
FRESH_S = 2.5
SHORT = ["hidden", "cut", "not drained"]


@pytest.mark.parametrize("how", [pytest.param(how, marks=[] if how in SHORT else pytest.mark.long) for how in LETTING_GO])
def test_dead_man(rover, how):
    rover.measure_current()
    page = rover.open(url=rover.network.url)
    drive(page)
    page.push_stick()
    rover.seconds_until(rover.turns, 3)
    time.sleep(1)
    assert rover.turns()
    LETTING_GO[how](rover, page)
    limit = 0.5 if how in AT_ONCE else FRESH_S + 1 if how == "not heard" else FS_TIMEOUT_S + 1
    rover.seconds_until(lambda: not rover.turns(), limit)
    time.sleep(FRESH_S + 0.5)
    assert not rover.turns()
    if how in ("released", "cancelled", "another room"):
        assert rover.mode == "Manual"
        return
    if how == "left":
        return
    assert rover.mode == "Hold"
    if how in ("blurred", "hidden", "not heard", "not drained"):
        # Neutral once, then nothing.
        sent = [throttle for _, throttle in page.sticks_sent()]
        assert sent[-1] == 0 and sent[-2] > 0
        time.sleep(0.5)
        assert len(page.sticks_sent()) == len(sent)
    if how == "cut":
        rover.network.mend()
        page.wait_for("Live", 15)
        time.sleep(1)
        # What was held back on the way is old, and moves nothing.
        assert not rover.turns() and rover.mode == "Hold"


@pytest.mark.long
def test_the_second_of_two_drivers_moves_nothing(rover):
    rover.measure_current()
    first, second = rover.open(), rover.open()
    drive(first)
    first.push_stick()
    rover.seconds_until(rover.turns, 3)
    second.enter("drive")
    second.wait_for("Move the stick to drive")
    second.push_stick(0)
    time.sleep(1)
    assert all(rover.turns() for _ in range(20))
    second.release_stick()
    second.push_stick(-0.9)
    second.wait_for("Sticks ignored: another station drives")
    first.release_stick()
    rover.seconds_until(lambda: not rover.turns(), 1)
    # Held all the time, the second one's stick has never been neutral.
    assert not any(rover.turns() for _ in range(40))
    # Whoever drives, anybody stops.
    first.push_stick()
    rover.seconds_until(rover.turns, 3)
    second.press("Stop")
    rover.seconds_until(lambda: not rover.turns(), 1)
    assert rover.mode == "Hold"


def test_keys_drive_and_escape_stops(rover):
    rover.measure_current()
    page = rover.open(size=DESKTOP)
    page.enter("drive")
    page.run("document.getElementById('arm').focus()")
    page.key("keyDown", "Space", " ")
    time.sleep(1.3)
    page.key("keyUp", "Space", " ")
    page.wait_for("Armed")
    page.press("Manual")
    page.wait_for("Move the stick to drive")
    page.key("keyDown", "KeyW", "w")
    rover.seconds_until(rover.turns, 3)
    assert "Throttle 60 %, steering 0 %" in page.text()
    page.key("keyDown", "ArrowRight", "ArrowRight")
    assert "Throttle 60 %, steering 60 %" in page.text()
    page.key("keyUp", "ArrowRight", "ArrowRight")
    page.key("keyUp", "KeyW", "w")
    rover.seconds_until(lambda: not rover.turns(), 1)
    page.key("keyDown", "KeyS", "s")
    page.wait_for("Throttle −60 %")
    page.key("keyDown", "Escape", "Escape")
    page.wait_for("Stopped: Hold")
    rover.seconds_until(lambda: not rover.turns(), 1)
    assert rover.mode == "Hold"


def test_a_game_pad_drives_once_it_was_neutral(rover):
    rover.measure_current()
    page = rover.open(size=DESKTOP)
    move = lambda x, y, stop=False: page.run(
        "const [x, y, pressed] = arguments;"
        "const pad = { connected: true, axes: [x, y], buttons: [{ pressed: false }, { pressed }] };"
        "navigator.getGamepads = () => [null, pad]",
        x,
        y,
        stop,
    )
    # In a bag, something lies on its stick.
    move(0, -1)
    drive(page)
    time.sleep(0.5)
    assert not rover.turns() and "Throttle 0 %, steering 0 %" in page.text()
    # A stick that is worn out is never quite in its middle.
    move(0.1, 0.1)
    time.sleep(0.2)
    move(0.5, -1)
    page.wait_for("Throttle 60 %, steering 30 %")
    rover.seconds_until(rover.turns, 3)
    move(0, 0)
    rover.seconds_until(lambda: not rover.turns(), 1)
    move(0, 1)
    page.wait_for("Throttle −60 %")
    rover.seconds_until(rover.turns, 3)
    # It is switched off, or its battery is empty.
    page.run("navigator.getGamepads = () => [null]")
    rover.seconds_until(lambda: not rover.turns(), 1)
    assert rover.mode == "Manual"
    move(0, 0, stop=True)
    page.wait_for("Stopped: Hold")
    assert rover.mode == "Hold" and page.errors() == []


def test_settings(rover):
    page = rover.open(size=DESKTOP)
    page.enter("setup")
    page.wait_for("Battery monitoring")
    page.wait_for("The rover counts 3 cells")
    # Nothing of a current without a sensor for it.
    assert not page.element("#form-sensor").is_displayed() and not page.element("#current").is_displayed()

    # A calibration says what it will change, and can be undone.
    meter = page.element("#voltage input")
    meter.send_keys("12.00")
    page.wait_for("BATT_VOLT_MULT changes from 3.95 to 3.7")
    page.press("Calibrate")
    page.wait_for("Undo: back to 3.95")
    assert 3.7 < parameter(rover, "BATT_VOLT_MULT") < 3.9
    page.wait_for("Battery 1 estimate restarted", 10)
    page.press("Undo: back to 3.95")
    page.wait_until_gone("Undo: back to 3.95")
    assert parameter(rover, "BATT_VOLT_MULT") == pytest.approx(3.95)

    # No multimeter is believed that shows what no divider explains; the question is for the one whose divider is another.
    meter.send_keys("40")
    page.wait_for("BATT_VOLT_MULT changes from 3.95 to 1")
    page.press("Calibrate")
    page.wait_for("Press again for another divider")
    assert parameter(rover, "BATT_VOLT_MULT") == pytest.approx(3.95)
    page.press("Press again for another divider")
    page.wait_for("Undo: back to 3.95")
    assert parameter(rover, "BATT_VOLT_MULT") > 10
    page.press("Undo: back to 3.95")
    page.wait_until_gone("Undo: back to 3.95")

    # Thresholds that suit the cells.
    page.press("Use what suits the cells: 10.50 V, 10.20 V")
    page.wait_for("Saved. Below 10.50 V for 10 s it stops in Hold.")
    assert parameter(rover, "BATT_LOW_VOLT") == 10.5
    assert parameter(rover, "BATT_CRT_VOLT") == pytest.approx(10.2)

    # What is refused says why, and the old value stays.
    page.element("#search").send_keys("batt_low_timer")
    page.wait(lambda: page.read("found").startswith("1 of "))
    field = page.element("#list input")
    field.clear()
    field.send_keys("500\t")
    page.wait(lambda: "BATT_LOW_TIMER refused: valid 0 to 120" in page.read("list"))
    assert page.read("list").lower().count("refused") == 1 and "Failed" not in page.read("list")
    assert field.get_attribute("value") == "10"

    # What needs a restart says so, and the page is back after it.
    set_to(rover.station, "BATT_CURR_PIN", 27)
    search = page.element("#search")
    search.clear()
    search.send_keys("batt_monitor")
    page.wait(lambda: page.read("found").startswith("1 of "))
    page.run("const list = document.querySelector('#list select'); list.value = 4; list.dispatchEvent(new Event('change'))")
    page.wait_for("Saved: Analog Voltage and Current")
    page.wait(lambda: page.element("#form-sensor").is_displayed())
    page.wait_for("After a restart: BATT_MONITOR")
    page.press("Restart the rover")
    page.press("Press again to restart")
    page.enter("battery")
    page.wait(lambda: re.search(r"Current\s+0\.\d A", page.text()), 20)
    errors = [error for error in page.errors() if "WebSocket" not in error]
    assert errors == []


def test_what_suits_the_cells_stops_the_rover_when_the_pack_is_low(rover):
    set_to(rover.station, "BATT_FS_CRT_ACT", 5)
    page = rover.open()
    page.enter("drive")
    page.wait_for("A low pack does not stop the rover.")
    page.element("#when-low").click()
    page.press("Use what suits the cells: 10.50 V, 10.20 V")
    # An action that was set stays, and is shown.
    page.wait_for("Saved. Below 10.50 V for 10 s it stops in Hold. Below 10.20 V for 10 s it disarms.")
    assert [parameter(rover, f"BATT_FS_{level}_ACT") for level in ("LOW", "CRT")] == [2, 5]
    set_to(rover.station, "BATT_LOW_TIMER", 2)
    drive(page)
    page.wait_for("Below 10.50 V for 2 s it stops in Hold.")
    set_to(rover.station, "SIM_BATT_VOLTAGE", 10.4)
    page.wait_for("The rover stops to spare the pack: charge it.", 20)
    assert rover.mode == "Hold" and rover.is_armed
    page.press("Disarm")
    page.wait_for("Does not arm: Battery 1 low voltage failsafe. Charge the pack, or plug in a full one.", 10)
    assert page.errors() == []


def test_only_a_warning_is_said_to_be_one(rover):
    page = rover.open(size=DESKTOP)
    page.enter("setup")
    page.wait_for("Use what suits the cells")
    page.run("document.getElementById('action').value = 0")
    page.press("Use what suits the cells")
    page.wait_for("Saved. Below 10.50 V for 10 s it only warns. Below 10.20 V for 10 s it only warns. A low pack does not stop the rover.")
    assert [parameter(rover, f"BATT_FS_{level}_ACT") for level in ("LOW", "CRT")] == [0, 0]


def test_stick_and_stop_stay_where_they_are_when_a_text_appears(rover):
    page = rover.open()
    places = lambda: page.run(
        "return ['pad', 'stop', 'manual', 'arm'].map((id) => Object.values(document.getElementById(id).getBoundingClientRect().toJSON()))"
    )
    for size in (PHONE, SMALL_PHONE, LANDSCAPE, DESKTOP):
        page.resize(size)
        page.enter("drive")
        page.wait_for("To drive, arm and choose Manual.")
        before = places()
        page.press("Stop")
        page.wait_for("Stopped: Hold")
        set_to(rover.station, "BATT_ARM_VOLT", 13)
        page.wait_for("Does not arm: Battery 1 below minimum arming voltage. Charge the pack", 10)
        page.hold_to_arm()
        page.wait_for("Not armed: Battery 1 below minimum arming voltage", 10)
        assert places() == before, size
        set_to(rover.station, "BATT_ARM_VOLT", 0)
        page.wait_until_gone("Does not arm")
        page.driver.refresh()
        page.wait_for("Live")


@pytest.mark.parametrize(
    "text, advice",
    [
        ("Battery 1 limits the motors: over 20W", "It drives slower, to spare the pack. Push the stick less."),
        ("Radio Failsafe: Hold", "No stick was received for too long, so it stopped. Go nearer, then choose Manual."),
        ("Battery 1 cells unclear: set BATT_CELLS", "Check chemistry and cells under Set up."),
        ("Battery 1 voltage failsafe critical >= low", "Under Set up, critical has to be below low."),
        ("Throttle (RC3) is not neutral", "Let go of the stick."),
    ],
)
def test_what_keeps_it_from_driving_is_said_with_what_to_do(codec, text, advice):
    script = (WEB / "advice.js").read_text()
    assert codec("const on = () => 0;" + script + "return advised(arguments[0])", text) == f"{text}. {advice}"


def test_what_another_station_sets_is_shown_and_a_longer_list_is_read(rover):
    page = rover.open()
    page.enter("setup")
    page.element("#search").send_keys("batt_low_timer")
    page.wait(lambda: page.read("found").startswith("1 of "))
    set_to(rover.station, "BATT_LOW_TIMER", 27)
    page.wait(lambda: page.element("#list input").get_attribute("value") == "27")
    search = page.element("#search")
    search.clear()
    search.send_keys("batt2_capacity")
    page.wait(lambda: page.read("found").startswith("0 of "))
    set_to(rover.station, "BATT2_MONITOR", 4)
    page.wait(lambda: page.read("found").startswith("1 of "))
    set_to(rover.station, "BATT2_MONITOR", 0)
    page.wait(lambda: page.read("found").startswith("0 of "))


def parameter(rover, name):
    rover.station.mav.param_request_read_send(1, 1, name.encode(), -1)
    # What the page has set comes unasked, without an index.
    while (answer := receive(rover.station, ["PARAM_VALUE"])).param_id != name or answer.param_index == 65535:
        pass
    return answer.param_value


def test_logs_are_listed_downloaded_and_erased_when_asked_twice(rover, tmp_path):
    name = rover.record_a_drive()
    page = rover.open(downloads=tmp_path)
    page.enter("logs")

    def is_listed():
        page.press("Read again")
        time.sleep(0.5)
        return "Log 1" in page.text()

    page.wait(is_listed)
    assert "11/26/2026, " in page.read("log-list")
    page.press("Download")
    (file,) = page.wait(lambda: list(tmp_path.glob("*.BIN")))
    assert file.read_bytes()[:2] == b"\xa3\x95" and file.name == name
    rover.arm()
    page.wait_for("While armed nothing is downloaded or erased: disarm first.")
    rover.disarm()
    page.wait_until_gone("While armed")
    page.press("Erase all logs")
    time.sleep(0.5)
    page.press("Press again to erase all for good")
    page.wait_for("No logs", 10)
    # The refusal while armed is an answer with an error.
    assert [error for error in page.errors() if "409" not in error] == []


@pytest.mark.parametrize("signs", [False, True])
def test_a_log_recorded_from_the_page_has_a_date(rover, signs):
    if signs:
        rover.station.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
        wait_for_text(rover.station, "Signing key set")
        sign_with(rover.station, KEY)
    page = rover.open()
    if signs:
        page.enter("about")
        page.element("#passphrase").send_keys("a good passphrase\n")
        page.wait_for("This page signs")
    drive(page)
    time.sleep(2)
    page.press("Disarm")
    page.wait_for("Disarmed")
    page.enter("logs")
    page.wait_for("Log 1")
    today = page.run("return new Date().toLocaleDateString()")
    assert today in page.read("log-list") and "no date" not in page.read("log-list")


def test_a_rover_with_a_key(rover, tmp_path):
    name = rover.record_a_drive()
    rover.station.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
    wait_for_text(rover.station, "Signing key set")
    sign_with(rover.station, KEY)
    page = rover.open(downloads=tmp_path)
    page.wait_for("The rover has a signing key")
    page.enter("drive")
    page.wait_for("Without the key nothing is obeyed.")
    page.hold_to_arm()
    time.sleep(1)
    assert not rover.is_armed

    page.enter("about")
    page.element("#passphrase").send_keys("a wrong passphrase\n")
    page.wait_for("This page signs")
    page.enter("drive")
    page.wait_for("Nothing comes that is signed with your key")
    page.enter("about")
    page.element("#passphrase").send_keys("a good passphrase\n")
    page.wait_for("Live")
    drive(page)
    assert rover.is_armed
    page.press("Disarm")
    page.wait_for("Disarmed")

    # By signed MAVLink, as HTTP can't be signed.
    page.enter("logs")
    page.wait_for("Log 1")
    page.press("Download")
    (file,) = page.wait(lambda: list(tmp_path.glob("*.BIN")), 30)
    assert file.read_bytes()[:2] == b"\xa3\x95" and file.name == name

    # It is stored nowhere: a reload asks for it again.
    assert page.run("return [sessionStorage.length, localStorage.length, document.cookie]") == [0, 0, ""]
    page.enter("about")
    page.wait_for("this page signs")
    page.press("Forget the key")
    page.wait_for("the rover signs, this page does not")
    page.element("#passphrase").send_keys("a good passphrase\n")
    page.wait_for("this page signs")
    page.driver.refresh()
    page.wait_for("the rover signs, this page does not")


@pytest.mark.parametrize("signs", [False, True])
def test_a_log_has_one_name(rover, signs, tmp_path):
    # The first file is erased, so that the second one's number is not its place.
    rover.record_a_drive()
    rover.station.mav.log_erase_send(1, 1)
    time.sleep(1)
    name = rover.record_a_drive().replace("-00000001", "-00000002")
    if signs:
        rover.station.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
        wait_for_text(rover.station, "Signing key set")
    page = rover.open(downloads=tmp_path)
    if signs:
        page.enter("about")
        page.element("#passphrase").send_keys("a good passphrase\n")
        page.wait_for("This page signs")
    page.enter("logs")
    page.wait_for("Log 2, ")
    page.press("Download")
    (file,) = page.wait(lambda: list(tmp_path.glob("*.BIN")), 30)
    assert file.name == name and file.read_bytes()[:2] == b"\xa3\x95"


def test_a_lost_rover_is_greyed_with_its_age_and_found_again(rover):
    page = rover.open(url=rover.network.url)
    colour = lambda: page.run("return getComputedStyle(document.querySelector('.charge b')).color")
    fresh = colour()
    rover.network.cut()
    page.wait_for("Not heard for 3 s", 5)
    page.wait(lambda: colour() != fresh, 2)
    page.wait_for("s old")
    rover.network.mend()
    page.wait_for("Live", 10)
    page.wait(lambda: colour() == fresh, 3)


@pytest.mark.long
def test_a_third_browser_learns_why_and_gets_the_first_free_place(rover):
    first, _ = rover.open(), rover.open()
    # Connections that a browser opens in advance, and says nothing on, have ended.
    time.sleep(4)
    third = Page(rover.url)
    rover.pages.append(third)
    third.wait_for("No place: two browsers are connected already?")
    first.close()
    third.wait_for("Live", 15)
    third.wait_until_gone("No place")


@pytest.mark.long
def test_an_hour_of_telemetry_takes_no_more_memory(start_rover):
    # Thirty times as fast, an hour takes two minutes.
    page = start_rover("--speedup", "30").open()

    def heap_bytes():
        page.devtools("HeapProfiler.collectGarbage")
        return page.run("return performance.memory.usedJSHeapSize")

    time.sleep(30)
    before = heap_bytes()
    time.sleep(120)
    assert heap_bytes() - before < 500_000
    assert page.errors() == []


def test_everything_is_on_the_screen_and_legible(rover, pytestconfig):
    page = rover.open()
    pictures = pytestconfig.getoption("--pictures")
    sizes = {"phone": PHONE, "small-phone": SMALL_PHONE, "landscape": LANDSCAPE, "desktop": DESKTOP}
    schemes = ("dark", "light")
    if not pytestconfig.getoption("--long"):
        sizes, schemes = {"small-phone": SMALL_PHONE, "landscape": LANDSCAPE}, ("light",)
    for name, size in sizes.items():
        for scheme in schemes:
            page.resize(size, scheme)
            for room in ROOMS:
                page.enter(room)
                time.sleep(0.4)
                if pictures:
                    page.picture(pathlib.Path(pictures) / f"{name}-{scheme}-{room}.png")
                where = f"{name} {scheme} {room}"
                box = page.run("const { left, top, right, bottom, height } = document.getElementById('stop').getBoundingClientRect(); return [left, top, right, bottom, height]")
                assert box[0] >= 0 and box[1] >= 0 and box[2] <= size[0] and box[3] <= size[1] and box[4] >= 44, where
                assert page.run("const main = document.querySelector('main'); return main.scrollWidth <= main.clientWidth && document.documentElement.scrollWidth <= innerWidth"), where
                assert page.run(HARD_TO_READ) == [], where
                assert page.run(UNNAMED) == [], where
                if room == "drive":
                    assert page.run("const [pad, main] = ['#pad', 'main'].map((one) => document.querySelector(one).getBoundingClientRect()); return pad.top >= main.top && pad.bottom <= main.bottom"), where
    assert page.errors() == []


@pytest.mark.long
def test_the_release_firmware_serves_the_page_and_is_driven_by_it(tmp_path):
    board = PageBoard(tmp_path / "flash")
    page = None
    try:
        station = connect(board.usb_url)
        for name, value in (("BATT_CELLS", 3), ("MOT_SLEWRATE", 0)):
            set_to(station, name, value)
        while receive(station, ["BATTERY_STATUS"]).battery_remaining < 0:
            pass
        page = Page("about:blank", arguments=[board.route])
        began_s = board.motors()[1]
        page.driver.get(board.URL)
        page.wait(lambda: re.search(r"\d %", page.read("packs")), 30)
        print(f"first percentage after {board.motors()[1] - began_s:.2f} s")
        assert board.motors()[1] - began_s <= 1
        drive(page)
        x, y, width = page.middle("#pad")
        waited_s = []
        for _ in range(5):
            page.touch("touchStart", (x, y))
            time.sleep(0.1)
            touched_s = board.motors()[1]
            page.touch("touchMove", (x, y - width / 3))
            waited_s.append(seconds_until_motors(board, True) - touched_s)
            page.release_stick()
            seconds_until_motors(board, False)
        print("from touch to motor, in s:", *(f"{seconds:.3f}" for seconds in waited_s))
        # What this computer takes is in it.
        assert min(waited_s) <= 0.1
        page.push_stick()
        seconds_until_motors(board, True)
        page.press("Stop")
        seconds_until_motors(board, False)
        page.wait_for("Stopped: Hold")
        assert page.errors() == []
    finally:
        if page:
            page.close()
        board.kill()


def seconds_until_motors(board, are_driven):
    """The emulated time at which they are so."""
    end = time.monotonic() + 10
    while (shown := board.motors())[0] != are_driven:
        assert time.monotonic() < end
    return shown[1]


@pytest.mark.long
@pytest.mark.skipif(not FIREFOX, reason="Firefox is not installed: apt-get install firefox-esr")
def test_a_drive_in_firefox(rover, tmp_path, pytestconfig):
    rover.measure_current()
    firefox = Firefox(rover.url, tmp_path)
    try:
        firefox.wait_for("Live", 20)
        firefox.wait_for("100 %")
        for room, words in (("setup", "Battery monitoring"), ("logs", "No logs"), ("about", "open: anyone"), ("drive", "Arm: press 1 s")):
            firefox.enter(room)
            firefox.wait_for(words)
            if pictures := pytestconfig.getoption("--pictures"):
                firefox.picture(pathlib.Path(pictures) / f"firefox-{room}.png")
        # A finger that slides off Arm lets go of it, also onto Stop.
        firefox.pointer(("move", *firefox.middle("#arm")), "down", 0.3, ("move", *firefox.middle("#stop")), 1.5, "up", kind="touch")
        assert not rover.is_armed
        firefox.pointer(("move", *firefox.middle("#arm")), "down", 1.3, "up", kind="touch")
        firefox.wait_for("Armed")
        firefox.pointer(("move", *firefox.middle("#manual")), "down", "up")
        firefox.wait_for("Move the stick to drive")
        x, y = firefox.middle("#pad")
        firefox.pointer(("move", x, y), "down", ("move", x, y - 100))
        rover.seconds_until(rover.turns, 3)
        firefox.pointer("up")
        rover.seconds_until(lambda: not rover.turns(), 1)
        firefox.pointer(("move", *firefox.middle("#stop")), "down", "up")
        firefox.wait_for("Stopped: Hold")
        assert rover.mode == "Hold" and firefox.errors() == []
    finally:
        firefox.close()


# Text whose contrast to what is behind it is below 4.5:1.
HARD_TO_READ = """
const rgb = (colour) => colour.match(/[\\d.]+/g).map(Number);
const light = ([r, g, b]) => [r, g, b].map((c) => c / 255).map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
const behind = (element) => {
    for (; element; element = element.parentElement) {
        const colour = rgb(getComputedStyle(element).backgroundColor);
        if (colour[3] !== 0) return colour;
    }
    return rgb(getComputedStyle(document.documentElement).backgroundColor);
};
return [...document.querySelectorAll('body *')].filter((element) => {
    const hasText = [...element.childNodes].some((node) => node.nodeType == 3 && node.textContent.trim());
    if (!hasText || !element.offsetParent || element.closest('#say, script, style, option')) return false;
    const [one, other] = [light(rgb(getComputedStyle(element).color)), light(behind(element))].sort((a, b) => b - a);
    return (one + 0.05) / (other + 0.05) < 4.5;
}).map((element) => element.outerHTML.slice(0, 80));
"""

# Controls that a screen reader has no name for.
UNNAMED = """
return [...document.querySelectorAll('button, a, input, select, [tabindex]')].filter((element) => element.offsetParent || element.tagName == 'svg')
    .filter((element) => !(element.ariaLabel || element.innerText?.trim() || element.labels?.length)).map((element) => element.outerHTML.slice(0, 80));
"""
