//! Velocity sets as values, for code outside the cell loop.

use super::{D2Q9, D3Q19, D3Q27, Lattice};

/// Choice of a velocity set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum VelocitySet {
    /// Two dimensions, nine velocities.
    D2Q9,
    /// Three dimensions, nineteen velocities.
    D3Q19,
    /// Three dimensions, twenty-seven velocities.
    D3Q27,
}

impl VelocitySet {
    /// Returns the number of velocities.
    #[must_use]
    pub fn count(self) -> usize {
        match self {
            Self::D2Q9 => 9,
            Self::D3Q19 => 19,
            Self::D3Q27 => 27,
        }
    }

    /// Returns the number of space dimensions.
    #[must_use]
    pub fn dimension(self) -> usize {
        match self {
            Self::D2Q9 => 2,
            Self::D3Q19 | Self::D3Q27 => 3,
        }
    }

    /// Returns the tables of the velocity set.
    #[must_use]
    pub fn velocities(self) -> Velocities {
        match self {
            Self::D2Q9 => Velocities::for_lattice::<D2Q9, 9>(),
            Self::D3Q19 => Velocities::for_lattice::<D3Q19, 19>(),
            Self::D3Q27 => Velocities::for_lattice::<D3Q27, 27>(),
        }
    }
}

/// Tables of the velocity set at run time, for code outside the cell loop (boundaries, coupling, output).
#[derive(Clone, Debug)]
pub struct Velocities {
    /// Name of the set.
    pub name: &'static str,
    /// Number of space dimensions.
    pub dimension: usize,
    /// Velocity of each population.
    pub c: Vec<[i8; 3]>,
    /// Weight of each population.
    pub w: Vec<f64>,
    /// Opposite of each population.
    pub opposite: Vec<usize>,
}

impl Velocities {
    /// Returns the tables of the velocity set `L`.
    #[must_use]
    pub fn for_lattice<L: Lattice<Q>, const Q: usize>() -> Self {
        Self {
            name: L::NAME,
            dimension: L::DIMENSION,
            c: L::C.to_vec(),
            w: L::W.to_vec(),
            opposite: L::OPPOSITE.to_vec(),
        }
    }

    /// Returns the number of populations.
    #[must_use]
    pub fn q(&self) -> usize {
        self.c.len()
    }
}
