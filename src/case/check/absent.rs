//! Features that this program does not have, with the alternative for each.
//!
//! For a field or choice with one of these names the alternative is reported instead of a similar name. README.md
//! has the list for users, and a test compares both.

/// Feature that the program does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Absent {
    /// Beginnings of words, in lower case without separators.
    words: &'static [&'static str],
    /// Name of the feature.
    pub feature: &'static str,
    /// Closest alternative.
    pub alternative: &'static str,
}

const fn absent(
    words: &'static [&'static str],
    feature: &'static str,
    alternative: &'static str,
) -> Absent {
    Absent {
        words,
        feature,
        alternative,
    }
}

/// Absent features, in the order of README.md.
pub const ABSENT: [Absent; 10] = [
    absent(
        &[
            "multiphase",
            "twophase",
            "gas",
            "bubble",
            "airphase",
            "immiscible",
        ],
        "two fluids, gas and bubbles",
        "compute with one liquid",
    ),
    absent(
        &[
            "clump",
            "multisphere",
            "superquadric",
            "superellipsoid",
            "ellipsoid",
            "spherocylinder",
        ],
        "clumps of spheres and ellipsoids",
        "use convex `blocks`, polyhedral `bodies`, or spheres held together by bonds (`grains.bond_at_start`)",
    ),
    absent(
        &["breakage", "crushing", "fragment", "fracture"],
        "grains and blocks that break",
        "build them from spheres held together by bonds, or cut the rock by `joints`",
    ),
    absent(
        &[
            "temperature",
            "thermal",
            "heat",
            "buoyancy",
            "boussinesq",
            "cooling",
            "freezing",
            "boiling",
        ],
        "heat and buoyancy",
        "set density and viscosity to the values at the temperature of the water",
    ),
    absent(
        &[
            "concentration",
            "solute",
            "scalar",
            "chemistry",
            "diffusion",
            "salinity",
            "tracer",
        ],
        "dissolved substances",
        "write `output.fluid` and transport them with another program",
    ),
    absent(
        &[
            "nonnewtonian",
            "bingham",
            "herschel",
            "yieldstress",
            "carreau",
            "powerlawfluid",
            "rheology",
        ],
        "non-Newtonian fluids",
        "use one viscosity, for the shear rate of the flow",
    ),
    absent(
        &[
            "deformable",
            "elasticstructure",
            "fluidstructure",
            "membrane",
            "flexible",
        ],
        "structures that deform",
        "structures are rigid; use bonded grains or `blocks` where they may move",
    ),
    absent(
        &[
            "refinement",
            "adaptive",
            "amr",
            "multilevel",
            "octree",
            "nestedgrid",
        ],
        "grids with local refinement",
        "choose one spacing that resolves the smallest feature, and run on more ranks; seepage without grains grades \
         its cells by `fluid.darcy.grid.spacing`",
    ),
    absent(
        &[
            "electric",
            "electro",
            "charge",
            "magnet",
            "vanderwaals",
            "jkr",
            "dlvo",
        ],
        "electric, magnetic and surface forces between grains",
        "use a contact law with `attraction` or bonds",
    ),
    absent(
        &["acoustic", "shock", "supersonic", "seismic", "earthquake"],
        "sound, shocks and earthquakes",
        "keep speeds far below that of sound; move walls with a `velocity`",
    ),
];

/// Feature that other programs state under another name.
struct Renamed {
    /// Beginnings of words, in lower case without separators.
    words: &'static [&'static str],
    /// Name of the feature.
    feature: &'static str,
    /// Field of a case that provides the feature.
    field: &'static str,
}

/// Features under other names.
const RENAMED: [Renamed; 4] = [
    Renamed {
        words: &["surfacetension"],
        feature: "surface tension of water",
        field: "fluid.lattice_boltzmann.surface.surface_tension",
    },
    Renamed {
        words: &["freesurface", "vof", "levelset", "watersurface", "dambreak"],
        feature: "a free surface of water",
        field: "fluid.lattice_boltzmann.surface",
    },
    Renamed {
        words: &["unsaturated", "suction", "richards", "phreatic"],
        feature: "unsaturated soil",
        field: "fluid.darcy.unsaturated",
    },
    Renamed {
        words: &["capillary", "liquidbridge"],
        feature: "capillary bridges between grains",
        field: "contact.linear.bridges",
    },
];

/// Returns the name of the feature for which a name stands and the field that provides it; none if no field does.
#[must_use]
pub(super) fn elsewhere(name: &str) -> Option<(&'static str, &'static str)> {
    let renamed = RENAMED
        .iter()
        .find(|renamed| has_word(name, renamed.words))?;
    Some((renamed.feature, renamed.field))
}

/// Returns the feature that a name stands for, if one of its words, or several joined, begin with a word of the
/// feature.
#[must_use]
pub(super) fn feature(name: &str) -> Option<&'static Absent> {
    ABSENT.iter().find(|absent| has_word(name, absent.words))
}

/// Returns `true` if one of the words of a name, or several joined, begin with one of `sought`.
fn has_word(name: &str, sought: &[&str]) -> bool {
    let mut words: Vec<String> = Vec::new();
    let mut before = None;
    for c in name.chars().take(100) {
        let begins = before
            .is_none_or(|b: char| !b.is_alphanumeric() || b.is_lowercase() && c.is_uppercase());
        before = Some(c);
        if c.is_alphanumeric() {
            if begins {
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.extend(c.to_lowercase());
            }
        }
    }
    let from: Vec<String> = (0..words.len()).map(|n| words[n..].concat()).collect();
    sought.iter().any(|word| match word.len() {
        // Short words must match entirely: `gas` is not part of `gasket`.
        ..5 => words.iter().any(|w| w == word),
        _ => from.iter().any(|text| text.starts_with(*word)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_absent_features_are_recognised() {
        for (name, found) in [
            ("clumps", "clumps of spheres and ellipsoids"),
            ("gas", "two fluids, gas and bubbles"),
            ("adaptive_refinement", "grids with local refinement"),
            ("temperature", "heat and buoyancy"),
            (
                "electric",
                "electric, magnetic and surface forces between grains",
            ),
            (
                "surface_charge",
                "electric, magnetic and surface forces between grains",
            ),
            (
                "magnetic",
                "electric, magnetic and surface forces between grains",
            ),
        ] {
            assert_eq!(
                feature(name).map(|absent| absent.feature),
                Some(found),
                "{name}"
            );
        }
        for name in [
            "free_slip",
            "save",
            "spcing",
            "velocty",
            "gasket",
            "absolute",
            "",
        ] {
            assert_eq!(feature(name), None, "{name}");
        }
    }

    /// Checks that the name of an absent feature is answered by the alternative wherever a field or a choice is
    /// written.
    #[test]
    fn a_case_with_an_absent_feature_is_told_the_alternative() {
        let text = crate::examples::find("deposition").unwrap().text;
        let value = serde_json::json!(1);
        for name in [
            "electric",
            "temperature",
            "magnetic",
            "gas",
            "salinity",
            "amr",
        ] {
            for place in [
                "",
                "/domain",
                "/materials/glass",
                "/output",
                "/output/grains",
            ] {
                let mut tree: serde_json::Value = serde_json::from_str(text).unwrap();
                let Some(object) = tree.pointer_mut(place).and_then(|at| at.as_object_mut()) else {
                    assert!(place.contains("materials"), "{place}");
                    continue;
                };
                object.insert(name.into(), value.clone());
                let problems = crate::check::against_schema(&mut tree).problems;
                assert_eq!(problems.len(), 1, "{place} {name}: {problems:?}");
                let told = problems[0].to_string();
                assert!(told.contains("this program does not compute"), "{told}");
                assert!(!told.contains("did you mean"), "{told}");
            }
        }
        let mut tree: serde_json::Value = serde_json::from_str(text).unwrap();
        tree["domain"]["periodic"] = serde_json::json!(["temperature"]);
        tree["output"]["fluid"] = serde_json::json!({"every": 1, "fields": ["temperature"]});
        let problems = crate::check::against_schema(&mut tree).problems;
        assert_eq!(problems.len(), 2, "{problems:?}");
        for problem in problems {
            assert!(
                problem.reason.contains("does not compute heat"),
                "{problem}"
            );
        }
    }

    #[test]
    fn features_under_other_names_lead_to_their_fields() {
        let field = |name| elsewhere(name).map(|(_, field)| field);
        assert_eq!(field("liquidBridges"), Some("contact.linear.bridges"));
        assert_eq!(field("matric_suction"), Some("fluid.darcy.unsaturated"));
        assert_eq!(field("bridges"), None);
    }

    #[test]
    fn the_readme_lists_every_feature_and_its_alternative() {
        let readme = include_str!("../../../README.md");
        let section = readme
            .split("## What it does not do")
            .nth(1)
            .unwrap_or_default();
        let section = section.split("\n## ").next().unwrap_or_default();
        for absent in ABSENT {
            let row = format!("| {} | {} |", absent.feature, absent.alternative);
            assert!(section.contains(&row), "README.md lacks: {row}");
        }
    }

    #[test]
    fn no_feature_is_a_field_of_a_case() {
        fn names(node: &serde_json::Value, found: &mut Vec<String>) {
            if let Some(fields) = node["properties"].as_object() {
                found.extend(fields.keys().cloned());
            }
            found.extend(node["const"].as_str().map(str::to_owned));
            match node {
                serde_json::Value::Object(map) => {
                    map.values().for_each(|child| names(child, found))
                }
                serde_json::Value::Array(list) => list.iter().for_each(|child| names(child, found)),
                _ => {}
            }
        }
        let mut found = Vec::new();
        names(&crate::check::bare_schema(), &mut found);
        assert!(found.len() > 100);
        for name in found {
            assert_eq!(feature(&name), None, "{name}");
        }
    }
}
