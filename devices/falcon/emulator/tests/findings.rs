//! Errors of opening the plugin, as `flotor doctor --device falcon` reports them: one test for each. The checks of the bus are
//! tested in `host/src/platform/linux/usb.rs`.

use super::contract::{CONFIG, open, serve};
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon_emulator::machine::{Fault, Power};
use flotor_hal::{Axes, UsbAccess};
use flotor_loader::Plugin;

const PUSH_AND_PULL: &str =
    "push the handle in as far as possible and pull the handle out as far as possible";

/// That it is refused when it is opened, in one line with all of these words.
fn refused_with(address: &str, more: &[(&str, &str)], words: &[&str]) {
    let refused = open(address, more).err().unwrap_or_default();
    assert!(words.iter().all(|words| refused.contains(words)), "{words:?}: {refused}");
    assert_eq!(refused.lines().count(), 1, "{refused}");
}

/// By these numbers it is looked for on the bus, and its driver and its permission with it.
#[test]
fn the_bus_is_searched_for_the_numbers_that_the_plugin_opens() {
    let plugin = Plugin::in_process(&flotor_falcon::FLOTOR_ENTRY).expect("it is a plugin");
    let [kind] = plugin.usb_kinds() else { panic!("{:?}", plugin.usb_kinds()) };
    let numbers = (kind.vendor(), kind.product(), kind.access());
    assert_eq!(numbers, (0x0403, Some(0xcb48), Some(UsbAccess::Raw)));
}

#[test]
fn where_nothing_answers_the_address_and_what_to_start_are_named() {
    refused_with(
        "tcp:127.0.0.1:1",
        &[],
        &["127.0.0.1:1", "refused", "start one with `flotor emulate falcon`"],
    );
}

#[test]
fn firmware_that_is_missing_is_told_with_where_it_may_be() {
    let (device, address) = serve(Power::Off, CENTRE_M);
    let words = [
        "the Falcon sends no reports, probably because it has no firmware after power-off",
        "give your own firmware file with `firmware`",
        "`nvent`",
    ];
    refused_with(&address, &[], &words);
    assert_eq!(device.machine().command().motors, [0; 3]);
}

#[test]
fn a_boot_loader_that_does_not_answer_is_told() {
    let (device, address) = serve(Power::Off, CENTRE_M);
    device.machine().breaks(Some(Fault::NoPrompt));
    let path = std::env::temp_dir().join(format!("flotor-unanswered-{}", std::process::id()));
    std::fs::write(&path, [7; 300]).expect("a folder for such files");
    let (name, digest) = (path.display().to_string(), flotor_falcon::firmware::digest(&[7; 300]));
    let with_file = [("firmware", name.as_str()), ("firmware_sha256", digest.as_str())];
    refused_with(&address, &with_file, &["the boot loader answered none of", "switch the Falcon off and on"]);
    std::fs::remove_file(&path).expect("it is ours");
}

#[test]
fn a_device_that_answers_and_is_not_homed_is_told_to_whoever_does_not_wait() {
    let (device, address) = serve(Power::On, CENTRE_M);
    device.machine().breaks(Some(Fault::Unhomed(0)));
    refused_with(&address, &[("homing_s", "0")], &["has not found its home position", PUSH_AND_PULL]);
    // Who waits opens it, and hears of it when the hand has done nothing for so long.
    let opened = open(&address, &[("homing_s", "0.1"), ("timeout_ms", "500")]).expect("it runs");
    let refused = opened.activate(&CONFIG).err().map(|(_, refusal)| refusal.to_string()).unwrap_or_default();
    assert!(refused.contains(PUSH_AND_PULL), "{refused}");
}

#[test]
fn a_device_that_is_well_is_opened_without_force_and_says_what_it_drives() {
    let (device, address) = serve(Power::On, CENTRE_M);
    for homing_s in ["30", "0"] {
        let mut opened = open(&address, &[("homing_s", homing_s)]).expect("nothing is wrong");
        let told = opened.capabilities().expect("they are legal");
        assert_eq!((told.sensed, told.actuated), (Axes::TRANSLATION, Axes::TRANSLATION));
        assert_eq!(device.machine().command().motors, [0; 3]);
    }
}
