//! Bounce-back on links that cross a plane of symmetry and end in the mirror image of a body.
//!
//! Beyond a plane of symmetry flow and bodies continue as their mirror images. A link that leaves a cell x of water
//! along i through the plane ends in a cell of the image of a body if the cell y in the domain, of which that cell is
//! the image, lies in the body. Free slip exchanges the populations of x and y across the plane; here both bounce back
//! instead:
//!
//! f_ī(x, t+1) = f*_i(x) - T,  f_ē(y, t+1) = f*_e(y) - T',
//!
//! where e leads from y through the plane to the image of x. Each half of a link is listed where its cell is in the
//! slab.
//!
//! The link lies in the corner between the plane and the body, which has the cell y next to the plane. As at the foot
//! of a body on a wall ([`super`]) its momentum acts on both: along the axes on which it crosses planes on
//! these, along the others on the body. In water at rest the body then has the pressure on its sides and its top, and
//! the plane that on its open cells. A link that meets a structure before the plane, with water in the cell behind,
//! acts on the structure alone.

use super::gaps::Gaps;
use super::{
    Along, BodyLink, CellPlane, Load, Numbers, Parity, Rigid, Scheme, Table, add_along, dot,
    into_ball, into_block, surface_velocity,
};
use crate::boundary::FaceLoads;
use crate::lanes::Stored;
use crate::populations::Populations;
use crate::quanta::quanta;

/// Loads of the links of a body through planes of symmetry.
#[derive(Clone, Copy, Debug, Default)]
pub struct MirroredLoads {
    /// Load on the body.
    pub body: Load,
    /// Loads on the planes.
    pub planes: FaceLoads,
}

impl MirroredLoads {
    /// Adds the loads on the planes of other links.
    pub fn add_planes(&mut self, planes: &FaceLoads) {
        let loads = self.planes.as_flattened_mut().iter_mut();
        for (sum, load) in loads.zip(planes.as_flattened()) {
            *sum += load;
        }
    }
}

/// Half of a link through a plane of symmetry, at a cell of this slab.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirroredLink {
    /// Populations of the cell, point on the plane, direction in which they act on the body, and switches; the halves
    /// inside bodies have no load.
    pub half: BodyLink,
    /// Direction from the cell through the plane.
    pub leaves: u8,
    /// Index of the narrow gap whose velocity the surface has; none for that of the body.
    pub gap: Option<u32>,
    /// Coefficient κ of a stationary surface, 0 for half-way bounce-back; none for a body that may move.
    pub kappa: Option<f64>,
}

/// Applies bounce-back on the halves of a body and adds the loads; `gaps` are those of the halves, and `faces` those of
/// a polyhedron.
///
/// # Panics
/// Never: positions come from [`Populations::link`] of the same lattice.
pub fn bounce_mirrored<S: Stored, const D: usize>(
    populations: &mut Populations<S>,
    scheme: Scheme,
    links: &[MirroredLink],
    gaps: &Gaps,
    motion: &Rigid,
    faces: &[CellPlane],
    loads: &mut MirroredLoads,
) {
    let parity = populations.parity();
    let table = Table::new(populations);
    let numbers = Numbers(populations.numbers_mut().as_mut_ptr());
    let all = Along {
        numbers: numbers.0,
        parity,
        table: &table,
        motion,
    };
    for link in links {
        // SAFETY: positions made by `Populations::link` lie in the array, and no other thread uses it.
        unsafe { one::<S, D>(&all, scheme, link, gaps, faces, loads) };
    }
}

/// # Safety
/// The numbers must be the array that the link's positions refer to, and no other thread may use them.
unsafe fn one<S: Stored, const D: usize>(
    all: &Along<S>,
    scheme: Scheme,
    link: &MirroredLink,
    gaps: &Gaps,
    faces: &[CellPlane],
    loads: &mut MirroredLoads,
) {
    let (half, motion) = (&link.half, all.motion);
    let along = all.table.direction(half);
    // SAFETY: promised by the caller.
    let read = |at: usize| unsafe { all.numbers.add(at).read().to_f64() };
    let leaves = read(half.link.out(all.parity));
    let six_weights = along.six_weights;
    let middle: [f64; 3] =
        std::array::from_fn(|a| 0.5 * f64::from(half.middle[a]) - motion.position[a]);
    let wall = |at: [f64; 3]| {
        let own = || surface_velocity::<D>(motion, at);
        dot::<D>(along.c, link.gap.map_or_else(own, |gap| gaps.velocity(gap)))
    };
    let own = &all.table.0[usize::from(link.leaves % 32)];
    // f_i(x, t+1) - f*_ī(x), between the cell and that behind it.
    let difference = || {
        let near = half.link.near as usize;
        let home = near.wrapping_add_signed(own.swap);
        let behind = near.wrapping_add_signed(own.behind);
        match all.parity {
            Parity::Home => read(home) - read(behind),
            Parity::Reversed => read(behind) - read(home),
        }
    };
    let interpolates = half.loads && half.backed;
    let back = match (link.kappa, scheme) {
        (Some(kappa), _) if interpolates => leaves + kappa * difference(),
        (None, Scheme::Interpolated) if interpolates => {
            // The line from the cell to the plane, in the body, and that from its image on, in the image of the body.
            let start = std::array::from_fn(|a| middle[a] - 0.5 * along.c[a]);
            let from = std::array::from_fn(|a| middle[a] - 0.5 * own.c[a]);
            let before = entry::<D>(from, own.c, motion, faces).filter(|q| *q < 0.5);
            // Otherwise the link hits the image of the body.
            let q = before.or_else(|| entry::<D>(start, along.c, motion, faces));
            let q = q.unwrap_or(0.5).clamp(0.0, 1.0);
            let on_surface = std::array::from_fn(|a| start[a] + q * along.c[a]);
            let (kappa, alpha) = ((1.0 - 2.0 * q) / (1.0 + 2.0 * q), 4.0 / (1.0 + 2.0 * q));
            let wall = 0.5 * alpha * six_weights * wall(on_surface);
            leaves + kappa * difference() - wall
        }
        _ => leaves - six_weights * wall(middle),
    };
    // SAFETY: promised by the caller.
    unsafe {
        all.numbers
            .add(half.link.incoming(all.parity))
            .write(S::from_f64(back));
    }
    if half.loads {
        let given = quanta(leaves + back);
        let crosses: [bool; 3] = std::array::from_fn(|a| own.ci[a] != along.ci[a]);
        let acts = std::array::from_fn(|a| if crosses[a] { 0 } else { own.ci[a] });
        add_along::<D>(&mut loads.body, given, acts, half.middle);
        for (a, planes) in loads.planes.iter_mut().enumerate() {
            if crosses[a] {
                planes[usize::from(own.ci[a] > 0)] += i128::from(own.ci[a]) * i128::from(given);
            }
        }
    }
}

/// Returns the point at which the link from `d`, about the centre, along `c` enters the body, as a fraction of its
/// length; none if it passes the body.
fn entry<const D: usize>(
    d: [f64; 3],
    c: [f64; 3],
    motion: &Rigid,
    faces: &[CellPlane],
) -> Option<f64> {
    const ON_SURFACE: f64 = 1e-9;
    if faces.is_empty() {
        let q = into_ball::<D>(d, c, motion.radius);
        let at: [f64; 3] = std::array::from_fn(|a| d[a] + q * c[a]);
        let reached = dot::<D>(at, at) <= motion.radius.powi(2) * (1.0 + ON_SURFACE);
        return (reached && q >= 0.0).then_some(q);
    }
    let q = into_block(d, c, motion.position, faces);
    let at = std::array::from_fn(|a| motion.position[a] + d[a] + q * c[a]);
    let reached = faces.iter().all(|face| face.height(at) <= ON_SURFACE);
    reached.then_some(q)
}
