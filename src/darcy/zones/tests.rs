use super::*;
use crate::resistance::kozeny_carman;

const WATER: Liquid = Liquid {
    density: 1000.0,
    viscosity: 1e-3,
};

fn grid(dimension: usize) -> SeepageGrid {
    SeepageGrid {
        cells: [4, 3, if dimension == 2 { 1 } else { 2 }],
        origin: [0.0; 3],
        spacing: [1.0, 2.0, 1.0],
        dimension,
        ..SeepageGrid::default()
    }
}

fn layer(axis: usize, from: f64, to: f64, permeability: f64) -> SoilZone {
    let (mut low, mut high) = ([f64::NEG_INFINITY; 3], [f64::INFINITY; 3]);
    (low[axis], high[axis]) = (from, to);
    SoilZone {
        from: low,
        to: high,
        permeability: Some(Rule::Value(permeability)),
        porosity: None,
        raster: None,
        polygon: Vec::new(),
        directions: [1.0; 3],
        shear: 0.0,
        without_grains: true,
    }
}

/// Returns the permeability of each cell along each axis.
fn permeabilities(grid: &SeepageGrid, zones: &[SoilZone]) -> Vec<[f64; 3]> {
    let n = grid.count();
    let zones = Zones::new(grid, zones);
    let mut room = ZonePermeability::new(&zones, n);
    let mut porosity = vec![0.4; n];
    room.replace_porosity(&zones, &mut porosity, |_| true);
    let law = Resistance::KozenyCarman;
    let (diameter, gradient) = (vec![1e-3; n], vec![1.0; n]);
    let bed = BedOfCells {
        porosity: &porosity,
        diameter: &diameter,
        gradient: &gradient,
    };
    let mut permeability = vec![0.0; n];
    law.model().fill(bed, WATER, &mut permeability);
    let open = vec![[1e-6; 3]; permeability.len()];
    room.replace(&zones, law.model(), (bed, &open), WATER, &mut permeability);
    assert_eq!(
        room.change(&zones, law.model(), (bed, &open), WATER, &permeability),
        0.0
    );
    let ratio = |cell: usize| room.ratios().map_or([1.0; 3], |ratios| ratios[cell]);
    let cells = permeability.iter().enumerate();
    cells
        .map(|(cell, k)| ratio(cell).map(|ratio| ratio * k))
        .collect()
}

#[test]
fn layers_that_cut_cells_have_the_means_of_layered_ground() {
    let (a, b) = (1e-10, 3e-13);
    for dimension in [2, 3] {
        let grid = grid(dimension);
        for axis in 0..dimension {
            // A quarter of the first cell along the axis, and the rest.
            let cut = 0.25 * grid.spacing[axis];
            let zones = [layer(axis, -1.0, 1e9, b), layer(axis, 0.0, cut, a)];
            let all = permeabilities(&grid, &zones);
            let harmonic = 1.0 / (0.25 / a + 0.75 / b);
            let arithmetic = 0.25 * a + 0.75 * b;
            for (index, k) in all.iter().enumerate() {
                for other in 0..dimension {
                    let exact = match (grid.cell(index)[axis], other == axis) {
                        (0, true) => harmonic,
                        (0, false) => arithmetic,
                        _ => b,
                    };
                    assert!((k[other] / exact - 1.0).abs() < 1e-14);
                }
            }
        }
    }
}

#[test]
fn a_chessboard_has_the_geometric_mean() {
    // Exact for a chessboard in 2-D (J. B. Keller, J. Math. Phys. 5 (1964) 548): K = sqrt(K_1 K_2).
    let (a, b) = (1e-10, 4e-12);
    let k = effective(0, [&[0.5; 2], &[0.5; 2], &[1.0]], &[a, b, b, a]);
    assert!((k / (a * b).sqrt() - 1.0).abs() < 1e-14);
}

#[test]
fn the_mean_of_boxes_lies_between_the_bounds_of_wiener() {
    let mut draws = base::random::SplitMix::new(8);
    let lengths: [&[f64]; 3] = [&[0.2, 0.8], &[0.5, 0.1, 0.4], &[0.3, 0.7]];
    for _ in 0..100 {
        let all: Vec<f64> = (0..12)
            .map(|_| 10_f64.powf(-14.0 + 4.0 * draws.uniform()))
            .collect();
        let (mut mean, mut resistance) = (0.0, 0.0);
        for (n, k) in all.iter().enumerate() {
            let w = lengths[0][n % 2] * lengths[1][n / 2 % 3] * lengths[2][n / 6];
            mean += w * k;
            resistance += w / k;
        }
        for axis in 0..3 {
            let k = effective(axis, lengths, &all);
            assert!(k > 1.0 / resistance && k < mean);
        }
    }
}

#[test]
fn later_zones_take_precedence_in_what_they_state() {
    let grid = grid(2);
    let porous = SoilZone {
        permeability: None,
        porosity: Some(0.3),
        ..layer(0, 0.0, 2.0, 0.0)
    };
    let slower = SoilZone {
        permeability: Some(Rule::Factor(0.1)),
        ..layer(0, 1.0, 3.0, 0.0)
    };
    let all = permeabilities(&grid, &[porous, slower]);
    let exact = [
        kozeny_carman(0.3, 1e-3),
        0.1 * kozeny_carman(0.3, 1e-3),
        0.1 * kozeny_carman(0.4, 1e-3),
        kozeny_carman(0.4, 1e-3),
    ];
    for (index, k) in all.iter().enumerate() {
        let exact = exact[grid.cell(index)[0]];
        assert!((k[0] / exact - 1.0).abs() < 1e-14, "{index}");
        assert_eq!(k[0], k[1]);
    }
}

#[test]
fn zones_of_grains_end_where_there_are_none() {
    let grid = grid(2);
    let only = SoilZone {
        polygon: Vec::new(),
        directions: [1.0; 3],
        shear: 0.0,
        without_grains: false,
        ..layer(0, 0.0, 4.0, 1e-12)
    };
    let zones = Zones::new(&grid, &[only]);
    let mut room = ZonePermeability::new(&zones, grid.count());
    let mut porosity = vec![0.5; grid.count()];
    room.replace_porosity(&zones, &mut porosity, |cell| cell == 0);
    let law = Resistance::KozenyCarman;
    let (diameter, gradient) = (vec![1e-3; 12], vec![1.0; 12]);
    let bed = BedOfCells {
        porosity: &porosity,
        diameter: &diameter,
        gradient: &gradient,
    };
    let mut permeability = vec![0.0; 12];
    let open = vec![[1e-6; 3]; permeability.len()];
    room.replace(&zones, law.model(), (bed, &open), WATER, &mut permeability);
    assert_eq!(permeability[0], 1e-12);
    assert_eq!(permeability[1], kozeny_carman(0.5, 1e-3));
    assert!(room.ratios().is_none());
}

#[test]
fn nodes_of_a_raster_stand_for_the_points_around_them() {
    let grid = grid(2);
    let raster = Raster {
        nodes: [vec![0.5, 1.5, 3.0], vec![3.0], vec![0.0]],
        permeability: [1e-10, 2e-12, 5e-13].map(Rule::Value).to_vec(),
        porosity: Vec::new(),
    };
    let zone = SoilZone {
        permeability: None,
        raster: Some(raster),
        ..layer(0, f64::NEG_INFINITY, f64::INFINITY, 0.0)
    };
    let all = permeabilities(&grid, &[zone]);
    // The border of the second and the third node lies at 2.25.
    let cut = 1.0 / (0.25 / 2e-12 + 0.75 / 5e-13);
    let exact = [1e-10, 2e-12, cut, 5e-13];
    for (index, k) in all.iter().enumerate() {
        let exact = exact[grid.cell(index)[0]];
        assert!((k[0] / exact - 1.0).abs() < 1e-14, "{index} {k:?}");
    }
}

/// Checks that no open water remains in cells that zones fill, wherever their boundaries cut the cells: the
/// fractions of the boxes add up to one except for rounding.
#[test]
fn cut_cells_that_zones_fill_hold_no_open_water() {
    let grid = grid(3);
    let mut rounded = 0;
    for n in 1..200 {
        let at = |k: u32| f64::from(n * k % 199) / 199.0;
        let mut zones = vec![layer(0, -1.0, 1e9, 1e-10)];
        zones
            .extend([(0, 7), (1, 8), (2, 9)].map(|(axis, k)| layer(axis, 0.1, 0.1 + at(k), 1e-12)));
        let zones = Zones::new(&grid, &zones);
        let mut room = ZonePermeability::new(&zones, grid.count());
        room.replace_porosity(&zones, &mut vec![0.4; grid.count()], |_| false);
        for divided in &zones.cells {
            let part = zones.part(divided, Medium::applies_without_grains);
            rounded += usize::from(part.total_cmp(&1.0).is_lt());
            assert!(room.free(divided.cell).abs() <= 0.0, "{n}");
        }
    }
    assert!(rounded > 0);
}
