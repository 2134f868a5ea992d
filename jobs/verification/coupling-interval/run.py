#!/usr/bin/env python3
"""Which coupling intervals of a seepage are right: consolidation, silt and random beds beside runs that couple in each solid step.

    python3 jobs/verification/coupling-interval/run.py SOLVER [WORK] [--beds N]

Needs the packages of jobs/python. Three tables are written beside this script (erosion.csv there is from runs of the smaller fissure):

columns.csv   columns of touching grains settle under their weight in water, oil and glycerine, and a column of silt in water, at intervals of 1 to
              1000 solid steps and at the default one: the largest difference of the settlement of any grain from that of the run that couples in each step, over
              the whole run, over the settlement of the top
terzaghi.csv  the settlement of the top of a column in glycerine over Terzaghi's (1943) for the modulus of its contacts and the permeability of its resistance
beds.csv      random beds (size, viscosity, stiffness, damping, interval; seeds stated), each at a stated and at the default interval: the verdict, the largest speed
              after the bed has settled over its free fall, and the rise of its top

An interval beyond its limits is refused (`unstable`); --allow-unstable shows what it would have done. The status is 1 where a valid run misses what the tables promise.
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

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "python"))
import numpy  # noqa: E402
from solver_results import Run  # noqa: E402

# Allowed difference from the run that couples in each step, over the settlement of the top.
BOUND = 0.02
INTERVALS = [2, 5, 10, 20, 50, 100, 200, 500, 1000, None]
GRAVITY = 9.81
POROSITY = 1.0 - math.pi / 6.0  # of a column of spheres in cells of their size

# Name, diameter [m], density of the grains [kg/m3], liquid: density [kg/m3] and viscosity [Pa s], stiffness [N/m], damping ratio.
COLUMNS = [
    ("water", 1e-3, 2650, (1000, 1e-3), 1e3, 0.0),
    ("water, damped", 1e-3, 2650, (1000, 1e-3), 1e3, 0.3),
    ("oil", 1e-3, 2650, (900, 0.1), 1e3, 0.0),
    ("oil, damped", 1e-3, 2650, (900, 0.1), 1e3, 0.3),
    ("glycerine", 1e-3, 2650, (1260, 1.4), 1e3, 0.0),
    ("glycerine, damped", 1e-3, 2650, (1260, 1.4), 1e3, 0.3),
    ("silt in water", 3e-5, 2650, (1000, 1e-3), 20.0, 0.0),
    ("silt in water, damped", 3e-5, 2650, (1000, 1e-3), 20.0, 0.3),
]


def permeability(diameter):
    return POROSITY**3 * diameter**2 / (180.0 * (1.0 - POROSITY) ** 2)


def column(diameter, density, liquid, stiffness, damping, grains=8):
    """The case, and the time in which the bed settles [s]."""
    size = [diameter, diameter, grains * diameter]
    mass = density * math.pi / 6.0 * diameter**3
    slowest = 2.0 * grains / math.pi * math.sqrt(mass / stiffness)
    stops = density * (1.0 - POROSITY) * permeability(diameter) / liquid[1]
    end = max(4.0 * slowest**2 / stops, 12.0 * slowest)
    contact = {"normal_stiffness": {"absolute": stiffness}, "friction_angle_degrees": 30}
    if damping > 0.0:
        contact["normal_damping_ratio"] = damping
    return {
        "title": "settling column",
        "gravity": [0, 0, -GRAVITY],
        "domain": {"size": [diameter, diameter, (grains + 4) * diameter], "spacing": diameter},
        "materials": {"grain": {"density": density}},
        "fluid": {"darcy": {
            "density": liquid[0], "viscosity": liquid[1], "resistance": "kozeny_carman",
            "grid": {"from": [0, 0, 0], "to": size, "cells": [1, 1, grains]},
            "boundaries": [{"name": "top", "face": "z_max", "condition": {"pressure": {"value": 0}}}],
        }},
        "grains": {"material": "grain", "initial": {"list": [
            {"position": [diameter / 2, diameter / 2, (k + 0.5) * diameter], "radius": diameter / 2} for k in range(grains)
        ]}},
        "contact": {"linear": contact},
        "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"],
        "box_wall_material": "grain",
        "time": {"end": end},
        "output": {"grains": {"every": end / 100}},
    }, end


def bed(seed):
    """A random bed of spheres that touch or nearly do, and a coupling interval."""
    draw = random.Random(seed)
    diameter = 10 ** draw.uniform(-4.5, -2.3)
    viscosity = 10 ** draw.uniform(-3, 0.3)
    density = draw.uniform(1500, 4000)
    height = draw.randint(6, 14)
    weight = (density - 1000) * GRAVITY * math.pi / 6 * diameter**3 * height
    # Overlaps of 1e-5 to 1e-2 of a diameter under the weight of the bed.
    stiffness = weight / (diameter * 10 ** draw.uniform(-5, -2))
    damping = draw.choice([0.0, 0.05, 0.2, 0.5])
    interval = round(10 ** draw.uniform(0, 3))
    side = draw.choice([1, 3])
    # Irregular: some grains are smaller than their places.
    grains = []
    for k in range(height):
        for j in range(side):
            for i in range(side):
                part = draw.uniform(0.85, 1.0) if draw.random() < 0.3 else 1.0
                grains.append({"position": [(i + 0.5) * diameter, (j + 0.5) * diameter, (k + 0.5) * diameter], "radius": 0.5 * part * diameter})
    case, _ = column(diameter, density, (1000, viscosity), stiffness, damping, height)
    case["grains"]["initial"]["list"] = grains
    cell = diameter * (side if side > 1 else 1)
    width = side * diameter
    case["domain"] = {"size": [width, width, (height + 4) * diameter], "spacing": diameter}
    case["fluid"]["darcy"]["grid"] = {"from": [0, 0, 0], "to": [width, width, height * diameter], "cells": [1, 1, max(2, round(height * diameter / cell))]}
    case["fluid"]["darcy"]["resistance"] = draw.choice(["gidaspow", "kozeny_carman", "ergun"])
    # Not for ever: a quarter of a million solid steps.
    case["time"]["end"] = min(case["time"]["end"], 5e4 * math.sqrt(density * math.pi / 6 * diameter**3 / stiffness))
    case["output"]["grains"]["every"] = case["time"]["end"] / 20
    return case, {"seed": seed, "diameter": diameter, "viscosity": viscosity, "density": density, "stiffness": stiffness, "damping": damping, "interval": interval, "grains": len(grains)}


def run(solver, work, case, interval, allow=False):
    """The verdict, and the heights of all grains at the times of the outputs."""
    case = json.loads(json.dumps(case))
    case["fluid"]["darcy"].pop("coupling_interval", None)
    if interval is not None:
        case["fluid"]["darcy"]["coupling_interval"] = interval
    path, folder = work / "case.json", work / "run"
    path.write_text(json.dumps(case))
    words = [solver, str(path), "--output", str(folder), "--overwrite", "--threads", "1", "--no-final-checkpoint"] + (["--allow-unstable"] if allow else [])
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode == 3:
        return "refused", None, None
    if done.returncode != 0:
        return f"failed ({done.returncode})", None, None
    times, heights = [], []
    with Run(folder) as results:
        for output in results.grains:
            order = numpy.argsort(output["id"])
            times.append(output.time)
            heights.append(output.positions[order, 2])
    return "valid", numpy.array(times), numpy.array(heights)


def settlement(heights):
    return heights[0] - heights


def difference(reference, other, scale):
    """The largest difference of settlements, the reference between its times by a cubic through four of them."""
    (t0, z0), (t1, z1) = reference, other
    inside = t1 <= t0[-1]
    worst = 0.0
    for k in range(z0.shape[1]):
        worst = max(worst, float(numpy.abs(cubic(t0, settlement(z0)[:, k], t1[inside]) - settlement(z1)[inside, k]).max()))
    return worst / scale


def cubic(x, y, at):
    out = numpy.empty_like(at)
    for n, t in enumerate(at):
        k = int(numpy.clip(numpy.searchsorted(x, t) - 2, 0, len(x) - 4))
        xs, ys = x[k:k + 4], y[k:k + 4]
        out[n] = sum(ys[i] * numpy.prod([(t - xs[j]) / (xs[i] - xs[j]) for j in range(4) if j != i]) for i in range(4))
    return out


def columns(solver, work):
    rows, good = [], True
    for name, *of_column in COLUMNS:
        case, _ = column(*of_column)
        # What the run of one step resolves has to be seen between two outputs.
        case["output"]["grains"]["every"] /= 4
        _, t0, z0 = run(solver, work, case, 1)
        scale = float(settlement(z0)[-1, -1])
        for interval in INTERVALS:
            verdict, t, z = run(solver, work, case, interval)
            beyond = ""
            if verdict == "refused":
                state, t, z = run(solver, work, case, interval, allow=True)
                beyond = state if z is None else f"{difference((t0, z0), (t, z), scale):.2g}"
            error = "" if verdict != "valid" else f"{difference((t0, z0), (t, z), scale):.2g}"
            good &= verdict == "refused" or (error != "" and float(error) <= BOUND)
            rows.append({"column": name, "interval": interval or "default", "verdict": verdict, "difference": error, "if it is run all the same": beyond})
            print(*rows[-1].values(), sep="  ", flush=True)
    return rows, good


def terzaghi(solver, work, grains=48):
    """Self-weight consolidation from the state without stress (Terzaghi 1943, an initial pressure in proportion to the depth)."""
    diameter, density, liquid, stiffness = 1e-3, 2650, (1260, 1.4), 1e3
    case, _ = column(diameter, density, liquid, stiffness, 0.0, grains)
    height = grains * diameter
    modulus = stiffness / diameter
    rate = permeability(diameter) * modulus / liquid[1] / height**2
    end = 1.0 / rate
    case["time"]["end"] = end
    case["output"]["grains"]["every"] = end / 20
    verdict, times, heights = run(solver, work, case, None)
    rows, good = [], verdict == "valid"
    if heights is None:
        return [{"time factor": "", "settlement": verdict, "Terzaghi": "", "ratio": ""}], False
    mass = (density - liquid[0]) * math.pi / 6 * diameter**3 * GRAVITY / stiffness
    final = mass * sum(grains - k for k in range(grains))
    for time, now in list(zip(times, settlement(heights)[:, -1]))[2::3]:
        factor = rate * time
        # The settlement of the surface, drained at the top, initial pressure in proportion to the depth.
        terms = [(-1.0) ** n * math.exp(-((n + 0.5) * math.pi) ** 2 * factor) / ((n + 0.5) * math.pi) ** 3 for n in range(40)]
        exact = 1.0 - 4.0 * sum(terms)
        found = float(now) / final
        good &= abs(found - exact) < BOUND
        rows.append({"time factor": f"{factor:.3f}", "settlement": f"{found:.4f}", "Terzaghi": f"{exact:.4f}", "ratio": f"{found / exact:.3f}"})
        print(*rows[-1].values(), sep="  ", flush=True)
    return rows, good


def beds(solver, work, count):
    rows, good = [], True
    for seed in range(1, count + 1):
        case, words = bed(seed)
        fall = None
        for interval in (words["interval"], None):
            verdict, times, heights = run(solver, work, case, interval)
            row = dict(words, interval=interval or "default", verdict=verdict, rise="", late="")
            if heights is not None:
                scale = words["diameter"]
                top = settlement(heights)
                row["rise"] = f"{float(-top.min()) / scale:.1e}"
                # What grains still move in the last quarter, over a diameter.
                last = heights[3 * len(heights) // 4:]
                row["late"] = f"{float(numpy.ptp(last, axis=0).max()) / scale:.1e}"
                good &= float(row["rise"]) < 0.05
            good &= not verdict.startswith("failed")
            rows.append(row)
        print(*rows[-2].values(), "|", rows[-1]["verdict"], rows[-1]["rise"], rows[-1]["late"], flush=True)
    return rows, good


def write(name, rows, program):
    with (HERE / name).open("w", newline="") as file:
        file.write(f"# {program}\n")
        out = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        out.writeheader()
        out.writerows(rows)


def main():
    words = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    words.add_argument("solver")
    words.add_argument("work", nargs="?")
    words.add_argument("--beds", type=int, default=200)
    words.add_argument("--only", choices=["columns", "terzaghi", "beds"])
    words = words.parse_args()
    solver = words.solver
    work = pathlib.Path(words.work or tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    program = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip().splitlines()[0]
    good = True
    for name, table in (("columns", lambda: columns(solver, work)), ("terzaghi", lambda: terzaghi(solver, work)), ("beds", lambda: beds(solver, work, words.beds))):
        if words.only not in (None, name):
            continue
        rows, right = table()
        write(f"{name}.csv", rows, program)
        good &= right
    sys.exit(0 if good else 1)


main()
