//! A prepared sample of grains as CSV, so that all runs of a study can start from the same sample.
//!
//! A header names the columns, in any order:
//!
//! | column | content | where it is left out |
//! |---|---|---|
//! | `x`, `y`, `z` (3-D only) | centre \[m\] | needed |
//! | `radius` | \[m\] | needed |
//! | `material` | name in the case | the material of the grains |
//! | `velocity_x`, `velocity_y`, `velocity_z` (3-D only) | [m/s] | 0 |
//! | `angular_velocity_x`, `_y` (3-D only), `angular_velocity_z` | [rad/s] | 0 |
//! | `id` | whole number, each once: grains stand in its order | the order of the lines |
//!
//! Other columns are refused. Numbers are written with all their digits, so that a sample is read back with the same bits.

use crate::case::check::nearest;
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

const POSITION: [&str; 3] = ["x", "y", "z"];
const VELOCITY: [&str; 3] = ["velocity_x", "velocity_y", "velocity_z"];
const SPIN: [&str; 3] = [
    "angular_velocity_x",
    "angular_velocity_y",
    "angular_velocity_z",
];

/// The columns of the rotation rate: in 2-D that about z.
fn spin(dimension: usize) -> &'static [&'static str] {
    &SPIN[if dimension == 2 { 2 } else { 0 }..]
}

/// The sample as CSV; `materials` are the names behind the indices. Velocities and rotation rates stand in it where one is not zero.
#[must_use]
pub fn write(grains: &[Grain], dimension: usize, materials: &[String]) -> String {
    let axes = dimension.min(3);
    let moves = grains
        .iter()
        .any(|grain| (grain.velocity.iter().chain(&grain.angular_velocity)).any(|v| *v != 0.0));
    let spins = spin(dimension);
    let mut names = POSITION[..axes].to_vec();
    names.extend(["radius", "material"]);
    if moves {
        names.extend(&VELOCITY[..axes]);
        names.extend(spins);
    }
    let mut text = names.join(",") + "\n";
    for grain in grains {
        let material = materials.get(grain.material).map_or("", String::as_str);
        for coordinate in &grain.position[..axes] {
            // Writing to a String cannot fail.
            let _ = write!(text, "{coordinate:?},");
        }
        let _ = write!(text, "{:?},{material}", grain.radius);
        if moves {
            let rates = &grain.angular_velocity[3 - spins.len()..];
            for number in grain.velocity[..axes].iter().chain(rates) {
                let _ = write!(text, ",{number:?}");
            }
        }
        text.push('\n');
    }
    text
}

/// Columns that are there or not, as places in a vector.
type Columns = Vec<(usize, usize)>;

/// Where the columns of a sample stand.
struct Header {
    position: Columns,
    radius: usize,
    material: Option<usize>,
    velocity: Columns,
    angular_velocity: Columns,
    id: Option<usize>,
}

impl Header {
    fn of(rows: &Reader<'_>, dimension: usize) -> Result<Self, String> {
        let axes = dimension.min(3);
        let mut known = POSITION[..axes].to_vec();
        known.extend(["radius", "material"]);
        known.extend(&VELOCITY[..axes]);
        known.extend(spin(dimension));
        known.push("id");
        let names = rows.names();
        for (n, name) in names.iter().enumerate() {
            if names[..n].contains(name) {
                return Err(format!("the header names the column `{name}` twice"));
            }
            if known.contains(name) {
                continue;
            }
            let list = known.join(", ");
            let meant = match nearest(name, &known) {
                _ if [POSITION, VELOCITY, SPIN].as_flattened().contains(name) => {
                    "this is a problem in two dimensions.".into()
                }
                Some(close) => format!("did you mean `{close}`?"),
                None => "take it out.".into(),
            };
            return Err(format!(
                "the header has a column `{name}` that a sample has not: {meant} Known: {list}"
            ));
        }
        let needed = |name: &str| {
            rows.column(name)
                .ok_or_else(|| format!("the header has no column `{name}`"))
        };
        let vector = |names: &[&str; 3]| -> Columns {
            let place = |(axis, name): (usize, &&str)| Some((axis, rows.column(name)?));
            names.iter().enumerate().filter_map(place).collect()
        };
        for name in &POSITION[..axes] {
            needed(name)?;
        }
        Ok(Self {
            position: vector(&POSITION),
            radius: needed("radius")?,
            material: rows.column("material"),
            velocity: vector(&VELOCITY),
            angular_velocity: vector(&SPIN),
            id: rows.column("id"),
        })
    }
}

/// Reads a sample; grains that name no material get `default`.
///
/// # Errors
/// A sentence that names the line or the column.
pub fn read(
    text: &str,
    dimension: usize,
    materials: &[String],
    default: usize,
) -> Result<Vec<Grain>, String> {
    let mut rows = Reader::new(text).ok_or("the file is empty")?;
    let header = Header::of(&rows, dimension)?;
    let mut grains = Vec::new();
    let mut ids: Vec<(u64, usize)> = Vec::new();
    while let Some(row) = rows.row() {
        let vector = |columns: &Columns| -> Result<[f64; 3], String> {
            let mut vector = [0.0; 3];
            for (axis, column) in columns {
                vector[*axis] = row.number(*column)?;
            }
            Ok(vector)
        };
        let radius = row.number(header.radius)?;
        if radius <= 0.0 {
            return Err(format!(
                "line {}: the radius is {radius}, it must be above 0",
                row.line()
            ));
        }
        let name = header.material.and_then(|column| row.text(column));
        let material = match name.unwrap_or_default() {
            "" => default,
            name => materials
                .iter()
                .position(|known| known == name)
                .ok_or_else(|| format!("line {}: there is no material `{name}`", row.line()))?,
        };
        if let Some(column) = header.id {
            let text = row.text(column).unwrap_or_default();
            let id = text.parse().map_err(|_| {
                let line = row.line();
                format!("line {line}: the id is `{text}`, it must be a whole number from 0 on")
            })?;
            ids.push((id, grains.len()));
        }
        grains.push(Grain {
            position: vector(&header.position)?,
            radius,
            velocity: vector(&header.velocity)?,
            angular_velocity: vector(&header.angular_velocity)?,
            material,
        });
    }
    if grains.is_empty() {
        return Err("the sample holds no grain".into());
    }
    if ids.is_empty() {
        return Ok(grains);
    }
    ids.sort_unstable();
    if let Some(pair) = ids.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(format!("two grains have the id {}", pair[0].0));
    }
    Ok(ids.iter().map(|(_, n)| grains[*n]).collect())
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
        let moving = |grain: Grain, velocity, angular_velocity| Grain {
            velocity,
            angular_velocity,
            ..grain
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
        let flat = [
            flat[0],
            moving(flat[1], [0.1, -1.0 / 3.0, 0.0], [0.0, 0.0, 7.0]),
        ];
        let solid = [moving(solid[0], [1.0, 2.0, 1.0 / 3.0], [-4.0, 5.0, 6.0])];
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
    fn grains_start_with_the_motion_of_their_columns_in_the_order_of_their_ids() {
        let text = "id,radius,velocity_y,x,y,angular_velocity_z\n7,1,-2,10,20,3\n2,0.5,0,11,21,0\n";
        let grains = read(text, 2, &[], 4).unwrap();
        assert_eq!(grains[0].position, [11.0, 21.0, 0.0]);
        assert_eq!(
            grains[1],
            Grain {
                position: [10.0, 20.0, 0.0],
                radius: 1.0,
                velocity: [0.0, -2.0, 0.0],
                angular_velocity: [0.0, 0.0, 3.0],
                material: 4,
            }
        );
    }

    #[test]
    fn an_unknown_column_is_refused_by_its_name() {
        let error = |header: &str, dimension| {
            let row = vec!["1"; header.split(',').count()].join(",");
            read(&format!("{header}\n{row}\n"), dimension, &[], 0).unwrap_err()
        };
        let said = error("x,y,radius,velocty_x", 2);
        assert!(said.contains("`velocty_x`"), "{said}");
        assert!(said.contains("did you mean `velocity_x`?"), "{said}");
        let said = error("x,y,z,radius", 2);
        assert!(
            said.contains("`z`") && said.contains("two dimensions"),
            "{said}"
        );
        let said = error("x,y,z,radius,temperature_of_the_grain", 3);
        assert!(said.contains("`temperature_of_the_grain`"), "{said}");
        assert!(said.contains("Known: x, y, z, radius"), "{said}");
        assert!(error("x,y,radius,radius", 2).contains("twice"));
        let twice = read("x,y,radius,id\n1,2,3,5\n2,2,3,5\n", 2, &[], 0);
        assert!(twice.unwrap_err().contains("id 5"));
        let half = read("x,y,radius,id\n1,2,3,0.5\n", 2, &[], 0);
        assert!(half.unwrap_err().contains("whole number"));
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
