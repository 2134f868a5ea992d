//! The grains of a scene: their source, sizes and number.

use super::block::Block;
use super::findings::{Findings, number};
use super::grid::Grid;
use super::motion::{motion, needs_density};
use super::sample::{self, Grain};
use super::{grading, material, unique};
use crate::case::Case;
use crate::case::grains::{
    Amount, Deposition as WrittenDeposition, Grading, GrainSource as Written, Growth, Radii,
    SizeClass,
};
use crate::error::Remedy;
use crate::number::real;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// Grains and their preparation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grains {
    /// Index of the material of grains that name none.
    pub material: usize,
    /// Where they come from.
    pub source: GrainSource,
    /// File to which the prepared sample goes; relative to the output folder.
    pub save: Option<PathBuf>,
    /// Boxes emptied after the preparation, with their names.
    pub cut: Vec<(String, Block)>,
    /// Whether contacts are bonded after preparation and cutting.
    pub bond_at_start: bool,
    /// Smallest and largest radius \[m\].
    pub radii: Option<(f64, f64)>,
    /// How many before cutting.
    pub expected: usize,
}

impl Grains {
    /// How many after cutting: exact for grains that are listed, from the volumes of the boxes for grains that grow. How many deposited
    /// grains a cut removes is not known before they have fallen.
    #[must_use]
    pub fn remaining(&self) -> f64 {
        match &self.source {
            GrainSource::List(grains) | GrainSource::File { grains, .. } => {
                let stays = |grain: &&Grain| {
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
                let shared = |cut: &Block| {
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

/// Where grains come from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub enum GrainSource {
    /// Growth of a loose cloud in a box.
    Growth {
        /// The box.
        block: Block,
        /// How many grains.
        number: usize,
        /// The rest as written.
        growth: Growth,
    },
    /// A cloud that falls from a box.
    Deposition {
        /// The box.
        block: Block,
        /// Sizes.
        grading: grading::Grading,
        /// The rest as written.
        deposition: WrittenDeposition,
    },
    /// A saved sample, read already.
    File {
        /// The file.
        path: PathBuf,
        /// Its grains.
        #[serde(skip)]
        grains: Vec<Grain>,
    },
    /// One by one.
    List(Vec<Grain>),
}

pub(crate) fn grains(
    case: &Case,
    grid: &Grid,
    names: &[String],
    findings: &mut Findings,
) -> Option<Grains> {
    let grains = case.grains.as_ref()?;
    let index = material(names, &grains.material, "grains.material", findings).unwrap_or(0);
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
                Block::resolve(grid, &cut.region, &format!("{path}.box"), findings),
            )
        })
        .collect();
    let (source, radii, expected) = match &grains.initial {
        Written::Growth(growth) => grow(growth, grid, findings)?,
        Written::Deposition(written) => falls(case, written, grid, findings)?,
        Written::File { path } => sample(case, path, grid, (names, index), findings),
        Written::List(list) => {
            if list.is_empty() {
                findings.error(
                    "grains.initial.list",
                    "the list holds no grain",
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
                    && grid.contains(grain.position.to_array())
                    && grain.velocity.is_none()
                    && grain.angular_velocity.is_none()
                    && grain.material.is_none();
                if plain {
                    // Paths of grains are written only where there may be something to say.
                    resolved.push(Grain {
                        position: grain.position.to_array(),
                        radius: grain.radius,
                        velocity: [0.0; 3],
                        angular_velocity: [0.0; 3],
                        material: index,
                    });
                    continue;
                }
                let path = format!("grains.initial.list[{n}]");
                let (velocity, angular_velocity) = motion(
                    grid,
                    grain.velocity.as_ref(),
                    grain.angular_velocity.as_ref(),
                    &path,
                    findings,
                );
                let position =
                    Block::vector(grid, &grain.position, &format!("{path}.position"), findings);
                if !grid.contains(position) {
                    findings.error(
                        &format!("{path}.position"),
                        "the centre lies outside the domain",
                        "move it inside",
                    );
                }
                fits_period(grid, grain.radius, &format!("{path}.radius"), findings);
                let own = grain.material.as_ref().map(|name| {
                    needs_density(case, name, findings);
                    material(names, name, &format!("{path}.material"), findings).unwrap_or(0)
                });
                resolved.push(Grain {
                    position,
                    radius: grain.radius,
                    velocity,
                    angular_velocity,
                    material: own.unwrap_or(index),
                });
            }
            let (radii, expected) = (bounds(&resolved), resolved.len());
            (GrainSource::List(resolved), radii, expected)
        }
    };
    Some(Grains {
        material: index,
        source,
        save: grains.save.clone(),
        cut,
        bond_at_start: grains.bond_at_start,
        radii,
        expected,
    })
}

type Source = (GrainSource, Option<(f64, f64)>, usize);

/// Smallest and largest radius.
fn bounds(grains: &[Grain]) -> Option<(f64, f64)> {
    let bounds = grains.iter().fold((f64::INFINITY, 0.0_f64), |(lo, hi), g| {
        (lo.min(g.radius), hi.max(g.radius))
    });
    Some(bounds).filter(|b| b.1 > 0.0)
}

/// A saved sample, or findings.
fn sample(
    case: &Case,
    written: &Path,
    grid: &Grid,
    (names, material): (&[String], usize),
    findings: &mut Findings,
) -> Source {
    let path = "grains.initial.file.path";
    let file = case.directory.join(written);
    let read = io::plain::text(&file, io::plain::LONGEST_INPUT)
        .map_err(|e| e.to_string())
        .and_then(|text| {
            sample::read(&text, grid.dimension, names, material)
                .map_err(|e| format!("{}: {e}", written.display()))
        });
    let grains = read.unwrap_or_else(|reason| {
        findings.error(
            path,
            reason,
            "correct the path (relative to the case) or the file",
        );
        Vec::new()
    });
    if let Some(n) = grains.iter().position(|g| !grid.contains(g.position)) {
        findings.error(
            path,
            format!("grain {} of the sample lies outside the domain", n + 1),
            "use the domain the sample was made for",
        );
    }
    let widest = grains.iter().map(|grain| grain.radius).fold(0.0, f64::max);
    fits_period(grid, widest, path, findings);
    for (n, name) in names.iter().enumerate() {
        if n != material && grains.iter().any(|grain| grain.material == n) {
            needs_density(case, name, findings);
        }
    }
    let (radii, expected) = (bounds(&grains), grains.len());
    (GrainSource::File { path: file, grains }, radii, expected)
}

/// Refuses a grain that would overlap its own image round a periodic axis.
pub(crate) fn fits_period(grid: &Grid, radius: f64, path: &str, findings: &mut Findings) {
    let periods = (0..grid.dimension).filter(|a| grid.periodic[*a]);
    let narrowest = periods.min_by(|a, b| grid.size[*a].total_cmp(&grid.size[*b]));
    // As wide as the period, but for rounding, closes it.
    if let Some(axis) = narrowest.filter(|a| 2.0 * radius > grid.size[*a] * (1.0 + 1e-9)) {
        let name = ["x", "y", "z"][axis];
        findings.error(
            path,
            format!(
                "a grain of {} m would overlap itself round the periodic axis {name}: its diameter is at most {} m, the length of the domain",
                number(2.0 * radius),
                number(grid.size[axis])
            ),
            format!(
                "use a radius of at most {} m, a longer domain, or take {name} out of domain.periodic; radii are in m",
                number(0.5 * grid.size[axis])
            ),
        );
    }
}

/// A radius distribution that can be used, or findings.
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
                    "radii must be above 0, and there must be one",
                    "correct the list",
                );
            }
            good
        }
    };
    good && radii.bounds().1.is_finite()
}

/// Resolves and checks a gravity deposition.
fn falls(
    case: &Case,
    written: &WrittenDeposition,
    grid: &Grid,
    findings: &mut Findings,
) -> Option<Source> {
    let path = "grains.initial.deposition";
    let block = Block::resolve(grid, &written.region, &format!("{path}.box"), findings);
    let classes = |list: &[SizeClass]| {
        let class = |c: &SizeClass| grading::Class {
            min: c.min,
            max: c.max,
            part: c.fraction,
        };
        list.iter().map(class).collect()
    };
    let (grading, name) = match &written.grading {
        Grading::ByCount(list) => (grading::Grading::ByCount(classes(list)), "by_count"),
        Grading::ByMass(list) => (grading::Grading::ByMass(classes(list)), "by_mass"),
    };
    let number_of = written.number as usize;
    let measure = match grading.measure(number_of, grid.dimension) {
        Ok(measure) => measure,
        Err(reason) => {
            findings.error(
                &format!("{path}.grading.{name}"),
                reason,
                "correct the classes, or use more grains",
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
                "a grain of {} m is wider than the box of {} m",
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
                // Part of the classes: a little less than in proportion.
                let fewer = (0.99 * real(number_of) * most / fraction).floor();
                Remedy::from(format!(
                    "use a box {} times as high, or smaller grains, or {fewer} of these at most",
                    number(fraction / most)
                ))
                .set(format!("{path}.number"), crate::number::whole(fewer))
            },
        );
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
            Remedy::from(format!("write for example {down}")).set("gravity", down),
        );
    }
    let bounds = grading.bounds();
    Some((
        GrainSource::Deposition {
            block,
            grading,
            deposition: written.clone(),
        },
        Some(bounds),
        number_of,
    ))
}

fn grow(growth: &Growth, grid: &Grid, findings: &mut Findings) -> Option<Source> {
    let path = "grains.initial.growth";
    let block = growth.region.as_ref().map_or(
        Block {
            from: [0.0; 3],
            to: grid.size,
            dimension: grid.dimension,
        },
        |extent| Block::resolve(grid, extent, &format!("{path}.box"), findings),
    );
    if !check_radii(&growth.radii, &format!("{path}.radii"), findings) {
        return None;
    }
    let flat = grid.dimension == 2;
    let pi = std::f64::consts::PI;
    let mean = if flat {
        pi * growth.radii.mean_power(2)
    } else {
        4.0 / 3.0 * pi * growth.radii.mean_power(3)
    };
    let largest = 2.0 * growth.radii.bounds().1;
    let narrowest = (0..grid.dimension)
        .map(|a| block.to[a] - block.from[a])
        .fold(f64::INFINITY, f64::min);
    if largest > narrowest {
        findings.error(
            &format!("{path}.radii"),
            format!(
                "a grain of {} m is wider than the box of {} m",
                number(largest),
                number(narrowest)
            ),
            "use smaller radii; they are in m",
        );
        return None;
    }
    let (least, most) = if flat { (0.7, 0.9) } else { (0.5, 0.72) };
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
    if fraction > most {
        findings.error(
            &amount_path,
            format!(
                "the grains would fill {} of the box at full size; a packing holds at most {most}",
                number(fraction)
            ),
            match growth.amount {
                Amount::SolidFraction(_) => Remedy::from(format!(
                    "use fewer or smaller grains, a fraction of {most} at most"
                ))
                .set(&*amount_path, most),
                Amount::Number(_) => {
                    let fewer = (number_of * most / fraction).floor();
                    Remedy::from(format!(
                        "use fewer or smaller grains, {fewer} of these at most"
                    ))
                    .set(&*amount_path, crate::number::whole(fewer))
                }
            },
        );
    } else if fraction < least {
        findings.warn(
            &amount_path,
            format!("the grains fill {} of the box at full size: a compact sample needs about {least} or more", number(fraction)),
            "use more or larger grains if the sample should hold together",
        );
    }
    if number_of > 1e8 {
        findings.error(
            &amount_path,
            format!("this makes {} grains; at most 1e8", number(number_of)),
            "use larger grains or a smaller box",
        );
        return None;
    }
    let number_of = crate::number::whole(number_of);
    Some((
        GrainSource::Growth {
            block,
            number: number_of,
            growth: growth.clone(),
        },
        Some(growth.radii.bounds()),
        number_of,
    ))
}
