//! The provenance of a raw photo by its file: whether this rig's camera can have taken it, and the
//! note where nothing proves that it did.

use crate::config::RigFile;
use crate::frame::{Mosaic, RawSites};
use crate::picture::{Flaw, PhotoCamera, RigSetting, dng};

/// The reason why this rig cannot have taken the raw photo of `camera`, the camera its file names;
/// `None` if it can. Files of other makers are told apart by their filters alone, for each names
/// cameras in its own way.
pub(super) fn other_camera(
    config: &RigFile,
    camera: Option<&PhotoCamera>,
    raw: RawSites,
) -> Option<Flaw> {
    if let Some(by_relens) = camera.filter(|camera| camera.name.starts_with(dng::OUR_MAKE)) {
        let (found, allowed) = (by_relens.name.clone(), dng::camera_of(&config.name));
        if found != allowed {
            return Some(Flaw::OtherCamera(format!(
                "was taken by another rig, with another lens: found {found}, allowed {allowed}"
            )));
        }
        if let (Some(found), Some(allowed)) = (&by_relens.serial, config.camera_serial())
            && found != allowed
        {
            return Some(other_setting("the camera's number", found, allowed));
        }
        if let Some(RigSetting { focus, .. }) = &by_relens.setting
            && *focus != config.camera.focus
        {
            let words = |focus: &Option<String>| {
                focus.as_ref().map_or("not stated".to_owned(), |focus| format!("{focus:?}"))
            };
            let (found, allowed) = (words(focus), words(&config.camera.focus));
            return Some(other_setting("the focus", &found, &allowed));
        }
    }
    let allowed = config.unbinned().photo_mosaic();
    (allowed != Some(raw.mosaic)).then(|| {
        let none = "developed photos, for the rig's camera has no raw sites";
        Flaw::OtherCamera(format!(
            "is of another sensor: found colour filters {}, allowed {}",
            raw.mosaic.name(),
            allowed.map_or(none, Mosaic::name)
        ))
    })
}

fn other_setting(what: &str, found: &str, allowed: &str) -> Flaw {
    Flaw::OtherCamera(format!(
        "was taken with other settings than the lens was measured with: {what} found {found}, \
         allowed {allowed}; see camera.focus in the rig file"
    ))
}

/// The report's note on the camera of a raw photo, where nothing proves that it is this rig's.
pub(super) fn camera_note(config: &RigFile, camera: Option<&PhotoCamera>) -> Option<String> {
    let of_another = |file: &str| {
        Some(format!(
            "{file}: the photo is restored as this rig's camera's, whose size and filters it has, \
             at the panel's focus unless it shows another"
        ))
    };
    match camera {
        None => of_another("the file does not name its camera"),
        Some(PhotoCamera { name, setting: None, .. }) => {
            of_another(&format!("the file names {name} as its camera"))
        }
        Some(PhotoCamera { setting: Some(setting), .. }) => {
            let note = "this photo was taken with other settings in the rig file: it is restored \
                        with the present ones";
            (setting.identity != config.identity).then(|| note.to_owned())
        }
    }
}
