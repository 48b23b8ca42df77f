"""Train the net: one command, fixed seed, checkpoints that survive a stop.

    python train.py DATA --width 32 --patches 200000 --run NAME

State is kept in DATA/runs/NAME; the same command goes on from the last checkpoint. At the end
`weights.npz` is there and `log.txt` names the held-out PSNR of display values.
"""

import argparse
import hashlib
import os
import pathlib
import time

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "2")
os.environ.setdefault("OMP_NUM_THREADS", "1")
import net
import numpy as np
import patches
import tensorflow as tf

SEED = 20
BATCH = 16
RATE = 2e-3
SAVE_EVERY = 250  # steps
MEASURE_EVERY = 2500  # steps


def display(linear):
    """sRGB display values 0..255 of linear light 0..255."""
    x = np.clip(np.asarray(linear) / 255, 0, 1)
    return 255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def psnr(a, b):
    """Mean over pictures of the PSNR of display values, dB."""
    error = ((display(a) - display(b)) ** 2).mean((1, 2, 3))
    return float((10 * np.log10(255**2 / np.maximum(error, 1e-3))).mean())


def loss_of(weights, truth, seen, stated):
    """Charbonnier loss of errors in display values, in parts of the error seen, bounded."""
    out = net.denoise(weights, seen, stated)
    light = tf.nn.avg_pool2d(tf.reduce_mean(truth, -1, keepdims=True), 5, 1, "SAME")
    slope = (0.1 + light / 255) ** -0.55
    before = (net.crop(seen, 2 * net.REACH) - truth) * slope
    level = tf.sqrt(tf.reduce_mean(before**2, (1, 2, 3), keepdims=True) + 0.04)
    error = (out - truth) * slope * level**-0.7
    colour = tf.einsum("bijc,kc->bijk", error, net.OPPONENT[1:])
    bound = 0.15
    root = lambda x: tf.sqrt(x * x + bound * bound) - bound
    return tf.reduce_mean(root(error)) + 0.4 * tf.reduce_mean(root(colour))


def measure(data, weights):
    """Held-out PSNR at noise 2, 5, 10, white and coloured."""
    found = []
    for coloured in (False, True):
        for level in (2.0, 5.0, 10.0):
            truth, seen, stated = patches.held_out(data, level, coloured, crops=1, side=128)
            found.append(psnr(net.denoise_whole(weights, seen, stated), truth))
    return found


def main():
    """Trains, saves, measures."""
    arguments = argparse.ArgumentParser()
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("--width", type=int, default=32)
    arguments.add_argument("--patches", type=int, default=200_000)
    arguments.add_argument("--run", default="first")
    arguments.add_argument("--start", type=pathlib.Path, help="weights.npz to begin with")
    arguments.add_argument("--rate", type=float, default=RATE)
    arguments.add_argument("--seed", type=int, default=SEED)
    chosen = arguments.parse_args()
    tf.config.threading.set_intra_op_parallelism_threads(1)
    tf.config.threading.set_inter_op_parallelism_threads(1)
    place = chosen.data / "runs" / chosen.run
    place.mkdir(parents=True, exist_ok=True)
    steps = chosen.patches // BATCH
    listed = hashlib.sha256((patches.HERE / "sources.csv").read_bytes()).hexdigest()
    made = (
        f"{chosen.patches} patches, rate {chosen.rate}, seed {chosen.seed}, sources.csv {listed}"
    )
    before = (chosen.start.parent / "made.txt").read_text() if chosen.start else ""
    (place / "made.txt").write_text(before + made + "\n")
    weights = net.new_weights(chosen.width, chosen.seed)
    if chosen.start:
        with np.load(chosen.start) as saved:
            for variable, name in zip(weights, saved.files):
                variable.assign(saved[name])
    first, second = ([tf.Variable(tf.zeros_like(w)) for w in weights] for _ in range(2))
    done = tf.Variable(0, dtype=tf.int64)
    keeper = tf.train.Checkpoint(weights=weights, first=first, second=second, done=done)
    manager = tf.train.CheckpointManager(keeper, str(place / "state"), max_to_keep=2)
    keeper.restore(manager.latest_checkpoint)

    @tf.function(jit_compile=True)
    def learn(truth, seen, stated, rate, step):
        with tf.GradientTape() as tape:
            loss = loss_of(weights, truth, seen, stated)
        slopes, _ = tf.clip_by_global_norm(tape.gradient(loss, weights), 1.0)
        rate *= tf.sqrt(1 - 0.999**step) / (1 - 0.9**step)  # Adam
        for weight, m, v, slope in zip(weights, first, second, slopes):
            m.assign_add(0.1 * (slope - m))
            v.assign_add(0.001 * (slope * slope - v))
            weight.assign_sub(rate * m / (tf.sqrt(v) + 1e-8))
        return loss

    mean, began = None, time.process_time()
    for step in range(int(done.numpy()), steps):
        warm = min(1, (step + 1) / 200)
        rate = chosen.rate * warm * 0.5 * (1 + np.cos(np.pi * step / steps))
        examples = patches.batch(chosen.data, chosen.seed, step, BATCH)
        loss = float(learn(*examples, tf.constant(rate, tf.float32), tf.constant(step + 1.0)))
        mean = loss if mean is None else 0.995 * mean + 0.005 * loss
        done.assign(step + 1)
        if (step + 1) % SAVE_EVERY == 0 or step + 1 == steps:
            manager.save()
            np.savez(place / "weights.npz", *[w.numpy() for w in weights])
        if (step + 1) % MEASURE_EVERY == 0 or step + 1 == steps or step + 1 in (250, 1000):
            found = " ".join(f"{value:.2f}" for value in measure(chosen.data, weights))
            seconds = time.process_time() - began
            count = (step + 1) * BATCH
            line = f"{count} patches, loss {mean:.4f}, held out {found}, {seconds:.0f} s"
            print(line, flush=True)
            with open(place / "log.txt", "a") as log:
                log.write(line + "\n")


if __name__ == "__main__":
    main()
