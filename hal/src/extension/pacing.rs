//! Devices that set the pace: the loop waits for their next sample, not for a clock.

/// Who decides when a tick begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pacing {
    /// The host's clock; `read` gives the newest sample, whenever it was taken.
    Host,
    /// The host's clock, or the device: then [`crate::ActiveDevice::wait_for_sample`] is called before each `read`.
    Device,
}

/// What came of waiting for a sample.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleWait {
    /// The device does not set the pace.
    NotPaced,
    /// No sample came in time.
    TimedOut,
    /// A sample is there to be read.
    Arrived {
        /// Samples taken since the last wait that ended so: 1 on time, more if some came and went unseen.
        samples: u64,
    },
}

impl SampleWait {
    /// Number of samples that crosses the boundary; 0 for a wait in vain.
    pub(crate) const fn samples(self) -> u64 {
        match self {
            Self::NotPaced | Self::TimedOut => 0,
            Self::Arrived { samples } => samples,
        }
    }
}
