//! Triangulated surfaces from STL files, as text or binary.
//!
//! STL lists the corners of each triangle separately. Corners within 1e-7 of the extent of the surface are merged into
//! one vertex, which gives the neighbours of a triangle. Triangles without area are dropped. The normals of the
//! file are not used, because walls act on both sides.
//!
//! The program has its own reader, because `stl_io` rounds text to single precision; this reader keeps double
//! precision, names the line in its messages, and compares the number of triangles with the length of the file
//! before it allocates memory.

use base::geometry::Mesh;
use dem::FacetSurface;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::path::Path;

/// Maximum distance of corners that are merged, relative to the extent of the surface.
const MERGE_DISTANCE: f64 = 1e-7;

/// Reason why a file of a surface cannot be read.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StlError {
    /// File without a triangle.
    #[error("the surface contains no triangle")]
    Empty,
    /// File without a triangle that has an area.
    #[error("the file contains no triangle with an area above 0")]
    NoArea,
    /// Triangles that are not a surface.
    #[error("{0}")]
    Facets(String),
    /// Corner that is not finite.
    #[error("a corner is not finite")]
    NotFinite,
    /// Vertex without three numbers.
    #[error("line {line}: a vertex must have three numbers")]
    Vertex { line: usize },
    /// Facet that is not a triangle.
    #[error("line {line}: a facet has {corners} corners instead of 3")]
    Facet { line: usize, corners: usize },
    /// Number of vertices that are not those of triangles.
    #[error("the file has {0} vertices, which is not a multiple of 3")]
    Vertices(usize),
    /// Bytes that are neither text nor the head of a binary file.
    #[error("the file is neither text STL nor binary STL, which has at least 84 bytes")]
    Short,
    /// Bytes that are neither text nor a complete binary file.
    #[error(
        "the file is neither text STL nor binary STL: {triangles} triangles need {needed} bytes, but the file has \
         {found}"
    )]
    Length {
        triangles: u64,
        needed: u64,
        found: usize,
    },
}

/// Returns what `read` finds in the file of a mesh, shifted by `origin` \[m\], or a reason that names the file.
pub(crate) fn load<T>(
    directory: &Path,
    mesh: &Mesh,
    origin: [f64; 3],
    read: impl Fn(&[u8], f64, &Vector3<f64>) -> Result<T, StlError>,
) -> Result<T, String> {
    let bytes = io::plain::bytes(&directory.join(&mesh.path), io::plain::LONGEST_INPUT)
        .map_err(|e| e.to_string())?;
    read(&bytes, mesh.scale, &origin.into()).map_err(|e| format!("{}: {e}", mesh.path.display()))
}

/// Returns the surface of a file, scaled by `scale` metres per unit of the file and shifted by `origin` \[m\].
///
/// # Errors
/// If the file is not a valid surface.
pub(crate) fn read(
    bytes: &[u8],
    scale: f64,
    origin: &Vector3<f64>,
) -> Result<FacetSurface, StlError> {
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
        return Err(StlError::NoArea);
    }
    FacetSurface::new(vertices, &facets).map_err(|error| StlError::Facets(error.into_reason()))
}

/// Returns the triangles of a file, scaled by `scale` metres per unit of the file and shifted by `origin` \[m\].
///
/// # Errors
/// If the file is not a valid surface.
pub(crate) fn triangles(
    bytes: &[u8],
    scale: f64,
    origin: &Vector3<f64>,
) -> Result<Vec<[Vector3<f64>; 3]>, StlError> {
    let corners = corners(bytes, scale, origin)?;
    Ok(corners
        .chunks_exact(3)
        .map(|t| [t[0], t[1], t[2]])
        .collect())
}

/// Returns the bounding box of corners \[m\].
pub(crate) fn extent(corners: impl Iterator<Item = Vector3<f64>>) -> [[f64; 3]; 2] {
    let none = [f64::INFINITY, f64::NEG_INFINITY].map(Vector3::repeat);
    let [low, high] = corners.fold(none, |[low, high], at| [low.inf(&at), high.sup(&at)]);
    [low.into(), high.into()]
}

/// Returns the corners of all triangles, one after the other.
fn corners(bytes: &[u8], scale: f64, origin: &Vector3<f64>) -> Result<Vec<Vector3<f64>>, StlError> {
    let corners = binary(bytes).map_or_else(|| text(bytes), Ok)?;
    let corners: Vec<Vector3<f64>> = corners
        .into_iter()
        .map(|corner| Vector3::from(corner) * scale + origin)
        .collect();
    if corners.iter().any(|c| !c.norm_squared().is_finite()) {
        return Err(StlError::NotFinite);
    }
    Ok(corners)
}

/// Length of the header of a binary file \[bytes\]: a text of 80 bytes and the number of triangles.
const HEADER: usize = 84;

/// Returns the corners of a binary file, which is at least as long as its number of triangles requires, whatever
/// its first word; none for another file.
fn binary(bytes: &[u8]) -> Option<Vec<[f64; 3]>> {
    let count = u32::from_le_bytes(bytes.get(80..84)?.try_into().ok()?) as usize;
    let end = HEADER + 50 * count;
    let padding = bytes.get(end..)?;
    if count == 0
        || padding
            .iter()
            .any(|byte| !matches!(byte, 0 | b' ' | b'\r' | b'\n'))
    {
        return None;
    }
    let number = |at: &[u8]| {
        at.try_into()
            .map_or(f64::NAN, |b| f64::from(f32::from_le_bytes(b)))
    };
    let corners = bytes[HEADER..end].chunks_exact(50).flat_map(|triangle| {
        // The three numbers of the normal come first.
        (1..4).map(|corner| {
            std::array::from_fn(|axis| {
                let at = 12 * corner + 4 * axis;
                number(&triangle[at..at + 4])
            })
        })
    });
    Some(corners.collect())
}

/// Returns the words of a text with their line numbers; lines end with a line feed, a carriage return or both.
fn words(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.split('\n').flat_map(|line| {
        let line = line.strip_suffix('\r').unwrap_or(line);
        line.split('\r')
    });
    (1..)
        .zip(lines)
        .flat_map(|(n, line)| line.split_whitespace().map(move |word| (n, word)))
}

/// Returns the corners of a text file as a sequence of words, however divided into lines. The name of a solid may
/// contain characters of any encoding.
fn text(bytes: &[u8]) -> Result<Vec<[f64; 3]>, StlError> {
    if bytes.len() == HEADER && bytes.ends_with(&[0; 4]) {
        return Err(StlError::Empty);
    }
    let padding = |byte: &u8| *byte == 0;
    let end = bytes
        .iter()
        .rposition(|byte| !padding(byte))
        .map_or(0, |n| n + 1);
    let text = String::from_utf8_lossy(&bytes[..end]);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    if text.contains('\0') || !text.is_ascii() && !text.contains("vertex") {
        return Err(no_text(bytes));
    }
    let mut corners = Vec::new();
    let mut in_loop = 0;
    // Words within a name are not keywords.
    let mut in_name = false;
    let mut words = words(text);
    while let Some((n, word)) = words.next() {
        let word = word.to_ascii_lowercase();
        in_name &= word != "facet";
        match word.as_str() {
            _ if in_name => {}
            "solid" | "endsolid" => in_name = true,
            "outer" => in_loop = 0,
            "vertex" => {
                let mut number = || words.next()?.1.parse().ok();
                let (Some(x), Some(y), Some(z)) = (number(), number(), number()) else {
                    return Err(StlError::Vertex { line: n });
                };
                corners.push([x, y, z]);
                in_loop += 1;
            }
            "endloop" if in_loop != 3 => {
                return Err(StlError::Facet {
                    line: n,
                    corners: in_loop,
                });
            }
            _ => {}
        }
    }
    if corners.is_empty() {
        let first = text.split_whitespace().next();
        return Err(match first.map(str::to_ascii_lowercase).as_deref() {
            Some("solid") => StlError::Empty,
            _ => no_text(bytes),
        });
    }
    if corners.len() % 3 != 0 {
        return Err(StlError::Vertices(corners.len()));
    }
    Ok(corners)
}

/// Returns the reason why bytes are neither text nor a complete binary file.
fn no_text(bytes: &[u8]) -> StlError {
    let count = bytes.get(80..84).and_then(|count| count.try_into().ok());
    count.map_or(StlError::Short, |count| {
        let triangles = u64::from(u32::from_le_bytes(count));
        StlError::Length {
            triangles,
            needed: 84 + 50 * triangles,
            found: bytes.len(),
        }
    })
}

/// Returns the merged vertices, and the vertex index of each corner.
fn merged(corners: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, Vec<u32>) {
    let mut low = Vector3::repeat(f64::INFINITY);
    let mut high = Vector3::repeat(f64::NEG_INFINITY);
    for corner in corners {
        low = low.inf(corner);
        high = high.sup(corner);
    }
    let near = (MERGE_DISTANCE * (high - low).norm()).max(f64::MIN_POSITIVE);
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
        endloop\nendfacet\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 1 1e-9\n  vertex 0 1 0\n \
        endloop\n\
        endfacet\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 0 0 0\n  vertex 0 1 0\n \
        endloop\nendfacet\nendsolid\n";

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
            // Without merging there would be two contacts across the diagonal.
            let mut found = Vec::new();
            let centre = Vector3::new(0.0005, 0.0005, 0.5001);
            surface.contacts(&[0, 1], &centre, 2e-4, &mut found);
            assert_eq!(found.len(), 1);
            assert!((found[0].distance - 1e-4).abs() < 1e-12);
        }
    }

    /// Checks text as found in practice: a name in Latin-1 that contains a keyword, everything on one line, old
    /// line ends, capitals, padding.
    #[test]
    fn text_is_read_as_it_is_found() {
        let expected = corners(SQUARE.as_bytes(), 1.0, &Vector3::zeros()).unwrap();
        let named = SQUARE.replacen("solid s", "solid B\u{f6}schung vertex 3", 1);
        let latin: Vec<u8> = named
            .chars()
            .map(|c| u8::try_from(u32::from(c)).unwrap())
            .collect();
        let mut padded = SQUARE.as_bytes().to_vec();
        padded.extend([0; 40]);
        for bytes in [
            latin,
            SQUARE.replace('\n', " ").into_bytes(),
            SQUARE.replace('\n', "\r").into_bytes(),
            SQUARE.replace('\n', "\r\n").into_bytes(),
            SQUARE.to_uppercase().into_bytes(),
            format!("\u{feff}{SQUARE}").into_bytes(),
            padded,
        ] {
            assert_eq!(corners(&bytes, 1.0, &Vector3::zeros()).unwrap(), expected);
        }
        let mut padded = as_binary();
        padded.extend([0; 30]);
        assert_eq!(binary(&padded), binary(&as_binary()));
        let bad = SQUARE
            .replace('\n', "\r")
            .replace("vertex 0 1 0", "vertex 0 1,5 0");
        let refused = corners(bad.as_bytes(), 1.0, &Vector3::zeros());
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("line 13"), "{refused}");
        let short = corners(&as_binary()[..150], 1.0, &Vector3::zeros());
        let short = short.unwrap_err().to_string();
        assert!(short.contains("184 bytes, but the file has 150"), "{short}");
    }

    /// Checks headers of several programs: words of Gmsh, OpenSCAD, Salome and CATIA; binary files of ParaView,
    /// MeshLab, and of SolidWorks, which begins with `solid` and stores colours in the last bytes of a facet.
    #[test]
    fn headers_of_several_programs_are_read() {
        let expected = corners(SQUARE.as_bytes(), 1.0, &Vector3::zeros()).unwrap();
        let body = SQUARE.strip_prefix("solid s\n").unwrap();
        let body = body.strip_suffix("endsolid\n").unwrap();
        let many_digits = body.replace(
            "vertex 1 0 0",
            "vertex 1.000000e+00 0.000000e+00 -0.0000000000E+000",
        );
        for text in [
            format!("solid Created by Gmsh\n{body}endsolid Created by Gmsh\n"),
            format!("solid OpenSCAD_Model\n{body}endsolid OpenSCAD_Model\n"),
            format!(
                "solid shape, STL ascii file, created with SALOME\n{many_digits}endsolid shape\n"
            ),
            format!(
                "solid CATIA STL\n{}endsolid CATIA STL\n",
                body.replace("facet normal", "  facet  normal")
            ),
            // Two solids in one file, the second without a name.
            SQUARE.replacen("endfacet\n", "endfacet\nendsolid s\nsolid\n", 1),
        ] {
            let found = corners(text.as_bytes(), 1.0, &Vector3::zeros());
            assert_eq!(found.unwrap(), expected, "{text}");
        }
        for name in [
            "Visualization Toolkit generated SLA File",
            "VCG",
            "solid Part1 by SolidWorks",
        ] {
            let mut bytes = as_binary();
            bytes[..80].fill(b' ');
            bytes[..name.len()].copy_from_slice(name.as_bytes());
            bytes[84 + 48..84 + 50].copy_from_slice(&[0x1f, 0x80]);
            assert_eq!(binary(&bytes), binary(&as_binary()), "{name}");
        }
    }

    #[test]
    fn files_that_are_no_surface_are_refused() {
        let refused = |bytes: &[u8]| {
            let read = read(bytes, 1.0, &Vector3::zeros());
            read.unwrap_err().to_string()
        };
        assert!(refused(b"").contains("neither text STL nor binary STL"));
        assert!(
            refused(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
                .contains("neither text STL nor binary STL")
        );
        // Surfaces without triangles, as Blender, OpenSCAD and Slic3r write them.
        for text in ["solid Model\nendsolid Model\n", "solid\n"] {
            assert!(refused(text.as_bytes()).contains("the surface contains no triangle"));
        }
        let mut named = [0; 84];
        named[..7].copy_from_slice(b"Blender");
        assert!(refused(&named).contains("the surface contains no triangle"));
        assert!(refused(&[0; 84]).contains("the surface contains no triangle"));
        assert!(refused(b"vertex 1 2\n").contains("line 1"));
        assert!(refused(&[0xff; 90]).contains("neither"));
        assert!(refused(&as_binary()[..150]).contains("neither"));
        assert!(refused(SQUARE.replace("1 1 1e-9", "1 1 nan").as_bytes()).contains("not finite"));
        let four = SQUARE.replacen("  vertex 1 1 0\n", "  vertex 1 1 0\n  vertex 0 1 0\n", 1);
        assert!(refused(four.as_bytes()).contains("4 corners"));
        assert!(refused(SQUARE.replace(" 1", " 0").as_bytes()).contains("no triangle"));
    }
}
