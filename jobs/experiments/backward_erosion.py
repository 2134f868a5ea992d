"""Backward erosion piping at true size: ten sands and geometries beside Sellmeijer's rule, scale, cells, and exits in three dimensions."""

import json
import math

from runs import run, seconds, table

GRAVITY = 9.81
CASE = "backward_erosion/case.json"
OWN = "fluid.darcy.backward_erosion"

# Name, source, kind, L [m], D [m], d70 [m], permeability [m2], measured head [m] or head of another program of the model.
SANDS = [
    ("small box, fine", "parameters of small tests", "box", 0.34, 0.101, 1.54e-4, 8e-12, None),
    ("small box, medium", "parameters of small tests", "box", 0.30, 0.10, 2.0e-4, 1.5e-11, None),
    ("small box, coarse", "parameters of small tests", "box", 0.30, 0.10, 4.0e-4, 6e-11, None),
    ("medium box", "parameters of medium tests", "box", 1.45, 0.40, 2.0e-4, 1.5e-11, None),
    ("IJkdijk 1", "Sellmeijer et al. 2011", "basin", 15, 3.0, 1.8e-4, 8.0e-5 * 1.3e-6 / GRAVITY, 2.30),
    ("IJkdijk 3", "Sellmeijer et al. 2011", "basin", 15, 3.0, 1.8e-4, 8.0e-5 * 1.3e-6 / GRAVITY, 2.10),
    ("IJkdijk 2", "Sellmeijer et al. 2011", "basin", 15, 2.85, 2.6e-4, 1.4e-4 * 1.3e-6 / GRAVITY, 1.75),
    ("S2-2, 30 m", "Pol et al. 2024", "dike", 30, 10, 2.0e-4, 2.2e-11, None),
    ("D-Geo Flow 30, 10 m", "validation of D-Geo Flow", "dike", 30, 10, 3.0e-4, 1.157e-12, 11.3),
    ("D-Geo Flow 60, 20 m", "validation of D-Geo Flow", "dike", 60, 20, 3.0e-4, 1.157e-12, 18.2),
    ("D-Geo Flow 90, 30 m", "validation of D-Geo Flow", "dike", 90, 30, 3.0e-4, 1.157e-12, 24.1),
    ("D-Geo Flow 30, 20 m", "validation of D-Geo Flow", "dike", 30, 20, 3.0e-4, 1.157e-12, 9.9),
    ("D-Geo Flow 30, 30 m", "validation of D-Geo Flow", "dike", 30, 30, 3.0e-4, 1.157e-12, 9.4),
]


def head(name, top, side=False):
    """Returns a boundary with a head of 0.1 m above the ground, of 0.2 m for the drive."""
    return {"name": name, "face": "x_min" if side else "y_max", "condition": {"head": {"value": top}}}


def plane(kind, length, thickness, cells, d70, permeability, diameter, heel=False, opening=None):
    """Returns the changes of the case for a section; with `heel` water enters through a filter over the depth at the heel, `opening` is the width of the exit in cells.

    box: water enters through a filter over the depth and leaves through a sand surface of a quarter of the length.
    basin: sand surfaces on both sides, as long as the dike. dike: the same upstream, and a ditch of a cell behind the toe, below a cover.
    """
    edge = length / cells
    layers = max(round(thickness / edge), 1)
    side = heel or kind == "box"
    before = 0 if side else length
    behind = {"box": math.ceil(cells / 4) * edge, "basin": length, "dike": length}[kind]
    exit_width = opening * edge if opening else edge if kind == "dike" else behind
    top = layers * edge
    inlet = head("drive", top + 0.2 * length, side=side)
    if not side:
        inlet["patch"] = {"from": [0, 0], "to": [before, top]}
    outlet = head("exit", top + 0.1 * length)
    toe = before + length
    outlet["patch"] = {"from": [toe, 0], "to": [toe + exit_width, top]}
    reach = max(0.75, 4 / cells) * length
    return {
        "domain.size": [toe + behind, top],
        "domain.spacing": edge,
        "fluid.darcy.zones[0].permeability": {"value": permeability},
        "fluid.darcy.boundaries": [inlet, outlet],
        f"{OWN}.pipe": {"from": [toe, top], "to": [toe - reach, top]},
        f"{OWN}.d70": d70,
        f"{OWN}.diameter": diameter,
        f"{OWN}.grain_density": 2500 if kind == "basin" else 2650,
        f"{OWN}.rule": {"length": length, "thickness": top},
    }


def answers(folder):
    """Returns the answers of a run."""
    with open(folder / "summary.json", encoding="utf-8") as file:
        return json.load(file)["backward_erosion"]


def extrapolated(heads):
    """Returns the limit of heads on cells halved twice, by their own order, and the interval of the finest (factor 3 of the grid convergence index)."""
    coarse, middle, fine = heads
    first, second = middle - coarse, fine - middle
    order = math.log2(first / second) if first * second > 0 else math.nan
    held = min(max(order, 0.5), 2) if order == order else 0.5
    change = second / (2**held - 1)
    return fine + change, 3 * abs(change), order


def sands(folders):
    """Runs the ten sands with both diameters and compares with the rule and the heads that were measured."""
    rows = []
    for name, source, kind, length, thickness, d70, permeability, known in SANDS:
        label = name.replace(" ", "_").replace(",", "")
        found = {}
        for diameter in ("d70", "sellmeijer2011"):
            values = plane(kind, length, thickness, 64, d70, permeability, diameter)
            folder = run(f"backward_erosion/{label}_{diameter}", CASE, values)
            folders.append(folder)
            found[diameter] = answers(folder)
        grids = [found["sellmeijer2011"]["critical_head"]]
        for cells in (32, 16):
            values = plane(kind, length, thickness, cells, d70, permeability, "sellmeijer2011")
            folder = run(f"backward_erosion/{label}_{cells}", CASE, values)
            folders.append(folder)
            grids.insert(0, answers(folder)["critical_head"])
        limit, half, order = extrapolated(grids)
        own = found["sellmeijer2011"]
        rows.append([
            name, source, kind, length, thickness, d70, permeability, own["critical_head"], half, limit, order, own["rule_head"],
            own["head_over_rule"], own["critical_length"] / length, 0.5 * math.tanh(2 * thickness / length),
            found["d70"]["critical_head"], known if known is not None else "",
        ])
    table(
        "backward_erosion", ["name", "source", "kind", "L_m", "D_m", "d70_m", "permeability_m2", "head_m", "interval_m", "limit_m", "order",
        "rule_m", "head_over_rule", "critical_length_over_L", "critical_length_rule", "head_with_d70_m", "measured_or_other_program_m"], rows,
        "64 cells along L; interval: three times the change to the limit; rule and head with the diameter of 2011",
    )
    return rows


def scale(folders):
    """Returns the exponent of the head over the length in sections of one shape."""
    rows = []
    for length in (0.3, 3, 30, 300):
        folder = run(f"backward_erosion/scale_{length}", CASE, plane("box", length, length / 3, 48, 2e-4, 1.5e-11, "d70"))
        folders.append(folder)
        rows.append(("section", length, answers(folder)["critical_head"]))
    return rows


def ends(folders):
    """Returns head over rule of standard dikes with other inlets and exits: which of them makes the head differ from the rule."""
    rows = []
    for thickness in (10, 30):
        for heel in (False, True):
            for opening in (1, 4, 16):
                values = plane("dike", 30, thickness, 64, 3e-4, 1.157e-12, "sellmeijer2011", heel, opening)
                folder = run(f"backward_erosion/ends_{thickness}_{'heel' if heel else 'surface'}_{opening}", CASE, values)
                folders.append(folder)
                rows.append(("filter over the depth at the heel" if heel else "sand surface as long as the dike", thickness / 30, opening / 64, answers(folder)["head_over_rule"]))
    table("backward_erosion_ends", ["inlet", "D_over_L", "width_of_exit_over_L", "head_over_rule"], rows, "standard dikes of 30 m, sand of the D-Geo Flow rows, 64 cells along L")


# Heads of a pipe to a hole, w/a = 20, D = L/3, sand S2-2, in DgFlow: Pol, Noordam, Kanning 2024, tables A.4 to A.6.
HOLE = {0.9: 0.084, 3: 0.144, 9: 0.254, 30: 0.470, 90: 0.864}


def box(length, cells, exit_kind):
    """Returns the changes of the case for a box of sand with a hole or a ditch behind the cover: L + L/6 long, 2 L/3 wide, L/3 deep."""
    edge = length / cells
    wide = 2 * (cells // 3) + 1
    middle, top = 0.5 * wide * edge, (cells // 3) * edge
    across = [middle - 0.4 * edge, middle + 0.4 * edge] if exit_kind == "hole" else [0, wide * edge]
    inlet = {"name": "drive", "face": "x_min", "condition": {"head": {"value": top + 0.2 * length}}}
    outlet = {"name": "exit", "face": "z_max", "condition": {"head": {"value": top + 0.1 * length}}}
    outlet["patch"] = {"from": [length, across[0], 0], "to": [length + edge, across[1], top]}
    return {
        "domain.size": [length + (cells // 6) * edge, wide * edge, top],
        "domain.spacing": edge,
        "gravity": [0, 0, -GRAVITY],
        "fluid.darcy.zones[0].permeability": {"value": 2.2e-11},
        "fluid.darcy.boundaries": [inlet, outlet],
        f"{OWN}.pipe": {"from": [length, middle, top], "to": [0.25 * length, middle, top]},
        f"{OWN}.d70": 2e-4,
        f"{OWN}.rule": None,
        f"{OWN}.width": {"ratio": 20},
    }


def exits(folders):
    """Runs boxes with a hole and a ditch at five lengths."""
    rows = []
    for length, published in HOLE.items():
        for exit_kind in ("hole", "ditch"):
            folder = run(f"backward_erosion/{exit_kind}_{length}", CASE, box(length, 24, exit_kind))
            folders.append(folder)
            found = answers(folder)
            rows.append((exit_kind, length, found["critical_head"], found["critical_length"] / length, found["exit_width"],
                         published if exit_kind == "hole" else ""))
    for cells in (12, 48):
        folder = run(f"backward_erosion/hole_3_{cells}", CASE, box(3, cells, "hole"))
        folders.append(folder)
        found = answers(folder)
        rows.append((f"hole, {cells} cells", 3, found["critical_head"], found["critical_length"] / 3, found["exit_width"], ""))
    return rows


def exponent(rows):
    """Returns the exponent of head over length by least squares of the logarithms."""
    points = [(math.log(length), math.log(value / length)) for length, value in rows]
    count = len(points)
    mean = [sum(point[k] for point in points) / count for k in (0, 1)]
    return sum((x - mean[0]) * (y - mean[1]) for x, y in points) / sum((x - mean[0]) ** 2 for x, _ in points)


def main():
    folders = []
    rows = sands(folders)
    sections = scale(folders)
    others = exits(folders)
    ends(folders)
    powers = {
        "section": exponent([row[1:3] for row in sections]),
        "hole": exponent([row[1:3] for row in others if row[0] == "hole"]),
        "ditch in a box with one pipe": exponent([row[1:3] for row in others if row[0] == "ditch"]),
        "hole, published": exponent(list(HOLE.items())),
    }
    scales = [[kind, length, value, "", "", ""] for kind, length, value in sections] + [list(row) for row in others]
    scales += [[f"exponent of head over length, {kind}", "", power, "", "", ""] for kind, power in powers.items()]
    table("backward_erosion_scale", ["exit", "L_m", "head_m", "critical_length_over_L", "exit_width_m", "published_m"], scales)
    ratios = [row[12] for row in rows]
    print(f"head over rule {min(ratios):.3f} to {max(ratios):.3f}; exponents {powers}; {seconds(folders):.0f} s, {len(folders)} runs")


if __name__ == "__main__":
    main()
