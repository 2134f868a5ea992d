#!/usr/bin/env python3
"""Files that other programs and people have published are read, or refused for the true reason.

    python3 jobs/reliability/public_files.py --clones FOLDER [--solver FILE] [--only TEXT] [--csv FILE]

`public_files.csv` names the files: repository, commit, path, licence and the format. They are not part of this repository. FOLDER has
a clone of each repository with the name OWNER+NAME (bare or not), or a subfolder `repo` of this name; a missing one is cloned from
GitHub where the network allows it. Each file goes into the smallest case that reads it. A reader of this script, which shares no code
with the program, reads it as well:

- grains: the program saves the sample that it has read; number, centres and radii must be the same to rounding;
- surfaces: number of facets with an area and their extent must be the same;
- profiles, rasters, polygons, lists of blocks: the case must have a plan.

Where the program refuses a file, its sentence must contain the text of the column `expected`. The table is written again with the
outcomes. Needs Python 3.9, git and h5py. Ends with 1 if an outcome is not the expected one.
"""

import argparse
import csv
import itertools
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TABLE = HERE / "public_files.csv"
# A case that takes longer hangs [s].
LIMIT = 300
SOURCES = ["format", "producer", "repository", "commit", "path", "licence", "case", "expected"]
OUTCOMES = ["bytes", "count", "outcome", "sentence"]


class NoReader(Exception):
    """This script does not read the file either."""


# Readers of this script -------------------------------------------------------------------------------------------------------------


def numbers(words):
    return [float(word) for word in words]


def dump(text):
    """Last snapshot of a dump: rows of x, y, z, radius in the order of the ids."""
    lines = text.splitlines()
    heads = [n for n, line in enumerate(lines) if line.startswith("ITEM: ATOMS")]
    if not heads:
        raise NoReader
    names = lines[heads[-1]].split()[2:]
    rows = []
    for line in lines[heads[-1] + 1 :]:
        if line.startswith("ITEM:"):
            break
        if line.strip():
            rows.append(dict(zip(names, line.split())))

    def first(row, *candidates):
        return float(next(row[name] for name in candidates if name in row))

    try:
        grains = [
            (
                int(row["id"]) if "id" in row else n,
                first(row, "x", "xu"),
                first(row, "y", "yu"),
                first(row, "z", "zu"),
                first(row, "radius") if "radius" in row else first(row, "diameter") / 2,
            )
            for n, row in enumerate(rows)
        ]
    except (StopIteration, ValueError):
        raise NoReader from None
    return [grain[1:] for grain in sorted(grains)]


def data(text):
    """Section `Atoms` of a data file: id, type, diameter, density, x, y, z."""
    grains, inside = [], False
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if words and words[0] == "Atoms":
            inside = True
        elif inside and words and words[0][0].isalpha():
            break
        elif inside and words:
            if len(words) < 7:
                raise NoReader
            grains.append((int(words[0]), *numbers(words[4:7]), float(words[2]) / 2))
    if not grains:
        raise NoReader
    return [grain[1:] for grain in sorted(grains)]


def rows(text):
    """Rows of x, y, z, r, whatever stands behind them."""
    try:
        found = [numbers(line.split()[:4]) for line in text.splitlines() if line.strip() and not line.startswith("#")]
    except ValueError:
        raise NoReader from None
    if not found or any(len(row) < 4 for row in found):
        raise NoReader
    return [tuple(row) for row in found]


def balls(text):
    """Commands `ball create` with numbers for all that is needed."""
    number = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"
    found = []
    for n, line in enumerate(text.splitlines()):
        line = re.sub(r"[=,()]", " ", line.split(";")[0].lower())
        if not re.match(r"\s*ball\s+(create|generate|id)", line):
            continue
        place = re.search(rf"pos(?:ition)?\s+({number})\s+({number})(?:\s+({number}))?", line)
        place = place or re.search(rf"\bx\s+({number})\s+y\s+({number})(?:\s+z\s+({number}))?", line)
        radius = re.search(rf"rad(?:ius)?\s+({number})", line)
        name = re.search(r"\bid\s+([0-9]+)", line)
        if not (place and radius):
            raise NoReader
        x, y, z = place.groups()
        found.append((int(name[1]) if name else n, float(x), float(y), float(z or 0), float(radius[1])))
    if not found:
        raise NoReader
    return [grain[1:] for grain in sorted(found)]


def table(text):
    """Comma-separated columns with names."""
    lines = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    names = {name.strip().lower(): name for name in lines.fieldnames or []}
    radius = next((name for name in ("r", "radius") if name in names), None)
    if radius is None or not {"x", "y", "z"} <= names.keys():
        raise NoReader
    return [tuple(float(line[names[name]]) for name in ("x", "y", "z", radius)) for line in lines]


def facets(content):
    """Triangles of an STL file, of which the binary form has no other sign than its length."""
    count = struct.unpack_from("<I", content, 80)[0] if len(content) >= 84 else 0
    if count and len(content) >= 84 + 50 * count and not content[84 + 50 * count :].strip(b"\0 \r\n"):
        triangles = [struct.unpack_from("<9f", content, 84 + 50 * n + 12) for n in range(count)]
    else:
        words = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", content, re.IGNORECASE)
        if not words or len(words) % 3:
            raise NoReader
        try:
            flat = [float(word) for vertex in words for word in vertex]
        except ValueError:
            raise NoReader from None
        triangles = [tuple(flat[9 * n : 9 * n + 9]) for n in range(len(flat) // 9)]

    def has_area(t):
        a = [t[3 + k] - t[k] for k in range(3)]
        b = [t[6 + k] - t[k] for k in range(3)]
        cross = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
        longest = max(sum(x * x for x in a), sum(x * x for x in b))
        return math.sqrt(sum(x * x for x in cross)) > 1e-10 * longest

    if not all(math.isfinite(x) for t in triangles for x in t):
        raise NoReader
    return [t for t in triangles if has_area(t)]


READERS = {"dump": dump, "data": data, "rows": rows, "balls": balls, "table": table}

def overlaps(grains):
    """Number of pairs that overlap by more than a twentieth of the smaller radius, which the program does not accept."""
    size = 2 * max(grain[3] for grain in grains)
    cells = {}
    for n, grain in enumerate(grains):
        cells.setdefault(tuple(math.floor(x / size) for x in grain[:3]), []).append(n)
    count = 0
    for cell, here in cells.items():
        for step in itertools.product((-1, 0, 1), repeat=3):
            for m in cells.get(tuple(a + b for a, b in zip(cell, step)), ()):
                for n in (n for n in here if n < m):
                    a, b = grains[n], grains[m]
                    depth = a[3] + b[3] - math.dist(a[:3], b[:3])
                    count += depth > 0.05 * min(a[3], b[3])
    return count


# Cases ------------------------------------------------------------------------------------------------------------------------------



def contact(radius):
    """Contact law of grains of glass that no impact presses much."""
    stiffness = 1e10 * 2500 * 4 / 3 * math.pi * radius**3
    return {"linear": {"normal_stiffness": {"absolute": stiffness}, "friction_angle_degrees": 20}}


def box(points):
    low = [min(p[a] for p in points) for a in range(3)]
    high = [max(p[a] for p in points) for a in range(3)]
    return low, high


def sample(file, grains, plane):
    """Case of a sample: the domain holds the box of its grains."""
    grains = grains or [(0.5, 0.5, 0.5, 0.1)]
    margin = 2 * max(grain[3] for grain in grains)
    low, high = box(grains)
    size = [high[a] - low[a] + 2 * margin for a in range(2 if plane else 3)]
    spacing = max(size) / 64
    size = [spacing * math.ceil(length / spacing - 1e-9) for length in size]
    return {
        "domain": {"size": size, "spacing": spacing},
        "materials": {"glass": {"density": 2500}},
        "grains": {
            "material": "glass",
            "initial": {"file": {"path": file, "origin": [margin - low[a] for a in range(len(size))]}},
            "save": "saved.csv",
        },
        "contact": contact(margin / 2),
        "time": {"end": 1e-9},
    }


def wall(file, triangles):
    """Case of a surface: a wall in a box twice as large, and a grain far from it."""
    corners = [t[3 * k : 3 * k + 3] for t in triangles or [(0.0,) * 9] for k in range(3)]
    low, high = box(corners)
    extent = max(high[a] - low[a] for a in range(3)) or 1.0
    return {
        "domain": {"size": [1.0, 1.0, 1.0], "spacing": 1 / 64},
        "materials": {"glass": {"density": 2500}},
        "grains": {"material": "glass", "initial": {"list": [{"position": [0.97, 0.97, 0.97], "radius": 0.02}]}},
        "walls": [
            {
                "name": "public",
                "material": "glass",
                "shape": {
                    "mesh": {
                        "path": file,
                        "scale": 0.5 / extent,
                        "origin": [0.25 - 0.5 / extent * low[a] for a in range(3)],
                    }
                },
            }
        ],
        "contact": contact(0.02),
        "output": {"grains": {"every": 1e-9}},
        "time": {"end": 1e-9},
    }


def solid(file, triangles):
    """Case of a closed surface: a structure in the box of the wall."""
    case = wall(file, triangles)
    shape = case.pop("walls")[0]["shape"]
    case["structures"] = [{"name": "public", "shape": {"surface": shape}}]
    return case


def polygon(file):
    """Case of a zone that a polygon bounds."""
    return {
        "domain": {"size": [1.0, 1.0], "spacing": 0.1},
        "gravity": [0, -9.81],
        "fluid": {
            "darcy": {
                "density": 1000,
                "viscosity": 0.001,
                "zones": [
                    {"name": "public", "polygon": {"path": file}, "permeability": {"value": 1e-11}, "without_grains": True}
                ],
                "boundaries": HEADS,
            }
        },
        "time": {"end": 0.01},
    }


HEADS = [
    {"name": "low", "face": "x_min", "condition": {"head": {"value": 1}}},
    {"name": "high", "face": "x_max", "condition": {"head": {"value": 1.1}}},
]


def raster(file):
    """Case of a zone with values of a raster."""
    case = polygon(file)
    case["domain"] = {"size": [1.0, 1.0, 1.0], "spacing": 0.1}
    case["gravity"] = [0, 0, -9.81]
    case["fluid"]["darcy"]["zones"] = [{"name": "public", "raster": {"path": file}, "without_grains": True}]
    return case


def profile(file):
    """Case of a plane channel with a velocity profile at its inlet."""
    return {
        "domain": {"size": [0.02, 0.01], "spacing": 0.0005},
        "fluid": {
            "lattice_boltzmann": {
                "density": 1000,
                "kinematic_viscosity": 1.0,
                "boundaries": [
                    {
                        "name": "in",
                        "face": "x_min",
                        "condition": {"velocity": {"profile": {"file": {"path": file}}}},
                    },
                    {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
                ],
            }
        },
        "time": {"end": 0.01},
    }


def blocks(file, size=4):
    """Case of a list of blocks in a cube of an edge."""
    return {
        "domain": {"size": [size] * 3, "spacing": size / 8},
        "gravity": [0, 0, -9.81],
        "materials": {"granite": {"density": 2600}},
        "box_walls": ["z_min"],
        "blocks": {"material": "granite", "initial": {"file": {"path": file}}},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 30}},
        "time": {"end": 0.1},
    }


def blocks_of_a_grid(file):
    """Case of the blocks of a VTK file, which are up to 120 m away from the origin."""
    return blocks(file, 120)


def bodies(file):
    """Case of the bodies of a file, which lie around the origin, up to 120 m away."""
    case = blocks(file, 240)
    case["blocks"]["initial"]["file"]["origin"] = [120, 120, 120]
    return case


CASES = {"polygon": polygon, "raster": raster, "profile": profile, "blocks": blocks, "grid": blocks_of_a_grid, "bodies": bodies}

# Runs -------------------------------------------------------------------------------------------------------------------------------


def content_of(clones, source):
    """Bytes of a file at its commit."""
    owner, name = source["repository"].split("/")
    folder = clones / f"{owner}+{name}"
    candidates = [folder / "repo" / ".git", folder / "repo", folder / ".git", folder]
    git = next((c for c in candidates if (c / "objects").is_dir()), None)
    if git is None:
        address = f"https://github.com/{source['repository']}"
        subprocess.run(["git", "clone", "--quiet", "--bare", address, str(folder)], check=True)
        git = folder
    show = ["git", f"--git-dir={git}", "show", f"{source['commit']}:{source['path']}"]
    return subprocess.run(show, check=True, capture_output=True).stdout


def solver(program, arguments, folder):
    """Exit code, errors and seconds of a command."""
    start = time.monotonic()
    try:
        done = subprocess.run(
            [str(program), *arguments], cwd=folder, capture_output=True, text=True, timeout=LIMIT, errors="replace"
        )
    except subprocess.TimeoutExpired:
        return -1, f"no end within {LIMIT} s", float(LIMIT)
    return done.returncode, done.stderr, time.monotonic() - start


def sentence(errors):
    """First sentence of a refusal."""
    line = next((line for line in errors.splitlines() if line.startswith(("error:", "unstable:"))), "")
    return line.split(": ", 1)[-1][:400]


def near(a, b, size):
    return abs(a - b) <= 1e-9 * size


def compare_grains(saved, grains, case):
    """Differences between the sample that the program saved and that of this script; empty where there are none."""
    lines = list(csv.DictReader(saved.read_text().splitlines()))
    if len(lines) != len(grains):
        return f"{len(lines)} grains, this script reads {len(grains)}"
    origin = case["grains"]["initial"]["file"]["origin"]
    size = max(case["domain"]["size"])
    for n, (line, grain) in enumerate(zip(lines, grains)):
        for a, name in enumerate("xyz"[: len(origin)]):
            if not near(float(line[name]), grain[a] + origin[a], size):
                return f"grain {n + 1}: {name} is {line[name]}, this script reads {grain[a] + origin[a]}"
        if not near(float(line["radius"]), grain[3], grain[3]):
            return f"grain {n + 1}: the radius is {line['radius']}, this script reads {grain[3]}"
    return ""


def compare_surface(folder, triangles, case):
    """Differences between the wall that the program wrote and the triangles of this script."""
    import h5py

    mesh = case["walls"][0]["shape"]["mesh"]
    with h5py.File(next(folder.glob("walls_*.vtkhdf"))) as file:
        count = len(file["VTKHDF/Polygons/Offsets"]) - 1
        points = file["VTKHDF/Points"][:]
    if count != len(triangles):
        return f"{count} facets, this script reads {len(triangles)}"
    for n, triangle in enumerate(triangles):
        mine = [triangle[k] * mesh["scale"] + mesh["origin"][k % 3] for k in range(9)]
        corners = points[3 * n : 3 * n + 3].flatten()
        # Corners within 1e-7 of the extent are one vertex.
        if max(abs(a - b) for a, b in zip(mine, corners)) > 2e-7:
            return f"facet {n + 1} has the corners {corners.tolist()}, this script reads {mine}"
    return ""


def feed(program, source, content, folder):
    """Outcome of one file: its count, `read`, `refused` or `wrong`, the seconds and the sentence."""
    kind, reader = (source["case"].split(":") + [""])[:2]
    file = "public" + pathlib.Path(source["path"]).suffix
    (folder / file).write_bytes(content)
    mine = None
    try:
        if kind in ("sample", "plane"):
            mine = READERS[reader](content.decode("utf-8", "replace"))
        elif kind in ("wall", "solid"):
            mine = facets(content)
    except NoReader:
        pass
    if kind in ("sample", "plane"):
        case = sample(file, mine, kind == "plane")
    elif kind == "wall":
        case = wall(file, mine)
    elif kind == "solid":
        case = solid(file, mine)
    else:
        case = CASES[kind](file)
    (folder / "case.json").write_text(json.dumps(case))
    planned = kind in CASES or kind == "solid"
    command = ["plan"] if planned else ["run"]
    end = ["--allow-unstable"] if planned else ["--allow-unstable", "--output", "out"]
    code, errors, seconds = solver(program, command + ["case.json"] + end, folder)
    count = len(mine) if mine is not None else ""
    if code == 3:
        text = sentence(errors)
        stated = re.search(r"([0-9]+) pairs of the sample overlap", text)
        if stated and int(stated[1]) != overlaps(mine):
            return count, "wrong", seconds, f"{text}; this script counts {overlaps(mine)}"
        return count, "refused", seconds, text
    if code != 0:
        return count, "wrong", seconds, f"exit code {code}: {errors.strip()[:300]}"
    if planned:
        return count, "read", seconds, ""
    if mine is None:
        return count, "wrong", seconds, "the program reads what this script cannot"
    if kind == "wall":
        difference = compare_surface(folder / "out", mine, case)
    else:
        difference = compare_grains(folder / "out" / "saved.csv", mine, case)
    return count, "wrong" if difference else "read", seconds, difference


def provenance(program):
    """First lines of the table: program, and the command."""
    version = subprocess.run([str(program), "--version"], capture_output=True, text=True, check=True).stdout
    return [f"# solver: {' '.join(version.split())}", f"# command: python3 jobs/reliability/public_files.py {COMMAND}"]


COMMAND = "--clones CLONES"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clones", type=pathlib.Path, required=True, help="folder of the repositories")
    parser.add_argument("--solver", type=pathlib.Path, default=ROOT / "target" / "release" / "solver")
    parser.add_argument("--sources", type=pathlib.Path, default=TABLE, help="table of the files")
    parser.add_argument("--only", default="", help="only files whose repository, path or format has this text")
    parser.add_argument("--csv", type=pathlib.Path, help="table with the outcomes")
    options = parser.parse_args()
    program = options.solver.resolve()
    lines = [line for line in options.sources.read_text().splitlines() if not line.startswith("#")]
    done, failures = [], 0
    for source in csv.DictReader(lines):
        if not any(options.only in source[name] for name in ("repository", "path", "format")):
            continue
        content = content_of(options.clones, source)
        with tempfile.TemporaryDirectory() as folder:
            count, outcome, seconds, text = feed(program, source, content, pathlib.Path(folder))
        expected = source["expected"]
        right = outcome == "read" if expected == "read" else outcome == "refused" and expected in text
        failures += not right
        row = {name: source[name] for name in SOURCES}
        row.update(bytes=len(content), count=count, outcome=outcome, sentence=text)
        done.append(row)
        mark = "" if right else f"  <- expected: {expected}"
        print(f"{outcome:8} {count:>7} {seconds:6.1f} s  {source['repository']} {source['path']}  {text}{mark}", flush=True)
    if options.csv:
        with options.csv.open("w", newline="") as file:
            file.write("\n".join(provenance(program)) + "\n")
            table_of = csv.DictWriter(file, SOURCES + OUTCOMES, lineterminator="\n")
            table_of.writeheader()
            table_of.writerows(done)
    print(f"{len(done)} files, {failures} not as expected")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
