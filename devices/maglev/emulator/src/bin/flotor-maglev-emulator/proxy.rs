//! Any device of Flotor for programs written for the Maglev 200: a scene with the device and the controller as its model,
//! run by the host with the safety layers of every run.

use super::plant::SIMULATED;
use super::{Arguments, ProtocolOption, key_value, plant};
use flotor_emulation::port::Reach;
use flotor_hal::{Axes, Capabilities, Refusal};
use flotor_loader::Setting;
use flotor_maglev::ml_api::PORT;
use rustix::fs::{MemfdFlags, memfd_create};
use std::error::Error;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::os::fd::AsRawFd;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// Settings for the flotor of a Maglev 200, with the weight compensated only by the controller, in a hand resting at home:
/// a moving hand would disturb the controller's search for the gravity.
const RESTING: &[(&str, &str)] =
    &[("flotor", "utah"), ("feedforward_n", "0"), ("hand", "hold"), ("hand_depth_mm", "0")];

/// Replaces this process by `flotor run`; returns only on failure.
pub(crate) fn become_host(device: &str, arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if arguments.protocol != ProtocolOption::MlApi {
        return Err(Refusal::parameter("--device serves the ML API only; add --protocol ml-api").into());
    }
    let scene = anonymous_file(&scene(device, arguments)?)?;
    // The descriptor stays open across `exec`: only this process can use its path.
    let file = format!("/dev/fd/{}", scene.as_raw_fd());
    let host = std::env::current_exe()?.with_file_name(format!("flotor{}", std::env::consts::EXE_SUFFIX));
    let record = &arguments.ml_api.record;
    let error = Command::new(&host).arg("run").arg(&file).arg("--record").arg(record).exec();
    Err(format!(
        "cannot start the host {}: {error}; build this program and the host with `cargo build --release`",
        host.display()
    )
    .into())
}

/// Writes a text to an unnamed file: no other process can replace the file, and it is freed with its last descriptor.
fn anonymous_file(text: &str) -> std::io::Result<File> {
    let mut file = File::from(memfd_create("flotor-scene", MemfdFlags::empty())?);
    file.write_all(text.as_bytes())?;
    Ok(file)
}

fn scene(device: &str, arguments: &Arguments) -> Result<String, Box<dyn Error>> {
    // About a year: the run ends on Ctrl-C.
    let mut scene = format!("duration_s = 3.0e7\n[device]\nplugin = {device:?}\n[device.parameters]\n");
    let mut sets = arguments.sets.iter().map(|text| key_value(text)).collect::<Result<Vec<_>, _>>()?;
    sets.splice(0..0, resting(device, &sets));
    for (key, value) in &sets {
        writeln!(scene, "{key} = {}", toml_value(value))?;
    }
    scene.push_str("[limits]\n");
    if let Some(felt) = capabilities(device, &sets).as_ref().and_then(felt) {
        writeln!(scene, "force_n = {felt:?}")?;
    }
    if arguments.ml_api.accept_shared_control_group {
        scene.push_str("accept_shared_control_group = true\n");
    }
    if let Some(most_ms) = arguments.ml_api.host_watchdog_ms {
        writeln!(scene, "watchdog_ms = {most_ms:?}")?;
    }
    let listen = arguments.listen.clone().unwrap_or_else(|| format!("127.0.0.1:{PORT}"));
    let parameters = arguments.ml_api.model_parameters();
    let reach = match arguments.reach.reach() {
        Reach::ThisUser => "this-user",
        Reach::ThisMachine => "this-machine",
        Reach::AnyMachine => "any-machine",
    };
    write!(
        scene,
        "[[model]]\nplugin = \"ml-api\"\n[model.parameters]\nlisten = {listen:?}\nreach = \"{reach}\"\n{parameters}"
    )?;
    Ok(scene)
}

/// Returns a value in TOML: a finite number as a number, any other value as a string. The host refuses `nan` for a number with its
/// key and range; as a number of Rust, `NaN`, it is not TOML.
fn toml_value(value: &str) -> String {
    match value.parse::<f64>() {
        Ok(number) if number.is_finite() => format!("{number:?}"),
        _ => format!("{value:?}"),
    }
}

/// Returns default settings of the simulated flotor for keys not given; none if the command line configures a hand.
fn resting(device: &str, sets: &[(&str, &str)]) -> Vec<(&'static str, &'static str)> {
    if device != SIMULATED || sets.iter().any(|(key, _)| key.starts_with("hand")) {
        return Vec::new();
    }
    let is_free = |(key, _): &&(&str, &str)| sets.iter().all(|(set, _)| set != key);
    RESTING.iter().filter(is_free).copied().collect()
}

/// Returns the capabilities of a device; `None` if it cannot be opened: the host reports the error.
fn capabilities(device: &str, sets: &[(&str, &str)]) -> Option<Capabilities> {
    let plugin = plant::load_device(device).ok()?;
    let settings = sets.iter().map(|(key, value)| Setting::parse(plugin.parameters(), key, value));
    let settings: Vec<Setting> = settings.collect::<Result<_, _>>().ok()?;
    plugin.open_device(&settings).ok()?.capabilities().ok()
}

/// Returns the force limits of a device without actuators on all three axes, N; else `None`. The host requires an explicit limit
/// of 0 on the axes without actuators, as the controller model commands all six axes.
fn felt(device: &Capabilities) -> Option<[f64; 3]> {
    let is_driven = [Axes::X, Axes::Y, Axes::Z].map(|axis| device.actuated.contains(axis));
    let felt_n = std::array::from_fn(|axis| if is_driven[axis] { device.max_force_n[axis] } else { 0.0 });
    (is_driven != [true; 3]).then_some(felt_n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_that_is_no_finite_number_is_a_string() {
        assert_eq!(["2.5", "hold", "nan"].map(toml_value), ["2.5", "\"hold\"", "\"nan\""]);
    }
}
