//! Variant `thesis`: the printed code with every branch, window and jump, for comparison.
//!
//! This is `springControl()` of the thesis's appendix A, expression by expression: the four modes of `change`,
//! three branches (buckled, elongation, compression), the window of 1e-4 mm around the free length, the buckling
//! rule of section 3.2 (from `L <= L_buckling` on a tenth of the vertical force and nothing else), and the sum
//! `M_U + M_L` with the printed signs. The other parts of the appendix are not in this law: the device has calibration
//! polynomial, feed-forward and damping, the host has the limits of position and angle, and the scene's mapping has the scaling
//! of device travel to the free length. The law starts from simulation coordinates.
//!
//! The printed code works in millimetres, and so does this module inside; its names are the thesis's. Poses come
//! in and wrenches go out in the model frame: X, Z, Y are x, y, z; `fwpos[3]` and `fwpos[4]` are `-rx` and `-ry`,
//! `force[3]` and `force[4]` are minus the torques about x and y in N·mm (PHYSICS D9, D12).
//!
//! **Yaw.** The source sets `force[5] = -spring_limit[1] * yaw` with a gain from a control panel. The thesis prints no value of the
//! gain, so the gain is zero here.
//!
//! **Finite outputs.** The printed code may return NaN or infinity. Here every such output is zero with
//! [`Validity::OutOfDomain`]:
//! - both moments (not the forces) where `L == L0` in the arithmetic used, at rest and sheared (0/0);
//! - everything for `L > L0 (1 + E/G)`, where `q` is the square root of a negative number;
//! - everything at `L = 0` if `L_buckling < 0`, where no branch runs and the outputs are uninitialised.
//!
//! An invalid pose (NaN, infinity, no unit quaternion) gives zero with [`Validity::InvalidInput`].
//!
//! **Precision.** In C, `float` operands are combined in `float`, a `double` operand or a function of the math
//! library makes the expression double, and an assignment rounds to `float`. `CFloat` reproduces these usual
//! conversions (FLT_EVAL_METHOD 0, no contraction); with `f64` for the type all of it is double.

use std::ops::{Add, Div, Mul, Neg, Sub};

use flotor_hal::glam::DVec3;
use flotor_hal::math;

use crate::pose::Pose;
use crate::precision::Precision;
use crate::response::{Demand, Response};
use crate::rigidity::{Geometry, Material, Spring, Stiffness};
use crate::validity::Validity;

/// Half width of the window around the free length in which the limit of `H` is used (mm), appendix A.
const WINDOW_MM: f64 = 1e-4;

/// Value of pi as appendix A declares it.
#[allow(clippy::approx_constant)] // its digits are part of the printed law
const PRINTED_PI: f64 = 3.14159265;

const MM_PER_M: f64 = 1e3;
const NM_PER_NMM: f64 = 1e-3;

/// Printed law of one spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thesis {
    constants: Constants,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Constants {
    Single(Printed<f32>),
    Double(Printed<f64>),
}

impl Thesis {
    /// Prepares the law: derives the constants, which the printed code derives again in every tick, with the same result.
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn new(spring: &Spring, stiffness: Stiffness, precision: Precision) -> Self {
        let (geometry, material) = (spring.geometry(), spring.material());
        let constants = match precision {
            Precision::Single => Constants::Single(Printed::new(geometry, material, stiffness)),
            Precision::Double => Constants::Double(Printed::new(geometry, material, stiffness)),
        };
        Self { constants }
    }

    /// Returns the length at which the printed code declares the spring buckled (m); negative if never.
    #[must_use]
    pub fn buckling_length_m(&self) -> f64 {
        let length_mm = match &self.constants {
            Constants::Single(law) => f64::from(law.buckling_length),
            Constants::Double(law) => law.buckling_length,
        };
        length_mm / MM_PER_M
    }

    /// Returns the wrench on the hand at a pose; this law has no energy. Always finite: an output without a finite value is zero
    /// with [`Validity::OutOfDomain`], and an invalid pose gives zero with [`Validity::InvalidInput`] (see the module
    /// documentation). Real-time: bounded, no allocation.
    pub fn respond(&self, pose: &Pose, demand: Demand) -> Response {
        if !pose.is_valid() {
            return Response::none(Validity::InvalidInput);
        }
        let at = Handle { position_mm: pose.position_m * MM_PER_M, rotation_rad: pose.rotation_vector_rad() };
        let outputs = match &self.constants {
            Constants::Single(law) => law.control(&at, demand).map(Outputs::response),
            Constants::Double(law) => law.control(&at, demand).map(Outputs::response),
        };
        outputs.unwrap_or(Response::none(Validity::OutOfDomain))
    }
}

/// Pose of the handle, in the thesis's millimetres.
struct Handle {
    position_mm: DVec3,
    rotation_rad: DVec3,
}

/// A floating type of C, with its usual conversions.
trait CFloat:
    Copy
    + PartialOrd
    + Into<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// Assigns a double.
    fn store(value: f64) -> Self;

    /// Converts to double, as beside a double operand.
    fn wide(self) -> f64 {
        self.into()
    }
}

impl CFloat for f32 {
    #[allow(clippy::cast_possible_truncation)] // what an assignment does in C
    fn store(value: f64) -> Self {
        value as Self
    }
}

impl CFloat for f64 {
    fn store(value: f64) -> Self {
        value
    }
}

/// Printed function with its parameters: mm, N, N·mm², the names of appendix A.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Printed<T> {
    free_length: T,
    alpha: T,
    beta: T,
    gamma: T,
    buckling_length: T,
}

/// Outputs of the printed function: forces (N) and moments (N·mm).
struct Outputs<T> {
    force_x: T,
    force_y: T,
    force_z: T,
    /// `force[3]`
    moment_x: T,
    /// `force[4]`
    moment_z: T,
}

/// Angles of the rod's ends against the chord in one plane: `si1` and `si2`.
#[derive(Clone, Copy)]
struct EndAngles<T> {
    upper: T,
    lower: T,
}

/// Internal reactions of a rod that has not buckled. `m1` is the moment of the upper end.
struct Reaction<T> {
    p: T,
    hx: T,
    hz: T,
    m1z: T,
    m1x: T,
}

impl<T: CFloat> Printed<T> {
    /// Evaluates `switch (change)` and the buckling length.
    fn new(geometry: &Geometry, material: &Material, stiffness: Stiffness) -> Self {
        let millimetres = |metres: f64| T::store(metres * MM_PER_M);
        let megapascals = |pascals: f64| T::store(pascals / 1e6);
        let free_length = millimetres(geometry.free_length_m);
        let wire = millimetres(geometry.wire_diameter_m);
        let coil = millimetres(geometry.coil_diameter_m);
        let n = T::store(geometry.active_coils);
        let e = megapascals(material.youngs_modulus_pa);
        let g = megapascals(material.shear_modulus_pa);

        let [one, two, four, eight] = [1.0, 2.0, 4.0, 8.0].map(T::store);
        let coil2 = coil.wide() * coil.wide();
        let bending_ratio = four * g / e + two;
        let shear_ratio = four + two * e / g;
        let (alpha, beta, gamma) = match stiffness {
            Stiffness::Gamma(gamma_n) => {
                let gamma = T::store(gamma_n);
                (T::store(gamma.wide() * coil2 / bending_ratio.wide()), gamma * e / g, gamma)
            }
            Stiffness::Alpha(alpha_n_m2) => {
                let alpha = T::store(alpha_n_m2 * 1e6);
                let per_coil = |ratio: T| T::store((alpha * ratio).wide() / coil2);
                (alpha, per_coil(shear_ratio), per_coil(bending_ratio))
            }
            Stiffness::Beta(beta_n) => {
                let beta = T::store(beta_n);
                (T::store(beta.wide() * coil2 / shear_ratio.wide()), beta, beta * g / e)
            }
            Stiffness::Physical => {
                let wire2 = wire.wide() * wire.wide();
                let common = free_length.wide() * (wire2 * wire2);
                let bending = T::store(32.0) * n * coil * (one + e / (two * g));
                let coils = (eight * n).wide() * (coil2 * coil.wide());
                (
                    T::store(common * e.wide() / bending.wide()),
                    T::store(common * e.wide() / coils),
                    T::store(common * g.wide() / coils),
                )
            }
        };
        let pi = T::store(PRINTED_PI).wide();
        // Buckling: P (1 + P / beta) = 4 pi² alpha / L0², equation 19 at q L0 = 2 pi (equation 20), and its length.
        let root = (beta.wide() * beta.wide()
            + 16.0 * (pi * pi) * alpha.wide() * beta.wide() / (free_length.wide() * free_length.wide()))
        .sqrt();
        let buckling_p = T::store(((-beta).wide() + root) / 2.0);
        let buckling_length = free_length - buckling_p * free_length / gamma;
        Self { free_length, alpha, beta, gamma, buckling_length }
    }

    /// Evaluates `springControl()`; `None` where no branch runs.
    #[inline]
    fn control(&self, at: &Handle, demand: Demand) -> Option<Outputs<T>> {
        let l0 = self.free_length;
        let [shear_x, shear_z, compress_y] = at.position_mm.to_array().map(T::store);
        let vertical = l0 + compress_y;
        let square = |x: T| x.wide() * x.wide();
        let l = T::store((square(vertical) + square(shear_x) + square(shear_z)).sqrt());

        let zero = T::store(0.0);
        if l <= self.buckling_length {
            let force_y = self.gamma * (l0 - l) / (T::store(10.0) * l0);
            return Some(Outputs { force_x: zero, force_y, force_z: zero, moment_x: zero, moment_z: zero });
        }
        let pitch = T::store(-at.rotation_rad.x);
        let roll = T::store(at.rotation_rad.y);
        let lower_z = T::store(math::atan((shear_x / vertical).wide()));
        let lower_x = T::store(math::atan((shear_z / vertical).wide()));
        let z = EndAngles { upper: lower_z - roll, lower: lower_z };
        let x = EndAngles { upper: lower_x - pitch, lower: lower_x };
        let reaction = if l > l0 && l > zero {
            self.elongated(l, z, x, demand)
        } else if l <= l0 && l > zero {
            self.compressed(l, z, x, demand)
        } else {
            return None;
        };
        Some(reaction.on_hand(l, z, x, demand))
    }

    fn elongated(&self, l: T, z: EndAngles<T>, x: EndAngles<T>, demand: Demand) -> Reaction<T> {
        let Self { free_length: l0, alpha, beta, gamma, .. } = *self;
        let [one, two] = [1.0, 2.0].map(T::store);
        let p = gamma * (l0 - l) / l0;
        // q of equation 19 in tension, H' of equation 71, M' of equation 72; near the free length H of equation 76.
        let q = T::store((-(p / alpha) * (one + p / beta)).wide().sqrt());
        let tanh = math::tanh((q * l / two).wide());
        let (hx, hz) = if l.wide() < l0.wide() + WINDOW_MM {
            self.limit(l, z, x)
        } else {
            let load = (-l * p).wide();
            // The source multiplies in different order for X and Z (PHYSICS D22).
            let share_x = load / (tanh * alpha.wide() * q.wide());
            let share_z = load / ((alpha * q).wide() * tanh);
            (
                T::store((p * (z.upper + z.lower)).wide() / (share_x - 2.0)),
                T::store((p * (x.upper + x.lower)).wide() / (share_z - 2.0)),
            )
        };
        let zero = T::store(0.0);
        if demand < Demand::Wrench {
            return Reaction { p, hx, hz, m1z: zero, m1x: zero };
        }
        let sinh = math::sinh((q * l).wide());
        let moment =
            |h: T, upper: T| T::store((((h / p + upper) * alpha * q).wide() + (h * l).wide() / sinh) / tanh);
        Reaction { p, hx, hz, m1z: moment(hx, z.upper), m1x: moment(hz, x.upper) }
    }

    fn compressed(&self, l: T, z: EndAngles<T>, x: EndAngles<T>, demand: Demand) -> Reaction<T> {
        let Self { free_length: l0, alpha, beta, gamma, .. } = *self;
        let [one, two] = [1.0, 2.0].map(T::store);
        let p = gamma * (l0 - l) / l0;
        // q of equation 19, H of equation 48, M of equation 49; near the free length H of equation 76.
        let q = T::store(((p / alpha) * (one + p / beta)).wide().sqrt());
        let tan = math::tan((q * l / two).wide());
        let (hx, hz) = if l.wide() > l0.wide() - WINDOW_MM {
            self.limit(l, z, x)
        } else {
            let share = (l * p).wide() / (tan * alpha.wide() * q.wide()) - 2.0;
            (
                T::store((p * (z.upper + z.lower)).wide() / share),
                T::store((p * (x.upper + x.lower)).wide() / share),
            )
        };
        let zero = T::store(0.0);
        if demand < Demand::Wrench {
            return Reaction { p, hx, hz, m1z: zero, m1x: zero };
        }
        let sin = math::sin((q * l).wide());
        let moment =
            |h: T, upper: T| T::store(((alpha * q * (h / p + upper)).wide() - (h * l).wide() / sin) / tan);
        Reaction { p, hx, hz, m1z: moment(hx, z.upper), m1x: moment(hz, x.upper) }
    }

    /// Returns `H` as `L -> L0` and `P -> 0`, equation 76.
    fn limit(&self, l: T, z: EndAngles<T>, x: EndAngles<T>) -> (T, T) {
        let Self { alpha, beta, .. } = *self;
        let bending = beta.wide() * (l.wide() * l.wide()) / (T::store(12.0) * alpha).wide();
        let h = |ends: EndAngles<T>| {
            T::store((-beta * (ends.upper + ends.lower)).wide() / (2.0 * (1.0 + bending)))
        };
        (h(z), h(x))
    }
}

impl<T: CFloat> Reaction<T> {
    /// Applies the printed "Transformation of axes", and sums the moments.
    #[inline]
    fn on_hand(&self, l: T, z: EndAngles<T>, x: EndAngles<T>, demand: Demand) -> Outputs<T> {
        let Self { p, hx, hz, m1z, m1x } = *self;
        let turn = |h: T, along: T, lower: T| {
            let (sin, cos) = math::sin_cos(lower.wide());
            (T::store(h.wide() * cos + along.wide() * sin), T::store(along.wide() * cos - h.wide() * sin))
        };
        let (force_x, inter_force_y) = turn(hx, p, z.lower);
        let (force_z, force_y) = turn(hz, inter_force_y, x.lower);
        let (moment_x, moment_z) = if demand >= Demand::Wrench {
            let (m2z, m2x) = (m1z + hx * l, m1x + hz * l);
            (m1x + m2x, -m1z - m2z)
        } else {
            (T::store(0.0), T::store(0.0))
        };
        Outputs { force_x, force_y, force_z, moment_x, moment_z }
    }
}

impl<T: CFloat> Outputs<T> {
    /// Converts to the model frame, with zero for numbers that are not finite.
    #[inline]
    fn response(self) -> Response {
        let force_n = DVec3::new(self.force_x.wide(), self.force_z.wide(), self.force_y.wide());
        let torque_nm = DVec3::new(self.moment_x.wide(), self.moment_z.wide(), 0.0) * -NM_PER_NMM;
        if force_n.is_finite() && torque_nm.is_finite() {
            return Response { force_n, torque_nm, energy_j: None, validity: Validity::Ok };
        }
        let answered = |v: DVec3| DVec3::select(v.is_finite_mask(), v, DVec3::ZERO);
        Response {
            force_n: answered(force_n),
            torque_nm: answered(torque_nm),
            energy_j: None,
            validity: Validity::OutOfDomain,
        }
    }
}

#[cfg(test)]
mod tests;
