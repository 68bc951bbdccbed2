"""The last step of an insertion: the placement, and a model's script that authors it."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from pathlib import Path
from typing import Any

from pxr import Sdf, UsdGeom

from s2a.core.errors import InputError, encodable
from s2a.language.insert import prompts
from s2a.language.insert.place.fit import Pose
from s2a.language.insert.placement import Placement, check_label
from s2a.language.insert.prompts import ScriptResult, run_sandboxed
from s2a.language.llm.ask import Model, Request, UsageLog, ValidationFeedback, ask, without_thoughts
from s2a.language.sandbox.jail import Sandbox
from s2a.language.sandbox.operations import PolicyViolation
from s2a.language.sandbox.policy import HIDDEN
from s2a.scan.labels import part_id
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd.stage import ROOT, new_stage, save, save_layer, write_mesh

FENCE = re.compile(
    r"^[ \t>]*(?P<fence>`{3,}|~{3,})[ \t]*(?P<language>[\w.+-]*)[^\n`]*\n(?P<script>.*?)(?:^[ \t]*(?P=fence)[`~]*[ \t]*$|\Z)",
    re.DOTALL | re.MULTILINE,
)
"""A block of code in Markdown."""
MAX_HINT = 2000
"""Letters of a placement hint."""
LANGUAGES = ("python", "python3", "py", "py3")


def check_words(label: str, hint: str) -> None:
    """Raise an InputError if a label or a placement hint can be in no script, file or request."""
    check_label(label)
    if HIDDEN.search(label):
        raise InputError(f"label {label!r} has a word that begins with an underscore, or two; use plain words")
    if encodable(hint) != hint or len(hint) > MAX_HINT:
        raise InputError(
            f"prompt {hint[:40]!r} is longer than {MAX_HINT} letters, or no UTF-8; say it in fewer, plain words"
        )


def placement(scene: Scene, label: str, pose: Pose, scale: float) -> Placement:
    """Return the placement for the script; the id is the label with the number after the highest in the scene."""
    numbers = [int(tail) for i in scene.parts if (tail := i.rpartition("_")[2]).isdecimal()]
    plain = unicodedata.normalize("NFKD", label.lower()).encode("ascii", "ignore").decode()
    # No leading and no double underscores: the policy forbids scripts to contain such names (s2a.language.sandbox.policy).
    words = "_".join(re.findall("[a-z0-9]+", plain))[:40].strip("_") or "object"
    name = part_id(words, max(numbers, default=0) + 1).lstrip("_")
    name = name if name[0].isalpha() else f"object_{name}"
    x, y, z = map(float, pose.position)  # the repr of NumPy's floats names their type
    qx, qy, qz, qw = map(float, pose.quaternion)
    return Placement(name, label, f"objects/{name}.usdc", (x, y, z), (qx, qy, qz, qw), float(scale))


def author(model: Model, sandbox: Sandbox, planned: Placement, usage: UsageLog, said: dict[str, Any]) -> ScriptResult:
    """Ask for a script and run it in the sandbox; a policy violation goes back to the model once.

    Args:
        model: the language model.
        sandbox: where the script runs.
        planned: the prim that the script is to add.
        usage: log of the answers, appended to.
        said: record of the step; receives the violations, the script, the active sandbox layers and the seconds.

    Raises:
        InputError: the second script was rejected too, or the system cannot confine scripts.
    """
    facts = {
        "id": planned.part_id,
        "label": planned.label,
        "reference": planned.reference,
        "translate": list(planned.position),
        "orient": list(planned.orientation),
        "scale": planned.scale,
    }
    refusals: list[str] = said.setdefault("refusals", [])

    def accept(text: str) -> ScriptResult:
        try:
            return run_sandboxed(sandbox, bare(text), planned)
        except PolicyViolation as violation:
            refusals.append(str(violation))
            raise ValidationFeedback(f"{violation}. Write the script again, whole.") from violation

    request = Request("script", prompts.SCRIPT, (("user", prompts.script_question(planned)),), None, facts)
    result = ask(model, request, accept, 1, usage)
    said |= {name: value for name, value in result.record.items() if name != "seconds"}
    said["confined_seconds"] = result.record["seconds"]
    return result


def bare(text: str) -> str:
    """Return the script in an answer, without what the model thought, code fences and the text around them.

    Of several fences the last one that says python counts, else the last one. One that does not end goes on to the end.
    """
    text = without_thoughts(text).lstrip("\ufeff")
    fences = [(found["language"].lower(), found["script"]) for found in FENCE.finditer(text)]
    if not fences:
        return text
    written = [script for language, script in fences if language in LANGUAGES]
    return textwrap.dedent(written[-1] if written else fences[-1][1])


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
