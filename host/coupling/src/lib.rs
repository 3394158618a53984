//! Virtual coupling of two devices by a spring and a damper: bilateral teleoperation.
//!
//! Each device has an [`End`]. An end receives the state of its partner: pose, velocity and the energy that the partner has passed
//! on ([`PeerState`], some ticks old), and pulls its own handle to that pose. It has an energy tank ([`Tank`]): the energy that its
//! hand puts in, less the energy that comes out, plus the energy that the partner has passed on. As long as no tank is below zero,
//! the pair generates no energy, *whatever the delay*, constant or not, and even if messages get lost: the energy passed on is sent
//! as a running total. This holds for ends with true claims; the claims of a partner on another host are accepted up to the motion
//! and energy that can be checked here (`claims`), so that false claims yield no energy beyond the accepted energy.
//!
//! ```text
//!  hand  <-- wrench --  End   -- PeerState: pose, twist, energy passed on -->  End  -- wrench -->  hand
//!        -- motion -->  Tank  <-- PeerState ---------------------------------  Tank <-- motion --
//! ```
//!
//! If frames or scales differ, both ends use one shared frame, to which each device has a mapping, like the mapping of
//! a model. Energies are given in the shared frame.
//!
//! The energy at the port of one device is in [`port_energy`]; [`passivity`] and [`slew`] are the stages of the envelope that limit
//! it.
//!
//! [`Coupling`] has both ends in one loop with a delay of whole ticks. [`RemoteEnd`] is an end whose partner is on
//! another host; other threads transport its messages over the [`Line`].
//!
//! Sources: energy tank and transfer of energy, M. Franken, S. Stramigioli, S. Misra, C. Secchi, A. Macchelli,
//! "Bilateral telemanipulation with time delays: a two-layer approach combining passivity and transparency", IEEE
//! Trans. Robotics 27(4), 2011, sections III and IV; controller at an end, see [`crate::port_energy`].
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod brake;
mod claims;
mod delay;
mod end;
pub mod passivity;
pub mod port_energy;
mod remote;
pub mod slew;
mod tank;
#[cfg(test)]
mod tests;

pub use claims::{ClaimExcess, Reach};
pub use end::End;
pub use flotor_core::coupling::{
    CouplingConfig, CouplingDescription, CouplingEnd, CouplingEnds, MAX_DELAY_TICKS,
};
pub use flotor_core::limits::PassivityMode;
pub use flotor_core::peer::{Dispatch, PeerState, TankState};
pub use remote::{Line, LinkStatistics, LinkTimeouts, RemoteEnd};
pub use tank::Tank;

use delay::DelayLine;
use flotor_hal::{DeviceState, Wrench};

/// Handle state and applied wrench at one device of a coupling in a tick.
#[derive(Clone, Copy, Debug)]
pub struct PortSample<'a> {
    /// State of the handle, device frame.
    pub state: &'a DeviceState,
    /// Wrench applied since the last tick less the models' request, device frame: the coupling's wrench with the changes by the
    /// envelope.
    pub held: Wrench,
}

/// Wrench that an end requests in a tick.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pull {
    /// Wrench on the hand, device frame.
    pub wrench: Wrench,
    /// This end's half of the energy stored in the spring, scaled to the device, J.
    pub energy_j: f64,
    /// True if the passivity controller has reduced the wrench.
    pub is_damped: bool,
}

/// Coupling of two devices of one loop.
#[derive(Clone)]
pub struct Coupling {
    ends: [End; 2],
    /// Peer states under way to the end with the same index.
    ways: [DelayLine; 2],
}

impl Coupling {
    /// Creates a coupling with empty tanks and without peer states; `period_s` is the time between ticks. Not
    /// real-time.
    #[must_use]
    pub fn new(config: &CouplingConfig, ends: &[CouplingEnd; 2], period_s: f64) -> Self {
        Self {
            ends: ends.map(|end| End::new(config, &end.mapping, period_s)),
            ways: [(); 2].map(|()| DelayLine::new(config.delay_ticks)),
        }
    }

    /// Runs one tick: both ends exchange their states, `delay_ticks` late; returns the request of each end. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub fn step(&mut self, samples: [PortSample<'_>; 2]) -> [Pull; 2] {
        let Self { ends: [first, second], ways: [to_first, to_second] } = self;
        let [at_first, at_second] = samples;
        first.observe(at_first.state, &at_first.held);
        second.observe(at_second.state, &at_second.held);
        if let Some(peer) = to_second.pass(first.send_state(at_first.state)) {
            second.receive(&peer);
        }
        if let Some(peer) = to_first.pass(second.send_state(at_second.state)) {
            first.receive(&peer);
        }
        [first.pull(at_first.state), second.pull(at_second.state)]
    }

    /// Returns the energy tanks of both ends.
    #[must_use]
    pub fn tanks(&self) -> [&Tank; 2] {
        let [first, second] = &self.ends;
        [&first.tank, &second.tank]
    }
}
