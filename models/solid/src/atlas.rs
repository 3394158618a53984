//! Elastic energy of a sphere pressed into a solid, as a function of the position of the sphere's centre.
//!
//! Without friction the force depends on the position of the centre alone. The whole law is therefore one function of
//! three coordinates, and the force is its gradient: the law has no path memory, no closed path generates energy, and a
//! tick costs the same wherever the sphere is. The energy is
//!
//! ```text
//! E = P(d) g(place, sqrt(d / R)),       P(d) = 8/15 E* sqrt(R) d^(5/2) h(sqrt(d / R))
//! ```
//!
//! with the depth `d` of the face inside the sphere, Hertz's law, its correction `h` for a true sphere and large depth, and
//! the ratio `g` of the block's energy to that of a half-space; `h` and `g` are splines through solved contacts
//! ([`crate::sphere`]). Depth and place come from the distance to the block, whose edges are rounded a little.

use crate::jet::Jet;
use crate::remainder::Size;
use crate::spline::{Curve, Volume};

/// Body that the sphere touches, with the tables of its law.
#[derive(Clone, Debug, PartialEq)]
pub enum TouchedBody {
    /// Half-space `z <= 0`.
    HalfSpace,
    /// Block, its bottom clamped.
    Block {
        /// Dimensions, m.
        size: Size,
        /// Energy ratios on the top (|x|, |y|), on the faces normal to x (|y|, z) and on those normal to y (|x|, z).
        ratios: Box<[Volume; 3]>,
        /// Radius of the rounded edges, m.
        rounding_m: f64,
    },
    /// Round cylinder, its bottom clamped.
    Cylinder {
        /// Radius of the cylinder, m.
        radius_m: f64,
        /// Height of the cylinder, m.
        height_m: f64,
        /// Energy ratio over the distance from the axis; the second coordinate is unused.
        ratio: Box<Volume>,
        /// Radius of the rounded rim, m.
        rounding_m: f64,
    },
    /// Plane top of a body of any shape. The law extends over the whole plane; outside the outline it is extrapolated.
    Face {
        /// Bounding box of the face: smallest and largest x, then y, m.
        outline_m: [[f64; 2]; 2],
        /// Energy ratio over x and y.
        ratio: Box<Volume>,
    },
}

/// Force law of one sphere, for a Young's modulus of 1 Pa.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Radius of the sphere, m.
    pub radius_m: f64,
    /// Factor `8/15 E* sqrt(R)` of Hertz's energy, J/m^(5/2).
    pub hertz: f64,
    /// Correction `h` of Hertz's energy, a function of `sqrt(d / R)`.
    pub profile: Curve,
    /// Depth at which the stiffness starts to fall to zero, over a tenth of the radius, m.
    pub deepest_m: f64,
    /// Body that the sphere touches.
    pub body: TouchedBody,
}

/// Width before and after the deepest solved depth over which the energy ratio becomes constant, in `sqrt(d / R)`.
const RATIO_END: f64 = 0.022;

/// Width over which the stiffness falls to zero beyond [`Atlas::deepest_m`], in radii.
const DEEPEST_FADE: f64 = 0.1;

/// Square of a distance below which the distance counts as zero, m²: its reciprocal would not be finite.
const NOTHING_M2: f64 = 1.0e-30;

/// Depth of a contact with its energy ratio.
struct Touch {
    depth_m: Jet,
    ratio: Jet,
    is_extrapolated: bool,
}

/// Number of square roots in the smooth minimum of [`least`]; its power is two to this number.
const SHARPNESS_ROOTS: u32 = 3; // 2^3 = 8

/// Energy of a contact with its gradient, and depth of the contact.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Answer {
    /// Stored energy, J, with its gradient, N; the force on the sphere is minus the gradient.
    pub energy: Jet,
    /// Depth of the undeformed face inside the sphere, m; not positive without contact.
    pub depth_m: f64,
    /// True if the law is extrapolated from a nearby position: off the face of a mesh, or on the side of a cylinder.
    pub is_extrapolated: bool,
}

impl Answer {
    /// Returns the answer at a depth without contact.
    fn none(depth_m: f64) -> Self {
        Self { energy: Jet::default(), depth_m, is_extrapolated: false }
    }
}

impl Atlas {
    /// Returns energy, with its gradient, and depth of the contact with a sphere centred at `centre_m` (finite). Real-time:
    /// bounded, no allocation.
    pub fn answer(&self, centre_m: [f64; 3]) -> Answer {
        let centre = [0, 1, 2].map(|axis| Jet::variable(centre_m[axis], axis));
        let touch = match &self.body {
            TouchedBody::HalfSpace => Some(Touch {
                depth_m: -centre[2] + self.radius_m,
                ratio: Jet::constant(1.0),
                is_extrapolated: false,
            }),
            TouchedBody::Block { size, ratios, rounding_m } => {
                self.touch_block(centre, *size, ratios, *rounding_m)
            }
            TouchedBody::Cylinder { radius_m, height_m, ratio, rounding_m } => {
                self.touch_cylinder(centre, [*radius_m, *height_m], ratio, *rounding_m)
            }
            TouchedBody::Face { outline_m, ratio } => self.touch_face(centre, *outline_m, ratio),
        };
        let Some(touch) = touch else { return Answer::none(-1.0) };
        let (depth_m, is_extrapolated) = (touch.depth_m.value, touch.is_extrapolated);
        if depth_m <= 0.0 {
            return Answer::none(depth_m);
        }
        Answer { energy: self.unbounded(touch.depth_m) * touch.ratio, depth_m, is_extrapolated }
    }

    /// Returns the contact with the top face of a block alone: its energy is zero beyond the edges of the face and fades in over
    /// half a radius inside them. The force of this contact grows with the depth; the force of [`Self::answer`] does not where
    /// another face is nearer. For a body other than a block the result is that of [`Self::answer`]. Real-time: bounded, no
    /// allocation.
    pub fn top(&self, centre_m: [f64; 3]) -> Answer {
        let TouchedBody::Block { size, ratios, rounding_m } = &self.body else {
            return self.answer(centre_m);
        };
        let centre = [0, 1, 2].map(|axis| Jet::variable(centre_m[axis], axis));
        let depth_m = -centre[2] + self.radius_m;
        let width_m = 0.5 * self.radius_m;
        let half_m = [size.half_x_m, size.half_y_m];
        let inside = [0, 1].map(|k| (-centre[k].abs() + half_m[k]) * (1.0 / width_m));
        if depth_m.value <= 0.0 || inside.iter().any(|s| s.value <= 0.0) {
            return Answer::none(depth_m.value);
        }
        let ratio = ratios[0].at(self.place_on_top(centre, depth_m, &ratios[0], *rounding_m));
        let energy = self.unbounded(depth_m) * ratio * step(inside[0]) * step(inside[1]);
        Answer { energy, depth_m: depth_m.value, is_extrapolated: false }
    }

    /// Returns the coordinates of a block's top energy ratio.
    fn place_on_top(&self, centre: [Jet; 3], depth_m: Jet, ratio: &Volume, rounding_m: f64) -> [Jet; 3] {
        let across = |k: usize| ease_at(centre[k].abs(), ratio.range(k).1, rounding_m);
        [across(0), across(1), self.root(depth_m, ratio)]
    }

    /// Returns the square root of depth over radius, limited to the range of the energy ratio.
    fn root(&self, depth_m: Jet, ratio: &Volume) -> Jet {
        let value = (depth_m.value / self.radius_m).sqrt();
        ease_at(depth_m.chain(value, 0.5 * value / depth_m.value), ratio.range(2).1, RATIO_END)
    }

    /// Returns depth and energy ratio at a plane face; `None` above the face.
    fn touch_face(&self, centre: [Jet; 3], outline_m: [[f64; 2]; 2], ratio: &Volume) -> Option<Touch> {
        let depth_m = -centre[2] + self.radius_m;
        if depth_m.value <= 0.0 {
            return None;
        }
        let within = |k: usize| {
            let (low, high) = ratio.range(k);
            let width = 0.05 * (high - low);
            -ease_at(-ease_at(centre[k], high, width), -low, width)
        };
        let is_extrapolated = (0..2).any(|k| !(outline_m[k][0]..=outline_m[k][1]).contains(&centre[k].value));
        Some(Touch {
            depth_m,
            ratio: ratio.at([within(0), within(1), self.root(depth_m, ratio)]),
            is_extrapolated,
        })
    }

    /// Returns depth and energy ratio at a cylinder; `None` without contact.
    fn touch_cylinder(
        &self,
        centre: [Jet; 3],
        [radius_m, height_m]: [f64; 2],
        ratio: &Volume,
        rounding_m: f64,
    ) -> Option<Touch> {
        let from_axis = (centre[0] * centre[0] + centre[1] * centre[1]).sqrt();
        let blunt_m = 0.25 * radius_m.min(0.5 * height_m);
        let up = smooth_size(centre[2] + 0.5 * height_m, blunt_m);
        let beyond = [
            smooth_size(from_axis, blunt_m) - (radius_m - rounding_m),
            Jet::constant(f64::NEG_INFINITY),
            up - (0.5 * height_m - rounding_m),
        ];
        let (distance_m, shares) = distance(beyond, rounding_m);
        let depth_m = -distance_m + (self.radius_m + rounding_m);
        if depth_m.value <= 0.0 {
            return None;
        }
        let place = ease_at(from_axis, ratio.range(0).1, rounding_m);
        let ratio = ratio.at([place, Jet::constant(0.0), self.root(depth_m, ratio)]);
        Some(Touch { depth_m, ratio, is_extrapolated: shares[0].value > 0.5 })
    }

    /// Evaluates `P(d)`. Beyond the deepest depth the second derivative falls to zero, then `P` is a straight line.
    fn unbounded(&self, depth_m: Jet) -> Jet {
        let within = depth_m.value.min(self.deepest_m);
        let root = (within / self.radius_m).sqrt();
        let (h, slope) = self.profile.at(root);
        let hertz = self.hertz * within * within * within.sqrt();
        let value = hertz * h;
        let derivative = 2.5 * value / within + hertz * slope * 0.5 * root / within;
        let over_m = depth_m.value - within;
        if over_m == 0.0 {
            return depth_m.chain(value, derivative);
        }
        let bend = self.profile.curvature(root);
        let second = hertz / (within * within) * (3.75 * h + 2.25 * slope * root + 0.25 * bend * root * root);
        let width_m = DEEPEST_FADE * self.radius_m;
        let s = (over_m / width_m).min(1.0);
        // The integrals of 1 - s^2 (3 - 2 s), once and twice.
        let once = width_m * s * (1.0 - s * s * (1.0 - 0.5 * s));
        let twice = width_m * width_m * s * s * (0.5 - s * s * (0.25 - 0.1 * s));
        let straight_m = (over_m - width_m).max(0.0);
        let steepest = derivative + second * once;
        depth_m.chain(
            value + derivative * (over_m - straight_m) + second * twice + steepest * straight_m,
            steepest,
        )
    }

    /// Returns depth and energy ratio at a block; `None` without contact.
    fn touch_block(
        &self,
        centre: [Jet; 3],
        size: Size,
        ratios: &[Volume; 3],
        rounding_m: f64,
    ) -> Option<Touch> {
        let half_m = [size.half_x_m, size.half_y_m, 0.5 * size.height_m];
        let middle = [centre[0], centre[1], centre[2] + half_m[2]];
        let blunt_m = 0.25 * half_m[0].min(half_m[1]).min(half_m[2]);
        // Distance beyond each pair of faces of the block less its rounding.
        let beyond = [0, 1, 2].map(|axis| smooth_size(middle[axis], blunt_m) - (half_m[axis] - rounding_m));
        let (distance_m, shares) = distance(beyond, rounding_m);
        let depth_m = -distance_m + (self.radius_m + rounding_m);
        if depth_m.value <= 0.0 {
            return None;
        }
        let root = self.root(depth_m, &ratios[0]);
        let across = |axis: usize, volume: &Volume, k: usize| {
            ease_at(middle[axis].abs(), volume.range(k).1, rounding_m)
        };
        let up = |volume: &Volume| {
            let (low, high) = volume.range(1);
            let from_above = ease_at(centre[2], high, rounding_m);
            -ease_at(-from_above, -low, rounding_m)
        };
        let mut ratio = Jet::constant(0.0);
        for (axis, share) in shares.into_iter().enumerate().filter(|(_, share)| share.value > 0.0) {
            let part = match axis {
                0 => ratios[1].at([across(1, &ratios[1], 0), up(&ratios[1]), root]),
                1 => ratios[2].at([across(0, &ratios[2], 0), up(&ratios[2]), root]),
                // Also for the clamped face, which cannot be touched: the law stays uniform in the middle of the block.
                _ => ratios[0].at(self.place_on_top(centre, depth_m, &ratios[0], rounding_m)),
            };
            ratio = ratio + share * part;
        }
        Some(Touch { depth_m, ratio, is_extrapolated: false })
    }
}

/// Returns the absolute value, rounded off within `blunt` of zero (apart from a constant) if `blunt` is positive.
fn smooth_size(x: Jet, blunt: f64) -> Jet {
    if x.value.abs() >= blunt {
        return x.abs();
    }
    let square = x * x * (1.0 / (blunt * blunt));
    (square * (square * -0.125 + 0.75) + 0.375) * blunt
}

/// Limits a number: unchanged up to `knee`, then bent to a plateau of `knee + width`, reached at `knee + 2 width`.
fn ease(x: Jet, knee: f64, width: f64) -> Jet {
    let over = x.value - knee;
    if over <= 0.0 {
        x
    } else if over < 2.0 * width {
        // The slope falls from one to zero like a cubic step: the second derivative has no jump.
        let s = over / (2.0 * width);
        let value = s * (1.0 - s * s * (1.0 - 0.5 * s));
        x.chain(knee + 2.0 * width * value, 1.0 - s * s * (3.0 - 2.0 * s))
    } else {
        Jet::constant(knee + width)
    }
}

/// Limits a number smoothly to `end`: the transition extends from `width` below `end` to `width` above it.
pub(crate) fn ease_at(x: Jet, end: f64, width: f64) -> Jet {
    let eased = ease(x, end - width, width);
    // Rounding errors must not leave the table.
    if eased.value > end { Jet::constant(end) } else { eased }
}

/// Returns the smooth positive part of a number, bent over `width` on both sides of zero: `above(x) - above(-x) = x`.
fn above(x: Jet, width: f64) -> Jet {
    if x.value <= -width { Jet::default() } else { x - ease(x, -width, width) }
}

/// Returns the length of a vector.
fn length(of: [Jet; 3]) -> Jet {
    let square = of[0] * of[0] + of[1] * of[1] + of[2] * of[2];
    if square.value > NOTHING_M2 { square.sqrt() } else { Jet::default() }
}

/// Returns a smooth minimum of three non-negative numbers: `(a^-8 + b^-8 + c^-8)^(-1/8)`.
fn least(of: [Jet; 3]) -> Jet {
    let least = of.iter().copied().fold(of[0], |least, d| if d.value < least.value { d } else { least });
    if least.value * least.value <= NOTHING_M2 {
        return Jet::default();
    }
    let mut sum = Jet::constant(0.0);
    for d in of {
        let mut power = least / d;
        for _ in 0..SHARPNESS_ROOTS {
            power = power * power;
        }
        sum = sum + power;
    }
    let mut root = sum.recip();
    for _ in 0..SHARPNESS_ROOTS {
        root = root.sqrt();
    }
    least * root
}

/// Returns the signed distance to a box (negative inside) from the distances beyond each pair of faces, and the weight
/// of each pair. Equally near pairs blend over `width` on both sides, with continuous second derivatives.
fn distance(beyond: [Jet; 3], width: f64) -> (Jet, [Jet; 3]) {
    let outside = beyond.map(|b| above(b, width));
    let distance = length(outside) - least(beyond.map(|b| above(-b, width)));
    // Outside, the distance beyond one of three pairs is at least 0.58 of that to their corner; inside, at most 1.15 of it.
    let over = (above(distance, width) * 0.6 + above(-distance, width) * 0.3 + width).recip();
    let weights = beyond.map(|b| {
        let s = (b - distance) * over + 1.0;
        if s.value > 0.0 { step(s) } else { Jet::default() }
    });
    let sum = (weights[0] + weights[1] + weights[2]).recip();
    (distance, weights.map(|weight| weight * sum))
}

/// Returns a smooth step from zero at zero to one at one, constant beyond, with two continuous derivatives.
pub(crate) fn step(x: Jet) -> Jet {
    let s = x.value.clamp(0.0, 1.0);
    x.chain(s * s * s * (10.0 - s * (15.0 - 6.0 * s)), 30.0 * s * s * (1.0 - s) * (1.0 - s))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spline::End;

    /// A law whose ratio is one everywhere: only distance and depth are left.
    fn even() -> Atlas {
        with([1.0; 3])
    }

    /// A law whose ratio is one number on each pair of faces: top, across x, across y.
    fn with(ratios: [f64; 3]) -> Atlas {
        let size = Size { half_x_m: 0.02, half_y_m: 0.03, height_m: 0.05 };
        let even = |ratio: f64, a: f64, low: f64, high: f64| {
            let nodes = [vec![0.0, 0.5 * a, a], vec![low, 0.5 * (low + high), high], vec![0.0, 0.5, 1.0]];
            Volume::new(nodes, &[ratio; 27], [[End::Parabola; 2]; 3])
        };
        let ratios = Box::new([
            even(ratios[0], 0.018, 0.0, 0.028),
            even(ratios[1], 0.028, -0.048, -0.002),
            even(ratios[2], 0.018, -0.048, -0.002),
        ]);
        Atlas {
            radius_m: 0.005,
            hertz: 1.0,
            profile: Curve::new(vec![0.0, 0.5, 1.2], vec![1.0; 3], [End::Parabola; 2]),
            deepest_m: 0.006,
            body: TouchedBody::Block { size, ratios, rounding_m: 0.001 },
        }
    }

    #[test]
    fn depth_is_measured_from_the_face_the_edge_or_the_corner() {
        let atlas = even();
        for (centre_m, depth_m) in [
            ([0.0, 0.0, 0.004], 0.001),
            ([0.0, 0.01, -0.001], 0.006),
            ([0.0245, 0.0, -0.025], 0.0005),
            ([-0.0245, 0.0, -0.025], 0.0005),
            ([0.0, 0.033, -0.025], 0.002),
            // Three and four beyond the faces of the block less its rounding: five from its edge.
            ([0.022, 0.0, 0.003], 0.001),
        ] {
            let answer = atlas.answer(centre_m);
            assert!((answer.depth_m - depth_m).abs() < 1.0e-12, "{centre_m:?} {}", answer.depth_m);
        }
        assert_eq!(atlas.answer([0.0, 0.0, 0.0051]).energy, Jet::default());
    }

    /// On the axis of a rounded edge, and where two faces are as near, directions meet: neither the energy nor the force
    /// depends on the side one comes from, and faces of different stiffness do not make a force of their difference.
    #[test]
    fn the_axis_of_an_edge_is_a_place_like_others() {
        let atlas = with([1.0, 1.3, 0.8]);
        let near = atlas.answer([0.0, 0.0, -0.001]).energy.slope[2].abs();
        for axis_m in [
            [0.019, 0.0, -0.001],
            [0.0, 0.029, -0.001],
            [0.019, 0.029, -0.02],
            [0.019, 0.029, -0.001],
            [0.009, 0.0, -0.011],
            [0.009, 0.019, -0.011],
        ] {
            let at = |i: usize, j: usize, k: usize| {
                let side = |k: usize| (k as f64 - 1.0) * 1.0e-9;
                atlas.answer([axis_m[0] + side(i), axis_m[1] + side(j), axis_m[2] + side(k)]).energy
            };
            let middle = at(1, 1, 1);
            for place in 0..27 {
                let beside = at(place % 3, place / 3 % 3, place / 9);
                let turned = (0..3).map(|k| (beside.slope[k] - middle.slope[k]).abs()).fold(0.0, f64::max);
                let step_j = (beside.value - middle.value).abs();
                // A nanometre is a millionth of the rounding: so much of the force of the face, and of its work.
                assert!(turned < 1.0e-4 * near, "{axis_m:?} {place}: {turned} {near}");
                assert!(step_j < 1.0e-8 * near, "{axis_m:?} {place}: {step_j}");
                assert!(beside.slope.iter().all(|s| s.abs() < 1.5 * near), "{axis_m:?} {:?}", beside.slope);
            }
        }
    }

    #[test]
    fn places_without_a_direction_have_a_finite_answer() {
        let atlas = even();
        for x in [0.0, 0.019, 0.02, f64::MIN_POSITIVE] {
            for z in [0.0, -0.001, -0.025, -1.0e-310] {
                let answer = atlas.answer([x, 0.0, z]);
                let slope = answer.energy.slope;
                assert!(answer.energy.value.is_finite() && slope.iter().all(|s| s.is_finite()), "{x} {z}");
            }
        }
    }
}
