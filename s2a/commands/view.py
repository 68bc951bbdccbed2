"""A look at a scan or a stage: as a tree of text, as a picture, or both."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.errors import InputError
from s2a.geometry.camera_pose import LookConfig, View, frame, front_of
from s2a.outputs import aside, refuse_other_picture
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
        text: whether to print its tree; null: unless a picture is asked for.
        picture: the PNG file to write, or null.
        part: id of the part in the middle of the picture, or null: the whole room.
        colliders: whether to draw what stands for the parts in contacts, each piece in its own colour.
        look: how the picture is taken.
    """

    path: Path
    text: bool | None
    picture: Path | None
    part: str | None
    colliders: bool
    look: LookConfig


def run(config: Config) -> str:
    """Write the picture if one is asked for; return the tree of the file, or what was written.

    Raises:
        InputError: nothing is there, nothing is asked for, or a picture that is no PNG file.
    """
    if not config.path.exists():
        raise InputError(f"{config.path}: does not exist; give a scan's folder, or a {', '.join(ENCODINGS)} file")
    if config.picture:
        refuse_other_picture(config.picture)
    if not config.picture and (config.part or config.colliders):
        raise InputError("keys 'part' and 'colliders' are of a picture, and none is asked for; give picture=FILE.png")
    said = []
    if config.picture:
        said.append(_picture(visible(config.path), config, config.picture))
    if config.text or (config.text is None and not config.picture):
        said.append(tree(config.path))
    if not said:
        raise InputError("key 'text' is false and no picture is asked for; give picture=FILE.png or text=true")
    return "\n".join(said)


def _picture(scene: Visible, config: Config, path: Path) -> str:
    # Loads Warp, which the tree does not need.
    from s2a.geometry.render import draw, painted, write

    meshes = list(scene.surfaces.values())
    if config.colliders:
        if not scene.colliders:
            raise InputError(f"{config.path} has no colliders; give a sim.usd, which s2a prepare writes")
        meshes = [painted(mesh, _hue(i)) for i, (_, mesh) in enumerate(scene.colliders)]
    view = _view(scene, scene.part(config.part) if config.part else meshes, config)
    with aside(path) as room:
        write(draw(meshes, view, config.look), room)
    return f"{path}: {config.look.width} x {config.look.height} pixels of {config.part or scene.name}"


def _view(scene: Visible, shown: list[Mesh], config: Config) -> View:
    """Return the view of some surfaces from their front; a room and closed surfaces have that of the parts that move."""
    points = np.concatenate([mesh.vertices for mesh in shown])
    jointed = [scene.surfaces[part] for part in scene.jointed if part in scene.surfaces]
    front = front_of(shown) if config.part else None
    front = front_of(jointed) if front is None else front
    return frame(points, np.array([1.0, 0.0, 0.0]) if front is None else front, config.look)


def _hue(number: int) -> tuple[int, int, int]:
    """Return the colour of the piece with this number."""
    red, green, blue = colorsys.hsv_to_rgb(number * GOLDEN % 1.0, 0.55, 0.95)
    return int(255 * red), int(255 * green), int(255 * blue)
