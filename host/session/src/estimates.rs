//! Error estimates of a model: details named `..._error` that are known before the first step.

use flotor_hal::Detail;
use flotor_hal::abi::CallStatus;
use flotor_loader::Model;

/// Returns the error estimates of a model, each with its detail; empty if the model has none. Not real-time.
pub fn estimates(model: &mut Model) -> Vec<(Detail, f64)> {
    let details = model.details();
    let mut values = vec![f64::NAN; details.len()];
    if values.is_empty() || model.read_details(&mut values) != CallStatus::Ok {
        return Vec::new();
    }
    let is_estimate = |(detail, value): &(Detail, f64)| detail.id().ends_with("_error") && value.is_finite();
    details.iter().copied().zip(values).filter(is_estimate).collect()
}
