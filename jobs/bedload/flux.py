"""Means of bedload runs: height of the stream, Reynolds and Shields number, flux of grains over flux of water.

    python3 jobs/bedload/flux.py RUN FROM [RUN FROM ...] > flux.csv       FROM: start of the mean [s]; needs jobs/python

With h_f the height above the bed (probe `bed`), q_f the discharge per width (probe `stream`), q the bedload per width (probe `bed`, the volume of
the grains) and q_v the integral over height of the mean velocity of the grains in layers of half a diameter (files of grains), as in Biegert,
Vowinckel, Meiburg (J. Comput. Phys. 340 (2017) 105): Re = q_f/nu, Sh = 6 Re (d/h_f)^2/Ga^2. The viscous flux is q nu/((s - 1) g d^3), the dimensionless
flux over Ga (Kidanemariam, Uhlmann, Int. J. Multiphase Flow 67 (2014) 174). The bounds are the least and the largest mean of four equal parts of the
time; q_v has the files of the whole time.

    python3 jobs/bedload/flux.py FROM TO RUN ...       with the end of the means, too, for runs of different length
"""

import json
import sys

import numpy as np
from solver_results import open_run

def parts_of(values):
    return [part.mean() for part in np.array_split(values, 4)]


def row(folder, start, end=np.inf):
    with open_run(folder) as run:
        bed, stream = run.probes["bed"], run.probes["stream"]
        with open(f"{folder}/case.json") as file:
            case = json.load(file)
        fluid = case["fluid"]["lattice_boltzmann"]
        viscosity, gravity = fluid["kinematic_viscosity"], abs(case["gravity"][1])
        excess = case["materials"]["glass"]["density"] / fluid["density"] - 1
        _, height, width = case["domain"]["size"]
        bed, stream = (table[(table.time >= start) & (table.time <= end)] for table in (bed, stream))
        diameter = bed.diameter.iloc[0]
        scale = np.sqrt(excess * gravity * diameter**3)
        galileo = scale / viscosity
        water = stream.discharge.to_numpy() / width
        flux = bed.bedload_flux.to_numpy()
        parts = [part / water.mean() for part in parts_of(flux)]
        depth = height - bed.surface_height.mean()
        reynolds = water.mean() / viscosity
        edges = np.arange(0, height, diameter / 2)
        layers = []
        for grains in run.grains:
            if not start <= grains.time <= end:
                continue
            table = grains.table()
            place = np.digitize(table["y"], edges)
            speeds = [table["velocity_x"][place == k].mean() if (place == k).any() else 0.0 for k in range(1, len(edges))]
            layers.append(np.sum(speeds) * diameter / 2)
        shields = 6 * reynolds * (diameter / depth) ** 2 / galileo**2
        viscous = [flux * viscosity / scale**2 for flux in [flux.mean(), *parts_of(flux)]]
        return [
            fluid["body_force"]["constant"][0], start, bed.time.iloc[-1], depth / diameter, reynolds, shields,
            flux.mean() / scale, flux.mean() / water.mean(), min(parts), max(parts), np.mean(layers) / water.mean(),
            galileo, viscous[0], min(viscous[1:]), max(viscous[1:]), diameter / case["domain"]["spacing"],
        ]


def main():
    print(
        "force [N/m3],from [s],to [s],h_f/d,Re,Sh,dimensionless flux,q/q_f,q/q_f low,q/q_f high,q_v/q_f,Ga,"
        "viscous flux,viscous flux low,viscous flux high,cells per diameter"
    )
    given = sys.argv[1:]
    try:
        start, end = float(given[0]), float(given[1])
        runs = [(run, start, end) for run in given[2:]]
    except ValueError:
        runs = [(run, float(start)) for run, start in zip(given[::2], given[1::2])]
    for run in runs:
        print(",".join(f"{value:.4g}" for value in row(*run)))


main()
