//! Gains of each axis in each set, and the PIDF law.

use flotor_maglev::ml_api::{Axis, Gain, GainSet, Pid, Status};

/// Gains of the public client of the University of Utah; a real controller may start with others.
const NORMAL: [[f32; 3]; 6] = [
    [2400.0, 15.0, 0.0],
    [2400.0, 15.0, 0.0],
    [10_000.0, 15.0, 3.5],
    [50.0, 0.15, 0.0],
    [50.0, 0.15, 0.0],
    [10.0, 0.15, 0.0],
];
const STIFF: [[f32; 3]; 6] = [
    [4800.0, 15.0, 0.0],
    [4800.0, 15.0, 0.0],
    [15_000.0, 15.0, 3.5],
    [50.0, 0.15, 0.0],
    [50.0, 0.15, 0.0],
    [15.0, 0.15, 0.0],
];

fn default_of(set: GainSet) -> [Pid; 6] {
    let table = if set == GainSet::Normal { NORMAL } else { STIFF };
    // The weight is compensated on free or locked axes; constraint and boundary gains are added to these.
    let carries = matches!(set, GainSet::Normal | GainSet::Locked);
    table.map(|[p, d, ff]| Pid { p, i: 0.0, d, ff: if carries { ff } else { 0.0 } })
}

/// All gain sets of a controller.
#[derive(Clone, Debug)]
pub(super) struct Gains {
    sets: [[Pid; 6]; 4],
}

impl Default for Gains {
    fn default() -> Self {
        Self { sets: GainSet::ALL.map(default_of) }
    }
}

impl Gains {
    pub(super) fn set(&self, set: GainSet) -> &[Pid; 6] {
        &self.sets[set as usize]
    }

    pub(super) fn of(&self, set: GainSet, axis: Axis) -> Pid {
        self.sets[set as usize][axis as usize]
    }

    pub(super) fn one(&self, set: GainSet, axis: Axis, gain: Gain) -> f32 {
        *self.of(set, axis).gain_mut(gain)
    }

    /// Sets the gains of the listed axes; if a gain is invalid, sets none and returns [`Status::GAIN_RANGE`].
    pub(super) fn take(&mut self, set: GainSet, gains: &[(Axis, Pid)]) -> Status {
        let legal = |pid: &Pid| {
            [pid.p, pid.i, pid.d].iter().all(|gain| gain.is_finite() && *gain >= 0.0) && pid.ff.is_finite()
        };
        if !gains.iter().all(|(_, pid)| legal(pid)) {
            return Status::GAIN_RANGE;
        }
        for (axis, pid) in gains {
            self.sets[set as usize][*axis as usize] = *pid;
        }
        Status::OK
    }

    /// Interpolates the gains of a set from `from` to the defaults, `share` from 0 to 1.
    pub(super) fn glide(&mut self, set: GainSet, from: &[Pid; 6], share: f32) {
        let mix = |from: f32, to: f32| if share >= 1.0 { to } else { from + (to - from) * share };
        for ((place, from), to) in self.sets[set as usize].iter_mut().zip(from).zip(default_of(set)) {
            *place = Pid {
                p: mix(from.p, to.p),
                i: mix(from.i, to.i),
                d: mix(from.d, to.d),
                ff: mix(from.ff, to.ff),
            };
        }
    }

    /// Returns the gains for a landing: the defaults, with the present feed-forward where it is not zero.
    pub(super) fn landing(&self) -> [Pid; 6] {
        let mut gains = default_of(GainSet::Normal);
        for (pid, carried) in gains.iter_mut().zip(self.set(GainSet::Normal)) {
            if carried.ff != 0.0 {
                pid.ff = carried.ff;
            }
        }
        gains
    }
}

/// Control error of an axis: m or rad, m/s or rad/s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AxisError {
    pub(super) off: f64,
    pub(super) speed_off: f64,
}

/// Returns force or torque of the PIDF law without the integral term, N or N·m.
pub(super) fn force(pid: Pid, error: AxisError) -> f64 {
    f64::from(pid.p) * error.off + f64::from(pid.d) * error.speed_off + f64::from(pid.ff)
}
