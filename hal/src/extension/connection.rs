//! Extension `flotor.connection/1`: connection of a device, as data, so that a host can diagnose the machine before
//! opening the device: presence, permission, and use by another driver or program.

use crate::Device;
use crate::abi::interface::table;
use crate::abi::layout::layout;

/// Access path to a USB device, as a closed set. In C, a `uint32_t` with these values.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UsbAccess {
    /// USB bus, without a kernel driver.
    Raw = 0,
    /// Serial port of the kernel.
    Serial = 1,
    /// Raw HID interface of the kernel.
    Hid = 2,
}

impl UsbAccess {
    /// Converts an access path code of the ABI; `None` for an unknown code.
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

/// USB identity of a device: vendor, product and access path. 8 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct UsbKind {
    pub(crate) vendor: u16,
    pub(crate) product: u16,
    /// Code of a [`UsbAccess`].
    pub(crate) access: u32,
}

impl UsbKind {
    /// Returns the identity of one product of a vendor.
    pub const fn new(vendor: u16, product: u16, access: UsbAccess) -> Self {
        Self { vendor, product, access: access as u32 }
    }

    /// Returns the identity of all products of a vendor.
    pub const fn of_vendor(vendor: u16, access: UsbAccess) -> Self {
        Self::new(vendor, 0, access)
    }

    /// Returns the vendor id (`idVendor`).
    #[must_use]
    pub const fn vendor(&self) -> u16 {
        self.vendor
    }

    /// Returns the product id (`idProduct`); `None` for all products of the vendor.
    #[must_use]
    pub const fn product(&self) -> Option<u16> {
        if self.product == 0 { None } else { Some(self.product) }
    }

    /// Returns the access path; `None` if a plugin wrote an unknown code.
    #[must_use]
    pub const fn access(&self) -> Option<UsbAccess> {
        UsbAccess::from_code(self.access)
    }
}

/// Device that declares its USB identities, so that a host can diagnose the connection before opening the device.
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
/// /// checks the connection before it opens the device.
/// impl ConnectionDevice for Crank {
///     const USB: &'static [UsbKind] = &[UsbKind::new(0x1209, 0x0001, UsbAccess::Serial)];
/// }
/// assert_eq!(Crank::USB[0].product(), Some(1));
/// ```
pub trait ConnectionDevice: Device {
    /// USB identities of the device, as alternatives.
    const USB: &'static [UsbKind];
}

/// Function table `flotor.connection/1`: see [`ConnectionDevice`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ConnectionTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Number of USB identities.
    pub usb_count: u32,
    /// USB identities of the device, constant.
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
