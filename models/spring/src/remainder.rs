//! Energy beyond the fourth order, from the exact rod: correction of the law `energy` for large sway of the chord.
//!
//! The law is accurate to fourth order in the angles of bending ([`crate::quartic`]). At 30 degrees of sway the higher
//! orders contribute millinewtons, at 50 degrees a tenth of a newton. In the variables of [`crate::directions`], with
//! the angle of twist `w` and `u = S² - 0.06`,
//!
//! ```text
//! W = alpha/L0 u³ (c0 + c1 u + c2 u² + (c3 m² D² + c4 (m S.D)²)/S² + (c5 (2 - 2 cos w) + c6 m sin w k.(S x D))/S⁴)        u > 0
//! ```
//!
//! and zero below: the cube makes force and stiffness continuous, and leaves the middle of the workspace unchanged. The
//! coefficients are polynomials in the length of the chord, interpolated at Chebyshev nodes. At each node the rod is solved at a
//! few poses, and the difference of the energies gives the coefficients: `c0` to `c2` from three sways of level plates, `c3` to
//! `c6` from one sway with the upper plate tilted across, tilted along (both ways), twisted, and both.
//!
//! Apart from the factor `alpha/L0` the remainder depends on the proportions of the spring only.

use std::array::from_fn;

use flotor_hal::glam::{DVec3, DVec4};
use flotor_hal::math;
use flotor_lanes::polynomial;
use flotor_lanes::saturation::{Saturated, saturate_above, saturate_below};

use crate::directions::{Directions, Gradient, Load, Slopes};
use crate::energy::EnergyForm;
use crate::pose::Pose;
use crate::response::Demand;
use crate::rigidity::Spring;
use crate::rod::Rod;
use crate::shape::relative_length;
use flotor_lanes::chebyshev::interpolated;

/// `S²` above which there is a remainder: 14 degrees.
pub(crate) const ONSET: f64 = 0.06;

/// Numbers of nodes over the length, for the coefficients of sway alone and for the others.
const SWAY_TERMS: usize = 6;
const OTHER_TERMS: usize = 4;

/// Angles between chord and axis at which the rod is solved: with level plates, and with a plate that is turned.
const SWAYS_RAD: [f64; 3] = [0.5, 0.75, 0.97];
const TURNED_SWAY_RAD: f64 = 0.85;
/// Rotation of the turned plate about each axis: 7 degrees, the device's range.
const TURN_RAD: f64 = 0.122;

/// Limits of the relative lengths of the first and the last node, and the margin in which the coefficients saturate.
const SHORTEST: f64 = 0.35;
const LONGEST: f64 = 1.7;
const MARGIN: f64 = 0.05;
/// Largest argument at the first node, short of buckling at 9.87.
const LAST_ARGUMENT: f64 = 6.0;
/// Largest `gamma L0²/(4 alpha)` of a spring with a remainder: a slender rod under tension sways in layers at its ends.
const MOST_LOAD: f64 = 30.0;

/// Coefficients of the remainder of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Remainder {
    /// Powers of the length mapped to -1..1, for `c0` to `c2` and `c3` to `c6`.
    sway: [[f64; SWAY_TERMS]; 3],
    other: [[f64; OTHER_TERMS]; 4],
    shortest_m: f64,
    longest_m: f64,
    margin_m: f64,
    middle_m: f64,
    mapping_per_m: f64,
    /// `alpha / L0`
    unit_j: f64,
}

/// Energy of the remainder at a pose, with its gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RemainderEnergy {
    pub(crate) energy_j: f64,
    pub(crate) gradient: Gradient,
}

/// Terms in addition to `u³`: values of `u`, `1/S²` and of the factors of `c3` to `c6`.
struct Terms {
    u: f64,
    inverse: f64,
    others: [f64; 4],
}

impl Terms {
    fn of(at: &Directions) -> Self {
        let m = at.magnification;
        let along = m * at.sway.dot(at.bow);
        let square = at.sway.length_squared();
        let inverse = 1.0 / square;
        let inverse2 = inverse * inverse;
        Self {
            u: square - ONSET,
            inverse,
            others: [
                m * m * at.bow.length_squared() * inverse,
                along * along * inverse,
                at.twist_square() * inverse2,
                m * at.twist[1] * at.sway.cross(at.bow).z * inverse2,
            ],
        }
    }
}

impl Remainder {
    /// Computes the coefficients from the rod; `None` for a spring that is too slender, or whose rod has no shape at
    /// one of the poses. Real-time: bounded, no allocation; 38 equilibrium solves of the rod.
    pub(crate) fn new(spring: &Spring, energy: &EnergyForm, rod: &mut Rod) -> Option<Self> {
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let load = Load::new(rigidities);
        let total = load.unit_per_m2 * free_length_m * free_length_m;
        if total > MOST_LOAD {
            return None;
        }
        let shortest = relative_length(total, 1.0 - load.ratio, LAST_ARGUMENT).unwrap_or(0.0).max(SHORTEST);
        let (middle, half_width) = (0.5 * (LONGEST + shortest), 0.5 * (LONGEST - shortest));
        let unit_j = rigidities.alpha_n_m2 / free_length_m;
        let mut difference = |mapped: f64, sway_rad: f64, rotation_rad: DVec3| {
            let direction = DVec3::new(math::sin(sway_rad), 0.0, math::cos(sway_rad));
            let chord = direction * ((middle + half_width * mapped) * free_length_m);
            let pose = Pose::from_rotation_vector(chord - DVec3::Z * free_length_m, rotation_rad);
            let law_j = energy.respond(&pose, Demand::WrenchAndEnergy).energy_j.unwrap_or(f64::NAN);
            let rod_j = rod.energy_at(&pose).unwrap_or(f64::NAN);
            let terms = pose
                .chord(free_length_m)
                .map_or(Terms { u: f64::NAN, inverse: 0.0, others: [0.0; 4] }, |chord| {
                    Terms::of(&Directions::new(&load, &chord, pose.orientation))
                });
            ((rod_j - law_j) / (unit_j * terms.u * terms.u * terms.u), terms)
        };
        let sway = interpolated(|mapped| {
            let [first, second, third] = SWAYS_RAD.map(|sway_rad| difference(mapped, sway_rad, DVec3::ZERO));
            through([first, second, third].map(|(value, terms)| [terms.u, value]))
        });
        let mut remainder = Self {
            sway: from_fn(|which| sway.map(|powers: DVec4| powers[which])),
            other: [[0.0; OTHER_TERMS]; 4],
            shortest_m: shortest * free_length_m,
            longest_m: LONGEST * free_length_m,
            margin_m: MARGIN * free_length_m,
            middle_m: middle * free_length_m,
            mapping_per_m: 1.0 / (half_width * free_length_m),
            unit_j,
        };
        let other = interpolated(|mapped| {
            let [c0, c1, c2] = remainder.sway.map(|powers| polynomial(mapped, &powers)[0]);
            let mut rest = |rotation_rad: DVec3| {
                let (value, Terms { u, others, .. }) = difference(mapped, TURNED_SWAY_RAD, rotation_rad);
                (value - (c0 + u * (c1 + u * c2)), others)
            };
            let (across, [bow, ..]) = rest(DVec3::X * TURN_RAD);
            let c3 = across / bow;
            let along = [1.0, -1.0].map(|sign| {
                let (value, [bow, along, ..]) = rest(DVec3::Y * (sign * TURN_RAD));
                (value - c3 * bow) / along
            });
            let c4 = 0.5 * (along[0] + along[1]);
            let (twisted, [_, _, twist, _]) = rest(DVec3::Z * TURN_RAD);
            let c5 = twisted / twist;
            let (value, [bow, along, twist, wound]) = rest((DVec3::X + DVec3::Z) * TURN_RAD);
            DVec4::new(c3, c4, c5, (value - c3 * bow - c4 * along - c5 * twist) / wound)
        });
        remainder.other = from_fn(|which| other.map(|powers: DVec4| powers[which]));
        let is_finite = |powers: &[f64]| powers.iter().all(|power| power.is_finite());
        (remainder.sway.iter().all(|powers| is_finite(powers))
            && remainder.other.iter().all(|powers| is_finite(powers)))
        .then_some(remainder)
    }

    /// Sets the stiffness of another spring of equal proportions, see [`Spring::is_proportional_to`]. Real-time: bounded, no allocation.
    pub(crate) fn restiffen(&mut self, spring: &Spring) {
        self.unit_j = spring.rigidities().alpha_n_m2 / spring.geometry().free_length_m;
    }

    /// Returns the remainder at a pose; `None` where it is zero. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(crate) fn at(&self, at: &Directions, upright: (f64, Gradient)) -> Option<RemainderEnergy> {
        let Terms { u, inverse, others } = Terms::of(at);
        if u <= 0.0 {
            return None;
        }
        let below = saturate_below(at.length_m, self.shortest_m, self.margin_m);
        let Saturated { value, slope, .. } = saturate_above(below.value, self.longest_m, self.margin_m);
        let slope = slope * below.slope * self.mapping_per_m;
        let mapped = (value - self.middle_m) * self.mapping_per_m;
        let [[c0, d0], [c1, d1], [c2, d2]] = self.sway.map(|powers| polynomial(mapped, &powers));
        let coupled = self.other.map(|powers| polynomial(mapped, &powers));

        let mut sum = c0 + u * (c1 + u * c2);
        let mut by_length = d0 + u * (d1 + u * d2);
        for ([c, d], term) in coupled.iter().zip(others) {
            sum += c * term;
            by_length += d * term;
        }
        let square = self.unit_j * (u * u);
        let cube = square * u;
        let energy_j = cube * sum;
        let [t3, t4, t5, t6]: [f64; 4] = from_fn(|which| coupled[which][0] * others[which]);
        let by_square =
            3.0 * square * sum + cube * (c1 + 2.0 * u * c2 - inverse * (t3 + t4 + 2.0 * (t5 + t6)));
        let (once, twice) = (cube * inverse, cube * inverse * inverse);
        let [[c3, _], [c4, _], [c5, _], [c6, _]] = coupled;
        let (c3, c4, c5, c6) = (c3 * once, c4 * once, c5 * twice, c6 * twice);

        let m = at.magnification;
        let (sway, bow, [cosine, sine]) = (at.sway, at.bow, at.twist);
        let (along, wound) = (sway.dot(bow), sway.cross(bow).z);
        let (by_along, by_wound) = (2.0 * c4 * (m * m) * along, c6 * m * sine);
        // k.(S x D) = S.(D x k) = D.(k x S)
        let slopes = Slopes {
            by_sway: sway * (2.0 * by_square) + bow * by_along + bow.cross(DVec3::Z) * by_wound,
            by_bow: bow * (2.0 * c3 * (m * m)) + sway * by_along + DVec3::Z.cross(sway) * by_wound,
            by_twist: 2.0 * c5 * sine + c6 * m * cosine * wound,
            by_magnification: 2.0 * m * (c3 * bow.length_squared() + c4 * (along * along))
                + c6 * sine * wound,
            by_argument: 0.0,
            by_length_per_m: cube * by_length * slope,
        };
        let (factor, fall) = upright;
        Some(RemainderEnergy {
            energy_j: energy_j * factor,
            gradient: at.gradient(&slopes).combined(factor, fall, energy_j),
        })
    }
}

/// Returns the coefficients of the parabola through three points.
fn through([[a, at_a], [b, at_b], [c, at_c]]: [[f64; 2]; 3]) -> DVec4 {
    let (first, second) = ((at_b - at_a) / (b - a), (at_c - at_b) / (c - b));
    let curvature = (second - first) / (c - a);
    DVec4::new(at_a - first * a + curvature * a * b, first - curvature * (a + b), curvature, 0.0)
}
