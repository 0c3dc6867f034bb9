#!/usr/bin/env python3
"""Counts the words of the documentation by page, as `wc -w` does, against each page's budget.

Prints a row for each page, pages that are missing or have no budget, and sentences of eight or more words that stand on
two pages; code blocks, headings and the heads of tables aside. With `--strict` it fails if a page is over its budget or
has none, or if a sentence is repeated.
"""

import argparse
import collections
import pathlib
import re
import subprocess
import sys

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]

# Pages that share a budget stand together.
BUDGETS = {
    ("README.md",): 1350,
    ("docs/getting-started.md",): 2650,
    ("docs/packs.md",): 2450,
    ("docs/failsafes.md",): 1600,
    ("docs/wifi.md",): 2000,
    ("docs/logs.md",): 1500,
    ("docs/fleet.md",): 1200,
    ("docs/troubleshooting.md",): 3400,
    ("docs/ground-stations.md",): 1650,
    ("docs/hardware.md",): 2200,
    ("docs/architecture.md",): 1750,
    ("docs/battery-model.md",): 2200,
    ("docs/parity.md",): 2150,
    ("docs/extending.md",): 1600,
    ("docs/proof.md",): 2850,
    ("docs/decisions.md",): 3550,
    ("CONTRIBUTING.md", "CHANGELOG.md"): 1900,
}
# All of it is generated.
NOT_COUNTED = "docs/parameters.md"
# Counts without its generated parts, and has no budget of its own.
PARTLY_GENERATED = "docs/performance.md"
GENERATED = re.compile(r"<!-- (\w+) begins -->.*?<!-- \1 ends -->", re.DOTALL)
README_OF_A_FOLDER = re.compile(r"(?:examples|tests|web)/(?:.*/)?README\.md")
README_BUDGET = 250
LEAST_WORDS = 8


def pages_of(repository):
    """The pages that git knows of or would add, with their text."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=repository, capture_output=True, text=True, check=True,
    ).stdout.split("\0")[:-1]  # fmt: skip
    files = {name: repository / name for name in sorted(set(listed))}
    return {name: file.read_text(encoding="utf-8") for name, file in files.items() if file.exists()}


def rows_of(words):
    """Each page, or pages with one budget: names, words or None if one is missing, and budget or None without one."""
    for names, budget in BUDGETS.items():
        yield names, sum(words[name] for name in names) if all(name in words for name in names) else None, budget
    budgeted = {name for names in BUDGETS for name in names}
    for name in words.keys() - budgeted - {NOT_COUNTED, PARTLY_GENERATED}:
        yield (name,), words[name], README_BUDGET if README_OF_A_FOLDER.fullmatch(name) else None


def verdict(count, budget):
    if count is None:
        return "missing"
    if budget is None:
        return "not in the budget"
    return f"{count - budget} over" if count > budget else ""


def sentences_of(text):
    """The sentences of a page's prose, list items and table cells, without their markup."""
    prose = re.sub(r"```.*?```|<!--.*?-->", "\n\n", text, flags=re.DOTALL)
    # The head of a table stands above its line of dashes.
    prose = re.sub(r"^ *\|.*\n *\|[ :|-]+\|$", "\n", prose, flags=re.MULTILINE)
    prose = re.sub(r"^ *#.*$", "\n", prose, flags=re.MULTILINE)
    prose = re.sub(r"\]\([^)]*\)", "]", prose)
    for block in re.split(r"\n\s*\n|^ *(?:[-*]|\d+\.) |\|", prose, flags=re.MULTILINE):
        for sentence in re.split(r"(?<=[.!?])\s+", block.strip()):
            yield " ".join(re.sub(r"[`*_\[\]]", "", sentence).split()).rstrip(".:").lower()


def repeated_sentences(pages):
    """Sentences that stand on more than one page, with the pages."""
    found = collections.defaultdict(set)
    for name, text in pages.items():
        for sentence in sentences_of(text):
            if len(sentence.split()) >= LEAST_WORDS:
                found[sentence].add(name)
    return {sentence: sorted(names) for sentence, names in found.items() if len(names) > 1}


def report(pages):
    """Prints everything, and returns how many complaints there are."""
    words = {name: len(text.split()) for name, text in pages.items()}
    complaints, counted = 0, 0
    for names, count, budget in sorted(rows_of(words), key=lambda row: (row[2] is None, row[0])):
        is_of_a_folder = README_OF_A_FOLDER.fullmatch(names[0])
        counted += 0 if is_of_a_folder else count or 0
        said = verdict(count, budget)
        complaints += said not in ("", "missing")
        print(f"  {'-' if count is None else count:>6} of {budget or '-':>5}  {' + '.join(names):42} {said}".rstrip())
    prose = len(GENERATED.sub("", pages.get(PARTLY_GENERATED, "")).split())
    counted += prose
    complaints += counted > sum(BUDGETS.values())
    print(f"  {prose:>6}           {PARTLY_GENERATED:42} without {words.get(PARTLY_GENERATED, 0) - prose} that are generated")
    print(f"  {words.get(NOT_COUNTED, 0):>6}           {NOT_COUNTED:42} not counted")
    repeated = repeated_sentences(pages)
    for sentence, names in sorted(repeated.items()):
        print(f"  on {' and '.join(names)}: {sentence}")
    print(f"{counted} words of {sum(BUDGETS.values())}, READMEs of folders aside; {len(repeated)} sentences on two pages")
    return complaints + len(repeated)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strict", action="store_true", help="fail if there is anything to complain of")
    arguments = parser.parse_args()
    complaints = report(pages_of(REPOSITORY))
    sys.exit(1 if arguments.strict and complaints else 0)


if __name__ == "__main__":
    main()
