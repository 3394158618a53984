//! Detection of lines that cover one another. A covered line is drawn wider and paler, so that it is visible on both sides of the
//! covering lines.

use super::decimate::Point;
use super::projection::Rect;

/// Distance up to which two lines look like one line.
const ONE_LINE_PX: f64 = 1.2;

/// Smallest fraction of a line's pixel columns that another line has to overlap to cover it.
const COVERING_SHARE: f64 = 0.5;

/// Number of distinct widths of covered lines; a line under more lines has the largest width.
pub(super) const MAX_COVERS: usize = 3;

/// Lowest and highest point of a line in each pixel column of its panel.
#[derive(Debug, Default)]
pub(super) struct Course {
    columns: Vec<Option<(f64, f64)>>,
}

impl Course {
    /// Computes the course of unbroken runs of points, in pixels, within `frame`.
    pub(super) fn of(runs: &[Vec<Point>], frame: &Rect) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most 8000 columns
        let count = frame.width.ceil().max(1.0) as usize;
        let mut course = Self { columns: vec![None; count] };
        for pair in runs.iter().flat_map(|run| run.windows(2)) {
            if let [from, to] = pair {
                course.add([*from, *to].map(|(x, y)| (x - frame.left, y)));
            }
        }
        course
    }

    /// Adds the columns that a straight line crosses.
    fn add(&mut self, [from, to]: [Point; 2]) {
        let (left, right) = if from.0 <= to.0 { (from, to) } else { (to, from) };
        let slope = if right.0 > left.0 { (right.1 - left.1) / (right.0 - left.0) } else { 0.0 };
        let last = self.columns.len().saturating_sub(1);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // within the frame
        let [first, end] = [left.0, right.0].map(|x| (x.max(0.0) as usize).min(last));
        for (column, reached) in self.columns.iter_mut().enumerate().take(end + 1).skip(first) {
            let at = |x: f64| left.1 + slope * (x.clamp(left.0, right.0) - left.0);
            let mut heights = [at(column as f64), at(column as f64 + 1.0)];
            if slope == 0.0 {
                heights = [left.1, right.1];
            }
            let [low, high] = [heights[0].min(heights[1]), heights[0].max(heights[1])];
            *reached = Some(reached.map_or((low, high), |(least, most)| (least.min(low), most.max(high))));
        }
    }

    /// Returns true if `upper` covers this line.
    pub(super) fn is_under(&self, upper: &Self) -> bool {
        let drawn = self.columns.iter().flatten().count();
        let shared = self.columns.iter().zip(&upper.columns).filter(|(lower, upper)| {
            lower.zip(**upper).is_some_and(|(lower, upper)| {
                (lower.0 - upper.0).abs() <= ONE_LINE_PX && (lower.1 - upper.1).abs() <= ONE_LINE_PX
            })
        });
        drawn > 0 && shared.count() as f64 >= COVERING_SHARE * drawn as f64
    }
}

/// Returns for each line, in the order of drawing, the number of later lines that cover it, at most 3. A line is a list of unbroken
/// runs of points, pixels; `[left, right]` are the edges of the frame, pixels.
#[must_use]
pub fn covering_lines(lines: &[Vec<Vec<(f64, f64)>>], [left, right]: [f64; 2]) -> Vec<usize> {
    let frame = Rect { left, top: 0.0, width: right - left, height: 0.0 };
    let courses: Vec<Course> = lines.iter().map(|runs| Course::of(runs, &frame)).collect();
    let covers = |(lower, course): (usize, &Course)| {
        courses.iter().skip(lower + 1).filter(|upper| course.is_under(upper)).count().min(MAX_COVERS)
    };
    courses.iter().enumerate().map(covers).collect()
}

/// Returns stroke width, as a multiple of the normal width, and opacity, 0 to 1, of a line that `covers` other lines cover.
#[must_use]
pub const fn covered_style(covers: usize) -> (f64, f64) {
    /// Visible width of a covered line on both sides together, per covering line, as a multiple of the normal width.
    const BESIDE: f64 = 2.125;
    if covers == 0 { (1.0, 1.0) } else { (1.0 + BESIDE * covers as f64, 0.45) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Rect = Rect { left: 80.0, top: 0.0, width: 800.0, height: 100.0 };

    fn course(points: &[Point]) -> Course {
        Course::of(&[points.to_vec()], &FRAME)
    }

    #[test]
    fn the_same_line_is_covered_however_its_samples_lie() {
        let coarse = course(&[(80.0, 10.0), (880.0, 90.0)]);
        let fine: Vec<Point> =
            (0..=1600).map(|i| (80.0 + 0.5 * f64::from(i), 10.0 + 0.05 * f64::from(i))).collect();
        let fine = course(&fine);
        assert!(coarse.is_under(&fine) && fine.is_under(&coarse));
    }

    #[test]
    fn of_three_lines_over_one_another_the_lowest_is_the_widest() {
        let line = |y: f64| vec![vec![(80.0, y), (880.0, y + 50.0)]];
        let covers = covering_lines(&[line(10.0), line(10.0), line(30.0), line(10.0)], [80.0, 880.0]);
        assert_eq!(covers, [2, 1, 0, 0]);
        let [lowest, upper, alone] = [2, 1, 0].map(|covers| covered_style(covers).0);
        assert!(lowest > upper && upper > alone && alone == 1.0);
    }

    #[test]
    fn lines_that_cross_or_run_side_by_side_are_not_covered() {
        let rising = course(&[(80.0, 0.0), (880.0, 100.0)]);
        let falling = course(&[(80.0, 100.0), (880.0, 0.0)]);
        let beside = course(&[(80.0, 3.0), (880.0, 103.0)]);
        assert!(!rising.is_under(&falling) && !rising.is_under(&beside));
        assert!(!course(&[]).is_under(&course(&[])), "nothing covers nothing");
        let upright = course(&[(100.0, 0.0), (100.0, 100.0)]);
        assert!(!rising.is_under(&upright));
    }
}
