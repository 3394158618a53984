//! Test device: the simulated flotor with range, forces, latency and fastest rate of another maker's device, as its plugin declares them,
//! and with the mass of its handle. A weight rests on the handle from the second second on.
//!
//! The simulation runs in pieces of 0.25 ms, of which all ticks and latencies here are multiples.

use flotor_hal::abi::{Entry, device_entry};
use flotor_hal::{
    Axes, Capabilities, Choices, Cycle, DVec3, DeviceInfo, DeviceState, Fault, LoopConfig, Opened, Parameter,
    Pose, Refusal, Settings, Simple, SimpleDevice, StopFlag, Tick, Twist, Wrench, choices,
};
use flotor_simulated::hand::Hand;
use flotor_simulated::plant::{Drag, FlotorParameters, State, Wrench as CoilWrench};
use flotor_simulated::simulation::{Setup, Simulation};
use std::collections::VecDeque;

/// Numbers of a device.
#[derive(Debug)]
pub(super) struct Kind {
    pub(super) name: &'static str,
    /// Range along each axis to both sides, m.
    range_m: [f64; 3],
    pub(super) max_force_n: f64,
    slew_n_per_s: f64,
    latency_s: f64,
    /// Largest stiffness, N/m; 0: not declared.
    max_stiffness_n_per_m: f64,
    pub(super) fastest_hz: f64,
    /// Mass at the handle (estimate), and damping of the mechanism (a low one).
    mass_kg: f64,
    damping_ns_per_m: f64,
}

/// Declarations of the plugins `falcon`, `inverse3`, `force-dimension` (an omega) and `touch` (as its SDK reports a Touch).
pub(super) const KINDS: [Kind; 4] = [
    Kind {
        name: "Falcon",
        range_m: [0.05; 3],
        max_force_n: 8.0,
        slew_n_per_s: 8.0e3,
        latency_s: 2.0e-3,
        max_stiffness_n_per_m: 0.0,
        fastest_hz: 1000.0,
        mass_kg: 0.25,
        damping_ns_per_m: 0.3,
    },
    Kind {
        name: "Inverse3",
        range_m: [0.06; 3],
        max_force_n: 5.0,
        slew_n_per_s: 5.0e3,
        latency_s: 1.0e-3,
        max_stiffness_n_per_m: 0.0,
        fastest_hz: 4000.0,
        mass_kg: 0.15,
        damping_ns_per_m: 0.3,
    },
    Kind {
        name: "omega",
        range_m: [0.08, 0.055, 0.08],
        max_force_n: 12.0,
        slew_n_per_s: 12.0e3,
        latency_s: 1.0e-3,
        max_stiffness_n_per_m: 0.0,
        fastest_hz: 4000.0,
        mass_kg: 0.25,
        damping_ns_per_m: 0.3,
    },
    Kind {
        name: "Touch",
        range_m: [0.035; 3],
        max_force_n: 3.3,
        slew_n_per_s: 3.3e3,
        latency_s: 1.0e-3,
        max_stiffness_n_per_m: 700.0,
        fastest_hz: 1000.0,
        mass_kg: 0.045,
        damping_ns_per_m: 0.1,
    },
];

const NAMES: Choices = choices!["Falcon", "Inverse3", "omega", "Touch"];

impl Kind {
    pub(super) const fn capabilities(&self) -> Capabilities {
        Capabilities {
            range_m: self.range_m,
            max_stiffness_n_per_m: self.max_stiffness_n_per_m,
            rate_hz: [100.0, self.fastest_hz],
            ..Capabilities::driving(Axes::TRANSLATION)
                .with_limits(self.max_force_n, 0.0)
                .with_slew(self.slew_n_per_s, f64::INFINITY)
                .with_latency(self.latency_s)
        }
    }

    fn flotor(&self) -> FlotorParameters {
        let drag = Drag { translational_ns_per_m: self.damping_ns_per_m, ..FlotorParameters::THESIS.drag };
        FlotorParameters { mass_kg: self.mass_kg, drag, ..FlotorParameters::THESIS }
    }
}

/// Length of a piece of the simulation, ns.
const PIECE_NS: u64 = 250_000;
/// Time at which the weight begins to rise, over a second, s: the force of the host has its full size.
const LAID_ON_S: f64 = 1.0;

/// Handle of a device, free of any hand.
pub(super) struct Handle {
    kind: &'static Kind,
    weight_n: f64,
    simulation: Simulation,
    /// States of the pieces within the latency, the oldest first.
    states: VecDeque<State>,
    /// Position of the last sample, m.
    last_m: DVec3,
    held: Wrench,
}

impl SimpleDevice for Handle {
    const INFO: DeviceInfo =
        DeviceInfo::new("handle", "Handle", "The simulated flotor with the numbers of other devices")
            .simulated();
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::choice("kind", NAMES, 0, "Device whose numbers count"),
        Parameter::real("weight_n", "N", 0.0, 10.0, 0.0, "Weight on the handle"),
        Parameter::real("start_z_mm", "mm", -100.0, 100.0, 0.0, "Height at the start"),
    ];
    type Stop = StopFlag;

    fn open(settings: &Settings<'_>) -> Result<Opened<Self>, Refusal> {
        let kind = KINDS.get(settings.choice_or_default("kind")).unwrap_or(&KINDS[0]);
        let position_m = DVec3::Z * settings.number_or_default("start_z_mm") * 1.0e-3;
        let start = State { position_m, ..State::HOME };
        let setup =
            Setup { flotor: kind.flotor(), hand: Hand::AWAY, start, tick_ns: PIECE_NS, ..Setup::DEMO };
        let simulation = Simulation::new(&setup).map_err(Refusal::parameter)?;
        let weight_n = settings.number_or_default("weight_n");
        let device = Self {
            kind,
            weight_n,
            simulation,
            states: VecDeque::new(),
            last_m: position_m,
            held: Wrench::ZERO,
        };
        Ok(Opened { device, capabilities: kind.capabilities(), stop: StopFlag::default() })
    }

    fn activate(&mut self, _: &LoopConfig) -> Result<(), Refusal> {
        self.simulation.reset();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of pieces
        let late = (self.kind.latency_s * 1.0e9 / PIECE_NS as f64).round() as usize;
        self.states = std::iter::repeat_n(self.simulation.state(), late + 1).collect();
        Ok(())
    }

    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        for _ in 0..tick.dt_ns / PIECE_NS {
            let laid_on = (self.simulation.time_ns() as f64 * 1.0e-9 - LAID_ON_S).clamp(0.0, 1.0);
            let force_n = self.held.force() - DVec3::Z * self.weight_n * laid_on;
            let _ = self.simulation.advance(PIECE_NS, CoilWrench { force_n, torque_nm: DVec3::ZERO });
            self.states.rotate_left(1);
            if let Some(newest) = self.states.back_mut() {
                *newest = self.simulation.state();
            }
        }
        let position_m = self.states.front().map_or(self.last_m, |sampled| sampled.position_m);
        let moved_m = position_m - self.last_m;
        self.last_m = position_m;
        let velocity = if tick.dt_ns > 0 { moved_m / (tick.dt_ns as f64 * 1.0e-9) } else { DVec3::ZERO };
        *state = DeviceState {
            pose: Pose::new(position_m, DeviceState::HOME.pose.orientation()),
            twist: Twist::new(velocity, DVec3::ZERO),
            delivered: self.held,
            sampled_ns: tick.time_ns,
            ..DeviceState::HOME
        };
        let is_inside = position_m.abs().cmple(DVec3::from_array(self.kind.range_m)).all();
        if is_inside { Cycle::Fresh } else { Cycle::Fault(Fault::SensorOutOfRange) }
    }

    fn write(&mut self, _: &Tick, wrench: &Wrench) -> Cycle {
        let most_n = DVec3::splat(self.kind.max_force_n);
        self.held = Wrench::from_force(wrench.force().clamp(-most_n, most_n));
        Cycle::Fresh
    }
}

/// Entry of the plugin `handle`.
pub(super) static ENTRY: Entry = device_entry::<Simple<Handle>>();
