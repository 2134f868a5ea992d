//! Every key of every example case is removed, misspelt or set to an invalid value: the program returns a plan or
//! problems with a path, and never panics.

use crate::ranks::Cores;
use serde_json::{Value, json};
use solver::case::Document;
use solver::case::examples::EXAMPLES;
use solver::plan::Plan;
use std::path::Path;
use std::time::Duration;

/// Maximum processor time of a mutant, ten times the usual second.
pub(crate) const HANG: Duration = Duration::from_secs(10);

/// Returns the processor time of this thread, which excludes other work on the machine.
pub(crate) fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|n| n.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or(0))
}

/// Collects JSON pointers of all nodes of the tree except the root; of a long list only the first three entries and
/// the last, because the others are similar.
fn pointers(node: &Value, at: &str, found: &mut Vec<String>) {
    let children: Vec<(String, &Value)> = match node {
        Value::Object(map) => map
            .iter()
            .map(|(k, v)| (k.replace('~', "~0").replace('/', "~1"), v))
            .collect(),
        Value::Array(list) => list
            .iter()
            .enumerate()
            .filter(|(n, _)| *n < 3 || n + 1 == list.len())
            .map(|(n, v)| (n.to_string(), v))
            .collect(),
        _ => return,
    };
    for (key, child) in children {
        let path = format!("{at}/{key}");
        found.push(path.clone());
        pointers(child, &path, found);
    }
}

fn replacements() -> Vec<Value> {
    vec![
        json!(-1),
        json!(0),
        json!(1e308),
        json!(-1e308),
        json!(1e-300),
        json!(18_446_744_073_709_551_615_u64),
        json!("text"),
        json!(""),
        json!(true),
        json!(null),
        json!([]),
        json!({}),
        json!([1e308, 0, -1, 2]),
        json!({"unknown": 1}),
    ]
}

/// Returns `true` if the case was accepted.
fn judge(text: &str, what: &str) -> bool {
    let start = processor_time();
    let result = Document::read(text, &[], Path::new("")).and_then(Plan::prepare);
    let taken = processor_time() - start;
    assert!(taken < HANG, "{what}: {taken:?}");
    let accepted = result.is_ok();
    if let Ok(plan) = &result {
        assert!(
            plan.clock.time_step > 0.0 && plan.clock.time_step.is_finite(),
            "{what}"
        );
        assert!(plan.estimate.memory_bytes.is_finite(), "{what}");
        assert!(!plan.to_string().contains("NaN"), "{what}: {plan}");
    }
    let problems = match result {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    };
    for problem in &problems {
        assert!(
            !problem.path.is_empty() && !problem.reason.is_empty() && !problem.remedy.is_empty(),
            "{what}: {problem:?}"
        );
        assert_ne!(
            problem.value, "not readable",
            "{what}: the schema missed {problem:?}"
        );
    }
    assert!(
        accepted || !problems.is_empty(),
        "{what}: refused without a reason"
    );
    accepted
}

#[test]
fn no_mutant_of_an_example_panics() {
    let (mut tried, mut accepted) = (0, 0);
    for example in EXAMPLES {
        let _core = Cores::acquire(1);
        let original: Value = serde_json::from_str(example.text).unwrap();
        let mut paths = Vec::new();
        pointers(&original, "", &mut paths);
        for (n, path) in paths.iter().enumerate() {
            // Every node of every example is mutated with some of the mutations; neighbouring nodes receive the
            // others.
            for value in replacements().into_iter().skip(n % 14).step_by(14) {
                let mut mutant = original.clone();
                *mutant.pointer_mut(path).unwrap() = value.clone();
                accepted += usize::from(judge(
                    &mutant.to_string(),
                    &format!("{} {path} = {value}", example.name),
                ));
                tried += 1;
            }
            if n % 3 != 0 {
                continue;
            }
            let (parent, key) = path.rsplit_once('/').unwrap();
            let mut mutant = original.clone();
            match mutant.pointer_mut(parent).unwrap() {
                Value::Object(map) => {
                    let value = map.remove(key).unwrap();
                    judge(
                        &mutant.to_string(),
                        &format!("{} without {path}", example.name),
                    );
                    if let Some(Value::Object(map)) = mutant.pointer_mut(parent) {
                        map.insert(format!("{key}_x"), value);
                    }
                    let what = format!("{} with {path}_x", example.name);
                    // Names of materials are arbitrary, and notes of sources are kept.
                    let refused = !judge(&mutant.to_string(), &what);
                    assert!(
                        refused || path.starts_with("/materials/"),
                        "{what} was accepted"
                    );
                    tried += 2;
                }
                Value::Array(list) => {
                    list.remove(key.parse().unwrap());
                    judge(
                        &mutant.to_string(),
                        &format!("{} without {path}", example.name),
                    );
                    tried += 1;
                }
                _ => {}
            }
        }
    }
    assert!(tried > 1000, "{tried}");
    assert!(
        accepted > 100,
        "some mutants are good cases: {accepted} of {tried}"
    );
}

proptest::proptest! {
    #[test]
    fn no_text_panics(text in ".{0,200}") {
        judge(&text, &text);
    }

    #[test]
    fn no_truncated_example_panics(which in 0_usize..EXAMPLES.len(), cut in 0.0_f64..1.0) {
        let chars: Vec<char> = EXAMPLES[which].text.chars().collect();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "a \
            fraction of a short text")]
        let count = (chars.len() as f64 * cut) as usize;
        let text: String = chars[..count].iter().collect();
        proptest::prop_assert!(!judge(&text, "truncated") || count + 2 > chars.len());
    }

    #[test]
    fn any_number_in_any_leaf_gives_an_answer(which in 0_usize..EXAMPLES.len(), leaf in 0_usize..1000,
        exponent in -40.0_f64..40.0, negative: bool) {
        let _core = Cores::acquire(1);
        let mut case: Value = serde_json::from_str(EXAMPLES[which].text).unwrap();
        let mut paths = Vec::new();
        pointers(&case, "", &mut paths);
        paths.retain(|p| case.pointer(p).is_some_and(Value::is_number));
        let path = &paths[leaf % paths.len()];
        let value = 10.0_f64.powf(exponent) * if negative { -1.0 } else { 1.0 };
        *case.pointer_mut(path).unwrap() = json!(value);
        judge(&case.to_string(), &format!("{} {path} = {value:e}", EXAMPLES[which].name));
    }
}
