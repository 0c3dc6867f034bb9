"""Checks that a UF2 file carries the firmware's flash image for the RP2040.

Usage: check_uf2.py ELF UF2
"""

import struct
import sys

from elf import flash_segments

BLOCK = struct.Struct("<8I476sI")
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)
RP2040_FAMILY = 0xE48BFF56


def uf2_image(data):
    """Bytes by address."""
    image = {}
    for offset in range(0, len(data), BLOCK.size):
        start0, start1, flags, address, length, _, _, family, payload, end = BLOCK.unpack_from(data, offset)
        assert (start0, start1, end) == MAGIC, f"no UF2 block at {offset}"
        assert family == RP2040_FAMILY, f"family {family:#x}"
        image.update((address + i, payload[i]) for i in range(length))
    return image


def main():
    with open(sys.argv[1], "rb") as elf, open(sys.argv[2], "rb") as uf2:
        image = uf2_image(uf2.read())
        total = 0
        for address, content in flash_segments(elf.read()):
            assert bytes(image[address + i] for i in range(len(content))) == content, f"differs at {address:#x}"
            total += len(content)
    print(f"  the UF2 file carries all {total} bytes of the ELF's flash image")


if __name__ == "__main__":
    main()
