"""Rows of src/plan/scene/auto/measured.csv from the tables of the studies in this folder.

    python3 benches/accuracy/rows.py >rows.csv

A row states the largest error at its number of cells and at every larger one of the same problem: the error on a staircase of nodes does not fall
evenly. Errors below 0.1 % are those of the references, and count as 0.1 %. Cells are counted across what the obstacle names: the diameter, the gap,
the layer, the pores of packed spheres (their hydraulic diameter, at most that of a sphere). The core-seconds are those of the fluid in a box of this width over its diffusion time, at 85 million (2-D) and 25 million (3-D) updates a
second.
"""

import cmath
import csv
import math
import os
import re

HERE = os.path.dirname(os.path.abspath(__file__))
OBSTACLES = {
    "half-way": "half-way links",
    "interpolated": "interpolated links",
    "matched": "partially saturated cells",
}
# F/(mu U) of square arrays: Sangani and Acrivos 1982, table 1. K of simple cubic arrays: Zick and Homsy 1982, table 2.
SQUARE = {0.05: 15.56, 0.3: 102.90, 0.4: 217.89, 0.5: 532.55, 0.6: 1763, 0.7: 13520, 0.75: 126300}
CUBIC = {0.216: 7.442, 0.343: 15.4, 0.45: 28.1, 0.5236: 42.1}
LEAST = 0.001
# Fewest cells of a row: below, no scheme is meant to work.
FEWEST = {"gap": 1.0, "moving": 0.5, "layer": 0.5, "diameter": 6.0, "wall": 6.0, "vortex": 6.0, "blocks": 4.0, "blocks in gaps": 3.69,
          "passages next to spheres": 1.0, "passages between blocks": 2.0, "passages between structures": 1.5}


def members(study):
    with open(os.path.join(HERE, study, "members.csv")) as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def arrays():
    for m in members("square-arrays"):
        phi, cells = float(m["solid fraction"]), int(m["cells"])
        if not m["K"]:
            continue
        gap = 1 - math.sqrt(4 * phi / math.pi)
        error = abs(SQUARE[phi] / float(m["K"]) - 1)
        diameter = 1 - gap
        kind, size = ("gap", gap) if gap < diameter else ("diameter", diameter)
        yield f"square array at solid fraction {phi}", 2, kind, m["coupling"], cells * size, error, 0


def inertia():
    flow = {(m["array"], m["coupling"], int(m["cells"])): float(m["Q"]) for m in members("square-arrays-inertia") if m["Q"]}
    for array in sorted({a for a, _, _ in flow}):
        gap = 1 - math.sqrt(4 * float(array.strip("b")) / math.pi)
        finest, finer = sorted((n for a, c, n in flow if (a, c) == (array, "interpolated")), reverse=True)[:2]
        a, b = flow[array, "interpolated", finer], flow[array, "interpolated", finest]
        exact = b + (b - a) / ((finest / finer) ** 2 - 1)
        reynolds = float(f"{exact / 1e-6:.3g}")
        for (name, coupling, cells), value in flow.items():
            if name == array:
                yield f"square array at solid fraction {array.strip('b')} and Re {reynolds}", 2, "gap", coupling, cells * gap, abs(value / exact - 1), reynolds


def slots():
    height = {"gap 0.1 mm": 2.2, "gap 0.2 mm": 2.4, "gap 0.4 mm": 2.8, "one gap 0.2 mm": 2.2}
    width = {"gap 0.1 mm": 0.1, "gap 0.2 mm": 0.2, "gap 0.4 mm": 0.4, "one gap 0.2 mm": 0.2}
    flow = {(m["gap"], m["coupling"], int(m["cells"])): float(m["Q"]) for m in members("slot") if m["Q"]}
    for gap in height:
        finest, finer = max((n for g, c, n in flow if (g, c) == (gap, "interpolated"))), None
        finer = max(n for g, c, n in flow if (g, c) == (gap, "interpolated") and n < finest)
        a, b = flow[gap, "interpolated", finer], flow[gap, "interpolated", finest]
        exact = b + (b - a) / ((finest / finer) ** 2 - 1)
        for (g, coupling, cells), value in flow.items():
            if g == gap:
                yield f"rod in a slot with {gap}", 2, "gap", coupling, cells * width[gap] / height[gap], abs(value / exact - 1), 0


def turning():
    # From a gap of 0.7 radii on the far wall counts, which is not in the exact solution.
    torques = {}
    for m in members("turning-rod"):
        if m["T"] and m["coupling"] == "interpolated":
            torques.setdefault(float(m["gap over radius"]), {})[int(m["cells"])] = abs(float(m["T"]))
    for m in members("turning-rod"):
        if not m["T"]:
            continue
        gap = float(m["gap over radius"])
        away = 1 + gap
        exact = 4 * math.pi * 0.1 * 1e-6 * away / math.sqrt(away * away - 1)
        if gap >= 0.7:
            exact = extrapolated(torques[gap])
            if m["coupling"] == "interpolated" and int(m["cells"]) == max(torques[gap]):
                continue
        error = abs(abs(float(m["T"])) / exact - 1)
        cells = int(m["cells"])
        yield f"rod that turns at {gap} radii from a wall", 2, "moving", m["coupling"], 0.5 * gap * cells, error, 0


def pores(solid):
    """Hydraulic diameter of the pores of spheres over their diameter, at most 1."""
    return min(1.0, 2 / 3 * (1 - solid) / solid)


def spheres():
    for m in members("cubic-arrays"):
        if not m["Q"]:
            continue
        phi, cells = float(m["solid fraction"]), int(m["cells"])
        radius = min(1e-3 * (3 * phi / (4 * math.pi)) ** (1 / 3), 5e-4)
        exact = 0.1 * 1e-9 / (6 * math.pi * 1e-3 * radius * CUBIC[phi]) * 1e-6
        error = abs(float(m["Q"]) / exact - 1)
        yield f"cubic array at solid fraction {phi}", 3, "packed", m["coupling"], 2e3 * radius * cells * pores(phi), error, 0


def layers():
    for m in members("stokes-layer"):
        if not m["most"]:
            continue
        thickness, cells = float(m["thickness"]) * 1e-3, int(m["cells"])
        omega, wave = 2e-6 / thickness**2, (1 + 1j) / thickness
        exact = 1e-3 * abs(1 / (omega * 1000) * wave * cmath.tanh(wave * 5e-4))
        error = abs(float(m["most"]) / exact - 1)
        for dimension in (2, 3):
            yield f"Stokes layer of {thickness * 1e3} mm", dimension, "layer", None, cells * thickness * 1e3, error, 0


def extrapolated(values, order=2.0):
    """Richardson extrapolation of the two finest grids of {cells: value}."""
    coarse, fine = sorted(values)[-2:]
    return values[fine] + (values[fine] - values[coarse]) / ((fine / coarse) ** order - 1)


def flows(study, found):
    """{problem: {(coupling, cells, place): (discharge, force)}}; members that refine the reference or move the body are named by the problem."""
    problems, slugs = {}, {}
    for m in members(study):
        if not m["Q"]:
            continue
        name, coupling, cells, place = m["problem"], m.get("coupling"), m["cells"], ""
        if name:
            slugs[re.sub(r"[^A-Za-z0-9.]+", "-", name)] = name
        else:
            slug, cells = re.fullmatch(r"(.*)-(\d+)-cells", m["member"]).groups()
            name, coupling = slugs.get(slug), found
            if not name:
                moved = re.fullmatch(r"(.*)-(half-way|interpolated|matched)-(place-\d)", slug)
                slug, coupling, place = moved.groups() if moved else (slug, found, "")
                # Problems that have no other members bear their name.
                name = slugs.get(slug, slug.replace("-", " "))
        values = float(m["Q"]), float(m["F"]) if m.get("F") else None
        problems.setdefault(name, {})[coupling, int(cells), place] = values
    return problems


def errors(values, references):
    """The largest error of the quantities."""
    return max(abs(value / exact - 1) for value, exact in zip(values, references) if exact)


def single(study, dimension, published, diameter, section, what):
    """Bodies alone in arrays and channels: the name of a problem begins with `array` and its solid fraction, or the kind of channel and the
    diameter over the width. The Reynolds number is that of the mean velocity in the narrowest section."""
    for name, values in flows(study, "interpolated").items():
        finest = [{n: v[i] for (c, n, at), v in values.items() if c == "interpolated" and not at} for i in (0, 1)]
        exact = [extrapolated(f) for f in finest]
        kind, number = name.split(",")[0].split()
        size = diameter(kind, float(number))
        if name in published:
            exact[0] = published[name]
        if kind == "array":
            exact[1] = None  # The force is that of the body force on the cell.
        reynolds = float(f"{exact[0] / section(kind, size) * size * 1e-3 / 1e-6:.3g}") if "N/m3" in name else 0
        shown = f"{what} of {kind} {number}" + (" aside" if "aside" in name else "") + (f" and Re {reynolds}" if reynolds else "")
        for (coupling, cells, _), pair in values.items():
            if (coupling, cells) != ("interpolated", max(finest[0])):
                yield shown, dimension, "diameter", coupling, cells * size, errors(pair, exact), reynolds


def single_cylinders():
    published = {"array 0.1": 0.1 * 1e-6 / (1e-3 * 24.83), "array 0.2": 0.1 * 1e-6 / (1e-3 * 51.53)}
    published = {name: speed * 1e-3 for name, speed in published.items()}
    return single(
        "single-cylinders", 2, published,
        lambda kind, number: math.sqrt(4 * number / math.pi) if kind == "array" else number,
        lambda kind, size: 1e-3 * (1 - size), "cylinder",
    )


def single_spheres():
    def published(phi, factor):
        radius = 1e-3 * (3 * phi / (4 * math.pi)) ** (1 / 3)
        return 0.1 * 1e-9 / (6 * math.pi * 1e-3 * radius * factor) * 1e-6

    known = {"array 0.027": published(0.027, 2.008), "array 0.064": published(0.064, 2.810)}
    return single(
        "single-spheres", 3, known,
        lambda kind, number: (6 * number / math.pi) ** (1 / 3) if kind == "array" else number,
        lambda kind, size: 1e-6 * (1 - math.pi / 4 * size**2), "sphere",
    )


def packed_lattices():
    for name, values in flows("packed-lattices", "interpolated").items():
        kind, phi = name.split()
        finest = {n: v[0] for (c, n, _), v in values.items() if c == "interpolated"}
        size = 2 * (3 * float(phi) / (4 * math.pi * {"bcc": 2, "fcc": 4}[kind])) ** (1 / 3)
        for (coupling, cells, _), pair in values.items():
            if (coupling, cells) != ("interpolated", max(finest)):
                yield f"{kind} array at solid fraction {phi}", 3, "packed", coupling, cells * size * pores(float(phi)), errors(pair[:1], [extrapolated(finest)]), 0


def walls(study, dimension, half_waves, speeds):
    """Velocities at points, over that of the lid or else the largest of the points. Cells across the box, half a wave, or twice the thickness of a
    shear layer."""
    problems = {}
    for m in members(study):
        if m["outcome"] == "finished":
            problems.setdefault(m["problem"], {})[int(m["cells"])] = [float(m[f"u{i}"]) for i in range(3)]
    for name, values in problems.items():
        finest = max(values)
        exact = [extrapolated({n: v[i] for n, v in values.items()}) for i in range(3)]
        lid = speeds.get(name, 0) * 1e-3 if "cavity" in name else 0
        largest = lid or max(abs(x) for x in exact)
        for cells, found in values.items():
            if cells != finest:
                error = max(abs(a - b) for a, b in zip(found, exact)) / largest
                yield name, dimension, "vortex" if name in half_waves else "wall", None, cells * half_waves.get(name, 1), error, speeds.get(name, 0)


def walls_2d():
    waves = {"flat vortices": 0.25, "vortices at Re 50": 0.5, "shear layers": 0.1}
    speeds = {"cavity at Re 1": 1, "cavity at Re 30": 30, "tall cavity at Re 1": 1, "flat cavity at Re 30": 30,
              "cavity with two lids at Re 10": 10, "vortices at Re 50": 50, "shear layers": 40}
    return walls("walls-2d", 2, waves, speeds)


def walls_3d():
    waves = {"vortices in space": 0.5, "vortices in space at Re 50": 0.5}
    speeds = {
        "cubic cavity at Re 1": 1, "cubic cavity at Re 30": 30, "tall cavity in space at Re 1": 1, "cubic cavity with two lids at Re 1": 1,
        "flat cavity in space at Re 10": 10, "vortices in space at Re 50": 50,
    }
    return walls("walls-3d", 3, waves, speeds)


def blocks():
    operators = {
        "matched": "viscosity matched", "about-solid": "bounce-back about the solid", "about-solid-fraction": "weighted by fraction",
        "non-equilibrium": "non-equilibrium bounce-back", "superposition": "superposition", "half-way": "half-way links",
        "interpolated": "interpolated links",
    }
    # The smallest width of the block, and the square root of width and gap, over the 4 mm that the cells are counted on.
    gap = lambda width, volume: math.sqrt(width * 0.5 * (8 - (6 * volume / math.pi) ** (1 / 3)) / 16)
    sizes = {
        "gap of a cube": gap(4, 64), "gap of a slab": gap(4, 120), "gap of a cube askew": gap(4, 64), "gap of a bar": gap(4, 112),
        "duct with a slab": 0.5, "array of slabs": 0.5,
    }
    for name, values in flows("blocks-at-rest", "").items():
        # Edges are sharp: the order is 1.5, as in the study of the towed block.
        finest = [[{n: v[i] for (c, n, _), v in values.items() if c == coupling} for coupling in ("matched", "interpolated")] for i in (0, 1)]
        exact = [0.5 * (extrapolated(a, 1.5) + extrapolated(b, 1.5)) for a, b in finest]
        size = sizes.get(name.split(",")[0], 1.0)
        # Of the mean velocity in the narrowest section and the size that the cells are counted across.
        section = 64e-6 - 16e-6 if name.startswith("gap") else 144e-6 - 16e-6
        reynolds = float(f"{exact[0] / section * size * 4e-3 / 1e-4:.3g}") if "0000 N/m3" in name else 0
        if name.startswith("array"):
            exact[1] = None
        for (coupling, cells, _), pair in values.items():
            kind = ("blocks in gaps: " if name.startswith("gap") else "blocks: ") + operators[coupling]
            shown = f"block at rest in {'an' if name[0] == 'a' else 'a'} {name.split(',')[0]}" + (f" at Re {reynolds}" if reynolds else "")
            yield shown, 3, kind, None, cells * size, errors(pair, exact), reynolds


def cylinders():
    # Schaefer and Turek 1996, cases 2D-1 and 2D-2, values of FEATFLOW.
    for study, exact, reynolds in (("cylinder-re20", 5.57954, 20), ("cylinder-re100", 3.2295, 100)):
        for m in members(study):
            if m["cD"]:
                error = abs(float(m["cD"]) / exact - 1)
                yield f"cylinder in a channel at Re {reynolds}", 2, "diameter", m["coupling"], int(m["cells"]) * 0.1 / 0.41, error, reynolds


# Narrowest places of the ways, as the plan finds them, and smallest widths of bodies in open arrays [mm].
WAYS = {
    "serpentine": 0.33, "orifice": 0.26, "staggered boxes": 0.46, "slit": 0.17, "disc between plates": 0.13, "step in a channel": 0.29,
    "sphere in a duct 0.9": 0.21, "sphere in a duct 0.8": 0.27, "cubes 0.8": 0.27, "bars 0.75": 0.24, "slabs 0.8": 0.29,
    "square orifice": 0.38, "baffles in a duct": 0.36, "octahedra 0.36": 0.42, "octahedra 0.45": 0.52, "turned cubes 0.56": 0.56,
}


def ways(study, dimension):
    for name, values in flows(study, "interpolated").items():
        kind = name.split(",")[0]
        finest = {n: v[0] for (c, n, _), v in values.items() if c in ("interpolated", None)}
        order = 2.0 if kind.startswith("sphere") else 1.3 if dimension == 2 else 1.5
        exact = extrapolated(finest, order)
        # The discharge per millimetre of depth, or through a square millimetre, over the viscosity.
        reynolds = float(f"{exact / 1e-6:.3g}") if name.endswith("6000 N/m3") else 0
        operators = {"matched": "viscosity matched", "half-way": "half-way links", "interpolated": "interpolated links"}
        for (coupling, cells, _), pair in values.items():
            if coupling in ("interpolated", None) and cells == max(finest):
                continue
            if kind.startswith("sphere"):
                rows = f"passages next to spheres: {OBSTACLES[coupling]}"
            elif kind.startswith(("octahedra", "turned")):
                rows = f"blocks: {operators[coupling]}"
            elif kind.startswith(("cubes", "bars", "slabs")):
                rows = f"passages between blocks: {operators[coupling]}"
            else:
                rows = "passages between structures"
            shown = f"way past {kind}" + (f" at Re {reynolds}" if reynolds else "")
            yield shown, dimension, rows, None, cells * WAYS[kind], errors(pair[:1], [exact]), reynolds


def positions():
    exact = {0.05: 15.56, 0.1: 24.83, 0.2: 51.53, 0.3: 102.90, 0.4: 217.89, 0.6: 1763}
    for m in members("positions"):
        if m["Q"]:
            phi = float(m["problem"].split()[1])
            diameter = math.sqrt(4 * phi / math.pi)
            kind, size = ("gap", 1 - diameter) if 1 - diameter < diameter else ("diameter", diameter)
            error = abs(float(m["Q"]) / (0.15 * 1e-6 / exact[phi]) - 1)
            yield f"array {phi} at five places", 2, kind, m["coupling"], int(m["cells"]) * size, error, 0


PLACES = {
    "way past": "benches/accuracy/ways-2d and ways-3d: flow against the extrapolation of the two finest grids",
    "array": "benches/accuracy/positions: flow against Sangani and Acrivos 1982; the worst of five places on the lattice",
    "square array at inertia": "benches/accuracy/square-arrays-inertia: flow against the extrapolation of its two finest grids",
    "square array": "benches/accuracy/square-arrays: flow against Sangani and Acrivos 1982",
    "rod in": "benches/accuracy/slot: flow against the extrapolation of its two finest grids",
    "rod that": "benches/accuracy/turning-rod: torque against Jeffery 1922",
    "cubic": "benches/accuracy/cubic-arrays: flow against Zick and Homsy 1982",
    "Stokes": "benches/accuracy/stokes-layer: largest force on the wall against the exact solution",
    "cylinder of": "benches/accuracy/single-cylinders: flow and force against Sangani and Acrivos 1982 or the extrapolation of the two finest grids",
    "sphere of": "benches/accuracy/single-spheres: flow and force against Zick and Homsy 1982 or the extrapolation of the two finest grids",
    "bcc": "benches/accuracy/packed-lattices: flow against the extrapolation of its two finest grids",
    "fcc": "benches/accuracy/packed-lattices: flow against the extrapolation of its two finest grids",
    "block at rest": "benches/accuracy/blocks-at-rest: flow and force against the extrapolation of two couplings",
    "cylinder in": "benches/accuracy/cylinder-re20 and cylinder-re100: drag against Schaefer and Turek 1996",
}


SOURCES = (
    arrays, inertia, slots, turning, spheres, layers, cylinders, single_cylinders, single_spheres, packed_lattices, walls_2d, walls_3d, blocks,
    lambda: ways("ways-2d", 2), lambda: ways("ways-3d", 3), positions,
)


def main():
    groups = {}
    for source in SOURCES:
        for problem, dimension, kind, coupling, cells, error, reynolds in source():
            fewest = FEWEST.get(kind, FEWEST.get(kind.split(":")[0], 0))
            if cells >= fewest * (1 - 1e-9):
                groups.setdefault((problem, dimension, kind, coupling), []).append((cells, error, reynolds))
    for (problem, dimension, kind, coupling), rows in groups.items():
        # Of several places of the body the worst counts.
        rows.sort(reverse=True)
        worst, lines = LEAST, {}
        for cells, error, reynolds in rows:
            worst = max(worst, error)
            lines[cells] = (worst, reynolds)
        base = OBSTACLES.get(coupling, "")
        obstacle = {
            "gap": f"gaps: {base}", "moving": f"gaps next to moving bodies: {base}", "packed": f"packed spheres: {base}",
            "layer": "layers in time", "wall": "walls", "vortex": "vortices", "diameter": base,
        }.get(kind, kind)
        kind_of = "square array at inertia" if problem.startswith("square") and " and Re " in problem else problem
        places = (place for start, place in PLACES.items() if kind_of.startswith(start))
        place = next(places, f"benches/accuracy/walls-{dimension}d: velocities at points against the extrapolation of the two finest grids")
        for cells, (error, reynolds) in reversed(lines.items()):
            tau = 1.0
            speed = {2: 85e6, 3: 25e6}[dimension]
            seconds = cells**dimension * 3 * cells**2 / (tau - 0.5) / speed
            lattice = "D3Q27" if kind.startswith("blocks") else {2: "D2Q9", 3: "D3Q19"}[dimension]
            moving = 0.06 if reynolds else 0
            print(f"{problem},{dimension},{obstacle},{lattice},TRT,{cells:.2f},{tau},{moving},{reynolds},{error:.4f},{seconds:.2e},{place}")


if __name__ == "__main__":
    main()
