//! The device behind its USB endpoints: what it answers to requests and bytes, and when a packet is due.

use flotor_emulation::rig::Stand;
use flotor_falcon::boot::{AGREED, LOAD_DIVISOR, PROMPT, PROMPT_ANSWER, PROMPT_DIVISOR, RUN_DIVISOR};
use flotor_falcon::chip::{PAYLOAD_BYTES, Request};
use flotor_falcon::kinematics::{CENTRE_M, angles_rad, counts, inverse, posture};
use flotor_falcon::protocol::{ALL_HOMED, Command, Frames, Heard, Homing, Report};
use flotor_hal::{DVec3, VerticalCalibration};
use std::collections::VecDeque;
use std::time::Duration;

/// States of modem and line at the head of each packet: nothing connected to the modem's lines; the line has sent all
/// it had.
pub const STATUS: [u8; 2] = [0x01, 0x60];
/// Latency timer after a reset, ms.
const LATENCY_MS: u16 = 16;
/// Commands with the homing bit until the hand has pushed the handle in and pulled it out.
const HOMING_COMMANDS: u32 = 50;
/// Motor word for a torque of an arm, 1/(N·m), as the plugin has it by default.
const WORDS_PER_NM: f64 = 10_000.0;

/// What a device does that was just plugged in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// Its power was off: the boot loader waits, no arm has met its end.
    Off,
    /// Its firmware runs since an earlier program, and its arms count.
    On,
}

/// Something that goes wrong on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The loader never answers.
    NoPrompt,
    /// The loader says this byte instead of agreeing.
    NotAgreed(u8),
    /// This byte of the firmware comes back with its lowest bit changed.
    WrongEcho(usize),
    /// This byte of the firmware does not come back.
    NoEcho(usize),
    /// The firmware does not run.
    NoReport,
    /// From this command on: a packet without its status.
    ShortPacket(u64),
    /// From this command on: a report too many.
    StaleReport(u64),
    /// From this command on: packets with their status alone.
    IdlePackets(u64),
    /// From this command on: bytes that are no reports.
    Noise(u64),
    /// From this command on: the arms count from nowhere.
    Unhomed(u64),
    /// From this command on: counts that no arms can have.
    NoPosture(u64),
    /// At this command: the hub is reset.
    HubReset(u64),
}

/// Who has the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The loader waits for its prompt.
    Loader,
    /// The loader was asked, and waits for the byte to agree on.
    Prompted,
    /// The loader takes a firmware: so many bytes so far.
    Loading(usize),
    /// The firmware.
    Running,
}

/// Where hand or stand have the handle, in the maker's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// A hand moves it to and fro.
    ToAndFro {
        /// The middle, m.
        centre_m: DVec3,
        /// From there to the ends, m.
        amplitude_m: DVec3,
        /// How often, Hz.
        frequency_hz: f64,
    },
    /// The stand of a calibration rig holds it, above and below the centre of the range. Its clock advances by a
    /// millisecond with each command, so that a delayed host misses no stop.
    OnStand(Stand),
}

impl Motion {
    /// A handle that is held at a place, m.
    #[must_use]
    pub fn held(place_m: DVec3) -> Self {
        Self::ToAndFro { centre_m: place_m, amplitude_m: DVec3::ZERO, frequency_hz: 0.0 }
    }

    /// Where the handle is at a time, and after so many commands, m.
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

/// A device.
#[derive(Clone, Debug)]
pub struct Machine {
    motion: Motion,
    /// Share of a vertical force that arrives, by the height above the centre of the range.
    share: VerticalCalibration,
    /// Buttons that the hand presses.
    buttons: u32,
    fault: Option<Fault>,
    stage: Stage,
    divisor: u16,
    latency_ms: u16,
    /// When the last packet went.
    last_packet: Duration,
    to_host: VecDeque<u8>,
    heard: VecDeque<u8>,
    frames: Frames,
    homed: u8,
    homing_commands: u32,
    /// What the arms would count where the firmware began: until they have met their ends, they count from there.
    began: Option<[i16; 3]>,
    commands: u64,
    command: Command,
    is_gone: bool,
}

impl Machine {
    /// A device that was just plugged in, and whose handle moves so.
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
            heard: VecDeque::new(),
            frames: Frames::default(),
            homed,
            homing_commands: 0,
            began: None,
            commands: 0,
            command: Command::REST,
            is_gone: false,
        }
    }

    /// Something will go wrong.
    pub fn breaks(&mut self, fault: Option<Fault>) {
        self.fault = fault;
    }

    /// The hand goes on in another way, and presses these buttons.
    pub fn moves(&mut self, motion: Motion, buttons: u32) {
        (self.motion, self.buttons) = (motion, buttons);
    }

    /// Of a vertical force arrives this share from now on, by the height above the centre of the range.
    pub fn delivers(&mut self, share: VerticalCalibration) {
        self.share = share;
    }

    /// The newest command.
    #[must_use]
    pub fn command(&self) -> Command {
        self.command
    }

    /// How many commands there were.
    #[must_use]
    pub fn commands(&self) -> u64 {
        self.commands
    }

    /// True once it is no longer on the bus.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.is_gone
    }

    /// Force of the motors on the hand, N, in the maker's frame; `None` where the linkage has no posture.
    #[must_use]
    pub fn force_n(&self, at: Duration) -> Option<DVec3> {
        let place_m = self.motion.place_m(at, self.commands);
        let torques_nm = DVec3::from_array(self.command.motors.map(f64::from)) / -WORDS_PER_NM;
        let force_n = posture(inverse(place_m)?, CENTRE_M)?.force_n(torques_nm);
        // Up is y.
        Some(force_n.with_y(force_n.y * self.share.share(place_m.y - CENTRE_M.y)))
    }

    /// A request of the host to the chip; what it answers, or nothing to what is no request of its.
    pub fn request(&mut self, number: u8, value: u16) -> Option<Vec<u8>> {
        match number {
            _ if number == Request::Reset as u8 => {
                match value {
                    1 => self.to_host.clear(),
                    2 => self.heard.clear(),
                    _ => {
                        self.to_host.clear();
                        self.heard.clear();
                        self.latency_ms = LATENCY_MS;
                    }
                }
                // What is stale is not in the chip but behind it.
                Some(Vec::new())
            }
            _ if number == Request::BaudRate as u8 => {
                self.divisor = value;
                // The firmware begins at its own rate.
                if let (Stage::Loading(1..), RUN_DIVISOR) = (self.stage, value)
                    && self.fault != Some(Fault::NoReport)
                {
                    (self.stage, self.homed, self.homing_commands) = (Stage::Running, 0, 0);
                    self.began = None;
                }
                Some(Vec::new())
            }
            _ if number == Request::LatencyTimer as u8 => {
                self.latency_ms = value.clamp(1, 255);
                Some(Vec::new())
            }
            // Modem lines, flow control, format; characters of events and errors, and the mode of the pins, mean nothing here.
            1 | 2 | 4 | 6 | 7 | 0x0b => Some(Vec::new()),
            _ => None,
        }
    }

    /// A question of the host to the chip; nothing to what is no question of its.
    #[must_use]
    pub fn question(&self, number: u8) -> Option<Vec<u8>> {
        match number {
            5 => Some(STATUS.to_vec()),
            0x0a => Some(self.latency_ms.to_le_bytes().get(..1)?.to_vec()),
            0x0c => Some(vec![0]),
            // A chip without a memory of its own.
            0x90 => Some(vec![0xff, 0xff]),
            _ => None,
        }
    }

    /// Bytes of the host for the line.
    pub fn output(&mut self, bytes: &[u8], at: Duration) {
        for byte in bytes {
            match (self.stage, self.divisor) {
                (Stage::Running, RUN_DIVISOR) => {
                    if let Heard::Frame(frame) = self.frames.push(*byte)
                        && let Some(command) = Command::read(&frame)
                    {
                        self.obey(command, at);
                    }
                }
                (Stage::Loader | Stage::Prompted, PROMPT_DIVISOR) => self.prompted(*byte),
                (Stage::Loading(_), PROMPT_DIVISOR) => {
                    // The handshake begins anew.
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
                // At a rate that is not its own a line carries nothing.
                _ => {}
            }
        }
    }

    fn prompted(&mut self, byte: u8) {
        self.heard.push_back(byte);
        while self.heard.len() > PROMPT.len() {
            self.heard.pop_front();
        }
        if self.heard.iter().eq(&PROMPT) && self.fault != Some(Fault::NoPrompt) {
            self.heard.clear();
            self.stage = Stage::Prompted;
            self.to_host.extend(PROMPT_ANSWER);
        }
    }

    /// A command: its report.
    fn obey(&mut self, command: Command, at: Duration) {
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

    /// The packet that is due for a host that waits for one: what the line has said, or, when the latency timer has run
    /// out, the chip's own states alone.
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

/// Where a device has the handle that counts so, m; `None` for counts that no arms can have.
#[must_use]
pub fn place_of(encoders: [i16; 3]) -> Option<DVec3> {
    Some(posture(angles_rad(encoders), CENTRE_M)?.position_m())
}
