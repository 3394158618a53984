//! The energy of a sphere against a solid, as a function of where its centre is.
//!
//! Without friction the answer depends on the place of the centre alone, so that the whole law is one function of three
//! coordinates, and the force its gradient: no path has a memory of its own, no closed path generates energy, and a
//! tick costs the same wherever the sphere is. It is
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

/// What is touched.
#[derive(Clone, Debug, PartialEq)]
pub enum Ground {
    /// All below `z = 0`.
    HalfSpace,
    /// A block.
    Block {
        /// Its size.
        size: Size,
        /// Ratio of energies on top (|x|, |y|), on the faces across x (|y|, z) and on those across y (|x|, z).
        ratios: Box<[Volume; 3]>,
        /// Radius of the edges, m.
        rounding_m: f64,
    },
    /// A round cylinder, its bottom clamped.
    Cylinder {
        /// Its radius, m.
        radius_m: f64,
        /// Its height, m.
        height_m: f64,
        /// Ratio of energies over the distance from the axis; the second axis is idle.
        ratio: Box<Volume>,
        /// Radius of the rim, m.
        rounding_m: f64,
    },
    /// The plane top of a body of any shape: the whole plane is touched, and beyond the face's box the answer says so.
    Face {
        /// Smallest and largest x and y of the face, m.
        outline_m: [[f64; 2]; 2],
        /// Ratio of energies over x and y.
        ratio: Box<Volume>,
    },
}

/// The law of one sphere.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Radius of the sphere, m.
    pub radius_m: f64,
    /// `8/15 E* sqrt(R)`, J/m^(5/2).
    pub hertz: f64,
    /// `h` over `sqrt(d / R)`.
    pub profile: Curve,
    /// Depth from which on the force stays as it is, m.
    pub deepest_m: f64,
    /// What is touched.
    pub ground: Ground,
}

/// Over how much of the root of depth over radius the ratio comes to its end, behind the deepest that is answered.
const RATIO_END: f64 = 0.022;

/// Distances below this are none, m: their reciprocals would not be finite.
const NOTHING_M: f64 = 1.0e-15;

/// Depth, and what the ratio is there.
struct Touch {
    depth_m: Jet,
    ratio: Jet,
    is_beyond: bool,
}

/// Power with which the depths below several faces are joined to the least of them.
const SHARPNESS_ROOTS: u32 = 3; // 2^3: the eighth

/// Energy, J, its gradient, N, and the depth, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Stored energy and its gradient.
    pub energy: Jet,
    /// How far the face is inside the sphere; not positive without contact.
    pub depth_m: f64,
    /// True where the law is that of a place nearby: off a face, or on the side of a cylinder.
    pub is_beyond: bool,
}

impl Atlas {
    /// Energy of a sphere whose centre is at `centre_m` (finite). Real-time: bounded, no allocation.
    #[must_use]
    pub fn answer(&self, centre_m: [f64; 3]) -> Answer {
        let centre = [0, 1, 2].map(|axis| Jet::variable(centre_m[axis], axis));
        let touch = match &self.ground {
            Ground::HalfSpace => Some(Touch {
                depth_m: -centre[2] + self.radius_m,
                ratio: Jet::constant(1.0),
                is_beyond: false,
            }),
            Ground::Block { size, ratios, rounding_m } => {
                self.touch_block(centre, *size, ratios, *rounding_m)
            }
            Ground::Cylinder { radius_m, height_m, ratio, rounding_m } => {
                self.touch_cylinder(centre, [*radius_m, *height_m], ratio, *rounding_m)
            }
            Ground::Face { outline_m, ratio } => self.touch_face(centre, *outline_m, ratio),
        };
        let Some(touch) = touch else {
            return Answer { energy: Jet::default(), depth_m: -1.0, is_beyond: false };
        };
        let (depth_m, is_beyond) = (touch.depth_m.value, touch.is_beyond);
        if depth_m <= 0.0 {
            return Answer { energy: Jet::default(), depth_m, is_beyond: false };
        }
        Answer { energy: self.unbounded(touch.depth_m) * touch.ratio, depth_m, is_beyond }
    }

    /// Root of depth over radius, up to where the ratio ends.
    fn root(&self, depth_m: Jet, ratio: &Volume) -> Jet {
        let value = (depth_m.value / self.radius_m).sqrt();
        ease_at(depth_m.chain(value, 0.5 * value / depth_m.value), ratio.range(2).1, RATIO_END)
    }

    /// Depth and ratio at a plane face; `None` above it.
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
        let is_beyond = (0..2).any(|k| !(outline_m[k][0]..=outline_m[k][1]).contains(&centre[k].value));
        Some(Touch { depth_m, ratio: ratio.at([within(0), within(1), self.root(depth_m, ratio)]), is_beyond })
    }

    /// Depth and ratio at a cylinder; `None` far from it.
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
        let (distance_m, shares) = distance(beyond);
        let depth_m = -distance_m + (self.radius_m + rounding_m);
        if depth_m.value <= 0.0 {
            return None;
        }
        let place = ease_at(from_axis, ratio.range(0).1, rounding_m);
        let ratio = ratio.at([place, Jet::constant(0.0), self.root(depth_m, ratio)]);
        Some(Touch { depth_m, ratio, is_beyond: shares[0].value > 0.5 })
    }

    /// `P(d)`: beyond the deepest, a straight line.
    fn unbounded(&self, depth_m: Jet) -> Jet {
        let within = depth_m.value.min(self.deepest_m);
        let root = (within / self.radius_m).sqrt();
        let (h, slope) = self.profile.at(root);
        let hertz = self.hertz * within * within * within.sqrt();
        let value = hertz * h;
        let derivative = 2.5 * value / within + hertz * slope * 0.5 * root / within;
        depth_m.chain(value + derivative * (depth_m.value - within), derivative)
    }

    /// Depth and ratio at a block; `None` far from it.
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
        let (distance_m, shares) = distance(beyond);
        let depth_m = -distance_m + (self.radius_m + rounding_m);
        if depth_m.value <= 0.0 {
            return None;
        }
        let root = self.root(depth_m, &ratios[0]);
        let across = |axis: usize, volume: &Volume, k: usize| {
            ease_at(smooth_size(middle[axis], 0.0), volume.range(k).1, rounding_m)
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
                // Of the clamped face too, where nothing is to be touched: in the middle of the block the law stays one.
                _ => ratios[0].at([across(0, &ratios[0], 0), across(1, &ratios[0], 1), root]),
            };
            ratio = ratio + share * part;
        }
        Some(Touch { depth_m, ratio, is_beyond: false })
    }
}

/// Size of a number; round at zero, if `blunt` is positive, but for a constant.
fn smooth_size(x: Jet, blunt: f64) -> Jet {
    if x.value.abs() >= blunt { x.abs() } else { (x * x * (1.0 / blunt) + blunt) * 0.5 }
}

/// The number itself up to `knee`, then bent until it stays at `knee + width`, which it reaches at `knee + 2 width`.
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

/// The same, staying at `end`, bent over `width` before it and as much behind.
pub(crate) fn ease_at(x: Jet, end: f64, width: f64) -> Jet {
    let eased = ease(x, end - width, width);
    // Rounding must not leave the table.
    if eased.value > end { Jet::constant(end) } else { eased }
}

/// Distance to a box (negative inside) of the distances beyond its pairs of faces, and the share of each pair in it.
fn distance(beyond: [Jet; 3]) -> (Jet, [Jet; 3]) {
    if beyond.iter().any(|b| b.value >= -NOTHING_M) {
        let outside = beyond.map(|b| b.at_least(0.0));
        let square = outside[0] * outside[0] + outside[1] * outside[1] + outside[2] * outside[2];
        if square.value > NOTHING_M * NOTHING_M {
            let inverse = square.recip();
            return (square.sqrt(), outside.map(|b| b * b * inverse));
        }
        // On the box: the distance along the first such face.
        let first = beyond.iter().position(|b| b.value >= -NOTHING_M).unwrap_or_default();
        let mut shares = [Jet::constant(0.0); 3];
        shares[first] = Jet::constant(1.0);
        return (beyond[first], shares);
    }
    let depths = beyond.map(|b| -b);
    let least =
        depths.iter().copied().fold(depths[0], |least, d| if d.value < least.value { d } else { least });
    let powers = depths.map(|d| {
        let mut power = least / d;
        for _ in 0..SHARPNESS_ROOTS {
            power = power * power;
        }
        power
    });
    let inverse = (powers[0] + powers[1] + powers[2]).recip();
    let mut root = inverse;
    for _ in 0..SHARPNESS_ROOTS {
        root = root.sqrt();
    }
    (-(least * root), powers.map(|power| power * inverse))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spline::End;

    /// A law whose ratio is one everywhere: only distance and depth are left.
    fn even() -> Atlas {
        let size = Size { half_x_m: 0.02, half_y_m: 0.03, height_m: 0.05 };
        let even = |a: f64, low: f64, high: f64| {
            let nodes = [vec![0.0, 0.5 * a, a], vec![low, 0.5 * (low + high), high], vec![0.0, 0.5, 1.0]];
            Volume::new(nodes, &[1.0; 27], [[End::Parabola; 2]; 3])
        };
        let ratios =
            Box::new([even(0.018, 0.0, 0.028), even(0.028, -0.048, -0.002), even(0.018, -0.048, -0.002)]);
        Atlas {
            radius_m: 0.005,
            hertz: 1.0,
            profile: Curve::new(vec![0.0, 0.5, 1.2], vec![1.0; 3], [End::Parabola; 2]),
            deepest_m: 0.006,
            ground: Ground::Block { size, ratios, rounding_m: 0.001 },
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
