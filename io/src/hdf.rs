//! One HDF5 file written by several ranks, each of which has a box of every dataset.
//!
//! [`Mode::Collective`] uses the MPI driver of HDF5 with collective transfers. [`Mode::Gather`] sends everything
//! piece by piece to rank 0, which writes with the serial driver; it is for parallel file systems or MPI-IO layers
//! with faults. Both give the same datasets, byte for byte.
//!
//! A file is built as [`Content`], data first. [`write()`] writes it in a sequence of agreed steps: space, create,
//! groups, datasets, flush, close, flush to disk, rename. The MPI driver refuses to close a file while a handle to an
//! object in it is open, and `Drop` hides this. Handles are therefore dropped early and `close` is explicit.

use std::ffi::c_void;
use std::mem::ManuallyDrop;
use std::ops::Range;
use std::path::Path;

use hdf5::dataset::{AllocTime, FillTime};
use hdf5::file::FileCloseDegree;
use hdf5::sync::sync;
use hdf5::types::TypeDescriptor;
use hdf5::{Dataset, Dataspace, File, Location};
use hdf5_sys::h5d::{H5Dread, H5Dwrite};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{H5FD_mpio_xfer_t, H5Pclose, H5Pcreate, H5Pset_dxpl_mpio};
use hdf5_sys::h5s::{H5S_seloper_t, H5Sselect_hyperslab, H5Sselect_none};

use crate::atomic;
use crate::data::{Data, Kind, Numbers, index};
use crate::error::{Error, Result};
use crate::group::{Group, agree, on_root};
use crate::plain;

/// Method by which several ranks write one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Mode {
    /// All ranks write together through MPI-IO.
    #[default]
    Collective,
    /// Rank 0 writes with the serial driver.
    Gather,
}

/// Returns the version of the HDF5 library that this program is linked with.
#[must_use]
pub fn version() -> String {
    let (major, minor, patch) = hdf5::library_version();
    format!("{major}.{minor}.{patch}")
}

/// Returns the optional features of the linked HDF5: `mpio`, writing of one file by all ranks through MPI, without
/// which this crate does not build, and `threadsafe`.
#[must_use]
pub fn features() -> Vec<&'static str> {
    let mut features = vec!["mpio"];
    if hdf5::is_library_threadsafe() {
        features.push("threadsafe");
    }
    features
}

impl Mode {
    /// Returns the communicator for the MPI driver if this mode and this group use it. A single rank writes
    /// serially: the bytes are the same, and closing after an error cannot hang.
    fn communicator(self, group: &dyn Group) -> Option<mpi_sys::MPI_Comm> {
        match self {
            Self::Collective if group.size() > 1 => group.raw(),
            _ => None,
        }
    }
}

/// Attribute of a group or dataset.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// Text, UTF-8, at most [`LONGEST_TEXT`] bytes.
    Text(String),
    /// One integer.
    Int(i64),
    /// One number.
    Float(f64),
    /// A list of integers.
    Ints(Vec<i64>),
    /// A list of numbers.
    Floats(Vec<f64>),
}

/// Maximum length of a text attribute, which must fit into its object's header (64 KiB); longer texts become byte
/// datasets.
pub const LONGEST_TEXT: usize = 32_000;

/// Group with its attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct Folder {
    /// Path from the root: `/VTKHDF/CellData`.
    pub path: String,
    /// Attributes of the group.
    pub attributes: Vec<(String, Attribute)>,
}

/// Dataset with this rank's box of it.
#[derive(Clone, Debug)]
pub struct DatasetPart<'a> {
    /// Path from the root: `/VTKHDF/CellData/velocity`.
    pub path: String,
    /// Shape of the whole dataset, the same on all ranks.
    pub shape: Vec<usize>,
    /// First index of this rank's box along each axis.
    pub start: Vec<usize>,
    /// Size of this rank's box along each axis; a box with a zero is empty.
    pub count: Vec<usize>,
    /// Numbers of this rank's box in C order.
    pub data: Numbers<'a>,
    /// Attributes, the same on all ranks.
    pub attributes: Vec<(String, Attribute)>,
}

/// Contents of one file. Intermediate groups on the path to a dataset need no entry.
#[derive(Clone, Debug, Default)]
pub struct Content<'a> {
    /// Groups, parents first.
    pub folders: Vec<Folder>,
    /// Datasets with the parts of this rank.
    pub parts: Vec<DatasetPart<'a>>,
}

impl<'a> Content<'a> {
    /// Adds a group.
    pub fn folder(&mut self, path: &str, attributes: &[(&str, Attribute)]) {
        self.folders.push(Folder {
            path: path.to_owned(),
            attributes: attributes
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.clone()))
                .collect(),
        });
    }

    /// Adds a group of texts, the same on all ranks: attributes, or byte datasets for the long ones (a case text).
    pub fn texts(&mut self, path: &str, texts: &'a [(String, String)], group: &dyn Group) {
        let (short, long): (Vec<_>, Vec<_>) = texts.iter().partition(|t| t.1.len() <= LONGEST_TEXT);
        self.folders.push(Folder {
            path: path.to_owned(),
            attributes: short
                .into_iter()
                .map(|(name, text)| (name.clone(), Attribute::Text(text.clone())))
                .collect(),
        });
        for (name, text) in long {
            let bytes = text.as_bytes();
            let mine = if group.rank() == 0 { bytes } else { &[] };
            self.parts.push(DatasetPart {
                path: format!("{path}/{name}"),
                shape: vec![bytes.len()],
                start: vec![0],
                count: vec![mine.len()],
                data: Data::U8(mine).into(),
                attributes: vec![("encoding".to_owned(), Attribute::Text("utf-8".to_owned()))],
            });
        }
    }

    /// Returns the number of bytes of all datasets plus an upper bound of the metadata.
    fn bytes(&self) -> u64 {
        let data: u64 = self
            .parts
            .iter()
            .map(|p| (product(&p.shape) * p.data.kind().size()) as u64)
            .sum();
        let headers = 64 * 1024 + 2048 * (self.parts.len() + self.folders.len()) as u64;
        let texts: u64 = self
            .folders
            .iter()
            .flat_map(|f| &f.attributes)
            .map(|a| match &a.1 {
                Attribute::Text(text) => text.len() as u64,
                _ => 64,
            })
            .sum();
        data + headers + texts
    }

    /// Checks that all ranks describe the same file, every box fits its dataset, and the boxes fill it.
    fn check(&self, group: &dyn Group) -> Result<()> {
        agree(group, self.parts.iter().try_for_each(DatasetPart::check))?;
        let mut description = format!("{:?}", self.folders);
        for part in &self.parts {
            description.push_str(&format!(
                "{:?}",
                (&part.path, &part.shape, part.data.kind(), &part.attributes)
            ));
        }
        let all = group.gather(blake3::hash(description.as_bytes()).as_bytes());
        if all.windows(2).any(|pair| pair[0] != pair[1]) {
            return Err(Error::invalid(
                "the content of a file",
                "differs from rank to rank",
            ));
        }
        for part in &self.parts {
            let (_, held) = group.offset_and_total(product(&part.count) as u64);
            if index(held)? != product(&part.shape) {
                return Err(Error::invalid(
                    &part.path,
                    format!("the ranks hold {held} numbers of a shape {:?}", part.shape),
                ));
            }
        }
        Ok(())
    }
}

impl DatasetPart<'_> {
    /// Returns the pieces for writing: numbers in memory as a whole, generated ones piece by piece.
    fn pieces(&self) -> Pieces {
        match self.data {
            Numbers::InMemory(_) => Pieces::whole(&self.start, &self.count),
            Numbers::Generated(_) => Pieces::new(&self.start, &self.count, self.data.kind().size()),
        }
    }

    fn check(&self) -> Result<()> {
        let axes = self.shape.len();
        if axes == 0 || self.start.len() != axes || self.count.len() != axes {
            return Err(Error::invalid(
                &self.path,
                "shape, start and count differ in length",
            ));
        }
        if !is_inside(&self.start, &self.count, &self.shape) {
            return Err(Error::invalid(
                &self.path,
                format!(
                    "the box at {:?} of size {:?} extends beyond the shape {:?}",
                    self.start, self.count, self.shape
                ),
            ));
        }
        if product(&self.count) != self.data.count() {
            return Err(Error::invalid(
                &self.path,
                format!("{} numbers for a box {:?}", self.data.count(), self.count),
            ));
        }
        Ok(())
    }
}

/// Returns `true` if a box is inside a shape; an empty box is inside every shape.
pub(crate) fn is_inside(start: &[usize], count: &[usize], shape: &[usize]) -> bool {
    start.len() == shape.len()
        && count.len() == shape.len()
        && (product(count) == 0
            || (0..shape.len()).all(|a| {
                start[a]
                    .checked_add(count[a])
                    .is_some_and(|end| end <= shape[a])
            }))
}

pub(crate) fn product(shape: &[usize]) -> usize {
    // The product saturates, so that an absurd shape is refused by comparison instead of an overflow.
    shape.iter().fold(1, |n, &m| n.saturating_mul(m))
}

/// Writes a file: under its `.part` name, closed, flushed to the disk, renamed. Called by all ranks of the group.
///
/// # Errors
/// If a step fails; the error is the same on all ranks: [`Error::Space`], [`Error::Io`] or [`Error::Invalid`]
/// before anything is written, [`Error::Broken`] if writing failed midway and the caller must abort (see
/// [`Group::give_up`]). No error changes an older file of this name.
pub fn write(path: &Path, content: &Content, group: &dyn Group, mode: Mode) -> Result<()> {
    write_part(path, content, group, mode)?;
    publish(path, group)
}

/// Writes all data up to the closed, complete `.part` file.
pub(crate) fn write_part(
    path: &Path,
    content: &Content,
    group: &dyn Group,
    mode: Mode,
) -> Result<()> {
    let begun = std::time::Instant::now();
    content.check(group)?;
    let part = atomic::part_of(path);
    // One rank checks for a full disk, a missing folder or missing permissions, before all open the file together.
    on_root(group, || {
        atomic::remove_if_there(&part)?;
        atomic::require_space(path, content.bytes())?;
        atomic::probe(&part, content.bytes())
    })?;
    match mode.communicator(group) {
        Some(communicator) => {
            let written = write_together(&part, content, group, communicator);
            // MPI tests locks with a separate file and may not remove it.
            let test = part.with_extension("part.locktest");
            on_root(group, || atomic::remove_if_there(&test))?;
            written
        }
        None => write_through_root(&part, content, group).map_err(|e| e.broken(&part)),
    }?;
    if group.rank() == 0 {
        log::debug!(
            "{}: {} datasets, at most {} bytes, written by {} rank(s) in {:.3} s",
            part.display(),
            content.parts.len(),
            content.bytes(),
            group.size(),
            begun.elapsed().as_secs_f64()
        );
    }
    Ok(())
}

/// Gives a complete `.part` file its final name.
pub(crate) fn publish(path: &Path, group: &dyn Group) -> Result<()> {
    on_root(group, || atomic::publish(&atomic::part_of(path), path))
}

fn write_together(
    part: &Path,
    content: &Content,
    group: &dyn Group,
    communicator: mpi_sys::MPI_Comm,
) -> Result<()> {
    // From here on a failure on one rank leaves handles that cannot be closed without the others. They are leaked
    // (ManuallyDrop) and the caller must abort, immediately if the group can do so.
    let together = |done: Result<()>| {
        let done = done.map_err(|e| e.broken(part));
        if let Err(error) = &done {
            group.give_up(error);
        }
        agree(group, done)
    };
    let mut file = None;
    together(
        File::with_options()
            .with_fapl(|access| {
                access
                    .mpio(communicator, None)
                    .all_coll_metadata_ops(true)
                    .coll_metadata_write(true)
            })
            .create(part)
            .map(|opened| file = Some(ManuallyDrop::new(opened)))
            .map_err(|e| Error::hdf(part, "create the file on all ranks", &e)),
    )?;
    let Some(file) = file else {
        return Err(Error::invalid("the file", "was created but is not there"));
    };
    for folder in &content.folders {
        together(make_folder(&file, folder).map_err(|e| Error::hdf(part, &folder.path, &e)))?;
    }
    let mut datasets = ManuallyDrop::new(Vec::with_capacity(content.parts.len()));
    for piece in &content.parts {
        together(
            make_dataset(&file, piece)
                .map(|made| datasets.push(made))
                .map_err(|e| Error::hdf(part, &format!("create {}", piece.path), &e)),
        )?;
    }
    // An MPI-IO layer may suppress the error of a disk that becomes full during writing (Open MPI's OMPIO 4.1), so
    // that the disk space is allocated first.
    agree(
        group,
        match group.rank() {
            0 => atomic::hold(part, content.bytes()).map_err(|e| e.broken(part)),
            _ => Ok(()),
        },
    )?;
    for (dataset, piece) in datasets.iter().zip(&content.parts) {
        if product(&piece.shape) == 0 {
            continue;
        }
        let pieces = piece.pieces();
        let rounds = match piece.data {
            Numbers::InMemory(_) => 1,
            Numbers::Generated(_) => maximum_of_ranks(group, pieces.rounds())?,
        };
        for round in 0..rounds {
            together(write_piece(
                part,
                dataset,
                piece,
                &pieces,
                round,
                Transfer::Collective,
            ))?;
        }
    }
    drop(ManuallyDrop::into_inner(datasets));
    together(
        file.flush()
            .map_err(|e| Error::hdf(part, "flush the file", &e)),
    )?;
    together(
        ManuallyDrop::into_inner(file)
            .close()
            .map_err(|e| Error::hdf(part, "close the file", &e)),
    )
}

fn write_through_root(part: &Path, content: &Content, group: &dyn Group) -> Result<()> {
    let mut file = None;
    let mut made = Ok(());
    if group.rank() == 0 {
        made = File::with_options()
            .with_fapl(|access| access.fclose_degree(FileCloseDegree::Semi))
            .create(part)
            .map(ManuallyDrop::new)
            .and_then(|opened| {
                let mut folders = content.folders.iter();
                let done = folders.try_for_each(|folder| make_folder(&opened, folder));
                file = Some(opened);
                done
            })
            .map_err(|e| Error::hdf(part, "create the file", &e));
    }
    agree(group, made)?;
    for piece in &content.parts {
        // A file after a failed write is not closed but leaked: HDF5 cannot flush it, and version 1.10 crashes at
        // its shutdown after such a close.
        agree(group, gather_dataset(part, file.as_deref(), piece, group))?;
    }
    let closed = match file {
        None => Ok(()),
        Some(file) => file
            .flush()
            .and_then(|()| ManuallyDrop::into_inner(file).close()),
    };
    agree(
        group,
        closed.map_err(|e| Error::hdf(part, "close the file", &e)),
    )
}

/// Writes a piece of a rank's part of a dataset.
fn write_piece(
    path: &Path,
    dataset: &Dataset,
    part: &DatasetPart,
    pieces: &Pieces,
    round: usize,
    transfer: Transfer,
) -> Result<()> {
    let (start, count) = pieces.start_and_count(round);
    let written = part.data.show(pieces.range(round), |bytes| {
        write_box(dataset, &start, &count, bytes, transfer)
    });
    written
        .unwrap_or_else(|| write_box(dataset, &start, &count, &[], transfer))
        .map_err(|e| Error::hdf(path, &format!("write {}", part.path), &e))
}

/// Returns the maximum of a number over the ranks.
fn maximum_of_ranks(group: &dyn Group, mine: usize) -> Result<usize> {
    let mut largest = 0;
    for bytes in group.gather(&(mine as u64).to_le_bytes()) {
        largest = largest.max(index(
            bytes.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b)),
        )?);
    }
    Ok(largest)
}

/// Size of one message to rank 0 in bytes: it limits the memory of rank 0 to this times the number of ranks.
const PIECE: usize = 4 << 20;

/// Sends one dataset in pieces to rank 0. After an error on rank 0 the messages continue, so that no rank waits.
fn gather_dataset(
    path: &Path,
    file: Option<&File>,
    part: &DatasetPart,
    group: &dyn Group,
) -> Result<()> {
    let made = file.map(|f| {
        make_dataset(f, part)
            .map(ManuallyDrop::new)
            .map_err(|e| Error::hdf(path, &format!("create {}", part.path), &e))
    });
    let (dataset, created) = match made.transpose() {
        Ok(dataset) => (dataset, Ok(())),
        Err(error) => (None, Err(error)),
    };
    let written = created.and(gather_numbers(path, dataset.as_deref(), part, group));
    if written.is_ok()
        && let Some(dataset) = dataset
    {
        drop(ManuallyDrop::into_inner(dataset));
    }
    written
}

/// Sends the numbers of one dataset; rank 0 without a dataset receives and discards them.
fn gather_numbers(
    path: &Path,
    dataset: Option<&Dataset>,
    part: &DatasetPart,
    group: &dyn Group,
) -> Result<()> {
    let mut first = Ok(());
    if group.size() == 1 {
        if let Some(dataset) = dataset
            && product(&part.shape) > 0
        {
            let pieces = part.pieces();
            return (0..pieces.rounds()).try_for_each(|round| {
                write_piece(path, dataset, part, &pieces, round, Transfer::Independent)
            });
        }
        return first;
    }
    let corner: Vec<u8> = part
        .start
        .iter()
        .chain(&part.count)
        .flat_map(|&n| (n as u64).to_le_bytes())
        .collect();
    let size = part.data.kind().size();
    let mut boxes = Vec::new();
    for bytes in group.gather(&corner) {
        let numbers: Vec<usize> = bytes
            .chunks_exact(8)
            .map(|c| index(c.iter().rev().fold(0_u64, |n, &b| n << 8 | u64::from(b))))
            .collect::<Result<_>>()?;
        let (start, count) = numbers.split_at(part.shape.len());
        boxes.push(Pieces::new(start, count, size));
    }
    let rounds = boxes.iter().map(|b| b.rounds).max().unwrap_or(0);
    let mine = &boxes[group.rank()];
    for round in 0..rounds {
        let all = part
            .data
            .show(mine.range(round), |bytes| group.gather(bytes))
            .unwrap_or_else(|| group.gather(&[]));
        let Some(dataset) = dataset else { continue };
        for (pieces, bytes) in boxes.iter().zip(&all) {
            if first.is_ok() && !bytes.is_empty() {
                let (start, count) = pieces.start_and_count(round);
                first = write_box(dataset, &start, &count, bytes, Transfer::Independent)
                    .map_err(|e| Error::hdf(path, &format!("write {}", part.path), &e));
            }
        }
    }
    first
}

/// Box divided along its first axis longer than one, so that each piece is contiguous.
pub(crate) struct Pieces {
    start: Vec<usize>,
    count: Vec<usize>,
    axis: usize,
    /// Number of numbers of a row, and number of rows of a piece.
    row: usize,
    rows: usize,
    rounds: usize,
}

impl Pieces {
    /// Returns the pieces of a box, given the size of a number in bytes.
    pub(crate) fn new(start: &[usize], count: &[usize], size: usize) -> Self {
        let axis = count.iter().position(|&n| n != 1).unwrap_or(0);
        let row = product(&count[axis + 1..]);
        Self::of_rows(start, count, row, PIECE / (row * size).max(1))
    }

    /// Returns the box as one piece.
    fn whole(start: &[usize], count: &[usize]) -> Self {
        let axis = count.iter().position(|&n| n != 1).unwrap_or(0);
        Self::of_rows(start, count, product(&count[axis + 1..]), count[axis])
    }

    fn of_rows(start: &[usize], count: &[usize], row: usize, rows: usize) -> Self {
        let axis = count.iter().position(|&n| n != 1).unwrap_or(0);
        let rows = rows.max(1);
        let rounds = if product(count) == 0 {
            0
        } else {
            count[axis].div_ceil(rows)
        };
        Self {
            start: start.to_vec(),
            count: count.to_vec(),
            axis,
            row,
            rows,
            rounds,
        }
    }

    /// Returns the number of pieces.
    pub(crate) fn rounds(&self) -> usize {
        self.rounds
    }

    fn span(&self, round: usize) -> (usize, usize) {
        if round >= self.rounds {
            return (0, 0);
        }
        let from = round * self.rows;
        (from, (from + self.rows).min(self.count[self.axis]))
    }

    /// Returns the range of numbers of the box in a piece.
    pub(crate) fn range(&self, round: usize) -> Range<usize> {
        let (from, to) = self.span(round);
        from * self.row..to * self.row
    }

    /// Returns start and size of a piece.
    pub(crate) fn start_and_count(&self, round: usize) -> (Vec<usize>, Vec<usize>) {
        let (from, to) = self.span(round);
        let (mut start, mut count) = (self.start.clone(), self.count.clone());
        start[self.axis] += from;
        count[self.axis] = to - from;
        (start, count)
    }
}

fn make_folder(file: &File, folder: &Folder) -> hdf5::Result<()> {
    let group = file.create_group(&folder.path)?;
    set_attributes(&group, &folder.attributes)
}

fn make_dataset(file: &File, part: &DatasetPart) -> hdf5::Result<Dataset> {
    let dataset = file
        .new_dataset_builder()
        .empty_as(part.data.kind().descriptor())
        .shape(part.shape.clone())
        .alloc_time(Some(AllocTime::Early))
        .fill_time(FillTime::Never)
        .create(part.path.as_str())?;
    set_attributes(&dataset, &part.attributes)?;
    Ok(dataset)
}

fn set_attributes(place: &Location, attributes: &[(String, Attribute)]) -> hdf5::Result<()> {
    for (name, value) in attributes {
        let name = name.as_str();
        match value {
            Attribute::Int(n) => place.new_attr::<i64>().create(name)?.write_scalar(n)?,
            Attribute::Float(x) => place.new_attr::<f64>().create(name)?.write_scalar(x)?,
            Attribute::Ints(v) => place
                .new_attr::<i64>()
                .shape(v.len())
                .create(name)?
                .write_raw(v)?,
            Attribute::Floats(v) => place
                .new_attr::<f64>()
                .shape(v.len())
                .create(name)?
                .write_raw(v)?,
            Attribute::Text(text) => set_text(place, name, text)?,
        }
    }
    Ok(())
}

/// Writes a string of fixed length: strings of variable length are stored in HDF5's global heap, which several
/// ranks cannot share.
fn set_text(place: &Location, name: &str, text: &str) -> hdf5::Result<()> {
    if text.len() > LONGEST_TEXT {
        return Err(format!("the text {name} has {} bytes", text.len()).into());
    }
    let bytes = if text.is_empty() {
        &[0][..]
    } else {
        text.as_bytes()
    };
    let kind = if text.is_ascii() {
        TypeDescriptor::FixedAscii(bytes.len())
    } else {
        TypeDescriptor::FixedUnicode(bytes.len())
    };
    let attribute = place.new_attr_builder().empty_as(&kind).create(name)?;
    let memory = attribute.dtype()?;
    // SAFETY: both handles are open, and the attribute's type is a string of exactly `bytes.len()` bytes.
    let code = sync(|| unsafe {
        hdf5_sys::h5a::H5Awrite(attribute.id(), memory.id(), bytes.as_ptr().cast::<c_void>())
    });
    hdf5::h5check(code).map(|_| ())
}

/// Transfer mode of the MPI driver; the serial driver supports only the independent one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Transfer {
    Independent,
    Collective,
}

/// List of transfer properties that closes itself.
struct TransferList(hid_t);

impl TransferList {
    fn new(transfer: Transfer) -> hdf5::Result<Self> {
        let class = *hdf5::globals::H5P_DATASET_XFER;
        // SAFETY: the class is one of the library's own, valid once the library is open, which `sync` ensures.
        let list = Self(hdf5::h5check(sync(|| unsafe { H5Pcreate(class) }))?);
        if transfer == Transfer::Collective {
            // SAFETY: the list was just created as a list of transfer properties.
            hdf5::h5check(sync(|| unsafe {
                H5Pset_dxpl_mpio(list.0, H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE)
            }))?;
        }
        Ok(list)
    }
}

impl Drop for TransferList {
    fn drop(&mut self) {
        // SAFETY: the list was created here and is closed only here.
        sync(|| unsafe { H5Pclose(self.0) });
    }
}

/// Returns the dataspaces of file and memory with one box selected, or with an empty selection for an empty box.
fn select(
    dataset: &Dataset,
    start: &[usize],
    count: &[usize],
) -> hdf5::Result<(Dataspace, Dataspace)> {
    let space = dataset.space()?;
    let shape = space.shape();
    if !is_inside(start, count, &shape) {
        return Err(
            format!("the box at {start:?} of size {count:?} is not in a shape {shape:?}").into(),
        );
    }
    if product(count) == 0 {
        let memory = Dataspace::try_new(1)?;
        // SAFETY: both dataspaces are open and owned here.
        hdf5::h5check(sync(|| unsafe {
            H5Sselect_none(space.id()).min(H5Sselect_none(memory.id()))
        }))?;
        return Ok((space, memory));
    }
    let memory = Dataspace::try_new(count.to_vec())?;
    let start: Vec<u64> = start.iter().map(|&n| n as u64).collect();
    let count: Vec<u64> = count.iter().map(|&n| n as u64).collect();
    // SAFETY: the dataspace is open; start and count have one entry per axis of it (checked above), and null stride
    // and block mean 1.
    hdf5::h5check(sync(|| unsafe {
        H5Sselect_hyperslab(
            space.id(),
            H5S_seloper_t::H5S_SELECT_SET,
            start.as_ptr(),
            std::ptr::null(),
            count.as_ptr(),
            std::ptr::null(),
        )
    }))?;
    Ok((space, memory))
}

/// Writes one box from bytes that have the dataset's own type.
fn write_box(
    dataset: &Dataset,
    start: &[usize],
    count: &[usize],
    bytes: &[u8],
    transfer: Transfer,
) -> hdf5::Result<()> {
    let kind = dataset.dtype()?;
    if product(count) * kind.size() != bytes.len() {
        return Err(format!("{} bytes for a box {count:?}", bytes.len()).into());
    }
    let list = TransferList::new(transfer)?;
    let (space, memory) = select(dataset, start, count)?;
    // SAFETY: all handles are open; the memory's dataspace has product(count) elements of the dataset's type, which is
    // the length of `bytes` (checked above). Without conversion HDF5 only copies, so alignment does not matter.
    let code = sync(|| unsafe {
        H5Dwrite(
            dataset.id(),
            kind.id(),
            memory.id(),
            space.id(),
            list.0,
            bytes.as_ptr().cast::<c_void>(),
        )
    });
    hdf5::h5check(code).map(|_| ())
}

/// Reads one box, converted to `T`.
pub(crate) fn read_box<T: crate::Element>(
    dataset: &Dataset,
    start: &[usize],
    count: &[usize],
    into: &mut [T],
) -> hdf5::Result<()> {
    if product(count) != into.len() {
        return Err(format!("a buffer of {} numbers for a box {count:?}", into.len()).into());
    }
    let kind = hdf5::Datatype::from_descriptor(&T::KIND.descriptor())?;
    let list = TransferList::new(Transfer::Independent)?;
    let (space, memory) = select(dataset, start, count)?;
    // SAFETY: all handles are open; the memory's dataspace has product(count) elements of type T, the length of `into`
    // (checked above), and every bit pattern is a T (Element is sealed).
    let code = sync(|| unsafe {
        H5Dread(
            dataset.id(),
            kind.id(),
            memory.id(),
            space.id(),
            list.0,
            into.as_mut_ptr().cast::<c_void>(),
        )
    });
    hdf5::h5check(code).map(|_| ())
}

/// Opens a complete file for reading: together through the MPI driver, or on each rank separately.
pub(crate) fn open(path: &Path, communicator: Option<mpi_sys::MPI_Comm>) -> Result<File> {
    let opened = match communicator {
        Some(communicator) => File::with_options()
            .with_fapl(|access| access.mpio(communicator, None).all_coll_metadata_ops(true))
            .open(path),
        // Mode Semi: an open handle is an error at closing, like with the MPI driver, instead of a file that
        // remains open.
        None => {
            plain::open(path, u64::MAX)?;
            File::with_options()
                .with_fapl(|access| access.fclose_degree(FileCloseDegree::Semi))
                .open(path)
        }
    };
    opened.map_err(|e| Error::hdf(path, "open the file", &e))
}

pub(crate) fn communicator(group: &dyn Group, mode: Mode) -> Option<mpi_sys::MPI_Comm> {
    mode.communicator(group)
}

/// Returns the dataset's number type, if it is one of this crate's.
pub(crate) fn kind_of(dataset: &Dataset) -> hdf5::Result<Option<Kind>> {
    // A type unknown to this crate (for example a compound) has no descriptor, which is not an error.
    Ok(dataset
        .dtype()?
        .to_descriptor()
        .ok()
        .and_then(|d| Kind::from_descriptor(&d)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Alone;

    fn part<'a>(path: &str, shape: &[usize], data: Data<'a>) -> DatasetPart<'a> {
        DatasetPart {
            path: path.to_owned(),
            shape: shape.to_vec(),
            start: vec![0; shape.len()],
            count: shape.to_vec(),
            data: data.into(),
            attributes: vec![("units".to_owned(), Attribute::Text("m/s²".to_owned()))],
        }
    }

    #[test]
    fn content_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.h5");
        let numbers: Vec<f64> = (0..24).map(f64::from).collect();
        let long = [
            ("case".to_owned(), "x".repeat(LONGEST_TEXT + 1)),
            ("empty".to_owned(), String::new()),
        ];
        let mut content = Content::default();
        content.folder("/a", &[("n", Attribute::Ints(vec![1, 2]))]);
        content.texts("/provenance", &long, &Alone);
        content
            .parts
            .push(part("/a/b/numbers", &[2, 3, 4], Data::F64(&numbers)));
        content
            .parts
            .push(part("/nothing", &[0, 3], Data::I32(&[])));
        write(&path, &content, &Alone, Mode::Collective).unwrap();
        assert!(!atomic::part_of(&path).exists());
        let file = open(&path, None).unwrap();
        let dataset = file.dataset("/a/b/numbers").unwrap();
        let mut box_ = [0_i64; 4];
        read_box(&dataset, &[1, 1, 0], &[1, 2, 2], &mut box_).unwrap();
        assert_eq!(box_, [16, 17, 20, 21]);
        let mut outside = [0.0_f64; 4];
        assert!(read_box(&dataset, &[2, 1, 0], &[1, 2, 2], &mut outside,).is_err());
        assert_eq!(file.dataset("/nothing").unwrap().shape(), vec![0, 3]);
        let text: Vec<u8> = file
            .dataset("/provenance/case")
            .unwrap()
            .read_raw()
            .unwrap();
        assert_eq!(text.len(), LONGEST_TEXT + 1);
    }

    #[test]
    fn the_same_content_gives_the_same_file() {
        let dir = tempfile::tempdir().unwrap();
        let numbers = [1.0_f32; 10];
        let mut content = Content::default();
        content.parts.push(part("/x", &[10], Data::F32(&numbers)));
        for name in ["a", "b"] {
            write(&dir.path().join(name), &content, &Alone, Mode::Gather).unwrap();
        }
        assert_eq!(
            std::fs::read(dir.path().join("a")).unwrap(),
            std::fs::read(dir.path().join("b")).unwrap()
        );
    }

    #[test]
    fn what_does_not_fit_is_refused_before_a_file_appears() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.h5");
        let numbers = [0.0_f32; 10];
        let mut short = part("/x", &[11], Data::F32(&numbers));
        let refuse = |p: &DatasetPart| {
            let content = Content {
                folders: vec![],
                parts: vec![p.clone()],
            };
            let error = write(&path, &content, &Alone, Mode::Collective).unwrap_err();
            assert!(matches!(error, Error::Invalid { .. }), "{error}");
            assert_eq!(atomic::files(dir.path()).unwrap().len(), 0);
        };
        refuse(&short);
        short.count = vec![10];
        refuse(&short); // fits its box, leaves a hole in the dataset
        short.start = vec![2];
        refuse(&short); // leaves the dataset
        short.start = vec![0, 0];
        refuse(&short);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("no").join("a.h5");
        let error = write(&path, &Content::default(), &Alone, Mode::Gather).unwrap_err();
        assert!(error.to_string().contains("/no"), "{error}");
        assert!(!error.must_abort());
    }

    #[test]
    fn pieces_cover_a_box_once() {
        for count in [
            vec![1, 1, 7_000_000],
            vec![5, 1000, 1000],
            vec![1, 3, 2],
            vec![0, 4, 4],
            vec![1, 1, 1],
        ] {
            let pieces = Pieces::new(&[0; 3], &count, 8);
            let mut next = 0;
            for round in 0..pieces.rounds + 2 {
                let range = pieces.range(round);
                if !range.is_empty() {
                    assert_eq!(range.start, next);
                    assert_eq!(product(&pieces.start_and_count(round).1), range.len());
                    next = range.end;
                }
            }
            assert_eq!(next, product(&count));
            let whole = Pieces::whole(&[0; 3], &count);
            assert_eq!(whole.range(0), 0..product(&count));
            assert_eq!(whole.rounds(), product(&count).min(1));
        }
    }
}
