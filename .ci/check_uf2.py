"""Checks that a UF2 file carries the firmware's flash image for the RP2040.

Usage: check_uf2.py ELF UF2
"""

import struct
import sys

BLOCK = struct.Struct("<8I476sI")
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)
RP2040_FAMILY = 0xE48BFF56
PT_LOAD = 1


def uf2_image(data):
    """Bytes by address."""
    image = {}
    for offset in range(0, len(data), BLOCK.size):
        start0, start1, flags, address, length, _, _, family, payload, end = BLOCK.unpack_from(data, offset)
        assert (start0, start1, end) == MAGIC, f"no UF2 block at {offset}"
        assert family == RP2040_FAMILY, f"family {family:#x}"
        image.update((address + i, payload[i]) for i in range(length))
    return image


def flash_segments(elf):
    """Load address and bytes of each segment that lies in flash."""
    table, = struct.unpack_from("<I", elf, 0x1C)
    entry_size, count = struct.unpack_from("<HH", elf, 0x2A)
    for i in range(count):
        kind, offset, _, address, size, *_ = struct.unpack_from("<8I", elf, table + i * entry_size)
        if kind == PT_LOAD and size:
            yield address, elf[offset : offset + size]


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
