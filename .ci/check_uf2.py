"""Checks that a UF2 file carries the firmware's flash image for the RP2040, and that the boot ROM writes it without
touching anything else.

Usage: check_uf2.py ELF UF2
"""

import struct
import sys

from elf import flash_regions, flash_segments

BLOCK = struct.Struct("<8I476sI")
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)
RP2040_FAMILY = 0xE48BFF56
SECTOR_BYTES = 4096
# Pages of 256 bytes.
BLOCKS_OF_A_SECTOR = 16


def uf2_blocks(data):
    """Address and content of each block, in the order of their numbers."""
    for number, offset in enumerate(range(0, len(data), BLOCK.size)):
        start0, start1, flags, address, length, noted, _, family, payload, end = BLOCK.unpack_from(data, offset)
        assert (start0, start1, end) == MAGIC, f"no UF2 block at {offset}"
        assert family == RP2040_FAMILY, f"family {family:#x}"
        assert noted == number, f"block {number} has the number {noted}"
        yield address, payload[:length]


def not_carried(segments, blocks):
    """The first address of each segment of which the blocks do not have every byte."""
    image = {address + i: byte for address, content in blocks for i, byte in enumerate(content)}
    for address, content in segments:
        if any(image.get(address + i) != byte for i, byte in enumerate(content)):
            yield address


def outside(regions, blocks):
    """The sectors outside of the regions: a block makes the boot ROM erase all of its sector."""
    sectors = sorted({address // SECTOR_BYTES * SECTOR_BYTES for address, _ in blocks})
    for sector in sectors:
        if not any(sector in region and sector + SECTOR_BYTES <= region.stop for region in regions):
            yield sector


def not_erased(blocks):
    """The first address of each sixteen blocks that are not those of one sector.

    The boot ROM decides by a block's number, and not by its address, whether the sector was erased before: once in sixteen
    numbers (raspberrypi/pico-bootrom-rp2040, issue 19).
    """
    erased = set()
    addresses = [address for address, _ in blocks]
    for first in range(0, len(addresses), BLOCKS_OF_A_SECTOR):
        sectors = {address // SECTOR_BYTES for address in addresses[first : first + BLOCKS_OF_A_SECTOR]}
        if len(sectors) > 1 or sectors & erased:
            yield addresses[first]
        erased |= sectors


def main():
    with open(sys.argv[1], "rb") as elf, open(sys.argv[2], "rb") as uf2:
        elf, blocks = elf.read(), list(uf2_blocks(uf2.read()))
    segments = list(flash_segments(elf))
    complaints = [f"the segment at {address:#x} differs" for address in not_carried(segments, blocks)]
    complaints += [f"the sector {sector:#x} is not the firmware's" for sector in outside(flash_regions(elf).values(), blocks)]
    complaints += [f"the boot ROM does not erase what the blocks from {address:#x} on need" for address in not_erased(blocks)]
    if complaints:
        sys.exit("\n".join(complaints))
    total = sum(len(content) for _, content in segments)
    print(f"  the UF2 file carries all {total} bytes of the ELF's flash image, and touches nothing else")


if __name__ == "__main__":
    main()
