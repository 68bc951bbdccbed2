"""The review of a result: a model that sees says once if an object looks right in its place; if not, one more plan is made."""

from __future__ import annotations

import copy
import io
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.language.insert import prompts
from s2a.language.insert.context import InsertContext, Inserted
from s2a.language.insert.pipeline import Planned, fixed
from s2a.language.insert.plan import FailedPlan
from s2a.language.insert.viewpoint import viewpoint
from s2a.language.llm.ask import Request, ask, parse
from s2a.language.llm.usage_log import Record, step
from s2a.scene.geometry.orbit_camera import CameraPose, OrbitCamera
from s2a.scene.geometry.render import render
from s2a.scene.scene import Scene

CLOSE = 1.8
"""Distance of the near image, as a multiple of the object's diagonal."""
WIDTH = 640
"""Of the images [pixels]: models take larger ones for more tokens, and they take seconds to render."""


@dataclass(frozen=True)
class ReviewVerdict:
    """What a model that sees says of an object in its place.

    Attributes:
        right: True if it looks right.
        problem: what is wrong, and what would be better; empty if nothing is.
    """

    right: bool
    problem: str


def reviewed(context: InsertContext, planned: Planned, inserted: Inserted, camera: OrbitCamera) -> Inserted:
    """Return an insertion that a model finds right, else one by another plan, else the first one.

    Args:
        context: of the insertion; its record gets the step "review".
        planned: the object.
        inserted: the object in its place.
        camera: intrinsics and framing of the image.
    """
    with step(context.record, "review") as said:
        verdict = _verdict(context, inserted, camera)
        said |= vars(verdict)
    if verdict.right:
        return inserted
    before = copy.deepcopy(context.record)
    failed = FailedPlan(inserted.plan, f"It was put there, and does not look right: {verdict.problem[:500]}", False)
    try:
        return fixed(context, planned, failed)
    except InputError as error:
        context.record.clear()
        context.record.update(before)
        context.record["review"]["kept"] = str(error)
        return inserted


def image_pose(inserted: Inserted, scene: Scene, camera: OrbitCamera) -> CameraPose:
    """Return the camera pose of the image of an object in its place, in the room with it."""
    front = Rotation.from_quat(inserted.candidate.pose.quaternion).apply([1.0, 0.0, 0.0])
    return viewpoint(scene, inserted.part.mesh, front, camera)


def wide_and_close(inserted: Inserted, scene: Scene, camera: OrbitCamera) -> tuple[CameraPose, CameraPose]:
    """Return two camera poses on an object in its place: one that shows the room about it, and a near one along the same line."""
    wide = image_pose(inserted, scene, camera)
    away = np.subtract(wide.eye, wide.target)
    size = float(np.linalg.norm(np.ptp(inserted.part.mesh.bounds, axis=0)))
    nearer = min(1.0, CLOSE * size / float(np.linalg.norm(away)))
    return wide, CameraPose(tuple((wide.target + nearer * away).tolist()), wide.target)


def _verdict(context: InsertContext, inserted: Inserted, camera: OrbitCamera) -> ReviewVerdict:
    parts = {**context.room.scene.parts, inserted.placement.part_id: inserted.part}
    scene = Scene(context.room.scene.name, parts, context.room.scene.origin)
    meshes = [part.mesh for part in parts.values()]
    camera = replace(camera, width=WIDTH, height=round(WIDTH * camera.height / camera.width), samples=1)
    images = tuple(_png(render(meshes, pose, camera)) for pose in wide_and_close(inserted, scene, camera))
    question = _question(inserted, scene)
    text = prompts.review_question(question)
    request = Request("review", prompts.REVIEW, (("user", text),), prompts.REVIEW_SCHEMA, question, images)
    return ask(context.model, request, lambda text: parse(text, ReviewVerdict), context.config.retries, context.usage)


def _question(inserted: Inserted, scene: Scene) -> Record:
    """Return the facts of the question; no pose is in it, so that a recording answers it after a small change of the search."""
    choice = inserted.candidate.choice
    longest = float(np.ptp(inserted.part.mesh.bounds, axis=0).max())
    carrier = {"id": choice.target, "label": scene.parts[choice.target].label}
    about = {"label": inserted.placement.label, "longest": float(f"{longest:.1g}"), "relation": choice.relation}
    return about | {"carrier": carrier, "up": inserted.plan.up, "front": inserted.plan.front}


def _png(pixels: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, format="PNG", optimize=True)
    return file.getvalue()
