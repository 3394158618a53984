//! Weight of the exact rod in the default law, a smooth function of the pose.
//!
//! The error in the force of [`crate::energy`] with its [`crate::remainder`], relative to `alpha/L0²`, is bounded by a
//! sum in the variables of [`crate::directions`], with `s = S²`, `b = m² D²`, `w = 2 - 2 cos(twist)` and the relative
//! length `l` of the chord,
//!
//! ```text
//! (1 + (load/22)⁴) (c0 x²/(x² + 0.01) + c1 w² + c2 b⁴ + c3 m⁸ s⁴ + c4 s¹² + c5 (s/l²)⁴)
//! x = s + 10 b + 10 w        load = gamma L0²/(4 alpha)
//! ```
//!
//! The first term is a plateau, the error of the fit of the remainder; the others rise steeply where the fit ends: far twist, bow
//! and sway near buckling, far sway, and a chord far below the free length. The coefficients come from a linear program and a
//! search: over 60 000 poses of the presets in the device's workspace, and 40 000 of the presets and of 600 springs of random
//! proportions turned by up to 30 degrees, the bound is at least the error, small in the device's workspace, and so steep that
//! the force of the blending, which follows the slope of the weight, stays within the tolerance. The weight rises from 0 at a
//! bound of eight tenths of the tolerance to 1 at six tolerances; likewise as `G0` of [`flotor_lanes::entire`] falls from 1 at
//! rest to 0 at buckling, because past buckling only the rod has a bulge.
//!
//! Where any two of chord and normals are more than 66 degrees apart, or the plate is twisted as much, the weight falls
//! again, to zero at 78 degrees: a rod whose plates stand beside one another, or past one another, has several shapes,
//! and none that a coil could take.

use crate::directions::{
    BUCKLING_ARGUMENT, DEEP_ARGUMENT, Directions, Gradient, Load, Passage, Slopes, upper_normal,
};
use crate::pose::Pose;
use crate::remainder::ONSET;
use crate::rigidity::Spring;
use flotor_lanes::entire::EntireFunctions;

/// Error bounds, in tolerances, at which the rod's weight leaves 0 and reaches 1. In between the weight is a function
/// of the fourth root of the bound, close to its logarithm: the bound grows steeply, and a weight linear in the bound
/// would rise over too short a distance of the handle.
const FIRST_ERROR: f64 = 0.8;
const LAST_ERROR: f64 = 6.0;

/// `G0` below which the rod's weight rises, and below which it is 1; and the argument of the former, rounded down.
const FIRST: f64 = 0.26;
const LAST: f64 = 0.17;
const FIRST_ARGUMENT: f64 = 6.006;

/// Middle of the workspace, where the law `energy` alone is sufficient: largest argument, shortest relative chord, and,
/// for the default tolerance, largest `D²` and `w`, 7 degrees each.
const MIDDLE_ARGUMENT: f64 = 4.0;
const MIDDLE_MAGNIFICATION: f64 = 1.0 + BUCKLING_ARGUMENT / (BUCKLING_ARGUMENT - MIDDLE_ARGUMENT);
const MIDDLE_LENGTH: f64 = 0.6;
const MIDDLE_TILT: f64 = 0.0037;
const MIDDLE_TWIST: f64 = 0.015;
/// Bisection steps of the search for the middle, which runs inside a tick: the result is the lower end, so a coarse one only costs a check
/// at few poses.
const MIDDLE_HALVINGS: u32 = 12;

/// Weight of the rod at a pose, with its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Share {
    pub(crate) value: f64,
    pub(crate) gradient: Gradient,
    /// True if a straight rod of the chord's length has buckled.
    pub(crate) is_buckled: bool,
}

/// Law that is blended with the rod: [`crate::energy`] with its [`crate::remainder`] (`Corrected`) or without (`Plain`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    Corrected,
    Plain,
}

/// Measures of a pose that determine the error of a law.
#[derive(Clone, Copy, Debug)]
struct Measures {
    /// `S²`
    sway: f64,
    /// `m² D²`
    bow: f64,
    /// `2 - 2 cos(twist)`
    twist: f64,
    /// Relative length of the chord.
    length: f64,
    /// `m`
    magnification: f64,
}

/// Derivatives of a bound with respect to [`Measures`].
#[derive(Clone, Copy, Debug)]
struct BoundSlopes {
    by_sway: f64,
    by_bow: f64,
    by_twist: f64,
    by_length: f64,
    by_magnification: f64,
}

impl Measures {
    fn of(at: &Directions, free_length_m: f64) -> Self {
        let m = at.magnification;
        Self {
            sway: at.sway.length_squared(),
            bow: m * m * at.bow.length_squared(),
            twist: at.twist_square(),
            length: at.length_m / free_length_m,
            magnification: m,
        }
    }

    /// Returns `x`.
    fn deviation(&self) -> f64 {
        self.sway + DEVIATION_WEIGHT * (self.bow + self.twist)
    }
}

/// Coefficients of the module documentation, in its sequence.
const PLATEAU: f64 = 5.8e-3;
const TWISTED: f64 = 7.0;
const BOWED: f64 = 2100.0;
const SWAYED_NEAR_BUCKLING: f64 = 8.9e-6;
const SWAYED: f64 = 0.2;
const SHORT: f64 = 6.0e-5;
/// Coefficients of the bound without the remainder, `(1 + (load/(4 pi²))²) (c6 (s + b)² + c7 w (s + b + 0.1))`.
const PLAIN_BENT: f64 = 4.5;
const PLAIN_TWISTED: f64 = 4.2;
/// `x²` at which the plateau has half of its height, and the weight of bow and twist in `x`.
const PLATEAU_SQUARE: f64 = 0.01;
const DEVIATION_WEIGHT: f64 = 10.0;
/// Load at which the error is twice that of a stout spring.
const SLENDER_LOAD: f64 = 22.0;

impl Law {
    /// Returns the factor of the bound for a spring of this load, relative to `alpha/L0²`.
    fn slenderness(self, load: f64) -> f64 {
        let part = match self {
            Self::Corrected => (load / SLENDER_LOAD) * (load / SLENDER_LOAD),
            // The sway of a slender rod reduces its length, and so its load.
            Self::Plain => load / (4.0 * BUCKLING_ARGUMENT),
        };
        1.0 + part * part
    }

    /// Returns the bound of the error of a stout spring.
    fn bound(self, at: &Measures) -> f64 {
        let Measures { sway: s, bow: b, twist: w, length, magnification: m } = *at;
        match self {
            Self::Corrected => {
                let x = at.deviation();
                let (s2, b2, m2) = (s * s, b * b, m * m);
                let (s6, m4) = (s2 * s2 * s2, m2 * m2);
                let shortened = s / (length * length);
                let shortened2 = shortened * shortened;
                PLATEAU * (x * x) / (x * x + PLATEAU_SQUARE)
                    + TWISTED * (w * w)
                    + BOWED * (b2 * b2)
                    + SWAYED_NEAR_BUCKLING * (s2 * s2) * (m4 * m4)
                    + SWAYED * (s6 * s6)
                    + SHORT * (shortened2 * shortened2)
            }
            Self::Plain => {
                let sum = s + b;
                PLAIN_BENT * (sum * sum) + PLAIN_TWISTED * w * (sum + 0.1)
            }
        }
    }

    /// Returns the derivatives of [`Self::bound`].
    fn slopes(self, at: &Measures) -> BoundSlopes {
        let Measures { sway: s, bow: b, twist: w, length, magnification: m } = *at;
        match self {
            Self::Corrected => {
                let x = at.deviation();
                let below = x * x + PLATEAU_SQUARE;
                let by_deviation = 2.0 * PLATEAU * PLATEAU_SQUARE * x / (below * below);
                let (s2, m2) = (s * s, m * m);
                let m7 = m2 * m2 * m2 * m;
                let s3 = s2 * s;
                let shortened = s / (length * length);
                let by_shortened = 4.0 * SHORT * shortened * shortened * shortened;
                BoundSlopes {
                    by_sway: by_deviation
                        + 4.0 * SWAYED_NEAR_BUCKLING * s3 * (m7 * m)
                        + 12.0 * SWAYED * (s3 * s3 * s3 * s2)
                        + by_shortened / (length * length),
                    by_bow: DEVIATION_WEIGHT * by_deviation + 4.0 * BOWED * (b * b * b),
                    by_twist: DEVIATION_WEIGHT * by_deviation + 2.0 * TWISTED * w,
                    by_length: -2.0 * by_shortened * shortened / length,
                    by_magnification: 8.0 * SWAYED_NEAR_BUCKLING * (s2 * s2) * m7,
                }
            }
            Self::Plain => {
                let sum = s + b;
                let by_sum = 2.0 * PLAIN_BENT * sum + PLAIN_TWISTED * w;
                BoundSlopes {
                    by_sway: by_sum,
                    by_bow: by_sum,
                    by_twist: PLAIN_TWISTED * (sum + 0.1),
                    by_length: 0.0,
                    by_magnification: 0.0,
                }
            }
        }
    }
}

/// Weight function of the rod for one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RodWeight {
    free_length_m: f64,
    load: Load,
    /// True if the straight rod buckles at any length.
    pub(crate) has_buckling: bool,
    law: Law,
    /// Factor from the bound of a stout spring to that of this spring in tolerances.
    per_tolerance: f64,
    middle: Middle,
}

/// Largest measures in the middle of the workspace.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Middle {
    /// `S²`
    sway: f64,
    /// `D²`
    tilt: f64,
    /// `w`
    twist: f64,
}

impl RodWeight {
    /// Prepares the weight function for a tolerance of the force.
    pub(crate) fn new(spring: &Spring, tolerance_n: f64, law: Law) -> Self {
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let load = Load::new(rigidities);
        // z = total p (1 - excess p) with the compression p = 1 - L/L0, at most 1.
        let (total, excess) = (load.unit_per_m2 * free_length_m * free_length_m, 1.0 - load.ratio);
        let crest = if excess > 0.5 { 0.5 / excess } else { 1.0 };
        let has_buckling = total * crest * (1.0 - excess * crest) > BUCKLING_ARGUMENT;
        let unit = rigidities.alpha_n_m2 / (free_length_m * free_length_m);
        let per_tolerance = law.slenderness(total) * unit / tolerance_n;
        let middle = Middle::new(law, per_tolerance);
        Self { free_length_m, load, has_buckling, law, per_tolerance, middle }
    }

    /// Returns the directions of a pose outside the middle of the workspace; `None` in the middle, where the law
    /// `energy` is sufficient, and where no rod has a shape. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn examine(&self, pose: &Pose) -> Option<Directions> {
        let chord = pose.chord(self.free_length_m).ok()?;
        let (argument, q) = (self.load.argument(&chord), pose.orientation);
        if argument <= MIDDLE_ARGUMENT && chord.length_m >= MIDDLE_LENGTH * self.free_length_m {
            // With scalars alone, because most ticks need no more: |D|² = (1 - k.t)/2 and |S|² = 2 - k.e - t.e - |D|², to rounding.
            let tilt = q.x * q.x + q.y * q.y;
            let sway = 2.0 - (chord.vector_m.z + chord.vector_m.dot(upper_normal(q))) / chord.length_m - tilt;
            // 2 - 2 cos(twist) = 4 z²/(z² + w²)
            let axial = q.z * q.z;
            let middle = &self.middle;
            if sway <= middle.sway && tilt <= middle.tilt && 4.0 * axial <= middle.twist * (axial + q.w * q.w)
            {
                return None;
            }
        }
        Some(Directions::new(&self.load, &chord, q)).filter(Directions::is_upright)
    }

    /// Returns the weight at a pose. Real-time: bounded, no allocation.
    pub(crate) fn share(&self, at: &Directions, upright: (f64, Gradient)) -> Share {
        let measures = Measures::of(at, self.free_length_m);
        let bound = self.law.bound(&measures) * self.per_tolerance;
        let is_buckled = at.argument >= BUCKLING_ARGUMENT;
        if bound <= FIRST_ERROR && at.argument <= FIRST_ARGUMENT {
            return Share { value: 0.0, gradient: Gradient::ZERO, is_buckled };
        }
        let by_error = by_error(bound);
        let by_argument = nearness(at.argument);
        // 1 minus the product of the weights of the law from the error and from the argument.
        let left = [1.0 - by_error.value, 1.0 - by_argument.value];
        let wanted = 1.0 - left[0] * left[1];
        let m = at.magnification;
        let slopes = self.law.slopes(&measures);
        let by_bound = by_error.slope * left[1] * self.per_tolerance;
        let by_magnification = slopes.by_magnification + 2.0 * slopes.by_bow * m * at.bow.length_squared();
        let slopes = Slopes {
            by_sway: at.sway * (2.0 * by_bound * slopes.by_sway),
            by_bow: at.bow * (2.0 * by_bound * slopes.by_bow * (m * m)),
            by_twist: 2.0 * by_bound * slopes.by_twist * at.twist[1],
            by_magnification: by_bound * by_magnification,
            by_argument: by_argument.slope * left[0],
            by_length_per_m: by_bound * slopes.by_length / self.free_length_m,
        };
        let (factor, fall) = upright;
        Share {
            value: wanted * factor,
            gradient: at.gradient(&slopes).combined(factor, fall, wanted),
            is_buckled,
        }
    }
}

impl Middle {
    /// Returns the largest region that needs neither remainder nor rod: bounds grow with each measure, so its corner
    /// decides.
    fn new(law: Law, per_tolerance: f64) -> Self {
        let scaled = |factor: f64| Self {
            sway: factor * ONSET,
            tilt: factor * MIDDLE_TILT,
            twist: factor * MIDDLE_TWIST,
        };
        let has_no_share = |factor: f64| {
            let Self { sway, tilt, twist } = scaled(factor);
            let corner = Measures {
                sway,
                bow: MIDDLE_MAGNIFICATION * MIDDLE_MAGNIFICATION * tilt,
                twist,
                length: MIDDLE_LENGTH,
                magnification: MIDDLE_MAGNIFICATION,
            };
            law.bound(&corner) * per_tolerance <= FIRST_ERROR
        };
        if has_no_share(1.0) {
            return scaled(1.0);
        }
        let (mut middle, mut beyond) = (0.0, 1.0);
        for _ in 0..MIDDLE_HALVINGS {
            let between = 0.5 * (middle + beyond);
            if has_no_share(between) {
                middle = between;
            } else {
                beyond = between;
            }
        }
        scaled(middle)
    }
}

/// Returns the weight by the error alone, with its derivative with respect to the bound in tolerances.
fn by_error(bound: f64) -> Passage {
    if bound <= FIRST_ERROR {
        return Passage::NOT_BEGUN;
    }
    let root = bound.sqrt().sqrt();
    let Passage { value, slope } = Passage::at(root, FIRST_ERROR.sqrt().sqrt(), LAST_ERROR.sqrt().sqrt());
    Passage { value, slope: slope * root / (4.0 * bound) }
}

/// Returns the weight by the argument alone, with its derivative with respect to the argument.
fn nearness(argument: f64) -> Passage {
    if argument <= FIRST_ARGUMENT {
        return Passage::NOT_BEGUN;
    }
    if argument >= DEEP_ARGUMENT {
        return Passage::DONE;
    }
    let EntireFunctions { g0, g1, .. } = EntireFunctions::at(argument);
    let Passage { value, slope } = Passage::at(g0, FIRST, LAST);
    // dG0/dz = -G1/6
    Passage { value, slope: -slope * g1 / 6.0 }
}
