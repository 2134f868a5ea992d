#!/usr/bin/env python3
"""Discs and spheres that rest on a floor in saturated cells: which shear dashpots keep them at rest.

    python3 benches/stability/resting.py SOLVER [--table FILE] [--runs N] [--dimension 2|3] [--seed N] [--coupling NAME]

A disc or sphere lies on a floor that is inclined by 1e-4 in still water. Density, viscosity, stiffness and resolution are drawn at random, with
automatic steps. Each scene runs without shear dashpots and with damping ratios of 0.05, 0.1 and 0.2; the normal damping ratio is 0.2. The columns are
the angular frequency of rolling against the shear spring times the step of the lattice, (k_s (1/m + R^2/I))^1/2 dt, and the largest speed along
the floor in the last quarter of the run over that without a spring, g sin(slope) t: a body at rest rolls slower than that, one that shakes is faster.
"""

import argparse
import csv
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

SLOPE = 1e-4
RADIUS = 0.0015
END = 0.2
DAMPING = (0.0, 0.05, 0.1, 0.2)


def case(dimension, coupling, drawn, damping):
    """Returns a case; `drawn` holds density ratio, viscosity, stiffness and cells per diameter."""
    ratio, viscosity, stiffness, cells = drawn
    spacing = 2 * RADIUS / cells
    wide, high = 5 * cells, 4 * cells
    size = [wide * spacing] * (dimension - 1) + [high * spacing]
    up = dimension - 1
    gravity = [0.0] * dimension
    gravity[0], gravity[up] = SLOPE * 9.81, -9.81
    position = [0.5 * x for x in size]
    position[up] = RADIUS
    shape = "disc" if dimension == 2 else "sphere"
    law = {"friction_angle_degrees": 20, "normal_damping_ratio": 0.2, "shear_damping_ratio": damping}
    if stiffness:
        law["normal_stiffness"] = {"absolute": stiffness}
    body = {"name": "b", "shape": {shape: {"radius": RADIUS}}, "position": position, "motion": {"free": {}}, "material": "stone"}
    names = "xyz"[:dimension]
    return {
        "domain": {"size": size, "spacing": spacing},
        "gravity": gravity,
        "materials": {"stone": {"density": 1000 * ratio}, "floor": {}},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": viscosity}},
        "contact": {"linear": law},
        "box_walls": [f"{a}_{end}" for a in names for end in ("min", "max")],
        "box_wall_material": "floor",
        "coupling": {coupling: {}},
        "bodies": [body],
        "time": {"end": END},
        "probes": [{"name": "b", "every": 0.002, "at": {"body": {"name": "b"}}}],
        "output": {},
    }


def found(tree, key):
    """Returns the first value of a key in nested dictionaries and lists; None without one."""
    if isinstance(tree, dict) and key in tree:
        return tree[key]
    parts = tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ()
    return next((value for part in parts if (value := found(part, key)) is not None), None)


def speed(solver, folder, case):
    """Runs a case; returns its exit code, the frequency of rolling times the step, and the largest speed of the last quarter [m/s]; None if refused."""
    written = folder / "case.json"
    written.write_text(json.dumps(case))
    plan = json.loads(subprocess.run([solver, "plan", written, "--json"], capture_output=True, text=True).stdout)
    law = case["contact"]["linear"]
    stiffness = law.get("normal_stiffness") or found(plan, "normal_stiffness")
    mass = case["materials"]["stone"]["density"] * (math.pi * RADIUS**2 if len(case["gravity"]) == 2 else 4 / 3 * math.pi * RADIUS**3)
    ratio, turning = (2 / 7, 3.0) if len(case["gravity"]) == 2 else (2 / 7, 3.5)
    if found(plan, "time_step") is None:
        return None
    angle = math.sqrt(ratio * turning * stiffness["absolute"] / mass) * found(plan, "time_step")
    command = [solver, written, "--output", folder / "run", "--overwrite", "--threads", "1", "--allow-unstable", "--no-final-checkpoint"]
    done = subprocess.run(command, capture_output=True, text=True)
    for table in sorted((folder / "run").glob("*.csv")):
        rows = [row for row in csv.reader(open(table)) if row and not row[0].startswith("#")]
        column = next((i for i, name in enumerate(rows[0]) if "velocity_x" in name), None) if rows else None
        if column is not None:
            late = rows[1 + 3 * len(rows) // 4 :]
            return done.returncode, angle, max(abs(float(row[column])) for row in late if row[column] not in ("", "-"))
    sys.exit(f"resting: {done.stderr[-800:]}")


def main():
    """Runs the scenes and writes the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("solver", type=pathlib.Path)
    options.add_argument("--table", type=pathlib.Path)
    options.add_argument("--runs", type=int, default=40)
    options.add_argument("--dimension", type=int, default=2, choices=(2, 3))
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--coupling", default="partially_saturated")
    given = options.parse_args()
    solver = given.solver.resolve()
    draw = random.Random(given.seed)
    revision = subprocess.run([solver, "--version"], capture_output=True, text=True).stdout.splitlines()[0]
    print(f"# {revision}; python3 benches/stability/resting.py SOLVER --runs {given.runs} --dimension {given.dimension} --seed {given.seed}")
    print("density_ratio,viscosity,stiffness,cells_per_diameter,frequency_step," + ",".join(f"speed_at_{z:g}" for z in DAMPING))
    print("-,m2/s,N/m,-,-" + ",m/s" * len(DAMPING), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(given.runs):
            ratio = draw.choice((1.05, 1.2, 1.5, 2.0, 2.65))
            viscosity = 10 ** draw.uniform(-6, -4.5)
            stiffness = draw.choice((None, None, round(10 ** draw.uniform(3.5, 6))))
            cells = draw.choice((4, 5, 6, 8, 10))
            scenes = [case(given.dimension, given.coupling, (ratio, viscosity, stiffness, cells), z) for z in DAMPING]
            rows = [speed(solver, pathlib.Path(folder), scene) for scene in scenes]
            if None in rows:  # The program refuses the scene.
                continue
            speeds = ",".join(f"{v:.1e}" if code == 0 else f"exit {code}" for code, _, v in rows)
            print(f"{ratio},{viscosity:.2e},{stiffness or 'automatic'},{cells},{rows[0][1]:.3g},{speeds}", flush=True)


if __name__ == "__main__":
    main()
