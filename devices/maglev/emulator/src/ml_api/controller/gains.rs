//! Gains of each axis in each set, and what they make of an error.

use flotor_maglev::ml_api::{Axis, Gain, GainSet, Pid, Status};

/// Gains of the public client of the University of Utah, which may or may not be those a controller starts with.
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
    // The weight is carried where an axis is free or locked; constraint and boundary come on top of that.
    let carries = matches!(set, GainSet::Normal | GainSet::Locked);
    table.map(|[p, d, ff]| Pid { p, i: 0.0, d, ff: if carries { ff } else { 0.0 } })
}

/// All gains of a controller.
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

    /// Takes gains of some axes: all of them or, if one is not legal, none.
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

    /// Part of the way from some gains to the defaults of a set, 0 to 1.
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

    /// Gains to let the flotor down with: those it starts with, and the feed-forward that carries it now.
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

/// How far an axis is from where it should be: m or rad, m/s or rad/s.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AxisError {
    pub(super) off: f64,
    pub(super) speed_off: f64,
}

/// Force or torque of the PIDF law without its integral, N or N·m.
pub(super) fn force(pid: Pid, error: AxisError) -> f64 {
    f64::from(pid.p) * error.off + f64::from(pid.d) * error.speed_off + f64::from(pid.ff)
}
