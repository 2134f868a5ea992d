#!/usr/bin/env python3
"""Memory of a rank where each rank has the same share of a scene: it should not grow with the number of ranks.

    python3 benches/memory_of_ranks.py SOLVER [--ranks 4 16 64] [--table FILE]

Three scenes grow with the number of ranks: water in a cavity (2-D), spheres on a floor, and seepage through spheres. The ranks may share a few cores:
only memory is measured. A row has the largest resident set of a rank, the status is 1 where that of the last number of ranks exceeds that of the first by
more than a tenth.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

MOST = 1.1
SPACING = 0.0025
LAYER = 8
"""Spheres across a slab, along y and up."""


def cavity(_, ranks):
    """Returns 256 x 80 cells of water a rank."""
    case = json.loads((pathlib.Path(__file__).parent / "cases/cavity.json").read_text())
    case["domain"]["size"] = [0.00256, 80e-5 * ranks]
    case["time"]["end"] = 2e-5
    return case


def spheres(folder, ranks):
    """Returns 512 spheres a rank, which touch one another and the floor."""
    along = LAYER * ranks
    file = folder / f"spheres_{ranks}.csv"
    rows = [f"{(x + 0.5) * SPACING:.6g},{(y + 0.5) * SPACING:.6g},{(z + 0.5) * SPACING:.6g},{0.5 * SPACING:.6g}"
            for x in range(along) for y in range(LAYER) for z in range(LAYER)]
    file.write_text("\n".join(["x,y,z,radius", *rows]) + "\n")
    return {
        "domain": {"size": [along * SPACING, LAYER * SPACING, 2 * LAYER * SPACING], "spacing": SPACING, "periodic": ["x", "y"], "split": "x"},
        "gravity": [0, 0, -9.81],
        "materials": {"sand": {"density": 2600}},
        "grains": {"material": "sand", "initial": {"file": {"path": str(file)}}},
        "contact": {"linear": {"normal_stiffness": {"absolute": 1000}, "friction_angle_degrees": 25, "normal_damping_ratio": 0.3}},
        "box_walls": ["z_min"],
        "time": {"end": 2e-4},
    }


def seepage(folder, ranks):
    """Returns the same spheres with 8 x 8 x 16 cells of seepage a rank."""
    case = spheres(folder, ranks)
    size = case["domain"]["size"]
    case["fluid"] = {
        "darcy": {
            "density": 1000,
            "viscosity": 0.1,
            "grid": {"from": [0, 0, 0], "to": size, "cells": [LAYER * ranks, LAYER, 2 * LAYER]},
            "boundaries": [
                {"name": "top", "face": "z_max", "condition": {"head": {"value": 0.05}}},
                {"name": "base", "face": "z_min", "condition": {"head": {"value": 0}}},
            ],
        }
    }
    return case


def main():
    """Runs the scenes and writes the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("solver", type=pathlib.Path)
    options.add_argument("--ranks", nargs="+", type=int, default=[4, 16, 64])
    options.add_argument("--table", type=pathlib.Path)
    given = options.parse_args()
    solver = given.solver.resolve()
    version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    lines = [f"# {version}", "scene,ranks,largest_resident_set_of_a_rank,over_the_first", "# -,-,MB,-"]
    good = True
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for scene in (cavity, spheres, seepage):
            first = None
            for ranks in given.ranks:
                case = folder / "case.json"
                case.write_text(json.dumps(scene(folder, ranks)))
                command = ["mpirun", "--oversubscribe", "-n", str(ranks), solver, case, "--threads", "1", "--output", folder / "run", "--overwrite", "--no-final-checkpoint"]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode != 0:
                    sys.exit(f"memory_of_ranks: {scene.__name__} on {ranks} ranks: {done.stderr[-800:]}")
                peak = json.loads((folder / "run/summary.json").read_text())["peak_rss_bytes"] / 1e6
                first = first or peak
                lines.append(f"{scene.__name__},{ranks},{peak:.1f},{peak / first:.3f}")
                print(lines[-1], flush=True)
            good &= peak <= MOST * first
    if given.table:
        given.table.write_text("\n".join(lines) + "\n")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
