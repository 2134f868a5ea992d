//! Open cross-sections of a domain with solids: their resistance to flow along an axis, before the run.
//!
//! The domain is cut into slices across the axis. In 2-D the open runs of width g in a slice conduct in parallel
//! like the flow between plates; in 3-D a slice conducts like a pipe of its area A and hydraulic diameter D = 4
//! A/P:
//!
//! ```text
//! loss of pressure     ∫ 12 ρ ν q/Σ g³ dx      ∫ 32 ρ ν Q/(A D²) dx
//! behind the narrowest                0.75 ρ (q/Σ g)² (1 - Σ g/H)²      the same with A
//! ```
//!
//! Every slice is treated by itself, so that cross flow between a wide and a narrow slice is neglected: the loss of
//! water that winds around walls is larger. Solids are sampled at points ([`ALONG`], [`ACROSS`]); openings narrower
//! than a sample are missed.

use crate::scene::Scene;
use crate::scene::flow::Flow;
use base::number::real;
use dem::polyhedron::HalfSpace;
use nalgebra::Vector3;

/// Number of slices along the axis in 2-D and 3-D.
const ALONG: [usize; 2] = [240, 64];
const ACROSS: [usize; 2] = [240, 40];
/// Maximum number of pairs of a sample and a solid.
const MAX_PAIRS: usize = 30_000_000;

/// Resistance of the sections along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sections {
    /// Pressure loss divided by ρ ν and the discharge: ∫ 12/Σ g³ dx \[1/m\], or ∫ 32/(A D²) dx [1/m³].
    pub(crate) friction: f64,
    /// The smallest open section: width \[m\] in 2-D, area \[m2\] in 3-D.
    pub(crate) smallest: f64,
    /// Width or area of the smallest open section, divided by that of the whole section.
    pub(crate) open: f64,
}

enum Form {
    Ball(f64),
    Hull(Vec<HalfSpace>),
}

struct Body {
    at: Vector3<f64>,
    form: Form,
}

/// Boundary at an end of a line across the axis.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum End {
    /// Wall with friction.
    Wall,
    /// Surface without friction.
    Slip,
    /// Periodic image of the other end of the line.
    Periodic,
}

/// Returns the sections along an axis; none without solids, with too many solids, or if a slice is closed.
pub(crate) fn along(
    scene: &Scene,
    flow: &Flow,
    axis: usize,
    ends: impl Fn(usize) -> [End; 2],
) -> Option<Sections> {
    let grid = &scene.grid;
    let bodies = bodies(scene);
    let structures: Vec<_> = scene
        .structures
        .iter()
        .filter(|s| s.stops.water())
        .collect();
    let solids = bodies.len() + structures.len();
    if solids == 0 || flow.density <= 0.0 {
        return None;
    }
    let across: Vec<usize> = (0..grid.dimension).filter(|a| *a != axis).collect();
    let n = grid.dimension - 2;
    let mut count = [1; 3];
    count[axis] = ALONG[n];
    for a in &across {
        count[*a] = ACROSS[n];
    }
    if count.iter().product::<usize>().saturating_mul(solids) > MAX_PAIRS {
        return None;
    }
    let step: [f64; 3] = std::array::from_fn(|a| grid.size[a] / real(count[a]));
    let solid = |cell: [usize; 3]| {
        let mut at = [0.0; 3];
        for a in 0..grid.dimension {
            at[a] = (real(cell[a]) + 0.5) * step[a];
        }
        bodies.iter().any(|body| holds(body, at, scene))
            || structures.iter().any(|s| s.solid.distance(at) < 0.0)
    };
    let bounds: Vec<[End; 2]> = across.iter().map(|a| ends(*a)).collect();
    let mut found = Sections {
        friction: 0.0,
        smallest: f64::INFINITY,
        open: 1.0,
    };
    let whole: f64 = across.iter().map(|a| grid.size[*a]).product();
    for slice in 0..count[axis] {
        let (conductance, area) = if grid.dimension == 2 {
            let line: Vec<bool> = (0..count[across[0]])
                .map(|k| {
                    let mut cell = [0; 3];
                    (cell[axis], cell[across[0]]) = (slice, k);
                    solid(cell)
                })
                .collect();
            runs(&line, step[across[0]], bounds[0])
        } else {
            let [a, b] = [across[0], across[1]];
            let mut plane = vec![false; count[a] * count[b]];
            for (k, cell_is_solid) in plane.iter_mut().enumerate() {
                let mut cell = [0; 3];
                cell[axis] = slice;
                (cell[a], cell[b]) = (k % count[a], k / count[a]);
                *cell_is_solid = solid(cell);
            }
            pipe(
                &plane,
                [count[a], count[b]],
                [step[a], step[b]],
                [bounds[0], bounds[1]],
            )
        };
        if area <= 0.0 {
            return None;
        }
        found.friction += step[axis] / conductance;
        if area < found.smallest {
            found.smallest = area;
            found.open = area / whole;
        }
    }
    Some(found)
}

/// Returns Σ g³/12 and Σ g of the open runs of a line.
fn runs(line: &[bool], step: f64, [first, last]: [End; 2]) -> (f64, f64) {
    let (mut conductance, mut area) = (0.0, 0.0);
    // A periodic line is read from behind a solid on, so that no run crosses its end.
    let start = if first == End::Periodic {
        line.iter().position(|solid| *solid).unwrap_or(0)
    } else {
        0
    };
    let count = line.len();
    let mut run = 0_usize;
    let mut slips = 0_usize;
    for k in 0..=count {
        let solid = k == count || line[(start + k) % count];
        if k == 0 && !solid && first == End::Slip {
            slips += 1;
        }
        if !solid {
            run += 1;
            continue;
        }
        if run > 0 {
            if k == count && last == End::Slip {
                slips += 1;
            }
            // A narrow run is as wide as its samples, plus or minus one.
            let width = real(run) * step;
            // A plane of symmetry represents the other half; between two planes of symmetry there is no friction.
            let factor = [1.0, 4.0, 1e6][slips.min(2)];
            conductance += factor * width.powi(3) / 12.0;
            area += width;
        }
        run = 0;
        slips = 0;
    }
    (conductance, area)
}

/// Returns A D²/32 and A of an open plane.
fn pipe(plane: &[bool], count: [usize; 2], step: [f64; 2], ends: [[End; 2]; 2]) -> (f64, f64) {
    let (mut open, mut edge) = (0_usize, 0.0);
    for (k, solid) in plane.iter().enumerate() {
        if *solid {
            continue;
        }
        open += 1;
        let at = [k % count[0], k / count[0]];
        for side in 0..2 {
            for upper in [false, true] {
                let outside = if upper {
                    at[side] + 1 == count[side]
                } else {
                    at[side] == 0
                };
                let wall = if outside && ends[side][0] != End::Periodic {
                    ends[side][usize::from(upper)] == End::Wall
                } else {
                    let mut beside = at;
                    beside[side] =
                        (at[side] + if upper { 1 } else { count[side] - 1 }) % count[side];
                    plane[beside[0] + count[0] * beside[1]]
                };
                if wall {
                    edge += step[1 - side];
                }
            }
        }
    }
    let area = real(open) * step[0] * step[1];
    let diameter = 4.0 * area / f64::max(edge, 1e-6 * area.sqrt());
    (area * diameter * diameter / 32.0, area)
}

fn bodies(scene: &Scene) -> Vec<Body> {
    let named = scene.bodies.iter().map(|body| Body {
        at: body.position.into(),
        form: match &body.solid {
            None => Form::Ball(body.radius),
            Some(solid) => Form::Hull(solid.half_spaces()),
        },
    });
    let blocks = scene.blocks.iter().flat_map(|blocks| &blocks.list);
    let blocks = blocks.map(|block| Body {
        at: block.solid.position,
        form: Form::Hull(block.solid.half_spaces()),
    });
    named.chain(blocks).collect()
}

/// Returns `true` if a body, or a periodic image of it, contains a point.
fn holds(body: &Body, at: [f64; 3], scene: &Scene) -> bool {
    let grid = &scene.grid;
    let mut at = Vector3::from(at);
    for a in (0..grid.dimension).filter(|a| grid.periodic[*a]) {
        let apart = at[a] - body.at[a];
        at[a] -= (apart / grid.size[a]).round() * grid.size[a];
    }
    match &body.form {
        Form::Ball(radius) => {
            let apart = at - body.at;
            let apart = if grid.dimension == 2 {
                apart.xy().norm()
            } else {
                apart.norm()
            };
            apart < *radius
        }
        Form::Hull(planes) => planes.iter().all(|plane| plane.height(&at) < 0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_runs_pass_what_plates_pass() {
        let line = |text: &str| text.chars().map(|c| c == '#').collect::<Vec<bool>>();
        let walls = [End::Wall; 2];
        let (conductance, area) = runs(&line("..##...."), 0.5, walls);
        assert!((conductance - (1.0 + 8.0) / 12.0).abs() < 1e-12 && (area - 3.0).abs() < 1e-12);
        // On a periodic line the two ends form one run.
        let (conductance, _) = runs(&line("..##...."), 0.5, [End::Periodic; 2]);
        assert!((conductance - 27.0 / 12.0).abs() < 1e-12);
        // Next to a plane of symmetry the run is half of a run twice as wide.
        let (conductance, _) = runs(&line("..##...."), 0.5, [End::Slip, End::Wall]);
        assert!((conductance - (4.0 + 8.0) / 12.0).abs() < 1e-12);
        let (conductance, _) = runs(&line("...."), 0.5, [End::Wall, End::Slip]);
        assert!((conductance - 4.0 * 8.0 / 12.0).abs() < 1e-12);
    }

    /// Checks a square duct of width 1: D = 1, A D²/32; the exact conductance is 1/28.45.
    #[test]
    fn an_open_plane_passes_what_a_pipe_passes() {
        let (conductance, area) = pipe(&[false; 100], [10, 10], [0.1, 0.1], [[End::Wall; 2]; 2]);
        assert!((area - 1.0).abs() < 1e-12 && (conductance * 32.0 - 1.0).abs() < 1e-12);
        let (plates, _) = pipe(
            &[false; 100],
            [10, 10],
            [0.1, 0.1],
            [[End::Periodic; 2], [End::Wall; 2]],
        );
        assert!((plates * 32.0 - 4.0).abs() < 1e-12);
    }
}
