"""Writes the studies of narrow ways in 2-D and 3-D and of positions on the lattice.

    python3 benches/accuracy/ways.py && for s in ways-2d ways-3d positions; do solver sweep benches/accuracy/$s/study.json --output DIR; done

`ways-2d` has structures in channels and arrays, `ways-3d` spheres that nearly fill a duct, turned blocks close to their periodic images and
structures in ducts, `positions` discs of square arrays centred on a node, between nodes and at three drawn places. Lengths are multiples of 1 mm.
"""

import json
import os

HERE = os.path.dirname(os.path.abspath(__file__))
MM = 1e-3
# A bounce-back coupling as the plan chooses it, and the partially saturated one.
COUPLINGS = {
    "half-way": {"coupling": {"bounce_back": {"scheme": "half_way"}}},
    "interpolated": {"coupling": {"bounce_back": {"scheme": "interpolated", "drop_wall_velocity_at_solid_neighbours": 0}}},
    "matched": {"coupling": {"partially_saturated": {"solid_operator": "viscosity_matched"}}},
}
SPEED_OF_SOUND = 0.4


def case(dimension, force, end):
    every = {"every": end}
    return {
        "title": "Narrow ways",
        "domain": {"size": [MM] * dimension, "spacing": 5e-5, "periodic": ["x", "y", "z"][:dimension]},
        "materials": {"steel": {}},
        "fluid": {
            "lattice_boltzmann": {
                "density": 1000,
                "kinematic_viscosity": 1e-6,
                "collision": {"trt": {"magic": 0.1875}},
                "body_force": {"constant": [force] + [0] * (dimension - 1)},
                "time_step": 1e-5,
            }
        },
        "time": {"end": end},
        "probes": [{"name": "plane", **every, "at": {"plane": {"axis": "x", "position": 1e-6}}}],
    }


def fixed(shape, at, turn=None):
    found = {"name": "body", "shape": shape, "position": [x * MM for x in at], "motion": {"fixed": {}}, "material": "steel"}
    if turn:
        found["orientation"] = {"axis": turn[0], "angle_degrees": turn[1]}
    return found


def box(name, low, high):
    return {"name": name, "shape": {"box": {"from": [x * MM for x in low], "to": [x * MM for x in high]}}}


def problem(size, periodic, force, end, sound=SPEED_OF_SOUND, **solids):
    return {
        "domain.size": [x * MM for x in size],
        "domain.periodic": periodic,
        "fluid.lattice_boltzmann.body_force.constant": [force] + [0] * (len(size) - 1),
        "fluid.lattice_boltzmann.time_step": f"=domain.spacing/(3^0.5*{sound})",
        "time.end": end,
        "probes[0].every": end,
        **solids,
    }


def cells(counts):
    return {str(n): {"domain.spacing": f"=1e-3/{n}"} for n in counts}


def write(name, title, description, base, vary, more=None):
    study = {
        "title": title,
        "description": description,
        "case": base,
        "set": {"probes[0].at.plane.position": "=domain.spacing/2"},
        "vary": vary,
        "members": more or [],
        "outputs": {"Q": {"file": "probe_plane.csv", "of": "discharge"}},
        "cost": "processor_time",
        "refused": "run",
        "run": {"time_limit": 600},
    }
    with open(os.path.join(HERE, name, "study.json"), "w") as out:
        json.dump(study, out, indent=1)
        out.write("\n")


def ways_2d():
    serpentine = [box("a", [0.5, -1], [0.6, 0.67]), box("b", [1.5, 0.33], [1.6, 2])]
    orifice = [box("a", [0.93, -1], [1.05, 0.37]), box("b", [0.93, 0.63], [1.05, 2])]
    staggered = [box("a", [0.12, 0.24], [0.65, 0.77]), box("b", [1.11, 0.74], [1.64, 1]), box("c", [1.11, 0], [1.64, 0.27])]
    slit = [box("a", [0.61, -1], [1.12, 0.42]), box("b", [0.61, 0.59], [1.12, 2])]
    disc = [{"name": "a", "shape": {"disc": {"centre": [1.03 * MM, 0.52 * MM], "radius": 0.39 * MM}}}]
    beside = [box("a", [0.4, -1], [0.9, 0.71])]
    whole, half = [2, 1], ["x"]
    problems = {
        "serpentine": problem(whole, half, 0.3, 0.6, structures=serpentine),
        "serpentine, 6000 N/m3": problem(whole, half, 6000, 0.4, 0.8, structures=serpentine),
        "orifice": problem(whole, half, 0.3, 0.6, structures=orifice),
        "orifice, 6000 N/m3": problem(whole, half, 6000, 0.4, 0.8, structures=orifice),
        "staggered boxes": problem(whole, ["x", "y"], 0.3, 0.6, structures=staggered),
        "slit": problem(whole, half, 0.3, 0.6, structures=slit),
        "disc between plates": problem(whole, half, 0.3, 0.6, structures=disc),
        "step in a channel": problem(whole, half, 0.3, 0.6, structures=beside),
    }
    write(
        "ways-2d", "Narrow passages between structures in 2-D", "Discharge under a body force. Reference: extrapolation of 100 and 200 cells with order 1.3, as edges are sharp; all faces lie between cells there.",
        case(2, 0.3, 0.6), {"problem": problems, "cells": cells([12, 14, 17, 20, 24, 29, 34, 41, 50, 62, 80, 100, 200])},
    )


def ways_3d():
    ball = lambda radius: {"sphere": {"radius": radius * MM}}
    octahedron = lambda r: {"vertices": [[s * r * MM if a == axis else 0 for a in range(3)] for axis in range(3) for s in (1, -1)]}
    cuboid = lambda *edges: {"cuboid": {"edges": [e * MM for e in edges]}}
    duct, array = [2, 1, 1], ["x", "y", "z"]
    plate = [box("a", [0.9, -1, -1], [1.05, 0.31, 2]), box("b", [0.9, 0.69, -1], [1.05, 2, 2]), box("c", [0.9, 0, -1], [1.05, 1, 0.33]), box("d", [0.9, 0, 0.71], [1.05, 1, 2])]
    baffles = [box("a", [0.5, -1, -1], [0.62, 0.64, 2]), box("b", [1.5, 0.36, -1], [1.62, 2, 2])]
    bodies = {
        "sphere in a duct 0.9": problem(duct, ["x"], 0.3, 0.3, bodies=[fixed(ball(0.45), [1.02, 0.5, 0.5])]),
        "sphere in a duct 0.8": problem(duct, ["x"], 0.3, 0.3, bodies=[fixed(ball(0.4), [1.02, 0.52, 0.49])]),
        "octahedra 0.36": problem([1] * 3, array, 0.3, 0.2, bodies=[fixed(octahedron(0.364), [0.51, 0.49, 0.5], ([1, 2, 0.5], 25))]),
        "octahedra 0.45": problem([1] * 3, array, 0.3, 0.2, bodies=[fixed(octahedron(0.45), [0.51, 0.49, 0.5], ([3, 1, 1], 40))]),
        "turned cubes 0.56": problem([1] * 3, array, 0.3, 0.2, bodies=[fixed(cuboid(0.56, 0.56, 0.56), [0.51, 0.49, 0.5], ([1, 2, 3], 30))]),
        "cubes 0.8": problem([1] * 3, array, 0.3, 0.2, bodies=[fixed(cuboid(0.8, 0.8, 0.8), [0.51, 0.49, 0.503], ([0, 0, 1], 4))]),
        "bars 0.75": problem([1] * 3, array, 0.3, 0.2, bodies=[fixed(cuboid(0.9, 0.75, 0.75), [0.51, 0.49, 0.503], ([1, 0, 0], 10))]),
        "slabs 0.8": problem([1] * 3, array, 0.3, 0.2, bodies=[fixed(cuboid(0.3, 0.8, 0.8), [0.51, 0.49, 0.503], ([1, 1, 0], 8))]),
    }
    structures = {
        "square orifice": problem(duct, ["x"], 0.3, 0.4, structures=plate),
        "baffles in a duct": problem(duct, ["x"], 0.3, 0.4, structures=baffles),
    }
    grids = [10, 12, 15, 18, 22, 27, 33, 40]
    more = [
        {"name": f"{name}, {n} cells", "set": {**value, "domain.spacing": f"=1e-3/{n}", "coupling": COUPLINGS["interpolated"]["coupling"]}}
        for name, value in bodies.items() for n in (50,)
    ]
    more += [
        {"name": f"{name}, {n} cells", "set": {**value, "domain.spacing": f"=1e-3/{n}"}}
        for name, value in structures.items() for n in grids + [50]
    ]
    write(
        "ways-3d", "Narrow ways in 3-D", "Discharge under a body force. Reference: extrapolation of the two finest grids with interpolated links; order 2 beside spheres, 1.5 beside edges.",
        case(3, 0.3, 0.3), {"problem": bodies, "coupling": COUPLINGS, "cells": cells(grids)}, more,
    )


def positions():
    places = {"on a node": (0.0, 0.0), "between nodes": (0.5, 0.5), "place 1": (0.31, 0.17), "place 2": (0.12, 0.83), "place 3": (0.64, 0.42)}
    disc = lambda phi: {"disc": {"radius": MM * (phi / 3.141592653589793) ** 0.5}}
    problems = {
        f"array {phi}": problem([1, 1], ["x", "y"], 0.15, end, bodies=[fixed(disc(phi), [0.5, 0.5])])
        for phi, end in ((0.05, 0.5), (0.1, 0.3), (0.2, 0.3), (0.3, 0.25), (0.4, 0.2), (0.6, 0.2))
    }
    # A node is in the middle where the number of cells is odd; where it is even the first two places change their roles.
    vary = {
        "problem": problems,
        "place": {
            name: {f"bodies[0].position[{a}]": f"={MM}*0.5+{shift[a]}*domain.spacing" for a in (0, 1)} for name, shift in places.items()
        },
        "coupling": COUPLINGS,
        "cells": cells([9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 20, 21, 22, 24, 27, 30, 33, 36, 41]),
    }
    write(
        "positions", "Discs at several places of the lattice", "Discharge of square arrays of discs under a body force along x, with a disc on a node, between nodes and at three places. Reference: Sangani and Acrivos 1982.",
        case(2, 0.15, 0.3), vary,
    )


if __name__ == "__main__":
    ways_2d()
    ways_3d()
    positions()
