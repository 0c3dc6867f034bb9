#!/usr/bin/env python3
"""Builds the page that the rover serves, one file with everything in it: page.html, and page.html.gz beside it.

Usage: build.py [--check]

`--check` writes nothing, and fails if what is committed is not what would be built, or is larger than it may be.
Takes comments and indentation out, nothing else: the page stays readable in a browser's debugger.
"""

import gzip
import pathlib
import re
import sys

FOLDER = pathlib.Path(__file__).resolve().parent

# Each uses what stands before it.
SCRIPTS = "messages codec signing link page rover plot battery drive setup logs about main".split()

MAX_BYTES = 99_000
MAX_COMPRESSED_BYTES = 99_000

# Strings stay as they are. No template of a script has a template in it.
STRING = re.compile(r"""('(?:\\.|[^'\\\n])*'|"(?:\\.|[^"\\\n])*"|`(?:\\.|[^`\\])*`)""")


def source(name):
    return (FOLDER / name).read_text(encoding="utf-8")


def without_indentation(text):
    return "\n".join(line.strip() for line in text.splitlines() if line.strip())


def script():
    text = "\n".join(source(f"{name}.js") for name in SCRIPTS)
    lines = (line.strip() for line in text.splitlines())
    code = "\n".join(line for line in lines if line and not line.startswith("//"))
    parts = STRING.split(code)
    # Comments have gone; a line that ends like this goes on in the next one.
    parts[::2] = [re.sub(r" *([=,;:{}()\[\]?&|<>*]) *", r"\1", part) for part in parts[::2]]
    parts[::2] = [re.sub(r"([;{,(\[])\n|\n(?=[})\].])", r"\1", part) for part in parts[::2]]
    return "".join(parts)


def style():
    return re.sub(r"\s*([{};,>])\s*|\n", r"\1", re.sub(r"(?<=[a-z]): ", ":", without_indentation(source("page.css"))))


def page():
    parts = {"/* page.css */": style(), "/* scripts */": script()}
    built = without_indentation(source("index.html"))
    for place, content in parts.items():
        assert built.count(place) == 1 and "</script" not in content, place
        built = built.replace(place, content)
    return built.encode()


def main():
    built = page()
    compressed = gzip.compress(built, compresslevel=9, mtime=0)
    print(f"page.html: {len(built)} of {MAX_BYTES} bytes, {len(compressed)} of {MAX_COMPRESSED_BYTES} compressed")
    if len(built) > MAX_BYTES or len(compressed) > MAX_COMPRESSED_BYTES:
        return "the page is too large"
    plain, packed = FOLDER / "page.html", FOLDER / "page.html.gz"
    if "--check" in sys.argv[1:]:
        # Compressors differ from one Python to the next, so what comes out again is compared.
        fresh = plain.read_bytes() == built and gzip.decompress(packed.read_bytes()) == built
        return None if fresh else "web/page.html is stale: run web/build.py"
    plain.write_bytes(built)
    packed.write_bytes(compressed)
    return None


if __name__ == "__main__":
    sys.exit(main())
