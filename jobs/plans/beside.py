#!/usr/bin/env python3
"""Compares the memory, disk space and time that `solver plan` states with those of the run.

    python3 jobs/plans/beside.py --solver target/release/solver --output results/plans [--only NAME ...] [--table jobs/plans/plans.csv]

Every line of cases.txt is `name | case | --set ...`, where a case is `example NAME` or a path from the root of the repository. The plan and
the run take the same case on one rank and one thread. Compared are

- memory: `estimate.memory_bytes` with the largest resident memory of the process (`peak_rss_bytes` of summary.json);
- disk: `estimate.disk_bytes` with the sizes of all files of the run;
- time: `estimate.seconds_on_one_core` with the processor time of the run (`processor_seconds`).

A run that was made before is not made again. The script ends with 1 if a plan refuses its case, a run does not end with 0, or an example of the
program is not in cases.txt: what a plan calls valid must run to its end.
"""

import argparse
import csv
import json
import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent


def cases(only):
    for line in (HERE / "cases.txt").read_text().splitlines():
        line = line.split("#")[0].strip()
        if not line:
            continue
        name, source, *sets = [part.strip() for part in line.split("|")]
        if not only or name in only:
            yield name, source, shlex.split(sets[0]) if sets else []


def case_file(solver, source, folder):
    kind, _, rest = source.partition(" ")
    if kind != "example":
        return ROOT / source
    text = subprocess.run([solver, "example", rest], check=True, capture_output=True, text=True).stdout
    path = folder / f"{rest}.json"
    path.write_text(text)
    return path


def unlisted_examples(solver):
    """Returns the examples of the program that cases.txt leaves out."""
    listed = {source.partition(" ")[2] for _, source, _ in cases([])}
    shown = subprocess.run([solver, "example"], check=True, capture_output=True, text=True).stdout
    names = [line.split()[0] for line in shown.splitlines() if "  " in line.strip()]
    missing = [name for name in names if name not in listed]
    return [f"{name} is not in cases.txt" for name in missing]


def on_disk(folder):
    return sum(entry.stat().st_size for entry in folder.rglob("*") if entry.is_file())


def one(solver, name, source, sets, output):
    folder = output / name
    record = folder / "record.json"
    if record.exists():
        return json.loads(record.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    case = case_file(solver, source, folder)
    sets = [part for value in sets for part in ("--set", value)]
    plan = subprocess.run([solver, "plan", case, "--json", *sets], capture_output=True, text=True)
    if plan.returncode:
        print(f"{name}: the plan ends with status {plan.returncode}\n{plan.stdout[-500:]}{plan.stderr[-500:]}", file=sys.stderr)
        return None
    estimate = json.loads(plan.stdout)["estimate"]
    run = folder / "run"
    begin = time.monotonic()
    process = subprocess.Popen(
        ["mpirun", "--allow-run-as-root", "-n", "1", solver, case, "--output", run, "--threads", "1", *sets],
        stdout=open(folder / "log", "w"),
        stderr=subprocess.STDOUT,
    )
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.monotonic() - begin
    code = os.waitstatus_to_exitcode(status)
    if code or not (run / "summary.json").exists():
        print(f"{name}: the run ends with status {code}\n{(folder / 'log').read_text()[-500:]}", file=sys.stderr)
        return None
    summary = json.loads((run / "summary.json").read_text())
    found = {
        "name": name,
        "estimate": estimate,
        "processor_seconds": usage.ru_utime + usage.ru_stime,
        "wall_seconds": wall,
        "disk_bytes": on_disk(run),
        "summary": {key: summary.get(key) for key in ("outcome", "wall_seconds", "processor_seconds", "loop_seconds", "phases", "mlups", "peak_rss_bytes", "grains", "particle_steps_per_second", "steps")},
    }
    record.write_text(json.dumps(found, indent=1))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", required=True, type=Path)
    parser.add_argument("--output", required=True, type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--table", type=Path)
    options = parser.parse_args()
    solver = options.solver.resolve()
    rows, failed = [], unlisted_examples(solver)
    for name, source, sets in cases(options.only):
        found = one(solver, name, source, sets, options.output.resolve())
        if found is None:
            failed.append(name)
            continue
        estimate, summary = found["estimate"], found["summary"]
        row = {
            "case": name,
            "outcome": summary["outcome"],
            "memory planned [MB]": estimate["memory_bytes"] / 1e6,
            "memory [MB]": summary["peak_rss_bytes"] / 1e6,
            "disk planned [MB]": estimate["disk_bytes"] / 1e6,
            "disk [MB]": found["disk_bytes"] / 1e6,
            "time planned [s]": estimate["seconds_on_one_core"],
            "time [s]": summary["processor_seconds"],
        }
        for what in ("memory", "disk", "time"):
            unit = "s" if what == "time" else "MB"
            planned, seen = row[f"{what} planned [{unit}]"], row[f"{what} [{unit}]"]
            row[f"{what} planned / found"] = planned / seen if seen else float("nan")
        rows.append({key: f"{value:.4g}" if isinstance(value, float) else value for key, value in row.items()})
        print("  ".join(f"{value}" for value in rows[-1].values()), flush=True)
    if options.table and rows:
        with options.table.open("w", newline="") as file:
            writer = csv.DictWriter(file, rows[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
    if failed:
        sys.exit(f"beside: {', '.join(failed)}")


if __name__ == "__main__":
    main()
