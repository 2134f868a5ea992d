//! Block lists: all formats, writing and reading back, and refusals.

use approx::assert_relative_eq;

use super::*;

/// Returns two unit cubes side by side as SparkRocks writes them: one per line, with planes relative to the centre, and
/// one normal reversed.
fn lines() -> String {
    let cube = |x: f64| {
        format!(
            r#"{{"centerX":{x},"centerY":0.5,"centerZ":0.5,"generation":3,"faces":[
            {{"a":1,"b":0,"c":0,"d":0.5,"phi":30,"cohesion":0}},{{"a":1,"b":0,"c":0,"d":-0.5,"phi":30,"cohesion":0}},
            {{"a":0,"b":1,"c":0,"d":0.5,"phi":30,"cohesion":0}},{{"a":0,"b":-1,"c":0,"d":0.5,"phi":30,"cohesion":0}},
            {{"a":0,"b":0,"c":1,"d":0.5,"phi":30,"cohesion":0}},
            {{"a":0,"b":0,"c":-1,"d":0.5,"phi":30,"cohesion":0}}]}}"#
        )
        .replace('\n', " ")
    };
    format!("{}\n{}\n", cube(0.5), cube(1.5))
}

/// Returns the errors of a text.
fn errors(text: &str) -> String {
    let errors = read(text).unwrap_err();
    let errors: Vec<String> = errors.iter().map(ToString::to_string).collect();
    errors.join("; ")
}

#[test]
fn spark_rocks_blocks_stand_where_their_centres_say() {
    let array = format!("[{}]", lines().trim().replace('\n', ","));
    for text in [lines(), array] {
        let blocks = read(&text).unwrap();
        assert_eq!(blocks.len(), 2);
        for (block, x) in blocks.iter().zip([0.5, 1.5]) {
            assert_relative_eq!(block.solid.shape.volume(), 1.0, epsilon = 1e-14);
            assert_relative_eq!(
                block.solid.position,
                Vector3::new(x, 0.5, 0.5),
                epsilon = 1e-14
            );
        }
    }
}

#[test]
fn what_is_written_is_read_again() {
    let text = r#"{"blocks": [
        {"id": 9, "vertices": [[0,0,0],[2,0,0],[0,3,0],[0,0,4]], "material": "slate"},
        {"id": 4, "half_spaces": [[2,0,0,2],[-1,0,0,0],[0,1,0,1],[0,-1,0,0],[0,0,1,1],[0,0,-1,0],[1,1,1,9]],
        "fixed": true}]}"#;
    let blocks = read(text).unwrap();
    // In the order of their ids; the plane that touches nothing is gone.
    assert!(blocks[0].fixed && blocks[0].material.is_none());
    assert_eq!(blocks[0].solid.shape.half_spaces().len(), 6);
    assert_eq!(blocks[1].material.as_deref(), Some("slate"));
    assert_relative_eq!(blocks[1].solid.shape.volume(), 4.0, epsilon = 1e-13);

    let again = write(blocks.iter().map(|b| SavedBlock {
        solid: &b.solid,
        material: "slate",
        fixed: b.fixed,
    }));
    let again = read(&again).unwrap();
    for (one, other) in blocks.iter().zip(&again) {
        assert_eq!(other.material.as_deref(), Some("slate"));
        assert_eq!(one.fixed, other.fixed);
        let (v, w) = (one.solid.shape.volume(), other.solid.shape.volume());
        assert_relative_eq!(v, w, max_relative = 1e-14);
        assert_relative_eq!(one.solid.position, other.solid.position, epsilon = 1e-14);
    }
}

#[test]
fn what_is_no_block_is_refused_by_its_number() {
    let refused = errors;
    assert!(refused("{").contains("not JSON"));
    assert!(refused(r#"{"blocks": []}"#).contains("contains no block"));
    assert!(refused(r#"{"blocks": [{"id": 0, "fixd": true}]}"#).contains("fixd"));
    let text = r#"{"blocks": [
        {"id": 0, "vertices": [[0,0,0],[1,0,0],[0,1,0],[1,1,0]]},
        {"id": 1, "half_spaces": [[1,0,0,1],[-1,0,0,0],[0,1,0,1],[0,-1,0,0]]},
        {"id": 2, "half_spaces": [[1,0,0,-1],[-1,0,0,-1],[0,1,0,1],[0,-1,0,0],[0,0,1,1],[0,0,-1,1]]},
        {"id": 2, "vertices": [[0,0,0],[1,0,0],[0,1,0],[0,0,1]]},
        {"id": 3}]}"#;
    let problems = refused(text);
    for expected in [
        "block 0: the block is flat",
        "block 1: the half-spaces do not bound the block",
        "block 2: the half-spaces have no point in common",
        "block 2: another block has this id",
        "block 3: the block needs either `half_spaces` or `vertices`",
    ] {
        assert!(problems.contains(expected), "{expected} in {problems}");
    }
    let open = lines().replacen("\"a\":1", "\"a\":0", 1);
    assert!(refused(&open).contains("block 0: half-space 0"));
    assert!(refused(&lines().replacen("\"d\":", "\"e\":", 1)).contains("block 0: faces[0]"));
}

/// Returns a unit cube over a tetrahedron in the form of UnBlocks-Gen; `faces` are the faces of the cube.
fn grid(faces: &str) -> String {
    let length = faces.split_whitespace().count();
    format!(
        "# vtk DataFile Version 3.0\nVoronoi results\nASCII\n \nDATASET UNSTRUCTURED_GRID\nPOINTS 9 float\n\
         0 0 1\n1 0 1\n1 1 1\n0 1 1\n0 0 2\n1 0 2\n1 1 2\n0 1 2\n0 0 0\n \nCELLS 2 {}\n{length} {faces}\n\
         4 0 1 2 8\n\nCELL_TYPES 2\n42\n10\n \nCELL_DATA 2\nSCALARS id float\nLOOKUP_TABLE default\n0\n1\n",
        length + 6
    )
}

/// Faces of the cube of [`grid`], in orders of both senses.
const CUBE: &str = "6 4 0 1 2 3 4 4 5 6 7 4 0 1 5 4 4 3 2 6 7 4 0 3 7 4 4 1 2 6 5";

#[test]
fn polyhedra_of_a_vtk_file_are_blocks() {
    let blocks = read(&grid(CUBE)).unwrap();
    let volumes: Vec<f64> = blocks.iter().map(|b| b.solid.shape.volume()).collect();
    assert_relative_eq!(volumes[..], [1.0, 1.0 / 6.0][..], epsilon = 1e-14);
    assert_relative_eq!(
        blocks[0].solid.position,
        Vector3::new(0.5, 0.5, 1.5),
        epsilon = 1e-14
    );
}

#[test]
fn polyhedra_that_are_no_blocks_are_refused_by_their_number() {
    // A face that is pressed in to the point (0, 0, 0), outside the cube, and a face that is missing.
    let dented = "6 4 0 1 2 3 4 4 5 6 7 4 0 1 5 4 4 3 2 6 7 4 0 3 7 4 4 1 2 6 8";
    let cases = [
        (
            grid("5 4 0 1 2 3 4 4 5 6 7 4 0 1 5 4 4 3 2 6 7 4 0 3 7 4"),
            "cell 0: the polyhedron is not convex",
        ),
        (grid(dented), "cell 0: the polyhedron is not convex"),
        (
            grid("6 4 0 1 2 3"),
            "cell 0: the list of its faces is incomplete",
        ),
        (
            grid(&CUBE.replace("2 6 5", "2 6 9")),
            "cell 0: there is no point 9",
        ),
        (
            grid(CUBE).replace("\n42\n", "\n12\n"),
            "cell 0: cells of type 12 are not read",
        ),
        (
            grid(CUBE).replace("ASCII", "BINARY"),
            "a binary VTK file is not read",
        ),
        (
            grid(CUBE).replace("UNSTRUCTURED_GRID", "POLYDATA"),
            "not POLYDATA",
        ),
        (
            grid(CUBE).replace("CELL_TYPES 2\n42\n10\n", ""),
            "`CELL_DATA` where `CELL_TYPES` is expected",
        ),
        (
            grid(CUBE).replace("0 0 1\n", "0 0 x\n"),
            "`x` where a coordinate is expected",
        ),
    ];
    for (text, expected) in cases {
        assert_eq!(read(&text).unwrap_err().len(), 1);
        let errors = errors(&text);
        assert!(errors.contains(expected), "{errors}, not {expected}");
    }
}

/// Returns a cube of 2 m at (10, 0, 0) and a tetrahedron, as LMGC90 writes them.
fn bodies() -> String {
    let corners = [
        [-1, -1, -1],
        [1, -1, -1],
        [1, 1, -1],
        [-1, 1, -1],
        [-1, -1, 1],
        [1, -1, 1],
        [1, 1, 1],
        [-1, 1, 1],
    ];
    let facets = [
        [1, 2, 3],
        [1, 3, 4],
        [5, 7, 6],
        [5, 8, 7],
        [1, 5, 6],
        [1, 6, 2],
        [2, 6, 7],
        [2, 7, 3],
        [3, 7, 8],
        [3, 8, 4],
        [4, 8, 5],
        [4, 5, 1],
    ];
    let tetrahedron = [[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 3]];
    let sides = [[1, 2, 3], [1, 2, 4], [1, 3, 4], [2, 3, 4]];
    format!(
        "\n! File BODIES\n!\n\n{}\n{}",
        body(10, &corners, &facets),
        body(0, &tetrahedron, &sides)
    )
}

/// Returns a body of LMGC90 at a coordinate x.
fn body(x: i32, corners: &[[i32; 3]], facets: &[[i32; 3]]) -> String {
    let rows = corners
        .iter()
        .map(|[a, b, c]| format!("   coo1= {a}.0D+00  coo2={b:2}.0D+00  coor= {c}.0000000D+00\n"));
    let corners: String = rows.collect();
    let rows = facets
        .iter()
        .map(|[a, b, c]| format!("   ver1= {a}   ver2={b:4}   ver3= {c}\n"));
    let count = [corners.lines().count(), facets.len()];
    let facets: String = rows.collect();
    format!(
        "$bdyty\n RBDY3      1\n$blmty\n PLAIN      1  behav  PLEXx  avrd= 0.0D+00  gyrd= 0.0D+00\n\
         $nodty\n NO6xx      1    coo1= {x}.0000000D+00  coo2= 0.0D+00  coo3= 0.0D+00\n    \
         coo4= 0.0D+00  coo5= 0.0D+00  coo6= 0.0D+00\n$tacty\n POLYR      1  color  BLEUx  nb_vertex=    {}      \
         nb_face=   {}\n{corners}{facets}$$$$$$\n",
        count[0], count[1]
    )
}

#[test]
fn bodies_of_lmgc90_are_blocks() {
    let blocks = read(&bodies()).unwrap();
    let volumes: Vec<f64> = blocks.iter().map(|b| b.solid.shape.volume()).collect();
    assert_relative_eq!(volumes[..], [8.0, 4.5][..], epsilon = 1e-13);
    let centres: Vec<Vector3<f64>> = blocks.iter().map(|b| b.solid.position).collect();
    assert_relative_eq!(centres[0], Vector3::new(10.0, 0.0, 0.0), epsilon = 1e-13);
    assert_relative_eq!(centres[1], Vector3::repeat(0.75), epsilon = 1e-13);
}

#[test]
fn bodies_of_lmgc90_that_are_no_blocks_are_refused_by_their_line() {
    let cases = [
        (
            bodies().replacen("RBDY3", "MAILx", 1),
            "body of line 6: `MAILx      1` is not read",
        ),
        (
            bodies().replacen("POLYR", "SPHER", 1),
            "body of line 6: a contactor SPHER is not a block",
        ),
        (
            bodies().replacen("coo5= 0.0", "coo5= 0.1", 1),
            "body of line 6: the body is turned",
        ),
        (
            bodies().replacen("nb_face=   12", "nb_face=   11", 1),
            "body of line 6: the polyhedron is not convex",
        ),
        (
            bodies().replacen("nb_vertex=    8", "nb_vertex=    x", 1),
            "does not have 2 numbers",
        ),
        (
            bodies().replacen("ver1= 4   ver2=   8", "ver1= 9   ver2=   8", 1),
            "there is no corner 9",
        ),
        (
            bodies().replacen("ver1= 4   ver2=   8", "ver1= 0   ver2=   8", 1),
            "there is no corner 0",
        ),
        (
            bodies().trim_end().trim_end_matches('$').to_owned(),
            "the file ends before `$$$$$$`",
        ),
        (
            bodies().replacen(
                "$tacty\n",
                "$tacty\n SPHER  1  color  BLEUx  byrd= 1.0D+00\n",
                1,
            ),
            "has 2 contactors",
        ),
    ];
    for (text, expected) in cases {
        let problems = errors(&text);
        assert!(problems.contains(expected), "{expected} in {problems}");
    }
}

#[test]
fn a_plane_of_lmgc90_is_a_fixed_cuboid() {
    let plane = [
        "$bdyty",
        " RBDY3      2",
        "$nodty",
        " NO6xx 1  coo1= 1.0D+00  coo2= 2.0D+00  coo3=-0.5D+00",
        "          coo4= 0.0D+00  coo5= 0.0D+00  coo6= 0.0D+00",
        "$tacty",
        " PLANx 1 color VERTx  axe1= 3.0D+00  axe2= 2.0D+00  axe3= 0.5D+00",
        "$$$$$$",
    ];
    let plane = plane.join("\n");
    let text = bodies() + &plane;
    let blocks = read(&text).unwrap();
    assert!(blocks[2].fixed && !blocks[0].fixed);
    assert_relative_eq!(blocks[2].solid.shape.volume(), 24.0, epsilon = 1e-13);
    let centre = Vector3::new(1.0, 2.0, -0.5);
    assert_relative_eq!(blocks[2].solid.position, centre, epsilon = 1e-13);
    let turned = text.replace(
        "0.5D+00\n$$$$$$",
        "0.5D+00\n localframe  alp1= 1.0D+00\n$$$$$$",
    );
    assert!(errors(&turned).contains("of a plane is not read"));
}
