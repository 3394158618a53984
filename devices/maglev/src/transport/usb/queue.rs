//! Transfers in flight: several pending reads, and one write.
//!
//! A completed read is delivered and resubmitted from its own callback, so that the device always finds one pending; a
//! packet costs one wake-up, and no tick waits for the bus. `rusb` wraps only blocking transfers, so this module calls
//! libusb directly, the only one of this crate to do so.
//!
//! ```text
//!            submit (tick)                     libusb's thread            take (tick)
//! write  ------------------> bus               ended -> not busy
//! reads   bus --------------------------------> ended -> channel ------------------> packet
//!                                                 +----> submitted again
//! ```
#![allow(unsafe_code)]

use super::claim::Endpoints;
use crate::protocol::FRAME_BYTES;
use crate::transport::{Incoming, LinkLost};
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
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Number of pending reads: one is being delivered while the next is filled, and two for a late thread.
const WAITING_READS: usize = 4;
/// Capacity of the channel from libusb's thread to the tick, packets: a few periods.
const KEPT_PACKETS: usize = 16;
/// Buffer size: a multiple of every packet size, or a longer packet would be lost to an overflow.
const BUFFER_BYTES: usize = 512;
/// Write timeout: after that time a device has lost the command; later ones were dropped meanwhile.
const WRITE_TIMEOUT_MS: u32 = 20;
/// Poll interval of libusb's thread for its end flag.
const LOOK_AROUND: Duration = Duration::from_millis(50);

/// State shared with the callbacks of the transfers.
struct Shared {
    packets: SyncSender<Incoming>,
    /// Number of transfers owned by libusb.
    in_flight: AtomicUsize,
    writing: AtomicBool,
    lost: AtomicBool,
    ending: AtomicBool,
}

/// Queue of reads and a write on a claimed interface.
pub(super) struct Queue {
    // Declared before the handle, so dropped first: freeing a transfer uses the device, in a live context.
    reads: Vec<Transfer>,
    write: Transfer,
    handle: Arc<DeviceHandle<Context>>,
    shared: Arc<Shared>,
    packets: Receiver<Incoming>,
    events: Option<JoinHandle<()>>,
}

/// A libusb transfer with its buffer, both owned, and the state shared with its callback.
struct Transfer {
    raw: NonNull<libusb_transfer>,
    buffer: NonNull<[u8; BUFFER_BYTES]>,
    /// Target of the transfer's `user_data`; lives as long as the transfer.
    shared: Arc<Shared>,
}

// SAFETY: both pointers are owned by this value alone, libusb may be called from any thread, and `Shared` is
// `Sync`.
unsafe impl Send for Transfer {}

impl Queue {
    /// Creates the transfers, submits the reads and starts libusb's thread. Not real-time.
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
        // From here on, dropping the value waits for all transfers in flight.
        let mut queue = Self { reads, write, handle, shared, packets, events: None };
        for read in &queue.reads {
            // SAFETY: made above, and submitted here for the first time.
            unsafe { read.submit() }?;
        }
        let (context, shared) = (queue.handle.context().clone(), Arc::clone(&queue.shared));
        let thread = std::thread::Builder::new().name("flotor-usb".to_owned());
        let events = thread.spawn(move || {
            while !shared.ending.load(Ordering::Acquire) {
                // An interrupted wait is retried; the callbacks report errors of the device.
                let _ = context.handle_events(Some(LOOK_AROUND));
            }
        });
        queue.events = Some(events.map_err(|_| rusb::Error::NoMem)?);
        Ok(queue)
    }

    /// Sends a packet unless the previous one is still in transit. Real-time: bounded, no allocation; one system call.
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

    /// Returns the oldest packet; [`Incoming::Nothing`] if there is none. Real-time: bounded, no allocation.
    pub(super) fn receive(&self) -> Result<Incoming, LinkLost> {
        self.packets.try_recv().or_else(|_| self.nothing())
    }

    /// Waits for the oldest packet; returns [`Incoming::Nothing`] after the timeout `patience`. Not real-time.
    pub(super) fn wait(&self, patience: Duration) -> Result<Incoming, LinkLost> {
        self.packets.recv_timeout(patience).or_else(|_| self.nothing())
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
        // Every cancelled transfer ends with a callback; until then libusb owns its buffer.
        for _ in 0..ENDING_LOOKS {
            if self.shared.in_flight.load(Ordering::Acquire) == 0 {
                break;
            }
            let _ = self.handle.context().handle_events(Some(LOOK_AROUND));
        }
        if self.shared.in_flight.load(Ordering::Acquire) != 0 {
            // The transfers are leaked (see their `drop`), and so is their device.
            std::mem::forget(Arc::clone(&self.handle));
        }
    }
}

/// Limit of waits for cancelled transfers: two seconds in total.
const ENDING_LOOKS: u32 = 40;

/// Callback at the end of a transfer.
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
        // A write sends a frame, a read accepts up to the whole buffer.
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

    /// Submits the transfer to libusb. Real-time: bounded, no allocation; one system call.
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
            // The kernel has not returned the transfers: memory that it may still write to is never freed.
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
        // Device gone, endpoint halted, or transfer cancelled.
        _ => None,
    };
    if let Some(incoming) = incoming {
        if incoming != Incoming::Nothing {
            // A full channel drops the newest packets; the sequence numbers show the loss.
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
