//! Fields of the seepage as cell data of its coarse grid, in SI.
//!
//! Every rank has the whole grid; the first one writes it. `velocity` is the Darcy flux (interstitial in the
//! equations as printed); cells outside the walls have porosity 0.

use super::fluid::Number;
use case::fluid::Precision;
use case::observe::FieldName;
use coupling::seepage::Seepage;
use darcy::SeepageGrid;
use dem::space::Space;
use io::{Column, Image};

/// Columns of one output, in buffers that are reused.
#[derive(Debug)]
pub(crate) enum SeepageFields {
    Single(Buffers<f32>),
    Double(Buffers<f64>),
}

#[derive(Debug, Default)]
pub(crate) struct Buffers<T> {
    pressure: Vec<T>,
    porosity: Vec<T>,
    velocity: Vec<T>,
    head: Vec<T>,
    saturation: Vec<T>,
    stream: Vec<T>,
    wanted: Vec<FieldName>,
}

impl SeepageFields {
    pub(crate) fn new(fields: &[FieldName], precision: Precision) -> Self {
        match precision {
            Precision::F32 => Self::Single(Buffers::new(fields)),
            Precision::F64 => Self::Double(Buffers::new(fields)),
        }
    }

    /// Reads the fields on the first rank.
    pub(crate) fn read<S: Space>(&mut self, seepage: &Seepage<S>, first: bool) {
        match self {
            Self::Single(buffers) => buffers.read(seepage, first),
            Self::Double(buffers) => buffers.read(seepage, first),
        }
    }

    /// Returns the box of this rank in the image.
    pub(crate) fn image<'a, S: Space>(&'a self, seepage: &Seepage<S>, first: bool) -> Image<'a> {
        let grid = seepage.grid();
        Image {
            origin: grid.origin,
            spacing: grid.spacing,
            cells: grid.cells,
            start: [0; 3],
            count: if first {
                grid.cells
            } else {
                [grid.cells[0], grid.cells[1], 0]
            },
            faces: graded_faces(grid),
            fields: match self {
                Self::Single(buffers) => buffers.columns(),
                Self::Double(buffers) => buffers.columns(),
            },
        }
    }
}

/// Returns the positions of the faces along each axis \[m\]; none if all cells are equal.
fn graded_faces(grid: &SeepageGrid) -> Option<[Vec<f64>; 3]> {
    let of_axis = |a: usize| {
        let axis = grid.axis(a);
        (0..=axis.cells).map(|n| axis.face(n)).collect()
    };
    grid.is_graded().then(|| std::array::from_fn(of_axis))
}

impl<T: Number> Buffers<T> {
    fn new(fields: &[FieldName]) -> Self {
        Self {
            pressure: Vec::new(),
            porosity: Vec::new(),
            velocity: Vec::new(),
            head: Vec::new(),
            saturation: Vec::new(),
            stream: Vec::new(),
            wanted: fields.to_vec(),
        }
    }

    fn read<S: Space>(&mut self, seepage: &Seepage<S>, first: bool) {
        self.pressure.clear();
        self.porosity.clear();
        self.velocity.clear();
        self.head.clear();
        self.saturation.clear();
        self.stream.clear();
        if !first {
            return;
        }
        let (pressure, pores) = (seepage.pressure(), seepage.pores());
        for cell in 0..seepage.grid().count() {
            self.pressure.push(T::from_value(pressure.pressure(cell)));
            self.porosity.push(T::from_value(pores.porosity()[cell]));
            self.velocity
                .extend(seepage.water_velocity(cell).map(T::from_value));
            let head = if pores.porosity()[cell] > 0.0 {
                pressure.head(pressure.reduced(cell))
            } else {
                f64::NAN
            };
            self.head.push(T::from_value(head));
            self.saturation
                .push(T::from_value(pressure.saturation(cell)));
        }
        if self.wanted.contains(&FieldName::StreamFunction) {
            let (grid, corners) = (seepage.grid(), pressure.stream_function());
            for cell in 0..grid.count() {
                let [i, j, _] = grid.cell(cell);
                let at = |k: usize, l: usize| corners[l * (grid.cells[0] + 1) + k];
                let mean = 0.25 * ((at(i, j) + at(i + 1, j)) + (at(i, j + 1) + at(i + 1, j + 1)));
                self.stream.push(T::from_value(mean));
            }
        }
    }

    fn columns(&self) -> Vec<Column<'_>> {
        let column = |name, units, components, values| Column {
            name,
            units,
            components,
            data: T::data(values),
        };
        let mut columns = Vec::new();
        if self.wanted.contains(&FieldName::Velocity) {
            columns.push(column("velocity", "m/s", 3, &self.velocity));
        }
        if self.wanted.contains(&FieldName::Pressure) {
            columns.push(column("pressure", "Pa", 1, &self.pressure));
        }
        if self.wanted.contains(&FieldName::Head) {
            columns.push(column("head", "m", 1, &self.head));
        }
        if self.wanted.contains(&FieldName::Saturation) {
            columns.push(column("saturation", "-", 1, &self.saturation));
        }
        if self.wanted.contains(&FieldName::StreamFunction) {
            columns.push(column("stream_function", "m2/s", 1, &self.stream));
        }
        columns.push(column("porosity", "-", 1, &self.porosity));
        columns
    }
}
