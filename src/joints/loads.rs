//! Force and moment of the water of a network on the faces of its blocks.
//!
//! The pressure of a cell acts on its area on both faces, normal to the faces and at the points of the faces. Its
//! work in a small motion of the blocks is the pressure times the change of the cell's volume.
//!
//! Friction of the water acts along both faces, each with half of the pressure that the discharge loses over the area
//! of the cross section ([`add_wide_loads`]). It matters where an aperture is no longer small compared with a block.

use crate::flow::JointFlow;
use crate::network::{End, Network, WIDE_CELLS};
use crate::pairs::{Rock, RockFace};
use nalgebra::Vector3;

/// Load of the water on a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RockLoad {
    /// Force \[N\].
    pub force: Vector3<f64>,
    /// Moment about the centroid of the block \[N m\].
    pub moment: Vector3<f64>,
    /// Area of the faces of the block in joints \[m²\].
    pub area: f64,
    /// Smallest and largest gauge pressure on the block \[Pa\]; infinite without adjacent joints.
    pub pressure: [f64; 2],
}

impl RockLoad {
    /// Adds the force \[N\] at a point whose vector from the centroid is `arm` \[m\].
    pub(crate) fn add(&mut self, force: &Vector3<f64>, arm: &Vector3<f64>) {
        self.force += force;
        self.moment += arm.cross(force);
    }
}

/// Returns the cells of the network at each face of a block, in the order of the cells; faces without a joint are
/// absent.
#[must_use]
pub fn cells_at(network: &Network, rock: usize) -> Vec<(RockFace, Vec<usize>)> {
    let mut faces: Vec<(RockFace, Vec<usize>)> = Vec::new();
    for (number, joint) in network.joints.iter().enumerate() {
        for face in joint.faces.iter().filter(|face| face.rock == rock) {
            let cells = network.firsts[number]..network.firsts[number + 1];
            match faces.iter_mut().find(|(known, _)| known == face) {
                Some((_, list)) => list.extend(cells),
                None => faces.push((*face, cells.collect())),
            }
        }
    }
    faces
}

/// Returns the load of a pressure on the part of a block's surface that no joint covers. `pressure` is a linear
/// function of the position \[m\]; `covered`: see [`cells_at`].
#[must_use]
pub fn outside(
    network: &Network,
    (number, rock): (usize, &Rock),
    covered: &[(RockFace, Vec<usize>)],
    pressure: impl Fn(&Vector3<f64>) -> f64,
) -> RockLoad {
    let mut load = RockLoad {
        pressure: [f64::INFINITY, f64::NEG_INFINITY],
        ..RockLoad::default()
    };
    for (face, plane) in rock.shape.half_spaces().iter().enumerate() {
        let normal = rock.orientation * plane.normal;
        let corner = |&vertex: &u32| rock.orientation * rock.shape.vertices()[vertex as usize];
        let corners: Vec<Vector3<f64>> = rock.shape.face(face).iter().map(corner).collect();
        for ends in corners[1..].windows(2) {
            let triangle = [corners[0], ends[0], ends[1]];
            let area = 0.5 * (ends[0] - corners[0]).cross(&(ends[1] - corners[0])).norm();
            load.area += area;
            // The middles of the edges integrate a product of two linear functions exactly.
            for k in 0..3 {
                let arm = 0.5 * (triangle[k] + triangle[(k + 1) % 3]);
                let force = -normal * (pressure(&(rock.position + arm)) * area / 3.0);
                load.add(&force, &arm);
            }
        }
        let name = RockFace { rock: number, face };
        let cells = covered.iter().filter(|(known, _)| *known == name);
        for &cell in cells.flat_map(|(_, cells)| cells) {
            let joint = &network.joints[network.joint_of[cell]];
            let side = usize::from(joint.faces[0] != name);
            let cell = &network.cells[cell];
            let arm = joint.point(&cell.centroid) - rock.position;
            // On the face itself: the plane of a wide joint is half an aperture away.
            let arm = arm + normal * (plane.offset - normal.dot(&arm));
            let force = joint.tilts[side] * (pressure(&(rock.position + arm)) * cell.area);
            load.area -= cell.area * joint.tilts[side].norm();
            load.add(&force, &arm);
        }
    }
    load
}

/// Returns the loads on the blocks with these centroids \[m\], in the order of the blocks, at the pressures of the
/// nodes \[Pa\].
#[must_use]
pub fn loads(network: &Network, pressure: &[f64], centroids: &[Vector3<f64>]) -> Vec<RockLoad> {
    let none = RockLoad {
        pressure: [f64::INFINITY, f64::NEG_INFINITY],
        ..RockLoad::default()
    };
    let mut loads = vec![none; centroids.len()];
    let cells = network.cells.iter().zip(&network.joint_of);
    for ((cell, &joint), &pressure) in cells.zip(pressure) {
        let joint = &network.joints[joint];
        let points = [0, 1].map(|face| joint.face_point(face, &cell.centroid));
        for ((face, tilt), centre) in joint.faces.iter().zip(&joint.tilts).zip(points) {
            let load = &mut loads[face.rock];
            let force = -tilt * (pressure * cell.area);
            load.add(&force, &(centre - centroids[face.rock]));
            load.area += cell.area * tilt.norm();
            load.pressure = [
                load.pressure[0].min(pressure),
                load.pressure[1].max(pressure),
            ];
        }
    }
    loads
}

/// Adds loads in joints that are wider than those with one cell of a lattice at their mouths; of a single joint if
/// `only` is given. `centroids` are those of the blocks \[m\].
///
/// - The friction of the present discharges on both faces.
/// - At mouths, where `front` returns the pressure \[Pa\] outside an open piece, less load on both faces: the lattice
///   loads a strip of a sixth of a cell there. Of the populations that carry the pressure on a face along the lattice,
///   a sixth moves aside by a cell, into the face of the joint from the first cell outside.
pub fn add_wide_loads(
    flow: &JointFlow,
    only: Option<usize>,
    front: impl Fn(usize) -> Option<f64>,
    centroids: &[Vector3<f64>],
    loads: &mut [RockLoad],
) {
    let network = flow.network();
    let Some(under) = network.settings.under else {
        return;
    };
    if flow.gaps().iter().all(|gap| gap.constant <= under.wide) {
        return;
    }
    let strip = under.wide / (6.0 * WIDE_CELLS);
    for (number, link) in network.links.iter().enumerate() {
        if only.is_some_and(|joint| joint != link.joint) {
            continue;
        }
        let (joint, gap) = (&network.joints[link.joint], &flow.gaps()[link.joint]);
        if gap.constant <= under.wide {
            continue;
        }
        let [from, to] = link.path;
        let middle = 0.5 * (from + to);
        let aperture = gap.value(&middle).max(network.settings.residual_aperture);
        let along = joint.direction(&(to - from)) / link.length;
        let force = along * (0.5 * flow.friction(number) * aperture * link.width);
        for (side, face) in joint.faces.iter().enumerate() {
            let point = joint.face_point(side, &middle);
            loads[face.rock].add(&force, &(point - centroids[face.rock]));
        }
        let End::Open(piece) = link.to else { continue };
        let Some(pressure) = front(piece) else {
            continue;
        };
        for (side, (face, tilt)) in joint.faces.iter().zip(&joint.tilts).enumerate() {
            let point = joint.face_point(side, &to);
            let force = tilt * (pressure * strip * link.width);
            loads[face.rock].add(&force, &(point - centroids[face.rock]));
        }
    }
}
