//! Contacts, bonds and capillary bridges as lines from centre to centre, or from a centre to the contact point on a
//! wall or a block.

use super::grains::{force_unit, space_vector, wrapped};
use super::order::{sorted, vector};
use base::error::Error;
use base::number::to_i64;
use decomposition::Communicator;
use dem::particles::Particles;
use dem::space::Space;
use dem::{Contact, Dem};
use io::{Cells, Column, Data, MeshData};
use plan::scene::grid::Grid;

/// Contacts of one output as lines, in buffers that are reused.
#[derive(Debug, Default)]
pub(crate) struct Contacts {
    points: Vec<f64>,
    lines: Vec<[usize; 2]>,
    grain: Vec<i64>,
    other: Vec<i64>,
    wall: Vec<i32>,
    normal_force: Vec<f64>,
    overlap: Vec<f64>,
    bonded: Vec<u8>,
    /// Forces of the bridges; none if the contact law has no bridges.
    bridge: Option<Vec<f64>>,
}

/// Numbers per row: grain, other grain or [`NONE`], wall or [`NONE`], bonded, force, overlap, both ends, bridge.
const NUMBERS: usize = 6 + 2 * 3 + 1;
const NONE: u64 = u64::MAX;

impl Contacts {
    /// Returns empty buffers, with a column of bridges if the contact law has `bridges`.
    pub(crate) fn new(bridges: bool) -> Self {
        Self {
            bridge: bridges.then(Vec::new),
            ..Self::default()
        }
    }

    /// Reads the contacts of every rank. Collective.
    pub(crate) fn read<S: Space>(
        &mut self,
        dem: Option<&Dem<S>>,
        particles: &Particles<S>,
        grid: &Grid,
        communicator: &Communicator,
    ) -> Result<(), Error> {
        let mut rows = Vec::new();
        if let Some(dem) = dem {
            dem.for_each_contact(particles, |contact| {
                rows.push(row(&contact, particles, grid))
            });
        }
        let rows = sorted(communicator, rows)?;
        self.clear();
        for row in &rows {
            let first = self.points.len() / 3;
            self.lines.push([first, first + 1]);
            self.points.extend(vector(row, 6));
            self.points.extend(vector(row, 9));
            self.grain.push(to_i64(row[0]));
            self.other
                .push(if row[1] == NONE { -1 } else { to_i64(row[1]) });
            self.wall.push(i32::try_from(row[2]).unwrap_or(-1));
            self.bonded.push(u8::from(row[3] == 1));
            self.normal_force.push(f64::from_bits(row[4]));
            self.overlap.push(f64::from_bits(row[5]));
            if let Some(bridge) = &mut self.bridge {
                bridge.push(f64::from_bits(row[12]));
            }
        }
        Ok(())
    }

    fn clear(&mut self) {
        self.points.clear();
        self.lines.clear();
        self.grain.clear();
        self.other.clear();
        self.wall.clear();
        self.normal_force.clear();
        self.overlap.clear();
        self.bonded.clear();
        if let Some(bridge) = &mut self.bridge {
            bridge.clear();
        }
    }

    /// Returns the lines of this rank.
    pub(crate) fn mesh(&self, dimension: usize) -> MeshData<'_> {
        let column = |name, units, data| Column {
            name,
            units,
            components: 1,
            data,
        };
        let force = force_unit(dimension);
        let mut cell_columns = vec![
            column("grain", "-", Data::I64(&self.grain)),
            column("other", "-", Data::I64(&self.other)),
            column("wall", "-", Data::I32(&self.wall)),
            column("normal_force", force, Data::F64(&self.normal_force)),
            column("overlap", "m", Data::F64(&self.overlap)),
            column("bonded", "-", Data::U8(&self.bonded)),
        ];
        if let Some(bridge) = &self.bridge {
            cell_columns.push(column("bridge_force", force, Data::F64(bridge)));
        }
        MeshData {
            points: Data::F64(&self.points),
            cells: Cells::Lines(&self.lines),
            point_columns: Vec::new(),
            cell_columns,
        }
    }
}

fn row<S: Space>(contact: &Contact<S>, particles: &Particles<S>, grid: &Grid) -> [u64; NUMBERS] {
    let radius = particles.body[contact.grain].radius;
    let from = wrapped(particles, contact.grain, grid);
    let normal = space_vector(&contact.normal);
    let shaped = |k: usize| particles.polyhedron(k).is_some();
    let block = shaped(contact.grain) || contact.other.is_some_and(shaped);
    // The arm lies along the normal, so that a contact through a periodic face is a short line that leaves the
    // domain.
    let arm = match contact.other {
        Some(other) => radius + particles.body[other].radius - contact.overlap,
        None => 0.5 * contact.overlap - radius,
    };
    let to_point = space_vector(&(contact.position - particles.location(contact.grain)));
    let mut row = [
        particles.body[contact.grain].id,
        contact.other.map_or(NONE, |k| particles.body[k].id),
        contact.wall.map_or(NONE, u64::from),
        u64::from(contact.bonded),
        contact.normal_force.to_bits(),
        contact.overlap.to_bits(),
        0,
        0,
        0,
        0,
        0,
        0,
        contact.bridge.to_bits(),
    ];
    for axis in 0..3 {
        row[6 + axis] = from[axis].to_bits();
        let along = if block {
            to_point[axis]
        } else {
            arm * normal[axis]
        };
        row[9 + axis] = (from[axis] + along).to_bits();
    }
    row
}
