//! Lists of grains in the formats of other programs, each with two grains of radii 0.5 and 0.25 m.

use super::super::{ListedGrain, read};

const DUMP: &str = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\n\
ITEM: ATOMS id type x y z radius\n7 1 8 8 8 1\n\
ITEM: TIMESTEP\n100\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\n\
ITEM: ATOMS id type mass x y z vx vy vz fx fy fz omegax omegay omegaz radius \n\
2 1 9.5 4 5 6 0 0 0 9 9 9 0 0 0 0.25 \n1 1 9.5 1 2 3 0 0 -1 9 9 9 0 0 7 0.5 \n";

fn expected(moving: bool) -> Vec<ListedGrain> {
    let grain = |position, radius, velocity: f64, spin: f64| ListedGrain {
        position,
        radius,
        velocity: [0.0, 0.0, velocity],
        angular_velocity: [0.0, 0.0, spin],
        material: 0,
    };
    let (velocity, spin) = if moving { (-1.0, 7.0) } else { (0.0, 0.0) };
    vec![
        grain([1.0, 2.0, 3.0], 0.5, velocity, spin),
        grain([4.0, 5.0, 6.0], 0.25, 0.0, 0.0),
    ]
}

#[test]
fn the_last_snapshot_of_a_dump_is_read_in_the_order_of_its_ids() {
    assert_eq!(read(DUMP, 3, &[], 0).unwrap(), expected(true));
    let diameters = DUMP
        .replace("omegaz radius", "omegaz diameter")
        .replace(" 0.25 ", " 0.5 ");
    assert_eq!(
        read(&diameters.replace(" 7 0.5 ", " 7 1 "), 3, &[], 0).unwrap(),
        expected(true)
    );
    let error = |text: &str| read(text, 3, &[], 0).unwrap_err();
    assert!(error(&DUMP.replace("radius", "c_r")).contains("no column `radius`"));
    assert!(error(&DUMP.replace("mass x y z", "mass xs ys zs")).contains("scaled"));
    assert!(error(&DUMP.replace("0.25 ", "oops ")).contains("line 20"));
    let cut = DUMP.rfind("1 1 9.5").unwrap();
    assert!(
        error(&DUMP[..cut]).contains("1 of its 2"),
        "{}",
        error(&DUMP[..cut])
    );
}

#[test]
fn text_files_of_yade_name_their_columns_in_a_comment() {
    for text in [
        "#format x_y_z_r\n1\t2\t3\t0.5\n4\t5\t6\t0.25\n",
        "#format x_y_z_r_matId\n# a pack\n1\t2\t3\t0.5\t0\n4\t5\t6\t0.25\t0\n",
        "#x y z r\n1 2 3 0.5\n4 5 6 0.25\n",
        "# x y z r\n1 2 3 5e-1\n 4  5  6  0.25\n",
    ] {
        assert_eq!(read(text, 3, &[], 0).unwrap(), expected(false), "{text}");
    }
    let bare = read("1 2 3 0.5\n4 5 6 0.25\n", 3, &[], 0).unwrap_err();
    assert!(bare.contains("`x y z radius`"), "{bare}");
}

#[test]
fn commands_that_create_balls_are_read() {
    for text in [
        "ball create id 1 radius 0.5 position (1,2,3) group 'sand'\nball create id 2 radius 0.25 position (4,5,6)\n",
        "model new\n; exported\nmodel domain extent 0 9\nball create rad 0.5 pos-x 1 position-x 1 position-y 2 \
         position-z 3\n\
         ball create rad 0.25 position-x 4 position-y 5 position-z 6\n",
        "new\nball id=2 x=4 y=5 z=6 rad=0.25\nball id=1 x=1 y=2 z=3 rad=0.5\n",
    ] {
        assert_eq!(read(text, 3, &[], 0).unwrap(), expected(false), "{text}");
    }
    let error = |text: &str| read(text, 3, &[], 0).unwrap_err();
    assert!(error("new\nball id 1 x 1 y 2 z 3\n").contains("`radius`"));
    assert!(error("new\nball id 1 x 1 y two z 3 rad 1\n").contains("line 2"));
    let half = "new\nball id 1 x 1 y 2 z 3 rad 1\nball id 2 x 1 y 2 rad 1\n";
    assert!(error(half).contains("line 3: this ball has no z"));
}

#[test]
fn grains_of_a_plane_have_one_coordinate_across_it() {
    let text = "#format x_y_z_r\n1\t2\t3\t0.5\n4\t5\t3\t0.25\n";
    let grains = read(text, 2, &[], 0).unwrap();
    assert_eq!(grains[1].position, [4.0, 5.0, 0.0]);
    let error = read(&text.replace("5\t3", "5\t4"), 2, &[], 0).unwrap_err();
    assert!(error.contains("line 3: z is 4"), "{error}");
}

/// Checks dumps with fixes and variables, and with several kinds of coordinates.
#[test]
fn dumps_of_several_programs_are_read() {
    let atoms = |names: &str, rows: &str| {
        format!(
            "ITEM: TIMESTEP \n100 \nITEM: NUMBER OF ATOMS \n2\nITEM: BOX BOUNDS pp pp ff\n0 9\n0 9\n0 9\n\
             ITEM: ATOMS {names} \n{rows}"
        )
    };
    let units = "ITEM: UNITS\nsi\nITEM: TIME\n1.5e-01\n";
    for text in [
        // LIGGGHTS with a column twice and the values of a fix.
        atoms(
            "id type type x y z ix iy iz vx vy vz fx fy fz omegax omegay omegaz radius f_liquid[0]",
            "2 1 1 4 5 6 0 0 0 0 0 0 9 9 9 0 0 0 0.25 0\n1 1 1 1 2 3 0 0 0 0 0 -1 9 9 9 0 0 7 0.5 0\n",
        ),
        // LAMMPS with wrapped, unwrapped and scaled coordinates, radius and diameter.
        units.to_owned()
            + &atoms(
                "id mol type xs ys zs x y z xu yu zu radius diameter vx vy vz omegax omegay omegaz",
                "1 0 1 .1 .2 .3 1 2 3 10 2 3 0.5 1 0 0 -1 0 0 7\n2 0 1 .4 .5 .6 4 5 6 4 5 6 0.25 0.5 0 0 0 0 0 0\n",
            ),
        // Unwrapped only, with a number of the element and carriage returns.
        atoms(
            "id element xu yu zu c_1 diameter vz omegaz",
            "1 Si 1 2 3 0.1 1.0 -1 7\n2 Si 4 5 6 0.1 0.5 0 0\n",
        )
        .replace('\n', "\r\n"),
    ] {
        assert_eq!(read(&text, 3, &[], 0).unwrap(), expected(true), "{text}");
    }
    let error = |names: &str| read(&atoms(names, "1 1 1 1 1 1 1\n"), 3, &[], 0).unwrap_err();
    assert!(error("id type x y z radius shapex").contains("superquadrics"));
    assert!(error("id type xs ys zs radius mass").contains("scaled"));
}

/// Checks data files of `write_data`, of `create_atoms` in LIGGGHTS, and files written by hand without a comment that
/// names the style.
#[test]
fn data_files_of_spheres_are_read() {
    let head = "LAMMPS data file via write_data, version 2 Aug 2023, timestep = 0, units = si\n\n\
        2 atoms\n1 atom types\n\n0 9 xlo xhi\n0 9 ylo yhi\n0 9 zlo zhi\n\n";
    let velocities = "\nVelocities\n\n2 0 0 0 0 0 0\n1 0 0 -1 0 0 7\n";
    for (atoms, moving) in [
        (
            "Atoms # sphere\n\n2 1 0.5 2600 4 5 6 0 0 0\n1 1 1 2600 1 2 3 0 0 0\n",
            true,
        ),
        (
            "Atoms  # sphere\n\n1 1 1.0 2500 1 2 3\n2 1 5e-1 2500 4 5 6 # last\n",
            false,
        ),
        (
            "Atoms\n\n1 1 1 2600 1 2 3\n2 1 0.5 2600 4 5 6\n\nBonds\n\n1 1 1 2\n",
            false,
        ),
    ] {
        let text = format!("{head}{atoms}{}", if moving { velocities } else { "" });
        assert_eq!(read(&text, 3, &[], 0).unwrap(), expected(moving), "{text}");
    }
    let full = format!("{head}Atoms # full\n\n1 1 1 0.5 1 2 3\n");
    let error = read(&full, 3, &[], 0).unwrap_err();
    assert!(
        error.contains("line 10: the atoms of this data file have the style `full`"),
        "{error}"
    );
    let text = format!("{head}Atoms # sphere\n\n1 1 x 2600 1 2 3\n");
    let error = read(&text, 3, &[], 0).unwrap_err();
    assert!(error.contains("line 12"), "{error}");
}

/// Checks that the header of a data file may have comments and any white space.
#[test]
fn headers_of_data_files_are_read_as_they_are_found() {
    let text = "# made from a table\n\n\t\t#### HEADER\n2 atoms \t # rows of the table\n1\tatom types\n\
        0 9  xlo   xhi\t# bounds\n0 9 ylo yhi\n0 9 zlo zhi\n\t\t#### BODY\nAtoms\n\
        1\t1\t1\t2700\t1\t2\t3\n2\t1\t0.5\t2700\t4\t5\t6\n";
    assert_eq!(read(text, 3, &[], 0).unwrap(), expected(false));
}

/// Checks styles with as many columns as `sphere` whose third column is not a diameter.
#[test]
fn atoms_without_a_style_are_spheres_only_where_they_can_be() {
    let head = "LAMMPS Description\n\n2 atoms\n1 bonds\n1 atom types\n\n\
        0 9 xlo xhi\n0 9 ylo yhi\n0 9 zlo zhi\n\n";
    let error = |below: &str| read(&format!("{head}{below}"), 3, &[], 0).unwrap_err();
    for (below, reason) in [
        (
            "Masses\n\n1 12.01\n\nAtoms\n\n1 1 1 0.5 1 2 3\n2 1 1 0.5 4 5 6\n",
            "line 11: this data file has a mass for each type",
        ),
        (
            "Atoms # by hand, and long\n\n1 1 1 0.5 1 2 3\n2 1 1 -0.5 4 5 6\n",
            "line 14: `Atoms` names no style, and this is not an atom of the style `sphere` (`id type diameter density \
             x y z`), because its density would be -0.5",
        ),
        (
            "Atoms\n\n1 1 1 2 3 1 2600 1\n2 1 4 5 6 0.5 2600 1\n",
            "line 13: an atom has 8 columns",
        ),
    ] {
        let said = error(below);
        assert!(said.contains(reason), "{below}: {said}");
        assert!(said.contains("`id x y z radius`"), "{said}");
    }
    let hybrid = error("Atoms # hybrid sphere bond\n\n1 1 1 2 3 1 2600 1\n");
    assert!(
        hybrid.contains("the style `hybrid sphere bond`"),
        "{hybrid}"
    );
}

/// Checks packs of YADE and Woo, and texts with attributes or numbers of clumps.
#[test]
fn packs_and_attributes_are_read() {
    for text in [
        "##PERIODIC:: 9 9 9\n1 2 3 0.5\n4 5 6 0.25\n",
        "##PERIODIC:: 9 9 9\n1 2 3 0.5 -1\n4 5 6 0.25 -1\n",
        "##PERIODIC:: 9 9 9\n##USER-DATA:: x\n0 Sphere 1 2 3 .5\n1 Sphere 4 5 6 .25\n",
        "#format x_y_z_r_clumpId\n1 2 3 0.5 -1\n4 5 6 0.25 -1\n",
        "#format x_y_z_r_attrs\n# x\ty\tz\tr\tvel\n1\t2\t3\t0.5\t0\t0\t1\n4\t5\t6\t0.25\t0\t0\t1\n",
    ] {
        assert_eq!(read(text, 3, &[], 0).unwrap(), expected(false), "{text}");
    }
    let capsule = "##PERIODIC:: 9 9 9\n0 Sphere 1 2 3 .5\n2 Capsule 4 4 4 .3 .05 .05 .05\n";
    let error = read(capsule, 3, &[], 0).unwrap_err();
    assert!(
        error.contains("line 3: `Capsule` is not a sphere"),
        "{error}"
    );
}

/// Checks tables of points that ParaView exports: of LIGGGHTS, of this program and of a glyph filter.
#[test]
fn tables_of_points_are_read() {
    for (text, moving) in [
        (
            "\"id\",\"type\",\"radius\",\"v:0\",\"v:1\",\"v:2\",\"omega:0\",\"omega:1\",\"omega:2\",\
             \"f:0\",\"Points:0\",\"Points:1\",\"Points:2\"\n\
             1,1,0.5,0,0,-1,0,0,7,9,1,2,3\n2,1,0.25,0,0,0,0,0,0,9,4,5,6\n",
            true,
        ),
        (
            "radius,velocity:0,velocity:1,velocity:2,angular_velocity:0,angular_velocity:1,angular_velocity:2,\
             vtkOriginalPointIds,Points:0,Points:1,Points:2\n0.5,0,0,-1,0,0,7,0,1,2,3\n0.25,0,0,0,0,0,0,1,4,5,6\n",
            true,
        ),
        (
            "Points_0,Points_1,Points_2,Diameter\n1,2,3,1\n4,5,6,0.5\n",
            false,
        ),
    ] {
        assert_eq!(read(text, 3, &[], 0).unwrap(), expected(moving), "{text}");
    }
    for names in [
        "\"Points:0\",\"Points:1\",\"Points:2\"",
        "position_0,position_1,position_2",
    ] {
        let error = read(&format!("{names}\n1,2,3\n"), 3, &[], 0).unwrap_err();
        assert!(error.contains("no column `radius`"), "{error}");
    }
}

#[test]
fn other_forms_of_ball_commands_are_read_or_refused() {
    for text in [
        "; PFC3D 7\nset random 10001\nball create group 'a' radius 0.5 position 1 2 3\n\
         ball create group 'b' radius 0.25 position 4 5 6\n",
        "fish define x\nend\nBALL CREATE ID 2 X 4 Y 5 Z 6 RADIUS 0.25 GROUP middle\n\
         BALL CREATE ID 1 X 1 Y 2 Z 3 RADIUS 0.5\n",
        "new\ndomain extent 0.000000 9.000000\nball create id  1  position 1.000000  2.000000 3.0 radius 0.5 group 1\n\
         ball create id  2  position 4.000000  5.000000 6.0 radius 0.25 group 1\n",
    ] {
        assert_eq!(read(text, 3, &[], 0).unwrap(), expected(false), "{text}");
    }
    let random = "model new\nball generate number 100 radius 0.1 0.2 box -1 1\n";
    let error = read(random, 3, &[], 0).unwrap_err();
    assert!(
        error.contains("line 2: with this command PFC itself chooses the positions"),
        "{error}"
    );
}
