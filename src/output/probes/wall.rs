//! Force of the fluid on a face of the domain, from the momentum transferred through its links.
//!
//! [`Flux`](lbm::boundary::Flux) counts whole populations, so that a fluid at rest exerts the pressure of
//! density one on every patch. This reference is subtracted link by link, in the same integers, and the gauge pressure
//! remains. Away from edges the reference is 1/3 per cell along the normal. Along an edge each component of force and
//! mass flux is that of the face normal to it, and a wall next to an opening has the shear stress of
//! the nearest cells up to the edge (see [`lbm::boundary`]).
//!
//! On a face with inflow or outflow the force includes the momentum of that fluid. A plane of symmetry exerts no
//! tangential force, also below a moving surface.
//!
//! Force and mass flux are those of the water. Where a structure, or a body with moving bounce-back, covers a face,
//! they are zero, whatever it contains: a body that leaves through an opening is no discharge. Partially saturated
//! cells have the pressure of the adjacent water and pass it on, so that a face has it below a body too; what moves
//! with such a body through an opening counts in the mass flux.

use super::quantity::Quantity;
use super::{Heading, Rows, Run, face_area, fluid, no_fluid};
use crate::grains::force_unit;
use crate::view::StateView;
use base::error::Error;
use base::number::real;
use case::geometry::Face;
use coupling::FluidView;
use decomposition::Communicator;
use dem::space::Space;
use lbm::boundary::{BoundaryKind, Condition, Flux, SurfaceKind, from_quanta, quanta};
use lbm::lattice::Velocities;
use plan::Plan;
use plan::scene::Scene;
use plan::scene::flow::Flow;
use plan::scene::grid::Grid;

/// Probe of a face.
#[derive(Debug)]
pub(super) struct Wall {
    face: Face,
    /// Faces of the patches of the scene: the fluid has these patches in this order, then one wall per face.
    faces: Vec<Face>,
    /// Force of a stationary fluid of density one, in quanta; set at the beginning of the run.
    reference: [i128; 3],
    cells: f64,
    /// Step up to which no flux through the face is known; none if the fluid has moved since it was created or read.
    first: Option<u64>,
}

impl Wall {
    /// Returns the force on a face.
    pub(super) fn new(scene: &Scene, face: Face) -> Result<Self, Error> {
        let (flow, grid) = (scene.flow.as_ref().ok_or_else(no_fluid)?, &scene.grid);
        Ok(Self {
            face,
            faces: flow.patches().map(|patch| patch.face).collect(),
            reference: [0; 3],
            cells: (0..grid.dimension)
                .filter(|&a| a != face.axis())
                .map(|a| real(grid.cells[a]))
                .product(),
            first: None,
        })
    }

    /// Sets the reference of the face, and the step at which the fluid was created or read, for which no fluxes are
    /// known: a checkpoint contains none.
    fn start(&mut self, plan: &Plan, resumed_at: Option<u64>) -> Result<(), Error> {
        let flow = plan.scene.flow.as_ref().ok_or_else(no_fluid)?;
        let velocities = flow.models.lattice.velocities();
        self.reference = reference(self.face, flow, &plan.scene.grid, &velocities);
        self.first = resumed_at.or((plan.clock.warm_up_steps == 0).then_some(0));
        Ok(())
    }

    /// Returns `true` if fluxes are known: this process has advanced the fluid since it was created or read.
    fn has_flux(&self, step: u64) -> bool {
        self.first.is_none_or(|first| step > first)
    }

    /// Returns the force, its normal part (positive towards the wall) and the magnitude of its tangential part,
    /// both per area, and the mass outflow per time. Collective.
    fn measure(
        &self,
        fluid: &dyn FluidView,
        communicator: &Communicator,
    ) -> Result<[f64; 8], Error> {
        let fluxes = fluid.fluxes();
        let whole = communicator.all_true(fluxes.len() == self.faces.len() + Face::ALL.len());
        if !whole {
            return Err(Error::Internal(
                "the patches of the fluid differ from those of the scene".into(),
            ));
        }
        let mut total = Flux::default();
        for (face, flux) in self.faces.iter().chain(&Face::ALL).zip(&fluxes) {
            if *face == self.face {
                total.mass += flux.mass;
                for (sum, force) in total.force.iter_mut().zip(flux.force) {
                    *sum += force;
                }
            }
        }
        let mut sums = [
            total.force[0].cast_unsigned(),
            total.force[1].cast_unsigned(),
            total.force[2].cast_unsigned(),
            total.mass.cast_unsigned(),
        ];
        communicator.all_reduce_sum_u128s(&mut sums);
        let [x, y, z, mass] = sums.map(u128::cast_signed);
        let units = fluid.units();
        let force: [f64; 3] = std::array::from_fn(|a| {
            units.force_to_si(from_quanta([x, y, z][a] - self.reference[a]))
        });
        let axis = self.face.axis();
        let normal = if self.face.is_max() {
            force[axis]
        } else {
            -force[axis]
        };
        let squared: f64 = (0..3)
            .filter(|&a| a != axis)
            .map(|a| force[a].powi(2))
            .sum();
        let shear = squared.sqrt();
        let area = self.cells * face_area(units);
        let mass_flux = units.rate_to_si(from_quanta(mass) * units.mass_scale());
        let [fx, fy, fz] = force;
        Ok([
            fx,
            fy,
            fz,
            normal,
            shear,
            normal / area,
            shear / area,
            mass_flux,
        ])
    }
}

impl Quantity for Wall {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        let dimension = scene.grid.dimension;
        let force = force_unit(dimension);
        vec![
            ("force_x", force),
            ("force_y", force),
            ("force_z", force),
            ("normal_force", force),
            ("shear_force", force),
            ("mean_pressure", "Pa"),
            ("mean_shear_stress", "Pa"),
            (
                "mass_flux",
                if dimension == 2 { "kg/(m s)" } else { "kg/s" },
            ),
        ]
    }

    fn delay(&self) -> f64 {
        0.5
    }

    fn begin(&mut self, run: &Run) -> Result<(), Error> {
        self.start(run.plan, run.resumed_at)
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        if !self.has_flux(view.step) {
            return Ok(false);
        }
        let values = self.measure(fluid(view)?, view.domain.communicator())?;
        rows.iter_mut().for_each(|row| row.extend(values));
        Ok(true)
    }
}

/// Returns the force on a face of a stationary fluid with density one, in quanta.
fn reference(face: Face, flow: &Flow, grid: &Grid, velocities: &Velocities) -> [i128; 3] {
    let mut sum = [0; 3];
    let (mut from, mut to) = ([0; 3], grid.cells);
    if face.is_max() {
        from[face.axis()] = grid.cells[face.axis()] - 1;
    } else {
        to[face.axis()] = 1;
    }
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            for x in from[0]..to[0] {
                let cell = [x, y, z];
                for (c, w) in velocities.c.iter().zip(&velocities.w) {
                    let outside: [bool; 3] = std::array::from_fn(|a| {
                        a < grid.dimension
                            && !grid.periodic[a]
                            && ((c[a] < 0 && cell[a] == 0)
                                || (c[a] > 0 && cell[a] + 1 == grid.cells[a]))
                    });
                    let owner = (0..3)
                        .filter(|&a| outside[a])
                        .map(|a| Face::ALL[2 * a + usize::from(c[a] > 0)])
                        .max_by_key(|face| wall_kind(condition(*face, cell, flow)).precedence());
                    let Some(owner) = owner else {
                        continue;
                    };
                    // A population leaves with velocity c and returns reversed, or mirrored at the faces that it
                    // crosses. Each component acts on the face normal to it, the others on the owner of the link.
                    let surface = wall_kind(condition(owner, cell, flow)).surface;
                    let mirrored = surface == SurfaceKind::Symmetry;
                    for a in 0..3 {
                        let on = if outside[a] {
                            Face::ALL[2 * a + usize::from(c[a] > 0)]
                        } else {
                            owner
                        };
                        if on == face && (outside[a] || !mirrored) {
                            sum[a] += 2 * i128::from(c[a]) * i128::from(quanta(*w));
                        }
                    }
                }
            }
        }
    }
    sum
}

/// Returns the condition at a face next to a cell: that of the last patch that contains the cell.
fn condition(face: Face, cell: [usize; 3], flow: &Flow) -> Option<&Condition> {
    let patches = flow.faces[face.index()].iter().rev();
    patches
        .filter(|patch| {
            (0..3).all(|a| a == face.axis() || (patch.from[a]..patch.to[a]).contains(&cell[a]))
        })
        .map(|patch| &patch.condition)
        .next()
}

/// Returns the type of condition at the wall; a stationary wall if the case gives none.
fn wall_kind(condition: Option<&Condition>) -> BoundaryKind {
    condition.map_or(BoundaryKind::WALL, |condition| condition.model().kind())
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::units::LatticeUnits;
    use case::Document;
    use decomposition::{Domain, SplitAxis};
    use lbm::boundary::convective_outflow::{Carried, ConvectiveOutflowLinks};
    use lbm::boundary::{Patch, Ramp, Rule, free_slip, no_slip, pressure};
    use lbm::collision::{Operator, bgk};
    use lbm::fluid::{Fluid, Models, Setup};
    use lbm::lattice::VelocitySet;
    use std::path::Path;

    const CASE: &str = r#"{
      "title": "rest",
      "domain": {"size": [6e-3, 4e-3], "spacing": 1e-3},
      "fluid": {"lattice_boltzmann": {
        "density": 1000, "kinematic_viscosity": 1e-6, "relaxation_time": 0.8,
        "boundaries": [
          {"name": "in", "face": "x_min", "condition": {"pressure": {"value": 1e-4}}},
          {"name": "out", "face": "x_max", "condition": {"outflow": {}}},
          {"name": "top", "face": "y_max", "condition": {"free_slip": {}}}
        ]}},
      "time": {"end": 10}
    }"#;

    struct Still(LatticeUnits, Vec<Flux>);

    impl FluidView for Still {
        fn units(&self) -> &LatticeUnits {
            &self.0
        }
        fn cells(&self) -> [usize; 3] {
            [6, 4, 1]
        }
        fn start(&self) -> [usize; 3] {
            [0; 3]
        }
        fn state(&self, _: [usize; 3]) -> (f64, [f64; 3]) {
            (0.0, [0.0; 3])
        }
        fn stress(&self, _: [usize; 3]) -> [[f64; 3]; 3] {
            [[0.0; 3]; 3]
        }
        fn body_at(&self, _: [usize; 3]) -> Option<u64> {
            None
        }
        fn patches(&self) -> Vec<String> {
            Vec::new()
        }
        fn fluxes(&self) -> Vec<Flux> {
            self.1.clone()
        }
    }

    /// Returns the rule that the case imposes, without its pressure.
    fn rule(patch: &str, deviation: f64) -> Box<dyn Rule<f64>> {
        match patch {
            "in" => Box::new(pressure::PressureLinks::new(0, Ramp::constant(deviation))),
            "out" => Box::new(ConvectiveOutflowLinks::new((0, true), Carried::Whole)),
            "top" => Box::<free_slip::FreeSlipLinks>::default(),
            _ => Box::new(no_slip::NoSlipLinks),
        }
    }

    fn still(deviation: f64) -> (Plan, Still) {
        let document = Document::read(CASE, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let flow = plan.scene.flow.as_ref().unwrap();
        let patches = flow
            .patches()
            .map(|patch| Patch {
                name: patch.name.clone(),
                axis: patch.face.axis(),
                upper: patch.face.is_max(),
                range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
                rule: rule(&patch.name, deviation),
            })
            .collect();
        let setup = Setup {
            patches,
            ..Setup::new(
                Models::new(VelocitySet::D2Q9, Operator::Bgk(bgk::BgkParameters {})),
                0.8,
                plan.scene.grid.cells,
            )
        };
        let mut fluid = Fluid::<f64>::new(setup, &Domain::serial(SplitAxis::X, 6, false)).unwrap();
        fluid.initialise(&|_| (deviation, [0.0; 3]));
        fluid.advance();
        let still = Still(plan.units.unwrap(), fluid.fluxes());
        (plan, still)
    }

    fn sample(face: Face, plan: &Plan, fluid: &Still) -> [f64; 8] {
        let mut wall = Wall::new(&plan.scene, face).unwrap();
        wall.start(plan, None).unwrap();
        wall.measure(fluid, &Communicator::serial()).unwrap()
    }

    /// Checks every condition and corner: a stationary fluid at the reference pressure exerts exactly no force.
    #[test]
    fn the_reference_is_what_a_fluid_at_rest_exerts() {
        let (plan, fluid) = still(0.0);
        for face in [Face::XMin, Face::XMax, Face::YMin, Face::YMax] {
            assert_eq!(sample(face, &plan, &fluid), [0.0; 8], "{face:?}");
        }
    }

    #[test]
    fn a_wall_feels_the_pressure_above_the_reference() {
        let (plan, fluid) = still(1e-3);
        let pressure = fluid.0.density_deviation_to_pressure(1e-3);
        let [x, y, _, normal, shear, mean, ..] = sample(Face::YMin, &plan, &fluid);
        let length = 6e-3;
        approx::assert_relative_eq!(mean, pressure, max_relative = 1e-9);
        approx::assert_relative_eq!(y, -pressure * length, max_relative = 1e-9);
        approx::assert_relative_eq!(normal, pressure * length, max_relative = 1e-9);
        assert!(x.abs() < 1e-9 * normal && shear < 1e-9 * normal);
    }
}
