//! Wiener filtering of the groups' coefficients, and aggregation of the filtered blocks.

use rayon::prelude::*;

use super::noise::BlockNoise;
use super::search::{Groups, Members, Task};
use super::transform::{AREA, Block, Cosines, SIDE, haar, haar_inverse};
use crate::frame::instructions::{Kernel, multiply_add, run_fastest};
use crate::frame::{Plane, Size};

/// Number of tasks whose sums are in memory at once. Guess: two for each core of a board.
const TASKS_AT_ONCE: usize = 8;

/// Filters `noisy` group by group by Wiener's rule, with the variances of `noise` and the signal's
/// power taken from the coefficients of `guide`. Pixels that no group covers are unchanged.
///
/// # Panics
/// When planes and groups differ in size.
pub fn filter(groups: &Groups, noisy: &Plane, guide: &Plane, noise: &BlockNoise<'_>) -> Plane {
    let size = noisy.size();
    assert!(groups.size() == size && guide.size() == size, "groups and planes of one size");
    let (window, cosines) = (&window(), &Cosines::new());
    let (mut total, mut weights) = (Plane::zeros(size), Plane::zeros(size));
    for tasks in groups.tasks().chunks(TASKS_AT_ONCE) {
        let filtered = tasks.par_iter().map(|task| {
            let mut found = Sums::new(task, size.width);
            run_fastest(Filter { task, noisy, guide, noise, window, cosines, sums: &mut found });
            found
        });
        // Added in the order of the tasks, so that the sums are the same on any number of threads.
        for sums in filtered.collect::<Vec<Sums>>() {
            let from = sums.first_row * size.width;
            let add = |to: &mut Plane, what: &[f32]| {
                to.data_mut()[from..][..what.len()].iter_mut().zip(what).for_each(|(t, w)| *t += w);
            };
            add(&mut total, &sums.values);
            add(&mut weights, &sums.weights);
        }
    }
    for ((value, weight), before) in
        total.data_mut().iter_mut().zip(weights.data()).zip(noisy.data())
    {
        *value = if *weight > 0.0 { *value / weight } else { *before };
    }
    total
}

/// Weighted sums of the blocks of a task, and of their weights.
struct Sums {
    first_row: usize,
    values: Vec<f32>,
    weights: Vec<f32>,
}

impl Sums {
    fn new(task: &Task, width: usize) -> Self {
        let none = vec![0.0; task.rows * width];
        Sums { first_row: task.first_row, values: none.clone(), weights: none }
    }
}

struct Filter<'a> {
    task: &'a Task,
    noisy: &'a Plane,
    guide: &'a Plane,
    noise: &'a BlockNoise<'a>,
    window: &'a Block,
    cosines: &'a Cosines,
    sums: &'a mut Sums,
}

impl Kernel for Filter<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Filter { task, noisy, guide, noise, window, cosines, sums } = self;
        let (mut blocks, mut signals) = (Vec::new(), Vec::new());
        for members in task.groups() {
            let Some(&(x, y)) = members.first() else { continue };
            let (variances, factor) = noise.at(x as usize, y as usize, noisy.size());
            analyse::<FUSED>(noisy, members, cosines, &mut blocks);
            analyse::<FUSED>(guide, members, cosines, &mut signals);
            let remaining = match members.len() {
                1 => shrink::<1>(&mut blocks, &signals, variances, factor),
                2 => shrink::<2>(&mut blocks, &signals, variances, factor),
                4 => shrink::<4>(&mut blocks, &signals, variances, factor),
                8 => shrink::<8>(&mut blocks, &signals, variances, factor),
                _ => shrink::<16>(&mut blocks, &signals, variances, factor),
            };
            let weight = 1.0 / remaining.max(LEAST);
            for (block, &place) in blocks.iter_mut().zip(members) {
                cosines.synthesise::<FUSED>(block);
                add_block::<FUSED>(block, place, noisy.size(), weight, window, sums);
            }
        }
    }
}

/// Minimum remaining noise power of a group, grey levels²: bounds the weight of an empty group.
pub(super) const LEAST: f32 = 1e-6;

/// Computes the cosine transforms of `members` into `blocks`.
#[inline(always)]
fn analyse<const FUSED: bool>(
    picture: &Plane,
    members: &Members,
    cosines: &Cosines,
    blocks: &mut Vec<Block>,
) {
    blocks.clear();
    let width = picture.width();
    for &(x, y) in members {
        let from = &picture.data()[y as usize * width + x as usize..][..(SIDE - 1) * width + SIDE];
        let mut block = [0.0; AREA];
        for (row, to) in block.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
            to.copy_from_slice(&from[row * width..][..SIDE]);
        }
        cosines.analyse::<FUSED>(&mut block);
        blocks.push(block);
    }
}

/// Shrinks a group of `N` `blocks` by Wiener's rule with the power of `signals`, both transformed
/// block by block, and returns the remaining noise power.
///
/// Eight coefficients of all blocks at a time go through the Haar transforms and the rule.
#[inline(always)]
fn shrink<const N: usize>(
    blocks: &mut [Block],
    signals: &[Block],
    variances: &Block,
    factor: f32,
) -> f32 {
    let (blocks, signals) = (&mut blocks[..N], &signals[..N]);
    let mut remaining = [0.0f32; SIDE];
    for (row, variances) in variances.as_chunks::<SIDE>().0.iter().enumerate() {
        let at = row * SIDE..(row + 1) * SIDE;
        let (mut values, mut powers) = ([[0.0f32; SIDE]; N], [[0.0f32; SIDE]; N]);
        for n in 0..N {
            values[n].copy_from_slice(&blocks[n][at.clone()]);
            powers[n].copy_from_slice(&signals[n][at.clone()]);
        }
        haar(&mut values);
        haar(&mut powers);
        for n in 0..N {
            let mut shares = [0.0f32; SIDE];
            for i in 0..SIDE {
                let power = powers[n][i] * powers[n][i];
                shares[i] = power / (power + factor * variances[i]).max(f32::MIN_POSITIVE);
            }
            for (value, share) in values[n].iter_mut().zip(&shares) {
                *value *= share;
            }
            for i in 0..SIDE {
                remaining[i] += shares[i] * shares[i] * variances[i];
            }
        }
        haar_inverse(&mut values);
        for n in 0..N {
            blocks[n][at.clone()].copy_from_slice(&values[n]);
        }
    }
    factor * remaining.iter().sum::<f32>()
}

/// Adds `block` at its place to `sums`, weighted by `weight` times `window`.
#[inline(always)]
fn add_block<const FUSED: bool>(
    block: &Block,
    (x, y): (u32, u32),
    size: Size,
    weight: f32,
    window: &Block,
    sums: &mut Sums,
) {
    let from = (y as usize - sums.first_row) * size.width + x as usize;
    let rows = block.as_chunks::<SIDE>().0.iter().zip(window.as_chunks::<SIDE>().0);
    for (row, (values, shares)) in rows.enumerate() {
        let at = from + row * size.width;
        let to = sums.values[at..at + SIDE].iter_mut().zip(&mut sums.weights[at..at + SIDE]);
        for ((sum, total), (value, share)) in to.zip(values.iter().zip(shares)) {
            let weight = weight * share;
            *sum = multiply_add::<FUSED>(weight, *value, *sum);
            *total += weight;
        }
    }
}

/// Kaiser window with β = 2 (Dabov et al. 2007).
pub(super) fn window() -> Block {
    let bessel = |x: f64| {
        let terms = (1..20).scan(1.0, |term, k| {
            *term *= (x / 2.0 / f64::from(k)).powi(2);
            Some(*term)
        });
        1.0 + terms.sum::<f64>()
    };
    let along: [f64; SIDE] = std::array::from_fn(|k| {
        let from_middle = 2.0 * k as f64 / (SIDE - 1) as f64 - 1.0;
        bessel(2.0 * (1.0 - from_middle * from_middle).sqrt()) / bessel(2.0)
    });
    std::array::from_fn(|n| (along[n / SIDE] * along[n % SIDE]) as f32)
}
