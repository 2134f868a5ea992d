//! Fields of the fluid as an image, one value per cell, in SI.
//!
//! Covered cells contain the state of the fictitious fluid inside a body; `solid` marks them. The vorticity is a
//! central difference, one-sided in the cells at a face that is not periodic.

use super::vorticity::Velocities;
use base::error::Error;
use case::fluid::Precision;
use case::observe::FieldName;
use coupling::{BandStates, FluidView, bands, cells_of};
use decomposition::Domain;
use io::{Column, Data, Element, Image};
use plan::scene::grid::Grid;

/// Number type of a field in a file.
pub(crate) trait Number: Element {
    /// Returns the nearest number of this type.
    fn from_value(value: f64) -> Self;
}

impl Number for f64 {
    fn from_value(value: f64) -> Self {
        value
    }
}

impl Number for f32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "files in f32 are rounded on purpose"
    )]
    fn from_value(value: f64) -> Self {
        value as Self
    }
}

/// Columns of one output, in buffers that are reused.
#[derive(Debug)]
pub(crate) enum Fields {
    Single(Buffers<f32>),
    Double(Buffers<f64>),
}

impl Fields {
    pub(crate) fn new(fields: &[FieldName], precision: Precision) -> Self {
        match precision {
            Precision::F32 => Self::Single(Buffers::new(fields)),
            Precision::F64 => Self::Double(Buffers::new(fields)),
        }
    }

    /// Reads the fields of the slab. Collective.
    pub(crate) fn read(
        &mut self,
        fluid: &dyn FluidView,
        grid: &Grid,
        domain: &Domain,
    ) -> Result<(), Error> {
        match self {
            Self::Single(buffers) => buffers.read(fluid, grid, domain),
            Self::Double(buffers) => buffers.read(fluid, grid, domain),
        }
    }

    /// Returns the box of this rank in the image.
    pub(crate) fn image<'a>(&'a self, fluid: &dyn FluidView, grid: &Grid) -> Image<'a> {
        let fields = match self {
            Self::Single(buffers) => buffers.columns(grid.dimension),
            Self::Double(buffers) => buffers.columns(grid.dimension),
        };
        lattice_image(fluid, grid, fields)
    }
}

/// Returns the box of this rank in the image of a lattice.
pub(super) fn lattice_image<'a>(
    fluid: &dyn FluidView,
    grid: &Grid,
    fields: Vec<Column<'a>>,
) -> Image<'a> {
    Image {
        origin: [0.0; 3],
        spacing: [grid.spacing; 3],
        faces: None,
        cells: grid.cells,
        start: fluid.start(),
        count: fluid.cells(),
        fields,
    }
}

#[derive(Debug)]
pub(crate) struct Buffers<T> {
    fields: Vec<(FieldName, Vec<T>)>,
    solid: Vec<u8>,
    body: Vec<i32>,
    velocities: Velocities,
    states: BandStates,
}

impl<T: Number> Buffers<T> {
    fn new(fields: &[FieldName]) -> Self {
        Self {
            fields: fields.iter().map(|field| (*field, Vec::new())).collect(),
            solid: Vec::new(),
            body: Vec::new(),
            velocities: Velocities::default(),
            states: BandStates::default(),
        }
    }

    fn read(&mut self, fluid: &dyn FluidView, grid: &Grid, domain: &Domain) -> Result<(), Error> {
        let units = fluid.units();
        let cells = fluid.cells();
        if self.fields.iter().any(|f| f.0 == FieldName::Vorticity) {
            self.velocities.read(fluid, domain)?;
        }
        self.solid.clear();
        self.body.clear();
        for (_, to) in &mut self.fields {
            to.clear();
        }
        let of_states = |field: &FieldName| {
            matches!(
                field,
                FieldName::Velocity | FieldName::Pressure | FieldName::Density
            )
        };
        let states_wanted = self.fields.iter().any(|(field, _)| of_states(field));
        for band in bands(cells[2]) {
            if states_wanted {
                fluid.band_states(band.clone(), &mut self.states);
            }
            let (density, velocity) = (&self.states.density, &self.states.velocity);
            let [nx, ny, _] = cells;
            let band = cells_of(band, [nx, ny]);
            for (field, to) in &mut self.fields {
                match field {
                    FieldName::Velocity => to.extend(
                        velocity
                            .iter()
                            .flat_map(|u| u.map(|u| T::from_value(units.velocity_to_si(u)))),
                    ),
                    FieldName::Pressure => to.extend(
                        density
                            .iter()
                            .map(|rho| T::from_value(units.density_deviation_to_pressure(*rho))),
                    ),
                    FieldName::Density => to.extend(
                        density
                            .iter()
                            .map(|rho| T::from_value(units.density_deviation_to_density(*rho))),
                    ),
                    FieldName::Vorticity => {
                        let first = if grid.dimension == 3 { 0 } else { 2 };
                        for cell in band.clone() {
                            let w = self.velocities.vorticity(cell, grid.periodic);
                            let w = w.map(|w| T::from_value(units.rate_to_si(w)));
                            to.extend_from_slice(&w[first..]);
                        }
                    }
                    FieldName::EddyViscosity => to.extend(band.clone().map(|cell| {
                        T::from_value(units.viscosity_to_si(fluid.eddy_viscosity(cell)))
                    })),
                    FieldName::Fill => {
                        to.extend(band.clone().map(|cell| T::from_value(fluid.fill(cell))));
                    }
                    // The plan refuses these fields.
                    FieldName::Head | FieldName::StreamFunction | FieldName::Saturation => {}
                    FieldName::Solid => {
                        for cell in band.clone() {
                            let body = fluid.body_at(cell);
                            self.solid.push(u8::from(fluid.solid_at(cell)));
                            self.body
                                .push(body.map_or(-1, |id| i32::try_from(id).unwrap_or(i32::MAX)));
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn columns(&self, dimension: usize) -> Vec<Column<'_>> {
        let mut columns = Vec::new();
        for (field, values) in &self.fields {
            let (name, units) = match field {
                FieldName::Velocity => ("velocity", "m/s"),
                FieldName::Pressure => ("pressure", "Pa"),
                FieldName::Density => ("density", "kg/m3"),
                FieldName::Vorticity => ("vorticity", "1/s"),
                FieldName::EddyViscosity => ("eddy_viscosity", "m2/s"),
                FieldName::Solid => ("solid", "-"),
                FieldName::Fill => ("fill", "-"),
                // The plan refuses these fields.
                FieldName::Head | FieldName::StreamFunction | FieldName::Saturation => continue,
            };
            let data = if *field == FieldName::Solid {
                Data::U8(&self.solid)
            } else {
                T::data(values)
            };
            columns.push(Column {
                name,
                units,
                components: field.components(dimension),
                data,
            });
            if *field == FieldName::Solid {
                columns.push(Column {
                    name: "body",
                    units: "-",
                    components: 1,
                    data: Data::I32(&self.body),
                });
            }
        }
        columns
    }
}
