#!/usr/bin/env python3
"""Compares the network of joints on coarse cells with lattices that resolve the joint: a block above a joint of 10 mm and
0.32 m, periodic along the joint, between two pools. Writes lift, moment and cost of each run as CSV.

    python3 jobs/verification/wide-joint/coarse.py SOLVER OUTPUT.csv [CELLS ...]

CELLS are the cells across the joint, by default 1/4, 1/2 and 1 for the network and 2, 3 and 4 for the lattice. The cost
is processor time of the steps, for a joint 0.08 m wide: the flow does not depend on that direction, so that finer
lattices have fewer cells across it and their time is multiplied by the ratio. The reference is the lattice with the most
cells; the moment is that of the pressures and of the friction about the middle of the block.
"""
import csv
import json
import math
import os
import resource
import subprocess
import sys
import tempfile

APERTURE, LENGTH, WIDTH, POOL, BASE, HEIGHT, END = 0.01, 0.32, 0.08, 0.08, 0.04, 0.12, 2.4
# Time step with one cell across the joint [s]: the numbers of steps and of cells along an axis grow together.
STEP = 3.2e-3
# Length of the runs whose time counts on coarse lattices, divided by that of the others.
LONGER = 10


def case(method, cells):
    spacing = APERTURE / cells
    rows = min(round(WIDTH / spacing), math.ceil(2.5 * cells - 1e-9)) if cells > 1 else round(WIDTH / spacing)
    width = rows * spacing
    far = LENGTH + 2 * POOL
    top = BASE + APERTURE
    block = [far / 2, width / 2, (top + HEIGHT) / 2]
    pressure = {"pressure": {"value": 6, "ramp": {"duration": 0.8}}}
    return {
        "domain": {"size": [far, width, HEIGHT], "spacing": spacing, "periodic": ["y"]},
        "materials": {"rock": {"density": 2650}},
        "blocks": {"material": "rock", "initial": {"list": [
            {"shape": {"cuboid": {"edges": [far, width, BASE]}}, "position": [far / 2, width / 2, BASE / 2]},
            {"shape": {"cuboid": {"edges": [LENGTH, width, HEIGHT - top]}}, "position": block}]},
            "fixed": [{"from": [0, 0, 0], "to": [far, width, HEIGHT]}]},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 35}},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": STEP / cells, "collision": {"trt": {}},
            "boundaries": [
                {"name": "left", "face": "x_min", "condition": pressure},
                {"name": "right", "face": "x_max", "condition": {"pressure": {"value": 0}}}],
            "joints": {"method": method, "largest_aperture": 0.0105, "residual_aperture": 1e-5,
                       "cell": max(0.01, spacing)}}},
        "probes": [{"name": "block", "every": END / 25, "at": {"block": {"position": block}}}],
        "checkpoint": {"every": END},
        "time": {"end": END},
    }, width


def late(path, names):
    rows = [row for row in csv.reader(line for line in open(path) if not line.startswith("#"))]
    last = rows[1:][-5:]
    return [sum(float(row[rows[0].index(name)]) for row in last) / len(last) for name in names]


def run(solver, method, cells, folder, end):
    """Runs a case to this time; returns its loads, its processor time [s] and the ratio of the widths."""
    scene, width = case(method, cells)
    scene["time"]["end"] = end
    scene["checkpoint"]["every"] = end
    name = os.path.join(folder, f"{method}-{cells}-{end:g}")
    with open(name + ".json", "w") as file:
        json.dump(scene, file)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([solver, "run", name + ".json", "--output", name, "--threads", "1"], check=True,
                   stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    lift, moment = late(os.path.join(name, "probe_block.csv"), ["force_z", "torque_y"])
    # In terms of the pressure difference of 6 Pa.
    return [lift / (6 * LENGTH * width), moment / (6 * LENGTH ** 2 * width)], seconds, WIDTH / width


def main():
    solver, output = sys.argv[1:3]
    chosen = [float(text) for text in sys.argv[3:]] or [0.25, 0.5, 1, 2, 3, 4]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for cells in chosen:
            method = "network" if cells <= 1 else "lattice"
            loads, once, wider = run(solver, method, cells, folder, END)
            # The start of the program does not count; runs of milliseconds are compared with longer ones.
            other = END * (LONGER if cells <= 2 else 0.1)
            seconds = (run(solver, method, cells, folder, other)[1] - once) / (other - END) * END
            rows.append((method, cells, loads, wider * seconds))
            print(rows[-1], flush=True)
    reference = rows[-1][2]
    with open(output, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["method", "cells_across", "lift", "moment", "lift_error", "moment_error", "processor_seconds"])
        for method, cells, loads, seconds in rows:
            errors = [load / other - 1 for load, other in zip(loads, reference)]
            table.writerow([method, f"{cells:g}"] + [f"{load:.6f}" for load in loads]
                           + [f"{error:.5f}" for error in errors] + [f"{seconds:.4f}"])


if __name__ == "__main__":
    main()
