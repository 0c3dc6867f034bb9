"""Reads 32-bit little-endian ELF files, as those of firmware are."""

import struct

SHF_ALLOC = 2
PT_LOAD = 1


def sections(elf):
    """Name, type, flags, address, offset in the file and size of each section."""
    table, entry_size, count, names_index = struct.unpack_from("<I10xHHH", elf, 0x20)
    headers = [struct.unpack_from("<10I", elf, table + i * entry_size) for i in range(count)]
    names_offset = headers[names_index][4]
    for name, kind, flags, address, offset, size, *_ in headers:
        start = names_offset + name
        yield elf[start : elf.index(b"\0", start)].decode(), kind, flags, address, offset, size


def contents(elf, section):
    """The bytes of a section, `None` without one of this name."""
    found = (elf[offset : offset + size] for name, _, _, _, offset, size in sections(elf) if name == section)
    return next(found, None)


def symbols(elf):
    """Name and value of each symbol."""
    strings = contents(elf, ".strtab")
    for name, value, *_ in struct.iter_unpack("<IIIBBH", contents(elf, ".symtab")):
        yield strings[name : strings.index(b"\0", name)].decode(), value


def loaded(elf):
    """Name, type, address and size of each section that takes memory."""
    for name, kind, flags, address, _, size in sections(elf):
        if flags & SHF_ALLOC and size:
            yield name, kind, address, size


def flash_segments(elf):
    """Load address and bytes of each segment that lies in flash."""
    table, = struct.unpack_from("<I", elf, 0x1C)
    entry_size, count = struct.unpack_from("<HH", elf, 0x2A)
    for i in range(count):
        kind, offset, _, address, size, *_ = struct.unpack_from("<8I", elf, table + i * entry_size)
        if kind == PT_LOAD and size:
            yield address, elf[offset : offset + size]


def flash_regions(elf):
    """Name and addresses of each region of flash that the firmware has, by the symbols of `memory.x`."""
    values = dict(symbols(elf))
    return {name: range(values[f"_{name}_start"], values[f"_{name}_end"]) for name in ("program", "constants")}
