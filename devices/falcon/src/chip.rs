//! FTDI chip between USB and the device's serial line, as seen by the host (FT232B, FTDI's requests).

use flotor_hal::IndependentStop;
use std::time::Duration;

/// USB vendor ID of a Falcon.
pub const VENDOR: u16 = 0x0403;
/// USB product ID of a Falcon, assigned to Novint by FTDI.
pub const PRODUCT: u16 = 0xcb48;
/// Largest packet of the chip's endpoints at full speed, bytes.
pub const PACKET_BYTES: usize = 64;
/// Bytes of modem and line status at the head of each packet towards the host.
pub const STATUS_BYTES: usize = 2;
/// Largest number of data bytes per packet towards the host.
pub const PAYLOAD_BYTES: usize = PACKET_BYTES - STATUS_BYTES;

/// Vendor request to the chip, with its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Reset: value 0 resets the chip, 1 clears its buffer towards the host, 2 clears its buffer from the host.
    Reset = 0,
    /// Modem lines: DTR in bit 0, RTS in bit 1; the high byte is the mask of the lines to change.
    ModemLines = 1,
    /// Flow control; 0: none.
    FlowControl = 2,
    /// Baud rate, as a divisor of 3 MHz; the upper bits encode eighths.
    BaudRate = 3,
    /// Frame format; 8: eight bits, no parity, one stop bit.
    DataFormat = 4,
    /// Time after which the chip sends its buffer, or the status bytes alone, ms.
    LatencyTimer = 9,
}

/// Error: the chip is gone (unplugged, or its hub was reset).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChipLost;

/// Error: a packet is shorter than its two status bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ShortPacket;

/// Connection to an FTDI chip; one thread may read while others write.
pub trait Chip: Send + Sync + 'static {
    /// Sends a control request with its value. Not real-time.
    ///
    /// # Errors
    /// If the chip is gone.
    fn request(&self, request: Request, value: u16) -> Result<(), ChipLost>;

    /// Sends bytes down the serial line, and waits until the chip has received them. Not real-time: waits for the bus.
    ///
    /// # Errors
    /// If the chip is gone.
    fn write(&self, bytes: &[u8]) -> Result<(), ChipLost>;

    /// Waits for packets until the timeout `patience`; returns the number of bytes of all packets, 64 each except the
    /// last, or 0 on timeout. Not real-time: waits for the bus.
    ///
    /// # Errors
    /// If the chip is gone.
    fn read(&self, packets: &mut [u8], patience: Duration) -> Result<usize, ChipLost>;

    /// Returns the independent stop of the chip: a message that sends the bytes `_rest` on the serial line. The default is no
    /// independent stop, as for a chip on USB, which only system calls of this process can reach.
    fn independent_stop(&self, _rest: &[u8]) -> IndependentStop {
        IndependentStop::none()
    }
}

/// Calls `each` with every received byte except the status bytes. Real-time: bounded, no allocation.
///
/// # Errors
/// If a packet is shorter than its status bytes.
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
        let mut received = Vec::new();
        let packets = [numbered(0, 62), numbered(62, 62), numbered(124, 5)].concat();
        payload(&packets, |byte| received.push(byte)).expect("each has its status");
        assert_eq!(received, (0..129).collect::<Vec<u8>>());
        received.clear();
        assert_eq!(payload(&[1, 0x60], |byte| received.push(byte)), Ok(()), "an idle chip");
        assert_eq!(payload(&[1], |byte| received.push(byte)), Err(ShortPacket));
        assert_eq!(received, []);
    }
}
