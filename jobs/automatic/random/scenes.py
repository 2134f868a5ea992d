"""Random scenes: does a run keep the error that its plan promises?

    python3 scenes.py --solver SOLVER --output DIR --seed 1 --count 40 [--levels draft normal reference] [--jobs 1]

Each scene is drawn from a family by its number and the seed: shapes, gaps, walls, drives, steady or not. The case states no numerics but the level of
accuracy. Its quantities (flow, force, torque, amplitude) are compared with the Richardson extrapolation (order 2) of two runs of the same
scene, at 1.1 and 1.7 times the resolution of `reference`. A scene is unresolved, and not judged, where the finer one differs by more than 4 % from
the extrapolation.

The table `scenes.csv` has a line for each scene, level and quantity: promise, error, their ratio, cells and processor time. Runs that exist are not
made again.
"""

import argparse
import csv
import json
import math
import os
import random
import resource
import subprocess
import sys

WATER = {"density": 1000, "kinematic_viscosity": 1e-6}
OIL = {"density": 900, "kinematic_viscosity": 1e-4}


def base(size, periodic, fluid, bodies, end, probes):
    return {
        "domain": {"size": size, "periodic": periodic},
        "materials": {"steel": {"density": 7800}},
        "fluid": {"lattice_boltzmann": fluid},
        "bodies": bodies,
        "time": {"end": end},
        "probes": probes,
    }


def disc(name, at, radius, motion=None):
    return {
        "name": name,
        "shape": {"disc": {"radius": radius}},
        "position": at,
        "motion": motion or {"fixed": {}},
        "material": "steel",
    }


def plane(size, end):
    return {"name": "flow", "every": end, "at": {"plane": {"axis": "x", "position": 0.37 * size[0]}}}


def body(name, end):
    return {"name": name, "every": end, "at": {"body": {"name": name}}}


FLOW = ("flow", "discharge", "last")


def discs_apart(draw, count, size, radius, least, periodic):
    """Discs whose gaps to each other, to walls and to images are at least `least`."""
    found = []
    for _ in range(2000):
        r = radius * draw.uniform(0.7, 1.3)
        at = [draw.uniform(0, size[0]), draw.uniform(0, size[1])]
        if "y" not in periodic and not least + r < at[1] < size[1] - least - r:
            continue
        if "x" not in periodic and not 3 * radius < at[0] < size[0] - 3 * radius:
            continue
        good = True
        for other, s in found + [(at, r)]:
            for i in (-1, 0, 1) if "x" in periodic else (0,):
                for j in (-1, 0, 1) if "y" in periodic else (0,):
                    if other is at and (i, j) == (0, 0):
                        continue
                    dx, dy = other[0] + i * size[0] - at[0], other[1] + j * size[1] - at[1]
                    good &= math.hypot(dx, dy) > r + s + least
        if good:
            found.append((at, r))
        if len(found) == count:
            break
    return [disc(f"d{n}", at, r) for n, (at, r) in enumerate(found)]


def array(draw):
    """Periodic box with discs under a body force, dilute to dense."""
    size = [1e-3 * draw.choice([1, 1.25, 1.5]), 1e-3]
    count = draw.choice([1, 1, 2, 3])
    radius = 1e-3 * draw.uniform(0.12, 0.47) / math.sqrt(count)
    bodies = discs_apart(draw, count, size, radius, radius * draw.uniform(0.06, 0.5), "xy")
    fluid = {**WATER, "body_force": {"constant": [draw.uniform(0.05, 2), 0]}}
    return base(size, ["x", "y"], fluid, bodies, 0.5, [plane(size, 0.5)]), [FLOW]


def walled(draw):
    """Channel between walls with fixed discs under a body force."""
    size = [2e-3, 1e-3]
    count = draw.choice([1, 2, 3])
    radius = 1e-3 * draw.uniform(0.08, 0.3) / math.sqrt(count)
    bodies = discs_apart(draw, count, size, radius, radius * draw.uniform(0.1, 1.0), "x")
    fluid = {**WATER, "body_force": {"constant": [draw.uniform(0.1, 20), 0]}}
    probes = [plane(size, 1.0), body("d0", 1.0)]
    return base(size, ["x"], fluid, bodies, 1.0, probes), [FLOW, ("d0", "fluid_force_x", "last")]


def slot(draw):
    """A rod that fills most of a slot."""
    gap = draw.uniform(0.08, 0.5)
    height = 1e-3 * (2 + 2 * gap)
    size = [height * 2, height]
    off = draw.uniform(-0.3, 0.3) * gap * 1e-3
    bodies = [disc("rod", [size[0] * 0.503, 0.5 * height + off], 1e-3)]
    fluid = {**OIL, "body_force": {"constant": [draw.uniform(1, 1000), 0]}}
    probes = [plane(size, 0.5), body("rod", 0.5)]
    return base(size, ["x"], fluid, bodies, 0.5, probes), [FLOW, ("rod", "fluid_force_x", "last")]


def turning(draw):
    """A rod that turns near a wall."""
    gap = draw.choice([0.06, 0.1, 0.2, 0.5, 1.0]) * draw.uniform(0.8, 1.2)
    size = [0.012, 0.01]
    motion = {"driven": {"angular_velocity": draw.choice([-1, 1]) * draw.uniform(0.5, 5)}}
    bodies = [disc("rod", [0.006 + draw.uniform(0, 2e-4), 0.001 * (1 + gap)], 0.001, motion)]
    return base(size, ["x"], OIL, bodies, 0.1, [body("rod", 0.1)]), [("rod", "fluid_torque_z", "last")]


def towed(draw):
    """A rod that is drawn along a channel."""
    gap = draw.uniform(0.3, 3)
    size = [0.02, 0.002 + 2 * 0.001 * gap]
    motion = {"driven": {"velocity": [draw.uniform(0.005, 0.05), 0]}}
    at = [0.006 + draw.uniform(0, 2e-4), 0.5 * size[1] * draw.uniform(0.95, 1.05)]
    bodies = [disc("rod", at, 0.001, motion)]
    return base(size, ["x"], OIL, bodies, 0.1, [body("rod", 0.1)]), [("rod", "fluid_force_x", "last")]


def pulsed(draw):
    """An oscillating force on a channel, empty or with a disc."""
    height = 1e-3 * draw.choice([1, 2, 4])
    size = [height, height]
    thickness = height * draw.uniform(0.04, 0.4)
    period = math.pi * thickness**2 / 1e-6
    bodies = []
    if draw.random() < 0.5:
        bodies = [disc("d0", [0.51 * height, draw.uniform(0.45, 0.55) * height], height * draw.uniform(0.1, 0.25))]
    force = {"oscillating": {"amplitude": [draw.uniform(0.01, 0.2), 0], "period": period}}
    end = 4 * period
    probe = {"name": "wall", "every": period / 40, "at": {"wall": {"face": "y_min"}}}
    fluid = {**WATER, "body_force": force}
    return base(size, ["x"], fluid, bodies, end, [probe]), [("wall", "force_x", "amplitude")]


def channel(draw):
    """Duct with an inlet velocity and an outlet pressure, with a disc."""
    height = 1e-2
    size = [3 * height, height]
    radius = height * draw.uniform(0.05, 0.2)
    speed = draw.uniform(0.2, 40) * 1e-4 / (2 * radius)
    fluid = {
        **OIL,
        "boundaries": [
            {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"parabolic": {"peak": speed}}}}},
            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
        ],
    }
    at = [1.2 * height, height * draw.uniform(0.4, 0.6)]
    end = 20 * height / speed if speed > 0.1 else 2.0
    end = min(end, 3.0)
    return base(size, [], fluid, [disc("d0", at, radius)], end, [body("d0", end / 50)]), [
        ("d0", "fluid_force_x", "mean")
    ]


def shear(draw):
    """A disc in a shear flow between moving walls."""
    height = 1e-2
    size = [2 * height, height]
    speed = draw.uniform(0.01, 0.5)
    wall = lambda face, u: {"name": face, "face": face, "condition": {"moving_wall": {"velocity": [u, 0]}}}
    fluid = {**OIL, "boundaries": [wall("y_min", -speed), wall("y_max", speed)]}
    radius = height * draw.uniform(0.08, 0.3)
    at = [1.01 * height, height * draw.uniform(0.4, 0.6)]
    return base(size, ["x"], fluid, [disc("d0", at, radius)], 1.0, [body("d0", 1.0)]), [
        ("d0", "fluid_torque_z", "last")
    ]


def cavity(draw):
    """A lid-driven box."""
    size = [0.01, 0.01 * draw.choice([0.5, 1, 2])]
    reynolds = draw.uniform(1, 100)
    speed = reynolds * 1e-4 / 0.01
    fluid = {**OIL, "boundaries": [
        {"name": "lid", "face": "y_max", "condition": {"moving_wall": {"velocity": [speed, 0]}}}]}
    probe = {"name": "point", "every": 2.0, "at": {"point": {"position": [0.0051, 0.3 * size[1]]}}}
    return base(size, [], fluid, [], 2.0, [probe]), [("point", "velocity_x", "last")]


def spheres(draw):
    """Cubic array of spheres, dilute to touching."""
    size = [1e-3] * 3
    radius = 1e-3 * draw.uniform(0.25, 0.49)
    shape = {"name": "s", "shape": {"sphere": {"radius": radius}}, "motion": {"fixed": {}}, "material": "steel"}
    at = [1e-3 * draw.uniform(0.45, 0.55) for _ in range(3)]
    fluid = {**WATER, "body_force": {"constant": [draw.uniform(0.05, 0.5), 0, 0]}}
    return base(size, ["x", "y", "z"], fluid, [{**shape, "position": at}], 0.2, [plane(size, 0.2)]), [FLOW]


FAMILIES = {
    "array": array, "walled": walled, "slot": slot, "turning": turning, "towed": towed, "pulsed": pulsed,
    "channel": channel, "shear": shear, "cavity": cavity, "spheres": spheres,
}
WEIGHTS = {"spheres": 0.5}


def value(folder, probe, column, take):
    with open(os.path.join(folder, f"probe_{probe}.csv")) as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    times = [float(row["time"]) for row in rows]
    values = [float(row[column]) for row in rows]
    if take == "last":
        return values[-1]
    late = [v for t, v in zip(times, values) if t > 0.75 * times[-1]]
    if take == "mean":
        return sum(late) / len(late)
    return 0.5 * (max(late) - min(late))


class Runner:
    def __init__(self, solver, folder):
        self.solver, self.folder = solver, folder

    def plan(self, path, sets):
        command = [self.solver, "plan", path, "--json"] + [x for s in sets for x in ("--set", s)]
        done = subprocess.run(command, capture_output=True, text=True)
        try:
            return json.loads(done.stdout)
        except json.JSONDecodeError:
            sys.stderr.write(f"{path}: {done.stderr[:400]}\n")
            return None

    def run(self, path, name, sets):
        folder = os.path.join(os.path.dirname(path), name)
        summary = os.path.join(folder, "summary.json")
        if not os.path.exists(summary):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            command = [self.solver, path, "--output", folder, "--overwrite", "--threads", "1", "--no-final-checkpoint"]
            command += [x for s in sets for x in ("--set", s)]
            done = subprocess.run(command, capture_output=True, text=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            if done.returncode != 0:
                sys.stderr.write(f"{folder}: {done.stderr[-400:]}\n")
                return None, seconds
            with open(os.path.join(folder, "seconds"), "w") as file:
                file.write(f"{seconds:.3f}")
        with open(os.path.join(folder, "seconds")) as file:
            return folder, float(file.read())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", default="solver")
    parser.add_argument("--output", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--levels", nargs="+", default=["draft", "normal", "reference"])
    parser.add_argument("--families", nargs="+", default=list(FAMILIES))
    options = parser.parse_args()
    runner = Runner(os.path.abspath(options.solver) if os.path.sep in options.solver else options.solver, options.output)
    os.makedirs(options.output, exist_ok=True)
    table = []
    for number in range(options.count):
        draw = random.Random(f"{options.seed}/{number}")
        family = options.families[number % len(options.families)]
        case, quantities = FAMILIES[family](draw)
        folder = os.path.join(options.output, f"{options.seed}_{number:03}_{family}")
        os.makedirs(folder, exist_ok=True)
        path = os.path.join(folder, "case.json")
        with open(path, "w") as file:
            json.dump(case, file, indent=1)
        finest = runner.plan(path, ["accuracy=reference"])
        if finest is None:
            continue
        h, dt = finest["scene"]["grid"]["spacing"], finest["scene"]["flow"]["time_step"]
        shortest = min(case["domain"]["size"])
        fine = []
        for factor in (1.1, 1.7):
            spacing = shortest / round(shortest / h * factor)
            # The same speed of sound: what settles by sound settles alike.
            step = dt * spacing / h
            sets = [f"domain.spacing={spacing!r}", f"fluid.lattice_boltzmann.time_step={step!r}", "accuracy=null"]
            done, seconds = runner.run(path, f"fine_{factor}", sets)
            fine.append((spacing, done, seconds))
        levels = []
        for level in options.levels:
            sets = [f'accuracy="{level}"']
            plan = runner.plan(path, sets)
            if plan is None:
                continue
            done, seconds = runner.run(path, level, sets)
            levels.append((level, plan, done, seconds))
        for probe, column, take in quantities:
            truth, spread = None, None
            if all(done for _, done, _ in fine):
                (h1, f1, _), (h2, f2, _) = fine
                a, b = value(f1, probe, column, take), value(f2, probe, column, take)
                truth = b + (b - a) / ((h1 / h2) ** 2 - 1)
                spread = abs(b / truth - 1)
            for level, plan, done, seconds in levels:
                promise = plan["scene"]["chosen"]["promised"]
                error = abs(value(done, probe, column, take) / truth - 1) if done and truth else None
                table.append({
                    "seed": options.seed, "scene": number, "family": family, "level": level,
                    "quantity": f"{probe}.{column} {take}",
                    "promise": promise, "error": error, "spread of the reference": spread,
                    "cells": plan["scene"]["grid"]["cells"], "processor time [s]": seconds,
                    "outcome": "finished" if done else "failed",
                })
        with open(os.path.join(options.output, "scenes.csv"), "w", newline="") as file:
            writer = csv.DictWriter(file, table[0].keys() if table else ["scene"])
            writer.writeheader()
            writer.writerows(table)
        print(number, family, [(r["level"], r["quantity"], r["promise"], r["error"]) for r in table if r["scene"] == number], flush=True)
    judged = [r for r in table if r["promise"] and r["error"] is not None and (r["spread of the reference"] or 1) < 0.04]
    kept = [r for r in judged if r["error"] <= r["promise"]]
    worst = max(((r["error"] / r["promise"]) for r in judged), default=0)
    print(f"{len(judged)} promises, {len(kept)} kept; worst {worst:.2f} times the promise; "
          f"{sum(r['promise'] is None for r in table)} of {len(table)} without a promise")


if __name__ == "__main__":
    main()
