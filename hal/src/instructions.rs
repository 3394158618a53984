//! Code in the instructions of the machine at hand, decided when the program runs (feature `instructions`).
//!
//! What compilers assume of an x86-64 has instructions of two operands, and the result overwrites one of them: half of a
//! law's instructions there only carry numbers out of its way. Those of AVX2 have three operands, and room for four
//! numbers side by side. They round alike, and Rust never fuses a product with a sum: the *same bits*, only sooner.

/// Runs code with the best instructions there are. What it calls has to be inlined to gain by it.
///
/// Real-time: bounded, no allocation. The machine is asked once, afterwards it is a load and a branch.
#[inline(always)]
pub fn best<T>(code: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        return avx2.vectorize(code);
    }
    plainly(code)
}

/// Runs code with the instructions that every machine of its kind has.
#[inline(never)] // its registers and its frame are no concern of the machines that have better ones
fn plainly<T>(code: impl FnOnce() -> T) -> T {
    code()
}
