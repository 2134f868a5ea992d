//! Free space for falling grains: outside all structures, and connected with the surface.
//!
//! Grains fall from above, so that none lies in a closed hollow of a structure, such as a pipe in the ground. Cells
//! in which a grain of the smallest size fits at the centre are filled from the top of the region downwards, or
//! from that of the clouds if a closed vessel contains them. A position in a cell that is not reached is not
//! available for a grain. The cells are as wide as the smallest radius, and wider if there would be more than
//! [`MAX_CELLS`]. Two centres that are both at least half a cell away from a structure have no sheet between them,
//! however thin, so that the filling passes through no structure.

use base::number::{floor_i64, real, whole};
use plan::scene::structures::Structure;

/// Maximum number of cells of the filling.
const MAX_CELLS: f64 = 2e6;

/// Free space outside the structures.
#[derive(Clone, Debug, Default)]
pub struct FreeSpace {
    /// Structures that stop grains.
    structures: Vec<Structure>,
    dimension: usize,
    lower: [f64; 3],
    width: f64,
    cells: [usize; 3],
    /// `true` for each cell that the filling reaches; empty without structures.
    reached: Vec<bool>,
    /// Free volume (2-D: area) in the clouds that the filling does not reach.
    pub closed: f64,
}

/// Box in which grains are placed, its periodic axes, the corners of the clouds, and the upward direction.
#[derive(Clone, Copy, Debug)]
pub struct Boundaries<'a> {
    /// Dimension, 2 or 3.
    pub dimension: usize,
    /// Corners of the box \[m\].
    pub region: [[f64; 3]; 2],
    /// `true` for each periodic axis.
    pub periodic: [bool; 3],
    /// Corners of each cloud \[m\].
    pub clouds: &'a [[[f64; 3]; 2]],
    /// Axis against gravity, and `true` if its positive direction is upwards.
    pub up: (usize, bool),
}

impl FreeSpace {
    /// Computes the space for grains of a smallest radius \[m\].
    #[must_use]
    pub fn new(structures: &[Structure], bounds: &Boundaries<'_>, smallest: f64) -> Self {
        let structures: Vec<Structure> = (structures.iter())
            .filter(|structure| structure.stops.grains())
            .cloned()
            .collect();
        let useful = smallest > 0.0 && smallest.is_finite() && !bounds.clouds.is_empty();
        if structures.is_empty() || !useful {
            return Self {
                structures,
                ..Self::default()
            };
        }
        let dimension = bounds.dimension;
        let [lower, upper] = bounds.region;
        let volume: f64 = (0..dimension).map(|a| upper[a] - lower[a]).product();
        let coarsest = (volume / MAX_CELLS).powf(1.0 / real(dimension));
        let width = smallest.max(coarsest);
        let cells = std::array::from_fn(|a| {
            if a < dimension {
                whole(((upper[a] - lower[a]) / width).ceil().max(1.0))
            } else {
                1
            }
        });
        let mut room = Self {
            structures,
            dimension,
            lower,
            width,
            cells,
            reached: Vec::new(),
            closed: 0.0,
        };
        room.fill(bounds, smallest.max(0.5 * width));
        room
    }

    /// Fills the cells whose centres are at least this distance \[m\] from all structures, from the top of the region,
    /// or from the top of the clouds.
    fn fill(&mut self, bounds: &Boundaries<'_>, clearance: f64) {
        let count = self.cells.iter().product();
        let free: Vec<bool> = (0..count)
            .map(|n| self.distance(self.centre(n)) >= clearance)
            .collect();
        let within = |n: usize| {
            let at = self.centre(n);
            let holds = |cloud: &[[f64; 3]; 2]| {
                (0..self.dimension).all(|a| at[a] >= cloud[0][a] && at[a] <= cloud[1][a])
            };
            free[n] && bounds.clouds.iter().any(holds)
        };
        let in_clouds: Vec<usize> = (0..count).filter(|n| within(*n)).collect();
        let (axis, positive) = bounds.up;
        let level = |n: usize| self.cell(n)[axis];
        let highest = |levels: &mut dyn Iterator<Item = usize>| {
            if positive { levels.max() } else { levels.min() }
        };
        let top = if positive { self.cells[axis] - 1 } else { 0 };
        let from_top = (0..count).filter(|&n| free[n] && level(n) == top);
        let mut reached = self.connected_cells(&free, from_top.collect(), bounds.periodic);
        if !in_clouds.iter().any(|n| reached[*n]) {
            // A closed vessel contains the clouds.
            let top = highest(&mut in_clouds.iter().map(|n| level(*n)));
            let from_clouds = in_clouds.iter().copied().filter(|n| Some(level(*n)) == top);
            reached = self.connected_cells(&free, from_clouds.collect(), bounds.periodic);
        }
        let closed = in_clouds.iter().filter(|n| !reached[**n]).count();
        let one: f64 = (0..self.dimension).map(|_| self.width).product();
        self.closed = real(closed) * one;
        self.reached = reached;
    }

    /// Returns the free cells that are connected through faces with the cells `next`.
    fn connected_cells(
        &self,
        free: &[bool],
        mut next: Vec<usize>,
        periodic: [bool; 3],
    ) -> Vec<bool> {
        let mut reached = vec![false; free.len()];
        for &n in &next {
            reached[n] = true;
        }
        while let Some(n) = next.pop() {
            let place = self.cell(n);
            for a in 0..self.dimension {
                let cells = self.cells[a];
                let before = if place[a] > 0 {
                    Some(place[a] - 1)
                } else {
                    periodic[a].then_some(cells - 1)
                };
                let after = if place[a] + 1 < cells {
                    Some(place[a] + 1)
                } else {
                    periodic[a].then_some(0)
                };
                for beside in [before, after].into_iter().flatten() {
                    let mut other = place;
                    other[a] = beside;
                    let m = self.number(other);
                    if free[m] && !reached[m] {
                        reached[m] = true;
                        next.push(m);
                    }
                }
            }
        }
        reached
    }

    /// Returns `true` if a grain of this radius can be placed at this position.
    #[must_use]
    pub fn has_space_for(&self, at: [f64; 3], radius: f64) -> bool {
        self.distance(at) >= radius && self.is_open(at)
    }

    /// Returns `true` if a position, or an adjacent cell, is connected with the surface, because a cell may be
    /// partly free.
    fn is_open(&self, at: [f64; 3]) -> bool {
        if self.reached.is_empty() {
            return true;
        }
        // The cell of the position and the nearer neighbour along each axis: a corner of a cell may be free
        // although its centre is not.
        let corners = 1_usize << self.dimension;
        (0..corners).any(|corner| {
            let mut place = [0; 3];
            for a in 0..self.dimension {
                let x = (at[a] - self.lower[a]) / self.width;
                let own = floor_i64(x);
                let nearer = if x - x.floor() < 0.5 {
                    own - 1
                } else {
                    own + 1
                };
                let chosen = if corner >> a & 1 == 1 { nearer } else { own };
                let last = i64::try_from(self.cells[a]).unwrap_or(i64::MAX) - 1;
                place[a] = usize::try_from(chosen.clamp(0, last)).unwrap_or(0);
            }
            self.reached[self.number(place)]
                && self.has_line_of_sight(at, self.centre(self.number(place)))
        })
    }

    /// Returns `true` if no structure intersects the straight line between two points.
    fn has_line_of_sight(&self, from: [f64; 3], to: [f64; 3]) -> bool {
        let along = std::array::from_fn(|a| to[a] - from[a]);
        let mut chords = Vec::new();
        self.structures.iter().all(|structure| {
            structure.solid.chords(from, along, &mut chords);
            chords.is_empty()
        })
    }

    /// Returns the distance \[m\] from the nearest structure, negative inside.
    #[must_use]
    pub fn distance(&self, at: [f64; 3]) -> f64 {
        let distances = self.structures.iter().map(|s| s.solid.distance(at));
        distances.fold(f64::INFINITY, f64::min)
    }

    fn number(&self, place: [usize; 3]) -> usize {
        place[0] + self.cells[0] * (place[1] + self.cells[1] * place[2])
    }

    fn cell(&self, n: usize) -> [usize; 3] {
        let [x, y, _] = self.cells;
        [n % x, n / x % y, n / (x * y)]
    }

    fn centre(&self, n: usize) -> [f64; 3] {
        let place = self.cell(n);
        std::array::from_fn(|a| {
            if a < self.dimension {
                self.lower[a] + (real(place[a]) + 0.5) * self.width
            } else {
                0.0
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::supervision::Supervision;
    use crate::{Engine, Prepared, prepare};
    use case::Document;
    use dem::space::PlaneSpace;
    use dem::{GrainDomain, Wall};
    use nalgebra::Vector2;
    use plan::Plan;
    use std::path::Path;

    /// Returns a scene of grains that fall over a weir and a culvert with a hollow enclosed by four plates.
    fn scene(initial: &str, plates: usize) -> Plan {
        let plate = |name: &str, from: [f64; 2], to: [f64; 2]| {
            format!(
                r#"{{"name": "{name}", "shape": {{"box": {{"from": {from:?}, "to": {to:?}}}}}}}"#
            )
        };
        let mut structures = vec![
            r#"{"name": "weir", "shape": {"polygon": {"points": [[0.01, -0.001], [0.03, -0.001], [0.025, 0.03],
                [0.015, 0.03]]}}}"#.to_owned(),
            plate("floor", [0.05, 0.01], [0.08, 0.012]),
            plate("left", [0.05, 0.012], [0.052, 0.03]),
            plate("right", [0.078, 0.012], [0.08, 0.03]),
            plate("roof", [0.05, 0.03], [0.08, 0.032]),
        ];
        structures.truncate(plates);
        let structures = structures.join(", ");
        let text = format!(
            r#"{{
                "domain": {{"size": [0.1, 0.08], "spacing": 0.005}},
                "gravity": [0, -9.81],
                "materials": {{"sand": {{"density": 2650}}}},
                "contact": {{"linear": {{"normal_stiffness": {{"absolute": 1e5}}, "normal_damping_ratio": 0.2}}}},
                "grains": {{"initial": {initial}, "material": "sand"}},
                "box_walls": ["x_min", "x_max", "y_min"],
                "structures": [{structures}],
                "time": {{"end": 0.01, "solid_time_step": 1e-5}}
            }}"#
        );
        let document =
            Document::read(&text, &[], Path::new(".")).unwrap_or_else(|p| panic!("{p:#?}"));
        Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"))
    }

    fn made(plan: &Plan) -> Prepared {
        let corner = Vector2::new(0.1, 0.08);
        let mut walls = Wall::of_box(Vector2::zeros(), corner, [true, true, false], 0);
        let surfaces = plan.scene.walls.iter().filter_map(|w| w.surface.clone());
        walls.extend(surfaces.map(|surface| Wall::of_surface(surface, 0)));
        let engine = Engine::<PlaneSpace> {
            region: GrainDomain::closed(Vector2::zeros(), corner, 0.005),
            walls,
        };
        prepare(
            plan,
            Path::new("."),
            &engine,
            &Supervision::without_requests(),
        )
        .unwrap()
    }

    const FALLING: &str = r#"{"deposition": {
        "number": 250, "grading": {"by_count": [{"min": 8e-4, "max": 1.2e-3, "fraction": 1}]},
        "box": {"from": [0, 0], "to": [0.1, 0.08]}, "seed": 1,
        "stop": {"at_most_steps": 20000}
    }}"#;

    const HOLLOW: [[f64; 2]; 2] = [[0.052, 0.012], [0.078, 0.03]];

    fn in_hollow(prepared: &Prepared) -> usize {
        let grains = prepared.grains.iter();
        let inside = |at: [f64; 3]| (0..2).all(|a| at[a] > HOLLOW[0][a] && at[a] < HOLLOW[1][a]);
        grains.filter(|grain| inside(grain.position)).count()
    }

    #[test]
    fn falling_grains_leave_structures_and_closed_hollows_empty() {
        let plan = scene(FALLING, 5);
        let prepared = made(&plan);
        assert_eq!(prepared.grains.len(), 250);
        for grain in &prepared.grains {
            for structure in &plan.scene.structures {
                let distance = structure.solid.distance(grain.position);
                assert!(
                    distance > 0.5 * grain.radius,
                    "{}: {grain:?}",
                    structure.name
                );
            }
        }
        assert_eq!(in_hollow(&prepared), 0);
        // A centre is at least a radius from the plates: (26 - 1.6) mm by (18 - 1.6) mm, except for the cells at
        // the rim.
        assert!(
            prepared.line.contains("closed cavities"),
            "{}",
            prepared.line
        );

        // Without its roof the culvert is a trough, which fills.
        let open = made(&scene(FALLING, 4));
        assert!(in_hollow(&open) > 10, "{}", in_hollow(&open));
        assert!(!open.line.contains("closed cavities"), "{}", open.line);
    }

    #[test]
    fn a_vessel_of_structures_that_contains_the_cloud_is_filled() {
        let plan = scene(FALLING, 5);
        let bounds = |from: [f64; 3], to: [f64; 3]| {
            let region = [[0.0; 3], [0.1, 0.08, 0.0]];
            let clouds = [[from, to]];
            let bounds = Boundaries {
                dimension: 2,
                region,
                periodic: [false; 3],
                clouds: &clouds,
                up: (1, true),
            };
            FreeSpace::new(&plan.scene.structures, &bounds, 1e-3)
        };
        let hollow = bounds([0.052, 0.012, 0.0], [0.078, 0.03, 0.0]);
        assert!(hollow.has_space_for([0.065, 0.02, 0.0], 1e-3));
        assert_eq!(hollow.closed, 0.0);
        let all = bounds([0.0; 3], [0.1, 0.08, 0.0]);
        assert!(!all.has_space_for([0.065, 0.02, 0.0], 1e-3));
        let area = 0.024 * 0.016;
        assert!((all.closed / area - 1.0).abs() < 0.15, "{}", all.closed);
        // Positions next to the weir, in it, and too close to it.
        assert!(all.has_space_for([0.005, 0.01, 0.0], 1e-3));
        assert!(!all.has_space_for([0.02, 0.01, 0.0], 1e-3));
        assert!(!all.has_space_for([0.02, 0.0305, 0.0], 1e-3));
    }

    #[test]
    fn grown_grains_in_structures_are_taken_out_with_a_word() {
        let growing = r#"{"growth": {
            "amount": {"number": 150}, "radii": {"uniform": {"min": 2e-3, "max": 3e-3}}
        }}"#;
        let plan = scene(growing, 1);
        let prepared = made(&plan);
        assert!(prepared.line.contains("were removed"), "{}", prepared.line);
        assert!((50..150).contains(&prepared.grains.len()));
        let weir = &plan.scene.structures[0].solid;
        for grain in &prepared.grains {
            assert!(weir.distance(grain.position) >= 0.95 * grain.radius - 1e-12);
        }
    }
}
