//! What a box can know of a result without knowing the scene.
//!
//! | evidence | what it shows |
//! |---|---|
//! | model residual over the photo's noise | a photo that no scene gives, or a changed rig |
//! | the same of the untouched photo | how much there was to gain |
//! | distance from the reference solution | noise and ringing that the lens hides from residuals |
//! | roughness of the quiet parts, as they look | the same, at the finest scale |
//!
//! The *reference solution* is what total variation makes of the photo with the measured lens
//! ([`super::reference_solution`]): no capture goes into it, so nothing that happened to the rig
//! since it was measured can, and what is flat stays flat in it.

use rayon::prelude::*;

use super::Pipeline;
use super::prepare::median;
use super::stages::{Evidence, Prepared, Residuals, Solved};
use crate::deconvolution::data_term::{
    MISSING, NOISE_MIN, SATURATED, noise_of, residual_in_place, rms_over_data,
};
use crate::deconvolution::lens_model::LensModel;
use crate::deconvolution::quality::ssim;
use crate::deconvolution::rounded::Rounded;
use crate::frame::{Channel, Channels, FULL_SCALE, Frame, Mosaic, Plane, Rect, Size, Work};

/// A channel with less of its pixels away from saturated ones has no say. Guess.
const DATA_SHARE_MIN: f64 = 0.05;
/// What a camera fills in between its filters errs by so much of what means of the nearest sites
/// err by. Guess: by directions and by the other colours, cameras do twice as well.
const FILLED_IN: f32 = 0.5;
/// Of a lossy WebP, whose own photograph through the lens lies beyond its steps by no more than
/// this share of half a step, nothing can be told. Set on a dark and a calm photo: from quality 75
/// and 30 down their results gained .012 SSIM at most, their colours got worse, and a sharp photo
/// would pass.
const CODED_AWAY: f32 = 0.07;
/// Weights of red, green and blue in luminance (Rec. 709).
const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// Lightness is light to this power, about.
const LIGHTNESS: f32 = 1.0 / 2.2;

/// How far `result` is from the `reference` solution, as a share of how far the untouched photo is
/// from it, by 1 − SSIM of lightness; 0 is the same picture, above 1 the photo is nearer.
pub(super) fn distance(
    photo: &Frame<Work>,
    result: &Frame<Work>,
    reference: &Frame<Work>,
    channels: Channels,
) -> f64 {
    let (reference, result) = (lightness(reference, channels), lightness(result, channels));
    let unlike = |plane: &Plane| 1.0 - ssim(plane, &reference);
    unlike(&result) / unlike(&lightness(photo, channels)).max(f64::MIN_POSITIVE)
}

/// How light `picture` looks, 0..255; of a grey photo its green channel.
fn lightness(picture: &Frame<Work>, channels: Channels) -> Plane {
    let mut sum = Plane::zeros(picture.size());
    for &c in channels.list() {
        let weight = if channels == Channels::Green { 1.0 } else { LUMINANCE[c.index()] };
        sum.add_scaled(weight, &picture.plane(c).map(|v: f32| v.clamp(0.0, FULL_SCALE)));
    }
    sum.map(|v: f32| FULL_SCALE * (v / FULL_SCALE).powf(LIGHTNESS))
}

/// The sites of a raw photo in cells of two by two: interpolated ones hide the noise.
fn in_cells(photo: &Frame<Work>, mosaic: Mosaic) -> Frame<Work> {
    let cells = Size::new(photo.size().width / 2, photo.size().height / 2);
    Frame::from_fn(|c| {
        let plane = photo.plane(c);
        Plane::from_fn(cells, |x, y| {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(u, v)| (2 * x + u, 2 * y + v));
            let own = four.into_iter().filter(|&(x, y)| mosaic.colour_at(x, y) == c);
            own.map(|(x, y)| plane.at(x, y)).sum::<f32>() * Mosaic::pixels_a_site(c) / 4.0
        })
    })
}

/// Side of the blocks whose noise is looked at one by one, pixels.
const BLOCK_PX: usize = 8;

/// The noise of the quiet parts of a picture in lightness: of its blocks' noises, the one that a
/// quarter of them stay below. A photo without any flat quarter hides noise, too.
fn roughness(lightness: &Plane) -> f32 {
    let (columns, rows) = (lightness.width() / BLOCK_PX, lightness.height() / BLOCK_PX);
    let mut noises: Vec<f32> = (0..columns * rows)
        .map(|n| {
            let (x, y) = (n % columns * BLOCK_PX, n / columns * BLOCK_PX);
            noise_of(&lightness.crop(Rect { x, y, size: Size::new(BLOCK_PX, BLOCK_PX) }))
        })
        .collect();
    let quarter = noises.len() / 4;
    if noises.is_empty() { 0.0 } else { *noises.select_nth_unstable_by(quarter, f32::total_cmp).1 }
}

impl Pipeline {
    /// What can be known of what was `solved` for `photo`, by the lens as its captures say it is.
    pub(super) fn evidence(&self, photo: &Prepared<'_>, solved: &Solved) -> Evidence {
        let rough = |picture: &Frame<Work>| roughness(&lightness(picture, photo.channels));
        let before = match photo.mosaic {
            // The photo's own, not the canvas's.
            Some(of) => rough(&in_cells(&photo.photo, of.from_place(photo.rect.x, photo.rect.y))),
            None => rough(&photo.photo),
        };
        let rougher = rough(&solved.picture) / before.max(NOISE_MIN);
        Evidence {
            channels: self.residuals(photo, &solved.lens, &solved.solution.picture),
            rougher,
        }
    }

    /// What `lens` leaves unexplained of `photo`, channel by channel, where `picture` is the
    /// candidate on its canvas.
    pub(super) fn residuals(
        &self,
        photo: &Prepared<'_>,
        lens: &LensModel,
        picture: &Frame<Work>,
    ) -> Vec<Residuals> {
        if let Some(rounded) = &photo.rounded {
            return vec![self.beyond_steps(photo, rounded, lens, picture)];
        }
        let channels = photo.channels.list();
        let Some(stated) = photo.stated.as_ref().filter(|stated| stated.is_data()) else {
            let of = |&c: &Channel| residuals_of(photo, lens, c, picture.plane(c));
            return channels.par_iter().map(of).collect();
        };
        // A JPEG is met by every picture that it may stand for.
        let data_of = |picture: &Frame<Work>| {
            let mut seen = picture.clone();
            channels.iter().for_each(|&c| lens.forward(c, picture.plane(c), seen.plane_mut(c)));
            stated.redecoded(&seen)
        };
        let (model, untouched) = rayon::join(|| data_of(picture), || data_of(&photo.placed));
        let of = |&c: &Channel| {
            let data = [model.plane(c), untouched.plane(c)];
            left_of(photo, lens, c, (picture.plane(c), data, stated.noise(c)))
        };
        channels.par_iter().map(of).collect()
    }

    /// Whether `photo` was coded so coarsely that what the lens does lies within its steps.
    pub(super) fn is_coded_away(&self, photo: &Prepared<'_>) -> bool {
        photo.rounded.as_ref().is_some_and(|rounded| {
            let left = self.beyond_steps(photo, rounded, self.lens_of(photo), &photo.placed);
            left.untouched <= CODED_AWAY * rounded.half_step()
        })
    }

    /// The same of the brightness of a lossy WebP, in codes: what lies beyond its steps.
    fn beyond_steps(
        &self,
        photo: &Prepared<'_>,
        rounded: &Rounded,
        lens: &LensModel,
        picture: &Frame<Work>,
    ) -> Residuals {
        let channels = photo.channels.list();
        let reach = lens.functions().support_px / 2;
        let trusts: Vec<Plane<u8>> = (channels.par_iter())
            .map(|&c| away_from_saturated(photo.trust.plane(c), reach))
            .collect();
        let Rect { x: left, y: top, size } = photo.rect;
        let known =
            |x: usize, y: usize| trusts.iter().all(|trust| trust.at(left + x, top + y) != MISSING);
        let pixels = (0..size.area()).filter(|n| known(n % size.width, n / size.width)).count();
        let seen_of = |picture: &Frame<Work>| {
            let mut seen = picture.clone();
            channels.iter().for_each(|&c| lens.forward(c, picture.plane(c), seen.plane_mut(c)));
            seen
        };
        let (seen, untouched) = rayon::join(|| seen_of(picture), || seen_of(&photo.placed));
        let brightness = rounded.brightness(&seen);
        let filled_in = photo.filled_in.map_or(0.0, |mosaic| {
            let filled = Frame::from_fn(|c| mosaic.filled(c, seen.plane(c)));
            let missed = rounded.brightness(&filled);
            FILLED_IN * apart(&missed, &brightness)
        });
        let light = Channel::ALL.map(|c| median(photo.photo.plane(c)));
        let of_camera = Channel::ALL.map(|c| self.noise[c.index()].sigma(light[c.index()]));
        let has_a_say = pixels as f64 >= DATA_SHARE_MIN * size.area() as f64;
        Residuals {
            model: if has_a_say { rounded.beyond(&brightness, &known) } else { 0.0 },
            untouched: rounded.beyond(&rounded.brightness(&untouched), &known),
            photo_noise: rounded.noise_beyond(rounded.spread(light, of_camera).hypot(filled_in)),
        }
    }
}

/// RMS difference of two planes.
fn apart(a: &Plane, b: &Plane) -> f32 {
    let mut difference = a.clone();
    difference.add_scaled(-1.0, b);
    (difference.dot(&difference) / difference.size().area() as f64).sqrt() as f32
}

/// What `lens` leaves unexplained of one channel of `photo`, where `plane` is the candidate's.
pub(super) fn residuals_of(
    photo: &Prepared<'_>,
    lens: &LensModel,
    c: Channel,
    plane: &Plane,
) -> Residuals {
    let data = [photo.placed.plane(c); 2];
    left_of(photo, lens, c, (plane, data, photo.noise[c.index()]))
}

/// The same of `data` in place of the photo, where the rest is `known`.
pub(super) fn residuals_on(
    photo: &Prepared<'_>,
    lens: &LensModel,
    c: Channel,
    (plane, data): (&Plane, &Plane),
    known: Residuals,
) -> Residuals {
    let trust = away_from_saturated(photo.trust.plane(c), lens.functions().support_px / 2);
    let mut seen = Plane::zeros(plane.size());
    lens.forward(c, plane, &mut seen);
    residual_in_place(&mut seen, data, &trust);
    Residuals { model: rms_over_data(&seen, &trust), ..known }
}

/// The same by what the data are for the candidate, and for the photo itself, and their noise.
fn left_of(
    photo: &Prepared<'_>,
    lens: &LensModel,
    c: Channel,
    (plane, data, photo_noise): (&Plane, [&Plane; 2], f32),
) -> Residuals {
    let trust = away_from_saturated(photo.trust.plane(c), lens.functions().support_px / 2);
    let known = trust.data().iter().filter(|&&t| t != MISSING).count();
    let residual = |of: &Plane, data: &Plane| {
        let mut plane = Plane::zeros(of.size());
        lens.forward(c, of, &mut plane);
        residual_in_place(&mut plane, data, &trust);
        rms_over_data(&plane, &trust)
    };
    let filled_in = photo.filled_in.map_or(0.0, |mosaic| {
        let mut seen = Plane::zeros(plane.size());
        lens.forward(c, plane, &mut seen);
        let mut missed = mosaic.filled(c, &seen);
        residual_in_place(&mut missed, &seen, &trust);
        FILLED_IN * rms_over_data(&missed, &trust)
    });
    let has_a_say = known as f64 >= DATA_SHARE_MIN * photo.rect.size.area() as f64;
    Residuals {
        model: if has_a_say { residual(plane, data[0]) } else { 0.0 },
        untouched: residual(photo.placed.plane(c), data[1]),
        photo_noise: photo_noise.hypot(filled_in),
    }
}

/// `trust` with nothing known within `reach` pixels of a saturated one: light from beyond full
/// scale falls there.
fn away_from_saturated(trust: &Plane<u8>, reach: usize) -> Plane<u8> {
    let (width, height) = (trust.width(), trust.height());
    let near = |at: usize, length: usize| at.saturating_sub(reach)..(at + reach + 1).min(length);
    let in_rows: Plane<u8> = Plane::from_fn(trust.size(), |x, y| {
        u8::from(near(x, width).any(|x| trust.at(x, y) == SATURATED))
    });
    Plane::from_fn(trust.size(), |x, y| {
        if near(y, height).any(|y| in_rows.at(x, y) == 1) { MISSING } else { trust.at(x, y) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::data_term::TRUSTED;

    #[test]
    fn what_is_near_a_saturated_pixel_is_not_known() {
        let size = Size::new(9, 7);
        let trust = Plane::from_fn(size, |x, y| if (x, y) == (4, 3) { SATURATED } else { TRUSTED });
        let known = away_from_saturated(&trust, 2);
        let missing = known.data().iter().filter(|&&t| t == MISSING).count();
        assert_eq!(missing, 25);
        assert_eq!((known.at(2, 1), known.at(1, 1)), (MISSING, TRUSTED));
    }

    #[test]
    fn the_distance_is_nought_for_the_reference_solution_and_one_for_the_photo() {
        let wave = |share: f32| {
            let plane =
                Plane::from_fn(Size::new(40, 30), |x, y| 90.0 + share * ((x * y) % 23) as f32);
            Frame::<Work>::from_fn(|_| plane.clone())
        };
        let (photo, reference) = (wave(1.0), wave(4.0));
        assert!(distance(&photo, &reference, &reference, Channels::Colour).abs() < 1e-6);
        assert!((distance(&photo, &photo, &reference, Channels::Colour) - 1.0).abs() < 1e-6);
        assert!(distance(&photo, &wave(3.0), &reference, Channels::Green) < 0.5);
    }
}
