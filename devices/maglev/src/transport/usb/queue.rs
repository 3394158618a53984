//! Transfers in flight: several reads that wait for the device, and one write.
//!
//! A read that has ended is delivered and submitted again from its own end, so that the device always finds one
//! waiting; a packet costs one wake-up, and no tick waits for the bus. `rusb` wraps only transfers that block, so this
//! module talks to libusb itself, and is the one place of this crate that does.
//!
//! ```text
//!            submit (tick)                     libusb's thread            take (tick)
//! write  ------------------> bus               ended -> not busy
//! reads   bus --------------------------------> ended -> channel ------------------> packet
//!                                                 +----> submitted again
//! ```
#![allow(unsafe_code)]

use super::{Endpoints, Incoming, LinkLost};
use crate::protocol::FRAME_BYTES;
use rusb::constants::{
    LIBUSB_TRANSFER_COMPLETED, LIBUSB_TRANSFER_OVERFLOW, LIBUSB_TRANSFER_TIMED_OUT,
    LIBUSB_TRANSFER_TYPE_BULK, LIBUSB_TRANSFER_TYPE_INTERRUPT,
};
use rusb::ffi::{
    libusb_alloc_transfer, libusb_cancel_transfer, libusb_free_transfer, libusb_submit_transfer,
    libusb_transfer,
};
use rusb::{Context, DeviceHandle, TransferType, UsbContext};
use std::ffi::c_int;
use std::ptr::NonNull;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Reads that wait on the bus: one is being delivered while the next is filled, and two for a late thread.
const WAITING_READS: usize = 4;
/// Packets between libusb's thread and the tick: a few periods.
const KEPT_PACKETS: usize = 16;
/// A multiple of every packet size, or a longer packet would be lost to an overflow.
const BUFFER_BYTES: usize = 512;
/// A device that takes nothing for so long has lost this command; the ones since were dropped anyway.
const WRITE_TIMEOUT_MS: u32 = 20;
/// How often libusb's thread looks whether it is still wanted.
const LOOK_AROUND: Duration = Duration::from_millis(50);

/// What the ends of transfers tell the rest.
struct Shared {
    packets: SyncSender<Incoming>,
    /// Transfers that libusb has.
    in_flight: AtomicUsize,
    writing: AtomicBool,
    lost: AtomicBool,
    ending: AtomicBool,
}

/// Reads and a write on a claimed interface.
pub(super) struct Queue {
    // Before the handle, in the order of dropping: freeing a transfer frees the device, in a live context.
    reads: Vec<Transfer>,
    write: Transfer,
    handle: Arc<DeviceHandle<Context>>,
    shared: Arc<Shared>,
    packets: Receiver<Incoming>,
    events: Option<JoinHandle<()>>,
}

/// A transfer of libusb's with its buffer, both owned, and what its end tells.
struct Transfer {
    raw: NonNull<libusb_transfer>,
    buffer: NonNull<[u8; BUFFER_BYTES]>,
    /// The `user_data` of the transfer: lives as long as it.
    shared: Arc<Shared>,
}

// SAFETY: both pointers are owned by this value alone, libusb may be called from any thread, and `Shared` is
// `Sync`.
unsafe impl Send for Transfer {}

impl Queue {
    /// Submits the reads. Not real-time.
    pub(super) fn start(
        handle: Arc<DeviceHandle<Context>>,
        endpoints: Endpoints,
    ) -> Result<Self, rusb::Error> {
        let (sender, packets) = sync_channel(KEPT_PACKETS);
        let shared = Arc::new(Shared {
            packets: sender,
            in_flight: AtomicUsize::new(0),
            writing: AtomicBool::new(false),
            lost: AtomicBool::new(false),
            ending: AtomicBool::new(false),
        });
        let make = |endpoint, ended, timeout_ms| {
            Transfer::new(&handle, endpoint, endpoints.transfer, &shared, ended, timeout_ms)
        };
        let reads = (0..WAITING_READS).map(|_| make(endpoints.input, read_ended as Ended, 0));
        let reads = reads.collect::<Result<Vec<_>, _>>()?;
        let write = make(endpoints.output, write_ended as Ended, WRITE_TIMEOUT_MS)?;
        // From here on the value itself waits for all that is in flight when it is dropped.
        let mut queue = Self { reads, write, handle, shared, packets, events: None };
        for read in &queue.reads {
            // SAFETY: made above, and submitted here for the first time.
            unsafe { read.submit() }?;
        }
        let (context, shared) = (queue.handle.context().clone(), Arc::clone(&queue.shared));
        let thread = std::thread::Builder::new().name("flotor-usb".to_owned());
        let events = thread.spawn(move || {
            while !shared.ending.load(Ordering::Acquire) {
                // An interrupted wait is tried again; the ends of transfers say what is wrong with the device.
                let _ = context.handle_events(Some(LOOK_AROUND));
            }
        });
        queue.events = Some(events.map_err(|_| rusb::Error::NoMem)?);
        Ok(queue)
    }

    /// Sends a packet unless the one before is still on its way. Real-time: bounded, no allocation; one call of the
    /// system.
    pub(super) fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        if self.shared.lost.load(Ordering::Acquire) {
            return Err(LinkLost);
        }
        if self.shared.writing.swap(true, Ordering::AcqRel) {
            return Ok(());
        }
        // SAFETY: no write is in flight (`writing` was false), so libusb has no use of the buffer and nobody else has
        // it; it is longer than a frame.
        unsafe { self.write.buffer.cast::<[u8; FRAME_BYTES]>().write(*frame) };
        // SAFETY: as above, no write is in flight.
        unsafe { self.write.submit() }.map_err(|_| {
            self.shared.writing.store(false, Ordering::Release);
            LinkLost
        })
    }

    /// The oldest packet. Real-time: bounded, no allocation.
    pub(super) fn receive(&self) -> Result<Incoming, LinkLost> {
        match self.packets.try_recv() {
            Ok(incoming) => Ok(incoming),
            Err(TryRecvError::Empty | TryRecvError::Disconnected) => self.nothing(),
        }
    }

    /// The oldest packet, waiting for it. Not real-time.
    pub(super) fn wait(&self, patience: Duration) -> Result<Incoming, LinkLost> {
        match self.packets.recv_timeout(patience) {
            Ok(incoming) => Ok(incoming),
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => self.nothing(),
        }
    }

    fn nothing(&self) -> Result<Incoming, LinkLost> {
        if self.shared.lost.load(Ordering::Acquire) { Err(LinkLost) } else { Ok(Incoming::Nothing) }
    }
}

impl Drop for Queue {
    fn drop(&mut self) {
        self.shared.ending.store(true, Ordering::Release);
        for transfer in self.reads.iter().chain([&self.write]) {
            // SAFETY: the transfer is allocated; cancelling one that is not in flight only says so.
            unsafe { libusb_cancel_transfer(transfer.raw.as_ptr()) };
        }
        if let Some(events) = self.events.take() {
            let _ = events.join();
        }
        // Every cancelled transfer ends once more; until then libusb has its buffer.
        for _ in 0..ENDING_LOOKS {
            if self.shared.in_flight.load(Ordering::Acquire) == 0 {
                break;
            }
            let _ = self.handle.context().handle_events(Some(LOOK_AROUND));
        }
        if self.shared.in_flight.load(Ordering::Acquire) != 0 {
            // The transfers stay (see their `drop`), and so does the device they are on.
            std::mem::forget(Arc::clone(&self.handle));
        }
    }
}

/// Two seconds, after which the kernel is not waited for any longer.
const ENDING_LOOKS: u32 = 40;

/// What libusb calls at the end of a transfer.
type Ended = extern "system" fn(*mut libusb_transfer);

impl Transfer {
    fn new(
        handle: &DeviceHandle<Context>,
        endpoint: u8,
        kind: TransferType,
        shared: &Arc<Shared>,
        ended: Ended,
        timeout_ms: u32,
    ) -> Result<Self, rusb::Error> {
        // SAFETY: no isochronous packets; the result is checked.
        let raw = NonNull::new(unsafe { libusb_alloc_transfer(0) }).ok_or(rusb::Error::NoMem)?;
        let buffer = NonNull::from(Box::leak(Box::new([0_u8; BUFFER_BYTES])));
        // A write is a frame, a read whatever comes.
        let length = if endpoint & 0x80 == 0 { FRAME_BYTES } else { BUFFER_BYTES };
        let fields = raw.as_ptr();
        // SAFETY: freshly allocated by libusb and nobody else's yet. Each field is written in place: the zeros in between
        // are no `libusb_transfer` that a reference could lead to, as its callback is never null. The handle outlives the
        // transfer: `Queue` drops it later.
        unsafe {
            (&raw mut (*fields).dev_handle).write(handle.as_raw());
            (&raw mut (*fields).endpoint).write(endpoint);
            (&raw mut (*fields).transfer_type).write(match kind {
                TransferType::Interrupt => LIBUSB_TRANSFER_TYPE_INTERRUPT,
                _ => LIBUSB_TRANSFER_TYPE_BULK,
            });
            (&raw mut (*fields).timeout).write(timeout_ms);
            (&raw mut (*fields).buffer).write(buffer.as_ptr().cast());
            (&raw mut (*fields).length).write(c_int::try_from(length).unwrap_or(0));
            (&raw mut (*fields).callback).write(ended);
            (&raw mut (*fields).user_data).write(Arc::as_ptr(shared).cast_mut().cast());
        }
        Ok(Self { raw, buffer, shared: Arc::clone(shared) })
    }

    /// Hands the transfer to libusb until it ends. Real-time: bounded, no allocation; one call of the system.
    ///
    /// # Safety
    /// The transfer is not in flight.
    unsafe fn submit(&self) -> Result<(), rusb::Error> {
        self.shared.in_flight.fetch_add(1, Ordering::AcqRel);
        // SAFETY: filled since `new`, and not in flight, as this function demands. It is counted as in flight
        // until it has ended, and not freed before (`drop`).
        match unsafe { libusb_submit_transfer(self.raw.as_ptr()) } {
            0 => Ok(()),
            _ => {
                self.shared.in_flight.fetch_sub(1, Ordering::AcqRel);
                Err(rusb::Error::Io)
            }
        }
    }
}

impl Drop for Transfer {
    fn drop(&mut self) {
        if self.shared.in_flight.load(Ordering::Acquire) != 0 {
            // A kernel that does not give transfers back: what it may still write to is never freed.
            std::mem::forget(Arc::clone(&self.shared));
            return;
        }
        // SAFETY: nothing is in flight, so libusb has neither; both are this value's alone and came from the
        // allocators they go back to.
        unsafe {
            libusb_free_transfer(self.raw.as_ptr());
            drop(Box::from_raw(self.buffer.as_ptr()));
        }
    }
}

extern "system" fn read_ended(transfer: *mut libusb_transfer) {
    // SAFETY: libusb calls with the transfer it was given, whose `user_data` is the `Shared` that a
    // `Transfer` keeps, and leaks if it is dropped while any is in flight.
    let (fields, shared) = unsafe { (&*transfer, &*(*transfer).user_data.cast::<Shared>()) };
    let length = usize::try_from(fields.actual_length).unwrap_or(0).min(BUFFER_BYTES);
    let incoming = match fields.status {
        LIBUSB_TRANSFER_COMPLETED => {
            // SAFETY: libusb has filled that much of the buffer, and reads and writes none of it until it is submitted
            // again.
            let bytes = unsafe { std::slice::from_raw_parts(fields.buffer, length) };
            Some(bytes.try_into().map_or(Incoming::Malformed, Incoming::Packet))
        }
        LIBUSB_TRANSFER_OVERFLOW => Some(Incoming::Malformed),
        LIBUSB_TRANSFER_TIMED_OUT => Some(Incoming::Nothing),
        // Gone, halted, or taken back at the end.
        _ => None,
    };
    if let Some(incoming) = incoming {
        if incoming != Incoming::Nothing {
            // A tick that does not take them loses the newest ones, and learns so from the sequence numbers.
            let _ = shared.packets.try_send(incoming);
        }
        // SAFETY: it has just ended, so it is not in flight.
        if !shared.ending.load(Ordering::Acquire) && unsafe { libusb_submit_transfer(transfer) } == 0 {
            return;
        }
    }
    shared.lost.store(true, Ordering::Release);
    shared.in_flight.fetch_sub(1, Ordering::AcqRel);
}

extern "system" fn write_ended(transfer: *mut libusb_transfer) {
    // SAFETY: as in `read_ended`.
    let (fields, shared) = unsafe { (&*transfer, &*(*transfer).user_data.cast::<Shared>()) };
    if !matches!(fields.status, LIBUSB_TRANSFER_COMPLETED | LIBUSB_TRANSFER_TIMED_OUT) {
        shared.lost.store(true, Ordering::Release);
    }
    shared.writing.store(false, Ordering::Release);
    shared.in_flight.fetch_sub(1, Ordering::AcqRel);
}
