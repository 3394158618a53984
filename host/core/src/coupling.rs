//! Configuration of a virtual coupling between two devices.

use crate::limits::PassivityMode;
use crate::mapping::MappingConfig;

/// Virtual spring and damper between two devices, and the delay between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingConfig {
    /// Stiffness of translation, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping of relative motion, N·s/m.
    pub damping_ns_per_m: f64,
    /// Stiffness of rotation, N·m/rad.
    pub stiffness_nm_per_rad: f64,
    /// Damping of relative rotation, N·m·s/rad.
    pub damping_nms_per_rad: f64,
    /// Delay of the peer state between two ends in one run, ticks.
    pub delay_ticks: u32,
    /// Energy that a tank may hold beyond the energy stored in the spring, J.
    pub reserve_j: f64,
    /// Treatment of energy that a port generates.
    pub passivity: PassivityMode,
}

/// Longest delay, ticks: at least 1 s at rates up to 4 kHz.
pub const MAX_DELAY_TICKS: u32 = 4096;

impl Default for CouplingConfig {
    fn default() -> Self {
        // Moves 0.58 kg at 5 Hz against the hand's own mass, damped half critically; the rotation likewise with the
        // flotor's inertia of some 1e-3 kg m². Well inside b > K T (1/2 + delay), the limit of Gil and others
        // (Mechatronics 2009) at 1 kHz.
        Self {
            stiffness_n_per_m: 600.0,
            damping_ns_per_m: 6.0,
            stiffness_nm_per_rad: 1.0,
            damping_nms_per_rad: 0.01,
            delay_ticks: 1,
            reserve_j: 0.01,
            passivity: PassivityMode::Control,
        }
    }
}

/// Device at one end of a coupling, with its mapping to the shared frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingEnd {
    /// Index of the device in the scene.
    pub device: u16,
    /// Mapping from the frame of the device to the shared frame of both ends.
    pub mapping: MappingConfig,
}

/// Tolerance of an energy gain of 1: above the relative rounding error of three quotients.
const GAIN_ROUNDING: f64 = 1.0e-12;

/// Locations of the ends of a coupling.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CouplingEnds {
    /// Both ends are in this run.
    Here([CouplingEnd; 2]),
    /// One end is in this run, the other on another host, whose scene has a coupling of the same name.
    Remote(CouplingEnd),
}

impl CouplingEnds {
    /// Returns the largest ratio of the energy that one hand receives to the energy that the other hand has put in; at
    /// least 1, which means that the coupling amplifies no energy.
    ///
    /// An end converts one joule of the shared frame to `force_scale / motion_scale` joules at its hand. A tank limits
    /// the energy of the shared frame, so energy that crosses the coupling is scaled by the ratio of both ends, up in
    /// one direction if they differ. The scales of a remote end are unknown here: the ratio assumes a remote end
    /// without scales. Not real-time.
    #[must_use]
    pub fn energy_gain(&self) -> f64 {
        let scale = |end: &CouplingEnd| end.mapping.force_scale / end.mapping.motion_scale;
        let (first, second) = match self {
            CouplingEnds::Here([first, second]) => (scale(first), scale(second)),
            CouplingEnds::Remote(end) => (scale(end), 1.0),
        };
        let gain = (first / second).max(second / first);
        if gain <= 1.0 + GAIN_ROUNDING { 1.0 } else { gain }
    }

    /// Returns the ends in this run.
    #[must_use]
    pub fn here(&self) -> &[CouplingEnd] {
        match self {
            CouplingEnds::Here(ends) => ends,
            CouplingEnds::Remote(end) => std::slice::from_ref(end),
        }
    }
}

/// Description of a coupling in a run.
#[derive(Clone, Debug, PartialEq)]
pub struct CouplingDescription {
    /// Name in the scene.
    pub name: String,
    /// Spring, damper, delay, energy reserve and treatment of generated energy.
    pub config: CouplingConfig,
    /// Device and mapping of each end in this run; the other end may be on another host.
    pub ends: CouplingEnds,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(motion_scale: f64, force_scale: f64) -> CouplingEnd {
        let mapping = MappingConfig { motion_scale, force_scale, ..MappingConfig::default() };
        CouplingEnd { device: 0, mapping }
    }

    #[test]
    fn a_coupling_amplifies_where_the_energy_scales_of_its_ends_differ() {
        let plain = end(1.0, 1.0);
        for (motion_scale, force_scale, gain) in
            [(1.0, 1.0, 1.0), (0.5, 0.5, 1.0), (0.5, 2.0, 4.0), (2.0, 0.5, 4.0), (0.1, 10.0, 100.0)]
        {
            let scaled = end(motion_scale, force_scale);
            for ends in [
                CouplingEnds::Here([plain, scaled]),
                CouplingEnds::Here([scaled, plain]),
                CouplingEnds::Remote(scaled),
            ] {
                assert_eq!(ends.energy_gain(), gain, "{ends:?}");
            }
        }
        // Joules of the shared frame are another unit at both hands, and the same one: 0.3 / 0.1 is not 3 in binary.
        assert_eq!(CouplingEnds::Here([end(0.1, 0.3), end(1.0, 3.0)]).energy_gain(), 1.0);
    }
}
