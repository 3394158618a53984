//! Description of a controller: axes, ranges, limits, in three pages.

use super::frame::{Reader, Rejection, Writer};

/// Length of a serial number; shorter ones end in zeros.
pub const SERIAL_BYTES: usize = 16;

/// Description of a controller. SI units, device frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// Sensed axes, one bit each: x, y, z, then rotation about x, y, z.
    pub sensed: u8,
    /// Actuated axes, one bit each: x, y, z, then rotation about x, y, z.
    pub actuated: u8,
    /// Position resolution, m.
    pub resolution_m: f32,
    /// Slowest and fastest command rate, Hz.
    pub rate_hz: [f32; 2],
    /// Latency from a sample to the resulting force, beyond one period, µs.
    pub latency_us: u32,
    /// Serial number, ASCII, zeros at the end.
    pub serial: [u8; SERIAL_BYTES],
    /// Largest displacement along each axis, m.
    pub range_m: [f32; 3],
    /// Largest rotation about each axis, rad.
    pub range_rad: [f32; 3],
    /// Largest stiffness rendered stably, N/m.
    pub max_stiffness_n_per_m: f32,
    /// Fastest change of force, N/s.
    pub force_slew_n_per_s: f32,
    /// Fastest change of torque, N·m/s.
    pub torque_slew_nm_per_s: f32,
    /// Largest force along each axis, N.
    pub max_force_n: [f32; 3],
    /// Largest torque about each axis, N·m.
    pub max_torque_nm: [f32; 3],
    /// Longest watchdog time that a host may request, µs.
    pub longest_watchdog_us: u32,
}

/// One page of a description.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Page {
    /// Axes, resolution, rates, latency, serial number.
    Axes {
        /// See [`Description::sensed`].
        sensed: u8,
        /// See [`Description::actuated`].
        actuated: u8,
        /// See [`Description::resolution_m`].
        resolution_m: f32,
        /// See [`Description::rate_hz`].
        rate_hz: [f32; 2],
        /// See [`Description::latency_us`].
        latency_us: u32,
        /// See [`Description::serial`].
        serial: [u8; SERIAL_BYTES],
    },
    /// Ranges, stiffness, slew.
    Ranges {
        /// See [`Description::range_m`].
        range_m: [f32; 3],
        /// See [`Description::range_rad`].
        range_rad: [f32; 3],
        /// Largest stiffness, slew rate of force, slew rate of torque.
        rates: [f32; 3],
    },
    /// Largest force and torque, longest watchdog time.
    Limits {
        /// See [`Description::max_force_n`].
        max_force_n: [f32; 3],
        /// See [`Description::max_torque_nm`].
        max_torque_nm: [f32; 3],
        /// See [`Description::longest_watchdog_us`].
        longest_watchdog_us: u32,
    },
}

/// Number of pages of a description.
pub const PAGES: u16 = 3;

impl Description {
    /// Returns a page of the description.
    ///
    /// # Errors
    /// [`Rejection::Kind`] if there is no such page.
    pub fn page(&self, number: u16) -> Result<Page, Rejection> {
        Ok(match number {
            0 => Page::Axes {
                sensed: self.sensed,
                actuated: self.actuated,
                resolution_m: self.resolution_m,
                rate_hz: self.rate_hz,
                latency_us: self.latency_us,
                serial: self.serial,
            },
            1 => Page::Ranges {
                range_m: self.range_m,
                range_rad: self.range_rad,
                rates: [self.max_stiffness_n_per_m, self.force_slew_n_per_s, self.torque_slew_nm_per_s],
            },
            2 => Page::Limits {
                max_force_n: self.max_force_n,
                max_torque_nm: self.max_torque_nm,
                longest_watchdog_us: self.longest_watchdog_us,
            },
            _ => return Err(Rejection::Kind),
        })
    }

    /// Assembles a description; `None` unless the pages are the three in order.
    #[must_use]
    pub fn from_pages(pages: [Page; 3]) -> Option<Self> {
        let [
            Page::Axes { sensed, actuated, resolution_m, rate_hz, latency_us, serial },
            Page::Ranges { range_m, range_rad, rates },
            Page::Limits { max_force_n, max_torque_nm, longest_watchdog_us },
        ] = pages
        else {
            return None;
        };
        let [max_stiffness_n_per_m, force_slew_n_per_s, torque_slew_nm_per_s] = rates;
        Some(Self {
            sensed,
            actuated,
            resolution_m,
            rate_hz,
            latency_us,
            serial,
            range_m,
            range_rad,
            max_stiffness_n_per_m,
            force_slew_n_per_s,
            torque_slew_nm_per_s,
            max_force_n,
            max_torque_nm,
            longest_watchdog_us,
        })
    }

    /// Returns the serial number as text; drops bytes that are not printable ASCII. Not real-time.
    #[must_use]
    pub fn serial_text(&self) -> String {
        self.serial.iter().filter(|byte| byte.is_ascii_graphic()).map(|byte| char::from(*byte)).collect()
    }
}

/// Converts a serial number to at most 16 bytes; longer ones are cut.
#[must_use]
pub fn serial_bytes(serial: &str) -> [u8; SERIAL_BYTES] {
    let mut bytes = [0; SERIAL_BYTES];
    bytes.iter_mut().zip(serial.bytes()).for_each(|(slot, byte)| *slot = byte);
    bytes
}

impl Page {
    /// Returns the number of the page.
    #[must_use]
    pub const fn number(&self) -> u16 {
        match self {
            Self::Axes { .. } => 0,
            Self::Ranges { .. } => 1,
            Self::Limits { .. } => 2,
        }
    }

    pub(super) fn write(&self, bytes: &mut Writer) {
        match self {
            Self::Axes { sensed, actuated, resolution_m, rate_hz, latency_us, serial } => {
                bytes.put(20, &[*sensed, *actuated]).floats(24, &[*resolution_m]).floats(28, rate_hz);
                bytes.double(36, *latency_us).put(40, serial);
            }
            Self::Ranges { range_m, range_rad, rates } => {
                bytes.floats(20, range_m).floats(32, range_rad).floats(44, rates);
            }
            Self::Limits { max_force_n, max_torque_nm, longest_watchdog_us } => {
                bytes.floats(20, max_force_n).floats(32, max_torque_nm).double(44, *longest_watchdog_us);
            }
        }
    }

    pub(super) fn read(number: u16, bytes: &Reader<'_>) -> Result<Self, Rejection> {
        Ok(match number {
            0 => {
                let [sensed, actuated] = bytes.array(20);
                let [resolution_m] = bytes.floats(24)?;
                let (rate_hz, latency_us) = (bytes.floats(28)?, bytes.double(36));
                Self::Axes { sensed, actuated, resolution_m, rate_hz, latency_us, serial: bytes.array(40) }
            }
            1 => Self::Ranges {
                range_m: bytes.floats(20)?,
                range_rad: bytes.floats(32)?,
                rates: bytes.floats(44)?,
            },
            2 => Self::Limits {
                max_force_n: bytes.floats(20)?,
                max_torque_nm: bytes.floats(32)?,
                longest_watchdog_us: bytes.double(44),
            },
            _ => return Err(Rejection::Kind),
        })
    }
}
