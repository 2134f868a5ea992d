//! Cuts between slabs: the same bits wherever the water is cut along any axis, and over restarts on other slabs.
//!
//! Ranks are threads here ([`decomposition::on_threads`]). The scenes are random: `SOLVER_CUT_SCENES` is their number,
//! `SOLVER_CUT_FROM` the first one.

use super::{AXES, Tank, at_face};
use crate::collision::{Operator, bgk, cumulant, trt};
use crate::fluid::Fluid;
use crate::lattice::VelocitySet;
use crate::surface::kind::GAS;
use crate::surface::{Outside, Passed, SavedCell, SurfaceTension};
use crate::turbulence::EddyViscosity;
use crate::turbulence::wale::Wale;
use base::history::TimeTable;
use base::random::SplitMix;
use decomposition::{Domain, Slabs, on_threads};
use std::collections::BTreeMap;

/// Axis and bounds of the slabs.
type Cut = (usize, Vec<usize>);

/// Water in a tank.
struct Scene {
    tank: Tank,
    /// Fill level of each cell, by x, y and z.
    levels: Vec<f64>,
    tension: Option<SurfaceTension>,
    steps: u64,
}

/// State of a cell as in a checkpoint.
#[derive(Clone, Debug)]
struct CellState {
    populations: Vec<f64>,
    surface: SavedCell,
    fill: f64,
    velocity: [f32; 3],
}

/// State of all cells at a step, with the mass that could not be distributed and that which passed each opening.
#[derive(Clone, Debug)]
struct State {
    step: u64,
    cells: BTreeMap<[usize; 3], CellState>,
    lost: i128,
    passed: Vec<Passed>,
}

impl State {
    /// Returns the first difference from another state, if there is one. The velocities of cells without water are not
    /// defined.
    fn difference(&self, other: &Self) -> Option<String> {
        let numbers = |state: &CellState| -> Vec<u64> {
            let surface = state.surface.iter().chain([&state.fill]);
            let all = state.populations.iter().chain(surface);
            let velocity = state.velocity.map(|u| u64::from(u.to_bits()));
            let wet = state.surface[0] > f64::from(GAS);
            let velocity = velocity.into_iter().filter(|_| wet);
            all.map(|x| x.to_bits()).chain(velocity).collect()
        };
        let mut all = self.cells.iter().zip(&other.cells);
        let cell = all.find(|((_, one), (_, two))| numbers(one) != numbers(two));
        let cell = cell.map(|((at, one), (_, two))| {
            format!("{at:?}: {:?} and {:?}", one.surface, two.surface)
        });
        let masses = [(self.lost, &self.passed), (other.lost, &other.passed)];
        cell.or_else(|| (masses[0] != masses[1]).then(|| format!("{masses:?}")))
    }

    /// Returns `true` if all numbers are finite.
    fn is_finite(&self) -> bool {
        let mut numbers = self.cells.values().flat_map(|cell| &cell.populations);
        numbers.all(|x| x.is_finite())
    }
}

/// Returns the state of the cells of a slab.
fn read(fluid: &Fluid<f64>) -> State {
    let (surface, populations) = (fluid.surface().unwrap(), fluid.populations());
    let start = fluid.start();
    let cells = populations.interior().map(|(at, cell)| {
        let wet = surface.is_wet(cell);
        let number = |i| {
            if wet {
                populations.numbers()[populations.incoming(cell, i)]
            } else {
                0.0
            }
        };
        let state = CellState {
            populations: (0..populations.velocities().q()).map(number).collect(),
            surface: surface.saved(cell),
            fill: surface.fill(cell),
            velocity: fluid
                .velocities()
                .map_or([0.0; 3], |field| field.velocity(cell)),
        };
        (std::array::from_fn(|a| at[a] + start[a]), state)
    });
    State {
        step: fluid.steps(),
        cells: cells.collect(),
        lost: surface.lost(),
        passed: surface.passed().map(|(_, passed)| passed).collect(),
    }
}

/// Sets the state of the cells of a slab, as at a restart.
fn restore(fluid: &mut Fluid<f64>, state: &State) {
    let start = fluid.start();
    let all: Vec<_> = fluid.populations().interior().collect();
    let of = |at: [usize; 3]| &state.cells[&std::array::from_fn(|a| at[a] + start[a])];
    for (at, cell) in &all {
        for (i, number) in of(*at).populations.iter().enumerate() {
            let position = fluid.populations().incoming(*cell, i);
            fluid.populations_mut().numbers_mut()[position] = *number;
        }
    }
    fluid.set_steps(state.step);
    let cells: Vec<usize> = all.iter().map(|(_, cell)| *cell).collect();
    let saved: Vec<SavedCell> = all.iter().map(|(at, _)| of(*at).surface).collect();
    let first = start == [0; 3] && !cells.is_empty();
    fluid.restore_surface(&cells, &saved, if first { state.lost } else { 0 });
    if let (Some(surface), true) = (fluid.surface_mut(), first) {
        surface.set_passed(state.passed.iter().copied());
    }
    if let Some(field) = fluid.velocities_mut() {
        for (at, cell) in &all {
            field.set_velocity(*cell, of(*at).velocity);
        }
        fluid.spread_velocities();
        fluid.continue_velocities();
    }
}

impl Scene {
    /// Returns the state after the steps on the slabs of a cut, from the start or from a state.
    fn run(&self, (axis, bounds): &Cut, from: Option<&State>, end: u64) -> State {
        let [_, cells_y, cells_z] = self.tank.cells;
        let level = |[x, y, z]: [usize; 3]| self.levels[(x * cells_y + y) * cells_z + z];
        let parts = on_threads(bounds.len() - 1, |communicator| {
            let slabs = Slabs::from_bounds(AXES[*axis], bounds.clone(), self.tank.periodic[*axis]);
            let domain = Domain::new(communicator, slabs.unwrap()).unwrap();
            let mut fluid = self.tank.empty(&domain);
            if let Some(tension) = self.tension {
                fluid.add_surface_tension(tension, &domain).unwrap();
            }
            match from {
                Some(state) => restore(&mut fluid, state),
                None => self.tank.pour(&mut fluid, level),
            }
            while fluid.steps() < end {
                fluid.advance();
                fluid.move_surface();
            }
            read(&fluid)
        });
        let mut parts = parts.into_iter();
        let mut whole = parts.next().unwrap();
        for part in parts {
            whole.cells.extend(part.cells);
            whole.lost += part.lost;
            for (sum, part) in whole.passed.iter_mut().zip(part.passed) {
                sum.entered += part.entered;
                sum.left += part.left;
            }
        }
        whole
    }

    /// Returns the cut of all cells into one slab.
    fn whole(&self, axis: usize) -> Cut {
        (axis, vec![0, self.tank.cells[axis]])
    }

    /// Returns all axes along which the tank may be cut.
    fn axes(&self) -> std::ops::Range<usize> {
        0..self.tank.models.lattice.velocities().dimension
    }
}

/// Returns the opening, wall or symmetry of a face.
fn add_face(tank: &mut Tank, draw: &mut SplitMix, (axis, upper): (usize, bool), up: usize) {
    let constant = |value: f64| TimeTable::new(None, value);
    let area = tank.cells.iter().product::<usize>() / tank.cells[axis];
    let height = tank.cells[up] as f64;
    match draw.below(8) {
        0 | 1 => {}
        2 | 3 => tank.slip_at.push((axis, upper)),
        4 => tank.open_at.push((axis, upper, Outside::Air)),
        5 => {
            let level = constant(height * draw.uniform());
            tank.open_at.push((axis, upper, at_face(level)));
        }
        6 => {
            let discharge = constant(0.03 * area as f64 * draw.uniform());
            (tank.open_at).push((axis, upper, Outside::Discharge(discharge)));
        }
        _ => {
            let mut velocity = [0.0; 3].map(|_: f64| 0.03 * (draw.uniform() - 0.5));
            if tank.cells[2] == 1 {
                velocity[2] = 0.0;
            }
            velocity[axis] = if upper { -0.03 } else { 0.03 } * (draw.uniform() + 0.1);
            let most = tank.cells[1] as f64;
            let range = [[0.0, most], [2.0, most - 2.0]][draw.below(2)];
            tank.streams.push(((axis, upper), range, velocity));
        }
    }
}

/// Returns a random scene.
fn scene(seed: u64) -> Scene {
    let draw = &mut SplitMix::new(seed);
    let flat = draw.below(3) == 0;
    let dimension = if flat { 2 } else { 3 };
    let mut cells = if flat { [14, 9, 1] } else { [13, 8, 6] };
    if draw.below(2) == 0 {
        cells.swap(0, 1);
    }
    if !flat && draw.below(3) > 0 {
        cells.swap(draw.below(3), 2);
    }
    let mut tank = Tank::new(cells);
    if !flat {
        tank.models.lattice = [VelocitySet::D3Q19, VelocitySet::D3Q27][draw.below(2)];
    }
    tank.models.collision = match draw.below(3) {
        0 => Operator::Bgk(bgk::BgkParameters {}),
        1 if tank.models.lattice == VelocitySet::D3Q27 => {
            Operator::Cumulant(cumulant::CumulantParameters { bulk: 1.0 })
        }
        _ => Operator::Trt(trt::TrtParameters { magic: 0.25 }),
    };
    tank.tau = 0.53 + 0.2 * draw.uniform();
    if draw.below(4) == 0 {
        tank.models.turbulence = Some(EddyViscosity::Wale(Wale { constant: 0.5 }));
    }
    let up = draw.below(dimension);
    let mut force = [0.0; 3];
    for (axis, force) in force.iter_mut().take(dimension).enumerate() {
        let most = if axis == up { 8e-4 } else { 3e-4 };
        *force =
            most * (draw.uniform() - 0.7) * f64::from(u8::from(axis == up || draw.below(2) == 0));
    }
    tank.gravity = -force[1];
    tank.slope = [force[0], force[2]];
    tank.surface_axis = Some(up);
    for axis in 0..dimension {
        tank.periodic[axis] = draw.below(4) == 0;
        if !tank.periodic[axis] {
            for upper in [false, true] {
                add_face(&mut tank, draw, (axis, upper), up);
            }
        }
    }
    let tension = (draw.below(5) == 0).then(|| SurfaceTension {
        tension: 1e-3,
        contact_angles: [[0.8 + 1.2 * draw.uniform(); 2]; 3],
    });
    Scene {
        levels: levels(draw, cells, up),
        tank,
        tension,
        steps: 150 + draw.below(150) as u64,
    }
}

/// Returns random fill levels: a slope, a block of water or of air, or random levels.
fn levels(draw: &mut SplitMix, cells: [usize; 3], up: usize) -> Vec<f64> {
    let kind = draw.below(5);
    let from = cells.map(|n| draw.below(n));
    let to: [usize; 3] = std::array::from_fn(|a| from[a] + 1 + draw.below(cells[a]));
    let depth = cells[up] as f64 * (0.2 + 0.7 * draw.uniform());
    let mut slope = [0.0; 3].map(|_: f64| 0.3 * draw.uniform());
    slope[up] = 1.0;
    let mut all = Vec::new();
    for x in 0..cells[0] {
        for y in 0..cells[1] {
            for z in 0..cells[2] {
                let at = [x, y, z];
                let within = (0..3).all(|a| (from[a]..to[a]).contains(&at[a]));
                let along: f64 = (0..3).map(|a| slope[a] * at[a] as f64).sum();
                all.push(match kind {
                    0 => f64::from(u8::from(within)),
                    1 => f64::from(u8::from(!within)),
                    2 => (depth - at[up] as f64).clamp(0.0, 1.0) * draw.uniform(),
                    _ => (depth - along).clamp(0.0, 1.0),
                });
            }
        }
    }
    all
}

/// Returns random bounds of slabs along an axis.
fn bounds(draw: &mut SplitMix, planes: usize) -> Vec<usize> {
    let mut bounds: Vec<usize> = (0..1 + draw.below(3))
        .map(|_| draw.below(planes + 1))
        .collect();
    bounds.extend([0, planes]);
    bounds.sort_unstable();
    bounds
}

/// Returns the levels of a surface that slopes along x.
fn slope(cells: [usize; 3], height: f64) -> Vec<f64> {
    let [nx, ny, nz] = cells;
    let at = (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |_| [x, y])));
    at.map(|[x, y]| (height + 0.02 * x as f64 - y as f64).clamp(0.0, 1.0))
        .collect()
}

/// Checks every cut through water whose surface falls past the planes towards an outfall, next to symmetry planes
/// and across a periodic axis: the planes on both sides of a cut are at first full of water.
#[test]
fn a_surface_that_reaches_a_cut_has_the_same_bits() {
    for (cells, periodic) in [
        ([24, 12, 1], false),
        ([10, 10, 4], false),
        ([10, 10, 4], true),
    ] {
        let mut tank = Tank::new(cells);
        tank.gravity = 6e-4;
        tank.slip_at = vec![(0, false)];
        if cells[2] > 1 {
            tank.periodic[2] = periodic;
            if !periodic {
                tank.slip_at.push((2, true));
            }
        }
        tank.open_at = vec![(0, true, Outside::Air)];
        let scene = Scene {
            levels: slope(cells, 7.6),
            tank,
            tension: None,
            steps: 200,
        };
        let straight = scene.run(&scene.whole(0), None, scene.steps);
        let wet = |at: [usize; 3]| straight.cells[&at].fill > 0.0;
        assert!(wet([0, 4, 0]) && !wet([cells[0] - 1, 6, 0]));
        let axes = if cells[2] > 1 { 1..2 } else { 0..2 };
        for axis in axes {
            let planes = cells[axis];
            for plane in 1..planes {
                let found = scene.run(&(axis, vec![0, plane, planes]), None, scene.steps);
                let difference = straight.difference(&found);
                assert_eq!(difference, None, "plane {plane} of axis {axis}");
            }
        }
    }
}

/// Checks scenes in which all kinds of faces meet at edges, each on random slabs along every axis and over a restart on
/// other slabs.
#[test]
fn the_bits_do_not_depend_on_the_cuts() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let first = number("SOLVER_CUT_FROM").unwrap_or(0);
    let count = number("SOLVER_CUT_SCENES").unwrap_or(3);
    let every = std::env::var_os("SOLVER_CUT_SCENES").is_some();
    let (mut compared, mut failed) = (0, Vec::new());
    for seed in first..first + count {
        let scene = scene(seed);
        let draw = &mut SplitMix::new(seed ^ 0x5eed);
        let straight = scene.run(&scene.whole(0), None, scene.steps);
        if !straight.is_finite() {
            println!("scene {seed} grows without bound");
            continue;
        }
        let mut cuts = Vec::new();
        for axis in scene.axes() {
            let planes = scene.tank.cells[axis];
            cuts.push((axis, bounds(draw, planes)));
            if every {
                cuts.push(scene.whole(axis));
                cuts.extend((1..planes).map(|plane| (axis, vec![0, plane, planes])));
            }
        }
        for cut in &cuts {
            let found = scene.run(cut, None, scene.steps);
            compared += 1;
            if let Some(difference) = straight.difference(&found) {
                failed.push(format!("scene {seed}, {cut:?}: {difference}"));
                break;
            }
        }
        let limit = usize::try_from(scene.steps - 1).unwrap();
        let middle = 1 + draw.below(limit) as u64;
        let [one, two] = [0, 0].map(|_| &cuts[draw.below(cuts.len())]);
        let saved = scene.run(one, None, middle);
        let found = scene.run(two, Some(&saved), scene.steps);
        compared += 1;
        if let Some(difference) = straight.difference(&found) {
            failed.push(format!(
                "scene {seed}, restart at {middle} from {one:?} on {two:?}: {difference}"
            ));
        }
    }
    println!("{compared} runs compared");
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
