//! Time of one factorisation and one solution of the matrix of a bed of blocks, of this program and of faer.
//!
//! The bed has `n` times `n` times `n` blocks with a joint between each two neighbours. Each joint is one cell; four
//! joints meet at a junction. This is the network of the program for such a bed. Conductances differ by two decades.
//! The lines are comma-separated: blocks along an edge, unknowns, then of each program the entries of the factor, the
//! mean processor times on one thread of a factorisation with a known pattern and of a solution \[s\], and the largest
//! difference of both solutions.

#[path = "../../../src/joints/ldl.rs"]
#[allow(dead_code, reason = "the program uses more of it")]
mod ldl;
#[path = "../../../src/joints/order.rs"]
mod order;

use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Mat, Side};
use nalgebra::Vector3;

/// Largest system that the program orders by degree.
const SMALL: usize = 4000;

/// Returns the positions of the joints and junctions of a bed, and the pairs that exchange water.
fn bed(n: usize) -> (Vec<Vector3<f64>>, Vec<[usize; 2]>) {
    let mut positions = Vec::new();
    let mut joints = std::collections::HashMap::new();
    let block = |at: [usize; 3]| Vector3::from(at.map(|i| i as f64));
    for axis in 0..3 {
        for at in cells(n) {
            if at[axis] + 1 < n {
                let mut position = block(at);
                position[axis] += 0.5;
                joints.insert((axis, at), positions.len());
                positions.push(position);
            }
        }
    }
    let mut pairs = Vec::new();
    for axis in 0..3 {
        let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
        for at in cells(n) {
            if at[a] + 1 < n && at[b] + 1 < n {
                let junction = positions.len();
                let mut position = block(at);
                position[a] += 0.5;
                position[b] += 0.5;
                positions.push(position);
                let beyond = |axis: usize| {
                    let mut next = at;
                    next[axis] += 1;
                    next
                };
                for joint in [(a, at), (a, beyond(b)), (b, at), (b, beyond(a))] {
                    pairs.push([joints[&joint], junction]);
                }
            }
        }
    }
    (positions, pairs)
}

/// Returns the numbers of all blocks.
fn cells(n: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..n * n * n).map(move |i| [i % n, i / n % n, i / n / n])
}

/// Returns the processor time of this thread \[s\], which excludes other work on the machine.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text
        .split(' ')
        .next()
        .and_then(|word| word.parse::<f64>().ok());
    1e-9 * nanoseconds.unwrap_or(f64::NAN)
}

/// Returns the mean processor time of a function over at least half a second \[s\], because the system counts it in
/// ticks.
fn mean(mut run: impl FnMut()) -> f64 {
    let (start, mut count) = (processor_time(), 0.0);
    loop {
        run();
        count += 1.0;
        let spent = processor_time() - start;
        if !(spent < 0.5) {
            return spent / count;
        }
    }
}

fn main() -> Result<(), String> {
    faer::set_global_parallelism(faer::Par::Seq);
    println!(
        "blocks along an edge,unknowns,entries,factorise [s],solve [s],entries of faer,factorise by faer [s],\
         solve by faer [s],\
         difference"
    );
    for n in [5, 10, 16] {
        let (positions, pairs) = bed(n);
        let count = positions.len();
        let numbers: Vec<f64> = (0..pairs.len())
            .map(|k| -(10_f64).powf(((k * 7919) % 101) as f64 / 50.0))
            .collect();
        let mut diagonal = vec![0.01; count];
        for ([a, b], number) in pairs.iter().zip(&numbers) {
            diagonal[*a] -= number;
            diagonal[*b] -= number;
        }
        let side: Vec<f64> = (0..count).map(|k| ((k * 31) % 17) as f64 - 8.0).collect();

        let mut ours = if count <= SMALL {
            ldl::Factors::new(count, &pairs)
        } else {
            ldl::Factors::in_order(order::dissection(&positions, &pairs), &pairs)
        };
        let factorise = mean(|| {
            ours.factorise(&diagonal, &numbers)
                .expect("positive definite")
        });
        let mut found = side.clone();
        let solve = mean(|| {
            found.copy_from_slice(&side);
            ours.solve(&mut found);
        });

        let mut triplets: Vec<_> = (0..count)
            .map(|k| Triplet::new(k, k, diagonal[k]))
            .collect();
        for ([a, b], number) in pairs.iter().zip(&numbers) {
            triplets.push(Triplet::new(*a.max(b), *a.min(b), *number));
        }
        let matrix = SparseColMat::<usize, f64>::try_new_from_triplets(count, count, &triplets)
            .map_err(|e| format!("{e:?}"))?;
        let symbolic =
            SymbolicLlt::try_new(matrix.symbolic(), Side::Lower).map_err(|e| format!("{e:?}"))?;
        let factors = || Llt::try_new_with_symbolic(symbolic.clone(), matrix.as_ref(), Side::Lower);
        let by_faer = mean(|| drop(std::hint::black_box(factors())));
        let theirs = factors().map_err(|e| format!("{e:?}"))?;
        let column = Mat::from_fn(count, 1, |row, _| side[row]);
        let mut solution = column.clone();
        let solve_by_faer = mean(|| solution = theirs.solve(&column));
        let size = found.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let apart = (0..count).fold(0.0_f64, |most, k| {
            most.max((found[k] - solution[(k, 0)]).abs())
        });
        let entries = faer::sparse::linalg::cholesky::factorize_symbolic_cholesky(
            matrix.symbolic(),
            Side::Lower,
            faer::sparse::linalg::cholesky::SymmetricOrdering::Amd,
            Default::default(),
        )
        .map_err(|e| format!("{e:?}"))?
        .len_val();
        println!(
            "{n},{count},{},{factorise:.3e},{solve:.3e},{entries},{by_faer:.3e},{solve_by_faer:.3e},{:.1e}",
            ours.entries(),
            apart / size
        );
    }
    Ok(())
}
