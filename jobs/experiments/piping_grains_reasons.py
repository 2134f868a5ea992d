"""Reasons of the row of piping: heads at which the layer below the cover slides under another friction, cover, play or ramp, compared with those of the row."""

import math

import numpy as np
from laboratory import MEASURES, of_solver
from piping_grains import CHAMBER, DIAMETER, EXCESS, FRICTION, LOOSE, answers_of, course, depth, exponent, metres, ramp, settings
from runs import interval, run, seconds, table
from solver_results import open_run

PACKINGS = {30: (1, 2, 3), 60: (1, 2)}
# Lengths of the cover in diameters and the changes: friction angles of the discs and of the cover, play [d], the largest H/L and the slowness of the ramp.
SCENES = {
    "discs of 10 degrees": ((30,), {"discs": 10.0}),
    "discs of 15 degrees": ((30,), {"discs": 15.0}),
    "discs of 25 degrees": ((30,), {"discs": 25.0, "largest": 0.8}),
    "discs of 30 degrees": ((30,), {"discs": 30.0, "largest": 1.0}),
    "play of 1 d": ((30,), {"play": 1.0}),
    "as in the row": ((30, 60), {}),
    "rough cover": ((30, 60), {"cover": FRICTION}),
    "ramp half as fast": ((30, 60), {"slowness": 2.0}),
}
FIRST_BREAK = 0.1
# Friction angles of the discs of biaxial tests [degrees], and their packings.
ANGLES, BIAXIAL = (10.0, 15.0, 20.0, 25.0, 30.0), (1, 2, 3)


def path_of(length, change):
    """Returns the ramp of a scene: that of the row, up to another head or with the rise after its first break stretched."""
    first, second, (end, top) = ramp(length)
    largest, slowness = change.get("largest", top), change.get("slowness", 1.0)
    rise = (end - FIRST_BREAK) / (top - second[1]) * slowness
    return first, second, (round(FIRST_BREAK + (largest - second[1]) * rise, 9), largest)


def values_of(length, seed, path, change):
    """Returns the values of a run of a scene; larger heads have shorter time steps."""
    bed = depth(length)
    values = settings(length, seed, path)
    box = values["grains.initial.growth.box.to"][0]
    step, ratio = "fluid.lattice_boltzmann.time_step", ramp(length)[-1][1] / path[-1][1]
    return values | {
        step: round(values[step] * ratio, 8),
        "contact.linear.friction_angle_degrees": change.get("discs", FRICTION),
        "contact.linear.pairs[0].friction_angle_degrees": change.get("cover", 0.0),
        "grains.initial.growth.box.to": [box, *metres(bed - change.get("play", LOOSE))],
    }


def solid_fraction(folder, length):
    """Returns the solid fraction of the bed below the cover at the start, without its edges."""
    low, high = 2 * DIAMETER, (depth(length) - 2) * DIAMETER
    start, stop = (CHAMBER + 2) * DIAMETER, (CHAMBER + length - 4) * DIAMETER
    with open_run(folder) as results:
        grains = next(iter(results.grains))
        x, y, radii = grains.positions[:, 0], grains.positions[:, 1], grains["radius"]
    inside = (x > start) & (x < stop) & (y > low) & (y < high)
    return float(np.pi * np.sum(radii[inside] ** 2) / ((stop - start) * (high - low)))


def strength(angle):
    """Runs biaxial tests of discs of a friction angle, and returns the friction angles of the packings at the peak and at strains of 6 to 8 % [degrees], and the folders."""
    found, folders = [], []
    for seed in BIAXIAL:
        change = {"grains.initial.growth.seed": seed, "contact.linear.friction_angle_degrees": angle}
        folders.append(run(f"laboratory/biaxial-{angle:g}-degrees-{seed}", "laboratory/biaxial.json", change))
        with open_run(folders[-1]) as results:
            answers, _ = MEASURES["biaxial"](of_solver("biaxial", results))
        late = answers["stress_ratio_at_6_to_8_percent"]
        found.append((answers["peak_friction_angle"], math.degrees(math.asin((late - 1) / (late + 1)))))
    return list(zip(*found)), folders


def main():
    rows, answers, folders = [], [], []
    for angle in ANGLES:
        for quantity, column in zip(("peak_friction_angle", "late_friction_angle"), (strength(angle)[0])):
            answers.append((f"biaxial test, discs of {angle:g} degrees", "", quantity, len(column), *map(float, interval(column))))
        folders += strength(angle)[1]
    for scene, (lengths, change) in SCENES.items():
        points = []
        for length in lengths:
            values = []
            for seed in PACKINGS[length]:
                path = path_of(length, change)
                name = f"{length}-{seed}" + ("" if not change else f"-{scene.replace(' ', '-')}")
                case = settings(length, seed, path) if not change else values_of(length, seed, path, change)
                folder = run(f"piping_grains/{name}", "piping_grains/case.json", case, may_fail=True)
                folders.append(folder)
                quarter, half, far = answers_of(course(folder, length, path))[1:4]
                fraction = solid_fraction(folder, length)
                slides = fraction * EXCESS * math.tan(math.radians(change.get("discs", FRICTION)))
                values.append((quarter, half, far, fraction, slides))
                points.append((length, half))
                rows.append((scene, length, seed, *map(float, values[-1])))
            for quantity, column in zip(("front_0.25_L", "front_0.5_L", "front_0.9_L", "solid_fraction", "friction_of_the_layer"), zip(*values)):
                column = [value for value in column if not math.isnan(value)]
                if column:
                    answers.append((scene, length, quantity, len(column), *map(float, interval(column))))
        good = [point for point in points if not math.isnan(point[1])]
        if len({length for length, _ in good}) > 1:
            slope, half = exponent(*zip(*good))
            answers.append((scene, "all", "exponent_front_0.5_L", len(good), slope, "", half))
    columns = ["scene", "length_over_d", "packing", "gradient_front_0.25_L", "gradient_front_0.5_L", "gradient_front_0.9_L", "solid_fraction", "friction_of_the_layer"]
    table("piping_grains_reasons_runs", columns, rows)
    note = f"gradients are H/L; friction of the layer: solid fraction times 1.5 tan(friction angle); processor time: {seconds(folders):.0f} s"
    table("piping_grains_reasons", ["scene", "length_over_d", "quantity", "packings", "mean", "scatter", "half_width_95"], answers, note)


if __name__ == "__main__":
    main()
