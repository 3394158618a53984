//! From the scene's wrench to the one the controller is told: walls, warning, weight, correction. The same for every
//! protocol.

use crate::boundary::Walls;
use crate::warning::ExcessForce;
use flotor_hal::{DVec3, DeviceState, VerticalCalibration, Wrench};

/// What shapes a command.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaping {
    pub(crate) walls: Option<Walls>,
    pub(crate) calibration: VerticalCalibration,
    /// What carries the handle.
    pub(crate) weight: Wrench,
    /// What the controller adds by itself, N.
    pub(crate) own_n: f64,
    /// What was commanded last, as the scene sees it: walls included, weight and correction not.
    pub(crate) commanded: Wrench,
    pub(crate) warning: ExcessForce,
}

impl Shaping {
    pub(crate) fn new(calibration: VerticalCalibration, weight: Wrench, own_n: f64) -> Self {
        let warning = ExcessForce::default();
        Self { walls: None, calibration, weight, own_n, commanded: Wrench::ZERO, warning }
    }

    /// The wrench to tell the controller: walls added, weight carried, the total vertical force corrected. Real-time:
    /// bounded, no allocation.
    pub(crate) fn command(&mut self, wrench: &Wrench, state: &DeviceState) -> [f32; 6] {
        let wrench = if wrench.is_finite() { *wrench } else { Wrench::ZERO };
        let walls = self.walls.as_ref().map_or(Wrench::ZERO, |walls| walls.wrench(state));
        self.commanded = wrench + walls;
        self.warning.look(self.commanded.force());
        let total = self.commanded + self.weight;
        let height_m = state.pose.position().z;
        let z = self.calibration.command_n(total.force().z + self.own_n, height_m) - self.own_n;
        let (DVec3 { x, y, .. }, [tx, ty, tz]) = (total.force(), total.torque_nm);
        #[allow(clippy::cast_possible_truncation)] // f32 is what the wire has
        [x, y, z, tx, ty, tz].map(|value| value as f32)
    }
}
