//! Broad light of a lens, from captures of large squares.
//!
//! Given the functions (each of sum 1) and captures in which flats are even, the capture y of a
//! pattern x differs from P x by the light spread wider: y − P x = Σⱼ sⱼ (Gⱼ x − P x). If it is
//! dark beyond the canvas, sⱼ (1 − Gⱼ 1) y is added on the right, because the correction by flats
//! has made up for that loss. The Gaussians' radii are given, each twice the previous; the shares
//! sⱼ are non-negative least squares by coordinate descent. A held-out pattern validates them.
//!
//! Only pixels whose function lies within one square are used: there P x = x for any functions. At
//! edges, errors of the functions would be mistaken for broad light. The measured functions contain
//! the broad light within their support, which is removed from them afterwards.

use nalgebra::{DMatrix, DVector};

use super::Shot;
use crate::deconvolution::lens_model::broad::{SHARE_MAX, Veil};
use crate::deconvolution::lens_model::{Beyond, Halo, LensFunctions};
use crate::frame::{Channel, Plane, Size};

/// Rounds of coordinate descent. Many are needed, as the columns are similar; they are cheap.
const ROUNDS: usize = 2000;
/// Least share of light of a halo; one grey level of 255 is 0.4 %.
const SHARE_MIN: f32 = 0.002;
/// Least reduction of the squared misfit of the held-out pattern, as a share. Guess.
const REDUCTION_MIN: f64 = 0.2;
/// Largest variation of light within one square, grey levels.
const EVEN: f32 = 0.01;
/// Cells per half width of a lens function; means over cells are compared. Guess.
const CELLS: usize = 2;

/// Evidence of one pattern per cell: the misfit without broad light, and the effect of each
/// Gaussian's share, both times the square root of the number of the cell's pixels.
struct PatternMisfit {
    misfit: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

/// The radii fitted for functions of `support_px` on a canvas of `size`.
fn radii_px(support_px: usize, size: Size) -> Vec<f32> {
    let widest = size.width.max(size.height) as f32 / 2.0;
    let first = support_px as f32 / 2.0;
    std::iter::successors(Some(first), |r| Some(2.0 * r)).take_while(|r| *r <= widest).collect()
}

/// Fits the halos of one channel, wider than functions of `support_px`, to all `shots` but the
/// last, which must confirm them. There are no halos with fewer than two shots. `trusted` is 1
/// where all captures are valid.
pub fn halos(
    support_px: usize,
    channel: Channel,
    shots: &[Shot],
    trusted: &Plane<u8>,
    beyond: Beyond,
) -> Vec<Halo> {
    let radii = radii_px(support_px, trusted.size());
    let Some((held_out, fitted)) = shots.split_last().filter(|(_, fitted)| !fitted.is_empty())
    else {
        return Vec::new();
    };
    let veils: Vec<Veil> =
        radii.iter().map(|&radius_px| Veil::new(trusted.size(), radius_px, beyond)).collect();
    let evidence = |shot: &Shot| evidence(support_px, shot, &veils, trusted);
    let shares = shares(&fitted.iter().map(evidence).collect::<Vec<_>>(), veils.len());
    let test = evidence(held_out);
    let (without, with) = (squared(&test, &vec![0.0; shares.len()]), squared(&test, &shares));
    log::debug!(
        "{channel:?}: shares {shares:.4?} of radii {radii:.0?} px reduce the misfit to {:.3}",
        with / without
    );
    if with > (1.0 - REDUCTION_MIN) * without {
        return Vec::new();
    }
    let pairs = radii.iter().zip(&shares);
    let found = pairs.map(|(&radius_px, &share)| Halo { radius_px, share: share as f32 });
    found.filter(|halo| halo.share >= SHARE_MIN).collect()
}

/// Removes from the functions of `channel`, each of sum 1, the light of `halos` within their
/// support, because the model adds that light itself.
pub fn remove_halos(functions: &mut LensFunctions, channel: Channel, halos: &[Halo]) {
    let side = functions.support_px;
    let mut within = vec![0.0f32; side * side];
    for halo in halos {
        let along = halo.along(side);
        for (row, down) in within.chunks_exact_mut(side).zip(&along) {
            row.iter_mut().zip(&along).for_each(|(w, across)| *w += halo.share * down * across);
        }
    }
    let all: f32 = halos.iter().map(|halo| halo.share).sum();
    // Share of all light in the functions before and after.
    let (seen, local) = (1.0 - all + within.iter().sum::<f32>(), 1.0 - all);
    for function in functions.taps[channel.index()].chunks_exact_mut(side * side) {
        function.iter_mut().zip(&within).for_each(|(t, w)| *t = (seen * *t - w) / local);
    }
}

/// 1 where everything within half of `support_px` lies in one square of `shown`; 0 elsewhere and
/// near the border.
pub fn within_a_square(shown: &Plane, support_px: usize) -> Plane<u8> {
    let (size, reach) = (shown.size(), support_px / 2);
    let near = |n: usize, length: usize| n.saturating_sub(reach)..(n + reach + 1).min(length);
    let (least, largest) = (f32::INFINITY, f32::NEG_INFINITY);
    let widened = |(a, b): (f32, f32), (c, d): (f32, f32)| (a.min(c), b.max(d));
    // Running minimum and maximum along rows, then along columns.
    let along = Plane::from_fn(size, |x, y| {
        let row = &shown.row(y)[near(x, size.width)];
        row.iter().map(|&v| (v, v)).fold((least, largest), widened)
    });
    Plane::from_fn(size, |x, y| {
        let (columns, rows) = (near(x, size.width), near(y, size.height));
        let is_inside = columns.len().min(rows.len()) > 2 * reach;
        let (least, largest) = rows.map(|y| along.at(x, y)).fold((least, largest), widened);
        u8::from(is_inside && largest - least <= EVEN)
    })
}

/// The evidence of `shot` over trusted pixels within one square.
fn evidence(support_px: usize, shot: &Shot, veils: &[Veil], trusted: &Plane<u8>) -> PatternMisfit {
    let (size, cell) = (trusted.size(), (support_px / (2 * CELLS)).max(1));
    let alone = within_a_square(&shot.shown, support_px);
    let pixels = |x0: usize, y0: usize| -> Vec<usize> {
        (y0..(y0 + cell).min(size.height))
            .flat_map(|y| (x0..(x0 + cell).min(size.width)).map(move |x| (x, y)))
            .filter(|&(x, y)| alone.at(x, y) > 0 && trusted.at(x, y) > 0)
            .map(|(x, y)| y * size.width + x)
            .collect()
    };
    let cells: Vec<Vec<usize>> = (0..size.height)
        .step_by(cell)
        .flat_map(|y| (0..size.width).step_by(cell).map(move |x| (x, y)))
        .map(|(x, y)| pixels(x, y))
        .filter(|pixels| !pixels.is_empty())
        .collect();
    let sums = |value: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let sum = |pixels: &Vec<usize>| {
            pixels.iter().map(|&n| value(n)).sum::<f64>() / (pixels.len() as f64).sqrt()
        };
        cells.iter().map(sum).collect()
    };
    let (seen, shown) = (shot.seen.data(), shot.shown.data());
    let white = Plane::filled(size, 1.0);
    let columns = veils.iter().map(|veil| {
        let (spread, flat) = (veil.on_pixels(&shot.shown), veil.on_pixels(&white));
        sums(&|n| {
            f64::from(spread.data()[n] - shown[n])
                + f64::from(1.0 - flat.data()[n]) * f64::from(seen[n])
        })
    });
    let columns = columns.collect();
    PatternMisfit { misfit: sums(&|n| f64::from(seen[n] - shown[n])), columns }
}

/// Non-negative least-squares shares of `count` Gaussians.
fn shares(evidence: &[PatternMisfit], count: usize) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let products = |i: usize, of: &dyn Fn(&PatternMisfit) -> &[f64]| -> f64 {
        evidence.iter().map(|e| dot(&e.columns[i], of(e))).sum()
    };
    let normal = DMatrix::from_fn(count, count, |i, j| products(i, &|e| &e.columns[j]));
    let side = DVector::from_fn(count, |i, _| products(i, &|e| &e.misfit));
    let mut shares = vec![0.0f64; count];
    for _ in 0..ROUNDS {
        for i in 0..count {
            let others: f64 =
                (0..count).filter(|&j| j != i).map(|j| normal[(i, j)] * shares[j]).sum();
            let best = (side[i] - others) / normal[(i, i)].max(f64::MIN_POSITIVE);
            // Their sum is bounded by what a lens can scatter.
            let room = f64::from(SHARE_MAX) - (shares.iter().sum::<f64>() - shares[i]);
            shares[i] = best.clamp(0.0, room.max(0.0));
        }
    }
    shares
}

fn squared(evidence: &PatternMisfit, shares: &[f64]) -> f64 {
    let residual = |n: usize| {
        let added: f64 = evidence.columns.iter().zip(shares).map(|(column, s)| s * column[n]).sum();
        (evidence.misfit[n] - added).powi(2)
    };
    (0..evidence.misfit.len()).map(residual).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deconvolution::lens_model::LensModel;
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
    fn halos_are_recovered_from_noise() {
        for beyond in [Beyond::Dark, Beyond::LikeTheBorder] {
            for truth in [vec![(18.0, 0.1)], vec![(25.0, 0.05)], vec![(9.0, 0.05), (72.0, 0.1)]] {
                let truth: Vec<Halo> =
                    truth.iter().map(|&(radius_px, share)| Halo { radius_px, share }).collect();
                let trusted = Plane::filled(SIZE, 1);
                let shots = shots(&model(&truth, beyond), 1.0);
                let found = halos(9, Channel::Green, &shots, &trusted, beyond);
                let share = |halos: &[Halo]| halos.iter().map(|h| h.share).sum::<f32>();
                assert!(
                    (share(&found) / share(&truth) - 1.0).abs() < 0.1,
                    "{beyond:?} {truth:?}: {found:?}"
                );
                // Compares the predicted light of a picture that the fit did not use.
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
    fn a_lens_without_broad_light_gets_no_halos() {
        let trusted = Plane::filled(SIZE, 1);
        for noise in [0.0, 1.0, 4.0] {
            let lens = model(&[], Beyond::Dark);
            let found = halos(9, Channel::Green, &shots(&lens, noise), &trusted, Beyond::Dark);
            assert!(found.is_empty(), "noise {noise}: {found:?}");
        }
    }

    #[test]
    fn functions_and_removed_halos_add_up_to_the_measurement() {
        let halos = [(9.0, 0.05), (25.0, 0.1)].map(|(radius_px, share)| Halo { radius_px, share });
        let measured = model(&[], Beyond::Dark).functions().clone();
        let mut functions = measured.clone();
        remove_halos(&mut functions, Channel::Green, &halos);
        let side = functions.support_px;
        let bells = halos.map(|halo| (halo.share, halo.along(side)));
        let (mut sum, mut seen) = (0.0f32, 0.0f32);
        let parts = functions.taps[1].iter().zip(&measured.taps[1]).enumerate();
        let mut ratios = Vec::new();
        for (n, (&tap, &before)) in parts {
            let within: f32 =
                bells.iter().map(|(s, along)| s * along[n / side] * along[n % side]).sum();
            let all = 0.85 * tap + within;
            (sum, seen) = (sum + tap, seen + all);
            ratios.extend((before > 0.0).then_some(all / before));
            assert!(before > 0.0 || all.abs() < 1e-6, "{all}");
        }
        // Within the support, functions plus halos are proportional to the measurement, tap by tap.
        let beyond: f32 = halos.iter().map(|halo| halo.beyond(side)).sum();
        assert!((sum - 1.0).abs() < 1e-4 && (seen - (1.0 - beyond)).abs() < 1e-4, "{sum} {seen}");
        assert!(ratios.iter().all(|ratio| (ratio / seen - 1.0).abs() < 1e-4), "{ratios:?}");
        assert_eq!(functions.taps[0], measured.taps[0]);
    }

    #[test]
    fn pixels_within_a_square_have_their_whole_function_inside() {
        let squares =
            Plane::from_fn(SIZE, |x, y| if (x / 30 + y / 30) % 2 == 0 { 1.0 } else { 0.0 });
        let found = within_a_square(&squares, 9);
        for y in 0..SIZE.height {
            for x in 0..SIZE.width {
                let alone = (4..26).contains(&(x % 30)) && (4..26).contains(&(y % 30));
                assert_eq!(found.at(x, y) > 0, alone, "{x} {y}");
            }
        }
        let flat = within_a_square(&Plane::zeros(SIZE), 9);
        assert_eq!(
            flat.data().iter().map(|&v| usize::from(v)).sum::<usize>(),
            (240 - 8) * (180 - 8)
        );
    }
}
