//! Encoding of requests and replies in shared memory.

use super::memory::SharedPage;
pub(super) use crate::platform::shared_memory::wait_for_change;
use crate::platform::shared_memory::wake;
use flotor_core::grip::{self, GripRecord};
use flotor_core::sent::{SentInput, SentSet};
use flotor_core::words::{Decoder, Encoder};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ActiveRegion, ContactSet, Input, Output, RegionShape, StepStatus, WorkspaceBounds, Wrench};
use flotor_sync::Words;
use std::sync::atomic::{AtomicU64, Ordering};

/// Operation that the host requests of a worker.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub(super) enum Operation {
    Step,
    SetParameter,
    Reset,
    LocalModel,
}

impl Operation {
    const ALL: [Self; 4] = [Self::Step, Self::SetParameter, Self::Reset, Self::LocalModel];
}

impl SharedPage {
    /// Host side: sends a request under a new number. Real-time: one system call.
    pub(super) fn ask(&self, number: u32, operation: Operation) {
        self.operation.store(operation as u32, Ordering::Relaxed);
        // Release: a worker that reads the number also reads the request.
        self.request.store(number, Ordering::Release);
        wake(&self.request);
    }

    /// Host side: returns true if the request with this number has a reply.
    pub(super) fn is_answered(&self, number: u32) -> bool {
        self.reply.load(Ordering::Acquire) == number
    }

    /// Worker side: returns the requested operation; `None` for an unknown code.
    pub(super) fn operation(&self) -> Option<Operation> {
        let code = self.operation.load(Ordering::Relaxed);
        Operation::ALL.into_iter().find(|operation| *operation as u32 == code)
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
        store(&self.input, SentInput(*input).to_words());
    }

    pub(super) fn input(&self) -> Input {
        SentInput::from_words(&load(&self.input)).0
    }

    pub(super) fn put_output(&self, output: &Output) {
        // A status outside the contract is encoded as a non-finite wrench: neither is usable.
        let (wrench, status) = match output.status() {
            Some(status) => (output.wrench, status),
            None => (NOT_USABLE, StepStatus::Ok),
        };
        let words =
            Encoder::of_zeros().wrench(&wrench).numbers([output.energy_j]).words([status as u64]).finish();
        store(&self.output, words);
    }

    pub(super) fn output(&self) -> Output {
        let words = load(&self.output);
        let mut words = Decoder::of(&words);
        let (wrench, [energy_j]) = (words.wrench(), words.numbers());
        let status = u32::try_from(words.word()).ok().and_then(StepStatus::from_code);
        let (wrench, status) = status.map_or((NOT_USABLE, StepStatus::Ok), |status| (wrench, status));
        Output::new(wrench, energy_j, status)
    }

    pub(super) fn put_grip(&self, grip: Option<GripRecord>) {
        store(&self.grip, grip::to_words(grip));
    }

    pub(super) fn grip(&self) -> Option<GripRecord> {
        grip::from_words(load(&self.grip))
    }

    pub(super) fn put_region(&self, region: &ActiveRegion) {
        let shape = match region.shape() {
            RegionShape::Everywhere => 0,
            RegionShape::Sphere => 1,
            RegionShape::Box => 2,
        };
        let (center_m, half_sides_m) = (region.center().to_array(), region.half_sides().to_array());
        let words = Encoder::of_zeros().words([shape]).numbers(center_m).numbers(half_sides_m).finish();
        store(&self.region, words);
    }

    pub(super) fn region(&self) -> ActiveRegion {
        let words = load(&self.region);
        let mut words = Decoder::of(&words);
        let (shape, center_m, half_sides_m) = (words.word(), words.numbers(), words.numbers::<3>());
        let [radius_m, ..] = half_sides_m;
        // Invalid numbers mean everywhere, too.
        match shape {
            1 => ActiveRegion::sphere(center_m, radius_m),
            2 => ActiveRegion::cuboid(center_m, half_sides_m),
            _ => ActiveRegion::EVERYWHERE,
        }
    }

    pub(super) fn put_bounds(&self, bounds: &WorkspaceBounds) {
        let [lower_m, upper_m] = bounds.ends_m();
        store(&self.bounds, Encoder::of_zeros().numbers(lower_m).numbers(upper_m).finish());
    }

    pub(super) fn bounds(&self) -> WorkspaceBounds {
        let words = load(&self.bounds);
        let mut words = Decoder::of(&words);
        WorkspaceBounds::between(words.numbers(), words.numbers())
    }

    pub(super) fn put_contact_set(&self, set: &ContactSet) {
        store(&self.contact_set, SentSet(*set).to_words());
    }

    pub(super) fn contact_set(&self) -> ContactSet {
        SentSet::from_words(&load(&self.contact_set)).0
    }
}

const NOT_USABLE: Wrench = Wrench { force_n: [f64::NAN; 3], torque_nm: [f64::NAN; 3] };

fn store<const N: usize>(slots: &[AtomicU64; N], words: [u64; N]) {
    slots.iter().zip(words).for_each(|(slot, word)| slot.store(word, Ordering::Relaxed));
}

fn load<const N: usize>(slots: &[AtomicU64; N]) -> [u64; N] {
    slots.each_ref().map(|slot| slot.load(Ordering::Relaxed))
}

#[cfg(test)]
mod tests;
