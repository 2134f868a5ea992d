"""Injection below a bed: flow at which a cavity opens and at which the bed moves up to its surface, for two heights of the bed."""

import numpy as np
from runs import interval, run, seconds, table
from solver_results import open_run

SPEED, SLOT, RAMP, VISCOSITY, DIAMETER, GRAVITY, EXCESS, DENSITY = 0.06, 0.0048, 0.9, 1e-5, 1e-3, 9.81, 1.5, 1000.0
ARCHIMEDES = EXCESS * GRAVITY * DIAMETER**3 / VISCOSITY**2
HEIGHTS = {"8 d": 0.008}
CENTRE = 0.0128


def onset(folder, height):
    """Returns times of the first grain and of the first surface grain that moved by a diameter, and the overpressure over the weight in time."""
    cavity = chimney = None
    with open_run(folder) as results:
        pressure = results.probes["slot"].groupby("time").pressure.mean()
        fraction = None
        for grains in results.grains:
            order = np.argsort(grains["id"])
            positions = grains.positions[order]
            if fraction is None:
                start = positions
                radii = grains["radius"][order]
                fraction = np.pi * np.sum(radii**2) / (2 * CENTRE * height)
                top = start[:, 1] > np.quantile(start[:, 1], 0.98) - DIAMETER
                middle = np.abs(start[:, 0] - CENTRE) < 0.008
                continue
            moved = np.linalg.norm(positions - start, axis=1) > DIAMETER
            if cavity is None and moved.any():
                cavity = grains.time
            if chimney is None and (moved & top & middle).any():
                chimney = grains.time
    weight = fraction * EXCESS * GRAVITY * DENSITY * height
    smooth = pressure.rolling(5, center=True).mean()
    return cavity, chimney, float(smooth.max() / weight), fraction, smooth / weight


def main():
    rows, answers, folders, curves = [], [], [], []
    for name, height in HEIGHTS.items():
        values = []
        for seed in (1, 2, 3):
            folder = run(f"chimney/{name}-{seed}", "chimney/case.json", {
                "grains.initial.growth.box.to": [2 * CENTRE, height],
                "grains.initial.growth.seed": seed,
            })
            folders.append(folder)
            cavity, chimney, pressure, fraction, course = onset(folder, height)
            curves += [(name, seed, SPEED * time / RAMP * SLOT / VISCOSITY, float(value)) for time, value in course.items() if value == value]
            reynolds = [SPEED * time / RAMP * SLOT / VISCOSITY if time is not None else float("nan") for time in (cavity, chimney)]
            values.append((*reynolds, pressure))
            rows.append((name, seed, height / DIAMETER, float(fraction), *map(float, values[-1])))
        for quantity, column in zip(("reynolds_cavity", "reynolds_chimney", "largest_overpressure_over_weight"), zip(*values)):
            answers.append((name, quantity, *map(float, interval(column))))
    table("chimney_runs", ["bed", "packing", "height_over_diameter", "solid_fraction", "reynolds_cavity", "reynolds_chimney", "largest_overpressure_over_weight"], rows)
    table("chimney_curves", ["bed", "packing", "reynolds", "overpressure_over_weight"], curves)
    note = f"Archimedes number {ARCHIMEDES:.1f}; Reynolds number Q/nu with the discharge Q of the slot per depth; processor time: {seconds(folders):.0f} s"
    table("chimney", ["bed", "quantity", "mean", "scatter", "half_width_95"], answers, note)


if __name__ == "__main__":
    main()
