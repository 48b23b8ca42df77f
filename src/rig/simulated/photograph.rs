//! Photographs of a scene by the rig's camera.

use super::optics::{Light, Optics};
use super::sensor::{Readout, SimulatedSensor, Stream};
use crate::config::{Curve, Surround};
use crate::frame::{Channel, FULL_SCALE, Frame, Mosaic, Plane, Rect, Size, Work};

/// Raw sites of a photograph.
#[derive(Debug, Clone, PartialEq)]
pub struct RawPhoto {
    /// Counts, photo-sized.
    pub sites: Plane<u16>,
    /// Colour filters of these sites.
    pub mosaic: Mosaic,
}

/// Light of a scene behind the lens, of the scene's size: linear, 0..255.
pub(super) struct SceneLight<'a> {
    sensor: &'a SimulatedSensor,
    part: Rect,
    pub(super) light: [Plane; 3],
    seed: u64,
}

impl<'a> SceneLight<'a> {
    /// Light of `scene` behind the lens `optics`, with blur, lateral colour and dark corners.
    /// `scene` is what a perfect lens with the green channel's geometry would record.
    pub(super) fn new(
        optics: &Optics,
        sensor: &'a SimulatedSensor,
        scene: &Frame<Work>,
        surround: Surround,
        seed: u64,
    ) -> SceneLight<'a> {
        // A scene has the size of the sensor or of the photo.
        let whole = Rect { x: 0, y: 0, size: optics.sensor };
        let part = if scene.size() == whole.size { whole } else { optics.photo };
        let Rect { x, y, size } = part;
        let on_grid = Rect { x: x + optics.pad, y: y + optics.pad, size };
        let falloff = optics.dark_corner(Light::Scene);
        let light = Channel::ALL.map(|channel| {
            let wide = surrounded(scene.plane(channel), optics.grid(), on_grid, surround);
            let mut seen = optics.through_lens(Light::Scene, channel, &wide).crop(on_grid);
            seen.multiply(&falloff[channel.index()].crop(part));
            seen
        });
        SceneLight { sensor, part, light, seed }
    }

    fn reading(&self) -> Readout {
        let SceneLight { part, seed, .. } = *self;
        Readout { part, seed, stream: Stream::Photograph, number: 0 }
    }

    fn fill(&self) -> impl Fn(Channel, usize, &mut [f32]) + Sync {
        |channel, y, levels| levels.copy_from_slice(self.light[channel.index()].row(y))
    }

    /// Raw sites of the photograph; `None` for a sensor without colour filters.
    pub(super) fn raw(&self) -> Option<RawPhoto> {
        let mosaic = self.sensor.config.mosaic?;
        let sites = self.sensor.sites(mosaic, self.reading(), self.fill());
        Some(RawPhoto { sites, mosaic: mosaic.from_place(self.part.x, self.part.y) })
    }

    /// Codes that the camera writes to its file; a mosaic is developed by bilinear interpolation.
    pub(super) fn developed(&self, curve: Curve) -> Frame<Work, u8> {
        let sensor = self.sensor;
        match self.raw() {
            Some(RawPhoto { sites, mosaic }) => {
                let counts = sensor.as_device_frame(&sites, mosaic);
                Frame::from_fn(|channel| {
                    counts.plane(channel).map(|count| encode(sensor.level_of(count), curve))
                })
            }
            None => Frame::from_fn(|channel| {
                let code = |level| encode(sensor.developed(level), curve);
                sensor.plane(channel, self.reading(), self.fill(), code)
            }),
        }
    }
}

/// The scene on the lens's grid, continued by its mirror image or by a dark surround.
pub(super) fn surrounded(scene: &Plane, grid: Size, place: Rect, surround: Surround) -> Plane {
    let mirrored = |at: usize, start: usize, length: usize| {
        let period = 2 * length as isize;
        let n = (at as isize - start as isize).rem_euclid(period);
        (if n < length as isize { n } else { period - 1 - n }) as usize
    };
    match surround {
        Surround::Scene => {
            let columns: Vec<usize> =
                (0..grid.width).map(|x| mirrored(x, place.x, place.size.width)).collect();
            let row = |y: usize| mirrored(y, place.y, place.size.height);
            Plane::from_fn(grid, |x, y| scene.at(columns[x], row(y)))
        }
        Surround::Black => {
            let mut out = Plane::zeros(grid);
            for y in 0..place.size.height {
                out.row_mut(place.y + y)[place.x..place.x + place.size.width]
                    .copy_from_slice(scene.row(y));
            }
            out
        }
    }
}

/// 8-bit code of a linear level 0..255; sRGB by IEC 61966-2-1.
fn encode(level: f32, curve: Curve) -> u8 {
    let share = (level / FULL_SCALE).clamp(0.0, 1.0);
    let value = match curve {
        Curve::Linear => share,
        Curve::Srgb if share <= 0.003_130_8 => 12.92 * share,
        Curve::Srgb => 1.055 * share.powf(1.0 / 2.4) - 0.055,
    };
    (value * 255.0 + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surround_mirrors_the_scene() {
        let scene = Plane::from_fn(Size::new(4, 3), |x, y| (10 * y + x) as f32);
        let place = Rect { x: 2, y: 1, size: Size::new(4, 3) };
        let wide = surrounded(&scene, Size::new(9, 6), place, Surround::Scene);
        assert_eq!(wide.row(1), &[1.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 2.0, 1.0]);
        assert_eq!(wide.row(0), wide.row(1));
        let dark = surrounded(&scene, Size::new(9, 6), place, Surround::Black);
        assert_eq!(dark.row(3), &[0.0, 0.0, 20.0, 21.0, 22.0, 23.0, 0.0, 0.0, 0.0]);
    }

    #[test]
    fn codes_follow_the_curve() {
        assert_eq!(encode(127.6, Curve::Linear), 128);
        // IEC 61966-2-1: linear 0.5 is code 187.5.
        assert!((187..=188).contains(&encode(127.5, Curve::Srgb)));
        assert_eq!((encode(-3.0, Curve::Srgb), encode(300.0, Curve::Srgb)), (0, 255));
        assert_eq!(encode(0.5, Curve::Srgb), 6);
    }
}
