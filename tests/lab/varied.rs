//! Scenes that call for different amounts of model: a page of text and a flat wall are not one
//! photo.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use relens::chart::scenes::Scene;
use relens::frame::{Channel, Channels, FULL_SCALE, Frame, Plane, Size, Work};
use relens::kiosk::lettering;

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
        grey("text page", text_page(size)),
        colour("night sky", night_sky(size, seed)),
        colour(
            "flat wall",
            Frame::from_fn(|c| Plane::filled(size, [150.0, 138.0, 120.0][c.index()])),
        ),
        colour("portrait", Scene::Astronaut.light(size)),
        colour("chart", Scene::Chart.light(size)),
        colour("foliage", foliage(size, seed)),
        Varied {
            through_lens: false,
            ..colour("noise only", Frame::from_fn(|_| Plane::filled(size, 90.0)))
        },
        Varied { through_lens: false, ..colour("already sharp", Scene::Coffee.light(size)) },
        colour("small thing", small_thing(size)),
    ]
}

/// Black lines of words on white paper.
fn text_page(size: Size) -> Plane {
    const WORDS: &str = "The lens computes its own convolution. Show, see, adjust: until its \
     photograph is the photo.";
    let mut page: Plane = Plane::filled(size, 0.8 * FULL_SCALE);
    let height_px = size.height as f32 / 16.0;
    let mut y = height_px;
    let wide = 0.9 * size.width as f32;
    let mut lines = lettering::wrapped(&[WORDS; 8].join(" "), height_px, wide);
    lines.truncate(12);
    if let Some(last) = lines.last_mut() {
        while lettering::width(&format!("{last} …"), height_px) > wide && last.pop().is_some() {}
        last.push_str(" …");
    }
    for line in &lines {
        lettering::set(line, (0.05 * size.width as f32, y), height_px, &mut |x, y, coverage| {
            if (0..size.width as i32).contains(&x) && (0..size.height as i32).contains(&y) {
                let (x, y) = (x as usize, y as usize);
                page.set(x, y, page.at(x, y) * (1.0 - 0.95 * coverage));
            }
        });
        y += 1.2 * height_px;
    }
    page
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

/// Leaves over leaves: discs of all sizes in all greens, the later ones in front ("dead leaves").
fn foliage(size: Size, seed: u64) -> Frame<Work> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed + 1);
    let mut leaves: Frame<Work> =
        Frame::from_fn(|c| Plane::filled(size, [20.0, 30.0, 10.0][c.index()]));
    for _ in 0..size.area() / 60 {
        let radius = 1.5 / random.random_range(0.03f32..1.0).sqrt();
        let (cx, cy) = (
            random.random_range(0.0..size.width as f32),
            random.random_range(0.0..size.height as f32),
        );
        let (light, flat) = (random.random_range(0.1f32..1.0), random.random_range(0.3f32..1.0));
        let colour = [90.0 * light, 170.0 * light, 45.0 * light];
        let span = |at: f32, side: usize| {
            ((at - radius).max(0.0) as usize)..((at + radius + 1.0) as usize).min(side)
        };
        for y in span(cy, size.height) {
            for x in span(cx, size.width) {
                if (x as f32 - cx).powi(2) + ((y as f32 - cy) / flat).powi(2) < radius * radius {
                    Channel::ALL
                        .iter()
                        .for_each(|&c| leaves.plane_mut(c).set(x, y, colour[c.index()]));
                }
            }
        }
    }
    leaves
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
