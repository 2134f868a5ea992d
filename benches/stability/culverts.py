#!/usr/bin/env python3
"""Stability of water that runs through a culvert between two openings with different levels.

    python3 benches/stability/culverts.py SOLVER [--table FILE]

A wall divides a basin of 1 m with a level on each side; the water runs below the wall, through a slot between two boxes, or without a wall. The
speed is V = (2 g d)^1/2 with the difference d of the levels, and U = V a/D at the lower opening with the height a of the passage and the depth D. The
table has both cell Reynolds numbers, V h/nu and U h/nu, the lattice velocity V dt/h and the Froude number U/(g D)^1/2. A run ends after 3 s or fails.
"""

import itertools
import math
import pathlib
import tempfile

from levels import arguments, outcome

OPERATORS = [("trt", "none"), ("trt", "smagorinsky"), ("bgk", "none"), ("bgk", "smagorinsky")]
# Difference of the levels [m], lowest and highest point of the passage [m].
JETS = [(0.1, 0.05, 0.13), (0.2, 0.0, 0.1)]
CALM = [(0.002, 0.0, 1.0), (0.01, 0.05, 0.13), (0.05, 0.05, 0.09)]
LEVEL = 0.2
SPACING = 0.01
# Passages, cell Reynolds numbers and lattice velocities of V.
PARTS = [(JETS, [3, 10, 30, 100, 300, 1000, 10000], [0.02, 0.05, 0.1]), (CALM, [100, 1000, 10000], [0.007])]
# More of them near the limit of two rates without an eddy viscosity.
NEAR = [(JETS, [15, 20, 25], [0.05])]


def case(operator, eddies, passage, number, velocity):
    """Returns the case of a run."""
    difference, floor, roof = passage
    speed = math.sqrt(2 * 9.81 * difference)
    upper = LEVEL + difference
    water = [{"from": [0, 0], "to": [0.5, upper]}, {"from": [0.5, 0], "to": [1, LEVEL]}]
    lattice = {
        "density": 1000,
        "kinematic_viscosity": speed * SPACING / number,
        "time_step": velocity * SPACING / speed,
        "surface": {"water": [{"shape": {"box": box}} for box in water]},
        "boundaries": [
            {"name": "upper", "face": "x_min", "condition": {"level": {"value": upper}}},
            {"name": "lower", "face": "x_max", "condition": {"level": {"value": LEVEL}}},
        ],
        "collision": {operator: {}},
    }
    if eddies != "none":
        lattice["turbulence"] = {eddies: {}}
    walls = []
    if roof < upper:
        walls.append({"name": "wall", "shape": {"box": {"from": [0.4, roof], "to": [0.6, 2]}}})
    if floor > 0:
        walls.append({"name": "sill", "shape": {"box": {"from": [0.4, -1], "to": [0.6, floor]}}})
    return {
        "domain": {"size": [1, round(upper + 0.1, 2)], "spacing": SPACING},
        "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": lattice},
        "structures": walls,
        "time": {"end": 3},
    }


def line(operator, eddies, passage, number, velocity, outcome):
    """Returns the row of a run."""
    difference, floor, roof = passage
    share = min(1, (roof - floor) / LEVEL)
    froude = share * math.sqrt(2 * difference / LEVEL)
    return f"{operator},{eddies},{difference:g},{floor:g},{roof:g},{number},{velocity},{share * number:.4g},{froude:.3g},{outcome}"


def main():
    """Runs the map and writes the table."""
    solver, table, version = arguments(__doc__)
    lines = [
        f"# {version}; python3 benches/stability/culverts.py SOLVER --table benches/stability/culverts.csv",
        "operator,eddies,difference,floor,roof,cell_reynolds_of_v,lattice_velocity,cell_reynolds,froude,outcome",
        "# -,-,m,m,m,-,-,-,-,-",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for operator, eddies in OPERATORS:
            near = NEAR if (operator, eddies) == ("trt", "none") else []
            for passages, numbers, velocities in PARTS + near:
                for row in itertools.product(passages, numbers, velocities):
                    ended = outcome(solver, folder, case(operator, eddies, *row))
                    lines.append(line(operator, eddies, *row, ended))
                    print(lines[-1], flush=True)
    if table:
        table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
