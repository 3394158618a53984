//! Floating-point environment of the calling thread, restored after each plugin call.
//!
//! Rounding mode, flush-to-zero and traps belong to a thread. A plugin that leaves them changed would change every number
//! that is computed after it: other models, the mapping, a simulated plant. A call therefore ends with the environment it began with.

use std::arch::asm;
#[cfg(target_arch = "x86_64")]
use std::mem::MaybeUninit;

/// Floating-point control register of a thread: rounding mode, flush-to-zero and traps.
#[derive(Clone, Copy)]
struct FloatControl {
    /// The x87 control word is not saved: no compiled Rust depends on that word, and the C library changes both words together.
    #[cfg(target_arch = "x86_64")]
    mxcsr: u32,
    #[cfg(target_arch = "aarch64")]
    fpcr: u64,
}

/// Exception flags of MXCSR, set by ordinary operations.
#[cfg(target_arch = "x86_64")]
const STATUS: u32 = 0x3f;
/// Initial x87 control word of every thread: round to nearest, no traps.
#[cfg(target_arch = "x86_64")]
static X87: u16 = 0x037f;

#[cfg(target_arch = "x86_64")]
impl FloatControl {
    /// Reads the control register. Real-time: bounded, no allocation.
    #[inline(always)]
    fn now() -> Self {
        let mut mxcsr = MaybeUninit::<u32>::uninit();
        // SAFETY: the instruction stores a word of the thread's state at the address of a local variable of that size, and changes
        // nothing else; then the variable holds it.
        let mxcsr = unsafe {
            asm!("stmxcsr [{}]", in(reg) mxcsr.as_mut_ptr(), options(nostack, preserves_flags));
            mxcsr.assume_init()
        };
        Self { mxcsr }
    }

    /// Compares the control bits, without the exception flags. Real-time: bounded, no allocation.
    #[inline(always)]
    fn is_as(self, other: Self) -> bool {
        (self.mxcsr ^ other.mxcsr) & !STATUS == 0
    }

    /// Restores the control register and resets x87. Real-time: bounded, no allocation.
    #[cold]
    fn restore(self) {
        // SAFETY: the first word was this thread's own when the call began, hence legal, and that is what compiled code relies on;
        // the second is that of every new thread; `fnclex` forgets x87 exceptions that a trap would otherwise report at the next
        // instruction.
        unsafe {
            asm!(
                "fnclex", "ldmxcsr [{mxcsr}]", "fldcw [{x87}]",
                mxcsr = in(reg) &raw const self.mxcsr, x87 = in(reg) &raw const X87,
                options(nostack, preserves_flags, readonly)
            );
        }
    }
}

#[cfg(target_arch = "aarch64")]
impl FloatControl {
    /// Reads the control register. Real-time: bounded, no allocation.
    #[inline(always)]
    fn now() -> Self {
        let fpcr: u64;
        // SAFETY: reads a register that every thread may read.
        unsafe { asm!("mrs {}, fpcr", out(reg) fpcr, options(nomem, nostack, preserves_flags)) };
        Self { fpcr }
    }

    /// Compares the control bits. Real-time: bounded, no allocation.
    #[inline(always)]
    fn is_as(self, other: Self) -> bool {
        self.fpcr == other.fpcr
    }

    /// Restores the control register. Real-time: bounded, no allocation.
    #[cold]
    fn restore(self) {
        // SAFETY: the register held this value when the call began; that is what compiled code relies on.
        unsafe { asm!("msr fpcr, {}", in(reg) self.fpcr, options(nostack, preserves_flags)) };
    }
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
impl FloatControl {
    fn now() -> Self {
        Self {}
    }

    fn is_as(self, _: Self) -> bool {
        true
    }

    fn restore(self) {}
}

/// Runs a plugin call, restores the floating-point environment, and increments `changed` if the call modified it.
/// Real-time: the call plus six instructions.
#[inline(always)]
pub(super) fn preserving_float_control<T>(changed: &mut u64, call: impl FnOnce() -> T) -> T {
    let before = FloatControl::now();
    let answer = call();
    if !FloatControl::now().is_as(before) {
        before.restore();
        *changed += 1;
    }
    answer
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::hint::black_box;

    /// Rounds up from now on, as `fesetround(FE_UPWARD)` does.
    fn round_up() {
        FloatControl { mxcsr: 0x1f80 | 0x4000 }.restore();
    }

    #[test]
    fn a_call_that_rounds_otherwise_changes_no_number_after_it_and_is_counted() {
        let third = || black_box(1.0_f64) / black_box(3.0);
        let before = third();
        let mut changed = 0;
        let inside = preserving_float_control(&mut changed, || {
            round_up();
            third()
        });
        assert!(inside > before, "{inside:e} {before:e}");
        assert_eq!((third().to_bits(), changed), (before.to_bits(), 1));
    }

    #[test]
    fn flags_of_what_happened_are_nobodys_fault() {
        let mut changed = 0;
        let _ = preserving_float_control(&mut changed, || {
            black_box(1.0e-320_f64) * black_box(0.1) / black_box(0.0)
        });
        assert_eq!(changed, 0);
    }
}
