#!/usr/bin/env python3
"""Writes the licences of what is linked into the firmware, as they have to accompany its files.

Usage: .ci/licences.py > THIRD-PARTY.md

What may be used by Apache-2.0 is; of the rest the packages' own licence files are printed, and where a package has none,
the licence's standard text (`.ci/licences/`) with the authors that its manifest names.
"""

import json
import pathlib
import sys

from dependencies import BY_OWN_TEXT, REPOSITORY, TARGET, cargo, licences

STANDARD_TEXTS = REPOSITORY / ".ci/licences"
SHARED = "Apache-2.0"


def linked_packages():
    """The manifests, as cargo reads them, of what is linked into the firmware, in the order of their names."""
    edges = ("--target", TARGET, "--edges", "normal,no-proc-macro")
    linked = {tuple(package.split()[:2]) for package, _ in licences(*edges)}
    metadata = json.loads(cargo("metadata", "--locked", "--format-version", "1").stdout)
    packages = [package for package in metadata["packages"] if (package["name"], f"v{package['version']}") in linked]
    return [package for package in sorted(packages, key=lambda package: package["name"]) if package["source"]]


def copyright_of(package):
    return ", ".join(package["authors"]) or f"the authors of {package['name']}, {package['repository']}"


def own_text(package):
    """What the package itself has as its licence. A file for each of several to choose from: the MIT one is enough."""
    folder = pathlib.Path(package["manifest_path"]).parent
    if package["name"] in BY_OWN_TEXT:
        return "\n\n".join(readable(file) for file in (folder / package["license_file"], *folder.rglob("LICENSE*")))
    files = sorted(folder.glob("LICENSE*"), key=lambda file: ("MIT" not in file.name, file.name))
    return readable(files[0]) if files else None


def readable(file):
    return file.read_text(encoding="utf-8", errors="replace")


def name_of_licence(package):
    return package["license"] or "its own, below"


def standard_text(package):
    text = STANDARD_TEXTS / package["license"]
    if not text.exists():
        sys.exit(f"{package['name']} has no licence file, and {text} is missing")
    return f"Copyright (c) {copyright_of(package)}\n\n{text.read_text(encoding='utf-8')}"


def main():
    packages = linked_packages()
    print("# Licences of what is linked into the firmware\n")
    print("`LICENSE-APACHE` is the text of Apache-2.0, by which everything is used that may be. The others' texts follow.\n")
    print("| package | version | licence |\n|---|---|---|")
    for package in packages:
        print(f"| {package['name']} | {package['version']} | {name_of_licence(package)} |")
    for package in packages:
        if SHARED not in name_of_licence(package):
            print(f"\n## {package['name']}\n````text\n{(own_text(package) or standard_text(package)).strip()}\n````")


if __name__ == "__main__":
    main()
