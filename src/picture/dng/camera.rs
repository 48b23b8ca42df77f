//! A raw photo's camera and rig settings, as its file states them.

use serde::{Deserialize, Serialize};

/// The camera of a photo, as its file states it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotoCamera {
    /// Maker and model.
    pub name: String,
    /// Serial number, if a raw photo states it.
    pub serial: Option<String>,
    /// The rig's settings, in relens's own photos.
    pub setting: Option<RigSetting>,
}

/// A rig's settings at the time of a photo.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RigSetting {
    /// The rig file's identity.
    pub identity: u64,
    /// Focus ring and aperture in the owner's words.
    pub focus: Option<String>,
}

/// Metadata of a raw photo.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RawTags<'a> {
    /// The camera's serial number.
    pub serial: Option<&'a str>,
    /// The rig's settings.
    pub setting: Option<&'a RigSetting>,
    /// Responses of each channel to sRGB's red, green and blue light, all in one unit; `None` if
    /// the channels are taken as sRGB's.
    pub gains: Option<[[f64; 3]; 3]>,
    /// Noise variance of the sites in red, green and blue: per unit of light 0..1, and without
    /// light (DNG 1.4, NoiseProfile).
    pub noise: Option<[[f64; 2]; 3]>,
}

/// Beginnings of the identity and of the focus in relens's image description.
const RIG: &str = "relens rig ";
const FOCUS: &str = "; focus ";

impl RigSetting {
    /// The settings as an image description, which other programs show and keep.
    pub(super) fn words(&self) -> String {
        let focus = self.focus.as_ref().map(|focus| format!("{FOCUS}{focus}"));
        format!("{RIG}{:016x}{}", self.identity, focus.unwrap_or_default())
    }

    /// The settings in an image description by [`RigSetting::words`]; `None` for another one.
    pub(super) fn of_words(words: &str) -> Option<RigSetting> {
        let rest = words.strip_prefix(RIG)?;
        let (identity, focus) = rest.split_once(FOCUS).map_or((rest, None), |(i, f)| (i, Some(f)));
        let identity = u64::from_str_radix(identity, 16).ok()?;
        Some(RigSetting { identity, focus: focus.map(str::to_owned) })
    }
}
