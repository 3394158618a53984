//! Force over compression: a monotone cubic spline through knots.
//!
//! The slopes at the knots are Fritsch and Butland's weighted harmonic means (SIAM J. Sci. Stat. Comput. 5:300, 1984): between two
//! knots the curve is monotone if the knots are, so the interpolation adds no bump that was not measured.

/// Error in a list of knots.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CurveError {
    /// Number of knots below three or above [`Curve::MOST_KNOTS`].
    Count(usize),
    /// First knot other than (0, 0).
    Start,
    /// Index (from 0) of a knot at which the compression does not grow or the force falls.
    Order(usize),
}

/// Cubic piece: force as a polynomial of the distance from its knot, with the energy stored up to the knot.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    from_m: f64,
    /// Coefficients, N, N/m, N/m², N/m³.
    force: [f64; 4],
    energy_j: f64,
}

impl Piece {
    /// Returns force, N, and energy, J, at a distance from the knot.
    fn at(&self, distance_m: f64) -> (f64, f64) {
        let [a, b, c, d] = self.force;
        let s = distance_m;
        let force_n = a + s * (b + s * (c + s * d));
        let energy_j = self.energy_j + s * (a + s * (b / 2.0 + s * (c / 3.0 + s * d / 4.0)));
        (force_n, energy_j)
    }
}

/// Monotone curve of force over compression, with its energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    pieces: Vec<Piece>,
    /// Compression of the last knot, the largest measured, m.
    pub(crate) deepest_m: f64,
    /// Force, N, slope, N/m, and energy, J, at the last knot.
    end: (f64, f64, f64),
}

impl Curve {
    /// Maximum number of knots, more than test benches give after smoothing; a lookup takes twelve steps.
    pub const MOST_KNOTS: usize = 4096;

    /// Builds a curve through knots of compression, m, and force, N, the first (0, 0). Not real-time.
    ///
    /// # Errors
    /// A [`CurveError`] for a wrong number of knots, a first knot other than (0, 0), or a wrong order.
    pub fn new(knots: &[(f64, f64)]) -> Result<Self, CurveError> {
        if knots.len() < 3 || knots.len() > Self::MOST_KNOTS {
            return Err(CurveError::Count(knots.len()));
        }
        if knots[0] != (0.0, 0.0) {
            return Err(CurveError::Start);
        }
        // Written so that NaN fails.
        let rises = |pair: &[(f64, f64)]| pair[1].0 > pair[0].0 && pair[1].1 >= pair[0].1;
        if let Some(at) = knots.windows(2).position(|pair| !rises(pair)) {
            return Err(CurveError::Order(at + 1));
        }
        let slopes = slopes(knots);
        let mut energy_j = 0.0;
        let mut pieces = Vec::with_capacity(knots.len() - 1);
        for (pair, ends) in knots.windows(2).zip(slopes.windows(2)) {
            let (width_m, rise_n) = (pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
            let chord = rise_n / width_m;
            let square = (3.0 * chord - 2.0 * ends[0] - ends[1]) / width_m;
            let cube = (ends[0] + ends[1] - 2.0 * chord) / (width_m * width_m);
            let piece = Piece { from_m: pair[0].0, force: [pair[0].1, ends[0], square, cube], energy_j };
            energy_j = piece.at(width_m).1;
            pieces.push(piece);
        }
        let (deepest_m, force_n) = knots[knots.len() - 1];
        Ok(Self { pieces, deepest_m, end: (force_n, slopes[slopes.len() - 1], energy_j) })
    }

    /// Returns the force against compression, N, and the stored energy, J: zero without compression, and beyond the last knot
    /// along the tangent there. Real-time: bounded, no allocation.
    #[must_use]
    pub fn at(&self, compression_m: f64) -> (f64, f64) {
        if compression_m <= 0.0 {
            return (0.0, 0.0);
        }
        let beyond_m = compression_m - self.deepest_m;
        if beyond_m >= 0.0 {
            let (force_n, slope, energy_j) = self.end;
            return (force_n + slope * beyond_m, energy_j + beyond_m * (force_n + 0.5 * slope * beyond_m));
        }
        let after = self.pieces.partition_point(|piece| piece.from_m <= compression_m);
        let piece = after.checked_sub(1).and_then(|index| self.pieces.get(index));
        piece.map_or((0.0, 0.0), |piece| piece.at(compression_m - piece.from_m))
    }
}

/// Returns the slope at each knot, N/m.
fn slopes(knots: &[(f64, f64)]) -> Vec<f64> {
    let widths: Vec<f64> = knots.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let chords: Vec<f64> =
        knots.windows(2).zip(&widths).map(|(pair, width)| (pair[1].1 - pair[0].1) / width).collect();
    let inner = widths.windows(2).zip(chords.windows(2)).map(|(h, d)| {
        let weights = [h[0] + 2.0 * h[1], 2.0 * h[0] + h[1]];
        if d[0] > 0.0 && d[1] > 0.0 {
            (weights[0] + weights[1]) / (weights[0] / d[0] + weights[1] / d[1])
        } else {
            0.0
        }
    });
    // At an end: a parabola through three knots, its slope limited so that the piece is monotone.
    let end = |h: [f64; 2], d: [f64; 2]| {
        (((2.0 * h[0] + h[1]) * d[0] - h[0] * d[1]) / (h[0] + h[1])).clamp(0.0, 3.0 * d[0])
    };
    let last = widths.len() - 1;
    let first_slope = end([widths[0], widths[1]], [chords[0], chords[1]]);
    let last_slope = end([widths[last], widths[last - 1]], [chords[last], chords[last - 1]]);
    std::iter::once(first_slope).chain(inner).chain(std::iter::once(last_slope)).collect()
}
