//! Named columns of equal length, as which grains and contacts are saved in a checkpoint.

use super::space::Components;
use base::error::Error;

/// Values of one column.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Real numbers.
    Real(Vec<f64>),
    /// Whole numbers; negative ones in two's complement.
    Whole(Vec<u64>),
}

impl Values {
    /// Returns the number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Real(values) => values.len(),
            Self::Whole(values) => values.len(),
        }
    }

    /// Returns `true` if there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Named columns of equal length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamedColumns {
    /// Name and values.
    pub columns: Vec<(String, Values)>,
}

impl NamedColumns {
    /// Returns the number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, values)| values.len())
    }

    /// Appends the rows of a table with the same columns.
    ///
    /// # Errors
    /// If the columns differ.
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

    /// Returns the rows for which `keep(row)` returns `true`.
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

    /// Returns the columns that `make` produces.
    pub(super) fn collect(make: impl FnOnce(&mut Columns<'_>)) -> Self {
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

    pub(super) fn get_real(&self, name: &str) -> Result<&[f64], Error> {
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

/// Endings of the column names of components.
pub(super) const AXES: [&str; 3] = ["x", "y", "z"];

/// Returns the column name of component `k` of a quantity; a quantity with one component has the plain name.
pub(super) fn component_name<C: Components>(name: &str, k: usize) -> String {
    if C::COUNT == 1 {
        name.to_owned()
    } else {
        format!("{name}_{}", AXES[k])
    }
}

/// Returns a whole number of a column that must fit 32 bits.
pub(super) fn small(value: u64) -> Result<u32, Error> {
    u32::try_from(value).map_err(|_| Error::Io(format!("{value} exceeds 32 bits")))
}

/// Returns a signed number from its column.
pub(super) fn signed(value: u64) -> Result<i32, Error> {
    i32::try_from(value.cast_signed())
        .map_err(|_| Error::Io(format!("{value} is not a number of box lengths")))
}

/// Returns a signed number as stored in a column.
pub(super) fn unsigned(value: i32) -> u64 {
    i64::from(value).cast_unsigned()
}

/// Receiver of columns one after another; only one of them needs to be in memory.
pub(super) struct Columns<'a>(pub(super) &'a mut dyn FnMut(String, Values));

impl Columns<'_> {
    pub(super) fn real(&mut self, name: impl Into<String>, values: impl Iterator<Item = f64>) {
        self.0(name.into(), Values::Real(values.collect()));
    }

    pub(super) fn whole(&mut self, name: impl Into<String>, values: impl Iterator<Item = u64>) {
        self.0(name.into(), Values::Whole(values.collect()));
    }

    pub(super) fn components<C: Components>(
        &mut self,
        name: &str,
        values: impl Iterator<Item = C> + Clone,
    ) {
        for k in 0..C::COUNT {
            let values = values.clone().map(|value| value.get(k));
            self.real(component_name::<C>(name, k), values);
        }
    }
}

impl NamedColumns {
    /// Returns the quantity whose components were written by [`Columns::components`].
    pub(super) fn components<C: Components>(&self, name: &str) -> Result<Vec<C>, Error> {
        let mut all = vec![C::default(); self.rows()];
        for k in 0..C::COUNT {
            let column = self.get_real(&component_name::<C>(name, k))?;
            for (value, number) in all.iter_mut().zip(column) {
                value.set(k, *number);
            }
        }
        Ok(all)
    }

    /// Returns the numbers of periods along the axes of a space of `dimension` dimensions.
    pub(super) fn shifts(&self, name: &str, dimension: usize) -> Result<Vec<[i32; 3]>, Error> {
        let mut all = vec![[0; 3]; self.rows()];
        for (axis, suffix) in AXES.iter().enumerate().take(dimension) {
            let column = self.get_whole(&format!("{name}_{suffix}"))?;
            for (shift, value) in all.iter_mut().zip(column) {
                shift[axis] = signed(*value)?;
            }
        }
        Ok(all)
    }

    /// Returns `true` if there is a column of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|(column, _)| column == name)
    }
}
