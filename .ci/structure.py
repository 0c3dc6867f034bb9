#!/usr/bin/env python3
"""Checks that imports in src/, crates/ and tools/ run one way: between folders, and between files. Test code does not count.

Usage: structure.py [DIRECTORY] [--floors]

An import leads to the file that defines the name, through any re-export on the way. A `mod.rs` that declares and
re-exports its children does not depend on them, one whose own code uses them does. A folder stands above everything
it imports; if folders import each other in a circle, the fewest arrows that would break it run back up. Every folder
is checked among its neighbours, files beside it included, so a new one needs no entry here.

Prints `0 arrows back up, 0 file cycles`, or what is in the way, and fails then. `--floors` also prints the folders
and files of each of these themselves, the top floor first.

Read are `use` items and paths in the code; a method that is called on a value is not an import.
"""

import collections
import itertools
import pathlib
import re
import sys

# Where the sources of the libraries are, each with its programs in bin/.
LIBRARIES = {"battery_gauge": "crates/battery-gauge/src", "rover_battmon": "src", "rover_battmon_tools": "tools/src"}

# Comments, strings and characters hold no imports. A lifetime is not a character.
NO_CODE = re.compile(
    r"""//[^\n]*
      | /\*.*?\*/
      | b?r(?P<hashes>\#*)".*?"(?P=hashes)
      | b?"(?:[^"\\]|\\.)*"
      | b?'(?:[^'\\\n]|\\(?:x[0-9a-fA-F]{2}|u\{[0-9a-fA-F_]+\}|.))'
    """,
    re.VERBOSE | re.DOTALL,
)
TEST_ONLY = re.compile(r"#\[cfg\((?:test|all\([^\]]*\btest\b[^\]]*\))\)\]")
USE = re.compile(r"(?P<public>\bpub(?:\([^)]*\))?\s+)?\buse\s+(?P<tree>[^;]+);")
MODULE = re.compile(r"\bmod\s+(\w+)\s*;")
PATH = re.compile(r"(?<![\w:])(?:\$?crate|\w+)(?:\s*::\s*\w+)+")
NAME = re.compile(r"\b[A-Za-z_]\w*\b")


def without_tests(code):
    """The code without items marked `#[cfg(test)]`, and the modules in files of their own among those."""
    test_modules = set()
    while marked := TEST_ONLY.search(code):
        end, depth = marked.end(), 0
        # The item ends at its closing brace or, before any brace, at its semicolon.
        for end in range(marked.end(), len(code)):
            if code[end] == "{":
                depth += 1
            elif code[end] == "}":
                depth -= 1
            if depth == 0 and code[end] in ";}":
                break
        item = code[marked.end() : end + 1]
        test_modules.update(MODULE.findall(item))
        code = code[: marked.start()] + code[end + 1 :]
    return code, test_modules


def leaves(tree, before=()):
    """The paths of a `use` tree, each with the name it binds; `*` and `_` bind none."""
    tree = tree.strip()
    group = re.fullmatch(r"((?:::\s*)?(?:\w+\s*::\s*)*)\{(.*)\}", tree, re.DOTALL)
    if not group:
        path, _, alias = (part.strip() for part in re.sub(r"\s+as\s+", "@", tree).partition("@"))
        names = before + tuple(re.split(r"\s*::\s*", path))
        if names[-1] == "self":
            names = names[:-1]
        yield names, alias or names[-1]
        return
    head = tuple(name for name in re.split(r"\s*::\s*", group[1].strip()) if name)
    # A leading `::` names another crate.
    head = ("::",) + head if group[1].startswith("::") else head
    depth, start = 0, 0
    for place, sign in enumerate(group[2] + ","):
        if sign == "{":
            depth += 1
        elif sign == "}":
            depth -= 1
        elif sign == "," and depth == 0:
            if part := group[2][start:place].strip():
                yield from leaves(part, before + head)
            start = place + 1


class Module:
    """A module in a file of its own. Modules written inside a file belong to the file's."""

    def __init__(self, crate, path, file, code):
        self.crate = crate
        self.path = path
        self.file = file
        self.bindings = {}
        self.imports = []
        self.reexports = []
        reexported = {}
        for use in USE.finditer(code):
            for names, alias in leaves(use["tree"]):
                self.bindings[alias] = names
                if use["public"]:
                    reexported[alias] = names
                else:
                    self.imports.append(names)
        self.body = MODULE.sub(" ", USE.sub(" ", code))
        used = set(NAME.findall(self.body))
        for alias, names in reexported.items():
            (self.imports if alias in used else self.reexports).append(names)
        for path_in_code in PATH.finditer(self.body):
            self.imports.append(tuple(re.split(r"\s*::\s*", path_in_code[0].replace("$", ""))))


class Sources:
    """The modules of all crates by their paths, of which the first name is the crate's. A program is a crate, too."""

    def __init__(self, root):
        self.root = root
        self.modules = {}
        for library, folder in LIBRARIES.items():
            source = root / folder
            self.read(library, (library,), source / "lib.rs", source)
            for file in [*sorted(source.glob("bin/*.rs")), *sorted(source.glob("bin/*/main.rs"))]:
                self.read(str(file), (str(file),), file, file.parent)

    def read(self, crate, path, file, folder):
        code, test_modules = without_tests(NO_CODE.sub(" ", file.read_text()))
        self.modules[path] = Module(crate, path, file, code)
        for name in MODULE.findall(code):
            if name in test_modules:
                continue
            inside = folder / name
            beside = folder / f"{name}.rs"
            self.read(crate, (*path, name), beside if beside.exists() else inside / "mod.rs", inside)

    def definer(self, module, names, otherwise=None):
        """The module that defines what `names` stand for in `module`; `otherwise` if that does not know the first."""
        if not names:
            return module
        first, rest = names[0], names[1:]
        if first in LIBRARIES:
            start = self.modules[first,]
        elif first == "crate":
            start = self.modules[module.crate,]
        elif first == "self":
            start = module
        elif first == "super" and len(module.path) > 1:
            start = self.modules[module.path[:-1]]
        elif (*module.path, first) in self.modules:
            start = self.modules[(*module.path, first)]
        elif first in module.bindings and module.bindings[first][0] != first:
            return self.definer(module, module.bindings[first] + rest)
        else:
            return otherwise
        # What a path leads to and nothing else knows is defined there.
        return self.definer(start, rest, start)

    def arrows(self):
        """For each pair of files the names that the first takes from the second."""
        found = collections.defaultdict(set)
        for module in self.modules.values():
            for names in module.imports + module.reexports:
                target = self.definer(module, names)
                # Handing on what a child defines is not an import.
                if target and names in module.reexports and target.path[: len(module.path)] == module.path:
                    continue
                # What stands behind an imported name is of the import's file, unless that name is a module.
                if names[0] in module.bindings and self.definer(module, names[:1]) is target:
                    continue
                if target and target.file != module.file:
                    found[self.name(module.file), self.name(target.file)].add(names[-1])
        return found

    def name(self, file):
        return file.relative_to(self.root).parts


def circles(arrows):
    """The strongly connected parts with more than one member."""
    below = collections.defaultdict(set)
    for above, under in arrows:
        below[above].add(under)

    def reach(start):
        found, waiting = set(), [start]
        while waiting:
            for under in below[waiting.pop()] - found:
                found.add(under)
                waiting.append(under)
        return found

    reached = {node: reach(node) for node in {node for arrow in arrows for node in arrow}}
    return {
        frozenset(other for other in reached[node] if node in reached[other])
        for node in reached
        if node in reached[node]
    }


def back_up(circle, arrows):
    """The fewest arrows that break a circle; of equally few those that carry the fewest names."""
    inside = {pair: len(names) for pair, names in arrows.items() if set(pair) <= circle}
    for count in range(1, len(inside) + 1):
        breaking = [
            cut
            for cut in itertools.combinations(inside, count)
            if not circles({pair: names for pair, names in arrows.items() if pair in inside and pair not in cut})
        ]
        if breaking:
            return min(breaking, key=lambda cut: (sum(inside[pair] for pair in cut), cut))


def neighbours(arrows, folder):
    """The arrows between the members of a folder, files and folders; its own `mod.rs` is not one of them."""
    found = collections.defaultdict(set)
    depth = len(folder)
    for (above, under), names in arrows.items():
        if above[:depth] == folder == under[:depth]:
            pair = above[: depth + 1], under[: depth + 1]
            if pair[0] != pair[1] and not {"mod.rs", "lib.rs"} & {pair[0][-1], pair[1][-1]}:
                found[pair].update((above, under, name) for name in names)
    return found


def floors(rooms):
    """Each room's floor: one above the highest it imports."""
    below = collections.defaultdict(set)
    for above, under in rooms:
        below[above].add(under)
    floor = lambda room: 1 + max((floor(under) for under in below[room]), default=0)
    return {room: floor(room) for room in {room for arrow in rooms for room in arrow}}


def shown(parts):
    return "/".join(parts)


def main():
    arguments = [argument for argument in sys.argv[1:] if argument != "--floors"]
    root = pathlib.Path(arguments[0]) if arguments else pathlib.Path(__file__).resolve().parents[1]
    arrows = Sources(root).arrows()
    files = {file for arrow in arrows for file in arrow}

    upward = 0
    for folder in sorted({file[:depth] for file in files for depth in range(len(file))}):
        rooms = neighbours(arrows, folder)
        for circle in sorted(circles(rooms), key=sorted):
            # A circle of files alone is a file cycle, below.
            if all(room in files for room in circle):
                continue
            for above, under in back_up(circle, rooms):
                upward += 1
                print(f"arrow back up: {shown(above)} -> {shown(under)}")
                for source, target, name in sorted(rooms[above, under]):
                    print(f"    {shown(source)} -> {shown(target)}: {name}")
    cycles = sorted(circles(arrows), key=sorted)
    for cycle in cycles:
        print(f"file cycle: {', '.join(map(shown, sorted(cycle)))}")
        for (above, under), names in sorted(arrows.items()):
            if above in cycle and under in cycle:
                print(f"    {shown(above)} -> {shown(under)}: {', '.join(sorted(names))}")
    if "--floors" in sys.argv and not upward:
        for folder in LIBRARIES.values():
            by_floor = collections.defaultdict(list)
            for room, floor in floors(neighbours(arrows, tuple(folder.split("/")))).items():
                by_floor[floor].append(room[-1])
            for floor in sorted(by_floor, reverse=True):
                print(f"{folder}, floor {floor}: {', '.join(sorted(by_floor[floor]))}")
    print(f"{upward} arrows back up, {len(cycles)} file cycles")
    sys.exit(1 if upward or cycles else 0)


if __name__ == "__main__":
    main()
