//! Entry points without a counterpart in a Flotor device: motors, encoders beyond those of the base, joints of a wrist, the memory of
//! a controller. Each returns "not implemented" for any arguments.

use crate::error::{Code, failed};
use std::ffi::c_int;

/// Exports entry points that must exist, because programs look them up, but are not implemented.
macro_rules! absent {
    ($($name:ident)*) => {
        $(
            /// Returns -1, not implemented; ignores the arguments.
            #[unsafe(no_mangle)]
            pub(crate) extern "C" fn $name() -> c_int {
                failed(Code::NotImplemented)
            }
        )*
    };
}

absent! {
    dhdPreset dhdCalibrateWrist dhdResetWrist dhdUpdateEncoders dhdGetWristEncoders
    dhdGetGripperEncoder dhdGetEncoder dhdGetEnc dhdGetEncRange dhdGetEncVelocities dhdSetMotor
    dhdSetDeltaMotor dhdSetWristMotor dhdSetGripperMotor dhdSetMot dhdPreloadMot dhdSetBrk
    dhdDeltaMotorToForce dhdDeltaForceToMotor
    dhdWristEncoderToOrientation dhdWristOrientationToEncoder dhdWristMotorToTorque dhdWristTorqueToMotor
    dhdGripperEncoderToAngleRad dhdGripperEncoderToGap dhdGripperAngleRadToEncoder dhdGripperGapToEncoder
    dhdGripperMotorToForce dhdGripperForceToMotor
    dhdDeltaJointTorquesExtrema dhdSetDeltaJointTorques
    dhdGetWristJointAngles dhdWristJointAnglesToJacobian
    dhdWristJointTorquesExtrema dhdSetWristJointTorques dhdSetForceAndWristJointTorques
    dhdSetForceAndWristJointTorquesAndGripperForce dhdWristEncodersToJointAngles
    dhdWristJointAnglesToEncoders dhdDeltaGravityJointTorques dhdWristGravityJointTorques dhdSetComMode
    dhdSetComModePriority dhdControllerSetDevice dhdReadConfigFromFile drdMoveToEnc drdMoveToAllEnc drdTrack
    drdTrackEnc drdTrackAllEnc drdSetForceAndWristJointTorquesAndGripperForce
}
