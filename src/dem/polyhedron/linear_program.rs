//! Intersection test of two sets of half-spaces by the linear program of Boon, Houlsby and Utili,
//!
//! ```text
//! minimise s   subject to   a_i . x - s <= d_i   for the half-spaces i of both blocks
//! ```
//!
//! The blocks overlap if `s* < 0`; `-s*` is the radius of the largest sphere in the overlap. The simplex method
//! solves the dual,
//!
//! ```text
//! maximise -sum l_i d_i   subject to   sum l_i a_i = 0,  sum l_i = 1,  l_i >= 0
//! ```
//!
//! A basis is four half-spaces. Each basis bounds `s*` from below: the search stops as soon as the bound exceeds
//! zero. The blocks are then separate, and the planes of the first block, weighted with their multipliers, sum up
//! to the normal of a separating plane. Otherwise the search ends with the point that is deepest inside both
//! blocks. The last basis of a pair is a good start for the next step.
//!
//! Source: C. W. Boon, G. T. Houlsby, S. Utili, Computers and Geotechnics 44 (2012) 73,
//! doi:10.1016/j.compgeo.2012.03.012.

use nalgebra::{Matrix3, Vector3};

use super::HalfSpace;

/// Basis without half-spaces, with which the search starts anew.
pub(super) const NO_BASIS: [u16; 4] = [u16::MAX; 4];

/// Result of the linear program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Deepest common point, and its depth \[m\].
    Overlap { point: Vector3<f64>, depth: f64 },
    /// Direction (not a unit vector) from the first set to the second, normal to a plane between them, and the
    /// minimum distance of any point from one of the half-spaces \[m\].
    Apart { axis: Vector3<f64>, gap: f64 },
    /// Undecided because of rounding: another test is needed.
    Open,
}

/// Normals of four distant planes around both sets, which form the initial basis if there is none.
const TETRAHEDRON: [[f64; 3]; 4] = [
    [1.0, 1.0, 1.0],
    [1.0, -1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
];

/// Basis with derived values.
struct Basis {
    inverse: Matrix3<f64>,
    origin: Vector3<f64>,
}

impl Basis {
    /// Returns the basis of four planes with the first as origin: rows `a_i - a_0`.
    fn new(planes: &[HalfSpace; 4]) -> Option<Self> {
        let origin = planes[0].normal;
        let [r, s, t] = [1, 2, 3].map(|k| planes[k].normal - origin);
        let (st, tr, rs) = (s.cross(&t), t.cross(&r), r.cross(&s));
        let volume = r.dot(&st);
        // Nearly coplanar unit normals form a basis whose orientation rounding may reverse.
        (volume.abs() > 1e-13).then(|| Self {
            inverse: Matrix3::from_columns(&[st, tr, rs]) / volume,
            origin,
        })
    }

    /// Returns the common point of the four planes shifted outwards by `s`, and `s`.
    fn point(&self, planes: &[HalfSpace; 4]) -> (Vector3<f64>, f64) {
        let first = planes[0].offset;
        let rises = Vector3::new(
            planes[1].offset - first,
            planes[2].offset - first,
            planes[3].offset - first,
        );
        let point = self.inverse * rises;
        (point, self.origin.dot(&point) - first)
    }

    /// Returns the numbers `m` with `sum m_i a_i = a`, `sum m_i = 1`.
    fn parts(&self, a: &Vector3<f64>) -> [f64; 4] {
        let rest = self.inverse.tr_mul(&(a - self.origin));
        [1.0 - rest.x - rest.y - rest.z, rest.x, rest.y, rest.z]
    }
}

/// Solves for the half-spaces of the first block (the first `own` of them, all within `reach` \[m\] of the origin)
/// and of the second. `basis` is the start basis, and the final basis on return.
pub(super) fn solve(planes: &[HalfSpace], own: usize, reach: f64, basis: &mut [u16; 4]) -> Verdict {
    let far = |k: usize| {
        let normal = Vector3::from(TETRAHEDRON[k]) / 3_f64.sqrt();
        HalfSpace {
            normal,
            offset: reach,
        }
    };
    let get = |name: u16| {
        let k = usize::from(name);
        planes.get(k).copied().unwrap_or_else(|| far(k & 3))
    };
    // The distant planes have the indices after all others.
    let Ok(count) = u16::try_from(planes.len()) else {
        return Verdict::Open;
    };
    let count = count.next_multiple_of(4);
    let afresh = [0, 1, 2, 3].map(|k| count + k);
    // Heights are accurate to the rounding of the largest offset, even for a mountain and a pebble.
    let scale = planes.iter().map(|p| p.offset.abs()).fold(reach, f64::max);
    let tolerance = 1e-15 * scale;
    let mut names = *basis;
    let valid = names.iter().all(|&name| name < count + 4);
    let mut current = names.map(get);
    let mut solved = if valid { Basis::new(&current) } else { None };
    if let Some(warm) = &solved
        && warm
            .parts(&Vector3::zeros())
            .iter()
            .any(|&part| part < -1e-12)
    {
        solved = None;
    }
    let mut system = match solved {
        Some(warm) => warm,
        None => {
            names = afresh;
            current = names.map(get);
            match Basis::new(&current) {
                Some(first) => first,
                None => return Verdict::Open,
            }
        }
    };
    for _ in 0..planes.len() + 40 {
        let (point, s) = system.point(&current);
        let weights = system.parts(&Vector3::zeros());
        if s > 0.0 {
            *basis = names;
            let axis = (0..4)
                .filter(|&k| usize::from(names[k]) < own || names[k] >= count)
                .map(|k| current[k].normal * weights[k])
                .sum();
            return Verdict::Apart { axis, gap: s };
        }
        // The most violated plane enters the basis.
        let mut worst = (tolerance, usize::MAX);
        for (k, plane) in planes.iter().enumerate() {
            let height = plane.height(&point) - s;
            if height > worst.0 {
                worst = (height, k);
            }
        }
        let entering = worst.1;
        let Some(plane) = planes.get(entering) else {
            *basis = names;
            return Verdict::Overlap { point, depth: -s };
        };
        // The first plane whose multiplier falls to zero leaves the basis.
        let parts = system.parts(&plane.normal);
        let mut leaving = (f64::INFINITY, 4, 0.0);
        for k in 0..4 {
            if parts[k] > 1e-11 {
                let ratio = weights[k].max(0.0) / parts[k];
                // Among equal ratios take the larger pivot, which gives the better basis.
                if ratio < leaving.0 || (ratio <= leaving.0 && parts[k] > leaving.2) {
                    leaving = (ratio, k, parts[k]);
                }
            }
        }
        let out = leaving.1;
        if out == 4 {
            break;
        }
        let Ok(name) = u16::try_from(entering) else {
            break;
        };
        names[out] = name;
        current[out] = *plane;
        match Basis::new(&current) {
            Some(next) => system = next,
            None => break,
        }
    }
    *basis = NO_BASIS;
    Verdict::Open
}
