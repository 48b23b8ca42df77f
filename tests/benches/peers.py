#!/usr/bin/env python3
"""relens' kernels beside the usual libraries, one thread, one run: prints a table of times and ratios.

One 1024x768 float32 plane. Kernels and libraries are timed by turns, so that other load disturbs both alike. Printed
are the fastest and the median of the turns, and the ratios of the fastest.

Needs: numpy scipy scikit-image opencv-python-headless PyWavelets
Run:   python tests/benches/peers.py [--turns 5]
"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[name] = "1"

import argparse
import json
import pathlib
import re
import statistics
import subprocess
import time

import cv2
import numpy as np
import pywt
import scipy.fft
from skimage.metrics import structural_similarity

H, W = 768, 1024
MS = {"ns": 1e-6, "µs": 1e-3, "us": 1e-3, "ms": 1.0, "s": 1e3}


def picture():
    """Shading, edges and texture, as the Rust benchmarks have it."""
    y, x = np.mgrid[0:H, 0:W]
    shading = 100 + 50 * np.sin(x / 91) * np.cos(y / 67)
    return (shading + np.where((x // 37 + y // 53) % 3 == 0, 60, 0) + (x * 31 + y * 17) % 13).astype(np.float32)


def built():
    """Builds our benchmarks and returns the program."""
    root = pathlib.Path(__file__).resolve().parents[2]
    made = subprocess.run(["cargo", "bench", "--bench", "kernels", "--no-run", "--message-format=json"],
                          cwd=root, check=True, capture_output=True, text=True).stdout
    for line in made.splitlines():
        message = json.loads(line)
        if message.get("executable") and message["target"]["name"] == "kernels":
            return message["executable"]
    raise SystemExit("cargo built no benchmark named kernels")


def ours(program, case, argument):
    """Fastest and median time in ms of our benchmark `case`, with its argument if it has one."""
    shown = subprocess.run([program, "--bench", case, "--sample-count", "40", "--color", "never"],
                           check=True, capture_output=True, text=True).stdout
    for line in shown.splitlines():
        label = re.match(r"^[│├╰─ ]*(.*?) {2,}", line)
        times = re.findall(r"([\d.]+) (ns|µs|us|ms|s)\b", line)
        if label and len(times) == 4 and label.group(1) in (argument or case, case):
            return [float(times[k][0]) * MS[times[k][1]] for k in (0, 2)]
    raise SystemExit(f"no line of {case} {argument} in:\n{shown}")


def theirs(work):
    """Fastest and median time in ms of 40 calls."""
    work()
    times = []
    for _ in range(40):
        begun = time.perf_counter()
        work()
        times.append((time.perf_counter() - begun) * 1e3)
    return [min(times), statistics.median(times)]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--turns", type=int, default=5)
    turns = parser.parse_args().turns
    cv2.setNumThreads(1)
    img = picture()
    other = img * np.float32(0.97) + np.float32(3)
    y, x = np.mgrid[0:H, 0:W].astype(np.float32)
    u, v = (x - 512) / 512, (y - 384) / 512
    k = 0.95 * (1 + 0.06 * (u * u + v * v))
    map_x = (512 + u * k * 512 + 0.3).astype(np.float32)
    map_y = (384 + v * k * 512 - 0.2).astype(np.float32)
    out = np.empty_like(img)

    def wavelet():
        return pywt.waverec2(pywt.wavedec2(img, "sym8", mode="periodization", level=4), "sym8", mode="periodization")

    def pair():
        return scipy.fft.irfft2(scipy.fft.rfft2(img), s=img.shape)

    def remap():
        return cv2.remap(img, map_x, map_y, cv2.INTER_CUBIC, dst=out, borderMode=cv2.BORDER_REPLICATE)

    def similarity():
        return structural_similarity(img, other, data_range=255, gaussian_weights=True, sigma=1.5,
                                     use_sample_covariance=False)

    # Checks that the peers compute what they are timed for.
    assert np.abs(wavelet() - img).max() < 1e-2 and np.abs(pair() - img).max() < 1e-2

    # Our benchmark, its argument, the peer, its function, maximum of ours/theirs (None: only
    # shown).
    cases = [
        ("sym8_analysis_and_synthesis", None, "PyWavelets wavedec2+waverec2", wavelet, 1 / 8),
        ("warp_bicubic", None, "OpenCV remap bicubic", remap, 1.0),
        ("lens_model_forward", "0", "scipy rfft2+irfft2", pair, 4.0),
        ("lens_model_adjoint", "0", "scipy rfft2+irfft2", pair, 4.0),
        ("ssim_gaussian", None, "scikit-image SSIM", similarity, None),
    ]
    program = built()
    print("| kernel | ours ms (median) | peer | peer ms (median) | ours / peer | wanted |")
    print("|---|---:|---|---:|---:|---:|")
    for case, argument, peer, work, wanted in cases:
        rounds = [(ours(program, case, argument), theirs(work)) for _ in range(turns)]
        mine, its = ([min(r[i][0] for r in rounds), statistics.median(r[i][1] for r in rounds)] for i in (0, 1))
        limit = f"≤ {wanted:.3g}" if wanted else ""
        print(f"| {case} | {mine[0]:.2f} ({mine[1]:.2f}) | {peer} | {its[0]:.2f} ({its[1]:.2f}) "
              f"| {mine[0] / its[0]:.3f} | {limit} |", flush=True)
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
