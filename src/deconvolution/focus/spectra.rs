//! Spectra of a photo's tiles, and what the lens lets through of them.
//!
//! Raw sites are taken as they are, with noughts between them: what a sensor does not sample folds
//! back, and the expected spectrum is folded just so.

use std::f32::consts::TAU;

use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::sync::Arc;

use crate::deconvolution::data_term::{MISSING, SATURATED};
use crate::deconvolution::lens_model::LensFunctions;
use crate::frame::{Channel, Channels, Frame, Mosaic, Plane, Rect, Size, Work};

/// Side of the tiles, pixels, unless functions are wider.
const TILE_PX: usize = 64;
/// A tile of whose pixels a larger share is full has no say: clipping makes edges of its own.
const SATURATED_SHARE: f32 = 0.02;
/// Power that measured functions may be off by at any frequency. Guess: taps are known to
/// thousandths of their sum.
const UNSURE: f32 = 1e-5;
/// The lowest frequency looked at, cycles a tile: below, the window's own spectrum is seen.
const LOWEST: f32 = 2.5;

/// A photo as the fit of its focus takes it.
pub struct FocusData<'a> {
    /// The photo on its canvas, linear light 0..255.
    pub photo: &'a Frame<Work>,
    /// What each pixel is worth.
    pub trust: &'a Frame<Work, u8>,
    /// Where the photo lies on the canvas.
    pub rect: Rect,
    /// The colours of the canvas's pixels where they are a sensor's raw sites.
    pub mosaic: Option<Mosaic>,
    /// The channels it has.
    pub channels: Channels,
    /// Standard deviation of the noise of a channel at a light, grey levels; of raw sites that of a
    /// site.
    pub noise: &'a (dyn Fn(Channel, f32) -> f32 + Sync),
}

/// How a spectrum folds: not at all, as quincunx sites do, or as one site of four does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Folding {
    Whole,
    Quincunx,
    OneOfFour,
}

impl Folding {
    /// The highest frequency looked at, cycles a pixel: what folds onto lower ones is little. The
    /// power of a tile with edges lies along lines, and where a line's low frequencies fold to, no
    /// model of a scene expects it.
    fn highest(self) -> f32 {
        match self {
            Folding::Whole => 1.0,
            Folding::Quincunx => 0.42,
            Folding::OneOfFour => 0.35,
        }
    }
}

/// The frequencies of a tile that are looked at.
pub(super) struct Frequencies {
    /// Whose power falls on the same place: [`Frequencies::folds`] numbers each.
    pub(super) aliases: Vec<u32>,
    /// How many fold onto each.
    pub(super) folds: usize,
    /// What share of a scene's power each of them brings.
    pub(super) share: f32,
    /// ln of the frequency, cycles a pixel, at every number.
    pub(super) ln: Arc<[f32]>,
}

/// The power of one tile of one channel, and its noise.
pub(super) struct TileSpectrum {
    /// At each of the frequencies looked at, squared grey levels.
    pub(super) power: Vec<f32>,
    /// Of white noise, the same.
    pub(super) noise: f32,
    pub(super) folding: Folding,
}

impl TileSpectrum {
    /// The same as of a sensor of so many times the noise power.
    pub(super) fn noisier(&self, times: f32) -> TileSpectrum {
        TileSpectrum { power: self.power.clone(), noise: times * self.noise, ..*self }
    }
}

/// Where tiles lie, and their transforms.
pub(super) struct Tiles {
    side: usize,
    window: Vec<f32>,
    transform: Arc<dyn Fft<f32>>,
    whole: Frequencies,
    quincunx: Frequencies,
    one_of_four: Frequencies,
    places: Vec<TilePlace>,
}

/// A tile around the centre of a function.
#[derive(Debug, Clone, Copy)]
pub(super) struct TilePlace {
    x: usize,
    y: usize,
    row: usize,
    column: usize,
}

impl Tiles {
    /// The tiles of a photo of `size`, one around the centre of each of the functions' grid; `None`
    /// when it is too small for any.
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
        Some(Tiles {
            side,
            window,
            transform: FftPlanner::new().plan_fft_forward(side),
            whole: Frequencies::of(side, Folding::Whole, &ln),
            quincunx: Frequencies::of(side, Folding::Quincunx, &ln),
            one_of_four: Frequencies::of(side, Folding::OneOfFour, &ln),
            places: (0..rows * columns).map(place).collect(),
        })
    }

    pub(super) fn places(&self) -> &[TilePlace] {
        &self.places
    }

    pub(super) fn frequencies(&self, folding: Folding) -> &Frequencies {
        match folding {
            Folding::Whole => &self.whole,
            Folding::Quincunx => &self.quincunx,
            Folding::OneOfFour => &self.one_of_four,
        }
    }

    /// The spectrum of `channel` at `place`; `None` where too much is full or nothing is known.
    pub(super) fn spectrum(
        &self,
        photo: &FocusData<'_>,
        place: &TilePlace,
        channel: Channel,
    ) -> Option<TileSpectrum> {
        let (x, y) = (photo.rect.x + place.x, photo.rect.y + place.y);
        let rect = Rect { x, y, size: Size::new(self.side, self.side) };
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
        let known = (0..light.data().len()).filter(|&n| trust.data()[n] != MISSING);
        let (mut sum, mut count, mut full) = (0.0f32, 0usize, 0usize);
        for n in known {
            (sum, count) = (sum + light.data()[n], count + 1);
            full += usize::from(trust.data()[n] == SATURATED);
        }
        if count == 0 || full as f32 > SATURATED_SHARE * count as f32 {
            return None;
        }
        let mean = sum / count as f32;
        let (mut power_of_window, mut tile) = (0.0, Vec::with_capacity(light.data().len()));
        for (n, (&v, &w)) in light.data().iter().zip(&self.window).enumerate() {
            // A bad site holds what its neighbours say; it is one of thousands.
            let value = if is_site(n) { w * (v - mean) } else { 0.0 };
            tile.push(Complex32::new(value, 0.0));
            power_of_window += w * w;
        }
        self.transformed(&mut tile);
        let frequencies = self.frequencies(folding);
        let first = |aliases: &[u32]| tile[aliases[0] as usize].norm_sqr() / power_of_window;
        let power = frequencies.aliases.chunks_exact(frequencies.folds).map(first).collect();
        let sites = 1.0 / frequencies.folds as f32;
        let noise = (photo.noise)(channel, mean).powi(2) * sites;
        Some(TileSpectrum { power, noise, folding })
    }

    /// Rows, then columns, which lie in rows afterwards: frequency (fx, fy) is at `fx · side + fy`.
    fn transformed(&self, tile: &mut Vec<Complex32>) {
        let side = self.side;
        self.transform.process(tile);
        *tile = (0..side * side).map(|n| tile[n % side * side + n / side]).collect();
        self.transform.process(tile);
    }
}

/// ln of each frequency in cycles a pixel.
fn ln_frequencies(side: usize) -> Arc<[f32]> {
    let cycles = |n: usize| if n > side / 2 { n as f32 - side as f32 } else { n as f32 };
    let of = |n: usize| (cycles(n / side).hypot(cycles(n % side)).max(1.0) / side as f32).ln();
    (0..side * side).map(of).collect()
}

impl Frequencies {
    fn of(side: usize, folding: Folding, ln: &Arc<[f32]>) -> Frequencies {
        let half = side / 2;
        // What is left when folds and the other half of a real tile's spectrum are not counted.
        let shifts: &[(usize, usize)] = match folding {
            Folding::Whole => &[(0, 0)],
            Folding::Quincunx => &[(0, 0), (half, half)],
            Folding::OneOfFour => &[(0, 0), (half, half), (half, 0), (0, half)],
        };
        let lowest = (LOWEST / side as f32).ln();
        let highest = folding.highest().ln();
        let (width, height) = match folding {
            Folding::Whole => (half + 1, side),
            Folding::Quincunx => (half, side),
            Folding::OneOfFour => (half / 2 + 1, half),
        };
        let mut aliases = Vec::new();
        for fx in 0..width {
            for fy in 0..height {
                let fold =
                    |&(x, y): &(usize, usize)| ((fx + x) % side * side + (fy + y) % side) as u32;
                let all: Vec<u32> = shifts.iter().map(fold).collect();
                let is_seen = |&n: &u32| ln[n as usize] >= lowest;
                if all.iter().all(is_seen) && ln[all[0] as usize] <= highest {
                    aliases.extend(all);
                }
            }
        }
        let folds = shifts.len();
        Frequencies { aliases, folds, share: (folds as f32).powi(-2), ln: Arc::clone(ln) }
    }
}

/// What each member of a series lets through at one place, per channel.
pub(super) struct Transfers {
    /// `[channel][member][frequency]`.
    of: [Vec<Vec<Complex32>>; 3],
    side: usize,
}

impl Transfers {
    pub(super) fn of<'a>(
        tiles: &Tiles,
        place: &TilePlace,
        members: impl Iterator<Item = &'a LensFunctions> + Clone,
    ) -> Transfers {
        let of = |channel: Channel| {
            let of_member = |functions: &LensFunctions| {
                let k = functions.support_px;
                let mut tile = vec![Complex32::default(); tiles.side * tiles.side];
                let taps = functions.function(channel, place.row, place.column);
                for (row, taps) in tile.chunks_exact_mut(tiles.side).zip(taps.chunks_exact(k)) {
                    row.iter_mut().zip(taps).for_each(|(value, &tap)| value.re = tap);
                }
                tiles.transformed(&mut tile);
                tile
            };
            members.clone().map(of_member).collect()
        };
        Transfers { of: Channel::ALL.map(of), side: tiles.side }
    }

    pub(super) fn members(&self) -> usize {
        self.of[0].len()
    }

    /// The same by the first member's functions, `width` times as wide: what they let through at a
    /// frequency so many times as high, which is nothing past the pixels' highest.
    pub(super) fn as_wide(&self, channel: Channel, width: f32, out: &mut Vec<f32>) {
        let (side, of) = (self.side, &self.of[channel.index()][0]);
        let signed = |n: usize| if n > side / 2 { n as f32 - side as f32 } else { n as f32 };
        let at = |fx: f32, fy: f32| {
            if fx.abs().max(fy.abs()) > (side / 2) as f32 {
                return 0.0;
            }
            let index = |f: f32| (f as i32).rem_euclid(side as i32) as usize;
            of[index(fx) * side + index(fy)].norm_sqr()
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

    /// Power let through at every frequency by functions that are `share` of the way from member
    /// `before` to the next.
    pub(super) fn power(&self, channel: Channel, before: usize, share: f32, out: &mut Vec<f32>) {
        let members = &self.of[channel.index()];
        let from = &members[before];
        let to = members.get(before + 1).unwrap_or(from);
        let power: Vec<f32> =
            from.iter().zip(to).map(|(a, b)| (a + (b - a) * share).norm_sqr()).collect();
        smeared(&power, self.side, out);
    }
}

/// `power` as it is seen through the window: a Hann window's own spectrum is (¼, ½, ¼) along each
/// axis, its power in units of their sum (1, 4, 1)/6. Where the lens lets nothing through, this is
/// what is seen.
fn smeared(power: &[f32], side: usize, out: &mut Vec<f32>) {
    let three = |before: f32, at: f32, after: f32| (before + 4.0 * at + after) / 6.0;
    let along: Vec<f32> = power
        .chunks_exact(side)
        .flat_map(|row| {
            (0..side).map(|n| three(row[(n + side - 1) % side], row[n], row[(n + 1) % side]))
        })
        .collect();
    out.clear();
    out.extend((0..side * side).map(|n| {
        let (row, column) = (n / side, n % side);
        let at = |row: usize| along[row % side * side + column];
        three(at(row + side - 1), at(row), at(row + 1)) + UNSURE
    }));
}
