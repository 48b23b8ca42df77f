//! Inner loops compiled twice: for the baseline processor, and for one with AVX2 and FMA, chosen at
//! run time.
//!
//! A kernel is written once, in plain Rust, as the `run` of a [`Kernel`]; everything it calls is
//! `#[inline(always)]`, so that it is compiled anew inside [`run_fastest`]'s AVX2 form, eight
//! numbers an instruction instead of four. Products and sums are one instruction, [`multiply_add`],
//! where the processor has it; on baseline x86-64 the same words would be a library call. On
//! aarch64 the baseline already has all of NEON, fused products too. The call of the AVX2 form is
//! the only unsafe line of the mathematics.

#![allow(unsafe_code)]

/// An inner loop with everything it works on.
pub trait Kernel {
    /// The work itself; to be marked `#[inline(always)]`. `FUSED` goes to every [`multiply_add`].
    fn run<const FUSED: bool>(self);
}

/// a · b + c, rounded once when `FUSED` and twice when not.
#[inline(always)]
pub fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Runs `kernel` with the widest vector instructions that this processor has and that are known to
/// pay.
pub fn run_fastest(kernel: impl Kernel) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: the processor has just been asked whether it has AVX2 and FMA.
        return unsafe { run_with_avx2(kernel) };
    }
    kernel.run::<{ cfg!(target_arch = "aarch64") }>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_with_avx2(kernel: impl Kernel) {
    kernel.run::<true>();
}
