"""The process in which a script runs: it imports USD, enables its sandbox layers, and only then reads the script.

`s2a.language.sandbox.jail` starts it. The saved stage goes to a descriptor of its own, and what the script prints to
/dev/null. Reports after the script began are untrusted; the report of the active layers is sent before.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from s2a.language.sandbox import layers
from s2a.language.sandbox.layers import install

NAME = "<script>"
"""What tracebacks call the script."""
GUARANTEES = {
    "namespaces": ("files", "network"),
    "landlock": ("files",),
    "seccomp": ("network", "processes"),
}
"""What each sandbox layer keeps a script from."""


def main(descriptor: int) -> None:
    """Enable the layers of the job that a descriptor holds; run the script on standard input, and hand over the saved stage.

    What holds, and what went wrong, is reported to a descriptor that the job names; the stage goes to another.
    """
    job = read_job(descriptor)
    active = enable_layers(job, preload)
    tell(job["report"], {"active": active})
    task = json.load(sys.stdin)
    error = execute(task["script"], task["names"])
    tell(job["report"], error)
    if not error:
        os.write(job["result"], Path(job["stage"]).read_bytes())
    os._exit(0)  # without the clean-up of what the script made


def read_job(descriptor: int) -> dict[str, Any]:
    """Return the job that a descriptor holds."""
    with open(descriptor) as file:
        job: dict[str, Any] = json.load(file)
    return job


def enable_layers(job: dict[str, Any], preload: Callable[[], None]) -> list[str]:
    """Enter the scratch folder, write the stage there, preload, and enable the sandbox layers; return the active ones."""
    active: list[str] = []
    wanted = job["layers"]
    if "namespaces" in wanted and _enabled(lambda: layers.enter_namespaces(Path(job["scratch"]), job["disk"])):
        active.append("namespaces")
    here = Path(job["scratch"], "here")  # not the root itself: USD writes no file into a folder without a name
    here.mkdir()
    os.chdir(here)
    Path(job["stage"]).write_text(job["stage_text"])
    preload()
    layers.limit(job["cpu_seconds"], job["memory"], job["disk"])
    if active and not _enabled(layers.drop_privileges):
        active.clear()
    if "landlock" in wanted and _enabled(layers.landlock):
        active.append("landlock")
    if "seccomp" in wanted and _enabled(install):
        active.append("seccomp")
    return active


def execute(script: str, names: dict[str, str]) -> dict[str, Any]:
    """Run a script as a main program; return what went wrong, or nothing."""
    try:
        exec(compile(script, NAME, "exec"), {"__name__": "__main__", **names})
    except BaseException as error:  # also SystemExit: whatever a script raises is its failure
        lines = [line for frame, line in traceback.walk_tb(error.__traceback__) if frame.f_code.co_filename == NAME]
        line = lines[-1] if lines else getattr(error, "lineno", None)
        return {"line": line, "reason": f"{type(error).__name__}: {error}"[:1000]}
    return {}


def preload() -> None:
    """Import and use once what a script may import: later loads would be denied their files."""
    os.environ["PXR_WORK_THREAD_LIMIT"] = "1"
    import math  # noqa: F401
    import unicodedata  # noqa: F401  (Python's parser asks for it when a name is not ASCII)

    from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdSemantics, Vt  # noqa: F401

    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/rehearsal").GetPrim()
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(0.0))
    UsdSemantics.LabelsAPI.Apply(prim, "class")
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    stage.GetRootLayer().Export("rehearsal.usda")
    Usd.Stage.Open("rehearsal.usda").Save()
    os.unlink("rehearsal.usda")


def _enabled(layer: Callable[[], None]) -> bool:
    """Enable a layer; False where the system does not offer it."""
    try:
        layer()
    except OSError:
        return False
    return True


def tell(report: int, message: dict[str, Any]) -> None:
    """Write one line of JSON."""
    os.write(report, json.dumps(message).encode() + b"\n")
