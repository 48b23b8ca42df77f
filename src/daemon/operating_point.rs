//! The operating point chosen for a rig, kept beside its calibration as a small file that people
//! can read.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DaemonError, atomic_file};
use crate::config::{self, Method};
use crate::disk::LocalDisk;
use crate::pipeline::{Chosen, Setting};

/// Name of the file beside the calibration's slots.
const NAME: &str = "operating-point.toml";
/// What it begins with.
const HEAD: &str = "# Chosen and written by `relens calibrate`, on scenes shown on this rig.\n\n";

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
struct Kept {
    /// Identity of the rig it was chosen on, in hexadecimal.
    rig: String,
    chosen: Chosen,
}

/// What was chosen on `rig` for what its file asks; nothing when it asks for nothing.
///
/// # Errors
/// Why nothing chosen can be used, in words.
pub fn load(slots: &Path, rig: &config::Rig) -> Result<Option<Chosen>, String> {
    let Some(wanted) = rig.restore.operating_point else { return Ok(None) };
    let path = slots.join(NAME);
    let name = path.display();
    let text = match std::fs::read_to_string(&path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(format!("there is no {name}"));
        }
        Err(error) => return Err(format!("cannot read {name}: {error}")),
    };
    let kept: Kept =
        toml::from_str(&text).map_err(|e| format!("{name} is damaged: {}", e.message()))?;
    if kept.rig != identity(rig) {
        return Err(format!("{name} is of rig {}; this is rig {}", kept.rig, identity(rig)));
    }
    let found = kept.chosen.operating_point;
    if found != wanted {
        return Err(format!(
            "{name} is `{}`; the rig file asks for `{}`",
            found.name(),
            wanted.name()
        ));
    }
    let Setting { method, steps, correction_steps, captures_max, rounds } = kept.chosen.setting;
    let sane = |n: u32| (1..=10_000).contains(&n);
    let without = method == Method::BlockMatching && captures_max == 0;
    if !([steps, correction_steps, rounds].into_iter().all(sane) && (without || sane(captures_max)))
    {
        return Err(format!(
            "{name} is damaged: it has steps, rounds or captures that are not 1 to 10000"
        ));
    }
    Ok(Some(kept.chosen))
}

/// Keeps what was `chosen` on `rig`, whole or not at all.
///
/// # Errors
/// When it cannot.
pub fn save(slots: &Path, rig: &config::Rig, chosen: &Chosen) -> Result<(), DaemonError> {
    let kept = Kept { rig: identity(rig), chosen: *chosen };
    let text = toml::to_string(&kept).map_err(std::io::Error::other);
    let text = text.and_then(|text| Ok((format!("{HEAD}{text}"), slots.canonicalize()?)));
    let (text, slots) = text.map_err(DaemonError::files("write", slots))?;
    let disk = LocalDisk::new(vec![slots.clone()]);
    atomic_file::replace(&disk, &slots, NAME.as_ref(), text.as_bytes())?;
    atomic_file::sync_folder(&disk, &slots)
}

/// What photos on `rig` are restored with: `method` if one is asked for, else what was chosen, else
/// what its file says.
pub fn setting(slots: &Path, rig: &config::Rig, method: Option<Method>) -> Setting {
    let filed = Setting::as_filed(rig, method.unwrap_or(rig.restore.method));
    if method.is_some() {
        return filed;
    }
    match load(slots, rig) {
        Ok(chosen) => chosen.map_or(filed, |chosen| chosen.setting),
        Err(reason) => {
            log::warn!(
                "no operating point to use: {reason}; restoring with {filed}; `relens calibrate` \
                 chooses one"
            );
            filed
        }
    }
}

fn identity(rig: &config::Rig) -> String {
    format!("{:016x}", rig.identity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::OperatingPoint;

    fn rig() -> config::Rig {
        let mut rig = config::load(Path::new("small.toml")).unwrap();
        rig.restore.operating_point = Some(OperatingPoint::Fast);
        rig
    }

    fn chosen(rig: &config::Rig) -> Chosen {
        Chosen {
            operating_point: OperatingPoint::Fast,
            setting: Setting { steps: 5, ..Setting::as_filed(rig, Method::Digital) },
            seconds: 0.5,
            ssim: 0.93,
            psnr_db: 32.0,
            best_ssim: 0.94,
            photo_ssim: 0.85,
        }
    }

    #[test]
    fn what_was_chosen_is_what_is_restored_with_unless_a_method_is_asked_for() {
        let (folder, rig) = (tempfile::tempdir().unwrap(), rig());
        let slots = folder.path();
        assert_eq!(setting(slots, &rig, None), Setting::as_filed(&rig, rig.restore.method));
        save(slots, &rig, &chosen(&rig)).unwrap();
        assert_eq!(load(slots, &rig), Ok(Some(chosen(&rig))));
        assert_eq!(setting(slots, &rig, None).steps, 5);
        assert_eq!(
            setting(slots, &rig, Some(Method::Wiener)),
            Setting::as_filed(&rig, Method::Wiener)
        );
        let text = std::fs::read_to_string(slots.join(NAME)).unwrap();
        assert!(
            text.contains("operating-point = \"fast\"") && text.contains("method = \"digital\""),
            "{text}"
        );
    }

    #[test]
    fn what_was_chosen_for_something_else_or_is_damaged_is_not_used() {
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
            assert!(load(slots, &rig).unwrap_err().contains("damaged"));
        }
        std::fs::write(&path, &text).unwrap();
        rig.restore.operating_point = Some(OperatingPoint::Best);
        assert!(load(slots, &rig).unwrap_err().contains("asks for `best`"));
        rig.identity ^= 1;
        assert!(load(slots, &rig).unwrap_err().contains("is of rig"));
        rig.restore.operating_point = None;
        assert_eq!(load(slots, &rig), Ok(None));
    }
}
