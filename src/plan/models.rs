//! Models of a scene, each with its reason, and the models that it does not need.

use super::Clock;
use super::arithmetic;
use super::coupling_interval;
use super::device::device;
use super::free_surface;
use super::impacts;
use crate::scene::Scene;
use crate::scene::auto::Subject;
use crate::scene::bodies::Mobility;
use crate::scene::findings::number;
use crate::scene::flow::Flow;
use crate::scene::gravity;
use crate::scene::joint_methods::{JointMethods, JointShare};
use crate::scene::joints::JointScene;
use crate::scene::observe::ProbeAt;
use crate::scene::seepage::{PipingScene, Seepage};
use base::family::Description;
use base::geometry::Face;
use case::coupling::{Coupling, Scheme, SolidFraction};
use case::darcy::{Darcy, Unsaturated};
use case::fluid::Device;
use case::fluid::Precision;
use case::joints::JointMethod;
use case::time::SolidSteps;
use darcy::piping::PipeWidth;
use lbm::lattice::VelocitySet;
use serde::Serialize;

/// Choice of a model, with its reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Choice {
    /// Subject of the choice.
    pub what: String,
    /// Chosen model.
    pub model: String,
    /// Reason.
    pub reason: String,
}

/// Returns the choices of a scene, in the order in which a plan prints them.
pub(crate) fn choices(scene: &Scene, clock: &Clock) -> Vec<Choice> {
    let list = Vec::new();
    let mut choices = Choices { scene, clock, list };
    choices.automatic();
    choices.timed_walls();
    choices.servo_walls();
    choices.grains();
    choices.leaving();
    if let Some(seepage) = &scene.seepage {
        choices.seepage(seepage);
    }
    if let Some(joints) = &scene.joints {
        choices.joints(joints);
    }
    match &scene.flow {
        None if scene.seepage.is_some() || scene.joints.is_some() => {}
        None => choices.add(
            "fluid",
            "none",
            "the case has no fluid: no lattice is allocated",
        ),
        Some(flow) => choices.flow(flow),
    }
    match (&scene.coupling, &scene.flow) {
        (Some(coupling), Some(flow)) => {
            choices.add_chosen(
                Subject::Coupling,
                name(coupling, flow),
                "there are solids in the fluid",
            );
        }
        (None, Some(_)) => choices.add_chosen(
            Subject::Coupling,
            "none",
            "there are no solids in the fluid",
        ),
        _ => {}
    }
    choices.contacts();
    choices.beds();
    let axis = scene.grid.split_axis.min(2);
    choices.add(
        "slabs",
        format!("along {}", AXES[axis]),
        format!("{} planes", scene.grid.cells[axis]),
    );
    choices.list
}

const AXES: [&str; 3] = ["x", "y", "z"];

/// Choices of a scene while they are being collected.
struct Choices<'a> {
    scene: &'a Scene,
    clock: &'a Clock,
    list: Vec<Choice>,
}

impl Choices<'_> {
    /// Adds a choice that only the case makes.
    fn add(&mut self, what: &str, model: impl Into<String>, reason: impl Into<String>) {
        self.list.push(Choice {
            what: what.into(),
            model: model.into(),
            reason: reason.into(),
        });
    }

    /// Adds a choice that may be automatic: it then has its own reason instead of `reason`.
    fn add_chosen(&mut self, what: Subject, model: impl Into<String>, reason: impl Into<String>) {
        match self.scene.chosen.reason_of(what) {
            Some(own) => self.add(what.name(), model, own),
            None => self.add(what.name(), model, reason),
        }
    }

    /// Adds the accuracy and the sizes that it fixes.
    fn automatic(&mut self) {
        let (grid, chosen) = (&self.scene.grid, &self.scene.chosen);
        if let Some(accuracy) = chosen.accuracy {
            let level = accuracy.name();
            let target = number(100.0 * accuracy.target());
            let promised = chosen.promised.map_or_else(
                || String::from("nothing promised"),
                |error| format!("{} % promised", number(100.0 * error)),
            );
            let of = if chosen.answers.is_empty() {
                "forces"
            } else {
                "answers"
            };
            self.add_chosen(
                Subject::Accuracy,
                format!("{level}: {target} % of {of}, {promised}"),
                "no measured row covers these cells",
            );
        } else if self.scene.surface.is_some()
            || self.scene.seepage.is_some() && !self.scene.has_solids()
        {
            let errors = chosen.answers.iter().filter_map(|answer| answer.error);
            let model = errors.reduce(f64::max).map_or_else(
                || String::from("nothing promised"),
                |error| format!("answers within {} % promised", number(100.0 * error)),
            );
            self.add_chosen(Subject::Accuracy, model, "");
        }
        if chosen.reason_of(Subject::Spacing).is_some() {
            let cells = grid.cell_count();
            let spacing = format!("{} m, {cells} cells", number(grid.spacing));
            self.add_chosen(Subject::Spacing, spacing, "");
        }
        if chosen.reason_of(Subject::TimeStep).is_some() {
            self.add_chosen(
                Subject::TimeStep,
                format!("{} s", number(self.clock.time_step)),
                "",
            );
        }
    }

    /// Adds the times of walls that are inserted or removed.
    fn timed_walls(&mut self) {
        let clock = self.clock;
        let at = |time: f64| {
            let step = clock.interval_to_steps(time);
            format!("{} s (step {step})", number(time))
        };
        for wall in self.scene.walls.iter().filter(|wall| wall.is_timed()) {
            let from = wall.from.map(|time| format!("from {}", at(time)));
            let until = wall.until.map(|time| format!("until {}", at(time)));
            let exists: Vec<String> = from.into_iter().chain(until).collect();
            self.add(
                &format!("wall {}", wall.name),
                exists.join(" "),
                "requested",
            );
        }
    }

    /// Adds the controls of servo walls.
    fn servo_walls(&mut self) {
        let servos = self.scene.walls.iter();
        let servos = servos.filter_map(|wall| Some((&wall.name, wall.servo.as_ref()?)));
        for (name, servo) in servos {
            let stress = match servo.history.as_slice() {
                [[_, stress]] => format!("{} Pa", number(*stress)),
                table => format!("a table of {} rows", table.len()),
            };
            self.add(
                &format!("wall {name}"),
                format!(
                    "a servo holds a mean normal stress of {stress}, with at most {} m/s and a gain of {}",
                    number(servo.velocity_limit),
                    number(servo.gain)
                ),
                "requested",
            );
        }
    }

    /// Adds what becomes of free solids that leave through openings.
    fn leaving(&mut self) {
        let scene = self.scene;
        let exits = scene.exits();
        let open = |face: &Face| exits[face.axis()][usize::from(face.is_max())];
        let faces: Vec<&str> = Face::ALL
            .iter()
            .filter(|face| open(face))
            .map(|face| face.name())
            .collect();
        let bodies = scene.bodies.iter();
        let free = bodies
            .filter(|body| body.mobility == Mobility::Free)
            .count();
        if faces.is_empty() || free == 0 && scene.grains.is_none() && scene.blocks.is_none() {
            return;
        }
        let faces = faces.join(", ");
        if scene.removes_leaving() {
            self.add(
                "solids that leave",
                format!("removed beyond {faces}"),
                "the water has openings there, and no wall stops solids: those more than one length of the domain \
                 outside are removed, and `summary.json` counts them in `left_through_openings`",
            );
        } else {
            self.add(
                "blocks that leave",
                format!("fly on beyond {faces}"),
                "no wall stops blocks there: `summary.json` counts those more than one length of the domain outside \
                 in `left_the_domain`",
            );
        }
    }

    /// Adds the grading of the grains, and the materials of layers and zones.
    fn grains(&mut self) {
        let scene = self.scene;
        let Some(grains) = &scene.grains else {
            return;
        };
        let dimension = scene.grid.dimension;
        if let Some(grading) = grains.percentiles(dimension) {
            // The sizes count by their volumes, which are their masses where all densities are equal.
            let densities: Vec<f64> = grains.materials().map(|m| scene.density(m)).collect();
            let alike = densities
                .windows(2)
                .all(|pair| pair[0].to_bits() == pair[1].to_bits());
            let by = if alike { "mass" } else { "volume" };
            let reason = format!("requested; {} grains, passing by {by}", grains.expected);
            self.add("grading", grading.to_string(), reason);
        }
        for cloud in grains.layers() {
            let material = &scene.materials[cloud.material].name;
            let sizes = cloud
                .percentiles(dimension)
                .map_or_else(String::new, |p| format!(", {p}"));
            self.add(
                &format!("grains of layer {}", cloud.name.as_deref().unwrap_or("1")),
                format!("{material}{sizes}"),
                format!("requested; {} grains", cloud.number),
            );
        }
        if grains.bond_at_start {
            self.add(
                "bonds at the start",
                "all contacts",
                "requested; what they connect to a wall or a fixed body comes to rest before time 0, without the \
                 fluid; everything else keeps its position and velocity",
            );
        }
        for zone in &grains.zones {
            let material = scene.materials[zone.material].name.as_str();
            let reason = zone.listed.map_or_else(
                || "requested; assigned after the preparation".into(),
                |count| format!("requested; {count} grains"),
            );
            self.add(&format!("grains of zone {}", zone.name), material, reason);
        }
    }

    /// Adds the method of each joint under a lattice, with its reason and its cost.
    fn joint_methods(&mut self, methods: &JointMethods, joints: &JointScene) {
        let across = |share: &JointShare| {
            let [low, high] = share.cells_across.map(number);
            format!("{low} to {high} cells across")
        };
        if methods.network.joints > 0 {
            let [_, takeover] = joints.lattice_limits.unwrap_or_default();
            let reason = format!(
                "{}; the network needs no cell in a joint: a lattice with four cells across the narrowest one would \
                 cost {} times as much; the lattice takes over joints that open to more than {} m",
                across(&methods.network),
                number(methods.resolved_cost()),
                number(takeover)
            );
            let count = methods.network.joints;
            self.add("joints by the network", count.to_string(), reason);
        }
        if methods.lattice.joints > 0 {
            let why = match methods.method {
                JointMethod::Lattice => "requested; those thinner than a cell contain no water",
                JointMethod::Network => "wider than `largest_aperture`",
                JointMethod::Auto => "four cells and more resolve the flow",
            };
            let reason = format!("{}: {why}", across(&methods.lattice));
            let count = methods.lattice.joints;
            self.add("joints by the lattice", count.to_string(), reason);
        }
    }

    /// Adds the models of the water in joints.
    fn joints(&mut self, joints: &JointScene) {
        let (written, counts) = (&joints.written, joints.counts);
        if let Some(methods) = &self.scene.joint_methods {
            self.joint_methods(methods, joints);
        }
        if counts.joints == 0 {
            return;
        }
        let [low, high] = joints.apertures.map(number);
        let name = if joints.under_lattice {
            "joints"
        } else {
            "fluid"
        };
        self.add(
            name,
            "water in joints",
            format!(
                "joints: {}, of {low} to {high} m, with {} cells and {} junctions",
                counts.joints, counts.cells, counts.junctions
            ),
        );
        let [open, closed] = joints.edges.map(number);
        if joints.under_lattice {
            self.add(
                "mouths",
                "cells of the lattice",
                format!(
                    "{closed} m of edges meet no other joint: an edge in front of a water cell takes its \
                     pressure and exchanges discharge with it, without the momentum of the jet; all other edges \
                     are closed"
                ),
            );
        } else {
            self.add(
                "mouths",
                format!("{open} m of open edges"),
                format!("{closed} m of edges meet no other joint and lie outside the boxes of all mouths: they \
                         are closed"),
            );
        }
        if joints.lattice_steps > 1 {
            self.add(
                "steps of the joints",
                format!("one in {} steps of the lattice", joints.lattice_steps),
                "requested: the means of pressures and loads drive it, its discharge returns evenly".to_owned(),
            );
        }
        if joints.movers > 0 {
            self.add(
                "blocks in joints",
                "moved together with the water",
                format!(
                    "{} blocks can move: pressures and velocities are solved together, contacts explicitly; the \
                     network is rebuilt where a block has moved by a tenth of its cells",
                    joints.movers
                ),
            );
        }
        self.add(
            "friction in joints",
            match written.joints.roughness {
                Some(_) => "laminar, Blasius and rough walls",
                None => "laminar",
            },
            "each discharge has the largest of the three resistances; losses at mouths and junctions are \
             neglected",
        );
        let settings = joints.settings(self.scene.gravity);
        let speed = settings.water.wave_speed(0.0);
        self.add(
            "waves in joints",
            if written.inertia {
                "inertia, and friction that depends on the frequency"
            } else {
                "storage alone"
            },
            format!(
                "waves of {} m/s at atmospheric pressure; the longest joint, of {} m and closed at one end, resonates \
                 at {} Hz",
                number(speed),
                number(joints.longest),
                number(0.25 * speed / joints.longest)
            ),
        );
    }

    /// Adds the models of seepage.
    fn seepage(&mut self, seepage: &Seepage) {
        let written = &seepage.written;
        let without_grains = self.scene.grains.is_none() && self.scene.bodies.is_empty();
        self.seepage_grid(seepage, without_grains);
        self.permeability(seepage, without_grains);
        let tolerance = format!("to {:e} of the driving terms", written.tolerance);
        match &written.unsaturated {
            Some(soil) => self.unsaturated(soil, tolerance),
            None => self.add("pressure", "conjugate gradients with multigrid", tolerance),
        }
        if written.zones.iter().any(|zone| zone.dip.is_some()) {
            self.add(
                "dip of the beds",
                "multi-point fluxes of a full tensor",
                "requested; heads may leave the range of the imposed ones where cells are too large",
            );
        }
        if let Some(piping) = &seepage.piping {
            self.backward_erosion(piping);
        }
        for drain in &seepage.drains {
            let cells = match drain.cells.normal() {
                Some(_) => "a plane between cells".to_owned(),
                None => format!("{} cells", drain.cells.count()),
            };
            let condition = drain.condition.to_string();
            let (kind, reason) = match &drain.cells.only {
                Some(_) => ("surface", "requested; a staircase of cells".to_owned()),
                None => ("drain", format!("requested; {cells}")),
            };
            self.add(&format!("{kind} {}", drain.name), condition, reason);
        }
        if !without_grains {
            match &written.unsaturated {
                Some(_) => self.unsaturated_on_grains(),
                None => self.seepage_on_grains(written),
            }
        }
    }

    /// Adds the cells of the seepage, and how often its flow is solved.
    fn seepage_grid(&mut self, seepage: &Seepage, without_grains: bool) {
        let scene = self.scene;
        let [x, y, z] = seepage.cells;
        let graded = if seepage.is_graded() {
            let axes = (0..scene.grid.dimension).map(|a| {
                let (least, most) = (seepage.spacing[a], seepage.widest(a));
                format!("{} to {} m along {}", number(least), number(most), AXES[a])
            });
            format!(" of {}", axes.collect::<Vec<_>>().join(", "))
        } else {
            String::new()
        };
        let cells = if without_grains {
            let time = if seepage.is_transient() {
                format!("every {} s", number(self.clock.time_step))
            } else {
                "steady: no grain moves".to_owned()
            };
            format!("requested; {x} x {y} x {z} cells{graded}, {time}")
        } else {
            format!("requested; {x} x {y} x {z} cells")
        };
        self.add("fluid", "Darcy seepage", cells);
        if !without_grains {
            let Clock {
                solid_steps_per_step: steps,
                time_step,
                ..
            } = *self.clock;
            self.add(
                Subject::CouplingInterval.name(),
                format!("{steps} solid steps, {} s", number(time_step)),
                coupling_interval::reason(scene, seepage, self.clock),
            );
        }
    }

    /// Adds the permeability and porosity of grains and zones.
    fn permeability(&mut self, seepage: &Seepage, without_grains: bool) {
        let written = &seepage.written;
        let of_zones = without_grains || written.unsaturated.is_some();
        if of_zones {
            let reason = if without_grains {
                "there are no grains"
            } else {
                "grains in unsaturated ground do not change its flow, except in zones that follow them"
            };
            self.add("permeability", "the resistance of the zones", reason);
            if !seepage.following.is_empty() {
                self.add(
                    "ground that follows the grains",
                    "permeability by Kozeny-Carman, pore volume in proportion to the porosity of the grains",
                    "requested by `follows_grains`; suction and water content over it are those of the zone",
                );
            }
        } else {
            let resistance = written.resistance().model().description();
            let porosity = written.porosity.model().description();
            self.add(
                "permeability",
                format!("{resistance}, {:?} mean diameter", written.mean_diameter),
                format!("porosity by {porosity}, at most {}", written.porosity_cap()),
            );
        }
        for [zone, states, reason] in seepage.describe_zones(of_zones) {
            self.add(&zone, states, reason);
        }
        if let Some(cut) = seepage.zones.as_ref().map(|z| z.cut()).filter(|n| *n > 0) {
            self.add(
                "cells cut by zones",
                cut.to_string(),
                "harmonic mean of the permeability across layers, arithmetic mean along them",
            );
        }
    }

    /// Adds the models of unsaturated ground.
    fn unsaturated(&mut self, soil: &Unsaturated, tolerance: String) {
        let law = soil.retention.model();
        let length = number(law.capillary_length());
        self.add(
            "retention",
            law.description(),
            format!("requested; capillary length {length} m"),
        );
        self.add(
            "pressure",
            "Newton's method, stabilised biconjugate gradients with multigrid",
            tolerance,
        );
        if let Some(transient) = &soil.transient {
            self.add(
                "time integration",
                "two implicit stages of second order, adaptive steps",
                format!(
                    "error of the water content below {} in a step",
                    number(transient.content_error)
                ),
            );
        }
        self.add(
            "not computed",
            "hysteresis, air pressure, swelling",
            "air moves freely at atmospheric pressure, and the ground is rigid",
        );
    }

    /// Adds the load of unsaturated ground on grains.
    fn unsaturated_on_grains(&mut self) {
        let bridges = self.scene.contact.as_ref();
        let (load, reason) = if bridges.is_some_and(|contact| contact.model().bridges()) {
            (
                "-S_e grad p, weight of the water",
                "the capillary bridges carry the suction",
            )
        } else {
            (
                "-grad(S_e p), weight of the water",
                "effective stress of Bishop with chi = S_e, the effective saturation",
            )
        };
        self.add("load on grains", load, reason);
        let follows = (self.scene.seepage.as_ref()).is_some_and(|s| !s.following.is_empty());
        let (missing, reason) = if follows {
            (
                "resistance of the water to the motion of grains, change of the suction with the pores",
                "permeability and pore volume follow the grains at each coupling",
            )
        } else {
            (
                "resistance of the water to the motion of grains, flow through ground that has moved",
                "permeability and retention remain those of the zones without `follows_grains`",
            )
        };
        self.add("not computed", missing, reason);
    }

    /// Adds the closure of backward erosion and its limits.
    fn backward_erosion(&mut self, piping: &PipingScene) {
        let (written, settings) = (&piping.written, &piping.settings);
        let width = match settings.width {
            None => "unit width".to_owned(),
            Some(PipeWidth::Fixed(width)) => format!("{} m wide", number(width)),
            Some(PipeWidth::Ratio(ratio)) => format!("{} heights wide", number(ratio)),
        };
        self.add(
            "backward erosion",
            format!(
                "limit equilibrium of grains of {} m in a laminar pipe of {width}",
                number(settings.grains.diameter)
            ),
            format!(
                "requested; {} lengths from `{}` towards `{}`, height times slope {} m",
                settings.path.count,
                written.exit,
                written.drive,
                number(settings.grains.height_of_slope())
            ),
        );
        self.add(
            "tip of the pipe",
            "advances where the longer pipe has an equilibrium",
            "no gradient in front of the tip is required, and no heave of the exit is checked",
        );
    }

    /// Adds the equations and the drag of seepage through grains.
    fn seepage_on_grains(&mut self, written: &Darcy) {
        let flow = super::pore_flow::reynolds(self.scene).map_or_else(
            || "no pressure and no flux drives the water".to_owned(),
            |re| {
                let re = number(re);
                format!("the Reynolds number of the seepage is about {re}")
            },
        );
        self.add("equations", format!("{:?}", written.equations), flow);
        let balance = if written.drag().model().balances() {
            "balances the pressure loss"
        } else {
            "independent of the resistance: see the closure of momentum in the log"
        };
        self.add("drag", written.drag().model().description(), balance);
    }

    /// Adds the models of a fluid on a lattice.
    fn flow(&mut self, flow: &Flow) {
        let operator = flow.models.collision.model();
        let (name, reason) = match flow.models.lattice {
            VelocitySet::D2Q9 => ("D2Q9", "the domain is 2-D"),
            VelocitySet::D3Q19 => (
                "D3Q19",
                "the domain is 3-D; the smallest velocity set that is accurate at these velocities",
            ),
            VelocitySet::D3Q27 if operator.only_on().is_some() => (
                "D3Q27",
                "the moments of the operator belong to this velocity set",
            ),
            VelocitySet::D3Q27 => ("D3Q27", "requested: isotropic to fourth order"),
        };
        self.add("lattice", name, reason);
        let Description { model, reason } = operator.describe(flow.relaxation_time);
        self.add_chosen(Subject::Collision, model, reason);
        let Description { model, reason } = flow.models.turbulence.map_or_else(
            || {
                Description::new(
                    "none",
                    "not requested: all eddies are assumed to be resolved, and no velocity field is stored",
                )
            },
            |model| model.describe(),
        );
        self.add_chosen(Subject::Turbulence, model, reason);
        for term in &self.scene.terms {
            for [what, model, reason] in term.model().describe() {
                self.add(&what, model, reason);
            }
        }
        if let Some(surface) = &self.scene.surface {
            let spacing = self.scene.grid.spacing;
            let openings = surface.openings.iter();
            let openings = openings.map(|opening| format!("; {}", opening.describe(spacing)));
            let openings: String = openings.collect();
            self.add(
                "free surface",
                "volume of fluid on the lattice",
                format!(
                    "water stands up to {} m; the flow and the pressure of air are not computed: air that water \
                     encloses disappears, and its volume is counted; {tension}no entrainment of air{openings}",
                    number(surface.head()),
                    tension = free_surface::without_tension(surface, flow.density),
                ),
            );
            if let Some(tension) = &surface.tension {
                let (model, reason) =
                    free_surface::describe_tension(self.scene, flow, surface, tension);
                self.add("surface tension", model, reason);
            }
            if self.scene.coupling.is_some() {
                self.add(
                    "bodies at the surface",
                    "each cell has a liquid and a solid fraction",
                    "loads are relative to the air pressure; the draught of boxes and discs at rest is accurate \
                     to 0.05 cells; a face that lies flush on a wall or on another body has no water beneath it \
                     and no uplift; the accuracy of impacts on water is not known"
                        .to_owned(),
                );
            }
        }
        if let Some((model, reason)) = gravity::describe(self.scene.gravity, flow.gravity_acts) {
            self.add("gravity on the fluid", model, reason);
        }
        let storage = match flow.storage {
            Precision::F64 => "f64, deviations from rest",
            Precision::F32 => "f32, deviations from rest",
        };
        self.add_chosen(
            Subject::Populations,
            storage,
            arithmetic::describe(self.scene, flow),
        );
        self.device(flow);
    }

    /// Adds the device of a fluid on a lattice, unless it is the processor as requested.
    fn device(&mut self, flow: &Flow) {
        let (device, reason) = match device(self.scene) {
            Device::Cpu if flow.device == Device::Auto => {
                ("the processor", "a GPU does not run this scene yet")
            }
            Device::Cpu => return,
            Device::Gpu => ("a GPU", "requested"),
            Device::Auto => (
                "a GPU if the machine has one, otherwise the processor",
                "requested; the state is the same on GPU and processor",
            ),
        };
        self.add("device", device, reason);
    }

    /// Adds the contact law of solids.
    fn contacts(&mut self) {
        let scene = self.scene;
        let Some(table) = scene.contact.as_ref().filter(|_| scene.has_solids()) else {
            self.add_chosen(Subject::ContactLaw, "none", "nothing moves freely");
            return;
        };
        let polyhedra = scene.polyhedra().count();
        let reason = if polyhedra > 0 {
            format!("requested; {polyhedra} polyhedra")
        } else {
            let flat = scene.grid.dimension == 2;
            let kind = if flat { "discs" } else { "spheres" };
            format!("requested; {kind}, without orientation")
        };
        self.add_chosen(Subject::ContactLaw, table.model().describe(), reason);
        if let Some((speed, part)) = impacts::of_loose_blocks(scene) {
            self.add(
                "impact of a loose block",
                format!("at most {} m/s, overlap {} of the radius", number(speed), number(part)),
                "after a fall to the end of the domain; which blocks come loose is not known before the run, which \
                 stops above `guards.max_overlap`",
            );
        }
        if table.model().bridges() {
            self.add(
                "capillary bridges",
                "force of Willett et al. (2000), formed at contact",
                "the slope of their force limits the solid step as a spring does; viscosity, weight, exchange of \
                 water and hysteresis of the contact angle are not computed",
            );
        }
        if table.is_elastic() {
            self.add(
                "contact damping",
                "none",
                "no damping is set: bodies rebound from an impact with their full speed",
            );
        }
        // In seepage the coupling interval states them.
        if scene.flow.is_some() {
            self.add(
                "solid steps",
                format!("{} per fluid step", self.clock.solid_steps_per_step),
                match scene.time.solid_steps_per_fluid_step {
                    SolidSteps::Number(_) => "requested",
                    SolidSteps::Auto(_) => {
                        "the smallest number that keeps the safety of the critical time step"
                    }
                },
            );
        }
    }

    /// Adds the beds that probes measure.
    fn beds(&mut self) {
        for probe in &self.scene.probes {
            if let ProbeAt::Bed(bed) = &probe.at {
                let [along, across, _] = bed.axes.map(|axis| AXES[axis]);
                let name = &probe.name;
                let threshold = number(bed.threshold);
                let from = number(bed.mean_from);
                self.add(
                    "bed",
                    format!("probe `{name}`: stream along {along}, bed across {across}"),
                    format!("surface at a solid fraction of {threshold}, means from {from} s on"),
                );
            }
        }
    }
}

/// Returns the coupling in words.
fn name(coupling: &Coupling, flow: &Flow) -> String {
    let written = match coupling {
        Coupling::BounceBack(written) => {
            return match written.scheme {
                Scheme::HalfWay => "moving bounce-back, half-way".into(),
                Scheme::Interpolated => "moving bounce-back, interpolated".into(),
            };
        }
        Coupling::PartiallySaturated(written) => written,
    };
    let chosen = flow.solid_operator(written).model();
    let operator = chosen.describe();
    let weighting = if chosen.weighted() {
        flow.weighting(written).describe()
    } else {
        "no weighting"
    };
    let fraction = match written.solid_fraction {
        SolidFraction::Exact => "exact fractions".into(),
        SolidFraction::Samples(n) => format!("solid fractions from {n} samples along an edge"),
        SolidFraction::Linear => "linear fractions".into(),
    };
    format!("partially saturated cells, {operator}, {weighting}, {fraction}")
}
