#!/usr/bin/env python3
"""Runs the commands and Python examples of the documentation as a newcomer would: in order, in a fresh clone.

Every ```sh block is one `bash -e` script, every ```python block one program. HTML comments on the lines just before a
block say how it runs; several may stand together:

    <!-- hardware -->       needs a board, a probe or a radio: only checked for its syntax
    <!-- internet -->       needs more of the internet than package registries: only checked for its syntax
    <!-- simulator -->      runs while `cargo run` is running
    <!-- until stopped -->  each command runs until Ctrl-C: it has to print something, stay, and end by Ctrl-C

The clone has the changes that are not committed yet, but no file that git does not know. It shares the target folder with
this one, and its files have the same times, so that cargo rebuilds nothing.
"""

import argparse
import ast
import contextlib
import dataclasses
import math
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
PAGES = ["README.md", "CONTRIBUTING.md", "examples/README.md", "docs/**/*.md"]
ONLY_CHECKED = {"hardware", "internet"}
MARKERS = ONLY_CHECKED | {"simulator", "until stopped"}

# Long enough to build everything on a slow machine.
BLOCK_TIMEOUT_S = 1800
# What runs until it is stopped gets this long to fail after its first line, and this long to end.
STAY_S, END_S = 4, 20
# A line of a program's own, not one of the cargo that builds it.
FIRST_LINE = re.compile(
    r"^(?! *(?:Blocking|Updating|Locking|Adding|Download\w+|Compiling|Building|Finished|Running) ).*\S.*\n", re.MULTILINE
)
SIMULATOR_PORTS = [(socket.SOCK_STREAM, 5760), (socket.SOCK_DGRAM, 14550)]


@dataclasses.dataclass
class Block:
    """A code block of a page."""

    page: str
    line: int
    language: str
    markers: set
    text: str


class Failed(Exception):
    """A command did not do what the page says; the message is for people."""


# Reading pages


def blocks_of(page, text):
    """The shell and Python blocks of a page, in order."""
    lines = text.splitlines()
    at = 0
    while at < len(lines):
        fence = re.match(r"( *)```(\S*)", lines[at])
        if not fence:
            at += 1
            continue
        end = next(i for i in range(at + 1, len(lines)) if lines[i].strip() == "```")
        if fence[2] in ("sh", "python"):
            content = [line.removeprefix(fence[1]) for line in lines[at + 1 : end]]
            yield Block(page, at + 1, fence[2], markers_above(page, lines, at), "\n".join(content) + "\n")
        at = end + 1


def markers_above(page, lines, at):
    """What the comments directly above a line say; a word that is not a marker is a mistake."""
    markers = set()
    while at > 0 and (comment := re.fullmatch(r" *<!-- (.*) -->", lines[at - 1])):
        markers.update(comment[1].split(", "))
        at -= 1
    if unknown := markers - MARKERS:
        raise Failed(f"{page}:{at + 1}: no such marker: {', '.join(sorted(unknown))}")
    return markers


def commands_of(script):
    """A script cut into whole commands: as many lines together as bash needs."""
    commands, started = [], []
    for line in script.splitlines():
        if not started and (not line.strip() or line.lstrip().startswith("#")):
            continue
        started.append(line)
        if not syntax_error("\n".join(started)):
            commands.append("\n".join(started))
            started = []
    return commands + (["\n".join(started)] if started else [])


def syntax_error(script):
    """What bash does not like about a script, also a line that goes on or a text that does not end."""
    if script.endswith("\\"):
        return "goes on"
    # Only warned of: a here-document without its end.
    return subprocess.run(["bash", "-n"], input=script + "\n", text=True, capture_output=True).stderr


def without_comment(command):
    return re.sub(r"\s+#.*", "", command).strip()


# The clone


@contextlib.contextmanager
def scratch_clone(empty_target=False):
    """A clone and the environment its commands run in. `empty_target` has cargo build everything."""
    with tempfile.TemporaryDirectory(prefix="rover-battmon-") as scratch:
        clone = pathlib.Path(scratch, "rover-battmon")
        subprocess.run(["git", "clone", "--quiet", REPOSITORY, clone], check=True)
        bring_up_to_date(clone)
        if not empty_target:
            (REPOSITORY / "target").mkdir(exist_ok=True)
            (clone / "target").symlink_to(REPOSITORY / "target")
        home = pathlib.Path(scratch, "home")
        home.mkdir()
        yield clone, environment(home, clone)


def bring_up_to_date(clone):
    """Makes every file the one here, with its time: cargo, which goes by times, takes what it has built from those.

    Only so is the target folder safe to share: built from other content, it would be taken for up to date here, too.
    """
    for name in files_in(clone):
        (clone / name).unlink()
    for name in files_in(REPOSITORY):
        if (REPOSITORY / name).exists():
            (clone / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(REPOSITORY / name, clone / name)


def files_in(repository):
    """The files git knows of."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=repository, capture_output=True, text=True, check=True)
    return listed.stdout.split("\0")[:-1]


def build_the_firmware_here():
    """The tests that read the ELF go by the folder its debug information names."""
    subprocess.run(["cargo", "fw", "--quiet"], cwd=REPOSITORY, check=True)


def make_the_venv_here():
    """The programs in it go by the folder it is made in, which has to be there later."""
    if not (REPOSITORY / "target/gcs-venv").exists():
        subprocess.run(["python3", "-m", "venv", "target/gcs-venv"], cwd=REPOSITORY, check=True)


def environment(home, clone):
    """Installed programs come from the target folder, and nothing is written to or read from the user's own settings."""
    user = pathlib.Path.home()
    target = (clone / "target").resolve()
    tools = target / "uf2-tools"
    return {
        "CARGO_HOME": str(user / ".cargo"),
        "RUSTUP_HOME": str(user / ".rustup"),
        **os.environ,
        "HOME": str(home),
        # Not by the symbolic link: another path to OUT_DIR is another build.
        "CARGO_TARGET_DIR": str(target),
        "CARGO_INSTALL_ROOT": str(tools),
        "PATH": f"{REPOSITORY / 'target/gcs-venv/bin'}:{tools / 'bin'}:{os.environ['PATH']}",
        "PYTHONUNBUFFERED": "1",
        "LC_ALL": "C.UTF-8",
    }


# Running


class Program:
    """A program in a session of its own that is stopped as by Ctrl-C."""

    def __init__(self, arguments, clone, environment):
        self.output = ""
        self.process = subprocess.Popen(
            arguments, cwd=clone, env=environment, start_new_session=True, text=True, errors="replace",
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in iter(lambda: self.process.stdout.read(1), ""):
            self.output += line

    def wait_for(self, pattern, timeout_s):
        """Waits until the program has printed something that fits."""
        end = time.monotonic() + timeout_s
        while not re.search(pattern, self.output):
            if self.process.poll() is not None:
                self.reader.join(timeout=END_S)
                if re.search(pattern, self.output):
                    return
                raise Failed(f"ended by itself\n{self.output}")
            if time.monotonic() > end:
                raise Failed(f"did not print {re.compile(pattern).pattern} within {timeout_s} s\n{self.output}")
            time.sleep(0.05)

    def stop(self):
        """Presses Ctrl-C and waits."""
        if self.process.poll() is not None:
            raise Failed(f"ended by itself\n{self.output}")
        os.killpg(self.process.pid, signal.SIGINT)
        try:
            self.process.wait(timeout=END_S)
        except subprocess.TimeoutExpired:
            raise Failed(f"did not end by Ctrl-C\n{self.output}") from None
        self.reader.join(timeout=END_S)

    def kill(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@contextlib.contextmanager
def running(arguments, clone, environment):
    program = Program(arguments, clone, environment)
    try:
        yield program
    finally:
        program.kill()


def wait_for_free_ports():
    """The simulator's own ports are used, as the pages say."""
    for kind, port in SIMULATOR_PORTS:
        end = time.monotonic() + END_S
        while not is_free(kind, port):
            if time.monotonic() > end:
                raise Failed(f"port {port} is in use: stop the simulator or ground station that has it")
            time.sleep(0.2)


def is_free(kind, port):
    with socket.socket(socket.AF_INET, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


@contextlib.contextmanager
def simulator(clone, environment):
    """The simulator as the README starts it."""
    wait_for_free_ports()
    with running(["cargo", "run"], clone, environment) as program:
        program.wait_for("MAVLink on tcp:", BLOCK_TIMEOUT_S)
        yield
        program.stop()


def run_script(commands, clone, environment):
    """Runs commands as one script; yields the seconds of each and stops with `Failed` at the first that fails."""
    with tempfile.NamedTemporaryFile("w+") as times:
        # The shell notes when each command has ended.
        note = f'\necho "$EPOCHREALTIME" >>{times.name}\n'
        started = time.time()
        result = subprocess.run(
            ["bash", "-ec", note.join(commands) + note], cwd=clone, env=environment, text=True, errors="replace",
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=BLOCK_TIMEOUT_S,
        )  # fmt: skip
        for ended in map(float, times.read().split()):
            yield ended - started
            started = ended
    if result.returncode != 0:
        raise Failed(f"exit code {result.returncode}\n{result.stdout}")


def run_until_stopped(arguments, clone, environment):
    """Starts a program, sees that it says something and stays, and presses Ctrl-C."""
    with running(arguments, clone, environment) as program:
        program.wait_for(FIRST_LINE, BLOCK_TIMEOUT_S)
        time.sleep(STAY_S)
        # Later one: Python's own word for Ctrl-C, and what MAVProxy's log writer has to say to it at times.
        traceback = re.search(r"^Traceback", program.output, re.MULTILINE)
        program.stop()
    if traceback or "panicked at" in program.output:
        raise Failed(f"did not run well\n{program.output}")


# The report


class Report:
    """A line for each command, and the sum."""

    def __init__(self):
        self.counts = {"passed": 0, "failed": 0, "skipped": 0}
        self.started = time.monotonic()

    def add(self, block, command, outcome, note):
        self.counts[outcome] += 1
        first_line, *more = command.splitlines()
        where = f"{block.page}:{block.line}"
        print(f"  {outcome:7}  {note:>11}  {where:38} {first_line}{' …' if more else ''}", flush=True)

    def fail(self, block, command, failure):
        reason, _, output = str(failure).partition("\n")
        self.add(block, command, "failed", "")
        print(f"    {reason}")
        for line in output.splitlines()[-40:]:
            print(f"    | {line}")

    def sum(self):
        counts = ", ".join(f"{count} {outcome}" for outcome, count in self.counts.items())
        return f"{counts} in {time.monotonic() - self.started:.1f}s"


class Runner:
    """Runs blocks in a clone."""

    def __init__(self, clone, environment, already_run, report, budget_s=math.inf):
        self.clone, self.environment = clone, environment
        self.already_run, self.report = already_run, report
        self.end = time.monotonic() + budget_s

    def run(self, block):
        commands = commands_of(block.text) if block.language == "sh" else [block.text]
        if block.markers & ONLY_CHECKED:
            return self.check_only(block, commands, ", ".join(block.markers & ONLY_CHECKED))
        if time.monotonic() >= self.end:
            return self.check_only(block, commands, "the time budget is used up")
        with contextlib.ExitStack() as stack:
            try:
                if "simulator" in block.markers:
                    stack.enter_context(simulator(self.clone, self.environment))
            except Failed as failure:
                return self.report.fail(block, "cargo run", failure)
            if "until stopped" in block.markers:
                self.run_each_until_stopped(block, commands)
            elif block.language == "python":
                self.run_python(block)
            else:
                self.run_commands(block, commands)

    def check_only(self, block, commands, reason):
        for command in commands:
            error = syntax_error(command) if block.language == "sh" else python_error(command)
            if error:
                self.report.fail(block, command, Failed(error))
            else:
                self.report.add(block, command, "skipped", reason)

    def run_commands(self, block, commands):
        done = 0
        script = [":" if without_comment(command) in self.already_run else command for command in commands]
        try:
            for seconds in run_script(script, self.clone, self.environment):
                note = "already run" if script[done] == ":" else f"{seconds:.1f} s"
                self.report.add(block, commands[done], "passed", note)
                done += 1
        except (Failed, subprocess.TimeoutExpired) as failure:
            self.report.fail(block, commands[min(done, len(commands) - 1)], failure)

    def run_python(self, block):
        with self.program_file(block) as file:
            try:
                (seconds,) = run_script([f"python {file}"], self.clone, self.environment)
                self.report.add(block, block.text, "passed", f"{seconds:.1f} s")
            except (Failed, subprocess.TimeoutExpired) as failure:
                self.report.fail(block, block.text, failure)

    def run_each_until_stopped(self, block, commands):
        for command in commands:
            started = time.monotonic()
            with self.program_file(block) as file:
                arguments = ["python", file] if block.language == "python" else ["bash", "-ec", command]
                try:
                    run_until_stopped(arguments, self.clone, self.environment)
                    self.report.add(block, command, "passed", f"{time.monotonic() - started:.1f} s")
                except Failed as failure:
                    self.report.fail(block, command, failure)

    @contextlib.contextmanager
    def program_file(self, block):
        with tempfile.NamedTemporaryFile("w", suffix=".py") as file:
            file.write(block.text)
            file.flush()
            yield file.name


def python_error(text):
    try:
        ast.parse(text)
    except SyntaxError as error:
        return str(error)
    return ""


def documented_blocks(folder, patterns):
    """The blocks of all pages, the README's first."""
    for pattern in patterns:
        for path in sorted(folder.glob(pattern)):
            yield from blocks_of(str(path.relative_to(folder)), path.read_text(encoding="utf-8"))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", default=PAGES, help=f"pages or patterns ({' '.join(PAGES)})")
    parser.add_argument("--already-run", action="append", default=[], metavar="COMMAND",
                        help="counts as passed without being run")  # fmt: skip
    parser.add_argument("--budget", type=float, default=math.inf, metavar="SECONDS",
                        help="after that, only check the syntax of what is left")  # fmt: skip
    parser.add_argument("--empty-target", action="store_true", help="build everything, as on a new machine")
    arguments = parser.parse_args()

    # A shell that starts this in the background has Ctrl-C ignored, and so would have everything started from here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if not arguments.empty_target:
        build_the_firmware_here()
        make_the_venv_here()
    report = Report()
    with scratch_clone(arguments.empty_target) as (clone, environment):
        runner = Runner(clone, environment, arguments.already_run, report, arguments.budget)
        try:
            blocks = list(documented_blocks(clone, arguments.pages))
        except Failed as failure:
            sys.exit(str(failure))
        for block in blocks:
            runner.run(block)
    print(report.sum())
    sys.exit(1 if report.counts["failed"] or not report.counts["passed"] else 0)


if __name__ == "__main__":
    main()
