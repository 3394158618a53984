//! Preset `full`: conversion of the settings to parameters of actuators, sensors and faults.

use crate::actuation::ActuationParameters;
use crate::actuation::coils::CoilGeometry;
use crate::actuation::field::FieldError;
use crate::actuation::thermal::ThermalParameters;
use crate::faults::{FaultKind, FaultPlan};
use crate::machine::MachineParameters;
use crate::sensing::SensingParameters;
use crate::sensing::optics::OpticsGeometry;
use crate::sensing::velocity::EstimatorKind;
use crate::units::{MM, PERCENT, UM, nanoseconds};
use flotor_hal::{Settings, math};

/// Returns the parameters of the machine; `None` with preset `plain`.
pub(crate) fn machine(settings: &Settings<'_>) -> Option<MachineParameters> {
    has_machine(settings).then(|| MachineParameters {
        actuation: actuation(settings),
        sensing: sensing(settings),
        fault: fault(settings),
    })
}

pub(super) fn has_machine(settings: &Settings<'_>) -> bool {
    settings.choice_or_default("preset") == 1
}

fn actuation(settings: &Settings<'_>) -> ActuationParameters {
    let value = |id| settings.number_or_default(id);
    ActuationParameters {
        geometry: CoilGeometry {
            radius_m: value("coil_radius_mm") * MM,
            meridian_ring_rad: value("coil_ring_a_deg").to_radians(),
            parallel_ring_rad: value("coil_ring_b_deg").to_radians(),
            coil_force_n: value("coil_force_n"),
        },
        amplifier_bandwidth_hz: value("amplifier_bandwidth_hz"),
        field: FieldError { peak_to_peak: value("field_error_percent") * PERCENT },
        thermal: ThermalParameters {
            ambient_c: value("coil_ambient_c"),
            rise_k_per_a2: value("coil_rise_k_per_a2"),
            lag_s: value("coil_lag_s"),
        },
    }
}

fn sensing(settings: &Settings<'_>) -> SensingParameters {
    let value = |id| settings.number_or_default(id);
    SensingParameters {
        geometry: OpticsGeometry {
            diode_azimuths_rad: [0.0, value("led_2_deg").to_radians(), value("led_3_deg").to_radians()],
            diode_radius_m: value("led_radius_mm") * MM,
            ..OpticsGeometry::MAGLEV
        },
        noise_m: value("sensor_noise_um") * UM,
        step_m: value("sensor_resolution_um") * UM,
        edge_nonlinearity: value("sensor_edge_percent") * PERCENT,
        bandwidth_hz: value("sensor_bandwidth_hz"),
        latency_ns: whole(value("sensor_latency_ticks")) as u64 * TICK_OF_THE_SENSORS_NS,
        estimator: estimator(settings),
    }
}

fn estimator(settings: &Settings<'_>) -> EstimatorKind {
    let value = |id| settings.number_or_default(id);
    match settings.choice_or_default("velocity") {
        1 => EstimatorKind::Difference,
        2 => EstimatorKind::Kalman {
            // Quantisation is noise, too: uniform over the width of a step.
            noise_m: math::hypot(
                value("sensor_noise_um") * UM,
                value("sensor_resolution_um") * UM / 12.0_f64.sqrt(),
            ),
            acceleration_m_per_s2: value("velocity_acceleration_m_per_s2"),
        },
        _ => EstimatorKind::LowPass { bandwidth_hz: value("velocity_bandwidth_hz") },
    }
}

fn fault(settings: &Settings<'_>) -> Option<FaultPlan> {
    let value = |id| settings.number_or_default(id);
    let index = whole(value("fault_index"));
    let kind = match settings.choice_or_default("fault") {
        1 => FaultKind::SensorLoss,
        2 => FaultKind::LateSample,
        3 => FaultKind::DuplicateSample,
        4 => FaultKind::DroppedSample,
        5 => FaultKind::StuckAxis(index),
        6 => FaultKind::CoilOpen(index),
        7 => FaultKind::OverTemperature,
        8 => FaultKind::CablePull,
        9 => FaultKind::ClockJitter,
        _ => return None,
    };
    Some(FaultPlan {
        kind,
        start_ns: nanoseconds(value("fault_time_s")),
        duration_ns: nanoseconds(value("fault_duration_s")),
        rate_per_s: value("fault_rate_per_s"),
    })
}

/// Unit of the setting `sensor_latency_ticks`, ns: the tick of the device's own controller.
const TICK_OF_THE_SENSORS_NS: u64 = 1_000_000;

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // the schema keeps it between 0 and 64
fn whole(number: f64) -> usize {
    number.round() as usize
}
