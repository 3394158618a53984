//! SVG path data in a compact form.
//!
//! Coordinates are whole tenths of a pixel. Each step is written relative to the last *rounded* point, so
//! rounding errors do not add up along a line, and a step takes about six characters.

use super::decimate::Point;
use super::text;

/// Half the width of the end of an error bar.
const ERROR_CAP_PX: f64 = 5.0;

/// Path data under construction.
#[derive(Debug, Default)]
pub(super) struct Path {
    pub(super) data: String,
    at: (f64, f64),
    /// Start and length of a horizontal step at the end of the data, which a following step in the same direction extends.
    level: Option<(usize, f64)>,
}

impl Path {
    pub(super) fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    fn move_to(&mut self, x: f64, y: f64) {
        self.at = (tenths(x), tenths(y));
        self.level = None;
        self.data.push('M');
        self.push_pair(self.at);
    }

    fn line_to(&mut self, x: f64, y: f64) {
        let to = (tenths(x), tenths(y));
        let step = (to.0 - self.at.0, to.1 - self.at.1);
        self.at = to;
        let level = if step == (0.0, 0.0) { self.level } else { self.level.take() };
        match step {
            (0.0, 0.0) => {}
            (dx, 0.0) => {
                let before = level.filter(|(_, before)| before.is_sign_positive() == dx.is_sign_positive());
                let (start, before) = before.unwrap_or((self.data.len(), 0.0));
                self.data.truncate(start);
                self.data.push('h');
                text::push_tenths(&mut self.data, before + dx);
                self.level = Some((start, before + dx));
            }
            (0.0, dy) => {
                self.data.push('v');
                text::push_tenths(&mut self.data, dy);
            }
            _ => {
                self.data.push('l');
                self.push_pair(step);
            }
        }
    }

    fn push_pair(&mut self, (first, second): (f64, f64)) {
        text::push_tenths(&mut self.data, first);
        if second >= 0.0 {
            self.data.push(' ');
        }
        text::push_tenths(&mut self.data, second);
    }

    pub(super) fn close(&mut self) {
        self.level = None;
        self.data.push('z');
    }

    /// Adds an open line through the points; a single point becomes a dot of the line's width (with round caps).
    pub(super) fn polyline(&mut self, points: impl IntoIterator<Item = Point>) {
        let mut points = points.into_iter();
        let Some((x, y)) = points.next() else { return };
        self.move_to(x, y);
        let drawn = self.data.len();
        for (x, y) in points {
            self.line_to(x, y);
        }
        if self.data.len() == drawn {
            self.level = None;
            self.data.push_str("h0");
        }
    }

    /// Adds a closed outline through points given as offsets from (x, y).
    pub(super) fn polygon(&mut self, x: f64, y: f64, offsets: &[Point]) {
        self.outline(offsets.iter().map(|&(dx, dy)| (x + dx, y + dy)));
    }

    /// Adds a closed outline through points.
    pub(super) fn outline(&mut self, points: impl IntoIterator<Item = Point>) {
        self.polyline(points);
        self.close();
    }

    pub(super) fn circle(&mut self, x: f64, y: f64, radius: f64) {
        self.arcs(x, y, radius, 1);
    }

    /// Adds a circle with a hole: the inner outline has the opposite direction, so that it is not filled.
    pub(super) fn ring(&mut self, x: f64, y: f64, outer: f64, inner: f64) {
        self.arcs(x, y, outer, 1);
        self.arcs(x, y, inner, 0);
    }

    /// Adds the cap at an end of an error bar.
    pub(super) fn error_cap(&mut self, x: f64, y: f64) {
        self.polyline([(x - ERROR_CAP_PX, y), (x + ERROR_CAP_PX, y)]);
    }

    fn arcs(&mut self, x: f64, y: f64, radius: f64, sweep: u8) {
        self.move_to(x - radius, y);
        let (r, d) = (text::px(radius), text::px(2.0 * radius));
        self.data.push_str(&format!("a{r} {r} 0 1 {sweep} {d} 0a{r} {r} 0 1 {sweep}-{d} 0z"));
    }
}

fn tenths(px: f64) -> f64 {
    // Adding zero turns -0 into 0.
    (px * 10.0).round() + 0.0
}
