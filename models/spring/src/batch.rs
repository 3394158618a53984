//! Vectorised evaluation of many independent poses, for sweeps and tables.
//!
//! Poses are stored one after the other, but a vector register needs the same component of several poses. So a batch reads
//! as many poses as two registers have lanes and transposes their numbers inside the registers, four by four, into one
//! register per component. The law runs over these registers; its outputs are transposed back and written, in one pass
//! without intermediate memory. The law is the code of the servo, over [`Wide`] instead of `f64`: the results, and the status
//! of every pose, equal those of single steps *bit for bit*.
//!
//! The instruction set is detected when the [`Batch`] is created (AVX-512, AVX2, NEON, or scalar).

use flotor_hal::{Input, Output, StepStatus, Wrench};
use pulp::{Arch, Simd, WithSimd, bytemuck};

use crate::contract;
use crate::pose::Coordinates;
use crate::response::{Demand, LaneResponse, Law, Response};
use flotor_lanes::{Pair, Real, Vector, Wide};

/// Number of lanes of two of the widest registers; a multiple of the lanes of two registers of any other instruction set.
const MOST_LANES: usize = 16;

/// Status of a lane's answer, as numbers in lanes.
const ANSWERED: f64 = 0.0;
const CLAMPED: f64 = 1.0;
const UNANSWERED: f64 = 2.0;

/// Evaluator of laws at many poses, with a given instruction set.
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct Batch {
    instructions: Arch,
}

impl Default for Batch {
    /// Creates an evaluator with the best instruction set of this machine. Not real-time.
    fn default() -> Self {
        Self::on(Arch::new())
    }
}

impl Batch {
    /// Creates an evaluator with a given instruction set, for comparisons.
    pub fn on(instructions: Arch) -> Self {
        Self { instructions }
    }

    /// Computes one output per input, equal to single steps. The shorter slice determines the number; further outputs stay
    /// unchanged. Real-time per pose: bounded, no allocation.
    pub fn respond<L: Law>(&self, law: &L, inputs: &[Input], outputs: &mut [Output]) {
        let count = inputs.len().min(outputs.len());
        let whole = count - count % MOST_LANES;
        let (inputs, rest) = inputs[..count].split_at(whole);
        let (outputs, rest_outputs) = outputs[..count].split_at_mut(whole);
        self.instructions.dispatch(Rows { law, inputs, outputs });
        if let Some(first) = rest.first() {
            let (mut inputs, mut outputs) = ([*first; MOST_LANES], [Output::default(); MOST_LANES]);
            inputs[..rest.len()].copy_from_slice(rest);
            self.instructions.dispatch(Rows { law, inputs: &inputs, outputs: &mut outputs });
            rest_outputs.copy_from_slice(&outputs[..rest.len()]);
        }
    }
}

/// Law at a multiple of [`MOST_LANES`] poses, with as many outputs.
struct Rows<'a, L> {
    law: &'a L,
    inputs: &'a [Input],
    outputs: &'a mut [Output],
}

impl<L: Law> WithSimd for Rows<'_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { law, inputs, outputs } = self;
        let lanes = 2 * S::F64_LANES;
        for (inputs, outputs) in inputs.chunks_exact(lanes).zip(outputs.chunks_exact_mut(lanes)) {
            // Compute the widest demand for all lanes; `amend` reduces the others.
            let first = &inputs[0];
            let is_common =
                inputs.iter().fold(true, |is_common, input| is_common & (input.demand == first.demand));
            let demand = if is_common { contract::demand(first) } else { widest(inputs) };
            let answer = law.evaluate(&coordinates(simd, inputs), demand);
            let verdict = verdict(&answer);
            let energy_j = match L::HAS_ENERGY && demand >= Demand::WrenchAndEnergy {
                true => answer.energy_j,
                false => verdict.like(f64::NAN),
            };
            put(simd, &LaneResponse { energy_j, ..answer }, outputs);
            if !is_common || Pair::<Wide<S>>::any(verdict.above(ANSWERED)) {
                // Transposed back like the answers: lanes need not be in the sequence of the poses.
                let (first, second) = ([verdict.0.lanes(); 4], [verdict.1.lanes(); 4]);
                let turned = [simd.interleave_shfl_f64s(first), simd.interleave_shfl_f64s(second)];
                amend(inputs, outputs, bytemuck::cast_slice(&turned));
            }
        }
    }
}

/// Returns the union of the demands of all inputs.
#[cold]
fn widest(inputs: &[Input]) -> Demand {
    inputs.iter().map(contract::demand).max().unwrap_or(Demand::Force)
}

/// Loads poses, one into each lane of two registers.
#[inline(always)]
fn coordinates<S: Simd>(simd: S, inputs: &[Input]) -> Coordinates<Pair<Wide<S>>> {
    let (first, second) = inputs.split_at(S::F64_LANES);
    let ([x0, y0, z0, i0, j0, k0, w0], [x1, y1, z1, i1, j1, k1, w1]) =
        (components(simd, first), components(simd, second));
    let pair = |first, second| Pair(Wide::new(simd, first), Wide::new(simd, second));
    Coordinates {
        position_m: Vector::new(pair(x0, x1), pair(y0, y1), pair(z0, z1)),
        orientation: [pair(i0, i1), pair(j0, j1), pair(k0, k1), pair(w0, w1)],
    }
}

/// Loads position x, y, z and orientation x, y, z, w of a register of poses.
#[inline(always)]
fn components<S: Simd>(simd: S, inputs: &[Input]) -> [S::f64s; 7] {
    let mut halves = [[simd.splat_f64s(0.0); 4]; 2];
    let [positions, orientations] = &mut halves;
    let positions: &mut [[f64; 4]] = bytemuck::cast_slice_mut(positions);
    let orientations: &mut [[f64; 4]] = bytemuck::cast_slice_mut(orientations);
    for ((position, orientation), input) in positions.iter_mut().zip(orientations).zip(inputs) {
        let ([x, y, z], [next, ..]) = (input.pose.position_m, input.pose.orientation_xyzw);
        // One load of four adjacent numbers; the fourth is unused.
        *position = [x, y, z, next];
        *orientation = input.pose.orientation_xyzw;
    }
    let [positions, orientations] = halves;
    let [x, y, z, _] = simd.deinterleave_shfl_f64s(positions);
    let [qx, qy, qz, qw] = simd.deinterleave_shfl_f64s(orientations);
    [x, y, z, qx, qy, qz, qw]
}

/// Returns the status of each lane's answer.
#[inline(always)]
fn verdict<R: Real>(answer: &LaneResponse<R>) -> R {
    let like = answer.energy_j;
    let trust = R::select(answer.trusted, like.like(ANSWERED), like.like(CLAMPED));
    R::select(answer.answered, trust, like.like(UNANSWERED))
}

/// Writes outputs, one from each lane of two registers, all with status `Ok`.
#[inline(always)]
fn put<S: Simd>(simd: S, answer: &LaneResponse<Pair<Wide<S>>>, outputs: &mut [Output]) {
    let LaneResponse { force_n: force, torque_nm: torque, energy_j, .. } = answer;
    let (first, second) = outputs.split_at_mut(S::F64_LANES);
    let numbers = [force.x.0, force.y.0, force.z.0, torque.x.0, torque.y.0, torque.z.0, energy_j.0];
    put_register(simd, numbers, first);
    let numbers = [force.x.1, force.y.1, force.z.1, torque.x.1, torque.y.1, torque.z.1, energy_j.1];
    put_register(simd, numbers, second);
}

/// Writes outputs from one register: force, torque, energy.
#[inline(always)]
fn put_register<S: Simd>(simd: S, numbers: [Wide<S>; 7], outputs: &mut [Output]) {
    let [fx, fy, fz, tx, ty, tz, energy_j] = numbers;
    let first = simd.interleave_shfl_f64s([fx.lanes(), fy.lanes(), fz.lanes(), tx.lanes()]);
    let nothing = simd.splat_f64s(0.0);
    let second = simd.interleave_shfl_f64s([ty.lanes(), tz.lanes(), energy_j.lanes(), nothing]);
    let first: &[[f64; 4]] = bytemuck::cast_slice(&first);
    let second: &[[f64; 4]] = bytemuck::cast_slice(&second);
    for ((output, first), second) in outputs.iter_mut().zip(first).zip(second) {
        let ([fx, fy, fz, tx], [ty, tz, energy_j, _]) = (*first, *second);
        let wrench = Wrench { force_n: [fx, fy, fz], torque_nm: [tx, ty, tz] };
        *output = Output::new(wrench, energy_j, StepStatus::Ok);
    }
}

/// Sets the status of clamped and unanswered outputs, and removes parts that an input has not demanded.
#[cold]
fn amend(inputs: &[Input], outputs: &mut [Output], verdicts: &[[f64; 4]]) {
    for ((input, output), [verdict, ..]) in inputs.iter().zip(outputs).zip(verdicts) {
        if *verdict == UNANSWERED {
            *output = contract::output(&Response::none(contract::pose(input).failure_reason()));
            continue;
        }
        let demand = contract::demand(input);
        let Output { mut wrench, mut energy_j, .. } = *output;
        if demand < Demand::Wrench {
            wrench.torque_nm = [0.0; 3];
        }
        if demand < Demand::WrenchAndEnergy {
            energy_j = f64::NAN;
        }
        let status = if *verdict == CLAMPED { StepStatus::Clamped } else { StepStatus::Ok };
        *output = Output::new(wrench, energy_j, status);
    }
}
