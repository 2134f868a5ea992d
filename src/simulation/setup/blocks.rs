//! From the plan to state: the law of blocks, the table of shapes, the blocks.

use super::{motion_of, pairs};
use crate::case::contact::BlockModel;
use crate::dem::Law;
use crate::dem::contact::blocks::Blocks;
use crate::dem::particles::{Body, Kind, Particles};
use crate::dem::polyhedron::{self, Model, Polyhedron, Stiffness};
use crate::dem::space::Space;
use crate::error::Error;
use crate::number::to_u32;
use crate::plan::Plan;
use crate::scene::contact::{ContactTable, PairParameters};
use decomposition::Domain;
use std::sync::Arc;

/// The law of a table of blocks.
pub(super) fn law(
    table: &ContactTable,
    per_area: bool,
    mass_damping: f64,
    model: BlockModel,
) -> Law {
    let of_pair = |pair: &PairParameters| {
        let normal = pair.normal_stiffness.number();
        let shear = normal * pair.shear_to_normal_stiffness;
        polyhedron::Law {
            stiffness: if per_area {
                Stiffness::PerArea { normal, shear }
            } else {
                Stiffness::PerContact { normal, shear }
            },
            friction: pair.friction_coefficient,
            normal_damping: pair.normal_damping_ratio,
            shear_damping: pair.shear_damping_ratio,
        }
    };
    Law::Blocks(Blocks {
        parameters: pairs(table, of_pair),
        model: match model {
            BlockModel::Patch => Model::Patch,
            BlockModel::Point { rounding } => Model::Point { rounding },
        },
        mass_damping,
    })
}

/// Gives the particles the shapes of all polyhedra, in the order of their ids. On every rank, before blocks are added or after they
/// were read; nothing happens in a scene without polyhedra.
///
/// # Errors
/// In the plane.
pub fn shapes<S: Space>(plan: &Plan, particles: &mut Particles<S>) -> Result<(), Error> {
    let shapes: Arc<[Polyhedron]> = (plan.scene.polyhedra())
        .map(|(solid, ..)| solid.shape.clone())
        .collect();
    if shapes.is_empty() {
        return Ok(());
    }
    particles.set_shapes(shapes)
}

/// Adds the blocks on the first rank, with ids after those of the bodies; the first lists hand them to their owners.
///
/// # Errors
/// Where a shape is not in the table.
pub fn blocks<S: Space>(
    plan: &Plan,
    domain: &Domain,
    particles: &mut Particles<S>,
) -> Result<(), Error> {
    let bodies = &plan.scene.bodies;
    let first_shape = bodies.iter().filter(|body| body.solid.is_some()).count();
    let Some(blocks) = plan.scene.blocks.as_ref().filter(|_| domain.rank() == 0) else {
        return Ok(());
    };
    for (n, block) in blocks.list.iter().enumerate() {
        let solid = &block.solid;
        // What never moves may have a material without density.
        let density = plan.scene.materials[block.material].density.unwrap_or(1.0);
        let id = (bodies.len() + n) as u64;
        let mut body = Body::of_block(id, &solid.shape, density, to_u32(block.material));
        if block.fixed {
            body.kind = Kind::Fixed;
        }
        let motion = motion_of::<S>(
            solid.position.into(),
            block.velocity,
            block.angular_velocity,
        );
        particles.add_block(body, motion, to_u32(first_shape + n), solid.orientation)?;
    }
    Ok(())
}
