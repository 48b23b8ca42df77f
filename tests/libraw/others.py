"""Writes the sites of a photo that relens took as picamera2 saves its raw photos (PiDNG: one tile, each count packed into its 10
bits, or in 16), and sees that LibRaw reads the same sites of both."""

import sys

import numpy as np
import rawpy
from pidng.camdefs import Picamera2Camera
from pidng.core import PICAM2DNG
from pidng.dng import Tag

photo, *written = sys.argv[1:]
with rawpy.imread(photo) as raw:
    sites = raw.raw_image.copy()
assert sites.max() < 1024, "one exposure of a camera of 10 bits"
height, width = sites.shape
said = {
    "SensorBlackLevels": [64 << 6] * 4,
    "ColourGains": (1.5, 1.4),
    "ColourCorrectionMatrix": (1.5, -0.3, -0.2, -0.2, 1.4, -0.2, 0.0, -0.4, 1.4),
    "ExposureTime": 50000,
    "AnalogueGain": 1.0,
    "DigitalGain": 1.0,
    "SensorTimestamp": 1,
}
for path, bits in zip(written, (10, 16)):
    camera = Picamera2Camera({"size": (width, height), "format": "SRGGB10", "stride": 2 * width}, said)
    camera.tags.set(Tag.BitsPerSample, bits)
    writer = PICAM2DNG(camera)
    writer.options(compress=False)
    open(path, "wb").write(writer.convert(sites))
    with rawpy.imread(path) as raw:
        assert (raw.raw_image == sites).all(), f"LibRaw reads other sites in {bits} bits"
    print(f"PiDNG wrote {sites.size} sites in {bits} bits each; LibRaw reads them")
