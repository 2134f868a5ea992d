//! Automatic choice of contact stiffness and coupling interval in seepage.
//!
//! Two dimensionless numbers are taken from measured beds. The grains at the bottom of a bed carry at most the
//! submerged weight of the bed and the pressure difference of the flow,
//!
//! ```text
//! sigma = c (rho_s - rho) g H + dp,   c = 0.6
//! overlap = sigma d/k                 overlap of a contact under sigma d², in diameters (2-D: sigma/k, sigma d)
//! interval = t/(d/a)^½                coupling interval over the time in which a grain without neighbours, under
//!                                     a = sigma/(c rho_s H), moves half a diameter
//! ```
//!
//! Softer contacts reduce the pore space. A longer coupling interval moves grains under an outdated load.
//! `measured_seepage.csv` lists the resulting errors of the flow: the largest error of two beds, one near the
//! critical gradient and one that the flow presses down, at this and every smaller overlap or interval. Both errors
//! add up. The plan promises twice their sum plus the error of the resistance law
//! ([`resistance`](super::resistance)), and nothing if that is not known. Porosity is computed from exact overlaps,
//! because other methods cost as much at equal error.
//!
//! Within the limits of the plan the settlement of columns (consolidation in water, oil and glycerine, and silt)
//! differs by at most 0.8 % from that of a coupling in each solid step, the mass eroded from sand by 0.5 %
//! (`jobs/verification/coupling-interval`).

use super::{Subject, measured, resistance, step};
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::grains::Grains;
use base::number::to_u32;
use base::vector::norm;
use serde::Deserialize;
use std::sync::LazyLock;

const TABLE: &str = include_str!("measured_seepage.csv");
/// Fractions of the target for the error of the contacts and for that of the interval. Together they are a half,
/// because another bed may differ from the measured ones.
const CONTACT_SHARE: f64 = 0.3;
const INTERVAL_SHARE: f64 = 0.2;
/// Maximum solid fraction of a bed; of the order of random packings of spheres.
const SOLID: f64 = 0.6;
/// Maximum overlap of an impact in diameters: falling grains come to rest before the run.
const IMPACT: f64 = 0.1;

/// Quantity of a measured row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Quantity {
    /// Overlap of the contacts in diameters.
    Overlap,
    /// Coupling interval over the time in which a free grain moves half a diameter.
    Interval,
}

impl Quantity {
    fn name(self) -> &'static str {
        match self {
            Self::Overlap => "overlap",
            Self::Interval => "interval",
        }
    }
}

/// Measured row.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Row {
    /// Quantity on which the error depends.
    what: Quantity,
    /// Largest value of the quantity for which the row is valid.
    value: f64,
    /// Largest relative error of the flow.
    error: f64,
    /// Source of the measurement, and its reference.
    place: String,
}

impl Row {
    fn name(&self) -> String {
        let error = number(100.0 * self.error);
        format!("`{} {}: {error} %`", self.what.name(), number(self.value))
    }
}

fn rows(what: Quantity) -> impl Iterator<Item = &'static Row> {
    all().iter().filter(move |row| row.what == what)
}

/// Returns all rows.
fn all() -> &'static [Row] {
    static ROWS: LazyLock<Vec<Row>> = LazyLock::new(|| measured::read(TABLE));
    &ROWS
}

/// Returns the cheapest row, that with the largest value, whose error is within a bound; without such a row, the one
/// with the smallest error.
fn cheapest_row(what: Quantity, bound: f64) -> Option<&'static Row> {
    let good = rows(what).filter(|row| row.error <= bound);
    good.max_by(|a, b| a.value.total_cmp(&b.value))
        .or_else(|| rows(what).min_by(|a, b| a.value.total_cmp(&b.value)))
}

/// Returns the row that covers a value; none above all rows.
fn covering_row(what: Quantity, value: f64) -> Option<&'static Row> {
    rows(what)
        .filter(|row| value <= row.value * (1.0 + 1e-9))
        .min_by(|a, b| a.value.total_cmp(&b.value))
}

/// Load on a bed.
struct Bed {
    /// Smallest and largest diameter \[m\].
    diameters: (f64, f64),
    /// Force of the largest stress on the largest grain \[N\].
    force: f64,
    /// Largest stress on the grains \[Pa\].
    stress: f64,
    /// Acceleration of an unsupported grain [m/s²].
    acceleration: f64,
}

impl Bed {
    fn new(scene: &Scene) -> Option<Self> {
        let seepage = scene.seepage.as_ref()?;
        let grains: &Grains = scene.grains.as_ref()?;
        let (low, high) = grains.radii?;
        let density = scene.density(grains.material);
        let gravity = norm(scene.gravity);
        let height = seepage.height(scene.gravity, scene.grid.dimension);
        let buoyant = (density - seepage.written.density).max(0.0);
        let stress = SOLID * buoyant * gravity * height + seepage.pressure_drop(scene.gravity);
        let acceleration = stress / (SOLID * density * height);
        let usable = stress > 0.0 && low > 0.0 && acceleration.is_finite();
        let section = (2.0 * high).powi(if scene.grid.dimension == 2 { 1 } else { 2 });
        usable.then_some(Self {
            diameters: (2.0 * low, 2.0 * high),
            force: stress * section,
            stress,
            acceleration,
        })
    }

    /// Returns the spring stiffness [N/m] for which the overlap is this fraction of the largest diameter.
    fn stiffness(&self, overlap: f64) -> f64 {
        self.force / (overlap * self.diameters.1)
    }

    /// Returns the unit in which coupling intervals are expressed \[s\].
    fn time(&self) -> f64 {
        (self.diameters.0 / self.acceleration).sqrt()
    }
}

/// Returns the spring stiffness [N/m] for the target, and the reason; none if the bed has no load. `impact` gives
/// the stiffness that stops falling grains within a fraction of their diameter.
pub(super) fn stiffness(
    scene: &Scene,
    target: f64,
    impact: impl Fn(f64) -> f64,
) -> Option<(f64, String)> {
    let bed = Bed::new(scene)?;
    let row = cheapest_row(Quantity::Overlap, CONTACT_SHARE * target)?;
    let value = bed.stiffness(row.value).max(impact(IMPACT));
    let text = format!(
        "{} N/m: contacts overlap by at most {} % of a diameter under {} Pa, and by {} % for falling grains",
        number(value),
        number(100.0 * row.value),
        number(bed.stress),
        number(100.0 * IMPACT)
    );
    Some((value, text))
}

/// Chooses the coupling interval, and adds the promised error of interval and contacts.
pub(super) fn choose(scene: &mut Scene, target: f64, findings: &mut Findings) {
    let Some(bed) = Bed::new(scene) else { return };
    let shortest = step::intervals(scene).fold(f64::INFINITY, f64::min);
    let Some(seepage) = scene.seepage.as_mut() else {
        return;
    };
    if seepage.written.coupling_interval.is_some() {
        let text = "the case sets its own coupling interval, whose error is not known";
        scene.chosen.note(Subject::Accuracy, text);
        return;
    }
    let Some(interval) = cheapest_row(Quantity::Interval, INTERVAL_SHARE * target) else {
        return;
    };
    let time = interval.value * bed.time();
    seepage.coupling_time = Some(time.min(shortest));
    let text = format!(
        "at most {} s, {} of the time in which a free grain moves half a diameter",
        number(time),
        number(interval.value)
    );
    scene.chosen.note(Subject::CouplingInterval, text);
    report_error(scene, &bed, interval, target, findings);
}

/// Reports the combined error of the chosen interval and the contacts, chosen or stated.
fn report_error(
    scene: &mut Scene,
    bed: &Bed,
    interval: &Row,
    target: f64,
    findings: &mut Findings,
) {
    let Some(overlap) = softest(scene).map(|k| bed.force / (k * bed.diameters.1)) else {
        return;
    };
    let Some(contacts) = covering_row(Quantity::Overlap, overlap) else {
        findings.warn(
            "accuracy",
            format!(
                "contacts overlap by {} % of a diameter under {} Pa, more than in any measured row: the plan promises \
                 no error",
                number(100.0 * overlap),
                number(bed.stress)
            ),
            "use stiffer contacts, or remove the contact law, so that the program chooses it",
        );
        return;
    };
    let numerics = 2.0 * (contacts.error + interval.error);
    let of_numerics = format!(
        "error of the flow by {} and {} ({}), twice the sum of both: {} %",
        contacts.name(),
        interval.name(),
        contacts.place,
        number(100.0 * numerics)
    );
    let (law, of_law) = match resistance::error(scene) {
        Ok(error) => error,
        Err(reason) => {
            let text = format!("{of_numerics}; nothing further is promised: {reason}");
            scene.chosen.note(Subject::Accuracy, text);
            findings.warn(
                "accuracy",
                format!(
                    "contacts and coupling interval change the flow by at most {} %, but the plan promises no error: \
                     {reason}",
                    number(100.0 * numerics)
                ),
                "compare the flow with a measurement; `solver estimate` runs the case under other laws of resistance",
            );
            return;
        }
    };
    let promised = numerics + law;
    scene.chosen.promised = Some(promised);
    let text = format!("{of_numerics}; law of resistance {of_law}");
    scene.chosen.note(Subject::Accuracy, text);
    if promised > target {
        findings.warn(
            "accuracy",
            format!(
                "an error of {} % is requested, but the plan promises {} %, of which {} % is due to the law of \
                 resistance",
                number(100.0 * target),
                number(100.0 * promised),
                number(100.0 * law)
            ),
            "use stiffer contacts if the case defines them, another law of resistance, or measured \
             permeabilities (`fluid.darcy.zones`)",
        );
    }
}

/// Returns the spring stiffness of the largest grain [N/m], from its time 2 (m/k)^½.
fn softest(scene: &Scene) -> Option<f64> {
    let (contact, grains) = (scene.contact.as_ref()?, scene.grains.as_ref()?);
    let radius = grains.radii?.1;
    let mass = scene.mass(grains.material, radius);
    let material = to_u32(grains.material);
    let time = contact
        .model()
        .time_limits(material, [radius; 2], mass)
        .spring;
    Some(4.0 * mass / (time * time))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_a_row_and_errors_grow() {
        assert_eq!(
            rows(Quantity::Overlap).count() + rows(Quantity::Interval).count() + 1,
            TABLE.lines().count()
        );
        for what in [Quantity::Overlap, Quantity::Interval] {
            let all: Vec<&Row> = rows(what).collect();
            let grows = |w: &[&Row]| w[0].value < w[1].value && w[0].error <= w[1].error;
            assert!(all.windows(2).all(grows), "{what:?}");
            assert!(
                all.iter()
                    .all(|row| row.error > 0.0 && !row.place.is_empty())
            );
        }
    }

    #[test]
    fn a_smaller_target_is_never_softer_nor_coupled_more_rarely() {
        for what in [Quantity::Overlap, Quantity::Interval] {
            let value = |bound| cheapest_row(what, bound).unwrap().value;
            assert!(
                value(0.03) >= value(0.015) && value(0.015) >= value(0.001),
                "{what:?}"
            );
        }
    }

    #[test]
    fn what_no_row_covers_is_not_promised() {
        let softest = rows(Quantity::Overlap).last().unwrap();
        assert!(covering_row(Quantity::Overlap, 0.99 * softest.value).is_some());
        assert!(covering_row(Quantity::Overlap, 1.01 * softest.value).is_none());
    }

    /// Column of 0.1 m under 500 Pa: the stress 0.6 * 1650 * 9.81 * 0.1 Pa + 500 Pa = 1471.19 Pa acts on grains of at
    /// most 4 mm and accelerates them by (1471.19 / 159) m/s².
    const COLUMN: &str = r#"{
        "accuracy": "draft",
        "domain": {"size": [0.02, 0.02, 0.1], "spacing": 0.01},
        "gravity": [0, 0, -9.81],
        "materials": {"sand": {"density": 2650}},
        "fluid": {"darcy": {"density": 1000, "viscosity": 0.001, "boundaries": [
            {"name": "in", "face": "z_min", "condition": {"pressure": {"value": 1481}}},
            {"name": "out", "face": "z_max", "condition": {"pressure": {"value": 0}}}]}},
        "grains": {"material": "sand", "initial": {"list": [
            {"position": [0.005, 0.005, 0.003], "radius": 0.002},
            {"position": [0.015, 0.015, 0.003], "radius": 0.001}]}},
        "box_walls": ["z_min"], "box_wall_material": "sand",
        "time": {"end": 0.1}
    }"#;

    fn scene(set: &[&str]) -> Scene {
        let set: Vec<String> = set.iter().map(|s| (*s).to_owned()).collect();
        let document = case::Document::read(COLUMN, &set, std::path::Path::new(".")).unwrap();
        Scene::resolve(&document.case).unwrap().0
    }

    #[test]
    fn stiffness_and_interval_follow_from_the_load_of_the_bed() {
        let scene = scene(&[]);
        let stress = 0.6 * 1650.0 * 9.81 * 0.1 + 500.0;
        let bed = Bed::new(&scene).unwrap();
        assert!((bed.stress / stress - 1.0).abs() < 1e-9, "{}", bed.stress);
        let stiffness = stress * 0.004 / 0.0000473;
        assert!((softest(&scene).unwrap() / stiffness - 1.0).abs() < 1e-9);
        let time = 0.5 * (0.002 * 0.6 * 2650.0 * 0.1 / stress).sqrt();
        let chosen = scene
            .seepage
            .as_ref()
            .and_then(|s| s.coupling_time)
            .unwrap();
        assert!((chosen / time - 1.0).abs() < 1e-9, "{chosen}");
        let reasons = format!("{:?}", scene.chosen.reasons);
        let numerics = format!(
            "twice the sum of both: {} %",
            number(100.0 * 2.0 * (0.0190 + 0.0160))
        );
        assert!(reasons.contains(&numerics), "{reasons}");
        // Two grains are not a bed, and no law was measured for them.
        assert_eq!(scene.chosen.promised, None);
    }

    /// Checks a cubic array of 5 x 5 x 5 touching spheres: Kozeny and Carman's law deviates by 13 % in the array
    /// and by 1 to 2 % in random beds, Ergun's law by 4 and 21 %.
    #[test]
    fn the_promise_covers_the_law_of_resistance() {
        let mut grains = Vec::new();
        for n in 0..125 {
            let at = |n: i32| 0.002 + 0.004 * f64::from(n % 5);
            grains.push(format!(
                r#"{{"position": [{}, {}, {}], "radius": 0.002}}"#,
                at(n),
                at(n / 5),
                at(n / 25)
            ));
        }
        let bed = format!(r#"grains.initial={{"list": [{}]}}"#, grains.join(", "));
        let slow = "fluid.darcy.viscosity=10";
        let of = |law: &str| {
            let law = format!(r#"fluid.darcy.resistance="{law}""#);
            scene(&[&bed, slow, &law]).chosen.promised.unwrap() - 2.0 * (0.0190 + 0.0160)
        };
        let (carman, ergun) = (of("kozeny_carman"), of("ergun"));
        assert!((0.15..0.17).contains(&carman), "{carman}");
        assert!((0.2..0.3).contains(&ergun), "{ergun}");
        // In water the flow is too fast for Darcy's law.
        assert!(of_water(&bed) > 1.0);
    }

    fn of_water(bed: &str) -> f64 {
        let law = r#"fluid.darcy.resistance="kozeny_carman""#;
        scene(&[bed, law]).chosen.promised.unwrap()
    }

    #[test]
    fn what_is_stated_is_kept_and_judged() {
        let law = |k: f64| {
            format!(
                r#"contact={{"linear":{{"normal_stiffness":{{"absolute":{k}}},"normal_damping_ratio":0.3}}}}"#
            )
        };
        let stiff = scene(&[&law(1e7)]);
        assert!((softest(&stiff).unwrap() / 1e7 - 1.0).abs() < 1e-9);
        let reasons = |scene: &Scene| format!("{:?}", scene.chosen.reasons);
        assert!(reasons(&stiff).contains("twice the sum of both: 4.32 %"));
        assert_eq!(scene(&[&law(10.0)]).chosen.promised, None);
        let often = scene(&["fluid.darcy.coupling_interval=7"]);
        let seepage = often.seepage.as_ref().unwrap();
        assert_eq!(seepage.coupling_interval(1e-6, None), 7);
        assert_eq!(often.chosen.promised, None);
    }
}
