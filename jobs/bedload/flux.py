"""Means of bedload runs: height of the stream, Reynolds and Shields number, flux of grains over flux of water.

    python3 jobs/bedload/flux.py RUN FROM [RUN FROM ...] > flux.csv       FROM: start of the mean [s]; needs jobs/python

With h_f the height above the bed (probe `bed`), q_f the discharge per width (probe `stream`), q the bedload per width (probe `bed`, the volume of
the grains) and q_v the integral over height of the mean velocity of the grains in layers of half a diameter (files of grains), as in Biegert,
Vowinckel, Meiburg (J. Comput. Phys. 340 (2017) 105): Re = q_f/nu, Sh = 6 Re (d/h_f)^2/Ga^2. The bounds are the least and the largest mean of four equal parts of the
time; q_v has the files of the whole time.
"""

import json
import sys

import numpy as np
from solver_results import open_run

D, NU, S, G = 1.1e-3, 3.01e-4, 2.098, 9.81
GALILEO = np.sqrt((S - 1) * G * D**3) / NU


def row(folder, start):
    with open_run(folder) as run:
        bed, stream = run.probes["bed"], run.probes["stream"]
        with open(f"{folder}/case.json") as file:
            case = json.load(file)
        _, height, width = case["domain"]["size"]
        bed, stream = bed[bed.time >= start], stream[stream.time >= start]
        water = stream.discharge.to_numpy() / width
        flux = bed.bedload_flux.to_numpy()
        parts = [part.mean() / water.mean() for part in np.array_split(flux, 4)]
        depth = height - bed.surface_height.mean()
        reynolds = water.mean() / NU
        edges = np.arange(0, height, D / 2)
        layers = []
        for grains in run.grains:
            if grains.time < start:
                continue
            table = grains.table()
            place = np.digitize(table["y"], edges)
            speeds = [table["velocity_x"][place == k].mean() if (place == k).any() else 0.0 for k in range(1, len(edges))]
            layers.append(np.sum(speeds) * D / 2)
        shields = 6 * reynolds * (D / depth) ** 2 / GALILEO**2
        return [
            case["fluid"]["lattice_boltzmann"]["body_force"]["constant"][0], start, bed.time.iloc[-1], depth / D, reynolds, shields,
            flux.mean() / np.sqrt((S - 1) * G * D**3), flux.mean() / water.mean(), min(parts), max(parts), np.mean(layers) / water.mean(),
        ]


def main():
    print("force [N/m3],from [s],to [s],h_f/d,Re,Sh,dimensionless flux,q/q_f,q/q_f low,q/q_f high,q_v/q_f")
    for folder, start in zip(sys.argv[1::2], sys.argv[2::2]):
        print(",".join(f"{value:.4g}" for value in row(folder, float(start))))


main()
