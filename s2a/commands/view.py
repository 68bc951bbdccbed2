"""Show a scan or a stage: its tree as text, an image, or both."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.errors import InputError
from s2a.geometry.orbit_camera import CameraPose, OrbitCamera, framing_pose, front_of
from s2a.outputs import atomic_write, require_png
from s2a.scan.folder import mesh_remedy
from s2a.scene import Mesh
from s2a.usd.stage import ENCODINGS
from s2a.usd.tree import tree
from s2a.usd.visuals import Visible, visible

GOLDEN = 0.618
"""Steps of the golden section around the circle of hues keep neighbours apart, however many there are."""


@dataclass(frozen=True)
class Config:
    """Keys of `s2a view`.

    Attributes:
        path: a scan's folder or a stage.
        text: Print the tree; null prints it unless an image is requested.
        image: PNG file to write, or null.
        part: id of the part at the centre of the image, or null for the whole room.
        colliders: Render the collision hulls instead of the surfaces, each in its own colour.
        camera: intrinsics and framing of the image.
    """

    path: Path
    text: bool | None
    image: Path | None
    part: str | None
    colliders: bool
    camera: OrbitCamera


def run(config: Config) -> str:
    """Write the image if one is requested; return the tree of the file, or a line about the image.

    Raises:
        InputError: no such file, nothing requested, or an image file that is not PNG.
    """
    if not config.path.exists():
        raise InputError(f"{config.path}: does not exist; give a scan's folder, or a {', '.join(ENCODINGS)} file")
    if remedy := mesh_remedy(config.path):
        raise InputError(f"{config.path}: {remedy}, in a folder of its own, and give that folder")
    if config.image:
        require_png(config.image)
    if not config.image and (config.part or config.colliders):
        raise InputError("keys 'part' and 'colliders' apply to an image, and none is requested; give image=FILE.png")
    said = []
    if config.image:
        said.append(_image(visible(config.path), config, config.image))
    if config.text or (config.text is None and not config.image):
        said.append(tree(config.path))
    if not said:
        raise InputError("key 'text' is false and no image is requested; give image=FILE.png or text=true")
    return "\n".join(said)


def _image(scene: Visible, config: Config, path: Path) -> str:
    # Loads Warp, which the tree does not need.
    from s2a.geometry.render import painted, render, write_png

    meshes = list(scene.surfaces.values())
    if config.colliders:
        if not scene.colliders:
            raise InputError(f"{config.path} has no colliders; give a sim.usd, which s2a prepare writes")
        meshes = [painted(mesh, _hue(i)) for i, (_, mesh) in enumerate(scene.colliders)]
    view = _camera_pose(scene, scene.part(config.part) if config.part else meshes, config)
    with atomic_write(path) as room:
        write_png(render(meshes, view, config.camera), room)
    return f"{path}: {config.camera.width} x {config.camera.height} pixels of {config.part or scene.name}"


def _camera_pose(scene: Visible, shown: list[Mesh], config: Config) -> CameraPose:
    """Return the view of some surfaces from their front; a room and closed surfaces have that of the parts that move."""
    points = np.concatenate([mesh.vertices for mesh in shown])
    jointed = [scene.surfaces[part] for part in scene.jointed if part in scene.surfaces]
    front = front_of(shown) if config.part else None
    front = front_of(jointed) if front is None else front
    return framing_pose(points, np.array([1.0, 0.0, 0.0]) if front is None else front, config.camera)


def _hue(number: int) -> tuple[int, int, int]:
    """Return the colour of the piece with this number."""
    red, green, blue = colorsys.hsv_to_rgb(number * GOLDEN % 1.0, 0.55, 0.95)
    return int(255 * red), int(255 * green), int(255 * blue)
