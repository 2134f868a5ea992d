"""Random scenes: does a run keep the error that its plan promises?

    python3 scenes.py --solver SOLVER --output DIR --table results.csv --seed 7 --count 60 [--most-seconds 20]
    python3 scenes.py --table results.csv --summary results.svg

Each scene is drawn from a family by its number and the seed: shapes, gaps, walls, drives, steady or not. The case states no numerics but the level of
accuracy. Its quantities (flow, force, torque, amplitude, profile) are compared with the Richardson extrapolation (order 2, lower beside edges) of two runs of the same
scene with 1.1 and 1.6 times the cells of the finest level, and time steps that go as the square of the spacing: errors of cells, of compressibility
and of sound that has not settled all vanish with it. The uncertainty of the reference is the distance of the finer run from the extrapolation.

A promise is kept where error <= promise, broken where error - uncertainty > promise, and open between; it is not judged where the
uncertainty exceeds half the promise. Where the two runs would take more than `--most-seconds` of processor time, levels are left out from the finest
on, and stand in the table as not judged.

The table has a line for each scene, level and quantity, written as soon as the scene is done. Scenes that it holds are not made again.
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
    probes = [plane(size, 0.02), body("rod", 0.02)]
    return base(size, ["x"], fluid, bodies, 0.02, probes), [FLOW, ("rod", "fluid_force_x", "last")]


def turning(draw):
    """A rod that turns near a wall."""
    gap = draw.choice([0.06, 0.1, 0.2, 0.5, 1.0]) * draw.uniform(0.8, 1.2)
    size = [0.006, 0.005]
    motion = {"driven": {"angular_velocity": draw.choice([-1, 1]) * draw.uniform(0.5, 5)}}
    bodies = [disc("rod", [0.003 + draw.uniform(0, 2e-4), 0.001 * (1 + gap)], 0.001, motion)]
    return base(size, ["x"], OIL, bodies, 0.02, [body("rod", 0.02)]), [("rod", "fluid_torque_z", "last")]


def towed(draw):
    """A rod that is drawn along a channel; its force is a mean over the way of some cells, as that of each step swings."""
    # Lengths in common measure, as the cells must divide them.
    size = [0.01, 0.0005 * draw.randint(5, 15)]
    motion = {"driven": {"velocity": [draw.uniform(0.005, 0.05), 0]}}
    at = [0.004 + draw.uniform(0, 2e-4), 0.5 * size[1] * draw.uniform(0.95, 1.05)]
    bodies = [disc("rod", at, 0.001, motion)]
    return base(size, ["x"], OIL, bodies, 0.1, [body("rod", 5e-4)]), [("rod", "fluid_force_x", "late mean")]


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
    end = min(20 * height / speed, 0.2)
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
    at = [0.0051, 0.1 * size[1]], [0.0051, 0.9 * size[1]]
    probe = {"name": "line", "every": 0.5, "at": {"line": {"from": at[0], "to": at[1], "points": 9}}}
    return base(size, [], fluid, [], 0.5, [probe]), [("line", "velocity_x", "profile")]


def spheres(draw):
    """Cubic array of spheres, dilute to touching."""
    size = [1e-3] * 3
    radius = 1e-3 * draw.uniform(0.25, 0.49)
    shape = {"name": "s", "shape": {"sphere": {"radius": radius}}, "motion": {"fixed": {}}, "material": "steel"}
    at = [1e-3 * draw.uniform(0.45, 0.55) for _ in range(3)]
    fluid = {**WATER, "body_force": {"constant": [draw.uniform(0.05, 0.5), 0, 0]}}
    return base(size, ["x", "y", "z"], fluid, [{**shape, "position": at}], 0.2, [plane(size, 0.2)]), [FLOW]


def placed(draw):
    """A square array of discs under a force up to 60 degrees from x; a disc stands in the middle of the period, half a cell aside, or anywhere."""
    size = [1e-3, 1e-3]
    radius = 1e-3 * math.sqrt(draw.uniform(0.05, 0.6) / math.pi)
    middle = draw.choice([0.5, 0.25, None])
    at = [1e-3 * (middle if middle else draw.uniform(0.3, 0.7)) for _ in range(2)]
    angle = draw.uniform(0, math.pi / 3)
    fluid = {**WATER, "body_force": {"constant": [0.2 * math.cos(angle), 0.2 * math.sin(angle)]}}
    return base(size, ["x", "y"], fluid, [disc("d", at, radius)], 0.3, [plane(size, 0.3)]), [FLOW]


def polyhedra(draw):
    """A turned octahedron, cube, bar or slab close to its periodic images."""
    size = [1e-3] * 3
    at = [1e-3 * draw.uniform(0.45, 0.55) for _ in range(3)]
    kind = draw.choice(["octahedron", "cube", "bar", "slab"])
    turn = {"axis": [draw.uniform(-1, 1) for _ in range(3)], "angle_degrees": draw.uniform(0, 45)}
    if kind == "octahedron":
        r = 1e-3 * draw.uniform(0.3, 0.47)
        shape = {"vertices": [[s * r if a == axis else 0 for a in range(3)] for axis in range(3) for s in (1, -1)]}
    else:
        edges = {"cube": [0.5, 0.5, 0.5], "bar": [0.8, 0.35, 0.35], "slab": [0.3, 0.6, 0.6]}[kind]
        shape = {"cuboid": {"edges": [1e-3 * e * draw.uniform(0.8, 1.1) for e in edges]}}
    block = {"name": "b", "shape": shape, "position": at, "orientation": turn, "motion": {"fixed": {}}, "material": "steel"}
    fluid = {**WATER, "body_force": {"constant": [draw.uniform(0.05, 0.5), 0, 0]}}
    return base(size, ["x", "y", "z"], fluid, [block], 0.1, [plane(size, 0.1)]), [FLOW]


def tube(draw):
    """A sphere that nearly fills a square duct."""
    size = [2e-3, 1e-3, 1e-3]
    radius = 1e-3 * draw.uniform(0.33, 0.47)
    at = [1e-3] + [1e-3 * draw.uniform(0.03 + radius * 1e3, 0.97 - radius * 1e3) for _ in range(2)]
    ball = {"name": "s", "shape": {"sphere": {"radius": radius}}, "position": at, "motion": {"fixed": {}}, "material": "steel"}
    fluid = {**OIL, "body_force": {"constant": [draw.uniform(20, 400), 0, 0]}}
    return base(size, ["x"], fluid, [ball], 0.01, [plane(size, 0.01)]), [FLOW]


def structured(draw):
    """Baffles, an orifice or staggered boxes in a channel."""
    size = [2e-3, 1e-3]
    kind = draw.choice(["baffles", "orifice", "boxes"])
    x, thick = draw.uniform(0.3, 0.6), draw.uniform(0.08, 0.4)
    way = draw.uniform(0.15, 0.45)
    if kind == "baffles":
        list_ = [([x, -1], [x + thick, 1 - way]), ([x + 0.95, way], [x + 0.95 + thick, 2])]
    elif kind == "orifice":
        low = draw.uniform(0.1, 0.9 - way)
        list_ = [([x, -1], [x + thick, low]), ([x, low + way], [x + thick, 2])]
    else:
        side = draw.uniform(0.25, 0.5)
        list_ = [([x, 0.1], [x + side, 0.1 + side]), ([x + 0.9, 0.9 - side], [x + 0.9 + side, 0.9])]
    boxes = [
        {"name": f"s{n}", "shape": {"box": {"from": [1e-3 * v for v in low], "to": [1e-3 * v for v in high]}}}
        for n, (low, high) in enumerate(list_)
    ]
    fluid = {**OIL, "body_force": {"constant": [10 ** draw.uniform(1, 3.5), 0]}}
    case = base(size, ["x"], fluid, [], 0.015, [plane(size, 0.015)])
    return {**case, "structures": boxes}, [FLOW]


def wake(draw):
    """A disc between an inlet and an outlet."""
    size = [3e-3, 1e-3]
    radius = 1e-3 * draw.uniform(0.08, 0.25)
    at = [1e-3 * draw.uniform(0.7, 1.2), 1e-3 * draw.uniform(radius * 1e3 + 0.12, 0.88 - radius * 1e3)]
    peak = 1.5 * 10 ** draw.uniform(-0.5, 1.3) * OIL["kinematic_viscosity"] / (2 * radius)
    boundaries = [
        {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"parabolic": {"peak": peak}}, "ramp_time": 2e-3}}},
        {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
    ]
    fluid = {**OIL, "boundaries": boundaries}
    end = 0.02
    return base(size, [], fluid, [disc("d", at, radius)], end, [body("d", end)]), [("d", "fluid_force_x", "last")]


def opened(draw):
    """A channel between an inlet and an outlet: the pressure that it needs."""
    size = [draw.choice([3e-3, 4e-3, 5e-3]), 1e-3]
    peak = 10 ** draw.uniform(-1, 1) * OIL["kinematic_viscosity"] / size[1]
    boundaries = [
        {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"parabolic": {"peak": peak}}, "ramp_time": 2e-3}}},
        {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
    ]
    probe = {"name": "flow", "every": 0.02, "at": {"plane": {"axis": "x", "position": 0.2 * size[0]}}}
    return base(size, [], {**OIL, "boundaries": boundaries}, [], 0.02, [probe]), [("flow", "mean_pressure", "last")]


FAMILIES = {
    "array": array, "walled": walled, "slot": slot, "turning": turning, "towed": towed, "pulsed": pulsed,
    "channel": channel, "shear": shear, "cavity": cavity, "spheres": spheres,
    "placed": placed, "polyhedra": polyhedra, "tube": tube, "structured": structured, "wake": wake, "opened": opened,
}
# Order of the extrapolation: lower beside sharp edges.
ORDERS = {"polyhedra": 1.5, "structured": 1.3}
LEVELS = ["draft", "normal", "reference"]
FACTORS = [1.1, 1.6]
# Lattice updates a second of one core, for the choice of scenes that are not too costly.
RATE = {2: 75e6, 3: 24e6}
FIELDS = [
    "seed", "scene", "family", "level", "quantity", "outcome", "promise", "error", "uncertainty", "value", "reference", "cells", "steps",
    "seconds", "seconds of the reference", "reason",
]


def values(folder, probe, column, take):
    """The values of a quantity, and the scale of their errors: one value and itself, or a profile and its largest."""
    with open(os.path.join(folder, f"probe_{probe}.csv")) as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    times = [float(row["time"]) for row in rows]
    found = [float(row[column]) for row in rows]
    if take == "profile":
        return [v for t, v in zip(times, found) if t == times[-1]]
    if take == "last":
        return found[-1:]
    late = [v for t, v in zip(times, found) if t > (0.5 if take == "late mean" else 0.75) * times[-1]]
    if take.endswith("mean"):
        return [sum(late) / len(late)]
    return [0.5 * (max(late) - min(late))]


class Runner:
    def __init__(self, solver, folder):
        self.solver, self.folder = solver, folder

    def plan(self, path, sets):
        """The plan, or the reason of a refusal."""
        command = [self.solver, "plan", path, "--json"] + [x for s in sets for x in ("--set", s)]
        done = subprocess.run(command, capture_output=True, text=True)
        try:
            plan = json.loads(done.stdout)
        except json.JSONDecodeError:
            return None, done.stderr.strip() or done.stdout.strip()
        if "scene" not in plan:
            return None, done.stdout.strip()
        return plan, ""

    def run(self, path, name, sets):
        folder = os.path.join(os.path.dirname(path), name)
        summary = os.path.join(folder, "seconds")
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
            with open(summary, "w") as file:
                file.write(f"{seconds:.3f}")
        with open(summary) as file:
            return folder, float(file.read())


def one_line(text):
    return " ".join(text.split())[:300]


def scene(runner, options, number):
    """The rows of a scene."""
    draw = random.Random(f"{options.seed}/{number}")
    family = options.families[number % len(options.families)]
    case, quantities = FAMILIES[family](draw)
    folder = os.path.join(options.output, f"{options.seed}_{number:03}_{family}")
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "case.json")
    with open(path, "w") as file:
        json.dump(case, file, indent=1)
    dimension = len(case["domain"]["size"])
    start = {"seed": options.seed, "scene": number, "family": family}
    names = [f"{probe}.{column} {take}" for probe, column, take in quantities]
    rows, plans = [], {}

    def note(level, outcome, **more):
        for name in names:
            rows.append({**start, "level": level, "quantity": name, "outcome": outcome, **more})

    def work(plan):
        return math.prod(plan["scene"]["grid"]["cells"]) * plan["clock"]["steps"]

    for level in LEVELS:
        plan, refusal = runner.plan(path, [f'accuracy="{level}"'])
        if plan is None:
            note(level, "refused", reason=one_line(refusal))
            continue
        chosen = plan["scene"]["chosen"]
        reason = one_line(next((r["text"] for r in chosen["reasons"] if r["what"] == "accuracy"), ""))
        size = "x".join(str(n) for n in plan["scene"]["grid"]["cells"][:dimension])
        facts = {"cells": size, "steps": plan["clock"]["steps"], "reason": reason}
        if chosen["promised"] is None:
            note(level, "no promise", **facts)
            continue
        facts["promise"] = chosen["promised"]
        seconds = work(plan) * sum(f ** (dimension + 2) for f in FACTORS) / RATE[dimension]
        if seconds > options.most_seconds:
            note(level, "not judged: cost", **{**facts, "seconds of the reference": f"{seconds:.0f}"})
            continue
        plans[level] = (plan, facts)
    if not plans:
        return rows
    # The finest that is judged.
    finest = min(plans.values(), key=lambda p: p[0]["scene"]["grid"]["spacing"])[0]
    h, dt = finest["scene"]["grid"]["spacing"], finest["scene"]["flow"]["time_step"]
    shortest = min(case["domain"]["size"])
    fine, cost = [], 0.0
    for factor in FACTORS:
        spacing = whole(case["domain"]["size"], shortest / h * factor)
        step = dt * (spacing / h) ** 2
        sets = [f"domain.spacing={spacing!r}", f"fluid.lattice_boltzmann.time_step={step!r}"]
        done, seconds = runner.run(path, f"fine_{factor}", sets)
        fine.append((spacing, done))
        cost += seconds
    for level, (plan, facts) in plans.items():
        done, seconds = runner.run(path, level, [f'accuracy="{level}"'])
        facts = {**facts, "seconds": f"{seconds:.3f}", "seconds of the reference": f"{cost:.1f}"}
        for name, (probe, column, take) in zip(names, quantities):
            row = {**start, "level": level, "quantity": name, **facts}
            rows.append(row)
            if not done or not all(folder for _, folder in fine):
                row["outcome"] = "failed"
                continue
            (h1, f1), (h2, f2) = fine
            a, b = values(f1, probe, column, take), values(f2, probe, column, take)
            exact = [y + (y - x) / ((h1 / h2) ** ORDERS.get(family, 2) - 1) for x, y in zip(a, b)]
            scale = max(abs(x) for x in exact)
            found = values(done, probe, column, take)
            error = max(abs(v - x) for v, x in zip(found, exact)) / scale
            spread = max(abs(y - x) for y, x in zip(b, exact)) / scale
            row.update(error=f"{error:.5g}", uncertainty=f"{spread:.3g}")
            if take != "profile":
                row.update(value=f"{found[0]:.6g}", reference=f"{exact[0]:.6g}")
            row["outcome"] = verdict(error, spread, plan["scene"]["chosen"]["promised"])
    return rows


def whole(sizes, cells):
    """The spacing near this number of cells along the shortest edge at which every edge is a whole number of cells."""
    shortest = min(sizes)
    for n in sorted(range(max(1, int(0.9 * cells)), int(1.2 * cells) + 200), key=lambda n: abs(n - cells)):
        if all(abs(size * n / shortest - round(size * n / shortest)) < 1e-7 * n for size in sizes):
            return shortest / n
    return shortest / round(cells)


def verdict(error, spread, promise):
    if spread > 0.5 * promise:
        return "not judged: uncertain"
    if error <= promise:
        return "kept"
    return "broken" if error - spread > promise else "open"


def table_of(rows):
    """Family, level: scenes, with a promise, judged, kept, open, broken, not judged for cost, for the reference, worst error over promise."""
    keys = sorted({row["family"] for row in rows}, key=list(FAMILIES).index)
    lines = []
    for family, level in [(f, l) for f in keys for l in LEVELS] + [("all", l) for l in LEVELS]:
        of = [r for r in rows if r["level"] == level and family in (r["family"], "all")]
        scenes = {(r["seed"], r["scene"]) for r in of}
        promised = {(r["seed"], r["scene"]) for r in of if r["promise"]}
        count = {o: sum(r["outcome"] == o for r in of) for o in OUTCOMES}
        ratios = [float(r["error"]) / float(r["promise"]) for r in of if r["outcome"] in JUDGED]
        judged = sum(count[o] for o in JUDGED)
        worst = f"{max(ratios):.2f}" if ratios else ""
        lines.append([family, level, len(scenes), len(promised), judged, count["kept"], count["open"], count["broken"],
                      count["not judged: cost"], count["not judged: uncertain"], count["failed"], worst])
    return lines


JUDGED = ["kept", "open", "broken"]
OUTCOMES = JUDGED + ["not judged: cost", "not judged: uncertain", "no promise", "refused", "failed"]
COLOURS = {"draft": "#0072B2", "normal": "#D55E00", "reference": "#009E73"}


def picture(rows):
    """Error over promise by family and level, on a logarithmic axis, as SVG."""
    judged = [r for r in rows if r["outcome"] in JUDGED]
    families = [f for f in FAMILIES if any(r["family"] == f for r in rows)]
    left, top, width, height, lane = 70, 40, 90 * len(families), 380, 90
    low, high = 1e-3, 10.0

    def y(ratio):
        share = math.log(min(max(ratio, low), high) / low) / math.log(high / low)
        return top + height * (1 - share)

    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + width + 130}" height="{top + height + 60}" '
        'font-family="Helvetica, Arial, sans-serif" font-size="13" fill="#222222">',
        '<rect width="100%" height="100%" fill="white"/>',
        f'<text x="{left}" y="24" font-weight="bold">Error over promise of random scenes</text>',
    ]
    for power in range(-3, 2):
        at = y(10.0**power)
        out.append(f'<line x1="{left}" y1="{at:.1f}" x2="{left + width}" y2="{at:.1f}" stroke="#e4e4e4"/>')
        out.append(f'<text x="{left - 8}" y="{at + 4:.1f}" text-anchor="end">{10.0**power:g}</text>')
    out.append(f'<line x1="{left}" y1="{y(1):.1f}" x2="{left + width}" y2="{y(1):.1f}" stroke="#222222" stroke-width="1.5"/>')
    for n, family in enumerate(families):
        middle = left + lane * (n + 0.5)
        out.append(f'<text x="{middle}" y="{top + height + 22}" text-anchor="middle">{family}</text>')
        for m, level in enumerate(LEVELS):
            of = [r for r in judged if r["family"] == family and r["level"] == level]
            for k, row in enumerate(of):
                promise = float(row["promise"])
                ratio, spread = float(row["error"]) / promise, float(row["uncertainty"]) / promise
                x = middle + lane * (0.28 * (m - 1) + 0.2 * ((k + 0.5) / len(of) - 0.5))
                colour = COLOURS[level]
                ends = y(ratio + spread), y(max(ratio - spread, low))
                out.append(f'<line x1="{x:.1f}" y1="{ends[0]:.1f}" x2="{x:.1f}" y2="{ends[1]:.1f}" stroke="{colour}" stroke-opacity="0.3"/>')
                out.append(f'<circle cx="{x:.1f}" cy="{y(ratio):.1f}" r="3" fill="{colour}"/>')
    for m, level in enumerate(LEVELS):
        at = top + 20 + 20 * m
        out.append(f'<circle cx="{left + width + 20}" cy="{at - 4}" r="4" fill="{COLOURS[level]}"/>')
        out.append(f'<text x="{left + width + 32}" y="{at}">{level}</text>')
    out.append(f'<text x="20" y="{top + height / 2}" transform="rotate(-90 20 {top + height / 2})" text-anchor="middle">error / promise</text>')
    out.append("</svg>")
    return "\n".join(out) + "\n"


def summary(table, file):
    with open(table) as lines:
        rows = list(csv.DictReader(lines))
    with open(file, "w") as out:
        out.write(picture(rows))
    print("| family | level | scenes | with a promise | judged | kept | open | broken | not judged: cost | not judged: reference | failed | worst error/promise |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for line in table_of(rows):
        print("| " + " | ".join(str(x) for x in line) + " |")
    print()
    for row in rows:
        if row["outcome"] in ("open", "broken", "failed", "refused"):
            print(" ".join(f"{row[k]}" for k in FIELDS[:8]), row["uncertainty"], row["reason"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", default="solver")
    parser.add_argument("--output")
    parser.add_argument("--table", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--most-seconds", type=float, default=20)
    parser.add_argument("--families", nargs="+", default=list(FAMILIES))
    parser.add_argument("--summary", metavar="SVG", help="no runs: draw the table, and print it by family and level")
    options = parser.parse_args()
    if options.summary:
        summary(options.table, options.summary)
        return
    runner = Runner(os.path.abspath(options.solver) if os.path.sep in options.solver else options.solver, options.output)
    os.makedirs(options.output, exist_ok=True)
    made = set()
    if os.path.exists(options.table):
        with open(options.table) as lines:
            made = {(int(row["seed"]), int(row["scene"])) for row in csv.DictReader(lines)}
    else:
        with open(options.table, "w", newline="") as file:
            csv.DictWriter(file, FIELDS).writeheader()
    for number in range(options.first, options.first + options.count):
        if (options.seed, number) in made:
            continue
        rows = scene(runner, options, number)
        with open(options.table, "a", newline="") as file:
            csv.DictWriter(file, FIELDS).writerows(rows)
        for row in rows:
            print(number, row["family"], row["level"], row["quantity"], row["outcome"], row.get("promise"), row.get("error"),
                  row.get("uncertainty"), row.get("seconds"), row.get("seconds of the reference"), flush=True)


if __name__ == "__main__":
    main()
