# YADE polyhedra: a pile of random convex blocks in a box (P-8).
#
#   PILE=pile.json SETTLE=100 STEPS=100 taskset -c 0 yade -n -x -j1 yade_blocks.py
#
# Peer: YADE 2023.02a (Smilauer et al. 2021), Debian's package; its polyhedra (J. Elias, Powder Technology 264, 2014) take the volume
# of the overlap by CGAL as measure of contact. Blocks of 4 cm lie in a box of 0.3 m as PILE has them: a list of blocks, each the list
# of its vertices in space (m), as `cargo bench --bench blocks -- pile BLOCKS STEPS FILE` writes it. SETTLE steps bring forth the
# peer's own contacts; what is timed is O.run over STEPS steps, three times. One JSON line: `contacts_per_second` counts the contacts
# that touch times steps over the median of the processor times.
import json
import os
import resource
import sys

import numpy as np
from yade import polyhedra_utils, utils

get = os.environ.get
SETTLE, STEPS = int(get("SETTLE", "100")), int(get("STEPS", "100"))
WIDTH = 0.30
with open(os.environ["PILE"]) as file:
    pile = json.load(file)

material = PolyhedraMat(young=1e8, poisson=0.2, frictionAngle=np.arctan(0.5), density=2600.0)
O.materials.append(material)
for axis, sense, at in ((2, 1, 0), (0, 1, 0), (0, -1, WIDTH), (1, 1, 0), (1, -1, WIDTH)):
    O.bodies.append(utils.wall(at, axis=axis, sense=sense, material=material))
for vertices in pile:
    O.bodies.append(polyhedra_utils.polyhedra(material, v=vertices))
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
    "blocks": len(pile),
}))
sys.stdout.flush()
os._exit(0)
