//! Supervision of the preparation of grains on the first rank: its progress, requests to it, and checkpoints of an
//! unfinished sample in the folder of the run.

use super::folder::RunFolder;
use super::watch::Watch;
use base::error::Error;
use decomposition::Communicator;
use dem::Dem;
use dem::particles::Particles;
use dem::space::Space;
use output::checkpoint::RunState;
use preparation::supervision::{Request, Requests, Supervisor};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::time::Instant;

/// Supervisor of a preparation on the first rank: it reports progress, forwards requests, and saves checkpoints.
pub(super) struct SampleSupervisor<'a> {
    pub(super) watch: RefCell<&'a mut Watch>,
    pub(super) report: &'a dyn Fn(&str),
    pub(super) communicator: &'a Communicator,
    pub(super) folder: &'a RunFolder,
    /// Attributes stored in the checkpoints.
    pub(super) attributes: &'a Value,
}

impl<S: Space> Supervisor<S> for SampleSupervisor<'_> {
    fn report(&self, line: &str) {
        (self.report)(line);
    }

    fn ask(&self) -> Request {
        self.watch.borrow_mut().ask(self.communicator)
    }

    fn save(
        &self,
        particles: &Particles<S>,
        dem: &Dem<S>,
        progress: &Value,
        request: Request,
    ) -> Result<(), Error> {
        let begun = Instant::now();
        let folder = self.folder.preparation();
        std::fs::create_dir_all(&folder)
            .map_err(|e| Error::Io(format!("{}: {e}", folder.display())))?;
        let mut attributes = self.attributes.clone();
        attributes["preparation"] = json!({ "sample": progress });
        let state = RunState::<S, f64>::of_grains(particles, dem);
        let written = state.write(
            &folder,
            dem.steps(),
            0.0,
            attributes,
            2,
            &Communicator::serial(),
        );
        match written {
            Ok(()) => (self.report)(&format!(
                "the unfinished sample is saved: {} grains, {} solid steps",
                particles.owned(),
                dem.steps()
            )),
            Err(io::Error::Space { needed, free, path }) if request == Request::Checkpoint => {
                (self.report)(&format!(
                    "the unfinished sample is not saved, because it needs {needed} bytes and {path} has only \
                     {free} free; the preparation continues"
                ));
            }
            Err(error) => return Err(Error::Io(error.to_string())),
        }
        let mut watch = self.watch.borrow_mut();
        watch.record_checkpoint(begun.elapsed());
        if request == Request::Stop {
            watch.forget_file();
        }
        Ok(())
    }
}
