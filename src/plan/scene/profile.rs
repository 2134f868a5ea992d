//! Velocities over a face from a table: its tangential coordinates \[m\], then the velocity components [m/s],
//! identified by the names of the columns.
//!
//! On a face across x the columns are `y`, `z` (3-D only), `u`, `v` and `w` (3-D only); on a face across y `x` and `z`,
//! across z `x` and `y`. Velocities may be called `velocity_x` or `vx` as well. [`io::sheet`] states which separators
//! and units are read. Of tables of points that ParaView exports (`U:0`, `Points:1`) other columns are not read.
//! [`VelocityTable`] interpolates between the rows.

use super::findings::number;
use super::grid::Grid;
use io::sheet::{Column, Header, Refusal, Sheet, Unit};
use lbm::boundary::profile::VelocityTable;
use std::path::Path;

/// Maximum number of rows of a table.
pub const MAX_ROWS: usize = 1_000_000;
/// Maximum length of a file \[bytes\]: that of [`MAX_ROWS`] rows of five numbers with all digits.
const LONGEST: u64 = 256 << 20;
/// Ratio of the extents of a table and of its face above which the table has another unit.
const TOO_WIDE: f64 = 20.0;
/// Names of the coordinate columns, by axis.
const COORDINATES: [(&str, &[(&str, f64)]); 3] = [
    ("x", &[("points_0", 1.0)]),
    ("y", &[("points_1", 1.0)]),
    ("z", &[("points_2", 1.0)]),
];
/// Beginning of the column names in tables of points that ParaView exports.
const POINTS: &str = "points_";
/// Names of the velocity columns, by axis.
const VELOCITIES: [(&str, &[(&str, f64)]); 3] = [
    (
        "u",
        &[
            ("velocity_x", 1.0),
            ("vx", 1.0),
            ("u_x", 1.0),
            ("ux", 1.0),
            ("u_0", 1.0),
            ("velocity_0", 1.0),
        ],
    ),
    (
        "v",
        &[
            ("velocity_y", 1.0),
            ("vy", 1.0),
            ("u_y", 1.0),
            ("uy", 1.0),
            ("u_1", 1.0),
            ("velocity_1", 1.0),
        ],
    ),
    (
        "w",
        &[
            ("velocity_z", 1.0),
            ("vz", 1.0),
            ("u_z", 1.0),
            ("uz", 1.0),
            ("u_2", 1.0),
            ("velocity_2", 1.0),
        ],
    ),
];

/// Reads the table of a file for a face perpendicular to an axis of a grid.
///
/// # Errors
/// If the file is not a valid table, or its rows do not lie on the face; the text names the file and the line.
pub(crate) fn read(path: &Path, grid: &Grid, axis: usize) -> Result<VelocityTable, String> {
    let text = io::plain::text(path, LONGEST).map_err(|e| e.to_string())?;
    let named = |e: String| format!("{}: {e}", path.display());
    let rows = rows(&text, grid.dimension, axis).map_err(named)?;
    judge_extent(&rows, grid, axis).map_err(named)?;
    Ok(VelocityTable::new(grid.dimension, rows))
}

/// Compares the coordinates of a table with the face: a table in another unit covers much more than the face, or none
/// of it.
///
/// # Errors
/// If no row lies on the face, or the table is [`TOO_WIDE`] times as wide.
fn judge_extent(rows: &[Vec<f64>], grid: &Grid, axis: usize) -> Result<(), String> {
    let tangential = (0..grid.dimension).filter(|a| *a != axis);
    for (column, a) in tangential.enumerate() {
        let values = rows.iter().map(|row| row[column]);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        let (size, name) = (grid.size[a], COORDINATES[a].0);
        let misses = high < 0.0 || low > size;
        if misses || high - low > TOO_WIDE * size {
            return Err(format!(
                "the profile covers {name} from {} to {} m, the face 0 to {} m; correct the coordinates, or write \
                 their unit in the header, such as `{name} [mm]`",
                number(low),
                number(high),
                number(size)
            ));
        }
    }
    Ok(())
}

/// Returns the columns of a table for a face perpendicular to an axis, in order.
fn columns(dimension: usize, axis: usize) -> Vec<Column> {
    let column = |(name, others), unit| Column {
        name,
        aliases: others,
        unit,
        required: true,
    };
    let tangential = (0..dimension).filter(|a| *a != axis);
    let coordinates = tangential.map(|a| column(COORDINATES[a], Unit::Length));
    let velocities = VELOCITIES[..dimension].iter();
    coordinates
        .chain(velocities.map(|names| column(*names, Unit::Velocity)))
        .collect()
}

/// Reads the rows of a text, sorted in ascending order of the first coordinate.
fn rows(text: &str, dimension: usize, axis: usize) -> Result<Vec<Vec<f64>>, String> {
    let columns = columns(dimension, axis);
    let names: Vec<&str> = columns.iter().map(|column| column.name).collect();
    let names = names.join(", ");
    let header = Header::find(text, &columns).map_err(|sentence| {
        format!("{sentence}; a profile of this face has the columns {names}")
    })?;
    let of_points = header.has_name_that_begins(POINTS);
    let sheet = Sheet::below(header, &columns, !of_points).map_err(|refusal| match refusal {
        Refusal::Sentence(sentence) => format!("{sentence}; a profile of this face has the columns {names}"),
        Refusal::Unknown(name) => {
            format!("the header has an unknown column `{name}`; a profile of this face has the columns {names}")
        }
    })?;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    sheet.each(|row| {
        if rows.len() >= MAX_ROWS {
            return Err(format!("the file has more than {MAX_ROWS} rows"));
        }
        let numbers: Vec<f64> = (0..columns.len())
            .map(|column| row.number(column))
            .collect::<Result<_, _>>()?;
        if let Some(large) = numbers.iter().find(|v| v.abs() > LARGEST) {
            let line = row.line();
            return Err(format!("line {line}: {large} is larger than {LARGEST}"));
        }
        rows.push(numbers);
        Ok(())
    })?;
    if rows.is_empty() {
        return Err("there are no rows below the header".into());
    }
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(rows)
}

/// Maximum magnitude of coordinates and velocities, as for all numbers of a case.
const LARGEST: f64 = 1e30;

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str, dimension: usize) -> Result<VelocityTable, String> {
        Ok(VelocityTable::new(dimension, rows(text, dimension, 0)?))
    }

    /// Checks a table in millimetres without a unit, one next to the face, and a wider one of the right unit.
    #[test]
    fn a_profile_in_another_unit_is_refused() {
        let text = r#"{"title": "p", "domain": {"size": [0.04, 0.01], "spacing": 0.001}, "time": {"end": 1},
            "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8}}}"#;
        let document = case::Document::read(text, &[], Path::new(".")).unwrap();
        let grid = crate::Plan::prepare(document).unwrap().scene.grid;
        let judged = |y: [f64; 3]| {
            let rows: Vec<Vec<f64>> = y.iter().map(|y| vec![*y, 0.006, 0.0]).collect();
            judge_extent(&rows, &grid, 0)
        };
        assert_eq!(judged([0.0, 0.005, 0.01]), Ok(()));
        assert_eq!(judged([-0.05, 0.0, 0.05]), Ok(()));
        let reason = judged([0.0, 5.0, 10.0]).unwrap_err();
        assert!(
            reason.contains("covers y from 0 to 10 m, the face 0 to 0.01 m"),
            "{reason}"
        );
        assert!(judged([0.1, 0.12, 0.14]).is_err());
    }

    #[test]
    fn rows_are_read_in_rising_order() {
        let flat = table("y,u,v\n# note\n\n1,4,-3\n0,2,0\n", 2).unwrap();
        assert_eq!(flat.velocity_at(&[0.5]), [3.0, -1.5, 0.0]);
        let solid = table("y,z,u,v,w\n0,0,1,0,0\n1,1,0,0,2\n", 3).unwrap();
        assert_eq!(solid.velocity_at(&[0.9, 0.6]), [0.0, 0.0, 2.0]);
    }

    #[test]
    fn columns_are_read_by_name_in_any_order() {
        let usual = rows("y,u,v\n0,1,0\n0.01,3,-1\n", 2, 0).unwrap();
        for text in [
            "u,y,v\n1,0,0\n3,0.01,-1\n",
            "velocity_x [m/s];y [mm];velocity_y [m/s]\n1;0;0\n3;10;-1\n",
            "y u v\n0 1 0\n0.01   3 -1\n",
            "\u{feff}Y,U,V\r\nm,cm/s,m/s\r\n0,100,0\r\n0.01,300,-1\r\n",
        ] {
            assert_eq!(rows(text, 2, 0).unwrap(), usual, "{text}");
        }
        let points = "\"U:0\",\"U:1\",\"U:2\",\"p\",\"arc_length\",\"Points:0\",\"Points:1\",\"Points:2\"\n\
            1,0,0,5,0,0.2,0,0.5\n3,-1,0,6,0.01,0.2,0.01,0.5\n";
        assert_eq!(rows(points, 2, 0).unwrap(), usual);
        let top = rows("x,u,v\n0,1,0\n0.01,3,-1\n", 2, 1).unwrap();
        assert_eq!(top, usual);
        let refused = rows("y,u,v\n0,1,0\n", 2, 1).unwrap_err();
        assert!(refused.contains("columns x, u, v"), "{refused}");
    }

    #[test]
    fn what_is_no_table_is_refused_with_its_line() {
        let error = |text: &str| table(text, 2).unwrap_err();
        let says = |text: &str, reason: &str| {
            let said = error(text);
            assert!(said.contains(reason), "{text}: {said}");
        };
        says("", "empty");
        says("y,u,v\n", "no rows");
        says("0,0,0\n0.005,0.006,0\n", "`y,u,v`");
        says("y,u,v\n0,1,2\n1,2\n", "line 3 has 2 cells");
        says("y,u,v\n0,1,2,3\n", "line 2 has 4 cells");
        says("y,u,v\n0;1e-3;0\n", "separates its cells by commas");
        says("y;u;v\n0,01;1;0\n", "line 2: column `y` holds `0,01`");
        says("y,u,v\n0,1,nan\n", "line 2");
        says("y,u,v\n0,1,1e300\n", "line 2");
        says("y,u,v\n0,1,fast\n", "line 2");
        says("y,speed,v\n0,1,2\n", "`speed`");
    }
}
