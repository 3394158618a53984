//! Description of a controller: axes, ranges, limits, in three pages.

use super::codec::{Reader, Writer};
use super::rejection::Rejection;

/// Length of a serial number, bytes; shorter numbers are padded with zeros.
pub const SERIAL_BYTES: usize = 16;

/// Description of a controller. SI units, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// First page: axes, resolution, rates, latency, serial number.
    pub axes: AxesPage,
    /// Second page: ranges, stiffness, slew rates.
    pub ranges: RangesPage,
    /// Third page: largest force and torque, longest watchdog timeout.
    pub limits: LimitsPage,
}

/// First page: axes, resolution, rates, latency, serial number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxesPage {
    /// Sensed axes, one bit each: x, y, z, then rotation about x, y, z.
    pub sensed: u8,
    /// Actuated axes, one bit each: x, y, z, then rotation about x, y, z.
    pub actuated: u8,
    /// Position resolution, m.
    pub resolution_m: f32,
    /// Lowest and highest command rate, Hz.
    pub rate_hz: [f32; 2],
    /// Latency from a sample to the resulting force, beyond one period, µs.
    pub latency_us: u32,
    /// Serial number, ASCII, padded with zeros.
    pub serial: [u8; SERIAL_BYTES],
}

/// Second page: ranges, stiffness, slew rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangesPage {
    /// Largest displacement along each axis, m.
    pub range_m: [f32; 3],
    /// Largest rotation about each axis, rad.
    pub range_rad: [f32; 3],
    /// Largest stiffness rendered stably, N/m.
    pub max_stiffness_n_per_m: f32,
    /// Maximum slew rate of the force, N/s.
    pub force_slew_n_per_s: f32,
    /// Maximum slew rate of the torque, N·m/s.
    pub torque_slew_nm_per_s: f32,
}

/// Third page: largest force and torque, longest watchdog timeout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitsPage {
    /// Largest force along each axis, N.
    pub max_force_n: [f32; 3],
    /// Largest torque about each axis, N·m.
    pub max_torque_nm: [f32; 3],
    /// Longest watchdog timeout that a host may request, µs.
    pub longest_watchdog_us: u32,
}

/// One page of a description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Page {
    /// First page, number 0.
    Axes(AxesPage),
    /// Second page, number 1.
    Ranges(RangesPage),
    /// Third page, number 2.
    Limits(LimitsPage),
}

/// Number of pages of a description.
pub const PAGES: u16 = 3;

impl Description {
    /// Returns the page `number` (0 to 2) of the description.
    ///
    /// # Errors
    /// [`Rejection::Kind`] if there is no such page.
    pub fn page(&self, number: u16) -> Result<Page, Rejection> {
        Ok(match number {
            0 => Page::Axes(self.axes),
            1 => Page::Ranges(self.ranges),
            2 => Page::Limits(self.limits),
            _ => return Err(Rejection::Kind),
        })
    }

    /// Assembles a description; `None` unless the pages are the three in sequence.
    #[must_use]
    pub fn from_pages(pages: [Page; 3]) -> Option<Self> {
        let [Page::Axes(axes), Page::Ranges(ranges), Page::Limits(limits)] = pages else { return None };
        Some(Self { axes, ranges, limits })
    }

    /// Returns the serial number as text; drops spaces and all bytes that are not printable ASCII. Not real-time.
    #[must_use]
    pub fn serial_text(&self) -> String {
        self.axes.serial.iter().filter(|byte| byte.is_ascii_graphic()).map(|byte| char::from(*byte)).collect()
    }
}

/// Converts a serial number to 16 bytes, truncated or padded with zeros.
#[must_use]
pub fn serial_bytes(serial: &str) -> [u8; SERIAL_BYTES] {
    let mut bytes = [0; SERIAL_BYTES];
    bytes.iter_mut().zip(serial.bytes()).for_each(|(slot, byte)| *slot = byte);
    bytes
}

impl Page {
    /// Returns the number of the page, 0 to 2.
    #[must_use]
    pub const fn number(&self) -> u16 {
        match self {
            Self::Axes(_) => 0,
            Self::Ranges(_) => 1,
            Self::Limits(_) => 2,
        }
    }

    pub(super) fn write(&self, bytes: &mut Writer) {
        match self {
            Self::Axes(page) => {
                bytes.put(20, &[page.sensed, page.actuated]).floats(24, &[page.resolution_m]);
                bytes.floats(28, &page.rate_hz).double(36, page.latency_us).put(40, &page.serial);
            }
            Self::Ranges(page) => {
                bytes.floats(20, &page.range_m).floats(32, &page.range_rad);
                bytes.floats(
                    44,
                    &[page.max_stiffness_n_per_m, page.force_slew_n_per_s, page.torque_slew_nm_per_s],
                );
            }
            Self::Limits(page) => {
                bytes.floats(20, &page.max_force_n).floats(32, &page.max_torque_nm);
                bytes.double(44, page.longest_watchdog_us);
            }
        }
    }

    pub(super) fn read(number: u16, bytes: &Reader<'_>) -> Result<Self, Rejection> {
        Ok(match number {
            0 => {
                let [sensed, actuated] = bytes.array(20);
                let [resolution_m] = bytes.floats(24)?;
                let (rate_hz, latency_us) = (bytes.floats(28)?, bytes.double(36));
                let serial = bytes.array(40);
                Self::Axes(AxesPage { sensed, actuated, resolution_m, rate_hz, latency_us, serial })
            }
            1 => {
                let (range_m, range_rad) = (bytes.floats(20)?, bytes.floats(32)?);
                let [max_stiffness_n_per_m, force_slew_n_per_s, torque_slew_nm_per_s] = bytes.floats(44)?;
                Self::Ranges(RangesPage {
                    range_m,
                    range_rad,
                    max_stiffness_n_per_m,
                    force_slew_n_per_s,
                    torque_slew_nm_per_s,
                })
            }
            2 => Self::Limits(LimitsPage {
                max_force_n: bytes.floats(20)?,
                max_torque_nm: bytes.floats(32)?,
                longest_watchdog_us: bytes.double(44),
            }),
            _ => return Err(Rejection::Kind),
        })
    }
}
