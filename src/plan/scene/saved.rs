//! Names of files that a case saves into the folder of its run: plain names that differ from the names of the
//! program's own files.

use super::findings::Findings;
use case::Case;
use std::path::Path;

/// File names reserved for the program.
const RESERVED_NAMES: [&str; 25] = [
    "averages_profile.csv",
    "backward_erosion.csv",
    "bonds.csv",
    "case.json",
    "checkpoints",
    "clusters.csv",
    "collapse.csv",
    "collapse.svg",
    "collapse_points.csv",
    "crossings.csv",
    "erosion.csv",
    "erosion_law.csv",
    "erosion_law.json",
    "erosion_points.csv",
    "erosion_readings.csv",
    "errors.txt",
    "log.txt",
    "member.json",
    "picture.svg",
    "preparation",
    "removed.csv",
    "settlement.svg",
    "stop",
    "summary.json",
    "surface.csv",
];
/// Endings reserved for series, checkpoints and incomplete files.
const OWN_ENDINGS: [&str; 5] = [".xmf", ".vtkhdf", ".h5", ".part", ".lock"];
/// Beginnings reserved for tables and checkpoints.
const OWN_BEGINNINGS: [&str; 3] = ["probe_", "checkpoint", "."];
/// Maximum length of a name \[bytes\], which leaves space for the ending of an incomplete file.
const LONGEST: usize = 200;

/// Checks all names that a case gives to files of its run.
pub(crate) fn names(case: &Case, findings: &mut Findings) {
    let grains = case.grains.as_ref().and_then(|grains| grains.save.as_ref());
    let blocks = case.blocks.as_ref().and_then(|blocks| blocks.save.as_ref());
    for (path, written, example) in [
        ("grains.save", grains, "sample.csv"),
        ("blocks.save", blocks, "blocks.json"),
    ] {
        if let Some(reason) = written.and_then(|name| invalid_name(name)) {
            let remedy = format!("write a file name such as \"{example}\"");
            findings.error(path, reason, remedy);
        }
    }
    if grains.is_some() && grains == blocks {
        findings.error(
            "blocks.save",
            "grains and blocks would be saved under the same name",
            "write a file name such as \"blocks.json\"",
        );
    }
}

/// Returns the reason why a name is not valid in the folder of the run; none if it is.
fn invalid_name(written: &Path) -> Option<String> {
    let name = written.to_str().unwrap_or_default();
    let plain = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_' | '.' | '+');
    if name.is_empty() || name.len() > LONGEST || !name.chars().all(plain) {
        return Some(format!(
            "the name of a file in the folder of the run has 1 to {LONGEST} bytes and consists of letters, \
             digits, spaces and - _ . + only"
        ));
    }
    let lower = name.to_lowercase();
    let own = RESERVED_NAMES.contains(&lower.as_str())
        || OWN_ENDINGS.iter().any(|end| lower.ends_with(end))
        || OWN_BEGINNINGS.iter().any(|begin| lower.starts_with(begin));
    own.then(|| "this name is reserved for files of the program, or it begins with a dot".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_names_that_are_free_pass() {
        for good in [
            "sample.csv",
            "blocks.json",
            "Sand 2+3-a.csv",
            "grün.csv",
            "probe.csv",
        ] {
            assert_eq!(invalid_name(Path::new(good)), None, "{good}");
        }
        for bad in [
            "", ".", "..", "/abs.csv", "../x.csv", "a/b.csv", "a\\b.csv", "a\nb", "a\0b", "~",
            "a:b", "*",
        ] {
            assert!(
                invalid_name(Path::new(bad)).is_some_and(|r| r.contains("folder"))
                    || bad.starts_with('.'),
                "{bad:?}"
            );
            assert!(invalid_name(Path::new(bad)).is_some(), "{bad:?}");
        }
        assert!(invalid_name(Path::new(&"a".repeat(201))).is_some());
        for own in RESERVED_NAMES.into_iter().chain([
            "CASE.JSON",
            "STOP",
            "probe_a.csv",
            "checkpoint_1.json",
            "fluid.xmf",
            "a.vtkhdf",
            "x.part",
            ".hidden",
        ]) {
            assert!(invalid_name(Path::new(own)).is_some(), "{own}");
        }
    }
}
