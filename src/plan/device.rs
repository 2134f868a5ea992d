//! Features that prevent running on a GPU.
//!
//! A GPU runs the lattices that have kernels between walls and periodic axes, with bodies in partially saturated cells
//! ([`lbm::gpu`]). The presence of a GPU is checked when the run starts.

use crate::scene::Scene;
use crate::scene::findings::Findings;
use crate::scene::flow::{BodyForce, PATH};
use crate::scene::terms::SceneTerm;
use base::error::Remedy;
use case::coupling::Coupling;
use case::fluid::{Device, Precision};
use lbm::boundary::SurfaceKind;
use lbm::fluid::{Models, kernel_exists_on_gpu};

/// Returns the features of a scene that a GPU does not run yet.
fn obstacles(scene: &Scene) -> Vec<String> {
    let Some(flow) = &scene.flow else {
        return Vec::new();
    };
    let mut all = Vec::new();
    if flow.models.turbulence.is_some() {
        all.push("an eddy viscosity".into());
    }
    let covered = matches!(scene.coupling, Some(Coupling::PartiallySaturated(_)));
    let forced = flow.body_force != BodyForce::Constant([0.0; 3])
        || (0..3).any(|a| flow.gravity_acts[a] && scene.gravity[a] != 0.0);
    let stored = match flow.storage {
        Precision::F64 => "f64",
        Precision::F32 => "f32",
    };
    let without_eddies = Models::new(flow.models.lattice, flow.models.collision);
    if !kernel_exists_on_gpu(without_eddies, stored, [forced, covered]) {
        all.push(format!(
            "the collision {} on {:?} in {stored}{}{}",
            flow.models.collision.name(),
            flow.models.lattice,
            if forced { " with a body force" } else { "" },
            if covered { " with saturated cells" } else { "" },
        ));
    }
    if flow.arithmetic == Precision::F32 {
        all.push("collisions in f32".into());
    }
    let open = flow.patches().find(|patch| {
        let surface = patch.condition.model().kind().surface;
        !matches!(surface, SurfaceKind::Wall | SurfaceKind::MovingWall)
    });
    if let Some(patch) = open {
        all.push(format!(
            "a boundary of {} ({})",
            patch.condition.name(),
            patch.name
        ));
    }
    let terms = scene.terms.iter().map(SceneTerm::model);
    let terms = terms.filter(|term| !term.runs_on_gpu());
    all.extend(terms.map(|term| term.name().to_owned()));
    if scene.joints.is_some() {
        all.push("water in joints".into());
    }
    if scene.surface.is_some() {
        all.push("a free surface".into());
    }
    if !scene.structures.is_empty() {
        all.push("structures".into());
    }
    if matches!(scene.coupling, Some(Coupling::BounceBack(_))) {
        all.push("bounce_back coupling".into());
    }
    all
}

/// Returns the device of the fluid of a scene: not a GPU if a feature prevents it.
#[must_use]
pub fn device(scene: &Scene) -> Device {
    let wish = scene.flow.as_ref().map_or(Device::Cpu, |flow| flow.device);
    // The compiled GPU kernels are read only if a GPU is requested.
    if wish == Device::Cpu || obstacles(scene).is_empty() {
        wish
    } else {
        Device::Cpu
    }
}

/// Refuses a requested GPU if a feature of the scene prevents its use.
pub(super) fn check(scene: &Scene, findings: &mut Findings) {
    let asked = |flow: &crate::scene::flow::Flow| flow.device == Device::Gpu;
    if !scene.flow.as_ref().is_some_and(asked) {
        return;
    }
    let against = obstacles(scene);
    if !against.is_empty() {
        let path = format!("{PATH}.device");
        findings.error(
            &path,
            format!("a GPU does not run {} yet", against.join(", ")),
            Remedy::from("use cpu, or auto, which uses a GPU where possible; a GPU runs d3q27 with bgk, trt and \
                          mrt (trt and mrt also with bodies in partially saturated cells), d3q19 with trt, and, \
                          in f64 and without a force, d3q19 and d2q9 with bgk")
                .set(&path, "cpu"),
        );
    }
}

#[cfg(test)]
mod tests {
    use crate::Plan;
    use case::{Document, examples};
    use std::path::Path;

    fn planned(example: &str, set: &[&str]) -> Result<Plan, Vec<base::error::Problem>> {
        let set: Vec<String> = set.iter().map(|&text| text.into()).collect();
        let text = examples::find(example).unwrap().text;
        Plan::prepare(Document::read(text, &set, Path::new("."))?)
    }

    #[test]
    fn a_gpu_is_refused_with_every_reason() {
        let gpu = "fluid.lattice_boltzmann.device=gpu";
        // The cavity in 3-D, with the velocity sets that have kernels.
        let cavity = [
            "domain={\"size\": [0.01, 0.01, 0.01], \"spacing\": 5e-4}",
            "fluid.lattice_boltzmann.lattice=d3q27",
            "fluid.lattice_boltzmann.boundaries[0].condition.moving_wall.velocity=[0.01, 0, 0]",
            "probes=[]",
            "output={}",
        ];
        let with = |device| [&cavity[..], &[device]].concat();
        let ok = planned("cavity", &with(gpu));
        assert!(ok.is_ok(), "{ok:?}");
        assert!(planned("cavity", &[gpu]).is_err());
        let Err(problems) = planned("piping", &[gpu]) else {
            panic!("the openings and links of piping were accepted");
        };
        let problem = problems
            .iter()
            .find(|p| p.path == "fluid.lattice_boltzmann.device")
            .unwrap();
        assert!(problem.reason.contains("pressure"), "{}", problem.reason);
        assert!(problem.reason.contains("bounce_back"), "{}", problem.reason);
        let auto = planned("piping", &["fluid.lattice_boltzmann.device=auto"]).unwrap();
        assert_eq!(super::device(&auto.scene), super::Device::Cpu);
        let auto = planned("cavity", &with("fluid.lattice_boltzmann.device=auto")).unwrap();
        assert_eq!(super::device(&auto.scene), super::Device::Auto);
    }
}
