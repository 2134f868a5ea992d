"""Rate over stress of the hole erosion test of ../piping_erosion: contacts of a grain, dissipation, and the part of the test that is read, one at a time."""

import json

import numpy as np
from runs import interval, run, seconds, table
from solver_results import open_run

SPACING = 2.67e-5
SOILS = {
    "friction 20, dashpots": (20, 0.2, 0),
    "friction 0, dashpots": (0, 0.2, 0),
    "friction 0, local damping": (0, 0, 0.2),
}
PARTS = (0.1, 0.3, 0.5)


def read(folder, part):
    """Returns the mean rate over the mean stress by the balance of forces [s/m] between 2 % and a part of the mass, or nothing if less eroded."""
    with open_run(folder) as results:
        record = results.tables["erosion"]
    fraction = record["eroded_fraction"].to_numpy()
    if fraction.max() < min(part, 0.05):
        return None
    window = (fraction >= 0.02) & (fraction <= part)
    if window.sum() < 3:
        return None
    time, mass = record["time"].to_numpy()[window], record["eroded_mass"].to_numpy()[window]
    length = record["hole_length"].to_numpy()[window].mean()
    stress = record["shear_balance"].to_numpy()[window].mean()
    return float((mass[-1] - mass[0]) / (time[-1] - time[0]) / (2 * length) / stress)


def main():
    rows, answers, folders = [], [], []
    for soil, (friction, dashpot, local) in SOILS.items():
        values = {part: [] for part in PARTS}
        contacts = []
        for seed in (1, 2, 3):
            law = "contact.cohesive_frictional"
            folder = run(f"hole/{soil.replace(', ', '-').replace(' ', '-')}-{seed}", "../piping_erosion/case_small.json", {
                "domain.spacing": SPACING,
                "domain.size": [315 * SPACING, 150 * SPACING],
                "grains.cut[0].box.to[1]": 150 * SPACING,
                "grains.cut[1].box.to": [315 * SPACING, 150 * SPACING],
                "regions[0].box": {"from": [312 * SPACING, 0], "to": [315 * SPACING, 150 * SPACING]},
                "grains.initial.growth.friction_angle_degrees": friction,
                "grains.initial.growth.seed": seed,
                f"{law}.normal_damping_ratio": dashpot,
                f"{law}.local_damping": local,
                "fluid.lattice_boltzmann.boundaries[0].condition.pressure.value": 0.3,
                "fluid.lattice_boltzmann.boundaries[0].condition.pressure.ramp.duration": 0.2,
                "time.end": 4,
                "time.solid_time_step_safety": 0.3,
                "analysis.erosion_law.end_at_eroded_fraction": 0.5,
                "output": {},
                "guards.limits": "warn",
            }, may_fail=True)
            folders.append(folder)
            with open(folder / "summary.json", encoding="utf-8") as file:
                start = json.load(file)["erosion"]
            contacts.append(start["contacts_per_grain"])
            row = [soil, seed, float(start["contacts_per_grain"])]
            for part in PARTS:
                value = read(folder, part)
                row.append("" if value is None else value)
                if value is not None:
                    values[part].append(value)
            rows.append(row)
        for part in PARTS:
            if len(values[part]) > 1:
                answers.append((soil, float(np.mean(contacts)), part, len(values[part]), *map(float, interval(values[part]))))
    columns = ["soil", "contacts_per_grain", "part_of_mass", "packings", "mean_s_m", "scatter", "half_width_95"]
    table("hole_runs", ["soil", "packing", "contacts_per_grain", *(f"rate_over_stress_to_{part}_s_m" for part in PARTS)], rows)
    table("hole", columns, answers, f"0.3 Pa, C/d 0.506 N/m; processor time: {seconds(folders):.0f} s")


if __name__ == "__main__":
    main()
