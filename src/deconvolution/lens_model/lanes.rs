//! Vectors of eight real and eight complex numbers.
//!
//! Arrays and loops of fixed length, which compile to vector instructions
//! ([`crate::frame::instructions`]).

use std::ops::{Add, Mul, Sub};

use crate::frame::instructions::multiply_add;

/// Numbers per vector.
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

impl Lanes {
    /// self · other + sum.
    #[inline(always)]
    pub(super) fn times_plus<const FUSED: bool>(mut self, other: Lanes, sum: Lanes) -> Lanes {
        for i in 0..LANES {
            self.0[i] = multiply_add::<FUSED>(self.0[i], other.0[i], sum.0[i]);
        }
        self
    }

    /// sum − self · other.
    #[inline(always)]
    pub(super) fn times_from<const FUSED: bool>(mut self, other: Lanes, sum: Lanes) -> Lanes {
        for i in 0..LANES {
            self.0[i] = multiply_add::<FUSED>(-self.0[i], other.0[i], sum.0[i]);
        }
        self
    }

    /// `value` in all lanes.
    #[inline(always)]
    pub(super) fn all(value: f32) -> Lanes {
        Lanes([value; LANES])
    }
}

/// Eight complex numbers.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
pub(super) struct ComplexLanes {
    pub(super) re: Lanes,
    pub(super) im: Lanes,
}

impl ComplexLanes {
    /// Times the complex number `w`.
    #[inline(always)]
    pub(super) fn times<const FUSED: bool>(self, w: [f32; 2]) -> ComplexLanes {
        let (re, im) = (Lanes::all(w[0]), Lanes::all(w[1]));
        ComplexLanes {
            re: self.im.times_from::<FUSED>(im, self.re * re),
            im: self.im.times_plus::<FUSED>(re, self.re * im),
        }
    }

    /// self · factor + sum, the factor real.
    #[inline(always)]
    pub(super) fn times_plus<const FUSED: bool>(
        self,
        factor: f32,
        sum: ComplexLanes,
    ) -> ComplexLanes {
        let factor = Lanes::all(factor);
        ComplexLanes {
            re: self.re.times_plus::<FUSED>(factor, sum.re),
            im: self.im.times_plus::<FUSED>(factor, sum.im),
        }
    }

    /// The product with the real numbers `factors`, lane by lane.
    #[inline(always)]
    pub(super) fn scaled(self, factors: Lanes) -> ComplexLanes {
        ComplexLanes { re: self.re * factors, im: self.im * factors }
    }

    /// self + i · other.
    #[inline(always)]
    pub(super) fn plus_i(self, other: ComplexLanes) -> ComplexLanes {
        ComplexLanes { re: self.re - other.im, im: self.im + other.re }
    }

    /// self − i · other.
    #[inline(always)]
    pub(super) fn minus_i(self, other: ComplexLanes) -> ComplexLanes {
        ComplexLanes { re: self.re + other.im, im: self.im - other.re }
    }

    /// The product with `other`, lane by lane.
    #[inline(always)]
    pub(super) fn product<const FUSED: bool>(self, other: ComplexLanes) -> ComplexLanes {
        ComplexLanes {
            re: self.im.times_from::<FUSED>(other.im, self.re * other.re),
            im: self.im.times_plus::<FUSED>(other.re, self.re * other.im),
        }
    }

    /// self · other + sum, lane by lane.
    #[inline(always)]
    pub(super) fn product_plus<const FUSED: bool>(
        self,
        other: ComplexLanes,
        sum: ComplexLanes,
    ) -> ComplexLanes {
        let re = self.re.times_plus::<FUSED>(other.re, sum.re);
        let im = self.re.times_plus::<FUSED>(other.im, sum.im);
        ComplexLanes {
            re: self.im.times_from::<FUSED>(other.im, re),
            im: self.im.times_plus::<FUSED>(other.re, im),
        }
    }

    /// The product with the conjugate of `other`, lane by lane.
    #[inline(always)]
    pub(super) fn product_conjugate<const FUSED: bool>(self, other: ComplexLanes) -> ComplexLanes {
        ComplexLanes {
            re: self.im.times_plus::<FUSED>(other.im, self.re * other.re),
            im: self.re.times_from::<FUSED>(other.im, self.im * other.re),
        }
    }
}

impl Add for ComplexLanes {
    type Output = ComplexLanes;
    #[inline(always)]
    fn add(self, other: ComplexLanes) -> ComplexLanes {
        ComplexLanes { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for ComplexLanes {
    type Output = ComplexLanes;
    #[inline(always)]
    fn sub(self, other: ComplexLanes) -> ComplexLanes {
        ComplexLanes { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul<f32> for ComplexLanes {
    type Output = ComplexLanes;
    #[inline(always)]
    fn mul(self, factor: f32) -> ComplexLanes {
        ComplexLanes { re: self.re * factor, im: self.im * factor }
    }
}
