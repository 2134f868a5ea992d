//! Broken cases: each is refused with exit code 3 with one sentence that names the path.

use crate::ranks::{Cores, beside_others, hang};
use assert_cmd::Command;
use serde_json::Value;
use solver::case::Document;
use solver::case::examples::find;
use solver::error::{Problem, Severity};
use solver::plan::Plan;
use std::path::Path;
use std::time::Instant;

/// Change that breaks a case.
pub(crate) enum Break {
    /// `--set` assignments.
    Set(&'static [&'static str]),
    /// Removal of a field, by JSON pointer.
    Remove(&'static str),
    /// Replacement of a text by another, once.
    Text(&'static str, &'static str),
}
use Break::{Remove, Set, Text};

/// Valid analysis of a collapse, to be broken.
const COLLAPSE: &str = "analysis={\"ground_collapse\": {\"every\": 0.001, \"stages\": {}, \"points\": [{\"name\": \
    \"p\", \"box\": {\"from\": [0, 0, 0], \"to\": [0.01, 0.01, 0.01]}}]}}";

/// Moduli of the soil.
const ELASTIC: &str =
    "materials.soil={\"density\": 2600, \"young_modulus\": 1e8, \"poisson_ratio\": 0.2}";

const LB: &str = "fluid.lattice_boltzmann";

/// Name of the fault, the example, the fault, and the path in the message. A path that starts with `.` is below the
/// lattice Boltzmann part.
pub(crate) const TABLE: &[(&str, &str, Break, &str)] = &[
    // Text
    ("not JSON", "couette", Text("{", "["), "line 2"),
    (
        "trailing comma",
        "couette",
        Text("\"time\": {\"end\": 2}", "\"time\": {\"end\": 2,}"),
        "line 1",
    ),
    (
        "key twice",
        "couette",
        Text("\"time\":", "\"time\": {\"end\": 1}, \"time\":"),
        "time",
    ),
    (
        "NaN",
        "couette",
        Text("\"end\": 2", "\"end\": NaN"),
        "line 1",
    ),
    (
        "beyond f64",
        "couette",
        Text("\"end\": 2", "\"end\": 1e999"),
        "line 1",
    ),
    // Unknown
    ("unknown top field", "couette", Set(&["flud={}"]), "flud"),
    (
        "unknown field",
        "couette",
        Set(&["fluid.lattice_boltzmann.viscosity=1e-6"]),
        ".viscosity",
    ),
    (
        "unknown field in a list",
        "couette",
        Set(&["probes[0].evry=1"]),
        "probes[0].evry",
    ),
    (
        "unknown choice",
        "couette",
        Set(&["fluid.lattice_boltzmann.collision={\"mrt\": {}}"]),
        ".collision.mrt",
    ),
    (
        "unknown word",
        "couette",
        Set(&["fluid.lattice_boltzmann.lattice=d2q8"]),
        ".lattice",
    ),
    (
        "unknown face",
        "couette",
        Set(&["fluid.lattice_boltzmann.boundaries[0].face=top"]),
        ".boundaries[0].face",
    ),
    (
        "unknown output field",
        "couette",
        Set(&["output.fluid.fields=[\"speed\"]"]),
        "output.fluid.fields[0]",
    ),
    (
        "two choices at once",
        "couette",
        Set(&["fluid.lattice_boltzmann.collision={\"bgk\": {}, \"trt\": {}}"]),
        ".collision",
    ),
    // Wrong type
    (
        "text for a number",
        "couette",
        Set(&["fluid.lattice_boltzmann.density=water"]),
        ".density",
    ),
    (
        "number for an object",
        "couette",
        Set(&["domain=3"]),
        "domain",
    ),
    (
        "object for a list",
        "couette",
        Set(&["probes={}"]),
        "probes",
    ),
    (
        "fraction for a count",
        "poiseuille",
        Set(&["probes[0].at.line.points=2.5"]),
        "probes[0].at.line.points",
    ),
    (
        "number for a word",
        "couette",
        Set(&["domain.split=1"]),
        "domain.split",
    ),
    (
        "null for a needed object",
        "couette",
        Set(&["time=null"]),
        "time",
    ),
    // Missing
    ("no domain", "couette", Remove("/domain"), "domain"),
    ("no time", "couette", Remove("/time"), "time"),
    (
        "no spacing for blocks",
        "scour",
        Remove("/domain/spacing"),
        "domain.spacing",
    ),
    (
        "unknown accuracy",
        "couette",
        Set(&["accuracy=best"]),
        "accuracy",
    ),
    (
        "accuracy out of reach",
        "couette",
        Set(&["accuracy={\"drag_error\": 0}"]),
        "accuracy.drag_error",
    ),
    (
        "no viscosity",
        "couette",
        Remove("/fluid/lattice_boltzmann/kinematic_viscosity"),
        ".kinematic_viscosity",
    ),
    (
        "no stiffness",
        "piping",
        Remove("/contact/cohesive_frictional/normal_stiffness"),
        "contact.cohesive_frictional.normal_stiffness",
    ),
    (
        "no grain density",
        "piping",
        Remove("/materials/soil/density"),
        "materials.soil.density",
    ),
    ("no law for bonds", "piping", Remove("/contact"), "contact"),
    ("nothing at all", "couette", Remove("/fluid"), "fluid"),
    // Out of range
    (
        "negative spacing",
        "couette",
        Set(&["domain.spacing=-1"]),
        "domain.spacing",
    ),
    (
        "zero density",
        "couette",
        Set(&["fluid.lattice_boltzmann.density=0"]),
        ".density",
    ),
    (
        "huge viscosity",
        "couette",
        Set(&["fluid.lattice_boltzmann.kinematic_viscosity=1e308"]),
        ".kinematic_viscosity",
    ),
    ("negative end", "couette", Set(&["time.end=-1"]), "time.end"),
    ("endless", "couette", Set(&["time.end=1e20"]), "time.end"),
    (
        "friction of 90 degrees",
        "piping",
        Set(&["contact.cohesive_frictional.friction_angle_degrees=90"]),
        "contact.cohesive_frictional.friction_angle_degrees",
    ),
    (
        "negative cohesion",
        "piping",
        Set(&["contact.cohesive_frictional.cohesion.per_diameter=-1"]),
        "contact.cohesive_frictional.cohesion.per_diameter",
    ),
    (
        "zero stiffness",
        "piping",
        Set(&["contact.cohesive_frictional.normal_stiffness.per_diameter=0"]),
        "contact.cohesive_frictional.normal_stiffness",
    ),
    (
        "radius factor above one",
        "piping",
        Set(&["coupling.bounce_back.hydraulic_radius_factor=1.5"]),
        "coupling.bounce_back.hydraulic_radius_factor",
    ),
    (
        "two rules for narrow gaps",
        "piping",
        Set(&[
            "coupling.bounce_back.drop_wall_velocity_at_solid_neighbours=5",
            "coupling.bounce_back.mean_wall_velocity_at_solid_neighbours=6",
        ]),
        "coupling.bounce_back.drop_wall_velocity_at_solid_neighbours",
    ),
    (
        "one checkpoint",
        "piping",
        Set(&["checkpoint.keep=1"]),
        "checkpoint.keep",
    ),
    (
        "four dimensions",
        "couette",
        Set(&["domain.size=[1, 1, 1, 1]"]),
        "domain.size",
    ),
    (
        "negative radius",
        "collision",
        Set(&["grains.initial.list[0].radius=-0.01"]),
        "grains.initial.list[0].radius",
    ),
    // The grid
    (
        "size not whole spacings",
        "couette",
        Set(&["domain.size=[0.0004, 0.00101]"]),
        "domain.size[1]",
    ),
    (
        "3-D lattice in 2-D",
        "couette",
        Set(&["fluid.lattice_boltzmann.lattice=d3q19"]),
        ".lattice",
    ),
    (
        "periodic in z in 2-D",
        "couette",
        Set(&["domain.periodic=[\"x\", \"z\"]"]),
        "domain.periodic[1]",
    ),
    (
        "periodic twice",
        "couette",
        Set(&["domain.periodic=[\"x\", \"x\"]"]),
        "domain.periodic[1]",
    ),
    (
        "slabs that fall",
        "couette",
        Set(&["domain.slab_bounds=[9, 3]"]),
        "domain.slab_bounds",
    ),
    (
        "memory",
        "couette",
        Set(&["domain.size=[20, 20]"]),
        "domain.spacing",
    ),
    // Time steps
    (
        "tau of one half",
        "couette",
        Set(&["fluid.lattice_boltzmann.relaxation_time=0.5"]),
        ".relaxation_time",
    ),
    (
        "tau below one half",
        "piping",
        Set(&["fluid.lattice_boltzmann.relaxation_time=0.3"]),
        ".relaxation_time",
    ),
    (
        "two ways to the time step",
        "couette",
        Set(&["fluid.lattice_boltzmann.time_step=1e-5"]),
        ".time_step",
    ),
    (
        "reference velocity without lattice velocity",
        "cavity",
        Remove("/fluid/lattice_boltzmann/lattice_velocity"),
        ".lattice_velocity",
    ),
    (
        "too few solid steps",
        "piping",
        Set(&["time.solid_steps_per_fluid_step=2"]),
        "time.solid_steps_per_fluid_step",
    ),
    (
        "solid step above critical",
        "collision",
        Set(&["time.solid_time_step=1e-3"]),
        "time.solid_time_step",
    ),
    (
        "solid step in a fluid",
        "piping",
        Set(&["time.solid_time_step=1e-6"]),
        "time.solid_time_step",
    ),
    // Lattice velocity
    (
        "lid too fast",
        "couette",
        Set(&["fluid.lattice_boltzmann.boundaries[0].condition.moving_wall.velocity=[1, 0]"]),
        ".boundaries[0].condition.moving_wall.velocity",
    ),
    (
        "inlet too fast",
        "cylinder",
        Set(&[
            "fluid.lattice_boltzmann.boundaries[0].condition.velocity.profile.parabolic.peak=30",
        ]),
        ".boundaries[0].condition.velocity.profile.parabolic.peak",
    ),
    (
        "pressure too high",
        "piping",
        Set(&["fluid.lattice_boltzmann.boundaries[0].condition.pressure.value=300"]),
        ".boundaries[0].condition.pressure.value",
    ),
    (
        "body force too high",
        "poiseuille",
        Set(&["fluid.lattice_boltzmann.body_force.constant=[8000, 0]"]),
        ".body_force",
    ),
    (
        "vortices too fast",
        "taylor-green",
        Set(&["fluid.lattice_boltzmann.initial.taylor_green.velocity=1"]),
        ".initial.taylor_green.velocity",
    ),
    // Precision
    (
        "collisions in f32 of populations in f64",
        "couette",
        Set(&[
            "fluid.lattice_boltzmann.arithmetic=f32",
            "fluid.lattice_boltzmann.storage=f64",
        ]),
        ".storage",
    ),
    (
        "collisions in f32 under a free surface",
        "dam-break",
        Set(&["fluid.lattice_boltzmann.arithmetic=f32"]),
        ".arithmetic",
    ),
    // Boundaries
    (
        "condition on a periodic face",
        "couette",
        Set(&["fluid.lattice_boltzmann.boundaries[0].face=x_min"]),
        ".boundaries[0].face",
    ),
    (
        "two conditions on a face",
        "piping",
        Set(&["fluid.lattice_boltzmann.boundaries[3].face=y_min"]),
        ".boundaries[3].face",
    ),
    (
        "patch outside the face",
        "piping",
        Set(&[
            "fluid.lattice_boltzmann.boundaries[0].patch={\"from\": [0, 0.003], \"to\": [0, 0.005]}",
        ]),
        ".boundaries[0].patch",
    ),
    (
        "wall that moves off",
        "couette",
        Set(&["fluid.lattice_boltzmann.boundaries[0].condition.moving_wall.velocity=[0, 0.001]"]),
        ".boundaries[0].condition.moving_wall.velocity",
    ),
    (
        "inlet without outlet",
        "cylinder",
        Set(&["fluid.lattice_boltzmann.boundaries[1].condition={\"no_slip\": {}}"]),
        ".boundaries",
    ),
    (
        "vector of the wrong length",
        "couette",
        Set(&[
            "fluid.lattice_boltzmann.boundaries[0].condition.moving_wall.velocity=[0.001, 0, 0]",
        ]),
        ".boundaries[0].condition.moving_wall.velocity",
    ),
    (
        "vortices between walls",
        "taylor-green",
        Set(&["domain.periodic=[\"x\"]"]),
        ".initial.taylor_green",
    ),
    (
        "initial file that is not there",
        "couette",
        Set(&["fluid.lattice_boltzmann.initial={\"file\": {\"path\": \"no.vtkhdf\"}}"]),
        ".initial.file.path",
    ),
    // Solids
    (
        "unknown material",
        "piping",
        Set(&["grains.material=sol"]),
        "grains.material",
    ),
    (
        "overlap at the start",
        "collision",
        Set(&["grains.initial.list[1].position=[0.095, 0.05]"]),
        "grains.initial.list[1].position",
    ),
    (
        "grain outside",
        "collision",
        Set(&["grains.initial.list[1].position=[0.5, 0.05]"]),
        "grains.initial.list[1].position",
    ),
    (
        "grain in the wall",
        "settling-disc",
        Set(&["bodies[0].position=[0.0005, 0.04]"]),
        "bodies[0].position",
    ),
    (
        "sphere in 2-D",
        "cylinder",
        Set(&["bodies[0].shape={\"sphere\": {\"radius\": 0.05}}"]),
        "bodies[0].shape",
    ),
    (
        "disc of too few cells",
        "cylinder",
        Set(&["bodies[0].shape.disc.radius=0.015"]),
        "bodies[0].shape",
    ),
    (
        "grains of too few cells",
        "piping",
        Set(&["grains.initial.growth.radii.uniform.min=0.3e-4"]),
        "grains.initial.growth.radii",
    ),
    (
        "radii the wrong way round",
        "piping",
        Set(&["grains.initial.growth.radii={\"uniform\": {\"min\": 2e-4, \"max\": 1e-4}}"]),
        "grains.initial.growth.radii.uniform",
    ),
    (
        "grains overfill the box",
        "piping",
        Set(&["grains.initial.growth.amount={\"number\": 5000}"]),
        "grains.initial.growth.amount.number",
    ),
    (
        "hole outside the domain",
        "piping",
        Set(&["grains.cut[2].box.to=[0.02, 0.0024]"]),
        "grains.cut[2].box",
    ),
    (
        "hole without extent",
        "piping",
        Set(&["grains.cut[2].box.to=[0.0012, 0.0024]"]),
        "grains.cut[2].box",
    ),
    (
        "sample that is not there",
        "piping",
        Set(&["grains.initial={\"file\": {\"path\": \"no.csv\"}}"]),
        "grains.initial.file.path",
    ),
    (
        "a grain wider than its period",
        "collision",
        Set(&[
            "domain.periodic=[\"y\"]",
            "grains.initial.list=[{\"position\": [0.1, 0.05], \"radius\": 0.0501}]",
        ]),
        "grains.initial.list[0].radius",
    ),
    (
        "new grains wider than their period",
        "collision",
        Set(&[
            "domain.periodic=[\"y\"]",
            "regions=[{\"name\": \"new\", \"box\": {\"from\": [0, 0], \"to\": [0.04, 0.1]}, \"action\": \
             {\"generate\": {\"rate\": 1, \"radii\": {\"uniform\": {\"min\": 0.01, \"max\": 0.051}}}}}]",
        ]),
        "regions[0].action.generate.radii",
    ),
    (
        "a gate before listed grains",
        "collision",
        Set(&[
            "walls=[{\"name\": \"gate\", \"shape\": {\"plane\": {\"point\": [0.15, 0], \"normal\": [-1, 0]}}, \
             \"material\": \"glass\", \"during\": \"preparation\"}]",
        ]),
        "walls[0].during",
    ),
    (
        "wall without a direction",
        "piping",
        Set(&[
            "walls=[{\"name\": \"w\", \"shape\": {\"plane\": {\"point\": [0, 0], \"normal\": [0, 0]}}, \"material\": \
             \"wall\"}]",
        ]),
        "walls[0].shape.plane.normal",
    ),
    (
        "box wall on a periodic face",
        "piping",
        Set(&["domain.periodic=[\"y\"]"]),
        "box_walls[1]",
    ),
    (
        "linear law with cohesion",
        "collision",
        Set(&[
            "contact.linear.pairs=[{\"materials\": [\"glass\", \"glass\"], \"cohesion\": {\"absolute\": 1}}]",
        ]),
        "contact.linear.pairs[0].cohesion",
    ),
    (
        "strength of a law without bonds",
        "collision",
        Set(&[
            "contact.linear.pairs=[{\"materials\": [\"glass\", \"glass\"], \"tensile_strength\": 1}]",
        ]),
        "contact.linear.pairs[0].tensile_strength",
    ),
    (
        "parts that are not the whole",
        "deposition",
        Set(&["grains.initial.deposition.grading.by_count[0].fraction=0.7"]),
        "grains.initial.deposition.grading.by_count",
    ),
    (
        "a class without a grain",
        "deposition",
        Set(&["grains.initial.deposition.number=2"]),
        "grains.initial.deposition.grading.by_count",
    ),
    (
        "coarse grains wider than the cloud",
        "deposition",
        Set(&["grains.initial.deposition.grading.by_count[1].max=0.01"]),
        "grains.initial.deposition.grading.by_count",
    ),
    (
        "more grains than the cloud holds",
        "deposition",
        Set(&["grains.initial.deposition.number=20000"]),
        "grains.initial.deposition.number",
    ),
    (
        "deposition without gravity",
        "deposition",
        Set(&["gravity=[0, 0, 0]"]),
        "gravity",
    ),
    (
        "a polygon that is not plane",
        "deposition",
        Set(&["walls[0].shape.polygon[2]=[0.005, 0.021, 0.06]"]),
        "walls[0].shape.polygon",
    ),
    (
        "a mesh that is not there",
        "deposition",
        Set(&["walls[0].shape={\"mesh\": {\"path\": \"no.stl\"}}"]),
        "walls[0].shape.mesh.path",
    ),
    (
        "a box without volume",
        "deposition",
        Set(&["walls[0].shape={\"box\": {\"from\": [0, 0, 0], \"to\": [0, 1, 1]}}"]),
        "walls[0].shape.box",
    ),
    (
        "facets in the plane",
        "collision",
        Set(&[
            "walls=[{\"name\": \"w\", \"shape\": {\"polygon\": [[0, 0], [1, 0], [1, 1]]}, \"material\": \"glass\"}]",
        ]),
        "walls[0].shape",
    ),
    (
        "coupling without fluid",
        "collision",
        Set(&["coupling={\"bounce_back\": {}}"]),
        "coupling",
    ),
    // Observation
    (
        "removal outside the domain",
        "piping",
        Set(&["regions[0].box.to=[0.0094, 0.004]"]),
        "regions[0].box",
    ),
    (
        "probe outside the domain",
        "cylinder",
        Set(&["probes[1].at.point.position=[3, 0.2]"]),
        "probes[1].at.point.position",
    ),
    (
        "probe of the water in a seepage",
        "seepage",
        Set(&[
            "probes=[{\"name\": \"cut\", \"every\": 1, \"at\": {\"plane\": {\"axis\": \"x\", \"position\": 0}}}]",
        ]),
        "probes[0].at",
    ),
    (
        "probe of a body in a case without bodies",
        "poiseuille",
        Set(&[r#"probes=[{"name": "p", "every": 1, "at": {"body": {"name": "rod"}}}]"#]),
        "probes[0].at.body.name",
    ),
    (
        "structure over the whole domain",
        "poiseuille",
        Set(&[
            r#"structures=[{"name": "all", "shape": {"box": {"from": [-9, -9], "to": [9, 9]}}}]"#,
        ]),
        "structures[0].shape",
    ),
    (
        "probe of an unknown body",
        "cylinder",
        Set(&["probes[0].at.body.name=cylindre"]),
        "probes[0].at.body.name",
    ),
    (
        "probe name twice",
        "cylinder",
        Set(&["probes[1].name=back"]),
        "probes[2].name",
    ),
    (
        "probe name with a slash",
        "cylinder",
        Set(&["probes[1].name=a/b"]),
        "probes[1].name",
    ),
    (
        "output of grains without grains",
        "couette",
        Set(&["output.grains={\"every\": 1}"]),
        "output.grains",
    ),
    (
        "samples without number",
        "couette",
        Set(&["probes[0].every=1e-12"]),
        "probes[0].every",
    ),
    (
        "eroded mass without removal",
        "piping",
        Set(&["regions=[]"]),
        "analysis.erosion_law.outlet",
    ),
    (
        "collapse without seepage points",
        "seepage",
        Set(&["analysis={\"ground_collapse\": {\"every\": 0.001}}"]),
        "analysis.ground_collapse.points",
    ),
    (
        "collapse into no region",
        "seepage",
        Set(&[
            "analysis={\"ground_collapse\": {\"every\": 0.001, \"points\": [{\"name\": \"left\"}]}}",
        ]),
        "analysis.ground_collapse.points[0].name",
    ),
    (
        "collapse into a point outside",
        "seepage",
        Set(&[
            "analysis={\"ground_collapse\": {\"every\": 0.001, \"points\": [{\"name\": \"p\", \"box\": {\"from\": [0, \
             0, 0.03], \"to\": [0.02, 0.02, 0.05]}}]}}",
        ]),
        "analysis.ground_collapse.points[0].box",
    ),
    (
        "collapse in 2-D",
        "piping",
        Set(&["analysis.ground_collapse={\"every\": 0.001}"]),
        "analysis.ground_collapse",
    ),
    (
        "collapse along oblique gravity",
        "seepage",
        Set(&[COLLAPSE, "gravity=[1, 0, -9.81]"]),
        "gravity",
    ),
    (
        "collapse along a vertical axis",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.long_axis=z"]),
        "analysis.ground_collapse.long_axis",
    ),
    (
        "cells of the collapse larger than the domain",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.cell_size=1"]),
        "analysis.ground_collapse.cell_size",
    ),
    (
        "cells of the collapse in other units",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.cell_size=1e-6"]),
        "analysis.ground_collapse.cell_size",
    ),
    (
        "void with all of its solid",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.void_below=1"]),
        "analysis.ground_collapse.void_below",
    ),
    (
        "extension without growth",
        "seepage",
        Set(&[
            COLLAPSE,
            "analysis.ground_collapse.stages.extension_ratio=1",
        ]),
        "analysis.ground_collapse.stages.extension_ratio",
    ),
    (
        "stage after no sample",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.stages.samples=0"]),
        "analysis.ground_collapse.stages.samples",
    ),
    (
        "misspelt stage",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.stages.hole_grain=3"]),
        "analysis.ground_collapse.stages.hole_grain",
    ),
    (
        "collapse never sampled",
        "seepage",
        Set(&[COLLAPSE, "analysis.ground_collapse.every=0"]),
        "analysis.ground_collapse.every",
    ),
    (
        "warm-up of a dry case",
        "collision",
        Set(&["time.warm_up={\"fluid_only\": {\"relative_change\": 1e-5, \"at_most\": 1}}"]),
        "time.warm_up",
    ),
    // Laboratory
    (
        "servo of a box",
        "triaxial",
        Set(&[
            "walls[0].shape={\"box\": {\"from\": [0.0085, 0, 0], \"to\": [0.009, 0.01, 0.01]}}",
            "probes=[]",
            "analysis={}",
        ]),
        "walls[0].servo",
    ),
    (
        "servo with a velocity across its plane",
        "triaxial",
        Set(&["walls[0].velocity=[0.1, 0.1, 0]"]),
        "walls[0].velocity",
    ),
    (
        "servo that pulls in its table",
        "triaxial",
        Set(&["walls[2].servo.history=[[0, 1e4], [0.001, -1]]"]),
        "walls[2].servo.history",
    ),
    (
        "servo whose times do not rise",
        "triaxial",
        Set(&["walls[2].servo.history=[[0.002, 1e4], [0.001, 1e4]]"]),
        "walls[2].servo.history",
    ),
    (
        "servo with a table of velocities",
        "triaxial",
        Set(&[
            "walls[0].history=[[0, 1], [1, 2]]",
            "walls[0].velocity=[0, 0.1, 0]",
        ]),
        "walls[0].history",
    ),
    (
        "body whose times do not rise",
        "rock-into-reservoir",
        Set(&["bodies[0].motion.driven.history=[[0, 1], [2, 1], [1, 0]]"]),
        "bodies[0].motion.driven.history",
    ),
    (
        "body with a factor beyond the numbers",
        "rock-into-reservoir",
        Set(&["bodies[0].motion.driven.history=[[0, 1], [2, 1e999]]"]),
        "bodies[0].motion.driven.history",
    ),
    (
        "table of a stationary body",
        "rock-into-reservoir",
        Set(&["bodies[0].motion.driven={\"history\": [[0, 1], [2, 1]]}"]),
        "bodies[0].motion.driven.history",
    ),
    (
        "servo that pulls",
        "triaxial",
        Set(&["walls[0].servo.stress=-1"]),
        "walls[0].servo.stress",
    ),
    (
        "servo without a limit",
        "triaxial",
        Remove("/walls/0/servo/velocity_limit"),
        "walls[0].servo.velocity_limit",
    ),
    (
        "servo with a gain above 1",
        "triaxial",
        Set(&["walls[0].servo.gain=1.5"]),
        "walls[0].servo.gain",
    ),
    (
        "servo on springs without a stiffness",
        "biaxial",
        Remove("/contact/linear/normal_stiffness"),
        "contact",
    ),
    (
        "servo without grains",
        "biaxial",
        Set(&["grains=null", "probes=[]", "analysis={}", "output={}"]),
        "fluid",
    ),
    (
        "load on an unknown wall",
        "triaxial",
        Set(&["probes[0].at.wall_load.name=ceiling"]),
        "probes[0].at.wall_load.name",
    ),
    (
        "element test of one plane",
        "biaxial",
        Set(&["analysis.element_test.axial=[\"top\", \"top\"]"]),
        "analysis.element_test.axial",
    ),
    (
        "element test with an unknown probe",
        "biaxial",
        Set(&["analysis.element_test.lateral=[\"lft\"]"]),
        "analysis.element_test.lateral[0]",
    ),
    (
        "element test without a lateral stress",
        "oedometer",
        Set(&["analysis.element_test.inside=null"]),
        "analysis.element_test.answers[2].quantity",
    ),
    (
        "element test without answers",
        "oedometer",
        Set(&["analysis.element_test.answers=[]"]),
        "analysis.element_test.answers",
    ),
    (
        "element test after the end",
        "oedometer",
        Set(&["analysis.element_test.from=1"]),
        "analysis.element_test.from",
    ),
    (
        "element test with samples at other times",
        "oedometer",
        Set(&["probes[1].every=2e-4"]),
        "probes[1].every",
    ),
    // Blocks
    (
        "blocks in the plane",
        "collision",
        Set(&["blocks={\"material\": \"steel\", \"initial\": {\"list\": []}}"]),
        "blocks",
    ),
    (
        "blocks of no material",
        "avalanche",
        Set(&["blocks.material=slate"]),
        "blocks.material",
    ),
    (
        "blocks without density",
        "avalanche",
        Set(&["materials.granite={}"]),
        "materials.granite.density",
    ),
    (
        "blocks from nowhere",
        "avalanche",
        Set(&["blocks.initial={\"file\": {\"path\": \"no.json\"}}"]),
        "blocks.initial.file.path",
    ),
    (
        "no block in the list",
        "avalanche",
        Set(&["blocks.initial={\"list\": []}"]),
        "blocks.initial.list",
    ),
    (
        "a sphere as a block",
        "avalanche",
        Set(&["blocks.initial={\"list\": [{\"shape\": {\"sphere\": {\"radius\": 1}}}]}"]),
        "blocks.initial.list[0].shape",
    ),
    (
        "a flat block",
        "avalanche",
        Set(&[
            "blocks.initial={\"list\": [{\"shape\": {\"vertices\": [[1,1,5],[2,1,5],[1,2,5],[2,2,5]]}}]}",
        ]),
        "blocks.initial.list[0].shape",
    ),
    (
        "an open block",
        "avalanche",
        Set(&[
            "blocks.initial={\"list\": [{\"shape\": {\"half_spaces\": [[1,0,0,1],[-1,0,0,0],[0,1,0,1],[0,-1,0,0]]}}]}",
        ]),
        "blocks.initial.list[0].shape",
    ),
    (
        "two blocks in one place",
        "avalanche",
        Set(&[
            "blocks.initial={\"list\": [{\"shape\": {\"cuboid\": {\"edges\": [1,1,1]}}, \"position\": [20,5,5]}, \
             {\"shape\": {\"cuboid\": {\"edges\": [1,1,1]}}, \"position\": [20.5,5.5,5]}]}",
        ]),
        "blocks.initial.list[1].position",
    ),
    (
        "a block in a wall",
        "avalanche",
        Set(&[
            "blocks.initial={\"list\": [{\"shape\": {\"cuboid\": {\"edges\": [1,1,1]}}, \"position\": [20,5,0.3]}]}",
        ]),
        "blocks.initial.list[0].position",
    ),
    (
        "blocks outside",
        "avalanche",
        Set(&[
            "blocks.initial={\"list\": [{\"shape\": {\"cuboid\": {\"edges\": [1,1,1]}}, \"position\": [40,5,5]}]}",
        ]),
        "blocks.initial",
    ),
    (
        "rock mass beyond the domain",
        "avalanche",
        Set(&["blocks.initial.joints.rock_mass.box.to=[100, 6, 14]"]),
        "blocks.initial.joints.rock_mass.box",
    ),
    (
        "nothing left of the rock",
        "avalanche",
        Set(&["blocks.initial.joints.excavation[1].point=[0, 0, 0]"]),
        "blocks.initial.joints.excavation",
    ),
    (
        "dip beyond the vertical",
        "avalanche",
        Set(&["blocks.initial.joints.sets[0].dip_degrees=91"]),
        "blocks.initial.joints.sets[0].dip_degrees",
    ),
    (
        "persistence above one",
        "avalanche",
        Set(&["blocks.initial.joints.sets[2].persistence=1.1"]),
        "blocks.initial.joints.sets[2].persistence",
    ),
    (
        "no spacing",
        "avalanche",
        Set(&["blocks.initial.joints.sets[0].spacing={\"constant\": 0}"]),
        "blocks.initial.joints.sets[0].spacing.constant",
    ),
    (
        "spacings the wrong way round",
        "avalanche",
        Set(&["blocks.initial.joints.sets[2].spacing={\"uniform\": {\"min\": 2, \"max\": 1}}"]),
        "blocks.initial.joints.sets[2].spacing.uniform",
    ),
    (
        "spacing that is mostly negative",
        "avalanche",
        Set(&["blocks.initial.joints.sets[1].spacing.normal.standard_deviation=2"]),
        "blocks.initial.joints.sets[1].spacing.normal.standard_deviation",
    ),
    (
        "more planes than anyone wants",
        "avalanche",
        Set(&["blocks.initial.joints.sets[0].spacing={\"exponential\": {\"mean\": 1e-6}}"]),
        "blocks.initial.joints.sets[0].spacing",
    ),
    (
        "more blocks than anyone wants",
        "avalanche",
        Set(&["blocks.initial.joints.sets[0].spacing={\"constant\": 0.001}"]),
        "blocks.initial.joints.sets",
    ),
    (
        "joints wider than blocks",
        "avalanche",
        Set(&["blocks.initial.joints.aperture=0.5"]),
        "blocks.initial.joints.aperture",
    ),
    (
        "bed rock outside",
        "avalanche",
        Set(&["blocks.fixed=[{\"from\": [0, 0, 0], \"to\": [99, 1, 1]}]"]),
        "blocks.fixed[0]",
    ),
    (
        "law of spheres for blocks",
        "avalanche",
        Set(&["contact={\"linear\": {\"normal_stiffness\": {\"absolute\": 1e6}}}"]),
        "contact",
    ),
    (
        "blocks without a law",
        "avalanche",
        Remove("/contact"),
        "contact",
    ),
    (
        "blocks without stiffness",
        "avalanche",
        Remove("/contact/blocks/normal_stiffness"),
        "contact.blocks.normal_stiffness",
    ),
    (
        "stiffness of no kind",
        "avalanche",
        Set(&["contact.blocks.normal_stiffness={\"per_volume\": 1}"]),
        "contact.blocks.normal_stiffness.per_volume",
    ),
    (
        "no rounding",
        "avalanche",
        Set(&["contact.blocks.model={\"point\": {\"rounding\": 0}}"]),
        "contact.blocks.model.point.rounding",
    ),
    (
        "a pair of blocks of an unknown material",
        "dry-incline",
        Set(&["contact.blocks.pairs[0].materials=[\"smooth\", \"ice\"]"]),
        "contact.blocks.pairs[0].materials[1]",
    ),
    (
        "law of blocks in the plane",
        "collision",
        Set(&["contact={\"blocks\": {\"normal_stiffness\": {\"per_area\": 1e9}}}"]),
        "contact.blocks",
    ),
    (
        "a turn about nothing",
        "dry-incline",
        Set(&["bodies[0].orientation.axis=[0, 0, 0]"]),
        "bodies[0].orientation.axis",
    ),
    (
        "a polyhedron in the plane",
        "collision",
        Set(&[
            "bodies=[{\"name\": \"b\", \"shape\": {\"vertices\": []}, \"position\": [0, 0], \"motion\": {\"fixed\": \
             {}}, \"material\": \"steel\"}]",
        ]),
        "bodies[0].shape",
    ),
    (
        "a polyhedron in a wall",
        "dry-incline",
        Set(&["bodies[0].position=[0.5, 0.5, 2.1]"]),
        "bodies[0].position",
    ),
    (
        "blocks drawn where there are none",
        "seepage",
        Set(&["output.blocks={\"every\": 0.001}"]),
        "output.blocks",
    ),
    // Set
    (
        "set through a number",
        "couette",
        Set(&["time.end.x=1"]),
        "time.end.x",
    ),
    (
        "set past the end of a list",
        "couette",
        Set(&["probes[9].every=1"]),
        "probes[9].every",
    ),
    // Elastic spheres
    (
        "elastic spheres without moduli",
        "seepage",
        Set(&["contact={\"hertz_mindlin\": {}}"]),
        "materials.sand.young_modulus",
    ),
    (
        "elastic walls without moduli",
        "seepage",
        Set(&[
            "contact={\"hertz_mindlin\": {}}",
            "materials.sand={\"density\": 2600, \"young_modulus\": 1e7, \"poisson_ratio\": 0.2}",
        ]),
        "materials.wall.poisson_ratio",
    ),
    (
        "elastic spheres in the plane",
        "collision",
        Set(&["contact={\"hertz_mindlin\": {}}"]),
        "contact.hertz_mindlin",
    ),
    (
        "Poisson's ratio above one half",
        "seepage",
        Set(&["materials.sand.poisson_ratio=0.6"]),
        "materials.sand.poisson_ratio",
    ),
    (
        "Young's modulus of nothing",
        "seepage",
        Set(&["materials.sand.young_modulus=0"]),
        "materials.sand.young_modulus",
    ),
    (
        "no restitution at all",
        "seepage",
        Set(&["contact={\"hertz_mindlin\": {\"restitution\": 0}}"]),
        "contact.hertz_mindlin.restitution",
    ),
    (
        "impact at no speed",
        "seepage",
        Set(&["contact={\"hertz_mindlin\": {\"impact_speed\": 0}}"]),
        "contact.hertz_mindlin.impact_speed",
    ),
    (
        "a spring in the elastic law",
        "seepage",
        Set(&["contact={\"hertz_mindlin\": {\"normal_stiffness\": {\"absolute\": 1}}}"]),
        "contact.hertz_mindlin.normal_stiffness",
    ),
    (
        "an elastic pair twice",
        "deposition",
        Set(&[
            ELASTIC,
            "contact={\"hertz_mindlin\": {\"pairs\": [{\"materials\": [\"soil\", \"soil\"]}, {\"materials\": \
             [\"soil\", \"soil\"]}]}}",
        ]),
        "contact.hertz_mindlin.pairs[1].materials",
    ),
    (
        "elastic bonds",
        "deposition",
        Set(&[ELASTIC, "contact={\"hertz_mindlin\": {}}"]),
        "grains.bond_at_start",
    ),
    (
        "bonds of a law that has none",
        "collision",
        Set(&["grains.bond_at_start=true"]),
        "grains.bond_at_start",
    ),
    (
        "elastic grains that fall softly",
        "deposition",
        Set(&[ELASTIC, "contact={\"hertz_mindlin\": {}}"]),
        "grains.initial.deposition.falling_stiffness",
    ),
    (
        "a step longer than Rayleigh's",
        "deposition",
        Set(&[
            ELASTIC,
            "contact={\"hertz_mindlin\": {}}",
            "grains.bond_at_start=false",
            "grains.initial.deposition.falling_stiffness=null",
            "time.solid_time_step=1e-3",
        ]),
        "time.solid_time_step",
    ),
    // Grading
    (
        "a class the wrong way round",
        "deposition",
        Set(&[
            "grains.initial.deposition.grading.by_count[0]={\"min\": 0.0012, \"max\": 0.001, \"fraction\": 0.8}",
        ]),
        "grains.initial.deposition.grading.by_count",
    ),
    (
        "a class of no size",
        "deposition",
        Set(&["grains.initial.deposition.grading.by_count[0].min=0"]),
        "grains.initial.deposition.grading.by_count[0].min",
    ),
    (
        "a negative part",
        "deposition",
        Set(&["grains.initial.deposition.grading.by_count[0].fraction=-0.8"]),
        "grains.initial.deposition.grading.by_count[0].fraction",
    ),
    (
        "a grading of no class",
        "deposition",
        Set(&["grains.initial.deposition.grading.by_count=[]"]),
        "grains.initial.deposition.grading.by_count",
    ),
    (
        "a cloud outside the domain",
        "deposition",
        Set(&["grains.initial.deposition.box.from=[-0.004, 0, 0.022]"]),
        "grains.initial.deposition.box",
    ),
    // Seepage
    (
        "seepage without viscosity",
        "seepage",
        Set(&["fluid.darcy.viscosity=0"]),
        "fluid.darcy.viscosity",
    ),
    (
        "structure as large as the ground",
        "earth-dam",
        Set(&[
            "structures=[{\"name\": \"all\", \"shape\": {\"box\": {\"from\": [0, 0], \"to\": [10, 10]}}}]",
        ]),
        "structures",
    ),
    (
        "part of an uplift outside the ground",
        "earth-dam",
        Set(&[
            "probes[0].at={\"uplift\": {\"axis\": \"y\", \"position\": 0}}",
            "probes[0].at.uplift.part={\"from\": [1e3, 0], \"to\": [2e3, 1]}",
        ]),
        "probes[0].at.uplift.part",
    ),
    (
        "section across z in two dimensions",
        "earth-dam",
        Set(&["probes[0].at={\"section\": {\"axis\": \"z\", \"position\": 1}}"]),
        "probes[0].at.section.axis",
    ),
    (
        "seepage without outlet",
        "seepage",
        Set(&["fluid.darcy.boundaries=[]"]),
        "fluid.darcy.boundaries",
    ),
    (
        "seepage point outside the grid",
        "seepage",
        Set(&[
            "fluid.darcy.boundaries[1].patch.from=[0.03, 0.03, 0]",
            "fluid.darcy.boundaries[1].patch.to=[0.04, 0.04, 0]",
        ]),
        "fluid.darcy.boundaries[1].patch",
    ),
    (
        "seepage cell smaller than a grain",
        "seepage",
        Set(&["fluid.darcy.grid.cells=[10, 10, 20]"]),
        "fluid.darcy.grid.cells",
    ),
    (
        "seepage grid without extent",
        "seepage",
        Set(&["fluid.darcy.grid.to=[0.02, 0, 0.04]"]),
        "fluid.darcy.grid",
    ),
    (
        "head without gravity",
        "seepage",
        Remove("/gravity"),
        "fluid.darcy.boundaries[0].condition",
    ),
    (
        "a zone of nothing",
        "seepage",
        Set(&["fluid.darcy.zones=[{\"name\": \"a\"}]"]),
        "fluid.darcy.zones[0]",
    ),
    (
        "a zone outside the domain",
        "seepage",
        Set(&[
            "fluid.darcy.zones=[{\"name\": \"a\", \"porosity\": 0.4, \"region\": {\"layer\": {\"from\": 1}}}]",
        ]),
        "fluid.darcy.zones[0].region.layer",
    ),
    (
        "a layer without thickness",
        "seepage",
        Set(&[
            "fluid.darcy.zones=[{\"name\": \"a\", \"porosity\": 0.4, \"region\": {\"layer\": {\"from\": 0.02, \"to\": \
             0.01}}}]",
        ]),
        "fluid.darcy.zones[0].region.layer",
    ),
    (
        "a zone of negative permeability",
        "seepage",
        Set(&["fluid.darcy.zones=[{\"name\": \"a\", \"permeability\": {\"value\": -1e-12}}]"]),
        "fluid.darcy.zones[0].permeability.value",
    ),
    (
        "a zone full of pores",
        "seepage",
        Set(&["fluid.darcy.zones=[{\"name\": \"a\", \"porosity\": 1}]"]),
        "fluid.darcy.zones[0].porosity",
    ),
    (
        "two zones of one name",
        "seepage",
        Set(&[
            "fluid.darcy.zones=[{\"name\": \"a\", \"porosity\": 0.4}, {\"name\": \"a\", \"porosity\": 0.3}]",
        ]),
        "fluid.darcy.zones[1].name",
    ),
    (
        "a raster that is not there",
        "seepage",
        Set(&["fluid.darcy.zones=[{\"name\": \"a\", \"raster\": {\"path\": \"none.csv\"}}]"]),
        "fluid.darcy.zones[0].raster.path",
    ),
    (
        "a zone by a law without its equations",
        "seepage",
        Set(&[
            "fluid.darcy.equations=paper",
            "fluid.darcy.zones=[{\"name\": \"a\", \"permeability\": {\"resistance\": \"ergun\"}}]",
        ]),
        "fluid.darcy.zones[0].permeability.resistance",
    ),
    (
        "a sieve curve in per cent",
        "deposition",
        Set(&[
            "grains.initial.deposition.grading={\"sieve\": [{\"diameter\": 0.002, \"passing\": 0}, {\"diameter\": \
             0.003, \"passing\": 100}]}",
        ]),
        "grains.initial.deposition.grading.sieve[1].passing",
    ),
    (
        "a sieve curve that ends too early",
        "deposition",
        Set(&[
            "grains.initial.deposition.grading={\"sieve\": [{\"diameter\": 0.002, \"passing\": 0}, {\"diameter\": \
             0.003, \"passing\": 0.9}]}",
        ]),
        "grains.initial.deposition.grading.sieve",
    ),
    (
        "a sieve curve that falls",
        "deposition",
        Set(&[
            "grains.initial.deposition.grading={\"sieve\": [{\"diameter\": 0.002, \"passing\": 0}, {\"diameter\": \
             0.0025, \"passing\": 0.8}, {\"diameter\": 0.0026, \"passing\": 0.7}, {\"diameter\": 0.003, \"passing\": \
             1}]}",
        ]),
        "grains.initial.deposition.grading.sieve",
    ),
    (
        "a layer denser than a cloud",
        "deposition",
        Set(&[
            "grains.initial.deposition.layers=[{\"name\": \"a\", \"number\": 9000, \"grading\": {\"by_count\": \
             [{\"min\": 0.001, \"max\": 0.001, \"fraction\": 1}]}, \"box\": {\"from\": [0, 0, 0.05], \"to\": [0.024, \
             0.02, 0.06]}}]",
        ]),
        "grains.initial.deposition.layers[0].number",
    ),
    (
        "a layer of an unknown material",
        "deposition",
        Set(&[
            "grains.initial.deposition.layers=[{\"name\": \"a\", \"material\": \"mud\", \"number\": 9, \"grading\": \
             {\"by_count\": [{\"min\": 0.001, \"max\": 0.001, \"fraction\": 1}]}, \"box\": {\"from\": [0, 0, 0.05], \
             \"to\": [0.024, 0.02, 0.06]}}]",
        ]),
        "grains.initial.deposition.layers[0].material",
    ),
    (
        "a zone of grains without a place",
        "deposition",
        Set(&["grains.zones=[{\"name\": \"a\", \"material\": \"soil\"}]"]),
        "grains.zones[0]",
    ),
    (
        "a zone of grains of an unknown material",
        "deposition",
        Set(&[
            "grains.zones=[{\"name\": \"a\", \"material\": \"mud\", \"region\": {\"layer\": {\"to\": 0.01}}}]",
        ]),
        "grains.zones[0].material",
    ),
    (
        "a zone of grains outside the domain",
        "deposition",
        Set(&[
            "grains.zones=[{\"name\": \"a\", \"material\": \"soil\", \"shape\": {\"sphere\": {\"centre\": [1, 1, 1], \
             \"radius\": 0.1}}}]",
        ]),
        "grains.zones[0].shape",
    ),
    (
        "a wall that is gone before it goes",
        "deposition",
        Set(&["walls[2].until=0.01"]),
        "walls[2].until",
    ),
    (
        "a wall that goes before it comes",
        "deposition",
        Set(&["walls[0].from=0.01", "walls[0].until=0.005"]),
        "walls[0].until",
    ),
    (
        "a wall until the start",
        "deposition",
        Set(&["walls[0].until=0"]),
        "walls[0].until",
    ),
    (
        "seepage with bounce-back",
        "seepage",
        Set(&["coupling={\"bounce_back\": {}}"]),
        "coupling",
    ),
    (
        "seepage in a periodic domain",
        "seepage",
        Set(&["domain.periodic=[\"x\"]", "box_walls=[\"z_min\"]"]),
        "domain.periodic",
    ),
    (
        "porosity limits crossed",
        "seepage",
        Set(&[
            "fluid.darcy.least_porosity=0.8",
            "fluid.darcy.porosity_cap=0.7",
        ]),
        "fluid.darcy.least_porosity",
    ),
    (
        "seepage of water without mass",
        "seepage",
        Set(&["fluid.darcy.density=0"]),
        "fluid.darcy.density",
    ),
    (
        "seepage that flows nowhere",
        "seepage",
        Set(&[
            "fluid.darcy.boundaries=[{\"name\": \"a\", \"face\": \"z_max\", \"condition\": {\"no_flow\": {}}}]",
        ]),
        "fluid.darcy.boundaries",
    ),
    (
        "seepage driven in without an outlet",
        "seepage",
        Set(&[
            "fluid.darcy.boundaries=[{\"name\": \"a\", \"face\": \"z_max\", \"condition\": {\"flux\": {\"value\": \
             1e-4}}}]",
        ]),
        "fluid.darcy.boundaries",
    ),
    (
        "seepage point behind the walls",
        "seepage",
        Set(&[
            "fluid.darcy.enclosure={\"planes\": [{\"point\": [0, 0, 0.005], \"normal\": [0, 0, 1]}]}",
        ]),
        "fluid.darcy.boundaries[1].patch",
    ),
    (
        "walls round no water",
        "seepage",
        Set(&[
            "fluid.darcy.enclosure={\"planes\": [{\"point\": [0, 0, 0.5], \"normal\": [0, 0, 1]}]}",
        ]),
        "fluid.darcy.boundaries[0].face",
    ),
    (
        "a plane round the water without direction",
        "seepage",
        Set(&[
            "fluid.darcy.enclosure={\"planes\": [{\"point\": [0, 0, 0], \"normal\": [0, 0, 0]}]}",
        ]),
        "fluid.darcy.enclosure.planes[0].normal",
    ),
    (
        "seepage grid outside the domain",
        "seepage",
        Set(&["fluid.darcy.grid.to=[0.02, 0.02, 0.4]"]),
        "fluid.darcy.grid",
    ),
    (
        "seepage boundary named twice",
        "seepage",
        Set(&["fluid.darcy.boundaries[1].name=rain"]),
        "fluid.darcy.boundaries[1].name",
    ),
    (
        "rain that falls up",
        "seepage",
        Set(&["fluid.darcy.boundaries[0].condition={\"rain\": {\"rate\": -1}}"]),
        "fluid.darcy.boundaries[0].condition.rain.rate",
    ),
    (
        "Ergun's resistance in the equations as printed",
        "seepage",
        Set(&[
            "fluid.darcy.resistance=ergun",
            "fluid.darcy.equations=paper",
        ]),
        "fluid.darcy.resistance",
    ),
    (
        "bonds that hold across grains",
        "deposition",
        Set(&["contact.contact_bond.tensile_strength=1e6"]),
        "contact.contact_bond.tensile_strength",
    ),
    (
        "a coupling that never comes",
        "seepage",
        Set(&["fluid.darcy.coupling_interval=0"]),
        "fluid.darcy.coupling_interval",
    ),
    (
        "a pressure without error",
        "seepage",
        Set(&["fluid.darcy.tolerance=0"]),
        "fluid.darcy.tolerance",
    ),
    (
        "a grain in another",
        "seepage",
        Set(&["grains.initial.list[1].position=[0.001224, 0.001254, 0.00125]"]),
        "grains.initial.list[1].position",
    ),
    (
        "a grain in the wall of the column",
        "seepage",
        Set(&["grains.initial.list[0].position=[0.0002, 0.001254, 0.00125]"]),
        "grains.initial.list[0].position",
    ),
    (
        "a grain outside the column",
        "seepage",
        Set(&["grains.initial.list[0].position=[-0.01, 0.001254, 0.00125]"]),
        "grains.initial.list[0].position",
    ),
    (
        "seepage with two intervals",
        "seepage",
        Set(&["time.solid_steps_per_fluid_step=10"]),
        "time.solid_steps_per_fluid_step",
    ),
];

pub(crate) fn expected(path: &str) -> String {
    if path.starts_with('.') {
        format!("{LB}{path}")
    } else {
        path.to_string()
    }
}

/// Returns the text of the broken case and its `--set` assignments.
pub(crate) fn broken(example: &str, how: &Break) -> (String, Vec<String>) {
    let text = find(example).expect("an example").text;
    match how {
        Set(set) => (text.into(), set.iter().map(|s| (*s).to_string()).collect()),
        Text(from, to) => {
            assert!(text.contains(from), "{example} holds {from}");
            (text.replacen(from, to, 1), vec![])
        }
        Remove(pointer) => {
            let mut tree: Value = serde_json::from_str(text).unwrap();
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            let parent = tree
                .pointer_mut(parent)
                .and_then(Value::as_object_mut)
                .unwrap();
            assert!(parent.remove(key).is_some(), "{pointer}");
            (tree.to_string(), vec![])
        }
    }
}

fn judge(text: &str, set: &[String]) -> Vec<Problem> {
    match Document::read(text, set, Path::new("")).and_then(Plan::prepare) {
        Ok(plan) => plan.warnings,
        Err(problems) => problems,
    }
}

#[test]
fn broken_cases_are_refused_by_the_library() {
    assert!(TABLE.len() >= 60);
    let mut failures = Vec::new();
    for (name, example, how, path) in TABLE {
        let (text, set) = broken(example, how);
        let start = Instant::now();
        let problems = judge(&text, &set);
        let taken = start.elapsed();
        let path = expected(path);
        // A list of what there is has at least one entry.
        let empty = problems.iter().find(|p| p.remedy.trim_end().ends_with(':'));
        failures.extend(empty.map(|p| format!("{name}: an empty list: {p}")));
        let found = problems.iter().any(|p| {
            let here = p.path == path || (path.starts_with("line") && p.path.starts_with("line"));
            p.severity == Severity::Error && here && !p.reason.is_empty() && !p.remedy.is_empty()
        });
        if !found || taken > hang(0.1) {
            failures.push(format!(
                "{name}: wanted {path}, got {problems:#?} in {taken:?}"
            ));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Changes with several invalid fields, each of which must be named.
const SEVERAL_SLIPS: [&str; 11] = [
    "box wall on a periodic face",
    "elastic spheres without moduli",
    "elastic walls without moduli",
    "no restitution at all",
    "impact at no speed",
    "a spring in the elastic law",
    "an elastic pair twice",
    "elastic bonds",
    "elastic grains that fall softly",
    "head without gravity",
    "walls round no water",
];

/// Checks that a slip has one finding: checks that depend on a wrong field are silent.
#[test]
fn one_slip_has_one_finding() {
    let mut failures = Vec::new();
    for (name, example, how, path) in TABLE {
        let (text, set) = broken(example, how);
        if SEVERAL_SLIPS.contains(name) {
            continue;
        }
        let path = expected(path);
        let others = judge(&text, &set).into_iter().filter(|p| {
            let here = p.path == path || (path.starts_with("line") && p.path.starts_with("line"));
            !here && p.severity == Severity::Error
        });
        failures.extend(others.map(|p| format!("{name} ({path}): {p}")));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

/// Checks that an unreadable file, mesh or sample is the only finding, even if the spacing is automatic.
#[test]
fn files_that_cannot_be_read_are_the_only_finding() {
    let only = |case: &Value, path: &str| {
        let problems = judge(&case.to_string(), &[]);
        let paths: Vec<&str> = problems.iter().map(|p| p.path.as_str()).collect();
        assert_eq!(paths, [path], "{problems:#?}");
    };
    let mut dry = serde_json::json!({
        "domain": {"size": [0.1, 0.1, 0.1], "spacing": 0.005},
        "gravity": [0, 0, -9.81],
        "materials": {"glass": {"density": 2500}},
        "walls": [{"name": "floor", "material": "glass", "shape": {"mesh": {"path": "missing.stl"}}}],
        "grains": {"material": "glass", "initial": {"list": [{"position": [0.05, 0.05, 0.035], "radius": 0.01}]}},
        "contact": {"linear": {"friction_angle_degrees": 20, "normal_stiffness": {"absolute": 20000.0}}},
        "time": {"end": 0.3}
    });
    only(&dry, "walls[0].shape.mesh.path");
    dry["walls"] = serde_json::json!([]);
    dry["box_walls"] = serde_json::json!(["z_min"]);
    dry["grains"]["initial"] = serde_json::json!({"file": {"path": "missing.csv"}});
    only(&dry, "grains.initial.file.path");
    dry["domain"].as_object_mut().unwrap().remove("spacing");
    only(&dry, "grains.initial.file.path");
    dry["grains"]["initial"] =
        serde_json::json!({"list": [{"position": [0.05, 0.05, 0.035], "radius": -0.01}]});
    only(&dry, "grains.initial.list[0].radius");
    let wet = serde_json::json!({
        "domain": {"size": [0.04, 0.02, 0.02], "spacing": 0.001, "periodic": ["x", "y"]},
        "fluid": {"lattice_boltzmann": {"density": 1000, "kinematic_viscosity": 1e-5, "relaxation_time": 0.8,
            "body_force": {"constant": [5, 0, 0]}}},
        "structures": [{"name": "sill", "shape": {"surface": {"mesh": {"path": "missing.stl"}}}}],
        "probes": [{"name": "force", "every": 0.1, "at": {"structure": {"name": "sill"}}}],
        "time": {"end": 0.3}
    });
    only(&wet, "structures[0].shape.surface.mesh.path");
}

/// Checks that names of unavailable features lead to their alternative, not to a similar name.
#[test]
fn absent_features_are_named_as_such() {
    for (example, set, reason) in [
        (
            "couette",
            "fluid.lattice_boltzmann.bubbles={}",
            "gas and bubbles",
        ),
        (
            "collision",
            "grains={\"material\": \"m\", \"clumps\": [], \"initial\": {\"list\": []}}",
            "clumps",
        ),
    ] {
        let problems = judge(find(example).unwrap().text, &[set.into()]);
        let told = problems.iter().any(|p| {
            p.reason.contains("this program does not compute") && p.reason.contains(reason)
        });
        assert!(told, "{set}: {problems:#?}");
    }
}

/// Checks that features under other names lead to the field that provides them.
#[test]
fn features_under_other_names_lead_to_their_field() {
    let surface = "fluid.lattice_boltzmann.surface";
    for (example, set, field) in [
        (
            "couette",
            "fluid.lattice_boltzmann.free_surface={}",
            surface,
        ),
        (
            "couette",
            "fluid.lattice_boltzmann.boundaries[0].condition={\"free_surface\": {}}",
            surface,
        ),
        (
            "couette",
            "fluid.lattice_boltzmann.boundaries[0].condition=\"free_surface\"",
            surface,
        ),
        (
            "couette",
            "fluid.lattice_boltzmann.surface_tension=0.07",
            "fluid.lattice_boltzmann.surface.surface_tension",
        ),
        (
            "seepage",
            "fluid.darcy.richards={}",
            "fluid.darcy.unsaturated",
        ),
    ] {
        let problems = judge(find(example).unwrap().text, &[set.into()]);
        let remedy = format!("use `{field}`");
        let said = problems.iter().any(|p| p.to_string().contains(&remedy));
        assert!(said, "{set}: {problems:#?}");
    }
}

/// Checks that numbers beyond any physical magnitude are refused with their path.
#[test]
fn numbers_without_size_are_refused_by_their_path() {
    for (example, path) in [
        ("settling-disc", "materials.disc.density"),
        ("settling-disc", "fluid.lattice_boltzmann.density"),
        (
            "settling-disc",
            "fluid.lattice_boltzmann.kinematic_viscosity",
        ),
        ("collision", "grains.initial.list[0].radius"),
    ] {
        let problems = judge(find(example).unwrap().text, &[format!("{path}=1e-300")]);
        let paths: Vec<&str> = problems.iter().map(|p| p.path.as_str()).collect();
        assert_eq!(paths, [path], "{problems:#?}");
    }
    let light = [
        "materials.disc.density=1e-20",
        "coupling={\"partially_saturated\": {}}",
    ];
    for problem in judge(
        find("settling-disc").unwrap().text,
        &light.map(String::from),
    ) {
        assert!(problem.to_string().len() < 600, "{problem}");
    }
}

#[test]
fn broken_cases_are_refused_by_the_binary() {
    let _beside = beside_others();
    let (first, second) = TABLE.split_at(TABLE.len() / 2);
    std::thread::scope(|scope| {
        for part in [first, second] {
            scope.spawn(|| are_refused(part));
        }
    });
}

/// Checks that every third of these cases is refused, by two commands in turn. The commands print what the library
/// says, which is checked for all of them.
fn are_refused(cases: &[(&str, &str, Break, &str)]) {
    let _cores = Cores::acquire(1);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("case.json");
    let commands = ["validate", "run"].iter().cycle();
    for ((name, example, how, path), command) in cases.iter().step_by(3).zip(commands) {
        let (text, set) = broken(example, how);
        std::fs::write(&file, text).unwrap();
        let start = Instant::now();
        let output = Command::cargo_bin("solver")
            .unwrap()
            .arg(command)
            .arg(&file)
            .args(set.iter().flat_map(|s| ["--set", s]))
            .env_remove("OMPI_COMM_WORLD_RANK")
            .env_remove("SLURM_PROCID")
            .output()
            .unwrap();
        let taken = start.elapsed();
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{name}: {message}");
        assert!(taken < hang(0.1), "{name}: {taken:?}");
        let path = expected(path);
        let path = if path.starts_with("line") {
            "line"
        } else {
            &path
        };
        let named = message
            .lines()
            .any(|line| line.starts_with(&format!("error: {path} ")));
        assert!(named, "{name}: no line names {path} in\n{message}");
        assert!(!message.contains("panicked"), "{name}: {message}");
    }
}

#[test]
fn one_wrong_grain_among_many_is_named() {
    let grain = |n: u32| {
        let at = |k: u32| 0.0006 + 0.0011 * f64::from(k);
        serde_json::json!({"position": [at(n % 100), at(n / 100)], "radius": 5e-4})
    };
    let mut grains: Vec<Value> = (0..10_000).map(grain).collect();
    let case = |grains: &[Value]| {
        serde_json::json!({
            "domain": {"size": [0.2, 0.2], "spacing": 0.01},
            "materials": {"glass": {"density": 2500}},
            "contact": {"linear": {"normal_stiffness": {"absolute": 1e4}, "friction_angle_degrees": 30}},
            "grains": {"material": "glass", "initial": {"list": grains}},
            "time": {"end": 0.001}
        })
        .to_string()
    };
    assert_eq!(judge(&case(&grains), &[]), []);
    for (n, field, value) in [
        (4711, "radius", serde_json::json!(-1)),
        (4712, "colour", serde_json::json!("red")),
        (4713, "position", serde_json::json!([0.1, "a"])),
    ] {
        grains[n][field] = value;
    }
    let problems = judge(&case(&grains), &[]);
    let paths: Vec<&str> = problems.iter().map(|p| p.path.as_str()).collect();
    let list = "grains.initial.list";
    assert_eq!(
        paths,
        [
            format!("{list}[4711].radius"),
            format!("{list}[4712].colour"),
            format!("{list}[4713].position[1]"),
        ]
    );
    // Faults of the whole case are named too.
    let mut grains: Vec<Value> = (0..10_000).map(grain).collect();
    grains[77]["position"] = grains[78]["position"].clone();
    let problems = judge(&case(&grains), &[]);
    assert_eq!(problems.len(), 1);
    assert_eq!(problems[0].path, format!("{list}[78].position"));
}

#[test]
fn a_run_made_shorter_than_an_interval_is_only_warned_of() {
    let text = find("piping").unwrap().text;
    let set = ["time.end=0.0015", "checkpoint.every=0.1"].map(String::from);
    let plan = Document::read(text, &set, Path::new(""))
        .and_then(Plan::prepare)
        .unwrap();
    for path in [
        "output.fluid.every",
        "output.grains.every",
        "output.contacts.every",
        "probes[0].every",
        "checkpoint.every",
        "analysis.erosion_law.every",
    ] {
        let problem = plan.warnings.iter().find(|p| p.path == path);
        let problem = problem.unwrap_or_else(|| panic!("{path} in {:#?}", plan.warnings));
        assert_eq!(problem.severity, Severity::Warning);
        assert!(
            problem.reason.contains("the run ends at 0.0015 s"),
            "{problem}"
        );
    }
}

#[test]
fn all_problems_come_at_once() {
    let text = find("piping").unwrap().text;
    let set = [
        "domain.spcing=1",
        "fluid.lattice_boltzmann.density=-1",
        "fluid.lattice_boltzmann.relaxation_time=0.4",
        "grains.cut[0].box.to=[1, 1]",
        "probes[0].at.plane.position=7",
    ];
    let problems = judge(text, &set.map(String::from));
    for path in [
        "domain.spcing",
        "fluid.lattice_boltzmann.density",
        "fluid.lattice_boltzmann.relaxation_time",
        "grains.cut[0].box",
        "probes[0].at.plane.position",
    ] {
        assert!(
            problems.iter().any(|p| p.path == path),
            "{path} in {problems:#?}"
        );
    }
}

#[test]
fn an_unknown_field_is_answered_with_the_nearest_name() {
    let text = find("couette").unwrap().text;
    let problems = judge(
        text,
        &["fluid.lattice_boltzmann.kinematic_viscosty=1".into()],
    );
    assert_eq!(problems.len(), 1);
    assert!(
        problems[0].remedy.contains("`kinematic_viscosity`"),
        "{}",
        problems[0]
    );
}
