#!/usr/bin/env python3
"""Compares two builds of the solver: instructions of a step, memory, and state.

    python3 benches/two_builds.py BEFORE AFTER [--rows P-1 P-3 ...] [--times N] [--table FILE]

BEFORE and AFTER are binaries of the solver. The rows have the physics of those of beside_peers.sh in small scenes. Work is counted in instructions
(valgrind), which other users of the machine do not change; each number is the difference of two runs that differ in their steps alone, so that start
and end do not count. A ratio is AFTER over BEFORE: above 1 it is slower or larger. The status is 1 where two builds do not reach the same state, or
where a ratio is above 1.02. With `--times N` the rows are timed instead, for a machine without other work: the seconds of the step loop in N
pairs of runs of at least three seconds, by turns, and the median of the ratios of the pairs with their range.
"""

import argparse
import json
import pathlib
import random
import re
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
BAR = 1.02
# Shortest loop of a timed run [s].
SHORTEST = 3.0
CAVITY = HERE / "cases/cavity.json"
CAVITY_3D = HERE / "cases/cavity_3d.json"
SMALL = "domain.size=[0.00256, 0.00256]"
SMALL_3D = "domain.size=[0.00048, 0.00048, 0.00048]"
EDDIES = ['fluid.lattice_boltzmann.turbulence={"wale": {}}', 'fluid.lattice_boltzmann.body_force={"constant": [10, 0, 0]}']

# Row: case, settings, two ends of the time [s].
ROWS = {
    "P-1 cavity, BGK": (CAVITY, [SMALL], (2e-4, 6e-4)),
    "P-2 piping": ("piping", [], (0.004, 0.008)),
    "P-3 MRT": (CAVITY_3D, [SMALL_3D, 'fluid.lattice_boltzmann.collision={"mrt": {"higher": 1}}'], (4e-5, 1.2e-4)),
    "P-3 MRT, rates of Suga": (CAVITY_3D, [SMALL_3D], (4e-5, 1.2e-4)),
    "P-4 MRT, WALE, force": (CAVITY_3D, [SMALL_3D, *EDDIES], (4e-5, 1.2e-4)),
    "P-5 MRT, f32 at rest": (CAVITY_3D, [SMALL_3D, "fluid.lattice_boltzmann.storage=f32"], (4e-5, 1.2e-4)),
    "P-6 spheres in saturated cells": (HERE / "cases/spheres_in_water.json", ["grains.initial.file.path=WET"], (1e-4, 3e-4)),
    "P-7, P-10 packed spheres": (HERE / "cases/spheres.json", ["grains.initial.file.path=BOX"], (2e-4, 6e-4)),
    "P-8 blocks": ("avalanche", [], (0.01, 0.02)),
    "P-9 seepage through grains": ("seepage", [], (0.002, 0.004)),
    "P-12 spheres that fall and collide": ("collision", [], (0.02, 0.04)),
}
# Row: case, settings of a small and of a large run; their difference is what cells and grains take.
MEMORY = {
    "P-13 memory of 4 million cells": (CAVITY, ["time.end=4e-5"], ["domain.size=[0.012, 0.012]"], []),
}


def samples(folder):
    """Writes the spheres of P-6 and P-7."""
    drawn = random.Random(1)
    with open(folder / "wet.csv", "w") as file:
        file.write("x,y,z,radius\n")
        for k in range(343):
            q = [((k // 7**a % 7 + 0.5) / 7) * 0.0128 + (drawn.random() - 0.5) * 2e-4 for a in range(3)]
            file.write("{:.9g},{:.9g},{:.9g},0.0008\n".format(*q))
    subprocess.run([sys.executable, HERE / "peers/states.py", "sample", "box_packed", folder / "box.csv"], check=True)
    return {"WET": str(folder / "wet.csv"), "BOX": str(folder / "box.csv")}


def run(solver, folder, files, case, settings, counted):
    """Returns the instructions (none if not `counted`) and the summary of a run."""
    if not isinstance(case, pathlib.Path):
        text = subprocess.run([solver, "example", case], check=True, capture_output=True, text=True).stdout
        case = folder / "case.json"
        case.write_text(text)
        settings = [*settings, "output={}", "probes=[]", "analysis={}"]
    command = [solver, case, "--threads", "1", "--output", folder / "run", "--overwrite", "--no-final-checkpoint"]
    for one in settings:
        for name, path in files.items():
            one = one.replace(f"={name}", f"={path}")
        command += ["--set", one]
    if counted:
        # Older builds execute themselves again: the run is the process with the most instructions.
        command = ["valgrind", "--trace-children=yes", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null", *command]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"two_builds: {case}: {done.stderr[-800:]}")
    found = re.findall(r"I\s+refs:\s+([\d,]+)", done.stderr)
    instructions = max((int(one.replace(",", "")) for one in found), default=None)
    return instructions, json.loads((folder / "run/summary.json").read_text())


def work(solver, folder, files, row):
    """Returns the instructions of a step and the last state."""
    case, settings, ends = ROWS[row]
    few, many = (run(solver, folder, files, case, [*settings, f"time.end={end}"], True) for end in ends)
    return (many[0] - few[0]) / (many[1]["steps"] - few[1]["steps"]), many[1]["state_hash"]


def time(builds, folder, files, row, pairs):
    """Returns the line of a row with the seconds of both builds, by turns."""
    case, settings, (_, end) = ROWS[row]
    seconds, states = ([], []), [None, None]
    once = 8 * run(builds[0], folder, files, case, [*settings, f"time.end={end:.9g}"], False)[1]["loop_seconds"]
    # The grains of P-12 leave their box later.
    end *= 1 if row.startswith("P-12") else 8 * max(1, round(SHORTEST / once))
    for turn in range(pairs):
        for k in (0, 1) if turn % 2 == 0 else (1, 0):
            summary = run(builds[k], folder, files, case, [*settings, f"time.end={end:.9g}"], False)[1]
            seconds[k].append(summary["loop_seconds"])
            states[k] = summary["state_hash"]
    ratios = [after / before for before, after in zip(*seconds)]
    ratio, same = statistics.median(ratios), "yes" if states[0] == states[1] else "no"
    middle = [statistics.median(one) for one in seconds]
    return ratio, f'"{row}",s,{middle[0]:.4g},{middle[1]:.4g},{ratio:.4f},{min(ratios):.4f},{max(ratios):.4f},{same}'


def memory(solver, folder, files, row):
    """Returns the bytes between a small and a large run, and the last state."""
    case, common, small, large = MEMORY[row]
    ends = [run(solver, folder, files, case, [*common, *settings], False)[1] for settings in (small, large)]
    return ends[1]["peak_rss_bytes"] - ends[0]["peak_rss_bytes"], ends[1]["state_hash"]


def main():
    """Compares the builds and writes the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("before", type=pathlib.Path)
    options.add_argument("after", type=pathlib.Path)
    options.add_argument("--rows", nargs="*", default=[*ROWS, *MEMORY], help="rows by the beginning of their names")
    options.add_argument("--times", type=int, default=0, help="pairs of timed runs; 0 counts instructions")
    options.add_argument("--table", type=pathlib.Path)
    given = options.parse_args()
    builds = [given.before.resolve(), given.after.resolve()]
    versions = [subprocess.run([one, "-V"], capture_output=True, text=True).stdout.strip() for one in builds]
    lines = [f"# before: {versions[0]}; after: {versions[1]}", "row,unit,before,after,ratio,same state"]
    if given.times:
        lines[1] = "row,unit,before,after,ratio,least ratio,largest ratio,same state"
    good = True
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        files = samples(folder)
        for row in [one for one in (*ROWS, *MEMORY) if any(re.match(re.escape(wanted) + r"\b", one) for wanted in given.rows)]:
            if given.times and row in ROWS:
                ratio, line = time(builds, folder, files, row, given.times)
                good &= ratio <= BAR
                lines.append(line)
                print(lines[-1], flush=True)
                continue
            measure, unit = (work, "instructions of a step") if row in ROWS else (memory, "B")
            (before, state), (after, other) = (measure(one, folder, files, row) for one in builds)
            ratio = after / before
            good &= ratio <= BAR and state == other
            lines.append(f'"{row}",{unit},{before:.6g},{after:.6g},{ratio:.4f},{"yes" if state == other else "no"}')
            print(lines[-1], flush=True)
    if given.table:
        given.table.write_text("\n".join(lines) + "\n")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
