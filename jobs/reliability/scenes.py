#!/usr/bin/env python3
"""Random scenes on random layouts of ranks and threads, and over a restart: the state must have the same bits.

    python3 jobs/reliability/scenes.py FAMILY [--seeds FIRST COUNT] [--solver FILE] [--csv FILE] [--keep FOLDER]

Families: `surface` (water with a surface in 2-D and 3-D, bodies, structures, openings), `joints` (water in the joints of blocks that move or stay) and
`soil` (unsaturated ground with seepage faces, rain, evaporation, drains, layers, tables in time). A scene is a function of its seed. It runs on one rank,
on two other layouts, and in two parts with another number of ranks in each. All runs must end with the same exit code: 0 with the same state and the same
tables, 3 (refused by name), or 4 (a named numerical failure). A run that takes longer than ten minutes hangs. The status is 1 where a scene is wrong; the table
has a row for each scene. Needs Python 3.9 and mpirun.
"""

import argparse
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
LIMIT = 600
"""A run that takes longer hangs [s]."""
ENVIRONMENT = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
AXES = "xyz"


def within(draw, low, high):
    """Returns a number between two bounds with three digits."""
    return float(f"{draw.uniform(low, high):.3g}")


def box(draw, size, cells, least=3):
    """Returns a random box inside the domain whose edges are at least some cells long."""
    low, high = [], []
    for length, count in zip(size, cells):
        a = draw.randrange(0, count - least)
        b = draw.randrange(a + least, count + 1)
        low.append(a * length / count)
        high.append(b * length / count)
    return {"from": low, "to": high}


def surface(draw):
    """Returns water with a surface: a level, boxes or a wave, in a tank with slip or without, with bodies and openings."""
    flat = draw.random() < 0.6
    cells = [draw.randrange(16, 57), draw.randrange(14, 41)] if flat else [draw.randrange(10, 25), draw.randrange(8, 17), draw.randrange(10, 21)]
    h = draw.choice([0.002, 0.005, 0.01])
    size = [n * h for n in cells]
    up = len(cells) - 1
    gravity = [0.0] * len(cells)
    gravity[up] = -9.81
    if draw.random() < 0.3:
        gravity[0] = within(draw, -2, 2)
    step = 0.05 * h / math.sqrt(9.81 * size[up])
    tau = draw.choice([0.503, 0.51, 0.55, 0.7, 1.0])
    lattice = {
        "density": 1000,
        "kinematic_viscosity": float(f"{(tau - 0.5) / 3 * h * h / step:.6g}"),
        "time_step": float(f"{step:.4g}"),
        "surface": {},
    }
    if not flat:
        lattice["lattice"] = draw.choice(["d3q19", "d3q27"])
    if draw.random() < 0.6:
        lattice["collision"] = draw.choice([{"bgk": {}}, {"trt": {}}, {"mrt": {}}, *([{"cumulant": {}}] if lattice.get("lattice") == "d3q27" else [])])
    if draw.random() < 0.3:
        lattice["turbulence"] = draw.choice([{"smagorinsky": {}}, *([] if flat else [{"wale": {}}])])
    water = []
    if draw.random() < 0.6:
        water.append({"level": within(draw, 0.2, 0.8) * size[up]})
    while not water or draw.random() < 0.4:
        water.append({"shape": {"box": box(draw, size, cells)}})
    if draw.random() < 0.15:
        level = within(draw, 0.3, 0.7) * size[up]
        water = [{"wave": {"level": level, "amplitude": within(draw, 0.02, 0.15) * level, "axis": "x", "waves": draw.choice([0.5, 1, 1.5])}}]
    lattice["surface"]["water"] = water
    case = {"domain": {"size": size, "spacing": h}, "gravity": gravity, "materials": {"stuff": {"density": draw.choice([300, 800, 1500, 2650])}}}
    if draw.random() < 0.25:
        case["domain"]["periodic"] = ["x"]
        gravity[0] = 0.0 if draw.random() < 0.5 else gravity[0]
    else:
        lattice["boundaries"] = []
        for face in ("x_min", "x_max"):
            kind = draw.random()
            name = {"name": face, "face": face}
            if kind < 0.3:
                lattice["boundaries"].append({**name, "condition": {"free_slip": {}}})
            elif kind < 0.4 and face == "x_min":
                lattice["boundaries"].append({**name, "condition": {"level": {"value": within(draw, 0.3, 0.8) * size[up]}}})
            elif kind < 0.5 and face == "x_min":
                lattice["boundaries"].append({**name, "condition": {"discharge": {"value": within(draw, 0.01, 0.1) * size[up] * (1 if flat else size[1])}}})
            elif kind < 0.6 and face == "x_max":
                lattice["boundaries"].append({**name, "condition": {"outfall": {}}})
        if draw.random() < 0.4:
            lattice["boundaries"].append({"name": "floor", "face": f"{AXES[up]}_min", "condition": {"free_slip": {}}})
    if draw.random() < 0.3:
        case["structures"] = [{"name": "step", "material": "stuff", "shape": {"box": {"from": [0.4 * size[0]] + [0.0] * up, "to": [0.6 * size[0], *size[1:up], 0.3 * size[up]]}}}]
    if draw.random() < 0.5:
        radius = 0.15 * min(size)
        place = [within(draw, 0.25, 0.75) * length for length in size]
        shape = {"disc": {"radius": radius}} if flat else {"sphere": {"radius": radius}}
        if not flat and draw.random() < 0.5:
            shape = {"cuboid": {"edges": [1.4 * radius, 1.2 * radius, radius]}}
        case["bodies"] = [{"name": "body", "shape": shape, "position": place, "motion": {"free": {}}, "material": "stuff"}]
        case["contact"] = {"blocks" if "cuboid" in shape else "linear": {"normal_stiffness": {"per_area": 1e7} if "cuboid" in shape else {"absolute": 1e5}, "friction_angle_degrees": 20, "normal_damping_ratio": 0.3}}
        case["coupling"] = {"partially_saturated": {}}
    case["fluid"] = {"lattice_boltzmann": lattice}
    case["probes"] = [{"name": "gauge", "every": 5 * step, "at": {"gauge": {"position": [0.5 * length for length in size[:up]] + [0.0]}}}]
    case["time"] = {"end": draw.randrange(60, 160) * lattice["time_step"]}
    return case


def joints(draw):
    """Returns blocks on fixed rock with water in their joints, driven by a pressure at the mouths."""
    edge = 0.2
    columns = [draw.randrange(1, 4), draw.randrange(1, 3)]
    high = draw.randrange(1, 3)
    gap = draw.choice([0.0, 0.0, 0.0005, 0.001])
    size = [0.2 + columns[0] * edge, 0.2 + columns[1] * edge, 0.1 + high * 0.1 + 0.2]
    rock = [size[0], size[1], 0.1 + high * 0.1]
    listed = []
    for i in range(columns[0]):
        for j in range(columns[1]):
            for k in range(high):
                position = [0.1 + (i + 0.5) * edge, 0.1 + (j + 0.5) * edge, 0.1 + (k + 0.5) * 0.1]
                listed.append({"shape": {"cuboid": {"edges": [edge - gap, edge - gap, 0.1 - gap]}}, "position": position})
    fixed = [
        {"from": [0, 0, 0], "to": [size[0], size[1], 0.1]},
        {"from": [0, 0, 0.1], "to": [0.1, size[1], rock[2]]},
        {"from": [size[0] - 0.1, 0, 0.1], "to": [size[0], size[1], rock[2]]},
        {"from": [0.1, 0, 0.1], "to": [size[0] - 0.1, 0.1, rock[2]]},
        {"from": [0.1, size[1] - 0.1, 0.1], "to": [size[0] - 0.1, size[1], rock[2]]},
    ]
    walls = [{"shape": {"cuboid": {"edges": [b - a for a, b in zip(one["from"], one["to"])]}}, "position": [0.5 * (a + b) for a, b in zip(one["from"], one["to"])]} for one in fixed]
    weight = (2650 - 1000) * 9.81 * 0.1 * high
    drive = draw.choice(["constant", "table", "harmonic"])
    peak = within(draw, 0.1, 2.5) * weight
    pressure = {"constant": {"constant": peak}, "table": {"table": [[0, 0], [0.02, peak], [0.04, within(draw, -0.2, 1) * peak]]}, "harmonic": {"harmonic": {"amplitude": peak, "frequency": within(draw, 5, 200)}}}[drive]
    water = {
        "density": 1000,
        "viscosity": 0.001,
        "time_step": draw.choice([5e-5, 9e-5]),
        "largest_aperture": 0.02,
        "residual_aperture": draw.choice([1e-5, 1e-4, 4e-4]),
        "cell": draw.choice([0.02, 0.03, 0.05]),
        "inertia": draw.random() < 0.5,
        "mouths": [{"name": "bed", "box": {"from": [0, 0, rock[2] - 0.01], "to": [size[0] * draw.choice([0.3, 1]), size[1], rock[2] + 0.01]}, "pressure": pressure}],
    }
    if draw.random() < 0.5:
        water["air_content"] = draw.choice([0, 0.001, 0.05, 0.2])
    if draw.random() < 0.3:
        water["roughness"] = 1e-4
    return {
        "domain": {"size": size, "spacing": 0.1},
        "gravity": [0, 0, -9.81],
        "materials": {"rock": {"density": 2650}},
        "blocks": {"material": "rock", "initial": {"list": listed + walls}, "fixed": fixed},
        "contact": {"blocks": {"normal_stiffness": {"per_area": draw.choice([2e7, 2e8])}, "friction_angle_degrees": draw.choice([15, 30, 45]), "normal_damping_ratio": 0.3}},
        "fluid": {"joints": water},
        "probes": [{"name": "block", "every": 0.001, "at": {"block": {"position": listed[0]["position"]}}}, {"name": "mouth", "every": 0.001, "at": {"mouth": {"name": "bed"}}}],
        "time": {"end": draw.choice([0.01, 0.02, 0.05])},
    }


def soil(draw):
    """Returns ground with a water table: steady or transient, layers, seepage faces, rain, evaporation, drains."""
    flat = draw.random() < 0.7
    cells = [draw.randrange(8, 41), draw.randrange(6, 25)] if flat else [draw.randrange(6, 13), draw.randrange(5, 9), draw.randrange(6, 13)]
    h = draw.choice([0.05, 0.1, 0.5])
    size = [n * h for n in cells]
    up = len(cells) - 1
    high = size[up]
    gravity = [0.0] * len(cells)
    gravity[up] = -9.81
    curves = [
        {"van_genuchten": {"alpha": within(draw, 0.5, 8), "n": within(draw, 1.3, 4), "saturated_content": 0.4, "residual_content": 0.05}},
        {"gardner": {"alpha": within(draw, 0.5, 5), "saturated_content": 0.4, "residual_content": 0.05}},
        {"saturated_only": {}},
    ]
    curve = draw.choice(curves[:2] if draw.random() < 0.7 else curves)
    unsaturated = {"retention": curve}
    transient = draw.random() < 0.6 and curve is not curves[2]
    if transient:
        unsaturated["transient"] = {"initial": draw.choice(["steady", {"head": within(draw, 0, 0.9) * high}, {"pressure_head": -within(draw, 0.1, 1) * high}])}
    zones = [{"name": "ground", "permeability": {"hydraulic_conductivity": float(f"{10 ** draw.uniform(-7, -3):.3g}")}}]
    if draw.random() < 0.5:
        low, top = sorted([within(draw, 0, 0.5) * high, within(draw, 0.5, 1) * high])
        layer = {"name": "layer", "region": {"box": {"from": [0.0] * up + [low], "to": [*size[:up], top]}}}
        layer["permeability"] = {"hydraulic_conductivity": float(f"{10 ** draw.uniform(-7, -3):.3g}")}
        if draw.random() < 0.4:
            layer["anisotropy"] = draw.choice([4, 9])
        zones.append(layer)
    boundaries = [{"name": "left", "face": "x_min", "condition": {"head": {"value": within(draw, 0.2, 1) * high}}}]
    if draw.random() < 0.4:
        boundaries[0]["condition"] = {"seepage_face": {"level": within(draw, 0, 0.9) * high}}
    if transient and draw.random() < 0.5:
        boundaries[0]["history"] = [[0, 1], [1800, within(draw, 0, 1)]]
    if draw.random() < 0.7:
        boundaries.append({"name": "right", "face": "x_max", "condition": {"seepage_face": {"level": within(draw, 0, 0.6) * high}} if draw.random() < 0.7 else {"head": {"value": within(draw, 0, 1) * high}}})
    top = draw.random()
    if top < 0.3:
        boundaries.append({"name": "rain", "face": f"{AXES[up]}_max", "condition": {"rain": {"rate": float(f"{10 ** draw.uniform(-8, -4):.3g}")}}})
    elif top < 0.45:
        boundaries.append({"name": "sun", "face": f"{AXES[up]}_max", "condition": {"evaporation": {"rate": float(f"{10 ** draw.uniform(-9, -7):.3g}"), "suction": within(draw, 1, 20)}}})
    darcy = {"density": 1000, "viscosity": 0.001, "zones": zones, "unsaturated": unsaturated, "boundaries": boundaries}
    if draw.random() < 0.3:
        middle = [0.5 * length for length in size]
        condition = draw.choice([{"seepage_face": {}}, {"head": {"value": within(draw, 0, 0.5) * high}}, {"discharge": {"value": -within(draw, 0, 1) * 1e-6}}])
        darcy["drains"] = [{"name": "drain", "box": {"from": [x - h for x in middle], "to": [x + h for x in middle]}, "condition": condition}]
    return {
        "domain": {"size": size, "spacing": h},
        "gravity": gravity,
        "materials": {"soil": {"density": 2650}},
        "fluid": {"darcy": darcy},
        "probes": [{"name": "table", "every": 600, "at": {"water_table": {}}}, *([{"name": "water", "every": 600, "at": {"water_balance": {}}}] if transient else [])],
        "time": {"end": 7200 if transient else 600, "solid_time_step": 60 if transient else 300},
    }


FAMILIES = {"surface": surface, "joints": joints, "soil": soil}


class Scene:
    """A case in a folder of its own, with the runs of it."""

    def __init__(self, solver, folder, case):
        self.solver, self.folder, self.case = solver, folder, case
        (folder / "case.json").write_text(json.dumps(case, indent=1))

    def start(self, ranks, command):
        """Returns the exit code of a command of the solver on some ranks, and its last words."""
        command = ["mpirun", "--oversubscribe", "-n", str(ranks), str(self.solver), *command]
        try:
            done = subprocess.run(command, cwd=self.folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=LIMIT)
        except subprocess.TimeoutExpired:
            return "hangs", ""
        words = [line for line in done.stderr.splitlines() if line.startswith(("error", "unstable", "solver", "numerical", "case.json:"))]
        return done.returncode, " | ".join(words)[:400] or done.stderr[-300:].replace("\n", " | ")

    def run(self, name, ranks, threads, settings):
        """Runs the case into a folder."""
        command = ["case.json", "--output", name, "--threads", str(threads)]
        for one in settings:
            command += ["--set", one]
        return self.start(ranks, command)

    def state(self, name):
        """Returns the hash of the last state of a run, and its tables."""
        folder = self.folder / name
        tables = {one.name: one.read_bytes() for one in sorted(folder.glob("probe_*.csv"))}
        return json.loads((folder / "summary.json").read_text())["state_hash"], tables


def judge(scene, draw):
    """Returns what came of a scene, and a remark."""
    first, words = scene.run("first", 1, 1, [])
    if first == 3:
        planned, _ = scene.start(1, ["validate", "case.json"])
        return ("refused" if words else "wrong: refused without a reason"), words if planned == 3 else words
    if first not in (0, 4):
        return f"wrong: exit {first}", words
    end = scene.case["time"]["end"]
    part = draw.uniform(0.2, 0.8) * end
    layouts = [(draw.randrange(2, 5), draw.randrange(1, 3)) for _ in range(2)]
    for number, (ranks, threads) in enumerate(layouts):
        axes = AXES[: len(scene.case["domain"]["size"])]
        # The state of rotated bodies in saturated cells may depend on the axis of the slabs, not on their number.
        other = "bodies" not in scene.case and "blocks" not in scene.case and draw.random() < 0.5
        settings = [f"domain.split={draw.choice(axes)}"] if other else []
        name = f"layout{number}"
        code, words = scene.run(name, ranks, threads, settings)
        if code != first:
            return f"wrong: exit {code} on {ranks} ranks x {threads} threads {settings}, {first} on one", words
        if first == 0 and scene.state(name) != scene.state("first"):
            return f"wrong: other bits on {ranks} ranks x {threads} threads {settings}", ""
    if first == 4:
        return "failed by name", words
    ranks, more = draw.randrange(1, 4), draw.randrange(1, 5)
    code, words = scene.run("parts", ranks, 1, [f"time.end={part:.9g}"])
    if code == 0:
        code, words = scene.start(more, ["restart", "parts", "--set", f"time.end={end!r}"])
    if code != 0:
        return f"wrong: exit {code} in two parts on {ranks} and {more} ranks", words
    if scene.state("parts")[0] != scene.state("first")[0]:
        return f"wrong: other bits in two parts on {ranks} and {more} ranks", ""
    return "same bits", ""


def main():
    """Runs the scenes of a family and writes the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("family", choices=FAMILIES)
    options.add_argument("--seeds", nargs=2, type=int, default=[0, 60], metavar=("FIRST", "COUNT"))
    options.add_argument("--solver", type=pathlib.Path, default=ROOT / "target/release/solver")
    options.add_argument("--csv", type=pathlib.Path)
    options.add_argument("--keep", type=pathlib.Path, help="folder for the scenes that are wrong")
    given = options.parse_args()
    solver = given.solver.resolve()
    version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    lines = [f"# {version}", "family,seed,result,remark"]
    counts = {}
    for seed in range(given.seeds[0], given.seeds[0] + given.seeds[1]):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            draw = random.Random(f"{given.family} {seed}")
            scene = Scene(solver, folder, FAMILIES[given.family](draw))
            result, remark = judge(scene, draw)
            if given.keep and result.startswith("wrong"):
                given.keep.mkdir(parents=True, exist_ok=True)
                (given.keep / f"{given.family}_{seed}.json").write_text((folder / "case.json").read_text())
        kind = result.split(":")[0]
        counts[kind] = counts.get(kind, 0) + 1
        remark = remark.replace('"', "'")
        lines.append(f'{given.family},{seed},"{result}","{remark}"')
        print(lines[-1], flush=True)
    print(counts)
    if given.csv:
        given.csv.write_text("\n".join(lines) + "\n")
    sys.exit(1 if "wrong" in counts else 0)


if __name__ == "__main__":
    main()
