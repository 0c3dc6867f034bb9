#!/usr/bin/env python3
"""Builds examples/pack-monitor/, firmware that has this library as a dependency.

It is copied to a folder below `target/`, with the path of this clone and with the versions of its Cargo.lock, and built.
The firmware has to link, by its own memory.x, to be as large as docs/extending.md says, and to hold nothing of the Freenove
board. There the clone's own `.cargo/config.toml` applies, too: what it adds are flags that make a program smaller.

On a host the library without its default features has to build without what only the programs there need.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

from elf import symbols
from size_report import usage

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
PAGE = REPOSITORY / "docs/extending.md"
SOURCE = REPOSITORY / "examples/pack-monitor"
CRATE = REPOSITORY / "target/as-a-dependency"
TARGET = REPOSITORY / "target"
FIRMWARE = TARGET / "thumbv6m-none-eabi/release/pack-monitor"

PATH = 'path = "../.."'

# `rover_battmon::board`, as symbols spell it in paths and in types.
BOARD = re.compile(r"rover_battmon(?:5|\.\.)board")
# What only the programs for a host need.
OF_PROGRAMS = ("clap", "ctrlc", "serialport")
# What the page says of the firmware's size, and how far off that may be.
SIZE = re.compile(r"(\d+) KB of flash and (\d+) KB of static RAM")
SIZE_TOLERANCE = 0.05
# Where its memory.x has the stack begin: at the end of RAM.
STACK_START = 0x2004_2000


def copy():
    shutil.rmtree(CRATE, ignore_errors=True)
    shutil.copytree(SOURCE, CRATE, ignore=shutil.ignore_patterns("target", "Cargo.lock"))
    shutil.copy(REPOSITORY / "Cargo.lock", CRATE)
    manifest = CRATE / "Cargo.toml"
    text = manifest.read_text(encoding="utf-8")
    if PATH not in text:
        sys.exit(f"{SOURCE.name}: Cargo.toml does not name the library by {PATH}")
    manifest.write_text(text.replace(PATH, f'path = "{REPOSITORY}"'), encoding="utf-8")


def build():
    # Build scripts and macros are shared with the firmware's own build.
    environment = {**os.environ, "CARGO_TARGET_DIR": str(TARGET)}
    subprocess.run(["cargo", "build", "--release"], cwd=CRATE, env=environment, check=True)


def complaints(elf):
    """What the firmware has that is not its own."""
    found = dict(symbols(elf))
    of_board = sorted(filter(BOARD.search, found))
    yield from (f"of the Freenove board: {name}" for name in of_board)
    if found["HardFault"] != found.get("HardFault_"):
        yield "the fault handler is not cortex-m-rt's"
    if found["_stack_start"] != STACK_START:
        yield f"the stack begins at {found['_stack_start']:#x}: by another memory.x"


def complaints_of_size(page, sizes):
    """What the page says otherwise of flash and static RAM, in bytes."""
    stated = [int(size) for size in SIZE.search(page).groups()]
    for kilobytes, size in zip(stated, sizes, strict=True):
        if abs(kilobytes * 1000 - size) > SIZE_TOLERANCE * size:
            yield f"{size / 1000:.0f} KB, and not {kilobytes} KB as on the page"


def complaints_on_a_host():
    """What a dependent on a host builds that only this repository's programs need."""
    library = ["--package", "rover-battmon", "--no-default-features", "--locked"]
    subprocess.run(["cargo", "check", "--lib", *library], cwd=REPOSITORY, check=True)
    tree = subprocess.run(
        ["cargo", "tree", *library, "--edges", "normal", "--prefix", "none"],
        cwd=REPOSITORY,
        check=True,
        capture_output=True,
        text=True,
    )
    built = {line.split()[0] for line in tree.stdout.splitlines() if line}
    yield from (f"on a host, for programs only: {name}" for name in OF_PROGRAMS if name in built)


def main():
    page = PAGE.read_text(encoding="utf-8")
    copy()
    build()
    elf = FIRMWARE.read_bytes()
    flash, ram = usage(elf)
    print(f"  flash {flash / 1000:.0f} KB, static RAM {ram / 1000:.0f} KB")
    found = [*complaints(elf), *complaints_of_size(page, (flash, ram)), *complaints_on_a_host()]
    for complaint in found:
        print(f"  {complaint}")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
