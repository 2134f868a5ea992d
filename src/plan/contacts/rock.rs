//! The contacts of blocks as they stand at the start, and the largest eigenvalue of what they hold together.
//!
//! What a contact does is that of [`crate::dem::polyhedron::force`]: springs along and across the normal at one point, a spring against twisting
//! k_s J/A, and dashpots like them that are spread over the patch, so that they resist rocking as well.

use super::limit;
use crate::dem::polyhedron::{Geometry, Memory, Model, Narrow, Placed, Solid};
use crate::scene::Scene;
use crate::scene::contact::{ContactTable, Law, PairParameters};
use nalgebra::{Matrix3, Vector3};

/// A block; what does not move by forces has inverse roots of zero.
struct Node<'a> {
    solid: &'a Solid,
    material: usize,
    rotation: Matrix3<f64>,
    mass: f64,
    /// Roots of M⁻¹ and of I⁻¹ in space.
    roots: (f64, Matrix3<f64>),
}

/// A contact of two blocks, or of one with a wall.
struct Spring {
    nodes: [Option<usize>; 2],
    /// From the centres to the contact (m).
    arms: [Vector3<f64>; 2],
    normal: Vector3<f64>,
    /// k_n, k_s, and k_s J/A.
    springs: [f64; 3],
    /// c_n, c_s, and c_s J/A.
    dashpots: [f64; 3],
    /// c_n Q/A of the dashpots against rocking.
    rocking: Matrix3<f64>,
}

/// Translation and rotation of a block, in coordinates scaled by the roots of the masses.
type Motion = [Vector3<f64>; 2];

/// All contacts of the start.
pub(super) struct Network<'a> {
    nodes: Vec<Node<'a>>,
    springs: Vec<Spring>,
}

/// Most rounds of the power iteration.
const ROUNDS: usize = 400;
/// More blocks than this are not looked at pair by pair.
const MOST: usize = 4000;

impl<'a> Network<'a> {
    /// The contacts of all blocks with each other and with plane walls; none of very many blocks.
    pub(super) fn of(scene: &'a Scene, contact: &ContactTable) -> Self {
        let mut network = Self {
            nodes: scene
                .polyhedra()
                .filter(|(_, material, _)| *material < contact.materials)
                .map(|(solid, material, free)| node(scene, solid, material, free))
                .collect(),
            springs: Vec::new(),
        };
        if network.nodes.len() > MOST || scene.grid.periodic.contains(&true) {
            network.nodes.clear();
        }
        let per_area = matches!(contact.law, Law::Blocks { per_area: true, .. });
        let mut narrow = Narrow::default();
        let nodes = &network.nodes;
        for (i, first) in nodes.iter().enumerate() {
            for (j, second) in nodes.iter().enumerate().skip(i + 1) {
                let mass = effective(first, second);
                if mass <= 0.0 {
                    continue;
                }
                let between = second.solid.position - first.solid.position;
                let [one, two] = [first, second].map(placed);
                let memory = &mut Memory::default();
                if let Some(touch) = narrow.blocks(&one, &two, &between, &Model::Patch, memory) {
                    let pair = contact.pair(first.material, second.material);
                    let arms = [touch.arm, touch.arm - between];
                    network.springs.push(spring(
                        [Some(i), Some(j)],
                        arms,
                        &touch,
                        pair,
                        per_area,
                        mass,
                    ));
                }
            }
            if first.roots.0 <= 0.0 {
                continue;
            }
            for wall in scene
                .walls
                .iter()
                .filter(|w| !w.temporary && w.surface.is_none())
            {
                let normal = Vector3::from(wall.normal);
                let height = normal.dot(&(first.solid.position - Vector3::from(wall.point)));
                let memory = &mut Memory::default();
                let found = narrow.plane(&placed(first), &normal, height, &Model::Patch, memory);
                if let Some(touch) = found {
                    let pair = contact.pair(first.material, wall.material);
                    let arms = [touch.arm, Vector3::zeros()];
                    network.springs.push(spring(
                        [Some(i), None],
                        arms,
                        &touch,
                        pair,
                        per_area,
                        first.mass,
                    ));
                }
            }
        }
        network
    }

    /// Whether every block that moves by forces touches something.
    pub(super) fn holds_all(&self) -> bool {
        let mut free: Vec<bool> = self.nodes.iter().map(|n| n.roots.0 > 0.0).collect();
        let any = free.contains(&true);
        for node in self.springs.iter().flat_map(|s| s.nodes).flatten() {
            free[node] = false;
        }
        any && !free.contains(&true)
    }

    /// The longest stable step (s), from above; infinite without contacts.
    pub(super) fn limit(&self) -> f64 {
        if self.springs.is_empty() {
            return f64::INFINITY;
        }
        let mut dt = 0.0;
        let mut found = f64::INFINITY;
        for _ in 0..4 {
            let vector = self.highest(dt);
            let stiffness: f64 = self.energies(&vector, [1.0, 0.0]).sum();
            let dashpots: f64 = self.energies(&vector, [0.0, 1.0]).sum();
            let next = limit(stiffness, dashpots);
            found = found.min(next);
            if (next - dt).abs() <= 1e-3 * next {
                break;
            }
            dt = next;
        }
        found
    }

    /// Twice the energy of each contact with its springs and dashpots weighed.
    fn energies<'b>(
        &'b self,
        vector: &'b [Motion],
        weights: [f64; 2],
    ) -> impl Iterator<Item = f64> + 'b {
        self.springs.iter().map(move |spring| {
            let (apart, turned) = self.stretch(spring, vector);
            let (force, moment) = spring.answer(&apart, &turned, weights);
            apart.dot(&force) + turned.dot(&moment)
        })
    }

    /// The eigenvector of `dt² K + 2 dt C` with the largest eigenvalue, of length 1; of K where `dt` is zero.
    fn highest(&self, dt: f64) -> Vec<Motion> {
        let weights = if dt > 0.0 {
            [dt * dt, 2.0 * dt]
        } else {
            [1.0, 0.0]
        };
        let mut vector = start(self.nodes.len());
        let mut image = vec![Motion::default(); self.nodes.len()];
        let mut before = 0.0;
        for round in 1..=ROUNDS {
            image.fill(Motion::default());
            for spring in &self.springs {
                let (apart, turned) = self.stretch(spring, &vector);
                let (force, moment) = spring.answer(&apart, &turned, weights);
                for (end, arm, sign) in [(0, spring.arms[0], -1.0), (1, spring.arms[1], 1.0)] {
                    let Some(k) = spring.nodes[end] else { continue };
                    let (mass, inertia) = &self.nodes[k].roots;
                    image[k][0] += force * (sign * mass);
                    image[k][1] += inertia * (arm.cross(&force) + moment) * sign;
                }
            }
            let squares = |m: &Motion| m[0].norm_squared() + m[1].norm_squared();
            let length = image.iter().map(squares).sum::<f64>().sqrt();
            if length <= 0.0 {
                break;
            }
            for (to, from) in vector.iter_mut().zip(&image) {
                *to = from.map(|v| v / length);
            }
            if round % 50 == 0 {
                if length - before <= 1e-5 * length {
                    break;
                }
                before = length;
            }
        }
        vector
    }

    /// How the second's side of a contact moves and turns against the first's.
    fn stretch(&self, spring: &Spring, vector: &[Motion]) -> Motion {
        let mut relative = Motion::default();
        for (end, sign) in [(0, -1.0), (1, 1.0)] {
            let Some(k) = spring.nodes[end] else { continue };
            let (mass, inertia) = &self.nodes[k].roots;
            let turn = inertia * vector[k][1];
            let shift = vector[k][0] * *mass + turn.cross(&spring.arms[end]);
            relative[0] += shift * sign;
            relative[1] += turn * sign;
        }
        relative
    }
}

impl Spring {
    /// Force and moment against a shift and a turn, by springs and dashpots with these weights.
    fn answer(
        &self,
        shift: &Vector3<f64>,
        turn: &Vector3<f64>,
        [springs, dashpots]: [f64; 2],
    ) -> Motion {
        let of = |n: usize| springs * self.springs[n] + dashpots * self.dashpots[n];
        let n = self.normal;
        let along = n * n.dot(shift);
        let about = n * n.dot(turn);
        let rocking = self.rocking * (turn - about) * dashpots;
        [
            along * of(0) + (shift - along) * of(1),
            about * of(2) + (rocking - n * n.dot(&rocking)),
        ]
    }
}

fn node<'a>(scene: &Scene, solid: &'a Solid, material: usize, free: bool) -> Node<'a> {
    let density = scene.density(material);
    let mass = density * solid.shape.volume();
    let rotation = solid.orientation.to_rotation_matrix().into_inner();
    let roots = if free && mass > 0.0 {
        let inverse = solid.shape.inertia(density).map(|i| 1.0 / i.sqrt());
        let inertia = rotation * Matrix3::from_diagonal(&inverse) * rotation.transpose();
        (1.0 / mass.sqrt(), inertia)
    } else {
        (0.0, Matrix3::zeros())
    };
    Node {
        solid,
        material,
        rotation,
        mass,
        roots,
    }
}

fn placed<'a>(node: &Node<'a>) -> Placed<'a> {
    Placed {
        shape: &node.solid.shape,
        rotation: node.rotation,
    }
}

/// Effective mass (kg): a block's own against what does not move, zero for two such.
fn effective(first: &Node<'_>, second: &Node<'_>) -> f64 {
    match [first, second].map(|n| n.roots.0 > 0.0) {
        [true, true] => first.mass * second.mass / (first.mass + second.mass),
        [true, false] => first.mass,
        [false, true] => second.mass,
        [false, false] => 0.0,
    }
}

fn spring(
    nodes: [Option<usize>; 2],
    arms: [Vector3<f64>; 2],
    touch: &Geometry,
    pair: &PairParameters,
    per_area: bool,
    mass: f64,
) -> Spring {
    let area = if per_area { touch.area } else { 1.0 };
    let normal = pair.normal_stiffness.number() * area;
    let sticks = pair.friction_coefficient > 0.0;
    let shear = if sticks {
        normal * pair.shear_to_normal_stiffness
    } else {
        0.0
    };
    let dashpot = |ratio: f64, stiffness: f64| 2.0 * ratio * (mass * stiffness).sqrt();
    let across = dashpot(pair.normal_damping_ratio, normal);
    let along = dashpot(pair.shear_damping_ratio, shear);
    let (spread, rocking) = if touch.area > 0.0 {
        let about_axes = Matrix3::identity() * touch.polar() - touch.second;
        (
            touch.polar() / touch.area,
            about_axes * (across / touch.area),
        )
    } else {
        (0.0, Matrix3::zeros())
    };
    Spring {
        nodes,
        arms,
        normal: touch.normal,
        springs: [normal, shear, shear * spread],
        dashpots: [across, along, along * spread],
        rocking,
    }
}

/// Numbers without a pattern: multiples of the golden mean without their whole parts.
fn start(nodes: usize) -> Vec<Motion> {
    let mut value = 0.5;
    let mut next = || {
        value = (value + 0.618_033_988_749_894_9) % 1.0;
        value - 0.5
    };
    (0..nodes)
        .map(|_| [(); 2].map(|()| Vector3::from_fn(|_, _| next())))
        .collect()
}
