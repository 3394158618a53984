//! Variant `rod`: the spring as a geometrically exact rod, in space and past buckling.
//!
//! Between its plates the spring is an elastic line whose sections can turn by any angle: it bends, twists, shears and
//! shortens, with one rigidity for each (Haringx's rod; Reissner and Simo's in space). Nothing is linearised, so there
//! are several equilibria where a real spring has several, and the hand feels only a stable one. [`Rod`] finds a stable
//! equilibrium by energy: a minimum of the stored energy among all shapes that meet the plates.
//!
//! One topic per module:
//! - `plate`: the upper plate in coordinates free of trigonometry; `section`: the energy of a section in
//!   them.
//! - `functional`: the energy as a function of the coefficients of the polynomials of the shape
//!   ([`flotor_lanes::basis`]), with all quadratic parts eliminated; its derivatives with respect to the pose are force and torque.
//! - `contact`: contact of the coils.
//! - `curve`: positions of the sections, for drawing.
//! - `predictor`, `equilibrium`: follow the minimum in time, and count unstable directions ([`flotor_lanes::matrix`]); `start`: first
//!   shape.
//! - `descent`: fast search for the equilibrium of a pose without a history, from the straight `column`;
//!   `search_energy`: the energy of this search.
//!
//! Shear, stretch and twist follow in closed form from the directions of the sections, two numbers each. So with ten
//! polynomials the error before buckling is below a micronewton, with twenty-eight polynomials it is rounding, and the matrix
//! of Newton's method also distinguishes a stable equilibrium from an unstable one. The response depends on the history only
//! where there are several stable equilibria.
//!
//! Sources: Haringx, *On highly compressible helical springs and rubber rods* (1948); Simo, *A finite strain
//! beam formulation* (1985); the elimination and the coordinates are this project's, in the book's chapter
//! "The spring".

use std::f64::consts::PI;

use flotor_hal::glam::DVec3;
use flotor_hal::{Restorable, StateBytes};

use crate::centerline::Section;
use crate::held::HeldSpring;
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::validity::Validity;
pub use contact::Coils;
use descent::Descent;
pub use equilibrium::Work;
use equilibrium::{Effort, Equilibrium, Outcome};
use functional::{Ratios, Reading};
use plate::Plate;
use search_energy::{BUBBLES, COEFFICIENTS, STATIONS};

mod column;
pub(crate) mod contact;
mod curve;
mod descent;
mod equilibrium;
mod functional;
mod plate;
mod predictor;
mod search_energy;
mod section;
mod start;

/// Accuracy of the rod, and cost of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Accuracy {
    /// For the servo: force to a micronewton before buckling and to a millinewton past it, in about a
    /// microsecond per tick.
    Servo,
    /// For reference: force to 1e-13 N before buckling and to 1e-10 N past it, in about a hundred
    /// microseconds.
    Tight,
}

/// Branch of the rod's equilibria, by the height of the upper plate above the lower plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Branch {
    /// Height above that at which a straight rod buckles.
    Unbuckled,
    /// Smaller height: a stable shape bulges.
    Buckled,
}

/// State of the rod's equilibrium after a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// Branch at the current pose.
    pub branch: Branch,
    /// Number of independent directions in which the energy of the shape decreases, the Morse index, at the last computation of
    /// the matrix of second derivatives.
    pub unstable_directions: usize,
}

impl State {
    /// Returns true if the shape is a minimum of the energy.
    #[must_use]
    pub fn is_stable(&self) -> bool {
        self.unstable_directions == 0
    }
}

/// Effort for the servo: a force to a nanonewton, in one evaluation of the energy on a smooth path.
const SERVO: Effort =
    Effort { most_steps: 6, most_matrices: 3, matrix_life: 32, tolerance: 1e-11, renewal: 1e-6 };

/// Effort of [`Accuracy::Tight`], a reference.
const TIGHT: Effort =
    Effort { most_steps: 8, most_matrices: 8, matrix_life: 1, tolerance: 1e-14, renewal: 1e-13 };

/// Effort for equilibria to rounding, so that an answer does not depend on the history.
const TO_ROUNDING: Effort = Effort {
    most_steps: 10,
    most_matrices: 6,
    matrix_life: 8,
    tolerance: 1e-13,
    // A step costs a ninth of a matrix: several steps with an old matrix are better while they contract.
    renewal: 1e-3,
};

impl Effort {
    /// Raises the limits for touching coils: they meet at one place after the other in a tick, and each place changes the matrix.
    fn with(self, coils: Coils) -> Self {
        match coils {
            Coils::Pass => self,
            Coils::Touch => Self { most_steps: 16, most_matrices: 6, ..self },
        }
    }
}

/// Exact rod of one spring, which follows the pose from tick to tick.
#[derive(Clone, Debug, PartialEq)]
#[must_use]
pub struct Rod {
    solver: Solver,
    coils: Coils,
    constants: Constants,
    branch: Branch,
    /// Response of the last tick that had an answer.
    last: Response,
}

#[derive(Clone, Debug, PartialEq)]
enum Solver {
    /// The servo's polynomials, with a multiple of four stations: four are summed at a time, so two more stations cost less.
    Blend(Box<Equilibrium<BUBBLES, COEFFICIENTS, STATIONS>>, Box<Descent>),
    Servo(Box<Equilibrium<10, 20, 14>>),
    Tight(Box<Equilibrium<28, 56, 30>>),
}

/// Evaluates an expression with the equilibrium of any solver.
macro_rules! either {
    ($solver:expr, $equilibrium:ident => $body:expr) => {
        match $solver {
            Solver::Blend($equilibrium, _) => $body,
            Solver::Servo($equilibrium) => $body,
            Solver::Tight($equilibrium) => $body,
        }
    };
}

impl Rod {
    /// Builds the rod at rest, without contact of its coils. Not real-time: allocates.
    pub fn new(spring: &Spring, accuracy: Accuracy) -> Self {
        Self::with_coils(spring, accuracy, Coils::Pass)
    }

    /// Builds the rod at rest, with or without contact of its coils. Not real-time: allocates.
    pub fn with_coils(spring: &Spring, accuracy: Accuracy, coils: Coils) -> Self {
        let ratios = Ratios::new(spring, coils);
        let solver = match accuracy {
            Accuracy::Servo => Solver::Servo(Box::new(Equilibrium::new(ratios, SERVO.with(coils)))),
            Accuracy::Tight => Solver::Tight(Box::new(Equilibrium::new(ratios, TIGHT))),
        };
        Self::solved_by(solver, spring, coils)
    }

    /// Builds the rod at rest with the servo's polynomials and each equilibrium solved to rounding, so that an answer
    /// does not depend on the history: for laws that minimise the energy of the rod ([`crate::seat`]). Not real-time:
    /// allocates.
    pub fn to_rounding(spring: &Spring, coils: Coils) -> Self {
        let equilibrium = Equilibrium::new(Ratios::new(spring, coils), TO_ROUNDING.with(coils));
        Self::solved_by(Solver::Servo(Box::new(equilibrium)), spring, coils)
    }

    /// Builds the rod at rest for a law that blends the rod's energy with another energy ([`crate::rod_blend`]) and finds the
    /// equilibrium anew at each pose. The equilibrium is solved to rounding while followed, to 1e-10 of the angles when found from
    /// the pose. Not real-time: allocates.
    pub(crate) fn for_a_blend(spring: &Spring) -> Self {
        // A base that lifts off needs two searches in a tick.
        let effort = Effort { most_matrices: 5, ..TO_ROUNDING };
        let equilibrium = Equilibrium::new(Ratios::new(spring, Coils::Pass), effort);
        Self::solved_by(Solver::Blend(Box::new(equilibrium), Box::new(Descent::new())), spring, Coils::Pass)
    }

    fn solved_by(solver: Solver, spring: &Spring, coils: Coils) -> Self {
        Self {
            solver,
            coils,
            constants: Constants::new(spring),
            branch: Branch::Unbuckled,
            last: Response::none(Validity::NotConverged),
        }
    }

    /// Resets to the rest state without history. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        either!(&mut self.solver, equilibrium => equilibrium.reset());
        self.branch = Branch::Unbuckled;
        self.last = Response::none(Validity::NotConverged);
    }

    /// Sets the parameters at a tick boundary, with the shape unchanged. Real-time: bounded, no allocation.
    pub fn set_spring(&mut self, spring: &Spring) {
        self.constants = Constants::new(spring);
        either!(&mut self.solver, equilibrium => equilibrium.set_ratios(Ratios::new(spring, self.coils)));
    }

    /// Returns the state of the last tick's equilibrium. Real-time: bounded, no allocation.
    #[must_use]
    pub fn state(&self) -> State {
        let unstable_directions = either!(&self.solver, equilibrium => equilibrium.unstable_directions);
        State { branch: self.branch, unstable_directions }
    }

    /// Returns the cost of the last tick. Real-time: bounded, no allocation.
    #[must_use]
    pub fn work(&self) -> Work {
        either!(&self.solver, equilibrium => equilibrium.work)
    }

    /// Fills in the sections of the rod after the last tick, from plate to plate, evenly in arc length of the unloaded
    /// spring. Not real-time: integrates along the rod.
    pub fn sections(&self, sections: &mut [Section]) {
        let free_length_m = self.constants.free_length_m;
        either!(&self.solver, equilibrium => equilibrium.curve().draw(free_length_m, sections));
    }

    /// Advances the shape by one tick and returns the wrench on the hand and the stored energy at `pose`.
    ///
    /// Defined for every pose and history:
    /// - in stable equilibrium: [`Validity::Ok`];
    /// - moving to an equilibrium (after a jump of the pose, or where the last equilibrium ceased to be stable):
    ///   [`Validity::NotConverged`], with the wrench of the present shape, which moves a bounded distance per tick.
    ///   The next call, at the same pose or another, continues the motion. If this wrench is not finite, the last finite wrench;
    /// - upper plate upside down to within 2.6 degrees, plates closer than a thousandth or farther than a
    ///   million free lengths: no wrench, [`Validity::OutOfDomain`];
    /// - NaN, infinity or a quaternion that is not of unit length: no wrench, [`Validity::InvalidInput`].
    ///
    /// Real-time: bounded, no allocation.
    pub fn step(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.answer(
            pose,
            |solver, plate| either!(solver, equilibrium => equilibrium.advance(plate, demand)),
            demand,
        )
    }

    /// Finds the equilibrium without a history, from the shape of the linear beam-column: a function of the pose alone.
    /// If the search does not converge, [`Validity::NotConverged`], and [`Self::step`] continues it. `spring`: the spring of
    /// this rod. Real-time: bounded, no allocation; about the time of ten steps.
    pub(crate) fn find(&mut self, spring: &Spring, pose: &Pose, demand: Demand) -> Response {
        self.last = Response::none(Validity::NotConverged);
        self.answer(
            pose,
            |solver, plate| {
                if let Solver::Blend(equilibrium, descent) = solver
                    && let Some(found) = descent.find(equilibrium.ratios(), plate)
                {
                    return equilibrium.settle(plate, &found);
                }
                either!(solver, equilibrium => equilibrium.find(spring, pose, plate, demand))
            },
            demand,
        )
    }

    /// Returns the stored energy of the equilibrium found from the pose alone; `None` for a plate turned upside down, if the search
    /// does not converge, or for a rod not built by [`Self::for_a_blend`]. The rod is unchanged. Real-time: bounded, no allocation.
    pub(crate) fn energy_at(&mut self, pose: &Pose) -> Option<f64> {
        let plate = Plate::new(pose, self.constants.free_length_m)?;
        let Solver::Blend(equilibrium, descent) = &mut self.solver else { return None };
        let found = descent.find(equilibrium.ratios(), &plate)?;
        Some(found.reading.energy * self.constants.energy_unit_j)
    }

    #[inline]
    fn answer(
        &mut self,
        pose: &Pose,
        solve: impl FnOnce(&mut Solver, &Plate) -> Outcome,
        demand: Demand,
    ) -> Response {
        if let Err(validity) = pose.chord(self.constants.free_length_m) {
            return Response::none(validity);
        }
        let Some(plate) = Plate::new(pose, self.constants.free_length_m) else {
            return Response::none(Validity::OutOfDomain);
        };
        self.branch = self.constants.branch(-pose.position_m.z);
        let response = match solve(&mut self.solver, &plate) {
            Outcome::Settled(reading) => self.constants.response(&plate, &reading, demand, Validity::Ok),
            Outcome::Moving(reading) => {
                self.constants.response(&plate, &reading, demand, Validity::NotConverged)
            }
            Outcome::Failed => return Response { validity: Validity::NotConverged, ..self.last },
        };
        if response.if_finite().validity != response.validity {
            return Response { validity: Validity::NotConverged, ..self.last };
        }
        self.last = response;
        response
    }
}

impl Restorable for Rod {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        either!(&mut self.solver, equilibrium => equilibrium.pass(bytes));
        bytes.choice(&mut self.branch, &[Branch::Unbuckled, Branch::Buckled]);
        self.last.pass(bytes);
    }
}

impl HeldSpring for Rod {
    fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.step(pose, demand)
    }

    fn stay(&mut self, pose: &Pose, demand: Demand) -> Response {
        self.answer(pose, |solver, plate| either!(solver, equilibrium => equilibrium.moving(plate)), demand)
    }

    fn noise_rad(&self) -> f64 {
        either!(&self.solver, equilibrium => equilibrium.tolerance())
    }

    fn cost(&self) -> u32 {
        self.work().cost()
    }

    fn mark(&mut self) {
        either!(&mut self.solver, equilibrium => equilibrium.mark());
    }

    fn go_back(&mut self) {
        either!(&mut self.solver, equilibrium => equilibrium.go_back());
    }

    fn unload(&mut self) {
        self.reset();
    }
}

/// Constants of the spring, SI units unless dimensionless.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Constants {
    free_length_m: f64,
    /// `alpha / L0²`
    force_unit_n: f64,
    /// `alpha / L0`
    energy_unit_j: f64,
    /// `gamma L0² / alpha`
    slenderness: f64,
    /// `1 - gamma / beta`
    shear: f64,
}

impl Constants {
    fn new(spring: &Spring) -> Self {
        let rigidities = spring.rigidities();
        let free_length_m = spring.geometry().free_length_m;
        let energy_unit_j = rigidities.alpha_n_m2 / free_length_m;
        let force_unit_n = energy_unit_j / free_length_m;
        Self {
            free_length_m,
            force_unit_n,
            energy_unit_j,
            slenderness: rigidities.gamma_n / force_unit_n,
            shear: 1.0 - rigidities.gamma_n / rigidities.beta_n,
        }
    }

    /// Returns the branch by Haringx's condition for clamped plates: `(gamma L0²/alpha) p (1 - (1 - gamma/beta) p) = 4 pi²`.
    fn branch(&self, shortening_m: f64) -> Branch {
        let compression = shortening_m / self.free_length_m;
        let load = self.slenderness * compression * (1.0 - self.shear * compression);
        if load > 4.0 * PI * PI { Branch::Buckled } else { Branch::Unbuckled }
    }

    #[inline]
    fn response(&self, plate: &Plate, reading: &Reading, demand: Demand, validity: Validity) -> Response {
        let torque = match demand {
            Demand::Force => DVec3::ZERO,
            Demand::Wrench | Demand::WrenchAndEnergy => plate.torque(reading.by_lean, reading.torsion),
        };
        Response {
            force_n: -reading.force * self.force_unit_n,
            torque_nm: torque * self.energy_unit_j,
            energy_j: (demand >= Demand::WrenchAndEnergy).then_some(reading.energy * self.energy_unit_j),
            validity,
        }
    }
}
