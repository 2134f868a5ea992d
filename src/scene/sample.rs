//! A prepared sample of grains as CSV, so that all runs of a study can start from the same sample.
//!
//! A header names the columns: `x`, `y`, `z` (3-D only), `radius` in m, and optionally `material`; other columns are
//! skipped. Numbers are written with all their digits, so that a sample is read back with the same bits.

use io::csv::Reader;
use serde::Serialize;
use std::fmt::Write;

/// A grain of a list.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Grain {
    /// Centre \[m\].
    pub position: [f64; 3],
    /// Radius \[m\].
    pub radius: f64,
    /// Velocity [m/s].
    pub velocity: [f64; 3],
    /// Rotation rate [rad/s].
    pub angular_velocity: [f64; 3],
    /// Index of its material.
    pub material: usize,
}

/// The sample as CSV; `materials` are the names behind the indices.
#[must_use]
pub fn write(grains: &[Grain], dimension: usize, materials: &[String]) -> String {
    let mut text = String::from(if dimension == 2 {
        "x,y,radius,material\n"
    } else {
        "x,y,z,radius,material\n"
    });
    for grain in grains {
        let material = materials.get(grain.material).map_or("", String::as_str);
        for coordinate in &grain.position[..dimension.min(3)] {
            // Writing to a String cannot fail.
            let _ = write!(text, "{coordinate:?},");
        }
        let _ = writeln!(text, "{:?},{material}", grain.radius);
    }
    text
}

/// Reads a sample; grains that name no material get `default`.
///
/// # Errors
/// A sentence that names the line.
pub fn read(
    text: &str,
    dimension: usize,
    materials: &[String],
    default: usize,
) -> Result<Vec<Grain>, String> {
    let mut rows = Reader::new(text).ok_or("the file is empty")?;
    let needed = |name: &str| {
        rows.column(name)
            .ok_or_else(|| format!("the header has no column `{name}`"))
    };
    let axes: Vec<usize> = ["x", "y", "z"][..dimension.min(3)]
        .iter()
        .map(|name| needed(name))
        .collect::<Result<_, _>>()?;
    let radius_column = needed("radius")?;
    let material_column = rows.column("material");
    let mut grains = Vec::new();
    while let Some(row) = rows.row() {
        let mut position = [0.0; 3];
        for (to, column) in position.iter_mut().zip(&axes) {
            *to = row.number(*column)?;
        }
        let radius = row.number(radius_column)?;
        if radius <= 0.0 {
            return Err(format!(
                "line {}: the radius is {radius}, it must be above 0",
                row.line()
            ));
        }
        let name = material_column.and_then(|column| row.text(column));
        let material = match name.unwrap_or_default() {
            "" => default,
            name => materials
                .iter()
                .position(|known| known == name)
                .ok_or_else(|| format!("line {}: there is no material `{name}`", row.line()))?,
        };
        grains.push(Grain {
            position,
            radius,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            material,
        });
    }
    if grains.is_empty() {
        return Err("the sample holds no grain".into());
    }
    Ok(grains)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_read_back_is_the_sample_written() {
        let materials = ["sand".to_string(), "clay".to_string()];
        let grain = |x: f64, z: f64, material| Grain {
            position: [x, 0.1 + x, z],
            radius: 1e-4 / 3.0,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            material,
        };
        let flat = [grain(1.0 / 3.0, 0.0, 0), grain(1e-300, 0.0, 1)];
        let solid = [grain(1.0 / 7.0, 2.0 / 3.0, 1)];
        assert_eq!(
            read(&write(&flat, 2, &materials), 2, &materials, 0).unwrap(),
            flat
        );
        assert_eq!(
            read(&write(&solid, 3, &materials), 3, &materials, 0).unwrap(),
            solid
        );
    }

    #[test]
    fn a_bad_sample_names_the_line() {
        let materials = ["sand".to_string()];
        let error = |text: &str| read(text, 2, &materials, 0).unwrap_err();
        assert!(error("").contains("empty"));
        assert!(error("x,radius\n").contains("`y`"));
        assert!(error("x,y,radius\n1,2,3\n1,b,3\n").contains("line 3"));
        assert!(error("x,y,radius\n1,2,-3\n").contains("line 2"));
        assert!(error("x,y,radius\n1,2,inf\n").contains("line 2"));
        assert!(error("x,y,radius,material\n1,2,3,mud\n").contains("mud"));
        assert!(error("x,y,radius\n").contains("no grain"));
    }
}
