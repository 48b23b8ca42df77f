//! What is known of a photo that was kept as a lossy WebP: its file states by which steps the
//! cosine coefficients of its brightness were rounded, in blocks of four by four pixels (RFC 6386,
//! 14.3 and 14.4).
//!
//! Each block was predicted from its neighbours before that, so a coefficient lies within half a
//! step of the decoded one, and not at a multiple of the step. A picture whose brightness lies
//! within all of these is as good as the photo itself; what lies beyond, no coder has made. Colours
//! were kept at half the size, and say nothing.

use rayon::prelude::*;

use crate::frame::{BlockSteps, Channel, Channels, Frame, Plane, Rect, Work};

const SIDE: usize = BlockSteps::SIDE;
/// R, G and B in brightness, where 219 steps are full (ITU-R BT.601, as RFC 9649 has it).
const WEIGHTS: [f32; 3] = [0.2568, 0.5041, 0.0979];
/// Coders round to nothing what is less than this share of a step: libwebp's for all coefficients
/// but the first.
const TO_NOTHING: f32 = 0.57;

/// The brightness of a photo and what rounding may have made of it, in codes of 8 bits.
#[derive(Debug, Clone)]
pub struct Rounded {
    brightness: Plane,
    steps: BlockSteps,
    /// Light 0..255 of each code.
    lights: [Vec<f32>; 3],
    channels: Channels,
    /// Where the photo lies on its canvas.
    rect: Rect,
}

impl Rounded {
    /// The `photo` at `rect` of its canvas, whose codes have these `lights`, rounded by `steps`.
    pub fn new(
        photo: &Frame<Work>,
        (channels, rect): (Channels, Rect),
        lights: [Vec<f32>; 3],
        steps: BlockSteps,
    ) -> Rounded {
        let brightness = Plane::zeros(rect.size);
        let mut rounded = Rounded { brightness, steps, lights, channels, rect };
        rounded.brightness = rounded.brightness(photo);
        rounded
    }

    /// How bright the part of `picture`, on its canvas, is that is the photo.
    pub fn brightness(&self, picture: &Frame<Work>) -> Plane {
        let mut sum = Plane::zeros(self.rect.size);
        for &c in self.channels.list() {
            let weight = match self.channels {
                Channels::Green => WEIGHTS.iter().sum(),
                Channels::Colour => WEIGHTS[c.index()],
            };
            let lights = &self.lights[c.index()];
            let code = |light: f32| code_of(lights, light);
            sum.add_scaled(weight, &picture.plane(c).crop(self.rect).map(code));
        }
        sum
    }

    /// Codes that a change of each channel's light by `sigma` about `light` makes of brightness,
    /// where the channels change by themselves.
    pub fn spread(&self, light: [f32; 3], sigma: [f32; 3]) -> f32 {
        let of = |&c: &Channel| {
            let n = c.index();
            let weight = if self.channels == Channels::Green { 1.0 } else { WEIGHTS[n] };
            weight * sigma[n] / self.code_in_light(n, light[n]).max(f32::MIN_POSITIVE)
        };
        self.channels.list().iter().map(|c| of(c).powi(2)).sum::<f32>().sqrt()
    }

    /// The light of one code of 8 bits more about `light` of channel `n`.
    pub fn code_in_light(&self, n: usize, light: f32) -> f32 {
        let lights = &self.lights[n];
        let at = lights.partition_point(|&v| v < light);
        let around = [at.saturating_sub(1), (at + 1).min(lights.len() - 1)];
        let [below, above] = around.map(|code| lights[code]);
        let of_one = (above - below) / (around[1] - around[0]).max(1) as f32;
        of_one * (lights.len() - 1) as f32 / 255.0
    }

    /// The standard deviation of what rounding took of the photo's brightness, codes. Where a
    /// coefficient was rounded to nothing, what neighbours and the smoothing of blocks' borders put
    /// in its place is taken for what was lost: coarse, and within a quarter of it on ten photos.
    pub fn lost(&self) -> f32 {
        let step = self.steps.step;
        let (short, of_step) = (TO_NOTHING * step, step * step / 12.0);
        let each = |v: f32| if v.abs() < short { v * v } else { of_step };
        self.mean_of(&self.brightness, &|_, _| true, &each).sqrt()
    }

    /// Half a step, codes: so far a coefficient may be from the decoded one.
    pub fn half_step(&self) -> f32 {
        0.5 * self.steps.step
    }

    /// RMS of what lies beyond the steps about the photo's coefficients in the `brightness` of
    /// another picture, over blocks of `known` pixels.
    pub fn beyond(&self, brightness: &Plane, known: &dyn Fn(usize, usize) -> bool) -> f32 {
        let mut apart = brightness.clone();
        apart.add_scaled(-1.0, &self.brightness);
        let half = self.half_step();
        self.mean_of(&apart, known, &|v: f32| (v.abs() - half).max(0.0).powi(2)).sqrt()
    }

    /// What noise of `sigma` codes leaves beyond the steps on the average: of a coefficient that is
    /// anywhere between its limits ±h, the mean square that noise moves beyond them is
    /// √(2/π) σ³/3h.
    pub fn noise_beyond(&self, sigma: f32) -> f32 {
        let share = (2.0 / std::f32::consts::PI).sqrt() / 3.0 * sigma;
        sigma * (share / self.half_step().max(f32::MIN_POSITIVE)).sqrt().min(1.0)
    }

    /// The mean of `each` over the coefficients of `plane`, in blocks of `known` pixels.
    fn mean_of(
        &self,
        plane: &Plane,
        known: &dyn Fn(usize, usize) -> bool,
        each: &(dyn Fn(f32) -> f32 + Sync),
    ) -> f32 {
        let (left, top) = self.steps.first;
        let whole = |length: usize, first: usize| length.saturating_sub(first) / SIDE;
        let (columns, rows) = (whole(plane.width(), left), whole(plane.height(), top));
        let place = |n: usize| (left + n % columns * SIDE, top + n / columns * SIDE);
        let all = (0..columns * rows).map(place);
        let blocks: Vec<_> = all
            .filter(|&(x, y)| (0..SIDE * SIDE).all(|k| known(x + k % SIDE, y + k / SIDE)))
            .collect();
        let of_block = |&(x, y): &(usize, usize)| {
            let block = std::array::from_fn(|v| std::array::from_fn(|u| plane.at(x + u, y + v)));
            let coefficients = transformed(block);
            f64::from(coefficients.as_flattened().iter().map(|&v| each(v)).sum::<f32>())
        };
        let sum: f64 = blocks.par_iter().map(of_block).sum();
        (sum / (SIDE * SIDE * blocks.len()).max(1) as f64) as f32
    }
}

/// The code of `wanted`, fractions kept, by the `lights` of codes; in codes of 8 bits.
fn code_of(lights: &[f32], wanted: f32) -> f32 {
    let above = lights.partition_point(|&v| v <= wanted);
    let top = (lights.len() - 1) as f32;
    let (Some(below), Some(&high)) = (above.checked_sub(1), lights.get(above)) else {
        return if above == 0 { 0.0 } else { 255.0 };
    };
    let code = below as f32 + (wanted - lights[below]) / (high - lights[below]);
    255.0 * code / top
}

/// The orthonormal cosine transform of a block, rows and columns.
fn transformed(block: [[f32; SIDE]; SIDE]) -> [[f32; SIDE]; SIDE] {
    let of_rows = turned(block.map(transformed_row));
    turned(of_rows.map(transformed_row))
}

fn turned(block: [[f32; SIDE]; SIDE]) -> [[f32; SIDE]; SIDE] {
    std::array::from_fn(|x| std::array::from_fn(|y| block[y][x]))
}

/// cos(π/8)/√2 and cos(3π/8)/√2.
const COSINES: [f32; 2] = [0.653_281_5, 0.270_598_05];

fn transformed_row([a, b, c, d]: [f32; SIDE]) -> [f32; SIDE] {
    let (outer, inner) = (a - d, b - c);
    [
        0.5 * (a + b + c + d),
        COSINES[0] * outer + COSINES[1] * inner,
        0.5 * (a - b - c + d),
        COSINES[1] * outer - COSINES[0] * inner,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    fn of(step: f32, codes: impl Fn(usize, usize) -> f32 + Copy) -> (Rounded, Frame<Work>) {
        let rect = Rect { x: 3, y: 2, size: Size::new(22, 17) };
        let canvas = Size::new(30, 24);
        let grey = |x: usize, y: usize| codes(x.wrapping_sub(3), y.wrapping_sub(2));
        let picture = Frame::from_fn(|_| Plane::from_fn(canvas, grey));
        // Light as it is in codes.
        let lights = [(); 3].map(|()| (0..256).map(|code| code as f32).collect());
        let steps = BlockSteps { step, first: (2, 1) };
        (Rounded::new(&picture, (Channels::Colour, rect), lights, steps), picture)
    }

    #[test]
    fn the_transform_keeps_lengths() {
        let block = std::array::from_fn(|y| std::array::from_fn(|x| (3 * x * x + 5 * y) as f32));
        let square = |of: [[f32; SIDE]; SIDE]| of.as_flattened().iter().map(|v| v * v).sum::<f32>();
        assert!((square(transformed(block)) / square(block) - 1.0).abs() < 1e-5);
        let even = transformed([[1.0; SIDE]; SIDE]);
        assert!((even[0][0] - 4.0).abs() < 1e-6);
        assert!(even.as_flattened()[1..].iter().all(|v| v.abs() < 1e-6));
    }

    #[test]
    fn what_lies_within_half_a_step_is_as_good_as_the_photo() {
        let all = |_: usize, _: usize| true;
        let wave = |x: usize, y: usize| 120.0 + ((7 * x + 3 * y) % 11) as f32;
        let (rounded, picture) = of(20.0, wave);
        assert_eq!(rounded.beyond(&rounded.brightness(&picture), &all), 0.0);
        // The first coefficient of an even change is four times it, in brightness of 219 steps.
        let brighter = |by: f32| {
            let moved = Frame::from_fn(|c| picture.plane(c).map(|v: f32| v + by));
            rounded.beyond(&rounded.brightness(&moved), &all)
        };
        assert_eq!(brighter(2.5), 0.0);
        let beyond = 4.0 * WEIGHTS.iter().sum::<f32>() * 5.0 - 10.0;
        assert!((brighter(5.0) - beyond / 4.0).abs() < 0.01, "{} {beyond}", brighter(5.0));
        // Where it is not known, it does not count.
        assert_eq!(rounded.beyond(&rounded.brightness(&picture), &|_, _| false), 0.0);
    }

    #[test]
    fn longer_steps_lose_more_and_no_more_than_there_was() {
        let wave = |x: usize, y: usize| 120.0 + 6.0 * ((7 * x + 3 * y) % 11) as f32;
        let lost = [0.0, 4.0, 40.0, 4000.0].map(|step| of(step, wave).0.lost());
        assert!(lost[0] == 0.0 && lost[1] < lost[2], "{lost:?}");
        assert!((lost[1] - 4.0 / 12f32.sqrt()).abs() < 0.3, "{lost:?}");
    }

    #[test]
    fn a_part_of_a_picture_has_its_blocks_where_they_were() {
        let whole = BlockSteps { step: 1.0, first: (0, 0) };
        assert_eq!(whole.from_place(8, 5).first, (0, 3));
        assert_eq!(whole.from_place(5, 6).from_place(3, 2).first, (0, 0));
    }
}
