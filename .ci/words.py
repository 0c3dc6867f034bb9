#!/usr/bin/env python3
"""Finds sentences that stand on two pages of the documentation, and counts the words of each page, as `wc -w` does.

A sentence counts from eight words on; code blocks, headings and the heads of tables do not. With `--strict` it fails if
there is one. Words are printed only.
"""

import argparse
import collections
import pathlib
import re
import subprocess
import sys

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
LEAST_WORDS = 8


def pages_of(repository):
    """The pages that git knows of or would add, with their text."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=repository, capture_output=True, text=True, check=True,
    ).stdout.split("\0")[:-1]  # fmt: skip
    files = {name: repository / name for name in sorted(set(listed))}
    return {name: file.read_text(encoding="utf-8") for name, file in files.items() if file.exists()}


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
    """Prints everything, and returns how many sentences are repeated."""
    for name, text in pages.items():
        print(f"{len(text.split()):7} {name}")
    repeated = repeated_sentences(pages)
    for sentence, names in sorted(repeated.items()):
        print(f"on {' and '.join(names)}: {sentence}")
    print(f"{len(repeated)} sentences on two pages")
    return len(repeated)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strict", action="store_true", help="fail if a sentence is repeated")
    arguments = parser.parse_args()
    repeated = report(pages_of(REPOSITORY))
    sys.exit(1 if arguments.strict and repeated else 0)


if __name__ == "__main__":
    main()
