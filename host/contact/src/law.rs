//! Laws of a single contact: the force along the normal, and the friction across it.

/// Force along the normal as a function of depth: 0 up to `start_m`, then steeper up to `knee_m` than beyond it.
///
/// Spring and damper: with approach speed `v` and stiffness `k`, the force is `k d + b v` and never below 0. A contact that is
/// younger than a period cannot have approached for all of it, so the damping force is at most `b d / period`: the force starts
/// at 0 and is a continuous, non-decreasing function of depth, the derivative of a convex energy.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct NormalLaw {
    start_m: f64,
    knee_m: f64,
    first_n_per_m: f64,
    then_n_per_m: f64,
}

impl NormalLaw {
    /// Creates the law for a tick; `damping_n_per_m` is damping divided by the period.
    #[inline]
    pub(crate) fn new(stiffness_n_per_m: f64, damping_n_per_m: f64, approach_m: f64) -> Self {
        let then_n_per_m = stiffness_n_per_m;
        if approach_m < 0.0 {
            let start_m = -approach_m * (damping_n_per_m / stiffness_n_per_m);
            Self { start_m, knee_m: start_m, first_n_per_m: then_n_per_m, then_n_per_m }
        } else {
            let first_n_per_m = stiffness_n_per_m + damping_n_per_m;
            Self { start_m: 0.0, knee_m: approach_m, first_n_per_m, then_n_per_m }
        }
    }

    /// Returns the force, N, and its slope, N/m.
    #[inline]
    pub(crate) fn at(&self, depth_m: f64) -> (f64, f64) {
        if depth_m <= self.start_m {
            (0.0, 0.0)
        } else if depth_m < self.knee_m {
            (self.first_n_per_m * (depth_m - self.start_m), self.first_n_per_m)
        } else {
            let at_knee = self.first_n_per_m * (self.knee_m - self.start_m);
            (at_knee + self.then_n_per_m * (depth_m - self.knee_m), self.then_n_per_m)
        }
    }
}

/// Friction as a function of the stretch of the tangential spring: linear up to a limit, constant beyond (Huber's function is
/// the energy).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FrictionLaw {
    pub(crate) stiffness_n_per_m: f64,
    pub(crate) limit_n: f64,
}

/// Friction at a stretch.
pub(crate) struct Friction {
    /// Fraction of the stretch that the spring holds within the friction limit, 0 to 1.
    pub(crate) held: f64,
    /// Direction of the stretch while the contact slides.
    pub(crate) sliding: Option<[f64; 2]>,
}

impl FrictionLaw {
    /// Returns the friction at a stretch, m.
    #[inline]
    pub(crate) fn at(&self, [first, second]: [f64; 2]) -> Friction {
        let square = first * first + second * second;
        let trial_n = self.stiffness_n_per_m;
        if trial_n * trial_n * square <= self.limit_n * self.limit_n {
            return Friction { held: 1.0, sliding: None };
        }
        let length = square.sqrt();
        Friction { held: self.limit_n / (trial_n * length), sliding: Some([first / length, second / length]) }
    }
}
