"""Small runs of the program for the tests of the reader: every example, shortened.

SOLVER names the program (default: target/debug/solver). SOLVER_RUNS may name a folder that already holds some of the runs, by the names
of their examples; they are not made again.
"""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "jobs" / "python"))


def _fluid(end, **more):
    return {"time.end": end, "output.fluid.every": end / 2, **more}


def _test(end):
    """An element test, with output and samples at its middle and end."""
    often = {"output.grains.every": end / 2, "output.contacts.every": end / 2, "analysis.element_test.from": 0}
    return {"time.end": end, **often, "probes[0].every": end / 2, "probes[1].every": end / 2}


# Ranks, and what shortens the example.
EXAMPLES = {
    "avalanche": (1, {"time.end": 0.02, "output.blocks.every": 0.01, "output.contacts": '{"every": 0.01}'}),
    "biaxial": (1, {**_test(0.002), "probes[2].every": 0.001, "probes[3].every": 0.001}),
    "broad-crested-weir": (1, _fluid(0.01, **{"probes[0].every": 0.005, "probes[1].every": 0.005})),
    "cavity": (1, _fluid(0.1, **{"probes[0].every": 0.05, "probes[1].every": 0.05})),
    "chute": (1, _fluid(0.005, **{f"probes[{n}].every": 0.0025 for n in range(7)})),
    "collision": (1, {"time.end": 0.005}),
    "couette": (1, _fluid(0.03, **{"probes[0].every": 0.01, "probes[1].every": 0.01})),
    "cylinder": (1, _fluid(0.2)),
    "dam-break": (1, _fluid(0.01)),
    "deposition": (1, {"time.end": 0.002, "output.grains.every": 0.001, "grains.initial.deposition.number": 30}),
    "direct-shear": (1, _test(0.002)),
    "dry-incline": (1, {"time.end": 0.02, "output.blocks.every": 0.01, "output.contacts.every": 0.01}),
    "first-flow": (1, _fluid(0.02)),
    "fissure-clay": (1, _fluid(0.0006, **{"output.grains.every": 0.0003, "output.contacts.every": 0.0003})),
    "fissure-sand": (1, _fluid(0.0006, **{"output.grains.every": 0.0003, "output.contacts.every": 0.0003})),
    "flume": (
        1,
        {
            "time.end": 0.002,
            "probes[0]": '{"name": "bed", "every": 0.001, "at": {"bed": {}}}',
            "grains.initial.deposition.stop.at_most_steps": 2000,
            "output.fluid.every": 0.001,
            "output.grains.every": 0.001,
        },
    ),
    "floating-log": (1, _fluid(0.01, **{"probes[0].every": 0.005})),
    "incline": (1, _fluid(0.005, **{"time.warm_up": "null", "output.blocks.every": 0.0025})),
    "joint-pulse": (1, {"time.end": 0.008, "output": '{"blocks": {"every": 0.004}}'}),
    "oedometer": (1, {**_test(1e-4), "probes[2].every": 5e-5}),
    "plucked-block": (1, {"time.end": 0.005, "output": '{"blocks": {"every": 0.0025}}'}),
    "piping": (
        2,
        _fluid(0.004, **{"time.warm_up": "null", "output.grains.every": 0.002, "output.contacts.every": 0.002}),
    ),
    "poiseuille": (1, _fluid(0.03, **{"probes[0].every": 0.01, "probes[1].every": 0.01})),
    "rain-fissure": (
        1,
        _fluid(0.024, **{"fluid.darcy.coupling_interval": 100, "output.grains.every": 0.012, "output.contacts.every": 0.012}),
    ),
    "rock-into-reservoir": (1, _fluid(0.01)),
    "scour": (1, _fluid(0.005, **{"output.blocks.every": 0.0025})),
    "seepage": (2, _fluid(0.002, **{"output.grains.every": 0.001})),
    "sheet-pile": (1, {}),
    "backward-erosion": (1, {}),
    "cut-off": (1, {}),
    "earth-dam": (1, {}),
    "drawdown": (
        1,
        {"time.end": 72000, "probes[0].every": 36000, "probes[1].every": 36000, "output.fluid.every": 36000},
    ),
    "infiltration": (1, {"time.end": 7200, "output.fluid.every": 3600}),
    "filter": (1, _fluid(0.004, **{"output.grains.every": 0.002, "grains.initial.deposition.stop.at_most_steps": 500})),
    "weir": (1, _fluid(0.002, **{"output.grains.every": 0.001, "probes[2].at.bed": "{}", "probes[2].every": 0.001})),
    "settling-disc": (2, _fluid(0.006, **{"output.grains.every": 0.003})),
    "stagnation": (1, _fluid(0.002, **{"output.averages.from": 0.0005})),
    "standing-wave": (1, _fluid(0.02)),
    "triaxial": (1, {**_test(1e-4), **{f"probes[{n}].every": 5e-5 for n in range(2, 6)}}),
    "unconfined-compression": (1, _test(0.002)),
    "taylor-green": (2, _fluid(0.02, **{"probes[0].every": 0.01})),
}


def _sample(folder):
    """Spheres in the fissure in place of a deposition, which takes minutes."""
    rows = ["x,y,z,radius"]
    for i in range(3):
        for j in range(10):
            rows += [f"{0.0165 + 0.0035 * i},{0.005 + 0.0095 * j},{0.013 + 0.004 * k},0.0015" for k in range(4)]
    (folder / "spheres.csv").write_text("\n".join(rows) + "\n")


def _make(solver, folder, name):
    ranks, changes = EXAMPLES[name]
    case = folder / f"{name}.json"
    case.write_bytes(subprocess.run([solver, "example", name], check=True, stdout=subprocess.PIPE).stdout)
    if name.startswith("fissure"):
        changes = {**changes, "grains.initial": '{"file": {"path": "spheres.csv"}}'}
    launch = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
    command = [*launch, solver, str(case), "--output", str(folder / name), "--threads", "1", "--no-final-checkpoint"]
    for path, value in changes.items():
        command += ["--set", f"{path}={value}"]
    environment = dict(os.environ)
    if ranks == 1:
        # Without the daemon of Open MPI a start is short. Such processes share one session folder unless each has its own.
        environment["OMPI_MCA_ess_singleton_isolated"] = "1"
        environment["OMPI_MCA_orte_tmpdir_base"] = str(folder / f"{name}-session")
    patience = float(os.environ.get("SOLVER_TEST_PATIENCE", "1"))
    limit = 300 * patience
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=limit
    )
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}"


@pytest.fixture(scope="session")
def runs(tmp_path_factory):
    """The folders of the runs by the names of their examples."""
    solver = os.environ.get("SOLVER", str(ROOT / "target" / "debug" / "solver"))
    made = Path(os.environ["SOLVER_RUNS"]) if "SOLVER_RUNS" in os.environ else None
    folder = tmp_path_factory.mktemp("runs")
    _sample(folder)
    listed = subprocess.run([solver, "example"], check=True, stdout=subprocess.PIPE, text=True).stdout
    names = [line.split()[0] for line in listed.split("\n\n")[0].splitlines()]
    assert sorted(names) == sorted(EXAMPLES), "every example is read"
    found = {name: made / name for name in names if made and (made / name / "summary.json").is_file()}
    missing = [name for name in names if name not in found]
    with ThreadPoolExecutor(2) as pool:
        for _ in pool.map(lambda name: _make(solver, folder, name), missing):
            pass
    return {**found, **{name: folder / name for name in missing}}
