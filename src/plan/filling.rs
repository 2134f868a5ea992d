//! Basins that are filled to the lid: by openings that let in more water than leaves, or from the start up to a small
//! part of a cell.
//!
//! An interface cell of the last row below a lid has no air above it. With less than [`NEARLY`] of the cell free it
//! counts as full, like a cell that the surface has passed, and water without a source fills the rest: levels 0.05
//! and 0.15 cells below a lid rose to it, and levels 0.25 cells and more below it stayed.
//!
//! A discharge or a velocity into the domain states how much water enters ([`inflow`]), and the cells between the
//! solids how much they hold ([`space`]). What leaves has an upper bound ([`outflow`]): the inflow less this bound
//! fills the free volume after a known time at the latest. From then on no air is left, the density of the water
//! grows by the excess over the volume, and its pressure drives more water through the openings. Where the density
//! leaves the range of the guards before the run ends, the case is refused.

mod inflow;
mod outflow;
mod space;
#[cfg(test)]
mod tests;

use crate::scene::Scene;
use crate::scene::bodies::Mobility;
use crate::scene::findings::{Findings, at_most, number};
use crate::scene::flow::{Flow, PATH};
use crate::scene::free_surface::{FreeSurface, WaterPart};
use base::error::Remedy;
use inflow::Inflows;
use outflow::Outlets;
use space::Space;

/// Free part of a cell below which an interface cell without air next to it becomes full.
const NEARLY: f64 = 0.2;
/// Difference between a level and the lid that is rounding \[cells\].
const LEVEL_SLACK: f64 = 1e-6;
/// Part of the time until the basin is full, or of the discharge that leaves, that a remedy proposes.
const PROPOSED: f64 = 0.95;
/// Part of the largest change of the density that the mean change reaches in runs that failed: in corners it is
/// larger.
const MAY_END: f64 = 0.75;
/// Number of halvings in the search for the volume after a step.
const HALVINGS: usize = 40;

/// Reports a level just below the lid, and a basin that is full before the end of the run. `like` is the flow of the
/// run that this one continues.
pub(super) fn check(scene: &Scene, flow: &Flow, like: Option<&Flow>, findings: &mut Findings) {
    let Some(surface) = &scene.surface else {
        return;
    };
    check_lid(scene, surface, findings);
    // A run that is continued with other openings has an amount of water that the case does not state.
    let other = like.is_some_and(|like| like.faces != flow.faces);
    if other || !flow.patches().any(inflow::is_stated) {
        return;
    }
    let space = Space::new(scene, flow, surface);
    let inflows = Inflows::new(scene, flow, &space);
    if inflows.volume(scene.time.end) <= 0.0 {
        return;
    }
    let space = space.filled_by(&inflows.inlets());
    let basin = Basin {
        scene,
        outlets: Outlets::new(scene, flow, surface, (&inflows, &space)),
        inflows,
        space,
        stiffness: (scene.grid.spacing / flow.time_step).powi(2) / 3.0,
    };
    basin.check(findings);
}

/// Water of a scene that enters and leaves, and the space for it.
struct Basin<'a> {
    scene: &'a Scene,
    inflows: Inflows<'a>,
    space: Space<'a>,
    outlets: Outlets<'a>,
    /// Pressure per density and relative change of the density [m²/s²].
    stiffness: f64,
}

/// Course of the filling.
struct Course {
    /// Time at which the basin is full \[s\].
    full: f64,
    /// Largest relative change of the mean density of the water until the end of the run.
    compression: f64,
}

/// Discharge of the openings.
#[derive(Clone, Copy)]
enum Leaves {
    /// Largest discharge, with the largest energy of the water at any level.
    Most,
    /// Likely discharge, with the energy of a level pool or of jets.
    Likely,
}

impl Basin<'_> {
    /// Reports a basin that is full before the end of the run.
    fn check(&self, findings: &mut Findings) {
        if self.outlets.unbounded {
            return;
        }
        let end = self.scene.time.end;
        let bound = self.course(end, Leaves::Most);
        let likely = self.course(end, Leaves::Likely);
        let Some(course) = bound.as_ref().or(likely.as_ref()) else {
            return;
        };
        // The times of a short run are more accurate.
        let full = likely.as_ref().map_or(course.full, |likely| likely.full);
        let part = self.course((2.0 * full).min(end), Leaves::Likely);
        let full = part.map_or(full, |part| part.full).min(course.full);
        let pressed = likely.as_ref().map_or(0.0, |likely| likely.compression);
        self.report((course, full, pressed), bound.is_some(), findings);
    }

    /// Returns the discharge through the openings with free flow when the water has a volume.
    fn leaves(&self, volume: f64, leaves: Leaves) -> f64 {
        let excess = (volume / self.space.capacity - 1.0).max(0.0);
        let pressure = self.stiffness * excess;
        match leaves {
            Leaves::Most => self.outlets.most(self.outlets.energy + pressure),
            Leaves::Likely => {
                let level = self.space.energy_of(volume);
                self.outlets
                    .likely(self.outlets.energy_at(level) + pressure)
            }
        }
    }

    /// Returns the course of the filling until an end; none if the basin is not full before.
    fn course(&self, end: f64, leaves: Leaves) -> Option<Course> {
        let capacity = self.space.capacity;
        let mut course: Option<Course> = None;
        let mut volume = self.space.water;
        for [from, to] in self.inflows.intervals(end) {
            let enters = self.inflows.rate(0.5 * (from + to));
            let next = self.after((volume, enters), to - from, leaves);
            if next > capacity {
                let between = 0.5 * (volume.min(capacity) + capacity);
                let rate = enters - self.leaves(between, leaves);
                let wait = (capacity - volume).max(0.0) / rate;
                let course = course.get_or_insert(Course {
                    full: from + wait.clamp(0.0, to - from),
                    compression: 0.0,
                });
                course.compression = course.compression.max(next / capacity - 1.0);
            }
            volume = next;
        }
        course
    }

    /// Returns the volume, at the density at rest, after a time in which water enters. The outflow is that at the
    /// end, which limits the volume for any time.
    fn after(&self, (volume, enters): (f64, f64), time: f64, leaves: Leaves) -> f64 {
        let [mut low, mut high] = [0.0, volume + enters.max(0.0) * time];
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if volume + (enters - self.leaves(middle, leaves)) * time > middle {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Reports the basin; `bound` is `true` if it is full although all openings let out as much as they can.
    fn report(
        &self,
        (course, full, pressed): (&Course, f64, f64),
        bound: bool,
        findings: &mut Findings,
    ) {
        let (scene, end) = (self.scene, self.scene.time.end);
        let Some(largest) = self.inflows.largest(end) else {
            return;
        };
        let most = scene.guards.max_compression;
        let ends = bound && course.compression > most;
        let may_end = pressed > MAY_END * most;
        let then = if ends {
            format!(
                "then it compresses the water, and guards.max_compression = {most} ends the run"
            )
        } else if may_end {
            format!(
                "then the pressure of the water grows, and guards.max_compression = {most} may end the run"
            )
        } else {
            "from then on the water presses on the lid".to_owned()
        };
        let reason = format!(
            "{}the box is {}full after {} s, before the end of the run at {} s; {then}",
            self.balance(bound, (full, end)),
            if bound { "" } else { "probably " },
            number(full),
            number(end)
        );
        let remedy = self.remedy((full, bound));
        if ends && self.is_certain() {
            findings.error(&largest.path, reason, remedy);
        } else if ends || may_end || bound && self.outlets.all_stated() {
            findings.unstable(&largest.path, reason, remedy);
        } else {
            findings.warn(&largest.path, reason, remedy);
        }
    }

    /// Returns `true` if there is no more space than is counted, and nothing drives the water out faster.
    fn is_certain(&self) -> bool {
        let scene = self.scene;
        let mut bodies = scene.bodies.iter();
        let still = bodies.all(|body| body.mobility == Mobility::Fixed) && scene.blocks.is_none();
        // Grains may leave, and with them their volume.
        scene.grains.is_none() && self.space.is_exact() && (still || self.outlets.all_stated())
    }

    /// Returns the beginning of a sentence on what enters, what is free and what leaves.
    fn balance(&self, bound: bool, (full, end): (f64, f64)) -> String {
        let three = self.scene.grid.dimension == 3;
        let [volume, rate] = [["m2", "m2/s"], ["m3", "m3/s"]][usize::from(three)];
        let free = (self.space.capacity - self.space.water).max(0.0);
        let names = self.inflows.names();
        if self.outlets.is_empty() {
            return format!(
                "{} {volume} of water enter through {names} until the end of the run, {} {volume} are free above the \
                 water of the start, and no opening lets water out: ",
                number(self.inflows.volume(end)),
                number(free)
            );
        }
        let leaves = if bound { Leaves::Most } else { Leaves::Likely };
        let leaves = self.leaves(self.space.capacity, leaves);
        format!(
            "{} {rate} of water enter through {names}, and with water up to the lid {} lets out {} {rate} {}: {} \
             {volume} are free above the water of the start, and ",
            number(self.inflows.entering(full) / full.max(f64::MIN_POSITIVE)),
            self.outlets.names(),
            number(leaves + self.inflows.leaving(full) / full.max(f64::MIN_POSITIVE)),
            if bound { "at most" } else { "or somewhat more" },
            number(free)
        )
    }

    /// Returns the remedy for a basin that is full at a time.
    fn remedy(&self, (full, bound): (f64, bool)) -> Remedy {
        let three = self.scene.grid.dimension == 3;
        let rate = ["m2/s", "m3/s"][usize::from(three)];
        let proposed = at_most(PROPOSED * full);
        let end = format!("end the run after {} s", number(proposed));
        if self.outlets.is_empty() {
            let free = self.space.capacity - self.space.water;
            let less = PROPOSED * free.max(0.0) / self.scene.time.end;
            let excess = self.inflows.volume(self.scene.time.end) - free;
            let higher = match self.space.lid {
                lid if lid > 0.0 => {
                    format!(", raise the lid by more than {} m", number(excess / lid))
                }
                _ => String::new(),
            };
            let text = format!(
                "add an opening through which water leaves, such as `outfall` or `level`, {end}, let in at most {} \
                 {rate} as a mean over the run{higher}",
                number(less)
            );
            return Remedy::from(text).set("time.end", proposed);
        }
        let leaves = if bound { Leaves::Most } else { Leaves::Likely };
        let leaves = self.leaves(self.space.capacity, leaves);
        let text = format!(
            "use larger or more openings, let in at most {} {rate}, {end}, or use a higher domain",
            number(PROPOSED * leaves)
        );
        Remedy::from(text).set("time.end", proposed)
    }
}

/// Warns of a level in the last row of cells that fills up to the lid.
fn check_lid(scene: &Scene, surface: &FreeSurface, findings: &mut Findings) {
    let (h, height) = (scene.grid.spacing, scene.grid.size[surface.axis]);
    for (n, part) in surface.parts.iter().enumerate() {
        let WaterPart::Level(level) = part else {
            continue;
        };
        let free = (height - surface.above(*level)) / h;
        if free <= LEVEL_SLACK || free > NEARLY {
            continue;
        }
        let path = format!("{PATH}.surface.water[{n}].level");
        let below = if surface.rises {
            h * ((height / h).round() - 1.0)
        } else {
            h
        };
        findings.warn(
            &path,
            format!(
                "the level is {} cells below the lid: the last row of cells counts as full, and water without a source \
                 fills it",
                number(free)
            ),
            Remedy::from(format!(
                "use a domain that is higher by a cell, or a level one cell from the lid, {} m",
                number(below)
            ))
            .set(&*path, below),
        );
        return;
    }
}
