//! Device as seen by a program: pose of the handle, wrench on the hand, and the next tick.

use flotor_core::mapping::Mapping;
use flotor_core::trace::TickRecord;
use flotor_hal::{Axes as Driven, Capabilities, DQuat, DVec3, GripAxis, GripState, Wrench};
use flotor_live::WrenchLimits;
use flotor_servo::{monotonic_ns, sleep_until};
use flotor_session::Tap;
use flotor_session::program::{Connected, NotFinite, Port, ProgramCounts};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Longest wait for a tick, ns.
const LONGEST_WAIT_NS: u64 = 10_000_000;
/// Poll interval for an overdue tick, ns.
const LOOK_NS: u64 = 20_000;
/// Usual time from a tick's deadline to its end, ns.
const TICK_NS: u64 = 30_000;
/// Time over which the rate of commands is measured, ns.
const RATE_WINDOW_NS: u64 = 500_000_000;

/// Sensed and driven axes of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// Translations only.
    Three,
    /// Driven translations, and sensed rotations without torque.
    ThreeAndWrist,
    /// Driven translations and rotations.
    Six,
}

/// Device of the scene as seen by a program: pose and wrench in the frame of the device's model `program`.
pub struct Station {
    name: String,
    plugin: String,
    port: Port,
    mapping: Mapping,
    capabilities: Capabilities,
    /// Declared grip; `None` without one.
    grip: Option<GripAxis>,
    /// Limits of the wrench on the hand: N, N·m.
    most: [f64; 2],
    tap: Tap,
    period_ns: u64,
    ramp_ns: u64,
    opened: AtomicU64,
    is_open: AtomicBool,
    /// Wait record of a program that is the only caller.
    pub(crate) turn: Turn,
    /// Estimated start of the loop, ns of the machine's clock; the smallest estimate so far.
    begun_ns: AtomicU64,
    rate: Mutex<Rate>,
}

/// Record of the ticks that a caller has waited for.
#[derive(Debug, Default)]
pub struct Turn {
    /// Last tick that was waited for.
    waited: AtomicU64,
    /// Time of the last return of a wait, ns of the machine's clock.
    returned_ns: AtomicU64,
}

/// Measured rate of commands.
#[derive(Clone, Copy, Debug, Default)]
struct Rate {
    since_ns: u64,
    commands: u64,
    hz: f64,
}

/// State of a device at the end of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct State {
    /// Number of ticks so far.
    pub ticks: u64,
    /// Position of the handle, m, Flotor's axes.
    pub position_m: DVec3,
    /// Orientation of the handle, Flotor's axes.
    pub orientation: DQuat,
    /// Velocity of the handle, m/s, Flotor's axes.
    pub velocity_m_per_s: DVec3,
    /// Angular velocity of the handle, rad/s, Flotor's axes.
    pub angular_velocity_rad_per_s: DVec3,
    /// Pressed buttons, one bit each.
    pub buttons: u32,
    /// Wrench sent to the device, after all limits, N and N·m, Flotor's axes.
    pub applied: Wrench,
    /// Grip, and the effort sent there after all limits, in the units of its kind; `None` without one.
    pub grip: Option<(GripState, f64)>,
}

impl Station {
    pub(crate) fn new(
        [name, plugin]: [String; 2],
        connected: Connected,
        (capabilities, grip): (Capabilities, Option<GripAxis>),
        limits: &WrenchLimits,
        tap: Tap,
        period_ns: u64,
    ) -> Self {
        let Connected { port, mapping, ramp_ns, .. } = connected;
        let largest = |axes: [f64; 3], told: &[Option<f64>; 3], norm: Option<f64>| {
            let axis = |(most, told): (f64, &Option<f64>)| told.map_or(most, |told| told.min(most));
            let axes = axes.into_iter().zip(told).map(axis);
            let most = axes.fold(0.0, f64::max);
            norm.map_or(most, |norm| norm.min(most))
        };
        let most = [
            largest(capabilities.max_force_n, &limits.force_n, limits.force_norm_n),
            largest(capabilities.max_torque_nm, &limits.torque_nm, limits.torque_norm_nm),
        ];
        Self {
            name,
            plugin,
            port,
            mapping,
            capabilities,
            grip,
            most,
            tap,
            period_ns,
            ramp_ns,
            opened: AtomicU64::new(0),
            is_open: AtomicBool::new(false),
            turn: Turn::default(),
            begun_ns: AtomicU64::new(u64::MAX),
            rate: Mutex::new(Rate::default()),
        }
    }

    /// Returns the name of the device in the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the id of the device's plugin.
    #[must_use]
    pub fn plugin(&self) -> &str {
        &self.plugin
    }

    /// Returns the sensed and driven axes of the device.
    #[must_use]
    pub fn axes(&self) -> Axes {
        let Capabilities { sensed, actuated, .. } = self.capabilities;
        match (sensed.contains(Driven::ROTATION), actuated.contains(Driven::ROTATION)) {
            (true, true) => Axes::Six,
            (true, false) => Axes::ThreeAndWrist,
            (false, _) => Axes::Three,
        }
    }

    /// Returns the largest displacement of the handle from the centre along x, y, z, m; 0.05 m if the device states no range.
    #[must_use]
    pub fn range_m(&self) -> DVec3 {
        let [x, y, z] = self.capabilities.range_m;
        let range_m = DVec3::new(x, y, z) / self.mapping.length_to_device(1.0);
        // Default: the range of a desktop device.
        if range_m.max_element() > 0.0 { range_m } else { DVec3::splat(0.05) }
    }

    /// Returns the limits of the wrench on the hand: force, N, and torque, N·m.
    #[must_use]
    pub fn most(&self) -> [f64; 2] {
        self.most
    }

    /// Returns the declared grip of the device; `None` without one.
    #[must_use]
    pub fn grip(&self) -> Option<&GripAxis> {
        self.grip.as_ref()
    }

    /// Returns the largest stiffness that the device renders, N/m; 0: unknown.
    #[must_use]
    pub fn max_stiffness_n_per_m(&self) -> f64 {
        self.capabilities.max_stiffness_n_per_m
    }

    /// Returns the counts of the program's commands.
    #[must_use]
    pub fn counts(&self) -> ProgramCounts {
        self.port.counts()
    }

    /// Returns the number of times that the device was opened.
    #[must_use]
    pub fn opened(&self) -> u64 {
        self.opened.load(Ordering::Relaxed)
    }

    /// Returns true if the device is open.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.is_open.load(Ordering::Acquire)
    }

    pub(crate) fn note_opened(&self) {
        if !self.is_open.swap(true, Ordering::AcqRel) {
            self.opened.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Closes the device, whose force ends with the next tick; returns true if the device was open.
    pub fn close(&self) -> bool {
        self.disable();
        self.port.set_validity(0);
        self.is_open.swap(false, Ordering::AcqRel)
    }

    /// Enables force, which fades in.
    pub fn enable(&self) {
        if !self.port.is_enabled() {
            self.port.enable();
        }
    }

    /// Disables force from the next tick on.
    pub fn disable(&self) {
        self.port.disable();
    }

    /// Returns the fade-in time of force, ns.
    #[must_use]
    pub fn ramp_ns(&self) -> u64 {
        self.ramp_ns
    }

    /// Returns true if force is enabled.
    #[must_use]
    pub fn is_enabled(&self) -> bool {
        self.port.is_enabled()
    }

    /// Sets the time after which a wrench without a newer one expires, ns; 0: as in the scene.
    pub fn set_validity(&self, valid_ns: u64) {
        self.port.set_validity(valid_ns);
    }

    /// Commands a wrench on the hand, Flotor's axes, from the next tick on; `now_ns` is the time for the command rate.
    ///
    /// # Errors
    /// [`NotFinite`]; the previous wrench remains.
    pub fn command(&self, wrench: &Wrench, now_ns: u64) -> Result<(), NotFinite> {
        self.command_with_grip(wrench, 0.0, now_ns)
    }

    /// Commands a wrench as [`Self::command`] does, and the effort at the grip, N or N·m.
    ///
    /// # Errors
    /// [`NotFinite`]; the previous command remains.
    pub fn command_with_grip(&self, wrench: &Wrench, effort: f64, now_ns: u64) -> Result<(), NotFinite> {
        self.port.command_with_grip(wrench, effort)?;
        let mut rate = flotor_core::lock(&self.rate);
        rate.commands += 1;
        let elapsed_ns = now_ns.saturating_sub(rate.since_ns);
        if elapsed_ns >= RATE_WINDOW_NS {
            let hz = rate.commands as f64 / (elapsed_ns as f64 * 1.0e-9);
            *rate = Rate { since_ns: now_ns, commands: 0, hz: if rate.since_ns == 0 { 0.0 } else { hz } };
        }
        Ok(())
    }

    /// Returns the rate of commands over the last complete window of at least half a second, Hz; 0 before.
    #[must_use]
    pub fn command_rate_hz(&self) -> f64 {
        flotor_core::lock(&self.rate).hz
    }

    /// Returns the number of ticks so far.
    #[must_use]
    pub fn ticks(&self) -> u64 {
        self.newest().0
    }

    /// Returns the state at the end of the newest tick.
    #[must_use]
    pub fn state(&self) -> State {
        let (ticks, record) = self.newest();
        let pose = self.mapping.pose_to_model(&record.pose);
        let twist = self.mapping.twist_to_model(&record.twist);
        State {
            ticks,
            position_m: pose.position(),
            orientation: pose.orientation(),
            velocity_m_per_s: twist.linear(),
            angular_velocity_rad_per_s: twist.angular(),
            buttons: record.buttons,
            applied: self.mapping.wrench_to_model(&record.commanded),
            grip: record.grip.map(|grip| {
                let applied = self.mapping.effort_to_model(grip.state.kind(), grip.commanded);
                (self.mapping.grip_to_model(&grip.state), applied)
            }),
        }
    }

    fn newest(&self) -> (u64, TickRecord) {
        loop {
            // Retry: a record is written within tens of nanoseconds.
            if let Some(newest) = self.tap.read() {
                return newest;
            }
            std::hint::spin_loop();
        }
    }

    /// Returns true if there is a tick that the caller has not waited for, and marks it as waited for.
    pub(crate) fn has_unseen_tick(&self, turn: &Turn) -> bool {
        let ticks = self.ticks();
        turn.waited.fetch_max(ticks, Ordering::AcqRel) < ticks
    }

    /// Waits for the next tick on the machine's clock; returns false after 10 ms without a tick. A caller in a loop that is late by a
    /// few ticks does not wait until it has caught up: it runs at the rate of the loop, though single iterations may take more or less
    /// than a period.
    pub(crate) fn wait_for_tick(&self, turn: &Turn) -> bool {
        let entered_ns = monotonic_ns();
        let (entered, _) = self.newest();
        if turn.takes_late_tick(entered, entered_ns) {
            turn.returned_ns.fetch_max(entered_ns, Ordering::Relaxed);
            return true;
        }
        let mut now_ns = entered_ns;
        loop {
            let (ticks, record) = self.newest();
            if ticks > entered {
                turn.waited.fetch_max(entered + 1, Ordering::AcqRel);
                turn.returned_ns.fetch_max(now_ns, Ordering::Relaxed);
                return true;
            }
            if now_ns - entered_ns >= LONGEST_WAIT_NS {
                return false;
            }
            let begun_ns = now_ns.saturating_sub(record.time_ns);
            let begun_ns = self.begun_ns.fetch_min(begun_ns, Ordering::Relaxed).min(begun_ns);
            let due_ns = begun_ns + record.time_ns + self.period_ns + TICK_NS;
            let until_ns = due_ns.max(now_ns + LOOK_NS).min(entered_ns + LONGEST_WAIT_NS);
            sleep_until(until_ns);
            now_ns = monotonic_ns();
        }
    }
}

impl Turn {
    /// Consumes one of the ticks that a caller in a loop was too late for; returns false if there is none.
    fn takes_late_tick(&self, ticks: u64, now_ns: u64) -> bool {
        if now_ns.saturating_sub(self.returned_ns.load(Ordering::Relaxed)) > LONGEST_WAIT_NS {
            self.waited.store(ticks, Ordering::Relaxed); // it is not in a loop
            return false;
        }
        let take = |waited| (waited < ticks).then_some(waited + 1);
        self.waited.fetch_update(Ordering::AcqRel, Ordering::Relaxed, take).is_ok()
    }
}
