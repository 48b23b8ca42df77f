"""Batches of training patches and the held-out set, the same for the same seed and step."""

import csv
import functools
import pathlib

import net
import noise
import numpy as np
import pages

HERE = pathlib.Path(__file__).parent
INNER = 48  # pixels of a patch that enter the loss
MARGIN = 2 * net.REACH  # pixels that the convolutions take off each side
OUTER = 16  # pixels more for a lens's spread at the patch's border
PAGES = 160
GREY, DRAWN = 0.25, 0.15  # shares of patches
TRAIN, HELD_OUT = "train", "held-out"


@functools.lru_cache
def photographs(data, role):
    """Prepared photographs of a role, in the list's order."""
    with open(HERE / "sources.csv", newline="") as listing:
        names = [row["name"] for row in csv.DictReader(listing) if row["role"] == role]
    return [np.load(data / "photographs" / (name + ".npy"), mmap_mode="r") for name in names]


@functools.lru_cache(PAGES)
def drawn(data, index):
    """A drawn page, uint16 as photographs are, kept beside them."""
    place = data / "pages" / f"{index}.npy"
    if not place.exists():
        place.parent.mkdir(exist_ok=True)
        np.save(place, np.round(pages.page(index) * 65535).astype(np.uint16))
    return np.load(place, mmap_mode="r")


def cut(pictures, random, side):
    """A square of a picture, linear light 0..255, shape (3, side, side)."""
    picture = pictures[random.integers(len(pictures))]
    y, x = (int(random.integers(length - side + 1)) for length in picture.shape[:2])
    square = np.asarray(picture[y : y + side, x : x + side]).astype(np.float32)
    return square.transpose(2, 0, 1) * (255 / 65535)


def varied(square, random):
    """A square turned, of another exposure and white balance, or grey."""
    if random.random() < 0.5:
        square = square.transpose(0, 2, 1)
    square = square[:, :: random.choice([-1, 1]), :: random.choice([-1, 1])]
    if random.random() < GREY:
        square = np.repeat(np.tensordot(random.dirichlet([4, 6, 2]), square, 1)[None], 3, 0)
    elif random.random() < 0.3:
        square = square * np.exp(random.normal(0, 0.15, 3))[:, None, None]
    gain = noise.log_uniform(random, 0.5, 1.6)
    return np.minimum(square * gain, 255).astype(np.float32)


def truth_square(data, random):
    """A square of a photograph, the livelier of two more often than not, or of a page."""
    side = INNER + 2 * (MARGIN + OUTER)
    if random.random() < DRAWN:
        page = drawn(data, int(random.integers(PAGES)))
        return varied(cut([page], random, side), random)
    pictures = photographs(data, TRAIN)
    square = cut(pictures, random, side)
    if random.random() < 0.6:
        other = cut(pictures, random, side)
        square = max(square, other, key=lambda s: np.diff(np.sqrt(s + 1), axis=2).std())
    return varied(square, random)


def to_cells(planes):
    """Mean over 2x2 cells of planes (..., height, width)."""
    return (
        planes[..., ::2, ::2]
        + planes[..., 1::2, ::2]
        + planes[..., ::2, 1::2]
        + planes[..., 1::2, 1::2]
    ) / 4


def channels_last(planes):
    """(batch, height, width, 3) of a list of (3, height, width)."""
    return np.ascontiguousarray(np.stack(planes).transpose(0, 2, 3, 1))


def batch(data, seed, step, size):
    """Truth (inner), seen pictures and stated noise of a training step."""
    random = np.random.default_rng([seed, step])
    truths, seen, stated = [], [], []
    whole, inner = slice(OUTER, -OUTER), slice(OUTER + MARGIN, -OUTER - MARGIN)
    for _ in range(size):
        truth = truth_square(data, random)
        picture, levels = noise.degrade(truth, random)
        truths.append(truth[:, inner, inner])
        seen.append(picture[:, whole, whole])
        stated.append(to_cells(levels[:, whole, whole]))
    return channels_last(truths), channels_last(seen), channels_last(stated)


def held_out(data, level, coloured, crops=2, side=192):
    """Truth, seen pictures and stated noise of held-out photographs at one noise."""
    truths, seen, stated = [], [], []
    for index, picture in enumerate(photographs(data, HELD_OUT)):
        random = np.random.default_rng([4711, index])
        for truth in [cut([picture], random, side) for _ in range(crops)]:
            picture_seen, levels = noise.degrade(truth, random, level, coloured, plain=True)
            truths.append(truth)
            seen.append(picture_seen)
            stated.append(to_cells(levels))
    return channels_last(truths), channels_last(seen), channels_last(stated)
