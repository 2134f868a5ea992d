"""Reasons of the row of the jet erosion test: wall shear of its jet in the computed flow, and the law of its records with that stress instead of the formula."""

import csv
import math

import numpy as np
from jet_erosion import CENTRE, NOZZLE, SPEED, record
from runs import HERE, STUDENT, run, seconds, table
from solver_results import open_run

DENSITY, VISCOSITY = 1000.0, 1e-6
# Distances of a flat wall from the nozzle and spacings of the cells [m]; the second spacing shows the error of the first.
CELLS = {2.8e-5: (63, 80, 96, 112, 140, 170), 1.4e-5: (126,)}
STEPS = {2.8e-5: 7e-6, 1.4e-5: 3.5e-6}
END, STEADY = 0.15, 0.1
BULK = 2143.0
# Critical stress of the hole erosion test of the same soil [Pa], example `piping`.
HOLE = 0.015
# The depth that a bed twice as deep has more, a whole number of cells; the nozzle starts at the same distance from it.
DEEPER = 0.001596
BOUNDARIES = "fluid.lattice_boltzmann.boundaries"


def flow(spacing, cells):
    """Runs the jet against a flat wall and returns its folder; grains, bonds and the region that removes them are left out."""
    height = round(spacing * cells, 9)
    width, line = 2 * CENTRE, []
    for row in (0.5, 1.5):
        y = round(row * spacing, 9)
        line.append({"name": f"row-{row}", "every": 0.005, "at": {"line": {"from": [spacing / 2, y], "to": [width - spacing / 2, y], "points": round(width / spacing)}}})
    changes = {
        "grains": None, "contact": None, "box_walls": [], "box_wall_material": None, "coupling": None, "regions": [], "output.grains": None,
        "domain.size": [width, height], "domain.spacing": spacing, "fluid.lattice_boltzmann.time_step": STEPS[spacing],
        f"{BOUNDARIES}[0].patch.to": [CENTRE + NOZZLE / 2, height],
        f"{BOUNDARIES}[1].patch.from": [0, 0], f"{BOUNDARIES}[1].patch.to": [0, height],
        f"{BOUNDARIES}[2].patch.from": [width, 0], f"{BOUNDARIES}[2].patch.to": [width, height],
        "probes": line, "time.end": END,
    }
    return run(f"jet_erosion/wall-{cells}-{spacing * 1e6:.0f}um", "jet_erosion/case.json", changes)


def wall(folder, spacing):
    """Returns the largest shear stress on the wall and its distance from the axis, the mean of its absolute value below twice the nozzle, and the pressure on the axis."""
    with open_run(folder) as results:
        near, next_row = (results.probes[f"row-{row}"] for row in (0.5, 1.5))
    means = []
    for samples in (near, next_row):
        late = samples[samples.time > STEADY - 1e-9]
        means.append(late.groupby("x")[["velocity_x", "pressure"]].mean())
    x = means[0].index.to_numpy() - CENTRE
    # The parabola through the wall, where the velocity is zero, and the centres of two cells.
    shear = DENSITY * VISCOSITY * (9 * means[0].velocity_x.to_numpy() - means[1].velocity_x.to_numpy()) / (3 * spacing)
    largest = np.abs(shear).argmax()
    return float(np.abs(shear).max()), float(abs(x[largest])), float(np.abs(shear)[np.abs(x) < NOZZLE].mean()), float(means[0].pressure.max())


def formula(distance):
    """Returns the stress of Hanson and Cook (2004) at a distance from the nozzle [Pa]."""
    return 0.00416 * DENSITY * SPEED**2 * np.minimum(1, 6.3 * NOZZLE / distance) ** 2


def fit(times, distances, stress, critical=None):
    """Returns critical stress, coefficient [m3/(N s)] and scatter of J of the law dJ/dt = k (stress(J) - tau) by least squares; the first distance is free, tau unless it is given."""
    way = np.linspace(distances.min() - 2e-4, distances.max() + 2e-3, 1500)
    pull = stress(way)
    centre, reach = np.array([0.5, math.log(0.1), 0.0]), np.array([0.5, math.log(100), 2e-4])
    for _ in range(9):
        best = (math.inf, centre)
        for part in sorted(set(np.clip(np.linspace(centre[0] - reach[0], centre[0] + reach[0], 13), 0, 0.999))) if critical is None else (critical / stress(distances[0]),):
            excess = pull - part * stress(distances[0])
            until = len(way) if (excess > 0).all() else int(np.argmax(excess <= 0))
            inverse = 1 / excess[:until]
            progress = np.concatenate(([0], np.cumsum(0.5 * (inverse[1:] + inverse[:-1]) * np.diff(way[:until]))))
            for slow in np.linspace(centre[1] - reach[1], centre[1] + reach[1], 13):
                for shift in np.linspace(centre[2] - reach[2], centre[2] + reach[2], 9):
                    begin = np.interp(distances[0] + shift, way[:until], progress)
                    found = np.interp(begin + math.exp(slow) * (times - times[0]), progress, way[:until])
                    total = float(np.sum((found - distances) ** 2))
                    if total < best[0]:
                        best = total, np.array([part, slow, shift])
        centre, reach = best[1], reach * 0.5
    return float(centre[0] * stress(distances[0])), math.exp(centre[1]), math.sqrt(best[0] / len(times))


def records():
    """Returns the records of the row by packing, as the fit of the row uses them."""
    with open(HERE / "results" / "jet_erosion_records.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    found = {}
    for seed in dict.fromkeys(row["packing"] for row in rows):
        part = [row for row in rows if row["packing"] == seed]
        found[seed] = usable(np.array([float(row["time_s"]) for row in part]), np.array([float(row["distance_m"]) for row in part]), 0.00336)
    return found


def usable(times, distances, floor):
    """Returns the part of a record after the rise of the jet and before a disc above the floor, with the deepest scour so far."""
    deepest = np.maximum.accumulate(distances)
    used = (times >= 0.05) & (deepest < floor - 2e-4)
    return times[used], deepest[used]


def deeper():
    """Runs the test on a bed twice as deep, and returns records by packing and folders."""
    found, folders, top = {}, [], 0.00336 + DEEPER
    for seed in (1, 2, 3):
        changes = {"grains.initial.growth.seed": seed, "grains.initial.growth.box.to": [2 * CENTRE, round(0.0016 + DEEPER, 6)], "domain.size": [2 * CENTRE, round(top, 6)], "time.end": 0.7,
                   f"{BOUNDARIES}[0].patch.to": [CENTRE + NOZZLE / 2, round(top, 6)]}
        for place, x in ((1, 0), (2, 2 * CENTRE)):
            changes |= {f"{BOUNDARIES}[{place}].patch.from": [x, round(0.0017 + DEEPER, 6)], f"{BOUNDARIES}[{place}].patch.to": [x, round(top, 6)]}
        for place in (0, 1):
            for corner, height in (("from", 0.0019), ("to", 0.00336)):
                x = {("from", 0): 0, ("to", 0): 0.0001, ("from", 1): 0.00438, ("to", 1): 0.00448}[corner, place]
                changes[f"regions[{place}].box.{corner}"] = [x, round(height + DEEPER, 6)]
        folders.append(run(f"jet_erosion/deep-{seed}", "jet_erosion/case.json", changes, may_fail=True))
        times, distances, _ = record(folders[-1])
        found[str(seed)] = usable(times, distances + DEEPER, top)
    return found, folders


def main():
    walls, folders = [], []
    for spacing, heights in CELLS.items():
        for cells in heights:
            folders.append(flow(spacing, cells))
            distance = spacing * cells
            largest, off, mean, pressure = wall(folders[-1], spacing)
            walls.append((distance, spacing, float(formula(distance)), largest, largest / float(formula(distance)), off, mean, pressure))
    table("jet_erosion_stress_wall", ["distance_m", "spacing_m", "formula_Pa", "largest_shear_Pa", "over_formula", "distance_from_axis_m", "mean_shear_below_nozzle_Pa", "pressure_on_axis_Pa"], walls)
    coarse = [row for row in walls if row[1] == max(CELLS)]
    heights, shears = np.log([row[0] for row in coarse]), np.log([row[3] for row in coarse])

    def own(distance):
        """Returns the largest wall shear of the computed flow at a distance [Pa]."""
        return np.exp(np.interp(np.log(distance), heights, shears))

    row = records()
    deep, more = deeper()
    half = {seed: (times[distances < 0.00256], distances[distances < 0.00256]) for seed, (times, distances) in row.items()}
    rows, answers = [], []
    for name, sets in (("row", row), ("upper half", half), ("deeper bed", deep)):
        for stress, law, critical in (("formula", formula, None), ("computed", own, None), ("computed, critical stress of the hole", own, HOLE)):
            found = [(name, stress, seed, *fit(*pair, law, critical)) for seed, pair in sets.items()]
            rows += found
            width = STUDENT[len(found) - 1] / math.sqrt(len(found))
            taus, slopes = np.array([one[3] for one in found]), np.log([one[4] * BULK for one in found])
            spread = math.exp(width * slopes.std(ddof=1))
            answers.append((name, stress, float(taus.mean()), float(width * taus.std(ddof=1)), float(math.exp(slopes.mean())), float(math.exp(slopes.mean()) / spread), float(math.exp(slopes.mean()) * spread)))
    table("jet_erosion_stress_runs", ["records", "stress", "packing", "critical_stress_Pa", "coefficient_m3_N_s", "scatter_m"], rows)
    columns = ["records", "stress", "critical_stress_Pa", "half_width_95", "coefficient_s_m", "low_95", "high_95"]
    table("jet_erosion_stress", columns, answers, f"processor time: {seconds(folders + more):.0f} s, without the records of the row")


if __name__ == "__main__":
    main()
