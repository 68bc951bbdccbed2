"""Linear light and sRGB levels: the one place where colours change between files and meshes.

A `Mesh` holds what a screen shows: sRGB (IEC 61966-2-1) in 8 bits. USD's `displayColor` and `diffuseColor`, glTF's `COLOR_0` and
`baseColorFactor` hold linear light; images, PLY and OBJ hold levels as shown.
"""

import numpy as np


def to_linear(levels: np.ndarray) -> np.ndarray:
    """Return the linear light, 0 to 1, float32, of sRGB levels: bytes 0 to 255, or floats 0 to 1; any shape."""
    levels = np.asarray(levels)
    if levels.dtype == np.uint8:
        return _TABLE[levels]
    values = np.clip(levels.astype(np.float64), 0.0, 1.0)
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).astype(np.float32)


def to_srgb(light: np.ndarray) -> np.ndarray:
    """Return the sRGB levels, 0 to 1, float32, of linear light, any shape; what is beyond 0 to 1 is clipped, NaN stays."""
    values = np.clip(np.asarray(light, dtype=np.float64), 0.0, 1.0)
    return np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055).astype(np.float32)


def fractions(values: np.ndarray) -> np.ndarray:
    """Return colours that a file of text or floats states, as fractions of the brightest, any shape, NaN stays.

    Numbers up to 1 are fractions, those of which one is above 2 are levels of 255. Between them lie fractions that a program has
    rounded or blended to a little more than 1; they are clipped.
    """
    values = np.asarray(values, dtype=np.float64)
    largest = np.nanmax(values, initial=0.0)
    return (
        values / 255
        if largest > _ROUNDED or (largest > 1 and (np.nan_to_num(values) % 1 == 0).all())
        else values.clip(0, 1)
    )


def to_bytes(light: np.ndarray) -> np.ndarray:
    """Return the sRGB levels, 0 to 255, uint8, of linear light, any shape; `to_bytes(to_linear(x))` is x for every byte."""
    return np.round(np.nan_to_num(to_srgb(light)) * 255.0).astype(np.uint8)


_ROUNDED = 2.0
_TABLE = to_linear(np.arange(256) / 255.0)  # Linear light of each byte
