//! Grains and contacts in a checkpoint: names, order and values of the columns, and the hash of the state.
//!
//! The expected values were recorded once and must not change: a checkpoint of an earlier build must be readable,
//! and state hashes must stay comparable.

use super::RunState;
use decomposition::Communicator;
use dem::contact::linear::{self, Linear};
use dem::contact::{Law, PairTable, Scaled};
use dem::particles::{Body, Kind, Motion, Particles};
use dem::polyhedron::Polyhedron;
use dem::state::{NamedColumns, Values};
use dem::walls::Wall;
use dem::{Dem, DemSettings, GrainDomain, PlaneSpace, Space, Volume, alone};
use nalgebra::{UnitQuaternion, Vector2, Vector3};

/// Returns the names of the columns in order.
fn names(table: &NamedColumns) -> Vec<&str> {
    table
        .columns
        .iter()
        .map(|(name, _)| name.as_str())
        .collect()
}

/// Returns a number that depends on the order and the bits of all values.
fn digest(table: &NamedColumns) -> u64 {
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bits: u64| {
        digest = (digest ^ bits)
            .wrapping_mul(0x0100_0000_01b3)
            .rotate_left(23)
    };
    for (name, values) in &table.columns {
        name.bytes().for_each(|byte| add(u64::from(byte)));
        match values {
            Values::Real(values) => values.iter().for_each(|value| add(value.to_bits())),
            Values::Whole(values) => values.iter().for_each(|value| add(*value)),
        }
    }
    digest
}

fn hash<S: Space>(particles: &Particles<S>, dem: Option<&Dem<S>>) -> String {
    let state = RunState::<S, f64> {
        fluid: None,
        averages: None,
        seepage: Vec::new(),
        particles,
        dem,
        earlier: None,
    };
    state.hash(&Communicator::serial())
}

/// Returns three spheres and a block with every array that a scene may request. All numbers are sums of powers of
/// two.
fn all_arrays() -> Particles<Volume> {
    let mut particles = Particles::<Volume>::new();
    let cube = Polyhedron::cuboid(Vector3::new(0.5, 0.25, 1.0)).unwrap();
    particles.set_shapes(vec![cube].into()).unwrap();
    for (id, x) in [(3_u32, -0.25), (5, 2.5), (7, 0.75)] {
        let kind = match id {
            3 => Kind::Fixed,
            5 => Kind::Driven,
            _ => Kind::Free,
        };
        let body = Body {
            id: id.into(),
            radius: 0.125,
            mass: 0.5 * f64::from(id),
            inertia: 0.03125,
            material: id / 3,
            kind,
        };
        let motion = Motion {
            position: Vector3::new(x, 0.5 * x, 0.25),
            velocity: Vector3::new(0.5, -x, 1.5),
            spin: Vector3::new(x, 2.0, -0.75),
        };
        particles.insert(body, motion);
    }
    let body = Body {
        id: 11,
        radius: 0.0,
        mass: 2.0,
        inertia: 0.25,
        material: 1,
        kind: Kind::Free,
    };
    let motion = Motion {
        position: Vector3::new(-1.5, 0.25, 0.5),
        velocity: Vector3::new(0.25, 0.5, 0.75),
        spin: Vector3::new(1.0, -2.0, 4.0),
    };
    particles
        .add_block(body, motion, 0, UnitQuaternion::identity())
        .unwrap();
    particles.allocate_fluid_loads();
    particles.keep_extra();
    particles.mark_start();
    particles.keep_last_velocity();
    for (k, number) in (0..particles.owned()).zip([0.5, 1.5, 2.5, 3.5]) {
        particles.motion[k].position.z += number;
        particles.contact[k].force = Vector3::new(number, 0.25, -number);
        particles.contact[k].torque = Vector3::new(0.125, number, 2.0);
        particles.fluid[k].force = Vector3::new(4.0, number, number + 1.0);
        particles.fluid[k].torque = Vector3::new(number, 8.0, -1.0);
        for (n, extra) in (0_u32..).zip(&mut particles.extra[k]) {
            *extra = number * f64::from(n);
        }
    }
    particles
}

#[test]
fn columns_of_grains_keep_names_order_and_hash() {
    let particles = all_arrays();
    let table = particles.table();
    assert_eq!(
        names(&table).join(" "),
        "id radius mass inertia material kind shift_x shift_y shift_z position_x position_y position_z \
         velocity_x velocity_y velocity_z spin_x spin_y spin_z contact_force_x contact_force_y contact_force_z \
         contact_torque_x contact_torque_y contact_torque_z fluid_force_x fluid_force_y fluid_force_z \
         fluid_torque_x fluid_torque_y fluid_torque_z extra_0 extra_1 extra_2 extra_3 extra_4 extra_5 extra_6 \
         extra_7 extra_8 extra_9 extra_10 extra_11 start_x start_y start_z last_velocity_x last_velocity_y \
         last_velocity_z shape orientation_x orientation_y \
         orientation_z orientation_w angular_momentum_x angular_momentum_y angular_momentum_z"
    );
    assert_eq!(digest(&table), 0xd9ce_5dad_5b54_86d3);
    assert_eq!(hash(&particles, None), "ef66613fd2d929924c30ee4f6559b50f");
    // Reading restores everything: a second table equals the first.
    let again = Particles::<Volume>::from_table(&table).unwrap();
    assert_eq!(hash(&again, None), hash(&particles, None));
}

#[test]
fn columns_of_discs_and_contacts_keep_names_order_and_hash() {
    let mut particles = Particles::<PlaneSpace>::new();
    for (id, x) in [(1, -0.09), (2, 0.09), (3, 2.0)] {
        let y = if id == 3 { 0.15 } else { -0.16 };
        let motion = Motion {
            position: Vector2::new(x, y),
            velocity: Vector2::new(-x, -y),
            spin: 0.5,
        };
        particles.insert(Body::uniform::<PlaneSpace>(id, 0.1, 2600.0, 0), motion);
    }
    let walls = vec![Wall::new(
        Vector2::new(0.0, -0.25),
        Vector2::new(0.0, 1.0),
        0,
    )];
    let mut region = GrainDomain::closed(Vector2::repeat(-1.0), Vector2::repeat(1.0), 0.02);
    region.periodic[0] = true;
    let mut settings = DemSettings::new(region, 1e-5, 0.02);
    settings.gravity = Vector2::new(0.0, -9.81);
    let springs = linear::LinearParameters {
        normal_stiffness: Scaled::Absolute(1e5),
        stiffness_ratio: 1.0,
        friction: 0.5,
        normal_damping_ratio: 0.0,
        shear_damping_ratio: 0.0,
        attraction: false,
    };
    let law = Law::Linear(Linear {
        parameters: PairTable::uniform(1, springs),
    });
    let mut dem = Dem::new(law, settings, walls).unwrap();
    dem.advance_many(&mut particles, &alone(), 20).unwrap();
    let (table, contacts) = (particles.table(), dem.contacts());
    assert_eq!(
        names(&table).join(" "),
        "id radius mass inertia material kind shift_x shift_y position_x position_y velocity_x velocity_y spin \
         contact_force_x contact_force_y contact_torque"
    );
    assert_eq!(
        names(&contacts.grains).join(" "),
        "first second shift_x shift_y memory_0"
    );
    assert_eq!(
        names(&contacts.walls).join(" "),
        "grain wall facet memory_0"
    );
    assert_eq!(
        names(&contacts.faces).join(" "),
        "point_x point_y normal_x normal_y velocity_x velocity_y material"
    );
    assert_eq!((contacts.grains.rows(), contacts.walls.rows()), (1, 2));
    assert_eq!(digest(&table), 0xdb20_60f2_62c4_e50b);
    assert_eq!(
        hash(&particles, Some(&dem)),
        "558919a88e30111165657d552e250468"
    );
}
