//! CSV files that grow during a run: rank 0 writes, and all ranks agree on the outcome ([`super::agreement`]).
//!
//! Rows begin with the step. A resumed run first truncates a table to its checkpoint, so that it equals that of an
//! uninterrupted run.

use base::error::Error;
use io::csv::step_of;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::PathBuf;

/// Appends lines on the rank that has the table.
pub(super) fn append(table: &mut Option<Table>, lines: &str) -> Result<(), Error> {
    table.as_mut().map_or(Ok(()), |table| table.append(lines))
}

/// CSV file that grows during a run.
#[derive(Debug)]
pub(super) struct Table {
    path: PathBuf,
    file: File,
}

impl Table {
    /// Opens a new table, or the existing one without the rows after step `resumed_at` and without an incomplete
    /// last line.
    pub(super) fn open(
        path: PathBuf,
        header: &str,
        resumed_at: Option<u64>,
    ) -> Result<Self, Error> {
        let fail = |error: std::io::Error| Error::Io(format!("{}: {error}", path.display()));
        let mut text = format!("{header}\n");
        if let Some(step) = resumed_at {
            match fs::read_to_string(&path) {
                Ok(old) => {
                    let kept = old.split_inclusive('\n').skip(1).filter(|line| {
                        line.ends_with('\n') && step_of(line).is_some_and(|row| row <= step)
                    });
                    text.extend(kept);
                }
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                Err(error) => return Err(fail(error)),
            }
        }
        Self::replace(path, &text)
    }

    /// Removes the rows of step `step` and of later steps.
    pub(super) fn drop_from(&mut self, step: u64) -> Result<(), Error> {
        let old = fs::read_to_string(&self.path)
            .map_err(|error| Error::Io(format!("{}: {error}", self.path.display())))?;
        let kept =
            |(n, line): &(usize, &str)| *n == 0 || step_of(line).is_some_and(|row| row < step);
        let lines = old.split_inclusive('\n').enumerate().filter(kept);
        let text: String = lines.map(|(_, line)| line).collect();
        if text.len() < old.len() {
            *self = Self::replace(self.path.clone(), &text)?;
        }
        Ok(())
    }

    /// Returns a table whose file has this text in place of its previous contents.
    fn replace(path: PathBuf, text: &str) -> Result<Self, Error> {
        // After a crash the file has the old or the new contents.
        let made =
            io::atomic::write(&path, text.as_bytes()).and_then(|()| io::atomic::append(&path));
        let file = made.map_err(|error| Error::Io(error.to_string()))?;
        Ok(Self { path, file })
    }

    fn append(&mut self, lines: &str) -> Result<(), Error> {
        self.file
            .write_all(lines.as_bytes())
            .map_err(|error| Error::Io(format!("{}: {error}", self.path.display())))
    }

    pub(super) fn sync(&self) -> Result<(), Error> {
        self.file
            .sync_data()
            .map_err(|error| Error::Io(format!("{}: {error}", self.path.display())))
    }
}
