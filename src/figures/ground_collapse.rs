//! The figures of a run: the collapse against time with its stages, and the long section of the settlement.

use super::plot::{CATEGORY, Figure, Layer, Legend, Panel, PlotAxis, PlotShape, sequential};
use analysis::ground_collapse::record::{CollapseRecord, StageTimes, SurfaceRecord};
use std::collections::BTreeMap;

/// Maximum number of times in the long section: more lines cannot be distinguished.
const SECTIONS: usize = 7;

/// Returns the void volume, settlement, extension and eroded fraction against time, with the stages as dashed lines:
/// `collapse.svg`.
#[must_use]
pub fn collapse(rows: &[CollapseRecord], stages: &StageTimes) -> Figure {
    type Series<'a> = (&'a str, fn(&CollapseRecord) -> f64);
    let panel = |title: &str, quantity: &str, unit: &str, series: &[Series<'_>]| {
        let mut layers = Vec::new();
        let mut top: f64 = 0.0;
        for ((label, value), colour) in series.iter().zip(CATEGORY) {
            let points: Vec<(f64, f64)> = rows.iter().map(|row| (row.time, value(row))).collect();
            top = points
                .iter()
                .map(|point| point.1)
                .filter(|y| y.is_finite())
                .fold(top, f64::max);
            let shape = PlotShape::Line {
                points,
                dashed: false,
            };
            layers.push(Layer::new(shape, colour, label));
        }
        let times = [
            stages.hidden_hole,
            stages.arch,
            stages.sinkhole,
            stages.extension,
        ];
        for (n, time) in times.into_iter().enumerate() {
            let Some(time) = time else { continue };
            let shape = PlotShape::Line {
                points: vec![(time, 0.0), (time, if top > 0.0 { top } else { 1.0 })],
                dashed: true,
            };
            layers.push(Layer::new(
                shape,
                &sequential(n, 4),
                &format!("t_{{{}}}", n + 1),
            ));
        }
        Panel {
            title: title.to_owned(),
            x: PlotAxis::linear("time", "s"),
            y: PlotAxis::linear(quantity, unit),
            layers,
            legend: Legend::Right,
            legend_title: String::new(),
        }
    };
    Figure {
        panels: vec![
            panel(
                "Voids over the seepage points",
                "void volume",
                "m^{3}",
                &[("voids", |row| row.void_volume)],
            ),
            panel(
                "Surface",
                "length",
                "m",
                &[
                    ("largest settlement", |row| row.settlement_max),
                    ("in the middle", |row| row.settlement_middle),
                    ("percentile", |row| row.settlement_percentile),
                    ("extension", |row| row.extension),
                ],
            ),
            panel(
                "Ground",
                "part",
                "",
                &[
                    ("eroded mass", |row| row.eroded_fraction),
                    ("moving cover", |row| row.front),
                ],
            ),
        ],
    }
}

/// Returns the figure of the settlement of the surface along the long axis, as the mean over the columns along the
/// transverse axis, at several times: `settlement.svg`. The axis points down, so that two sinkholes with a higher
/// middle form a W.
#[must_use]
pub fn settlement(rows: &[SurfaceRecord]) -> Figure {
    // For each step: its time, and for each column along the axis its position, the sum of settlements and the
    // number of columns along the transverse axis.
    type Section = (f64, BTreeMap<u64, (f64, f64, f64)>);
    let mut sections: BTreeMap<u64, Section> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.settlement.is_finite()) {
        let (_, section) = sections
            .entry(row.step)
            .or_insert_with(|| (row.time, BTreeMap::new()));
        let (place, sum, n) = section.entry(row.ix).or_insert((row.long, 0.0, 0.0));
        *place = row.long;
        *sum -= row.settlement;
        *n += 1.0;
    }
    let all: Vec<Section> = sections.into_values().collect();
    let last = all.len().saturating_sub(1);
    let shown = SECTIONS.min(all.len());
    let layers = (0..shown)
        .filter_map(|n| {
            let (time, section) = all.get(n * last / (shown - 1).max(1))?;
            let points = section.values().map(|&(place, sum, n)| (place, sum / n));
            let shape = PlotShape::Line {
                points: points.collect(),
                dashed: false,
            };
            Some(Layer::new(
                shape,
                &sequential(n, shown),
                &format!("{time:.4}"),
            ))
        })
        .collect();
    Figure {
        panels: vec![Panel {
            title: "Long section of the surface".to_owned(),
            x: PlotAxis::linear("along", "m"),
            y: PlotAxis::linear("change of elevation", "m"),
            layers,
            legend: Legend::Right,
            legend_title: "time [s]".to_owned(),
        }],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_section_is_the_mean_across_with_down_down() {
        let row = |step, ix, iy, settlement| SurfaceRecord {
            step,
            time: f64::from(u32::try_from(step).unwrap()),
            ix,
            iy,
            long: f64::from(u32::try_from(ix).unwrap()) + 0.5,
            across: 0.0,
            elevation: 1.0,
            settlement,
        };
        let rows = [
            row(0, 0, 0, 0.0),
            row(0, 1, 0, 0.0),
            row(5, 0, 0, 0.2),
            row(5, 0, 1, 0.4),
            row(5, 1, 0, f64::NAN),
            row(5, 1, 1, 0.1),
        ];
        let figure = settlement(&rows);
        let layers = &figure.panels[0].layers;
        assert_eq!(layers.len(), 2);
        let PlotShape::Line { points, .. } = &layers[1].shape else {
            panic!("no line");
        };
        assert!((points[0].1 + 0.3).abs() < 1e-15 && (points[1].1 + 0.1).abs() < 1e-15);
        assert!(settlement(&[]).to_svg().contains("</svg>"));
    }

    #[test]
    fn stages_are_marked_where_they_began() {
        let stages = StageTimes {
            sinkhole: Some(0.5),
            ..StageTimes::default()
        };
        let svg = collapse(&[], &stages).to_svg();
        assert_eq!(
            svg.matches("stroke-dasharray").count(),
            2 * 3,
            "line and legend of three panels"
        );
    }
}
