//! Live parameters with which a client guides the hand of a simulated device, such as the mouse in the viewer's window.
//!
//! The parameters change with every motion of the pointer, so plots of a run do not mark their changes.

/// Id of the parameter with the number of the guiding client; 0 releases the hand.
pub const GUIDE: &str = "hand_guide";

/// Ids of the parameters with the target: x, y, z of the device frame, mm.
pub const TARGET_MM: [&str; 3] = ["hand_target_x_mm", "hand_target_y_mm", "hand_target_z_mm"];

/// Returns true if a parameter guides a hand: [`GUIDE`], or one of [`TARGET_MM`].
#[must_use]
pub fn is_guidance(parameter: &str) -> bool {
    parameter == GUIDE || TARGET_MM.contains(&parameter)
}
