//! A photo binned to the solving grid, and its result carried back to the photo's own pixels.

use crate::frame::binning::{bin, corrected, is_any};
use crate::frame::{Channels, CoarseResult, FULL_SCALE, Frame, RawSites, Work};
use crate::picture::Photo;
use crate::pipeline::{Outcome, PhotoData, Recorded, SATURATION_SHARE, Verdict};

/// Threshold of the photo's detail within binned pixels, in standard deviations of its noise.
/// Measured on `truthful.toml` with half its pitch, binned by 2: without a threshold SSIM falls by
/// 0.002 to 0.010; without that detail PSNR falls by 0.03 to 0.06 dB.
const FINE_SIGMAS: f32 = 2.0;

/// A binned photo.
pub(super) struct BinnedPhoto {
    /// Mean light of each bin.
    pub(super) light: Frame<Work>,
    saturated: Frame<Work, bool>,
    channels: Channels,
    raw: Option<RawSites>,
}

impl BinnedPhoto {
    /// Bins `photo` by `by` pixels along each side.
    pub(super) fn of(photo: &Photo, by: usize) -> BinnedPhoto {
        let full = SATURATION_SHARE * FULL_SCALE;
        BinnedPhoto {
            light: Frame::from_fn(|c| bin(photo.light.plane(c), by)),
            saturated: Frame::from_fn(|c| is_any(photo.light.plane(c), by, |v| v >= full)),
            channels: photo.channels,
            raw: photo.raw,
        }
    }

    /// The binned data for the pipeline.
    pub(super) fn data(&self) -> PhotoData<'_> {
        let BinnedPhoto { light, saturated, channels, raw } = self;
        let recorded = Recorded::Binned { saturated, raw: *raw };
        PhotoData { light, channels: *channels, recorded }
    }

    /// Carries the `outcome` from the solving grid to that of `photo`, and adds a note. `noise` is
    /// the σ of the binned light, in grey levels.
    pub(super) fn carry(&self, outcome: &mut Outcome, photo: &Photo, noise: [f32; 3]) {
        if outcome.verdict == Verdict::Untouched {
            return;
        }
        let (solved, own) = (self.light.size(), photo.light.size());
        let by = own.width / solved.width;
        let means = [&outcome.picture, &self.light]
            .map(|means| Frame::from_fn(|c| corrected(means.plane(c), own)));
        outcome.coarse = Some(CoarseResult {
            means,
            thresholds: noise.map(|sigma| FINE_SIGMAS * by as f32 * sigma),
            channels: self.channels,
            is_turned: false,
        });
        outcome.notes.push(format!("solved at {solved} (binned by {by}), delivered at {own}"));
    }
}
