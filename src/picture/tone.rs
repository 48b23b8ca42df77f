//! The photo's transfer curve: codes to linear light 0..255, and back to the nearest code.

use serde::{Deserialize, Serialize};

use moxcms::{
    Chromaticity, CicpProfile, ColorPrimaries, ColorProfile, DataColorSpace, MatrixCoefficients,
    ToneReprCurve, curve_from_gamma,
};

use crate::config::Curve;
use crate::frame::{Channel, FULL_SCALE, Plane};

/// Colours that a file states elsewhere than in an ICC profile.
#[derive(Debug, Clone)]
pub(super) enum StatedColours {
    /// sRGB.
    Srgb,
    /// Exponent from code to light, `None` for sRGB's curve; x and y of white, red, green and blue,
    /// `None` for sRGB's.
    Measured { gamma: Option<f64>, xy: Option<[f64; 8]> },
    /// Tables from code to light, 0..65535, one for all channels or one for each; x and y as in
    /// [`StatedColours::Measured`].
    Tables { tables: Vec<Vec<u16>>, xy: Option<[f64; 8]> },
    /// Primaries and transfer function stated by numbers of ITU-T H.273.
    Coded(Box<ColorProfile>),
}

impl StatedColours {
    /// sRGB's primaries with a linear curve.
    pub(super) const LINEAR: StatedColours = StatedColours::Measured { gamma: Some(1.0), xy: None };

    /// Adobe RGB (1998), §4.3.
    pub(super) const ADOBE: StatedColours = StatedColours::Measured {
        gamma: Some(2.199_218_75),
        xy: Some([0.3127, 0.329, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06]),
    };

    /// The colours with the numbers `primaries` and `transfer` of ITU-T H.273; `None` if no
    /// ordinary screen has them.
    pub(super) fn coded(primaries: u8, transfer: u8) -> Option<StatedColours> {
        // Logarithmic curves and those of bright screens are not supported.
        if matches!(transfer, 9 | 10 | 16 | 18) {
            return None;
        }
        if (primaries, transfer) == (1, 13) {
            return Some(StatedColours::Srgb);
        }
        let stated = CicpProfile {
            color_primaries: primaries.try_into().ok()?,
            transfer_characteristics: transfer.try_into().ok()?,
            matrix_coefficients: MatrixCoefficients::Identity,
            full_range: true,
        };
        let profile = ColorProfile::new_from_cicp(stated);
        profile.red_trc.is_some().then(|| StatedColours::Coded(Box::new(profile)))
    }

    /// The ICC profile of these colours, a grey one if `grey` is set; `None` for sRGB.
    pub(super) fn profile(&self, grey: bool) -> Option<Vec<u8>> {
        let mut profile = ColorProfile::new_srgb();
        let (xy, curves) = match self {
            StatedColours::Srgb => return None,
            StatedColours::Coded(coded) => {
                profile = coded.as_ref().clone();
                (None, Vec::new())
            }
            StatedColours::Measured { gamma, xy } => {
                (*xy, gamma.iter().map(|&gamma| curve_from_gamma(gamma as f32)).collect())
            }
            StatedColours::Tables { tables, xy } => {
                (*xy, tables.iter().cloned().map(ToneReprCurve::Lut).collect::<Vec<_>>())
            }
        };
        if let [red, .., blue] | [red @ blue] = &curves[..] {
            let green = curves.get(1).unwrap_or(red);
            profile.red_trc = Some(red.clone());
            profile.green_trc = Some(green.clone());
            profile.blue_trc = Some(blue.clone());
        }
        if let Some([wx, wy, rest @ ..]) = xy {
            let [red, green, blue] =
                [0, 2, 4].map(|n| Chromaticity { x: rest[n] as f32, y: rest[n + 1] as f32 });
            let white = Chromaticity { x: wx as f32, y: wy as f32 }.to_xyyb();
            profile.update_rgb_colorimetry(white, ColorPrimaries { red, green, blue });
        }
        if grey {
            let mut of_grey = ColorProfile::new_gray_with_gamma(1.0);
            of_grey.gray_trc = profile.green_trc;
            profile = of_grey;
        }
        profile.encode().ok()
    }
}

/// Light 0..1 of a code 0..1.
pub(super) fn light(curve: Curve, code: f64) -> f64 {
    match curve {
        Curve::Linear => code,
        // IEC 61966-2-1, equations 5 and 6.
        Curve::Srgb if code <= 0.040_45 => code / 12.92,
        Curve::Srgb => ((code + 0.055) / 1.055).powf(2.4),
    }
}

/// Tables from code to linear light, one a channel, as deep as the file's samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Tone {
    tables: [Vec<f32>; 3],
    /// The curve, for the report; `None` for a profile's.
    curve: Option<Curve>,
}

impl Tone {
    /// The same `curve` in all channels, for samples of `bits` (8 or 16).
    pub fn of_curve(curve: Curve, bits: u8) -> Tone {
        let table = table(bits, |code| light(curve, code));
        Tone { tables: [table.clone(), table.clone(), table], curve: Some(curve) }
    }

    /// The tone curves of an embedded ICC profile; `grey` when the samples are grey.
    ///
    /// # Errors
    /// Why the profile has no usable curves: neither RGB nor grey, look-up tables only, falling
    /// curves.
    pub fn of_profile(icc: &[u8], bits: u8, grey: bool) -> Result<Tone, &'static str> {
        let profile = ColorProfile::new_from_slice(icc).map_err(|_| "it cannot be read")?;
        let curves = match (profile.color_space, grey) {
            (DataColorSpace::Gray, true) => {
                let curve = profile.gray_trc.ok_or("it has no tone curve")?;
                [curve.clone(), curve.clone(), curve]
            }
            (DataColorSpace::Rgb, _) => {
                match (profile.red_trc, profile.green_trc, profile.blue_trc) {
                    (Some(red), Some(green), Some(blue)) => [red, green, blue],
                    _ => return Err("it has no tone curves"),
                }
            }
            _ => return Err("it is for another kind of picture"),
        };
        let [red, green, blue] = curves.map(|curve| profile_table(&curve, bits));
        Ok(Tone { tables: [red?, green?, blue?], curve: None })
    }

    /// The origin of the curve: `sRGB`, `linear` or `ICC profile`.
    pub fn origin(&self) -> &'static str {
        match self.curve {
            Some(Curve::Srgb) => "sRGB",
            Some(Curve::Linear) => "linear",
            None => "ICC profile",
        }
    }

    /// Whether each table has `steps` entries that do not fall.
    pub(super) fn has_steps(&self, steps: usize) -> bool {
        let rises = |table: &Vec<f32>| table.windows(2).all(|w| w[0] <= w[1]);
        self.tables.iter().all(|table| table.len() == steps && rises(table))
    }

    /// Linear light 0..255 of a sample `code` in channel `channel` (0..3).
    pub(super) fn light(&self, channel: usize, code: u16) -> f32 {
        let table = &self.tables[channel];
        table[usize::from(code).min(table.len() - 1)]
    }

    /// Gives the code nearest to a light, rounded in codes; light outside the range is clipped.
    pub(super) fn coder(&self, channel: usize) -> impl Fn(f32) -> u16 {
        let table = &self.tables[channel];
        // Numbers of entries below each grey level, between which a search is short.
        let below = |level: usize| table.partition_point(|&v| v < level as f32);
        let starts: Vec<usize> = (0..=FULL_SCALE as usize).map(below).collect();
        move |light| {
            // `light` lies in the step that ends at the first entry above it.
            let level = (light as usize).min(starts.len() - 1);
            let end = starts.get(level + 1).map_or(table.len(), |&end| end);
            let above = starts[level] + table[starts[level]..end].partition_point(|&v| v <= light);
            if above == 0 {
                return 0;
            }
            let below = above - 1;
            let Some(&top) = table.get(above) else { return (table.len() - 1) as u16 };
            let share = (light - table[below]) / (top - table[below]);
            (if share >= 0.5 { above } else { below }) as u16
        }
    }

    /// Linear light 0..255 of each code of `channel`.
    pub fn lights(&self, channel: Channel) -> &[f32] {
        &self.tables[channel.index()]
    }

    /// The light of a plane of 8-bit codes.
    pub fn plane(&self, channel: Channel, codes: &Plane<u8>) -> Plane {
        codes.map(|code| self.light(channel.index(), u16::from(code)))
    }

    /// The display values, 0..255, of a plane of linear light, rounded as a file's codes.
    pub fn display(&self, channel: Channel, light: &Plane) -> Plane {
        let scale = 255.0 / (self.tables[channel.index()].len() - 1) as f32;
        let code = self.coder(channel.index());
        light.map(|v| f32::from(code(v)) * scale)
    }

    pub(super) fn codes(&self, channel: usize, light: &Plane) -> Vec<u16> {
        let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
        let code = self.coder(channel);
        light.data().iter().map(|&v| code(finite(v))).collect()
    }
}

fn table(bits: u8, light: impl Fn(f64) -> f64) -> Vec<f32> {
    let top = if bits > 8 { 65535 } else { 255 };
    (0..=top)
        .map(|code| (light(f64::from(code) / f64::from(top)) * f64::from(FULL_SCALE)) as f32)
        .collect()
}

fn profile_table(curve: &ToneReprCurve, bits: u8) -> Result<Vec<f32>, &'static str> {
    let evaluator =
        curve.make_linear_evaluator().map_err(|_| "its tone curve is of an unknown kind")?;
    let table =
        table(bits, |code| f64::from(evaluator.evaluate_value(code as f32)).clamp(0.0, 1.0));
    let rises = table.windows(2).all(|w| w[0] <= w[1]) && table.last() > table.first();
    if rises { Ok(table) } else { Err("its tone curve falls") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_survives_the_round_trip() {
        for bits in [8u8, 16] {
            for curve in [Curve::Srgb, Curve::Linear] {
                let tone = Tone::of_curve(curve, bits);
                let top = if bits == 8 { 255 } else { 65535u16 };
                let nearest = tone.coder(1);
                for code in 0..=top {
                    assert_eq!(nearest(tone.light(1, code)), code, "{curve:?} {bits} bits");
                }
            }
        }
    }

    #[test]
    fn stated_colours_give_their_profile() {
        let half = |stated: &StatedColours, grey| {
            let icc = stated.profile(grey).unwrap();
            let tone = Tone::of_profile(&icc, 8, grey).unwrap();
            (
                f64::from(tone.light(0, 128) / FULL_SCALE),
                ColorProfile::new_from_slice(&icc).unwrap(),
            )
        };
        let code = 128.0f64 / 255.0;
        for grey in [false, true] {
            assert!((half(&StatedColours::LINEAR, grey).0 - code).abs() < 1e-3, "{grey}");
        }
        let (light, profile) = half(&StatedColours::ADOBE, false);
        assert!((light - code.powf(2.199)).abs() < 1e-3, "{light}");
        let known = ColorProfile::new_adobe_rgb();
        assert!((profile.green_colorant.x - known.green_colorant.x).abs() < 1e-3);
        let tables = (0..256u16).map(|n| n * n).collect::<Vec<_>>();
        let squares = StatedColours::Tables { tables: vec![tables], xy: None };
        assert!((half(&squares, false).0 - code * code).abs() < 0.01);
        // Rec. 2020's primaries have a profile with sRGB's curve, but none with that of HDR, PQ.
        let wide = half(&StatedColours::coded(9, 13).unwrap(), false);
        assert!((wide.0 - 0.2158).abs() < 1e-3 && wide.1.red_colorant.x > 0.6);
        assert!(StatedColours::coded(9, 16).is_none());
        assert!(StatedColours::Srgb.profile(false).is_none());
    }

    #[test]
    fn srgb_has_the_standard_curve() {
        let tone = Tone::of_curve(Curve::Srgb, 8);
        // IEC 61966-2-1: code 128 is 21.586 % light.
        assert!((tone.light(0, 128) / FULL_SCALE - 0.215_861).abs() < 1e-5);
        assert_eq!((tone.light(0, 0), tone.light(0, 255)), (0.0, FULL_SCALE));
    }

    #[test]
    fn light_out_of_range_is_clipped() {
        let tone = Tone::of_curve(Curve::Srgb, 8);
        assert_eq!([-3.0, 300.0].map(tone.coder(0)), [0, 255]);
    }

    #[test]
    fn a_profile_s_curve_is_used_and_a_broken_profile_refused() {
        let mut profile = ColorProfile::new_srgb();
        let gamma = curve_from_gamma(1.8);
        (profile.red_trc, profile.green_trc, profile.blue_trc) =
            (Some(gamma.clone()), Some(gamma.clone()), Some(gamma));
        let icc = profile.encode().unwrap();
        let tone = Tone::of_profile(&icc, 8, false).unwrap();
        let want = (128.0f64 / 255.0).powf(1.8) * 255.0;
        assert!(
            (f64::from(tone.light(2, 128)) - want).abs() < 0.2,
            "{} {want}",
            tone.light(2, 128)
        );
        let nearest = tone.coder(0);
        assert!((0..=255).all(|code| nearest(tone.light(0, code)) == code));
        assert!(Tone::of_profile(b"nonsense", 8, false).is_err());
    }
}
