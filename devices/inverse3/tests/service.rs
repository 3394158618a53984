//! Plugin with a faulty service, called through the device contract as by a host.

use flotor_hal::{Axes, Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick, UsbAccess, Wrench};
use flotor_loader::{ActiveDevice, OpenedDevice, Plugin, Setting};
use stand_in::{ARM, GRIP, OTHER_ARM, Said, StandIn, configured, frame, state};
use std::time::{Duration, Instant};

mod stand_in;

const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };
/// How long anything here may take.
const PATIENCE: Duration = Duration::from_secs(20);
/// Where the cursor is.
const HELD_M: DVec3 = DVec3::new(0.01, -0.02, 0.03);

/// The three components of the newest force that the service was commanded, and whether there was one.
fn commanded_n(service: &StandIn) -> Option<DVec3> {
    service.received().iter().rev().find_map(|message| force_of(message))
}

/// The last message is on its way when a tick hears of the fault; the service reads it in its own time.
fn until_it_pushes_no_more(service: &StandIn) {
    let started = Instant::now();
    while commanded_n(service) != Some(DVec3::ZERO) {
        assert!(started.elapsed() < PATIENCE, "{:?}", commanded_n(service));
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn force_of(message: &str) -> Option<DVec3> {
    let vector = message.split_once("\"vector\":{")?.1;
    let part = |name: &str| {
        let rest = vector.split_once(&format!("\"{name}\":"))?.1;
        rest.split([',', '}']).next()?.parse().ok()
    };
    Some(DVec3::new(part("x")?, part("y")?, part("z")?))
}

/// A service that keeps its promises until the message of this number, and says something else then.
fn until(fatal: usize, last: Said) -> StandIn {
    StandIn::start(move |number, message| match number {
        0 => Said::Text(state(HELD_M, DVec3::ZERO)),
        1 => Said::Text(configured(0.0)),
        _ if number == fatal => last.clone(),
        _ => Said::Text(state(HELD_M, force_of(message).unwrap_or(DVec3::ZERO))),
    })
    .expect("there is a port")
}

fn open(service: &StandIn, more: &[(&str, &str)]) -> Result<OpenedDevice, String> {
    let plugin = Plugin::in_process(&flotor_inverse3::FLOTOR_ENTRY).expect("it is a plugin");
    let mut settings = vec![("address", &*service.address), ("device", ARM), ("timeout_ms", "9000")];
    settings.retain(|(key, _)| more.iter().all(|(other, _)| other != key));
    let settings = settings.iter().chain(more).filter(|(_, value)| !value.is_empty());
    let settings: Vec<Setting> = settings
        .map(|(key, value)| Setting::parse(plugin.parameters(), key, value).expect("it is legal"))
        .collect();
    plugin.open_device(&settings).map_err(|error| error.to_string())
}

fn activated(service: &StandIn, more: &[(&str, &str)]) -> ActiveDevice {
    let opened = open(service, more).expect("the service agrees");
    opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("nobody else commands it")
}

/// A loop of one device, from tick to tick.
struct Ticks {
    device: ActiveDevice,
    index: u64,
    state: DeviceState,
}

impl Ticks {
    fn of(device: ActiveDevice) -> Self {
        Self { device, index: 0, state: DeviceState::HOME }
    }

    fn next(&mut self, force_n: DVec3) -> Cycle {
        let tick = Tick { index: self.index, time_ns: self.index * 1_000_000, dt_ns: 1_000_000 };
        self.index += 1;
        let cycle = self.device.read(&tick, &mut self.state);
        assert!(!matches!(self.device.write(&tick, &Wrench::from_force(force_n)), Cycle::Fault(_)));
        cycle
    }

    /// Ticks until one is as it should be.
    fn until(&mut self, force_n: DVec3, mut is_there: impl FnMut(Cycle, &DeviceState) -> bool) {
        let started = Instant::now();
        loop {
            let cycle = self.next(force_n);
            if is_there(cycle, &self.state) {
                return;
            }
            assert!(started.elapsed() < PATIENCE, "{cycle:?} {:?}", self.state);
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

#[test]
fn a_force_goes_to_the_service_and_what_it_says_comes_back() {
    let service = until(usize::MAX, Said::Nothing);
    let mut ticks = Ticks::of(activated(&service, &[]));
    let force_n = DVec3::new(0.25, -1.0, 0.125);
    ticks.until(force_n, |cycle, state| cycle == Cycle::Fresh && state.delivered.force() == force_n);
    assert_eq!((ticks.state.pose.position(), ticks.state.buttons), (HELD_M, 0b101));
    assert!((ticks.state.pose.orientation() * DVec3::X - DVec3::Y).length() < 1.0e-15);
    // More than its limit, and what is no number, in the middle of a run.
    ticks.until(DVec3::Z * 1.0e9, |_, state| state.delivered.force() == DVec3::Z * 5.0);
    ticks.until(DVec3::new(f64::NAN, 0.0, 0.0), |_, state| state.delivered.force() == DVec3::ZERO);
    ticks.until(force_n, |_, state| state.delivered.force() == force_n);
    let opened = ticks.device.deactivate().expect("it is opened again");
    until_it_pushes_no_more(&service);
    let mut ticks = Ticks::of(opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("once more"));
    ticks.until(force_n, |_, state| state.delivered.force() == force_n);
    assert_eq!(service.ended(), 0, "it is the same session");
    let configured = &service.received()[0];
    for part in [
        "\"gain\":0}",
        "\"scalar\":0}",
        "arm_front_centered",
        "\"XYZ\"",
        "\"name\":\"flotor\"",
        "set_transform",
    ] {
        assert!(configured.contains(part), "{part}: {configured}");
    }
}

/// Each fault is reported as its own kind, and the last message to the service commands zero force.
#[test]
fn whatever_the_service_breaks_ends_with_its_own_fault_and_no_force() {
    let good = state(HELD_M, DVec3::ZERO);
    let long = "\"".to_owned() + &" ".repeat(10_000_000) + "\"";
    let cases = [
        ("closed", Said::Close, Fault::Disconnected),
        ("silent", Said::Nothing, Fault::Timeout),
        ("a partial frame", Said::Raw(frame(&good)[..300].to_vec()), Fault::Timeout),
        ("a frame of 10 MB", Said::Raw(frame(&long)), Fault::Protocol),
        ("no frame", Said::Raw(vec![0xFF; 64]), Fault::Protocol),
        ("NaN", Said::Text(good.replace("\"z\":0.03", "\"z\":NaN")), Fault::Protocol),
        ("an infinite number", Said::Text(good.replace("\"z\":0.03", "\"z\":1e999")), Fault::Protocol),
        ("a missing field", Said::Text(good.replace("cursor_velocity", "cursor_speed")), Fault::Protocol),
        ("half a state", Said::Text(good[..good.len() / 2].to_owned()), Fault::Protocol),
        ("another device", Said::Text(good.replace(ARM, "FFFF")), Fault::Disconnected),
        ("no grip", Said::Text(good.replace(GRIP, "FFFF")), Fault::Disconnected),
        (
            "no power",
            Said::Text(good.replace("\"power_supply\":true", "\"power_supply\":false")),
            Fault::Disconnected,
        ),
    ];
    for (what, last, fault) in cases {
        let is_late = fault == Fault::Timeout;
        let service = until(40, last);
        let timeout = if is_late { "300" } else { "9000" };
        let mut ticks = Ticks::of(activated(&service, &[("timeout_ms", timeout)]));
        ticks.until(DVec3::X, |cycle, _| match cycle {
            Cycle::Fault(found) => {
                assert_eq!(found, fault, "{what}");
                true
            }
            _ => false,
        });
        // It stays, and commands change nothing.
        for _ in 0..3 {
            assert_eq!(ticks.next(DVec3::X), Cycle::Fault(fault), "{what}");
        }
        // A session that has ended has no force. One that still listens is told before.
        let listens = what != "closed" && what != "a frame of 10 MB";
        let is_over = || service.ended() == 1 && (commanded_n(&service) == Some(DVec3::ZERO) || !listens);
        let started = Instant::now();
        while !is_over() {
            assert!(started.elapsed() < PATIENCE, "{what}: {:?}", service.received().last());
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// The connection of a service that is gone ends at once: the next tick that comes after that is a fault.
#[test]
fn a_service_that_is_gone_is_a_fault_in_the_next_tick() {
    let service = until(40, Said::Close);
    let mut ticks = Ticks::of(activated(&service, &[]));
    let started = Instant::now();
    while service.ended() == 0 {
        let _ = ticks.next(DVec3::X);
        assert!(started.elapsed() < PATIENCE);
        std::thread::sleep(Duration::from_micros(200));
    }
    // Far more than the thread needs to hear of it.
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!(ticks.next(DVec3::X), Cycle::Fault(Fault::Disconnected));
}

#[test]
fn another_session_that_pushes_too_is_a_fault() {
    let service = StandIn::start(move |number, message| match number {
        0 => Said::Text(state(HELD_M, DVec3::ZERO)),
        1 => Said::Text(configured(0.0)),
        _ => {
            let other_n = if number > 40 { DVec3::Y } else { DVec3::ZERO };
            Said::Text(state(HELD_M, force_of(message).unwrap_or(DVec3::ZERO) + other_n))
        }
    });
    let service = service.expect("there is a port");
    let mut ticks = Ticks::of(activated(&service, &[]));
    ticks.until(DVec3::X, |cycle, _| cycle == Cycle::Fault(Fault::Protocol));
    until_it_pushes_no_more(&service);
    let heard = service.received().len();
    // Three samples after the first push, and the last message takes the force away.
    assert!((43..=45).contains(&heard), "{heard} messages");
}

#[test]
fn a_stop_from_another_thread_takes_the_force_and_the_handle_is_still_seen() {
    let service = until(usize::MAX, Said::Nothing);
    let opened = open(&service, &[]).expect("the service agrees");
    let stopper = opened.stopper();
    let device = opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("nobody commands it");
    let mut ticks = Ticks::of(device);
    ticks.until(DVec3::X, |_, state| state.delivered.force() == DVec3::X);
    std::thread::spawn(move || stopper.safe_stop()).join().expect("it does not panic");
    // Without another tick: the thread says it by itself.
    until_it_pushes_no_more(&service);
    for _ in 0..5 {
        ticks.until(DVec3::X, |cycle, state| cycle == Cycle::Fresh && state.delivered == Wrench::ZERO);
    }
}

#[test]
fn what_cannot_be_opened_is_refused_in_one_sentence_with_what_to_do() {
    let plain = || until(usize::MAX, Said::Nothing);
    for (service, more, words) in [
        (
            plain(),
            vec![("device", "")],
            format!("several devices ({OTHER_ARM}, {ARM}); set `device` to one of their ids"),
        ),
        (
            plain(),
            vec![("grip", "1234")],
            format!(
                "no grip 1234 (its grips: {GRIP}); connect the grip, or set `grip` to one of their ids, or to `none`"
            ),
        ),
        (answering(1, configured(0.3)), vec![], "`config.filters.force_gate.gain` of the device".to_owned()),
    ] {
        refused_with(&service, &more, &[&words]);
    }
}

/// A service that answers as it should, but this from the message of this number on.
fn answering(from: usize, text: String) -> StandIn {
    StandIn::start(move |number, _| match number {
        _ if number >= from => Said::Text(text.clone()),
        1 => Said::Text(configured(0.0)),
        _ => Said::Text(state(HELD_M, DVec3::ZERO)),
    })
    .expect("there is a port")
}

/// That it is refused when it is opened, in one line with all of these words: what `flotor doctor` shows as `opening`.
fn refused_with(service: &StandIn, more: &[(&str, &str)], words: &[&str]) {
    let refused = open(service, more).err().unwrap_or_default();
    assert!(words.iter().all(|words| refused.contains(words)), "{words:?}: {refused}");
    assert_eq!(refused.lines().count(), 1, "{refused}");
}

/// What the service says while another session commands the arm.
fn commanded() -> String {
    state(HELD_M, DVec3::ZERO).replace("\"control_mode\":\"idle\"", "\"control_mode\":\"force\"")
}

const BUSY: &str =
    "another program commands this Inverse3, and the forces of both would add up; end that program first";

#[test]
fn where_no_service_listens_the_address_and_what_to_start_are_named() {
    let service = until(usize::MAX, Said::Nothing);
    refused_with(
        &service,
        &[("address", "127.0.0.1:1")],
        &[
            "127.0.0.1:1",
            "refused",
            "check `address`, and start Haply's service, or `flotor emulate haply-service`",
        ],
    );
}

#[test]
fn a_service_without_a_device_asks_for_cable_and_power() {
    let empty = answering(0, "{\"session_id\":1,\"inverse3\":[],\"verse_grip\":[]}".to_owned());
    refused_with(
        &empty,
        &[("device", "")],
        &["the service has no device; connect a device and switch it on"],
    );
}

#[test]
fn a_service_without_the_wanted_device_lists_those_it_has() {
    let listed = format!("no device 1234; set `device` to the id of one of its devices: {OTHER_ARM}, {ARM}");
    refused_with(&until(usize::MAX, Said::Nothing), &[("device", "1234")], &[&listed]);
}

#[test]
fn messages_of_another_version_are_told_with_the_version_that_is_needed() {
    const UPDATE: &str = "update the service to 3.5 or newer";
    let of_old = |text: &str| answering(1, text.to_owned());
    refused_with(&of_old("nonsense"), &[], &["the service sent a malformed device state", UPDATE]);
    // It knows no presets.
    let told = configured(0.0).replace("\"preset\":\"arm_front_centered\",", "");
    refused_with(
        &of_old(&told),
        &[],
        &["`config.preset` of the device", "is missing, not `arm_front_centered`", UPDATE],
    );
    // Its states have another name for a field.
    let told = state(HELD_M, DVec3::ZERO).replace("cursor_velocity", "velocity");
    refused_with(&answering(2, told), &[], &["the device state has no valid `cursor_velocity`", UPDATE]);
}

#[test]
fn a_device_without_power_is_not_opened() {
    let told = state(HELD_M, DVec3::ZERO).replace("\"power_supply\":true", "\"power_supply\":false");
    refused_with(&answering(2, told), &[], &["no power, or is not calibrated; switch both on"]);
}

#[test]
fn a_device_that_another_session_commands_is_not_opened() {
    refused_with(&answering(2, commanded()), &[], &[BUSY]);
}

#[test]
fn a_device_that_another_session_commands_after_it_was_opened_is_not_activated() {
    let service = answering(3, commanded());
    let opened = open(&service, &[]).expect("the service agrees, and nobody commands it");
    let refused = opened.activate(&CONFIG).err().map(|(_, refusal)| refusal.to_string()).unwrap_or_default();
    assert!(refused.contains(BUSY), "{refused}");
    assert_eq!(commanded_n(&service).unwrap_or(DVec3::ZERO), DVec3::ZERO, "nothing pushed");
}

#[test]
fn a_device_that_is_well_is_opened_without_a_command_and_says_what_it_is() {
    let plugin = Plugin::in_process(&flotor_inverse3::FLOTOR_ENTRY).expect("it is a plugin");
    let kinds: Vec<_> =
        plugin.usb_kinds().iter().map(|kind| (kind.vendor(), kind.product(), kind.access())).collect();
    let serial = Some(UsbAccess::Serial);
    assert_eq!(kinds, [(0x16c0, Some(0x0483), serial), (0x2fe3, Some(0x0100), serial)]);
    let service = until(usize::MAX, Said::Nothing);
    let mut opened = open(&service, &[]).expect("nothing is wrong");
    let told = opened.capabilities().expect("they are legal");
    assert_eq!((told.sensed, told.actuated), (Axes::ALL, Axes::TRANSLATION));
    assert_eq!(commanded_n(&service), None, "{:?}", service.received());
}

#[test]
fn without_a_grip_no_orientation_is_sensed() {
    let service = until(usize::MAX, Said::Nothing);
    let mut opened = open(&service, &[("grip", "none")]).expect("the service agrees");
    let told = opened.capabilities().expect("they are legal");
    assert_eq!((told.sensed, told.actuated), (Axes::TRANSLATION, Axes::TRANSLATION));
    let mut ticks = Ticks::of(opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("it starts"));
    ticks.until(DVec3::X, |_, state| state.delivered.force() == DVec3::X);
    assert_eq!((ticks.state.buttons, ticks.state.pose.orientation().w), (0, 1.0));
}
