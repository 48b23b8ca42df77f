//! A picture as people see it, and its distance from the scene: brightness, colour, edges.

use relens::chart::appearance::{display_luminance, edges, lab_colours};
use relens::deconvolution::quality::ssim;
use relens::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use relens::picture::{Lab, Tone};

/// Display luminance below which a place of the scene counts as dark: dark grey print.
const DARK: f32 = 75.0;

/// A picture prepared for scoring.
#[derive(Debug, Clone)]
pub(crate) struct Appearance {
    codes: [Plane; 3],
    colours: Vec<Lab>,
    luminance: Plane,
}

/// Distances of a picture from its scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AppearanceScores {
    /// SSIM of luminance.
    pub(crate) ssim: f64,
    /// PSNR of the codes of all channels, dB.
    pub(crate) rgb_db: f64,
    /// Mean C*ab of the picture.
    pub(crate) chroma: f64,
    /// 99th percentile of C*ab of the picture.
    pub(crate) chroma_99th: f64,
    /// Mean error of a* and b* at the scene's dark places.
    pub(crate) dark_cast: [f64; 2],
    /// Mean ΔE (CIEDE2000).
    pub(crate) difference: f64,
    /// Mean ΔE at the scene's edges.
    pub(crate) edge_difference: f64,
}

impl Appearance {
    /// Appearance of linear light shown with the curve of `tone`.
    pub(crate) fn new(tone: &Tone, light: &Frame<Work>) -> Appearance {
        Appearance {
            codes: Channel::ALL.map(|c| tone.display(c, light.plane(c))),
            colours: lab_colours(tone, light),
            luminance: display_luminance(tone, light),
        }
    }

    /// Size of the picture.
    pub(crate) fn size(&self) -> Size {
        self.luminance.size()
    }

    /// Codes in bytes: red, green and blue of each pixel in turn.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let [r, g, b] = self.codes.each_ref().map(|plane| plane.data());
        let pixels = r.iter().zip(g).zip(b);
        pixels.flat_map(|((&r, &g), &b)| [r, g, b].map(|v| v.round() as u8)).collect()
    }

    /// Distances from the `scene`, which has the same size.
    pub(crate) fn scores(&self, scene: &Appearance) -> AppearanceScores {
        let squares = |(a, b): (&Plane, &Plane)| -> f64 {
            a.data().iter().zip(b.data()).map(|(a, b)| f64::from(a - b).powi(2)).sum()
        };
        let total: f64 = self.codes.iter().zip(&scene.codes).map(squares).sum();
        let power = total / (3 * self.colours.len()) as f64;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let mut chroma: Vec<f64> = self.colours.iter().map(|colour| colour.chroma()).collect();
        chroma.sort_by(f64::total_cmp);
        let pairs = self.colours.iter().zip(&scene.colours);
        let is_dark: Vec<bool> = scene.luminance.data().iter().map(|&v| v < DARK).collect();
        let cast = |of: fn(&Lab) -> f64| {
            let dark = pairs.clone().zip(&is_dark).filter(|(_, is_dark)| **is_dark);
            mean(&dark.map(|((own, wanted), _)| of(own) - of(wanted)).collect::<Vec<f64>>())
        };
        let dark_cast = [cast(|colour| colour.a), cast(|colour| colour.b)];
        let differences: Vec<f64> = pairs.map(|(a, b)| a.difference(*b)).collect();
        let edges = edges(&scene.luminance);
        let at_edges: Vec<f64> =
            differences.iter().zip(&edges).filter(|(_, edge)| **edge).map(|(d, _)| *d).collect();
        AppearanceScores {
            ssim: ssim(&self.luminance, &scene.luminance),
            rgb_db: 10.0 * (f64::from(FULL_SCALE).powi(2) / power).log10(),
            chroma: mean(&chroma),
            chroma_99th: chroma[chroma.len() * 99 / 100],
            dark_cast,
            difference: mean(&differences),
            edge_difference: mean(&at_edges),
        }
    }
}
