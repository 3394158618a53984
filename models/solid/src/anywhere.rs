//! Law of a ball anywhere on the surface of a mesh: one energy over the places of its centre, and the force as its gradient.
//!
//! The energy is `C p^(5/2)` where `p` is positive, with Hertz's `C = 8/15 E* sqrt(R)`: on a half-space `p` is nearly the depth,
//! so a smooth function whatever the body. A spline ([`crate::lattice`]) is fitted to contacts solved at some places
//! ([`crate::touch`]), which are chosen one after another where the law is farthest from all before, and knows least. What a
//! new place says before it is used is the error estimate there.

use crate::jet::Jet;
use crate::lattice::Lattice;

/// Prepared law, for a Young's modulus of 1 Pa.
#[derive(Clone, Debug, PartialEq)]
pub struct Anywhere {
    /// Radius of the ball, m.
    pub radius_m: f64,
    /// Factor `C` of the energy, J/m^(5/2).
    pub hertz: f64,
    /// Function `p`, in steps of the lattice.
    pub lattice: Lattice,
    /// Depth of the undeformed surface inside the ball at each point of the lattice, m; above the radius inside the body.
    pub depths_m: Vec<f32>,
    /// Estimated relative error of the force at each point of the lattice.
    pub errors: Vec<f32>,
}

/// Answer at a place of the centre.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Answer {
    /// Stored energy, J, with its gradient, N.
    pub energy: Jet,
    /// Depth of the undeformed surface inside the ball, m; above the radius where the centre is inside the body.
    pub depth_m: f64,
    /// Estimated relative error of the force.
    pub error: f64,
}

/// Depth up to which the law holds, in radii.
pub const DEEPEST: f64 = 0.9;
/// Estimated error up to which the law holds.
pub const LARGEST_ERROR: f64 = 0.04;
/// Error of the depth, in radii: most of the error of a shallow contact.
const SHALLOW: f64 = 0.001;

impl Answer {
    /// Returns true if the law holds at this place.
    #[must_use]
    pub fn is_in_domain(&self, radius_m: f64) -> bool {
        self.depth_m <= 0.0 || self.depth_m <= DEEPEST * radius_m && self.error <= LARGEST_ERROR
    }
}

impl Anywhere {
    /// Returns the answer with the centre at `centre_m` (finite), in the frame of the mesh. Real-time: bounded, no allocation.
    pub fn answer(&self, centre_m: [f64; 3]) -> Answer {
        let step_m = self.lattice.step_m;
        let p = self.lattice.at(centre_m);
        // Beyond the deepest contact the force grows no more.
        let within = p.value.max(0.0).min(DEEPEST * self.radius_m / step_m);
        let scale = self.hertz * step_m * step_m * step_m.sqrt();
        let (root, over) = (within.sqrt(), (p.value - within).max(0.0));
        let slope = 2.5 * scale * within * root;
        let energy = p.chain(scale * within * within * root + slope * over, slope);
        let [depth_m, error] = [&self.depths_m, &self.errors].map(|l| self.lattice.between(l, centre_m));
        Answer {
            energy,
            depth_m,
            error: error + SHALLOW * self.radius_m / depth_m.abs().max(f64::MIN_POSITIVE),
        }
    }

    /// Returns all numbers of the law, for the cache. Not real-time.
    #[must_use]
    pub fn to_numbers(&self) -> Vec<f64> {
        let Lattice { low_m, step_m, counts, values } = &self.lattice;
        let mut numbers = vec![self.radius_m, self.hertz, *step_m];
        numbers.extend(low_m);
        numbers.extend(counts.map(|count| count as f64));
        numbers.extend(values);
        numbers.extend(self.depths_m.iter().chain(&self.errors).map(|x| f64::from(*x)));
        numbers
    }

    /// Restores a law from its numbers, bit for bit; `None` if they do not describe one. Not real-time.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // were f32
    pub fn from_numbers(mut numbers: &[f64]) -> Option<Self> {
        use crate::spline::{take, whole};
        let [radius_m, hertz, step_m, x, y, z] = *take(&mut numbers, 6)?.first_chunk()?;
        let mut counts = [0; 3];
        for (count, number) in counts.iter_mut().zip(take(&mut numbers, 3)?) {
            *count = whole(*number).filter(|count| *count >= 6)?;
        }
        let all = counts.iter().product();
        let lattice = Lattice { low_m: [x, y, z], step_m, counts, values: take(&mut numbers, all)?.to_vec() };
        let narrow = |list: &[f64]| list.iter().map(|x| *x as f32).collect();
        let (depths_m, errors) = (narrow(take(&mut numbers, all)?), narrow(take(&mut numbers, all)?));
        numbers.is_empty().then_some(Self { radius_m, hertz, lattice, depths_m, errors })
    }
}
