#!/usr/bin/env python3
"""Has a rover with a Pico W join a router's network, or gives the rover's own network another password.

    wifi_config.py "my network"                join this network
    wifi_config.py --own                       set the password of the rover's own network
    wifi_config.py "my network" --link COM5    at another serial port

The password is asked for. By USB, while disarmed. Needs pymavlink.

Exit codes: 0; 1 if the rover refuses, or does not join the network; 2 if it could not be asked.
"""

import argparse
import getpass
import os
import struct
import sys
import time

# pymavlink reads this when it is imported: the message needs MAVLink 2.
os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil  # noqa: E402

ACCESS_POINT, STATION = 1, 2
ACCEPTED = 1
RESPONSES = {
    ACCEPTED: "accepted",
    2: "refused: armed",
    3: "refused: no radio, or no such mode",
    4: "refused: bad name",
    5: "refused: bad password",
}
# The response is behind the header, the name, the password and the mode.
RESPONSE_AT = 10 + 97
# Otherwise pymavlink cuts them off, and the rover has to refuse the rest.
MOST_NAME_BYTES, MOST_PASSWORD_BYTES = 32, 63
HEARTBEAT_TIMEOUT_S = 10
ANSWER_TIMEOUT_S = 5
# The rover looks for a network for a minute.
ADDRESS_TIMEOUT_S = 70


class Failure(Exception):
    """What was not possible, and the exit code."""


class WifiConfigAp(mavutil.mavlink.MAVLink_wifi_config_ap_message):
    """With the mode, which pymavlink 2.4.50 leaves out."""

    def __init__(self, name, password, mode):
        super().__init__(name.encode(), password.encode())
        self.mode = mode

    def pack(self, mav, force_mavlink1=False):
        payload = struct.pack("<32s64sB", self._ssid_raw, self._password_raw, self.mode)
        return self._pack(mav, self.crc_extra, payload)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    network = parser.add_mutually_exclusive_group(required=True)
    network.add_argument("name", nargs="?", help="of the router's network")
    network.add_argument("--own", action="store_true", help="the rover's own network, instead of a router's")
    parser.add_argument("--link", default="/dev/ttyACM0", help="serial port, or as tcp:127.0.0.1:5760")
    chosen = parser.parse_args()
    if not chosen.own and not 1 <= len(chosen.name.encode()) <= MOST_NAME_BYTES:
        parser.error(f"a name has 1 to {MOST_NAME_BYTES} bytes, this one {len(chosen.name.encode())}")
    return chosen


def asked_password():
    """Raises Failure."""
    try:
        password = getpass.getpass("Password: ") if sys.stdin.isatty() else sys.stdin.readline().rstrip("\n")
    except EOFError as error:
        raise Failure("no password", 2) from error
    if len(password.encode()) > MOST_PASSWORD_BYTES:
        raise Failure(f"a password has {MOST_PASSWORD_BYTES} bytes at most, this one {len(password.encode())}", 2)
    return password


def closed():
    raise ConnectionError("the connection was closed")


def connected(device):
    """A link on which a rover is heard. Raises Failure."""
    if os.path.isfile(device):
        raise Failure(f"Can't open {device}: it is a file", 2)
    try:
        rover = mavutil.mavlink_connection(device, retries=1)
    except Exception as error:
        # Each kind of link has errors of its own.
        raise Failure(f"Can't open {device}: {error}", 2) from error
    # Otherwise pymavlink prints each time that it reads the end of a TCP connection, and goes on.
    rover.handle_eof = closed
    end = time.monotonic() + HEARTBEAT_TIMEOUT_S
    while time.monotonic() < end:
        # By UDP the rover may look for any station.
        rover.mav.heartbeat_send(mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)
        if rover.wait_heartbeat(timeout=1):
            return rover
    raise Failure(f"No rover at {device}.", 2)


def response_to(rover, message):
    """The rover's response, or `None` if it gives none."""
    rover.mav.send(message)
    answer = rover.recv_match(type="WIFI_CONFIG_AP", blocking=True, timeout=ANSWER_TIMEOUT_S)
    return answer and answer.get_msgbuf()[RESPONSE_AT]


def has_joined(rover):
    """Prints what the rover says of its Wi-Fi until it announces an address, or has not joined."""
    end = time.monotonic() + ADDRESS_TIMEOUT_S
    while (left_s := end - time.monotonic()) > 0:
        message = rover.recv_match(type="STATUSTEXT", blocking=True, timeout=left_s)
        if message and "Wi-Fi" in message.text:
            print(message.text, flush=True)
            if message.text.startswith("Wi-Fi address"):
                return True
            if message.text.endswith("access point instead"):
                return False
    return False


def configure(chosen):
    """Raises Failure, and OSError if the link is lost."""
    password = asked_password()
    rover = connected(chosen.link)
    mode = ACCESS_POINT if chosen.own else STATION
    response = response_to(rover, WifiConfigAp(chosen.name or "", password, mode))
    if response != ACCEPTED:
        raise Failure("no answer" if response is None else RESPONSES.get(response, f"refused: {response}"), 1)
    print(RESPONSES[ACCEPTED], flush=True)
    if mode == STATION and not has_joined(rover):
        raise Failure("The rover has not joined the network.", 1)


def main():
    chosen = arguments()
    try:
        configure(chosen)
    except Failure as failure:
        text, code = failure.args
        print(text, file=sys.stderr)
        return code
    except OSError as error:
        print(f"The rover is lost: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(1)
