//! Triangulated surfaces from STL files, as text or binary.
//!
//! STL lists the corners of each triangle separately. Corners within 1e-7 of the extent of the surface are merged into one vertex, which gives
//! the neighbours of a triangle. Triangles without an area are left out. The normals of the file are not used, because walls act
//! on both sides.
//!
//! The program has its own reader: it reads text in double precision where the crate `stl_io` rounds to single precision, its messages name
//! the line, and it compares the number of triangles with the length of the file before it allocates memory.

use crate::dem::Surface;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Corners closer than this over the extent of the surface are one.
const MERGE: f64 = 1e-7;

/// The surface of a file, `scale` metres per unit of it, moved by `origin` (m).
///
/// # Errors
/// A sentence about the error.
pub(crate) fn read(bytes: &[u8], scale: f64, origin: &Vector3<f64>) -> Result<Surface, String> {
    let corners = corners(bytes, scale, origin)?;
    let (vertices, numbers) = merged(&corners);
    let facets: Vec<Vec<u32>> = numbers
        .chunks_exact(3)
        .filter(|t| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|k| vertices[k as usize]);
            let longest = (b - a).norm_squared().max((c - a).norm_squared());
            (b - a).cross(&(c - a)).norm() > 1e-10 * longest
        })
        .map(<[u32]>::to_vec)
        .collect();
    if facets.is_empty() {
        return Err("the file holds no triangle with an area".into());
    }
    Surface::new(vertices, &facets).map_err(|e| e.to_string())
}

/// The triangles of a file, `scale` metres per unit of it, moved by `origin` (m).
///
/// # Errors
/// A sentence about the error.
pub(crate) fn triangles(
    bytes: &[u8],
    scale: f64,
    origin: &Vector3<f64>,
) -> Result<Vec<[Vector3<f64>; 3]>, String> {
    let corners = corners(bytes, scale, origin)?;
    Ok(corners
        .chunks_exact(3)
        .map(|t| [t[0], t[1], t[2]])
        .collect())
}

/// The corners of all triangles, one after the other.
fn corners(bytes: &[u8], scale: f64, origin: &Vector3<f64>) -> Result<Vec<Vector3<f64>>, String> {
    let corners = binary(bytes).map_or_else(|| text(bytes), Ok)?;
    let corners: Vec<Vector3<f64>> = corners
        .into_iter()
        .map(|corner| Vector3::from(corner) * scale + origin)
        .collect();
    if corners.iter().any(|c| !c.norm_squared().is_finite()) {
        return Err("a corner is not finite".into());
    }
    Ok(corners)
}

/// The corners of a binary file: its length fits its count of triangles, whatever its first word.
fn binary(bytes: &[u8]) -> Option<Vec<[f64; 3]>> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    if count == 0 || bytes.len() != 84 + 50 * count {
        return None;
    }
    let number = |at: &[u8]| {
        at.try_into()
            .map_or(f64::NAN, |b| f64::from(f32::from_le_bytes(b)))
    };
    let corners = bytes[84..].chunks_exact(50).flat_map(|triangle| {
        // Three numbers of the normal come first.
        (1..4).map(|corner| {
            std::array::from_fn(|axis| {
                let at = 12 * corner + 4 * axis;
                number(&triangle[at..at + 4])
            })
        })
    });
    Some(corners.collect())
}

/// The corners of a text file.
fn text(bytes: &[u8]) -> Result<Vec<[f64; 3]>, String> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| "neither binary STL (its length does not fit) nor text")?;
    let mut corners = Vec::new();
    let mut in_loop = 0;
    for (n, line) in (1..).zip(text.lines()) {
        let mut words = line.split_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("outer") => in_loop = 0,
            Some("vertex") => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                let [x, y, z] = numbers[..] else {
                    return Err(format!("line {n}: a vertex is three numbers"));
                };
                corners.push([x, y, z]);
                in_loop += 1;
            }
            Some("endloop") if in_loop != 3 => {
                return Err(format!("line {n}: a facet of {in_loop} corners, not 3"));
            }
            _ => {}
        }
    }
    if corners.is_empty() || corners.len() % 3 != 0 {
        return Err(format!("{} vertices do not make triangles", corners.len()));
    }
    Ok(corners)
}

/// Vertices, and the vertex of each corner.
fn merged(corners: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, Vec<u32>) {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for corner in corners {
        low = low.inf(corner);
        high = high.sup(corner);
    }
    let near = (MERGE * (high - low).norm()).max(f64::MIN_POSITIVE);
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    let mut vertices: Vec<Vector3<f64>> = Vec::new();
    let mut numbers = Vec::with_capacity(corners.len());
    for corner in corners {
        let cell = cell_of(&((corner - low) / near));
        let mut known = None;
        for step in 0..27_i64 {
            let beside = [
                cell[0] + step % 3 - 1,
                cell[1] + step / 3 % 3 - 1,
                cell[2] + step / 9 - 1,
            ];
            known = known.or_else(|| {
                cells
                    .get(&beside)?
                    .iter()
                    .copied()
                    .find(|&v| (vertices[v as usize] - corner).norm() <= near)
            });
        }
        let number = known.unwrap_or_else(|| {
            let number = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
            vertices.push(*corner);
            cells.entry(cell).or_default().push(number);
            number
        });
        numbers.push(number);
    }
    (vertices, numbers)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "between 0 and 1e7 by the choice of the cell"
)]
fn cell_of(at: &Vector3<f64>) -> [i64; 3] {
    [at[0] as i64, at[1] as i64, at[2] as i64]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "solid s\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 1 1 0\n \
        endloop\nendfacet\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 1 1e-9\n  vertex 0 1 0\n endloop\n\
        endfacet\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 0 0 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid\n";

    fn as_binary() -> Vec<u8> {
        let mut bytes = vec![b's'; 80];
        bytes.extend(2_u32.to_le_bytes());
        for corners in [[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]] {
            bytes.extend([0; 12]);
            for [x, y] in corners {
                for value in [x, y, 0] {
                    bytes.extend((value as f32).to_le_bytes());
                }
            }
            bytes.extend([0; 2]);
        }
        bytes
    }

    #[test]
    fn text_and_binary_are_the_same_surface_with_shared_vertices() {
        let origin = Vector3::new(0.0, 0.0, 0.5);
        let a = read(SQUARE.as_bytes(), 0.001, &origin).unwrap();
        let b = read(&as_binary(), 0.001, &origin).unwrap();
        for surface in [&a, &b] {
            assert_eq!(surface.len(), 2);
            assert!(surface.adjacent(0, 1));
            // Two contacts without merging, over the diagonal.
            let mut found = Vec::new();
            let centre = Vector3::new(0.0005, 0.0005, 0.5001);
            surface.contacts(&[0, 1], &centre, 2e-4, &mut found);
            assert_eq!(found.len(), 1);
            assert!((found[0].distance - 1e-4).abs() < 1e-12);
        }
    }

    #[test]
    fn files_that_are_no_surface_are_refused() {
        let refused = |bytes: &[u8]| read(bytes, 1.0, &Vector3::zeros()).unwrap_err();
        assert!(refused(b"").contains("do not make triangles"));
        assert!(refused(b"vertex 1 2\n").contains("line 1"));
        assert!(refused(&[0xff; 90]).contains("neither"));
        assert!(refused(&as_binary()[..150]).contains("neither"));
        assert!(refused(SQUARE.replace("1 1 1e-9", "1 1 nan").as_bytes()).contains("not finite"));
        let four = SQUARE.replacen("  vertex 1 1 0\n", "  vertex 1 1 0\n  vertex 0 1 0\n", 1);
        assert!(refused(four.as_bytes()).contains("4 corners"));
        assert!(refused(SQUARE.replace(" 1", " 0").as_bytes()).contains("no triangle"));
    }
}
