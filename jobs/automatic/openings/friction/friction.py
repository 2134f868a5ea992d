"""Friction factor of the turbulent duct of case.json on the grids of an estimate, beside Moody's value.

    solver estimate case.json --output DIR && python3 friction.py DIR >friction.csv

Darcy's factor f = 2 (p3 - p7) b/(L rho U²) from the mean pressures of two planes 4 widths apart, over the second half of the run, with the standard error of
four parts of it. The reference is Colebrook's equation for a smooth pipe of the hydraulic diameter at this Reynolds number.
"""

import csv
import math
import os
import sys


def column(folder, probe, name):
    with open(os.path.join(folder, f"probe_{probe}.csv")) as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    late = [row for row in rows if float(row["time"]) > 0.5 * float(rows[-1]["time"])]
    return [float(row[name]) for row in late]


def smooth(reynolds):
    f = 0.03
    for _ in range(50):
        f = (-2 * math.log10(2.51 / (reynolds * math.sqrt(f)))) ** -2
    return f


print("run,mean velocity [m/s],friction factor,standard error,Moody")
for run in sorted(os.listdir(sys.argv[1])):
    folder = os.path.join(sys.argv[1], run)
    if not os.path.exists(os.path.join(folder, "probe_p3.csv")):
        continue
    drop = [a - b for a, b in zip(column(folder, "p3", "mean_pressure"), column(folder, "p7", "mean_pressure"))]
    speeds = column(folder, "p7", "discharge")
    speed = sum(speeds) / len(speeds)
    factors = [2 * d / (4 * 1000 * speed**2) for d in drop]
    part = len(factors) // 4
    means = [sum(factors[part * k : part * (k + 1)]) / part for k in range(4)]
    mean = sum(means) / 4
    error = math.sqrt(sum((m - mean) ** 2 for m in means) / 3 / 4)
    print(f"{run},{speed:.4f},{mean:.4f},{error:.4f},{smooth(1e4 * speed):.4f}")
