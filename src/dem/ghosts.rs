//! Ghosts: copies of grains on the ranks that need them, created with the lists and updated in every solid step.
//!
//! A grain is a ghost on every rank that may need it: if the slab of that rank, widened by the largest radius *that
//! rank* owns, is within the interaction range. A single giant therefore does not make all grains ghosts
//! everywhere. A body may be larger than a slab: every rank in its range has a ghost of it.

use super::census::Census;
use super::columns::Crosses;
use super::ghost_plan::{GhostPlan, Messages};
use super::message::{Reader, Writer};
use super::particles::Particles;
use super::region::{GrainDomain, edge};
use super::space::{Components, Space};
use base::error::Error;
use decomposition::{Domain, exchange};

/// Creates the ghosts of every rank. `range` is the largest gap of listed pairs, `margin` the distance beyond a
/// slab within which grains are ghosts for reasons other than contacts \[m\]. Call it when there are no ghosts.
/// Collective.
pub(super) fn make<S: Space>(
    particles: &mut Particles<S>,
    region: &GrainDomain<S>,
    census: &[Census],
    range: f64,
    margin: f64,
    domain: &Domain,
) -> Result<(), Error> {
    let owned = particles.owned();
    if owned >= u32::MAX as usize / 2 {
        return Err(Error::Internal(format!(
            "{owned} grains on one rank are too many for the index lists; use more ranks"
        )));
    }
    let split = domain.axis().index();
    let mut plan = GhostPlan::default();
    let mut images: Vec<(usize, [i32; 3])> = Vec::new();
    let mut shifts = Vec::new();
    let mut messages = Vec::new();
    for (target, of_target) in census.iter().enumerate() {
        let slab = domain.slabs().range(target);
        if slab.is_empty() || (target == domain.rank() && !region.any_periodic()) {
            continue;
        }
        let (mut lower, mut upper) = (region.lower, region.upper);
        for axis in 0..S::DIMENSION {
            if axis == split && domain.communicator().size() > 1 {
                lower.set(
                    axis,
                    edge(slab.start, region.lower.get(axis), region.spacing),
                );
                upper.set(axis, edge(slab.end, region.lower.get(axis), region.spacing));
            }
            if !region.periodic[axis] {
                // Grains outside the box belong to the outermost planes.
                if axis != split || slab.start == 0 {
                    lower.set(axis, f64::NEG_INFINITY);
                }
                if axis != split || slab.end == domain.slabs().planes() {
                    upper.set(axis, f64::INFINITY);
                }
            }
        }
        let mut writer = Writer::default();
        let mut entries = Vec::new();
        for k in 0..owned {
            // Slightly more than needed, so that rounding has no effect.
            let reach =
                (particles.body[k].radius + of_target.largest.max(margin) + range) * (1.0 + 1e-9);
            image_shifts(particles, k, region, (&lower, &upper), reach, &mut shifts);
            for &shift in &shifts {
                if target == domain.rank() {
                    if shift != particles.shift[k] {
                        images.push((k, shift));
                    }
                } else {
                    particles.pack(k, shift, Crosses::Creation, &mut writer);
                    entries.push(index(k));
                }
            }
        }
        if !entries.is_empty() {
            plan.sends.push((target, entries));
        }
        if !writer.0.is_empty() {
            messages.push((target, writer.0));
        }
    }
    for (k, shift) in images {
        plan.images.push((index(k), index(particles.len())));
        particles.push_image(k, shift);
    }
    for (source, bytes) in exchange(domain.communicator(), messages) {
        let start = particles.len();
        let mut reader = Reader(&bytes);
        while !reader.is_empty() {
            particles.unpack(Crosses::Creation, &mut reader)?;
        }
        plan.receives.push((source, start..particles.len()));
    }
    particles.plan = plan;
    Ok(())
}

/// Returns the index of an entry as a 32-bit number.
#[expect(
    clippy::cast_possible_truncation,
    reason = "`make` refuses more than 2^31 grains on a rank"
)]
pub(super) fn index(k: usize) -> u32 {
    k as u32
}

/// Finds the shifts of all images of grain `k` whose centre lies within `reach` of the box `bounds`.
fn image_shifts<S: Space>(
    particles: &Particles<S>,
    k: usize,
    region: &GrainDomain<S>,
    bounds: (&S::Vector, &S::Vector),
    reach: f64,
    shifts: &mut Vec<[i32; 3]>,
) {
    shifts.clear();
    let mut spans = [(0, 0); 3];
    let at = particles.location(k);
    for (axis, span) in spans.iter_mut().enumerate().take(S::DIMENSION) {
        let x = at.get(axis);
        let (low, high) = (bounds.0.get(axis) - reach, bounds.1.get(axis) + reach);
        if region.periodic[axis] {
            let length = region.length(axis);
            *span = (-whole((x - low) / length), whole((high - x) / length));
        } else if x < low || x > high {
            return;
        }
    }
    for a in spans[0].0..=spans[0].1 {
        for b in spans[1].0..=spans[1].1 {
            for c in spans[2].0..=spans[2].1 {
                let own = particles.shift[k];
                shifts.push([own[0] + a, own[1] + b, own[2] + c]);
            }
        }
    }
}

/// Returns the largest whole number not above a value.
#[expect(
    clippy::cast_possible_truncation,
    reason = "a few box lengths at most: grains lie inside the box"
)]
fn whole(value: f64) -> i32 {
    value.floor() as i32
}

impl<S: Space> Particles<S> {
    /// Sends the present motion of owned grains to their ghosts, which must be those of the last step. Collective.
    ///
    /// # Errors
    /// If a message fails.
    #[inline(never)]
    pub fn refresh_ghosts(&mut self, domain: &Domain) -> Result<(), Error> {
        // The plan is taken out while the arrays change, which only moves some pointers.
        let mut plan = std::mem::take(&mut self.plan);
        let outcome = self.refresh_by(&mut plan, domain);
        self.plan = plan;
        outcome
    }

    fn refresh_by(&mut self, plan: &mut GhostPlan, domain: &Domain) -> Result<(), Error> {
        self.copy_step(&plan.images);
        if domain.communicator().size() == 1 {
            return Ok(());
        }
        if plan.step.is_none() {
            plan.step = Some(Messages::to_ghosts(plan, self.step_bytes(), domain)?);
        }
        let Some(Messages { exchange, .. }) = &mut plan.step else {
            return Ok(());
        };
        let mut writer = Writer(std::mem::take(&mut plan.buffer));
        for ((_, entries), message) in plan.sends.iter().zip(exchange.send_buffers_mut::<u8>()) {
            writer.0.clear();
            self.pack_step(entries, &mut writer);
            message.copy_from_slice(&writer.0);
        }
        plan.buffer = writer.0;
        exchange.start();
        exchange.finish();
        for (n, (_, range)) in plan.receives.iter().enumerate() {
            self.unpack_step(range.clone(), &mut Reader(exchange.received(n)))?;
        }
        Ok(())
    }

    /// Adds the row of every ghost to the row of its grain on the owner. The numbers are integers, so that the sum
    /// does not depend on the order. `values` has one row per entry; the rows of ghosts keep their values.
    /// Collective.
    ///
    /// # Errors
    /// If the length of `values` differs from the number of entries, or a message fails.
    pub fn reduce_to_owners<const N: usize>(
        &mut self,
        values: &mut [[i128; N]],
        domain: &Domain,
    ) -> Result<(), Error> {
        if values.len() != self.len() {
            return Err(Error::Internal(format!(
                "{} rows to reduce for {} entries",
                values.len(),
                self.len()
            )));
        }
        let plan = &mut self.plan;
        for &(own, ghost) in &plan.images {
            let row = values[ghost as usize];
            add_row(&mut values[own as usize], &row);
        }
        if domain.communicator().size() == 1 {
            return Ok(());
        }
        if plan.back.as_ref().is_none_or(|back| back.row != N) {
            plan.back = Some(Messages::to_owners(plan, N, domain)?);
        }
        let Some(Messages { exchange, .. }) = &mut plan.back else {
            return Ok(());
        };
        for ((_, range), message) in plan.receives.iter().zip(exchange.send_buffers_mut::<u8>()) {
            let numbers = message.as_chunks_mut::<16>().0;
            for (bytes, value) in numbers
                .iter_mut()
                .zip(values[range.clone()].iter().flatten())
            {
                *bytes = value.to_le_bytes();
            }
        }
        exchange.start();
        exchange.finish();
        for (n, (_, entries)) in plan.sends.iter().enumerate() {
            let numbers = exchange.received::<u8>(n).as_chunks::<16>().0;
            for (&k, row) in entries.iter().zip(numbers.chunks_exact(N.max(1))) {
                for (sum, value) in values[k as usize].iter_mut().zip(row) {
                    *sum = sum.wrapping_add(i128::from_le_bytes(*value));
                }
            }
        }
        Ok(())
    }
}

fn add_row<const N: usize>(to: &mut [i128; N], from: &[i128; N]) {
    for (sum, value) in to.iter_mut().zip(from) {
        *sum = sum.wrapping_add(*value);
    }
}
