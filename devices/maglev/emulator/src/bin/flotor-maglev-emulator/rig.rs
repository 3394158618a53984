//! The emulated device in the rig of the vertical calibration (`flotor_emulation::rig`): mass, stand, and the force on the
//! sensor.

use flotor_emulation::rig::Stand;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Mass of flotor, plates, screws and bolts, kg: 8.58 N (Varadharajan 2007, section 3.4) at standard gravity.
const MASS_KG: f64 = 0.874_917;
/// Stiffness and damping of the stand, N/m and N·s/m.
const STIFFNESS_N_PER_M: f64 = 20_000.0;
const DAMPING_NS_PER_M: f64 = 250.0;

/// Force on the sensor, N; clones share the value.
#[derive(Clone, Default)]
pub(crate) struct SensedForce(Arc<AtomicU64>);

impl SensedForce {
    pub(crate) fn press(&self, force_n: f64) {
        self.0.store(force_n.to_bits(), Ordering::Release);
    }

    pub(crate) fn value_n(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Acquire))
    }
}

/// Returns the settings of the simulated flotor in the rig; writes the stand's steps to a file beside the link.
pub(crate) fn settings(link: &Path, stand: Stand) -> Result<Vec<(&'static str, String)>, Box<dyn Error>> {
    let script = link.with_extension("stand.toml");
    std::fs::write(&script, stand.script()).map_err(|error| {
        format!("cannot write {}: {error}; name another path with --calibration-rig", script.display())
    })?;
    Ok(vec![
        ("preset", "full".to_owned()),
        ("mass_kg", MASS_KG.to_string()),
        ("feedforward_n", "0".to_owned()),
        ("hand_mass_kg", "0".to_owned()),
        ("hand_stiffness_n_per_m", STIFFNESS_N_PER_M.to_string()),
        ("hand_damping_ns_per_m", DAMPING_NS_PER_M.to_string()),
        ("hand_script", script.display().to_string()),
    ])
}
