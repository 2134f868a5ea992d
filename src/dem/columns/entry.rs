//! Elements of the arrays: their bytes in a message, their columns in a checkpoint.

use super::super::message::{Reader, Writer};
use super::super::space::{Components, Space};
use super::super::table::{AXES, Columns, NamedColumns, component_name, small, unsigned};
use base::error::Error;

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
