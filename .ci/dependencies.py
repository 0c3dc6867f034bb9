#!/usr/bin/env python3
"""Checks the dependencies: licences against two lists, yanked versions, and that each version stands once, with its use."""

import json
import pathlib
import re
import subprocess
import sys

REPOSITORY = pathlib.Path(__file__).resolve().parents[1]
TARGET = "thumbv6m-none-eabi"

# What may be linked into the firmware, and beside that into programs that stay on the desk.
FIRMWARE = {"MIT", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "Unlicense", "Zlib", "0BSD"}
# Packages without one of these, whose own text allows it: the comment in Cargo.toml.
BY_OWN_TEXT = {"cyw43-firmware"}
DESK = FIRMWARE | {"MPL-2.0", "BSL-1.0", "CC0-1.0", "Unicode-3.0"}

# The table of versions, its entries, those below a comment, and entries of any table that have a version of their own.
TABLE = re.compile(r"^\[workspace\.dependencies\]\n(?:(?!\[).*\n)*", re.MULTILINE)
ENTRY = re.compile(r"^([A-Za-z0-9_-]+) = ", re.MULTILINE)
EXPLAINED = re.compile(r"^# \S.*\n([A-Za-z0-9_-]+) = ", re.MULTILINE)
VERSION = re.compile(r'^([A-Za-z0-9_-]+) = (?:"|\{.*\bversion = )', re.MULTILINE)


def cargo(*arguments):
    result = subprocess.run(["cargo", *arguments], cwd=REPOSITORY, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(result.stderr)
    return result


def is_allowed(licence, allowed):
    """Evaluates an SPDX expression; crates of old write `/` instead of OR."""
    licence = licence.replace("/", " OR ")
    tokens = re.findall(r"\(|\)|AND|OR|[A-Za-z0-9.-]+(?: WITH [A-Za-z0-9.-]+)?", licence)
    words = {"AND": "and", "OR": "or", "(": "(", ")": ")"}
    terms = [words.get(token, str(token in allowed)) for token in tokens]
    # Nothing but these words is left in it.
    return bool(terms) and eval(" ".join(terms))


def licences(*selection):
    """Name and version, and licence, of every package in a part of the tree."""
    listing = cargo("tree", "--locked", "--prefix", "none", "--format", "{p};{l}", *selection).stdout
    return {tuple(line.removesuffix(" (*)").split(";")) for line in listing.splitlines() if line}


def licence_complaints(part, packages, allowed):
    print(f"  licences {part}: {len(packages)} packages")
    for package, licence in sorted(packages):
        if package.split()[0] not in BY_OWN_TEXT and not is_allowed(licence, allowed):
            yield f"{package}: {licence or 'no licence'} is not allowed {part}"


def direct_dependencies():
    """The dependencies of all packages of the workspace, and their manifests."""
    metadata = json.loads(cargo("metadata", "--locked", "--no-deps", "--format-version", "1").stdout)
    used = {dependency["name"] for package in metadata["packages"] for dependency in package["dependencies"]}
    return used, [pathlib.Path(package["manifest_path"]) for package in metadata["packages"]]


def versions_complaints():
    """The table of all versions has a comment above each, and no dependency besides those in use; no other place has a version."""
    used, manifests = direct_dependencies()
    table = TABLE.search((REPOSITORY / "Cargo.toml").read_text()).group()
    listed = set(ENTRY.findall(table))
    explained = set(EXPLAINED.findall(table))
    print(f"  direct dependencies: {len(listed)}")
    yield from (f"{name}: no comment above it in [workspace.dependencies] says what it is for" for name in sorted(listed - explained))
    yield from (f"{name}: in [workspace.dependencies], and used by no package" for name in sorted(listed - used))
    for manifest in manifests:
        elsewhere = used & set(VERSION.findall(manifest.read_text().replace(table, "")))
        yield from (f"{name}: {manifest} has a version of its own" for name in sorted(elsewhere))


def yanked_complaints():
    """Packing what is published is what has cargo look for yanked versions."""
    arguments = ("publish", "--workspace", "--dry-run", "--no-verify", "--allow-dirty", "--target-dir", "target/tmp/package")
    said = cargo(*arguments).stderr
    yield from re.findall(r"package `.*` in Cargo.lock is yanked.*", said)


def main():
    complaints = [
        *licence_complaints("in the firmware", licences("--target", TARGET, "--edges", "normal,no-proc-macro"), FIRMWARE),
        *licence_complaints("on the desk", licences("--target", "all", "--edges", "normal,build,dev"), DESK),
        *versions_complaints(),
        *yanked_complaints(),
    ]
    for complaint in complaints:
        print(f"  {complaint}")
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
