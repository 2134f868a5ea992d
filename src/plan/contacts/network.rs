//! The initial contacts of spheres and discs, and the largest eigenvalue of their network.

use super::{bonds, limit, mass_over_inertia};
use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::grains::GrainSource;
use crate::scene::grid::Grid;
use crate::scene::pairs::{self, Ball};
use base::number::to_u32;
use base::vector::{cross, dot, minus, norm, plus, times};
use dem::contact::{ContactModel, Depth, Springs, StaticContact};
use std::ops::ControlFlow;

/// Grain or body; one that does not move under forces has zero inverse masses.
#[derive(Clone, Copy, Debug)]
struct Node {
    position: [f64; 3],
    radius: f64,
    material: u32,
    /// Square roots of 1/m and 1/I.
    roots: [f64; 2],
    mass: f64,
}

/// Contact between two nodes, or between a node and a wall.
#[derive(Clone, Copy, Debug)]
struct Spring {
    first: usize,
    second: Option<usize>,
    /// Unit normal pointing away from the first node.
    normal: [f64; 3],
    /// Distances of the contact point from both centres \[m\].
    arms: [f64; 2],
    constants: Springs,
}

/// Network of all initial contacts.
#[derive(Debug)]
pub(super) struct Network {
    nodes: Vec<Node>,
    springs: Vec<Spring>,
    bonded: bool,
}

/// Translation and rotation of a node, in coordinates scaled by the square roots of the masses.
type Motion = [[f64; 3]; 2];

/// Maximum number of nodes in the eigenvalue problem, and the number of them that are chosen by their own bounds
/// alone.
const LARGEST: usize = 20_000;
const SEEDS: usize = 64;

/// Maximum mean number of contacts per node.
const MAX_PARTNERS: usize = 100;

/// Maximum number of power iterations.
const ROUNDS: usize = 400;

impl Network {
    /// Returns the contacts of bodies, and of grains if `listed`.
    pub(super) fn for_scene(
        scene: &Scene,
        law: &dyn ContactModel,
        listed: bool,
        depth: Depth,
    ) -> Self {
        let mut network = Self {
            nodes: nodes(scene, listed),
            springs: Vec::new(),
            bonded: bonds(scene, law),
        };
        let bonded = network.bonded;
        let reach = if bonded { law.bonding_gap() } else { 0.0 };
        let maker = ContactBuilder {
            law,
            bonded,
            reach,
            depth,
        };
        network.touch_each_other(&scene.grid, &maker);
        network.touch_walls(scene, &maker);
        network
    }

    /// Returns the part of the network around the nodes with the largest bounds, if there are more nodes than
    /// [`LARGEST`]. Removing springs lowers every eigenvalue, so that the limit of a part is an upper bound for the
    /// whole; in a uniform packing the difference decreases with the inverse square of the width of the part.
    pub(super) fn stiffest_part(self) -> Self {
        if self.nodes.len() <= LARGEST {
            return self;
        }
        let mut bounds = vec![0.0; self.nodes.len()];
        for spring in &self.springs {
            let bound: f64 = spring.constants.stiffness.iter().sum();
            for (end, k) in spring.ends().enumerate() {
                let [mass, inertia] = self.nodes[k].roots;
                bounds[k] += bound * (mass * mass + (inertia * spring.arms[end]).powi(2));
            }
        }
        let mut partners: Vec<Vec<usize>> = vec![Vec::new(); self.nodes.len()];
        for spring in &self.springs {
            if let Some(second) = spring.second {
                partners[spring.first].push(second);
                partners[second].push(spring.first);
            }
        }
        let mut order: Vec<usize> = (0..self.nodes.len()).collect();
        order.sort_unstable_by(|&a, &b| bounds[b].total_cmp(&bounds[a]).then(a.cmp(&b)));
        // Add nodes layer by layer around the stiffest ones.
        const UNKNOWN: usize = usize::MAX;
        let mut place = vec![UNKNOWN; self.nodes.len()];
        let mut chosen = Vec::with_capacity(LARGEST);
        let mut seeds = order.into_iter();
        let mut next = 0;
        while chosen.len() < LARGEST {
            let seed = if chosen.len() < SEEDS || next == chosen.len() {
                seeds.find(|&k| place[k] == UNKNOWN)
            } else {
                None
            };
            if let Some(k) = seed {
                place[k] = chosen.len();
                chosen.push(k);
                continue;
            }
            let Some(&centre) = chosen.get(next) else {
                break;
            };
            next += 1;
            for &k in &partners[centre] {
                if place[k] == UNKNOWN && chosen.len() < LARGEST {
                    place[k] = chosen.len();
                    chosen.push(k);
                }
            }
        }
        let inside = |spring: &&Spring| spring.ends().all(|k| place[k] != UNKNOWN);
        let moved = |spring: &Spring| Spring {
            first: place[spring.first],
            second: spring.second.map(|k| place[k]),
            ..*spring
        };
        Self {
            springs: self.springs.iter().filter(inside).map(moved).collect(),
            nodes: chosen.iter().map(|&k| self.nodes[k]).collect(),
            bonded: self.bonded,
        }
    }

    fn touch_each_other(&mut self, grid: &Grid, maker: &ContactBuilder<'_>) {
        let ball = |node: &Node| Ball {
            at: node.position,
            reach: node.radius + 0.5 * maker.reach,
        };
        let balls: Vec<Ball> = self.nodes.iter().map(ball).collect();
        let period = std::array::from_fn(|a| grid.periodic[a].then_some(grid.size[a]));
        let most = MAX_PARTNERS * self.nodes.len();
        let (nodes, springs) = (&self.nodes, &mut self.springs);
        // Bodies that overlap each other widely have too many contacts to sum; such a case is refused elsewhere.
        let _ = pairs::near(&balls, period, |i, j| {
            springs.extend(maker.between(nodes, [i, j], grid));
            if springs.len() < most {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        });
    }

    fn touch_walls(&mut self, scene: &Scene, maker: &ContactBuilder<'_>) {
        for wall in scene
            .walls
            .iter()
            .filter(|w| !w.temporary && w.surface.is_none())
        {
            for (first, node) in self.nodes.iter().enumerate() {
                let height: f64 = (0..3)
                    .map(|a| (node.position[a] - wall.point[a]) * wall.normal[a])
                    .sum();
                let overlap = node.radius - height;
                if overlap <= -maker.reach || node.roots[0] == 0.0 {
                    continue;
                }
                let touching = StaticContact {
                    materials: [node.material, to_u32(wall.material)],
                    diameter: 2.0 * node.radius,
                    radius: node.radius,
                    mass: node.mass,
                    overlap: Some(overlap),
                    depth: maker.depth,
                    bonded: maker.bonded,
                };
                self.springs.push(Spring {
                    first,
                    second: None,
                    normal: wall.normal.map(|n| -n),
                    arms: [height, 0.0],
                    constants: maker.law.springs(&touching),
                });
            }
        }
    }

    /// Returns `true` if at least nine of ten bodies that move under forces touch another body.
    pub(super) fn holds_all(&self) -> bool {
        let mut free: Vec<bool> = self.nodes.iter().map(|n| n.roots[0] > 0.0).collect();
        let moving = free.iter().filter(|f| **f).count();
        for spring in &self.springs {
            for node in [Some(spring.first), spring.second].into_iter().flatten() {
                free[node] = false;
            }
        }
        let alone = free.iter().filter(|f| **f).count();
        moving > 0 && 10 * alone <= moving
    }

    /// Removes the shear springs and shear dashpots of contacts that are not bonded.
    pub(super) fn let_slip(&mut self) {
        if self.bonded {
            return;
        }
        for spring in &mut self.springs {
            spring.constants.stiffness[1] = 0.0;
            spring.constants.dashpots[1] = 0.0;
        }
    }

    /// Returns the longest stable step \[s\], approached from above; infinite without contacts.
    pub(super) fn limit(&self) -> f64 {
        if self.springs.is_empty() {
            return f64::INFINITY;
        }
        // Without dashpots the eigenvector does not depend on the step; with dashpots it converges in a few
        // iterations.
        let mut dt = 0.0;
        let mut found = f64::INFINITY;
        for _ in 0..4 {
            let vector = self.highest(dt);
            let weigh = |which: fn(&Springs) -> [f64; 2]| {
                self.springs
                    .iter()
                    .map(|s| s.energy(&self.nodes, &vector, which))
                    .sum::<f64>()
            };
            let next = limit(weigh(|c| c.stiffness), weigh(|c| c.dashpots));
            found = found.min(next);
            if (next - dt).abs() <= 1e-3 * next {
                break;
            }
            dt = next;
        }
        found
    }

    /// Returns the unit eigenvector of `dt² K + 2 dt C` with the largest eigenvalue; that of K if `dt` is zero.
    fn highest(&self, dt: f64) -> Vec<Motion> {
        let weights = |c: &Springs| {
            if dt > 0.0 {
                let ([k, l], [c, d]) = (c.stiffness, c.dashpots);
                [dt * dt * k + 2.0 * dt * c, dt * dt * l + 2.0 * dt * d]
            } else {
                c.stiffness
            }
        };
        let mut vector = start(self.nodes.len());
        let mut image = vec![Motion::default(); self.nodes.len()];
        let mut before = 0.0;
        for round in 1..=ROUNDS {
            image.fill(Motion::default());
            for spring in &self.springs {
                spring.apply(&self.nodes, weights(&spring.constants), &vector, &mut image);
            }
            let length = image
                .as_flattened()
                .as_flattened()
                .iter()
                .map(|v| v * v)
                .sum::<f64>()
                .sqrt();
            if length <= 0.0 {
                break;
            }
            for (to, from) in vector
                .as_flattened_mut()
                .as_flattened_mut()
                .iter_mut()
                .zip(image.as_flattened().as_flattened())
            {
                *to = from / length;
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
}

/// Data from which the contacts are computed.
struct ContactBuilder<'a> {
    law: &'a dyn ContactModel,
    bonded: bool,
    /// Maximum gap of a bond \[m\].
    reach: f64,
    depth: Depth,
}

impl ContactBuilder<'_> {
    fn between(&self, nodes: &[Node], [i, j]: [usize; 2], grid: &Grid) -> Option<Spring> {
        let (one, two) = (&nodes[i], &nodes[j]);
        if one.roots[0] == 0.0 && two.roots[0] == 0.0 {
            return None;
        }
        let between: [f64; 3] = std::array::from_fn(|a| {
            let apart = two.position[a] - one.position[a];
            if grid.periodic[a] {
                apart - grid.size[a] * (apart / grid.size[a]).round()
            } else {
                apart
            }
        });
        let distance = norm(between);
        let overlap = one.radius + two.radius - distance;
        if overlap <= -self.reach || distance <= 0.0 {
            return None;
        }
        let inverse = |node: &Node| node.roots[0] * node.roots[0];
        let touching = StaticContact {
            materials: [one.material, two.material],
            diameter: one.radius + two.radius,
            radius: one.radius * two.radius / (one.radius + two.radius),
            mass: 1.0 / (inverse(one) + inverse(two)),
            overlap: Some(overlap),
            depth: self.depth,
            bonded: self.bonded,
        };
        Some(Spring {
            first: i,
            second: Some(j),
            normal: between.map(|x| x / distance),
            arms: [one, two].map(|node| node.radius - 0.5 * overlap),
            constants: self.law.springs(&touching),
        })
    }
}

impl Spring {
    /// Returns the nodes of the contact.
    fn ends(&self) -> impl Iterator<Item = usize> {
        [Some(self.first), self.second].into_iter().flatten()
    }

    /// Returns the relative motion of the second node at the contact with respect to the first: normal and
    /// tangential part.
    fn stretch(&self, nodes: &[Node], vector: &[Motion]) -> (f64, [f64; 3]) {
        let first = unscaled(&nodes[self.first], &vector[self.first]);
        let second = self
            .second
            .map_or(Motion::default(), |k| unscaled(&nodes[k], &vector[k]));
        let turn = plus(
            times(first[1], self.arms[0]),
            times(second[1], self.arms[1]),
        );
        let turned = cross(turn, self.normal);
        let apart = minus(minus(second[0], first[0]), turned);
        let along = dot(apart, self.normal);
        (along, minus(apart, times(self.normal, along)))
    }

    /// Returns twice the energy of these springs for a motion.
    fn energy(&self, nodes: &[Node], vector: &[Motion], which: fn(&Springs) -> [f64; 2]) -> f64 {
        let (along, across) = self.stretch(nodes, vector);
        let [normal, shear] = which(&self.constants);
        normal * along * along + shear * dot(across, across)
    }

    /// Adds the forces of these springs for a motion.
    fn apply(
        &self,
        nodes: &[Node],
        [normal, shear]: [f64; 2],
        vector: &[Motion],
        image: &mut [Motion],
    ) {
        let (along, across) = self.stretch(nodes, vector);
        let force = plus(times(self.normal, normal * along), times(across, shear));
        let moment = cross(self.normal, force);
        for (end, sign, arm) in [
            (Some(self.first), -1.0, self.arms[0]),
            (self.second, 1.0, self.arms[1]),
        ] {
            let Some(k) = end else { continue };
            let [mass, inertia] = nodes[k].roots;
            for a in 0..3 {
                image[k][0][a] += sign * mass * force[a];
                image[k][1][a] -= inertia * arm * moment[a];
            }
        }
    }
}

fn unscaled(node: &Node, motion: &Motion) -> Motion {
    [
        times(motion[0], node.roots[0]),
        times(motion[1], node.roots[1]),
    ]
}

/// Returns start values without a pattern: fractional parts of multiples of the golden ratio.
fn start(nodes: usize) -> Vec<Motion> {
    let mut value = 0.5;
    let mut next = || {
        value = (value + 0.618_033_988_749_894_9) % 1.0;
        value - 0.5
    };
    (0..nodes)
        .map(|_| [0; 2].map(|_| [0; 3].map(|_| next())))
        .collect()
}

fn nodes(scene: &Scene, listed: bool) -> Vec<Node> {
    let flat = scene.grid.dimension == 2;
    let node = |position: [f64; 3], radius: f64, material: usize, free: bool| {
        let mass = scene.mass(material, radius);
        let inverse = if free && mass > 0.0 { 1.0 / mass } else { 0.0 };
        let turning = mass_over_inertia(scene.grid.dimension) / (radius * radius);
        Node {
            position: if flat {
                [position[0], position[1], 0.0]
            } else {
                position
            },
            radius,
            material: to_u32(material),
            roots: [inverse.sqrt(), (inverse * turning).sqrt()],
            mass,
        }
    };
    let bodies = scene
        .bodies
        .iter()
        .filter(|b| b.solid.is_none())
        .map(|body| {
            let free = body.mobility == Mobility::Free;
            node(body.position, body.radius, body.material, free)
        });
    let mut all: Vec<Node> = bodies.collect();
    if let Some(GrainSource::List(list) | GrainSource::File { grains: list, .. }) = scene
        .grains
        .as_ref()
        .map(|grains| &grains.source)
        .filter(|_| listed)
    {
        all.extend(
            list.iter()
                .map(|g| node(g.position, g.radius, g.material, true)),
        );
    }
    all
}
