//! Handshake with the boot loader, which runs after each power-on (libnifalcon, `FalconFirmware`).
//!
//! ```text
//! 9600 baud     host 0a 43 0d      device 0a 44 2c 0d, possibly preceded by 00, possibly only after many retries
//! 140 kbaud     host 41            device 41
//!               host firmware      device echoes each byte
//! 1.5 Mbaud     the firmware runs: a report for each command
//! ```

use crate::chip::{Chip, ChipLost, PACKET_BYTES, PAYLOAD_BYTES, Request, payload};
use crate::protocol::{Command, Frames, Parsed, Report};
use std::time::{Duration, Instant};

/// Baud rate divisor for the prompt: 9600 baud.
pub const PROMPT_DIVISOR: u16 = 0x4138;
/// Baud rate divisor while the firmware loads: 3 MHz / 21.
pub const LOAD_DIVISOR: u16 = 0x15;
/// Baud rate divisor of the running firmware: 3 MHz / 2.
pub const RUN_DIVISOR: u16 = 0x02;
/// Prompt to the loader.
pub const PROMPT: [u8; 3] = [0x0a, 0x43, 0x0d];
/// Reply of the loader to the prompt, possibly after a zero byte.
pub const PROMPT_ANSWER: [u8; 4] = [0x0a, 0x44, 0x2c, 0x0d];
/// Agreement byte that host and loader exchange before the firmware.
pub const AGREED: u8 = 0x41;

/// Data format: eight bits, no parity, one stop bit.
const FORMAT: u16 = 8;
/// Modem line values: RTS low, DTR low, DTR high.
const RTS_LOW: u16 = 0x0200;
const DTR_LOW: u16 = 0x0100;
const DTR_HIGH: u16 = 0x0101;
/// Latency timer of the chip while loading and while running, ms.
const LOAD_LATENCY_MS: u16 = 16;
const RUN_LATENCY_MS: u16 = 1;

/// Prompts per attempt.
const PROMPTS: u32 = 100;
/// Attempts at the whole handshake, which fails at random.
const ATTEMPTS: u32 = 3;
/// Timeouts of the prompt's reply, of an echo, and of the firmware's first report.
const ANSWER: Duration = Duration::from_millis(30);
const ECHO: Duration = Duration::from_millis(1000);
const FIRST_REPORT: Duration = Duration::from_millis(1000);
/// Silence after which the line counts as quiet, and the limit on the wait for it.
const QUIET: Duration = Duration::from_millis(20);
const SETTLED: Duration = Duration::from_millis(500);

/// Error at the start of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BootFailure {
    /// The chip is gone.
    #[error(
        "the Falcon was unplugged, its hub was reset, or its emulator has ended; connect the \
            Falcon without a hub, or start the emulator, and try again"
    )]
    Lost,
    /// A packet without its two status bytes: the chip is not an FTDI, or the link is broken.
    #[error(
        "the USB chip sends packets without the two bytes of its status; connect the Falcon without a hub, and try again"
    )]
    ShortPacket,
    /// No firmware runs, and the user named no file.
    #[error(
        "the Falcon sends no reports, probably because it has no firmware after power-off; give your own firmware \
         file with `firmware`: the file `nvent` is in libnifalcon's folder `firmware` and in the driver for Windows"
    )]
    NoFirmware,
    /// The loader did not reply to the prompt.
    #[error(
        "the boot loader answered none of {PROMPTS} prompts; switch the Falcon off and on, and try again"
    )]
    NoPrompt,
    /// The loader did not agree to receive a firmware: its reply, `None` on timeout.
    #[error(
        "the boot loader {}; switch the Falcon off and on, and try again",
        .0.map_or_else(
            || "did not accept the upload of a firmware".to_owned(),
            |byte| format!("replied {byte:#04x} instead of {AGREED:#04x}")
        )
    )]
    NotAgreed(Option<u8>),
    /// The echo of a byte of the firmware differs.
    #[error(
        "byte {at} of the firmware, {sent:#04x}, came back as {came:#04x}; switch the Falcon off and on, \
         connect the Falcon without a hub, and try again"
    )]
    Echo {
        /// Index of the byte, from 0.
        at: usize,
        /// Byte sent.
        sent: u8,
        /// Byte received.
        came: u8,
    },
    /// A byte of the firmware had no echo.
    #[error(
        "byte {at} of the firmware did not come back; switch the Falcon off and on, connect the Falcon \
         without a hub, and try again"
    )]
    NoEcho {
        /// Index of the byte, from 0.
        at: usize,
    },
    /// The firmware was loaded but sends no report.
    #[error(
        "the Falcon received the firmware but sends no reports; switch the Falcon off and on, and check \
         that `firmware` names a firmware of the Falcon"
    )]
    NoReport,
    /// The device sends reports without a command, or more than one report for a command.
    #[error(
        "the Falcon sends reports without a command, so every report would be late; unplug the Falcon, plug \
         it in again, and try again"
    )]
    StaleReports,
}

impl From<ChipLost> for BootFailure {
    fn from(_: ChipLost) -> Self {
        Self::Lost
    }
}

/// Byte stream of the serial line, without the chip's status bytes.
struct Line<'c> {
    chip: &'c dyn Chip,
    waiting: std::collections::VecDeque<u8>,
}

impl<'c> Line<'c> {
    fn new(chip: &'c dyn Chip) -> Self {
        Self { chip, waiting: std::collections::VecDeque::new() }
    }

    /// Returns the next byte; `None` on timeout.
    fn next(&mut self, patience: Duration) -> Result<Option<u8>, BootFailure> {
        let until = Instant::now() + patience;
        let mut packets = [0; PACKET_BYTES];
        loop {
            if let Some(byte) = self.waiting.pop_front() {
                return Ok(Some(byte));
            }
            let rest = until.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return Ok(None);
            }
            let length = self.chip.read(&mut packets, rest)?;
            let read = packets.get(..length).unwrap_or_default();
            payload(read, |byte| self.waiting.push_back(byte)).map_err(|_| BootFailure::ShortPacket)?;
        }
    }

    /// Discards bytes until the line is quiet; returns false if it does not become quiet in time.
    fn settle(&mut self) -> Result<bool, BootFailure> {
        let until = Instant::now() + SETTLED;
        while self.next(QUIET)?.is_some() {
            if Instant::now() > until {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Starts a device and waits for its first report; loads the firmware unless it runs already. Not real-time.
///
/// # Errors
/// [`BootFailure::NoFirmware`] if no firmware runs and `firmware` is `None`; else the [`BootFailure`] of the last attempt.
pub fn start(chip: &dyn Chip, firmware: Option<&[u8]>) -> Result<Report, BootFailure> {
    match run(chip) {
        Err(BootFailure::NoReport) => {}
        settled => return settled,
    }
    let firmware = firmware.ok_or(BootFailure::NoFirmware)?;
    let mut attempt = 1;
    loop {
        match load(chip, firmware).and_then(|()| run(chip)) {
            // A further attempt cannot help.
            Err(failure @ (BootFailure::Lost | BootFailure::NoPrompt)) => return Err(failure),
            Err(_) if attempt < ATTEMPTS => attempt += 1,
            settled => return settled,
        }
    }
}

/// Sets the line up for a running firmware, and requests a report.
fn run(chip: &dyn Chip) -> Result<Report, BootFailure> {
    chip.request(Request::LatencyTimer, RUN_LATENCY_MS)?;
    chip.request(Request::BaudRate, RUN_DIVISOR)?;
    chip.request(Request::DataFormat, FORMAT)?;
    chip.request(Request::FlowControl, 0)?;
    chip.request(Request::Reset, 1)?;
    chip.request(Request::Reset, 2)?;
    let (mut line, mut frames) = (Line::new(chip), Frames::default());
    // Drop the bytes that an earlier program caused.
    if !line.settle()? {
        return Err(BootFailure::StaleReports);
    }
    chip.write(&Command::REST.bytes())?;
    let until = Instant::now() + FIRST_REPORT;
    let mut report = None;
    loop {
        // One command, one report: further bytes are of earlier commands.
        let patience = if report.is_some() { QUIET } else { until.saturating_duration_since(Instant::now()) };
        match (line.next(patience)?, report) {
            (None, Some(report)) => return Ok(report),
            (None, None) => return Err(BootFailure::NoReport),
            (Some(_), Some(_)) => return Err(BootFailure::StaleReports),
            (Some(byte), None) => {
                if let Parsed::Frame(bytes) = frames.push(byte) {
                    report = Some(Report::read(&bytes));
                }
            }
        }
    }
}

/// Prompts the boot loader until it replies.
fn prompt(chip: &dyn Chip, line: &mut Line<'_>) -> Result<(), BootFailure> {
    for _ in 0..PROMPTS {
        chip.write(&PROMPT)?;
        let mut answer = Vec::with_capacity(PROMPT_ANSWER.len() + 1);
        while answer.len() <= PROMPT_ANSWER.len()
            && let Some(byte) = line.next(ANSWER)?
        {
            answer.push(byte);
            if answer.strip_prefix(&[0]).unwrap_or(&answer) == PROMPT_ANSWER {
                return Ok(());
            }
        }
    }
    Err(BootFailure::NoPrompt)
}

/// Runs the handshake and loads the firmware.
fn load(chip: &dyn Chip, firmware: &[u8]) -> Result<(), BootFailure> {
    chip.request(Request::Reset, 1)?;
    chip.request(Request::Reset, 2)?;
    chip.request(Request::LatencyTimer, LOAD_LATENCY_MS)?;
    chip.request(Request::BaudRate, PROMPT_DIVISOR)?;
    chip.request(Request::DataFormat, FORMAT)?;
    chip.request(Request::FlowControl, 0)?;
    for lines in [RTS_LOW, DTR_LOW, DTR_HIGH] {
        chip.request(Request::ModemLines, lines)?;
    }
    let mut line = Line::new(chip);
    prompt(chip, &mut line)?;
    chip.request(Request::ModemLines, DTR_LOW)?;
    chip.request(Request::BaudRate, LOAD_DIVISOR)?;
    chip.write(&[AGREED])?;
    match line.next(ECHO)? {
        Some(AGREED) => {}
        other => return Err(BootFailure::NotAgreed(other)),
    }
    for (number, piece) in firmware.chunks(PAYLOAD_BYTES).enumerate() {
        chip.write(piece)?;
        for (place, sent) in piece.iter().enumerate() {
            let at = number * PAYLOAD_BYTES + place;
            match line.next(ECHO)? {
                None => return Err(BootFailure::NoEcho { at }),
                Some(came) if came != *sent => return Err(BootFailure::Echo { at, sent: *sent, came }),
                Some(_) => {}
            }
        }
    }
    Ok(())
}
