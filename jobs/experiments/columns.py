"""Immersed columns: front in time and pore pressure of a loose and a dense plane column, compared with Rondon, Pouliquen and Aussillous (2011)."""

import numpy as np
from runs import interval, run, seconds, table
from solver_results import open_run

LENGTH, GRAVITY, EXCESS = 0.0054, 9.81, 1490.0
STATES = {"loose": (21.8, 0.77, 0.00432), "dense": (0, 0.86, 0.00378)}
PUBLISHED = {"loose": (0.06, 0.048, 0.55, 0.212, 144.1), "dense": (0.06, 0.042, 0.60, 0.1207, -126.0)}


def measure(folder, height):
    """Returns the front in heights at the times of the output, and the pressure over the weight of the column in time."""
    with open_run(folder) as results:
        pressure = results.probes["pressure"].groupby("time").pressure.mean()
        series = []
        fraction = None
        for grains in results.grains:
            positions = grains.positions
            if fraction is None:
                radii = grains["radius"]
                fraction = np.pi * np.sum(radii**2) / (LENGTH * height)
            edge = np.quantile(positions[:, 0], 0.98)
            series.append((grains.time, edge))
        times, edges = (np.array(column) for column in zip(*series))
        return times, (edges - edges[0]) / height, pressure / (fraction * EXCESS * GRAVITY * height), fraction


def main():
    rows, curves, answers, folders = [], [], [], []
    for state, (friction, amount, height) in STATES.items():
        values = []
        for seed in (1, 2, 3):
            folder = run(f"columns/{state}-{seed}", "columns/case.json", {
                "grains.initial.growth.friction_angle_degrees": friction,
                "grains.initial.growth.amount.solid_fraction": amount,
                "grains.initial.growth.box.to": [LENGTH, height],
                "grains.initial.growth.seed": seed,
            })
            folders.append(folder)
            times, front, pressure, fraction = measure(folder, height)
            window = pressure[(pressure.index > 0.02) & (pressure.index < 0.12)]
            late = pressure[pressure.index > 0.5]
            reached = np.nonzero(front >= 0.5)[0][0]
            values.append((fraction, front[-1], times[reached], window.mean(), late.mean()))
            rows.append((state, seed, *map(float, values[-1])))
            binned = pressure.groupby((pressure.index / 0.02).astype(int)).mean()
            for time, edge in zip(times, front):
                part = binned.get(int(time / 0.02 + 1e-6), np.nan)
                curves.append((state, seed, float(time), float(edge), float(part)))
        for name, column in zip(("solid_fraction", "run_out_over_height", "time_to_half_height_s", "pressure_over_weight_early", "pressure_over_weight_late"), zip(*values)):
            answers.append((state, name, *map(float, interval(column))))
    table("columns_runs", ["state", "seed", "solid_fraction", "run_out_over_height", "time_to_half_height_s", "pressure_early", "pressure_late"], rows)
    table("columns", ["state", "quantity", "mean", "scatter", "half_width_95"], answers, f"processor time of the six runs: {seconds(folders):.0f} s")
    table("columns_curves", ["state", "seed", "time_s", "run_out_over_height", "pressure_over_weight"], curves)


if __name__ == "__main__":
    main()
