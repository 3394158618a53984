//! Grip of a device in the record of a tick.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use flotor_hal::{GripKind, GripState};

/// Grip of a device in a tick, in the units of its kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GripRecord {
    /// Last valid sample.
    pub state: GripState,
    /// Sum of the efforts of the models, scaled to the device.
    pub model: f64,
    /// Effort sent to the device after the limits.
    pub commanded: f64,
}

impl GripRecord {
    /// Returns the record of a grip at this sample, without effort. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn at(state: GripState) -> Self {
        Self { state, model: 0.0, commanded: 0.0 }
    }
}

/// Number of words of a grip: opening, velocity, efforts delivered, of the models and commanded, kind.
pub const GRIP_WORDS: usize = 6;

/// Returns a grip as words, all 0 without a grip. Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn to_words(grip: Option<GripRecord>) -> [u64; GRIP_WORDS] {
    let Some(GripRecord { state, model, commanded }) = grip else { return [0; GRIP_WORDS] };
    let numbers = [state.opening, state.velocity, state.delivered, model, commanded];
    let [opening, velocity, delivered, model, commanded] = numbers.map(f64::to_bits);
    [opening, velocity, delivered, model, commanded, state.kind() as u64 + 1]
}

/// Returns the grip that was stored in words; `None` without one. Real-time: bounded, no allocation.
#[inline]
#[must_use]
pub fn from_words(
    [opening, velocity, delivered, model, commanded, code]: [u64; GRIP_WORDS],
) -> Option<GripRecord> {
    let kind = [GripKind::Linear, GripKind::Angular].into_iter().find(|kind| *kind as u64 + 1 == code)?;
    let numbers = [opening, velocity, delivered, model, commanded].map(f64::from_bits);
    let [opening, velocity, delivered, model, commanded] = numbers;
    let state = GripState::new(kind, opening, velocity).with_delivered(delivered);
    Some(GripRecord { state, model, commanded })
}
