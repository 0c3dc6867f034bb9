"""Draws docs/pictures/mavproxy.svg: the README's session of MAVProxy with the simulator, as a terminal shows it.

    target/gcs-venv/bin/python tests/gcs/draw_mavproxy.py

MAVProxy runs on a terminal of its own, the commands of the page are typed, and what the terminal shows then is what is drawn.
Lines are left out or cut only where an ellipsis says so.
"""

import fcntl
import html
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from importlib.metadata import version

from conftest import MAVPROXY, REPOSITORY, Simulator
from sessions import SECTION, like, session_of

PICTURE = REPOSITORY / "docs/pictures/mavproxy.svg"

# What is typed, and what MAVProxy has to say before the next line is.
SESSION = [
    (typed, like(shown[-1]) if shown else None)
    for typed, shown in session_of((REPOSITORY / "README.md").read_text(encoding="utf-8"), SECTION)
]

# The pack with which the page starts the simulator.
PACK = ["--pack", "2s-18650"]

# So long nothing more may come before the next line is typed.
QUIET_S = 1.5
TIMEOUT_S = 40

# What is drawn of what MAVProxy says while it starts.
OF_THE_START = re.compile(r"^Connect |^online|^AP: |parameters")

ELLIPSIS = "…"

ESCAPE = re.compile(r"\x1b(\[[0-9;?]*[A-Za-z]|\][^\x07]*\x07|[=>])")
PROMPT = re.compile(r"^([A-Z]*> |\$ )")

# Of a character and of a line, in pixels.
WIDTH = 8.4
HEIGHT = 19
COLUMNS = 104
MARGIN = 16
TITLE_HEIGHT = 34

SHEET = "#1d2129"
TITLE_BAR = "#343b47"
TEXT = "#d5dae2"
PROMPT_TEXT = "#7ec699"
TYPED_TEXT = "#ffffff"
VEHICLE_TEXT = "#f0c674"
FAINT_TEXT = "#9aa4b5"


class Terminal:
    """A program on a terminal that is wide enough to wrap nothing."""

    def __init__(self, arguments, home):
        ours, its = pty.openpty()
        fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 200, 2000, 0, 0))
        self.shown = ""
        self.last_s = time.monotonic()
        self.ours = ours
        self.process = subprocess.Popen(
            arguments,
            cwd=home,
            # No start-up script of the user's, and no colours.
            env={**os.environ, "HOME": str(home), "TERM": "dumb", "PYTHONUNBUFFERED": "1"},
            stdin=its,
            stdout=its,
            stderr=its,
            start_new_session=True,
        )
        os.close(its)
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        while True:
            try:
                data = os.read(self.ours, 4096)
            except OSError:  # It has ended.
                return
            self.shown += data.decode(errors="replace")
            self.last_s = time.monotonic()

    def wait_for(self, pattern, since=0):
        """Waits until it has shown the pattern and been quiet for a while."""
        end = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end:
            said = pattern is None or re.search(pattern, "\n".join(lines_of(self.shown[since:])), re.MULTILINE)
            if said and time.monotonic() - self.last_s > QUIET_S:
                return
            time.sleep(0.05)
        raise AssertionError(f"it never showed {pattern}, but:\n{self.shown[since:]}")

    def type(self, line, pattern):
        """Types a line behind a prompt and waits for what it brings about."""
        if not PROMPT.search(lines_of(self.shown)[-1]):
            # What came meanwhile has pushed the prompt away: Enter brings it back.
            self.enter("", PROMPT.pattern)
        self.enter(line, pattern)

    def enter(self, line, pattern):
        since = len(self.shown)
        os.write(self.ours, line.encode() + b"\n")
        self.last_s = time.monotonic()
        self.wait_for(pattern, since)

    def kill(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


def lines_of(shown):
    """The lines as they stand on the screen: what a carriage return goes back over is overwritten."""
    lines = []
    for line in ESCAPE.sub("", shown).replace("\r\n", "\n").split("\n"):
        screen = ""
        for part in line.split("\r"):
            screen = part + screen[len(part) :]
        lines.append(screen)
    return lines


def record(port=None):
    """Runs the session with the simulator on this port or a free one; returns the lines of the terminal."""
    simulator = Simulator(*PACK, port=port)
    with tempfile.TemporaryDirectory() as home:
        terminal = Terminal([sys.executable, str(MAVPROXY), "--master", simulator.url], home)
        try:
            terminal.wait_for(r"Saved \d+ parameters")
            started = len(lines_of(terminal.shown))
            for line, pattern in SESSION:
                terminal.type(line, pattern)
        finally:
            terminal.kill()
            simulator.kill()
    lines = lines_of(terminal.shown)
    # The picture ends with the last answer, not with lines that wait for more.
    last = max(number for number, line in enumerate(lines) if PROMPT.sub("", line))
    command = f"$ mavproxy.py --master {simulator.url}"
    return [command, *essence(lines[:started]), *lines[started : last + 1]]


def essence(lines):
    """What is drawn of the start: an ellipsis stands for each run of lines that are not."""
    essential = []
    for line in lines:
        if OF_THE_START.search(line):
            essential.append(line)
        elif line and essential[-1:] != [ELLIPSIS]:
            essential.append(ELLIPSIS)
    return essential


def rows_of(line):
    """The rows a line takes on the picture's terminal."""
    return [line[at : at + COLUMNS] for at in range(0, len(line), COLUMNS)] or [""]


def runs_of(row):
    """The pieces of a row, each with its column and colour."""
    prompt = PROMPT.match(row)
    begin = prompt.end() if prompt else 0
    rest = row[begin:]
    if rest.startswith("mavproxy.py") or any(rest == typed for typed, _ in SESSION):
        colour = TYPED_TEXT
    elif rest.startswith("AP: "):
        colour = VEHICLE_TEXT
    elif rest == ELLIPSIS:
        colour = FAINT_TEXT
    else:
        colour = TEXT
    return [run for run in [(0, PROMPT_TEXT, row[:begin]), (begin, colour, rest)] if run[2].strip()]


def draw(lines, title):
    """The lines as an SVG picture of a terminal."""
    rows = [row for line in lines for row in rows_of(line)]
    width = 2 * MARGIN + COLUMNS * WIDTH
    height = TITLE_HEIGHT + 2 * MARGIN + len(rows) * HEIGHT
    svg = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height}" viewBox="0 0 {width:.0f} {height}" '
        'font-family="monospace" font-size="14">',
        f"<title>{html.escape(title)}</title>",
        f'<rect width="100%" height="100%" rx="8" fill="{SHEET}"/>',
        f'<path d="M0 {TITLE_HEIGHT}V8a8 8 0 0 1 8-8h{width - 16:.0f}a8 8 0 0 1 8 8v{TITLE_HEIGHT - 8}z" fill="{TITLE_BAR}"/>',
        f'<text x="{width / 2:.0f}" y="22" text-anchor="middle" fill="{FAINT_TEXT}">{html.escape(title)}</text>',
    ]
    for number, row in enumerate(rows):
        y = TITLE_HEIGHT + MARGIN + (number + 0.75) * HEIGHT
        for column, colour, text in runs_of(row):
            # The length is given, so that columns stay columns in whatever font there is.
            svg.append(
                f'<text x="{MARGIN + column * WIDTH:.1f}" y="{y:.1f}" fill="{colour}" xml:space="preserve" '
                f'textLength="{len(text) * WIDTH:.1f}" lengthAdjust="spacingAndGlyphs">{html.escape(text)}</text>'
            )
    return "\n".join([*svg, "</svg>", ""])


def main():
    title = f"MAVProxy {version('mavproxy')} and the simulator (cargo run -- {' '.join(PACK)})"
    PICTURE.parent.mkdir(exist_ok=True)
    # The simulator's default port.
    PICTURE.write_text(draw(record(5760), title))


if __name__ == "__main__":
    main()
