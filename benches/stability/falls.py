#!/usr/bin/env python3
"""Stability of falling water with one relaxation rate and the eddy viscosity of Smagorinsky, in two dimensions.

    python3 benches/stability/falls.py SOLVER [--table FILE]

A column twice as high as wide falls in a dry basin five times as long as it is wide, with walls with or without friction. The cell Reynolds number is U h/nu with
the speed U = (2 g H)^1/2 of a fall over the height H. The surge runs against the wall and splashes. A run ends after 2 s or fails.
"""

import itertools
import math
import pathlib
import tempfile

from levels import arguments, outcome

CONSTANTS = [0.17, 0.3]
WALLS = ["no_slip", "free_slip"]
# Width of the column [m].
WIDTHS = [0.2, 0.3]
VELOCITIES = [0.05, 0.1]
NUMBERS = [100, 300, 1000, 3000, 10000]
SPACING = 0.01


def case(constant, walls, width, velocity, number):
    """Returns the case of a run."""
    speed = math.sqrt(2 * 9.81 * 2 * width)
    faces = ["x_min", "x_max", "y_min"]
    return {
        "domain": {"size": [5 * width, 4 * width], "spacing": SPACING},
        "gravity": [0, -9.81],
        "fluid": {
            "lattice_boltzmann": {
                "density": 1000,
                "kinematic_viscosity": speed * SPACING / number,
                "time_step": velocity * SPACING / speed,
                "surface": {"water": [{"shape": {"box": {"from": [0, 0], "to": [width, 2 * width]}}}]},
                "boundaries": [{"name": face, "face": face, "condition": {walls: {}}} for face in faces],
                "collision": {"bgk": {}},
                "turbulence": {"smagorinsky": {"constant": constant}},
            }
        },
        "time": {"end": 2},
    }


def main():
    """Runs the map and writes the table."""
    solver, table, version = arguments(__doc__)
    lines = [
        f"# {version}; python3 benches/stability/falls.py SOLVER --table benches/stability/falls.csv",
        "constant,walls,width,lattice_velocity,cell_reynolds,outcome",
        "# -,-,m,-,-,-",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for row in itertools.product(CONSTANTS, WALLS, WIDTHS, VELOCITIES, NUMBERS):
            ended = outcome(solver, folder, case(*row))
            lines.append(",".join(str(value) for value in row) + f",{ended}")
            print(lines[-1], flush=True)
    if table:
        table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
