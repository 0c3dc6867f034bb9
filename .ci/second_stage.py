#!/usr/bin/env python3
"""Assembles src/board/second_stage.s to src/board/second_stage.bin: 252 bytes and their checksum.

The assembler is rustc's, for the firmware's target.

Usage: second_stage.py [--check]     --check compares, and writes nothing
"""

import argparse
import pathlib
import struct
import subprocess
import sys
import tempfile

from elf import contents

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
SOURCE = REPOSITORY / "src/board/second_stage.s"
BINARY = SOURCE.with_suffix(".bin")
TARGET = "thumbv6m-none-eabi"
SECTION = ".second_stage"
CODE_BYTES = 252


def assemble(source):
    """The object file."""
    crate = f"""#![no_std]
core::arch::global_asm!(".section {SECTION}, \\"ax\\"", include_str!("{source}"), options(raw));
"""
    with tempfile.TemporaryDirectory() as folder:
        object_file = pathlib.Path(folder) / "second_stage.o"
        command = ["rustc", "--crate-name", "second_stage", "--crate-type", "lib", "--target", TARGET, "--emit", "obj"]
        subprocess.run([*command, "-o", object_file, "-"], cwd=REPOSITORY, input=crate, text=True, check=True)
        return object_file.read_bytes()


def checksum(data):
    """CRC-32 from the most significant bit, of which nothing is inverted at the end (RP2040 datasheet, 2.8.1.3.1)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ 0x04C11DB7 * (crc >> 31)) & 0xFFFFFFFF
    return crc


def image(source):
    """The first 256 bytes of flash."""
    object_file = assemble(source)
    if contents(object_file, f".rel{SECTION}"):
        sys.exit(f"{source.name} is not position-independent: it leaves something to the linker")
    code = contents(object_file, SECTION)
    if len(code) > CODE_BYTES:
        sys.exit(f"{source.name} takes {len(code)} bytes, of which there are {CODE_BYTES}")
    print(f"  {source.name} takes {len(code)} bytes of {CODE_BYTES}")
    padded = code.ljust(CODE_BYTES, b"\0")
    return padded + struct.pack("<I", checksum(padded))


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--check", action="store_true", help="compare, and write nothing")
    if not arguments.parse_args().check:
        BINARY.write_bytes(image(SOURCE))
    elif BINARY.read_bytes() != image(SOURCE):
        sys.exit(f"{BINARY.name} is not what {SOURCE.name} assembles to: run .ci/second_stage.py")


if __name__ == "__main__":
    main()
