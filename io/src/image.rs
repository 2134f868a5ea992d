//! Output of a lattice in one file per output time: static VTKHDF ImageData, or RectilinearGrid, with cell data.
//!
//! The layout follows Kitware's VTKHDF specification 1.0; that of cells of different widths its version 2.7. Programs
//! that know no RectilinearGrid in VTKHDF read the same arrays through the XDMF index. Arrays are in C order
//! `[z][y][x][component]`. The origin is the lower corner of the first cell. A lattice in two dimensions has one cell
//! in z.

use std::path::Path;

use crate::data::{Column, Data, index, signed};
use crate::error::{Error, Result};
use crate::group::{Group, agree};
use crate::hdf::{self, Attribute, Content, DatasetPart, Mode, product};
use crate::moment::OutputTime;

/// One rank's box of a lattice with its columns. A rank may have no cells.
#[derive(Clone, Debug)]
pub struct Image<'a> {
    /// Lower corner of the first cell, x y z, m.
    pub origin: [f64; 3],
    /// Edges of a cell, x y z, m.
    pub spacing: [f64; 3],
    /// Positions of the faces between cells along each axis, one more than the cells, m; none for equal cells.
    pub faces: Option<[Vec<f64>; 3]>,
    /// Number of cells of the whole lattice, x y z.
    pub cells: [usize; 3],
    /// First cell of this rank's box, x y z.
    pub start: [usize; 3],
    /// Number of cells of this rank's box, x y z.
    pub count: [usize; 3],
    /// Columns of this rank's box, `[z][y][x][component]`.
    pub fields: Vec<Column<'a>>,
}

/// Writes one output of a lattice. Called by all ranks.
///
/// # Errors
/// If [`hdf::write`] fails.
pub fn write(
    path: &Path,
    when: OutputTime,
    image: &Image,
    provenance: &[(String, String)],
    group: &dyn Group,
    mode: Mode,
) -> Result<()> {
    agree(group, image.check())?;
    let mut content = Content::default();
    let [nx, ny, nz] = image.cells;
    let extent = [0, signed(nx)?, 0, signed(ny)?, 0, signed(nz)?];
    let points = [nx, ny, nz].map(|n| signed(n + 1));
    let extent = ("WholeExtent", Attribute::Ints(extent.to_vec()));
    if let Some(faces) = &image.faces {
        let attributes = [
            ("Version", Attribute::Ints(vec![2, 7])),
            ("Type", Attribute::Text(RECTILINEAR.to_owned())),
            extent,
            (
                "Dimensions",
                Attribute::Ints(points.into_iter().collect::<Result<_>>()?),
            ),
        ];
        content.folder("/VTKHDF", &attributes);
        for (name, faces) in COORDINATES.iter().zip(faces) {
            let held = if group.rank() == 0 { faces.len() } else { 0 };
            content.parts.push(DatasetPart {
                path: format!("/VTKHDF/{name}"),
                shape: vec![faces.len()],
                start: vec![0],
                count: vec![held],
                data: Data::F64(&faces[..held]).into(),
                attributes: vec![("units".to_owned(), Attribute::Text("m".to_owned()))],
            });
        }
    } else {
        let direction = vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let attributes = [
            ("Version", Attribute::Ints(vec![1, 0])),
            ("Type", Attribute::Text("ImageData".to_owned())),
            extent,
            ("Origin", Attribute::Floats(image.origin.to_vec())),
            ("Spacing", Attribute::Floats(image.spacing.to_vec())),
            ("Direction", Attribute::Floats(direction)),
        ];
        content.folder("/VTKHDF", &attributes);
    }
    content.folder("/VTKHDF/CellData", &[]);
    let reversed = |[x, y, z]: [usize; 3]| [z, y, x];
    for field in &image.fields {
        content.parts.push(DatasetPart {
            path: format!("/VTKHDF/CellData/{}", field.name),
            shape: field.shaped(&reversed(image.cells)),
            start: field.start(&reversed(image.start)),
            count: field.shaped(&reversed(image.count)),
            data: field.data.into(),
            attributes: vec![("units".to_owned(), Attribute::Text(field.units.to_owned()))],
        });
    }
    when.describe(&mut content);
    content.texts("/provenance", provenance, group);
    hdf::write(path, &content, group, mode)
}

/// Type of a file with cells of different widths.
pub(crate) const RECTILINEAR: &str = "RectilinearGrid";
/// Names of the positions of the faces along each axis.
pub(crate) const COORDINATES: [&str; 3] = ["XCoordinates", "YCoordinates", "ZCoordinates"];

impl Image<'_> {
    fn check(&self) -> Result<()> {
        let positive = self.spacing.iter().all(|d| *d > 0.0 && d.is_finite());
        if !positive || !self.origin.iter().all(|x| x.is_finite()) {
            return Err(Error::invalid(
                "the lattice",
                format!("origin {:?}, spacing {:?}", self.origin, self.spacing),
            ));
        }
        if product(&self.cells) == 0 {
            return Err(Error::invalid(
                "the lattice",
                format!("cells {:?}", self.cells),
            ));
        }
        let rises = |(faces, cells): (&Vec<f64>, &usize)| {
            faces.len() == cells + 1 && faces.windows(2).all(|pair| pair[0] < pair[1])
        };
        if !(self.faces.iter()).all(|faces| faces.iter().zip(&self.cells).all(rises)) {
            return Err(Error::invalid(
                "the lattice",
                format!("faces {:?}", self.faces),
            ));
        }
        // This also checks that the extents fit the file's integers.
        self.cells.iter().try_for_each(|&n| signed(n).map(|_| ()))?;
        self.fields
            .iter()
            .try_for_each(|field| field.check(product(&self.count)))
    }
}

/// Contents of a lattice file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageInfo {
    /// Step and time of the output.
    pub when: OutputTime,
    /// Lower corner of the first cell, x y z, m.
    pub origin: [f64; 3],
    /// Edges of a cell, of the narrowest ones if their widths differ, x y z, m.
    pub spacing: [f64; 3],
    /// Number of cells, x y z.
    pub cells: [usize; 3],
    /// Positions of the faces between cells along each axis, m; none for equal cells.
    pub faces: Option<[Vec<f64>; 3]>,
    /// Columns of the file.
    pub columns: Vec<crate::fields::DatasetInfo>,
}

/// Reads the description of a lattice file; [`crate::fields::read_column`] reads the numbers.
///
/// # Errors
/// If it is not an HDF5 file ([`Error::Hdf`]), or not a lattice ([`Error::Corrupt`]).
pub fn open(path: &Path) -> Result<ImageInfo> {
    let info = crate::fields::inspect(path)?;
    let wrong = |what: &str| Error::corrupt(path, format!("no {what} in /VTKHDF"));
    let get = |name: &str| info.attribute("/VTKHDF", name).ok_or_else(|| wrong(name));
    let graded = match get("Type")?.as_str() {
        Some("ImageData") => false,
        Some(RECTILINEAR) => true,
        _ => return Err(wrong("ImageData")),
    };
    let floats = |name: &str| -> Result<[f64; 3]> {
        let value = get(name)?;
        let list = value.as_array().ok_or_else(|| wrong(name))?;
        let numbers: Vec<f64> = list.iter().filter_map(serde_json::Value::as_f64).collect();
        numbers.try_into().map_err(|_| wrong(name))
    };
    let extent = get("WholeExtent")?;
    let at = |i: usize| extent.get(i).and_then(serde_json::Value::as_u64);
    let mut cells = [0; 3];
    for (axis, n) in cells.iter_mut().enumerate() {
        let (Some(low), Some(high)) = (at(2 * axis), at(2 * axis + 1)) else {
            return Err(wrong("WholeExtent"));
        };
        *n = index(high.checked_sub(low).ok_or_else(|| wrong("WholeExtent"))?)?;
    }
    let faces = if graded {
        let read = |axis: usize| -> Result<Vec<f64>> {
            let name = COORDINATES[axis];
            let faces = crate::fields::read_column(path, &format!("/VTKHDF/{name}"))?.values;
            if faces.len() != cells[axis] + 1 {
                return Err(wrong(name));
            }
            Ok(faces)
        };
        Some([read(0)?, read(1)?, read(2)?])
    } else {
        None
    };
    let (origin, spacing) = match &faces {
        Some(faces) => (
            std::array::from_fn(|a| faces[a][0]),
            std::array::from_fn(|a| {
                let widths = faces[a].windows(2).map(|pair| pair[1] - pair[0]);
                widths.fold(f64::INFINITY, f64::min)
            }),
        ),
        None => (floats("Origin")?, floats("Spacing")?),
    };
    Ok(ImageInfo {
        when: OutputTime::read(&info, path)?,
        origin,
        spacing,
        cells,
        faces,
        columns: info
            .datasets
            .into_iter()
            .filter(|d| d.path.starts_with("/VTKHDF/CellData/"))
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Alone, Data};

    #[test]
    fn a_lattice_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("fluid.vtkhdf");
        let u: Vec<f32> = (0..2 * 3 * 4 * 3).map(|i| i as f32).collect();
        let flag = vec![1_u8; 24];
        let image = Image {
            origin: [0.5, 1.0, -1.0],
            spacing: [0.1, 0.2, 0.3],
            faces: None,
            cells: [4, 3, 2],
            start: [0; 3],
            count: [4, 3, 2],
            fields: vec![
                Column {
                    name: "velocity",
                    units: "m/s",
                    components: 3,
                    data: Data::F32(&u),
                },
                Column {
                    name: "flag",
                    units: "-",
                    components: 1,
                    data: Data::U8(&flag),
                },
            ],
        };
        let when = OutputTime {
            step: 7,
            time: 0.25,
        };
        let provenance = [("version".to_owned(), "1".to_owned())];
        write(&path, when, &image, &provenance, &Alone, Mode::Collective).unwrap();
        let back = open(&path).unwrap();
        assert_eq!((back.when, back.cells), (when, [4, 3, 2]));
        assert_eq!((back.origin, back.spacing), (image.origin, image.spacing));
        let velocity = crate::fields::read_column(&path, "velocity").unwrap();
        assert_eq!(velocity.shape, vec![2, 3, 4, 3]);
        assert_eq!(velocity.units.as_deref(), Some("m/s"));
        let written: Vec<f64> = u.iter().map(|&x| f64::from(x)).collect();
        assert_eq!(velocity.values, written);
        assert_eq!(
            crate::fields::read_column(&path, "flag").unwrap().shape,
            vec![2, 3, 4]
        );
    }

    /// Checks that faces come back, and that the index refers to them.
    #[test]
    fn cells_of_different_widths_come_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("seepage.vtkhdf");
        let head = [1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0];
        let faces = [
            vec![0.0, 1.0, 3.0, 3.5],
            vec![1.0, 2.0, 4.0],
            vec![0.0, 1.0],
        ];
        let image = Image {
            origin: [0.0, 1.0, 0.0],
            spacing: [0.5, 1.0, 1.0],
            faces: Some(faces.clone()),
            cells: [3, 2, 1],
            start: [0; 3],
            count: [3, 2, 1],
            fields: vec![Column {
                name: "head",
                units: "m",
                components: 1,
                data: Data::F32(&head),
            }],
        };
        let when = OutputTime { step: 1, time: 0.5 };
        write(&path, when, &image, &[], &Alone, Mode::Collective).unwrap();
        let back = open(&path).unwrap();
        assert_eq!((back.cells, back.faces), ([3, 2, 1], Some(faces)));
        assert_eq!((back.origin, back.spacing), (image.origin, image.spacing));
        assert_eq!(
            crate::fields::read_column(&path, "head").unwrap().shape,
            [1, 2, 3]
        );
        let (_, index) = crate::xdmf::grid(&path).unwrap();
        for part in [
            "TopologyType=\"3DRectMesh\" Dimensions=\"2 3 4\"",
            "GeometryType=\"VXVYVZ\"",
            "Dimensions=\"4\">seepage.vtkhdf:/VTKHDF/XCoordinates",
            "Dimensions=\"1 2 3\">seepage.vtkhdf:/VTKHDF/CellData/head",
        ] {
            assert!(index.contains(part), "{part}\n{index}");
        }
    }

    #[test]
    fn wrong_lattices_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.vtkhdf");
        let image = Image {
            origin: [0.0; 3],
            spacing: [1.0, 0.0, 1.0],
            faces: None,
            cells: [1; 3],
            start: [0; 3],
            count: [1; 3],
            fields: vec![],
        };
        let refused = |image: &Image| {
            let when = OutputTime { step: 0, time: 0.0 };
            write(&path, when, image, &[], &Alone, Mode::Gather).is_err()
        };
        assert!(refused(&image));
        let mut image = Image {
            spacing: [1.0; 3],
            ..image
        };
        assert!(!refused(&image));
        image.faces = Some([vec![0.0, 1.0], vec![0.0, 1.0], vec![1.0, 1.0]]);
        assert!(refused(&image));
        image.faces = None;
        image.cells = [0, 1, 1];
        assert!(refused(&image));
    }
}
