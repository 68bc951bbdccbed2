"""The geometry-free stage that a script sees: prims, types, transforms and labels, no arrays."""

from __future__ import annotations

from pathlib import Path

from pxr import Sdf, Usd, UsdGeom

from s2a.scene.usd.stage import ROOT, new_stage, open_stage

KEPT = ("s2a:partId", "s2a:label", "s2a:parent", "s2a:motion")


def geometry_free_text(path: Path) -> str:
    """Return a stage in USD's text with the prims of the one at `path`, and nothing of it that is long.

    Kept are types, transforms, and `s2a:partId`, `s2a:label`, `s2a:parent` and `s2a:motion`; dropped are arrays,
    references, joints and physics.

    Raises:
        InputError: no such file, or not a stage in metres with z up and the default prim `/scene`.
    """
    stage, bare = open_stage(path), new_stage()
    layer = bare.GetRootLayer()
    for prim in Usd.PrimRange(stage.GetPrimAtPath(ROOT)):
        if prim.GetPath() != ROOT:
            _copy(prim, layer)
    return layer.ExportToString()


def _copy(prim: Usd.Prim, layer: Sdf.Layer) -> None:
    """Write a prim's type, transform and short attributes into a layer."""
    spec = Sdf.CreatePrimInLayer(layer, prim.GetPath())
    spec.specifier, spec.typeName = Sdf.SpecifierDef, prim.GetTypeName()
    kept = [attribute for name in KEPT if (attribute := prim.GetAttribute(name)).HasAuthoredValue()]
    if prim.IsA(UsdGeom.Xformable):
        order = UsdGeom.Xformable(prim).GetXformOpOrderAttr()
        kept += [order] if order.HasAuthoredValue() else []
        kept += [op.GetAttr() for op in UsdGeom.Xformable(prim).GetOrderedXformOps()]
    for attribute in kept:
        kind = attribute.GetTypeName()
        copy = Sdf.AttributeSpec(spec, attribute.GetName(), kind, attribute.GetVariability(), attribute.IsCustom())
        copy.default = attribute.Get()
