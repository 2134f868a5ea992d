//! Distances, chords and surfaces of all shapes, against one another and against closed forms.

use super::*;
use base::error::Remedy;
use base::geometry::Mesh;
use base::number::{real, to_u32};
use base::random::Stream;

const SPACE: Frame = Frame {
    dimension: 3,
    size: [4.0, 3.0, 2.0],
};
const FLAT: Frame = Frame {
    dimension: 2,
    size: [4.0, 3.0, 1.0],
};

#[derive(Default)]
struct Messages(Vec<String>);

impl Report for Messages {
    fn error(&mut self, path: &str, reason: String, _: Remedy) {
        self.0.push(format!("{path}: {reason}"));
    }

    fn unknown_material(&mut self, _: &str, _: &str, _: &[&str]) {}
}

fn made(text: &str, frame: &Frame, read: ReadMesh<'_>) -> Result<Arc<dyn Solid>, String> {
    let shape: Shape = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let mut heard = Messages::default();
    let solid = shape.solid(frame, "shape", read, &mut heard);
    match (solid, heard.0.is_empty()) {
        (Some(solid), true) => Ok(solid),
        _ => Err(heard.0.join("; ")),
    }
}

fn none(_: &Mesh) -> Result<Vec<[Point; 3]>, String> {
    Err("no file".into())
}

/// Returns an L-shaped prism, not convex, as triangles.
fn ell() -> Vec<[Point; 3]> {
    let solid = made(L_SHAPE, &SPACE, &none).unwrap();
    let facets = solid.facets(0.0);
    let corner = |k: u32| facets.vertices[k as usize];
    facets
        .faces
        .iter()
        .flat_map(|face| (2..face.len()).map(|k| [face[0], face[k - 1], face[k]].map(corner)))
        .collect()
}

const L_SHAPE: &str = r#"{"polygon": {"points": [[1, 0.5], [3, 0.5], [3, 1], [1.5, 1], [1.5, 1.8], [1, 1.8]],
    "axis": "y", "from": 0.4, "to": 2.6}}"#;

fn shapes() -> Vec<(Frame, &'static str)> {
    vec![
        (
            SPACE,
            r#"{"plane": {"point": [2, 1, 1], "normal": [1, 2, -2]}}"#,
        ),
        (
            SPACE,
            r#"{"box": {"from": [1, 0.5, 0.4], "to": [3, 2, 1.5]}}"#,
        ),
        (SPACE, L_SHAPE),
        (
            SPACE,
            r#"{"sphere": {"centre": [2, 1.5, 1], "radius": 0.8}}"#,
        ),
        (
            SPACE,
            r#"{"cylinder": {"from": [1, 1, 0.3], "to": [3, 2, 1.2], "radius": 0.5}}"#,
        ),
        (SPACE, r#"{"surface": {"mesh": {"path": "ell.stl"}}}"#),
        (
            SPACE,
            r#"{"surface": {"mesh": {"path": "ell.stl"}, "thickness": 0.2}}"#,
        ),
        (FLAT, r#"{"plane": {"point": [2, 1], "normal": [1, 3]}}"#),
        (FLAT, r#"{"box": {"from": [1, 0.5], "to": [3, 2]}}"#),
        (
            FLAT,
            r#"{"polygon": {"points": [[1, 0.5], [1, 1.8], [1.5, 1.8], [1.5, 1], [3, 1], [3, 0.5]]}}"#,
        ),
        (FLAT, r#"{"disc": {"centre": [2, 1.5], "radius": 0.8}}"#),
    ]
}

fn point(draw: &mut Stream, frame: &Frame) -> Point {
    let mut at: Point = std::array::from_fn(|a| frame.size[a] * (1.2 * draw.uniform() - 0.1));
    at[frame.dimension..].fill(0.0);
    at
}

/// Checks that the exact chords agree with those computed from the distance alone, and that the distance never exceeds
/// that to a point of the other sign.
#[test]
fn distances_and_chords_agree_for_every_shape() {
    for (frame, text) in shapes() {
        let solid = made(text, &frame, &|_| Ok(ell())).unwrap();
        let mut met = 0;
        for k in 0..60 {
            let mut draw = Stream::new(3, k, 0);
            let (a, b) = (point(&mut draw, &frame), point(&mut draw, &frame));
            let along = minus(b, a);
            let (mut exact, mut traced) = (Vec::new(), Vec::new());
            solid.chords(a, along, &mut exact);
            solid::trace(&*solid, a, along, &mut traced);
            // A corner that is cut by less than a step is passed over.
            exact.retain(|[s, t]| t - s > 2e-3);
            traced.retain(|[s, t]| t - s > 2e-3);
            assert_eq!(
                exact.len(),
                traced.len(),
                "{text} {a:?} {b:?} {exact:?} {traced:?}"
            );
            for (x, y) in exact.as_flattened().iter().zip(traced.as_flattened()) {
                assert!((x - y).abs() < 1e-9, "{text}: {x} {y}");
            }
            met += exact.len();
            let (p, q) = (solid.distance(a), solid.distance(b));
            assert!((p - q).abs() <= norm(along) * (1.0 + 1e-12), "{text}");
            let [low, high] = solid.extent();
            let inside = (0..frame.dimension).all(|n| low[n] <= a[n] && a[n] <= high[n]);
            assert!(p > 0.0 || inside, "{text} at {a:?}");
        }
        assert!(met > 5, "{text}: {met}");
    }
}

/// Checks that corners of facets lie on the surface, and that facets face outwards and close the volume.
#[test]
fn facets_close_the_volume_of_a_solid() {
    let volumes = [
        (
            r#"{"box": {"from": [1, 0.5, 0.4], "to": [3, 2, 1.5]}}"#,
            2.0 * 1.5 * 1.1,
            1e-12,
        ),
        (L_SHAPE, 2.2 * (2.0 * 0.5 + 0.5 * 0.8), 1e-12),
        (
            r#"{"sphere": {"centre": [2, 1.5, 1], "radius": 0.8}}"#,
            4.0 / 3.0 * std::f64::consts::PI * 0.512,
            5e-3,
        ),
        (
            r#"{"cylinder": {"from": [1, 1, 0.5], "to": [1, 1, 1.5], "radius": 0.5}}"#,
            0.25 * std::f64::consts::PI,
            3e-3,
        ),
    ];
    for (text, expected, within) in volumes {
        let solid = made(text, &SPACE, &none).unwrap();
        let facets = solid.facets(1e-3);
        let corner = |k: u32| facets.vertices[k as usize];
        let mut volume = 0.0;
        for face in &facets.faces {
            for k in 2..face.len() {
                let [a, b, c] = [face[0], face[k - 1], face[k]].map(corner);
                volume += dot(a, cross(b, c)) / 6.0;
            }
            for &k in face {
                assert!(solid.distance(corner(k)).abs() < 1e-12, "{text}");
            }
        }
        assert!(
            (volume / expected - 1.0).abs() < within,
            "{text}: {volume} {expected}"
        );
    }
    let triangles = mesh::TriangleMesh::new(&ell()).unwrap();
    assert!((triangles.volume() / 3.08 - 1.0).abs() < 1e-12);
    assert_eq!(triangles.open_edges(), 0);
}

/// Checks that the middle of the largest facet of a round solid lies at the stated distance below its surface, also
/// where the number of facets is at its limit.
#[test]
fn deviation_is_that_of_the_largest_facet() {
    for text in [
        r#"{"sphere": {"centre": [2, 1.5, 1], "radius": 0.8}}"#,
        r#"{"cylinder": {"from": [1, 1, 0.5], "to": [1, 1, 1.5], "radius": 0.5}}"#,
    ] {
        let solid = made(text, &SPACE, &none).unwrap();
        for tolerance in [1e-2, 1e-3, 1e-9] {
            let facets = solid.facets(tolerance);
            let middle = |face: &Vec<u32>| {
                let sum = (face.iter().map(|&k| facets.vertices[k as usize])).fold([0.0; 3], plus);
                solid.distance(times(sum, 1.0 / f64::from(to_u32(face.len()))))
            };
            let sides = facets.faces.iter().filter(|face| face.len() == 4);
            let deepest = sides.map(middle).fold(0.0, f64::min);
            let deviation = solid.deviation(tolerance);
            assert!(
                (deepest / -deviation - 1.0).abs() < 1e-2,
                "{text} {tolerance}: {deepest} {deviation}"
            );
            assert!(
                deviation <= tolerance || tolerance < 1e-8,
                "{text} {tolerance}: {deviation}"
            );
        }
    }
}

/// Checks that the distance of an L made of triangles is that of the L in closed form, also near its edges and corners.
#[test]
fn a_surface_of_triangles_has_the_distance_of_its_solid() {
    let exact = made(L_SHAPE, &SPACE, &none).unwrap();
    // Turned inside out it is the same solid.
    let reversed: Vec<[Point; 3]> = ell().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    for triangles in [ell(), reversed] {
        let mesh = mesh::TriangleMesh::new(&triangles).unwrap();
        for k in 0..400 {
            let at = point(&mut Stream::new(9, k, 0), &SPACE);
            let (a, b) = (exact.distance(at), mesh.distance(at));
            // Inside, the closed form is a bound where two faces of the L meet.
            let same = (a - b).abs() < 1e-12 || (a < 0.0 && b < 0.0 && a >= b - 1e-12);
            assert!(same, "{at:?}: {a} {b}");
        }
    }
}

/// Returns a box of triangles between two corners, facing outwards.
fn boxed(low: Point, high: Point) -> Vec<[Point; 3]> {
    let at = |k: usize| std::array::from_fn(|a| if k >> a & 1 == 0 { low[a] } else { high[a] });
    let faces = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let faces = faces.map(|face| face.map(at));
    faces
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect()
}

fn turned(triangles: &[[Point; 3]]) -> Vec<[Point; 3]> {
    triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect()
}

/// Function that is `true` inside a part of space.
type Holds<'a> = &'a dyn Fn(&Point) -> bool;

/// Checks that the sign of the distance, and the length of lines along the axes inside several shells, are those of
/// their union, and that a reversed shell inside another shell is a cavity.
#[test]
fn shells_that_cross_are_one_solid() {
    let one = boxed([0.5, 0.5, 0.5], [2.5, 2.0, 1.5]);
    let two = boxed([1.7, 0.9, 0.2], [3.5, 2.4, 1.2]);
    let inner = boxed([1.0, 1.0, 0.8], [1.5, 1.5, 1.2]);
    let in_box =
        |at: &Point, low: Point, high: Point| (0..3).all(|a| low[a] < at[a] && at[a] < high[a]);
    let in_one = |at: &Point| in_box(at, [0.5, 0.5, 0.5], [2.5, 2.0, 1.5]);
    let in_two = |at: &Point| in_box(at, [1.7, 0.9, 0.2], [3.5, 2.4, 1.2]);
    let in_inner = |at: &Point| in_box(at, [1.0, 1.0, 0.8], [1.5, 1.5, 1.2]);
    let union = |at: &Point| in_one(at) || in_two(at);
    let hollow = |at: &Point| in_one(at) && !in_inner(at);
    // Winding of some triangles, or of a whole shell, the wrong way round.
    let mut mixed = [one.clone(), two.clone()].concat();
    for k in [1, 4, 5, 17] {
        mixed[k] = [mixed[k][0], mixed[k][2], mixed[k][1]];
    }
    let cases: [(Vec<[Point; 3]>, Holds<'_>); 5] = [
        ([one.clone(), two.clone()].concat(), &union),
        ([one.clone(), turned(&two)].concat(), &union),
        (mixed, &union),
        ([one.clone(), turned(&inner)].concat(), &hollow),
        ([turned(&one), inner.clone()].concat(), &hollow),
    ];
    for (n, (triangles, inside)) in cases.iter().enumerate() {
        let mesh = mesh::TriangleMesh::new(triangles).unwrap();
        for k in 0..600 {
            let at = point(&mut Stream::new(5, k, 0), &SPACE);
            assert_eq!(mesh.distance(at) < 0.0, inside(&at), "{n}: {at:?}");
        }
        for k in 0..40 {
            let mut draw = Stream::new(8, k, 0);
            let (from, to) = (point(&mut draw, &SPACE), point(&mut draw, &SPACE));
            let along = minus(to, from);
            let mut found = Vec::new();
            mesh.chords(from, along, &mut found);
            let length: f64 = found.iter().map(|[s, t]| t - s).sum();
            let on = |k: u32| plus(from, times(along, (f64::from(k) + 0.5) / 2000.0));
            let sampled = (0..2000).filter(|k| inside(&on(*k))).count();
            let sampled = real(sampled) / 2000.0;
            assert!((length - sampled).abs() < 3e-3, "{n}: {length} {sampled}");
        }
    }
}

/// Lines in the plane of a face, along an edge or through corners are inside or outside as a whole, and cost no
/// more than others.
#[test]
fn lines_that_graze_a_surface_are_sure() {
    let mesh = mesh::TriangleMesh::new(&boxed([0.5, 0.5, 0.5], [2.5, 2.0, 1.5])).unwrap();
    let chords = |from: Point, to: Point| {
        let mut found = Vec::new();
        mesh.chords(from, minus(to, from), &mut found);
        found
    };
    // In the plane of the top, and along its edge.
    assert!(chords([0.0, 1.0, 1.5], [3.0, 1.1, 1.5]).is_empty());
    assert!(chords([0.0, 2.0, 1.5], [3.0, 2.0, 1.5]).is_empty());
    // Through two corners, and through the diagonal of two faces.
    let through = chords([-0.5, -0.25, 0.0], [3.5, 2.75, 2.0]);
    assert_eq!(through.len(), 1, "{through:?}");
    assert!((through[0][0] - 0.25).abs() < 1e-9 && (through[0][1] - 0.75).abs() < 1e-9);
    let across = chords([1.5, 1.25, 0.0], [1.5, 1.25, 2.0]);
    assert_eq!(across.len(), 1);
    assert!((across[0][0] - 0.25).abs() < 1e-9 && (across[0][1] - 0.75).abs() < 1e-9);
    // From a point of the surface.
    assert!(chords([1.5, 1.25, 1.5], [1.5, 1.25, 2.0]).is_empty());
    let down = chords([1.5, 1.25, 1.5], [1.5, 1.25, 1.0]);
    assert!((down[0][1] - down[0][0] - 1.0).abs() < 1e-9, "{down:?}");
}

#[test]
fn solids_that_are_none_are_refused_by_name() {
    let open: Vec<[Point; 3]> = ell()[1..].to_vec();
    let refused = |text: &str, frame: &Frame, triangles: &[[Point; 3]]| {
        made(text, frame, &|_| Ok(triangles.to_vec())).unwrap_err()
    };
    let bow = r#"{"polygon": {"points": [[0, 0], [1, 1], [1, 0], [0, 1]]}}"#;
    assert!(refused(bow, &FLAT, &[]).contains("crosses or touches itself"));
    let spike = r#"{"polygon": {"points": [[0, 0], [1, 0], [2, 0], [1, 0], [1, 1]]}}"#;
    assert!(refused(spike, &FLAT, &[]).contains("crosses or touches itself"));
    let line = r#"{"polygon": {"points": [[0, 0], [1, 1], [2, 2]]}}"#;
    assert!(!refused(line, &FLAT, &[]).is_empty());
    let stl = r#"{"surface": {"mesh": {"path": "a.stl"}}}"#;
    assert!(refused(stl, &SPACE, &open).contains("open: 3 of its edges"));
    let mut folded = ell();
    let [a, b, _] = folded[0];
    folded.push([a, b, [2.0, 2.0, 3.0]]);
    assert!(refused(stl, &SPACE, &folded).contains("3 triangles meet at an edge"));
    assert!(refused(stl, &FLAT, &ell()).contains("does not fit a 2-D problem"));
    let flat = r#"{"box": {"from": [1, 1], "to": [2, 1]}}"#;
    assert!(refused(flat, &FLAT, &[]).contains("no volume"));
    let ends =
        r#"{"polygon": {"points": [[0, 0], [1, 0], [1, 1]], "axis": "z", "from": 2, "to": 1}}"#;
    assert!(refused(ends, &SPACE, &[]).contains("needs `axis`"));
    let sheet = r#"{"surface": {"mesh": {"path": "a.stl"}, "thickness": 0.1}}"#;
    assert!(made(sheet, &SPACE, &|_| Ok(open.clone())).is_ok());
}

/// Checks that a solid across a periodic face is complete.
#[test]
fn images_join_across_periodic_faces() {
    let solid = made(
        r#"{"disc": {"centre": [3.9, 1.5], "radius": 0.5}}"#,
        &FLAT,
        &none,
    )
    .unwrap();
    let images = Images::new(solid, FLAT, [true, false, false], 0.1);
    assert_eq!(images.extents().count(), 2);
    assert!((images.distance([0.1, 1.5, 0.0]) + 0.3).abs() < 1e-12);
    let mut found = Vec::new();
    images.chords([0.0, 1.5, 0.0], [4.0, 0.0, 0.0], &mut found);
    let expected = [[0.0, 0.1], [0.85, 1.0]];
    assert_eq!(found.len(), 2);
    for (a, b) in found.as_flattened().iter().zip(expected.as_flattened()) {
        assert!((a - b).abs() < 1e-12);
    }
    let away = made(
        r#"{"disc": {"centre": [9, 1.5], "radius": 0.5}}"#,
        &FLAT,
        &none,
    )
    .unwrap();
    assert!(Images::new(away, FLAT, [false; 3], 0.1).is_empty());
    // Counter-clockwise, so that the area is positive.
    let area: f64 = images
        .drawn(1e-4)
        .faces
        .iter()
        .map(|face| face.len())
        .map(real)
        .sum();
    assert!(area > 0.0);
}

/// Checks that an inclined half-space ends at a periodic face: chords by hand, and distances below those from the
/// nearest points on the other side of the surface.
#[test]
fn a_half_space_across_a_periodic_axis_has_a_step_at_its_face() {
    // Solid below y = 2 - x/2 for x in the domain of width 4, and again in each period.
    let shape = r#"{"plane": {"normal": [1, 2], "point": [0, 2]}}"#;
    let solid = made(shape, &FLAT, &none).unwrap();
    let images = Images::new(solid, FLAT, [true, false, false], 0.1);
    let is_solid = |[x, y]: [f64; 2]| y < 2.0 - 0.5 * x.rem_euclid(4.0);
    let mut found = Vec::new();
    let mut chords = |from, along| {
        images.chords(from, along, &mut found);
        found.clone()
    };
    // From water in front of the step into it, back out of it, and through the water of two periods.
    assert_eq!(chords([3.5, 1.0, 0.0], [1.0, 0.0, 0.0]), [[0.5, 1.0]]);
    assert_eq!(chords([0.5, 1.0, 0.0], [-1.0, 0.0, 0.0]), [[0.0, 0.5]]);
    assert_eq!(chords([3.5, 2.5, 0.0], [1.0, 0.0, 0.0]), [[0.0; 2]; 0]);
    // Solid on both sides of the face.
    assert_eq!(chords([3.5, -0.5, 0.0], [1.0, 0.0, 0.0]), [[0.0, 1.0]]);
    for n in 0..40 {
        for m in 0..30 {
            let [x, y] = [n, m].map(|k| 0.1 * f64::from(k) + 0.05);
            let distance = images.distance([x, y, 0.0]);
            assert_eq!(distance < 0.0, is_solid([x, y]), "{x} {y}");
            let other = (-60..60).flat_map(|i| (-60..60).map(move |j| [i, j]));
            let other = other.map(|ij| ij.map(|k| 0.05 * f64::from(k) + 0.025));
            let nearest = other
                .filter(|[a, b]| is_solid([x + a, y + b]) != is_solid([x, y]))
                .map(|[a, b]| a.hypot(b))
                .fold(f64::INFINITY, f64::min);
            assert!(distance.abs() <= nearest, "{x} {y}: {distance}, {nearest}");
            // In front of the edge of the step, whose faces have an angle of 116.6° between their normals, the bound is
            // at least cos 58.3° of the distance.
            assert!(
                distance.abs() > 0.52 * nearest - 0.05,
                "{x} {y}: {distance}, {nearest}"
            );
        }
    }
    let [one, next] = [3.9, 7.9].map(|x| images.distance([x, 1.0, 0.0]));
    assert!((one - 0.1).abs() < 1e-12 && (next - one).abs() < 1e-12);
}
