#!/usr/bin/env python3
"""Errors that the plan promises for seepage: the measured rows, and random scenes that judge them.

    promises.py --solver SOLVER --output DIR --rows src/plan/scene/auto/measured_ground.csv
    promises.py --solver SOLVER --output DIR --table promises.csv --seed 303 --count 60
    promises.py --solver SOLVER --output DIR --table promises.csv --seed 304 --count 60 --levels draft normal reference
    promises.py --solver SOLVER --output DIR --rows src/plan/scene/auto/measured_graded.csv --kinds graded
    promises.py --table promises.csv --summary

`--rows` draws problems from the families of scenes.py and from those below, whose edges lie anywhere in a cell, with random numbers of
their own (`rows FAMILY/NUMBER`), and runs each on its grid and on coarser and finer ones. A row is an answer on a grid: kind of ground and
smallest number of cells across a length as the plan finds them, and the largest error on this grid and on finer ones. The true values are
those of scenes.py: exact, or extrapolated from 2 and 4 times finer cells. Rows whose reference is more uncertain than their error are left out.

A scene of a table is drawn by scenes.py (`soil SEED/NUMBER`), of which no row is made. With `--levels` the scene loses its grid, and the
program chooses the cells for each level. A line is an answer:

    kept          the error is at most the promised one
    open          it is at most the sum of the promised one and the uncertainty of the reference
    broken        it is larger
    no promise    the plan promises nothing for this answer
    not judged    the reference is more uncertain than half of the promise
    cost          the plan takes more cells than the limit of this script
    failed        the run or its reference failed
"""

import argparse
import csv
import json
import math
import os
import pathlib
import random
import shutil

import exact
import scenes
from scenes import FAMILIES, FINER, GRADED, KINDS, Ground, answer_of, between, depth_of, digits, layering, on_structure, one_line, probe, with_widths, zone

MOST_CELLS = 1.0e5


def loose(draw, left, right, most):
    """A ground whose base and wall lie anywhere in their cells."""
    ground = Ground(draw, left, right, layering(draw), most)
    shifts = [draw.uniform(-0.5, 0.5) * ground.h for _ in range(3)]
    if left == 0:
        shifts[0] = shifts[1]
    if right == 0:
        shifts[2] = shifts[1]
    ground.heel, ground.wall, ground.toe = (x + s for x, s in zip((ground.heel, ground.wall, ground.toe), shifts))
    return ground


def whole(strip):
    """The discharge through the whole ground."""
    return ("seepage.outflow", strip.discharge(), scenes.ENDS * strip.discharge())


def loose_pile(draw):
    """Returns a sheet pile anywhere in a cell."""
    ground = loose(draw, 0, 0, 40)
    cut = depth_of(draw, ground)
    strip = ground.exact(cut)
    point, at = ground.point(draw, 0.1, 1)
    return ground.case([zone(ground.k, ground.ratio)], cut, [point]), [whole(strip), ground.exit(strip), ground.head(strip, at)]


def loose_dam(draw):
    """Returns a flat base with edges anywhere in a cell, with a cut-off or none."""
    ground = loose(draw, 1.2, 1.2, 40)
    cut = depth_of(draw, ground) if draw.random() < 0.6 else 0
    strip = ground.exact(cut)
    point, at = ground.point(draw, -1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], cut, [point])
    return made, [whole(strip), ground.head(strip, at)]


def loose_layers(draw):
    """Returns a flat base with edges anywhere in a cell on layers or beds that dip. Reference: finer cells."""
    ground = loose(draw, 1, 1, 20)
    zones = [zone(ground.k)]
    if draw.random() < 0.4:
        zones = [zone(ground.k, draw.choice([2, 4, 9]), dip=draw.choice([-1, 1]) * draw.randrange(10, 80))]
    else:
        low = draw.uniform(0.1, 0.7) * ground.depth
        layer = {"from": digits(low), "to": digits(low + draw.uniform(0.1, 0.3) * ground.depth)}
        zones.append({**zone(digits(ground.k * between(draw, 0.02, 20))), "name": "layer", "region": {"layer": layer}})
    point, _ = ground.point(draw, -1, 1)
    return ground.case(zones, 0, [point]), [("seepage.outflow", 1), ("point: head, last", 1)]


def thin_base(draw):
    """Returns a short base on deep ground, with few cells across it, and a short cut-off or none."""
    ground = Ground(draw, 0.3, 0.3, layering(draw), 32)
    cut = digits(draw.uniform(0.03, 0.2) * ground.depth) if draw.random() < 0.5 else 0
    strip = ground.exact(cut)
    point, at = ground.point(draw, -1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], cut, [ground.under(), ground.uplift(), point])
    return made, [ground.flow(strip), *ground.loads(strip), ground.head(strip, at)]


def short_base(draw):
    """Returns a ground with a base as short as the stratum is deep or shorter, on cells that remain whole on coarser grids."""
    ground = Ground(draw, 0.5, 0.5, layering(draw), 24)
    high = draw.choice([12, 16, 18, 20, 24])
    ground.h = ground.depth / high
    # The discharge is least accurate where base and depth are the same number of cells.
    half = high // 2 if draw.random() < 0.4 else max(2, round(draw.uniform(0.15, 0.6) * high))
    ends = 12 * math.ceil(high * math.sqrt(ground.ratio) / 3)
    ground.left = ground.right = half
    ground.cells = [2 * (ends + half), high]
    ground.size = [ground.cells[0] * ground.h, ground.depth]
    ground.heel, ground.wall, ground.toe = (n * ground.h for n in (ends, ends + half, ends + 2 * half))
    return ground


def flat_dam(draw):
    """Returns a flat base without a cut-off, as short as its stratum is deep or shorter: discharge, uplift, moment, head at a point."""
    ground = short_base(draw)
    strip = ground.exact(0)
    point, at = ground.point(draw, -1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], 0, [ground.under(), ground.uplift(), point])
    return made, [ground.flow(strip), *ground.loads(strip), ground.head(strip, at)]


def loose_flat(draw):
    """Returns a flat base without a cut-off, as short as its stratum is deep or shorter, with edges anywhere in a cell."""
    ground = short_base(draw)
    ground.heel, ground.toe = (x + draw.uniform(-0.5, 0.5) * ground.h for x in (ground.heel, ground.toe))
    ground.wall = 0.5 * (ground.heel + ground.toe)
    strip = ground.exact(0)
    point, at = ground.point(draw, -1, 1)
    return ground.case([zone(ground.k, ground.ratio)], 0, [point]), [whole(strip), ground.head(strip, at)]


def structure(draw):
    """Returns a dam as a polygon, with a cut-off or none: uplift, thrust and moment on the structure."""
    ground = Ground(draw, 1.2, 1.2, layering(draw), 40)
    cut = depth_of(draw, ground) if draw.random() < 0.7 else 0
    return on_structure(ground, cut)


OWN = {"structure": structure, "loose pile": loose_pile, "loose dam": loose_dam, "loose layers": loose_layers, "thin base": thin_base, "flat dam": flat_dam, "loose flat": loose_flat}
ALL = {**FAMILIES, **OWN, **GRADED}
COUNTS = {
    "pile": 12, "dam": 14, "toe": 12, "bedding": 10, "layers": 14, "earth": 24, "capillary": 14, "drain": 10, "linear": 10, "suction": 8, "soak": 16,
    "drawdown": 8, "well": 6, "consolidation": 8, "loose pile": 8, "loose dam": 10, "loose layers": 8, "thin base": 8,
    "structure": 10, "flat dam": 20, "loose flat": 10,
}
GRADED_COUNTS = {"graded pile": 16, "graded dam": 18, "graded base": 14, "graded toe": 14, "graded structure": 14, "graded layers": 14}
BY_FINER = {**FINER, "loose layers": 1}


def with_front(case, answers, family):
    """The case with a line probe where a front moves into dry ground, whose position is an answer."""
    if family != "soak":
        return case, answers
    height = case["domain"]["size"][1]
    x = 0.5 * case["domain"]["size"][0]
    line = {"line": {"from": [x, 0.002 * height], "to": [x, 0.998 * height], "points": 500}}
    case["probes"].append(probe("profile", case["time"]["end"], line))
    return case, [*answers, ("profile: front, last", 1)]


def front(folder, case):
    """Highest point whose pressure head is half of that at the start."""
    start = case["fluid"]["darcy"]["unsaturated"]["transient"]["initial"]["pressure_head"]
    lines = [line for line in (folder / "probe_profile.csv").read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    last = [row for row in rows if row["time"] == rows[-1]["time"]]
    points = sorted((float(row["y"]), float(row["head"]) - float(row["y"])) for row in last)
    for (y1, low), (y2, high) in reversed(list(zip(points, points[1:]))):
        if low <= 0.5 * start <= high:
            return y1 + (0.5 * start - low) / (high - low) * (y2 - y1)
    raise ValueError("no front")


def value_of(folder, case, name):
    return front(folder, case) if name.startswith("profile: front") else answer_of(folder, name)


def resized(case, factor):
    """The case on cells of another size, with the same steps in time; none if its cells cannot be divided."""
    made = json.loads(json.dumps(case))
    grid = made["fluid"]["darcy"]["grid"]
    if "spacing" in grid:
        return with_widths(made, factor)
    narrow = grid["cells"][0] <= 4
    cells = [n if narrow and a == 0 else n * factor for a, n in enumerate(grid["cells"])]
    if any(n != round(n) for n in cells) or min(cells[0] if not narrow else 9, cells[1]) < 4:
        return None
    grid["cells"] = [round(n) for n in cells]
    return made


def plan(runner, path):
    """Choices of the plan, or none with the reason."""
    done, _ = runner.call("plan", path, "--json")
    try:
        scene = json.loads(done.stdout)["scene"]
        return scene["chosen"], scene["seepage"]["cells"], ""
    except (json.JSONDecodeError, KeyError, TypeError):
        return None, None, one_line(done.stderr or done.stdout)


def run(runner, case, folder, names):
    """Values of the answers of a case, or none with the reason."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    path = folder / "case.json"
    path.write_text(json.dumps(case, indent=1))
    done, _ = runner.call(path, "--output", folder / "run", "--overwrite", "--threads", "1", "--no-final-checkpoint")
    if done.returncode != 0:
        return None, one_line(done.stderr)
    try:
        return [value_of(folder / "run", case, name) for name in names], ""
    except (ValueError, KeyError) as error:
        return None, f"{type(error).__name__}: {error}"


def truths(runner, case, folder, answers, family):
    """True values and their uncertainties."""
    names = [name for name, *_ in answers]
    if family not in BY_FINER:
        return [(truth, more[0] if more else 0.0) for _, truth, *more in answers], ""
    found = []
    for factor in scenes.FINE:
        values, why = run(runner, scenes.finer(case, factor), folder / f"finer{factor}", names)
        if values is None:
            return None, why
        found.append(values)
    ratio = (scenes.FINE[1] / scenes.FINE[0]) ** BY_FINER[family] - 1
    return [(b + (b - a) / ratio, abs(b - a) / ratio) for a, b in zip(*found)], ""


def promised(chosen, name):
    """Entry of the plan for an answer."""
    short = name.removesuffix(", last")
    if short.startswith("seepage.patch_inflows"):
        short = "seepage.outflow"
    return next((a for a in chosen["answers"] if a["answer"] == short), None)


def measured(runner, options, family, number):
    """The rows of a problem."""
    draw = random.Random(f"rows {family}/{number}")
    case, answers = with_front(*ALL[family](draw), family)
    folder = pathlib.Path(options.output).resolve() / f"rows_{family.replace(' ', '_')}_{number:02}"
    names = [name for name, *_ in answers]
    true, why = truths(runner, case, folder, answers, family)
    if true is None:
        print(family, number, "reference:", why, flush=True)
        return []
    rows, largest = [], {}
    factors = [1, 0.5, 0.25] if family in BY_FINER else [2, 1, 0.5, 0.25]
    for factor in factors:
        other = resized(case, factor)
        if other is None or math.prod(other["fluid"]["darcy"]["grid"].get("cells", [1])) > MOST_CELLS:
            continue
        at = folder / f"cells{factor}"
        values, why = run(runner, other, at, names)
        if values is None:
            print(family, number, factor, why, flush=True)
            continue
        chosen, _, why = plan(runner, at / "case.json")
        if not chosen or not chosen["ground"]:
            print(family, number, factor, "no ground:", why or [r["text"] for r in chosen["reasons"]], flush=True)
            if family in GRADED:
                continue
            return []
        for name, value, (truth, uncertain) in zip(names, values, true):
            entry = promised(chosen, name)
            if entry is None:
                print(family, number, name, "is no answer of the plan", flush=True)
                continue
            scale = entry["scale"] or abs(truth)
            error = abs(value - truth) / scale
            if error <= 1e-9 or uncertain > abs(value - truth):
                continue
            largest[name] = max(error, largest.get(name, 0.0))
            cells = chosen["ground"]["lengths"][0]["cells"]
            if cells < 1.4 and "within cells" not in chosen["ground"]["kind"]:
                # A length of one cell is not resolved: such ground has no promise.
                continue
            widening = [f"{chosen['ground']['widening']:.3g}"] if family in GRADED else []
            rows.append([chosen["ground"]["kind"], entry["kind"], f"{family} {number}", f"{cells:.3g}", *widening, f"{largest[name]:.3g}"])
    if not options.keep:
        shutil.rmtree(folder)
    return rows


def make_rows(runner, options):
    """Writes the table of rows, sorted; problems that are already in the file OUTPUT/rows.csv are not run again."""
    path = pathlib.Path(options.output) / "rows.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    done = {}
    if path.exists():
        with open(path) as lines:
            for row in csv.reader(lines):
                done.setdefault(row[0], []).append(row[1:])
    graded = options.kinds == "graded"
    for family, count in (GRADED_COUNTS if graded else COUNTS).items():
        if options.families and family not in options.families:
            continue
        for number in range(count):
            if f"{family} {number}" in done:
                continue
            rows = measured(runner, options, family, number) or [[""] * 5]
            done[f"{family} {number}"] = rows
            with open(path, "a", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([[f"{family} {number}", *row] for row in rows])
            print(family, number, len(rows), flush=True)
    rows = [row for problem in done.values() for row in problem if row[0]]
    rows.sort(key=lambda row: (row[0], row[1], row[2], float(row[3])))
    with open(options.rows, "w", newline="") as file:
        file.write(f"ground,answer,problem,cells,{'widening,' if graded else ''}error\n")
        csv.writer(file, lineterminator="\n").writerows(rows)


FIELDS = ["seed", "scene", "family", "level", "ground", "answer", "kind", "outcome", "value", "reference", "of reference", "promised", "error", "error over promise", "shortest length [cells]", "cells", "reason", "solver"]


def judge(row, value, truth, uncertain, entry):
    """Fills a row with the errors and the outcome."""
    row["value"], row["reference"], row["of reference"] = f"{value:.8g}", f"{truth:.8g}", f"{uncertain:.3g}"
    if entry is None or entry["error"] is None:
        row["outcome"] = "no promise"
        return
    width = entry["error"] * (entry["scale"] or abs(truth))
    error = abs(value - truth)
    row.update(kind=entry["kind"], promised=f"{width:.4g}", error=f"{error:.4g}")
    row["error over promise"] = f"{error / width:.4g}"
    if uncertain > 0.5 * width:
        row["outcome"] = "not judged"
    elif error <= width:
        row["outcome"] = "kept"
    else:
        row["outcome"] = "open" if error <= width + uncertain else "broken"


def of_level(case, level):
    made = json.loads(json.dumps(case))
    del made["fluid"]["darcy"]["grid"], made["domain"]["spacing"]
    made["accuracy"] = level
    return made


def scene(runner, options, number):
    draw = random.Random(f"soil {options.seed}/{number}")
    families = options.families or list(KINDS[options.kinds])
    family = families[number % len(families)]
    case, answers = with_front(*ALL[family](draw), family)
    folder = pathlib.Path(options.output).resolve() / f"promise_{options.seed}_{number:03}"
    names = [name for name, *_ in answers]
    true, why = truths(runner, case, folder, answers, family)
    made = []
    for level in options.levels or [""]:
        own = of_level(case, level) if level else case
        at = folder / (level or "own")
        at.mkdir(parents=True, exist_ok=True)
        (at / "plan.json").write_text(json.dumps(own))
        chosen, cells, reason = plan(runner, at / "plan.json")
        start = {"seed": options.seed, "scene": number, "family": family, "level": level, "solver": runner.version, "reason": reason or why}
        if chosen and chosen["ground"]:
            start["ground"] = chosen["ground"]["kind"]
            start["shortest length [cells]"] = f"{chosen['ground']['lengths'][0]['cells']:.3g}"
            start["cells"] = math.prod(cells)
        elif chosen:
            start["reason"] = next((r["text"] for r in chosen["reasons"] if r["what"] == "accuracy"), "")
        outcome, values = "", None
        if chosen is None or true is None:
            outcome = "failed"
        elif math.prod(cells) > MOST_CELLS:
            outcome = "cost"
        else:
            values, reason = run(runner, own, at, names)
            outcome = "" if values is not None else "failed"
            start["reason"] = start["reason"] or reason
        for n, name in enumerate(names):
            row = {**start, "answer": name, "outcome": outcome}
            if not outcome:
                judge(row, values[n], *true[n], promised(chosen, name))
            made.append(row)
    if not options.keep:
        shutil.rmtree(folder)
    return made


def summary(path):
    """Prints the outcomes by seed, level and family, and every promise that was not kept."""
    with open(path) as lines:
        rows = list(csv.DictReader(lines))
    for seed in sorted({row["seed"] for row in rows}, key=int):
        of = [row for row in rows if row["seed"] == seed]
        print(f"\nSeed {seed}, solver {', '.join(sorted({row['solver'] for row in of}))}\n")
        print("| level | family | scenes | answers | judged | kept | open | broken | share kept | no promise | not judged | cost | failed | median error/promise | largest |")
        print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
        levels = [level for level in ("", "draft", "normal", "reference") if any(row["level"] == level for row in of)]
        for level in levels:
            for family in [*[f for f in KINDS["all"] if any(row["family"] == f for row in of)], "all"]:
                own = [row for row in of if family in (row["family"], "all") and row["level"] == level]
                count = {o: sum(row["outcome"] == o for row in own) for o in ("kept", "open", "broken", "no promise", "not judged", "cost", "failed")}
                judged = count["kept"] + count["open"] + count["broken"]
                ratios = sorted(float(row["error over promise"]) for row in own if row["outcome"] in ("kept", "open", "broken"))
                share = f"{100 * count['kept'] / judged:.1f} %" if judged else ""
                middle, largest = (f"{ratios[len(ratios) // 2]:.2f}", f"{ratios[-1]:.2f}") if ratios else ("", "")
                cells = [level or "own grid", family, len({row["scene"] for row in own}), len(own), judged, *[count[o] for o in ("kept", "open", "broken")],
                         share, *[count[o] for o in ("no promise", "not judged", "cost", "failed")], middle, largest]
                print("| " + " | ".join(map(str, cells)) + " |")
    print()
    for row in rows:
        if row["outcome"] in ("open", "broken", "failed"):
            print(row["seed"], row["scene"], row["level"], row["family"], row["ground"], row["answer"], row["outcome"], row["error over promise"], row["shortest length [cells]"], row["reason"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", default="solver")
    parser.add_argument("--output", default="promises")
    parser.add_argument("--rows", help="write the table of measured rows")
    parser.add_argument("--table")
    parser.add_argument("--seed", type=int, default=303)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--levels", nargs="+", choices=["draft", "normal", "reference"], default=[])
    parser.add_argument("--kinds", default="equal", choices=list(KINDS), help="families on equal or on graded cells")
    parser.add_argument("--families", nargs="+", choices=list(ALL))
    parser.add_argument("--keep", action="store_true", help="keep the folders of the runs")
    parser.add_argument("--summary", action="store_true", help="no runs: print the table by family")
    options = parser.parse_args()
    if options.summary:
        summary(options.table)
        return
    exact.check()
    runner = scenes.Runner(shutil.which(options.solver) or options.solver)
    print(scenes.machine(), runner.version, flush=True)
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
    for number in range(options.first, options.first + options.count):
        if (options.seed, number) in done:
            continue
        rows = scene(runner, options, number)
        with open(options.table, "a", newline="") as file:
            csv.DictWriter(file, FIELDS, lineterminator="\n").writerows(rows)
        for row in rows:
            print(*[row.get(k, "") for k in ("scene", "level", "family", "answer", "outcome", "error over promise", "cells", "reason")], flush=True)


if __name__ == "__main__":
    main()
