#!/usr/bin/env python3
"""Builds the page that the rover serves, one file with everything in it: page.html, and page.html.gz beside it.

Usage: build.py [--check]

`--check` writes nothing, and fails if what is committed is not what would be built, or is larger than it may be.
Needs the minifier and the compressor that tests/gcs/requirements.txt names.
"""

import gzip
import pathlib
import re
import sys
from string import ascii_lowercase, ascii_uppercase

import minify
import zopfli.gzip

FOLDER = pathlib.Path(__file__).resolve().parent

# Each uses what stands before it.
SCRIPTS = "messages codec signing link page rover advice drive setup battery plot about logs main".split()

# Fields of messages that the rover has in its lists of logs, too.
NAMES_IN_JSON = {"time_utc"}

MAX_BYTES = 46 * 1024
MAX_COMPRESSED_BYTES = 18_500


def source(name):
    return (FOLDER / name).read_text(encoding="utf-8")


def with_numbers(text):
    """These scripts with constants as their numbers."""
    for name, number in re.findall(r"^const ([A-Z_]+) = (-?[0-9a-fx.]+);$", text, re.MULTILINE):
        text = re.sub(rf"^const {name} = .*|\b{name}\b", lambda found: "" if " " in found[0] else number, text, flags=re.MULTILINE)
    return text


def with_short_names(text):
    """These scripts with MAVLink's names shortened: none is on the wire. Messages have their numbers, and letters those fields that
    are written with an underscore, as nothing else in the scripts is, and our own names that no browser has."""
    table = re.search("MESSAGE_TABLE = `(.*?)`", text, re.DOTALL)[1]
    for name, number in re.findall(r"^([A-Z_]+) (\d+) ", table, re.MULTILINE):
        text = re.sub(rf"'{name}'|^{name}(?= )", number, text, flags=re.MULTILINE)
    fields = dict.fromkeys(field for field in re.findall(r"\b([a-z]+_[a-z_]+):", table) if field not in NAMES_IN_JSON)
    fields.update(dict.fromkeys(re.findall(r"\b(?:is[A-Z][a-z]+|[a-z]+(?:Count|At))\b", text)))
    letters = [one + other for one in ("", *ascii_uppercase) for other in ascii_uppercase]
    for field, letter in zip(fields, letters):
        text = re.sub(rf"\b{field}\b", letter, text)
    return text


def scripts(*names):
    """These scripts as one, in which all names are local: only such are shortened."""
    text = with_short_names(with_numbers("\n".join(source(f"{name}.js") for name in names)))
    return "(()=>{" + text.replace("const ", "let ") + "})()"


def style():
    """The style sheet with its variables shortened."""
    text = source("page.css")
    for name, letter in zip(dict.fromkeys(re.findall(r"--[a-z]+", text)), ascii_lowercase):
        text = re.sub(rf"{name}\b", "--" + letter, text)
    return text


def page():
    text = source("index.html")
    for place, content in {"/* page.css */": style(), "/* scripts */": scripts(*SCRIPTS)}.items():
        assert text.count(place) == 1, place
        text = text.replace(place, content)
    return minify.string("text/html", text).encode()


def main():
    built = page()
    compressed = zopfli.gzip.compress(built, numiterations=500)
    print(f"page.html: {len(built)} of {MAX_BYTES} bytes, {len(compressed)} of {MAX_COMPRESSED_BYTES} compressed")
    if len(built) > MAX_BYTES or len(compressed) > MAX_COMPRESSED_BYTES:
        return "the page is too large"
    plain, packed = FOLDER / "page.html", FOLDER / "page.html.gz"
    if "--check" in sys.argv[1:]:
        fresh = plain.read_bytes() == built and gzip.decompress(packed.read_bytes()) == built
        return None if fresh else "web/page.html is stale: run web/build.py"
    plain.write_bytes(built)
    packed.write_bytes(compressed)
    return None


if __name__ == "__main__":
    sys.exit(main())
