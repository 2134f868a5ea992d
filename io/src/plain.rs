//! Reading files of unknown origin at a bounded cost.
//!
//! Only plain files are read. A device, a pipe, a socket or a folder is refused before it is opened, because reading it
//! may never end. A file longer than the limit of the caller is refused before its bytes are read.

use std::fs::{self, File, OpenOptions};
use std::io::Read;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use crate::error::{Error, Result};

/// Maximum length of the text of a case or a study \[bytes\].
pub const LONGEST_CASE: u64 = 256 << 20;
/// Maximum length of a list named in a case: samples, blocks, meshes, profiles \[bytes\].
pub const LONGEST_INPUT: u64 = 2 << 30;
/// Maximum length of a table or summary of a run that is read back \[bytes\].
pub const LONGEST_TABLE: u64 = 8 << 30;

fn refused(path: &Path, reason: &str) -> Error {
    Error::Io {
        action: "read".to_owned(),
        path: path.display().to_string(),
        reason: reason.to_owned(),
    }
}

/// Returns a message that names the kind of a special file.
fn kind(kind: fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    if kind.is_dir() {
        "it is a folder, not a plain file"
    } else if kind.is_fifo() {
        "it is a pipe, not a plain file"
    } else if kind.is_socket() {
        "it is a socket, not a plain file"
    } else {
        "it is a device, not a plain file"
    }
}

/// Opens a plain file of at most `limit` bytes for reading; returns the file and its length.
///
/// # Errors
/// If the system refuses an operation, or if the file is not plain or too long ([`Error::Io`], with the reason).
pub fn open(path: &Path, limit: u64) -> Result<(File, u64)> {
    let look = |known: &fs::Metadata| -> Result<u64> {
        if !known.is_file() {
            return Err(refused(path, kind(known.file_type())));
        }
        if known.len() > limit {
            let reason = format!(
                "it holds {} bytes, and at most {limit} are read",
                known.len()
            );
            return Err(refused(path, &reason));
        }
        Ok(known.len())
    };
    // Opening a pipe waits for its other end and opening a device may act on it, so the kind is checked first.
    look(&fs::metadata(path).map_err(|e| Error::io("read", path, &e))?)?;
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(libc::O_NONBLOCK)
        .open(path)
        .map_err(|e| Error::io("read", path, &e))?;
    // Another file may have replaced it since the first check.
    let length = look(&file.metadata().map_err(|e| Error::io("read", path, &e))?)?;
    Ok((file, length))
}

/// Returns all bytes of a plain file of at most `limit` bytes.
///
/// # Errors
/// If [`open`] fails.
pub fn bytes(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let (file, length) = open(path, limit)?;
    let mut all = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
    // A file that grows during reading remains within the limit.
    file.take(limit.saturating_add(1))
        .read_to_end(&mut all)
        .map_err(|e| Error::io("read", path, &e))?;
    if all.len() as u64 > limit {
        let reason = format!("it holds more than the {limit} bytes that are read");
        return Err(refused(path, &reason));
    }
    Ok(all)
}

/// Returns the text of a plain file of at most `limit` bytes, without a byte order mark.
///
/// # Errors
/// If [`open`] fails, or if the bytes are not UTF-8 ([`Error::Corrupt`]).
pub fn text(path: &Path, limit: u64) -> Result<String> {
    let mut bytes = bytes(path, limit)?;
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
    if let Some(name) = other_encoding(&bytes) {
        let reason = format!("it is not text in UTF-8 but in {name}: save it as UTF-8");
        return Err(Error::corrupt(path, reason));
    }
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        Error::corrupt(path, format!("it is not text (UTF-8) from byte {at} on"))
    })
}

/// Returns the name of an encoding other than UTF-8 that the first bytes of a text show: by a byte order mark, or,
/// without one, by the zero bytes of its first ASCII characters (RFC 4627, section 3). `None` if they show none.
fn other_encoding(bytes: &[u8]) -> Option<&'static str> {
    // The mark of UTF-32 begins with that of UTF-16, so it is looked for first.
    if bytes.starts_with(b"\xff\xfe\0\0") || bytes.starts_with(b"\0\0\xfe\xff") {
        return Some("UTF-32");
    }
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Some("UTF-16");
    }
    let first = bytes.first_chunk::<4>()?;
    match first.map(|byte| byte == 0) {
        [false, true, true, true] | [true, true, true, false] => Some("UTF-32"),
        [false, true, false, true] | [true, false, true, false] => Some("UTF-16"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;

    #[test]
    fn only_plain_files_within_the_limit_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        fs::write(&path, "twelve bytes").unwrap();
        assert_eq!(text(&path, 12).unwrap(), "twelve bytes");
        let error = text(&path, 11).unwrap_err().to_string();
        assert!(error.contains("holds 12 bytes, and at most 11"), "{error}");
        fs::write(&path, [b'a', 0xff]).unwrap();
        let error = text(&path, 12).unwrap_err().to_string();
        assert!(error.contains("from byte 1 on"), "{error}");

        fs::write(&path, "\u{feff}marked").unwrap();
        assert_eq!(text(&path, 12).unwrap(), "marked");
        fs::write(&path, b"\xff\xfex\0,\0y\0\xd8\xd8").unwrap();
        let error = text(&path, 12).unwrap_err().to_string();
        assert!(error.contains("save it as UTF-8"), "{error}");

        let says = |path: &Path, what: &str| {
            let error = bytes(path, 1000).unwrap_err().to_string();
            assert!(error.contains(what), "{error}");
        };
        says(dir.path(), "a folder");
        says(Path::new("/dev/full"), "a device");
        says(&dir.path().join("none"), "No such file");
        let pipe = dir.path().join("pipe");
        assert!(
            std::process::Command::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        says(&pipe, "a pipe");
        let socket = dir.path().join("socket");
        let _listener = UnixListener::bind(&socket).unwrap();
        says(&socket, "a socket");
    }
    /// Checks that a text in UTF-16 or UTF-32 is named, in both byte orders, with and without a byte order mark.
    #[test]
    fn the_name_of_another_encoding_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        for marked in [true, false] {
            let json = if marked {
                "\u{feff}{\"a\": 1}"
            } else {
                "{\"a\": 1}"
            };
            let short = |turn: fn(u16) -> [u8; 2]| json.encode_utf16().flat_map(turn).collect();
            let long =
                |turn: fn(u32) -> [u8; 4]| json.chars().map(u32::from).flat_map(turn).collect();
            let files: [(Vec<u8>, &str); 4] = [
                (short(u16::to_le_bytes), "UTF-16:"),
                (short(u16::to_be_bytes), "UTF-16:"),
                (long(u32::to_le_bytes), "UTF-32:"),
                (long(u32::to_be_bytes), "UTF-32:"),
            ];
            for (bytes, name) in files {
                fs::write(&path, &bytes).unwrap();
                let error = text(&path, 100).unwrap_err().to_string();
                assert!(error.contains(name), "{marked}, {bytes:?}: {error}");
            }
        }
        // A zero byte elsewhere does not name an encoding.
        fs::write(&path, b"a\0bc").unwrap();
        assert_eq!(text(&path, 100).unwrap(), "a\0bc");
    }
}
