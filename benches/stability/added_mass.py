"""Smallest stable density ratio of a free body over coupling, radius, relaxation time and position relative to the nodes.

    python3 benches/stability/added_mass.py target/release/solver OUTPUT

A body falls or rises for 400 steps in a box of 8 radii (discs) or 4.5 (spheres), with density ratios 10 % apart around the stability
limit. The script writes to OUTPUT a study with its runs for each coupling, dimension and radius, and `added_mass.csv`: the largest unstable and the
smallest stable density ratio. The bounds in `src/plan/added_mass.rs` enclose them.
"""

import csv
import json
import pathlib
import subprocess
import sys

LINKS = {"drop_wall_velocity_at_solid_neighbours": 0}
COUPLINGS = {
    "interpolated": {"bounce_back": {"scheme": "interpolated", **LINKS}},
    "half_way": {"bounce_back": {"scheme": "half_way", **LINKS}},
    "viscosity_matched": {"partially_saturated": {"solid_operator": "viscosity_matched"}},
    "non_equilibrium_bounce_back": {"partially_saturated": {"solid_operator": "non_equilibrium_bounce_back"}},
    "bounce_back_about_solid": {"partially_saturated": {"solid_operator": "bounce_back_about_solid"}},
    "superposition": {"partially_saturated": {"solid_operator": "superposition"}},
    "with_inner_fluid": {"partially_saturated": {"exclude_inner_fluid": False}},
}
RADII = {2: (3.0, 5.0, 8.0), 3: (2.5, 4.0, 6.0)}
TIMES = {2: (0.52, 0.6, 0.8, 1.0, 1.2, 1.5, 2.0), 3: (0.52, 0.6, 0.9, 1.2, 1.5, 2.0)}
PLACES = ((0.13, 0.13, 0.13), (0.9, 0.37, 0.37))
SPACING = 1e-3
VISCOSITY = 1e-5
STEPS = 400


def ratios(name, dimension, radius):
    """Density ratios round the border."""
    low, high, count = 0.25, 1.2, 12
    if "bounce_back" in COUPLINGS[name]:
        low, high = 0.5 / radius, 2.5 / radius
    return [low * (high / low) ** (k / (count - 1)) for k in range(count)]


def study(name, dimension, radius):
    cells = int((8 if dimension == 2 else 4.5) * radius)
    vary = {"time": {}, "place": {}, "density_ratio": {}}
    for tau in TIMES[dimension]:
        dt = (tau - 0.5) / 3 * SPACING**2 / VISCOSITY
        vary["time"][str(tau)] = {
            "fluid.lattice_boltzmann.relaxation_time": tau,
            "time.end": STEPS * dt,
            "probes[0].every": 10 * dt,
            "gravity": [0] * (dimension - 1) + [-2e-6 * SPACING / dt**2],
        }
    for n, place in enumerate(PLACES):
        vary["place"][str(n)] = {"bodies[0].position": [(cells / 2 + p) * SPACING for p in place[:dimension]]}
    for ratio in ratios(name, dimension, radius):
        vary["density_ratio"]["%.4g" % ratio] = {"materials.body.density": 1000 * ratio}
    case = {
        "title": "free body",
        "domain": {"size": [cells * SPACING] * dimension, "spacing": SPACING},
        "gravity": [0] * dimension,
        "materials": {"body": {"density": 1000}},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": VISCOSITY, "relaxation_time": 0.8}},
        "bodies": [{
            "name": "body",
            "shape": {"disc" if dimension == 2 else "sphere": {"radius": radius * SPACING}},
            "position": [cells * SPACING / 2] * dimension,
            "motion": {"free": {}},
            "material": "body",
        }],
        "coupling": COUPLINGS[name],
        "time": {"end": 1, "solid_steps_per_fluid_step": 1, "solid_time_step_safety": 1},
        "probes": [{"name": "body", "every": 1e-9, "at": {"body": {"name": "body"}}}],
        "output": {},
        "guards": {"check_every_steps": 20},
    }
    square = "+".join(f"velocity_{axis}^2" for axis in "xyz"[:dimension])
    return {
        "title": f"A free body, {name}, {dimension}-D, {radius} cells in radius",
        "case": case,
        "vary": vary,
        "outputs": {"square": {"file": "probe_body.csv", "of": square, "take": "max"}},
        "map": ["time", "density_ratio"],
        "refused": "run",
        "run": {"time_limit": 60},
    }


def main():
    solver, output = sys.argv[1], pathlib.Path(sys.argv[2])
    output.mkdir(parents=True, exist_ok=True)
    rows = []
    for dimension, radii in RADII.items():
        for name in COUPLINGS:
            for radius in radii:
                folder = output / f"{name}_{dimension}_{radius:g}"
                case = folder.with_suffix(".json")
                case.write_text(json.dumps(study(name, dimension, radius)))
                subprocess.run([solver, "sweep", case, "--output", folder], check=True, stdout=subprocess.DEVNULL)
                with open(folder / "members.csv") as file:
                    members = list(csv.DictReader(line for line in file if not line.startswith("#")))
                for tau in TIMES[dimension]:
                    for n, place in enumerate(PLACES):
                        mine = [m for m in members if float(m["time"]) == tau and int(float(m["place"])) == n]
                        held = [float(m["density_ratio"]) for m in mine if m["outcome"] == "finished"]
                        thrown = [float(m["density_ratio"]) for m in mine if m["outcome"] != "finished"]
                        rows.append([name, dimension, radius, tau, n, max(thrown, default=0), min(held, default=99)])
    with open(output / "added_mass.csv", "w") as file:
        file.write("coupling,dimension,radius [cells],relaxation time,place,thrown away,held\n")
        for row in rows:
            file.write(",".join("%.4g" % x if isinstance(x, float) else str(x) for x in row) + "\n")


main()
