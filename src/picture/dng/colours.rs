//! Conversion of a raw photo's colours to linear sRGB, by the file's matrices (DNG 1.4, chapter 6:
//! ColorMatrix and AsShotNeutral).
//!
//! As in dcraw and LibRaw, each channel is divided by its response to white and clipped there, and
//! a matrix that preserves white separates the colours. White needs no further adaptation.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Work};

/// XYZ to the linear light of sRGB (IEC 61966-2-1), in ten-thousandths.
const SRGB_OF_XYZ: [i32; 9] = [32406, -15372, -4986, -9689, 18758, 415, 557, -2040, 10570];

/// Least response of a channel to white, relative to the strongest channel. Guess.
const NEUTRAL_MIN: f64 = 0.01;

/// Conversion from a camera's channels to linear sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CameraColours {
    /// Factors of the channels that bring white to full scale in all of them.
    balance: [f32; 3],
    /// sRGB's red, green and blue (rows) from the balanced channels; each row adds up to 1.
    matrix: [[f32; 3]; 3],
}

impl CameraColours {
    /// The conversion by a file's matrix from XYZ to the camera, row by row, and the channels'
    /// responses to white. `None` if these are invalid, or the channels are sRGB's.
    pub(super) fn of_file(camera_of_xyz: &[f64], neutral: [f64; 3]) -> Option<CameraColours> {
        let largest = neutral.iter().copied().fold(0.0, f64::max);
        let neutral = neutral.map(|v| v / largest);
        let is_white = |v: &f64| v.is_finite() && *v >= NEUTRAL_MIN;
        if camera_of_xyz.len() != 9 || !neutral.iter().all(is_white) {
            return None;
        }
        let mut camera_of_srgb =
            Matrix3::from_row_slice(camera_of_xyz) * srgb_of_xyz().try_inverse()?;
        for mut row in camera_of_srgb.row_iter_mut() {
            let white = row.sum();
            row /= white;
        }
        let srgb_of_camera = camera_of_srgb.try_inverse()?;
        // Larger numbers would amplify noise, and no camera has them. Guess.
        let sound = srgb_of_camera.iter().all(|v| v.is_finite() && v.abs() < 20.0);
        let rows = [0, 1, 2].map(|to| [0, 1, 2].map(|from| srgb_of_camera[(to, from)] as f32));
        let colours = CameraColours { balance: neutral.map(|v| (1.0 / v) as f32), matrix: rows };
        (sound && !colours.are_srgb()).then_some(colours)
    }

    /// Whether the conversion is the identity, up to the file's rounding.
    fn are_srgb(&self) -> bool {
        let near = |v: f32, to: f32| (v - to).abs() < 1e-3;
        self.balance.iter().all(|&v| near(v, 1.0))
            && (0..3).all(|i| (0..3).all(|j| near(self.matrix[i][j], f32::from(i == j))))
    }

    /// Whether the numbers are finite; a worker's answer is untrusted.
    pub(crate) fn are_sound(&self) -> bool {
        let all = self.balance.iter().chain(self.matrix.as_flattened());
        all.into_iter().all(|v| v.is_finite())
    }

    /// Converts `light` behind the colour filters to linear sRGB.
    pub fn developed(&self, light: &Frame<Work>) -> Frame<Work> {
        Frame::from_fn(|to| self.developed_plane(light, to))
    }

    /// Channel `to` of [`CameraColours::developed`].
    pub(in crate::picture) fn developed_plane(&self, light: &Frame<Work>, to: Channel) -> Plane {
        let mut plane = Plane::zeros(light.size());
        for (from, share) in Channel::ALL.into_iter().zip(self.matrix[to.index()]) {
            let balance = self.balance[from.index()];
            plane.update(light.plane(from), |sum, light| {
                *sum += share * (light * balance).min(FULL_SCALE);
            });
        }
        plane
    }
}

/// The numbers for a file: its matrix from XYZ in ten-thousandths, and the responses to white.
/// `gains[c]` are the responses of channel `c` to sRGB's red, green and blue, in one unit.
pub(super) fn numbers_of(gains: Option<[[f64; 3]; 3]>) -> ([i32; 9], [f64; 3]) {
    // Without a measurement, the channels are taken as sRGB's.
    let Some(gains) = gains else { return (SRGB_OF_XYZ, [1.0; 3]) };
    let gains = Matrix3::from_fn(|to, from| gains[to][from]);
    let white = gains * Vector3::repeat(1.0);
    let gains = gains / white.max();
    let of_xyz = gains * srgb_of_xyz();
    let at = |n: usize| (of_xyz[(n / 3, n % 3)] * 10_000.0).round() as i32;
    (std::array::from_fn(at), (white / white.max()).into())
}

fn srgb_of_xyz() -> Matrix3<f64> {
    Matrix3::from_row_slice(&SRGB_OF_XYZ.map(|n| f64::from(n) / 10_000.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    /// The responses of an invented camera to sRGB's colours.
    const GAINS: [[f64; 3]; 3] = [[0.5, 0.08, 0.02], [0.1, 0.9, 0.15], [0.01, 0.2, 0.6]];

    fn flat(light: [f64; 3]) -> Frame<Work> {
        Frame::from_fn(|c| Plane::filled(Size::new(1, 1), light[c.index()] as f32))
    }

    fn of(gains: [[f64; 3]; 3]) -> Option<CameraColours> {
        let (of_xyz, neutral) = numbers_of(Some(gains));
        CameraColours::of_file(&of_xyz.map(|n| f64::from(n) / 10_000.0), neutral)
    }

    #[test]
    fn the_file_s_matrix_separates_the_filters_colours() {
        let colours = of(GAINS).unwrap();
        for light in [[1.0, 1.0, 1.0], [0.9, 0.3, 0.2], [0.1, 0.2, 0.8]] {
            let white: f64 = GAINS[1].iter().sum();
            let seen = GAINS.map(|row| {
                200.0 / white * row.iter().zip(light).map(|(gain, v)| gain * v).sum::<f64>()
            });
            let back = colours.developed(&flat(seen));
            for c in Channel::ALL {
                let (found, wanted) = (back.plane(c).at(0, 0), 200.0 * light[c.index()] as f32);
                assert!((found - wanted).abs() < 0.3, "{light:?}: {found}, wanted {wanted}");
            }
        }
    }

    #[test]
    fn full_channels_are_white() {
        let white = of(GAINS).unwrap().developed(&flat([255.0; 3]));
        assert!(Channel::ALL.iter().all(|&c| (white.plane(c).at(0, 0) - 255.0).abs() < 0.01));
    }

    #[test]
    fn invalid_numbers_give_no_conversion() {
        let (of_xyz, neutral) = numbers_of(None);
        let of_xyz = of_xyz.map(|n| f64::from(n) / 10_000.0);
        assert_eq!(CameraColours::of_file(&of_xyz, neutral), None, "it is sRGB");
        for (of_xyz, neutral) in [
            (&of_xyz[..8], [1.0; 3]),
            (&[0.0; 9], [1.0; 3]),
            (&[f64::NAN; 9], [1.0; 3]),
            (&of_xyz, [0.0; 3]),
            (&of_xyz, [1.0, f64::INFINITY, 1.0]),
            (&of_xyz, [1.0, -1.0, 1.0]),
        ] {
            assert_eq!(CameraColours::of_file(of_xyz, neutral), None, "{of_xyz:?} {neutral:?}");
        }
    }
}
