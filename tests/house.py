"""Counts what makes production code hard to read: long functions, wide structs, and lines that two places share.

    python3 tests/house.py [--most N]

Production code is every Rust file that git tracks under src, without tests: files and folders of that name, and modules
under #[cfg(test)]. The first table counts functions by their lines from `fn` to the closing brace, the second structs by
their fields, the third lists pairs of places with at least six equal lines (spaces at the ends, blank lines, comments
and `use` do not count).
"""

import argparse
import collections
import pathlib
import re
import subprocess

FUNCTION = re.compile(r"(\s*)(?:pub(?:\([^)]*\))? )?(?:const |unsafe |async |extern \"C\" )*fn (\w+)")
STRUCT = re.compile(r"(\s*)(?:pub(?:\([^)]*\))? )?struct (\w+)[^;(]*\{$")
FIELD = re.compile(r"\s*(?:pub(?:\([^)]*\))? )?\w+: ")
SHARED = 6


def production(root):
    """Yields each file with its lines before the first module of tests."""
    listed = subprocess.run(["git", "ls-files", "src"], cwd=root, capture_output=True, text=True, check=True)
    for name in listed.stdout.split():
        parts = pathlib.PurePath(name).parts
        if not name.endswith(".rs") or "tests.rs" in parts[-1] or "tests" in parts:
            continue
        lines = (root / name).read_text().split("\n")
        for number, line in enumerate(lines[:-1]):
            if line == "#[cfg(test)]" and re.match(r"(pub\(\w+\) )?mod \w+ \{", lines[number + 1]):
                lines = lines[:number]
                break
        yield name, lines


def blocks(lines, head):
    """Yields name, first and last line of what starts with `head` and ends with a brace as far to the left."""
    for first, line in enumerate(lines):
        found = head.match(line)
        if not found:
            continue
        for last in range(first, len(lines)):
            if lines[last] == found[1] + "}":
                yield found[2], first, last
                break
            if last > first and lines[last].startswith(found[1] + ")") and lines[last].endswith(";"):
                break
            if lines[last].endswith(";") and last == first:
                break


def shared(files):
    """Returns pairs of places with equal lines, the longest first."""
    counted = {}
    places = collections.defaultdict(list)
    for name, lines in files:
        kept = [(n, line.strip()) for n, line in enumerate(lines)]
        kept = [(n, line) for n, line in kept if line and not line.startswith(("//", "use ", "#["))]
        counted[name] = kept
        for at in range(len(kept) - SHARED + 1):
            window = tuple(line for _, line in kept[at : at + SHARED])
            if sum(len(line) for line in window) > 60:
                places[window].append((name, at))
    pairs, seen = [], set()
    for found in places.values():
        for one in range(len(found)):
            for other in range(one):
                (a, i), (b, j) = found[other], found[one]
                if (a, i, b, j) in seen or (a == b and abs(i - j) < SHARED):
                    continue
                length = 0
                while (
                    i + length < len(counted[a])
                    and j + length < len(counted[b])
                    and counted[a][i + length][1] == counted[b][j + length][1]
                ):
                    seen.add((a, i + length, b, j + length))
                    length += 1
                pairs.append((length, f"{a}:{counted[a][i][0] + 1}", f"{b}:{counted[b][j][0] + 1}"))
    return sorted((pair for pair in pairs if pair[0] >= SHARED), reverse=True)


def main():
    words = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    words.add_argument("--most", type=int, default=12, help="rows of each table")
    most = words.parse_args().most
    files = list(production(pathlib.Path(__file__).resolve().parent.parent))
    functions, structs = [], []
    for name, lines in files:
        functions += [(last - first + 1, what, name) for what, first, last in blocks(lines, FUNCTION)]
        for what, first, last in blocks(lines, STRUCT):
            fields = sum(bool(FIELD.match(line)) for line in lines[first + 1 : last])
            structs.append((fields, what, name))
    print(f"lines of production code: {sum(len(lines) for _, lines in files)}")
    for title, rows, limits in [("lines of functions", functions, (150, 100)), ("fields of structs", structs, (30, 20))]:
        above = ", ".join(f"{sum(row[0] > limit for row in rows)} above {limit}" for limit in limits)
        print(f"\n{title}: {above}")
        for row in sorted(rows, reverse=True)[:most]:
            print(f"{row[0]:6} {row[1]:32} {row[2]}")
    pairs = shared(files)
    print(f"\npairs of places that share at least {SHARED} lines: {len(pairs)}")
    for length, one, other in pairs[:most]:
        print(f"{length:6} {one}  {other}")


main()
