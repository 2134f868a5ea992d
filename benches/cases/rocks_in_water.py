#!/usr/bin/env python3
"""Prints a case: 343 moving rocks of 14 corners in a periodic box of water, partially saturated cells, all rocks mapped anew in each step.

    python3 benches/cases/rocks_in_water.py > rocks.json; solver run rocks.json --threads 1
"""
import json
import math
import random

SIDE, ALONG, CORNERS, RADIUS = 0.0128, 7, 14, 8.9e-4
random.seed(3)


def rock():
    """Corners of a spiral on a sphere, somewhat out of place."""
    corners = []
    for k in range(CORNERS):
        z = 1 - (2 * k + 1) / CORNERS
        angle = 2.39996 * k + random.uniform(-0.2, 0.2)
        flat = math.sqrt(1 - z * z)
        out = RADIUS * random.uniform(0.85, 1)
        corners.append([round(out * x, 9) for x in (flat * math.cos(angle), flat * math.sin(angle), z)])
    return corners


def within(bound):
    """Three numbers between -bound and bound."""
    return [random.uniform(-bound, bound) for _ in range(3)]


blocks = [
    {
        "shape": {"vertices": rock()},
        "position": [(n + 0.5) * SIDE / ALONG for n in at],
        "orientation": {"axis": within(1), "angle_degrees": random.uniform(0, 180)},
        "velocity": within(0.02),
        "angular_velocity": within(20),
    }
    for at in ((i, j, k) for i in range(ALONG) for j in range(ALONG) for k in range(ALONG))
]
print(json.dumps({
    "title": "343 moving rocks in a periodic box of water",
    "domain": {"size": [SIDE] * 3, "spacing": 1e-4, "periodic": ["x", "y", "z"]},
    "gravity": [0, 0, -9.81],
    "materials": {"rock": {"density": 2500}},
    "fluid": {"lattice_boltzmann": {
        "density": 1000, "kinematic_viscosity": 1e-5, "lattice": "d3q27", "collision": {"mrt": {}}, "relaxation_time": 0.65,
    }},
    "blocks": {"material": "rock", "initial": {"list": blocks}},
    "contact": {"blocks": {
        "normal_stiffness": {"per_contact": 100}, "normal_damping_ratio": 0.3, "friction_angle_degrees": 20,
    }},
    "coupling": {"partially_saturated": {}},
    "time": {"end": 5e-4},
    "checkpoint": {"every_wall_seconds": 0},
}))
