//! Walls that move towards openings, other walls and planes of symmetry, against exact solutions.

use crate::boundary::convective_outflow::{Carried, ConvectiveOutflowLinks};
use crate::boundary::free_slip::FreeSlipLinks;
use crate::boundary::pressure::PressureLinks;
use crate::boundary::sound::PlaneWave;
use crate::boundary::velocity::VelocityLinks;
use crate::boundary::{BoundaryKind, Flux, Patch, Ramp, Rule, Strength, SurfaceKind, from_quanta};
use crate::collision::{Operator, trt};
use crate::fluid::{Fluid, Models, Setup};
use crate::lattice::VelocitySet;
use base::history::TimeTable;
use decomposition::{Domain, SplitAxis};

const SETS: [VelocitySet; 3] = [VelocitySet::D2Q9, VelocitySet::D3Q19, VelocitySet::D3Q27];
const MOVING: BoundaryKind = BoundaryKind {
    surface: SurfaceKind::MovingWall,
    strength: Strength::Velocity,
};
const TAU: f64 = 0.8;

type Faces = Vec<(usize, bool, Box<dyn Rule<f64>>)>;

fn fluid(set: VelocitySet, cells: [usize; 3], periodic: [bool; 3], faces: Faces) -> Fluid<f64> {
    let trt = Operator::Trt(trt::TrtParameters { magic: 3.0 / 16.0 });
    let patches = faces.into_iter().map(|(axis, upper, rule)| Patch {
        name: format!("{axis}{upper}"),
        axis,
        upper,
        range: [[f64::NEG_INFINITY, f64::INFINITY]; 3],
        rule,
    });
    let setup = Setup {
        periodic,
        patches: patches.collect(),
        ..Setup::new(Models::new(set, trt), TAU, cells)
    };
    Fluid::new(setup, &Domain::serial(SplitAxis::X, cells[0], periodic[0])).unwrap()
}

/// Returns a wall that moves with half of twice the velocity.
fn wall(u: [f64; 3]) -> Box<dyn Rule<f64>> {
    let twice = u.map(|u| 2.0 * u);
    let links = VelocityLinks::new(Box::new(move |_| twice), Ramp::constant(1.0));
    let half = TimeTable::new(Some(&[[0.0, 0.5], [9.0, 0.5]]), 1.0);
    Box::new(links.following(Some(half)).with_kind(MOVING))
}

/// Returns an inlet with a stated discharge into the domain.
fn inlet(u: [f64; 3], discharge: f64) -> Box<dyn Rule<f64>> {
    Box::new(VelocityLinks::uniform(u).balanced(Some(discharge)))
}

fn pressure(axis: usize) -> Box<dyn Rule<f64>> {
    Box::new(PressureLinks::new(axis, Ramp::constant(0.0)))
}

fn outflow(axis: usize, upper: bool, carried: Carried) -> Box<dyn Rule<f64>> {
    Box::new(ConvectiveOutflowLinks::new((axis, upper), carried))
}

/// Returns an outflow that holds the reference pressure as a mean.
fn held(axis: usize, upper: bool) -> Box<dyn Rule<f64>> {
    let links = ConvectiveOutflowLinks::new((axis, upper), Carried::Local);
    Box::new(links.holding(PlaneWave::reflected(), TimeTable::constant(0.0), None))
}

/// Returns the largest difference of density and velocity from those of a field.
fn apart(fluid: &Fluid<f64>, field: impl Fn([f64; 3]) -> [f64; 3]) -> [f64; 2] {
    let mut largest = [0.0_f64; 2];
    for (at, cell) in fluid.populations().interior() {
        let (density, u) = fluid.state(cell);
        let exact = field(at.map(|n| n as f64 + 0.5));
        largest[0] = largest[0].max(density.abs());
        for a in 0..3 {
            largest[1] = largest[1].max((u[a] - exact[a]).abs());
        }
    }
    largest
}

fn mass(flux: &Flux) -> f64 {
    from_quanta(flux.mass)
}

fn force(flux: &Flux, axis: usize) -> f64 {
    from_quanta(flux.force[axis])
}

/// Checks a uniform stream between walls that move with it: the equilibrium is steady to rounding, the flow through the
/// openings is that of all their cells, the walls let nothing through and have no shear stress, and the openings have
/// the pressure and the momentum of the stream.
#[test]
fn a_stream_between_walls_that_move_with_it_is_exact() {
    const SPEED: f64 = 0.04;
    type Ends = fn(usize, [f64; 3], f64) -> [Box<dyn Rule<f64>>; 2];
    // Rules at the end upstream and downstream of an axis; `f64` is the discharge.
    let ends: [(&str, Ends); 6] = [
        ("velocity, pressure", |axis, u, q| {
            [inlet(u, q), pressure(axis)]
        }),
        ("velocities", |_, u, q| [inlet(u, q), inlet(u, -q)]),
        ("pressures", |axis, _, _| [pressure(axis), pressure(axis)]),
        ("velocity, outflow", |axis, u, q| {
            [inlet(u, q), outflow(axis, u[axis] > 0.0, Carried::Whole)]
        }),
        ("velocity, convective", |axis, u, q| {
            [inlet(u, q), outflow(axis, u[axis] > 0.0, Carried::Local)]
        }),
        ("velocity, held", |axis, u, q| {
            [inlet(u, q), held(axis, u[axis] > 0.0)]
        }),
    ];
    let mut wrong = Vec::new();
    for set in SETS {
        let dimension = set.velocities().dimension;
        let cells = [6, 5, if dimension == 2 { 1 } else { 4 }];
        for (axis, forward, around) in (0..dimension)
            .flat_map(|a| [(a, true), (a, false)])
            .flat_map(|(a, f)| (1..dimension).map(move |around| (a, f, around)))
        {
            for (name, ends) in &ends {
                let mut u = [0.0; 3];
                u[axis] = if forward { SPEED } else { -SPEED };
                let others = (0..dimension).filter(|a| *a != axis).take(around);
                let walled: Vec<usize> = others.collect();
                let area = (0..3).filter(|a| *a != axis).map(|a| cells[a] as f64);
                let area: f64 = area.product();
                let [first, last] = ends(axis, u, SPEED * area);
                let mut faces: Faces = vec![(axis, !forward, first), (axis, forward, last)];
                for &b in &walled {
                    faces.extend([false, true].map(|upper| (b, upper, wall(u))));
                }
                let periodic = std::array::from_fn(|a| a != axis && !walled.contains(&a));
                let mut fluid = fluid(set, cells, periodic, faces);
                fluid.initialise(&|_: [f64; 3]| (0.0, u));
                for _ in 0..60 {
                    fluid.advance();
                }
                let [density, speed] = apart(&fluid, |_| u);
                let fluxes = fluid.fluxes();
                let mut masses = Vec::new();
                fluid.mass_through(|_| true, &mut masses);
                let mut off = vec![density, speed];
                for (end, sign) in [(0, -1.0), (1, 1.0)] {
                    off.push(mass(&fluxes[end]) - sign * SPEED * area);
                    off.push(from_quanta(masses[end]) - sign * SPEED * area);
                    let along = if forward { sign } else { -sign };
                    let normal = along * (1.0 / 3.0 + SPEED * SPEED) * area;
                    off.push(force(&fluxes[end], axis) - normal);
                }
                for flux in &fluxes[2..] {
                    off.extend([mass(flux), force(flux, axis)]);
                }
                let most = off.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
                if most > 1e-13 {
                    wrong.push(format!("{set:?} {axis} {forward} {around} {name}: {off:?}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Checks a uniform stream oblique to faces that all impose it: each face has the discharge of its cells, though the
/// links of edges and corners carry that of two and three faces, and the factors of the faces differ.
#[test]
fn an_oblique_stream_through_imposed_velocities_is_exact() {
    for set in SETS {
        let dimension = set.velocities().dimension;
        let cells = [6, 5, if dimension == 2 { 1 } else { 4 }];
        let mut u = [0.03, -0.02, 0.01];
        u[dimension..].fill(0.0);
        let discharge = |axis: usize, upper: bool| {
            let area: usize = (0..3).filter(|a| *a != axis).map(|a| cells[a]).product();
            area as f64 * if upper { -u[axis] } else { u[axis] }
        };
        let faces = (0..dimension).flat_map(|axis| {
            [false, true].map(|upper| {
                // The first two axes state a multiple of the velocity, with a factor.
                let factor = [1.0, 0.5, 0.25][axis];
                let stated = u.map(|u| u / factor);
                let table = TimeTable::new(Some(&[[0.0, factor], [9.0, factor]]), 1.0);
                let links = VelocityLinks::new(Box::new(move |_| stated), Ramp::constant(1.0));
                let links = links.following(Some(table));
                let rule = links.balanced(Some(discharge(axis, upper) / factor));
                (axis, upper, Box::new(rule) as Box<dyn Rule<f64>>)
            })
        });
        let mut fluid = fluid(set, cells, [false, false, dimension == 2], faces.collect());
        fluid.initialise(&|_: [f64; 3]| (0.0, u));
        for _ in 0..60 {
            fluid.advance();
        }
        let off = apart(&fluid, |_| u);
        assert!(off.iter().all(|off| *off < 1e-13), "{set:?} {off:?}");
        let mut masses = Vec::new();
        fluid.mass_through(|_| true, &mut masses);
        for (n, flux) in fluid.fluxes()[..2 * dimension].iter().enumerate() {
            let exact = -discharge(n / 2, n % 2 == 1);
            for found in [mass(flux), from_quanta(masses[n])] {
                assert!(
                    (found - exact).abs() < 1e-13,
                    "{set:?} {n}: {found} {exact}"
                );
            }
        }
    }
}

/// Checks that a closed box of walls, some of which slide towards others and towards planes of symmetry, keeps its
/// mass: each wall slides along both axes in its plane.
#[test]
fn walls_that_slide_towards_walls_let_no_water_through() {
    for set in SETS {
        let dimension = set.velocities().dimension;
        let cells = [7, 6, if dimension == 2 { 1 } else { 5 }];
        let slide = |axis: usize, upper: bool| {
            let mut u = [0.02, 0.03, -0.01];
            u[dimension..].fill(0.0);
            u[axis] = 0.0;
            (axis, upper, wall(u))
        };
        let mirror = |axis, upper| {
            let rule = Box::<FreeSlipLinks>::default() as Box<dyn Rule<f64>>;
            (axis, upper, rule)
        };
        // The faces at the upper ends are walls at rest in one of the boxes.
        let all = |ends: usize| {
            let axes = (0..dimension).flat_map(|axis| [(axis, false), (axis, true)]);
            axes.filter(move |(_, upper)| ends == 2 || !upper)
        };
        let boxes: [Faces; 4] = [
            vec![slide(1, true)],
            all(1).map(|(axis, upper)| slide(axis, upper)).collect(),
            all(2).map(|(axis, upper)| slide(axis, upper)).collect(),
            all(2)
                .map(|(axis, upper)| match (axis, upper) {
                    (0, false) => mirror(axis, upper),
                    _ => slide(axis, upper),
                })
                .collect(),
        ];
        for (n, faces) in boxes.into_iter().enumerate() {
            let mut fluid = fluid(set, cells, [false, false, dimension == 2], faces);
            fluid.initialise(&|_: [f64; 3]| (0.0, [0.0; 3]));
            for _ in 0..100 {
                fluid.advance();
                for flux in fluid.fluxes() {
                    assert!(mass(&flux).abs() < 1e-14, "{set:?} {n}: {}", mass(&flux));
                }
            }
            let cells = fluid.populations().interior();
            let inside: f64 = cells
                .map(|(_, cell)| fluid.populations().moments(cell).0)
                .sum();
            assert!(inside.abs() < 1e-12, "{set:?} {n}: {inside}");
        }
    }
}

/// Returns Couette flow through openings after it has become steady: `along` is the axis of the stream, `across` that
/// from the wall at rest to the one that moves.
fn couette(
    set: VelocitySet,
    (along, across): (usize, usize),
    speed: f64,
    imposed: bool,
) -> Fluid<f64> {
    let mut cells = [if set == VelocitySet::D2Q9 { 1 } else { 2 }; 3];
    (cells[along], cells[across]) = (HEIGHT, HEIGHT);
    if set == VelocitySet::D2Q9 {
        cells[2] = 1;
    }
    let profile = move |p: [f64; 3]| {
        let mut u = [0.0; 3];
        u[along] = speed * p[across] / HEIGHT as f64;
        u
    };
    let mut lid = [0.0; 3];
    lid[along] = speed;
    let first: Box<dyn Rule<f64>> = if imposed {
        let depth = cells[3 - along - across] as f64;
        let links = VelocityLinks::new(Box::new(profile), Ramp::constant(1.0));
        Box::new(links.balanced(Some(0.5 * speed * HEIGHT as f64 * depth)))
    } else {
        pressure(along)
    };
    let faces: Faces = vec![
        (along, false, first),
        (along, true, pressure(along)),
        (across, true, wall(lid)),
    ];
    let periodic = std::array::from_fn(|a| a != along && a != across);
    let mut fluid = fluid(set, cells, periodic, faces);
    fluid.initialise(&|p: [f64; 3]| (0.0, profile(p)));
    for _ in 0..8000 {
        fluid.advance();
    }
    fluid
}

const HEIGHT: usize = 20;

/// Checks Couette flow through openings: velocity, flow and forces of the walls are those of the linear profile up to
/// terms of the second order in the velocity.
#[test]
fn couette_flow_through_openings_is_linear() {
    for (set, axes) in [
        (VelocitySet::D2Q9, (0, 1)),
        (VelocitySet::D2Q9, (1, 0)),
        (VelocitySet::D3Q19, (0, 2)),
        (VelocitySet::D3Q27, (2, 1)),
    ] {
        for imposed in [true, false] {
            for speed in [1e-3, 1e-2] {
                let fluid = couette(set, axes, speed, imposed);
                let (along, across) = axes;
                let height = HEIGHT as f64;
                let depth = if set == VelocitySet::D2Q9 { 1.0 } else { 2.0 };
                let [_, off] = apart(&fluid, |p| {
                    let mut u = [0.0; 3];
                    u[along] = speed * p[across] / height;
                    u
                });
                let fluxes = fluid.fluxes();
                let flow = 0.5 * speed * height * depth;
                let flows = [-mass(&fluxes[0]), mass(&fluxes[1])].map(|q| q / flow - 1.0);
                // The walls have the length of the height.
                let drag = (TAU - 0.5) / 3.0 * speed * depth;
                let floor = 3 + 2 * across;
                let drags = [
                    -force(&fluxes[2], along) / drag - 1.0,
                    force(&fluxes[floor], along) / drag - 1.0,
                ];
                let off = [off / speed, flows[0], flows[1], drags[0], drags[1]];
                println!("{set:?} {axes:?} {imposed} {speed}: {off:?}");
                // Two links that cross an opening at one point have the u² of their own cells: the stress u Δu/6 in
                // a cell, by which its velocity changes by u Δu/(6 ν).
                let most = speed / height / (2.0 * TAU - 1.0);
                assert!(off.iter().all(|off| off.abs() < most), "{off:?} {most}");
                if imposed {
                    assert!(flows[0].abs().max(flows[1].abs()) < 1e-12, "{flows:?}");
                }
            }
        }
    }
}

/// Checks the forces on walls at rest in Poiseuille flow between two pressures: both walls together have the difference
/// of the pressures over the section, up to the second order in the size of a cell.
#[test]
fn walls_beside_openings_have_the_whole_drag() {
    const DROP: f64 = 1e-5;
    for (set, along, across) in [
        (VelocitySet::D2Q9, 0, 1),
        (VelocitySet::D2Q9, 1, 0),
        (VelocitySet::D3Q19, 2, 0),
        (VelocitySet::D3Q27, 1, 2),
    ] {
        let mut cells = [if set == VelocitySet::D2Q9 { 1 } else { 3 }; 3];
        (cells[along], cells[across]) = (12, 10);
        let end = |density: f64| Box::new(PressureLinks::new(along, Ramp::constant(density)));
        let faces: Faces = vec![(along, false, end(DROP)), (along, true, end(0.0))];
        let periodic = std::array::from_fn(|a| a != along && a != across);
        let mut fluid = fluid(set, cells, periodic, faces);
        fluid.initialise(&|_: [f64; 3]| (0.0, [0.0; 3]));
        for _ in 0..6000 {
            fluid.advance();
        }
        let fluxes = fluid.fluxes();
        let depth = cells[3 - along - across] as f64;
        let section = cells[across] as f64 * depth;
        let floor = 2 + 2 * across;
        let walls = [0, 1].map(|n| force(&fluxes[floor + n], along));
        let ends = [0, 1].map(|n| force(&fluxes[n], along));
        let pressure = DROP / 3.0 * section;
        println!(
            "{set:?} {:?} {}",
            walls.map(|x| 2.0 * x / pressure),
            -(ends[0] + ends[1]) / pressure
        );
        assert!((walls[0] - walls[1]).abs() < 1e-9 * pressure, "{walls:?}");
        assert!(
            ((walls[0] + walls[1]) / pressure - 1.0).abs() < 1e-4,
            "{walls:?}"
        );
        assert!((walls[0] + walls[1] + ends[0] + ends[1]).abs() < 1e-9 * pressure);
    }
}
