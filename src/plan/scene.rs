//! Resolved problem: checked, complete, equal on every rank, without state.
//!
//! Names are replaced by indices, boxes by cells, and missing choices by their defaults. Numbers are in SI.
//! [`crate`] derives time steps, memory and stability.

pub mod aligned_box;
pub mod auto;
pub(crate) mod blocked;
pub mod blocks;
pub mod bodies;
pub mod body_force;
pub mod boundaries;
pub mod collapse;
pub mod contact;
pub mod element_test;
pub mod findings;
pub mod flow;
pub mod free_surface;
pub mod grading;
pub mod grains;
pub(crate) mod gravity;
pub mod grid;
pub mod initial;
pub mod joint_methods;
pub mod joints;
pub(crate) mod machine;
mod motion;
pub mod observe;
mod overlaps;
pub(crate) mod packed;
pub(crate) mod pairs;
pub mod profile;
mod region;
pub mod rock;
pub mod rounding;
pub mod sample;
pub(crate) mod saved;
pub mod seepage;
pub(crate) mod speed;
pub(crate) mod stl;
pub mod structures;
pub mod terms;
pub mod walls;

use base::error::{Problem, Remedy, Report};
use base::geometry::Face;
use case::Case;
use case::coupling::Coupling;
use case::fluid::Fluid;
use case::observe::{Action, Output};
use case::solids;
use case::time::{Checkpoint, Guards, SolidSteps, Time};
use dem::contact::{blocks as law_of_blocks, linear};
use dem::polyhedron::PlacedPolyhedron;
use findings::Findings;
use serde::Serialize;

/// The resolved problem.
#[derive(Clone, Debug, Serialize)]
pub struct Scene {
    /// One line that names the run.
    pub title: String,
    /// Grid of cells.
    pub grid: grid::Grid,
    /// Acceleration of gravity [m/s2].
    pub gravity: [f64; 3],
    /// Materials; other parts of the scene refer to them by index.
    pub materials: Vec<Material>,
    /// The fluid, if any.
    pub flow: Option<flow::Flow>,
    /// The free surface of the fluid, if any.
    pub surface: Option<free_surface::FreeSurface>,
    /// The seepage, if any. A scene has at most one fluid.
    pub seepage: Option<seepage::Seepage>,
    /// The water in the joints between blocks, if it is the fluid.
    pub joints: Option<joints::JointScene>,
    /// Methods for the joints under a lattice, if the case has any.
    pub joint_methods: Option<joint_methods::JointMethods>,
    /// The grains, if any.
    pub grains: Option<grains::Grains>,
    /// The blocks, if any.
    pub blocks: Option<blocks::PlacedBlocks>,
    /// The contact law, if contacts are possible.
    pub contact: Option<contact::ContactTable>,
    /// Structures, in the order of the case.
    pub structures: Vec<structures::Structure>,
    /// Terms of the step of a fluid on a lattice, such as porous zones.
    pub terms: Vec<terms::SceneTerm>,
    /// Walls of grains: those of the case, of the structures, and on faces of the domain.
    pub walls: Vec<walls::SceneWall>,
    /// Named bodies.
    pub bodies: Vec<bodies::NamedBody>,
    /// The coupling, if there are fluid and solids.
    pub coupling: Option<Coupling>,
    /// Duration and steps, as written.
    pub time: Time,
    /// Regions.
    pub regions: Vec<observe::ObservedRegion>,
    /// Probes.
    pub probes: Vec<observe::Probe>,
    /// Outputs, as written.
    pub output: Output,
    /// Checkpoints, as written.
    pub checkpoint: Checkpoint,
    /// Guards, as written.
    pub guards: Guards,
    /// Erosion law analysis.
    pub erosion_law: Option<observe::ErosionLaw>,
    /// Analysis of ground collapse.
    pub ground_collapse: Option<collapse::GroundCollapse>,
    /// Element test of a sample between walls.
    pub element_test: Option<element_test::ElementTest>,
    /// The automatic choices and their reasons.
    pub chosen: auto::Chosen,
    /// Causes of density changes in the lattice fluid in addition to the pressures stated in the case.
    pub density_causes: Vec<auto::density::Cause>,
}

/// A material.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Material {
    /// Name of the material.
    pub name: String,
    /// Density [kg/m3]; required for free motion.
    pub density: Option<f64>,
}

/// The solids of a scene, and the law of their contacts.
struct Solids {
    structures: Vec<structures::Structure>,
    walls: Vec<walls::SceneWall>,
    bodies: Vec<bodies::NamedBody>,
    grains: Option<grains::Grains>,
    contact: Option<contact::ContactTable>,
    blocks: Option<blocks::PlacedBlocks>,
}

impl Solids {
    /// Resolves the solids of a case.
    fn resolve(
        case: &Case,
        grid: &grid::Grid,
        names: &[String],
        flow: Option<&flow::Flow>,
        findings: &mut Findings,
    ) -> Self {
        let structures = structures::structures(case, grid, names, findings);
        if let Some(flow) = flow {
            structures::water(grid, &structures, flow, findings);
        }
        let walls = walls::walls(case, grid, names, &structures, findings);
        let bodies = bodies::bodies(case, grid, names, findings);
        let grains = grains::grains(case, grid, names, findings);
        let contact = contact::ContactTable::resolve(
            case,
            grains.as_ref(),
            auto::solids::in_saturated_cells(case),
            findings,
        );
        contact::warn_of_friction(case, findings);
        Self {
            structures,
            walls,
            bodies,
            grains,
            contact,
            blocks: blocks::blocks(case, grid, names, findings),
        }
    }

    /// Checks the places of the solids, and with a gravity also those at the start, unless what places them is wrong.
    fn check(
        &self,
        case: &Case,
        grid: &grid::Grid,
        start: Option<[f64; 3]>,
        findings: &mut Findings,
    ) {
        const PLACES: [&str; 6] = [
            "domain",
            "structures",
            "walls",
            "bodies",
            "grains",
            "blocks",
        ];
        if !findings.wrong_in(&PLACES) {
            self.check_water(case, grid, findings);
        }
        if let Some(gravity) = start.filter(|_| !findings.wrong_in(&PLACES)) {
            self.check_start(case, grid, gravity, findings);
        }
    }

    /// Checks walls in the water.
    fn check_water(&self, case: &Case, grid: &grid::Grid, findings: &mut Findings) {
        let fixed = |body: &&bodies::NamedBody| body.mobility == bodies::Mobility::Fixed;
        let bodies = self.bodies.iter().filter(fixed);
        let bodies = bodies.filter_map(|body| body.solid.as_ref());
        let blocks = self.blocks.iter().flat_map(|blocks| &blocks.list);
        let blocks = blocks.filter(|block| block.fixed);
        let fixed: Vec<&PlacedPolyhedron> =
            bodies.chain(blocks.map(|block| &block.solid)).collect();
        let solids = (self.structures.as_slice(), fixed.as_slice());
        walls::walls_in_water(case, grid, &self.walls, solids, findings);
    }

    /// Refuses a case whose solids overlap at the start.
    fn check_start(
        &self,
        case: &Case,
        grid: &grid::Grid,
        gravity: [f64; 3],
        findings: &mut Findings,
    ) {
        let start = overlaps::Start {
            case,
            grid,
            gravity,
            grains: self.grains.as_ref(),
            blocks: self.blocks.as_ref(),
            bodies: &self.bodies,
            walls: &self.walls,
            structures: &self.structures,
        };
        overlaps::overlaps(&start, findings);
    }
}

/// Polyhedron of a scene, a body or a block.
#[derive(Clone, Copy, Debug)]
pub struct ScenePolyhedron<'a> {
    /// Shape in its initial position.
    pub solid: &'a PlacedPolyhedron,
    /// Index of the material.
    pub material: usize,
    /// `true` if it moves under forces.
    pub free: bool,
}

impl Scene {
    /// Resolves a case; returns the scene and warnings.
    ///
    /// # Errors
    /// If the case has errors; all findings are returned, warnings included.
    pub fn resolve(case: &Case) -> Result<(Self, Vec<Problem>), Vec<Problem>> {
        match Self::resolve_findings(case, None, &[]) {
            (Some(scene), findings) if !findings.refused() => Ok((scene, findings.problems)),
            (_, findings) => Err(findings.problems),
        }
    }

    /// Returns the scene as far as it can be resolved, with all findings. If the case continues the state of
    /// another scene `like`, fields that both leave out are chosen as in that scene. `wrong` has the paths of
    /// fields that the schema refuses.
    pub(crate) fn resolve_findings<'a>(
        case: &'a Case,
        like: Option<&Self>,
        wrong: &[String],
    ) -> (Option<Self>, Findings<'a>) {
        let mut findings = Findings::with_wrong(case, wrong);
        if let Some(like) = like {
            let spacing = auto::spacing::Spacing::of_scene(like);
            return Self::resolve_at(case, &spacing, Some(like), findings);
        }
        // A spacing chosen from wrong fields would cause further findings.
        if case.domain.spacing.is_none() && findings.stop_plan() {
            return (None, findings);
        }
        let Some(spacing) = auto::spacing::first(case, &mut findings) else {
            return (None, findings);
        };
        let (scene, findings) = Self::resolve_at(case, &spacing, None, findings);
        if findings.stopped {
            return (scene, findings);
        }
        // Shapes are known before velocities: a fast flow may require finer cells than the shapes. The cells of a
        // seepage follow from its lengths and answers.
        let first = scene.as_ref();
        match first.and_then(|scene| {
            if scene.seepage.is_some() {
                auto::ground::promised_spacing(case, scene)
            } else {
                auto::spacing::finer_spacing(case, scene)
            }
        }) {
            Some(other) => Self::resolve_at(case, &other, None, Findings::with_wrong(case, wrong)),
            None => (scene, findings),
        }
    }

    /// Resolves a case at a given spacing, with the choices that it leaves to the program.
    fn resolve_at<'a>(
        written: &Case,
        spacing: &auto::spacing::Spacing,
        like: Option<&Self>,
        mut findings: Findings<'a>,
    ) -> (Option<Self>, Findings<'a>) {
        let mut chosen = auto::Chosen::default();
        spacing.note(&mut chosen);
        spacing.warn_of_rounding(written, &mut findings);
        let case = &*auto::with_choices(written, spacing, &mut chosen);
        // A restarted run has no initial state to check.
        let starts = like.is_none();
        let Some(mut scene) = Self::with_spacing(case, starts, &mut findings) else {
            return (None, findings);
        };
        scene.chosen = chosen;
        // A finer spacing may resolve a refusal by the choices below, but not an error found before them.
        findings.stopped = findings.stop_plan();
        if findings.stopped {
            return (Some(scene), findings);
        }
        match like {
            Some(like) => {
                auto::keep_choices(&mut scene, (case, written), like, &mut findings);
                scene.forget_sample();
            }
            None => auto::choose_remaining(&mut scene, case, written, &mut findings),
        }
        log::debug!(
            "scene: cells {:?} of {} m, {} materials, {} bodies, \
             {} blocks, {} walls, {} regions, {} probes, {} findings",
            scene.grid.cells,
            scene.grid.spacing,
            scene.materials.len(),
            scene.bodies.len(),
            scene.blocks.as_ref().map_or(0, |blocks| blocks.number),
            scene.walls.len(),
            scene.regions.len(),
            scene.probes.len(),
            findings.problems.len()
        );
        (Some(scene), findings)
    }

    /// Resolves a case with a given spacing, before the program chooses the fields that the case leaves out.
    fn with_spacing(case: &Case, starts: bool, findings: &mut Findings) -> Option<Self> {
        let grid = grid::Grid::resolve(&case.domain, findings)?;
        let gravity = case.gravity.as_ref().map_or([0.0; 3], |g| {
            aligned_box::AlignedBox::vector(&grid, g, "gravity", findings)
        });
        gravity::check_size(gravity, findings);
        let names: Vec<String> = case.materials.keys().cloned().collect();
        let materials = case.materials.iter().map(|(name, material)| Material {
            name: name.clone(),
            density: material.density,
        });
        let materials = materials.collect();
        let flow = flow::Flow::resolve(case, &grid, findings);
        let surface = flow
            .as_ref()
            .and_then(|flow| free_surface::resolve(case, &grid, &flow.faces, findings));
        let solids = Solids::resolve(case, &grid, &names, flow.as_ref(), findings);
        solids.check(case, &grid, starts.then_some(gravity), findings);
        let (grains, structures) = (solids.grains.as_ref(), &solids.structures);
        if let Some(flow) = flow.as_ref().filter(|_| surface.is_none()) {
            let obstacles = blocked::Obstacles {
                structures,
                bodies: &solids.bodies,
                blocks: solids.blocks.as_ref(),
            };
            let discs =
                grid.dimension == 2 && solids.bodies.iter().all(|body| body.solid.is_none());
            let sealed = discs || !auto::solids::in_saturated_cells(case);
            let pockets = sealed.then_some(blocked::Pockets {
                end: case.time.end,
                max_compression: case.guards.max_compression,
            });
            blocked::check(flow, &grid, &obstacles, pockets, findings);
        }
        let seepage = seepage::Seepage::resolve(case, &grid, grains, structures, findings);
        let rock = (solids.blocks.as_ref(), solids.contact.as_ref());
        let joints = joints::JointScene::resolve(case, &grid, rock, flow.as_ref(), findings);
        let joint_methods = joint_methods::JointMethods::resolve(case, &grid, rock.0);
        let terms = terms::resolve(case, &grid, surface.is_some(), findings);
        let regions = observe::regions(case, &grid, (&names, structures), findings);
        let measured = observe::Measured {
            case,
            grid: &grid,
            bodies: &solids.bodies,
            structures,
            walls: &solids.walls,
            blocks: solids.blocks.as_ref(),
        };
        let probes = observe::probes(&measured, findings);
        let element_test = element_test::resolve(case, &probes, &solids.walls, findings);
        let erosion_law = observe::erosion_law(case, &grid, &regions, findings);
        let ground_collapse = collapse::resolve(case, &grid, gravity, &regions, findings);
        let solid = has_solids(case);
        observe::outputs(case, solid, findings);
        check_agreement(case, findings);
        saved::names(case, findings);
        findings.drop_consequences();
        if findings.refused()
            && (case.fluid.is_some() && flow.is_none() && seepage.is_none() && joints.is_none()
                || case.grains.is_some() && solids.grains.is_none()
                || case.blocks.is_some() && solids.blocks.is_none())
        {
            return None;
        }
        Some(Self {
            title: case.title.clone(),
            grid,
            gravity,
            materials,
            flow,
            surface,
            seepage,
            joints,
            joint_methods,
            grains: solids.grains,
            blocks: solids.blocks,
            contact: solids.contact,
            structures: solids.structures,
            terms,
            walls: solids.walls,
            bodies: solids.bodies,
            coupling: case.coupling.clone().filter(|_| solid),
            time: case.time.clone(),
            regions,
            probes,
            output: case.output.clone(),
            checkpoint: case.checkpoint.clone(),
            guards: case.guards.clone(),
            erosion_law,
            ground_collapse,
            element_test,
            density_causes: Vec::new(),
            chosen: auto::Chosen::default(),
        })
    }

    /// Returns `true` if each grain stores its initial position: if [`Self::follows_grains`] requires it, and for the
    /// erosion law.
    #[must_use]
    pub fn marks_start(&self) -> bool {
        self.follows_grains() || self.erosion_law.is_some()
    }

    /// Returns `true` if an output or analysis requires the initial position of each grain.
    #[must_use]
    pub fn follows_grains(&self) -> bool {
        let written = self.output.grains.as_ref();
        self.ground_collapse.is_some()
            || self.output.blocks.is_some()
            || written.is_some_and(|grains| grains.displacement)
    }

    /// Returns the id of the first grain: the named bodies come first, then the blocks.
    #[must_use]
    pub fn first_grain(&self) -> u64 {
        (self.bodies.len() + self.blocks.as_ref().map_or(0, |blocks| blocks.number)) as u64
    }

    /// Returns `true` for the lower and the upper face of each axis through which free solids leave the domain: the
    /// water has an opening there, or there is no water but that in joints, and the face has no wall.
    #[must_use]
    pub fn exits(&self) -> [[bool; 2]; 3] {
        let mut exits = [[false; 2]; 3];
        if self.flow.is_none() && self.joints.is_none() {
            return exits;
        }
        for face in Face::ALL {
            let open = self.flow.as_ref().is_none_or(|flow| {
                let mut patches = flow.faces[face.index()].iter();
                patches.any(|patch| patch.condition.model().passes_water())
            });
            let closed = self.walls.iter().any(|wall| wall.face == Some(face));
            exits[face.axis()][usize::from(face.is_max())] = open && !closed;
        }
        exits
    }

    /// Returns `true` if free solids are removed when they have left the domain for good. The network of joints needs
    /// all blocks: one that left flies on.
    #[must_use]
    pub fn removes_leaving(&self) -> bool {
        self.joints.is_none()
    }

    /// Returns all polyhedra in the order of their ids, bodies before blocks.
    pub fn polyhedra(&self) -> impl Iterator<Item = ScenePolyhedron<'_>> {
        let bodies = self.bodies.iter().filter_map(|body| {
            Some(ScenePolyhedron {
                solid: body.solid.as_ref()?,
                material: body.material,
                free: body.mobility == bodies::Mobility::Free,
            })
        });
        let blocks = self.blocks.iter().flat_map(|blocks| &blocks.list);
        bodies.chain(blocks.map(|block| ScenePolyhedron {
            solid: &block.solid,
            material: block.material,
            free: !block.fixed,
        }))
    }

    /// Returns the polyhedron of this id in its initial position.
    #[must_use]
    pub fn polyhedron(&self, id: u64) -> Option<&PlacedPolyhedron> {
        let place = usize::try_from(id).ok()?;
        if let Some(body) = self.bodies.get(place) {
            return body.solid.as_ref();
        }
        let blocks = self.blocks.as_ref()?;
        let block = blocks.list.get(place - self.bodies.len());
        block.map(|block| &block.solid)
    }

    /// Returns `true` if bodies, grains or blocks move.
    #[must_use]
    pub fn moves_solids(&self) -> bool {
        let moves = |body: &bodies::NamedBody| body.mobility != bodies::Mobility::Fixed;
        let loose = |blocks: &blocks::PlacedBlocks| blocks.fixed < blocks.number;
        self.grains.is_some()
            || self.bodies.iter().any(moves)
            || self.blocks.as_ref().is_some_and(loose)
            || self.generates_grains()
    }

    /// Returns `true` if regions generate grains.
    fn generates_grains(&self) -> bool {
        let feeds = |region: &observe::ObservedRegion| {
            matches!(region.action, observe::RegionAction::Generate { .. })
        };
        self.regions.iter().any(feeds)
    }

    /// Returns `true` if there are solids.
    #[must_use]
    pub fn has_solids(&self) -> bool {
        self.grains.is_some()
            || self.blocks.is_some()
            || !self.bodies.is_empty()
            || self.generates_grains()
    }

    /// Frees the listed grains once the run contains them; each takes some hundred bytes.
    pub fn forget_sample(&mut self) {
        use grains::GrainSource::{File, List};
        if let Some(List(grains) | File { grains, .. }) =
            self.grains.as_mut().map(|grains| &mut grains.source)
        {
            *grains = Vec::new();
        }
    }

    /// Returns the density of a material [kg/m³]; zero if it has none.
    #[must_use]
    pub fn density(&self, material: usize) -> f64 {
        let known = self.materials.get(material);
        known.and_then(|m| m.density).unwrap_or(0.0)
    }

    /// Returns the mass \[kg\] of a disc (per metre of depth) or sphere of this material.
    #[must_use]
    pub fn mass(&self, material: usize, radius: f64) -> f64 {
        let density = self.density(material);
        let pi = std::f64::consts::PI;
        if self.grid.dimension == 2 {
            density * pi * radius * radius
        } else {
            density * 4.0 / 3.0 * pi * radius.powi(3)
        }
    }
}

fn has_solids(case: &Case) -> bool {
    has_grains(case) || case.blocks.is_some() || !case.bodies.is_empty()
}

/// Returns `true` if the case has grains at the start or generates grains.
pub(crate) fn has_grains(case: &Case) -> bool {
    case.grains.is_some() || feeds(case).next().is_some()
}

/// Returns the materials of the regions that generate grains, if stated.
fn feeds(case: &Case) -> impl Iterator<Item = Option<&String>> {
    case.regions
        .iter()
        .filter_map(|region| match &region.action {
            Action::Generate { material, .. } => Some(material.as_ref()),
            _ => None,
        })
}

/// Checks that the parts of a case fit each other.
fn check_agreement(case: &Case, findings: &mut Findings) {
    let solid = has_solids(case);
    let fluid = case.fluid.is_some();
    if !solid && !fluid {
        findings.error(
            "fluid",
            "this case has neither a fluid nor solids",
            "add `fluid`, `grains` or `blocks`",
        );
    }
    if case.coupling.is_some() && !fluid {
        findings.error(
            "coupling",
            "there is no fluid in this case",
            Remedy::take_out("remove the coupling", "coupling"),
        );
    } else if case.coupling.is_some() && !solid {
        findings.warn(
            "coupling",
            "there are no solids in this case",
            Remedy::take_out("remove the coupling", "coupling"),
        );
    }
    check_narrow_gaps(case, findings);
    let polyhedra = has_polyhedra(case);
    check_covered_cells(case, findings);
    if polyhedra {
        check_polyhedra(case, findings);
    } else if case.output.blocks.is_some() && solid {
        findings.error(
            "output.blocks",
            "there are no blocks in this case",
            Remedy::take_out("remove this output", "output.blocks"),
        );
    }
    check_contact_law(case, findings);
    check_times(case, findings);
    for name in case.materials.keys().filter(|name| name.is_empty()) {
        findings.error(
            &format!("materials.{name}"),
            "a material needs a name",
            "write a name",
        );
    }
}

/// Checks that there is a contact law if and only if bodies can move.
fn check_contact_law(case: &Case, findings: &mut Findings) {
    let moving = has_grains(case)
        || case.blocks.is_some()
        || case
            .bodies
            .iter()
            .any(|b| matches!(b.motion, solids::Motion::Free { .. }));
    let polyhedra = has_polyhedra(case);
    let flat = case.domain.size.0.len() == 2;
    if moving && case.contact.is_none() && !auto::solids::move_without_law(case) {
        let law = if polyhedra {
            law_of_blocks::example()
        } else {
            linear::example()
        };
        findings.error(
            "contact",
            "bodies can move and touch, but there is no contact law",
            if polyhedra && flat {
                "make the domain 3-D, and add a contact law for blocks".into()
            } else {
                Remedy::from(format!("add for example \"contact\": {law}")).set("contact", law)
            },
        );
    }
    if case.contact.is_some() && !moving {
        findings.warn(
            "contact",
            "nothing moves freely in this case",
            Remedy::take_out("remove the contact law", "contact"),
        );
    }
}

/// Checks the times that depend on the kind of fluid.
fn check_times(case: &Case, findings: &mut Findings) {
    let fluid = case.fluid.is_some();
    let lattice = matches!(case.fluid, Some(Fluid::LatticeBoltzmann(_)));
    if lattice && case.time.solid_time_step.is_some() {
        findings.error(
            "time.solid_time_step",
            "with a fluid, the solid time step is the fluid time step divided by `solid_steps_per_fluid_step`",
            Remedy::take_out("remove it", "time.solid_time_step"),
        );
    }
    if !lattice && matches!(case.time.solid_steps_per_fluid_step, SolidSteps::Number(_)) {
        let (reason, remedy) = if fluid {
            match case.fluid {
                Some(Fluid::Joints(_)) => (
                    "the water in the joints has its own time step, and blocks use the same step",
                    "remove it",
                ),
                _ => (
                    "with seepage, `coupling_interval` determines the number of solid steps",
                    "use `fluid.darcy.coupling_interval`",
                ),
            }
        } else {
            ("there is no fluid in this case", "remove it")
        };
        let path = "time.solid_steps_per_fluid_step";
        findings.error(path, reason, Remedy::from(remedy).set(path, "auto"));
    }
    if case.time.warm_up.is_some() && !fluid {
        findings.error(
            "time.warm_up",
            "the warm-up needs a fluid, and there is none",
            Remedy::take_out("remove it", "time.warm_up"),
        );
    }
}

/// Reports two rules for the velocity of surfaces in narrow gaps.
fn check_narrow_gaps(case: &Case, findings: &mut Findings) {
    let Some(Coupling::BounceBack(links)) = &case.coupling else {
        return;
    };
    let path = "coupling.bounce_back.drop_wall_velocity_at_solid_neighbours";
    let mean = links.mean_wall_velocity_at_solid_neighbours;
    if let (Some(limit), Some(mean)) = (links.drop_wall_velocity_at_solid_neighbours, mean)
        && limit > 0
        && mean > 0
    {
        findings.error(
            path,
            format!(
                "surfaces in narrow gaps cannot be at rest (from {limit} solid neighbours) and have the mean velocity \
                 of the bodies (`mean_wall_velocity_at_solid_neighbours` is {mean})"
            ),
            Remedy::take_out("remove this rule, or set the other to 0", path),
        );
    }
}

/// Reports a solid operator that scales two rates of the fluid, with a collision operator that has one.
fn check_covered_cells(case: &Case, findings: &mut Findings) {
    if let (Some(Coupling::PartiallySaturated(cells)), Some(Fluid::LatticeBoltzmann(fluid))) =
        (&case.coupling, &case.fluid)
        && let Some(operator) = cells.solid_operator
        && operator.model().needs_two_rates()
        && fluid
            .collision
            .is_some_and(|collision| collision.model().antisymmetric_rate().is_none())
    {
        findings.error(
            "coupling.partially_saturated.solid_operator",
            format!(
                "{} scales one or two relaxation times and therefore works with BGK and TRT only",
                operator.name()
            ),
            Remedy::from("use the collision {\"trt\": {}}, or the solid operator non_equilibrium_bounce_back")
                .set(
                    "coupling.partially_saturated.solid_operator",
                    "non_equilibrium_bounce_back",
                ),
        );
    }
}

/// Rejects features that polyhedra do not support.
fn check_polyhedra(case: &Case, findings: &mut Findings) {
    if matches!(case.fluid, Some(Fluid::Darcy(_))) {
        findings.error(
            "fluid",
            "seepage acts on grains, not on blocks",
            "use lattice_boltzmann, or remove the blocks and polyhedra",
        );
    }
    if case
        .contact
        .as_ref()
        .is_some_and(|law| !law.model().of_polyhedra())
    {
        findings.error(
            "contact",
            "this law is for discs and spheres, but there are polyhedra",
            if case.domain.size.0.len() == 2 {
                "remove the polyhedra: they require three dimensions".into()
            } else {
                let law = law_of_blocks::example();
                Remedy::from(format!("write for example {law}")).set("contact", law)
            },
        );
        findings.depends(&["blocks", "bodies"]);
    }
}

/// Returns `true` if the case has polyhedra, which need a law of blocks.
pub(crate) fn has_polyhedra(case: &Case) -> bool {
    case.blocks.is_some() || case.bodies.iter().any(|b| !b.shape.round())
}

/// Returns the default material of walls and structures: that of the grains, otherwise of the blocks, of the first
/// free body, of the first body, or of the first region that generates grains.
pub(crate) fn usual_material(case: &Case) -> Option<&str> {
    let of_grains = case.grains.as_ref().map(|grains| &grains.material);
    let of_blocks = || case.blocks.as_ref().map(|blocks| &blocks.material);
    let free = |body: &&solids::Body| matches!(body.motion, solids::Motion::Free { .. });
    let of_bodies = || {
        let free = case.bodies.iter().find(free);
        free.or(case.bodies.first()).map(|body| &body.material)
    };
    of_grains
        .or_else(of_blocks)
        .or_else(of_bodies)
        .or_else(|| feeds(case).flatten().next())
        .map(String::as_str)
}

/// Returns the index of a material; if there is no such material, adds a finding.
pub(crate) fn material(
    names: &[String],
    name: &str,
    path: &str,
    findings: &mut Findings,
) -> Option<usize> {
    let index = names.iter().position(|known| known == name);
    if index.is_none() {
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        findings.unknown_material(path, name, &known);
    }
    index
}

/// Checks names, which become file names: not empty, plain characters, unique.
pub(crate) fn unique<'a>(
    known: &mut Vec<&'a str>,
    name: &'a str,
    path: &str,
    findings: &mut Findings,
) {
    let plain = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_' | '.' | '+');
    if name.is_empty() || name.len() > 100 || name.starts_with('.') || !name.chars().all(plain) {
        findings.error(
            path,
            "a name has 1 to 100 characters: letters, digits, spaces and - _ . + only, and it does not start \
             with a dot",
            "choose another name",
        );
    }
    if known.contains(&name) {
        findings.error(path, "this name is used twice", "use another name");
    }
    known.push(name);
}
