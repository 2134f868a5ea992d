"""Jet erosion test of bonded discs: record of the scour depth in time, and the law that `solver erosion-law` fits to it."""

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from runs import HERE, RUNS, SOLVER, run, seconds, table
from solver_results import open_run

NOZZLE, SPEED, GRAVITY, TOP, CENTRE, DENSITY = 4e-4, 0.25, 9.81, 0.00336, 0.00224, 2650.0
HEAD = SPEED**2 / (2 * GRAVITY)


def record(folder):
    """Returns times and distances of the nozzle from the soil on its axis: the highest disc there that has not moved by half a diameter."""
    times, distances = [], []
    with open_run(folder) as results:
        start = None
        for grains in results.grains:
            ids, positions, radii = grains["id"], grains.positions, grains["radius"]
            if start is None:
                start = dict(zip(ids.tolist(), positions))
                bulk = np.pi * np.sum(radii**2) / (2 * CENTRE * 0.0016) * DENSITY
            origin = np.array([start[key] for key in ids.tolist()])
            bed = (np.linalg.norm(positions - origin, axis=1) < radii) & (np.abs(positions[:, 0] - CENTRE) < NOZZLE)
            surface = (positions[:, 1] + radii)[bed].max() if bed.any() else 0.0
            times.append(grains.time)
            distances.append(TOP - surface)
    return np.array(times), np.array(distances), float(bulk)


def main():
    tables, folders, rows = [], [], []
    for seed in (1, 2, 3):
        folder = run(f"jet_erosion/{seed}", "jet_erosion/case.json", {"grains.initial.growth.seed": seed}, may_fail=True)
        folders.append(folder)
        times, distances, bulk = record(folder)
        for time, distance in zip(times, distances):
            rows.append((seed, float(time), float(distance)))
        path = RUNS / "jet_erosion" / f"record-{seed}.csv"
        with open(path, "w", encoding="utf-8") as file:
            file.write("time,distance\n")
            # The jet grows for 0.05 s. Steps back of the record are discs that swing: the deepest scour counts. The record ends a disc above the floor.
            deepest = np.maximum.accumulate(distances)
            used = (times >= 0.05) & (deepest < TOP - 2e-4)
            for time, distance in zip(times[used] - 0.05, deepest[used]):
                file.write(f"{time:.6g},{distance:.6g}\n")
        tables.append(path)
    table("jet_erosion_records", ["packing", "time_s", "distance_m"], rows)
    laws(tables, bulk, folders)


def laws(records, bulk, folders):
    """Fits the law to all records with the program, and writes what it found."""
    command = [SOLVER, "erosion-law", *map(str, records), "--nozzle", str(NOZZLE), "--head", f"{HEAD:.6g}", "--bulk-density", f"{bulk:.4g}", "--json",
               "--output", str(RUNS / "jet_erosion")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    with open(RUNS / "jet_erosion" / "erosion-law.txt", "w", encoding="utf-8") as file:
        file.write(done.stdout + done.stderr)
    if done.returncode != 0:
        sys.exit(done.stderr)
    shutil.copy(RUNS / "jet_erosion" / "jet_erosion.svg", HERE / "results" / "jet_erosion.svg")
    with open(RUNS / "jet_erosion" / "jet_erosion.csv", encoding="utf-8", newline="") as file:
        columns, *rows = csv.reader(line for line in file if not line.startswith("#"))
    with open(RUNS / "jet_erosion" / "jet_erosion.json", encoding="utf-8") as file:
        means = json.load(file).get("means")
    if means:
        mean = []
        for name in ("critical_shear", "coefficient"):
            part = means[f"{name}_interval"]
            mean += [means["law"][name], part["low"], part["high"]]
        rows.append(["mean", *mean, *[""] * (len(columns) - 7)])
        rows.append(["mean in Pa and s/m", *mean[:3], *(value * bulk for value in mean[3:]), *[""] * (len(columns) - 7)])
    rows = [[Path(str(value)).name if str(value).endswith(".csv") else value for value in row] for row in rows]
    table("jet_erosion", columns, rows, f"head {HEAD:.4g} m, nozzle {NOZZLE} m, bulk density {bulk:.0f} kg/m3; processor time: {seconds(folders):.0f} s")


if __name__ == "__main__":
    main()
