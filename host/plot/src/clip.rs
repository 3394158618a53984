//! Clipping of lines at the edges of the plotting area.

use super::decimate::Point;
use super::projection::Rect;

/// Returns the parts of a line within `frame`, in order. A line entirely within `frame` is returned as one part, with unchanged points.
pub(super) fn clipped(line: &[Point], frame: &Rect) -> Vec<Vec<Point>> {
    if let [only] = line {
        return if frame.contains(*only) { vec![vec![*only]] } else { Vec::new() };
    }
    let mut parts: Vec<Vec<Point>> = Vec::new();
    let mut reached = None;
    for (from, to) in line.iter().zip(line.iter().skip(1)) {
        let Some((start, end)) = segment_within(*from, *to, frame) else { continue };
        match parts.last_mut() {
            Some(part) if reached == Some(start) => part.push(end),
            _ => parts.push(vec![start, end]),
        }
        // A segment that leaves the frame ends the current part.
        reached = (end == *to).then_some(end);
    }
    parts
}

/// Clips a segment to `frame` (Liang and Barsky, "A New Concept and Method for Line Clipping", ACM Transactions on Graphics 3(1),
/// 1984); ends within the frame are returned unchanged, bit for bit. Returns `None` if at most one point of the segment is within
/// the frame, unless the segment is a single point.
fn segment_within(from: Point, to: Point, frame: &Rect) -> Option<(Point, Point)> {
    let step = (to.0 - from.0, to.1 - from.1);
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    let edges = [
        (-step.0, from.0 - frame.left),
        (step.0, frame.right() - from.0),
        (-step.1, from.1 - frame.top),
        (step.1, frame.bottom() - from.1),
    ];
    for (towards, room) in edges {
        if towards < 0.0 {
            enters = enters.max(room / towards);
        } else if towards > 0.0 {
            leaves = leaves.min(room / towards);
        } else if room < 0.0 {
            return None;
        }
    }
    let at = |share: f64| frame.nearest((from.0 + share * step.0, from.1 + share * step.1));
    let start = if enters > 0.0 { at(enters) } else { from };
    let end = if leaves < 1.0 { at(leaves) } else { to };
    (enters < leaves).then_some((start, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Rect = Rect { left: 10.0, top: 20.0, width: 100.0, height: 50.0 };

    #[test]
    fn a_line_within_the_frame_keeps_its_points() {
        let line = vec![(10.0, 20.0), (11.0, 70.0), (11.0, 70.0), (110.0, 33.3), (60.0, 20.0)];
        assert_eq!(clipped(&line, &FRAME), [line]);
    }

    #[test]
    fn a_line_that_leaves_and_returns_is_cut_at_the_edges() {
        // Up through the top at x = 35, back at x = 65, out at the right, and past without touching.
        let line = [
            (10.0, 70.0),
            (40.0, 10.0),
            (60.0, 10.0),
            (70.0, 30.0),
            (120.0, 30.0),
            (120.0, 90.0),
            (0.0, 90.0),
        ];
        let expected = [vec![(10.0, 70.0), (35.0, 20.0)], vec![(65.0, 20.0), (70.0, 30.0), (110.0, 30.0)]];
        assert_eq!(clipped(&line, &FRAME), expected);
    }

    #[test]
    fn a_segment_across_the_frame_is_cut_at_both_ends() {
        assert_eq!(clipped(&[(0.0, 45.0), (500.0, 45.0)], &FRAME), [vec![(10.0, 45.0), (110.0, 45.0)]]);
        assert_eq!(clipped(&[(60.0, -30.0), (60.0, 98.0)], &FRAME), [vec![(60.0, 20.0), (60.0, 70.0)]]);
        assert!(clipped(&[(0.0, 30.0), (20.0, 0.0)], &FRAME).is_empty(), "past the corner");
        assert!(clipped(&[(5.0, 5.0)], &FRAME).is_empty());
        assert_eq!(clipped(&[(50.0, 50.0)], &FRAME), [vec![(50.0, 50.0)]]);
    }
}
