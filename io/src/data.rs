//! Borrowed numbers with their type.

use hdf5::types::{FloatSize, IntSize, TypeDescriptor};
use serde::{Deserialize, Serialize};
use std::marker::PhantomData;
use std::ops::Range;

use crate::error::{Error, Result};

/// Types of the numbers in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// 32-bit floats.
    F32,
    /// 64-bit floats.
    F64,
    /// Bytes.
    U8,
    /// 32-bit signed integer.
    I32,
    /// 64-bit signed integer.
    I64,
    /// 64-bit unsigned integer.
    U64,
}

impl Kind {
    /// Returns the size of one number in bytes.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::F32 | Self::I32 => 4,
            Self::F64 | Self::I64 | Self::U64 => 8,
        }
    }

    pub(crate) fn descriptor(self) -> TypeDescriptor {
        match self {
            Self::F32 => TypeDescriptor::Float(FloatSize::U4),
            Self::F64 => TypeDescriptor::Float(FloatSize::U8),
            Self::U8 => TypeDescriptor::Unsigned(IntSize::U1),
            Self::I32 => TypeDescriptor::Integer(IntSize::U4),
            Self::I64 => TypeDescriptor::Integer(IntSize::U8),
            Self::U64 => TypeDescriptor::Unsigned(IntSize::U8),
        }
    }

    pub(crate) fn from_descriptor(descriptor: &TypeDescriptor) -> Option<Self> {
        [
            Self::F32,
            Self::F64,
            Self::U8,
            Self::I32,
            Self::I64,
            Self::U64,
        ]
        .into_iter()
        .find(|kind| kind.descriptor() == *descriptor)
    }

    /// Returns `NumberType` and `Precision` in XDMF; `None` for the type that some readers do not support.
    pub(crate) fn xdmf(self) -> Option<(&'static str, usize)> {
        match self {
            Self::F32 | Self::F64 => Some(("Float", self.size())),
            Self::U8 => Some(("UChar", 1)),
            Self::I32 | Self::I64 => Some(("Int", self.size())),
            Self::U64 => None,
        }
    }
}

mod sealed {
    pub trait Sealed {}
}

/// Type of numbers in files: f32, f64, u8, i32, i64, u64. For all of them every bit pattern is a valid value.
pub trait Element: sealed::Sealed + Copy + Default + 'static {
    /// Kind of the type.
    const KIND: Kind;
    /// Returns the slice as typed data.
    fn data(slice: &[Self]) -> Data<'_>;
}

macro_rules! elements {
    ($($number:ty => $kind:ident),*) => {$(
        impl sealed::Sealed for $number {}
        impl Element for $number {
            const KIND: Kind = Kind::$kind;
            fn data(slice: &[Self]) -> Data<'_> {
                Data::$kind(slice)
            }
        }
    )*};
}
elements!(f32 => F32, f64 => F64, u8 => U8, i32 => I32, i64 => I64, u64 => U64);

/// Borrowed numbers, one rank's part of an array, in C order.
#[derive(Clone, Copy, Debug)]
pub enum Data<'a> {
    /// 32-bit floats.
    F32(&'a [f32]),
    /// 64-bit floats.
    F64(&'a [f64]),
    /// Bytes.
    U8(&'a [u8]),
    /// 32-bit signed integers.
    I32(&'a [i32]),
    /// 64-bit signed integers.
    I64(&'a [i64]),
    /// 64-bit unsigned integers; checkpoints only.
    U64(&'a [u64]),
}

impl<'a, T: Element> From<&'a [T]> for Data<'a> {
    fn from(slice: &'a [T]) -> Self {
        T::data(slice)
    }
}

impl<'a, T: Element> From<&'a Vec<T>> for Data<'a> {
    fn from(slice: &'a Vec<T>) -> Self {
        T::data(slice)
    }
}

impl<'a> Data<'a> {
    /// Returns the number type.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::F32(_) => Kind::F32,
            Self::F64(_) => Kind::F64,
            Self::U8(_) => Kind::U8,
            Self::I32(_) => Kind::I32,
            Self::I64(_) => Kind::I64,
            Self::U64(_) => Kind::U64,
        }
    }

    /// Returns the number of values.
    #[must_use]
    pub fn len(&self) -> usize {
        self.bytes().len() / self.kind().size()
    }

    /// Returns `true` if there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes().is_empty()
    }

    /// Returns the bytes of the numbers in memory order.
    #[must_use]
    pub fn bytes(&self) -> &'a [u8] {
        match self {
            Self::F32(v) => bytes_of(v),
            Self::F64(v) => bytes_of(v),
            Self::U8(v) => v,
            Self::I32(v) => bytes_of(v),
            Self::I64(v) => bytes_of(v),
            Self::U64(v) => bytes_of(v),
        }
    }
}

/// Numbers generated during writing, a piece at a time, so that they are never all in memory.
pub trait NumberSource {
    /// Returns the number type.
    fn kind(&self) -> Kind;
    /// Returns the number of values.
    fn count(&self) -> usize;
    /// Generates the numbers of a range in C order and passes them to `show`.
    fn show(&self, range: Range<usize>, show: &mut dyn FnMut(Data<'_>));
}

/// Generator of numbers by a function that appends a range to a list.
pub struct FunctionSource<T, F> {
    count: usize,
    append: F,
    kind: PhantomData<fn() -> T>,
}

impl<T: Element, F: Fn(Range<usize>, &mut Vec<T>)> FunctionSource<T, F> {
    /// Returns a generator of `count` numbers; `append` is called with ranges below `count`, and must give the same
    /// numbers for the same range each time.
    pub fn new(count: usize, append: F) -> Self {
        Self {
            count,
            append,
            kind: PhantomData,
        }
    }
}

impl<T: Element, F: Fn(Range<usize>, &mut Vec<T>)> NumberSource for FunctionSource<T, F> {
    fn kind(&self) -> Kind {
        T::KIND
    }

    fn count(&self) -> usize {
        self.count
    }

    fn show(&self, range: Range<usize>, show: &mut dyn FnMut(Data<'_>)) {
        let mut numbers = Vec::with_capacity(range.len());
        (self.append)(range, &mut numbers);
        show(T::data(&numbers));
    }
}

/// One rank's part of an array in C order: numbers in memory, or numbers generated during writing.
#[derive(Clone, Copy)]
pub enum Numbers<'a> {
    /// Numbers in memory.
    InMemory(Data<'a>),
    /// Numbers generated in pieces.
    Generated(&'a dyn NumberSource),
}

impl<'a> From<Data<'a>> for Numbers<'a> {
    fn from(data: Data<'a>) -> Self {
        Self::InMemory(data)
    }
}

impl<'a, T: Element> From<&'a [T]> for Numbers<'a> {
    fn from(slice: &'a [T]) -> Self {
        Self::InMemory(T::data(slice))
    }
}

impl std::fmt::Debug for Numbers<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} numbers {:?}", self.count(), self.kind())
    }
}

impl Numbers<'_> {
    /// Returns the number type.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::InMemory(data) => data.kind(),
            Self::Generated(make) => make.kind(),
        }
    }

    /// Returns the number of values.
    #[must_use]
    pub fn count(&self) -> usize {
        match self {
            Self::InMemory(data) => data.len(),
            Self::Generated(make) => make.count(),
        }
    }

    /// Passes the bytes of a range of numbers to `show`.
    pub(crate) fn show<R>(&self, range: Range<usize>, show: impl FnOnce(&[u8]) -> R) -> Option<R> {
        let (mut show, mut shown) = (Some(show), None);
        match self {
            Self::InMemory(data) => {
                let size = data.kind().size();
                let bytes = data.bytes().get(range.start * size..range.end * size);
                if let (Some(bytes), Some(show)) = (bytes, show.take()) {
                    shown = Some(show(bytes));
                }
            }
            Self::Generated(make) => make.show(range, &mut |data| {
                if let Some(show) = show.take() {
                    shown = Some(show(data.bytes()));
                }
            }),
        }
        shown
    }
}

fn bytes_of<T: Element>(slice: &[T]) -> &[u8] {
    // SAFETY: `Element` is sealed to plain numbers without padding, and the length in bytes is that of the slice.
    unsafe { std::slice::from_raw_parts(slice.as_ptr().cast(), size_of_val(slice)) }
}

/// Named quantity on the cells of a lattice or on the points or cells of a mesh.
#[derive(Clone, Debug)]
pub struct Column<'a> {
    /// Name in lower_snake: `velocity`.
    pub name: &'a str,
    /// Unit in SI: `m/s`; `-` for a pure number.
    pub units: &'a str,
    /// Number of components: 1, 3 (vector) or 9 (tensor, row by row).
    pub components: usize,
    /// Numbers of this rank, with the component as the fastest index.
    pub data: Data<'a>,
}

impl Column<'_> {
    /// Checks that every reader supports the name, type and number of components, and that there is a value for
    /// each of this rank's `places`.
    pub(crate) fn check(&self, places: usize) -> Result<()> {
        check_name(self.name)?;
        if !matches!(self.components, 1 | 3 | 9) {
            return Err(Error::invalid(
                self.name,
                format!("{} components; 1, 3 or 9 are allowed", self.components),
            ));
        }
        if self.data.kind().xdmf().is_none() {
            return Err(Error::invalid(
                self.name,
                "u64 is not read by every viewer; use i64",
            ));
        }
        if self.data.len() != places * self.components {
            return Err(Error::invalid(
                self.name,
                format!(
                    "{} numbers for {places} places of {} components",
                    self.data.len(),
                    self.components
                ),
            ));
        }
        Ok(())
    }

    /// Returns the shape of an array over places of shape `places`, with the component last if there are several.
    pub(crate) fn shaped(&self, places: &[usize]) -> Vec<usize> {
        let mut shape = places.to_vec();
        if self.components > 1 {
            shape.push(self.components);
        }
        shape
    }

    pub(crate) fn start(&self, places: &[usize]) -> Vec<usize> {
        let mut start = places.to_vec();
        if self.components > 1 {
            start.push(0);
        }
        start
    }
}

/// Checks that a name needs no quoting: lower case letters, digits, underscores, and a letter first.
pub(crate) fn check_name(name: &str) -> Result<()> {
    let fine = name.starts_with(|c: char| c.is_ascii_lowercase())
        && name
            .chars()
            .all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
    if fine {
        Ok(())
    } else {
        Err(Error::invalid(
            name,
            "a name is lower case letters, digits and underscores, a letter first",
        ))
    }
}

/// Returns a count from a group as an index.
pub(crate) fn index(n: u64) -> Result<usize> {
    usize::try_from(n).map_err(|e| Error::invalid("an array", e.to_string()))
}

/// Returns an index in the type used in files.
pub(crate) fn signed(n: usize) -> Result<i64> {
    i64::try_from(n).map_err(|e| Error::invalid("an array", e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_the_numbers() {
        let v = [1.5_f64, -2.0];
        let d = Data::from(&v[..]);
        assert_eq!((d.len(), d.kind()), (2, Kind::F64));
        assert_eq!(d.bytes()[..8], 1.5_f64.to_ne_bytes());
        assert!(Data::from(&Vec::<u8>::new()).is_empty());
        for kind in [Kind::F32, Kind::U8, Kind::I32, Kind::I64, Kind::U64] {
            assert_eq!(Kind::from_descriptor(&kind.descriptor()), Some(kind));
        }
    }

    #[test]
    fn names_and_shapes_are_checked() {
        for bad in ["", "Velocity", "p [Pa]", "a.b", "a/b", "1a", "_a"] {
            assert!(check_name(bad).is_err(), "{bad}");
        }
        check_name("fluid_force2").unwrap();
        let column = |components, data| Column {
            name: "a",
            units: "m",
            components,
            data,
        };
        let v = [0.0_f32; 6];
        column(3, Data::F32(&v)).check(2).unwrap();
        assert!(column(3, Data::F32(&v)).check(3).is_err());
        assert!(column(2, Data::F32(&v)).check(3).is_err());
        assert!(column(1, Data::U64(&[1])).check(1).is_err());
    }
}
