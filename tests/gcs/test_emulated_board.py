"""The release firmware on the emulated board, and what ground stations see of it at its two ports."""

import concurrent.futures
import time

import pytest

from station import command, connect, count, is_about, mavlink, messages_of, opened, read, read_list, set_to

# One board at a time.
pytestmark = pytest.mark.xdist_group("emulated_board")

PORTS = ["uart_url", "usb_url"]
FLASH_BYTES = 2 * 1024 * 1024


def test_telemetry_at_its_rates_over_both_ports_at_once(emulated_board):
    links = [connect(getattr(emulated_board, port)) for port in PORTS]
    seconds = 5
    with concurrent.futures.ThreadPoolExecutor() as executor:
        received = list(executor.map(lambda link: messages_of(link, seconds), links))
    for link, messages in zip(links, received):
        for name, hertz in [("HEARTBEAT", 1), ("SYS_STATUS", 2), ("BATTERY_STATUS", 2)]:
            assert is_about(count(messages, name) / seconds, hertz), (name, count(messages, name))
        voltages = [message.voltages[0] for message in messages if message.get_type() == "BATTERY_STATUS"]
        assert all(abs(voltage - 12_600) < 50 for voltage in voltages), voltages
        assert link.mav_loss == 0


def test_the_same_parameters_are_listed_over_both_ports(emulated_board):
    over_uart, over_usb = (read_list(connect(getattr(emulated_board, port))) for port in PORTS)
    assert over_uart == over_usb
    assert over_uart["BATT_VOLT_MULT"] == pytest.approx(3.95)


def test_what_was_set_outlasts_the_board_in_its_flash_file(start_emulated_board):
    board = start_emulated_board()
    assert set_to(connect(board.uart_url), "BATT_LOW_VOLT", 10.25).param_value == 10.25
    time.sleep(1)
    log = board.switch_off()
    assert "Stopped after" in log and " Warn " not in log and " Error " not in log, log
    assert board.flash.stat().st_size == FLASH_BYTES
    assert read(connect(start_emulated_board().usb_url), "BATT_LOW_VOLT").param_value == 10.25


@pytest.mark.parametrize("port", PORTS)
def test_a_restart_by_command_keeps_the_connection(emulated_board, port):
    link = connect(getattr(emulated_board, port))
    assert command(link, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mavlink.MAV_RESULT_ACCEPTED
    time.sleep(2)
    assert read(link, "BATT_MONITOR").param_value == 3
    assert "started by Software" in emulated_board.switch_off()


@pytest.mark.parametrize("port", PORTS)
def test_a_client_is_served_once_the_one_before_is_gone(emulated_board, port):
    url = getattr(emulated_board, port)
    for _ in range(2):
        first, second = connect(url), opened(url)
        assert second.recv_match(blocking=True, timeout=1.5) is None
        first.close()
        assert second.wait_heartbeat(timeout=3) is not None
        assert read(second, "BATT_MONITOR").param_value == 3
        second.close()


def test_what_a_suspended_machine_has_missed_is_not_caught_up_with(emulated_board):
    link = connect(emulated_board.uart_url)
    emulated_board.suspend()
    time.sleep(4)
    while link.recv_match(blocking=False):
        pass
    emulated_board.resume()
    assert count(messages_of(link, 0.8), "HEARTBEAT") <= 1
    assert count(messages_of(link, 4), "HEARTBEAT") in (3, 4, 5)
