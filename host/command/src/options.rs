//! Options that several commands share, and their parsers.

use crate::CommandError;
use clap::{Args, ValueEnum};
use flotor_hal::abi::loader::{Plugin, Setting};
use flotor_servo::Core;
use flotor_session::Strength;
pub use flotor_session::scene::{KeyValue, PluginKeyValue};
use std::ops::RangeInclusive;

/// `--clock`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ClockOption {
    /// The machine's clock
    #[default]
    Real,
    /// As fast as possible, bit-exact
    Virtual,
}

/// `--allow-strong`, of each command that runs a scene on a device.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct StrengthOption {
    /// Lift the host's ceiling of 20 N and 1 N·m for devices that are not simulated
    #[arg(long)]
    allow_strong: bool,
}

impl StrengthOption {
    /// What was said.
    #[must_use]
    pub fn strength(self) -> Strength {
        if self.allow_strong { Strength::Strong } else { Strength::UnderCeiling }
    }
}

/// Seconds from `10`, `10s`, `500ms`, `2min` or `1h`.
///
/// # Errors
/// If the text is no duration, or none a run may have.
pub fn duration_s(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let scale = match unit {
        "" | "s" => 1.0,
        "ms" => 1.0e-3,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        other => return Err(format!("unknown unit of time `{other}`; use ms, s, min or h")),
    };
    let number: f64 =
        number.trim().parse().map_err(|_| format!("invalid duration `{text}`; write 10s or 500ms"))?;
    let seconds = number * scale;
    if (0.0..=31_536_000.0).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("the range is 0 to 1 year".to_owned())
    }
}

/// A loop rate in Hz.
///
/// # Errors
/// If the text is no rate, or not from 100 to 10000 Hz.
pub fn rate_hz(text: &str) -> Result<f64, String> {
    number(text, "Hz", "rate", 100.0..=10_000.0)
}

/// A number in a unit, which may be left out; errors call it `what`.
///
/// # Errors
/// If the text is no number in this unit, or not a legal one.
pub fn number(text: &str, unit: &str, what: &str, legal: RangeInclusive<f64>) -> Result<f64, String> {
    let number = text.trim().trim_end_matches(unit).trim().parse();
    let number = number.map_err(|_| format!("invalid {what} `{text}`"))?;
    let (least, most) = (legal.start(), legal.end());
    if legal.contains(&number) { Ok(number) } else { Err(format!("the range is {least} to {most} {unit}")) }
}

/// A core of the machine.
///
/// # Errors
/// If the text is no number, or the system has no such core.
pub fn core(text: &str) -> Result<Core, String> {
    let number = text.trim().parse().map_err(|_| format!("invalid core number `{text}`"))?;
    Core::new(number).ok_or_else(|| format!("no core {number} on this machine"))
}

/// Checks `--set KEY=VALUE` against the schema of a plugin.
///
/// # Errors
/// If the schema knows no such parameter, or the value is not legal.
pub fn settings(plugin: &Plugin, sets: &[KeyValue]) -> Result<Vec<Setting>, CommandError> {
    let check = |set: &KeyValue| {
        let parameter = set.parameter();
        Setting::parse(plugin.parameters(), &parameter.key, &parameter.value)
            .map_err(|error| CommandError::Usage(format!("{}: {error}", parameter.location)))
    };
    sets.iter().map(check).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_may_have_its_unit_and_stays_in_its_range() {
        let force = |text| number(text, "N", "force", 1.0..=50.0);
        assert_eq!((force("10"), force(" 2.5 N ")), (Ok(10.0), Ok(2.5)));
        assert_eq!(force("ten N"), Err("invalid force `ten N`".to_owned()));
        for outside in ["0.5", "51N", "inf", "nan"] {
            assert_eq!(force(outside), Err("the range is 1 to 50 N".to_owned()), "{outside}");
        }
        assert_eq!(rate_hz("1000 Hz"), Ok(1000.0));
        assert_eq!(rate_hz("99"), Err("the range is 100 to 10000 Hz".to_owned()));
    }

    #[test]
    fn durations_have_units() {
        assert_eq!(duration_s("10"), Ok(10.0));
        assert_eq!(duration_s("10s"), Ok(10.0));
        assert_eq!(duration_s(" 500 ms"), Ok(0.5));
        assert_eq!(duration_s("2min"), Ok(120.0));
        assert!(duration_s("10 parsec").is_err());
        assert!(duration_s("-1s").is_err());
        assert!(duration_s("nan").is_err());
    }
}
