//! Unsaturated ground: parameters of the soil, and features that do not work with it.

use super::polygons::polygon;
use super::terrain::path_of;
use super::{PATH, Seepage};
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use crate::scene::region::region;
use base::error::Remedy;
use base::history;
use base::vector::norm;
use case::Case;
use case::darcy::{TransientFlow, Zone, ZonePermeability};
use darcy::zones::is_inside;
use darcy::{Condition, Equations, Retention};

/// Maximum height of a cell in capillary lengths, above which the plan warns: the relative permeability then falls
/// by e^-20 from one cell to the next.
const COARSE: f64 = 20.0;

/// Maximum height of ground of Gardner's soil in capillary lengths, above which the plan warns: columns and slopes of
/// 36 lengths drained to rest, a slope of 40 did not.
const HIGHEST: f64 = 36.0;

/// Maximum number of zones with a retention.
const MAX_SOILS: usize = 255;
/// Thickness of the phreatic surface in ground without suction, in cell heights.
const SURFACE: f64 = 0.1;

/// Returns `true` for rain and evaporation.
fn is_weather(condition: Condition) -> bool {
    matches!(
        condition,
        Condition::Rain { .. } | Condition::Evaporation { .. }
    )
}

impl Seepage {
    /// Sets the thickness of the phreatic surface from the height of the cells if the case states none.
    pub(super) fn resolve_surface(&mut self, gravity: [f64; 3]) {
        let strength = norm(gravity);
        let rise = (0..3)
            .map(|a| (gravity[a] / strength).abs() * self.spacing[a])
            .fold(0.0, f64::max);
        let soil = self
            .written
            .unsaturated
            .iter_mut()
            .map(|soil| &mut soil.retention);
        let zones = self.written.zones.iter_mut();
        for retention in soil.chain(zones.filter_map(|zone| zone.retention.as_mut())) {
            if let Retention::SaturatedOnly(surface) = retention
                && surface.thickness.is_none()
                && rise > 0.0
            {
                surface.thickness = Some(SURFACE * rise);
            }
        }
    }

    /// Returns the index of the soil of each cell; empty if no zone states one.
    pub(super) fn soils(&self, case: &Case, grid: &Grid) -> Vec<u8> {
        let stated = self
            .written
            .zones
            .iter()
            .any(|zone| zone.retention.is_some());
        if self.written.unsaturated.is_none() || !stated {
            return Vec::new();
        }
        let soils = self.last_zones(case, grid, |zone| zone.retention.is_some());
        let soil = |last: Option<usize>| last.map_or(0, |n| u8::try_from(n + 1).unwrap_or(u8::MAX));
        soils.into_iter().map(soil).collect()
    }

    /// Returns the last of the chosen zones that contains the centre of each cell, by its number among them.
    fn last_zones(
        &self,
        case: &Case,
        grid: &Grid,
        is_chosen: impl Fn(&Zone) -> bool,
    ) -> Vec<Option<usize>> {
        let coarse = self.coarse_grid(grid.dimension);
        let mut regions = Vec::new();
        // Errors of a region were already reported.
        let mut silent = Findings::new(case);
        for zone in self.written.zones.iter().filter(|zone| is_chosen(zone)) {
            let whole = [[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]];
            let written = zone.region.as_ref();
            let corners = written.map_or(whole, |written| region(grid, written, PATH, &mut silent));
            regions.push((corners, polygon(case, zone, PATH, &mut silent)));
        }
        let last = |cell: usize| {
            let centre = coarse.centre(coarse.cell(cell));
            let holds = |([from, to], polygon): &([[f64; 3]; 2], Vec<[f64; 2]>)| {
                (0..3).all(|a| centre[a] >= from[a] && centre[a] < to[a])
                    && (polygon.is_empty() || is_inside(polygon, [centre[0], centre[1]]))
            };
            regions.iter().rposition(holds)
        };
        (0..self.cell_count()).map(last).collect()
    }

    /// Returns the porosity to which the values of each cell refer where the ground follows the grains, 0 for other
    /// cells; empty if no zone follows them. Reports findings for zones that cannot.
    pub(super) fn following(&self, case: &Case, grid: &Grid, findings: &mut Findings) -> Vec<f64> {
        let zones = &self.written.zones;
        if !zones.iter().any(|zone| zone.follows_grains) {
            return Vec::new();
        }
        for (n, zone) in zones.iter().enumerate() {
            if zone.follows_grains {
                self.check_following(case, zone, n, findings);
            }
        }
        let Some(soil) = &self.written.unsaturated else {
            return Vec::new();
        };
        // The zone whose permeability applies decides.
        let conducts = |zone: &Zone| zone.permeability.is_some() || zone.raster.is_some();
        let reference = |zone: &Zone| {
            let retention = zone.retention.as_ref().unwrap_or(&soil.retention);
            let porosity = zone.porosity;
            porosity.unwrap_or_else(|| retention.model().state(0.0).content)
        };
        let of_zones = zones.iter().filter(|zone| conducts(zone)).map(|zone| {
            let follows = zone.follows_grains;
            if follows { reference(zone) } else { 0.0 }
        });
        let of_zones: Vec<f64> = of_zones.collect();
        let found = self.last_zones(case, grid, conducts);
        let of_cell = |last: Option<usize>| last.map_or(0.0, |n| of_zones[n]);
        found.into_iter().map(of_cell).collect()
    }

    /// Refuses a zone that follows the grains without unsaturated ground, grains or a permeability.
    fn check_following(&self, case: &Case, zone: &Zone, n: usize, findings: &mut Findings) {
        let path = format!("{PATH}.zones[{n}].follows_grains");
        let remedy = || Remedy::take_out("remove it", &path);
        if self.written.unsaturated.is_none() {
            findings.error(
                &path,
                "in saturated ground the flow follows the grains wherever no zone states a permeability",
                remedy(),
            );
        } else if case.grains.is_none() {
            findings.error(
                &path,
                "this case has no grains that the ground could follow",
                remedy(),
            );
        }
        let stated = match zone.permeability {
            Some(ZonePermeability::Value(_) | ZonePermeability::HydraulicConductivity(_)) => true,
            Some(_) => false,
            None => zone.raster.is_some(),
        };
        if !stated {
            findings.error(
                &path,
                "the zone has no permeability as a number, from which that of moved grains could follow",
                "write `value` or `hydraulic_conductivity` for the porosity of the zone, or a raster of them",
            );
        }
    }

    /// Checks the retentions of zones, and refuses them in saturated ground.
    fn check_layers(&self, findings: &mut Findings) {
        let drains = self.written.unsaturated.as_ref();
        let stated = self.written.zones.iter().enumerate();
        let mut count = 0;
        for (n, zone) in stated {
            let Some(retention) = &zone.retention else {
                continue;
            };
            let path = format!("{PATH}.zones[{n}].retention");
            count += 1;
            if drains.is_none() || count > MAX_SOILS {
                let (reason, remedy) = if drains.is_none() {
                    (
                        "a retention needs unsaturated ground",
                        "add `unsaturated`, or remove the retention",
                    )
                } else {
                    (
                        "at most 255 zones can have a retention",
                        "remove the retention, or merge zones",
                    )
                };
                findings.error(&path, reason, remedy);
                return;
            }
            if let Some(fault) = retention.model().check() {
                let path = format!("{path}.{}", fault.path);
                findings.error(&path, fault.reason, fault.remedy);
            }
            let stores = retention.model().stores();
            if self.is_transient() && !stores {
                findings.error(
                    &format!("{path}.saturated_only"),
                    "transient flow stores water, but this retention defines no water content",
                    "use van_genuchten or gardner",
                );
            }
        }
    }

    /// Checks the time tables of conditions.
    fn check_histories(&self, findings: &mut Findings) {
        let boundaries = self.written.boundaries.iter().enumerate();
        let boundaries =
            boundaries.map(|(n, b)| (format!("boundaries[{n}]"), b.condition, &b.history));
        let drains = self.written.drains.iter().enumerate();
        let drains = drains.map(|(n, d)| (format!("drains[{n}]"), d.condition, &d.history));
        let surface = self.written.terrain.iter().flat_map(|t| &t.conditions);
        let surface = surface
            .enumerate()
            .map(|(n, c)| (path_of(n), c.condition, &c.history));
        for (place, condition, history) in boundaries.chain(drains).chain(surface) {
            let Some(table) = history else {
                continue;
            };
            let path = format!("{PATH}.{place}.history");
            let (reason, remedy) = if !self.is_transient() {
                (
                    "a condition can follow a table in transient flow only",
                    "add `unsaturated.transient`, or state one value in `condition`",
                )
            } else if condition == (Condition::NoFlow {}) {
                (
                    "an impermeable face has no value that could follow a table",
                    "use another condition",
                )
            } else if let Some([_, value]) = table
                .iter()
                .find(|[_, value]| *value < 0.0 && is_weather(condition))
            {
                let reason = format!("a rate of rain or evaporation is {} m/s", number(*value));
                findings.error(&path, reason, "write rates of at least 0 m/s");
                continue;
            } else {
                history::check(table, &path, findings);
                continue;
            };
            findings.error(&path, reason, remedy);
        }
    }

    /// Warns of rain and evaporation on faces that do not face upwards.
    fn check_weather(&self, case: &Case, findings: &mut Findings) {
        let gravity = case.gravity.as_ref().map(|g| g.to_array());
        for (n, patch) in self.patches.iter().enumerate() {
            let pull = gravity.map_or(0.0, |gravity| gravity[patch.face.axis()]);
            let upwards = if patch.face.is_max() {
                pull < 0.0
            } else {
                pull > 0.0
            };
            if is_weather(patch.condition) && !upwards {
                findings.warn(
                    &format!("{PATH}.boundaries[{n}].condition"),
                    "the face does not face upwards, and rain and evaporation are volumes per horizontal area, so \
                     that none passes through it",
                    "state a `flux`, or choose the face at the top of the ground",
                );
            }
        }
    }

    /// Checks the soil of unsaturated ground, and refuses features that need it in saturated ground.
    pub(super) fn check_unsaturated(&self, case: &Case, grid: &Grid, findings: &mut Findings) {
        self.check_layers(findings);
        self.check_histories(findings);
        self.check_weather(case, findings);
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
        self.check_grains(case, law.stores(), findings);
        if let Some(transient) = &soil.transient {
            self.check_transient(transient, law.stores(), findings);
        }
        if self.written.equations != Equations::Corrected {
            findings.error(
                &format!("{PATH}.equations"),
                "unsaturated ground needs the corrected equations, because those of the paper neglect gravity in \
                 the water",
                Remedy::from("use \"corrected\"").set(format!("{PATH}.equations"), "corrected"),
            );
        }
        let gravity = case.gravity.as_ref().map(|g| g.to_array());
        let Some(gravity) = gravity.filter(|g| g.iter().any(|g| g.abs() > 0.0)) else {
            findings.error(
                "gravity",
                "unsaturated ground needs gravity, but this case has none",
                "add `gravity`, such as [0, -9.81]",
            );
            return;
        };
        let strength = norm(gravity);
        let rise = (0..grid.dimension)
            .map(|a| (gravity[a] / strength).abs() * self.widest(a))
            .fold(0.0, f64::max);
        self.check_height(gravity, grid.dimension, findings);
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

    /// Warns of ground in which an exponential soil drains until its content and its permeability are rounding.
    fn check_height(&self, gravity: [f64; 3], dimension: usize, findings: &mut Findings) {
        let Some(soil) = &self.written.unsaturated else {
            return;
        };
        let Retention::Gardner(gardner) = soil.retention else {
            return;
        };
        let strength = norm(gravity);
        let height: f64 = (0..dimension)
            .map(|a| (gravity[a] / strength).abs() * self.axis(a).length(0, self.cells[a]))
            .sum();
        let lengths = height * gardner.alpha;
        if soil.transient.is_some() && lengths > HIGHEST * (1.0 + 1e-9) {
            findings.warn(
                &format!("{PATH}.unsaturated.retention.gardner.alpha"),
                format!(
                    "the ground is {} m high, {} capillary lengths of an exponential soil: where it drains to rest, \
                     its content and its permeability are rounding, and the flow may not converge",
                    number(height),
                    number(lengths)
                ),
                format!(
                    "use an alpha of at most {} 1/m, or van_genuchten, whose content falls more slowly",
                    number(HIGHEST / height)
                ),
            );
        }
    }

    /// Refuses bodies in unsaturated ground, and fields that have no effect on its grains.
    fn check_grains(&self, case: &Case, stores: bool, findings: &mut Findings) {
        let path = format!("{PATH}.unsaturated");
        if !case.bodies.is_empty() || case.blocks.is_some() {
            findings.error(
                &path,
                "unsaturated ground supports spheres and discs as grains, but no bodies and no blocks",
                Remedy::take_out("remove `unsaturated`, or the bodies and blocks", &path),
            );
        }
        if case.grains.is_none() {
            return;
        }
        if !stores {
            findings.error(
                &format!("{path}.retention.saturated_only"),
                "the load on grains in unsaturated ground depends on its content of water, \
                 and this retention has none",
                "use van_genuchten or gardner",
            );
        }
        let stated = [
            ("drag", self.written.drag.is_some()),
            ("resistance", self.written.resistance.is_some()),
            (
                "transient_porosity",
                self.written.transient_porosity == Some(true),
            ),
            ("semi_implicit_drag", !self.written.semi_implicit_drag),
        ];
        for (name, _) in stated.iter().filter(|(_, stated)| *stated) {
            let path = format!("{PATH}.{name}");
            findings.error(
                &path,
                "the load on grains in unsaturated ground follows from suction and water content: \
                 this field has no effect on it",
                Remedy::take_out("remove it", &path),
            );
        }
    }

    /// Checks the settings of a transient flow.
    fn check_transient(&self, transient: &TransientFlow, stores: bool, findings: &mut Findings) {
        let path = format!("{PATH}.unsaturated");
        if !stores {
            findings.error(
                &format!("{path}.retention.saturated_only"),
                "transient flow stores water above the water table, but this retention defines no water content",
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
                        "the value is {}; it must be a number of at least 0",
                        number(value)
                    ),
                    "omit it for its default",
                );
            }
        }
    }

    /// Refuses seepage faces and evaporation in saturated ground.
    fn refuse_seepage_faces(&self, findings: &mut Findings) {
        let boundaries = self.patches.iter().enumerate();
        let boundaries = boundaries.map(|(n, patch)| (format!("boundaries[{n}]"), patch.condition));
        let drains = self.drains.iter();
        let drains = drains.map(|drain| (drain.path.clone(), drain.condition));
        for (place, condition) in boundaries.chain(drains) {
            let path = format!("{PATH}.{place}.condition");
            match condition {
                Condition::SeepageFace { .. } => findings.error(
                    &path,
                    "a seepage face needs unsaturated ground, because in saturated ground the pressure on a face \
                     in air is not known",
                    "add `unsaturated` with a retention, or impose a pressure or a head",
                ),
                Condition::Evaporation { .. } => findings.error(
                    &path,
                    "evaporation needs unsaturated ground, because saturated ground has no suction that limits \
                     it",
                    "add `unsaturated` with a retention, or impose a flux",
                ),
                _ => {}
            }
        }
    }
}
