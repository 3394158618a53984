//! Conversion of the scene's wrench to the commanded wrench: walls, warning, weight, correction. Common to both protocols.

use crate::boundary::Walls;
use crate::warning::ExcessForce;
use flotor_hal::{DVec3, DeviceState, VerticalCalibration, Wrench};

/// State of the command shaping.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaping {
    pub(crate) walls: Option<Walls>,
    pub(crate) calibration: VerticalCalibration,
    /// Wrench that balances the weight of the flotor.
    pub(crate) weight: Wrench,
    /// Vertical force that the controller adds by itself, N.
    pub(crate) own_n: f64,
    /// Last commanded wrench as the scene sees it: with walls, without weight and correction.
    pub(crate) commanded: Wrench,
    pub(crate) warning: ExcessForce,
}

impl Shaping {
    pub(crate) fn new(calibration: VerticalCalibration, weight: Wrench, own_n: f64) -> Self {
        let warning = ExcessForce::default();
        Self { walls: None, calibration, weight, own_n, commanded: Wrench::ZERO, warning }
    }

    /// Returns the wrench to command: walls and weight added, total vertical force corrected. Stores the wrench without weight and
    /// correction, and updates the warning. Real-time: bounded, no allocation.
    pub(crate) fn command(&mut self, wrench: &Wrench, state: &DeviceState) -> [f32; 6] {
        let wrench = if wrench.is_finite() { *wrench } else { Wrench::ZERO };
        let walls = self.walls.as_ref().map_or(Wrench::ZERO, |walls| walls.wrench(state));
        self.commanded = wrench + walls;
        self.warning.update(self.commanded.force());
        let total = self.commanded + self.weight;
        let height_m = state.pose.position().z;
        let z = self.calibration.command_n(total.force().z + self.own_n, height_m) - self.own_n;
        let (DVec3 { x, y, .. }, [tx, ty, tz]) = (total.force(), total.torque_nm);
        #[allow(clippy::cast_possible_truncation)] // the wire format is f32
        [x, y, z, tx, ty, tz].map(|value| value as f32)
    }
}
