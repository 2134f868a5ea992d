//! Files that appear complete or not at all: written to `.part`, flushed to the disk, renamed, folder flushed.

use std::ffi::CString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
#[cfg(target_os = "linux")]
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::{Error, Result};

/// Returns the name of a file until it is complete: its name with `.part` at the end.
#[must_use]
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    PathBuf::from(name)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Flag with which the system refuses to open a link for writing.
pub const NO_LINKS: i32 = libc::O_NOFOLLOW;

/// Creates an incomplete file. An existing file of its name is removed first; a link is removed rather than its
/// target.
fn create_part(part: &Path) -> Result<File> {
    remove_if_there(part)?;
    OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(part)
        .map_err(|e| Error::io("create", part, &e))
}

/// Opens a file to append to it; a link is refused.
///
/// # Errors
/// If the system refuses an operation.
pub fn append(path: &Path) -> Result<File> {
    OpenOptions::new()
        .append(true)
        .custom_flags(NO_LINKS)
        .open(path)
        .map_err(|e| Error::io("open", path, &e))
}

/// Writes a small file so that `path` contains either its previous contents or all of `bytes`, even after a power
/// failure.
///
/// # Errors
/// If the system refuses an operation; `path` is then unchanged and no `.part` file remains.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let part = part_of(path);
    let written = create_part(&part)
        .and_then(|mut file| {
            file.write_all(bytes)
                .map_err(|e| Error::io("write", &part, &e))
        })
        .and_then(|()| publish(&part, path));
    if written.is_err() {
        // The first error is reported; a leftover file is removed at the next start at the latest.
        let _ = fs::remove_file(&part);
    }
    written
}

/// Writes a value as indented JSON with a final newline, like [`write()`].
///
/// # Errors
/// If the system refuses an operation, or if the value has no JSON form ([`Error::Invalid`]).
pub fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value)
        .map_err(|e| Error::invalid(&path.display().to_string(), e.to_string()))?;
    text.push('\n');
    write(path, text.as_bytes())
}

/// Flushes a complete, closed `.part` file to the disk and gives it its final name.
///
/// # Errors
/// If the system refuses an operation.
pub fn publish(part: &Path, path: &Path) -> Result<()> {
    File::open(part)
        .and_then(|file| file.sync_all())
        .map_err(|e| Error::io("flush", part, &e))?;
    fs::rename(part, path).map_err(|e| Error::io("rename into place", path, &e))?;
    if log::log_enabled!(log::Level::Debug) {
        let bytes = fs::metadata(path).map_or(0, |data| data.len());
        log::debug!("{} is complete, {bytes} bytes", path.display());
    }
    sync_folder(path)
}

/// Flushes the folder that contains `path`, so that a rename or removal in it is on the disk.
///
/// # Errors
/// If the system refuses an operation.
pub fn sync_folder(path: &Path) -> Result<()> {
    let folder = folder_of(path);
    match File::open(folder).and_then(|file| file.sync_all()) {
        // Some network file systems cannot flush a folder; the rename itself is complete.
        Err(e) if e.kind() != io::ErrorKind::InvalidInput => Err(Error::io("flush", folder, &e)),
        _ => Ok(()),
    }
}

/// Checks on one rank, before all open it together, if `part` can be created with `bytes` bytes. Missing
/// permissions, a quota and a full disk are detected here, where the write can still be cancelled. An old `part` is
/// replaced; none remains.
pub(crate) fn probe(part: &Path, bytes: u64) -> Result<()> {
    let file = create_part(part)?;
    let reserved = reserve(&file, bytes);
    drop(file);
    remove_if_there(part)?;
    match reserved {
        Err(e) if e.raw_os_error() == Some(libc::ENOSPC) => {
            let folder = folder_of(part);
            Err(Error::Space {
                needed: bytes,
                free: free_bytes(folder)?,
                path: folder.display().to_string(),
            })
        }
        Err(e) => Err(Error::io("reserve the space for", part, &e)),
        Ok(()) => Ok(()),
    }
}

/// Allocates the disk space of an existing file, so that writing to it cannot run out of space.
pub(crate) fn hold(part: &Path, bytes: u64) -> Result<()> {
    OpenOptions::new()
        .write(true)
        .open(part)
        .and_then(|file| reserve(&file, bytes))
        .map_err(|e| Error::io("reserve the space for", part, &e))
}

#[cfg(target_os = "linux")]
fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    let length = libc::off_t::try_from(bytes).map_err(io::Error::other)?;
    // SAFETY: the descriptor is open for as long as `file` is borrowed, and fallocate touches no memory of ours.
    let code = unsafe { libc::fallocate(file.as_raw_fd(), 0, 0, length) };
    if code == 0 {
        return Ok(());
    }
    let error = io::Error::last_os_error();
    match error.raw_os_error() {
        // The file system cannot reserve space, so that an error would appear at writing.
        Some(libc::EOPNOTSUPP | libc::ENOSYS | libc::EINVAL) => Ok(()),
        _ => Err(error),
    }
}

#[cfg(not(target_os = "linux"))]
fn reserve(_: &File, _: u64) -> io::Result<()> {
    Ok(())
}

pub(crate) fn remove_if_there(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(Error::io("remove", path, &e)),
        _ => Ok(()),
    }
}

/// Returns the number of bytes that this user can still write on the disk that contains `path` (an existing file or
/// folder).
///
/// # Errors
/// If the system refuses an operation.
pub fn free_bytes(path: &Path) -> Result<u64> {
    let name = CString::new(path.as_os_str().as_bytes())
        .map_err(|e| Error::invalid(&path.display().to_string(), e.to_string()))?;
    let mut room = std::mem::MaybeUninit::<libc::statvfs>::uninit();
    // SAFETY: `name` ends in a zero byte and `room` is large enough for what statvfs writes.
    let code = unsafe { libc::statvfs(name.as_ptr(), room.as_mut_ptr()) };
    if code != 0 {
        return Err(Error::io(
            "query the free space on",
            path,
            &io::Error::last_os_error(),
        ));
    }
    // SAFETY: statvfs returned 0, so it has filled the struct.
    let room = unsafe { room.assume_init() };
    Ok(room.f_bavail.saturating_mul(room.f_frsize))
}

/// Refuses a write of `needed` bytes to the folder of `path` if they do not fit.
pub(crate) fn require_space(path: &Path, needed: u64) -> Result<()> {
    let folder = folder_of(path);
    let free = free_bytes(folder)?;
    if free < needed {
        return Err(Error::Space {
            needed,
            free,
            path: folder.display().to_string(),
        });
    }
    Ok(())
}

/// Returns the files in a folder, in order of name.
pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Error::io("list", folder, &e))? {
        let entry = entry.map_err(|e| Error::io("list", folder, &e))?;
        if entry.file_type().is_ok_and(|kind| kind.is_file()) {
            all.push(entry.path());
        }
    }
    all.sort();
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write(&path, b"one").unwrap();
        write(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(files(dir.path()).unwrap(), vec![path]);
    }

    #[test]
    fn a_failed_write_names_the_path_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let missing = dir.path().join("no").join("a.txt");
        let error = write(&missing, b"x").unwrap_err();
        assert!(error.to_string().contains("no/a.txt"), "{error}");
        // A folder of this name exists: the rename fails, and the .part file is removed.
        let folder = dir.path().join("b");
        fs::create_dir(&folder).unwrap();
        fs::write(folder.join("x"), b"x").unwrap();
        assert!(write(&folder, b"x").is_err());
        assert!(!part_of(&folder).exists());
    }

    #[test]
    fn space_is_counted() {
        let dir = tempfile::tempdir().unwrap();
        assert!(free_bytes(dir.path()).unwrap() > 0);
        assert!(free_bytes(&dir.path().join("no")).is_err());
        let path = dir.path().join("a");
        require_space(&path, 1).unwrap();
        let error = require_space(&path, u64::MAX).unwrap_err();
        assert!(matches!(
            error,
            Error::Space {
                needed: u64::MAX,
                ..
            }
        ));
    }

    #[test]
    fn json_ends_in_a_newline() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("summary.json");
        write_json(&path, &serde_json::json!({"outcome": "done"})).unwrap();
        assert_eq!(
            fs::read_to_string(&path).unwrap(),
            "{\n  \"outcome\": \"done\"\n}\n"
        );
    }
}
