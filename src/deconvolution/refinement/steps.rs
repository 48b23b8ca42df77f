//! Steps that are safe for changed functions: level norms grow by as much as more of a level is let
//! through.
//!
//! αⱼ goes with the largest power that a function lets through of level j's frequencies
//! ([`LevelNorms`]). Measuring it anew takes as long as solving a photo. But how it was with the
//! functions as measured is known, and what a change makes of it is the ratio of two spectra.

use std::f64::consts::PI;

use rayon::prelude::*;

use crate::deconvolution::lens_model::LensFunctions;
use crate::deconvolution::level_norms::LevelNorms;
use crate::frame::Channel;

/// Frequencies looked at from 0 to half a cycle a pixel.
const FREQUENCIES: usize = 24;
/// By so much the wavelet's octaves reach into each other.
const OVERLAP: f64 = 1.4;
/// The ratio is raised by so much where it is above 1. Guess; the power method is held against it
/// in the tests.
const RAISED: f32 = 1.1;

/// The norms of one channel for functions `after` in place of `before`, never smaller than they
/// were.
pub(super) fn safe(
    norms: &LevelNorms,
    channel: Channel,
    before: &LensFunctions,
    after: &LensFunctions,
) -> LevelNorms {
    let levels = norms.levels();
    let (before, after) = (passed(before, channel, levels), passed(after, channel, levels));
    let least = (0..=levels).map(|level| {
        let ratio = (after[level] / before[level].max(f64::MIN_POSITIVE)) as f32;
        if ratio > 1.0 { norms.at(level) * ratio * RAISED } else { 0.0 }
    });
    norms.at_least(&least.collect::<Vec<_>>())
}

/// The largest power that any function lets through of each level of details, and of the
/// approximation.
fn passed(functions: &LensFunctions, channel: Channel, levels: usize) -> Vec<f64> {
    let k = functions.support_px;
    let waves: Vec<(f64, f64)> = (0..=FREQUENCIES)
        .flat_map(|f| {
            (0..k).map(move |u| {
                (PI * f as f64 / FREQUENCIES as f64 * (u as f64 - (k / 2) as f64)).sin_cos()
            })
        })
        .collect();
    let of = |taps: &[f32]| {
        let mut largest = vec![0.0f64; levels + 1];
        for fx in 0..=FREQUENCIES {
            let wave = &waves[fx * k..][..k];
            // Each row of taps as seen by this horizontal frequency.
            let rows: Vec<(f64, f64)> = taps
                .chunks_exact(k)
                .map(|row| {
                    row.iter().zip(wave).fold((0.0, 0.0), |(re, im), (&t, (sin, cos))| {
                        (re + f64::from(t) * cos, im + f64::from(t) * sin)
                    })
                })
                .collect();
            for fy in 0..=FREQUENCIES {
                // Both signs of the vertical frequency at once: cosines and sines apart.
                let mut sums = [0.0f64; 4];
                for ((re, im), (sin, cos)) in rows.iter().zip(&waves[fy * k..][..k]) {
                    sums[0] += re * cos;
                    sums[1] += im * sin;
                    sums[2] += re * sin;
                    sums[3] += im * cos;
                }
                let up = (sums[0] - sums[1]).powi(2) + (sums[2] + sums[3]).powi(2);
                let down = (sums[0] + sums[1]).powi(2) + (sums[3] - sums[2]).powi(2);
                let frequency = fx.max(fy) as f64 / FREQUENCIES as f64;
                for (level, largest) in largest.iter_mut().enumerate() {
                    let octave = 0.5f64.powi(level as i32);
                    let lowest = if level == levels { 0.0 } else { octave / 2.0 / OVERLAP };
                    if (lowest..=octave * OVERLAP).contains(&frequency) {
                        *largest = largest.max(up).max(down);
                    }
                }
            }
        }
        largest
    };
    let area = k.pow(2).max(1);
    let all = functions.taps[channel.index()].par_chunks_exact(area).map(of);
    all.reduce(|| vec![0.0; levels + 1], |a, b| a.iter().zip(&b).map(|(a, b)| a.max(*b)).collect())
}
