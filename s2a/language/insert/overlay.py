"""What was added to a stage, as a small layer over it: the stage stays as it is, and without the layer nothing was added."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, UsdGeom

from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import ROOT, new_stage, save, save_layer, write_mesh

OBJECT = "/object"
"""Default prim of an object's file."""


def write_object(mesh: Mesh, path: Path) -> None:
    """Write an object's file, as a placement refers to it: `/object` with its surface in `/object/visual`.

    Args:
        mesh: in the object's own frame, metres, z up.
        path: ends in .usd, .usda or .usdc.

    Raises:
        InputError: the file cannot be written.
    """
    stage = new_stage()
    stage.RemovePrim(ROOT)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, OBJECT).GetPrim())
    write_mesh(stage, f"{OBJECT}/visual", mesh)
    save(stage, path)


def write(added: Sdf.Layer, below: str, path: Path) -> None:
    """Write a layer that shows a stage with what was added; the same input gives the same bytes.

    Args:
        added: `/scene` with the new prims, from `s2a.language.sandbox.diff`.
        below: path of the stage (a geometric.usd or an overlay), relative to the folder of `path`.
        path: ends in .usda.

    Raises:
        InputError: the file cannot be written.
    """
    stage, layer = new_stage(), Sdf.Layer.CreateAnonymous(".usda")
    layer.TransferContent(stage.GetRootLayer())  # a layer alone opens nothing that it names
    layer.subLayerPaths.append(below)
    root = layer.GetPrimAtPath(ROOT)
    root.specifier, root.typeName = Sdf.SpecifierOver, ""
    for prim in added.GetPrimAtPath(ROOT).nameChildren:
        Sdf.CopySpec(added, prim.path, layer, prim.path)
    save_layer(layer, path)
