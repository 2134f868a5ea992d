//! Blocks as surfaces: the faces of every polyhedron in ascending order of ids, so that a file does not depend on
//! the number of ranks.
//!
//! Every face has the values of its block. `body` is the number of the named body, or -1. `rotation` is the
//! rotation since the start as a vector: its direction is the axis, its length the angle.

use super::grains::{space_vector, spin_vector, wrapped};
use super::order::{sorted, vector};
use base::error::Error;
use base::number::to_i64;
use decomposition::Communicator;
use dem::particles::{Kind, Particles};
use dem::space::Space;
use io::{Cells, Column, Data, MeshData};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use plan::scene::Scene;

/// Faces of the blocks of one output, in buffers that are reused.
#[derive(Debug, Default)]
pub(crate) struct Blocks {
    points: Vec<f64>,
    sizes: Vec<usize>,
    corners: Vec<usize>,
    id: Vec<i64>,
    body: Vec<i32>,
    material: Vec<i32>,
    fixed: Vec<u8>,
    velocity: Vec<f64>,
    angular_velocity: Vec<f64>,
    displacement: Vec<f64>,
    rotation: Vec<f64>,
}

/// Numbers per row: id, material, 1 if forces do not move the block, four vectors, the quaternion.
const NUMBERS: usize = 3 + 4 * 3 + 4;

impl Blocks {
    /// Reads the owned blocks of every rank. Collective.
    pub(crate) fn read<S: Space>(
        &mut self,
        particles: &Particles<S>,
        scene: &Scene,
        communicator: &Communicator,
    ) -> Result<(), Error> {
        let rows = (0..particles.owned()).filter_map(|k| row(particles, k, scene));
        let rows = sorted(communicator, rows.collect())?;
        self.clear();
        for row in &rows {
            self.push(row, scene);
        }
        Ok(())
    }

    /// Adds the faces of the block in a row.
    fn push(&mut self, row: &[u64; NUMBERS], scene: &Scene) {
        let Some(solid) = scene.polyhedron(row[0]) else {
            return;
        };
        let q: [f64; 4] = std::array::from_fn(|k| f64::from_bits(row[15 + k]));
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(q[3], q[0], q[1], q[2]));
        let centre = Vector3::from(vector(row, 3));
        let first = self.points.len() / 3;
        for vertex in solid.shape.vertices() {
            let at: [f64; 3] = (centre + turn * vertex).into();
            self.points.extend(at);
        }
        let rotation: [f64; 3] = (turn * solid.orientation.inverse()).scaled_axis().into();
        let body = usize::try_from(row[0]).unwrap_or(usize::MAX);
        let body = if body < scene.bodies.len() {
            i32::try_from(body).unwrap_or(i32::MAX)
        } else {
            -1
        };
        for face in 0..solid.shape.half_spaces().len() {
            let corners = solid.shape.face(face);
            self.sizes.push(corners.len());
            let named = corners.iter().map(|&corner| first + corner as usize);
            self.corners.extend(named);
            self.id.push(to_i64(row[0]));
            self.body.push(body);
            self.material
                .push(i32::try_from(row[1]).unwrap_or(i32::MAX));
            self.fixed.push(u8::from(row[2] == 1));
            self.velocity.extend(vector(row, 6));
            self.angular_velocity.extend(vector(row, 9));
            self.displacement.extend(vector(row, 12));
            self.rotation.extend(rotation);
        }
    }

    fn clear(&mut self) {
        self.sizes.clear();
        self.corners.clear();
        self.id.clear();
        self.body.clear();
        self.material.clear();
        self.fixed.clear();
        for column in [
            &mut self.points,
            &mut self.velocity,
            &mut self.angular_velocity,
            &mut self.displacement,
            &mut self.rotation,
        ] {
            column.clear();
        }
    }

    /// Returns the faces of this rank.
    pub(crate) fn mesh(&self) -> MeshData<'_> {
        let column = |name, units, components, data| Column {
            name,
            units,
            components,
            data,
        };
        let vectors = [
            ("velocity", "m/s", &self.velocity),
            ("angular_velocity", "rad/s", &self.angular_velocity),
            ("displacement", "m", &self.displacement),
            ("rotation", "rad", &self.rotation),
        ];
        let mut cell_columns = vec![
            column("id", "-", 1, Data::I64(&self.id)),
            column("body", "-", 1, Data::I32(&self.body)),
            column("material", "-", 1, Data::I32(&self.material)),
            column("fixed", "-", 1, Data::U8(&self.fixed)),
        ];
        for (name, units, data) in vectors {
            cell_columns.push(column(name, units, 3, Data::F64(data)));
        }
        MeshData {
            points: Data::F64(&self.points),
            cells: Cells::Polygons {
                sizes: &self.sizes,
                corners: &self.corners,
            },
            point_columns: Vec::new(),
            cell_columns,
        }
    }
}

/// Returns a block as numbers; none for a particle without faces.
fn row<S: Space>(particles: &Particles<S>, k: usize, scene: &Scene) -> Option<[u64; NUMBERS]> {
    let (_, state) = particles.polyhedron(k)?;
    let (body, motion) = (&particles.body[k], &particles.motion[k]);
    let displacement = particles.displacement(k);
    let vectors = [
        wrapped(particles, k, &scene.grid),
        space_vector(&motion.velocity),
        spin_vector(&motion.spin),
        displacement.map_or([0.0; 3], |vector| space_vector(&vector)),
    ];
    let mut row = [0; NUMBERS];
    row[0] = body.id;
    row[1] = u64::from(body.material);
    row[2] = u64::from(body.kind != Kind::Free);
    let q = state.orientation.coords;
    let numbers = vectors.as_flattened().iter().chain(q.iter());
    for (to, value) in row[3..].iter_mut().zip(numbers) {
        *to = value.to_bits();
    }
    Some(row)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use case::Document;
    use dem::particles::{Body, Motion};
    use dem::space::Volume;
    use plan::Plan;
    use std::path::Path;

    const CASE: &str = r#"{
        "domain": {"size": [4, 4, 4], "spacing": 0.5, "periodic": ["x"]},
        "materials": {"granite": {"density": 2600}},
        "bodies": [
            {"name": "ball", "shape": {"sphere": {"radius": 0.2}}, "position": [3, 3, 3], "motion": {"fixed": {}},
            "material": "granite"},
            {"name": "box", "shape": {"cuboid": {"edges": [1, 2, 0.5]}}, "position": [2, 2, 1],
            "motion": {"free": {}}, "material": "granite"}
        ],
        "blocks": {"material": "granite", "initial": {"list": [{"shape": {"vertices": [[0, 0, 3], [1, 0, 3], [0, 1,
        3], [0, 0, 4]]}}]}},
        "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}}},
        "time": {"end": 0.1},
        "output": {"blocks": {"every": 0.01}}
    }"#;

    /// Returns the volume that the faces of one id enclose, by the divergence theorem.
    fn enclosed(blocks: &Blocks, id: i64) -> f64 {
        let at = |corner: usize| Vector3::from_fn(|k, _| blocks.points[3 * corner + k]);
        let (mut volume, mut first) = (0.0, 0);
        for (face, &size) in blocks.sizes.iter().enumerate() {
            let corners = &blocks.corners[first..first + size];
            first += size;
            if blocks.id[face] == id {
                for k in 2..size {
                    let [a, b, c] = [0, k - 1, k].map(|n| at(corners[n]));
                    volume += a.dot(&b.cross(&c)) / 6.0;
                }
            }
        }
        volume
    }

    /// Checks a block that left through a periodic face and rotated: its surface is closed and its columns are
    /// those of the block.
    #[test]
    fn surfaces_stand_where_the_blocks_are() {
        let plan = Document::read(CASE, &[], Path::new(""))
            .and_then(Plan::prepare)
            .expect("a good case");
        let scene = &plan.scene;
        let shapes = scene.polyhedra().map(|one| one.solid.shape.clone());
        let mut particles = Particles::<Volume>::new();
        particles.set_shapes(shapes.collect()).expect("space");
        particles.insert(
            Body::uniform::<Volume>(0, 0.2, 2600.0, 0),
            Motion::default(),
        );
        let quarter = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        for (id, shape, position) in [(1, 0, [2.0, 2.0, 1.0]), (2, 1, [5.0, 0.25, 3.25])] {
            let solid = scene.polyhedron(id).expect("a polyhedron");
            let motion = Motion::<Volume> {
                position: position.into(),
                velocity: [0.5, 0.0, -1.0].into(),
                ..Motion::default()
            };
            let body = Body::of_block(id, &solid.shape, 2600.0, 0);
            particles
                .add_block(body, motion, shape, quarter * solid.orientation)
                .expect("a shape");
        }
        let mut blocks = Blocks::default();
        for _ in 0..2 {
            let read = blocks.read(&particles, scene, &Communicator::serial());
            read.expect("rows");
        }
        assert_eq!(blocks.sizes.len(), 6 + 4);
        assert_eq!(blocks.body, [[1; 6].as_slice(), &[-1; 4]].concat());
        assert_relative_eq!(enclosed(&blocks, 1), 1.0, max_relative = 1e-12);
        assert_relative_eq!(enclosed(&blocks, 2), 1.0 / 6.0, max_relative = 1e-12);
        // The box lies along x now; the tetrahedron is back in the domain.
        let reach = |axis: usize, points: &[f64]| {
            let along = points.iter().skip(axis).step_by(3);
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| {
                (low.min(v), high.max(v))
            })
        };
        let (low, high) = reach(0, &blocks.points[..24]);
        assert_relative_eq!(low, 1.0, epsilon = 1e-14);
        assert_relative_eq!(high, 3.0, epsilon = 1e-14);
        let (low, high) = reach(0, &blocks.points[24..]);
        assert_relative_eq!(low, 0.25, epsilon = 1e-14);
        assert_relative_eq!(high, 1.25, epsilon = 1e-14);
        for turn in blocks.rotation.as_chunks::<3>().0 {
            let expected = [0.0, 0.0, std::f64::consts::FRAC_PI_2];
            assert_relative_eq!(&turn[..], &expected[..], epsilon = 1e-12);
        }
        assert_eq!(blocks.velocity[..3], [0.5, 0.0, -1.0]);
        assert_eq!(blocks.mesh().cell_columns.len(), 8);
    }
}
