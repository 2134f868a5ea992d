"""Draws the tables of results as SVG files.

    python3 jobs/experiments/draw.py       reads and writes results/; needs matplotlib
"""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt

matplotlib.rcParams["svg.hashsalt"] = "experiments"  # without it the names inside a file are random

RESULTS = Path(__file__).resolve().parent / "results"
# Front [cm] in time [s] and pressure [Pa] of Rondon et al. (2011), as digitised in SedFoam/sedfoam, tutorials/Py/DATA/Rondon2012.
LOOSE = [(0.085, 6.921), (0.636, 16.271), (1.314, 19.719), (1.907, 20.301), (2.585, 20.747), (3.22, 21.022), (3.941, 21.161), (4.534, 21.231), (5.89, 21.201)]
DENSE = [(0.042, 7.092), (0.551, 8.765), (1.229, 8.358), (1.907, 9.282), (2.542, 9.523), (3.093, 9.797), (3.771, 10.448), (4.407, 11.201), (5.508, 11.648), (6.229, 12.094), (8.051, 12.066)]
LOOSE_PRESSURE = [(1.127, 133.320), (1.972, 144.078), (3.380, 126.458), (4.507, 104.229), (5.915, 82.005)]
DENSE_PRESSURE = [(1.127, -126.015), (1.972, -63.850), (3.380, -52.314), (6.197, -52.260), (7.324, -56.842)]
COLOURS = {"loose": "C0", "dense": "C3"}


def rows(name):
    """Returns the rows of a table of results, or none where the table is missing."""
    path = RESULTS / f"{name}.csv"
    if not path.exists():
        return []
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def save(figure, name):
    """Writes a figure without its date, so that equal tables give equal files by one version of matplotlib."""
    figure.tight_layout()
    figure.savefig(RESULTS / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


def columns():
    """Draws the front and the pressure of the columns, both published and computed."""
    table = rows("columns_curves")
    if not table:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8))
    published = {"loose": (LOOSE, LOOSE_PRESSURE, 0.048, 0.00432, 0.55), "dense": (DENSE, DENSE_PRESSURE, 0.042, 0.00378, 0.60)}
    for state, (front, pressure, height, computed, fraction) in published.items():
        scale, weight = computed / height, fraction * 1490 * 9.81 * height
        label = f"{state}, experiment, time times {scale:.2f}"
        left.plot([time * scale for time, _ in front], [(edge - 6) / (100 * height) for _, edge in front], COLOURS[state] + "o", ms=4, label=label)
        right.plot([time * scale for time, _ in pressure], [value / weight for _, value in pressure], COLOURS[state] + "o", ms=4, label=label)
        for seed in sorted({row["seed"] for row in table}):
            part = [row for row in table if row["state"] == state and row["seed"] == seed]
            times = [float(row["time_s"]) for row in part]
            label = f"{state}, computed" if seed == "1" else None
            left.plot(times, [float(row["run_out_over_height"]) for row in part], COLOURS[state], lw=1, label=label)
            right.plot(times, [float(row["pressure_over_weight"]) for row in part], COLOURS[state], lw=1, label=label)
    for axes, name in ((left, "run-out over height of the column"), (right, "excess pressure over submerged weight")):
        axes.set(xlabel="time [s]", ylabel=name)
        axes.set_xlim(0, 0.6)
        axes.legend(frameon=False, fontsize=7)
    right.axhline(0, color="grey", lw=0.5)
    save(figure, "columns")


def jet():
    """Draws the velocity on the axis of the free jet, to the power at which Bickley's jet is a line."""
    table = rows("jet_axis")
    if not table:
        return
    figure, axes = plt.subplots(figsize=(5, 3.8))
    distance = [float(row["distance_over_slot"]) for row in table]
    axes.plot(distance, [float(row["velocity_over_mean"]) ** -3 for row in table], "o", label="computed")
    first = float(table[0]["velocity_over_mean"]) ** -3
    axes.plot(distance, [first + (x - distance[0]) / (0.45428**3 * 40) for x in distance], label="slope of Bickley (1937)")
    axes.set(xlabel="distance from the slot over its width", ylabel="(U/u)³ on the axis")
    axes.legend(frameon=False)
    save(figure, "jet")


def round_jet():
    """Draws the velocity on the axis of the free round jet, whose inverse grows along Schlichting's line, and the steps between which beads are eroded."""
    table, runs = rows("round_jet_axis"), rows("round_jet_runs") + rows("round_jet_far_runs") + rows("round_jet_crater_runs")
    if not table or not runs:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8))
    distance = [float(row["distance_over_nozzle"]) for row in table]
    for shade, name in enumerate(key for key in table[0] if key.startswith("velocity")):
        speed = float(name.rpartition("_")[2])
        inverse = [1 / max(float(row[name]), 1e-3) for row in table]
        left.plot(distance, inverse, f"C{shade}", label=f"{speed:g} m/s, Re {200 * speed:.0f}")
        near = min(range(len(distance)), key=lambda place: abs(distance[place] - 4.5))
        left.plot(distance, [inverse[near] + (x - distance[near]) / (25 * speed) for x in distance], f"C{shade}:")
    left.set(xlabel="distance from the nozzle over its diameter", ylabel="U/u on the axis (dotted: slope of Schlichting 1933)", xlim=(0, 7), ylim=(0, 3))
    left.legend(frameon=False)
    for shade, (beads, words) in enumerate((("1", "first bead"), ("10", "ten beads"))):
        for style, (quantity, name) in zip(("-", ":"), (("shields_of_jet", "jet"), ("shields_local", "velocity at the bed"))):
            part = [run for run in runs if run["beads"] == beads and " to " in run[quantity]]
            for place, row in enumerate(part):
                x, ends = float(row["distance_over_nozzle"]), [float(end) for end in row[quantity].split(" to ")]
                right.plot([x] * 2, ends, f"C{shade}_{style}", ms=8, label=None if place else f"{words}, {name}")
    right.set(xlabel="distance of the bed over the diameter of the nozzle", ylabel="Shields number at the threshold", xlim=(0, None), ylim=(0, None))
    right.legend(frameon=False)
    save(figure, "round_jet")


def chimney():
    """Draws the overpressure at the slot over the weight of the bed as the injection grows."""
    table = rows("chimney_curves")
    if not table:
        return
    figure, axes = plt.subplots(figsize=(5, 3.8))
    for seed in sorted({row["packing"] for row in table}):
        part = [row for row in table if row["packing"] == seed]
        axes.plot(*zip(*((float(row["reynolds"]), float(row["overpressure_over_weight"])) for row in part)), lw=1, label=f"packing {seed}")
    axes.axhline(1, color="grey", lw=0.5)
    axes.set(xlabel="Reynolds number of the injection", ylabel="overpressure over submerged weight", ylim=(0, None))
    axes.legend(frameon=False)
    save(figure, "chimney")


def piping_grains():
    """Draws the front of the discs below a cover over the gradient, the discharge at heads that stay, and H/L against L with the rule of 2011."""
    curves, runs = (rows(f"piping_grains_{kind}") + rows(f"piping_grains_240_{kind}") for kind in ("curves", "runs"))
    if not curves or not runs:
        return
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12, 3.8))
    lengths = list(dict.fromkeys(row["length_over_d"] for row in runs))
    for shade, length in enumerate(lengths):
        for seed in sorted({row["packing"] for row in curves if row["length_over_d"] == length and row["head"] == "ramp"}):
            part = [row for row in curves if (row["length_over_d"], row["packing"], row["head"]) == (length, seed, "ramp")]
            label = f"L = {length} d" if seed == "1" else None
            left.plot([float(row["gradient"]) for row in part], [float(row["front_over_length"]) for row in part], f"C{shade}", lw=1, label=label)
    for shade, head in enumerate(sorted({row["head"] for row in curves} - {"ramp"})):
        part = [row for row in curves if row["head"] == head and float(row["gradient"]) >= 0.2]
        flow = [float(row["discharge_over_head_m_s"]) for row in part]
        middle.semilogy([float(row["time_s"]) for row in part], [value / flow[4] for value in flow], f"C{shade}", lw=1, label=f"H/L = {head}, L = {part[0]['length_over_d']} d")
    for shade, (value, label) in enumerate((("front_0.5_L", "front at L/2"), ("front_0.9_L", "front at 0.9 L"), ("water_breaks_through", "water breaks through"))):
        points = [(float(row["length_over_d"]) * (1 + 0.03 * shade), float(row[f"gradient_{value}"])) for row in runs if row[f"gradient_{value}"] != "nan"]
        right.loglog(*zip(*points), "o", ms=4, label=label)
    for angle, style in ((37, "k-"), (20, "k--")):
        line = [(float(length), sum(float(row[f"rule_{angle}_degrees"]) for row in runs if row["length_over_d"] == length) / sum(row["length_over_d"] == length for row in runs)) for length in lengths]
        right.loglog(*zip(*line), style, lw=1, label=f"rule of 2011, {angle} degrees")
    left.set(xlabel="H/L (ramp)", ylabel="front of moved discs over L")
    middle.set(xlabel="time [s]", ylabel="discharge over head, relative to 0.2 s")
    right.set(xlabel="L/d", ylabel="H/L")
    right.set_xticks([float(length) for length in lengths], lengths)
    right.set_xticks([], minor=True)
    right.set_yticks([0.2, 0.3, 0.4, 0.5, 0.6], ["0.2", "0.3", "0.4", "0.5", "0.6"])
    right.set_yticks([], minor=True)
    for axes in (left, middle, right):
        axes.legend(frameon=False, fontsize=7)
    save(figure, "piping_grains")


def reasons():
    """Draws the runs that test the reasons of rows that disagree: sliding below a cover and wall shear of the jet."""
    sliding, shears = rows("piping_grains_reasons_runs"), rows("jet_erosion_stress_wall")
    if not sliding or not shears:
        return
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8))
    for shade, scene in enumerate(dict.fromkeys(row["scene"] for row in sliding)):
        part = [row for row in sliding if row["scene"] == scene and row["front_0.5_L"] != "nan"]
        left.plot([float(row["sliding_by_contact_friction"]) for row in part], [float(row["front_0.5_L"]) for row in part], f"C{shade}o", ms=4, label=scene)
    discs = [row for row in sliding if row["scene"].startswith("discs") or row["scene"] == "as in the row"]
    for mark, quantity in (("k^", "peak_strength"), ("kv", "late_strength")):
        places = [[float(row[f"sliding_by_{value}"]) for row in discs] for value in ("contact_friction", quantity)]
        left.plot(*places, mark, ms=3, mfc="none", label=f"sliding by the {quantity.replace('_', ' ')} of the packing")
    left.plot([0, 0.8], [0, 0.8], "k:", lw=1, label="sliding by the friction of contacts")
    left.set(xlabel="solid fraction times 1.5 tan(friction angle of contacts)", ylabel="H/L with the front at L/2", xlim=(0, None), ylim=(0, 1.2))
    spacing = max(float(row["spacing_m"]) for row in shears)
    for name, part in (("computed", [row for row in shears if float(row["spacing_m"]) == spacing]), ("computed, half the spacing", [row for row in shears if float(row["spacing_m"]) < spacing])):
        right.semilogy([1e3 * float(row["distance_m"]) for row in part], [float(row["largest_shear_Pa"]) for row in part], "o", ms=4, label=name)
    part = [row for row in shears if float(row["spacing_m"]) == spacing]
    right.semilogy([1e3 * float(row["distance_m"]) for row in part], [float(row["formula_Pa"]) for row in part], label="formula of Hanson and Cook")
    right.set(xlabel="distance of the wall from the nozzle [mm]", ylabel="largest wall shear stress [Pa]")
    left.legend(frameon=False, fontsize=6, ncol=2)
    right.legend(frameon=False, fontsize=7)
    save(figure, "reasons")


def laboratory():
    """Draws the laboratory tests of both programs, one line for each packing."""
    table = rows("laboratory_curves") + rows("triaxial_curves")
    if not table:
        return
    figure, parts = plt.subplots(1, 4, figsize=(13, 3.4))
    labels = {
        "oedometer": ("axial strain", "axial stress [kPa]", 1e-3),
        "biaxial": ("axial strain", "axial over lateral stress", 1),
        "shear": ("path over height", "shear over normal stress", 1),
        "triaxial": ("axial strain", "axial over lateral stress", 1),
    }
    for axes, (test, (across, up, scale)) in zip(parts, labels.items()):
        for program, colour, width in (("solver", "C0", 1.6), ("LAMMPS", "C3", 0.6)):
            part = [row for row in table if (row["test"], row["program"]) == (test, program)]
            for place, seed in enumerate(sorted({row["packing"] for row in part})):
                points = [(float(row["path"]), scale * float(row["value"])) for row in part if row["packing"] == seed]
                axes.plot(*zip(*points), colour, lw=width, label=None if place else program)
        axes.set(xlabel=across, ylabel=up, title=test)
        axes.set_ylim(bottom=0)
    parts[0].legend(frameon=False, fontsize=7)
    save(figure, "laboratory")


def bars(name, group, values, label):
    """Draws the runs of a table as points, one column for each group."""
    table = rows(name)
    if not table:
        return
    groups = list(dict.fromkeys(row[group] for row in table))
    figure, axes = plt.subplots(figsize=(6.5, 3.8))
    for shift, value in enumerate(values):
        points = [(groups.index(row[group]) + 0.12 * shift, float(row[value])) for row in table if row[value] not in ("", "nan", "none")]
        if points:
            axes.plot(*zip(*points), "o", label=value.replace("_", " "))
    axes.set_xticks(range(len(groups)), groups, fontsize=7)
    axes.set_ylabel(label)
    axes.set_ylim(bottom=0)
    axes.legend(frameon=False, fontsize=7)
    save(figure, name.removesuffix("_runs"))


def main():
    columns()
    jet()
    round_jet()
    chimney()
    piping_grains()
    laboratory()
    reasons()
    bars("heap_runs", "program", ["run_out_over_length", "centre_over_length"], "over the length of the column")


if __name__ == "__main__":
    main()
