//! Blocks of a rock mass: counts, volumes and statistics with known values.

use approx::assert_relative_eq;
use nalgebra::{UnitQuaternion, Vector3};

use super::joints::{JointSet, Spacing, upward_normal};
use super::*;
use dem::polyhedron::Polyhedron;

/// Returns a box with a corner at the origin.
fn mass(edges: [f64; 3], sets: Vec<JointSet>) -> RockMass {
    let edges = Vector3::from(edges);
    RockMass {
        solid: PlacedPolyhedron {
            shape: Polyhedron::cuboid(edges).unwrap(),
            position: 0.5 * edges,
            orientation: UnitQuaternion::identity(),
        },
        sets,
        seed: 1,
        aperture: 0.0,
        smallest_thickness: 0.0,
        smallest_volume: 0.0,
    }
}

fn set(dip: f64, direction: f64, spacing: Spacing, persistence: f64) -> JointSet {
    JointSet {
        normal: upward_normal(dip, direction),
        origin: Vector3::zeros(),
        spacing,
        persistence,
    }
}

/// Returns three sets at right angles.
fn bricks(spacings: [f64; 3], persistence: f64) -> Vec<JointSet> {
    [(90.0, 90.0), (90.0, 0.0), (0.0, 0.0)]
        .into_iter()
        .zip(spacings)
        .map(|((dip, direction), s)| set(dip, direction, Spacing::Constant(s), persistence))
        .collect()
}

/// Returns joint sets of all kinds.
fn skew(persistence: f64) -> Vec<JointSet> {
    let uniform = Spacing::Uniform { min: 0.2, max: 0.5 };
    let normal = Spacing::Normal {
        mean: 0.4,
        standard_deviation: 0.1,
    };
    vec![
        set(35.0, 110.0, uniform, persistence),
        set(70.0, 250.0, Spacing::Exponential { mean: 0.4 }, persistence),
        set(60.0, 10.0, normal, persistence),
    ]
}

fn volume(blocks: &[PlacedPolyhedron]) -> f64 {
    blocks.iter().map(|block| block.shape.volume()).sum()
}

#[test]
fn three_sets_at_right_angles_make_bricks() {
    let blocks = mass([4.0, 3.0, 2.0], bricks([0.5, 1.0, 0.4], 1.0))
        .blocks()
        .unwrap();
    assert_eq!(blocks.len(), 8 * 3 * 5);
    for block in &blocks {
        assert_relative_eq!(block.shape.volume(), 0.2, max_relative = 1e-12);
        assert_eq!(block.shape.half_spaces().len(), 6);
    }
    assert_relative_eq!(volume(&blocks), 24.0, max_relative = 1e-13);
}

#[test]
fn dip_and_dip_direction_are_those_of_a_compass() {
    let half = 0.5_f64.sqrt();
    let east = upward_normal(45.0, 90.0);
    assert_relative_eq!(east, Vector3::new(half, 0.0, half), epsilon = 1e-15);
    let north = upward_normal(45.0, 0.0);
    assert_relative_eq!(north, Vector3::new(0.0, half, half), epsilon = 1e-15);
    assert_eq!(upward_normal(0.0, 123.0), Vector3::z());
    assert_eq!(upward_normal(90.0, 270.0), -Vector3::x());
}

/// Checks a cube cut by planes of 45° that dip to the east: the part below the k-th plane from the lower edge is a
/// wedge of volume (k s)².
#[test]
fn planes_of_45_degrees_cut_wedges() {
    let s = 0.5_f64.sqrt() / 4.0;
    let blocks = mass([1.0; 3], vec![set(45.0, 90.0, Spacing::Constant(s), 1.0)])
        .blocks()
        .unwrap();
    assert_eq!(blocks.len(), 8);
    let below = |k: f64| {
        let d = k.min(8.0 - k) * s;
        if k < 4.5 { d * d } else { 1.0 - d * d }
    };
    for (k, block) in (0..8).zip(&blocks) {
        let exact = below(f64::from(k) + 1.0) - below(f64::from(k));
        assert_relative_eq!(block.shape.volume(), exact, max_relative = 1e-12);
    }
    assert_relative_eq!(volume(&blocks), 1.0, max_relative = 1e-13);
}

/// Checks that every point of the mass is in exactly one block.
#[test]
fn blocks_fill_the_mass_and_do_not_overlap() {
    for persistence in [1.0, 0.6] {
        let mass = mass([2.0, 1.5, 1.0], skew(persistence));
        let blocks = mass.blocks().unwrap();
        assert!(blocks.len() > 20, "{}", blocks.len());
        assert_relative_eq!(volume(&blocks), 3.0, max_relative = 1e-12);
        let sides: Vec<Vec<HalfSpace>> = blocks.iter().map(PlacedPolyhedron::half_spaces).collect();
        let mut draw = Stream::new(5, 0, 0);
        for _ in 0..2000 {
            let at = Vector3::from_fn(|a, _| draw.uniform() * [2.0, 1.5, 1.0][a]);
            let height = |planes: &Vec<HalfSpace>| {
                let above = |plane: &HalfSpace| plane.height(&at);
                planes.iter().map(above).fold(f64::NEG_INFINITY, f64::max)
            };
            let heights: Vec<f64> = sides.iter().map(height).collect();
            let inside = |by: f64| heights.iter().filter(|&&h| h < by).count();
            assert!(inside(-1e-10) <= 1 && inside(1e-10) >= 1, "{at}");
        }
    }
}

#[test]
fn persistence_is_the_probability_of_a_cut() {
    let one = |persistence| mass([1.0; 3], bricks([0.1; 3], persistence));
    assert_eq!(one(0.0).blocks().unwrap().len(), 1);
    assert_eq!(one(1.0).blocks().unwrap().len(), 1000);
    // One plane through many blocks: a binomial number, 400 of probability 0.3, standard deviation 9.2.
    let mut sets = bricks([0.05, 0.05, 0.5], 1.0);
    sets[2].persistence = 0.3;
    let cuts = mass([1.0; 3], sets).blocks().unwrap().len() - 400;
    assert!((83..158).contains(&cuts), "{cuts}");
}

#[test]
fn a_seed_gives_the_same_blocks_and_another_others() {
    let with = |seed| {
        let mut mass = mass([2.0, 1.5, 1.0], skew(0.6));
        mass.seed = seed;
        mass.blocks().unwrap()
    };
    assert_eq!(with(7), with(7));
    assert_ne!(with(7), with(8));
}

/// Checks the mean and the mean square of many gaps against those of the distribution, to four standard errors.
#[test]
fn gaps_have_the_statistics_of_their_distribution() {
    let exponential = Spacing::Exponential { mean: 0.5 };
    let uniform = Spacing::Uniform { min: 0.2, max: 0.8 };
    let normal = Spacing::Normal {
        mean: 0.5,
        standard_deviation: 0.1,
    };
    for (spacing, deviation, fourth) in [
        // The fourth central moment over the square of the variance.
        (exponential, 0.5, 9.0),
        (uniform, 0.6 / 12.0_f64.sqrt(), 1.8),
        (normal, 0.1, 3.0),
    ] {
        assert_relative_eq!(spacing.mean(), 0.5, epsilon = 1e-15);
        let set = set(0.0, 0.0, spacing, 1.0);
        let offsets = set.offsets(3, 0, -5000.0, 5000.0);
        let gaps: Vec<f64> = offsets.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let n = gaps.iter().fold(0.0, |n, _| n + 1.0);
        let mean = gaps.iter().sum::<f64>() / n;
        let variance = gaps.iter().map(|g| (g - 0.5).powi(2)).sum::<f64>() / n;
        assert!((mean - 0.5).abs() < 4.0 * deviation / n.sqrt(), "{mean}");
        let error = deviation.powi(2) * ((fourth - 1.0) / n).sqrt();
        let off = variance - deviation.powi(2);
        assert!(off.abs() < 4.0 * error, "{spacing:?}: {variance}");
        assert!(offsets.contains(&0.0));
        // A larger mass has the same joints, and more.
        let small = set.offsets(3, 0, -10.0, 10.0);
        assert!(small.iter().all(|at| offsets.contains(at)));
    }
}

#[test]
fn slivers_are_not_cut_off() {
    let mut mass = mass([1.0; 3], skew(1.0));
    mass.smallest_thickness = 0.1;
    mass.smallest_volume = 0.005;
    let blocks = mass.blocks().unwrap();
    assert!(blocks.len() > 4);
    assert_relative_eq!(volume(&blocks), 1.0, max_relative = 1e-12);
    for block in &blocks {
        assert!(block.shape.volume() >= 0.005 * (1.0 - 1e-12));
        assert!(Piece::from_polyhedron(block).thickness() >= 0.1 * (1.0 - 1e-12));
    }
}

/// Checks that an open joint moves both of its walls back by half of the aperture, while the faces of the mass stay.
#[test]
fn joints_open_by_the_aperture() {
    let mut mass = mass([1.0; 3], bricks([0.5; 3], 1.0));
    mass.aperture = 0.02;
    let blocks = mass.blocks().unwrap();
    assert_eq!(blocks.len(), 8);
    for block in &blocks {
        assert_relative_eq!(block.shape.volume(), 0.49_f64.powi(3), max_relative = 1e-12);
        let outermost = |v: &Vector3<f64>| v.min().min((1.0 - v.max()).abs());
        let nearest = block.vertices().iter().map(outermost).fold(1.0, f64::min);
        assert!(nearest.abs() < 1e-14);
    }
}
