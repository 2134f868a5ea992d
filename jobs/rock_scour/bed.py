#!/usr/bin/env python3
"""Writes the case of a bed of blocks of 0.1 m with joints of 1 mm under a stream, to measure the cost of the joints.

    python3 jobs/rock_scour/bed.py none|top|all CASE.json [CELL]

The second word names the blocks that may move: none, the upper layer, or all but the lowest layer. CELL is the size of a
cell of the lattice [m], by default 0.02. The bed has 20 x 10 x 5 blocks.
"""
import json
import sys

BLOCK, GAP, COUNTS, DEPTH, STEPS, STEP = 0.1, 1e-3, (20, 10, 5), 0.5, 40, 1e-4


def case(free, cell):
    size = [count * BLOCK for count in COUNTS]
    blocks = []
    for place in ((i, j, k) for i in range(COUNTS[0]) for j in range(COUNTS[1]) for k in range(COUNTS[2])):
        low = [n * BLOCK + (GAP / 2 if n > 0 else 0) for n in place]
        high = [(n + 1) * BLOCK - (GAP / 2 if n < count - 1 else 0) for n, count in zip(place, COUNTS)]
        blocks.append({"shape": {"cuboid": {"edges": [b - a for a, b in zip(low, high)]}},
                       "position": [(a + b) / 2 for a, b in zip(low, high)]})
    fixed = {"none": size[2], "top": size[2] - BLOCK, "all": BLOCK}[free]
    pressure = {"pressure": {"value": 400, "ramp": {"duration": 0.01}}}
    return {
        "domain": {"size": [size[0], size[1], size[2] + DEPTH], "spacing": cell},
        "gravity": [0, 0, -9.81],
        "materials": {"rock": {"density": 2650}},
        "blocks": {"material": "rock", "initial": {"list": blocks},
                   "fixed": [{"from": [0, 0, 0], "to": [size[0], size[1], fixed]}]},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e7}, "friction_angle_degrees": 35,
                               "normal_damping_ratio": 0.3}},
        "coupling": {"bounce_back": {}},
        "fluid": {"lattice_boltzmann": {
            "density": 1000, "kinematic_viscosity": 0.05, "time_step": STEP, "collision": {"trt": {}},
            "boundaries": [{"name": "left", "face": "x_min", "condition": pressure},
                           {"name": "right", "face": "x_max", "condition": {"pressure": {"value": 0}}}],
            "joints": {"largest_aperture": 0.005, "residual_aperture": 2e-4, "cell": BLOCK}}},
        "time": {"end": STEPS * STEP},
    }


if __name__ == "__main__":
    with open(sys.argv[2], "w") as file:
        json.dump(case(sys.argv[1], float(sys.argv[3]) if len(sys.argv) > 3 else 0.02), file)
