"""The rows of unused.csv; started by unused.sh."""

import json
import os
import re
import subprocess
import sys
from datetime import datetime, timezone

WORK, VERSION, MACHINE = sys.argv[1:4]
SOLVER, BENCH = os.environ["SOLVER"], os.environ["LBM_BENCH"]


def run(case, name, count=False):
    """The summary of a run, and its instructions where they are counted."""
    path, folder = f"{WORK}/{name}.json", f"{WORK}/{name}"
    with open(path, "w") as file:
        json.dump(case, file)
    command = [SOLVER, path, "--output", folder, "--overwrite", "--no-final-checkpoint", "--threads", "1"]
    instructions = counted(command) if count else None
    if not count:
        subprocess.run(command, check=True, capture_output=True)
    with open(f"{folder}/summary.json") as file:
        return json.load(file), instructions


def counted(command):
    """Instructions of a command."""
    valgrind = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    said = subprocess.run(valgrind + command, check=True, capture_output=True, text=True).stderr
    return int(re.search(r"I\s+refs:\s+([\d,]+)", said).group(1).replace(",", ""))


def share(summary, phase):
    """The part of the steps that a phase takes."""
    means = {p["phase"]: p["mean"] for p in summary["phases"]}
    return means[phase] / sum(means.values())


def water(cells, steps, **more):
    """A cavity; `steps` of 0.8 - 1/2 = 3 nu dt/h2."""
    h = 1e-4
    fluid = {
        "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.8, "collision": {"bgk": {}},
        "boundaries": [{"name": "lid", "face": "y_max", "condition": {"moving_wall": {"velocity": [1e-3, 0]}}}],
    }
    fluid.update(more)
    return {
        "domain": {"size": [cells * h, cells * h], "spacing": h},
        "fluid": {"lattice_boltzmann": fluid},
        "time": {"end": steps * 1e-3},
        "checkpoint": {"every_wall_seconds": 0},
    }


def spheres(number, steps, spacing=0.01, more=None):
    """Spheres at rest on a lattice, from a file; with a block far above them where `more` says so."""
    sample = f"{WORK}/spheres{number}.csv"
    with open(sample, "w") as file:
        file.write("x,y,z,radius\n")
        for i in range(number):
            x, y, z = i % 50 + 1, i // 50 % 50 + 1, i // 2500 + 1
            file.write(f"{0.01 * x!r},{0.01 * y!r},{0.01 * z!r},0.005002\n")
    stiff = {"normal_stiffness": {"absolute": 1e4}}
    case = {
        "domain": {"size": [0.6, 0.6, 0.6], "spacing": spacing},
        "materials": {"sand": {"density": 2600}},
        "grains": {"material": "sand", "initial": {"file": {"path": sample}}},
        "contact": {"linear": stiff},
        "time": {"end": steps * 1e-5, "solid_time_step": 1e-5},
        "checkpoint": {"every_wall_seconds": 0},
    }
    if more == "block":
        case["contact"] = {"blocks": {"normal_stiffness": {"per_contact": 1e4}}}
        case["bodies"] = [{"name": "block", "shape": {"cuboid": {"edges": [0.02] * 3}}, "position": [0.55] * 3, "motion": {"fixed": {}}, "material": "sand"}]
    return case


ROWS = []


def row(scene, quantity, unit, value, beside, other, bar=""):
    """A line of the table: `value` beside `other`, their ratio, and what it may be."""
    ratio = value / other if other else float("nan")
    passed = "" if bar == "" else ("yes" if ratio <= bar else "no")
    ROWS.append(f'"{scene}","{quantity}",{unit},{value:.6g},"{beside}",{other:.6g},{ratio:.4f},{"" if bar == "" else f"<={bar}"},{passed}')


def peak(case, name):
    """Peak memory of a run."""
    return run(case, name)[0]["peak_rss_bytes"]


def work():
    """Instructions of a step."""
    n, few, many = 256, 20, 60
    updates = n * n * (many - few)
    program = [run(water(n, steps), f"water{steps}", count=True)[1] for steps in (few, many)]
    ours = (program[1] - program[0]) / updates
    if BENCH:
        # The bench takes its steps three times.
        kernel = [counted([BENCH, str(n), str(steps), "D2Q9 BGK f64"]) for steps in (few, many)]
        bare = (kernel[1] - kernel[0]) / updates / 3
        row("water alone, 256 x 256, BGK", "instructions of a lattice update, whole program", "1", ours, "bare kernel (benches/lbm.rs)", bare, 1.02)
    # A body that never moves: the map is made once, and steps do not touch it.
    fixed = water(n, many)
    fixed["materials"] = {"steel": {}}
    fixed["bodies"] = [{"name": "cylinder", "shape": {"disc": {"radius": 2e-3}}, "position": [0.0128, 0.0128], "motion": {"fixed": {}}, "material": "steel"}]
    fixed["coupling"] = {"bounce_back": {}}
    summary, many_steps = run(fixed, "fixed", count=True)
    fixed["time"]["end"] = few * 1e-3
    few_steps = run(fixed, "fixed_few", count=True)[1]
    links = (many_steps - few_steps) / updates
    row("a fixed cylinder of 40 cells", "instructions of a lattice update", "1", links, "water alone", ours)
    fixed["time"]["end"] = 2.0
    row("a fixed cylinder of 40 cells", "share of mapping in the steps", "1", share(run(fixed, "fixed_long")[0], "mapping"), "all of it", 1, 0.01)
    long = run(water(1024, 500), "long")[0]
    row("water alone, 1024 x 1024, BGK", "share of all but the lattice in the steps, guards included", "1", 1 - share(long, "fluid"), "all of it", 1, 0.02)
    row("water alone, 1024 x 1024, BGK", "share of grains and mapping in the steps", "1", share(long, "grains") + share(long, "mapping"), "all of it", 1, 0.001)


def memory():
    """Bytes of a cell and of a grain."""
    cells = 1024**2 - 256**2
    def of(name, **more):
        return (peak(water(1024, 4, **more), name + "large") - peak(water(256, 4, **more), name + "small")) / cells
    laminar = of("laminar")
    row("laminar water, D2Q9", "bytes of a cell", "B", laminar, "nine populations in f64", 72, 1.15)
    row("laminar water, D2Q9", "bytes of a cell", "B", laminar, "with an eddy viscosity", of("eddies", turbulence={"smagorinsky": {}}))
    row("dry spheres", "memory with cells of 3 mm (8e6 of them)", "B", peak(spheres(2000, 10, 0.003), "fine"), "with cells of 60 mm (1000)", peak(spheres(2000, 10, 0.06), "coarse"), 1.02)
    number = 40000 - 10000
    def grain(name, more=None):
        return (peak(spheres(40000, 20, more=more), name + "many") - peak(spheres(10000, 20, more=more), name + "few")) / number
    row("spheres alone", "bytes of a grain", "B", grain("alone"), "among blocks, with their attitudes and shapes", grain("among", "block"), 1.0)


def main():
    """Measures, and prints the table."""
    work()
    memory()
    when = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    print(f"# {VERSION}\n# date: {when}\n# machine: {MACHINE}\n# command: bash benches/unused.sh")
    print("scene,quantity,unit,value,beside,other,ratio,bar,pass")
    print("\n".join(ROWS))


main()
