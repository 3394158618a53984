//! Parameters of the simulated flotor, and their conversion to a [`Setup`].

pub(crate) mod live;
mod machine;
mod schema;

use machine::has_machine;
pub(crate) use machine::machine;
pub(crate) use schema::SCHEMA;

use crate::fingers::FingerParameters;
use crate::hand::{Grip, Hand, Impedance, Pose, Recording, Script, Trajectory, Unsteadiness};
use crate::plant::{FeedForward, FlotorParameters, State};
use crate::simulation::Setup;
use crate::units::{MM, PERCENT, UM, nanoseconds};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Refusal, Settings};
use std::path::Path;

/// Prefixes of the documentation of parameters used only by preset `full`, and only with a grip.
const OF_FULL: &str = "Full:";
const OF_FINGERS: &str = "Fingers:";

/// Rejects parameters without an effect: those of preset `full` under preset `plain`, and those of fingers without a grip.
///
/// # Errors
/// If such a parameter is set; the error contains its name and the parameter that makes it effective.
pub(crate) fn refuse_idle(settings: &Settings<'_>) -> Result<(), Refusal> {
    let groups = [
        (
            OF_FULL,
            has_machine(settings),
            "has no effect in preset `plain`, which omits coils, sensors and faults; set `preset` to `full` as well",
        ),
        (
            OF_FINGERS,
            FingerParameters::of(settings).is_some(),
            "has no effect without a grip; set `fingers` to `on` as well",
        ),
    ];
    for (prefix, _, why) in groups.iter().filter(|(_, is_used, _)| !is_used) {
        let is_idle =
            |id: &str| SCHEMA.iter().any(|known| known.id() == id && known.doc().starts_with(prefix));
        if let Some(id) = settings.ids().find(|id| is_idle(id)) {
            return Err(Refusal::parameter(format!("`{id}` {why}")));
        }
    }
    Ok(())
}

/// Converts a set of values to a setup; tick length and seed are set at activation. Not real-time.
///
/// # Errors
/// If a script or recording of the hand is unreadable or invalid.
pub(crate) fn setup(settings: &Settings<'_>) -> Result<Setup, Refusal> {
    let flotor = flotor(settings);
    let trajectory = trajectory(settings)?;
    let impedance = impedance(settings, &trajectory);
    let unsteadiness = Unsteadiness {
        tremor_m: settings.number_or_default("hand_tremor_um") * UM,
        force_share: settings.number_or_default("hand_force_noise_percent") * PERCENT,
    };
    let start = State {
        position_m: three(settings, ["start_x_mm", "start_y_mm", "start_z_mm"], DVec3::ZERO, MM),
        ..State::HOME
    };
    Ok(Setup { flotor, hand: Hand { impedance, trajectory, unsteadiness }, start, ..Setup::DEMO })
}

fn flotor(settings: &Settings<'_>) -> FlotorParameters {
    let base = settings.one_of("flotor", [FlotorParameters::THESIS, FlotorParameters::UTAH]);
    let mut flotor = FlotorParameters {
        mass_kg: settings.number("mass_kg").unwrap_or(base.mass_kg),
        inertia_kg_m2: three(
            settings,
            ["inertia_x_kg_m2", "inertia_y_kg_m2", "inertia_z_kg_m2"],
            base.inertia_kg_m2,
            1.0,
        ),
        centre_of_mass_m: three(settings, ["com_x_mm", "com_y_mm", "com_z_mm"], base.centre_of_mass_m, MM),
        gravity_m_per_s2: settings.number("gravity_m_per_s2").unwrap_or(base.gravity_m_per_s2),
        feed_forward: settings.number("feedforward_n").map_or(FeedForward::Weight, FeedForward::Force),
        ..base
    };
    if let Some(drag) = settings.number("damping_ns_per_m") {
        flotor.drag.translational_ns_per_m = drag;
    }
    if let Some(drag) = settings.number("damping_nms_per_rad") {
        flotor.drag.rotational_nms_per_rad = drag;
    }
    flotor
}

/// Returns the impedance of the hand: the configured grip, else the grip of the script, else the firm grip; stiffness,
/// damping and mass override those of the grip if set.
fn impedance(settings: &Settings<'_>, trajectory: &Trajectory) -> Impedance {
    let of_script = match trajectory {
        Trajectory::Scripted(script) => script.grip(),
        _ => None,
    };
    let of_settings =
        settings.number("hand_grip").map(|_| settings.one_of("hand_grip", [Grip::Firm, Grip::Relaxed]));
    let grip = of_settings.or(of_script).unwrap_or(Grip::Firm).impedance();
    let splat = |id, value: DVec3| settings.number(id).map_or(value, DVec3::splat);
    Impedance {
        stiffness_n_per_m: splat("hand_stiffness_n_per_m", grip.stiffness_n_per_m),
        damping_ns_per_m: splat("hand_damping_ns_per_m", grip.damping_ns_per_m),
        mass_kg: settings.number("hand_mass_kg").unwrap_or(grip.mass_kg),
        ..grip
    }
}

fn trajectory(settings: &Settings<'_>) -> Result<Trajectory, Refusal> {
    match (settings.text("hand_script"), settings.text("hand_recording")) {
        (Some(_), Some(_)) => Err(Refusal::parameter(
            "`hand_script` and `hand_recording` are both set, but the hand follows only one; omit one",
        )),
        (Some(script), None) => Script::load(script).map(Trajectory::Scripted).map_err(Refusal::parameter),
        (None, Some(file)) => {
            Recording::load(Path::new(file)).map(Trajectory::Recorded).map_err(Refusal::parameter)
        }
        (None, None) => Ok(simple_trajectory(settings)),
    }
}

/// Returns the trajectory selected by the parameter `hand`.
fn simple_trajectory(settings: &Settings<'_>) -> Trajectory {
    let value = |id| settings.number_or_default(id);
    let depth_m = value("hand_depth_mm") * MM;
    let below = Pose { position_m: DVec3::new(0.0, 0.0, -depth_m), orientation: DQuat::IDENTITY };
    match settings.choice_or_default("hand") {
        1 => Trajectory::Press { depth_m, start_s: 0.0, rise_s: value("hand_rise_s") },
        2 => Trajectory::Release { from: below, at_ns: nanoseconds(value("hand_release_s")) },
        3 => Trajectory::Hold(below),
        4 => Trajectory::Open,
        _ => Trajectory::Oscillate {
            centre_m: value("hand_centre_mm") * MM,
            amplitude_m: value("hand_amplitude_mm") * MM,
            frequency_hz: value("hand_frequency_hz"),
            onset_s: value("hand_rise_s"),
        },
    }
}

/// Returns a vector of three parameters; an unset one falls back to a component of `base` (already in SI).
fn three(settings: &Settings<'_>, ids: [&str; 3], base: DVec3, scale: f64) -> DVec3 {
    let [x, y, z] = ids.map(|id| settings.number(id).map(|value| value * scale));
    DVec3::new(x.unwrap_or(base.x), y.unwrap_or(base.y), z.unwrap_or(base.z))
}

/// Returns the effective value of the parameter at `index` of the schema, in the units of the schema; NaN for an index
/// out of range.
pub(crate) fn in_force(setup: &Setup, settings: &[f64], index: usize) -> f64 {
    let Some(parameter) = SCHEMA.get(index) else { return f64::NAN };
    let FlotorParameters { mass_kg, inertia_kg_m2, centre_of_mass_m, gravity_m_per_s2, drag, .. } =
        setup.flotor;
    let hand = setup.hand.impedance;
    match parameter.id() {
        "mass_kg" => mass_kg,
        "inertia_x_kg_m2" => inertia_kg_m2.x,
        "inertia_y_kg_m2" => inertia_kg_m2.y,
        "inertia_z_kg_m2" => inertia_kg_m2.z,
        "com_x_mm" => centre_of_mass_m.x / MM,
        "com_y_mm" => centre_of_mass_m.y / MM,
        "com_z_mm" => centre_of_mass_m.z / MM,
        "gravity_m_per_s2" => gravity_m_per_s2,
        "feedforward_n" => setup.flotor.feed_forward_n(),
        "damping_ns_per_m" => drag.translational_ns_per_m,
        "damping_nms_per_rad" => drag.rotational_nms_per_rad,
        "hand_stiffness_n_per_m" => hand.stiffness_n_per_m.z,
        "hand_damping_ns_per_m" => hand.damping_ns_per_m.z,
        "hand_mass_kg" => hand.mass_kg,
        _ => settings.get(index).copied().unwrap_or(f64::NAN),
    }
}
