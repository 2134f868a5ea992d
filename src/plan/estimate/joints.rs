//! Blocks next to other blocks: their surface cells exchange populations with cells of the neighbours.

use crate::scene::Scene;

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
}
