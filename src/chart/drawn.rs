//! Drawn scenes: a page of print, and leaves.

use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::frame::{Channel, FULL_SCALE, Frame, Plane, Size, Work};
use crate::kiosk::lettering;

/// Black lines of print on white paper, 0..255.
pub(super) fn page(size: Size) -> Plane {
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

/// Overlapping leaves, 0..255: discs of all sizes in all shades of green drawn from `seed`, later
/// ones in front ("dead leaves" with the sizes of photographs; Lee, Mumford & Huang 2001,
/// "Occlusion models for natural images").
pub(super) fn leaves(size: Size, seed: u64) -> Frame<Work> {
    let mut random = Xoshiro256PlusPlus::seed_from_u64(seed);
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
