"""A ground station for the tests, made of pymavlink."""

import math
import threading
import time

from pymavlink import mavutil

mavlink = mavutil.mavlink

# Wall time on a shared machine is not exact.
RATE_TOLERANCE = 0.15


def connect(url):
    connection = opened(url)
    assert connection.wait_heartbeat(timeout=10) is not None, f"no heartbeat on {url}"
    return connection


def opened(url, seconds=10):
    """The connection. A port over USB is missing while its board restarts."""
    end = time.monotonic() + seconds
    while True:
        try:
            return mavutil.mavlink_connection(url, source_system=255)
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.2)


def receive(connection, names, timeout=3):
    message = connection.recv_match(type=names, blocking=True, timeout=timeout)
    assert message is not None, f"no {names} came"
    return message


def messages_of(connection, seconds):
    """Everything that comes within the given time from now on."""
    while connection.recv_match(blocking=False):
        pass
    return unread_messages_of(connection, seconds)


def unread_messages_of(connection, seconds):
    """What has come and was not read yet, and everything that comes within the given time."""
    messages = []
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        message = connection.recv_match(blocking=True, timeout=left)
        if message is not None:
            messages.append(message)
    return messages


def rate_of(connection, name, seconds=4):
    return count(messages_of(connection, seconds), name) / seconds


def count(messages, name):
    return sum(message.get_type() == name for message in messages)


def is_about(hertz, expected):
    return abs(hertz - expected) <= RATE_TOLERANCE * expected


def read(connection, name):
    connection.mav.param_request_read_send(1, 1, name.encode(), -1)
    return answer_about(connection, name)


def set_to(connection, name, value):
    connection.param_set_send(name, value)
    return answer_about(connection, name)


def answer_about(connection, name):
    """What other stations change comes in between."""
    while (answer := receive(connection, ["PARAM_VALUE", "PARAM_ERROR"])).param_id != name:
        pass
    return answer


def read_list(connection):
    """What is listed: value by name, in the order of the indices."""
    # pymavlink's own param_fetch_all does nothing when it is called twice within two seconds.
    connection.mav.param_request_list_send(1, 1)
    listed = {}
    first = receive(connection, ["PARAM_VALUE"])
    listed[first.param_index] = first
    while len(listed) < first.param_count:
        message = receive(connection, ["PARAM_VALUE"])
        assert message.param_index not in listed
        listed[message.param_index] = message
    assert sorted(listed) == list(range(first.param_count))
    return {listed[index].param_id: listed[index].param_value for index in sorted(listed)}


def say_time(connection):
    """A ground station says what time it is."""
    gcs, none = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
    connection.mav.heartbeat_send(gcs, none, 0, 0, mavlink.MAV_STATE_ACTIVE)
    connection.mav.system_time_send(int(time.time() * 1e6), 0)


def command(connection, number, *parameters):
    """Sends a COMMAND_LONG, what isn't given NaN as MAVSDK does, and returns the result."""
    parameters = list(parameters) + [math.nan] * (7 - len(parameters))
    connection.mav.command_long_send(1, 1, number, 0, *parameters)
    return result_of(connection, number)


def command_int(connection, number, *parameters):
    parameters = list(parameters) + [math.nan] * (4 - len(parameters))
    frame = mavlink.MAV_FRAME_GLOBAL
    connection.mav.command_int_send(1, 1, frame, number, 0, 0, *parameters, 0, 0, 0)
    return result_of(connection, number)


def result_of(connection, number):
    ack = receive(connection, ["COMMAND_ACK"])
    assert ack.command == number
    return ack.result


def fresh(connection, name):
    """A message as the vehicle builds it now: it is asked for, so none that was sent before is taken for it."""
    number = getattr(mavlink, f"MAVLINK_MSG_ID_{name}")
    assert command(connection, mavlink.MAV_CMD_REQUEST_MESSAGE, number) == mavlink.MAV_RESULT_ACCEPTED
    return receive(connection, [name])


def restarted(connection, url):
    """A connection to the vehicle once it has restarted."""
    assert command(connection, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mavlink.MAV_RESULT_ACCEPTED
    while connection.recv_match(blocking=True, timeout=0.5) is not None:
        pass
    connection.close()
    return connect(url)


def knows_its_voltage(status):
    return status.voltages[0] != 65535


def pack(connection, instance, is_known=knows_its_voltage):
    """The pack's BATTERY_STATUS once its sensor has delivered a reading."""
    request, message = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
    for _ in range(20):
        assert command(connection, request, message, instance) == mavlink.MAV_RESULT_ACCEPTED
        status = receive(connection, ["BATTERY_STATUS"])
        if status.id == instance and is_known(status):
            return status
    raise AssertionError(f"pack {instance} never reported a reading: {status}")


def volts(status):
    """The pack's voltage, of a BATTERY_STATUS."""
    return sum(mv for mv in status.voltages if mv != 65535) / 1000


def sticks(url, throttle, steering=0):
    """Stick input on a connection of its own; each call sends MANUAL_CONTROL once and waits a little."""
    connection = mavutil.mavlink_connection(url, source_system=254)

    def send():
        connection.mav.manual_control_send(1, 0, steering, throttle, 0, 0)
        while connection.recv_match(blocking=False):
            pass
        time.sleep(0.02)

    return send


class Background:
    """Repeats something beside the test until the end of the block."""

    def __init__(self, act):
        self.act = act
        self.over = threading.Event()
        self.error = None
        self.thread = threading.Thread(target=self.run)

    def run(self):
        try:
            while not self.over.is_set():
                self.act()
        except Exception as error:  # Raised again at the end of the block.
            self.error = error

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.over.set()
        self.thread.join(timeout=10)
        assert not self.thread.is_alive()
        assert self.error is None, self.error
