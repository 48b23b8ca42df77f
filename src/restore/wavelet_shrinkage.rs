//! The prior: wavelet details are few and large (paper Eqs. 3 and 6), by soft thresholding, plain or cycle-spun.
//!
//! Shrinking is done in whatever frame of the plane the shift says: the plane is thought turned cyclically by
//! `shift`, transformed, shrunk and turned back. One shift a step, another at each step, is cycle spinning
//! spread over the iteration; the mean over a set of shifts is cycle spinning proper (Coifman and Donoho,
//! "Translation-invariant de-noising", 1995).

use super::wavelet::{Coefficients, Scratch, Sym8};
use crate::frame::{Plane, Size};

/// A regulariser: what a candidate is drawn towards after each step.
pub trait Prior: Send + Sync {
    /// Replaces `plane` by its proximal point: the minimiser of ½‖x − plane‖² + `strength` · prior(x). A prior
    /// that changes from step to step (cycle spinning) goes by `step_index`.
    fn apply(&self, plane: &mut Plane, strength: f32, step_index: usize, scratch: &mut ShrinkageScratch);
}

/// Soft thresholding of the details of Symlets 8; the approximation is left alone.
#[derive(Debug, Clone)]
pub struct Shrinkage {
    transform: Sym8,
    spin: Vec<(usize, usize)>,
}

/// Memory shrinking works in; any may be used with any [`Shrinkage`] of the same size, or `default()` to begin with.
#[derive(Debug, Clone, Default)]
pub struct ShrinkageScratch {
    coefficients: Option<Coefficients>,
    transform: Scratch,
    original: Option<Plane>,
    turned: Option<Plane>,
}

impl Shrinkage {
    /// Shrinkage of planes of size `size` in `levels` levels, with no shift at any step (the paper's).
    pub fn new(size: Size, levels: usize) -> Self {
        Shrinkage { transform: Sym8::new(size, levels), spin: vec![(0, 0)] }
    }

    /// The same with the shift drawn for each step of [`Prior::apply`] from the periods of all levels, in a fixed
    /// order that spreads any few consecutive steps evenly over them.
    #[must_use]
    pub fn cycle_spun(mut self) -> Self {
        let period = 1usize << self.transform.levels();
        // Bit-reversed counting along both sides: the first 2ᵏ of them are the even spread of 2ᵏ shifts.
        let reversed = |n: usize| {
            let bits = self.transform.levels();
            (0..bits).map(|b| (n >> b & 1) << (bits - 1 - b)).sum::<usize>()
        };
        self.spin = (0..period * period)
            .map(|n| {
                let (row, column) = interleaved(n);
                (reversed(column ^ row), reversed(row))
            })
            .collect();
        self
    }

    /// Size of the planes it shrinks.
    pub fn size(&self) -> Size {
        self.transform.size()
    }

    /// The shift (columns, rows) of step `step_index`.
    pub fn shift(&self, step_index: usize) -> (usize, usize) {
        self.spin[step_index % self.spin.len()]
    }

    /// Draws all details of `plane`, turned by `shift`, towards zero by `threshold` grey levels.
    ///
    /// # Panics
    /// When the plane is of another size, which is a bug of the caller.
    pub fn shrink(
        &self,
        plane: &mut Plane,
        threshold: f32,
        shift: (usize, usize),
        scratch: &mut ShrinkageScratch,
    ) {
        if threshold <= 0.0 {
            return;
        }
        let fits = scratch.coefficients.take().filter(|c| self.transform.owns(c));
        let mut coefficients = fits.unwrap_or_else(|| self.transform.zeros());
        self.transform.analyse_shifted(plane, shift, &mut coefficients, &mut scratch.transform);
        for details in &mut coefficients.details {
            for band in [&mut details.horizontal, &mut details.vertical, &mut details.diagonal] {
                for value in band.data_mut() {
                    *value -= value.clamp(-threshold, threshold);
                }
            }
        }
        self.transform.synthesise_shifted(&coefficients, shift, plane, &mut scratch.transform);
        scratch.coefficients = Some(coefficients);
    }

    /// Replaces `plane` by the mean of its shrunk versions over `shifts`; leaves it alone when there are none.
    pub fn shrink_spun(
        &self,
        plane: &mut Plane,
        threshold: f32,
        shifts: &[(usize, usize)],
        scratch: &mut ShrinkageScratch,
    ) {
        if shifts.is_empty() || threshold <= 0.0 {
            return;
        }
        let fits = |kept: Option<Plane>| kept.filter(|p| p.size() == plane.size());
        let mut original = fits(scratch.original.take()).unwrap_or_else(|| Plane::zeros(plane.size()));
        let mut turned = fits(scratch.turned.take()).unwrap_or_else(|| Plane::zeros(plane.size()));
        original.data_mut().copy_from_slice(plane.data());
        plane.data_mut().fill(0.0);
        for &shift in shifts {
            turned.data_mut().copy_from_slice(original.data());
            self.shrink(&mut turned, threshold, shift, scratch);
            plane.add_scaled(1.0 / shifts.len() as f32, &turned);
        }
        (scratch.original, scratch.turned) = (Some(original), Some(turned));
    }
}

impl Prior for Shrinkage {
    fn apply(&self, plane: &mut Plane, strength: f32, step_index: usize, scratch: &mut ShrinkageScratch) {
        self.shrink(plane, strength, self.shift(step_index), scratch);
    }
}

/// The even and the odd bits of `n` as two numbers.
fn interleaved(n: usize) -> (usize, usize) {
    let every_second = |n: usize| (0..16).map(|b| (n >> (2 * b) & 1) << b).sum();
    (every_second(n), every_second(n >> 1))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::frame::read_npy_f32;

    fn golden(name: &str) -> Plane {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
        let (shape, values) = read_npy_f32(&path).unwrap();
        Plane::from_vec(Size::new(shape[1], shape[0]), values).unwrap()
    }

    fn largest_difference(a: &Plane, b: &Plane) -> f32 {
        a.data().iter().zip(b.data()).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max)
    }

    fn turned(plane: &Plane, (sx, sy): (usize, usize)) -> Plane {
        let Size { width, height } = plane.size();
        Plane::from_fn(plane.size(), |x, y| plane.at((x + sx) % width, (y + sy) % height))
    }

    #[test]
    fn shrinking_agrees_with_the_golden_array() {
        let mut x = golden("sym8_x.npy");
        Shrinkage::new(x.size(), 2).shrink(&mut x, 1.2, (0, 0), &mut ShrinkageScratch::default());
        assert!(largest_difference(&x, &golden("sym8_soft1.2.npy")) < 1e-3);
    }

    #[test]
    fn a_shift_is_turning_shrinking_and_turning_back() {
        let x = golden("sym8_x.npy");
        let shrinkage = Shrinkage::new(x.size(), 3);
        let mut scratch = ShrinkageScratch::default();
        let (mut inside, mut by_hand) = (x.clone(), turned(&x, (5, 3)));
        shrinkage.shrink(&mut inside, 4.0, (5, 3), &mut scratch);
        shrinkage.shrink(&mut by_hand, 4.0, (0, 0), &mut scratch);
        let back = turned(&by_hand, (x.width() - 5, x.height() - 3));
        assert!(largest_difference(&inside, &back) < 1e-4);
        assert!(largest_difference(&inside, &x) > 1.0);
    }

    #[test]
    fn spinning_over_all_shifts_does_not_see_the_place() {
        let x = golden("sym8_x.npy");
        let shrinkage = Shrinkage::new(x.size(), 2).cycle_spun();
        let shifts: Vec<_> = (0..16).map(|n| shrinkage.shift(n)).collect();
        let mut sorted = shifts.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 16, "every shift of two levels' period once");
        let mut scratch = ShrinkageScratch::default();
        let (mut plain, mut moved) = (x.clone(), turned(&x, (1, 2)));
        shrinkage.shrink_spun(&mut plain, 3.0, &shifts, &mut scratch);
        shrinkage.shrink_spun(&mut moved, 3.0, &shifts, &mut scratch);
        assert!(largest_difference(&turned(&plain, (1, 2)), &moved) < 1e-3);
    }

    #[test]
    fn scratch_of_another_size_does_no_harm() {
        let x = golden("sym8_x.npy");
        let mut scratch = ShrinkageScratch::default();
        let mut small = Plane::filled(Size::new(7, 5), 3.0);
        Shrinkage::new(small.size(), 4).shrink_spun(&mut small, 1.0, &[(1, 1), (2, 0)], &mut scratch);
        assert!(small.data().iter().all(|&v| (v - 3.0).abs() < 1e-4));
        let (mut a, mut b) = (x.clone(), x);
        let shrinkage = Shrinkage::new(a.size(), 3);
        shrinkage.shrink_spun(&mut a, 2.0, &[(0, 0)], &mut scratch);
        shrinkage.apply(&mut b, 2.0, 0, &mut ShrinkageScratch::default());
        assert!(largest_difference(&a, &b) < 1e-5);
    }
}
