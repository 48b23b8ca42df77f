//! The broad light of a lens, from captures of large squares.
//!
//! With the functions known (each of sum 1) and flats seen flat, what is seen of a pattern x
//! differs from P x by what is spread wider: y − P x = Σⱼ sⱼ (Gⱼ x − P x), and where dark lies
//! beyond the canvas sⱼ (1 − Gⱼ 1) y is added on the right, for the flats have been scaled by it.
//! The Gaussians' radii are given, each twice the one before; the shares are the least squares'
//! with none below 0 (non-negative least squares by coordinate descent). A pattern held out tells
//! whether any of it is true.
//!
//! Only places count whose function sees nothing but one square: there P x = x, whatever the
//! functions are. At the squares' edges what is wrong with the functions would be taken for broad
//! light, and much of that for a little of the former. What of the broad light falls within the
//! functions was measured with them, and is taken out of them afterwards.

use super::Shot;
use crate::deconvolution::lens_model::broad::{SHARE_MAX, Veil};
use crate::deconvolution::lens_model::{Beyond, Halo, LensFunctions};
use crate::frame::{Channel, Plane, Size};

/// Rounds of coordinate descent; the radii's columns are alike, so it takes many, and each costs
/// next to nothing.
const ROUNDS: usize = 2000;
/// Smaller shares of the light are left out: a grey level of 255 is 0.4 %.
const SHARE_MIN: f32 = 0.002;
/// Broad light is believed when it takes away at least so much of the squared misfit of the pattern
/// held out. Guess.
const BELIEVED: f64 = 0.2;
/// Light of one square differs by no more than this where a panel shows it, grey levels.
const EVEN: f32 = 0.01;
/// Cells a radius of half a lens function has: what is compared are means over them. Guess.
const CELLS: usize = 2;

/// What one pattern says: the misfit without broad light, and what a share of each Gaussian would
/// add, cell by cell; each times the root of the pixels it is of.
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

/// The halos of one channel, wider than functions of `support_px`: what `shots` say but for the
/// last, believed when the last agrees; none when there are fewer than two. `trusted` has a 1 where
/// all captures can be trusted.
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

/// Takes out of the functions of `channel`, each of sum 1, what of the light of `halos` falls
/// within them: they were measured with it, and a model adds it.
pub fn without_halos(functions: &mut LensFunctions, channel: Channel, halos: &[Halo]) {
    let side = functions.support_px;
    let mut within = vec![0.0f32; side * side];
    for halo in halos {
        let along = halo.along(side);
        for (row, down) in within.chunks_exact_mut(side).zip(&along) {
            row.iter_mut().zip(&along).for_each(|(w, across)| *w += halo.share * down * across);
        }
    }
    let all: f32 = halos.iter().map(|halo| halo.share).sum();
    // What the functions had of all light, and what they are to have.
    let (seen, local) = (1.0 - all + within.iter().sum::<f32>(), 1.0 - all);
    for function in functions.taps[channel.index()].chunks_exact_mut(side * side) {
        function.iter_mut().zip(&within).for_each(|(t, w)| *t = (seen * *t - w) / local);
    }
}

/// 1 where all within half of `support_px` is one square of `shown`, else 0, as near the border.
pub fn within_a_square(shown: &Plane, support_px: usize) -> Plane<u8> {
    let (size, reach) = (shown.size(), support_px / 2);
    let near = |n: usize, length: usize| n.saturating_sub(reach)..(n + reach + 1).min(length);
    let (least, largest) = (f32::INFINITY, f32::NEG_INFINITY);
    let widened = |(a, b): (f32, f32), (c, d): (f32, f32)| (a.min(c), b.max(d));
    // The least and the largest near each place, along its row and then along its column.
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

/// Misfit and columns over cells, of their trusted pixels within one square.
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
    let sums = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let sum = |pixels: &Vec<usize>| {
            pixels.iter().map(|&n| of(n)).sum::<f64>() / (pixels.len() as f64).sqrt()
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
    fn halos_are_found_again_in_noise() {
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
            let found = halos(9, Channel::Green, &shots(&lens, noise), &trusted, Beyond::Dark);
            assert!(found.is_empty(), "noise {noise}: {found:?}");
        }
    }

    #[test]
    fn halos_taken_out_of_functions_leave_what_was_measured_of_both() {
        let halos = [(9.0, 0.05), (25.0, 0.1)].map(|(radius_px, share)| Halo { radius_px, share });
        let measured = model(&[], Beyond::Dark).functions().clone();
        let mut functions = measured.clone();
        without_halos(&mut functions, Channel::Green, &halos);
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
        // Of all light what falls within the functions, and each of them still passes it on.
        let beyond: f32 = halos.iter().map(|halo| halo.beyond(side)).sum();
        assert!((sum - 1.0).abs() < 1e-4 && (seen - (1.0 - beyond)).abs() < 1e-4, "{sum} {seen}");
        assert!(ratios.iter().all(|ratio| (ratio / seen - 1.0).abs() < 1e-4), "{ratios:?}");
        assert_eq!(functions.taps[0], measured.taps[0]);
    }

    #[test]
    fn places_within_a_square_are_those_whose_functions_see_it_alone() {
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
