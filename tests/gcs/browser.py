"""A person at the page in the browser: reads what is on the screen, touches, types, looks away."""

import base64
import contextlib
import gzip
import hashlib
import json
import os
import pathlib
import queue
import re
import shutil
import signal
import socket
import struct
import subprocess
import threading
import time

import pytest
from pymavlink.dialects.v20 import all as dialect
from pymavlink.dialects.v20.all import mavlink_map, x25crc

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]

DESCRIPTIONS = json.loads(gzip.decompress((REPOSITORY / "docs" / "parameters.json.gz").read_bytes()))

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
CHROMEDRIVER = shutil.which("chromedriver")

PHONE = (390, 844)
SMALL_PHONE = (360, 640)
LANDSCAPE = (844, 390)
DESKTOP = (1280, 800)

# Runs in the page before it: what leaves it, and what it would hide.
WATCH = """
window.sent = [];
const { send } = WebSocket.prototype;
WebSocket.prototype.send = function (data) {
  window.sockets = (window.sockets || new Set()).add(this);
  window.sent.push([performance.now(), ...new Uint8Array(data.buffer || data)]);
  return send.call(this, data);
};
window.errors = [];
addEventListener('error', (event) => window.errors.push(String(event.message)));
addEventListener('unhandledrejection', (event) => window.errors.push(String(event.reason)));
"""

MANUAL_CONTROL = 69

# Runs in the page before it: a rover of which nothing is true but what a test says. `state` is heard five times a second.
STAGE = """
window.state = {};
window.fetch = async (path) => ({ ok: true, json: async () => window.files[path] });
window.WebSocket = class {
  constructor() {
    this.readyState = this.bufferedAmount = 0;
    this.binaryType = '';
    window.hear = (bytes) => this.onmessage({ data: Uint8Array.from(bytes).buffer });
    window.hang_up = () => this.onclose();
    setTimeout(() => {
      this.readyState = 1;
      this.onopen();
      clearInterval(window.telling);
      window.telling = setInterval(() => Object.values(window.state).forEach(window.hear), 200);
    });
  }
  send(frame) {
    // A PING is its own answer.
    if (frame[7] == 4) setTimeout(() => window.hear(frame));
  }
  close() {}
};
"""


def require_chromium():
    """Skips the test where there is no Chromium, by the name of what is missing; on a build server that is a failure."""
    if CHROMIUM and CHROMEDRIVER:
        return
    reason = "Chromium is not installed: apt-get install chromium chromium-driver"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


class Page:
    """The page in a headless Chromium of its own."""

    def __init__(self, url, size=PHONE, scheme="dark", downloads=None, arguments=(), script=""):
        require_chromium()
        from selenium import webdriver

        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM
        for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", *arguments):
            options.add_argument(argument)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(CHROMEDRIVER))
        self.driver.set_script_timeout(60)
        self.devtools("Page.addScriptToEvaluateOnNewDocument", source=script + WATCH)
        if downloads:
            self.devtools("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(downloads))
        self.resize(size, scheme)
        self.url = url
        self.driver.get(url)

    def devtools(self, command, **parameters):
        return self.driver.execute_cdp_cmd(command, parameters)

    def resize(self, size, scheme="dark"):
        width, height = size
        is_phone = max(size) < 1000
        self.devtools(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=2 if is_phone else 1,
            mobile=is_phone,
        )
        self.devtools("Emulation.setTouchEmulationEnabled", enabled=is_phone)
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    # What a person reads.

    def text(self):
        """All that is on the screen or can be scrolled to."""
        return self.run("return document.body.innerText")

    def read(self, element_id):
        return self.run("return document.getElementById(arguments[0]).innerText", element_id)

    def wait(self, condition, seconds=10):
        """What the condition gives once that is something. An element may be replaced between two looks at it."""
        from selenium.common.exceptions import StaleElementReferenceException

        end = time.monotonic() + seconds
        while True:
            with contextlib.suppress(StaleElementReferenceException):
                if found := condition():
                    return found
            assert time.monotonic() < end, f"not within {seconds} s:\n{self.text()}"
            time.sleep(0.05)

    def wait_for(self, text, seconds=10):
        self.wait(lambda: text in self.text(), seconds)

    def wait_until_gone(self, text, seconds=10):
        self.wait(lambda: text not in self.text(), seconds)

    # What a person does.

    def enter(self, room):
        self.run("document.querySelector(`nav a[href='#${arguments[0]}']`).click()", room)

    def element(self, css):
        from selenium.webdriver.common.by import By

        return self.driver.find_element(By.CSS_SELECTOR, css)

    def button(self, text):
        """The button that is shown with this text."""
        find = "return [...document.querySelectorAll('button, a.button')].find((one) => one.offsetParent && one.innerText.includes(arguments[0]))"
        return self.wait(lambda: self.run(find, text))

    def press(self, text):
        self.button(text).click()

    def middle(self, css):
        return self.run(
            "const box = document.querySelector(arguments[0]).getBoundingClientRect();"
            "return [box.left + box.width / 2, box.top + box.height / 2, box.width]",
            css,
        )

    def mouse(self, kind, x, y):
        self.devtools("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def touch(self, kind, *points):
        self.devtools("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y, "id": i} for i, (x, y) in enumerate(points)])

    def key(self, kind, code, key):
        self.devtools("Input.dispatchKeyEvent", type=kind, code=code, key=key)

    def hold_to_arm(self, seconds=1.3):
        x, y, _ = self.middle("#arm")
        self.touch("touchStart", (x, y))
        time.sleep(seconds)
        self.touch("touchEnd")

    def push_stick(self, share=0.9, css="#pad"):
        """A thumb on the stick, ahead."""
        x, y, width = self.middle(css)
        self.touch("touchStart", (x, y))
        self.touch("touchMove", (x, y - share * width / 3))

    def release_stick(self):
        self.touch("touchEnd")

    def sticks_sent(self):
        """Time in ms and throttle of each MANUAL_CONTROL that has left."""
        frames = self.run("return window.sent")
        found = []
        for at, *frame in frames:
            if frame[7] | frame[8] << 8 == MANUAL_CONTROL:
                payload = bytes(frame[10 : 10 + frame[1]]).ljust(30, b"\0")
                found.append((at, int.from_bytes(payload[4:6], "little", signed=True)))
        return found

    def now_ms(self):
        return self.run("return performance.now()")

    def picture(self, path, pixels=None):
        """With so many pixels for one of the style sheet's, where the screen has others."""
        clip = {}
        if pixels:
            width, height, ratio = self.run("return [innerWidth, innerHeight, devicePixelRatio]")
            clip = {"clip": {"x": 0, "y": 0, "width": width, "height": height, "scale": pixels / ratio}}
        data = self.devtools("Page.captureScreenshot", format="png", **clip)["data"]
        pathlib.Path(path).parent.mkdir(parents=True, exist_ok=True)
        pathlib.Path(path).write_bytes(base64.b64decode(data))

    def errors(self):
        """What the console has said, and what was not caught."""
        console = [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
        return console + self.run("return window.errors")

    def kill(self):
        """The browser is gone at once, without a word."""
        profile = self.driver.capabilities["chrome"]["userDataDir"].encode()
        for arguments in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            with contextlib.suppress(OSError):
                if profile in arguments.read_bytes():
                    os.kill(int(arguments.parent.name), signal.SIGKILL)

    def close(self):
        with contextlib.suppress(Exception):
            self.driver.quit()


class Stage(Page):
    """The page as it was built, and in place of a rover the messages that a test has it hear: states that no simulator reaches soon."""

    def __init__(self):
        files = {"/parameters.json": DESCRIPTIONS}
        super().__init__("about:blank", script=STAGE + f"window.files = {json.dumps(files)};")

    def start(self, parameters=(), size=PHONE, script=""):
        """Opens the page, where `script` runs before it; of a rover that has these parameters, if there are any."""
        self.sender = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
        # Not only another fragment of the same page.
        self.driver.get("about:blank")
        added = self.devtools("Page.addScriptToEvaluateOnNewDocument", source=script)
        self.driver.get((REPOSITORY / "web" / "page.html").as_uri())
        self.devtools("Page.removeScriptToEvaluateOnNewDocument", **added)
        # Another process has no emulation of touch yet.
        self.resize(size)
        self.wait(lambda: self.run("return !!window.telling"))
        version = dialect.MAVLink_autopilot_version_message(0, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0x0A2C)
        self.state("version", version)
        self.drive(False)
        self.ready(True)
        if parameters:
            self.parameters(parameters)
        return self

    def hear(self, *messages):
        for message in messages:
            self.run("window.hear(arguments[0])", list(message.pack(self.sender)))

    def state(self, key, message):
        self.run("window.state[arguments[0]] = arguments[1]; window.hear(arguments[1])", key, list(message.pack(self.sender)))

    def drive(self, is_armed, mode=0, status=4):
        self.state("heartbeat", dialect.MAVLink_heartbeat_message(10, 3, 81 + 128 * is_armed, mode, status, 3))

    def ready(self, is_ready):
        self.state("status", dialect.MAVLink_sys_status_message(0, 0, is_ready << 28, *[0] * 10))

    def announce(self, text, severity=4):
        self.hear(dialect.MAVLink_statustext_message(severity, text.encode(), 0, 0))

    def pack(self, number=1, charge_state=1, volts=12.0, amps=-0.01, percent=80, drawn=-1, left=0, celsius=327.67):
        cells = [65535 if volts is None else round(volts * 1000), *[65535] * 9]
        status = (number - 1, 0, 1, round(celsius * 100), cells, round(amps * 100), drawn, -1, percent, left, charge_state, [0] * 4)
        self.state(f"pack {number}", dialect.MAVLink_battery_status_message(*status))

    def info(self, number=1, cells=3, chemistry=1, design_ah=3.3, full_ah=float("nan"), health=255):
        """BATTERY_INFO, which pymavlink 2.4.50 does not know."""
        payload = bytearray(140)
        struct.pack_into("<ff", payload, 32, design_ah, full_ah)
        payload[44:49] = bytes([number - 1, 0, chemistry, health, cells])
        head = bytes([len(payload), 0, 0, 0, 1, 1, *(372).to_bytes(3, "little")])
        checksum = x25crc(head + payload + bytes([26])).crc
        self.run("window.hear(arguments[0])", [0xFD, *head, *payload, checksum & 255, checksum >> 8])

    def value(self, name, value):
        self.hear(dialect.MAVLink_named_value_float_message(0, name.encode(), value))

    def parameters(self, values):
        """The whole list: these, and of the first pack those that a rover has by default."""
        described = DESCRIPTIONS["parameters"]
        packs = {name.split("_")[0] for name, value in values.items() if name.startswith("BATT") and (name[-7:], value) != ("MONITOR", 0)} | {"BATT"}
        values = {
            **{one["name"].replace("BATT", pack): one["default"] for one in described if one["name"].startswith("BATT_") for pack in packs},
            "SIGN_WIFI_ALLOW": 0,
            **values,
        }
        self.hear(*(dialect.MAVLink_param_value_message(name.encode(), value, 9, len(values), index) for index, (name, value) in enumerate(values.items())))


class Way:
    """One direction of a network."""

    def __init__(self):
        # Set while bytes go through; until then they wait.
        self.is_open = threading.Event()
        self.delay_s = 0
        # What becomes of the bytes on it.
        self.change = lambda data: data


class Network:
    """What is between a browser and the rover: it can be cut or slow, in one direction or both, without a word to either end."""

    def __init__(self, port):
        self.port_there = port
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.up, self.down = Way(), Way()
        # Raised when the connections so far are lost.
        self.generation = 0
        self.mend()
        threading.Thread(target=self.accept, daemon=True).start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                here, _ = self.listener.accept()
                try:
                    there = socket.create_connection(("127.0.0.1", self.port_there))
                except OSError:
                    here.close()
                    continue
                for source, sink, way in ((here, there, self.up), (there, here, self.down)):
                    waiting = queue.Queue()
                    threading.Thread(target=self.take, args=(source, waiting, way), daemon=True).start()
                    threading.Thread(target=self.bring, args=(waiting, source, sink, way, self.generation), daemon=True).start()

    @staticmethod
    def take(source, waiting, way):
        with contextlib.suppress(OSError):
            while data := source.recv(4096):
                waiting.put((time.monotonic() + way.delay_s, data))
        waiting.put(None)

    def bring(self, waiting, source, sink, way, generation):
        with contextlib.suppress(OSError):
            while packet := waiting.get():
                due, data = packet
                time.sleep(max(0, due - time.monotonic()))
                way.is_open.wait()
                if generation == self.generation:
                    sink.sendall(way.change(data))
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def cut(self):
        self.up.is_open.clear()
        self.down.is_open.clear()

    def mute(self):
        """The rover hears, and is not heard."""
        self.down.is_open.clear()

    def deafen(self):
        """The rover is heard, and hears nothing."""
        self.up.is_open.clear()

    def mend(self):
        """What has waited arrives."""
        self.up.is_open.set()
        self.down.is_open.set()

    def lose(self):
        """Connections end here: nothing that waits ever arrives, and neither end learns it."""
        self.cut()
        self.generation += 1

    def lead_to(self, port):
        """The next network has the same address."""
        self.lose()
        self.port_there = port
        self.mend()

    def close(self):
        self.mend()
        self.listener.close()


AUTOPILOT_VERSION = 148
SIGNED = 1


def with_board_id(board_id, key=b""):
    """A change of what comes from a rover: its AUTOPILOT_VERSION has this id of the board, or is damaged. With a key it is signed."""

    def changed(frame, length):
        payload = frame[10 : 10 + length]
        payload = payload[:8] + (board_id or 0).to_bytes(8, "little") + payload[16:]
        checksum = x25crc(frame[1:10] + payload + bytes([mavlink_map[AUTOPILOT_VERSION].crc_extra])).crc
        if board_id is None:
            checksum ^= 1
        rest = frame[12 + length :]
        frame = frame[:10] + payload + checksum.to_bytes(2, "little") + rest[:7]
        return frame + hashlib.sha256(key + frame).digest()[:6] if rest else frame

    def change(data):
        at = 0
        while (at := data.find(b"\xfd", at)) >= 0:
            length, flags = data[at + 1 : at + 3] if at + 3 <= len(data) else (0, 0)
            end = at + 12 + length + 13 * (flags & SIGNED)
            if data[at + 7 : at + 10] == AUTOPILOT_VERSION.to_bytes(3, "little") and end <= len(data):
                data = data[:at] + changed(data[at:end], length) + data[end:]
            at += 1
        return data

    return change


FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")


class Firefox:
    """The page in a headless Firefox, by the protocol that it speaks itself, WebDriver BiDi."""

    def __init__(self, url, profile):
        import websocket

        self.process = subprocess.Popen(
            [FIREFOX, "--headless", "--no-remote", "--profile", str(profile), "--remote-debugging-port", "0"],
            stderr=subprocess.PIPE,
            text=True,
        )
        for line in self.process.stderr:
            if found := re.search(r"ws://\S+", line):
                break
        threading.Thread(target=self.process.stderr.read, daemon=True).start()
        self.socket = websocket.create_connection(found[0] + "/session", suppress_origin=True, timeout=60)
        self.count = 0
        self.logged = []
        self.send("session.new", capabilities={})
        self.send("session.subscribe", events=["log.entryAdded"])
        # The first tab never gets the focus, as there is no person in front of it.
        self.context = self.send("browsingContext.create", type="tab")["context"]
        self.send("browsingContext.setViewport", context=self.context, viewport={"width": DESKTOP[0], "height": DESKTOP[1]})
        self.send("browsingContext.activate", context=self.context)
        self.send("browsingContext.navigate", context=self.context, url=url, wait="complete")

    def send(self, method, **parameters):
        self.count += 1
        self.socket.send(json.dumps({"id": self.count, "method": method, "params": parameters}))
        while (answer := json.loads(self.socket.recv())).get("id") != self.count:
            if answer.get("method") == "log.entryAdded":
                self.logged.append(answer["params"])
        assert answer["type"] == "success", answer
        return answer["result"]

    def run(self, expression):
        answer = self.send(
            "script.evaluate", expression=f"JSON.stringify({expression})", target={"context": self.context}, awaitPromise=True
        )
        assert answer["type"] == "success", answer
        return json.loads(answer["result"].get("value", "null"))

    def text(self):
        return self.run("document.body.innerText")

    def wait_for(self, text, seconds=10):
        end = time.monotonic() + seconds
        while text not in (shown := self.text()):
            assert time.monotonic() < end, shown
            time.sleep(0.1)

    def enter(self, room):
        self.run(f"document.querySelector('nav a[href=\"#{room}\"]').click()")

    def pointer(self, *actions, kind="mouse"):
        """Actions of a mouse, or another kind of pointer: ("move", x, y), "down", "up", or a pause in seconds."""
        steps = []
        for action in actions:
            if action in ("down", "up"):
                steps.append({"type": f"pointer{action.capitalize()}", "button": 0})
            elif isinstance(action, tuple):
                steps.append({"type": "pointerMove", "x": round(action[1]), "y": round(action[2])})
            else:
                steps.append({"type": "pause", "duration": round(action * 1000)})
        source = {"type": "pointer", "id": kind, "parameters": {"pointerType": kind}, "actions": steps}
        self.send("input.performActions", context=self.context, actions=[source])

    def middle(self, css):
        return self.run(f"(({{ left, top, width, height }}) => [left + width / 2, top + height / 2])(document.querySelector('{css}').getBoundingClientRect())")

    def errors(self):
        return [entry["text"] for entry in self.logged if entry["level"] in ("error", "warn")]

    def picture(self, path):
        data = self.send("browsingContext.captureScreenshot", context=self.context)["data"]
        pathlib.Path(path).write_bytes(base64.b64decode(data))

    def close(self):
        self.process.terminate()
        self.process.wait(timeout=20)
