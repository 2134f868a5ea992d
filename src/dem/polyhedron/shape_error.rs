//! Errors in the input of a block's shape.

/// Reason why vertices, half-spaces or triangles make no block.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// Too few of what it is made from.
    #[error("{found} {what}, where a block needs at least {least}")]
    Few {
        /// Vertices, half-spaces or triangles.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Minimum number.
        least: usize,
    },
    /// Too many of what it is made from.
    #[error("{found} {what}, where at most {most} are allowed")]
    Many {
        /// Vertices, half-spaces or triangles.
        what: &'static str,
        /// Number found.
        found: usize,
        /// Maximum number.
        most: usize,
    },
    /// A number that is none, or a normal or an edge of no length.
    #[error("{what} {index} is not finite or has no length")]
    Unusable {
        /// Vertex, half-space, edge or triangle.
        what: &'static str,
        /// Index of the faulty item.
        index: usize,
    },
    /// Solid without a volume.
    #[error("the block is flat: {thickness:e} m thick over a width of {width:e} m")]
    Flat {
        /// Smallest extent \[m\].
        thickness: f64,
        /// Largest extent \[m\].
        width: f64,
    },
    /// The half-spaces have no point in common.
    #[error(
        "the half-spaces have no point in common: each point is outside one of them by {gap:e} m or more"
    )]
    Empty {
        /// Distance of the best point outside \[m\].
        gap: f64,
    },
    /// The half-spaces leave a direction open.
    #[error("the half-spaces are not bounded towards ({}, {}, {})", .direction[0], .direction[1], .direction[2])]
    Unbounded {
        /// Unit vector along which the solid is unbounded.
        direction: [f64; 3],
    },
    /// A corner outside the plane of a facet.
    #[error(
        "the surface is not convex: a corner stands {height:e} m outside the plane of triangle {triangle}"
    )]
    NotConvex {
        /// Number of the triangle.
        triangle: usize,
        /// Height of the corner above the face \[m\].
        height: f64,
    },
    /// A surface with holes, or with triangles turned the wrong way.
    #[error("the triangles do not close: they enclose {enclosed:e} m³ of a block of {volume:e} m³")]
    NotClosed {
        /// Volume by the sum over triangles \[m³\].
        enclosed: f64,
        /// Volume between their planes \[m³\].
        volume: f64,
    },
}
