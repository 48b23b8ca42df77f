//! What a raw photo says of the camera that took it, and how that is written.

use serde::{Deserialize, Serialize};

/// The camera of a raw photo.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PhotoCamera {
    /// Maker and model.
    pub name: String,
    /// Its serial number.
    pub serial: Option<String>,
    /// How the rig was set, of photos that relens has taken.
    pub setting: Option<RigSetting>,
}

/// A rig at the time of a photo.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RigSetting {
    /// The rig file's identity.
    pub identity: u64,
    /// Focus ring and aperture in the owner's words.
    pub focus: Option<String>,
}

/// What a raw photo says beyond its counts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RawTags<'a> {
    /// The camera's serial number.
    pub serial: Option<&'a str>,
    /// How the rig was set.
    pub setting: Option<&'a RigSetting>,
    /// What light of sRGB's red, green and blue gives in each of the three channels, in one unit
    /// for all; where it is not known the channels are taken for sRGB's.
    pub gains: Option<[[f64; 3]; 3]>,
    /// The variance of the sites in red, green and blue, where it is known: what light of 0 to 1
    /// adds to it, and without light (DNG 1.4, NoiseProfile).
    pub noise: Option<[[f64; 2]; 3]>,
}

/// Beginning of a description of ours, and of the second part of it.
const RIG: &str = "relens rig ";
const FOCUS: &str = "; focus ";

impl RigSetting {
    /// The words for the description, which other programs show and hand on.
    pub(super) fn words(&self) -> String {
        let focus = self.focus.as_ref().map(|focus| format!("{FOCUS}{focus}"));
        format!("{RIG}{:016x}{}", self.identity, focus.unwrap_or_default())
    }

    /// What [`RigSetting::words`] said; `None` of any other words.
    pub(super) fn of_words(words: &str) -> Option<RigSetting> {
        let said = words.strip_prefix(RIG)?;
        let (identity, focus) = said.split_once(FOCUS).map_or((said, None), |(i, f)| (i, Some(f)));
        let identity = u64::from_str_radix(identity, 16).ok()?;
        Some(RigSetting { identity, focus: focus.map(str::to_owned) })
    }
}
