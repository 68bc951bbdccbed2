"""Files that a mesh file names, and its textures -> arrays; a missing or damaged texture is a warning."""

from __future__ import annotations

import io
import logging
from pathlib import Path
from urllib.parse import unquote

import numpy as np

_log = logging.getLogger(__name__)


def beside(folder: Path, name: str) -> Path | None:
    """Return the file that a name in another file means, or None if there is none.

    Tried are the name as it is, without quotes, with slashes for backslashes, without percent signs' escapes, as the bare name
    of a path of the machine that wrote it, and each in another case.
    """
    plain = name.strip().strip('"').strip("'")
    slashed = plain.replace("\\", "/")
    names = [
        name.strip(),
        plain,
        slashed,
        unquote(slashed),
        slashed.rsplit("/", 1)[-1],
        unquote(slashed).rsplit("/", 1)[-1],
    ]
    for each in dict.fromkeys(names):
        if each and "\0" not in each and (file := _existing(folder, each)):
            return file
    return None


def read_image(mesh: Path, folder: Path, name: str) -> np.ndarray | None:
    """Return an image file of a mesh, sRGB, shape [row column 3], uint8; None, and a warning, if it cannot be read."""
    file = beside(folder, name)
    if file is None:
        _log.warning("%s: the texture %s is missing; its faces become grey", mesh, name)
        return None
    return decode(mesh, file.name, file.read_bytes())


def decode(mesh: Path, name: str, data: bytes) -> np.ndarray | None:
    """Return the image that bytes hold, sRGB, shape [row column 3], uint8; None, and a warning, if they are damaged."""
    from PIL import Image  # of the extra sim; files without textures do without

    try:
        with Image.open(io.BytesIO(data)) as opened:
            if opened.mode.startswith("I"):  # Pillow clips 16 bits to 8 instead of scaling them
                grey = np.asarray(opened).astype(np.float64) / 257
                return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
            return np.asarray(opened.convert("RGB"))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        _log.warning("%s: the texture %s cannot be read (%s); its faces become grey", mesh, name, error)
        return None


def _existing(folder: Path, name: str) -> Path | None:
    """Return a file in a folder, whose name may be in another case."""
    file = folder / name
    try:
        if file.is_file():
            return file
        fits = [other for other in file.parent.iterdir() if other.name.lower() == file.name.lower() and other.is_file()]
    except OSError:  # no such folder, or a name that is too long
        return None
    return fits[0] if fits else None
