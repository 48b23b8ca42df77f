#!/usr/bin/env python3
"""What scikit-image makes of the photos that relens charts: rows for the laboratory's `peers`.

Every method of scikit-image that takes a point spread function is given the photo and the central function that the rig
measured (it knows of one function for the whole field, and so does the usual user), alone and with one of its denoisers
behind it. The photo's edges are repeated around it: without, or with black, Richardson-Lucy loses 3 dB at the border.
SSIM and PSNR are scikit-image's own, as relens computes them. Seconds: the fastest of several calls, as many threads as the library takes.

Needs: numpy scipy scikit-image PyWavelets
Run:   cargo run --release --example lab -- captures --rig study.toml --out DIR
       python tests/benches/outside.py DIR > ROWS.csv
       cargo run --release --example lab -- peers --rig study.toml --rows ROWS.csv --out OTHER
"""
import argparse
import pathlib
import sys
import time
import zlib

import numpy as np
import skimage
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from skimage.restoration import (denoise_nl_means, denoise_tv_chambolle, denoise_wavelet, estimate_sigma,
                                 richardson_lucy, unsupervised_wiener, wiener)


def padded(work, photo, margin):
    """`work` on the photo with its edges repeated around it, cut back."""
    wide = np.pad(photo, margin, mode="edge")
    return work(wide)[margin:-margin, margin:-margin]


def methods(psf):
    """Name and function of photo (0..1) of everything tried."""
    margin = psf.shape[0]
    # Richardson-Lucy takes no negative light; what is no more than noise goes, as clipping it would leave a false skirt.
    noise = np.concatenate([psf[:5].ravel(), psf[-5:].ravel()]).std()
    light = np.where(psf > 3 * noise, psf, 0)
    light /= light.sum()

    def filtered(balance):
        return lambda photo: padded(lambda p: wiener(p, psf, balance, clip=False), photo, margin)

    def unsupervised(photo):
        # Its Gibbs sampler draws random numbers: the same ones every time.
        rng = np.random.default_rng(1)
        return padded(lambda p: unsupervised_wiener(p, psf, clip=False, rng=rng)[0], photo, margin)

    def lucy(steps):
        return lambda photo: padded(
            lambda p: richardson_lucy(np.clip(p, 1e-6, 1), light, num_iter=steps, clip=False), photo, margin)

    def tv(work, weight):
        return lambda photo: denoise_tv_chambolle(work(photo), weight=weight)

    def wavelets(work):
        return lambda photo: denoise_wavelet(work(photo), wavelet="sym8", method="BayesShrink", mode="soft",
                                             rescale_sigma=True)

    def means(work):
        def run(photo):
            sharp = work(photo)
            sigma = float(estimate_sigma(sharp))
            return denoise_nl_means(sharp, h=0.8 * sigma, sigma=sigma, patch_size=5, patch_distance=6, fast_mode=True)
        return run

    yield "unsupervised Wiener", unsupervised
    for balance in (0.003, 0.01, 0.03, 0.1, 0.3):
        yield f"Wiener balance {balance}", filtered(balance)
    for steps in (5, 10, 20, 40):
        yield f"Richardson-Lucy {steps} steps", lucy(steps)
    yield "unsupervised Wiener then wavelets", wavelets(unsupervised)
    yield "Wiener 0.01 then wavelets", wavelets(filtered(0.01))
    yield "Wiener 0.01 then total variation 0.01", tv(filtered(0.01), 0.01)
    yield "Wiener 0.01 then total variation 0.03", tv(filtered(0.01), 0.03)
    yield "Wiener 0.01 then non-local means", means(filtered(0.01))
    yield "Richardson-Lucy 20 then total variation 0.01", tv(lucy(20), 0.01)
    yield "Richardson-Lucy 20 then non-local means", means(lucy(20))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=pathlib.Path, help="where the laboratory's `captures` wrote to")
    parser.add_argument("--turns", type=int, default=3)
    words = parser.parse_args()
    psf = np.load(words.folder / "function.npy").astype(np.float64)
    psf /= psf.sum()
    print("setting,scene,photo-crc32,seconds,ssim,psnr-db")
    for name, method in methods(psf):
        for file in sorted(words.folder.glob("*-photo.npy")):
            scene = file.name.removesuffix("-photo.npy")
            photo = np.load(file)
            truth = np.load(file.with_name(f"{scene}-truth.npy")).astype(np.float64)
            times = []
            for _ in range(words.turns):
                begun = time.perf_counter()
                restored = method(photo.astype(np.float64) / 255)
                times.append(time.perf_counter() - begun)
            restored = np.clip(255 * restored, 0, 255)
            ssim = structural_similarity(truth, restored, data_range=255, gaussian_weights=True, sigma=1.5,
                                         use_sample_covariance=False)
            psnr = peak_signal_noise_ratio(truth, restored, data_range=255)
            print(f"{name},{scene},{zlib.crc32(photo.astype('<f4').tobytes()):08x},{min(times):.4f},{ssim:.4f},"
                  f"{psnr:.3f}", flush=True)
    print(f"scikit-image {skimage.__version__}", file=sys.stderr)


if __name__ == "__main__":
    main()
