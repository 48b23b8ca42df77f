//! Scenes that call for different amounts of model: a page of text and a flat wall are not one
//! photo.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use relens::chart::drawn;
use relens::chart::scenes::Scene;
use relens::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Size, Work};

/// One of the varied set.
#[derive(Debug, Clone)]
pub(crate) struct Varied {
    /// What it is, for the table.
    pub(crate) name: &'static str,
    /// Linear light 0..255.
    pub(crate) light: Frame<Work>,
    /// Grey scenes are given to the box as grey photos.
    pub(crate) channels: Channels,
    /// Whether it is seen through the lens; if not, the photo is the scene itself with noise.
    pub(crate) through_lens: bool,
}

/// All of them at `size`; those that are drawn at random, from `seed`.
pub(crate) fn varied(size: Size, seed: u64) -> Vec<Varied> {
    let colour =
        |name, light| Varied { name, light, channels: Channels::Colour, through_lens: true };
    let grey = |name, plane: Plane| {
        let mut light = Frame::zeros(size);
        *light.plane_mut(Channel::Green) = plane;
        Varied { name, light, channels: Channels::Green, through_lens: true }
    };
    vec![
        grey("text page", drawn::page(size)),
        colour("night sky", night_sky(size, seed)),
        colour(
            "flat wall",
            Frame::from_fn(|c| Plane::filled(size, [150.0, 138.0, 120.0][c.index()])),
        ),
        colour("portrait", Scene::Astronaut.light(size)),
        colour("chart", Scene::Chart.light(size)),
        colour("foliage", drawn::leaves(size, seed + 1)),
        Varied {
            through_lens: false,
            ..colour("noise only", Frame::from_fn(|_| Plane::filled(size, 90.0)))
        },
        Varied { through_lens: false, ..colour("already sharp", Scene::Coffee.light(size)) },
        colour("small thing", small_thing(size)),
    ]
}

/// Stars of all brightnesses on nearly nothing.
fn night_sky(size: Size, seed: u64) -> Frame<Work> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut sky: Frame<Work> = Frame::from_fn(|c| Plane::filled(size, [1.5, 1.8, 3.0][c.index()]));
    for _ in 0..size.area() / 2000 {
        let (x, y) = (random.random_range(0..size.width), random.random_range(0..size.height));
        // As many stars of each magnitude as there are in the sky, about: four times for half the
        // light.
        let light = (10.0 / random.random_range(0.04f32..1.0)).min(FULL_SCALE);
        let warmth = random.random_range(0.7f32..1.0);
        for c in Channel::ALL {
            sky.plane_mut(c).set(x, y, light * [1.0, 0.9, warmth][c.index()]);
        }
    }
    sky
}

/// One small thing in the middle of a plain ground.
fn small_thing(size: Size) -> Frame<Work> {
    let part = Size::new(size.width / 8, size.height / 8);
    let thing = Scene::Coffee.light(part);
    Frame::from_fn(|c| {
        let mut plane = Plane::filled(size, 100.0);
        let (left, top) = ((size.width - part.width) / 2, (size.height - part.height) / 2);
        for y in 0..part.height {
            plane.row_mut(top + y)[left..left + part.width].copy_from_slice(thing.plane(c).row(y));
        }
        plane
    })
}
