//! Pairs of nearby discs or spheres, at a cost proportional to their number.
//!
//! Balls are sorted into levels by size. The size doubles from level to level. A level has a grid whose cells are
//! as wide as its largest ball, so that a ball of this level or a smaller one can only touch balls in adjacent
//! cells. The balls of a row of cells are sorted by x and swept; adjacent rows are found by index. The cost is
//! proportional to the number of nearby pairs, also for a full slab of grains or a wide range of sizes.

use super::grid::Grid;
use super::sample::ListedGrain;
use std::collections::{BTreeMap, HashMap};
use std::ops::{ControlFlow, Range};

/// Disc or sphere, enlarged by the gap within which another ball is near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    /// Centre \[m\].
    pub(crate) at: [f64; 3],
    /// Half of the distance \[m\] up to which a ball of equal size is near.
    pub(crate) reach: f64,
}

/// Ball or periodic image of a ball.
#[derive(Clone, Copy)]
struct Entry {
    row: (i64, i64),
    at: [f64; 3],
    reach: f64,
    index: usize,
    image: bool,
}

/// Visits each pair of balls whose centre distance is at most the sum of their reaches once, with the smaller index
/// first, until `visit` breaks. `period` has the length of each periodic axis \[m\]. Balls with a non-finite
/// position or without a positive reach are never near.
pub(crate) fn near(
    balls: &[Ball],
    period: [Option<f64>; 3],
    visit: impl FnMut(usize, usize) -> ControlFlow<()>,
) -> ControlFlow<()> {
    counted(balls, period, visit, &mut 0)
}

/// Largest gap of grains that touch, relative to their radii.
pub(crate) const TOUCHES: f64 = 1e-3;
/// Largest number of contacts per sphere of equal spheres, each of two spheres.
const MOST_CONTACTS: usize = 6;

/// Returns the number of pairs of grains that touch, at most that of equal spheres.
pub(crate) fn touching(grains: &[ListedGrain], grid: &Grid) -> usize {
    let ball = |grain: &ListedGrain| Ball {
        at: grain.position,
        reach: grain.radius * (1.0 + TOUCHES),
    };
    let balls: Vec<Ball> = grains.iter().map(ball).collect();
    let period = std::array::from_fn(|a| grid.periodic[a].then_some(grid.size[a]));
    let mut pairs = 0;
    let _ = near(&balls, period, |_, _| {
        pairs += 1;
        // Grains that overlap are another finding.
        if pairs < MOST_CONTACTS * grains.len() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    pairs
}

/// Visits pairs like [`near`]; `compared` counts the comparisons.
fn counted(
    balls: &[Ball],
    period: [Option<f64>; 3],
    mut visit: impl FnMut(usize, usize) -> ControlFlow<()>,
    compared: &mut u64,
) -> ControlFlow<()> {
    let mut levels: BTreeMap<i32, Vec<Entry>> = BTreeMap::new();
    for (index, ball) in balls.iter().enumerate() {
        let finite = ball.at.iter().all(|x| x.is_finite()) && ball.reach.is_finite();
        if !finite || ball.reach <= 0.0 {
            continue;
        }
        let at = std::array::from_fn(|a| match period[a] {
            Some(length) if length > 0.0 => ball.at[a].rem_euclid(length),
            _ => ball.at[a],
        });
        levels.entry(level(ball.reach)).or_default().push(Entry {
            row: (0, 0),
            at,
            reach: ball.reach,
            index,
            image: false,
        });
    }
    let periodic = period.iter().any(Option::is_some);
    let mut found = Vec::new();
    for (large, theirs) in &levels {
        let widest = theirs.iter().map(|e| e.reach).fold(0.0, f64::max);
        let edge = 2.0 * widest;
        let mut grid = with_images(theirs, period, edge);
        let rows = in_rows(&mut grid, edge);
        for (small, ours) in levels.range(..=large) {
            // For a level with itself the balls are already in order.
            let mut sorted = Vec::new();
            let sorted_rows;
            let (ours, groups) = if small == large {
                (&grid, &rows)
            } else {
                sorted.extend_from_slice(ours);
                sorted_rows = in_rows(&mut sorted, edge);
                (&sorted, &sorted_rows)
            };
            let mut places: Vec<(i64, i64)> = groups.keys().copied().collect();
            places.sort_unstable();
            for place in places {
                let mut beside: Vec<Range<usize>> = Vec::with_capacity(9);
                for y in -1..=1 {
                    for z in -1..=1 {
                        let row = (place.0.saturating_add(y), place.1.saturating_add(z));
                        beside.extend(rows.get(&row).cloned());
                    }
                }
                for one in ours[groups[&place].clone()].iter().filter(|e| !e.image) {
                    found.clear();
                    for range in &mut beside {
                        // Balls before this one are not near to later ones either.
                        while range.start < range.end && grid[range.start].at[0] < one.at[0] - edge
                        {
                            range.start += 1;
                        }
                        for other in &grid[range.clone()] {
                            if other.at[0] > one.at[0] + edge {
                                break;
                            }
                            *compared += 1;
                            let mine = one.index < other.index
                                || (small != large && one.index != other.index);
                            if mine && touch(one, other) {
                                found.push(other.index);
                            }
                        }
                    }
                    if periodic {
                        // In a narrow periodic domain a pair may be near both directly and through an image.
                        found.sort_unstable();
                        found.dedup();
                    }
                    for &other in &found {
                        visit(one.index.min(other), one.index.max(other))?;
                    }
                }
            }
        }
    }
    ControlFlow::Continue(())
}

/// Returns the level of a size: the exponent of the next larger power of two.
fn level(reach: f64) -> i32 {
    // The exponent of a finite number fits.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "exponents of f64 are small"
    )]
    let exponent = reach.log2().ceil() as i32;
    exponent
}

fn touch(one: &Entry, other: &Entry) -> bool {
    let squared: f64 = (0..3).map(|a| (one.at[a] - other.at[a]).powi(2)).sum();
    let reach = one.reach + other.reach;
    // Rounding must not miss a pair.
    squared <= reach * reach * (1.0 + 1e-12)
}

/// Returns the balls of a level with those of their periodic images that lie up to `edge` beyond the domain.
fn with_images(balls: &[Entry], period: [Option<f64>; 3], edge: f64) -> Vec<Entry> {
    let mut all = balls.to_vec();
    for (axis, length) in period.into_iter().enumerate() {
        let Some(length) = length else { continue };
        for n in 0..all.len() {
            for shift in [-length, length] {
                let at = all[n].at[axis] + shift;
                if at >= -edge && at <= length + edge {
                    let mut image = all[n];
                    image.at[axis] = at;
                    image.image = true;
                    all.push(image);
                }
            }
        }
    }
    all
}

/// Sorts balls into rows of cells along x, and each row by x; returns the range of each row.
fn in_rows(balls: &mut [Entry], edge: f64) -> HashMap<(i64, i64), Range<usize>> {
    for ball in balls.iter_mut() {
        ball.row = (cell(ball.at[1], edge), cell(ball.at[2], edge));
    }
    balls.sort_unstable_by(|a, b| {
        let by_row = a.row.cmp(&b.row);
        by_row
            .then(a.at[0].total_cmp(&b.at[0]))
            .then(a.index.cmp(&b.index))
    });
    let mut rows = HashMap::new();
    let mut start = 0;
    for chunk in balls.chunk_by(|a, b| a.row == b.row) {
        rows.insert(chunk[0].row, start..start + chunk.len());
        start += chunk.len();
    }
    rows
}

/// Returns the cell of a coordinate; coordinates beyond the range of cell numbers get the last cell.
fn cell(x: f64, edge: f64) -> i64 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a cast from a float saturates"
    )]
    let cell = (x / edge).floor() as i64;
    cell
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn found(balls: &[Ball], period: [Option<f64>; 3]) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        let done = near(balls, period, |i, j| {
            pairs.push((i, j));
            ControlFlow::Continue(())
        });
        assert!(done.is_continue());
        pairs.sort_unstable();
        pairs
    }

    fn all(balls: &[Ball], period: [Option<f64>; 3]) -> Vec<(usize, usize)> {
        let mut pairs = Vec::new();
        for i in 0..balls.len() {
            for j in i + 1..balls.len() {
                let squared: f64 = (0..3)
                    .map(|a| {
                        let apart = balls[i].at[a] - balls[j].at[a];
                        let turns = period[a].map_or(0.0, |l| l * (apart / l).round());
                        (apart - turns).powi(2)
                    })
                    .sum();
                if squared.sqrt() <= balls[i].reach + balls[j].reach {
                    pairs.push((i, j));
                }
            }
        }
        pairs
    }

    fn ball() -> impl Strategy<Value = Ball> {
        (proptest::array::uniform3(-0.2_f64..1.2), -9.0_f64..-0.5).prop_map(|(at, size)| Ball {
            at,
            reach: size.exp2(),
        })
    }

    proptest! {
        #[test]
        fn the_pairs_are_those_of_all_against_all(
            balls in proptest::collection::vec(ball(), 0..80), closed in proptest::array::uniform3(any::<bool>())
        ) {
            let period = closed.map(|closed| (!closed).then_some(1.0));
            prop_assert_eq!(found(&balls, period), all(&balls, period));
        }
    }

    #[test]
    fn only_what_is_near_is_compared() {
        // A cube of grains with distances slightly above one diameter, one distant grain, and one as large as the
        // cube: a sweep along one axis would need many more visits.
        let mut balls = Vec::new();
        for n in 0..20_u8 {
            for m in 0..20_u8 {
                for k in 0..20_u8 {
                    balls.push(Ball {
                        at: [n, m, k].map(|x| 1.01 * f64::from(x)),
                        reach: 0.5,
                    });
                }
            }
        }
        balls.push(Ball {
            at: [1e300, 0.0, 0.0],
            reach: 0.5,
        });
        let mut compared = 0;
        let done = counted(
            &balls,
            [None; 3],
            |_, _| ControlFlow::Break(()),
            &mut compared,
        );
        assert!(done.is_continue());
        // Three by three rows, and in each the balls that are less than two diameters away.
        assert!(compared <= 27 * 8001, "{compared}");
        balls.push(Ball {
            at: [-20.0, 0.0, 0.0],
            reach: 20.0,
        });
        assert!(found(&balls, [None; 3]).contains(&(0, 8001)));
        balls.push(Ball {
            at: [f64::NAN; 3],
            reach: 0.5,
        });
        assert!(found(&balls, [None; 3]).iter().all(|(_, j)| *j == 8001));
    }

    #[test]
    fn a_visitor_can_leave() {
        let balls = [Ball {
            at: [0.0; 3],
            reach: 1.0,
        }; 1000];
        let mut visits = 0;
        let left = near(&balls, [None; 3], |_, _| {
            visits += 1;
            if visits == 10 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        assert!(left.is_break() && visits == 10);
    }
}
