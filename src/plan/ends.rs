//! Distance of the closed ends of a seepage model from its imposed heads.
//!
//! The ends of a model of a dam are impermeable. Under a cover of thickness D and conductivity k,
//! water leaks into a layer of transmissivity T over the leakage length λ = (T D/k)^½ (C. E. Jacob, Trans. AGU 27,
//! 198, 1946; J. Bear, Hydraulics of Groundwater, 1979, section 5-5). An end at the distance L beyond the last edge of
//! an imposed head adds the resistance of a length E(L) = λ coth(L/λ) instead of E(∞) = λ. In uniform ground of depth D
//! the conformal map cosh(π (x + i z)/D) of the strip gives the length of the entrance, and λ = 2 D/π is the length of
//! the slowest mode, cos(π z/2D) exp(-π x/2D):
//!
//! ```text
//! E(L) = L - (2 D/π) ln sinh(π L/2D),     E(∞) = (2 ln 2/π) D
//! ```
//!
//! Between the heads lies the base B:
//!
//! ```text
//! q(L) / q(∞) = (B + 2 E(∞)) / (B + E(L1) + E(L2))
//! ```
//!
//! At L = 3 λ an end reduces the discharge by less than 1 %. The formula needs layers along the axis of gravity
//! with stated conductivities; it neglects structures.

use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::seepage::Seepage;
use base::geometry::Vector;
use base::vector::norm;
use case::darcy::ZonePermeability;
use case::geometry::{Axis, Region};
use darcy::Condition;
use std::f64::consts::{FRAC_2_PI, LN_2};

/// Relative loss of discharge above which the plan warns.
const WARNED_LOSS: f64 = 0.02;
/// Distance of an end from the last edge, in leakage lengths, beyond which its effect is negligible.
const NEGLIGIBLE_DISTANCE: f64 = 3.0;

/// Warns of closed ends that are too close to the heads.
pub(super) fn check(scene: &Scene, seepage: &Seepage, findings: &mut Findings) {
    let dimension = scene.grid.dimension;
    let up = dimension - 1;
    let Some(conductivity) = layers(scene, seepage, up) else {
        return;
    };
    let entrance = Entrance::new(&conductivity, &thicknesses(seepage, up));
    let length = entrance.length();
    for axis in (0..dimension).filter(|axis| *axis != up) {
        let Some(ends) = Ends::find(seepage, axis) else {
            continue;
        };
        let loss = ends.loss(entrance);
        if loss < WARNED_LOSS {
            continue;
        }
        let name = ["x", "y", "z"][axis];
        let shortest = ends.distances.iter().flatten().copied().reduce(f64::min);
        findings.warn(
            &format!("domain.size[{axis}]"),
            format!(
                "the closed ends along {name} lie {} m from the edges of the imposed heads, and the leakage length of \
                 the ground is {} m: the discharge is about {} % below that of ground without ends",
                number(shortest.unwrap_or(0.0)),
                number(length),
                (100.0 * loss).round()
            ),
            format!(
                "place the ends at least {} m (three leakage lengths) from the heads, or impose at the ends the \
                 heads or fluxes of the ground beyond",
                number(NEGLIGIBLE_DISTANCE * length)
            ),
        );
    }
}

/// Closed ends of a seepage and the distance to which an estimate moves them.
#[derive(Clone, Debug, PartialEq)]
pub struct FarEnds {
    /// Axis along which the ends close the model.
    pub axis: usize,
    /// Distance of the lower and the upper end from the nearest edge of an imposed head \[m\]; none for an open
    /// end.
    pub distances: [Option<f64>; 2],
    /// Distance beyond which the ends reduce the discharge by less than 1 % \[m\]; 0 if the leakage length is not
    /// known.
    pub enough: f64,
}

impl FarEnds {
    /// Finds the ends along the first horizontal axis that has closed ends beyond imposed heads.
    #[must_use]
    pub fn find(scene: &Scene, seepage: &Seepage) -> Option<Self> {
        let up = scene.grid.dimension - 1;
        let length = layers(scene, seepage, up).map_or(0.0, |conductivity| {
            Entrance::new(&conductivity, &thicknesses(seepage, up)).length()
        });
        (0..up).find_map(|axis| {
            let ends = Ends::find(seepage, axis)?;
            Some(Self {
                axis,
                distances: ends.distances,
                enough: NEGLIGIBLE_DISTANCE * length,
            })
        })
    }

    /// Returns the distances by which the ends must be moved \[m\]: to `enough`, and at least to twice their
    /// distance.
    #[must_use]
    pub fn added(&self) -> [f64; 2] {
        self.distances
            .map(|distance| distance.map_or(0.0, |distance| distance.max(self.enough - distance)))
    }
}

/// Closed ends along an axis, and the base between the heads.
struct Ends {
    /// Distance of the lower and the upper end from the nearest edge of a head \[m\]; none for an end that is open.
    distances: [Option<f64>; 2],
    /// Distance between the outer edges of the heads \[m\].
    base: f64,
}

impl Ends {
    /// Finds the ends along an axis; none without edges of heads between them, or without a closed end.
    fn find(seepage: &Seepage, axis: usize) -> Option<Self> {
        let cells = seepage.cells[axis];
        let held = seepage.patches.iter().filter(|patch| {
            let held = matches!(
                patch.condition,
                Condition::Head { .. } | Condition::Pressure { .. }
            );
            held && patch.face.axis() != axis
        });
        let edges: Vec<usize> = held
            .flat_map(|patch| [patch.from[axis], patch.to[axis]])
            .filter(|edge| (1..cells).contains(edge))
            .collect();
        let (first, last) = (*edges.iter().min()?, *edges.iter().max()?);
        let open = |upper: bool| {
            let mut patches = seepage.patches.iter();
            patches.any(|patch| patch.face.axis() == axis && patch.face.is_max() == upper)
        };
        let along = seepage.axis(axis);
        let distance =
            |from: usize, to: usize, upper: bool| (!open(upper)).then(|| along.length(from, to));
        let distances = [distance(0, first, false), distance(last, cells, true)];
        distances.iter().any(Option::is_some).then(|| Self {
            distances,
            base: along.length(first, last),
        })
    }

    /// Returns the relative loss of discharge caused by the ends.
    fn loss(&self, entrance: Entrance) -> f64 {
        let far = entrance.far();
        let entry = |distance: &Option<f64>| distance.map_or(far, |at| entrance.closed_at(at));
        let closed: f64 = self.distances.iter().map(entry).sum();
        1.0 - (self.base + 2.0 * far) / (self.base + closed)
    }
}

/// Path of the water into the ground below an imposed head.
#[derive(Clone, Copy, Debug)]
enum Entrance {
    /// Through a cover, over this leakage length \[m\].
    Cover(f64),
    /// Into uniform ground of this depth \[m\].
    Uniform(f64),
}

impl Entrance {
    /// Returns the entrance of layers with these conductivities and thicknesses \[m\], from the lowest to the
    /// highest.
    fn new(conductivity: &[f64], thickness: &[f64]) -> Self {
        let layers = || conductivity.iter().zip(thickness);
        let sum =
            |part: &mut dyn Iterator<Item = (&f64, &f64)>| part.map(|(k, d)| k * d).sum::<f64>();
        let inverse =
            |part: &mut dyn Iterator<Item = (&f64, &f64)>| part.map(|(k, d)| d / k).sum::<f64>();
        let depth = (sum(&mut layers()) * inverse(&mut layers())).sqrt();
        let leaks = (1..conductivity.len()).map(|split| {
            (sum(&mut layers().take(split)) * inverse(&mut layers().skip(split))).sqrt()
        });
        let leak = leaks.fold(0.0, f64::max);
        if leak > FRAC_2_PI * depth {
            Self::Cover(leak)
        } else {
            Self::Uniform(depth)
        }
    }

    /// Returns the leakage length \[m\].
    fn length(self) -> f64 {
        match self {
            Self::Cover(length) => length,
            Self::Uniform(depth) => FRAC_2_PI * depth,
        }
    }

    /// Returns the length of ground with the resistance of the entrance below a head without end \[m\].
    fn far(self) -> f64 {
        match self {
            Self::Cover(length) => length,
            Self::Uniform(depth) => FRAC_2_PI * LN_2 * depth,
        }
    }

    /// Returns this length below a head that ends at a closed end \[m\].
    fn closed_at(self, distance: f64) -> f64 {
        match self {
            Self::Cover(length) => length / (distance / length).tanh(),
            Self::Uniform(depth) => {
                let modes = distance / (FRAC_2_PI * depth);
                // L - λ ln sinh(L/λ) without the overflow of the hyperbolic sine.
                FRAC_2_PI * depth * (LN_2 - (-(-2.0 * modes).exp()).ln_1p())
            }
        }
    }
}

/// Returns the thickness of each layer of cells along the vertical axis \[m\].
fn thicknesses(seepage: &Seepage, up: usize) -> Vec<f64> {
    let axis = seepage.axis(up);
    (0..axis.cells).map(|cell| axis.width(cell)).collect()
}

/// Returns the conductivity of each layer of cells along the vertical axis, in arbitrary units; none unless zones
/// give it for all cells in layers. A box that reaches from end to end is a layer.
fn layers(scene: &Scene, seepage: &Seepage, up: usize) -> Option<Vec<f64>> {
    let strength = norm(scene.gravity);
    let conducts = seepage.written.density * strength / seepage.written.viscosity;
    let mut found = vec![None; seepage.cells[up]];
    for zone in &seepage.written.zones {
        let value = match zone.permeability {
            Some(ZonePermeability::Value(k)) => k * conducts,
            Some(ZonePermeability::HydraulicConductivity(k)) => k,
            _ => return None,
        };
        if zone.polygon.is_some() {
            return None;
        }
        let (from, to) = match &zone.region {
            None => (None, None),
            Some(Region::Layer(layer)) => {
                let axis = layer.axis.map_or(up, Axis::index);
                if axis != up {
                    return None;
                }
                (layer.from, layer.to)
            }
            Some(Region::Box(extent)) => {
                let [low, high] = [&extent.from, &extent.to].map(Vector::to_array);
                let spans = |axis: usize| {
                    let cells = seepage.axis(axis);
                    let last = cells.centre(cells.cells.saturating_sub(1));
                    low[axis] <= cells.centre(0) && high[axis] > last
                };
                if !(0..up).all(spans) {
                    return None;
                }
                (Some(low[up]), Some(high[up]))
            }
        };
        for (k, known) in found.iter_mut().enumerate() {
            let middle = seepage.axis(up).centre(k);
            let inside = from.is_none_or(|from| middle >= from) && to.is_none_or(|to| middle < to);
            if inside {
                *known = Some(value);
            }
        }
    }
    found.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Plan;
    use base::error::Problem;
    use case::Document;
    use serde_json::json;
    use std::path::Path;

    #[test]
    fn leakage_lengths_of_a_cover_and_of_uniform_ground() {
        // Two metres of 1e-3 m/s under one metre of 1e-6 m/s: (2e-3 * 1e6)^(1/2).
        let layered = [1e-3, 1e-3, 1e-6];
        let length = |layers: &[f64], thickness: f64| {
            Entrance::new(layers, &vec![thickness; layers.len()]).length()
        };
        assert!((length(&layered, 1.0) / 2000_f64.sqrt() - 1.0).abs() < 0.01);
        let uniform = [1e-5; 40];
        let exact = 2.0 * 10.0 / std::f64::consts::PI;
        assert!((length(&uniform, 0.25) / exact - 1.0).abs() < 1e-12);
    }

    /// Checks the entrance into uniform ground against a head of length L at a closed end: the map cosh(π x/D) gives
    /// L + D/π ln(2/(cosh(π L/D) - 1)).
    #[test]
    fn the_entrance_into_uniform_ground_is_that_of_its_conformal_map() {
        use std::f64::consts::PI;
        let entrance = Entrance::Uniform(10.0);
        for length in [1.0, 5.0, 10.0, 30.0_f64] {
            let exact = length + 10.0 / PI * (2.0 / ((PI * length / 10.0).cosh() - 1.0)).ln();
            let found = entrance.closed_at(length);
            assert!((found - exact).abs() < 1e-9, "{length}: {found} {exact}");
        }
        assert!((entrance.closed_at(1e4) - entrance.far()).abs() < 1e-12);
    }

    #[test]
    fn ends_far_away_take_nothing() {
        let ends = |distance: f64| Ends {
            distances: [Some(distance), Some(distance)],
            base: 20.0,
        };
        let cover = Entrance::Cover(40.0);
        assert!(ends(400.0).loss(cover) < 1e-8);
        assert!(ends(120.0).loss(cover) < 0.005);
        let near = ends(20.0).loss(cover);
        let exact = 1.0 - (20.0 + 80.0) / (20.0 + 80.0 / 0.5_f64.tanh());
        assert!((near - exact).abs() < 1e-12 && near > 0.4);
    }

    fn warnings(beyond: f64) -> Vec<Problem> {
        let length = 20.0 + 2.0 * beyond;
        with_cover(beyond, &json!({"layer": {"from": 4}}), length)
    }

    /// Returns the warnings for a cover in a region of ground of this length \[m\].
    fn with_cover(beyond: f64, cover: &serde_json::Value, length: f64) -> Vec<Problem> {
        let case = json!({
            "domain": {"size": [length, 6], "spacing": 1},
            "gravity": [0, -9.81],
            "fluid": {"darcy": {
                "density": 1000, "viscosity": 1e-3,
                "zones": [
                    {"name": "gravel", "permeability": {"hydraulic_conductivity": 1e-3}},
                    {"name": "cover", "region": cover,
                        "permeability": {"hydraulic_conductivity": 4e-6}}
                ],
                "boundaries": [
                    {"name": "up", "face": "y_max", "patch": {"from": [0, 0], "to": [beyond, 0]},
                        "condition": {"head": {"value": 10}}},
                    {"name": "down", "face": "y_max", "patch": {"from": [beyond + 20.0, 0], "to": [length, 0]},
                        "condition": {"head": {"value": 6}}}
                ]
            }},
            "time": {"end": 1}
        });
        let document = Document::read(&case.to_string(), &[], Path::new("")).unwrap();
        let mut plan = Plan::prepare(document).unwrap_or_else(|p| panic!("{p:#?}"));
        plan.warnings.retain(|p| p.path == "domain.size[0]");
        plan.warnings
    }

    /// Checks a layer with T = 4e-3 m2/s under a cover with D/k = 2/4e-6 s: a leakage length of 44.7 m.
    #[test]
    fn the_plan_names_the_leakage_length_of_a_dam() {
        let near = warnings(40.0);
        assert_eq!(near.len(), 1);
        assert!(near[0].reason.contains("is 44.7"), "{}", near[0]);
        assert!(near[0].remedy.contains("134"), "{}", near[0]);
        assert_eq!(warnings(140.0), []);
        // The same cover as a box over the whole length.
        let cover = json!({"box": {"from": [0, 4], "to": [100, 6]}});
        assert_eq!(with_cover(40.0, &cover, 100.0), near);
    }
}
