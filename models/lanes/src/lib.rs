//! SIMD numerics: formulas that run on one pose, or on several poses side by side.
//!
//! The laws of a model are written once, over any [`Real`]: `f64` for the servo's one pose, [`Wide`] for a batch, several
//! poses in the lanes of one vector register. Every operation rounds as IEEE 754 says, in the order written, and no product is
//! fused with a sum, so a lane of a batch holds *the same bits* as the scalar law, on every machine.
//!
//! A comparison returns a mask, a truth value per lane. Rare cases (strong tension, saturation, one plate below the
//! other) are guarded by `if R::any(mask)`: for one pose an ordinary branch; for several poses a branch taken if any lane
//! needs the rare case, after which [`Real::select`] restores the other lanes.
//!
//! Modules over [`Real`], without the functions of a math library: [`angle`] computes squared angles and twists, [`arctangent`]
//! angles from sides of triangles, and [`saturation`] limits a quantity below a pole. [`entire`] and [`stability`] compute the
//! functions of a loaded column. [`chebyshev`] interpolates by polynomials, [`basis`] has polynomials of a field along a rod,
//! [`matrix`] solves small symmetric systems, and [`tipped`] minimises an energy with a kink.
//!
//! The lanes come from the crate `pulp`, which detects the instruction set of the machine at run time.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

use pulp::Simd;

pub mod angle;
pub mod arctangent;
pub mod basis;
pub mod chebyshev;
pub mod entire;
pub mod matrix;
pub mod saturation;
pub mod stability;
pub mod tipped;

/// Marks functions `#[inline(always)]`. Lane functions use the instructions of an instruction set only if they are
/// inlined into code compiled for that set. With `#[inline]` alone a batch executes ten times as many instructions (per
/// pose 3436 instead of 326 for `energy`, 1961 instead of 192 for `closed-form`; tests/instructions). The same applies
/// to the laws over [`Real`].
macro_rules! in_lanes {
    ($($(#[$meta:meta])* $visibility:vis fn $name:ident $arguments:tt -> $result:ty $body:block)*) => {
        $($(#[$meta])* #[inline(always)] $visibility fn $name $arguments -> $result $body)*
    };
}

/// Real number, or one real number per SIMD lane. All methods are real-time: bounded, no allocation.
pub trait Real:
    Copy
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// Truth value per lane.
    type Mask: Copy + BitAnd<Output = Self::Mask> + BitOr<Output = Self::Mask>;

    /// Returns a number with as many lanes as `self` and `value` in every lane.
    #[must_use]
    fn like(self, value: f64) -> Self;

    /// Returns the square root, correctly rounded.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Returns the absolute value.
    #[must_use]
    fn abs(self) -> Self;

    /// Compares each lane with a bound: true below; false for NaN.
    #[must_use]
    fn below(self, bound: f64) -> Self::Mask;

    /// Compares each lane with a bound: true above; false for NaN.
    #[must_use]
    fn above(self, bound: f64) -> Self::Mask;

    /// Selects `yes` or `no` lane by lane.
    #[must_use]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Returns true if any lane is true.
    #[must_use]
    fn any(mask: Self::Mask) -> bool;

    /// Applies a scalar function to every lane, one after the other: for cases too rare to vectorise.
    #[must_use]
    fn map(self, function: impl Fn(f64) -> f64) -> Self;

    /// Returns the reciprocal.
    #[inline(always)]
    #[must_use]
    fn inverse(self) -> Self {
        self.like(1.0) / self
    }

    /// Returns the larger of the number and the floor; the floor for NaN.
    #[inline(always)]
    #[must_use]
    fn at_least(self, floor: f64) -> Self {
        Self::select(self.above(floor), self, self.like(floor))
    }

    /// Returns the smaller of the number and the ceiling; the ceiling for NaN.
    #[inline(always)]
    #[must_use]
    fn at_most(self, ceiling: f64) -> Self {
        Self::select(self.below(ceiling), self, self.like(ceiling))
    }

    /// Returns true for lanes that are neither infinite nor NaN.
    #[inline(always)]
    #[must_use]
    fn finite(self) -> Self::Mask {
        self.abs().below(f64::INFINITY)
    }
}

impl Real for f64 {
    type Mask = bool;

    #[inline]
    fn like(self, value: f64) -> Self {
        value
    }

    #[inline]
    fn sqrt(self) -> Self {
        self.sqrt()
    }

    #[inline]
    fn abs(self) -> Self {
        self.abs()
    }

    #[inline]
    fn below(self, bound: f64) -> bool {
        self < bound
    }

    #[inline]
    fn above(self, bound: f64) -> bool {
        self > bound
    }

    #[inline]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }

    #[inline]
    fn any(mask: bool) -> bool {
        mask
    }

    #[inline]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        function(self)
    }
}

/// SIMD register of `f64` numbers for the instruction set `S`.
#[derive(Clone, Copy, Debug)]
pub struct Wide<S: Simd> {
    simd: S,
    lanes: S::f64s,
}

impl<S: Simd> Wide<S> {
    in_lanes! {
        /// Wraps a register.
        #[must_use]
        pub fn new(simd: S, lanes: S::f64s) -> Self {
            Self { simd, lanes }
        }

        /// Returns the register.
        #[must_use]
        pub fn lanes(self) -> S::f64s {
            self.lanes
        }
    }
}

/// Truth values of the lanes of a [`Wide`].
#[derive(Clone, Copy, Debug)]
pub struct WideMask<S: Simd> {
    simd: S,
    lanes: S::m64s,
}

impl<S: Simd> BitAnd for WideMask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self { lanes: self.simd.and_m64s(self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd> BitOr for WideMask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self { lanes: self.simd.or_m64s(self.lanes, other.lanes), ..self }
    }
}

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { lanes: self.simd.neg_f64s(self.lanes), ..self }
    }
}

/// Implements an arithmetic operator between lanes, and between lanes and a scalar.
macro_rules! lane_operator {
    ($($trait:ident $method:ident $instruction:ident),*) => {$(
        impl<S: Simd> $trait for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { lanes: self.simd.$instruction(self.lanes, other.lanes), ..self }
            }
        }

        impl<S: Simd> $trait<f64> for Wide<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.$method(self.like(other))
            }
        }
    )*};
}

lane_operator!(Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);

impl<S: Simd> Real for Wide<S> {
    type Mask = WideMask<S>;

    in_lanes! {
        fn like(self, value: f64) -> Self {
            Self { lanes: self.simd.splat_f64s(value), ..self }
        }

        fn sqrt(self) -> Self {
            Self { lanes: self.simd.sqrt_f64s(self.lanes), ..self }
        }

        fn abs(self) -> Self {
            Self { lanes: self.simd.abs_f64s(self.lanes), ..self }
        }

        fn below(self, bound: f64) -> WideMask<S> {
            let lanes = self.simd.less_than_f64s(self.lanes, self.simd.splat_f64s(bound));
            WideMask { simd: self.simd, lanes }
        }

        fn above(self, bound: f64) -> WideMask<S> {
            let lanes = self.simd.less_than_f64s(self.simd.splat_f64s(bound), self.lanes);
            WideMask { simd: self.simd, lanes }
        }

        fn select(mask: WideMask<S>, yes: Self, no: Self) -> Self {
            Self { lanes: mask.simd.select_f64s(mask.lanes, yes.lanes, no.lanes), ..yes }
        }

        fn any(mask: WideMask<S>) -> bool {
            pulp::bytemuck::bytes_of(&mask.lanes).iter().fold(0, |any, byte| any | byte) != 0
        }

        fn map(self, function: impl Fn(f64) -> f64) -> Self {
            let mut lanes = self.lanes;
            for lane in pulp::bytemuck::cast_slice_mut::<S::f64s, f64>(std::slice::from_mut(&mut lanes)) {
                *lane = function(*lane);
            }
            Self { lanes, ..self }
        }
    }
}

/// Two numbers, or two registers, computed together: while one waits for a division, the processor computes the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair<R>(pub R, pub R);

impl<R: BitAnd<Output = R>> BitAnd for Pair<R> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0, self.1 & other.1)
    }
}

impl<R: BitOr<Output = R>> BitOr for Pair<R> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0, self.1 | other.1)
    }
}

impl<R: Real> Neg for Pair<R> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

/// Implements the operators of a pair from those of its parts.
macro_rules! pair_operator {
    ($($trait:ident $method:ident),*) => {$(
        impl<R: Real> $trait for Pair<R> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0), self.1.$method(other.1))
            }
        }
    )*};
}

/// Implements the operators between a pair and a scalar.
macro_rules! pair_operator_by_number {
    ($($trait:ident $method:ident),*) => {$(
        impl<R: Real> $trait<f64> for Pair<R> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                Self(self.0.$method(other), self.1.$method(other))
            }
        }
    )*};
}

pair_operator!(Add add, Sub sub, Mul mul, Div div);
pair_operator_by_number!(Add add, Sub sub, Mul mul);

impl<R: Real> Real for Pair<R> {
    type Mask = Pair<R::Mask>;

    in_lanes! {
        fn like(self, value: f64) -> Self {
            Self(self.0.like(value), self.1.like(value))
        }

        fn sqrt(self) -> Self {
            Self(self.0.sqrt(), self.1.sqrt())
        }

        fn abs(self) -> Self {
            Self(self.0.abs(), self.1.abs())
        }

        fn below(self, bound: f64) -> Self::Mask {
            Pair(self.0.below(bound), self.1.below(bound))
        }

        fn above(self, bound: f64) -> Self::Mask {
            Pair(self.0.above(bound), self.1.above(bound))
        }

        fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
            Self(R::select(mask.0, yes.0, no.0), R::select(mask.1, yes.1, no.1))
        }

        fn any(mask: Self::Mask) -> bool {
            R::any(mask.0 | mask.1)
        }

        fn map(self, function: impl Fn(f64) -> f64) -> Self {
            Self(self.0.map(&function), self.1.map(&function))
        }
    }
}

/// Returns a polynomial and its derivative at `x`. `powers`: coefficients from the constant on, an even number of at
/// least four. Even and odd powers are summed separately, for short dependency chains. Real-time: bounded, no
/// allocation, no branch.
#[inline(always)]
#[must_use]
pub fn polynomial<R: Real, const TERMS: usize>(x: R, powers: &[f64; TERMS]) -> [R; 2] {
    // Horner in x² for even and odd powers at once, value and derivative.
    let square = x * x;
    let (mut even_slope, mut odd_slope) = (x.like(powers[TERMS - 2]), x.like(powers[TERMS - 1]));
    let (mut even, mut odd) =
        (even_slope * square + powers[TERMS - 4], odd_slope * square + powers[TERMS - 3]);
    let (lower, _) = powers[..TERMS - 4].as_chunks::<2>();
    for [even_power, odd_power] in lower.iter().rev() {
        even_slope = even_slope * square + even;
        odd_slope = odd_slope * square + odd;
        even = even * square + *even_power;
        odd = odd * square + *odd_power;
    }
    [odd * x + even, (odd_slope * x + even_slope) * (x + x) + odd]
}

/// Vector of three [`Real`] components.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<R> {
    /// Component along x.
    pub x: R,
    /// Component along y.
    pub y: R,
    /// Component along z.
    pub z: R,
}

impl<R: Real> Vector<R> {
    in_lanes! {
        /// Creates a vector from its components.
        #[must_use]
        pub fn new(x: R, y: R, z: R) -> Self {
            Self { x, y, z }
        }

        /// Returns the inner product.
        #[must_use]
        pub fn dot(self, other: Self) -> R {
            self.x * other.x + self.y * other.y + self.z * other.z
        }

        /// Returns the cross product.
        #[must_use]
        pub fn cross(self, other: Self) -> Self {
            Self {
                x: self.y * other.z - other.y * self.z,
                y: self.z * other.x - other.z * self.x,
                z: self.x * other.y - other.x * self.y,
            }
        }
    }
}

impl<R: Real> Add for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<R: Real> Sub for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<R: Real> Mul<R> for Vector<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: R) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

#[cfg(test)]
mod tests;
