//! Descriptors that a device returns during enumeration (USB 2.0, chapter 9), little endian.

/// Type of a device descriptor.
pub const DEVICE: u8 = 1;
/// Type of a configuration descriptor.
pub const CONFIGURATION: u8 = 2;
/// Type of a string descriptor.
pub const STRING: u8 = 3;
const INTERFACE: u8 = 4;
const ENDPOINT: u8 = 5;

/// Transfer type of a bulk endpoint.
pub const BULK: u8 = 2;
/// Transfer type of an interrupt endpoint.
pub const INTERRUPT: u8 = 3;

/// Longest text of a string descriptor, UTF-16 units: the length of a descriptor has one byte.
const LONGEST_TEXT: usize = 126;

/// Contents of a device descriptor; the device has one configuration and the strings 1 to 3.
#[derive(Clone, Copy, Debug)]
pub struct Device {
    /// Version of USB, binary-coded decimal.
    pub usb: u16,
    /// Device class; 0: the interfaces have classes.
    pub class: u8,
    /// Largest packet of the control endpoint, bytes.
    pub packet_bytes: u8,
    /// Vendor id.
    pub vendor: u16,
    /// Product id.
    pub product: u16,
    /// Version of the device, binary-coded decimal.
    pub release: u16,
}

impl Device {
    /// Encodes the descriptor.
    #[must_use]
    pub fn bytes(&self) -> Vec<u8> {
        let mut bytes = vec![18, DEVICE];
        bytes.extend(self.usb.to_le_bytes());
        bytes.extend([self.class, 0, 0, self.packet_bytes]);
        bytes.extend([self.vendor, self.product, self.release].into_iter().flat_map(u16::to_le_bytes));
        bytes.extend([1, 2, 3]);
        bytes.push(1);
        bytes
    }
}

/// Power supply of a device, as in a configuration descriptor.
#[derive(Clone, Copy, Debug)]
pub enum Supply {
    /// By the bus.
    Bus = 0x80,
    /// Supply of the device itself.
    Own = 0xc0,
}

/// Encodes the only configuration, with the descriptors of `interfaces` interfaces in `body`; `current_2ma`: largest current
/// from the bus, in units of 2 mA.
#[must_use]
pub fn configuration(interfaces: u8, supply: Supply, current_2ma: u8, body: &[u8]) -> Vec<u8> {
    let [low, high] = u16::try_from(9 + body.len()).unwrap_or(0).to_le_bytes();
    let head = [9, CONFIGURATION, low, high, interfaces, 1, 0, supply as u8, current_2ma];
    [&head, body].concat()
}

/// Encodes an interface descriptor; `class`: class, subclass and protocol; `name`: index of the string descriptor of the
/// interface, 0 for none.
#[must_use]
pub fn interface(number: u8, alternate: u8, endpoints: u8, class: [u8; 3], name: u8) -> [u8; 9] {
    let [class, subclass, protocol] = class;
    [9, INTERFACE, number, alternate, endpoints, class, subclass, protocol, name]
}

/// Encodes an endpoint descriptor; `packet_bytes`: largest packet, `interval`: polling interval, coded as `bInterval`.
#[must_use]
pub fn endpoint(address: u8, transfer_type: u8, packet_bytes: u16, interval: u8) -> [u8; 7] {
    let [low, high] = packet_bytes.to_le_bytes();
    [7, ENDPOINT, address, transfer_type, low, high, interval]
}

/// Encodes the string descriptor `number`: 0 lists the languages, 1 to 3 are the maker, the product and the serial number;
/// `None` for an unknown number.
#[must_use]
pub fn string(number: u8, [maker, product, serial]: [&str; 3]) -> Option<Vec<u8>> {
    let text = match number {
        0 => return Some(vec![4, STRING, 0x09, 0x04]), // American English
        1 => maker,
        2 => product,
        3 => serial,
        _ => return None,
    };
    let mut bytes: Vec<u8> = text.encode_utf16().take(LONGEST_TEXT).flat_map(u16::to_le_bytes).collect();
    bytes.splice(0..0, [u8::try_from(bytes.len() + 2).unwrap_or(u8::MAX), STRING]);
    Some(bytes)
}
