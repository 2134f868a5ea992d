#!/usr/bin/env python3
"""Whether a bed of spheres lifts where the water bears it, with every default of the seepage: diameters, porosities, water and oil.

    python3 jobs/verification/lift-off/run.py SOLVER [WORK]

The packing of ../critical-gradient, and one deposited without friction, are scaled to each diameter; stiffnesses go with its square. A random bed has denser
and looser layers. It lifts from the level at which the difference of head to its surface first bears the buoyant weight of the grains above (Terzaghi's
block): the heads are those of the seepage through the bed at rest, the weight is that of the list of grains. In a uniform bed this is Terzaghi's gradient
(G_s - 1)(1 - n). Each bed is run at PARTS of the gradient at which this level is borne, for the time in which it rises by half a diameter at 3 % more than the flux. It
lifts where ten grains or more have risen by 0.1 diameters. A random bed has looser columns, too, which neighbours hold; these may boil before. The table goes to results.csv
beside this script; the status is 1 where a bed lifts at the least part or stays at the largest.
"""

import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
BASE = HERE.parent / "critical-gradient"
# Of the critical gradient.
PARTS = [0.9, 0.94, 0.97, 1.03]
# Layers of the seepage.
LEVELS = 5
# Mean diameter of the packing of the case [m].
DIAMETER = 5.5e-3
FLUIDS = {"water": (1000, 1e-3), "oil": (900, 0.09)}
# Diameters [m], fluids. Finer grains rise so slowly that a run takes a minute (0.1 mm in water) or hours (in oil).
BEDS = [(5e-4, "water"), (2e-3, "water"), (5e-3, "water"), (5e-3, "oil")]


def spheres(path):
    with path.open() as file:
        return [{k: float(v) for k, v in row.items() if k in ("x", "y", "z", "radius")} for row in csv.DictReader(line for line in file if not line.startswith("#"))]


def write(path, grains, factor):
    with path.open("w", newline="") as file:
        out = csv.writer(file)
        out.writerow(["x", "y", "z", "radius"])
        out.writerows([[repr(grain[k] * factor) for k in ("x", "y", "z", "radius")] for grain in grains])


def case_of(work, grains, diameter, fluid, gradient=0.0, end=1.0):
    factor = diameter / DIAMETER
    case = json.loads((BASE / "case.json").read_text())
    scaled = lambda values: [value * factor for value in values]
    density, viscosity = FLUIDS[fluid]
    top = max(grain["z"] + grain["radius"] for grain in grains) * factor
    edge, height = 0.04 * factor, 0.052 * factor
    darcy = case["fluid"]["darcy"]
    for name in ("resistance", "drag", "porosity_cap", "coupling_interval"):
        darcy.pop(name, None)
    darcy.update(density=density, viscosity=viscosity)
    darcy["grid"] = {"from": [0, 0, 0], "to": [edge, edge, height], "cells": [4, 4, LEVELS]}
    darcy["boundaries"][0]["condition"] = {"head": {"value": height * (1 + gradient)}}
    darcy["boundaries"][1]["condition"] = {"head": {"value": height}}
    case["domain"] = {"size": scaled([0.04, 0.04, 0.08]), "spacing": 0.01 * factor}
    sample = work / f"sample_{diameter:g}.csv"
    write(sample, grains, factor)
    case["grains"] = {"material": "sand", "initial": {"file": {"path": str(sample)}}}
    linear = case["contact"]["linear"]
    linear["normal_stiffness"] = {"absolute": 1e4 * factor**2}
    case["regions"] = [
        {"name": "lifted", "box": {"from": [0, 0, top + 0.1 * diameter], "to": scaled([0.04, 0.04, 0.08])}, "action": {"remove": {"when": "touches"}}}
    ]
    case["time"] = {"end": end, "solid_time_step_safety": 0.2}
    case["checkpoint"] = {"every_wall_seconds": 0}
    case["output"] = {}
    case["probes"] = [
        {"name": f"level{k}", "every": end, "at": {"section": {"axis": "z", "position": k * height / LEVELS}}} for k in range(1, LEVELS)
    ]
    return case


def last(path):
    with path.open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return {name.split(" ")[0]: float(value) for name, value in rows[-1].items() if value}


def borne(folder, grains, diameter, fluid, gradient):
    """The largest part of the buoyant weight above a level that the difference of head bears, and the height of that level."""
    factor, density = diameter / DIAMETER, FLUIDS[fluid][0]
    height, area = 0.052 * factor, (0.04 * factor) ** 2
    best = (0.0, 0.0)
    for k in range(LEVELS):
        z = k * height / LEVELS
        if k == 0:
            head = height * (1 + gradient)
        else:
            row = last(folder / "run" / f"probe_level{k}.csv")
            head = 0.5 * (row["head_before"] + row["head_behind"])
        weight = 0.0
        for grain in grains:
            r, at = grain["radius"] * factor, grain["z"] * factor
            cap = min(max(at + r - z, 0.0), 2 * r)
            weight += math.pi * cap * cap * (3 * r - cap) / 3 * (2650 - density)
        if weight > 0.1 * 0.5 * area * height * (2650 - density):
            best = max(best, (density * (head - height) * area / weight, z / height))
    return best


def run(solver, folder, case):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "case.json").write_text(json.dumps(case))
    words = [solver, str(folder / "case.json"), "--output", str(folder / "run"), "--threads", "1", "--allow-unstable"]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{folder}: {(done.stdout + done.stderr)[-600:]}")
    summary = json.loads((folder / "run" / "summary.json").read_text())
    removed = folder / "run" / "removed.csv"
    lifted = len(removed.read_text().splitlines()) - 1 if removed.exists() else 0
    return summary, lifted


def loose(solver, work):
    """A packing without friction, deposited in the same column and trimmed at 0.05 m."""
    case = json.loads((BASE / "case.json").read_text())
    case.pop("fluid")
    case["regions"] = []
    case["contact"]["linear"]["friction_angle_degrees"] = 0
    case["contact"]["linear"]["pairs"] = []
    case["domain"]["size"][2] = 0.4
    case["grains"] = {
        "material": "sand",
        "save": "sample.csv",
        "initial": {
            "deposition": {
                "number": 700,
                "grading": {"by_count": [{"min": 0.0025, "max": 0.003, "fraction": 1}]},
                "box": {"from": [0, 0, 0], "to": [0.04, 0.04, 0.4]},
                "seed": 1,
                "trim_above": 0.0515,
            }
        },
    }
    case["time"] = {"end": 1e-5}
    case["output"] = {}
    run(solver, work / "loose", case)
    return spheres(work / "loose" / "run" / "sample.csv")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    solver = sys.argv[1]
    work = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    packings = {"with friction": spheres(BASE / "sample.csv"), "without friction": loose(solver, work)}
    program = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    rows, wrong = [], 0
    for packing, grains in packings.items():
        for diameter, fluid in BEDS:
            density, viscosity = FLUIDS[fluid]
            folder = work / f"{packing}-{diameter:g}-{fluid}".replace(" ", "-")
            solid = sum(4 / 3 * math.pi * grain["radius"] ** 3 for grain in grains) / (0.04 * 0.04 * 0.052)
            porosity = 1 - solid
            terzaghi = (2650 / density - 1) * solid
            run(solver, folder / "still", case_of(work, grains, diameter, fluid, terzaghi, 1e-6))
            part, level = borne(folder / "still", grains, diameter, fluid, terzaghi)
            critical = terzaghi / part
            # Time in which the bed rises by a diameter at 3 % above the flux of Ergun's law, and at least that of a free fall of it.
            a = 1.75 * density * (1 - porosity) / (porosity**3 * diameter)
            b = 150 * viscosity * (1 - porosity) ** 2 / (porosity**3 * diameter**2)
            load = density * 9.81 * critical
            flux = ((b * b + 4 * a * load) ** 0.5 - b) / (2 * a)
            end = max(0.5 * diameter / (0.03 * flux), 0.05 * (diameter / DIAMETER) ** 0.5)
            line = {"packing": packing, "diameter [m]": diameter, "fluid": fluid, "porosity [1]": f"{porosity:.4f}", "Terzaghi [1]": f"{terzaghi:.4f}", "critical [1]": f"{critical:.4f}", "from the height [1]": f"{level:.1f}"}
            for part in PARTS:
                summary, lifted = run(solver, folder / f"at-{part}", case_of(work, grains, diameter, fluid, part * critical, end))
                line[f"lifted at {part}"] = lifted
                line["closure [1]"] = f"{max(float(line.get('closure [1]', 0)), summary['seepage']['largest_closure']):.2g}"
            lifts = [part for part in PARTS if line[f"lifted at {part}"] >= 10]
            stays = [part for part in PARTS if line[f"lifted at {part}"] < 10]
            line["stays at"], line["lifts at"] = max(stays, default=""), min(lifts, default="")
            wrong += PARTS[0] in lifts or PARTS[-1] in stays
            rows.append(line)
            print(line, flush=True)
    with (HERE / "results.csv").open("w", newline="") as file:
        file.write(f"# {program}, python3 jobs/verification/lift-off/run.py SOLVER; end of each run: half a diameter at 3 % above the flux of Ergun's law\n")
        out = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        out.writeheader()
        out.writerows(rows)
    sys.exit(wrong > 0)


main()
