"""Time and memory of refusals, and of an inbox full of companions and junk: pace.py RELENS [FILES]

Needs Pillow. RELENS is the program. Processor time is given beside time, for machines that are not
idle.
"""

import json
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile
import time

relens = str(pathlib.Path(sys.argv[1]).resolve())
files = int(sys.argv[2]) if len(sys.argv) > 2 else 10_000
noise = random.Random(1)


def write_picture(path, size, **options):
    """Writes grain enlarged to `size`, as hard to decode as a photo, by a process of its own: the
    memory of this one is counted for those it starts.
    """
    child = os.fork()
    if child == 0:
        from PIL import Image

        grain = Image.frombytes("RGB", (400, 300), noise.randbytes(400 * 300 * 3))
        grain.resize(size, Image.Resampling.BICUBIC).save(path, **options)
        os._exit(0)
    os.waitpid(child, 0)


def refusal(path):
    """Milliseconds, those of the processor, MB, and the first words of the answer of a worker that
    refuses the file `path`.
    """
    size = {"width": 256, "height": 192}
    grid = {"sensor": size, "photo": {"x": 0, "y": 0, "size": size}}
    limits = {"bytes_max": 1 << 28, "pixels_max": 32_000_000, "decoder_bytes_max": 1 << 29}
    ask = {"name": path.name, "limits": limits, "purpose": {"Photo": ["srgb", grid]},
           "memory_bytes_max": 1536 << 20, "processor_s_max": 60}
    begun = time.monotonic()
    with path.open("rb") as file:
        worker = subprocess.Popen([relens, "read-photo", json.dumps(ask)], stdin=file,
                                  stdout=subprocess.PIPE, env={"RAYON_NUM_THREADS": "1"})
        answer = worker.stdout.read()
        _, status, usage = os.wait4(worker.pid, 0)
    took = 1000 * (time.monotonic() - begun)
    worker.returncode = status
    # After the length come the answer's kind and then a text.
    processor = 1000 * (usage.ru_utime + usage.ru_stime)
    return took, processor, usage.ru_maxrss / 1024, answer[4:].decode("utf-8", "replace")[2:70]


COMPANIONS = [("{}.AAE", b"<?xml"), ("{}.MOV", b"\0\0\0\x14ftypqt  " + bytes(500)), ("{}.json", b"{}"),
              ("{}.xmp", b"<x:xmpmeta>"), ("{}.THM", b"\xff\xd8\xff\xe0"), ("{}.db", b"SQLite format 3\0"),
              ("._{}.jpg", b"\0\5\x16\7"), ("{}.MP", b"\0\0\0\x18ftypmp42" + bytes(500))]
JUNK = [("{}.txt", b"Dear Sir or Madam,\n"), ("{}.pdf", b"%PDF-1.7"), ("{}.jpg", b"<html>404</html>"),
        ("{}.heic", b"\0\0\0\x18ftypheic" + bytes(500))]

with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    write_picture(folder / "24 MP, another shape.jpg", (6000, 4001), quality=90)
    write_picture(folder / "24 MP, another shape.png", (6000, 4001), compress_level=1)
    write_picture(folder / "8 MP, another shape.tif", (3400, 2401))
    write_picture(folder / "24 MP, another shape.bmp", (6000, 4001))
    write_picture(folder / "24 MP, another shape.ppm", (6000, 4001))
    write_picture(folder / "24 MP, another shape, LZW.tif", (6000, 4001), compression="tiff_lzw")
    with (folder / "200 MB.zip").open("wb") as file:
        file.write(b"PK\3\4")
        file.truncate(200_000_000)
    (folder / "telephone.heic").write_bytes(b"\0\0\0\x18ftypheic" + bytes(4_000_000))
    (folder / "text.jpg").write_bytes(b"Dear Sir or Madam,\n")
    print("refused", "ms", "of the processor", "MB", "answer", sep="\t")
    for path in sorted(folder.iterdir()):
        *numbers, words = min(refusal(path) for _ in range(5))
        size = f"{path.name} ({path.stat().st_size / 1e6:.1f} MB)"
        print(size, *(f"{number:.0f}" for number in numbers), words, sep="\t")
        path.unlink()
    box = folder / "box"
    subprocess.run([relens, "calibrate", "--rig", "small.toml", "--folder", box], check=True,
                   stderr=subprocess.DEVNULL)
    (box / "inbox").mkdir(exist_ok=True)
    for n in range(files):
        kinds = JUNK if n % 4 == 0 else COMPANIONS
        name, data = kinds[noise.randrange(len(kinds))]
        path = box / "inbox" / str(n // 500) / name.format(n)
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        os.utime(path, (946_684_800, 946_684_800))
    begun, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([relens, "run", "--rig", "small.toml", "--folder", box, "--once"],
                   stderr=subprocess.DEVNULL, check=False)
    took, after = time.monotonic() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{files} files, a quarter junk: {took:.1f} s, {processor:.1f} s of the processor")
