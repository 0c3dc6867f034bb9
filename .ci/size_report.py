"""Prints how much flash and RAM a firmware ELF takes, and fails when it is over its budget.

Usage: size_report.py ELF FLASH_KIB RAM_KIB
"""

import struct
import sys

FLASH = range(0x1000_0000, 0x1100_0000)
RAM = range(0x2000_0000, 0x2004_2000)
SHT_NOBITS = 8
SHF_ALLOC = 2


def sections(elf):
    """Name, type, flags, address and size of each section of a 32-bit little-endian ELF."""
    table, entry_size, count, names_index = struct.unpack_from("<I10xHHH", elf, 0x20)
    headers = [struct.unpack_from("<10I", elf, table + i * entry_size) for i in range(count)]
    names_offset = headers[names_index][4]
    for name, kind, flags, address, _, size, *_ in headers:
        start = names_offset + name
        yield elf[start : elf.index(b"\0", start)].decode(), kind, flags, address, size


def symbols(elf):
    """Name and value of each symbol."""
    by_name = {name: i for i, (name, *_) in enumerate(sections(elf))}
    table, entry_size = struct.unpack_from("<I10xH", elf, 0x20)
    header = lambda name: struct.unpack_from("<10I", elf, table + by_name[name] * entry_size)
    strings = header(".strtab")[4]
    _, _, _, _, offset, size, *_ = header(".symtab")
    for name, value, *_ in struct.iter_unpack("<IIIBBH", elf[offset : offset + size]):
        start = strings + name
        yield elf[start : elf.index(b"\0", start)].decode(), value


def loaded(elf):
    """Name, type, address and size of each section that takes memory."""
    for name, kind, flags, address, size in sections(elf):
        if flags & SHF_ALLOC and size:
            yield name, kind, address, size


def usage(elf):
    """Bytes of flash and of static RAM."""
    # .data lies in RAM and its initial values in flash.
    flash = sum(size for _, kind, _, size in loaded(elf) if kind != SHT_NOBITS)
    return flash, sum(size for _, _, address, size in loaded(elf) if address in RAM)


def main():
    path, flash_kib, ram_kib = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    with open(path, "rb") as file:
        elf = file.read()
    for name, _, address, size in loaded(elf):
        print(f"  {name:16} {address:#010x} {size:8}")
    flash, ram = usage(elf)
    values = dict(symbols(elf))
    stack = values["_stack_start"] - values["_stack_end"]
    print(f"  flash {flash / 1024:.1f} KiB of {flash_kib}, static RAM {ram / 1024:.1f} KiB of {ram_kib}, "
          f"stack {stack / 1024:.0f} KiB")
    if flash > flash_kib * 1024 or ram > ram_kib * 1024:
        sys.exit("over budget")


if __name__ == "__main__":
    main()
