//! Conductivities of cells, which may differ along the axes, and fluxes between cells.

use crate::enclosure::Openness;
use crate::grid::SeepageGrid;
use crate::layout::Layout;

/// Cells with an anisotropic conductivity, or of different widths.
pub(super) struct Directions {
    /// Ratio of the conductivity along each axis to that of the cell.
    pub(super) ratios: Vec<[f64; 3]>,
    /// Conductivity along each axis, times the width of the narrowest cell over that of the cell.
    pub(super) conductivity: [Vec<f64>; 3],
}

impl Directions {
    /// Returns equal conductivities along the axes.
    pub(super) fn new(cells: usize, positions: usize) -> Self {
        Self {
            ratios: vec![[1.0; 3]; cells],
            conductivity: std::array::from_fn(|_| vec![0.0; positions]),
        }
    }

    /// Returns the conductivities of the cells of a graded grid; none if all cells are equal.
    pub(super) fn of_graded(grid: &SeepageGrid, positions: usize) -> Option<Box<Self>> {
        let graded = grid.is_graded();
        graded.then(|| Box::new(Self::new(grid.count(), positions)))
    }
}

/// Fluxes between cells: faces, conductivities, and the flux carried by grains.
pub(super) struct Conduction {
    /// Open area of a face times 2 over the width of the narrowest cell, per axis; 0 for a closed face.
    pub(super) factor: [Vec<f64>; 3],
    /// Inverse of the open area of a face, per axis; 0 for a closed one.
    pub(super) per_area: [Vec<f64>; 3],
    /// Total conductivity: water plus grains.
    pub(super) conductivity: Vec<f64>,
    /// Data of cells with an anisotropic conductivity.
    pub(super) directions: Option<Box<Directions>>,
    /// Flux carried by the grains along each axis \[m/s\].
    pub(super) carried: [Vec<f64>; 3],
    /// `true` if this flux is not zero.
    pub(super) carries: bool,
    /// Flux driven by the gradient through each cell \[m/s\].
    pub(super) driven: Vec<[f64; 3]>,
    pub(super) conducts: Vec<bool>,
}

impl Conduction {
    /// Returns the faces of a grid with zero conductivity.
    pub(super) fn new(openness: &Openness, layout: &Layout) -> Self {
        let (grid, n) = (&openness.grid, layout.len());
        let mut all = Self {
            factor: std::array::from_fn(|_| vec![0.0; n]),
            per_area: std::array::from_fn(|_| vec![0.0; n]),
            conductivity: vec![0.0; n],
            directions: Directions::of_graded(grid, n),
            carried: std::array::from_fn(|_| vec![0.0; n]),
            carries: false,
            driven: vec![[0.0; 3]; grid.count()],
            conducts: (0..grid.count()).map(|c| !openness.blocked(c)).collect(),
        };
        for index in 0..grid.count() {
            let cell = grid.cell(index);
            for axis in 0..grid.dimension {
                let open = openness.faces[axis][openness.face(axis, cell)];
                if cell[axis] > 0 && open > 0.0 {
                    let area = open * grid.area(axis, cell);
                    all.factor[axis][layout.position(cell)] = 2.0 * area / grid.spacing[axis];
                    all.per_area[axis][layout.position(cell)] = 1.0 / area;
                }
            }
        }
        all
    }
}
