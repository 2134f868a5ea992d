//! Migration: grains that left the slab are sent to their owners, with the histories of their contacts.

use super::histories::{pack_history, unpack_history};
use super::*;

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Sends grains that left the slab, with their contacts, to their owners.
    pub(super) fn migrate(
        &mut self,
        particles: &mut Particles<S>,
        region: &GrainDomain<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        let owners = migration::owners(particles, region, domain)?;
        let mut messages = Vec::new();
        let mut numbers = Vec::new();
        for target in (0..domain.communicator().size()).filter(|&target| target != domain.rank()) {
            let leaving: Vec<usize> = (0..owners.len()).filter(|&k| owners[k] == target).collect();
            if leaving.is_empty() {
                continue;
            }
            let mut ids: Vec<u64> = leaving.iter().map(|&k| particles.body[k].id).collect();
            ids.sort_unstable();
            let leaves = |id: u64| ids.binary_search(&id).is_ok();
            let mut writer = Writer::default();
            pack_grains(particles, &leaving, &mut writer);
            let grains = || {
                self.histories
                    .iter()
                    .filter(|(key, _)| leaves(key.first) || leaves(key.second))
            };
            let walls = || {
                self.wall_histories
                    .iter()
                    .filter(|(key, _)| leaves(key.grain))
            };
            writer.integer(grains().count() as u64);
            for (key, history) in grains() {
                writer.integer(key.first);
                writer.integer(key.second);
                for n in key.shift {
                    writer.signed(n);
                }
                pack_history::<S, L>(history, &mut numbers, &mut writer);
            }
            writer.integer(walls().count() as u64);
            for (key, history) in walls() {
                writer.integer(key.grain);
                writer.integer(u64::from(key.wall));
                writer.integer(u64::from(key.facet));
                pack_history::<S, L>(history, &mut numbers, &mut writer);
            }
            messages.push((target, writer.0));
        }
        particles.keep(|k| owners[k] == domain.rank());
        for (_, bytes) in exchange(domain.communicator(), messages) {
            let mut reader = Reader(&bytes);
            unpack_grains(particles, &mut reader)?;
            for _ in 0..reader.integer()? {
                let (first, second) = (reader.integer()?, reader.integer()?);
                let shift = [reader.signed()?, reader.signed()?, reader.signed()?];
                let history = unpack_history::<S, L>(&mut numbers, &mut reader)?;
                self.histories.push((
                    Key {
                        first,
                        second,
                        shift,
                    },
                    history,
                ));
            }
            for _ in 0..reader.integer()? {
                let grain = reader.integer()?;
                let mut small = || {
                    u32::try_from(reader.integer()?)
                        .map_err(|_| Error::Internal("the index of a wall exceeds 32 bits".into()))
                };
                let (wall, facet) = (small()?, small()?);
                let history = unpack_history::<S, L>(&mut numbers, &mut reader)?;
                self.wall_histories
                    .push((WallKey { grain, wall, facet }, history));
            }
        }
        self.put_histories_in_order();
        Ok(())
    }
}
