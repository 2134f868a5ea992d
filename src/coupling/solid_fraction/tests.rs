mod planes;
mod rows;

use super::*;
use base::number::real;
use base::random::SplitMix;
use dem::polyhedron::Polyhedron;
use nalgebra::{Rotation3, Unit, Vector3};
use planes::{Buffers, cut_cell, cut_often, cut_once};
use rows::row;

const PI: f64 = std::f64::consts::PI;

/// Returns the surface of a shape, turned about (1, 2, 3) by `angle`, round `centre`.
fn turned(shape: &Polyhedron, angle: f64, centre: [f64; 3]) -> PolyhedronSurface {
    let axis = Unit::new_normalize(Vector3::new(1.0, 2.0, 3.0));
    let turn = Rotation3::from_axis_angle(&axis, angle);
    let mut surface = PolyhedronSurface::default();
    surface.set_pose(shape, turn.matrix(), centre, 1.0);
    surface
}

/// Returns a cuboid of these edges, turned about (1, 2, 3) by `angle`, round `centre`.
fn cuboid(edges: [f64; 3], angle: f64, centre: [f64; 3]) -> (PolyhedronSurface, f64) {
    let shape = Polyhedron::cuboid(Vector3::from(edges)).unwrap();
    (turned(&shape, angle, centre), shape.radius())
}

/// Returns the sum of fractions over a box of cells that holds the body; rows must agree with the cells.
fn sum(form: &Form<'_>, method: FractionMethod) -> f64 {
    let mut scratch = Scratch::default();
    let (centre, radius) = form.bounds();
    let low = centre.map(|x| (x - radius - 2.0).floor());
    #[expect(clippy::cast_possible_truncation, reason = "a few cells")]
    let n = (2.0 * radius + 5.0).ceil() as i32;
    let deep = if matches!(form, Form::Disc { .. }) {
        1
    } else {
        n
    };
    let mut sum = 0.0;
    for z in 0..deep {
        for y in 0..n {
            let first = [low[0], low[1] + f64::from(y), low[2] + f64::from(z)];
            let row = row(form, 0, first);
            for x in 0..n {
                let lower = [first[0] + f64::from(x), first[1], first[2]];
                let fraction = form.fraction(method, lower, &mut scratch);
                if lower[0] >= row.inner[0] && lower[0] + 1.0 <= row.inner[1] {
                    assert!(fraction > 1.0 - 1e-9, "{lower:?} {fraction} {row:?}");
                }
                if row.misses() || lower[0] + 1.0 < row.outer[0] || lower[0] > row.outer[1] {
                    assert!(fraction < 1e-9, "{lower:?} {fraction} {row:?}");
                }
                sum += fraction;
            }
        }
    }
    sum
}

#[test]
fn exact_fractions_add_up_to_the_volume() {
    let ball = Form::Ball {
        centre: [0.37, -0.21, 0.73],
        radius: 4.3,
    };
    assert!((sum(&ball, FractionMethod::Exact) - 4.0 / 3.0 * PI * 4.3_f64.powi(3)).abs() < 1e-9);
    let disc = Form::Disc {
        centre: [0.37, -0.21, 0.0],
        radius: 4.3,
    };
    assert!((sum(&disc, FractionMethod::Exact) - PI * 4.3 * 4.3).abs() < 1e-10);
    // Long, thinner than a cell, smaller than a cell, along the axes and faces on faces of cells.
    for (edges, angle, centre) in [
        ([3.0, 4.0, 7.5], 0.7, [0.1, 0.2, 0.3]),
        ([9.0, 6.0, 0.13], 1.1, [0.4, 0.45, 0.05]),
        ([0.3, 0.2, 0.4], 2.1, [0.5, 0.0, 0.0]),
        ([3.5, 2.0, 4.0], 0.0, [0.3, 0.0, 0.0]),
        ([4.0, 4.0, 4.0], 0.0, [0.0, 0.0, 0.0]),
        ([4.0, 4.0, 4.0], 1e-9, [0.0, 0.0, 0.0]),
    ] {
        let (surface, radius) = cuboid(edges, angle, centre);
        let block = Form::Block {
            surface: &surface,
            centre,
            radius,
        };
        let exact = edges[0] * edges[1] * edges[2];
        let found = sum(&block, FractionMethod::Exact);
        assert!(
            (found - exact).abs() < 1e-7 * exact.max(1.0),
            "{edges:?} {found} {exact}"
        );
    }
}

/// The closed form of one cut against clipping.
#[test]
fn one_cut_in_closed_form() {
    let mut buffers = Buffers::default();
    for k in 0..4000_i32 {
        let angle = f64::from(k) * 0.618;
        let height = f64::from(k % 61) / 30.0 - 1.0;
        let flat = (1.0 - height * height).max(0.0).sqrt();
        let normal = [flat * angle.cos(), flat * angle.sin(), height];
        let reach = 0.5 * (normal[0].abs() + normal[1].abs() + normal[2].abs());
        let offset = reach * (f64::from(k % 97) / 48.5 - 1.0) * 0.999;
        let plane = CellPlane { normal, offset };
        buffers.cuts.clear();
        buffers.cuts.push(plane);
        let (closed, clipped) = (cut_once(&plane), cut_often(&mut buffers));
        assert!(
            (closed - clipped).abs() < 3e-8,
            "{plane:?} {closed} {clipped}"
        );
    }
}

/// Shapes with many, few, long and short faces; thin, smaller than a cell, and along the axes.
fn shapes() -> Vec<Polyhedron> {
    let mut random = SplitMix::new(7);
    let mut shapes: Vec<Polyhedron> = [6, 9, 14, 40, 120]
        .into_iter()
        .map(|count| {
            let size = 5.0 + 5.0 * random.uniform();
            let points: Vec<Vector3<f64>> = (0..count)
                .map(|_| size * Vector3::from_fn(|_, _| random.uniform() - 0.5))
                .collect();
            Polyhedron::from_vertices(&points).unwrap().shape
        })
        .collect();
    for edges in [[4.0, 3.0, 5.0], [7.0, 5.0, 0.1], [0.4, 0.3, 0.2]] {
        shapes.push(Polyhedron::cuboid(Vector3::from(edges)).unwrap());
    }
    shapes
}

#[test]
fn the_surface_gives_what_the_planes_give() {
    let mut buffers = Buffers::default();
    let mut table = BlockTable::default();
    let mut partial = 0;
    for (k, shape) in shapes().iter().enumerate() {
        for (angle, centre) in [
            (0.7 + real(k), [5.3, 5.1, 5.7]),
            (0.0, [5.0, 5.5, 5.25]),
            (1e-9, [5.0, 5.0, 5.0]),
        ] {
            let surface = turned(shape, angle, centre);
            // The closed form of one cut takes a slope below 1e-8 for none.
            let most = if angle == 1e-9 { 1e-7 } else { 1e-12 };
            for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
                let lower = [0, -1, 1];
                table.fill(&surface, lower, [12, 11, 10], along(order));
                let count = order.map(|axis| [12, 11, 10][axis]);
                for layer in 0..count[0] {
                    table.layer(&surface, layer);
                    for row in 0..count[1] {
                        let found = table.row(row, 0, count[2]).to_vec();
                        for (at, found) in found.into_iter().enumerate() {
                            let mut cell = lower.map(f64::from);
                            for (axis, steps) in order.into_iter().zip([layer, row, at]) {
                                cell[axis] += real(steps);
                            }
                            let planes = cut_cell(surface.planes(), cell, &mut buffers);
                            assert!(
                                (found - planes).abs() < most,
                                "{k} {angle} {order:?} {cell:?}: {found} {planes}"
                            );
                            partial += u32::from(planes > 0.0 && planes < 1.0);
                        }
                    }
                }
            }
        }
    }
    assert!(partial > 10_000, "{partial}");
}

/// Returns rows of the lattice along these axes, with the sums along the same.
fn along(lattice: [usize; 3]) -> RowAxes {
    RowAxes {
        lattice,
        sums: lattice,
    }
}

/// Checks that the fractions do not depend on the order of the cells in memory, which follows the axis of the slabs.
#[test]
fn rows_along_any_axis_have_the_same_bits() {
    let [mut known, mut table] = [BlockTable::default(), BlockTable::default()];
    let (lower, cells) = ([0, -1, 1], [12, 11, 10]);
    let (sums, mut partial, mut differ) = ([0, 1, 2], 0, 0);
    for (k, shape) in shapes().iter().enumerate() {
        let surface = turned(shape, real(k) + 0.7, [5.3, 5.1, 5.7]);
        let fractions = |table: &mut BlockTable, axes: RowAxes| {
            let mut all = vec![0.0; cells.iter().product()];
            table.fill(&surface, lower, cells, axes);
            let [layers, rows, length] = axes.lattice.map(|axis| cells[axis]);
            for layer in 0..layers {
                table.layer(&surface, layer);
                for row in 0..rows {
                    for (at, found) in table.row(row, 0, length).iter().enumerate() {
                        let mut cell = [0; 3];
                        for (axis, steps) in axes.lattice.into_iter().zip([layer, row, at]) {
                            cell[axis] = steps;
                        }
                        all[(cell[0] * cells[1] + cell[1]) * cells[2] + cell[2]] = *found;
                    }
                }
            }
            all.into_iter().map(f64::to_bits).collect::<Vec<_>>()
        };
        let exact = fractions(&mut known, along(sums));
        let exact_parts = exact.iter().map(|bits| f64::from_bits(*bits));
        partial += exact_parts
            .filter(|part| *part > 0.0 && *part < 1.0)
            .count();
        for lattice in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let found = fractions(&mut table, RowAxes { lattice, sums });
            assert!(found == exact, "{k} {lattice:?}");
            let summed = fractions(&mut table, along(lattice));
            differ += usize::from(summed != exact);
        }
    }
    assert!(partial > 1000, "{partial}");
    // The axis of the sums matters.
    assert!(differ > 20, "{differ}");
}

/// Ranks and threads have some of the layers, rows or cells each.
#[test]
fn a_part_of_the_cells_has_the_same_bits() {
    let [mut whole, mut part] = [BlockTable::default(), BlockTable::default()];
    for (k, shape) in shapes().iter().enumerate() {
        let surface = turned(shape, real(k) + 0.3, [5.3, 5.1, 5.7]);
        whole.fill(&surface, [0; 3], [12; 3], along([0, 1, 2]));
        part.fill(&surface, [4, 3, 5], [3, 4, 2], along([0, 1, 2]));
        for layer in 0..3 {
            whole.layer(&surface, layer + 4);
            part.layer(&surface, layer);
            for row in 0..4 {
                let bits = |row: &[f64]| row.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
                let (all, some) = (bits(whole.row(row + 3, 5, 2)), bits(part.row(row, 0, 2)));
                assert_eq!(all, some, "{k} {layer} {row}");
            }
        }
    }
}

#[test]
fn rows_of_a_layer_end_where_each_row_does() {
    let mut ends = BlockRows::default();
    let mut deep = 0;
    for (k, shape) in shapes().iter().enumerate() {
        for (angle, centre) in [(real(k) + 0.3, [5.3, 5.1, 5.7]), (0.0, [5.0, 5.5, 5.25])] {
            let surface = turned(shape, angle, centre);
            let form = Form::Block {
                surface: &surface,
                centre,
                radius: shape.radius(),
            };
            for order in [[0, 1, 2], [2, 1, 0], [1, 0, 2]] {
                ends.fill(-1, 12, order);
                for layer in 0..11 {
                    ends.layer(surface.planes(), f64::from(layer));
                    for row in 0..12 {
                        let mut lower = [0.0; 3];
                        lower[order[0]] = f64::from(layer);
                        lower[order[1]] = real(row) - 1.0;
                        let alone = RowCells::from_row(&rows::row(&form, order[2], lower), 3);
                        assert_eq!(ends.row(row, 3), alone, "{k} {order:?} {lower:?}");
                        deep += (alone.deep[1] - alone.deep[0]).max(0);
                    }
                }
            }
        }
    }
    assert!(deep > 100, "{deep}");
}

/// Measures the error of the low-cost methods: the table of the module.
#[test]
fn the_error_of_samples_and_of_the_linear_estimate() {
    let mut scratch = Scratch::default();
    let mut error = |method: FractionMethod| {
        let (mut squares, mut cells, mut volume, mut true_volume) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..8 {
            let shift = f64::from(k) / 8.0;
            let ball = Form::Ball {
                centre: [shift, (3.0 * shift).fract(), (5.0 * shift).fract()],
                radius: 8.0,
            };
            for n in 0..20_i32.pow(3) {
                let lower = [n % 20, n / 20 % 20, n / 400].map(|x| f64::from(x - 10));
                let exact = ball.fraction(FractionMethod::Exact, lower, &mut scratch);
                let found = ball.fraction(method, lower, &mut scratch);
                volume += found;
                true_volume += exact;
                if exact > 0.0 && exact < 1.0 {
                    squares += (found - exact).powi(2);
                    cells += 1.0;
                }
            }
        }
        ((squares / cells).sqrt(), volume / true_volume - 1.0)
    };
    let (linear, bias) = error(FractionMethod::Linear);
    assert!((0.015..0.025).contains(&linear), "{linear}");
    assert!(bias.abs() < 2e-4, "{bias}");
    let mut last = 1.0;
    for (n, most) in [(2, 0.06), (5, 0.01), (10, 0.003)] {
        let (samples, bias) = error(FractionMethod::Samples(n));
        assert!(samples < most && samples < last, "{n} {samples}");
        assert!(bias.abs() < 2e-3, "{n} {bias}");
        last = samples;
    }
}
