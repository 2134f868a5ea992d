//! Example cases: each runs in under a minute on two ranks. `solver example` lists them.

/// Example case of the program.
#[derive(Clone, Copy, Debug)]
pub struct Example {
    /// Name of the example.
    pub name: &'static str,
    /// Description in one line.
    pub summary: &'static str,
    /// Text of the case file.
    pub text: &'static str,
}

/// All example cases, in the order of the list.
pub const EXAMPLES: [Example; 41] = [
    Example {
        name: "piping",
        summary: "hole-erosion test: a bonded packing of discs with a hole, whose faces erode under a pressure drop",
        text: include_str!("examples/piping.json"),
    },
    Example {
        name: "first-flow",
        summary: "oil flow past a wire, in SI units: the program chooses cells, time step and models",
        text: include_str!("examples/first-flow.json"),
    },
    Example {
        name: "poiseuille",
        summary: "flow between two walls driven by a body force",
        text: include_str!("examples/poiseuille.json"),
    },
    Example {
        name: "couette",
        summary: "flow between a wall at rest and a sliding one",
        text: include_str!("examples/couette.json"),
    },
    Example {
        name: "taylor-green",
        summary: "decaying vortices in a periodic box, with an exact solution",
        text: include_str!("examples/taylor-green.json"),
    },
    Example {
        name: "cavity",
        summary: "lid-driven cavity at Reynolds number 100",
        text: include_str!("examples/cavity.json"),
    },
    Example {
        name: "cylinder",
        summary: "steady flow round a cylinder in a channel, Reynolds number 20 (DFG 2D-1)",
        text: include_str!("examples/cylinder.json"),
    },
    Example {
        name: "settling-disc",
        summary: "a disc settles in a closed channel",
        text: include_str!("examples/settling-disc.json"),
    },
    Example {
        name: "collision",
        summary: "two dry discs collide and rebound",
        text: include_str!("examples/collision.json"),
    },
    Example {
        name: "seepage",
        summary: "water seeps through a pile of spheres to an opening in the floor",
        text: include_str!("examples/seepage.json"),
    },
    Example {
        name: "sheet-pile",
        summary: "seepage under a sheet pile, with the solution by conformal mapping (Harr 1962)",
        text: include_str!("examples/sheet-pile.json"),
    },
    Example {
        name: "backward-erosion",
        summary: "a pipe below a dike on sand: its head for each length, and the rule of Sellmeijer et al. (2011)",
        text: include_str!("examples/backward-erosion.json"),
    },
    Example {
        name: "cut-off",
        summary: "a cut-off wall under a dam on layered ground, with the exact solution for its equivalent \
            permeability (Harr 1962)",
        text: include_str!("examples/cut-off.json"),
    },
    Example {
        name: "earth-dam",
        summary: "a dam with a phreatic surface and a seepage face, compared with the exact discharge (Charny 1951)",
        text: include_str!("examples/earth-dam.json"),
    },
    Example {
        name: "infiltration",
        summary: "water enters a dry column of soil, compared with Celia, Bouloutas and Zarba (1990)",
        text: include_str!("examples/infiltration.json"),
    },
    Example {
        name: "drawdown",
        summary: "a level falls in front of an aquifer: water that leaves, and the equation of Boussinesq",
        text: include_str!("examples/drawdown.json"),
    },
    Example {
        name: "filter",
        summary: "sand on a layer of gravel under seepage, with Terzaghi's criterion for a filter",
        text: include_str!("examples/filter.json"),
    },
    Example {
        name: "weir",
        summary: "a stream over a weir in a bed of discs: force on the weir, bedload and scour",
        text: include_str!("examples/weir.json"),
    },
    Example {
        name: "deposition",
        summary: "spheres are deposited between two inclined walls and bonded, then the floor is removed",
        text: include_str!("examples/deposition.json"),
    },
    Example {
        name: "fissure-sand",
        summary: "sand washed out of a hidden fissure through two seepage points until the ground collapses",
        text: include_str!("examples/fissure-sand.json"),
    },
    Example {
        name: "fissure-clay",
        summary: "the same with contact bonds: clay comes loose in blocks",
        text: include_str!("examples/fissure-clay.json"),
    },
    Example {
        name: "dry-incline",
        summary: "two blocks on an incline: one sticks, one slides with the exact acceleration",
        text: include_str!("examples/dry-incline.json"),
    },
    Example {
        name: "oedometer",
        summary: "spheres in a regular array under a servo wall, with the strain and the lateral stress of Hertz",
        text: include_str!("examples/oedometer.json"),
    },
    Example {
        name: "triaxial",
        summary: "spheres in a regular array between servo walls up to failure, with the strength of Rowe (1962)",
        text: include_str!("examples/triaxial.json"),
    },
    Example {
        name: "biaxial",
        summary: "discs in hexagonal rows between servo walls up to failure, compared with the strength of Rowe (1962)",
        text: include_str!("examples/biaxial.json"),
    },
    Example {
        name: "direct-shear",
        summary: "two rows of discs sheared between rough plates under a servo wall, with their strength by hand",
        text: include_str!("examples/direct-shear.json"),
    },
    Example {
        name: "unconfined-compression",
        summary: "a column of bonded discs is crushed between plates, compared with its strength by hand",
        text: include_str!("examples/unconfined-compression.json"),
    },
    Example {
        name: "flume",
        summary: "a bed of discs under a laminar stream: shear stress, Shields number and bedload",
        text: include_str!("examples/flume.json"),
    },
    Example {
        name: "scour",
        summary: "blocks of a jointed bed under a turbulent stream: one protrudes, one is flush",
        text: include_str!("examples/scour.json"),
    },
    Example {
        name: "stagnation",
        summary: "a stream over an open joint with a raised downstream side: stagnation point, eddy and uplift",
        text: include_str!("examples/stagnation.json"),
    },
    Example {
        name: "joint-pulse",
        summary: "a pressure pulsates in front of a closed joint at its resonance, with the exact amplification",
        text: include_str!("examples/joint-pulse.json"),
    },
    Example {
        name: "plucked-block",
        summary: "pressure in the joints round a flush block, which lifts it out of its bed",
        text: include_str!("examples/plucked-block.json"),
    },
    Example {
        name: "incline",
        summary: "two blocks on an incline under a stream that carries both away",
        text: include_str!("examples/incline.json"),
    },
    Example {
        name: "avalanche",
        summary: "a jointed rock mass slides down a slope",
        text: include_str!("examples/avalanche.json"),
    },
    Example {
        name: "dam-break",
        summary: "a column of water collapses over a dry floor, compared with Martin and Moyce (1952)",
        text: include_str!("examples/dam-break.json"),
    },
    Example {
        name: "standing-wave",
        summary: "a standing wave on deep water, with its frequency and decay by linear theory",
        text: include_str!("examples/standing-wave.json"),
    },
    Example {
        name: "broad-crested-weir",
        summary: "water over a broad-crested weir, compared with measured discharges (Bos 1989)",
        text: include_str!("examples/broad-crested-weir.json"),
    },
    Example {
        name: "chute",
        summary: "a supercritical stream over blocks, one of which protrudes, with forces that carry its weight",
        text: include_str!("examples/chute.json"),
    },
    Example {
        name: "rock-into-reservoir",
        summary: "a rock slide pushes a bore into a reservoir, with its height by shallow-water theory",
        text: include_str!("examples/rock-into-reservoir.json"),
    },
    Example {
        name: "floating-log",
        summary: "a log heaves in water, compared with the theory of a half-immersed cylinder (Ursell 1949)",
        text: include_str!("examples/floating-log.json"),
    },
    Example {
        name: "rain-fissure",
        summary: "stones fall from ledges of a fissure as a front of rain descends and weakens their bonds",
        text: include_str!("examples/rain-fissure.json"),
    },
];

/// An example study: members of a case for `solver sweep`.
pub const STUDY: Example = Example {
    name: "sweep",
    summary: "study of a channel flow: error against cost over cells, operator and relaxation time",
    text: include_str!("examples/sweep.json"),
};

/// An example search for `solver threshold`.
pub const SEARCH: Example = Example {
    name: "threshold",
    summary: "search for the slope on which a block begins to slide: the tangent of its friction angle",
    text: include_str!("examples/threshold.json"),
};

/// Returns the example of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Example> {
    EXAMPLES.iter().find(|example| example.name == name)
}
