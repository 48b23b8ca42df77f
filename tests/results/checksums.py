"""Checksums of the pictures that a relens binary delivers, to compare two builds.

    python3 tests/results/checksums.py target/release/relens --out DIR > new.txt
    python3 tests/results/checksums.py /path/to/other/relens --out DIR > old.txt; diff old.txt new.txt

Photos of small.toml and truthful.toml are made once in DIR/photos (PNG, raw, JPEG of two qualities,
another distance, strong noise, another lens, no lens), by the first binary; then each binary restores
them with `run --once`, and the pixels of its results are hashed. Needs numpy, Pillow, scipy and
tifffile.
"""

import argparse
import hashlib
import pathlib
import re
import shutil
import subprocess
import tempfile

import numpy as np
import tifffile
from PIL import Image
from scipy.ndimage import uniform_filter

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCENES = ROOT / "tests" / "scenes"
RIGS = ["small", "truthful"]
# Distance of a scene farther away than the panel, which is at 4 m.
FAR_MM = 4600.0


def call(relens, *words):
    subprocess.run([relens, *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def far_rig(rig, folder):
    """The rig file with its scene at another distance than the panel."""
    text = (ROOT / "rig-config" / f"{rig}.toml").read_text()
    text = re.sub(r"(?m)^(scene|focus)-distance-mm = .*\n", "", text)
    distances = f"focus-distance-mm = 4000.0\nscene-distance-mm = {FAR_MM}\n"
    text = re.sub(r"(?m)^(object-distance-mm = .*\n)", rf"\g<1>{distances}", text)
    path = folder / f"{rig}-far.toml"
    path.write_text(text)
    return path


def make_photos(relens, rig, folder):
    folder.mkdir(parents=True)
    work = pathlib.Path(tempfile.mkdtemp())
    far = far_rig(rig, work)
    taken = {"astronaut": "astronaut.png", "coffee": "coffee.png"}
    for name, scene in taken.items():
        call(relens, "photograph", "-q", "-r", f"{rig}.toml", SCENES / scene, "-o", folder / f"{name}.png")
    call(relens, "photograph", "-q", "-r", far, SCENES / "rocket.jpg", "-o", folder / "distance.png")
    if rig == "truthful":
        for name, file, scene in [("raw", f"{rig}.toml", "coffee.png"), ("distance-raw", far, "rocket.jpg")]:
            out = folder / f"{name}.dng"
            call(relens, "shoot", "-q", "-r", file, "-f", work / name, "--scene", SCENES / scene, "-o", out)
    astronaut = Image.open(folder / "astronaut.png").convert("RGB")
    astronaut.save(folder / "jpeg-95.jpg", quality=95, subsampling=0)
    astronaut.save(folder / "jpeg-70.jpg", quality=70)
    coffee = np.asarray(Image.open(folder / "coffee.png").convert("RGB")).astype(float)
    noise = np.random.default_rng(7).normal(0.0, 8.0, coffee.shape)
    Image.fromarray(np.clip(coffee + noise, 0, 255).astype(np.uint8)).save(folder / "noisy.png")
    width, height = astronaut.size
    sharp = Image.open(SCENES / "astronaut.png").convert("RGB").resize((width, width))
    sharp = sharp.crop((0, (width - height) // 2, width, (width + height) // 2))
    sharp.save(folder / "sharp.png")
    foreign = uniform_filter(np.asarray(sharp).astype(float), (7, 1, 1))
    Image.fromarray(foreign.astype(np.uint8)).save(folder / "foreign.png")


def pixels(path):
    return tifffile.imread(path) if path.suffix.startswith(".tif") else np.asarray(Image.open(path))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("relens", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    options = parser.parse_args()
    relens = options.relens.resolve()
    for rig in RIGS:
        photos = options.out / "photos" / rig
        if not photos.exists():
            make_photos(relens, rig, photos)
        work = pathlib.Path(tempfile.mkdtemp(dir=options.out))
        shutil.copytree(photos, work / "inbox")
        call(relens, "run", "-q", "-r", f"{rig}.toml", "-f", work, "--once")
        for path in sorted((work / "outbox").iterdir()):
            if path.suffix in (".png", ".jpg", ".tif"):
                picture = pixels(path)
                digest = hashlib.sha256(picture.tobytes()).hexdigest()[:16]
                print(rig, path.name, picture.shape, picture.dtype, digest)
        shutil.rmtree(work)


if __name__ == "__main__":
    main()
