"""Named scenes: is a number within what the plan promises, or within what `solver estimate` states where the plan promises nothing?

    python3 scenes.py --solver SOLVER --output DIR --table results.csv [--scenes rods-0.6 wires ...] [--estimate normal]

The scenes are those on which an earlier promise failed: dense arrays of rods, an oscillating layer, a rod that turns beside a wall, sound between
openings, a slot, bars, a row of wires, vortices with modelled eddies, and beds of grains. Each is run at the three levels of accuracy. The reference is an
exact solution, or the Richardson extrapolation of two runs with 1.5 and 2.2 times the cells of the finest level that is not too costly. Where a level has no promise,
`solver estimate` runs the case at that level, and its interval is judged.
"""

import argparse
import cmath
import csv
import json
import math
import os
import subprocess
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "random"))
import scenes as drawn  # noqa: E402

LEVELS = drawn.LEVELS
# F/(mu U): Sangani and Acrivos 1982, table 1.
ARRAYS = {0.4: 217.89, 0.5: 532.55, 0.6: 1763, 0.7: 13520}


def rods(phi):
    radius = 1e-3 * math.sqrt(phi / math.pi)
    fluid = {**drawn.WATER, "body_force": {"constant": [0.1, 0]}}
    bodies = [drawn.disc("rod", [0.51e-3, 0.47e-3], radius)]
    exact = 0.1 * 1e-6 / (1e-3 * ARRAYS[phi]) * 1e-3
    return drawn.base([1e-3, 1e-3], ["x", "y"], fluid, bodies, 0.3, [drawn.plane([1e-3, 1e-3], 0.3)]), drawn.FLOW, exact


def plate():
    """A layer of 0.25 mm that oscillates on the walls of a channel of 10 mm, by an oscillating force: stress of the wall."""
    thickness = 0.25e-3
    omega = 2e-6 / thickness**2
    period = 2 * math.pi / omega
    fluid = {**drawn.WATER, "body_force": {"oscillating": {"amplitude": [0.1, 0], "period": period}}}
    probe = {"name": "wall", "every": period / 40, "at": {"wall": {"face": "y_min"}}}
    wave = (1 + 1j) / thickness
    stress = 1e-3 * abs(0.1 / (omega * 1000) * wave * cmath.tanh(wave * 5e-3))
    return drawn.base([1e-3, 1e-2], ["x"], fluid, [], 4 * period, [probe]), ("wall", "force_x", "amplitude"), stress * 1e-3


def turning():
    """Jeffery 1922: a rod that turns a tenth of its radius from a wall."""
    motion = {"driven": {"angular_velocity": 1}}
    bodies = [drawn.disc("rod", [0.00603, 0.0011], 0.001, motion)]
    case = drawn.base([0.012, 0.012], ["x"], drawn.OIL, bodies, 0.1, [drawn.body("rod", 0.1)])
    return case, ("rod", "fluid_torque_z", "last"), -4 * math.pi * 0.09 * 1e-6 * 1.1 / math.sqrt(1.1**2 - 1)


def openings():
    """A disc in a channel of 10 diameters, parabolic inlet and pressure outlet, after 1 s."""
    fluid = {
        **drawn.OIL,
        "boundaries": [
            {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"parabolic": {"peak": 0.02}}}}},
            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
        ],
    }
    bodies = [drawn.disc("disc", [0.02, 0.0102], 0.002)]
    return drawn.base([0.04, 0.02], [], fluid, bodies, 1.0, [drawn.body("disc", 0.02)]), ("disc", "fluid_force_x", "last"), None


def slot():
    """A rod of 2 mm in a slot of 2.2 mm."""
    fluid = {**drawn.OIL, "body_force": {"constant": [1000, 0]}}
    bodies = [drawn.disc("rod", [0.00221, 0.0011], 0.001)]
    return drawn.base([0.0044, 0.0022], ["x"], fluid, bodies, 0.006, [drawn.plane([0.0044, 0.0022], 0.006)]), drawn.FLOW, None


def bars():
    """Square bars 0.2 mm apart across the flow."""
    fluid = {**drawn.OIL, "body_force": {"constant": [1000, 0]}}
    case = drawn.base([0.003, 0.0012], ["x", "y"], fluid, [], 0.02, [drawn.plane([0.003, 0.0012], 0.02)])
    case["structures"] = [{"name": "bar", "shape": {"box": {"from": [0.001, 0.0001], "to": [0.002, 0.0011]}}, "material": "steel"}]
    return case, drawn.FLOW, None


def wires():
    """A row of wires between an inlet and an outlet: the force on one, as the water has to pass the gaps."""
    fluid = {
        **drawn.OIL,
        "boundaries": [
            {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": {"velocity": [0.005, 0]}}}}},
            {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}},
        ],
    }
    bodies = [drawn.disc(f"wire{n}", [0.002, 0.0006 + 0.0012 * n], 0.0005) for n in range(4)]
    case = drawn.base([0.006, 0.0048], ["y"], fluid, bodies, 0.04, [drawn.body("wire1", 0.002)])
    return case, ("wire1", "fluid_force_x", "last"), None


def vortices():
    """Taylor-Green vortices at a Reynolds number of 1600 with modelled eddies: only planned."""
    length = 2e-3 * math.pi
    fluid = {"density": 1000, "kinematic_viscosity": 1e-6, "turbulence": {"wale": {}},
             "initial": {"taylor_green": {"velocity": 1.6, "waves_along_z": 1}}}
    return drawn.base([length] * 3, ["x", "y", "z"], fluid, [], 0.005, []), None, None


def gravel():
    """Water pressed through a random-like bed of 2.5 mm grains: only planned; the law of resistance decides."""
    grains = [{"position": [0.00125 + 0.0025 * i, 0.00125 + 0.0025 * j, 0.00125 + 0.0025 * k], "radius": 0.00125}
              for i in range(6) for j in range(6) for k in range(6)]
    case = {
        "domain": {"size": [0.015, 0.015, 0.0175]}, "gravity": [0, 0, -9.81],
        "materials": {"rock": {"density": 2650}},
        "fluid": {"darcy": {"density": 1000, "viscosity": 0.001, "boundaries": [
            {"name": "top", "face": "z_max", "condition": {"head": {"value": 0.1175}}},
            {"name": "bottom", "face": "z_min", "condition": {"head": {"value": 0.0175}}}]}},
        "grains": {"material": "rock", "initial": {"list": grains}},
        "box_walls": ["x_min", "x_max", "y_min", "y_max", "z_min"], "box_wall_material": "rock",
        "time": {"end": 0.02},
    }
    return case, None, None


SCENES = {
    **{f"rods-{phi}": (lambda phi=phi: rods(phi)) for phi in ARRAYS},
    "plate": plate, "turning": turning, "openings": openings, "slot": slot, "bars": bars, "wires": wires, "vortices": vortices, "gravel": gravel,
}
FACTORS = [1.5, 2.2]
# Lattice updates of the two finer runs.
MOST = 3e10
FIELDS = ["scene", "level", "outcome", "promise", "error", "value", "reference", "uncertainty of the reference", "seconds", "cells", "reason"]


def estimated(runner, path, level, quantity, options):
    """Value and uncertainty of the quantity as `solver estimate` states them."""
    probe, column, _ = quantity
    folder = os.path.join(os.path.dirname(path), f"estimate_{level}")
    command = [runner.solver, "estimate", path, "--set", f'accuracy="{level}"', "--output", folder, "--cells-only", "--threads", "1"]
    if options.finer:
        command.append("--finer")
    done = subprocess.run(command, capture_output=True, text=True)
    with open(f"{folder}.txt", "w") as file:
        file.write(done.stdout + done.stderr)
    try:
        with open(os.path.join(folder, "1-case", "summary.json")) as file:
            answers = json.load(file)["estimate"]["answers"]
    except (OSError, KeyError, ValueError):
        return None
    return next((a for a in answers if a["answer"].startswith(f"{probe}: {column}")), None)


def scene(runner, options, name):
    case, quantity, exact = SCENES[name]()
    folder = os.path.join(options.output, name)
    os.makedirs(folder, exist_ok=True)
    path = os.path.join(folder, "case.json")
    with open(path, "w") as file:
        json.dump(case, file, indent=1)
    dimension = len(case["domain"]["size"])
    rows, plans, spread = [], {}, 0.0
    for level in LEVELS:
        plan, refusal = runner.plan(path, [f'accuracy="{level}"'])
        row = {"scene": name, "level": level}
        rows.append(row)
        if plan is None:
            row.update(outcome="refused", reason=drawn.one_line(refusal))
            continue
        chosen = plan["scene"]["chosen"]
        row["reason"] = drawn.one_line(next((r["text"] for r in chosen["reasons"] if r["what"] == "accuracy"), ""))
        row["cells"] = "x".join(str(n) for n in plan["scene"]["grid"]["cells"][:dimension])
        if chosen["promised"] is not None:
            row["promise"] = f"{chosen['promised']:.4g}"
        row["outcome"] = "planned"
        plans[level] = (plan, row)
    if quantity is None or not plans:
        return rows
    probe, column, take = quantity
    if exact is None:
        # From the finest level on that two finer runs can be paid for.
        work = lambda plan: math.prod(plan["scene"]["grid"]["cells"]) * plan["clock"]["steps"] * sum(f ** (dimension + 2) for f in FACTORS)
        finest = next((p for p, _ in reversed(plans.values()) if work(p) < MOST), list(plans.values())[0][0])
        h, dt = finest["scene"]["grid"]["spacing"], finest["scene"]["flow"]["time_step"]
        found = []
        for factor in FACTORS:
            spacing = drawn.whole(case["domain"]["size"], min(case["domain"]["size"]) / h * factor)
            sets = [f"domain.spacing={spacing!r}", f"fluid.lattice_boltzmann.time_step={dt * (spacing / h) ** 2!r}"]
            done, _ = runner.run(path, f"fine_{factor}", sets)
            found.append((spacing, drawn.values(done, probe, column, take)[0]) if done else None)
        if None in found:
            for _, row in plans.values():
                row["outcome"] = "the reference failed"
            return rows
        (h1, a), (h2, b) = found
        exact = b + (b - a) / ((h1 / h2) ** 2 - 1)
        spread = abs(b / exact - 1)
    for level, (plan, row) in plans.items():
        done, seconds = runner.run(path, level, [f'accuracy="{level}"'])
        row.update(reference=f"{exact:.6g}", seconds=f"{seconds:.2f}")
        row["uncertainty of the reference"] = f"{spread:.2g}"
        if not done:
            row["outcome"] = "failed"
            continue
        value = drawn.values(done, probe, column, take)[0]
        error = abs(value / exact - 1)
        row.update(value=f"{value:.6g}", error=f"{error:.4g}")
        if "promise" in row:
            row["outcome"] = "kept" if error <= float(row["promise"]) else "open" if error - spread <= float(row["promise"]) else "broken"
        else:
            row["outcome"] = "no promise"
            answer = estimated(runner, path, level, quantity, options)
            if answer is None:
                row["outcome"] = "no promise; no estimate possible"
            elif answer["uncertainty"] is not None:
                inside = abs(answer["value"] - exact) <= answer["uncertainty"] * (1 + 1e-9) + spread * abs(exact)
                row["outcome"] = f"no promise; estimated {answer['value']:.4g} +- {answer['uncertainty']:.2g}: {'inside' if inside else 'OUTSIDE'}"
            else:
                row["outcome"] = f"no promise; the estimate promises nothing: {answer['behaviour']}"
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", default="solver")
    parser.add_argument("--output", required=True)
    parser.add_argument("--table", required=True)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--finer", action="store_true", help="estimate with a finer grid")
    options = parser.parse_args()
    runner = drawn.Runner(options.solver, options.output)
    rows = []
    for name in options.scenes:
        rows += scene(runner, options, name)
        with open(options.table, "w", newline="") as file:
            writer = csv.DictWriter(file, FIELDS)
            writer.writeheader()
            writer.writerows(rows)
        for row in rows[-len(LEVELS):]:
            print(" ".join(str(row.get(k, "-")) for k in FIELDS[:5]), flush=True)


if __name__ == "__main__":
    main()
