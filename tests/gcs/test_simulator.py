"""What the simulator prints for those who start it: on a terminal, into a file, and when it can't start."""

import contextlib
import os
import pty
import re
import subprocess
import time

import pytest

from conftest import REPOSITORY, free_port, simulator_command

SWAP = ["--scenario", "swap", "--speedup", "20", "--for", "65"]
EVENTS = [
    "0:20  the pack is unplugged",
    "0:30  a full pack is plugged in",
    "0:3\\d  Battery 1 swapped: estimates restarted",
    r"1:00  Seen: the swap at 0:3\d \(100 % left.*\), at the end 100 % left, 100 ±\d % estimated\. Ctrl-C ends it\.",
]


def run(*arguments):
    """What a run prints on both streams, after it ended well."""
    ports = ["--udp", f"127.0.0.1:{free_port()}"]
    command = simulator_command(free_port(), *ports, *arguments)
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended
    return ended


def run_on_terminal(environment, *arguments):
    """What a run prints on a terminal."""
    ours, its = pty.openpty()
    command = simulator_command(free_port(), "--udp", f"127.0.0.1:{free_port()}", *arguments)
    streams = {"stdin": its, "stdout": its, "stderr": its}
    with subprocess.Popen(
        command, cwd=REPOSITORY, env=os.environ | {"TERM": "xterm"} | environment, **streams
    ) as process:
        os.close(its)
        printed = b""
        # The end of a terminal whose other side was closed is an error.
        with contextlib.suppress(OSError):
            while piece := os.read(ours, 65536):
                printed += piece
        assert process.wait(timeout=60) == 0, printed
    os.close(ours)
    return printed.decode()


def test_a_scenario_is_printed_line_by_line_into_a_file():
    lines = run(*SWAP).stdout.splitlines()
    assert re.match(r"MAVLink on tcp:127\.0\.0\.1:\d+ and to udp:", lines[0])
    assert re.match(r"Scenario swap: a pack with 35 % left is unplugged .* 20 times as fast\.", lines[1])
    events = iter(lines[2:])
    for expected in EVENTS:
        assert any(re.fullmatch(expected, line) for line in events), (expected, lines)
    status = r"pack 1\d\.\d\d V \d\.\d A \d+ % \| estimated \d+ ±\d % \| HOLD, disarmed \| 0 ground stations \| .* 0 dropped"
    assert any(re.fullmatch(status, line) for line in lines), lines
    assert lines[-1] == "Stopped." and "\x1b" not in "".join(lines)


def test_the_readme_shows_what_the_scenario_prints():
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    shown = re.search(r"--scenario drain\n```\n\n```text\n(.*?)```", readme, re.DOTALL)[1].splitlines()
    printed = run("--scenario", "drain", "--speedup", "100", "--for", "2110").stdout.splitlines()
    events = [line for line in printed[1:-1] if not line.startswith("pack ")]
    # What happens within a second may change places.
    assert sorted(map(without_numbers, events)) == sorted(map(without_numbers, shown))


def without_numbers(line):
    """Times and estimates may differ by a few units from one run to the next; an estimate need not be there in time."""
    return re.sub(r"\d+", "0", re.sub(r" \([^)]*\)", "", line))


@pytest.mark.parametrize(("environment", "is_coloured"), [({}, True), ({"NO_COLOR": "1"}, False)])
def test_on_a_terminal_the_status_stays_in_one_line_below_the_events(environment, is_coloured):
    environment = {"NO_COLOR": ""} | environment
    printed = run_on_terminal(environment, *SWAP)
    # What stays of a line is what was written since it was erased last.
    lines = [re.sub(r"\x1b\[[?\d]*[mlh]", "", line.split("\r\x1b[K")[-1]) for line in re.split(r"\r+\n", printed)]
    events = iter(lines)
    for expected in EVENTS:
        assert any(re.fullmatch(expected, line) for line in events), (expected, lines)
    statuses = [line for line in lines if " ground station" in line]
    assert len(statuses) == 1 and statuses[0] == lines[-3], lines
    assert lines[-2:] == ["Stopped.", ""]
    assert ("\x1b[33m" in printed) == is_coloured


@pytest.mark.parametrize("closed", ["stdout", "both"])
def test_whoever_reads_its_output_may_leave(tmp_path, closed):
    """As `head` does: the simulator ends, and what it recorded is complete."""
    ports = ["--udp", f"127.0.0.1:{free_port()}", "--log", str(tmp_path)]
    command = simulator_command(free_port(), *ports, "--scenario", "drain", "--speedup", "100")
    errors = subprocess.STDOUT if closed == "both" else subprocess.PIPE
    with subprocess.Popen(command, cwd=REPOSITORY, stdout=subprocess.PIPE, stderr=errors, text=True) as process:
        assert process.stdout.readline().startswith("MAVLink on tcp:")
        while ", armed" not in process.stdout.readline():
            pass
        process.stdout.readline()
        process.stdout.close()
        assert process.wait(timeout=60) == 0
        assert process.stderr is None or "panicked" not in process.stderr.read()
    (log,) = tmp_path.glob("*.BIN")
    assert b"BATT_MONITOR" in log.read_bytes()


def test_a_port_that_the_system_chooses_is_printed():
    udp = f"127.0.0.1:{free_port()}"
    command = ["cargo", "run", "--quiet", "--", "--tcp", "127.0.0.1:0", "--udp", udp, "--web", "off", "--for", "1"]
    printed = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60).stdout
    assert re.match(r"MAVLink on tcp:127\.0\.0\.1:[1-9]\d* and", printed), printed


def test_what_another_simulator_has_is_said_with_ports_that_are_free(start_simulator):
    port = start_simulator().port
    command = ["cargo", "run", "--quiet", "--", "--tcp", f"localhost:{port}"]
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 1 and ended.stdout == "", ended
    # The name was resolved.
    assert ended.stderr.startswith(f"Can't listen on 127.0.0.1:{port}: "), ended
    hint = f"Is another simulator running? --tcp 127.0.0.1:{port + 1} --udp 127.0.0.1:14551 takes other ports.\n"
    assert ended.stderr.endswith(hint), ended


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--udp", "localhost"], "a host and a port are needed, as in localhost:5761"),
        (["--scenario", "flood"], "there are drain, swap, cold, loose-wire"),
        (["--scenario", "drain", "--flash", "x"], "cannot be used with"),
        (["--speedup", "0"], "a number from 0.01 to 1000 is needed"),
        (["--rovers", "241"], "a number from 1 to 240 is needed"),
        (["--rovers", "2", "--flash", "x"], "cannot be used with"),
        (["--rovers", "2", "--scenario", "drain"], "cannot be used with"),
        (["--pack", "4s-lipo"], "there are 2s-18650, "),
        (["--pack", "smart-battery"], "smart-battery.param has no cells and chemistry, or a monitor that is not simulated; "),
        (["--pack", "2s-18650", "--rovers", "2"], "cannot be used with"),
    ],
)
def test_an_argument_that_does_not_fit_is_explained(arguments, expected):
    ended = subprocess.run(
        simulator_command(free_port(), *arguments), cwd=REPOSITORY, capture_output=True, text=True, timeout=60
    )
    assert ended.returncode == 2 and expected in ended.stderr, ended


def test_a_scenario_with_a_pack_of_its_own_takes_no_other():
    command = simulator_command(free_port(), "--scenario", "swap", "--pack", "2s-18650")
    ended = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (1, "The scenario swap has a pack of its own: no --pack.\n")


def test_help_says_what_it_is_and_gives_examples():
    text = run("--help").stdout
    assert text.startswith("Simulates a rover with a battery pack, "), text
    assert "Examples" in text and "--scenario drain" in text


def wait_for(condition, seconds=20):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.parametrize("comes_back", [True, False])
def test_logs_that_could_not_be_copied_are_tried_again_and_else_said(start_simulator, tmp_path, comes_back):
    folder = tmp_path / "logs"
    simulator = start_simulator("--scenario", "drain", "--speedup", "20", "--log", str(folder))
    folder.rmdir()
    wait_for(lambda: any(line.startswith("Can't copy the log: ") for line in simulator.output))
    time.sleep(2.5)
    if comes_back:
        folder.mkdir()
        wait_for(lambda: list(folder.glob("*.BIN")))
    code, printed = simulator.interrupt()
    assert printed.count("Can't copy the log: ") == 1
    assert ("The logs are incomplete: " in printed) == (not comes_back), printed
    assert code == (0 if comes_back else 1)
    for log in folder.glob("*.BIN"):
        # From its first record on.
        assert b"BATT_MONITOR" in log.read_bytes()
