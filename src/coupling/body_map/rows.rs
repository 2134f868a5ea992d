//! Cells of a body near a slab, as one span per row along x: bodies are convex.

/// Spans of cells in rows along x.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Rows {
    /// First row: its y and z.
    low: [i32; 2],
    /// Number of rows along y and z.
    count: [i32; 2],
    /// First x of a row and one past its last, y fastest; equal for an empty row.
    spans: Vec<[i32; 2]>,
}

/// Row of cells: a span of x, and y and z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Row {
    pub(super) span: [i32; 2],
    pub(super) y: i32,
    pub(super) z: i32,
}

impl Row {
    pub(super) fn length(self) -> usize {
        usize::try_from(self.span[1] - self.span[0]).unwrap_or(0)
    }

    pub(super) fn cells(self) -> impl Iterator<Item = [i32; 3]> {
        let Self { span, y, z } = self;
        (span[0]..span[1]).map(move |x| [x, y, z])
    }
}

impl Rows {
    /// Sets the rows from `low` to `high` (y and z, both inclusive). Rows without cells at the ends are dropped, so
    /// that equal cells give equal rows in two dimensions.
    pub(super) fn take(
        &mut self,
        low: [i32; 2],
        high: [i32; 2],
        mut span: impl FnMut(i32, i32) -> [i32; 2],
    ) {
        self.spans.clear();
        self.low = low;
        self.count = [(high[0] - low[0] + 1).max(0), (high[1] - low[1] + 1).max(0)];
        for z in low[1]..=high[1] {
            for y in low[0]..=high[0] {
                self.spans.push(span(y, z));
            }
        }
        // Drop whole planes, or single rows if there is one plane only.
        let axis = usize::from(self.count[1] != 1);
        let group = if axis == 1 {
            usize::try_from(self.count[0]).unwrap_or(0)
        } else {
            1
        };
        if group == 0 {
            return;
        }
        let is_empty = |rows: &[[i32; 2]]| rows.iter().all(|span| span[0] >= span[1]);
        while self.spans.len() >= group && is_empty(&self.spans[self.spans.len() - group..]) {
            self.spans.truncate(self.spans.len() - group);
            self.count[axis] -= 1;
        }
        let before = self
            .spans
            .chunks_exact(group)
            .take_while(|rows| is_empty(rows))
            .count();
        self.spans.drain(..before * group);
        let before = i32::try_from(before).unwrap_or(i32::MAX);
        self.low[axis] += before;
        self.count[axis] -= before;
    }

    /// Reserves capacity for a number of rows.
    pub(super) fn reserve(&mut self, rows: usize) {
        self.spans.reserve(rows.saturating_sub(self.spans.len()));
    }

    pub(super) fn clear(&mut self) {
        self.spans.clear();
        self.count = [0; 2];
    }

    /// Returns the span of a row; empty if there is no such row.
    pub(super) fn span(&self, y: i32, z: i32) -> [i32; 2] {
        let at = [y - self.low[0], z - self.low[1]];
        if (0..2).all(|a| (0..self.count[a]).contains(&at[a])) {
            let place = usize::try_from(at[1] * self.count[0] + at[0]);
            place.map_or([0; 2], |place| self.spans[place])
        } else {
            [0; 2]
        }
    }

    /// Returns all non-empty rows.
    pub(super) fn rows(&self) -> impl Iterator<Item = Row> {
        let width = usize::try_from(self.count[0]).unwrap_or(0).max(1);
        let place = |n: usize| i32::try_from(n).unwrap_or(i32::MAX);
        let (low, spans) = (self.low, &self.spans);
        let all = spans.iter().enumerate().map(move |(n, &span)| Row {
            span,
            y: low[0] + place(n % width),
            z: low[1] + place(n / width),
        });
        all.filter(|row| row.span[0] < row.span[1])
    }

    /// Returns the two parts of a row that these rows do not contain.
    pub(super) fn missing_parts(&self, row: Row) -> [Row; 2] {
        let here = self.span(row.y, row.z);
        let part = |from: i32, to: i32| Row {
            span: [from, to.max(from)],
            ..row
        };
        if here[0] >= here[1] {
            return [row, part(row.span[1], row.span[1])];
        }
        let [from, to] = row.span;
        [part(from, to.min(here[0])), part(from.max(here[1]), to)]
    }

    /// Returns the parts at both ends of a row whose cells have a neighbour outside the body, judged by the
    /// adjacent rows (3 or 9).
    pub(super) fn ends(&self, row: Row, deep: bool) -> [Row; 2] {
        let deep = i32::from(deep);
        // Intersection of all adjacent rows, without its first and last cell.
        let [mut from, mut to] = row.span;
        for z in row.z - deep..=row.z + deep {
            for y in row.y - 1..=row.y + 1 {
                let near = self.span(y, z);
                from = from.max(near[0] + 1);
                to = to.min(near[1] - 1);
                if near[0] >= near[1] {
                    to = i32::MIN;
                }
            }
        }
        let part = |from: i32, to: i32| Row {
            span: [from, to],
            ..row
        };
        if from >= to {
            return [row, part(row.span[1], row.span[1])];
        }
        [part(row.span[0], from), part(to, row.span[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use base::random::Stream;

    /// Returns the cells whose centres lie in an ellipsoid of random position and shape, within a window that cuts some
    /// of the ellipsoids.
    fn body(draw: &mut Stream, deep: bool) -> Rows {
        let mut uniform = |low: f64, high: f64| low + (high - low) * draw.uniform();
        let centre = [uniform(-1.0, 1.0), uniform(-1.0, 1.0), uniform(-1.0, 1.0)];
        let axes = [uniform(0.2, 6.0), uniform(0.2, 6.0), uniform(0.2, 6.0)];
        let square = |v: i32, a: usize| ((f64::from(v) + 0.5 - centre[a]) / axes[a]).powi(2);
        let half = if deep { 7 } else { 0 };
        let mut rows = Rows::default();
        rows.take([-5, -half], [8, half], |y, z| {
            let beside = square(y, 1) + if deep { square(z, 2) } else { 0.0 };
            let mut inside = (-8..5).filter(|&x| square(x, 0) + beside < 1.0);
            let first = inside.next();
            first.map_or([0; 2], |x| [x, inside.next_back().unwrap_or(x) + 1])
        });
        rows
    }

    #[test]
    fn rows_say_the_same_as_sets_of_cells() {
        use std::collections::BTreeSet;
        let cells = |rows: &Rows| rows.rows().flat_map(Row::cells).collect::<BTreeSet<_>>();
        let mut draw = Stream::new(5, 0, 0);
        let (mut empty, mut differ) = (0, 0);
        for turn in 0..2000 {
            let deep = turn % 2 == 0;
            let (a, b) = (body(&mut draw, deep), body(&mut draw, deep));
            let (in_a, in_b) = (cells(&a), cells(&b));
            let lacking = a
                .rows()
                .flat_map(|row| b.missing_parts(row))
                .flat_map(Row::cells);
            assert_eq!(lacking.collect::<BTreeSet<_>>(), &in_a - &in_b);
            let near = |cell: [i32; 3]| {
                let depth = i32::from(deep);
                (-depth..=depth).flat_map(move |z| {
                    (-1..=1).flat_map(move |y| {
                        (-1..=1).map(move |x| [cell[0] + x, cell[1] + y, cell[2] + z])
                    })
                })
            };
            let edge = in_a
                .iter()
                .filter(|&&cell| near(cell).any(|n| !in_a.contains(&n)));
            let ends: Vec<_> = a
                .rows()
                .flat_map(|row| a.ends(row, deep))
                .flat_map(Row::cells)
                .collect();
            let set: BTreeSet<_> = ends.iter().copied().collect();
            assert_eq!(ends.len(), set.len(), "a cell stands twice");
            assert_eq!(set, edge.copied().collect::<BTreeSet<_>>());
            empty += usize::from(in_a.is_empty());
            differ += usize::from(in_a != in_b);
        }
        assert!(empty > 10 && differ > 1000, "{empty} {differ}");
    }
}
