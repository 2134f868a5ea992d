//! Grains, contacts and blocks in one file for each output: static VTKHDF PolyData.
//!
//! The layout follows Kitware's VTKHDF specification 2.0. Points with vertices are grains, lines are contacts or
//! bonds, polygons are the faces of blocks. Each rank passes its own points and cells with its own indices from 0;
//! in the file they are in the order of the ranks. Any rank, or all of them, may have none.

use std::path::Path;

use crate::data::{Column, Data, Kind, index, signed};
use crate::error::{Error, Result};
use crate::group::{Group, agree};
use crate::hdf::{self, Attribute, Content, DatasetPart, Mode};
use crate::moment::OutputTime;

/// Cells that connect the points.
#[derive(Clone, Copy, Debug)]
pub enum Cells<'a> {
    /// Each point is a cell: grains.
    Vertices,
    /// Lines between two points each, with the indices of this rank: contacts, bonds.
    Lines(&'a [[usize; 2]]),
    /// Faces: number of corners of each, and the corners of all faces, with this rank's indices.
    Polygons {
        /// Number of corners of each face, at least 3.
        sizes: &'a [usize],
        /// The corners of all faces, one face after the other.
        corners: &'a [usize],
    },
}

/// One rank's points and cells with their columns.
#[derive(Clone, Debug)]
pub struct MeshData<'a> {
    /// Positions `[n][3]`, f32 or f64, m.
    pub points: Data<'a>,
    /// Cells that connect the points.
    pub cells: Cells<'a>,
    /// Columns with one row per point.
    pub point_columns: Vec<Column<'a>>,
    /// Columns with one row per line or polygon; for vertices, columns of the points are used.
    pub cell_columns: Vec<Column<'a>>,
}

/// Names of the four lists of cells of PolyData, including unused ones.
const LISTS: [&str; 4] = ["Vertices", "Lines", "Polygons", "Strips"];

impl Cells<'_> {
    fn list(&self) -> &'static str {
        match self {
            Self::Vertices => LISTS[0],
            Self::Lines(_) => LISTS[1],
            Self::Polygons { .. } => LISTS[2],
        }
    }
}

/// Writes one output of a mesh. Called by all ranks.
///
/// # Errors
/// If [`hdf::write`] fails.
pub fn write(
    path: &Path,
    when: OutputTime,
    mesh: &MeshData,
    provenance: &[(String, String)],
    group: &dyn Group,
    mode: Mode,
) -> Result<()> {
    agree(group, mesh.check())?;
    let joined = Joined::new(mesh, group)?;
    let root = group.rank() == 0;
    let mut content = Content::default();
    content.folder(
        "/VTKHDF",
        &[
            ("Version", Attribute::Ints(vec![2, 0])),
            ("Type", Attribute::Text("PolyData".to_owned())),
        ],
    );
    content.folder("/VTKHDF/PointData", &[]);
    content.folder("/VTKHDF/CellData", &[]);
    let total_points = [signed(joined.points.total)?];
    content.parts.push(single(
        "/VTKHDF/NumberOfPoints".to_owned(),
        &total_points,
        root,
    ));
    content
        .parts
        .push(joined.points.part("/VTKHDF/Points", &[3], mesh.points, "m"));
    let counts = [
        signed(joined.cells.total)?,
        signed(joined.connectivity.total)?,
    ];
    for list in LISTS {
        let at = |name: &str| format!("/VTKHDF/{list}/{name}");
        if list == mesh.cells.list() {
            content
                .parts
                .push(single(at("NumberOfCells"), &counts[..1], root));
            content
                .parts
                .push(single(at("NumberOfConnectivityIds"), &counts[1..], root));
            content.parts.push(joined.connectivity.part(
                &at("Connectivity"),
                &[],
                Data::I64(&joined.ids),
                "-",
            ));
            content
                .parts
                .push(joined.starts_part(&at("Offsets"), group));
        } else {
            for name in ["NumberOfCells", "NumberOfConnectivityIds", "Offsets"] {
                content.parts.push(single(at(name), &[0], root));
            }
            content.parts.push(DatasetPart {
                path: at("Connectivity"),
                shape: vec![0],
                start: vec![0],
                count: vec![0],
                data: Data::I64(&[]).into(),
                attributes: Vec::new(),
            });
        }
    }
    if let Cells::Polygons { .. } = mesh.cells {
        content.parts.push(
            joined
                .mixed
                .part(MIXED, &[], Data::I64(&joined.mixed_ids), "-"),
        );
    }
    for (place, span, columns) in [
        ("PointData", &joined.points, &mesh.point_columns),
        ("CellData", &joined.cells, &mesh.cell_columns),
    ] {
        for column in columns {
            let components: &[usize] = if column.components > 1 {
                &[column.components]
            } else {
                &[]
            };
            content.parts.push(span.part(
                &format!("/VTKHDF/{place}/{}", column.name),
                components,
                column.data,
                column.units,
            ));
        }
    }
    when.describe(&mut content);
    content.texts("/provenance", provenance, group);
    hdf::write(path, &content, group, mode)
}

/// Path of a second copy of the polygons in XDMF's own order (3, corners, ids …), outside VTKHDF's part of the
/// file: the two formats share all other data.
pub(crate) const MIXED: &str = "/XDMF/Polygons";

/// Returns a dataset of a few integers, written by rank 0.
fn single(path: String, value: &[i64], root: bool) -> DatasetPart<'_> {
    let held = usize::from(root);
    DatasetPart {
        path,
        shape: vec![1],
        start: vec![0],
        count: vec![held],
        data: Data::I64(&value[..held]).into(),
        attributes: Vec::new(),
    }
}

/// Range of the rows of this rank among all rows.
struct Span {
    mine: usize,
    offset: usize,
    total: usize,
}

impl Span {
    fn new(mine: usize, group: &dyn Group) -> Result<Self> {
        let (offset, total) = group.offset_and_total(mine as u64);
        Ok(Self {
            mine,
            offset: index(offset)?,
            total: index(total)?,
        })
    }

    fn part<'a>(
        &self,
        path: &str,
        components: &[usize],
        data: Data<'a>,
        units: &str,
    ) -> DatasetPart<'a> {
        let shaped = |n: usize| [&[n], components].concat();
        DatasetPart {
            path: path.to_owned(),
            shape: shaped(self.total),
            start: [&[self.offset][..], &vec![0; components.len()]].concat(),
            count: shaped(self.mine),
            data: data.into(),
            attributes: vec![("units".to_owned(), Attribute::Text(units.to_owned()))],
        }
    }
}

/// Cells with the indices of the file.
struct Joined {
    points: Span,
    cells: Span,
    connectivity: Span,
    mixed: Span,
    ids: Vec<i64>,
    starts: Vec<i64>,
    mixed_ids: Vec<i64>,
}

impl Joined {
    fn new(mesh: &MeshData, group: &dyn Group) -> Result<Self> {
        let points = Span::new(mesh.points.len() / 3, group)?;
        let shifted = |i: usize| signed(i + points.offset);
        let (sizes, ids): (Vec<usize>, Vec<i64>) = match mesh.cells {
            Cells::Vertices => (
                vec![1; points.mine],
                (0..points.mine).map(shifted).collect::<Result<_>>()?,
            ),
            Cells::Lines(lines) => (
                vec![2; lines.len()],
                lines
                    .iter()
                    .flatten()
                    .map(|&i| shifted(i))
                    .collect::<Result<_>>()?,
            ),
            Cells::Polygons { sizes, corners } => (
                sizes.to_vec(),
                corners.iter().map(|&i| shifted(i)).collect::<Result<_>>()?,
            ),
        };
        let cells = Span::new(sizes.len(), group)?;
        let connectivity = Span::new(ids.len(), group)?;
        let mut starts = Vec::with_capacity(sizes.len() + 1);
        let mut mixed_ids = Vec::new();
        let mut next = 0;
        for &size in &sizes {
            starts.push(signed(connectivity.offset + next)?);
            if let Cells::Polygons { .. } = mesh.cells {
                // XDMF's number for a polygon.
                mixed_ids.extend([3, signed(size)?]);
                mixed_ids.extend_from_slice(&ids[next..next + size]);
            }
            next += size;
        }
        // The end of the last of all cells belongs to the last rank.
        if group.rank() + 1 == group.size() {
            starts.push(signed(connectivity.total)?);
        }
        let mixed = Span::new(mixed_ids.len(), group)?;
        Ok(Self {
            points,
            cells,
            connectivity,
            mixed,
            ids,
            starts,
            mixed_ids,
        })
    }

    fn starts_part(&self, path: &str, group: &dyn Group) -> DatasetPart<'_> {
        let last = usize::from(group.rank() + 1 == group.size());
        DatasetPart {
            path: path.to_owned(),
            shape: vec![self.cells.total + 1],
            start: vec![self.cells.offset],
            count: vec![self.cells.mine + last],
            data: Data::I64(&self.starts).into(),
            attributes: Vec::new(),
        }
    }
}

impl MeshData<'_> {
    fn check(&self) -> Result<()> {
        let wrong = |reason: String| Err(Error::invalid("the mesh", reason));
        if !matches!(self.points.kind(), Kind::F32 | Kind::F64)
            || !self.points.len().is_multiple_of(3)
        {
            return wrong(format!(
                "{} coordinates of type {:?}",
                self.points.len(),
                self.points.kind()
            ));
        }
        let points = self.points.len() / 3;
        let outside = |i: &usize| *i >= points;
        let cells = match self.cells {
            Cells::Vertices => {
                if let Some(column) = self.cell_columns.first() {
                    return wrong(format!(
                        "the column {} belongs to the points, which are the cells",
                        column.name
                    ));
                }
                points
            }
            Cells::Lines(lines) => {
                if lines.iter().flatten().any(outside) {
                    return wrong(format!(
                        "a line refers to a point beyond the {points} points"
                    ));
                }
                lines.len()
            }
            Cells::Polygons { sizes, corners } => {
                if corners.iter().any(outside) {
                    return wrong(format!(
                        "a polygon refers to a point beyond the {points} points"
                    ));
                }
                if sizes.iter().any(|&n| n < 3) || sizes.iter().sum::<usize>() != corners.len() {
                    return wrong("the sizes of the polygons do not fit their corners".to_owned());
                }
                sizes.len()
            }
        };
        self.point_columns
            .iter()
            .try_for_each(|c| c.check(points))?;
        self.cell_columns.iter().try_for_each(|c| c.check(cells))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Alone;
    use crate::fields::{inspect, read_column};

    const WHEN: OutputTime = OutputTime { step: 3, time: 0.5 };

    fn save(mesh: &MeshData) -> (tempfile::TempDir, Result<()>) {
        let dir = tempfile::tempdir().unwrap();
        let done = write(
            &dir.path().join("a.vtkhdf"),
            WHEN,
            mesh,
            &[],
            &Alone,
            Mode::Collective,
        );
        (dir, done)
    }

    #[test]
    fn two_blocks_come_back() {
        let points: Vec<f64> = (0..21).map(f64::from).collect();
        let mesh = MeshData {
            points: Data::F64(&points),
            cells: Cells::Polygons {
                sizes: &[3, 4],
                corners: &[0, 1, 2, 3, 4, 5, 6],
            },
            point_columns: vec![],
            cell_columns: vec![Column {
                name: "id",
                units: "-",
                components: 1,
                data: Data::I64(&[8, 9]),
            }],
        };
        let (dir, done) = save(&mesh);
        done.unwrap();
        let path = dir.path().join("a.vtkhdf");
        assert_eq!(read_column(&path, "position").unwrap().shape, vec![7, 3]);
        assert_eq!(read_column(&path, "id").unwrap().values, vec![8.0, 9.0]);
        let offsets = read_column(&path, "/VTKHDF/Polygons/Offsets").unwrap();
        assert_eq!(offsets.values, vec![0.0, 3.0, 7.0]);
        let mixed = read_column(&path, MIXED).unwrap();
        assert_eq!(
            mixed.values,
            vec![3., 3., 0., 1., 2., 3., 4., 3., 4., 5., 6.]
        );
    }

    #[test]
    fn no_grains_are_a_file_too() {
        let (dir, done) = save(&MeshData {
            points: Data::F32(&[]),
            cells: Cells::Vertices,
            point_columns: vec![],
            cell_columns: vec![],
        });
        done.unwrap();
        let info = inspect(&dir.path().join("a.vtkhdf")).unwrap();
        assert_eq!(info.dataset("/VTKHDF/Points").unwrap().shape, vec![0, 3]);
        assert_eq!(
            info.dataset("/VTKHDF/Vertices/Offsets").unwrap().shape,
            vec![1]
        );
    }

    #[test]
    fn cells_that_leave_their_points_are_refused() {
        let points = [0.0_f64; 6];
        let mesh = |cells| MeshData {
            points: Data::F64(&points),
            cells,
            point_columns: vec![],
            cell_columns: vec![],
        };
        assert!(save(&mesh(Cells::Lines(&[[0, 1]]))).1.is_ok());
        assert!(save(&mesh(Cells::Lines(&[[0, 2]]))).1.is_err());
        let polygons = |sizes, corners| mesh(Cells::Polygons { sizes, corners });
        assert!(save(&polygons(&[2], &[0, 1])).1.is_err());
        assert!(save(&polygons(&[3], &[0, 1])).1.is_err());
        assert!(save(&polygons(&[3], &[0, 1, 1])).1.is_ok());
        let mut odd = mesh(Cells::Vertices);
        odd.points = Data::F64(&points[..5]);
        assert!(save(&odd).1.is_err());
        odd.points = Data::I64(&[0, 0, 0]);
        assert!(save(&odd).1.is_err());
    }
}
