//! Time averages of the velocity and of its products in every cell, and their means over planes.
//!
//! From a start time on and at a given interval, the state of each cell whose centre is in the fluid is added to
//! eleven sums: the number of samples, the density deviation, the velocity and its six products. From these follow
//!
//! ```text
//! <u_a>,  <p>,  <u_a' u_b'> = <u_a u_b> - <u_a> <u_b>
//! ```
//!
//! as fields (`averages`), and, where a `profile` is requested, the same for all cells of each plane across an axis
//! (`averages_profile.csv`): mean velocity and Reynolds stresses against the distance from a wall. The stresses of the
//! profile are relative to the mean of the plane. They do not contain eddies smaller than a cell.
//!
//! Each cell has its own sums, so that they do not depend on ranks and threads. Sums over planes are exact. The
//! sums are part of a checkpoint and of the hash of the state.

use super::fluid::lattice_image;
use base::error::Error;
use base::number::real;
use base::units::LatticeUnits;
use coupling::{BandStates, FluidView, bands, cells_of};
use decomposition::{Communicator, ExactSum};
use io::{Column, CsvTable, Image};
use plan::Plan;
use plan::interval::Interval;
use plan::scene::grid::Grid;
use std::path::{Path, PathBuf};

/// Sums of a cell: samples, density deviation, u v w, uu vv ww uv vw uw; lattice units.
pub const SUMS: usize = 11;

/// Index of the product for each component of the tensor, row by row.
const TENSOR: [usize; 9] = [0, 3, 5, 3, 1, 4, 5, 4, 2];

/// Columns of the profile, and their units.
pub(super) const HEADINGS: [(&str, &str); 13] = [
    ("time", "s"),
    ("position", "m"),
    ("samples", "-"),
    ("mean_velocity_x", "m/s"),
    ("mean_velocity_y", "m/s"),
    ("mean_velocity_z", "m/s"),
    ("mean_pressure", "Pa"),
    ("stress_xx", "m2/s2"),
    ("stress_yy", "m2/s2"),
    ("stress_zz", "m2/s2"),
    ("stress_xy", "m2/s2"),
    ("stress_yz", "m2/s2"),
    ("stress_xz", "m2/s2"),
];

/// Sums of the cells of a slab.
#[derive(Clone, Debug, PartialEq)]
pub struct Averages {
    first: u64,
    every: Interval,
    samples: u64,
    /// Sums in the order `[z][y][x][sum]`.
    sums: Vec<f64>,
    states: Scratch,
}

/// Buffer for a band of states, which is not part of the averages.
#[derive(Clone, Debug, Default)]
struct Scratch(BandStates);

impl PartialEq for Scratch {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Averages {
    /// Returns empty averages of a plan for the slab of `fluid`; none if the plan requests none.
    #[must_use]
    pub fn new(plan: &Plan, fluid: &dyn FluidView) -> Option<Self> {
        let (first, every) = Self::schedule(plan)?;
        Some(Self {
            first,
            every,
            samples: 0,
            sums: vec![0.0; fluid.cells().iter().product::<usize>() * SUMS],
            states: Scratch::default(),
        })
    }

    /// Returns the step of the first sample, and the interval of samples.
    fn schedule(plan: &Plan) -> Option<(u64, Interval)> {
        let written = plan.scene.output.averages.as_ref()?;
        // A sample at the very start of the run would be the initial state.
        let first = plan.clock.interval_to_steps(written.from).max(1);
        Some((first, plan.clock.every(written.sample_every)))
    }

    /// Compares the sampling schedule of a plan with that of the run that it continues at `step`. Returns `true` if the
    /// sums so far continue, `false` if the averages restart.
    ///
    /// If samples before `step` would be included that the plan does not request, or with another weight; the error
    /// is the field that changed.
    pub fn continues(old: &Plan, new: &Plan, step: u64) -> Result<bool, &'static str> {
        let Some((first, every)) = Self::schedule(new) else {
            return Ok(false);
        };
        let Some((old_first, old_every)) = Self::schedule(old) else {
            // Without sums of the time before the checkpoint the averages start later.
            return if first > step {
                Ok(false)
            } else {
                Err("output.averages.from")
            };
        };
        if (old_first, old_every) == (first, every) {
            return Ok(true);
        }
        // Either no sample was taken yet, or the new averages start later.
        if old_first > step || first > step {
            return Ok(false);
        }
        Err(if old_first == first {
            "output.averages.sample_every"
        } else {
            "output.averages.from"
        })
    }

    /// Adds the state after `step` steps, if a sample is due.
    pub fn sample(&mut self, step: u64, fluid: &dyn FluidView) {
        if step < self.first || !self.every.falls_on(step - self.first) {
            return;
        }
        self.samples += 1;
        let mut sums = self.sums.chunks_exact_mut(SUMS);
        let [nx, ny, nz] = fluid.cells();
        let states = &mut self.states.0;
        for band in bands(nz) {
            fluid.band_states(band.clone(), states);
            for (n, (cell, sums)) in cells_of(band, [nx, ny]).zip(&mut sums).enumerate() {
                if fluid.solid_at(cell) {
                    continue;
                }
                let drho = states.density[n];
                let [u, v, w] = states.velocity[n];
                let state = [1.0, drho, u, v, w, u * u, v * v, w * w, u * v, v * w, u * w];
                for (sum, value) in sums.iter_mut().zip(state) {
                    *sum += value;
                }
            }
        }
    }

    /// Returns the number of samples taken.
    #[must_use]
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// Returns the sums of the slab, in the order `[z][y][x][sum]`.
    #[must_use]
    pub fn sums(&self) -> &[f64] {
        &self.sums
    }

    /// Continues from saved sums of the same slab.
    pub fn restore(&mut self, samples: u64, sums: Vec<f64>) {
        self.samples = samples;
        self.sums = sums;
    }
}

/// Means of the summed quantities in SI.
struct MeanState {
    velocity: [f64; 3],
    pressure: f64,
    /// Mean products of the fluctuations of two components of the velocity.
    products: [f64; 6],
}

/// Returns the means of the summed quantities; NaN without samples.
fn means(sums: &[f64], units: &LatticeUnits) -> MeanState {
    let n = sums[0];
    let u: [f64; 3] = std::array::from_fn(|a| sums[2 + a] / n);
    let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];
    let scale = units.velocity_to_si(1.0).powi(2);
    let products = std::array::from_fn(|k| {
        let (a, b) = pairs[k];
        scale * (sums[5 + k] / n - u[a] * u[b])
    });
    MeanState {
        velocity: u.map(|u| units.velocity_to_si(u)),
        pressure: units.density_deviation_to_pressure(sums[1] / n),
        products,
    }
}

/// Output fields of the averages, in buffers that are reused. The table of the profile is on rank 0.
#[derive(Debug)]
pub(super) struct AverageFields {
    velocity: Vec<f64>,
    pressure: Vec<f64>,
    stress: Vec<f64>,
    samples: Vec<f64>,
    pub(super) profile: Option<usize>,
    pub(super) table: Option<CsvTable>,
}

impl AverageFields {
    pub(super) fn new(profile: Option<usize>) -> Self {
        Self {
            velocity: Vec::new(),
            pressure: Vec::new(),
            stress: Vec::new(),
            samples: Vec::new(),
            profile,
            table: None,
        }
    }

    pub(super) fn read(&mut self, averages: &Averages, units: &LatticeUnits) {
        self.velocity.clear();
        self.pressure.clear();
        self.stress.clear();
        self.samples.clear();
        for sums in averages.sums.chunks_exact(SUMS) {
            let means = means(sums, units);
            self.velocity.extend(means.velocity);
            self.pressure.push(means.pressure);
            self.stress.extend(TENSOR.map(|k| means.products[k]));
            self.samples.push(sums[0]);
        }
    }

    pub(super) fn image<'a>(&'a self, fluid: &dyn FluidView, grid: &Grid) -> Image<'a> {
        let column = |name, units, components, data: &'a [f64]| Column {
            name,
            units,
            components,
            data: data.into(),
        };
        let fields = vec![
            column("mean_velocity", "m/s", 3, &self.velocity),
            column("mean_pressure", "Pa", 1, &self.pressure),
            column("reynolds_stress", "m2/s2", 9, &self.stress),
            column("samples", "-", 1, &self.samples),
        ];
        lattice_image(fluid, grid, fields)
    }
}

/// Returns the rows of the profile across `axis`, without the time: one row per plane of cells. Collective.
pub(super) fn profile(
    averages: &Averages,
    fluid: &dyn FluidView,
    grid: &Grid,
    axis: usize,
    communicator: &Communicator,
) -> Vec<Vec<f64>> {
    let (start, cells) = (fluid.start(), fluid.cells());
    (0..grid.cells[axis])
        .map(|plane| {
            let mut sums: [ExactSum; SUMS] = std::array::from_fn(|_| ExactSum::new());
            if let Some(local) = plane.checked_sub(start[axis]).filter(|n| *n < cells[axis]) {
                let (mut from, mut to) = ([0; 3], cells);
                (from[axis], to[axis]) = (local, local + 1);
                for z in from[2]..to[2] {
                    for y in from[1]..to[1] {
                        for x in from[0]..to[0] {
                            let place = SUMS * ((z * cells[1] + y) * cells[0] + x);
                            let cell = &averages.sums[place..place + SUMS];
                            for (sum, value) in sums.iter_mut().zip(cell) {
                                sum.add(*value);
                            }
                        }
                    }
                }
            }
            let sums = sums.map(|mut sum| {
                sum.all_reduce(communicator);
                sum.value()
            });
            let means = means(&sums, fluid.units());
            let mut row = vec![(real(plane) + 0.5) * grid.spacing, sums[0]];
            row.extend(means.velocity);
            row.push(means.pressure);
            row.extend(means.products);
            row
        })
        .collect()
}

/// Returns the path of the table of the profile.
pub(super) fn profile_path(folder: &Path) -> PathBuf {
    folder.join("averages_profile.csv")
}

/// Opens the table of the profile, on rank 0; `resumed_at` has the step of a restart, and `true` if the rows of
/// that step are complete.
pub(super) fn open(path: &Path, resumed_at: Option<(u64, bool)>) -> Result<CsvTable, io::Error> {
    match resumed_at {
        None | Some((0, false)) => CsvTable::create(path, &HEADINGS),
        Some((step, true)) => CsvTable::resume(path, &HEADINGS, step),
        Some((step, false)) => CsvTable::resume(path, &HEADINGS, step - 1),
    }
}

/// Returns the error for averages without a lattice.
pub(super) fn none() -> Error {
    Error::Internal("there are no averages to write".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use case::Document;
    use lbm::boundary::Flux;
    use std::path::Path;

    const CASE: &str = r#"{
      "title": "swing",
      "domain": {"size": [3e-3, 4e-3], "spacing": 1e-3},
      "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-6, "time_step": 0.1}},
      "time": {"end": 10},
      "output": {"averages": {"from": 1, "sample_every": 0.2, "profile": "y"}}
    }"#;

    /// u = y + s, v = -s/2 in every cell with s = (-1)^step; the first cell is covered.
    struct Swing(LatticeUnits, f64);

    impl FluidView for Swing {
        fn units(&self) -> &LatticeUnits {
            &self.0
        }
        fn cells(&self) -> [usize; 3] {
            [3, 4, 1]
        }
        fn start(&self) -> [usize; 3] {
            [0; 3]
        }
        fn state(&self, [_, y, _]: [usize; 3]) -> (f64, [f64; 3]) {
            (0.3 + self.1, [real(y) + self.1, -0.5 * self.1, 0.0])
        }
        fn stress(&self, _: [usize; 3]) -> [[f64; 3]; 3] {
            [[0.0; 3]; 3]
        }
        fn body_at(&self, cell: [usize; 3]) -> Option<u64> {
            (cell == [0; 3]).then_some(7)
        }
        fn patches(&self) -> Vec<String> {
            Vec::new()
        }
        fn fluxes(&self) -> Vec<Flux> {
            Vec::new()
        }
    }

    #[test]
    fn means_and_products_of_a_swing() {
        let document = Document::read(CASE, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let units = plan.units.unwrap();
        let mut averages = Averages::new(&plan, &Swing(units, 0.0)).unwrap();
        // Samples are due at 10, 12, 14 ...: the sign of the state changes from one of them to the next.
        for step in 0..=24_u32 {
            let sign = if (step / 2) % 2 == 0 { 1.0 } else { -1.0 };
            averages.sample(u64::from(step), &Swing(units, 0.1 * sign));
        }
        assert_eq!(averages.samples(), 8);
        let fluid = Swing(units, 0.0);
        let serial = Communicator::serial();
        let rows = profile(&averages, &fluid, &plan.scene.grid, 1, &serial);
        assert_eq!(rows.len(), 4);
        let speed = units.velocity_to_si(1.0);
        for (y, row) in rows.iter().enumerate() {
            let cells = if y == 0 { 2.0 } else { 3.0 };
            let pressure = units.density_deviation_to_pressure(0.3);
            let expected = [
                (real(y) + 0.5) * 1e-3,
                8.0 * cells,
                real(y) * speed,
                0.0,
                0.0,
                pressure,
                0.01 * speed * speed,
                0.0025 * speed * speed,
                0.0,
                -0.005 * speed * speed,
                0.0,
                0.0,
            ];
            assert_eq!(row.len() + 1, HEADINGS.len());
            for (found, expected) in row.iter().zip(expected) {
                assert_abs_diff_eq!(*found, expected, epsilon = 1e-12 + 1e-12 * expected.abs());
            }
        }
        let mut fields = AverageFields::new(None);
        fields.read(&averages, &units);
        assert!(fields.velocity[0].is_nan(), "a covered cell has no samples");
        let second = &fields.stress[9..18];
        for (k, expected) in [0.01, -0.005, 0.0, -0.005, 0.0025, 0.0, 0.0, 0.0, 0.0]
            .into_iter()
            .enumerate()
        {
            assert_abs_diff_eq!(second[k], expected * speed * speed, epsilon = 1e-15);
        }
    }

    #[test]
    fn saved_sums_go_on() {
        let document = Document::read(CASE, &[], Path::new(".")).unwrap();
        let plan = Plan::prepare(document).unwrap();
        let units = plan.units.unwrap();
        let fluid = Swing(units, 0.01);
        let mut straight = Averages::new(&plan, &fluid).unwrap();
        let mut parts = straight.clone();
        straight.sample(10, &fluid);
        parts.sample(10, &fluid);
        let mut other = Averages::new(&plan, &fluid).unwrap();
        other.restore(parts.samples(), parts.sums().to_vec());
        straight.sample(12, &fluid);
        other.sample(12, &fluid);
        assert_eq!(straight, other);
    }

    /// Checks that past sums continue under the same schedule, are dropped by one that starts later, and forbid any
    /// other.
    #[test]
    fn sums_go_on_only_under_the_same_schedule() {
        let plan = |set: &[&str]| {
            let set: Vec<String> = set.iter().map(|one| (*one).to_owned()).collect();
            Plan::prepare(Document::read(CASE, &set, Path::new("")).unwrap()).unwrap()
        };
        let (from, every) = ("output.averages.from", "output.averages.sample_every");
        let old = plan(&[]);
        // A step takes 0.1 s, the first sample is that of step 10.
        let restart = |set: &[&str], step: u64| Averages::continues(&old, &plan(set), step);
        assert_eq!(restart(&[], 50), Ok(true));
        assert_eq!(restart(&["time.end=20"], 50), Ok(true));
        assert_eq!(restart(&["output.averages.from=6"], 50), Ok(false));
        assert_eq!(restart(&["output.averages.from=4"], 50), Err(from));
        assert_eq!(restart(&["output.averages.from=0.5"], 50), Err(from));
        assert_eq!(
            restart(&["output.averages.sample_every=0.5"], 50),
            Err(every)
        );
        let later = ["output.averages.from=6", "output.averages.sample_every=0.5"];
        assert_eq!(restart(&later, 50), Ok(false));
        // No sample was taken yet.
        assert_eq!(restart(&["output.averages.sample_every=0.5"], 8), Ok(false));
    }
}
