#!/usr/bin/env python3
"""Planned time of transient unsaturated ground beside the processor time of runs.

    python3 jobs/plans/unsaturated.py SOLVER > jobs/plans/unsaturated.csv

Columns, drawdowns, dams whose reservoir fills and rain, each with permeabilities that differ by factors of 1 to 10,000; `damc` and `rainc` are
the same on coarser cells.
"""

import json
import pathlib
import resource
import subprocess
import sys
import tempfile

CONTRASTS = [1, 10, 100, 10000]
SAND = 1e-5


def zone(name, conductivity, region=None):
    """Returns a zone of a hydraulic conductivity [m/s]."""
    made = {"name": name, "permeability": {"hydraulic_conductivity": conductivity}}
    return made | ({"region": region} if region else {})


def layer(low, high):
    """Returns a layer between two elevations [m]."""
    return {"layer": {"from": low, "to": high}}


def example(solver, name):
    """Returns a case of the program."""
    return json.loads(subprocess.run([solver, "example", name], capture_output=True, text=True, check=True).stdout)


def column(solver, contrast):
    """Infiltration into a column of five layers."""
    case = example(solver, "infiltration")
    case["domain"] = case["domain"] | {"size": [0.05, 1], "spacing": 0.005}
    zones = [zone("soil", 9.22e-5)]
    if contrast > 1:
        zones += [zone(f"l{n}", 9.22e-5 / contrast, layer(n / 5, (n + 1) / 5)) for n in (1, 3)]
    case["fluid"]["darcy"]["zones"] = zones
    case["probes"] = case["probes"][:1]
    case["time"]["end"] = 43200
    return case | {"output": {}}


def drawdown(solver, contrast):
    """Drawdown beside ground with a layer of clay."""
    case = example(solver, "drawdown")
    zones = [zone("sand", 1e-4)]
    if contrast > 1:
        zones.append(zone("clay", 1e-4 / contrast, layer(0.4, 0.6)))
    case["fluid"]["darcy"]["zones"] = zones
    case["time"]["end"] = 432000
    return case | {"output": {}}


def dam(contrast, cells):
    """A dam with a core whose reservoir fills."""
    zones = [zone("shell", SAND)]
    if contrast > 1:
        zones.append(zone("core", SAND / contrast, {"box": {"from": [8, 0], "to": [12, 10]}}))
    face = {"seepage_face": {"level": 1}}
    retention = {"alpha": 3, "n": 2, "saturated_content": 0.4, "residual_content": 0.05}
    water = {
        "density": 1000,
        "viscosity": 0.001,
        "zones": zones,
        "unsaturated": {"retention": {"van_genuchten": retention}, "transient": {"initial": {"head": 1}}},
        "boundaries": [
            {"name": "up", "face": "x_min", "condition": face, "history": [[0, 1], [86400, 8]]},
            {"name": "down", "face": "x_max", "condition": face},
        ],
    }
    return {
        "domain": {"size": [20, 10], "spacing": 10 / cells},
        "gravity": [0, -9.81],
        "materials": {"earth": {"density": 2650}},
        "fluid": {"darcy": water},
        "time": {"end": 864000, "solid_time_step": 7200},
        "probes": [{"name": "water", "every": 86400, "at": {"water_balance": {}}}],
        "output": {},
    }


def rain(contrast, cells):
    """Rain on ground with two layers of clay."""
    case = dam(1, cells)
    water = case["fluid"]["darcy"]
    if contrast > 1:
        water["zones"] += [zone(f"c{n}", SAND / contrast, layer(n, n + 1)) for n in (3, 6)]
    water["boundaries"] = [
        {"name": "rain", "face": "y_max", "condition": {"rain": {"rate": 2e-7}}},
        {"name": "base", "face": "y_min", "condition": {"seepage_face": {"level": 1}}},
    ]
    return case


def scenes(solver):
    """Yields the names and cases of all scenes."""
    for contrast in CONTRASTS:
        yield f"column-{contrast}", column(solver, contrast)
        yield f"draw-{contrast}", drawdown(solver, contrast)
        yield f"dam-{contrast}", dam(contrast, 40)
        yield f"rain-{contrast}", rain(contrast, 30)
        if contrast != 10:
            yield f"damc-{contrast}", dam(contrast, 20)
            yield f"rainc-{contrast}", rain(contrast, 20)


def main():
    """Runs the scenes and prints the table."""
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    solver = str(pathlib.Path(sys.argv[1]).resolve())
    version = subprocess.run([solver, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    print(f"# {version}; processor time of the run, one thread")
    print("# command: python3 jobs/plans/unsaturated.py SOLVER")
    print("scene,planned [s],processor [s],processor over planned")
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "case.json"
        for name, case in scenes(solver):
            file.write_text(json.dumps(case))
            plan = subprocess.run([solver, "plan", file, "--json", "--threads", "1"], capture_output=True, text=True, check=True)
            planned = json.loads(plan.stdout)["estimate"]["seconds_on_one_core"]
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            command = [solver, "run", file, "--threads", "1", "--overwrite", "--output", file.with_name("run")]
            subprocess.run(command, capture_output=True, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            used = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
            print(f"{name},{planned:.2f},{used:.2f},{used / planned:.2f}", flush=True)


if __name__ == "__main__":
    main()
