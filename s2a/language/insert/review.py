"""The review of an object in its place: the camera poses that show it best, and a model's verdict on the images."""

import io
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from s2a.language.ask import Model, Record, Request, UsageLog, ask, parse
from s2a.language.insert import prompts
from s2a.language.insert.serves import visible_fraction
from s2a.language.insert.settings import Inserted, InsertSettings
from s2a.language.insert.supports import bounds_of, floor_height
from s2a.scene.geometry.camera import CameraPose, OrbitCamera
from s2a.scene.geometry.mesh_ops import merge, sample
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh, Scene

AZIMUTHS, ELEVATIONS = 24, np.radians([5.0, 15.0, 25.0, 40.0, 60.0])
# Height over width of what lies flat, and the least elevation from which it is looked at: edge-on it is a line
FLAT, STEEP = 0.15, np.radians(25.0)
CLOSER = (1.0, 0.6, 0.35, 0.2)  # Distances that are tried, as fractions of the camera's
# Least distances, as multiples of that at which the object fills the image: the next where none shows the second share of it
FITS, SEEN = (1.3, 1.0, 0.7, 0.4), 0.15
POINTS = 80  # Sampled on the object
GAP = 0.002  # Rays start this far from the surface [m]
LOW, HIGH = 0.15, 2.3  # Heights of the camera above the floor [m]
# Share of the best view's visible points that a view farther off must have, to be taken for what it shows of the room
ENOUGH = 0.8


def viewpoint(scene: Scene, object: Mesh, front: np.ndarray, camera: OrbitCamera) -> CameraPose:
    """Return the camera pose that shows most of an object, from its front and from afar if it can be.

    Args:
        scene: the room with the object in it.
        object: in the scene [m], the mesh of one of its parts.
        front: horizontal direction that it faces, shape [3].
        camera: intrinsics; its margin is the largest distance, as a multiple of the one at which the object fills the image.
    """
    points = sample(object, POINTS, seed=0).astype(np.float64)
    middle = object.bounds.mean(axis=0).astype(np.float64)
    room = merge(
        [Mesh(part.mesh.vertices, part.mesh.faces) for part in scene.parts.values() if part.mesh is not object]
    )
    whole = merge([room, Mesh(object.vertices, object.faces)])
    for fit in FITS:
        eyes, nearness, facing = _eyes(scene, object, middle, front, camera, fit)
        # What touches a wall is seen through it by rays from its back; points inside of it are not.
        share = visible_fraction(whole, points, eyes, GAP) * visible_fraction(room, (points + middle) / 2, eyes, GAP)
        if share.max(initial=0.0) >= SEEN:
            break
    if not len(eyes):
        eyes, share, nearness, facing = middle[None] + (0.0, 0.0, 1.0), np.ones(1), np.ones(1), np.zeros(1)
    merit = share + 0.15 * facing * share.max() - 0.5 * nearness * (share < ENOUGH * share.max())
    merit -= 0.1 * nearness * share.max()
    best = int(np.argmax(np.where(share >= ENOUGH * share.max(), merit, -1.0)))
    return CameraPose(tuple(eyes[best].tolist()), tuple(middle.tolist()))


def _eyes(
    scene: Scene, object: Mesh, middle: np.ndarray, front: np.ndarray, camera: OrbitCamera, fit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return possible eyes in the room [eye 3], how near each is (0 at the farthest) and how much in front, [eye] each.

    `fit`: least distance, as a multiple of the one at which the object fills the image.
    """
    radius = float(np.linalg.norm(np.ptp(object.bounds, axis=0))) / 2
    farthest = max(0.6, camera.margin / 2 * radius / np.tan(camera.fov / 2))
    heading = np.arctan2(front[1], front[0])
    azimuth, elevation, closer = (
        grid.ravel()
        for grid in np.meshgrid(np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS, ELEVATIONS, CLOSER, indexing="ij")
    )
    level = np.cos(elevation)
    away = np.stack([level * np.cos(heading + azimuth), level * np.sin(heading + azimuth), np.sin(elevation)], axis=1)
    distance = np.maximum(farthest * closer, fit * radius / np.tan(camera.fov / 2))
    eyes = middle + distance[:, None] * away
    (low, high), floor = bounds_of(scene), floor_height(scene)
    sides = np.ptp(object.bounds, axis=0)
    if sides[2] < FLAT * sides[:2].min():
        steep = elevation >= STEEP - 1e-6
        eyes, closer, azimuth = eyes[steep], closer[steep], azimuth[steep]
    inside = ((eyes > low + 0.05) & (eyes < high - 0.05))[:, :2].all(axis=1)
    inside &= (eyes[:, 2] > floor + LOW) & (eyes[:, 2] < floor + HIGH)
    return eyes[inside], 1.0 - closer[inside], np.cos(azimuth)[inside]


CLOSE = 1.8  # Distance of the near image, as a multiple of the object's diagonal
WIDTH = 640  # Of the images [pixels]: models take larger ones for more tokens, and they take seconds to render


@dataclass(frozen=True)
class ReviewVerdict:
    """What a model that sees says of an object in its place."""

    right: bool  # True if it looks right
    problem: str  # what is wrong, and what would be better; empty if nothing is


def reviewed(model: Model, room: Scene, inserted: Inserted, settings: InsertSettings, usage: UsageLog) -> ReviewVerdict:
    """Ask a model that sees whether an object looks right in its place, in two images of it.

    `settings`: intrinsics and framing of the images, and how many answers may be rejected.
    """
    parts = {**room.parts, inserted.placement.part_id: inserted.part}
    scene, camera = Scene(room.name, parts, room.origin), settings.camera
    camera = replace(camera, width=WIDTH, height=round(WIDTH * camera.height / camera.width), samples=1)
    meshes = [part.mesh for part in parts.values()]
    images = tuple(_png(render(meshes, pose, camera)) for pose in wide_and_close(inserted, scene, camera))
    question = _question(inserted, scene)
    text = prompts.review_question(question)
    request = Request("review", prompts.REVIEW, (("user", text),), prompts.REVIEW_SCHEMA, question, images)
    return ask(model, request, lambda text: parse(text, ReviewVerdict), settings.retries, usage)


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
