"""Colours that tell parts apart."""

from __future__ import annotations

import colorsys

GOLDEN = 0.618
"""Steps of the golden section around the circle of hues keep neighbours apart, however many there are."""
SATURATION, VALUE = 0.55, 0.95


def hue(number: int) -> tuple[int, int, int]:
    """Return the sRGB colour of the item with this number, 0 to 255."""
    red, green, blue = colorsys.hsv_to_rgb(number * GOLDEN % 1.0, SATURATION, VALUE)
    return int(255 * red), int(255 * green), int(255 * blue)
