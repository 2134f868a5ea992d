//! An eddy viscosity requires one file and one line: the toy is its file and its line in the list below.

#![allow(unreachable_pub, reason = "a list of models makes public items")]

use super::*;

family! {
    dispatch each_toy;
    /// Eddy viscosities of this test.
    #[derive(Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(transform = describe_choices)]
    enum Models {
        toy: Toy(Toy),
    }
}

#[test]
fn an_eddy_viscosity_is_one_file_and_one_line() {
    let toy: Models = serde_json::from_str(r#"{"toy": {"factor": 2}}"#).unwrap();
    assert!(serde_json::from_str::<Models>(r#"{"toy": {}}"#).is_err());
    assert_eq!(toy.name(), "toy");
    assert_eq!(
        each_toy!(&toy, toy => toy.describe()).model,
        "toy, factor 2"
    );
    assert!(each_toy!(&toy, toy => toy.check("turbulence", 2)).is_none());
    let mut gradient = [[0.0; 3]; 3];
    gradient[0][1] = 0.01;
    assert_eq!(each_toy!(&toy, toy => toy.viscosity(&gradient)), 0.02);
    assert_eq!(each_toy!(&toy, toy => toy.fraction(&gradient)), (0.02, 1.0));
    let schema = schemars::schema_for!(Models).to_value();
    assert_eq!(schema["oneOf"][0]["description"], "Toy eddy viscosity.");
}

/// Checks that WALE is refused in 2-D, with its path in the case.
#[test]
fn models_judge_their_domain() {
    let wale: EddyViscosity = serde_json::from_str(r#"{"wale": {}}"#).unwrap();
    assert!(wale.check("fluid.turbulence", 3).is_none());
    let finding = wale.check("fluid.turbulence", 2).unwrap();
    assert_eq!(finding.path, "fluid.turbulence.wale");
    let smagorinsky: EddyViscosity = serde_json::from_str(r#"{"smagorinsky": {}}"#).unwrap();
    assert!(smagorinsky.check("fluid.turbulence", 2).is_none());
}
