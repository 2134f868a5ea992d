//! The erosion records of a run: their columns, and how they are written and read.
//!
//! | file | row | one row per |
//! |---|---|---|
//! | `erosion.csv` | [`ErosionRecord`] | interval of the erosion record |
//! | `removed.csv` | [`RemovedGrain`] | grain that left the domain |
//! | `bonds.csv` | [`BondBreak`] | bond that broke |
//! | `summary.json`, key `erosion` | [`ErosionSummary`] | run |
//!
//! Each struct declares name and unit of every column with the field. Header, writer and reader use the same
//! declaration. Numbers are written with the shortest text that reads back to the same bits. Undefined values, such as
//! the shear stress on a hole that no longer exists, are `NaN`.

use base::error::Error;
use io::csv::Reader;
use serde::de::DeserializeOwned;
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// One row of a CSV file.
pub trait RecordRow: DeserializeOwned {
    /// Columns in order, `name [unit]`.
    const COLUMNS: &'static [&'static str];

    /// Returns the row as text, without the end of line.
    fn to_csv(&self) -> String;

    /// Returns the first line of the file, without the end of line.
    #[must_use]
    fn header() -> String {
        Self::COLUMNS.join(",")
    }
}

/// Struct whose fields are the columns of a CSV file.
macro_rules! csv_row {
    (
        $(#[$about:meta])*
        pub struct $name:ident {
            $( $(#[$doc:meta])* $field:ident: $kind:ty = $column:literal, )*
        }
    ) => {
        $(#[$about])*
        #[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
        pub struct $name { $( $(#[$doc])* #[serde(rename = $column)] pub $field: $kind, )* }

        impl RecordRow for $name {
            const COLUMNS: &'static [&'static str] = &[$($column),*];

            fn to_csv(&self) -> String {
                let mut line = String::new();
                $(
                    if !line.is_empty() {
                        line.push(',');
                    }
                    self.$field.put(&mut line);
                )*
                line
            }
        }
    };
}

pub(crate) use csv_row;

/// Value of one column.
pub(crate) trait Value: Sized {
    /// Appends the value to a line.
    fn put(&self, line: &mut String);
}

impl Value for u64 {
    fn put(&self, line: &mut String) {
        // Writing to a string cannot fail.
        let _ = write!(line, "{self}");
    }
}

impl Value for f64 {
    fn put(&self, line: &mut String) {
        // Writing to a string cannot fail.
        let _ = if self.is_nan() || (1e-3..1e6).contains(&self.abs()) {
            write!(line, "{self}")
        } else if self.abs() < f64::MIN_POSITIVE {
            write!(line, "0")
        } else {
            write!(line, "{self:e}")
        };
    }
}

csv_row! {
/// The state of an eroding hole at one time: a row of `erosion.csv`. Per metre of depth in 2-D.
pub struct ErosionRecord {
    /// Fluid step.
    step: u64 = "step",
    /// Time since the flow was started, s.
    time: f64 = "time [s]",
    /// Mass that left through the outlet so far, M_e, kg; in 2-D kg/m. Earlier versions named the column
    /// `eroded_mass [kg/m]`.
    #[serde(alias = "eroded_mass [kg/m]")]
    eroded_mass: f64 = "eroded_mass [kg; 2-D kg/m]",
    /// M_e / M_0, M_0 the mass of the grains at the start of the flow.
    eroded_fraction: f64 = "eroded_fraction [1]",
    /// Grains that left through the outlet so far.
    eroded_grains: u64 = "eroded_grains [1]",
    /// Mean position of the lower face of the hole, m.
    lower_face: f64 = "lower_face [m]",
    /// Mean position of the upper face of the hole, m.
    upper_face: f64 = "upper_face [m]",
    /// Distance between the faces, m.
    hole_width: f64 = "hole_width [m]",
    /// Length of the pipe along the flow, m.
    hole_length: f64 = "hole_length [m]",
    /// Shear stress from the velocity gradient at the faces, mean of both, Pa.
    shear_gradient: f64 = "shear_gradient [Pa]",
    /// Shear stress from the balance of forces, `dP d_h / (2 L)`, Pa.
    shear_balance: f64 = "shear_balance [Pa]",
    /// Shear stress from the force of the fluid on the grains of the faces, Pa.
    shear_traction: f64 = "shear_traction [Pa]",
    /// Pressure difference applied at this time, Pa (it differs from the case's while a ramp lasts).
    pressure_difference: f64 = "pressure_difference [Pa]",
    /// Discharge through the hole, m^2/s.
    discharge: f64 = "discharge [m^2/s]",
    /// Bonds broken so far.
    bonds_broken: u64 = "bonds_broken [1]",
    /// Bonds broken so far in the bulk of the packing.
    bonds_broken_inside: u64 = "bonds_broken_inside [1]",
    /// Bonds broken so far at the wall of the hole: between its faces or within two mean diameters of one.
    bonds_broken_at_wall: u64 = "bonds_broken_at_wall [1]",
    /// Largest fluid speed in lattice units, |u| dt/h. Earlier versions named the column `mach [1]`.
    #[serde(alias = "mach [1]")]
    lattice_velocity: f64 = "lattice_velocity [1]",
    /// Fluid mass relative to the expected one, minus one.
    mass_error: f64 = "mass_error [1]",
    /// Fraction of the bonds broken before a tenth of the mass had left that broke at the wall of the hole. Earlier
    /// versions had no such column.
    #[serde(default = "unknown")]
    face_share: f64 = "face_share [1]",
    /// Mean displacement of the grains that started next to the hole and more than two mean diameters behind its
    /// present faces, in mean diameters. Earlier versions had no such column.
    #[serde(default = "unknown")]
    bulk_displacement: f64 = "bulk_displacement [diameters]",
}
}

csv_row! {
/// Grain that left the domain: a row of `removed.csv`.
pub struct RemovedGrain {
    /// Fluid step.
    step: u64 = "step",
    /// Time, s.
    time: f64 = "time [s]",
    /// Id of the grain.
    id: u64 = "id",
    /// Mass, kg; in 2-D kg/m.
    mass: f64 = "mass [kg; 2-D kg/m]",
    /// Radius, m.
    radius: f64 = "radius [m]",
    /// Position, m.
    x: f64 = "x [m]",
    /// Position, m.
    y: f64 = "y [m]",
    /// Position, m; 0 in 2-D.
    z: f64 = "z [m]",
}
}

/// Mode in which a bond broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BreakMode {
    /// Normal force above the tensile strength.
    Tension,
    /// Shear force above its limit.
    Shear,
}

/// Part of the packing in which a bond broke.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BreakPlace {
    /// Bulk of the packing, which only a pressure wave reaches.
    Inside,
    /// Wall of the hole.
    HoleWall,
}

impl Value for BreakMode {
    fn put(&self, line: &mut String) {
        line.push_str(match self {
            Self::Tension => "tension",
            Self::Shear => "shear",
        });
    }
}

impl Value for BreakPlace {
    fn put(&self, line: &mut String) {
        line.push_str(match self {
            Self::Inside => "inside",
            Self::HoleWall => "hole_wall",
        });
    }
}

csv_row! {
/// A bond that broke: a row of `bonds.csv`.
pub struct BondBreak {
    /// Fluid step.
    step: u64 = "step",
    /// Time, s.
    time: f64 = "time [s]",
    /// Id of the grain with the smaller id.
    id_a: u64 = "id_a",
    /// Id of the other grain, or of the wall.
    id_b: u64 = "id_b",
    /// Contact point, m.
    x: f64 = "x [m]",
    /// Contact point, m.
    y: f64 = "y [m]",
    /// Mode of breakage.
    mode: BreakMode = "mode",
    /// Part of the packing in which the bond broke.
    place: BreakPlace = "place",
}
}

/// Data of a run that a study needs in addition to its record: the value of the key `erosion` of `summary.json`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ErosionSummary {
    /// Cohesion divided by the mean diameter, C/d, N/m.
    pub cohesion: f64,
    /// Pressure difference over the box after any ramp, Pa.
    pub pressure_difference: f64,
    /// Time at which a ramp of the pressure ends, s; 0 without a ramp.
    pub ramp_end: f64,
    /// Mass of the grains at the start of the flow, M_0, kg; in 2-D kg/m.
    pub initial_mass: f64,
    /// Mass that left through the outlet, kg; in 2-D kg/m.
    pub eroded_mass: f64,
    /// Initial hole width d_h, m.
    pub hole_width: f64,
    /// Initial hole length L, m.
    pub hole_length: f64,
    /// Mean number of contacts of a grain with grains and walls at the start of the flow.
    #[serde(default)]
    pub contacts_per_grain: Option<f64>,
    /// Mean number of bonds of a grain with grains and walls at the start of the flow.
    #[serde(default)]
    pub bonds_per_grain: Option<f64>,
    /// Fraction of the bonds broken before a tenth of the mass had left that broke at the wall of the hole; none if
    /// no bond broke.
    #[serde(default)]
    pub face_share: Option<f64>,
    /// Mean displacement of the bulk at the time at which a tenth of the mass had left, or at the end if less has
    /// left, in mean diameters.
    #[serde(default)]
    pub bulk_displacement: Option<f64>,
}

/// Returns the value of a column that is missing in a table.
fn unknown() -> f64 {
    f64::NAN
}

/// Columns at the end of the tables that earlier versions did not write.
const LATER_COLUMNS: [&str; 2] = ["face_share [1]", "bulk_displacement [diameters]"];

/// Columns that earlier versions wrote under another name: that name and the present one.
const RENAMED: [(&str, &str); 2] = [
    ("mach [1]", "lattice_velocity [1]"),
    ("eroded_mass [kg/m]", "eroded_mass [kg; 2-D kg/m]"),
];

/// Reads a CSV file whose first line is the header of the row. Column names of earlier versions are accepted.
///
/// A run that was killed and resumed may have written rows after its last checkpoint twice. Of rows with the same
/// `key`, the last one is used. Lines that start with `#` are skipped.
///
/// # Errors
/// If the file cannot be read, [`Error::Io`] with file, line and column.
pub fn read_rows<R: RecordRow>(path: &Path, key: impl Fn(&R) -> u64) -> Result<Vec<R>, Error> {
    let fail = |what: String| Error::Io(format!("{}: {what}", path.display()));
    let text = io::plain::text(path, io::plain::LONGEST_TABLE)
        .map_err(|error| Error::Io(error.to_string()))?;
    let mut lines = Reader::new(&text).ok_or_else(|| fail("the file is empty".to_owned()))?;
    let present = |name| match RENAMED.iter().find(|(old, _)| *old == name) {
        Some((_, now)) => *now,
        None => name,
    };
    let names = lines.names();
    let given = || names.iter().map(|name| present(name));
    let earlier = (R::COLUMNS.iter().copied()).filter(|name| !LATER_COLUMNS.contains(name));
    if !given().eq(R::COLUMNS.iter().copied()) && !given().eq(earlier) {
        return Err(fail(format!(
            "the columns are `{}`, but `{}` are needed",
            names.join(","),
            R::header()
        )));
    }
    let mut rows: Vec<R> = Vec::new();
    let mut places: HashMap<u64, usize> = HashMap::new();
    while let Some(line) = lines.row() {
        let row: R = line.read().map_err(fail)?;
        match places.get(&key(&row)) {
            Some(&place) => {
                if let Some(old) = rows.get_mut(place) {
                    *old = row;
                }
            }
            None => {
                places.insert(key(&row), rows.len());
                rows.push(row);
            }
        }
    }
    Ok(rows)
}

/// Writes a whole CSV file: header and rows.
///
/// # Errors
/// If the file cannot be written, [`Error::Io`].
pub fn write_rows<R: RecordRow>(path: &Path, rows: &[R]) -> Result<(), Error> {
    let mut text = R::header();
    text.push('\n');
    for row in rows {
        text.push_str(&row.to_csv());
        text.push('\n');
    }
    fs::write(path, text).map_err(|error| Error::Io(format!("{}: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(step: u64) -> ErosionRecord {
        ErosionRecord {
            step,
            time: 0.1 + 0.2,
            eroded_mass: 1.0 / 3.0,
            eroded_fraction: 5e-324,
            eroded_grains: 17,
            lower_face: 3.5e-3,
            upper_face: 4.5e-3,
            hole_width: 1e-3,
            hole_length: 1.2e-2,
            shear_gradient: -1.25e-9,
            shear_balance: 1.5e300,
            shear_traction: f64::NAN,
            pressure_difference: 0.5,
            discharge: 1e-6,
            bonds_broken: u64::MAX,
            bonds_broken_inside: 2,
            bonds_broken_at_wall: 3,
            lattice_velocity: 0.0,
            mass_error: -0.0,
            face_share: 0.75,
            bulk_displacement: 1e-3,
        }
    }

    #[test]
    fn rows_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("erosion.csv");
        // Subnormal fractions are below the resolution of any run and are written as zero.
        let rows: Vec<ErosionRecord> = (0..3).map(record).collect();
        write_rows(&path, &rows).unwrap();
        let back = read_rows::<ErosionRecord>(&path, |row| row.step).unwrap();
        assert_eq!(back.len(), 3);
        for (a, b) in rows.iter().zip(&back) {
            assert_eq!(a.time.to_bits(), b.time.to_bits());
            assert_eq!(a.eroded_mass.to_bits(), b.eroded_mass.to_bits());
            assert_eq!(a.shear_gradient.to_bits(), b.shear_gradient.to_bits());
            assert_eq!(a.shear_balance.to_bits(), b.shear_balance.to_bits());
            assert_eq!(a.bonds_broken, b.bonds_broken);
            assert!(b.shear_traction.is_nan());
            assert!(b.eroded_fraction.abs() < f64::MIN_POSITIVE);
        }
    }

    #[test]
    fn a_table_of_an_earlier_version_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("erosion.csv");
        let row = ErosionRecord {
            lattice_velocity: 0.05,
            ..record(1)
        };
        write_rows(&path, &[row]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let old = text.replace("lattice_velocity [1]", "mach [1]");
        assert_ne!(old, text);
        fs::write(&path, &old).unwrap();
        let back = read_rows::<ErosionRecord>(&path, |row| row.step).unwrap();
        assert_eq!(back[0].lattice_velocity.to_bits(), 0.05_f64.to_bits());
        // Even earlier versions end before the columns of the mechanism.
        let cut = |line: &str| line.rsplitn(3, ',').last().unwrap_or_default().to_owned();
        let older: Vec<String> = old.lines().map(cut).collect();
        fs::write(&path, older.join("\n")).unwrap();
        let back = read_rows::<ErosionRecord>(&path, |row| row.step).unwrap();
        assert_eq!(back[0].lattice_velocity.to_bits(), 0.05_f64.to_bits());
        assert!(back[0].face_share.is_nan() && back[0].bulk_displacement.is_nan());
    }

    #[test]
    fn every_column_names_its_unit_or_is_a_label() {
        let labels = ["step", "id", "id_a", "id_b", "mode", "place"];
        for columns in [
            ErosionRecord::COLUMNS,
            RemovedGrain::COLUMNS,
            BondBreak::COLUMNS,
        ] {
            for column in columns {
                assert!(
                    labels.contains(column) || (column.contains(" [") && column.ends_with(']')),
                    "{column}"
                );
            }
        }
    }

    #[test]
    fn rows_written_twice_after_a_restart_count_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("erosion.csv");
        let mut late = record(2);
        late.eroded_grains = 99;
        write_rows(&path, &[record(1), record(2), record(3), late]).unwrap();
        let back = read_rows::<ErosionRecord>(&path, |row| row.step).unwrap();
        assert_eq!(
            back.iter().map(|row| row.step).collect::<Vec<_>>(),
            [1, 2, 3]
        );
        assert_eq!(back[1].eroded_grains, 99);
    }

    #[test]
    fn bond_events_keep_mode_and_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bonds.csv");
        let row = BondBreak {
            step: 5,
            time: 0.5,
            id_a: 1,
            id_b: 2,
            x: 0.001,
            y: 0.002,
            mode: BreakMode::Shear,
            place: BreakPlace::HoleWall,
        };
        write_rows(&path, &[row]).unwrap();
        assert_eq!(
            read_rows::<BondBreak>(&path, |row| row.step).unwrap(),
            [row]
        );
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(
            text,
            "step,time [s],id_a,id_b,x [m],y [m],mode,place\n5,0.5,1,2,0.001,0.002,shear,hole_wall\n"
        );
    }

    #[test]
    fn a_broken_file_is_named_with_line_and_column() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("removed.csv");
        let header = RemovedGrain::header();
        fs::write(&path, format!("{header}\n1,0.5,7,oops,1e-4,0,0,0\n")).unwrap();
        let error = read_rows::<RemovedGrain>(&path, |row| row.id)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("line 2") && error.contains("mass [kg; 2-D kg/m]"),
            "{error}"
        );
        fs::write(&path, format!("{header}\n1,0.5\n")).unwrap();
        let error = read_rows::<RemovedGrain>(&path, |row| row.id)
            .unwrap_err()
            .to_string();
        assert!(error.contains("2 columns, expected 8"), "{error}");
        fs::write(&path, "a,b\n").unwrap();
        let error = read_rows::<RemovedGrain>(&path, |row| row.id)
            .unwrap_err()
            .to_string();
        assert!(error.contains("but `step"), "{error}");
    }
}
