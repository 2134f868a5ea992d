//! Grains and bodies as points: one vertex each, in ascending order of ids, so that a file does not depend on the
//! number of ranks.

use super::order::{sorted, vector};
use base::error::Error;
use base::number::to_i64;
use decomposition::Communicator;
use dem::Load;
use dem::particles::Particles;
use dem::space::{Components, Space};
use io::{Cells, Column, Data, MeshData};
use plan::scene::grid::Grid;

/// Grains of one output as columns, in buffers that are reused.
#[derive(Debug, Default)]
pub(crate) struct Grains {
    position: Vec<f64>,
    id: Vec<i64>,
    radius: Vec<f64>,
    diameter: Vec<f64>,
    velocity: Vec<f64>,
    angular_velocity: Vec<f64>,
    fluid_force: Vec<f64>,
    contact_force: Vec<f64>,
    material: Vec<i32>,
    /// Displacement from the start \[m\]; empty unless the case requests it.
    displacement: Vec<f64>,
    displaced: bool,
}

/// Numbers per row: id, radius, material, then six vectors.
const NUMBERS: usize = 3 + 6 * 3;

impl Grains {
    /// Returns empty columns; with displacements if `displaced`.
    pub(crate) fn new(displaced: bool) -> Self {
        Self {
            displaced,
            ..Self::default()
        }
    }

    /// Reads the owned grains of every rank. Collective.
    pub(crate) fn read<S: Space>(
        &mut self,
        particles: &Particles<S>,
        grid: &Grid,
        communicator: &Communicator,
    ) -> Result<(), Error> {
        let rows = (0..particles.owned())
            .map(|k| {
                let (body, motion) = (&particles.body[k], &particles.motion[k]);
                let force = |load: &Load<S>| space_vector(&load.force);
                let vectors = [
                    wrapped(particles, k, grid),
                    space_vector(&motion.velocity),
                    spin_vector(&motion.spin),
                    force(&particles.fluid_load(k)),
                    force(&particles.contact[k]),
                    particles
                        .displacement(k)
                        .map_or([0.0; 3], |vector| space_vector(&vector)),
                ];
                let mut row = [0; NUMBERS];
                row[0] = body.id;
                row[1] = body.radius.to_bits();
                row[2] = u64::from(body.material);
                for (to, value) in row[3..].iter_mut().zip(vectors.as_flattened()) {
                    *to = value.to_bits();
                }
                row
            })
            .collect();
        let rows = sorted(communicator, rows)?;
        *self = Self::cleared(std::mem::take(self));
        for row in &rows {
            self.id.push(to_i64(row[0]));
            let radius = f64::from_bits(row[1]);
            self.radius.push(radius);
            self.diameter.push(2.0 * radius);
            self.material
                .push(i32::try_from(row[2]).unwrap_or(i32::MAX));
            self.position.extend(vector(row, 3));
            self.velocity.extend(vector(row, 6));
            self.angular_velocity.extend(vector(row, 9));
            self.fluid_force.extend(vector(row, 12));
            self.contact_force.extend(vector(row, 15));
            if self.displaced {
                self.displacement.extend(vector(row, 18));
            }
        }
        Ok(())
    }

    fn cleared(mut self) -> Self {
        self.id.clear();
        self.material.clear();
        for column in [
            &mut self.position,
            &mut self.radius,
            &mut self.diameter,
            &mut self.velocity,
            &mut self.angular_velocity,
            &mut self.fluid_force,
            &mut self.contact_force,
            &mut self.displacement,
        ] {
            column.clear();
        }
        self
    }

    /// Returns the rows of this rank.
    pub(crate) fn mesh(&self, dimension: usize) -> MeshData<'_> {
        let force = force_unit(dimension);
        let column = |name, units, components, data| Column {
            name,
            units,
            components,
            data,
        };
        let mut point_columns = vec![
            column("id", "-", 1, Data::I64(&self.id)),
            column("radius", "m", 1, Data::F64(&self.radius)),
            column("diameter", "m", 1, Data::F64(&self.diameter)),
            column("velocity", "m/s", 3, Data::F64(&self.velocity)),
            column(
                "angular_velocity",
                "rad/s",
                3,
                Data::F64(&self.angular_velocity),
            ),
            column("fluid_force", force, 3, Data::F64(&self.fluid_force)),
            column("contact_force", force, 3, Data::F64(&self.contact_force)),
            column("material", "-", 1, Data::I32(&self.material)),
        ];
        if self.displaced {
            point_columns.push(column(
                "displacement",
                "m",
                3,
                Data::F64(&self.displacement),
            ));
        }
        MeshData {
            points: Data::F64(&self.position),
            cells: Cells::Vertices,
            point_columns,
            cell_columns: Vec::new(),
        }
    }
}

/// Returns the position of owned grain `k` wrapped into the domain \[m\].
pub(crate) fn wrapped<S: Space>(particles: &Particles<S>, k: usize, grid: &Grid) -> [f64; 3] {
    let raw = space_vector(&particles.motion[k].position);
    std::array::from_fn(|axis| {
        let length = grid.size[axis];
        if axis >= S::DIMENSION || !grid.periodic[axis] {
            return raw[axis];
        }
        // Computed from the raw position in one step, so that the bits do not depend on the shift stored with the
        // grain.
        let periods = -(raw[axis] / length).floor();
        let at = raw[axis] + periods * length;
        if at < 0.0 {
            raw[axis] + (periods + 1.0) * length
        } else if at >= length {
            raw[axis] + (periods - 1.0) * length
        } else {
            at
        }
    })
}

/// Returns a vector with three components from one in the plane or in space.
pub(crate) fn space_vector<C: Components>(value: &C) -> [f64; 3] {
    std::array::from_fn(|k| if k < C::COUNT { value.get(k) } else { 0.0 })
}

/// Returns a spin or moment as a vector: in the plane along z.
pub(crate) fn spin_vector<C: Components>(value: &C) -> [f64; 3] {
    if C::COUNT == 1 {
        [0.0, 0.0, value.get(0)]
    } else {
        space_vector(value)
    }
}

/// Returns the unit of forces; in the plane forces are per metre of depth.
pub(crate) fn force_unit(dimension: usize) -> &'static str {
    if dimension == 2 { "N/m" } else { "N" }
}

/// Returns the unit of torques.
pub(crate) fn torque_unit(dimension: usize) -> &'static str {
    if dimension == 2 { "N m/m" } else { "N m" }
}
