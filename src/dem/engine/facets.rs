//! Contacts of grains with walls of facets.
//!
//! A grain may touch a surface at any number of points. Its contacts with facets are therefore searched again in
//! each step, and each takes over the history of the same facet, or of a neighbouring facet without a contact of
//! its own: shear is preserved across an interior edge.

use super::flush::drop_doubled_by_planes;

use super::WallFailure;
use super::pairs::{Grains, WallTouch, act_at_wall};
use crate::contact::ContactLaw;
use crate::deepest::{Partner, Record};
use crate::ghosts;
use crate::particles::{Load, Motion};
use crate::space::Space;
use crate::surface::{FacetSurface, Nearest};
use crate::walls::Wall;

/// Owned grain near a wall with facets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfacePair<C> {
    pub(super) wall: u32,
    pub(super) grain: u32,
    pub(super) radius: f64,
    /// Largest gap over which a bond acts \[m\].
    pub(super) opening: f64,
    /// `true` if the grain is near a plane wall as well.
    pub(super) by_plane: bool,
    /// Index range in `Facets::near` of the facets within reach.
    pub(super) near: (u32, u32),
    /// Contacts: range in `Facets::held`.
    pub(super) held: (u32, u32),
    pub(super) constants: C,
}

/// Grain at a wall of facets, with the list that contains the pair.
pub(crate) type AtFacets<'a, C, M> = (&'a Facets<C, M>, &'a SurfacePair<C>);

/// Contact with a facet and its history.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Held<M> {
    pub(super) facet: u32,
    pub(super) history: M,
}

/// Contacts with facets. A grain may touch a surface at any number of points, so that contacts are listed again in
/// each step. A contact takes over the history of the same facet, or otherwise of an adjacent facet: shear is
/// preserved across an interior edge.
#[derive(Debug)]
pub(crate) struct Facets<C, M> {
    pub(super) pairs: Vec<SurfacePair<C>>,
    pub(super) near: Vec<u32>,
    pub(super) held: Vec<Held<M>>,
    pub(super) next: Vec<Held<M>>,
    /// Indices of the pairs to test until all gaps are checked again.
    pub(super) active: Vec<u32>,
    pub(super) found: Vec<Nearest>,
    pub(super) taken: Vec<bool>,
    pub(super) close: Vec<[u32; 3]>,
    /// Contacts of one grain with several walls, by pair.
    pub(super) together: Vec<(u32, Nearest)>,
    /// Pair and facet of contacts that a contact with another wall replaces.
    pub(super) doubled: Vec<[u32; 2]>,
}

impl<C, M> Default for Facets<C, M> {
    fn default() -> Self {
        Self {
            pairs: Vec::new(),
            near: Vec::new(),
            held: Vec::new(),
            next: Vec::new(),
            active: Vec::new(),
            found: Vec::new(),
            taken: Vec::new(),
            close: Vec::new(),
            together: Vec::new(),
            doubled: Vec::new(),
        }
    }
}

impl<C: Copy, M: Copy + Default + PartialEq> Facets<C, M> {
    /// Computes the contacts of the sphere of pair `k` with its surface and adds them to its load; they are stored
    /// for the next step. The loads begin with grain `first`.
    #[inline(always)]
    pub(super) fn act_on_sphere<S: Space, L: ContactLaw<S, Constants = C, History = M>>(
        &mut self,
        k: usize,
        walls: &[Wall<S>],
        grains: Grains<'_, S>,
        (contact, first): (&mut [Load<S>], usize),
        (failures, record): (&mut Vec<WallFailure<S>>, &mut Record),
        dt: f64,
    ) {
        let pair = &mut self.pairs[k];
        let wall = &walls[pair.wall as usize];
        let Some(surface) = &wall.surface else {
            return;
        };
        let grain = &grains.motion[pair.grain as usize];
        let held = &self.held[pair.held.0 as usize..pair.held.1 as usize];
        let reach = if held.iter().any(|old| L::holds(&old.history)) {
            pair.radius + pair.opening
        } else {
            pair.radius
        };
        let near = &self.near[pair.near.0 as usize..pair.near.1 as usize];
        wall.touched(near, &grain.position, reach, &mut self.found);
        if !self.doubled.is_empty() {
            let pair = ghosts::index(k);
            let doubled = &self.doubled;
            self.found
                .retain(|one| !doubled.contains(&[pair, one.facet]));
        }
        if pair.by_plane {
            let sphere = (&grain.position, pair.radius);
            drop_doubled_by_planes(walls, sphere, &mut self.found, |one| {
                is_held::<S, L>(held, one.facet)
            });
        }
        self.taken.clear();
        self.taken.resize(held.len(), false);
        let start = ghosts::index(self.next.len());
        for one in &self.found {
            let mut history = history_of(surface, held, &mut self.taken, &self.found, one.facet);
            if one.distance >= pair.radius && !L::holds(&history) {
                continue;
            }
            let normal = S::from_volume(&one.normal);
            record.note(
                pair.radius - one.distance,
                pair.radius,
                pair.grain,
                Partner::Wall(pair.wall),
            );
            let failure = act_at_wall::<S, L>(
                (&pair.constants, &mut history),
                &WallTouch {
                    radius: pair.radius,
                    distance: one.distance,
                    normal: &normal,
                    grain,
                    moves: &wall.velocity,
                    moisture: grains.moisture::<L>(pair.grain, pair.grain),
                },
                &mut contact[pair.grain as usize - first],
                dt,
            );
            if let Some(mode) = failure {
                failures.push(WallFailure {
                    grain: pair.grain,
                    wall: pair.wall,
                    arm: normal * -one.distance,
                    mode,
                });
            }
            // The default history counts as none, whether or not lists were built meanwhile.
            if (one.distance < pair.radius || L::holds(&history)) && history != M::default() {
                self.next.push(Held {
                    facet: one.facet,
                    history,
                });
            }
        }
        pair.held = (start, ghosts::index(self.next.len()));
    }

    /// Computes the contacts of all active pairs of spheres: searched again, each with its previous history. The
    /// loads begin with grain `first`.
    #[inline(always)]
    pub(super) fn act<S: Space, L: ContactLaw<S, Constants = C, History = M>>(
        &mut self,
        walls: &[Wall<S>],
        grains: Grains<'_, S>,
        (contact, first): (&mut [Load<S>], usize),
        (failures, record): (&mut Vec<WallFailure<S>>, &mut Record),
        dt: f64,
    ) {
        if self.active.is_empty() && self.held.is_empty() {
            return;
        }
        self.next.clear();
        let mut from = 0;
        while from < self.active.len() {
            let to = self.same_grain(from);
            self.find_doubled::<S, L>((from, to), walls, grains.motion);
            for n in from..to {
                let found = (&mut *failures, &mut *record);
                let k = self.active[n] as usize;
                self.act_on_sphere::<S, L>(k, walls, grains, (&mut *contact, first), found, dt);
            }
            from = to;
        }
        std::mem::swap(&mut self.held, &mut self.next);
    }

    /// Returns the end of the active pairs with the same grain as the active pair `from`: pairs are sorted by
    /// grain.
    pub(super) fn same_grain(&self, from: usize) -> usize {
        let grain = |n: usize| self.pairs[self.active[n] as usize].grain;
        let mut to = from + 1;
        while to < self.active.len() && grain(to) == grain(from) {
            to += 1;
        }
        to
    }

    /// Marks the contacts of the active pairs from `from` to `to`, all of one sphere, that a contact with another
    /// wall replaces: where two walls touch or lie in one plane, only one contact acts.
    pub(super) fn find_doubled<S: Space, L: ContactLaw<S, Constants = C, History = M>>(
        &mut self,
        (from, to): (usize, usize),
        walls: &[Wall<S>],
        motion: &[Motion<S>],
    ) {
        self.doubled.clear();
        if to - from < 2 {
            return;
        }
        let mut together = std::mem::take(&mut self.together);
        let mut doubled = std::mem::take(&mut self.doubled);
        let mut found = std::mem::take(&mut self.found);
        let pairs = self.active[from..to].iter().copied();
        let buffers = (&mut together, &mut found);
        self.doubles::<S, L>(pairs, walls, motion, |_| 0.0, buffers, &mut doubled);
        (self.together, self.doubled, self.found) = (together, doubled, found);
    }

    /// Adds to `doubled` those contacts of these pairs, all of one sphere, that a contact with another wall
    /// replaces: a nearer one in the same direction (at equal distance that with the first wall), one with a
    /// facet that contains the edge or vertex in contact, or one in the same direction that a bond or a bridge holds. A
    /// pair is in contact up to its `gap` \[m\].
    pub(super) fn doubles<S: Space, L: ContactLaw<S, Constants = C, History = M>>(
        &self,
        pairs: impl Iterator<Item = u32>,
        walls: &[Wall<S>],
        motion: &[Motion<S>],
        gap: impl Fn(&SurfacePair<C>) -> f64,
        (together, found): (&mut Vec<(u32, Nearest)>, &mut Vec<Nearest>),
        doubled: &mut Vec<[u32; 2]>,
    ) {
        together.clear();
        for k in pairs {
            let pair = &self.pairs[k as usize];
            let wall = &walls[pair.wall as usize];
            let at = &motion[pair.grain as usize].position;
            wall.touched(self.near(pair), at, pair.radius + gap(pair), found);
            together.extend(found.iter().map(|one| (k, *one)));
        }
        for &(k, one) in together.iter() {
            let pair = &self.pairs[k as usize];
            if is_held::<S, L>(self.held(pair), one.facet) {
                continue;
            }
            let centre = S::to_volume(&motion[pair.grain as usize].position);
            let foot = S::from_volume(&(centre - one.normal * one.distance));
            let replaced = together.iter().any(|&(other, two)| {
                let others = &self.pairs[other as usize];
                let wall = &walls[others.wall as usize];
                let on = || wall.stands_on(self.near(others), &foot);
                let holds = || is_held::<S, L>(self.held(others), two.facet);
                other != k
                    && (two.replaces(&one, other < k, on) || two.holds_instead_of(&one) && holds())
            });
            if replaced {
                doubled.push([k, one.facet]);
            }
        }
    }

    /// Bonds all contacts of spheres that no contact with another wall replaces; returns their number.
    pub(super) fn bond<S: Space, L: ContactLaw<S, Constants = C, History = M>>(
        &mut self,
        walls: &[Wall<S>],
        motion: &[Motion<S>],
    ) -> u64 {
        let gap = |pair: &SurfacePair<C>| L::bonding_gap(&pair.constants);
        let (mut together, mut found, mut doubled) = (Vec::new(), Vec::new(), Vec::new());
        let mut from = 0;
        for pairs in self.pairs.chunk_by(|a, b| a.grain == b.grain) {
            let indices = from..from + ghosts::index(pairs.len());
            from = indices.end;
            if pairs.len() > 1 {
                let buffers = (&mut together, &mut found);
                self.doubles::<S, L>(indices, walls, motion, gap, buffers, &mut doubled);
            }
        }
        doubled.sort_unstable();
        let mut bonds = 0;
        self.next.clear();
        for (k, pair) in (0..).zip(&mut self.pairs) {
            let wall = &walls[pair.wall as usize];
            let Some(surface) = &wall.surface else {
                continue;
            };
            let at = &motion[pair.grain as usize].position;
            let held = &self.held[pair.held.0 as usize..pair.held.1 as usize];
            let near = &self.near[pair.near.0 as usize..pair.near.1 as usize];
            wall.touched(near, at, pair.radius + gap(pair), &mut found);
            found.retain(|one| doubled.binary_search(&[k, one.facet]).is_err());
            if pair.by_plane {
                drop_doubled_by_planes(walls, (at, pair.radius), &mut found, |one| {
                    is_held::<S, L>(held, one.facet)
                });
            }
            self.taken.clear();
            self.taken.resize(held.len(), false);
            let start = ghosts::index(self.next.len());
            for one in &found {
                let mut history = history_of(surface, held, &mut self.taken, &found, one.facet);
                bonds += u64::from(L::bond(
                    &pair.constants,
                    &mut history,
                    pair.radius - one.distance,
                ));
                // The default history counts as none, whether or not lists were built meanwhile.
                if (one.distance < pair.radius || L::holds(&history)) && history != M::default() {
                    self.next.push(Held {
                        facet: one.facet,
                        history,
                    });
                }
            }
            pair.held = (start, ghosts::index(self.next.len()));
        }
        std::mem::swap(&mut self.held, &mut self.next);
        bonds
    }

    /// Chooses the pairs that may touch before grains have moved by another `check_path` \[m\].
    pub(super) fn activate<S: Space>(
        &mut self,
        walls: &[Wall<S>],
        motion: &[Motion<S>],
        check_path: f64,
    ) {
        self.active.clear();
        for (k, pair) in (0..).zip(&mut self.pairs) {
            let wall = &walls[pair.wall as usize];
            let at = wall.local(&motion[pair.grain as usize].position);
            let far = pair.radius * (1.0 + 1e-12) + 2.0 * check_path * (1.0 + 1e-9);
            let closes = || {
                wall.surface.as_ref().is_some_and(|surface| {
                    let near = &self.near[pair.near.0 as usize..pair.near.1 as usize];
                    near.iter()
                        .any(|&facet| surface.distance(facet as usize, &at) <= far)
                })
            };
            if pair.held.0 < pair.held.1 || closes() {
                self.active.push(k);
            } else {
                // The pair is not tested before it is active again, while the contacts of other pairs change.
                pair.held = (0, 0);
            }
        }
    }

    /// Removes all pairs.
    pub(super) fn clear(&mut self) {
        self.pairs.clear();
        self.near.clear();
        self.held.clear();
        self.active.clear();
    }

    /// Returns the facets near the grain of a pair.
    pub(super) fn near(&self, pair: &SurfacePair<C>) -> &[u32] {
        &self.near[pair.near.0 as usize..pair.near.1 as usize]
    }

    /// Returns the contacts of a pair.
    pub(super) fn held(&self, pair: &SurfacePair<C>) -> &[Held<M>] {
        &self.held[pair.held.0 as usize..pair.held.1 as usize]
    }
}

/// Returns `true` if one of the contacts acts across a gap to this facet.
pub(super) fn is_held<S: Space, L: ContactLaw<S>>(held: &[Held<L::History>], facet: u32) -> bool {
    let acts = |one: &Held<L::History>| one.facet == facet && L::holds(&one.history);
    held.iter().any(acts)
}

/// Returns the history among `held` for a contact with `facet`: that of the facet itself, otherwise of an adjacent
/// facet without a contact in `found`.
pub(super) fn history_of<M: Copy + Default>(
    surface: &FacetSurface,
    held: &[Held<M>],
    taken: &mut [bool],
    found: &[Nearest],
    facet: u32,
) -> M {
    let own = held.iter().position(|old| old.facet == facet);
    let at = own.or_else(|| {
        held.iter().zip(&*taken).position(|(old, taken)| {
            !taken
                && surface.adjacent(old.facet, facet)
                && found.iter().all(|other| other.facet != old.facet)
        })
    });
    at.map_or(M::default(), |at| {
        taken[at] = true;
        held[at].history
    })
}
