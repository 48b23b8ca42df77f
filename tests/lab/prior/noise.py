"""Inputs of training: pictures after the regularised inverse of a lens, with noise of many kinds.

Pictures and noise are in grey levels of linear light, 0..255.
"""

import numpy as np
import scipy.fft
from scipy.ndimage import uniform_filter
from scipy.special import j1

WIDTHS = (0.7, 4.0)  # pixels, RMS of a lens's spread along an axis
REGULARISERS = (0.003, 0.3)
LEVELS = (0.3, 15.0)  # grey levels, RMS of noise a pixel


def log_uniform(random, low, high):
    """A number whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def lens(random, side):
    """Transfer of a lens, three colours, for the real transform of side x side pixels."""
    fy, fx = np.meshgrid(scipy.fft.fftfreq(side), scipy.fft.rfftfreq(side), indexing="ij")
    angle, stretch = random.uniform(0, np.pi), np.sqrt(log_uniform(random, 0.6, 1.6))
    along = (fx * np.cos(angle) + fy * np.sin(angle)) * stretch
    across = (fy * np.cos(angle) - fx * np.sin(angle)) / stretch
    frequency = np.hypot(along, across).astype(np.float32)
    width, disc_width = log_uniform(random, *WIDTHS), log_uniform(random, *WIDTHS)
    share = random.choice([0.0, 1.0, random.uniform()])
    transfers = []
    for _ in range(3):
        scale = random.uniform(0.9, 1.1)
        gaussian = np.exp(-2 * (np.pi * frequency * width * scale) ** 2)
        x = (2 * np.pi * frequency * 2 * disc_width * scale + 1e-4).astype(np.float32)
        transfers.append(share * gaussian + (1 - share) * 2 * j1(x) / x)
    return np.stack(transfers).astype(np.float32)


def transform(planes):
    """Real transform over the last two axes."""
    return scipy.fft.rfft2(planes.astype(np.float32))


def inverse(spectrum, side):
    """Planes of a real transform."""
    return scipy.fft.irfft2(spectrum, (side, side)).astype(np.float32)


def unit(noise):
    """Noise of RMS one, channel by channel."""
    return noise / np.sqrt((noise**2).mean((-2, -1), keepdims=True) + 1e-12)


def channel_levels(random, total):
    """Noise of each channel whose mean square is that of `total`."""
    ratios = np.ones(3)
    if random.random() < 0.5:
        ratios = np.exp(random.normal(0, 0.25, 3))
    if random.random() < 0.2:  # red and blue noisier, as in sensors
        ratios *= np.array([random.uniform(1, 2.5), 1, random.uniform(1, 2.5)])
    return (total * ratios / np.sqrt((ratios**2).mean())).astype(np.float32)


def narrow(noise, random):
    """Noise of lower bandwidth in red and blue, as interpolated sites have it."""
    side = noise.shape[-1]
    fy, fx = scipy.fft.fftfreq(side)[:, None], scipy.fft.rfftfreq(side)[None]
    square = fx**2 + fy**2
    wide, slim = random.uniform(0, 0.4), random.uniform(0.5, 1.1)
    spread = np.array([slim, wide, slim])[:, None, None]
    return unit(inverse(transform(noise) * np.exp(-2 * np.pi**2 * spread**2 * square), side))


def degrade(truth, random, total=None, coloured=None, plain=False):
    """Picture as the net sees it, and the noise stated to it.

    `truth` has shape (3, side, side). Given `total`, `coloured` and `plain`, the noise is of that
    level and kind and nothing else is changed. The noise comes for pixels: shape of `truth`.
    """
    side = truth.shape[-1]
    total = log_uniform(random, *LEVELS) if total is None else total
    coloured = random.random() < 0.5 if coloured is None else coloured
    levels = channel_levels(random, total) if not plain else np.full(3, total, np.float32)
    noise, base = random.standard_normal(truth.shape, np.float32), truth
    if coloured:
        transfer, regulariser = lens(random, side), log_uniform(random, *REGULARISERS)
        power = transfer**2
        if not plain and random.random() < 0.5:
            base = inverse(transform(truth) * power / (power + regulariser), side)
            shape = np.abs(transfer) / (power + regulariser)
        else:
            shape = 1 / np.sqrt(power + regulariser)
        noise = inverse(transform(noise) * shape, side)
    noise = unit(noise)
    if not plain and random.random() < 0.15:
        noise = narrow(noise, random)
    stated = np.broadcast_to(levels[:, None, None], truth.shape)
    if not plain and random.random() < 0.35:
        light = uniform_filter(np.maximum(truth, 0), (0, 5, 5))
        share = random.uniform(0.3, 1)  # of the variance that follows light
        mean = light.mean((1, 2), keepdims=True) + 1
        stated = stated * np.sqrt(1 - share + share * light / mean)
    seen = base + noise * stated
    if not plain and random.random() < 0.25:
        stated = stated * log_uniform(random, 0.7, 1.4)
    return seen.astype(np.float32), np.maximum(stated, 0.05).astype(np.float32)
