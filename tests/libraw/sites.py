"""Compares what LibRaw reads of a raw photo with the bytes of its file, and its picture with the scene."""

import struct
import sys

import numpy as np
import rawpy
from PIL import Image

photo, scene = sys.argv[1:]
data = open(photo, "rb").read()


def entries(at):
    """The first directory's tags: type, count, and where the values are."""
    sizes = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 10: 8, 12: 8}
    found = {}
    for n in range(struct.unpack_from("<H", data, at)[0]):
        entry = at + 2 + 12 * n
        tag, kind, count = struct.unpack_from("<HHI", data, entry)
        inside = count * sizes[kind] <= 4
        found[tag] = kind, count, entry + 8 if inside else struct.unpack_from("<I", data, entry + 8)[0]
    return found


def values(tag):
    kind, count, at = tags[tag]
    if kind in (5, 10):
        numbers = struct.unpack_from(f"<{2 * count}{'I' if kind == 5 else 'i'}", data, at)
        return [above / below for above, below in zip(numbers[::2], numbers[1::2])]
    return list(struct.unpack_from(f"<{count}{ {1: 'B', 3: 'H', 4: 'I'}[kind] }", data, at))


assert data[:4] == b"II*\0", "relens writes the smaller byte first"
tags = entries(struct.unpack_from("<I", data, 4)[0])
width, height, offset = (values(tag)[0] for tag in (256, 257, 273))
sites = np.frombuffer(data, "<u2", width * height, offset).reshape(height, width)

with rawpy.imread(photo) as raw:
    decoded = raw.raw_image
    assert decoded.shape == sites.shape, f"{decoded.shape}, wanted {sites.shape}"
    assert (decoded == sites).all(), f"{(decoded != sites).sum()} sites differ"
    assert [raw.color_desc[c : c + 1] for c in raw.raw_pattern[:2, :2].ravel()] == [b"R", b"G", b"G", b"B"]
    assert raw.white_level == values(50717)[0], raw.white_level
    assert all(abs(level - values(50714)[0]) <= 0.5 for level in raw.black_level_per_channel)
    neutral = np.array(values(50728))
    balance = np.array(raw.camera_whitebalance[:3])
    assert np.allclose(balance * neutral / balance[1], 1.0, atol=0.01), (balance, neutral)
    picture = raw.postprocess(use_camera_wb=True, no_auto_bright=True, half_size=True).astype(float)

# The scene is cut to the sensor's shape in its middle, as relens does.
sharp = Image.open(scene).convert("RGB")
shape = min(sharp.width / width, sharp.height / height)
cut = [(whole - shape * side) / 2 for whole, side in ((sharp.width, width), (sharp.height, height))]
box = (cut[0], cut[1], sharp.width - cut[0], sharp.height - cut[1])
sharp = np.asarray(sharp.crop(box).resize((picture.shape[1], picture.shape[0])), float)
likeness = [np.corrcoef(picture[..., c].ravel(), sharp[..., c].ravel())[0, 1] for c in range(3)]
print(f"LibRaw {'.'.join(map(str, rawpy.libraw_version))}: {sites.size} sites alike; "
      f"its picture follows the scene by {', '.join(f'{c:.3f}' for c in likeness)} (correlation)")
assert min(likeness) > 0.9, "no picture of this scene"
