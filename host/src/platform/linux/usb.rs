//! Diagnosis of a device's USB connection from sysfs: presence, hub, driver, permission.

use crate::diagnosis::{Diagnosis, Grade};
use flotor_hal::{UsbAccess, UsbKind};
use rustix::fs::{Access, access};
use std::fs::{read_dir, read_link, read_to_string};
use std::path::{Path, PathBuf};

/// Folders with udev rules, relative to the root.
const RULES: [&str; 4] = ["etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d"];
/// Property with which a udev rule excludes a port from ModemManager.
const IGNORED: &str = "ID_MM_DEVICE_IGNORE";

/// Root folder of a machine's files, with a check of access rights.
pub(crate) struct Machine {
    root: PathBuf,
    /// Returns true if this user may read and write a file.
    may_use: fn(&Path) -> bool,
}

/// USB device of one of the requested kinds, found in sysfs.
struct Seen {
    /// Folder of the device below `sys/bus/usb/devices`.
    folder: PathBuf,
    /// Position on the bus: `1-4.2` is port 2 of a hub at port 4 of bus 1.
    place: String,
    vendor: u16,
    product: u16,
    /// Requested kind that the device matches.
    kind: UsbKind,
    access: UsbAccess,
}

impl Machine {
    /// Creates the machine whose files are below `root`: `/`, except in tests.
    pub(crate) fn at(root: &Path) -> Self {
        let may_use = |path: &Path| access(path, Access::READ_OK | Access::WRITE_OK).is_ok();
        Self { root: root.to_path_buf(), may_use }
    }

    /// Returns the connected devices of these kinds, sorted by their position.
    fn seen(&self, kinds: &[UsbKind]) -> Vec<Seen> {
        let folders = entries(&self.root.join("sys/bus/usb/devices"));
        let mut seen: Vec<Seen> = folders.filter_map(|folder| Seen::of(&folder, kinds)).collect();
        seen.sort_by(|a, b| a.place.cmp(&b.place));
        seen
    }

    /// Returns true if a program with this name is running.
    fn runs(&self, program: &str) -> bool {
        let processes = entries(&self.root.join("proc"));
        processes.filter_map(|process| text_of(&process, "comm")).any(|name| name == program)
    }

    /// Returns true if a udev rule excludes the ports of a vendor from ModemManager.
    fn keeps_modem_manager_away(&self, vendor: u16) -> bool {
        let vendor = format!("{vendor:04x}");
        let files = RULES.iter().flat_map(|folder| entries(&self.root.join(folder)));
        let mut texts = files.filter_map(|file| read_to_string(file).ok());
        let is_rule = |line: &str| {
            !line.trim_start().starts_with('#')
                && line.contains(IGNORED)
                && line.to_ascii_lowercase().contains(&vendor)
        };
        texts.any(|text| text.lines().any(is_rule))
    }
}

impl Seen {
    fn of(folder: &Path, kinds: &[UsbKind]) -> Option<Self> {
        let number = |file: &str| u16::from_str_radix(&text_of(folder, file)?, 16).ok();
        let (vendor, product) = (number("idVendor")?, number("idProduct")?);
        let is_one = |kind: &&UsbKind| {
            kind.vendor() == vendor && kind.product().is_none_or(|wanted| wanted == product)
        };
        let kind = *kinds.iter().find(is_one)?;
        let access = kind.access()?;
        let place = folder.file_name()?.to_str()?.to_owned();
        Some(Self { folder: folder.to_path_buf(), place, vendor, product, kind, access })
    }

    /// Returns the folders of the device's interfaces, such as `1-4.2:1.0`, in order.
    fn interfaces(&self) -> Vec<PathBuf> {
        let begins = format!("{}:", self.place);
        let is_own = |path: &PathBuf| {
            path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(&begins))
        };
        let mut own: Vec<PathBuf> =
            self.folder.parent().into_iter().flat_map(entries).filter(is_own).collect();
        own.sort();
        own
    }

    /// Returns the path, below the root, of the device node through which a program uses the device; `None` if there is no node.
    fn node(&self, machine: &Machine) -> Option<PathBuf> {
        if self.access == UsbAccess::Raw {
            let number = |file| text_of(&self.folder, file)?.parse::<u16>().ok();
            let (bus, device) = (number("busnum")?, number("devnum")?);
            return Some(machine.root.join(format!("dev/bus/usb/{bus:03}/{device:03}")));
        }
        // `tty/ttyACM0` in the folder of an interface, or `hidraw/hidraw0` one folder below.
        let kind = if self.access == UsbAccess::Serial { "tty" } else { "hidraw" };
        let node = self.interfaces().into_iter().find_map(|interface| {
            let below = entries(&interface).map(|path| path.join(kind));
            [interface.join(kind)].into_iter().chain(below).flat_map(|folder| entries(&folder)).next()
        })?;
        Some(machine.root.join("dev").join(node.file_name()?))
    }

    /// Returns the udev rule that grants access to the locally logged-in user (`uaccess`), limited to the product if the vendor has
    /// several products.
    fn rule(&self) -> String {
        let (begins, attribute, then) = match self.access {
            UsbAccess::Raw => ("SUBSYSTEM==\"usb\"", "ATTR", String::new()),
            UsbAccess::Serial => ("SUBSYSTEM==\"tty\"", "ATTRS", format!(" ENV{{{IGNORED}}}=\"1\",")),
            UsbAccess::Hid => ("KERNEL==\"hidraw*\"", "ATTRS", String::new()),
        };
        let product = self.kind.product().map(|id| format!(" {attribute}{{idProduct}}==\"{id:04x}\","));
        let product = product.unwrap_or_default();
        format!("{begins}, {attribute}{{idVendor}}==\"{:04x}\",{product}{then} TAG+=\"uaccess\"", self.vendor)
    }

    fn remedy_by_rule(&self) -> String {
        format!(
            "as root, put the line `{}` into /etc/udev/rules.d/70-flotor.rules; then `udevadm control --reload`, and \
             reconnect the device",
            self.rule()
        )
    }

    fn diagnose(&self, machine: &Machine, is_open: bool) -> Vec<Diagnosis> {
        let found = format!("{:04x}:{:04x} at {}", self.vendor, self.product, self.place);
        let mut diagnoses = vec![Diagnosis::good("on USB", found)];
        if self.place.contains('.') {
            diagnoses.push(Diagnosis::note(
                "hub",
                format!("behind a hub ({})", self.place),
                "connect the device to a port of the computer: a hub delays the messages, and may reset its devices",
            ));
        }
        diagnoses.extend(self.driver(is_open));
        diagnoses.extend(self.permission(machine, is_open));
        if self.access == UsbAccess::Serial && machine.runs("ModemManager") {
            let found = "writes to its port whenever it is connected, to find a modem";
            diagnoses.push(match machine.keeps_modem_manager_away(self.vendor) {
                true => Diagnosis::good("ModemManager", "does not open its port"),
                false => Diagnosis::bad("ModemManager", found, self.remedy_by_rule()),
            });
        }
        diagnoses
    }

    /// Returns a finding if a kernel driver uses the raw device, or another program while the device is not open here; `None`
    /// otherwise.
    fn driver(&self, is_open: bool) -> Option<Diagnosis> {
        if self.access != UsbAccess::Raw {
            return None;
        }
        self.interfaces().into_iter().find_map(|interface| {
            let driver = read_link(interface.join("driver")).ok()?.file_name()?.to_str()?.to_owned();
            let interface = interface.file_name()?.to_str()?.to_owned();
            if driver == "usbfs" {
                let remedy = "end that program; only one program at a time can open the device";
                let other = Diagnosis::bad("driver", "another program has the device open", remedy);
                return Some(other).filter(|_| !is_open);
            }
            let found = format!("the kernel's driver `{driver}` uses the device");
            let remedy = format!("as root: `echo {interface} > /sys/bus/usb/drivers/{driver}/unbind`");
            Some(hindrance(is_open, "driver", found, remedy))
        })
    }

    fn permission(&self, machine: &Machine, is_open: bool) -> Option<Diagnosis> {
        let Some(node) = self.node(machine) else {
            let (what, module) = match self.access {
                UsbAccess::Raw => return None,
                UsbAccess::Serial => ("serial port", "cdc_acm"),
                UsbAccess::Hid => ("raw HID", "usbhid"),
            };
            let remedy = format!("as root: `modprobe {module}`, and reconnect the device");
            let found = format!("the kernel has no {what} for the device");
            return Some(Diagnosis::bad("driver", found, remedy));
        };
        let shown = Path::new("/").join(node.strip_prefix(&machine.root).unwrap_or(&node));
        let shown = shown.display();
        Some(match (machine.may_use)(&node) {
            true => Diagnosis::good("permission", format!("this user may use {shown}")),
            false => {
                let found = format!("this user may not use {shown}");
                hindrance(is_open, "permission", found, self.remedy_by_rule())
            }
        })
    }
}

/// Creates the diagnosis of an access problem: a note if the device is open despite the problem, through a service or another
/// connection; bad otherwise.
fn hindrance(is_open: bool, what: &'static str, found: String, remedy: String) -> Diagnosis {
    Diagnosis::problem(if is_open { Grade::Note } else { Grade::Bad }, what, found, remedy)
}

/// Diagnoses the USB connection of devices of these kinds. A missing device is a note if the plugin has opened a device, and bad
/// otherwise.
pub(crate) fn connection(machine: &Machine, kinds: &[UsbKind], is_open: bool) -> Vec<Diagnosis> {
    if kinds.is_empty() {
        return Vec::new(); // a simulated device, or one behind a service
    }
    let seen = machine.seen(kinds);
    if seen.is_empty() {
        let wanted: Vec<String> = kinds.iter().map(wanted).collect();
        let found = format!("no device {}", wanted.join(" or "));
        let remedy = match is_open {
            true => "the device is open nevertheless: it is simulated, or has another connection",
            false => "connect the device and switch it on; `lsusb` lists the devices that the system detects",
        };
        return vec![hindrance(is_open, "on USB", found, remedy.to_owned())];
    }
    seen.iter().flat_map(|seen| seen.diagnose(machine, is_open)).collect()
}

fn wanted(kind: &UsbKind) -> String {
    let product = kind.product().map_or_else(|| "*".to_owned(), |product| format!("{product:04x}"));
    format!("{:04x}:{product}", kind.vendor())
}

/// Returns the paths in a folder; none if the folder cannot be read.
fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

/// Reads the trimmed text of a small file.
fn text_of(folder: &Path, file: &str) -> Option<String> {
    Some(read_to_string(folder.join(file)).ok()?.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{create_dir_all, write};
    use std::os::unix::fs::symlink;

    const KINDS: &[UsbKind] = &[
        UsbKind::of_vendor(0x1451, UsbAccess::Raw),
        UsbKind::new(0x2988, 0x0302, UsbAccess::Serial),
        UsbKind::of_vendor(0x2988, UsbAccess::Hid),
    ];

    /// A machine with one device, at this place of the bus.
    struct Fixture(tempfile::TempDir);

    impl Fixture {
        fn new(place: &str, ids: [&str; 2]) -> Self {
            let fixture = Self(tempfile::tempdir().expect("there is room"));
            let device = format!("sys/bus/usb/devices/{place}");
            for (file, text) in
                [("idVendor", ids[0]), ("idProduct", ids[1]), ("busnum", "1"), ("devnum", "7")]
            {
                fixture.file(&format!("{device}/{file}"), &format!("{text}\n"));
            }
            create_dir_all(fixture.0.path().join(format!("sys/bus/usb/devices/{place}:1.0")))
                .expect("there is room");
            fixture
        }

        fn file(&self, path: &str, text: &str) {
            let path = self.0.path().join(path);
            create_dir_all(path.parent().expect("it is below the root")).expect("there is room");
            write(path, text).expect("there is room");
        }

        fn driven_by(&self, place: &str, driver: &str) {
            let link = self.0.path().join(format!("sys/bus/usb/devices/{place}:1.0/driver"));
            symlink(format!("../../drivers/{driver}"), link).expect("there is room");
        }

        /// What is wrong or worth a note: what, found, remedy.
        fn told(&self, may_use: fn(&Path) -> bool) -> Vec<(&'static str, Grade, String)> {
            self.told_of(may_use, false)
        }

        fn told_of(&self, may_use: fn(&Path) -> bool, is_open: bool) -> Vec<(&'static str, Grade, String)> {
            let machine = Machine { root: self.0.path().to_path_buf(), may_use };
            let diagnoses = connection(&machine, KINDS, is_open);
            let told = diagnoses.into_iter().filter(|diagnosis| diagnosis.grade != Grade::Good);
            told.map(|told| {
                (told.what, told.grade, format!("{} -> {}", told.found, told.remedy.unwrap_or_default()))
            })
            .collect()
        }
    }

    fn one<'a>(told: &'a [(&'static str, Grade, String)]) -> (&'static str, Grade, &'a str) {
        let [(what, grade, words)] = told else { panic!("{told:?}") };
        (what, *grade, words)
    }

    #[test]
    fn a_device_that_is_well_connected_is_good() {
        let fixture = Fixture::new("1-4", ["1451", "0402"]);
        assert_eq!(fixture.told(|_| true), []);
    }

    #[test]
    fn one_that_is_not_there_is_told_by_its_numbers() {
        let fixture = Fixture::new("1-4", ["0403", "cb48"]);
        let told = fixture.told(|_| true);
        let (what, grade, words) = one(&told);
        assert_eq!((what, grade), ("on USB", Grade::Bad));
        assert!(
            words.starts_with("no device 1451:* or 2988:0302 or 2988:* -> connect the device"),
            "{words}"
        );
    }

    #[test]
    fn a_hub_is_noted() {
        let fixture = Fixture::new("1-4.2", ["1451", "0402"]);
        let told = fixture.told(|_| true);
        let (what, grade, words) = one(&told);
        assert_eq!((what, grade), ("hub", Grade::Note));
        assert!(
            words.starts_with("behind a hub (1-4.2) -> connect the device to a port of the computer"),
            "{words}"
        );
    }

    #[test]
    fn a_driver_or_a_program_that_has_it_is_named() {
        for (driver, expected) in [
            (
                "ftdi_sio",
                "the kernel's driver `ftdi_sio` uses the device -> as root: `echo 1-4:1.0 > /sys/bus/usb/drivers/ftdi_sio/unbind`",
            ),
            (
                "usbfs",
                "another program has the device open -> end that program; only one program at a time can open the device",
            ),
        ] {
            let fixture = Fixture::new("1-4", ["1451", "0402"]);
            fixture.driven_by("1-4", driver);
            let told = fixture.told(|_| true);
            assert_eq!(one(&told), ("driver", Grade::Bad, expected));
        }
    }

    #[test]
    fn who_may_not_use_it_gets_the_line_for_udev() {
        let fixture = Fixture::new("1-4", ["1451", "0402"]);
        let told = fixture.told(|_| false);
        let (what, grade, words) = one(&told);
        assert_eq!((what, grade), ("permission", Grade::Bad));
        assert!(words.starts_with("this user may not use /dev/bus/usb/001/007 -> "), "{words}");
        assert!(
            words.contains("`SUBSYSTEM==\"usb\", ATTR{idVendor}==\"1451\", TAG+=\"uaccess\"`"),
            "{words}"
        );
    }

    /// A raw device is claimed through the same driver by this program as by another one.
    #[test]
    fn a_device_that_is_open_is_not_taken_for_another_programs() {
        let fixture = Fixture::new("1-4", ["1451", "0402"]);
        fixture.driven_by("1-4", "usbfs");
        assert_eq!(fixture.told_of(|_| true, true), []);
    }

    #[test]
    fn what_did_not_keep_a_device_from_opening_is_a_note() {
        let fixture = Fixture::new("1-4", ["1451", "0402"]);
        fixture.driven_by("1-4", "ftdi_sio");
        let told = fixture.told_of(|_| false, true);
        let grades: Vec<_> = told.iter().map(|(what, grade, _)| (*what, *grade)).collect();
        assert_eq!(grades, [("driver", Grade::Note), ("permission", Grade::Note)]);
    }

    #[test]
    fn a_rule_is_for_one_product_where_the_plugin_names_one() {
        let fixture = Fixture::new("1-4", ["0403", "cb48"]);
        let machine = Machine { root: fixture.0.path().to_path_buf(), may_use: |_| false };
        let kinds = [UsbKind::new(0x0403, 0xcb48, UsbAccess::Raw)];
        let diagnoses = connection(&machine, &kinds, false);
        let remedy = diagnoses.into_iter().find_map(|diagnosis| diagnosis.remedy).expect("it is refused");
        let line =
            "`SUBSYSTEM==\"usb\", ATTR{idVendor}==\"0403\", ATTR{idProduct}==\"cb48\", TAG+=\"uaccess\"`";
        assert!(remedy.contains(line), "{remedy}");
    }

    #[test]
    fn a_serial_port_that_is_missing_is_the_drivers() {
        let fixture = Fixture::new("1-4", ["2988", "0302"]);
        let told = fixture.told(|_| true);
        let (what, _, words) = one(&told);
        assert_eq!(what, "driver");
        assert!(words.contains("no serial port for the device -> as root: `modprobe cdc_acm`"), "{words}");
    }

    #[test]
    fn modem_manager_is_kept_away_by_a_rule() {
        let fixture = Fixture::new("1-4", ["2988", "0302"]);
        fixture.file("sys/bus/usb/devices/1-4:1.0/tty/ttyACM0/dev", "166:0\n");
        assert_eq!(fixture.told(|_| true), [], "nobody disturbs it");
        fixture.file("proc/77/comm", "ModemManager\n");
        let told = fixture.told(|_| true);
        let (what, grade, words) = one(&told);
        assert_eq!((what, grade), ("ModemManager", Grade::Bad));
        let line = "SUBSYSTEM==\"tty\", ATTRS{idVendor}==\"2988\", ATTRS{idProduct}==\"0302\", \
                    ENV{ID_MM_DEVICE_IGNORE}=\"1\", TAG+=\"uaccess\"";
        assert!(words.contains(line), "{words}");
        fixture.file("etc/udev/rules.d/70-flotor.rules", &format!("# {line}\n"));
        assert_eq!(fixture.told(|_| true).len(), 1, "a comment is no rule");
        fixture.file("etc/udev/rules.d/70-flotor.rules", &format!("{line}\n"));
        assert_eq!(fixture.told(|_| true), []);
    }

    #[test]
    fn raw_hid_lies_below_the_device_of_its_driver() {
        let fixture = Fixture::new("1-4", ["2988", "0305"]);
        fixture.file("sys/bus/usb/devices/1-4:1.0/0003:2988:0305.0001/hidraw/hidraw3/dev", "240:3\n");
        let told = fixture.told(|_| false);
        let (what, _, words) = one(&told);
        assert_eq!(what, "permission");
        assert!(words.starts_with("this user may not use /dev/hidraw3"), "{words}");
    }
}
