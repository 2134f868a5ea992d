#!/usr/bin/env python3
"""waLBerla beside the solver: nanoseconds per cell of water of a standing wave (P-14), updates per second of wet spheres (P-6).

  walberla.py wave BINARY --cells 96x96x48 --box 1.25 [--blocks 2x1x2] [--steps N] [--core 0]
  walberla.py spheres BINARY [--steps N] [--core 0]
  walberla.py case --cells 96x96x48 --box 1.25 [--steps N] [--operator bgk]

waLBerla (https://walberla.net, GPL) is compiled by its user, in double precision for this processor; nothing of it is here but the
names of its parameters. BINARY of `wave` is the showcase GravityWave, of which the code must read the height of its box from the
parameter `domainHeight` and, in three dimensions (lattice D3Q19), the third size from `domainDepthZ`. BINARY of `spheres` is the
showcase FluidizedBedPSM as it is.

`wave` is timed by waLBerla's own performance logger, after WARM steps, `spheres` by its table of times. One JSON line each.
`case` prints the same wave for the solver.
"""
import argparse
import json
import math
import os
import re
import subprocess
import tempfile

# Cells of 2 mm, a time step of 5e-5 s, a viscosity of 2e-4 m2/s; the amplitude is a twentieth of the depth.
SPACING, STEP, VISCOSITY, GRAVITY, AMPLITUDE = 0.002, 5e-5, 2e-4, 9.81, 1 / 20
WARM = 10


def text(value, depth=0):
    """A block of a parameter file."""
    pad = "   " * depth
    lines = []
    for key, one in value.items():
        for item in one if isinstance(one, list) else [one]:
            if isinstance(item, dict):
                lines += [f"{pad}{key}", f"{pad}{{", *text(item, depth + 1), f"{pad}}}"]
            else:
                lines.append(f"{pad}{key} {vector(item)};")
    return lines


def vector(value):
    return f"< {', '.join(map(str, value))} >" if isinstance(value, tuple) else str(value).lower() if isinstance(value, bool) else str(value)


def run(binary, blocks, core):
    """Runs a binary with these blocks of parameters and returns what it printed."""
    with tempfile.TemporaryDirectory() as work:
        with open(f"{work}/case.prm", "w") as f:
            f.write("\n".join(text(blocks)) + "\n")
        done = subprocess.run(["taskset", "-c", core, os.path.abspath(binary), "case.prm"], cwd=work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        raise SystemExit(f"walberla: {binary} failed: {done.stdout[-800:]}")
    return done.stdout


def wave(a):
    along, depth = a.cells[0], a.cells[-1]
    height = round(depth * a.box)
    across = a.cells[1] if len(a.cells) == 3 else 1
    # Its vertical is y, and it has the gravity from a Reynolds number of the wave.
    viscosity = VISCOSITY * STEP / SPACING**2
    gravity = GRAVITY * STEP**2 / SPACING
    amplitude = depth * AMPLITUDE
    number = 2 * math.pi / along
    frequency = math.sqrt(gravity * number * math.tanh(number * depth))
    split = a.blocks or (1, 1, 1)
    cells = (along, height, across)
    if any(n % k for n, k in zip(cells, split)):
        raise SystemExit(f"walberla: {split} blocks do not divide {cells} cells")
    log = run(a.binary, {
        "BlockForestParameters": {
            "cellsPerBlock": tuple(n // k for n, k in zip(cells, split)),
            "periodicity": (1, 0, 1),
            "loadBalancingFrequency": 0,
            "printLoadBalancingStatistics": False,
        },
        "DomainParameters": {
            "domainWidth": along, "domainHeight": height, "domainDepthZ": across,
            "liquidDepth": depth, "initialAmplitude": amplitude,
        },
        "PhysicsParameters": {
            "reynoldsNumber": f"{frequency * along * amplitude / viscosity:.12g}",
            "relaxationRate": f"{1 / (0.5 + 3 * viscosity):.12g}",
            "enableWetting": False, "contactAngle": 0, "timesteps": WARM + a.steps + 1,
        },
        "ModelParameters": {
            "pdfReconstructionModel": "OnlyMissing", "pdfRefillingModel": "EquilibriumRefilling",
            "excessMassDistributionModel": a.excess, "curvatureModel": a.curvature,
            "useSimpleMassExchange": a.simple, "cellConversionThreshold": 1e-2, "cellConversionForceThreshold": 1e-1,
            "enableBubbleModel": False, "enableBubbleSplits": False,
        },
        "EvaluationParameters": {"performanceLogFrequency": WARM, "evaluationFrequency": 10**9, "filename": "wave.txt"},
        "BoundaryParameters": {"Border": [{"direction": side, "walldistance": -1, "NoSlip": {}} for side in "NS"]},
        "MeshOutputParameters": {"writeFrequency": 0, "baseFolder": "mesh"},
        "VTK": {},
    }, a.core)
    if a.log:
        open(a.log, "w").write(log)
    times = [float(t) for t in re.findall(r"- time:\s+(\S+) sec", log)]
    found = {int(n) for n in re.findall(r"- cells:\s+(\d+)", log)}
    if found != {math.prod(cells)}:
        raise SystemExit(f"walberla: {a.binary} has {found} cells, not {math.prod(cells)}: does it read domainHeight and domainDepthZ?")
    if len(times) != 1 + a.steps // WARM:
        raise SystemExit(f"walberla: {len(times)} times in the log of {a.binary}")
    seconds = sum(times[1:])
    return dict(scene="wave", cells=list(cells), steps=a.steps, seconds=seconds, ns_per_water_cell=seconds / a.steps / math.prod(a.cells) * 1e9)


def case(cells, box, steps, operator=None):
    """The same wave as a case of the solver."""
    up = len(cells) - 1
    size = [n * SPACING for n in cells]
    level = size[up]
    size[up] = round(cells[up] * box) * SPACING
    water = {"wave": {"level": level, "amplitude": level * AMPLITUDE, "axis": "x"}}
    fluid = {"density": 1000, "kinematic_viscosity": VISCOSITY, "time_step": STEP, "surface": {"water": [water]}}
    if operator:
        fluid["collision"] = {operator: {}}
    return {
        "domain": {"size": size, "spacing": SPACING, "periodic": ["x", "y"][:up]},
        "gravity": [0] * up + [-GRAVITY],
        "fluid": {"lattice_boltzmann": fluid},
        "time": {"end": steps * STEP},
    }


def spheres(a):
    # 128^3 cells, 343 spheres of 16 cells, as in cases/spheres_in_water.json; the inflow that it needs is slow.
    spacing, step, inflow = 1e-4, 5e-5, 0.001
    log = run(a.binary, {
        "PhysicalSetup": {
            "xSize": 0.0128, "ySize": 0.0128, "zSize": 0.0128, "periodicInX": True, "periodicInY": True, "runtime": f"{(a.steps - 0.5) * step:.6g}",
            "uInflow": inflow * spacing / step, "gravitationalAcceleration": GRAVITY, "kinematicViscosityFluid": 1e-5, "densityFluid": 1000,
            "particleDiameter": 0.0016, "densityParticle": 2500, "dynamicFrictionCoefficient": 0.364, "coefficientOfRestitution": 0.4,
            "particleGenerationSpacing": 0.001828,
        },
        "NumericalSetup": {
            "dx": spacing, "uInflow": inflow, "numXBlocks": 1, "numYBlocks": 1, "numZBlocks": 1, "useLubricationForces": False,
            "numberOfParticleSubCycles": 2,
        },
        "Output": {"infoSpacing": 1e9, "vtkSpacingParticles": 0, "vtkSpacingFluid": 0, "vtkFolder": "vtk"},
    }, a.core)
    if a.log:
        open(a.log, "w").write(log)
    count = re.search(r"numParticles = (\d+)", log)
    if not count or int(count[1]) != 343:
        raise SystemExit(f"walberla: {a.binary} has {count and count[1]} spheres, not 343")
    # The table of all phases of its loop; the total is the second number of a line.
    table = re.findall(r"([^|\n]*?)\s*\|\s*[\d.]+%\s*\|\s*([\d.]+)\s*\|", log)
    seconds = sum(float(t) for name, t in table if "Evaluate infos" not in name)
    if not seconds:
        raise SystemExit(f"walberla: no times in the log of {a.binary}")
    return dict(scene="spheres", cells=[128] * 3, steps=a.steps, seconds=seconds, mlups=128**3 * a.steps / seconds / 1e6)


def size(words):
    return tuple(int(n) for n in words.split("x"))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("scene", choices=["wave", "spheres", "case"])
    p.add_argument("binary", nargs="?")
    p.add_argument("--cells", type=size, default=(768, 384), help="of the water")
    p.add_argument("--box", type=float, default=1.25, help="height of the box over the depth")
    p.add_argument("--blocks", type=size, help="blocks along the wave, upwards, across")
    p.add_argument("--steps", type=int, default=100)
    p.add_argument("--operator", help="of the solver; default: its own")
    p.add_argument("--core", default="0", help="for taskset")
    p.add_argument("--excess", default="EvenlyAllInterface", help="its model for the excess mass")
    p.add_argument("--curvature", default="SimpleFiniteDifferenceMethod", help="its model for curvatures: without surface tension only that of the normals")
    p.add_argument("--simple", action="store_true", help="its simple exchange of mass, without the special cases of stray cells")
    p.add_argument("--log", help="file for what it prints")
    a = p.parse_args()
    if a.scene == "case":
        print(json.dumps(case(a.cells, a.box, a.steps, a.operator)))
    elif not a.binary:
        p.error("no binary")
    else:
        print(json.dumps({"wave": wave, "spheres": spheres}[a.scene](a)), flush=True)


if __name__ == "__main__":
    main()
