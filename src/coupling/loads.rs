//! Loads of the lattice on a body, converted from exact sums in quanta to SI.

use base::units::LatticeUnits;
use dem::particles::Load as GrainLoad;
use dem::space::{Components, Space};
use lbm::boundary::from_quanta;
use lbm::links::Load;

/// Returns the force and torque in lattice units about a raw centre \[cells\], from exact sums about the origin of
/// the raw frame.
#[must_use]
pub fn about_centre(centre: [f64; 3], load: &Load) -> [f64; 6] {
    // Twice the moment about a cell corner near the centre, still exact; only then converted to floating point.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "positions in cells are far below 2^63"
    )]
    let corner = centre.map(|v| i128::from(v.floor() as i64));
    let f = [load[0], load[1], load[2]];
    let moment = [
        load[3] - 2 * (corner[1] * f[2] - corner[2] * f[1]),
        load[4] - 2 * (corner[2] * f[0] - corner[0] * f[2]),
        load[5] - 2 * (corner[0] * f[1] - corner[1] * f[0]),
    ];
    let force = f.map(from_quanta);
    let rest = centre.map(|x| x - x.floor());
    let half = moment.map(|m| 0.5 * from_quanta(m));
    [
        force[0],
        force[1],
        force[2],
        half[0] - (rest[1] * force[2] - rest[2] * force[1]),
        half[1] - (rest[2] * force[0] - rest[0] * force[2]),
        half[2] - (rest[0] * force[1] - rest[1] * force[0]),
    ]
}

/// Returns a load in SI; `buoyancy` [N/m3] acts on `volume` \[m3\].
#[must_use]
pub fn to_grain<Sp: Space>(
    units: &LatticeUnits,
    load: &[f64; 6],
    buoyancy: [f64; 3],
    volume: f64,
) -> GrainLoad<Sp> {
    let mut grain = GrainLoad::<Sp>::default();
    for a in 0..Sp::DIMENSION {
        grain
            .force
            .set(a, units.force_to_si(load[a]) + buoyancy[a] * volume);
    }
    if Sp::DIMENSION == 2 {
        grain.torque.set(0, units.torque_to_si(load[5]));
    } else {
        for a in 0..3 {
            grain.torque.set(a, units.torque_to_si(load[3 + a]));
        }
    }
    grain
}
