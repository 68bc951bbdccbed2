"""Images of the planes of virtual homes, and where fronts are in them: what the network of the proposals is trained on.

    s2a sample room=kitchen seed=0 detail=phone out=runs/homes_train/kitchen_0_phone    # and so on
    python experiments/proposal_images.py runs/homes_train/* --out runs/proposal_images [--jobs 2]

Each folder holds a scan of s2a sample. Writes an .npz for each; those that are there are kept. Of a phone's scan the textured GLB
is imported, as experiments/proposals.py does.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from proposals import as_used, true_parts
from scipy import ndimage

from s2a.annotate import files
from s2a.annotate.propose.layers import FACING, Layer, Points, ProposeConfig, floor_of, layers, spread
from s2a.annotate.propose.network import MOTIONS, image
from s2a.annotate.surface import SplitSurface
from s2a.core import config
from s2a.core.outputs import atomic_write
from s2a.scan import folder
from s2a.scan.formats import articulate3d
from s2a.scene.scene import Joint

ON_PLANE, HARDLY = 0.5, 0.15
"""Fraction of a front's surface on a plane from which on it is to be found there; between the two neither is asked for."""
MIN_POINTS, MIN_CELLS = 400, 30
"""Of a front on a plane."""
HELD = (-0.02, 0.15)
"""[m] Where a handle is, over its plane."""


@dataclass(frozen=True, eq=False)
class Planes:
    """The planes of a scan.

    Attributes:
        images: what the network sees of each, float16, shape [CHANNELS row column].
        boxes: of the fronts of each: left, bottom, right, top [cell], index in MOTIONS or -1, whether it is asked for;
            shape [front 6].
        handles: cells of handles, bool, shape [row column].
        cell: width of a cell [m].
    """

    images: list[np.ndarray]
    boxes: list[np.ndarray]
    handles: list[np.ndarray]
    cell: float

    @staticmethod
    def read(path: Path) -> Planes:
        """Read what `write` wrote."""
        with np.load(path) as data:
            count = int(data["count"])
            columns = ([data[f"{name}{i}"] for i in range(count)] for name in ("image", "boxes", "handles"))
            return Planes(*columns, float(data["cell"]))

    def write(self, path: Path) -> None:
        """Write all into an .npz."""
        each = zip(self.images, self.boxes, self.handles, strict=True)
        named = {
            f"{name}{i}": x
            for i, row in enumerate(each)
            for name, x in zip(("image", "boxes", "handles"), row, strict=True)
        }
        with atomic_write(path) as out, out.open("wb") as file:
            np.savez_compressed(file, count=len(self.images), cell=self.cell, **named)


def main() -> None:
    """Write what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=1)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(args.jobs) as helpers:
        for line in helpers.map(partial(_made, args.out), args.scans):
            print(line, flush=True)


def _made(out: Path, path: Path) -> str:
    """Write the planes of a scan; return what they hold."""
    file = out / f"{path.name}.npz"
    if not file.exists():
        planes(path).write(file)
    found = Planes.read(file)
    return f"{file}: {len(found.images)} planes, {sum(map(len, found.boxes))} fronts"


def planes(path: Path) -> Planes:
    """Return the planes of a scan, with the truth."""
    settings = config.load(ProposeConfig, config.file("annotate")["propose"])
    bare = files.read(path)
    surface, source = as_used(path, bare)
    truth = json.loads((path / "truth" / "truth.json").read_text())
    annotated = articulate3d.read_parts(folder.find(path).parts, bare.mesh)
    fronts: list[tuple[Joint, Points, Points]] = []
    for name, faces, joint in true_parts(path, bare, truth, surface, source):
        number = int(name.rpartition("_")[2])
        own = faces[np.isin(source[faces], annotated[number].faces)] if number in annotated else faces[:0]
        fronts.append((joint, *(_spread(surface, some, settings.density) for some in (own, np.setdiff1d(faces, own)))))
    floor = floor_of(surface)
    found = Planes([], [], [], settings.cell)
    for layer in layers(spread(surface, settings.density), settings):
        boxes, handles = _true_fronts(layer, fronts, settings)
        found.images.append(image(layer, floor).astype(np.float16))
        found.boxes.append(boxes)
        found.handles.append(handles)
    return found


def _spread(surface: SplitSurface, faces: np.ndarray, density: float) -> Points:
    """Return points on some faces."""
    return spread(replace(surface, faces=surface.faces[faces], source=surface.source[faces]), density, seed=1)


def _true_fronts(
    layer: Layer, fronts: list[tuple[Joint, Points, Points]], settings: ProposeConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Return boxes and handles of the fronts on a plane."""
    handles, boxes = np.zeros(layer.height.shape, bool), []
    for joint, body, grip in fronts:
        facing, (cells, height, within) = body.normal @ layer.normal > FACING, _cells(layer, body)
        mine = facing & within & (np.abs(height) < settings.layer)
        share = mine.sum() / max(facing.sum(), 1)
        if mine.sum() < MIN_POINTS or share < HARDLY:
            continue
        low, high = np.quantile(cells[mine], (0.005, 0.995), axis=0) + [[0.0], [1.0]]
        asked = share >= ON_PLANE and len(np.unique(cells[mine], axis=0)) >= MIN_CELLS
        boxes.append([*low, *high, _motion(layer, joint, low, high), asked])
        if asked:
            cells, height, within = _cells(layer, grip)
            held = np.zeros_like(handles)
            held[tuple(cells[within & (height > HELD[0]) & (height < HELD[1])].T[::-1])] = True
            handles |= ndimage.binary_closing(held)
    return np.array(boxes).reshape(-1, 6), handles


def _cells(layer: Layer, points: Points) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return columns and rows of points in a plane's image, shape [point 2], their heights [m], and which lie in it."""
    place = np.stack([points.place @ layer.right, points.place[:, 2]], axis=1)
    cells = np.floor((place - layer.low) / layer.cell).astype(int)
    within = ((cells >= 0) & (cells < layer.height.shape[::-1])).all(axis=1)
    return cells, points.place @ layer.normal - layer.offset, within


def _motion(layer: Layer, joint: Joint, low: np.ndarray, high: np.ndarray) -> int:
    """Return the index in MOTIONS of how a front opens; -1 where it is none of them."""
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    across, up, out = axis @ layer.right, axis[2], axis @ layer.normal
    place = (np.array([origin @ layer.right, origin[2]]) - layer.low) / layer.cell
    side = np.abs(place - high) < np.abs(place - low)
    if joint.kind == "prismatic":
        way = ("slide", "out") if abs(out) > 0.7 else ("slide", "right" if across > 0 else "left")
        return MOTIONS.index(way) if max(abs(out), abs(across)) > 0.7 else -1
    if abs(up) > 0.7:
        return MOTIONS.index(("hinge", "right" if side[0] else "left"))
    return MOTIONS.index(("hinge", "top" if side[1] else "bottom")) if abs(across) > 0.7 else -1


if __name__ == "__main__":
    main()
