//! The links from water through planes of symmetry into the mirror images of bodies.

use super::rows::Row;
use super::{BodyMap, FLUID, OUTSIDE, tag};
use lbm::lanes::Stored;
use lbm::links::gaps::Gaps;
use lbm::links::mirrored::{MirroredLink, MirroredLoads, bounce_mirrored};
use lbm::links::{BodyLink, Load, Rigid, Scheme};
use lbm::populations::Populations;
use std::sync::atomic::Ordering;

/// Link from a cell of a body or joint through planes of symmetry.
struct Through {
    inner: [i32; 3],
    /// Index of the direction from the inner cell.
    out: usize,
    /// Cell whose image is at the other end.
    outer: [i32; 3],
    there: u32,
}

impl BodyMap {
    /// Finds the halves of links through planes of symmetry of every body that is linked again.
    pub(super) fn mirror_links<S: Stored>(&mut self, populations: &Populations<S>) {
        if !self.slab.mirrors() {
            return;
        }
        let (mut found, mut gaps) = (Vec::new(), Gaps::default());
        for k in 0..self.bodies.len() {
            if self.relink[k].load(Ordering::Relaxed) {
                found.clear();
                gaps.clear();
                self.mirror(k, populations, &mut found, &mut gaps);
                std::mem::swap(&mut self.bodies[k].mirrored, &mut found);
                std::mem::swap(&mut self.bodies[k].mirrored_gaps, &mut gaps);
            }
        }
    }

    /// Finds the halves of links of body `k`.
    fn mirror<S: Stored>(
        &self,
        k: usize,
        populations: &Populations<S>,
        found: &mut Vec<MirroredLink>,
        gaps: &mut Gaps,
    ) {
        let body = &self.bodies[k];
        let (mine, rows) = (tag(body.id), &body.rows);
        let frame = self.slab.frame(body.shift);
        let deep = self.slab.dimension == 3;
        let ends = rows.rows().flat_map(|row| rows.ends(row, deep));
        for inner in ends.flat_map(Row::cells) {
            if !self.slab.deep(inner) && self.owner[self.slab.layout_index(inner)] == mine {
                self.through(inner, |through| {
                    let near = [through.inner, through.outer];
                    if through.there == mine || !near.iter().any(|cell| self.slab.interior(*cell)) {
                        return;
                    }
                    let outer = through.outer;
                    let beyond: [i32; 3] = self.beyond(&through);
                    let sign = |a: usize| if beyond[a] == outer[a] { 1 } else { -1 };
                    let place = self.slab.layout_index(outer);
                    let gap = self.gap_at(outer, place, std::array::from_fn(sign), gaps);
                    found.extend(self.halves(&through, frame, gap, populations));
                });
            }
        }
    }

    /// Finds the halves of the links of closed cells of joints, which are at rest. They load no body, only the planes.
    pub(super) fn mirror_joints<S: Stored>(
        &self,
        closed: &[(usize, [i32; 3])],
        populations: &Populations<S>,
        found: &mut Vec<MirroredLink>,
    ) {
        found.clear();
        if !self.slab.mirrors() {
            return;
        }
        for &(_, inner) in closed {
            self.through(inner, |through| {
                if through.there == FLUID {
                    found.extend(self.halves(&through, [0; 3], None, populations));
                }
            });
        }
    }

    /// Visits the links from a cell through planes of symmetry to images of other cells of the domain.
    fn through(&self, inner: [i32; 3], mut visit: impl FnMut(Through)) {
        for (out, along) in self.directions.iter().enumerate().skip(1) {
            let beyond = std::array::from_fn(|a| inner[a] + along.c[a]);
            let Some(outer) = self.slab.grid.image(self.slab.dimension, beyond) else {
                continue;
            };
            if outer != inner && self.slab.held(outer) {
                let there = self.owner[self.slab.layout_index(outer)];
                if there != OUTSIDE {
                    visit(Through {
                        inner,
                        out,
                        outer,
                        there,
                    });
                }
            }
        }
    }

    /// Returns `true` if a cell is the image of water across planes of symmetry.
    pub(super) fn is_mirrored_water(&self, cell: [i32; 3]) -> bool {
        let image = self.slab.grid.image(self.slab.dimension, cell);
        image
            .is_some_and(|at| self.slab.held(at) && self.owner[self.slab.layout_index(at)] == FLUID)
    }

    /// Returns the cell beyond the planes in which a link ends.
    fn beyond(&self, through: &Through) -> [i32; 3] {
        std::array::from_fn(|a| through.inner[a] + self.directions[through.out].c[a])
    }

    /// Returns the halves of a link at cells of the slab: inside the body, and outside if the other end is water.
    fn halves<S: Stored>(
        &self,
        through: &Through,
        frame: [i32; 3],
        gap: Option<u32>,
        populations: &Populations<S>,
    ) -> impl Iterator<Item = MirroredLink> + use<S> {
        let along = &self.directions[through.out];
        let (inner, outer, c) = (through.inner, through.outer, along.c);
        let number = |direction: usize| u8::try_from(direction).unwrap_or(0);
        let cell = |at: [i32; 3]| populations.cell(at.map(|v| v as isize));
        let middle = std::array::from_fn(|a| {
            if a < self.slab.dimension {
                2 * (inner[a] - frame[a]) + 1 + c[a]
            } else {
                0
            }
        });
        let inside = self.slab.interior(inner).then(|| MirroredLink {
            half: BodyLink {
                link: populations.link(cell(inner), through.out),
                middle,
                direction: number(through.out),
                loads: false,
                backed: false,
            },
            leaves: number(through.out),
            gap,
            kappa: None,
        });
        // The direction from the outer cell through the plane: the image of that into the body.
        let turned: [i32; 3] = std::array::from_fn(|a| {
            let crossed = outer[a] != inner[a] + c[a];
            if crossed { c[a] } else { -c[a] }
        });
        let leaves = self.directions.iter().position(|d| d.c == turned);
        let wet = through.there == FLUID && self.slab.interior(outer);
        let outside = leaves.filter(|_| wet).map(|leaves| {
            let behind: [i32; 3] = std::array::from_fn(|a| outer[a] - turned[a]);
            let back = self.directions[leaves].opposite;
            let place = self.slab.layout_index(outer);
            MirroredLink {
                half: BodyLink {
                    link: populations.link(cell(outer), leaves),
                    middle,
                    direction: number(along.opposite),
                    loads: true,
                    backed: self.slab.held(behind)
                        && (self.owner[self.slab.layout_index(behind)] == FLUID
                            || self.is_mirrored_water(behind))
                        && !self.cut(place, back),
                },
                leaves: number(leaves),
                gap,
                kappa: None,
            }
        });
        inside.into_iter().chain(outside)
    }

    /// Reflects populations on links through planes of symmetry and adds the loads. Returns the load that the planes
    /// receive instead of the bodies, which completes the balance of the momentum, and that of the water on the planes;
    /// none without such planes.
    pub fn bounce_at_planes<S: Stored>(
        &self,
        populations: &mut Populations<S>,
        scheme: Scheme,
        loads: &mut [Load],
    ) -> Option<MirroredLoads> {
        if !self.slab.mirrors() {
            return None;
        }
        let mut all = MirroredLoads::default();
        for (k, body) in self.bodies.iter().enumerate() {
            if body.mirrored.is_empty() {
                continue;
            }
            let (links, gaps) = (&body.mirrored, &body.mirrored_gaps);
            let (motion, faces) = (&self.motion[k], self.faces(k));
            let mut own = MirroredLoads::default();
            if self.slab.dimension == 2 {
                bounce_mirrored::<S, 2>(populations, scheme, links, gaps, motion, faces, &mut own);
            } else {
                bounce_mirrored::<S, 3>(populations, scheme, links, gaps, motion, faces, &mut own);
            }
            for a in 0..6 {
                loads[k][a] += own.body[a];
            }
            for a in 0..3 {
                all.body[a] -= own.body[a];
            }
            all.add_planes(&own.planes);
        }
        let (links, half) = (self.mirrored_joint_links(), Scheme::HalfWay);
        let (gaps, still) = (&Gaps::default(), &Rigid::default());
        let mut joints = MirroredLoads::default();
        if self.slab.dimension == 2 {
            bounce_mirrored::<S, 2>(populations, half, links, gaps, still, &[], &mut joints);
        } else {
            bounce_mirrored::<S, 3>(populations, half, links, gaps, still, &[], &mut joints);
        }
        all.add_planes(&joints.planes);
        Some(all)
    }
}
