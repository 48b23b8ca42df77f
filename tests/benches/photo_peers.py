#!/usr/bin/env python3
"""A photo's cost on the box beside what a user would take instead, one thread, one run: prints a table.

relens: `cargo bench --bench appliance -- sizes`, photos of 0.8 to 50 megapixels solved at 1024x768, from file to file.
Capture sharpening: Richardson-Lucy of luminance with a Gaussian of 1.5 px, 20 steps, as raw developers sharpen.
scikit-image: restoration.richardson_lucy of each channel with one function of 41x41 px, 20 steps.
The peers read a PNG and write one, each size in a process of its own. Printed are processor seconds a megapixel, reading
and writing included, and peak resident memory.

Needs: numpy scipy scikit-image opencv-python-headless
Run:   python tests/benches/photo_peers.py [--peers-only]
"""
import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ[name] = "1"

import multiprocessing
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np
from skimage.restoration import richardson_lucy

SIZES = [(1024, 768), (2048, 1536), (4096, 3072), (6144, 4608)]
STEPS = 20


def linear(codes):
    return (codes.astype(np.float32) / 255) ** 2.2


def codes(light):
    return (np.clip(light, 0, 1) ** (1 / 2.2) * 255 + 0.5).astype(np.uint8)


def capture_sharpening(photo):
    light = linear(photo)
    luma = (light @ np.array([0.0722, 0.7152, 0.2126], np.float32)).clip(1e-4)
    blur = lambda plane: cv2.GaussianBlur(plane, (0, 0), 1.5)
    sharp = luma.copy()
    for _ in range(STEPS):
        sharp *= blur(luma / blur(sharp).clip(1e-4))
    return codes(light * (sharp / luma)[..., None])


def scikit_image(photo):
    line = cv2.getGaussianKernel(41, 3.0).astype(np.float32)
    light = linear(photo)
    for channel in range(3):
        light[..., channel] = richardson_lucy(light[..., channel], line @ line.T, num_iter=STEPS)
    return codes(light)


def restore(method, path, found):
    cv2.setNumThreads(1)
    begun = time.process_time()
    cv2.imwrite(path + ".out.png", method(cv2.imread(path)))
    found.put((time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024))


def ours():
    """Rows of the box's own benchmark: size, processor seconds a megapixel, peak memory in MiB."""
    root = pathlib.Path(__file__).resolve().parents[2]
    shown = subprocess.run(["cargo", "bench", "--bench", "appliance", "--", "sizes"], cwd=root, check=True,
                           stdout=subprocess.PIPE, text=True).stdout
    line = re.compile(r"^(developed\.png|raw\.dng), (\d+)×(\d+), .*read ([\d.]+) s, restored ([\d.]+) s, encoded to "
                      r"[\d.]+ MB ([\d.]+) s .*peak memory (\d+) MiB", re.M)
    for photo, width, height, read, restored, written, peak in line.findall(shown):
        seconds = float(read) + float(restored) + float(written)
        yield f"relens, {photo}", int(width), int(height), seconds, float(peak)


def peers():
    made = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder:
        for width, height in SIZES:
            y, x = np.mgrid[0:height, 0:width]
            scene = (100 + 50 * np.sin(x / 91) * np.cos(y / 67) + np.where((x // 37 + y // 53) % 3 == 0, 60, 0))
            path = f"{folder}/{width}.png"
            cv2.imwrite(path, np.repeat(cv2.GaussianBlur(scene.astype(np.uint8), (0, 0), 3.0)[..., None], 3, 2))
            for method in (capture_sharpening, scikit_image):
                found = made.Queue()
                process = made.Process(target=restore, args=(method, path, found))
                process.start()
                yield method.__name__.replace("_", " "), width, height, *found.get()
                process.join()


def main():
    print("| method | photo | s/MP | peak MiB |\n|---|---|---:|---:|")
    rows = () if "--peers-only" in sys.argv else ours()
    for part in (rows, peers()):
        for method, width, height, seconds, peak in part:
            print(f"| {method} | {width}×{height} | {seconds * 1e6 / (width * height):.2f} | {peak:.0f} |", flush=True)


if __name__ == "__main__":
    main()
