//! Direct solution of sparse symmetric systems by `L D L^T` without pivoting.
//!
//! The matrices of a network are positive definite; with the motion of blocks they become quasi-definite, for which the
//! factors exist in any order of elimination (Vanderbei, SIAM J. Optim. 5, 100 (1995)). The order is that of
//! approximate minimum degree on the quotient graph (George and Liu, SIAM Review 31, 1 (1989); Amestoy, Davis and Duff,
//! SIAM J. Matrix Anal. Appl. 17, 886 (1996)); the caller states it for large networks ([`crate::order`]). The factors
//! are computed row by row along the elimination tree (Davis, Direct Methods for Sparse Linear Systems, 2006, chapter
//! 4). The pattern is analysed once; further factorisations allocate nothing. The order of operations is fixed, so that
//! the bits are the same on every rank.

use std::collections::BTreeSet;

/// Value for a missing parent or a missing entry.
const NONE: usize = usize::MAX;

/// Factors of a symmetric matrix with a fixed pattern.
#[derive(Clone, Debug)]
pub(crate) struct Factors {
    /// Position of each unknown in the elimination order.
    position: Vec<usize>,
    /// Unknown at each position.
    order: Vec<usize>,
    /// Entries above the diagonal, by columns in the elimination order: rows, and indices of the pairs.
    upper_starts: Vec<usize>,
    upper_rows: Vec<usize>,
    upper_pairs: Vec<usize>,
    /// Columns of the rows of `L`, in a valid elimination order.
    row_starts: Vec<usize>,
    row_columns: Vec<usize>,
    /// Columns of `L`: rows and values.
    column_starts: Vec<usize>,
    column_rows: Vec<u32>,
    lower: Vec<f64>,
    diagonal: Vec<f64>,
    filled: Vec<usize>,
    work: Vec<f64>,
}

/// Zero or undefined pivot, at this unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Singular(pub(crate) usize);

impl Factors {
    /// Returns the symbolic factorisation of a matrix of `count` unknowns with nonzero entries at `pairs` of
    /// different unknowns. A pair may occur several times.
    pub(crate) fn new(count: usize, pairs: &[[usize; 2]]) -> Self {
        Self::in_order(minimum_degree(count, pairs), pairs)
    }

    /// Returns the analysis for unknowns that are eliminated in this order.
    pub(crate) fn in_order(order: Vec<usize>, pairs: &[[usize; 2]]) -> Self {
        let count = order.len();
        let mut position = vec![0; count];
        for (at, &unknown) in order.iter().enumerate() {
            position[unknown] = at;
        }
        let (upper_starts, upper_rows, upper_pairs) = columns_above(count, pairs, &position);
        let parents = elimination_tree(count, &upper_starts, &upper_rows);
        let (row_starts, row_columns) = rows_of_factor(&parents, &upper_starts, &upper_rows);
        let mut column_starts = vec![0; count + 1];
        for &column in &row_columns {
            column_starts[column + 1] += 1;
        }
        for column in 0..count {
            column_starts[column + 1] += column_starts[column];
        }
        let entries = row_columns.len();
        let (mut filled, mut column_rows) = (column_starts.clone(), vec![0; entries]);
        for row in 0..count {
            for &column in &row_columns[row_starts[row]..row_starts[row + 1]] {
                column_rows[filled[column]] = u32::try_from(row).unwrap_or(u32::MAX);
                filled[column] += 1;
            }
        }
        Self {
            position,
            order,
            upper_starts,
            upper_rows,
            upper_pairs,
            row_starts,
            row_columns,
            column_starts,
            column_rows,
            lower: vec![0.0; entries],
            diagonal: vec![0.0; count],
            filled: vec![0; count],
            work: vec![0.0; count],
        }
    }

    /// Returns the memory of the factors \[bytes\].
    pub(crate) fn bytes(&self) -> usize {
        use std::mem::size_of;
        let unknowns = 6 * size_of::<usize>() + 3 * size_of::<f64>();
        let above = 2 * size_of::<usize>();
        let entry = size_of::<usize>() + size_of::<u32>() + size_of::<f64>();
        let unknowns = self.order.len() * unknowns;
        unknowns + self.upper_rows.len() * above + self.lower.len() * entry
    }

    /// Returns the number of entries of `L` below its diagonal.
    pub(crate) fn entries(&self) -> usize {
        self.lower.len()
    }

    /// Computes the factors of the matrix with this diagonal and these values at its pairs. Values of a repeated
    /// pair are added.
    ///
    /// # Errors
    /// If a pivot is zero or not a number.
    pub(crate) fn factorise(&mut self, diagonal: &[f64], pairs: &[f64]) -> Result<(), Singular> {
        self.filled
            .copy_from_slice(&self.column_starts[..diagonal.len()]);
        for row in 0..diagonal.len() {
            for entry in self.upper_starts[row]..self.upper_starts[row + 1] {
                self.work[self.upper_rows[entry]] += pairs[self.upper_pairs[entry]];
            }
            let mut pivot = diagonal[self.order[row]];
            for entry in self.row_starts[row]..self.row_starts[row + 1] {
                let column = self.row_columns[entry];
                let number = std::mem::take(&mut self.work[column]);
                let end = self.filled[column];
                let above = self.column_starts[column]..end;
                let entries = self.column_rows[above.clone()]
                    .iter()
                    .zip(&self.lower[above]);
                for (below, entry) in entries {
                    self.work[*below as usize] -= entry * number;
                }
                let factor = number / self.diagonal[column];
                pivot -= factor * number;
                self.lower[end] = factor;
                self.filled[column] = end + 1;
            }
            if !(pivot.is_finite() && pivot.abs() > 0.0) {
                self.work.fill(0.0);
                return Err(Singular(self.order[row]));
            }
            self.diagonal[row] = pivot;
            self.work[row] = 0.0;
        }
        Ok(())
    }

    /// Replaces the right-hand side by the solution.
    pub(crate) fn solve(&mut self, side: &mut [f64]) {
        let work = &mut self.work;
        for (number, &unknown) in work.iter_mut().zip(&self.order) {
            *number = side[unknown];
        }
        for column in 0..self.diagonal.len() {
            let number = work[column];
            let own = self.column_starts[column]..self.column_starts[column + 1];
            for (row, entry) in self.column_rows[own.clone()].iter().zip(&self.lower[own]) {
                work[*row as usize] -= entry * number;
            }
        }
        for column in (0..self.diagonal.len()).rev() {
            let mut number = work[column] / self.diagonal[column];
            let own = self.column_starts[column]..self.column_starts[column + 1];
            for (row, entry) in self.column_rows[own.clone()].iter().zip(&self.lower[own]) {
                number -= entry * work[*row as usize];
            }
            work[column] = number;
        }
        for (number, &at) in side.iter_mut().zip(&self.position) {
            *number = work[at];
        }
        work.fill(0.0);
    }
}

/// Returns the entries above the diagonal by columns in the elimination order: starts, rows and pairs.
fn columns_above(
    count: usize,
    pairs: &[[usize; 2]],
    position: &[usize],
) -> (Vec<usize>, Vec<usize>, Vec<usize>) {
    let ends = |pair: &[usize; 2]| {
        let [a, b] = pair.map(|unknown| position[unknown]);
        [a.min(b), a.max(b)]
    };
    let mut starts = vec![0; count + 1];
    for pair in pairs {
        starts[ends(pair)[1] + 1] += 1;
    }
    for column in 0..count {
        starts[column + 1] += starts[column];
    }
    let mut next = starts.clone();
    let (mut rows, mut which) = (vec![0; pairs.len()], vec![0; pairs.len()]);
    for (n, pair) in pairs.iter().enumerate() {
        let [row, column] = ends(pair);
        rows[next[column]] = row;
        which[next[column]] = n;
        next[column] += 1;
    }
    (starts, rows, which)
}

/// Returns the parent of each column in the elimination tree; [`NONE`] for roots.
fn elimination_tree(count: usize, starts: &[usize], rows: &[usize]) -> Vec<usize> {
    let mut parents = vec![NONE; count];
    let mut ancestors = vec![NONE; count];
    for column in 0..count {
        for &row in &rows[starts[column]..starts[column + 1]] {
            let mut node = row;
            while node != NONE && node < column {
                let up = std::mem::replace(&mut ancestors[node], column);
                if up == NONE {
                    parents[node] = column;
                }
                node = up;
            }
        }
    }
    parents
}

/// Returns the columns of each row of the factor, children before parents.
fn rows_of_factor(parents: &[usize], starts: &[usize], rows: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let count = parents.len();
    let mut seen = vec![NONE; count];
    let (mut row_starts, mut columns) = (vec![0], Vec::new());
    for row in 0..count {
        seen[row] = row;
        let begin = columns.len();
        for &first in &rows[starts[row]..starts[row + 1]] {
            let mut node = first;
            while node != NONE && seen[node] != row {
                seen[node] = row;
                columns.push(node);
                node = parents[node];
            }
        }
        // A column has a larger number than the columns that update it.
        columns[begin..].sort_unstable();
        row_starts.push(columns.len());
    }
    (row_starts, columns)
}

/// Returns an elimination order with little fill.
pub(crate) fn minimum_degree(count: usize, pairs: &[[usize; 2]]) -> Vec<usize> {
    let mut variables = vec![Vec::new(); count];
    for &[a, b] in pairs {
        variables[a].push(b);
        variables[b].push(a);
    }
    for list in &mut variables {
        list.sort_unstable();
        list.dedup();
    }
    // An eliminated unknown represents the clique of its neighbours.
    let mut cliques: Vec<Vec<usize>> = vec![Vec::new(); count];
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); count];
    let mut degree: Vec<usize> = variables.iter().map(Vec::len).collect();
    let mut queue: BTreeSet<(usize, usize)> = degree.iter().copied().zip(0..).collect();
    let mut mark = vec![NONE; count];
    let (mut counted, mut outside) = (vec![NONE; count], vec![0; count]);
    let mut order = Vec::with_capacity(count);
    while let Some((_, pivot)) = queue.pop_first() {
        order.push(pivot);
        mark[pivot] = pivot;
        let mut joined = Vec::new();
        let absorbed = std::mem::take(&mut cliques[pivot]);
        let own = std::mem::take(&mut variables[pivot]);
        let of_cliques = absorbed.iter().flat_map(|&clique| members[clique].iter());
        for &other in own.iter().chain(of_cliques) {
            if mark[other] != pivot {
                mark[other] = pivot;
                joined.push(other);
            }
        }
        joined.retain(|&other| other != pivot);
        for &clique in &absorbed {
            members[clique] = Vec::new();
        }
        for &other in &joined {
            variables[other].retain(|&v| mark[v] != pivot);
            cliques[other].retain(|clique| !absorbed.contains(clique));
        }
        // Members of other cliques that are not in the new one.
        for &other in &joined {
            for &clique in &cliques[other] {
                if counted[clique] != pivot {
                    counted[clique] = pivot;
                    outside[clique] = members[clique].len();
                }
                outside[clique] -= 1;
            }
        }
        for &other in &joined {
            // A clique contained in the new one is redundant.
            cliques[other].retain(|&clique| outside[clique] > 0);
            let through: usize = cliques[other].iter().map(|&clique| outside[clique]).sum();
            cliques[other].push(pivot);
            let new = (variables[other].len() + through + joined.len() - 1).min(count);
            queue.remove(&(degree[other], other));
            degree[other] = new;
            queue.insert((new, other));
        }
        members[pivot] = joined;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Returns the pairs of a grid of `n` times `n` points.
    fn grid(n: usize) -> Vec<[usize; 2]> {
        let at = |x: usize, y: usize| x + n * y;
        let along = (0..n).flat_map(move |y| (1..n).map(move |x| [at(x - 1, y), at(x, y)]));
        let across = (1..n).flat_map(move |y| (0..n).map(move |x| [at(x, y - 1), at(x, y)]));
        along.chain(across).collect()
    }

    #[test]
    fn a_quasi_definite_system_is_solved_like_a_dense_one() {
        let n = 7;
        let mut pairs = grid(n);
        // Two additional unknowns with negative diagonals, each connected to some points; one pair is repeated.
        let count = n * n + 2;
        for k in 0..12 {
            pairs.push([n * n, 3 * k]);
            pairs.push([5 + 2 * k, n * n + 1]);
        }
        pairs.push([0, 1]);
        let numbers: Vec<f64> = (0..pairs.len())
            .map(|k| -0.3 - 0.05 * f64::from(u32::try_from(k % 7).unwrap()))
            .collect();
        let diagonal: Vec<f64> = (0..count)
            .map(|k| if k < n * n { 3.0 } else { -0.7 })
            .collect();
        let mut dense = DMatrix::from_diagonal(&DVector::from_column_slice(&diagonal));
        for (&[a, b], number) in pairs.iter().zip(&numbers) {
            dense[(a, b)] += number;
            dense[(b, a)] += number;
        }
        let side = DVector::from_fn(count, |k, _| f64::from(u32::try_from(k % 5).unwrap()) - 1.5);
        let exact = dense.lu().solve(&side).unwrap();
        let mut factors = Factors::new(count, &pairs);
        // The second factorisation is independent of the first.
        factors
            .factorise(&vec![1.0; count], &vec![0.0; pairs.len()])
            .unwrap();
        factors.factorise(&diagonal, &numbers).unwrap();
        let mut found = side.as_slice().to_vec();
        factors.solve(&mut found);
        let error = found.iter().zip(exact.iter()).map(|(a, b)| (a - b).abs());
        let error = error.fold(0.0, f64::max);
        println!("largest difference {error:e}");
        assert!(error < 1e-12 * exact.amax());
    }

    #[test]
    fn a_grid_fills_little() {
        // In row-by-row order, n times n points give n³ entries.
        for n in [40, 120] {
            let entries = Factors::new(n * n, &grid(n)).entries();
            println!("{n} times {n} points: {entries} entries of {}", n * n * n);
            assert!(entries < n * n * n * 6 / 10);
        }
        let large = Factors::new(120 * 120, &grid(120)).entries();
        assert!(large < 120_usize.pow(3) / 3);
    }

    #[test]
    fn a_singular_system_is_refused() {
        let mut factors = Factors::new(2, &[[0, 1]]);
        assert!(factors.factorise(&[1.0, 1.0], &[-1.0]).is_err());
        assert!(factors.factorise(&[1.0, 2.0], &[-1.0]).is_ok());
    }
}
