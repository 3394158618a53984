//! Flotor, hand and energy balance on one clock.
//!
//! The clock counts integer nanoseconds: time accumulates no rounding error, and equal calls give bit-identical
//! results. The intention of the hand is a smooth curve, sampled once per millisecond of this clock (not per tick) and
//! interpolated linearly: the motion of the hand does not depend on the length of the ticks. Each tick is split at
//! these sampling times and at the release of the handle; each piece has constant or linearly growing forces, as the
//! integrator requires (see `plant`).

use crate::hand::guidance::NotGuiding;
use crate::hand::{Aim, Follower, Guidance, Hand, Intention, Pose, Trajectory, Wavering};
use crate::ledger::Ledger;
use crate::plant::{FlotorParameters, MAX_PIECE_NS, Outcome, Plant, State, Wrench};
use crate::units::seconds;
use crate::validation::InvalidParameter;
use crate::workspace::SensorRange;
use flotor_hal::glam::DVec3;
use flotor_hal::restorable;

/// Longest time simulated by one call of [`Simulation::advance`], ns: ten ticks of the slowest loop (100 Hz). Bounds
/// the computing time of a tick after a delay of the host.
pub const MAX_ADVANCE_NS: u64 = 100_000_000;

/// Sampling interval of the hand's intention, ns.
const GRID_NS: u64 = MAX_PIECE_NS;

/// Flotor, hand, initial state, tick length and seed of a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Physical parameters of the flotor.
    pub flotor: FlotorParameters,
    /// Impedance, intended motion and unsteadiness of the hand.
    pub hand: Hand,
    /// Initial state of the flotor.
    pub start: State,
    /// Nominal tick length, ns. Other lengths work too, at a slightly higher cost.
    pub tick_ns: u64,
    /// Seed of the hand's tremor and force noise.
    pub seed: u64,
}

impl Setup {
    /// Setup of the demo: the thesis's flotor at home in an exploring hand, at 1 kHz.
    pub const DEMO: Self = Self {
        flotor: FlotorParameters::THESIS,
        hand: Hand::EXPLORING,
        start: State::HOME,
        tick_ns: 1_000_000,
        seed: 0,
    };
}

/// Incidents of a tick. No incident stops the simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Incidents {
    /// The wrench contained a NaN or an infinity; the coils delivered zero instead.
    pub wrench_rejected: bool,
    /// The motion exceeded the physical limits; the flotor was stopped at its pose and a new energy balance began.
    pub stopped: bool,
    /// The tick was longer than [`MAX_ADVANCE_NS`]; only that time was simulated.
    pub cut_short: bool,
}

impl Incidents {
    /// Returns true if no incident occurred. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Simulation of flotor and hand, with its clock and energy balance.
#[derive(Clone, Debug)]
pub struct Simulation {
    setup: Setup,
    plant: Plant,
    ledger: Ledger,
    time_ns: u64,
    wavering: Wavering,
    guidance: Guidance,
    stroke: Stroke,
}

restorable!(Simulation { plant, ledger, time_ns, guidance, stroke } without { setup, wavering });

impl Simulation {
    /// Creates a simulation at time 0. Not real-time.
    ///
    /// # Errors
    /// If a parameter is not physical; the error contains its name.
    pub fn new(setup: &Setup) -> Result<Self, InvalidParameter> {
        let plant = plant(setup, &setup.start)?;
        let wavering = Wavering::new(setup.hand.unsteadiness, setup.seed);
        Ok(Self {
            ledger: Ledger::open(plant.energy()),
            plant,
            time_ns: 0,
            stroke: Stroke::at(0, &setup.hand.trajectory, &wavering),
            wavering,
            guidance: Guidance::NONE,
            setup: setup.clone(),
        })
    }

    /// Resets to the start: time 0, initial state, no guide, new energy balance; the hand of the latest
    /// [`Self::set_hand`] stays. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.plant.place(&self.setup.start);
        self.ledger = Ledger::open(self.plant.energy());
        self.time_ns = 0;
        self.guidance = Guidance::NONE;
        self.stroke = Stroke::at(0, &self.setup.hand.trajectory, &self.wavering);
    }

    /// Replaces the hand and ends the guidance; the times of the hand's trajectory count from the start of the run.
    ///
    /// Not real-time.
    ///
    /// # Errors
    /// If a parameter is not physical; the old hand then continues.
    pub fn set_hand(&mut self, hand: Hand) -> Result<(), InvalidParameter> {
        let setup = Setup { hand, ..self.setup.clone() };
        self.plant = plant(&setup, &self.plant.state())?;
        self.wavering = Wavering::new(setup.hand.unsteadiness, setup.seed);
        self.guidance = Guidance::NONE;
        self.stroke = Stroke::at(self.time_ns, &setup.hand.trajectory, &self.wavering);
        self.setup = setup;
        Ok(())
    }

    /// Starts the guidance of the hand by client `guide` (its number), or resets the timeout of this client's guidance
    /// (see [`guidance`](crate::hand::guidance)); 0 ends the guidance by any client. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`NotGuiding`] while another client guides.
    pub fn guide(&mut self, guide: f64) -> Result<(), NotGuiding> {
        let start = self.stroke.follower(&self.plant.state());
        self.guidance.take(guide, self.time_ns, start)
    }

    /// Sets the target of the guide along an axis (0 to 2: x, y, z of the device frame), m. Real-time: bounded, no
    /// allocation.
    ///
    /// # Errors
    /// [`NotGuiding`] if the client of the latest [`Self::guide`] does not guide.
    pub fn guide_to(&mut self, axis: usize, target_m: f64) -> Result<(), NotGuiding> {
        self.guidance.aim_at(axis, target_m, self.time_ns)
    }

    /// Returns the number of the guiding client; 0 for none. Real-time: bounded, no allocation.
    #[must_use]
    pub fn guided_by(&self) -> f64 {
        self.guidance.guide()
    }

    /// Advances by `dt_ns` (at most [`MAX_ADVANCE_NS`]) under a constant coil wrench (zero-order hold); returns the
    /// incidents.
    ///
    /// Splitting a tick changes nothing but rounding in translation and the Runge-Kutta error in rotation. A non-finite
    /// wrench counts as zero. Real-time: bounded, no allocation.
    pub fn advance(&mut self, dt_ns: u64, coils: Wrench) -> Incidents {
        let wrench_rejected = !coils.is_finite();
        let coils = if wrench_rejected { &Wrench::ZERO } else { &coils };
        Incidents { wrench_rejected, ..self.advance_under(dt_ns, coils) }
    }

    /// Advances like [`Self::advance`], under a finite wrench passed by reference: a copy would have to be in memory before
    /// the motion starts.
    #[inline]
    pub(crate) fn advance_under(&mut self, dt_ns: u64, coils: &Wrench) -> Incidents {
        debug_assert!(coils.is_finite());
        let mut incidents = Incidents { cut_short: dt_ns > MAX_ADVANCE_NS, ..Incidents::default() };
        let end_ns = self.time_ns.saturating_add(dt_ns.min(MAX_ADVANCE_NS));
        while self.time_ns < end_ns {
            let (piece_ns, intention) = self.next_piece(end_ns);
            match self.plant.advance(piece_ns, coils, intention.as_ref()) {
                Outcome::Moved(work) => self.ledger.add(work, self.plant.energy()),
                Outcome::Stopped => {
                    incidents.stopped = true;
                    self.ledger = Ledger::open(self.plant.energy());
                }
            }
            self.time_ns += piece_ns;
        }
        incidents
    }

    /// Returns the time since the start, ns. Real-time: bounded, no allocation.
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Returns the present pose and velocity of the flotor. Real-time: bounded, no allocation.
    #[must_use]
    pub fn state(&self) -> State {
        self.plant.state()
    }

    /// Returns whether the present pose is within the range of the sensors. Real-time: bounded, no allocation.
    #[must_use]
    pub fn sensor_range(&self) -> SensorRange {
        let state = self.plant.state();
        SensorRange::of(state.position_m, state.orientation)
    }

    /// Returns the present aim of the trajectory, without tremor, force noise and guidance; `None` while the trajectory
    /// has the hand off the handle. Real-time: bounded, no allocation.
    #[must_use]
    pub fn aim(&self) -> Option<Aim> {
        self.setup.hand.trajectory.aim(self.time_ns)
    }

    /// Returns the energy balance since the start of the run, or since the flotor was last stopped. Real-time: bounded,
    /// no allocation.
    #[must_use]
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Returns the setup, with the hand of the latest [`Self::set_hand`]. Real-time: bounded, no allocation.
    #[must_use]
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Returns the length of the next piece, ns, and the intention of the hand during the piece; `None` while the hand is
    /// off the handle. A piece ends with the tick, at the next grid point, or when the hand releases the handle.
    #[inline]
    fn next_piece(&mut self, tick_end_ns: u64) -> (u64, Option<Intention>) {
        let trajectory = &self.setup.hand.trajectory;
        if self.time_ns >= self.stroke.end_ns {
            self.stroke.go_on(trajectory, &self.wavering);
            if !self.guidance.is_free() {
                self.stroke.be_guided(&mut self.guidance, &self.plant.state());
            }
        }
        let end_ns = tick_end_ns.min(self.stroke.end_ns);
        let release_ns = match trajectory.release_ns() {
            Some(release_ns) if !self.stroke.is_guided => release_ns,
            _ => u64::MAX,
        };
        if self.time_ns < release_ns {
            (end_ns.min(release_ns) - self.time_ns, self.stroke.drawn(self.time_ns))
        } else {
            (end_ns - self.time_ns, None)
        }
    }
}

/// Creates the plant of a setup, with the flotor in `state`.
fn plant(setup: &Setup, state: &State) -> Result<Plant, InvalidParameter> {
    let Setup { flotor, hand, tick_ns, .. } = setup;
    hand.check()?;
    Plant::yielding(flotor, &hand.impedance, &hand.trajectory.yieldings(), state, *tick_ns)
}

/// Aims of the hand at two adjacent sampling times of the intention.
#[derive(Clone, Copy, Debug)]
struct Stroke {
    start_ns: u64,
    end_ns: u64,
    start: Option<Aim>,
    end: Option<Aim>,
    /// True while a guide moves the hand: a planned release of the trajectory is then skipped.
    is_guided: bool,
    /// Aim of the trajectory at the end, without the guide.
    scripted: Option<Aim>,
}

restorable!(Stroke { start_ns, end_ns, start, end, is_guided, scripted });

impl Stroke {
    /// Returns the stroke that contains the time `time_ns`.
    fn at(time_ns: u64, trajectory: &Trajectory, wavering: &Wavering) -> Self {
        let start_ns = time_ns - time_ns % GRID_NS;
        let end_ns = start_ns.saturating_add(GRID_NS);
        let aim = |time_ns| Self::aim(time_ns, trajectory, wavering);
        Self { start_ns, end_ns, start: aim(start_ns), end: aim(end_ns), is_guided: false, scripted: None }
    }

    /// Advances to the next stroke, which starts at the end of this one: their common grid point is evaluated once.
    #[inline(never)] // inlined, the sine would force the caller's numbers into memory
    fn go_on(&mut self, trajectory: &Trajectory, wavering: &Wavering) {
        (self.start_ns, self.start) = (self.end_ns, self.end);
        self.end_ns = self.end_ns.saturating_add(GRID_NS);
        self.end = Self::aim(self.end_ns, trajectory, wavering);
        self.is_guided = false;
    }

    /// Replaces the aim at the end of this stroke by the guided aim; `state` is the state of the handle at the start.
    #[cold] // hands mostly follow their trajectory
    fn be_guided(&mut self, guidance: &mut Guidance, state: &State) {
        let (scripted, dt_s) = (self.end, seconds(GRID_NS));
        let (end, velocity_m_per_s) = guidance.advance(self.end_ns, dt_s, scripted, &Follower::of(state));
        (self.end, self.is_guided) = (end, !guidance.is_free());
        if guidance.is_free() {
            self.start = self.scripted; // the trajectory continues as without a guide
        } else if let (Some(start), Some(end), Some(scripted)) = (&mut self.start, end, scripted) {
            // Along an axis with an intended force the guided aim follows the handle, but the damper of the hand acts on the
            // velocity of the guide alone: the start is set so that the slope of the intended position is this velocity.
            let from_m = end.pose.position_m - velocity_m_per_s * dt_s;
            start.pose.position_m = DVec3::select(scripted.yielding, from_m, start.pose.position_m);
        }
        self.scripted = scripted;
    }

    /// Returns the intended motion of the hand at the end of the stroke, the initial motion of a guide; off the handle,
    /// the motion of the handle.
    #[cold] // clients take the hand rarely
    fn follower(&self, state: &State) -> Follower {
        self.drawn(self.end_ns).map_or_else(
            || Follower::of(state),
            |meant| {
                let pose = Pose { position_m: meant.position_m, orientation: meant.orientation };
                Follower { pose, velocity_m_per_s: meant.velocity_m_per_s }
            },
        )
    }

    /// Returns the aim of an unsteady hand at a time.
    #[inline]
    fn aim(time_ns: u64, trajectory: &Trajectory, wavering: &Wavering) -> Option<Aim> {
        let aim = trajectory.aim(time_ns)?;
        Some(wavered(&aim, wavering, seconds(time_ns)))
    }

    /// Interpolates the aim linearly at a time during the stroke: position on the chord with its slope as velocity;
    /// orientation and force, constant for the plant, at the midpoint. Constant if the hand releases the handle before the
    /// end.
    #[inline(always)]
    fn drawn(&self, time_ns: u64) -> Option<Intention> {
        let start = self.start?;
        let end = self.end.unwrap_or(start);
        let velocity_m_per_s = (end.pose.position_m - start.pose.position_m) / seconds(GRID_NS);
        let mut drawn = Intention {
            position_m: start.pose.position_m + velocity_m_per_s * seconds(time_ns - self.start_ns),
            velocity_m_per_s,
            force_n: 0.5 * (start.force_n + end.force_n),
            yielding: start.yielding,
            ..Intention::resting(start.pose)
        };
        if end.pose.orientation != start.pose.orientation {
            drawn.orientation = start.pose.orientation.lerp(end.pose.orientation, 0.5);
            drawn.angular_velocity_rad_per_s = start.pose.rotation_to(&end.pose) / seconds(GRID_NS);
        }
        Some(drawn)
    }
}

/// Adds tremor and force noise to an aim.
#[inline]
fn wavered(aim: &Aim, wavering: &Wavering, time_s: f64) -> Aim {
    let pose = Pose { position_m: aim.pose.position_m + wavering.offset_m(time_s), ..aim.pose };
    Aim { pose, force_n: wavering.force_n(aim.force_n, time_s), ..*aim }
}

#[cfg(test)]
mod tests;
