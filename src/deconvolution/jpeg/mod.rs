//! The data term of a JPEG: its quantised coefficients in place of its decoded light.
//!
//! A JPEG determines each coefficient to within half a quantisation step. As noisy light, the photo
//! would pass its coding errors on to the scene: they are alike within a block and different in the
//! next, and large in chroma, which has long steps. So the photo is decoded again during the solve:
//! to the expected picture among all that the file may encode, given that the camera saw K L.
//!
//! ```text
//! e  = expected codes of K L               within 0..255
//! m  = D (M e) Dᵀ                          block by block; M: R, G, B to Y', Cb, Cr; chroma
//!                                          averaged over its pixels first
//! δ  = E[n | |c q − m − n| ≤ q/2]          n: the camera's noise in that coefficient
//! e′ = e + M⁻¹ (Dᵀ δ D)                    chroma repeated over its pixels
//! B̃  = K L − (light of e − light of e′)
//! ```
//!
//! (ITU-T T.81 and T.871 for D, q and M.) The gradient is Kᵀ(K L − B̃), with B̃ kept between
//! decodings. With the camera's curve and subsampled chroma it is not the gradient of one function;
//! tests check that it descends.

mod curve;
mod history;
mod interval;
mod luma;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::deconvolution::smoothing::blur;
use crate::frame::block_transform::{cosines, transform, transposed};
use crate::frame::{
    BLOCK_AREA, BLOCK_PX, Channel, Channels, CodedComponent, Coding, Frame, Plane, Rect, Size,
    TO_YCC, Work,
};
use curve::CodeCurve;
pub use history::coded_twice;
use interval::truncated_mean;
pub use luma::AlongLuma;

/// Weights of Cb and Cr in R, G and B (ITU-T T.871, clause 7); that of Y' is 1.
const FROM_CHROMA: [[f32; 2]; 3] = [[0.0, 1.402], [-0.344_136, -0.714_136], [1.772, 0.0]];
/// σ of the Gaussian that gives the local brightness, pixels.
const ABOUT_PX: f32 = 1.0;
/// Factor on the camera's noise σ, because the residual that the solve has not yet explained adds
/// to it. From the independent study.
const WIDENED: f32 = 2.0;
/// Further factor on the widened noise σ in chroma, from the independent study.
const WIDENED_CHROMA: f32 = 0.5;
/// Least σ of a coefficient, codes, against division by zero.
const SPREAD_MIN: f32 = 1e-2;
/// Level shift of luma (ITU-T T.81, A.3.1).
const MIDDLE: f32 = 128.0;
/// Rows of coded units that are decoded again in parallel; bounds the memory of copies. Guess.
const ROWS_AT_ONCE: usize = 16;
/// Pixels of the largest coded unit: chroma at half the width and height.
const UNIT_AREA: usize = 4 * BLOCK_AREA;

/// A photo's coefficients with their intervals, and the σ that the camera's noise gives them.
#[derive(Debug, Clone)]
pub struct JpegTerm {
    coding: Coding,
    /// The photo's rectangle on the canvas.
    rect: Rect,
    curves: [CodeCurve; 3],
    /// Noise σ s of each coefficient of each component, codes.
    spread: Vec<Vec<f32>>,
    /// Noise σ of each channel, grey levels: the camera's, plus coding errors if the photo was
    /// coded twice.
    noise: [f32; 3],
    /// Whether the photo was coded once, so that its coefficients are the camera's.
    once: bool,
    /// Weight of each channel in luma, n before normalisation, per 2×2 pixels of the canvas.
    luma: [Plane; 3],
    /// D and Dᵀ.
    cosines: ([[f32; BLOCK_PX]; BLOCK_PX], [[f32; BLOCK_PX]; BLOCK_PX]),
}

/// Input of [`JpegTerm::of`].
pub struct Stated<'a> {
    /// The file's coefficients.
    pub coding: &'a Coding,
    /// Light 0..255 of each code, by channel.
    pub lights: [&'a [f32]; 3],
    /// The photo's channels.
    pub channels: Channels,
    /// The decoded photo on its canvas, linear light.
    pub photo: &'a Frame<Work>,
    /// The photo's rectangle on the canvas.
    pub rect: Rect,
    /// Noise σ of each channel, grey levels: the camera's, without coding errors if coded `once`.
    pub noise: [f32; 3],
    /// The camera's noise σ of a channel at a light, both in grey levels.
    pub noise_at: &'a (dyn Fn(Channel, f32) -> f32 + Sync),
    /// Whether the photo was coded once. Otherwise its file does not bound all coding errors;
    /// `noise` then includes them, and only the luma prior applies.
    pub once: bool,
}

impl JpegTerm {
    /// Builds the term of a photo; `None` if file and photo differ in size or channels.
    pub fn of(stated: &Stated<'_>) -> Option<JpegTerm> {
        let &Stated { coding, lights, channels, photo, rect, noise, noise_at, once } = stated;
        if coding.size != rect.size || !coding.is_whole() {
            return None;
        }
        let coding = match channels {
            // The chroma of a grey photo carries no information.
            Channels::Green => coding.brightness(),
            Channels::Colour if coding.components.len() == 3 => coding.clone(),
            Channels::Colour => return None,
        };
        let of = |c: Channel| CodeCurve::new(lights[c.index()], &|light| noise_at(c, light));
        let [red, green, blue] = Channel::ALL.map(of);
        let curves = [red?, green?, blue?];
        let about: Vec<Plane> =
            photo.planes().par_iter().map(|plane| blur(plane, ABOUT_PX)).collect();
        let variances: Vec<Plane> = (curves.iter().zip(&about))
            .map(|(curve, about)| about.map(|v: f32| (WIDENED * curve.deviation(v)).powi(2)))
            .collect();
        let grey = coding.components.len() == 1;
        let spread = (coding.components.par_iter().enumerate())
            .map(|(n, component)| spread(component, n, &variances, rect, grey))
            .collect();
        let luma = luma::directions(&curves, photo);
        let cosines = (cosines(), transposed(&cosines()));
        Some(JpegTerm { coding, rect, curves, spread, noise, once, luma, cosines })
    }

    /// Whether the data are the coefficients rather than the decoded light.
    pub fn is_data(&self) -> bool {
        self.once
    }

    /// Noise σ of `channel`, grey levels, from which thresholds are computed.
    pub fn noise(&self, channel: Channel) -> f32 {
        self.noise[channel.index()]
    }

    /// The prior along the code's luma, for planes of the canvas's `size`, with one level for each
    /// of the `thresholds`, grey levels, finest first.
    pub(super) fn along_luma(&self, size: Size, thresholds: &[f32]) -> AlongLuma {
        AlongLuma::new(size, &self.luma, thresholds.to_vec())
    }

    /// Sets the chroma of `picture` to the mean of its own and the `photo`'s, and keeps its luma.
    /// Chroma was stored in long steps and often at half size: the solved and the stored chroma
    /// have independent errors, and their mean has less.
    pub(super) fn mix_colours(&self, picture: &mut Frame<Work>, photo: &Frame<Work>) {
        if self.coding.components.len() == 1 {
            return;
        }
        let width = photo.size().width;
        let [red, green, blue] =
            picture.planes_mut().each_mut().map(|plane| plane.data_mut().par_chunks_mut(width));
        (red, green, blue).into_par_iter().enumerate().for_each(|(y, (red, green, blue))| {
            let photo = Channel::ALL.map(|c| photo.plane(c).row(y));
            for x in 0..width {
                let codes = |light: [f32; 3]| {
                    let codes: [f32; 3] = std::array::from_fn(|n| self.curves[n].encode(light[n]));
                    let luma: f32 = (0..3).map(|n| TO_YCC[0][n] * codes[n]).sum();
                    (luma, codes.map(|code| code - luma))
                };
                let (luma, of_picture) = codes([red[x], green[x], blue[x]]);
                let (_, of_photo) = codes(photo.map(|row| row[x]));
                for (n, light) in [&mut red[x], &mut green[x], &mut blue[x]].into_iter().enumerate()
                {
                    let code = luma + 0.5 * (of_picture[n] + of_photo[n]);
                    *light = self.curves[n].decode(code.clamp(0.0, 255.0));
                }
            }
        });
    }

    /// The channels that are decoded together: all, or green alone.
    fn channels(&self) -> &'static [Channel] {
        if self.coding.components.len() == 1 { &[Channel::Green] } else { &Channel::ALL }
    }

    /// B̃: the expected picture among those that the file may encode, given `seen`, which is K L on
    /// the canvas; outside the photo it equals `seen`.
    ///
    /// # Panics
    /// When `seen` is not of the canvas's size, which is a bug of the caller.
    pub fn redecoded(&self, seen: &Frame<Work>) -> Frame<Work> {
        let mut decoded = seen.clone();
        let (_, down) = self.unit();
        let rows: Vec<usize> = (0..self.rect.size.height.div_ceil(down)).collect();
        for rows in rows.chunks(ROWS_AT_ONCE) {
            let strips: Vec<_> = rows.par_iter().map(|&row| self.strip(seen, row)).collect();
            for (n, &c) in self.channels().iter().enumerate() {
                let plane = decoded.plane_mut(c);
                let top = self.rect.y + rows[0] * down;
                let lines = strips.iter().flat_map(|strip| strip[n].chunks(self.rect.size.width));
                for (y, line) in lines.enumerate() {
                    plane.row_mut(top + y)[self.rect.x..][..line.len()].copy_from_slice(line);
                }
            }
        }
        decoded
    }

    /// Size of a coded unit, pixels across and down.
    fn unit(&self) -> (usize, usize) {
        let (across, down) = self.coding.densest();
        (BLOCK_PX * usize::from(across), BLOCK_PX * usize::from(down))
    }

    /// Decodes one row of units again; returns the photo's pixels in it, channel by channel.
    fn strip(&self, seen: &Frame<Work>, row: usize) -> [Vec<f32>; 3] {
        let (rect, (across, down)) = (self.rect, self.unit());
        let Size { width, height } = rect.size;
        let high = down.min(height - row * down);
        let mut strip = [(); 3].map(|()| vec![0.0; high * width]);
        let mut codes = [[0.0f32; UNIT_AREA]; 3];
        for column in 0..width.div_ceil(across) {
            for (codes, &c) in codes.iter_mut().zip(self.channels()) {
                let curve = &self.curves[c.index()];
                for (y, codes) in codes.chunks_exact_mut(across).take(down).enumerate() {
                    // The last unit is filled by repeating the edge, as coders do.
                    let from = seen.plane(c).row(rect.y + (row * down + y).min(height - 1));
                    let from = &from[rect.x..][..width];
                    for (x, code) in codes.iter_mut().enumerate() {
                        *code = curve.encode(from[(column * across + x).min(width - 1)]);
                    }
                }
            }
            let change = self.change(&codes, (column, row));
            let wide = across.min(width - column * across);
            for (n, &c) in self.channels().iter().enumerate() {
                let curve = &self.curves[c.index()];
                for y in 0..high {
                    let from = &seen.plane(c).row(rect.y + row * down + y)[rect.x..];
                    let from = &from[column * across..][..wide];
                    let to = &mut strip[n][y * width + column * across..][..wide];
                    let codes = codes[n][y * across..].iter().zip(&change[n][y * across..]);
                    for ((to, &seen), (&code, &change)) in to.iter_mut().zip(from).zip(codes) {
                        let stated = (code + change).clamp(0.0, 255.0);
                        *to = seen - (curve.decode(code) - curve.decode(stated));
                    }
                }
            }
        }
        strip
    }

    /// The change of the `codes` of the unit in `column` and `row`: M⁻¹ (Dᵀ δ D).
    fn change(
        &self,
        codes: &[[f32; UNIT_AREA]; 3],
        (column, row): (usize, usize),
    ) -> [[f32; UNIT_AREA]; 3] {
        let (across, down) = self.unit();
        let mut change = [[0.0f32; UNIT_AREA]; 3];
        let (there, back) = &self.cosines;
        for (n, component) in self.coding.components.iter().enumerate() {
            let pixels = (usize::from(component.pixels.0), usize::from(component.pixels.1));
            let (wide, high) = (across / pixels.0, down / pixels.1);
            let mut samples = [0.0f32; UNIT_AREA];
            let share = 1.0 / (pixels.0 * pixels.1) as f32;
            let of_pixels = self.component(n, codes);
            for (y, from) in of_pixels.chunks_exact(across).take(down).enumerate() {
                let to = &mut samples[y / pixels.1 * wide..][..wide];
                for (to, from) in to.iter_mut().zip(from.chunks_exact(pixels.0)) {
                    from.iter().for_each(|v| *to += share * v);
                }
            }
            for part in 0..wide * high / BLOCK_AREA {
                let (u, v) = (part % (wide / BLOCK_PX), part / (wide / BLOCK_PX));
                let place = (row * high / BLOCK_PX + v) * component.blocks.width
                    + column * wide / BLOCK_PX
                    + u;
                let place = place * BLOCK_AREA..(place + 1) * BLOCK_AREA;
                let first = v * BLOCK_PX * wide + u * BLOCK_PX;
                let mut block: [f32; BLOCK_AREA] =
                    std::array::from_fn(|k| samples[first + k / BLOCK_PX * wide + k % BLOCK_PX]);
                transform(&mut block, there);
                let stated = component.coefficients[place.clone()].iter().zip(&component.steps);
                let spread = &self.spread[n][place];
                for ((m, (&c, &q)), &s) in block.iter_mut().zip(stated).zip(spread) {
                    let step = f32::from(q);
                    *m = truncated_mean(f32::from(c) * step - *m, 0.5 * step, s);
                }
                transform(&mut block, back);
                for (k, v) in block.iter().enumerate() {
                    samples[first + k / BLOCK_PX * wide + k % BLOCK_PX] = *v;
                }
            }
            let weights = match n {
                0 => [1.0; 3],
                n => FROM_CHROMA.map(|row| row[n - 1]),
            };
            for (change, weight) in change.iter_mut().zip(weights) {
                for (y, to) in change.chunks_exact_mut(across).take(down).enumerate() {
                    let from = &samples[y / pixels.1 * wide..][..wide];
                    for (to, from) in to.chunks_exact_mut(pixels.0).zip(from) {
                        to.iter_mut().for_each(|to| *to += weight * from);
                    }
                }
            }
        }
        change
    }

    /// Component `n` of each pixel of a unit; for a grey photo, its codes less the level shift.
    fn component(&self, n: usize, codes: &[[f32; UNIT_AREA]; 3]) -> [f32; UNIT_AREA] {
        let middle = if n == 0 { MIDDLE } else { 0.0 };
        let [red, green, blue] = codes;
        match self.channels().len() {
            1 => red.map(|code| code - middle),
            _ => {
                let [r, g, b] = TO_YCC[n];
                std::array::from_fn(|at| r * red[at] + g * green[at] + b * blue[at] - middle)
            }
        }
    }
}

/// Noise σ s of each coefficient of component `n`: the roots of (D∘D) V (D∘D)ᵀ, where V follows
/// from the variances of the codes, by channel.
fn spread(
    component: &CodedComponent,
    n: usize,
    variances: &[Plane],
    rect: Rect,
    grey: bool,
) -> Vec<f32> {
    let (across, down) = (usize::from(component.pixels.0), usize::from(component.pixels.1));
    let count = (across * down) as f32;
    let of_pixel = |x: usize, y: usize| {
        let at = |channel: usize| {
            let (x, y) = (x.min(rect.size.width - 1), y.min(rect.size.height - 1));
            variances[channel].at(rect.x + x, rect.y + y)
        };
        match (grey, n) {
            (true, _) => at(Channel::Green.index()),
            (_, n) => (0..3).map(|c| TO_YCC[n][c].powi(2) * at(c)).sum(),
        }
    };
    let narrowed = if n == 0 { 1.0 } else { WIDENED_CHROMA * WIDENED_CHROMA };
    let squares = cosines().map(|row| row.map(|v| v * v));
    let blocks = 0..component.blocks.area();
    let of_block = |place: usize| {
        let (column, row) = (place % component.blocks.width, place / component.blocks.width);
        let mut block: [f32; BLOCK_AREA] = std::array::from_fn(|k| {
            let (x, y) = (column * BLOCK_PX + k % BLOCK_PX, row * BLOCK_PX + k / BLOCK_PX);
            let pixels =
                (0..across * down).map(|p| (x * across + p % across, y * down + p / across));
            // The variance of the mean of `count` pixels.
            narrowed * pixels.map(|(x, y)| of_pixel(x, y)).sum::<f32>() / (count * count)
        });
        transform(&mut block, &squares);
        block.map(|variance| variance.sqrt().max(SPREAD_MIN))
    };
    blocks.into_par_iter().flat_map_iter(of_block).collect()
}
