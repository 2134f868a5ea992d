"""Counts what makes production code hard to read: long functions, wide structs, and lines that two places share.

    python3 tests/house.py [--most N]

Production code is every Rust file that git tracks under src, without tests: files and folders of that name, and modules
under #[cfg(test)]. The first table counts functions by their lines from `fn` to the closing brace, the second structs by
their fields, the third lists pairs of places with at least six equal lines (spaces at the ends, blank lines, comments
and `use` do not count). Pairs with a stated reason are counted by reason and not listed:

- GPU: one of the files is a source of the GPU kernels, which are stored with the hash of their sources
- signature: without heads of functions, which the implementations of a trait repeat, and without lines of brackets fewer
  than six lines are equal
- the reasons in REASONS, by the two files

WIDE has the reasons of structs.
"""

import argparse
import collections
import gzip
import pathlib
import re
import subprocess

FUNCTION = re.compile(r"(\s*)(?:pub(?:\([^)]*\))? )?(?:const |unsafe |async |extern \"C\" )*fn (\w+)")
STRUCT = re.compile(r"(\s*)(?:pub(?:\([^)]*\))? )?struct (\w+)[^;(]*\{$")
FIELD = re.compile(r"\s*(?:pub(?:\([^)]*\))? )?\w+: ")
SHARED = 6
HEAD = re.compile(r"(?:pub(?:\([^)]*\))? )?(?:const |unsafe |async |extern \"C\" )*fn \w+")
BRACKETS = re.compile(r"[\])},;(\[{]*")

# Pairs of files whose equal lines stay, and the reason.
REASONS = {
    ("src/dem/contact/", "src/dem/contact/"): "laws: each has a table of parameters of its own, with the same names",
    ("src/lbm/kernel.rs", "src/lbm/kernel"): "passes: f64 and f32, with and without cover, are unrolled apart",
    ("src/case/", "src/plan/scene/"): "case and scene: the written and the resolved form of one list of fields",
}

# Structs whose fields stay together, and the reason.
WIDE = {
    "Case": "sections of a case, which users write",
    "Darcy": "fields of a case, which users write",
    "LatticeBoltzmann": "fields of a case, which users write",
    "ErosionRecord": "columns of a table, one field each",
    "Particles": "list of the arrays of grains, one line each",
}


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
                lines = [line for _, line in counted[a][i : i + length]]
                pairs.append((length, f"{a}:{counted[a][i][0] + 1}", f"{b}:{counted[b][j][0] + 1}", lines))
    return sorted((pair for pair in pairs if pair[0] >= SHARED), reverse=True)


def gpu_sources(root):
    """Returns the sources of the GPU kernels."""
    text = gzip.decompress((root / "src/lbm/gpu/kernels.ptx.gz").read_bytes()).decode()
    lines = re.findall(r"^// Sources in src/lbm: (.*)$", text, re.MULTILINE)
    return {"src/lbm/" + name for line in lines for name in line.split()}


def without_signatures(lines):
    """Returns the number of lines that are neither in the head of a function nor brackets only."""
    # Equal lines may begin among the parameters of a head, whose first line differs.
    end = next((n for n, line in enumerate(lines) if line.startswith(")")), 0)
    in_head = all(line.endswith(",") and (":" in line or "self" in line) for line in lines[:end])
    count = 0
    for line in lines:
        in_head = in_head or bool(HEAD.match(line))
        count += not in_head and not BRACKETS.fullmatch(line)
        in_head = in_head and not line.endswith(("{", ";"))
    return count


def reason(one, other, lines, gpu):
    """Returns the stated reason for equal lines, or an empty text."""
    files = sorted(place.rsplit(":", 1)[0] for place in (one, other))
    if any(name in gpu for name in files):
        return "GPU"
    if without_signatures(lines) < SHARED:
        return "signature"
    for (first, second), text in REASONS.items():
        if files[0].startswith(first) and files[1].startswith(second):
            return text
    return ""


def main():
    words = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    words.add_argument("--most", type=int, default=12, help="rows of each table")
    most = words.parse_args().most
    root = pathlib.Path(__file__).resolve().parent.parent
    files = list(production(root))
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
            print(f"{row[0]:6} {row[1]:32} {row[2]}  {WIDE.get(row[1], '')}".rstrip())
    pairs, gpu = shared(files), gpu_sources(root)
    reasons = [reason(one, other, lines, gpu) for _, one, other, lines in pairs]
    print(f"\npairs of places that share at least {SHARED} lines: {len(pairs)}, without a stated reason {reasons.count('')}")
    open_pairs = [pair for pair, stated in zip(pairs, reasons) if not stated]
    for length, one, other, _ in open_pairs[:most]:
        print(f"{length:6} {one}  {other}")
    print("\npairs with a stated reason")
    for stated, count in collections.Counter(filter(None, reasons)).most_common():
        print(f"{count:6} {stated}")


main()
