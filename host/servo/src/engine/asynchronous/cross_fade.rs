//! Fields that come one after the other, made one force without a step.

use flotor_hal::{LinearField, Pose, Wrench};

/// The newest field and the one it takes over from.
pub(super) struct CrossFade {
    old: LinearField,
    new: LinearField,
    /// When the new one came, ns.
    since_ns: u64,
    fade_ns: u64,
}

impl CrossFade {
    /// No force; each field will come in over `fade_ns`.
    pub(super) fn new(fade_ns: u64) -> Self {
        Self { old: LinearField::NONE, new: LinearField::NONE, since_ns: 0, fade_ns }
    }

    /// Back to no force. Real-time: bounded, no allocation.
    pub(super) fn clear(&mut self) {
        *self = Self::new(self.fade_ns);
    }

    /// A field takes over from what is felt at a pose now, which goes on as a field of its own: nothing jumps, also if
    /// the one before has not come in wholly. Real-time: bounded, no allocation.
    pub(super) fn take(&mut self, field: LinearField, pose: &Pose, now_ns: u64) {
        let share = self.share(now_ns);
        let (wrench, _) = self.at(pose, now_ns);
        let mut stiffness = self.old.stiffness;
        for (row, new_row) in stiffness.iter_mut().zip(&self.new.stiffness) {
            for (old, new) in row.iter_mut().zip(new_row) {
                *old += share * (new - *old);
            }
        }
        self.old = LinearField {
            anchor: *pose,
            wrench,
            stiffness,
            valid_m: self.old.valid_m.min(self.new.valid_m),
            valid_rad: self.old.valid_rad.min(self.new.valid_rad),
            time_ns: self.new.time_ns,
        };
        (self.new, self.since_ns) = (field, now_ns);
    }

    /// The wrench at a pose now, and whether both fields may be believed there. Real-time: bounded, no allocation.
    pub(super) fn at(&self, pose: &Pose, now_ns: u64) -> (Wrench, bool) {
        let share = self.share(now_ns);
        let (new, is_new_valid) = self.new.at(pose);
        if share >= 1.0 {
            return (new, is_new_valid);
        }
        let (old, is_old_valid) = self.old.at(pose);
        (old * (1.0 - share) + new * share, is_old_valid && is_new_valid)
    }

    /// How far the new field has come in, 0 to 1.
    fn share(&self, now_ns: u64) -> f64 {
        let passed_ns = now_ns.saturating_sub(self.since_ns);
        if passed_ns >= self.fade_ns { 1.0 } else { passed_ns as f64 / self.fade_ns as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{DQuat, DVec3, Input};

    const MS: u64 = 1_000_000;

    fn field(force_n: f64, stiffness_n_per_m: f64) -> LinearField {
        let slope = [DVec3::ZERO, DVec3::ZERO, DVec3::NEG_Z * stiffness_n_per_m];
        LinearField::of_force(&Input::at_rest(Pose::HOME), DVec3::Z * force_n, slope, 0.01)
    }

    fn up(z_m: f64) -> Pose {
        Pose::new(DVec3::Z * z_m, DQuat::IDENTITY)
    }

    #[test]
    fn a_field_comes_in_evenly_and_is_alone_then() {
        let mut fade = CrossFade::new(4 * MS);
        fade.take(field(2.0, 0.0), &Pose::HOME, 10 * MS);
        for (ms, expected) in [(10, 0.0), (11, 0.5), (12, 1.0), (14, 2.0), (90, 2.0)] {
            let (wrench, _) = fade.at(&Pose::HOME, ms * MS);
            assert!((wrench.force().z - expected).abs() < 1.0e-12, "{ms} ms: {wrench:?}");
        }
    }

    #[test]
    fn whenever_a_field_comes_nothing_jumps() {
        let mut fade = CrossFade::new(5 * MS);
        // Fields of every kind, some before the last has come in, the handle moving all along.
        for (count, at_ms) in [0, 5, 7, 12, 13, 14, 30].into_iter().enumerate() {
            let (count, pose) = (count as f64, up(0.001 * at_ms as f64));
            let before = fade.at(&pose, at_ms * MS).0;
            fade.take(field(3.0 - 2.0 * count, 100.0 * count), &pose, at_ms * MS);
            let after = fade.at(&pose, at_ms * MS).0;
            assert!((before.force() - after.force()).length() < 1.0e-12, "at {at_ms} ms");
            // And what goes on is as stiff as what was.
            let slope = |pose: &Pose| fade.at(pose, at_ms * MS).0.force().z;
            assert!(slope(&up(pose.position().z + 1.0e-4)) <= slope(&pose) + 1.0e-12);
        }
    }

    #[test]
    fn beyond_either_field_it_says_so() {
        let mut fade = CrossFade::new(4 * MS);
        fade.take(field(1.0, 10.0), &Pose::HOME, 0);
        assert!(fade.at(&up(0.009), 2 * MS).1 && !fade.at(&up(0.011), 2 * MS).1);
    }
}
