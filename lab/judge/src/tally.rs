//! Results of the parts of a long measurement, merged in the order of the parts, independent of the schedule.

use flotor_hal::{Pose, math};
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// Result of a part. Merging is associative; the default is an empty result.
pub(crate) trait Merge: Default {
    /// Merges the result of the next part.
    fn merge(&mut self, later: Self);
}

/// Merges counts by addition.
impl Merge for u64 {
    fn merge(&mut self, later: Self) {
        *self += later;
    }
}

/// Merges positive numbers by their maximum.
impl Merge for f64 {
    fn merge(&mut self, later: Self) {
        *self = self.max(later);
    }
}

/// Merges options to the first value.
impl<T> Merge for Option<T> {
    fn merge(&mut self, later: Self) {
        *self = self.take().or(later);
    }
}

/// Merges lists by concatenation.
impl<T> Merge for Vec<T> {
    fn merge(&mut self, mut later: Self) {
        self.append(&mut later);
    }
}

/// Merges arrays by element.
impl<T: Merge, const N: usize> Merge for [T; N]
where
    [T; N]: Default,
{
    fn merge(&mut self, later: Self) {
        self.iter_mut().zip(later).for_each(|(here, there)| here.merge(there));
    }
}

/// Defines a struct that merges field by field.
macro_rules! tally {
    ($(#[$about:meta])* $seen:vis struct $name:ident { $($(#[$note:meta])* $shown:vis $field:ident: $type:ty,)* }) => {
        $(#[$about])*
        #[derive(Default)]
        $seen struct $name { $($(#[$note])* $shown $field: $type,)* }

        impl $crate::tally::Merge for $name {
            fn merge(&mut self, later: Self) {
                $($crate::tally::Merge::merge(&mut self.$field, later.$field);)*
            }
        }
    };
}
pub(crate) use tally;

/// Largest value so far, with its pose; of equal values, the first.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    pub(crate) value: f64,
    pub(crate) pose: Option<Pose>,
}

impl Worst {
    pub(crate) fn offer(&mut self, value: f64, pose: Pose) {
        self.merge(Self { value, pose: Some(pose) });
    }
}

impl Merge for Worst {
    fn merge(&mut self, later: Self) {
        if later.value > self.value {
            *self = later;
        }
    }
}

/// Histogram of a positive quantity with twenty bins per decade.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Decades(BTreeMap<i32, u64>);

/// Bins per decade.
const BINS_PER_DECADE: f64 = 20.0;
/// Smallest counted value; smaller ones count as this, below rounding of any measured quantity.
const SMALLEST: f64 = 1.0e-18;

impl Decades {
    /// Counts one value; ignores NaN.
    pub(crate) fn count(&mut self, value: f64) {
        if value.is_nan() {
            return;
        }
        #[allow(clippy::cast_possible_truncation)] // a few thousand at most
        let bin = (math::log10(value.clamp(SMALLEST, f64::MAX)) * BINS_PER_DECADE).floor() as i32;
        *self.0.entry(bin).or_default() += 1;
    }

    /// Returns lower edge, upper edge and count of every bin from the first to the last non-empty bin.
    #[must_use]
    pub fn bins(&self) -> Vec<(f64, f64, u64)> {
        let (Some((first, _)), Some((last, _))) = (self.0.first_key_value(), self.0.last_key_value()) else {
            return Vec::new();
        };
        let edge = |bin: i32| math::pow(10.0, f64::from(bin) / BINS_PER_DECADE);
        let bins = *first..=*last;
        bins.map(|bin| (edge(bin), edge(bin + 1), self.0.get(&bin).copied().unwrap_or(0))).collect()
    }
}

impl Merge for Decades {
    fn merge(&mut self, later: Self) {
        later.0.into_iter().for_each(|(bin, count)| *self.0.entry(bin).or_default() += count);
    }
}

impl Serialize for Decades {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let filled = self.bins().into_iter().filter(|(.., count)| *count > 0);
        serializer.collect_seq(filled)
    }
}

impl<'de> Deserialize<'de> for Decades {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let filled = Vec::<(f64, f64, u64)>::deserialize(from)?;
        #[allow(clippy::cast_possible_truncation)] // the edges of bins
        let bin = |edge: f64| (math::log10(edge) * BINS_PER_DECADE).round() as i32;
        Ok(Self(filled.into_iter().map(|(edge, _, count)| (bin(edge), count)).collect()))
    }
}
