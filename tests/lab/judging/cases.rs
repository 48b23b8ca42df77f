//! Cases: ways to keep a photo, and faults in growing strengths.

use crate::change::{Change, NOTHING, SWEPT, Swept, To, lens};
use crate::jpeg_coder::Quality;

/// How a photo is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kept {
    /// As the rig wants it: raw sites, if its sensor has filters.
    Own,
    /// Developed by its camera.
    Developed,
    /// Developed, as a JPEG.
    Jpeg(Quality),
}

impl Kept {
    pub(crate) fn name(self) -> String {
        match self {
            Kept::Own => "as the rig wants it".to_owned(),
            Kept::Developed => "developed".to_owned(),
            Kept::Jpeg(quality) => format!("JPEG {}", quality.name().replace(',', "")),
        }
    }
}

/// A JPEG of `quality`, one sample of chroma for `pixels` across and down.
const fn jpeg(quality: u32, pixels: usize) -> Kept {
    Kept::Jpeg(Quality { quality, pixels: (pixels, pixels) })
}

/// Forms in which ordinary photos are kept.
pub(crate) const ORDINARY: [Kept; 5] =
    [Kept::Own, Kept::Developed, jpeg(95, 1), jpeg(85, 2), jpeg(60, 2)];

/// Faults of the sweep that do not apply here: patch sizes concern other methods, JPEGs are
/// ordinary photos, and at another photo's distance the lens is refocused.
const ELSEWHERE: [&str; 4] =
    ["patch below the blur", "patch up to the frame", "photo's JPEG", "photo's distance"];

/// A scene nearer or farther than the panel, while the lens stays focused on the panel.
static SCENE_ELSEWHERE: Swept = Swept {
    change: Change {
        name: "scene's distance",
        unit: "m",
        to: To::Camera(|rig, metres| {
            lens(rig, |lens| {
                lens.focus_distance_mm.get_or_insert(lens.object_distance_mm);
                lens.scene_distance_mm = Some(1000.0 * metres);
            });
        }),
    },
    strengths: |_| [4.0, 3.2, 5.5, 2.0, 1.0],
};

/// The faults with their strengths.
pub(crate) fn faults() -> Vec<&'static Swept> {
    let here = SWEPT.iter().filter(|swept| !ELSEWHERE.contains(&swept.change.name));
    here.chain([&SCENE_ELSEWHERE]).collect()
}

/// No fault.
pub(crate) static NONE: Swept = Swept { change: NOTHING, strengths: |_| [0.0; 5] };
