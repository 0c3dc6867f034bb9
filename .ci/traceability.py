#!/usr/bin/env python3
"""Prints a table: which tests show each row of docs/requirements.md.

A test names the requirements that it shows in a comment between its attributes and its name:

    #[test]
    // Requirement: FR-2, AP-13
    fn the_rate_follows_the_parameter() {

In Python the comment begins with `#` and stands above `def`. Fails for a requirement that no test names, unless the page
marks it `(not met)`, and for a comment that names what the page does not have, or that is not at a test. With --check it
prints only how many there are.
"""

import pathlib
import re
import sys

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
PAGE = REPOSITORY / "docs/requirements.md"

REQUIREMENT = re.compile(r"^\| ([A-Z0-9]+-\d+)( \(not met\))? \| ", re.MULTILINE)
COMMENT = re.compile(r"^\s*(?://|#) Requirement: ", re.MULTILINE)
OTHER_LINES = r"(?:\s*(?:#\[.*\]|//.*)\n)*?"
TEST = {
    ".rs": re.compile(rf"#\[test\]\n{OTHER_LINES}\s*// Requirement: (.+)\n{OTHER_LINES}\s*fn (\w+)\("),
    ".py": re.compile(r"^# Requirement: (.+)\ndef (test_\w+)\(", re.MULTILINE),
}

def rows(path):
    """The requirements and tests of a file of tests: (requirement, file, test)."""
    text = path.read_text()
    name = path.relative_to(REPOSITORY).as_posix()
    tests = TEST[path.suffix].findall(text)
    if len(tests) != len(COMMENT.findall(text)):
        sys.exit(f"{name}: a requirement is named where no test is")
    return [(requirement, name, test) for requirements, test in tests for requirement in requirements.split(", ")]

def main():
    stated = REQUIREMENT.findall(PAGE.read_text())
    met = {identifier: not unmet for identifier, unmet in stated}
    files = [path for folder in ("src", "crates", "tools", "tests") for suffix in TEST for path in (REPOSITORY / folder).rglob(f"*{suffix}")]
    found = [row for path in sorted(files) for row in rows(path)]
    if unknown := sorted({row[0] for row in found} - met.keys()):
        sys.exit(f"not on the page: {', '.join(unknown)}")
    shown = {row[0] for row in found}
    if untested := [identifier for identifier, is_met in met.items() if is_met and identifier not in shown]:
        sys.exit(f"no test names {', '.join(untested)}")
    order = list(met)
    found.sort(key=lambda row: (order.index(row[0]), row))
    if "--check" in sys.argv[1:]:
        print(f"{len(met)} requirements, {len(found)} rows")
        return
    for row in [("requirement", "file", "test"), *found]:
        print(",".join(row))

if __name__ == "__main__":
    main()
