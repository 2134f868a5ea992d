//! History of a contact of blocks: start values of the search, and the springs of shear and twist.

use nalgebra::Vector3;

use super::super::linear_program::NO_BASIS;

/// History of a pair as plain data of 17 numbers. Lengths in m, forces in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockHistory {
    /// Axis that separated the pair at the last test, in the frame of the first block; zero if no axis did.
    pub(super) axis: Vector3<f64>,
    /// Last contact point, in the frame of the first block.
    pub(super) point: Vector3<f64>,
    /// Last basis of the linear program.
    pub(super) basis: [u16; 4],
    /// Last normal, in the axes of space; zero if there was no contact.
    pub(in crate::polyhedron) normal: Vector3<f64>,
    /// Force of the shear spring on the second block, in the axes of space.
    pub(in crate::polyhedron) shear: Vector3<f64>,
    /// Moment \[N m\] of the twist spring on the second block about the normal.
    pub(in crate::polyhedron) twist: f64,
}

impl Default for BlockHistory {
    fn default() -> Self {
        Self {
            axis: Vector3::zeros(),
            point: Vector3::zeros(),
            basis: NO_BASIS,
            normal: Vector3::zeros(),
            shear: Vector3::zeros(),
            twist: 0.0,
        }
    }
}

impl BlockHistory {
    /// Number of values.
    pub const NUMBERS: usize = 17;

    /// Returns `true` if the pair was in contact at the last test.
    #[must_use]
    pub fn touching(&self) -> bool {
        self.normal != Vector3::zeros()
    }

    /// Returns the history as numbers.
    #[must_use]
    pub fn save(&self) -> [f64; Self::NUMBERS] {
        let (a, p, n, s) = (self.axis, self.point, self.normal, self.shear);
        let b = self.basis.map(f64::from);
        [
            a.x, a.y, a.z, p.x, p.y, p.z, b[0], b[1], b[2], b[3], n.x, n.y, n.z, s.x, s.y, s.z,
            self.twist,
        ]
    }

    /// Reads the history from numbers.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "names of half-spaces were u16; anything else saturates and starts afresh"
    )]
    pub fn load(numbers: &[f64; Self::NUMBERS]) -> Self {
        let at = |k: usize| Vector3::new(numbers[k], numbers[k + 1], numbers[k + 2]);
        Self {
            axis: at(0),
            point: at(3),
            basis: [6, 7, 8, 9].map(|k| numbers[k] as u16),
            normal: at(10),
            shear: at(13),
            twist: numbers[16],
        }
    }

    /// Returns the force \[N\] of the shear spring on the second block, in the axes of space.
    pub(crate) fn spring(&self) -> Vector3<f64> {
        self.shear
    }

    /// Stores normal and shear spring of a contact whose force comes from another law than [`super::BlockPairLaw`].
    pub(crate) fn hold(&mut self, normal: &Vector3<f64>, shear: &Vector3<f64>) {
        self.normal = *normal;
        self.shear = *shear;
    }

    /// Ends the contact: springs are reset, but start values of the search remain.
    pub(super) fn release(&mut self) {
        self.normal = Vector3::zeros();
        self.shear = Vector3::zeros();
        self.twist = 0.0;
    }
}
