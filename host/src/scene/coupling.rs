//! `[[coupling]]`: what holds two devices together.

use super::devices::{self, DeviceUse};
use super::reader::{SceneError, Section};
use super::{Limits, frame_and_scales, passivity};
use crate::coupling::{CouplingConfig, CouplingDescription, CouplingEnd, MOST_DELAY_TICKS, PassivityMode};
use crate::mapping::MappingConfig;

/// Every coupling, in the order written.
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
    let wrong = |problem: &str| SceneError { location: here.clone(), problem: problem.to_owned() };
    let default = CouplingConfig::default();
    let name = section.take("name").map(devices::name).transpose()?;
    let mut gain = |key, most, default| section.number(key, 0.0..=most).map(|value| value.unwrap_or(default));
    let config = CouplingConfig {
        stiffness_n_per_m: gain("stiffness_n_per_m", 1.0e5, default.stiffness_n_per_m)?,
        damping_ns_per_m: gain("damping_ns_per_m", 1.0e3, default.damping_ns_per_m)?,
        stiffness_nm_per_rad: gain("stiffness_nm_per_rad", 1.0e3, default.stiffness_nm_per_rad)?,
        damping_nms_per_rad: gain("damping_nms_per_rad", 10.0, default.damping_nms_per_rad)?,
        reserve_j: gain("reserve_mj", 1.0e6, default.reserve_j * 1.0e3)? * 1.0e-3,
        delay_ticks: match section.take("delay_ticks") {
            Some(value) => value.whole(1..=MOST_DELAY_TICKS)?,
            None => default.delay_ticks,
        },
        passivity: section.take("passivity").map(passivity).transpose()?.unwrap_or(default.passivity),
    };
    let ends = section.sections("end")?;
    section.finish()?;
    let ends = ends.into_iter().map(|section| end(section, devices)).collect::<Result<Vec<_>, _>>()?;
    let Ok(ends) = <[CouplingEnd; 2]>::try_from(ends) else {
        return Err(wrong("a coupling has two ends: `[[coupling.end]]` twice, each with its `device`"));
    };
    let [first, second] = ends;
    if first.device == second.device {
        return Err(wrong("a coupling holds two devices together, not one with itself"));
    }
    if limits.passivity == PassivityMode::Control {
        return Err(wrong(
            "`limits.passivity = \"control\"` keeps back what comes from the other device; leave it out: a coupling \
             has an energy controller of its own",
        ));
    }
    let named = |end: CouplingEnd| devices.get(usize::from(end.device)).map_or("", |device| &device.name);
    let name = name.unwrap_or_else(|| format!("{}-{}", named(first), named(second)));
    Ok(CouplingDescription { name, config, ends })
}

fn end(mut section: Section<'_>, devices: &[DeviceUse]) -> Result<CouplingEnd, SceneError> {
    let device = devices::number(devices, section.require("device")?)?;
    let mapping = match section.section("mapping")? {
        // No torque scale: energy must come out in the measure in which it went in.
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
