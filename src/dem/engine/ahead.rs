//! Contact loads for bodies that another program moves together with its water.
//!
//! The loads are those at the positions and orientations half a step ahead, with the present velocities, and histories
//! advance by a step. A program that takes them as constant over the step makes drift - kick - drift of velocity
//! Verlet, which is symplectic and of second order where nothing else acts:
//!
//! ```text
//! F = F(x + v dt/2, v),     x(t+dt) = x + v dt + F dt²/(2 m),     v(t+dt) = v + F dt/m
//! ```

use super::bodies::Bodies;
use super::{Engine, all_bounded, largest};
use crate::census::agree;
use crate::integrate;
use crate::particles::Particles;
use crate::space::{Components, Space};
use base::error::Error;
use decomposition::Domain;

impl<S: Space, L: Bodies<S>> Engine<S, L> {
    /// Sets the contact loads of the step that follows; the bodies do not move. Collective.
    pub(super) fn loads_ahead(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
    ) -> Result<(), Error> {
        self.prepare(particles, domain)?;
        let half = 0.5 * self.settings.time_step;
        let mut saved = particles.owned_motion();
        let mut ahead = self.drift(particles, domain, half)?;
        if self.validity.path + ahead >= 0.5 * self.settings.skin {
            particles.set_owned_motion(&saved);
            self.rebuild(particles, domain)?;
            saved = particles.owned_motion();
            ahead = self.drift(particles, domain, half)?;
        }
        if ahead >= 0.5 * self.settings.skin {
            return Err(Error::Numerical("a block moves too far in one step".into()));
        }
        self.drift_walls(half);
        particles.refresh_ghosts(domain)?;
        L::pose(&mut self.scratch, particles, self.parallel);
        let path = self.validity.path;
        self.validity.path = path + ahead;
        if self.validity.path > self.validity.activated {
            self.activate(particles);
        }
        self.all_forces(particles, self.settings.time_step, None);
        self.validity.path = path;
        particles.set_owned_motion(&saved);
        Ok(())
    }

    /// Records that the bodies were moved over a step, each by at most `path` \[m\] on this rank. Collective.
    pub(super) fn carried(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        path: f64,
    ) -> Result<(), Error> {
        self.steps += 1;
        let walls = self.drift_walls(0.5 * self.settings.time_step);
        let path = path.max(2.0 * walls) * (1.0 + 1e-9);
        self.validity.path = largest(domain, self.validity.path + path);
        if self.validity.path >= 0.5 * self.settings.skin {
            return self.rebuild(particles, domain);
        }
        particles.refresh_ghosts(domain)?;
        L::pose(&mut self.scratch, particles, self.parallel);
        if self.validity.path > self.validity.activated {
            self.activate(particles);
        }
        Ok(())
    }

    /// Moves all bodies with their velocities for a time \[s\]. Returns the longest path of all ranks \[m\].
    fn drift(
        &mut self,
        particles: &mut Particles<S>,
        domain: &Domain,
        time: f64,
    ) -> Result<f64, Error> {
        let fastest = integrate::blocks::drift(particles, time, self.parallel);
        let path = fastest.speed_squared.sqrt() * time * (1.0 + 1e-9);
        let path = largest(domain, if fastest.bad { f64::INFINITY } else { path });
        if path == f64::INFINITY {
            return agree(domain, all_bounded(particles)).and(Err(Error::Numerical(
                "a block moves too far in one step".into(),
            )));
        }
        Ok(path)
    }

    /// Moves the walls for a time \[s\]; returns the longest path \[m\].
    fn drift_walls(&mut self, time: f64) -> f64 {
        let mut path = 0.0_f64;
        for wall in self.walls.iter_mut().filter(|wall| !wall.open) {
            let drift = wall.drift() * time;
            wall.point += drift;
            path = path.max(drift.length());
        }
        path
    }
}
