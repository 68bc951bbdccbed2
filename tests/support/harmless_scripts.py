"""Scripts as language models write them, each of which places the mug as planned: all must be accepted.

They vary what models vary: names, order, helper functions, loops, comments, types, checks, precision and printing. The plan
is a mug at (1.5, -0.25, 0.75), turned by 90 degrees about z, half its size.
"""

from __future__ import annotations

import itertools

IMPORTS = (
    "from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics",
    "from pxr import Usd, UsdGeom, Gf, Sdf, Vt, Kind\nfrom pxr import UsdSemantics",
    '"""Add a coffee mug to the scene."""\n\nfrom pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdSemantics\n',
)

OPENED = (
    'stage = Usd.Stage.Open("scene.usda")',
    "stage = Usd.Stage.Open(STAGE)",
    'STAGE_PATH = "scene.usda"\nstage = Usd.Stage.Open(STAGE_PATH)\n'
    'if not stage:\n    raise RuntimeError(f"cannot open {STAGE_PATH}")',
    'stage = Usd.Stage.Open("./scene.usda")\nassert stage, "no stage"',
    'layer = Sdf.Layer.FindOrOpen("scene.usda")\nstage = Usd.Stage.Open(layer)',
)

DEFINED = (
    'xform = UsdGeom.Xform.Define(stage, "/scene/mug_8")\nprim = xform.GetPrim()',
    'prim = stage.DefinePrim("/scene/mug_8", "Xform")\nxform = UsdGeom.Xformable(prim)',
    'root = stage.GetDefaultPrim()\npath = root.GetPath().AppendChild("mug_8")\nxform = UsdGeom.Xform.Define(stage, path)\n'
    "prim = xform.GetPrim()",
    'part_id = "mug_8"\nprim_path = f"/scene/{part_id}"\nif stage.GetPrimAtPath(prim_path):\n'
    '    raise ValueError("prim exists: " + prim_path)\nxform = UsdGeom.Xform.Define(stage, Sdf.Path(prim_path))\n'
    "prim = xform.GetPrim()",
)

REFERRED = (
    'prim.GetReferences().AddReference("objects/mug.usd")',
    "refs = prim.GetReferences()\nrefs.ClearReferences()\nrefs.AddReference(OBJECT)",
    'prim.GetReferences().AddReference(assetPath="objects/mug.usd")',
    'ref = Sdf.Reference("objects/mug.usd")\nprim.GetReferences().SetReferences([ref])',
    'asset = "objects" + "/" + "mug.usd"\nprim.GetReferences().AddReference(asset)',
)

POSED = (
    "xform.AddTranslateOp().Set(Gf.Vec3d(1.5, -0.25, 0.75))\n"
    "xform.AddOrientOp().Set(Gf.Quatf(0.7071067811865476, 0.0, 0.0, 0.7071067811865476))\n"
    "xform.AddScaleOp().Set(Gf.Vec3f(0.5, 0.5, 0.5))",
    "xform.ClearXformOpOrder()\nposition = (1.5, -0.25, 0.75)\n"
    "qx, qy, qz, qw = 0.0, 0.0, 0.7071067811865476, 0.7071067811865476\n"
    "xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*position))\n"
    "xform.AddOrientOp(precision=UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(qw, Gf.Vec3d(qx, qy, qz)))\n"
    "xform.AddScaleOp(UsdGeom.XformOp.PrecisionFloat).Set(Gf.Vec3f(0.5))",
    "m = Gf.Matrix4d(1.0)\nm.SetScale(0.5)\nr = Gf.Matrix4d(1.0)\n"
    "r.SetRotate(Gf.Quatd(0.7071067811865476, 0, 0, 0.7071067811865476))\nt = Gf.Matrix4d(1.0)\n"
    "t.SetTranslate(Gf.Vec3d(1.5, -0.25, 0.75))\nxform.AddTransformOp().Set(m * r * t)",
    "xform.AddTranslateOp().Set((1.5, -0.25, 0.75))\nxform.AddRotateXYZOp().Set((0.0, 0.0, 90.0))\n"
    "xform.AddScaleOp().Set((0.5, 0.5, 0.5))",
    "api = UsdGeom.XformCommonAPI(prim)\napi.SetTranslate(Gf.Vec3d(1.5, -0.25, 0.75))\napi.SetRotate(Gf.Vec3f(0, 0, 90))\n"
    "api.SetScale(Gf.Vec3f(0.5, 0.5, 0.5))",
    "translate = xform.AddXformOp(UsdGeom.XformOp.TypeTranslate, UsdGeom.XformOp.PrecisionDouble)\n"
    "translate.Set(Gf.Vec3d(1.5, -0.25, 0.75))\nxform.AddRotateZOp().Set(180.0 / 2)\n"
    "xform.AddScaleOp().Set(Gf.Vec3f(1, 1, 1) * 0.5)",
)

NAMED = (
    'prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set("mug_8")\n'
    'prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set("coffee mug")',
    'for name, value in (("s2a:partId", "mug_8"), ("s2a:label", "coffee mug")):\n'
    "    attr = prim.CreateAttribute(name, Sdf.ValueTypeNames.String)\n    attr.Set(value)",
    'attributes = {"s2a:partId": "mug_8", "s2a:label": "coffee mug"}\nfor key, value in attributes.items():\n'
    "    prim.CreateAttribute(key, Sdf.ValueTypeNames.String, custom=True).Set(str(value))",
    'def set_string(target: Usd.Prim, name: str, value: str) -> None:\n    """Author a string."""\n'
    "    target.CreateAttribute(name, Sdf.ValueTypeNames.String, True, Sdf.VariabilityUniform).Set(value)\n\n\n"
    'set_string(prim, "s2a:partId", "mug_8")\nset_string(prim, "s2a:label", value="coffee mug")',
)

LABELLED = (
    'UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr(["coffee mug"])',
    'labels = UsdSemantics.LabelsAPI.Apply(prim, "class")\nlabels.CreateLabelsAttr().Set(Vt.TokenArray(["coffee mug"]))',
    'api_labels = UsdSemantics.LabelsAPI.Apply(prim, "class")\nattr_labels = api_labels.GetLabelsAttr()\n'
    'if not attr_labels:\n    attr_labels = api_labels.CreateLabelsAttr()\nattr_labels.Set(["coffee mug"])',
    'UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([part for part in ["coffee mug"]])\n'
    "Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)",
)

SAVED = (
    "stage.Save()",
    "stage.GetRootLayer().Save()",
    'stage.Save()\nprint("added", prim.GetPath())',
    "try:\n    stage.GetRootLayer().Save()\nexcept Exception as error:\n"
    '    raise RuntimeError("could not save: {}".format("scene.usda"))',
    "# verify\nassert prim.IsValid()\nassert prim.IsA(UsdGeom.Xform)\nstage.Save()",
)

STEPS = (OPENED, DEFINED, REFERRED, POSED, NAMED, LABELLED, SAVED)

WHOLE = (
    '''\
from pxr import Usd, UsdGeom, UsdSemantics, Sdf, Gf


def add_object(stage_path, prim_path, asset_path, translate, orient, scale, label):
    """Add a referenced object."""
    stage = Usd.Stage.Open(stage_path)
    xform = UsdGeom.Xform.Define(stage, prim_path)
    prim = xform.GetPrim()
    prim.GetReferences().AddReference(asset_path)
    xform.AddTranslateOp().Set(Gf.Vec3d(*translate))
    xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(orient[3], orient[0], orient[1], orient[2]))
    xform.AddScaleOp().Set(Gf.Vec3f(scale, scale, scale))
    prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set(prim.GetName())
    prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set(label)
    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([label])
    stage.Save()
    return prim


if __name__ == "__main__":
    add_object(
        stage_path="scene.usda",
        prim_path="/scene/mug_8",
        asset_path="objects/mug.usd",
        translate=(1.5, -0.25, 0.75),
        orient=(0.0, 0.0, 0.7071067811865476, 0.7071067811865476),
        scale=0.5,
        label="coffee mug",
    )
''',
    """\
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics

# ---- plan ----
OBJ = {
    "id": "mug_8",
    "label": "coffee mug",
    "asset": "objects/mug.usd",
    "position": [1.5, -0.25, 0.75],
    "orientation": [0.0, 0.0, 0.7071067811865476, 0.7071067811865476],
    "scale": 0.5,
}


def main() -> None:
    stage: Usd.Stage = Usd.Stage.Open("scene.usda")
    prim = stage.DefinePrim("/scene/%s" % OBJ["id"], "Xform")
    prim.GetReferences().AddReference(OBJ["asset"])
    xf = UsdGeom.Xformable(prim)
    x, y, z = OBJ["position"]
    xf.AddTranslateOp().Set(Gf.Vec3d(x, y, z))
    qx, qy, qz, qw = OBJ["orientation"]
    xf.AddOrientOp().Set(Gf.Quatf(qw, qx, qy, qz))
    xf.AddScaleOp().Set(Gf.Vec3f(*[OBJ["scale"] for _ in range(3)]))
    prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set(OBJ["id"])
    prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set(OBJ["label"])
    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr().Set([OBJ["label"]])
    stage.GetRootLayer().Save()


main()
""",
    """\
from pxr import Sdf, Usd, UsdGeom, Gf, UsdSemantics

stage = Usd.Stage.Open("scene.usda")
existing = [p.GetName() for p in stage.GetPrimAtPath("/scene").GetChildren()]
assert "mug_8" not in existing, existing
for p in stage.Traverse():
    if p.GetAttribute("s2a:label").Get() == "desk":
        print(p.GetPath(), p.GetTypeName())

with Sdf.ChangeBlock():
    spec = Sdf.CreatePrimInLayer(stage.GetRootLayer(), "/scene/mug_8")
    spec.specifier = Sdf.SpecifierDef
    spec.typeName = "Xform"
    spec.referenceList.Prepend(Sdf.Reference("objects/mug.usd"))
    for name, value in [("s2a:partId", "mug_8"), ("s2a:label", "coffee mug")]:
        a = Sdf.AttributeSpec(spec, name, Sdf.ValueTypeNames.String)
        a.default = value

mug = stage.GetPrimAtPath("/scene/mug_8")
xformable = UsdGeom.Xformable(mug)
t = xformable.AddTranslateOp()
o = xformable.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
s = xformable.AddScaleOp()
t.Set(Gf.Vec3d(1.5, -0.25, 0.75))
o.Set(Gf.Rotation(Gf.Vec3d.ZAxis(), 90.0).GetQuat())
s.Set(Gf.Vec3f(0.5))
xformable.SetXformOpOrder([t, o, s])
UsdSemantics.LabelsAPI.Apply(mug, "class").CreateLabelsAttr(["coffee mug"])
stage.Save()
""",
)


def scripts() -> list[str]:
    """Return the whole scripts, and 40 made of steps so that every way to write a step occurs five times or more."""
    made = []
    for number in range(40):
        steps = [
            volumes[(number + shift) % len(volumes)] for shift, volumes in zip(itertools.count(), STEPS, strict=False)
        ]
        required_guarantees = "Vt.TokenArray" in steps[5] or "Kind" in steps[5]
        made.append("\n".join([IMPORTS[1] if required_guarantees else IMPORTS[number % len(IMPORTS)], *steps]) + "\n")
    return [*WHOLE, *made]
