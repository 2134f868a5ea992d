#!/usr/bin/env python3
"""Stability of a bore that reaches an opening with a level.

    python3 benches/stability/bores.py SOLVER [--table FILE]

A column of 0.3 m by a height stands at one end of a basin of 1 m with a level; the other end is open to the same level. The column falls, and its bore leaves
through the opening. The cell Reynolds number is U h/nu with the speed U = (2 g d)^1/2 of the difference d of height and level; the lattice velocity of a fall
over the whole height is 0.05. A run ends after 3 s or fails.
"""

import itertools
import math
import pathlib
import tempfile

from levels import arguments, outcome

OPERATORS = [("trt", "smagorinsky"), ("trt", "none"), ("bgk", "smagorinsky")]
# Level and height of the column, and spacing [m].
COLUMNS = [(0.1, 0.3, 0.01), (0.1, 0.15, 0.01), (0.2, 0.3, 0.01), (0.05, 0.25, 0.01), (0.2, 0.3, 0.005)]
NUMBERS = [10, 20, 30, 50, 100, 300, 1000, 10000]


def case(operator, eddies, column, number):
    """Returns the case of a run."""
    level, height, spacing = column
    speed = math.sqrt(2 * 9.81 * (height - level))
    lattice = {
        "density": 1000,
        "kinematic_viscosity": speed * spacing / number,
        "time_step": 0.05 * spacing / math.sqrt(2 * 9.81 * height),
        "surface": {"water": [{"level": level}, {"shape": {"box": {"from": [0, 0], "to": [0.3, height]}}}]},
        "boundaries": [{"name": "side", "face": "x_max", "condition": {"level": {"value": level}}}],
        "collision": {operator: {}},
    }
    if eddies != "none":
        lattice["turbulence"] = {eddies: {}}
    return {
        "domain": {"size": [1, 0.4], "spacing": spacing},
        "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": lattice},
        "time": {"end": 3},
    }


def main():
    """Runs the map and writes the table."""
    solver, table, version = arguments(__doc__)
    lines = [
        f"# {version}; python3 benches/stability/bores.py SOLVER --table benches/stability/bores.csv",
        "operator,eddies,level,height,spacing,cell_reynolds,outcome",
        "# -,-,m,m,m,-,-",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for (operator, eddies), column, number in itertools.product(OPERATORS, COLUMNS, NUMBERS):
            ended = outcome(solver, folder, case(operator, eddies, column, number))
            level, height, spacing = column
            lines.append(f"{operator},{eddies},{level},{height},{spacing},{number},{ended}")
            print(lines[-1], flush=True)
    if table:
        table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
