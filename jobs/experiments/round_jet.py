"""A round jet on a bed of beads in three dimensions: threshold as Shields numbers at two distances, and the free jet compared with Schlichting (1933)."""

import numpy as np
from runs import extend, interval, run, seconds, table
from solver_results import open_run

NOZZLE, VISCOSITY, DIAMETER, CENTRE = 0.002, 1e-5, 1e-3, 0.005
WEIGHT = 1.5 * 9.81 * DIAMETER
# Heights of the box [m], packings, spacings of the cells [m] and time steps [s].
HEIGHTS, PACKINGS = {"near": 0.008, "crater": 0.008, "far": 0.0115}, {"near": (1, 2, 3), "crater": (1,), "far": (1, 2, 3)}
SPACINGS, STEPS = 1 / 6000, {"near": 4.8e-5, "crater": 4.8e-5, "far": 4.8e-5, "free": 4e-5}
# Mean velocities at the nozzle [m/s], the time that each of them stays and that of the rise to it [s]. Above 0.2 m/s the cells would be too large.
SPEEDS = {"near": (0.14, 0.16, 0.18, 0.2), "crater": (0.14, 0.16, 0.18, 0.2), "far": (0.14, 0.16, 0.18, 0.2), "free": (0.12, 0.16, 0.2)}
STAYS, RISE = {"near": 0.15, "crater": 0.15, "far": 0.15, "free": 0.12}, 0.005
FREE = 0.0135
# Beads that have moved by a diameter: the first one, and those of a crater; a run ends after the step in which UNTIL beads have.
BEADS, UNTIL = (1, 10), {"near": 1, "crater": 10, "far": 1}
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
        "domain.spacing": SPACINGS,
        f"{BOUNDARIES}[0].patch.to": [0.006, 0.006, height],
        f"{BOUNDARIES}[0].condition.velocity.history": stairs(name),
        f"{BOUNDARIES}[1].patch.to": [0, side, height],
        f"{BOUNDARIES}[2].patch.to": [side, side, height],
        f"{BOUNDARIES}[3].patch.to": [side, 0, height],
        f"{BOUNDARIES}[4].patch.to": [side, side, height],
        "fluid.lattice_boltzmann.time_step": STEPS[name],
        "probes[0].at.line.to": [0.005, 0.005, round(height - 1e-4, 6)],
        "probes[0].at.line.points": round(height / 1e-4) - 1,
        "time.end": STAYS[name] * (len(SPEEDS[name]) if name == "free" else 1),
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


def surface(grains):
    """Returns the height of the bed on the axis: the mean of the highest beads at nine points within one diameter [m]."""
    points = CENTRE + DIAMETER * np.mgrid[-1:2, -1:2].reshape(2, -1).T
    tops = grains.positions[:, 2] + grains["radius"]
    return float(np.mean([tops[np.linalg.norm(grains.positions[:, :2] - point, axis=1) < 0.75 * DIAMETER].max(initial=0) for point in points]))


def surfaces(folder):
    """Returns the height of the bed on the axis at the start and at the end of a run [m]."""
    with open_run(folder) as results:
        series = list(results.grains)
        return surface(series[0]), surface(series[-1])


def threshold(folder, part, beads=1):
    """Returns the time at which so many beads below the jet lie `part` diameters from their places at the start, and the distance of the farthest from the axis.

    Below the jet is within three diameters of the axis.
    """
    with open_run(folder) as results:
        series = list(results.grains)
        start = series[0].positions[np.argsort(series[0]["id"])]
        off = np.linalg.norm(start[:, :2] - CENTRE, axis=1)
        below = off < 3 * DIAMETER
        for grains in series[1:]:
            moved = np.linalg.norm(grains.positions[np.argsort(grains["id"])] - start, axis=1) * below
            if np.sort(moved)[-beads] > part * DIAMETER:
                return grains.time, float(off[moved.argmax()] / DIAMETER)
    return None, None


def climb(name, seed):
    """Runs a packing step by step until its beads have moved or up to the last velocity, and returns its folder and the number of steps."""
    height = HEIGHTS[name]
    changes = {"grains.initial.deposition.seed": seed, "grains.initial.deposition.box.to": [0.01, 0.01, round(height - 1e-4, 6)]}
    folder = run(f"round-jet/{name}-{seed}", "round_jet/case.json", settings(name, height, changes), may_extend=True)
    with open_run(folder) as results:
        steps = round(list(results.grains)[-1].time / STAYS[name])
    while steps < len(SPEEDS[name]) and threshold(folder, 1.0, UNTIL[name])[0] is None:
        steps += 1
        extend(folder, round(steps * STAYS[name], 6))
    return folder, steps


def bounds(name, time, distance, origin):
    """Returns the last step before a time and the step at it: velocity, Reynolds number, Shields numbers of the jet and of its velocity at the bed."""
    place, rows = int((time - 1e-9) // STAYS[name]), []
    for speed in (SPEEDS[name][place - 1] if place else 0.0, SPEEDS[name][place]):
        there = local(distance, speed, origin)
        rows.append((speed, speed * NOZZLE / VISCOSITY, speed**2 / WEIGHT, there**2 / WEIGHT))
    return rows


def study(name, title):
    """Runs the packings at a distance and the free jet, and writes their tables."""
    flow = {"grains": None, "contact": None, "box_walls": [], "box_wall_material": None, "coupling": None, "output.grains": None}
    corners = ((0, 0), (0.01, 0), (0, 0), (0, 0.01))
    flow |= {f"{BOUNDARIES}[{place}].patch.from": [*corner, 0] for place, corner in enumerate(corners, start=1)}
    folders, rows, found = [], [], {}
    for seed in PACKINGS[name]:
        folder, steps = climb(name, seed)
        folders.append(folder)
        found[seed] = threshold(folder, 0.25)[0], {beads: threshold(folder, 1.0, beads) for beads in BEADS}, surfaces(folder), steps
    folders.append(run("round-jet/free", "round_jet/case.json", settings("free", FREE, flow)))
    distances, profiles = axis(folders[-1], FREE)
    slope, origin = schlichting(distances, profiles[-1], SPEEDS["free"][-1])
    answers = []
    for beads in BEADS:
        values = []
        for seed in PACKINGS[name]:
            first, erosion, (start, end), steps = found[seed]
            time, place = erosion[beads]
            distance, crater = HEIGHTS[name] - start, (start - end) / DIAMETER
            if time is None:
                rows.append((name, beads, seed, distance / NOZZLE, f"above {SPEEDS[name][steps - 1]}", "", "", "", first or "", "", "", crater))
                continue
            low, high = bounds(name, time, distance, origin)
            if low[0] == 0:
                words = [f"at most {other:.4g}" for other in high]
            else:
                values.append([0.5 * (one + other) for one, other in zip(low, high)])
                words = [f"{one:.4g} to {other:.4g}" for one, other in zip(low, high)]
            rows.append((name, beads, seed, distance / NOZZLE, *words, first, time, place, crater))
        for quantity, column in zip(("speed", "reynolds_of_jet", "shields_of_jet", "shields_local"), zip(*values)):
            answers.append((name, beads, quantity, len(column), *map(float, interval(column))))
    last = f"free jet of {SPEEDS['free'][-1]} m/s"  # the slower ones have not reached their length yet
    answers += [(last, "", "slope_over_schlichting", 1, float(slope), "", ""), (last, "", "virtual_origin_over_nozzle", 1, float(origin), "", "")]
    columns = ["distance", "beads", "packing", "distance_over_nozzle", "speed_m_s", "reynolds_of_jet", "shields_of_jet", "shields_local", "moved_by_a_quarter_s",
               "moved_by_a_diameter_s", "distance_from_axis_d", "crater_depth_at_end_d"]
    table(f"{title}_runs", columns, rows, "from the last step that holds to the first that erodes; the first step has none before it")
    curves = [(float(x / NOZZLE), *map(float, u)) for x, u in zip(distances, profiles.T)][::4]
    if name == "near":
        table(f"{title}_axis", ["distance_over_nozzle", *(f"velocity_over_mean_at_{speed}" for speed in SPEEDS["free"])], curves)
    table(title, ["distance", "beads", "quantity", "packings", "mean", "scatter", "half_width_95"], answers, f"processor time: {seconds(folders):.0f} s")


def main():
    study("near", "round_jet")


if __name__ == "__main__":
    main()
