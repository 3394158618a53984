//! USB/IP messages between a virtual host controller and a device (Linux kernel documentation,
//! `usb/usbip_protocol`): headers of 48 bytes, big endian, some followed by data.

use std::collections::VecDeque;
use std::io::{self, Read, Write};

const HEADER_BYTES: usize = 48;
const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const SUBMITTED: u32 = 3;
const UNLINKED: u32 = 4;
/// Limit on the data of one message, bytes: the largest transfer of the kernel's drivers here is 4 KiB.
const LONGEST_DATA: usize = 1 << 20;

/// Status of a stalled and of an unlinked transfer (Linux `EPIPE`, `ECONNRESET`).
const STALLED: i32 = -32;
const TAKEN_BACK: i32 = -104;

/// Request from the host controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Message {
    /// Request to start a transfer.
    Submit(Transfer),
    /// Request to cancel a pending transfer.
    Unlink {
        /// Sequence number of this request.
        number: u32,
        /// Sequence number of the transfer to cancel.
        transfer: u32,
    },
}

/// Transfer submitted by the host controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// Sequence number, which assigns the completion to the transfer.
    pub number: u32,
    /// Address of the endpoint, with the direction in bit 7.
    pub endpoint: u8,
    /// Length requested from the device, or sent to it, bytes.
    pub length: usize,
    /// Setup packet of a control transfer.
    pub setup: [u8; 8],
    /// Data sent by the host; empty for transfers towards the host.
    pub data: Vec<u8>,
}

/// Direction bit of an endpoint's address: towards the host.
pub const INPUT: u8 = 0x80;

impl Message {
    /// Reads the next request from a stream; blocks until the request is complete.
    ///
    /// # Errors
    /// Errors of the stream; `InvalidData` for an unknown message or more than 1 MiB of data.
    pub fn read(stream: &mut impl Read) -> io::Result<Self> {
        let mut header = [0; HEADER_BYTES];
        stream.read_exact(&mut header)?;
        let number = |at: usize| {
            let field = header.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
            u32::from_be_bytes(field.unwrap_or_default())
        };
        match number(0) {
            SUBMIT => {
                let input = number(12) == 1;
                let length = usize::try_from(number(24)).unwrap_or(usize::MAX);
                if length > LONGEST_DATA {
                    return Err(io::ErrorKind::InvalidData.into());
                }
                let mut data = vec![0; if input { 0 } else { length }];
                stream.read_exact(&mut data)?;
                let endpoint = (number(16) & 0x0f) as u8 | if input { INPUT } else { 0 };
                let setup = header.get(40..48).and_then(|bytes| bytes.try_into().ok()).unwrap_or_default();
                Ok(Self::Submit(Transfer { number: number(4), endpoint, length, setup, data }))
            }
            UNLINK => Ok(Self::Unlink { number: number(4), transfer: number(20) }),
            _ => Err(io::ErrorKind::InvalidData.into()),
        }
    }
}

/// Reports a transfer as complete: with `data` towards the host, or with all bytes from the host accepted.
///
/// # Errors
/// Errors of the stream.
pub fn complete(stream: &mut impl Write, transfer: &Transfer, data: &[u8]) -> io::Result<()> {
    let is_input = transfer.endpoint & INPUT != 0;
    let actual = if is_input { data.len() } else { transfer.length };
    end(stream, SUBMITTED, transfer.number, 0, u32::try_from(actual).unwrap_or(0), data)
}

/// Completes a control transfer with data, cut to the requested length; without data the transfer stalls.
///
/// # Errors
/// Errors of the stream.
pub fn answer(stream: &mut impl Write, transfer: &Transfer, data: Option<Vec<u8>>) -> io::Result<()> {
    let Some(mut data) = data else { return stall(stream, transfer) };
    data.truncate(transfer.length);
    complete(stream, transfer, &data)
}

/// Reports a transfer as stalled: the device does not support the request.
///
/// # Errors
/// Errors of the stream.
pub fn stall(stream: &mut impl Write, transfer: &Transfer) -> io::Result<()> {
    end(stream, SUBMITTED, transfer.number, STALLED, 0, &[])
}

/// Executes and answers the unlink request `number`: removes the transfer from the pending ones, unless it was complete before.
///
/// # Errors
/// Errors of the stream.
pub fn unlink(
    stream: &mut impl Write,
    pending: &mut VecDeque<Transfer>,
    number: u32,
    transfer: u32,
) -> io::Result<()> {
    let place = pending.iter().position(|waiting| waiting.number == transfer);
    let removed = place.and_then(|place| pending.remove(place));
    end(stream, UNLINKED, number, if removed.is_some() { TAKEN_BACK } else { 0 }, 0, &[])
}

/// Writes header and data with one call, so that the kernel's reader wakes up once.
fn end(
    stream: &mut impl Write,
    kind: u32,
    number: u32,
    status: i32,
    actual: u32,
    data: &[u8],
) -> io::Result<()> {
    let mut message = Vec::with_capacity(HEADER_BYTES + data.len());
    message.extend(kind.to_be_bytes());
    message.extend(number.to_be_bytes());
    message.extend([0; 12]);
    message.extend(status.to_be_bytes());
    message.extend(actual.to_be_bytes());
    message.extend([0; 20]);
    message.extend(data);
    stream.write_all(&message)
}
