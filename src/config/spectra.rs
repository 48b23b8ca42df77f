//! Spectra of a simulated rig: panel, scene and colour filters.

use serde::{Deserialize, Serialize};
use toml::Value;

use super::keys::words;

words! {
    /// Spectra of panel, scene and colour filters.
    pub enum SpectralLight {
        /// An LCD with a white LED behind it, and a scene's broad light through colour filters.
        Broad = "broad",
        /// One wavelength per channel for both, as in the study.
        Lines = "lines",
    }
}

/// Wavelengths in nm with their weights: red, green, blue.
type Spectra = [&'static [(f64, f64)]; 3];

impl SpectralLight {
    /// One wavelength per channel (study).
    const LINES: Spectra = [&[(610.0, 1.0)], &[(540.0, 1.0)], &[(465.0, 1.0)]];
    /// Narrow blue, phosphor green and red. Guesses.
    const LED_PANEL: Spectra = [
        &[(605.0, 0.6), (620.0, 1.0), (635.0, 0.5)],
        &[(520.0, 0.5), (540.0, 1.0), (560.0, 0.6)],
        &[(445.0, 0.6), (455.0, 1.0), (470.0, 0.5)],
    ];
    /// Colour filters in broad light. Guesses.
    const FILTERS: Spectra = [
        &[(590.0, 0.8), (610.0, 1.0), (640.0, 0.6)],
        &[(505.0, 0.5), (535.0, 1.0), (570.0, 0.6)],
        &[(435.0, 0.6), (460.0, 1.0), (490.0, 0.5)],
    ];

    /// Spectra of the panel's primaries, as a table.
    pub(super) fn primaries(self) -> Value {
        table_of(match self {
            SpectralLight::Broad => Self::LED_PANEL,
            SpectralLight::Lines => Self::LINES,
        })
    }

    /// Spectra of a scene's light behind the filters, as a table.
    pub(super) fn filters(self) -> Value {
        table_of(match self {
            SpectralLight::Broad => Self::FILTERS,
            SpectralLight::Lines => Self::LINES,
        })
    }
}

fn table_of(spectra: Spectra) -> Value {
    let pair = |&(nm, weight): &(f64, f64)| Value::from(vec![nm, weight]);
    let list = |spectrum: &[(f64, f64)]| Value::from(spectrum.iter().map(pair).collect::<Vec<_>>());
    let names = ["red-nm", "green-nm", "blue-nm"].map(str::to_owned);
    Value::Table(names.into_iter().zip(spectra.map(list)).collect())
}

/// A wavelength in nm and its weight relative to the others of its list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wavelength(pub f64, pub f64);

/// Wavelengths of the three channels with their relative weights.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub struct Primaries {
    pub red_nm: Vec<Wavelength>,
    pub green_nm: Vec<Wavelength>,
    pub blue_nm: Vec<Wavelength>,
}

impl Primaries {
    /// The lists of red, green and blue.
    pub fn lists(&self) -> [&[Wavelength]; 3] {
        [&self.red_nm, &self.green_nm, &self.blue_nm]
    }
}
