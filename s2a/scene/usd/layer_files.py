"""The files that a stage is made of."""

from __future__ import annotations

import os
from pathlib import Path

from pxr import Ar, Usd

from s2a.scene.usd.stage import reading, refuse_deep


def files(path: Path) -> list[Path]:
    """Return the files that a stage is composed of, its own first: its layers, what they stand over and refer to.

    Raises:
        InputError: a damaged file.
    """
    refuse_deep(path)
    with reading(path):
        stage = Usd.Stage.Open(str(path))  # its layers live as long as it does
        # Of a layer in a .usdz this is the package.
        found = [Ar.SplitPackageRelativePathOuter(layer.realPath)[0] for layer in stage.GetUsedLayers()]
        others = {Path(os.path.realpath(name)) for name in found if name}
    return [path, *sorted(others - {Path(os.path.realpath(path))})]
