use super::*;
use crate::dem::polyhedron::Polyhedron;

const PI: f64 = std::f64::consts::PI;

/// A cuboid of these edges, turned about (1, 2, 3) by `angle`, round `centre`.
fn cuboid(edges: [f64; 3], angle: f64, centre: [f64; 3]) -> (Vec<Plane>, f64) {
    let shape = Polyhedron::cuboid(Vector3::from(edges)).unwrap();
    let axis = nalgebra::Unit::new_normalize(Vector3::new(1.0, 2.0, 3.0));
    let turn = nalgebra::Rotation3::from_axis_angle(&axis, angle);
    let planes = shape
        .half_spaces()
        .iter()
        .map(|face| {
            let normal = turn * face.normal;
            Plane {
                normal: normal.into(),
                offset: face.offset + normal.dot(&Vector3::from(centre)),
            }
        })
        .collect();
    (planes, shape.radius())
}

/// Sum of fractions over a box of cells that holds the body; rows must agree with the cells.
fn sum(form: &Form<'_>, method: Method) -> f64 {
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
            let row = form.row(0, first);
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
    assert!((sum(&ball, Method::Exact) - 4.0 / 3.0 * PI * 4.3_f64.powi(3)).abs() < 1e-9);
    let disc = Form::Disc {
        centre: [0.37, -0.21, 0.0],
        radius: 4.3,
    };
    assert!((sum(&disc, Method::Exact) - PI * 4.3 * 4.3).abs() < 1e-10);
    // Long, thinner than a cell, smaller than a cell, along the axes and faces on faces of cells.
    for (edges, angle, centre) in [
        ([3.0, 4.0, 7.5], 0.7, [0.1, 0.2, 0.3]),
        ([9.0, 6.0, 0.13], 1.1, [0.4, 0.45, 0.05]),
        ([0.3, 0.2, 0.4], 2.1, [0.5, 0.0, 0.0]),
        ([3.5, 2.0, 4.0], 0.0, [0.3, 0.0, 0.0]),
        ([4.0, 4.0, 4.0], 0.0, [0.0, 0.0, 0.0]),
        ([4.0, 4.0, 4.0], 1e-9, [0.0, 0.0, 0.0]),
    ] {
        let (planes, radius) = cuboid(edges, angle, centre);
        let block = Form::Block {
            planes: &planes,
            centre,
            radius,
        };
        let exact = edges[0] * edges[1] * edges[2];
        let found = sum(&block, Method::Exact);
        assert!(
            (found - exact).abs() < 1e-7 * exact.max(1.0),
            "{edges:?} {found} {exact}"
        );
    }
}

/// The closed form of one cut against clipping.
#[test]
fn one_cut_in_closed_form() {
    let mut scratch = Scratch::default();
    for k in 0..4000_i32 {
        let angle = f64::from(k) * 0.618;
        let height = f64::from(k % 61) / 30.0 - 1.0;
        let flat = (1.0 - height * height).max(0.0).sqrt();
        let normal = [flat * angle.cos(), flat * angle.sin(), height];
        let reach = 0.5 * (normal[0].abs() + normal[1].abs() + normal[2].abs());
        let offset = reach * (f64::from(k % 97) / 48.5 - 1.0) * 0.999;
        let plane = Plane { normal, offset };
        scratch.cuts.clear();
        scratch.cuts.push(plane);
        let (closed, clipped) = (cut_once(&plane), cut_often(&mut scratch));
        assert!(
            (closed - clipped).abs() < 3e-8,
            "{plane:?} {closed} {clipped}"
        );
    }
}

/// What the cheaper methods cost in accuracy: the table of the module.
#[test]
fn the_error_of_samples_and_of_the_linear_estimate() {
    let mut scratch = Scratch::default();
    let mut error = |method: Method| {
        let (mut squares, mut cells, mut volume, mut true_volume) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..8 {
            let shift = f64::from(k) / 8.0;
            let ball = Form::Ball {
                centre: [shift, (3.0 * shift).fract(), (5.0 * shift).fract()],
                radius: 8.0,
            };
            for n in 0..20_i32.pow(3) {
                let lower = [n % 20, n / 20 % 20, n / 400].map(|x| f64::from(x - 10));
                let exact = ball.fraction(Method::Exact, lower, &mut scratch);
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
    let (linear, bias) = error(Method::Linear);
    assert!((0.015..0.025).contains(&linear), "{linear}");
    assert!(bias.abs() < 2e-4, "{bias}");
    let mut last = 1.0;
    for (n, most) in [(2, 0.06), (5, 0.01), (10, 0.003)] {
        let (samples, bias) = error(Method::Samples(n));
        assert!(samples < most && samples < last, "{n} {samples}");
        assert!(bias.abs() < 2e-3, "{n} {bias}");
        last = samples;
    }
}
