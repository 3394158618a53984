//! Emulator of the controller: its firmware, a plant, and a link to the host.
//!
//! The program `flotor-maglev-emulator` loads the simulated flotor as the plant through the plugin contract. Authors of
//! other plugins can use this module directly: a link, a plant, and [`Emulator::serve`].

use crate::controller::{Controller, ControllerConfig, LimitConfig, Reply, Sample};
use clap::ValueEnum;
use flotor_hal::{Capabilities, Wrench};
use flotor_maglev::protocol::description::{AxesPage, LimitsPage, RangesPage, serial_bytes};
use flotor_maglev::protocol::{Condition, Description, Mode, Rejections};
use flotor_maglev::transport::{Incoming, LinkLost, Transport};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Simulated mechanics, advanced by the wrench of each cycle.
pub trait Plant {
    /// Advances the plant by `dt_us` under a constant wrench and returns the sample at the end; 0 only returns the
    /// current sample.
    fn advance(&mut self, dt_us: u64, wrench: &Wrench) -> Sample;

    /// Resets the plant to its initial state.
    fn restart(&mut self);
}

/// Clock of the cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Pace {
    /// The machine's clock: a cycle each period, independent of the host, as on hardware.
    #[value(name = "real", help = "Cycles by the machine's clock")]
    RealTime,
    /// The host's commands: a cycle for each command, so that a host on a virtual clock gets bit-identical runs.
    #[value(help = "A cycle for each command of the host, for a host on a virtual clock")]
    Lockstep,
}

/// Event of an emulated controller, for the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The controller has changed its mode.
    Mode {
        /// The new mode.
        mode: Mode,
        /// Faults and active limits.
        condition: Condition,
        /// Time since the last accepted request, µs.
        silence_us: u64,
        /// The controller's clock, µs.
        at_us: u64,
    },
    /// The link to the host is lost.
    Closed {
        /// Requests rejected while the host was connected.
        rejections: Rejections,
    },
}

/// Period of a cycle in real time, µs.
const CYCLE_US: u64 = 1000;
/// Limit of packets read in one cycle: a burst is from a delayed host, with commands that have expired.
const PACKETS_PER_CYCLE: usize = 16;
/// Poll interval of a lockstep cycle while no command arrives.
const LOCKSTEP_NAP: Duration = Duration::from_micros(20);

/// An emulated controller with its plant.
pub struct Emulator<P> {
    /// Controller, with mode, condition and numbers of rejected requests.
    pub controller: Controller,
    plant: P,
    pace: Pace,
    now_us: u64,
    mode: Mode,
}

impl<P: Plant> Emulator<P> {
    /// Creates a controller with its coils off, over a plant.
    pub fn new(config: ControllerConfig, pace: Pace, plant: P) -> Self {
        let mut emulator =
            Self { controller: Controller::new(config), plant, pace, now_us: 0, mode: Mode::Disarmed };
        emulator.run(0);
        emulator
    }

    /// Serves one host until the link is lost or `stop` is true, and passes mode changes and the end to `log`; then
    /// switches the coils off.
    pub fn serve(&mut self, link: &mut dyn Transport, stop: &AtomicBool, log: &mut dyn FnMut(Event)) {
        let before = *self.controller.intake().rejections();
        let (Ok(()) | Err(LinkLost)) = match self.pace {
            Pace::RealTime => self.serve_in_real_time(link, stop, log),
            Pace::Lockstep => self.serve_in_lockstep(link, stop, log),
        };
        self.controller.link_lost(self.now_us);
        self.tell_mode(log);
        log(Event::Closed { rejections: self.controller.intake().rejections().since(&before) });
    }

    fn serve_in_real_time(
        &mut self,
        link: &mut dyn Transport,
        stop: &AtomicBool,
        log: &mut dyn FnMut(Event),
    ) -> Result<(), LinkLost> {
        let mut deadline = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            self.cycle(link, log)?;
            deadline += Duration::from_micros(CYCLE_US);
            match deadline.checked_duration_since(Instant::now()) {
                // Replies are sent on arrival of the request, as a controller's interrupt does.
                Some(_) => self.receive_until(link, deadline)?,
                // Delayed: missed cycles run in simulated time, so that the watchdog sees the silence.
                None => {
                    let missed_us = u64::try_from(deadline.elapsed().as_micros()).unwrap_or(u64::MAX);
                    for _ in 0..(missed_us / CYCLE_US).min(1000) {
                        deadline += Duration::from_micros(CYCLE_US);
                        self.cycle(link, log)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Receives the pending packets, and runs one cycle of real time.
    fn cycle(&mut self, link: &mut dyn Transport, log: &mut dyn FnMut(Event)) -> Result<(), LinkLost> {
        self.receive_all(link)?;
        self.run(CYCLE_US);
        self.tell_mode(log);
        Ok(())
    }

    fn receive_all(&mut self, link: &mut dyn Transport) -> Result<(), LinkLost> {
        for _ in 0..PACKETS_PER_CYCLE {
            match link.receive()? {
                Incoming::Nothing => break,
                incoming => self.take(link, &incoming)?,
            }
        }
        Ok(())
    }

    fn receive_until(&mut self, link: &mut dyn Transport, deadline: Instant) -> Result<(), LinkLost> {
        while let Some(rest) = deadline.checked_duration_since(Instant::now()) {
            let incoming = link.wait(rest)?;
            self.take(link, &incoming)?;
        }
        Ok(())
    }

    fn take(&mut self, link: &mut dyn Transport, incoming: &Incoming) -> Result<(), LinkLost> {
        match incoming {
            Incoming::Nothing => {}
            Incoming::Malformed => self.controller.receive_malformed(),
            Incoming::Packet(packet) => {
                if let Some(reply) = self.controller.receive(packet, self.now_us) {
                    self.reply(link, reply)?;
                }
            }
        }
        Ok(())
    }

    fn serve_in_lockstep(
        &mut self,
        link: &mut dyn Transport,
        stop: &AtomicBool,
        log: &mut dyn FnMut(Event),
    ) -> Result<(), LinkLost> {
        while !stop.load(Ordering::Relaxed) {
            let packet = match link.receive()? {
                Incoming::Nothing => {
                    std::thread::sleep(LOCKSTEP_NAP);
                    continue;
                }
                Incoming::Malformed => {
                    self.controller.receive_malformed();
                    continue;
                }
                Incoming::Packet(packet) => packet,
            };
            let Some(reply) = self.controller.receive(&packet, self.now_us) else { continue };
            match (reply, self.controller.mode()) {
                // Arming restarts the plant, so that every run is bit-identical.
                (Reply::Status(_), Mode::Armed) => {
                    self.plant.restart();
                    self.run(0);
                }
                (Reply::Commanded(_), _) => self.run(u64::from(self.controller.period_us())),
                _ => {}
            }
            self.reply(link, reply)?;
            self.tell_mode(log);
        }
        Ok(())
    }

    fn reply(&mut self, link: &mut dyn Transport, reply: Reply) -> Result<(), LinkLost> {
        let answer = match reply {
            Reply::Status(acknowledged) | Reply::Commanded(acknowledged) => {
                self.controller.status(acknowledged)
            }
            Reply::Page(page) => page,
        };
        link.send(&answer.encode())
    }

    /// Runs one cycle: applies the wrench for `dt_us` and samples at the end.
    fn run(&mut self, dt_us: u64) {
        let wrench = if dt_us == 0 { Wrench::ZERO } else { self.controller.drive(self.now_us, dt_us) };
        let sample = self.plant.advance(dt_us, &wrench);
        self.now_us += dt_us;
        self.controller.observe(self.now_us, &sample);
    }

    fn tell_mode(&mut self, log: &mut dyn FnMut(Event)) {
        let mode = self.controller.mode();
        if mode != self.mode {
            self.mode = mode;
            let (condition, silence_us) =
                (self.controller.condition(), self.controller.silence_us(self.now_us));
            log(Event::Mode { mode, condition, silence_us, at_us: self.now_us });
        }
    }
}

/// Returns the configuration of a controller for a plant with these capabilities. The largest force and torque are the
/// smaller of the plant's and the published limits; all other limits are those of [`LimitConfig::MAGLEV`].
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // the wire format is f32, latencies are small
pub fn controller_config(capabilities: &Capabilities, pace: Pace, serial: &str) -> ControllerConfig {
    let narrow = |values: [f64; 3]| values.map(|value| value as f32);
    // The smaller of the plant's limits and the published ones.
    let limits = LimitConfig {
        max_force_n: LimitConfig::MAGLEV.max_force_n.min(capabilities.max_force_n.into()),
        max_torque_nm: LimitConfig::MAGLEV.max_torque_nm.min(capabilities.max_torque_nm.into()),
        ..LimitConfig::MAGLEV
    };
    ControllerConfig {
        description: Description {
            axes: AxesPage {
                sensed: 0b11_1111,
                actuated: 0b11_1111,
                resolution_m: capabilities.resolution_m as f32,
                rate_hz: capabilities.rate_hz.map(|rate| rate as f32),
                latency_us: (capabilities.latency_s * 1.0e6) as u32
                    + match pace {
                        // A command waits for the next cycle at most.
                        Pace::RealTime => CYCLE_US as u32,
                        Pace::Lockstep => 0,
                    },
                serial: serial_bytes(serial),
            },
            ranges: RangesPage {
                range_m: narrow(capabilities.range_m),
                range_rad: narrow(capabilities.range_rad),
                max_stiffness_n_per_m: capabilities.max_stiffness_n_per_m as f32,
                force_slew_n_per_s: limits.force_slew_n_per_s as f32,
                torque_slew_nm_per_s: limits.torque_slew_nm_per_s as f32,
            },
            limits: LimitsPage {
                max_force_n: narrow(limits.max_force_n.to_array()),
                max_torque_nm: narrow(limits.max_torque_nm.to_array()),
                longest_watchdog_us: 1_000_000,
            },
        },
        limits,
        hold_us: 50_000,
        landing_us: 500_000,
        hold_damping: [15.0, 0.15],
        // Limit from the smearing of light spots over a millisecond of exposure; no figure is published.
        max_speed_m_per_s: 2.0,
    }
}
