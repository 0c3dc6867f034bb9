"""The sessions with MAVProxy that pages show: what is typed at each prompt, and what it shows then."""

import re

PROMPT = re.compile(r"[A-Z]+> ")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")

SECTION = "## On a desk, without a board"


def section_of(page, heading):
    """What stands between a heading and the next one, split before its first block of text."""
    section = re.search(rf"^{heading}\n(.*?)^##", page, re.MULTILINE | re.DOTALL)[1]
    return re.split(r"^```text\n", section, maxsplit=1, flags=re.MULTILINE)


def session_of(page, heading):
    """What is typed at each prompt of a page's session, with the lines shown after it."""
    _, session = section_of(page, heading)
    found = []
    for line in session.split("```")[0].splitlines():
        if prompt := PROMPT.match(line):
            found.append((line[prompt.end() :], []))
        else:
            found[-1][1].append(line)
    return found


def like(line):
    """A pattern for a line with any figures."""
    return NUMBER.pattern.join(re.escape(text) for text in NUMBER.split(line))
