//! Resolution of the probes of a scene.

use super::{Probe, ProbeAt, averaging_start, bed, due, seepage};
use crate::scene::aligned_box::AlignedBox;
use crate::scene::blocks::PlacedBlocks;
use crate::scene::bodies::NamedBody;
use crate::scene::findings::{Findings, number};
use crate::scene::grid::Grid;
use crate::scene::seepage::grid_of;
use crate::scene::structures::Structure;
use crate::scene::walls::SceneWall;
use crate::scene::{has_grains, unique};
use base::error::Remedy;
use case::Case;
use case::fluid::Fluid;
use case::geometry::{Axis, Extent, Face, Vector};
use case::observe::{Fabric, ProbeAt as Written};
use dem::contact::Contact;

/// Parts of a problem that probes refer to.
pub(crate) struct Measured<'a> {
    pub case: &'a Case,
    pub grid: &'a Grid,
    pub bodies: &'a [NamedBody],
    pub structures: &'a [Structure],
    pub walls: &'a [SceneWall],
    pub blocks: Option<&'a PlacedBlocks>,
}

/// Returns the probes of a case.
pub(crate) fn probes(measured: &Measured, findings: &mut Findings) -> Vec<Probe> {
    let case = measured.case;
    let mut known = Vec::new();
    let mut probes = Vec::new();
    for (n, probe) in case.probes.iter().enumerate() {
        let path = format!("probes[{n}]");
        unique(&mut known, &probe.name, &format!("{path}.name"), findings);
        due(case, probe.every, &format!("{path}.every"), findings);
        let path = format!("{path}.at");
        check_fluid(case, &probe.at, &path, findings);
        if let Some(at) = measured.resolve(&probe.at, &path, findings) {
            probes.push(Probe {
                name: probe.name.clone(),
                every: probe.every,
                at,
            });
        }
    }
    probes
}

/// Refuses a probe that samples a fluid which the case does not have.
fn check_fluid(case: &Case, at: &Written, path: &str, findings: &mut Findings) {
    if matches!(
        at,
        Written::Body { .. } | Written::Grains { .. } | Written::WallLoad { .. }
    ) {
        return;
    }
    if case.fluid.is_none() {
        findings.error(
            path,
            "this probe needs a fluid, but the case has none",
            "add `fluid`, or remove the probe",
        );
        findings.depends(&["fluid"]);
    }
    let of_pores = matches!(
        at,
        Written::Point { .. }
            | Written::Line { .. }
            | Written::Structure { .. }
            | Written::Crossing { .. }
            | Written::Heave { .. }
            | Written::Section { .. }
            | Written::WaterTable {}
            | Written::WaterBalance {}
            | Written::Uplift { .. }
    );
    let of_joints = matches!(
        at,
        Written::Joint { .. } | Written::Mouth { .. } | Written::Block { .. }
    );
    let in_joints = matches!(case.fluid, Some(Fluid::Joints(_)));
    let over_joints =
        matches!(&case.fluid, Some(Fluid::LatticeBoltzmann(water)) if water.joints.is_some());
    let suits = of_joints == in_joints || over_joints;
    if case.fluid.is_some() && !suits {
        findings.error(
            path,
            if in_joints {
                "this probe samples a fluid on grid cells, but this case has water in joints"
            } else {
                "this probe samples the water in joints (`fluid.joints`), but this case has another fluid"
            },
            if in_joints {
                "use `joint`, `mouth` or `block`"
            } else {
                "use a probe of this fluid"
            },
        );
        return;
    }
    if matches!(case.fluid, Some(Fluid::Darcy(_))) && !of_pores {
        findings.error(
            path,
            "this probe samples a fluid on a lattice, but this case has seepage",
            "use a point, a line, a section, or `output.fluid`, which has the pressure and velocity of every cell",
        );
    }
}

impl Measured<'_> {
    /// Returns the location of a probe; reports a finding and returns none if there is nothing to measure.
    fn resolve(&self, at: &Written, path: &str, findings: &mut Findings) -> Option<ProbeAt> {
        Some(match at {
            Written::Point { position } => {
                self.point(position, &format!("{path}.point.position"), findings)
            }
            Written::Line { from, to, points } => {
                self.line([from, to], *points, &format!("{path}.line"), findings)
            }
            Written::Plane { axis, position } => {
                self.plane(*axis, *position, &format!("{path}.plane"), findings)
            }
            Written::Body { name } => self.body(name, &format!("{path}.body.name"), findings),
            Written::Structure { name, about } => {
                let path = format!("{path}.structure");
                ProbeAt::Structure {
                    index: self.structure(name, &format!("{path}.name"), findings),
                    about: self.about(about.as_ref(), &path, findings),
                }
            }
            Written::WallLoad { name, about } => {
                let path = format!("{path}.wall_load");
                ProbeAt::WallLoad {
                    wall: self.loaded_wall(name, &path, findings),
                    about: self.about(about.as_ref(), &path, findings),
                }
            }
            Written::Crossing { from, to } => {
                let path = format!("{path}.crossing");
                seepage::crossing((self.case, self.grid), [from, to], &path, findings)
            }
            Written::Heave {
                prism,
                at,
                submerged_weight,
            } => {
                let path = format!("{path}.heave");
                seepage::heave(
                    (self.case, self.grid),
                    prism,
                    (*at, *submerged_weight),
                    &path,
                    findings,
                )?
            }
            Written::Section {
                axis,
                position,
                part,
            } => {
                let path = format!("{path}.section");
                self.section(*axis, *position, part.as_ref(), &path, findings)
            }
            Written::WaterTable {} => self.water_table(&format!("{path}.water_table"), findings),
            Written::Joint { position } => {
                let path = format!("{path}.joint.position");
                let point = AlignedBox::vector(self.grid, position, &path, findings);
                ProbeAt::Joint(self.inside(point, &path, findings))
            }
            Written::Mouth { name } => self.mouth(name, &format!("{path}.mouth.name"), findings),
            Written::Block { position } => {
                self.block(position, &format!("{path}.block.position"), findings)
            }
            Written::WaterBalance {} => {
                self.water_balance(&format!("{path}.water_balance"), findings)
            }
            Written::Uplift {
                axis,
                position,
                part,
                about,
            } => {
                let path = format!("{path}.uplift");
                let about = self.about(about.as_ref(), &path, findings);
                match self.section(*axis, *position, part.as_ref(), &path, findings) {
                    ProbeAt::Section {
                        axis,
                        position,
                        part,
                    } => ProbeAt::Uplift {
                        axis,
                        position,
                        part,
                        about,
                    },
                    other => other,
                }
            }
            Written::Gauge { position } => {
                self.gauge(position, &format!("{path}.gauge.position"), findings)
            }
            Written::Wall { face } => self.wall(*face, &format!("{path}.wall.face"), findings),
            Written::Grains(written) => self.grains(written, &format!("{path}.grains"), findings),
            Written::Bed(written) => {
                let path = format!("{path}.bed");
                let bed = bed::resolve(self.case, self.grid, written, &path, findings)?;
                ProbeAt::Bed(Box::new(bed))
            }
        })
    }

    /// Returns the reference point of a torque \[m\].
    fn about(&self, about: Option<&Vector>, path: &str, findings: &mut Findings) -> [f64; 3] {
        about.map_or([0.0; 3], |about| {
            AlignedBox::vector(self.grid, about, &format!("{path}.about"), findings)
        })
    }

    /// Returns a point; reports a finding if it lies outside the domain or in a structure.
    fn inside(&self, point: [f64; 3], path: &str, findings: &mut Findings) -> [f64; 3] {
        seepage::inside(self.grid, point, path, findings)
    }

    fn line(
        &self,
        ends: [&Vector; 2],
        points: u32,
        path: &str,
        findings: &mut Findings,
    ) -> ProbeAt {
        let [from, to] = [("from", ends[0]), ("to", ends[1])].map(|(name, end)| {
            let path = format!("{path}.{name}");
            let point = AlignedBox::vector(self.grid, end, &path, findings);
            self.inside(point, &path, findings)
        });
        ProbeAt::Line {
            from,
            to,
            points: usize::try_from(points).unwrap_or(usize::MAX),
        }
    }

    /// Returns the water balance; reports a finding if the flow does not change with time.
    fn water_balance(&self, path: &str, findings: &mut Findings) -> ProbeAt {
        let transient = match &self.case.fluid {
            Some(Fluid::Darcy(written)) => written.unsaturated.as_ref(),
            _ => None,
        };
        if transient.is_none_or(|soil| soil.transient.is_none()) {
            findings.error(
                path,
                "a water balance needs transient seepage, but this case has none",
                "add `fluid.darcy.unsaturated.transient`, or use a section",
            );
        }
        ProbeAt::WaterBalance
    }

    fn point(&self, position: &Vector, path: &str, findings: &mut Findings) -> ProbeAt {
        let point = AlignedBox::vector(self.grid, position, path, findings);
        let holds = |s: &&Structure| s.stops.water() && s.solid.distance(point) < 0.0;
        if let Some(structure) = self.structures.iter().find(holds) {
            findings.error(
                path,
                format!("the point lies in the structure `{}`", structure.name),
                "move it into the water",
            );
        }
        ProbeAt::Point(self.inside(point, path, findings))
    }

    fn gauge(&self, position: &Vector, path: &str, findings: &mut Findings) -> ProbeAt {
        let point = AlignedBox::vector(self.grid, position, path, findings);
        let surface = match &self.case.fluid {
            Some(Fluid::LatticeBoltzmann(lbm)) => lbm.surface.is_some(),
            _ => false,
        };
        if !surface {
            findings.error(
                path,
                "a gauge measures a free surface, but this case has none",
                "add `fluid.lattice_boltzmann.surface`, or use a point",
            );
        }
        let point = self.inside(point, path, findings);
        let cell = |a: usize| {
            let place = base::number::whole((point[a] / self.grid.spacing).floor());
            place.min(self.grid.cells[a] - 1)
        };
        ProbeAt::Gauge([cell(0), cell(1), cell(2)])
    }

    /// Returns the columns of a water table; reports a finding without unsaturated ground or without an axis of
    /// gravity.
    fn water_table(&self, path: &str, findings: &mut Findings) -> ProbeAt {
        let written = match &self.case.fluid {
            Some(Fluid::Darcy(written)) => written.unsaturated.as_ref().map(|_| written),
            _ => None,
        };
        let gravity = (self.case.gravity.as_ref()).map_or([0.0; 3], Vector::to_array);
        let steepest = gravity.map(f64::abs).into_iter().fold(0.0, f64::max);
        let pulls = |a: &usize| gravity[*a].abs() > 1e-9 * steepest;
        if written.is_none() {
            findings.error(
                path,
                "a water table needs unsaturated ground, but this case has none",
                "add `fluid.darcy.unsaturated`, or use a point or a gauge",
            );
        } else if (0..3).filter(pulls).count() > 1 {
            findings.error(
                path,
                "a water table is determined along columns of cells, but gravity does not point along an axis",
                "use points, or the field `pressure` of `output.fluid`",
            );
        }
        let axis = (0..3).find(pulls).unwrap_or(0);
        let coarse = written.and_then(|_| grid_of(self.case, self.grid));
        let all = coarse.map_or(self.grid.cells, |coarse| coarse.cells);
        let cells = |a: usize| all[a];
        ProbeAt::WaterTable((0..3).filter(|a| *a != axis).map(cells).product())
    }

    fn plane(&self, axis: Axis, position: f64, path: &str, findings: &mut Findings) -> ProbeAt {
        let (grid, axis) = (self.grid, axis.index());
        if axis >= grid.dimension {
            findings.error(
                &format!("{path}.axis"),
                "there is no z in a 2-D problem",
                "use x or y",
            );
        } else if !(0.0..=grid.size[axis]).contains(&position) {
            findings.error(
                &format!("{path}.position"),
                format!(
                    "the plane lies outside the domain, which is 0 … {} m along this axis",
                    number(grid.size[axis])
                ),
                "move it inside",
            );
        }
        ProbeAt::Plane { axis, position }
    }

    fn body(&self, name: &str, path: &str, findings: &mut Findings) -> ProbeAt {
        let index = self.bodies.iter().position(|b| b.name == name);
        if index.is_none() {
            let names: Vec<&str> = self.bodies.iter().map(|b| b.name.as_str()).collect();
            let remedy = case::check::nearest(name, &names).map_or_else(
                || match names[..] {
                    [] => "add the body to `bodies`, or remove the probe".into(),
                    _ => format!("bodies here: {}", names.join(", ")).into(),
                },
                |near| Remedy::from(format!("did you mean `{near}`?")).set(path, near),
            );
            findings.error(path, "there is no body with this name", remedy);
            findings.depends(&["bodies"]);
        }
        ProbeAt::Body(index.unwrap_or(0))
    }

    fn structure(&self, name: &str, path: &str, findings: &mut Findings) -> usize {
        let water = self.structures.iter().filter(|s| s.stops.water());
        let names: Vec<&str> = water.map(|s| s.name.as_str()).collect();
        let index = names.iter().position(|known| *known == name);
        if index.is_none() {
            findings.error(
                path,
                "no structure with this name stops water",
                if names.is_empty() {
                    "add a structure to `structures` that stops water".to_owned()
                } else {
                    format!("use one of: {}", names.join(", "))
                },
            );
            findings.depends(&["structures"]);
        }
        index.unwrap_or(0)
    }

    /// Returns the index of a wall that grains load.
    fn loaded_wall(&self, name: &str, path: &str, findings: &mut Findings) -> usize {
        if matches!(self.case.contact, Some(Contact::Blocks(_))) {
            findings.error(
                path,
                "the law `blocks` has contacts over areas, and the run does not record their shear forces",
                "use another law, or remove the probe",
            );
        }
        let case = self.case;
        if case.grains.is_none()
            && case.blocks.is_none()
            && case.bodies.is_empty()
            && case.regions.is_empty()
        {
            findings.error(
                path,
                "there are no grains and no bodies that could load a wall",
                Remedy::from("add `grains`, or remove the probe"),
            );
            findings.depends(&["grains", "bodies"]);
        }
        let lasting = |wall: &SceneWall| wall.name == name && !wall.temporary;
        let index = self.walls.iter().position(lasting);
        if index.is_none() {
            let names: Vec<&str> = self.walls.iter().map(|wall| wall.name.as_str()).collect();
            let path = format!("{path}.name");
            let remedy = case::check::nearest(name, &names).map_or_else(
                || match (
                    Face::ALL
                        .iter()
                        .find(|face| face.name() == name && !self.grid.periodic[face.axis()]),
                    names.is_empty(),
                ) {
                    (Some(face), _) => {
                        let mut closed = case.box_walls.clone();
                        closed.push(*face);
                        Remedy::from(format!("add \"{name}\" to `box_walls`"))
                            .set("box_walls", serde_json::json!(closed))
                    }
                    (None, true) => {
                        "add the wall to `walls` or a face to `box_walls`, or remove the probe"
                            .into()
                    }
                    (None, false) => format!("walls here: {}", names.join(", ")).into(),
                },
                |near| Remedy::from(format!("did you mean `{near}`?")).set(&*path, near),
            );
            findings.error(
                &path,
                "no wall, structure or closed face with this name stops grains during the run",
                remedy,
            );
            findings.depends(&["walls", "box_walls", "structures"]);
        }
        index.unwrap_or(0)
    }

    fn mouth(&self, name: &str, path: &str, findings: &mut Findings) -> ProbeAt {
        let mouths = match &self.case.fluid {
            Some(Fluid::Joints(written)) => written.mouths.as_slice(),
            _ => &[],
        };
        let index = mouths.iter().position(|mouth| mouth.name == name);
        if index.is_none() {
            let known: Vec<&str> = mouths.iter().map(|mouth| mouth.name.as_str()).collect();
            findings.error(
                path,
                "there is no mouth with this name",
                match known[..] {
                    [] => "add the mouth to `fluid.joints.mouths`, or remove the probe".to_owned(),
                    _ => format!("use one of: {}", known.join(", ")),
                },
            );
        }
        ProbeAt::Mouth(index.unwrap_or(0))
    }

    /// Returns the block that contains a point.
    fn block(&self, position: &Vector, path: &str, findings: &mut Findings) -> ProbeAt {
        let point = AlignedBox::vector(self.grid, position, path, findings);
        let holds = |solid: &dem::polyhedron::PlacedPolyhedron| {
            let planes = solid.half_spaces();
            planes
                .iter()
                .all(|plane| plane.height(&point.into()) <= 0.0)
        };
        let blocks = self.blocks.iter().flat_map(|blocks| &blocks.list);
        let mut blocks = blocks.map(|block| &block.solid);
        let index = blocks.position(holds);
        if index.is_none() && self.blocks.is_some() {
            findings.error(
                path,
                "no block contains this point",
                "use a point inside a block, such as its centroid",
            );
        }
        ProbeAt::Block(index.unwrap_or(0))
    }

    fn section(
        &self,
        axis: Axis,
        position: f64,
        part: Option<&Extent>,
        path: &str,
        findings: &mut Findings,
    ) -> ProbeAt {
        let grid = self.grid;
        if matches!(self.case.fluid, Some(Fluid::LatticeBoltzmann(_))) {
            findings.error(
                path,
                "a section measures seepage, but this fluid is computed on a lattice",
                "use a plane",
            );
        }
        self.plane(axis, position, path, findings);
        let axis = axis.index();
        let part = part.map(|part| AlignedBox {
            from: AlignedBox::vector(grid, &part.from, &format!("{path}.part.from"), findings),
            to: AlignedBox::vector(grid, &part.to, &format!("{path}.part.to"), findings),
            dimension: grid.dimension,
        });
        if let Some(part) = &part {
            self.check_part(axis, part, path, findings);
        }
        ProbeAt::Section {
            axis,
            position,
            part,
        }
    }

    /// Refuses a part of a plane across an axis that contains nothing of the domain.
    fn check_part(&self, axis: usize, part: &AlignedBox, path: &str, findings: &mut Findings) {
        let grid = self.grid;
        let others = (0..grid.dimension).filter(|a| *a != axis);
        let misses = |a: &usize| {
            let (low, high) = (part.from[*a].max(0.0), part.to[*a].min(grid.size[*a]));
            low.partial_cmp(&high) != Some(std::cmp::Ordering::Less)
        };
        if let Some(a) = others.into_iter().find(misses) {
            findings.error(
                &format!("{path}.part"),
                format!(
                    "the part from {} to {} m along {} contains nothing of the domain, which is 0 … {} m there",
                    number(part.from[a]),
                    number(part.to[a]),
                    ["x", "y", "z"][a],
                    number(grid.size[a])
                ),
                "move it into the domain, or leave `part` out for the whole plane",
            );
        }
    }

    fn wall(&self, face: Face, path: &str, findings: &mut Findings) -> ProbeAt {
        if face.axis() >= self.grid.dimension || self.grid.periodic[face.axis()] {
            findings.error(path, "there is no wall at this face", "choose another face");
        }
        ProbeAt::Wall(face)
    }

    fn grains(&self, written: &Fabric, path: &str, findings: &mut Findings) -> ProbeAt {
        let (case, grid) = (self.case, self.grid);
        if !has_grains(case) {
            findings.error(
                path,
                "there are no grains in this case",
                "add `grains`, or remove the probe",
            );
        }
        if matches!(case.contact, Some(Contact::Blocks(_))) {
            findings.error(
                path,
                "the law `blocks` has contacts over areas, for which a stress from point forces and a number of \
                 contacts have no meaning",
                "use another law, or remove the probe",
            );
        }
        ProbeAt::Grains {
            part: match &written.part {
                Some(part) => AlignedBox::resolve(grid, part, &format!("{path}.part"), findings),
                None => AlignedBox {
                    from: [0.0; 3],
                    to: grid.size,
                    dimension: grid.dimension,
                },
            },
            mean_from: averaging_start(case, written.mean_from, path, findings),
        }
    }
}
