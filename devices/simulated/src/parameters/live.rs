//! Parameters that change while the loop runs: the guide of the hand and its target.

use super::SCHEMA;
use crate::hand::guidance::NotGuiding;
use crate::simulation::Simulation;
use crate::units::MM;
use flotor_hal::{OutOfRange, SetParameterError};

/// Indices of the coordinates of the target in the schema: x, y, z.
const TARGET: [usize; 3] =
    [index_of("hand_target_x_mm"), index_of("hand_target_y_mm"), index_of("hand_target_z_mm")];

/// Index of the parameter with the number of the guiding client.
const GUIDE: usize = index_of("hand_guide");

/// Returns the index of a parameter; compilation fails for an unknown id.
const fn index_of(id: &str) -> usize {
    let mut index = 0;
    while !is_same(SCHEMA[index].id().as_bytes(), id.as_bytes()) {
        index += 1;
    }
    index
}

const fn is_same(one: &[u8], other: &[u8]) -> bool {
    let mut at = 0;
    while at < one.len() && at < other.len() && one[at] == other[at] {
        at += 1;
    }
    at == one.len() && at == other.len()
}

/// Changes the live parameter at `index` of the schema. Real-time: bounded, no allocation.
///
/// # Errors
/// [`OutOfRange`] if another client guides the hand, or none does, with the number of the guiding client (0: none) as
/// both limits; `Fixed` for a parameter that is not live.
pub(crate) fn change(simulation: &mut Simulation, index: usize, value: f64) -> Result<(), SetParameterError> {
    let refused =
        |NotGuiding { guide }| SetParameterError::OutOfRange(OutOfRange { min: guide, max: guide, value });
    if index == GUIDE {
        return simulation.guide(value).map_err(refused);
    }
    match TARGET.iter().position(|target| *target == index) {
        Some(axis) => simulation.guide_to(axis, value * MM).map_err(refused),
        None => Err(SetParameterError::Fixed),
    }
}

/// Applies the initial values of the live parameters: if `hand_guide` is set, its guidance starts with the first tick.
/// Real-time: bounded, no allocation.
pub(crate) fn begin(simulation: &mut Simulation, values: &[f64]) {
    let guide = values.get(GUIDE).copied().unwrap_or_default();
    if guide != 0.0 && simulation.guide(guide).is_ok() {
        for (axis, index) in TARGET.into_iter().enumerate() {
            // Cannot fail: the guide has just been set.
            let _ = simulation.guide_to(axis, values.get(index).copied().unwrap_or_default() * MM);
        }
    }
}
