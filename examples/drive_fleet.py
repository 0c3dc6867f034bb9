#!/usr/bin/env python3
"""Drives every rover that is heard at a UDP port at once, wheels up or simulated, so that each records a drive with a date.

    cargo run -- --rovers 30 --log drives
    python examples/drive_fleet.py --rovers 30
"""

import argparse
import os
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

mavlink = mavutil.mavlink
EVERY = 0
MANUAL = 0
NEUTRAL_US, AHEAD_US, UNCHANGED = 1500, 1650, 65535


class Fleet:
    """All rovers at one port: what is sent goes to each of them."""

    def __init__(self, link):
        self.link = link
        self.armed = {}

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
                    self.armed[heartbeat.get_srcSystem()] = bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def command(self, number, *parameters):
        self.link.mav.command_long_send(EVERY, 1, number, 0, *parameters, *[0] * (7 - len(parameters)))

    def arm(self, wanted, rovers):
        for _ in range(60):
            if len(self.armed) >= rovers and all(armed == wanted for armed in self.armed.values()):
                return
            if len(self.armed) >= rovers:
                self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, wanted)
            self.run(1)
        raise SystemExit(f"{sum(self.armed.values())} of {len(self.armed)} rovers are armed, {rovers} were expected")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--link", default="udpin:0.0.0.0:14550", help="where they are heard")
    parser.add_argument("--rovers", type=int, required=True, help="how many there are")
    parser.add_argument("--seconds", type=float, default=20, help="how long each drives")
    arguments = parser.parse_args()
    fleet = Fleet(mavutil.mavlink_connection(arguments.link, source_system=255))
    fleet.arm(True, arguments.rovers)
    fleet.command(mavlink.MAV_CMD_DO_SET_MODE, 1, MANUAL)
    fleet.run(1, NEUTRAL_US)
    fleet.run(arguments.seconds, AHEAD_US)
    fleet.run(1, NEUTRAL_US)
    fleet.arm(False, arguments.rovers)
    print(f"{len(fleet.armed)} rovers have recorded a drive")


if __name__ == "__main__":
    main()
