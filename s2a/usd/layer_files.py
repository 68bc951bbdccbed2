"""The files that a stage is made of."""

from __future__ import annotations

from pathlib import Path

from pxr import Ar, Usd

from s2a.usd.stage import reading


def files(path: Path) -> list[Path]:
    """Return the files that a stage is composed of, its own first: its layers, what they stand over and refer to.

    Raises:
        InputError: a damaged file.
    """
    with reading(path):
        stage = Usd.Stage.Open(str(path))  # its layers live as long as it does
        # Of a layer in a .usdz this is the package.
        found = [Ar.SplitPackageRelativePathOuter(layer.realPath)[0] for layer in stage.GetUsedLayers()]
        others = {Path(name).resolve() for name in found if name}
    return [path, *sorted(others - {path.resolve()})]
