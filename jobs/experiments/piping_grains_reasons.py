"""Reasons of the row of piping: heads at which the front passes below a cover of 30 diameters with other discs, covers, plays and ramps, and the strength of the discs."""

import math

import numpy as np
from laboratory import MEASURES, of_solver
from piping_grains import CASE, CHAMBER, DIAMETER, EXCESS, FRICTION, LOOSE, answers_of, course, depth, metres, ramp, settings
from runs import interval, run, seconds, table
from solver_results import open_run

LENGTH, PACKINGS = 30, (1, 2, 3)
# Changes of the scenes: friction angles of the discs and of the cover, play [d], the largest H/L and the slowness of the ramp.
SCENES = {
    "discs of 10 degrees": {"discs": 10.0},
    "discs of 15 degrees": {"discs": 15.0},
    "as in the row": {},
    "discs of 25 degrees": {"discs": 25.0, "largest": 0.8},
    "discs of 30 degrees": {"discs": 30.0, "largest": 1.0},
    "rough cover": {"cover": FRICTION},
    "play of 1 d": {"play": 1.0},
    "ramp half as fast": {"slowness": 2.0},
}
FIRST_BREAK = 0.1
QUANTITIES = ("front_0.25_L", "front_0.5_L", "front_0.9_L", "sliding_by_contact_friction", "sliding_by_peak_strength", "sliding_by_late_strength")


def path_of(change):
    """Returns the ramp of a scene: that of the row, up to another head or with the rise after its first break stretched."""
    first, second, (end, top) = ramp(LENGTH)
    largest, slowness = change.get("largest", top), change.get("slowness", 1.0)
    rise = (end - FIRST_BREAK) / (top - second[1]) * slowness
    return first, second, (round(FIRST_BREAK + (largest - second[1]) * rise, 9), largest)


def values_of(seed, path, change):
    """Returns the values of a run of a scene; larger heads have shorter time steps."""
    values = settings(LENGTH, seed, path)
    if not change:
        return values
    step, ratio = "fluid.lattice_boltzmann.time_step", ramp(LENGTH)[-1][1] / path[-1][1]
    return values | {
        step: round(values[step] * ratio, 8),
        "contact.linear.friction_angle_degrees": change.get("discs", FRICTION),
        "contact.linear.pairs[0].friction_angle_degrees": change.get("cover", 0.0),
        "grains.initial.growth.box.to": [values["grains.initial.growth.box.to"][0], *metres(depth(LENGTH) - change.get("play", LOOSE))],
    }


def solid_fraction(folder):
    """Returns the solid fraction of the bed below the cover at the start, without its edges."""
    low, high = 2 * DIAMETER, (depth(LENGTH) - 2) * DIAMETER
    start, stop = (CHAMBER + 2) * DIAMETER, (CHAMBER + LENGTH - 4) * DIAMETER
    with open_run(folder) as results:
        grains = next(iter(results.grains))
        x, y, radii = grains.positions[:, 0], grains.positions[:, 1], grains["radius"]
    inside = (x > start) & (x < stop) & (y > low) & (y < high)
    return float(np.pi * np.sum(radii[inside] ** 2) / ((stop - start) * (high - low)))


def strength(angle, seed):
    """Runs a biaxial test of discs of a friction angle, and returns the tangents of the friction angle of the packing at the peak and at strains of 6 to 8 %, and the folder."""
    change = {"grains.initial.growth.seed": seed, "contact.linear.friction_angle_degrees": angle}
    folder = run(f"laboratory/biaxial-{angle:g}-degrees-{seed}", "laboratory/biaxial.json", change)
    with open_run(folder) as results:
        answers, _ = MEASURES["biaxial"](of_solver("biaxial", results))
    ratios = answers["peak_stress_ratio"], answers["stress_ratio_at_6_to_8_percent"]
    return [(ratio - 1) / (2 * math.sqrt(ratio)) for ratio in ratios], folder


def main():
    rows, answers, folders = [], [], []
    for scene, change in SCENES.items():
        values, path = [], path_of(change)
        for seed in PACKINGS:
            name = f"{LENGTH}-{seed}" + (f"-{scene.replace(' ', '-')}" if change else "")
            folder = run(f"piping_grains/{name}", CASE, values_of(seed, path, change), may_fail=True)
            angle = change.get("discs", FRICTION)
            (peak, late), test = strength(angle, seed)
            folders += [folder, test]
            weight = solid_fraction(folder) * EXCESS
            values.append((*answers_of(course(folder, LENGTH, path))[1:4], weight * math.tan(math.radians(angle)), weight * peak, weight * late))
            rows.append((scene, seed, *map(float, values[-1])))
        for quantity, column in zip(QUANTITIES, zip(*values)):
            column = [value for value in column if not math.isnan(value)]
            if column:
                answers.append((scene, quantity, len(column), *map(float, interval(column))))
    table("piping_grains_reasons_runs", ["scene", "packing", *QUANTITIES], rows)
    note = f"heads are H/L, L = 30 d; those of sliding: solid fraction times 1.5 times the tangent of the friction angle of contacts or of the packing; processor time: {seconds(set(folders)):.0f} s"
    table("piping_grains_reasons", ["scene", "quantity", "packings", "mean", "scatter", "half_width_95"], answers, note)


if __name__ == "__main__":
    main()
