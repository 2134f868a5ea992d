//! Analysis of a sparse symmetric matrix: panels of columns of its factor with the same rows.
//!
//! The elimination tree has a parent for each column: the first row below its diagonal (Davis, Direct Methods for
//! Sparse Linear Systems, 2006, chapter 4). Children come directly before their parents, so that a column and its
//! parent with the same rows are consecutive. A panel is joined to its parent if few zeros are stored in addition
//! (Ashcraft and Grimes, ACM Trans. Math. Softw. 15, 291 (1989)).

use base::number::real;
use std::ops::Range;

/// Value for a missing parent.
const NONE: usize = usize::MAX;
/// Largest part of zeros in the values of a joined panel.
const ZEROS: f64 = 0.1;
/// Number of zeros up to which panels are joined in any case.
const FEW_ZEROS: usize = 16;

/// Columns of a factor with the same rows.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    /// Position of the first column in the order of elimination, and number of columns.
    pub(crate) first: usize,
    pub(crate) columns: usize,
    /// Rows below the columns, in the list of all panels.
    pub(crate) rows: Range<usize>,
    /// Values in the factor.
    pub(crate) values: Range<usize>,
    /// Children in the list of all panels, the last one first.
    pub(crate) children: Range<usize>,
}

impl Panel {
    /// Returns the number of rows with those of the columns themselves.
    pub(crate) fn height(&self) -> usize {
        self.columns + self.rows.len()
    }
}

/// Panels of a matrix with a fixed pattern, and the places of its entries.
#[derive(Clone, Debug)]
pub(crate) struct Panels {
    /// Position of each unknown in the order of elimination.
    pub(crate) position: Vec<usize>,
    /// Unknown at each position.
    pub(crate) order: Vec<usize>,
    /// Panels, children before their parents.
    pub(crate) list: Vec<Panel>,
    /// Rows of all panels, and their places among the rows of the parent of their panel.
    rows: Vec<u32>,
    pub(crate) targets: Vec<u32>,
    pub(crate) children: Vec<usize>,
    /// Place in the values of the diagonal entry of each unknown, and of each pair.
    pub(crate) diagonal: Vec<usize>,
    pub(crate) pairs: Vec<usize>,
    /// Number of values.
    pub(crate) values: usize,
    /// Largest number of values of updates at a time, and largest number of rows of a panel.
    pub(crate) most_updates: usize,
    pub(crate) most_rows: usize,
}

/// Columns `first..end` that form a panel; the rows of the last one are those of the panel.
struct Span {
    first: usize,
    end: usize,
    /// Number of zeros that the panel stores in addition.
    zeros: usize,
}

impl Panels {
    /// Returns the panels for unknowns that are eliminated in this order, or in another one with the same entries.
    pub(crate) fn new(order: Vec<usize>, pairs: &[[usize; 2]]) -> Self {
        let order = children_first(order, pairs);
        let position = positions(&order);
        let (starts, rows) = columns_above(pairs, &position);
        let parents = elimination_tree(&starts, &rows);
        let (column_starts, column_rows) = columns_of_factor(&parents, &starts, &rows);
        let below = |column: usize| &column_rows[column_starts[column]..column_starts[column + 1]];
        let mut all = Self {
            position,
            order,
            list: Vec::new(),
            rows: Vec::new(),
            targets: Vec::new(),
            children: Vec::new(),
            diagonal: Vec::new(),
            pairs: Vec::new(),
            values: 0,
            most_updates: 0,
            most_rows: 0,
        };
        for span in spans(&parents, below) {
            let first_row = all.rows.len();
            all.rows.extend(below(span.end - 1));
            let rows = first_row..all.rows.len();
            let columns = span.end - span.first;
            let end = all.values + columns * (columns + rows.len());
            all.list.push(Panel {
                first: span.first,
                columns,
                rows,
                values: all.values..end,
                children: 0..0,
            });
            all.values = end;
        }
        all.find_targets();
        all.find_entries(pairs);
        all
    }

    /// Returns the rows below the columns of a panel.
    pub(crate) fn rows_of(&self, panel: &Panel) -> &[u32] {
        &self.rows[panel.rows.clone()]
    }

    /// Returns the number of values below the diagonal.
    pub(crate) fn entries(&self) -> usize {
        let entries = |panel: &Panel| {
            panel.columns * (panel.columns - 1) / 2 + panel.columns * panel.rows.len()
        };
        self.list.iter().map(entries).sum()
    }

    /// Returns the memory of the analysis \[bytes\].
    pub(crate) fn bytes(&self) -> usize {
        let indices = 3 * self.order.len() + self.pairs.len() + self.children.len();
        indices * size_of::<usize>()
            + 2 * self.rows.len() * size_of::<u32>()
            + self.list.len() * size_of::<Panel>()
    }

    /// Returns the panel of each column.
    fn panel_of(&self) -> Vec<usize> {
        let list = self.list.iter().enumerate();
        list.flat_map(|(number, panel)| std::iter::repeat_n(number, panel.columns))
            .collect()
    }

    /// Finds the parents of the panels, the places of rows in them, and the memory of the updates.
    fn find_targets(&mut self) {
        let panel_of = self.panel_of();
        let mut children = vec![Vec::new(); self.list.len()];
        let mut targets = vec![0; self.rows.len()];
        for (number, panel) in self.list.iter().enumerate() {
            let Some(&first) = self.rows_of(panel).first() else {
                continue;
            };
            let above = panel_of[first as usize];
            children[above].push(number);
            let parent = &self.list[above];
            let mut later = self.rows_of(parent).iter().enumerate();
            for at in panel.rows.clone() {
                let row = self.rows[at] as usize;
                let place = if row < parent.first + parent.columns {
                    row - parent.first
                } else {
                    let place = later.find(|(_, later)| **later as usize == row);
                    parent.columns + place.map_or(0, |(place, _)| place)
                };
                targets[at] = index(place);
            }
        }
        self.targets = targets;
        let square = |panel: &Panel| panel.rows.len() * panel.rows.len();
        let mut held = 0;
        for (number, list) in children.iter().enumerate() {
            let begin = self.children.len();
            self.children.extend(list.iter().rev());
            self.list[number].children = begin..self.children.len();
            held += square(&self.list[number]);
            self.most_updates = self.most_updates.max(held);
            held -= list
                .iter()
                .map(|child| square(&self.list[*child]))
                .sum::<usize>();
            self.most_rows = self.most_rows.max(self.list[number].rows.len());
        }
    }

    /// Finds the places of the entries of the matrix in the values.
    fn find_entries(&mut self, pairs: &[[usize; 2]]) {
        let panel_of = self.panel_of();
        let place = |column: usize, row: usize| {
            let panel = &self.list[panel_of[column]];
            let row = if row < panel.first + panel.columns {
                row - panel.first
            } else {
                let place = self.rows_of(panel).binary_search(&index(row));
                panel.columns + place.unwrap_or(0)
            };
            panel.values.start + (column - panel.first) * panel.height() + row
        };
        let diagonal = self.position.iter().map(|&at| place(at, at)).collect();
        let pairs = pairs.iter().map(|pair| {
            let [a, b] = pair.map(|unknown| self.position[unknown]);
            place(a.min(b), a.max(b))
        });
        (self.pairs, self.diagonal) = (pairs.collect(), diagonal);
    }
}

/// Returns an index as a number of a list of rows.
fn index(number: usize) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// Returns the position of each unknown in an order.
fn positions(order: &[usize]) -> Vec<usize> {
    let mut position = vec![0; order.len()];
    for (at, &unknown) in order.iter().enumerate() {
        position[unknown] = at;
    }
    position
}

/// Returns an order with the same entries of the factor in which all children come directly before their parents.
fn children_first(order: Vec<usize>, pairs: &[[usize; 2]]) -> Vec<usize> {
    let (starts, rows) = columns_above(pairs, &positions(&order));
    let parents = elimination_tree(&starts, &rows);
    let count = order.len();
    let (mut first, mut next) = (vec![NONE; count], vec![NONE; count]);
    for column in (0..count).rev() {
        if parents[column] != NONE {
            next[column] = std::mem::replace(&mut first[parents[column]], column);
        }
    }
    let mut sorted = Vec::with_capacity(count);
    for root in (0..count).filter(|column| parents[*column] == NONE) {
        let mut path = vec![root];
        while let Some(&column) = path.last() {
            let child = std::mem::replace(&mut first[column], NONE);
            if child == NONE {
                sorted.push(order[column]);
                path.pop();
                if let Some(&above) = path.last() {
                    first[above] = next[column];
                }
            } else {
                path.push(child);
            }
        }
    }
    sorted
}

/// Returns the entries above the diagonal by columns in the order of elimination: starts and rows.
fn columns_above(pairs: &[[usize; 2]], position: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let ends = |pair: &[usize; 2]| {
        let [a, b] = pair.map(|unknown| position[unknown]);
        [a.min(b), a.max(b)]
    };
    let count = position.len();
    let mut starts = vec![0; count + 1];
    for pair in pairs {
        starts[ends(pair)[1] + 1] += 1;
    }
    for column in 0..count {
        starts[column + 1] += starts[column];
    }
    let (mut next, mut rows) = (starts.clone(), vec![0; pairs.len()]);
    for pair in pairs {
        let [row, column] = ends(pair);
        rows[next[column]] = row;
        next[column] += 1;
    }
    (starts, rows)
}

/// Returns the parent of each column in the elimination tree; [`NONE`] for roots.
fn elimination_tree(starts: &[usize], rows: &[usize]) -> Vec<usize> {
    let count = starts.len() - 1;
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

/// Returns the rows below the diagonal of each column of the factor: starts and rows.
fn columns_of_factor(
    parents: &[usize],
    starts: &[usize],
    rows: &[usize],
) -> (Vec<usize>, Vec<u32>) {
    let count = parents.len();
    let mut column_starts = vec![0; count + 1];
    each_entry(parents, starts, rows, |_, column| {
        column_starts[column + 1] += 1
    });
    for column in 0..count {
        column_starts[column + 1] += column_starts[column];
    }
    let mut filled = column_starts.clone();
    let mut column_rows = vec![0; column_starts[count]];
    each_entry(parents, starts, rows, |row, column| {
        column_rows[filled[column]] = index(row);
        filled[column] += 1;
    });
    (column_starts, column_rows)
}

/// Calls a function with row and column of each entry of the factor, row by row.
fn each_entry(
    parents: &[usize],
    starts: &[usize],
    rows: &[usize],
    mut visit: impl FnMut(usize, usize),
) {
    let mut seen = vec![NONE; parents.len()];
    for row in 0..parents.len() {
        seen[row] = row;
        for &first in &rows[starts[row]..starts[row + 1]] {
            let mut node = first;
            while node != NONE && seen[node] != row {
                seen[node] = row;
                visit(row, node);
                node = parents[node];
            }
        }
    }
}

/// Returns the columns of the panels, children before their parents.
fn spans<'a>(parents: &[usize], below: impl Fn(usize) -> &'a [u32]) -> Vec<Span> {
    let mut spans: Vec<Span> = Vec::new();
    for column in 0..parents.len() {
        let mut span = Span {
            first: column,
            end: column + 1,
            zeros: 0,
        };
        while let Some(child) = spans.last()
            && (span.first..span.end).contains(&parents[child.end - 1])
        {
            let (lower, upper) = (child.end - child.first, span.end - span.first);
            let rows = below(span.end - 1).len();
            let more = lower * (upper + rows - below(child.end - 1).len());
            let zeros = more + child.zeros + span.zeros;
            let columns = lower + upper;
            let values = columns * rows + columns * (columns + 1) / 2;
            if more > FEW_ZEROS && real(zeros) > ZEROS * real(values) {
                break;
            }
            span = Span {
                first: child.first,
                end: span.end,
                zeros,
            };
            spans.pop();
        }
        spans.push(span);
    }
    spans
}
