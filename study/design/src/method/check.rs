//! Checks of the settings of methods.

use crate::error::DesignError;

/// Checks that levels are finite and different.
pub(super) fn different(key: &str, levels: &[f64]) -> Result<(), DesignError> {
    let is_right =
        |level: f64| level.is_finite() && levels.iter().filter(|other| **other == level).count() == 1;
    levels.iter().find(|level| !is_right(**level)).map_or(Ok(()), |wrong| {
        Err(DesignError::new(
            key,
            &format!("level {wrong} is listed twice or not finite; write finite levels, each once"),
        ))
    })
}

/// Checks that floor, first level and ceiling of a track are in this order.
pub(super) fn in_order(key: &str, [floor, initial, ceiling]: [f64; 3]) -> Result<(), DesignError> {
    if floor <= initial && initial <= ceiling && floor < ceiling {
        return Ok(());
    }
    let problem = format!(
        "levels from {floor} to {ceiling} that begin at {initial}: write floor <= first level <= ceiling"
    );
    Err(DesignError::new(key, &problem))
}

pub(super) fn positive(key: &str, value: f64) -> Result<(), DesignError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(DesignError::new(key, &format!("{value}: write a finite number above 0")))
}

pub(super) fn share(key: &str, value: f64) -> Result<(), DesignError> {
    if value > 0.0 && value < 1.0 {
        return Ok(());
    }
    Err(DesignError::new(key, &format!("{value}: write a share above 0 and below 1")))
}

/// Checks the numbers of reversals of a track: first counted, last, and largest number of trials.
pub(super) fn reversals([first, last, trials]: [u32; 3]) -> Result<(), DesignError> {
    if first >= 1 && first <= last && last < trials {
        return Ok(());
    }
    let problem = format!(
        "the mean from reversal {first} of {last} in at most {trials} trials: write 1 <= average_from <= stop_after < trials_most"
    );
    Err(DesignError::new("method.rule", &problem))
}
