//! Blocks next to other blocks: their surface cells exchange populations with cells of the neighbours.

use crate::scene::Scene;
use base::number::real;

/// Bounding box of a block, its surface area, and `true` if another block is adjacent.
struct Boxed {
    low: [f64; 3],
    high: [f64; 3],
    area: f64,
    joined: bool,
}

/// Returns the fraction of the total block surface that belongs to blocks within a cell of another block, by
/// bounding boxes.
pub(super) fn joint_share(scene: &Scene) -> f64 {
    let reach = scene.grid.spacing;
    let mut boxes: Vec<Boxed> = scene
        .polyhedra()
        .map(|one| {
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for vertex in one.solid.vertices() {
                for a in 0..3 {
                    low[a] = low[a].min(vertex[a]);
                    high[a] = high[a].max(vertex[a] + reach);
                }
            }
            Boxed {
                low,
                high,
                area: one.solid.shape.area(),
                joined: false,
            }
        })
        .collect();
    boxes.sort_by(|a, b| a.low[0].total_cmp(&b.low[0]));
    for one in 0..boxes.len() {
        let (before, after) = boxes.split_at_mut(one + 1);
        let one = &mut before[one];
        for other in after {
            if other.low[0] > one.high[0] {
                break;
            }
            if (1..3).all(|a| other.low[a] <= one.high[a] && one.low[a] <= other.high[a]) {
                one.joined = true;
                other.joined = true;
            }
        }
    }
    let area = |only_joined: bool| {
        let some = boxes.iter().filter(|block| block.joined || !only_joined);
        some.map(|block| block.area).sum::<f64>()
    };
    if boxes.is_empty() {
        0.0
    } else {
        area(true) / area(false)
    }
}

/// Maximum number of blocks whose faces are looked at; in larger scenes each represents its neighbours in the list.
const MOST: usize = 300;

/// Returns the fraction of the block surface in open water: of faces that have no other block, by bounding boxes, and
/// no end of the domain within a cell.
pub(super) fn open_share(scene: &Scene) -> f64 {
    let grid = &scene.grid;
    let solids: Vec<_> = scene.polyhedra().map(|one| one.solid).collect();
    let boxes: Vec<[[f64; 3]; 2]> = solids
        .iter()
        .map(|solid| {
            let none = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
            let vertices = solid.vertices();
            vertices.iter().fold(none, |[low, high], vertex| {
                [
                    std::array::from_fn(|a| low[a].min(vertex[a])),
                    std::array::from_fn(|a| high[a].max(vertex[a])),
                ]
            })
        })
        .collect();
    // A block is its own neighbour only across a periodic end.
    let is_closed = |own: Option<usize>, point: [f64; 3]| {
        let outside = |a: usize| !grid.periodic[a] && !(0.0..=grid.size[a]).contains(&point[a]);
        (0..grid.dimension).any(outside)
            || boxes.iter().enumerate().any(|(n, [low, high])| {
                own != Some(n) && (0..3).all(|a| (low[a]..=high[a]).contains(&point[a]))
            })
    };
    let (mut open, mut all) = (0.0, 0.0);
    for (n, solid) in solids
        .iter()
        .enumerate()
        .step_by(solids.len().div_ceil(MOST).max(1))
    {
        let vertices = solid.vertices();
        for (face, plane) in solid.half_spaces().iter().enumerate() {
            let corners = solid.shape.face(face);
            let mut own = Some(n);
            let mut point = [0.0; 3];
            for (a, x) in point.iter_mut().enumerate() {
                let sum: f64 = corners.iter().map(|c| vertices[*c as usize][a]).sum();
                *x = sum / real(corners.len()) + grid.spacing * plane.normal[a];
                if a < grid.dimension && grid.periodic[a] && !(0.0..grid.size[a]).contains(x) {
                    *x = x.rem_euclid(grid.size[a]);
                    own = None;
                }
            }
            let area = solid.shape.face_area(face);
            all += area;
            open += if is_closed(own, point) { 0.0 } else { area };
        }
    }
    if all > 0.0 { open / all } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::Document;
    use std::path::Path;

    #[test]
    fn two_of_three_blocks_are_joined() {
        let text = r#"{"domain": {"size": [1, 1, 1], "spacing": 0.05}, "materials": {"rock": {"density": 2600}},
            "blocks": {"material": "rock", "initial": {"list": [
                {"shape": {"cuboid": {"edges": [0.2, 0.2, 0.2]}}, "position": [0.2, 0.2, 0.2]},
                {"shape": {"cuboid": {"edges": [0.2, 0.2, 0.2]}}, "position": [0.2, 0.41, 0.2]},
                {"shape": {"cuboid": {"edges": [0.1, 0.1, 0.1]}}, "position": [0.7, 0.41, 0.2]}]}},
            "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "normal_damping_ratio": 0.3}},
            "time": {"end": 0.01}}"#;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let share = super::joint_share(&plan.scene);
        assert!((share - 48.0 / 54.0).abs() < 1e-9, "{share}");
    }

    /// Checks the share of five blocks side by side on the floor of a chute that repeats along and across it, of which
    /// only the upper faces touch open water; and that of one block in the middle of a box.
    #[test]
    fn faces_next_to_blocks_and_ends_are_not_open() {
        let text = case::examples::find("chute").unwrap().text;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let [long, wide, high, proud] = [0.0396, 0.0146, 0.02, 0.025];
        let all = 5.0 * 2.0 * long * wide + 2.0 * (long + wide) * (4.0 * high + proud);
        let expected = 5.0 * long * wide / all;
        let share = super::open_share(&plan.scene);
        assert!(
            (share - expected).abs() < 0.2 * expected,
            "{share} {expected}"
        );
        let text = r#"{"domain": {"size": [1, 1, 1], "spacing": 0.05}, "materials": {"rock": {"density": 2600}},
            "blocks": {"material": "rock", "initial": {"list": [
                {"shape": {"cuboid": {"edges": [0.2, 0.2, 0.2]}}, "position": [0.5, 0.5, 0.5]}]}},
            "contact": {"blocks": {"normal_stiffness": {"per_area": 1e9}, "normal_damping_ratio": 0.3}},
            "time": {"end": 0.01}}"#;
        let document = Document::read(text, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        assert!((super::open_share(&plan.scene) - 1.0).abs() < 1e-12);
    }
}
