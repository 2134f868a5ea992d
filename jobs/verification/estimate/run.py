#!/usr/bin/env python3
"""Whether the true value lies in the interval that `solver estimate` states: problems with exact or published answers.

    python3 jobs/verification/estimate/run.py SOLVER [WORK [NAME...]]

Each problem is a case of jobs/verification with other cells and probes. The table goes to results.csv beside this script. The status is 1
where the true value of an answer lies outside its interval.
"""

import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
CASES = HERE.parent
LBM = "fluid.lattice_boltzmann"

# Velocity at height y at time t between a plate at rest and one that starts at once: the Fourier series of the diffusion equation.
def started_couette(y, t, speed=0.002, height=4e-4, nu=1e-6):
    series = sum(
        (-1) ** n / n * math.exp(-((n * math.pi / height) ** 2) * nu * t) * math.sin(n * math.pi * y / height)
        for n in range(1, 60)
    )
    return speed * (y / height + 2 / math.pi * series)


def probe(name, every, at):
    return {"name": name, "every": every, "at": at}


def point(*position):
    return {"point": {"position": list(position)}}


# A sheet pile of depth s = 1 - tip in ground of depth 1 m, k = 1e-4 m/s, without grains: its own cells are refined.
def sheet_pile(tip, discharge):
    return (
        f"sheet-pile-{1 - tip:g}",
        "sheet-pile",
        {
            "grains": None,
            "contact": None,
            "box_walls": [],
            "fluid.darcy.resistance": None,
            "fluid.darcy.porosity_cap": None,
            "fluid.darcy.coupling_interval": None,
            "gravity": [0, -9.81],
            "fluid.darcy.zones": [{"name": "sand", "permeability": {"hydraulic_conductivity": 1e-4}}],
            "structures[0].shape": {"box": {"from": [2.9999, tip], "to": [3.0001, 1.2]}},
        },
        [
            ("under: discharge, last", lambda t: 1e-4 * 0.1 * discharge, "exact, Harr 1962"),
        ],
    )


# name, case, changes, [(answer, true value from the last time, source)]
PROBLEMS = [
    (
        "poiseuille-force",
        "poiseuille-force",
        {
            "domain.spacing": 1.25e-5,
            f"{LBM}.collision": {"bgk": {}},
            f"{LBM}.relaxation_time": 1.1,
            "time.end": 0.4,
            "probes": [probe("plane", 0.01, {"plane": {"axis": "x", "position": 5e-5}})],
        },
        [("plane: discharge, last", lambda t: 100 * 4e-4**3 / 12e-3, "exact")],
    ),
    (
        "couette-start",
        "couette",
        {
            "domain.spacing": 1.25e-5,
            f"{LBM}.relaxation_time": 0.8,
            "time.end": 0.02,
            "probes": [probe("middle", 0.0005, point(5e-5, 2e-4)), probe("low", 0.0005, point(5e-5, 1e-4))],
        },
        [
            ("middle: velocity_x, last", lambda t: started_couette(2e-4, t), "exact series"),
            ("low: velocity_x, last", lambda t: started_couette(1e-4, t), "exact series"),
        ],
    ),
    (
        "couette-cylindrical",
        "couette-cylindrical",
        {"probes": [probe("cylinder", 0.02, {"body": {"name": "cylinder"}})]},
        [("cylinder: fluid_torque_z, last", lambda t: -16.75516082e-3 * 4 * 5e-4**2, "exact")],
    ),
    (
        "taylor-green",
        "taylor-green",
        {"domain.spacing": 1.5625e-5, "probes": [probe("point", 0.00025, point(5e-4, 2.5e-4))]},
        [
            (
                "point: velocity_x, last",
                lambda t: 0.0064 * math.exp(-2e-6 * (2 * math.pi / 1e-3) ** 2 * t),
                "exact",
            )
        ],
    ),
    (
        "duct",
        "duct",
        {
            "domain.size": [5e-4, 1e-3, 1e-3],
            "probes": [probe("cut", 0.00025, {"plane": {"axis": "x", "position": 2.5e-4}})],
        },
        [("cut: mean_velocity_x, last", lambda t: 50 * 1e-6 / 1e-4 * 0.0351442537, "exact series")],
    ),
    (
        "womersley",
        "womersley",
        {
            "domain.size": [2.5e-4, 1e-3],
            "domain.spacing": 2.5e-5,
            f"{LBM}.time_step": None,
            f"{LBM}.relaxation_time": 0.8,
            f"{LBM}.body_force.oscillating.period": 0.09817477042468103,
            "time.end": 15.25 * 0.09817477042468103,
            "probes": [probe("axis", 0.01, point(1.25e-4, 5e-4))],
        },
        [
            (
                "axis: velocity_x, last",
                lambda t: 2.5e-4
                * 0.06955022
                * math.cos(2 * math.pi * t / 0.09817477042468103 - math.radians(88.141703)),
                "exact, table womersley_plane",
            )
        ],
    ),
    (
        "cylinder-array",
        "cylinder-array",
        {
            f"{LBM}.relaxation_time": 1.5,
            "bodies[0].shape.disc.radius": 0.000252313252202,
            "time.end": 0.45,
            "probes": [probe("plane", 0.01, {"plane": {"axis": "x", "position": 1.25e-5}})],
        },
        [("plane: discharge, last", lambda t: 1e-7 / 51.53, "Sangani and Acrivos 1982")],
    ),
    (
        "cylinder-array-dense",
        "cylinder-array",
        {
            f"{LBM}.relaxation_time": 1.5,
            "bodies[0].shape.disc.radius": 0.000398942280401,
            "time.end": 0.1,
            "probes": [probe("plane", 0.0025, {"plane": {"axis": "x", "position": 1.25e-5}})],
        },
        [("plane: discharge, last", lambda t: 1e-7 / 532.55, "Sangani and Acrivos 1982")],
    ),
    (
        "cylinder-array-half-way",
        "cylinder-array",
        {
            f"{LBM}.relaxation_time": 1.5,
            "coupling.bounce_back.scheme": "half_way",
            "bodies[0].shape.disc.radius": 0.000252313252202,
            "time.end": 0.45,
            "probes": [probe("plane", 0.01, {"plane": {"axis": "x", "position": 1.25e-5}})],
        },
        [("plane: discharge, last", lambda t: 1e-7 / 51.53, "Sangani and Acrivos 1982")],
    ),
    (
        "sphere-array",
        "sphere-array",
        {
            "domain.spacing": 1e-3 / 26,
            f"{LBM}.relaxation_time": 1.5,
            "coupling": {"bounce_back": {"scheme": "interpolated"}},
            "probes": [probe("plane", 0.01, {"plane": {"axis": "x", "position": 1.9e-5}})],
        },
        [
            (
                "plane: discharge, last",
                lambda t: 0.1e-15 / (6 * math.pi * 1e-3 * 0.0003101752454497 * 4.29159),
                "Zick and Homsy 1982",
            )
        ],
    ),
    (
        "sphere-array-saturated",
        "sphere-array",
        {
            "domain.spacing": 1e-3 / 26,
            f"{LBM}.relaxation_time": 1.5,
            "probes": [probe("plane", 0.01, {"plane": {"axis": "x", "position": 1.9e-5}})],
        },
        [
            (
                "plane: discharge, last",
                lambda t: 0.1e-15 / (6 * math.pi * 1e-3 * 0.0003101752454497 * 4.29159),
                "Zick and Homsy 1982",
            )
        ],
    ),
    (
        "cylinder-2d1",
        "cylinder-2d1",
        # 2.255 m instead of 2.2: 5.5 times the height, so that coarser cells divide both.
        {
            "domain.size": [2.255, 0.41],
            "domain.spacing": 0.005,
            "probes": [probe("force", 0.25, {"body": {"name": "cylinder"}})],
        },
        [
            ("force: fluid_force_x, last", lambda t: 5.57953523384 / 500, "Schaefer and Turek 1996; FEATFLOW"),
            ("force: fluid_force_y, last", lambda t: 0.010618948146 / 500, "Schaefer and Turek 1996; FEATFLOW"),
        ],
    ),
    sheet_pile(0.75, 2.400094459133703 / (2 * 1.6335863074581471)),
    sheet_pile(0.5, 0.5),
    sheet_pile(0.25, 1.6335863074581471 / (2 * 2.400094459133703)),
    (
        "cut-off",
        "cut-off",
        {"fluid.darcy.zones": [{"name": "sand", "permeability": {"hydraulic_conductivity": 1e-4}}]},
        [("under_wall: discharge, last", lambda t: 1e-4 * 1.7052004102572171 / (2 * 2.098138692130958), "exact, Harr 1962")],
    ),
]

COLUMNS = (
    "problem,answer,reference,source,value,uncertainty,inside,error over uncertainty,extrapolated,observed order,"
    "series,in time,core-s of the case,core-s of the coarser grids,commit,machine,command"
).split(",")


def rows_of(problem, solver, work):
    name, case, changes, answers = problem
    folder = work / name
    command = [solver, "estimate", str(CASES / case / "case.json"), "--cells-only", "--threads", "1"]
    command += ["--output", str(folder)]
    for path, value in changes.items():
        command += ["--set", f"{path}={json.dumps(value)}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{name}: {done.stderr}")
    print(f"{name}\n{done.stdout}\n", flush=True)
    block = json.loads((folder / "1-case" / "summary.json").read_text())
    time = block["time"]
    estimate = block["estimate"]
    cost = {grid["folder"]: grid["core_seconds"] for grid in estimate["grids"]}
    own = cost.pop("1-case")
    program = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip()
    for answer, truth, source in answers:
        row = next(row for row in estimate["answers"] if row["answer"] == answer)
        reference = truth(time)
        error = abs(row["value"] - reference)
        width = row["uncertainty"]
        yield {
            "problem": name,
            "answer": answer,
            "reference": f"{reference:.8e}",
            "source": source,
            "value": f"{row['value']:.8e}",
            "uncertainty": "" if width is None else f"{width:.3e}",
            "inside": "not promised" if width is None else "yes" if error <= width else "no",
            "error over uncertainty": "" if not width else f"{error / width:.3f}",
            "extrapolated": "" if row["extrapolated"] is None else f"{row['extrapolated']:.8e}",
            "observed order": "" if row["observed_order"] is None else f"{row['observed_order']:.3f}",
            "series": row["behaviour"],
            "in time": row["in_time"],
            "core-s of the case": f"{own:.2f}",
            "core-s of the coarser grids": f"{sum(cost.values()):.2f}",
            "commit": program.split("(")[-1].strip(")"),
            "machine": machine(),
            "command": f"run.py SOLVER WORK {name}",
        }


def machine():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else "unknown"


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    solver = sys.argv[1]
    work = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else tempfile.mkdtemp())
    chosen = [p for p in PROBLEMS if not sys.argv[3:] or p[0] in sys.argv[3:]]
    rows = [row for problem in chosen for row in rows_of(problem, solver, work)]
    target = HERE / "results.csv" if not sys.argv[3:] else work / "results.csv"
    with target.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    inside = sum(row["inside"] == "yes" for row in rows)
    print(f"{inside} of {len(rows)} true values lie in their intervals; {target}")
    sys.exit(inside != len(rows))


main()
