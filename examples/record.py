#!/usr/bin/env python3
"""Makes a recording for `replay` of a ground station's log, or of a link until Ctrl-C: the first pack of any autopilot.

    record.py mav.tlog drive.csv
    record.py tcp:127.0.0.1:5760 drive.csv
    record.py /dev/ttyACM0 drive.csv

Needs pymavlink.
"""

import argparse
import csv
import os

# pymavlink reads this when it is imported.
os.environ["MAVLINK20"] = "1"

from pymavlink import mavutil  # noqa: E402

ROVER = mavutil.mavlink.MAV_TYPE_GROUND_ROVER
ARMED = mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
FIRST_PACK = 0
# MAVLink's values for what is unknown or not used.
VOLTAGE_UNKNOWN_MV = 0xFFFF
CURRENT_UNKNOWN = -1


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", help="log of a ground station, serial port, or as tcp:127.0.0.1:5760")
    parser.add_argument("recording", help="CSV file to write")
    parser.add_argument("--baud", type=int, default=115200, help="of a serial port")
    return parser.parse_args()


def messages_of(source, baud):
    """The messages of a log to its end, or of a link."""
    is_link = not os.path.isfile(source)
    connection = mavutil.mavlink_connection(source, baud=baud)
    while message := connection.recv_match(type=["HEARTBEAT", "BATTERY_STATUS"], blocking=is_link):
        yield message


def rows_of(messages):
    """A row for each report of the pack. What is unknown is left empty."""
    start_s, armed = None, 0
    for message in messages:
        if message.get_type() == "HEARTBEAT":
            # Ground stations have heartbeats, too.
            armed = int(message.base_mode & ARMED != 0) if message.type == ROVER else armed
        elif message.id == FIRST_PACK:
            start_s = start_s or message._timestamp
            volts = sum(mv for mv in message.voltages if mv != VOLTAGE_UNKNOWN_MV) / 1000
            amperes = "" if message.current_battery == CURRENT_UNKNOWN else message.current_battery / 100
            yield f"{message._timestamp - start_s:.3f}", volts or "", amperes, armed


def main():
    chosen = arguments()
    with open(chosen.recording, "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["t_s", "voltage_v", "current_a", "armed"])
        try:
            rows.writerows(rows_of(messages_of(chosen.source, chosen.baud)))
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    main()
