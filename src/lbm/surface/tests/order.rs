//! Order of the cells of water with a surface in memory.

use super::{Tank, bits, step};

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
