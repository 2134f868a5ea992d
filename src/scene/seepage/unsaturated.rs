//! Ground that drains: parameters of the soil, and what does not go with it.

use super::{PATH, Seepage};
use crate::case::Case;
use crate::case::darcy::{TransientFlow, ZonePermeability};
use crate::darcy::{Condition, Equations, Retention};
use crate::error::Remedy;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;

/// Height of a cell over the capillary length above which the plan warns: the relative permeability falls by e^-20
/// from one cell to the next.
const COARSE: f64 = 20.0;

/// Thickness of the surface of ground without suction over the height of a cell.
const SURFACE: f64 = 0.1;

impl Seepage {
    /// Sets the thickness of the phreatic surface by the cells where the case states none.
    pub(super) fn resolve_surface(&mut self, gravity: [f64; 3]) {
        let strength = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let rise = (0..3)
            .map(|a| (gravity[a] / strength).abs() * self.spacing[a])
            .fold(0.0, f64::max);
        if let Some(soil) = &mut self.written.unsaturated
            && let Retention::SaturatedOnly(surface) = &mut soil.retention
            && surface.thickness.is_none()
            && rise > 0.0
        {
            surface.thickness = Some(SURFACE * rise);
        }
    }

    /// Checks the soil that drains, and that nothing needs one where there is none.
    pub(super) fn check_unsaturated(&self, case: &Case, grid: &Grid, findings: &mut Findings) {
        let path = format!("{PATH}.unsaturated");
        let Some(soil) = &self.written.unsaturated else {
            self.refuse_seepage_faces(findings);
            return;
        };
        let law = soil.retention.model();
        if let Some(fault) = law.check() {
            findings.error(
                &format!("{path}.retention.{}", fault.path),
                fault.reason,
                fault.remedy,
            );
            return;
        }
        if case.grains.is_some() || !case.bodies.is_empty() {
            findings.error(
                &path,
                "unsaturated ground does not support grains and bodies: \
                 drag and buoyancy are those of saturated ground",
                Remedy::take_out(
                    "remove `unsaturated` for saturated ground with grains, or the grains",
                    &path,
                ),
            );
        }
        if let Some(transient) = &soil.transient {
            self.check_transient(transient, law.stores(), findings);
        }
        if self.written.equations != Equations::Corrected {
            findings.error(
                &format!("{PATH}.equations"),
                "unsaturated ground needs the corrected equations: those of the paper have no gravity in the water",
                Remedy::from("use \"corrected\"").set(format!("{PATH}.equations"), "corrected"),
            );
        }
        let gravity = case.gravity.as_ref().map(|g| g.to_array());
        let Some(gravity) = gravity.filter(|g| g.iter().any(|g| g.abs() > 0.0)) else {
            findings.error(
                "gravity",
                "unsaturated ground needs gravity, and there is none in this case",
                "add `gravity`, such as [0, -9.81]",
            );
            return;
        };
        let strength = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
        let rise = (0..grid.dimension)
            .map(|a| (gravity[a] / strength).abs() * self.spacing[a])
            .fold(0.0, f64::max);
        let length = law.capillary_length();
        if rise > COARSE * length * (1.0 + 1e-9) {
            findings.warn(
                &path,
                format!(
                    "cells are {} m high, {} capillary lengths of the soil ({} m): the solution may not converge",
                    number(rise),
                    number(rise / length),
                    number(length)
                ),
                format!(
                    "use cells of at most {} m, or a longer capillary length",
                    number(COARSE * length)
                ),
            );
        }
    }

    /// Checks a flow that changes with time.
    fn check_transient(&self, transient: &TransientFlow, stores: bool, findings: &mut Findings) {
        let path = format!("{PATH}.unsaturated");
        if !stores {
            findings.error(
                &format!("{path}.retention.saturated_only"),
                "flow that changes with time stores water above the water table, \
                 and this retention has no content of water",
                "use van_genuchten or gardner, or remove `transient` for steady flow",
            );
        }
        for (name, value) in [
            ("specific_storage", transient.specific_storage),
            ("content_error", transient.content_error),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                findings.error(
                    &format!("{path}.transient.{name}"),
                    format!(
                        "this is {}; it must be a number of at least 0",
                        number(value)
                    ),
                    "omit it for its default",
                );
            }
        }
        for (n, zone) in self.written.zones.iter().enumerate() {
            if matches!(zone.permeability, Some(ZonePermeability::Resistance(_))) {
                findings.error(
                    &format!("{PATH}.zones[{n}].permeability.resistance"),
                    "a flow that changes with time needs permeabilities that do not depend on the flow",
                    "state a `value` or a `hydraulic_conductivity`",
                );
            }
        }
    }

    /// Refuses seepage faces of saturated ground.
    fn refuse_seepage_faces(&self, findings: &mut Findings) {
        for (n, patch) in self.patches.iter().enumerate() {
            if matches!(patch.condition, Condition::SeepageFace { .. }) {
                findings.error(
                    &format!("{PATH}.boundaries[{n}].condition"),
                    "a seepage face needs ground that drains: \
                     in saturated ground the pressure on a face in air is not known",
                    "add `unsaturated` with a retention, or impose a pressure or a head",
                );
            }
        }
    }
}
