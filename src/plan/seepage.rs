//! Consistency checks of seepage input.
//!
//! * Different heads next to each other without a structure between them. If a sheet pile ends next to the edge of
//!   a patch, or short of the surface, neighbouring cells on the surface have different heads. Water then flows
//!   from one to the other around the pile, and the discharge depends on the size of the cells.
//! * Ground that is in no zone. Without grains it is open water.
//! * Ground that is so dry at the start that its water is lost to rounding. Newton's method then fails.
//! * Values in wrong units: permeabilities and densities that no ground and no liquid has, heads below the ground
//!   on which they act.

use super::explicit_drag::openness;
use crate::scene::Scene;
use crate::scene::findings::{Findings, number};
use crate::scene::seepage::{PATH, Seepage};
use base::error::Remedy;
use base::vector::{dot, norm};
use case::darcy::{InitialState, ZonePermeability};
use darcy::{Condition, Openness};

/// Fraction of the largest head difference above which the heads of neighbours count as different.
const HEAD_DIFFERENCE: f64 = 0.1;
/// Permeability of coarse gravel \[m²\] (J. Bear, Dynamics of Fluids in Porous Media, 1972, table 5.5.1: up to
/// 1e-7).
const GRAVEL: f64 = 1e-6;
/// Range of densities of liquids \[kg/m³\].
const LIQUIDS: [f64; 2] = [500.0, 2e4];

/// Runs all checks and reports warnings.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let Some(seepage) = &scene.seepage else {
        return;
    };
    // In unsaturated ground the zones are the ground, with or without grains.
    let without_grains =
        scene.grains.is_none() && scene.bodies.is_empty() || seepage.written.unsaturated.is_some();
    units(scene, seepage, findings);
    heads(scene, seepage, findings);
    driest(seepage, findings);
    super::ends::check(scene, seepage, findings);
    let several = seepage
        .patches
        .iter()
        .filter(|p| p.condition.holds())
        .count()
        > 1;
    if !several && !without_grains {
        return;
    }
    let openness = openness(seepage, scene.grid.dimension);
    if several {
        short_circuits(scene, seepage, &openness, findings);
    }
    if without_grains {
        if scene.grains.is_none() {
            nothing_drives(scene, seepage, findings);
        }
        open_water(seepage, &openness, findings);
    }
}

/// Reports a uniform start that is drier than a retention can state.
fn driest(seepage: &Seepage, findings: &mut Findings) {
    let Some(soil) = &seepage.written.unsaturated else {
        return;
    };
    let Some(InitialState::PressureHead(head)) = soil.transient.as_ref().map(|flow| flow.initial)
    else {
        return;
    };
    let zones = seepage
        .written
        .zones
        .iter()
        .filter_map(|zone| zone.retention.as_ref());
    let laws = std::iter::once(&soil.retention).chain(zones);
    let driest = laws.map(|law| (law.model().driest_head(), law.model().description()));
    let Some((driest, law)) = driest.max_by(|a, b| a.0.total_cmp(&b.0)) else {
        return;
    };
    if head >= driest {
        return;
    }
    // A value with few digits that is not drier.
    let unit = 10_f64.powf((-driest).log10().floor() - 1.0);
    let proposed = -((-driest / unit).floor() * unit);
    let path = format!("{PATH}.unsaturated.transient.initial.pressure_head");
    findings.unstable(
        &path,
        format!(
            "with the retention {law} the water that can drain at a pressure head of {} m is less than the rounding \
             of that of saturation; below {} m the flow may not converge",
            number(head),
            number(driest)
        ),
        Remedy::from(format!(
            "use a pressure head of at least {} m, or a retention with a slower fall, such as van_genuchten with a \
             smaller n",
            number(proposed)
        ))
        .set(path.clone(), proposed),
    );
}

fn units(scene: &Scene, seepage: &Seepage, findings: &mut Findings) {
    let written = &seepage.written;
    let [least, most] = LIQUIDS;
    if !(least..=most).contains(&written.density) {
        findings.warn(
            &format!("{PATH}.density"),
            format!(
                "no liquid has a density of {} kg/m3",
                number(written.density)
            ),
            Remedy::from("state the density in kg/m3: water has 1000")
                .set(format!("{PATH}.density"), 1000.0),
        );
    }
    let strength = norm(scene.gravity);
    if strength <= 0.0 {
        return;
    }
    // Hydraulic conductivity of a permeability of 1 m2.
    let conducts = written.density * strength / written.viscosity;
    for (n, zone) in written.zones.iter().enumerate() {
        let path = format!("{PATH}.zones[{n}].permeability");
        match zone.permeability {
            Some(ZonePermeability::Value(k)) if k > GRAVEL => findings.warn(
                &path,
                format!(
                    "a permeability of {} m2 is a hydraulic conductivity of {} m/s; coarse gravel has a permeability \
                     of about 1e-7 m2",
                    number(k),
                    number(k * conducts)
                ),
                Remedy::from(format!(
                    "if {} is a hydraulic conductivity in m/s, write {{\"hydraulic_conductivity\": {k}}}",
                    number(k)
                ))
                .set(path.clone(), serde_json::json!({"hydraulic_conductivity": k})),
            ),
            Some(ZonePermeability::HydraulicConductivity(k)) if k > GRAVEL * conducts => {
                findings.warn(
                    &path,
                    format!(
                        "a hydraulic conductivity of {} m/s; coarse gravel has about 1 m/s",
                        number(k)
                    ),
                    "state it in m/s",
                );
            }
            _ => {}
        }
    }
}

/// Reports heads relative to a level other than the origin, and gravity with the wrong sign.
fn heads(scene: &Scene, seepage: &Seepage, findings: &mut Findings) {
    let (gravity, dimension) = (scene.gravity, scene.grid.dimension);
    let strength = norm(gravity);
    let mut heads = (seepage.patches.iter().enumerate())
        .filter_map(|(n, patch)| match patch.condition {
            Condition::Head { value } => Some((n, patch, value)),
            _ => None,
        })
        .peekable();
    if heads.peek().is_none() || strength <= 0.0 {
        return;
    }
    let up = dimension - 1;
    if gravity[up] > 0.5 * strength {
        let axis = ["x", "y", "z"][up];
        findings.warn(
            "gravity",
            format!(
                "gravity points along +{axis}: heads and pressures are computed as if {axis} pointed down into \
                 the ground"
            ),
            format!("write the component along {axis} with a minus sign if {axis} points up"),
        );
    }
    for (n, patch, head) in heads {
        // Highest point of the patch.
        let elevation: f64 = (0..dimension)
            .map(|a| {
                let ends = if a == patch.face.axis() {
                    let end = if patch.face.is_max() {
                        seepage.cells[a]
                    } else {
                        0
                    };
                    [end, end]
                } else {
                    [patch.from[a], patch.to[a]]
                };
                let at = ends.map(|k| seepage.axis(a).face(k));
                let heights = at.map(|x| -gravity[a] / strength * x);
                heights[0].max(heights[1])
            })
            .sum();
        let below = head < elevation - 1e-9 * (1.0 + elevation.abs());
        if below && seepage.written.unsaturated.is_some() {
            let path = format!("{PATH}.boundaries[{n}].condition");
            findings.warn(
                &path,
                format!(
                    "the head of {} m lies below the highest point of `{}`, which is at an elevation of {} m: \
                     water would pass there under suction, but no water leaves a face in air under suction",
                    number(head),
                    patch.name,
                    number(elevation)
                ),
                Remedy::from("use a seepage face with this level of water in front of its lower part")
                    .set(path.clone(), serde_json::json!({"seepage_face": {"level": head}})),
            );
        } else if below {
            findings.warn(
                &format!("{PATH}.boundaries[{n}].condition.head.value"),
                format!(
                    "the head of {} m lies {} m below the highest point of `{}`, which is at an elevation of {} \
                     m: the water there would be under suction, but saturated ground has no water table",
                    number(head),
                    number(elevation - head),
                    patch.name,
                    number(elevation)
                ),
                "heads are measured from the origin of the domain, not from the ground: add the elevation of the \
                 ground, or end the patch at the water level",
            );
        }
    }
}

fn nothing_drives(scene: &Scene, seepage: &Seepage, findings: &mut Findings) {
    let moves = seepage.conditions().any(|condition| match condition {
        Condition::Discharge { value } => value.abs() > 0.0,
        other => other.flux().is_some_and(|flux| flux.abs() > 0.0),
    });
    if !moves && !seepage.is_transient() && seepage.pressure_drop(scene.gravity) <= 0.0 {
        findings.warn(
            &format!("{PATH}.boundaries"),
            "nothing drives the water: all conditions impose the same head, and none imposes a flux",
            "impose two different heads or pressures, or a flux",
        );
    }
}

/// Cell face with an imposed pressure or head.
#[derive(Clone, Copy)]
struct Held {
    patch: usize,
    /// Reduced pressure \[Pa\].
    reduced: f64,
}

fn short_circuits(scene: &Scene, seepage: &Seepage, openness: &Openness, findings: &mut Findings) {
    let (grid, gravity, dimension) = (&openness.grid, scene.gravity, scene.grid.dimension);
    let density = seepage.written.density;
    let strength = norm(gravity);
    let drop = seepage.pressure_drop(gravity);
    if drop <= 0.0 {
        return;
    }
    let mut warned: Vec<[usize; 2]> = Vec::new();
    let mut warn = |one: Held, other: Held, at: [f64; 3]| {
        let pair = [one.patch.min(other.patch), one.patch.max(other.patch)];
        let same = one.patch == other.patch;
        if same
            || (one.reduced - other.reduced).abs() < HEAD_DIFFERENCE * drop
            || warned.contains(&pair)
        {
            return;
        }
        warned.push(pair);
        let [first, second] = pair.map(|n| &seepage.patches[n].name);
        let place: Vec<String> = at[..dimension].iter().map(|x| number(*x)).collect();
        findings.warn(
            &format!("{PATH}.boundaries[{}].patch", pair[1]),
            format!(
                "`{first}` and `{second}` impose different heads on adjacent cells at ({}) m, and no structure \
                 separates them: water flows from one to the other along the face, and the discharge depends on \
                 the cell size",
                place.join(", ")
            ),
            "let a structure reach the face where the patches meet, or leave a strip of the face between them without \
             a condition",
        );
    };
    // Conditions on each face of the cells; a later condition takes precedence.
    let mut held: [Vec<Option<Held>>; 6] = std::array::from_fn(|_| Vec::new());
    for (n, patch) in seepage.patches.iter().enumerate() {
        let axis = patch.face.axis();
        let upper = patch.face.is_max();
        let level = if upper { grid.cells[axis] - 1 } else { 0 };
        let of_face = &mut held[2 * axis + usize::from(upper)];
        of_face.resize(grid.count(), None);
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            let inside = |a: usize| a == axis || (patch.from[a]..patch.to[a]).contains(&cell[a]);
            if cell[axis] != level || !(0..3).all(inside) || openness.blocked(index) {
                continue;
            }
            let mut beyond = cell;
            beyond[axis] += usize::from(upper);
            if openness.faces[axis][openness.face(axis, beyond)] <= 0.0 {
                continue;
            }
            let mut at = grid.centre(cell);
            at[axis] += if upper { 0.5 } else { -0.5 } * grid.width(axis, cell);
            let weight = dot(gravity, at);
            of_face[index] = match patch.condition {
                Condition::Pressure { value } => Some(value - density * weight),
                Condition::Head { value } => Some(density * strength * value),
                _ => None,
            }
            .map(|reduced| Held { patch: n, reduced });
        }
    }
    for index in 0..grid.count() {
        let cell = grid.cell(index);
        let here = held
            .iter()
            .filter_map(|face| face.get(index).copied().flatten());
        let here: Vec<Held> = here.collect();
        let Some((first, others)) = here.split_first() else {
            continue;
        };
        for other in others {
            warn(*first, *other, grid.centre(cell));
        }
        for (side, face) in held.iter().enumerate().filter(|(_, face)| !face.is_empty()) {
            for a in 0..dimension {
                let mut next = cell;
                next[a] += 1;
                if next[a] >= grid.cells[a] || openness.faces[a][openness.face(a, next)] <= 0.0 {
                    continue;
                }
                if let (Some(one), Some(other)) = (face[index], face[grid.index(next)]) {
                    let mut at = grid.centre(cell);
                    at[a] += 0.5 * grid.width(a, cell);
                    let outward = if side % 2 == 1 { 0.5 } else { -0.5 };
                    at[side / 2] += outward * grid.width(side / 2, cell);
                    warn(one, other, at);
                }
            }
        }
    }
}

fn open_water(seepage: &Seepage, openness: &Openness, findings: &mut Findings) {
    let Some(zones) = &seepage.zones else {
        return;
    };
    let grid = &openness.grid;
    let filled = zones.filled(grid.count());
    let wet = || (0..grid.count()).filter(|&k| !openness.blocked(k));
    let open = || wet().filter(|&k| filled[k] < 1.0 - 1e-9);
    let Some(first) = open().next() else {
        return;
    };
    let place = grid.centre(grid.cell(first));
    let place: Vec<String> = place[..grid.dimension].iter().map(|x| number(*x)).collect();
    let counted = format!(
        "no zone fills {} of {} cells, the first of them at ({}) m",
        open().count(),
        wet().count(),
        place.join(", ")
    );
    let (path, remedy) = (
        format!("{PATH}.zones"),
        "extend the zones until they meet and reach the ends of the ground, or list first a zone without a \
         region, which applies everywhere else",
    );
    if seepage.written.unsaturated.is_some() {
        let reason =
            format!("{counted}: these cells are open water or air, which have no retention");
        findings.error(&path, reason, remedy);
    } else {
        findings.warn(
            &path,
            format!("{counted}: without grains these cells are open water, which hardly resists the flow"),
            remedy,
        );
    }
}
