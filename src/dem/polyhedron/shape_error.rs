//! Errors in the definition of the shape of a block.

/// Reason why vertices, half-spaces or triangles do not define a block.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// Too few items.
    #[error("the block has {found} {what}, but needs at least {least}")]
    Few {
        /// Vertices, half-spaces or triangles.
        what: &'static str,
        /// Number of items found.
        found: usize,
        /// Minimum number of items.
        least: usize,
    },
    /// Too many items.
    #[error("the block has {found} {what}, but at most {most} are allowed")]
    Many {
        /// Vertices, half-spaces or triangles.
        what: &'static str,
        /// Number of items found.
        found: usize,
        /// Maximum number of items.
        most: usize,
    },
    /// Number that is not finite, or normal or edge without length.
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
    /// Half-spaces without a common point.
    #[error(
        "the half-spaces have no point in common: each point is outside one of them by {gap:e} m or more"
    )]
    Empty {
        /// Smallest distance of any point outside \[m\].
        gap: f64,
    },
    /// Half-spaces that leave a direction open.
    #[error("the half-spaces do not bound the block towards ({}, {}, {})", .direction[0], .direction[1], .direction[2])]
    Unbounded {
        /// Unit vector along which the solid is unbounded.
        direction: [f64; 3],
    },
    /// Corner outside the plane of a facet.
    #[error(
        "the surface is not convex: a corner lies {height:e} m outside the plane of triangle {triangle}"
    )]
    NotConvex {
        /// Number of the triangle.
        triangle: usize,
        /// Height of the corner above the face \[m\].
        height: f64,
    },
    /// Surface with holes, or with triangles of wrong orientation.
    #[error(
        "the triangles do not form a closed surface: they enclose {enclosed:e} m³ of a block of {volume:e} \
             m³"
    )]
    NotClosed {
        /// Volume by the sum over triangles \[m³\].
        enclosed: f64,
        /// Volume between the half-spaces \[m³\].
        volume: f64,
    },
}
