//! Extension `flotor.connection/1`: how a device is connected, as data, so that a host can look at the machine before the
//! device is opened: is it there, may this user use it, does another driver or program have it.

use crate::Device;
use crate::abi::interface::table;
use crate::abi::layout::layout;
#[cfg(feature = "loader")]
use crate::abi::loader::Plugin;

/// Through what a device on USB is used, as a closed set. In C as a number of this value.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsbAccess {
    /// The bus itself, without a driver of the kernel.
    Raw = 0,
    /// A serial port of the kernel's.
    Serial = 1,
    /// The kernel's raw HID.
    Hid = 2,
}

impl UsbAccess {
    /// Reads it from the boundary; `None` for a code that this contract does not know.
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Raw),
            1 => Some(Self::Serial),
            2 => Some(Self::Hid),
            _ => None,
        }
    }
}

/// A kind of device on USB. 8 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct UsbKind {
    pub(crate) vendor: u16,
    pub(crate) product: u16,
    /// Code of a [`UsbAccess`].
    pub(crate) access: u32,
}

impl UsbKind {
    /// One product of a vendor.
    #[must_use]
    pub const fn new(vendor: u16, product: u16, access: UsbAccess) -> Self {
        Self { vendor, product, access: access as u32 }
    }

    /// Every product of a vendor.
    #[must_use]
    pub const fn of_vendor(vendor: u16, access: UsbAccess) -> Self {
        Self::new(vendor, 0, access)
    }

    /// Number of the vendor.
    #[must_use]
    pub const fn vendor(&self) -> u16 {
        self.vendor
    }

    /// Number of the product; `None`: every one of the vendor.
    #[must_use]
    pub const fn product(&self) -> Option<u16> {
        if self.product == 0 { None } else { Some(self.product) }
    }

    /// Through what it is used; `None` if a plugin wrote something that is no access.
    #[must_use]
    pub const fn access(&self) -> Option<UsbAccess> {
        UsbAccess::from_code(self.access)
    }
}

/// A device that says how it is connected.
///
/// ```
/// # use flotor_hal::*;
/// # struct Crank { samples: u64, ledger: EnergyLedger }
/// # impl Device for Crank {
/// #     const INFO: DeviceInfo = DeviceInfo::new("crank", "Crank", "A handle that turns");
/// #     type Active = Crank;
/// #     type Stop = NothingToStop;
/// #     fn open(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Crank { samples: 0, ledger: EnergyLedger::default() })
/// #     }
/// #     fn capabilities(&self) -> Capabilities { Capabilities::UNDRIVEN }
/// #     fn stopper(&self) -> NothingToStop { NothingToStop }
/// #     fn activate(self, _: &LoopConfig) -> Result<Crank, (Self, Refusal)> { Ok(self) }
/// # }
/// # impl ActiveDevice for Crank {
/// #     type Opened = Crank;
/// #     fn read(&mut self, _: &Tick, _: &mut DeviceState) -> Cycle { Cycle::Fresh }
/// #     fn write(&mut self, _: &Tick, _: &Wrench) -> Cycle { Cycle::Fresh }
/// #     fn deactivate(self) -> Crank { self }
/// # }
/// /// On a serial port of the kernel, behind a USB bridge: `export_device!(Crank, connection)`. `flotor doctor --device crank`
/// /// looks for it before it opens the device.
/// impl ConnectionDevice for Crank {
///     const USB: &'static [UsbKind] = &[UsbKind::new(0x1209, 0x0001, UsbAccess::Serial)];
/// }
/// assert_eq!(Crank::USB[0].product(), Some(1));
/// ```
pub trait ConnectionDevice: Device {
    /// What it is on USB: any of these.
    const USB: &'static [UsbKind];
}

/// `flotor.connection/1`: see [`ConnectionDevice`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ConnectionTable {
    /// Bytes of this table as the plugin knows it.
    pub size: u32,
    /// Number of kinds.
    pub usb_count: u32,
    /// What it is on USB, constant.
    pub usb: *const UsbKind,
}

layout! {
    UsbKind { vendor, product, access }
    ConnectionTable { size, usb_count, usb }
}
table!(ConnectionTable: "flotor.connection/1", D: [ConnectionDevice] {
    usb_count: D::USB.len() as u32,
    usb: D::USB.as_ptr(),
});

#[cfg(feature = "loader")]
impl Plugin {
    /// What a device is on USB; empty for one that does not say, and for a model.
    #[must_use]
    pub fn usb_kinds(&self) -> &'static [UsbKind] {
        match self.device_extensions().and_then(|extensions| extensions.connection) {
            Some(table) if !table.usb.is_null() && table.usb_count > 0 => {
                // SAFETY: a table's list is a static array of `usb_count` kinds of the checked layout.
                unsafe { std::slice::from_raw_parts(table.usb, table.usb_count as usize) }
            }
            _ => &[],
        }
    }
}
