//! Rain above the permeability, which ponds and runs off.

use super::transient::{advancing, closes, transient};
use super::*;
use crate::retention::RetentionLaw;
use crate::{DrainCells, InitialWater, TransientSettings};

/// Loam, silt and clay of R. F. Carsel and R. S. Parrish (Water Resour. Res. 24 (1988) 755): the slope of their
/// permeability is infinite at saturation.
const SOILS: [VanGenuchten; 3] = [
    VanGenuchten {
        alpha: 3.6,
        n: 1.56,
        saturated_content: 0.43,
        residual_content: 0.078,
        exponent: 0.5,
    },
    VanGenuchten {
        alpha: 1.6,
        n: 1.37,
        saturated_content: 0.46,
        residual_content: 0.034,
        exponent: 0.5,
    },
    VanGenuchten {
        alpha: 0.8,
        n: 1.09,
        saturated_content: 0.38,
        residual_content: 0.068,
        exponent: 0.5,
    },
];

/// Returns the rain on the top of a plane grid, with a base in air.
fn rain_and_base(grid: &SeepageGrid, rate: f64) -> Vec<PressurePatch> {
    let width = [0.0, grid.spacing[0] * real(grid.cells[0])];
    let base = Condition::SeepageFace { level: None };
    vec![
        patch(grid, 1, true, width, Condition::Rain { rate }),
        patch(grid, 1, false, width, base),
    ]
}

/// Ground below a slope that falls along x, in stairs of cells, under rain on the slope; the base is in air.
fn slope(law: VanGenuchten, fall: f64, rate: f64, interval: f64) -> Pressure {
    let grid = plane([8, 10], [0.8, 1.0]);
    let above = (0..grid.count()).map(|cell| {
        let centre = grid.centre(grid.cell(cell));
        centre[1] > 1.0 - fall * centre[0]
    });
    let air = DrainCells {
        from: [0; 3],
        to: grid.cells,
        stays: false,
        only: Some(above.collect()),
    };
    let open = Openness::measure(&grid, &Enclosure::Everything).with_drains(&[air]);
    let surface = PressurePatch {
        axis: 0,
        upper: false,
        from: [0; 3],
        to: [0; 3],
        condition: Condition::Rain { rate },
        inside: true,
    };
    let mut patches = vec![surface];
    patches.extend(rain_and_base(&grid, rate));
    let volume = vec![grid.volume([0; 3]); grid.count()];
    Pressure::new(&open, patches, WATER, settings(), &Communicator::serial())
        .unwrap()
        .with_soil(Soil {
            retention: Retention::VanGenuchten(law),
        })
        .with_transient(
            transient(InitialWater::PressureHead(-2.0), interval),
            &volume,
        )
}

/// Checks rain of 1.2 to 10 times the permeability on level ground and on slopes until the ground passes as much water
/// as it can, the permeability times the area in plan.
#[test]
fn rain_above_the_permeability_ponds_and_runs_off() {
    for law in SOILS {
        for (fall, part) in [(0.0, 4.0), (0.1, 10.0), (0.5, 1.2), (1.0, 4.0)] {
            let mut solver = slope(law, fall, part, 0.1);
            let conductivity = conductivity(solver.grid(), 1.0);
            let mut before = 0.0;
            let mut rate = 0.0;
            for _ in 0..6 {
                solver.solve(still(&conductivity)).unwrap();
                closes(&solver);
                let entered = solver.water_balance().unwrap().entered;
                (rate, before) = ((entered - before) / (0.8 * 0.1), entered);
            }
            println!("{} {fall} {part}: {rate}", law.n);
            assert!((rate - 1.0).abs() < 1e-6, "{fall} {part}: {rate}");
        }
    }
}

/// Integral of the relative permeability over the suction from 0 to a suction \[m\].
fn matric_potential(law: &VanGenuchten, suction: f64) -> f64 {
    // The integrand changes fastest at saturation: s = x^8.
    let (parts, last) = (20_000, suction.powf(0.125));
    let value = |n: i32| {
        let x = last * f64::from(n) / f64::from(parts);
        let permeability = if n == 0 {
            1.0
        } else {
            law.state(-x.powi(8)).log_permeability.exp()
        };
        permeability * 8.0 * x.powi(7)
    };
    let inner: f64 = (1..parts).map(value).sum();
    (inner + 0.5 * (value(0) + value(parts))) * last / f64::from(parts)
}

/// Checks the time until ponding between two limits, for which the water that has entered is known. For a sharp front
/// it is S dtheta/(R/K - 1) (R. G. Mein and C. L. Larson, Water Resour. Res. 9 (1973) 384), for a permeability that is
/// exponential in the content S dtheta ln[R/(R - K)] (R. E. Smith and J.-Y. Parlange, Water Resour. Res. 14 (1978)
/// 533). The suction S of the front is the integral of the relative permeability (S. P. Neuman, Water Resour. Res. 12
/// (1976) 564).
#[test]
fn rain_ponds_between_the_times_of_two_limits() {
    let law = SOILS[0];
    let (rain, start) = (4.0, -5.0);
    let grid = plane([1, 400], [0.01, 1.0]);
    let soil = Retention::VanGenuchten(law);
    let settings = TransientSettings {
        content_error: 5e-4,
        ..transient(InitialWater::PressureHead(start), 5e-4)
    };
    let mut solver = advancing(&grid, rain_and_base(&grid, rain), soil, settings);
    let conductivity = conductivity(&grid, 1.0);
    let mut known = [0.0; 2];
    let mut ponded = None;
    while ponded.is_none() {
        solver.solve(still(&conductivity)).unwrap();
        closes(&solver);
        let time = known[0] + 5e-4;
        let entered = solver.water_balance().unwrap().entered / 0.01;
        if entered < rain * time * (1.0 - 1e-9) {
            ponded = Some(known[0] + (entered - known[1]) / rain);
        }
        known = [time, entered];
        assert!(time < 1.0, "no ponding");
    }
    let deficit = law.state(0.0).content - law.state(start).content;
    let suction = matric_potential(&law, -start);
    let sharp = suction * deficit / (rain - 1.0) / rain;
    let exponential = suction * deficit * (rain / (rain - 1.0)).ln() / rain;
    let found = ponded.unwrap();
    println!("{found} {sharp} {exponential}");
    assert!(
        found < sharp && found > exponential,
        "{found} {sharp} {exponential}"
    );
}

/// Checks that cells above the ground keep their pressure: the cycle of the preconditioner also corrects them, and in
/// a long run their pressure grew until it was no number.
#[test]
fn cells_without_ground_keep_their_pressure() {
    let sand = VanGenuchten {
        n: 2.0,
        alpha: 5.0,
        ..SOILS[0]
    };
    let mut solver = slope(sand, 0.5, 2.0, 0.05);
    let conductivity = conductivity(solver.grid(), 1.0);
    solver.solve(still(&conductivity)).unwrap();
    let grid = solver.grid().clone();
    let air = |cell: &usize| {
        let centre = grid.centre(grid.cell(*cell));
        centre[1] > 1.0 - 0.5 * centre[0]
    };
    let air: Vec<usize> = (0..grid.count()).filter(air).collect();
    let pressures = |solver: &Pressure| -> Vec<u64> {
        let layout = solver.slab.layout;
        let of = |cell: &usize| solver.phi[layout.position(grid.cell(*cell))].to_bits();
        air.iter().map(of).collect()
    };
    let first = pressures(&solver);
    for _ in 0..10 {
        solver.solve(still(&conductivity)).unwrap();
        assert_eq!(pressures(&solver), first);
    }
}
