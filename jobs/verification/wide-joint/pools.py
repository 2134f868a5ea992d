"""Block above a joint of 10 mm, periodic along the joint, between two pools of 6 and 0 Pa: its case, its runs, and tables of
errors. `methods.py` and `coarse.py` use it.
"""
import csv
import json
import os
import resource
import subprocess

APERTURE, PRESSURE = 0.01, 6


def cuboid(edges, position):
    return {"shape": {"cuboid": {"edges": edges}}, "position": position}


def case(method, spacing, sizes, times, cell):
    """Returns the case of a base and a block with these sizes [m]: length of the block, of a pool, width, heights of the base
    and of the domain. `times` are the time step, the duration of the ramp of the pressure, the interval of the probe and the
    end [s]; `cell` is the size of a cell of the joint [m]."""
    length, pool, width, base, height = sizes
    step, ramp, every, end = times
    far, top = length + 2 * pool, base + APERTURE
    block = [far / 2, width / 2, (top + height) / 2]
    pressure = {"pressure": {"value": PRESSURE, "ramp": {"duration": ramp}}}
    return {
        "domain": {"size": [far, width, height], "spacing": spacing, "periodic": ["y"]},
        "materials": {"rock": {"density": 2650}},
        "blocks": {"material": "rock", "initial": {"list": [
            cuboid([far, width, base], [far / 2, width / 2, base / 2]), cuboid([length, width, height - top], block)]},
            "fixed": [{"from": [0, 0, 0], "to": [far, width, height]}]},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "friction_angle_degrees": 35}},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 1e-3, "time_step": step, "collision": {"trt": {}},
            "boundaries": [
                {"name": "left", "face": "x_min", "condition": pressure},
                {"name": "right", "face": "x_max", "condition": {"pressure": {"value": 0}}}],
            "joints": {"method": method, "largest_aperture": 0.0105, "residual_aperture": 1e-5, "cell": cell}}},
        "probes": [{"name": "block", "every": every, "at": {"block": {"position": block}}}],
        "time": {"end": end},
    }


def late(path, names, count):
    """Returns the means of the last rows of these columns of a probe."""
    with open(path) as file:
        header, *rows = csv.reader(line for line in file if not line.startswith("#"))
    last = rows[-count:]
    return [sum(float(row[header.index(name)]) for row in last) / len(last) for name in names]


def run(solver, scene, name, columns, count):
    """Runs a case on one thread; returns the means of the last rows of the probe, and the processor time [s]."""
    with open(name + ".json", "w") as file:
        json.dump(scene, file)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([solver, "run", name + ".json", "--output", name, "--threads", "1"], check=True,
                   stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return late(os.path.join(name, "probe_block.csv"), columns, count), seconds


def write(output, names, rows, reference, digits):
    """Writes rows of a method, a number of cells, loads and seconds, with the errors of the loads against the reference."""
    with open(output, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        errors = [name + "_error" for name in names]
        table.writerow(["method", "cells_across", *names, *errors, "processor_seconds"])
        for method, cells, loads, seconds in rows:
            errors = [load / other - 1 for load, other in zip(loads, reference)]
            table.writerow([method, f"{cells:g}"] + [f"{load:.6f}" for load in loads]
                           + [f"{error:.5f}" for error in errors] + [f"{seconds:.{digits}f}"])
