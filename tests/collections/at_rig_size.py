"""Pictures at a rig's size: at_rig_size.py FROM TO [WIDTH HEIGHT]

Needs Pillow. Each whole picture in FROM comes into TO at 256×192, of every third one its middle and
the others resampled, saved as it was: format, quantisation, profile, EXIF, dots per inch.
"""

import pathlib
import sys
import warnings

from PIL import Image, ImageOps, JpegImagePlugin

folder, out = map(pathlib.Path, sys.argv[1:3])
size = tuple(map(int, sys.argv[3:5])) or (256, 192)
warnings.simplefilter("ignore")
ENDINGS = {"JPEG": ".jpg", "PNG": ".png", "TIFF": ".tif", "WEBP": ".webp", "BMP": ".bmp", "GIF": ".gif",
           "PPM": ".ppm"}
# Description, camera, program, date, artist, copyright, XMP, IPTC, image resources, EXIF.
TIFF_FIELDS = {270, 271, 272, 305, 306, 315, 33432, 700, 33723, 34377, 34665}


def convert(path, is_cut):
    """Writes the picture `path` at the size, its middle if `is_cut`."""
    with Image.open(path) as whole:
        whole.load()
        format = {"MPO": "JPEG"}.get(whole.format, whole.format)
        kept = {key: whole.info[key] for key in ("icc_profile", "exif", "dpi", "xmp", "transparency")
                if whole.info.get(key)}
        if format == "JPEG":
            kept |= {"qtables": whole.quantization, "progressive": "progressive" in whole.info,
                     "subsampling": max(JpegImagePlugin.get_sampling(whole), 0)}
        if format == "TIFF":
            fields = {tag: value for tag, value in whole.tag_v2.items() if tag in TIFF_FIELDS}
            kept = {"icc_profile": kept.get("icc_profile"), "tiffinfo": fields,
                    "compression": whole.info.get("compression", "raw")}
        if is_cut and whole.width >= size[0] and whole.height >= size[1]:
            x, y = (whole.width - size[0]) // 2, (whole.height - size[1]) // 2
            made = whole.crop((x, y, x + size[0], y + size[1]))
        else:
            has_palette = whole.mode in ("1", "P", "PA")
            kernel = Image.Resampling.NEAREST if has_palette else Image.Resampling.LANCZOS
            made = ImageOps.fit(whole, size, kernel)
        # The old ending stays in the name, because two files may differ only in it.
        made.save(out / (path.name + ENDINGS[format]), format, **kept)


out.mkdir(exist_ok=True)
for n, path in enumerate(sorted(path for path in folder.rglob("*") if path.is_file())):
    try:
        convert(path, n % 3 == 2)
    except Exception as error:
        print(f"{path.name}: {error}", file=sys.stderr)
