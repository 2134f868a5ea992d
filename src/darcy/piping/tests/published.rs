//! Published sands and geometries compared with the rule, and the scale of pipes to a hole. Each test prints its rows.

use super::*;

/// Section of the ground below a dike or in a box of sand.
#[derive(Clone, Copy)]
enum Kind {
    /// Inlet over the depth, and a sand surface behind the cover, a quarter of its length.
    Box,
    /// Sand surfaces on both sides, as long as the dike.
    Basin,
    /// Sand surface upstream, and a ditch of one cell at the toe with a tight cover behind it.
    Dike,
}

/// Name, kind, L \[m\], D \[m\], d70 \[m\], permeability \[m2\], density of the grains over that of water, and the head
/// that was measured or computed by another program of the model \[m\].
///
/// Boxes: parameters of small and medium tests. Basins: the IJkdijk tests (Sellmeijer et al. 2011). Dikes: sand S2-2
/// of Pol et al. (2024), and the validation of D-Geo Flow.
type Sand = (&'static str, Kind, f64, f64, f64, f64, f64, Option<f64>);

const SANDS: [Sand; 12] = [
    (
        "small box, fine sand",
        Kind::Box,
        0.34,
        0.101,
        1.54e-4,
        8e-12,
        2.65,
        None,
    ),
    (
        "small box, medium sand",
        Kind::Box,
        0.3,
        0.1,
        2e-4,
        1.5e-11,
        2.65,
        None,
    ),
    (
        "small box, coarse sand",
        Kind::Box,
        0.3,
        0.1,
        4e-4,
        6e-11,
        2.65,
        None,
    ),
    (
        "medium box",
        Kind::Box,
        1.45,
        0.4,
        2e-4,
        1.5e-11,
        2.65,
        None,
    ),
    (
        "IJkdijk 1",
        Kind::Basin,
        15.0,
        3.0,
        1.8e-4,
        1.06e-11,
        2.5,
        Some(2.30),
    ),
    (
        "IJkdijk 3",
        Kind::Basin,
        15.0,
        3.0,
        1.8e-4,
        1.06e-11,
        2.5,
        Some(2.10),
    ),
    (
        "IJkdijk 2",
        Kind::Basin,
        15.0,
        2.85,
        2.6e-4,
        1.855e-11,
        2.5,
        Some(1.75),
    ),
    (
        "S2-2 below 30 m",
        Kind::Dike,
        30.0,
        10.0,
        2e-4,
        2.2e-11,
        2.65,
        None,
    ),
    (
        "D-Geo Flow 30, 10 m",
        Kind::Dike,
        30.0,
        10.0,
        3e-4,
        1.157e-12,
        2.65,
        Some(11.3),
    ),
    (
        "D-Geo Flow 30, 20 m",
        Kind::Dike,
        30.0,
        20.0,
        3e-4,
        1.157e-12,
        2.65,
        Some(9.9),
    ),
    (
        "D-Geo Flow 30, 30 m",
        Kind::Dike,
        30.0,
        30.0,
        3e-4,
        1.157e-12,
        2.65,
        Some(9.4),
    ),
    (
        "D-Geo Flow 90, 30 m",
        Kind::Dike,
        90.0,
        30.0,
        3e-4,
        1.157e-12,
        2.65,
        Some(24.1),
    ),
];

/// Returns the study of a section with this many cells along the cover; the diameter is that of the rule, d70 in the
/// rows of D-Geo Flow.
fn section(sand: &Sand, cells: usize) -> (Piping, f64) {
    let (name, kind, length, thickness, d70, permeability, density, _) = *sand;
    let edge = length / real(cells);
    let down = (1..).find(|n| real(*n) + 0.5 > thickness / edge).unwrap();
    let (before, behind) = match kind {
        Kind::Box => (0, cells.div_ceil(4)),
        Kind::Basin | Kind::Dike => (cells, cells),
    };
    let toe = before + cells;
    let all = [toe + behind, down, 1];
    let mouth = if matches!(kind, Kind::Dike) {
        toe + 1
    } else {
        toe + behind
    };
    let inlet = match kind {
        Kind::Box => (0, false, [0; 3], all, 1.0),
        Kind::Basin | Kind::Dike => (1, true, [0; 3], [before, down, 1], 1.0),
    };
    let exit = (1, true, [toe, 0, 0], [mouth, down, 1], 0.0);
    let conductivity = permeability * WEIGHT / WATER.viscosity;
    let ground = Ground::new(all, [edge, edge, 1.0], conductivity, &[inlet, exit]);
    let diameter = if name.starts_with("D-Geo") {
        d70
    } else {
        rule::effective_diameter(d70)
    };
    let grains = BottomGrains {
        relative_density: density,
        ..grains(diameter)
    };
    let settings = PipingSettings {
        path: PipePath {
            first: [toe - 1, down - 1, 0],
            axis: 0,
            rises: false,
            count: 3 * cells / 4,
            vertical: 1,
        },
        ..ground.settings(1, grains)
    };
    let found = Piping::study(&ground.pressure, &ground.openness, &settings).unwrap();
    let dike = rule::Dike {
        length,
        thickness,
        permeability,
    };
    let rule = rule::head_of_equilibrium(&grains, &dike);
    (found, rule)
}

/// Heads of published sands, with the limit of three grids by their own order (at least 0.5). The thickness is rounded
/// to whole cells and the ditch is one cell, so that the grids differ in shape as well.
///
/// The rule was fitted to computed results whose programs lie 9 to 20 % above it; it has a scatter of 13 % against
/// its tests. The bound of the test is their sum. Boxes, to whose tests the rule was adapted, lie within 15 %.
#[test]
fn heads_of_published_sands_and_the_rule() {
    println!("name,L,D,d70,permeability,head,limit,order,rule,head/rule,length/L,known");
    for sand in &SANDS {
        let (name, kind, length, thickness, d70, permeability, _, known) = *sand;
        let [coarse, middle, fine] = [12, 24, 48].map(|cells| section(sand, cells));
        let heads = [&coarse, &middle, &fine].map(|(found, _)| found.critical().head);
        let order = ((heads[1] - heads[0]) / (heads[2] - heads[1])).log2();
        let held = if order.is_finite() {
            order.clamp(0.5, 2.0)
        } else {
            0.5
        };
        let limit = heads[2] + (heads[2] - heads[1]) / (held.exp2() - 1.0);
        let (found, rule) = &fine;
        let ratio = heads[2] / rule;
        println!(
            "{name},{length},{thickness},{d70:e},{permeability:e},{:.4},{limit:.4},{order:.2},{rule:.4},\
             {ratio:.3},{:.3},{}",
            heads[2],
            found.critical().length / length,
            known.map_or(String::new(), |head| head.to_string()),
        );
        assert!((0.87..1.20 * 1.13).contains(&ratio), "{name}: {ratio}");
        let is_box = matches!(kind, Kind::Box);
        assert!(!is_box || (ratio - 1.0).abs() < 0.15, "{name}: {ratio}");
    }
}

/// Heads of pipes to a hole, 20 heights wide, D = L/3, in sand S2-2 (Pol, Noordam and Kanning 2024, tables A.4 to A.6):
/// L \[m\] and head \[m\].
const HOLE: [(f64, f64); 5] = [
    (0.9, 0.084),
    (3.0, 0.144),
    (9.0, 0.254),
    (30.0, 0.470),
    (90.0, 0.864),
];

/// Returns the critical pipe in a box of length L with a hole or a ditch behind the cover.
fn in_box(length: f64, cells: usize, hole: bool) -> PipeOfLength {
    let edge = length / real(cells);
    let (wide, down) = (2 * (cells / 3) + 1, cells / 3);
    let all = [cells + cells / 6, wide, down];
    let middle = wide / 2;
    let across = if hole {
        [middle, middle + 1]
    } else {
        [0, wide]
    };
    let ground = Ground::new(
        all,
        [edge; 3],
        2.2e-11 * WEIGHT / WATER.viscosity,
        &[
            (0, false, [0; 3], all, 1.0),
            (
                2,
                true,
                [cells, across[0], 0],
                [cells + 1, across[1], down],
                0.0,
            ),
        ],
    );
    let settings = PipingSettings {
        path: PipePath {
            first: [cells - 1, middle, down - 1],
            axis: 0,
            rises: false,
            count: 3 * cells / 4,
            vertical: 2,
        },
        drive: 0,
        exit: 1,
        grains: grains(2e-4),
        width: Some(PipeWidth::Ratio(20.0)),
    };
    let found = Piping::study(&ground.pressure, &ground.openness, &settings).unwrap();
    *found.critical()
}

/// Returns the exponent of the head over the length by least squares of the logarithms.
fn exponent(rows: &[(f64, f64)]) -> f64 {
    let points: Vec<[f64; 2]> = rows.iter().map(|(l, h)| [l.ln(), (h / l).ln()]).collect();
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / real(points.len());
    let [x, y] = [mean(0), mean(1)];
    let product = |k: usize, m: f64| points.iter().map(|p| (p[0] - x) * (p[k] - m)).sum::<f64>();
    product(1, y) / product(0, x)
}

/// The exponent over a hundredfold of lengths is -1/2 but for the logarithm of width over length, which the published
/// program has as well. The bound is a third of the difference between -1/2 and -1/3. The heads are those of pipes up
/// to three quarters of the length, at whose end they still rise slowly.
#[test]
fn a_pipe_to_a_hole_has_the_scale_of_the_published_model() {
    let (mut holes, mut ditches) = (Vec::new(), Vec::new());
    println!("L,hole,published,length/L,width,cell,ditch");
    for (length, published) in HOLE {
        let (hole, ditch) = (in_box(length, 24, true), in_box(length, 24, false));
        println!(
            "{length},{:.4},{published},{:.3},{:.4},{:.4},{:.4}",
            hole.head,
            hole.length / length,
            hole.exit_width,
            length / 24.0,
            ditch.head
        );
        holes.push((length, hole.head));
        ditches.push((length, ditch.head));
    }
    let [own, other, published] = [exponent(&holes), exponent(&ditches), exponent(&HOLE)];
    println!("exponents: hole {own:.4}, ditch {other:.4}, published {published:.4}");
    for cells in [12, 36] {
        println!(
            "L = 3 m, {cells} cells: {:.4}",
            in_box(3.0, cells, true).head
        );
    }
    assert!((own + 0.5).abs() < 0.05, "{own}");
    assert!((own - published).abs() < 0.05, "{own}");
    let lower = holes
        .iter()
        .zip(&ditches)
        .all(|(hole, ditch)| hole.1 < ditch.1);
    assert!(lower, "{holes:?} {ditches:?}");
}
