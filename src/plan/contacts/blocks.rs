//! Stability limits of blocks: springs on all faces, and on the smallest face alone; contacts without a potential
//! energy.

use super::{Limits, limit};
use crate::scene::findings::Findings;
use crate::scene::{Scene, ScenePolyhedron};
use base::error::Remedy;
use base::number::to_u32;
use dem::contact::Springs;
use dem::contact::blocks::{self, BlockLaw};
use dem::polyhedron::{BlockContactModel, BlockPairLaw, Polyhedron, Stiffness};
use nalgebra::{Matrix6, SymmetricEigen, Vector3, Vector6};

/// Returns two unstable time steps \[s\] of free blocks: the shortest one with a single face in contact with a
/// fixed body, and that with all faces in contact with neighbours that move against the block.
pub(super) fn limits(scene: &Scene, law: &BlockLaw) -> Limits {
    let mut shortest = [f64::INFINITY; 2];
    for ScenePolyhedron {
        solid, material, ..
    } in scene.polyhedra().filter(|one| one.free)
    {
        let mass = scene.density(material) * solid.shape.volume();
        if mass <= 0.0 {
            continue;
        }
        for pair in law.parameters.rows_of(to_u32(material)) {
            let block = Block {
                shape: &solid.shape,
                mass,
                per_area: matches!(pair.stiffness, Stiffness::PerArea { .. }),
                pair,
            };
            shortest[0] = shortest[0].min(block.one_face());
            shortest[1] = shortest[1].min(block.all_faces());
        }
    }
    Limits {
        slipping: shortest[0],
        sticking: shortest[1],
        packing: f64::INFINITY,
        held: true,
    }
}

struct Block<'a> {
    shape: &'a Polyhedron,
    mass: f64,
    per_area: bool,
    pair: &'a BlockPairLaw,
}

impl Block<'_> {
    /// Springs and dashpots of a face, normal and shear; the dashpots are those against a body of `mass`.
    fn springs(&self, face: usize, mass: f64) -> Springs {
        blocks::springs(self.pair, self.shape.face_area(face), mass)
    }

    fn one_face(&self) -> f64 {
        let faces = 0..self.shape.half_spaces().len();
        let steps = faces.map(|face| {
            let found = self.springs(face, self.mass);
            limit(
                found.stiffness[0] / self.mass,
                found.dashpots[0] / self.mass,
            )
        });
        steps.fold(0.0, f64::max)
    }

    /// Returns the largest eigenvalue with contacts on all faces: whatever the neighbours do, it is at most twice
    /// that of a block between fixed neighbours.
    fn all_faces(&self) -> f64 {
        let (mut springs, mut dashpots) = (Matrix6::zeros(), Matrix6::zeros());
        for face in 0..self.shape.half_spaces().len() {
            let found = self.springs(face, 0.5 * self.mass);
            springs += self.resistance(face, found.stiffness, false);
            dashpots += self.resistance(face, found.dashpots, true);
        }
        let mut dt = 0.0;
        let mut found = f64::INFINITY;
        for _ in 0..4 {
            let matrix = if dt > 0.0 {
                springs * dt + dashpots * 2.0
            } else {
                springs
            };
            let eigen = SymmetricEigen::new(matrix);
            let highest = eigen
                .eigenvectors
                .column(eigen.eigenvalues.imax())
                .into_owned();
            let weigh = |matrix: &Matrix6<f64>| 2.0 * highest.dot(&(matrix * highest));
            dt = limit(weigh(&springs), weigh(&dashpots));
            found = found.min(dt);
        }
        found
    }

    /// Returns the resistance of a face with springs `normal` and `shear` to small motions of the block, divided by
    /// its masses. The face resists rocking if the normal load is distributed over it (`spread`), as for dashpots;
    /// springs act at one point (dem::polyhedron::force).
    fn resistance(&self, face: usize, [normal, shear]: [f64; 2], spread: bool) -> Matrix6<f64> {
        let inertia = self.shape.inertia(self.mass / self.shape.volume());
        let n = self.shape.half_spaces()[face].normal;
        let points = self.points(face);
        let weight = 1.0 / points.iter().map(|(_, w)| w).sum::<f64>();
        let centre = points.iter().map(|(p, w)| p * (w * weight)).sum();
        let mut total = Matrix6::zeros();
        for (point, share) in points {
            for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
                // Spring along the normal and springs in the face: k_s I + (k_n - k_s) n nᵀ.
                let row = |point: &Vector3<f64>, d: Vector3<f64>| {
                    let turn = point.cross(&d).component_div(&inertia.map(f64::sqrt));
                    let shift = d / self.mass.sqrt();
                    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
                };
                let across = row(&point, axis - n * n.dot(&axis));
                let along = row(if spread { &point } else { &centre }, n * n.dot(&axis));
                let share = share * weight;
                total += across * across.transpose() * (share * shear);
                total += along * along.transpose() * (share * normal);
            }
        }
        total
    }

    /// Returns points of a face with weights that integrate quadratic functions exactly: the edge midpoints of its
    /// triangles. A single point suffices if springs do not grow with the area.
    fn points(&self, face: usize) -> Vec<(Vector3<f64>, f64)> {
        let corners: Vec<Vector3<f64>> = self
            .shape
            .face(face)
            .iter()
            .map(|&v| self.shape.vertices()[v as usize])
            .collect();
        let Some(&first) = corners.first() else {
            return Vec::new();
        };
        let mut points = Vec::new();
        for pair in corners.windows(2).skip(1) {
            let [a, b] = [pair[0], pair[1]];
            let area = (a - first).cross(&(b - first)).norm() / 3.0;
            for middle in [first + a, a + b, b + first] {
                points.push((middle * 0.5, area));
            }
        }
        if self.per_area {
            return points;
        }
        let total: f64 = points.iter().map(|(_, w)| w).sum();
        let centre: Vector3<f64> = points.iter().map(|(p, w)| *p * (*w / total)).sum();
        vec![(centre, 1.0)]
    }
}

/// Damping ratio at which dashpots dissipate 1 - exp(-2 pi ratio) = 27 % of the energy of an impact, more than the
/// 17 % that a contact at a point was observed to add.
const STRONG_DAMPING: f64 = 0.05;

/// Reports contacts of undamped free blocks that have no potential energy.
///
/// In a closed box, without friction and dashpots, a thousand impacts of 12 blocks of several shapes change the kinetic
/// energy by less than a relative 1e-6 with pressures per area. With patches it changes by up to 8, 5 and 4 % at 1e8,
/// 1e9 and 1e10 Pa/m, with a stiffness per contact by half. With points 200 impacts multiply it
/// (`dem::polyhedron::tests::energy`).
pub(super) fn energy(scene: &Scene, law: &BlockLaw, findings: &mut Findings) {
    let bare = |pair: &&BlockPairLaw| pair.normal_damping_ratio < STRONG_DAMPING;
    let Some(pair) = law.parameters.rows().find(bare) else {
        return;
    };
    if law.mass_damping > 0.0 || scene.polyhedra().all(|one| !one.free) {
        return;
    }
    let remedy = || {
        Remedy::from(
            "use `pressure` with a stiffness per area, or a normal damping ratio of 0.05 or more",
        )
        .set("contact.blocks.model", "pressure")
    };
    match (law.model, pair.stiffness) {
        (BlockContactModel::Point { .. }, _) => findings.unstable(
            "contact.blocks.model",
            "the model `point` does not conserve energy: in runs, free blocks without damping gained up to 17 % \
             of their energy in an impact of edges or corners",
            remedy(),
        ),
        (_, Stiffness::PerContact { .. }) => findings.warn(
            "contact.blocks.normal_stiffness",
            "a stiffness per contact does not conserve energy: in runs, free blocks without damping gained 15 % of \
             their energy over 14 impacts, and more than doubled it over 150",
            Remedy::from(
                "use a stiffness `per_area` with the model `pressure`, or a normal damping ratio of 0.05 or more",
            ),
        ),
        (BlockContactModel::Patch, Stiffness::PerArea { .. }) => findings.warn(
            "contact.blocks.model",
            "the model `patch` conserves energy only approximately: in runs, free blocks without damping gained \
             or lost up to 8 % of their energy over a thousand impacts",
            remedy(),
        ),
        (BlockContactModel::Pressure, Stiffness::PerArea { .. }) => {}
    }
}
