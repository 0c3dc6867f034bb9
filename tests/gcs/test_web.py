"""The simulator's page, its logs and its WebSocket, as browsers and pymavlink use them."""

import gzip
import http.client
import json
import socket
import threading
import time
from contextlib import ExitStack, closing

import pytest

from conftest import REPOSITORY, failed_start, free_port
from station import command, connect, is_about, mavlink, rate_of, read, read_list, set_to, unread_messages_of
from test_signing import KEY, sign_with, ticks_now, wait_for_text

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
SET_INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
FORCED = 21196

# More than by default; at 50 Hz a busy computer is what limits.
RATE_HZ = 10

UPGRADE = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)


BINARY, PING = 0x82, 0x89


def in_frame(payload, first_byte):
    """A WebSocket's frame, with a mask of zeros."""
    return bytes([first_byte, 0x80 | len(payload), 0, 0, 0, 0]) + payload


def heartbeat():
    sender = mavlink.MAVLink(None, srcSystem=255)
    gcs, none = mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID
    return sender.heartbeat_encode(gcs, none, 0, 0, mavlink.MAV_STATE_ACTIVE).pack(sender)


def ends(client):
    """Whether the rover closes this connection within a second."""
    client.settimeout(0.2)
    end = time.monotonic() + 1
    while time.monotonic() < end:
        try:
            if client.recv(65536) == b"":
                return True
        except TimeoutError:
            pass
    return False


class Site:
    """A simulator with a page."""

    def __init__(self, start_simulator, *arguments):
        self.port = free_port()
        self.simulator = start_simulator("--web", f"127.0.0.1:{self.port}", *arguments)

    @property
    def ws_url(self):
        return f"ws:127.0.0.1:{self.port}"

    def get(self, path, method="GET", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        with closing(connection):
            names = {name.replace("_", "-"): value for name, value in headers.items()}
            connection.request(method, path, headers=names)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()

    def logs(self):
        """Those that are listed, once there are some."""
        end = time.monotonic() + 15
        while not (logs := json.loads(self.get("/logs/")[2])):
            assert time.monotonic() < end
            time.sleep(0.2)
        return logs

    def upgraded(self, headers=""):
        """A socket on which a WebSocket was asked for, and the status of the answer."""
        client = socket.create_connection(("127.0.0.1", self.port), timeout=10)
        client.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\n{UPGRADE}{headers}\r\n".encode())
        return client, int(client.recv(13)[9:12])


@pytest.fixture
def site(start_simulator):
    return Site(start_simulator)


def test_page_and_descriptions_are_served_compressed_whatever_the_browser_says(site):
    for path, content in [("/parameters.json", (REPOSITORY / "docs" / "parameters.json").read_bytes()), ("/", None)]:
        status, headers, body = site.get(path, Accept_Encoding="identity")
        assert (status, headers["Content-Encoding"]) == (200, "gzip")
        assert content in (None, gzip.decompress(body))
        assert site.get(path, If_None_Match=headers["ETag"])[0] == 304
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]


def test_parameters_commands_and_rates_are_those_of_tcp(site):
    with closing(connect(site.simulator.url)) as tcp, closing(connect(site.ws_url)) as web:
        assert read_list(web) == read_list(tcp)
        set_to(web, "BATT_LOW_VOLT", 10.5)
        assert read(tcp, "BATT_LOW_VOLT").param_value == 10.5
        for vehicle in (tcp, web):
            message = mavlink.MAVLINK_MSG_ID_BATTERY_STATUS
            assert command(vehicle, SET_INTERVAL, message, 1e6 / RATE_HZ) == ACCEPTED
            assert is_about(rate_of(vehicle, "BATTERY_STATUS"), RATE_HZ)
            assert vehicle.mav_loss == 0
            assert command(vehicle, ARM, 1, FORCED) == ACCEPTED
            assert command(vehicle, ARM, 0) == ACCEPTED


def test_logs_are_listed_and_downloaded_and_a_broken_download_goes_on(site):
    with closing(connect(site.ws_url)) as web:
        # Space for the log is erased before.
        time.sleep(1)
        assert command(web, ARM, 1, FORCED) == ACCEPTED
        (log,) = site.logs()
        path = f"/logs/{log['number']}.BIN"
        assert site.get(path)[0] == 409, "armed"
        assert command(web, ARM, 0) == ACCEPTED
        set_to(web, "LOG_DISARMED", 0)
        # It would grow for 15 s after disarming.
        set_to(web, "LOG_BITMASK", 0)
        before = None
        while (logs := site.logs()) != before:
            before = logs
            time.sleep(1)
    (log,) = logs
    status, headers, whole = site.get(path)
    assert status == 200 and len(whole) == log["bytes"] == int(headers["Content-Length"])
    assert log["name"] in headers["Content-Disposition"]
    status, headers, part = site.get(path, Range="bytes=100-299", If_Range=headers["ETag"])
    assert (status, part) == (206, whole[100:300])
    assert headers["Content-Range"] == f"bytes 100-299/{len(whole)}"
    assert site.get(path, Range="bytes=-50")[2] == whole[-50:]
    assert site.get(path, Range="bytes=100-", If_Range='"another"')[0] == 200
    assert site.get(path, Range="bytes=99999999-")[0] == 416


def test_with_a_key_logs_follow_sign_wifi_allow(site):
    with closing(connect(site.simulator.url)) as tcp:
        tcp.mav.setup_signing_send(1, 1, b"k" * 32, 1)
        assert tcp.recv_match(type="STATUSTEXT", condition="'igning' in STATUSTEXT.text", blocking=True, timeout=5)
        assert site.get("/logs/")[0] == 403
        tcp.setup_signing(b"k" * 32, sign_outgoing=True)
        set_to(tcp, "SIGN_WIFI_ALLOW", 1)
        assert site.get("/logs/")[0] == 200


def test_a_foreign_page_hears_and_commands_nothing(site):
    client, status = site.upgraded("Origin: https://evil.example\r\n")
    with closing(client), closing(connect(site.simulator.url)) as tcp:
        assert status == 101
        client.sendall(set_low_volt(mavlink.MAVLink(None, srcSystem=255)))
        time.sleep(1)
        assert read(tcp, "BATT_LOW_VOLT").param_value == 0
        assert len(client.recv(65536)) > 200, "telemetry comes"
        assert site.get("/logs/", Origin="https://evil.example")[0] == 403


def set_low_volt(sender):
    """PARAM_SET of 10.5 V in a WebSocket's frame."""
    return in_frame(sender.param_set_encode(1, 1, b"BATT_LOW_VOLT", 10.5, 9).pack(sender), BINARY)


def test_a_foreign_page_that_signs_is_obeyed(site):
    sender = mavlink.MAVLink(None, srcSystem=200)
    sender.signing.secret_key, sender.signing.timestamp = KEY, ticks_now()
    with closing(connect(site.simulator.url)) as tcp:
        tcp.mav.setup_signing_send(1, 1, list(KEY), ticks_now())
        wait_for_text(tcp, "Signing key set")
        sign_with(tcp, KEY)
        client, _ = site.upgraded("Origin: https://evil.example\r\n")
        with closing(client):
            for signs, value in ((False, 0), (True, 10.5)):
                sender.signing.sign_outgoing = signs
                client.sendall(set_low_volt(sender))
                time.sleep(1)
                assert read(tcp, "BATT_LOW_VOLT").param_value == value


def test_foreign_hosts_get_nothing(site):
    for path in ["/", "/logs/", "/x"]:
        assert site.get(path, Host="evil.example")[0] == 421
    assert site.get("/", Host=f"localhost:{site.port}")[0] == 200


def test_two_browsers_at_a_time_and_a_silent_one_gives_way(site):
    with ExitStack() as clients:
        opened = lambda headers="": site.upgraded(headers)
        keep = lambda upgraded: (clients.enter_context(closing(upgraded[0])), upgraded[1])
        (live, _), (silent, _) = keep(opened()), keep(opened())
        assert keep(opened())[1] == 503
        for _ in range(4):
            live.sendall(in_frame(heartbeat(), BINARY))
            time.sleep(1)
        third, status = keep(opened())
        assert status == 101
        assert ends(silent) and not ends(live)
        # It was refused while both were heard, so a free place waits for it.
        live.sendall(in_frame(heartbeat(), BINARY))
        assert keep(opened())[1] == 503
        third.close()
        time.sleep(0.5)
        assert keep(opened("Origin: https://evil.example\r\n"))[1] == 503
        assert keep(opened())[1] == 101


@pytest.mark.parametrize("flood", ["pings", "empty frames"])
def test_a_flood_of_frames_without_mavlink_leaves_others_their_turn(site, flood):
    client, _ = site.upgraded()
    over = threading.Event()
    frames = 1000 * in_frame(b"", PING if flood == "pings" else BINARY)

    def send():
        # What the rover sends is not read.
        client.settimeout(0.5)
        while not over.is_set():
            try:
                client.send(frames)
            except TimeoutError:
                pass

    with closing(client), closing(connect(site.simulator.url)) as tcp:
        flooding = threading.Thread(target=send, daemon=True)
        flooding.start()
        try:
            # Of 2 Hz, while it takes all of a processor, which other tests need, too.
            assert rate_of(tcp, "BATTERY_STATUS", seconds=2) >= 1
            assert command(tcp, ARM, 1, FORCED) == ACCEPTED
        finally:
            over.set()
            flooding.join()


@pytest.mark.parametrize(("count", "begin"), [(40, b"GET / HTTP/1.1\r\nX: "), (12, b"G"), (40, b"")])
def test_slow_connections_delay_a_page_by_six_seconds_at_most(site, count, begin):
    with closing(connect(site.ws_url)) as web, ExitStack() as slow:
        began = time.monotonic()
        for _ in range(count):
            client = slow.enter_context(socket.create_connection(("127.0.0.1", site.port), timeout=10))
            client.sendall(begin)
        status = None
        while status != 200:
            try:
                status = site.get("/")[0]
            except ConnectionError:
                pass
            time.sleep(0.1)
        assert time.monotonic() - began < 6.5
        # What the open one has got meanwhile.
        times = [message._timestamp for message in unread_messages_of(web, 1)]
        assert max(later - earlier for earlier, later in zip(times, times[1:])) < 1


def test_a_port_that_is_taken_is_an_error_if_it_was_asked_for_and_off_serves_nothing(start_simulator):
    site = Site(start_simulator)
    assert "Can't serve the page" in failed_start("--web", f"127.0.0.1:{site.port}")
    without = start_simulator("--web", "off")
    code, output = without.interrupt()
    assert code == 0 and "page" not in output
