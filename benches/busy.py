#!/usr/bin/env python3
"""Speed on a machine with other work: ranks and threads beside a process that never waits.

    python3 benches/busy.py SOLVER [--table FILE] [--turns N]

Two scenes (a cavity in 3-D, packed spheres) run on 1, 2 and 4 ranks and threads, alone and beside one busy process. A row has the medians of
N turns (else 3), taken in alternation, in million updates of cells or grains a second, and what is left of one thread alone. The status is 1 where less than
a third of it is left.
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
LEAST = 1 / 3
SCENES = {
    "cavity": (HERE / "cases/cavity_3d.json", ["domain.size=[0.00096, 0.00096, 0.00096]", "time.end=2e-4"]),
    "spheres": (HERE / "cases/spheres.json", ["time.end=1e-3"]),
}
LAYOUTS = [(1, 1), (1, 2), (2, 1), (1, 4), (2, 2), (4, 1)]
SPIN = [sys.executable, "-c", "while True: pass"]


def speed(solver, folder, scene, files, ranks, threads):
    """Returns the million updates a second of a run, and its state."""
    case, settings = SCENES[scene]
    command = ["mpirun", "--oversubscribe", "-n", str(ranks), solver, case, "--threads", str(threads)]
    command += ["--output", folder / "run", "--overwrite", "--no-final-checkpoint"]
    for one in [*settings, *files.get(scene, [])]:
        command += ["--set", one]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"busy: {scene} on {ranks} ranks: {done.stderr[-800:]}")
    summary = json.loads((folder / "run/summary.json").read_text())
    return summary["mlups"] or summary["particle_steps_per_second"] / 1e6, summary["state_hash"]


def main():
    """Runs the scenes and writes the table."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("solver", type=pathlib.Path)
    options.add_argument("--table", type=pathlib.Path)
    options.add_argument("--turns", type=int, default=3)
    given = options.parse_args()
    solver = given.solver.resolve()
    version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    lines = [f"# {version}", "scene,ranks,threads,alone,busy,busy_over_one_thread_alone", "# -,-,-,1e6/s,1e6/s,-"]
    good = True
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([sys.executable, HERE / "peers/states.py", "sample", "box_packed", folder / "box.csv"], check=True)
        files = {"spheres": [f"grains.initial.file.path={folder / 'box.csv'}"]}
        for scene in SCENES:
            found = {(layout, busy): [] for layout in LAYOUTS for busy in (False, True)}
            states = set()
            for _ in range(given.turns):
                for busy in (False, True):
                    other = subprocess.Popen(SPIN) if busy else None
                    for layout in LAYOUTS:
                        value, state = speed(solver, folder, scene, files, *layout)
                        found[layout, busy].append(value)
                        states.add(state)
                    if other:
                        other.kill()
                        other.wait()
            one = statistics.median(found[(1, 1), False])
            good &= len(states) == 1
            for ranks, threads in LAYOUTS:
                alone, busy = (statistics.median(found[(ranks, threads), busy]) for busy in (False, True))
                good &= busy >= LEAST * one
                lines.append(f"{scene},{ranks},{threads},{alone:.3g},{busy:.3g},{busy / one:.3f}")
                print(lines[-1], flush=True)
    if given.table:
        given.table.write_text("\n".join(lines) + "\n")
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
