"""Held-out table: PSNR of display values of a run beside wavelets and BM3D.

    python evaluate.py DATA --run NAME [--others]
"""

import argparse
import os
import pathlib

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
import net
import noise
import numpy as np
import patches
import tensorflow as tf
import train

LEVELS = (2.0, 5.0, 10.0)
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def block_matching(seen, stated):
    """BM3D of linear light, at the level of white noise."""
    import bm3d

    found = []
    for picture, levels in zip(seen, stated):
        level = float(np.sqrt((levels**2).mean()))
        found.append(bm3d.bm3d_rgb(picture / 255, level / 255) * 255)
    return np.stack(found)


def wavelets(seen, stated):
    """Soft-thresholded sym8 of opponent colours, sixteen shifts averaged."""
    import pywt

    found = []
    for picture, levels in zip(seen, stated):
        level = float(np.sqrt((levels**2).mean()))
        colours = picture @ net.OPPONENT.T
        sums = np.zeros_like(colours)
        for shift in range(16):
            dy, dx = shift // 4, shift % 4
            moved = np.roll(colours, (dy, dx), (0, 1))
            for k in range(3):
                parts = pywt.wavedec2(moved[..., k], "sym8", "periodization", 4)
                bound = level * (1.5 if k == 0 else 2.5)
                kept = [parts[0]] + [
                    tuple(pywt.threshold(b, bound, "soft") for b in p) for p in parts[1:]
                ]
                sums[..., k] += np.roll(
                    pywt.waverec2(kept, "sym8", "periodization"), (-dy, -dx), (0, 1)
                )
        found.append(sums / 16 @ net.OPPONENT)
    return np.stack(found).astype(np.float32)


def colourfulness(linear):
    """C*ab of linear light 0..255, D65."""
    xyz = np.clip(linear / 255, 0, 1) @ XYZ.T / XYZ.sum(1)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.hypot(500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2]))


def grey_pages(data, level, coloured, count=30):
    """Seen pictures and stated noise of pages without colour."""
    random = np.random.default_rng(9)
    seen, stated = [], []
    for index in range(count):
        page = patches.drawn(data, index)[100:228, 100:228].astype(np.float32).mean(2)
        truth = np.repeat(page[None] / 65535 * 255, 3, 0)
        picture, levels = noise.degrade(truth, random, level, coloured, plain=True)
        seen.append(picture)
        stated.append(patches.to_cells(levels))
    return patches.channels_last(seen), patches.channels_last(stated)


def main():
    """Prints the table."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("--run", nargs="*", default=[])
    arguments.add_argument("--others", action="store_true", help="wavelets and BM3D too")
    chosen = arguments.parse_args()
    ways = {"as seen": lambda seen, stated: seen}
    for run in chosen.run:
        with np.load(chosen.data / "runs" / run / "weights.npz") as saved:
            weights = [tf.constant(saved[n].astype("<f2").astype(np.float32)) for n in saved.files]
        ways[run] = lambda seen, stated, w=weights: net.denoise_whole(w, seen, stated).numpy()
    if chosen.others:
        ways |= {"wavelets": wavelets, "BM3D": block_matching}
    print("| noise | " + " | ".join(ways) + " |\n|---|" + "---|" * len(ways))
    for coloured in (False, True):
        for level in LEVELS:
            truth, seen, stated = patches.held_out(chosen.data, level, coloured, crops=1, side=128)
            cells = [f"{train.psnr(way(seen, stated), truth):.2f}" for way in ways.values()]
            print(
                f"| {'coloured' if coloured else 'white'} {level:g} | " + " | ".join(cells) + " |",
                flush=True,
            )
    print("grey pages, C*ab mean / 99th percentile")
    for coloured in (False, True):
        for level in LEVELS[:2]:
            seen, stated = grey_pages(chosen.data, level, coloured)
            found = [colourfulness(way(seen, stated)) for way in ways.values()]
            cells = [f"{c.mean():.2f} / {np.percentile(c, 99):.1f}" for c in found]
            print(f"| {'coloured' if coloured else 'white'} {level:g} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
