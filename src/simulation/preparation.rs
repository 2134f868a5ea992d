//! The sample of grains of a run: prepared on the first rank and saved in the folder of the run. Errors are the
//! same on all ranks.

use super::agreement;
use super::folder::RunFolder;
use super::setup;
use super::watch::Watch;
use base::error::Error;
use decomposition::Communicator;
use dem::Dem;
use dem::particles::Particles;
use dem::space::Space;
use io::checkpoint::{Found, Reader};
use output::checkpoint::{self, RunState};
use plan::Plan;
use preparation::supervision::{Request, Requests, SavedSample, Supervision, Supervisor};
use preparation::{Engine, Prepared, prepare};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::time::Instant;

/// Supervisor of a preparation on the first rank: it reports progress, forwards requests, and saves checkpoints.
struct SampleSupervisor<'a> {
    watch: RefCell<&'a mut Watch>,
    report: &'a dyn Fn(&str),
    communicator: &'a Communicator,
    folder: &'a RunFolder,
    /// Attributes stored in the checkpoints.
    attributes: &'a Value,
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

/// Returns the state of a sample from a checkpoint. First rank.
fn saved<S: Space>(found: &Found) -> Result<SavedSample<S>, Error> {
    let reader = Reader::open(found).map_err(|e| Error::Io(e.to_string()))?;
    let (grains, contacts) = checkpoint::read_tables(&reader, 0)?;
    Ok(SavedSample {
        particles: Particles::from_table(&grains)?,
        contacts,
        progress: reader.attributes()["preparation"]["sample"].clone(),
    })
}

/// Generates, reads or lists the grains and cuts the sample; continues from the checkpoint of an earlier attempt,
/// if any. `attributes` are stored in the checkpoints of an unfinished sample. Collective.
///
/// # Errors
/// If the sample cannot be made, read or saved, and [`Error::Stopped`] after a request; the same on all ranks.
pub fn grains<S: Space>(
    plan: &Plan,
    folder: &RunFolder,
    communicator: &Communicator,
    watch: &mut Watch,
    report: &dyn Fn(&str),
    attributes: &Value,
    earlier: Option<&Found>,
) -> Result<Prepared, Error> {
    let mine = if communicator.rank() == 0 {
        let supervisor = SampleSupervisor {
            watch: RefCell::new(watch),
            report,
            communicator,
            folder,
            attributes,
        };
        let made = earlier.map(saved::<S>).transpose().and_then(|saved| {
            let engine = Engine {
                region: setup::region::<S>(plan),
                walls: setup::walls::<S>(plan),
            };
            prepare(
                plan,
                folder.path(),
                &engine,
                &Supervision::new(&supervisor, saved),
            )
        });
        supervisor.watch.into_inner().finish(communicator);
        made
    } else {
        watch.answer_checks(communicator);
        Ok(Prepared::default())
    };
    let mut prepared = agreement::agree(communicator, mine)?;
    // Every rank writes the report into checkpoints, and all must write the same bytes.
    let mut report = prepared.report.to_string().into_bytes();
    communicator.broadcast_bytes(0, &mut report);
    prepared.report = serde_json::from_slice(&report)
        .map_err(|e| Error::Internal(format!("the report of the preparation: {e}")))?;
    Ok(prepared)
}
