//! Parameters for every pair of materials.

use serde::Serialize;

/// Parameters for every unordered pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PairTable<P> {
    /// Number of materials n.
    materials: u32,
    /// Rows of an n x n table, symmetric.
    rows: Vec<P>,
}

impl<P: Clone> PairTable<P> {
    /// Returns a table with equal parameters for every pair of `materials` materials.
    #[must_use]
    pub fn uniform(materials: u32, parameters: P) -> Self {
        let materials = materials.max(1);
        Self {
            materials,
            rows: vec![parameters; materials as usize * materials as usize],
        }
    }

    /// Sets the parameters of one pair.
    pub fn set(&mut self, a: u32, b: u32, parameters: P) {
        let [i, j] = [self.row(a, b), self.row(b, a)];
        self.rows[i] = parameters.clone();
        self.rows[j] = parameters;
    }
}

impl<P> PairTable<P> {
    /// Returns the number of materials.
    #[must_use]
    pub fn materials(&self) -> u32 {
        self.materials
    }

    /// Returns the parameters of one pair; materials beyond the table use its last row.
    #[must_use]
    pub fn get(&self, a: u32, b: u32) -> &P {
        &self.rows[self.row(a, b)]
    }

    /// Returns every row, each pair twice.
    pub fn rows(&self) -> impl Iterator<Item = &P> {
        self.rows.iter()
    }

    /// Returns every row for changes, each pair twice.
    pub fn rows_mut(&mut self) -> impl Iterator<Item = &mut P> {
        self.rows.iter_mut()
    }

    /// Returns the rows of a material with every material.
    pub fn rows_of(&self, material: u32) -> impl Iterator<Item = &P> {
        (0..self.materials).map(move |other| self.get(material, other))
    }

    /// Returns a table of values computed from the rows.
    #[must_use]
    pub fn map<Q>(&self, make: impl FnMut(&P) -> Q) -> PairTable<Q> {
        PairTable {
            materials: self.materials,
            rows: self.rows.iter().map(make).collect(),
        }
    }

    /// Calls `visit` once for every pair of materials.
    pub(crate) fn for_each_pair(&self, mut visit: impl FnMut(u32, u32, &P)) {
        for a in 0..self.materials {
            for b in a..self.materials {
                visit(a, b, self.get(a, b));
            }
        }
    }

    /// Returns the index of a pair in the table, for [`Self::parameters_at`].
    #[expect(clippy::cast_possible_truncation, reason = "a few materials, squared")]
    pub(crate) fn index_of(&self, a: u32, b: u32) -> u32 {
        self.row(a, b) as u32
    }

    /// Returns the parameters at an index of the table.
    #[inline(always)]
    pub(crate) fn parameters_at(&self, place: u32) -> &P {
        &self.rows[place as usize]
    }

    fn row(&self, a: u32, b: u32) -> usize {
        let last = self.materials - 1;
        a.min(last) as usize * self.materials as usize + b.min(last) as usize
    }
}
