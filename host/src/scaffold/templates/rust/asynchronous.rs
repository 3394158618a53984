//! Your name: a soft block, too slow for the loop. Replace `solve` by your solver, build, and feel the difference.
//!
//! The loop runs a thousand times a second; `contact_set` runs at the rate that the scene gives, in a thread of its own. It gets
//! the pose of the handle (m; z up, home at the origin) and returns the surface under the handle. In every tick the loop computes
//! the force of this surface, which pushes the hand and never pulls.

use flotor_hal::*;

/// Height of a layer, m, and for each layer the force that halves it, N.
const LAYER_M: f64 = 0.0075;
const HALF_N: [f64; 4] = [10.0, 20.0, 40.0, 80.0];
/// Largest depth passed to the solver, m. Below, the stiffness is constant.
const DEEPEST_M: f64 = 0.012;

/// Instance of the model: the place for the state of a solver.
struct YourName;

impl ForceModel for YourName {
    const INFO: ModelInfo = ModelInfo::new(
        "your-name", // in scenes
        "Your name", // on screens
        "A soft block of four layers",
    );

    // Before the loop: the place to read files, and to refuse with a reason.
    fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self)
    }

    // In the loop, for scenes without `[model.field]`: no force, because the solver is too slow.
    fn step(&mut self, input: &Input) -> Output {
        let status = if input.pose.is_finite() { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        Output::new(Wrench::ZERO, f64::NAN, status)
    }
}

impl ContactSetModel for YourName {
    // In a thread of its own: may allocate and wait, but not longer than a period of the model.
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let height_m = input.pose.position().z;
        let depth_m = (-height_m).clamp(0.0, DEEPEST_M);
        let [force_n, stiffness_n_per_m] = solve(depth_m);
        // The plane behind which a spring of this stiffness has this force. Above the block it is the surface itself.
        let gap_m = height_m + depth_m - force_n / stiffness_n_per_m;
        let surface = Contact::of_handle(input, DVec3::Z, gap_m, stiffness_n_per_m).with_damping(6.0);
        // Within half a millimetre the stiffness changes by less than a tenth.
        ContactSet { valid_m: 0.0005, ..ContactSet::at(input).with(surface) }
    }
}

flotor_hal::export_model!(YourName, contact_set);

/// Returns force, N, and stiffness, N/m, at a depth: a layer of height `h` gives way by `h F / (s + F)`, and Newton's method finds the
/// force `F` that all layers have when together they give way by the depth.
fn solve(depth_m: f64) -> [f64; 2] {
    let mut answer = [0.0; 2];
    for _ in 0..50 {
        let [force_n, _] = answer;
        let yielded_m: f64 = HALF_N.iter().map(|s_n| LAYER_M * force_n / (s_n + force_n)).sum();
        let slope: f64 = HALF_N.iter().map(|s_n| LAYER_M / (s_n + force_n) / (1.0 + force_n / s_n)).sum();
        answer = [force_n + (depth_m - yielded_m) / slope, 1.0 / slope];
    }
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Force of the contact at a height of the handle, of a set that was computed at another height.
    fn force_n(z_m: f64, computed_at_m: f64) -> f64 {
        let computed_at = Input::at_rest(Pose::new(DVec3::Z * computed_at_m, DQuat::IDENTITY));
        let surface = YourName.contact_set(&computed_at).contacts[0];
        surface.stiffness_n_per_m * (computed_at_m - z_m - surface.gap_m).max(0.0)
    }

    #[test]
    fn the_layers_together_give_way_by_the_depth() {
        for depth_m in [0.0, 0.004, 0.012] {
            let [force_n, _] = solve(depth_m);
            let layers = HALF_N.map(|half_n| 0.0075 / (1.0 + half_n / force_n));
            assert!((layers.iter().sum::<f64>() - depth_m).abs() < 1.0e-15);
        }
    }

    #[test]
    fn the_contact_is_near_the_solver_as_far_as_it_says() {
        let [exact_n, _] = solve(0.004);
        assert!((force_n(-0.004, -0.004) - exact_n).abs() < 1.0e-12);
        for z_m in [-0.0045, -0.0035] {
            let [exact_n, _] = solve(-z_m);
            // A tenth of the stiffness at the end is a twentieth of the change.
            let change_n = exact_n - force_n(-0.004, -0.004);
            assert!((force_n(z_m, -0.004) - exact_n).abs() < 0.05 * change_n.abs());
        }
    }

    #[test]
    fn above_the_block_there_is_no_force() {
        assert_eq!(force_n(0.001, 0.002), 0.0);
        assert!(force_n(-0.001, 0.002) > 0.5);
    }
}
