//! Provenance of a photo, from its file: whether this rig's camera can have taken it, and a note if
//! nothing proves that it did.

use crate::config::RigFile;
use crate::frame::{Mosaic, RawSites};
use crate::picture::{Flaw, PhotoCamera, RigSetting, dng};

/// Reason why this rig cannot have taken the raw photo with the sites `raw`, whose file names
/// `camera`; `None` if it can. Files of other makers are judged by their colour filters alone,
/// because each maker names cameras in its own way.
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
            "is of another sensor: found colour filters {}, allowed {}; develop it and save it as \
             TIFF of 16 bits",
            raw.mosaic.name(),
            allowed.map_or(none, Mosaic::name)
        ))
    })
}

/// Reason for returning a photo unchanged because its file names a `camera` that the rig file does
/// not list; `None` if it may be restored.
pub(super) fn unlisted_camera(config: &RigFile, camera: Option<&PhotoCamera>) -> Option<String> {
    let (found, allowed) = (&camera?.name, &config.photo.cameras);
    let holds = |part: &String| found.to_lowercase().contains(&part.to_lowercase());
    let is_ours = *found == dng::camera_of(&config.name);
    (!allowed.is_empty() && !is_ours && !allowed.iter().any(holds)).then(|| {
        format!(
            "the file names another camera: found {found:?}, allowed names that contain {} \
             (photo.cameras in the rig file); drop photos taken through the rig's lens, or add the \
             camera to photo.cameras",
            allowed.iter().map(|part| format!("{part:?}")).collect::<Vec<_>>().join(" or ")
        )
    })
}

fn other_setting(what: &str, found: &str, allowed: &str) -> Flaw {
    Flaw::OtherCamera(format!(
        "was taken with other settings than the lens was measured with: {what} found {found}, \
         allowed {allowed}; see camera.focus in the rig file"
    ))
}

/// Note for the report if nothing proves that this rig's camera took a raw photo, or if the rig
/// file has changed since.
pub(super) fn camera_note(config: &RigFile, camera: Option<&PhotoCamera>) -> Option<String> {
    let of_another = |file: &str| {
        Some(format!(
            "{file}; its size and colour filters are those of this rig's camera, so it is restored \
             as that camera's photo, at the panel's focus unless the photo shows another"
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sites_of_another_sensor_are_refused_with_a_step() {
        for (rig, allowed) in [("small.toml", "developed photos"), ("truthful.toml", "RGGB")] {
            let rig = crate::config::load(std::path::Path::new(rig)).unwrap();
            let words = other_camera(&rig, None, RawSites::new(Mosaic::Gbrg, 4.0)).unwrap();
            let words = words.to_string();
            let found = format!("found colour filters GBRG, allowed {allowed}");
            assert!(
                words.contains(&found) && words.contains("save it as TIFF of 16 bits"),
                "{words}"
            );
        }
    }

    #[test]
    fn a_listed_camera_or_none_is_taken_and_another_named() {
        let mut rig = crate::config::load(std::path::Path::new("small.toml")).unwrap();
        let why = |rig: &RigFile, name: &str| {
            let camera = PhotoCamera { name: name.to_owned(), serial: None, setting: None };
            unlisted_camera(rig, Some(&camera))
        };
        assert_eq!(why(&rig, "Apple iPhone 6"), None, "nothing is listed");
        rig.photo.cameras = vec!["IMX296".to_owned(), "33UX174".to_owned()];
        assert_eq!(unlisted_camera(&rig, None), None, "the file names none");
        for ours in ["Raspberry Pi /base/soc/i2c0mux/i2c@1/imx296@1a", "relens small"] {
            assert_eq!(why(&rig, ours), None, "{ours}");
        }
        let words = why(&rig, "Apple iPhone 6").unwrap();
        assert!(
            words.contains(r#"found "Apple iPhone 6", allowed names that contain "IMX296" or "#)
        );
        assert!(why(&rig, "relens another").unwrap().contains("photo.cameras in the rig file"));
    }
}
