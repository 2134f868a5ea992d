//! Lanes in the vector registers of x86-64 processors: one list of operations for f64 and f32.

/// Implements [`Lanes`](crate::lanes::Lanes) and its operators for a register, and
/// [`Memory`](crate::lanes::Memory) for the numbers in it. The static `COUNT` of the caller holds the indices of the
/// lanes.
macro_rules! vector_lanes {
    ($lanes:ident, $own:ty, $width:literal, [$($operator:ident $function:ident $operation:ident),*], [$fma:ident,
        $fnma:ident, $sqrt:ident], [$load:ident, $store:ident], |$x:ident| $splat:expr, |$test:ident, $zero:ident,
            $other:ident| $choose:expr, |$from:ident, $bound:ident| $above:expr, |$numbers:ident, $number:ident|
                $equal:expr) => {
        $(
            impl $operator for $lanes {
                type Output = Self;
                #[inline(always)]
                fn $function(self, b: Self) -> Self {
                    // SAFETY: a value of this type exists only inside a kernel that is entered after the instruction
                    // set was detected (`Level::best`); the same is true for each operation below.
                    Self(unsafe { $operation(self.0, b.0) })
                }
            }
        )*
        impl Lanes for $lanes {
            const WIDTH: usize = $width;
            #[inline(always)]
            fn splat($x: f64) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $splat })
            }
            #[inline(always)]
            fn count() -> Self {
                // SAFETY: as for the operators; at least as many numbers as lanes.
                Self(unsafe { $load(COUNT.as_ptr()) })
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $fma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn neg_mul_add(self, a: Self, b: Self) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $fnma(self.0, a.0, b.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as for the operators.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn where_zero(self, a: Self, b: Self) -> Self {
                let ($test, $zero, $other) = (self.0, a.0, b.0);
                // SAFETY: as for the operators.
                Self(unsafe { $choose })
            }
            #[inline(always)]
            unsafe fn above($from: *const f32, $bound: f32) -> u8 {
                // SAFETY: the caller promises WIDTH readable elements; instruction set as for the operators.
                unsafe { $above }
            }
            #[inline(always)]
            unsafe fn equal($numbers: *const u32, $number: u32) -> u8 {
                // SAFETY: as for `above`.
                unsafe { $equal }
            }
        }
        $crate::vectors::memory!($own, $lanes, |p| $load(p), |p, v| $store(p, v.0));
    };
}

/// Implements [`Memory`](crate::lanes::Memory) for stored numbers and a register.
macro_rules! memory {
    ($stored:ty, $lanes:ident, |$from:ident| $load:expr, |$to:ident, $value:ident| $store:expr) => {
        impl Memory<$lanes> for $stored {
            #[inline(always)]
            unsafe fn load($from: *const Self) -> $lanes {
                // SAFETY: the caller promises WIDTH readable elements; instruction set as for the operators.
                $lanes(unsafe { $load })
            }
            #[inline(always)]
            unsafe fn store($to: *mut Self, $value: $lanes) {
                // SAFETY: the caller promises WIDTH writable elements; instruction set as for the operators.
                unsafe { $store }
            }
        }
    };
}

pub(crate) use {memory, vector_lanes};
