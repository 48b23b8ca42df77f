//! Eight numbers side by side, and eight complex ones: what the fast form computes with.
//!
//! Plain arrays and loops of fixed length, which compile to vector instructions
//! ([`crate::frame::instructions`]).

use std::ops::{Add, AddAssign, Mul, Sub};

/// Numbers side by side.
pub(super) const LANES: usize = 8;

/// Eight numbers.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

impl Add for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn add(mut self, other: Lanes) -> Lanes {
        for i in 0..LANES {
            self.0[i] += other.0[i];
        }
        self
    }
}

impl Sub for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn sub(mut self, other: Lanes) -> Lanes {
        for i in 0..LANES {
            self.0[i] -= other.0[i];
        }
        self
    }
}

impl Mul for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(mut self, other: Lanes) -> Lanes {
        for i in 0..LANES {
            self.0[i] *= other.0[i];
        }
        self
    }
}

impl Mul<f32> for Lanes {
    type Output = Lanes;
    #[inline(always)]
    fn mul(mut self, factor: f32) -> Lanes {
        for i in 0..LANES {
            self.0[i] *= factor;
        }
        self
    }
}

/// Eight complex numbers.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
pub(super) struct Complex {
    pub(super) re: Lanes,
    pub(super) im: Lanes,
}

impl Complex {
    /// Times the complex number `w`.
    #[inline(always)]
    pub(super) fn times(self, w: [f32; 2]) -> Complex {
        Complex { re: self.re * w[0] - self.im * w[1], im: self.re * w[1] + self.im * w[0] }
    }

    /// Times i.
    #[inline(always)]
    pub(super) fn times_i(self) -> Complex {
        Complex { re: Lanes::default() - self.im, im: self.re }
    }

    /// Lane by lane the product with `other`.
    #[inline(always)]
    pub(super) fn product(self, other: Complex) -> Complex {
        Complex { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }

    /// Lane by lane the product with the conjugate of `other`.
    #[inline(always)]
    pub(super) fn product_conjugate(self, other: Complex) -> Complex {
        Complex { re: self.re * other.re + self.im * other.im, im: self.im * other.re - self.re * other.im }
    }
}

impl Add for Complex {
    type Output = Complex;
    #[inline(always)]
    fn add(self, other: Complex) -> Complex {
        Complex { re: self.re + other.re, im: self.im + other.im }
    }
}

impl AddAssign for Complex {
    #[inline(always)]
    fn add_assign(&mut self, other: Complex) {
        *self = *self + other;
    }
}

impl Sub for Complex {
    type Output = Complex;
    #[inline(always)]
    fn sub(self, other: Complex) -> Complex {
        Complex { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul<f32> for Complex {
    type Output = Complex;
    #[inline(always)]
    fn mul(self, factor: f32) -> Complex {
        Complex { re: self.re * factor, im: self.im * factor }
    }
}

/// Rows for columns.
#[inline(always)]
pub(super) fn transposed(rows: &[Lanes; LANES]) -> [Lanes; LANES] {
    let mut columns = [Lanes::default(); LANES];
    for (i, row) in rows.iter().enumerate() {
        for (j, column) in columns.iter_mut().enumerate() {
            column.0[i] = row.0[j];
        }
    }
    columns
}
