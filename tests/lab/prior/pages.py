"""Pages of text and line drawings, drawn from fonts: black on white, grey on grey, coloured."""

import functools
import pathlib
import string

import numpy as np
from PIL import Image, ImageDraw, ImageFont

SIDE = 512  # pixels of a finished page
OVER = 3  # factor by which pages are drawn larger, then averaged in linear light
FAMILIES = ("dejavu", "liberation")


@functools.lru_cache
def fonts():
    """Font files of the system, sorted."""
    found = sorted(
        f for f in pathlib.Path("/usr/share/fonts").rglob("*.ttf") if f.parent.name in FAMILIES
    )
    if not found:
        raise SystemExit("no fonts under /usr/share/fonts: install fonts-dejavu")
    return found


def word(random):
    """A word of one to nine letters or digits."""
    kind = random.random()
    letters = (
        string.digits
        if kind < 0.15
        else string.ascii_letters[:26]
        if kind < 0.8
        else string.ascii_letters
    )
    return "".join(random.choice(list(letters), random.integers(1, 10)))


def draw_text(draw, random, ink):
    """Lines of text over a column of the page."""
    size = int(np.exp(random.uniform(np.log(8), np.log(48)))) * OVER
    font = ImageFont.truetype(str(random.choice(fonts())), size)
    y = 0
    while y < SIDE * OVER:
        line = " ".join(word(random) for _ in range(2 + 90 * OVER // size * 8))
        draw.text((random.integers(-20, 20), y), line, fill=ink, font=font)
        y += int(size * random.uniform(1.1, 1.5))


def draw_lines(draw, random, ink):
    """Straight lines, boxes, ellipses, hatching and spokes."""
    whole = SIDE * OVER
    for _ in range(random.integers(10, 60)):
        width = int(random.integers(1, 5 * OVER))
        x0, y0, x1, y1 = (int(v) for v in random.integers(0, whole, 4))
        box = [min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)]
        shape = random.integers(5)
        if shape == 0:
            draw.line([x0, y0, x1, y1], fill=ink, width=width)
        elif shape == 1:
            draw.rectangle(box, outline=ink, width=width)
        elif shape == 2:
            draw.ellipse(
                box, outline=ink, width=width, fill=ink if random.random() < 0.15 else None
            )
        elif shape == 3:
            step = int(random.integers(3, 14)) * OVER
            reach = int(random.integers(5, 25)) * step
            for offset in range(0, reach, step):
                draw.line([x0 + offset, y0, x0 + offset, y0 + reach], fill=ink, width=step // 2)
        else:
            radius = int(random.integers(20, 150)) * OVER
            for angle in np.arange(0, np.pi, np.pi / random.integers(6, 30)):
                dx, dy = int(radius * np.cos(angle)), int(radius * np.sin(angle))
                draw.line([x0 - dx, y0 - dy, x0 + dx, y0 + dy], fill=ink, width=width)


def page(seed):
    """A page, linear light 0..1, shape (SIDE, SIDE, 3)."""
    random = np.random.default_rng([seed, 77])
    image = Image.new("L", (SIDE * OVER, SIDE * OVER), 0)
    draw = ImageDraw.Draw(image)
    draw_text(draw, random, 255) if random.random() < 0.6 else draw_lines(draw, random, 255)
    covered = np.asarray(image, np.float32).reshape(SIDE, OVER, SIDE, OVER).mean((1, 3)) / 255
    kind = random.random()
    if kind < 0.5:  # black on white, or nearly
        paper, ink = np.full(3, random.uniform(0.6, 1)), np.full(3, random.uniform(0, 0.05))
    elif kind < 0.7:  # grey on grey
        paper, ink = np.full(3, random.uniform(0.02, 1)), np.full(3, random.uniform(0.02, 1))
    else:
        paper, ink = random.uniform(0, 1, 3) ** 2, random.uniform(0, 1, 3) ** 2
    if random.random() < 0.25:
        paper, ink = ink, paper
    return (paper + (ink - paper) * covered[..., None]).astype(np.float32)
