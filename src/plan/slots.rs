//! Slots between structures that are too narrow for the lattice.
//!
//! Half-way bounce-back places a wall in the middle of a link. The profile across a passage of few cells is then a
//! polygon: with less than about four cells across, discharge and drag of a slot are those of another one. The run
//! is stable, so that no other check finds it.
//!
//! A slot is found on the lattice: open cells between two solid cells of a line along an axis, fewer than
//! [`CELLS`], of which at least one belongs to a structure. It is a passage if both ways along another axis lead
//! from it to wider water or to an opening. The corner between a round structure and a wall narrows to nothing and is
//! none.

use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::flow::Flow;
use base::error::Remedy;
use base::number::real;

/// Least number of cells across a passage.
const CELLS: usize = 4;
/// Maximum number of cells of a lattice that is searched.
const MOST: usize = 1_000_000;

/// Which cells of a lattice are open.
struct Lattice {
    cells: [usize; 3],
    /// Structure of a cell, by index, plus 1; 0 for an open cell.
    solid: Vec<u32>,
    periodic: [bool; 3],
    /// Faces of the domain through which water passes.
    opens: [[bool; 2]; 3],
}

/// Neighbour of a cell.
#[derive(Clone, Copy, PartialEq)]
enum Next {
    Open([usize; 3]),
    /// Solid of a structure, by index.
    Structure(usize),
    Wall,
    Opening,
}

impl Lattice {
    fn new(scene: &Scene, flow: &Flow) -> Self {
        let cells = scene.grid.cells;
        let h = scene.grid.spacing;
        let solids: Vec<_> = scene
            .structures
            .iter()
            .enumerate()
            .filter(|(_, s)| s.stops.water())
            .collect();
        let mut solid = Vec::with_capacity(cells.iter().product());
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let mut at = [x, y, z].map(|n| (real(n) + 0.5) * h);
                    if scene.grid.dimension == 2 {
                        at[2] = 0.0;
                    }
                    let inside = solids.iter().find(|(_, s)| s.solid.distance(at) < 0.0);
                    solid.push(inside.map_or(0, |(n, _)| base::number::to_u32(*n) + 1));
                }
            }
        }
        let mut opens = [[false; 2]; 3];
        for patch in flow
            .patches()
            .filter(|patch| patch.condition.model().passes_water())
        {
            opens[patch.face.axis()][usize::from(patch.face.is_max())] = true;
        }
        Self {
            cells,
            solid,
            periodic: scene.grid.periodic,
            opens,
        }
    }

    fn structure(&self, at: [usize; 3]) -> Option<usize> {
        let [nx, ny, _] = self.cells;
        let owner = self.solid[at[0] + nx * (at[1] + ny * at[2])];
        (owner > 0).then(|| owner as usize - 1)
    }

    /// Returns what lies next to a cell along an axis.
    fn next(&self, mut at: [usize; 3], axis: usize, up: bool) -> Next {
        let last = self.cells[axis] - 1;
        if at[axis] == if up { last } else { 0 } {
            if self.opens[axis][usize::from(up)] {
                return Next::Opening;
            }
            if !self.periodic[axis] {
                return Next::Wall;
            }
            at[axis] = last - at[axis];
        } else if up {
            at[axis] += 1;
        } else {
            at[axis] -= 1;
        }
        self.structure(at).map_or(Next::Open(at), Next::Structure)
    }

    /// Returns the number of open cells across an open cell along an axis, and what ends them; none if they are
    /// [`CELLS`] or more, or end at an opening.
    fn across(&self, at: [usize; 3], axis: usize) -> Option<(usize, [Next; 2])> {
        let mut width = 1;
        let mut ends = [Next::Opening; 2];
        for (up, end) in [false, true].into_iter().zip(&mut ends) {
            let mut cell = at;
            *end = loop {
                match self.next(cell, axis, up) {
                    Next::Open(next) if width + 1 < CELLS => {
                        width += 1;
                        cell = next;
                    }
                    Next::Open(_) | Next::Opening => return None,
                    other => break other,
                }
            };
        }
        Some((width, ends))
    }

    /// Returns `true` if both ways along an axis lead from a cell of a slot to wider water.
    fn passes(&self, at: [usize; 3], across: usize, along: usize) -> bool {
        [false, true].into_iter().all(|up| {
            let mut cell = at;
            for _ in 0..self.cells[along] {
                match self.next(cell, along, up) {
                    Next::Open(next) if self.across(next, across).is_none() => return true,
                    Next::Open(next) => cell = next,
                    Next::Opening => return true,
                    Next::Wall | Next::Structure(_) => return false,
                }
            }
            false
        })
    }
}

/// Narrowest slot of a lattice.
struct Slot {
    width: usize,
    at: [usize; 3],
    axis: usize,
    ends: [Next; 2],
}

/// Returns the narrowest slot next to a structure; none if all passages have [`CELLS`] cells.
fn narrowest(lattice: &Lattice, dimension: usize) -> Option<Slot> {
    let mut found: Option<Slot> = None;
    let [nx, ny, nz] = lattice.cells;
    for n in 0..nx * ny * nz {
        let at = [n % nx, n / nx % ny, n / (nx * ny)];
        if lattice.structure(at).is_some() {
            continue;
        }
        for axis in 0..dimension {
            let Some((width, ends)) = lattice.across(at, axis) else {
                continue;
            };
            let beside = ends.iter().any(|end| matches!(end, Next::Structure(_)));
            let narrower = found.as_ref().is_none_or(|slot| width < slot.width);
            let mut ways = (0..dimension).filter(|along| *along != axis);
            if beside && narrower && ways.any(|along| lattice.passes(at, axis, along)) {
                found = Some(Slot {
                    width,
                    at,
                    axis,
                    ends,
                });
            }
        }
    }
    found
}

/// Warns of the narrowest slot with fewer than [`CELLS`] cells.
pub(super) fn check(scene: &Scene, flow: &Flow, findings: &mut Findings) {
    let grid = &scene.grid;
    let stops = scene
        .structures
        .iter()
        .any(|structure| structure.stops.water());
    if !stops || grid.cells.iter().product::<usize>() > MOST {
        return;
    }
    let Some(slot) = narrowest(&Lattice::new(scene, flow), grid.dimension) else {
        return;
    };
    let name = |end: &Next| match end {
        Next::Structure(n) => format!("structure `{}`", scene.structures[*n].name),
        _ => "a wall of the domain".to_owned(),
    };
    let at: Vec<String> = (0..grid.dimension)
        .map(|a| number((real(slot.at[a]) + 0.5) * grid.spacing))
        .collect();
    let width = real(slot.width) * grid.spacing;
    let finest = width / real(CELLS);
    findings.warn(
        "domain.spacing",
        format!(
            "the passage between {} and {} at [{}] m is {} of {} m wide along {}: half-way bounce-back needs about \
             {CELLS} cells across, below which discharge and drag are those of another width",
            name(&slot.ends[0]),
            name(&slot.ends[1]),
            at.join(", "),
            if slot.width == 1 { "one cell".into() } else { format!("{} cells", slot.width) },
            number(grid.spacing),
            ["x", "y", "z"][slot.axis]
        ),
        Remedy::from(format!(
            "use a spacing of at most {} m, close the passage, or make it wider",
            number(finest)
        )),
    );
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use base::error::Problem;
    use case::Document;
    use serde_json::{Value, json};
    use std::path::Path;

    /// Returns the warning about the narrowest slot of a channel with structures.
    fn slot(structures: &Value) -> Option<Problem> {
        let case = json!({
            "domain": {"size": [0.2, 0.1], "spacing": 0.002},
            "fluid": {"lattice_boltzmann": {
                "density": 1000, "kinematic_viscosity": 1e-4, "relaxation_time": 0.8,
                "boundaries": [
                    {"name": "in", "face": "x_min", "condition": {"velocity": {"profile": {"uniform": [0.01, 0]}}}},
                    {"name": "out", "face": "x_max", "condition": {"pressure": {"value": 0}}}
                ]
            }},
            "structures": structures,
            "time": {"end": 0.5}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        plan.warnings
            .into_iter()
            .find(|p| p.path == "domain.spacing")
    }

    /// Checks slots of one, three and four cells between two boxes, one below a box, and places that are no slots: a
    /// groove without a way through, and the corner between a cylinder and the floor.
    #[test]
    fn a_slot_below_four_cells_is_named_with_its_place() {
        let block = |name: &str, low: f64, high: f64| {
            json!({"name": name,
                "shape": {"box": {"from": [0.08, low], "to": [0.12, high]}}})
        };
        for (cells, text) in [
            (1, Some("is one cell of")),
            (3, Some("is 3 cells of")),
            (4, None),
        ] {
            let above = 0.04 + 0.002 * f64::from(cells);
            let found = slot(&json!([
                block("lower", -1.0, 0.04),
                block("upper", above, 0.07)
            ]));
            assert_eq!(found.is_some(), text.is_some(), "{cells}: {found:?}");
            if let (Some(found), Some(text)) = (found, text) {
                let words = found.to_string();
                assert!(words.contains(text) && words.contains("along y"), "{words}");
                assert!(
                    words.contains("`lower`") && words.contains("`upper`"),
                    "{words}"
                );
            }
        }
        let floor = slot(&json!([block("gate", 0.004, 0.06)]))
            .unwrap()
            .to_string();
        assert!(
            floor.contains("a wall of the domain") && floor.contains("is 2 cells of"),
            "{floor}"
        );
        let groove = json!([block("floor", -1.0, 0.04),
            {"name": "lid", "shape": {"box": {"from": [0.118, 0.0], "to": [0.12, 0.06]}}},
            {"name": "roof", "shape": {"box": {"from": [0.08, 0.044], "to": [0.12, 0.06]}}}]);
        assert_eq!(slot(&groove), None);
        let round =
            json!([{"name": "pipe", "shape": {"disc": {"centre": [0.1, 0.02], "radius": 0.02}}}]);
        assert_eq!(slot(&round), None);
    }
}
