//! stub
use super::removal::Departed;
use crate::{dem::BondBreak, dem::space::Space, error::Error, plan::Plan, simulation::view::View};
use decomposition::Domain;
use serde_json::Value;
use std::path::Path;
pub struct ErosionRecorder {
    n: usize,
    b: usize,
    modes: [usize; 2],
}
impl ErosionRecorder {
    pub fn create(_: &Plan, _: &Path, _: &Domain, _: Option<u64>) -> Result<Self, Error> {
        Ok(Self {
            n: 0,
            b: 0,
            modes: [0; 2],
        })
    }
    pub fn record_due<S: Space>(
        &mut self,
        v: &View<S>,
        r: &[Departed],
        b: Vec<BondBreak<S>>,
        _: f64,
    ) -> Result<(), Error> {
        self.n += r.len();
        self.b += b.len();
        for x in &b {
            self.modes[usize::from(x.mode == crate::dem::Failure::Shear)] += 1;
        }
        if v.step % 500 == 0 {
            eprintln!(
                "step {} t {:.3} left {} removed {} broken {} {:?}",
                v.step,
                v.time,
                v.particles.owned(),
                self.n,
                self.b,
                self.modes
            );
        }
        Ok(())
    }
    pub fn eroded_fraction(&self) -> f64 {
        self.n as f64
    }
    pub fn sync(&mut self) -> Result<(), Error> {
        Ok(())
    }
    pub fn state(&self) -> Value {
        Value::Null
    }
    pub fn restore(&mut self, _: &Value) -> Result<(), Error> {
        Ok(())
    }
    pub fn summary(&self) -> Value {
        Value::Null
    }
}
