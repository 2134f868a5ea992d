#!/usr/bin/env python3
"""Runs a block above a joint of 10 mm, periodic along the joint, by the network and by the lattice, on lattices with
several numbers of cells across the joint, and writes lift, push, moment and processor time of each run as CSV.

    python3 jobs/verification/wide-joint/methods.py SOLVER OUTPUT.csv [CELLS ...]

The reference is the lattice with the most cells. Processor time is that of the process, on one thread.
"""
import csv
import json
import math
import os
import resource
import subprocess
import sys
import tempfile

APERTURE, LENGTH, WIDTH, POOL, BASE, TOP, END = 0.01, 0.1, 0.0125, 0.03, 0.02, 0.03, 0.3


def case(method, cells):
    spacing = APERTURE / cells
    # A power of two of cells would fit all heights; others are rounded to whole cells.
    width = math.ceil(WIDTH / spacing - 1e-9) * spacing
    base = round(BASE / spacing) * spacing
    top = round(TOP / spacing) * spacing
    pool = round(POOL / spacing) * spacing
    length = round(LENGTH / spacing) * spacing
    far, height = length + 2 * pool, base + APERTURE + top
    block = [far / 2, width / 2, base + APERTURE + top / 2]
    pressure = {"pressure": {"value": 6, "ramp": {"duration": 0.02}}}
    return {
        "domain": {"size": [far, width, height], "spacing": spacing, "periodic": ["y"]},
        "materials": {"rock": {"density": 2650}},
        "blocks": {"material": "rock", "initial": {"list": [
            {"shape": {"cuboid": {"edges": [far, width, base]}}, "position": [far / 2, width / 2, base / 2]},
            {"shape": {"cuboid": {"edges": [length, width, top]}}, "position": block}]},
            "fixed": [{"from": [0, 0, 0], "to": [far, width, height]}]},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 35}},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": 2e-4 * (spacing / 0.0025) ** 2,
            "collision": {"trt": {}},
            "boundaries": [
                {"name": "left", "face": "x_min", "condition": pressure},
                {"name": "right", "face": "x_max", "condition": {"pressure": {"value": 0}}}],
            "joints": {"method": method, "largest_aperture": 0.0105, "residual_aperture": 1e-5,
                       "cell": max(0.005, spacing)}}},
        "probes": [{"name": "block", "every": END / 60, "at": {"block": {"position": block}}}],
        "time": {"end": END},
    }, length * width, length ** 2 * width


def late(path, names):
    rows = [row for row in csv.reader(line for line in open(path) if not line.startswith("#"))]
    last = rows[-10:]
    return [sum(float(row[rows[0].index(name)]) for row in last) / len(last) for name in names]


def run(solver, method, cells, folder):
    scene, area, lever = case(method, cells)
    name = os.path.join(folder, f"{method}-{cells}")
    with open(name + ".json", "w") as file:
        json.dump(scene, file)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([solver, "run", name + ".json", "--output", name, "--threads", "1"], check=True,
                   stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    lift, push, moment = late(os.path.join(name, "probe_block.csv"), ["force_z", "force_x", "torque_y"])
    # In terms of the pressure difference of 6 Pa.
    return [lift / (6 * area), push / (6 * area), moment / (6 * lever)], seconds


def main():
    solver, output = sys.argv[1:3]
    cells = [int(text) for text in sys.argv[3:]] or [1, 2, 3, 4, 6, 8]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for number in cells:
            for method in ["network", "lattice"]:
                if method == "lattice" and number == 1:
                    continue
                loads, seconds = run(solver, method, number, folder)
                rows.append((method, number, loads, seconds))
                print(rows[-1], flush=True)
    reference = [row for row in rows if row[0] == "lattice"][-1][2]
    with open(output, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["method", "cells_across", "lift", "push", "moment", "lift_error", "push_error", "moment_error",
                        "processor_seconds"])
        for method, number, loads, seconds in rows:
            errors = [load / other - 1 for load, other in zip(loads, reference)]
            table.writerow([method, number] + [f"{load:.6f}" for load in loads]
                           + [f"{error:.5f}" for error in errors] + [f"{seconds:.2f}"])


if __name__ == "__main__":
    main()
