//! Many independent poses at once: the fast path for sweeps and tables.
//!
//! Poses come one after the other; a vector register wants the same component of several. So a block of them is
//! laid out component by component (a structure of arrays), the law runs over the block a register at a time, and
//! the answers are put back in order. The law is the very code the servo runs, over [`Wide`] instead of `f64`
//! ([`crate::real`]): the results, and the status of every pose, are those of single steps, *bit for bit*.
//!
//! The instruction set is found when the [`Batch`] is made (AVX-512, AVX2, NEON, or one number at a time).

use flotor_hal::{Input, Output, StepStatus, Wrench};
use pulp::{Arch, Simd, WithSimd};

use crate::contract;
use crate::pose::Coordinates;
use crate::real::{Pair, Real, Vector, Wide};
use crate::response::{Answer, Demand, Law, Response};

/// Poses laid out at a time: an even multiple of every register's lanes, and small enough for the first-level cache.
const BLOCK: usize = 64;

const COORDINATES: usize = 7;
const ANSWERS: usize = 8;

/// Verdicts on a lane, as numbers because that is what lanes hold.
const ANSWERED: f64 = 0.0;
const CLAMPED: f64 = 1.0;
const UNANSWERED: f64 = 2.0;

/// Evaluates laws at many poses.
#[derive(Clone, Copy, Debug)]
pub struct Batch {
    instructions: Arch,
}

impl Default for Batch {
    fn default() -> Self {
        Self::on(Arch::new())
    }
}

impl Batch {
    /// With the best instruction set of this machine. Not real-time.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// With a given instruction set, to compare them.
    #[must_use]
    pub fn on(instructions: Arch) -> Self {
        Self { instructions }
    }

    /// One answer per input, as by single steps; surplus of either slice is left alone. Real-time per pose:
    /// bounded, no allocation.
    pub fn respond<L: Law>(&self, law: &L, inputs: &[Input], outputs: &mut [Output]) {
        let mut block = Block::new();
        for (inputs, outputs) in inputs.chunks(BLOCK).zip(outputs.chunks_mut(BLOCK)) {
            // The widest demand of the block serves all; narrower ones get their share of it.
            let demand = inputs.iter().map(contract::demand).max().unwrap_or(Demand::Force);
            block.load(inputs);
            self.instructions.dispatch(Evaluate { law, demand, count: inputs.len(), block: &mut block });
            block.store::<L>(inputs, outputs);
        }
    }
}

/// Poses and answers, component by component.
struct Block {
    /// Position x, y, z; orientation x, y, z, w.
    coordinates: [[f64; BLOCK]; COORDINATES],
    /// Force x, y, z; torque x, y, z; energy; verdict.
    answers: [[f64; BLOCK]; ANSWERS],
}

impl Block {
    /// All poses at home: lanes without an input are evaluated too, and must cost no more than others.
    fn new() -> Self {
        let mut coordinates = [[0.0; BLOCK]; COORDINATES];
        coordinates[COORDINATES - 1] = [1.0; BLOCK];
        Self { coordinates, answers: [[0.0; BLOCK]; ANSWERS] }
    }

    /// Lays out the poses of at most a block of inputs.
    #[inline]
    fn load(&mut self, inputs: &[Input]) {
        let [x, y, z, qx, qy, qz, qw] = &mut self.coordinates;
        // Bounds the compiler can see: no check per number.
        for index in 0..inputs.len().min(BLOCK) {
            let pose = &inputs[index].pose;
            [x[index], y[index], z[index]] = pose.position_m;
            [qx[index], qy[index], qz[index], qw[index]] = pose.orientation_xyzw;
        }
    }

    /// Puts the answers in order, each narrowed to what its input demands.
    #[inline]
    fn store<L: Law>(&self, inputs: &[Input], outputs: &mut [Output]) {
        let [fx, fy, fz, tx, ty, tz, energy, verdict] = &self.answers;
        for index in 0..inputs.len().min(outputs.len()).min(BLOCK) {
            let status = if verdict[index] == ANSWERED {
                StepStatus::Ok
            } else if verdict[index] == CLAMPED {
                StepStatus::Clamped
            } else {
                let why = contract::pose(&inputs[index]).why_unanswered();
                outputs[index] = contract::output(&Response::none(why));
                continue;
            };
            let demand = contract::demand(&inputs[index]);
            let force_n = [fx[index], fy[index], fz[index]];
            let with_torque = demand >= Demand::Wrench;
            let torque_nm = if with_torque { [tx[index], ty[index], tz[index]] } else { [0.0; 3] };
            let with_energy = L::HAS_ENERGY && demand >= Demand::WrenchAndEnergy;
            let energy_j = if with_energy { energy[index] } else { f64::NAN };
            outputs[index] = Output::new(Wrench { force_n, torque_nm }, energy_j, status);
        }
    }
}

/// A law over the first poses of a block.
struct Evaluate<'a, L> {
    law: &'a L,
    demand: Demand,
    count: usize,
    block: &'a mut Block,
}

impl<L: Law> WithSimd for Evaluate<'_, L> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { law, demand, count, block } = self;
        let [x, y, z, qx, qy, qz, qw] = block.coordinates.each_ref().map(|lanes| S::as_simd_f64s(lanes).0);
        let [fx, fy, fz, tx, ty, tz, energy, verdict] =
            block.answers.each_mut().map(|lanes| S::as_mut_simd_f64s(lanes).0);
        // Macros, not closures: those are compiled without the wide instructions.
        macro_rules! pair {
            ($lanes:ident, $i:expr) => {
                Pair(Wide::new(simd, $lanes[$i]), Wide::new(simd, $lanes[$i + 1]))
            };
        }
        macro_rules! keep {
            ($number:expr => $lanes:ident, $i:expr) => {{
                let Pair(first, second) = $number;
                [$lanes[$i], $lanes[$i + 1]] = [first.lanes(), second.lanes()];
            }};
        }
        for i in (0..count.div_ceil(S::F64_LANES)).step_by(2) {
            let at = Coordinates {
                position_m: Vector::new(pair!(x, i), pair!(y, i), pair!(z, i)),
                orientation: [pair!(qx, i), pair!(qy, i), pair!(qz, i), pair!(qw, i)],
            };
            let Answer { force_n, torque_nm, energy_j, answered, trusted } = law.answer(&at, demand);
            let trust = Pair::select(trusted, energy_j.like(ANSWERED), energy_j.like(CLAMPED));
            keep!(force_n.x => fx, i);
            keep!(force_n.y => fy, i);
            keep!(force_n.z => fz, i);
            keep!(torque_nm.x => tx, i);
            keep!(torque_nm.y => ty, i);
            keep!(torque_nm.z => tz, i);
            keep!(energy_j => energy, i);
            keep!(Pair::select(answered, trust, energy_j.like(UNANSWERED)) => verdict, i);
        }
    }
}
