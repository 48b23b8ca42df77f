"""Write the weights file and the golden vector of a training run.

    python export.py DATA --run NAME --out weights.bin [--golden FOLDER]

The file is a text header ended by a line `---`, then little-endian IEEE halves, layer by layer:
kernel [out][in][3][3], then bias [out]. The golden vector is computed with the rounded weights.
"""

import argparse
import datetime
import os
import pathlib

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
import net
import noise
import numpy as np
import patches
import tensorflow as tf

HERE = pathlib.Path(__file__).parent


def rounded(run):
    """Weights of a run, rounded to halves, as the net takes them."""
    with np.load(run / "weights.npz") as saved:
        return [saved[name].astype("<f2") for name in saved.files]


def header(run, width):
    """What made the weights, a few lines."""
    last = (run / "log.txt").read_text().splitlines()[-1]
    return "\n".join(
        [
            "relens prior: gates and additions on 2x2 Haar coefficients of opponent colours",
            f"made by tests/lab/prior/train.py, {datetime.date.today()}",
            f"layers 18->{width}, six {width}->{width}, {width}->24",
            "each: kernel [out][in][3][3], bias [out]; little-endian halves",
            "stages, each with its list's sha256:",
            (run / "made.txt").read_text().strip(),
            f"last {last}",
            "held out: PSNR of display values, dB, white at 2 5 10 grey levels, then coloured",
            "---\n",
        ]
    )


def golden(folder, halves, data):
    """Input, noise and output of a 64x48 picture: the middle of a page and of a photograph."""
    random = np.random.default_rng(5)
    photograph = patches.photographs(data, patches.HELD_OUT)[0][200:248, 300:332] / 65535 * 255
    page = patches.drawn(data, 2)[100:148, 100:132] / 65535 * 255
    truth = np.concatenate([photograph, page], 1).astype(np.float32)
    levels = np.array([4.0, 3.0, 5.0], np.float32)
    seen = (truth + random.normal(0, 1, truth.shape) * levels).astype(np.float32)
    stated = np.broadcast_to(levels, (24, 32, 3))
    weights = [tf.constant(half.astype(np.float32)) for half in halves]
    out = net.denoise_whole(weights, seen[None], stated[None])[0].numpy()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "golden-input.f32").write_bytes(seen.transpose(2, 0, 1).astype("<f4").tobytes())
    (folder / "golden-output.f32").write_bytes(out.transpose(2, 0, 1).astype("<f4").tobytes())
    (folder / "golden-sigma.txt").write_text("".join(f"{level}\n" for level in levels))
    print(
        "golden: error of input",
        np.abs(seen - truth).mean(),
        "of output",
        np.abs(out - truth).mean(),
    )


def main():
    """Writes the weights and, if asked, the golden vector."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("--run", default="first")
    arguments.add_argument("--out", type=pathlib.Path, default=HERE / "weights.bin")
    arguments.add_argument("--golden", type=pathlib.Path)
    chosen = arguments.parse_args()
    run = chosen.data / "runs" / chosen.run
    halves = rounded(run)
    body = b"".join(
        (half.transpose(3, 2, 0, 1) if half.ndim == 4 else half).tobytes() for half in halves
    )
    chosen.out.write_bytes(header(run, halves[0].shape[-1]).encode() + body)
    if chosen.golden:
        golden(chosen.golden, halves, chosen.data)


if __name__ == "__main__":
    main()
