//! A photo made ready for the solver: its data on the canvas, weights and noise.
//!
//! | step | why |
//! |---|---|
//! | the camera's response curve undone | the operator is linear |
//! | saturated pixels marked | a full pixel is only a lower bound |
//! | raw sites divided by the sensor's gains, bad ones marked | the lens did not cause them |
//! | hot pixels marked that the calibration does not know | no scene gives them |
//! | placed on the canvas | light from outside the frame reaches the photo |
//! | noise estimated | it sets the shrinkage; nothing else is tuned per photo |
//! | sensor recognised by its gain pattern | photos of other cameras are returned |
//! | focus estimated, if several were measured | the scene may be nearer or farther |
//! | spectrum of a raw photo tested | a lens stopped down is sharper than the measured one |
//!
//! The photo's own shading V is kept: B = V·K(L) equals K(V·L) as far as V is smooth, so V·L is
//! solved for, shown and delivered. The flats of the captures include the panel's shading and
//! therefore do not apply to a photo. The exception is a canvas without margin, where photo and
//! panel both end in the dark: there the flats hold the light that the lens loses into the dark,
//! and the photo is divided by them.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use super::Pipeline;
use super::hot_pixels::hot_note;
use super::own_sensor::FoundPhoto;
use super::photo_data::{PhotoData, Recorded};
use super::raw_noise::{AVERAGED_MIN, plausible_noise};
use super::stages::{Prepared, TakenBy};
use crate::calibration::{Noise, SiteGains};
use crate::deconvolution::blocking::blocking_of;
use crate::deconvolution::data_term::{self, MISSING, SATURATED, TRUSTED};
use crate::deconvolution::focus::{SpectralFinding, check_spectrum};
use crate::deconvolution::jpeg::{JpegTerm, Stated, coded_twice};
use crate::deconvolution::lens_model::Beyond;
use crate::deconvolution::observation::{Developed, Jpeg, Observation, Raw};
use crate::deconvolution::smoothing;
use crate::frame::{Channel, Channels, Coding, FULL_SCALE, Frame, Plane, RawSites, Rect, Work};
use crate::picture::Tone;

/// Photo values at or above this share of full scale count as saturated (8-bit files clip at 255;
/// the code below it counts as data).
pub const SATURATION_SHARE: f32 = 0.998;

/// Note on a JPEG that was made from another JPEG.
const CODED_TWICE: &str = "this JPEG was made from another JPEG with coarser steps: it is restored \
                           from its decoded pixels, not from its coefficients";

impl Pipeline {
    /// Prepares `photo` (photo-sized) for the methods.
    pub fn prepare<'a>(&self, photo: impl Into<PhotoData<'a>>) -> Prepared<'a> {
        let photo = photo.into();
        let FoundPhoto { rect, sensor } = self.find_on_sensor(&photo);
        let PhotoData { light, channels, recorded } = photo;
        let mut prepared = match recorded {
            Recorded::Developed => self.prepare_developed(light, channels, rect),
            Recorded::Raw(raw) => self.prepare_raw(light, raw, rect),
            Recorded::Binned { saturated, raw } => {
                let mut prepared = match raw {
                    Some(raw) => self.prepare_binned_sites(light, raw, rect),
                    None => self.prepare_developed(light, channels, rect),
                };
                mark_saturated(&mut prepared.observation.trust, rect, saturated);
                prepared
            }
            Recorded::Jpeg { coding, tone } => {
                let developed = self.prepare_developed(light, channels, rect);
                self.with_coefficients(developed, light, coding, tone)
            }
        };
        prepared.sensor = sensor;
        if prepared.taken_by() != Some(TakenBy::Another) {
            self.fit_colours(&mut prepared);
        }
        prepared
    }

    /// Prepares a developed photo. Pixels to which bad sites of the rig's sensor may have
    /// contributed are marked missing. The photo is not divided by the sensor's gain pattern,
    /// because it is unknown how its camera interpolated between the sites.
    fn prepare_developed<'a>(
        &self,
        photo: &'a Frame<Work>,
        channels: Channels,
        rect: Rect,
    ) -> Prepared<'a> {
        let mut prepared = self.place(photo, self.straighten(photo, None), channels, rect);
        self.mark_missing(&mut prepared.observation, SiteGains::reaches);
        self.mark_hot_pixels(&mut prepared);
        fill_missing(&mut prepared.observation);
        let noise = prepared.observation.noise;
        self.find_focus(&mut prepared, &|c, light| {
            noise[c.index()].max(self.noise[c.index()].sigma(light))
        });
        prepared
    }

    /// Prepares means of raw sites of the rig's own sensor: divides them by its gain pattern and
    /// marks bad ones missing.
    fn prepare_binned_sites<'a>(
        &self,
        photo: &'a Frame<Work>,
        raw: RawSites,
        rect: Rect,
    ) -> Prepared<'a> {
        let raw = raw.in_units_of(self.own_counts_per_level);
        let even = self.evened(photo, &raw, rect);
        let mut prepared = self.place(photo, even, Channels::Colour, rect);
        self.mark_missing(&mut prepared.observation, SiteGains::is_bad);
        let own = self.noise_at(&raw);
        let estimated = prepared.observation.noise;
        self.find_focus(&mut prepared, &|c, light| {
            estimated[c.index()].max(own[c.index()].sigma(light))
        });
        prepared
    }

    /// Makes the coefficients of a JPEG its data, unless the file does not have the photo's size,
    /// or was coded before in coarser steps, whose errors the coefficients do not show.
    fn with_coefficients<'a>(
        &self,
        mut prepared: Prepared<'a>,
        photo: &Frame<Work>,
        coding: &Coding,
        tone: &Tone,
    ) -> Prepared<'a> {
        // Once divided by the dark corner, the light no longer matches the coefficients.
        if self.beyond == Beyond::Dark {
            return prepared;
        }
        let once = !coded_twice(coding);
        let straight = self.photo_side.straightened(None);
        let light_of = |&code: &f32| straight.as_ref().map_or(code, |straight| straight(code));
        let lights: [Vec<f32>; 3] =
            Channel::ALL.map(|c| tone.lights(c).iter().map(light_of).collect());
        let camera_noise = |c| self.noise[Channel::index(c)].sigma(photo.plane(c).mean() as f32);
        let observation = &mut prepared.observation;
        let term = JpegTerm::of(&Stated {
            coding,
            lights: lights.each_ref().map(Vec::as_slice),
            channels: observation.channels,
            photo: &observation.light,
            rect: observation.rect,
            noise_at: &|c, light| self.noise[c.index()].sigma(light.max(0.0)),
            noise: if once { Channel::ALL.map(camera_noise) } else { observation.noise },
            once,
        });
        if let Some(term) = term {
            let interpolated = observation.sampling.interpolated();
            observation.sampling = Arc::new(Jpeg { term, interpolated });
            if !once {
                prepared.notes.push(CODED_TWICE.to_owned());
            }
        }
        prepared
    }

    /// Prepares raw sites of the rig's own sensor: divides them by its gain pattern and marks bad
    /// ones missing. Their noise is what the file states if that is plausible, raised to
    /// [`AVERAGED_MIN`] if below; otherwise the sensor's noise, or the noise in their spectrum if
    /// that is far higher, because the gain may have differed.
    fn prepare_raw<'a>(&self, photo: &'a Frame<Work>, raw: RawSites, rect: Rect) -> Prepared<'a> {
        let raw = raw.in_units_of(self.own_counts_per_level);
        let one_exposure = self.noise_at(&raw);
        let (raw, note) = plausible_noise(raw, &one_exposure);
        let mut even = self.evened(photo, &raw, rect);
        let hot = self.patch_hot_sites(&mut even, &raw, rect);
        let mut prepared = self.place(photo, even, Channels::Colour, rect);
        prepared.notes.extend(hot_note(hot.len()));
        prepared.notes.extend(note);
        self.mark_missing(&mut prepared.observation, SiteGains::is_bad);
        for hot in hot {
            let trust = prepared.observation.trust.plane_mut(raw.mosaic.colour_at(hot.x, hot.y));
            trust.set(rect.x + hot.x, rect.y + hot.y, MISSING);
        }
        let mosaic = raw.mosaic.from_place(rect.x, rect.y);
        for channel in Channel::ALL {
            let plane = prepared.observation.trust.plane_mut(channel);
            for y in 0..plane.height() {
                let row = plane.row_mut(y).iter_mut().enumerate();
                row.filter(|&(x, _)| mosaic.colour_at(x, y) != channel)
                    .for_each(|(_, trust)| *trust = MISSING);
            }
        }
        prepared.observation.sampling = Arc::new(Raw { mosaic });
        self.test_spectrum(&mut prepared, &raw, one_exposure);
        prepared
    }

    /// Sets noise, focus and spectral finding of the raw `photo`, whose sensor has the noise `own`
    /// in one exposure.
    fn test_spectrum(&self, photo: &mut Prepared<'_>, raw: &RawSites, mut own: [Noise; 3]) {
        let sigma = |own: &[Noise; 3], c: Channel, light: f32| {
            let one = own[c.index()].sigma(light);
            raw.noise.map_or(one, |stated| {
                let [at_black, per_level] = stated[c.index()];
                let stated = Noise { at_black, per_level }.sigma(light);
                stated.max(AVERAGED_MIN.sqrt() * one)
            })
        };
        let measured = |c: Channel, light: f32| sigma(&own, c, light);
        let field = self.lens.model.field();
        let data = photo.focus_data(field, &measured);
        let finding = check_spectrum(self.lens.model.functions(), &data, raw.noise.is_none());
        let mean = Channel::ALL.map(|c| photo.photo.plane(c).mean() as f32);
        if let Some(SpectralFinding::Noisier(powers)) = finding {
            let green = Channel::Green.index();
            let one = own[green].sigma(mean[green]);
            own = own.map(|noise| noise.times(powers));
            let factor = own[green].sigma(mean[green]) / one;
            if factor > 1.0 {
                photo.notes.push(format!(
                    "the photo has about {factor:.0} times the measured noise of this rig's \
                     sensor, as at a higher gain; it is restored with that noise"
                ));
            }
            photo.observation.dark_light = own.map(|noise| noise.dark_light());
        }
        let noise_at = |c: Channel, light: f32| sigma(&own, c, light);
        photo.observation.noise = Channel::ALL.map(|c| noise_at(c, mean[c.index()]));
        self.find_focus(photo, &noise_at);
        photo.is_of_sharper_lens = finding == Some(SpectralFinding::SharperLens);
        // At another focus the lens may be sharper than at the panel's.
        if photo.is_of_sharper_lens && photo.focus.is_some() {
            let data = photo.focus_data(field, &noise_at);
            let lens = self.lens_of(photo).model.functions();
            photo.is_of_sharper_lens =
                check_spectrum(lens, &data, false) == Some(SpectralFinding::SharperLens);
        }
    }

    /// The raw `photo`, at `rect` of the canvas, in linear light divided by the sites' gains.
    fn evened<'a>(
        &self,
        photo: &'a Frame<Work>,
        raw: &RawSites,
        rect: Rect,
    ) -> Cow<'a, Frame<Work>> {
        let straight = self.straighten(photo, Some(FULL_SCALE * raw.counts_per_level));
        match self.correction.sites() {
            Some(sites) => Cow::Owned(sites.evened(rect, |c, y| straight.plane(c).row(y).to_vec())),
            None => straight,
        }
    }

    /// `photo` with the camera's response curve undone; its white is `white` counts above black,
    /// where that is known.
    fn straighten<'a>(&self, photo: &'a Frame<Work>, white: Option<f32>) -> Cow<'a, Frame<Work>> {
        match self.photo_side.straightened(white) {
            Some(straight) => Cow::Owned(Frame::from_fn(|c| photo.plane(c).map(&straight))),
            None => Cow::Borrowed(photo),
        }
    }

    /// Places `even`, the linear light of `photo`, at `rect` of the canvas, and estimates noise.
    fn place<'a>(
        &self,
        photo: &Frame<Work>,
        even: Cow<'a, Frame<Work>>,
        channels: Channels,
        rect: Rect,
    ) -> Prepared<'a> {
        let canvas = self.lens.model.canvas();
        let mut flat = even.as_ref().clone();
        if self.beyond == Beyond::Dark {
            self.photo_side.undo_dark_corner(&mut flat);
        }
        let trust = Frame::from_fn(|c| {
            // Taken from `photo`: the sensor saturates before any division.
            let full = SATURATION_SHARE * FULL_SCALE;
            let inner = photo.plane(c).map(|v: f32| if v >= full { SATURATED } else { TRUSTED });
            data_term::place(&inner, canvas, rect, MISSING)
        });
        let light = Frame::from_fn(|c| match self.beyond {
            Beyond::Dark => data_term::place(flat.plane(c), canvas, rect, 0.0),
            Beyond::LikeTheBorder => data_term::place_with_edges(flat.plane(c), canvas, rect),
        });
        let estimate = |c: Channel| self.estimate_noise(c, even.plane(c));
        let (red, (green, blue)) = rayon::join(
            || estimate(Channel::Red),
            || rayon::join(|| estimate(Channel::Green), || estimate(Channel::Blue)),
        );
        let estimates = [red, green, blue];
        let sampling = Developed {
            interpolated: self
                .correction
                .layout()
                .canvas_mosaic()
                .filter(|_| channels == Channels::Colour),
            has_blocks: estimates.iter().any(|noise| noise.coding > 0.0),
        };
        let observation = Observation {
            light,
            trust,
            rect,
            channels,
            noise: estimates.map(|noise| noise.sigma),
            dark_light: self.noise.map(|noise| noise.dark_light()),
            sampling: Arc::new(sampling),
        };
        Prepared {
            photo: even,
            observation,
            focus: None,
            lens: None,
            is_of_sharper_lens: false,
            sensor: None,
            outliers: None,
            notes: Vec::new(),
            lens_alone: OnceLock::new(),
            untouched: OnceLock::new(),
        }
    }

    /// Marks as missing the pixels of the photo for which `is_bad` returns true.
    fn mark_missing(
        &self,
        observation: &mut Observation,
        is_bad: impl Fn(&SiteGains, Channel, usize, usize) -> bool,
    ) {
        let Some(sites) = self.correction.sites() else { return };
        let Rect { x: left, y: top, size } = observation.rect;
        for c in Channel::ALL {
            let trust = observation.trust.plane_mut(c);
            for y in top..top + size.height {
                for x in (left..left + size.width).filter(|&x| is_bad(sites, c, x, y)) {
                    trust.set(x, y, MISSING);
                }
            }
        }
    }

    /// Estimates the noise of one channel of `photo` from its pixels, or takes the camera's noise
    /// at its mean light if that is larger. A JPEG's coding errors are added: they are absent from
    /// the pixels that the estimate uses, but not from the others.
    fn estimate_noise(&self, channel: Channel, photo: &Plane) -> EstimatedNoise {
        let camera = self.noise[channel.index()].sigma(photo.mean() as f32);
        let sigma = data_term::noise_of(photo).max(camera);
        let coding = blocking_of(photo);
        EstimatedNoise { sigma: sigma.hypot(coding), coding }
    }
}

/// Replaces the missing pixels of a photo by a smooth continuation of the others; otherwise a hot
/// site would be part of a solve's initial value.
fn fill_missing(observation: &mut Observation) {
    let rect = observation.rect;
    for c in Channel::ALL {
        let is_missing = observation.trust.plane(c).crop(rect).map(|trust| trust == MISSING);
        smoothing::fill(observation.light.plane_mut(c), &is_missing, rect);
    }
}

/// Marks in `trust`, on the canvas, the pixels of the photo at `rect` that are `saturated`.
fn mark_saturated(trust: &mut Frame<Work, u8>, rect: Rect, saturated: &Frame<Work, bool>) {
    for c in Channel::ALL {
        let (trust, saturated) = (trust.plane_mut(c), saturated.plane(c));
        for y in 0..rect.size.height {
            let row = trust.row_mut(rect.y + y)[rect.x..].iter_mut().zip(saturated.row(y));
            row.filter(|(trust, is)| **is && **trust == TRUSTED)
                .for_each(|(trust, _)| *trust = SATURATED);
        }
    }
}

/// Noise of one channel, σ in grey levels.
#[derive(Debug, Clone, Copy)]
struct EstimatedNoise {
    /// Total noise.
    sigma: f32,
    /// Coding error alone; 0 if the photo shows no blocks.
    coding: f32,
}
