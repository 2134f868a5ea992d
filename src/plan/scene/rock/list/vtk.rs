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

use super::error::{POLYHEDRON, TETRAHEDRON};
use super::faces::block;
use super::{ListError, Listed, Origin};
use nalgebra::Vector3;

/// First words of a legacy VTK file.
const FIRST: &str = "# vtk DataFile";

/// Returns `true` if a text is a legacy VTK file.
pub(super) fn is_vtk(text: &str) -> bool {
    text.trim_start_matches('\u{feff}').starts_with(FIRST)
}

/// Returns the blocks of a text; the inner errors are those of single blocks.
///
/// # Errors
/// If the text is not such a data set.
pub(super) fn read(text: &str) -> Result<Vec<Result<Listed, ListError>>, ListError> {
    let mut lines = text.lines().skip(2);
    if lines.next().map(str::trim) != Some("ASCII") {
        return Err(ListError::Binary);
    }
    let mut words = Words {
        rest: lines.flat_map(str::split_whitespace),
    };
    words.expect("DATASET")?;
    let kind = words.next("the kind of the data set")?;
    if kind != "UNSTRUCTURED_GRID" {
        return Err(ListError::DataSet(kind.to_owned()));
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
        let cell: Result<Vec<usize>, ListError> = (0..length)
            .map(|_| words.number::<usize>("a number of a cell"))
            .collect();
        cells.push(cell?);
    }
    words.expect("CELL_TYPES")?;
    words.next("the number of cell types")?;
    let mut blocks = Vec::new();
    for (n, cell) in cells.iter().enumerate() {
        let kind = words.number::<usize>("a cell type")?;
        blocks.push(block_of_cell(&points, kind, cell).map_err(|e| e.with_origin(Origin::Cell(n))));
    }
    Ok(blocks)
}

/// Words of a file, one after another.
struct Words<'t, W: Iterator<Item = &'t str>> {
    rest: W,
}

impl<'t, W: Iterator<Item = &'t str>> Words<'t, W> {
    fn next(&mut self, meaning: &str) -> Result<&'t str, ListError> {
        self.rest
            .next()
            .ok_or_else(|| ListError::Ends(meaning.to_owned()))
    }

    fn expect(&mut self, keyword: &str) -> Result<(), ListError> {
        let word = self.next(keyword)?;
        if word.eq_ignore_ascii_case(keyword) {
            Ok(())
        } else {
            Err(ListError::Word {
                word: word.to_owned(),
                expected: format!("`{keyword}`"),
            })
        }
    }

    fn number<N: std::str::FromStr>(&mut self, meaning: &str) -> Result<N, ListError> {
        let word = self.next(meaning)?;
        word.parse().map_err(|_| ListError::Word {
            word: word.to_owned(),
            expected: meaning.to_owned(),
        })
    }
}

/// Returns the block of a cell.
fn block_of_cell(
    points: &[Vector3<f64>],
    kind: usize,
    cell: &[usize],
) -> Result<Listed, ListError> {
    let faces = match kind {
        TETRAHEDRON => match *cell {
            [a, b, c, d] => vec![vec![a, b, c], vec![a, c, d], vec![a, d, b], vec![b, d, c]],
            _ => return Err(ListError::Tetrahedron(cell.len())),
        },
        POLYHEDRON => faces(cell)?,
        _ => {
            return Err(ListError::CellType(kind));
        }
    };
    block(points, &faces)
}

/// Returns the points of each face of a polyhedron.
fn faces(cell: &[usize]) -> Result<Vec<Vec<usize>>, ListError> {
    let (&count, mut rest) = cell.split_first().ok_or(ListError::FewFaces)?;
    let mut faces = Vec::new();
    for _ in 0..count {
        let (&length, behind) = rest.split_first().ok_or(ListError::FewFaces)?;
        let (face, behind) = behind.split_at_checked(length).ok_or(ListError::FewFaces)?;
        faces.push(face.to_vec());
        rest = behind;
    }
    if rest.is_empty() {
        Ok(faces)
    } else {
        Err(ListError::ManyNumbers(rest.len()))
    }
}
