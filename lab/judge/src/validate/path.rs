//! Poses for checks of a model: at rest on a grid, and in motion along a smooth path.

use crate::subject::{call, input_of};
use crate::trajectory::{Series, Trajectory};
use crate::wording;
use flotor_hal::abi::CallStatus;
use flotor_hal::{DQuat, DVec3, Input, LoopConfig, Output, Pose, Twist};
use flotor_loader::Model;

/// Loop configuration of the checks.
pub(super) const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };

/// Speed factor of the fast walk: up to 0.8 m/s and 8 rad/s, the maximum of a hand.
pub(super) const FAST: f64 = 20.0;

/// Angular frequencies, rad/s, and amplitudes of the path. The frequencies have no common divisor, so no pose recurs
/// within a few seconds.
const POSITION_RAD_PER_S: DVec3 = DVec3::new(7.0, 11.0, 5.0);
const ROTATION_RAD_PER_S: DVec3 = DVec3::new(3.0, 13.0, 2.0);
const POSITION_M: f64 = 3.0e-3;
const ROTATION_RAD: f64 = 0.03;

/// Returns the 27 x 27 poses of a grid: each component of the position is -`size_m`, 0 or `size_m`, each component of the
/// rotation vector -`size_rad`, 0 or `size_rad`.
pub(super) fn grid(size_m: f64, size_rad: f64) -> impl Iterator<Item = Pose> {
    directions().flat_map(move |position| {
        directions().map(move |rotation| {
            let orientation = DQuat::from_scaled_axis(rotation * size_rad);
            Pose::new(position * size_m, orientation)
        })
    })
}

/// Returns the 27 points of a cube of half-edge 1: its centre, its corners, and the middles of its edges and faces.
pub(super) fn directions() -> impl Iterator<Item = DVec3> {
    let three = [-1.0, 0.0, 1.0];
    let pairs = move || three.into_iter().flat_map(move |x| three.map(move |y| (x, y)));
    pairs().flat_map(move |(x, y)| three.map(move |z| DVec3::new(x, y, z)))
}

/// Returns a walk near home, as inputs of a loop.
pub(crate) fn walk(steps: u64) -> impl Iterator<Item = Input> {
    walk_at(1.0, steps)
}

/// Returns the walk `speed` times as fast: the twist of each input is the derivative of its pose.
pub(super) fn walk_at(speed: f64, steps: u64) -> impl Iterator<Item = Input> {
    let path = Trajectory {
        position: Series::sines(DVec3::splat(POSITION_M), POSITION_RAD_PER_S),
        rotation: Series::sines(DVec3::splat(ROTATION_RAD), ROTATION_RAD_PER_S),
    };
    (0..steps).map(move |tick| {
        let (pose, shift_m, turn_rad) = path.at(tick as f64 * 1.0e-3 * speed);
        let dt_ns = if tick == 0 { 0 } else { CONFIG.period_ns };
        let twist = Twist::new(shift_m * speed, turn_rad * speed);
        Input { dt_ns, twist, ..input_of(tick, pose) }
    })
}

/// Makes one step; returns the answer, or a description of the failure.
pub(super) fn step(model: &mut Model, input: &Input) -> Result<Output, String> {
    call(model, input).map_err(|status| match status {
        CallStatus::Panicked => format!("{} the model failed: {}", place(input), model.reason(status)),
        other => format!("{} the model returned `{}`", place(input), other.name()),
    })
}

/// Makes one step; returns a description of the failure also for a wrench that is not finite, an infinite energy or an unknown
/// status.
pub(super) fn finite(model: &mut Model, input: &Input) -> Result<Output, String> {
    let output = step(model, input)?;
    if output.wrench.is_finite() && !output.energy_j.is_infinite() && output.status().is_some() {
        return Ok(output);
    }
    Err(format!("{} the model returned {}", place(input), wording::output(&output)))
}

fn place(input: &Input) -> String {
    if input.twist == Twist::ZERO {
        return format!("at {}", wording::pose(&input.pose));
    }
    let Input { tick, pose, twist, .. } = input;
    format!("at tick {tick}, {}, moving with {},", wording::pose(pose), wording::twist(twist))
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::rotation_vector;

    #[test]
    fn the_twist_of_the_walk_is_the_derivative_of_its_pose() {
        for speed in [1.0, FAST] {
            let inputs: Vec<Input> = walk_at(speed, 2000).collect();
            for window in inputs.windows(3) {
                let [before, here, after] = window else { panic!("three of them") };
                let turned = after.pose.orientation() * before.pose.orientation().inverse();
                let velocity = (after.pose.position() - before.pose.position()) / 2.0e-3;
                let spin = rotation_vector(turned) / 2.0e-3;
                // A central difference is wrong by a sixth of the third derivative times the step squared.
                let slack = |size: f64, rad_per_s: f64| size * (rad_per_s * speed).powi(3) * 1.0e-6;
                let slack_m_per_s = slack(POSITION_M, POSITION_RAD_PER_S.length());
                assert!((velocity - here.twist.linear()).length() <= slack_m_per_s, "tick {}", here.tick);
                let slack_rad_per_s = slack(ROTATION_RAD, ROTATION_RAD_PER_S.length());
                assert!((spin - here.twist.angular()).length() <= slack_rad_per_s, "tick {}", here.tick);
            }
        }
    }
}
