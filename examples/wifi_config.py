#!/usr/bin/env python3
"""Has a rover with a Pico W join a router's network, or gives the rover's own network another password.

    wifi_config.py "my network"                join this network
    wifi_config.py --own                       set the password of the rover's own network
    wifi_config.py "my network" --link COM5    at another serial port

The password is asked for. By USB, while disarmed. Needs pymavlink.
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
HEARTBEAT_TIMEOUT_S = 10
ANSWER_TIMEOUT_S = 5
# The rover looks for a network for a minute.
ADDRESS_TIMEOUT_S = 70


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
    return parser.parse_args()


def response_to(rover, message):
    """The rover's response, or `None` if it gives none."""
    rover.mav.send(message)
    answer = rover.recv_match(type="WIFI_CONFIG_AP", blocking=True, timeout=ANSWER_TIMEOUT_S)
    return answer and answer.get_msgbuf()[RESPONSE_AT]


def print_address(rover):
    """Prints the address that the rover announces, or that it has not joined."""
    end = time.monotonic() + ADDRESS_TIMEOUT_S
    while (left_s := end - time.monotonic()) > 0:
        message = rover.recv_match(type="STATUSTEXT", blocking=True, timeout=left_s)
        if message and "Wi-Fi" in message.text:
            print(message.text)
            return


def main():
    chosen = arguments()
    password = getpass.getpass("Password: ") if sys.stdin.isatty() else sys.stdin.readline().rstrip("\n")
    rover = mavutil.mavlink_connection(chosen.link)
    if not rover.wait_heartbeat(timeout=HEARTBEAT_TIMEOUT_S):
        sys.exit(f"No rover at {chosen.link}.")
    mode = ACCESS_POINT if chosen.own else STATION
    response = response_to(rover, WifiConfigAp(chosen.name or "", password, mode))
    if response != ACCEPTED:
        sys.exit("no answer" if response is None else RESPONSES.get(response, f"refused: {response}"))
    print(RESPONSES[ACCEPTED])
    if mode == STATION:
        print_address(rover)


if __name__ == "__main__":
    main()
