//! Blocks in a legacy VTK file as text: a data set `UNSTRUCTURED_GRID` of tetrahedra and polyhedra, one cell for each
//! block, as `UnBlocks-Gen` (L. L. Rasmussen, Comput. Geotech. 118 (2020) 103328) and ParaView write them.
//!
//! ```text
//! POINTS n float      x y z of each point
//! CELLS m size        for each cell the number of values that follow, then the points of a tetrahedron, or the
//!                     number of faces of a polyhedron and for each face its number of points and these points
//! CELL_TYPES m        10 for a tetrahedron, 42 for a polyhedron
//! ```
//!
//! Fields of points and cells are not used. A block is the convex hull of its points. A polyhedron whose faces enclose
//! another volume is refused, because it is not convex.

use super::Listed;
use super::faces::block;
use nalgebra::Vector3;

/// First words of a legacy VTK file.
const FIRST: &str = "# vtk DataFile";
/// Types of cells that may be blocks.
const TETRAHEDRON: usize = 10;
const POLYHEDRON: usize = 42;

/// Returns `true` if a text is a legacy VTK file.
pub(super) fn is_vtk(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').starts_with(FIRST)
}

/// Returns the blocks of a text; the inner errors are those of single blocks.
///
/// # Errors
/// If the text is not such a data set.
pub(super) fn read(text: &str) -> Result<Vec<Result<Listed, String>>, String> {
    let mut lines = text.lines().skip(2);
    if lines.next().map(str::trim) != Some("ASCII") {
        return Err("a binary VTK file is not read: save it as text (ASCII)".into());
    }
    let mut words = Words {
        rest: lines.flat_map(str::split_whitespace),
    };
    words.expect("DATASET")?;
    let kind = words.next("the kind of the data set")?;
    if kind != "UNSTRUCTURED_GRID" {
        return Err(format!(
            "a VTK file of blocks has the data set UNSTRUCTURED_GRID with one cell for each block, not {kind}"
        ));
    }
    words.expect("POINTS")?;
    let count = words.number::<usize>("the number of points")?;
    words.next("the type of the coordinates")?;
    let mut points = Vec::new();
    for _ in 0..count {
        let mut point = Vector3::zeros();
        for coordinate in point.iter_mut() {
            *coordinate = words.number::<f64>("a coordinate")?;
        }
        points.push(point);
    }
    words.expect("CELLS")?;
    let count = words.number::<usize>("the number of cells")?;
    words.next("the size of the cells")?;
    let mut cells = Vec::new();
    for _ in 0..count {
        let length = words.number::<usize>("the length of a cell")?;
        let cell: Result<Vec<usize>, String> = (0..length)
            .map(|_| words.number::<usize>("a number of a cell"))
            .collect();
        cells.push(cell?);
    }
    words.expect("CELL_TYPES")?;
    words.next("the number of cell types")?;
    let mut blocks = Vec::new();
    for (n, cell) in cells.iter().enumerate() {
        let kind = words.number::<usize>("a cell type")?;
        blocks.push(block_of_cell(&points, kind, cell).map_err(|e| format!("cell {n}: {e}")));
    }
    Ok(blocks)
}

/// Words of a file, one after another.
struct Words<'t, W: Iterator<Item = &'t str>> {
    rest: W,
}

impl<'t, W: Iterator<Item = &'t str>> Words<'t, W> {
    fn next(&mut self, meaning: &str) -> Result<&'t str, String> {
        self.rest
            .next()
            .ok_or_else(|| format!("the VTK file ends before {meaning}"))
    }

    fn expect(&mut self, keyword: &str) -> Result<(), String> {
        let word = self.next(keyword)?;
        if word.eq_ignore_ascii_case(keyword) {
            Ok(())
        } else {
            Err(format!(
                "the VTK file has `{word}` where `{keyword}` is expected"
            ))
        }
    }

    fn number<N: std::str::FromStr>(&mut self, meaning: &str) -> Result<N, String> {
        let word = self.next(meaning)?;
        word.parse()
            .map_err(|_| format!("the VTK file has `{word}` where {meaning} is expected"))
    }
}

/// Returns the block of a cell.
fn block_of_cell(points: &[Vector3<f64>], kind: usize, cell: &[usize]) -> Result<Listed, String> {
    let faces = match kind {
        TETRAHEDRON => match *cell {
            [a, b, c, d] => vec![vec![a, b, c], vec![a, c, d], vec![a, d, b], vec![b, d, c]],
            _ => return Err(format!("a tetrahedron has 4 points, not {}", cell.len())),
        },
        POLYHEDRON => faces(cell)?,
        _ => {
            return Err(format!(
                "cells of type {kind} are not read; a block is a tetrahedron ({TETRAHEDRON}) or a polyhedron \
                 ({POLYHEDRON})"
            ));
        }
    };
    block(points, &faces)
}

/// Returns the points of each face of a polyhedron.
fn faces(cell: &[usize]) -> Result<Vec<Vec<usize>>, String> {
    let short = || "the list of its faces is incomplete".to_owned();
    let (&count, mut rest) = cell.split_first().ok_or_else(short)?;
    let mut faces = Vec::new();
    for _ in 0..count {
        let (&length, behind) = rest.split_first().ok_or_else(short)?;
        let (face, behind) = behind.split_at_checked(length).ok_or_else(short)?;
        faces.push(face.to_vec());
        rest = behind;
    }
    if rest.is_empty() {
        Ok(faces)
    } else {
        Err(format!("{} numbers follow the last face", rest.len()))
    }
}
