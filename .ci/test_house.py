"""Counting the sources, and holding the counts to their limits."""

import subprocess

import house
import pytest

SOURCES = {
    "src/lib.rs": "//! What it is.\n\n// A reason.\npub mod a;\n#[cfg(test)]\nmod helper;\n",
    "src/a.rs": "/// Says.\npub struct A {\n    b: u8,\n}\n\n#[cfg(test)]\nmod tests {\n    enum Not {}\n    #[test]\n    fn x() {}\n}\n",
    "src/helper.rs": "fn of_a_test() {}\n",
    "src/a/tests.rs": "#[test]\nfn y() {}\n",
    "tools/src/lib.rs": "enum B {\n    C,\n}\n",
    "tests/host/a.rs": "fn helper() {}\n\n#[test]\nfn z() {\n    helper();\n}\n",
    "tests/emulator/src/lib.rs": "fn chip() {}\n",
    "examples/one.rs": "fn main() {}\n",
}


def test_code_tests_and_comments_are_distinguished():
    counts, lines = house.measure(SOURCES)
    assert counts == {
        "board: lines of code": 4,
        "board: files": 2,
        # As a type that only a test has is not one of the program's, only few are written inside of them.
        "board: types": 2,
        "tools: lines of code": 3,
        "tools: files": 1,
        "tools: types": 1,
        "tests: lines in test functions": 4,
        "tests: lines outside": 2,
        "comments: relative clauses in a thousand lines": 333,
    }
    assert lines["src/a.rs"] == 11


@pytest.fixture
def repository(tmp_path, monkeypatch):
    monkeypatch.setattr(house, "REPOSITORY", tmp_path)
    (tmp_path / ".ci").mkdir()
    (tmp_path / "src").mkdir()
    house.git("init", "-q")
    house.git("config", "user.name", "a")
    house.git("config", "user.email", "a@b.c")
    return tmp_path


def commit(repository, message, limit, types, more_limits=""):
    (repository / house.LIMITS).write_text(f"board: types {limit}\n{more_limits}")
    (repository / "src/lib.rs").write_text("struct A;\n" * types)
    house.git("add", ".")
    house.git("commit", "-q", "-m", message)


def unexplained(repository):
    commits = house.git("log", "--format=%H", "--", house.LIMITS).split()
    return [names for _, names in house.unexplained_raises(commits)]


def test_a_number_rises_alone_and_with_a_reason(repository):
    commit(repository, "One", 1, 1)
    commit(repository, "Raise\n\nBuys a thing.", 5, 1)
    commit(repository, "Use it", 5, 4)
    commit(repository, "Fall", 3, 3)
    assert unexplained(repository) == []
    commit(repository, "Raise", 6, 3)
    assert unexplained(repository) == [["board: types"]], "without a reason"
    commit(repository, "Raise and use\n\nBuys a thing.", 9, 7)
    assert len(unexplained(repository)) == 2, "together with code"


def test_a_held_number_is_dropped_alone_and_with_a_reason(repository):
    commit(repository, "One", 1, 1, "board: files 1\nboard: lines of code 1\n")
    commit(repository, "Print lines", 1, 2, "board: files 1\n")
    assert unexplained(repository) == []
    commit(repository, "Drop a limit", 1, 1)
    assert unexplained(repository) == [["board: files"]]


def test_growth_and_falls_are_reported():
    def complain(types, may_have_room, without=None):
        counts = {**dict.fromkeys(house.HELD, 5), "board: types": types, "board: lines of code": 1000}
        limits = {name: 5 for name in house.HELD if name != without}
        return list(house.complaints(counts, limits, may_have_room))

    assert complain(5, False) == []
    assert "board: types: 6 of 5: make something simpler" in complain(6, True)[0]
    assert "lower it" in complain(4, False)[0]
    assert complain(4, True) == [], "what a raise allows is used little by little"
    assert "tools: files: 5, and .ci/house.txt does not say" in complain(5, False, without="tools: files")[0]


def test_lines_are_printed_and_have_no_limit(repository, monkeypatch, capsys):
    commit(repository, "One", 1, 1, f"board: files 1\ntools: files 0\ntools: types 0\n{house.HELD[-1]} 0\n")
    monkeypatch.setattr("sys.argv", ["house.py"])
    (repository / "src/lib.rs").write_text("struct A;\nfn f() {}\nfn g() {}\n")
    with pytest.raises(SystemExit) as end:
        house.main()
    assert end.value.code == 0
    printed = capsys.readouterr().out.splitlines()
    assert [" ".join(line.split()) for line in printed[:2]] == ["3 board: lines of code", "1 of 1 board: files"]


def test_numbers_are_lowered_to_what_is_there_and_never_raised():
    text = "# How many.\nfiles 5\ntypes 3\n"
    assert house.lower(text, {"files": 4, "types": 9}) == "# How many.\nfiles 4\ntypes 3\n"


def test_what_has_grown_is_shown(repository):
    commit(repository, "One", 9, 1)
    before = house.git("rev-parse", "HEAD").strip()
    commit(repository, "Two", 9, 3)
    shown = list(house.growth(house.working_tree(), before))
    lines = ["board: lines of code", "board: types", "lines of src/lib.rs"]
    assert shown == [f"        +2 {line}" for line in lines]
