//! What a Flotor device does not have: motors, encoders beyond those of the base, joints of a wrist, the memory of a controller. Each answers that it is not
//! implemented, whatever it is asked.

use crate::error::{Code, failed};
use std::ffi::c_int;

/// Exports entry points that are there, because programs look for them, and do nothing.
macro_rules! absent {
    ($($name:ident)*) => {
        $(
            /// Not implemented: -1. What it is called with is not looked at.
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
