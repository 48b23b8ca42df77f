//! A photo made ready for the solver, once: its light on the canvas, what each pixel is worth, and
//! its noise.
//!
//! | step | why |
//! |---|---|
//! | light straightened, where the camera bends it | the operator is linear |
//! | saturated pixels marked | a full pixel is only a lower bound |
//! | raw sites divided by the sensor's pattern, bad ones marked | no lens made them differ |
//! | placed on the canvas | light from outside the frame fell into it |
//! | noise measured | the shrinkage follows the noise; nothing else is tuned per photo |
//! | focus found, where the lens was measured at several | the scene may be nearer or farther |
//! | a raw photo's spectrum asked for another lens | stopped down it is too sharp for this one |
//!
//! The photo's own shading V stays: B = V·K(L) is K(V·L) as far as V is smooth, so V·L is what is
//! solved, shown and delivered. The flats of the captures hold the panel's shading, too, and no
//! photo was taken of the panel. Only where the canvas has no margin, and photo and panel both end
//! in the dark, is the photo divided, too: the flats then hold what the lens loses into it.

use std::borrow::Cow;
use std::sync::OnceLock;

use super::Pipeline;
use super::stages::Prepared;
use crate::calibration::{Noise, SiteGains};
use crate::deconvolution::blocking::blocking_of;
use crate::deconvolution::data_term::{self, MISSING, SATURATED, TRUSTED};
use crate::deconvolution::detail_mask::NoisyPlane;
use crate::deconvolution::focus::{SpectralDoubt, doubted};
use crate::deconvolution::jpeg::{JpegTerm, Stated, coded_twice};
use crate::deconvolution::ladder::{Rung, is_blank};
use crate::frame::{Channel, Channels, Coding, FULL_SCALE, Frame, Plane, RawSites, Rect, Work};
use crate::picture::Tone;

/// A photo value at or above this share of full scale counts as saturated (8-bit files clip at 255;
/// the code below it is kept as data).
const SATURATION_SHARE: f32 = 0.998;

/// Least noise power by which a raw photo is restored, as a share of one exposure's: what the
/// measured lens misses does not average out with the noise. Measured with 4 and 16 exposures of
/// two scenes on two rigs: with it SSIM and PSNR rise, with a half one of them loses PSNR.
pub const AVERAGED_MIN: f32 = 0.75;

/// A photo of nothing but noise that has so many times its camera's is no blank one. Guess: a gain
/// 64 times as high has that.
const NOT_ITS_CAMERAS: f32 = 8.0;
/// Why such a photo is left.
const ALL_NOISE: &str = "from pixel to pixel the photo changes as much as anywhere: no lens lets \
                         such a pattern through; it is dithered, screened as in print, or hardly \
                         anything but noise";

impl Pipeline {
    /// `photo` (photo-sized, linear light 0..255) with its `channels`, made ready.
    ///
    /// What bad sites of the rig's sensor may have reached is no data. Nothing says that this
    /// sensor took a developed photo, nor how it was filled between the sites: it is not divided by
    /// their pattern, and of another camera's a few pixels are lost for nothing.
    pub fn prepare<'a>(&self, photo: &'a Frame<Work>, channels: Channels) -> Prepared<'a> {
        let mut prepared = self.placed(photo, self.straightened(photo, None), channels);
        self.doubt(&mut prepared, SiteGains::reaches);
        if channels == Channels::Colour {
            prepared.filled_in = self.correction.layout().canvas_mosaic();
        }
        let noise = prepared.noise;
        prepared.focus = self.focus_of(&prepared, &|c, light| {
            noise[c.index()].max(self.noise[c.index()].sigma(light))
        });
        prepared
    }

    /// `photo` as a camera that is straight would have taken it, its white being `white` counts
    /// over black, if they are known.
    fn straightened<'a>(&self, photo: &'a Frame<Work>, white: Option<f32>) -> Cow<'a, Frame<Work>> {
        match self.photo_side.straightened(white) {
            Some(straight) => Cow::Owned(Frame::from_fn(|c| photo.plane(c).map(&straight))),
            None => Cow::Borrowed(photo),
        }
    }

    /// `alike`, which is `photo` as sites that are all alike would have taken it, on its canvas.
    fn placed<'a>(
        &self,
        photo: &Frame<Work>,
        alike: Cow<'a, Frame<Work>>,
        channels: Channels,
    ) -> Prepared<'a> {
        let (canvas, rect) = data_term::canvas_of(photo.size(), self.correction.layout().margin_px);
        let mut flat = alike.as_ref().clone();
        if self.black_surround {
            self.photo_side.undo_dark_corner(&mut flat);
        }
        let trust = Frame::from_fn(|c| {
            // What is full is full, whatever it was divided by.
            let full = SATURATION_SHARE * FULL_SCALE;
            let inner = photo.plane(c).map(|v: f32| if v >= full { SATURATED } else { TRUSTED });
            data_term::place(&inner, canvas, rect, MISSING)
        });
        let placed = Frame::from_fn(|c| {
            if self.black_surround {
                data_term::place(flat.plane(c), canvas, rect, 0.0)
            } else {
                data_term::place_with_edges(flat.plane(c), canvas, rect)
            }
        });
        let of = |c: Channel| self.noise_and_coding_of(c, alike.plane(c));
        let (red, (green, blue)) = rayon::join(
            || of(Channel::Red),
            || rayon::join(|| of(Channel::Green), || of(Channel::Blue)),
        );
        let noise = [red, green, blue].map(|(all, _)| all);
        let coded = [red, green, blue].iter().any(|&(_, coding)| coding > 0.0);
        Prepared {
            photo: alike,
            channels,
            placed,
            trust,
            rect,
            mosaic: None,
            noise,
            dark_light: self.noise.map(|noise| noise.dark_light()),
            coded,
            filled_in: None,
            stated: None,
            focus: None,
            times_noise: 1.0,
            is_sharper: false,
            lens_alone: OnceLock::new(),
            untouched: OnceLock::new(),
        }
    }

    /// The same of a `photo` whose file is a JPEG that states it by `coding`, in codes of `tone`.
    /// One that was coded before, in longer steps, has their errors, too, and is taken as any.
    pub fn prepare_coded<'a>(
        &self,
        photo: &'a Frame<Work>,
        channels: Channels,
        (coding, tone): (&Coding, &Tone),
    ) -> Prepared<'a> {
        let mut prepared = self.prepare(photo, channels);
        // Divided by its dark corner it is no longer what the file states.
        if !self.black_surround {
            let once = !coded_twice(coding);
            let straight = self.photo_side.straightened(None);
            let of_code = |&bent: &f32| straight.as_ref().map_or(bent, |straight| straight(bent));
            let lights: [Vec<f32>; 3] =
                Channel::ALL.map(|c| tone.lights(c).iter().map(of_code).collect());
            let of_camera = |c| self.noise[Channel::index(c)].sigma(photo.plane(c).mean() as f32);
            prepared.stated = JpegTerm::of(&Stated {
                coding,
                lights: lights.each_ref().map(Vec::as_slice),
                channels,
                photo: &prepared.placed,
                rect: prepared.rect,
                noise_at: &|c, light| self.noise[c.index()].sigma(light.max(0.0)),
                noise: if once { Channel::ALL.map(of_camera) } else { prepared.noise },
                once,
            });
        }
        prepared
    }

    /// Takes for missing what the `bad` sites of the sensor's pattern say.
    fn doubt(
        &self,
        prepared: &mut Prepared<'_>,
        bad: impl Fn(&SiteGains, Channel, usize, usize) -> bool,
    ) {
        let Some(sites) = self.correction.sites() else { return };
        let Rect { x: left, y: top, size } = prepared.rect;
        for c in Channel::ALL {
            let trust = prepared.trust.plane_mut(c);
            for y in top..top + size.height {
                for x in (left..left + size.width).filter(|&x| bad(sites, c, x, y)) {
                    trust.set(x, y, MISSING);
                }
            }
        }
    }

    /// The same of a `photo` that this rig's own sensor took and that is known at its `raw` sites
    /// only; between them it holds something to begin with
    /// ([`Mosaic::interpolated`](crate::frame::Mosaic::interpolated)). The sites are divided by the
    /// sensor's pattern, and bad ones are missing. The noise is what is stated of the sites, if it
    /// is not less than [`AVERAGED_MIN`] allows, or the sensor's, or what their spectrum shows
    /// where that is far more: the gain may have been another.
    pub fn prepare_raw<'a>(&self, photo: &'a Frame<Work>, raw: RawSites) -> Prepared<'a> {
        let (_, rect) = data_term::canvas_of(photo.size(), self.correction.layout().margin_px);
        let straight = self.straightened(photo, Some(FULL_SCALE * raw.counts_per_level));
        let alike = match self.correction.sites() {
            Some(sites) => Cow::Owned(sites.evened(rect, |c, x, y| straight.plane(c).at(x, y))),
            None => straight,
        };
        let mut prepared = self.placed(photo, alike, Channels::Colour);
        self.doubt(&mut prepared, SiteGains::is_bad);
        let Prepared { photo, mut trust, .. } = prepared;
        // By two rows and columns a mosaic repeats.
        let mosaic = raw.mosaic.from_place(rect.x, rect.y);
        for channel in Channel::ALL {
            let plane = trust.plane_mut(channel);
            for y in 0..plane.height() {
                let row = plane.row_mut(y).iter_mut().enumerate();
                row.filter(|&(x, _)| mosaic.colour_at(x, y) != channel)
                    .for_each(|(_, trust)| *trust = MISSING);
            }
        }
        let mosaic = Some(mosaic);
        let mut prepared = Prepared { photo, trust, mosaic, coded: false, ..prepared };
        let mut own = self.noise_at(&raw);
        let stated = |own: &[Noise; 3], c: Channel, light: f32| {
            let one = own[c.index()].sigma(light);
            raw.noise.map_or(one, |stated| {
                let [at_black, per_level] = stated[c.index()];
                let stated = Noise { at_black, per_level }.sigma(light);
                stated.max(AVERAGED_MIN.sqrt() * one)
            })
        };
        let before = |c: Channel, light: f32| stated(&own, c, light);
        let data = prepared.focus_data(&before);
        let doubt = doubted(self.model.functions(), &data, raw.noise.is_none());
        let mean = Channel::ALL.map(|c| prepared.photo.plane(c).mean() as f32);
        if let Some(SpectralDoubt::Noisier(powers)) = doubt {
            let green = Channel::Green.index();
            let one = own[green].sigma(mean[green]);
            own = own.map(|noise| noise.times(powers));
            prepared.times_noise = own[green].sigma(mean[green]) / one;
            prepared.dark_light = own.map(|noise| noise.dark_light());
        }
        let noise_at = |c: Channel, light: f32| stated(&own, c, light);
        prepared.noise = Channel::ALL.map(|c| noise_at(c, mean[c.index()]));
        prepared.focus = self.focus_of(&prepared, &noise_at);
        prepared.is_sharper = doubt == Some(SpectralDoubt::Sharper);
        // At another focus the lens may be sharper than at the panel's.
        if prepared.is_sharper && prepared.focus.is_some() {
            let data = prepared.focus_data(&noise_at);
            let lens = self.lens_of(&prepared).functions();
            prepared.is_sharper = doubted(lens, &data, false) == Some(SpectralDoubt::Sharper);
        }
        prepared
    }

    /// The photo's noise in one channel, grey levels: as measured, and at least what this camera
    /// has at the photo's mean light, with what a JPEG's coding adds; and that alone. A JPEG's
    /// noise is flattened where it is measured, and still in the picture.
    fn noise_and_coding_of(&self, channel: Channel, photo: &Plane) -> (f32, f32) {
        let of_camera = self.noise[channel.index()].sigma(photo.mean() as f32);
        let of_light = data_term::noise_of(photo).max(of_camera);
        let coding = blocking_of(photo);
        (of_light.hypot(coding), coding)
    }
}

impl Pipeline {
    /// Why a photo [that is blank](Prepared::is_blank) is left as it is.
    pub(super) fn why_blank(&self, photo: &Prepared<'_>) -> &'static str {
        let is_not_its_cameras = |&c: &Channel| {
            let of_camera = self.noise[c.index()].sigma(photo.photo.plane(c).mean() as f32);
            photo.noise[c.index()] > NOT_ITS_CAMERAS * of_camera
        };
        match photo.channels.list().iter().any(is_not_its_cameras) {
            true => ALL_NOISE,
            false => Rung::LeaveIt.reason(),
        }
    }
}

/// The noise power that is `stated`, without light and for each level, as a share of `own`: of
/// light in the middle.
pub fn power_share(stated: [f32; 2], own: &Noise) -> f32 {
    let middle = FULL_SCALE / 2.0;
    let [at_black, per_level] = stated;
    (Noise { at_black, per_level }.sigma(middle) / own.sigma(middle)).powi(2)
}

impl Prepared<'_> {
    /// Whether nothing in the photo rises above its noise.
    pub fn is_blank(&self) -> bool {
        let of = |&c: &Channel| NoisyPlane {
            light: self.placed.plane(c),
            trust: self.trust.plane(c),
            noise: self.noise[c.index()],
            dark_light: self.dark_light[c.index()],
        };
        let planes: Vec<_> = self.channels.list().iter().map(of).collect();
        is_blank(&planes, self.mosaic.is_some())
    }
}
