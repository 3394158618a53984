//! When something happened, for people and for other devices' files: the time of day in UTC, to the millisecond. Only what a
//! person does has one; simulated sittings are the same whenever they run.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

const MS_PER_DAY: u64 = 86_400_000;

/// A moment, as milliseconds since 1970 in UTC; written `2026-11-25T18:34:09.123Z` (ISO 8601, as in BIDS).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeOfDay(u64);

impl TimeOfDay {
    /// This moment by the system's clock.
    #[must_use]
    pub fn now() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self(u64::try_from(since.as_millis()).unwrap_or(u64::MAX))
    }

    /// Time from an earlier moment, s; negative if that was later.
    #[must_use]
    pub fn since_s(self, earlier: Self) -> f64 {
        (self.0 as f64 - earlier.0 as f64) * 1.0e-3
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

/// Year, month and day of a day counted from 1970-01-01 (Gregorian; years from March on, so that the leap day is the last).
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

/// A text that is no time of day.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it is no time like 2026-11-25T18:34:09.123Z")]
pub struct NoTime;

impl FromStr for TimeOfDay {
    type Err = NoTime;

    fn from_str(text: &str) -> Result<Self, NoTime> {
        let number = |range: std::ops::Range<usize>| -> Result<u64, NoTime> {
            text.get(range).and_then(|digits| digits.parse().ok()).ok_or(NoTime)
        };
        let (year, month, day) = (number(0..4)?, number(5..7)?, number(8..10)?);
        let (hour, minute, second, ms) = (number(11..13)?, number(14..16)?, number(17..19)?, number(20..23)?);
        if year < 1970 {
            return Err(NoTime);
        }
        let (march, years) = if month > 2 { (month - 3, year) } else { (month + 9, year - 1) };
        let days = 365 * years + years / 4 - years / 100 + years / 400 + (153 * march + 2) / 5 + day;
        let days = days.checked_sub(719_469).ok_or(NoTime)?;
        let time = Self(days * MS_PER_DAY + hour * 3_600_000 + minute * 60_000 + second * 1000 + ms);
        // What reads back as the same text is one, and nothing else.
        if time.to_string() == text { Ok(time) } else { Err(NoTime) }
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
            assert_eq!(wrong.parse::<TimeOfDay>(), Err(NoTime), "{wrong}");
        }
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
