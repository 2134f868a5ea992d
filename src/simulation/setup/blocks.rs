//! Construction of the state of blocks from the plan: the table of shapes, the blocks.

use base::error::Error;
use base::number::to_u32;
use decomposition::Communicator;
use dem::particles::{Body, Kind, Motion, Particles};
use dem::polyhedron::Polyhedron;
use dem::space::Space;
use plan::Plan;
use std::sync::Arc;

/// Gives the particles the shapes of all polyhedra, in the order of their ids; does nothing in a scene without
/// polyhedra. Call it on every rank, before blocks are added and after they were read.
///
/// # Errors
/// If the scene is two-dimensional.
pub fn shapes<S: Space>(plan: &Plan, particles: &mut Particles<S>) -> Result<(), Error> {
    let shapes: Arc<[Polyhedron]> = (plan.scene.polyhedra())
        .map(|one| one.solid.shape.clone())
        .collect();
    if shapes.is_empty() {
        return Ok(());
    }
    particles.set_shapes(shapes)
}

/// Adds the blocks on the first rank, with ids after those of the bodies; building the first neighbour lists sends
/// them to their owners.
///
/// # Errors
/// If a shape is not in the table.
pub fn blocks<S: Space>(
    plan: &Plan,
    communicator: &Communicator,
    particles: &mut Particles<S>,
) -> Result<(), Error> {
    let bodies = &plan.scene.bodies;
    let first_shape = bodies.iter().filter(|body| body.solid.is_some()).count();
    let Some(blocks) = plan
        .scene
        .blocks
        .as_ref()
        .filter(|_| communicator.rank() == 0)
    else {
        return Ok(());
    };
    for (n, block) in blocks.list.iter().enumerate() {
        let solid = &block.solid;
        // A block that never moves may have a material without density.
        let density = plan.scene.materials[block.material].density.unwrap_or(1.0);
        let id = (bodies.len() + n) as u64;
        let mut body = Body::of_block(id, &solid.shape, density, to_u32(block.material));
        if block.fixed {
            body.kind = Kind::Fixed;
        }
        let motion = Motion::new(
            solid.position.into(),
            block.velocity,
            block.angular_velocity,
        );
        particles.add_block(body, motion, to_u32(first_shape + n), solid.orientation)?;
    }
    Ok(())
}
