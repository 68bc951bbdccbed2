"""A cube of tetrahedra as a file, to be a soft body."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from s2a.sim.soft_body import KUHN


def cube_asset(folder: Path) -> Path:
    """Write a cube of six tetrahedra; return the file."""
    corners, index = np.unique(KUHN.reshape(-1, 3), axis=0, return_inverse=True)
    stage = Usd.Stage.CreateNew(str(folder / "cube.usda"))
    mesh = UsdGeom.Mesh.Define(stage, "/cube")
    mesh.CreatePointsAttr([tuple(map(float, each)) for each in corners])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 3])
    mesh.GetPrim().CreateAttribute("tetraIndices", Sdf.ValueTypeNames.IntArray).Set([int(i) for i in index.ravel()])
    stage.Save()
    return folder / "cube.usda"
