#!/usr/bin/env python3
"""Compares the network of joints on coarse cells with lattices that resolve the joint: a block above a joint of 10 mm and
0.32 m, periodic along the joint, between two pools. Writes lift, moment and cost of each run as CSV.

    python3 jobs/verification/wide-joint/coarse.py SOLVER OUTPUT.csv [CELLS ...]

CELLS are the cells across the joint, by default 1/4, 1/2 and 1 for the network and 2, 3 and 4 for the lattice. The cost
is processor time of the steps, for a joint 0.08 m wide: the flow does not depend on that direction, so that finer
lattices have fewer cells across it and their time is multiplied by the ratio. The reference is the lattice with the most
cells; the moment is that of the pressures and of the friction about the middle of the block.
"""
import math
import os
import sys
import tempfile

import pools

LENGTH, WIDTH, POOL, BASE, HEIGHT, END = 0.32, 0.08, 0.08, 0.04, 0.12, 2.4
# Time step with one cell across the joint [s]: the numbers of steps and of cells along an axis grow together.
STEP = 3.2e-3
# Length of the runs whose time counts on coarse lattices, divided by that of the others.
LONGER = 10


def run(solver, method, cells, folder, end):
    """Runs a case to this time; returns its loads, its processor time [s] and the ratio of the widths."""
    spacing = pools.APERTURE / cells
    rows = min(round(WIDTH / spacing), math.ceil(2.5 * cells - 1e-9)) if cells > 1 else round(WIDTH / spacing)
    width = rows * spacing
    times = (STEP / cells, 0.8, END / 25, end)
    scene = pools.case(method, spacing, (LENGTH, POOL, width, BASE, HEIGHT), times, max(0.01, spacing))
    scene["checkpoint"] = {"every": end}
    name = os.path.join(folder, f"{method}-{cells}-{end:g}")
    (lift, moment), seconds = pools.run(solver, scene, name, ["force_z", "torque_y"], 5)
    area = pools.PRESSURE * LENGTH * width
    return [lift / area, moment / (area * LENGTH)], seconds, WIDTH / width


def main():
    solver, output = sys.argv[1:3]
    chosen = [float(text) for text in sys.argv[3:]] or [0.25, 0.5, 1, 2, 3, 4]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for cells in chosen:
            method = "network" if cells <= 1 else "lattice"
            loads, once, wider = run(solver, method, cells, folder, END)
            # The start of the program does not count; runs of milliseconds are compared with longer ones.
            other = END * (LONGER if cells <= 2 else 0.1)
            seconds = (run(solver, method, cells, folder, other)[1] - once) / (other - END) * END
            rows.append((method, cells, loads, wider * seconds))
            print(rows[-1], flush=True)
    pools.write(output, ["lift", "moment"], rows, rows[-1][2], 4)


if __name__ == "__main__":
    main()
