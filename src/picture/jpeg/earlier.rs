//! The JPEG that a picture's pixels were decoded from: a photo that an editor, a converter or a
//! messenger saved again as PNG, TIFF, BMP or WebP.
//!
//! The cosine coefficients of such pixels, block by block, lie within a rounding error of multiples
//! of the quantisation steps (Fan & de Queiroz 2003, "Identification of bitmap compression
//! history", IEEE Trans. Image Process. 12(2)). For chroma at half resolution, the decoder's
//! interpolation is undone first. Pixels moved, resized or changed since show no multiples.

use rayon::prelude::*;

use crate::frame::block_transform::{cosines, transform};
use crate::frame::{
    BLOCK_AREA, BLOCK_PX, CodedComponent, Coding, Plane, Rect, Size, TO_YCC, usual_step,
};

type BlockCoefficients = [f32; BLOCK_AREA];

/// Largest distance of a coefficient from a multiple of its step, codes. Rounding to samples and to
/// colours makes an error of σ 0.4.
const ROUNDING: f32 = 1.0;
/// Least share of a coefficient's values within [`ROUNDING`] of multiples of its step. Random
/// values come that near to multiples of 3 in two cases of three.
const SHARE: f32 = 0.9;
/// Smallest and largest step that is found: multiples of 2 are only a rounding error apart; 255 is
/// T.81's largest step of 8 bits.
const STEPS: std::ops::RangeInclusive<u16> = 3..=255;
/// Fewest non-zero values from which a step is inferred.
const NON_ZERO: usize = 24;
/// Fewest steps found in luma that reveal a JPEG. In photographs of 512×384 with noise of σ 0.7 and
/// 2 codes, 5 to 23 are found after coding at qualities of 60 to 95, and none before.
const STEPS_FOUND: usize = 3;
/// Side of the part that is searched for steps, pixels; bounds the time and memory spent on
/// pictures that never were JPEGs.
const SEARCHED_PX: usize = 1024;
/// Level shift of luma (T.81, A.3.1).
const MIDDLE: f32 = 128.0;
/// Passes that invert the interpolation of chroma: each at least halves the error.
const PASSES: usize = 10;

/// The coding of the JPEG from which `samples` of 8 bits, `step` a pixel, were decoded; `None` if
/// they show none.
pub(crate) fn earlier_coding(size: Size, samples: &[u16], step: usize) -> Option<Coding> {
    let component = |n: usize, Rect { x: left, y: top, size: part }: Rect| {
        Plane::from_fn(part, |x, y| {
            let pixel = &samples[((top + y) * size.width + left + x) * step..][..step];
            let code = |at: usize| f32::from(pixel[at]);
            match (step, n) {
                (1 | 2, _) => code(0) - MIDDLE,
                (_, 0) => (0..3).map(|c| TO_YCC[0][c] * code(c)).sum::<f32>() - MIDDLE,
                _ => (0..3).map(|c| TO_YCC[n][c] * code(c)).sum(),
            }
        })
    };
    let (all, middle) = (Rect { x: 0, y: 0, size }, middle_of(size));
    let luma = ShownSteps::of(&component(0, middle));
    if luma.count() < STEPS_FOUND {
        return None;
    }
    let quality = luma.quality(0, 50);
    let mut parts = vec![(AS_STORED, luma.steps(0, quality))];
    if step >= 3 {
        let chroma = [component(1, middle), component(2, middle)];
        let shown = |by: Enlargement| {
            let shown = chroma.each_ref().map(|plane| ShownSteps::of(&by.samples(plane)));
            (by, shown)
        };
        let count = |(_, shown): &(Enlargement, [ShownSteps; 2])| {
            shown.iter().map(ShownSteps::count).sum::<usize>()
        };
        // `max_by_key` returns the last of equals: in reverse order, the likeliest enlargement.
        let (by, shown) = ENLARGEMENTS.map(shown).into_iter().rev().max_by_key(count)?;
        parts.extend(shown.map(|steps| (by, steps.steps(1, steps.quality(1, quality)))));
    }
    let densest = parts.last()?.0.pixels;
    let components = parts.into_iter().enumerate().map(|(n, (by, steps))| {
        let blocks = Coding::blocks(size, densest, by.pixels);
        coded(&by.samples(&component(n, all)), by.pixels, blocks, steps)
    });
    Some(Coding { size, components: components.collect() })
}

/// The middle of a picture of `size`, with sides of at most [`SEARCHED_PX`], beginning at a block
/// of chroma.
fn middle_of(size: Size) -> Rect {
    let unit = 2 * BLOCK_PX;
    let begin = |side: usize| side.saturating_sub(SEARCHED_PX) / 2 / unit * unit;
    let part = Size::new(size.width.min(SEARCHED_PX), size.height.min(SEARCHED_PX));
    Rect { x: begin(size.width), y: begin(size.height), size: part }
}

/// How a decoder enlarges chroma.
#[derive(Clone, Copy)]
struct Enlargement {
    /// Pixels per sample across and down.
    pixels: (u8, u8),
    /// Whether the decoder interpolates, with weights 3/4 for the nearer sample and 1/4 for the
    /// other; otherwise it repeats each sample.
    interpolates: bool,
}

/// No enlargement, for components at full resolution.
const AS_STORED: Enlargement = Enlargement { pixels: (1, 1), interpolates: false };
/// The usual enlargements of chroma, the likeliest first.
const ENLARGEMENTS: [Enlargement; 5] = [
    Enlargement { pixels: (2, 2), interpolates: true },
    Enlargement { pixels: (2, 1), interpolates: true },
    AS_STORED,
    Enlargement { pixels: (2, 2), interpolates: false },
    Enlargement { pixels: (2, 1), interpolates: false },
];

impl Enlargement {
    /// The stored samples from which `plane` was enlarged.
    fn samples(self, plane: &Plane) -> Plane {
        let (across, down) = (usize::from(self.pixels.0), usize::from(self.pixels.1));
        let size = plane.size();
        let last = Size::new(size.width - 1, size.height - 1);
        let share = 1.0 / (across * down) as f32;
        let means = Plane::from_fn(
            Size::new(size.width.div_ceil(across), size.height.div_ceil(down)),
            |x, y| {
                let at = |n: usize| {
                    let (x, y) = (x * across + n % across, y * down + n / across);
                    plane.at(x.min(last.width), y.min(last.height))
                };
                share * (0..across * down).map(at).sum::<f32>()
            },
        );
        let mut samples = means;
        if self.interpolates && across > 1 {
            samples = sharpened(&samples, |x, y, by| (x.saturating_add_signed(by), y));
        }
        if self.interpolates && down > 1 {
            samples = sharpened(&samples, |x, y, by| (x, y.saturating_add_signed(by)));
        }
        samples
    }
}

/// The samples whose interpolation, averaged over the pixels of each sample, gives `means`, along
/// one axis: a mean weighs its own sample by 6/8 and each neighbour by 1/8.
fn sharpened(means: &Plane, beside: impl Fn(usize, usize, isize) -> (usize, usize)) -> Plane {
    let size = means.size();
    let mut samples = means.clone();
    for _ in 0..PASSES {
        samples = Plane::from_fn(size, |x, y| {
            let at = |by| {
                let (x, y) = beside(x, y, by);
                samples.at(x.min(size.width - 1), y.min(size.height - 1))
            };
            let seen = 0.125 * (at(-1) + 6.0 * at(0) + at(1));
            at(0) + means.at(x, y) - seen
        });
    }
    samples
}

/// Quantisation steps inferred from a component's coefficients; `None` where none was found.
struct ShownSteps([Option<u16>; BLOCK_AREA]);

impl ShownSteps {
    /// Infers the steps from a component's `samples`.
    fn of(samples: &Plane) -> ShownSteps {
        let Size { width, height } = samples.size();
        // Blocks at the border may be cut.
        let whole = Size::new(width / BLOCK_PX, height / BLOCK_PX);
        let blocks: Vec<_> = blocks_of(samples, whole).collect();
        let step = |k: usize| step_of(blocks.iter().map(|block| block[k].abs()).collect());
        let all: Vec<_> = (0..BLOCK_AREA).into_par_iter().map(step).collect();
        ShownSteps(std::array::from_fn(|k| all[k]))
    }

    fn count(&self) -> usize {
        self.0.iter().flatten().count()
    }

    /// The quality at which the usual table `n` is nearest to the steps; of equally near ones, the
    /// quality nearest to `about`.
    fn quality(&self, n: usize, about: u16) -> u16 {
        let apart = |quality: u16| -> f32 {
            let ratio = |(k, found): (usize, &Option<u16>)| {
                Some(f32::from((*found)?) / f32::from(usual_step(n, k, quality)))
            };
            self.0.iter().enumerate().filter_map(ratio).map(|ratio| ratio.ln().abs()).sum()
        };
        let mut all: Vec<u16> = (1..=100).collect();
        all.sort_by_key(|quality| quality.abs_diff(about));
        let all = all.into_iter().map(|quality| (quality, apart(quality)));
        all.min_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(about, |(quality, _)| quality)
    }

    /// The steps found, completed by those of the usual table `n` at `quality`.
    fn steps(&self, n: usize, quality: u16) -> Vec<u16> {
        let all = self.0.iter().enumerate();
        all.map(|(k, found)| found.unwrap_or_else(|| usual_step(n, k, quality))).collect()
    }
}

/// The largest step such that `values`, one coefficient's magnitudes in all blocks, are its
/// multiples.
fn step_of(mut values: Vec<f32>) -> Option<u16> {
    values.sort_unstable_by(|a, b| b.total_cmp(a));
    // Blocks of a drawn pattern are alike to the bit, decoded ones differ by rounding errors.
    values.dedup();
    STEPS.rev().find(|&step| {
        let step = f32::from(step);
        // Smaller values round to the multiple 0, whatever their rounding error.
        let least = (0.5 * step - ROUNDING).max(ROUNDING);
        let non_zero = &values[..values.partition_point(|&value| value >= least)];
        let near = |value: &&f32| (**value - step * (**value / step).round()).abs() < ROUNDING;
        non_zero.len() >= NON_ZERO
            && non_zero.iter().filter(near).count() as f32 > SHARE * non_zero.len() as f32
    })
}

/// The coefficients of the first `blocks`, columns and rows, of `samples`, which are continued
/// beyond their border by their last row and column.
fn blocks_of(samples: &Plane, blocks: Size) -> impl ParallelIterator<Item = BlockCoefficients> {
    let (there, size) = (cosines(), samples.size());
    (0..blocks.area()).into_par_iter().map(move |n| {
        let (left, top) = (n % blocks.width * BLOCK_PX, n / blocks.width * BLOCK_PX);
        let mut block = std::array::from_fn(|k| {
            let (x, y) = (left + k % BLOCK_PX, top + k / BLOCK_PX);
            samples.at(x.min(size.width - 1), y.min(size.height - 1))
        });
        transform(&mut block, &there);
        block
    })
}

/// Quantises `samples`, in `blocks` columns and rows of blocks, by `steps`.
fn coded(samples: &Plane, pixels: (u8, u8), blocks: Size, steps: Vec<u16>) -> CodedComponent {
    let of_block = |block: BlockCoefficients| {
        let values = block.into_iter().zip(&steps);
        values.map(|(v, &step)| (v / f32::from(step)).round() as i16)
    };
    let coefficients: Vec<i16> = blocks_of(samples, blocks).flat_map_iter(of_block).collect();
    CodedComponent { pixels, blocks, steps, coefficients: coefficients.into() }
}

#[cfg(test)]
mod tests {
    use image::{ColorType, DynamicImage, imageops};
    use jpeg_encoder::{Encoder, SamplingFactor};

    use super::super::coefficients;
    use super::*;

    /// A blurred scene of 512×384.
    fn photo() -> DynamicImage {
        let bytes = include_bytes!("../../../tests/scenes/coffee.png");
        let scene = image::load_from_memory(bytes).unwrap().into_rgb8();
        let scene = imageops::crop_imm(&scene, 40, 8, 512, 384).to_image();
        imageops::blur(&scene, 1.5).into()
    }

    fn samples(picture: &DynamicImage) -> Vec<u16> {
        picture.as_bytes().iter().map(|&code| u16::from(code)).collect()
    }

    #[test]
    fn the_pixels_of_a_jpeg_have_its_coefficients() {
        let (photo, size) = (photo(), Size::new(512, 384));
        for (quality, sampling, share) in [
            (95, SamplingFactor::F_1_1, 0.95),
            (90, SamplingFactor::F_2_2, 0.98),
            (85, SamplingFactor::F_2_1, 0.99),
            (60, SamplingFactor::F_2_2, 0.99),
        ] {
            let mut bytes = Vec::new();
            let mut encoder = Encoder::new(&mut bytes, quality);
            encoder.set_sampling_factor(sampling);
            encoder.encode(photo.as_bytes(), 512, 384, jpeg_encoder::ColorType::Rgb).unwrap();
            let stored = coefficients(&bytes).unwrap().unwrap();
            let decoded = image::load_from_memory(&bytes).unwrap();
            let found = earlier_coding(size, &samples(&decoded), 3).unwrap();
            for (found, stored) in found.components.iter().zip(&stored.components) {
                assert_eq!((found.pixels, found.blocks), (stored.pixels, stored.blocks));
                assert_eq!(found.steps, stored.steps, "quality {quality}");
                let pairs = found.coefficients.iter().zip(&*stored.coefficients);
                let same = pairs.filter(|(a, b)| a == b).count() as f64;
                let same = same / stored.coefficients.len() as f64;
                assert!(same > share, "quality {quality}: {same}");
            }
        }
    }

    #[test]
    fn other_pixels_have_none() {
        let photo = photo();
        assert!(earlier_coding(Size::new(512, 384), &samples(&photo), 3).is_none());
        let drawn: Vec<u16> = (0..256 * 192u32 * 3)
            .map(|n| ((n / 3 % 256 * 3 + n / 768 * 2) % 200 + 10 * (n % 3)) as u16)
            .collect();
        assert!(earlier_coding(Size::new(256, 192), &drawn, 3).is_none());
        let grey = DynamicImage::from(photo.to_luma8());
        assert_eq!(grey.color(), ColorType::L8);
        assert!(earlier_coding(Size::new(512, 384), &samples(&grey), 1).is_none());
        for (width, height) in [(1, 1), (7, 9), (16, 16)] {
            let few = vec![77; width * height * 4];
            assert!(earlier_coding(Size::new(width, height), &few, 4).is_none());
        }
    }
}
