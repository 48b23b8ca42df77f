//! The picture that tells where a panel lies on the sensor: white dots on dark grey.
//!
//! The middle dot is the largest, its right neighbour the second, and the one below is left out:
//! that gives shift, turn, size and reflection, also to a camera that sees no colours.

use super::pose::SeenDot;
use super::sites::GreenSites;
use crate::frame::{Codes, Frame, Plane, Size};

/// Dots on each side of the middle one, across and down.
const AROUND: [i32; 2] = [3, 2];
/// The dot below the middle one, which is not there.
const LEFT_OUT: [i32; 2] = [0, 1];
/// The grey between the dots, so that the panel's border can be seen.
const GREY: u8 = 64;
/// Light of a dot that counts, between the median's and the brightest. Guess: half of it is left at
/// the rim of a dot, and corners are half as bright.
const DOT_SHARE: f32 = 0.25;
/// A camera that sees no more than this share of its range sees no dots.
const SEEN_SHARE: f32 = 0.02;
/// A dot is its grid place's when it lies this near to it, in steps of the grid.
const NEAR: f64 = 0.3;
/// Fewer dots are chance.
const DOTS_MIN: usize = 6;
/// Fewer sites are a hot site or two.
const AREA_MIN: usize = 5;

/// Panel place of the dot so many columns and rows from the middle one.
fn place(panel: Size, [column, row]: [i32; 2]) -> [f64; 2] {
    let along = |pixels: usize, n: i32, around: i32| {
        0.5 * (pixels as f64 - 1.0) + f64::from(n) * pixels as f64 / f64::from(2 * around + 1)
    };
    [along(panel.width, column, AROUND[0]), along(panel.height, row, AROUND[1])]
}

fn radius_px(panel: Size, dot: [i32; 2]) -> f64 {
    let times = match dot {
        [0, 0] => 2.0,
        [1, 0] => 1.5,
        _ => 1.0,
    };
    times * panel.height as f64 / 32.0
}

/// All dots that are there.
fn dots() -> impl Iterator<Item = [i32; 2]> {
    let rows = -AROUND[1]..=AROUND[1];
    rows.flat_map(|row| (-AROUND[0]..=AROUND[0]).map(move |column| [column, row]))
        .filter(|dot| *dot != LEFT_OUT)
}

/// The picture for a panel of size `panel`.
pub(super) fn picture(panel: Size) -> Codes {
    let mut plane = Plane::filled(panel, GREY);
    for dot in dots() {
        let ([cx, cy], radius) = (place(panel, dot), radius_px(panel, dot));
        let near = |centre: f64, pixels: usize| {
            ((centre - radius).max(0.0) as usize)..((centre + radius + 1.0) as usize).min(pixels)
        };
        for y in near(cy, panel.height) {
            for x in near(cx, panel.width) {
                if (x as f64 - cx).hypot(y as f64 - cy) <= radius {
                    plane.set(x, y, 255);
                }
            }
        }
    }
    Frame::from_fn(|_| plane.clone())
}

/// The dots that were found.
pub(super) struct FoundDots {
    /// Panel place and sensor place of each.
    pub(super) pairs: Vec<SeenDot>,
    /// Whether left and right are swapped.
    pub(super) mirrored: bool,
}

/// The dots of a `panel` in `light`, the green `sites` of a camera that counts up to `range` over
/// black; `None` when the middle ones are not seen.
pub(super) fn find(light: &Plane, sites: GreenSites, range: f64, panel: Size) -> Option<FoundDots> {
    let mut sorted = light.data().to_vec();
    let last = sorted.len().checked_sub(1)?;
    let mut rank = |share: f64| {
        let n = (share * last as f64) as usize;
        *sorted.select_nth_unstable_by(n, f32::total_cmp).1
    };
    // Hot sites are fewer than a dot's.
    let (median, peak) = (rank(0.5), rank(0.998));
    if peak - median < SEEN_SHARE * range as f32 {
        return None;
    }
    let mut blobs = blobs(light, median + DOT_SHARE * (peak - median));
    blobs.sort_by(|a, b| b.flux.total_cmp(&a.flux));
    for blob in &mut blobs {
        blob.at = sites.on_sensor(blob.at);
    }
    let [middle, right] = [blobs.first()?.at, blobs.get(1)?.at];
    let across = [right[0] - middle[0], right[1] - middle[1]];
    // The grid's step down is square to the one across, longer or shorter, and below or above it.
    let [step_x, step_y] = [0, 1].map(|axis| {
        let next = place(panel, [1, 1]);
        next[axis] - place(panel, [0, 0])[axis]
    });
    let turned = [-across[1], across[0]].map(|v| v * step_y / step_x);
    let is_near = |at: [f64; 2], wanted: [f64; 2]| {
        (at[0] - wanted[0]).hypot(at[1] - wanted[1]) < NEAR * across[0].hypot(across[1])
    };
    let at = |[column, row]: [i32; 2], down: [f64; 2]| {
        let [column, row] = [f64::from(column), f64::from(row)];
        [0, 1].map(|k| middle[k] + column * across[k] + row * down[k])
    };
    let nearest = |wanted: [f64; 2]| {
        let off = |blob: &&Blob| (blob.at[0] - wanted[0]).hypot(blob.at[1] - wanted[1]);
        let nearest = blobs.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        is_near(nearest.at, wanted).then_some(nearest.at)
    };
    let matched = |down: [f64; 2]| -> Vec<SeenDot> {
        let pair = |dot| Some((place(panel, dot), nearest(at(dot, down))?));
        dots().filter_map(pair).collect()
    };
    let mirrored = match [turned, turned.map(|v| -v)].map(|down| nearest(at(LEFT_OUT, down))) {
        [None, Some(_)] => false,
        [Some(_), None] => true,
        _ => return None,
    };
    let pairs = matched(turned.map(|v| if mirrored { -v } else { v }));
    (pairs.len() >= DOTS_MIN).then_some(FoundDots { pairs, mirrored })
}

/// Bright sites that touch each other.
struct Blob {
    at: [f64; 2],
    flux: f64,
}

/// All of them that do not reach the picture's border, where they may be cut.
fn blobs(light: &Plane, threshold: f32) -> Vec<Blob> {
    let Size { width, height } = light.size();
    let mut seen = Plane::filled(light.size(), false);
    let (mut found, mut to_do) = (Vec::new(), Vec::new());
    for start in 0..width * height {
        if seen.data()[start] || light.data()[start] < threshold {
            continue;
        }
        seen.data_mut()[start] = true;
        to_do.push(start);
        let (mut area, mut flux, mut sums, mut cut) = (0, 0.0, [0.0; 2], false);
        while let Some(n) = to_do.pop() {
            let (x, y) = (n % width, n / width);
            let over = f64::from(light.data()[n] - threshold);
            area += 1;
            flux += over;
            sums = [sums[0] + over * x as f64, sums[1] + over * y as f64];
            if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
                cut = true;
                continue;
            }
            for next in [n - 1, n + 1, n - width, n + width] {
                if !seen.data()[next] && light.data()[next] >= threshold {
                    seen.data_mut()[next] = true;
                    to_do.push(next);
                }
            }
        }
        if area >= AREA_MIN && !cut && flux > 0.0 {
            found.push(Blob { at: sums.map(|sum| sum / flux), flux });
        }
    }
    found
}
