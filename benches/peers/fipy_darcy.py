#!/usr/bin/env python3
"""FiPy: the seepage of the fissure paper, div(K/(mu eps) grad p) = 0, assembled, solved and differentiated (P-9).

  FIPY_SOLVERS=scipy OMP_NUM_THREADS=1 fipy_darcy.py --cells 6x20x6|60x200x60 [--tolerance 1e-8] [--repeats 3]

Peer: FiPy (Guyer, Wheeler, Warren, Computing in Science & Engineering 11, 2009), from PyPI, the paper's own solver, with
conjugate gradients to a residual of `tolerance` times the right side. A box of 0.06 x 0.2 x 0.06 m, porosity and permeability
as `benches/darcy.rs` has them, 1000 Pa on top, 0 on two windows of the slot in the floor. The mesh and the fields are made
before the clock starts; each repeat starts from p = 0. One JSON line: seconds [median, least, most], the flow through the
windows and the mean pressure, which `benches/darcy.rs` prints too.
"""
import argparse
import json
import statistics
import time

import fipy
import numpy as np
from fipy import CellVariable, DiffusionTerm, Grid3D, LinearPCGSolver


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--cells", default="6x20x6")
    p.add_argument("--tolerance", type=float, default=1e-8)
    p.add_argument("--repeats", type=int, default=3)
    a = p.parse_args()
    nx, ny, nz = (int(word) for word in a.cells.split("x"))
    mesh = Grid3D(nx=nx, ny=ny, nz=nz, Lx=0.06, Ly=0.2, Lz=0.06)
    x, y, z = (np.array(c) for c in mesh.cellCenters.value)
    viscosity, diameter = 0.1, 1.9e-3
    porosity = 0.40 + 0.05 * np.sin(2 * np.pi * x / 0.06) * np.cos(2 * np.pi * y / 0.2) + 0.05 * (z / 0.06 - 0.5)
    permeability = porosity**3 / (1 - porosity)**2 * diameter**2 / 180
    coefficient = CellVariable(mesh=mesh, value=permeability / (viscosity * porosity))
    fx, fy, fz = (np.array(c) for c in mesh.faceCenters.value)
    outside = mesh.exteriorFaces.value
    top = (np.abs(fz - 0.06) < 1e-9) & outside

    def window(x, y):
        return (np.abs(x - 0.03) < 0.01) & ((np.abs(y - 0.05) < 0.02) | (np.abs(y - 0.15) < 0.02))

    floor = (np.abs(fz) < 1e-9) & outside & window(fx, fy)

    def once():
        begin = time.perf_counter()
        pressure = CellVariable(mesh=mesh, value=0.0)
        pressure.constrain(1000.0, where=top)
        pressure.constrain(0.0, where=floor)
        equation = DiffusionTerm(coeff=coefficient.harmonicFaceValue)
        solver = LinearPCGSolver(tolerance=a.tolerance, iterations=20000)
        equation.solve(var=pressure, solver=solver)
        flux = -coefficient.value * np.array(pressure.grad.value)
        return time.perf_counter() - begin, np.array(pressure.value), flux

    once()
    took, pressure = [], None
    for _ in range(a.repeats):
        seconds, pressure, _ = once()
        took.append(seconds)
    dz = 0.06 / nz
    cells = (z < dz) & window(x, y)
    flow = float((coefficient.value * pressure / (dz / 2) * (0.06 / nx) * (0.2 / ny))[cells].sum())
    print(json.dumps(dict(code="fipy", version=fipy.__version__, cells=mesh.numberOfCells, tolerance=a.tolerance,
                          seconds=[statistics.median(took), min(took), max(took)], flow=flow, mean_pressure=float(pressure.mean()))))


if __name__ == "__main__":
    main()
