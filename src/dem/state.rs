//! Grains and contacts as named columns, for checkpoints and output, and back.
//!
//! A table of grains holds all that the next step depends on; any rank may take any rows back, since the first lists hand
//! grains to their owners. Contacts are keyed by the ids of both ends, so that they too fit any number of ranks: give every
//! rank the rows of all ranks, each keeps what its lists need. A run restored from them goes on bit by bit as the
//! uninterrupted one.

use std::sync::Arc;

use super::blocks::{self, ATTITUDE, Blocks};
use super::contact::ContactLaw;
use super::engine::bodies::Bodies;
use super::engine::{Engine, Key};
use super::particles::{Body, EXTRA, Kind, Load, Motion, Particles};
use super::space::{Components, Space};
use super::{Dem, Inner, of_each_law};
use crate::error::Error;

/// The values of one column.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Real numbers.
    Real(Vec<f64>),
    /// Whole numbers; negative ones in two's complement.
    Whole(Vec<u64>),
}

impl Values {
    /// How many.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Real(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }

    /// None at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Columns of equal length, each with a name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Name and values.
    pub columns: Vec<(String, Values)>,
}

impl Table {
    /// How many rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, values)| values.len())
    }

    /// Appends the rows of a table with the same columns.
    ///
    /// # Errors
    /// Where the columns differ.
    pub fn append(&mut self, other: &Self) -> Result<(), Error> {
        if self.columns.is_empty() {
            *self = other.clone();
            return Ok(());
        }
        for ((name, mine), (other_name, theirs)) in self.columns.iter_mut().zip(&other.columns) {
            match (mine, theirs) {
                (Values::Real(mine), Values::Real(theirs)) if name == other_name => {
                    mine.extend(theirs)
                }
                (Values::Whole(mine), Values::Whole(theirs)) if name == other_name => {
                    mine.extend(theirs)
                }
                _ => {
                    return Err(Error::Io(format!(
                        "column {name} does not match column {other_name}"
                    )));
                }
            }
        }
        Ok(())
    }

    /// The rows for which `keep(row)` holds.
    #[must_use]
    pub fn filter(&self, keep: impl Fn(usize) -> bool) -> Self {
        fn pick<T: Copy>(values: &[T], keep: impl Fn(usize) -> bool) -> Vec<T> {
            values
                .iter()
                .enumerate()
                .filter(|(row, _)| keep(*row))
                .map(|(_, value)| *value)
                .collect()
        }
        let columns = self
            .columns
            .iter()
            .map(|(name, values)| {
                let values = match values {
                    Values::Real(values) => Values::Real(pick(values, &keep)),
                    Values::Whole(values) => Values::Whole(pick(values, &keep)),
                };
                (name.clone(), values)
            })
            .collect();
        Self { columns }
    }

    /// The columns that `make` hands over.
    fn of(make: impl FnOnce(&mut Columns<'_>)) -> Self {
        let mut columns = Vec::new();
        make(&mut Columns(&mut |name, values| {
            columns.push((name, values))
        }));
        Self { columns }
    }

    fn find(&self, name: &str) -> Result<&Values, Error> {
        let rows = self.rows();
        self.columns
            .iter()
            .find(|(column, values)| column == name && values.len() == rows)
            .map(|(_, values)| values)
            .ok_or_else(|| Error::Io(format!("no column {name} with {rows} rows")))
    }

    fn get_real(&self, name: &str) -> Result<&[f64], Error> {
        match self.find(name)? {
            Values::Real(values) => Ok(values),
            Values::Whole(_) => Err(Error::Io(format!("column {name} should hold real numbers"))),
        }
    }

    pub(super) fn get_whole(&self, name: &str) -> Result<&[u64], Error> {
        match self.find(name)? {
            Values::Whole(values) => Ok(values),
            Values::Real(_) => Err(Error::Io(format!(
                "column {name} should hold whole numbers"
            ))),
        }
    }
}

/// Takes columns one after another, so that no more than one need be held.
struct Columns<'a>(&'a mut dyn FnMut(String, Values));

impl Columns<'_> {
    fn real(&mut self, name: impl Into<String>, values: impl IntoIterator<Item = f64>) {
        self.0(name.into(), Values::Real(values.into_iter().collect()));
    }

    fn whole(&mut self, name: impl Into<String>, values: impl IntoIterator<Item = u64>) {
        self.0(name.into(), Values::Whole(values.into_iter().collect()));
    }

    fn components<C: Components>(&mut self, name: &str, values: impl Iterator<Item = C> + Clone) {
        for (k, axis) in AXES.iter().enumerate().take(C::COUNT) {
            let name = if C::COUNT == 1 {
                name.to_owned()
            } else {
                format!("{name}_{axis}")
            };
            self.real(name, values.clone().map(|value| value.get(k)));
        }
    }
}

/// What a run restored from it needs to know of the contacts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts {
    /// Grain with grain.
    pub grains: Table,
    /// Grain with wall.
    pub walls: Table,
    /// The walls themselves, the same on every rank.
    pub faces: Table,
    /// Solid steps done.
    pub steps: u64,
    /// Where each wall of a changed scene was among those saved; none for a new one. Without it the walls are the same.
    origins: Option<Vec<Option<usize>>>,
}

impl Contacts {
    /// Fits the contacts to other walls: `origins` says which of the saved walls each wall is. Contacts with walls that are gone go.
    ///
    /// # Errors
    /// Where a column is missing or broken.
    pub fn take_walls(&mut self, origins: &[Option<usize>]) -> Result<(), Error> {
        let place = |old: u64| {
            origins
                .iter()
                .position(|origin| origin.is_some_and(|origin| origin as u64 == old))
        };
        let numbers = self.walls.get_whole("wall")?.to_vec();
        self.walls = self.walls.filter(|row| place(numbers[row]).is_some());
        for (name, values) in &mut self.walls.columns {
            if let ("wall", Values::Whole(values)) = (name.as_str(), values) {
                for value in values {
                    *value = place(*value).map_or(*value, |new| new as u64);
                }
            }
        }
        self.origins = Some(origins.to_vec());
        Ok(())
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];
const ATTITUDES: [&str; ATTITUDE] = [
    "orientation_x",
    "orientation_y",
    "orientation_z",
    "orientation_w",
    "angular_momentum_x",
    "angular_momentum_y",
    "angular_momentum_z",
];

fn read_components<C: Components>(table: &Table, name: &str) -> Result<Vec<C>, Error> {
    let mut all = vec![C::default(); table.rows()];
    for (k, axis) in AXES.iter().enumerate().take(C::COUNT) {
        let name = if C::COUNT == 1 {
            name.to_owned()
        } else {
            format!("{name}_{axis}")
        };
        for (value, number) in all.iter_mut().zip(table.get_real(&name)?) {
            value.set(k, *number);
        }
    }
    Ok(all)
}

fn small(value: u64) -> Result<u32, Error> {
    u32::try_from(value).map_err(|_| Error::Io(format!("{value} is beyond 32 bits")))
}

/// A shift from its column.
fn signed(value: u64) -> Result<i32, Error> {
    i32::try_from(value.cast_signed())
        .map_err(|_| Error::Io(format!("{value} is no count of box lengths")))
}

fn unsigned(value: i32) -> u64 {
    i64::from(value).cast_unsigned()
}

impl<S: Space> Particles<S> {
    /// The owned grains with all that the next step depends on, in rising order of id.
    #[must_use]
    pub fn table(&self) -> Table {
        Table::of(|columns| self.columns(columns))
    }

    /// The columns of [`Self::table`] one after another, the ids first.
    pub fn each_column(&self, mut take: impl FnMut(&str, &Values)) {
        self.columns(&mut Columns(&mut |name, values| take(&name, &values)));
    }

    fn columns(&self, table: &mut Columns<'_>) {
        let owned = self.owned();
        let body = &self.body[..owned];
        table.whole("id", body.iter().map(|b| b.id));
        table.real("radius", body.iter().map(|b| b.radius));
        table.real("mass", body.iter().map(|b| b.mass));
        table.real("inertia", body.iter().map(|b| b.inertia));
        table.whole("material", body.iter().map(|b| u64::from(b.material)));
        table.whole("kind", body.iter().map(|b| b.kind.code()));
        for (axis, name) in AXES.iter().enumerate().take(S::DIMENSION) {
            let shift = (0..owned).map(|k| unsigned(self.shift_into_box(k)[axis]));
            table.whole(format!("shift_{name}"), shift);
        }
        let motion = self.motion[..owned].iter();
        table.components("position", motion.clone().map(|m| m.position));
        table.components("velocity", motion.clone().map(|m| m.velocity));
        table.components("spin", motion.map(|m| m.spin));
        let wet = self.immersed.then_some(("fluid", &self.fluid));
        for (name, loads) in std::iter::once(("contact", &self.contact)).chain(wet) {
            let loads = loads[..owned].iter();
            table.components(
                &format!("{name}_force"),
                loads.clone().map(|load| load.force),
            );
            table.components(&format!("{name}_torque"), loads.map(|load| load.torque));
        }
        if self.keeps_extra {
            let extra = self.extra[..owned].iter();
            for k in 0..EXTRA {
                table.real(format!("extra_{k}"), extra.clone().map(|extra| extra[k]));
            }
        }
        if let Some(start) = &self.start {
            table.components("start", start[..owned].iter().copied());
        }
        if let Some(blocks) = &self.blocks {
            let shapes = blocks.shape[..owned].iter();
            table.whole("shape", shapes.map(|&shape| u64::from(shape)));
            for (k, name) in ATTITUDES.iter().enumerate() {
                let attitudes = blocks.attitude[..owned].iter();
                table.real(*name, attitudes.map(|one| blocks::numbers(one)[k]));
            }
        }
    }

    /// Grains from rows of [`Self::table`]: any rows on any rank, each on one rank only. `lengths` of the box along periodic
    /// axes are set when the lists are made. Where there are blocks, [`Self::set_shapes`] has to give their shapes back.
    ///
    /// # Errors
    /// Where a column is missing, short or of another type.
    pub fn from_table(table: &Table) -> Result<Self, Error> {
        let mut particles = Self::new();
        let [ids, materials, kinds] = [
            table.get_whole("id")?,
            table.get_whole("material")?,
            table.get_whole("kind")?,
        ];
        let [radii, masses, inertias] = [
            table.get_real("radius")?,
            table.get_real("mass")?,
            table.get_real("inertia")?,
        ];
        let position = read_components::<S::Vector>(table, "position")?;
        let velocity = read_components::<S::Vector>(table, "velocity")?;
        let spin = read_components::<S::Spin>(table, "spin")?;
        let contact_force = read_components::<S::Vector>(table, "contact_force")?;
        let contact_torque = read_components::<S::Spin>(table, "contact_torque")?;
        for k in 0..table.rows() {
            let body = Body {
                id: ids[k],
                radius: radii[k],
                mass: masses[k],
                inertia: inertias[k],
                material: small(materials[k])?,
                kind: Kind::from_code(kinds[k])?,
            };
            let motion = Motion {
                position: position[k],
                velocity: velocity[k],
                spin: spin[k],
            };
            particles.push(body, motion, [0; 3]);
            particles.contact[k] = Load {
                force: contact_force[k],
                torque: contact_torque[k],
            };
        }
        for (axis, name) in AXES.iter().enumerate().take(S::DIMENSION) {
            for (shift, value) in particles
                .shift
                .iter_mut()
                .zip(table.get_whole(&format!("shift_{name}"))?)
            {
                shift[axis] = signed(*value)?;
            }
        }
        // Only runs with a fluid write these columns.
        if table
            .columns
            .iter()
            .any(|(name, _)| name == "fluid_force_x")
        {
            particles.immerse();
            let forces = read_components::<S::Vector>(table, "fluid_force")?;
            let torques = read_components::<S::Spin>(table, "fluid_torque")?;
            let loads = forces.into_iter().zip(torques);
            for (load, (force, torque)) in particles.fluid.iter_mut().zip(loads) {
                *load = Load { force, torque };
            }
        }
        // Only runs with a lattice write these.
        if table.columns.iter().any(|(name, _)| name == "extra_0") {
            particles.keep_extra();
            for n in 0..EXTRA {
                let values = table.get_real(&format!("extra_{n}"))?;
                for (extra, value) in particles.extra.iter_mut().zip(values) {
                    extra[n] = *value;
                }
            }
        }
        // Only runs that ask for displacements write these columns.
        if table.columns.iter().any(|(name, _)| name == "start_x") {
            particles.start = Some(read_components::<S::Vector>(table, "start")?);
        }
        // Only scenes with blocks write these.
        if table.columns.iter().any(|(name, _)| name == "shape") {
            particles.blocks = Some(read_blocks(table)?);
        }
        particles.owned = table.rows();
        particles.loaded = true;
        Ok(particles)
    }
}

fn read_blocks(table: &Table) -> Result<Blocks, Error> {
    let mut columns = [&[][..]; ATTITUDE];
    for (column, name) in columns.iter_mut().zip(ATTITUDES) {
        *column = table.get_real(name)?;
    }
    let mut blocks = Blocks::new(Arc::default(), 0);
    for (row, shape) in table.get_whole("shape")?.iter().enumerate() {
        let attitude = blocks::from_numbers(columns.map(|column| column[row]));
        blocks.push(small(*shape)?, attitude);
    }
    Ok(blocks)
}

impl<S: Space> Dem<S> {
    /// The contacts this rank reports, the walls, and the steps done.
    #[must_use]
    pub fn contacts(&self) -> Contacts {
        of_each_law!(&self.inner, engine => save(engine))
    }

    /// Each contact this rank reports, in no order: with grains by the ids of both, then with walls by grain, wall and facet;
    /// beside it the numbers that the law keeps of it.
    pub fn each_contact(
        &self,
        grains: &mut dyn FnMut([u64; 2], &[f64]),
        walls: &mut dyn FnMut([u64; 3], &[f64]),
    ) {
        of_each_law!(&self.inner, engine => each_contact(engine, grains, walls));
    }

    /// Gives the walls these velocities (m/s), in their order.
    pub fn drive_walls(&mut self, velocities: &[S::Vector]) {
        of_each_law!(&mut self.inner, engine => {
            for (wall, velocity) in engine.walls.iter_mut().zip(velocities) {
                wall.velocity = *velocity;
            }
        });
    }

    /// Takes back the contacts of [`Self::contacts`], those of **all** ranks on every rank; the grains come from
    /// [`Particles::from_table`].
    ///
    /// # Errors
    /// Where a column is missing, short or of another type, or the number of walls differs.
    pub fn restore(&mut self, contacts: &Contacts) -> Result<(), Error> {
        of_each_law!(&mut self.inner, engine => restore(engine, contacts))
    }
}

fn each_contact<S: Space, L: Bodies<S>>(
    engine: &Engine<S, L>,
    grains: &mut dyn FnMut([u64; 2], &[f64]),
    walls: &mut dyn FnMut([u64; 3], &[f64]),
) {
    let (mut numbers, mut at_wall) = (Vec::new(), Vec::new());
    engine.each_memory(
        |key, memory| {
            numbers.clear();
            L::save(memory, &mut numbers);
            grains([key.first, key.second], &numbers);
        },
        |key, memory| {
            at_wall.clear();
            L::save(memory, &mut at_wall);
            walls([key.0, u64::from(key.1), u64::from(key.2)], &at_wall);
        },
    );
}

fn memory_columns<S: Space, L: ContactLaw<S>>(table: &mut Columns<'_>, memories: &[L::Memory]) {
    let mut numbers = Vec::new();
    for memory in memories {
        L::save(memory, &mut numbers);
    }
    for n in 0..L::NUMBERS {
        table.real(
            format!("memory_{n}"),
            numbers.iter().skip(n).step_by(L::NUMBERS).copied(),
        );
    }
}

fn read_memories<S: Space, L: ContactLaw<S>>(table: &Table) -> Result<Vec<L::Memory>, Error> {
    let columns = (0..L::NUMBERS)
        .map(|n| table.get_real(&format!("memory_{n}")))
        .collect::<Result<Vec<_>, _>>()?;
    Ok((0..table.rows())
        .map(|row| {
            let numbers: Vec<f64> = columns.iter().map(|column| column[row]).collect();
            L::load(&numbers)
        })
        .collect())
}

fn save<S: Space, L: Bodies<S>>(engine: &Engine<S, L>) -> Contacts {
    let (pairs, at_walls) = engine.saved();
    let grains = Table::of(|table| {
        table.whole("first", pairs.iter().map(|(key, _)| key.first));
        table.whole("second", pairs.iter().map(|(key, _)| key.second));
        for (axis, name) in AXES.iter().enumerate().take(S::DIMENSION) {
            let shifts = pairs.iter().map(|(key, _)| unsigned(key.shift[axis]));
            table.whole(format!("shift_{name}"), shifts);
        }
        let memories: Vec<_> = pairs.iter().map(|(_, memory)| *memory).collect();
        memory_columns::<S, L>(table, &memories);
    });
    let walls = Table::of(|table| {
        table.whole("grain", at_walls.iter().map(|(key, _)| key.0));
        table.whole("wall", at_walls.iter().map(|(key, _)| u64::from(key.1)));
        table.whole("facet", at_walls.iter().map(|(key, _)| u64::from(key.2)));
        let memories: Vec<_> = at_walls.iter().map(|(_, memory)| *memory).collect();
        memory_columns::<S, L>(table, &memories);
    });
    let faces = Table::of(|table| {
        let walls = engine.walls.iter();
        table.components("point", walls.clone().map(|wall| wall.point));
        table.components("normal", walls.clone().map(|wall| wall.normal));
        table.components("velocity", walls.clone().map(|wall| wall.velocity));
        table.whole("material", walls.map(|wall| u64::from(wall.material)));
    });
    Contacts {
        grains,
        walls,
        faces,
        steps: engine.steps,
        origins: None,
    }
}

fn restore<S: Space, L: Bodies<S>>(
    engine: &mut Engine<S, L>,
    contacts: &Contacts,
) -> Result<(), Error> {
    let (grains, walls, faces) = (&contacts.grains, &contacts.walls, &contacts.faces);
    let same = || (0..faces.rows()).map(Some).collect();
    let origins: Vec<Option<usize>> = contacts.origins.clone().unwrap_or_else(same);
    if origins.len() != engine.walls.len()
        || origins.iter().flatten().any(|&old| old >= faces.rows())
    {
        return Err(Error::Io(format!(
            "{} walls saved, {} here",
            faces.rows(),
            engine.walls.len()
        )));
    }
    let points = read_components::<S::Vector>(faces, "point")?;
    let normals = read_components::<S::Vector>(faces, "normal")?;
    let velocities = read_components::<S::Vector>(faces, "velocity")?;
    let materials = faces.get_whole("material")?;
    for (wall, origin) in engine.walls.iter_mut().zip(origins) {
        // A new wall stands as it was made.
        let Some(k) = origin else { continue };
        wall.point = points[k];
        wall.normal = normals[k];
        wall.velocity = velocities[k];
        wall.material = small(materials[k])?;
    }
    let (first, second) = (grains.get_whole("first")?, grains.get_whole("second")?);
    let mut shifts = vec![[0; 3]; grains.rows()];
    for (axis, name) in AXES.iter().enumerate().take(S::DIMENSION) {
        for (shift, value) in shifts
            .iter_mut()
            .zip(grains.get_whole(&format!("shift_{name}"))?)
        {
            shift[axis] = signed(*value)?;
        }
    }
    let pairs = read_memories::<S, L>(grains)?
        .into_iter()
        .enumerate()
        .map(|(k, memory)| {
            (
                Key {
                    first: first[k],
                    second: second[k],
                    shift: shifts[k],
                },
                memory,
            )
        })
        .collect();
    let (grain, wall) = (walls.get_whole("grain")?, walls.get_whole("wall")?);
    let facet = walls.get_whole("facet")?;
    let at_walls = read_memories::<S, L>(walls)?
        .into_iter()
        .enumerate()
        .map(|(k, memory)| Ok(((grain[k], small(wall[k])?, small(facet[k])?), memory)))
        .collect::<Result<_, Error>>()?;
    engine.restore(pairs, at_walls, contacts.steps);
    Ok(())
}
