"""What the runner of documented commands takes for a command, and what it calls a failure."""

import math
import os

import pytest

import documented_commands as documented
from documented_commands import Block, Failed

PAGE = """# Page
```text
not run
```
<!-- simulator -->
<!-- until stopped -->
```sh
one
```

<!-- hardware, until stopped -->
```python
two
```
1. In a list:
   ```sh
   three \\
     four
   ```
"""


class Reported(documented.Report):
    """Keeps what is reported."""

    def __init__(self):
        super().__init__()
        self.lines = []

    def add(self, block, command, outcome, note):
        super().add(block, command, outcome, note)
        self.lines.append((command, outcome))


def run(folder, text, language="sh", markers=(), already_run=(), budget_s=math.inf):
    report = Reported()
    runner = documented.Runner(folder, dict(os.environ), already_run, report, budget_s)
    runner.run(Block("page.md", 1, language, set(markers), text))
    return report.lines


def test_blocks_come_with_their_line_and_the_markers_above_them():
    blocks = list(documented.blocks_of("page.md", PAGE))
    assert blocks == [
        Block("page.md", 7, "sh", {"simulator", "until stopped"}, "one\n"),
        Block("page.md", 12, "python", {"hardware", "until stopped"}, "two\n"),
        Block("page.md", 16, "sh", set(), "three \\\n  four\n"),
    ]


def test_a_marker_that_does_not_exist_is_a_mistake():
    with pytest.raises(Failed, match="page.md:1: no such marker: hardwear"):
        list(documented.blocks_of("page.md", "<!-- hardwear -->\n```sh\n```\n"))


def test_a_command_is_as_many_lines_as_bash_needs():
    script = "# why\none \\\n  two\n\nfor i in 1 2; do\n  three\ndone\ncat <<END\nfour\nEND\n"
    assert documented.commands_of(script) == [
        "one \\\n  two",
        "for i in 1 2; do\n  three\ndone",
        "cat <<END\nfour\nEND",
    ]


def test_a_block_is_one_script_that_ends_at_the_first_failure(tmp_path):
    lines = run(tmp_path, "word=it\ntest $word = it\nfalse\ntouch never\n")
    assert lines == [("word=it", "passed"), ("test $word = it", "passed"), ("false", "failed")]
    assert not (tmp_path / "never").exists()


def test_what_was_run_before_is_not_run_again(tmp_path):
    assert run(tmp_path, "false   # all of it\n", already_run=["false"]) == [("false   # all of it", "passed")]


def test_hardware_is_not_run_but_read(tmp_path):
    assert run(tmp_path, "false\n", markers=["hardware"]) == [("false", "skipped")]
    assert run(tmp_path, "if\n", markers=["hardware"]) == [("if", "failed")]
    assert run(tmp_path, "a b\n", "python", ["hardware"]) == [("a b\n", "failed")]


def test_what_there_is_no_time_for_is_read_and_listed(tmp_path):
    assert run(tmp_path, "touch never\n", budget_s=0) == [("touch never", "skipped")]
    assert run(tmp_path, "if\n", budget_s=0) == [("if", "failed")]
    assert not (tmp_path / "never").exists()


@pytest.mark.parametrize(
    ("program", "outcome"),
    [
        ("while True: time.sleep(1)", "passed"),
        ("pass", "failed"),
        ("sys.exit(1)", "failed"),
        ("raise ValueError", "failed"),
        ("signal.signal(signal.SIGINT, signal.SIG_IGN)\nwhile True: time.sleep(1)", "failed"),
    ],
)
def test_what_runs_until_it_is_stopped_has_to_stay_and_to_end(tmp_path, monkeypatch, program, outcome):
    monkeypatch.setattr(documented, "STAY_S", 3)
    monkeypatch.setattr(documented, "END_S", 10)
    text = f"import signal, sys, time\nprint('here', flush=True)\n{program}\n"
    assert run(tmp_path, text, "python", ["until stopped"]) == [(text, outcome)]


def test_what_cargo_says_is_not_the_programs_word():
    built = "   Compiling rover-battmon v0.1.0\n    Finished `dev` profile in 1.0s\n     Running `target/debug/rover-battmon-sitl`\n"
    assert not documented.FIRST_LINE.search(built)
    assert not documented.FIRST_LINE.search(built + "   Comp")
    assert documented.FIRST_LINE.search(built + "MAVLink on tcp:127.0.0.1:5760\n")


def test_the_sum_counts_each_outcome(tmp_path):
    report = Reported()
    for outcome in ("passed", "passed", "skipped"):
        report.add(Block("page.md", 1, "sh", set(), ""), "command", outcome, "")
    assert report.sum().startswith("2 passed, 0 failed, 1 skipped in ")


def test_the_clone_is_what_git_knows_with_its_times():
    (here := documented.REPOSITORY / "not-known-to-git").touch()
    try:
        with documented.scratch_clone() as (clone, _):
            assert not (clone / here.name).exists()
            for name in ("Cargo.toml", "src/lib.rs"):
                original, copy = (documented.REPOSITORY / name).stat(), (clone / name).stat()
                assert (copy.st_size, copy.st_mtime_ns) == (original.st_size, original.st_mtime_ns)
    finally:
        here.unlink()
