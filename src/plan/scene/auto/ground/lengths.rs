//! Kind of ground of a scene, and the lengths that the cells of its seepage must resolve.
//!
//! Ground that conducts better along its beds is compared with the isotropic ground that has the same answers: lengths
//! along the beds are divided by the root of the ratio of the permeabilities, edges of cells too. Horizontal and
//! vertical lengths over beds with a dip g are multiplied by (cos² g/r + sin² g)^½ and (sin² g/r + cos² g)^½.
//!
//! Lengths on cells of different widths are counted in the cells at the singular points ([`widening`]).

mod widening;

use crate::scene::Scene;
use crate::scene::findings::number;
use crate::scene::seepage::Seepage;
use base::vector::norm;
use case::Case;
use case::darcy::{InitialState, Zone, ZonePermeability};
use case::geometry::{Axis, Region};
use darcy::{Condition, Retention};
use serde::Serialize;
use structure::Shape;

/// Largest error of the water content in a step for which errors were measured; the default of a case.
const CONTENT_ERROR: f64 = 2e-3;
/// Distance over the height of the ground below which two edges count as one.
const SAME: f64 = 1e-3;
/// Thickness over depth below which a structure is a sheet, if it is thinner than a cell.
const SHEET: f64 = 0.2;
/// Beginning of the names of layers.
const ZONE: &str = "zone";
/// Thickness of a layer in cells below which no error was measured.
pub(super) const MIN_LAYER: f64 = 0.3;
/// Distance over a cell within which an edge lies on a face of the grid.
const ON_FACE: f64 = 1e-5;

/// Saturated ground below structures and between heads.
pub(super) const SATURATED: &str = "saturated ground";
/// Saturated ground of layers, or with beds that dip.
pub(super) const LAYERED: &str = "layered ground";
/// Saturated ground with drains.
pub(super) const DRAINED: &str = "drained ground";
/// Steady flow with a phreatic surface and without suction.
pub(super) const PHREATIC: &str = "phreatic surface";
/// Steady flow with suction.
pub(super) const SUCTION: &str = "suction";
/// Steady flow with suction in a column.
pub(super) const MOIST_COLUMN: &str = "column with suction";
/// Wetting or draining of a column.
pub(super) const INFILTRATION: &str = "wetting column";
/// Phreatic surface that moves.
pub(super) const DRAWDOWN: &str = "moving phreatic surface";
/// Storage in saturated ground, along one axis.
pub(super) const STORAGE: &str = "storage in a column";
/// Storage in saturated ground around wells.
pub(super) const WELLS: &str = "wells";

/// Ending of the kinds on cells of different widths.
pub(super) const GRADED: &str = ", graded cells";
/// Ending of the kinds whose heads end within cells and not on faces of the grid.
pub(super) const WITHIN_CELLS: &str = ", edges within cells";

/// Length that cells must resolve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroundLength {
    /// Name of the length: `depth of the wall `pile``.
    pub what: String,
    /// Length \[m\].
    pub size: f64,
    /// Length over the largest edge of a cell, both in ground of the same permeability in all directions \[1\]. If
    /// widths differ, the cells are those at the edges of heads and walls.
    pub cells: f64,
    /// `true` if the errors follow this length. The limits of layers divide cells, so that in saturated ground errors
    /// hardly depend on the thickness of layers.
    pub counts: bool,
}

/// Ground of a scene of seepage without grains.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Ground {
    /// Kind of ground, as in the table of measured errors.
    pub kind: String,
    /// Lengths: those that count from the shortest in cells, then the others.
    pub lengths: Vec<GroundLength>,
    /// Range of the heads \[m\]: differences of imposed and initial heads, the height of ground with suction, and the
    /// drawdown Q/k of wells.
    pub drop: f64,
    /// Largest increase of the width of a cell over its distance from the nearest edge of a head or a wall \[1\]; 0
    /// for equal cells.
    pub widening: f64,
    /// Largest factor of the edge of a cell in isotropic ground.
    #[serde(skip)]
    pub(super) stretch: f64,
    /// Axis along gravity.
    #[serde(skip)]
    pub(super) up: usize,
    /// Axes and coordinates of the edges of conditions, relative to the corner of the grid \[m\].
    #[serde(skip)]
    pub(super) edges: Vec<(usize, f64)>,
    /// Horizontal extent of each structure in the water, and its depth in the ground \[m\].
    #[serde(skip)]
    pub(super) parts: Vec<[f64; 2]>,
}

impl Ground {
    /// Returns the ground of a scene; or the reason why no measured error applies to it.
    pub(super) fn new(scene: &Scene, case: &Case) -> Result<Self, String> {
        let seepage = (scene.seepage.as_ref()).ok_or("the case has no seepage")?;
        let reader = Reader::new(scene, case, seepage)?;
        reader.ground()
    }

    /// Returns `true` if the edges of all conditions lie on faces of cells of these edges \[m\].
    pub(super) fn is_aligned(&self, spacing: [f64; 2]) -> bool {
        self.edges.iter().all(|(axis, at)| {
            let place = at / spacing[*axis];
            (place - place.round()).abs() <= ON_FACE * (1.0 + place.abs())
        })
    }

    /// Returns the smallest number of cells across a length.
    #[must_use]
    pub fn cells(&self) -> f64 {
        self.lengths.first().map_or(0.0, |length| length.cells)
    }
}

/// Structure in the ground.
struct Part {
    name: String,
    /// Corners of its part in the ground \[m\]; none if it lies on the surface.
    ends: Option<[[f64; 2]; 2]>,
    /// Horizontal extent in the domain \[m\].
    width: f64,
}

/// Seepage while its ground is read.
struct Reader<'a> {
    scene: &'a Scene,
    case: &'a Case,
    seepage: &'a Seepage,
    up: usize,
    end: [f64; 2],
    /// Smallest and largest factor of lengths along each axis in isotropic ground.
    factors: [[f64; 2]; 2],
    /// Axis along which nothing varies.
    idle: Option<usize>,
    /// Largest hydraulic conductivity [m/s].
    conductivity: f64,
    /// Structures in the water.
    parts: Vec<Part>,
    /// Lengths found \[m\]: name, length, axis.
    found: Vec<(String, f64, usize)>,
}

impl<'a> Reader<'a> {
    fn new(scene: &'a Scene, case: &'a Case, seepage: &'a Seepage) -> Result<Self, String> {
        let dimension = scene.grid.dimension;
        if dimension != 2 {
            return Err("no error was measured for seepage in three dimensions".into());
        }
        let gravity = scene.gravity;
        let strength = norm(gravity);
        let up = usize::from(gravity[1].abs() >= gravity[0].abs());
        if strength <= 0.0 || (gravity[up].abs() - strength).abs() > 1e-9 * strength {
            return Err("errors were measured with gravity along an axis".into());
        }
        let end = [0, 1].map(|a| seepage.axis(a).end());
        let mut reader = Self {
            scene,
            case,
            seepage,
            up,
            end,
            factors: [[1.0; 2]; 2],
            idle: None,
            conductivity: 0.0,
            parts: Vec::new(),
            found: Vec::new(),
        };
        reader.refuse()?;
        reader.read_factors();
        let idle: Vec<usize> = (0..2).filter(|a| reader.is_idle(*a)).collect();
        if let [axis] = idle[..] {
            reader.idle = Some(axis);
        }
        Ok(reader)
    }

    /// Refuses features without measured errors.
    fn refuse(&mut self) -> Result<(), String> {
        let written = &self.seepage.written;
        let conducts = written.density * self.strength() / written.viscosity;
        if self.seepage.piping.is_some() {
            return Err("no error was measured for backward erosion".into());
        }
        if !self.seepage.planes.is_empty() {
            return Err("no error was measured for ground between planes (`enclosure`)".into());
        }
        for zone in &written.zones {
            let of = |what: &str| {
                Err(format!(
                    "no error was measured for {what} (zone `{}`)",
                    zone.name
                ))
            };
            if zone.polygon.is_some() {
                return of("the boundary of a polygon");
            }
            if zone.raster.is_some() {
                return of("a raster");
            }
            if zone.retention.is_some() {
                return of("several soils with suction");
            }
            let k = match zone.permeability {
                Some(ZonePermeability::Value(k)) => k * conducts,
                Some(ZonePermeability::HydraulicConductivity(k)) => k,
                _ => return of("a permeability that is not stated as a number"),
            };
            self.conductivity = self.conductivity.max(k);
        }
        self.parts = self.read_parts()?;
        if let Some(transient) = written
            .unsaturated
            .as_ref()
            .and_then(|s| s.transient.as_ref())
            && transient.content_error > CONTENT_ERROR * (1.0 + 1e-9)
        {
            return Err(format!(
                "`content_error` {} is above {CONTENT_ERROR}, with which errors were measured",
                number(transient.content_error)
            ));
        }
        Ok(())
    }

    /// Returns the part in the ground of each structure in the water: a box completely, and for a polygon the box
    /// around its corners below the surface. That box must be a sheet.
    fn read_parts(&self) -> Result<Vec<Part>, String> {
        let (origin, end, up) = (self.seepage.origin, self.end, self.up);
        let least = SAME * self.height();
        let mut parts = Vec::new();
        for (written, structure) in self.case.structures.iter().zip(&self.scene.structures) {
            if !structure.stops.water() {
                continue;
            }
            let name = structure.name.clone();
            let [low, high] = structure.solid.solid().extent();
            let mut low = [0, 1].map(|a| low[a].max(origin[a]));
            let mut high = [0, 1].map(|a| high[a].min(end[a]));
            let width = (high[1 - up] - low[1 - up]).max(0.0);
            let mut deep = high[up] - low[up] > least;
            if let Shape::Polygon(polygon) = &written.shape {
                let inside = |at: &&[f64; 2]| {
                    (0..2).all(|a| at[a] > origin[a] + least && at[a] < end[a] - least)
                };
                (low, high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
                for corner in polygon.points.iter().filter(inside) {
                    for a in 0..2 {
                        (low[a], high[a]) = (low[a].min(corner[a]), high[a].max(corner[a]));
                    }
                }
                deep = low[up].is_finite();
                // A cut-off reaches the surface on which the structure lies.
                high[up] = end[up];
            }
            let thin = high[1 - up] - low[1 - up] <= self.seepage.spacing[1 - up] * (1.0 + 1e-9);
            if deep && !thin && !matches!(written.shape, Shape::Cuboid(_)) {
                return Err(format!(
                    "no error was measured for the shape of the structure `{name}`"
                ));
            }
            parts.push(Part {
                name,
                ends: deep.then_some([low, high]),
                width,
            });
        }
        Ok(parts)
    }

    fn strength(&self) -> f64 {
        self.scene.gravity[self.up].abs()
    }

    fn height(&self) -> f64 {
        self.end[self.up] - self.seepage.origin[self.up]
    }

    fn soil(&self) -> Option<&'a Retention> {
        let soil = self.seepage.written.unsaturated.as_ref();
        soil.map(|soil| &soil.retention)
    }

    fn read_factors(&mut self) {
        let across = 1 - self.up;
        let (mut low, mut high) = ([f64::INFINITY; 2], [0.0_f64; 2]);
        for zone in &self.seepage.written.zones {
            let ratio = zone.anisotropy.unwrap_or(1.0);
            let (sin, cos) = zone.dip.unwrap_or(0.0).to_radians().sin_cos();
            let mut factors = [0.0; 2];
            factors[across] = (cos * cos / ratio + sin * sin).sqrt();
            factors[self.up] = (sin * sin / ratio + cos * cos).sqrt();
            for a in 0..2 {
                low[a] = low[a].min(factors[a]);
                high[a] = high[a].max(factors[a]);
            }
        }
        if high.iter().all(|high| *high > 0.0) {
            self.factors = [0, 1].map(|a| [low[a], high[a]]);
        }
    }

    /// Returns `true` if neither conditions nor ground vary along an axis, and nothing flows along it.
    fn is_idle(&self, axis: usize) -> bool {
        let written = &self.seepage.written;
        // Gravity moves the water of ground that drains.
        if axis == self.up && self.soil().is_some() && !self.stays_saturated() {
            return false;
        }
        let uniform = |zone: &Zone| {
            let across = match &zone.region {
                None => true,
                Some(Region::Layer(layer)) => layer.axis.map_or(1, Axis::index) != axis,
                Some(Region::Box(_)) => false,
            };
            across && zone.dip.is_none_or(|dip| dip.abs() <= 0.0)
        };
        self.seepage.solids.is_empty()
            && written.drains.is_empty()
            && written.zones.iter().all(uniform)
            && (written.boundaries.iter()).all(|b| b.face.axis() != axis && b.patch.is_none())
    }

    /// Returns the ground after all lengths have been found.
    fn ground(mut self) -> Result<Ground, String> {
        let edges = self.edges();
        let kind = self.kind()?;
        let resolution = self.resolution(&edges)?;
        self.extents();
        self.stretches();
        self.walls();
        self.layers();
        self.drains();
        self.levels();
        self.depths(kind);
        let stretch = self.factors.iter().map(|f| f[1]).fold(0.0, f64::max);
        let mut lengths: Vec<GroundLength> = (self.found.iter())
            .map(|(what, size, axis)| GroundLength {
                what: what.clone(),
                size: *size,
                cells: size * self.factors[*axis][0] / resolution.edge,
                counts: kind != LAYERED || !what.starts_with(ZONE),
            })
            .collect();
        let thin = lengths.iter().find(|l| !l.counts && l.cells < MIN_LAYER);
        if let Some(layer) = thin {
            return Err(format!(
                "the {} is thinner than the {MIN_LAYER} cells of any measured layer",
                layer.what
            ));
        }
        lengths.sort_by(|a, b| b.counts.cmp(&a.counts).then(a.cells.total_cmp(&b.cells)));
        let mut ground = Ground {
            kind: kind.to_owned(),
            lengths,
            drop: self.range_of_heads(),
            widening: resolution.widening,
            stretch,
            up: self.up,
            edges,
            parts: (self.parts.iter())
                .map(|part| {
                    let depth = part
                        .ends
                        .map_or(0.0, |[low, high]| high[self.up] - low[self.up]);
                    [part.width, depth]
                })
                .collect(),
        };
        let spacing = [self.seepage.spacing[0], self.seepage.spacing[1]];
        if self.seepage.is_graded() {
            if ![SATURATED, LAYERED].contains(&kind) {
                return Err(format!(
                    "no error was measured on cells of different widths for this kind of ground ({kind})"
                ));
            }
            if !self.is_on_faces(&ground.edges) {
                return Err("no error was measured for heads that end within cells of different widths, and a \
                     position in `points` of the grid makes their end a face"
                    .into());
            }
            ground.kind += GRADED;
        } else if !ground.is_aligned(spacing) {
            ground.kind += WITHIN_CELLS;
        }
        Ok(ground)
    }

    /// Returns the kind of the ground.
    fn kind(&self) -> Result<&'static str, String> {
        let written = &self.seepage.written;
        if written.terrain.is_some() {
            return Err("no error was measured below a surface of the ground (`terrain`)".into());
        }
        let held = |c: &Condition| {
            matches!(
                c,
                Condition::Head { .. } | Condition::Pressure { .. } | Condition::NoFlow {}
            )
        };
        let wells = self
            .seepage
            .drains
            .iter()
            .any(|d| matches!(d.condition, Condition::Discharge { .. }));
        let column = self.idle.is_some();
        if self
            .seepage
            .conditions()
            .any(|c| matches!(c, Condition::Evaporation { .. }))
        {
            return Err("no error was measured for evaporation with a limit".into());
        }
        let Some(soil) = self.soil() else {
            let layered = written
                .zones
                .iter()
                .any(|zone| zone.region.is_some() || zone.dip.is_some());
            if !self.seepage.conditions().all(|condition| held(&condition)) {
                return Err("no error was measured for fluxes and wells in saturated ground that stores nothing".into());
            }
            return match (self.seepage.drains.is_empty(), layered) {
                (true, false) => Ok(SATURATED),
                (true, true) => Ok(LAYERED),
                (false, false) => Ok(DRAINED),
                (false, true) => Err("no error was measured for drains in layers".into()),
            };
        };
        let dry = matches!(soil, Retention::SaturatedOnly(_));
        if !self.seepage.is_transient() {
            return match (dry, column, self.seepage.drains.is_empty()) {
                (_, _, false) => {
                    Err("no error was measured for drains in unsaturated ground".into())
                }
                (true, false, _) => Ok(PHREATIC),
                (false, false, _) if written.zones.len() == 1 => Ok(SUCTION),
                (false, false, _) => Err("no error was measured for layers with suction".into()),
                (false, true, _) => Ok(MOIST_COLUMN),
                (true, true, _) => Err("no error was measured for a column without suction".into()),
            };
        }
        if written.zones.len() > 1 {
            return Err("no error was measured for transient flow in layers".into());
        }
        if self.stays_saturated() {
            return match (column, wells) {
                (true, _) => Ok(STORAGE),
                (false, true) => Ok(WELLS),
                (false, false) => Err(
                    "no error was measured for storage below structures and between heads".into(),
                ),
            };
        }
        match (
            column,
            self.seepage.drains.is_empty() && self.seepage.solids.is_empty(),
        ) {
            (true, _) => Ok(INFILTRATION),
            (false, true) => Ok(DRAWDOWN),
            (false, false) => {
                Err("no error was measured for transient flow with drains and walls".into())
            }
        }
    }

    /// Returns `true` if no condition and no initial state puts the ground under suction.
    fn stays_saturated(&self) -> bool {
        let transient = self
            .seepage
            .written
            .unsaturated
            .as_ref()
            .and_then(|s| s.transient.as_ref());
        let top = self.top();
        let starts = match transient.map(|transient| transient.initial) {
            Some(InitialState::Head(head)) => head >= top,
            Some(InitialState::PressureHead(head)) => head >= 0.0,
            _ => true,
        };
        let patches = self
            .seepage
            .patches
            .iter()
            .map(|p| (p.condition, &p.history));
        let drains = self
            .seepage
            .drains
            .iter()
            .map(|d| (d.condition, &d.history));
        let wet = |(condition, history): (Condition, &Vec<[f64; 2]>)| match condition {
            Condition::Head { value } => {
                value >= top && history.iter().all(|[_, value]| *value >= top)
            }
            Condition::Discharge { .. } | Condition::NoFlow {} => true,
            _ => false,
        };
        starts && patches.chain(drains).all(wet)
    }

    /// Returns the highest elevation of the ground \[m\].
    fn top(&self) -> f64 {
        if self.scene.gravity[self.up] > 0.0 {
            -self.seepage.origin[self.up]
        } else {
            self.end[self.up]
        }
    }

    fn add(&mut self, what: String, size: f64, axis: usize) {
        if size > SAME * self.height() {
            self.found.push((what, size, axis));
        }
    }

    /// Adds the extents of the ground.
    fn extents(&mut self) {
        let idle = self.idle;
        for a in (0..2).filter(|a| idle != Some(*a)) {
            let what = if a == self.up { "height" } else { "length" };
            self.add(
                format!("{what} of the ground"),
                self.end[a] - self.seepage.origin[a],
                a,
            );
        }
    }

    /// Returns the edges of conditions that do not cover their face, and of drains with an extent.
    fn edges(&self) -> Vec<(usize, f64)> {
        let written = &self.seepage.written;
        let mut edges = Vec::new();
        let origin = self.seepage.origin;
        let mut add = |axis: usize, at: f64| {
            if at > origin[axis] && at < self.end[axis] {
                edges.push((axis, at - origin[axis]));
            }
        };
        for boundary in &written.boundaries {
            let Some(patch) = &boundary.patch else {
                continue;
            };
            let (from, to) = (patch.from.to_array(), patch.to.to_array());
            let along = 1 - boundary.face.axis().min(1);
            add(along, from[along]);
            add(along, to[along]);
        }
        for drain in &written.drains {
            let (from, to) = (drain.region.from.to_array(), drain.region.to.to_array());
            // A sheet lies on the plane nearest to it.
            for a in (0..2).filter(|&a| to[a] - from[a] > 0.5 * self.seepage.spacing[a]) {
                add(a, from[a]);
                add(a, to[a]);
            }
        }
        edges
    }

    /// Adds the stretches into which conditions and walls divide the faces of the ground.
    fn stretches(&mut self) {
        let boundaries = &self.seepage.written.boundaries;
        for face in boundaries.iter().map(|b| b.face) {
            let normal = face.axis();
            let along = 1 - normal;
            let level = if face.is_max() {
                self.end[normal]
            } else {
                self.seepage.origin[normal]
            };
            let mut ends = vec![self.seepage.origin[along], self.end[along]];
            for boundary in boundaries.iter().filter(|b| b.face == face) {
                if let Some(patch) = &boundary.patch {
                    ends.extend([patch.from.to_array()[along], patch.to.to_array()[along]]);
                }
            }
            for [low, high] in self.parts.iter().filter_map(|part| part.ends) {
                let near = SAME * self.height();
                // Corners lie within the grid, so that a wall through the face ends on it.
                if low[normal] < level + near && high[normal] > level - near {
                    let ends_of = [low[along], high[along]];
                    if ends_of[1] - ends_of[0] > self.seepage.spacing[along] {
                        ends.extend(ends_of);
                    } else {
                        ends.push(0.5 * (low[along] + high[along]));
                    }
                }
            }
            for end in &mut ends {
                *end = end.clamp(self.seepage.origin[along], self.end[along]);
            }
            ends.sort_by(f64::total_cmp);
            if ends.len() == 2
                && boundaries
                    .iter()
                    .all(|b| b.face != face || b.patch.is_none())
            {
                continue;
            }
            for pair in ends.windows(2) {
                let what = format!(
                    "stretch of {} from {} to {} m",
                    face.name(),
                    number(pair[0]),
                    number(pair[1])
                );
                if !self.found.iter().any(|(known, ..)| *known == what) {
                    self.add(what, pair[1] - pair[0], along);
                }
            }
        }
    }

    /// Adds the parts of structures in the ground, and the ground below and above them.
    fn walls(&mut self) {
        let (origin, end, spacing) = (self.seepage.origin, self.end, self.seepage.spacing);
        let mut parts = Vec::new();
        for part in &self.parts {
            let Some([low, high]) = part.ends else {
                continue;
            };
            let name = &part.name;
            let sizes = [0, 1].map(|a| high[a] - low[a]);
            for a in 0..2 {
                // The thickness of a sheet is not resolved, its depth is.
                if sizes[a] > spacing[a].min(SHEET * sizes[1 - a]) {
                    let what = format!("structure `{name}` along {}", ["x", "y"][a]);
                    parts.push((what, sizes[a], a));
                    parts.push((format!("ground before `{name}`"), low[a] - origin[a], a));
                    parts.push((format!("ground behind `{name}`"), end[a] - high[a], a));
                }
            }
        }
        for (what, size, axis) in parts {
            self.add(what, size, axis);
        }
    }

    /// Adds the thickness of layers and zones, and of the ground between them.
    fn layers(&mut self) {
        let written = &self.seepage.written;
        let mut ends = [0, 1].map(|a| vec![self.seepage.origin[a], self.end[a]]);
        for zone in &written.zones {
            match &zone.region {
                None => {}
                Some(Region::Layer(layer)) => {
                    let axis = layer.axis.map_or(1, Axis::index);
                    ends[axis].extend([layer.from, layer.to].into_iter().flatten());
                }
                Some(Region::Box(extent)) => {
                    let (from, to) = (extent.from.to_array(), extent.to.to_array());
                    for (a, ends) in ends.iter_mut().enumerate() {
                        ends.extend([from[a], to[a]]);
                    }
                }
            }
        }
        for (a, mut ends) in ends.into_iter().enumerate() {
            if ends.len() == 2 || self.idle == Some(a) {
                continue;
            }
            for end in &mut ends {
                *end = end.clamp(self.seepage.origin[a], self.end[a]);
            }
            ends.sort_by(f64::total_cmp);
            for pair in ends.windows(2) {
                let what = format!(
                    "{ZONE} from {} to {} m along {}",
                    number(pair[0]),
                    number(pair[1]),
                    ["x", "y"][a]
                );
                self.add(what, pair[1] - pair[0], a);
            }
        }
    }

    /// Adds the extents of drains and the ground around them.
    fn drains(&mut self) {
        let (origin, end, spacing) = (self.seepage.origin, self.end, self.seepage.spacing);
        for drain in &self.seepage.written.drains {
            if matches!(drain.condition, Condition::Discharge { .. }) {
                continue;
            }
            let (from, to) = (drain.region.from.to_array(), drain.region.to.to_array());
            for a in 0..2 {
                let (from, to) = (from[a].max(origin[a]), to[a].min(end[a]));
                if to - from > 0.5 * spacing[a] {
                    self.add(
                        format!("drain `{}` along {}", drain.name, ["x", "y"][a]),
                        to - from,
                        a,
                    );
                }
                self.add(
                    format!("ground before `{}`", drain.name),
                    from - origin[a],
                    a,
                );
                self.add(format!("ground behind `{}`", drain.name), end[a] - to, a);
            }
        }
    }

    /// Adds the depths of water in front of faces that it covers in part, and the capillary length.
    fn levels(&mut self) {
        let Some(soil) = self.soil() else { return };
        let (bottom, height, up) = (self.top() - self.height(), self.height(), self.up);
        let mut depths = Vec::new();
        for patch in self
            .seepage
            .patches
            .iter()
            .filter(|patch| patch.face.axis() != up)
        {
            let written = match patch.condition {
                Condition::Head { value } => Some(value),
                Condition::SeepageFace { level } => level,
                _ => continue,
            };
            let values = written
                .into_iter()
                .chain(patch.history.iter().map(|[_, value]| *value));
            for depth in values
                .map(|value| value - bottom)
                .filter(|depth| *depth < height)
            {
                depths.push((format!("depth of water before `{}`", patch.name), depth));
            }
        }
        for (what, depth) in depths {
            self.add(what, depth, up);
        }
        if !matches!(soil, Retention::SaturatedOnly(_)) && !self.stays_saturated() {
            // Not subject to the smallest size of other lengths: it may be small against the ground.
            let length = soil.model().capillary_length();
            self.found
                .push(("capillary length of the soil".into(), length, up));
        }
    }

    /// Adds the length over which water or pressure moves in the run.
    fn depths(&mut self, kind: &str) {
        let written = &self.seepage.written;
        let Some(soil) = written.unsaturated.as_ref() else {
            return;
        };
        let Some(transient) = &soil.transient else {
            return;
        };
        let end = self.scene.time.end;
        let axis = self.idle.map_or(self.up, |idle| 1 - idle);
        if [STORAGE, WELLS].contains(&kind) {
            if transient.specific_storage > 0.0 {
                let length = (self.conductivity * end / transient.specific_storage).sqrt();
                self.found.push((
                    "length over which pressure spreads in the run".into(),
                    length,
                    axis,
                ));
            }
            return;
        }
        let law = soil.retention.model();
        let yielding = law.state(0.0).content - law.residual_content();
        let patches = self.seepage.patches.iter();
        let fluxes = patches.map(|patch| {
            let of_history = patch
                .history
                .iter()
                .map(|[_, value]| *value)
                .fold(0.0, f64::max);
            match patch.condition {
                Condition::Flux { value } => value.max(of_history),
                Condition::Rain { rate } => rate.max(of_history),
                _ => f64::INFINITY,
            }
        });
        // A closed or wet end does not limit what enters; a column with a table and a flux has the flux.
        let limited: Vec<f64> = fluxes.filter(|flux| flux.is_finite()).collect();
        let flux = limited
            .into_iter()
            .reduce(f64::max)
            .unwrap_or(f64::INFINITY);
        let length = self.conductivity.min(flux) * end / yielding;
        if length.is_finite() && length > 0.0 {
            self.found
                .push(("length that water passes in the run".into(), length, axis));
        }
    }

    /// Returns the range of imposed and initial heads, and of suction and drawdown \[m\].
    fn range_of_heads(&self) -> f64 {
        let written = &self.seepage.written;
        let weight = written.density * self.strength();
        let elevation = |patch: &crate::scene::seepage::SeepagePatch| {
            let centre = self.seepage.centre(patch);
            -self.scene.gravity[self.up].signum() * centre[self.up]
        };
        let mut heads = Vec::new();
        for patch in &self.seepage.patches {
            let of_history = patch.history.iter().map(|[_, value]| *value);
            match patch.condition {
                Condition::Head { value } => heads.extend(of_history.chain([value])),
                Condition::Pressure { value } => {
                    let high = elevation(patch);
                    heads.extend(of_history.chain([value]).map(|value| value / weight + high));
                }
                Condition::SeepageFace { level } => {
                    let low = self.top() - self.height();
                    heads.extend(of_history.chain([level.unwrap_or(low)]));
                }
                // The surface may be wetted until it is saturated.
                Condition::Rain { .. } | Condition::Flux { .. } if self.soil().is_some() => {
                    heads.push(self.top());
                }
                _ => {}
            }
        }
        heads.extend(
            self.seepage
                .drains
                .iter()
                .filter_map(|drain| match drain.condition {
                    Condition::Head { value } => Some(value),
                    _ => None,
                }),
        );
        let transient = written
            .unsaturated
            .as_ref()
            .and_then(|s| s.transient.as_ref());
        match transient.map(|transient| transient.initial) {
            Some(InitialState::Head(head)) => heads.push(head),
            Some(InitialState::PressureHead(head)) => {
                heads.extend([head + self.top(), head + self.top() - self.height()])
            }
            _ => {}
        }
        let high = heads.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let low = heads.iter().copied().fold(f64::INFINITY, f64::min);
        let mut range = (high - low).max(0.0);
        if self.soil().is_some() && !self.stays_saturated() {
            range = range.max(self.height());
        }
        let pumped: f64 = (self.seepage.drains.iter())
            .map(|drain| match drain.condition {
                Condition::Discharge { value } => value.abs(),
                _ => 0.0,
            })
            .sum();
        if self.conductivity > 0.0 {
            range += pumped / self.conductivity;
        }
        range
    }
}
