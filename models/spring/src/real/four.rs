//! Four numbers that go through the same formula.
//!
//! Several poses fill the lanes of a register by themselves. One pose alone leaves all but one of them empty, unless its
//! formula has four like numbers at hand: four coefficients by powers of one length, or four angles by the same series.
//! Written over [`Four`] these share a register where one pose has lanes ([`Lone`]), and are computed one after the other
//! where the lanes are taken by other poses. *The same bits* either way.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::{Simd, f64x4};

use super::{Real, Wide};

/// Four numbers. Everything on them is real-time: bounded, no allocation.
pub trait Four<R>: Copy + Add<Output = Self> + Mul<Output = Self> + Mul<R, Output = Self> {
    /// The product with a factor each and the sum with a term each, rounded once.
    #[must_use]
    fn mul_add(self, factor: Self, term: Self) -> Self;

    /// A polynomial of each, by powers from the constant on, and its derivative.
    #[must_use]
    fn polynomials<const TERMS: usize>(self, coefficients: &[[f64; 4]; TERMS]) -> [Self; 2];

    /// From its numbers.
    #[must_use]
    fn of(numbers: [R; 4]) -> Self;

    /// Four values, in as many lanes as `like` has.
    #[must_use]
    fn like(like: R, values: &[f64; 4]) -> Self;

    /// Its numbers.
    #[must_use]
    fn numbers(self) -> [R; 4];
}

/// One after the other.
#[derive(Clone, Copy, Debug)]
pub struct Each<R>([R; 4]);

impl<R: Real> Add for Each<R> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a + e, b + f, c + g, d + h])
    }
}

impl<R: Real> Mul for Each<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h]) = (self.0, other.0);
        Self([a * e, b * f, c * g, d * h])
    }
}

impl<R: Real> Mul<R> for Each<R> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: R) -> Self {
        let [a, b, c, d] = self.0;
        Self([a * factor, b * factor, c * factor, d * factor])
    }
}

impl<R: Real> Each<R> {
    /// The polynomial of one of them. Leading zeros are left out, which changes no bit.
    #[inline(always)]
    fn polynomial<const TERMS: usize>(self, which: usize, coefficients: &[[f64; 4]; TERMS]) -> [R; 2] {
        let x = self.0[which];
        let [mut value, mut slope] = [x.like(0.0); 2];
        let mut is_leading = true;
        for powers in coefficients.iter().rev() {
            is_leading &= powers[which] == 0.0;
            if !is_leading {
                slope = slope.mul_add(x, value);
                value = value.mul_add(x, x.like(powers[which]));
            }
        }
        [value, slope]
    }
}

impl<R: Real> Four<R> for Each<R> {
    #[inline(always)]
    fn polynomials<const TERMS: usize>(self, coefficients: &[[f64; 4]; TERMS]) -> [Self; 2] {
        // One after the other: together they would need more registers than there are.
        let [a, a_slope] = self.polynomial(0, coefficients);
        let [b, b_slope] = self.polynomial(1, coefficients);
        let [c, c_slope] = self.polynomial(2, coefficients);
        let [d, d_slope] = self.polynomial(3, coefficients);
        [Self([a, b, c, d]), Self([a_slope, b_slope, c_slope, d_slope])]
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        let ([a, b, c, d], [e, f, g, h], [i, j, k, l]) = (self.0, factor.0, term.0);
        Self([a.mul_add(e, i), b.mul_add(f, j), c.mul_add(g, k), d.mul_add(h, l)])
    }

    #[inline(always)]
    fn of(numbers: [R; 4]) -> Self {
        Self(numbers)
    }

    #[inline(always)]
    fn like(like: R, [a, b, c, d]: &[f64; 4]) -> Self {
        Self([like.like(*a), like.like(*b), like.like(*c), like.like(*d)])
    }

    #[inline(always)]
    fn numbers(self) -> [R; 4] {
        self.0
    }
}

/// The number of one pose, on a machine whose registers hold four.
#[derive(Clone, Copy, Debug)]
pub struct Lone<S> {
    simd: S,
    number: f64,
}

impl<S: Simd<f64s = f64x4>> Lone<S> {
    /// The number of one pose.
    #[inline(always)]
    #[must_use]
    pub fn new(simd: S, number: f64) -> Self {
        Self { simd, number }
    }

    #[inline(always)]
    fn with(self, number: f64) -> Self {
        Self { number, ..self }
    }
}

impl<S> From<Lone<S>> for f64 {
    #[inline(always)]
    fn from(lone: Lone<S>) -> f64 {
        lone.number
    }
}

impl<S: Simd<f64s = f64x4>> Neg for Lone<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(-self.number)
    }
}

/// An arithmetic operator, with another number of the pose and with one that is the same for all poses.
macro_rules! lone_operator {
    ($($trait:ident $method:ident),*) => {$(
        impl<S: Simd<f64s = f64x4>> $trait for Lone<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.number.$method(other.number))
            }
        }

        impl<S: Simd<f64s = f64x4>> $trait<f64> for Lone<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.with(self.number.$method(other))
            }
        }
    )*};
}

lone_operator!(Add add, Sub sub, Mul mul, Div div);

impl<S: Simd<f64s = f64x4>> Real for Lone<S> {
    type Mask = bool;
    type Four = Wide<S>;

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        self.with(value)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.number.sqrt())
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        self.with(self.number.mul_add(factor.number, term.number))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.number.abs())
    }

    #[inline(always)]
    fn below(self, bound: f64) -> bool {
        self.number < bound
    }

    #[inline(always)]
    fn above(self, bound: f64) -> bool {
        self.number > bound
    }

    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }

    #[inline(always)]
    fn any(mask: bool) -> bool {
        mask
    }

    #[inline(always)]
    fn map(self, function: impl Fn(f64) -> f64) -> Self {
        self.with(function(self.number))
    }
}

impl<S: Simd<f64s = f64x4>> Mul<Lone<S>> for Wide<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Lone<S>) -> Self {
        self * factor.number
    }
}

impl<S: Simd<f64s = f64x4>> Four<Lone<S>> for Wide<S> {
    #[inline(always)]
    fn polynomials<const TERMS: usize>(self, coefficients: &[[f64; 4]; TERMS]) -> [Self; 2] {
        let [mut value, mut slope] = [Real::like(self, 0.0); 2];
        for [a, b, c, d] in coefficients.iter().rev() {
            slope = Real::mul_add(slope, self, value);
            value = Real::mul_add(value, self, Self { lanes: f64x4(*a, *b, *c, *d), ..self });
        }
        [value, slope]
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Real::mul_add(self, factor, term)
    }

    #[inline(always)]
    fn of([a, b, c, d]: [Lone<S>; 4]) -> Self {
        Self { simd: a.simd, lanes: f64x4(a.number, b.number, c.number, d.number) }
    }

    #[inline(always)]
    fn like(like: Lone<S>, [a, b, c, d]: &[f64; 4]) -> Self {
        Self { simd: like.simd, lanes: f64x4(*a, *b, *c, *d) }
    }

    #[inline(always)]
    fn numbers(self) -> [Lone<S>; 4] {
        let f64x4(a, b, c, d) = self.lanes;
        let simd = self.simd;
        [Lone::new(simd, a), Lone::new(simd, b), Lone::new(simd, c), Lone::new(simd, d)]
    }
}
