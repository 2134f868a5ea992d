"""A round jet on a bed of beads in three dimensions: threshold as Shields numbers at two distances, and the free jet compared with Schlichting (1933)."""

import numpy as np
from runs import interval, run, seconds, table
from solver_results import open_run

NOZZLE, VISCOSITY, DIAMETER, CENTRE = 0.002, 1e-5, 1e-3, 0.005
WEIGHT = 1.5 * 9.81 * DIAMETER
# Heights of the box [m], packings of each, and time steps [s].
HEIGHTS, PACKINGS, STEPS = {"near": 0.008, "far": 0.0115}, {"near": (1, 2), "far": (1,)}, {"near": 5e-5, "far": 4e-5, "free": 4e-5}
# Mean velocities at the nozzle [m/s], the time that each of them stays and that of the rise to it [s].
SPEEDS = {"near": (0.1, 0.11, 0.12, 0.13, 0.14, 0.15, 0.16), "far": (0.12, 0.135, 0.15, 0.165, 0.18, 0.195, 0.21), "free": (0.12, 0.16, 0.2)}
STAYS, RISE = {"near": 0.06, "far": 0.06, "free": 0.12}, 0.005
FREE = 0.0135
# Numbers of beads that have moved by a diameter at the threshold; the first was chosen before the runs, the second after the first run.
BEADS = (1, 10)
BOUNDARIES = "fluid.lattice_boltzmann.boundaries"


def stairs(name):
    """Returns the table of times and mean velocities at the nozzle."""
    rows = [[0.0, 0.0]]
    for place, speed in enumerate(SPEEDS[name]):
        rows += [[round(place * STAYS[name] + RISE, 6), speed], [round((place + 1) * STAYS[name], 6), speed]]
    return rows


def settings(name, height, changes):
    """Returns the values of a run in a box of a height."""
    side = 0.01
    return {
        "domain.size": [side, side, height],
        f"{BOUNDARIES}[0].patch.to": [0.006, 0.006, height],
        f"{BOUNDARIES}[0].condition.velocity.history": stairs(name),
        f"{BOUNDARIES}[1].patch.to": [0, side, height],
        f"{BOUNDARIES}[2].patch.to": [side, side, height],
        f"{BOUNDARIES}[3].patch.to": [side, 0, height],
        f"{BOUNDARIES}[4].patch.to": [side, side, height],
        "fluid.lattice_boltzmann.time_step": STEPS[name],
        "probes[0].at.line.to": [0.005, 0.005, round(height - 1e-4, 6)],
        "probes[0].at.line.points": round(height / 1e-4) - 1,
        "time.end": round(len(SPEEDS[name]) * STAYS[name], 6),
    } | changes


def axis(folder, height):
    """Returns the distances from the nozzle and, at the end of each step of the free jet, the velocity on the axis away from it over the mean at the nozzle."""
    with open_run(folder) as results:
        samples = results.probes["axis"]
    times, profiles = samples.time.unique(), []
    for place, speed in enumerate(SPEEDS["free"], start=1):
        part = samples[samples.time == times[np.abs(times - place * STAYS["free"]).argmin()]].sort_values("z", ascending=False)
        profiles.append(-part.velocity_z.to_numpy() / speed)
    return height - part.z.to_numpy(), np.array(profiles)


def local(distance, speed, origin):
    """Returns the velocity of Schlichting's jet at a distance from the nozzle; its virtual origin, known at the last velocity of the free jet, grows with U as its length does."""
    return speed**2 * NOZZLE / VISCOSITY / (8 * (distance / NOZZLE + origin * speed / SPEEDS["free"][-1]))


def schlichting(distances, velocities, speed):
    """Returns slope over that of Schlichting's jet, U/u = 8 (x + x0)/(Re D) for the profile of a pipe, and virtual origin over D, by the part from 2.5 to 5 D."""
    part = (distances > 2.5 * NOZZLE) & (distances < 5 * NOZZLE)
    slope, offset = np.polyfit(distances[part] / NOZZLE, 1 / velocities[part], 1)
    return slope / (8 / (speed * NOZZLE / VISCOSITY)), offset / slope


def threshold(folder, part, beads=1):
    """Returns the time at which so many beads below the jet lie `part` diameters from their places at the start, the distance of the farthest from the axis, and
    the surface there.

    Below the jet is within three diameters of the axis; the surface is the mean of the highest beads at nine points within one diameter.
    """
    with open_run(folder) as results:
        series = list(results.grains)
        order = np.argsort(series[0]["id"])
        start, radii = series[0].positions[order], series[0]["radius"][order]
        off = np.linalg.norm(start[:, :2] - CENTRE, axis=1)
        points = CENTRE + DIAMETER * np.mgrid[-1:2, -1:2].reshape(2, -1).T
        surface = np.mean([(start[:, 2] + radii)[np.linalg.norm(start[:, :2] - point, axis=1) < 0.75 * DIAMETER].max() for point in points])
        below = off < 3 * DIAMETER
        for grains in series[1:]:
            moved = np.linalg.norm(grains.positions[np.argsort(grains["id"])] - start, axis=1) * below
            if np.sort(moved)[-beads] > part * DIAMETER:
                return grains.time, float(off[moved.argmax()] / DIAMETER), float(surface)
    return None, None, float(surface)


def bounds(name, time, distance, origin):
    """Returns the last step before a time and the step at it: velocity, Reynolds number, Shields numbers of the jet and of its velocity at the bed."""
    place, rows = int((time - 1e-9) // STAYS[name]), []
    for speed in (SPEEDS[name][place - 1] if place else 0.0, SPEEDS[name][place]):
        there = local(distance, speed, origin)
        rows.append((speed, speed * NOZZLE / VISCOSITY, speed**2 / WEIGHT, there**2 / WEIGHT))
    return rows


def main():
    flow = {"grains": None, "contact": None, "box_walls": [], "box_wall_material": None, "coupling": None, "output.grains": None}
    corners = ((0, 0), (0.01, 0), (0, 0), (0, 0.01))
    flow |= {f"{BOUNDARIES}[{place}].patch.from": [*corner, 0] for place, corner in enumerate(corners, start=1)}
    folders, rows, found = [], [], {}
    for name, height in HEIGHTS.items():
        for seed in PACKINGS[name]:
            changes = {"grains.initial.deposition.seed": seed, "grains.initial.deposition.box.to": [0.01, 0.01, round(height - 1e-4, 6)]}
            folder = run(f"round-jet/{name}-{seed}", "round_jet/case.json", settings(name, height, changes))
            folders.append(folder)
            found[name, seed] = threshold(folder, 0.25)[0], {beads: threshold(folder, 1.0, beads) for beads in BEADS}
    folders.append(run("round-jet/free", "round_jet/case.json", settings("free", FREE, flow)))
    distances, profiles = axis(folders[-1], FREE)
    slope, origin = schlichting(distances, profiles[-1], SPEEDS["free"][-1])
    answers = []
    for name, beads in ((name, beads) for name in HEIGHTS for beads in BEADS):
        values = []
        for seed in PACKINGS[name]:
            first, (time, place, surface) = found[name, seed][0], found[name, seed][1][beads]
            distance = HEIGHTS[name] - surface
            if time is None:
                rows.append((name, beads, seed, distance / NOZZLE, f"above {SPEEDS[name][-1]}", "", "", "", first or "", "", ""))
                continue
            low, high = bounds(name, time, distance, origin)
            values.append([0.5 * (one + other) for one, other in zip(low, high)])
            rows.append((name, beads, seed, distance / NOZZLE, *(f"{one:.4g} to {other:.4g}" for one, other in zip(low, high)), first, time, place))
        for quantity, column in zip(("speed", "reynolds_of_jet", "shields_of_jet", "shields_local"), zip(*values)):
            answers.append((name, beads, quantity, *map(float, interval(column))))
    last = f"free jet of {SPEEDS['free'][-1]} m/s"  # the slower ones have not reached their length yet
    answers += [(last, "", "slope_over_schlichting", float(slope), "", ""), (last, "", "virtual_origin_over_nozzle", float(origin), "", "")]
    columns = ["distance", "beads", "packing", "distance_over_nozzle", "speed_m_s", "reynolds_of_jet", "shields_of_jet", "shields_local", "moved_by_a_quarter_s",
               "moved_by_a_diameter_s", "distance_from_axis_d"]
    table("round_jet_runs", columns, rows, "from the last step that holds to the first that erodes")
    curves = [(float(x / NOZZLE), *map(float, u)) for x, u in zip(distances, profiles.T)][::4]
    table("round_jet_axis", ["distance_over_nozzle", *(f"velocity_over_mean_at_{speed}" for speed in SPEEDS["free"])], curves)
    table("round_jet", ["distance", "beads", "quantity", "mean", "scatter", "half_width_95"], answers, f"processor time: {seconds(folders):.0f} s")


if __name__ == "__main__":
    main()
