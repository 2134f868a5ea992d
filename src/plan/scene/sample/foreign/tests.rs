//! Lists of grains in the forms of other programs, each with two grains of radii 0.5 and 0.25 m.

use super::super::{Grain, read};

const DUMP: &str = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\n\
ITEM: ATOMS id type x y z radius\n7 1 8 8 8 1\n\
ITEM: TIMESTEP\n100\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\n\
ITEM: ATOMS id type mass x y z vx vy vz fx fy fz omegax omegay omegaz radius \n\
2 1 9.5 4 5 6 0 0 0 9 9 9 0 0 0 0.25 \n1 1 9.5 1 2 3 0 0 -1 9 9 9 0 0 7 0.5 \n";

fn expected(moving: bool) -> Vec<Grain> {
    let grain = |position, radius, velocity: f64, spin: f64| Grain {
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
    assert!(bare.contains("`x,y,z,radius`"), "{bare}");
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
