"""A contact sheet: images in rows with their names below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

COLORS = 255
"""Of the palette, which halves the file."""


def write(tiles: Sequence[tuple[str, np.ndarray]], out: Path, columns: int, caption: int) -> str:
    """Write images of one size with their names, and return the file's name and size in words.

    Args:
        tiles: name and image of each, shape [height width 3].
        out: PNG file; its folder is created.
        columns: images in a row, if there are so many.
        caption: height of the line with the name [pixel].
    """
    height, width = tiles[0][1].shape[:2]
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    sheet = Image.new("RGB", (columns * width, rows * (height + caption)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(0.7 * caption)
    for i, (name, image) in enumerate(tiles):
        x, y = i % columns * width, i // columns * (height + caption)
        sheet.paste(Image.fromarray(image), (x, y))
        draw.text((x + width / 2, y + height + caption / 2), name, "black", font, anchor="mm")
    out.parent.mkdir(parents=True, exist_ok=True)
    sheet.quantize(COLORS).save(out, optimize=True)
    return f"{out}: {out.stat().st_size / 1000:.0f} kB"
