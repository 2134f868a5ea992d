//! Prepared sample of grains as a table, so that all runs of a study can start from the same sample.
//!
//! A header names the columns, in any order:
//!
//! | column | content | default |
//! |---|---|---|
//! | `x`, `y`, `z` (3-D only) | centre \[m\] | required |
//! | `radius` (or `diameter`) | \[m\] | required |
//! | `material` | name in the case | the material of the grains |
//! | `velocity_x`, `velocity_y`, `velocity_z` (3-D only) | [m/s] | 0 |
//! | `angular_velocity_x`, `_y` (3-D only), `angular_velocity_z` | [rad/s] | 0 |
//! | `id` | whole number, each once: grains are sorted by it | the order of the lines |
//!
//! Other columns are refused. Numbers are written with all digits, so that reading a sample restores the same bits.
//! [`io::sheet`] states which separators and units are read. Files of other programs are converted first
//! ([`foreign`]); columns that a sample does not have are not read from them.

mod foreign;

use base::geometry::Vector;
use case::Case;
use case::check::nearest;
use case::grains::SampleFile;
use io::sheet::{Column, Refusal, Sheet, SheetRow, Unit};
use serde::Serialize;
use std::fmt::Write;

/// Grain with its state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ListedGrain {
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

/// Path of the sample file in a case.
pub(crate) const PATH: &str = "grains.initial.file.path";
/// Remedy for a file that cannot be read.
pub(crate) const REMEDY: &str = "correct the path (relative to the case) or the file";

/// Range of the magnitudes that a case may contain.
const SCALES: std::ops::RangeInclusive<f64> = 1e-30..=1e30;
/// Maximum magnitude of coordinates and velocities, as for all numbers of a case.
const LARGEST: f64 = 1e30;

/// Reads the sample of a case, converts it to m and moves it to the position given in the case.
///
/// # Errors
///
/// If the file is not a valid sample; the text names the file, the line or the column.
pub(crate) fn load(case: &Case, written: &SampleFile) -> Result<Vec<ListedGrain>, String> {
    let text = io::plain::text(
        &case.directory.join(&written.path),
        io::plain::LONGEST_INPUT,
    );
    let text = text.map_err(|e| e.to_string())?;
    let names: Vec<String> = case.materials.keys().cloned().collect();
    let usual = case.grains.as_ref().map(|grains| &grains.material);
    let material = names.iter().position(|name| Some(name) == usual);
    let dimension = case.domain.size.0.len();
    let mut grains = read(&text, dimension, &names, material.unwrap_or(0))
        .map_err(|e| format!("{}: {e}", written.path.display()))?;
    // A scale out of range is a finding of its own.
    if !SCALES.contains(&written.scale) {
        return Ok(Vec::new());
    }
    let origin = written.origin.as_ref().map(Vector::to_array);
    for (n, grain) in grains.iter_mut().enumerate() {
        grain.convert(written.scale, origin);
        if !(grain.radius > 0.0 && grain.radius.is_finite()) {
            return Err(format!(
                "grain {} has a radius of {} m after multiplication by the scale {:e}",
                n + 1,
                grain.radius,
                written.scale
            ));
        }
        if let Some((what, large)) = grain.too_large() {
            return Err(format!(
                "grain {} has a {what} of {large:e}; numbers of a sample are at most {LARGEST:e} in magnitude",
                n + 1
            ));
        }
    }
    Ok(grains)
}

impl ListedGrain {
    /// Returns the name and the value of a number that no list may contain either.
    fn too_large(&self) -> Option<(&'static str, f64)> {
        let all = [
            ("position", self.position),
            ("velocity", self.velocity),
            ("angular velocity", self.angular_velocity),
        ];
        let numbers = all.into_iter().flat_map(|(what, v)| v.map(|x| (what, x)));
        numbers
            .into_iter()
            .find(|(_, x)| x.is_nan() || x.abs() > LARGEST)
    }

    /// Converts lengths of a file whose unit is `scale` m, and moves the grain by `origin` \[m\].
    fn convert(&mut self, scale: f64, origin: Option<[f64; 3]>) {
        self.radius *= scale;
        self.position = self.position.map(|x| x * scale);
        self.velocity = self.velocity.map(|v| v * scale);
        for (x, by) in self.position.iter_mut().zip(origin.iter().flatten()) {
            *x += by;
        }
    }
}

const POSITION: [&str; 3] = ["x", "y", "z"];
const VELOCITY: [&str; 3] = ["velocity_x", "velocity_y", "velocity_z"];
const SPIN: [&str; 3] = [
    "angular_velocity_x",
    "angular_velocity_y",
    "angular_velocity_z",
];

/// Returns the names of the columns of the rotation rate: in 2-D only that about z.
fn spin(dimension: usize) -> &'static [&'static str] {
    &SPIN[if dimension == 2 { 2 } else { 0 }..]
}

/// Returns the sample as CSV; `materials` are the names of the material indices. Columns of velocities and rotation
/// rates are written only if one of them is not zero.
#[must_use]
pub fn write(grains: &[ListedGrain], dimension: usize, materials: &[String]) -> String {
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

/// Alternative names of the radius, with the factor from diameter to radius.
const RADIUS: &[(&str, f64)] = &[
    ("r", 1.0),
    ("rad", 1.0),
    ("radii", 1.0),
    ("diameter", 2.0),
    ("d", 2.0),
    ("dia", 2.0),
    ("diam", 2.0),
];
/// Alternative names of centres, velocities and rotation rates.
const OTHERS: [&[(&str, f64)]; 9] = [
    &[
        ("pos_x", 1.0),
        ("position_x", 1.0),
        ("xu", 1.0),
        ("points_0", 1.0),
        ("position_0", 1.0),
    ],
    &[
        ("pos_y", 1.0),
        ("position_y", 1.0),
        ("yu", 1.0),
        ("points_1", 1.0),
        ("position_1", 1.0),
    ],
    &[
        ("pos_z", 1.0),
        ("position_z", 1.0),
        ("zu", 1.0),
        ("points_2", 1.0),
        ("position_2", 1.0),
    ],
    &[
        ("vx", 1.0),
        ("vel_x", 1.0),
        ("v_0", 1.0),
        ("velocity_0", 1.0),
    ],
    &[
        ("vy", 1.0),
        ("vel_y", 1.0),
        ("v_1", 1.0),
        ("velocity_1", 1.0),
    ],
    &[
        ("vz", 1.0),
        ("vel_z", 1.0),
        ("v_2", 1.0),
        ("velocity_2", 1.0),
    ],
    &[
        ("omegax", 1.0),
        ("spin_x", 1.0),
        ("wx", 1.0),
        ("omega_0", 1.0),
        ("angular_velocity_0", 1.0),
    ],
    &[
        ("omegay", 1.0),
        ("spin_y", 1.0),
        ("wy", 1.0),
        ("omega_1", 1.0),
        ("angular_velocity_1", 1.0),
    ],
    &[
        ("omegaz", 1.0),
        ("spin_z", 1.0),
        ("wz", 1.0),
        ("omega_2", 1.0),
        ("angular_velocity_2", 1.0),
    ],
];

/// Columns of a sample, by their positions in the list passed to the reader.
struct Columns {
    list: Vec<Column>,
    position: Vec<usize>,
    velocity: Vec<usize>,
    /// Axis and position of each rotation rate.
    spin: Vec<(usize, usize)>,
    radius: usize,
    material: usize,
    id: usize,
    /// Coordinate normal to the plane, in a 2-D sample of another program.
    plane: Option<usize>,
}

impl Columns {
    /// Returns the columns of samples in 2 or 3 dimensions.
    fn new(dimension: usize) -> Self {
        let axes = dimension.min(3);
        let mut list = Vec::new();
        let mut add = |name, others, unit, needed| {
            list.push(Column {
                name,
                aliases: others,
                unit,
                required: needed,
            });
            list.len() - 1
        };
        let position = (0..axes).map(|a| add(POSITION[a], OTHERS[a], Unit::Length, true));
        let position = position.collect();
        let radius = add("radius", RADIUS, Unit::Length, true);
        let material = add("material", &[], Unit::Text, false);
        let velocity = (0..axes).map(|a| add(VELOCITY[a], OTHERS[3 + a], Unit::Velocity, false));
        let velocity = velocity.collect();
        let spin = (3 - spin(dimension).len()..3)
            .map(|a| (a, add(SPIN[a], OTHERS[6 + a], Unit::Rotation, false)));
        let spin = spin.collect();
        let id = add("id", &[], Unit::Text, false);
        Self {
            list,
            position,
            velocity,
            spin,
            radius,
            material,
            id,
            plane: None,
        }
    }

    /// Adds the coordinate normal to the plane.
    fn add_plane(&mut self) {
        self.plane = Some(self.list.len());
        self.list.push(Column {
            name: POSITION[2],
            aliases: OTHERS[2],
            unit: Unit::Length,
            required: false,
        });
    }

    /// Returns the error about a column that samples do not have.
    fn unknown(&self, name: &str) -> String {
        let known: Vec<&str> = self.list.iter().map(|column| column.name).collect();
        let list = known.join(", ");
        let flat = [POSITION, VELOCITY, SPIN].as_flattened().contains(&name)
            || OTHERS
                .iter()
                .copied()
                .flatten()
                .any(|(other, _)| *other == name);
        let meant = match nearest(&name.to_lowercase(), &known) {
            _ if flat => "this is a 2-D problem.".into(),
            Some(close) => format!("did you mean `{close}`?"),
            None => "remove it.".into(),
        };
        format!("the header has an unknown column `{name}`: {meant} A sample can have: {list}")
    }
}

/// Reads a sample; grains without a material get `default`.
///
/// # Errors
/// If the text is not a valid sample; the error names the line or the column.
pub fn read(
    text: &str,
    dimension: usize,
    materials: &[String],
    default: usize,
) -> Result<Vec<ListedGrain>, String> {
    let mut columns = Columns::new(dimension);
    let foreign = foreign::header(text, &columns.list).map_err(|e| e.to_string())?;
    if foreign.is_some() && dimension == 2 {
        columns.add_plane();
    }
    let sheet = match foreign {
        Some(header) => Sheet::below(header, &columns.list, false),
        None => Sheet::new(text, &columns.list),
    };
    let sheet = sheet.map_err(|refusal| match refusal {
        Refusal::Sentence(sentence) => sentence,
        Refusal::Unknown(name) => columns.unknown(&name),
    })?;
    let mut plane = None;
    let mut grains = Vec::new();
    let mut ids: Vec<(u64, usize)> = Vec::new();
    sheet.each(|row| {
        let (grain, id) = grain(row, &sheet, &columns, materials, default)?;
        ids.extend(id.map(|id| (id, grains.len())));
        if let Some(column) = columns.plane.filter(|column| sheet.has(*column)) {
            let z = row.number(column)? + 0.0;
            let first = *plane.get_or_insert(z);
            if z.total_cmp(&first).is_ne() {
                let line = row.line();
                return Err(format!(
                    "line {line}: z is {z}, but the first grain has {first}: the grains of a 2-D problem must \
                     lie in one plane"
                ));
            }
        }
        grains.push(grain);
        Ok(())
    })?;
    if grains.is_empty() {
        return Err("the sample contains no grain".into());
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

/// Returns the grain of a row, and its id if the table has ids.
fn grain(
    row: &SheetRow<'_>,
    sheet: &Sheet<'_>,
    columns: &Columns,
    materials: &[String],
    default: usize,
) -> Result<(ListedGrain, Option<u64>), String> {
    let line = row.line();
    let number = |column: usize| match sheet.has(column) {
        true => row.number(column),
        false => Ok(0.0),
    };
    let mut grain = ListedGrain {
        position: [0.0; 3],
        radius: 0.0,
        velocity: [0.0; 3],
        angular_velocity: [0.0; 3],
        material: default,
    };
    for (a, column) in columns.position.iter().enumerate() {
        grain.position[a] = number(*column)?;
    }
    for (a, column) in columns.velocity.iter().enumerate() {
        grain.velocity[a] = number(*column)?;
    }
    for (a, column) in &columns.spin {
        grain.angular_velocity[*a] = number(*column)?;
    }
    grain.radius = row.number(columns.radius)?;
    if grain.radius <= 0.0 {
        let radius = grain.radius;
        return Err(format!(
            "line {line}: the radius is {radius}; it must be above 0"
        ));
    }
    let name = row.text(columns.material);
    if !name.is_empty() {
        let known = materials.iter().position(|known| known == name);
        grain.material =
            known.ok_or_else(|| format!("line {line}: there is no material `{name}`"))?;
    }
    if !sheet.has(columns.id) {
        return Ok((grain, None));
    }
    let text = row.text(columns.id);
    let id = text.parse().map_err(|_| {
        format!("line {line}: the id is `{text}`; it must be a whole number of at least 0")
    })?;
    Ok((grain, Some(id)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_read_back_is_the_sample_written() {
        let materials = ["sand".to_string(), "clay".to_string()];
        let grain = |x: f64, z: f64, material| ListedGrain {
            position: [x, 0.1 + x, z],
            radius: 1e-4 / 3.0,
            velocity: [0.0; 3],
            angular_velocity: [0.0; 3],
            material,
        };
        let moving = |grain: ListedGrain, velocity, angular_velocity| ListedGrain {
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
            ListedGrain {
                position: [10.0, 20.0, 0.0],
                radius: 1.0,
                velocity: [0.0, -2.0, 0.0],
                angular_velocity: [0.0, 0.0, 3.0],
                material: 4,
            }
        );
    }

    /// Checks that a table without a required column names its unknown columns, one of which may be meant.
    #[test]
    fn an_unknown_column_may_be_the_missing_one() {
        let said = |text: &str| read(text, 2, &[], 0).unwrap_err();
        let one = said("x,y,size\n1,2,0.5\n");
        assert!(
            one.contains("no column `radius`, but an unknown column `size`"),
            "{one}"
        );
        let two = said("x,y,colour,raduis\n1,2,3,0.5\n");
        assert!(
            two.contains("no column `radius`, but the unknown columns `colour`, `raduis`"),
            "{two}"
        );
        let none = said("x,y\n1,2\n");
        assert!(
            none.contains("no column `radius`") && !none.contains("unknown"),
            "{none}"
        );
        let only = said("x,y,radius,colour\n1,2,0.5,3\n");
        assert!(
            only.contains("unknown column `colour`: remove it."),
            "{only}"
        );
    }

    #[test]
    fn names_with_capitals_units_and_diameters_are_read() {
        let usual = read("x,y,radius,velocity_x\n1,0.02,0.5,3\n", 2, &[], 0).unwrap();
        for text in [
            "X,Y,Radius,VX\n1,0.02,0.5,3\n",
            "x [m],y [cm],radius [m],velocity_x [m/s]\n1,2,0.5,3\n",
            "x (m); y (mm); Diameter (m); vx\n1; 20; 1; 3;;\n;;;\n",
            "\u{feff}x\ty\tradius\tvelocity-x\r\n[m]\t[mm]\t[m]\t[m/s]\r\n1\t20\t0.5\t3\r\n",
            "sep=;\nx;y;r;vx\n1;0.02;0.5;3\n",
            "% made by hand\nx y d vx\n1 2e-2 1 3",
            "x,y,r,vx\r1,0.02,0.5,3\r",
            "x/m,y/mm,r/m,vx\n1,20,0.5,3",
        ] {
            assert_eq!(read(text, 2, &[], 0).unwrap(), usual, "{text}");
        }
    }

    #[test]
    fn a_grid_of_a_map_is_called_one() {
        let text = "ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 5\nNODATA_value -9999\n1 2\n3 4\n";
        let grass = "north: 9\nsouth: 0\neast: 9\nwest: 0\nrows: 2\ncols: 2\n1 2\n3 4\n".to_owned();
        let surfer = "DSAA\n2 2\n0 9\n0 9\n1 4\n1 2\n3 4\n".to_owned();
        for text in [text.to_owned(), text.to_uppercase(), grass, surfer] {
            let said = read(&text, 3, &[], 0).unwrap_err();
            assert!(said.contains("line 1: this is a grid of a map"), "{said}");
            assert!(said.contains("`x,y,z,radius`"), "{said}");
        }
    }

    /// Checks the message about files of other programs that begin with a title.
    #[test]
    fn a_first_line_that_names_no_column_is_called_so() {
        for (text, example) in [
            (
                "\"Y(X), created by a digitizer\"\n\n1\t2\n",
                "`x,y,z,radius`",
            ),
            ("name=Example\nd0=1.00\n4\n1 2 3\n", "`x,y,z,radius`"),
            ("A packing of 2 spheres\n1 2 3 0.1\n", "`x y z radius`"),
        ] {
            let said = read(text, 3, &[], 0).unwrap_err();
            let expected = format!(
                "line 1 names none of the columns: the first line of a table is such as {example}"
            );
            assert_eq!(said, expected, "{text}");
        }
    }

    #[test]
    fn the_line_of_names_that_is_proposed_has_the_separator_of_the_rows() {
        for (rows, names) in [
            ("1 2 3 4\n", "`x y z radius`"),
            ("1\t2\t3\t4\n", "`x y z radius`"),
            ("1;2;3;4\n", "`x;y;z;radius`"),
            ("1,2,3,4\n", "`x,y,z,radius`"),
        ] {
            let said = read(rows, 3, &[], 0).unwrap_err();
            assert!(said.contains(names), "{said}");
            let with_names = format!("{}\n{rows}", names.trim_matches('`'));
            assert_eq!(read(&with_names, 3, &[], 0).unwrap()[0].radius, 4.0);
        }
    }

    #[test]
    fn rows_of_another_length_and_decimal_commas_are_refused() {
        let says = |text: &str, reason: &str| {
            let said = read(text, 3, &[], 0).unwrap_err();
            assert!(said.contains(reason), "{text}: {said}");
        };
        says(
            "x,y,z,radius\n4,5,6,5,7,5,0,5\n",
            "line 2 has 8 cells where the header names 4",
        );
        says(
            "x,y,z,radius\n4,5,6,5,7,5,0,5\n",
            "points (4.5 instead of 4,5)",
        );
        says(
            "x;y;z;radius\n1;2;3;4\n4,5;6,5;7,5;0,5\n",
            "line 3: column `x` holds `4,5`",
        );
        says(
            "x;y;z;radius\n4,5;6,5;7,5;0,5\n",
            "write a decimal point, 4.5",
        );
        says("x,y,z,radius\n\"4,5\",6,7,1\n", "write a decimal point");
        says("x,y,z,radius\n1,2,3\n", "line 2 has 3 cells");
        says("1,2,3,4\n5,6,7,8\n", "`x,y,z,radius`");
        says(
            "x,y,z,radius [kg]\n1,2,3,4\n",
            "`radius [kg]` is in kg, expected m",
        );
        says(
            "x,y,z,r,diameter\n1,2,3,4,8\n",
            "`r` and `diameter` both state the radius",
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
            said.contains("`z`") && said.contains("2-D problem"),
            "{said}"
        );
        let said = error("x,y,z,radius,temperature_of_the_grain", 3);
        assert!(said.contains("`temperature_of_the_grain`"), "{said}");
        assert!(said.contains("can have: x, y, z, radius"), "{said}");
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
