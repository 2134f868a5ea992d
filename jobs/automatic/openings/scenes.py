"""Verdicts on random scenes with openings: does a case that is valid run, and does one that is called unstable fail?

    python3 scenes.py --solver SOLVER --output DIR --table results.csv --seed 50 --count 300 [--most-seconds 20]
    python3 scenes.py --table results.csv --summary

With `--moving` the scenes are bodies that are driven, settle or rise in fluid without openings, with `--suspended` many grains that do.

Each scene is drawn from a family by its number and the seed: ducts and channels from laminar to turbulent, sudden and ramped starts, long and narrow
passages, jets from patches, bodies at random places, wakes that reach the outlet, screens, structures, pressures at both ends, outflows, stated
time steps. Levels of accuracy and what the plan chooses are drawn as well. A case that the plan calls `unstable` is run all the same
(--allow-unstable). Scenes whose planned time is beyond `--most-seconds` of processor time are drawn again with a coarser level, then left out.

The table has a line for each scene: family, verdict, exit code, what the run said last, its time, the planned one, and the largest change of density.
Scenes that it holds are not made again. The summary counts, by families, scenes that were valid and failed, and scenes that were refused and ran.
"""

import argparse
import csv
import json
import math
import os
import random
import re
import subprocess
import time

WATER = {"density": 1000, "kinematic_viscosity": 1e-6}
OIL = {"density": 900, "kinematic_viscosity": 1e-4}
COLUMNS = ["seed", "scene", "family", "level", "verdict", "exit", "seconds", "planned", "compression", "said"]


def uniform_or_parabolic(draw, speed, dimension):
    if draw.random() < 0.5:
        return {"uniform": [speed] + [0] * (dimension - 1)}
    return {"parabolic": {"peak": speed * (1.5 if dimension == 2 else 2.25)}}


def inlet(draw, speed, dimension, passing, name="in", face="x_min", patch=None):
    velocity = {"profile": uniform_or_parabolic(draw, speed, dimension)}
    if draw.random() < 0.5:
        velocity["ramp_time"] = passing * draw.choice([0.05, 0.2, 0.5])
    found = {"name": name, "face": face, "condition": {"velocity": velocity}}
    if patch:
        found["patch"] = patch
    return found


def outlet(draw, face="x_max", patch=None):
    condition = draw.choice([{"pressure": {"value": 0}}] * 4 + [{"outflow": {}}, {"convective_outflow": {}}])
    found = {"name": "out", "face": face, "condition": condition}
    if patch:
        found["patch"] = patch
    return found


def case_of(draw, size, fluid, boundaries, end, **more):
    case = {
        "domain": {"size": size},
        "materials": {"steel": {"density": 7800}},
        "fluid": {"lattice_boltzmann": {**fluid, "boundaries": boundaries}},
        "time": {"end": end},
        "accuracy": draw.choice(["draft", "draft", "normal"]),
    }
    return {**case, **more}


def channel(draw):
    """Between plates, laminar, short to long."""
    height, re = 10 ** draw.uniform(-3.3, -1.5), 10 ** draw.uniform(-1, 2)
    fluid = draw.choice([WATER, OIL])
    speed = re * fluid["kinematic_viscosity"] / height
    length = height * draw.uniform(2, 12)
    passing = length / speed
    end = min(2 * passing, 4 * height**2 / fluid["kinematic_viscosity"] + passing)
    return case_of(draw, [length, height], fluid, [inlet(draw, speed, 2, passing), outlet(draw)], end)


def long_channel(draw):
    """Length of 20 to 80 heights: the loss of pressure and the time of filling."""
    height, re = 10 ** draw.uniform(-3, -2), 10 ** draw.uniform(-1, 1.3)
    speed = re * OIL["kinematic_viscosity"] / height
    length = height * draw.uniform(20, 80)
    end = 2 * height**2 / OIL["kinematic_viscosity"] * draw.uniform(1, 4)
    return case_of(draw, [length, height], OIL, [inlet(draw, speed, 2, end), outlet(draw)], end)


def transitional(draw):
    """Between plates at Reynolds numbers of 200 to 3000, in 2-D."""
    height, re = 10 ** draw.uniform(-2.3, -1), 10 ** draw.uniform(2.3, 3.5)
    speed = re * WATER["kinematic_viscosity"] / height
    length = height * draw.uniform(2, 5)
    passing = length / speed
    return case_of(draw, [length, height], WATER, [inlet(draw, speed, 2, passing), outlet(draw)], 2 * passing)


def duct(draw):
    """A rectangular duct, laminar."""
    height, re = 10 ** draw.uniform(-2.5, -1), 10 ** draw.uniform(-0.5, 2)
    speed = re * OIL["kinematic_viscosity"] / height
    size = [height * draw.uniform(2, 4), height * draw.uniform(1, 2), height]
    passing = size[0] / speed
    end = min(1.5 * passing, 2 * height**2 / OIL["kinematic_viscosity"] + 0.5 * passing)
    return case_of(draw, size, OIL, [inlet(draw, speed, 3, passing), outlet(draw)], end)


def turbulent(draw):
    """A rectangular duct at Reynolds numbers of 700 to 1e6."""
    height, re = 10 ** draw.uniform(-1.5, 0.3), 10 ** draw.uniform(2.85, 6)
    speed = re * WATER["kinematic_viscosity"] / height
    size = [height * draw.uniform(1.5, 2.5), height * draw.uniform(1, 1.5), height]
    passing = size[0] / speed
    entry = inlet(draw, speed, 3, passing)
    if draw.random() < 0.3:
        entry["condition"]["velocity"]["turbulence"] = {"intensity": draw.uniform(0.02, 0.15), "length_scale": 0.2 * height}
    return case_of(draw, size, WATER, [entry, outlet(draw)], draw.uniform(1, 2) * passing)


def jet(draw):
    """A jet from a patch into a box, out through another patch."""
    height, re = 10 ** draw.uniform(-2.3, -1.3), 10 ** draw.uniform(0, 2)
    width = height * draw.uniform(0.15, 0.4)
    speed = re * OIL["kinematic_viscosity"] / width
    size = [height * draw.uniform(1, 2.5), height]
    low = draw.uniform(0.1, 0.5) * height
    side = draw.uniform(0.2, 0.45) * height
    at = draw.uniform(0.1, 0.5) * height
    passing = size[0] / speed
    boundaries = [
        inlet(draw, speed, 2, passing, patch={"from": [0, low], "to": [0, low + width]}),
        outlet(draw, patch={"from": [size[0], at], "to": [size[0], at + side]}),
    ]
    return case_of(draw, size, OIL, boundaries, 4 * passing)


def body(draw, dimension):
    """A body in a stream at a random place, its wake into the outlet."""
    height, re = 10 ** draw.uniform(-2, -1), 10 ** draw.uniform(0.3, 2.3)
    radius = height * draw.uniform(0.05, 0.3)
    fluid = draw.choice([WATER, OIL])
    speed = re * fluid["kinematic_viscosity"] / (2 * radius)
    length = height * draw.uniform(1.5, 3)
    size = [length] + [height] * (dimension - 1)
    at = [draw.uniform(2 * radius, length - 1.5 * radius)]
    at += [draw.uniform(1.15 * radius, height - 1.15 * radius) for _ in range(dimension - 1)]
    shape = {"disc": {"radius": radius}} if dimension == 2 else {"sphere": {"radius": radius}}
    passing = length / speed
    end = min(3 * passing, 3 * height**2 / fluid["kinematic_viscosity"] + passing)
    bodies = [{"name": "b", "shape": shape, "position": at, "motion": {"fixed": {}}, "material": "steel"}]
    return case_of(draw, size, fluid, [inlet(draw, speed, dimension, passing), outlet(draw)], end, bodies=bodies)


def disc(draw):
    """A disc in a channel."""
    return body(draw, 2)


def sphere(draw):
    """A sphere in a duct."""
    return body(draw, 3)


def slit(draw):
    """Two discs that leave a narrow slit between them."""
    height = 10 ** draw.uniform(-2.3, -1.5)
    gap = height * 10 ** draw.uniform(-1.5, -0.5)
    radius = 0.25 * (height - gap) - 1e-6 * height
    length = height * draw.uniform(1.5, 2.5)
    speed = 10 ** draw.uniform(-0.5, 1) * OIL["kinematic_viscosity"] / height
    x = 0.5 * length
    middle = 0.5 * height
    places = [[x, middle - 0.5 * gap - radius], [x, middle + 0.5 * gap + radius]]
    bodies = [{"name": n, "shape": {"disc": {"radius": radius}}, "position": at, "motion": {"fixed": {}}, "material": "steel"} for n, at in zip("ab", places)]
    end = draw.uniform(1, 3) * height**2 / OIL["kinematic_viscosity"]
    return case_of(draw, [length, height], OIL, [inlet(draw, speed, 2, end), outlet(draw)], end, bodies=bodies)


def structures(draw):
    """Baffles from alternate walls."""
    height, re = 10 ** draw.uniform(-2.3, -1.3), 10 ** draw.uniform(-0.5, 1.5)
    speed = re * OIL["kinematic_viscosity"] / height
    length = height * draw.uniform(2, 3)
    open_part = draw.uniform(0.25, 0.6) * height
    thick = 0.1 * height
    boxes = [
        {"name": "a", "shape": {"box": {"from": [0.3 * length, -height], "to": [0.3 * length + thick, height - open_part]}}},
        {"name": "b", "shape": {"box": {"from": [0.6 * length, open_part], "to": [0.6 * length + thick, 2 * height]}}},
    ]
    end = min(2 * length / speed, 3 * height**2 / OIL["kinematic_viscosity"])
    return case_of(draw, [length, height], OIL, [inlet(draw, speed, 2, end), outlet(draw)], end, structures=boxes)


def pressures(draw):
    """Pressures at both ends of a channel."""
    height = 10 ** draw.uniform(-3, -2)
    length = height * draw.uniform(2, 8)
    re = 10 ** draw.uniform(-0.5, 1.7)
    speed = re * OIL["kinematic_viscosity"] / height
    drop = 12 * OIL["density"] * OIL["kinematic_viscosity"] * speed * length / height**2
    ends = [("in", "x_min", drop), ("out", "x_max", 0)]
    boundaries = [{"name": n, "face": f, "condition": {"pressure": {"value": p}}} for n, f, p in ends]
    return case_of(draw, [length, height], OIL, boundaries, 3 * height**2 / OIL["kinematic_viscosity"])


def stated(draw):
    """Spacing, time step and operator are stated: from sound to reckless."""
    dimension = draw.choice([2, 2, 3])
    cells = draw.randint(10, 40) if dimension == 2 else draw.randint(10, 20)
    lattice_velocity, cell_reynolds = 10 ** draw.uniform(-1.7, -0.6), 10 ** draw.uniform(-0.5, 2.5)
    height, speed = 1.0, 1.0
    spacing = height / cells
    length = spacing * round(cells * draw.uniform(1.5, 3))
    fluid = {"density": 1000, "kinematic_viscosity": speed * spacing / cell_reynolds, "time_step": lattice_velocity * spacing / speed}
    operators = [{"trt": {}}, {"bgk": {}}] if dimension == 2 else [{"trt": {}}, {"mrt": {}}, {"cumulant": {}}]
    operator = draw.choice(operators)
    fluid["collision"] = operator
    if dimension == 3:
        fluid["lattice"] = "d3q27"
        if draw.random() < 0.4:
            fluid["turbulence"] = draw.choice([{"wale": {}}, {"smagorinsky": {}}])
    passing = length / speed
    size = [length] + [height] * (dimension - 1)
    case = case_of(draw, size, fluid, [inlet(draw, speed, dimension, passing), outlet(draw)], 2.5 * passing)
    del case["accuracy"]
    case["domain"]["spacing"] = spacing
    if dimension == 2 and draw.random() < 0.5:
        at = [0.35 * length, draw.uniform(0.3, 0.7)]
        case["bodies"] = [{"name": "b", "shape": {"disc": {"radius": 0.15}}, "position": at, "motion": {"fixed": {}}, "material": "steel"}]
    return case


def moving(draw, dimension):
    """A disc or sphere in water at rest, the size of the box in its diameters, and a place in it."""
    diameter = 10 ** draw.uniform(-3, -1.5)
    size = [diameter * draw.uniform(3, 8) for _ in range(dimension)]
    size[-1] = diameter * draw.uniform(5, 10)
    at = [draw.uniform(0.7 * diameter, edge - 0.7 * diameter) for edge in size]
    shape = {"disc": {"radius": 0.5 * diameter}} if dimension == 2 else {"sphere": {"radius": 0.5 * diameter}}
    walled = draw.random() < 0.5
    return diameter, size, at, shape, [] if walled else ["x", "y", "z"][:dimension]


def driven(draw):
    """A body that is driven, level by level or with a stated grid, from a sudden start."""
    dimension = draw.choice([2, 2, 3])
    diameter, size, at, shape, periodic = moving(draw, dimension)
    fluid = dict(draw.choice([WATER, OIL]))
    speed = 10 ** draw.uniform(0, 2.7) * fluid["kinematic_viscosity"] / diameter
    at[-1] = 0.75 * size[-1]
    velocity = [0] * (dimension - 1) + [-speed]
    bodies = [{"name": "b", "shape": shape, "position": at, "motion": {"driven": {"velocity": velocity}}, "material": "steel"}]
    case = case_of(draw, size, fluid, [], draw.uniform(0.1, 0.5) * size[-1] / speed, bodies=bodies)
    case["domain"]["periodic"] = periodic
    grid_of(draw, case, diameter, speed)
    return case


def settling(draw):
    """A body that settles or rises."""
    dimension = draw.choice([2, 2, 3])
    diameter, size, at, shape, periodic = moving(draw, dimension)
    fluid = dict(draw.choice([WATER, OIL]))
    periodic = [axis for axis in periodic if axis != "xyz"[dimension - 1]]
    density = draw.choice([1100, 1500, 2650])
    speed = 10 ** draw.uniform(0, 2.5) * fluid["kinematic_viscosity"] / diameter
    lighter = density / fluid["density"] - 1
    case = case_of(draw, size, fluid, [], draw.uniform(1, 4) * size[-1] / speed)
    # Weight at which drag (Schiller and Naumann 1933) allows this speed.
    reynolds = speed * diameter / fluid["kinematic_viscosity"]
    drag = 24 / reynolds * (1 + 0.15 * reynolds**0.687)
    case["gravity"] = [0] * (dimension - 1) + [-0.75 * drag * speed**2 / (lighter * diameter)]
    at[-1] = 0.75 * size[-1]
    case["bodies"] = [{"name": "b", "shape": shape, "position": at, "motion": {"free": {}}, "material": "steel"}]
    case["materials"] = {"steel": {"density": density}}
    case["domain"]["periodic"] = periodic
    case["box_walls"] = [f"{'xyz'[axis]}_{end}" for axis in range(dimension) if "xyz"[axis] not in periodic for end in ("min", "max")]
    # The deepest overlap is about a hundredth of a diameter, also after a fall without drag.
    energy = max(speed**2, 2 * size[-1] * abs(lighter * case["gravity"][-1]))
    stiffness = 1e4 * density * diameter ** (dimension - 2) * energy
    case["contact"] = {"linear": {"normal_stiffness": {"absolute": stiffness}, "friction_angle_degrees": 20}}
    grid_of(draw, case, diameter, speed)
    return case


def grid_of(draw, case, diameter, speed):
    """States the grid, the time step and the coupling in half of the scenes."""
    if draw.random() < 0.5:
        return
    del case["accuracy"]
    fluid = case["fluid"]["lattice_boltzmann"]
    dimension = len(case["domain"]["size"])
    spacing = diameter / draw.uniform(6, 16)
    case["domain"]["spacing"] = spacing
    case["domain"]["size"] = [spacing * max(8, round(edge / spacing)) for edge in case["domain"]["size"]]
    fluid["time_step"] = 10 ** draw.uniform(-1.7, -0.6) * spacing / speed
    operators = [{"trt": {}}, {"bgk": {}}] if dimension == 2 else [{"trt": {}}, {"mrt": {}}, {"cumulant": {}}]
    fluid["collision"] = draw.choice(operators)
    if dimension == 3:
        fluid["lattice"] = "d3q27"
    case["coupling"] = draw.choice([{"bounce_back": {"scheme": "interpolated"}}, {"bounce_back": {"scheme": "half_way"}}, {"partially_saturated": {}}])


def suspension(draw):
    """Many grains that start to settle or rise at once in a closed box."""
    dimension = draw.choice([2, 2, 3])
    diameter = 10 ** draw.uniform(-3.3, -2)
    across = [draw.uniform(5, 14) for _ in range(dimension)] if dimension == 2 else [draw.uniform(3, 6) for _ in range(dimension)]
    across[-1] *= draw.uniform(1, 2)
    size = [diameter * edge for edge in across]
    fluid = dict(draw.choice([WATER, OIL]))
    density = draw.choice([700, 1200, 1500, 2650])
    speed = 10 ** draw.uniform(0, 2) * fluid["kinematic_viscosity"] / diameter
    share = draw.uniform(0.05, 0.35 if dimension == 2 else 0.25)
    volume = 0.785 if dimension == 2 else 0.524
    number = max(2, round(share * math.prod(across) / volume))
    places = []
    for _ in range(200 * number):
        at = [draw.uniform(0.55, edge - 0.55) for edge in across]
        if len(places) < number and all(math.dist(at, other) > 1.05 for other in places):
            places.append(at)
    case = case_of(draw, size, fluid, [], draw.uniform(0.3, 1) * size[-1] / speed)
    lighter = abs(density / fluid["density"] - 1)
    reynolds = speed * diameter / fluid["kinematic_viscosity"]
    drag = 24 / reynolds * (1 + 0.15 * reynolds**0.687)
    case["gravity"] = [0] * (dimension - 1) + [-0.75 * drag * speed**2 / (lighter * diameter)]
    case["materials"] = {"steel": {"density": density}}
    case["box_walls"] = [f"{'xyz'[axis]}_{end}" for axis in range(dimension) for end in ("min", "max")]
    energy = max(speed**2, 2 * size[-1] * lighter * abs(case["gravity"][-1]))
    stiffness = 1e4 * density * diameter ** (dimension - 2) * energy
    case["contact"] = {"linear": {"normal_stiffness": {"absolute": stiffness}, "friction_angle_degrees": 20}}
    grid_of(draw, case, diameter, speed)
    scale = [edge / old for edge, old in zip(case["domain"]["size"], size)]
    case["grains"] = {
        "material": "steel",
        "initial": {"list": [{"position": [x * diameter * s for x, s in zip(at, scale)], "radius": 0.5 * diameter} for at in places]},
    }
    return case


FAMILIES = [channel, long_channel, transitional, duct, turbulent, jet, disc, sphere, slit, structures, pressures, stated]
MOVING = [driven, settling]
SUSPENDED = [suspension]


def planned(options, path):
    done = subprocess.run([options.solver, "plan", path, "--json", "--threads", "1"], capture_output=True, text=True)
    try:
        said = json.loads(done.stdout)
    except ValueError:
        return done.returncode, None
    return done.returncode, (said.get("estimate") or {}).get("seconds_on_one_core")


def words_of(text):
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("warning")]
    told = [line for line in lines if line.startswith(("error", "unstable", "solver:"))]
    return re.sub(r"\s+", " ", (told or lines or [""])[-1])[:300]


def scene(options, number):
    families = MOVING if options.moving else SUSPENDED if options.suspended else FAMILIES
    family = families[number % len(families)]
    draw = random.Random(f"{options.seed}-{number}")
    case = family(draw)
    folder = os.path.join(options.output, f"{options.seed}-{number}")
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "case.json")
    row = {"seed": options.seed, "scene": number, "family": family.__name__, "level": case.get("accuracy", "stated")}
    with open(path, "w") as file:
        json.dump(case, file, indent=1)
    status, seconds = planned(options, path)
    if seconds is not None and seconds > options.most_seconds and case.get("accuracy") == "normal":
        case["accuracy"] = row["level"] = "draft"
        with open(path, "w") as file:
            json.dump(case, file, indent=1)
        status, seconds = planned(options, path)
    row["planned"] = "" if seconds is None else f"{seconds:.3g}"
    if seconds is not None and seconds > options.most_seconds:
        return {**row, "verdict": "left out"}
    words = [options.solver, "run", path, "--output", os.path.join(folder, "run"), "--overwrite", "--threads", "1", "--no-final-checkpoint"]
    row["verdict"] = "valid"
    begin = time.monotonic()
    limit = 20 * options.most_seconds
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=limit)
        if done.returncode == 3:
            row["said"] = words_of(done.stdout + done.stderr)
            done = subprocess.run([*words, "--allow-unstable"], capture_output=True, text=True, timeout=limit)
            row["verdict"] = "refused" if done.returncode == 3 else "unstable"
    except subprocess.TimeoutExpired:
        return {**row, "exit": "time", "seconds": f"{limit:.3g}"}
    row["exit"] = done.returncode
    row["seconds"] = f"{time.monotonic() - begin:.2g}"
    if row["verdict"] == "valid" and done.returncode:
        row["said"] = words_of(done.stdout + done.stderr)
    summary_path = os.path.join(folder, "run", "summary.json")
    if os.path.exists(summary_path):
        with open(summary_path) as file:
            row["compression"] = f"{json.load(file).get('compression') or 0:.2g}"
    subprocess.run(["rm", "-rf", os.path.join(folder, "run")], check=False)
    return row


def read(table):
    if not os.path.exists(table):
        return []
    with open(table, newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def summary(rows):
    print("| family | scenes | valid | of these failed | unstable | of these ran | refused | left out |")
    print("|---|---|---|---|---|---|---|---|")
    families = [family.__name__ for family in [*FAMILIES, *MOVING, *SUSPENDED]]
    for name in [*families, "all"]:
        if not any(name in ("all", row["family"]) for row in rows):
            continue
        mine = [row for row in rows if name in ("all", row["family"])]
        of = lambda verdict: [row for row in mine if row["verdict"] == verdict]
        failed = sum(row["exit"] not in ("0",) for row in of("valid"))
        ran = sum(row["exit"] == "0" for row in of("unstable"))
        numbers = [len(mine), len(of("valid")), failed, len(of("unstable")), ran, len(of("refused")), len(of("left out"))]
        print(f"| {name} | " + " | ".join(map(str, numbers)) + " |")


def main():
    words = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    words.add_argument("--solver")
    words.add_argument("--output", default="results/openings")
    words.add_argument("--table", required=True)
    words.add_argument("--seed", type=int, default=50)
    words.add_argument("--first", type=int, default=0)
    words.add_argument("--count", type=int, default=300)
    words.add_argument("--most-seconds", type=float, default=20)
    words.add_argument("--moving", action="store_true")
    words.add_argument("--suspended", action="store_true")
    words.add_argument("--summary", action="store_true")
    options = words.parse_args()
    rows = read(options.table)
    if options.summary:
        return summary(rows)
    done = {(row["seed"], row["scene"]) for row in rows}
    if not rows:
        version = subprocess.run([options.solver, "-V"], capture_output=True, text=True).stdout.split("\n")[0]
        with open(options.table, "w", newline="") as file:
            file.write(f"# {version}\n" + ",".join(COLUMNS) + "\n")
    for number in range(options.first, options.first + options.count):
        if (str(options.seed), str(number)) in done:
            continue
        row = scene(options, number)
        with open(options.table, "a", newline="") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n", restval="").writerow(row)
        print(*(row.get(column, "") for column in COLUMNS), flush=True)


main()
