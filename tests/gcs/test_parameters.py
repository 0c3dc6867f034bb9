"""The parameter services, with pymavlink as the ground station."""

import re
import time

import pytest
from pymavlink import mavutil

from conftest import failed_start, parameter_metadata
from station import command, connect, fresh, read, read_list, receive, restarted, set_to

mavlink = mavutil.mavlink


@pytest.fixture
def vehicle(start_simulator):
    return connect(start_simulator().url)


def described():
    """The names in the metadata file for ground stations."""
    return {param.get("name").removeprefix("Rover:") for param in parameter_metadata().iter("param")}


# What sets up a CAN bus, a protocol of the second serial port or a thermometer that is not in use, a pack that is measured so, or a
# curve of its own.
NOT_IN_USE = r"CAN_(?!P1_DRIVER)|TEMP\d_(?!TYPE)|GEN_TYPE|EFI_|TRQD1_|SERIAL1_BAUD|BATT\d?_(CURR_MULT|ESC_MASK|CURVE_)"


def visible(packs):
    """The names that are listed while these packs, with analog sensors, are enabled: of the others, what enables them."""

    def is_visible(name):
        pack = re.match(r"BATT(\d?)_", name)
        is_enabled = not pack or int(pack[1] or 1) in packs
        return (is_enabled and not re.match(NOT_IN_USE, name)) or (pack and name == f"{pack[0]}MONITOR")

    return {name for name in described() if is_visible(name)}


@pytest.mark.board
def test_list(vehicle):
    values = read_list(vehicle)
    assert values.keys() == visible({1})
    assert values["SR0_EXTRA1"] == 2
    assert values["BATT_VOLT_MULT"] == pytest.approx(3.95)
    for name, value in values.items():
        assert read(vehicle, name).param_value == value


@pytest.mark.board
def test_read_by_index_and_unknown_names(vehicle):
    vehicle.mav.param_request_read_send(1, 1, b"", 2)
    message = receive(vehicle, ["PARAM_VALUE"])
    assert (message.param_index, message.param_id) == (2, "SR0_EXTRA1")
    error = read(vehicle, "NOPE")
    assert error.get_type() == "PARAM_ERROR"
    assert error.error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST


@pytest.mark.board
# Requirement: AP-29
def test_names_of_ardupilot_4_7(vehicle):
    listed = read_list(vehicle)
    for newer, value, own, own_value in [
        ("MAV1_EXTRA1", 5, "SR0_EXTRA1", 5),
        ("MAV1_PARAMS", 20, "SR0_PARAMS", 20),
        ("ARMING_SKIPCHK", 320, "ARMING_CHECK", 1024),
        ("ARMING_SKIPCHK", -1, "ARMING_CHECK", 0),
        ("ARMING_SKIPCHK", 0, "ARMING_CHECK", 1),
        ("MAV_SYSID", 1, "SYSID_THISMAV", 1),
    ]:
        answer = set_to(vehicle, newer, value)
        assert (answer.param_id, answer.param_value, answer.param_index) == (newer, value, 65535)
        assert read(vehicle, own).param_value == own_value
        assert read(vehicle, newer).param_value == value
    assert read_list(vehicle).keys() == listed.keys()


@pytest.mark.board
def test_a_pack_that_is_enabled_shows_its_parameters(vehicle):
    assert set_to(vehicle, "BATT2_VOLT_MULT", 11).param_index == 65535, "not listed"
    assert set_to(vehicle, "BATT2_MONITOR", 3).param_count == len(visible({1, 2}))
    values = read_list(vehicle)
    assert values.keys() == visible({1, 2})
    assert values["BATT2_VOLT_MULT"] == 11
    for number in range(3, 10):
        set_to(vehicle, f"BATT{number}_MONITOR", 3)
    assert read_list(vehicle).keys() == visible(set(range(1, 10)))
    assert set_to(vehicle, "BATT2_MONITOR", 0).param_count == len(visible({1, *range(3, 10)}))


def test_what_was_set_outlasts_a_restart_and_the_simulator(start_simulator, tmp_path):
    flash = str(tmp_path / "flash")
    simulator = start_simulator("--flash", flash)
    vehicle = connect(simulator.url)
    set_to(vehicle, "SR0_EXTRA1", 4)
    assert command(vehicle, mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mavlink.MAV_RESULT_ACCEPTED
    vehicle.close()
    time.sleep(2)
    vehicle = connect(simulator.url)
    assert read(vehicle, "SR0_EXTRA1").param_value == 4
    vehicle.close()
    code, output = simulator.interrupt()
    assert code == 0 and "Restarted." in output, output

    vehicle = connect(start_simulator("--flash", flash).url)
    assert read(vehicle, "SR0_EXTRA1").param_value == 4
    assert command(vehicle, mavlink.MAV_CMD_PREFLIGHT_STORAGE, 2) == mavlink.MAV_RESULT_ACCEPTED
    time.sleep(0.5)
    assert read(vehicle, "SR0_EXTRA1").param_value == 2


def test_a_parameter_that_could_not_be_saved_is_named_and_saved_later(start_simulator, tmp_path):
    folder, away = tmp_path / "flash", tmp_path / "away"
    folder.mkdir()
    simulator = start_simulator("--flash", str(folder / "rover"), "--speedup", "10")
    vehicle = connect(simulator.url)

    def text(beginning, seconds=20):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            said = vehicle.recv_match(type="STATUSTEXT", blocking=True, timeout=1)
            if said and said.text.startswith(beginning):
                return said.text
        raise AssertionError(beginning)

    folder.rename(away)
    set_to(vehicle, "SR0_EXTRA1", 4)
    text("Parameters can't be saved")
    # It is acknowledged behind its texts.
    vehicle.mav.command_long_send(1, 1, mavlink.MAV_CMD_RUN_PREARM_CHECKS, 0, 0, 0, 0, 0, 0, 0, 0)
    text("PreArm: Parameters can't be saved: flash worn out?")
    away.rename(folder)
    text("Parameters saved")


def test_a_count_outlasts_a_restart(start_simulator):
    simulator = start_simulator()
    vehicle = connect(simulator.url)
    for name, value in (("BATT_MONITOR", 4), ("BATT_CURR_PIN", 27), ("BATT_CELLS", 3), ("BATT_CAPACITY", 2200)):
        set_to(vehicle, name, value)
    vehicle = restarted(vehicle, simulator.url)
    time.sleep(3)
    assert command(vehicle, mavlink.MAV_CMD_BATTERY_RESET, 1, 40) == mavlink.MAV_RESULT_ACCEPTED
    used_mah = fresh(vehicle, "BATTERY_STATUS").current_consumed
    assert used_mah > 500
    vehicle = restarted(vehicle, simulator.url)
    time.sleep(2)
    assert fresh(vehicle, "BATTERY_STATUS").current_consumed == pytest.approx(used_mah, abs=10)


def test_a_flash_file_belongs_to_one_simulator_at_a_time(start_simulator, tmp_path):
    flash = str(tmp_path / "flash")
    first = start_simulator("--flash", flash)
    set_to(connect(first.url), "SR0_EXTRA1", 4)
    assert failed_start("--flash", flash) == f"Can't use the flash file {flash}: another simulator uses it.\n"
    first.kill()
    assert read(connect(start_simulator("--flash", flash).url), "SR0_EXTRA1").param_value == 4


def test_a_flash_file_that_can_not_be_written_is_refused_at_the_start(tmp_path):
    flash = str(tmp_path / "missing" / "flash")
    printed = failed_start("--flash", flash)
    assert printed.startswith(f"Can't use the flash file {flash}: its folder can't be used: "), printed


def test_a_simulator_that_is_killed_while_it_saves_starts_again(start_simulator, tmp_path):
    flash = str(tmp_path / "flash")
    for _ in range(3):
        simulator = start_simulator("--flash", flash)
        vehicle = connect(simulator.url)
        assert read(vehicle, "SR0_EXTRA1").param_value in range(2, 12)
        for value in range(200):
            vehicle.param_set_send("SR0_EXTRA1", 2 + value % 10)
        time.sleep(0.05)
        simulator.kill()
        vehicle.close()


@pytest.mark.board
def test_unknown_commands_and_files_are_refused_at_once(vehicle):
    for number in (mavlink.MAV_CMD_GET_HOME_POSITION, 65535):
        assert command(vehicle, number) == mavlink.MAV_RESULT_UNSUPPORTED
    assert command(vehicle, mavlink.MAV_CMD_PREFLIGHT_STORAGE, 1) == mavlink.MAV_RESULT_DENIED
    opening = bytes([7, 0, 0, 4, 11, 0, 0, 0, 0, 0, 0, 0]) + b"/etc/passwd"
    vehicle.mav.file_transfer_protocol_send(0, 1, 1, opening.ljust(251, b"\0"))
    answer = receive(vehicle, ["FILE_TRANSFER_PROTOCOL"])
    assert (answer.payload[0], answer.payload[3], answer.payload[5]) == (8, 129, 4)
