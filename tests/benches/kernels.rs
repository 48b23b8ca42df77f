//! Time of the inner kernels: one 1024×768 plane, one thread, as `peers.py` times its libraries.

// A failed unwrap ends the benchmark.
#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use relens::deconvolution::lens_model::{LensFunctions, LensModel};
use relens::deconvolution::quality::ssim;
use relens::deconvolution::wavelet::{Scratch, Sym8};
use relens::deconvolution::wavelet_shrinkage::{Shrinkage, ShrinkageScratch};
use relens::frame::resample::{resize, warp};
use relens::frame::{Channel, Plane, Size};

const PHOTO: Size = Size::new(1024, 768);

fn main() {
    // Everything runs in the pool's thread; otherwise handing work over would be timed, too.
    rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(divan::main);
}

/// Shading, edges and texture in 0..255.
fn picture(size: Size) -> Plane {
    Plane::from_fn(size, |x, y| {
        let (u, v) = (x as f32, y as f32);
        let shading = 100.0 + 50.0 * (u / 91.0).sin() * (v / 67.0).cos();
        shading
            + if (x / 37 + y / 53) % 3 == 0 { 60.0 } else { 0.0 }
            + ((x * 31 + y * 17) % 13) as f32
    })
}

/// `rows` × `columns` lens functions of `support_px`: Gaussians that widen and lean towards the
/// corners.
fn functions(rows: usize, columns: usize, support_px: usize) -> LensFunctions {
    let r = (support_px / 2) as f32;
    let mut one = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let (u, v) = (column as f32 / columns as f32 - 0.5, row as f32 / rows as f32 - 0.5);
            let sigma = 2.0 + 4.0 * (u * u + v * v);
            let taps: Vec<f32> = (0..support_px * support_px)
                .map(|t| {
                    let (x, y) = (
                        (t % support_px) as f32 - r - 3.0 * u,
                        (t / support_px) as f32 - r - 3.0 * v,
                    );
                    (-(x * x + y * y + x * y * u * v) / (2.0 * sigma * sigma)).exp()
                })
                .collect();
            let total: f32 = taps.iter().sum();
            one.extend(taps.iter().map(|t| t / total));
        }
    }
    LensFunctions { rows, columns, support_px, taps: [one.clone(), one.clone(), one] }
}

#[divan::bench]
fn sym8_analysis_and_synthesis(bencher: Bencher) {
    let (transform, x) = (Sym8::new(PHOTO, 4), picture(PHOTO));
    let (mut found, mut back, mut scratch) = (transform.zeros(), x.clone(), Scratch::default());
    bencher.bench_local(|| {
        transform.analyse(black_box(&x), &mut found, &mut scratch);
        transform.synthesise(&found, &mut back, &mut scratch);
    });
}

#[divan::bench(args = [(0, 0), (5, 3)])]
fn sym8_shrinkage(bencher: Bencher, shift: (usize, usize)) {
    let (shrinkage, mut x, mut scratch) =
        (Shrinkage::new(PHOTO, 4), picture(PHOTO), ShrinkageScratch::default());
    bencher.bench_local(|| shrinkage.shrink(black_box(&mut x), 0.01, shift, &mut scratch));
}

#[divan::bench]
fn warp_bicubic(bencher: Bencher) {
    let source = picture(PHOTO);
    let place = |x: usize, y: usize| {
        let (u, v) = ((x as f32 - 512.0) / 512.0, (y as f32 - 384.0) / 512.0);
        let k = 0.95 * (1.0 + 0.06 * (u * u + v * v));
        (512.0 + u * k * 512.0 + 0.3, 384.0 + v * k * 512.0 - 0.2)
    };
    let map_x = Plane::from_fn(PHOTO, |x, y| place(x, y).0);
    let map_y = Plane::from_fn(PHOTO, |x, y| place(x, y).1);
    let mut out = source.clone();
    bencher.bench_local(|| warp(black_box(&source), &map_x, &map_y, &mut out));
}

#[divan::bench]
fn resize_to_half(bencher: Bencher) {
    let source = picture(PHOTO);
    bencher.bench_local(|| resize(black_box(&source), Size::new(512, 384)));
}

#[divan::bench]
fn ssim_gaussian(bencher: Bencher) {
    let a = picture(PHOTO);
    let b = a.map(|v| v * 0.97 + 3.0);
    bencher.bench_local(|| ssim(black_box(&a), black_box(&b)));
}

#[divan::bench(args = [0, 32])]
fn lens_model_forward(bencher: Bencher, margin_px: usize) {
    let model = LensModel::new(PHOTO, margin_px, &functions(6, 8, 51)).expect("a proper grid");
    let x = picture(model.canvas());
    let mut out = x.clone();
    bencher.bench_local(|| model.forward(Channel::Green, black_box(&x), &mut out));
}

#[divan::bench(args = [0, 32])]
fn lens_model_adjoint(bencher: Bencher, margin_px: usize) {
    let model = LensModel::new(PHOTO, margin_px, &functions(6, 8, 51)).expect("a proper grid");
    let x = picture(model.canvas());
    let mut out = x.clone();
    bencher.bench_local(|| model.adjoint(Channel::Green, black_box(&x), &mut out));
}

#[divan::bench(sample_count = 5, sample_size = 1)]
fn lens_model_from_functions(bencher: Bencher) {
    let functions = functions(6, 8, 51);
    bencher.bench_local(|| LensModel::new(PHOTO, 32, black_box(&functions)));
}
