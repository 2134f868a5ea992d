//! Zones of the seepage: regions with their own permeability or porosity, on the coarse grid.

use super::polygons::polygon;
use super::{PATH, Seepage};
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use crate::scene::region::region;
use crate::scene::unique;
use base::error::Remedy;
use base::vector::norm;
use case::Case;
use case::darcy::{Zone, ZonePermeability};
use darcy::Zones;
use darcy::zones::{Raster, Rule, SoilZone as Resolved};
use io::sheet::{Column, Refusal, Sheet, Unit};
use std::sync::Arc;

/// Columns of a raster that give a permeability.
const PERMEABILITIES: [&str; 3] = ["permeability", "hydraulic_conductivity", "factor"];

/// Ground of all zones of a case.
#[derive(Clone, Copy)]
struct Ground {
    /// Factor from hydraulic conductivity to permeability, mu/(rho g); infinite without gravity.
    permeable: f64,
    /// `true` if the zones are the ground: without grains and bodies, and in unsaturated ground.
    alone: bool,
}

impl Seepage {
    /// Returns the zones on the coarse grid; none if the case has none.
    pub(super) fn zones_of(
        &self,
        case: &Case,
        grid: &Grid,
        findings: &mut Findings,
    ) -> Option<Arc<Zones>> {
        let written = &self.written;
        if written.zones.is_empty() {
            return None;
        }
        let strength = case
            .gravity
            .as_ref()
            .map_or(0.0, |gravity| norm(gravity.to_array()));
        let ground = Ground {
            permeable: written.viscosity / (written.density * strength),
            alone: case.grains.is_none() && case.bodies.is_empty() || written.unsaturated.is_some(),
        };
        let mut known = Vec::new();
        let mut zones = Vec::new();
        for (n, zone) in written.zones.iter().enumerate() {
            let path = format!("{PATH}.zones[{n}]");
            unique(&mut known, &zone.name, &format!("{path}.name"), findings);
            zones.push(self.zone(case, grid, zone, (&path, ground), findings));
        }
        let all = Zones::new(&self.coarse_grid(grid.dimension), &zones);
        for (n, reached) in all.reached().iter().enumerate() {
            if *reached == 0 {
                findings.error(
                    &format!("{PATH}.zones[{n}].region"),
                    format!(
                        "no cell of the coarse grid, which reaches from {:?} to {:?} m, lies in this zone",
                        &self.origin[..grid.dimension],
                        &self.end()[..grid.dimension]
                    ),
                    "move the zone into the grid, or remove it",
                );
            }
        }
        Some(Arc::new(all))
    }

    /// Returns a zone with its region, permeability and porosity; reports what is wrong with it.
    fn zone(
        &self,
        case: &Case,
        grid: &Grid,
        zone: &Zone,
        (path, ground): (&str, Ground),
        findings: &mut Findings,
    ) -> Resolved {
        let [from, to] = zone
            .region
            .as_ref()
            .map_or([[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]], |written| {
                region(grid, written, &format!("{path}.region"), findings)
            });
        self.check_content(zone, path, findings);
        let mut directions = bedding(case, zone, path, findings);
        let mut shear = 0.0;
        if let Some(dip) = zone.dip {
            self.check_dip(case, zone, path, findings);
            (directions, shear) = dipping(zone.anisotropy.unwrap_or(1.0), dip);
        }
        let raster = raster(case, zone, grid, (path, ground.permeable), findings);
        self.refuse_laws_of_grains(zone, raster.as_ref(), (path, ground.alone), findings);
        let conducts = matches!(
            zone.permeability,
            Some(ZonePermeability::HydraulicConductivity(_))
        );
        if conducts && !ground.permeable.is_finite() {
            weightless(
                &format!("{path}.permeability.hydraulic_conductivity"),
                findings,
            );
        }
        Resolved {
            from,
            to,
            polygon: polygon(case, zone, path, findings),
            permeability: zone.permeability.map(|written| match written {
                ZonePermeability::Value(value) => Rule::Value(value),
                ZonePermeability::HydraulicConductivity(k) => Rule::Value(k * ground.permeable),
                ZonePermeability::Factor(factor) => Rule::Factor(factor),
                ZonePermeability::Resistance(law) => Rule::Law(law),
            }),
            porosity: zone.porosity,
            raster,
            directions,
            shear,
            without_grains: zone.without_grains || ground.alone,
        }
    }

    /// Reports a zone without effect, and a law of resistance that the equations do not allow.
    fn check_content(&self, zone: &Zone, path: &str, findings: &mut Findings) {
        if zone.permeability.is_none()
            && zone.porosity.is_none()
            && zone.raster.is_none()
            && zone.retention.is_none()
        {
            findings.error(
                path,
                "the zone defines neither a permeability nor a porosity, so that it has no effect",
                Remedy::from("add one, for example a porosity of 0.4, or remove the zone")
                    .set(format!("{path}.porosity"), 0.4),
            );
        }
        if let Some(ZonePermeability::Resistance(law)) = zone.permeability
            && !law.model().supports_equations(self.written.equations)
        {
            let path = format!("{path}.permeability.resistance");
            findings.error(
                &path,
                "the equations \"as_printed\" allow only the resistance of Kozeny and Carman",
                Remedy::from("use \"kozeny_carman\"").set(path.clone(), "kozeny_carman"),
            );
        }
    }

    /// Refuses a permeability that follows from that of grains where none does: without grains, and in unsaturated
    /// ground, whose permeability the zones state.
    fn refuse_laws_of_grains(
        &self,
        zone: &Zone,
        raster: Option<&Raster>,
        (path, alone): (&str, bool),
        findings: &mut Findings,
    ) {
        let multiplies = |raster: &Raster| {
            let first = raster.permeability.first();
            matches!(first, Some(Rule::Factor(_)))
        };
        let (place, what) = match zone.permeability {
            Some(ZonePermeability::Factor(_)) => ("permeability.factor", "a factor multiplies"),
            Some(ZonePermeability::Resistance(_)) => {
                ("permeability.resistance", "a law of resistance needs")
            }
            _ if raster.is_some_and(multiplies) => {
                ("raster.path", "the column `factor` multiplies")
            }
            _ => return,
        };
        if !alone {
            return;
        }
        let why = if self.written.unsaturated.is_some() {
            "unsaturated ground has the permeability that its zones state as a number"
        } else {
            "the case has no grains"
        };
        findings.error(
            &format!("{path}.{place}"),
            format!("{what} a permeability that follows from grains, and {why}"),
            "write a `value` or a `hydraulic_conductivity`, or a raster of them",
        );
    }

    /// Checks the requirements of dipping beds.
    fn check_dip(&self, case: &Case, zone: &Zone, path: &str, findings: &mut Findings) {
        let path = format!("{path}.dip");
        let gravity = (case.gravity.as_ref()).map_or([0.0; 3], |gravity| gravity.to_array());
        let upright = gravity[1] < 0.0 && gravity[0].abs() <= 1e-9 * gravity[1].abs();
        let stated = match zone.permeability {
            Some(ZonePermeability::Value(_) | ZonePermeability::HydraulicConductivity(_)) => true,
            Some(_) => false,
            None => zone.raster.is_some(),
        };
        let (reason, remedy) = if case.domain.size.0.len() != 2 {
            (
                "dipping beds require a 2-D domain, and this one is 3-D",
                "use a 2-D section along the dip, or remove the dip",
            )
        } else if !upright {
            (
                "the dip is measured from the horizontal axis x, but gravity does not point along -y",
                "write gravity as [0, -9.81]",
            )
        } else if zone.anisotropy.is_none() {
            (
                "the dip has no effect, because the permeability is the same in all directions",
                "add `anisotropy`, or remove the dip",
            )
        } else if self.written.unsaturated.is_some() {
            (
                "dipping beds require saturated ground",
                "remove `unsaturated`, or the dip",
            )
        } else if case.grains.is_some() || !case.bodies.is_empty() {
            (
                "dipping beds require ground without grains, because the drag on grains is computed along the axes",
                "remove the grains, or the dip",
            )
        } else if !stated {
            (
                "the dip needs a permeability given as a number",
                "state a `value` or a `hydraulic_conductivity`",
            )
        } else {
            return;
        };
        findings.error(&path, reason, remedy);
    }

    /// Returns the name, property and extent of every zone, as printed in a plan.
    #[must_use]
    pub fn describe_zones(&self, alone: bool) -> Vec<[String; 3]> {
        let reached = self.zones.iter().flat_map(|zones| zones.reached());
        let described = self.written.zones.iter().zip(reached);
        described
            .map(|(zone, cells)| {
                let mut states = Vec::new();
                match zone.permeability {
                    Some(ZonePermeability::Value(k)) => {
                        states.push(format!("permeability {} m2", number(k)));
                    }
                    Some(ZonePermeability::HydraulicConductivity(k)) => {
                        states.push(format!("hydraulic conductivity {} m/s", number(k)));
                    }
                    Some(ZonePermeability::Factor(factor)) => {
                        states.push(format!("permeability times {}", number(factor)));
                    }
                    Some(ZonePermeability::Resistance(law)) => {
                        states.push(law.model().description());
                    }
                    None => {}
                }
                let bedding = |ratio: f64| {
                    format!(
                        "permeability along the bedding {} times that across it",
                        number(ratio)
                    )
                };
                states.extend(zone.anisotropy.map(bedding));
                states.extend(
                    zone.dip
                        .map(|dip| format!("beds at {} degrees", number(dip))),
                );
                states.extend(zone.retention.as_ref().map(|r| r.model().description()));
                states.extend(zone.porosity.map(|n| format!("porosity {}", number(n))));
                let from = |raster: &case::darcy::RasterFile| {
                    format!("raster of {}", raster.path.display())
                };
                states.extend(zone.raster.as_ref().map(from));
                let holds = if zone.without_grains || alone {
                    "also without grains"
                } else {
                    "only where there are grains"
                };
                [
                    format!("zone {}", zone.name),
                    states.join(", "),
                    format!("requested; covers {cells} cells, {holds}"),
                ]
            })
            .collect()
    }
}

/// Returns the permeability of a zone along each axis divided by the stated one; reports a finding if gravity
/// defines no bedding.
fn bedding(case: &Case, zone: &Zone, path: &str, findings: &mut Findings) -> [f64; 3] {
    let Some(ratio) = zone.anisotropy else {
        return [1.0; 3];
    };
    let path = format!("{path}.anisotropy");
    if zone.permeability.is_none() && zone.raster.is_none() {
        findings.error(
            &path,
            "the zone defines no permeability along its bedding",
            "add `permeability`",
        );
    }
    let gravity = (case.gravity.as_ref()).map_or([0.0; 3], |gravity| gravity.to_array());
    let steepest = gravity.iter().map(|g| g.abs()).fold(0.0, f64::max);
    let pulls = |a: &usize| gravity[*a].abs() > 1e-9 * steepest;
    let vertical: Vec<usize> = (0..3).filter(pulls).collect();
    let mut directions = [1.0; 3];
    match vertical[..] {
        [axis] => directions[axis] = 1.0 / ratio,
        _ => findings.error(
            &path,
            "the bedding is normal to gravity, but in this case gravity does not point along an axis",
            "point gravity along an axis, or remove the anisotropy",
        ),
    }
    directions
}

/// Returns permeabilities along x and y and the cross term, divided by the permeability along the bedding, of beds
/// at an angle \[deg\].
fn dipping(ratio: f64, dip: f64) -> ([f64; 3], f64) {
    let (s, c) = dip.to_radians().sin_cos();
    let across = 1.0 / ratio;
    (
        [c * c + across * s * s, s * s + across * c * c, 1.0],
        (1.0 - across) * s * c,
    )
}

fn weightless(path: &str, findings: &mut Findings) {
    findings.error(
        path,
        "a hydraulic conductivity needs gravity, but this case has none",
        "add `gravity`, or state a permeability in m2",
    );
}

/// Returns the raster of a zone; reports a finding if it cannot be read.
fn raster(
    case: &Case,
    zone: &Zone,
    grid: &Grid,
    (path, permeable): (&str, f64),
    findings: &mut Findings,
) -> Option<Raster> {
    let written = zone.raster.as_ref()?;
    let place = format!("{path}.raster.path");
    let read = io::plain::text(
        &case.directory.join(&written.path),
        io::plain::LONGEST_INPUT,
    )
    .map_err(|e| e.to_string())
    .and_then(|text| {
        read(&text, grid.dimension, permeable)
            .map_err(|e| format!("{}: {e}", written.path.display()))
    });
    let (raster, column) = match read {
        Ok(read) => read,
        Err(reason) => {
            let remedy = "correct the path (relative to the case) or the file";
            findings.error(&place, reason, remedy);
            return None;
        }
    };
    if column == Some("hydraulic_conductivity") && !permeable.is_finite() {
        weightless(&place, findings);
    }
    for (field, stated, twice) in [
        (
            "permeability",
            zone.permeability.is_some(),
            column.is_some(),
        ),
        (
            "porosity",
            zone.porosity.is_some(),
            !raster.porosity.is_empty(),
        ),
    ] {
        if stated && twice {
            let path = format!("{path}.{field}");
            findings.error(
                &path,
                format!("both the zone and its raster define the {field}"),
                Remedy::take_out("remove one of them", &path),
            );
        }
    }
    Some(raster)
}

/// Returns the columns that a raster may have: coordinates, permeabilities, porosity.
fn columns(axes: &[&'static str]) -> Vec<Column> {
    let column = |name, unit, needed| Column {
        name,
        aliases: &[],
        unit,
        required: needed,
    };
    let coordinates = axes.iter().map(|name| column(*name, Unit::Length, true));
    let permeabilities = PERMEABILITIES.iter().map(|name| {
        let unit = match *name {
            "permeability" => Unit::Area,
            "hydraulic_conductivity" => Unit::Velocity,
            _ => Unit::Ratio,
        };
        column(*name, unit, false)
    });
    coordinates
        .chain(permeabilities)
        .chain([column("porosity", Unit::Ratio, false)])
        .collect()
}

/// Node of a raster and the line on which it stands.
struct Node {
    at: [f64; 3],
    rule: Option<Rule>,
    porosity: Option<f64>,
    line: u64,
}

/// Reads a raster; returns it with the name of its permeability column. `permeable` is the ratio of permeability to
/// hydraulic conductivity [m s].
///
/// # Errors
/// If the text is not a valid raster; the error names the line or the column.
fn read(
    text: &str,
    dimension: usize,
    permeable: f64,
) -> Result<(Raster, Option<&'static str>), String> {
    let axes = &["x", "y", "z"][..dimension.min(3)];
    let columns = columns(axes);
    let sheet = Sheet::new(text, &columns).map_err(|refusal| match refusal {
        Refusal::Sentence(sentence) => sentence,
        Refusal::Unknown(name) => format!(
            "the header has an unknown column `{name}`. A raster can have: {}, {}, porosity",
            axes.join(", "),
            PERMEABILITIES.join(", ")
        ),
    })?;
    let permeability = permeability_column(&sheet, axes.len())?;
    let porosity = Some(columns.len() - 1).filter(|column| sheet.has(*column));
    if permeability.is_none() && porosity.is_none() {
        return Err(format!(
            "the header has neither a permeability ({}) nor `porosity`",
            PERMEABILITIES.join(", ")
        ));
    }
    let mut nodes = Vec::new();
    sheet.each(|row| {
        let line = row.line();
        let mut at = [0.0; 3];
        for (column, x) in at.iter_mut().take(axes.len()).enumerate() {
            // Adding 0 turns minus zero into zero.
            *x = row.number(column)? + 0.0;
        }
        let mut rule = None;
        if let Some((name, column)) = permeability {
            let value = row.number(column)?;
            if value <= 0.0 {
                return Err(format!(
                    "line {line}: `{name}` is {value}; it must be above 0"
                ));
            }
            rule = Some(match name {
                "factor" => Rule::Factor(value),
                "permeability" => Rule::Value(value),
                _ => Rule::Value(value * permeable),
            });
        }
        let porosity = porosity.map(|column| row.number(column)).transpose()?;
        if let Some(pores) = porosity.filter(|n| !(*n > 0.0 && *n < 1.0)) {
            return Err(format!(
                "line {line}: `porosity` is {pores}; it must be between 0 and 1"
            ));
        }
        nodes.push(Node {
            at,
            rule,
            porosity,
            line,
        });
        Ok(())
    })?;
    Ok((raster_of(nodes, axes)?, permeability.map(|(name, _)| name)))
}

/// Returns name and number of the column that states the permeability, if one does, after so many coordinates.
///
/// # Errors
/// If two columns state it.
fn permeability_column(
    sheet: &Sheet<'_>,
    coordinates: usize,
) -> Result<Option<(&'static str, usize)>, String> {
    let columns = PERMEABILITIES.iter().copied().zip(coordinates..);
    let stated: Vec<(&str, usize)> = columns.filter(|(_, n)| sheet.has(*n)).collect();
    match stated[..] {
        [(one, _), (other, _), ..] => Err(format!(
            "the columns `{one}` and `{other}` both define the permeability: remove one of them"
        )),
        _ => Ok(stated.first().copied()),
    }
}

/// Returns the raster of nodes that come in any order.
///
/// # Errors
/// If two nodes are the same, or one is missing.
fn raster_of(mut nodes: Vec<Node>, axes: &[&str]) -> Result<Raster, String> {
    if nodes.is_empty() {
        return Err("the raster contains no node".into());
    }
    nodes.sort_by(|p, q| {
        let along = |a: usize| p.at[a].total_cmp(&q.at[a]);
        along(2).then(along(1)).then(along(0))
    });
    let same = |p: &Node, q: &Node| (0..3).all(|a| p.at[a].total_cmp(&q.at[a]).is_eq());
    if let Some(pair) = nodes.windows(2).find(|pair| same(&pair[0], &pair[1])) {
        return Err(format!(
            "lines {} and {} are the same node",
            pair[0].line.min(pair[1].line),
            pair[0].line.max(pair[1].line)
        ));
    }
    let along: [Vec<f64>; 3] = std::array::from_fn(|a| {
        let mut all: Vec<f64> = nodes.iter().map(|node| node.at[a]).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        all
    });
    let counts: Vec<usize> = along[..axes.len()].iter().map(Vec::len).collect();
    // If the nodes differ and fill every combination of coordinates, they are complete.
    if counts.iter().try_fold(1_usize, |n, m| n.checked_mul(*m)) != Some(nodes.len()) {
        return Err(format!(
            "{} nodes do not form a raster: their coordinates have {} different values along {}, and every \
             combination of these must occur exactly once",
            nodes.len(),
            counts
                .iter()
                .map(usize::to_string)
                .collect::<Vec<_>>()
                .join(" x "),
            axes.join(", ")
        ));
    }
    Ok(Raster {
        nodes: along,
        permeability: nodes.iter().filter_map(|node| node.rule).collect(),
        porosity: nodes.iter().filter_map(|node| node.porosity).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_come_in_any_order() {
        let text = "y,x,factor,porosity\n1,0,3,0.3\n0,0,1,0.1\n0,2,2,0.2\n1,2,4,0.4\n";
        let (raster, column) = read(text, 2, f64::NAN).unwrap();
        assert_eq!(column, Some("factor"));
        assert_eq!(raster.nodes, [vec![0.0, 2.0], vec![0.0, 1.0], vec![0.0]]);
        assert_eq!(raster.permeability, [1.0, 2.0, 3.0, 4.0].map(Rule::Factor));
        assert_eq!(raster.porosity, [0.1, 0.2, 0.3, 0.4]);
        let (raster, _) = read("x,y,z,hydraulic_conductivity\n0,0,0,2\n", 3, 1e-7).unwrap();
        assert_eq!(raster.permeability, [Rule::Value(2e-7)]);
    }

    #[test]
    fn a_bad_raster_names_the_line_or_the_column() {
        let error = |text: &str| read(text, 2, 1.0).unwrap_err();
        assert!(error("").contains("empty"));
        assert!(error("x,y\n1,2\n").contains("neither"));
        assert!(error("x,porosity\n1,0.2\n").contains("`y`"));
        assert!(error("x,y,z,factor\n1,2,3,1\n").contains("`z`"));
        assert!(error("x,y,factor,permeability\n1,2,3,1\n").contains("both"));
        assert!(error("x,y,factor\n").contains("no node"));
        assert!(error("x,y,factor\n1,2,0\n").contains("line 2"));
        assert!(error("x,y,porosity\n1,2,0.5\n1,3,1\n").contains("line 3"));
        assert!(error("x,y,factor\n1,2,1\n1,2,2\n").contains("lines 2 and 3"));
        let holes = error("x,y,factor\n1,2,1\n2,2,1\n2,3,1\n");
        assert!(holes.contains("2 x 2"), "{holes}");
    }
}
