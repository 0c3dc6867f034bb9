#!/usr/bin/env python3
"""Packs the files of a release into one ZIP file: the same files make the same bytes.

Usage: archive.py FOLDER ARCHIVE
"""

import pathlib
import sys
import zipfile

# The first day that the format knows.
TIME = (1980, 1, 1, 0, 0, 0)
MODE = 0o644 << 16


def main():
    folder, archive = map(pathlib.Path, sys.argv[1:])
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != archive)
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in files:
            entry = zipfile.ZipInfo(f"{archive.stem}/{path.relative_to(folder).as_posix()}", TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = MODE
            packed.writestr(entry, path.read_bytes())


if __name__ == "__main__":
    main()
