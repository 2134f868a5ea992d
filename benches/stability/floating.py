#!/usr/bin/env python3
"""Stability of spheres in saturated cells that float in water with a free surface.

    python3 benches/stability/floating.py SOLVER [--table FILE]

A sphere of 15 mm in a basin of eight radii starts three radii below the surface and rises, or with its centre 1.33 radii above it and falls. A run ends after
1 s or fails.
"""

import itertools
import math
import pathlib
import tempfile

from levels import arguments, outcome

RADIUS = 0.015
MRT, CUMULANT = ("mrt", "none"), ("cumulant", "none")
EDDIES = [("trt", "smagorinsky"), ("bgk", "smagorinsky")]
STARTS = [-3, 1.33]
TAUS = [0.5001, 0.51]
# Operators, radii in cells, densities relative to water, relaxation times and starts.
PARTS = [
    ([MRT, *EDDIES], [2.5], [0.9, 0.95], TAUS, STARTS),
    ([MRT, *EDDIES, CUMULANT], [3], [0.8, 0.9], TAUS, STARTS),
    ([MRT], [3], [0.85], TAUS, STARTS),
    (EDDIES, [3], [0.95], TAUS, STARTS),
    ([MRT, *EDDIES], [4], [0.67, 0.8], TAUS, STARTS),
    ([MRT, EDDIES[0]], [4], [0.73], TAUS, STARTS),
    ([EDDIES[1]], [4], [0.73], TAUS[:1], STARTS),
    ([MRT], [5], [0.56], TAUS[:1], STARTS[:1]),
    ([MRT], [5], [0.62], TAUS[:1], STARTS),
    (EDDIES, [3], [0.8], [0.52], STARTS[:1]),
    (EDDIES[1:], [3], [0.85], [0.52, 0.53, 0.55], STARTS[:1]),
]


def case(operator, radius, density, relaxation_time, start):
    """Returns the case of a run."""
    name, eddies = operator
    spacing = RADIUS / radius
    step = 6e-4 / radius
    width = math.ceil(8 * radius) * spacing
    level = math.ceil(20 * radius / 3)
    lattice = {
        "density": 1000,
        "kinematic_viscosity": (relaxation_time - 0.5) / 3 * spacing * spacing / step,
        "time_step": step,
        "surface": {"water": [{"level": level * spacing}]},
        "collision": {name: {}},
    }
    if eddies != "none":
        lattice["turbulence"] = {eddies: {}}
    body = {
        "name": "ball",
        "shape": {"sphere": {"radius": RADIUS}},
        "position": [width / 2, width / 2, (level + start * radius) * spacing],
        "motion": {"free": {}},
        "material": "wood",
    }
    return {
        "domain": {"size": [width, width, math.ceil(32 * radius / 3) * spacing], "spacing": spacing},
        "gravity": [0, 0, -9.81],
        "materials": {"wood": {"density": 1000 * density}, "wall": {}},
        "fluid": {"lattice_boltzmann": lattice},
        "bodies": [body],
        "coupling": {"partially_saturated": {}},
        "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
        "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"],
        "box_wall_material": "wall",
        "time": {"end": 1},
    }


def main():
    """Runs the map and writes the table."""
    solver, table, version = arguments(__doc__)
    lines = [
        f"# {version}; python3 benches/stability/floating.py SOLVER --table benches/stability/floating.csv",
        "operator,eddies,radius,density_ratio,relaxation_time,start,outcome",
        "# -,-,cells,-,-,radii,-",
    ]
    rows = itertools.chain.from_iterable(itertools.product(*part) for part in PARTS)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for operator, *row in rows:
            ended = outcome(solver, folder, case(operator, *row))
            lines.append(",".join([*operator, *map(str, row), ended]))
            print(lines[-1], flush=True)
    if table:
        table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
