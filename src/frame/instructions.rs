//! Inner loops compiled for the baseline processor and for AVX2 with FMA, selected at run time.
//!
//! A kernel is written once, as the `run` of a [`Kernel`]. Everything it calls is
//! `#[inline(always)]` and hence compiled again inside the AVX2 form of [`run_fastest`], with eight
//! numbers per instruction instead of four. [`multiply_add`] is one instruction where available; on
//! baseline x86-64 `mul_add` would be a library call. On aarch64 the baseline has all of NEON,
//! including fused products. Calling the AVX2 form is the only unsafe line of the mathematics.

#![allow(unsafe_code)]

/// An inner loop and its data.
pub trait Kernel {
    /// The loop; must be `#[inline(always)]`. `FUSED` is passed to every [`multiply_add`].
    fn run<const FUSED: bool>(self);
}

/// a · b + c, rounded once if `FUSED`, else twice.
#[inline(always)]
pub fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Runs `kernel` with the widest vector instructions of the processor that pay.
pub fn run_fastest(kernel: impl Kernel) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: AVX2 and FMA were detected above.
        return unsafe { run_with_avx2(kernel) };
    }
    kernel.run::<{ cfg!(target_arch = "aarch64") }>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn run_with_avx2(kernel: impl Kernel) {
    kernel.run::<true>();
}
