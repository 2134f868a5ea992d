//! Reading of files: their contents, and any box of any dataset.
//!
//! The module is used by `info`, initial states from a file, and tests. Every rank reads independently.

use std::ffi::c_void;
use std::path::Path;

use hdf5::Location;
use hdf5::sync::sync;
use hdf5::types::{TypeDescriptor, VarLenAscii, VarLenUnicode};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::data::Kind;
use crate::error::{Error, Result};
use crate::hdf::{self, product};

/// Description of one dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DatasetInfo {
    /// Path from the root: `/VTKHDF/CellData/velocity`.
    pub path: String,
    /// Shape of the dataset.
    pub shape: Vec<usize>,
    /// Number type; none for a type that this crate does not write.
    pub kind: Option<Kind>,
    /// Unit, if it has one.
    pub units: Option<String>,
    /// All attributes of the dataset.
    pub attributes: Vec<(String, Value)>,
}

impl DatasetInfo {
    /// Returns the last part of the path.
    #[must_use]
    pub fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or_default()
    }
}

/// Contents of an HDF5 file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileInfo {
    /// Groups with their attributes, from the root.
    pub groups: Vec<(String, Vec<(String, Value)>)>,
    /// Datasets with their attributes.
    pub datasets: Vec<DatasetInfo>,
}

impl FileInfo {
    /// Returns an attribute of a group.
    #[must_use]
    pub fn attribute(&self, group: &str, name: &str) -> Option<&Value> {
        let (_, attributes) = self.groups.iter().find(|g| g.0 == group)?;
        attributes.iter().find(|a| a.0 == name).map(|a| &a.1)
    }

    /// Returns the names of the columns of cells and points; of a file without a mesh or an image, of all datasets.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        let of_mesh = |dataset: &&DatasetInfo| {
            let parts = ["/VTKHDF/CellData/", "/VTKHDF/PointData/"];
            parts.iter().any(|part| dataset.path.starts_with(part))
        };
        let mesh = self.groups.iter().any(|group| group.0 == "/VTKHDF");
        let columns = self.datasets.iter().filter(move |d| !mesh || of_mesh(d));
        columns.map(DatasetInfo::name)
    }

    /// Returns a dataset by its path.
    #[must_use]
    pub fn dataset(&self, path: &str) -> Option<&DatasetInfo> {
        self.datasets.iter().find(|d| d.path == path)
    }
}

/// Lists groups, datasets and attributes.
///
/// # Errors
/// If the file cannot be read, [`Error::Hdf`].
pub fn inspect(path: &Path) -> Result<FileInfo> {
    let file = hdf::open(path, None)?;
    let mut info = FileInfo {
        groups: Vec::new(),
        datasets: Vec::new(),
    };
    let walked = walk(&file, &mut info, 0).map_err(|e| Error::hdf(path, "list the file", &e));
    let closed = file
        .close()
        .map_err(|e| Error::hdf(path, "close the file", &e));
    walked.and(closed).map(|()| info)
}

/// Maximum nesting of groups, and maximum number of objects of a file: links may form a cycle.
const DEEPEST: usize = 32;
const MAX_OBJECTS: usize = 100_000;

fn walk(group: &hdf5::Group, info: &mut FileInfo, depth: usize) -> hdf5::Result<()> {
    if depth > DEEPEST || info.groups.len() + info.datasets.len() > MAX_OBJECTS {
        return Err(format!(
            "its groups nest more than {DEEPEST} deep, or it has more than {MAX_OBJECTS} objects"
        )
        .into());
    }
    info.groups.push((group.name(), attributes(group)?));
    for dataset in group.datasets()? {
        let attributes = attributes(&dataset)?;
        let units = attributes
            .iter()
            .find(|a| a.0 == "units")
            .and_then(|a| a.1.as_str())
            .map(str::to_owned);
        info.datasets.push(DatasetInfo {
            path: dataset.name(),
            shape: dataset.shape(),
            kind: hdf::kind_of(&dataset)?,
            units,
            attributes,
        });
    }
    for child in group.groups()? {
        walk(&child, info, depth + 1)?;
    }
    Ok(())
}

fn attributes(place: &Location) -> hdf5::Result<Vec<(String, Value)>> {
    let mut all = Vec::new();
    for name in place.attr_names()? {
        let value = attribute(place, &name)?;
        all.push((name, value));
    }
    Ok(all)
}

/// Returns an attribute as JSON: text, numbers and lists of numbers; null for anything else.
fn attribute(place: &Location, name: &str) -> hdf5::Result<Value> {
    let attribute = place.attr(name)?;
    let Ok(kind) = attribute.dtype()?.to_descriptor() else {
        return Ok(Value::Null);
    };
    let scalar = attribute.ndim() == 0;
    Ok(match kind {
        TypeDescriptor::FixedAscii(size) | TypeDescriptor::FixedUnicode(size) if scalar => {
            let memory = attribute.dtype()?;
            let mut bytes = vec![0_u8; size];
            // SAFETY: both handles are open, and the attribute is one string of exactly `size` bytes.
            hdf5::h5check(sync(|| unsafe {
                hdf5_sys::h5a::H5Aread(
                    attribute.id(),
                    memory.id(),
                    bytes.as_mut_ptr().cast::<c_void>(),
                )
            }))?;
            let end = bytes.iter().position(|&b| b == 0).unwrap_or(size);
            Value::from(String::from_utf8_lossy(&bytes[..end]).into_owned())
        }
        TypeDescriptor::VarLenUnicode if scalar => {
            Value::from(attribute.read_scalar::<VarLenUnicode>()?.as_str())
        }
        TypeDescriptor::VarLenAscii if scalar => {
            Value::from(attribute.read_scalar::<VarLenAscii>()?.as_str())
        }
        TypeDescriptor::Integer(_) | TypeDescriptor::Unsigned(_) => {
            one_or_many(scalar, attribute.read_raw::<i64>()?)
        }
        TypeDescriptor::Float(_) => one_or_many(scalar, attribute.read_raw::<f64>()?),
        _ => Value::Null,
    })
}

fn one_or_many<T: Into<Value> + Copy>(scalar: bool, values: Vec<T>) -> Value {
    match values.first() {
        Some(&first) if scalar => first.into(),
        _ => Value::Array(values.into_iter().map(Into::into).collect()),
    }
}

/// Reads one box of a dataset of any number type as f64.
///
/// # Errors
/// If there is no such dataset or the box is not in it, [`Error::Hdf`].
pub fn read_f64(path: &Path, dataset: &str, start: &[usize], count: &[usize]) -> Result<Vec<f64>> {
    let file = hdf::open(path, None)?;
    let read = || -> hdf5::Result<Vec<f64>> {
        let dataset = file.dataset(dataset)?;
        if !hdf::is_inside(start, count, &dataset.shape()) {
            return Err(format!(
                "no box at {start:?} of size {count:?} in {:?}",
                dataset.shape()
            )
            .into());
        }
        let mut values = vec![0.0; product(count)];
        hdf::read_box(&dataset, start, count, &mut values)?;
        Ok(values)
    };
    let values = read().map_err(|e| Error::hdf(path, &format!("read {dataset}"), &e));
    let closed = file
        .close()
        .map_err(|e| Error::hdf(path, "close the file", &e));
    values.and_then(|values| closed.map(|()| values))
}

/// Whole column of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// Shape, slowest axis first.
    pub shape: Vec<usize>,
    /// Unit, if it has one.
    pub units: Option<String>,
    /// Numbers of the column, in C order.
    pub values: Vec<f64>,
}

/// Returns the paths in a file at which a column of this name may be stored.
fn places(name: &str) -> Vec<String> {
    if name.starts_with('/') {
        vec![name.to_owned()]
    } else if name == "position" {
        vec!["/VTKHDF/Points".to_owned()]
    } else {
        vec![
            format!("/VTKHDF/CellData/{name}"),
            format!("/VTKHDF/PointData/{name}"),
            format!("/{name}"),
        ]
    }
}

/// Returns the shape of a column found as by [`find_column`]; only metadata are read from the file.
///
/// # Errors
/// If the file cannot be read ([`Error::Hdf`]), or has no such column of numbers ([`Error::Invalid`]).
pub fn column_shape(path: &Path, name: &str) -> Result<Vec<usize>> {
    let file = hdf::open(path, None)?;
    let mut found = None;
    for place in places(name) {
        // Without a dataset at this path, the next one is tried.
        if let Ok(dataset) = file.dataset(&place) {
            found = Some((dataset.shape(), hdf::kind_of(&dataset)));
            break;
        }
    }
    let closed = file
        .close()
        .map_err(|e| Error::hdf(path, "close the file", &e));
    match found {
        Some((shape, Ok(Some(_)))) => closed.map(|()| shape),
        Some(_) => Err(Error::invalid(
            &path.display().to_string(),
            format!("its column {name} holds no numbers"),
        )),
        None => Err(Error::invalid(
            &path.display().to_string(),
            format!("holds no column {name}"),
        )),
    }
}

/// Returns a column by its name (`velocity`, `position` for the points of a mesh) or by its path from the root.
///
/// # Errors
/// If there is no such column, [`Error::Invalid`] with the list of existing names.
pub fn find_column(info: &FileInfo, path: &Path, name: &str) -> Result<DatasetInfo> {
    places(name)
        .iter()
        .find_map(|place| info.dataset(place))
        .cloned()
        .ok_or_else(|| {
            let names: Vec<&str> = info.columns().collect();
            Error::invalid(
                &path.display().to_string(),
                format!("has no column {name}; its columns are {}", names.join(", ")),
            )
        })
}

/// Reads a whole column as f64.
///
/// # Errors
/// If the file cannot be read ([`Error::Hdf`]), or has no such column ([`Error::Invalid`]).
pub fn read_column(path: &Path, name: &str) -> Result<Values> {
    let found = find_column(&inspect(path)?, path, name)?;
    let values = read_f64(path, &found.path, &vec![0; found.shape.len()], &found.shape)?;
    Ok(Values {
        shape: found.shape,
        units: found.units,
        values,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hdf::{Attribute, Content, DatasetPart, Mode};
    use crate::{Alone, Data};

    #[test]
    fn everything_is_listed_and_missing_names_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.h5");
        let mut content = Content::default();
        content.folder(
            "/g",
            &[
                ("time", Attribute::Float(0.5)),
                ("text", Attribute::Text("grün".to_owned())),
                ("none", Attribute::Text(String::new())),
                ("list", Attribute::Ints(vec![3, 4])),
            ],
        );
        content.parts.push(DatasetPart {
            path: "/g/id".to_owned(),
            shape: vec![3],
            start: vec![0],
            count: vec![3],
            data: Data::I64(&[5, 6, 7]).into(),
            attributes: vec![("units".to_owned(), Attribute::Text("-".to_owned()))],
        });
        hdf::write(&path, &content, &Alone, Mode::Gather).unwrap();
        let info = inspect(&path).unwrap();
        assert_eq!(info.attribute("/g", "time"), Some(&Value::from(0.5)));
        assert_eq!(info.attribute("/g", "text"), Some(&Value::from("grün")));
        assert_eq!(info.attribute("/g", "none"), Some(&Value::from("")));
        assert_eq!(
            info.attribute("/g", "list"),
            Some(&serde_json::json!([3, 4]))
        );
        let id = info.dataset("/g/id").unwrap();
        assert_eq!(
            (id.kind, id.units.as_deref(), id.name()),
            (Some(Kind::I64), Some("-"), "id")
        );
        assert_eq!(
            read_f64(&path, "/g/id", &[1], &[2]).unwrap(),
            vec![6.0, 7.0]
        );
        let error = read_column(&path, "speed").unwrap_err();
        assert!(error.to_string().contains("its columns are id"), "{error}");
        assert!(read_f64(&path, "/g/id", &[1], &[usize::MAX]).is_err());
        assert!(inspect(&dir.path().join("b.h5")).is_err());
        std::fs::write(dir.path().join("c.h5"), b"no").unwrap();
        assert!(inspect(&dir.path().join("c.h5")).is_err());
    }
}
