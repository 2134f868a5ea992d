"""Rows of src/scene/auto/measured.csv from the tables of the studies in this folder.

    python3 benches/accuracy/rows.py >rows.csv

A row states the largest error at its number of cells and at every larger one of the same problem: the error on a staircase of nodes does not fall
evenly. Errors below 0.1 % are those of the references, and count as 0.1 %. Cells are counted across what the obstacle names: the diameter, the gap,
the layer. The core-seconds are those of the fluid in a box of this width over its diffusion time, at 85 million (2-D) and 25 million (3-D) updates a
second.
"""

import cmath
import csv
import math
import os

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
FEWEST = {"gap": 1.0, "moving": 0.5, "layer": 0.5, "diameter": 6.0}


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
    for m in members("turning-rod"):
        if not m["T"]:
            continue
        gap = float(m["gap over radius"])
        away = 1 + gap
        exact = 4 * math.pi * 0.1 * 1e-6 * away / math.sqrt(away * away - 1)
        error = abs(abs(float(m["T"])) / exact - 1)
        cells = int(m["cells"])
        yield f"rod that turns at {gap} radii from a wall", 2, "moving", m["coupling"], 0.5 * gap * cells, error, 0


def spheres():
    for m in members("cubic-arrays"):
        if not m["Q"]:
            continue
        phi, cells = float(m["solid fraction"]), int(m["cells"])
        radius = min(1e-3 * (3 * phi / (4 * math.pi)) ** (1 / 3), 5e-4)
        exact = 0.1 * 1e-9 / (6 * math.pi * 1e-3 * radius * CUBIC[phi]) * 1e-6
        error = abs(float(m["Q"]) / exact - 1)
        yield f"cubic array at solid fraction {phi}", 3, "packed", m["coupling"], 2e3 * radius * cells, error, 0


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


def cylinders():
    # Schaefer and Turek 1996, cases 2D-1 and 2D-2, values of FEATFLOW.
    for study, exact, reynolds in (("cylinder-re20", 5.57954, 20), ("cylinder-re100", 3.2295, 100)):
        for m in members(study):
            if m["cD"]:
                error = abs(float(m["cD"]) / exact - 1)
                yield f"cylinder in a channel at Re {reynolds}", 2, "diameter", m["coupling"], int(m["cells"]) * 0.1 / 0.41, error, reynolds


PLACES = {
    "square array at inertia": "benches/accuracy/square-arrays-inertia: flow against the extrapolation of its two finest grids",
    "square array": "benches/accuracy/square-arrays: flow against Sangani and Acrivos 1982",
    "rod in": "benches/accuracy/slot: flow against the extrapolation of its two finest grids",
    "rod that": "benches/accuracy/turning-rod: torque against Jeffery 1922",
    "cubic": "benches/accuracy/cubic-arrays: flow against Zick and Homsy 1982",
    "Stokes": "benches/accuracy/stokes-layer: largest force on the wall against the exact solution",
    "cylinder": "benches/accuracy/cylinder-re20 and cylinder-re100: drag against Schaefer and Turek 1996",
}


def main():
    groups = {}
    for source in (arrays, inertia, slots, turning, spheres, layers, cylinders):
        for problem, dimension, kind, coupling, cells, error, reynolds in source():
            if cells >= FEWEST.get(kind, 0) * (1 - 1e-9):
                groups.setdefault((problem, dimension, kind, coupling), []).append((cells, error, reynolds))
    for (problem, dimension, kind, coupling), rows in groups.items():
        rows.sort(reverse=True)
        worst, lines = LEAST, []
        for cells, error, reynolds in rows:
            worst = max(worst, error)
            lines.append((cells, worst, reynolds))
        base = OBSTACLES.get(coupling, "")
        obstacle = {"gap": f"gaps: {base}", "moving": f"gaps beside bodies that move: {base}", "packed": f"packed spheres: {base}", "layer": "layers in time", "diameter": base}[kind]
        kind_of = "square array at inertia" if " and Re " in problem else problem
        place = next(place for start, place in PLACES.items() if kind_of.startswith(start))
        for cells, error, reynolds in reversed(lines):
            tau = 1.0
            speed = {2: 85e6, 3: 25e6}[dimension]
            seconds = cells**dimension * 3 * cells**2 / (tau - 0.5) / speed
            lattice = {2: "D2Q9", 3: "D3Q19"}[dimension]
            moving = 0.06 if reynolds else 0
            print(f"{problem},{dimension},{obstacle},{lattice},TRT,{cells:.2f},{tau},{moving},{reynolds},{error:.4f},{seconds:.2e},{place}")


if __name__ == "__main__":
    main()
