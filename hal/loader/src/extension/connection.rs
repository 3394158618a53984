//! Host side of `flotor.connection/1`: the USB identities of a device, read before the device is opened.

use crate::Plugin;
use crate::declaration::static_list;
use flotor_hal::UsbKind;

impl Plugin {
    /// Returns the USB identities of a device; empty without a declaration and for a model.
    pub fn usb_kinds(&self) -> &'static [UsbKind] {
        let table = self.device_extensions().and_then(|extensions| extensions.connection);
        // SAFETY: a table's list is a static array of `usb_count` kinds of the checked layout.
        table.map_or(&[], |table| unsafe { static_list(table.usb, table.usb_count) })
    }
}
