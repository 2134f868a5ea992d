#!/usr/bin/env python3
"""LAMMPS and LIGGGHTS on the three scenes of spheres: particle-steps per second (P-7, P-10).

  grains.py --code lammps|liggghts --scene box|packed|cloud [--ranks N] [--cores 0] [--steps N] [--repeats N]

Peers: Debian's packages lammps and liggghts, run as they come; their own `Loop time` of the steps after a warm-up of
100. One JSON line a run. The scenes (SI, density 2600, friction 0.5, gravity 9.81, linear springs with history, k_n = k_t):

  box     box_packed: 100,000 spheres, periodic in x and y, floor; k 1e3, dt 1e-5, damping 8e3 1/s
  packed  fissure_packed: 47,702 spheres in the V; k 1e3, dt 3e-6, damping 1e4 1/s
  cloud   fissure_cloud: the same falling at 0.5 m/s, no contact yet; k 1e6, dt 2e-7, damping 3.2e5 1/s

The V: planes through x = +-0.004, z = 0.01 with slope dx/dz = +-0.42, floor z = 0.01, ends y = 0 and 0.2 m.
`benches/dem.rs` has the same numbers.
"""
import argparse
import json
import os
import re
import subprocess
import tempfile

import states

HERE = os.path.dirname(os.path.abspath(__file__))
BOX = (0, 0.2, 0, 0.2, 0, 0.06)
FISSURE = (-0.04, 0.04, 0, 0.2, 0, 0.12)
SCENES = {
    "box": dict(state="box_packed", box=BOX, case="box", kn="1e3", dt="1e-5", gn="8e3", skin="0.0004", vel="0"),
    "packed": dict(state="fissure_packed", box=FISSURE, case="fissure", kn="1e3", dt="3e-6", gn="1e4", skin="0.0003", vel="0"),
    "cloud": dict(state="fissure_cloud", box=FISSURE, case="fissure", kn="1e6", dt="2e-7", gn="3.2e5", skin="0.0003", vel="-0.5"),
}


def write_data(scene, path):
    """The state as a data file of LAMMPS (atom_style sphere)."""
    rows = states.load(scene["state"])
    b = scene["box"]
    with open(path, "w") as f:
        f.write(f"# {scene['state']}\n\n{len(rows)} atoms\n1 atom types\n")
        for low, high, axis in zip(b[::2], b[1::2], "xyz"):
            f.write(f"{low} {high} {axis}lo {axis}hi\n")
        f.write("\nAtoms\n\n")
        for k, (x, y, z, r) in enumerate(rows, 1):
            f.write(f"{k} 1 {2 * r:.9e} 2600 {x:.9e} {y:.9e} {z:.9e}\n")


def write_stl(path):
    """The V as triangles."""
    def half(z):
        return 0.004 + 0.42 * (z - 0.01)
    quads = [[(s * half(0.01), -0.05, 0.01), (s * half(0.01), 0.25, 0.01), (s * half(0.12), 0.25, 0.12), (s * half(0.12), -0.05, 0.12)] for s in (-1, 1)]
    quads.append([(-0.004, -0.05, 0.01), (0.004, -0.05, 0.01), (0.004, 0.25, 0.01), (-0.004, 0.25, 0.01)])
    with open(path, "w") as f:
        f.write("solid v\n")
        for a, b, c, d in quads:
            for triangle in ((a, b, c), (a, c, d)):
                f.write("facet normal 0 0 0\nouter loop\n" + "".join("vertex %g %g %g\n" % v for v in triangle) + "endloop\nendfacet\n")
        f.write("endsolid v\n")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--code", choices=["lammps", "liggghts"], required=True)
    p.add_argument("--scene", choices=list(SCENES), required=True)
    p.add_argument("--ranks", type=int, default=1)
    p.add_argument("--cores", default="0", help="for taskset")
    p.add_argument("--steps", type=int, default=300)
    p.add_argument("--repeats", type=int, default=1)
    a = p.parse_args()
    scene = SCENES[a.scene]
    with tempfile.TemporaryDirectory() as work:
        write_data(scene, f"{work}/state.data")
        write_stl(f"{work}/fissure.stl")
        command = ["taskset", "-c", a.cores]
        if a.ranks > 1:
            command += ["mpirun", "--oversubscribe", "--bind-to", "none", "-np", str(a.ranks)]
        if a.code == "lammps":
            command += ["lmp", "-in", f"{HERE}/lammps_grains.in", "-log", "run.log", "-screen", "none"]
        else:
            command += ["liggghts", "-in", f"{HERE}/liggghts_grains.in", "-log", "run.log"]
        values = {name: scene[name] for name in ("case", "kn", "dt", "gn", "vel", "skin")}
        values["fissure"] = int(scene["case"] == "fissure")
        for name, value in dict(values, data="state.data", warm=100, steps=a.steps).items():
            command += ["-var", name, str(value)]
        environment = dict(os.environ, OMP_NUM_THREADS="1", OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                           OMPI_MCA_btl_vader_single_copy_mechanism="none")
        for repeat in range(a.repeats):
            run = subprocess.run(command, cwd=work, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            with open(f"{work}/run.log") as f:
                loops = re.findall(r"Loop time of (\S+) on (\d+) procs for (\d+) steps with (\d+) atoms", f.read())
            if run.returncode or len(loops) != 2:
                raise SystemExit(f"grains: {a.code} failed: {run.stdout[-400:]}")
            seconds, ranks, steps, grains = float(loops[1][0]), int(loops[1][1]), int(loops[1][2]), int(loops[1][3])
            print(json.dumps(dict(code=a.code, scene=a.scene, ranks=ranks, repeat=repeat, grains=grains, steps=steps, seconds=seconds,
                                  particle_steps_per_second=grains * steps / seconds)), flush=True)


if __name__ == "__main__":
    main()
