//! The device side of the USB bus: replies to the host controller and queues packets in both directions.
//!
//! An IN transfer without data waits (on a real bus: NAK) until a packet is available, or until it is unlinked. The start
//! and end of use by a host are detected per kind of device:
//!
//! | | begins | ends |
//! |---|---|---|
//! | interrupt, bulk | alternate setting 1 | setting 0, which the kernel selects itself for a process that died |
//! | HID | the first report | the host fetches no more |
//! | serial port | DTR | no DTR |
//!
//! Unplugging ends every use.

use super::personality::{IN, OUT, Personality, REPORT, REPORT_DESCRIPTOR};
use flotor_usbip::descriptor::{CONFIGURATION, DEVICE, STRING};
use flotor_usbip::wire::{self, INPUT, Message, Transfer};
use std::collections::VecDeque;
use std::io::{self, Read};
use std::os::unix::net::UnixStream;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Limit on the packets queued in each direction; a further packet replaces the oldest.
const KEPT_PACKETS: usize = 32;
/// Pause after which a HID host counts as detached: a reading host requests the next report within microseconds.
const FETCHES_NO_MORE: Duration = Duration::from_millis(5);

/// Id of an attachment of a host to the device; each attachment has a new id.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment(u64);

/// Error: the host no longer uses the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Detached;

pub(super) struct Bus {
    pub(super) personality: Personality,
    serial: String,
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    socket: UnixStream,
    used: Option<Attachment>,
    uses: u64,
    plugged: bool,
    alternate: u8,
    line_coding: [u8; 7],
    /// IN transfers that wait for data, oldest first.
    fetches: VecDeque<Transfer>,
    /// Time of the last delivery or unlinking.
    fetched_since: Instant,
    to_host: VecDeque<Vec<u8>>,
    to_controller: VecDeque<Vec<u8>>,
}

impl Bus {
    pub(super) fn new(personality: Personality, serial: &str, socket: UnixStream) -> Self {
        let state = State {
            socket,
            used: None,
            uses: 0,
            plugged: true,
            alternate: 0,
            line_coding: [0; 7],
            fetches: VecDeque::new(),
            fetched_since: Instant::now(),
            to_host: VecDeque::new(),
            to_controller: VecDeque::new(),
        };
        Self { personality, serial: serial.to_owned(), state: Mutex::new(state), changed: Condvar::new() }
    }

    /// Replies to the host controller until the device is unplugged.
    pub(super) fn serve(&self, requests: &mut impl Read) {
        while let Ok(message) = Message::read(requests) {
            let mut state = self.lock();
            let answered = match message {
                Message::Submit(transfer) => self.submit(&mut state, transfer),
                Message::Unlink { number, transfer } => state.take_back(number, transfer),
            };
            drop(state);
            self.changed.notify_all();
            if answered.is_err() {
                break;
            }
        }
        let mut state = self.lock();
        state.plugged = false;
        state.detach();
        drop(state);
        self.changed.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Poisoning is ignored: a panic leaves whole packets in the queues.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn submit(&self, state: &mut State, transfer: Transfer) -> io::Result<()> {
        match transfer.endpoint {
            IN => {
                state.fetches.push_back(transfer);
                state.deliver()
            }
            OUT => {
                if self.personality == Personality::Hid {
                    state.attach();
                }
                state.keep_for_controller(&transfer.data);
                wire::complete(&mut state.socket, &transfer, &[])
            }
            endpoint if endpoint & !INPUT == 0 => {
                let data = self.control(state, &transfer);
                wire::answer(&mut state.socket, &transfer, data)
            }
            // A notification, which never arrives: the transfer waits until unplugged or unlinked.
            _ => {
                state.fetches.push_back(transfer);
                Ok(())
            }
        }
    }

    /// Answers a control transfer; `None` stalls the endpoint.
    fn control(&self, state: &mut State, transfer: &Transfer) -> Option<Vec<u8>> {
        let [kind, request, value_low, value_high, index_low, ..] = transfer.setup;
        let done = || Some(Vec::new());
        match (kind, request, self.personality) {
            // Get descriptor, of the device and of the interface.
            (0x80, 6, _) => match value_high {
                DEVICE => Some(self.personality.device()),
                CONFIGURATION => Some(self.personality.configuration()),
                STRING => self.personality.string(value_low, &self.serial),
                _ => None,
            },
            (0x81, 6, Personality::Hid) if value_high == REPORT => Some(REPORT_DESCRIPTOR.to_vec()),
            // Set configuration: resets the interface.
            (0x00, 9, _) => {
                state.select(0);
                done()
            }
            // Set interface.
            (0x01, 11, Personality::Interrupt | Personality::Bulk) if index_low == 0 => {
                state.select(value_low);
                done()
            }
            // Get status, of device, interface and endpoint; clear feature: no endpoint is ever halted.
            (0x80..=0x82, 0, _) => Some(vec![0, 0]),
            (0x02, 1, _) => done(),
            // Set idle: ignored, reports are sent only when available.
            (0x21, 0x0a, Personality::Hid) => done(),
            // Line coding and modem lines.
            (0x21, 0x20, Personality::Serial) => {
                state.line_coding.iter_mut().zip(&transfer.data).for_each(|(slot, byte)| *slot = *byte);
                done()
            }
            (0xa1, 0x21, Personality::Serial) => Some(state.line_coding.to_vec()),
            (0x21, 0x22, Personality::Serial) => {
                let ready = value_low & 1 == 1;
                if ready {
                    state.attach()
                } else {
                    state.detach()
                }
                done()
            }
            _ => None,
        }
    }

    pub(super) fn is_plugged_in(&self) -> bool {
        self.lock().plugged
    }

    /// Waits for a host to use the device; `None` on timeout or when unplugged.
    pub(super) fn wait_for_host(&self, patience: Duration) -> Option<Attachment> {
        let state = self.lock();
        let waited =
            self.changed.wait_timeout_while(state, patience, |state| state.used.is_none() && state.plugged);
        let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.used
    }

    /// Queues a packet for the host; a full queue drops the oldest packet.
    pub(super) fn send(&self, attachment: Attachment, packet: &[u8]) -> Result<(), Detached> {
        let mut state = self.lock();
        state.check(attachment)?;
        if state.to_host.len() >= KEPT_PACKETS {
            state.to_host.pop_front();
        }
        state.to_host.push_back(packet.to_vec());
        state.deliver().map_err(|_| Detached)
    }

    /// Waits until a packet from the host arrives or the host detaches, at most for `patience`.
    pub(super) fn wait_for_packet(&self, attachment: Attachment, patience: Duration) {
        drop(self.wait(self.lock(), attachment, patience));
    }

    fn wait<'s>(
        &self,
        state: MutexGuard<'s, State>,
        attachment: Attachment,
        patience: Duration,
    ) -> MutexGuard<'s, State> {
        let waited = self.changed.wait_timeout_while(state, patience, |state| {
            state.to_controller.is_empty() && state.used == Some(attachment)
        });
        waited.unwrap_or_else(PoisonError::into_inner).0
    }

    /// Removes and returns the oldest packet from the host; waits for a packet if there is none, and returns `None` after the
    /// timeout `patience`.
    pub(super) fn take(
        &self,
        attachment: Attachment,
        patience: Duration,
    ) -> Result<Option<Vec<u8>>, Detached> {
        let mut state = self.lock();
        if self.personality == Personality::Hid
            && state.fetches.is_empty()
            && state.fetched_since.elapsed() > FETCHES_NO_MORE
        {
            state.detach();
        }
        if !patience.is_zero() {
            state = self.wait(state, attachment, patience);
        }
        state.check(attachment)?;
        Ok(state.to_controller.pop_front())
    }
}

impl State {
    fn check(&self, attachment: Attachment) -> Result<(), Detached> {
        if self.used == Some(attachment) { Ok(()) } else { Err(Detached) }
    }

    fn attach(&mut self) {
        if self.used.is_none() {
            self.uses += 1;
            self.used = Some(Attachment(self.uses));
            self.to_host.clear();
            self.to_controller.clear();
        }
    }

    fn detach(&mut self) {
        self.used = None;
        self.to_host.clear();
        self.to_controller.clear();
    }

    fn select(&mut self, alternate: u8) {
        self.alternate = alternate;
        self.detach();
        if alternate != 0 {
            self.attach();
        }
    }

    fn keep_for_controller(&mut self, packet: &[u8]) {
        if self.to_controller.len() >= KEPT_PACKETS {
            self.to_controller.pop_front();
        }
        self.to_controller.push_back(packet.to_vec());
    }

    /// Completes waiting IN transfers with the queued packets.
    fn deliver(&mut self) -> io::Result<()> {
        while let Some(index) = self.fetches.iter().position(|transfer| transfer.endpoint == IN) {
            let Some(mut packet) = self.to_host.pop_front() else { break };
            let Some(transfer) = self.fetches.remove(index) else { break };
            packet.truncate(transfer.length);
            self.fetched_since = Instant::now();
            wire::complete(&mut self.socket, &transfer, &packet)?;
        }
        Ok(())
    }

    fn take_back(&mut self, number: u32, transfer: u32) -> io::Result<()> {
        self.fetched_since = Instant::now();
        wire::unlink(&mut self.socket, &mut self.fetches, number, transfer)
    }
}
