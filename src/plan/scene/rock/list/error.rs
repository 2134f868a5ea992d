//! Reasons why blocks of a file cannot be used.

use dem::polyhedron::ShapeError;
use std::fmt;

/// Line after the last word of a body of LMGC90.
pub(super) const END: &str = "$$$$$$";
/// Types of cells of VTK that may be blocks.
pub(super) const TETRAHEDRON: usize = 10;
pub(super) const POLYHEDRON: usize = 42;

/// Place of a block in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Block with this id.
    Block(u64),
    /// Body of LMGC90 that begins on this line.
    Body(usize),
    /// Cell of VTK with this number.
    Cell(usize),
    /// Line of LMGC90.
    Line(usize),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Block(id) => write!(f, "block {id}"),
            Self::Body(line) => write!(f, "body of line {line}"),
            Self::Cell(number) => write!(f, "cell {number}"),
            Self::Line(number) => write!(f, "line {number}"),
        }
    }
}

/// Reason why a block of a file, or the whole file, cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ListError {
    /// Error in a part of the file.
    #[error("{0}: {1}")]
    Of(Origin, Box<Self>),
    /// Number of blocks with further errors.
    #[error("{0} more blocks cannot be used")]
    More(usize),
    /// File without a block.
    #[error("the file contains no block")]
    NoBlock,
    /// Geometry that is not a block.
    #[error(transparent)]
    Shape(#[from] ShapeError),
    /// Face with the index of a point that does not exist.
    #[error("there is no point {0}")]
    NoPoint(usize),
    /// Faces that enclose another volume than their hull.
    #[error(
        "the polyhedron is not convex: its faces enclose {inside} m3, its convex hull {hull} m3; cut it into convex \
         blocks"
    )]
    NotConvex {
        /// Volume inside the faces \[m³\].
        inside: f64,
        /// Volume of the hull \[m³\].
        hull: f64,
    },

    /// Text that is not JSON.
    #[error("the file is not JSON: {0}")]
    NotJson(serde_json::Error),
    /// Field that cannot be read.
    #[error("{}: {}", .0.path(), .0.inner())]
    Field(serde_path_to_error::Error<serde_json::Error>),
    /// Id of an earlier block.
    #[error("another block has this id")]
    KnownId,
    /// Block with neither or with both kinds of geometry.
    #[error("the block needs either `half_spaces` or `vertices`")]
    NoGeometry,

    /// File of LMGC90 that ends before a body.
    #[error("the file ends before the body")]
    NoBody,
    /// Body of LMGC90 that does not end.
    #[error("the file ends before `{END}`")]
    NoEnd,
    /// Head of a body of LMGC90 that is not a rigid body in space.
    #[error("`{0}` is not read; a block is a rigid body in space (RBDY3)")]
    NotRigid(String),
    /// Number of contactors of a body of LMGC90 that does not have one.
    #[error("the body has {0} contactors; a block is one polyhedron (POLYR): make a body of each")]
    Contactors(usize),
    /// Contactor of LMGC90 that is not a block.
    #[error("a contactor {0} is not a block; remove the body and use `walls` or `grains`")]
    Contactor(String),
    /// Line of a plane of LMGC90 that is not read.
    #[error("`{0}` of a plane is not read; write a polyhedron (POLYR)")]
    OfPlane(String),
    /// Polyhedron of LMGC90 with too few lines.
    #[error("the list of its corners and facets is incomplete")]
    FewLines,
    /// Facet of LMGC90 with the number of a corner that does not exist.
    #[error("there is no corner {0}")]
    NoCorner(usize),
    /// Body of LMGC90 without a node.
    #[error("the body has no node NO6xx")]
    NoNode,
    /// Body of LMGC90 with a rotation.
    #[error("the body is turned (coo4, coo5, coo6); write its corners where they are")]
    Turned,
    /// Line of LMGC90 without the expected numbers.
    #[error("`{line}` does not have {count} numbers after `=`")]
    FewNumbers {
        /// Text of the line.
        line: String,
        /// Expected number of numbers.
        count: usize,
    },

    /// VTK file that is not text.
    #[error("a binary VTK file is not read: save it as text (ASCII)")]
    Binary,
    /// VTK file with another data set.
    #[error(
        "a VTK file of blocks has the data set UNSTRUCTURED_GRID with one cell for each block, not {0}"
    )]
    DataSet(String),
    /// VTK file that ends before this part.
    #[error("the VTK file ends before {0}")]
    Ends(String),
    /// Word of a VTK file at the position of another part.
    #[error("the VTK file has `{word}` where {expected} is expected")]
    Word {
        /// Word.
        word: String,
        /// Expected part.
        expected: String,
    },
    /// Tetrahedron of VTK with another number of points.
    #[error("a tetrahedron has 4 points, not {0}")]
    Tetrahedron(usize),
    /// Type of a cell of VTK that is not a block.
    #[error(
        "cells of type {0} are not read; a block is a tetrahedron ({TETRAHEDRON}) or a polyhedron ({POLYHEDRON})"
    )]
    CellType(usize),
    /// Polyhedron of VTK with too few numbers.
    #[error("the list of its faces is incomplete")]
    FewFaces,
    /// Number of values after the last face of a polyhedron of VTK.
    #[error("{0} numbers follow the last face")]
    ManyNumbers(usize),
}

impl ListError {
    /// Returns the error with the place at which it occurred.
    pub(super) fn with_origin(self, origin: Origin) -> Self {
        Self::Of(origin, Box::new(self))
    }
}
