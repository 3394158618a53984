//! Extension `flotor.linear-field/1`: local linear field of a model that is too slow for the loop.
//!
//! A model that needs milliseconds (a mesh, a network, a solver) runs asynchronously, at its own rate. Each call
//! returns the wrench at one pose, the anchor, and the stiffness around it; the loop evaluates this field at every
//! tick, at the current pose of the handle.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{Instance, ModelAdapter};
use crate::{DVec3, ForceModel, Input, Pose, Wrench, rotation_vector};

/// Wrench around a pose, in the model frame: `W(d) = W0 - K d`. 416 bytes.
///
/// `d` is the displacement from the anchor: position in m, then the rotation vector of the turn from the anchor's
/// orientation, in rad. `K` is a stiffness: positive where the model pushes back.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct LinearField {
    /// Pose at which the field is exact.
    pub anchor: Pose,
    /// Wrench on the hand at the anchor, N and N·m.
    pub wrench: Wrench,
    /// Stiffness matrix `K = -dW/dd`. Rows: force x, y, z (N), torque x, y, z (N·m); columns: position x, y, z (m),
    /// rotation x, y, z (rad).
    pub stiffness: [[f64; 6]; 6],
    /// Radius of validity about the anchor, m; beyond, a host uses the wrench at that distance in the same direction.
    pub valid_m: f64,
    /// Largest valid rotation from the orientation of the anchor, rad.
    pub valid_rad: f64,
    /// Loop time for which the field was computed, ns.
    pub time_ns: u64,
}

impl LinearField {
    /// Field of zero wrench, valid everywhere.
    pub const NONE: Self = Self {
        anchor: Pose::HOME,
        wrench: Wrench::ZERO,
        stiffness: [[0.0; 6]; 6],
        valid_m: f64::INFINITY,
        valid_rad: f64::INFINITY,
        time_ns: 0,
    };

    /// Builds the field of a force that depends on position only, with the anchor at the pose of `input`. `slope_n_per_m`
    /// has the derivatives of the force along x, y and z; the stiffness is their negative.
    #[must_use]
    pub fn of_force(input: &Input, force_n: DVec3, slope_n_per_m: [DVec3; 3], valid_m: f64) -> Self {
        let mut stiffness = [[0.0; 6]; 6];
        for (column, change) in slope_n_per_m.into_iter().enumerate() {
            for (row, change) in stiffness.iter_mut().zip(change.to_array()) {
                if let Some(place) = row.get_mut(column) {
                    *place = -change;
                }
            }
        }
        Self {
            anchor: input.pose,
            wrench: Wrench::from_force(force_n),
            stiffness,
            valid_m,
            valid_rad: f64::INFINITY,
            time_ns: input.time_ns,
        }
    }

    /// Returns true if anchor, wrench and stiffness are finite and the range of validity is neither negative nor NaN.
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.anchor.is_finite()
            && self.wrench.is_finite()
            && self.stiffness.iter().flatten().all(|number| number.is_finite())
            && self.valid_m >= 0.0 // false for NaN
            && self.valid_rad >= 0.0
    }

    /// Returns the wrench at a pose, and true if the pose is within the range of validity; beyond, the wrench is
    /// taken at the edge of this range in the same direction. Real-time: bounded, no allocation.
    #[must_use]
    pub fn at(&self, pose: &Pose) -> (Wrench, bool) {
        let (position_m, is_near) = shortened(pose.position() - self.anchor.position(), self.valid_m);
        let turn = pose.orientation() * self.anchor.orientation().inverse();
        let (rotation_rad, is_turned_little) = shortened(rotation_vector(turn), self.valid_rad);
        let displacement: [f64; 6] = {
            let ([x, y, z], [rx, ry, rz]) = (position_m.to_array(), rotation_rad.to_array());
            [x, y, z, rx, ry, rz]
        };
        let pull = self.stiffness.map(|row| row.iter().zip(displacement).map(|(k, d)| k * d).sum::<f64>());
        let [fx, fy, fz, tx, ty, tz] = pull;
        let force = self.wrench.force() - DVec3::new(fx, fy, fz);
        let torque = self.wrench.torque() - DVec3::new(tx, ty, tz);
        (Wrench::new(force, torque), is_near && is_turned_little)
    }
}

fn shortened(displacement: DVec3, longest: f64) -> (DVec3, bool) {
    let length = displacement.length();
    if length <= longest { (displacement, true) } else { (displacement * (longest / length), false) }
}

/// Force model that computes a local linear field of its wrench.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, look: Shape }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Self { depth_m: 0.0, look: Shape::default() })
/// #     }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A stiffness of 200 N/m along z about the pose of the input: `export_model!(Foam, linear_field)`.
/// impl LinearFieldModel for Foam {
///     fn linear_field(&mut self, input: &Input) -> LinearField {
///         let mut stiffness = [[0.0; 6]; 6];
///         stiffness[2][2] = 200.0; // N/m
///         let force_n = DVec3::Z * -200.0 * input.pose.position().z;
///         LinearField {
///             anchor: input.pose,
///             wrench: Wrench::from_force(force_n),
///             stiffness,
///             valid_m: 0.002,
///             valid_rad: 0.1,
///             time_ns: input.time_ns,
///         }
///     }
/// }
/// # let mut foam = Foam { depth_m: 0.0, look: Shape::default() };
/// let field = foam.linear_field(&Input::at_rest(Pose::new(DVec3::Z * -0.005, DQuat::IDENTITY)));
/// // One millimetre deeper, a host without a newer field evaluates this field.
/// let (wrench, _) = field.at(&Pose::new(DVec3::Z * -0.006, DQuat::IDENTITY));
/// assert!((wrench.force().z - 1.2).abs() < 1e-12);
/// ```
pub trait LinearFieldModel: ForceModel {
    /// Returns the field at an input, after the time since the previous call (`input.dt_ns`). A run uses either this
    /// function or [`ForceModel::step`] of an instance, never both. Not real-time, but bounded: a call takes less than
    /// the period the model was prepared for.
    fn linear_field(&mut self, input: &Input) -> LinearField;
}

/// Function table `flotor.linear-field/1`: see [`LinearFieldModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct LinearFieldTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the field at an input, after the time since the previous call; returns a [`crate::abi::CallStatus`] code.
    /// Not real-time, but bounded.
    pub linear_field:
        Option<unsafe extern "C" fn(instance: Instance, input: *const Input, field: *mut LinearField) -> u32>,
}

layout! {
    LinearField { anchor, wrench, stiffness, valid_m, valid_rad, time_ns }
    LinearFieldTable { size, reserved, linear_field }
}
unsafe extern "C" fn linear_field<M: LinearFieldModel>(
    instance: Instance,
    input: *const Input,
    field: *mut LinearField,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, field, |model| Ok(model.linear_field(&*input))) }
}

table!(LinearFieldTable: "flotor.linear-field/1", M: [LinearFieldModel] {
    reserved: 0,
    linear_field: Some(linear_field::<M>),
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DQuat, orientation_from_rotation_vector};

    fn spring(valid_m: f64) -> LinearField {
        let input = Input::at_rest(Pose::new(DVec3::new(0.0, 0.0, 0.01), DQuat::IDENTITY));
        let slope = [DVec3::new(-100.0, 0.0, 5.0), DVec3::ZERO, DVec3::new(0.0, 0.0, -300.0)];
        LinearField::of_force(&input, DVec3::new(0.0, 0.0, 2.0), slope, valid_m)
    }

    #[test]
    fn at_its_anchor_it_is_its_wrench_and_around_it_linear() {
        let field = spring(1.0);
        assert_eq!(field.at(&field.anchor), (Wrench::from_force(DVec3::Z * 2.0), true));
        let (wrench, is_valid) = field.at(&Pose::new(DVec3::new(0.001, 0.5, 0.008), DQuat::IDENTITY));
        assert!(is_valid && (wrench.force() - DVec3::new(-0.1, 0.0, 2.605)).length() < 1.0e-12, "{wrench:?}");
    }

    #[test]
    fn beyond_what_may_be_believed_the_wrench_stays_as_at_the_edge() {
        let field = spring(0.002);
        let at = |z: f64| field.at(&Pose::new(DVec3::new(0.0, 0.0, z), DQuat::IDENTITY));
        assert_eq!((at(0.008).1, at(0.0), at(-5.0)), (true, at(0.0), at(0.0)));
        assert!(!at(0.0).1 && (at(0.0).0.force().z - 2.6).abs() < 1.0e-12);
        assert!(at(f64::MAX).0.is_finite());
    }

    #[test]
    fn rotation_acts_through_the_turn_from_the_anchor() {
        let anchor = orientation_from_rotation_vector(DVec3::new(0.3, -0.1, 0.2));
        let turn_rad = DVec3::new(0.0, 0.0, 0.05);
        let mut field = LinearField { anchor: Pose::new(DVec3::ZERO, anchor), ..LinearField::NONE };
        field.stiffness[5][5] = 2.0;
        let pose = Pose::new(DVec3::ZERO, orientation_from_rotation_vector(turn_rad) * anchor);
        let (wrench, _) = field.at(&pose);
        assert!((wrench.torque() - DVec3::new(0.0, 0.0, -0.1)).length() < 1.0e-12, "{wrench:?}");
    }

    #[test]
    fn a_field_with_a_number_that_is_none_is_noticed() {
        assert!(LinearField::NONE.is_finite());
        let mut field = spring(1.0);
        field.stiffness[2][3] = f64::NAN;
        assert!(!field.is_finite());
        assert!(!LinearField { valid_m: f64::NAN, ..LinearField::NONE }.is_finite());
    }
}
