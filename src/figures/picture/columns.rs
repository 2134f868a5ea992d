//! Columns that a picture shows: those that the request names, and a field of the water without a request.

use super::PictureOptions;
use base::error::Error;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Fields of the water that a picture shows without a request, the first that is written.
const FIELDS: [&str; 7] = [
    "velocity",
    "pressure",
    "head",
    "saturation",
    "fill",
    "density",
    "stream_function",
];

/// Returns the field of the water that the request names, or the first of [`FIELDS`] in a file, or another one; `None`
/// if the file has no field.
pub(super) fn field_of_water(
    path: &Path,
    request: &PictureOptions,
) -> Result<Option<String>, Error> {
    let names = names_of_columns(path)?;
    if request.streamlines {
        asked(path, "--streamlines", "velocity", &names)?;
    }
    if let Some(field) = &request.field {
        asked(path, &format!("--field {field}"), field, &names)?;
        return Ok(Some(field.clone()));
    }
    let usual = FIELDS.into_iter().find(|field| names.contains(*field));
    let field = usual.or_else(|| {
        names
            .iter()
            .find(|name| *name != "solid")
            .map(String::as_str)
    });
    let field = field.or_else(|| names.first().map(String::as_str));
    Ok(field.map(str::to_owned))
}

/// Refuses options that name a column which a file does not have.
pub(super) fn check_columns<'a>(
    file: Option<PathBuf>,
    options: impl IntoIterator<Item = (&'a str, Option<&'a str>)>,
) -> Result<(), Error> {
    let named = options
        .into_iter()
        .filter_map(|(option, column)| Some((option, column?)));
    for (option, column) in named {
        if let Some(path) = &file {
            let option = format!("{option} {column}");
            asked(path, &option, column, &names_of_columns(path)?)?;
        }
    }
    Ok(())
}

/// Returns the names of the columns of a file.
fn names_of_columns(path: &Path) -> Result<BTreeSet<String>, Error> {
    let info = io::fields::inspect(path).map_err(|e| Error::Io(e.to_string()))?;
    Ok(info.columns().map(str::to_owned).collect())
}

/// Refuses an option whose column a file does not have.
fn asked(path: &Path, option: &str, column: &str, names: &BTreeSet<String>) -> Result<(), Error> {
    // The positions of grains are the points of their file.
    if names.contains(column) || column == "position" || column.starts_with('/') {
        return Ok(());
    }
    let there: Vec<&str> = names.iter().map(String::as_str).collect();
    Err(Error::Usage(format!(
        "{option}: {} has no {column}; it has {}. Name one of these, or add {column} to the outputs of the case and \
         run it again",
        path.display(),
        there.join(", ")
    )))
}
