//! Two steps in one sweep below a free surface.

use super::serial;
use crate::collision::{Operator, trt};
use crate::fluid::{Fluid, Force, Models, Setup};
use crate::lattice::VelocitySet;
use crate::surface::SurfaceTension;
use crate::surface::depths::Depths;
use crate::turbulence::EddyViscosity;
use crate::turbulence::smagorinsky::Smagorinsky;
use decomposition::{Domain, SplitAxis};

/// Waves in a basin.
struct Basin {
    cells: [usize; 3],
    split: usize,
    periodic: [bool; 3],
    tension: bool,
    turbulence: Option<EddyViscosity>,
}

impl Basin {
    /// Returns the vertical axis: the last one.
    fn up(&self) -> usize {
        if self.cells[2] == 1 { 1 } else { 2 }
    }

    /// Returns the fill level of a cell.
    fn level(&self, at: [usize; 3]) -> f64 {
        let [x, y] = [0, 1].map(|a| std::f64::consts::TAU * at[a] as f64 / self.cells[a] as f64);
        let y = if self.up() == 1 { 0.0 } else { y };
        let mean = 0.75 * self.cells[self.up()] as f64;
        let height = mean + 1.7 * x.cos() + 0.6 * y.sin();
        (height - at[self.up()] as f64).clamp(0.0, 1.0)
    }

    fn fluid(&self) -> Fluid<f64> {
        let up = self.up();
        let set = if up == 1 {
            VelocitySet::D2Q9
        } else {
            VelocitySet::D3Q19
        };
        let operator = Operator::Trt(trt::TrtParameters { magic: 0.25 });
        let mut models = Models::new(set, operator);
        models.turbulence = self.turbulence;
        let mut setup = Setup::new(models, 0.56, self.cells);
        let mut force = [0.0; 3];
        force[up] = -6e-4;
        setup.force = Force::Constant(force);
        setup.periodic = self.periodic;
        setup.surface_axis = Some(up);
        let axis = [SplitAxis::X, SplitAxis::Y, SplitAxis::Z][self.split];
        let domain = Domain::serial(axis, self.cells[self.split], self.periodic[self.split]);
        let mut fluid = serial(self.split, setup);
        fluid.open_surface(&domain).unwrap();
        if self.tension {
            let tension = SurfaceTension {
                tension: 1e-3,
                contact_angles: [[1.2; 2]; 3],
            };
            fluid.add_surface_tension(tension, &domain).unwrap();
        }
        fluid.fill(&|at| self.level(at));
        fluid
    }
}

/// Returns the state of all cells.
fn bits(fluid: &Fluid<f64>) -> Vec<u64> {
    let (surface, populations) = (fluid.surface().unwrap(), fluid.populations());
    let q = populations.velocities().q();
    let of_cell = |(_, cell): ([usize; 3], usize)| {
        let wet = surface.is_wet(cell);
        let number = move |i| populations.numbers()[populations.incoming(cell, i)];
        let numbers = (0..if wet { q } else { 0 }).map(number);
        surface.saved(cell).into_iter().chain(numbers)
    };
    let all = populations.interior().flat_map(of_cell);
    all.map(f64::to_bits).collect()
}

/// Covers rows along and across the surface, parts of rows, periodic axes in each place, planes between threads, and
/// cells that the surface reaches between the two steps.
#[test]
fn two_steps_in_one_sweep_below_a_surface_are_two_steps() {
    let mut swept = 0;
    for (cells, tension) in [
        ([34, 44, 1], false),
        ([52, 34, 1], true),
        ([34, 10, 32], false),
        ([9, 34, 28], false),
    ] {
        let up = if cells[2] == 1 { 1 } else { 2 };
        for (periodic, split) in [[false; 3], [true, false, false], [true, up == 2, false]]
            .into_iter()
            .flat_map(|periodic| (0..=up).map(move |split| (periodic, split)))
        {
            let basin = Basin {
                cells,
                split,
                periodic,
                tension,
                turbulence: None,
            };
            let run = |threads: usize, at_once: bool| {
                let mut fluid = basin.fluid();
                fluid.threads = threads;
                let kinds = fluid.surface().unwrap().kinds().to_vec();
                let mut far = false;
                for _ in 0..15 {
                    if at_once {
                        assert!(fluid.may_advance_two());
                        far |= fluid.find_far(&mut Depths::default());
                        fluid.advance_two();
                    } else {
                        for _ in 0..2 {
                            fluid.advance();
                            fluid.move_surface();
                        }
                    }
                }
                assert_eq!(fluid.steps(), 30);
                assert!(fluid.surface().unwrap().kinds() != kinds);
                (far, bits(&fluid))
            };
            let (_, steps) = run(1, false);
            for threads in 1..4 {
                let (far, at_once) = run(threads, true);
                assert!(steps == at_once, "{cells:?} {periodic:?} {split} {threads}");
                swept += usize::from(far);
            }
        }
    }
    assert!(swept > 40, "{swept}");
}

#[test]
fn water_with_a_body_moves_in_single_steps() {
    let basin = Basin {
        cells: [34, 44, 1],
        split: 0,
        periodic: [false; 3],
        tension: false,
        turbulence: None,
    };
    let mut fluid = basin.fluid();
    assert_eq!(fluid.at_once(), 2);
    fluid.advance();
    fluid.move_surface();
    assert_eq!(fluid.at_once(), 1);
    fluid.advance();
    fluid.move_surface();
    fluid.close(std::iter::empty());
    assert_eq!(fluid.at_once(), 1);
}

/// Checks deep water with an eddy viscosity, in which two steps in one sweep would lack the velocities of the first.
#[test]
fn water_with_an_eddy_viscosity_moves_in_single_steps() {
    for (cells, periodic) in [
        ([34, 44, 1], false),
        ([34, 44, 1], true),
        ([12, 12, 32], false),
    ] {
        let basin = Basin {
            cells,
            split: 0,
            periodic: [periodic, false, false],
            tension: false,
            turbulence: Some(EddyViscosity::Smagorinsky(Smagorinsky { constant: 0.17 })),
        };
        let mut fluid = basin.fluid();
        for _ in 0..4 {
            assert_eq!(fluid.at_once(), 1);
            fluid.advance();
            fluid.move_surface();
        }
    }
}
