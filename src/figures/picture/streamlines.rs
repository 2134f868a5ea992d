//! Streamlines of a plane flow. They are integrated in both directions from seeds by the Runge-Kutta method of fourth
//! order, until they leave the fluid, the velocity vanishes, or another line is close. Seeds are tried in rows, so that
//! the lines fill the plane evenly (Jobard and Lefer, Visualization in Scientific Computing '97, 43, with squares
//! instead of distances).

use super::Water;
use crate::svg::{Svg, points};
use base::number::{real, whole};

/// Number of squares along the longer edge of the plane; each square contains one line at most.
const SQUARES: f64 = 36.0;
/// Maximum number of steps of a line in each direction, of half a cell each.
const MAX_STEPS: usize = 4000;

/// Returns the velocity at a point in cells from the corner, interpolated between the centres of cells; `None` in
/// solids and outside.
fn velocity(water: &Water, flow: &[[f64; 3]], at: [f64; 2]) -> Option<[f64; 2]> {
    let [width, height] = [water.cells[0], water.cells[1]];
    if !(0.0..real(width)).contains(&at[0]) || !(0.0..real(height)).contains(&at[1]) {
        return None;
    }
    if water.solid[whole(at[1]) * width + whole(at[0])] {
        return None;
    }
    let mut sum = [0.0; 2];
    let mut weights = 0.0;
    let low = at.map(|x| (x - 0.5).floor());
    for corner in 0..4_usize {
        let cell = [low[0] + real(corner & 1), low[1] + real(corner >> 1)];
        let weight: f64 = (0..2)
            .map(|a| 1.0 - (at[a] - 0.5 - cell[a]).abs())
            .product();
        let [k, l] = [
            whole(cell[0].max(0.0)).min(width - 1),
            whole(cell[1].max(0.0)).min(height - 1),
        ];
        let n = l * width + k;
        if !water.solid[n] {
            sum[0] += weight * flow[n][0];
            sum[1] += weight * flow[n][1];
            weights += weight;
        }
    }
    (weights > 0.0).then(|| sum.map(|v| v / weights))
}

/// Returns the unit vector of the flow direction.
fn direction(water: &Water, flow: &[[f64; 3]], at: [f64; 2], still: f64) -> Option<[f64; 2]> {
    let [u, v] = velocity(water, flow, at)?;
    let speed = u.hypot(v);
    (speed > still).then(|| [u / speed, v / speed])
}

/// Returns a step of `length` cells along the flow.
fn step(
    water: &Water,
    flow: &[[f64; 3]],
    at: [f64; 2],
    length: f64,
    still: f64,
) -> Option<[f64; 2]> {
    let go =
        |k: [f64; 2], share: f64| [at[0] + share * length * k[0], at[1] + share * length * k[1]];
    let look = |at| direction(water, flow, at, still);
    let a = look(at)?;
    let b = look(go(a, 0.5))?;
    let c = look(go(b, 0.5))?;
    let d = look(go(c, 1.0))?;
    let mean = std::array::from_fn(|n| (a[n] + 2.0 * (b[n] + c[n]) + d[n]) / 6.0);
    Some(go(mean, 1.0))
}

/// Returns streamlines through the plane, in cells from its corner.
pub(super) fn lines(water: &Water) -> Vec<Vec<[f64; 2]>> {
    let Some(flow) = &water.flow else {
        return Vec::new();
    };
    let fastest = flow.iter().map(|v| v[0].hypot(v[1])).fold(0.0, f64::max);
    let still = 1e-4 * fastest;
    let edge = (real(water.cells[0].max(water.cells[1])) / SQUARES).max(1.0);
    let squares = [0, 1].map(|a| whole((real(water.cells[a]) / edge).ceil()).max(1));
    let square = |at: [f64; 2]| {
        let [k, l] = [0, 1].map(|a| whole((at[a] / edge).max(0.0)).min(squares[a] - 1));
        l * squares[0] + k
    };
    // Number of the line through each square; 0 without a line.
    let mut taken = vec![0_usize; squares[0] * squares[1]];
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    for seed in 0..taken.len() {
        if taken[seed] > 0 {
            continue;
        }
        let start = [
            (real(seed % squares[0]) + 0.5) * edge,
            (real(seed / squares[0]) + 0.5) * edge,
        ];
        let name = lines.len() + 1;
        let mut line = Vec::new();
        let mut passed = Vec::new();
        for length in [-0.5, 0.5] {
            let mut at = start;
            for _ in 0..MAX_STEPS {
                let Some(next) = step(water, flow, at, length, still) else {
                    break;
                };
                let there = square(next);
                if taken[there] > 0 {
                    break;
                }
                passed.push(there);
                // The line is closed.
                let home = (next[0] - start[0]).hypot(next[1] - start[1]);
                if line.len() > 12 && home < 0.4 {
                    break;
                }
                line.push(next);
                at = next;
            }
            if length < 0.0 {
                line.reverse();
                line.push(start);
            }
        }
        if line.len() > whole(2.0 * edge).max(4) {
            for square in passed {
                taken[square] = name;
            }
            taken[seed] = name;
            lines.push(line);
        }
    }
    lines
}

/// Returns the lines as SVG, with an arrow in the middle of each. `place` maps cells to the picture.
pub(super) fn draw(water: &Water, place: impl Fn([f64; 2]) -> [f64; 2]) -> String {
    let mut svg = Svg::default();
    svg.put(format_args!(
        "<g fill=\"none\" stroke=\"#222\" stroke-width=\"0.8\">"
    ));
    for line in lines(water) {
        // One point per cell has the resolution of the field.
        let shown = line.iter().step_by(2).chain(line.last());
        let points = points(shown.map(|point| place(*point)));
        svg.put(format_args!("<polyline points=\"{points}\"/>"));
        let middle = line.len() / 2;
        if let (Some(&a), Some(&b)) = (line.get(middle.saturating_sub(1)), line.get(middle)) {
            let ([x0, y0], [x, y]) = (place(a), place(b));
            let turn = (y - y0).atan2(x - x0).to_degrees();
            svg.put(format_args!(
                "<path d=\"M-4,-2.5 L2,0 L-4,2.5 z\" fill=\"#222\" stroke=\"none\" transform=\"translate({x:.1},\
                 {y:.1}) rotate({turn:.0})\"/>"
            ));
        }
    }
    svg.put(format_args!("</g>"));
    svg.elements()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns water of 48 x 32 cells with the velocity `flow` at the centre of each.
    fn water(flow: impl Fn(f64, f64) -> [f64; 3], solid: impl Fn(f64, f64) -> bool) -> Water {
        let middles = || {
            (0..32_usize).flat_map(|l| (0..48_usize).map(move |k| (real(k) + 0.5, real(l) + 0.5)))
        };
        Water {
            cells: [48, 32, 1],
            origin: [0.0; 3],
            spacing: [1.0; 3],
            values: vec![0.0; 48 * 32],
            solid: middles().map(|(x, y)| solid(x, y)).collect(),
            flow: Some(middles().map(|(x, y)| flow(x, y)).collect()),
            units: String::new(),
        }
    }

    /// Checks that the streamlines of a rigid-body rotation are circles; the interpolated field is exact there.
    #[test]
    fn lines_of_a_vortex_are_circles() {
        let vortex = water(|x, y| [16.0 - y, x - 24.0, 0.0], |_, _| false);
        let flow = vortex.flow.clone().unwrap();
        let mut at = [34.0, 16.0];
        for _ in 0..400 {
            at = step(&vortex, &flow, at, 0.5, 1e-9).unwrap();
        }
        let radius = (at[0] - 24.0_f64).hypot(at[1] - 16.0);
        assert!((radius - 10.0).abs() < 1e-4, "{radius}");
        for line in lines(&vortex) {
            let radii = line.iter().map(|p| (p[0] - 24.0).hypot(p[1] - 16.0));
            let (low, high) = radii.fold((f64::MAX, 0.0_f64), |(l, h), r| (l.min(r), h.max(r)));
            assert!(high - low < 1e-2 || high > 15.0, "{low} to {high}");
        }
    }

    #[test]
    fn lines_end_at_solids_and_leave_none_of_the_water_empty() {
        let wall = |x: f64, _: f64| x > 30.0;
        let stream = water(|_, _| [1.0, 0.0, 0.0], wall);
        let all = lines(&stream);
        assert!(all.len() > 15, "{}", all.len());
        for line in &all {
            assert!(line.iter().all(|p| p[0] < 30.0 && p[0] > 0.0));
            let rows = line.iter().map(|p| p[1]);
            let (low, high) = rows.fold((f64::MAX, 0.0_f64), |(l, h), y| (l.min(y), h.max(y)));
            assert!(high - low < 1e-9);
        }
        let picture = draw(&stream, |p| p);
        assert_eq!(picture.matches("<polyline").count(), all.len());
        assert!(lines(&water(|_, _| [0.0; 3], |_, _| false)).is_empty());
    }
}
