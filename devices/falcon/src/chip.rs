//! The FTDI chip between USB and the device's serial line, as the host sees it (FT232B, FTDI's requests).

use flotor_hal::IndependentStop;
use std::time::Duration;

/// Vendor and product of a Falcon.
pub const VENDOR: u16 = 0x0403;
/// FTDI gave Novint this number.
pub const PRODUCT: u16 = 0xcb48;
/// Largest packet of the chip's endpoints at full speed.
pub const PACKET_BYTES: usize = 64;
/// Each packet towards the host begins with the states of modem and line.
pub const STATUS_BYTES: usize = 2;
/// What fits beside them.
pub const PAYLOAD_BYTES: usize = PACKET_BYTES - STATUS_BYTES;

/// A request to the chip, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Value 0: everything; 1, 2: what waits towards the host, and from it.
    Reset = 0,
    /// DTR in bit 0, RTS in bit 1, and in the high byte which of them to change.
    ModemLines = 1,
    /// 0: none.
    FlowControl = 2,
    /// 3 MHz over this, eighths in the upper bits.
    BaudRate = 3,
    /// 8: eight bits, no parity, one stop bit.
    DataFormat = 4,
    /// After so many ms the chip sends what it has, or its states alone.
    LatencyTimer = 9,
}

/// The chip is gone: unplugged, or its hub was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipLost;

/// A packet without the two bytes that each one has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShortPacket;

/// A chip; one thread may read while others write.
pub trait Chip: Send + Sync + 'static {
    /// Makes a request. Not real-time.
    ///
    /// # Errors
    /// [`ChipLost`].
    fn request(&self, request: Request, value: u16) -> Result<(), ChipLost>;

    /// Sends bytes down the line, and waits until the chip has them. Not real-time: waits for the bus.
    ///
    /// # Errors
    /// [`ChipLost`].
    fn write(&self, bytes: &[u8]) -> Result<(), ChipLost>;

    /// Waits for packets, at most so long; the bytes of all of them, each of 64 bytes but the last. Not real-time: waits
    /// for the bus.
    ///
    /// # Errors
    /// [`ChipLost`].
    fn read(&self, packets: &mut [u8], patience: Duration) -> Result<usize, ChipLost>;

    /// Returns the stop of a device that a process without this plugin stops with these bytes for the line. A chip on USB has none:
    /// it takes bytes by calls that such a process does not make.
    fn independent_stop(&self, _rest: &[u8]) -> IndependentStop {
        IndependentStop::none()
    }
}

/// Passes what came down the line on, without the bytes of the chip itself. Real-time: bounded, no allocation.
///
/// # Errors
/// [`ShortPacket`].
pub fn payload(packets: &[u8], mut each: impl FnMut(u8)) -> Result<(), ShortPacket> {
    for packet in packets.chunks(PACKET_BYTES) {
        let bytes = packet.get(STATUS_BYTES..).ok_or(ShortPacket)?;
        bytes.iter().copied().for_each(&mut each);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_packet_loses_its_own_two_bytes() {
        let numbered = |first: u8, length: u8| -> Vec<u8> {
            [1, 0x60].into_iter().chain((0..length).map(|byte| first + byte)).collect()
        };
        let mut heard = Vec::new();
        let packets = [numbered(0, 62), numbered(62, 62), numbered(124, 5)].concat();
        payload(&packets, |byte| heard.push(byte)).expect("each has its status");
        assert_eq!(heard, (0..129).collect::<Vec<u8>>());
        heard.clear();
        assert_eq!(payload(&[1, 0x60], |byte| heard.push(byte)), Ok(()), "an idle chip");
        assert_eq!(payload(&[1], |byte| heard.push(byte)), Err(ShortPacket));
        assert_eq!(heard, []);
    }
}
