//! Options, folder and requests of a run during its start.

use super::super::progress::Progress;
use super::super::setup;
use super::super::watch::Watch;
use super::Start;
use base::error::Error;
use decomposition::Communicator;
use dem::space::Space;
use lbm::lanes::Level;
use output::checkpoint::{RunState, SavedNumber};
use plan::Plan;
use preparation::supervision::{Request, Requests};
use serde_json::Value;
use std::time::{Duration, Instant};

/// Environment of a run during its start: options and folder, requests to the run and its messages.
pub(super) struct Outside {
    pub(super) communicator: Communicator,
    pub(super) start: Start,
    pub(super) watch: Watch,
    pub(super) progress: Progress,
}

impl Outside {
    /// Listens for requests and notes the numbers of ranks and threads.
    ///
    /// # Errors
    /// If signals cannot be caught.
    pub(super) fn open(
        plan: &Plan,
        communicator: Communicator,
        start: Start,
    ) -> Result<Self, Error> {
        let every = plan.scene.checkpoint.every_wall_seconds;
        let every = (every > 0.0).then(|| Duration::from_secs_f64(every));
        let mut folders = vec![start.folder.path()];
        folders.extend(start.parent.as_deref());
        let watch = Watch::new(&folders, start.begun, start.limit, every)?;
        let mut outside = Self {
            communicator,
            start,
            watch,
            progress: Progress::new(false, 0),
        };
        // A run that continues with other slabs has already printed the rest.
        let prints_messages = outside.prints_messages() && outside.start.slabs.is_none();
        outside.progress = Progress::new(prints_messages, 0);
        outside.progress.note(&format!(
            "{} rank(s) x {} thread(s), slabs along {:?}, {} lanes",
            outside.communicator.size(),
            outside.start.threads,
            setup::axis(plan.scene.grid.split_axis),
            Level::best().name()
        ));
        Ok(outside)
    }

    /// Returns `true` if this rank prints messages.
    pub(super) fn prints_messages(&self) -> bool {
        self.communicator.rank() == 0 && !self.start.quiet
    }

    /// Saves a preparation as a checkpoint at step 0, and ends the preparation if requested. Collective.
    ///
    /// # Errors
    /// If a stop is requested ([`Error::Stopped`]), or if the checkpoint cannot be written ([`Error::Io`]).
    pub(super) fn keep<Sp: Space, S: SavedNumber>(
        &mut self,
        state: &RunState<'_, Sp, S>,
        attributes: &Value,
        request: Request,
    ) -> Result<(), Error> {
        let begun = Instant::now();
        let folder = &self.start.folder;
        let written = state.write(
            &folder.checkpoints(),
            0,
            0.0,
            attributes.clone(),
            2,
            &self.communicator,
        );
        match written {
            Ok(()) => folder.forget_preparation(),
            Err(io::Error::Space { needed, free, path }) if request == Request::Checkpoint => {
                self.progress.note(&format!(
                    "the preparation is not saved, because it needs {needed} bytes and {path} has only {free} \
                     free; it continues"
                ));
            }
            Err(error) => return Err(Error::Io(error.to_string())),
        }
        self.watch.record_checkpoint(begun.elapsed());
        if request == Request::Stop {
            if self.communicator.rank() == 0 {
                self.watch.forget_file();
            }
            return Err(Error::Stopped("in the preparation".into()));
        }
        Ok(())
    }
}

impl Requests for Outside {
    fn steps(&self) -> u64 {
        self.watch.steps()
    }

    fn ask(&mut self, communicator: &Communicator) -> Request {
        self.watch.ask(communicator)
    }
}
