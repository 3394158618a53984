//! Detection of force that no command of this session explains.
//!
//! The service adds up the forces of all its sessions, so another program can push the hand beyond every limit of this
//! session. A device may delay, limit and fade the commanded force, but each component of its force then lies between zero
//! and a recently commanded component. A component outside is the force of another program.

use flotor_hal::DVec3;

/// Length of the command history, messages: a service fades unrenewed commands within 0.1 s, 100 messages at 1 kHz.
const MESSAGES: u32 = 200;
/// Number of consecutive unexplained samples that count as a fault; fewer may be noise.
const SAMPLES: u32 = 3;

/// Smallest and largest components of commands, and zero, N.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Extent {
    least_n: DVec3,
    most_n: DVec3,
}

impl Extent {
    const NONE: Self = Self { least_n: DVec3::ZERO, most_n: DVec3::ZERO };

    fn with(self, force_n: DVec3) -> Self {
        Self { least_n: self.least_n.min(force_n), most_n: self.most_n.max(force_n) }
    }

    fn and(self, other: Self) -> Self {
        self.with(other.least_n).with(other.most_n)
    }
}

/// Detector of force that other programs command on the device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForeignForce {
    tolerance_n: f64,
    /// Extents of the commands in the current and the previous [`MESSAGES`].
    newest: Extent,
    older: Extent,
    messages: u32,
    unexplained: u32,
}

impl ForeignForce {
    /// Creates a detector without commands; `tolerance_n` (N) is the largest deviation of a component from the range of
    /// recent commands.
    #[must_use]
    pub fn new(tolerance_n: f64) -> Self {
        Self { tolerance_n, newest: Extent::NONE, older: Extent::NONE, messages: 0, unexplained: 0 }
    }

    /// Records a command and the force exerted by the device, N; returns true if the last three exerted forces were
    /// outside the range of recent commands. Real-time: bounded, no allocation.
    pub fn is_there(&mut self, commanded_n: DVec3, exerted_n: DVec3) -> bool {
        self.newest = self.newest.with(commanded_n);
        self.messages += 1;
        if self.messages == MESSAGES {
            (self.older, self.newest, self.messages) = (self.newest, Extent::NONE.with(commanded_n), 0);
        }
        let Extent { least_n, most_n } = self.newest.and(self.older);
        let is_explained = exerted_n.cmpge(least_n - self.tolerance_n).all()
            && exerted_n.cmple(most_n + self.tolerance_n).all();
        self.unexplained = if is_explained { 0 } else { self.unexplained + 1 };
        self.unexplained >= SAMPLES
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fades_lags_or_is_limited_is_our_own() {
        let mut foreign = ForeignForce::new(0.1);
        for step in 0..2000 {
            // A force that turns round; the device gives two thirds of the one 80 messages ago.
            let at = |step: i32| {
                let (sine, cosine) = (f64::from(step) * 0.02).sin_cos();
                DVec3::new(3.0 * sine, 2.0 * cosine, -1.0)
            };
            assert!(!foreign.is_there(at(step), at((step - 80).max(0)) * (2.0 / 3.0)), "{step}");
        }
        // Zero is commanded: what is still there fades.
        for step in 0..100 {
            assert!(
                !foreign.is_there(DVec3::ZERO, DVec3::new(0.0, 2.0, -1.0) * (1.0 - f64::from(step) / 100.0))
            );
        }
    }

    #[test]
    fn another_push_is_noticed_at_the_third_sample_and_an_old_command_explains_nothing() {
        let mut foreign = ForeignForce::new(0.1);
        let own_n = DVec3::new(0.0, 0.0, 1.0);
        let noticed = (0..10).find(|_| foreign.is_there(own_n, own_n + DVec3::X));
        assert_eq!(noticed, Some(2));
        let mut foreign = ForeignForce::new(0.1);
        assert!(!foreign.is_there(own_n, own_n));
        let noticed = (0..1000).find(|_| foreign.is_there(DVec3::ZERO, own_n));
        assert!(noticed.is_some_and(|message| message <= 2 * MESSAGES + SAMPLES), "{noticed:?}");
    }
}
