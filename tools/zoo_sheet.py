"""Render docs/zoo.png: all objects of the zoo with their labels, one row for each half of a category.

python tools/zoo_sheet.py docs/zoo.png [LABEL_OR_CATEGORY ...]
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import sheet

from s2a.homes.zoo import ZooObject, zoo
from s2a.scene.geometry.camera import OrbitCamera, framing_pose
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh

COLUMNS = 10
TILE, CAPTION = 168, 22
"""Side of an image, and height of the label below it [pixel]."""
CAMERA = OrbitCamera(TILE, TILE, 3, fov=0.5, azimuth=0.45, elevation=0.5, margin=1.06, backface_culling=False)


def main(out: Path, chosen: list[str]) -> None:
    """Render the objects of the chosen labels and categories, or all."""
    shown = [item for item in zoo() if not chosen or {item.label, item.category} & set(chosen)]
    tiles = [(item.label, _image(item)) for item in shown]
    print(f"{sheet.write(tiles, out, COLUMNS, CAPTION)}, {len(shown)} objects")


def _image(item: ZooObject) -> np.ndarray:
    """Render an object from the front, the right and above; what hangs on walls is seen more level."""
    mesh = item.surface.mesh
    # As large as a room, so that its own small parts throw shadows.
    size = 1.0 / np.ptp(mesh.vertices, axis=0).max()
    large = Mesh(mesh.vertices * size, mesh.faces, mesh.colors)
    camera = replace(CAMERA, elevation=0.15, azimuth=0.35) if item.placement == "hanging" else CAMERA
    return render([large], framing_pose(large.vertices, np.array([1.0, 0.0, 0.0]), camera), camera)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("image", type=Path)
    parser.add_argument("chosen", nargs="*", metavar="LABEL_OR_CATEGORY", help="render these alone")
    args = parser.parse_args()
    if unknown := set(args.chosen) - {name for item in zoo() for name in (item.label, item.category)}:
        parser.error(f"no object has the label or category {min(unknown)!r}")
    main(args.image, args.chosen)
