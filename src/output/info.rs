//! Description of a file or folder of a run as text or JSON: `solver info`.
//!
//! | given | output |
//! |---|---|
//! | a folder | outcome of the run, its series, tables and checkpoints |
//! | `.vtkhdf`, `.h5` | step, time, datasets with shape and unit, provenance |
//! | `.xmf` | steps and times of the series |
//! | `checkpoint_*.json` | contents, and whether all checksums agree |
//! | other `.json` | its content |
//! | `.csv` | columns, number of rows, last row |

use base::error::Error;
use io::csv::Reader;
use io::{Alone, Series};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Describes a file or folder as JSON, or as text if `json` is `false`. Serial.
///
/// # Errors
/// If it cannot be read or is of no known kind. A damaged checkpoint is described without an error, [`Error::Io`].
pub fn info(path: &Path, json: bool) -> Result<String, Error> {
    let value = if path.is_dir() {
        folder(path)?
    } else {
        file(path)?
    };
    if json {
        return serde_json::to_string_pretty(&value)
            .map(|text| text + "\n")
            .map_err(|error| Error::Internal(error.to_string()));
    }
    let mut text = format!("{}\n", path.display());
    write_value(&mut text, &value, 1);
    Ok(text)
}

fn failed(path: &Path, reason: impl std::fmt::Display) -> Error {
    Error::Io(format!("{}: {reason}", path.display()))
}

fn extension(path: &Path) -> &str {
    path.extension().and_then(|e| e.to_str()).unwrap_or("")
}

fn name(path: &Path) -> String {
    path.file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

fn is_checkpoint(path: &Path) -> bool {
    name(path).starts_with("checkpoint_") && extension(path) == "json"
}

fn file(path: &Path) -> Result<Value, Error> {
    match extension(path) {
        "vtkhdf" | "h5" | "hdf5" => hdf(path),
        "xmf" => series(path),
        "csv" => table(path),
        "json" if is_checkpoint(path) => Ok(checkpoint(path, true)),
        "json" => read_json(path),
        _ if path.exists() => Err(failed(
            path,
            "this is not a file of a run; `info` reads folders, .vtkhdf, .h5, .xmf, .csv and .json",
        )),
        _ => Err(failed(path, "this file or folder does not exist")),
    }
}

fn read_json(path: &Path) -> Result<Value, Error> {
    let text =
        io::plain::text(path, io::plain::LONGEST_CASE).map_err(|e| Error::Io(e.to_string()))?;
    serde_json::from_str(&text).map_err(|error| failed(path, error))
}

/// Returns the description of a folder and of the folders in it, one level deep: checkpoints may have their own
/// folder.
fn folder(path: &Path) -> Result<Value, Error> {
    let mut files = Vec::new();
    for entry in entries(path)? {
        if entry.is_dir() {
            files.extend(entries(&entry)?.into_iter().filter(|file| file.is_file()));
        } else {
            files.push(entry);
        }
    }
    let mut all = Map::new();
    let mut found = |kind: &str, one: &Path, value: Value| {
        let Value::Object(list) = all.entry(kind).or_insert_with(|| json!({})) else {
            return;
        };
        let short = one.strip_prefix(path).unwrap_or(one);
        list.insert(short.display().to_string(), value);
    };
    // A file that cannot be read is reported in its own entry and does not hide the others.
    let described = |result: Result<Value, Error>| result.unwrap_or_else(|e| json!(e.to_string()));
    for one in &files {
        match extension(one) {
            "xmf" => found("series", one, described(series(one))),
            "csv" => found("tables", one, described(table(one))),
            "json" if is_checkpoint(one) => found("checkpoints", one, checkpoint(one, false)),
            "json" if name(one) == "summary.json" => {
                found("summary", one, described(read_json(one)))
            }
            "part" => found("unfinished", one, Value::Null),
            _ => {}
        }
    }
    if all.is_empty() {
        return Err(failed(path, "this folder contains no file of a run"));
    }
    Ok(Value::Object(all))
}

fn entries(path: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut all = std::fs::read_dir(path)
        .and_then(Iterator::collect::<std::io::Result<Vec<_>>>)
        .map_err(|error| failed(path, error))?
        .into_iter()
        .map(|entry| entry.path())
        .collect::<Vec<_>>();
    all.sort();
    Ok(all)
}

fn hdf(path: &Path) -> Result<Value, Error> {
    let info = io::fields::inspect(path).map_err(|error| Error::Io(error.to_string()))?;
    let mut all = Map::new();
    for (group, key, label) in [
        ("/VTKHDF", "Type", "type"),
        ("/output", "step", "step"),
        ("/output", "time", "time"),
        ("/VTKHDF", "WholeExtent", "extent"),
        ("/VTKHDF", "Origin", "origin"),
        ("/VTKHDF", "Spacing", "spacing"),
    ] {
        if let Some(value) = info.attribute(group, key) {
            all.insert(label.to_owned(), value.clone());
        }
    }
    let mut datasets = Map::new();
    let mut texts = Map::new();
    for dataset in &info.datasets {
        if dataset.path.starts_with("/provenance/") {
            texts.insert(dataset.name().to_owned(), json!({ "shape": dataset.shape }));
            continue;
        }
        let shape: Vec<String> = dataset.shape.iter().map(ToString::to_string).collect();
        let kind = dataset.kind.map_or_else(
            || "other".to_owned(),
            |kind| format!("{kind:?}").to_lowercase(),
        );
        let unit = match &dataset.units {
            Some(unit) if unit != "-" => format!(" [{unit}]"),
            _ => String::new(),
        };
        let line = format!("{kind} {}{unit}", shape.join(" x "));
        datasets.insert(dataset.path.clone(), json!(line));
    }
    all.insert("datasets".to_owned(), Value::Object(datasets));
    if let Some((_, attributes)) = info.groups.iter().find(|g| g.0 == "/provenance") {
        texts.extend(attributes.iter().cloned());
    }
    if !texts.is_empty() {
        all.insert("provenance".to_owned(), Value::Object(texts));
    }
    Ok(Value::Object(all))
}

fn series(path: &Path) -> Result<Value, Error> {
    let parent = path.parent().unwrap_or(Path::new("."));
    let stem = path
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default();
    if !path.exists() {
        return Err(failed(path, "this file or folder does not exist"));
    }
    let series =
        Series::open(parent, &stem, &Alone).map_err(|error| Error::Io(error.to_string()))?;
    let moments: Vec<_> = series.moments().collect();
    let mut all = Map::new();
    all.insert("outputs".to_owned(), json!(moments.len()));
    for (label, moment) in [("first", moments.first()), ("last", moments.last())] {
        if let Some(moment) = moment {
            all.insert(
                label.to_owned(),
                json!({
                    "step": moment.step,
                    "time": moment.time,
                    "file": name(&series.data_path(moment.step)),
                }),
            );
        }
    }
    Ok(Value::Object(all))
}

fn table(path: &Path) -> Result<Value, Error> {
    let text =
        io::plain::text(path, io::plain::LONGEST_TABLE).map_err(|e| Error::Io(e.to_string()))?;
    // A last line without a line end is a row that is being written.
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let (mut rows, mut last, mut headings) = (0_u64, None, Vec::new());
    if let Some(mut reader) = Reader::new(whole) {
        while let Some(row) = reader.row() {
            rows += 1;
            last = Some(row.cells().collect::<Vec<_>>().join(","));
        }
        let (names, units) = (reader.names(), reader.units());
        headings = names
            .iter()
            .enumerate()
            .map(|(k, name)| match units.get(k) {
                Some(unit) if *unit != "-" && !unit.is_empty() => format!("{name} [{unit}]"),
                _ => (*name).to_owned(),
            })
            .collect();
    }
    let mut all = Map::new();
    all.insert("columns".to_owned(), json!(headings.join(", ")));
    all.insert("rows".to_owned(), json!(rows));
    if let Some(last) = last {
        all.insert("last".to_owned(), json!(last));
    }
    Ok(Value::Object(all))
}

/// Returns the description of a checkpoint from its manifest, with the checksums verified.
fn checkpoint(path: &Path, arrays: bool) -> Value {
    let manifest = match io::checkpoint::verify(path, &Alone) {
        Ok(found) => found.manifest,
        Err(error) => return json!({ "sound": false, "reason": error.to_string() }),
    };
    let mut all = json!({
        "sound": true,
        "step": manifest.step,
        "time": manifest.time,
        "file": manifest.file,
        "bytes": manifest.bytes,
    });
    if arrays && let Value::Object(all) = &mut all {
        all.insert("blake3".to_owned(), json!(manifest.blake3));
        all.insert("attributes".to_owned(), manifest.attributes);
        let list = manifest.arrays.iter().map(|array| {
            let shape: Vec<String> = array.shape.iter().map(ToString::to_string).collect();
            let kind = format!("{:?}", array.kind).to_lowercase();
            (
                array.name.clone(),
                json!(format!("{kind} {}", shape.join(" x "))),
            )
        });
        all.insert("arrays".to_owned(), Value::Object(list.collect()));
    }
    all
}

/// Writes nested names and values, indented by two spaces per level.
fn write_value(text: &mut String, value: &Value, level: usize) {
    let indent = "  ".repeat(level);
    // Writing to a String cannot fail.
    match value {
        Value::Object(fields) => {
            let width = fields
                .iter()
                .filter(|(_, value)| !value.is_object())
                .map(|(key, _)| key.chars().count())
                .max()
                .unwrap_or(0);
            for (key, value) in fields {
                if value.is_object() {
                    let _ = writeln!(text, "{indent}{key}");
                    write_value(text, value, level + 1);
                } else {
                    let _ = writeln!(text, "{indent}{key:width$}  {}", plain(value));
                }
            }
        }
        other => {
            let _ = writeln!(text, "{indent}{}", plain(other));
        }
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => String::new(),
        Value::Array(list) if !list.iter().any(|v| v.is_object() || v.is_array()) => {
            list.iter().map(plain).collect::<Vec<_>>().join(", ")
        }
        other => other.to_string(),
    }
}
