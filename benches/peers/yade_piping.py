# YADE, HydrodynamicsLawLBM: the piping paper's own engine at the paper's size, whole program steps (P-2).
#
#   NX=777 STEPS=100 RATIO=18 taskset -c 0 yade -n -x -j1 yade_piping.py
#
# Peer: YADE 2023.02a (Smilauer et al. 2021), Debian's package; the engine is that of Lomine, Scholtes, Sibille and Poullain
# (International Journal for Numerical and Analytical Methods in Geomechanics 37, 2013). 14 mm x 8 mm, chambers of 2 mm, a hole
# of 1.2 mm through bonded discs of 0.2 mm on a triangular lattice: 1,881 discs and, with NX = 777, 346,000 nodes; RATIO solid
# steps in a fluid step; the pressure difference DP (Pa) at once. What is timed is O.run: everything that the program does
# in STEPS fluid steps, without the first two. One JSON line: `mlups` counts all nodes, as the solver does.
import json
import os
import resource
import sys
import time

import numpy as np

get = os.environ.get
NX, STEPS, RATIO = int(get("NX", "777")), int(get("STEPS", "100")), int(get("RATIO", "18"))
DP, COHESION, TAU = float(get("DP", "0.5")), float(get("COHESION", "0.506")), 1.1
LX, LY, CHAMBER, HOLE, D = 0.014, 0.008, 0.002, 0.0012, 2e-4
DENSITY, STIFFNESS = 2650.0, 150e6

O.materials.append(FrictMat(young=150e6, poisson=0.4, frictionAngle=0.0, density=3000, label="walls"))
O.materials.append(
    CohFrictMat(young=150e6, poisson=0.4, frictionAngle=np.radians(20), density=DENSITY, isCohesive=True, normalCohesion=1e9,
                shearCohesion=1e9, momentRotationLaw=False, label="spheres"))

# Six thin walls round the box; the engine knows them by their order.
t = 1e-5
low, high = (1e-5, 1e-5, -0.002), (1e-5 + LX, 1e-5 + LY, 0.002)
cx, cy = (low[0] + high[0]) / 2, (low[1] + high[1]) / 2
wx, wy, wz = 1.001 * LX / 2 + t, 1.001 * LY / 2 + t, 0.002 * 1.001 + t
for centre, extents in (((cx, low[1] - t / 2, 0), (wx, t / 2, wz)), ((cx, high[1] + t / 2, 0), (wx, t / 2, wz)),
                        ((low[0] - t / 2, cy, 0), (t / 2, wy, wz)), ((high[0] + t / 2, cy, 0), (t / 2, wy, wz)),
                        ((cx, cy, -0.002 - t / 2), (wx, wy, t / 2)), ((cx, cy, 0.002 + t / 2), (wx, wy, t / 2))):
    O.bodies.append(utils.box(center=centre, extents=extents, fixed=True, material="walls"))

discs, row, pitch, y = 0, 0, 0.99999 * D, low[1] + D / 2
while y < high[1] - D / 2 + 1e-9:
    x = low[0] + CHAMBER + D / 2 + (row % 2) * pitch / 2
    while x < high[0] - CHAMBER - D / 2:
        if abs(y - cy) > HOLE / 2 + D / 2:
            O.bodies.append(utils.sphere((x, y, 0), D / 2, material="spheres"))
            discs += 1
        x += pitch
    y += pitch * np.sqrt(3) / 2
    row += 1
for body in O.bodies:
    if isinstance(body.shape, Sphere):
        r = body.shape.radius
        m = DENSITY * np.pi * r * r  # a cylinder of unit length
        body.state.mass, body.state.inertia, body.state.blockedDOFs = m, (m * r * r / 2,) * 3, "zXY"

strength = COHESION * D
contact = [
    Ip2_FrictMat_FrictMat_FrictPhys(kn=MatchMaker(algo="val", val=STIFFNESS * D), ks=MatchMaker(algo="val", val=0.4 * STIFFNESS * D)),
    Ip2_CohFrictMat_CohFrictMat_CohFrictPhys(setCohesionNow=True, setCohesionOnNewContacts=False, normalCohesion=MatchMaker(algo="val", val=strength),
                                             shearCohesion=MatchMaker(algo="val", val=strength)),
]
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb(), Bo1_Box_Aabb()]),
    InteractionLoop([Ig2_Sphere_Sphere_ScGeom6D(), Ig2_Box_Sphere_ScGeom6D()], contact,
                    [Law2_ScGeom_FrictPhys_CundallStrack(), Law2_ScGeom6D_CohFrictPhys_CohesionMoment()]),
    HydrodynamicsLawLBM(EngineIsActivated=True, WallYm_id=0, WallYp_id=1, WallXm_id=2, WallXp_id=3, WallZp_id=5, WallZm_id=4, useWallYm=1, useWallYp=1,
                        YmBCType=2, YpBCType=2, useWallXm=0, useWallXp=0, XmBCType=1, XpBCType=1, LBMSavedData="", tau=TAU, dP=(DP, 0, 0),
                        IterSave=10**9, IterPrint=10**6, RadFactor=0.8, Nx=NX, Rho=1000, Nu=1e-6, periodicity="", bc="", VbCutOff=0.0,
                        applyForcesAndTorques=True),
    NewtonIntegrator(damping=0.0, gravity=(0, 0, 0)),
]
dx = (LX + 2e-5) / NX
O.dt = 0.9999 * (TAU - 0.5) / 3 * dx * dx / 1e-6 / RATIO
O.run(2 * RATIO, True)
begin = time.perf_counter()
O.run(STEPS * RATIO, True)
seconds = time.perf_counter() - begin
nodes = (NX + 1) * (int(np.ceil(NX * LY / LX)) + 1)
fastest = max(b.state.vel.norm() for b in O.bodies)
print(json.dumps(dict(code="yade 2023.02a", nodes=nodes, discs=discs, steps=STEPS, solid_steps=RATIO, seconds=seconds,
                      mlups=nodes * STEPS / seconds / 1e6, fastest_disc=fastest, contacts=O.interactions.countReal(),
                      rss_bytes=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)))
sys.stdout.flush()
# YADE hangs or crashes at some exits.
os._exit(0)
