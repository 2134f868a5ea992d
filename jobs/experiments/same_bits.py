"""One scene of each kind of answer, shortened: state on any ranks and threads and after a restart, and errors that `solver estimate` gives."""

import csv
import json
import os
import subprocess
import sys

from columns import LENGTH, STATES
from piping_grains import ramp, settings
from runs import HERE, RUNS, SOLVER, complete, note_version, table

FRICTION, AMOUNT, HEIGHT = STATES["loose"]
# Case, end [s] and other values.
SCENES = {
    "heap": ("heap/column.json", 0.05, {"grains.save": None}),
    "biaxial test with servo walls": ("laboratory/biaxial.json", 0.03, {"analysis": None}),
    "plane jet": ("jet/case.json", 0.01, {}),
    "chimney": ("chimney/case.json", 0.01, {"probes[0].every": 0.0005}),
    "jet erosion test": ("jet_erosion/case.json", 0.01, {}),
    "piping, grain by grain": ("piping_grains/case.json", 0.02, settings(30, 1, ramp(30)) | {"probes[0].every": 0.001}),
    "immersed column": ("columns/case.json", 0.002, {
        "grains.initial.growth.friction_angle_degrees": FRICTION, "grains.initial.growth.amount.solid_fraction": AMOUNT, "grains.initial.growth.box.to": [LENGTH, HEIGHT],
        "probes[0].every": 0.0001}),
    "round jet": ("round_jet/case.json", 0.002, {"probes[0].every": 0.0001}),
}
# Ranks and threads of the runs that are compared with one rank and one thread.
OTHERS = ((2, 1), (3, 1), (1, 2))
NOTE = "compared with one rank and one thread: 2 and 3 ranks, 2 threads, and a run on 2 ranks up to half of the end that was continued on 3"


def launch(ranks, arguments, log):
    """Runs the program on a number of ranks and returns its exit code."""
    command = [] if ranks == 1 else ["mpirun", "-n", str(ranks), "--oversubscribe"]
    with open(log, "a", encoding="utf-8") as file:
        return subprocess.run([*command, SOLVER, *arguments], stdout=file, stderr=subprocess.STDOUT, check=False).returncode


def state(folder):
    """Returns the hash of the state at the end of a run and the number of its steps."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    note_version(folder)
    return summary["state_hash"], summary["steps"]


def compare(name, case, end, values):
    """Runs a scene on other ranks and threads and in two parts, and returns the hash, the number of steps and the runs whose hash differs."""
    base = RUNS / "same-bits" / name.replace(" ", "-").replace(",", "")
    base.mkdir(parents=True, exist_ok=True)

    def arguments(folder, threads, until):
        """Returns the arguments of a run up to a time."""
        sets = [f"{path}={json.dumps(value)}" for path, value in (values | {"time.end": until}).items()]
        return ["run", str(HERE / case), "--output", str(folder), "--threads", str(threads), "--overwrite", *(word for text in sets for word in ("--set", text))]

    def whole(ranks, threads):
        """Returns hash and steps of a run without a restart."""
        folder = base / f"{ranks}-{threads}"
        if not complete(folder) and launch(ranks, arguments(folder, threads, end), base / "log") != 0:
            sys.exit(f"{name} on {ranks} ranks: see {base / 'log'}")
        return state(folder)

    first = whole(1, 1)
    different = [f"{ranks} ranks, {threads} threads" for ranks, threads in OTHERS if whole(ranks, threads) != first]
    parts = base / "parts"
    if not complete(parts):
        launch(2, arguments(parts, 1, 0.5 * end), base / "log")
    launch(3, ["restart", str(parts), "--threads", "1", "--set", f"time.end={end}"], base / "log")
    if state(parts) != first:
        different.append("restart on 3 ranks of a run on 2")
    return (*first, different)


def errors(name, case, end, values):
    """Returns the numbers of answers of `solver estimate`, of those with an error by grids, and the settings whose change it gives."""
    folder = RUNS / "same-bits" / f"{name.replace(' ', '-').replace(',', '')}-estimate"
    sets = [f"{path}={json.dumps(value)}" for path, value in (values | {"time.end": end}).items()]
    code = launch(1, ["estimate", str(HERE / case), "--output", str(folder), "--threads", "1", *(word for text in sets for word in ("--set", text))], folder.with_suffix(".log"))
    path = folder / "estimate.csv"
    if not path.exists():
        return 0, 0, f"exit code {code}"
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    grids = [row for row in rows if row["kind"] == "cells"]
    settings_of = dict.fromkeys(row["kind"] for row in rows if row["kind"] != "cells")
    return len(grids), sum(bool(row["uncertainty"]) for row in grids), "; ".join(settings_of) or "none"


def main():
    os.environ.setdefault("OMPI_MCA_rmaps_base_oversubscribe", "1")
    rows = []
    for name, (case, end, values) in SCENES.items():
        mark, steps, different = compare(name, case, end, values)
        rows.append((name, end, steps, mark, "; ".join(different) or "none", *errors(name, case, end, values)))
        table("same_bits", ["scene", "end_s", "steps", "state_hash", "different", "answers", "with_error_by_grids", "change_given_for"], rows, NOTE)


if __name__ == "__main__":
    main()
