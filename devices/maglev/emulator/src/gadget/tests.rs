//! Device on its bus without a kernel: the test sends the messages of a host controller.

use super::{Gadget, Personality};
use flotor_maglev::transport::{Incoming, LinkLost};
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// A host controller that sends by hand.
struct Host {
    stream: UnixStream,
    number: u32,
}

impl Host {
    fn with(personality: Personality) -> (Self, Gadget) {
        let (ours, theirs) = UnixStream::pair().unwrap();
        ours.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        (Self { stream: ours, number: 0 }, Gadget::serve(personality, "T-1", theirs).unwrap())
    }

    /// Sends a transfer; its number.
    fn submit(&mut self, endpoint: u8, length: u32, setup: [u8; 8], data: &[u8]) -> u32 {
        self.number += 1;
        let mut bytes = Vec::new();
        for field in [1, self.number, 0x1_0001, u32::from(endpoint >> 7), u32::from(endpoint & 15), 0, length]
        {
            bytes.extend(field.to_be_bytes());
        }
        bytes.extend([0; 12]);
        bytes.extend(setup);
        bytes.extend(data);
        self.stream.write_all(&bytes).unwrap();
        self.number
    }

    fn unlink(&mut self, transfer: u32) {
        self.number += 1;
        let mut bytes = Vec::new();
        for field in [2, self.number, 0, 0, 0, transfer] {
            bytes.extend(u32::to_be_bytes(field));
        }
        bytes.extend([0; 24]);
        self.stream.write_all(&bytes).unwrap();
    }

    /// Kind, number, status of an answer, and its data if it has any.
    fn answer(&mut self, input: bool) -> (u32, u32, i32, Vec<u8>) {
        let mut header = [0; 48];
        self.stream.read_exact(&mut header).unwrap();
        let field = |at: usize| u32::from_be_bytes(header[at..at + 4].try_into().unwrap());
        let mut data = vec![0; if input { field(24) as usize } else { 0 }];
        self.stream.read_exact(&mut data).unwrap();
        (field(0), field(4), field(20).cast_signed(), data)
    }

    fn control(&mut self, setup: [u8; 8]) -> (i32, Vec<u8>) {
        let input = setup[0] & 0x80 != 0;
        let length = u32::from(u16::from_le_bytes([setup[6], setup[7]]));
        self.submit(if input { 0x80 } else { 0 }, length, setup, &[]);
        let (_, _, status, data) = self.answer(input);
        (status, data)
    }
}

const SELECT_1: [u8; 8] = [0x01, 11, 1, 0, 0, 0, 0, 0];
const SELECT_0: [u8; 8] = [0x01, 11, 0, 0, 0, 0, 0, 0];
const SOON: Duration = Duration::from_secs(5);

#[test]
fn descriptors_are_as_long_as_they_say() {
    for personality in [Personality::Interrupt, Personality::Bulk, Personality::Hid, Personality::Serial] {
        let (mut host, _gadget) = Host::with(personality);
        let (status, device) = host.control([0x80, 6, 0, 1, 0, 0, 255, 0]);
        assert_eq!((status, device.len(), device[0]), (0, 18, 18));
        let (_, configuration) = host.control([0x80, 6, 0, 2, 0, 0, 255, 0]);
        assert_eq!(
            usize::from(u16::from_le_bytes([configuration[2], configuration[3]])),
            configuration.len()
        );
        // Every descriptor begins with its length, and the chain ends where the whole ends.
        let mut at = 0;
        while at < configuration.len() {
            at += usize::from(configuration[at]);
        }
        assert_eq!(at, configuration.len());
        let (_, serial) = host.control([0x80, 6, 3, 3, 9, 4, 255, 0]);
        assert_eq!(serial, [8, 3, b'T', 0, b'-', 0, b'1', 0]);
        // No more than was requested; nothing of what is not there.
        assert_eq!(host.control([0x80, 6, 0, 1, 0, 0, 8, 0]).1.len(), 8);
        assert_eq!(host.control([0x80, 6, 9, 3, 9, 4, 255, 0]).0, -32);
    }
}

#[test]
fn setting_1_begins_a_use_and_setting_0_ends_it() {
    let (mut host, gadget) = Host::with(Personality::Interrupt);
    assert!(gadget.wait_for_host(Duration::ZERO).is_none());
    assert_eq!(host.control(SELECT_1).0, 0);
    let mut link = gadget.wait_for_host(SOON).unwrap();
    host.submit(1, 64, [0; 8], &[7; 64]);
    assert_eq!(host.answer(false).2, 0);
    assert_eq!(link.wait(SOON), Ok(Incoming::Packet([7; 64])));
    host.submit(1, 3, [0; 8], &[7; 3]);
    assert_eq!(link.wait(SOON), Ok(Incoming::Malformed));
    assert_eq!(host.answer(false).2, 0);
    host.control(SELECT_0);
    assert_eq!((link.receive(), link.send(&[0; 64])), (Err(LinkLost), Err(LinkLost)));
    // The next use is another link; the old one stays lost.
    host.control(SELECT_1);
    assert!(gadget.wait_for_host(SOON).unwrap().receive().is_ok());
    assert_eq!(link.receive(), Err(LinkLost));
}

#[test]
fn a_transfer_waits_until_there_is_something_or_it_is_taken_back() {
    let (mut host, gadget) = Host::with(Personality::Bulk);
    host.control(SELECT_1);
    let mut link = gadget.wait_for_host(SOON).unwrap();
    let (first, second) = (host.submit(0x81, 512, [0; 8], &[]), host.submit(0x81, 512, [0; 8], &[]));
    host.unlink(first);
    let (kind, _, status, _) = host.answer(false);
    assert_eq!((kind, status), (4, -104), "in time");
    link.send(&[9; 64]).unwrap();
    assert_eq!(host.answer(true), (3, second, 0, vec![9; 64]));
    // Too late to take it back.
    host.unlink(second);
    let (kind, _, status, _) = host.answer(false);
    assert_eq!((kind, status), (4, 0));
}

#[test]
fn a_pulled_cable_ends_the_use() {
    let (mut host, gadget) = Host::with(Personality::Interrupt);
    host.control(SELECT_1);
    let mut link = gadget.wait_for_host(SOON).unwrap();
    drop(gadget);
    assert_eq!(link.wait(SOON), Err(LinkLost));
    assert_eq!(host.stream.read(&mut [0; 1]).unwrap(), 0);
}

#[test]
fn a_serial_port_is_used_while_dtr_is_set() {
    let (mut host, gadget) = Host::with(Personality::Serial);
    assert_eq!(host.control([0x21, 0x22, 3, 0, 0, 0, 0, 0]).0, 0);
    let mut link = gadget.wait_for_host(SOON).unwrap();
    let (coded, length) = flotor_maglev::protocol::stream::coded(&[5; 64]);
    host.submit(1, u32::try_from(length).unwrap(), [0; 8], &coded[..length]);
    host.answer(false);
    assert_eq!(link.wait(SOON), Ok(Incoming::Packet([5; 64])));
    link.send(&[6; 64]).unwrap();
    host.submit(0x81, 512, [0; 8], &[]);
    assert_eq!(host.answer(true).3.len(), 66);
    host.control([0x21, 0x22, 0, 0, 0, 0, 0, 0]);
    assert_eq!(link.receive(), Err(LinkLost));
}

#[test]
fn a_hid_device_is_used_while_reports_are_fetched() {
    let (mut host, gadget) = Host::with(Personality::Hid);
    assert_eq!(host.control([0x81, 6, 0, 0x22, 0, 0, 255, 0]).1.len(), 27);
    let fetch = host.submit(0x81, 64, [0; 8], &[]);
    host.submit(1, 64, [0; 8], &[7; 64]);
    host.answer(false);
    let mut link = gadget.wait_for_host(SOON).unwrap();
    std::thread::sleep(Duration::from_millis(10));
    assert_eq!(link.receive(), Ok(Incoming::Packet([7; 64])), "a host that waits is there");
    host.unlink(fetch);
    host.answer(false);
    std::thread::sleep(Duration::from_millis(10));
    assert_eq!(link.receive(), Err(LinkLost));
}

#[test]
fn nonsense_ends_the_connection() {
    let (mut host, gadget) = Host::with(Personality::Interrupt);
    host.stream.write_all(&[0xff; 48]).unwrap();
    assert!(gadget.wait_for_host(SOON).is_none());
}
