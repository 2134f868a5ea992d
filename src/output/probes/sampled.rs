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
use base::family::family;
use dem::space::Space;
use plan::scene::Scene;
use plan::scene::observe::ProbeAt;
use std::path::Path;

family! {
    /// One of the quantities.
    #[derive(Debug)]
    pub(super) enum Sampled, from {
        Bed(Box<Bed>),
        BlockLoad(Box<BlockLoad>),
        Body(Box<Body>),
        Crossing(Box<Crossing>),
        Fabric(Box<Fabric>),
        Gauge(Box<Gauge>),
        Heave(Box<Heave>),
        JointCell(Box<JointCell>),
        Line(Box<Line>),
        Mouth(Box<Mouth>),
        Plane(Box<Plane>),
        Point(Box<Point>),
        PoreLine(Box<PoreLine>),
        PorePoint(Box<PorePoint>),
        Section(Box<Section>),
        StructureLoad(Box<StructureLoad>),
        SurfaceLoad(Box<SurfaceLoad>),
        Uplift(Box<Uplift>),
        Wall(Box<Wall>),
        WallLoad(Box<WallLoad>),
        WaterBalance(Box<WaterBalance>),
        WaterTable(Box<WaterTable>),
    }
}

impl Quantity for Sampled {
    fn headings(&self, scene: &Scene) -> Vec<Heading> {
        each!(self, quantity => quantity.headings(scene))
    }

    fn rows(&self) -> usize {
        each!(self, quantity => quantity.rows())
    }

    fn delay(&self) -> f64 {
        each!(self, quantity => quantity.delay())
    }

    fn begin(&mut self, run: &Run) -> Result<(), Error> {
        each!(self, quantity => quantity.begin(run))
    }

    fn remember(&mut self, table: &Path) -> io::Result<()> {
        each!(self, quantity => quantity.remember(table))
    }

    fn sample<S: Space>(&mut self, view: &StateView<S>, rows: &mut Rows) -> Result<bool, Error> {
        each!(self, quantity => quantity.sample(view, rows))
    }
}

impl Sampled {
    /// Returns the quantity of a probe.
    ///
    /// # Errors
    /// If the scene has no fluid of the kind that is sampled.
    pub(super) fn new(scene: &Scene, at: &ProbeAt) -> Result<Self, Error> {
        let in_pores = scene.seepage.is_some();
        Ok(match *at {
            ProbeAt::Point(point) if in_pores => boxed(PorePoint(point)),
            ProbeAt::Point(point) => boxed(Point::new(point)),
            ProbeAt::Line { from, to, points } if in_pores => {
                boxed(PoreLine::new(from, to, points))
            }
            ProbeAt::Line { from, to, points } => boxed(Line::new(from, to, points)),
            ProbeAt::Plane { axis, position } => boxed(Plane { axis, position }),
            ProbeAt::Gauge(cell) => boxed(Gauge::new(scene, cell)?),
            ProbeAt::Body(index) => boxed(Body::new(index)),
            ProbeAt::Structure { index, about } if in_pores => {
                boxed(SurfaceLoad::new(scene, index, about)?)
            }
            ProbeAt::Structure { index, about } => boxed(StructureLoad { index, about }),
            ProbeAt::Section {
                axis,
                position,
                part,
            } => boxed(Section::new(scene, axis, position, part.as_ref())?),
            ProbeAt::Crossing { from, to } => boxed(Crossing::new(scene, from, to)?),
            ProbeAt::Heave(prisms) => boxed(Heave(prisms)),
            ProbeAt::Uplift {
                axis,
                position,
                part,
                about,
            } => {
                let section = Section::new(scene, axis, position, part.as_ref())?;
                boxed(Uplift::new(section, about))
            }
            ProbeAt::WaterBalance => boxed(WaterBalance),
            ProbeAt::WaterTable(_) => boxed(WaterTable::new(scene)?),
            ProbeAt::Joint(point) => boxed(JointCell(point)),
            ProbeAt::Mouth(index) => boxed(Mouth(index)),
            ProbeAt::Block(index) => boxed(BlockLoad(index)),
            ProbeAt::WallLoad { wall, about } => boxed(WallLoad::new(wall, about)),
            ProbeAt::Wall(face) => boxed(Wall::new(scene, face)?),
            ProbeAt::Grains { part, .. } => boxed(Fabric::new(scene, part)),
            ProbeAt::Bed(ref bed) => boxed(Bed::new(bed)),
        })
    }
}

/// Returns the quantity in the list.
fn boxed<Q>(quantity: Q) -> Sampled
where
    Sampled: From<Box<Q>>,
{
    Box::new(quantity).into()
}
