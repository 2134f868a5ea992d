"""Reasons of the row of the immersed columns: run-out of looser, larger and longer runs."""

import numpy as np
from columns import LENGTH, STATES, measure
from runs import run, seconds, table

# Solid fractions that the growth is asked for, sizes over that of the row, ends over its end, and packings.
SCENES = {
    "as in the row": (0.77, 1, 1, (1, 2, 3)),
    "looser": (0.74, 1, 1, (1, 2)),
    "loosest": (0.70, 1, 1, (1, 2)),
    "three times as long": (0.77, 1, 3, (1,)),
    "twice as large": (0.77, 2, 1, (1,)),
}
END = 0.6


def main():
    rows, folders, curves = [], [], []
    friction, _, height = STATES["loose"]
    for scene, (amount, size, longer, seeds) in SCENES.items():
        for seed in seeds:
            end = END * size * longer
            changes = {
                "grains.initial.growth.friction_angle_degrees": friction,
                "grains.initial.growth.amount.solid_fraction": amount,
                "grains.initial.growth.box.to": [LENGTH * size, height * size],
                "grains.initial.growth.seed": seed,
            }
            if size != 1 or longer != 1:
                changes |= {"domain.size": [0.0216 * size, 0.0054 * size], "time.end": end, "output.fluid.every": end}
                changes |= {"probes[0].at.line.from": [0.0018 * size, 2e-5], "probes[0].at.line.to": [0.0027 * size, 2e-5]}
            name = f"loose-{seed}" if scene == "as in the row" else f"{scene.replace(' ', '-')}-{seed}"
            folder = run(f"columns/{name}", "columns/case.json", changes)
            folders.append(folder)
            # Pressures of a column are compared with its own weight, and times scale with its size.
            times, front, pressure, fraction = measure(folder, height * size)
            fraction /= size
            window = pressure[(pressure.index > 0.02 * size) & (pressure.index < 0.12 * size)] * size
            last = np.interp(END * size, times, front)
            rows.append((scene, seed, float(fraction), float(window.mean()), float(last), float(front[-1]), float(front[-1] - np.interp(0.9 * end, times, front))))
            curves += [(scene, seed, float(time / size), float(edge)) for time, edge in zip(times, front)]
    columns = ["scene", "packing", "solid_fraction", "pressure_over_weight_early", "run_out_over_height_at_0.6_s", "run_out_over_height_at_end", "growth_in_last_tenth"]
    table("columns_reasons", columns, rows, f"times over the size; processor time of all runs: {seconds(folders):.0f} s")
    table("columns_reasons_curves", ["scene", "packing", "time_over_size_s", "run_out_over_height"], curves)


if __name__ == "__main__":
    main()
