//! A raw photo's camera and rig settings, as they stand in the file.

use serde::{Deserialize, Serialize};

/// The camera of a photo by its file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotoCamera {
    /// Maker and model.
    pub name: String,
    /// Its serial number, if a raw photo states it.
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
    /// The response of each channel to light of sRGB's red, green and blue, in one unit; `None`
    /// where the channels count as sRGB's.
    pub gains: Option<[[f64; 3]; 3]>,
    /// Noise variance of the sites in red, green and blue: per unit of light 0..1, and without
    /// light (DNG 1.4, NoiseProfile).
    pub noise: Option<[[f64; 2]; 3]>,
}

/// The beginnings of the two parts of relens's description.
const RIG: &str = "relens rig ";
const FOCUS: &str = "; focus ";

impl RigSetting {
    /// The description, which other programs show and keep.
    pub(super) fn words(&self) -> String {
        let focus = self.focus.as_ref().map(|focus| format!("{FOCUS}{focus}"));
        format!("{RIG}{:016x}{}", self.identity, focus.unwrap_or_default())
    }

    /// The settings in a description by [`RigSetting::words`]; `None` for others.
    pub(super) fn of_words(words: &str) -> Option<RigSetting> {
        let rest = words.strip_prefix(RIG)?;
        let (identity, focus) = rest.split_once(FOCUS).map_or((rest, None), |(i, f)| (i, Some(f)));
        let identity = u64::from_str_radix(identity, 16).ok()?;
        Some(RigSetting { identity, focus: focus.map(str::to_owned) })
    }
}
