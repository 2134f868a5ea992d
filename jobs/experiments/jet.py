"""A plane jet on a bed of discs: threshold as Shields numbers at two distances, and the free jet compared with Bickley (1937)."""

import numpy as np
from runs import interval, run, seconds, table
from solver_results import open_run

SLOT, VISCOSITY, DIAMETER, GRAVITY, EXCESS, SPEED = 0.002, 5e-6, 5e-4, 9.81, 1.5, 0.22
HEIGHTS = {"near": 0.010}
CENTRE, HALF = 0.008, 0.004


def axis(folder, time, below):
    """Returns the velocity on the axis of a free jet at a distance below the slot, at the sample nearest to a time."""
    with open_run(folder) as results:
        samples = results.probes["axis"]
    samples = samples[samples.time == samples.time.unique()[np.abs(samples.time.unique() - time).argmin()]]
    distance = 0.032 - samples.y.to_numpy()
    order = np.argsort(distance)
    return float(np.interp(below, distance[order], -samples.velocity_y.to_numpy()[order]))


def bickley():
    """Compares the decay of the velocity on the axis with u^-3 = (x + x0)/(0.45428^3 U^3 Re b), in which x0 alone is free."""
    speed = 0.1
    uniform = "fluid.lattice_boltzmann.boundaries[0].condition.velocity"
    folder = run("jet/steady", "jet/free.json", {f"{uniform}.profile.uniform": [0, -speed], f"{uniform}.ramp_time": 0.1, "time.end": 1.5})
    distances = np.linspace(3 * SLOT, 8 * SLOT, 21)
    velocities = np.array([axis(folder, 1.5, distance) for distance in distances])
    slope, offset = np.polyfit(distances, velocities**-3, 1)
    exact = 1 / (0.45428**3 * speed**3 * (speed * SLOT / VISCOSITY) * SLOT)
    earlier = np.array([axis(folder, 1.3, distance) for distance in distances])
    rows = [(float(x / SLOT), float(u / speed), float(v / speed)) for x, u, v in zip(distances, velocities, earlier)]
    table("jet_axis", ["distance_over_slot", "velocity_over_mean", "velocity_over_mean_0.2_s_earlier"], rows)
    return folder, slope / exact, offset / slope / SLOT


def threshold(folder):
    """Returns time of the first grain in the middle that moved by a quarter of a diameter, out of its hollow, and the height of the bed there at the start."""
    with open_run(folder) as results:
        series = list(results.grains)
        ids, start, radii = series[0]["id"], series[0].positions, series[0]["radius"]
        order = np.argsort(ids)
        middle = np.abs(start[order, 0] - CENTRE) < HALF
        surface = np.mean([
            (start[:, 1] + radii)[np.abs(start[:, 0] - x) < DIAMETER].max() for x in np.arange(CENTRE - 0.002, CENTRE + 0.0021, 0.0005)
        ])
        for grains in series[1:]:
            now = np.argsort(grains["id"])
            moved = np.linalg.norm((grains.positions[now] - start[order])[middle, :2], axis=1)
            if moved.max() > DIAMETER / 4:
                return grains.time, surface
    return None, surface


def main():
    steady, slope, origin = bickley()
    free = run("jet/free", "jet/free.json")
    folders, rows, answers = [steady, free], [], []
    weight = EXCESS * GRAVITY * DIAMETER
    for name, height in HEIGHTS.items():
        values = []
        for seed in (1, 2, 3):
            path = "fluid.lattice_boltzmann.boundaries"
            folder = run(f"jet/{name}-{seed}", "jet/case.json", {
                "domain.size": [0.016, height],
                "grains.initial.deposition.seed": seed,
                "grains.initial.deposition.box.to": [0.016, height - 1e-4],
                f"{path}[0].patch.to": [0.009, height],
                f"{path}[1].patch.to": [0, height],
                f"{path}[2].patch.to": [0.016, height],
            })
            folders.append(folder)
            time, surface = threshold(folder)
            if time is None:
                rows.append((name, seed, float((height - surface) / SLOT), "none", "", "", ""))
                continue
            speed, local = SPEED * time, axis(free, time, height - surface)
            values.append((speed * SLOT / VISCOSITY, speed**2 / weight, local**2 / weight))
            rows.append((name, seed, float((height - surface) / SLOT), float(speed), *map(float, values[-1])))
        if values:
            for quantity, column in zip(("reynolds_of_jet", "shields_of_jet", "shields_local"), zip(*values)):
                answers.append((name, quantity, *map(float, interval(column))))
    answers.append(("free jet", "slope_over_bickley", float(slope), "", ""))
    answers.append(("free jet", "virtual_origin_over_slot", float(origin), "", ""))
    table("jet_runs", ["distance", "packing", "distance_over_slot", "speed_m_s", "reynolds_of_jet", "shields_of_jet", "shields_local"], rows)
    table("jet", ["distance", "quantity", "mean", "scatter", "half_width_95"], answers, f"processor time: {seconds(folders):.0f} s")


if __name__ == "__main__":
    main()
