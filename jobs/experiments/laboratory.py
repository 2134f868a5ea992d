"""Laboratory tests: oedometer, biaxial and shear test of discs, triaxial test of spheres, compared with LAMMPS, and regular packings
compared with statics.
"""

import importlib.util
import json
import math
import subprocess
import time

import numpy as np
from runs import HERE, RUNS, SOLVER, interval, run, seconds, table
from solver_results import open_run

PACKINGS = {"oedometer": 8, "biaxial": 8, "shear": 8, "triaxial": 3}
TRIAXIAL_STIFFNESS, TRIAXIAL_STEP = 1e4, 8e-6
MISSING = "; without the Python package lammps its values are missing"
UNITS = {
    "axial_stress_at_1_percent": "Pa",
    "axial_stress_at_1.5_percent": "Pa",
    "tangent_modulus": "Pa",
    "lateral_over_axial_stress": "-",
    "peak_stress_ratio": "-",
    "peak_friction_angle": "degrees",
    "stress_ratio_at_6_to_8_percent": "-",
    "volume_increase_at_8_percent": "-",
    "dilatancy_angle": "degrees",
    "lateral_stress": "Pa",
    "steady_shear_over_normal_stress": "-",
    "steady_normal_stress": "Pa",
}


def case_of(name):
    """Returns a case of the folder laboratory."""
    with open(HERE / "laboratory" / f"{name}.json", encoding="utf-8") as file:
        return json.load(file)


def records(results, names, moved):
    """Returns time, displacements and normal stresses of walls, by the names that the measures use."""
    probes = {name: results.probes[name] for name in names}
    record = {name: probe["normal_stress"].to_numpy() for name, probe in probes.items()}
    record["time"] = probes["top"]["time"].to_numpy()
    for name, (wall, axis, sign) in moved.items():
        record[name] = sign * probes[wall][f"displacement_{axis}"].to_numpy()
    return record


def smooth(values, width):
    """Returns running means over `width` samples."""
    return np.convolve(values, np.ones(width) / width, mode="valid")


def oedometer(record):
    """Returns the answers of an oedometer test, and strain and stresses."""
    strain = record["shortening"] / 0.04
    axial, lateral = 0.5 * (record["bottom"] + record["top"]), 0.5 * (record["left"] + record["right"])
    late, last = strain > 0.00999, strain > 0.0139
    answers = {
        "axial_stress_at_1_percent": np.interp(0.01, strain, axial),
        "axial_stress_at_1.5_percent": np.interp(0.015, strain, axial),
        "tangent_modulus": np.polyfit(strain[late], axial[late], 1)[0],
        "lateral_over_axial_stress": lateral[last].mean() / axial[last].mean(),
    }
    return answers, (strain, axial, lateral)


def biaxial(record):
    """Returns the answers of a biaxial test from 0.1 s on, and strain, stress ratio and change of volume."""
    begin = np.searchsorted(record["time"], 0.1 - 1e-9)
    height, width = 0.06 - record["shortening"][begin:], 0.04 + record["widening"][begin:]
    lateral = 0.5 * (record["left"] + record["right"])[begin:]
    return failure(height, height * width, 0.5 * (record["bottom"] + record["top"])[begin:], lateral)


def triaxial(record):
    """Returns the answers of a triaxial test from 0.04 s on, and strain, stress ratio and change of volume."""
    begin = np.searchsorted(record["time"], 0.04 - 1e-9)
    height = 0.021 - record["shortening"][begin:]
    volume = height * (0.014 + record["widening"][begin:]) * (0.014 + record["thickening"][begin:])
    lateral = 0.25 * (record["left"] + record["right"] + record["back"] + record["front"])[begin:]
    return failure(height, volume, 0.5 * (record["bottom"] + record["top"])[begin:], lateral)


def failure(height, size, axial, lateral):
    """Returns the answers of a test up to failure from heights, volumes (areas of discs) and stresses, and strain, stress ratio and change of volume."""
    strain, volume, ratio = 1 - height / height[0], size / size[0] - 1, axial / lateral
    smoothed = smooth(ratio, 20)
    peak = smoothed.max()
    rise = (strain > 0.01) & (strain < 0.04)
    slope = np.polyfit(strain[rise], volume[rise], 1)[0]
    answers = {
        "peak_stress_ratio": peak,
        "peak_friction_angle": math.degrees(math.asin((peak - 1) / (peak + 1))),
        "stress_ratio_at_6_to_8_percent": ratio[(strain > 0.06) & (strain < 0.08)].mean(),
        "volume_increase_at_8_percent": np.interp(0.08, strain, volume),
        "dilatancy_angle": math.degrees(math.asin(slope / (2 + slope))),
        "lateral_stress": lateral[rise].mean(),
    }
    return answers, (strain[19:], smoothed, volume[19:])


def shear(record):
    """Returns the answers of a shear test over the second half of the path, and path over height, stress ratio and normal stress."""
    path = 0.04 * (record["time"] - 0.1) / 0.0394
    steady = path > 0.5
    answers = {
        "steady_shear_over_normal_stress": record["shear"][steady].mean() / record["normal"][steady].mean(),
        "steady_normal_stress": record["normal"][steady].mean(),
    }
    begin = np.searchsorted(path, 0)
    shown = smooth(record["normal"][begin:], 10)
    return answers, (path[begin + 9:], smooth(record["shear"][begin:], 10) / shown, shown)


MEASURES = {"oedometer": oedometer, "biaxial": biaxial, "shear": shear, "triaxial": triaxial}


def of_solver(test, results):
    """Returns the record of a run of the solver."""
    if test == "shear":
        probe = results.probes["inside"]
        return {"time": probe["time"].to_numpy(), "normal": probe["stress_yy"].to_numpy(), "shear": np.abs(probe["stress_xy"].to_numpy())}
    if test == "triaxial":
        moved = {"shortening": ("top", "z", -1), "widening": ("right", "x", 1), "thickening": ("front", "y", 1)}
        return records(results, ("bottom", "top", "left", "right", "back", "front"), moved)
    moved = {"shortening": ("top", "y", -1)} | ({"widening": ("right", "x", 1)} if test == "biaxial" else {})
    return records(results, ("bottom", "top", "left", "right"), moved)


def of_lammps(test, sample, folder):
    """Returns the record of LAMMPS for the grains at the start of a run of the solver."""
    import lammps_laboratory

    case = case_of(test)
    grains = sample["id"] >= len(case.get("bodies", []))  # bodies come first
    positions, radii = sample.positions[grains, : len(case["domain"]["size"])], sample["radius"][grains]
    if test == "triaxial":
        return lammps_laboratory.triaxial(positions, radii, folder, case, stiffness=TRIAXIAL_STIFFNESS, time_step=TRIAXIAL_STEP)
    if test != "shear":
        return getattr(lammps_laboratory, test)(positions, radii, folder, case)
    discs = [np.array([body["position"] for body in case["bodies"] if body["name"].startswith(name)]) for name in ("lower", "upper")]
    record = lammps_laboratory.shear(positions, radii, (*discs, 0.001), folder, case)
    return record | {"shear": np.abs(record["shear"])}


def packings(test, lammps):
    """Runs a test with several packings, writes its rows, and returns them with their curves."""
    rows, curves, folders, spent = [], [], [], 0.0
    for seed in range(1, PACKINGS[test] + 1):
        folder = run(f"laboratory/{test}-{seed}", f"laboratory/{test}.json", {"grains.initial.growth.seed": seed})
        folders.append(folder)
        with open_run(folder) as results:
            sources = {"solver": of_solver(test, results)}
            if lammps:
                before = time.process_time()
                sources["LAMMPS"] = of_lammps(test, list(results.grains)[0], folder)
                spent += time.process_time() - before
        for program, record in sources.items():
            answers, curve = MEASURES[test](record)
            rows += [(test, program, seed, name, float(value), UNITS[name]) for name, value in answers.items()]
            curves += [(test, program, seed, *map(float, point)) for point in list(zip(*curve[:2]))[:: len(curve[0]) // 40]]
    print(f"{test}: processor time {seconds(folders):.0f} s, LAMMPS {spent:.0f} s")
    return rows, curves, folders


def example(name, suffix, change):
    """Runs an example of the solver with other values, and returns its case and its folder."""
    path = RUNS / "laboratory" / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(subprocess.run([SOLVER, "example", name], capture_output=True, text=True, check=True).stdout, encoding="utf-8")
    case = json.loads(path.read_text(encoding="utf-8"))
    return case, run(f"laboratory/exact-{name}-{suffix}", path, change)


def listed(case):
    """Returns positions and radii of the grains of a case with a list."""
    grains = case["grains"]["initial"]["list"]
    return np.array([grain["position"] for grain in grains]), np.array([grain["radius"] for grain in grains])


def answer(folder, name):
    """Returns an answer of an element test."""
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))["element_test"][name]["value"]


def hexagonal_oedometer(lammps):
    """Returns rows of discs that slide over each other, V = k delta (3^0.5 + mu) for each disc of a row, and the folder of the run."""
    friction, stiffness, layers, fall = 0.25, 1e8, 7, 1e-6
    case, folder = case_of("hexagonal_oedometer"), run("laboratory/exact-oedometer", "laboratory/hexagonal_oedometer.json")
    load = fall / ((layers - 1) / (stiffness * math.sqrt(0.75) * (math.sqrt(3) + friction)) + 2 / stiffness)
    other = {}
    if lammps:
        from lammps_laboratory import plates

        other = plates(*listed(case), folder, case, stiffness, friction, 0.3, 1.0, 2650.0, 1e-5)
    known = {"axial_stress": load / 0.01, "lateral_stress_ratio": (1 - math.sqrt(3) * friction) / (3 + math.sqrt(3) * friction)}
    what = "oedometer, hexagonal discs"
    return [(what, name, value, answer(folder, name), float(other.get(name, math.nan))) for name, value in known.items()], folder


def hexagonal_biaxial(lammps):
    """Returns rows of hexagonal discs at the limit of V/H = tan(60 degrees + phi), with phi = 0 in LAMMPS, and the folders of the runs."""
    rows, folders = [], []
    for degrees in (0, 14.0362434679):
        values = {"contact.linear.friction_angle_degrees": degrees} | ({} if degrees else {"contact.linear.rolling": None})
        case, folder = example("biaxial", f"{degrees:.0f}", values)
        exact, peak = 2 * 5 / 6 * (6 * math.sqrt(0.75) + 1) / 6 * math.tan(math.radians(60 + degrees)), math.nan
        if lammps and not degrees:
            from lammps_laboratory import biaxial as other

            record = other(*listed(case), folder, case, stiffness=1e9, friction=0.0, shear=0.5, time_step=2.5e-6, density=2650.0)
            ratio = (record["bottom"] + record["top"]) / (record["left"] + record["right"])
            peak = float(ratio[record["time"] >= 0.01].max())
        what = f"biaxial, hexagonal discs, friction {degrees:.3g} degrees"
        rows.append((what, "peak_stress_ratio", exact, answer(folder, "peak_stress_ratio"), peak))
        folders.append(folder)
    return rows, folders


def two_rows(lammps):
    """Returns the row of two rows of discs between rough plates: half of the angle of their lines of centres; and the folder of the run."""
    (case, folder), peak = example("direct-shear", "30", {}), math.nan
    if lammps:
        from lammps_laboratory import plates

        other = plates(*listed(case), folder, case, 1e9, math.tan(math.radians(30)), 0.3, 0.5, 2650.0, 2.5e-6)
        peak = float(other["peak_shear_ratio"])
    return [("shear, two rows of discs", "peak_shear_ratio", 1 / 3, answer(folder, "peak_shear_ratio"), peak)], folder


def exact(lammps):
    """Returns rows of regular packings: test, quantity, exact value, those of both programs; and the folders of the runs."""
    pressed, one = hexagonal_oedometer(lammps)
    failed, others = hexagonal_biaxial(lammps)
    sheared, last = two_rows(lammps)
    return pressed + failed + sheared, [one, *others, last]


def tables(tests, name):
    """Runs tests and writes their tables: answers, differences between the programs, runs and curves."""
    lammps = importlib.util.find_spec("lammps") is not None
    rows, curves, folders = [], [], []
    for test in tests:
        for whole, part in zip((rows, curves, folders), packings(test, lammps)):
            whole += part
    table(f"{name}_runs", ["test", "program", "packing", "quantity", "value", "unit"], rows)
    table(f"{name}_curves", ["test", "program", "packing", "path", "value"], curves)
    answers = []
    for test, quantity in dict.fromkeys((row[0], row[3]) for row in rows):
        for program in dict.fromkeys(row[1] for row in rows):
            values = [row[4] for row in rows if (row[0], row[1], row[3]) == (test, program, quantity)]
            answers.append((test, program, quantity, *map(float, interval(values)), UNITS[quantity]))
        if lammps:
            pairs = [{row[2]: row[4] for row in rows if (row[0], row[1], row[3]) == (test, program, quantity)} for program in ("solver", "LAMMPS")]
            differences = interval([pairs[0][seed] - pairs[1][seed] for seed in pairs[0]])
            answers.append((test, "difference", quantity, *map(float, differences), UNITS[quantity]))
    note = f"processor time of the solver: {seconds(folders):.0f} s{MISSING}"
    table(name, ["test", "program", "quantity", "mean", "scatter", "half_width_95", "unit"], answers, note)


def main():
    rows, folders = exact(importlib.util.find_spec("lammps") is not None)
    rows = [(*row, row[3] / row[2] - 1, row[4] / row[2] - 1) for row in rows]
    columns = ["test", "quantity", "exact", "solver", "LAMMPS", "solver_deviation", "LAMMPS_deviation"]
    table("laboratory_exact", columns, rows, f"processor time of the solver: {seconds(folders):.0f} s{MISSING}")
    tables(("oedometer", "biaxial", "shear"), "laboratory")


if __name__ == "__main__":
    main()
