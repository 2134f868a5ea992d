//! The tables of a run as a checkpoint records them: length and hash of each.
//!
//! A run that continues from a checkpoint cuts its tables back to the recorded length. The hash shows whether the
//! remaining bytes are those that were written. A table that was changed meanwhile is reported and not continued.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::plain;

/// Table at the time of a checkpoint.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mark {
    /// Length in bytes.
    pub bytes: u64,
    /// BLAKE3 hash of these bytes.
    pub blake3: String,
}

/// Marks by the names of their files, all in one folder.
pub type Marks = BTreeMap<String, Mark>;

/// Recorder of marks of growing tables: bytes hashed for one checkpoint are not read again for the next.
#[derive(Clone, Debug, Default)]
pub struct Marker {
    known: BTreeMap<String, (u64, blake3::Hasher)>,
}

impl Marker {
    /// Returns the marks of the named files that exist.
    ///
    /// # Errors
    /// If the system refuses an operation, or if a table has become shorter ([`Error::Corrupt`]).
    pub fn mark<'a>(
        &mut self,
        folder: &Path,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Result<Marks> {
        let mut marks = Marks::new();
        for name in names {
            let path = folder.join(name);
            if !path.exists() {
                continue;
            }
            let (done, hasher) = self.known.entry(name.to_owned()).or_default();
            let (mut file, length) = plain::open(&path, u64::MAX)?;
            if length < *done {
                return Err(Error::corrupt(
                    &path,
                    format!("{length} bytes, but {done} were written to it"),
                ));
            }
            file.seek(SeekFrom::Start(*done))
                .map_err(|e| Error::io("read", &path, &e))?;
            *done += hash(&path, file.take(length - *done), hasher)?;
            marks.insert(
                name.to_owned(),
                Mark {
                    bytes: *done,
                    blake3: hasher.finalize().to_hex().to_string(),
                },
            );
        }
        Ok(marks)
    }
}

fn hash(path: &Path, mut from: impl Read, hasher: &mut blake3::Hasher) -> Result<u64> {
    let mut buffer = vec![0; 1 << 16];
    let mut bytes = 0;
    loop {
        let n = from
            .read(&mut buffer)
            .map_err(|e| Error::io("read", path, &e))?;
        if n == 0 {
            return Ok(bytes);
        }
        hasher.update(&buffer[..n]);
        bytes += n as u64;
    }
}

/// Truncates tables to their marks. Every table is checked before the first is truncated; missing ones are
/// returned.
///
/// # Errors
/// If [`check`] fails.
pub fn cut_back(folder: &Path, marks: &Marks) -> Result<Vec<String>> {
    let (gone, longer) = compare(folder, marks)?;
    for (path, bytes) in longer {
        OpenOptions::new()
            .write(true)
            .open(&path)
            .and_then(|file| {
                file.set_len(bytes)?;
                file.sync_all()
            })
            .map_err(|e| Error::io("cut back", &path, &e))?;
    }
    Ok(gone)
}

/// Compares tables with their marks without changing later rows; missing ones are returned.
///
/// # Errors
/// If the system refuses an operation, or if a table is shorter than its mark or differs before it
/// ([`Error::Corrupt`]).
pub fn check(folder: &Path, marks: &Marks) -> Result<Vec<String>> {
    Ok(compare(folder, marks)?.0)
}

/// Names of missing tables, and paths of tables that are longer than their marks, with the marked length.
type MarkDifferences = (Vec<String>, Vec<(PathBuf, u64)>);

fn compare(folder: &Path, marks: &Marks) -> Result<MarkDifferences> {
    let mut gone = Vec::new();
    let mut longer = Vec::new();
    for (name, mark) in marks {
        // Names come from a file: a path that leads out of the folder is not the name of a table.
        if Path::new(name).file_name() != Some(name.as_ref()) {
            return Err(Error::invalid(name, "is not the name of a table"));
        }
        let path = folder.join(name);
        if !path.exists() {
            gone.push(name.clone());
            continue;
        }
        let (file, length) = plain::open(&path, u64::MAX)?;
        let wrong = |what: &str| {
            let remedy = "restore it, or move it away: the run then starts a new table";
            Error::corrupt(&path, format!("{what}; {remedy}"))
        };
        if length < mark.bytes {
            return Err(wrong(&format!(
                "it has {length} bytes; it had {} at the checkpoint",
                mark.bytes
            )));
        }
        let mut hasher = blake3::Hasher::new();
        hash(&path, file.take(mark.bytes), &mut hasher)?;
        if hasher.finalize().to_hex().as_str() != mark.blake3 {
            return Err(wrong(&format!(
                "its first {} bytes are not those of the checkpoint",
                mark.bytes
            )));
        }
        if length > mark.bytes {
            longer.push((path, mark.bytes));
        }
    }
    Ok((gone, longer))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn tables_are_cut_back_and_changed_ones_are_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.csv");
        let mut marker = Marker::default();
        fs::write(&path, "step,x\n1,2\n").unwrap();
        let first = marker.mark(dir.path(), ["a.csv", "none.csv"]).unwrap();
        assert_eq!(first.len(), 1);
        fs::write(&path, "step,x\n1,2\n2,3\n").unwrap();
        let second = marker.mark(dir.path(), ["a.csv"]).unwrap();
        assert_eq!(second["a.csv"].bytes, 15);
        assert_eq!(check(dir.path(), &first).unwrap(), Vec::<String>::new());
        assert_eq!(fs::read_to_string(&path).unwrap().len(), 15, "not cut");
        // The hash of rows added step by step equals that of the whole table.
        assert_eq!(
            second,
            Marker::default().mark(dir.path(), ["a.csv"]).unwrap()
        );

        assert_eq!(cut_back(dir.path(), &first), Ok(vec![]));
        assert_eq!(fs::read_to_string(&path).unwrap(), "step,x\n1,2\n");
        let says = |marks: &Marks, what: &str| {
            let error = cut_back(dir.path(), marks).unwrap_err().to_string();
            assert!(error.contains("a.csv") && error.contains(what), "{error}");
        };
        says(&second, "it has 11 bytes; it had 15 at the checkpoint");
        fs::write(&path, "step,x\n1,3\n2,3\n").unwrap();
        says(&first, "its first 11 bytes");
        // The table was not truncated.
        assert_eq!(fs::read_to_string(&path).unwrap().len(), 15);
        fs::write(&path, [0xff; 15]).unwrap();
        says(&second, "move it away");
        fs::remove_file(&path).unwrap();
        assert_eq!(cut_back(dir.path(), &first), Ok(vec!["a.csv".to_owned()]));
        let outside = Marks::from([("../a.csv".to_owned(), first["a.csv"].clone())]);
        says(&outside, "not the name of a table");
        assert!(marker.mark(dir.path(), ["a.csv"]).unwrap().is_empty());
        fs::write(&path, "").unwrap();
        assert!(marker.mark(dir.path(), ["a.csv"]).is_err());
    }
}
