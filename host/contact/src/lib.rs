//! Force of a set of contacts on a tool: one convex problem with one answer, solved in every tick.
//!
//! A model that computes slower than the loop publishes a [`ContactSet`]: points of the tool, and the planes that stand for
//! the surface near them. The loop's [`Solver`] returns in every tick the wrench of this set on the hand, for the pose of the
//! handle then. Surfaces only push.
//!
//! ```
//! use flotor_contact::{Contact, ContactSet, Coupling, Limits, Replacement, Solver, Validity};
//! use flotor_hal::{DVec3, Pose, Twist};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let floor = Contact {
//!     tool_point_m: DVec3::ZERO,
//!     surface_point_m: DVec3::ZERO,
//!     normal: DVec3::Z,
//!     gap_m: 0.0,
//!     surface_velocity_m_per_s: DVec3::ZERO,
//!     stiffness_n_per_m: 1000.0,
//!     tangential_stiffness_n_per_m: 500.0,
//!     damping_ns_per_m: 1.0,
//!     friction: 0.3,
//! };
//! let set = ContactSet::new(&Pose::HOME, &[floor], Validity::UNLIMITED)?;
//! let (coupling, limits) = (Coupling::new(10_000.0, 5.0)?, Limits::new(20.0, 1.0)?);
//! let mut solver = Solver::new(coupling, limits, Replacement::Immediate, 1.0e-3)?;
//! solver.replace(&set);
//! let lowered = Pose { position_m: [0.0, 0.0, -0.002], ..Pose::HOME };
//! assert_eq!(solver.solve(&lowered, &Twist::ZERO, 0.001).wrench.force_n, [0.0, 0.0, 2.0]);
//! # Ok(())
//! # }
//! ```
//!
//! # The problem
//!
//! The tool has an offset `u` from the handle: a translation and a small rotation. With the pose of the handle, the gap of
//! contact `i` is `g + n u`, the stretch of its tangential spring `t + T u`, both linear in `u`. The offset minimises
//!
//! ```text
//! E(u) = u^T G^-1 u / 2 + sum_i [ integral from 0 to -(g + n u) of f_i  +  h_i(|t + T u|) ]
//! ```
//!
//! - `f(d)`: the force along the normal at depth `d`: `k d + b v`, never below 0, and 0 outside. `v` is the speed of approach of
//!   handle and surface. In the period in which a contact closes, `b v` is at most `b d / period`: the force is continuous.
//! - `h`: friction, Huber's function: a spring up to the limit `mu f`, of constant force beyond. The spring ends at an anchor on
//!   the surface. After the solve the anchor follows as far as the contact slides; the spring's energy then falls, never rises.
//! - `G`: the compliance of the coupling. All terms are convex and once continuously differentiable, and the first is strictly
//!   convex on the offsets that `G` allows: there is exactly one minimum. The wrench on the hand is the sum of the forces of the
//!   contacts there, which the coupling balances.
//!
//! # The coupling
//!
//! A constant compliance `1 / c` in series would make a stiffness `k` feel like `k c / (k + c)`: 10 % too soft for `c = 9 k`. To
//! stiffen each contact in return is right for one contact only; for several it depends on which of them touch. So the compliance
//! is as large as the set needs, and no larger: with the stiffness `N` of the whole set (all contacts touching and sticking),
//! in units of the coupling's, and its eigenvalues `s` along the directions `V`,
//!
//! ```text
//! N = V diag(s) V^T,   G = V diag(max(0, 1 - 1/s)) V^T,   (N^-1 + G)^-1 = V diag(min(s, 1)) V^T
//! ```
//!
//! - A set that is nowhere stiffer than the coupling is felt exactly, to rounding: `G = 0`, the offset is 0, and no iteration is
//!   needed. That holds for one contact, for several parallel ones, in a wedge and between opposed surfaces.
//! - In a direction in which the set is stiffer, all contacts together are as stiff as the coupling.
//! - Of such a set, contacts that touch alone are softer than both say, since the compliance is that of the whole set: one of
//!   `m` equal contacts has `1 / (1/k + 1/c - 1/(m k))`. A set with contacts that are far away costs stiffness near its limit.
//! - Arms are those at the anchor pose, so `G` is constant for a set: without friction and damping the wrench is the exact
//!   gradient of the minimum of `E` over the pose, and a closed path makes no work.
//!
//! # The error of the friction
//!
//! Coulomb's law limits friction by the normal force of the same instant. Together with an offset this is not a convex problem and
//! may have several answers or none. Without an offset (`G = 0`) the normal force does not depend on friction, and the limit is
//! that of the same tick: the law is exact. With an offset the limit is the normal force of the last solve times `mu`: the error
//! is `mu` times the change of the normal force in one tick (at 10 kN/m, 0.1 m/s, 1 kHz and `mu = 0.5`: 0.5 N at the most), and
//! a contact that closes has no friction in its first tick. At a steady normal force the error is 0.
//!
//! # The change of a set
//!
//! With [`Replacement::Conserving`] a new set adds no energy, whatever it says. Depth that it has and the set before did not is
//! withheld; contacts that it lacks fade. The withheld depth falls only as far as dissipated energy pays for it: work of the hand
//! and of the declared surface velocities (up to a power for each contact), less the energy of the springs. Where the tool has
//! left a contact, its withheld depth is gone. All changes take half the time between two sets, 20 ms at the most, and the forces
//! of a set that is older than it says fade in 20 ms.
//!
//! - A surface at rest, and one that moves as it says, have the same force as computed in the loop.
//! - A surface that moves without a declared velocity pushes a hand at rest only as far as energy was dissipated before.
//! - Over a convex surface each new plane is less deep than the last one was by then: the energy is lost, and sliding feels like
//!   viscous friction. On a ball of 20 mm at 0.1 m/s the force differs by up to 10 % at 100 Hz, 4 % at 200 Hz, one period late.
//! - The energy is that of the returned wrench. A caller that scales the wrench differently from tick to tick adds the difference.
//!
//! # Sources
//!
//! Tool behind a coupling: J. Colgate, M. Stanley, J. Brown, "Issues in the haptic display of tool use", IROS 1995; M. Ortega,
//! S. Redon, S. Coquillart, "A six degree-of-freedom god-object method", IEEE TVCG 13(3), 2007. Local models for slow
//! simulations: Y. Adachi, T. Kumano, K. Ogino, "Intermediate representation for stiff virtual objects", VRAIS 1995. Friction
//! limited by the normal force of the last solve makes the problem convex: A. Castro, X. Han, J. Masterjohn, "Irrotational contact
//! fields", arXiv:2312.03908, 2023, there called lagged.
//!
//! Answers have the same bits on every machine: sums, products, quotients, square roots and comparisons in a fixed order.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![forbid(unsafe_code)]

mod answer;
mod cap;
mod contact;
mod coupling;
mod cross_fade;
mod law;
mod linear;
mod newton;
mod published;
mod replacement;
mod slot;
mod solver;

pub use answer::NewestAnswer;
pub use contact::{Contact, ContactSet, ContactSetError, Fault, Validity};
pub use coupling::{Coupling, Limits, NotPositive};
pub use cross_fade::CrossFade;
pub use published::{FeltStiffness, PublishedContacts, Shortcoming, StableStiffness, Touch};
pub use replacement::Replacement;
pub use solver::{Outcome, Solution, Solver};
