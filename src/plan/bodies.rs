//! Smallest resolution of a body on the lattice; [`super::added_mass`] limits its density.
//!
//! * A disc or sphere is at least four cells in diameter: fewer cells do not represent its shape.
//! * A block is at least one cell thick. A block of less than two cells may cover all of its cells only in part, and
//!   with the viscous weighting a partly covered cell becomes permeable as τ approaches ½: a stream at τ = 0.50006
//!   passed through a plate of half a cell, and through a plate of one cell that straddled two, with less than 4 % of
//!   its force on the plate.

use super::margin::{Margin, margin};
use crate::scene::Scene;
use crate::scene::blocks::PlacedBlocks;
use crate::scene::findings::{Findings, length_of, number};
use crate::scene::grains::GrainSource;
use base::error::Remedy;
use case::coupling::{Coupling, Weighting};

/// Minimum number of cells in a diameter.
const MIN_CELLS: f64 = 4.0;
/// Minimum number of cells in the thickness of a block.
const THINNEST: f64 = 1.0;
/// Minimum thickness of a plate \[cells\] that contains full cells at any position on the lattice.
const SOLID: f64 = 2.0;

/// Checks all limits of bodies in the fluid.
pub(super) fn check(scene: &Scene, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let Some(coupling) = &scene.coupling else {
        return;
    };
    diameters(scene, coupling, margins, findings);
    buoyancy(scene, coupling, findings);
    thickness(scene, margins, findings);
}

/// Warns of a stated viscous weighting where the hydrostatic pressure of the lattice carries bodies: cells covered in
/// part count by less than their fraction, so that the buoyancy is that of a smaller body.
fn buoyancy(scene: &Scene, coupling: &Coupling, findings: &mut Findings) {
    let (Coupling::PartiallySaturated(written), Some(flow)) = (coupling, &scene.flow) else {
        return;
    };
    let viscous = written.weighting == Some(Weighting::Viscous);
    if viscous && flow.hydrostatic && flow.solid_operator(written).model().weighted() {
        let path = "coupling.partially_saturated.weighting";
        findings.warn(
            path,
            "gravity acts on the water, and with the viscous weighting cells covered in part carry less of its \
             pressure than their fraction: the buoyancy of a disc of 10 cells was 21 % too small, of 20 cells 10 %",
            Remedy::from("use `fraction`").set(path, "fraction"),
        );
    }
}

fn grains_path(source: &GrainSource) -> &'static str {
    match source {
        GrainSource::Growth { .. } => "grains.initial.growth.radii",
        GrainSource::Deposition { .. } => "grains.initial.deposition.grading",
        _ => "grains.initial",
    }
}

fn diameters(
    scene: &Scene,
    coupling: &Coupling,
    margins: &mut Vec<Margin>,
    findings: &mut Findings,
) {
    let h = scene.grid.spacing;
    let factor = coupling.hydraulic_radius_factor();
    let mut diameters: Vec<(String, f64)> = Vec::new();
    if let Some(grains) = &scene.grains
        && let Some((smallest, _)) = grains.radii
    {
        let path = grains_path(&grains.source);
        diameters.push((path.into(), 2.0 * smallest * factor));
    }
    for (n, body) in scene.bodies.iter().enumerate() {
        diameters.push((format!("bodies[{n}].shape"), 2.0 * body.radius));
    }
    for (path, diameter) in diameters {
        let cells = diameter / h;
        if cells < MIN_CELLS * (1.0 - 1e-9) {
            findings.error(
                &path,
                format!(
                    "the smallest diameter in the fluid is {} cells; at least {MIN_CELLS} are required",
                    number(cells)
                ),
                propose_spacing(
                    scene,
                    diameter / MIN_CELLS,
                    format!(
                        "use a spacing of at most {} m, or larger solids",
                        number(diameter / MIN_CELLS)
                    ),
                ),
            );
        }
        margins.push(margin("fewest cells per diameter", MIN_CELLS, cells, &path));
    }
}

/// Proposes the coarsest spacing of at most `finest` that divides the present spacing, so that it divides all
/// lengths that the present one divides; none if the present spacing is more than eight times as large.
pub(super) fn propose_spacing(scene: &Scene, finest: f64, text: String) -> Remedy {
    let h = scene.grid.spacing;
    let parts = (h / finest * (1.0 - 1e-9)).ceil();
    let remedy = Remedy::from(text);
    if (2.0..=8.0).contains(&parts) {
        (scene.chosen).state_spacing(remedy, length_of(1.0 / parts, h))
    } else {
        remedy
    }
}

fn thickness(scene: &Scene, margins: &mut Vec<Margin>, findings: &mut Findings) {
    let bodies = scene.bodies.iter().enumerate();
    let of_bodies =
        bodies.filter_map(|(n, body)| Some((format!("bodies[{n}].shape"), body.thickness()?)));
    let thinnest = scene.blocks.as_ref().and_then(PlacedBlocks::thinnest);
    let of_blocks = thinnest.map(|thinnest| (String::from("blocks.initial"), thinnest));
    for (path, thickness) in of_bodies.chain(of_blocks) {
        let cells = thickness / scene.grid.spacing;
        let remedy = propose_spacing(
            scene,
            thickness / SOLID,
            format!(
                "use a spacing of at most {} m, or a thicker block",
                number(thickness / SOLID)
            ),
        );
        if cells < THINNEST * (1.0 - 1e-9) {
            let reason = format!(
                "the block is {} cells thick; at least {THINNEST} are required, otherwise water flows through it",
                number(cells)
            );
            findings.error(&path, reason, remedy);
        } else if cells < SOLID * (1.0 - 1e-9) {
            let reason = format!(
                "the block is {} cells thick; a block of less than {SOLID} cells may fill no cell completely, and \
                 water of low viscosity then flows through it",
                number(cells)
            );
            findings.warn(&path, reason, remedy);
        }
        margins.push(margin(
            "fewest cells across the thickness of a block",
            THINNEST,
            cells,
            &path,
        ));
    }
}
