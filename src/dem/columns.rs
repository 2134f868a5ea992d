//! Generation of a struct of arrays from a list: [`grain_arrays`] generates the storage of the grains from one line
//! per array.
//!
//! A line names the array, its container and element type, the occasion on which it crosses ranks ([`Crosses`]),
//! its treatment in checkpoints ([`CheckpointColumns`]) and the value of a new grain. Insertion, removal,
//! reordering, messages and checkpoints are generated from the list. The element type implements [`Entry`]; for a
//! struct of numbers the macro `entry` does so.

use std::ops::{Deref, DerefMut};

use super::space::Space;
use super::table::{Entry, NamedColumns};
use base::error::Error;

/// Occasion on which an array crosses ranks. Later variants include the earlier ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Crosses {
    /// Change of the owner of a grain; ghosts have the value of a new grain.
    Migration,
    /// Creation of a ghost as well.
    Creation,
    /// Every solid step as well, from the owner to the ghosts.
    EveryStep,
}

/// Prefix of the column names of an array in checkpoints, "" for none; the variant states whether the hash of the
/// state includes the array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum CheckpointColumns {
    /// Array in the checkpoint and in the hash of the state.
    Hashed(&'static str),
    /// Array in the checkpoint only.
    Unhashed(&'static str),
}

impl CheckpointColumns {
    pub(super) const fn prefix(self) -> &'static str {
        match self {
            Self::Hashed(prefix) | Self::Unhashed(prefix) => prefix,
        }
    }

    pub(super) const fn is_hashed(self) -> bool {
        matches!(self, Self::Hashed(_))
    }
}

/// Container with one element per grain.
pub(super) trait Array {
    /// Type of the elements.
    type Item: Copy;
    /// Returns `true` if the scene uses the array.
    fn is_present(&self) -> bool;
    /// Appends an element, if the scene uses the array.
    fn push(&mut self, value: Self::Item);
    /// Drops all elements beyond the first `entries`.
    fn truncate(&mut self, entries: usize);
    /// Rearranges the array: element `k` of the result is element `order[k]`.
    fn arrange(&mut self, order: &[usize]);
    /// Reads the array from a table, if the table contains it.
    fn load<S: Space>(&mut self, name: &str, from: &NamedColumns) -> Result<(), Error>
    where
        Self::Item: Entry<S>;
}

impl<T: Copy> Array for Vec<T> {
    type Item = T;

    fn is_present(&self) -> bool {
        true
    }
    fn push(&mut self, value: T) {
        self.push(value);
    }
    fn truncate(&mut self, entries: usize) {
        self.truncate(entries);
    }
    fn arrange(&mut self, order: &[usize]) {
        *self = order.iter().map(|&k| self[k]).collect();
    }
    fn load<S: Space>(&mut self, name: &str, from: &NamedColumns) -> Result<(), Error>
    where
        T: Entry<S>,
    {
        *self = T::load(name, from)?;
        Ok(())
    }
}

/// Array that only some scenes use: empty until it is allocated.
#[derive(Clone, Debug)]
pub struct Optional<T> {
    values: Vec<T>,
    is_present: bool,
}

impl<T> Default for Optional<T> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            is_present: false,
        }
    }
}

impl<T: Copy> Optional<T> {
    /// Returns `true` if the array is allocated.
    #[must_use]
    pub fn is_allocated(&self) -> bool {
        self.is_present
    }

    /// Allocates the array with these elements, one per grain.
    pub(super) fn allocate(&mut self, values: impl Iterator<Item = T>) {
        self.values.clear();
        self.values.extend(values);
        self.is_present = true;
    }

    /// Frees the array; the scene no longer uses it.
    pub(super) fn free(&mut self) {
        *self = Self::default();
    }
}

impl<T> Deref for Optional<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        &self.values
    }
}

impl<T> DerefMut for Optional<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values
    }
}

impl<T: Copy> Array for Optional<T> {
    type Item = T;

    fn is_present(&self) -> bool {
        self.is_present
    }
    fn push(&mut self, value: T) {
        if self.is_present {
            self.values.push(value);
        }
    }
    fn truncate(&mut self, entries: usize) {
        self.values.truncate(entries);
    }
    fn arrange(&mut self, order: &[usize]) {
        if self.is_present {
            self.values.arrange(order);
        }
    }
    fn load<S: Space>(&mut self, name: &str, from: &NamedColumns) -> Result<(), Error>
    where
        T: Entry<S>,
    {
        if from.has(&T::first_column(name)) {
            self.allocate(T::load(name, from)?.into_iter());
        }
        Ok(())
    }
}

/// Generates the struct of arrays and all functions that depend on the list of arrays; see the module and the list
/// in `particles.rs`.
///
/// `given` arrays contain the data of a new grain, which is a struct with the same fields; `held` arrays start with
/// a value computed from it; `derived` arrays are functions of it, and neither cross ranks nor are saved in a
/// checkpoint.
macro_rules! grain_arrays {
    (
        $(#[$meta:meta])*
        pub struct $name:ident {
            given {
                $( $(#[$given_about:meta])*
                $given_vis:vis $given:ident: Vec<$given_type:ty>,
                    $given_crosses:ident, $given_saved:ident($given_prefix:literal)
                    $(, saves $given_of:ident)?; )*
            }
            held {
                $( $(#[$held_about:meta])*
                $held_vis:vis $held:ident: $held_array:ident<$held_type:ty>,
                    $held_crosses:ident, $held_saved:ident($held_prefix:literal), $held_new:expr; )*
            }
            derived {
                $( $(#[$derived_about:meta])*
                $derived_vis:vis $derived:ident: $derived_type:ty, $derived_new:expr; )*
            }
            $( $(#[$other_about:meta])* $other_vis:vis $other:ident: $other_type:ty, )*
        }
    ) => {
        $(#[$meta])*
        pub struct $name<S: Space> {
            $( $(#[$given_about])* $given_vis $given: Vec<$given_type>, )*
            $( $(#[$held_about])* $held_vis $held: $held_array<$held_type>, )*
            $( $(#[$derived_about])* $derived_vis $derived: Vec<$derived_type>, )*
            $( $(#[$other_about])* $other_vis $other: $other_type, )*
        }

        impl<S: Space> Default for $name<S> {
            fn default() -> Self {
                Self {
                    $( $given: Vec::default(), )*
                    $( $held: $held_array::default(), )*
                    $( $derived: Vec::default(), )*
                    $( $other: Default::default(), )*
                }
            }
        }

        /// Values of a new entry.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct NewEntry<S: Space> {
            $( pub(super) $given: $given_type, )*
        }

        impl<S: Space> $name<S> {
            /// Returns the `given` arrays of entry `k`.
            fn given(&self, k: usize) -> NewEntry<S> {
                NewEntry { $( $given: self.$given[k], )* }
            }

            fn push_given(&mut self, new: &NewEntry<S>) {
                $( self.$given.push(new.$given); )*
                $( {
                    let derive: fn(&NewEntry<S>) -> $derived_type = $derived_new;
                    self.$derived.push(derive(new));
                } )*
            }

            /// Appends a new entry.
            pub(super) fn push(&mut self, new: &NewEntry<S>) {
                self.push_given(new);
                $( {
                    let initial: fn(&NewEntry<S>) -> $held_type = $held_new;
                    Array::push(&mut self.$held, initial(new));
                } )*
            }

            /// Appends an image of entry `k` as a ghost.
            pub(super) fn push_image(&mut self, k: usize, shift: [i32; 3]) {
                let new = NewEntry { shift, ..self.given(k) };
                self.push_given(&new);
                $( if self.$held.is_present() {
                    let initial: fn(&NewEntry<S>) -> $held_type = $held_new;
                    let value = if Crosses::$held_crosses >= Crosses::Creation {
                        self.$held[k]
                    } else {
                        initial(&new)
                    };
                    Array::push(&mut self.$held, value);
                } )*
            }

            /// Drops all entries beyond the first `entries`.
            fn truncate(&mut self, entries: usize) {
                $( Array::truncate(&mut self.$given, entries); )*
                $( Array::truncate(&mut self.$held, entries); )*
                $( Array::truncate(&mut self.$derived, entries); )*
            }

            /// Rearranges the arrays: entry `k` of the result is entry `order[k]`.
            fn arrange_arrays(&mut self, order: &[usize]) {
                $( Array::arrange(&mut self.$given, order); )*
                $( Array::arrange(&mut self.$held, order); )*
                $( Array::arrange(&mut self.$derived, order); )*
            }

            /// Writes entry `k` as the image with this shift, with the arrays that cross ranks on this occasion.
            pub(super) fn pack(&self, k: usize, shift: [i32; 3], when: Crosses, to: &mut Writer) {
                let new = NewEntry { shift, ..self.given(k) };
                $( Entry::<S>::pack(&new.$given, to); )*
                $( if self.$held.is_present() && Crosses::$held_crosses >= when {
                    Entry::<S>::pack(&self.$held[k], to);
                } )*
            }

            /// Appends an entry written by [`Self::pack`] on the same occasion.
            pub(super) fn unpack(&mut self, when: Crosses, from: &mut Reader<'_>) -> Result<(), Error> {
                let new = NewEntry { $( $given: Entry::<S>::unpack(from)?, )* };
                self.push_given(&new);
                $( if self.$held.is_present() {
                    let initial: fn(&NewEntry<S>) -> $held_type = $held_new;
                    let value = if Crosses::$held_crosses >= when {
                        Entry::<S>::unpack(from)?
                    } else {
                        initial(&new)
                    };
                    Array::push(&mut self.$held, value);
                } )*
                Ok(())
            }

            /// Returns the number of bytes of an entry in the message of a solid step.
            pub(super) fn step_bytes(&self) -> usize {
                let mut bytes = 0;
                $( if Crosses::$given_crosses == Crosses::EveryStep {
                    bytes += <$given_type as Entry<S>>::BYTES;
                } )*
                $( if self.$held.is_present() && Crosses::$held_crosses == Crosses::EveryStep {
                    bytes += <$held_type as Entry<S>>::BYTES;
                } )*
                bytes
            }

            /// Copies the arrays that cross in every step from owned entries to their images, `(owned entry,
            /// image)`.
            pub(super) fn copy_step(&mut self, images: &[(u32, u32)]) {
                $( if Crosses::$given_crosses == Crosses::EveryStep {
                    for &(from, to) in images {
                        self.$given[to as usize] = self.$given[from as usize];
                    }
                } )*
                $( if self.$held.is_present() && Crosses::$held_crosses == Crosses::EveryStep {
                    for &(from, to) in images {
                        self.$held[to as usize] = self.$held[from as usize];
                    }
                } )*
            }

            /// Writes the message of a solid step for these entries, one array after another.
            pub(super) fn pack_step(&self, entries: &[u32], to: &mut Writer) {
                $( if Crosses::$given_crosses == Crosses::EveryStep {
                    for &k in entries {
                        Entry::<S>::pack(&self.$given[k as usize], to);
                    }
                } )*
                $( if self.$held.is_present() && Crosses::$held_crosses == Crosses::EveryStep {
                    for &k in entries {
                        Entry::<S>::pack(&self.$held[k as usize], to);
                    }
                } )*
            }

            /// Reads the message of a solid step into these entries.
            pub(super) fn unpack_step(
                &mut self,
                entries: Range<usize>,
                from: &mut Reader<'_>,
            ) -> Result<(), Error> {
                $( if Crosses::$given_crosses == Crosses::EveryStep {
                    for value in &mut self.$given[entries.clone()] {
                        *value = Entry::<S>::unpack(from)?;
                    }
                } )*
                $( if self.$held.is_present() && Crosses::$held_crosses == Crosses::EveryStep {
                    for value in &mut self.$held[entries.clone()] {
                        *value = Entry::<S>::unpack(from)?;
                    }
                } )*
                Ok(())
            }

            /// Writes the columns of the owned grains: all saved arrays, or only those in the hash of the state.
            fn save_columns(&self, hashed_only: bool, to: &mut Columns<'_>) {
                let owned = 0..self.owned;
                $( {
                    let saved = CheckpointColumns::$given_saved($given_prefix);
                    if saved.is_hashed() || !hashed_only {
                        let value = |k: usize| grain_arrays!(@value self k $given $($given_of)?);
                        <$given_type as Entry<S>>::save(saved.prefix(), owned.clone().map(value), to);
                    }
                } )*
                $( {
                    let saved = CheckpointColumns::$held_saved($held_prefix);
                    if self.$held.is_present() && (saved.is_hashed() || !hashed_only) {
                        let values = self.$held[owned.clone()].iter().copied();
                        <$held_type as Entry<S>>::save(saved.prefix(), values, to);
                    }
                } )*
            }

            /// Loads the arrays from the columns of a table.
            fn load_columns(&mut self, from: &NamedColumns) -> Result<(), Error> {
                $( Array::load::<S>(
                    &mut self.$given,
                    CheckpointColumns::$given_saved($given_prefix).prefix(),
                    from,
                )?; )*
                $( Array::load::<S>(
                    &mut self.$held,
                    CheckpointColumns::$held_saved($held_prefix).prefix(),
                    from,
                )?; )*
                for k in 0..from.rows() {
                    let new = self.given(k);
                    $( {
                        let derive: fn(&NewEntry<S>) -> $derived_type = $derived_new;
                        self.$derived.push(derive(&new));
                    } )*
                }
                Ok(())
            }
        }
    };
    (@value $particles:ident $k:ident $array:ident) => { $particles.$array[$k] };
    (@value $particles:ident $k:ident $array:ident $of:ident) => { $particles.$of($k) };
}
pub(super) use grain_arrays;
