//! The list of what probes sample.

use super::bed::Bed;
use super::body::Body;
use super::crossing::Crossing;
use super::fabric::Fabric;
use super::gauge::Gauge;
use super::heave::Heave;
use super::joints::{BlockLoad, JointCell, Mouth};
use super::plane::Plane;
use super::points::{Line, Point};
use super::pores::{PoreLine, PorePoint};
use super::quantity::Quantity;
use super::section::Section;
use super::structure::StructureLoad;
use super::surface_load::SurfaceLoad;
use super::uplift::Uplift;
use super::wall::Wall;
use super::wall_load::WallLoad;
use super::water_balance::WaterBalance;
use super::water_table::WaterTable;
use super::{Heading, Rows, Run};
use crate::view::StateView;
use base::error::Error;
use dem::space::Space;
use plan::scene::Scene;
use plan::scene::observe::ProbeAt;
use std::path::Path;

/// Defines [`Sampled`], one of the quantities named, which passes each call on to it.
macro_rules! quantities {
    ($($name:ident),* $(,)?) => {
        /// One of the quantities.
        #[derive(Debug)]
        pub(super) enum Sampled {
            $($name(Box<$name>),)*
        }

        $(impl From<$name> for Sampled {
            fn from(quantity: $name) -> Self {
                Self::$name(Box::new(quantity))
            }
        })*

        impl Quantity for Sampled {
            fn headings(&self, scene: &Scene) -> Vec<Heading> {
                match self {
                    $(Self::$name(quantity) => quantity.headings(scene),)*
                }
            }

            fn rows(&self) -> usize {
                match self {
                    $(Self::$name(quantity) => quantity.rows(),)*
                }
            }

            fn delay(&self) -> f64 {
                match self {
                    $(Self::$name(quantity) => quantity.delay(),)*
                }
            }

            fn begin(&mut self, run: &Run) -> Result<(), Error> {
                match self {
                    $(Self::$name(quantity) => quantity.begin(run),)*
                }
            }

            fn remember(&mut self, table: &Path) -> io::Result<()> {
                match self {
                    $(Self::$name(quantity) => quantity.remember(table),)*
                }
            }

            fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
                match self {
                    $(Self::$name(quantity) => quantity.sample(view, rows),)*
                }
            }
        }
    };
}

quantities![
    Bed,
    BlockLoad,
    Body,
    Crossing,
    Fabric,
    Gauge,
    Heave,
    JointCell,
    Line,
    Mouth,
    Plane,
    Point,
    PoreLine,
    PorePoint,
    Section,
    StructureLoad,
    SurfaceLoad,
    Uplift,
    Wall,
    WallLoad,
    WaterBalance,
    WaterTable,
];

impl Sampled {
    /// Returns the quantity of a probe.
    ///
    /// # Errors
    /// If the scene has no fluid of the kind that is sampled.
    pub(super) fn new(scene: &Scene, at: &ProbeAt) -> Result<Self, Error> {
        let in_pores = scene.seepage.is_some();
        Ok(match *at {
            ProbeAt::Point(point) if in_pores => PorePoint(point).into(),
            ProbeAt::Point(point) => Point::new(point).into(),
            ProbeAt::Line { from, to, points } if in_pores => {
                PoreLine::new(from, to, points).into()
            }
            ProbeAt::Line { from, to, points } => Line::new(from, to, points).into(),
            ProbeAt::Plane { axis, position } => Plane { axis, position }.into(),
            ProbeAt::Gauge(cell) => Gauge::new(scene, cell)?.into(),
            ProbeAt::Body(index) => Body::new(index).into(),
            ProbeAt::Structure { index, about } if in_pores => {
                SurfaceLoad::new(scene, index, about)?.into()
            }
            ProbeAt::Structure { index, about } => StructureLoad { index, about }.into(),
            ProbeAt::Section {
                axis,
                position,
                part,
            } => Section::new(scene, axis, position, part.as_ref())?.into(),
            ProbeAt::Crossing { from, to } => Crossing::new(scene, from, to)?.into(),
            ProbeAt::Heave(prisms) => Heave(prisms).into(),
            ProbeAt::Uplift {
                axis,
                position,
                part,
                about,
            } => Uplift::new(Section::new(scene, axis, position, part.as_ref())?, about).into(),
            ProbeAt::WaterBalance => WaterBalance.into(),
            ProbeAt::WaterTable(_) => WaterTable::new(scene)?.into(),
            ProbeAt::Joint(point) => JointCell(point).into(),
            ProbeAt::Mouth(index) => Mouth(index).into(),
            ProbeAt::Block(index) => BlockLoad(index).into(),
            ProbeAt::WallLoad { wall, about } => WallLoad::new(wall, about).into(),
            ProbeAt::Wall(face) => Wall::new(scene, face)?.into(),
            ProbeAt::Grains { part, .. } => Fabric::new(scene, part).into(),
            ProbeAt::Bed(ref bed) => Bed::new(bed).into(),
        })
    }
}
