"""The ring of log files in a flash chip, by the layout in src/recorder/mod.rs, and chips that have one."""

import struct
import zlib

KIB = 1024
CHIP_BYTES = 2048 * KIB
# src/memory/flash_map.rs: the program is in front of the log.
LOG_START, LOG_END = 840 * KIB, 2008 * KIB
# tools/src/sim/flash.rs: the simulator has nothing of what is in front of it in its flash file.
IMAGE_START = 768 * KIB
SECTOR_BYTES, FRONT_BYTES = 4 * KIB, 32
SECTORS = (LOG_END - LOG_START) // SECTOR_BYTES
BLANK = b"\xff"


def read_files(ring):
    """Content by number of the files in the bytes of a ring, oldest first."""
    sectors = [ring[at : at + SECTOR_BYTES] for at in range(0, len(ring), SECTOR_BYTES)]
    assert len(sectors) == SECTORS
    used = {}
    for position, sector in enumerate(sectors):
        magic, sequence, number, index, crc = struct.unpack_from("<4sIHHI", sector)
        if magic == b"LOG1" and crc == checksum(sector[:12]) and sequence % SECTORS == position:
            used[sequence] = number, index, sector[FRONT_BYTES:]
    files, last = {}, None
    for sequence, (number, index, content) in sorted(used.items()):
        assert index == 0 or last == (sequence - 1, number, index - 1), "a gap"
        files[number] = files.get(number, b"") + content
        last = sequence, number, index
    return {number: content.rstrip(BLANK) for number, content in files.items()}


def checksum(words):
    """Of a header or mark: the size of the ring enters it."""
    return zlib.crc32(words + struct.pack("<I", SECTORS))


def ring_with(files, first_sequence, erased):
    """The bytes of a ring with these files, by number, and this many sectors after them erased."""
    ring = bytearray(BLANK * (LOG_END - LOG_START))

    def put(sequence, offset, content):
        at = sequence % SECTORS * SECTOR_BYTES + offset
        ring[at : at + len(content)] = content

    sequence = first_sequence
    for number, content in files.items():
        payload_bytes = SECTOR_BYTES - FRONT_BYTES
        for index, at in enumerate(range(0, len(content), payload_bytes)):
            header = struct.pack("<4sIHH", b"LOG1", sequence, number, index)
            put(sequence, 0, header + struct.pack("<I", checksum(header)))
            put(sequence, FRONT_BYTES, content[at : at + payload_bytes])
            sequence += 1
    for ready in range(sequence, sequence + erased):
        mark = struct.pack("<I", ready)
        put(ready, 16, mark + struct.pack("<I", checksum(b"ERS1" + mark)))
    return bytes(ring)


def ring_of(content):
    """The bytes of the ring in a flash file, of a board or of the simulator: both end where the chip ends."""
    return content[len(content) - (CHIP_BYTES - LOG_START) :][: LOG_END - LOG_START]


def chip_with(ring):
    """A chip with this ring and nothing else."""
    return BLANK * LOG_START + ring + BLANK * (CHIP_BYTES - LOG_END)
