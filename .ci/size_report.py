"""Prints how much flash and RAM a firmware ELF takes, and fails when it is over its budget.

Usage: size_report.py ELF FLASH_KIB RAM_KIB     FLASH_KIB is the budget of both regions of flash together
"""

import sys

from elf import flash_regions, flash_segments, loaded, symbols

RAM = range(0x2000_0000, 0x2004_2000)
SHT_NOBITS = 8


def usage(elf):
    """Bytes of flash and of static RAM."""
    # .data lies in RAM and its initial values in flash.
    flash = sum(size for _, kind, _, size in loaded(elf) if kind != SHT_NOBITS)
    return flash, sum(size for _, _, address, size in loaded(elf) if address in RAM)


def taken(elf):
    """Of each region of flash its name, its size and what is taken of it, in bytes."""
    segments = list(flash_segments(elf))
    for name, region in flash_regions(elf).items():
        yield name, len(region), sum(len(content) for address, content in segments if address in region)


def main():
    path, flash_kib, ram_kib = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    with open(path, "rb") as file:
        elf = file.read()
    for name, _, address, size in loaded(elf):
        print(f"  {name:16} {address:#010x} {size:8}")
    flash, ram = usage(elf)
    for name, size, of_it in taken(elf):
        print(f"  {name} {of_it / 1024:.1f} KiB of {size / 1024:.0f}")
    values = dict(symbols(elf))
    stack = values["_stack_start"] - values["_stack_end"]
    print(f"  flash {flash / 1024:.1f} KiB of {flash_kib}, static RAM {ram / 1024:.1f} KiB of {ram_kib}, "
          f"stack {stack / 1024:.0f} KiB")
    if flash > flash_kib * 1024 or ram > ram_kib * 1024:
        sys.exit("over budget")


if __name__ == "__main__":
    main()
