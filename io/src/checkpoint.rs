//! Checkpoints: the whole state as named arrays, accepted only if every bit is as written.
//!
//! Order of a write:
//!
//! 1. The free space is checked.
//! 2. All ranks write `checkpoint_<step>.h5` under its `.part` name. The ranks agree on the result of every step.
//! 3. The file is closed; each block is read back and compared with memory.
//! 4. Rank 0 hashes the file and renames it.
//! 5. Rank 0 writes the manifest `checkpoint_<step>.json`. The rename of the manifest is the one moment at which the
//!    checkpoint comes into existence.
//! 6. Older checkpoints are removed.
//!
//! A manifest contains the size and BLAKE3 hash of the file, the position and CRC-32 of each block, the attributes
//! of the caller (case hash, version), and a hash of itself. Its `serial` increases by one with every checkpoint of
//! a folder: after a restart from an older checkpoint the newest is the last one written, not the one with the
//! highest step.

use std::collections::BTreeSet;
use std::fs;
use std::io::Read;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::atomic;
use crate::data::{Element, Kind, Numbers};
use crate::error::{Error, Result};
use crate::group::{Group, agree, on_root};
use crate::hdf::{self, Attribute, Content, DatasetPart, Mode, product};
use crate::plain;

/// One rank's box of a named array of the state.
#[derive(Clone, Debug)]
pub struct Array<'a> {
    /// Name in lower_snake, with `/` between parts: `particles/position`.
    pub name: &'a str,
    /// Shape of the whole array, the same on all ranks.
    pub shape: Vec<usize>,
    /// First index of this rank's box along each axis.
    pub start: Vec<usize>,
    /// Size of this rank's box; a box with a zero is empty.
    pub count: Vec<usize>,
    /// Numbers of this rank's box in C order.
    pub data: Numbers<'a>,
}

/// Contents of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of this format.
    pub format: u32,
    /// Number of this checkpoint in its folder.
    pub serial: u64,
    /// Step from the start of the simulation.
    pub step: u64,
    /// Time \[s\].
    pub time: f64,
    /// Name of the HDF5 file, in the same folder as the manifest.
    pub file: String,
    /// Size in bytes.
    pub bytes: u64,
    /// BLAKE3 hash of the HDF5 file.
    pub blake3: String,
    /// Arrays.
    pub arrays: Vec<ArrayInfo>,
    /// Attributes given by the caller.
    pub attributes: Value,
}

/// Description of one array of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArrayInfo {
    /// Name of the array.
    pub name: String,
    /// Type of the numbers.
    pub kind: Kind,
    /// Shape of the whole array.
    pub shape: Vec<usize>,
    /// Boxes written by the ranks, without empty ones.
    pub blocks: Vec<ArrayBlock>,
}

/// Box of an array with the CRC-32 of its numbers, C order, little endian.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ArrayBlock {
    /// First index of the box along each axis.
    pub start: Vec<usize>,
    /// Size of the box along each axis.
    pub count: Vec<usize>,
    /// CRC-32 (IEEE) of the numbers in the box.
    pub crc32: u32,
}

/// Manifest with the hash of its own text.
#[derive(Serialize, Deserialize)]
struct Signed {
    checkpoint: Manifest,
    manifest_blake3: String,
}

const FORMAT: u32 = 1;
/// Maximum length of a manifest \[bytes\], which takes some seconds to read.
const LONGEST: u64 = 64 << 20;
/// Maximum number of axes of an array.
const DIMENSIONS: usize = 8;
/// Space for the headers that describe the arrays in a file \[bytes\].
const HEADERS: u64 = 16 << 20;
/// Minimum number of checkpoints kept, because the last one may be damaged.
const MIN_KEPT: usize = 2;

impl Manifest {
    fn render(&self) -> Result<String> {
        let text = |value: &Self| {
            serde_json::to_string(value).map_err(|e| Error::invalid("the manifest", e.to_string()))
        };
        let signed = Signed {
            manifest_blake3: blake3::hash(text(self)?.as_bytes()).to_hex().to_string(),
            checkpoint: self.clone(),
        };
        let mut all = serde_json::to_string_pretty(&signed)
            .map_err(|e| Error::invalid("the manifest", e.to_string()))?;
        all.push('\n');
        Ok(all)
    }

    /// Reads a manifest and verifies that it is identical, byte for byte, to the written one.
    fn read(path: &Path) -> Result<Self> {
        let bytes = plain::bytes(path, LONGEST)?;
        let signed: Signed = serde_json::from_slice(&bytes).map_err(|e| {
            // A manifest of another format may have other fields.
            other_format(path, &bytes).unwrap_or_else(|| Error::corrupt(path, e.to_string()))
        })?;
        // The rendered text contains the hash, so that one comparison covers all content.
        if signed.checkpoint.render()?.as_bytes() != bytes {
            return Err(Error::corrupt(path, "it does not match its own hash"));
        }
        if let Some(error) = other_format(path, &bytes) {
            return Err(error);
        }
        signed.checkpoint.sound(path, bytes.len() as u64)?;
        Ok(signed.checkpoint)
    }

    /// Validates the manifest. A matching hash excludes accidental damage only, because the hash can be computed by
    /// any program. The caller checks that the contents fit the case.
    fn sound(&self, path: &Path, length: u64) -> Result<()> {
        let wrong = |what: String| Err(Error::corrupt(path, what));
        let file = Path::new(&self.file);
        if file.file_name() != Some(file.as_os_str()) || !is_ours(file, "h5") {
            return wrong(format!(
                "it names {:?}, which is not a file of a checkpoint in the same folder",
                self.file
            ));
        }
        if !self.time.is_finite() {
            return wrong("its time is not finite".to_owned());
        }
        let mut names = BTreeSet::new();
        let mut all = 0_u64;
        for array in &self.arrays {
            let name = &array.name;
            check_name(name)?;
            if !names.insert(name) {
                return wrong(format!("it has two arrays {name}"));
            }
            let numbers = array
                .shape
                .iter()
                .try_fold(1_usize, |n, &m| n.checked_mul(m));
            let bytes = numbers
                .filter(|_| (1..=DIMENSIONS).contains(&array.shape.len()))
                .and_then(|n| n.checked_mul(array.kind.size()))
                .and_then(|n| all.checked_add(n as u64))
                .filter(|&bytes| bytes <= self.bytes);
            let Some(bytes) = bytes else {
                return wrong(format!(
                    "the array {name} of shape {:?} does not fit into a file of {} bytes",
                    array.shape, self.bytes
                ));
            };
            all = bytes;
            let outside =
                |block: &&ArrayBlock| !hdf::is_inside(&block.start, &block.count, &array.shape);
            if let Some(block) = array.blocks.iter().find(outside) {
                return wrong(format!(
                    "a block at {:?} of size {:?} extends beyond the array {name} of shape {:?}",
                    block.start, block.count, array.shape
                ));
            }
        }
        // In addition to the arrays the file contains their headers and the caller's attributes.
        let most = all.saturating_add(HEADERS).saturating_add(4 * length);
        if self.bytes > most {
            return wrong(format!(
                "a file of {} bytes for arrays of {all} bytes",
                self.bytes
            ));
        }
        Ok(())
    }

    /// Returns the path of the HDF5 file in the folder of `manifest`.
    fn data_path(&self, manifest: &Path) -> PathBuf {
        manifest.with_file_name(&self.file)
    }

    fn verify_file(&self, manifest: &Path) -> Result<()> {
        let path = self.data_path(manifest);
        let known = fs::symlink_metadata(&path).map_err(|e| Error::io("read", &path, &e))?;
        if known.is_symlink() {
            return Err(Error::corrupt(&path, "it is a link to another file"));
        }
        if known.is_file() && known.len() != self.bytes {
            return Err(Error::corrupt(
                &path,
                format!("{} bytes instead of {}", known.len(), self.bytes),
            ));
        }
        let (bytes, hash) = hash_file(&path)?;
        if bytes != self.bytes {
            return Err(Error::corrupt(
                &path,
                format!("{bytes} bytes instead of {}", self.bytes),
            ));
        }
        if hash != self.blake3 {
            return Err(Error::corrupt(&path, "its BLAKE3 hash differs"));
        }
        Ok(())
    }
}

/// Returns the error for a manifest of a format that this program does not read.
fn other_format(path: &Path, bytes: &[u8]) -> Option<Error> {
    let tree: Value = serde_json::from_slice(bytes).ok()?;
    let checkpoint = tree.get("checkpoint")?;
    let format = checkpoint.get("format")?.as_u64()?;
    if format == u64::from(FORMAT) {
        return None;
    }
    let writer = |key: &str| {
        let written = checkpoint.get("attributes").and_then(|all| all.get(key));
        let text = written.and_then(Value::as_str).unwrap_or("unknown");
        text.chars().take(40).collect::<String>()
    };
    Some(Error::invalid(
        &path.display().to_string(),
        format!(
            "a checkpoint of format {format}, written by version {} (commit {}); this program reads format {FORMAT}: \
             continue with that version",
            writer("version"),
            writer("commit")
        ),
    ))
}

fn hash_file(path: &Path) -> Result<(u64, String)> {
    let failed = |e: &std::io::Error| Error::io("read", path, e);
    let (mut file, _) = plain::open(path, u64::MAX)?;
    let mut hasher = blake3::Hasher::new();
    let mut buffer = vec![0; 1 << 20];
    let mut bytes = 0;
    loop {
        let n = file.read(&mut buffer).map_err(|e| failed(&e))?;
        if n == 0 {
            return Ok((bytes, hasher.finalize().to_hex().to_string()));
        }
        hasher.update(&buffer[..n]);
        bytes += n as u64;
    }
}

fn manifest_path(folder: &Path, step: u64) -> PathBuf {
    folder.join(format!("checkpoint_{step:09}.json"))
}

/// Writes a checkpoint and keeps the last `keep` (at least 2). Called by all ranks; returns the manifest's path.
///
/// # Errors
/// If a write fails; the error is the same on all ranks, and earlier checkpoints are unchanged: [`Error::Space`]
/// before anything is written (the caller may continue without a checkpoint), [`Error::Broken`] if the caller must
/// abort, otherwise with all files closed.
#[expect(
    clippy::too_many_arguments,
    reason = "each is a different thing that a checkpoint is made of"
)]
pub fn write(
    folder: &Path,
    step: u64,
    time: f64,
    arrays: &[Array],
    attributes: &Value,
    group: &dyn Group,
    mode: Mode,
    keep: usize,
) -> Result<PathBuf> {
    let manifest = manifest_path(folder, step);
    let (serial, name) = on_root(group, || name_and_serial(folder, step))?;
    let path = folder.join(&name);
    let sound = if time.is_finite() {
        arrays.iter().try_for_each(|a| check_name(a.name))
    } else {
        Err(Error::invalid("the time", time.to_string()))
    };
    agree(group, sound)?;
    let text = [("attributes".to_owned(), attributes.to_string())];
    let mut content = Content::default();
    content.folder(
        "/checkpoint",
        &[("time", Attribute::Float(time)), ("step", as_text(step))],
    );
    content.texts("/checkpoint/caller", &text, group);
    for array in arrays {
        content.parts.push(DatasetPart {
            path: format!("/{}", array.name),
            shape: array.shape.clone(),
            start: array.start.clone(),
            count: array.count.clone(),
            data: array.data,
            attributes: Vec::new(),
        });
    }
    hdf::write_part(&path, &content, group, mode)?;
    let blocks = gather_blocks(arrays, group)?;
    let checked = read_back(&atomic::part_of(&path), arrays, &blocks, group, mode);
    agree(group, checked)?;
    on_root(group, || {
        let part = atomic::part_of(&path);
        let (bytes, blake3) = hash_file(&part)?;
        let new = Manifest {
            format: FORMAT,
            serial,
            step,
            time,
            file: name.clone(),
            bytes,
            blake3,
            arrays: describe(arrays, &blocks),
            attributes: attributes.clone(),
        };
        let text = new.render()?;
        atomic::publish(&part, &path)?;
        atomic::write(&manifest, text.as_bytes())?;
        // The contents of the disk are verified, not those of memory.
        Manifest::read(&manifest)?.verify_file(&manifest)?;
        log::debug!(
            "{} and its {bytes} bytes read back as they were written",
            manifest.display()
        );
        remove_old(folder, keep.max(MIN_KEPT))
    })?;
    Ok(manifest)
}

fn as_text(step: u64) -> Attribute {
    Attribute::Text(step.to_string())
}

/// Checks that the name of an array consists of valid names.
fn check_name(name: &str) -> Result<()> {
    if name.split('/').next() == Some("checkpoint") {
        return Err(Error::invalid(name, "this name belongs to the format"));
    }
    name.split('/').try_for_each(crate::data::check_name)
}

/// Returns the next serial number, and a file name that no manifest uses: if a step is written again, its present
/// checkpoint remains complete until the manifest is replaced.
fn name_and_serial(folder: &Path, step: u64) -> Result<(u64, String)> {
    let known = intact(folder)?;
    let serial = known.iter().map(|k| k.1.serial).max().map_or(1, |n| n + 1);
    let plain = format!("checkpoint_{step:09}.h5");
    let other = format!("checkpoint_{step:09}_b.h5");
    let used = known.iter().any(|k| k.1.file == plain);
    Ok((serial, if used { other } else { plain }))
}

/// Returns the manifests of a folder that match their own hash, with their paths.
fn intact(folder: &Path) -> Result<Vec<(PathBuf, Manifest)>> {
    Ok(manifests(folder)?
        .into_iter()
        .filter_map(|path| Some((path.clone(), Manifest::read(&path).ok()?)))
        .collect())
}

fn is_ours(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e == extension)
        && path
            .file_name()
            .and_then(|n| n.to_str())
            .is_some_and(|n| n.starts_with("checkpoint_"))
}

fn manifests(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut all = atomic::files(folder)?;
    all.retain(|path| is_ours(path, "json"));
    Ok(all)
}

/// Returns the boxes and checksums of all ranks: for each array, one block per rank.
fn gather_blocks(arrays: &[Array], group: &dyn Group) -> Result<Vec<Vec<ArrayBlock>>> {
    let mine: Vec<ArrayBlock> = arrays
        .iter()
        .map(|a| ArrayBlock {
            start: a.start.clone(),
            count: a.count.clone(),
            crc32: crc_of_numbers(a),
        })
        .collect();
    let text = serde_json::to_vec(&mine)
        .map_err(|e| Error::invalid("the blocks of a checkpoint", e.to_string()));
    let all = group.gather(&agree(group, text)?);
    let mut by_array = vec![Vec::with_capacity(all.len()); arrays.len()];
    for bytes in all {
        let blocks: Vec<ArrayBlock> = serde_json::from_slice(&bytes)
            .map_err(|e| Error::invalid("the blocks of a checkpoint", e.to_string()))?;
        for (list, block) in by_array.iter_mut().zip(blocks) {
            list.push(block);
        }
    }
    Ok(by_array)
}

/// Returns the checksum of this rank's numbers, in pieces if they are generated.
fn crc_of_numbers(array: &Array) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    let pieces = hdf::Pieces::new(&array.start, &array.count, array.data.kind().size());
    for round in 0..pieces.rounds() {
        array
            .data
            .show(pieces.range(round), |bytes| sum.update(bytes));
    }
    sum.finalize()
}

fn describe(arrays: &[Array], blocks: &[Vec<ArrayBlock>]) -> Vec<ArrayInfo> {
    arrays
        .iter()
        .zip(blocks)
        .map(|(array, blocks)| ArrayInfo {
            name: array.name.to_owned(),
            kind: array.data.kind(),
            shape: array.shape.clone(),
            blocks: blocks
                .iter()
                .filter(|b| product(&b.count) > 0)
                .cloned()
                .collect(),
        })
        .collect()
}

/// Compares the closed file with memory: each rank compares its own blocks, or rank 0 all of them if it wrote for
/// all. Some MPI-IO layers have written wrong files without an error.
fn read_back(
    part: &Path,
    arrays: &[Array],
    blocks: &[Vec<ArrayBlock>],
    group: &dyn Group,
    mode: Mode,
) -> Result<()> {
    let communicator = hdf::communicator(group, mode);
    let opened = match communicator {
        None if group.rank() > 0 => return Ok(()),
        _ => hdf::open(part, communicator),
    };
    let file = match communicator {
        Some(_) => agree(group, opened).map_err(|e| e.broken(part))?,
        None => opened?,
    };
    // There is no early return: opening a dataset is collective with the MPI driver, so that every rank opens all
    // of them.
    let compare = |array: &Array, blocks: &[ArrayBlock]| -> Result<()> {
        let name = format!("/{}", array.name);
        let dataset = file
            .dataset(&name)
            .map_err(|e| Error::hdf(part, &format!("open {name}"), &e))?;
        for (rank, block) in blocks.iter().enumerate() {
            let mine = communicator.is_none() || rank == group.rank();
            if mine && crc_of(part, &dataset, array.data.kind(), block)? != block.crc32 {
                return Err(Error::corrupt(
                    part,
                    format!("{name} reads back differently from what rank {rank} wrote"),
                ));
            }
        }
        Ok(())
    };
    let mut compared = Ok(());
    for (array, blocks) in arrays.iter().zip(blocks) {
        compared = compared.and(compare(array, blocks));
    }
    let closed = file
        .close()
        .map_err(|e| Error::hdf(part, "close the file", &e));
    compared.and(closed)
}

fn crc_of(path: &Path, dataset: &hdf5::Dataset, kind: Kind, block: &ArrayBlock) -> Result<u32> {
    // The block is read in pieces, so that no memory of the size of the state is needed.
    fn crc<T: Element>(dataset: &hdf5::Dataset, block: &ArrayBlock) -> hdf5::Result<u32> {
        let mut sum = crc32fast::Hasher::new();
        let mut numbers = Vec::new();
        let pieces = hdf::Pieces::new(&block.start, &block.count, size_of::<T>());
        for round in 0..pieces.rounds() {
            let (start, count) = pieces.start_and_count(round);
            numbers.resize(product(&count), T::default());
            hdf::read_box(dataset, &start, &count, &mut numbers)?;
            sum.update(T::data(&numbers).bytes());
        }
        Ok(sum.finalize())
    }
    if product(&block.count) == 0 {
        return Ok(block.crc32);
    }
    match kind {
        Kind::F32 => crc::<f32>(dataset, block),
        Kind::F64 => crc::<f64>(dataset, block),
        Kind::U8 => crc::<u8>(dataset, block),
        Kind::I32 => crc::<i32>(dataset, block),
        Kind::I64 => crc::<i64>(dataset, block),
        Kind::U64 => crc::<u64>(dataset, block),
    }
    .map_err(|e| Error::hdf(path, "read a block back", &e))
}

/// Keeps the last `keep` checkpoints; removes older ones, manifest first, and HDF5 files without a manifest.
fn remove_old(folder: &Path, keep: usize) -> Result<()> {
    let mut known = intact(folder)?;
    known.sort_by_key(|k| std::cmp::Reverse(k.1.serial));
    if known.len() > keep {
        for (path, _) in known.split_off(keep) {
            atomic::remove_if_there(&path)?;
        }
    }
    if known.len() < keep {
        // While there are few checkpoints, even damaged ones are kept for inspection.
        return Ok(());
    }
    let named = |path: &Path| {
        known
            .iter()
            .any(|k| k.0 == path || k.1.data_path(&k.0) == path)
    };
    for path in atomic::files(folder)? {
        let ours = is_ours(&path, "h5")
            || is_ours(&path, "json")
            || is_ours(&path.with_extension(""), "h5");
        if ours && !named(&path) {
            atomic::remove_if_there(&path)?;
        }
    }
    atomic::sync_folder(&folder.join("."))
}

/// Verified checkpoint.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Found {
    /// Path of the manifest.
    pub path: PathBuf,
    /// Contents of the manifest.
    pub manifest: Manifest,
    /// Newer checkpoints that were skipped, each with its fault.
    pub passed_over: Vec<String>,
}

/// Returns the newest checkpoint of a folder that verifies bit by bit. Called by all ranks; rank 0 reads.
///
/// # Errors
/// If there is no valid checkpoint ([`Error::NoCheckpoint`], with the fault of each), or the system cannot read the
/// folder.
pub fn newest(folder: &Path, group: &dyn Group) -> Result<Found> {
    newest_that(folder, group, |_| Ok(()))
}

/// Returns the newest checkpoint, like [`newest`], whose manifest also `fits` the caller's case. `fits` is called
/// before any byte of the file is read.
///
/// # Errors
/// If [`newest`] fails, or if `fits` refuses the newest checkpoint with a valid manifest ([`Error::Invalid`], with
/// the text from `fits`).
pub fn newest_that(
    folder: &Path,
    group: &dyn Group,
    fits: impl Fn(&Manifest) -> std::result::Result<(), String>,
) -> Result<Found> {
    on_root(group, || {
        let mut passed_over = Vec::new();
        let mut candidates = Vec::new();
        for path in manifests(folder)? {
            match Manifest::read(&path) {
                Ok(manifest) => candidates.push((path, manifest)),
                Err(error) => passed_over.push(error.to_string()),
            }
        }
        candidates.sort_by_key(|c| std::cmp::Reverse(c.1.serial));
        for path in atomic::files(folder)? {
            let named = candidates.iter().any(|c| c.1.data_path(&c.0) == path);
            if is_ours(&path, "h5") && !named {
                passed_over.push(format!("{} has no usable manifest", path.display()));
            }
        }
        for (path, manifest) in candidates {
            if let Err(reason) = fits(&manifest) {
                return Err(Error::invalid(&path.display().to_string(), reason));
            }
            match manifest.verify_file(&path) {
                Ok(()) => {
                    log::debug!(
                        "{} of step {} verified, {} bytes",
                        path.display(),
                        manifest.step,
                        manifest.bytes
                    );
                    return Ok(Found {
                        path,
                        manifest,
                        passed_over,
                    });
                }
                Err(error) => passed_over.push(error.to_string()),
            }
        }
        Err(no_checkpoint(folder, &passed_over))
    })
}

/// Returns one named checkpoint, verified bit by bit. Called by all ranks; rank 0 reads.
///
/// # Errors
/// If the checkpoint is damaged ([`Error::Corrupt`], with the difference), or the system refuses an operation.
pub fn verify(manifest: &Path, group: &dyn Group) -> Result<Found> {
    on_root(group, || {
        let link = |known: fs::Metadata| known.is_symlink();
        if fs::symlink_metadata(manifest).is_ok_and(link) {
            return Err(Error::corrupt(manifest, "it is a link to another file"));
        }
        let read = Manifest::read(manifest)?;
        read.verify_file(manifest)?;
        Ok(Found {
            path: manifest.to_owned(),
            manifest: read,
            passed_over: Vec::new(),
        })
    })
}

fn no_checkpoint(folder: &Path, passed_over: &[String]) -> Error {
    let reason = if passed_over.is_empty() {
        String::new()
    } else {
        format!(": {}", passed_over.join("; "))
    };
    Error::NoCheckpoint {
        path: folder.display().to_string(),
        reason,
    }
}

/// Reads boxes of a checkpoint's arrays, on any number of ranks.
pub struct Reader {
    file: hdf5::File,
    path: PathBuf,
    manifest: Manifest,
}

/// Checks that a file contains the arrays of its manifest itself, and not as links or references to other files of
/// unknown content.
fn holds(file: &hdf5::File, manifest: &Manifest) -> hdf5::Result<()> {
    within(file, "", 0, &mut 0)?;
    for array in &manifest.arrays {
        let dataset = file.dataset(&format!("/{}", array.name))?;
        let described = dataset.dcpl()?;
        // An empty array has no storage in the file.
        let whole =
            described.layout() == hdf5::dataset::Layout::Contiguous || array.shape.contains(&0);
        if !whole || !described.external().is_empty() {
            return Err(format!("{} is not stored in one piece", array.name).into());
        }
        if dataset.shape() != array.shape || hdf::kind_of(&dataset)? != Some(array.kind) {
            return Err(format!(
                "{} has the shape {:?} in the file and {:?} in the manifest, or other numbers",
                array.name,
                dataset.shape(),
                array.shape
            )
            .into());
        }
    }
    Ok(())
}

/// Refuses links other than plain names of objects in the same file.
fn within(group: &hdf5::Group, path: &str, depth: usize, seen: &mut usize) -> hdf5::Result<()> {
    let mut names = Vec::new();
    group.iter_visit_default(|name, info| {
        *seen += 1;
        if info.link_type != hdf5::LinkType::Hard || depth > DIMENSIONS || *seen > MAX_NAMES {
            return Err(format!("{path}/{name} is a link, or there are too many objects").into());
        }
        names.push(name.to_owned());
        Ok(())
    })?;
    for name in names {
        if group.loc_type_by_name(&name)? == hdf5::LocationType::Group {
            within(
                &group.group(&name)?,
                &format!("{path}/{name}"),
                depth + 1,
                seen,
            )?;
        }
    }
    Ok(())
}

/// Maximum number of names in the file of a checkpoint.
const MAX_NAMES: usize = 10_000;

impl Reader {
    /// Opens a checkpoint for this rank alone, which then reads independently of other ranks.
    ///
    /// # Errors
    /// [`Error::Hdf`].
    pub fn open(found: &Found) -> Result<Self> {
        let path = found.manifest.data_path(&found.path);
        let file = hdf::open(&path, None)?;
        holds(&file, &found.manifest).map_err(|e| Error::hdf(&path, "use its arrays", &e))?;
        Ok(Self {
            file,
            path,
            manifest: found.manifest.clone(),
        })
    }

    /// Returns the attributes that the caller gave at writing.
    #[must_use]
    pub fn attributes(&self) -> &Value {
        &self.manifest.attributes
    }

    /// Returns an array's shape.
    ///
    /// # Errors
    /// If there is no such array, [`Error::Invalid`].
    pub fn shape(&self, name: &str) -> Result<&[usize]> {
        Ok(&self.info(name)?.shape)
    }

    fn info(&self, name: &str) -> Result<&ArrayInfo> {
        self.manifest
            .arrays
            .iter()
            .find(|a| a.name == name)
            .ok_or_else(|| {
                Error::invalid(name, format!("{} holds no such array", self.path.display()))
            })
    }

    /// Reads a box into a slice of the array's own number type.
    ///
    /// # Errors
    /// If the array is missing, has another number type, or the box or the slice does not fit ([`Error::Invalid`]),
    /// or if the file cannot be read ([`Error::Hdf`]).
    pub fn read_into<T: Element>(
        &self,
        name: &str,
        start: &[usize],
        count: &[usize],
        into: &mut [T],
    ) -> Result<()> {
        self.fits::<T>(name, start, count, into.len())?;
        if product(self.shape(name)?) == 0 {
            return Ok(());
        }
        self.file
            .dataset(&format!("/{name}"))
            .and_then(|dataset| hdf::read_box(&dataset, start, count, into))
            .map_err(|e| Error::hdf(&self.path, &format!("read {name}"), &e))
    }

    fn fits<T: Element>(
        &self,
        name: &str,
        start: &[usize],
        count: &[usize],
        room: usize,
    ) -> Result<()> {
        let info = self.info(name)?;
        if info.kind != T::KIND {
            return Err(Error::invalid(
                name,
                format!(
                    "is {:?} in the checkpoint, {:?} was requested",
                    info.kind,
                    T::KIND
                ),
            ));
        }
        if !hdf::is_inside(start, count, &info.shape) || product(count) != room {
            return Err(Error::invalid(
                name,
                format!(
                    "the box at {start:?} of size {count:?} into {room} numbers does not fit the shape {:?}",
                    info.shape
                ),
            ));
        }
        Ok(())
    }

    /// Reads a box.
    ///
    /// # Errors
    /// If [`Reader::read_into`] fails.
    pub fn read<T: Element>(&self, name: &str, start: &[usize], count: &[usize]) -> Result<Vec<T>> {
        // A box outside the array has no capacity here; it causes an error below.
        let room = match self.shape(name) {
            Ok(shape) if hdf::is_inside(start, count, shape) => product(count),
            _ => 0,
        };
        let mut numbers = vec![T::default(); room];
        self.read_into(name, start, count, &mut numbers)?;
        Ok(numbers)
    }

    /// Reads a box in pieces of some megabytes, in C order: `take` receives the range of each piece in the box, and
    /// its numbers.
    ///
    /// # Errors
    /// If [`Reader::read_into`] or `take` fails.
    pub fn read_in_pieces<T: Element>(
        &self,
        name: &str,
        start: &[usize],
        count: &[usize],
        mut take: impl FnMut(Range<usize>, &[T]) -> Result<()>,
    ) -> Result<()> {
        match self.shape(name) {
            Ok(shape) if hdf::is_inside(start, count, shape) => {}
            _ => self.fits::<T>(name, start, count, product(count))?,
        }
        let pieces = hdf::Pieces::new(start, count, size_of::<T>());
        for round in 0..pieces.rounds() {
            let (start, count) = pieces.start_and_count(round);
            let numbers = self.read::<T>(name, &start, &count)?;
            take(pieces.range(round), &numbers)?;
        }
        Ok(())
    }

    /// Reads a whole array.
    ///
    /// # Errors
    /// If [`Reader::read_into`] fails.
    pub fn read_all<T: Element>(&self, name: &str) -> Result<Vec<T>> {
        let shape = self.shape(name)?.to_vec();
        self.read(name, &vec![0; shape.len()], &shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Alone;
    use crate::data::Data;
    use std::fs::OpenOptions;
    use std::io::{Seek, SeekFrom, Write};

    fn save(folder: &Path, step: u64, keep: usize) -> Result<PathBuf> {
        let position: Vec<f64> = (0..300)
            .map(|i| f64::from(i) + f64::from(u32::try_from(step).unwrap()))
            .collect();
        let id: Vec<u64> = (0..100).collect();
        let arrays = [
            Array {
                name: "particles/position",
                shape: vec![100, 3],
                start: vec![0, 0],
                count: vec![100, 3],
                data: Data::F64(&position).into(),
            },
            Array {
                name: "particles/id",
                shape: vec![100],
                start: vec![0],
                count: vec![100],
                data: Data::U64(&id).into(),
            },
            Array {
                name: "contacts",
                shape: vec![0],
                start: vec![0],
                count: vec![0],
                data: Data::I32(&[]).into(),
            },
        ];
        let attributes = serde_json::json!({"case_hash": "abc", "x": 0.1});
        write(
            folder,
            step,
            0.25,
            &arrays,
            &attributes,
            &Alone,
            Mode::Collective,
            keep,
        )
    }

    fn step_found(folder: &Path) -> u64 {
        newest(folder, &Alone).unwrap().manifest.step
    }

    #[test]
    fn a_state_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        save(dir.path(), 100, 2).unwrap();
        let found = newest(dir.path(), &Alone).unwrap();
        assert!(found.passed_over.is_empty());
        let reader = Reader::open(&found).unwrap();
        assert_eq!(reader.attributes()["case_hash"], "abc");
        assert_eq!(found.manifest.time.to_bits(), 0.25_f64.to_bits());
        assert_eq!(reader.shape("particles/position").unwrap(), [100, 3]);
        let row = reader
            .read::<f64>("particles/position", &[2, 1], &[2, 2])
            .unwrap();
        assert_eq!(row, vec![107.0, 108.0, 110.0, 111.0]);
        let ids = reader.read_all::<u64>("particles/id").unwrap();
        assert_eq!(ids, (0..100).collect::<Vec<u64>>());
        assert!(reader.read_all::<i32>("contacts").unwrap().is_empty());
        assert!(reader.read_all::<f32>("particles/position").is_err());
        assert!(reader.read_all::<f64>("no").is_err());
        assert!(
            reader
                .read::<u64>("particles/id", &[usize::MAX], &[2])
                .is_err()
        );
        let info = crate::fields::inspect(&dir.path().join("checkpoint_000000100.h5")).unwrap();
        assert!(
            info.attribute("/checkpoint/caller", "attributes")
                .unwrap()
                .as_str()
                .unwrap()
                .contains("case_hash")
        );
    }

    /// Checks that numbers generated during writing give the same file as numbers in memory, and are read back in
    /// pieces.
    #[test]
    fn numbers_are_made_in_pieces() {
        let dir = tempfile::tempdir().unwrap();
        let of = |n: usize| f64::from(u32::try_from(n).unwrap()).sqrt();
        // Twelve megabytes, divided between rows of the first axis.
        let shape = vec![40, 13, 3001];
        let count = product(&shape);
        let all: Vec<f64> = (0..count).map(of).collect();
        let made = crate::FunctionSource::new(count, |range, some: &mut Vec<f64>| {
            some.extend(range.map(of));
        });
        let both = [
            Numbers::InMemory(Data::F64(&all)),
            Numbers::Generated(&made),
        ];
        let texts = both.map(|data| {
            let folder = dir
                .path()
                .join(format!("{:?}", matches!(data, Numbers::Generated(_))));
            fs::create_dir(&folder).unwrap();
            let array = Array {
                name: "all",
                shape: shape.clone(),
                start: vec![0; 3],
                count: shape.clone(),
                data,
            };
            let none = Value::Null;
            write(&folder, 1, 0.0, &[array], &none, &Alone, Mode::Gather, 2).unwrap();
            let found = newest(&folder, &Alone).unwrap();
            let reader = Reader::open(&found).unwrap();
            assert_eq!(reader.read_all::<f64>("all").unwrap(), all);
            let (mut next, mut pieces) = (0, 0);
            let (start, size) = ([3, 0, 0], [37, 13, 3001]);
            let read = reader.read_in_pieces("all", &start, &size, |range, some: &[f64]| {
                let from = 3 * 13 * 3001;
                assert_eq!(range.start, next);
                assert_eq!(some, &all[from + range.start..from + range.end]);
                (next, pieces) = (range.end, pieces + 1);
                Ok(())
            });
            read.unwrap();
            assert_eq!((next, pieces), (37 * 13 * 3001, 3));
            let beyond = reader.read_in_pieces("all", &[4, 0, 0], &size, |_, _: &[f64]| Ok(()));
            assert!(beyond.is_err());
            format!("{:?}", found.manifest.arrays)
        });
        assert_eq!(texts[0], texts[1]);
    }

    #[test]
    fn the_last_ones_are_kept() {
        let dir = tempfile::tempdir().unwrap();
        for step in [1, 2, 3, 4] {
            save(dir.path(), step, 0).unwrap();
        }
        let left: Vec<String> = atomic::files(dir.path())
            .unwrap()
            .iter()
            .map(|p| p.file_name().unwrap().to_str().unwrap().to_owned())
            .collect();
        assert_eq!(
            left,
            [
                "checkpoint_000000003.h5",
                "checkpoint_000000003.json",
                "checkpoint_000000004.h5",
                "checkpoint_000000004.json"
            ]
        );
        // After a restart from step 3, a checkpoint written again is newer than that of step 4.
        let again = save(dir.path(), 3, 2).unwrap();
        let found = newest(dir.path(), &Alone).unwrap();
        assert_eq!((found.manifest.step, &found.path), (3, &again));
        assert_eq!(found.manifest.file, "checkpoint_000000003_b.h5");
        assert!(verify(&again, &Alone).is_ok());
        save(dir.path(), 3, 2).unwrap();
        assert_eq!(
            newest(dir.path(), &Alone).unwrap().manifest.file,
            "checkpoint_000000003.h5"
        );
    }

    #[test]
    fn leftovers_of_a_killed_write_do_not_disturb() {
        let dir = tempfile::tempdir().unwrap();
        save(dir.path(), 1, 2).unwrap();
        save(dir.path(), 2, 2).unwrap();
        for name in [
            "checkpoint_000000003.h5.part",
            "checkpoint_000000003.h5",
            "checkpoint_000000003.json.part",
        ] {
            fs::write(dir.path().join(name), b"half").unwrap();
        }
        let found = newest(dir.path(), &Alone).unwrap();
        assert_eq!(found.manifest.step, 2);
        assert!(found.passed_over[0].contains("checkpoint_000000003.h5"));
        save(dir.path(), 3, 2).unwrap();
        assert_eq!(step_found(dir.path()), 3);
        save(dir.path(), 4, 2).unwrap();
        assert!(!dir.path().join("checkpoint_000000003.h5.part").exists());
    }

    #[test]
    fn an_empty_folder_and_a_missing_one_are_told() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(
            newest(dir.path(), &Alone),
            Err(Error::NoCheckpoint { .. })
        ));
        let missing = dir.path().join("no");
        assert!(newest(&missing, &Alone).is_err());
        let error = save(&missing, 1, 2).unwrap_err();
        assert!(error.to_string().contains("/no"), "{error}");
    }

    #[test]
    fn names_of_the_format_are_refused() {
        for name in ["checkpoint/x", "A", "a//b", "a b"] {
            assert!(check_name(name).is_err(), "{name}");
        }
        check_name("fluid/population_0").unwrap();
    }

    /// Small generator with a fixed seed (Knuth's constants), sufficient to distribute damage.
    struct Dice(u64);

    impl Dice {
        fn below(&mut self, n: u64) -> u64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) % n
        }
    }

    /// Checks that flipped bits, truncations and zeroed pages, in the file and in the manifest, are all found, and that
    /// the previous checkpoint is used.
    #[test]
    fn every_damage_is_found() {
        let dir = tempfile::tempdir().unwrap();
        save(dir.path(), 1, 2).unwrap();
        let manifest = save(dir.path(), 2, 2).unwrap();
        let heavy = dir.path().join("checkpoint_000000002.h5");
        let mut dice = Dice(2);
        for path in [&heavy, &manifest] {
            let whole = fs::read(path).unwrap();
            let length = whole.len() as u64;
            let found = |what: &str| {
                let found = newest(dir.path(), &Alone).unwrap();
                assert_eq!(found.manifest.step, 1, "{what} in {}", path.display());
                assert!(!found.passed_over.is_empty());
            };
            for _ in 0..500 {
                let (at, bit) = (dice.below(length), dice.below(8));
                let byte = whole[usize::try_from(at).unwrap()] ^ (1 << bit);
                let mut file = OpenOptions::new().write(true).open(path).unwrap();
                file.seek(SeekFrom::Start(at)).unwrap();
                file.write_all(&[byte]).unwrap();
                found(&format!("bit {bit} of byte {at}"));
                file.seek(SeekFrom::Start(at)).unwrap();
                file.write_all(&[byte ^ (1 << bit)]).unwrap();
            }
            assert_eq!(step_found(dir.path()), 2);
            for _ in 0..200 {
                let at = dice.below(length);
                fs::write(path, &whole[..usize::try_from(at).unwrap()]).unwrap();
                found(&format!("cut at {at}"));
            }
            for page in 0..whole.len().div_ceil(4096) {
                let mut zeroed = whole.clone();
                let end = (4096 * (page + 1)).min(zeroed.len());
                zeroed[4096 * page..end].fill(0);
                if zeroed == whole {
                    continue;
                }
                fs::write(path, &zeroed).unwrap();
                found(&format!("page {page} zeroed"));
            }
            fs::write(path, [&whole[..], b"\0"].concat()).unwrap();
            found("one byte more");
            fs::remove_file(path).unwrap();
            found("missing");
            fs::write(path, &whole).unwrap();
            assert_eq!(step_found(dir.path()), 2);
        }
        // Two files are exchanged: both manifests are refused.
        let first = dir.path().join("checkpoint_000000001.h5");
        fs::rename(&heavy, dir.path().join("x")).unwrap();
        fs::rename(&first, &heavy).unwrap();
        fs::rename(dir.path().join("x"), &first).unwrap();
        let error = newest(dir.path(), &Alone).unwrap_err();
        assert!(error.to_string().contains("differs"), "{error}");
        assert!(verify(&manifest, &Alone).is_err());
    }
}
