//! Grains of a scene: their source, sizes and number.

use super::aligned_box::AlignedBox;
use super::findings::{Findings, number};
use super::grid::Grid;
use super::motion::{motion, needs_density};
use super::pairs;
use super::region::region;
use super::sample::{self, ListedGrain};
use super::structures::images;
use super::{grading, material, unique};
use base::error::Remedy;
use base::number::real;
use case::Case;
use case::geometry::Extent;
use case::grains::{
    Amount, Deposition as WrittenDeposition, Grading, Grain as WrittenGrain,
    GrainSource as Written, GrainZone, Growth, Radii, SampleFile, SizeClass,
};
use case::sieve::{self, Percentiles};
use serde::Serialize;
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use structure::Images;

/// Grains and their preparation.
#[derive(Clone, Debug, Serialize)]
pub struct Grains {
    /// Index of the default material of grains.
    pub material: usize,
    /// Source of the grains.
    pub source: GrainSource,
    /// File to which the prepared sample is saved; relative to the output folder.
    pub save: Option<PathBuf>,
    /// Regions whose grains have a material of their own.
    pub zones: Vec<MaterialZone>,
    /// Boxes emptied after the preparation, with their names.
    pub cut: Vec<(String, AlignedBox)>,
    /// `true` if contacts are bonded after preparation and cutting.
    pub bond_at_start: bool,
    /// Smallest and largest radius \[m\].
    pub radii: Option<(f64, f64)>,
    /// Number of grains before cutting.
    pub expected: usize,
    /// Number of pairs of grains of a list or a file that touch at the start, at most those of equal spheres; 0 for
    /// prepared grains.
    pub contacts: usize,
}

impl Grains {
    /// Returns the number of grains after cutting: exact for listed grains, estimated from the volumes of the boxes
    /// for growth. The number of deposited grains that a cut removes is not known before the deposition.
    #[must_use]
    pub fn remaining(&self) -> f64 {
        match &self.source {
            GrainSource::List(grains) | GrainSource::File { grains, .. } => {
                let stays = |grain: &&ListedGrain| {
                    let mut cuts = self.cut.iter();
                    !cuts.any(|(_, block)| block.contains(grain.position))
                };
                real(grains.iter().filter(stays).count())
            }
            GrainSource::Growth { block, number, .. } => {
                let volume = |from: [f64; 3], to: [f64; 3]| {
                    let axes = 0..block.dimension;
                    axes.map(|a| (to[a] - from[a]).max(0.0)).product::<f64>()
                };
                let shared = |cut: &AlignedBox| {
                    let from = std::array::from_fn(|a| cut.from[a].max(block.from[a]));
                    let to = std::array::from_fn(|a| cut.to[a].min(block.to[a]));
                    volume(from, to)
                };
                let removed: f64 = self.cut.iter().map(|(_, cut)| shared(cut)).sum();
                let part = 1.0 - removed / volume(block.from, block.to);
                (real(*number) * part).round().max(0.0)
            }
            GrainSource::Deposition { .. } => real(self.expected),
        }
    }
}

/// Cloud of grains that fall from a box.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cloud {
    /// Name of the layer; none for the first cloud.
    pub name: Option<String>,
    /// Box in which the grains start.
    pub block: AlignedBox,
    /// Grading of the grains.
    pub grading: grading::Grading,
    /// Number of grains.
    pub number: usize,
    /// Index of the material of the grains.
    pub material: usize,
}

/// Source of grains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum GrainSource {
    /// Growth of a loose cloud in a box.
    Growth {
        /// Box in which the grains grow.
        block: AlignedBox,
        /// Number of grains.
        number: usize,
        /// Other fields as written.
        growth: Growth,
    },
    /// Clouds that fall from boxes.
    Deposition {
        /// Clouds, lowest layer first.
        clouds: Vec<Cloud>,
        /// Other fields as written.
        deposition: WrittenDeposition,
    },
    /// Sample that was saved in a file and is already read.
    File {
        /// Path of the file.
        path: PathBuf,
        /// Grains of the file.
        #[serde(skip)]
        grains: Vec<ListedGrain>,
    },
    /// Grains listed one by one in the case.
    List(Vec<ListedGrain>),
}

/// Region whose grains have a material of their own.
#[derive(Clone, Debug, Serialize)]
pub struct MaterialZone {
    /// Name of the zone.
    pub name: String,
    /// Lower corner \[m\]; infinite along axes without a bound.
    pub from: [f64; 3],
    /// Upper corner \[m\].
    pub to: [f64; 3],
    /// Solid that contains the grains as well; none if the box is the whole region.
    #[serde(skip)]
    pub solid: Option<Arc<Images>>,
    /// Index of the material.
    pub material: usize,
    /// Initial velocity [m/s]; none if the zone does not change it.
    pub velocity: Option<[f64; 3]>,
    /// Number of listed grains that are in the zone and in no later one; none if grains are prepared.
    pub listed: Option<usize>,
}

impl MaterialZone {
    /// Returns `true` if a point is in the zone.
    #[must_use]
    pub fn contains(&self, point: [f64; 3]) -> bool {
        (0..3).all(|a| point[a] >= self.from[a] && point[a] < self.to[a])
            && (self.solid.as_ref()).is_none_or(|solid| solid.distance(point) < 0.0)
    }
}

/// Gives grains the material and velocity of the last zone that contains their centre; returns the number of grains
/// of each zone.
pub fn assign(zones: &[MaterialZone], grains: &mut [ListedGrain]) -> Vec<usize> {
    let mut counts = vec![0; zones.len()];
    for grain in grains {
        let Some(n) = zones.iter().rposition(|zone| zone.contains(grain.position)) else {
            continue;
        };
        counts[n] += 1;
        grain.material = zones[n].material;
        grain.velocity = zones[n].velocity.unwrap_or(grain.velocity);
    }
    counts
}

fn zones(
    case: &Case,
    written: &[GrainZone],
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Vec<MaterialZone> {
    let mut known = Vec::new();
    let mut zones = Vec::new();
    for (n, zone) in written.iter().enumerate() {
        let path = format!("grains.zones[{n}]");
        unique(&mut known, &zone.name, &format!("{path}.name"), findings);
        if zone.region.is_none() && zone.shape.is_none() {
            findings.error(
                &path,
                "the zone has neither a region nor a shape, so that it would contain the whole sample",
                "add a `region`, or change `grains.material`",
            );
        }
        let [from, to] = zone
            .region
            .as_ref()
            .map_or([[f64::NEG_INFINITY; 3], [f64::INFINITY; 3]], |written| {
                region(grid, written, &format!("{path}.region"), findings)
            });
        let shape = format!("{path}.shape");
        let solid = zone
            .shape
            .as_ref()
            .map(|written| images(case, grid, written, &shape, findings));
        if matches!(solid, Some(None)) {
            continue;
        }
        needs_density(case, &zone.material, findings);
        let index = material(names, &zone.material, &format!("{path}.material"), findings);
        let velocity = zone.velocity.as_ref().map(|written| {
            AlignedBox::vector(grid, written, &format!("{path}.velocity"), findings)
        });
        zones.push(MaterialZone {
            name: zone.name.clone(),
            from,
            to,
            solid: solid.flatten().map(Arc::new),
            material: index.unwrap_or(0),
            velocity,
            listed: None,
        });
    }
    zones
}

/// Maximum number of grains for which percentiles are computed before the run.
const MAX_SIZES: usize = 1_000_000;

impl Cloud {
    /// Returns the percentiles of the grading by mass; none if there are too many grains.
    #[must_use]
    pub fn percentiles(&self, dimension: usize) -> Option<Percentiles> {
        let number = self.number.min(MAX_SIZES);
        let radii = self.grading.radii(number, dimension, (0, 0)).ok()?;
        Percentiles::from_radii(radii.into_iter(), dimension)
    }
}

impl Grains {
    /// Returns the clouds of a deposition with several layers; empty for all other sources.
    #[must_use]
    pub fn layers(&self) -> &[Cloud] {
        match &self.source {
            GrainSource::Deposition { clouds, .. } if clouds.len() > 1 => clouds,
            _ => &[],
        }
    }

    /// Returns the materials of prepared grains, that of the grains first.
    pub fn materials(&self) -> impl Iterator<Item = usize> {
        let zones = self.zones.iter().map(|zone| zone.material);
        let clouds = self.layers().iter().map(|cloud| cloud.material);
        std::iter::once(self.material).chain(zones).chain(clouds)
    }

    /// Returns the percentiles of the grading by mass before cutting: of the listed grains, of the sizes that will
    /// be drawn, or of the uniform distribution for growth.
    #[must_use]
    pub fn percentiles(&self, dimension: usize) -> Option<Percentiles> {
        let number = self.expected.min(MAX_SIZES);
        let radii = match &self.source {
            GrainSource::List(grains) | GrainSource::File { grains, .. } => {
                return Percentiles::from_radii(grains.iter().map(|grain| grain.radius), dimension);
            }
            GrainSource::Deposition { clouds, deposition } => {
                let mut radii = Vec::new();
                for cloud in clouds {
                    let first = radii.len();
                    let number = cloud.number.min(MAX_SIZES);
                    let from = (deposition.seed, first);
                    radii.extend(cloud.grading.radii(number, dimension, from).ok()?);
                }
                radii
            }
            GrainSource::Growth { growth, .. } => match &growth.radii {
                Radii::Uniform { min, max } => {
                    let share = |n: usize| (real(n) + 0.5) / real(number);
                    let radius = |n: usize| min + share(n) * (max - min);
                    return Percentiles::from_radii((0..number).map(radius), dimension);
                }
                Radii::List(list) => list.clone(),
                Radii::Sieve(curve) => grading::Grading::of_sieves(curve)
                    .radii(number, dimension, (growth.seed, 0))
                    .ok()?,
            },
        };
        Percentiles::from_radii(radii.into_iter(), dimension)
    }
}

pub(crate) fn grains(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Option<Grains> {
    let grains = case.grains.as_ref()?;
    let default_material =
        material(names, &grains.material, "grains.material", findings).unwrap_or(0);
    needs_density(case, &grains.material, findings);
    let mut known = Vec::new();
    let cut = grains
        .cut
        .iter()
        .enumerate()
        .map(|(n, cut)| {
            let path = format!("grains.cut[{n}]");
            unique(&mut known, &cut.name, &format!("{path}.name"), findings);
            (
                cut.name.clone(),
                AlignedBox::resolve(grid, &cut.region, &format!("{path}.box"), findings),
            )
        })
        .collect();
    let mut zones = zones(case, &grains.zones, grid, names, findings);
    let materials = Materials {
        names,
        default_material,
    };
    let Source {
        mut source,
        radii,
        expected,
    } = match &grains.initial {
        Written::Growth(growth) => grow(growth, grid, findings)?,
        Written::Deposition(written) => {
            resolve_deposition(case, written, grid, materials, findings)?
        }
        Written::File(file) => sample(case, file, grid, materials, findings),
        Written::List(list) => resolve_list(case, list, grid, materials, findings),
    };
    assign_zones(&mut zones, grains.zones.len(), &mut source, findings);
    Some(Grains {
        contacts: match &source {
            GrainSource::List(grains) | GrainSource::File { grains, .. } => {
                pairs::touching(grains, grid)
            }
            GrainSource::Growth { .. } | GrainSource::Deposition { .. } => 0,
        },
        material: default_material,
        source,
        save: grains.save.clone(),
        zones,
        cut,
        bond_at_start: grains.bond_at_start,
        radii,
        expected,
    })
}

/// Assigns zones to listed grains, and warns of zones without grains.
fn assign_zones(
    zones: &mut [MaterialZone],
    written: usize,
    source: &mut GrainSource,
    findings: &mut Findings,
) {
    if let GrainSource::List(list) | GrainSource::File { grains: list, .. } = source {
        let counts = assign(zones, list);
        for (n, count) in counts.into_iter().enumerate() {
            if count == 0 && !list.is_empty() && zones.len() == written {
                findings.warn(
                    &format!("grains.zones[{n}]"),
                    format!(
                        "the zone `{}` contains no grain, or later zones overwrite all of its grains",
                        zones[n].name
                    ),
                    "correct the region, or the order of the zones",
                );
            }
            zones[n].listed = Some(count);
        }
    }
}

/// Resolves grains that are listed one by one.
fn resolve_list(
    case: &Case,
    list: &[WrittenGrain],
    grid: &Grid,
    materials: Materials,
    findings: &mut Findings,
) -> Source {
    if list.is_empty() {
        findings.error(
            "grains.initial.list",
            "the list contains no grain",
            "add one, or omit `grains`",
        );
    }
    let mut resolved = Vec::with_capacity(list.len());
    let narrowest = grid.size[..grid.dimension]
        .iter()
        .fold(f64::INFINITY, |least, size| size.min(least));
    for (n, grain) in list.iter().enumerate() {
        let plain = grain.position.0.len() == grid.dimension
            && 2.0 * grain.radius <= narrowest
            && grain.radius >= SMALLEST
            && grid.contains(grain.position.to_array())
            && grain.velocity.is_none()
            && grain.angular_velocity.is_none()
            && grain.material.is_none();
        if plain {
            // Paths are built only for grains that may have a finding.
            resolved.push(ListedGrain {
                position: grain.position.to_array(),
                radius: grain.radius,
                velocity: [0.0; 3],
                angular_velocity: [0.0; 3],
                material: materials.default_material,
            });
            continue;
        }
        let path = format!("grains.initial.list[{n}]");
        resolved.push(listed_grain(case, grain, grid, materials, &path, findings));
    }
    let (radii, expected) = (bounds(&resolved), resolved.len());
    Source {
        source: GrainSource::List(resolved),
        radii,
        expected,
    }
}

/// Resolves a listed grain.
fn listed_grain(
    case: &Case,
    grain: &WrittenGrain,
    grid: &Grid,
    materials: Materials,
    path: &str,
    findings: &mut Findings,
) -> ListedGrain {
    let (velocity, angular_velocity) = motion(
        grid,
        grain.velocity.as_ref(),
        grain.angular_velocity.as_ref(),
        path,
        findings,
    );
    let position = AlignedBox::vector(grid, &grain.position, &format!("{path}.position"), findings);
    if !grid.contains(position) {
        findings.error(
            &format!("{path}.position"),
            "the centre lies outside the domain",
            "move it inside",
        );
    }
    fits_domain(grid, grain.radius, &format!("{path}.radius"), findings);
    let own = grain.material.as_ref().map(|name| {
        needs_density(case, name, findings);
        material(materials.names, name, &format!("{path}.material"), findings).unwrap_or(0)
    });
    ListedGrain {
        position,
        radius: grain.radius,
        velocity,
        angular_velocity,
        material: own.unwrap_or(materials.default_material),
    }
}

/// Names of the materials, and the index of the default material of grains.
#[derive(Clone, Copy)]
struct Materials<'a> {
    names: &'a [String],
    default_material: usize,
}

/// Resolved source of grains.
struct Source {
    source: GrainSource,
    /// Smallest and largest radius \[m\]; none without grains.
    radii: Option<(f64, f64)>,
    /// Expected number of grains.
    expected: usize,
}

/// Returns the smallest and largest radius.
fn bounds(grains: &[ListedGrain]) -> Option<(f64, f64)> {
    let bounds = grains.iter().fold((f64::INFINITY, 0.0_f64), |(lo, hi), g| {
        (lo.min(g.radius), hi.max(g.radius))
    });
    Some(bounds).filter(|b| b.1 > 0.0)
}

/// Returns the range of the centres along each axis as text.
fn span(grid: &Grid, grains: &[ListedGrain]) -> String {
    let along = |a: usize| {
        let all = grains.iter().map(|grain| grain.position[a]);
        let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (x.min(low), x.max(high))
        });
        let name = ["x", "y", "z"][a];
        format!("{name} {} … {} m", number(low), number(high))
    };
    (0..grid.dimension)
        .map(along)
        .collect::<Vec<_>>()
        .join(", ")
}

/// Checks a saved sample and reports findings.
fn sample(
    case: &Case,
    written: &SampleFile,
    grid: &Grid,
    Materials {
        names,
        default_material: material,
    }: Materials,
    findings: &mut Findings,
) -> Source {
    let path = sample::PATH;
    let file = case.directory.join(&written.path);
    if let Some(origin) = &written.origin {
        origin.resolve(grid.dimension, "grains.initial.file.origin", findings);
    }
    let grains = sample::load(case, written).unwrap_or_else(|reason| {
        findings.error(path, reason, sample::REMEDY);
        Vec::new()
    });
    if let Some(n) = grains.iter().position(|g| !grid.contains(g.position)) {
        findings.error(
            path,
            format!(
                "grain {} of the sample lies outside the domain; the centres span {}",
                n + 1,
                span(grid, &grains)
            ),
            format!(
                "the domain is 0 … {} m along its axes: move the sample into it with `origin` next to `path`, or \
                 convert its lengths with `scale`",
                grid.size[..grid.dimension]
                    .iter()
                    .map(|x| number(*x))
                    .collect::<Vec<_>>()
                    .join(", ")
            ),
        );
    }
    if let Some((finest, widest)) = bounds(&grains) {
        let worst = if finest < SMALLEST { finest } else { widest };
        fits_domain(grid, worst, path, findings);
    }
    for (n, name) in names.iter().enumerate() {
        if n != material && grains.iter().any(|grain| grain.material == n) {
            needs_density(case, name, findings);
        }
    }
    let (radii, expected) = (bounds(&grains), grains.len());
    Source {
        source: GrainSource::File { path: file, grains },
        radii,
        expected,
    }
}

/// Minimum radius of a grain \[m\]: that of an atom. The mass and inertia of much smaller grains underflow.
const SMALLEST: f64 = 1e-10;

/// Refuses a grain that is smaller than an atom, that covers the whole domain, or that would overlap its own image
/// across a periodic face.
pub(crate) fn fits_domain(grid: &Grid, radius: f64, path: &str, findings: &mut Findings) {
    if radius < SMALLEST {
        findings.error(
            path,
            format!(
                "a radius of {} m is smaller than that of an atom; it must be at least {} m",
                number(radius),
                number(SMALLEST)
            ),
            "write radii in m",
        );
    }
    let diagonal = grid.size[..grid.dimension].iter().map(|x| x * x);
    let diagonal = diagonal.sum::<f64>().sqrt();
    if radius > diagonal {
        findings.error(
            path,
            format!(
                "a grain with a radius of {} m covers the whole domain; the radius can be at most {} m, the \
                 diagonal of the domain",
                number(radius),
                number(diagonal)
            ),
            "write radii in m",
        );
        return;
    }
    let periods = (0..grid.dimension).filter(|a| grid.periodic[*a]);
    let narrowest = periods.min_by(|a, b| grid.size[*a].total_cmp(&grid.size[*b]));
    // A grain as wide as the period, up to rounding, closes it.
    if let Some(axis) = narrowest.filter(|a| 2.0 * radius > grid.size[*a] * (1.0 + 1e-9)) {
        let name = ["x", "y", "z"][axis];
        findings.error(
            path,
            format!(
                "a grain with a radius of {} m would overlap itself across the periodic axis {name}: its \
                 diameter can be at most {} m, the length of the domain",
                number(radius),
                number(grid.size[axis])
            ),
            format!(
                "use a radius of at most {} m or a longer domain, or remove {name} from domain.periodic; radii \
                 are in m",
                number(0.5 * grid.size[axis])
            ),
        );
    }
}

/// Returns `true` for a usable radius distribution; otherwise reports findings.
pub(crate) fn check_radii(radii: &Radii, path: &str, findings: &mut Findings) -> bool {
    let good = match radii {
        Radii::Uniform { min, max } => {
            if min > max {
                findings.error(
                    &format!("{path}.uniform"),
                    "the smallest radius is above the largest",
                    Remedy::from("exchange min and max")
                        .set(format!("{path}.uniform.min"), *max)
                        .set(format!("{path}.uniform.max"), *min),
                );
            }
            min <= max && *min > 0.0
        }
        Radii::List(list) => {
            let good = !list.is_empty() && list.iter().all(|r| *r > 0.0);
            if !good {
                findings.error(
                    &format!("{path}.list"),
                    "the list needs at least one radius, and all must be above 0",
                    "correct the list",
                );
            }
            good
        }
        Radii::Sieve(curve) => {
            let checked = sieve::check(curve);
            if let Err(reason) = &checked {
                findings.error(
                    &format!("{path}.sieve"),
                    reason.clone(),
                    "correct the curve",
                );
            }
            checked.is_ok()
        }
    };
    good && radii.bounds().1.is_finite()
}

/// Returns a cloud of grains that fit its box and are not too dense; otherwise reports findings. The caller sets
/// its name.
fn cloud(
    written: &Grading,
    region: &Extent,
    number_of: u32,
    path: &str,
    grid: &Grid,
    findings: &mut Findings,
) -> Option<Cloud> {
    let block = AlignedBox::resolve(grid, region, &format!("{path}.box"), findings);
    let classes = |list: &[SizeClass]| {
        let class = |c: &SizeClass| grading::Class {
            min: c.min,
            max: c.max,
            part: c.fraction,
        };
        list.iter().map(class).collect()
    };
    let (grading, name) = match written {
        Grading::ByCount(list) => (grading::Grading::ByCount(classes(list)), "by_count"),
        Grading::ByMass(list) => (grading::Grading::ByMass(classes(list)), "by_mass"),
        Grading::Sieve(curve) => {
            if let Err(reason) = sieve::check(curve) {
                let path = format!("{path}.grading.sieve");
                findings.error(&path, reason, "correct the curve");
                return None;
            }
            (grading::Grading::of_sieves(curve), "sieve")
        }
    };
    let number_of = number_of as usize;
    let measure = match grading.measure(number_of, grid.dimension) {
        Ok(measure) => measure,
        Err(error) => {
            findings.error(
                &format!("{path}.grading.{name}"),
                error.to_string(),
                "correct the grading, or use more grains",
            );
            return None;
        }
    };
    let widest = 2.0 * grading.bounds().1;
    let narrowest = (0..grid.dimension)
        .map(|a| block.to[a] - block.from[a])
        .fold(f64::INFINITY, f64::min);
    if widest > narrowest {
        findings.error(
            &format!("{path}.grading.{name}"),
            format!(
                "the diameter of a grain with a radius of {} m exceeds the width of the box of {} m",
                number(widest),
                number(narrowest)
            ),
            "use smaller radii; they are in m",
        );
        return None;
    }
    let most = grading::densest_cloud(grid.dimension);
    let fraction = measure / block.measure();
    if fraction > most {
        findings.error(
            &format!("{path}.number"),
            format!(
                "these grains would fill {} of the cloud's box; a loose cloud fills at most {most}",
                number(fraction)
            ),
            {
                // The class fractions allow slightly fewer grains than the proportion.
                let fewer = (0.99 * real(number_of) * most / fraction).floor();
                Remedy::from(format!(
                    "use a box {} times as high, smaller grains, or at most {fewer} of these grains",
                    number(fraction / most)
                ))
                .set(format!("{path}.number"), base::number::whole(fewer))
            },
        );
    }
    Some(Cloud {
        name: None,
        block,
        grading,
        number: number_of,
        material: 0,
    })
}

/// Resolves and checks a gravity deposition.
fn resolve_deposition(
    case: &Case,
    written: &WrittenDeposition,
    grid: &Grid,
    Materials {
        names,
        default_material: default,
    }: Materials,
    findings: &mut Findings,
) -> Option<Source> {
    let path = "grains.initial.deposition";
    let (grading, number_of) = (&written.grading, written.number);
    let mut clouds = vec![Cloud {
        name: None,
        material: default,
        ..cloud(grading, &written.region, number_of, path, grid, findings)?
    }];
    let mut known = Vec::new();
    for (n, layer) in written.layers.iter().enumerate() {
        let path = format!("{path}.layers[{n}]");
        unique(&mut known, &layer.name, &format!("{path}.name"), findings);
        let own = layer.material.as_ref().map(|name| {
            needs_density(case, name, findings);
            material(names, name, &format!("{path}.material"), findings).unwrap_or(default)
        });
        let (grading, number_of) = (&layer.grading, layer.number);
        clouds.push(Cloud {
            name: Some(layer.name.clone()),
            material: own.unwrap_or(default),
            ..cloud(grading, &layer.region, number_of, &path, grid, findings)?
        });
    }
    let along = (0..grid.dimension)
        .filter(|&a| {
            case.gravity
                .as_ref()
                .is_some_and(|g| g.to_array()[a].abs() > 0.0)
        })
        .count();
    if along != 1 {
        let down = if grid.dimension == 2 {
            json!([0, -9.81])
        } else {
            json!([0, 0, -9.81])
        };
        findings.error(
            "gravity",
            "a deposition needs gravity along one axis",
            Remedy::from(format!(
                "write for example {down}. For a slope prepare the sample under this gravity, save it with \
                 `grains.save`, and start another case with inclined gravity from this file; a `body_force` of \
                 the fluid drives the water only"
            ))
            .set("gravity", down),
        );
    }
    let bounds = clouds.iter().map(|cloud| cloud.grading.bounds());
    let bounds = bounds.fold((f64::INFINITY, 0.0_f64), |(low, high), (least, most)| {
        (least.min(low), most.max(high))
    });
    let number_of = clouds.iter().map(|cloud| cloud.number).sum();
    Some(Source {
        source: GrainSource::Deposition {
            clouds,
            deposition: written.clone(),
        },
        radii: Some(bounds),
        expected: number_of,
    })
}

/// Resolves and checks grains that grow in a box.
fn grow(growth: &Growth, grid: &Grid, findings: &mut Findings) -> Option<Source> {
    let path = "grains.initial.growth";
    let block = growth.region.as_ref().map_or(
        AlignedBox {
            from: [0.0; 3],
            to: grid.size,
            dimension: grid.dimension,
        },
        |extent| AlignedBox::resolve(grid, extent, &format!("{path}.box"), findings),
    );
    if !check_radii(&growth.radii, &format!("{path}.radii"), findings) {
        return None;
    }
    let flat = grid.dimension == 2;
    let pi = std::f64::consts::PI;
    let mean = if flat {
        pi * growth.radii.mean_power(2, 2)
    } else {
        4.0 / 3.0 * pi * growth.radii.mean_power(3, 3)
    };
    if !fits_box(growth, &block, &format!("{path}.radii"), findings) {
        return None;
    }
    let (amount_path, number_of, fraction) = match growth.amount {
        Amount::Number(n) => (
            format!("{path}.amount.number"),
            f64::from(n),
            f64::from(n) * mean / block.measure(),
        ),
        Amount::SolidFraction(fraction) => (
            format!("{path}.amount.solid_fraction"),
            (fraction * block.measure() / mean).round().max(1.0),
            fraction,
        ),
    };
    let packing = Packing {
        number_of,
        fraction,
    };
    packing.check(&growth.amount, flat, &amount_path, findings);
    if number_of > 1e8 {
        findings.error(
            &amount_path,
            format!(
                "this makes {} grains; at most 1e8 are allowed",
                number(number_of)
            ),
            "use larger grains or a smaller box",
        );
        return None;
    }
    let number_of = base::number::whole(number_of);
    if let Radii::Sieve(curve) = &growth.radii
        && let Err(error) = grading::Grading::of_sieves(curve).numbers(number_of, grid.dimension)
    {
        findings.error(
            &format!("{path}.radii.sieve"),
            error.to_string(),
            "correct the curve, or use more grains or a larger box",
        );
        return None;
    }
    Some(Source {
        source: GrainSource::Growth {
            block,
            number: number_of,
            growth: growth.clone(),
        },
        radii: Some(growth.radii.bounds()),
        expected: number_of,
    })
}

/// Returns `true` if the largest grain fits the box in which the grains grow; otherwise reports a finding.
fn fits_box(growth: &Growth, block: &AlignedBox, path: &str, findings: &mut Findings) -> bool {
    let largest = 2.0 * growth.radii.bounds().1;
    let narrowest = (0..block.dimension)
        .map(|a| block.to[a] - block.from[a])
        .fold(f64::INFINITY, f64::min);
    let wider = largest > narrowest;
    if wider {
        findings.error(
            path,
            format!(
                "the diameter of a grain with a radius of {} m exceeds the width of the box of {} m",
                number(largest),
                number(narrowest)
            ),
            "use smaller radii; they are in m",
        );
    }
    !wider
}

/// Growing grains, and the fraction of the box that they fill at full size.
struct Packing {
    number_of: f64,
    fraction: f64,
}

impl Packing {
    /// Refuses more grains than a packing can contain, and warns of a loose sample.
    fn check(&self, amount: &Amount, flat: bool, path: &str, findings: &mut Findings) {
        let fraction = self.fraction;
        let (least, most) = if flat { (0.7, 0.9) } else { (0.5, 0.72) };
        if fraction > most {
            findings.error(
                path,
                format!(
                    "the grains would fill {} of the box at full size; a packing holds at most {most}",
                    number(fraction)
                ),
                match amount {
                    Amount::SolidFraction(_) => Remedy::from(format!(
                        "use fewer or smaller grains, with a fraction of at most {most}"
                    ))
                    .set(path, most),
                    Amount::Number(_) => {
                        let fewer = (self.number_of * most / fraction).floor();
                        Remedy::from(format!(
                            "use smaller grains, or at most {fewer} of these grains"
                        ))
                        .set(path, base::number::whole(fewer))
                    }
                },
            );
        } else if fraction < least {
            findings.warn(
                path,
                format!("the grains fill {} of the box at full size: a compact sample needs about {least} or more",
                    number(fraction)),
                "use more or larger grains if the sample should hold together",
            );
        }
    }
}
