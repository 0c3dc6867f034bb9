"""Which UF2 files the boot ROM would not write as the ELF has it, or which take more of flash than the firmware has."""

from check_uf2 import not_carried, not_erased, outside

PAGE, SECTOR = 256, 4096
BASE = 0x1000_0000
# Two sectors, a gap of one, and two more.
REGIONS = [range(BASE, BASE + 2 * SECTOR), range(BASE + 3 * SECTOR, BASE + 5 * SECTOR)]
BEHIND_THE_GAP = REGIONS[1].start


def pages(start, end):
    return [(address, bytes(PAGE)) for address in range(start, end, PAGE)]


# The first part fills its last sector, the second does not.
WHOLE = pages(BASE, REGIONS[0].stop) + pages(BEHIND_THE_GAP, BEHIND_THE_GAP + 3 * PAGE)


def test_two_parts_of_which_the_first_fills_its_sectors_are_written_as_they_are():
    assert not list(outside(REGIONS, WHOLE)) and not list(not_erased(WHOLE))


def test_a_filled_gap_is_found():
    assert list(outside(REGIONS, pages(BASE, REGIONS[1].stop))) == [REGIONS[0].stop]


def test_behind_a_sector_that_is_not_filled_one_is_not_erased_and_one_too_late():
    short = pages(BASE, REGIONS[0].stop - 2 * PAGE) + pages(BEHIND_THE_GAP, BEHIND_THE_GAP + 3 * PAGE)
    assert list(not_erased(short)) == [BASE + SECTOR, BEHIND_THE_GAP + 2 * PAGE]


def test_a_sector_that_is_erased_again_is_found():
    assert list(not_erased(pages(BASE, BASE + SECTOR) * 2)) == [BASE]


def test_a_byte_that_is_missing_or_another_is_found():
    segments = [(BASE + PAGE, bytes(10)), (BEHIND_THE_GAP, bytes(SECTOR))]
    assert list(not_carried(segments, WHOLE)) == [BEHIND_THE_GAP]
    assert list(not_carried([(BASE, b"\1")], WHOLE)) == [BASE]
