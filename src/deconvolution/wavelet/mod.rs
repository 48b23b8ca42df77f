//! The periodised orthonormal wavelet transform with Symlets 8 (paper Eq. 3).
//!
//! One level transforms a line x of even length N into N/2 averages a and N/2 details d,
//! a\[o\] = Σⱼ lo\[j\] x\[(2o + 8 − j) mod N\] and likewise d with hi: an orthonormal change of
//! basis, whose transpose is the synthesis. A line of odd length is extended by its last pixel,
//! which synthesis drops (as PyWavelets' "periodization" does): reconstruction is perfect, but the
//! basis is not orthonormal at that border. If both sides of a plane are multiples of 2^levels, it
//! has no such border.

mod lines;
mod two_sums;

use rayon::prelude::*;

use crate::frame::{Plane, STRETCH, Size};
use lines::Lines;
pub use lines::Put;

/// Low-pass analysis filter of Symlets 8, from PyWavelets.
const LOW: [f64; 16] = [
    -0.003_382_415_951_006_125_6,
    -0.000_542_132_331_791_148_1,
    0.031_695_087_811_492_98,
    0.007_607_487_324_917_605,
    -0.143_294_238_350_809_7,
    -0.061_273_359_067_658_524,
    0.481_359_651_258_372_2,
    0.777_185_751_700_523_5,
    0.364_441_894_835_331_4,
    -0.051_945_838_107_709_04,
    -0.027_219_029_917_056_003,
    0.049_137_179_673_607_506,
    0.003_808_752_013_890_615,
    -0.014_952_258_337_048_23,
    -0.000_302_920_514_721_366_8,
    0.001_889_950_332_759_459_4,
];

/// High-pass analysis filter: the low-pass filter reversed, with alternating signs.
fn high() -> [f64; 16] {
    std::array::from_fn(|j| if j % 2 == 0 { -LOW[15 - j] } else { LOW[15 - j] })
}

/// The three detail bands of one level, each half the size of its input.
#[derive(Debug, Clone, PartialEq)]
pub struct Details {
    /// High-pass along y: horizontal edges.
    pub horizontal: Plane,
    /// High-pass along x: vertical edges.
    pub vertical: Plane,
    /// High-pass along both.
    pub diagonal: Plane,
}

/// Wavelet coefficients of a plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficients {
    /// The approximation after the last level.
    pub approximation: Plane,
    /// The details, finest level first.
    pub details: Vec<Details>,
}

impl Coefficients {
    /// Multiplies the details of each level, finest first, and the approximation by `factors`.
    ///
    /// # Panics
    /// Unless there is one factor for each level and one for the approximation.
    pub fn scale_levels(&mut self, factors: &[f32]) {
        assert!(
            factors.len() == self.details.len() + 1,
            "a factor for each level and the approximation"
        );
        for (details, &factor) in self.details.iter_mut().zip(factors) {
            details.bands_mut().into_par_iter().for_each(|band| band.scale(factor));
        }
        self.approximation.scale(factors[self.details.len()]);
    }
}

impl Details {
    /// The three bands.
    pub fn bands_mut(&mut self) -> [&mut Plane; 3] {
        [&mut self.horizontal, &mut self.vertical, &mut self.diagonal]
    }
}

/// The transform of planes of one size.
#[derive(Debug, Clone)]
pub struct Sym8 {
    /// Sizes of the plane and of each level's approximation.
    sizes: Vec<Size>,
    lines: Lines,
}

/// Buffers of a transform of any size.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    approximation: Vec<f32>,
    /// The next level's approximation.
    next: Vec<f32>,
}

impl Sym8 {
    /// The transform of planes of `size` with `levels` levels.
    ///
    /// # Panics
    /// When `levels` is 0.
    pub fn new(size: Size, levels: usize) -> Self {
        assert!(levels > 0, "a transform has a level");
        let mut sizes = vec![size];
        for level in 0..levels {
            sizes.push(Size::new(sizes[level].width.div_ceil(2), sizes[level].height.div_ceil(2)));
        }
        Sym8 { sizes, lines: Lines::new() }
    }

    /// The same transform, run in parallel.
    #[must_use]
    pub fn parallel(self) -> Self {
        Sym8 { lines: self.lines.parallel(STRETCH), ..self }
    }

    /// Size of the planes.
    pub fn size(&self) -> Size {
        self.sizes[0]
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.sizes.len() - 1
    }

    /// Whether `coefficients` have the sizes of this transform.
    pub(super) fn fits(&self, coefficients: &Coefficients) -> bool {
        coefficients.approximation.size() == self.sizes[self.levels()]
            && coefficients.details.len() == self.levels()
            && coefficients
                .details
                .iter()
                .zip(&self.sizes[1..])
                .all(|(d, &size)| d.diagonal.size() == size)
    }

    /// Coefficients of this transform's sizes, all zero.
    pub fn zeros(&self) -> Coefficients {
        let details = self.sizes[1..]
            .iter()
            .map(|&size| Details {
                horizontal: Plane::zeros(size),
                vertical: Plane::zeros(size),
                diagonal: Plane::zeros(size),
            })
            .collect();
        Coefficients { approximation: Plane::zeros(self.sizes[self.levels()]), details }
    }

    /// Computes the coefficients of `plane`.
    ///
    /// # Panics
    /// When `plane` or `out` has another size than the transform.
    pub fn analyse(&self, plane: &Plane, out: &mut Coefficients, scratch: &mut Scratch) {
        self.analyse_shifted(plane, (0, 0), out, scratch);
    }

    /// Computes the coefficients of `plane` shifted cyclically so that pixel `shift` (column, row)
    /// comes first.
    pub fn analyse_shifted(
        &self,
        plane: &Plane,
        shift: (usize, usize),
        out: &mut Coefficients,
        scratch: &mut Scratch,
    ) {
        assert!(plane.size() == self.size(), "the plane has the transform's size");
        let Scratch { approximation, next } = scratch;
        for level in 0..self.levels() {
            let (from, to) = (self.sizes[level], self.sizes[level + 1]);
            let (input, shift) =
                if level == 0 { (plane.data(), shift) } else { (&approximation[..], (0, 0)) };
            let averages = if level + 1 == self.levels() {
                out.approximation.data_mut()
            } else {
                next.resize(to.area(), 0.0);
                &mut next[..]
            };
            let [horizontal, vertical, diagonal] =
                out.details[level].bands_mut().map(Plane::data_mut);
            let bands = [averages, horizontal, vertical, diagonal];
            self.lines.analyse(input, (from, to), shift, bands);
            std::mem::swap(approximation, next);
        }
    }

    /// Computes the plane of `coefficients`.
    ///
    /// # Panics
    /// When `out` or the coefficients have another size than the transform.
    pub fn synthesise(&self, coefficients: &Coefficients, out: &mut Plane, scratch: &mut Scratch) {
        self.synthesise_shifted(coefficients, (0, 0), (out, Put::Set), scratch);
    }

    /// The inverse of [`Sym8::analyse_shifted`]; `put` says whether the result replaces `out` or is
    /// added.
    pub fn synthesise_shifted(
        &self,
        coefficients: &Coefficients,
        shift: (usize, usize),
        (out, put): (&mut Plane, Put),
        scratch: &mut Scratch,
    ) {
        assert!(out.size() == self.size(), "the plane has the transform's size");
        let Scratch { approximation, next } = scratch;
        for level in (0..self.levels()).rev() {
            let (to, from) = (self.sizes[level], self.sizes[level + 1]);
            let Details { horizontal, vertical, diagonal } = &coefficients.details[level];
            let is_last = level + 1 == self.levels();
            let averages =
                if is_last { coefficients.approximation.data() } else { &approximation[..] };
            let bands = [averages, horizontal.data(), vertical.data(), diagonal.data()];
            if level == 0 {
                return self.lines.synthesise(bands, (from, to), shift, (out.data_mut(), put));
            }
            next.resize(to.area(), 0.0);
            self.lines.synthesise(bands, (from, to), (0, 0), (&mut next[..], Put::Set));
            std::mem::swap(approximation, next);
        }
    }
}

#[cfg(test)]
mod tests;
