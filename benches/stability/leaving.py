#!/usr/bin/env python3
"""Stability of water with a free surface from which a floating log leaves through an opening.

    python3 benches/stability/leaving.py SOLVER [--table FILE]

A stream of 0.2 m depth on cells of 0.01 m carries a log that starts 0.3 m in front of the opening, half immersed, with the speed of the stream. A run ends when
the log has had twice the time that the stream takes over 0.3 m, or fails.
"""

import itertools
import math
import pathlib
import tempfile

from levels import arguments, outcome

OPERATORS = [("bgk", "smagorinsky", 1e-5), ("trt", "none", 5e-4)]
OPENINGS = ["level", "outfall"]
SPEEDS = [0.1, 0.3]
# Density relative to water, radius in cells.
LOGS = [(0.5, 4), (0.5, 7), (0.7, 4), (0.7, 7)]
SPACING = 0.01
DEPTH = 0.2
LENGTH = 0.8
WAY = 0.3


def case(operator, opening, speed, log):
    """Returns the case of a run."""
    name, eddies, viscosity = operator
    density, radius = log
    lattice = {
        "density": 1000,
        "kinematic_viscosity": viscosity,
        "time_step": 0.05 * SPACING / math.sqrt(9.81 * DEPTH),
        "surface": {"water": [{"level": DEPTH}]},
        "initial": {"uniform": {"velocity": [speed, 0]}},
        "boundaries": [
            {
                "name": "in",
                "face": "x_min",
                "patch": {"from": [0, 0], "to": [0, DEPTH]},
                "condition": {"velocity": {"profile": {"uniform": [speed, 0]}}},
            },
            {"name": "out", "face": "x_max", "condition": {opening: {"value": DEPTH} if opening == "level" else {}}},
            {"name": "floor", "face": "y_min", "condition": {"free_slip": {}}},
        ],
        "collision": {name: {}},
    }
    if eddies != "none":
        lattice["turbulence"] = {eddies: {}}
    body = {
        "name": "log",
        "shape": {"disc": {"radius": radius * SPACING}},
        "position": [LENGTH - WAY, DEPTH],
        "motion": {"free": {"velocity": [speed, 0]}},
        "material": "wood",
    }
    return {
        "domain": {"size": [LENGTH, 0.32], "spacing": SPACING},
        "gravity": [0, -9.81],
        "materials": {"wood": {"density": 1000 * density}},
        "fluid": {"lattice_boltzmann": lattice},
        "bodies": [body],
        "coupling": {"partially_saturated": {}},
        "contact": {"linear": {"friction_angle_degrees": 20, "normal_damping_ratio": 0.3}},
        "box_walls": ["y_min"],
        "time": {"end": 2 * WAY / speed},
    }


def main():
    """Runs the map and writes the table."""
    solver, table, version = arguments(__doc__)
    lines = [
        f"# {version}; python3 benches/stability/leaving.py SOLVER --table benches/stability/leaving.csv",
        "operator,eddies,opening,speed,density_ratio,radius,outcome",
        "# -,-,-,m/s,-,cells,-",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for operator, opening, speed, log in itertools.product(OPERATORS, OPENINGS, SPEEDS, LOGS):
            ended = outcome(solver, folder, case(operator, opening, speed, log))
            lines.append(f"{operator[0]},{operator[1]},{opening},{speed},{log[0]},{log[1]},{ended}")
            print(lines[-1], flush=True)
    if table:
        table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
