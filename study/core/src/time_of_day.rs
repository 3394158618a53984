//! UTC timestamps with a resolution of 1 ms, for relating events to the files of other devices. Only the events of a person's
//! sitting have timestamps; simulated sittings do not depend on the clock.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

const MS_PER_DAY: u64 = 86_400_000;

/// Date and time of day, in milliseconds since 1970-01-01 UTC; written as `2026-11-25T18:34:09.123Z` (ISO 8601, as in BIDS).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeOfDay(u64);

impl TimeOfDay {
    /// Returns the current time by the system's clock.
    #[must_use]
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self(u64::try_from(since.as_millis()).unwrap_or(u64::MAX))
    }

    /// Returns the time since `earlier`, s; negative if `earlier` is later than this time.
    #[must_use]
    pub fn since_s(self, earlier: Self) -> f64 {
        (self.0 as f64 - earlier.0 as f64) * 1.0e-3
    }
}

/// Smallest change of the system clock that counts as a jump, ms; smaller changes are ordinary adjustments.
const LEAST_JUMP_MS: i64 = 1_000;

/// Clock of a sitting: the time of day at its start plus monotonic time, unaffected by changes of the system clock.
#[derive(Clone, Copy, Debug)]
pub struct SittingClock {
    began: TimeOfDay,
    started: Instant,
    /// System time minus this clock's time at the last reported jump, ms.
    noted_ms: i64,
}

impl SittingClock {
    /// Starts the clock at the current time.
    #[must_use]
    pub fn start() -> Self {
        Self { began: TimeOfDay::now(), started: Instant::now(), noted_ms: 0 }
    }

    /// Returns the time of day by this clock.
    #[must_use]
    pub fn now(&self) -> TimeOfDay {
        let passed_ms = u64::try_from(self.started.elapsed().as_millis()).unwrap_or(u64::MAX);
        TimeOfDay(self.began.0.saturating_add(passed_ms))
    }

    /// Returns the jump of the system clock since the last reported jump, ms, positive forward, and marks it as reported; `None`
    /// if the clock jumped by less than a second.
    pub fn take_jump_ms(&mut self) -> Option<i64> {
        self.jump_to(TimeOfDay::now())
    }

    fn jump_to(&mut self, system: TimeOfDay) -> Option<i64> {
        let apart_ms = system.0.cast_signed().saturating_sub(self.now().0.cast_signed());
        let jump_ms = apart_ms.saturating_sub(self.noted_ms);
        let is_jump = jump_ms.saturating_abs() >= LEAST_JUMP_MS;
        is_jump.then(|| {
            self.noted_ms = apart_ms;
            jump_ms
        })
    }
}

impl fmt::Display for TimeOfDay {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (days, ms) = (self.0 / MS_PER_DAY, self.0 % MS_PER_DAY);
        let (year, month, day) = date(days);
        let (hour, minute, second) = (ms / 3_600_000, ms / 60_000 % 60, ms / 1000 % 60);
        write!(f, "{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}.{:03}Z", ms % 1000)
    }
}

/// Converts days since 1970-01-01 to year, month and day (Gregorian calendar; computed with years that start in March, so that
/// the leap day is the last day).
fn date(days: u64) -> (u64, u64, u64) {
    let from_march = days + 719_468; // days from 0000-03-01 to 1970-01-01
    let (era, day) = (from_march / 146_097, from_march % 146_097);
    let year = (day - day / 1460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (month, carry) = if month < 10 { (month + 3, 0) } else { (month - 9, 1) };
    (era * 400 + year + carry, month, day)
}

/// Error: a text is not a valid time of day in canonical form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the time does not have the form 2026-11-25T18:34:09.123Z")]
pub struct ParseTimeError;

impl FromStr for TimeOfDay {
    type Err = ParseTimeError;

    fn from_str(text: &str) -> Result<Self, ParseTimeError> {
        let number = |range: std::ops::Range<usize>| -> Result<u64, ParseTimeError> {
            text.get(range).and_then(|digits| digits.parse().ok()).ok_or(ParseTimeError)
        };
        let (year, month, day) = (number(0..4)?, number(5..7)?, number(8..10)?);
        let (hour, minute, second, ms) = (number(11..13)?, number(14..16)?, number(17..19)?, number(20..23)?);
        if year < 1970 {
            return Err(ParseTimeError);
        }
        let (march, years) = if month > 2 { (month - 3, year) } else { (month + 9, year - 1) };
        let days = 365 * years + years / 4 - years / 100 + years / 400 + (153 * march + 2) / 5 + day;
        let days = days.checked_sub(719_469).ok_or(ParseTimeError)?;
        let time = Self(days * MS_PER_DAY + hour * 3_600_000 + minute * 60_000 + second * 1000 + ms);
        // Accept only text in canonical form.
        if time.to_string() == text { Ok(time) } else { Err(ParseTimeError) }
    }
}

impl Serialize for TimeOfDay {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for TimeOfDay {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_read_back_and_dates_are_those_of_the_calendar() {
        for (ms, text) in [
            (0, "1970-01-01T00:00:00.000Z"),
            (951_782_400_000, "2000-02-29T00:00:00.000Z"),
            (1_709_251_199_999, "2024-02-29T23:59:59.999Z"),
            (1_764_095_649_123, "2025-11-25T18:34:09.123Z"),
            (4_107_542_400_000, "2100-03-01T00:00:00.000Z"),
        ] {
            assert_eq!(TimeOfDay(ms).to_string(), text);
            assert_eq!(text.parse(), Ok(TimeOfDay(ms)), "{text}");
        }
        for wrong in [
            "",
            "2025-02-29T00:00:00.000Z",
            "2025-13-01T00:00:00.000Z",
            "1969-01-01T00:00:00.000Z",
            "25.11.2025",
        ] {
            assert_eq!(wrong.parse::<TimeOfDay>(), Err(ParseTimeError), "{wrong}");
        }
    }

    #[test]
    fn a_jump_of_the_time_of_day_is_told_once_and_moves_no_time() {
        let mut clock = SittingClock::start();
        let hour_ms = 3_600_000;
        let at = |clock: &SittingClock, by_ms: i64| TimeOfDay(clock.now().0.saturating_add_signed(by_ms));
        assert_eq!(clock.jump_to(at(&clock, 0)), None);
        // Milliseconds may pass between two readings of the clock.
        let back = clock.jump_to(at(&clock, -hour_ms)).expect("it has jumped");
        assert!((back + hour_ms).abs() < 900, "{back}");
        assert_eq!(clock.jump_to(at(&clock, -hour_ms)), None);
        let forth = clock.jump_to(at(&clock, 0)).expect("it was set right");
        assert!((forth - hour_ms).abs() < 900, "{forth}");
        assert!((0.0..1.0).contains(&clock.now().since_s(clock.began)));
    }

    #[test]
    fn every_day_of_four_centuries_reads_back() {
        for day in (0..146_097 * 2).step_by(13) {
            let time = TimeOfDay(day * MS_PER_DAY + day % 1000);
            assert_eq!(time.to_string().parse(), Ok(time));
        }
        assert_eq!(TimeOfDay(1500).since_s(TimeOfDay(2000)), -0.5);
    }
}
