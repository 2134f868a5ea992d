//! Named columns of equal length, as which grains and contacts are saved in a checkpoint, and the elements of their
//! arrays ([`Entry`]): their columns, and their bytes in a message.

use super::message::{Reader, Writer};
use super::space::{Components, Space};
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

/// Element of an array: its bytes in a message, its columns in a checkpoint.
pub(crate) trait Entry<S: Space>: Copy {
    /// Number of bytes in a message.
    const BYTES: usize;
    /// Appends the bytes to a message.
    fn pack(&self, to: &mut Writer);
    /// Reads the element from a message.
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error>;
    /// Writes the columns of many entries.
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>);
    /// Returns the name of the first column; a table without it does not contain the array.
    fn first_column(name: &str) -> String;
    /// Reads the values of many entries from their columns.
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error>;
}

/// Returns `prefix_field`, or the field alone without a prefix.
pub(crate) fn joined(prefix: &str, field: &str) -> String {
    if prefix.is_empty() {
        field.to_owned()
    } else {
        format!("{prefix}_{field}")
    }
}

impl<S: Space, C: Components> Entry<S> for C {
    const BYTES: usize = 8 * C::COUNT;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        for k in 0..C::COUNT {
            to.float(self.get(k));
        }
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        let mut value = C::default();
        for k in 0..C::COUNT {
            value.set(k, from.float()?);
        }
        Ok(value)
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        to.components(name, values);
    }
    fn first_column(name: &str) -> String {
        component_name::<C>(name, 0)
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        from.components(name)
    }
}

impl<S: Space> Entry<S> for u64 {
    const BYTES: usize = 8;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        to.integer(*self);
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        from.integer()
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        to.whole(name, values);
    }
    fn first_column(name: &str) -> String {
        name.to_owned()
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        Ok(from.get_whole(name)?.to_vec())
    }
}

impl<S: Space> Entry<S> for u32 {
    const BYTES: usize = 8;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        to.integer(u64::from(*self));
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        from.index("a number")
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        to.whole(name, values.map(u64::from));
    }
    fn first_column(name: &str) -> String {
        name.to_owned()
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        let column = from.get_whole(name)?.iter();
        column.map(|value| small(*value)).collect()
    }
}

/// Numbers of periods along each axis, with one column per axis of the space.
impl<S: Space> Entry<S> for [i32; 3] {
    const BYTES: usize = 12;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        for n in self {
            to.signed(*n);
        }
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        Ok([from.signed()?, from.signed()?, from.signed()?])
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        for (axis, suffix) in AXES.iter().enumerate().take(S::DIMENSION) {
            let values = values.clone().map(|value| unsigned(value[axis]));
            to.whole(format!("{name}_{suffix}"), values);
        }
    }
    fn first_column(name: &str) -> String {
        format!("{name}_{}", AXES[0])
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        from.shifts(name, S::DIMENSION)
    }
}

/// Unnamed real numbers, in columns `name_0`, `name_1` and so on.
impl<S: Space, const N: usize> Entry<S> for [f64; N] {
    const BYTES: usize = 8 * N;

    #[inline]
    fn pack(&self, to: &mut Writer) {
        for number in self {
            to.float(*number);
        }
    }
    #[inline]
    fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
        let mut value = [0.0; N];
        for number in &mut value {
            *number = from.float()?;
        }
        Ok(value)
    }
    fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
        for n in 0..N {
            to.real(format!("{name}_{n}"), values.clone().map(|value| value[n]));
        }
    }
    fn first_column(name: &str) -> String {
        format!("{name}_0")
    }
    fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
        let mut all = vec![[0.0; N]; from.rows()];
        for n in 0..N {
            let column = from.get_real(&format!("{name}_{n}"))?;
            for (value, number) in all.iter_mut().zip(column) {
                value[n] = *number;
            }
        }
        Ok(all)
    }
}

/// Defines a struct and implements [`Entry`] for it, field by field in their order.
macro_rules! entry {
    (
        $(#[$meta:meta])*
        pub struct $name:ident $(<$space:ident: Space>)? {
            $( $(#[$about:meta])* pub $field:ident: $type:ty, )*
        }
    ) => {
        $(#[$meta])*
        pub struct $name $(<$space: Space>)? {
            $( $(#[$about])* pub $field: $type, )*
        }

        impl<S: Space> Entry<S> for $name $(<$space>)? {
            const BYTES: usize = 0 $( + <$type as Entry<S>>::BYTES )*;

            #[inline]
            fn pack(&self, to: &mut Writer) {
                $( Entry::<S>::pack(&self.$field, to); )*
            }
            #[inline]
            fn unpack(from: &mut Reader<'_>) -> Result<Self, Error> {
                Ok(Self { $( $field: Entry::<S>::unpack(from)?, )* })
            }
            fn save(name: &str, values: impl Iterator<Item = Self> + Clone, to: &mut Columns<'_>) {
                $( <$type as Entry<S>>::save(
                    &joined(name, stringify!($field)),
                    values.clone().map(|value| value.$field),
                    to,
                ); )*
            }
            fn first_column(name: &str) -> String {
                let mut first = String::new();
                $( if first.is_empty() {
                    first = <$type as Entry<S>>::first_column(&joined(name, stringify!($field)));
                } )*
                first
            }
            fn load(name: &str, from: &NamedColumns) -> Result<Vec<Self>, Error> {
                $( let $field =
                    <$type as Entry<S>>::load(&joined(name, stringify!($field)), from)?; )*
                Ok((0..from.rows()).map(|row| Self { $( $field: $field[row], )* }).collect())
            }
        }
    };
}
pub(crate) use entry;
