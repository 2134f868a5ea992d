//! XDMF: the text file that refers to the arrays of a data file.
//!
//! Only forms that both generations of ParaView's XDMF readers accept are used: whole datasets, one for each field
//! and step, counts in the order z y x, vertices with an explicit list, scalars, vectors and 9-component tensors.
//! The text is generated from the data file, so that types and shapes agree.

use std::fmt::Write;
use std::path::Path;

use crate::error::{Error, Result};
use crate::fields::{DatasetInfo, FileInfo, inspect};
use crate::image;
use crate::mesh::MIXED;
use crate::moment::OutputTime;

/// Returns the `<Grid>` of one data file, and its step and time.
pub(crate) fn grid(path: &Path) -> Result<(OutputTime, String)> {
    let info = inspect(path)?;
    let when = OutputTime::read(&info, path)?;
    let kind = info.attribute("/VTKHDF", "Type").and_then(|v| v.as_str());
    let text = match kind {
        Some("ImageData" | image::RECTILINEAR) => image_grid(path, &info, when)?,
        Some("PolyData") => mesh_grid(path, &info, when)?,
        _ => {
            return Err(Error::corrupt(path, "neither a lattice nor a mesh"));
        }
    };
    Ok((when, text))
}

fn stem(path: &Path) -> &str {
    path.file_stem()
        .and_then(|s| s.to_str())
        .unwrap_or_default()
}

/// Returns the first line of a grid; [`crate::series`] reads the time back from it.
fn head(path: &Path, when: OutputTime) -> String {
    format!(
        "  <Grid Name=\"{}\" GridType=\"Uniform\"><Time Value=\"{:?}\"/>\n",
        stem(path),
        when.time
    )
}

fn image_grid(path: &Path, info: &FileInfo, when: OutputTime) -> Result<String> {
    let image = image::open(path)?;
    let [nx, ny, nz] = image.cells.map(|n| n + 1);
    let [ox, oy, oz] = image.origin;
    let [dx, dy, dz] = image.spacing;
    let mut text = head(path, when);
    if image.faces.is_some() {
        let _ = write!(
            text,
            "   <Topology TopologyType=\"3DRectMesh\" Dimensions=\"{nz} {ny} {nx}\"/>\n   \
             <Geometry GeometryType=\"VXVYVZ\">\n"
        );
        for name in image::COORDINATES {
            let faces = info.dataset(&format!("/VTKHDF/{name}"));
            let faces = faces.ok_or_else(|| Error::corrupt(path, format!("no {name}")))?;
            let _ = writeln!(text, "    {}", item(path, faces)?);
        }
        text.push_str("   </Geometry>\n");
        for column in &image.columns {
            attribute(&mut text, path, column, "Cell", 3)?;
        }
        text.push_str("  </Grid>\n");
        return Ok(text);
    }
    let three = "<DataItem Dimensions=\"3\" NumberType=\"Float\" Precision=\"8\" Format=\"XML\">";
    // Writing to a String cannot fail.
    let _ = write!(
        text,
        "   <Topology TopologyType=\"3DCoRectMesh\" Dimensions=\"{nz} {ny} {nx}\"/>\n   \
         <Geometry GeometryType=\"ORIGIN_DXDYDZ\">\n    \
         {three}{oz:?} {oy:?} {ox:?}</DataItem>\n    \
         {three}{dz:?} {dy:?} {dx:?}</DataItem></Geometry>\n"
    );
    for column in &image.columns {
        attribute(&mut text, path, column, "Cell", 3)?;
    }
    text.push_str("  </Grid>\n");
    Ok(text)
}

fn mesh_grid(path: &Path, info: &FileInfo, when: OutputTime) -> Result<String> {
    let missing = |what: &str| Error::corrupt(path, format!("no {what}"));
    let dataset = |name: &str| info.dataset(name).ok_or_else(|| missing(name));
    let cells = |list: &str| -> Result<usize> {
        let offsets = dataset(&format!("/VTKHDF/{list}/Offsets"))?;
        Ok(offsets.shape.first().map_or(0, |n| n.saturating_sub(1)))
    };
    let (kind, nodes, list) = if cells("Vertices")? > 0 {
        ("Polyvertex", " NodesPerElement=\"1\"", "Vertices")
    } else if cells("Lines")? > 0 {
        ("Polyline", " NodesPerElement=\"2\"", "Lines")
    } else if cells("Polygons")? > 0 {
        ("Mixed", "", "Polygons")
    } else {
        return without_cells(path, info, when);
    };
    let ids = match list {
        "Polygons" => dataset(MIXED)?,
        _ => dataset(&format!("/VTKHDF/{list}/Connectivity"))?,
    };
    let mut text = head(path, when);
    let _ = writeln!(
        text,
        "   <Topology TopologyType=\"{kind}\" NumberOfElements=\"{}\"{nodes}>\n    {}</Topology>",
        cells(list)?,
        item(path, ids)?
    );
    let _ = writeln!(
        text,
        "   <Geometry GeometryType=\"XYZ\">\n    {}</Geometry>",
        item(path, dataset("/VTKHDF/Points")?)?
    );
    for column in &info.datasets {
        if column.path.starts_with("/VTKHDF/PointData/") {
            attribute(&mut text, path, column, "Node", 1)?;
        } else if column.path.starts_with("/VTKHDF/CellData/") {
            attribute(&mut text, path, column, "Cell", 1)?;
        }
    }
    text.push_str("  </Grid>\n");
    Ok(text)
}

/// Topology of a grid without cells.
const NO_CELLS: &str =
    "<Topology TopologyType=\"Polyvertex\" NumberOfElements=\"0\" NodesPerElement=\"1\"/>";

/// Returns `true` if a grid has cells.
pub(crate) fn has_cells(grid: &str) -> bool {
    !grid.contains(NO_CELLS)
}

/// Returns the grid of a step without cells, which has one point with values of 0: readers report grids without points
/// as errors, and an omitted step would show the one before it.
fn without_cells(path: &Path, info: &FileInfo, when: OutputTime) -> Result<String> {
    let mut text = head(path, when);
    let values = |width: usize| {
        let zeros = vec!["0"; width].join(" ");
        let dimensions = if width == 1 {
            "1".to_owned()
        } else {
            format!("1 {width}")
        };
        (dimensions, zeros)
    };
    let (dimensions, zeros) = values(3);
    let _ = write!(
        text,
        "   {NO_CELLS}\n   <Geometry GeometryType=\"XYZ\">\n    \
         <DataItem Format=\"XML\" NumberType=\"Float\" Precision=\"8\" Dimensions=\"{dimensions}\">{zeros}\
         </DataItem></Geometry>\n"
    );
    let of_points = |column: &&DatasetInfo| column.path.starts_with("/VTKHDF/PointData/");
    for column in info.datasets.iter().filter(of_points) {
        let kind = rank(path, column, 1)?;
        let (number, precision) = number_type(path, column)?;
        let (dimensions, zeros) = values(column.shape.get(1).copied().unwrap_or(1));
        let _ = writeln!(
            text,
            "   <Attribute Name=\"{}\" AttributeType=\"{kind}\" Center=\"Node\">\n    <DataItem Format=\"XML\" \
             NumberType=\"{number}\" Precision=\"{precision}\" Dimensions=\"{dimensions}\">{zeros}</DataItem>\
             </Attribute>",
            column.name()
        );
    }
    text.push_str("  </Grid>\n");
    Ok(text)
}

/// Returns the rank of a field as XDMF names it; `axes` are those of its places.
fn rank(path: &Path, column: &DatasetInfo, axes: usize) -> Result<&'static str> {
    match column.shape.get(axes) {
        None => Ok("Scalar"),
        Some(3) => Ok("Vector"),
        Some(9) => Ok("Tensor"),
        Some(n) => Err(Error::corrupt(
            path,
            format!("{} has {n} components", column.path),
        )),
    }
}

/// Returns the type of the numbers of a dataset and their size in bytes.
fn number_type(path: &Path, dataset: &DatasetInfo) -> Result<(&'static str, usize)> {
    (dataset.kind.and_then(|kind| kind.xdmf()))
        .ok_or_else(|| Error::corrupt(path, format!("{} has no XDMF type", dataset.path)))
}

/// Writes one field; `axes` are those of its places, and an additional one is the component.
fn attribute(
    text: &mut String,
    path: &Path,
    column: &DatasetInfo,
    center: &str,
    axes: usize,
) -> Result<()> {
    let kind = rank(path, column, axes)?;
    let _ = writeln!(
        text,
        "   <Attribute Name=\"{}\" AttributeType=\"{kind}\" Center=\"{center}\">\n    {}</Attribute>",
        column.name(),
        item(path, column)?
    );
    Ok(())
}

fn item(path: &Path, dataset: &DatasetInfo) -> Result<String> {
    let (number, precision) = number_type(path, dataset)?;
    let shape: Vec<String> = dataset.shape.iter().map(usize::to_string).collect();
    let file = path
        .file_name()
        .and_then(|s| s.to_str())
        .unwrap_or_default();
    Ok(format!(
        "<DataItem Format=\"HDF\" NumberType=\"{number}\" Precision=\"{precision}\" \
         Dimensions=\"{}\">{file}:{}</DataItem>",
        shape.join(" "),
        dataset.path
    ))
}
