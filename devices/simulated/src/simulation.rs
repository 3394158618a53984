//! Flotor, hand and energy balance on one clock: what a device needs to stand in for the machine.
//!
//! The clock counts integer nanoseconds, so a run can be cut at any of them and goes on bit for bit the same
//! way. The hand's intention is a smooth curve sampled once a millisecond and drawn straight in between, on a
//! grid that belongs to the clock and not to the servo: ticks of any length, regular or not, meet the same
//! hand. Each tick is cut at the grid and at the moment the hand releases the handle; within a piece the plant is exact
//! (see `plant`).

use crate::hand::guidance::NotGuiding;
use crate::hand::{Aim, Follower, Guidance, Hand, Intention, Pose, Trajectory, Wavering};
use crate::ledger::Ledger;
use crate::plant::{FlotorParameters, MAX_PIECE_NS, Outcome, Plant, State, Wrench};
use crate::validation::InvalidParameter;
use crate::workspace::SensorRange;
use flotor_hal::glam::DVec3;

/// Longest time one call of [`Simulation::advance`] simulates, ns: ten ticks of the slowest servo (100 Hz).
/// It bounds what a tick may cost after a delay of the host.
pub const MAX_ADVANCE_NS: u64 = 100_000_000;

/// Distance of the samples of the hand's intention, ns.
const GRID_NS: u64 = MAX_PIECE_NS;

/// What a simulation is built from.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The flotor.
    pub flotor: FlotorParameters,
    /// The hand.
    pub hand: Hand,
    /// Where the flotor starts.
    pub start: State,
    /// Time between two ticks if all goes well, ns. Any other works too, and costs a little more.
    pub tick_ns: u64,
    /// Seed of what the hand does without meaning to.
    pub seed: u64,
}

impl Setup {
    /// The demo: the thesis's flotor at home in an exploring hand, at 1 kHz.
    pub const DEMO: Self = Self {
        flotor: FlotorParameters::THESIS,
        hand: Hand::EXPLORING,
        start: State::HOME,
        tick_ns: 1_000_000,
        seed: 0,
    };
}

/// What went wrong during a tick. Nothing here stops the simulation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Incidents {
    /// The wrench held a NaN or an infinity; the coils gave nothing instead.
    pub wrench_rejected: bool,
    /// The motion left every physical range; the flotor was stopped where it was and a new energy balance
    /// began.
    pub stopped: bool,
    /// The tick was longer than [`MAX_ADVANCE_NS`]; only that much was simulated.
    pub cut_short: bool,
}

impl Incidents {
    /// True if nothing went wrong. Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// A running simulation.
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

impl Simulation {
    /// A simulation at time 0. Not real-time.
    ///
    /// # Errors
    /// If a parameter is not physical; the error names it.
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

    /// Back to the start: time 0, first state, new energy balance. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        self.plant.place(&self.setup.start);
        self.ledger = Ledger::open(self.plant.energy());
        self.time_ns = 0;
        self.guidance = Guidance::NONE;
        self.stroke = Stroke::at(0, &self.setup.hand.trajectory, &self.wavering);
    }

    /// Replaces the hand from now on; its trajectory keeps counting from the start of the run.
    ///
    /// Not real-time.
    ///
    /// # Errors
    /// If a parameter is not physical; the hand then stays as it was.
    pub fn set_hand(&mut self, hand: Hand) -> Result<(), InvalidParameter> {
        let setup = Setup { hand, ..self.setup.clone() };
        self.plant = plant(&setup, &self.plant.state())?;
        self.wavering = Wavering::new(setup.hand.unsteadiness, setup.seed);
        self.guidance = Guidance::NONE;
        self.stroke = Stroke::at(self.time_ns, &setup.hand.trajectory, &self.wavering);
        self.setup = setup;
        Ok(())
    }

    /// Lets the client `guide` take the hand (see [`guidance`](crate::hand::guidance)), or keep it; 0 releases the hand.
    /// Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`NotGuiding`] while another client guides.
    pub fn guide(&mut self, guide: f64) -> Result<(), NotGuiding> {
        let start = self.stroke.follower(&self.plant.state());
        self.guidance.take(guide, self.time_ns, start)
    }

    /// Moves the target of the guide along an axis (0 to 2: x, y, z of the device frame), m. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`NotGuiding`] if the client of the latest [`Self::guide`] does not guide.
    pub fn guide_to(&mut self, axis: usize, target_m: f64) -> Result<(), NotGuiding> {
        self.guidance.aim_at(axis, target_m, self.time_ns)
    }

    /// Number of the client that guides the hand; 0 for none. Real-time: bounded, no allocation.
    #[must_use]
    pub fn guided_by(&self) -> f64 {
        self.guidance.guide()
    }

    /// Moves on by `dt_ns` under a coil wrench that is constant over that time (zero-order hold).
    ///
    /// Splitting a tick changes nothing but rounding in translation and the Runge-Kutta error in rotation.
    /// Total: a wrench that is not finite counts as none. Real-time: bounded, no allocation.
    pub fn advance(&mut self, dt_ns: u64, coils: Wrench) -> Incidents {
        let wrench_rejected = !coils.is_finite();
        let coils = if wrench_rejected { &Wrench::ZERO } else { &coils };
        Incidents { wrench_rejected, ..self.advance_under(dt_ns, coils) }
    }

    /// [`Self::advance`] with a finite wrench that stays where it is: a copy would have to be in memory before
    /// the motion starts.
    #[inline]
    pub(crate) fn advance_under(&mut self, dt_ns: u64, coils: &Wrench) -> Incidents {
        debug_assert!(coils.is_finite());
        let mut incidents = Incidents { cut_short: dt_ns > MAX_ADVANCE_NS, ..Incidents::default() };
        let end_ns = self.time_ns.saturating_add(dt_ns.min(MAX_ADVANCE_NS));
        while self.time_ns < end_ns {
            let (piece_ns, intention) = self.next_piece(end_ns);
            match self.plant.advance(piece_ns, coils, intention.as_ref()) {
                Outcome::Moved(work) => self.ledger.book(work, self.plant.energy()),
                Outcome::Stopped => {
                    incidents.stopped = true;
                    self.ledger = Ledger::open(self.plant.energy());
                }
            }
            self.time_ns += piece_ns;
        }
        incidents
    }

    /// Time since the start, ns. Real-time: bounded, no allocation.
    #[must_use]
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Pose and velocity of the flotor now. Real-time: bounded, no allocation.
    #[must_use]
    pub fn state(&self) -> State {
        self.plant.state()
    }

    /// Whether the sensors see the flotor now. Real-time: bounded, no allocation.
    #[must_use]
    pub fn sensor_range(&self) -> SensorRange {
        let state = self.plant.state();
        SensorRange::of(state.position_m, state.orientation)
    }

    /// What the trajectory of the hand aims at now; nothing while it is off the handle. Real-time: bounded, no allocation.
    #[must_use]
    pub fn aim(&self) -> Option<Aim> {
        self.setup.hand.trajectory.aim(self.time_ns)
    }

    /// Energy balance since the start. Real-time: bounded, no allocation.
    #[must_use]
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// What the simulation was built from, with the hand of the latest [`Self::set_hand`]. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Length of the piece that starts now, ns, and the intention of the hand meanwhile; nothing while it is off the
    /// handle. It lasts to the tick's end, the next grid point, or the moment the hand releases the handle.
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

/// Flotor and hand of a setup, the flotor in `state`.
fn plant(setup: &Setup, state: &State) -> Result<Plant, InvalidParameter> {
    let Setup { flotor, hand, tick_ns, .. } = setup;
    hand.check()?;
    Plant::yielding(flotor, &hand.impedance, &hand.trajectory.yieldings(), state, *tick_ns)
}

/// What the hand aims at between two grid points of the clock.
#[derive(Clone, Copy, Debug)]
struct Stroke {
    start_ns: u64,
    end_ns: u64,
    start: Option<Aim>,
    end: Option<Aim>,
    /// Whether a guide has a share in it: a release that the trajectory plans is then not made.
    is_guided: bool,
    /// Under a guide: what the trajectory would aim at at the end.
    scripted: Option<Aim>,
}

impl Stroke {
    /// The stroke under way at a time.
    fn at(time_ns: u64, trajectory: &Trajectory, wavering: &Wavering) -> Self {
        let start_ns = time_ns - time_ns % GRID_NS;
        let end_ns = start_ns.saturating_add(GRID_NS);
        let aim = |time_ns| Self::aim(time_ns, trajectory, wavering);
        Self { start_ns, end_ns, start: aim(start_ns), end: aim(end_ns), is_guided: false, scripted: None }
    }

    /// On to the next stroke, which starts where this one ends: their common grid point is evaluated once.
    #[inline(never)] // what calls it would keep all its numbers in memory over the sine
    fn go_on(&mut self, trajectory: &Trajectory, wavering: &Wavering) {
        (self.start_ns, self.start) = (self.end_ns, self.end);
        self.end_ns = self.end_ns.saturating_add(GRID_NS);
        self.end = Self::aim(self.end_ns, trajectory, wavering);
        self.is_guided = false;
    }

    /// Lets the guide move the end of this stroke, at whose start the handle is in `state`.
    #[cold] // hands mostly follow their trajectory
    fn be_guided(&mut self, guidance: &mut Guidance, state: &State) {
        let (scripted, dt_s) = (self.end, seconds(GRID_NS));
        let (end, velocity_m_per_s) = guidance.advance(self.end_ns, dt_s, scripted, &Follower::of(state));
        (self.end, self.is_guided) = (end, !guidance.is_free());
        if guidance.is_free() {
            self.start = self.scripted; // the trajectory goes on as if there had been no guide
        } else if let (Some(start), Some(end), Some(scripted)) = (&mut self.start, end, scripted) {
            // Where a force is meant, the intended position goes with the handle and the damper of the hand does not.
            let from_m = end.pose.position_m - velocity_m_per_s * dt_s;
            start.pose.position_m = DVec3::select(scripted.yielding, from_m, start.pose.position_m);
        }
        self.scripted = scripted;
    }

    /// Returns the intended motion of the hand at the end of the stroke, where a guide begins. Without a grip, the motion of the handle.
    #[cold] // a client takes the hand seldom
    fn follower(&self, state: &State) -> Follower {
        self.drawn(self.end_ns).map_or_else(
            || Follower::of(state),
            |meant| {
                let pose = Pose { position_m: meant.position_m, orientation: meant.orientation };
                Follower::moving(pose, meant.velocity_m_per_s)
            },
        )
    }

    /// What an unsteady hand aims at at a time.
    #[inline]
    fn aim(time_ns: u64, trajectory: &Trajectory, wavering: &Wavering) -> Option<Aim> {
        let aim = trajectory.aim(time_ns)?;
        Some(wavered(&aim, wavering, seconds(time_ns)))
    }

    /// The aim at a time during the stroke, drawn straight to its end: position on the chord with
    /// its slope as velocity; orientation and force, which the plant takes as constant, halfway. Where the hand
    /// releases the handle before the end it stays.
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

/// An aim as an unsteady hand has it.
#[inline]
fn wavered(aim: &Aim, wavering: &Wavering, time_s: f64) -> Aim {
    let pose = Pose { position_m: aim.pose.position_m + wavering.offset_m(time_s), ..aim.pose };
    Aim { pose, force_n: wavering.force_n(aim.force_n, time_s), ..*aim }
}

#[inline]
fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1.0e-9
}

#[cfg(test)]
mod tests;
