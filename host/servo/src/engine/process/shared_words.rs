//! Encoding of requests and replies in shared memory.

use super::memory::{BOUNDS_WORDS, INPUT_WORDS, OUTPUT_WORDS, REGION_WORDS, SharedPage};
use crate::engine::field_words::Sent;
pub(super) use crate::platform::shared_memory::wait_for_change;
use crate::platform::shared_memory::wake;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    ActiveRegion, Demand, Input, LinearField, Output, Pose, RegionShape, StepStatus, Twist, WorkspaceBounds,
    Wrench,
};
use flotor_sync::Words;
use std::sync::atomic::{AtomicU64, Ordering};

/// Operation that the host requests of a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operation {
    Step,
    SetParameter,
    Reset,
    Field,
}

impl Operation {
    const fn code(self) -> u32 {
        match self {
            Self::Step => 0,
            Self::SetParameter => 1,
            Self::Reset => 2,
            Self::Field => 3,
        }
    }

    const fn from_code(code: u32) -> Option<Self> {
        Some(match code {
            0 => Self::Step,
            1 => Self::SetParameter,
            2 => Self::Reset,
            3 => Self::Field,
            _ => return None,
        })
    }
}

impl SharedPage {
    /// Host side: sends a request under a new number. Real-time: one system call.
    pub(super) fn ask(&self, number: u32, operation: Operation) {
        self.operation.store(operation.code(), Ordering::Relaxed);
        // Release: a worker that reads the number also reads the request.
        self.request.store(number, Ordering::Release);
        wake(&self.request);
    }

    /// Host side: returns true if the request is answered.
    pub(super) fn is_answered(&self, number: u32) -> bool {
        self.reply.load(Ordering::Acquire) == number
    }

    /// Worker side: returns the requested operation; `None` for an unknown code.
    pub(super) fn operation(&self) -> Option<Operation> {
        Operation::from_code(self.operation.load(Ordering::Relaxed))
    }

    /// Worker side: sends the reply to a request.
    pub(super) fn answer(&self, number: u32, status: CallStatus) {
        self.status.store(status as u32, Ordering::Relaxed);
        self.reply.store(number, Ordering::Release);
        wake(&self.reply);
    }

    pub(super) fn status(&self) -> CallStatus {
        CallStatus::from_code(self.status.load(Ordering::Relaxed))
    }

    pub(super) fn put_message(&self, text: &str) {
        let bytes = text.as_bytes().iter().zip(&self.message);
        let len = bytes.map(|(byte, slot)| slot.store(*byte, Ordering::Relaxed)).count();
        self.message_len.store(u32::try_from(len).unwrap_or(0), Ordering::Relaxed);
    }

    pub(super) fn message(&self) -> String {
        let len = self.message_len.load(Ordering::Relaxed) as usize;
        let bytes: Vec<u8> = self.message.iter().take(len).map(|byte| byte.load(Ordering::Relaxed)).collect();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    pub(super) fn put_input(&self, input: &Input) {
        let mut words = self.input.iter();
        let mut put = |word: u64| {
            if let Some(slot) = words.next() {
                slot.store(word, Ordering::Relaxed);
            }
        };
        let numbers = [&input.pose.position_m[..], &input.pose.orientation_xyzw];
        let rates = [&input.twist.linear_m_per_s[..], &input.twist.angular_rad_per_s];
        numbers.into_iter().chain(rates).flatten().for_each(|number| put(number.to_bits()));
        let demand =
            DEMANDS.iter().enumerate().map(|(bit, demand)| u64::from(input.demand.contains(*demand)) << bit);
        let demand: u64 = demand.sum();
        [input.time_ns, input.dt_ns, input.tick, u64::from(input.buttons) | demand << 32]
            .into_iter()
            .for_each(put);
    }

    pub(super) fn input(&self) -> Input {
        let words: [u64; INPUT_WORDS] = std::array::from_fn(|i| load(self.input.get(i)));
        let [px, py, pz, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz, time_ns, dt_ns, tick, flags] = words;
        let three = |a, b, c| [a, b, c].map(f64::from_bits);
        let is_demanded = |(bit, demand): (usize, &Demand)| (flags >> (32 + bit) & 1 == 1).then_some(*demand);
        let demands = DEMANDS.iter().enumerate().filter_map(is_demanded);
        #[allow(clippy::cast_possible_truncation)] // the lower half
        let buttons = flags as u32;
        Input {
            pose: Pose {
                position_m: three(px, py, pz),
                orientation_xyzw: [qx, qy, qz, qw].map(f64::from_bits),
            },
            twist: Twist { linear_m_per_s: three(vx, vy, vz), angular_rad_per_s: three(wx, wy, wz) },
            time_ns,
            dt_ns,
            tick,
            buttons,
            demand: demands.fold(NO_DEMAND, Demand::with),
        }
    }

    pub(super) fn put_output(&self, output: &Output) {
        // A status outside the contract is encoded as a non-finite wrench: neither is usable.
        let (wrench, status) = match output.status() {
            Some(status) => (output.wrench, status),
            None => (NOT_USABLE, StepStatus::Ok),
        };
        let numbers = wrench.force_n.into_iter().chain(wrench.torque_nm).chain([output.energy_j]);
        let words = numbers.map(f64::to_bits).chain([status as u64]);
        self.output.iter().zip(words).for_each(|(slot, word)| slot.store(word, Ordering::Relaxed));
    }

    pub(super) fn put_region(&self, region: &ActiveRegion) {
        let shape = match region.shape() {
            RegionShape::Everywhere => 0,
            RegionShape::Sphere => 1,
            RegionShape::Box => 2,
        };
        let numbers = region.center().to_array().into_iter().chain(region.half_sides().to_array());
        put(&self.region, [shape].into_iter().chain(numbers.map(f64::to_bits)));
    }

    pub(super) fn region(&self) -> ActiveRegion {
        let words: [u64; REGION_WORDS] = std::array::from_fn(|i| load(self.region.get(i)));
        let [shape, cx, cy, cz, hx, hy, hz] = words;
        let [center_m, half_sides_m] = [[cx, cy, cz], [hx, hy, hz]].map(|three| three.map(f64::from_bits));
        let [radius_m, ..] = half_sides_m;
        // Invalid numbers mean everywhere, too.
        match shape {
            1 => ActiveRegion::sphere(center_m, radius_m),
            2 => ActiveRegion::cuboid(center_m, half_sides_m),
            _ => ActiveRegion::EVERYWHERE,
        }
    }

    pub(super) fn put_bounds(&self, bounds: &WorkspaceBounds) {
        put(&self.bounds, bounds.ends_m().into_iter().flatten().map(f64::to_bits));
    }

    pub(super) fn bounds(&self) -> WorkspaceBounds {
        let words: [u64; BOUNDS_WORDS] = std::array::from_fn(|i| load(self.bounds.get(i)));
        let [lx, ly, lz, ux, uy, uz] = words.map(f64::from_bits);
        WorkspaceBounds::between([lx, ly, lz], [ux, uy, uz])
    }

    pub(super) fn put_field(&self, field: &LinearField) {
        put(&self.field, Sent(*field).to_words().into_iter());
    }

    pub(super) fn field(&self) -> LinearField {
        Sent::from_words(&std::array::from_fn(|i| load(self.field.get(i)))).0
    }

    pub(super) fn output(&self) -> Output {
        let words: [u64; OUTPUT_WORDS] = std::array::from_fn(|i| load(self.output.get(i)));
        let [fx, fy, fz, tx, ty, tz, energy_j, status] = words;
        let three = |a, b, c| [a, b, c].map(f64::from_bits);
        let wrench = Wrench { force_n: three(fx, fy, fz), torque_nm: three(tx, ty, tz) };
        let status = u32::try_from(status).ok().and_then(StepStatus::from_code);
        let (wrench, status) = status.map_or((NOT_USABLE, StepStatus::Ok), |status| (wrench, status));
        Output::new(wrench, f64::from_bits(energy_j), status)
    }
}

const NOT_USABLE: Wrench = Wrench { force_n: [f64::NAN; 3], torque_nm: [f64::NAN; 3] };

pub(super) const NO_DEMAND: Demand = Demand::FORCE.limited_to(Demand::TORQUE);

/// Demands in the order of their bits in the shared memory.
pub(super) const DEMANDS: [Demand; 3] = [Demand::FORCE, Demand::TORQUE, Demand::ENERGY];

/// Encodes a field as words.
fn put(slots: &[AtomicU64], words: impl Iterator<Item = u64>) {
    slots.iter().zip(words).for_each(|(slot, word)| slot.store(word, Ordering::Relaxed));
}

fn load(word: Option<&AtomicU64>) -> u64 {
    word.map_or(0, |word| word.load(Ordering::Relaxed))
}

#[cfg(test)]
mod tests;
