//! The operating point chosen for a rig, kept beside its calibration as a small TOML file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{identity, keep, kept};
use crate::config::{self, MethodName};
use crate::disk::FileError;
use crate::pipeline::{Chosen, Setting};
use crate::remedy::full_message;

const NAME: &str = "operating-point.toml";
const HEAD: &str = "# Chosen and written by `relens calibrate`, on scenes shown on this rig.\n\n";

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct KeptPoint {
    /// Identity of the rig it was chosen on.
    rig: String,
    chosen: Chosen,
}

/// Reads the operating point chosen for `rig`; `None` if the rig file requests none.
///
/// # Errors
/// When there is no valid choice for the request; names the file and what is wrong.
pub fn load(slots: &Path, rig: &config::RigFile) -> Result<Option<Chosen>, String> {
    let Some(wanted) = rig.restore.operating_point else { return Ok(None) };
    let path = slots.join(NAME);
    let damaged = |what: &str| format!("{} is damaged: {what}", path.display());
    let bytes = kept(slots, NAME).map_err(|error| full_message(&error))?;
    let bytes = bytes.ok_or_else(|| format!("there is no {}", path.display()))?;
    let point: KeptPoint = toml::from_slice(&bytes).map_err(|error| damaged(error.message()))?;
    let of = |rig: &str, point: &str| format!("rig {rig} for `{point}`");
    let found = of(&point.rig, point.chosen.operating_point.name());
    let allowed = of(&identity(rig), wanted.name());
    if found != allowed {
        return Err(format!("{} was chosen for {found}; allowed is {allowed}", path.display()));
    }
    if !point.chosen.setting.is_sane() {
        return Err(damaged("it has steps, rounds or captures that are not 1 to 10000"));
    }
    Ok(Some(point.chosen))
}

/// Keeps the operating point `chosen` for `rig`, whole or not at all.
///
/// # Errors
/// When the file cannot be written.
pub fn save(slots: &Path, rig: &config::RigFile, chosen: &Chosen) -> Result<(), FileError> {
    let point = KeptPoint { rig: identity(rig), chosen: *chosen };
    let text = toml::to_string(&point).map_err(std::io::Error::other);
    let text = text.map_err(FileError::at("write", &slots.join(NAME)))?;
    keep(slots, NAME, format!("{HEAD}{text}").as_bytes())
}

/// Setting for photos on `rig`: for `method` if given, else the chosen operating point, else the
/// rig file's.
pub fn setting(slots: &Path, rig: &config::RigFile, method: Option<MethodName>) -> Setting {
    let filed = Setting::as_filed(rig, method.unwrap_or(rig.restore.method));
    if method.is_some() {
        return filed;
    }
    match load(slots, rig) {
        Ok(chosen) => chosen.map_or(filed, |chosen| chosen.setting),
        Err(reason) => {
            log::warn!(
                "no operating point: {reason}; restoring with {filed}; `relens calibrate` chooses \
                 one"
            );
            filed
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::OperatingPoint;

    fn rig() -> config::RigFile {
        let mut rig = config::load(Path::new("small.toml")).unwrap();
        rig.restore.operating_point = Some(OperatingPoint::Fast);
        rig
    }

    fn chosen(rig: &config::RigFile) -> Chosen {
        Chosen {
            operating_point: OperatingPoint::Fast,
            setting: Setting { steps: 5, ..Setting::as_filed(rig, MethodName::Digital) },
            seconds: 0.5,
            ssim: 0.93,
            psnr_db: 32.0,
            best_ssim: 0.94,
            photo_ssim: 0.85,
        }
    }

    fn refused(slots: &Path, rig: &config::RigFile) -> String {
        load(slots, rig).unwrap_err()
    }

    #[test]
    fn the_choice_is_used_unless_a_method_is_given() {
        let (folder, rig) = (tempfile::tempdir().unwrap(), rig());
        let slots = folder.path();
        assert_eq!(setting(slots, &rig, None), Setting::as_filed(&rig, rig.restore.method));
        save(slots, &rig, &chosen(&rig)).unwrap();
        assert_eq!(load(slots, &rig).unwrap(), Some(chosen(&rig)));
        assert_eq!(setting(slots, &rig, None).steps, 5);
        assert_eq!(
            setting(slots, &rig, Some(MethodName::Wiener)),
            Setting::as_filed(&rig, MethodName::Wiener)
        );
        let text = std::fs::read_to_string(slots.join(NAME)).unwrap();
        assert!(
            text.contains("operating-point = \"fast\"") && text.contains("method = \"digital\""),
            "{text}"
        );
    }

    #[test]
    fn a_damaged_choice_or_one_for_another_rig_is_not_used() {
        let (folder, mut rig) = (tempfile::tempdir().unwrap(), rig());
        let slots = folder.path();
        save(slots, &rig, &chosen(&rig)).unwrap();
        let path = slots.join(NAME);
        let text = std::fs::read_to_string(&path).unwrap();
        let broken = [
            text.replace("steps = 5", "steps = 0"),
            text.replace("digital", "numerical"),
            text[..text.len() / 2].into(),
        ];
        for broken in broken {
            std::fs::write(&path, broken).unwrap();
            assert!(refused(slots, &rig).contains("damaged"));
        }
        std::fs::write(&path, &text).unwrap();
        rig.restore.operating_point = Some(OperatingPoint::Best);
        assert!(refused(slots, &rig).contains("for `fast`; allowed is rig"));
        rig.identity ^= 1;
        assert!(refused(slots, &rig).contains("was chosen for rig"));
        rig.restore.operating_point = None;
        assert_eq!(load(slots, &rig).unwrap(), None);
    }
}
