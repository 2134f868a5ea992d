//! Fields of grains whose voids, fronts and settlement are known: a cavity with a roof, a trench, a cone, a triangle.

use super::*;

/// Spacing of the grains, equal to their diameter \[m\].
const D: f64 = 0.01;
/// Edge of a cell \[m\].
const EDGE: f64 = 2.0 * D;
/// Cells along each axis; the ground fills all but the uppermost two layers.
const COUNT: [usize; 3] = [12, 4, 8];
const LAYERS: usize = 6;

/// Returns the solid volume of a grain in a cell. A grain is treated as lying wholly in the cell of its centre: there
/// are 8 grains in a cell of 2 x 2 x 2 diameters.
fn overlap(centre: [f64; 3], radius: f64, lower: [f64; 3], upper: [f64; 3]) -> f64 {
    let inside = (0..3).all(|a| (lower[a]..upper[a]).contains(&centre[a]));
    if inside {
        4.0 / 3.0 * std::f64::consts::PI * radius.powi(3)
    } else {
        0.0
    }
}

/// Returns a cubic packing; `edit` moves a grain, or removes it by returning `false`.
fn packing(edit: impl Fn(&mut MeasuredGrain) -> bool) -> Vec<MeasuredGrain> {
    let mut grains = Vec::new();
    for z in 0..2 * LAYERS {
        for y in 0..2 * COUNT[1] {
            for x in 0..2 * COUNT[0] {
                let mut grain = MeasuredGrain {
                    id: grains.len() as u64,
                    at: [x, y, z].map(|k| (real(k) + 0.5) * D),
                    moved: [0.0; 3],
                    radius: 0.5 * D,
                };
                if edit(&mut grain) {
                    grains.push(grain);
                }
            }
        }
    }
    grains
}

fn sink(grain: &mut MeasuredGrain, depth: f64) {
    grain.at[2] -= depth;
    grain.moved[2] -= depth;
}

fn cells() -> Cells {
    Cells::new(COUNT.map(|n| real(n) * EDGE), COUNT)
}

fn ground() -> InitialGround {
    InitialGround::new(cells(), &packing(|_| true), D, overlap)
}

/// Returns an opening two cells long and two wide in the bottom.
fn point(first: usize) -> Point {
    Point {
        from: [real(first) * EDGE, EDGE, 0.0],
        to: [real(first + 2) * EDGE, 3.0 * EDGE, 0.5 * EDGE],
    }
}

const LIMITS: Limits = Limits {
    void_below: 0.5,
    moving: 0.25 * D,
    settled: D,
    percentile: 90.0,
};

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-3 * b.abs() + 1e-12
}

fn sample(grains: &[MeasuredGrain], points: &[Point]) -> Sample {
    ground().measure(grains, points, &LIMITS, overlap)
}

#[test]
fn whole_ground_has_no_void_and_does_not_move() {
    let seen = sample(&packing(|_| true), &[point(2), point(8)]);
    assert_eq!((seen.voids, seen.void_volume), (0, 0.0));
    assert_eq!(seen.settlement_max, 0.0);
    assert_eq!(seen.depression, Depression::default());
    for above in &seen.points {
        assert_eq!((above.front, above.arch_height), (0.0, 0.0));
        assert!(near(above.cover, real(LAYERS) * EDGE), "{above:?}");
        assert!(above.front_shape.is_nan());
    }
}

/// Checks a box-shaped cavity three cells high over the first point, and a closed cavity that belongs to no point.
#[test]
fn a_cavity_under_an_arch_is_measured_and_a_closed_one_is_not_its() {
    let cavity = |at: [f64; 3]| {
        let cell = at.map(|x| (x / EDGE).floor());
        (2.0..4.0).contains(&cell[0]) && (1.0..3.0).contains(&cell[1]) && cell[2] < 3.0
    };
    let closed = |at: [f64; 3]| at.map(|x| (x / EDGE).floor()) == [8.0, 1.0, 3.0];
    let grains = packing(|grain| !cavity(grain.at) && !closed(grain.at));
    let seen = sample(&grains, &[point(2), point(8)]);
    assert_eq!(seen.voids, 1);
    assert!(
        near(seen.void_volume, 12.0 * EDGE.powi(3)),
        "{}",
        seen.void_volume
    );
    assert!(near(seen.points[0].arch_height, 3.0 * EDGE));
    assert_eq!(seen.points[1].void_volume, 0.0);
    // Empty layers move, the roof does not.
    assert!(near(seen.points[0].front, 0.5));
    assert_eq!(seen.settlement_max, 0.0);
}

#[test]
fn voids_that_have_met_are_one() {
    let grains =
        packing(|grain| !(grain.at[2] < EDGE && (2.0 * EDGE..10.0 * EDGE).contains(&grain.at[0])));
    let seen = sample(&grains, &[point(2), point(8)]);
    assert_eq!(seen.voids, 1);
    assert!(near(seen.void_volume, real(8 * COUNT[1]) * EDGE.powi(3)));
    assert_eq!(seen.points[0].void_volume, seen.points[1].void_volume);
}

/// Checks that a cell is void if less than half of its solid remains.
#[test]
fn a_cell_with_a_quarter_of_its_solid_is_void_and_one_with_three_quarters_is_not() {
    // Of the 2 x 2 x 2 grains of each cell of the lowest layer one edge is gone, or all but one edge.
    let low = |grain: &MeasuredGrain| grain.at[2] < EDGE && grain.at[0] < 6.0 * EDGE;
    let odd = |x: f64| (x / D).floor() % 2.0 > 0.5;
    let most = packing(|grain| !(low(grain) && odd(grain.at[0]) && odd(grain.at[1])));
    assert_eq!(sample(&most, &[point(2)]).voids, 0);
    let few = packing(|grain| !(low(grain) && !(odd(grain.at[0]) && odd(grain.at[1]))));
    let seen = sample(&few, &[point(2)]);
    assert_eq!(seen.voids, 1);
    let missing = 0.75 * real(6 * COUNT[1]) * EDGE.powi(3);
    assert!(near(seen.void_volume, missing), "{}", seen.void_volume);
}

/// Checks a cone of depth 4 d: the settlement of a column is that of the highest grain left in it.
#[test]
fn a_cone_settles_as_deep_as_it_is() {
    let middle = [6.0 * EDGE, 2.0 * EDGE];
    let surface = real(LAYERS) * EDGE;
    let depth = 4.0 * D;
    let grains = packing(|grain| {
        let r = (grain.at[0] - middle[0]).hypot(grain.at[1] - middle[1]);
        grain.at[2] + grain.radius <= surface - (depth - r).max(0.0) + 1e-12
    });
    let seen = sample(&grains, &[point(5)]);
    // The innermost grains are at r = d/sqrt(2): above them less than 4 d, so they go down to 3 d below the surface at
    // most.
    let expected = |column: [usize; 2]| {
        let corners = [0.5, 1.5].iter().flat_map(|a| [0.5, 1.5].map(|b| (*a, b)));
        let highest = corners.map(|(a, b)| {
            let x = real(column[0]) * EDGE + a * D - middle[0];
            let y = real(column[1]) * EDGE + b * D - middle[1];
            ((depth - x.hypot(y)).max(0.0) / D - 1e-9).ceil() * D
        });
        highest.fold(f64::INFINITY, f64::min)
    };
    for across in 0..COUNT[1] {
        for long in 0..COUNT[0] {
            let found = seen.settlement[cells().column(long, across)].unwrap();
            assert!(
                near(found, expected([long, across]).max(0.0)),
                "{long} {across}: {found}"
            );
        }
    }
    assert!(near(seen.settlement_max, expected([5, 1])));
    assert!(seen.depression.length >= 2.0 * EDGE && seen.depression.length <= 4.0 * EDGE);
}

/// Checks two trenches of 3 and 2 cells across the whole width, one and two diameters deep.
#[test]
fn trenches_have_the_length_and_depth_they_were_dug_with() {
    let surface = real(LAYERS) * EDGE;
    let depth = |x: f64| match (x / EDGE).floor() {
        k if (1.0..4.0).contains(&k) => 2.0 * D,
        k if (7.0..9.0).contains(&k) => D,
        _ => 0.0,
    };
    let grains = packing(|grain| grain.at[2] < surface - depth(grain.at[0]));
    let seen = sample(&grains, &[point(2), point(8)]);
    assert!(near(seen.settlement_max, 2.0 * D));
    let dug = seen.depression;
    assert!(
        near(dug.length, 5.0 * EDGE) && near(dug.longest, 3.0 * EDGE),
        "{dug:?}"
    );
    assert!(near(dug.width, 4.0 * EDGE));
    // The middle third are the slices 4 ... 7, one of them one diameter down.
    assert!(near(seen.settlement_middle, 0.25 * D));
    // 12 of 48 columns are two diameters down, 8 one: the 90th percentile is among the deepest.
    assert!(near(seen.settlement_percentile, 2.0 * D));
}

/// Leaves out single grains in flight: grains that fall together are ground, and the elevation of a column without
/// grains is that of its lowest ground.
#[test]
fn a_grain_in_flight_is_no_ground() {
    let mut flying = packing(|grain| grain.at[0] > 2.0 * EDGE);
    for grain in &mut flying {
        if grain.at[0] > 10.0 * EDGE {
            sink(grain, 0.4 * D);
        }
    }
    let mut alone = flying[0];
    alone.at = [5.0 * EDGE, 2.0 * EDGE, real(LAYERS) * EDGE + 1.2 * D];
    flying.push(alone);
    let seen = sample(&flying, &[point(4)]);
    assert!(near(seen.settlement_max, real(LAYERS) * EDGE));
    assert!(near(seen.depression.length, 2.0 * EDGE));
    let at = |long| seen.settlement[cells().column(long, 2)].unwrap();
    assert!(at(5).abs() < 1e-12, "{}", at(5));
    assert!(near(at(11), 0.4 * D), "{}", at(11));
}

/// Returns a large grain on the ground, just inside column (5, 2).
fn perched() -> MeasuredGrain {
    MeasuredGrain {
        id: 1_000_000,
        at: [
            6.0 * EDGE - 0.1 * D,
            2.0 * EDGE + 0.5 * D,
            real(LAYERS) * EDGE + 1.5 * D,
        ],
        moved: [0.0; 3],
        radius: 1.5 * D,
    }
}

/// Returns the ground with a perched grain, before and after `edit` is applied to the grain.
fn with_perched(edit: impl Fn(&mut MeasuredGrain)) -> Sample {
    let mut grains = packing(|_| true);
    grains.push(perched());
    let ground = InitialGround::new(cells(), &grains, D, overlap);
    grains.iter_mut().for_each(edit);
    ground.measure(&grains, &[point(5)], &LIMITS, overlap)
}

#[test]
fn a_grain_that_rolls_off_its_column_takes_no_ground_along() {
    let k = cells().column(5, 2);
    let seen = with_perched(|grain| {
        if grain.radius > D {
            grain.at[0] += 0.2 * D;
            grain.moved[0] += 0.2 * D;
            sink(grain, 1.2 * D);
        }
    });
    // The top of the column is three diameters lower, and that grain has moved by more than one; its neighbours are
    // stationary.
    assert!(near(seen.surface[k].unwrap(), real(LAYERS) * EDGE));
    assert_eq!(seen.settlement[k], Some(0.0));
    assert_eq!(seen.settlement_max, 0.0);
    assert_eq!(seen.depression, Depression::default());
}

#[test]
fn one_column_that_sinks_with_its_grains_is_a_depression() {
    let k = cells().column(5, 2);
    let seen = with_perched(|grain| {
        if cells().cell_of(grain.at)[..2] == [5, 2] {
            sink(grain, 1.5 * D);
        }
    });
    assert!(near(seen.settlement[k].unwrap(), 1.5 * D));
    let found = seen.depression;
    assert!(
        near(found.length, EDGE) && near(found.width, EDGE),
        "{found:?}"
    );
}

/// Checks sinkholes: a single column over the point is one; away from the point two columns side by side or corner to
/// corner are, with the smaller settlement.
#[test]
fn a_sinkhole_lies_over_a_point_or_is_wider_than_a_column() {
    let sunk = |columns: &[([usize; 2], f64)]| {
        let grains = packing(|grain| {
            let [long, across, _] = cells().cell_of(grain.at);
            for (column, depth) in columns {
                if *column == [long, across] {
                    sink(grain, *depth);
                }
            }
            true
        });
        // Over columns 2 and 3.
        sample(&grains, &[point(2)]).sinkhole
    };
    assert!(near(sunk(&[([3, 0], 1.5 * D)]), 1.5 * D));
    assert_eq!(sunk(&[([5, 2], 1.5 * D)]), 0.0);
    assert!(near(sunk(&[([5, 2], 1.5 * D), ([6, 2], D)]), D));
    assert!(near(sunk(&[([5, 2], 1.5 * D), ([6, 3], D)]), D));
    assert!(near(sunk(&[([5, 2], 1.5 * D), ([4, 3], 2.0 * D)]), 1.5 * D));
    assert_eq!(sunk(&[([5, 2], 1.5 * D), ([7, 2], D)]), 0.0);
}

/// Checks ground over a point that has moved down within a triangle, then within a rectangle.
#[test]
fn the_shape_of_a_front_distinguishes_a_triangle_from_a_rectangle() {
    let point = Point {
        from: [0.0, 0.0, 0.0],
        to: [12.0 * EDGE, 4.0 * EDGE, 0.5 * EDGE],
    };
    let moved = |grain: &mut MeasuredGrain, inside: bool| {
        grain.moved[2] = if inside { -10.0 * D } else { 0.0 };
        true
    };
    // Layer k of 6 moves over 12 - 2 k cells: 12, 10, 8 below and 6, 4, 2 above.
    let triangle = packing(|grain| {
        let [x, _, z] = cells().cell_of(grain.at);
        moved(grain, x >= z && x < 12 - z)
    });
    let seen = sample(&triangle, &[point]).points[0];
    assert!(
        near(seen.front, 1.0) && near(seen.front_shape, 12.0 / 30.0),
        "{seen:?}"
    );
    let rectangle = packing(|grain| {
        let [x, _, _] = cells().cell_of(grain.at);
        moved(grain, (3..9).contains(&x))
    });
    let seen = sample(&rectangle, &[point]).points[0];
    assert!(near(seen.front_shape, 1.0), "{seen:?}");
    // Up to the fourth layer only.
    let low = packing(|grain| {
        let up = grain.at[2] < 4.0 * EDGE;
        moved(grain, up)
    });
    assert!(near(sample(&low, &[point]).points[0].front, 4.0 / 6.0));
}

/// Checks a fissure that widens upwards: the layers are two, three and four cells wide. Ground that moves over the same
/// length at every height is a rectangle, though the upper half of the moving ground has more cells.
#[test]
fn the_shape_of_a_front_is_that_of_the_long_section_in_a_widening_fissure() {
    let point = Point {
        from: [0.0, EDGE, 0.0],
        to: [12.0 * EDGE, 3.0 * EDGE, 0.5 * EDGE],
    };
    let v = |edit: &dyn Fn(&mut MeasuredGrain)| {
        packing(|grain| {
            let [_, y, z] = cells().cell_of(grain.at);
            edit(grain);
            (1..(z + 3).min(4)).contains(&y) || (y == 0 && z >= 3)
        })
    };
    let ground = InitialGround::new(cells(), &v(&|_| ()), D, overlap);
    let shape = |moves: fn([usize; 3]) -> bool| {
        let grains = v(&|grain| {
            if moves(cells().cell_of(grain.at)) {
                grain.moved[2] = -10.0 * D;
            }
        });
        let seen = ground.measure(&grains, &[point], &LIMITS, overlap);
        seen.points[0].front_shape
    };
    assert!(near(shape(|[x, _, _]| (3..9).contains(&x)), 1.0));
    assert!(near(shape(|[x, _, z]| x >= z && x < 12 - z), 12.0 / 30.0));
}

/// Checks soil that moves from both sides towards the nearest point; soil further away than the thickness of the cover
/// does not count.
#[test]
fn soil_beside_a_point_moves_inward() {
    let grains = packing(|grain| {
        let start = grain.at[0];
        let step = 0.1 * D;
        grain.moved[0] = if start < 2.0 * EDGE { step } else { -step };
        grain.at[0] += grain.moved[0];
        true
    });
    let seen = sample(&grains, &[point(2)]);
    assert!(near(seen.inward, 0.1 * D), "{}", seen.inward);
}

#[test]
fn ground_survives_a_checkpoint() {
    let mut ground = ground();
    ground.surface[3] = None;
    ground.surface[4] = Some(0.1 + 0.2);
    let text = serde_json::to_string(&ground).unwrap();
    assert_eq!(
        serde_json::from_str::<InitialGround>(&text).unwrap(),
        ground
    );
}
