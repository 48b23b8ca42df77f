//! A method with the numbers chosen for a rig, and the scores of that choice.

use serde::{Deserialize, Serialize};

use crate::config::{self, OperatingPoint, RigFile};
use crate::deconvolution::method::digital::Digital;
use crate::deconvolution::method::hybrid;

/// A method and its numbers, as chosen for a rig; all other numbers are those of the rig file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Setting {
    /// The method.
    pub method: config::MethodName,
    /// Steps of the solve with the lens model.
    pub steps: u32,
    /// Steps of each correction of the hybrid method.
    pub correction_steps: u32,
    /// Maximum number of captures per photo: at least 1 for the hybrid, from 0 for block matching.
    pub captures_max: u32,
    /// Rounds of block matching per solve; unused by other methods.
    pub rounds: u32,
}

impl Setting {
    /// `method` with the numbers of the rig file.
    pub fn as_filed(rig: &RigFile, method: config::MethodName) -> Setting {
        Setting {
            method,
            steps: Digital::default().steps,
            correction_steps: match method {
                config::MethodName::BlockMatching => hybrid::STEPS_BEFORE_BLOCKS,
                _ => hybrid::CORRECTION_STEPS,
            },
            captures_max: 1 + rig.restore.corrections_max as u32,
            rounds: rig.restore.block_rounds as u32,
        }
    }

    /// Whether the numbers are in range: 1 to 10 000, and captures from 0 for block matching.
    pub fn is_sane(&self) -> bool {
        let Setting { method, steps, correction_steps, captures_max, rounds } = *self;
        let sane = |n: u32| (1..=10_000).contains(&n);
        let without = method == config::MethodName::BlockMatching && captures_max == 0;
        [steps, correction_steps, rounds].into_iter().all(sane) && (without || sane(captures_max))
    }

    /// The numbers in words; empty for a method without any.
    pub fn numbers(&self) -> String {
        let Setting { method, steps, correction_steps, captures_max, rounds } = *self;
        let (captures, rounds) =
            (captures_at_most(captures_max), counted(rounds as usize, "round"));
        match method {
            config::MethodName::Digital => counted(steps as usize, "step"),
            config::MethodName::Hybrid => format!("{steps}+{correction_steps} steps, {captures}"),
            config::MethodName::BlockMatching if captures_max == 0 => {
                format!("{}, {rounds}, {captures}", counted(steps as usize, "step"))
            }
            config::MethodName::BlockMatching => {
                format!("{steps}+{correction_steps} steps, {rounds}, {captures}")
            }
            _ => String::new(),
        }
    }
}

/// `count` with the noun `thing` in its singular or plural.
pub(crate) fn counted(count: usize, thing: &str) -> String {
    format!("{count} {thing}{}", if count == 1 { "" } else { "s" })
}

fn captures_at_most(most: u32) -> String {
    if most == 0 {
        "no capture".to_owned()
    } else {
        format!("{} at most", counted(most as usize, "capture"))
    }
}

impl std::fmt::Display for Setting {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (name, numbers) = (self.method.name(), self.numbers());
        if numbers.is_empty() { f.write_str(name) } else { write!(f, "{name}, {numbers}") }
    }
}

/// A rig's operating point: the request, the choice, and its scores on scenes shown on that rig.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Chosen {
    /// The rig file's request.
    pub operating_point: OperatingPoint,
    /// The chosen method and numbers.
    pub setting: Setting,
    /// Seconds for each photo, captures and computing.
    pub seconds: f64,
    /// Mean SSIM of the scenes.
    pub ssim: f64,
    /// Mean PSNR of the scenes, dB.
    pub psnr_db: f64,
    /// Mean SSIM of the best setting tried.
    pub best_ssim: f64,
    /// Mean SSIM of the untouched photos.
    pub photo_ssim: f64,
}

impl std::fmt::Display for Chosen {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Chosen { operating_point, setting, seconds, ssim, psnr_db, best_ssim, photo_ssim } =
            self;
        write!(
            f,
            "{}: {setting}; {seconds:.2} s a photo, SSIM {ssim:.4} (best {best_ssim:.4}, \
             untouched {photo_ssim:.4}), \
             PSNR {psnr_db:.2} dB on scenes shown on this rig",
            operating_point.name()
        )
    }
}
