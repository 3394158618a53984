//! Snapshot: the saved state of a model or device, with all that an instance must have in common with the saved one.
//!
//! The state itself is bytes that only the plugin understands (`flotor.snapshot/1`). Bytes of another version, of other
//! parameters or of another loop would be numbers of another meaning, so a snapshot carries its origin and is refused
//! with the first difference.

use flotor_hal::LoopConfig;
use serde::{Deserialize, Serialize};

/// Plugin, parameters and loop of an instance whose state is saved.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct SnapshotOrigin {
    /// Id of the plugin.
    pub id: String,
    /// Version of the plugin.
    pub version: String,
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Seed of the run.
    pub seed: u64,
    /// Id and present value of every parameter, numbers with all their digits.
    pub parameters: Vec<(String, String)>,
}

/// Saved state of an instance.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Snapshot {
    origin: SnapshotOrigin,
    bytes: Vec<u8>,
}

/// Reason why a snapshot does not fit an instance. Prints the difference and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SnapshotError {
    /// The snapshot is of another plugin.
    #[error("the snapshot is of `{saved}`, not of `{id}`; use a snapshot of `{id}`")]
    OtherPlugin {
        /// Id of the plugin of the snapshot.
        saved: String,
        /// Id of the plugin of the instance.
        id: String,
    },
    /// The snapshot is of another version of the plugin.
    #[error("the snapshot is of `{id}` {saved}, this is `{id}` {present}; save the state with this version")]
    OtherVersion {
        /// Id of the plugin.
        id: String,
        /// Version of the plugin of the snapshot.
        saved: String,
        /// Version of the plugin of the instance.
        present: String,
    },
    /// The loop of the instance has another period or seed.
    #[error(
        "the snapshot of `{id}` is of a loop with a period of {saved_ns} ns and seed {saved_seed}, this loop has \
         {period_ns} ns and seed {seed}; use the rate and the seed of the snapshot"
    )]
    OtherLoop {
        /// Id of the plugin.
        id: String,
        /// Period of the saved loop, ns.
        saved_ns: u64,
        /// Seed of the saved loop.
        saved_seed: u64,
        /// Period of this loop, ns.
        period_ns: u64,
        /// Seed of this loop.
        seed: u64,
    },
    /// A parameter of the instance has another value.
    #[error(
        "the snapshot of `{id}` was saved with {parameter} = {saved}, now it is {present}; set {parameter} to {saved}"
    )]
    OtherParameter {
        /// Id of the plugin.
        id: String,
        /// Id of the first differing parameter.
        parameter: String,
        /// Value in the snapshot; `nothing` if the plugin had no such parameter.
        saved: String,
        /// Value of the instance; `nothing` if the plugin has no such parameter.
        present: String,
    },
    /// The plugin failed, or the bytes are not a state of this instance.
    #[error("`{id}` does not accept the bytes of the snapshot; save the state again")]
    Rejected {
        /// Id of the plugin.
        id: String,
    },
}

impl SnapshotOrigin {
    /// Returns the origin of an instance in a loop.
    #[must_use]
    pub(super) fn new(
        id: &str,
        version: &str,
        config: &LoopConfig,
        parameters: Vec<(String, String)>,
    ) -> Self {
        let LoopConfig { period_ns, seed } = *config;
        Self { id: id.to_owned(), version: version.to_owned(), period_ns, seed, parameters }
    }
}

impl Snapshot {
    /// Joins saved bytes with their origin.
    #[must_use]
    pub(super) fn new(origin: SnapshotOrigin, bytes: Vec<u8>) -> Self {
        Self { origin, bytes }
    }

    /// Returns the bytes for an instance of the same origin.
    ///
    /// # Errors
    /// [`SnapshotError`] with the first difference.
    pub(super) fn bytes_for(&self, present: &SnapshotOrigin) -> Result<&[u8], SnapshotError> {
        let SnapshotOrigin { id: saved, version, period_ns, seed, parameters } = &self.origin;
        let id = present.id.clone();
        if *saved != id {
            return Err(SnapshotError::OtherPlugin { saved: saved.clone(), id });
        }
        if *version != present.version {
            let (saved, present) = (version.clone(), present.version.clone());
            return Err(SnapshotError::OtherVersion { id, saved, present });
        }
        if (*period_ns, *seed) != (present.period_ns, present.seed) {
            return Err(SnapshotError::OtherLoop {
                id,
                saved_ns: *period_ns,
                saved_seed: *seed,
                period_ns: present.period_ns,
                seed: present.seed,
            });
        }
        match first_difference(parameters, &present.parameters) {
            Some((parameter, saved, present)) => {
                Err(SnapshotError::OtherParameter { id, parameter, saved, present })
            }
            None => Ok(&self.bytes),
        }
    }
}

/// Returns the first parameter that differs, with both values.
fn first_difference(
    saved: &[(String, String)],
    present: &[(String, String)],
) -> Option<(String, String, String)> {
    let nothing = || "nothing".to_owned();
    let value = |parameters: &[(String, String)], wanted: &str| {
        let found = parameters.iter().find(|(id, _)| id == wanted);
        found.map_or_else(nothing, |(_, value)| value.clone())
    };
    let ids = saved.iter().chain(present).map(|(id, _)| id);
    ids.map(|id| (id.clone(), value(saved, id), value(present, id)))
        .find(|(_, saved, present)| saved != present)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn origin() -> SnapshotOrigin {
        let parameters = [("stiffness_n_per_m", "2000"), ("friction", "0.5")];
        let parameters = parameters.map(|(id, value)| (id.to_owned(), value.to_owned())).to_vec();
        SnapshotOrigin::new("wall", "0.1.0", &LoopConfig { period_ns: 1_000_000, seed: 1 }, parameters)
    }

    #[test]
    fn only_an_instance_of_the_same_origin_gets_the_bytes() {
        let snapshot = Snapshot::new(origin(), vec![1, 2, 3]);
        assert_eq!(snapshot.bytes_for(&origin()), Ok(&[1, 2, 3][..]));
        let other = |change: fn(&mut SnapshotOrigin)| {
            let mut present = origin();
            change(&mut present);
            snapshot.bytes_for(&present).expect_err("it differs").to_string()
        };
        let cases = [
            (other(|present| present.id = "load".to_owned()), "is of `wall`, not of `load`"),
            (other(|present| present.version = "0.2.0".to_owned()), "`wall` 0.1.0, this is `wall` 0.2.0"),
            (other(|present| present.period_ns = 250_000), "this loop has 250000 ns"),
            (other(|present| present.seed = 2), "this loop has 1000000 ns and seed 2"),
            (
                other(|present| present.parameters[1].1 = "0.25".to_owned()),
                "friction = 0.5, now it is 0.25; set friction to 0.5",
            ),
            (other(|present| drop(present.parameters.pop())), "friction = 0.5, now it is nothing"),
        ];
        for (text, words) in cases {
            assert!(text.contains(words) && !text.contains('\n'), "{text}");
        }
    }
}
