#!/usr/bin/env python3
"""Drives every rover that is heard at a UDP port at once, wheels up or simulated, so that each records a drive with a date.

    cargo run -- --rovers 30 --log drives
    python examples/drive_fleet.py --rovers 30

Whatever ends it (Ctrl-C, too), all rovers are stopped and disarmed first. Exit codes: 0; 1 if a rover did not arm, drive to
the end or disarm; 2 if they were not all heard.
"""

import argparse
import math
import os
import signal
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

mavlink = mavutil.mavlink
EVERY = 0
MANUAL = 0
NEUTRAL_US, AHEAD_US, UNCHANGED = 1500, 1650, 65535
FIND_TIMEOUT_S = 60
ARM_TIMEOUT_S = 20
DISARM_TIMEOUT_S = 10
# A heartbeat may have been on its way when a command was sent, and the command in a queue.
SETTLE_S = 1.5


class Failure(Exception):
    """What did not go as planned, and the exit code."""


class Fleet:
    """All rovers at one port: what is sent goes to each of them."""

    def __init__(self, link, rovers):
        self.link = link
        self.rovers = rovers
        self.armed = {}
        self.heard_at = {}

    def run(self, seconds, throttle_us=None):
        """Ten times a second what a driver sends; notes who is armed."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.link.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
            self.link.mav.system_time_send(int(time.time() * 1e6), 0)
            if throttle_us:
                self.link.mav.rc_channels_override_send(EVERY, 1, NEUTRAL_US, UNCHANGED, throttle_us, *[UNCHANGED] * 5)
            until = time.monotonic() + 0.1
            while (left := until - time.monotonic()) > 0:
                heartbeat = self.link.recv_match(type="HEARTBEAT", blocking=True, timeout=left)
                if heartbeat and heartbeat.autopilot != mavlink.MAV_AUTOPILOT_INVALID:
                    rover = heartbeat.get_srcSystem()
                    self.armed[rover] = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                    self.heard_at[rover] = time.monotonic()

    def command(self, number, *parameters):
        self.link.mav.command_long_send(EVERY, 1, number, 0, *parameters, *[0] * (7 - len(parameters)))

    def find(self):
        end = time.monotonic() + FIND_TIMEOUT_S
        while len(self.armed) < self.rovers:
            if time.monotonic() > end:
                raise Failure(f"{len(self.armed)} of {self.rovers} rovers were heard", 2)
            self.run(1)

    def arm(self):
        end = time.monotonic() + ARM_TIMEOUT_S
        while not all(self.armed.values()):
            if time.monotonic() > end:
                raise Failure(f"not armed: {names(rover for rover, armed in self.armed.items() if not armed)}", 1)
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)
            self.run(1)

    def disarm(self):
        """Stops all rovers until each has said that it is not armed; returns those that have not."""
        begin = time.monotonic()
        while self.left_armed(begin) and time.monotonic() < begin + DISARM_TIMEOUT_S:
            try:
                self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0)
                self.run(0.5, NEUTRAL_US)
            except OSError:
                # The link may come back.
                time.sleep(0.5)
        return self.left_armed(begin)

    def left_armed(self, since):
        """Rovers without a later heartbeat of one that is not armed."""
        return [rover for rover, armed in self.armed.items() if armed or self.heard_at[rover] < since + SETTLE_S]

    def drive(self, seconds):
        self.find()
        self.arm()
        self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, MANUAL)
        self.run(1, NEUTRAL_US)
        self.run(seconds, AHEAD_US)
        self.run(1, NEUTRAL_US)


def names(rovers):
    return ", ".join(f"rover {rover}" for rover in sorted(rovers))


def drive(fleet, seconds):
    """Returns the exit code."""
    code = 1
    try:
        fleet.drive(seconds)
        code = 0
    except Failure as failure:
        text, code = failure.args
        print(text, file=sys.stderr)
    except OSError as error:
        print(f"The link is lost: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("Interrupted.", file=sys.stderr)
    finally:
        ignore_signals()
        left = fleet.disarm()
    if left:
        print(f"STILL ARMED, or not heard any more: {names(left)}", file=sys.stderr)
        return 1
    if code == 0:
        print(f"{len(fleet.armed)} rovers have recorded a drive")
    return code


# Ctrl-C, and where there is one the end of the terminal.
SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


def ignore_signals():
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def interrupt(*_):
    """Once: who presses Ctrl-C again would leave rovers armed, and has to wait for ten seconds at most."""
    ignore_signals()
    raise KeyboardInterrupt


def count(text):
    if not 1 <= int(text) <= 255:
        raise argparse.ArgumentTypeError("1 to 255")
    return int(text)


def duration(text):
    if not 0 < float(text) < math.inf:
        raise argparse.ArgumentTypeError("more than 0 s")
    return float(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--link", default="udpin:0.0.0.0:14550", help="where they are heard")
    parser.add_argument("--rovers", type=count, required=True, help="how many there are")
    parser.add_argument("--seconds", type=duration, default=20, help="how long each drives")
    arguments = parser.parse_args()
    for number in SIGNALS:
        signal.signal(number, interrupt)
    try:
        link = mavutil.mavlink_connection(arguments.link, source_system=255)
    except Exception as error:
        # Each kind of link has errors of its own.
        print(f"Can't open {arguments.link}: {error}", file=sys.stderr)
        return 2
    return drive(Fleet(link, arguments.rovers), arguments.seconds)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(1)
