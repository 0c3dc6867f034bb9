"""A newcomer's way, from `git clone` to a failsafe in a ground station. What is typed and what is expected is the pages'.

The clone takes what cargo has built from the same files: to compile everything again shows nothing of the way, and takes
minutes. `.ci/documented_commands.py --empty-target README.md` does.
"""

import contextlib
import re
import sys
import time

import pytest

from conftest import REPOSITORY
from sessions import NUMBER, PROMPT, SECTION, section_of, session_of

sys.path.insert(0, str(REPOSITORY / ".ci"))

import documented_commands as documented

# One MAVProxy at a time: what it repeats in time, it repeats late on a machine that starts others.
pytestmark = pytest.mark.xdist_group("mavproxy")

# Pages with a session in such a ground station, the headings it is below, and what has to be typed in it.
SESSIONS = [("README.md", SECTION, "bat"), ("docs/failsafes.md", "### On a desk", "disarm")]


def way_to_the_session(clone):
    """The blocks of the README that a newcomer goes through before a session with the ground station."""
    before, _ = section_of((clone / "README.md").read_text(encoding="utf-8"), SECTION)
    return documented.blocks_of("README.md", before)


def test_what_a_newcomer_installs_is_what_is_tested():
    tested = (REPOSITORY / "tests/gcs/requirements.txt").read_text(encoding="utf-8").splitlines()
    for page in ["README.md", "docs/ground-stations.md"]:
        text = (REPOSITORY / page).read_text(encoding="utf-8")
        installed = re.search(r"^target/gcs-venv/bin/pip install --quiet (.+)$", text, re.MULTILINE)[1].split()
        assert installed and set(installed) <= set(tested), (page, installed)


def follow(block, clone, environment, stack):
    """Does what a block says; returns the program if it is one that stays."""
    if "until stopped" not in block.markers:
        for _ in documented.run_script(documented.commands_of(block.text), clone, environment):
            pass
        return None
    program = stack.enter_context(documented.running(["bash", "-ec", block.text], clone, environment))
    program.wait_for(documented.FIRST_LINE, documented.BLOCK_TIMEOUT_S)
    return program


def says(station, typed, shown):
    """Types a line until the lines of the page have come, whose figures may differ by a twentieth."""
    so_far = len(station.output)
    # What was set takes a moment to be seen; the charge of a pack at rest follows within half a minute.
    for _ in range(45):
        station.process.stdin.write(typed + "\n")
        station.process.stdin.flush()
        time.sleep(1)
        answer = station.output[so_far:].splitlines()
        if all(any(is_like(line, wanted) for line in answer) for wanted in shown):
            return True
    return False


def is_like(line, wanted):
    line = PROMPT.sub("", line)
    if NUMBER.sub("0", line).strip() != NUMBER.sub("0", wanted).strip():
        return False
    return [float(number) for number in NUMBER.findall(line)] == pytest.approx(
        [float(number) for number in NUMBER.findall(wanted)], rel=0.05
    )


@pytest.mark.parametrize(["page", "heading", "needed"], SESSIONS)
def test_the_pages_lead_from_a_clone_to_a_failsafe(page, heading, needed):
    documented.wait_for_free_ports()
    with documented.scratch_clone() as (clone, environment), contextlib.ExitStack() as stack:
        blocks = way_to_the_session(clone)
        *_, station = programs = [
            program for block in blocks if (program := follow(block, clone, environment, stack)) is not None
        ]
        assert len(programs) == 2, "a simulator and a ground station"
        station.wait_for(r"Received \d+ parameters", 30)

        session = session_of((clone / page).read_text(encoding="utf-8"), heading)
        assert [typed for typed, _ in session].count(needed) > 0
        assert [shown for _, shown in session if "Mode HOLD" in shown], "no failsafe"
        for typed, shown in session:
            assert says(station, typed, shown), f"{typed}: {station.output}"

        simulator = programs[0]
        simulator.stop()
        assert simulator.process.returncode == 0
        assert simulator.output.endswith("Stopped.\n")
