# YADE polyhedra: a pile of random convex blocks in a box (P-8).
#
#   BLOCKS=1000 SETTLE=6000 STEPS=300 taskset -c 0 yade -n -x -j1 yade_blocks.py
#
# Peer: YADE 2023.02a (Smilauer et al. 2021), Debian's package; its polyhedra (J. Elias, Powder Technology 264, 2014) take the volume
# of the overlap by CGAL as measure of contact. Blocks of 4 cm fall from a lattice into a box of 0.3 m with a floor. What is timed
# is O.run over STEPS steps, three times after SETTLE steps. One JSON line: `contacts_per_second` counts the contacts that touch
# times steps over the median of the processor times.
import json
import os
import resource
import sys

import numpy as np
from yade import polyhedra_utils, utils

get = os.environ.get
BLOCKS, SETTLE, STEPS = int(get("BLOCKS", "1000")), int(get("SETTLE", "6000")), int(get("STEPS", "300"))
SIZE, WIDTH, ACROSS = 0.04, 0.30, 6
draw = np.random.default_rng(3)

material = PolyhedraMat(young=1e8, poisson=0.2, frictionAngle=np.arctan(0.5), density=2600.0)
O.materials.append(material)
for axis, sense, at in ((2, 1, 0), (0, 1, 0), (0, -1, WIDTH), (1, 1, 0), (1, -1, WIDTH)):
    O.bodies.append(utils.wall(at, axis=axis, sense=sense, material=material))
for n in range(BLOCKS):
    block = polyhedra_utils.polyhedra(material, size=(1.05 * SIZE,) * 3, seed=n + 1)
    column, row, layer = n % ACROSS, n // ACROSS % ACROSS, n // ACROSS**2
    block.state.pos = ((column + 0.5) * WIDTH / ACROSS, (row + 0.5) * WIDTH / ACROSS, SIZE * (0.65 + 1.25 * layer))
    axis = draw.normal(size=3)
    axis /= np.linalg.norm(axis)
    block.state.ori = Quaternion(Vector3(*map(float, axis)), float(draw.uniform(-0.17, 0.17)))
    O.bodies.append(block)
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Polyhedra_Aabb(), Bo1_Wall_Aabb()], verletDist=0.002),
    InteractionLoop([Ig2_Wall_Polyhedra_PolyhedraGeom(), Ig2_Polyhedra_Polyhedra_PolyhedraGeom()],
                    [Ip2_PolyhedraMat_PolyhedraMat_PolyhedraPhys()], [Law2_PolyhedraGeom_PolyhedraPhys_Volumetric()]),
    NewtonIntegrator(damping=0.4, gravity=(0, 0, -9.81), exactAsphericalRot=True),
]
O.dt = 1e-4


def processor_time():
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


O.run(SETTLE, True)
times = []
for _ in range(3):
    start = processor_time()
    O.run(STEPS, True)
    times.append(processor_time() - start)
contacts = O.interactions.countReal()
print(json.dumps({
    "contacts_per_second": contacts * STEPS / sorted(times)[1],
    "contacts": contacts,
    "tested": len(O.interactions),
    "kinetic_energy": utils.kineticEnergy(),
    "blocks": BLOCKS,
}))
sys.stdout.flush()
os._exit(0)
