"""Backward erosion piping of discs below a rigid cover: heads at which grains move, at which the pipe grows and at which water breaks through, against L."""

import math

import numpy as np
from runs import STUDENT, interval, run, seconds, table
from solver_results import open_run

CASE = "piping_grains/case.json"
DIAMETER, VISCOSITY, GRAVITY, EXCESS, FRICTION, BEDDING = 1e-3, 5e-6, 9.81, 1.5, 20.0, 37.0
CHAMBER, DITCH, OVERHEAD, LOOSE = 2, 4, 3, 0.3
# Packings for each length of the cover in diameters, and the largest H/L of the ramp. That of 240 diameters, a row of its own, ends where the front of the others
# has passed 0.9 L, before the water breaks through.
PACKINGS = {30: 5, 60: 5, 120: 5}
LARGEST = {30: 0.65, 60: 0.65, 120: 0.65, 240: 0.5}
RISE = 0.45 / 1.1
# Springs of long covers [N/m] instead of 1e5: the weight compresses the bed when the run starts, by a volume that grows as L³ over the stiffness, and this water
# leaves through the ditch, at 240 diameters so fast that the run fails.
STIFFER = {240: 8e5}
# Heads over L that stay, for the first packing.
HELD = {30: (0.3, 0.36, 0.46), 60: (0.4, 0.5)}
FRONTS = (0.25, 0.5, 0.9)


def ramp(length):
    """Returns the ramp of a length: times and heads over L, the same for each length up to its end."""
    return (0.0, 0.0), (0.1, 0.2), (round(0.1 + (LARGEST[length] - 0.2) / RISE, 9), LARGEST[length])


def stay(head):
    """Returns a ramp that ends at a head over L after a third of the run."""
    return (0.0, 0.0), (0.1, 0.2), (0.4, head), (1.2, head)


def depth(length):
    """Returns the depth of the bed in diameters: a third of the length of the cover."""
    return round(length / 3)


def metres(*diameters):
    """Returns lengths in metres."""
    return [round(value * DIAMETER, 7) for value in diameters]


def settings(length, seed, path):
    """Returns the values of a run: all lengths and the table of the pressures, half of the head on each side of zero."""
    bed = depth(length)
    start, stop = CHAMBER + length, CHAMBER + length + DITCH
    size = [stop + math.ceil(bed / 2) + 3, bed + OVERHEAD]
    pressure = [[time, round(500 * GRAVITY * head * length * DIAMETER, 6)] for time, head in path]
    boundaries = "fluid.lattice_boltzmann.boundaries"
    return {
        "domain.size": metres(*size),
        "fluid.lattice_boltzmann.time_step": round(7.5e-5 * math.sqrt(30 / length), 7),
        f"{boundaries}[0].patch.to": metres(0, bed),
        f"{boundaries}[0].condition.pressure.history": pressure,
        f"{boundaries}[1].patch.from": metres(start, 0),
        f"{boundaries}[1].patch.to": metres(stop, 0),
        f"{boundaries}[1].condition.pressure.history": [[time, 0.0 - value] for time, value in pressure],
        "structures[0].shape.box.to": metres(CHAMBER, bed),
        "structures[1].shape.box.from": metres(-1, bed),
        "structures[1].shape.box.to": metres(start, size[1] + 1),
        "structures[2].shape.box.from": metres(stop, bed),
        "structures[2].shape.box.to": metres(size[0] + 1, size[1] + 1),
        "grains.initial.growth.box.to": metres(size[0], bed - LOOSE),
        "grains.initial.growth.seed": seed,
        "grains.cut[0].box.from": metres(start, bed - 2),
        "grains.cut[0].box.to": metres(stop, size[1]),
        "regions[0].box.from": metres(start, bed - 2.2),
        "regions[0].box.to": metres(stop, size[1]),
        "time.end": path[-1][0],
    }


def front(moved, start, length):
    """Returns how far below the cover grains have moved, from the ditch on, in diameters: gaps of up to three diameters do not end it."""
    edge = CHAMBER + length
    reach = 0.0
    for distance in np.sort(edge - start[moved, 0] / DIAMETER):
        if distance > reach + 3:
            break
        reach = max(reach, distance)
    return reach


def course(folder, length, path):
    """Returns the rows of a run: time, head over L, front over L, mean displacement below the cover and discharge over head."""
    times, heads = zip(*path)
    rows, start, last = [], None, None
    with open_run(folder) as results:
        discharge = results.probes["discharge"].groupby("time").discharge.mean()
        for grains in results.grains:
            positions = dict(zip(grains["id"], grains.positions))
            if start is None:
                start = positions
                names = list(start)
                first = np.array([start[name] for name in names])
                last = first.copy()
                below = first[:, 0] < (CHAMBER + length) * DIAMETER
            for index, name in enumerate(names):
                last[index] = positions.get(name, np.inf)
            shift = np.minimum(np.linalg.norm(last - first, axis=1) / DIAMETER, length)
            head = float(np.interp(grains.time, times, heads))
            near = discharge[(discharge.index > grains.time - 0.013) & (discharge.index < grains.time + 0.013)]
            mean = float(np.median(shift[below]))
            flow = float(near.mean() / (head * length * DIAMETER)) if head > 0 and len(near) else math.nan
            rows.append((float(grains.time), head, front(below & (shift > 1), first, length) / length, mean, flow))
    return rows


def permeability(rows, length):
    """Returns the permeability over d², from the discharge at H/L = 0.2 to 0.3; the way is L and 0.44 D, that of a strip that ends below a surface."""
    flow = np.mean([row[4] for row in rows if 0.2 < row[1] < 0.3])
    bed = depth(length)
    return flow * (length + 0.44 * bed) / bed * VISCOSITY / GRAVITY / DIAMETER**2


def rule(kappa, length, angle):
    """Returns H/L of the rule of Sellmeijer et al. (2011) for discs: eta 0.25, without the factors of sieve curve and density."""
    ratio = depth(length) / length
    shape = 0.91 * ratio ** (0.28 / (ratio**2.8 - 1) + 0.04)
    return 0.25 * EXCESS * math.tan(math.radians(angle)) * (kappa * length) ** (-1 / 3) * shape


def answers_of(rows):
    """Returns heads over L: first grain below the cover, front at its fractions of L, bed moved by a quarter diameter, twice the first conductance for good."""
    base = np.mean([row[4] for row in rows if 0.2 < row[1] < 0.3])
    tests = [lambda row: row[2] > 0] + [lambda row, part=part: row[2] >= part for part in FRONTS]
    tests.append(lambda row: row[3] > 0.25)
    heads = [next((row[1] for row in rows if test(row)), math.nan) for test in tests]
    low = max(index for index, row in enumerate(rows) if not (row[1] > 0.2 and row[4] > 2 * base))
    return [*heads, rows[low + 1][1] if low + 1 < len(rows) else math.nan]


NAMES = ("first_grain", "front_0.25_L", "front_0.5_L", "front_0.9_L", "bed_moves", "water_breaks_through")


def exponent(lengths, heads):
    """Returns slope and half width of its 95 % interval in the regression of log(H/L) on log(L)."""
    x, y = np.log(lengths), np.log(heads)
    slope, offset = np.polyfit(x, y, 1)
    rest = np.sum((y - slope * x - offset) ** 2) / (len(x) - 2)
    return float(slope), float(STUDENT.get(len(x) - 2, 2.2) * math.sqrt(rest / np.sum((x - x.mean()) ** 2)))


def held():
    """Runs heads that stay and returns their courses and folders."""
    courses = []
    for length, heads in HELD.items():
        for head in heads:
            folder = run(f"piping_grains/{length}-held-{head}", CASE, settings(length, 1, stay(head)), may_fail=True)
            courses.append(([(length, 1, head, *row) for row in course(folder, length, stay(head))], folder))
    return courses


def climb(length, seed):
    """Runs a packing under its ramp and returns its folder; where springs are stiffer, the packing is that of springs of 1e5 N/m."""
    name, values = f"piping_grains/{length}-{seed}", settings(length, seed, ramp(length))
    if length in STIFFER:
        grown = run(f"{name}-grown", CASE, values | {"time.end": values["fluid.lattice_boltzmann.time_step"]}, may_fail=True)
        sample = grown.parent / f"{length}-{seed}-sample.csv"
        with open_run(grown) as results:
            grains = next(iter(results.grains))
            order = np.argsort(grains["id"])
            rows = np.column_stack((grains.positions[order, :2], grains["radius"][order]))
        np.savetxt(sample, rows, fmt="%.17g", delimiter=",", header="x,y,radius", comments="")
        values = {path: value for path, value in values.items() if not path.startswith("grains.initial.")}
        values |= {"grains.initial": {"file": {"path": str(sample)}}, "contact.linear.normal_stiffness.absolute": STIFFER[length]}
    return run(name, CASE, values, may_fail=True)


def tables(packings, name, steady=()):
    """Runs packings of each length, and writes their tables with the courses and folders of heads that stay."""
    rows, answers, curves, folders, points = [], [], [], [], []
    for length, count in packings.items():
        values = []
        for seed in range(1, count + 1):
            folders.append(climb(length, seed))
            part = course(folders[-1], length, ramp(length))
            curves += [(length, seed, "ramp", *row) for row in part]
            kappa = permeability(part, length)
            values.append((*answers_of(part), kappa, rule(kappa, length, BEDDING), rule(kappa, length, FRICTION)))
            points.append((length, values[-1]))
            rows.append((length, seed, *map(float, values[-1])))
        for quantity, column in zip((*NAMES, "permeability_over_d2", "rule_37_degrees", "rule_20_degrees"), zip(*values)):
            column = [value for value in column if not math.isnan(value)]
            if column:
                answers.append((length, quantity, len(column), *map(float, interval(column))))
    for index, quantity in enumerate(NAMES):
        good = [(length, value[index]) for length, value in points if not math.isnan(value[index])]
        if len({length for length, _ in good}) > 1:
            slope, half = exponent(*zip(*good))
            answers.append(("all", f"exponent_{quantity}", len(good), slope, "", half))
    for part, folder in steady:
        curves += part
        folders.append(folder)
    table(f"{name}_runs", ["length_over_d", "packing", *(f"gradient_{quantity}" for quantity in NAMES), "permeability_over_d2", "rule_37_degrees", "rule_20_degrees"], rows)
    table(f"{name}_curves", ["length_over_d", "packing", "head", "time_s", "gradient", "front_over_length", "median_displacement_over_d", "discharge_over_head_m_s"], curves)
    note = f"gradients are H/L; processor time: {seconds(folders):.0f} s"
    table(name, ["length_over_d", "quantity", "packings", "mean", "scatter", "half_width_95"], answers, note)


def main():
    tables(PACKINGS, "piping_grains", held())


if __name__ == "__main__":
    main()
