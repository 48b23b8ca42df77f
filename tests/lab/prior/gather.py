"""Gather the training photographs named in `sources.csv`.

    python gather.py DATA

Clones the named public repositories and downloads the named Debian packages into
DATA/downloads, then writes each photograph to DATA/photographs/NAME.npy: linear light, uint16 of
0..65535 for 0..1, shape (height, width, 3), shrunk by area averaging in linear light by two or
more so that noise and the coding's traces vanish. What is there already is kept.
"""

import csv
import io
import pathlib
import subprocess
import sys

import numpy as np
from PIL import Image, ImageOps

Image.MAX_IMAGE_PIXELS = None
HERE = pathlib.Path(__file__).parent
LONGEST = 1400  # pixels of a prepared photograph's longer side, at most
SMALLEST_SHRINK = 2


def linear_of_srgb(values):
    """Linear light 0..1 of sRGB display values 0..1."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def shrink(picture, factor):
    """Area average over cells of `factor` by `factor` pixels; a remainder at the border is cut."""
    height, width = (side // factor for side in picture.shape[:2])
    cut = picture[: height * factor, : width * factor]
    return cut.reshape(height, factor, width, factor, 3).mean((1, 3))


def prepare(data):
    """Prepared photograph (uint16 linear light) of an encoded picture's bytes."""
    image = ImageOps.exif_transpose(Image.open(io.BytesIO(data))).convert("RGB")
    table = linear_of_srgb(np.arange(256) / 255.0).astype(np.float32)
    picture = table[np.asarray(image)]
    factor = max(SMALLEST_SHRINK, -(-max(picture.shape[:2]) // LONGEST))
    return np.round(shrink(picture, factor) * 65535).astype(np.uint16)


def run(*command, where=None):
    """Output of a command; an error ends the program."""
    return subprocess.run(command, cwd=where, check=True, stdout=subprocess.PIPE).stdout


def of_repository(downloads, row):
    """A file's bytes from a git repository at a revision; cloned on first use."""
    place = downloads / row["source"].removeprefix("https://github.com/").replace("/", "+")
    if not place.exists():
        run("git", "clone", "--quiet", "--bare", row["source"], str(place))
    return run("git", "show", f"{row['revision']}:{row['path']}", where=place)


def of_package(downloads, row):
    """A file's bytes from a Debian package; downloaded and unpacked on first use."""
    place = downloads / row["source"]
    if not place.exists():
        run("apt-get", "download", row["source"], where=downloads)
        package = next(downloads.glob(row["source"] + "_*.deb"))
        run("dpkg", "-x", str(package), str(place))
    return (place / row["path"]).read_bytes()


def main(data):
    """Gathers every photograph of the list that is not there yet."""
    downloads, prepared = data / "downloads", data / "photographs"
    downloads.mkdir(parents=True, exist_ok=True)
    prepared.mkdir(exist_ok=True)
    with open(HERE / "sources.csv", newline="") as listing:
        rows = list(csv.DictReader(listing))
    for row in rows:
        target = prepared / (row["name"] + ".npy")
        if target.exists():
            continue
        fetch = of_repository if row["kind"] == "git" else of_package
        np.save(target, prepare(fetch(downloads, row)))
        print(row["name"], flush=True)
    print(len(rows), "photographs")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
