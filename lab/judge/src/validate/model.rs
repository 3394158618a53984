//! Rules of a force model: finite numbers, repeatability, time, threads, energy, active region.

use super::outcome::Outcome;
use super::path::{CONFIG, FAST, directions, finite, grid, step, walk, walk_at};
use super::subject::Subject;
use crate::platform::{processor_time, state};
use crate::subject::input_of;
use crate::wording;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    ActiveRegion, DQuat, DVec3, Demand, Input, Memory, Output, Pose, RegionShape, StepStatus, Twist, Wrench,
};
use flotor_loader::Model;
use std::time::Duration;

fn finite_at(model: &mut Model, pose: Pose) -> Result<(), String> {
    finite(model, &Input::at_rest(pose)).map(|_| ())
}

pub(super) fn near_home(model: &mut Model) -> Result<(), String> {
    finite_at(model, Pose::HOME)?;
    for size_m in [1.0e-12, 1.0e-6, 1.0e-3, 5.0e-3] {
        grid(size_m, size_m * 10.0).try_for_each(|pose| finite_at(model, pose))?;
    }
    Ok(())
}

pub(super) fn finite_in_motion(model: &mut Model) -> Result<(), String> {
    for speed in [1.0, FAST] {
        walk_at(speed, 3000).try_for_each(|input| finite(model, &input).map(|_| ()))?;
    }
    Ok(())
}

/// Demand in each tick of a path.
type DemandOfTick = fn(u64) -> Demand;

/// Compares the answers on a path with everything demanded to those with less demanded, and to those with a demand that
/// changes from step to step, as with a viewer that connects and disconnects.
pub(super) fn demand(model: &mut Model) -> Result<(), String> {
    let all = demanded(model, |_| Demand::ALL)?;
    let fewer: [(&str, DemandOfTick); 4] = [
        ("force alone", |_| Demand::FORCE),
        ("force and torque", |_| Demand::WRENCH),
        ("force and energy", |_| Demand::FORCE.with(Demand::ENERGY)),
        ("all outputs in every other step", |tick| if tick % 2 == 0 { Demand::ALL } else { Demand::FORCE }),
    ];
    for (what, of) in fewer {
        let less = demanded(model, of)?;
        let other = (0..).zip(all.iter().zip(&less)).find(|(tick, (all, less))| {
            let (has_torque, [all_of, less_of]) =
                (of(*tick).contains(Demand::TORQUE), [all, less].map(|o| o.wrench));
            is_other(all_of.force_n, less_of.force_n)
                || all.status() != less.status()
                || has_torque && is_other(all_of.torque_nm, less_of.torque_nm)
        });
        if let Some((tick, (all, less))) = other {
            let of_both = |text: fn(&Output) -> String| [all, less].map(text);
            let (part, [with, without]) = if is_other(all.wrench.force_n, less.wrench.force_n) {
                ("force", of_both(|output| format!("{} N", wording::vector(output.wrench.force()))))
            } else if all.status() != less.status() {
                (
                    "status",
                    of_both(|output| format!("`{}`", output.status().map_or("unknown", StepStatus::name))),
                )
            } else {
                ("torque", of_both(|output| format!("{} N·m", wording::vector(output.wrench.torque()))))
            };
            return Err(format!(
                "step {tick} of a path returned the {part} {with} with all outputs requested, and {without} with {what}"
            ));
        }
    }
    Ok(())
}

/// Returns true if a number differs; two NaNs count as equal, because another rule finds them.
fn is_other(first: [f64; 3], second: [f64; 3]) -> bool {
    first.into_iter().zip(second).any(|(a, b)| a != b && !(a.is_nan() && b.is_nan()))
}

/// Returns the answers on a path from the start, with a demand for each step.
fn demanded(model: &mut Model, of: impl Fn(u64) -> Demand) -> Result<Vec<Output>, String> {
    match model.reset() {
        CallStatus::Ok => {}
        other => return Err(format!("reset returned `{}`", other.name())),
    }
    let serves = model.serves();
    walk(500)
        .map(|input| step(model, &Input { demand: of(input.tick).limited_to(serves), ..input }))
        .collect()
}

pub(super) fn not_finite(model: &mut Model) -> Result<(), String> {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in 0..7 {
            let mut pose = Pose::HOME;
            let numbers = pose.position_m.iter_mut().chain(&mut pose.orientation_xyzw);
            numbers.skip(axis).take(1).for_each(|number| *number = bad);
            finite_at(model, pose)?;
        }
    }
    finite_at(model, Pose::HOME) // and the model still works afterwards
}

pub(super) fn far_poses(model: &mut Model) -> Result<(), String> {
    for size_m in [0.03, 1.0, 1.0e9, 1.0e300] {
        grid(size_m, 3.0).try_for_each(|pose| finite_at(model, pose))?;
    }
    Ok(())
}

pub(super) fn reset_repeats(model: &mut Model) -> Result<(), String> {
    // In motion first, with the time of a loop: only there do integrated states show.
    let run = |model: &mut Model| -> Result<Vec<Output>, String> {
        let at_rest = grid(2.0e-3, 0.05).map(Input::at_rest);
        walk(500).chain(at_rest).map(|input| step(model, &input)).collect()
    };
    let first = run(model)?;
    match model.reset() {
        CallStatus::Ok => {}
        other => return Err(format!("reset returned `{}`", other.name())),
    }
    let second = run(model)?;
    let differs = first.iter().zip(&second).position(|(a, b)| a.wrench != b.wrench);
    differs.map_or(Ok(()), |index| {
        Err(format!("pose {index} of the same path returned another result after reset"))
    })
}

pub(super) fn time_budget(model: &mut Model) -> Result<(), String> {
    const STEPS: usize = 1000;
    let mut took = Vec::with_capacity(STEPS);
    for input in walk(STEPS as u64) {
        let started = processor_time();
        // A failed step is fast and must not pass.
        step(model, &input)?;
        took.push(processor_time().saturating_sub(started));
    }
    took.sort_unstable();
    let usual = took.get(STEPS * 99 / 100).copied().unwrap_or_default();
    let limit = Duration::from_nanos(CONFIG.period_ns / 2);
    if usual <= limit {
        return Ok(());
    }
    let [usual, limit] = [usual, limit].map(wording::time);
    Err(format!("the 99th percentile of the duration of a step is {usual}, above the limit of {limit}"))
}

/// Returns the wrenches of a walk of each model, stepped alternately.
fn walked(models: &mut [&mut Model]) -> Result<Vec<Vec<Wrench>>, String> {
    let mut wrenches = vec![Vec::new(); models.len()];
    for input in walk(500) {
        for (model, wrenches) in models.iter_mut().zip(&mut wrenches) {
            wrenches.push(step(model, &input)?.wrench);
        }
    }
    Ok(wrenches)
}

pub(super) fn independent(subject: &Subject) -> Result<(), Outcome> {
    let make = || subject.prepared_model();
    let alone = walked(&mut [&mut make()?])?;
    let alone = alone.first().cloned().unwrap_or_default();
    let in_turns = walked(&mut [&mut make()?, &mut make()?])?;
    if in_turns.iter().any(|wrenches| *wrenches != alone) {
        return Err("two instances stepped alternately return other results than one instance alone"
            .to_owned()
            .into());
    }
    // Created here, stepped on another thread: as in a loop.
    let start = |mut model: Model| {
        let thread = std::thread::Builder::new().spawn(move || walked(&mut [&mut model]));
        thread.map_err(|cause| Outcome::no_thread(&cause))
    };
    let elsewhere: Vec<_> = [start(make()?), start(make()?)]
        .into_iter()
        .map(|thread| Ok(thread?.join().map_err(|_| "a thread panicked".to_owned())??))
        .collect::<Result<_, Outcome>>()?;
    if elsewhere.iter().flatten().any(|wrenches| *wrenches != alone) {
        return Err("two instances stepped on two threads return other results than one instance alone"
            .to_owned()
            .into());
    }
    Ok(())
}

/// Compares the number of threads with that before the library was loaded.
pub(super) fn no_threads(mut model: Model, before: usize) -> Result<(), Outcome> {
    let more = |when: &str| match state::threads()?.saturating_sub(before) {
        0 => Ok(()),
        more => Err(Outcome::Violation(format!(
            "after {when} the process has more threads than before the plugin was loaded ({more} more); join \
             every thread before the call returns"
        ))),
    };
    more("create and prepare")?;
    let _ = walked(&mut [&mut model])?;
    more("500 steps")?;
    drop(model);
    more("destroy")
}

/// Compares force and torque with the energy's slope over a micrometre and a hundredth of a milliradian, at poses of a walk. A kink
/// of the law may lie between the two poses, so a few places may differ, but not one in ten.
pub(super) fn energy_gradient(model: &mut Model) -> Result<(), Outcome> {
    const STEP_M: f64 = 1.0e-6;
    const STEP_RAD: f64 = 1.0e-5;
    if model.memory() != Memory::Stateless {
        return Err(Outcome::nothing_to_judge(
            "the model has a history, so its energy is not a function of the pose",
        ));
    }
    if !model.serves().contains(Demand::ENERGY) {
        return Err(Outcome::nothing_to_judge("the model has no output `energy`"));
    }
    // Components of force and of torque, each with the energy's slope.
    let (mut forces, mut torques) = (Vec::new(), Vec::new());
    for input in walk(2000).step_by(20) {
        let (position, orientation) = (input.pose.position(), input.pose.orientation());
        let here = step(model, &input)?.wrench;
        for axis in DVec3::AXES {
            let moved = |along: f64| Pose::new(position + axis * along, orientation);
            let turned = |angle: f64| Pose::new(position, DQuat::from_axis_angle(axis, angle) * orientation);
            let mut slope = |pose: &dyn Fn(f64) -> Pose, size: f64| -> Result<f64, Outcome> {
                let ahead_j = step(model, &Input::at_rest(pose(size)))?.energy_j;
                let behind_j = step(model, &Input::at_rest(pose(-size)))?.energy_j;
                Ok((ahead_j - behind_j) / (2.0 * size))
            };
            forces.push((here.force().dot(axis), -slope(&moved, STEP_M)?));
            torques.push((here.torque().dot(axis), -slope(&turned, STEP_RAD)?));
        }
    }
    let has_something =
        |(own, gradient): &(f64, f64)| gradient.is_finite() && (*own != 0.0 || *gradient != 0.0);
    if !forces.iter().chain(&torques).any(has_something) {
        return Err(Outcome::nothing_to_judge(
            "wrench and energy are zero, or the energy is not finite, on the whole path",
        ));
    }
    agree(&forces, ["force", "N"])?;
    Ok(agree(&torques, ["torque", "N·m"])?)
}

/// Compares components with the energy's gradient, to a five hundredth of the largest: rounding of the energy over the
/// step and the curvature of the law are far below that.
fn agree(seen: &[(f64, f64)], [what, unit]: [&str; 2]) -> Result<(), String> {
    const TOLERATED: usize = 10;
    const SAME: f64 = 0.002;
    let seen: Vec<_> = seen.iter().filter(|(_, gradient)| gradient.is_finite()).collect();
    let largest = seen.iter().fold(0.0, |largest: f64, (own, _)| largest.max(own.abs()));
    let differs = |(own, gradient): &&&(f64, f64)| (own - gradient).abs() > SAME * largest;
    let different = seen.iter().filter(differs).count();
    if different * TOLERATED <= seen.len() {
        return Ok(());
    }
    let example = seen.iter().find(differs).map_or(String::new(), |(own, gradient)| {
        format!(": {own:.4} {unit} instead of the {gradient:.4} {unit} of the energy's gradient")
    });
    Err(format!("{what} and energy disagree in {different} of {} components{example}", seen.len()))
}

/// Steps the model around its active region, where a host does not step it and assumes zero.
pub(super) fn activity(model: &mut Model) -> Result<(), Outcome> {
    let region = model.active_region();
    if region.shape() == RegionShape::Everywhere {
        return Err(Outcome::nothing_to_judge("the model is active everywhere"));
    }
    let turned = DQuat::from_scaled_axis(DVec3::new(0.1, -0.2, 0.05));
    let mut ticks = 0..;
    for position_m in around(&region).filter(|position_m| !region.contains(*position_m)) {
        let outwards = (position_m - region.center()).normalize_or_zero();
        for velocity_m_per_s in [DVec3::ZERO, outwards * 0.1, outwards * -0.1] {
            // Start each time at the centre, where the model may exert a force: the test is that the force has ended
            // outside.
            for pose in [Pose::new(region.center(), DQuat::IDENTITY), Pose::new(position_m, turned)] {
                let tick = ticks.next().unwrap_or(0);
                let twist = Twist::new(velocity_m_per_s, DVec3::ZERO);
                let output = finite(model, &Input { twist, ..input_of(tick, pose) })?;
                let acts = output.wrench != Wrench::ZERO || output.energy_j.abs() > 0.0;
                if acts && !region.contains(pose.position()) {
                    return Err(Outcome::Violation(format!(
                        "at {position_m} m, outside its active region, the model returned {}",
                        wording::output(&output)
                    )));
                }
            }
        }
    }
    Ok(())
}

/// Returns positions around a region: barely outside, a little, and far.
fn around(region: &ActiveRegion) -> impl Iterator<Item = DVec3> {
    let (center_m, half_m, shape) = (region.center(), region.half_sides(), region.shape());
    directions().filter(|direction| *direction != DVec3::ZERO).flat_map(move |direction| {
        [1.0e-9, 1.0e-3, 1.0].map(move |gap| {
            // Relative as well: in a large region the absolute gap is below rounding.
            let outside_m = half_m * (1.0 + gap) + DVec3::splat(gap);
            let direction = if shape == RegionShape::Sphere { direction.normalize() } else { direction };
            center_m + direction * outside_m
        })
    })
}
