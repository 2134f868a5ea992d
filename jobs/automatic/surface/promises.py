#!/usr/bin/env python3
"""Errors that the plan promises for water with a free surface: the measured rows, and random scenes that judge them.

    promises.py --solver SOLVER --output DIR --rows src/plan/scene/auto/measured_surface.csv
    promises.py --solver SOLVER --output DIR --table jobs/automatic/surface/promises.csv --seed 401 --count 60
    promises.py --table jobs/automatic/surface/promises.csv --summary

A scene is drawn from a family (its function describes it) on a base grid, and can be made on finer ones with the same water. `--rows` draws
problems with random numbers of their own (`rows FAMILY/NUMBER`) and runs each on its base grid and on 1.5 and 2 times finer cells; a scene
of a table is drawn with `surface SEED/NUMBER`, of which no row is made, on the base grid or on 1.5 times finer cells.

True values are those of theory for the standing wave (Lamb, Hydrodynamics, section 349, linear and viscous), the film (Nusselt) and the
sluice gate (contraction 0.605, quoted as 0.60 to 0.61); else they are extrapolated with first order from 2 and 3 times finer cells, and the
distance from the finest run is the uncertainty. A row contains the largest error on this grid and on finer ones. Rows whose reference is
more uncertain than their error are left out.

    kept          the error is at most the promised one
    open          it is at most the sum of the promised one and the uncertainty of the reference
    broken        it is larger
    no promise    the plan promises nothing for this answer
    not judged    the reference is more uncertain than half of the promise
    failed        the run or its reference failed
"""

import argparse
import cmath
import csv
import json
import math
import os
import pathlib
import random
import resource
import shutil
import subprocess

G = 9.81
FACTORS = [1.0, 1.5, 2.0]
LIMIT = [2.0, 3.0]


def between(draw, low, high):
    """A number whose logarithm is uniform."""
    return math.exp(draw.uniform(math.log(low), math.log(high)))


def digits(x):
    return float(f"{x:.7g}")


class Scene:
    """Water on a base grid: lengths in base cells, the time step for a lattice velocity of a speed."""

    def __init__(self, h, cells, nu, step, end, eddies=False):
        self.h, self.cells, self.nu, self.step, self.end, self.eddies = h, cells, nu, step, end, eddies
        self.gravity = [0, -G]
        self.water, self.boundaries, self.structures, self.probes = [], [], [], []
        self.periodic = []
        self.answers = []

    def slip(self, *faces):
        self.boundaries += [{"name": f"slip_{f}", "face": f, "condition": {"free_slip": {}}} for f in faces]

    def gauge(self, name, x, every):
        self.probes.append({"name": name, "every": every, "at": {"gauge": {"position": [x, 0]}}})

    def case(self, factor):
        """The case with cells and steps divided by a factor."""
        h = self.h / factor
        lattice = {"density": 1000, "kinematic_viscosity": self.nu, "time_step": self.step / factor, "surface": {"water": self.water}, "boundaries": self.boundaries}
        if self.eddies:
            lattice.update(collision={"bgk": {}}, turbulence={"smagorinsky": {}})
        domain = {"size": [n * self.h for n in self.cells], "spacing": h}
        if self.periodic:
            domain["periodic"] = self.periodic
        case = {"title": "Water with a free surface", "domain": domain, "gravity": self.gravity, "fluid": {"lattice_boltzmann": lattice}, "time": {"end": self.end}, "probes": self.probes}
        if self.structures:
            case["structures"] = self.structures
        return case


def even(x):
    return 2 * math.ceil(0.5 * x - 1e-9)


def box(x0, x1, y1):
    return {"shape": {"box": {"from": [x0, 0], "to": [x1, y1]}}}


# ---------------------------------------------------------------- values of a run

class Series:
    """Columns of a probe."""

    def __init__(self, folder, name):
        lines = [line for line in (folder / f"probe_{name}.csv").read_text().splitlines() if not line.startswith("#")]
        rows = list(csv.DictReader(lines))
        self.columns = {key: [] for key in rows[0]}
        for row in rows:
            try:
                numbers = {key: float(text) for key, text in row.items()}
            except (TypeError, ValueError):
                continue
            for key, number in numbers.items():
                self.columns[key].append(number)

    def __getitem__(self, key):
        return self.columns[key]


def crest(t, z):
    """Time and height of the largest value, by a parabola through three samples."""
    n = max(range(1, len(z) - 1), key=lambda n: z[n])
    a, b, c = z[n - 1 : n + 2]
    curve = a - 2 * b + c
    s = 0.5 * (a - c) / curve if curve < 0 else 0.0
    return t[n] + s * (t[n + 1] - t[n]), b - 0.25 * (a - c) * s


def crossing(t, z, level):
    """Time at which values first rise above a level."""
    for n in range(1, len(z)):
        if z[n - 1] < level <= z[n]:
            return t[n - 1] + (level - z[n - 1]) / (z[n] - z[n - 1]) * (t[n] - t[n - 1])
    raise ValueError("the water does not arrive")


def mean_after(t, z, start):
    late = [v for s, v in zip(t, z) if s > start]
    return sum(late) / len(late)


# ---------------------------------------------------------------- families

def lamb(k, d, nu, g=G):
    """Root of viscous linear waves over a floor without friction."""
    n = complex(-2 * nu * k * k, math.sqrt(g * k * math.tanh(k * d)))

    def f(n):
        m = cmath.sqrt(k * k + n / nu)
        # tanh of a large argument is 1.
        t = 1.0 if (m * d).real > 30 else cmath.tanh(m * d)
        return nu * nu * ((m * m + k * k) ** 2 - 4 * k**3 * m * math.tanh(k * d) / t) + g * k * math.tanh(k * d)

    for _ in range(60):
        step = 1e-6 * n
        n -= f(n) / ((f(n + step) - f(n - step)) / (2 * step))
    return n


def standing(draw):
    """A wave between its images, 12 to 20 base cells long: frequency and amplitude after a period."""
    length, cells = digits(between(draw, 0.04, 2)), draw.choice([12, 14, 16, 18, 20])
    h, k = length / cells, 2 * math.pi / length
    depth = digits(length * draw.uniform(0.12, 0.5))
    speed = math.sqrt(G / k * math.tanh(k * depth))
    amplitude = digits(min(draw.uniform(0.03, 0.12) / k, 0.1 * depth))
    nu = digits(speed * h / between(draw, 2, 25))
    step = draw.uniform(0.02, 0.05) * h / speed
    root = lamb(k, depth, nu)
    while math.exp(2 * math.pi * root.real / root.imag) < 0.6:
        nu = digits(0.8 * nu)
        root = lamb(k, depth, nu)
    period = 2 * math.pi / root.imag
    high = even((depth + 2 * amplitude) / h + 3)
    scene = Scene(h, [cells, high], nu, step, 6 * period)
    scene.periodic = ["x"]
    scene.slip("y_min")
    scene.water = [{"wave": {"level": depth, "amplitude": amplitude, "axis": "x"}}]
    scene.gauge("crest", 0.01 * h, period / 60)

    def value(folder):
        rows = Series(folder, "crest")
        t, z = rows["time"], [v - depth for v in rows["elevation"]]
        grown = [v * math.exp(-root.real * s) for s, v in zip(t, z)]
        zeros = []
        for n in range(1, len(z)):
            if t[n] > 0.6 * period and grown[n - 1] * grown[n] < 0:
                zeros.append(t[n - 1] + (t[n] - t[n - 1]) * grown[n - 1] / (grown[n - 1] - grown[n]))
        frequency = math.pi * (len(zeros) - 1) / (zeros[-1] - zeros[0])

        def square(a, b):
            own = [v * v for s, v in zip(t, grown) if a * period < s <= b * period]
            return sum(own) / len(own)

        faster = 0.25 * math.log(square(1, 3) / square(3, 5))
        return [frequency, math.exp(root.real * period - faster)]

    scene.value = value
    scene.answers = [("crest: frequency", root.imag, 1e-3 * root.imag), ("crest: amplitude after a period", math.exp(root.real * period), 1e-3)]
    # An amplitude is relative to the amplitude, not in m.
    scene.scales = {"crest: amplitude after a period": 1.0}
    return scene


def solitary(draw):
    """A solitary wave on water of 4 to 8 base cells that runs against a wall: crest at two gauges, run-up."""
    depth, cells = digits(between(draw, 0.05, 2)), draw.choice([4, 6, 8])
    h, e = depth / cells, draw.uniform(0.1, 0.4)
    height = digits(e * depth)
    c = math.sqrt(G * depth * (1 + e - e * e / 20 - 3 / 70 * e**3))
    nu = digits(c * h / between(draw, 3, 25))
    scene = Scene(h, [26 * cells, even((1 + 2.6 * e) * cells + 3)], nu, 0.05 * h / c, 24 * depth / c)
    scene.slip("y_min", "x_min", "x_max")
    scene.water = [{"solitary_wave": {"level": depth, "height": height, "axis": "x", "crest": 7 * depth}}]
    every = depth / c / 30
    scene.gauge("first", 12 * depth, every)
    scene.gauge("second", 17 * depth, every)
    scene.gauge("wall", 26 * depth - 0.01 * h, every)

    def value(folder):
        found = []
        for name, until in (("first", 9), ("second", 14), ("wall", 24)):
            rows = Series(folder, name)
            own = [(s, v - depth) for s, v in zip(rows["time"], rows["elevation"]) if s < until * depth / c]
            found += crest(*zip(*own))
        return found

    scene.value = value
    for name, what in (("first", "crest"), ("second", "crest"), ("wall", "run-up")):
        scene.answers += [(f"{name}: time of the {what}", None), (f"{name}: height of the {what}", None)]
    return scene


def film(draw):
    """A laminar film down a slope, 4 to 8 base cells deep, its surface anywhere in a cell: discharge of Nusselt."""
    cells = draw.choice([4, 5, 6, 8])
    h = between(draw, 1e-4, 1e-2)
    depth = (cells + draw.uniform(-0.45, 0.45)) * h
    nu = digits(between(draw, 1e-6, 1e-3))
    viscosity, slope = (between(draw, 0.52, 0.8) - 0.5) / 3, between(draw, 0.05, 0.6)
    # The weight of the film changes its density by 0.1 to 0.5 %.
    speed = min(0.05, between(draw, 0.001, 0.005) * cells * slope / (6 * viscosity))
    step = viscosity * h * h / nu
    pull = 2 * nu * (speed * h / step) / depth**2
    scene = Scene(h, [4, even(cells + 3)], nu, step, 5 * depth * depth / nu)
    scene.gravity = [pull, -pull / slope]
    scene.periodic = ["x"]
    scene.water = [{"level": depth}]
    scene.probes.append({"name": "section", "every": scene.end / 50, "at": {"plane": {"axis": "x", "position": h}}})
    scene.value = lambda folder: [Series(folder, "section")["discharge"][-1]]
    truth = pull * depth**3 / (3 * nu)
    scene.answers = [("section: discharge", truth, 1e-4 * truth)]
    return scene


def dam(draw, wet, eddies):
    """A column of 8 to 14 base cells that falls over a bed without friction: arrival at a dry gauge, depths at the end."""
    height, cells = digits(between(draw, 0.05, 3)), draw.choice([8, 10, 12, 14])
    h = height / cells
    width = digits(height * draw.uniform(0.8, 2))
    speed = math.sqrt(2 * G * height)
    nu = digits(speed * h / (between(draw, 50, 3000) if eddies else between(draw, 4, 25)))
    unit = math.sqrt(height / G)
    duration = draw.uniform(1.5, 3.0)
    long = even((width + 2 * duration * height) / h + 2)
    scene = Scene(h, [long, even(1.2 * cells + 2)], nu, 0.05 * h / speed, duration * unit, eddies)
    scene.slip("y_min", "x_min")
    scene.water = [box(0, width, height)]
    scene.scales = {}
    if wet:
        scene.water.append({"level": digits(height * draw.uniform(0.1, 0.45))})
    every = unit / 200
    scene.gauge("back", 0.01 * h, every)
    ahead = 0.55 * duration * height
    scene.gauge("ahead", width + ahead, every)

    def value(folder):
        ends = [mean_after(Series(folder, name)["time"], Series(folder, name)["depth"], scene.end - 0.1 * unit) for name in ("back", "ahead")]
        rows = Series(folder, "ahead")
        return ends if wet else [*ends, crossing(rows["time"], rows["depth"], 0.05 * height)]

    scene.value = value
    scene.answers = [("back: depth at the end", None), ("ahead: depth at the end", None)]
    if not wet:
        scene.answers.append(("ahead: time of arrival", None))
    return scene


def sluice(draw):
    """Free flow below a thin gate, 4 to 6 base cells open: discharge with a contraction of 0.605."""
    opening, cells = digits(between(draw, 0.02, 0.5)), draw.choice([4, 5, 6])
    h, ratio = opening / cells, draw.uniform(3, 5)
    level = digits(ratio * opening)
    speed = math.sqrt(2 * G * (level - opening))
    nu = digits(speed * h / between(draw, 20, 200))
    gate = 7 * opening
    end = 45 * math.sqrt(opening / G)
    scene = Scene(h, [even(12 * cells), even((ratio + 0.5) * cells + 2)], nu, 0.05 * h / speed, end, True)
    scene.slip("y_min")
    scene.boundaries += [
        {"name": "inlet", "face": "x_min", "condition": {"level": {"value": level}}},
        {"name": "outlet", "face": "x_max", "condition": {"outfall": {}}},
    ]
    scene.water = [box(0, gate, level)]
    thin = 0.3 * h
    scene.structures = [{"name": "gate", "shape": {"box": {"from": [gate - thin, opening], "to": [gate + thin, 20 * level]}}}]
    scene.probes.append({"name": "section", "every": end / 500, "at": {"plane": {"axis": "x", "position": 10 * opening}}})
    scene.value = lambda folder: [mean_after(Series(folder, "section")["time"], Series(folder, "section")["discharge"], 0.5 * end)]
    contracted, q = 0.605 * opening, 0.0
    for _ in range(30):
        q = contracted * math.sqrt(2 * G * (level + (q / level) ** 2 / (2 * G) - contracted))
    scene.answers = [("section: discharge", q, 0.008 * q)]
    return scene


FAMILIES = {
    "standing": standing,
    "solitary": solitary,
    "film": film,
    "dry dam": lambda draw: dam(draw, False, False),
    "dry dam with eddies": lambda draw: dam(draw, False, True),
    "wet dam": lambda draw: dam(draw, True, False),
    "wet dam with eddies": lambda draw: dam(draw, True, True),
    "sluice": sluice,
}
COUNTS = {"standing": 14, "solitary": 8, "film": 12, "dry dam": 10, "dry dam with eddies": 10, "wet dam": 10, "wet dam with eddies": 10, "sluice": 8}


# ---------------------------------------------------------------- runs

class Runner:
    """The program."""

    def __init__(self, solver):
        self.solver = solver
        self.version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip().split("(")[-1].strip(")")

    def call(self, *arguments):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([self.solver, *map(str, arguments)], capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return done, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def one_line(text):
    return " ".join(text.split())[:240]


def plan(runner, scene, factor, folder):
    """Choices of the plan, or none with the reason."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "case.json"
    path.write_text(json.dumps(scene.case(factor), indent=1))
    done, _ = runner.call("plan", path, "--json")
    try:
        return json.loads(done.stdout)["scene"]["chosen"], ""
    except (json.JSONDecodeError, KeyError, TypeError):
        return None, one_line(done.stderr or done.stdout)


def run(runner, scene, factor, folder):
    """Values of the answers on a grid, or none with the reason. The values of a case that was run in this folder are read."""
    folder.mkdir(parents=True, exist_ok=True)
    path, kept = folder / "case.json", folder / "values.json"
    text = json.dumps(scene.case(factor), indent=1)
    if kept.exists() and path.exists() and path.read_text() == text:
        return json.loads(kept.read_text()), ""
    path.write_text(text)
    done, _ = runner.call(path, "--output", folder / "run", "--overwrite", "--threads", "1", "--no-final-checkpoint")
    if done.returncode != 0:
        return None, one_line(done.stderr)
    try:
        values = scene.value(folder / "run")
        kept.write_text(json.dumps(values))
        shutil.rmtree(folder / "run")
        return values, ""
    except (ValueError, KeyError, ZeroDivisionError, IndexError) as error:
        return None, f"{type(error).__name__}: {error}"


def truths(runner, scene, folder):
    """True values and their uncertainties, and the values on the grids of the limit."""
    by_theory = all(len(answer) == 3 for answer in scene.answers)
    if by_theory:
        return [(truth, uncertain) for _, truth, uncertain in scene.answers], {}, ""
    found = {}
    for factor in LIMIT:
        found[factor], why = run(runner, scene, factor, folder / f"limit{factor}")
        if found[factor] is None:
            return None, {}, why
    ratio = LIMIT[1] / LIMIT[0] - 1
    pairs = zip(found[LIMIT[0]], found[LIMIT[1]])
    return [(b + (b - a) / ratio, abs(b - a) / ratio) for a, b in pairs], found, ""


def promised(chosen, name):
    return next((a for a in chosen["answers"] if a["answer"] == name), None)


def scale_of(scene, entry, name, truth):
    own = getattr(scene, "scales", {}).get(name)
    return own or entry["scale"] or abs(truth)


def measured(runner, options, family, number):
    """The rows of a problem."""
    scene = FAMILIES[family](random.Random(f"rows {family}/{number}"))
    folder = pathlib.Path(options.output).resolve() / f"rows_{family.replace(' ', '_')}_{number:02}"
    names = [name for name, *_ in scene.answers]
    true, known, why = truths(runner, scene, folder)
    if true is None:
        print(family, number, "reference:", why, flush=True)
        return []
    rows, largest = [], {}
    for factor in sorted(FACTORS, reverse=True):
        values = known.get(factor)
        if values is None:
            values, why = run(runner, scene, factor, folder / f"cells{factor}")
        if values is None:
            print(family, number, factor, why, flush=True)
            continue
        chosen, why = plan(runner, scene, factor, folder / f"plan{factor}")
        if not chosen or not chosen["water"]:
            print(family, number, factor, "no flow:", why or [r["text"] for r in chosen["reasons"]], flush=True)
            return []
        water = chosen["water"]
        for name, value, (truth, uncertain) in zip(names, values, true):
            entry = promised(chosen, name)
            if entry is None:
                print(family, number, name, "is no answer of the plan", flush=True)
                continue
            scale = scale_of(scene, entry, name, truth)
            error = abs(value - truth)
            if uncertain > error and name not in largest:
                continue
            largest[name] = max(error / scale, largest.get(name, 0.0))
            cells = water["lengths"][0]["cells"]
            rows.append([water["kind"], entry["kind"], f"{family} {number}", f"{cells:.4g}", f"{water['cell_reynolds']:.4g}", f"{water['shape']:.5g}", f"{largest[name]:.3g}"])
    if not options.keep:
        shutil.rmtree(folder)
    return rows


HEAD = "flow,answer,problem,cells,reynolds,shape,error\n"


def write_rows(path, rows):
    rows = sorted(rows, key=lambda row: (row[0], row[1], row[2], float(row[3])))
    with open(path, "w", newline="") as file:
        file.write(HEAD)
        csv.writer(file, lineterminator="\n").writerows(rows)


def make_rows(runner, options):
    """Writes the table of rows, sorted; problems that are already in the file OUTPUT/rows.csv are not run again."""
    path = pathlib.Path(options.output) / "rows.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    done = {}
    if path.exists():
        with open(path) as lines:
            for row in csv.reader(lines):
                done.setdefault(row[0], []).append(row[1:])
    for family, count in COUNTS.items():
        if family not in options.families:
            continue
        for number in range(count):
            if f"{family} {number}" in done:
                continue
            rows = measured(runner, options, family, number) or [[""] * 7]
            done[f"{family} {number}"] = rows
            with open(path, "a", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([[f"{family} {number}", *row] for row in rows])
            print(family, number, len(rows), flush=True)
    write_rows(options.rows, [row for problem in done.values() for row in problem if row[0]])


FIELDS = ["seed", "scene", "family", "flow", "answer", "kind", "outcome", "value", "reference", "of reference", "promised", "error", "error over promise", "shortest length [cells]", "cell Reynolds number", "shape", "reason", "solver"]


def judge(row, value, truth, uncertain, entry, scale):
    """Fills a row with the errors and the outcome."""
    row["value"], row["reference"], row["of reference"] = f"{value:.8g}", f"{truth:.8g}", f"{uncertain:.3g}"
    if entry is None or entry["error"] is None:
        row["outcome"] = "no promise"
        return
    width = entry["error"] * scale
    error = abs(value - truth)
    row.update(kind=entry["kind"], promised=f"{width:.4g}", error=f"{error:.4g}")
    row["error over promise"] = f"{error / width:.4g}"
    if uncertain > 0.5 * width:
        row["outcome"] = "not judged"
    elif error <= width:
        row["outcome"] = "kept"
    else:
        row["outcome"] = "open" if error <= width + uncertain else "broken"


def judged(runner, options, number):
    draw = random.Random(f"surface {options.seed}/{number}")
    family = list(FAMILIES)[number % len(FAMILIES)]
    scene = FAMILIES[family](draw)
    factor = draw.choice([1.0, 1.5])
    folder = pathlib.Path(options.output).resolve() / f"promise_{options.seed}_{number:03}"
    names = [name for name, *_ in scene.answers]
    chosen, reason = plan(runner, scene, factor, folder / "plan")
    start = {"seed": options.seed, "scene": number, "family": family, "solver": runner.version, "reason": reason}
    values = true = None
    if chosen:
        if chosen["water"]:
            water = chosen["water"]
            start["flow"] = water["kind"]
            start["shortest length [cells]"] = f"{water['lengths'][0]['cells']:.4g}"
            start["cell Reynolds number"], start["shape"] = f"{water['cell_reynolds']:.4g}", f"{water['shape']:.4g}"
        else:
            start["reason"] = next((r["text"] for r in chosen["reasons"] if r["what"] == "accuracy"), "")
        if all((promised(chosen, name) or {"error": None})["error"] is None for name in names):
            # Nothing to judge.
            start["reason"] = next((r["text"] for r in chosen["reasons"] if r["what"] == "accuracy"), "")
            return [{**start, "answer": name, "outcome": "no promise"} for name in names]
        true, _, start["reason"] = truths(runner, scene, folder)
        if true is not None:
            values, start["reason"] = run(runner, scene, factor, folder / "own")
    rows = []
    for n, name in enumerate(names):
        row = {**start, "answer": name}
        if values is None:
            row["outcome"] = "failed"
        else:
            entry = promised(chosen, name)
            scale = scale_of(scene, entry, name, true[n][0]) if entry else 1.0
            judge(row, values[n], *true[n], entry, scale)
        rows.append(row)
    if not options.keep:
        shutil.rmtree(folder)
    return rows


def summary(path):
    """Prints the outcomes by seed and family, and every promise that was not kept."""
    with open(path) as lines:
        rows = list(csv.DictReader(lines))
    for seed in sorted({row["seed"] for row in rows}, key=int):
        of = [row for row in rows if row["seed"] == seed]
        print(f"\nSeed {seed}, solver {', '.join(sorted({row['solver'] for row in of}))}\n")
        print("| family | scenes | answers | judged | kept | open | broken | share kept | no promise | not judged | failed | median error/promise | largest |")
        print("|---|---|---|---|---|---|---|---|---|---|---|---|---|")
        for family in [*[f for f in FAMILIES if any(row["family"] == f for row in of)], "all"]:
            own = [row for row in of if family in (row["family"], "all")]
            count = {o: sum(row["outcome"] == o for row in own) for o in ("kept", "open", "broken", "no promise", "not judged", "failed")}
            total = count["kept"] + count["open"] + count["broken"]
            ratios = sorted(float(row["error over promise"]) for row in own if row["outcome"] in ("kept", "open", "broken"))
            share = f"{100 * count['kept'] / total:.1f} %" if total else ""
            middle, largest = (f"{ratios[len(ratios) // 2]:.2f}", f"{ratios[-1]:.2f}") if ratios else ("", "")
            cells = [family, len({row["scene"] for row in own}), len(own), total, *[count[o] for o in ("kept", "open", "broken")], share,
                     *[count[o] for o in ("no promise", "not judged", "failed")], middle, largest]
            print("| " + " | ".join(map(str, cells)) + " |")
    print()
    for row in rows:
        if row["outcome"] in ("open", "broken", "failed"):
            print(row["seed"], row["scene"], row["family"], row["answer"], row["outcome"], row["error over promise"], row["shortest length [cells]"], row["reason"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", default="solver")
    parser.add_argument("--output", default="promises")
    parser.add_argument("--rows", help="write the table of measured rows")
    parser.add_argument("--table")
    parser.add_argument("--seed", type=int, default=401)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--step", type=int, default=1, help="judge every step-th scene")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--keep", action="store_true", help="keep the folders of the runs")
    parser.add_argument("--summary", action="store_true", help="no runs: print the table by family")
    options = parser.parse_args()
    if options.summary:
        summary(options.table)
        return
    runner = Runner(shutil.which(options.solver) or options.solver)
    print(runner.version, flush=True)
    if options.rows:
        make_rows(runner, options)
        return
    done = set()
    if os.path.exists(options.table):
        with open(options.table) as lines:
            done = {(int(row["seed"]), int(row["scene"])) for row in csv.DictReader(lines)}
    else:
        with open(options.table, "w", newline="") as file:
            csv.DictWriter(file, FIELDS, lineterminator="\n").writeheader()
    for number in range(options.first, options.first + options.count, options.step):
        if (options.seed, number) in done:
            continue
        rows = judged(runner, options, number)
        with open(options.table, "a", newline="") as file:
            csv.DictWriter(file, FIELDS, lineterminator="\n").writerows(rows)
        for row in rows:
            print(*[row.get(k, "") for k in ("scene", "family", "answer", "outcome", "error over promise", "reason")], flush=True)


if __name__ == "__main__":
    main()
