#!/usr/bin/env python3
"""Stability of water with a free surface behind an opening with a level.

    python3 benches/stability/levels.py SOLVER [--table FILE]

A tank of 0.6 m by 0.3 m with a level inside is opened on one side to another level. The cell Reynolds number is U h/nu with the speed
U = (2 g d)^1/2 of the difference d of the levels; the lattice velocity of U is 0.05. A run ends after 1.5 s or fails.
"""

import argparse
import json
import math
import pathlib
import subprocess
import tempfile

OPERATORS = [("trt", "none"), ("trt", "smagorinsky"), ("bgk", "none"), ("bgk", "smagorinsky")]
LEVELS = [(0.1, 0.2), (0.2, 0.1), (0.1, 0.05)]
SPACINGS = [0.01, 0.005]
NUMBERS = [1, 3, 5, 7, 15, 30, 100, 1000, 10000]


def case(operator, eddies, levels, spacing, number):
    """Returns the case of a run."""
    inside, outside = levels
    speed = math.sqrt(2 * 9.81 * abs(inside - outside))
    lattice = {
        "density": 1000,
        "kinematic_viscosity": speed * spacing / number,
        "time_step": 0.05 * spacing / speed,
        "surface": {"water": [{"level": inside}]},
        "boundaries": [{"name": "side", "face": "x_min", "condition": {"level": {"value": outside}}}],
        "collision": {operator: {}},
    }
    if eddies != "none":
        lattice["turbulence"] = {eddies: {}}
    return {
        "domain": {"size": [0.6, 0.3], "spacing": spacing},
        "gravity": [0, -9.81],
        "fluid": {"lattice_boltzmann": lattice},
        "time": {"end": 1.5},
    }


def arguments(about):
    """Returns the program and the table that the command line names, and the version of the program."""
    options = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("solver", type=pathlib.Path)
    options.add_argument("--table", type=pathlib.Path)
    given = options.parse_args()
    solver = given.solver.resolve()
    version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    return solver, given.table, version


def outcome(solver, folder, made):
    """Runs a case in a folder; returns how it ended."""
    (folder / "case.json").write_text(json.dumps(made))
    command = ["mpirun", "-n", "1", solver, folder / "case.json", "--allow-unstable"]
    command += ["--output", folder / "run", "--overwrite", "--threads", "1"]
    code = subprocess.run(command, capture_output=True).returncode
    return {0: "finished", 4: "failed"}[code]


def main():
    """Runs the map and writes the table."""
    solver, table, version = arguments(__doc__)
    lines = [
        f"# {version}; python3 benches/stability/levels.py SOLVER --table benches/stability/levels.csv",
        "operator,eddies,level_inside,level_outside,spacing,cell_reynolds,outcome",
        "# -,-,m,m,m,-,-",
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for operator, eddies in OPERATORS:
            for levels in LEVELS:
                for spacing in SPACINGS:
                    for number in NUMBERS:
                        ended = outcome(solver, folder, case(operator, eddies, levels, spacing, number))
                        lines.append(f"{operator},{eddies},{levels[0]},{levels[1]},{spacing},{number},{ended}")
                        print(lines[-1], flush=True)
    if table:
        table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
