use super::copies::Copies;
use super::loads::BodyLoad;
use crate::links::{Rigid, add_force};
use crate::saturation::solid::CoveringBody;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Compares the hash of the sources in the archive with the sources: `build.sh` was run after the last change.
#[test]
fn the_ptx_is_made_from_these_sources() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    assert_eq!(super::KERNELS.len(), 8);
    for (kernels, text) in super::KERNELS.iter() {
        let named = |start: &str| {
            let line = text.lines().find_map(|line| line.strip_prefix(start));
            line.unwrap_or_else(|| panic!("{kernels}: no line {start}"))
                .trim()
        };
        let mut all = Vec::new();
        for source in named("// Sources in src/lbm:").split(' ') {
            all.extend(std::fs::read(here.join(source)).unwrap());
        }
        let mut command = Command::new("sha256sum");
        let pipes = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = pipes.spawn().unwrap();
        child.stdin.take().unwrap().write_all(&all).unwrap();
        let hash = child.wait_with_output().unwrap();
        let hash = String::from_utf8(hash.stdout).unwrap();
        assert_eq!(
            hash.split(' ').next(),
            Some(named("// Hash of the sources, one after the other:")),
            "{kernels}: run `bash src/lbm/gpu/build.sh`"
        );
    }
}

/// Checks that every operation is rounded to nearest and none is approximate; otherwise the bits would change.
#[test]
fn every_operation_of_the_ptx_is_rounded_to_nearest() {
    let mut seen = 0;
    for (kernels, text) in super::KERNELS.iter() {
        // A driver refuses external functions, for example the panic of a division by zero.
        assert!(!text.contains(".extern"), "{kernels}");
        for line in text.lines() {
            let name = line.split_whitespace().next().unwrap_or_default();
            let float = name.ends_with(".f64") || name.ends_with(".f32");
            let arithmetic = ["add", "sub", "mul", "fma", "div", "sqrt", "mad"];
            if float && arithmetic.contains(&name.split('.').next().unwrap_or_default()) {
                assert!(
                    name.contains(".rn.") && !name.contains("ftz"),
                    "{kernels}: {line}"
                );
                seen += 1;
            }
            assert!(!name.contains("approx"), "{kernels}: {line}");
        }
    }
    assert!(seen > 3000, "{seen}");
}

/// Checks that the pieces contain each copy once, for rows longer than a piece and for several rows in a piece.
#[test]
fn pieces_are_the_copies_of_the_rectangle() {
    for counts in [[1, 1], [5, 7], [7, 5], [100, 3], [3, 100], [64, 64]] {
        let whole = Copies {
            from: 3,
            to: 100_000,
            counts,
            strides: [2, 1000],
            factor: 1,
            unused: 0,
            term: 0.0,
        };
        let places = |copies: &Copies| {
            let [along, beyond] = copies.counts.map(|count| 0..count);
            let (from, [one, other]) = (copies.from, copies.strides);
            let rows = beyond.map(move |row| from + row * other);
            rows.flat_map(move |row| along.clone().map(move |place| row + place * one))
                .collect::<Vec<u32>>()
        };
        for most in [1, 4, 32, 10_000] {
            let pieces: Vec<Copies> = whole.pieces(most).collect();
            assert!(pieces.iter().all(|piece| piece.count() <= most));
            assert!(pieces.iter().all(|piece| piece.to - piece.from == 99_997));
            let mut found: Vec<u32> = pieces.iter().flat_map(places).collect();
            found.sort_unstable();
            assert_eq!(found, places(&whole), "{counts:?} {most}");
        }
    }
}

/// Compares the sums of upper and lower halves about a cell of the body with sums of 128 bits about the origin.
#[test]
fn loads_of_a_gpu_are_those_of_the_processor() {
    let at = |z: f64| CoveringBody {
        motion: Rigid {
            position: [-17.3, 1204.8, z],
            ..Rigid::default()
        },
        ..CoveringBody::default()
    };
    let (disc, sphere) = (at(0.0), at(33.1));
    let (flat, spatial) = (BodyLoad::default(), BodyLoad::default());
    let (mut in_plane, mut in_space) = ([0; 6], [0; 6]);
    for n in 0..5000_i64 {
        let random = n.wrapping_mul(0x9e37_79b9_7f4a_7c15_u64.cast_signed());
        let force = [
            random,
            random.rotate_left(21) >> 7,
            random.rotate_left(42) >> 30,
        ];
        let raw = [-30, 1190, 20].map(|at| at + (random >> 59) as i32);
        let middle = raw.map(|at| 2 * at + 1);
        flat.add::<2>(&disc, raw, force);
        spatial.add::<3>(&sphere, raw, force);
        add_force::<2>(&mut in_plane, force, middle);
        add_force::<3>(&mut in_space, force, middle);
    }
    assert_eq!(flat.total(&disc), in_plane);
    assert_eq!(spatial.total(&sphere), in_space);
    assert!(in_space.iter().all(|&part| part != 0));
}
