//! Check that a scene fits its devices, before anything is energised: mismatches and warnings.

use super::error::RunError;
use super::prepare::Opened;
use crate::scene::{Pacing, Scene};
use flotor_core::limits::Boundary;
use flotor_hal::{Axes, Capabilities};

/// Checks that a scene fits its devices.
///
/// # Errors
/// [`RunError::Mismatch`] with all mismatches of the first device that has any.
pub(super) fn check_fit(scene: &Scene, opened: &[Opened]) -> Result<(), RunError> {
    for (number, (device, opened)) in (0..).zip(scene.devices.iter().zip(opened)) {
        let mut mismatches = pair(scene, number, &opened.capabilities, opened.device.can_pace());
        mismatches.extend(opened.stop.missing().filter(|_| scene.limits.require_independent_stop));
        if !mismatches.is_empty() {
            let name = if scene.devices.len() > 1 { &device.name } else { &device.plugin.plugin };
            return Err(RunError::Mismatch { device: name.clone(), mismatches });
        }
    }
    Ok(())
}

/// Returns the warnings about a scene on its devices.
pub(super) fn warnings(scene: &Scene, opened: &[Opened]) -> Vec<String> {
    let devices = (0..).zip(opened);
    let torqueless =
        devices.filter_map(|(number, opened)| without_torque(scene, number, &opened.capabilities));
    torqueless.chain(amplifications(scene)).collect()
}

/// Returns a warning if models may request torque from a device that exerts none, unless the scene limits the torque to zero. It is
/// no mismatch: a model declares that it can compute torque, not that it will.
fn without_torque(scene: &Scene, number: u16, device: &Capabilities) -> Option<String> {
    let is_driven = device.actuated != Axes::NONE && !device.actuated.contains(Axes::ROTATION);
    let is_felt = scene.models.iter().any(|model| model.devices().contains(&number.into()));
    let is_wanted = scene.limits.torque_nm.axes().iter().any(|most_nm| *most_nm > 0.0);
    (is_driven && is_felt && is_wanted).then(|| {
        let name = scene.devices.get(usize::from(number)).map_or("", |device| device.name.as_str());
        format!(
            "`{name}` exerts no torque, so the hand cannot feel the torque of a model; `[limits] torque_nm = [0, 0, \
             0]` accepts this"
        )
    })
}

/// Returns a warning for each coupling that amplifies energy, which the scene allows.
fn amplifications(scene: &Scene) -> impl Iterator<Item = String> + '_ {
    let gains = scene.couplings.iter().map(|coupling| (&coupling.name, coupling.ends.energy_gain()));
    gains.filter(|(_, gain)| *gain > 1.0).map(|(name, gain)| {
        format!(
            "the coupling `{name}` amplifies: one hand may get {gain:.4} times the energy that the other puts in \
             (`allow_amplification`)"
        )
    })
}

/// Returns all mismatches of a scene with its device `number`.
fn pair(scene: &Scene, number: u16, device: &Capabilities, can_pace: bool) -> Vec<String> {
    let mut mismatches = Vec::new();
    let [slowest, fastest] = device.rate_hz;
    if scene.rate_hz < slowest || scene.rate_hz > fastest {
        mismatches.push(format!(
            "rate {} Hz, but the device runs at {slowest} to {fastest} Hz; change `rate_hz` (or `--rate`)",
            scene.rate_hz
        ));
    }
    // Only the first device can pace the loop.
    if scene.pacing == Pacing::Device && number == 0 && !can_pace {
        mismatches.push(
            "the device cannot set the pace of the loop; remove `pacing`, or set `pacing = \"host\"`"
                .to_owned(),
        );
    }
    mismatches.extend(boundless(&scene.boundary, device));
    let is_felt = scene.models.iter().any(|model| model.devices().contains(&number.into()))
        || scene.couplings.iter().any(|coupling| coupling.ends.here().iter().any(|end| end.device == number));
    if is_felt {
        mismatches.extend(unfelt(&scene.limits.force_n.axes(), device));
    }
    mismatches
}

/// Returns an error text if the margin of the boundary leaves no workspace without wall force; `None` otherwise.
fn boundless(boundary: &Boundary, device: &Capabilities) -> Option<String> {
    let narrowest = |range: [f64; 3]| {
        let moving = range.into_iter().filter(|half_side| *half_side > 0.0);
        moving.fold(f64::INFINITY, f64::min)
    };
    let (range_m, range_rad) = (narrowest(device.range_m), narrowest(device.range_rad));
    let says = |key, margin: f64, range: f64, unit| {
        format!(
            "`{key} = {margin:.3}` leaves no free workspace, because the device moves {range:.3} {unit} around home; reduce `{key}`"
        )
    };
    if boundary.margin_m >= range_m {
        return Some(says("margin_mm", boundary.margin_m * 1.0e3, range_m * 1.0e3, "mm"));
    }
    let (margin_deg, range_deg) = (boundary.margin_rad.to_degrees(), range_rad.to_degrees());
    (margin_deg >= range_deg).then(|| says("margin_deg", margin_deg, range_deg, "degrees"))
}

/// Returns an error text if models may request a force along an axis that the device does not drive, unless the scene limits the
/// force along this axis to zero.
fn unfelt(wanted_n: &[f64; 3], device: &Capabilities) -> Option<String> {
    let axes = [(Axes::X, "x"), (Axes::Y, "y"), (Axes::Z, "z")];
    let is_driven = axes.map(|(axis, _)| device.actuated.contains(axis));
    let is_unfelt =
        |index: usize| !is_driven[index] && wanted_n.get(index).is_some_and(|most_n| *most_n > 0.0);
    let unfelt: Vec<&str> = (0..3).filter(|index| is_unfelt(*index)).map(|index| axes[index].1).collect();
    if unfelt.is_empty() {
        return None;
    }
    let accepted_n =
        |index: usize| if is_driven[index] { device.max_force_n[index].min(wanted_n[index]) } else { 0.0 };
    let accepted = [0, 1, 2].map(|index| accepted_n(index).to_string()).join(", ");
    Some(if is_driven == [false; 3] {
        format!(
            "the device exerts no force, so the hand cannot feel a model; set `[limits] force_n = [{accepted}]` to \
             accept this: the host then computes, shows and records the models. A scene without a `[[model]]` \
             records poses"
        )
    } else {
        format!(
            "the device exerts no force along {}, so the hand cannot feel this component of a model's force; set \
             `[limits] force_n = [{accepted}]` to accept this",
            unfelt.join(" and ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEVICE: Capabilities = Capabilities {
        sensed: Axes::ALL,
        actuated: Axes::ALL,
        range_m: [0.01, 0.01, 0.0],
        range_rad: [0.1; 3],
        resolution_m: 0.0,
        max_force_n: [3.0; 3],
        max_torque_nm: [0.0; 3],
        max_force_slew_n_per_s: f64::INFINITY,
        max_torque_slew_nm_per_s: f64::INFINITY,
        max_stiffness_n_per_m: 0.0,
        rate_hz: [100.0, 10_000.0],
        latency_s: 0.0,
    };

    fn mismatch(wanted_n: [f64; 3], actuated: Axes, max_force_n: [f64; 3]) -> Option<String> {
        unfelt(&wanted_n, &Capabilities { actuated, max_force_n, ..DEVICE })
    }

    #[test]
    fn a_boundary_that_leaves_no_room_is_refused() {
        let said = |boundary: Boundary| boundless(&boundary, &DEVICE);
        assert_eq!(said(Boundary::default()), None); // an axis that does not move needs no room
        let wide = said(Boundary { margin_m: 0.01, ..Boundary::default() }).expect("10 of 10 mm");
        assert!(wide.contains("`margin_mm = 10.000`"), "{wide}");
        let turned = said(Boundary { margin_rad: 0.2, ..Boundary::default() }).expect("0.2 of 0.1 rad");
        assert!(turned.contains("`margin_deg = 11.459`"), "{turned}");
    }

    #[test]
    fn a_device_without_force_says_what_works_and_takes_its_word() {
        let said = mismatch([f64::INFINITY; 3], Axes::NONE, [0.0; 3]).expect("nothing could be felt");
        assert!(said.contains("exerts no force") && said.contains("force_n = [0, 0, 0]"), "{said}");
        assert_eq!(mismatch([0.0; 3], Axes::NONE, [0.0; 3]), None);
        assert_eq!(mismatch([f64::INFINITY; 3], Axes::ALL, [3.0; 3]), None);
    }

    #[test]
    fn a_planar_device_says_which_axis_is_missing_and_takes_its_word() {
        let said = mismatch([f64::INFINITY; 3], Axes::PLANE, [3.0, 3.0, 0.0]).expect("z would not be felt");
        assert!(said.contains("along z") && said.contains("force_n = [3, 3, 0]"), "{said}");
        assert_eq!(mismatch([3.0, 3.0, 0.0], Axes::PLANE, [3.0, 3.0, 0.0]), None);
    }
}
