//! Who took a raw photo, as far as its file says: whether it can be this rig's, and what is to be
//! told where nothing proves that it is.

use crate::calibration::Noise;
use crate::config::RigFile;
use crate::frame::{FULL_SCALE, RawSites};
use crate::picture::{Flaw, PhotoCamera, RigSetting, dng};
use crate::pipeline::{AVERAGED_MIN, power_share};

/// Why a raw photo of a `camera` that says its name, or none, cannot be this rig's. Of other
/// makers' files only the sites tell: whoever writes a camera's raw files names it his own way.
pub(super) fn of_another_camera(
    config: &RigFile,
    camera: Option<&PhotoCamera>,
    raw: RawSites,
) -> Option<Flaw> {
    if let Some(by_relens) = camera.filter(|camera| camera.name.starts_with(dng::OUR_MAKE)) {
        let (found, allowed) = (by_relens.name.clone(), dng::camera_of(&config.name));
        if found != allowed {
            return Some(Flaw::OtherRig { found, allowed });
        }
        if let (Some(found), Some(allowed)) = (&by_relens.serial, config.camera_serial())
            && found != allowed
        {
            let (found, allowed) = (found.clone(), allowed.to_owned());
            return Some(Flaw::OtherSetting { what: "the camera's number", found, allowed });
        }
        if let Some(RigSetting { focus, .. }) = &by_relens.setting
            && *focus != config.camera.focus
        {
            let words = |focus: &Option<String>| {
                focus.as_ref().map_or("none said".to_owned(), |focus| format!("{focus:?}"))
            };
            let (found, allowed) = (words(focus), words(&config.camera.focus));
            return Some(Flaw::OtherSetting { what: "the focus", found, allowed });
        }
    }
    let allowed = config.photo_mosaic();
    (allowed != Some(raw.mosaic)).then_some(Flaw::OtherSensor { found: raw.mosaic, allowed })
}

/// What `raw` says, its counts in this camera's own unit: others write the same sensor's 10 bits as
/// 16, and its noise and its bend are known by what it counts itself. Bits are shifted, so units
/// differ by a power of two; what else differs is where a file puts its white.
pub(super) fn in_own_counts(config: &RigFile, black: f64, raw: RawSites) -> RawSites {
    let own = (f64::from(config.camera.count_max()) - black) as f32 / FULL_SCALE;
    let shift = (raw.counts_per_level / own).log2().round();
    RawSites { counts_per_level: raw.counts_per_level / shift.exp2(), ..raw }
}

/// Variance that a file states of its noise, as a share of the rig's own, at the least and at the
/// most: of the mean of more exposures than are taken, or of a gain that no camera has, it is not
/// this photo's. Guess.
const BELIEVED: std::ops::RangeInclusive<f32> = 0.01..=100.0;

/// Power below which it is told that a photo is not restored by all of its file's noise: of two
/// exposures or more. The two measures of one exposure differ by less.
const TOLD_BELOW: f32 = 0.6;

/// `raw` with the noise that its file states only if it can be the noise of such sites, whose
/// single exposure has `own`; and what is to be told. A file knows how many exposures it is the
/// mean of, and at which gain; the rig knows its own gain alone.
pub(super) fn believed(raw: RawSites, own: &[Noise; 3]) -> (RawSites, Option<String>) {
    let Some(stated) = raw.noise else { return (raw, None) };
    let share = |n: usize| power_share(stated[n], &own[n]);
    if (0..3).all(|n| BELIEVED.contains(&share(n))) {
        let told = format!(
            "by its file the photo has {:.2} of one exposure's noise: it is restored by {:.2} of \
             it, for what the measured lens misses does not average out",
            share(1).sqrt(),
            AVERAGED_MIN.sqrt()
        );
        return (raw, (share(1) < TOLD_BELOW).then_some(told));
    }
    let told = format!(
        "the noise that the file states is {:.2} times this rig's own: the rig's is taken",
        share(1).sqrt()
    );
    (RawSites { noise: None, ..raw }, Some(told))
}

/// What a report says of the camera of a raw photo.
pub(super) fn told(config: &RigFile, camera: Option<&PhotoCamera>) -> Option<String> {
    let of_another = |who: &str| {
        Some(format!(
            "the file {who} took this photo: it is restored as this rig's camera's, whose size \
             and filters it has, at the panel's focus unless it shows another"
        ))
    };
    match camera {
        None => of_another("does not say what camera"),
        Some(PhotoCamera { name, setting: None, .. }) => of_another(&format!("says that {name}")),
        Some(PhotoCamera { setting: Some(setting), .. }) => {
            let told = "this photo was taken when the rig file said otherwise of the rig: it is \
                        restored as this rig's";
            (setting.identity != config.identity).then(|| told.to_owned())
        }
    }
}
