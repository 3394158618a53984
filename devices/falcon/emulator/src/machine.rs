//! State machine of the device behind its USB endpoints: replies to requests and bytes, and due packets.

use clap::ValueEnum;
use flotor_emulation::rig::Stand;
use flotor_falcon::boot::{AGREED, LOAD_DIVISOR, PROMPT, PROMPT_ANSWER, PROMPT_DIVISOR, RUN_DIVISOR};
use flotor_falcon::chip::{PAYLOAD_BYTES, Request};
use flotor_falcon::kinematics::{CENTRE_M, angles_rad, counts, inverse, posture};
use flotor_falcon::protocol::{ALL_HOMED, Command, Frames, Homing, Parsed, Report};
use flotor_hal::{DVec3, VerticalCalibration};
use std::collections::VecDeque;
use std::time::Duration;

/// Modem and line status at the head of each packet: no modem lines connected; transmitter empty.
pub const STATUS: [u8; 2] = [0x01, 0x60];
/// Latency timer after a reset, ms.
const LATENCY_MS: u16 = 16;
/// Number of commands with the homing bit until the hand has homed the handle (pushed in and pulled out).
const HOMING_COMMANDS: u32 = 50;
/// Motor word per torque of an arm, 1/(N·m): the plugin's default.
const WORDS_PER_NM: f64 = 10_000.0;

/// Power history of a device that was just plugged in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Power {
    /// Power was off: the boot loader waits for a firmware, the arms are not homed.
    #[value(help = "After power-off: the boot loader waits for a firmware (any bytes); arms are not homed")]
    Off,
    /// Power stayed on since an earlier program: the firmware runs, the arms are homed.
    #[value(help = "The firmware runs, and the arms are homed")]
    On,
}

/// Fault that a test injects into the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The loader never replies to the prompt.
    NoPrompt,
    /// The loader replies with this byte instead of the agreement byte.
    NotAgreed(u8),
    /// The echo of this byte of the firmware has its lowest bit changed.
    WrongEcho(usize),
    /// This byte of the firmware has no echo.
    NoEcho(usize),
    /// The firmware does not start.
    NoReport,
    /// From this command on: packets of one byte, shorter than their two status bytes.
    ShortPacket(u64),
    /// From this command on: one surplus report per command.
    StaleReport(u64),
    /// From this command on: packets with their status bytes alone.
    IdlePackets(u64),
    /// From this command on: malformed bytes instead of reports.
    Noise(u64),
    /// From this command on: the arms are not homed and count zero.
    Unhomed(u64),
    /// From this command on: encoder counts outside the linkage's geometry.
    NoPosture(u64),
    /// From this command on: the device is gone, as after a reset of the hub.
    HubReset(u64),
}

/// Program in control of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Loader, waiting for its prompt.
    Loader,
    /// Loader, prompted, waiting for the agreement byte.
    Prompted,
    /// Loader, receiving a firmware: number of bytes so far.
    Loading(usize),
    /// Firmware, running.
    Running,
}

/// Motion of the handle by a hand or a stand, in the maker's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Sinusoidal motion by a hand.
    ToAndFro {
        /// Middle of the motion, m.
        centre_m: DVec3,
        /// Amplitude from the middle to the ends, m.
        amplitude_m: DVec3,
        /// Frequency, Hz.
        frequency_hz: f64,
    },
    /// Handle held by the stand of a calibration rig, at heights above and below the centre of the range. The clock of
    /// the stand advances by a millisecond with each command, so that a delayed host skips no height.
    OnStand(Stand),
}

impl Motion {
    /// Returns the motion of a handle held at a position, m.
    #[must_use]
    pub fn held(place_m: DVec3) -> Self {
        Self::ToAndFro { centre_m: place_m, amplitude_m: DVec3::ZERO, frequency_hz: 0.0 }
    }

    /// Returns the position of the handle at a time and after a number of commands, m.
    fn place_m(&self, at: Duration, commands: u64) -> DVec3 {
        match self {
            Self::ToAndFro { centre_m, amplitude_m, frequency_hz } => {
                let phase = std::f64::consts::TAU * frequency_hz * at.as_secs_f64();
                *centre_m + *amplitude_m * flotor_hal::math::sin(phase)
            }
            // Up is y.
            Self::OnStand(stand) => CENTRE_M + DVec3::Y * stand.height_m(Duration::from_millis(commands)),
        }
    }
}

/// Emulated Falcon: FTDI chip, boot loader, firmware and handle.
#[derive(Clone, Debug)]
pub struct Machine {
    motion: Motion,
    /// Ratio of delivered to commanded vertical force, by the height above the centre of the range.
    share: VerticalCalibration,
    /// Pressed buttons, one bit each.
    buttons: u32,
    fault: Option<Fault>,
    stage: Stage,
    divisor: u16,
    latency_ms: u16,
    /// Time of the last packet.
    last_packet: Duration,
    to_host: VecDeque<u8>,
    received: VecDeque<u8>,
    frames: Frames,
    homed: u8,
    homing_commands: u32,
    /// Encoder counts at the start of the firmware: the zero of the counts until homing.
    began: Option<[i16; 3]>,
    commands: u64,
    command: Command,
    is_gone: bool,
}

impl Machine {
    /// Creates a device that was just plugged in, with a motion of its handle and no pressed button.
    #[must_use]
    pub fn new(power: Power, motion: Motion) -> Self {
        let (stage, homed) = match power {
            Power::Off => (Stage::Loader, 0),
            Power::On => (Stage::Running, ALL_HOMED),
        };
        Self {
            motion,
            share: VerticalCalibration::NONE,
            buttons: 0,
            fault: None,
            stage,
            divisor: 0,
            latency_ms: LATENCY_MS,
            last_packet: Duration::ZERO,
            to_host: VecDeque::new(),
            received: VecDeque::new(),
            frames: Frames::default(),
            homed,
            homing_commands: 0,
            began: None,
            commands: 0,
            command: Command::REST,
            is_gone: false,
        }
    }

    /// Injects a fault, or clears it with `None`.
    pub fn breaks(&mut self, fault: Option<Fault>) {
        self.fault = fault;
    }

    /// Replaces the motion of the handle and the pressed buttons.
    pub fn moves(&mut self, motion: Motion, buttons: u32) {
        (self.motion, self.buttons) = (motion, buttons);
    }

    /// Sets the ratio of delivered to commanded vertical force, by the height above the centre of the range.
    pub fn delivers(&mut self, share: VerticalCalibration) {
        self.share = share;
    }

    /// Returns the newest command; [`Command::REST`] before the first.
    #[must_use]
    pub fn command(&self) -> Command {
        self.command
    }

    /// Returns the number of commands so far.
    #[must_use]
    pub fn commands(&self) -> u64 {
        self.commands
    }

    /// Returns true once the device has left the bus ([`Fault::HubReset`]).
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.is_gone
    }

    /// Returns the force of the motors on the hand under the newest command, N, in the maker's frame; `None` where the
    /// linkage has no posture.
    #[must_use]
    pub fn force_n(&self, at: Duration) -> Option<DVec3> {
        let place_m = self.motion.place_m(at, self.commands);
        let torques_nm = DVec3::from_array(self.command.motors.map(f64::from)) / -WORDS_PER_NM;
        let force_n = posture(inverse(place_m)?, CENTRE_M)?.force_n(torques_nm);
        // Up is y.
        Some(force_n.with_y(force_n.y * self.share.share(place_m.y - CENTRE_M.y)))
    }

    /// Carries out a request from the host to the chip and returns the reply; `None` for an unknown request.
    pub fn request(&mut self, number: u8, value: u16) -> Option<Vec<u8>> {
        match number {
            _ if number == Request::Reset as u8 => {
                match value {
                    1 => self.to_host.clear(),
                    2 => self.received.clear(),
                    _ => {
                        self.to_host.clear();
                        self.received.clear();
                        self.latency_ms = LATENCY_MS;
                    }
                }
                // Stale bytes of the fault injection come from beyond the chip, not from its buffer.
            }
            _ if number == Request::BaudRate as u8 => {
                self.divisor = value;
                // The switch to its baud rate starts the firmware.
                if let (Stage::Loading(1..), RUN_DIVISOR) = (self.stage, value)
                    && self.fault != Some(Fault::NoReport)
                {
                    (self.stage, self.homed, self.homing_commands) = (Stage::Running, 0, 0);
                    self.began = None;
                }
            }
            _ if number == Request::LatencyTimer as u8 => self.latency_ms = value.clamp(1, 255),
            // No effect here: modem lines, flow control, format, event and error characters, pin mode.
            1 | 2 | 4 | 6 | 7 | 0x0b => {}
            _ => return None,
        }
        Some(Vec::new())
    }

    /// Returns the reply to a read request from the host; `None` for an unknown request.
    #[must_use]
    pub fn question(&self, number: u8) -> Option<Vec<u8>> {
        match number {
            5 => Some(STATUS.to_vec()),
            0x0a => Some(self.latency_ms.to_le_bytes().get(..1)?.to_vec()),
            0x0c => Some(vec![0]),
            // Chip without an EEPROM.
            0x90 => Some(vec![0xff, 0xff]),
            _ => None,
        }
    }

    /// Processes bytes from the host on the serial line (prompt, firmware or commands), and queues the replies for
    /// [`Self::packet`]; bytes at a wrong baud rate are lost.
    pub fn output(&mut self, bytes: &[u8], at: Duration) {
        for byte in bytes {
            match (self.stage, self.divisor) {
                (Stage::Running, RUN_DIVISOR) => {
                    if let Parsed::Frame(frame) = self.frames.push(*byte)
                        && let Some(command) = Command::read(&frame)
                    {
                        self.execute(command, at);
                    }
                }
                (Stage::Loader | Stage::Prompted, PROMPT_DIVISOR) => self.prompted(*byte),
                (Stage::Loading(_), PROMPT_DIVISOR) => {
                    // The handshake restarts.
                    self.stage = Stage::Loader;
                    self.prompted(*byte);
                }
                (Stage::Prompted, LOAD_DIVISOR) if *byte == AGREED => {
                    self.stage = Stage::Loading(0);
                    self.to_host.push_back(match self.fault {
                        Some(Fault::NotAgreed(other)) => other,
                        _ => AGREED,
                    });
                }
                (Stage::Loading(length), LOAD_DIVISOR) => {
                    self.stage = Stage::Loading(length + 1);
                    match self.fault {
                        Some(Fault::NoEcho(missing)) if missing == length => {}
                        Some(Fault::WrongEcho(wrong)) if wrong == length => self.to_host.push_back(byte ^ 1),
                        _ => self.to_host.push_back(*byte),
                    }
                }
                // Bytes at a wrong baud rate are lost.
                _ => {}
            }
        }
    }

    fn prompted(&mut self, byte: u8) {
        self.received.push_back(byte);
        while self.received.len() > PROMPT.len() {
            self.received.pop_front();
        }
        if self.received.iter().eq(&PROMPT) && self.fault != Some(Fault::NoPrompt) {
            self.received.clear();
            self.stage = Stage::Prompted;
            self.to_host.extend(PROMPT_ANSWER);
        }
    }

    /// Carries out a command and queues a report.
    fn execute(&mut self, command: Command, at: Duration) {
        self.command = command;
        self.commands += 1;
        let since = |first: u64| self.commands >= first;
        if command.homing == Homing::Wanted && self.homed != ALL_HOMED {
            self.homing_commands += 1;
            if self.homing_commands >= HOMING_COMMANDS {
                self.homed = ALL_HOMED;
            }
        }
        let mut homed = self.homed;
        let mut encoders = inverse(self.motion.place_m(at, self.commands)).map_or([0; 3], counts);
        if homed != ALL_HOMED {
            let began = self.began.get_or_insert(encoders);
            encoders = std::array::from_fn(|arm| encoders[arm].wrapping_sub(began[arm]));
        }
        match self.fault {
            Some(Fault::HubReset(first)) if since(first) => {
                self.is_gone = true;
                return;
            }
            Some(Fault::IdlePackets(first)) if since(first) => return,
            Some(Fault::Noise(first)) if since(first) => {
                self.to_host.extend([0xa5; 16]);
                return;
            }
            Some(Fault::Unhomed(first)) if since(first) => (homed, encoders) = (0, [0; 3]),
            Some(Fault::NoPosture(first)) if since(first) => encoders = [i16::MAX, i16::MIN, 0],
            _ => {}
        }
        let report = Report { encoders, buttons: self.buttons, homed };
        self.to_host.extend(report.bytes());
        if let Some(Fault::StaleReport(first)) = self.fault
            && since(first)
        {
            self.to_host.extend(report.bytes());
        }
    }

    /// Removes and returns the due packet for a waiting host, and restarts the latency timer: status bytes, then bytes of the
    /// serial line, if any. A packet is due when full or when the latency timer has expired; `None` if no packet is due.
    pub fn packet(&mut self, at: Duration) -> Option<Vec<u8>> {
        let latency = Duration::from_millis(u64::from(self.latency_ms));
        let is_due = at.saturating_sub(self.last_packet) >= latency;
        if self.to_host.len() < PAYLOAD_BYTES && !is_due {
            return None;
        }
        self.last_packet = at;
        if let Some(Fault::ShortPacket(first)) = self.fault
            && self.commands >= first
        {
            return Some(vec![STATUS[0]]);
        }
        let length = self.to_host.len().min(PAYLOAD_BYTES);
        Some(STATUS.into_iter().chain(self.to_host.drain(..length)).collect())
    }
}

/// Returns the position of the handle for encoder counts, m, in the maker's frame; `None` for counts outside the linkage's
/// geometry.
#[must_use]
pub fn place_of(encoders: [i16; 3]) -> Option<DVec3> {
    Some(posture(angles_rad(encoders), CENTRE_M)?.position_m())
}
