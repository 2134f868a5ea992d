#!/usr/bin/env python3
"""Cost of a free surface: a wave in a basin beside the same water under a lid, and below more and more air.

    python3 benches/surface_cost.py SOLVER [--table FILE] [--turns N]

Water of 96 x 96 x 48 cells (3-D) or 768 x 384 (2-D) moves as a standing wave. It runs closed (full box, no surface), with a quarter of its
depth of air above it, and in a box of ten times its depth. In 3-D the rows of the lattice run along the crests in all boxes, because interface cells
cost more where they are not adjacent in a row; one more box of ten times the depth has rows across the crests. Times are those of the step loop, in alternation, the least of N turns (else 5),
per step and cell of water: the difference between runs of 300 and of 100 steps, so that what a run does once, as the first access to the memory of a
large box, does not count. The columns are the ratio to the closed run on one rank, and the speed-up on two ranks.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile

# Cells of the water.
SCENES = {"3-D": [96, 96, 48], "2-D": [768, 384]}
# Steps of the short and of the long run.
STEPS = (100, 300)
# Depth of the box over the depth of the water; 1: closed.
BOXES = {"closed": 1, "a quarter of air": 1.25, "nine tenths of air": 10}
# The same with rows across the crests.
ACROSS = "nine tenths of air; rows across the crests"
SPACING = 0.002


def boxes(cells):
    """Returns the boxes of a scene."""
    return BOXES | ({ACROSS: BOXES["nine tenths of air"]} if len(cells) == 3 else {})


def case(cells, name, steps):
    """Returns the case of a box."""
    box = boxes(cells)[name]
    size = [n * SPACING for n in cells]
    level = size[-1]
    up = len(cells) - 1
    step = 5e-5
    size[-1] = level * box
    gravity = [0.0] * len(cells)
    gravity[up] = -9.81
    lattice = {"density": 1000, "kinematic_viscosity": 2e-4, "time_step": step}
    if box > 1:
        axis = "y" if up == 2 and name != ACROSS else "x"
        lattice["surface"] = {"water": [{"wave": {"level": level, "amplitude": level / 20, "axis": axis}}]}
    domain = {"size": size, "spacing": SPACING, "periodic": ["x", "y"][:up]}
    if up == 2:
        domain["split"] = "z"
    return {
        "domain": domain,
        "gravity": gravity,
        "fluid": {"lattice_boltzmann": lattice},
        "time": {"end": steps * step},
    }


def seconds(solver, folder, case, ranks):
    """Returns the time of the loop of a run [s]."""
    (folder / "case.json").write_text(json.dumps(case))
    command = ["mpirun", "--oversubscribe", "-n", str(ranks), solver, folder / "case.json", "--threads", "1"]
    command += ["--output", folder / "run", "--overwrite", "--no-final-checkpoint", "--allow-unstable"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"surface_cost: {done.stderr[-800:]}")
    return json.loads((folder / "run/summary.json").read_text())["loop_seconds"]


def main():
    """Runs the scenes and writes the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("solver", type=pathlib.Path)
    options.add_argument("--table", type=pathlib.Path)
    options.add_argument("--turns", type=int, default=5)
    given = options.parse_args()
    solver = given.solver.resolve()
    version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    command = "python3 benches/surface_cost.py SOLVER --table benches/results/surface_cost.csv"
    lines = [f"# {version}; {command}", "scene,box,ns_per_water_cell,over_closed,speed_up_on_two_ranks", "# -,-,ns,-,-"]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for scene, cells in SCENES.items():
            names = boxes(cells)
            times = {(box, ranks, steps): [] for box in names for ranks in (1, 2) for steps in STEPS}
            for _ in range(given.turns):
                for box, ranks, steps in times:
                    times[box, ranks, steps].append(seconds(solver, folder, case(cells, box, steps), ranks))
            short, long = STEPS
            a_step = {
                (box, ranks): (min(times[box, ranks, long]) - min(times[box, ranks, short])) / (long - short)
                for box in names
                for ranks in (1, 2)
            }
            for box in names:
                one, two = a_step[box, 1], a_step[box, 2]
                over = one / a_step["closed", 1]
                lines.append(f"{scene},{box},{one / math.prod(cells) * 1e9:.3g},{over:.3f},{one / two:.3f}")
                print(lines[-1], flush=True)
    if given.table:
        given.table.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
