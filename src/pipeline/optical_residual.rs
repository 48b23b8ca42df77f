//! The optical residual of a finished picture: how far its photograph is from the photo.

use serde::{Deserialize, Serialize};

use super::judging::limits::{CONFIRMED, NEARLY_CONFIRMED, NOISY_GREY_LEVELS};

/// RMS difference between a finished picture's photograph and the photo.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "WrittenResidual", into = "WrittenResidual")]
pub struct OpticalResidual {
    /// The difference, grey levels of 255.
    pub residual_grey_levels: f64,
    /// The difference that noise alone would leave, grey levels of 255.
    pub floor_grey_levels: f64,
    /// The focus of the comparison.
    pub focus: CertifiedFocus,
    /// Whether the photo may be another sensor's: it shows too little of any gain pattern.
    pub of_any_sensor: bool,
}

/// An [`OpticalResidual`] in a report: one number, smaller is better, and its unit.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
struct WrittenResidual {
    times_noise: f64,
    noise_grey_levels: f64,
    focus: CertifiedFocus,
    of_any_sensor: bool,
}

impl From<OpticalResidual> for WrittenResidual {
    fn from(residual: OpticalResidual) -> WrittenResidual {
        WrittenResidual {
            times_noise: residual.ratio(),
            noise_grey_levels: residual.floor_grey_levels,
            focus: residual.focus,
            of_any_sensor: residual.of_any_sensor,
        }
    }
}

impl From<WrittenResidual> for OpticalResidual {
    fn from(written: WrittenResidual) -> OpticalResidual {
        OpticalResidual {
            residual_grey_levels: written.times_noise * written.noise_grey_levels,
            floor_grey_levels: written.noise_grey_levels,
            focus: written.focus,
            of_any_sensor: written.of_any_sensor,
        }
    }
}

/// The focus at which a picture's photograph is compared with the photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CertifiedFocus {
    /// The panel's focus, which confirms nothing about a nearer or farther scene.
    Panel,
    /// The photo's own focus, found among those at which the lens was measured.
    Photo,
}

/// What the photograph of a finished picture confirms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Confirmation {
    /// The photograph is the photo.
    Full,
    /// The photograph is the photo, as far as its strong noise shows.
    Noisy,
    /// The photograph is the photo, provided that this sensor took it.
    Unproven,
    /// The photograph is nearly the photo.
    Nearly,
    /// The photograph differs from the photo.
    Not,
}

impl OpticalResidual {
    /// Residual over floor; 1 is perfect.
    pub fn ratio(&self) -> f64 {
        self.residual_grey_levels / self.floor_grey_levels.max(1e-9)
    }

    /// The ratio in words.
    pub fn words(&self) -> String {
        match self.ratio() {
            r if r <= 1.0 => "no more than noise alone would leave".to_owned(),
            r => format!("{r:.2} times what noise alone would leave"),
        }
    }

    /// What the photograph confirms.
    pub fn confirmation(&self) -> Confirmation {
        match self.ratio() {
            r if r <= CONFIRMED && self.floor_grey_levels > NOISY_GREY_LEVELS => {
                Confirmation::Noisy
            }
            r if r <= CONFIRMED && self.of_any_sensor => Confirmation::Unproven,
            r if r <= CONFIRMED => Confirmation::Full,
            r if r <= NEARLY_CONFIRMED => Confirmation::Nearly,
            _ => Confirmation::Not,
        }
    }

    /// The user's sentence on what the photograph confirms.
    pub fn meaning(&self) -> String {
        let finding = match self.confirmation() {
            Confirmation::Full => "is your photo",
            Confirmation::Noisy => "is your photo as far as its strong noise shows",
            Confirmation::Unproven => "is your photo, supposing that this camera took it",
            Confirmation::Nearly => "is nearly your photo",
            Confirmation::Not => "still differs from your photo",
        };
        let proviso = self.proviso();
        format!("Photographed through the lens again, this picture {finding}{proviso}.")
    }

    /// The condition appended to a confirmation.
    pub fn proviso(&self) -> &'static str {
        match (self.confirmation(), self.focus) {
            (Confirmation::Not, _) | (_, CertifiedFocus::Photo) => "",
            (_, CertifiedFocus::Panel) => ", if the scene was as far away as the panel",
        }
    }
}
