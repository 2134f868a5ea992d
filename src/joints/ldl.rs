//! Direct solution of sparse symmetric systems by `L D L^T` without pivoting.
//!
//! The matrices of a network are positive definite; with the motion of blocks they become quasi-definite, for which the
//! factors exist in any order of elimination (Vanderbei, SIAM J. Optim. 5, 100 (1995)). The order is that of
//! approximate minimum degree on the quotient graph (George and Liu, SIAM Review 31, 1 (1989); Amestoy, Davis and Duff,
//! SIAM J. Matrix Anal. Appl. 17, 886 (1996)); the caller states it for large networks ([`crate::order`]). Columns with
//! the same rows form a dense panel ([`crate::panels`]), and the panels are factorised one after the other, each with
//! the updates of its children in the elimination tree (multifrontal method: Liu, SIAM Review 34, 82 (1992)): the inner
//! loops run over consecutive numbers without indices. The pattern is analysed once; further factorisations allocate
//! nothing. The order of operations is fixed, so that the bits are the same on every rank.

use crate::panels::{Panel, Panels};
use std::collections::BTreeSet;

/// Value for a missing parent or a missing entry.
const NONE: usize = usize::MAX;
/// Number of columns that a loop over rows combines.
const COLUMNS: usize = 4;

/// Factors of a symmetric matrix with a fixed pattern.
#[derive(Clone, Debug)]
pub(crate) struct Factors {
    panels: Panels,
    /// Values of the panels, each column by column with the rows of the panel. The diagonal has the pivots.
    lower: Vec<f64>,
    /// Updates of panels whose parents are not factorised yet.
    updates: Vec<f64>,
    /// Numbers in the order of elimination.
    work: Vec<f64>,
    /// Numbers at the rows of a panel.
    rows: Vec<f64>,
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

    /// Returns the analysis for unknowns that are eliminated in this order, or in another one with the same entries.
    pub(crate) fn in_order(order: Vec<usize>, pairs: &[[usize; 2]]) -> Self {
        let panels = Panels::new(order, pairs);
        Self {
            lower: vec![0.0; panels.values],
            updates: vec![0.0; panels.most_updates],
            work: vec![0.0; panels.order.len()],
            rows: vec![0.0; panels.most_rows],
            panels,
        }
    }

    /// Returns the memory of the factors \[bytes\].
    pub(crate) fn bytes(&self) -> usize {
        let numbers = self.lower.len() + self.updates.len() + self.work.len() + self.rows.len();
        self.panels.bytes() + numbers * size_of::<f64>()
    }

    /// Returns the number of entries of `L` below its diagonal.
    pub(crate) fn entries(&self) -> usize {
        self.panels.entries()
    }

    /// Computes the factors of the matrix with this diagonal and these values at its pairs. Values of a repeated
    /// pair are added.
    ///
    /// # Errors
    /// If a pivot is zero or not a number.
    pub(crate) fn factorise(&mut self, diagonal: &[f64], pairs: &[f64]) -> Result<(), Singular> {
        let Self {
            panels,
            lower,
            updates,
            ..
        } = self;
        lower.fill(0.0);
        for (value, &at) in diagonal.iter().zip(&panels.diagonal) {
            lower[at] += value;
        }
        for (value, &at) in pairs.iter().zip(&panels.pairs) {
            lower[at] += value;
        }
        let mut top = 0;
        for panel in &panels.list {
            let own = panels.rows_of(panel).len();
            let values = &mut lower[panel.values.clone()];
            // The updates of the children lie at the top, the last child first; that of the panel comes above them.
            let (children, free) = updates.split_at_mut(top);
            let update = &mut free[..own * own];
            update.fill(0.0);
            let mut end = top;
            for &child in &panels.children[panel.children.clone()] {
                let child = &panels.list[child];
                let size = child.rows.len();
                end -= size * size;
                let targets = &panels.targets[child.rows.clone()];
                add_child(
                    &children[end..end + size * size],
                    targets,
                    panel,
                    values,
                    update,
                );
            }
            factorise_panel(panel, values)
                .map_err(|column| Singular(panels.order[panel.first + column]))?;
            subtract_products(panel, values, update);
            updates.copy_within(top..top + own * own, end);
            top = end + own * own;
        }
        Ok(())
    }

    /// Replaces the right-hand side by the solution.
    pub(crate) fn solve(&mut self, side: &mut [f64]) {
        let Self {
            panels,
            lower,
            work,
            rows,
            ..
        } = self;
        for (number, &unknown) in work.iter_mut().zip(&panels.order) {
            *number = side[unknown];
        }
        for panel in &panels.list {
            let below = panels.rows_of(panel);
            panel.forward(&lower[panel.values.clone()], below, work, rows);
        }
        for panel in panels.list.iter().rev() {
            let below = panels.rows_of(panel);
            panel.backward(&lower[panel.values.clone()], below, work, rows);
        }
        for (number, &at) in side.iter_mut().zip(&panels.position) {
            *number = work[at];
        }
    }
}

/// Adds the update of a child to the columns of its parent and to the update of the parent. `targets` are the rows of
/// the child among those of the parent.
fn add_child(
    child: &[f64],
    targets: &[u32],
    panel: &Panel,
    values: &mut [f64],
    update: &mut [f64],
) {
    let (size, columns, height) = (targets.len(), panel.columns, panel.height());
    let own = height - columns;
    for (column, &to) in targets.iter().enumerate() {
        let entries = child[column * size..][column..size].iter();
        let entries = entries.zip(&targets[column..]);
        let to = to as usize;
        if to < columns {
            let values = &mut values[to * height..(to + 1) * height];
            entries.for_each(|(entry, &row)| values[row as usize] += entry);
        } else {
            let update = &mut update[(to - columns) * own..(to - columns + 1) * own];
            entries.for_each(|(entry, &row)| update[row as usize - columns] += entry);
        }
    }
}

/// Factorises the columns of a panel; fails with the column of a pivot that is zero or not a number.
fn factorise_panel(panel: &Panel, values: &mut [f64]) -> Result<(), usize> {
    let (columns, height) = (panel.columns, panel.height());
    for column in 0..columns {
        let (before, own) = values.split_at_mut(column * height);
        let own = &mut own[column..height];
        let mut done = 0;
        while done < column {
            let width = COLUMNS.min(column - done);
            subtract_columns(before, (done, width, height), column, own);
            done += width;
        }
        let pivot = own[0];
        if !(pivot.is_finite() && pivot.abs() > 0.0) {
            return Err(column);
        }
        own[1..].iter_mut().for_each(|entry| *entry /= pivot);
    }
    Ok(())
}

/// Subtracts the products of columns with their entries in a row from the rows from there on. `(first, width, height)`
/// are the first of the columns, their number, and the number of their rows; the pivots are on the diagonal.
fn subtract_columns(
    columns: &[f64],
    (first, width, height): (usize, usize, usize),
    row: usize,
    to: &mut [f64],
) {
    let column = |k: usize| &columns[(first + k) * height..(first + k + 1) * height];
    let part = |k: usize| column(k)[row] * column(k)[first + k];
    if width == COLUMNS {
        let parts: [f64; COLUMNS] = std::array::from_fn(part);
        let [a, b, c, d] = std::array::from_fn(|k| &column(k)[row..row + to.len()]);
        for (at, to) in to.iter_mut().enumerate() {
            *to -= (parts[0] * a[at] + parts[1] * b[at]) + (parts[2] * c[at] + parts[3] * d[at]);
        }
        return;
    }
    for k in 0..width {
        let part = part(k);
        for (to, entry) in to.iter_mut().zip(&column(k)[row..]) {
            *to -= part * entry;
        }
    }
}

/// Subtracts the products of the columns of a panel from the update of its parent.
fn subtract_products(panel: &Panel, values: &[f64], update: &mut [f64]) {
    let (columns, height) = (panel.columns, panel.height());
    let own = height - columns;
    for column in 0..own {
        let to = &mut update[column * own..(column + 1) * own][column..];
        let mut done = 0;
        while done < columns {
            let width = COLUMNS.min(columns - done);
            subtract_columns(values, (done, width, height), columns + column, to);
            done += width;
        }
    }
}

impl Panel {
    /// Eliminates the unknowns of the panel from a right-hand side `work`.
    fn forward(&self, values: &[f64], below: &[u32], work: &mut [f64], rows: &mut [f64]) {
        let (columns, height) = (self.columns, self.height());
        if columns == 1 {
            let number = work[self.first];
            for (entry, &row) in values[1..].iter().zip(below) {
                work[row as usize] -= entry * number;
            }
            return;
        }
        let own = &mut work[self.first..self.first + columns];
        for column in 1..columns {
            let number = own[column - 1];
            let entries = &values[(column - 1) * height..][column..columns];
            for (to, entry) in own[column..].iter_mut().zip(entries) {
                *to -= entry * number;
            }
        }
        let rows = &mut rows[..below.len()];
        rows.fill(0.0);
        let column = |k: usize| &values[k * height..][columns..height];
        let whole = columns / COLUMNS * COLUMNS;
        for first in (0..whole).step_by(COLUMNS) {
            let parts: [f64; COLUMNS] = std::array::from_fn(|k| own[first + k]);
            let [a, b, c, d] = std::array::from_fn(|k| &column(first + k)[..rows.len()]);
            for (at, to) in rows.iter_mut().enumerate() {
                *to +=
                    (parts[0] * a[at] + parts[1] * b[at]) + (parts[2] * c[at] + parts[3] * d[at]);
            }
        }
        for k in whole..columns {
            let part = own[k];
            for (to, entry) in rows.iter_mut().zip(column(k)) {
                *to += part * entry;
            }
        }
        for (number, &row) in rows.iter().zip(below) {
            work[row as usize] -= number;
        }
    }

    /// Replaces the unknowns of the panel in `work` by the solution, after those of its rows.
    fn backward(&self, values: &[f64], below: &[u32], work: &mut [f64], rows: &mut [f64]) {
        let (columns, height) = (self.columns, self.height());
        let rows = &mut rows[..below.len()];
        for (number, &row) in rows.iter_mut().zip(below) {
            *number = work[row as usize];
        }
        let own = &mut work[self.first..self.first + columns];
        let column = |k: usize| &values[k * height..(k + 1) * height];
        for (k, number) in own.iter_mut().enumerate() {
            *number /= column(k)[k];
        }
        let whole = columns / COLUMNS * COLUMNS;
        for first in (0..whole).step_by(COLUMNS) {
            let [a, b, c, d] =
                std::array::from_fn(|k| &column(first + k)[columns..columns + rows.len()]);
            let mut sums = [[0.0; 2]; COLUMNS];
            for (at, numbers) in rows.chunks(2).enumerate() {
                for (half, number) in numbers.iter().enumerate() {
                    let at = 2 * at + half;
                    sums[0][half] += a[at] * number;
                    sums[1][half] += b[at] * number;
                    sums[2][half] += c[at] * number;
                    sums[3][half] += d[at] * number;
                }
            }
            for (number, sums) in own[first..].iter_mut().zip(sums) {
                *number -= sums[0] + sums[1];
            }
        }
        for k in whole..columns {
            own[k] -= product(&column(k)[columns..], rows);
        }
        for k in (0..columns).rev() {
            let (above, later) = own.split_at_mut(k + 1);
            above[k] -= product(&column(k)[k + 1..columns], later);
        }
    }
}

/// Returns the sum of the products of two lists, in four partial sums.
#[inline]
fn product(one: &[f64], other: &[f64]) -> f64 {
    let mut sums = [0.0; COLUMNS];
    let (ones, others) = (one.chunks_exact(COLUMNS), other.chunks_exact(COLUMNS));
    let rest = ones.remainder().iter().zip(others.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (one, other) in ones.zip(others) {
        for k in 0..COLUMNS {
            sums[k] += one[k] * other[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
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
