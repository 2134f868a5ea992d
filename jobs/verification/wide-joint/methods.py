#!/usr/bin/env python3
"""Runs a block above a joint of 10 mm, periodic along the joint, by the network and by the lattice, on lattices with
several numbers of cells across the joint, and writes lift, push, moment and processor time of each run as CSV.

    python3 jobs/verification/wide-joint/methods.py SOLVER OUTPUT.csv [CELLS ...]

The reference is the lattice with the most cells. Processor time is that of the process, on one thread.
"""
import math
import os
import sys
import tempfile

import pools

LENGTH, WIDTH, POOL, BASE, TOP, END = 0.1, 0.0125, 0.03, 0.02, 0.03, 0.3


def run(solver, method, cells, folder):
    spacing = pools.APERTURE / cells
    # A power of two of cells would fit all heights; others are rounded to whole cells.
    width = math.ceil(WIDTH / spacing - 1e-9) * spacing
    length, pool, base, top = (round(size / spacing) * spacing for size in (LENGTH, POOL, BASE, TOP))
    sizes = (length, pool, width, base, base + pools.APERTURE + top)
    times = (2e-4 * (spacing / 0.0025) ** 2, 0.02, END / 60, END)
    scene = pools.case(method, spacing, sizes, times, max(0.005, spacing))
    name = os.path.join(folder, f"{method}-{cells}")
    (lift, push, moment), seconds = pools.run(solver, scene, name, ["force_z", "force_x", "torque_y"], 10)
    area = pools.PRESSURE * length * width
    return [lift / area, push / area, moment / (area * length)], seconds


def main():
    solver, output = sys.argv[1:3]
    cells = [int(text) for text in sys.argv[3:]] or [1, 2, 3, 4, 6, 8]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for number in cells:
            for method in ["network", "lattice"]:
                if method == "lattice" and number == 1:
                    continue
                rows.append((method, number, *run(solver, method, number, folder)))
                print(rows[-1], flush=True)
    reference = [row for row in rows if row[0] == "lattice"][-1][2]
    pools.write(output, ["lift", "push", "moment"], rows, reference, 2)


if __name__ == "__main__":
    main()
