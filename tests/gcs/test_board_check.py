"""`board-check` as its user runs it, against the simulator. Which fault fails which check is shown on the core and on the
release firmware, `tests/host/board_check.rs` and `tests/firmware/board_check.rs`; that a sound vehicle passes, by `.ci/hil
--rehearsal`, too.
"""

import contextlib
import os
import select
import signal
import socket
import subprocess
import threading
import time
import tty

from pymavlink import mavutil

from conftest import REPOSITORY
from station import connect, receive

BOARD_CHECK = ["cargo", "run", "--quiet", "--bin", "board-check", "--"]

# Half a minute, and the time to build it.
TIMEOUT = 300


def board_check(port, report, *arguments, answers=""):
    return subprocess.run(
        [*BOARD_CHECK, port, "--report", report, *arguments],
        cwd=REPOSITORY,
        input=answers,
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
    )


def rows(report):
    """Result of each check by the report."""
    cells = (line.split(" | ") for line in report.read_text().splitlines() if line.startswith("| "))
    return {row[0].removeprefix("| "): row[1] for row in cells}


# Wall time on a shared machine is not exact.
BY_THE_CLOCK = {"rates", "jitter", "round trips"}


def failed(results):
    return {name for name, result in results.items() if result == "**failed**"}


def test_only_an_elf_file_names_a_build(tmp_path):
    report = tmp_path / "report.md"
    ended = board_check("tcp:127.0.0.1:9", report, "--firmware", REPOSITORY / "Cargo.toml")
    assert ended.returncode == 2 and "the firmware's ELF file is needed" in ended.stderr


def test_ctrl_c_stops_the_wheels(start_simulator, tmp_path):
    url = start_simulator().url
    process = subprocess.Popen(
        [*BOARD_CHECK, url, "--report", tmp_path / "report.md", "--motors"],
        cwd=REPOSITORY,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    process.stdin.write("y\n")
    process.stdin.flush()
    while "left wheels ahead" not in process.stdout.readline():
        assert process.poll() is None
    vehicle = connect(url)
    armed = mavutil.mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    while not receive(vehicle, ["HEARTBEAT"]).base_mode & armed:
        pass
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10) == 1
    time.sleep(0.2)
    while vehicle.recv_match(blocking=False):
        pass
    assert not receive(vehicle, ["HEARTBEAT"]).base_mode & armed


def serve_serial(path, simulator_port):
    """A serial port that is the simulator's; it vanishes with the simulator's connection, as a board's on USB does."""
    # Until the simulator is ended.
    with contextlib.suppress(OSError):
        while True:
            with socket.create_connection(("127.0.0.1", simulator_port)) as board:
                ours, theirs = os.openpty()
                tty.setraw(theirs)
                path.symlink_to(os.ttyname(theirs))
                carry(board, ours)
                path.unlink()
                os.close(theirs)
                os.close(ours)


def carry(board, port):
    """Carries bytes both ways until the board closes."""
    while True:
        ready, _, _ = select.select([board, port], [], [])
        if port in ready:
            board.sendall(os.read(port, 4096))
        if board in ready:
            sent = board.recv(4096)
            if not sent:
                return
            os.write(port, sent)


def test_everything_is_checked_over_a_serial_port_that_vanishes_with_each_restart(start_simulator, tmp_path):
    port, report = tmp_path / "ttyACM0", tmp_path / "report.md"
    arguments = (port, start_simulator().port)
    threading.Thread(target=serve_serial, args=arguments, daemon=True).start()
    while not port.exists():
        time.sleep(0.01)
    plan = ["--voltage", "12.6", "--motors", "--provoke-fault"]
    ended = board_check(str(port), report, *plan, answers="y\ny\nn\ny\ny\n")
    assert f"The report is in {report}." in ended.stdout
    assert ended.returncode == 1, ended
    results = rows(report)
    # One wheel was said to turn wrong; and the simulator has no memory that outlasts a crash.
    assert failed(results) - BY_THE_CLOCK == {"right wheels ahead", "crash record"}, ended
    unknown = {name for name, result in results.items() if result == "not measured"}
    assert unknown == {"firmware hash", "load", "voltage under load", "current under load"}
    assert "restarted in" in report.read_text()


def test_a_silent_port_is_no_board(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as silent:
        ended = board_check(f"tcp:127.0.0.1:{silent.getsockname()[1]}", tmp_path / "report.md")
    assert ended.returncode == 2, ended
    assert "No autopilot's heartbeat was received." in ended.stdout
    ended = board_check("/dev/no-such-port", tmp_path / "report.md")
    assert ended.returncode == 2 and "Can't open /dev/no-such-port" in ended.stderr


def test_a_report_that_cannot_be_written_is_said_before_the_first_frame(tmp_path):
    note = tmp_path / "note.md"
    note.write_text("A note.\n")
    for report, said in [(tmp_path / "none" / "report.md", "No such file"), (tmp_path, "directory"), (note, "no report of board-check")]:
        with socket.create_server(("127.0.0.1", 0)) as board:
            ended = board_check(f"tcp:127.0.0.1:{board.getsockname()[1]}", report)
            assert board.accept()[0].recv(1) == b""
        assert ended.returncode == 2 and ended.stderr.startswith(f"Can't write {report}: "), ended
        assert said in ended.stderr and ended.stdout == ""
    assert note.read_text() == "A note.\n"


def test_an_earlier_report_is_replaced(tmp_path):
    report = tmp_path / "report.md"
    report.write_text("# Board check\n\nYesterday.\n")
    with socket.create_server(("127.0.0.1", 0)) as silent:
        ended = board_check(f"tcp:127.0.0.1:{silent.getsockname()[1]}", report)
    assert ended.returncode == 2 and "The report is in" in ended.stdout
    assert report.read_text().startswith("# Board check\n") and "Yesterday" not in report.read_text()


def test_what_was_typed_before_a_question_does_not_turn_the_wheels(start_simulator, tmp_path):
    ours, theirs = os.openpty()
    arguments = [start_simulator().url, "--report", tmp_path / "report.md", "--motors"]
    process = subprocess.Popen(
        [*BOARD_CHECK, *arguments], cwd=REPOSITORY, stdin=theirs, stdout=subprocess.PIPE, text=True
    )
    try:
        for line in process.stdout:
            if "Listening" in line:
                os.write(ours, b"y\ny\n")
            if "all wheels off the ground" in line:
                time.sleep(1)
                os.write(ours, b"n\n")
            assert "Did both left wheels" not in line
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(timeout=10)
        os.close(ours)
        os.close(theirs)
    assert rows(tmp_path / "report.md")["left wheels ahead"] == "not measured"
