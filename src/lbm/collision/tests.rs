//! An operator requires one file and one line: the toy is its file and its line in the list below.

#![allow(unreachable_pub, reason = "a list of models makes public items")]

use super::*;
use crate::lattice::D2Q9;

family! {
    dispatch each_toy;
    /// Collision operators of this test.
    #[derive(Debug, Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    #[schemars(transform = describe_choices)]
    enum Operators: dyn CollisionModel {
        toy: Toy(Parameters),
    }
}

/// Collides a cell of D2Q9 with the kernel of a pass without force and eddies.
struct Collide([f64; 9]);

impl Dispatch for Collide {
    type Output = Option<[f64; 9]>;

    fn on_any_set<K: Kernels>(mut self, kernels: K) -> Self::Output {
        let kernel = kernels.uniform::<false>(1.0, [0.0; 3]);
        kernel.collide::<D2Q9, f64, _, 9>(&mut self.0, &kernel.uniform());
        Some(self.0)
    }

    fn on_d3q27<K: Kernels>(self, _: K) -> Self::Output {
        None
    }
}

#[test]
fn an_operator_is_one_file_and_one_line() {
    let read = |text| serde_json::from_str::<Operators>(text);
    let toy = read(r#"{"toy": {"strength": 0.5}}"#).unwrap();
    assert!(read(r#"{"toy": {"strength": 0.5, "magic": 1}}"#).is_err());
    assert_eq!(
        serde_json::to_string(&toy).unwrap(),
        r#"{"toy":{"strength":0.5}}"#
    );
    assert_eq!(toy.name(), "toy");
    assert_eq!(toy.model().describe(0.8).model, "a toy of strength 0.5");
    assert!(toy.model().check("collision", 0.8).is_none());
    let cell = [0.1, 0.3, 0.0, -0.1, 0.2, 0.0, 0.05, 0.0, -0.02];
    let after = each_toy!(&toy, toy => toy.dispatch(Collide(cell))).unwrap();
    assert_eq!(after, cell.map(|g| 0.5 * g));
    assert!(each_toy!(&toy, toy => toy.dispatch_single(Collide(cell))).is_none());
}

/// Checks that the schema names each operator and describes it by the documentation of its parameters.
#[test]
fn the_schema_takes_the_texts_of_the_operators() {
    let schema = schemars::schema_for!(Operators).to_value();
    let choices = schema["oneOf"].as_array().unwrap();
    assert_eq!(choices.len(), 1);
    assert_eq!(
        choices[0]["description"],
        "Operator of this test, which scales the incoming populations."
    );
    assert!(choices[0]["properties"]["toy"].get("description").is_none());
    assert_eq!(
        choices[0]["properties"]["toy"]["properties"]["strength"]["description"],
        "Factor of the populations, without unit."
    );
    assert_eq!(choices[0]["required"][0], "toy");
}

/// Checks that operators with a stated antisymmetric rate are those with two relaxation times per cell.
#[test]
fn the_names_in_a_case_are_those_of_the_modules() {
    for (text, name, rates) in [
        (r#"{"bgk": {}}"#, "bgk", true),
        (r#"{"trt": {}}"#, "trt", true),
        (r#"{"mrt": {"higher": 1}}"#, "mrt", false),
        (r#"{"suga": {"q": 1.2}}"#, "suga", false),
        (r#"{"cumulant": {}}"#, "cumulant", false),
    ] {
        let operator: Operator = serde_json::from_str(text).unwrap();
        assert_eq!(operator.name(), name);
        let model = operator.model();
        assert_eq!(model.antisymmetric_rate().is_some(), rates, "{name}");
        assert_eq!(model.only_on().is_none(), rates, "{name}");
    }
    assert_eq!(
        serde_json::to_string(&Operator::default()).unwrap(),
        r#"{"trt":{"magic":0.1875}}"#
    );
}
