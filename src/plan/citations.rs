//! Papers of the models that a case uses.
//!
//! [`MODELS`] gives the keys of the bibliography ([`super::bibliography`]) for every model of every
//! family, by the names of the models in a case. A new model needs a line here; a test compares the
//! table with the schema.

use super::Plan;
use super::bibliography::{self, Publication};
use crate::scene::Scene;
use crate::scene::flow::{BodyForce, Flow};
use crate::scene::free_surface::WaterPart;
use crate::scene::observe::ProbeAt;
use case::coupling::Coupling;
use case::fluid::Precision;
use lbm::lattice::VelocitySet;
use serde::Serialize;
use serde_json::Value;

/// Models of a family by their names in a case, each with the keys of its papers.
type Models = &'static [(&'static str, &'static [&'static str])];

/// Papers of all models, by family.
pub const MODELS: &[(&str, Models)] = &[
    (
        "lattice",
        &[
            ("d2q9", &["qian1992", "bailey2009"]),
            ("d3q19", &["qian1992", "bailey2009"]),
            ("d3q27", &["qian1992", "bailey2009"]),
        ],
    ),
    (
        "collision",
        &[
            ("bgk", &["bhatnagar1954"]),
            ("trt", &["ginzburg2008"]),
            ("mrt", &["suga2015", "junk2009", "latt2006"]),
            ("suga", &["suga2015"]),
            ("cumulant", &["geier2015"]),
        ],
    ),
    ("arithmetic", &[("f32", &["lehmann2022"])]),
    (
        "body_force",
        &[("constant", &["guo2002"]), ("oscillating", &["guo2002"])],
    ),
    (
        "turbulence",
        &[
            ("wale", &["nicoud1999"]),
            ("smagorinsky", &["smagorinsky1963"]),
        ],
    ),
    (
        "initial",
        &[
            ("taylor_green", &["taylor1937"]),
            ("shear_layers", &["minion1997"]),
        ],
    ),
    (
        "boundary",
        &[
            ("no_slip", &["ladd1994"]),
            ("moving_wall", &["ladd1994"]),
            ("free_slip", &["kruger2017"]),
            ("velocity", &["ladd1994"]),
            ("pressure", &["ginzburg2008", "ladd1994"]),
            ("outflow", &["lou2013", "kruger2017"]),
            ("convective_outflow", &["lou2013"]),
            ("discharge", &["ladd1994", "chow1959"]),
            ("level", &["mohamad2009"]),
            ("outfall", &["mohamad2009"]),
        ],
    ),
    (
        "opening",
        &[
            ("absorb", &["poinsot1992", "rudy1980", "izquierdo2008"]),
            ("turbulence", &["kraichnan1970", "taylor1938"]),
        ],
    ),
    (
        "coupling",
        &[
            ("bounce_back", &["ladd1994", "aidun1998"]),
            (
                "partially_saturated",
                &["noble1998", "owen2011", "feng2009"],
            ),
        ],
    ),
    (
        "scheme",
        &[
            ("half_way", &["ladd1994"]),
            ("interpolated", &["ginzburg2008"]),
        ],
    ),
    (
        "solid_operator",
        &[
            ("non_equilibrium_bounce_back", &["noble1998"]),
            ("superposition", &["noble1998"]),
            ("bounce_back_about_solid", &["holdych2003"]),
            ("viscosity_matched", &["ginzburg2003"]),
        ],
    ),
    (
        "free_surface",
        &[
            (
                "volume_of_fluid",
                &["korner2005", "thurey2007", "bogner2015"],
            ),
            ("solitary_wave", &["grimshaw1971", "fenton1972"]),
            ("surface_tension", &["cummins2005", "afkhami2008"]),
        ],
    ),
    (
        "porous_zone",
        &[
            ("darcy_forchheimer", &["guozhao2002", "kupershtokh2009"]),
            ("ergun", &["ergun1952", "guozhao2002", "kupershtokh2009"]),
        ],
    ),
    (
        "seepage",
        &[
            ("darcy", &["bear1972"]),
            ("zones", &["cardwell1945", "renard1997"]),
            ("open_water", &["shah1978", "churchill1977"]),
            (
                "unsaturated",
                &["richards1931", "scharfetter1969", "vandervorst1992"],
            ),
            ("transient", &["celia1990", "alexander1977"]),
            ("effective_stress", &["bishop1959", "lu2010"]),
            ("follows_grains", &["carman1937"]),
            (
                "backward_erosion",
                &[
                    "sellmeijer1988",
                    "sellmeijer2011",
                    "white1940",
                    "peaceman1978",
                ],
            ),
        ],
    ),
    (
        "joints",
        &[
            (
                "network",
                &[
                    "witherspoon1980",
                    "eymard2000",
                    "alexander1977",
                    "elrod1981",
                ],
            ),
            ("inertia", &["zielke1968"]),
            ("turbulent", &["blasius1913", "colebrook1939"]),
        ],
    ),
    (
        "retention",
        &[
            ("van_genuchten", &["vangenuchten1980", "mualem1976"]),
            ("gardner", &["gardner1958"]),
            ("haverkamp", &["haverkamp1977"]),
            ("saturated_only", &["gardner1958", "bear1972"]),
        ],
    ),
    (
        "resistance",
        &[
            ("gidaspow", &["gidaspow1994", "ergun1952", "wen1966"]),
            ("kozeny_carman", &["carman1937"]),
            ("ergun", &["ergun1952"]),
            ("di_felice", &["difelice1994", "dallavalle1948"]),
        ],
    ),
    (
        "drag",
        &[
            ("reaction", &["bear1972"]),
            ("di_felice", &["difelice1994", "dallavalle1948"]),
            ("gidaspow", &["gidaspow1994", "ergun1952", "wen1966"]),
            ("dallavalle", &["dallavalle1948"]),
        ],
    ),
    (
        "porosity",
        &[
            ("centroid", &["peng2014"]),
            ("divided", &["peng2014"]),
            ("exact", &["strobl2016"]),
        ],
    ),
    (
        "contact",
        &[
            ("linear", &["cundall1979", "schwager2007"]),
            ("cohesive_frictional", &["sibille2012", "cundall1979"]),
            ("contact_bond", &["potyondy2004", "cundall1979"]),
            (
                "hertz_mindlin",
                &[
                    "hertz1882",
                    "mindlin1949",
                    "tsuji1992",
                    "direnzo2004",
                    "direnzo2005",
                    "schwager2007",
                    "antypov2011",
                    "thornton2013",
                ],
            ),
            (
                "blocks",
                &[
                    "hart1988",
                    "howe1996",
                    "mclachlan1993",
                    "dullweber1997",
                    "miller2002",
                ],
            ),
        ],
    ),
    (
        "block_model",
        &[
            ("pressure", &["feng2021"]),
            ("patch", &["hasegawa2004", "feng2012"]),
            ("point", &["boon2012"]),
        ],
    ),
    (
        "contact_option",
        &[
            ("rolling", &["ai2011"]),
            ("bridges", &["willett2000", "lian1993"]),
            ("softening", &["hawkins1992"]),
            ("local_damping", &["cundall1987"]),
        ],
    ),
    (
        "structure",
        &[
            ("plane", &["hart1996"]),
            ("box", &["hart1996"]),
            ("polygon", &["hart1996"]),
            ("disc", &["hart1996"]),
            ("cylinder", &["hart1996"]),
            ("sphere", &["hart1996"]),
            ("surface", &["hart1996", "baerentzen2005"]),
        ],
    ),
    (
        "walls",
        &[
            ("facets", &["santasusana2016"]),
            ("servo", &["sutherland1974"]),
        ],
    ),
    ("blocks", &[("joints", &["priest1976"])]),
    (
        "probe",
        &[
            ("bed", &["shields1936", "einstein1950"]),
            ("grains", &["christoffersen1981"]),
        ],
    ),
    (
        "analysis",
        &[
            ("erosion_law", &["sibille2012"]),
            ("element_test", &["rowe1962"]),
        ],
    ),
];

/// A model that a case uses, with its papers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Citation {
    /// Family of the model.
    pub family: &'static str,
    /// Name of the model in a case.
    pub model: &'static str,
    /// Papers of the model.
    pub publications: Vec<&'static Publication>,
}

/// Returns the models that a plan uses, each once, in the order of [`MODELS`].
#[must_use]
pub fn citations(plan: &Plan) -> Vec<Citation> {
    let scene = &plan.scene;
    let mut used: Vec<(&str, String)> = Vec::new();
    if let Some(flow) = &scene.flow {
        flow_models(scene, flow, &mut used);
    }
    seepage_models(scene, &mut used);
    if let Some(joints) = &scene.joints {
        used.push(("joints", "network".into()));
        if joints.written.inertia {
            used.push(("joints", "inertia".into()));
        }
        if joints.written.joints.roughness.is_some() {
            used.push(("joints", "turbulent".into()));
        }
    }
    grain_models(scene, &mut used);
    let case: Value = serde_json::from_str(&plan.case_text).unwrap_or_default();
    written_models(&case, &mut used);
    let mut list = Vec::new();
    for &(family, models) in MODELS {
        for &(model, keys) in models {
            if used.iter().any(|(f, m)| *f == family && m == model) {
                list.push(Citation {
                    family,
                    model,
                    publications: keys
                        .iter()
                        .filter_map(|key| bibliography::find(key))
                        .collect(),
                });
            }
        }
    }
    list
}

/// Returns the papers of all citations, each once, in the order of their keys.
#[must_use]
pub fn publications(citations: &[Citation]) -> Vec<&'static Publication> {
    let mut all: Vec<&'static Publication> = Vec::new();
    for citation in citations {
        all.extend(&citation.publications);
    }
    all.sort_by(|a, b| a.key.cmp(&b.key));
    all.dedup_by(|a, b| a.key == b.key);
    all
}

/// Returns the name of a choice: the text itself, or the name of the first field of an object.
fn name(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(name)) => name,
        Ok(Value::Object(fields)) => fields.keys().next().cloned().unwrap_or_default(),
        _ => String::new(),
    }
}

/// Adds the models of a fluid on a lattice.
fn flow_models(scene: &Scene, flow: &Flow, used: &mut Vec<(&'static str, String)>) {
    let lattice = match flow.models.lattice {
        VelocitySet::D2Q9 => "d2q9",
        VelocitySet::D3Q19 => "d3q19",
        VelocitySet::D3Q27 => "d3q27",
    };
    used.push(("lattice", lattice.into()));
    used.push(("collision", flow.models.collision.name().into()));
    if flow.arithmetic == Precision::F32 {
        used.push(("arithmetic", "f32".into()));
    }
    used.extend(
        flow.models
            .turbulence
            .iter()
            .map(|model| ("turbulence", name(model))),
    );
    let weight = (0..3).any(|a| flow.gravity_acts[a] && scene.gravity[a] != 0.0);
    match flow.body_force {
        BodyForce::Oscillating { .. } => used.push(("body_force", "oscillating".into())),
        BodyForce::Constant(force) if weight || force.iter().any(|f| *f != 0.0) => {
            used.push(("body_force", "constant".into()));
        }
        BodyForce::Constant(_) => {}
    }
    for patch in flow.patches() {
        used.push(("boundary", patch.condition.name().into()));
        opening_options(&patch.condition, flow, used);
    }
    if let Some(surface) = &scene.surface {
        used.push(("free_surface", "volume_of_fluid".into()));
        let solitary = |part: &WaterPart| matches!(part, WaterPart::Solitary(_));
        if surface.parts.iter().any(solitary) {
            used.push(("free_surface", "solitary_wave".into()));
        }
        if surface.tension.is_some() {
            used.push(("free_surface", "surface_tension".into()));
        }
    }
    if let Some(coupling) = &scene.coupling {
        used.push(("coupling", name(coupling)));
        match coupling {
            Coupling::BounceBack(written) => used.push(("scheme", name(&written.scheme))),
            Coupling::PartiallySaturated(written) => {
                let operator = flow.solid_operator(written);
                used.push(("solid_operator", operator.name().into()));
            }
        }
    }
}

/// Adds the treatment of sound and the turbulence of an opening.
fn opening_options(
    condition: &lbm::boundary::Condition,
    flow: &Flow,
    used: &mut Vec<(&'static str, String)>,
) {
    let written = serde_json::to_value(condition).unwrap_or_default();
    let written = &written[condition.name()];
    let imposes = |name: &str| {
        let patches = flow.patches();
        patches.filter(|p| p.condition.name() == name).count()
    };
    // By default an imposed pressure absorbs sound if it is the only opening besides imposed velocities.
    let only_outlet = condition.name() == "pressure"
        && written["sound"].is_null()
        && imposes("pressure") == 1
        && imposes("velocity") > 0
        && imposes("outflow") + imposes("convective_outflow") == 0;
    if written["sound"] == "absorb" || only_outlet || !written["mean_pressure"].is_null() {
        used.push(("opening", "absorb".into()));
    }
    if !written["turbulence"].is_null() {
        used.push(("opening", "turbulence".into()));
    }
}

/// Adds the models of seepage.
fn seepage_models(scene: &Scene, used: &mut Vec<(&'static str, String)>) {
    let Some(seepage) = &scene.seepage else {
        return;
    };
    let written = &seepage.written;
    used.push(("seepage", "darcy".into()));
    if !written.zones.is_empty() {
        used.push(("seepage", "zones".into()));
    }
    if written.backward_erosion.is_some() {
        used.push(("seepage", "backward_erosion".into()));
    }
    if let Some(soil) = &written.unsaturated {
        used.push(("seepage", "unsaturated".into()));
        used.push(("retention", name(&soil.retention)));
        if soil.transient.is_some() {
            used.push(("seepage", "transient".into()));
        }
    }
    if written.unsaturated.is_some() {
        if scene.grains.is_some() {
            used.push(("seepage", "effective_stress".into()));
        }
        if written.zones.iter().any(|zone| zone.follows_grains) {
            used.push(("seepage", "follows_grains".into()));
        }
    } else if scene.grains.is_some() || !scene.bodies.is_empty() {
        used.push(("seepage", "open_water".into()));
        used.push(("resistance", name(&written.resistance())));
        used.push(("drag", name(&written.drag())));
        used.push(("porosity", name(&written.porosity)));
    }
}

/// Adds the models of grains and blocks.
fn grain_models(scene: &Scene, used: &mut Vec<(&'static str, String)>) {
    if let Some(contact) = &scene.contact {
        let law = name(&contact.law);
        let mut model = law.as_str();
        for (prefix, option) in [
            ("bridged_", "bridges"),
            ("rolling_", "rolling"),
            ("softened_", "softening"),
        ] {
            if let Some(rest) = model.strip_prefix(prefix) {
                used.push(("contact_option", option.into()));
                model = rest;
            }
        }
        used.push(("contact", model.into()));
        if contact.local_damping > 0.0 {
            used.push(("contact_option", "local_damping".into()));
        }
    }
    if scene.walls.iter().any(|wall| wall.surface.is_some()) {
        used.push(("walls", "facets".into()));
    }
    if scene.walls.iter().any(|wall| wall.servo.is_some()) {
        used.push(("walls", "servo".into()));
    }
    for probe in &scene.probes {
        match probe.at {
            ProbeAt::Bed(_) => used.push(("probe", "bed".into())),
            ProbeAt::Grains { .. } => used.push(("probe", "grains".into())),
            _ => {}
        }
    }
    if scene.erosion_law.is_some() {
        used.push(("analysis", "erosion_law".into()));
    }
    if scene.element_test.is_some() {
        used.push(("analysis", "element_test".into()));
    }
}

/// Adds the models whose names are only in the text of the case.
fn written_models(case: &Value, used: &mut Vec<(&'static str, String)>) {
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    let lattice = &case["fluid"]["lattice_boltzmann"];
    if !lattice["initial"].is_null() {
        used.push(("initial", name(&lattice["initial"])));
    }
    for structure in list(&case["structures"]) {
        used.push(("structure", name(&structure["shape"])));
    }
    for zone in list(&lattice["porous_zones"]) {
        used.push(("porous_zone", name(&zone["resistance"])));
        used.push(("structure", name(&zone["shape"])));
    }
    for blocks in list(&case["blocks"]).iter().chain([&case["blocks"]]) {
        if !blocks["initial"]["joints"].is_null() {
            used.push(("blocks", "joints".into()));
        }
    }
    let blocks = &case["contact"]["blocks"];
    if !blocks.is_null() {
        let model = &blocks["model"];
        let model = if model.is_null() {
            "pressure".into()
        } else {
            name(model)
        };
        used.push(("block_model", model));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::{Document, examples};
    use dem::polyhedron::BlockContactModel as BlockModel;
    use std::collections::BTreeSet;
    use std::path::Path;

    /// Collects the names that a schema offers for a choice: fields of objects with one field,
    /// constants, and values of enums.
    fn names(schema: &Value) -> BTreeSet<String> {
        let mut found = BTreeSet::new();
        let texts = |value: &Value| -> Vec<String> {
            let list = value.as_array().cloned().unwrap_or_default();
            list.iter()
                .filter_map(|v| v.as_str().map(String::from))
                .collect()
        };
        found.extend(texts(&schema["enum"]));
        found.extend(schema["const"].as_str().map(String::from));
        for choice in ["oneOf", "anyOf"] {
            for choice in schema[choice].as_array().into_iter().flatten() {
                found.extend(names(choice));
                found.extend(texts(&choice["required"]));
            }
        }
        found
    }

    fn offered<T: schemars::JsonSchema>() -> BTreeSet<String> {
        names(schemars::schema_for!(T).as_value())
    }

    fn family(name: &str) -> BTreeSet<String> {
        let (_, models) = MODELS.iter().find(|(family, _)| *family == name).unwrap();
        models
            .iter()
            .map(|(model, _)| (*model).to_owned())
            .collect()
    }

    #[test]
    fn every_model_of_every_family_has_papers() {
        use case::{coupling, fluid};
        let mut lattices = offered::<fluid::LatticeChoice>();
        assert!(lattices.remove("auto"));
        let families = [
            ("lattice", lattices),
            ("collision", offered::<fluid::Collision>()),
            ("body_force", offered::<fluid::BodyForce>()),
            ("turbulence", offered::<fluid::Turbulence>()),
            ("boundary", offered::<lbm::boundary::Condition>()),
            ("coupling", offered::<Coupling>()),
            ("scheme", offered::<coupling::Scheme>()),
            ("solid_operator", offered::<coupling::SolidOperator>()),
            ("porous_zone", offered::<fluid::Resistance>()),
            ("resistance", offered::<darcy::Resistance>()),
            ("drag", offered::<darcy::DragLaw>()),
            ("retention", offered::<darcy::Retention>()),
            ("porosity", offered::<darcy::PorosityMethod>()),
            ("contact", offered::<dem::contact::Contact>()),
            ("block_model", offered::<BlockModel>()),
            ("structure", offered::<structure::Shape>()),
        ];
        for (name, models) in families {
            assert!(models.len() > 1, "{name}: {models:?}");
            assert_eq!(family(name), models, "{name}");
        }
        for (name, models) in MODELS {
            for (model, keys) in *models {
                assert!(!keys.is_empty(), "{name} {model}");
                for key in *keys {
                    assert!(bibliography::find(key).is_some(), "{name} {model}: {key}");
                }
            }
        }
    }

    #[test]
    fn every_publication_is_cited() {
        let cited: BTreeSet<&str> = MODELS
            .iter()
            .flat_map(|(_, models)| models.iter().flat_map(|(_, keys)| keys.iter().copied()))
            .collect();
        for publication in bibliography::all() {
            assert!(
                cited.contains(publication.key.as_str()),
                "{}",
                publication.key
            );
        }
    }

    fn cited(example: &str, set: &[&str]) -> Vec<String> {
        let set: Vec<String> = set.iter().map(|&text| text.into()).collect();
        let text = examples::find(example).unwrap().text;
        let document = Document::read(text, &set, Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let list = citations(&plan);
        list.iter()
            .map(|c| format!("{}:{}", c.family, c.model))
            .collect()
    }

    #[test]
    fn a_case_cites_the_models_that_it_uses_and_no_others() {
        let cavity = cited("cavity", &[]);
        let expected = [
            "lattice:d2q9",
            "collision:trt",
            "boundary:no_slip",
            "boundary:moving_wall",
        ];
        assert_eq!(cavity, expected);
        let piping = cited("piping", &[]);
        for model in [
            "contact:cohesive_frictional",
            "analysis:erosion_law",
            "coupling:bounce_back",
        ] {
            assert!(piping.iter().any(|m| m == model), "{model}: {piping:?}");
        }
        assert!(!piping.iter().any(|m| m.starts_with("drag:")));
        let vortices = cited("taylor-green", &[]);
        assert!(vortices.contains(&"initial:taylor_green".to_owned()));
    }

    #[test]
    fn all_examples_cite_their_fluid_or_their_contacts() {
        for example in &examples::EXAMPLES {
            let document = Document::read(example.text, &[], Path::new(".")).unwrap();
            let plan = Plan::prepare(document).unwrap();
            let list = citations(&plan);
            let has = |family: &str| list.iter().any(|c| c.family == family);
            assert_eq!(
                has("lattice"),
                plan.scene.flow.is_some(),
                "{}",
                example.name
            );
            assert_eq!(
                has("seepage"),
                plan.scene.seepage.is_some(),
                "{}",
                example.name
            );
            assert_eq!(
                has("contact"),
                plan.scene.contact.is_some(),
                "{}",
                example.name
            );
            let all = publications(&list);
            assert!(!all.is_empty() && all.windows(2).all(|p| p[0].key < p[1].key));
        }
    }
}
