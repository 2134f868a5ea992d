#!/usr/bin/env python3
"""lbmpy: a bare collide-and-stream kernel in place (AA pattern), million lattice updates per second (P-1; also P-3 to P-5).

  OMP_NUM_THREADS=1 taskset -c 0 lbmpy_kernel.py --stencil D2Q9 --method srt --n 2400
  ... --stencil D3Q27 --method mrt_raw|central --n 200 [--sgs smagorinsky] [--force] [--precision mixed]

Peer: lbmpy 2.0 and pystencils 2.0 (Bauer, Koestler, Ruede, Journal of Computational Science 49, 2021), from PyPI. What
is timed is only the generated kernel over all cells, without boundaries, with the placement that suits it best: structure
of arrays, rows aligned to 64 bytes, huge pages, vectors as wide as the processor has. One JSON line: `mlups` [median, least,
most] of the repeats by the clock.
"""
import argparse
import json
import math
import mmap
import os
import statistics
import time

import numpy as np
from lbmpy import LBMConfig, LBMOptimisation, LBStencil, Method, Stencil, create_lb_ast, create_lb_update_rule
from lbmpy.advanced_streaming.utility import Timestep
from lbmpy.enums import ForceModel, SubgridScaleModel
from pystencils import Assignment, CreateKernelConfig, Field, Target, create_kernel, tcast

METHODS = {"srt": Method.SRT, "mrt_raw": Method.MRT_RAW, "central": Method.CENTRAL_MOMENT, "cumulant": Method.CUMULANT}


def vectors(longest):
    """The widest vectors of this processor, or those of AVX2."""
    with open("/proc/cpuinfo") as f:
        flags = next((line for line in f if line.startswith("flags")), "").split()
    if "avx512f" in flags and longest:
        return Target.X86_AVX512
    if "avx2" in flags:
        return Target.X86_AVX
    return Target.X86_SSE


def allocate(cells, count, number, keep):
    """Structure of arrays with one ghost layer; the first inner cell of a row is aligned to 64 bytes."""
    size = np.dtype(number).itemsize
    line = 64 // size
    shape = [-(-(cells[0] + 2) // line) * line] + [n + 2 for n in cells[1:]]
    stride = int(np.prod(shape)) * size
    area = mmap.mmap(-1, stride * count + (4 << 20), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    area.madvise(mmap.MADV_HUGEPAGE)
    keep.append(area)
    raw = np.frombuffer(area, np.uint8)
    start = (-raw.ctypes.data) % (2 << 20) + 64 - size
    flat = raw[start:start + stride * count].view(number)
    flat[:] = 0
    strides = [size * int(np.prod(shape[:k])) for k in range(len(cells))] + [stride]
    return np.lib.stride_tricks.as_strided(flat, tuple(n + 2 for n in cells) + (count,), tuple(strides))


def in_double(rule):
    """The same rule for a field of floats: each number is widened where it is read and narrowed where it is written."""

    def widened(assignment):
        wide = {access: tcast(access, "float64") for access in assignment.rhs.atoms(Field.Access)}
        rhs = assignment.rhs.xreplace(wide)
        return Assignment(assignment.lhs, tcast(rhs, "float32") if isinstance(assignment.lhs, Field.Access) else rhs)

    return rule.copy([widened(a) for a in rule.main_assignments], [widened(a) for a in rule.subexpressions])


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--stencil", default="D2Q9")
    p.add_argument("--method", default="srt", choices=list(METHODS))
    p.add_argument("--precision", default="double", choices=["double", "single", "mixed"], help="mixed: float at rest, double arithmetic")
    p.add_argument("--n", default="2400", help="cells along an edge, or AxB[xC]")
    p.add_argument("--sgs", choices=["smagorinsky"])
    p.add_argument("--force", action="store_true", help="constant, after Guo")
    p.add_argument("--compressible", action="store_true", help="equilibrium of momentum over density, as the solver has it; else of momentum, without a division")
    p.add_argument("--rates", choices=["one", "many"], default="one",
                   help="one: the shear stress has a rate, all higher moments get 1 and are not needed; many: each has a rate of its own (D3Q27)")
    p.add_argument("--vectors", choices=["longest", "avx2"], default="longest", help="longest: as wide as the processor has")
    p.add_argument("--repeats", type=int, default=7)
    p.add_argument("--seconds", type=float, default=0.5, help="of each repeat")
    a = p.parse_args()

    stencil = LBStencil(Stencil[a.stencil])
    cells = [int(word) for word in a.n.split("x")]
    cells = cells * stencil.D if len(cells) == 1 else cells
    number = np.float64 if a.precision == "double" else np.float32
    keep = []
    populations = allocate(cells, stencil.Q, number, keep)
    field = Field.create_from_numpy_array("src", populations, index_dimensions=1)
    options = {"relaxation_rate": 1.7}
    if a.rates == "many":
        # Density and momentum, six second moments, the others as Suga et al. (2015) choose them.
        higher = [1.5, 1.5, 1.5, 1.83, 1.83, 1.83, 1.4, 1.61, 1.98, 1.98, 1.98, 1.98, 1.98, 1.74, 1.74, 1.74, 1.74]
        options = {"relaxation_rates": [0.0] * 4 + [1.7] * 5 + [1.54] + higher}
    if a.sgs:
        options["subgrid_scale_model"] = SubgridScaleModel[a.sgs.upper()]
    if a.force:
        options.update(force_model=ForceModel.GUO, force=(1e-6,) + (0,) * (stencil.D - 1))
    target = vectors(a.vectors == "longest")
    config = CreateKernelConfig(target=target, default_dtype="float32" if a.precision == "single" else "float64")
    config.cpu.openmp.enable = True
    config.cpu.vectorize.enable = True
    config.cpu.vectorize.assume_inner_stride_one = True
    config.cpu.vectorize.assume_aligned = True
    kernels = []
    for parity in (Timestep.EVEN, Timestep.ODD):
        method = LBMConfig(stencil=stencil, method=METHODS[a.method], compressible=a.compressible or a.method in ("central", "cumulant"), streaming_pattern="aa",
                           timestep=parity, zero_centered=True, **options)
        options_of_field = LBMOptimisation(symbolic_field=field)
        if a.precision == "mixed":
            rule = in_double(create_lb_update_rule(lbm_config=method, lbm_optimisation=options_of_field, config=config))
            kernels.append(create_kernel(rule, config=config).compile())
        else:
            kernels.append(create_lb_ast(lbm_config=method, lbm_optimisation=options_of_field, config=config).compile())
    noise = np.random.default_rng(0)
    for q in range(stencil.Q):
        populations[..., q] = 1e-5 * noise.standard_normal(populations.shape[:-1])

    def run(steps):
        begin = time.perf_counter()
        for k in range(steps):
            kernels[k & 1](src=populations)
        return time.perf_counter() - begin

    run(4)
    steps = max(2, int(a.seconds / (run(2) / 2)) // 2 * 2)
    rates = [math.prod(cells) * steps / run(steps) * 1e-6 for _ in range(a.repeats)]
    if not np.isfinite(populations).all():
        raise SystemExit("lbmpy_kernel: the populations are not finite")
    print(json.dumps(dict(code="lbmpy 2.0", stencil=a.stencil, method=a.method, precision=a.precision, n=cells, vectors=target.name,
                          threads=int(os.environ.get("OMP_NUM_THREADS", "0")), bytes_per_update=2 * stencil.Q * np.dtype(number).itemsize,
                          mlups=[round(x, 2) for x in (statistics.median(rates), min(rates), max(rates))])))


if __name__ == "__main__":
    main()
