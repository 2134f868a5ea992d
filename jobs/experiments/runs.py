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
STUDENT = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}


def run(name, case, values=None, may_fail=False):
    """Runs a case with values set, unless it has run, and returns its folder."""
    folder = RUNS / name
    summary = folder / "summary.json"
    if not summary.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        command = [SOLVER, "run", str(HERE / case), "--threads", "1", "--overwrite", "--no-final-checkpoint", "--output", str(folder)]
        for path, value in (values or {}).items():
            command += ["--set", f"{path}={json.dumps(value)}"]
        with open(folder.parent / f"{folder.name}.log", "w", encoding="utf-8") as log:
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            code = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False).returncode
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if code != 0 and not (may_fail and code == 4):
            sys.exit(f"{' '.join(command)}: exit code {code}; see {folder}.log")
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        with open(folder.parent / f"{folder.name}.seconds", "w", encoding="utf-8") as file:
            file.write(f"{spent:.1f}\n")
    return folder


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
    """Writes a table of results with commit, machine and command in its head."""
    path = HERE / "results" / f"{name}.csv"
    path.parent.mkdir(exist_ok=True)
    version = subprocess.run([SOLVER, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
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
