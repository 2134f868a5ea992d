"""Runs of the experiments, their measures and their tables; `run.py` has the rows.

A run that is complete is not repeated. The program is `solver`, or the one named by the variable SOLVER.
"""

import csv
import json
import math
import os
import platform
import resource
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
RUNS = Path(os.environ.get("EXPERIMENTS", HERE / "runs"))
SOLVER = os.environ.get("SOLVER", "solver")
# Versions of the program that made the runs, which may be older than SOLVER because complete runs are kept.
VERSIONS = set()
STUDENT = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}


def run(name, case, values=None, may_fail=False, may_extend=False):
    """Runs a case with values set, unless it has run, and returns its folder; a run that may be extended writes a checkpoint at its end."""
    folder = RUNS / name
    if not complete(folder, may_fail):
        folder.parent.mkdir(parents=True, exist_ok=True)
        for old in ("log", "seconds"):
            (folder.parent / f"{folder.name}.{old}").unlink(missing_ok=True)
        command = [SOLVER, "run", str(HERE / case), "--threads", "1", "--overwrite", "--output", str(folder)]
        command += [] if may_extend else ["--no-final-checkpoint"]
        for path, value in (values or {}).items():
            command += ["--set", f"{path}={json.dumps(value)}"]
        call(command, folder, may_fail)
    note_version(folder)
    return folder


def complete(folder, may_fail=False):
    """Returns whether a run has ended; one that was stopped, or that failed where it may not, begins again."""
    summary = folder / "summary.json"
    outcome = json.loads(summary.read_text(encoding="utf-8")).get("outcome") if summary.exists() else None
    return outcome == "done" or (may_fail and outcome == "failed")


def extend(folder, end):
    """Continues a finished run up to a later end [s]."""
    call([SOLVER, "restart", str(folder), "--threads", "1", "--set", f"time.end={end}"], folder)
    note_version(folder)


def note_version(folder):
    """Adds the version that made a run to those which the heads of the tables name."""
    made = json.loads((folder / "summary.json").read_text(encoding="utf-8")).get("versions")
    if made:
        VERSIONS.add(f"solver {made['solver']} ({made['commit']})")


def call(command, folder, may_fail=False):
    """Executes a command of a run, and adds its output to the log of the run and its processor time to that spent before."""
    with open(folder.parent / f"{folder.name}.log", "a", encoding="utf-8") as log:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        code = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False).returncode
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if code != 0 and not (may_fail and code == 4):
        sys.exit(f"{' '.join(command)}: exit code {code}; see {folder}.log")
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    record = folder.parent / f"{folder.name}.seconds"
    spent += float(record.read_text(encoding="utf-8")) if record.exists() else 0.0
    record.write_text(f"{spent:.1f}\n", encoding="utf-8")


def seconds(folders):
    """Returns the processor time of runs [s] together."""
    total = 0.0
    for folder in folders:
        with open(folder.parent / f"{folder.name}.seconds", encoding="utf-8") as file:
            total += float(file.read())
    return total


def interval(values):
    """Returns mean, standard deviation and half width of the 95 % interval of the mean (Student)."""
    count = len(values)
    mean = sum(values) / count
    if count < 2:
        return mean, math.nan, math.nan
    scatter = math.sqrt(sum((value - mean) ** 2 for value in values) / (count - 1))
    return mean, scatter, STUDENT[count - 1] * scatter / math.sqrt(count)


def table(name, columns, rows, note=""):
    """Writes a table of results with the versions that made its runs, machine and command in its head."""
    path = HERE / "results" / f"{name}.csv"
    path.parent.mkdir(exist_ok=True)
    own = subprocess.run([SOLVER, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    version = ", ".join(sorted(VERSIONS)) or own
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(f"# {version}; {processor()}, one thread\n")
        file.write(f"# command: python3 jobs/experiments/run.py {' '.join(sys.argv[1:])}\n")
        if note:
            file.write(f"# {note}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            writer.writerow([f"{value:.4g}" if isinstance(value, float) else value for value in row])
    print(path)


def processor():
    """Returns the name of the processor."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(line.split(":")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.machine()
