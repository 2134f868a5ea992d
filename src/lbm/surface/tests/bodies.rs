//! Boxes with edges along the axes, whose solid fractions are products, in a tank with a free surface.

use super::super::kind::{GAS, HELD};
use super::{Tank, bits, mass};
use crate::fluid::Fluid;
use crate::lattice::VelocitySet;
use crate::links::Load;
use crate::quanta::from_quanta;
use crate::rigid::Rigid;
use crate::saturation::cover::CoveringBody;
use crate::saturation::{SaturationMethod, SolidOperator, Weighting};
use base::number::single;

const OPERATOR: SolidOperator = SolidOperator::NonEquilibriumBounceBack;

/// A box that moves: lower corner, edges and velocity in cells.
struct Box {
    low: [f64; 3],
    edges: [f64; 3],
    velocity: [f64; 3],
    covered: Vec<usize>,
}

impl Box {
    fn new(low: [f64; 2], edges: [f64; 2], cells: [usize; 3]) -> Self {
        Self {
            low: [low[0], low[1], -2.0],
            edges: [edges[0], edges[1], cells[2] as f64 + 4.0],
            velocity: [0.0; 3],
            covered: Vec::new(),
        }
    }

    fn part(&self, at: [isize; 3]) -> f64 {
        let along = |a: usize| {
            let (low, high) = (self.low[a], self.low[a] + self.edges[a]);
            (high.min(at[a] as f64 + 1.0) - low.max(at[a] as f64)).clamp(0.0, 1.0)
        };
        along(0) * along(1) * along(2)
    }

    /// Covers the cells of a fluid that the box contains.
    fn cover(&mut self, fluid: &mut Fluid<f64>) {
        let cells = fluid.populations().cells().map(usize::cast_signed);
        let flat = fluid.populations().velocities().dimension == 2;
        let ghosts = [1, 1, isize::from(!flat)];
        let mut positions = Vec::new();
        for z in -ghosts[2]..cells[2] + ghosts[2] {
            for y in -1..=cells[1] {
                for x in -1..=cells[0] {
                    let at = [x, y, z];
                    let inside = (0..3).all(|a| (0..cells[a]).contains(&at[a]));
                    let part = single(self.part(at));
                    let signed = if inside { part } else { -part };
                    positions.push((fluid.populations().cell(at), signed));
                }
            }
        }
        let cover = fluid.cover_mut().unwrap();
        cover.make_room(1);
        let motion = Rigid {
            position: std::array::from_fn(|a| self.low[a] + 0.5 * self.edges[a]),
            velocity: self.velocity,
            ..Rigid::default()
        };
        let solid = CoveringBody {
            motion,
            ..CoveringBody::default()
        };
        cover.set(0, solid);
        self.covered.clear();
        for (position, part) in positions {
            if part != 0.0 || cover.held(position) != 0.0 {
                cover.cover(position, 0, part);
            }
            if part != 0.0 {
                self.covered.push(position);
            }
        }
        fluid.meet_bodies(self.covered.iter().copied());
    }

    /// Advances the fluid by a step and moves the box; returns the load on the box.
    fn step(&mut self, fluid: &mut Fluid<f64>) -> [f64; 3] {
        fluid.advance();
        fluid.move_surface();
        let mut load: Load = [0; 6];
        let cover = fluid.cover_mut().unwrap();
        cover.collect(|_, part| {
            for (sum, part) in load.iter_mut().zip(part) {
                *sum += part;
            }
        });
        for (low, v) in self.low.iter_mut().zip(self.velocity) {
            *low += v;
        }
        self.cover(fluid);
        std::array::from_fn(|a| from_quanta(load[a]))
    }
}

/// Returns the largest error of the balance of momentum of the steps of a moving box, over the weight of the water.
fn error_of_balance(tank: &Tank, body: &mut Box, dry_before: usize, steps: usize) -> f64 {
    let mut fluid = tank.fill(|at| {
        let wet = level(6.4)(at);
        if at[0] < dry_before { 0.0 } else { wet }
    });
    body.cover(&mut fluid);
    let mut largest = 0.0_f64;
    for _ in 0..steps {
        fluid.balance_surface(true);
        let load = body.step(&mut fluid);
        let balance = fluid.surface().unwrap().balanced().unwrap();
        let open = from_quanta(balance.open);
        for (a, load) in load.into_iter().enumerate() {
            let force = [tank.slope[0], -tank.gravity, tank.slope[1]][a] * open;
            let gone = from_quanta(balance.change[a] + balance.left[a] - balance.weight[a]);
            largest = largest.max((gone + load - force).abs() / (open * tank.gravity));
        }
    }
    largest
}

/// Checks that no momentum is missing or counted twice where a moving body stands on planes of symmetry or walls: links
/// of its cells lead through the planes into the body.
#[test]
fn the_momentum_is_closed_at_bodies_that_stand_on_faces() {
    let boxes = [
        // Pistons with air behind them, one of them in a corner.
        ([0.0, 0.0], [8.0, 11.0], 8),
        ([2.0, 0.0], [6.3, 11.0], 8),
        // Blocks on the floor: through the surface, and below it.
        ([9.0, 0.0], [5.0, 11.0], 0),
        ([9.4, 0.0], [4.8, 4.5], 0),
    ];
    for (set, cells) in [
        (VelocitySet::D2Q9, [26, 14, 1]),
        (VelocitySet::D3Q19, [22, 14, 5]),
        (VelocitySet::D3Q27, [22, 14, 5]),
    ] {
        for (low, edges, dry_before) in boxes {
            for slips in [0, 1, 3, 5] {
                let faces = [(1, false), (0, false), (0, true), (2, false), (2, true)];
                let mut tank = tank(cells, Weighting::Viscous);
                tank.models.lattice = set;
                let kept = faces[..slips].iter().copied();
                tank.slip_at = kept.filter(|face| cells[2] > 1 || face.0 != 2).collect();
                let mut body = Box::new(low, edges, cells);
                body.velocity = [0.03, 0.0, 0.0];
                let found = error_of_balance(&tank, &mut body, dry_before, 40);
                assert!(found < 1e-11, "{set:?} {low:?} {edges:?} {slips}: {found}");
            }
        }
    }
}

/// Checks that a body which enters the water or leaves it is not charged with the momentum of the water in its place:
/// this momentum changes by U² times the width at the water line in a step, and does not for a body under water.
#[test]
fn the_momentum_in_the_place_of_a_body_is_no_load() {
    for cells in [[40, 30, 1], [24, 26, 6]] {
        for (low, height, speed, share) in [
            (9.4, 14.0, -0.03, 1.0),
            (9.4, 14.0, 0.03, 1.0),
            (3.3, 6.1, -0.03, 0.0),
        ] {
            let mut tank = tank(cells, Weighting::Viscous);
            tank.gravity = 1e-12;
            let mut fluid = tank.fill(level(14.3));
            let mut body = Box::new([6.3, low], [9.7, height], cells);
            body.velocity = [0.0, speed, 0.0];
            body.cover(&mut fluid);
            for n in 0..20 {
                fluid.balance_surface(true);
                body.step(&mut fluid);
                let balance = fluid.surface().unwrap().balanced().unwrap();
                let found = from_quanta(balance.weight[1]);
                let exact = -share * speed * speed * 9.7 * cells[2] as f64;
                let of = speed * speed * 9.7 * cells[2] as f64;
                assert!(
                    (found - exact).abs() < 1e-5 * of,
                    "{cells:?} {low} {speed} {n}: {found} for {exact}"
                );
            }
        }
    }
}

fn tank(cells: [usize; 3], weighting: Weighting) -> Tank {
    let mut tank = Tank::new(cells);
    tank.slip_at = vec![(0, false), (0, true), (1, false)];
    if cells[2] > 1 {
        tank.slip_at.extend([(2, false), (2, true)]);
    }
    tank.saturation = Some(SaturationMethod {
        operator: OPERATOR,
        weighting,
    });
    tank
}

fn level(height: f64) -> impl Fn([usize; 3]) -> f64 + Sync {
    move |[_, y, _]| (height - y as f64).clamp(0.0, 1.0)
}

#[test]
fn a_box_at_rest_carries_its_buoyancy() {
    let cells = [40, 30, 1];
    for weighting in [Weighting::Fraction, Weighting::Viscous] {
        // Through the surface, below it, with faces between centres of cells. The bar of a draught is 2 %.
        for (low, edges, within) in [
            ([14.0, 9.0], [12.0, 12.0], 0.02),
            ([14.3, 9.4], [11.8, 12.1], 0.02),
            ([14.3, 4.4], [11.8, 6.3], 1.5e-4),
            ([13.5, 12.5], [12.0, 5.5], 0.02),
        ] {
            let tank = tank(cells, weighting);
            let height = 16.3;
            let mut fluid = tank.fill(level(height));
            let mut body = Box::new(low, edges, cells);
            body.cover(&mut fluid);
            let mut sum = [0.0; 3];
            for n in 0..4000 {
                let load = body.step(&mut fluid);
                if n >= 3000 {
                    for (sum, load) in sum.iter_mut().zip(load) {
                        *sum += load / 1000.0;
                    }
                }
            }
            let under = (low[1] + edges[1]).min(height) - low[1];
            let draught = sum[1] / (tank.gravity * edges[0]);
            assert!(
                (draught / under - 1.0).abs() < within,
                "{draught} of {under}"
            );
            let aside = sum[0] / (tank.gravity * edges[1] * edges[1]);
            assert!(aside.abs() < 1e-3, "{aside}");
        }
    }
}

#[test]
fn a_box_that_goes_in_and_out_keeps_the_mass_of_the_water() {
    for (cells, steps) in [([40, 30, 1], 1800), ([24, 24, 6], 600)] {
        let tank = tank(cells, Weighting::Viscous);
        let mut fluid = tank.fill(level(12.3));
        let middle = 0.5 * cells[0] as f64;
        let mut body = Box::new([middle - 5.3, 14.0], [9.7, 7.4], cells);
        body.cover(&mut fluid);
        let before = mass(&fluid);
        let mut deepest = f64::INFINITY;
        for n in 0..steps {
            let phase = std::f64::consts::TAU * f64::from(n) / 600.0;
            body.velocity = [0.01 * phase.cos(), -0.05 * phase.sin(), 0.0];
            let load = body.step(&mut fluid);
            deepest = deepest.min(body.low[1]);
            assert!(load[1].is_finite());
            let kept = mass(&fluid) + fluid.surface().unwrap().lost_mass();
            assert!(
                (kept / before - 1.0).abs() < 1e-12,
                "{n}: {kept} of {before}"
            );
        }
        assert!(deepest < 5.0);
        let lost = fluid.surface().unwrap().lost_mass() / before;
        assert!(lost.abs() < 1e-2, "{lost}");
    }
}

#[test]
fn a_box_in_the_air_has_no_load() {
    let cells = [40, 30, 1];
    let tank = tank(cells, Weighting::Viscous);
    let mut fluid = tank.fill(level(8.3));
    let mut body = Box::new([14.3, 14.0], [9.7, 7.4], cells);
    body.velocity = [0.003, 0.004, 0.0];
    body.cover(&mut fluid);
    let before = bits(&fluid);
    for _ in 0..300 {
        assert_eq!(body.step(&mut fluid), [0.0; 3]);
    }
    let surface = fluid.surface().unwrap();
    let dry = |cell: usize| surface.cells.solid(cell) <= 0.0 || surface.cells.kind[cell] == GAS;
    assert!(fluid.populations().interior().all(|(_, cell)| dry(cell)));
    assert!(!surface.kinds().contains(&HELD));
    assert_eq!(before.len(), bits(&fluid).len());
}
