"""Smallest stable density ratio of packed grains over operator, radius and relaxation time.

    python3 benches/stability/dense_beds.py target/release/solver OUTPUT [OPERATOR...]

32 spheres on a face-centred lattice fill 0.72 of a periodic box, 16 discs on a hexagonal one 0.895 of it. They start in water at rest with
random velocities of 1e-5 cells a step. A run holds if their kinetic energy is less after 400 steps. Eight bisections give the border to 1.2 %.
The script writes OUTPUT/dense_beds.csv: the largest unstable and the smallest stable density ratio. The bounds are `lightest_in_a_bed` of
each operator in `src/lbm/saturation/`. It needs numpy and h5py.
"""

import csv
import glob
import json
import math
import pathlib
import random
import subprocess
import sys

import h5py

OPERATORS = ("viscosity_matched", "non_equilibrium_bounce_back", "bounce_back_about_solid", "superposition")
RADII = {2: (3, 5, 8), 3: (2.15, 3, 4, 6)}
FRACTIONS = {2: 0.895, 3: 0.72}
TIMES = (0.55, 0.8, 1.0, 1.5, 2.0)
SPACING, VISCOSITY, STEPS, PLACE = 1e-3, 1e-5, 400, 0.13


def spheres(radius, fraction):
    """Box, radius and places in cells."""
    balls = 32 * 4 / 3 * math.pi
    edge = round((balls * radius**3 / fraction) ** (1 / 3))
    radius = (fraction * edge**3 / balls) ** (1 / 3)
    a = edge / 2
    corners = [(i, j, k) for i in range(2) for j in range(2) for k in range(2)]
    basis = ((0, 0, 0), (0.5, 0.5, 0), (0.5, 0, 0.5), (0, 0.5, 0.5))
    places = [[((x + y) * a + PLACE + a / 4) % edge for x, y in zip(corner, b)] for corner in corners for b in basis]
    return [edge] * 3, radius, places


def discs(radius, fraction):
    """The same in the plane; as the box is whole cells, rows and columns are not quite alike."""
    apart = math.sqrt(2 * math.pi * radius**2 / (fraction * math.sqrt(3)))
    size = [round(4 * apart), round(2 * apart * math.sqrt(3))]
    radius = math.sqrt(fraction * size[0] * size[1] / (16 * math.pi))
    closest = min(size[0] / 4, math.hypot(size[0] / 8, size[1] / 4))
    radius = min(radius, 0.998 * closest / 2)
    places = [
        [((i + 0.5 * (j % 2) + 0.25) * size[0] / 4 + PLACE) % size[0], ((j + 0.5) * size[1] / 4 + PLACE) % size[1]]
        for j in range(4)
        for i in range(4)
    ]
    return size, radius, places


def case(operator, dimension, radius, tau, ratio):
    """The case, and the radius in cells that fills the box."""
    size, radius, places = (discs if dimension == 2 else spheres)(radius, FRACTIONS[dimension])
    dt = (tau - 0.5) / 3 * SPACING**2 / VISCOSITY
    draw = random.Random(3)
    grains = [
        {
            "position": [x * SPACING for x in place],
            "radius": radius * SPACING,
            "velocity": [1e-5 * SPACING / dt * draw.uniform(-1, 1) for _ in range(dimension)],
        }
        for place in places
    ]
    stiffness = 1e-3 * 1000 * SPACING**dimension / dt**2
    return {
        "domain": {"size": [x * SPACING for x in size], "spacing": SPACING, "periodic": ["x", "y", "z"][:dimension]},
        "materials": {"grain": {"density": 1000 * ratio}},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": VISCOSITY, "relaxation_time": tau}},
        "grains": {"material": "grain", "initial": {"list": grains}},
        "contact": {"linear": {"normal_stiffness": {"absolute": stiffness}, "normal_damping_ratio": 0.3}},
        "coupling": {"partially_saturated": {"solid_operator": operator}},
        "time": {"end": STEPS * dt, "solid_steps_per_fluid_step": 1, "solid_time_step_safety": 1},
        "output": {"grains": {"every": STEPS * dt}},
    }, radius


def energy(path):
    """Sum of the squared velocities."""
    with h5py.File(path) as file:
        fields = file["VTKHDF/PointData"]
        name = next(name for name in fields if name.startswith("velocity"))
        return float((fields[name][...] ** 2).sum())


def holds(solver, folder, written):
    """Whether the grains come to rest."""
    path = folder / "case.json"
    path.write_text(json.dumps(written))
    command = [solver, "run", path, "--threads", "1", "--output", folder / "run", "--overwrite"]
    run = subprocess.run(command + ["--no-final-checkpoint", "--allow-unstable"], capture_output=True, text=True)
    if run.returncode == 3 and "makes it unstable" not in run.stdout + run.stderr:
        sys.exit(run.stdout + run.stderr)
    if run.returncode != 0:
        return False
    files = sorted(glob.glob(str(folder / "run" / "grains_*.vtkhdf")))
    return energy(files[-1]) < energy(files[0])


def main():
    solver, output = sys.argv[1], pathlib.Path(sys.argv[2])
    output.mkdir(parents=True, exist_ok=True)
    rows = []
    for dimension, radii in RADII.items():
        for operator in sys.argv[3:] or OPERATORS:
            for radius in radii:
                for tau in TIMES:
                    low, high = 0.2, 20.0
                    for _ in range(8):
                        middle = math.sqrt(low * high)
                        written, real = case(operator, dimension, radius, tau, middle)
                        if holds(solver, output, written):
                            high = middle
                        else:
                            low = middle
                    rows.append([operator, dimension, f"{real:.3f}", tau, f"{low:.3f}", f"{high:.3f}"])
                    print(*rows[-1], flush=True)
    with open(output / "dense_beds.csv", "w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["operator", "dimension", "radius [cells]", "relaxation time", "thrown away", "held"])
        writer.writerows(rows)


main()
