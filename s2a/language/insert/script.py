"""The script of an insertion: it adds the planned prim to a geometry-free stage; any other change is a violation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pxr import Sdf

from s2a.language.insert.placement import Placement
from s2a.language.sandbox.diff import TAXONOMY
from s2a.language.sandbox.jail import STAGE, Sandbox
from s2a.language.sandbox.policy import check

TEMPLATE = """\
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics

stage = Usd.Stage.Open({stage!r})
xform = UsdGeom.Xform.Define(stage, {path!r})
prim = xform.GetPrim()
prim.GetReferences().AddReference({reference!r})
xform.AddTranslateOp().Set(Gf.Vec3d({x!r}, {y!r}, {z!r}))
xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd({qw!r}, {qx!r}, {qy!r}, {qz!r}))
xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d({scale!r}, {scale!r}, {scale!r}))
prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set({part_id!r})
prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set({label!r})
UsdSemantics.LabelsAPI.Apply(prim, {taxonomy!r}).CreateLabelsAttr([{label!r}])
stage.Save()
"""


@dataclass(frozen=True)
class ScriptResult:
    """Result of a script.

    Attributes:
        layer: `/scene` with the new prim, as the script wrote it; `s2a.language.insert.author.write` puts it over a stage.
        record: plain values for the JSON record: the active sandbox layers, what they left exposed, seconds, the script.
    """

    layer: Sdf.Layer
    record: dict[str, Any]


def run_sandboxed(sandbox: Sandbox, text: str, plan: Placement) -> ScriptResult:
    """Check a script, run it in the sandbox, and compare the saved stage with the plan.

    The script finds the stage as `scene.usda` in its current folder, and as `STAGE` and `OBJECT` that name and the path of
    the object's file.

    Args:
        sandbox: where it runs, with the geometry-free stage.
        text: Python.
        plan: the prim that it is to add.

    Raises:
        PolicyViolation: its text is not allowed, it failed, or its result differs from the plan.
        InputError: the system cannot confine an untrusted script.
    """
    check(text, STAGE, plan.reference, sandbox.config.allow)
    run = sandbox.run(text, {"STAGE": STAGE, "OBJECT": plan.reference})
    layer = sandbox.compare(run.saved, plan)
    return ScriptResult(
        layer,
        {"active": list(run.active), "exposed": list(run.exposed), "seconds": round(run.seconds, 3), "script": text},
    )


def write_script(plan: Placement) -> str:
    """Return the reference script: run without a model, and the example in the prompt."""
    (x, y, z), (qx, qy, qz, qw) = plan.position, plan.orientation
    return TEMPLATE.format(
        stage=STAGE,
        path=f"/scene/{plan.part_id}",
        reference=plan.reference,
        part_id=plan.part_id,
        label=plan.label,
        taxonomy=TAXONOMY,
        scale=plan.scale,
        **{"x": x, "y": y, "z": z, "qx": qx, "qy": qy, "qz": qz, "qw": qw},
    )
