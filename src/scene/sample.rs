//! A prepared sample of grains as CSV, so that every run of a study can start from the same one.
//!
//! A header names the columns: `x`, `y`, `z` (3-D only), `radius` in m, and optionally `material`; other columns are
//! skipped. Numbers are written with all their digits: a sample read back is the sample written.

use serde::Serialize;
use std::fmt::Write;

/// A grain of a list.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Grain {
    /// Centre [m].
    pub position: [f64; 3],
    /// Radius [m].
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
        for coordinate in &grain.position[..dimension.min(3)] {
            // Writing to a String cannot fail.
            let _ = write!(text, "{coordinate:?},");
        }
        let material = materials.get(grain.material).map_or("", String::as_str);
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
    let mut lines = text.lines().enumerate();
    let header: Vec<&str> = match lines.next() {
        Some((_, line)) => line.split(',').map(str::trim).collect(),
        None => return Err("the file is empty".into()),
    };
    let column = |name: &str| header.iter().position(|c| *c == name);
    let needed =
        |name: &str| column(name).ok_or_else(|| format!("the header has no column `{name}`"));
    let axes: Vec<usize> = ["x", "y", "z"][..dimension.min(3)]
        .iter()
        .map(|name| needed(name))
        .collect::<Result<_, _>>()?;
    let radius_column = needed("radius")?;
    let material_column = column("material");
    let mut grains = Vec::new();
    let mut cells: Vec<&str> = Vec::new();
    for (n, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        cells.clear();
        cells.extend(line.split(',').map(str::trim));
        let number = |column: usize| {
            cells
                .get(column)
                .and_then(|cell| cell.parse::<f64>().ok())
                .filter(|x| x.is_finite())
                .ok_or_else(|| {
                    format!(
                        "line {}: column `{}` holds no number",
                        n + 1,
                        header[column]
                    )
                })
        };
        let mut position = [0.0; 3];
        for (to, column) in position.iter_mut().zip(&axes) {
            *to = number(*column)?;
        }
        let radius = number(radius_column)?;
        if radius <= 0.0 {
            return Err(format!("line {}: the radius must be above 0", n + 1));
        }
        let name = material_column
            .and_then(|column| cells.get(column).copied())
            .unwrap_or("");
        let material = if name.is_empty() {
            default
        } else {
            materials
                .iter()
                .position(|known| known == name)
                .ok_or_else(|| format!("line {}: there is no material `{name}`", n + 1))?
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
