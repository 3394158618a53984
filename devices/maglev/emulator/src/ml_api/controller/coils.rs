//! Currents, temperatures and light spots: the coil, thermal and optical models of the simulated flotor.

use flotor_hal::{Pose, Wrench};
use flotor_maglev::ml_api::{AxisValues, Cell};
use flotor_simulated::actuation::coils::{COILS, CURRENT_LIMIT_A, CoilGeometry, Coils, Currents};
use flotor_simulated::actuation::thermal::{
    MEAN_CURRENT_LIMIT_A, TEMPERATURE_LIMIT_C, Thermal, ThermalParameters,
};
use flotor_simulated::plant;
use flotor_simulated::sensing::optics::{Optics, OpticsGeometry};

/// Voltage of an electrode that receives all of the light, V.
const FULL_V: f64 = 10.0;

/// Coils with limits and temperatures, and the optics of the position sensors.
#[derive(Clone, Debug)]
pub(super) struct CoilSet {
    coils: Option<Coils>,
    optics: Option<Optics>,
    thermal: Thermal,
    /// Current limit of each coil, A: the limit of the device until a client sets another.
    pub(super) limits_a: AxisValues,
    currents_a: Currents,
}

impl Default for CoilSet {
    #[allow(clippy::cast_possible_truncation)] // the wire format is f32
    fn default() -> Self {
        Self {
            coils: Coils::new(&CoilGeometry::MAGLEV).ok(),
            optics: Optics::new(&OpticsGeometry::MAGLEV).ok(),
            thermal: Thermal::new(ThermalParameters::MAGLEV),
            limits_a: [CURRENT_LIMIT_A as f32; COILS],
            currents_a: [0.0; COILS],
        }
    }
}

impl CoilSet {
    fn limit_a(&self, coil: usize) -> f64 {
        f64::from(self.limits_a[coil]).min(CURRENT_LIMIT_A)
    }

    /// Returns the coil currents for a wrench, A, and the resulting wrench; both are scaled down if a coil exceeds its
    /// limit.
    pub(super) fn driven(&self, wanted: &Wrench) -> (Currents, Wrench) {
        let Some(coils) = &self.coils else { return ([0.0; COILS], *wanted) };
        let asked = plant::Wrench { force_n: wanted.force(), torque_nm: wanted.torque() };
        let (currents_a, mut share) = coils.currents(&asked);
        for (coil, current) in currents_a.iter().enumerate() {
            if current.abs() > self.limit_a(coil) {
                share = share.min(self.limit_a(coil) / (current.abs() / share).max(f64::MIN_POSITIVE));
            }
        }
        if share >= 1.0 {
            return (currents_a, *wanted);
        }
        let delivered = Wrench::new(wanted.force() * share, wanted.torque() * share);
        let (currents_a, _) =
            coils.currents(&plant::Wrench { force_n: delivered.force(), torque_nm: delivered.torque() });
        (currents_a, delivered)
    }

    /// Clips currents, A, to the limits; returns true if a current was clipped.
    pub(super) fn clipped(&self, asked_a: &AxisValues) -> (AxisValues, bool) {
        #[allow(clippy::cast_possible_truncation)] // an f32 or a limit
        let within = std::array::from_fn(|coil| {
            f64::from(asked_a[coil]).clamp(-self.limit_a(coil), self.limit_a(coil)) as f32
        });
        (within, within != *asked_a)
    }

    /// Returns the wrench of the coils at these currents, A.
    pub(super) fn wrench(&self, currents_a: &AxisValues) -> Wrench {
        let made = self.coils.as_ref().map(|coils| coils.wrench(&currents_a.map(f64::from)));
        made.map_or(Wrench::ZERO, |made| Wrench::new(made.force_n, made.torque_nm))
    }

    /// Stores the coil currents, A, and heats the coils over `dt_s`.
    pub(super) fn carry(&mut self, currents_a: &Currents, dt_s: f64) {
        self.currents_a = *currents_a;
        self.thermal.heat(currents_a, dt_s);
    }

    /// Returns the temperatures of the coils, °C.
    #[allow(clippy::cast_possible_truncation)] // the wire format is f32
    pub(super) fn temperatures_c(&self) -> AxisValues {
        self.thermal.temperatures_c().map(|value| value as f32)
    }

    pub(super) fn is_too_hot(&self) -> bool {
        self.thermal.hottest_c() > TEMPERATURE_LIMIT_C
    }

    pub(super) fn is_overloaded(&self) -> bool {
        self.thermal.mean_current_a() > MEAN_CURRENT_LIMIT_A
    }

    /// Returns the light spots of a pose on the position sensors, m.
    #[allow(clippy::cast_possible_truncation)] // the wire format is f32
    pub(super) fn cells(&self, pose: &Pose) -> [Cell; 3] {
        let Some(spots) = self.spots(pose) else { return [Cell::default(); 3] };
        spots.map(|[x, y]| Cell { x: x as f32, y: y as f32, is_valid: true })
    }

    /// Returns the voltages of each sensor's four electrodes: two along and two across share the light in proportion.
    #[allow(clippy::cast_possible_truncation)] // the wire format is f32
    pub(super) fn voltages(&self, pose: &Pose) -> [f32; 12] {
        let mut voltages = [0.0; 12];
        let half_m = OpticsGeometry::MAGLEV.cell_half_width_m;
        for (four, [x, y]) in voltages.chunks_exact_mut(4).zip(self.spots(pose).unwrap_or_default()) {
            for (pair, at) in four.chunks_exact_mut(2).zip([x, y]) {
                pair[0] = (0.5 * FULL_V * (1.0 - at / half_m)) as f32;
                pair[1] = (0.5 * FULL_V * (1.0 + at / half_m)) as f32;
            }
        }
        voltages
    }

    fn spots(&self, pose: &Pose) -> Option<[[f64; 2]; 3]> {
        let pose =
            flotor_simulated::hand::Pose { position_m: pose.position(), orientation: pose.orientation() };
        let spots = self.optics.as_ref()?.spots(&pose)?;
        let (across, up) = (spots.across_m.to_array(), spots.up_m.to_array());
        Some([0, 1, 2].map(|cell| [across[cell], up[cell]]))
    }
}
