//! Order of the cells of water with a surface in memory, and order of the axes.

use super::{Tank, bits, step};
use crate::lattice::VelocitySet;

#[test]
fn the_order_of_the_axes_in_memory_does_not_show() {
    let run = |surface_axis: Option<usize>| {
        let mut tank = Tank::new([14, 48, 33]);
        tank.tau = 0.53;
        tank.gravity = 6e-4;
        tank.surface_axis = surface_axis;
        let mut fluid = tank.fill(|[x, y, z]| {
            let [x, z] = [0.45 * x as f64, 0.19 * z as f64];
            (36.0 + 1.7 * x.cos() + 0.6 * z.sin() - y as f64).clamp(0.0, 1.0)
        });
        let kinds = fluid.surface().unwrap().kinds().to_vec();
        step(&mut fluid, 40);
        assert!(fluid.surface().unwrap().kinds() != kinds);
        (fluid.populations().order(), bits(&fluid))
    };
    let (along, across) = (run(None), run(Some(1)));
    assert_eq!([along.0, across.0], [[0, 2, 1], [0, 1, 2]]);
    assert!(along.1 == across.1);
}

/// Checks that a scene with the axes x and z exchanged has the same surface. The edges of a pillar are convex, so that
/// the mirror image of a level behind them depends on the axis that is reflected first.
#[test]
fn water_at_an_edge_does_not_prefer_an_axis() {
    for lattice in [VelocitySet::D3Q19, VelocitySet::D3Q27] {
        let run = |turned: bool| {
            let turn = |[x, y, z]: [usize; 3]| if turned { [z, y, x] } else { [x, y, z] };
            let mut tank = Tank::new(turn([10, 10, 9]));
            tank.models.lattice = lattice;
            tank.gravity = 3e-4;
            let in_pillar = |[x, y, z]: [usize; 3]| x >= 5 && z >= 6 && y < 6;
            let cells = (0..900).map(|n| [n % 10, n / 10 % 10, n / 100]);
            tank.solids = cells
                .clone()
                .filter(|&at| in_pillar(at))
                .map(turn)
                .collect();
            let mut fluid = tank.fill(|at| {
                let [x, y, z] = turn(at);
                let height = 4.3 + 0.21 * x as f64 + 0.17 * z as f64 - 0.01 * (x * z) as f64;
                let level = (height - y as f64).clamp(0.0, 1.0);
                if in_pillar([x, y, z]) { 0.0 } else { level }
            });
            step(&mut fluid, 30);
            let (surface, populations) = (fluid.surface().unwrap(), fluid.populations());
            let fill = |at| surface.fill(populations.interior_cell(turn(at)));
            cells.map(fill).collect::<Vec<_>>()
        };
        for (one, two) in run(false).into_iter().zip(run(true)) {
            assert!((one - two).abs() < 1e-12, "{one} and {two}");
        }
    }
}
