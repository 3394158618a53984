//! Overview picture of a sweep: results over the first numeric axis, a line for each value of another axis.

use crate::design::Cell;
use crate::plan::Plan;
use crate::table::number;
use crate::task::{Column, ColumnKind};
use flotor_plot::{Axis, Figure, Panel, Series};

/// Limit on the lines of a panel: more lines cannot be distinguished.
const MOST_LINES: usize = 6;

/// Draws the numeric results in `wanted` (all if empty), at most four, of a finished sweep as SVG.
#[must_use]
pub fn draw(plan: &Plan, columns: &[Column], rows: &[Vec<Cell>], wanted: &[String]) -> String {
    let answers = plan.axes.len() + 1;
    let is_wanted = |column: &Column| match wanted {
        [] => true,
        names => names.contains(&column.name),
    };
    let numeric = columns.iter().enumerate().skip(answers);
    let drawn = numeric.filter(|(_, column)| column.kind == ColumnKind::Number && is_wanted(column)).take(4);
    let across =
        plan.axes.iter().zip(columns).position(|(_, column)| column.kind == ColumnKind::Number).unwrap_or(0);
    let name = |at: usize| columns.get(at).map(|column| column.name.clone()).unwrap_or_default();
    // The slowest other axis distinguishes the lines.
    let lines = (0..plan.axes.len()).find(|axis| *axis != across);
    let mut figure = Figure::new(&plan.title, Axis::linear(name(across), ""));
    figure =
        figure.subtitle(format!("{} rows, {} seeds", rows.len(), plan.seeds.len())).panel_height_px(180.0);
    for (index, column) in drawn {
        let mut panel = Panel::new(Axis::linear(column.name.clone(), ""));
        for (label, points) in grouped(rows, across, lines, index) {
            panel = panel.series(Series::line(label, points));
        }
        figure = figure.panel(panel);
    }
    figure.to_svg()
}

type Line = (String, Vec<(f64, f64)>);

/// Returns the means over all other axes at each position, a line for each value of the axis `lines`.
fn grouped(rows: &[Vec<Cell>], across: usize, lines: Option<usize>, answer: usize) -> Vec<Line> {
    let mut labels: Vec<String> = Vec::new();
    let mut groups: Vec<Vec<(f64, f64)>> = Vec::new();
    for row in rows {
        let label = lines.and_then(|axis| row.get(axis)).map(Cell::text).unwrap_or_default();
        let known = labels.iter().position(|known| *known == label);
        let at = known.unwrap_or_else(|| {
            labels.push(label);
            groups.push(Vec::new());
            labels.len() - 1
        });
        if let Some(group) = groups.get_mut(at) {
            group.push((number(row.get(across)), number(row.get(answer))));
        }
    }
    let thinned = labels.len().div_ceil(MOST_LINES).max(1);
    labels.into_iter().zip(groups).step_by(thinned).map(|(label, points)| (label, means(points))).collect()
}

/// Averages the points with the same x.
fn means(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    points.retain(|(x, _)| x.is_finite());
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points
        .chunk_by(|a, b| a.0 == b.0)
        .filter_map(|same| {
            let answered: Vec<f64> = same.iter().map(|(_, y)| *y).filter(|y| y.is_finite()).collect();
            let mean = answered.iter().sum::<f64>() / answered.len() as f64;
            same.first().map(|(x, _)| (*x, mean))
        })
        .collect()
}
