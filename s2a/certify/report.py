"""Validation reports as JSON, SARIF, JUnit and a table, and images of scan and colliders."""

import io
import itertools
import json
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from s2a.core.check import Check, ValidationReport, as_json, count_text, doubtful
from s2a.scan.visuals import hulls, visible_room
from s2a.scene.geometry.camera import CameraPose, OrbitCamera, framing_pose, front_of
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.sim.asset import Asset, placed


def to_json(results: Sequence[ValidationReport]) -> str:
    """Return validation reports as JSON; NaN and infinity, which JSON has not, become null."""
    rows = [{"passed": c.passed, **as_json(c)} for c in results]
    return json.dumps({"passed": all(c.passed for c in results), "reports": rows}, indent=1)


def from_json(text: str) -> list[ValidationReport]:
    """Read validation reports; ValueError, KeyError or TypeError if the text is none."""
    return [_result(values) for values in json.loads(text)["reports"]]


SARIF = "https://json.schemastore.org/sarif-2.1.0.json"


def to_sarif(results: Sequence[ValidationReport]) -> str:
    """Return what failed and what warns as SARIF 2.1.0, which code hosts show beside a file."""
    rows = [(each, check) for each in results for check in doubtful(each.checks)]
    rules = [{"id": name} for name in dict.fromkeys(check.name for _, check in rows)]
    findings = [
        {
            "ruleId": check.name,
            "level": "error" if check.status == "fail" else "warning",
            "message": {"text": f"{number(check)} {check}".strip()},
            "locations": [
                {
                    "physicalLocation": {"artifactLocation": {"uri": Path(each.stage).as_posix()}},
                    "logicalLocations": [{"fullyQualifiedName": check.prim or each.target or "/"}],
                }
            ],
        }
        for each, check in rows
    ]
    tool = {"driver": {"name": "s2a", "version": version("s2a"), "rules": rules}}
    return json.dumps({"$schema": SARIF, "version": "2.1.0", "runs": [{"tool": tool, "results": findings}]}, indent=1)


def to_junit(results: Sequence[ValidationReport]) -> str:
    """Return validation reports as JUnit's XML, a suite each, which build servers show as tests."""
    root = ElementTree.Element("testsuites", name="s2a certify")
    for each in results:
        counts = {status: str(sum(c.status == status for c in each.checks)) for status in ("fail", "skipped")}
        about = {"tests": str(len(each.checks)), "failures": counts["fail"], "skipped": counts["skipped"]}
        name = f"{each.stage} {each.target}".strip()
        suite = ElementTree.SubElement(root, "testsuite", {"name": name, "time": f"{each.seconds}", **about})
        for check in each.checks:
            case = ElementTree.SubElement(suite, "testcase", classname=name, name=f"{check.name} {check.prim}".strip())
            if check.status in ("fail", "skipped"):
                tag = "failure" if check.status == "fail" else "skipped"
                ElementTree.SubElement(case, tag, message=f"{number(check)} {check}".strip())
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True)


def _result(values: dict[str, Any]) -> ValidationReport:
    values = {key: value for key, value in values.items() if key not in ("passed", "checks")} | {
        "checks": tuple(Check(**check) for check in values["checks"])
    }
    return ValidationReport(**values)


def kept(
    path: Path, sha256: str, settings: Mapping[str, object], made: Mapping[str, object], parts: Sequence[str]
) -> list[ValidationReport] | None:
    """Return the reports in a file if they are of these parts of this stage, with these settings and by this code.

    What changed code found is never kept: its commit says no more than that it was changed.
    """
    if str(made.get("commit")).endswith("+"):
        return None
    try:
        earlier = from_json(path.read_text())
    except (OSError, ValueError, KeyError, TypeError):
        return None
    same = all((c.sha256, c.settings, c.provenance) == (sha256, as_json(settings), made) for c in earlier)
    return earlier if same and [c.target for c in earlier] == list(parts) else None


def grip(result: ValidationReport) -> str:
    """Return in words whether a parallel gripper can hold the part, and why it cannot."""
    why = next((check.message for check in result.checks if check.name == "grasp_hold"), "")
    no = "not graspable by a parallel gripper"
    words = {
        True: "graspable by a parallel gripper",
        False: f"{no}: {why.removeprefix(f'{no}: ')}",
        None: "grasp not tested",
    }
    return words[result.graspable]


def summary(result: ValidationReport) -> str:
    """Return a report as a few lines: its verdict, and each failed check with its remedy.

    Whether a gripper can hold the part is a line of its own, with the reason: a part without a handle is no fault of its file.
    """
    head, *lines = verdict(result).splitlines()
    return "\n".join([head, f"  {grip(result)}", *lines])


def verdict(result: ValidationReport) -> str:
    """Return a report as a few lines without a word about grasps."""
    head = f"{result.stage}: {result.target or 'no target'}: {'PASSED' if result.passed else 'FAILED'}"
    lines = [f"  {c.name} at {c.prim or '/scene'}: {number(c)} {c.message}; {c.remedy}" for c in result.failed]
    return "\n".join([head, *lines, f"  {count_text(result.checks)}"])


def skipped(results: Sequence[ValidationReport]) -> list[str]:
    """Return why checks were skipped, a line each, and what to do about it, with the parts where those are not all."""
    parts: dict[str, list[str]] = {}
    for target, check in ((each.target, c) for each in results for c in each.checks if c.status == "skipped"):
        remedy = f"; {check.remedy}" if check.remedy else ""
        parts.setdefault(f"  {check.name} skipped: {check.message}{remedy}", []).append(target)
    return [line if len(of) == len(results) else f"{line} ({', '.join(of)})" for line, of in parts.items()]


def table(results: Sequence[ValidationReport]) -> str:
    """Return many reports as text, one a line; how many passed; and which parts a gripper can hold."""
    lines = [f"{'stage':40} {'target':16} {'verdict':8} failed checks"]
    for c in results:
        verdict = "passed" if c.passed else "FAILED"
        failed = ", ".join(check.name for check in c.failed)
        lines.append(f"{c.stage[-40:]:40} {c.target:16} {verdict:8} {failed}".rstrip())
    lines.append(f"{sum(c.passed for c in results)} of {len(results)} passed")
    grips: tuple[tuple[str, bool | None], ...] = (
        ("graspable", True),
        ("not graspable", False),
        ("grasp not tested", None),
    )
    for words, holds in grips:
        if some := [c.target for c in results if c.graspable is holds]:
            lines.append(f"{words}: {', '.join(some)}")
    return "\n".join(lines)


def number(check: Check) -> str:
    """Return what was measured, with its unit."""
    return "" if check.value is None else f"{check.value:.4g} {check.unit}".strip()


def png(image: np.ndarray) -> bytes:
    """Return an RGB image [row column 3], uint8, as a PNG file."""
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


# Colours of the moving part's colliders, one after the other
TARGET = ((230, 120, 40), (250, 170, 60), (205, 90, 60), (245, 140, 100))
NEAR = 1.6  # Distance for the image of the grasp, as a multiple of what just fits
OTHERS = (120, 150, 190)  # Colour of all other colliders


def images(path: Path, part: str, camera: OrbitCamera) -> dict[str, np.ndarray]:
    """Return images [row column 3] of a sim.usd, by their captions; none where there is nothing to see of the part."""
    room = sim_stage.read(path)
    body, scene = room.bodies[part], visible_room(room)
    if not len(body.visual.faces) or not scene.colliders:
        return {}
    moving = [painted(c.mesh, color) for c, color in zip(body.colliders, itertools.cycle(TARGET), strict=False)]
    hidden = {collider.part for collider in room.static_colliders if collider.structure}  # walls are before the room
    others = [painted(mesh, OTHERS) for owner, of, mesh in hulls(room) if owner != part and of not in hidden]
    view = _camera_pose(body.visual, body.visual, camera)
    seen, hard = list(scene.surfaces.values()), [*moving, *others]
    near = _camera_pose(room.articulations[part].grasp.region, body.visual, replace(camera, margin=NEAR))
    return {
        "the scan": render(seen, view, camera),
        "what collides; orange moves": render(hard, view, camera),
        "what collides over the scan": _mixed(seen, hard, view, camera),
        "the same at the grasp": _mixed(seen, hard, near, camera),
    }


def asset_images(asset: Asset, camera: OrbitCamera) -> dict[str, np.ndarray]:
    """Return images [row column 3] of a third-party asset, by their captions; none of one without visuals."""
    bodies = asset.bodies.values()
    seen = [placed(mesh, body.pose) for body in bodies for mesh in body.visuals or body.colliders]
    hard = [placed(mesh, body.pose) for body in bodies for mesh in body.colliders]
    if not seen:
        return {}
    whole = merge(seen + hard)
    view = framing_pose(whole.vertices, np.array([1.0, 0.0, 0.0]), camera)
    solid = [painted(mesh, color) for mesh, color in zip(hard, itertools.cycle(TARGET), strict=False)]
    shown = {"what is seen": render(seen, view, camera)}
    if not solid:
        return shown
    return shown | {"what collides": render(solid, view, camera), "both": _mixed(seen, solid, view, camera)}


def _mixed(seen: list[Mesh], hard: list[Mesh], view: CameraPose, camera: OrbitCamera) -> np.ndarray:
    """Return an image of two sets of surfaces, blended."""
    return ((render(seen, view, camera).astype(int) + render(hard, view, camera)) // 2).astype(np.uint8)


def _camera_pose(shown: Mesh, part: Mesh, camera: OrbitCamera) -> CameraPose:
    """Return the camera pose that frames a surface from the front of its part."""
    front = front_of([part])
    return framing_pose(shown.vertices, np.array([1.0, 0.0, 0.0]) if front is None else front, camera)
