//! The resolved element test: probes of opposite planes and of the lateral stress, and the answers.

use super::findings::{Findings, number};
use super::observe::{Probe, ProbeAt};
use super::walls::SceneWall;
use base::error::Remedy;
use case::Case;
use case::check::nearest;
use case::element_test::TestAnswer;
use nalgebra::Vector3;
use serde::Serialize;

/// Test of a sample between two opposite planes. Probes are indices in [`super::Scene::probes`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElementTest {
    /// Probes of the two planes of the axis.
    pub axial: [usize; 2],
    /// Normals of the two planes.
    pub normals: [[f64; 3]; 2],
    /// Distance of the planes at time 0 \[m\].
    pub height: f64,
    /// Probes of lateral walls.
    pub lateral: Vec<usize>,
    /// Probe of the stress inside the sample, and the axis of the test: 0, 1 or 2.
    pub inside: Option<(usize, usize)>,
    /// Time from which answers count \[s\].
    pub from: f64,
    /// Answers, as written.
    pub answers: Vec<TestAnswer>,
}

const PATH: &str = "analysis.element_test";

/// Cosine from which normals are along one line.
const PARALLEL_COSINE: f64 = 1.0 - 1e-9;

/// Resolves the element test of a case; none if there is none or its probes are wrong.
pub(crate) fn resolve(
    case: &Case,
    probes: &[Probe],
    walls: &[SceneWall],
    findings: &mut Findings,
) -> Option<ElementTest> {
    let written = case.analysis.element_test.as_ref()?;
    // A wrong probe or wall has a finding of its own.
    if findings.wrong_in(&["probes", "walls", "box_walls"]) {
        return None;
    }
    let names = [0, 1].map(|k| (&written.axial[k], format!("{PATH}.axial[{k}]")));
    let axial = names.map(|(name, path)| find(case, probes, name, Kind::Wall, &path, findings));
    let lateral = written.lateral.iter().enumerate();
    let lateral: Vec<Option<usize>> = lateral
        .map(|(k, name)| {
            let path = format!("{PATH}.lateral[{k}]");
            find(case, probes, name, Kind::Wall, &path, findings)
        })
        .collect();
    let inside = written.inside.as_ref();
    let path = format!("{PATH}.inside");
    let inside = inside.map(|name| find(case, probes, name, Kind::Grains, &path, findings));
    let [Some(lower), Some(upper)] = axial else {
        return None;
    };
    let planes = [lower, upper].map(|probe| loaded(&probes[probe], walls));
    let [Some(one), Some(other)] = planes else {
        return None;
    };
    let normals = [one, other].map(|wall| Vector3::from(wall.normal));
    let apart = Vector3::from(other.point) - Vector3::from(one.point);
    let height = apart.dot(&normals[0]);
    let planes = one.surface.is_none() && other.surface.is_none();
    if !planes || normals[0].dot(&normals[1]) > -PARALLEL_COSINE || height <= 0.0 {
        findings.error(
            &format!("{PATH}.axial"),
            "the two walls are not planes that face each other",
            "choose probes of two parallel planes whose normals point at each other",
        );
        findings.depends(&["probes", "walls", "box_walls"]);
    }
    let axis = normals[0].iamax();
    if inside.is_some() && normals[0][axis].abs() < PARALLEL_COSINE {
        findings.error(
            &path,
            "the inner stress is known along the axes of the domain only, and the test acts along another \
             direction",
            "use planes normal to an axis, or lateral walls",
        );
    }
    let lateral: Option<Vec<usize>> = lateral.into_iter().collect();
    let test = ElementTest {
        axial: [lower, upper],
        normals: normals.map(Into::into),
        height,
        lateral: lateral?,
        inside: match inside {
            Some(probe) => Some((probe?, axis)),
            None => None,
        },
        from: written.from,
        answers: written.answers.clone(),
    };
    check_answers(case, &test, findings);
    check_samples(case, &test, probes, findings);
    Some(test)
}

/// Kind of a probe that a test reads.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Wall,
    Grains,
}

/// Finds a probe by its name.
fn find(
    case: &Case,
    probes: &[Probe],
    name: &str,
    kind: Kind,
    path: &str,
    findings: &mut Findings,
) -> Option<usize> {
    let fits = |probe: &&Probe| match probe.at {
        ProbeAt::WallLoad { .. } => kind == Kind::Wall,
        ProbeAt::Grains { .. } => kind == Kind::Grains,
        _ => false,
    };
    let found = probes
        .iter()
        .position(|probe| probe.name == name && fits(&probe));
    // A probe that could not be resolved has a finding of its own.
    let unresolved = probes.len() < case.probes.len();
    if found.is_none() && !unresolved {
        let kind = if kind == Kind::Wall {
            "wall_load"
        } else {
            "grains"
        };
        let names: Vec<&str> = probes
            .iter()
            .filter(fits)
            .map(|p| p.name.as_str())
            .collect();
        let remedy = nearest(name, &names).map_or_else(
            || match names[..] {
                [] => Remedy::from(format!("add a probe `{kind}` with this name to `probes`")),
                _ => Remedy::from(format!("probes `{kind}` here: {}", names.join(", "))),
            },
            |near| Remedy::from(format!("did you mean `{near}`?")).set(path, near),
        );
        findings.error(
            path,
            format!("there is no probe `{kind}` with this name"),
            remedy,
        );
        findings.depends(&["probes"]);
    }
    found
}

/// Returns the wall that a wall probe measures.
fn loaded<'a>(probe: &Probe, walls: &'a [SceneWall]) -> Option<&'a SceneWall> {
    match probe.at {
        ProbeAt::WallLoad { wall, .. } => walls.get(wall),
        _ => None,
    }
}

/// Refuses answers that need a lateral stress if none is measured, two kinds of lateral stress, and a test without
/// answers.
fn check_answers(case: &Case, test: &ElementTest, findings: &mut Findings) {
    let sides = !test.lateral.is_empty();
    if sides && test.inside.is_some() {
        findings.error(
            &format!("{PATH}.inside"),
            "the lateral stress comes from either `lateral` or `inside`, but both are given",
            Remedy::take_out("remove one of them", &format!("{PATH}.inside")),
        );
    }
    for (n, answer) in test.answers.iter().enumerate() {
        if answer.quantity.is_lateral() && !sides && test.inside.is_none() {
            findings.error(
                &format!("{PATH}.answers[{n}].quantity"),
                "this quantity needs a lateral stress, but the test has none",
                "add `lateral` (probes of the side walls) or `inside` (a probe `grains`)",
            );
        }
    }
    if test.answers.is_empty() {
        findings.error(
            &format!("{PATH}.answers"),
            "the test requests no quantity",
            "request at least one quantity, for example [{\"quantity\": \"strength\"}]",
        );
    }
    if test.from >= case.time.end {
        findings.error(
            &format!("{PATH}.from"),
            format!(
                "the test begins at {} s, but the run ends at {} s",
                number(test.from),
                number(case.time.end)
            ),
            "use a time before the end of the run",
        );
    }
}

/// Refuses probes that are not sampled at the same times.
fn check_samples(case: &Case, test: &ElementTest, probes: &[Probe], findings: &mut Findings) {
    let first = probes[test.axial[0]].every;
    let others = test.lateral.iter().copied();
    let others = others.chain(test.inside.map(|(probe, _)| probe));
    for probe in others.chain([test.axial[1]]) {
        let probe = &probes[probe];
        let differs = (probe.every - first).abs() > 0.0;
        let place = case.probes.iter().position(|one| one.name == probe.name);
        if let Some(place) = place.filter(|_| differs) {
            let path = format!("probes[{place}].every");
            findings.error(
                &path,
                format!(
                    "an element test reads this probe together with another that is written every {} s, and both \
                     must have the same interval",
                    number(first)
                ),
                Remedy::from("use the same interval").set(&*path, first),
            );
        }
    }
}
