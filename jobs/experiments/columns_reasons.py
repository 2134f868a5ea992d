"""Reason of the row of the immersed columns: run-out against pore pressure over the packings of the row and a further one."""

import csv

import numpy as np
from columns import LENGTH, STATES, measure
from runs import HERE, STUDENT, run, seconds, table

PUBLISHED_PRESSURE = 0.37
# Amount of discs from which a further packing is grown; it does not become looser than those of the row.
AMOUNT = 0.70


def line(x, y, at):
    """Returns the regression of y on x at a place and the half width of the 95 % interval of the mean there."""
    slope, offset = np.polyfit(x, y, 1)
    free = len(x) - 2
    spread = np.sqrt(np.sum((y - slope * x - offset) ** 2) / free)
    return slope * at + offset, STUDENT[free] * spread * np.sqrt(1 / len(x) + (at - x.mean()) ** 2 / np.sum((x - x.mean()) ** 2))


def main():
    with open(HERE / "results" / "columns_runs.csv", encoding="utf-8", newline="") as file:
        found = csv.DictReader(text for text in file if not text.startswith("#"))
        rows = [(row["state"], row["seed"], *(float(row[name]) for name in ("solid_fraction", "pressure_early", "run_out_over_height")), "") for row in found]
    friction, _, height = STATES["loose"]
    growth = "grains.initial.growth"
    values = {f"{growth}.friction_angle_degrees": friction, f"{growth}.amount.solid_fraction": AMOUNT, f"{growth}.box.to": [LENGTH, height], f"{growth}.seed": 1}
    folder = run("columns/loosest-1", "columns/case.json", values)
    _, front, pressure, fraction = measure(folder, height)
    rows.append((f"loose, from {AMOUNT}", "1", float(fraction), float(pressure[(pressure.index > 0.02) & (pressure.index < 0.12)].mean()), float(front[-1]), ""))
    x, y = (np.array([row[column] for row in rows]) for column in (3, 4))
    rows.append(("regression of all", len(x), "", PUBLISHED_PRESSURE, *map(float, line(x, y, PUBLISHED_PRESSURE))))
    note = f"the regression is that of run-out on pressure at the published pressure; the runs of the row are read from its table; processor time of the further run: {seconds([folder]):.0f} s"
    table("columns_reasons", ["state", "packing", "solid_fraction", "pressure_early", "run_out_over_height", "half_width_95"], rows, note)


if __name__ == "__main__":
    main()
