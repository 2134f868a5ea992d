"""Draws the viscous flux of grains over the Shields number beside experiments and a law with a threshold.

    python3 jobs/bedload/draw.py      reads results/shields.csv and results/flux.csv, writes results/shields.svg; needs matplotlib

The curve is A Sh_c [Sh/(2 Sh_c) (Sh²/Sh_c² + 1/5) - 3/5], for a bed with Coulomb friction under a viscous stream (after Ouriemi, Aussillous, Guazzelli, J. Fluid Mech.
636 (2009) 295), with A and the threshold Sh_c fitted to the logarithms of the runs with 5 cells per diameter from 1 s on and Sh above 0.14.
"""

import csv
from pathlib import Path

import matplotlib

matplotlib.use("svg")
import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import least_squares

RESULTS = Path(__file__).parent / "results"
# Aussillous et al. 2013: Shields number, h_f/d, least and largest q_v/q_f.
EXPERIMENTS = [(0.24, 7.05, 0.005, 0.019), (0.24, 8.15, 0.005, 0.016), (0.35, 11.27, 0.0052, 0.0089), (0.37, 10.29, 0.0049, 0.0115)]


def rows(name):
    with open(RESULTS / name) as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def columns(rows, *names):
    return [np.array([float(row[name]) for row in rows]) for name in names]


def law(shields, scale, threshold):
    return scale * threshold * (shields / (2 * threshold) * (shields**2 / threshold**2 + 0.2) - 0.6)


def main():
    runs = rows("shields.csv")
    figure, axes = plt.subplots(figsize=(6.4, 4.6))
    for cells, start, mark, label in [(5, 1.0, "o", "5 cells per diameter, 1 to 1.8 s"), (5, 0.5, "x", "5 cells, 0.5 to 1 s"), (7, 0.5, "s", "7 cells, 0.5 to 1 s")]:
        some = [row for row in runs if round(float(row["cells per diameter"])) == cells and float(row["from [s]"]) == start]
        shields, flux, low, high = columns(some, "Sh", "viscous flux", "viscous flux low", "viscous flux high")
        axes.errorbar(shields, flux, [flux - low, high - flux], fmt=mark, label=label, markersize=5, linewidth=1)
        if (cells, start) == (5, 1.0):
            far = shields > 0.14
            fit = least_squares(lambda p: np.log(np.maximum(law(shields[far], *p), 1e-12) / flux[far]), [0.03, 0.11]).x
    print(f"A {fit[0]:.4f}, threshold {fit[1]:.4f}")
    for low in (0.18, 0.25):
        for start in (0.5, 1.0):
            some = [row for row in runs if float(row["cells per diameter"]) < 6 and float(row["from [s]"]) == start and float(row["Sh"]) > low]
            shields, flux = columns(some, "Sh", "viscous flux")
            print(f"exponent of the means from {start} s on, Sh above {low}: {np.polyfit(np.log(shields), np.log(flux), 1)[0]:.2f}")
    shields = np.linspace(fit[1] * 1.02, 0.6, 200)
    axes.plot(shields, law(shields, *fit), "k-", linewidth=1, label=f"law with a threshold of {fit[1]:.3f}")
    shields, flux = columns(rows("flux.csv"), "Sh", "viscous flux")
    axes.plot(shields, flux, "^", color="grey", markersize=5, label="in oil, 4 cells (README)")
    for n, (shields, depth, low, high) in enumerate(EXPERIMENTS):
        scale = shields * depth**2 / 6
        axes.plot([shields * (1 + 0.01 * n)] * 2, [low * scale, high * scale], "r-", linewidth=3, alpha=0.5, label=None if n else "experiments, least to largest")
    axes.set(xscale="log", yscale="log", xlim=(0.1, 0.6), ylim=(3e-4, 0.3), xlabel="Shields number", ylabel="viscous flux  q ν / ((s - 1) g d³)")
    axes.set_xticks([0.1, 0.2, 0.3, 0.4, 0.6], ["0.1", "0.2", "0.3", "0.4", "0.6"])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(RESULTS / "shields.svg", metadata={"Date": None})


main()
