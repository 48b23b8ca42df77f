//! The local inverse of the lens: (KᵀMK + ε)⁻¹Kᵀ for a mask M of sites, cell by cell.
//!
//! Within a cell one function with transfer function P is a convolution, whose regularised inverse
//! is P*/(|P|² + ε) (Wiener 1949). Cells and functions are interpolated as in Kᵀ.
//!
//! A mosaic's sites of one colour repeat every 2×2 pixels, so M couples a frequency f with its
//! aliases, f + ½ along either axis, and for a quincunx with f + (½, ½) alone. If each site is
//! weighted by the number of pixels it stands for, KᵀMK has rank one on each group of aliases, and
//! the inverse is P*/(Σ|P|² + ε) with the sum over the group (Zhao et al. 2016, "Fast single image
//! super-resolution using a new analytical solution for ℓ2-ℓ2 problems", IEEE TIP 25(8)). The phase
//! of the sites within the period does not matter.

use rayon::prelude::*;

use super::cells::{Cells, Side, Spectrum};
use super::lanes::{LANES, Lanes};
use crate::frame::Channel;

/// Number of data that a channel has in each 2×2 pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Density {
    /// Four: every pixel has a datum.
    Full,
    /// Two on a diagonal, as for the sites of green.
    Half,
    /// One, as for the sites of red or blue.
    Quarter,
}

impl Density {
    /// The density of a `channel`'s sites in a mosaic, or of full-colour pixels.
    pub fn of(channel: Channel, is_mosaic: bool) -> Density {
        match (is_mosaic, channel) {
            (false, _) => Density::Full,
            (true, Channel::Green) => Density::Half,
            (true, _) => Density::Quarter,
        }
    }
}

/// 1/(Σ|P|² + ε) at each frequency of each spectrum of a channel.
#[derive(Debug, Clone)]
pub struct LocalInverse {
    pub(super) channel: Channel,
    pub(super) reciprocals: Vec<Vec<Lanes>>,
}

impl LocalInverse {
    /// The inverse of a channel with `spectra` over `cells`, regularised by `epsilon` > 0.
    pub(super) fn new(
        cells: &Cells,
        spectra: &[Spectrum],
        channel: Channel,
        epsilon: f32,
        density: Density,
    ) -> LocalInverse {
        let lengths = cells.spectra.iter().map(|of| {
            let length = |side: &Side, n: usize| side.transforms[n].length();
            (length(&cells.along_x, of.transform_x), length(&cells.along_y, of.transform_y))
        });
        let lengths: Vec<(usize, usize)> = lengths.collect();
        let reciprocals = spectra.par_iter().zip(lengths).map(|(spectrum, (nx, ny))| {
            let powers = Powers::of(spectrum, nx, ny);
            let mut reciprocals = vec![Lanes::default(); spectrum.len()];
            for (n, lanes) in reciprocals.iter_mut().enumerate() {
                let (group, fx) = (n / nx, n % nx);
                for (i, lane) in lanes.0.iter_mut().enumerate() {
                    let fy = (group * LANES + i).min(ny / 2);
                    *lane = 1.0 / (powers.sum(fx, fy, density) + epsilon);
                }
            }
            reciprocals
        });
        LocalInverse { channel, reciprocals: reciprocals.collect() }
    }
}

/// |P|² of one function at `nx` × (`ny`/2 + 1) frequencies.
struct Powers {
    nx: usize,
    ny: usize,
    values: Vec<f32>,
}

impl Powers {
    fn of(spectrum: &Spectrum, nx: usize, ny: usize) -> Powers {
        // Spectra are scaled for the unscaled inverse transform.
        let scale = (2 * nx * ny) as f32;
        let mut values = vec![0.0; nx * (ny / 2 + 1)];
        for (fy, row) in values.chunks_exact_mut(nx).enumerate() {
            let from = &spectrum[fy / LANES * nx..][..nx];
            for (value, p) in row.iter_mut().zip(from) {
                let (re, im) = (scale * p.re.0[fy % LANES], scale * p.im.0[fy % LANES]);
                *value = re * re + im * im;
            }
        }
        Powers { nx, ny, values }
    }

    /// The sum over the frequencies that alias with (`fx`, `fy`).
    fn sum(&self, fx: usize, fy: usize, density: Density) -> f32 {
        let (nx, ny) = (self.nx, self.ny);
        let at = |fx: usize, fy: usize| self.values[fy * nx + fx];
        let opposite = (fx + nx / 2) % nx;
        // Frequency fy + ny/2 is the conjugate of its mirror image in the stored half.
        let mirrored = |fx: usize| at((nx - fx) % nx, ny / 2 - fy);
        match density {
            Density::Full => at(fx, fy),
            Density::Half => at(fx, fy) + mirrored(opposite),
            Density::Quarter => at(fx, fy) + at(opposite, fy) + mirrored(fx) + mirrored(opposite),
        }
    }
}
