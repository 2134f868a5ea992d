//! Checks of a checkpoint against its case: of its manifest before memory is allocated, of its grains and contacts
//! after they are read.

use super::{EARLIER, TABLES};
use crate::averages::SUMS;
use base::error::Error;
use base::number::to_usize;
use dem::particles::SPHERE;
use dem::space::{PlaneSpace, Space, Volume};
use dem::state::{Contacts, NamedColumns, Values};
use io::checkpoint::Manifest;
use io::data::Kind;
use serde_json::{Value, json};

/// Contents that a checkpoint of a case may have, compared with a manifest before memory is allocated.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    /// `true` if the preparation is complete: earlier checkpoints contain less.
    pub prepared: bool,
    /// Populations; none without a lattice.
    pub lattice: Option<ExpectedPopulations>,
    /// Length of the state of the seepage or of the water in joints; none without these.
    pub seepage: Option<usize>,
    /// `true` if the number of these values may be smaller.
    pub seepage_varies: bool,
    /// Maximum number of grains, blocks and bodies; none if nothing is solid.
    pub grains: Option<u64>,
    /// Number of steps of the case.
    pub steps: u64,
    /// Maximum number of warm-up steps of the fluid.
    pub warm_up: u64,
    /// Longest edge of the domain \[m\].
    pub length: f64,
}

/// Populations that a checkpoint of a case has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpectedPopulations {
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Number of velocities.
    pub velocities: usize,
    /// Bytes per number.
    pub bytes: usize,
}

/// Array that a checkpoint may have.
struct KnownArray {
    name: String,
    kind: Kind,
    shape: Vec<usize>,
}

/// Returns an array.
fn known_array(name: impl Into<String>, kind: Kind, shape: Vec<usize>) -> KnownArray {
    KnownArray {
        name: name.into(),
        kind,
        shape,
    }
}

/// Maximum mean number of contacts per grain.
const MAX_CONTACTS: u64 = 1000;

impl Expected {
    /// Checks that a manifest can belong to a checkpoint of the case.
    ///
    /// # Errors
    /// If it cannot; the text names the mismatch.
    pub fn fits(&self, manifest: &Manifest) -> Result<(), String> {
        let attributes = &manifest.attributes;
        let mut known = Vec::new();
        let count = |name: &str| {
            let value = &attributes[name];
            let number = if value.is_null() {
                Some(0)
            } else {
                value.as_u64()
            };
            number.ok_or_else(|| format!("its `{name}` is {value}, which is not a count"))
        };
        // The steps of a preparation are counted separately.
        if self.prepared && manifest.step > self.steps {
            return Err(format!(
                "it was written at step {}, but the case ends at step {}",
                manifest.step, self.steps
            ));
        }
        if let Some(lattice) = &self.lattice {
            let [nx, ny, nz] = lattice.cells;
            let cells = |numbers: usize| vec![nz, ny, nx, numbers];
            let kind = if lattice.bytes == 4 {
                Kind::F32
            } else {
                Kind::F64
            };
            known.push(known_array("populations", kind, cells(lattice.velocities)));
            if attributes["velocities"] == json!(true) {
                known.push(known_array("velocities", Kind::F32, cells(3)));
            }
            if attributes[super::SURFACE_LOSS].is_string() {
                let numbers = cells(super::SURFACE_NUMBERS);
                known.push(known_array(super::SURFACE, Kind::F64, numbers));
            }
            if count("averages")? > manifest.step.saturating_add(1) {
                return Err("it holds more averages than steps".to_owned());
            }
            known.push(known_array(EARLIER, Kind::F64, cells(3)));
            if count("averages")? > 0 || manifest.arrays.iter().any(|a| a.name == "averages") {
                known.push(known_array("averages", Kind::F64, cells(SUMS)));
            }
            let steps = count("fluid_steps")?;
            if self.prepared && steps < manifest.step
                || steps > manifest.step.saturating_add(self.warm_up)
            {
                return Err(format!(
                    "its fluid has done {steps} steps at step {}",
                    manifest.step
                ));
            }
        }
        let seepage = count("seepage")?;
        if seepage > 0 {
            let expected = self.seepage.unwrap_or(0);
            let found = to_usize(seepage);
            if found > expected || found < expected && !self.seepage_varies {
                return Err(format!(
                    "it holds {seepage} numbers of the seepage or of joints; the case needs {expected}"
                ));
            }
            known.push(known_array("seepage", Kind::F64, vec![to_usize(seepage)]));
        }
        self.tables(attributes, &mut known)?;
        for array in &manifest.arrays {
            let Some(KnownArray { kind, shape, .. }) =
                known.iter().find(|known| known.name == array.name)
            else {
                return Err(format!(
                    "it holds an array {} that the case does not have",
                    array.name
                ));
            };
            if array.kind != *kind || array.shape != *shape {
                return Err(format!(
                    "its array {} has the shape {:?} and the type {:?}; the case needs {shape:?} and {kind:?}",
                    array.name, array.shape, array.kind
                ));
            }
        }
        // The arrays of an unfinished preparation depend on its progress; reading them reports missing ones.
        let lacks = |name: &str| name != EARLIER && manifest.arrays.iter().all(|a| a.name != name);
        match known.iter().find(|known| lacks(&known.name)) {
            Some(known) if self.prepared => Err(format!("it lacks the array {}", known.name)),
            _ => Ok(()),
        }
    }

    /// Checks the sizes of the tables of grains and contacts.
    fn tables(&self, attributes: &Value, known: &mut Vec<KnownArray>) -> Result<(), String> {
        let most = self.grains.unwrap_or(0);
        for (n, kind) in TABLES.iter().enumerate() {
            let rows = attributes["rows"][n].as_u64();
            let rows = rows.ok_or_else(|| format!("it does not state its number of {kind}"))?;
            let most = if n == 0 {
                most
            } else {
                most.saturating_mul(MAX_CONTACTS)
            };
            if rows > most {
                return Err(format!(
                    "it holds {rows} {kind}, but the case has at most {most}"
                ));
            }
            for column in attributes["columns"][n].as_array().into_iter().flatten() {
                let (Some(name), Some(values)) = (column[0].as_str(), column[1].as_str()) else {
                    return Err(format!("a column of its {kind} has no name"));
                };
                let values = match values {
                    "real" => Kind::F64,
                    "whole" => Kind::U64,
                    other => {
                        return Err(format!(
                            "a column of its {kind} has an unknown type or {other} numbers \
                                                 per row"
                        ));
                    }
                };
                if rows > 0 {
                    let name = format!("{kind}_{name}");
                    known.push(known_array(name, values, vec![to_usize(rows)]));
                }
                if known.len() > MAX_ARRAYS {
                    return Err(format!("it has more than {MAX_ARRAYS} columns"));
                }
            }
        }
        if !matches!(attributes["notes"], Value::Object(_) | Value::Null) {
            return Err("its notes are not an object".to_owned());
        }
        let radius = &attributes["typical_radius"];
        let plausible = |r: f64| r > 0.0 && r <= self.length;
        if self.prepared && self.grains.is_some() && !radius.as_f64().is_some_and(plausible) {
            return Err(format!(
                "its typical radius is {radius}, in a domain of {} m",
                self.length
            ));
        }
        Ok(())
    }
}

/// Limits of the grains and contacts of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct StateLimits {
    /// Edges of the domain \[m\].
    pub size: [f64; 3],
    /// Periodic axes. Grains and contacts have no shift along the others.
    pub periodic: [bool; 3],
    /// Number of dimensions.
    pub dimension: usize,
    /// Density of each material [kg/m³]; 1 for one without a density.
    pub densities: Vec<f64>,
    /// Mass \[kg\] and mean moment of inertia [kg m²] of each shape of a block at a density of 1 kg/m³.
    pub shapes: Vec<[f64; 2]>,
    /// Radius of the smallest grain or body \[m\]; 0 if the grains of the case grow.
    pub smallest: f64,
    /// Radius of the largest grain, body or block \[m\].
    pub largest: f64,
}

/// Upper bound of ids: contacts store the ids of two grains in one number.
const IDS: u64 = 1 << 32;
/// Maximum number of solid steps: sums of larger numbers could overflow.
const LARGEST: u64 = 1 << 53;
/// Maximum distance of a grain from the domain, in lengths of the domain: along a periodic axis positions are not
/// wrapped.
const FARTHEST: f64 = 1e6;
/// Maximum number of periods by which a grain or the partner of a contact may be shifted.
const SHIFTS: i64 = 1 << 20;
/// Maximum magnitude of a force, a moment or a number of a contact, as of any quantity of a case.
const MAGNITUDE: f64 = 1e30;
/// Maximum speed [m/s].
const SPEED: f64 = 3e8;
/// Relative rounding error of radii.
const ROUNDING: f64 = 1e-6;
/// Relative rounding error of masses and moments of inertia, which follow from density and shape.
const MASS_ROUNDING: f64 = 1e-9;

impl StateLimits {
    /// Checks that grains and contacts are possible in the case: values that no run could have written would make
    /// the next step fail or corrupt memory. Only the first rank reads the grains, so that other ranks compare the
    /// contacts with each other alone.
    ///
    /// # Errors
    /// If a value is impossible, [`Error::Io`] with the name of the column.
    pub fn hold(&self, grains: &NamedColumns, contacts: &Contacts) -> Result<(), Error> {
        self.grains(grains)?;
        let mut ids = match grains.columns.iter().find(|(name, _)| name == "id") {
            Some((_, Values::Whole(ids))) => ids.clone(),
            _ => Vec::new(),
        };
        ids.sort_unstable();
        if ids.windows(2).any(|pair| pair[0] == pair[1]) {
            return mismatch("two grains have the same id");
        }
        if contacts.steps > LARGEST {
            return mismatch(&format!("{} solid steps", contacts.steps));
        }
        let known = |id: &u64| ids.is_empty() && *id < IDS || ids.binary_search(id).is_ok();
        let walls = contacts.faces.rows() as u64;
        for (table, kind) in [
            (&contacts.grains, "contacts"),
            (&contacts.walls, "contacts with walls"),
        ] {
            for (name, values) in &table.columns {
                let good = match (name.as_str(), values) {
                    ("first" | "second" | "grain", Values::Whole(ids)) => ids.iter().all(known),
                    ("wall", Values::Whole(numbers)) => numbers.iter().all(|wall| *wall < walls),
                    (_, Values::Whole(numbers)) if name.starts_with("shift") => {
                        self.shifts(name, numbers)
                    }
                    (_, Values::Whole(numbers)) => numbers.iter().all(|n| *n < IDS),
                    (_, Values::Real(numbers)) => within(numbers, -MAGNITUDE, MAGNITUDE),
                };
                if !good {
                    return mismatch(&format!(
                        "column {name} of the {kind} holds values that no contact can have"
                    ));
                }
            }
        }
        for (name, values) in &contacts.faces.columns {
            let good = match values {
                Values::Real(values) => within(values, -MAGNITUDE, MAGNITUDE),
                Values::Whole(values) => values.iter().all(|n| *n < self.materials()),
            };
            if !good {
                return mismatch(&format!(
                    "column {name} of the walls holds values that no wall can have"
                ));
            }
        }
        Ok(())
    }

    /// Checks the columns of the grains.
    fn grains(&self, grains: &NamedColumns) -> Result<(), Error> {
        for (name, values) in &grains.columns {
            let good = match values {
                Values::Real(values) => {
                    let [least, most] = self.range(name);
                    within(values, least, most)
                }
                Values::Whole(values) => match name.as_str() {
                    "id" => values.iter().all(|id| *id < IDS),
                    "material" => values.iter().all(|n| *n < self.materials()),
                    "kind" => values.iter().all(|kind| *kind < 3),
                    "shape" => {
                        let shapes = self.shapes.len() as u64;
                        let shape = |s: u64| s < shapes || s == u64::from(SPHERE);
                        values.iter().all(|s| shape(*s))
                    }
                    _ if name.starts_with("shift") => self.shifts(name, values),
                    _ => values.iter().all(|n| *n < LARGEST),
                },
            };
            if !good {
                return mismatch(&format!(
                    "column {name} of the grains holds values that no grain can have"
                ));
            }
        }
        self.masses(grains)?;
        let turns: Vec<&[f64]> = ["x", "y", "z", "w"]
            .iter()
            .filter_map(|axis| {
                let name = format!("orientation_{axis}");
                let found = grains.columns.iter().find(|(known, _)| *known == name);
                match found {
                    Some((_, Values::Real(values))) => Some(values.as_slice()),
                    _ => None,
                }
            })
            .collect();
        if let [x, y, z, w] = turns[..] {
            let squares = (0..x.len()).map(|k| {
                [x, y, z, w]
                    .iter()
                    .filter_map(|part| part.get(k))
                    .map(|q| q * q)
                    .sum::<f64>()
            });
            // In a scene with blocks, spheres have the identity as orientation, or zeros.
            let mut squares = squares.filter(|square| *square > 0.0);
            if squares.any(|square| (square - 1.0).abs() > 1e-6) {
                return mismatch("an orientation of a grain is not a rotation");
            }
        }
        Ok(())
    }

    /// Returns the number of materials, at least 1.
    fn materials(&self) -> u64 {
        self.densities.len().max(1) as u64
    }

    /// Checks that masses and moments of inertia are those of the density and the shape of each grain.
    fn masses(&self, grains: &NamedColumns) -> Result<(), Error> {
        let find = |name: &str| grains.columns.iter().find(|(known, _)| known == name);
        let real = |name: &str| match find(name) {
            Some((_, Values::Real(values))) => values.as_slice(),
            _ => &[],
        };
        let whole = |name: &str| match find(name) {
            Some((_, Values::Whole(values))) => values.as_slice(),
            _ => &[],
        };
        let (radii, materials, shapes) = (real("radius"), whole("material"), whole("shape"));
        let (masses, inertias) = (real("mass"), real("inertia"));
        for (k, (radius, material)) in radii.iter().zip(materials).enumerate() {
            let density = self.densities.get(to_usize(*material)).unwrap_or(&1.0);
            let shape = shapes
                .get(k)
                .and_then(|shape| self.shapes.get(to_usize(*shape)));
            let expected = match shape {
                Some(unit) => unit.map(|number| density * number),
                None => self.of_ball(*radius, *density),
            };
            for (name, values, expected) in [
                ("mass", masses, expected[0]),
                ("inertia", inertias, expected[1]),
            ] {
                let Some(value) = values.get(k) else {
                    continue;
                };
                if (value - expected).abs() > MASS_ROUNDING * expected {
                    return mismatch(&format!(
                        "column {name} of the grains holds values that no grain can have: {value} where a density of \
                         {density} kg/m3 and the shape give {expected}"
                    ));
                }
            }
        }
        Ok(())
    }

    /// Returns mass and moment of inertia of a disc or sphere.
    fn of_ball(&self, radius: f64, density: f64) -> [f64; 2] {
        if self.dimension == 2 {
            let mass = PlaneSpace::mass(density, radius);
            [mass, PlaneSpace::inertia(mass, radius)]
        } else {
            let mass = Volume::mass(density, radius);
            [mass, Volume::inertia(mass, radius)]
        }
    }

    /// Returns `true` if all numbers of periods, stored as whole numbers, are at most [`SHIFTS`] in magnitude, and 0
    /// along an axis that is not periodic.
    fn shifts(&self, name: &str, numbers: &[u64]) -> bool {
        let axis = name.chars().last().and_then(|last| "xyz".find(last));
        let most = if axis.is_none_or(|axis| self.periodic[axis]) {
            SHIFTS
        } else {
            0
        };
        let small = |n: &u64| (-most..=most).contains(&n.cast_signed());
        numbers.iter().all(small)
    }

    /// Returns the minimum and maximum of a column of real numbers.
    fn range(&self, name: &str) -> [f64; 2] {
        let both = |most: f64| [-most, most];
        let axis = |name: &str| "xyz".find(name.chars().last()?);
        let (more, less) = (1.0 + ROUNDING, 1.0 - ROUNDING);
        match name {
            "radius" => [less * self.smallest, more * self.largest],
            // The exact value is checked together with density and shape.
            "mass" | "inertia" => [0.0, MAGNITUDE],
            _ if name.starts_with("position") || name.starts_with("start") => {
                both(axis(name).map_or(MAGNITUDE, |a| FARTHEST * self.size[a].max(1.0)))
            }
            _ if name.starts_with("velocity") || name.starts_with("last_velocity") => both(SPEED),
            _ if name.starts_with("moisture") => [0.0, MAGNITUDE],
            _ if name.starts_with("orientation") => both(1.0 + 1e-6),
            _ => both(MAGNITUDE),
        }
    }
}

fn mismatch(what: &str) -> Result<(), Error> {
    Err(Error::Io(format!("the checkpoint cannot be used: {what}")))
}

/// Returns `true` if all numbers lie in a range; none is NaN.
fn within(numbers: &[f64], least: f64, most: f64) -> bool {
    numbers.iter().all(|x| (least..=most).contains(x))
}

/// Maximum number of arrays in a checkpoint.
const MAX_ARRAYS: usize = 1000;
