//! White dots on dark grey, to locate a panel on the sensor.
//!
//! The middle dot is the largest, its right neighbour the second largest, and the one below is
//! missing: this gives shift, rotation, size and reflection even without colours.

use super::pose::SeenDot;
use super::sites::GreenSites;
use crate::frame::{Codes, Frame, Plane, Size};

/// Number of dots on each side of the middle one, across and down.
const AROUND: [i32; 2] = [3, 2];
/// The missing dot, below the middle one.
const MISSING_DOT: [i32; 2] = [0, 1];
/// Code between the dots; keeps the panel's border visible.
const GREY: u8 = 64;
/// Threshold of a dot, as a share of the way from the median to the brightest light. Guess: the rim
/// of a dot has half its light, and the sensor's corners are half as bright.
const DOT_SHARE: f32 = 0.25;
/// Least contrast of the dots, as a share of the camera's range.
const CONTRAST_MIN: f32 = 0.02;
/// Largest distance of a dot from its grid position, in grid steps.
const NEAR: f64 = 0.3;
/// Least number of dots found; fewer may be chance.
const DOTS_MIN: usize = 6;
/// Least number of sites of a dot; fewer may be hot sites.
const AREA_MIN: usize = 5;

/// Panel position of the dot at a column and row relative to the middle one.
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

fn dots() -> impl Iterator<Item = [i32; 2]> {
    let rows = -AROUND[1]..=AROUND[1];
    rows.flat_map(|row| (-AROUND[0]..=AROUND[0]).map(move |column| [column, row]))
        .filter(|dot| *dot != MISSING_DOT)
}

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

pub(super) struct FoundDots {
    /// Positions of the dots on panel and sensor.
    pub(super) pairs: Vec<SeenDot>,
    pub(super) mirrored: bool,
}

/// Finds the dots of a `panel` in `light`, the green `sites` of a camera with `range` counts above
/// black; `None` if the middle dots are not in view.
pub(super) fn find(light: &Plane, sites: GreenSites, range: f64, panel: Size) -> Option<FoundDots> {
    let mut blobs = blobs(light, threshold(light, range)?);
    blobs.sort_by(|a, b| b.flux.total_cmp(&a.flux));
    for blob in &mut blobs {
        blob.at = sites.on_sensor(blob.at);
    }
    let [middle, right] = [blobs.first()?.at, blobs.get(1)?.at];
    let across = [right[0] - middle[0], right[1] - middle[1]];
    // The grid's step down is perpendicular to the one across; its sign depends on mirroring.
    let [step_x, step_y] =
        [0, 1].map(|axis| place(panel, [1, 1])[axis] - place(panel, [0, 0])[axis]);
    let down = [-across[1], across[0]].map(|v| v * step_y / step_x);
    let nearest = |[column, row]: [i32; 2], down: [f64; 2]| {
        let (column, row) = (f64::from(column), f64::from(row));
        let wanted = [0, 1].map(|k| middle[k] + column * across[k] + row * down[k]);
        let off = |blob: &&Blob| (blob.at[0] - wanted[0]).hypot(blob.at[1] - wanted[1]);
        let nearest = blobs.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        (off(&nearest) < NEAR * across[0].hypot(across[1])).then_some(nearest.at)
    };
    let up = down.map(|v| -v);
    let mirrored = match [down, up].map(|down| nearest(MISSING_DOT, down)) {
        [None, Some(_)] => false,
        [Some(_), None] => true,
        _ => return None,
    };
    let down = if mirrored { up } else { down };
    let pair = |dot| Some(SeenDot { panel: place(panel, dot), sensor: nearest(dot, down)? });
    let pairs: Vec<SeenDot> = dots().filter_map(pair).collect();
    (pairs.len() >= DOTS_MIN).then_some(FoundDots { pairs, mirrored })
}

/// Least light of a dot; `None` if the picture has no contrast.
fn threshold(light: &Plane, range: f64) -> Option<f32> {
    let mut sorted = light.data().to_vec();
    let last = sorted.len().checked_sub(1)?;
    let mut rank = |share: f64| {
        let n = (share * last as f64) as usize;
        *sorted.select_nth_unstable_by(n, f32::total_cmp).1
    };
    // The rank of the peak excludes hot sites, which are fewer than the sites of the dots.
    let (median, peak) = (rank(0.5), rank(0.998));
    let has_contrast = peak - median >= CONTRAST_MIN * range as f32;
    has_contrast.then_some(median + DOT_SHARE * (peak - median))
}

/// A connected group of bright sites.
struct Blob {
    at: [f64; 2],
    flux: f64,
}

/// Finds all blobs of `light` above `threshold` except those at the border, which may be cut off.
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
