//! Where the law `energy` is not good enough: the share of the exact rod, a smooth function of the pose.
//!
//! The law `energy` is right to fourth order in the angles of bending and to second in the twist. What it leaves out of the
//! energy, relative to `alpha/L0`, grows as
//!
//! ```text
//! a (w² + c a²),     a = S² + m² D²,     c = 1 + (load/pi²)²/16,     load = gamma L0²/(4 alpha)
//! ```
//!
//! with the half sum `S` and the half difference `D` of the angles of the ends against the chord, the twist `w` and the
//! magnification `m = 1 + pi²/(pi² - z)` of a bow close to buckling ([`crate::quartic`]); `c`
//! because the sway of a slender rod takes length from it, and so load. Sines stand for the angles. From
//! a first bound of that estimate on the rod takes over, and at a second it is alone; likewise by the length of the
//! chord, as `G0` of [`flotor_lanes::entire`] falls from 1 at rest to 0 at buckling, because past that `energy` knows no bulge.
//!
//! Where any two of chord and normals stand more than 66 degrees apart, or the plate is twisted as much, the share falls
//! again, to zero at 78 degrees: a rod whose plates stand beside one another, or past one another, has several shapes, and
//! none that a coil could take.

use std::f64::consts::PI;

use flotor_hal::glam::{DQuat, DVec3};

use crate::beam_column::TRUSTED_ARGUMENT;
use crate::pose::{Chord, Pose};
use crate::rigidity::Spring;
use flotor_lanes::entire::EntireFunctions;

/// Estimated error from which on the rod has a share, and from which on it is alone.
const FIRST_ERROR: f64 = 2.5e-4;
const LAST_ERROR: f64 = 1.0e-3;

/// `G0` below which the rod has a share, and below which it is alone.
const FIRST: f64 = 0.30;
const LAST: f64 = 0.20;
/// Argument past that of [`LAST`], short of where `G0` is computed to rounding: from here on the rod is alone.
const DEEP_ARGUMENT: f64 = 7.5;
/// Argument at which the straight rod buckles.
const BUCKLING_ARGUMENT: f64 = PI * PI;

/// Cosine of an angle from which on the share falls, 66 degrees, and at which it is zero, 78 degrees.
const UPRIGHT: f64 = 0.4;
const LYING: f64 = 0.2;

/// The share at a pose and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Share {
    pub(crate) value: f64,
    /// By the position of the upper plate.
    pub(crate) by_position_per_m: DVec3,
    /// By a small rotation of it about each axis.
    pub(crate) by_rotation_per_rad: DVec3,
    /// Whether a straight rod of the chord's length has buckled.
    pub(crate) is_buckled: bool,
}

impl Share {
    const NONE: Self = Self {
        value: 0.0,
        by_position_per_m: DVec3::ZERO,
        by_rotation_per_rad: DVec3::ZERO,
        is_buckled: false,
    };
}

/// The shares of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShareOfRod {
    free_length_m: f64,
    /// `gamma / beta`
    ratio: f64,
    /// `gamma / (4 alpha)`
    unit_per_m2: f64,
    has_buckling: bool,
    /// `c`
    slenderness: f64,
}

/// From 0 to 1 as a quantity goes from one bound to another, and its derivative by the quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Passage {
    value: f64,
    slope: f64,
}

impl Passage {
    const DONE: Self = Self { value: 1.0, slope: 0.0 };

    /// `6 t⁵ - 15 t⁴ + 10 t³`: first and second derivatives vanish at both ends.
    fn at(quantity: f64, from: f64, to: f64) -> Self {
        let passed = ((quantity - from) / (to - from)).clamp(0.0, 1.0);
        let rest = passed * (1.0 - passed);
        Self {
            value: passed * passed * passed * (10.0 + passed * (6.0 * passed - 15.0)),
            slope: 30.0 * rest * rest / (to - from),
        }
    }
}

/// What the share depends on.
struct Directions {
    /// Of the chord, `e`, and of the upper normal, `t`; the lower normal is `k = z`.
    chord: DVec3,
    upper: DVec3,
    length_m: f64,
    /// `z` and its derivative by the length.
    argument: f64,
    argument_by_length_per_m: f64,
    /// Cosine and sine of the twist.
    twist: [f64; 2],
    /// `c`
    slenderness: f64,
}

impl ShareOfRod {
    pub(crate) fn new(spring: &Spring) -> Self {
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let ratio = rigidities.gamma_n / rigidities.beta_n;
        let unit_per_m2 = 0.25 * rigidities.gamma_n / rigidities.alpha_n_m2;
        // z = load p (1 - excess p) with the compression p = 1 - L/L0, at most 1.
        let (load, excess) = (unit_per_m2 * free_length_m * free_length_m, 1.0 - ratio);
        let crest = if excess > 0.5 { 0.5 / excess } else { 1.0 };
        let has_buckling = load * crest * (1.0 - excess * crest) > BUCKLING_ARGUMENT;
        let slenderness = 1.0 + load * load / (16.0 * BUCKLING_ARGUMENT * BUCKLING_ARGUMENT);
        Self { free_length_m, ratio, unit_per_m2, has_buckling, slenderness }
    }

    /// Whether the straight rod buckles at any length.
    pub(crate) fn has_buckling(&self) -> bool {
        self.has_buckling
    }

    /// Whether there is any at a pose. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn is_any(&self, pose: &Pose) -> bool {
        self.is_wanted(pose) && self.directions(pose).is_some_and(|at| at.is_upright())
    }

    /// The share at a pose; none where no law answers. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn at(&self, pose: &Pose) -> Share {
        if !self.is_wanted(pose) {
            return Share::NONE;
        }
        match self.directions(pose) {
            Some(at) if at.is_upright() => at.share(),
            _ => Share::NONE,
        }
    }

    /// Whether the length or the error asks for the rod: with scalars alone, because most ticks need no more.
    #[inline]
    fn is_wanted(&self, pose: &Pose) -> bool {
        let Ok(chord) = pose.chord(self.free_length_m) else { return false };
        let argument = self.argument(&chord);
        if argument > TRUSTED_ARGUMENT {
            return true;
        }
        // |D|² = (1 - k.t)/2 and |S|² = 2 - k.e - t.e - |D|², to rounding.
        let q = pose.orientation;
        let bow = q.x * q.x + q.y * q.y;
        let sway = 2.0 - (chord.vector_m.z + chord.vector_m.dot(upper_normal(q))) / chord.length_m - bow;
        let magnification = 1.0 + BUCKLING_ARGUMENT / (BUCKLING_ARGUMENT - argument);
        let bending = sway + magnification * magnification * bow;
        // w² = 2 - 2 cos(twist) = 4 z²/(z² + w²)
        let twist = 4.0 * q.z * q.z / (q.z * q.z + q.w * q.w).max(f64::MIN_POSITIVE);
        bending * (twist + self.slenderness * (bending * bending)) > FIRST_ERROR
    }

    /// `z`
    #[inline(always)]
    fn argument(&self, chord: &Chord) -> f64 {
        self.unit_per_m2 * chord.shortening_m * (chord.length_m + self.ratio * chord.shortening_m)
    }

    fn directions(&self, pose: &Pose) -> Option<Directions> {
        let chord = pose.chord(self.free_length_m).ok()?;
        let length_m = chord.length_m;
        let sheared_m = length_m + self.ratio * chord.shortening_m;
        let q = pose.orientation;
        // The twist is that of the part (z, w) of the quaternion, by its double angle.
        let square = q.z * q.z + q.w * q.w;
        let inverse = 1.0 / square.max(f64::MIN_POSITIVE);
        Some(Directions {
            chord: chord.vector_m / length_m,
            upper: upper_normal(q),
            length_m,
            argument: self.argument(&chord),
            argument_by_length_per_m: self.unit_per_m2
                * ((1.0 - self.ratio) * chord.shortening_m - sheared_m),
            twist: [(q.w * q.w - q.z * q.z) * inverse, 2.0 * q.z * q.w * inverse],
            slenderness: self.slenderness,
        })
    }
}

/// `t`, the upper plate's normal.
#[inline(always)]
fn upper_normal(q: DQuat) -> DVec3 {
    DVec3::new(
        2.0 * (q.x * q.z + q.w * q.y),
        2.0 * (q.y * q.z - q.w * q.x),
        1.0 - 2.0 * (q.x * q.x + q.y * q.y),
    )
}

/// The estimate of the error, and its parts.
struct Estimate {
    value: f64,
    /// `e - (k + t)/2`, of the length `S`.
    sway: DVec3,
    /// `(t - k)/2`, of the length `D`.
    bow: DVec3,
    /// `a`
    bending: f64,
    /// `w²`
    twist: f64,
    /// `m`
    magnification: f64,
}

impl Directions {
    /// `a (w² + c a²)`.
    #[inline(always)]
    fn estimate(&self) -> Estimate {
        let bow = 0.5 * (self.upper - DVec3::Z);
        let sway = self.chord - DVec3::Z - bow;
        let magnification = 1.0 + BUCKLING_ARGUMENT / (BUCKLING_ARGUMENT - self.argument.min(DEEP_ARGUMENT));
        let bending = sway.length_squared() + magnification * magnification * bow.length_squared();
        let twist = 2.0 * (1.0 - self.twist[0]);
        let value = bending * (twist + self.slenderness * (bending * bending));
        Estimate { value, sway, bow, bending, twist, magnification }
    }

    fn cosines(&self) -> [f64; 4] {
        [self.chord.z, self.upper.z, self.chord.dot(self.upper), self.twist[0]]
    }

    /// Whether no two directions stand so far apart that the rod has no share.
    fn is_upright(&self) -> bool {
        self.cosines().into_iter().all(|cosine| cosine > LYING)
    }

    fn share(&self) -> Share {
        let Estimate { value, sway, bow, bending, twist, magnification } = self.estimate();
        let (chord, upper, length_m) = (self.chord, self.upper, self.length_m);
        let by_error = Passage::at(value, FIRST_ERROR, LAST_ERROR);
        let (by_length, argument_slope) = self.nearness();
        // 1 - (1 - by error)(1 - by length), and its derivatives by the estimate and by the argument.
        let wanted = 1.0 - (1.0 - by_error.value) * (1.0 - by_length);
        let by_estimate = by_error.slope * (1.0 - by_length);
        let mut by_argument = argument_slope * (1.0 - by_error.value);

        let by_bending = by_estimate * (twist + 3.0 * self.slenderness * bending * bending);
        let mut by_twist = by_estimate * bending * 2.0 * self.twist[1];
        let mut by_chord = sway * (2.0 * by_bending);
        let mut by_upper = (bow * (magnification * magnification) - sway) * by_bending;
        if self.argument < DEEP_ARGUMENT {
            let pole = BUCKLING_ARGUMENT - self.argument;
            let slope = BUCKLING_ARGUMENT / (pole * pole);
            by_argument += by_bending * 2.0 * magnification * slope * bow.length_squared();
        }

        let upright = self.cosines().map(|cosine| Passage::at(cosine, LYING, UPRIGHT));
        let product = |without: usize| -> f64 {
            upright
                .iter()
                .enumerate()
                .filter(|(i, _)| *i != without)
                .map(|(_, passage)| passage.value)
                .product()
        };
        let all = product(upright.len());
        let by_cosine: [f64; 4] = std::array::from_fn(|i| wanted * upright[i].slope * product(i));
        by_argument *= all;
        by_twist = by_twist * all - by_cosine[3] * self.twist[1];
        by_chord = by_chord * all + DVec3::Z * by_cosine[0] + upper * by_cosine[2];
        by_upper = by_upper * all + DVec3::Z * by_cosine[1] + chord * by_cosine[2];

        // The chord turns as its end moves across, the upper normal as it is turned, and the twist changes by the
        // rotation's component along (t + k)/(1 + k.t).
        let across = (by_chord - chord * by_chord.dot(chord)) / length_m;
        Share {
            value: wanted * all,
            by_position_per_m: across + chord * (by_argument * self.argument_by_length_per_m),
            by_rotation_per_rad: upper.cross(by_upper) + (upper + DVec3::Z) * (by_twist / (1.0 + upper.z)),
            is_buckled: self.argument >= BUCKLING_ARGUMENT,
        }
    }

    /// The share by the length alone, and its derivative by the argument.
    fn nearness(&self) -> (f64, f64) {
        if self.argument <= TRUSTED_ARGUMENT {
            return (0.0, 0.0);
        }
        if self.argument >= DEEP_ARGUMENT {
            return (Passage::DONE.value, Passage::DONE.slope);
        }
        let EntireFunctions { g0, g1, .. } = EntireFunctions::at(self.argument);
        let passage = Passage::at(g0, FIRST, LAST);
        // dG0/dz = -G1/6
        (passage.value, -passage.slope * g1 / 6.0)
    }
}
