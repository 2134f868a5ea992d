//! Axes along which gravity acts on the water of a lattice.
//!
//! The total pressure is p = p' + P, of which the lattice solves for p'. With the water's weight on the lattice, P = 0.
//! Without it P is hydrostatic, grad P = rho g: then the lattice has no force, and P exerts on a solid of volume V
//! the force
//! -rho g V, its buoyancy. Along each axis exactly one of the two holds:
//!
//! | along an axis | force on the water [N/m3] | force of P on a solid \[N\] |
//! |---|---|---|
//! | gravity acts | rho g | 0 |
//! | gravity is balanced by P | 0 | -rho g V |
//!
//! Along a periodic axis P would rise from one end to the other. In a closed vessel or conduit it may. Below a surface
//! it cannot: the pressure there is that of the air everywhere, and the weight along the slope, rho g sin(slope),
//! drives the stream (Chow, Open-channel hydraulics, 1959, section 3-1). Its balance, once it is steady, is rho g
//! sin(slope) V = shear of the walls + force on the solids.

use super::body_force::BodyForce;
use super::findings::{Findings, LATTICE_PATH as PATH, number};
use super::grid::Grid;
use crate::scene::boundaries::ScenePatch;
use base::error::Remedy;
use base::vector::norm;
use case::Case;
use case::fluid::{GravityOnFluid, LatticeBoltzmann, Where};
use lbm::boundary::SurfaceKind;

const AXES: [&str; 3] = ["x", "y", "z"];
/// Relative difference below which a body force is considered to be the weight of the water.
const SAME_WEIGHT: f64 = 0.1;

/// Maximum acceleration of gravity [m/s²]: ten times that of the fastest centrifuges.
const LARGEST: f64 = 1e8;

/// Refuses an unrealistic acceleration.
pub(super) fn check_size(gravity: [f64; 3], findings: &mut Findings) {
    let size = norm(gravity);
    if size > LARGEST {
        findings.error(
            "gravity",
            format!(
                "the acceleration is {} m/s2; at most {} is allowed",
                number(size),
                number(LARGEST)
            ),
            "write the value in m/s2: it is 9.81 on Earth and up to 1e7 in a centrifuge",
        );
    }
}

/// Returns `true` for the axes along which gravity acts on the water; reports contradictions.
pub(super) fn gravity_axes(
    case: &Case,
    lbm: &LatticeBoltzmann,
    grid: &Grid,
    (faces, force): (&[Vec<ScenePatch>; 6], &BodyForce),
    findings: &mut Findings,
) -> [bool; 3] {
    let gravity = case.gravity.as_ref().map_or([0.0; 3], |g| g.to_array());
    let pulls = |a: usize| a < grid.dimension && gravity[a] != 0.0;
    let path = format!("{PATH}.gravity_acts_on_fluid");
    let written = lbm.gravity_acts_on_fluid;
    let stated = !matches!(written, GravityOnFluid::Where(Where::Auto));
    if written != GravityOnFluid::All(false) && stated && !(0..3).any(pulls) {
        findings.warn(
            &path,
            "there is no gravity in this case",
            Remedy::from("add `gravity`, or remove this field").set(&*path, false),
        );
    }
    let surface = faces.iter().flatten().find(|patch| {
        let axis = patch.face.axis();
        let down = gravity[axis] * patch.face.inward()[axis];
        down > 0.0 && patch.condition.model().kind().surface == SurfaceKind::Symmetry
    });
    let along = |a: usize| pulls(a) && grid.periodic[a];
    if lbm.surface.is_some() {
        if written != GravityOnFluid::All(true) && stated {
            findings.error(
                &path,
                "gravity acts along all axes on water with a free surface, so that this field has no effect",
                Remedy::take_out("remove this field", &path),
            );
        }
        return std::array::from_fn(pulls);
    }
    let acts: [bool; 3] = std::array::from_fn(|a| match written {
        GravityOnFluid::All(all) => all && pulls(a),
        GravityOnFluid::Where(Where::AlongPeriodicAxes) => along(a),
        GravityOnFluid::Where(Where::Auto) => surface.is_some() && along(a),
    });
    if let (Some(surface), Some(axis)) = (surface, (0..3).find(|&a| along(a) && !acts[a])) {
        findings.warn(
            &path,
            format!(
                "under the surface `{}` no wall supports the weight of the water along {}, but solids receive \
                 the buoyancy of supported water, which pushes them up the slope",
                surface.name, AXES[axis]
            ),
            Remedy::from("write along_periodic_axes, or, for a closed conduit, replace this surface by a wall")
                .set(&*path, "along_periodic_axes"),
        );
    }
    let BodyForce::Constant(force) = force else {
        return acts;
    };
    for a in (0..3).filter(|&a| along(a)) {
        let weight = lbm.density * gravity[a];
        if (force[a] - weight).abs() > SAME_WEIGHT * weight.abs() {
            continue;
        }
        let alone = (0..3).all(|other| other == a || force[other] == 0.0);
        let body = format!("{PATH}.body_force");
        let reason = format!(
            "{} N/m3 along {} equals the weight of the water, {} N/m3, which would act twice: {}",
            number(force[a]),
            AXES[a],
            number(weight),
            if acts[a] {
                "gravity already acts on the water along this axis"
            } else {
                "solids already receive the buoyancy of water at rest"
            }
        );
        let mut remedy = Remedy::from(
            "let gravity drive the water with along_periodic_axes, and remove this component",
        );
        if alone {
            remedy = Remedy::take_out(remedy, &body);
            if !acts[a] {
                remedy = remedy.set(&*path, "along_periodic_axes");
            }
        }
        findings.error(&format!("{body}.constant"), reason, remedy);
    }
    acts
}

/// Returns the treatment of gravity in the water and its reason, for `plan`; none if there is no gravity.
pub(crate) fn describe(gravity: [f64; 3], acts: [bool; 3]) -> Option<(String, String)> {
    let names = |which: bool| -> Vec<&str> {
        (0..3)
            .filter(|&a| gravity[a] != 0.0 && acts[a] == which)
            .map(|a| AXES[a])
            .collect()
    };
    let (driven, held) = (names(true).join(" and "), names(false).join(" and "));
    Some(match (driven.is_empty(), held.is_empty()) {
        (true, true) => return None,
        (true, false) => (
            "in the pressure".into(),
            format!(
                "along {held}: the pressure is the excess over the hydrostatic pressure, and solids have their \
                 buoyancy"
            ),
        ),
        (false, true) => (
            "acts".into(),
            format!("along {driven}: the computed pressure of the lattice balances or drives it"),
        ),
        (false, false) => (
            format!("acts along {driven}"),
            format!(
                "gravity drives the water along these axes; along {held} the pressure is the excess over the \
                 hydrostatic pressure, and solids have their buoyancy"
            ),
        ),
    })
}
