//! Free surface of a scene: initial water, openings, and features that do not work with a surface yet.
//!
//! The initial pressure is hydrostatic: the weight of the water above, up to the first surface.

mod amounts;
mod openings;
mod solitary;
mod tension;

pub use amounts::WaterCells;
pub use openings::Opening;
pub use solitary::SolitaryForm;
pub use tension::Tension;

use super::aligned_box::AlignedBox;
use super::boundaries::ScenePatch;
use super::findings::{Findings, LATTICE_PATH, number};
use super::grid::Grid;
use super::structures;
use base::error::Remedy;
use base::number::real;
use case::Case;
use case::coupling::{Coupling, SolidOperator};
use case::fluid::{Device, Fluid, Initial, LatticeBoltzmann};
use case::free_surface::{Water, Wave};
use serde::Serialize;
use std::sync::Arc;
use structure::Images;

/// Samples of a cell along each axis, if a surface crosses the cell.
const SAMPLES: usize = 4;
/// Maximum number of cells whose initial fill levels are compared.
const MAX_CELLS_TO_COMPARE: usize = 2_000_000;
/// Difference below which two fill levels count as equal.
const FILL_SLACK: f64 = 1e-3;

/// A free surface.
#[derive(Clone, Debug, Serialize)]
pub struct FreeSurface {
    /// Axis of gravity: 0, 1 or 2.
    pub axis: usize,
    /// `true` if the coordinate along the axis increases upwards.
    pub rises: bool,
    /// Magnitude of gravity along that axis [m/s²].
    pub gravity: f64,
    /// Parts of the initial water.
    pub parts: Vec<WaterPart>,
    /// Openings through which water passes.
    pub openings: Vec<Opening>,
    /// Surface tension; none if it is not computed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tension: Option<Tension>,
    /// Edge of a cell \[m\].
    spacing: f64,
    /// Edge lengths of the domain \[m\].
    size: [f64; 3],
    dimension: usize,
}

/// Part of the initial water.
#[derive(Clone, Debug, Serialize)]
pub enum WaterPart {
    /// Water below a height \[m\].
    Level(f64),
    /// Water inside a solid.
    Solid(#[serde(skip)] Arc<Images>),
    /// Water below a wave.
    Wave(WaveForm),
    /// Water below a solitary wave.
    Solitary(SolitaryForm),
}

/// A wave in SI.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WaveForm {
    level: f64,
    amplitude: f64,
    axis: usize,
    wave_number: f64,
}

impl WaveForm {
    /// Returns the height of the undisturbed surface along the axis of gravity \[m\].
    pub(crate) fn level(&self) -> f64 {
        self.level
    }

    /// Returns the magnitude of the amplitude \[m\].
    pub(crate) fn amplitude(&self) -> f64 {
        self.amplitude.abs()
    }

    /// Returns the wave number [1/m].
    pub(crate) fn wave_number(&self) -> f64 {
        self.wave_number
    }

    fn height(&self, at: [f64; 3]) -> f64 {
        self.level + self.amplitude * (self.wave_number * at[self.axis]).cos()
    }

    /// Returns the lowest and the highest coordinate of the surface \[m\].
    fn range(&self) -> [f64; 2] {
        [self.level - self.amplitude(), self.level + self.amplitude()]
    }
}

impl FreeSurface {
    /// Returns the initial fill level of a cell, given by its coordinates in the domain.
    #[must_use]
    pub fn fill(&self, cell: [usize; 3]) -> f64 {
        let parts = self.parts.iter().map(|part| self.fill_of(part, cell));
        parts.fold(0.0, f64::max)
    }

    fn fill_of(&self, part: &WaterPart, cell: [usize; 3]) -> f64 {
        let h = self.spacing;
        let low = cell.map(|n| real(n) * h);
        let below = |height: f64, at: f64| {
            let depth = if self.rises {
                height - at
            } else {
                at + h - height
            };
            (depth / h).clamp(0.0, 1.0)
        };
        let mean = |axis: usize, height: &dyn Fn([f64; 3]) -> f64| {
            let samples = 2 * SAMPLES;
            let parts = (0..samples).map(|n| {
                let mut at = low;
                at[axis] += (real(n) + 0.5) / real(samples) * h;
                below(height(at), low[self.axis])
            });
            parts.sum::<f64>() / real(samples)
        };
        // Most cells lie outside the range of a wave and need no samples of it.
        let of_wave = |range: [f64; 2], axis: usize, height: &dyn Fn([f64; 3]) -> f64| {
            let [first, last] = range.map(|height| below(height, low[self.axis]));
            if (first - last).abs() <= 0.0 {
                first
            } else {
                mean(axis, height)
            }
        };
        match part {
            WaterPart::Level(height) => below(*height, low[self.axis]),
            WaterPart::Wave(wave) => of_wave(wave.range(), wave.axis, &|at| wave.height(at)),
            WaterPart::Solitary(wave) => {
                let range = self.range_of(wave);
                of_wave(range, wave.axis(), &|at| self.crest_at(wave, at))
            }
            WaterPart::Solid(solid) => {
                let middle = low.map(|x| x + 0.5 * h);
                let distance = solid.distance(middle);
                let reach = 0.5 * h * real(self.dimension).sqrt();
                if distance.abs() >= reach {
                    return f64::from(u8::from(distance < 0.0));
                }
                self.sampled(solid, low)
            }
        }
    }

    /// Returns the mean fill level of small cubes, each cut by the plane at the distance of its centre.
    fn sampled(&self, solid: &Images, low: [f64; 3]) -> f64 {
        let step = self.spacing / real(SAMPLES);
        let count = |axis: usize| if axis < self.dimension { SAMPLES } else { 1 };
        let mut sum = 0.0;
        for z in 0..count(2) {
            for y in 0..count(1) {
                for x in 0..count(0) {
                    let at = [x, y, z].map(|n| (real(n) + 0.5) * step);
                    let at = std::array::from_fn(|a| low[a] + at[a]);
                    sum += (0.5 - solid.distance(at) / step).clamp(0.0, 1.0);
                }
            }
        }
        sum / real(count(0) * count(1) * count(2))
    }

    /// Returns the depth of a point \[m\] below the nearest surface above it; 0 outside the water.
    #[must_use]
    pub fn depth(&self, at: [f64; 3]) -> f64 {
        let axis = self.axis;
        let begin = at[axis];
        let mut top = at;
        let mut chords = Vec::new();
        // Each part may support the next one: there are no more iterations than parts.
        for _ in 0..=self.parts.len() {
            let before = top[axis];
            for part in &self.parts {
                let height = self.top(part, top, &mut chords);
                if let Some(height) = height.filter(|height| self.is_higher(*height, top)) {
                    top[axis] = height.clamp(0.0, self.size[axis]);
                }
            }
            if (top[axis] - before).abs() <= 0.0 {
                break;
            }
        }
        (top[axis] - begin).abs()
    }

    /// Returns `true` if a coordinate along the axis of gravity lies above a point.
    fn is_higher(&self, coordinate: f64, at: [f64; 3]) -> bool {
        if self.rises {
            coordinate > at[self.axis]
        } else {
            coordinate < at[self.axis]
        }
    }

    /// Returns the height of the surface of a part above a point in it; `None` also above the crest of a wave.
    fn top(&self, part: &WaterPart, at: [f64; 3], chords: &mut Vec<[f64; 2]>) -> Option<f64> {
        let axis = self.axis;
        let reaches = |range: [f64; 2]| range.iter().any(|height| self.is_higher(*height, at));
        match part {
            WaterPart::Level(height) => Some(*height),
            WaterPart::Wave(wave) => reaches(wave.range()).then(|| wave.height(at)),
            WaterPart::Solitary(wave) => {
                reaches(self.range_of(wave)).then(|| self.crest_at(wave, at))
            }
            WaterPart::Solid(solid) => {
                let length = self.size[axis];
                let mut along = [0.0; 3];
                along[axis] = if self.rises { length } else { -length };
                solid.chords(at, along, chords);
                let touches = 1e-9;
                let chord = chords.iter().find(|chord| chord[0] <= touches)?;
                Some(at[axis] + chord[1] * along[axis])
            }
        }
    }

    /// Returns the coordinate of the surface of a solitary wave along the axis of gravity \[m\].
    fn crest_at(&self, wave: &SolitaryForm, at: [f64; 3]) -> f64 {
        wave.level + self.upwards() * wave.elevation(at)
    }

    /// Returns the coordinates of the level and of the crest of a solitary wave \[m\].
    fn range_of(&self, wave: &SolitaryForm) -> [f64; 2] {
        [
            wave.level,
            wave.level + self.upwards() * wave.crest_height(),
        ]
    }

    /// Returns 1 if the coordinate along the axis of gravity increases upwards, else -1.
    fn upwards(&self) -> f64 {
        if self.rises { 1.0 } else { -1.0 }
    }

    /// Returns the velocity [m/s] that the initial waves have at a point; zero in the air.
    #[must_use]
    pub fn velocity(&self, at: [f64; 3]) -> [f64; 3] {
        let mut velocity = [0.0; 3];
        for part in &self.parts {
            let WaterPart::Solitary(wave) = part else {
                continue;
            };
            let height = self.upwards() * (at[self.axis] - wave.level);
            let elevation = wave.elevation(at);
            // A cell that the surface crosses holds water although its centre may lie outside.
            if height <= elevation + self.spacing {
                let [along, up] = wave.velocity(at, height.min(elevation));
                velocity[wave.axis()] += along;
                velocity[self.axis] += self.upwards() * up;
            }
        }
        velocity
    }

    /// Returns the height of a coordinate along the axis of gravity above the lowest point of the domain \[m\].
    #[must_use]
    pub fn above(&self, coordinate: f64) -> f64 {
        if self.rises {
            coordinate
        } else {
            self.size[self.axis] - coordinate
        }
    }

    /// Returns the height through which water can fall \[m\]: from the highest water, initially or outside, to the
    /// lowest level or outfall; or to the lowest point of the domain if a shape contains water and no level lies below
    /// the shape.
    #[must_use]
    pub fn drop(&self) -> f64 {
        let lowest = |part: &WaterPart| match part {
            WaterPart::Level(height) => self.above(*height),
            WaterPart::Wave(wave) => self.above(wave.level) - wave.amplitude.abs(),
            WaterPart::Solitary(wave) => self.above(wave.level),
            WaterPart::Solid(_) => f64::INFINITY,
        };
        let inside = self.parts.iter().map(lowest);
        let outside = self.openings.iter().filter_map(|opening| opening.lowest);
        let lowest = inside.chain(outside).fold(f64::INFINITY, f64::min);
        let lowest = if lowest.is_finite() { lowest } else { 0.0 };
        (self.head() - lowest).max(0.0)
    }

    /// Returns the height through which water can fall \[m\] if the initial water is in equilibrium: from the energy
    /// line of water outside, or the highest initial water, to the lowest level or outfall.
    #[must_use]
    pub fn drop_at_openings(&self) -> f64 {
        let outside = self.openings.iter().filter_map(|opening| opening.lowest);
        let lowest = outside.fold(f64::INFINITY, f64::min);
        let (inside, whole) = (self.standing_head(), self.head());
        let lowest = if whole > inside {
            lowest.min(inside)
        } else {
            lowest
        };
        if lowest.is_finite() {
            (whole - lowest).max(0.0)
        } else {
            0.0
        }
    }

    /// `true` if no initial water has air next to or below it, so that it is in equilibrium. `separated` returns `true`
    /// if solids lie between two points.
    #[must_use]
    pub fn stands(
        &self,
        cells: [usize; 3],
        separated: impl Fn([f64; 3], [f64; 3]) -> bool,
    ) -> bool {
        let level = |part: &WaterPart| matches!(part, WaterPart::Level(_) | WaterPart::Solid(_));
        if !self.parts.iter().all(level) || cells.iter().product::<usize>() > MAX_CELLS_TO_COMPARE {
            return false;
        }
        let h = self.spacing;
        let middle = |cell: [usize; 3]| cell.map(|n| (real(n) + 0.5) * h);
        let wet = |cell: [usize; 3]| self.fill(cell);
        for z in 0..cells[2] {
            for y in 0..cells[1] {
                for x in 0..cells[0] {
                    let cell = [x, y, z];
                    for a in 0..self.dimension {
                        let mut next = cell;
                        next[a] += 1;
                        if next[a] == cells[a] {
                            continue;
                        }
                        let (own, other) = (wet(cell), wet(next));
                        let falls = if a == self.axis {
                            // The lower cell must be full below water.
                            let [low, high] = if self.rises {
                                [own, other]
                            } else {
                                [other, own]
                            };
                            high > FILL_SLACK && low < 1.0 - FILL_SLACK
                        } else {
                            (own - other).abs() > FILL_SLACK
                        };
                        if falls && !separated(middle(cell), middle(next)) {
                            return false;
                        }
                    }
                }
            }
        }
        true
    }

    /// Returns the height of a point above the lowest point of the domain \[m\].
    #[must_use]
    pub fn height(&self, at: [f64; 3]) -> f64 {
        self.above(at[self.axis])
    }

    /// Returns the height above the lowest point of the domain \[m\] of the highest initial water, or of the energy
    /// line of water outside.
    #[must_use]
    pub fn head(&self) -> f64 {
        let outside = self.openings.iter().filter_map(|opening| opening.head);
        outside.fold(self.standing_head(), f64::max)
    }

    /// Returns the height above the lowest point of the domain \[m\] of the highest initial water.
    #[must_use]
    pub fn standing_head(&self) -> f64 {
        let above = |height: f64| self.above(height).clamp(0.0, self.size[self.axis]);
        let heights = self.parts.iter().map(|part| match part {
            WaterPart::Level(height) => above(*height),
            WaterPart::Wave(wave) => above(wave.level + self.upwards() * wave.amplitude.abs()),
            WaterPart::Solitary(wave) => above(wave.level + self.upwards() * wave.crest_height()),
            WaterPart::Solid(solid) => {
                let end = usize::from(self.rises);
                let ends = solid.extents().map(|extent| above(extent[end][self.axis]));
                ends.fold(0.0, f64::max)
            }
        });
        heights.fold(0.0, f64::max)
    }
}

/// Returns the surface of a case; reports features that do not work with it.
pub(crate) fn resolve(
    case: &Case,
    grid: &Grid,
    patches: &[Vec<ScenePatch>; 6],
    findings: &mut Findings,
) -> Option<FreeSurface> {
    let Some(Fluid::LatticeBoltzmann(lbm)) = &case.fluid else {
        return None;
    };
    let Some(written) = lbm.surface.as_ref() else {
        openings::refuse_without_surface(patches, findings);
        return None;
    };
    let gravity = case.gravity.as_ref().map_or([0.0; 3], |written| {
        AlignedBox::vector(grid, written, "gravity", findings)
    });
    let axis = (0..grid.dimension).max_by(|a, b| gravity[*a].abs().total_cmp(&gravity[*b].abs()));
    let axis = axis.unwrap_or(0);
    let weight = gravity[axis];
    let mut parts = Vec::new();
    for (n, water) in written.water.iter().enumerate() {
        let path = format!("{LATTICE_PATH}.surface.water[{n}]");
        parts.extend(part(case, grid, (axis, weight), (water, &path), findings));
    }
    let mut surface = FreeSurface {
        axis,
        rises: weight <= 0.0,
        gravity: weight.abs(),
        parts,
        openings: Vec::new(),
        tension: tension::resolve(case, (lbm, written), patches, findings),
        spacing: grid.spacing,
        size: grid.size,
        dimension: grid.dimension,
    };
    surface.openings = openings::resolve(&surface, grid, (patches, gravity), findings);
    let is_whole = |n: usize| lbm.boundaries.get(n).is_some_and(|b| b.patch.is_none());
    openings::refuse(patches, is_whole, findings);
    refuse(case, lbm, findings);
    Some(surface)
}

/// Returns a part of the water.
fn part(
    case: &Case,
    grid: &Grid,
    (axis, weight): (usize, f64),
    (water, path): (&Water, &str),
    findings: &mut Findings,
) -> Option<WaterPart> {
    let mut level = |name: &str, height: f64| {
        if weight == 0.0 {
            findings.error(
                path,
                "without gravity a level has no lower side",
                "add `gravity`, or define the water by a shape",
            );
        } else if !(height >= 0.0 && height <= grid.size[axis]) {
            findings.error(
                &format!("{path}.{name}"),
                format!(
                    "the height lies outside the domain, which goes from 0 to {} m along {}",
                    number(grid.size[axis]),
                    ["x", "y", "z"][axis]
                ),
                format!("use 0 to {} m", number(grid.size[axis])),
            );
        }
    };
    match water {
        Water::Level(height) => {
            level("level", *height);
            Some(WaterPart::Level(*height))
        }
        Water::Shape(shape) => {
            let path = format!("{path}.shape");
            let images = structures::images(case, grid, shape, &path, findings)?;
            structures::check_cells(case, grid, &images, &path, findings);
            Some(WaterPart::Solid(Arc::new(images)))
        }
        Water::Wave(wave) => {
            level("wave.level", wave.level);
            wave_form(grid, axis, wave, path, findings).map(WaterPart::Wave)
        }
        Water::SolitaryWave(wave) => {
            level("solitary_wave.level", wave.level);
            let above = if weight <= 0.0 {
                wave.level
            } else {
                grid.size[axis] - wave.level
            };
            let written = (wave, path);
            solitary::resolve(grid, (axis, weight), written, above, findings)
                .map(WaterPart::Solitary)
        }
    }
}

fn wave_form(
    grid: &Grid,
    up: usize,
    wave: &Wave,
    path: &str,
    findings: &mut Findings,
) -> Option<WaveForm> {
    let axis = wave.axis.index();
    if axis >= grid.dimension || axis == up {
        findings.error(
            &format!("{path}.wave.axis"),
            "a wave must run along an axis of the domain that is normal to gravity",
            "write another axis",
        );
        return None;
    }
    if !wave.amplitude.is_finite() || wave.waves.is_nan() || wave.waves <= 0.0 {
        findings.error(
            &format!("{path}.wave"),
            "a wave needs a finite amplitude and a number of waves above 0",
            "correct them",
        );
        return None;
    }
    Some(WaveForm {
        level: wave.level,
        amplitude: wave.amplitude,
        axis,
        wave_number: std::f64::consts::TAU * wave.waves / grid.size[axis],
    })
}

/// Refuses features that do not work with a free surface yet.
fn refuse(case: &Case, lbm: &LatticeBoltzmann, findings: &mut Findings) {
    if let Some(Coupling::BounceBack(_)) = &case.coupling {
        findings.error(
            "coupling.bounce_back",
            "bounce-back links of bodies do not work with a free surface: a body that moves through the surface \
             would change the mass of the water",
            Remedy::from("use partially saturated cells")
                .set("coupling", serde_json::json!({"partially_saturated": {}})),
        );
    }
    if let Some(Coupling::PartiallySaturated(cells)) = &case.coupling
        && let Some(operator) = cells.solid_operator
        && operator != SolidOperator::NonEquilibriumBounceBack
    {
        let path = "coupling.partially_saturated.solid_operator";
        findings.error(
            path,
            format!(
                "{} is not verified with a free surface: with viscosity_matched a box at rest had up to 4 % too \
                 little buoyancy, and a box that fell into the water became unstable",
                operator.name()
            ),
            Remedy::from("use non_equilibrium_bounce_back, the default with a free surface")
                .set(path, "non_equilibrium_bounce_back"),
        );
    }
    if lbm.device == Device::Gpu {
        let path = format!("{LATTICE_PATH}.device");
        findings.error(
            &path,
            "a GPU does not run a free surface yet",
            Remedy::from("use cpu").set(path.clone(), "cpu"),
        );
    }
    if !matches!(lbm.initial, Initial::Rest {} | Initial::Uniform(_)) {
        findings.error(
            &format!("{LATTICE_PATH}.initial"),
            "water with a free surface can only start at rest or with a uniform velocity",
            Remedy::from("use rest").set(
                format!("{LATTICE_PATH}.initial"),
                serde_json::json!({"rest": {}}),
            ),
        );
    }
    if let Initial::Uniform(flow) = &lbm.initial
        && flow.pressure != 0.0
    {
        let path = format!("{LATTICE_PATH}.initial.uniform.pressure");
        findings.error(
            &path,
            "the pressure at a free surface is the reference pressure, and the pressure below follows from the \
             depth",
            Remedy::take_out("remove it", &path),
        );
    }
    if case.time.warm_up.is_some() {
        findings.error(
            "time.warm_up",
            "a free surface moves from the start, so that there is no steady flow to warm up",
            Remedy::take_out("remove it", "time.warm_up"),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use case::{Document, examples};
    use std::path::Path;

    /// Returns the surface of the dam-break example with other initial water.
    fn surface(water: &str) -> FreeSurface {
        let text = examples::find("dam-break").unwrap().text;
        let set = [
            format!("fluid.lattice_boltzmann.surface.water={water}"),
            r#"domain={"size": [0.4, 0.2], "spacing": 0.01}"#.to_owned(),
            "probes=[]".to_owned(),
        ];
        let document = Document::read(text, &set, Path::new(".")).unwrap();
        crate::scene::Scene::resolve(&document.case)
            .unwrap()
            .0
            .surface
            .unwrap()
    }

    fn volume(surface: &FreeSurface) -> f64 {
        let cells = (0..40).flat_map(|x| (0..20).map(move |y| [x, y, 0]));
        cells.map(|cell| surface.fill(cell)).sum::<f64>() * 1e-4
    }

    #[test]
    fn water_has_the_volume_of_its_parts() {
        for (water, exact, within) in [
            (r#"[{"level": 0.0537}]"#, 0.4 * 0.0537, 1e-12),
            (
                r#"[{"shape": {"box": {"from": [0, 0], "to": [0.1234, 0.0777]}}}]"#,
                0.1234 * 0.0777,
                2e-3,
            ),
            (
                r#"[{"wave": {"level": 0.1, "amplitude": 0.02, "axis": "x", "waves": 0.5}}]"#,
                0.04,
                1e-4,
            ),
            (
                r#"[{"shape": {"disc": {"centre": [0.2, 0.1], "radius": 0.0611}}}]"#,
                std::f64::consts::PI * 0.0611 * 0.0611,
                2e-3,
            ),
        ] {
            let found = volume(&surface(water));
            assert!(
                (found / exact - 1.0).abs() < within,
                "{water}: {found} of {exact}"
            );
        }
    }

    #[test]
    fn the_depth_ends_at_the_first_surface() {
        let stacked = surface(
            r#"[{"level": 0.05},
                {"shape": {"box": {"from": [0.1, 0.04], "to": [0.2, 0.1]}}},
                {"shape": {"box": {"from": [0.1, 0.15], "to": [0.2, 0.18]}}}]"#,
        );
        for (at, depth) in [
            ([0.05, 0.01], 0.04),
            ([0.05, 0.06], 0.0),
            ([0.15, 0.01], 0.09),
            ([0.15, 0.12], 0.0),
            ([0.15, 0.16], 0.02),
        ] {
            let found = stacked.depth([at[0], at[1], 0.0]);
            assert!((found - depth).abs() < 1e-12, "{at:?}: {found}");
        }
        assert!((stacked.head() - 0.18).abs() < 1e-12);
    }
}
