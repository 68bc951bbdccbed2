"""Textures of a mesh file -> arrays; a missing or damaged one is a warning."""

from __future__ import annotations

import io
import logging
from pathlib import Path

import numpy as np

_log = logging.getLogger(__name__)


def read_image(mesh: Path, image: Path) -> np.ndarray | None:
    """Return an image file of a mesh, RGB, shape [row column 3], uint8; None, and a warning, if it cannot be read."""
    if not image.is_file():
        _log.warning("%s: the texture %s is missing; its faces become grey", mesh, image.name)
        return None
    return decode(mesh, image.name, image.read_bytes())


def decode(mesh: Path, name: str, data: bytes) -> np.ndarray | None:
    """Return the image that bytes hold, RGB, shape [row column 3], uint8; None, and a warning, if they are damaged."""
    from PIL import Image  # of the extra sim; files without textures do without

    try:
        with Image.open(io.BytesIO(data)) as opened:
            return np.asarray(opened.convert("RGB"))
    except (OSError, SyntaxError, ValueError) as error:
        _log.warning("%s: the texture %s cannot be read (%s); its faces become grey", mesh, name, error)
        return None
