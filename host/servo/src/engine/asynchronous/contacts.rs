//! Contacts of one instance of a model, with the limits at the hand in the frame of the model.

use flotor_contact::{
    Coupling, Limits, NotPositive, PublishedContacts, Replacement, Solver, StableStiffness,
};
use flotor_core::asynchronous::{ContactLimits, StiffnessCap};
use flotor_core::mapping::Mapping;
use flotor_hal::{DVec3, Refusal, Wrench};

/// Validity of contacts that declare none, in periods of the model.
const VALID_PERIODS: f64 = 3.0;

/// Creates the contacts of an instance before the first is published; `periods_ns` are those of the loop and of the model. Not
/// real-time.
///
/// # Errors
/// If a limit is not above 0.
pub(super) fn contacts(
    limits: &ContactLimits,
    mapping: &Mapping,
    periods_ns: [u64; 2],
) -> Result<PublishedContacts, Refusal> {
    let [loop_s, model_s] = periods_ns.map(|period_ns| period_ns as f64 * 1.0e-9);
    let cap = limits.cap.unwrap_or(StiffnessCap::UNKNOWN);
    // Stiffness and damping have the same scale.
    let scale = mapping.stiffness_scale();
    let (by_device_n_per_m, per_damping_1_per_s) = (cap.by_device_n_per_m / scale, cap.per_damping_1_per_s);
    let stable = StableStiffness { by_device_n_per_m, per_damping_1_per_s };
    let unit = mapping.wrench_to_model(&Wrench::new(DVec3::X, DVec3::X));
    let (force_n, torque_nm) =
        (limits.force_n * unit.force().length(), limits.torque_nm * unit.torque().length());
    let replacement =
        Replacement::Conserving { surface_power_w: limits.surface_power_w / mapping.energy_scale() };
    let solver = || {
        // The device declares no stiffness of rotation.
        let coupling = Coupling::new(cap.stiffness_n_per_m / scale, f64::INFINITY)?;
        let limits = Limits::new(force_n, torque_nm)?;
        Solver::new(coupling, limits, replacement, loop_s)
    };
    let solver = solver().map_err(|error: NotPositive| Refusal::parameter(format!("contacts: {error}")))?;
    Ok(PublishedContacts::new(solver, stable, VALID_PERIODS * model_s))
}
