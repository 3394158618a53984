//! Sources of reports.

use crate::platform::{ACCESS_REMEDY, PATH_EXAMPLE, is_refused};
use flotor_hal::Refusal;
use hidapi::{HidApi, HidDevice, HidError};

/// USB vendor IDs: 3Dconnexion, and Logitech, which sold the older pucks.
const VENDORS: [u16; 2] = [0x256f, 0x046d];
/// USB product IDs of 3Dconnexion's pucks under Logitech's vendor ID: from the SpaceMouse Plus (c603) to the SpaceMouse
/// Pro (c62b).
const PRODUCTS_OF_LOGITECH: std::ops::RangeInclusive<u16> = 0xc603..=0xc62b;
/// HID usage of a six-axis puck: a multi-axis controller of the generic desktop page.
const PAGE: u16 = 0x01;
const MULTI_AXIS_CONTROLLER: u16 = 0x08;

/// Buffer size of a report, bytes.
pub const REPORT_BYTES: usize = 64;

/// Error: the puck is gone (unplugged, or switched off).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gone;

/// Source of the puck's reports.
pub trait Reports: Sized + Send + 'static {
    /// Opens the puck at a device path, or the first puck found. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] with the cause and the remedy.
    fn open(path: Option<&str>) -> Result<Self, Refusal>;

    /// Reads the next pending report and returns its length; 0 if none is pending. Never waits. Real-time: bounded, no allocation,
    /// one system call.
    ///
    /// # Errors
    /// If the puck is gone.
    fn next(&mut self, report: &mut [u8; REPORT_BYTES]) -> Result<usize, Gone>;
}

/// Puck opened as a HID device through hidapi.
pub struct HidPuck(HidDevice);

fn refused(path: &str, error: &HidError) -> Refusal {
    Refusal::resource(if is_refused(error) {
        format!("no access to {path}; {ACCESS_REMEDY}")
    } else {
        format!("cannot open {path}: {error}; check the connection of the device, and its `path`")
    })
}

impl Reports for HidPuck {
    fn open(path: Option<&str>) -> Result<Self, Refusal> {
        let api = HidApi::new().map_err(Refusal::resource)?;
        let puck = |info: &&hidapi::DeviceInfo| {
            let (vendor, product) = (info.vendor_id(), info.product_id());
            let ours =
                vendor == VENDORS[0] || vendor == VENDORS[1] && PRODUCTS_OF_LOGITECH.contains(&product);
            // Some pucks are a keyboard as well: the usage distinguishes them.
            ours && (info.usage_page(), info.usage()) == (PAGE, MULTI_AXIS_CONTROLLER)
        };
        let path = match path {
            Some(path) => std::ffi::CString::new(path).map_err(|_| {
                Refusal::parameter("`path` has a null character, which no path has; correct the path")
            })?,
            None => api.device_list().find(puck).map(|info| info.path().to_owned()).ok_or_else(|| {
                Refusal::resource(format!(
                    "no SpaceMouse found; connect a SpaceMouse, or set its `path`, such as {PATH_EXAMPLE}"
                ))
            })?,
        };
        let device = api.open_path(&path).map_err(|error| refused(&path.to_string_lossy(), &error))?;
        device.set_blocking_mode(false).map_err(Refusal::resource)?;
        Ok(Self(device))
    }

    fn next(&mut self, report: &mut [u8; REPORT_BYTES]) -> Result<usize, Gone> {
        // Any read error means a disconnected puck: hidapi returns no error code.
        self.0.read_timeout(report, 0).map_err(|_| Gone)
    }
}
