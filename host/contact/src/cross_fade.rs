//! Cross-fade between successive linear fields, so that the force has no steps.

use flotor_hal::{LinearField, Pose, Wrench};

/// Bilateral part of published sets: the two newest fields and the fade between them.
#[derive(Clone, Copy, Debug)]
pub struct CrossFade {
    old: LinearField,
    new: LinearField,
    /// Arrival of the new field, ns.
    since_ns: u64,
    fade_ns: u64,
}

impl CrossFade {
    /// Creates a cross-fade without force; each field fades in over `fade_ns`.
    #[must_use]
    pub fn new(fade_ns: u64) -> Self {
        Self { old: LinearField::NONE, new: LinearField::NONE, since_ns: 0, fade_ns }
    }

    /// Resets to no force. Real-time: bounded, no allocation.
    pub fn clear(&mut self) {
        *self = Self::new(self.fade_ns);
    }

    /// Starts the fade to a new field. The old field is re-anchored at `pose` with the present wrench, so that the force does not
    /// jump even if the last fade is not over. Real-time: bounded, no allocation.
    pub fn take(&mut self, field: LinearField, pose: &Pose, now_ns: u64) {
        let share = self.share(now_ns);
        let (wrench, _) = self.at(pose, now_ns);
        let mut stiffness = self.old.stiffness;
        for (row, new_row) in stiffness.iter_mut().zip(&self.new.stiffness) {
            for (old, new) in row.iter_mut().zip(new_row) {
                *old += share * (new - *old);
            }
        }
        // The old field is in use until the new one has faded in.
        let before = if share < 1.0 { &self.old } else { &self.new };
        self.old = LinearField {
            anchor: *pose,
            wrench,
            stiffness,
            valid_m: before.valid_m.min(self.new.valid_m),
            valid_rad: before.valid_rad.min(self.new.valid_rad),
            time_ns: self.new.time_ns,
        };
        (self.new, self.since_ns) = (field, now_ns);
    }

    /// Returns the wrench at a pose, and true if the fields in use are valid at the pose. Real-time: bounded, no allocation.
    #[must_use]
    pub fn at(&self, pose: &Pose, now_ns: u64) -> (Wrench, bool) {
        let share = self.share(now_ns);
        let (new, is_new_valid) = self.new.at(pose);
        if share >= 1.0 {
            return (new, is_new_valid);
        }
        let (old, is_old_valid) = self.old.at(pose);
        (old * (1.0 - share) + new * share, is_old_valid && is_new_valid)
    }

    /// Returns the weight of the new field, 0 to 1.
    fn share(&self, now_ns: u64) -> f64 {
        let passed_ns = now_ns.saturating_sub(self.since_ns);
        if passed_ns >= self.fade_ns { 1.0 } else { passed_ns as f64 / self.fade_ns as f64 }
    }
}

#[cfg(test)]
mod tests;
