//! Construction of the state from the plan: the fluid with its boundaries, walls, contact law and bodies. Blocks and
//! the initial flow are constructed in separate files.

pub mod blocks;
pub mod initial;

use super::coupled;
use base::error::Error;
use base::history::TimeTable;
use base::number::{real, to_u32};
use base::units::LatticeUnits;
use case::darcy::{InitialState, TransientFlow};
use case::fluid::Precision;
use coupling::body_map::GHOSTS;
use coupling::joint_water::{self, JointWater};
use coupling::seepage::{self, Seepage};
use darcy;
use decomposition::{Communicator, SplitAxis};
use dem::particles::{Body, Kind, Motion, Particles};
use dem::space::Space;
pub use dem::space::vector;
use dem::{Dem, DemSettings, GrainDomain, Wall};
use lbm::boundary::{Opening, Patch};
use lbm::fluid::{Force, Setup};
use lbm::lanes::Stored;
use lbm::surface::SurfaceTension;
use plan::scene::bodies::Mobility;
use plan::scene::boundaries;
use plan::scene::flow::{BodyForce, Flow};
use plan::scene::seepage::{Seepage as SeepageScene, SeepagePatch};
use plan::{self, Plan};
use std::sync::Arc;

/// Returns the axis of this number.
pub fn axis(n: usize) -> SplitAxis {
    [SplitAxis::X, SplitAxis::Y, SplitAxis::Z][n.min(2)]
}

/// Returns the setup of the fluid of a plan, in lattice units.
///
/// # Errors
/// If a profile cannot be read.
pub fn fluid<S: Stored>(plan: &Plan, flow: &Flow, units: &LatticeUnits) -> Result<Setup<S>, Error> {
    let grid = &plan.scene.grid;
    let openings = boundaries::openings(flow.patches(), grid);
    let mut patches = Vec::new();
    for patch in flow.patches() {
        patches.push(self::patch(plan, patch, &openings, units)?);
    }
    Ok(Setup {
        models: flow.models,
        relaxation_time: flow.relaxation_time,
        force: force(plan, flow, units),
        cells: grid.cells,
        // In two dimensions a plane of cells is its own neighbour along z, where nothing moves.
        periodic: [
            grid.periodic[0],
            grid.periodic[1],
            grid.dimension == 2 || grid.periodic[2],
        ],
        patches,
        saturation: coupled::saturation(plan),
        single: flow.arithmetic == Precision::F32,
        device: plan::device::device(&plan.scene),
        surface_axis: plan.scene.surface.as_ref().map(|surface| surface.axis),
        terms: (plan.scene.terms.iter())
            .map(|term| term.build(&plan.scene.grid, flow))
            .collect(),
    })
}

fn force(plan: &Plan, flow: &Flow, units: &LatticeUnits) -> Force {
    let weight = |a: usize| {
        if flow.gravity_acts[a] {
            flow.density * plan.scene.gravity[a]
        } else {
            0.0
        }
    };
    match &flow.body_force {
        BodyForce::Constant(density) => {
            let total: [f64; 3] =
                std::array::from_fn(|a| units.force_density_to_lattice(density[a] + weight(a)));
            if total.iter().all(|f| f.abs() == 0.0) {
                Force::None
            } else {
                Force::Constant(total)
            }
        }
        BodyForce::Oscillating {
            amplitude,
            period,
            phase,
        } => Force::Oscillating {
            mean: std::array::from_fn(|a| units.force_density_to_lattice(weight(a))),
            amplitude: amplitude.map(|a| units.force_density_to_lattice(a)),
            period: units.time_to_lattice(*period),
            phase: *phase,
        },
    }
}

fn patch<S: Stored>(
    plan: &Plan,
    patch: &boundaries::ScenePatch,
    openings: &[Opening],
    units: &LatticeUnits,
) -> Result<Patch<S>, Error> {
    let cells = plan.scene.grid.cells;
    let axis = patch.face.axis();
    let upper = patch.face.is_max();
    let range = std::array::from_fn(|a| {
        // A patch that covers a whole face includes the links that cross exactly at its edge.
        let low = if patch.from[a] == 0 {
            f64::NEG_INFINITY
        } else {
            real(patch.from[a])
        };
        let high = if patch.to[a] >= cells[a] {
            f64::INFINITY
        } else {
            real(patch.to[a])
        };
        [low, high]
    });
    let path = format!("fluid.lattice_boltzmann.boundaries `{}`", patch.name);
    let mut place = patch.imposed_at(&plan.scene.grid, &path);
    place.openings = openings;
    place.bodies_move = plan.scene.moves_solids();
    Ok(Patch {
        name: patch.name.clone(),
        axis,
        upper,
        range,
        rule: patch.condition.rule(&place, units)?,
    })
}

/// Returns the surface tension of a plan in lattice units; none if it is not computed.
#[must_use]
pub fn tension(plan: &Plan, flow: &Flow, units: &LatticeUnits) -> Option<SurfaceTension> {
    let tension = plan.scene.surface.as_ref()?.tension?;
    // σ/h is a pressure.
    let pressure = tension.value / plan.scene.grid.spacing / flow.density;
    let speed = units.velocity_to_lattice(1.0);
    Some(SurfaceTension {
        tension: pressure * speed * speed,
        contact_angles: tension.contact_angles(),
    })
}

/// Returns the box of the grains.
pub fn region<S: Space>(plan: &Plan) -> GrainDomain<S> {
    let grid = &plan.scene.grid;
    GrainDomain {
        lower: S::Vector::default(),
        upper: vector::<S>(grid.size),
        periodic: grid.periodic,
        spacing: grid.spacing,
        exits: [[false; 2]; 3],
    }
}

/// Returns contacts and motion of a plan; `radius` is that of a typical grain \[m\].
///
/// # Errors
/// If the engine refuses its settings.
pub fn dem<S: Space>(plan: &Plan, radius: f64) -> Result<Dem<S>, Error> {
    let scene = &plan.scene;
    let skin = scene.time.neighbour_skin * radius;
    let mut settings = DemSettings::new(region::<S>(plan), plan.clock.solid_time_step, skin);
    settings.region.exits = scene.exits();
    settings.gravity = vector::<S>(scene.gravity);
    settings.local_damping = scene.contact.as_ref().map_or(0.0, |c| c.local_damping);
    if scene.flow.is_some() {
        settings.ghost_margin = (f64::from(GHOSTS) + 0.5) * scene.grid.spacing + settings.skin;
    }
    Dem::new(scene.contact_law(), settings, walls(plan))
}

/// Returns the walls of a plan.
#[must_use]
pub fn walls<S: Space>(plan: &Plan) -> Vec<Wall<S>> {
    let walls = plan.scene.walls.iter().map(|w| {
        let mut wall = match &w.surface {
            Some(surface) => Wall::of_surface(Arc::clone(surface), to_u32(w.material)),
            None => Wall::new(
                vector::<S>(w.point),
                vector::<S>(w.normal),
                to_u32(w.material),
            ),
        };
        wall.velocity = vector::<S>(w.velocity_at_start());
        // A wall that is inserted later is not part of the preparation.
        wall.open = w.from.is_some();
        wall
    });
    walls.collect()
}

/// Returns the indices of the walls that are removed when the run begins.
#[must_use]
pub fn temporary_walls(plan: &Plan) -> Vec<usize> {
    let walls = plan.scene.walls.iter().enumerate();
    walls.filter(|(_, w)| w.temporary).map(|(n, _)| n).collect()
}

/// Adds the named bodies (ids from 0) on the first rank; building the first neighbour lists sends them to their
/// owners.
///
/// # Errors
/// If the shape of a polyhedron is not in the table.
pub fn bodies<S: Space>(
    plan: &Plan,
    communicator: &Communicator,
    particles: &mut Particles<S>,
) -> Result<(), Error> {
    if communicator.rank() != 0 {
        return Ok(());
    }
    let mut shape = 0;
    for (n, body) in plan.scene.bodies.iter().enumerate() {
        let density = plan.scene.materials[body.material].density.unwrap_or(1.0);
        let (id, material) = (n as u64, to_u32(body.material));
        let mut made = match &body.solid {
            None => Body::uniform::<S>(id, body.radius, density, material),
            Some(solid) => Body::of_block(id, &solid.shape, density, material),
        };
        made.kind = match body.mobility {
            Mobility::Fixed => Kind::Fixed,
            Mobility::Driven => Kind::Driven,
            Mobility::Free => Kind::Free,
        };
        let [velocity, rate] = body.motion_at_start();
        let motion = Motion::new(body.position, velocity, rate);
        match &body.solid {
            None => particles.insert(made, motion),
            Some(solid) => {
                particles.add_block(made, motion, shape, solid.orientation)?;
                shape += 1;
            }
        }
    }
    Ok(())
}

/// Returns the settings of a transient flow; `interval` is the time between two steps of the clock
/// \[s\].
fn transient(written: &TransientFlow, interval: f64) -> darcy::TransientSettings {
    darcy::TransientSettings {
        initial: match written.initial {
            InitialState::Steady => darcy::InitialWater::Steady,
            InitialState::Head(head) => darcy::InitialWater::Head(head),
            InitialState::PressureHead(head) => darcy::InitialWater::PressureHead(head),
        },
        specific_storage: written.specific_storage,
        content_error: written.content_error,
        interval,
    }
}

/// Returns the water in the joints of a plan in its steady state at time 0; none if the plan has no such water.
///
/// # Errors
/// If there is no steady state.
pub fn joints(plan: &Plan) -> Result<Option<JointWater>, Error> {
    let (Some(scene), Some(blocks)) = (&plan.scene.joints, &plan.scene.blocks) else {
        return Ok(None);
    };
    let network = scene.network(blocks);
    let settings = scene.settings(plan.scene.gravity);
    let mouth = |mouth: &plan::scene::joints::SceneMouth| joint_water::MouthFront {
        pressure: mouth.pressure.clone(),
        region: [mouth.block.from, mouth.block.to],
        presses_on_blocks: mouth.presses_on_blocks,
    };
    let mouths = scene.mouths.iter().map(mouth).collect();
    let block = |block: &plan::scene::blocks::RockBlock| joint_water::NetworkBlock {
        solid: block.solid.clone(),
        density: plan.scene.materials[block.material]
            .density
            .filter(|_| !block.fixed),
        velocity: block.velocity.into(),
    };
    let all: Vec<_> = blocks.list.iter().map(block).collect();
    let first = plan.scene.bodies.len() as u64;
    let steps = (first, plan.clock.time_step);
    if scene.under_lattice {
        let gravity = plan.scene.gravity.into();
        let steps = (steps.0, steps.1, scene.lattice_steps);
        return JointWater::under_lattice(network, settings, gravity, &all, steps).map(Some);
    }
    JointWater::new(network, settings, mouths, &all, steps).map(Some)
}

/// Returns the seepage of a plan with its drag; none if the plan has no seepage. Collective.
///
/// # Errors
/// If water is enclosed without an outlet.
pub fn seepage<S: Space>(
    plan: &Plan,
    communicator: &Communicator,
) -> Result<Option<Seepage<S>>, Error> {
    let Some(scene) = &plan.scene.seepage else {
        return Ok(None);
    };
    let openness = plan::explicit_drag::openness(scene, plan.scene.grid.dimension);
    let pores = plan::explicit_drag::pores(scene, &openness);
    let pressure = pressure_of(plan, scene, &openness, communicator)?;
    let settings = seepage_settings(plan, scene, pores.mean());
    let mut seepage = Seepage::new(openness, pores, pressure, settings, communicator);
    if !scene.following.is_empty() {
        seepage = seepage.with_following(scene.following.clone());
    }
    Ok(Some(match &scene.zones {
        Some(zones) => seepage.with_zones(Arc::clone(zones)),
        None => seepage,
    }))
}

/// Returns the liquid of a seepage.
fn liquid_of(scene: &SeepageScene) -> darcy::Liquid {
    darcy::Liquid {
        density: scene.written.density,
        viscosity: scene.written.viscosity,
    }
}

/// Returns the pressure of the seepage with what the ground adds to it: shears of zones, soil, stored water.
fn pressure_of(
    plan: &Plan,
    scene: &SeepageScene,
    openness: &darcy::Openness,
    communicator: &Communicator,
) -> Result<darcy::Pressure, Error> {
    let written = &scene.written;
    let patch = |p: &SeepagePatch| darcy::PressurePatch {
        axis: p.face.axis(),
        upper: p.face.is_max(),
        from: p.from,
        to: p.to,
        condition: p.condition,
        inside: false,
    };
    let drains = scene.drains.iter().map(|drain| darcy::PressurePatch {
        axis: 0,
        upper: false,
        from: drain.cells.from,
        to: drain.cells.to,
        condition: drain.condition,
        inside: true,
    });
    let new = if scene.has_stored_start() {
        darcy::Pressure::without_outlets
    } else {
        darcy::Pressure::new
    };
    let mut pressure = new(
        openness,
        scene.patches.iter().map(patch).chain(drains).collect(),
        liquid_of(scene),
        darcy::PressureSettings {
            equations: written.equations,
            gravity: plan.scene.gravity,
            tolerance: written.tolerance,
            iterations: written.max_iterations,
        },
        communicator,
    )
    .map_err(|e| Error::Numerical(e.to_string()))?;
    let zones = scene.zones.as_ref();
    let shears = zones.map_or_else(Vec::new, |z| z.shears(openness.grid.count()));
    if !shears.is_empty() {
        pressure = pressure.with_shear(&shears);
    }
    let Some(soil) = &written.unsaturated else {
        return Ok(pressure);
    };
    let retention = soil.retention;
    let layers = written.zones.iter().filter_map(|zone| zone.retention);
    let layers: Vec<_> = layers.collect();
    pressure = (pressure.with_soil(darcy::Soil { retention })).with_layers(&layers, &scene.soil_of);
    Ok(match &soil.transient {
        Some(written) => {
            let cells = 0..openness.grid.count();
            let volume: Vec<f64> = cells.map(|cell| openness.volume(cell)).collect();
            let settings = transient(written, plan.clock.time_step);
            let stored = pressure.with_transient(settings, &volume);
            stored.with_histories(histories_of(scene))
        }
        None => pressure,
    })
}

/// Returns the conditions of patches and drains that change in time.
fn histories_of(scene: &SeepageScene) -> Vec<darcy::ConditionHistory> {
    let of_patches = scene.patches.iter().map(|patch| &patch.history);
    let of_drains = scene.drains.iter().map(|drain| &drain.history);
    let histories = of_patches.chain(of_drains).enumerate();
    histories
        .filter(|(_, table)| !table.is_empty())
        .map(|(patch, table)| darcy::ConditionHistory {
            patch,
            values: TimeTable::new(Some(table), 0.0),
        })
        .collect()
}

/// Returns the laws of a seepage through pores of a kind of mean diameter.
fn seepage_settings(
    plan: &Plan,
    scene: &SeepageScene,
    diameter: darcy::MeanDiameter,
) -> seepage::SeepageSettings {
    let written = &scene.written;
    // In unsaturated ground the water is that of a stationary bed.
    let saturated = written.unsaturated.is_none();
    seepage::SeepageSettings {
        liquid: liquid_of(scene),
        resistance: darcy::ResistanceSettings {
            law: written.resistance(),
            diameter,
            porosity_cap: written.porosity_cap(),
            least_porosity: written.least_porosity,
        },
        drag: written.drag(),
        equations: written.equations,
        transient_porosity: written.transient_porosity() && saturated,
        semi_implicit_drag: written.semi_implicit_drag && saturated,
        gravity: plan.scene.gravity,
        interval: plan.clock.time_step,
        roughness: written.roughness,
        bridges: (plan.scene.contact.as_ref()).is_some_and(|contact| contact.model().bridges()),
        walls: scene.walls,
    }
}
