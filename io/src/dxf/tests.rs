//! Tests of the reader of drawings: files of several programs, arcs, and what is refused.

#![allow(
    clippy::float_cmp,
    reason = "numbers of a drawing are read without rounding"
)]

use super::*;

/// A polyline of a point cloud, closed by a last vertex equal to the first, in a file without units that CloudCompare
/// 2.10 wrote with dxflib 3.17 (from the tests of ezdxf, MIT licence in the same folder).
const DXFLIB: &str = include_str!("../../../tests/reference/dxf/dxflib.dxf");
/// The section of a dam in mm, R2010 with LWPOLYLINE, written with ezdxf 1.4.
const EZDXF: &str = include_str!("../../../tests/reference/dxf/dam-ezdxf.dxf");
/// That section in m, R12 with POLYLINE, written with the R12 writer of ezdxf 1.4.
const R12: &str = include_str!("../../../tests/reference/dxf/dam-r12.dxf");

fn drawing(entities: &str) -> String {
    format!("0\nSECTION\n2\nENTITIES\n{entities}0\nENDSEC\n0\nEOF\n")
}

fn area(points: &[[f64; 2]]) -> f64 {
    let next = points.iter().cycle().skip(1);
    let twice = points.iter().zip(next);
    let twice = twice.map(|(a, b)| a[0] * b[1] - a[1] * b[0]);
    0.5 * twice.sum::<f64>()
}

#[test]
fn a_polyline_of_dxflib_is_closed_by_its_ends() {
    let drawing = read(DXFLIB.as_bytes()).unwrap();
    assert_eq!(drawing.unit, None);
    let [line] = &drawing.polylines[..] else {
        panic!("{drawing:?}")
    };
    assert_eq!(
        (line.layer.as_str(), line.vertices.len()),
        ("POLYLINE_001", 4)
    );
    assert!(line.closed);
    assert_eq!(
        line.vertices[1].at,
        [0.302_861_690_521_240_2, -1.579_475_760_459_9]
    );
}

#[test]
fn both_forms_of_a_polyline_have_the_same_corners() {
    let (light, heavy) = (
        read(EZDXF.as_bytes()).unwrap(),
        read(R12.as_bytes()).unwrap(),
    );
    assert_eq!(light.unit, Some(1e-3));
    assert_eq!(heavy.unit, None);
    let of = |drawing: &Drawing, layer: &str| {
        let found = drawing.polylines.iter().find(|line| line.layer == layer);
        found
            .unwrap_or_else(|| panic!("{layer}: {drawing:?}"))
            .clone()
    };
    for layer in ["DAM", "SAND", "GRAVEL", "SURFACE"] {
        let (one, other) = (of(&light, layer), of(&heavy, layer));
        assert_eq!(one.closed, layer != "SURFACE");
        assert_eq!(one.closed, other.closed, "{layer}");
        assert_eq!(one.vertices.len(), other.vertices.len(), "{layer}");
        for (a, b) in one.vertices.iter().zip(&other.vertices) {
            assert!(
                (0..2).all(|k| (1e-3 * a.at[k] - b.at[k]).abs() < 1e-9),
                "{layer}"
            );
            assert!((a.bulge - b.bulge).abs() < 1e-9, "{layer}");
        }
    }
    assert!(
        light.others["NOTES"].contains_key("TEXT"),
        "{:?}",
        light.others
    );
}

/// Checks a circle of two half circles, either way round: every point lies on it, chords are within the tolerance, and
/// the area is that of a regular polygon.
#[test]
fn a_bulge_is_an_arc() {
    for (bulge, sign) in [("1", 1.0), ("-1", -1.0)] {
        let text = drawing(&format!(
            "0\nLWPOLYLINE\n8\nround\n90\n2\n70\n1\n10\n1\n20\n5\n42\n{bulge}\n10\n5\n20\n5\n42\n{bulge}\n"
        ));
        let line = read(text.as_bytes()).unwrap().polylines.remove(0);
        let points = line.points(1e-3);
        for at in &points {
            assert!(((at[0] - 3.0).hypot(at[1] - 5.0) - 2.0).abs() < 1e-12);
        }
        // 2 r (1 - cos(pi/n)) <= 2e-3 of a circle of radius 2 needs 100 points.
        let count = f64::from(u32::try_from(points.len()).unwrap());
        let sagitta = 2.0 * (1.0 - (std::f64::consts::PI / count).cos());
        assert!(sagitta <= 1e-3 && points.len() < 120, "{}", points.len());
        let exact = 0.5 * count * 4.0 * (2.0 * std::f64::consts::PI / count).sin();
        assert!((area(&points) / exact - sign).abs() < 1e-12);
    }
    // A quarter circle around the origin, from (1, 0) to (0, 1).
    let quarter = (std::f64::consts::PI / 8.0).tan();
    let text = drawing(&format!(
        "0\nLWPOLYLINE\n8\nround\n70\n0\n10\n1\n20\n0\n42\n{quarter}\n10\n0\n20\n1\n"
    ));
    let points = read(text.as_bytes()).unwrap().polylines[0].points(1e-4);
    assert!(
        points
            .iter()
            .all(|at| (at[0].hypot(at[1]) - 1.0).abs() < 1e-12)
    );
    assert_eq!(points[points.len() - 1], [0.0, 1.0]);
}

#[test]
fn a_polyline_seen_from_behind_is_mirrored() {
    let text = drawing(
        "0\nLWPOLYLINE\n8\nback\n70\n1\n230\n-1\n10\n1\n20\n0\n10\n3\n20\n0\n10\n3\n20\n2\n",
    );
    let line = read(text.as_bytes()).unwrap().polylines.remove(0);
    assert_eq!(line.vertices[0].at, [-1.0, 0.0]);
    let inclined = text.replace("-1\n10", "0.7\n10");
    let drawing = read(inclined.as_bytes()).unwrap();
    assert!(drawing.polylines.is_empty() && drawing.others["back"].len() == 1);
}

#[test]
fn other_entities_and_layouts_are_left_out() {
    let text = drawing(
        "0\nLINE\n8\nRAND\\U+00C4\n10\n0\n20\n0\n11\n1\n21\n1\n\
         0\nLWPOLYLINE\n8\nframe\n67\n1\n70\n1\n10\n0\n20\n0\n10\n1\n20\n0\n",
    );
    let drawing = read(text.as_bytes()).unwrap();
    assert!(drawing.polylines.is_empty());
    assert_eq!(drawing.others["RAND\u{c4}"]["LINE"], 1);
}

#[test]
fn wrong_files_are_refused_by_line() {
    for (bytes, reason) in [
        (&b"AutoCAD Binary DXF\r\n\x1a\x00"[..], "binary"),
        (b"AC1027\x00\x00", "DWG"),
        (
            b"solid cube\nfacet",
            "line 1: `solid cube` is not a group code",
        ),
        (b"0\nSECTION\n2\nENTITIES\n", "incomplete"),
        (b"0\nSECTION\n2\n", "line 3: the file ends"),
        (b"", "incomplete"),
    ] {
        let found = read(bytes).unwrap_err();
        assert!(found.contains(reason), "{found}");
    }
    let text = drawing("0\nLWPOLYLINE\n8\na\n10\n1,5\n20\n0\n");
    let found = read(text.as_bytes()).unwrap_err();
    assert!(found.contains("line 10: `1,5` is not a number"), "{found}");
    let open = drawing("0\nPOLYLINE\n8\na\n66\n1\n0\nVERTEX\n8\na\n10\n0\n20\n0\n");
    assert!(read(open.as_bytes()).unwrap_err().contains("has no end"));
}
