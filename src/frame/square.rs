//! The pixels or sites of a square that contribute to one datum of pixels binned by two.

use super::{Channel, Mosaic, Plane};

/// A pixel or site, by column and row from the first pixel of a square of two by two pixels, and
/// its share of the square's datum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SquarePlace {
    /// Column.
    pub x: isize,
    /// Row.
    pub y: isize,
    /// Share of the datum; those of a square add up to 1.
    pub share: f32,
}

/// The four pixels of a square.
const PIXELS: [(usize, usize); 4] = [(0, 0), (1, 0), (0, 1), (1, 1)];

impl SquarePlace {
    /// All pixels of a square.
    pub fn pixels() -> Vec<SquarePlace> {
        SquarePlace::equal(PIXELS.into_iter())
    }

    /// The sites of `channel` in a square behind the filters of `mosaic`.
    pub fn sites(mosaic: Mosaic, channel: Channel) -> Vec<SquarePlace> {
        SquarePlace::equal(PIXELS.into_iter().filter(|&(x, y)| mosaic.colour_at(x, y) == channel))
    }

    /// The sites of `channel` from which the pixels of a square are interpolated bilinearly: up to
    /// one pixel beside it.
    pub fn interpolated(mosaic: Mosaic, channel: Channel) -> Vec<SquarePlace> {
        let from_pixel = |(x, y)| {
            let near = mosaic.nearest(channel, x, y);
            let share = 1.0 / (PIXELS.len() * near.len()) as f32;
            let place = move |&(dx, dy): &(usize, usize)| {
                let [x, y] = [x + dx, y + dy].map(|side| side as isize - 1);
                SquarePlace { x, y, share }
            };
            near.iter().map(place)
        };
        PIXELS.into_iter().flat_map(from_pixel).collect()
    }

    /// The value of `plane` at this place of the square in column `x`, row `y` of squares; the
    /// place must lie inside the square.
    pub fn of<T: Copy + Default>(&self, plane: &Plane<T>, x: usize, y: usize) -> T {
        plane.at(2 * x + self.x.unsigned_abs(), 2 * y + self.y.unsigned_abs())
    }

    fn equal(places: impl Iterator<Item = (usize, usize)>) -> Vec<SquarePlace> {
        let places: Vec<(usize, usize)> = places.collect();
        let share = 1.0 / places.len() as f32;
        let place = |(x, y)| SquarePlace { x: x as isize, y: y as isize, share };
        places.into_iter().map(place).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Size;

    #[test]
    fn the_places_of_a_square_have_the_light_of_its_datum() {
        let light: Plane = Plane::from_fn(Size::new(8, 8), |x, y| ((x * 7 + y * 13) % 11) as f32);
        let mean = |places: &[SquarePlace], plane: &Plane| {
            let at = |p: &SquarePlace| plane.at((4 + p.x) as usize, (2 + p.y) as usize);
            places.iter().map(|p| p.share * at(p)).sum::<f32>()
        };
        for mosaic in Mosaic::ALL {
            for channel in Channel::ALL {
                let filled = mosaic.filled(channel, &light);
                let expected = mean(&SquarePlace::pixels(), &filled);
                let sites = SquarePlace::interpolated(mosaic, channel);
                assert!((mean(&sites, &light) - expected).abs() < 1e-5, "{mosaic:?} {channel:?}");
                let own = SquarePlace::sites(mosaic, channel);
                assert_eq!(own.len() as f32 * Mosaic::pixels_a_site(channel), 4.0);
            }
        }
    }
}
