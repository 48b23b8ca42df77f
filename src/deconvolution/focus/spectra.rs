//! Power spectra of a photo's tiles, and the lens's power transfer functions there.
//!
//! Raw sites are transformed with zeros between them; the expected spectrum is aliased likewise.

use std::f32::consts::TAU;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

use crate::deconvolution::data_term::{MISSING, SATURATED};
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::{Channel, Channels, Frame, Mosaic, Plane, Rect, Size, Work};

/// Side of a tile, pixels, unless the functions are wider.
const TILE_PX: usize = 64;
/// Maximum share of saturated pixels in a tile: clipping adds edges.
const SATURATED_SHARE: f32 = 0.02;
/// Error power of the measured transfer functions at any frequency. Guess: taps are accurate to
/// thousandths of their sum.
const UNSURE: f32 = 1e-5;
/// Lowest frequency used, cycles per tile: below it the window's own spectrum dominates.
const LOWEST: f32 = 2.5;

/// A photo as input of the spectral fits.
pub struct FocusData<'a> {
    /// The photo on its canvas, linear light 0..255.
    pub photo: &'a Frame<Work>,
    /// Validity of each pixel, see [`crate::deconvolution::data_term`].
    pub trust: &'a Frame<Work, u8>,
    /// The photo's rectangle on the canvas.
    pub rect: Rect,
    /// The rectangle over which the lens's functions are spread.
    pub field: Rect,
    /// Colour filters over the canvas, of raw sites.
    pub mosaic: Option<Mosaic>,
    /// Channels present.
    pub channels: Channels,
    /// Noise σ of a channel's pixel (in raw data, of a site) at a given light, grey levels.
    pub noise: &'a (dyn Fn(Channel, f32) -> f32 + Sync),
}

/// Aliasing of a channel's sites.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Folding {
    /// Every pixel is sampled.
    Whole,
    /// Every other pixel is sampled, in a checkerboard.
    Quincunx,
    /// One pixel in four is sampled.
    OneOfFour,
}

/// The frequencies of a tile that are used.
pub(super) struct Frequencies {
    /// Indices of the mutual aliases, [`Frequencies::folds`] for each frequency used.
    pub(super) aliases: Vec<u32>,
    /// Number of mutual aliases.
    pub(super) folds: usize,
    /// Share of the scene's power that each alias contributes.
    pub(super) share: f32,
    /// ln of the frequency in cycles per pixel, by index.
    pub(super) ln: Arc<[f32]>,
}

/// Power spectrum of one tile of one channel.
pub(super) struct TileSpectrum {
    /// Power at each frequency used, squared grey levels.
    pub(super) power: Vec<f32>,
    /// Power of the white noise, squared grey levels.
    pub(super) noise: f32,
    pub(super) folding: Folding,
}

impl TileSpectrum {
    /// The same spectrum with an assumed noise power of `times` the sensor's.
    pub(super) fn noisier(&self, times: f32) -> TileSpectrum {
        TileSpectrum { power: self.power.clone(), noise: times * self.noise, ..*self }
    }
}

/// The tile grid and its transforms.
pub(super) struct Tiles {
    side: usize,
    window: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
    /// Frequencies used for each [`Folding`].
    frequencies: [Frequencies; 3],
    places: Vec<TilePlace>,
}

/// A tile around the centre of a point spread function.
#[derive(Debug, Clone, Copy)]
pub(super) struct TilePlace {
    x: usize,
    y: usize,
    row: usize,
    column: usize,
}

impl Tiles {
    /// The tiles of a field of `size`, one around the centre of each function; `None` when it is
    /// smaller than a tile.
    pub(super) fn of(size: Size, functions: &LensFunctions) -> Option<Tiles> {
        let LensFunctions { rows, columns, support_px, .. } = *functions;
        let side = TILE_PX.max(support_px.next_power_of_two());
        if size.width < side || size.height < side {
            return None;
        }
        let start = |n: usize, of: usize, length: usize| {
            let centre = (2 * n + 1) * length / (2 * of);
            centre.saturating_sub(side / 2).min(length - side)
        };
        let place = |n: usize| {
            let (row, column) = (n / columns, n % columns);
            let (x, y) = (start(column, columns, size.width), start(row, rows, size.height));
            TilePlace { x, y, row, column }
        };
        let hann = |n: usize| 0.5 - 0.5 * (TAU * (n as f32 + 0.5) / side as f32).cos();
        let window = (0..side * side).map(|n| hann(n % side) * hann(n / side)).collect();
        let ln = ln_frequencies(side);
        let foldings = [Folding::Whole, Folding::Quincunx, Folding::OneOfFour];
        Some(Tiles {
            side,
            window,
            fft: FftPlanner::new().plan_fft_forward(side),
            frequencies: foldings.map(|folding| Frequencies::of(side, folding, &ln)),
            places: (0..rows * columns).map(place).collect(),
        })
    }

    pub(super) fn places(&self) -> &[TilePlace] {
        &self.places
    }

    pub(super) fn frequencies(&self, folding: Folding) -> &Frequencies {
        &self.frequencies[folding as usize]
    }

    /// The spectrum of `channel` at `place`; `None` if the tile is not wholly inside the photo, has
    /// no data, or has too many saturated pixels.
    pub(super) fn spectrum(
        &self,
        photo: &FocusData<'_>,
        place: &TilePlace,
        channel: Channel,
    ) -> Option<TileSpectrum> {
        let (x, y) = (photo.field.x + place.x, photo.field.y + place.y);
        let rect = Rect { x, y, size: Size::new(self.side, self.side) };
        if !photo.rect.contains(rect) {
            return None;
        }
        let light = photo.photo.plane(channel).crop(rect);
        let trust = photo.trust.plane(channel);
        let trust = Plane::from_fn(rect.size, |u, v| trust.at(x + u, y + v));
        let folding = match (photo.mosaic, channel) {
            (None, _) => Folding::Whole,
            (Some(_), Channel::Green) => Folding::Quincunx,
            (Some(_), _) => Folding::OneOfFour,
        };
        let is_site = |n: usize| {
            let at = (x + n % self.side, y + n / self.side);
            photo.mosaic.is_none_or(|of| of.colour_at(at.0, at.1) == channel)
        };
        let valid = (0..light.data().len()).filter(|&n| trust.data()[n] != MISSING);
        let (mut sum, mut count, mut saturated) = (0.0f32, 0usize, 0usize);
        for n in valid {
            (sum, count) = (sum + light.data()[n], count + 1);
            saturated += usize::from(trust.data()[n] == SATURATED);
        }
        if count == 0 || saturated as f32 > SATURATED_SHARE * count as f32 {
            return None;
        }
        let mean = sum / count as f32;
        let (mut power_of_window, mut tile) = (0.0, Vec::with_capacity(light.data().len()));
        for (n, (&v, &w)) in light.data().iter().zip(&self.window).enumerate() {
            // Dead sites hold a mean of their neighbours; they are one in thousands.
            let value = if is_site(n) { w * (v - mean) } else { 0.0 };
            tile.push(Complex32::new(value, 0.0));
            power_of_window += w * w;
        }
        self.transform(&mut tile);
        let frequencies = self.frequencies(folding);
        let first = |aliases: &[u32]| tile[aliases[0] as usize].norm_sqr() / power_of_window;
        let power = frequencies.aliases.chunks_exact(frequencies.folds).map(first).collect();
        let sites = 1.0 / frequencies.folds as f32;
        let noise = (photo.noise)(channel, mean).powi(2) * sites;
        Some(TileSpectrum { power, noise, folding })
    }

    /// The 2-D transform, transposed: frequency (fx, fy) is at `fx · side + fy`.
    fn transform(&self, tile: &mut Vec<Complex32>) {
        let side = self.side;
        self.fft.process(tile);
        *tile = (0..side * side).map(|n| tile[n % side * side + n / side]).collect();
        self.fft.process(tile);
    }
}

/// ln of each frequency in cycles per pixel.
fn ln_frequencies(side: usize) -> Arc<[f32]> {
    let cycles = |n: usize| if n > side / 2 { n as f32 - side as f32 } else { n as f32 };
    let of = |n: usize| (cycles(n / side).hypot(cycles(n % side)).max(1.0) / side as f32).ln();
    (0..side * side).map(of).collect()
}

impl Frequencies {
    fn of(side: usize, folding: Folding, ln: &Arc<[f32]>) -> Frequencies {
        let half = side / 2;
        // The shifts between mutual aliases; width and height of the spectrum without aliases and
        // without the conjugate half of a real spectrum; the highest frequency used, cycles per
        // pixel, up to which aliases are weak. Edges put their power along lines in frequency,
        // whose aliases an isotropic scene does not explain.
        let (shifts, width, height, highest): (&[(usize, usize)], _, _, f32) = match folding {
            Folding::Whole => (&[(0, 0)], half + 1, side, 1.0),
            Folding::Quincunx => (&[(0, 0), (half, half)], half, side, 0.42),
            Folding::OneOfFour => {
                (&[(0, 0), (half, half), (half, 0), (0, half)], half / 2 + 1, half, 0.35)
            }
        };
        let (lowest, highest) = ((LOWEST / side as f32).ln(), highest.ln());
        let mut aliases = Vec::new();
        for fx in 0..width {
            for fy in 0..height {
                let fold =
                    |&(x, y): &(usize, usize)| ((fx + x) % side * side + (fy + y) % side) as u32;
                let all: Vec<u32> = shifts.iter().map(fold).collect();
                let is_used = |&n: &u32| ln[n as usize] >= lowest;
                if all.iter().all(is_used) && ln[all[0] as usize] <= highest {
                    aliases.extend(all);
                }
            }
        }
        let folds = shifts.len();
        Frequencies { aliases, folds, share: (folds as f32).powi(-2), ln: Arc::clone(ln) }
    }
}

/// Transfer functions of each member of a series at one place, per channel.
pub(super) struct Transfers {
    /// `[channel][member][frequency]`.
    of: [Vec<Vec<Complex32>>; 3],
    side: usize,
}

impl Transfers {
    pub(super) fn of(tiles: &Tiles, place: &TilePlace, members: &[&LensFunctions]) -> Transfers {
        let of = |channel: Channel| {
            let of_member = |functions: &&LensFunctions| {
                let k = functions.support_px;
                let mut tile = vec![Complex32::default(); tiles.side * tiles.side];
                let taps = functions.function(channel, place.row, place.column);
                for (row, taps) in tile.chunks_exact_mut(tiles.side).zip(taps.chunks_exact(k)) {
                    row.iter_mut().zip(taps).for_each(|(value, &tap)| value.re = tap);
                }
                tiles.transform(&mut tile);
                tile
            };
            members.iter().map(of_member).collect()
        };
        Transfers { of: Channel::ALL.map(of), side: tiles.side }
    }

    /// Power transfer function of the first member scaled to `width` times its size: its value at
    /// `width` times each frequency, 0 beyond Nyquist.
    pub(super) fn as_wide(&self, channel: Channel, width: f32, out: &mut Vec<f32>) {
        let side = self.side;
        let own: Vec<f32> = self.of[channel.index()][0].iter().map(|v| v.norm_sqr()).collect();
        let signed = |n: usize| if n > side / 2 { n as f32 - side as f32 } else { n as f32 };
        let at = |fx: f32, fy: f32| {
            if fx.abs().max(fy.abs()) > (side / 2) as f32 {
                return 0.0;
            }
            let index = |f: f32| if f < 0.0 { side - (-f) as usize } else { f as usize };
            own[index(fx) * side + index(fy)]
        };
        let between = |n: usize| {
            let (fx, fy) = (width * signed(n / side), width * signed(n % side));
            let (left, top) = (fx.floor(), fy.floor());
            let row = |y: f32| at(left, y) + (fx - left) * (at(left + 1.0, y) - at(left, y));
            row(top) + (fy - top) * (row(top + 1.0) - row(top))
        };
        let power: Vec<f32> = (0..side * side).map(between).collect();
        smeared(&power, side, out);
    }

    /// Power transfer function `share` of the way from member `before` to the next.
    pub(super) fn power(&self, channel: Channel, before: usize, share: f32, out: &mut Vec<f32>) {
        let members = &self.of[channel.index()];
        let from = &members[before];
        let to = members.get(before + 1).unwrap_or(from);
        let power: Vec<f32> =
            from.iter().zip(to).map(|(a, b)| (a + (b - a) * share).norm_sqr()).collect();
        smeared(&power, self.side, out);
    }
}

/// `power` convolved with the window's spectrum, which fills the zeros of a transfer function: a
/// Hann window's amplitudes are (¼, ½, ¼) along each axis, its normalised power (1, 4, 1)/6.
fn smeared(power: &[f32], side: usize, out: &mut Vec<f32>) {
    let three = |before: f32, at: f32, after: f32| (before + 4.0 * at + after) / 6.0;
    let (mut along, last) = (vec![0.0; side * side], side - 1);
    for (to, row) in along.chunks_exact_mut(side).zip(power.chunks_exact(side)) {
        to[1..last].iter_mut().zip(row.windows(3)).for_each(|(v, w)| *v = three(w[0], w[1], w[2]));
        to[0] = three(row[last], row[0], row[1]);
        to[last] = three(row[last - 1], row[last], row[0]);
    }
    out.clear();
    for row in 0..side {
        let line = |row: usize| &along[row % side * side..][..side];
        let lines = line(row + last).iter().zip(line(row)).zip(line(row + 1));
        out.extend(lines.map(|((above, at), below)| three(*above, *at, *below) + UNSURE));
    }
}
