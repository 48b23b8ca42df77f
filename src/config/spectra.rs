//! Spectra of a simulated rig: panel, scene and colour filters.

use serde::{Deserialize, Serialize};

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

    /// Spectra of the panel's primaries.
    pub(super) fn primaries(self) -> Primaries {
        match self {
            SpectralLight::Broad => Primaries::of(Self::LED_PANEL),
            SpectralLight::Lines => Primaries::of(Self::LINES),
        }
    }

    /// Spectra of a scene's light behind the filters.
    pub(super) fn filters(self) -> Primaries {
        match self {
            SpectralLight::Broad => Primaries::of(Self::FILTERS),
            SpectralLight::Lines => Primaries::of(Self::LINES),
        }
    }
}

/// A wavelength in nm and its weight relative to the others of its list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wavelength(pub f64, pub f64);

/// Wavelengths of the three channels with their relative weights.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[allow(missing_docs)]
pub struct Primaries {
    pub red_nm: Vec<Wavelength>,
    pub green_nm: Vec<Wavelength>,
    pub blue_nm: Vec<Wavelength>,
}

impl Primaries {
    fn of(spectra: Spectra) -> Primaries {
        let list =
            |spectrum: &[(f64, f64)]| spectrum.iter().map(|&(nm, w)| Wavelength(nm, w)).collect();
        let [red_nm, green_nm, blue_nm] = spectra.map(list);
        Primaries { red_nm, green_nm, blue_nm }
    }

    /// The lists of red, green and blue.
    pub fn lists(&self) -> [&[Wavelength]; 3] {
        [&self.red_nm, &self.green_nm, &self.blue_nm]
    }
}
