//! Steady flow: one joint, crossing joints, joints round a block.

use crate::flow::{Drive, FlowSettings, JointFlow};
use crate::network::{End, Network, NetworkSettings, UnderLattice};
use crate::pairs::{PairLimits, Rock};
use crate::water::Mixture;
use dem::polyhedron::{PlacedPolyhedron, Polyhedron};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

/// Boxes between two corners \[m\].
pub(super) fn boxes(corners: &[[[f64; 3]; 2]]) -> Vec<PlacedPolyhedron> {
    let solid = |[low, high]: &[[f64; 3]; 2]| {
        let (low, high) = (Vector3::from(*low), Vector3::from(*high));
        PlacedPolyhedron {
            shape: Polyhedron::cuboid(high - low).unwrap(),
            position: 0.5 * (low + high),
            orientation: UnitQuaternion::identity(),
        }
    };
    corners.iter().map(solid).collect()
}

pub(super) fn rocks(solids: &[PlacedPolyhedron]) -> Vec<Rock<'_>> {
    solids
        .iter()
        .map(|solid| Rock {
            shape: &solid.shape,
            position: solid.position,
            orientation: solid.orientation,
        })
        .collect()
}

pub(super) fn settings(cell: f64) -> NetworkSettings {
    NetworkSettings {
        limits: PairLimits {
            distance: 0.02,
            angle: 0.1,
        },
        residual_aperture: 1e-6,
        cell,
        under: None,
    }
}

pub(super) fn water() -> FlowSettings {
    FlowSettings {
        water: Mixture {
            density: 1000.0,
            viscosity: 1e-3,
            ..Mixture::default()
        },
        roughness: None,
        inertia: false,
        gravity: Vector3::zeros(),
    }
}

/// Boundary pressures as a function of position and time; closed if there is no value.
pub(super) struct Fronts<F>(pub(super) Vec<Vector3<f64>>, pub(super) F);

impl<F: Fn(&Vector3<f64>, f64) -> Option<f64>> Fronts<F> {
    pub(super) fn new(network: &Network, pressure: F) -> Self {
        let middles = network.open.iter().map(|piece| piece.middle);
        Self(middles.collect(), pressure)
    }
}

impl<F: Fn(&Vector3<f64>, f64) -> Option<f64>> Drive for Fronts<F> {
    fn pressure(&self, open: usize, time: f64) -> Option<f64> {
        (self.1)(&self.0[open], time)
    }
}

/// Returns the discharge into the network through open pieces whose middle passes a test.
fn through(flow: &JointFlow, test: impl Fn(&Vector3<f64>) -> bool) -> f64 {
    let outflows = flow.outflows();
    let pieces = flow.network().open.iter().zip(&outflows);
    -pieces
        .filter(|(piece, _)| test(&piece.middle))
        .map(|(_, outflow)| outflow)
        .sum::<f64>()
}

/// Laminar conductance of a parallel layer, w a³/(12 mu L).
fn conductance(width: f64, aperture: f64, length: f64) -> f64 {
    width * aperture.powi(3) / (12.0 * 1e-3 * length)
}

#[test]
fn one_joint_has_the_cubic_law() {
    let (gap, depth, length) = (1e-3, 0.4, 1.0);
    let solids = boxes(&[
        [[0.0, 0.0, 0.0], [length, depth, 0.5]],
        [[0.0, 0.0, 0.5 + gap], [length, depth, 1.0]],
    ]);
    let network = Network::new(&rocks(&solids), &settings(0.07));
    assert_eq!((network.joints.len(), network.junctions.len()), (1, 0));
    assert_eq!(network.cells.len(), 15 * 6);
    let drive = Fronts::new(&network, |at, _| match at.x {
        x if x < 1e-9 => Some(9810.0),
        x if x > 1.0 - 1e-9 => Some(0.0),
        _ => None,
    });
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    let exact = 9810.0 * conductance(depth, gap, length);
    let [entered, left] = [0.0, 1.0].map(|x| through(&flow, |at| (at.x - x).abs() < 1e-9));
    println!("discharge {entered:e}, exact {exact:e}");
    assert!((entered / exact - 1.0).abs() < 1e-10 && (left / exact + 1.0).abs() < 1e-10);
    // 8.175e-4 m²/s at a gradient of 1.
    assert!((exact / depth - 8.175e-4).abs() < 1e-7);
    for (cell, pressure) in flow.network().positions.iter().zip(flow.pressures()) {
        assert!((pressure - 9810.0 * (1.0 - cell.x)).abs() < 1e-7);
    }
}

#[test]
fn a_wedge_has_the_mean_of_the_inverse_cubes() {
    // The upper face rises from 1 to 3 mm.
    let lower = boxes(&[[[0.0, 0.0, 0.0], [1.0, 0.3, 0.5]]]).remove(0);
    let (a, b) = (1e-3, 3e-3);
    let corners = |z: f64, tilt: f64| {
        [[0.0, 0.0], [1.0, 0.0], [1.0, 0.3], [0.0, 0.3]]
            .map(|[x, y]| Vector3::new(x, y, z + tilt * x))
    };
    let points = [corners(0.5 + a, b - a), corners(1.0, 0.0)].concat();
    let upper = Polyhedron::from_vertices(&points).unwrap();
    let network = Network::new(&rocks(&[lower, upper]), &settings(0.05));
    assert_eq!(network.joints.len(), 1);
    let size = network.joints[0].overlap.size();
    let drive = Fronts::new(&network, |at, _| match at.x {
        x if x < 1e-4 => Some(1000.0),
        x if x > 1.0 - 1e-4 => Some(0.0),
        _ => None,
    });
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    // In the plane of the joint, half of the angle off each face; apertures are measured across it.
    let half = (0.5 * (b - a).atan()).cos();
    let gap = |x: f64| flow.gaps()[0].value(&nalgebra::Vector2::new(x, 0.0));
    let ends = [gap(-0.5 * size), gap(0.5 * size)];
    let ends = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    println!("apertures {ends:?}, cosine {half}");
    assert!((ends[0] / a - 1.0).abs() < 1e-5 && (ends[1] / b - 1.0).abs() < 1e-5);
    let cube = 2.0 * (ends[0] * ends[1]).powi(2) / (ends[0] + ends[1]);
    let exact = 1000.0 * 0.3 * cube / (12.0 * 1e-3 * size);
    let found = through(&flow, |at| at.x < 1e-4);
    println!("discharge {found:e}, exact {exact:e}");
    assert!((found / exact - 1.0).abs() < 1e-10);
}

/// Returns four blocks between which a vertical joint of one aperture and a horizontal joint of another aperture
/// remain.
fn cross(upright: f64, level: f64) -> Vec<PlacedPolyhedron> {
    let (x, z) = (0.5 * upright, 0.5 * level);
    boxes(&[
        [[-0.6, 0.0, -0.5], [-x, 0.2, -z]],
        [[x, 0.0, -0.5], [0.4, 0.2, -z]],
        [[-0.6, 0.0, z], [-x, 0.2, 0.3]],
        [[x, 0.0, z], [0.4, 0.2, 0.3]],
    ])
}

#[test]
fn a_cross_of_joints_is_a_star_of_resistances() {
    let (upright, level) = (1.5e-3, 0.8e-3);
    let solids = cross(upright, level);
    let network = Network::new(&rocks(&solids), &settings(0.09));
    assert_eq!(network.joints.len(), 4);
    let joined = |junction: &crate::edges::Junction| junction.pieces.len() == 4;
    assert!(!network.junctions.is_empty() && network.junctions.iter().all(joined));
    let pressure = |at: &Vector3<f64>| match at {
        at if at.x < -0.59 => Some(5e3),
        at if at.x > 0.39 => Some(-1e3),
        at if at.z < -0.49 => Some(2e3),
        at if at.z > 0.29 => Some(0.0),
        _ => None,
    };
    let drive = Fronts::new(&network, move |at, _| pressure(at));
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    let arms = [
        (5e3, conductance(0.2, level, 0.6 - 0.5 * upright)),
        (-1e3, conductance(0.2, level, 0.4 - 0.5 * upright)),
        (2e3, conductance(0.2, upright, 0.5 - 0.5 * level)),
        (0.0, conductance(0.2, upright, 0.3 - 0.5 * level)),
    ];
    let sum: f64 = arms.iter().map(|arm| arm.1).sum();
    let middle = arms.iter().map(|arm| arm.0 * arm.1).sum::<f64>() / sum;
    let sides: [fn(&Vector3<f64>) -> bool; 4] = [
        |at| at.x < -0.59,
        |at| at.x > 0.39,
        |at| at.z < -0.49,
        |at| at.z > 0.29,
    ];
    for (side, (front, conductance)) in sides.into_iter().zip(arms) {
        let (found, exact) = (through(&flow, side), conductance * (front - middle));
        println!("discharge {found:e}, exact {exact:e}");
        assert!((found / exact - 1.0).abs() < 1e-10);
    }
}

/// Returns a block in a hole: six fixed slabs round it, with an aperture at each face.
fn hole(apertures: [[f64; 2]; 3]) -> Vec<PlacedPolyhedron> {
    let size = [0.5, 0.3, 0.2];
    let outer = |axis: usize, side: usize| {
        let (mut low, mut high) = ([0.0; 3], size);
        if side == 0 {
            (low[axis], high[axis]) = (-0.1, -apertures[axis][0]);
        } else {
            (low[axis], high[axis]) = (size[axis] + apertures[axis][1], size[axis] + 0.1);
        }
        [low, high]
    };
    let mut corners = vec![[[0.0; 3], size]];
    for axis in 0..3 {
        corners.extend([outer(axis, 0), outer(axis, 1)]);
    }
    boxes(&corners)
}

#[test]
fn six_joints_round_a_block_are_a_network_of_resistances() {
    let apertures = [[1e-3, 2e-3], [0.7e-3, 1.1e-3], [0.9e-3, 1.6e-3]];
    let solids = hole(apertures);
    let network = Network::new(&rocks(&solids), &settings(0.04));
    assert_eq!(network.joints.len(), 6);
    // Twelve edges of the block, each with the two joints that meet there, and no open edge.
    assert!(network.open.is_empty());
    assert!(network.junctions.iter().all(|j| j.pieces.len() == 2));
    let length = |junction: &crate::edges::Junction| junction.pieces[0].width;
    let sum: f64 = network.junctions.iter().map(length).sum();
    assert!((sum - 4.0 * (0.5 + 0.3 + 0.2)).abs() < 1e-9, "{sum}");

    // Openings at both ends along x alone: the four sides conduct side by side. The slabs at the ends are left out.
    let open = [&solids[..1], &solids[3..]].concat();
    let network = Network::new(&rocks(&open), &settings(0.04));
    assert_eq!(network.joints.len(), 4);
    let drive = Fronts::new(&network, |at, _| match at.x {
        x if x < 1e-6 => Some(700.0),
        x if x > 0.5 - 1e-6 => Some(0.0),
        _ => None,
    });
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    let sides = [
        conductance(0.2, apertures[1][0], 0.5),
        conductance(0.2, apertures[1][1], 0.5),
        conductance(0.3, apertures[2][0], 0.5),
        conductance(0.3, apertures[2][1], 0.5),
    ];
    let exact = 700.0 * sides.iter().sum::<f64>();
    let found = through(&flow, |at| at.x < 1e-6);
    println!("four sides: {found:e}, exact {exact:e}");
    assert!((found / exact - 1.0).abs() < 1e-10);

    // Water enters all round one end face and leaves in its middle axis: all six joints take part. The reference is
    // Kirchhoff's law for the same cells, assembled from their sizes alone and solved densely.
    ring(&solids, apertures);
}

/// Compares the flow round the block in two parallel paths with the closed solution: with the joints in the planes
/// across y closed, a ring of four joints in series and parallel.
fn ring(solids: &[PlacedPolyhedron], apertures: [[f64; 2]; 3]) {
    let network = Network::new(
        &rocks(&[&solids[..3], &solids[5..]].concat()),
        &settings(0.04),
    );
    assert_eq!(network.joints.len(), 4);
    // Sources: the whole network is closed at y; a pressure at one joint's side makes no flow, so compare resistances
    // by a dense solution of the same conductances.
    let nodes = network.nodes();
    let mut matrix = DMatrix::zeros(nodes, nodes);
    let mut side = DVector::zeros(nodes);
    let aperture = |joint: usize| {
        let normal = network.joints[joint].normal;
        let axis = normal.iamax();
        // The block is the first of each pair.
        apertures[axis][usize::from(normal[axis] > 0.0)]
    };
    let pressure = |at: &Vector3<f64>| match at {
        at if at.y < 1e-6 && at.x < 0.1 => Some(400.0 * (1.0 + at.z)),
        at if at.y > 0.3 - 1e-6 && at.x > 0.4 => Some(0.0),
        _ => None,
    };
    let mut fronts = 0;
    for link in &network.links {
        let conductance = conductance(link.width, aperture(link.joint), link.length);
        matrix[(link.from, link.from)] += conductance;
        match link.to {
            End::Node(to) => {
                matrix[(to, to)] += conductance;
                matrix[(link.from, to)] -= conductance;
                matrix[(to, link.from)] -= conductance;
            }
            End::Open(piece) => match pressure(&network.open[piece].middle) {
                Some(front) => {
                    side[link.from] += conductance * front;
                    fronts += 1;
                }
                None => matrix[(link.from, link.from)] -= conductance,
            },
        }
    }
    assert!(fronts > 4);
    let exact = matrix.lu().solve(&side).unwrap();
    let drive = Fronts::new(&network, move |at, _| pressure(at));
    let mut flow = JointFlow::new(network, water());
    flow.solve_steady(&drive, 0.0).unwrap();
    let error = flow.pressures().iter().zip(exact.iter());
    let error = error.map(|(a, b): (&f64, &f64)| (a - b).abs());
    let error = error.fold(0.0, f64::max) / exact.amax();
    println!("ring: largest difference from Kirchhoff's law {error:e}");
    assert!(error < 1e-10);
}

#[test]
fn water_at_rest_has_its_hydrostatic_pressure() {
    let solids = cross(1e-3, 1e-3);
    let network = Network::new(&rocks(&solids), &settings(0.1));
    let mut settings = water();
    settings.gravity = Vector3::new(0.0, 0.0, -9.81);
    let drive = Fronts::new(&network, |at, _| {
        (at.z > 0.29 || at.x < -0.59).then(|| 9810.0 * (0.3 - at.z))
    });
    let mut flow = JointFlow::new(network, settings);
    flow.solve_steady(&drive, 0.0).unwrap();
    for (at, pressure) in flow.network().positions.iter().zip(flow.pressures()) {
        assert!((pressure - 9810.0 * (0.3 - at.z)).abs() < 1e-7);
    }
    let most = flow
        .discharges()
        .iter()
        .fold(0.0_f64, |m, q| m.max(q.abs()));
    assert!(most < 1e-17, "{most:e}");
}

#[test]
fn a_block_in_still_water_has_its_buoyancy() {
    let apertures = [[1e-3, 2e-3], [0.7e-3, 1.1e-3], [0.9e-3, 1.6e-3]];
    let solids = hole(apertures);
    let network = Network::new(&rocks(&solids), &settings(0.07));
    let mut flow = JointFlow::new(network, water());
    flow.set_pressures(|at| 9810.0 * (1.0 - at.z));
    let centroids: Vec<Vector3<f64>> = solids.iter().map(|solid| solid.position).collect();
    let all = crate::loads::loads(flow.network(), flow.pressures(), &centroids);
    // The pressures are those in the middle of the joints above and below.
    let exact = 9810.0 * 0.5 * 0.3 * (0.2 + 0.5 * (0.9e-3 + 1.6e-3));
    println!("buoyancy {:?}, exact {exact}", all[0].force);
    assert!((all[0].force - Vector3::new(0.0, 0.0, exact)).norm() < 1e-9 * exact);
    assert!(all[0].moment.norm() < 1e-9 * exact);
    assert!((all[0].area - 2.0 * (0.15 + 0.1 + 0.06)).abs() < 1e-12);
    // Both faces of a joint have opposite forces.
    let sum: Vector3<f64> = all.iter().map(|load| load.force).sum();
    assert!(sum.norm() < 1e-9 * exact);
}

/// Returns `true` if a network is open along the line parallel to y through a point of the plane x-z.
fn is_open_along(solids: &[PlacedPolyhedron], [x, z]: [f64; 2]) -> bool {
    let under = Some(UnderLattice {
        wide: 0.05,
        takeover: 0.1,
    });
    let settings = NetworkSettings {
        under,
        ..settings(0.25)
    };
    let network = Network::new(&rocks(solids), &settings);
    let near = |at: &Vector3<f64>| (at.x - x).hypot(at.z - z) < 0.02;
    // Edges along y; those across it end at the sides of the blocks.
    let along = |at: &Vector3<f64>| at.y > 0.05 && at.y < 0.95;
    assert!(
        network.junctions.iter().any(|one| near(&one.position)),
        "joints meet on the line"
    );
    network
        .open
        .iter()
        .any(|piece| near(&piece.middle) && along(&piece.middle))
}

/// Checks that joints under a lattice which meet on a line are open there if the blocks around it leave a sector free,
/// such as below the edge of a block that stands on a joint.
#[test]
fn joints_that_meet_at_the_surface_are_open() {
    let (a, half) = (0.002, 0.001);
    let left = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]];
    let right = [[1.0 + a, 0.0, 0.0], [2.0, 1.0, 1.0]];
    let line = [1.0 + half, 1.0 + half];
    let upper = |to: f64| [[0.0, 0.0, 1.0 + a], [to, 1.0, 2.0]];
    assert!(is_open_along(&boxes(&[left, right, upper(1.0)]), line));
    assert!(is_open_along(
        &boxes(&[left, right, upper(1.0 + half)]),
        line
    ));
    // A block over both, and four blocks round the line, leave nothing free.
    assert!(!is_open_along(&boxes(&[left, right, upper(2.0)]), line));
    let beside = [[1.0 + a, 0.0, 1.0 + a], [2.0, 1.0, 2.0]];
    let four = boxes(&[left, right, upper(1.0), beside]);
    assert!(!is_open_along(&four, line));
}
