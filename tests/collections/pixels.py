"""Photos as relens's worker decodes them beside Pillow's: pixels.py RELENS FOLDER

Needs Pillow and numpy. RELENS is the program. Each whole picture of FOLDER without a profile is
decoded on a grid of its own size; those that differ in more than a hundredth of their pixels by
more than 8 of 255 codes are listed. Transparent pixels have no colour and may differ.
"""

import collections
import concurrent.futures
import json
import os
import pathlib
import struct
import subprocess
import sys
import warnings

import numpy as np
from PIL import Image

relens, folder = sys.argv[1:]
warnings.simplefilter("ignore")
FORMATS = {"JPEG", "MPO", "PNG", "TIFF", "BMP", "GIF", "WEBP", "PPM"}


def picture(path):
    """Codes of the file `path` by Pillow, grey or RGB; `None` for what is not compared."""
    with Image.open(path) as opened:
        if opened.format not in FORMATS or opened.info.get("icc_profile"):
            return None
        if opened.info.get("gamma") or opened.width * opened.height > 2_000_000:
            return None
        if opened.mode.startswith("I"):
            return np.asarray(opened, float)[..., None] / 257
        codes = np.asarray(opened.convert("RGBA"), float)[..., :3]
    is_grey = (codes == codes[..., :1]).all()
    return codes[..., :1] if is_grey else codes


def worker(path, width, height):
    """Codes of the file `path` by relens, or the sentence of its refusal."""
    size = {"width": width, "height": height}
    grid = {"sensor": size, "photo": {"x": 0, "y": 0, "size": size}}
    limits = {"bytes_max": 1 << 28, "pixels_max": 32_000_000, "decoder_bytes_max": 1 << 29}
    ask = {"name": path.name, "limits": limits | {"grid": grid}, "purpose": {"Photo": ["srgb", grid]},
           "memory_bytes_max": 1536 << 20, "processor_s_max": 60}
    with path.open("rb") as file:
        answer = subprocess.run([relens, "read-photo", json.dumps(ask)], stdin=file, check=False,
                                stdout=subprocess.PIPE, env={"RAYON_NUM_THREADS": "1"}).stdout
    length = struct.unpack("<I", answer[:4])[0] if len(answer) > 4 else 0
    if length == 0 or answer[4] != 1:
        return answer[6:4 + length].decode("utf-8", "replace") or "no answer"
    planes = np.frombuffer(answer[4 + length:][:4 * (len(answer[4 + length:]) // 4)], "<f4")
    light = planes[:min(3, len(planes) // (width * height)) * width * height] / 255
    light = np.clip(light.reshape(-1, height, width), 0, 1)
    # IEC 61966-2-1.
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def compare(path):
    """The outcome of `path`, and words on a difference."""
    try:
        codes = picture(path)
    except Exception:
        return "not whole", ""
    if codes is None:
        return "not compared", ""
    height, width, channels = codes.shape
    ours = worker(path, width, height)
    if isinstance(ours, str):
        return "refused", ""
    ours = np.moveaxis(ours[:channels], 0, -1)
    apart = np.abs(ours - codes[..., :ours.shape[2]]).max(-1)
    share = (apart > 8).mean()
    words = f"{path.name}: {100 * share:.0f} % of the pixels differ, {apart.mean():.1f} codes"
    return ("equal", "") if share < 0.01 else ("differ", words)


paths = sorted(path for path in pathlib.Path(folder).rglob("*") if path.is_file())
with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
    outcomes = list(pool.map(compare, paths))
for words in filter(None, (words for _, words in outcomes)):
    print(words)
print(*(f"{count} {outcome}" for outcome, count in
        collections.Counter(outcome for outcome, _ in outcomes).most_common()), sep=", ")
