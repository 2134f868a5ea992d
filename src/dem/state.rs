//! Contacts as named columns for checkpoints.
//!
//! Contacts are identified by the ids of both partners and do not depend on the number of ranks. To restore them,
//! give every rank the rows of all ranks; each rank keeps those that its lists need. Grains are saved by
//! [`Particles::table`](super::Particles::table). A restored run gives the same bits as an uninterrupted one.

use super::Dem;
use super::contact::ContactLaw;
use super::engine::bodies::Bodies;
use super::engine::{Engine, Key, WallKey};
use super::space::Space;
use super::table::{AXES, Columns, small, unsigned};
pub use super::table::{NamedColumns, Values};
use base::error::Error;

/// Contact data that a restored run needs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contacts {
    /// Contacts between grains.
    pub grains: NamedColumns,
    /// Contacts between grains and walls.
    pub walls: NamedColumns,
    /// Walls, the same on every rank.
    pub faces: NamedColumns,
    /// Number of solid steps done.
    pub steps: u64,
    /// Index of each wall of a changed scene among the saved walls, or none for a new wall; none if the walls are
    /// unchanged.
    origins: Option<Vec<Option<usize>>>,
}

impl Contacts {
    /// Adapts the contacts to other walls: `origins` has for each wall the index of the same wall in the saved state.
    /// Contacts with removed walls are dropped.
    ///
    /// # Errors
    /// If a column is missing or malformed.
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

impl<S: Space> Dem<S> {
    /// Returns the contacts reported by this rank, the walls, and the number of steps done.
    #[must_use]
    pub fn contacts(&self) -> Contacts {
        self.engine.save()
    }

    /// Calls `grains` and `walls` with each contact reported by this rank, in no order: contacts between grains by
    /// both ids, contacts with walls by grain, wall and facet; each with the numbers that the law stores for it.
    pub fn each_contact(
        &self,
        grains: &mut dyn FnMut([u64; 2], &[f64]),
        walls: &mut dyn FnMut([u64; 3], &[f64]),
    ) {
        self.engine.each_contact(grains, walls);
    }

    /// Sets the velocity of a wall [m/s].
    pub fn drive_wall(&mut self, wall: usize, velocity: S::Vector) {
        self.engine.walls_mut()[wall].velocity = velocity;
    }

    /// Sets the velocities of the walls [m/s], in their order.
    pub fn drive_walls(&mut self, velocities: &[S::Vector]) {
        for (wall, velocity) in self.engine.walls_mut().iter_mut().zip(velocities) {
            wall.velocity = *velocity;
        }
    }

    /// Restores the contacts of [`Self::contacts`], with those of **all** ranks on every rank; the grains come from
    /// `Particles::from_table`.
    ///
    /// # Errors
    /// If a column is missing, short or of another type, or the number of walls differs.
    pub fn restore(&mut self, contacts: &Contacts) -> Result<(), Error> {
        self.engine.restore(contacts)
    }
}

pub(super) fn each_contact<S: Space, L: Bodies<S>>(
    engine: &Engine<S, L>,
    grains: &mut dyn FnMut([u64; 2], &[f64]),
    walls: &mut dyn FnMut([u64; 3], &[f64]),
) {
    let (mut numbers, mut at_wall) = (Vec::new(), Vec::new());
    engine.each_history(
        |key, history| {
            numbers.clear();
            L::save(history, &mut numbers);
            grains([key.first, key.second], &numbers);
        },
        |key, history| {
            at_wall.clear();
            L::save(history, &mut at_wall);
            let key = [key.grain, u64::from(key.wall), u64::from(key.facet)];
            walls(key, &at_wall);
        },
    );
}

fn history_columns<S: Space, L: ContactLaw<S>>(table: &mut Columns<'_>, histories: &[L::History]) {
    let mut numbers = Vec::new();
    for history in histories {
        L::save(history, &mut numbers);
    }
    for n in 0..L::NUMBERS {
        table.real(
            format!("memory_{n}"),
            numbers.iter().skip(n).step_by(L::NUMBERS).copied(),
        );
    }
}

fn read_histories<S: Space, L: ContactLaw<S>>(
    table: &NamedColumns,
) -> Result<Vec<L::History>, Error> {
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

pub(super) fn save<S: Space, L: Bodies<S>>(engine: &Engine<S, L>) -> Contacts {
    let (pairs, at_walls) = engine.saved();
    let grains = NamedColumns::collect(|table| {
        table.whole("first", pairs.iter().map(|(key, _)| key.first));
        table.whole("second", pairs.iter().map(|(key, _)| key.second));
        for (axis, name) in AXES.iter().enumerate().take(S::DIMENSION) {
            let shifts = pairs.iter().map(|(key, _)| unsigned(key.shift[axis]));
            table.whole(format!("shift_{name}"), shifts);
        }
        let histories: Vec<_> = pairs.iter().map(|(_, history)| *history).collect();
        history_columns::<S, L>(table, &histories);
    });
    let walls = NamedColumns::collect(|table| {
        table.whole("grain", at_walls.iter().map(|(key, _)| key.grain));
        table.whole("wall", at_walls.iter().map(|(key, _)| u64::from(key.wall)));
        table.whole(
            "facet",
            at_walls.iter().map(|(key, _)| u64::from(key.facet)),
        );
        let histories: Vec<_> = at_walls.iter().map(|(_, history)| *history).collect();
        history_columns::<S, L>(table, &histories);
    });
    let faces = NamedColumns::collect(|table| {
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

pub(super) fn restore<S: Space, L: Bodies<S>>(
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
            "the saved state has {} walls, but the case has {}",
            faces.rows(),
            engine.walls.len()
        )));
    }
    let points = faces.components::<S::Vector>("point")?;
    let normals = faces.components::<S::Vector>("normal")?;
    let velocities = faces.components::<S::Vector>("velocity")?;
    let materials = faces.get_whole("material")?;
    for (wall, origin) in engine.walls.iter_mut().zip(origins) {
        // A new wall keeps its initial state.
        let Some(k) = origin else { continue };
        wall.point = points[k];
        wall.normal = normals[k];
        wall.velocity = velocities[k];
        wall.material = small(materials[k])?;
    }
    let (first, second) = (grains.get_whole("first")?, grains.get_whole("second")?);
    let shifts = grains.shifts("shift", S::DIMENSION)?;
    let pairs = read_histories::<S, L>(grains)?
        .into_iter()
        .enumerate()
        .map(|(k, history)| {
            (
                Key {
                    first: first[k],
                    second: second[k],
                    shift: shifts[k],
                },
                history,
            )
        })
        .collect();
    let (grain, wall) = (walls.get_whole("grain")?, walls.get_whole("wall")?);
    let facet = walls.get_whole("facet")?;
    let at_walls = read_histories::<S, L>(walls)?
        .into_iter()
        .enumerate()
        .map(|(k, history)| {
            let key = WallKey {
                grain: grain[k],
                wall: small(wall[k])?,
                facet: small(facet[k])?,
            };
            Ok((key, history))
        })
        .collect::<Result<_, Error>>()?;
    engine.restore(pairs, at_walls, contacts.steps);
    Ok(())
}
