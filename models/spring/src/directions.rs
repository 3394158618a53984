//! Variables of a pose for the exact rod: sway, bow, twist and nearness to buckling, and gradients of functions of these variables.
//!
//! With the lower normal `k`, the upper normal `t` and the chord's direction `e`, the half sum and the half difference of the
//! angles of the ends against the chord have the sines
//!
//! ```text
//! S = e - (k + t)/2        D = (t - k)/2        m = 1 + pi²/(pi² - z)
//! ```
//!
//! A bow grows by the magnification `m` as the argument `z` of [`flotor_lanes::entire`] comes close to buckling. The
//! angle by which the upper plate is twisted about its normal is `w`.

use std::f64::consts::PI;

use flotor_hal::glam::{DQuat, DVec3};

use crate::pose::Chord;
use crate::rigidity::Rigidities;

/// Argument at which the straight rod buckles.
pub(crate) const BUCKLING_ARGUMENT: f64 = PI * PI;
/// Argument above which the magnification is constant: below the largest argument at which `G0` is accurate to rounding.
pub(crate) const DEEP_ARGUMENT: f64 = 7.5;

/// Cosines of the angles at which [`Directions::upright`] begins to fall, 66 degrees, and is zero, 78 degrees.
const UPRIGHT: f64 = 0.4;
const LYING: f64 = 0.2;

/// Smooth step from 0 to 1 between two bounds of a quantity, with its derivative with respect to the quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Passage {
    pub(crate) value: f64,
    pub(crate) slope: f64,
}

impl Passage {
    pub(crate) const NOT_BEGUN: Self = Self { value: 0.0, slope: 0.0 };
    pub(crate) const DONE: Self = Self { value: 1.0, slope: 0.0 };

    /// Evaluates `6 t⁵ - 15 t⁴ + 10 t³`: first and second derivatives vanish at both ends.
    pub(crate) fn at(quantity: f64, from: f64, to: f64) -> Self {
        let passed = ((quantity - from) / (to - from)).clamp(0.0, 1.0);
        let rest = passed * (1.0 - passed);
        Self {
            value: passed * passed * passed * (10.0 + passed * (6.0 * passed - 15.0)),
            slope: 30.0 * rest * rest / (to - from),
        }
    }
}

/// Constants of a spring for the argument of a chord.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Load {
    /// `gamma / beta`
    pub(crate) ratio: f64,
    /// `gamma / (4 alpha)`
    pub(crate) unit_per_m2: f64,
}

impl Load {
    pub(crate) fn new(rigidities: &Rigidities) -> Self {
        Self {
            ratio: rigidities.gamma_n / rigidities.beta_n,
            unit_per_m2: 0.25 * rigidities.gamma_n / rigidities.alpha_n_m2,
        }
    }

    /// Returns the argument `z` of a chord.
    #[inline(always)]
    pub(crate) fn argument(&self, chord: &Chord) -> f64 {
        self.unit_per_m2 * chord.shortening_m * (chord.length_m + self.ratio * chord.shortening_m)
    }

    /// Returns `dz/dL`.
    fn argument_by_length_per_m(&self, chord: &Chord) -> f64 {
        let sheared_m = chord.length_m + self.ratio * chord.shortening_m;
        self.unit_per_m2 * ((1.0 - self.ratio) * chord.shortening_m - sheared_m)
    }
}

/// Returns the magnification `m` of a bow at an argument; constant above [`DEEP_ARGUMENT`].
#[inline(always)]
pub(crate) fn magnification(argument: f64) -> f64 {
    1.0 + BUCKLING_ARGUMENT / (BUCKLING_ARGUMENT - argument.min(DEEP_ARGUMENT))
}

/// Returns `t`, the upper plate's normal.
#[inline(always)]
pub(crate) fn upper_normal(q: DQuat) -> DVec3 {
    DVec3::new(
        2.0 * (q.x * q.z + q.w * q.y),
        2.0 * (q.y * q.z - q.w * q.x),
        1.0 - 2.0 * (q.x * q.x + q.y * q.y),
    )
}

/// Variables of one pose, see the module.
pub(crate) struct Directions {
    /// `e`
    chord: DVec3,
    /// `t`
    upper: DVec3,
    pub(crate) length_m: f64,
    /// `S`
    pub(crate) sway: DVec3,
    /// `D`
    pub(crate) bow: DVec3,
    /// `z`
    pub(crate) argument: f64,
    /// `m`
    pub(crate) magnification: f64,
    argument_by_length_per_m: f64,
    /// Cosine and sine of the twist.
    pub(crate) twist: [f64; 2],
}

/// Derivatives of a function with respect to the variables of [`Directions`].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slopes {
    pub(crate) by_sway: DVec3,
    pub(crate) by_bow: DVec3,
    pub(crate) by_twist: f64,
    pub(crate) by_argument: f64,
    pub(crate) by_magnification: f64,
    pub(crate) by_length_per_m: f64,
}

/// Derivatives of a function of the pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gradient {
    /// Derivatives with respect to the position of the upper plate.
    pub(crate) by_position_per_m: DVec3,
    /// Derivatives with respect to a small rotation of the upper plate about each axis.
    pub(crate) by_rotation_per_rad: DVec3,
}

impl Gradient {
    pub(crate) const ZERO: Self = Self { by_position_per_m: DVec3::ZERO, by_rotation_per_rad: DVec3::ZERO };

    /// Returns `self * factor + other * by`.
    #[inline(always)]
    pub(crate) fn combined(self, factor: f64, other: Self, by: f64) -> Self {
        Self {
            by_position_per_m: self.by_position_per_m * factor + other.by_position_per_m * by,
            by_rotation_per_rad: self.by_rotation_per_rad * factor + other.by_rotation_per_rad * by,
        }
    }
}

impl Directions {
    #[inline(always)]
    pub(crate) fn new(load: &Load, chord: &Chord, q: DQuat) -> Self {
        let length_m = chord.length_m;
        // The twist is that of the part (z, w) of the quaternion, by its double angle.
        let inverse = 1.0 / (q.z * q.z + q.w * q.w).max(f64::MIN_POSITIVE);
        let (direction, upper) = (chord.vector_m / length_m, upper_normal(q));
        let bow = 0.5 * (upper - DVec3::Z);
        let argument = load.argument(chord);
        Self {
            chord: direction,
            upper,
            length_m,
            sway: direction - DVec3::Z - bow,
            bow,
            argument,
            magnification: magnification(argument),
            argument_by_length_per_m: load.argument_by_length_per_m(chord),
            twist: [(q.w * q.w - q.z * q.z) * inverse, 2.0 * q.z * q.w * inverse],
        }
    }

    /// Returns `2 - 2 cos w`, the square of a small twist.
    pub(crate) fn twist_square(&self) -> f64 {
        2.0 * (1.0 - self.twist[0])
    }

    /// Returns the cosines of the angles between any two of chord and normals, and of the twist.
    fn cosines(&self) -> [f64; 4] {
        [self.chord.z, self.upper.z, self.chord.dot(self.upper), self.twist[0]]
    }

    /// Returns true if all angles and the twist are below 78 degrees, at which the factor of [`Self::upright`] becomes zero.
    pub(crate) fn is_upright(&self) -> bool {
        self.cosines().into_iter().all(|cosine| cosine > LYING)
    }

    /// Returns a factor, with its gradient, that falls from 1 to 0 between angles or a twist of 66 and 78 degrees.
    pub(crate) fn upright(&self) -> (f64, Gradient) {
        let cosines = self.cosines();
        if cosines.iter().all(|cosine| *cosine >= UPRIGHT) {
            return (1.0, Gradient::ZERO);
        }
        let passages = cosines.map(|cosine| Passage::at(cosine, LYING, UPRIGHT));
        let product = |without: usize| -> f64 {
            passages
                .iter()
                .enumerate()
                .filter(|(i, _)| *i != without)
                .map(|(_, passage)| passage.value)
                .product()
        };
        let [lower, plates, upper, twist]: [f64; 4] = std::array::from_fn(|i| passages[i].slope * product(i));
        let by_chord = DVec3::Z * lower + self.upper * upper;
        let by_upper = DVec3::Z * plates + self.chord * upper;
        (product(passages.len()), self.turned(by_chord, by_upper, -twist * self.twist[1], 0.0))
    }

    /// Returns the gradient of a function with respect to the pose.
    #[inline(always)]
    pub(crate) fn gradient(&self, slopes: &Slopes) -> Gradient {
        let Slopes { by_sway, by_bow, by_twist, mut by_argument, by_magnification, by_length_per_m } =
            *slopes;
        if self.argument < DEEP_ARGUMENT {
            let pole = BUCKLING_ARGUMENT - self.argument;
            by_argument += by_magnification * BUCKLING_ARGUMENT / (pole * pole);
        }
        // dS = de - dt/2, dD = dt/2
        let by_length = by_length_per_m + by_argument * self.argument_by_length_per_m;
        self.turned(by_sway, 0.5 * (by_bow - by_sway), by_twist, by_length)
    }

    /// Converts derivatives to a gradient: the chord turns as its end moves across, the upper normal as the plate is
    /// turned, and the twist changes by the rotation's component along (t + k)/(1 + k.t).
    #[inline(always)]
    fn turned(&self, by_chord: DVec3, by_upper: DVec3, by_twist: f64, by_length_per_m: f64) -> Gradient {
        let (chord, upper) = (self.chord, self.upper);
        let across = (by_chord - chord * by_chord.dot(chord)) / self.length_m;
        Gradient {
            by_position_per_m: across + chord * by_length_per_m,
            by_rotation_per_rad: upper.cross(by_upper) + (upper + DVec3::Z) * (by_twist / (1.0 + upper.z)),
        }
    }
}
