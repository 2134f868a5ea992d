mod bodies;
mod cuts;
mod drops;
mod films;
mod momentum;
mod openings;
mod order;
mod waves;

use super::kind::{GAS, LIQUID};
use super::opening::Outside;
use crate::boundary::{Patch, Strength, free_slip, outfall, velocity};
use crate::collision::{Operator, bgk, trt};
use crate::fluid::{Fluid, Force, Models, Setup};
use crate::lattice::VelocitySet;
use crate::quanta::from_quanta;
use crate::saturation::SaturationMethod;
use base::history::TimeTable;
use decomposition::{Domain, SplitAxis};

/// Returns water outside with levels that hold at the face.
fn at_face(levels: TimeTable) -> Outside {
    Outside::Level {
        levels,
        in_reservoir: false,
    }
}

/// Axes along which the slabs may be cut.
const AXES: [SplitAxis; 3] = [SplitAxis::X, SplitAxis::Y, SplitAxis::Z];

const EVERYWHERE: [[f64; 2]; 3] = [[f64::NEG_INFINITY, f64::INFINITY]; 3];

/// A stream through a part of a face: axis and end of the face, range along y, velocity.
type Stream = ((usize, bool), [f64; 2], [f64; 3]);

/// A box of water under gravity along -y with side walls of free slip, split along an axis.
pub(super) struct Tank {
    models: Models,
    pub(super) tau: f64,
    pub(super) gravity: f64,
    pub(super) cells: [usize; 3],
    pub(super) split: usize,
    pub(super) slip_at: Vec<(usize, bool)>,
    pub(super) periodic: [bool; 3],
    /// Accelerations along x and z in addition to gravity.
    pub(super) slope: [f64; 2],
    /// Openings over whole faces.
    pub(super) open_at: Vec<(usize, bool, Outside)>,
    /// Streams through parts of faces: face, range along y, velocity.
    pub(super) streams: Vec<Stream>,
    pub(super) solids: Vec<[usize; 3]>,
    saturation: Option<SaturationMethod>,
    /// Vertical axis for the order of the axes in memory.
    pub(super) surface_axis: Option<usize>,
}

impl Tank {
    pub(super) fn new(cells: [usize; 3]) -> Self {
        Self {
            models: Models::new(
                if cells[2] == 1 {
                    VelocitySet::D2Q9
                } else {
                    VelocitySet::D3Q19
                },
                Operator::Trt(trt::TrtParameters { magic: 0.25 }),
            ),
            tau: 0.6,
            gravity: 1e-4,
            cells,
            split: 0,
            slip_at: Vec::new(),
            periodic: [false, false, cells[2] == 1],
            slope: [0.0; 2],
            open_at: Vec::new(),
            streams: Vec::new(),
            solids: Vec::new(),
            saturation: None,
            surface_axis: Some(1),
        }
    }

    /// Returns the patches of the faces.
    fn patches(&self) -> Vec<Patch> {
        let name = |n: usize| format!("patch {n}");
        let slips = self.slip_at.iter().enumerate();
        let slips = slips.map(|(n, &(axis, upper))| Patch {
            name: name(n),
            axis,
            upper,
            range: EVERYWHERE,
            rule: Box::<free_slip::FreeSlipLinks>::default(),
        });
        let open = self.open_at.iter().map(|(axis, upper, outside)| Patch {
            name: format!("open {axis} {upper}"),
            axis: *axis,
            upper: *upper,
            range: EVERYWHERE,
            rule: Box::new(outfall::Links {
                strength: Strength::Pressure,
                outside: outside.clone(),
            }),
        });
        let streams = self.streams.iter().map(|((axis, upper), y, velocity)| {
            let mut range = EVERYWHERE;
            range[1] = *y;
            Patch {
                name: "stream".into(),
                axis: *axis,
                upper: *upper,
                range,
                rule: Box::new(velocity::VelocityLinks::uniform(*velocity)),
            }
        });
        slips.chain(open).chain(streams).collect()
    }

    /// Returns the domain on one rank.
    pub(super) fn domain(&self) -> Domain {
        let planes = self.cells[self.split];
        Domain::serial(AXES[self.split], planes, self.periodic[self.split])
    }

    /// Returns the stationary fluid with these fill levels and the pressure of its own column.
    pub(super) fn fill(&self, level: impl Fn([usize; 3]) -> f64 + Sync) -> Fluid<f64> {
        let mut fluid = self.empty(&self.domain());
        self.pour(&mut fluid, level);
        fluid
    }

    /// Returns the slab of this rank without water.
    pub(super) fn empty(&self, domain: &Domain) -> Fluid<f64> {
        let setup = Setup {
            force: Force::Constant([self.slope[0], -self.gravity, self.slope[1]]),
            periodic: self.periodic,
            patches: self.patches(),
            saturation: self.saturation,
            surface_axis: self.surface_axis,
            ..Setup::new(self.models, self.tau, self.cells)
        };
        let mut fluid = Fluid::new(setup, domain).unwrap();
        fluid.open_surface(domain).unwrap();
        fluid
    }

    /// Fills a slab with stationary water of these fill levels and the pressure of its own column.
    pub(super) fn pour(&self, fluid: &mut Fluid<f64>, level: impl Fn([usize; 3]) -> f64 + Sync) {
        let solids = self.solids.iter();
        let solids: Vec<usize> = solids
            .map(|at| fluid.populations().interior_cell(*at))
            .collect();
        fluid.surface_mut().unwrap().make_solid(solids.into_iter());
        let [width, height, breadth] = self.cells;
        let index = |[x, y, z]: [usize; 3]| (z * width + x) * height + y;
        // Each level once: the water above a cell is asked for all cells.
        let cells = (0..width * breadth).flat_map(|n| (0..height).map(move |y| (n, y)));
        let levels: Vec<f64> = cells
            .map(|(n, y)| level([n % width, y, n / width]))
            .collect();
        fluid.initialise(&|p: [f64; 3]| {
            let [x, y, z] = p.map(|x| base::number::whole(x.floor()));
            let at = [x.min(width - 1), y.min(height), z.min(breadth - 1)];
            let rest = index(at)..index([at[0], height, at[2]]);
            let above: f64 = levels[rest].iter().sum();
            let depth = (above - 0.5).max(0.0);
            (3.0 * self.gravity * depth, [0.0; 3])
        });
        fluid.fill(&level);
    }
}

pub(super) fn step(fluid: &mut Fluid<f64>, steps: usize) {
    for _ in 0..steps {
        fluid.advance();
        fluid.move_surface();
    }
}

pub(super) fn mass(fluid: &Fluid<f64>) -> f64 {
    from_quanta(fluid.surface().unwrap().mass(fluid.populations()))
}

/// Returns a block of water against the left wall.
pub(super) fn dam(width: usize, height: usize) -> impl Fn([usize; 3]) -> f64 {
    move |[x, y, _]| f64::from(u8::from(x < width && y < height))
}

/// Returns the state of all cells of the water, as bits.
pub(super) fn bits(fluid: &Fluid<f64>) -> Vec<([usize; 3], Vec<u64>)> {
    let surface = fluid.surface().unwrap();
    let populations = fluid.populations();
    let mut all: Vec<_> = populations
        .interior()
        .map(|(at, cell)| {
            let mut bits: Vec<u64> = surface.saved(cell).iter().map(|x| x.to_bits()).collect();
            bits.push(surface.fill(cell).to_bits());
            if surface.is_wet(cell) {
                let q = populations.velocities().q();
                let number = |i| populations.numbers()[populations.incoming(cell, i)];
                bits.extend((0..q).map(|i| number(i).to_bits()));
            }
            (at, bits)
        })
        .collect();
    all.sort_unstable();
    all
}

#[test]
fn water_keeps_its_mass_and_liquid_never_touches_gas() {
    for cells in [[48, 24, 1], [24, 16, 6]] {
        let mut tank = Tank::new(cells);
        tank.tau = 0.52;
        tank.slip_at = vec![(1, false)];
        let mut fluid = tank.fill(dam(12, 12));
        let before = mass(&fluid);
        assert!((before / (12.0 * 12.0 * cells[2] as f64) - 1.0).abs() < 2e-3);
        for _ in 0..20 {
            step(&mut fluid, 75);
            let surface = fluid.surface().unwrap();
            let kept = mass(&fluid) + surface.lost_mass();
            assert!((kept / before - 1.0).abs() < 1e-12, "{kept} of {before}");
            for (_, cell) in fluid.populations().interior() {
                if surface.cells.kind[cell] == LIQUID {
                    assert_eq!(surface.cells.count_neighbours(cell, |kind| kind == GAS), 0);
                }
            }
        }
        assert!(fluid.surface().unwrap().lost_mass().abs() < 1e-2 * before);
        // The water has reached the other wall.
        let far = fluid.populations().interior_cell([cells[0] - 1, 0, 0]);
        assert!(fluid.surface().unwrap().is_wet(far));
    }
}

#[test]
fn the_bits_do_not_depend_on_the_axis_of_the_slabs() {
    for cells in [[30, 18, 1], [18, 14, 5]] {
        let dimension = if cells[2] == 1 { 2 } else { 3 };
        let states: Vec<_> = (0..dimension)
            .map(|split| {
                let mut tank = Tank::new(cells);
                tank.split = split;
                tank.slip_at = vec![(0, true), (2, false)];
                let mut fluid = tank.fill(dam(9, 11));
                step(&mut fluid, 301);
                bits(&fluid)
            })
            .collect();
        for other in &states[1..] {
            assert!(*other == states[0]);
        }
    }
}

#[test]
fn water_at_rest_stays_at_rest_at_any_fill_level() {
    for level in [7.0, 7.25, 7.5, 7.9] {
        let mut tank = Tank::new([12, 12, 1]);
        tank.gravity = 1e-4;
        let fill = move |[_, y, _]: [usize; 3]| (level - y as f64).clamp(0.0, 1.0);
        let mut fluid = tank.fill(fill);
        step(&mut fluid, 4000);
        for (at, cell) in fluid.populations().interior() {
            let wet = fluid.surface().unwrap().is_wet(cell);
            let (drho, u) = fluid.state(cell);
            if wet && at[1] < 7 {
                let exact = 3.0 * tank.gravity * (level - at[1] as f64 - 0.5);
                assert!(
                    (drho - exact).abs() < 2e-6,
                    "{level} {at:?}: {drho} for {exact}"
                );
                assert!(u[0].abs() + u[1].abs() < 1e-6, "{level} {at:?}: {u:?}");
            }
        }
    }
}

/// Checks that the load on a ceiling in the air is that at the reference pressure, also where the vectors of the pass
/// contain water and gas.
#[test]
fn a_wall_in_the_air_carries_no_load() {
    for split in [0, 1] {
        let mut tank = Tank::new([14, 12, 1]);
        tank.split = split;
        tank.periodic[0] = true;
        tank.gravity = 2e-4;
        tank.slope = [3e-5, 0.0];
        let mut fluid = tank.fill(|[_, y, _]| (9.8 - y as f64).clamp(0.0, 1.0));
        // The walls follow the patches in the order of the faces.
        let ceiling = |fluid: &Fluid<f64>| fluid.fluxes()[3].force;
        let at_rest = ceiling(&fluid);
        assert_ne!(at_rest[1], 0);
        step(&mut fluid, 60);
        assert_eq!(ceiling(&fluid), at_rest, "split {split}");
    }
}

#[test]
fn an_operator_of_one_rate_works_too() {
    let mut tank = Tank::new([30, 16, 1]);
    tank.models.collision = Operator::Bgk(bgk::BgkParameters {});
    let mut fluid = tank.fill(dam(10, 10));
    let before = mass(&fluid);
    step(&mut fluid, 500);
    let kept = mass(&fluid) + fluid.surface().unwrap().lost_mass();
    assert!((kept / before - 1.0).abs() < 1e-12);
}
