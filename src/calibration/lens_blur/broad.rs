//! The broad light of a lens, from captures of large squares.
//!
//! With the functions known (each of sum 1) and flats seen flat, what is seen of a pattern x
//! differs from P x by what is spread wider: y − P x = Σⱼ sⱼ (Gⱼ x − P x), and where dark lies
//! beyond the canvas sⱼ (1 − Gⱼ 1) y is added on the right, for the flats have been scaled by it.
//! The Gaussians' radii are given, each twice the one before; the shares are the least squares'
//! with none below 0 (non-negative least squares by coordinate descent). A pattern held out tells
//! whether any of it is true.

use super::Shot;
use crate::deconvolution::lens_model::broad::{SHARE_MAX, Veil};
use crate::deconvolution::lens_model::{Beyond, Halo, LensModel};
use crate::frame::{Channel, Plane, Size};

/// Rounds of coordinate descent; the radii's columns are alike, so it takes many, and each costs
/// next to nothing.
const ROUNDS: usize = 2000;
/// Smaller shares of the light are left out: a grey level of 255 is 0.4 %.
const SHARE_MIN: f32 = 0.002;
/// Broad light is believed when it takes away at least so much of the squared misfit of the pattern
/// held out. Guess.
const BELIEVED: f64 = 0.2;
/// Cells a radius of half a lens function has: what is compared are means over them.
const CELLS: usize = 4;

/// What one pattern says: the misfit without broad light, and what a share of each Gaussian would
/// add, cell by cell.
struct PatternMisfit {
    misfit: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

/// The radii tried for functions that are `support_px` wide, on a canvas of `size`.
fn radii_px(support_px: usize, size: Size) -> Vec<f32> {
    let widest = size.width.max(size.height) as f32 / 2.0;
    let first = support_px as f32 / 2.0;
    std::iter::successors(Some(first), |r| Some(2.0 * r)).take_while(|r| *r <= widest).collect()
}

/// The halos of one channel: what `shots` say but for the last, believed when the last agrees; none
/// when there are fewer than two. `functions_only` is the model without broad light; `trusted` has
/// a 1 where all captures can be trusted.
pub fn halos(
    functions_only: &LensModel,
    channel: Channel,
    shots: &[Shot],
    trusted: &Plane<u8>,
    beyond: Beyond,
) -> Vec<Halo> {
    let support_px = functions_only.functions().support_px;
    let radii = radii_px(support_px, functions_only.canvas());
    let Some((held_out, fitted)) = shots.split_last().filter(|(_, fitted)| !fitted.is_empty())
    else {
        return Vec::new();
    };
    let veils: Vec<Veil> = radii
        .iter()
        .map(|&radius_px| Veil::new(functions_only.canvas(), radius_px, beyond))
        .collect();
    let cell = (support_px / (2 * CELLS)).max(1);
    let evidence = |shot: &Shot| evidence(functions_only, channel, shot, &veils, trusted, cell);
    let shares = shares(&fitted.iter().map(evidence).collect::<Vec<_>>(), veils.len());
    let judge = evidence(held_out);
    let (without, with) = (squared(&judge, &vec![0.0; shares.len()]), squared(&judge, &shares));
    log::debug!(
        "{channel:?}: shares {shares:.4?} of radii {radii:.0?} px leave {:.3} of the misfit",
        with / without
    );
    if with > (1.0 - BELIEVED) * without {
        return Vec::new();
    }
    let pairs = radii.iter().zip(&shares);
    let found = pairs.map(|(&radius_px, &share)| Halo { radius_px, share: share as f32 });
    found.filter(|halo| halo.share >= SHARE_MIN).collect()
}

/// Means over whole, trusted cells away from the border, of misfit and columns.
fn evidence(
    functions_only: &LensModel,
    channel: Channel,
    shot: &Shot,
    veils: &[Veil],
    trusted: &Plane<u8>,
    cell: usize,
) -> PatternMisfit {
    let size = functions_only.canvas();
    let mut local = Plane::zeros(size);
    functions_only.forward(channel, &shot.shown, &mut local);
    let border = functions_only.functions().support_px / 2;
    let sound = |x0: usize, y0: usize| {
        (y0..y0 + cell).all(|y| trusted.row(y)[x0..x0 + cell].iter().all(|&t| t > 0))
    };
    let corners: Vec<(usize, usize)> = (border..(size.height.saturating_sub(border + cell)))
        .step_by(cell)
        .flat_map(|y| {
            (border..(size.width.saturating_sub(border + cell))).step_by(cell).map(move |x| (x, y))
        })
        .filter(|&(x, y)| sound(x, y))
        .collect();
    let mean = |of: &dyn Fn(usize) -> f64, (x, y): (usize, usize)| {
        let rows = (y..y + cell).map(|y| y * size.width + x);
        rows.flat_map(|first| first..first + cell).map(of).sum::<f64>() / (cell * cell) as f64
    };
    let (seen, local) = (shot.seen.data(), local.data());
    let misfit = corners.iter().map(|&at| mean(&|n| f64::from(seen[n] - local[n]), at)).collect();
    let white = Plane::filled(size, 1.0);
    let columns = veils.iter().map(|veil| {
        let (spread, flat) = (veil.on_pixels(&shot.shown), veil.on_pixels(&white));
        let adds = |n: usize| {
            f64::from(spread.data()[n] - local[n])
                + f64::from(1.0 - flat.data()[n]) * f64::from(seen[n])
        };
        corners.iter().map(|&at| mean(&adds, at)).collect()
    });
    PatternMisfit { misfit, columns: columns.collect() }
}

/// The shares that explain most, none negative.
fn shares(evidence: &[PatternMisfit], count: usize) -> Vec<f64> {
    let dot =
        |a: &dyn Fn(&PatternMisfit) -> Vec<f64>, b: &dyn Fn(&PatternMisfit) -> Vec<f64>| -> f64 {
            evidence.iter().map(|e| a(e).iter().zip(&b(e)).map(|(a, b)| a * b).sum::<f64>()).sum()
        };
    let column = |j: usize| move |e: &PatternMisfit| e.columns[j].clone();
    let misfit = |e: &PatternMisfit| e.misfit.clone();
    let normal: Vec<Vec<f64>> =
        (0..count).map(|i| (0..count).map(|j| dot(&column(i), &column(j))).collect()).collect();
    let side: Vec<f64> = (0..count).map(|i| dot(&column(i), &misfit)).collect();
    let mut shares = vec![0.0f64; count];
    for _ in 0..ROUNDS {
        for i in 0..count {
            let others: f64 =
                (0..count).filter(|&j| j != i).map(|j| normal[i][j] * shares[j]).sum();
            let best = (side[i] - others) / normal[i][i].max(f64::MIN_POSITIVE);
            // All of them together are no more than a lens can scatter.
            let room = f64::from(SHARE_MAX) - (shares.iter().sum::<f64>() - shares[i]);
            shares[i] = best.clamp(0.0, room.max(0.0));
        }
    }
    shares
}

/// Squared misfit left by `shares`.
fn squared(evidence: &PatternMisfit, shares: &[f64]) -> f64 {
    let left = |n: usize| {
        let added: f64 = evidence.columns.iter().zip(shares).map(|(column, s)| s * column[n]).sum();
        (evidence.misfit[n] - added).powi(2)
    };
    (0..evidence.misfit.len()).map(left).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::LensFunctions;
    use crate::patterns::pseudo_random;

    const SIZE: Size = Size::new(240, 180);

    fn model(halos: &[Halo], beyond: Beyond) -> LensModel {
        let mut taps = vec![0.0; 81];
        taps[30..51].fill(1.0 / 21.0);
        let functions = LensFunctions {
            rows: 1,
            columns: 1,
            support_px: 9,
            taps: [taps.clone(), taps.clone(), taps],
        };
        let halos = std::array::from_fn(|_| halos.to_vec());
        LensModel::new(SIZE, 0, &functions).unwrap().with_broad_light(&halos, beyond).unwrap()
    }

    fn shots(truth: &LensModel, noise: f32) -> Vec<Shot> {
        let shot = |(n, square): (usize, &usize)| {
            let signs = pseudo_random(
                Size::new(SIZE.width.div_ceil(*square), SIZE.height.div_ceil(*square)),
                n as u64,
            );
            let shown = Plane::from_fn(SIZE, |x, y| 80.0 * signs.at(x / square, y / square));
            let mut seen = Plane::zeros(SIZE);
            truth.forward(Channel::Green, &shown, &mut seen);
            let rough = pseudo_random(SIZE, 100 + n as u64);
            seen.add_scaled(noise, &rough);
            Shot { shown, seen }
        };
        [18, 36, 72, 27].iter().enumerate().map(shot).collect()
    }

    #[test]
    fn halos_are_found_again_in_noise() {
        for beyond in [Beyond::Dark, Beyond::LikeTheBorder] {
            for truth in [vec![(18.0, 0.1)], vec![(25.0, 0.05)], vec![(9.0, 0.05), (72.0, 0.1)]] {
                let truth: Vec<Halo> =
                    truth.iter().map(|&(radius_px, share)| Halo { radius_px, share }).collect();
                let trusted = Plane::filled(SIZE, 1);
                let found = halos(
                    &model(&[], beyond),
                    Channel::Green,
                    &shots(&model(&truth, beyond), 1.0),
                    &trusted,
                    beyond,
                );
                let share = |halos: &[Halo]| halos.iter().map(|h| h.share).sum::<f32>();
                assert!(
                    (share(&found) / share(&truth) - 1.0).abs() < 0.1,
                    "{beyond:?} {truth:?}: {found:?}"
                );
                // What counts is the light: a picture that no fit has seen.
                let shown = Plane::from_fn(SIZE, |x, y| if x * 3 > y * 4 { 200.0 } else { 20.0 });
                let mut light = [Plane::zeros(SIZE), Plane::zeros(SIZE)];
                model(&truth, beyond).forward(Channel::Green, &shown, &mut light[0]);
                model(&found, beyond).forward(Channel::Green, &shown, &mut light[1]);
                let [mut off, seen] = light;
                off.add_scaled(-1.0, &seen);
                assert!(
                    off.rms() < 0.3,
                    "{beyond:?} {truth:?}: {found:?}, off by {:.2}",
                    off.rms()
                );
            }
        }
    }

    #[test]
    fn a_lens_without_broad_light_gets_none() {
        let trusted = Plane::filled(SIZE, 1);
        for noise in [0.0, 1.0, 4.0] {
            let lens = model(&[], Beyond::Dark);
            let found = halos(&lens, Channel::Green, &shots(&lens, noise), &trusted, Beyond::Dark);
            assert!(found.is_empty(), "noise {noise}: {found:?}");
        }
    }
}
