#!/usr/bin/env python3
"""Holds the number of files and types of each package, and of comments that begin with a relative clause.

Each number of house.txt is the most there may be. A larger change begins with one commit that raises them: it changes
house.txt alone, and its body has the estimate and what the growth buys. The change's last commit lowers them to what is
there (`--lower`). Outside of such a change, a commit that makes something smaller lowers its number.

Lines of code and of tests are printed only: a limit on them makes code denser instead of simpler.

Lines of code are those with more than a comment, outside of `#[cfg(test)]`. Test code is what stands in folders of tests,
in modules for tests, or is named by them; examples are not counted.

Usage: house.py [--lower]
"""

import collections
import io
import pathlib
import re
import subprocess
import sys
import tarfile

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
LIMITS = ".ci/house.txt"
HELD = (
    "board: files",
    "board: types",
    "tools: files",
    "tools: types",
    "comments: relative clauses in a thousand lines",
)

# Test code with functions of tests; the emulator and what generates data are not judged by their share.
SCENARIOS = ("host", "firmware", "workbench", "support", "nor_flash", "rig")

CLAUSE = re.compile(r"\s*//[/!]?\s*(What|How|Who(?:se|m)?|Where|So|Those)\b")
TYPE = re.compile(r"^\s*(?:pub(?:\([a-z: ]+\))? )?(?:struct|enum) ", re.MULTILINE)
TEST_ONLY = re.compile(r"\s*#\[cfg\((?:all\()?test\b")
TEST_MODULE = re.compile(
    r"#\[cfg\((?:all\()?test\b[^\]]*\]\s*(?:#\[[^\]]*\]\s*)*(?:pub(?:\([a-z: ]+\))? )?mod (\w+);"
)
NO_BRACES = re.compile(r"\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])'|//.*")


def end_of_item(lines, start):
    """The line behind the item that begins at `start`: behind its closing brace or, before any brace, its semicolon."""
    depth, has_braces = 0, False
    for place in range(start, len(lines)):
        code = NO_BRACES.sub("", lines[place])
        depth += code.count("{") - code.count("}")
        has_braces |= "{" in code
        if (has_braces and depth <= 0) or (not has_braces and code.rstrip().endswith(";")):
            return place + 1
    return len(lines)


def without(lines, begins):
    """The lines that are not part of an item which begins with such a line."""
    place = 0
    while place < len(lines):
        if begins.match(lines[place]):
            place = end_of_item(lines, place)
        else:
            yield lines[place]
            place += 1


def is_code(line):
    return bool(line.strip()) and not line.strip().startswith("//")


def test_modules(sources):
    """Files and folders that a `#[cfg(test)] mod name;` names."""
    for path, text in sources.items():
        path = pathlib.PurePath(path)
        folder = path.parent if path.stem in ("mod", "lib", "main") else path.with_suffix("")
        for name in TEST_MODULE.findall(text):
            yield from (folder / f"{name}.rs", folder / name)


def is_test(path, named):
    return (
        path.parts[0] in ("tests", "benches")
        or "tests" in path.parts[:-1]
        or path.stem == "tests"
        or path.stem.endswith("_tests")
        or path in named
        or any(folder in named for folder in path.parents)
    )


def measure(sources):
    """The numbers, and for each file its lines."""
    named = set(test_modules(sources))
    counts = collections.Counter()
    comments = clauses = 0
    lines_of = {}
    for name, text in sources.items():
        path = pathlib.PurePath(name)
        lines = text.splitlines()
        if path.parts[0] == "examples":
            continue
        lines_of[name] = len(lines)
        if is_test(path, named):
            if path.parts[0] == "tests" and len(path.parts) > 2 and path.parts[1] in SCENARIOS:
                outside = len(list(without(lines, re.compile(r"\s*#\[test\]"))))
                counts["tests: lines in test functions"] += len(lines) - outside
                counts["tests: lines outside"] += outside
            continue
        crate = "tools" if path.parts[0] == "tools" else "board"
        counts[f"{crate}: lines of code"] += sum(map(is_code, without(lines, TEST_ONLY)))
        counts[f"{crate}: files"] += 1
        counts[f"{crate}: types"] += len(TYPE.findall(text))
        for line in filter(lambda line: line.strip().startswith("//"), lines):
            comments += 1
            clauses += bool(CLAUSE.match(line))
    counts["comments: relative clauses in a thousand lines"] = round(1000 * clauses / max(comments, 1))
    return counts, lines_of


def git(*arguments, **options):
    return subprocess.run(
        ["git", "-C", str(REPOSITORY), *arguments], check=True, capture_output=True, text=True, **options
    ).stdout


def working_tree():
    names = git("ls-files", "--cached", "--others", "--exclude-standard", "*.rs").split()
    return {name: (REPOSITORY / name).read_text() for name in names if (REPOSITORY / name).exists()}


def sources_at(commit):
    packed = subprocess.run(
        ["git", "-C", str(REPOSITORY), "archive", commit, "--", ":(glob)**/*.rs"], check=True, capture_output=True
    ).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as files:
        return {file.name: files.extractfile(file).read().decode() for file in files if file.isfile()}


def parse(text):
    limits = {}
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            name, _, number = line.rpartition(" ")
            limits[name.strip()] = int(number)
    return limits


def limits_at(commit):
    try:
        return parse(git("show", f"{commit}:{LIMITS}"))
    except subprocess.CalledProcessError:
        return None


def raised(before, after):
    """The held numbers that allow more, or that are gone."""
    return [name for name in HELD if name in before and (name not in after or after[name] > before[name])]


def unexplained_raises(commits):
    """Commits that raise a number together with something else, or without a reason."""
    for commit in commits:
        before, after = limits_at(f"{commit}^"), limits_at(commit)
        if before is None or after is None or not raised(before, after):
            continue
        files = git("show", "--name-only", "--format=", commit).split()
        reason = git("show", "-s", "--format=%b", commit).strip()
        if files != [LIMITS] or not reason:
            yield commit, raised(before, after)


def growth(sources, commit):
    """What has changed since a commit: numbers, and the files that grew most."""
    now, lines_now = measure(sources)
    then, lines_then = measure(sources_at(commit))
    for name in now:
        if now[name] != then[name]:
            yield f"    {now[name] - then[name]:+6} {name}"
    files = {name: lines_now[name] - lines_then.get(name, 0) for name in lines_now}
    for name in sorted(files, key=files.get, reverse=True)[:10]:
        if files[name] > 0:
            yield f"    {files[name]:+6} lines of {name}"


def complaints(counts, limits, may_have_room):
    """Why the numbers do not fit what was measured."""
    for name in HELD:
        count, limit = counts[name], limits.get(name)
        if limit is None:
            yield f"{name}: {count}, and {LIMITS} does not say how many there may be"
        elif count > limit:
            yield f"{name}: {count} of {limit}: make something simpler, or begin a larger change by raising it alone"
        elif count < limit and not may_have_room:
            yield f"{name}: {count} of {limit}: lower it in this commit (house.py --lower)"


def lower(text, counts):
    """The limits with each number at most what was measured."""
    lines = []
    for line in text.splitlines():
        name, _, number = line.rpartition(" ")
        count = counts.get(name.strip())
        if not line.startswith("#") and count is not None and count < int(number):
            line = f"{name} {count}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def main():
    file = REPOSITORY / LIMITS
    sources = working_tree()
    counts, _ = measure(sources)
    if "--lower" in sys.argv:
        file.write_text(lower(file.read_text(), counts))
    limits = parse(file.read_text())
    for name, count in counts.items():
        limit = f"of {limits.get(name, 0):7}" if name in HELD else ""
        print(f"{count:7} {limit:10} {name}")

    commits = git("log", "--format=%H", "--", LIMITS).split()
    failed = False
    may_have_room = False
    if commits:
        before = limits_at(f"{commits[0]}^")
        may_have_room = before is not None and bool(raised(before, limits))
        print("Since the numbers last changed:")
        print("\n".join(growth(sources, commits[0])) or "    nothing")
    for complaint in complaints(counts, limits, may_have_room):
        print(complaint)
        failed = True
    for commit, names in unexplained_raises(commits):
        print(f"{commit[:10]} raises {', '.join(names)}: alone, and with a reason in its body")
        failed = True
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
