"""Prints the hash that firmware reports as `flight_custom_version`: the CRC-32 of what its ELF file puts in flash.

Usage: firmware_hash.py ELF
"""

import sys
import zlib

from elf import flash_segments


def main():
    with open(sys.argv[1], "rb") as elf:
        segments = sorted(flash_segments(elf.read()))
    print(f"{zlib.crc32(b''.join(content for _, content in segments)):08x}")


if __name__ == "__main__":
    main()
