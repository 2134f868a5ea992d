#!/usr/bin/env python3
"""Random scenes of soil water: does the interval of `solver estimate` contain the true value, and does the plan keep its promise?

    scenes.py --solver SOLVER --output DIR --table results.csv --seed 1 --count 70
    scenes.py --table results.csv --summary

A scene is a case with an ordinary grid, drawn from a family (the functions below describe them). `solver estimate --cells-only` runs it on
three grids. The true values are exact solutions (exact.py) or, where there are none, the extrapolation of two much finer runs, whose
distance from the finest run is the uncertainty of the reference; that of an exact solution is the effect of the ends of the domain, which
it does not have. A line of the table is an answer of a scene:

    kept            the interval contains the true value
    open            it contains a value within the uncertainty of the reference
    broken          it does not
    no interval     the estimate gives none, because the answers do not converge
    given           the answer is the same on all grids to the last bit: no cells change it
    not judged      the reference is more uncertain than half of the interval

A scene that is already in the table is skipped.
"""

import argparse
import csv
import json
import math
import os
import pathlib
import random
import resource
import shutil
import subprocess
import sys

import exact

WEIGHT = 9810.0
FINE = [2, 4]
# Part of the drop that closed ends four depths away change: the head below a free surface decays by exp(-pi/2) per depth, there and back.
ENDS = math.exp(-4 * math.pi)


def digits(number, count=3):
    """A number as a person writes it."""
    return float(f"{number:.{count}g}")


def within(draw, low, high, count=3):
    return digits(draw.uniform(low, high), count)


def between(draw, low, high):
    """A number whose logarithm is uniform."""
    return digits(math.exp(draw.uniform(math.log(low), math.log(high))))


def conducts(draw):
    return between(draw, 1e-6, 1e-3)


def probe(name, every, at):
    return {"name": name, "every": every, "at": at}


def base(size, cells, darcy, probes, end=1, steps=10):
    """A case on square or stated cells."""
    grid = {"from": [0, 0], "to": size, "cells": cells}
    return {
        "domain": {"size": size, "spacing": size[1] / cells[1]},
        "gravity": [0, -9.81],
        "materials": {"soil": {"density": 2650}},
        "fluid": {"darcy": {"density": 1000, "viscosity": 1e-3, "grid": grid, **darcy}},
        "probes": probes,
        "time": {"end": end, "solid_time_step": end / steps},
    }


def zone(k, ratio=1.0, **more):
    made = {"name": "ground", "permeability": {"hydraulic_conductivity": k}, **more}
    return {**made, "anisotropy": ratio} if ratio > 1 else made


def points(edges, ends, width, widening, plateau):
    """Widths of cells: `width` at edges and up to `plateau` from them, and wider by `widening` of the distance beyond."""
    near = 1e-6 * (ends[1] - ends[0])
    edges = sorted(set(edges))
    edges = [at for n, at in enumerate(edges) if n == 0 or at - edges[n - 1] > near]
    found = {}

    def widen(at, away):
        found[digits(at, 12)] = width + widening * max(away - plateau, 0)

    for at in edges:
        found[digits(at, 12)] = width
    for low, high in zip(edges, edges[1:]):
        half = 0.5 * (high - low)
        if half > 1.5 * plateau + width:
            widen(0.5 * (low + high), half)
            for at in (low + plateau, high - plateau) if plateau > 0 else ():
                widen(at, 0)
    for end, edge, side in ((ends[0], edges[0], -1), (ends[1], edges[-1], 1)):
        if abs(end - edge) > 1.5 * plateau + width:
            widen(end, abs(end - edge))
            if plateau > 0:
                widen(edge + side * plateau, 0)
    return [[at, found[at]] for at in sorted(found)]


class Ground:
    """A stratum under a flat base from x1 to x2, with a cut-off at a plane between cells or none, drawn with its grid."""

    def __init__(self, draw, left, right, ratio, most=64):
        """`left` and `right`: largest lengths of the base on both sides of the cut-off in depths of the stratum; 0 for none."""
        self.depth = within(draw, 3, 20, 2)
        high = draw.choice([n for n in (16, 20, 24, 30, 32, 36, 40, 48, 56, 64) if n <= most])
        self.h = self.depth / high
        # The closed ends are four depths away (ENDS).
        ends = math.ceil(4 * high * math.sqrt(ratio))

        def cells(most_of):
            return 0 if most_of == 0 else draw.randint(max(2, high // 4), max(3, int(most_of * high)))

        self.left, self.right = cells(left), cells(right)
        before, after = ends + draw.randrange(4), ends + draw.randrange(4)
        along = before + self.left + self.right + after
        after += along % 2
        self.cells = [along + along % 2, high]
        self.size = [self.cells[0] * self.h, self.depth]
        self.heel, self.wall, self.toe = (n * self.h for n in (before, before + self.left, before + self.left + self.right))
        self.upper, self.lower = self.depth + within(draw, 1, 8, 2), self.depth
        if draw.random() < 0.5:
            self.lower = self.depth + within(draw, 0.1, 0.8, 2)
        self.k, self.ratio = conducts(draw), ratio

    def boundaries(self):
        def patch(name, low, high, head):
            return {"name": name, "face": "y_max", "patch": {"from": [low, 0], "to": [high, self.depth]}, "condition": {"head": {"value": head}}}

        return [patch("upstream", 0, self.heel, self.upper), patch("downstream", self.toe, self.size[0], self.lower)]

    def cut_off(self, cut):
        thin = 1e-4 * self.h
        return [{"name": "wall", "shape": {"box": {"from": [self.wall - thin, self.depth - cut], "to": [self.wall + thin, self.depth + 1]}}}]

    def case(self, zones, cut, probes):
        made = base(self.size, self.cells, {"zones": zones, "boundaries": self.boundaries()}, probes)
        if cut > 0:
            made["structures"] = self.cut_off(cut)
        return made

    def exact(self, cut):
        args = (self.wall - self.heel, self.toe - self.wall, cut, self.upper - self.lower, self.k, self.ratio)
        return exact.Strip(self.depth, *args)

    def under(self):
        return probe("under", 1, {"section": {"axis": "x", "position": self.wall}})

    def uplift(self):
        part = {"from": [self.heel, 0], "to": [self.toe, self.depth]}
        return probe("base", 1, {"uplift": {"axis": "y", "position": self.depth, "part": part, "about": [self.heel, self.depth]}})

    def point(self, draw, low, high):
        """A probe in the ground, at a distance from the wall along x and at any depth."""
        x = digits(self.wall + draw.uniform(low, high) * self.depth, 5)
        y = digits(draw.uniform(0.05, 0.95) * self.depth, 3)
        return probe("point", 1, {"point": {"position": [x, y]}}), (x, y)

    def flow(self, strip):
        return ("under: discharge, last", strip.discharge(), ENDS * strip.discharge())

    def exit(self, strip):
        return ("seepage.exit_gradients.downstream.gradient", strip.exit_gradient(), ENDS * strip.exit_gradient())

    def loads(self, strip):
        """Uplift and its moment about the heel, of the head above the base."""
        force, moment = strip.base()
        drop, rest, width = self.upper - self.lower, self.lower - self.depth, self.toe - self.heel
        return [
            ("base: force, last", WEIGHT * (drop * force + rest * width), ENDS * WEIGHT * drop * width),
            ("base: torque_z, last", WEIGHT * (drop * moment + 0.5 * rest * width * width), ENDS * WEIGHT * drop * width * width),
        ]

    def head(self, strip, at):
        share = strip.share(at[0] - self.wall, self.depth - at[1])
        drop = self.upper - self.lower
        return ("point: head, last", self.lower + drop * share, ENDS * drop)


class GradedGround(Ground):
    """A stratum under a base that lies anywhere, on cells that widen away from heel, toe and the ends of the cut-off."""

    def __init__(self, draw, left, right, ratio, chance=0.0):
        """`left` and `right`: smallest and largest lengths of the base on both sides of the cut-off in depths, or none; `chance`: of a cut-off."""
        self.depth = within(draw, 3, 20, 2)
        self.left, self.right = (digits(draw.uniform(*most) * self.depth) if most else 0 for most in (left, right))
        far = digits(draw.uniform(4, 4.3) * math.sqrt(ratio) * self.depth)
        self.heel, self.wall, self.toe = far, far + self.left, far + self.left + self.right
        # The domain has whole cells, which the seepage does not use.
        self.unit = self.depth / 20
        self.size = [math.ceil((self.toe + far) / self.unit) * self.unit, self.depth]
        self.upper, self.lower = self.depth + within(draw, 1, 8, 2), self.depth
        if draw.random() < 0.5:
            self.lower = self.depth + within(draw, 0.1, 0.8, 2)
        self.k, self.ratio = conducts(draw), ratio
        self.cut = digits(draw.uniform(0.15, 0.85) * self.depth) if draw.random() < chance else 0
        shortest = min(length for length in (self.left, self.right, self.left + self.right, self.cut, self.depth - self.cut) if length > 0)
        # Cells are square at edges in isotropic ground.
        self.h = digits(shortest / between(draw, 6, 40))
        self.widening = between(draw, 0.03, 0.5)
        self.plateau = draw.choice([0, 0, 0, 2, 5]) * self.h

    def case(self, zones, cut, probes):
        made = super().case(zones, cut, probes)
        axes = zip([[self.heel, self.wall, self.toe], [self.depth, self.depth - cut]], self.size, (math.sqrt(self.ratio), 1))
        spacing = [{"points": points(edges, [0, end], self.h * s, self.widening, self.plateau * s)} for edges, end, s in axes]
        made["fluid"]["darcy"]["grid"] = {"from": [0, 0], "to": self.size, "spacing": spacing}
        return made

    @property
    def cells(self):
        """Cells of the domain."""
        return [round(self.size[0] / self.unit), 20]


def depth_of(draw, ground):
    """Depth of a cut-off: half of them end on a plane between cells."""
    cut = draw.uniform(0.15, 0.85) * ground.depth
    return round(cut / ground.h) * ground.h if draw.random() < 0.5 else digits(cut, 3)


def layering(draw):
    return draw.choice([1, 1, 2, 4, 9])


def pile(draw):
    """Returns a sheet pile in a stratum, k_h = 1 to 9 k_v: discharge, exit gradient, head at a point (M. E. Harr)."""
    ground = Ground(draw, 0, 0, layering(draw), 48)
    cut = depth_of(draw, ground)
    strip = ground.exact(cut)
    point, at = ground.point(draw, 0.1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], cut, [ground.under(), point])
    return made, [ground.flow(strip), ground.exit(strip), ground.head(strip, at)]


def dam(draw):
    """Returns a flat base with or without a cut-off at any place: discharge, uplift, moment, head at a point (Pavlovsky; M. E. Harr)."""
    ground = Ground(draw, 1.2, 1.2, layering(draw), 48)
    cut = depth_of(draw, ground) if draw.random() < 0.7 else 0
    strip = ground.exact(cut)
    point, at = ground.point(draw, -1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], cut, [ground.under(), ground.uplift(), point])
    return made, [ground.flow(strip), *ground.loads(strip), ground.head(strip, at)]


def toe(draw):
    """Returns a flat base with a cut-off at its toe: discharge, uplift, exit gradient."""
    ground = Ground(draw, 1.5, 0, layering(draw), 48)
    cut = depth_of(draw, ground)
    strip = ground.exact(cut)
    made = ground.case([zone(ground.k, ground.ratio)], cut, [ground.under(), ground.uplift()])
    return made, [ground.flow(strip), *ground.loads(strip), ground.exit(strip)]


def bedding(draw):
    """Returns a base on beds with a dip, with a cut-off or none: discharge, uplift, head at a point. Reference: finer cells."""
    ground = Ground(draw, 1, 1, 1, 24)
    cut = depth_of(draw, ground) if draw.random() < 0.5 else 0
    dip = draw.choice([-1, 1]) * draw.randrange(10, 80)
    beds = zone(ground.k, draw.choice([2, 4, 9]), dip=dip)
    point, _ = ground.point(draw, -1, 1)
    made = ground.case([beds], cut, [ground.under(), ground.uplift(), point])
    return made, [("under: discharge, last", 1), ("base: force, last", 1), ("base: torque_z, last", 1), ("point: head, last", 1)]


def layers(draw):
    """Returns a base on layers whose limits lie anywhere, with a cut-off or none: discharge, uplift. Reference: finer cells."""
    ground = Ground(draw, 1, 1, 1, 32)
    cut = depth_of(draw, ground) if draw.random() < 0.5 else 0
    zones = [zone(ground.k)]
    for n in range(draw.randint(1, 2)):
        low = draw.uniform(0.1, 0.7) * ground.depth
        high = low + draw.uniform(0.1, 0.3) * ground.depth
        layer = {"from": digits(low), "to": digits(high)}
        zones.append({**zone(digits(ground.k * between(draw, 0.02, 20))), "name": f"layer {n}", "region": {"layer": layer}})
    made = ground.case(zones, cut, [ground.under(), ground.uplift()])
    return made, [("under: discharge, last", 1), ("base: force, last", 1), ("base: torque_z, last", 1)]


def on_structure(ground, cut):
    """A dam as a polygon on a ground: uplift, thrust and moment on the structure."""
    strip = ground.exact(cut)
    made = ground.case([zone(ground.k, ground.ratio)], 0, [])
    top, thin = ground.depth, 1e-4 * ground.h
    unit = ground.depth / ground.cells[1]
    high = (ground.cells[1] + math.ceil(1 / unit)) * unit
    wall = [[ground.wall - thin, top], [ground.wall - thin, top - cut], [ground.wall + thin, top - cut], [ground.wall + thin, top]] if cut else []
    corners = [[ground.heel, top], *wall, [ground.toe, top], [ground.toe, high], [ground.heel, high]]
    made["structures"] = [{"name": "dam", "shape": {"polygon": {"points": corners}}}]
    # The dam stands in the domain, above the grid.
    made["domain"]["size"] = [ground.size[0], high]
    made["probes"] = [probe("dam", 1, {"structure": {"name": "dam", "about": [ground.heel, top]}})]
    drop, rest, width = ground.upper - ground.lower, ground.lower - ground.depth, ground.toe - ground.heel
    force, moment = strip.base()
    answers = [("dam: fluid_force_y, last", WEIGHT * (drop * force + rest * width), ENDS * WEIGHT * drop * width)]
    turned = 0.0
    if cut:
        # x = 0 is the cut-off, whose two sides have different heads.
        near = 1e-9 * ground.depth
        thrust = exact.integral(lambda y: strip.share(-near, y) - strip.share(near, y), 0, cut)
        turned = exact.integral(lambda y: y * (strip.share(-near, y) - strip.share(near, y)), 0, cut)
        answers.append(("dam: fluid_force_x, last", WEIGHT * drop * thrust, ENDS * WEIGHT * drop * cut))
    full = drop * (moment + turned) + 0.5 * rest * width * width
    answers.append(("dam: fluid_torque_z, last", WEIGHT * full, ENDS * WEIGHT * drop * width * width))
    return made, answers


def graded_pile(draw):
    """Returns a sheet pile on graded cells: discharge, exit gradient, head at a point."""
    ground = GradedGround(draw, None, None, layering(draw), 1)
    strip = ground.exact(ground.cut)
    point, at = ground.point(draw, 0.1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], ground.cut, [ground.under(), point])
    return made, [ground.flow(strip), ground.exit(strip), ground.head(strip, at)]


def on_graded_base(draw, ground):
    strip = ground.exact(ground.cut)
    point, at = ground.point(draw, -1, 1)
    made = ground.case([zone(ground.k, ground.ratio)], ground.cut, [ground.under(), ground.uplift(), point])
    return made, [ground.flow(strip), *ground.loads(strip), ground.head(strip, at)]


def graded_dam(draw):
    """Returns a flat base with or without a cut-off on graded cells: discharge, uplift, moment, head at a point."""
    return on_graded_base(draw, GradedGround(draw, (0.25, 1.2), (0.25, 1.2), layering(draw), 0.7))


def graded_base(draw):
    """Returns a base shorter than its stratum is deep on graded cells: discharge, uplift, moment, head at a point."""
    return on_graded_base(draw, GradedGround(draw, (0.05, 0.5), (0.05, 0.5), layering(draw), 0.3))


def graded_toe(draw):
    """Returns a flat base with a cut-off at its toe on graded cells: discharge, uplift, moment, exit gradient."""
    ground = GradedGround(draw, (0.25, 1.5), None, layering(draw), 1)
    strip = ground.exact(ground.cut)
    made = ground.case([zone(ground.k, ground.ratio)], ground.cut, [ground.under(), ground.uplift()])
    return made, [ground.flow(strip), *ground.loads(strip), ground.exit(strip)]


def graded_structure(draw):
    """Returns a dam as a polygon, with a cut-off or none, on graded cells: uplift, thrust and moment on the structure."""
    ground = GradedGround(draw, (0.25, 1.2), (0.25, 1.2), layering(draw), 0.7)
    made, answers = on_structure(ground, ground.cut)
    # The cut-off is a part of the structure.
    made["fluid"]["darcy"]["grid"] = ground.case([], ground.cut, [])["fluid"]["darcy"]["grid"]
    return made, answers


def graded_layers(draw):
    """Returns a base on layers, with a cut-off or none, on graded cells: discharge, uplift, moment. Reference: finer cells."""
    ground = GradedGround(draw, (0.25, 1), (0.25, 1), 1, 0.5)
    zones = [zone(ground.k)]
    for n in range(draw.randint(1, 2)):
        low = draw.uniform(0.1, 0.7) * ground.depth
        layer = {"from": digits(low), "to": digits(low + draw.uniform(0.1, 0.3) * ground.depth)}
        zones.append({**zone(digits(ground.k * between(draw, 0.02, 20))), "name": f"layer {n}", "region": {"layer": layer}})
    made = ground.case(zones, ground.cut, [ground.under(), ground.uplift()])
    return made, [("under: discharge, last", 1), ("base: force, last", 1), ("base: torque_z, last", 1)]


def levels(draw):
    """Water levels, length and grid of a rectangular dam whose upstream level is its height."""
    upper = within(draw, 2, 20, 2)
    lower = draw.choice([0, 0, digits(draw.uniform(0.1, 0.6) * upper, 2)])
    high = draw.choice([20, 24, 30, 32, 40, 48, 56, 60])
    along = draw.randint(high // 2, 2 * high)
    along += along % 2
    return upper, lower, [along, high], [along * upper / high, upper]


def faces(upper, lower):
    level = {"level": lower} if lower > 0 else {}
    return [
        {"name": "upstream", "face": "x_min", "condition": {"head": {"value": upper}}},
        {"name": "downstream", "face": "x_max", "condition": {"seepage_face": level}},
    ]


def table():
    return probe("table", 1, {"water_table": {}})


def earth(draw):
    """Returns a rectangular dam on an impervious base, isotropic, layered, with bands or a core, under rain: discharge (I. A. Charny) and, in
    one soil, the exit of the phreatic line (P. Ya. Polubarinova-Kochina)."""
    upper, lower, cells, size = levels(draw)
    k, length = conducts(draw), size[0]
    kind = draw.choice(["one", "one", "ratio", "bands", "core", "rain"])
    darcy = {"zones": [zone(k)], "unsaturated": {"retention": {"saturated_only": {}}}, "boundaries": faces(upper, lower)}
    answers = [("seepage.outflow", exact.dam_discharge(upper, lower, length, [(upper, k)]))]
    if kind in ("one", "ratio"):
        ratio = draw.choice([2, 4, 9]) if kind == "ratio" else 1
        darcy["zones"] = [zone(k, ratio)]
        face = exact.seepage_face(upper, lower, length / math.sqrt(ratio))
        answers.append(("table: y, last", lower + face))
    elif kind == "bands":
        limit, other = within(draw, 0.2, 0.8) * upper, digits(k * between(draw, 0.1, 10))
        darcy["zones"].append({**zone(other), "name": "band", "region": {"layer": {"from": 0, "to": limit}}})
        answers = [("seepage.outflow", exact.dam_discharge(upper, lower, length, [(limit, other), (upper, k)]))]
    elif kind == "core":
        low, high = within(draw, 0.2, 0.45) * length, within(draw, 0.5, 0.8) * length
        other = digits(k * between(draw, 0.05, 0.5))
        region = {"box": {"from": [low, 0], "to": [high, upper]}}
        darcy["zones"].append({**zone(other), "name": "core", "region": region})
        loss = (length - high + low) / k + (high - low) / other
        answers = [("seepage.outflow", 0.5 * (upper**2 - lower**2) / loss)]
    elif kind == "rain":
        # The crest stays below the top: rain of less than k (h1/L)^2 leaves the divide upstream of the dam.
        rain = digits(draw.uniform(0.1, 0.8) * k * min(0.1, (upper**2 - lower**2) / length**2))
        darcy["boundaries"].append({"name": "rain", "face": "y_max", "condition": {"rain": {"rate": rain}}})
        answers = [("seepage.patch_inflows[1]", -answers[0][1] - 0.5 * rain * length)]
    return base(size, cells, darcy, [table()]), answers


def soil_of(draw):
    """A retention after van Genuchten, from sand to loam."""
    n = within(draw, 1.5, 4)
    return {"van_genuchten": {"alpha": within(draw, 1, 6), "n": n, "saturated_content": 0.4, "residual_content": within(draw, 0.03, 0.1)}}


def capillary(draw):
    """Returns a dam of soil with suction, with or without a drain at its base: discharge, phreatic line. Reference: finer cells."""
    upper, lower, cells, size = levels(draw)
    cells = [cells[0] // 2 + cells[0] // 2 % 2, cells[1] // 2 + cells[1] // 2 % 2]
    size = [cells[0] * upper / cells[1], upper]
    darcy = {"zones": [zone(conducts(draw))], "unsaturated": {"retention": soil_of(draw)}, "boundaries": faces(upper, lower)}
    if draw.random() < 0.4:
        first = draw.randint(cells[0] // 2, 3 * cells[0] // 4) * size[0] / cells[0]
        patch = {"from": [first, 0], "to": size}
        darcy["boundaries"].append({"name": "drain", "face": "y_min", "patch": patch, "condition": {"seepage_face": {}}})
    at = [digits(draw.uniform(0.2, 0.8) * size[0]), digits(draw.uniform(0.1, 0.9) * size[1])]
    probes = [table(), probe("point", 1, {"point": {"position": at}})]
    return base(size, cells, darcy, probes), [("seepage.outflow", 1), ("table: y, last", 1), ("point: head, last", 1)]


def drain(draw):
    """Returns a slit drain in a confined stratum between two heads: its discharge and the head at a point, exact."""
    depth, high = within(draw, 3, 15, 2), draw.choice([16, 20, 24, 30, 32, 40, 48])
    h = depth / high
    half = 3 * high + 2 * draw.randrange(6)
    length = half * h
    cut = draw.uniform(0.2, 0.8) * depth
    cut = round(cut / h) * h if draw.random() < 0.5 else digits(cut)
    heads = [depth + within(draw, 1, 6, 2), depth + within(draw, 1, 6, 2)]
    held, k = depth + within(draw, 0, 0.9, 2), conducts(draw)
    thin = 0.01 * h
    darcy = {
        "zones": [zone(k)],
        "boundaries": [{"name": n, "face": n, "condition": {"head": {"value": head}}} for n, head in zip(("x_min", "x_max"), heads)],
        "drains": [{"name": "slit", "box": {"from": [length - thin, depth - cut], "to": [length + thin, depth]}, "condition": {"head": {"value": held}}}],
    }
    x, y = digits(length + draw.uniform(-1.5, 1.5) * depth, 5), digits(draw.uniform(0.05, 0.95) * depth)
    slit = exact.Slit(depth, cut, length, heads, held, k)
    made = base([2 * length, depth], [2 * half, high], darcy, [probe("point", 1, {"point": {"position": [x, y]}})])
    # The ends are three depths away and the point at most one and a half: exp(-pi) per depth to the end and back.
    uncertain = math.exp(-4.5 * math.pi) * (max(heads) - held)
    head = ("point: head, last", slit.head(x - length, depth - y), uncertain)
    return made, [("seepage.patch_inflows[2]", -slit.discharge(), math.exp(-6 * math.pi) * slit.discharge()), head]


def storing(retention, initial, **more):
    return {"retention": retention, "transient": {"initial": initial, **more}}


def linear(draw):
    """Returns a column of Gardner's soil above a water table whose rain rises or falls at once: heads, water that left (Srivastava and Yeh)."""
    alpha, length = within(draw, 0.5, 8), within(draw, 0.5, 3, 2)
    k = conducts(draw)
    wet, dry = within(draw, 0.3, 0.44), within(draw, 0.02, 0.12)
    before, after = within(draw, 0.02, 0.9), within(draw, 0.02, 0.9)
    high = draw.choice([20, 24, 30, 40, 48, 64, 80])
    wide = draw.choice([2, 4])
    # The wetting passes the column within the run, or half of it.
    end = digits(draw.uniform(0.3, 1.2) * (wet - dry) * length / (k * max(before, after)))
    soil = {"gardner": {"alpha": alpha, "saturated_content": wet, "residual_content": dry}}
    boundaries = [
        {"name": "table", "face": "y_min", "condition": {"head": {"value": 0}}},
        {"name": "rain", "face": "y_max", "condition": {"flux": {"value": before * k}}, "history": [[0, before * k], [0, after * k]]},
    ]
    points = [digits(draw.uniform(0.05, 0.95) * length) for _ in range(2)]
    width = wide * length / high
    probes = [probe(f"point{n}", end, {"point": {"position": [0.4 * width, z]}}) for n, z in enumerate(points)]
    darcy = {"zones": [zone(k)], "unsaturated": storing(soil, "steady"), "boundaries": boundaries}
    column = exact.LinearSoil(alpha, length, k, wet - dry, before, after)
    left = width * (after * k * end - column.water(end) + column.water(0))
    answers = [(f"point{n}: head, last", z + column.suction(z, end)) for n, z in enumerate(points)]
    return base([width, length], [wide, high], darcy, probes, end, 100), [*answers, ("seepage.water_out", left)]


def suction(draw):
    """Returns a column of Gardner's soil above a water table under steady rain or evaporation: heads."""
    alpha, length, k = within(draw, 0.5, 6), within(draw, 0.5, 3, 2), conducts(draw)
    high, wide = draw.choice([16, 20, 24, 30, 40]), draw.choice([2, 4])
    if draw.random() < 0.6:
        rate = within(draw, 0.02, 0.9)
    else:
        # At most 0.8 of the largest flux that the column can lift.
        rate = -within(draw, 0.1, 0.8) / (math.exp(alpha * length) - 1)
    soil = {"gardner": {"alpha": alpha, "saturated_content": 0.4, "residual_content": 0.1}}
    boundaries = [
        {"name": "table", "face": "y_min", "condition": {"head": {"value": 0}}},
        {"name": "sky", "face": "y_max", "condition": {"flux": {"value": rate * k}}},
    ]
    points = [digits(draw.uniform(0.1, 0.95) * length) for _ in range(2)]
    width = wide * length / high
    probes = [probe(f"point{n}", 1, {"point": {"position": [0.4 * width, z]}}) for n, z in enumerate(points)]
    darcy = {"zones": [zone(k)], "unsaturated": {"retention": soil}, "boundaries": boundaries}

    def head(z):
        return z + math.log(rate + (1 - rate) * math.exp(-alpha * z)) / alpha

    return base([width, length], [wide, high], darcy, probes), [(f"point{n}: head, last", head(z)) for n, z in enumerate(points)]


def soak(draw):
    """Returns a dry column of van Genuchten's soil under a wet surface or rain: water that entered, head behind the front. Reference: finer cells."""
    length, k = within(draw, 0.4, 2, 2), between(draw, 1e-6, 1e-4)
    soil = soil_of(draw)
    high, wide = draw.choice([20, 24, 32, 40, 50]), 2
    start = -within(draw, 1, 10)
    # The front is at about a third to two thirds of the column.
    end = digits(draw.uniform(0.3, 0.6) * 0.3 * length / k)
    rain = draw.random() < 0.5
    top = {"rain": {"rate": digits(k * draw.uniform(0.2, 0.9))}} if rain else {"pressure": {"value": -within(draw, 0.01, 0.5) * WEIGHT}}
    if rain:
        end = digits(end * k / top["rain"]["rate"])
    boundaries = [{"name": "top", "face": "y_max", "condition": top}, {"name": "base", "face": "y_min", "condition": {"pressure": {"value": start * WEIGHT}}}]
    width = wide * length / high
    probes = [probe("point", end, {"point": {"position": [0.5 * width, digits(draw.uniform(0.7, 0.95) * length)]}})]
    darcy = {"zones": [zone(k)], "unsaturated": storing(soil, {"pressure_head": start}), "boundaries": boundaries}
    # Rain that soaks in whole is given.
    answers = [("point: head, last", 1)] if rain else [("seepage.water_in", 1), ("point: head, last", 1)]
    return base([width, length], [wide, high], darcy, probes, end, 100), answers


def drawdown(draw):
    """Returns ground beside a river whose level falls at once or slowly: water that left, phreatic line, head. Reference: finer cells."""
    high = draw.choice([10, 12, 14, 16])
    along = 2 * draw.randint(high, 2 * high)
    level = within(draw, 1, 6, 2)
    size = [along * level / high, level]
    k = between(draw, 1e-5, 1e-3)
    soil = soil_of(draw)
    low = digits(draw.uniform(0.3, 0.7) * level)
    end = digits(draw.uniform(0.1, 0.5) * 0.3 * size[0] / k)
    fall = draw.choice([0, digits(0.3 * end)])
    river = {"name": "river", "face": "x_min", "condition": {"seepage_face": {"level": level}}, "history": [[0, level], [fall, low]]}
    at = [digits(draw.uniform(0.2, 0.8) * size[0]), digits(draw.uniform(0.1, 0.5) * level)]
    probes = [probe("table", end, {"water_table": {}}), probe("point", end, {"point": {"position": at}})]
    darcy = {"zones": [zone(k)], "unsaturated": storing(soil, {"head": level}), "boundaries": [river]}
    made = base(size, [along, high], darcy, probes, end, 100)
    return made, [("seepage.water_out", 1), ("table: y, last", 1), ("point: head, last", 1)]


CONFINED = {"gardner": {"alpha": 1, "saturated_content": 0.3, "residual_content": 0.1}}


def well(draw):
    """Returns a quarter of a confined aquifer, seen from above, with a well at its corner: heads at two points (C. V. Theis)."""
    k, storage = between(draw, 1e-5, 1e-3), between(draw, 1e-5, 1e-3)
    cells = draw.choice([40, 48, 60, 64, 80])
    h = within(draw, 2, 6, 2)
    size = cells * h
    # The ends are at u = 6 or more: less than 1e-4 of the drawdown at the well.
    end = digits(size**2 * storage / (4 * k * draw.uniform(6, 15)))
    pumped = digits(k * draw.uniform(2, 20))
    points = [[digits(h * draw.uniform(2, 0.3 * cells)), digits(h * draw.uniform(2, 0.3 * cells))] for _ in range(2)]
    darcy = {
        "zones": [zone(k)],
        "unsaturated": storing(CONFINED, {"head": 1000}, specific_storage=storage),
        "boundaries": [{"name": n, "face": n, "condition": {"head": {"value": 1000}}} for n in ("x_max", "y_max")],
        "drains": [{"name": "well", "box": {"from": [0, 0], "to": [h, h]}, "condition": {"discharge": {"value": -0.25 * pumped}}}],
    }
    probes = [probe(f"point{n}", end, {"point": {"position": at}}) for n, at in enumerate(points)]

    def head(x, y):
        return 1000 - pumped / (4 * math.pi * k) * exact.theis((x * x + y * y) * storage / (4 * k * end))

    return base([size, size], [cells, cells], darcy, probes, end, 100), [(f"point{n}: head, last", head(*at)) for n, at in enumerate(points)]


def consolidation(draw):
    """Returns a column of clay, drained at its top, under an excess head: head at a point, water that left (K. Terzaghi)."""
    k, storage = between(draw, 1e-10, 1e-7), between(draw, 1e-4, 1e-3)
    length, high, wide = within(draw, 1, 10, 2), draw.choice([16, 20, 24, 32, 40, 50]), draw.choice([2, 4])
    excess, factor = within(draw, 1, 10, 2), within(draw, 0.02, 0.6)
    end = digits(factor * length**2 * storage / k)
    y = digits(draw.uniform(0.05, 0.95) * length)
    width = wide * length / high
    darcy = {
        "zones": [zone(k)],
        "unsaturated": storing(CONFINED, {"head": length + excess}, specific_storage=storage),
        "boundaries": [{"name": "top", "face": "y_max", "condition": {"head": {"value": length}}}],
    }
    probes = [probe("point", end, {"point": {"position": [0.4 * width, y]}})]
    head, mean = exact.consolidation(end * k / (storage * length**2), 1 - y / length)
    left = storage * excess * length * width * (1 - mean)
    return base([width, length], [wide, high], darcy, probes, end, 100), [("point: head, last", length + excess * head), ("seepage.water_out", left)]


FAMILIES = {
    "pile": pile, "dam": dam, "toe": toe, "bedding": bedding, "layers": layers, "earth": earth, "capillary": capillary,
    "drain": drain, "linear": linear, "suction": suction, "soak": soak, "drawdown": drawdown, "well": well, "consolidation": consolidation,
}
GRADED = {
    "graded pile": graded_pile, "graded dam": graded_dam, "graded base": graded_base, "graded toe": graded_toe,
    "graded structure": graded_structure, "graded layers": graded_layers,
}
KINDS = {"equal": FAMILIES, "graded": GRADED, "all": {**FAMILIES, **GRADED}}
# Families whose truth is the extrapolation of finer runs, and its order: first beside singular edges, seepage faces and fronts.
FINER = {"bedding": 1, "layers": 1, "capillary": 1, "soak": 1, "drawdown": 1, "graded layers": 1}
JUDGED = ["kept", "open", "broken"]
FIELDS = [
    "seed", "scene", "family", "answer", "outcome", "value", "uncertainty", "reference", "of reference", "error over uncertainty",
    "series", "observed order", "values", "promise", "cells", "seconds", "seconds of the reference", "reason", "solver",
]


class Runner:
    """The program, with the processor time of its runs."""

    def __init__(self, solver):
        self.solver = solver
        self.version = subprocess.run([solver, "-V"], capture_output=True, text=True).stdout.strip().split("(")[-1].strip(")")

    def call(self, *arguments):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([self.solver, *map(str, arguments)], capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return done, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def promise(self, path):
        """The error that the plan promises, or none, and the reason."""
        done, _ = self.call("plan", path, "--json")
        try:
            chosen = json.loads(done.stdout)["scene"]["chosen"]
        except (json.JSONDecodeError, KeyError):
            return None, one_line(done.stderr or done.stdout)
        return chosen["promised"], ""


def one_line(text):
    return " ".join(text.split())[:240]


def with_widths(case, factor):
    """The case with the widths of its graded cells divided by a factor: so is their widening."""
    for axis in case["fluid"]["darcy"]["grid"]["spacing"]:
        for point in axis["points"]:
            point[1] /= factor
    return case


def finer(case, factor):
    """The case with cells and error of its time steps divided."""
    made = json.loads(json.dumps(case))
    grid = made["fluid"]["darcy"]["grid"]
    if "spacing" in grid:
        return with_widths(made, factor)
    narrow = grid["cells"][0] <= 4
    # A column has one direction: its width stays at its cells.
    grid["cells"] = [grid["cells"][0] if narrow else grid["cells"][0] * factor, grid["cells"][1] * factor]
    transient = made["fluid"]["darcy"].get("unsaturated", {}).get("transient")
    if transient is not None:
        transient["content_error"] = 2e-3 / factor**2
        steps = made["time"]["end"] / made["time"]["solid_time_step"]
        made["time"]["solid_time_step"] = made["time"]["end"] / (steps * factor)
    return made


def answer_of(folder, name):
    """An answer of a run: a number of its summary or the last value of a probe."""
    if name.startswith("seepage."):
        value = json.loads((folder / "summary.json").read_text())
        for part in name.replace("[", ".").replace("]", "").split("."):
            value = value[int(part)] if isinstance(value, list) else value[part]
        return value
    file, column = name.split(": ")
    column = column.split(", ")[0]
    lines = [line for line in (folder / f"probe_{file}.csv").read_text().splitlines() if not line.startswith("#")]
    return float(list(csv.DictReader(lines))[-1][column])


def reference(runner, case, folder, names, order):
    """Extrapolated values of two finer runs, and their uncertainties; none where a run fails."""
    found, cost = [], 0.0
    for factor in FINE:
        path = folder / f"finer{factor}.json"
        path.write_text(json.dumps(finer(case, factor)))
        done, seconds = runner.call(path, "--output", folder / f"finer{factor}", "--overwrite", "--threads", "1", "--no-final-checkpoint")
        cost += seconds
        if done.returncode != 0:
            return None, cost, one_line(done.stderr)
        found.append([answer_of(folder / f"finer{factor}", name) for name in names])
    ratio = (FINE[1] / FINE[0]) ** order - 1
    return [(b + (b - a) / ratio, abs(b - a) / ratio) for a, b in zip(*found)], cost, ""


def verdict(row, uncertain, width):
    error = abs(row["value"] - row["reference"])
    if width is None:
        return "no interval"
    if uncertain > 0.5 * width and uncertain > 1e-9 * abs(row["reference"]):
        return "not judged"
    if error <= width:
        return "kept"
    return "open" if error <= width + uncertain else "broken"


def scene(runner, options, number):
    """The rows of a scene."""
    draw = random.Random(f"soil {options.seed}/{number}")
    families = options.families or list(KINDS[options.kinds])
    family = families[number % len(families)]
    case, answers = KINDS["all"][family](draw)
    folder = pathlib.Path(options.output).resolve() / f"{options.seed}_{number:03}_{family}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    path = folder / "case.json"
    path.write_text(json.dumps(case, indent=1))
    promise, reason = runner.promise(path)
    start = {
        "seed": options.seed, "scene": number, "family": family, "promise": "" if promise is None else f"{promise:.3g}",
        "cells": "x".join(map(str, case["fluid"]["darcy"]["grid"].get("cells", ["graded"]))), "reason": reason, "solver": runner.version,
    }
    done, seconds = runner.call("estimate", path, "--cells-only", "--threads", "1", "--output", folder / "estimate")
    start["seconds"] = f"{seconds:.2f}"
    if done.returncode != 0:
        why = one_line(done.stderr)
        return [{**start, "answer": name, "outcome": "refused" if done.returncode == 3 else "failed", "reason": why} for name, *_ in answers]
    block = json.loads((folder / "estimate/1-case/summary.json").read_text())["estimate"]
    rows = {row["answer"]: row for row in block["answers"]}
    truths, of_runs = [(truth, more[0] if more else 0.0) for _, truth, *more in answers], None
    if family in FINER:
        truths, cost, why = reference(runner, case, folder, [name for name, *_ in answers], FINER[family])
        of_runs = f"{cost:.1f}"
        if truths is None:
            return [{**start, "answer": name, "outcome": "failed", "reason": f"the reference: {why}"} for name, *_ in answers]
    made = []
    for (name, *_), (truth, uncertain) in zip(answers, truths):
        row = {**start, "answer": name, "reference": truth, "of reference": f"{uncertain:.3g}", "seconds of the reference": of_runs}
        made.append(row)
        found = rows.get(name)
        if found is None:
            row["value"] = answer_of(folder / "estimate/1-case", name)
            same = abs(row["value"] - truth) <= 1e-9 * abs(truth)
            row["outcome"] = "given" if same or uncertain else "broken"
            continue
        width = found["uncertainty"]
        row["value"] = found["value"]
        row["outcome"] = verdict(row, uncertain, width)
        row["series"], row["values"] = found["behaviour"], " ".join(f"{v:.9g}" for v in found["values"])
        row["observed order"] = "" if found["observed_order"] is None else f"{found['observed_order']:.3f}"
        if width is not None:
            row["uncertainty"] = f"{width:.4g}"
            row["error over uncertainty"] = f"{abs(row['value'] - truth) / width:.4g}" if width > 0 else "inf"
    for row in made:
        for name in ("value", "reference"):
            row[name] = f"{row[name]:.10g}"
    if not options.keep:
        shutil.rmtree(folder)
    return made


def machine():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def summary(path):
    """Prints counts and coverage by seed, and the answers whose interval does not contain the true value."""
    with open(path) as lines:
        rows = list(csv.DictReader(lines))
    for seed in sorted({row["seed"] for row in rows}, key=int):
        of = [row for row in rows if row["seed"] == seed]
        solvers = ", ".join(sorted({row["solver"] for row in of}))
        print(f"\nSeed {seed}, solver {solvers}\n")
        print("| family | scenes | answers | judged | kept | open | broken | coverage | no interval | given | not judged | failed | median half width | most error/interval |")
        print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
        for family in [*[f for f in KINDS["all"] if any(row["family"] == f for row in of)], "all"]:
            own = [row for row in of if family in (row["family"], "all")]
            count = {o: sum(row["outcome"] == o for row in own) for o in [*JUDGED, "no interval", "given", "not judged", "failed", "refused"]}
            judged = sum(count[o] for o in JUDGED)
            share = f"{100 * count['kept'] / judged:.1f} %" if judged else ""
            ratios = [float(row["error over uncertainty"]) for row in own if row["outcome"] in JUDGED and row["error over uncertainty"]]
            widths = sorted(float(r["uncertainty"]) / abs(float(r["value"])) for r in own if r["outcome"] in JUDGED and r["uncertainty"] and float(r["value"]))
            middle = f"{100 * widths[len(widths) // 2]:.2g} %" if widths else ""
            scenes = len({row["scene"] for row in own})
            cells = [family, scenes, len(own), judged, *[count[o] for o in JUDGED], share, count["no interval"], count["given"], count["not judged"],
                     count["failed"] + count["refused"], middle, f"{max(ratios):.2f}" if ratios else ""]
            print("| " + " | ".join(map(str, cells)) + " |")
    print()
    for row in rows:
        if row["outcome"] in ("open", "broken", "failed", "refused", "no interval"):
            print(row["seed"], row["scene"], row["family"], row["answer"], row["outcome"], row["error over uncertainty"], row["series"],
                  row["observed order"], row["values"], row["reference"], row["of reference"], row["reason"])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solver", default="solver")
    parser.add_argument("--output", default="scenes")
    parser.add_argument("--table", required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=5 * len(FAMILIES))
    parser.add_argument("--kinds", default="equal", choices=list(KINDS), help="families on equal or on graded cells")
    parser.add_argument("--families", nargs="+", choices=list(KINDS["all"]))
    parser.add_argument("--keep", action="store_true", help="keep the folders of the runs")
    parser.add_argument("--summary", action="store_true", help="no runs: print the table by family")
    options = parser.parse_args()
    if options.summary:
        summary(options.table)
        return
    exact.check()
    runner = Runner(shutil.which(options.solver) or options.solver)
    done = set()
    if os.path.exists(options.table):
        with open(options.table) as lines:
            done = {(int(row["seed"]), int(row["scene"])) for row in csv.DictReader(lines)}
    else:
        with open(options.table, "w", newline="") as file:
            csv.DictWriter(file, FIELDS, lineterminator="\n").writeheader()
    print(machine(), runner.version, flush=True)
    for number in range(options.first, options.first + options.count):
        if (options.seed, number) in done:
            continue
        rows = scene(runner, options, number)
        with open(options.table, "a", newline="") as file:
            csv.DictWriter(file, FIELDS, lineterminator="\n").writerows(rows)
        for row in rows:
            print(*[row.get(k, "") for k in ("scene", "family", "answer", "outcome", "error over uncertainty", "seconds", "seconds of the reference", "reason")], flush=True)


if __name__ == "__main__":
    main()
