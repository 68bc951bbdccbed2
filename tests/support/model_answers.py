"""Sixty answers in the styles of five families of language models, each of which places the mug as planned.

The families differ in how they wrap a script and in their habits: one answers with bare code, one with prose and a fence,
one thinks aloud first, one gives several fences, one writes short code with other quotes. The twelve bodies of each differ in
what they call things, how they pose the object, what they check and what they print. The plan is that of `harmless_scripts`.
"""

from __future__ import annotations

from collections.abc import Callable

HALF = "0.7071067811865476"
IMPORT = "from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics\n"
CHECKED = """\
check = Usd.Stage.Open("scene.usda")
placed = check.GetPrimAtPath("/scene/mug_8")
assert placed and placed.IsValid(), "prim missing after save"
print("OK:", placed.GetPath(), placed.GetTypeName(), flush=True)
"""

PLAIN = f"""\
stage = Usd.Stage.Open("scene.usda")
xform = UsdGeom.Xform.Define(stage, "/scene/mug_8")
prim = xform.GetPrim()
prim.GetReferences().AddReference("objects/mug.usd")
xform.AddTranslateOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(1.5, -0.25, 0.75))
xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd({HALF}, 0.0, 0.0, {HALF}))
xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.5, 0.5, 0.5))
prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set("mug_8")
prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set("coffee mug")
UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr(["coffee mug"])
stage.Save()
"""


def _tail(prim: str = "prim") -> str:
    return (
        f'{prim}.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set("mug_8")\n'
        f'{prim}.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set("coffee mug")\n'
        f'UsdSemantics.LabelsAPI.Apply({prim}, "class").CreateLabelsAttr(["coffee mug"])\nstage.Save()\n'
    )


BODIES = {
    "plain": IMPORT + PLAIN,
    "printing": IMPORT
    + PLAIN
    + "print('saved', stage.GetRootLayer().identifier)\n".replace(".identifier", "")
    + "for line in ('a', 'b', 'c'):\n    print(f'{line:>10}', end='\\n', flush=True)\n",
    "future": "from __future__ import annotations\n\n"
    + IMPORT
    + f"""
def place(stage: Usd.Stage, path: str) -> Usd.Prim | None:
    prim: Usd.Prim = stage.DefinePrim(path, "Xform")
    return prim


stage = Usd.Stage.Open(STAGE)
prim = place(stage, "/scene/mug_8")
assert prim is not None
prim.GetReferences().AddReference(OBJECT)
xf = UsdGeom.Xformable(prim)
xf.AddTranslateOp().Set(Gf.Vec3d(1.5, -0.25, 0.75))
xf.AddOrientOp().Set(Gf.Quatf({HALF}, 0, 0, {HALF}))
xf.AddScaleOp().Set(Gf.Vec3f(0.5))
"""
    + _tail(),
    "math": "import math\n\n"
    + IMPORT
    + f"""
TRANSLATE = (1.5, -0.25, 0.75)
ORIENT_XYZW = (0.0, 0.0, {HALF}, {HALF})

stage = Usd.Stage.Open("scene.usda")
xform = UsdGeom.Xform.Define(stage, "/scene/mug_8")
prim = xform.GetPrim()
prim.GetReferences().AddReference("objects/mug.usd")
norm = math.sqrt(sum([c * c for c in ORIENT_XYZW]))
assert math.isclose(norm, 1.0, abs_tol=1e-6)
yaw = math.degrees(2.0 * math.atan2(ORIENT_XYZW[2], ORIENT_XYZW[3]))
xform.AddTranslateOp().Set(Gf.Vec3d(*TRANSLATE))
xform.AddRotateZOp().Set(yaw)
xform.AddScaleOp().Set(Gf.Vec3f(0.5, 0.5, 0.5))
"""
    + _tail(),
    "typing": "from typing import List, Optional, Tuple\n"
    + IMPORT
    + f'''
Vec = Tuple[float, float, float]


def add(stage: Usd.Stage, path: str, at: Vec, labels: List[str], note: Optional[str] = None) -> Usd.Prim:
    """Define the Xform and its attributes."""
    xform = UsdGeom.Xform.Define(stage, path)
    p = xform.GetPrim()
    p.GetReferences().AddReference("objects/mug.usd")
    xform.AddTranslateOp().Set(Gf.Vec3d(at[0], at[1], at[2]))
    xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd({HALF}, Gf.Vec3d(0.0, 0.0, {HALF})))
    xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(0.5))
    UsdSemantics.LabelsAPI.Apply(p, "class").CreateLabelsAttr(labels)
    return p


stage = Usd.Stage.Open("scene.usda")
mug = add(stage, "/scene/mug_8", (1.5, -0.25, 0.75), ["coffee mug"])
for key, text in {{"s2a:partId": "mug_8", "s2a:label": "coffee mug"}}.items():
    mug.CreateAttribute(key, Sdf.ValueTypeNames.String).Set(text)
stage.GetRootLayer().Save()
''',
    "errors": IMPORT
    + f"""
def main():
    stage = Usd.Stage.Open("scene.usda")
    if stage is None:
        raise RuntimeError("Failed to open stage: scene.usda")
    prim_path = Sdf.Path("/scene/mug_8")
    if stage.GetPrimAtPath(prim_path).IsValid():
        raise RuntimeError(f"Prim already exists: {{prim_path}}")
    xform = UsdGeom.Xform.Define(stage, prim_path)
    prim = xform.GetPrim()
    try:
        prim.GetReferences().AddReference("objects/mug.usd")
    except Exception as e:
        print(f"could not add the reference: {{e}}", flush=True)
        raise
    xform.ClearXformOpOrder()
    xform.AddTranslateOp().Set(Gf.Vec3d(1.5, -0.25, 0.75))
    xform.AddOrientOp().Set(Gf.Quatf({HALF}, Gf.Vec3f(0, 0, {HALF})))
    xform.AddScaleOp().Set(Gf.Vec3f(0.5, 0.5, 0.5))
"""
    + "".join("    " + line + "\n" for line in _tail().splitlines())
    + """

if __name__ == "__main__":
    main()
""",
    "low level": "from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdSemantics, Vt\n"
    + f"""
layer = Sdf.Layer.FindOrOpen("scene.usda")
stage = Usd.Stage.Open(layer)
with Sdf.ChangeBlock():
    spec = Sdf.CreatePrimInLayer(layer, "/scene/mug_8")
    spec.specifier = Sdf.SpecifierDef
    spec.typeName = "Xform"
    spec.referenceList.Prepend(Sdf.Reference("objects/mug.usd"))
    for attr_name, attr_value in (("s2a:partId", "mug_8"), ("s2a:label", "coffee mug")):
        attr = Sdf.AttributeSpec(spec, attr_name, Sdf.ValueTypeNames.String)
        attr.default = attr_value
prim = stage.GetPrimAtPath("/scene/mug_8")
xf = UsdGeom.Xformable(prim)
ops = [xf.AddTranslateOp(), xf.AddOrientOp(UsdGeom.XformOp.PrecisionDouble), xf.AddScaleOp()]
vals = [Gf.Vec3d(1.5, -0.25, 0.75), Gf.Quatd({HALF}, 0, 0, {HALF}), Gf.Vec3f(0.5)]
for op, val in zip(ops, vals):
    op.Set(val)
labels = UsdSemantics.LabelsAPI.Apply(prim, "class")
labels.CreateLabelsAttr().Set(Vt.TokenArray(["coffee mug"]))
layer.Save()
""",
    "matrices": IMPORT
    + f"""
stage = Usd.Stage.Open("scene.usda")
prim = stage.DefinePrim("/scene/mug_8", "Xform")
prim.GetReferences().AddReference("objects/mug.usd")
q = Gf.Quatd({HALF}, 0.0, 0.0, {HALF}).GetNormalized()
matrix = Gf.Matrix4d().SetScale(Gf.Vec3d(0.5, 0.5, 0.5)) * Gf.Matrix4d().SetRotate(q) * Gf.Matrix4d().SetTranslate(
    Gf.Vec3d(1.5, -0.25, 0.75)
)
UsdGeom.Xformable(prim).AddTransformOp().Set(matrix)
print(matrix.ExtractTranslation() * 1.0, matrix.GetInverse() * matrix)
"""
    + _tail(),
    "common": IMPORT
    + """
stage = Usd.Stage.Open("scene.usda")
x = UsdGeom.Xform.Define(stage, "/scene/mug_8")
prim = x.GetPrim()
prim.GetReferences().AddReference("objects/mug.usd")
api = UsdGeom.XformCommonAPI(x)
ok = api.SetTranslate((1.5, -0.25, 0.75)) and api.SetRotate((0.0, 0.0, 90.0)) and api.SetScale((0.5, 0.5, 0.5))
assert ok, "could not author the pose"
"""
    + _tail()
    + CHECKED,
    "tables": IMPORT
    + f"""
PLAN = {{
    "id": "mug_8",
    "label": "coffee mug",
    "reference": "objects/mug.usd",
    "translate": [1.5, -0.25, 0.75],
    "orient": [0.0, 0.0, {HALF}, {HALF}],  # x, y, z, w
    "scale": 0.5,
}}
stage = Usd.Stage.Open("scene.usda")
scene_path = "/scene"
path = scene_path + "/" + PLAN["id"]
xform = UsdGeom.Xform.Define(stage, path)
prim = xform.GetPrim()
prim.GetReferences().AddReference(PLAN["reference"])
x, y, z = PLAN["translate"]
*imaginary, real = PLAN["orient"]
s = PLAN["scale"]
xform.AddTranslateOp().Set(Gf.Vec3d(x, y, z))
xform.AddOrientOp(precision=UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(real, Gf.Vec3d(*imaginary)))
xform.AddScaleOp(precision=UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(s, s, s))
for name in ("partId", "label"):
    value = PLAN["id"] if name == "partId" else PLAN["label"]
    prim.CreateAttribute(f"s2a:{{name}}", Sdf.ValueTypeNames.String, custom=True).Set(value)
UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([PLAN["label"]])
stage.Save()
""",
    "looking around": IMPORT
    + f"""
stage = Usd.Stage.Open("scene.usda")
root = stage.GetDefaultPrim()
ids = sorted([p.GetName() for p in root.GetChildren()])
print(len(ids), "parts:", ", ".join(ids), flush=True)
for i, p in enumerate(root.GetChildren()):
    label = p.GetAttribute("s2a:label").Get() if p.HasAttribute("s2a:label") else None
    if label is not None and i < 5:
        print(i, p.GetPath(), label)
prim = UsdGeom.Xform.Define(stage, root.GetPath().AppendChild("mug_8")).GetPrim()
refs = prim.GetReferences()
if not prim.HasAuthoredReferences():
    refs.AddReference(OBJECT)
xformable = UsdGeom.Xformable(prim)
t = xformable.AddTranslateOp()
o = xformable.AddOrientOp()
s = xformable.AddScaleOp()
t.Set(Gf.Vec3d(1.5, -0.25, 0.75))
o.Set(Gf.Quatf({HALF}, 0.0, 0.0, {HALF}))
s.Set(Gf.Vec3f(0.5, 0.5, 0.5))
xformable.SetXformOpOrder([t, o, s])
"""
    + _tail(),
    "helpers": IMPORT
    + f"""
def vec3(v, k=1.0):
    return Gf.Vec3d(v[0], v[1], v[2]) * k


def quat(xyzw):
    x, y, z, w = xyzw
    return Gf.Quatd(w, x, y, z)


def string_attr(p, name, value):
    a = p.CreateAttribute(name, Sdf.ValueTypeNames.String)
    a.Set(value)
    return a.Get() == value


stage = Usd.Stage.Open("scene.usda")
xform = UsdGeom.Xform.Define(stage, "/scene/mug_8")
prim = xform.GetPrim()
prim.GetReferences().AddReference("objects/mug.usd")
xform.AddTranslateOp().Set(vec3([1.5, -0.25, 0.75]))
xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(quat((0.0, 0.0, {HALF}, {HALF})))
xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(vec3((1.0, 1.0, 1.0), 0.5) * 1)
assert all([string_attr(prim, "s2a:partId", "mug_8"), string_attr(prim, "s2a:label", "coffee mug")])
UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr(["coffee mug"])
stage.Save()
""",
}
"""Twelve scripts, before a family's habits."""


def _bare(number: int, body: str) -> str:
    """A model that answers with code alone, with comments, and says what it has done."""
    head = (
        "",
        "#!/usr/bin/env python3\n",
        "# -*- coding: utf-8 -*-\n",
        '"""Place the mug \N{EM DASH} as planned."""\n',
    )[number % 4]
    if body.startswith("from __future__"):
        head = ""
    return f"{head}{body}# done\n"


def _prose(number: int, body: str) -> str:
    """A model that explains, with a fence that says python, and a remark below."""
    mark = ("python", "py", "Python", "python3")[number % 4]
    return f"Here's the script:\n\n```{mark}\n{body}```\n\nThe orientation is `x, y, z, w`; **Gf.Quatd** takes w first."


def _thinking(number: int, body: str) -> str:
    """A model that thinks aloud first, also in code, and then answers with or without a fence."""
    thoughts = "Okay, I need a script. First try:\n```python\nimport os\nos.system('ls')\n```\nNo, that is not allowed."
    opened = "" if number % 3 == 2 else "<think>\n"
    answer = body if number % 2 else f"```\n{body}```"
    return f"{opened}{thoughts}\n</think>\n\n{answer}"


def _fences(number: int, body: str) -> str:
    """A model that gives a command, the script and what it prints, in fences of its own."""
    fence = "~~~" if number % 2 else "```"
    first = f"First install USD:\n{fence}bash\npip install usd-core\n{fence}\n"
    last = f"\nIt prints:\n{fence}text\nOK: /scene/mug_8 Xform\n{fence}\n" if number % 3 else ""
    return f"{first}Then run:\n\n{fence}python\n{body}{fence}\n{last}"


def _terse(number: int, body: str) -> str:
    """A model that writes short code with other quotes, without blank lines, sometimes cut off behind its end."""
    lines = [line for line in body.replace('"', "'").splitlines() if line.strip() and not line.strip().startswith("#")]
    text = "\n".join(line for line in lines if "'''" not in line) + "\n"
    return (f"```python\n{text}", text.replace("\n", "\r\n"), f"  ```python\n{text}  ```", f"\ufeff{text}")[number % 4]


FAMILIES: dict[str, Callable[[int, str], str]] = {
    "bare": _bare,
    "prose": _prose,
    "thinking": _thinking,
    "fences": _fences,
    "terse": _terse,
}


def answers() -> dict[str, str]:
    """Return sixty answers by family and body."""
    return {
        f"{family}: {name}": wrap(number, body)
        for family, wrap in FAMILIES.items()
        for number, (name, body) in enumerate(BODIES.items())
    }
