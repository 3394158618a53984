//! `[[coupling]]`: the virtual coupling of two devices.

use super::devices::{self, DeviceUse};
use super::reader::{SceneError, Section, Value};
use super::{Limits, frame_and_scales, passivity};
use flotor_core::coupling::{
    CouplingConfig, CouplingDescription, CouplingEnd, CouplingEnds, MAX_DELAY_TICKS,
};
use flotor_core::limits::PassivityMode;
use flotor_core::mapping::MappingConfig;

/// Reads all couplings, in the order of the file.
pub(super) fn read(
    sections: Vec<Section<'_>>,
    devices: &[DeviceUse],
    limits: &Limits,
) -> Result<Vec<CouplingDescription>, SceneError> {
    sections.into_iter().map(|section| coupling(section, devices, limits)).collect()
}

fn coupling(
    mut section: Section<'_>,
    devices: &[DeviceUse],
    limits: &Limits,
) -> Result<CouplingDescription, SceneError> {
    let here = section.location();
    let wrong = |problem: &str| here.problem(problem);
    let default = CouplingConfig::default();
    let name = section.read("name", devices::name)?;
    let places = [("here", Partner::Here), ("elsewhere", Partner::Elsewhere)];
    let partner = section.read("partner", |value| value.one_of(&places))?.unwrap_or(Partner::Here);
    let mut gain = |key, most, default| section.number_or(key, 0.0..=most, default);
    let config = CouplingConfig {
        stiffness_n_per_m: gain("stiffness_n_per_m", 1.0e5, default.stiffness_n_per_m)?,
        damping_ns_per_m: gain("damping_ns_per_m", 1.0e3, default.damping_ns_per_m)?,
        stiffness_nm_per_rad: gain("stiffness_nm_per_rad", 1.0e3, default.stiffness_nm_per_rad)?,
        damping_nms_per_rad: gain("damping_nms_per_rad", 10.0, default.damping_nms_per_rad)?,
        reserve_j: gain("reserve_mj", 1.0e6, default.reserve_j * 1.0e3)? * 1.0e-3,
        delay_ticks: match (section.take("delay_ticks"), partner) {
            (Some(value), Partner::Here) => value.whole(1..=MAX_DELAY_TICKS)?,
            (Some(_), Partner::Elsewhere) => {
                return Err(wrong("the network determines the delay to another host; remove `delay_ticks`"));
            }
            (None, _) => default.delay_ticks,
        },
        passivity: section.read("passivity", passivity)?.unwrap_or(default.passivity),
    };
    let may_amplify = section.read("allow_amplification", Value::truth)?.unwrap_or(false);
    let ends = section.sections("end")?;
    section.finish()?;
    let ends = ends.into_iter().map(|section| end(section, devices)).collect::<Result<Vec<_>, _>>()?;
    let ends = match (partner, ends.as_slice()) {
        (Partner::Here, [first, second]) if first.device == second.device => {
            return Err(wrong(
                "both ends of the coupling are on the same device; name a different `device` in each \
                 `[[coupling.end]]`",
            ));
        }
        (Partner::Here, [first, second]) => CouplingEnds::Here([*first, *second]),
        (Partner::Elsewhere, [here]) => CouplingEnds::Remote(*here),
        (Partner::Here, _) => {
            return Err(wrong(
                "a coupling has exactly two ends; write `[[coupling.end]]` twice, each with its `device`, \
                 or, for an end on another host, once with `partner = \"elsewhere\"`",
            ));
        }
        (Partner::Elsewhere, _) => {
            return Err(wrong(
                "a coupling with `partner = \"elsewhere\"` has exactly one end on this host; write \
                 `[[coupling.end]]` exactly once",
            ));
        }
    };
    let gain = ends.energy_gain();
    if gain > 1.0 && !may_amplify {
        return Err(wrong(&format!(
            "the coupling amplifies: one hand may get {gain:.4} times the energy that the other puts in, because \
             `force_scale` / `motion_scale` differ between its ends (1 at an end on another host); make these quotients \
             equal, or write `allow_amplification = true` if the amplified force is safe for the hand"
        )));
    }
    if gain <= 1.0 && may_amplify {
        return Err(wrong(
            "`allow_amplification = true` has no effect, because this coupling does not amplify; remove the key",
        ));
    }
    if limits.passivity == PassivityMode::Control {
        return Err(wrong(
            "`limits.passivity = \"control\"` would remove the energy that comes from the other device; remove the \
             key: a coupling has an energy controller of its own",
        ));
    }
    let named = |end: CouplingEnd| devices.get(usize::from(end.device)).map_or("", |device| &device.name);
    let name = match (name, ends) {
        (Some(name), CouplingEnds::Here(_)) => name,
        (None, CouplingEnds::Here([first, second])) => format!("{}-{}", named(first), named(second)),
        (Some(name), CouplingEnds::Remote(_)) if is_key(&name) => name,
        (_, CouplingEnds::Remote(_)) => {
            return Err(wrong(
                "`name` is missing or invalid; it identifies the coupling on both hosts: write at most 40 \
                 lower-case letters, digits and hyphens",
            ));
        }
    };
    Ok(CouplingDescription { name, config, ends })
}

/// Location of the other end of a coupling.
#[derive(Clone, Copy)]
enum Partner {
    /// In this scene.
    Here,
    /// In a scene on another host.
    Elsewhere,
}

/// Returns true if a name can be part of a key on the network: 1 to 40 lower-case letters, digits and hyphens.
fn is_key(name: &str) -> bool {
    let legal = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    (1..=40).contains(&name.len()) && name.chars().all(legal)
}

fn end(mut section: Section<'_>, devices: &[DeviceUse]) -> Result<CouplingEnd, SceneError> {
    let device = devices::number(devices, section.require("device")?)?;
    let mapping = match section.section("mapping")? {
        // No torque scale: both ends must measure the same energy.
        Some(mut mapping) => {
            let config = frame_and_scales(&mut mapping)?;
            mapping.finish()?;
            config
        }
        None => MappingConfig::default(),
    };
    section.finish()?;
    Ok(CouplingEnd { device, mapping })
}
