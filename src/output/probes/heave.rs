//! Heave of the ground in front of a structure: excess head, gradient and factor of safety of prisms of each width.

use super::quantity::Quantity;
use super::{Heading, Rows, sampled_if_solved};
use crate::view::StateView;
use base::error::Error;
use darcy::Prisms;
use dem::space::Space;
use plan::scene::Scene;

/// Prisms of ground.
#[derive(Debug)]
pub(super) struct Heave(pub(super) Prisms);

impl Quantity for Heave {
    fn headings(&self, _scene: &Scene) -> Vec<Heading> {
        vec![
            ("width", "m"),
            ("excess_head", "m"),
            ("gradient", "-"),
            ("factor_of_safety", "-"),
        ]
    }

    fn rows(&self) -> usize {
        self.0.widths()
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        sampled_if_solved(view, |seepage| {
            for (row, h) in rows.iter_mut().zip(seepage.pressure().heave(&self.0)) {
                row.extend([h.width, h.excess_head, h.gradient, h.factor_of_safety]);
            }
        })
    }
}
