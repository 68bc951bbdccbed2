"""Images of the planes of virtual homes, and where fronts are in them: what the network of the proposals is trained on.

    s2a sample room=kitchen seed=0 detail=phone out=runs/homes_train/kitchen_0_phone    # and so on
    python experiments/proposal_images.py runs/homes_train/* --out runs/proposal_images [--jobs 2] [--coarse 2]

Each folder holds a scan of s2a sample. Writes an .npz for each, and one for each coarse copy: leaning, bent, with larger
triangles, bled colours, uneven light, gloss and holes, as real captures have them. Those that are there are kept. Of a phone's
scan the textured GLB is imported, as experiments/proposals.py does.
"""

from __future__ import annotations

import argparse
import json
import zlib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from proposals import as_used, true_parts
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.spatial.transform import Rotation

from s2a.annotate import files
from s2a.annotate.propose.layers import FACING, Layer, Points, ProposeConfig, floor_of, layer_of, layers, spread
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
EDGE = (0.015, 0.06)
"""[m] Edges of the cells whose vertices become one in a coarse copy; the triangles of scene0000_00 are 0.048 m wide."""
LEAN, BEND = np.radians(0.6), 0.005
"""[rad] and [m], standard deviations of how a coarse copy leans about each level axis, and of how far it is bent along each."""
LONG = (0.6, 3.0)
"""[m] Lengths of the waves of bends and of uneven light."""
HOLES, HOLE = 25, (0.03, 0.22)
"""Largest number of holes in a coarse copy, and their radii [m]."""
SPOTS, SPOT = 20, (0.05, 0.5)
"""Largest number of highlights in a coarse copy, and their radii [m]."""


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
    parser.add_argument("--coarse", type=int, default=0, help="coarse copies of each scan")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(args.jobs) as helpers:
        for lines in helpers.map(partial(written, args.out, args.coarse), args.scans):
            print(lines, flush=True)


def written(out: Path, copies: int, path: Path) -> str:
    """Write the planes of a scan and of its coarse copies; return what they hold."""
    names = [path.name, *(f"{path.name}_coarse{k}" for k in range(copies))]
    missing = [name for name in names if not (out / f"{name}.npz").exists()]
    if missing:
        scan = TrueScan.read(path)
        for name in missing:
            random = None if name == path.name else np.random.default_rng(zlib.crc32(name.encode()))
            scan.planes(random).write(out / f"{name}.npz")
    each = ((name, Planes.read(out / f"{name}.npz")) for name in names)
    return "\n".join(f"{name}: {len(one.images)} planes, {sum(map(len, one.boxes))} fronts" for name, one in each)


@dataclass(frozen=True, eq=False)
class TrueScan:
    """A scan with the truth.

    Attributes:
        surface: as it is annotated.
        fronts: joint, faces of the body and faces of the handles of each front.
    """

    surface: SplitSurface
    fronts: list[tuple[Joint, np.ndarray, np.ndarray]]

    @staticmethod
    def read(path: Path) -> TrueScan:
        """Read a folder of s2a sample."""
        bare = files.read(path)
        surface, source = as_used(path, bare)
        truth = json.loads((path / "truth" / "truth.json").read_text())
        annotated = articulate3d.read_parts(folder.find(path).parts, bare.mesh)
        fronts = []
        for name, faces, joint in true_parts(path, bare, truth, surface, source):
            number = int(name.rpartition("_")[2])
            own = faces[np.isin(source[faces], annotated[number].faces)] if number in annotated else faces[:0]
            fronts.append((joint, own, np.setdiff1d(faces, own)))
        return TrueScan(surface, fronts)

    def planes(self, random: np.random.Generator | None = None) -> Planes:
        """Return the planes with the truth, of a coarse copy where a generator is given."""
        settings = config.load(ProposeConfig, config.file("annotate")["propose"])
        surface = shown = self.surface
        fronts = self.fronts
        if random is not None:
            surface = bent(surface, random)
            left = intact(surface, random)
            fronts = [(joint, *(some[left[some]] for some in faces)) for joint, *faces in fronts]
            rest = replace(surface, faces=surface.faces[left], source=surface.source[left])
            shown = lit(merged(rest, random), random)
        points = [(joint, *(_spread(surface, some, settings.density) for some in faces)) for joint, *faces in fronts]
        settings = replace(settings, layer=layer_of(shown, settings.layer))
        floor, found = floor_of(shown), Planes([], [], [], settings.cell)
        for layer in layers(spread(shown, settings.density), settings):
            boxes, handles = _true_fronts(layer, points, settings)
            found.images.append(image(layer, floor).astype(np.float16))
            found.boxes.append(boxes)
            found.handles.append(handles)
        return found


def _waves(places: np.ndarray, random: np.random.Generator, count: int = 8) -> np.ndarray:
    """Return a smooth random field of about unit variance at places [m], shape [place]."""
    length = random.uniform(*LONG, count)
    way = random.normal(size=(count, 3))
    way *= (2 * np.pi / length / np.linalg.norm(way, axis=1))[:, None]
    return np.sin(places @ way.T + random.uniform(0, 2 * np.pi, count)).sum(axis=1) * np.sqrt(2 / count)


def bent(surface: SplitSurface, random: np.random.Generator) -> SplitSurface:
    """Return a surface that leans a little and is bent, as drift leaves it; joints stay, which are right to a few degrees."""
    lean = Rotation.from_rotvec([*random.normal(0.0, LEAN, 2), 0.0]).as_matrix()
    middle, amount = surface.vertices.mean(axis=0), random.uniform(0.0, 2 * BEND)
    bends = np.stack([_waves(surface.vertices, random) for _ in range(3)], axis=1)
    return replace(surface, vertices=(surface.vertices - middle) @ lean.T + middle + amount * bends)


def intact(surface: SplitSurface, random: np.random.Generator) -> np.ndarray:
    """Return which faces random holes leave, shape [face]."""
    left = np.ones(len(surface.faces), bool)
    for place in surface.centroids[random.integers(0, len(left), random.integers(0, HOLES + 1))]:
        stretch = random.uniform(0.5, 2.0, 3)
        left &= np.linalg.norm((surface.centroids - place) * stretch, axis=1) > random.uniform(*HOLE)
    return left


def merged(surface: SplitSurface, random: np.random.Generator) -> SplitSurface:
    """Return a surface whose vertices in a cell that look one way became one: relief is smeared, and colours are bled."""
    edge, used = random.uniform(*EDGE), np.unique(surface.faces)
    normals = np.zeros_like(surface.vertices)
    for corner in surface.faces.T:
        np.add.at(normals, corner, surface.normals * surface.areas[:, None])
    axis = np.argmax(np.abs(normals[used]), axis=1)
    way = 2 * axis + (normals[used, axis] > 0)
    turn = Rotation.random(rng=random).as_matrix()
    cells = np.floor(surface.vertices[used] @ turn.T / edge).astype(np.int64)
    _, group = np.unique(np.column_stack([cells, way]), axis=0, return_inverse=True)
    index = np.zeros(len(surface.vertices), np.int64)
    index[used] = group
    faces = index[surface.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    faces = faces[first]
    values = np.column_stack([surface.vertices, surface.colors])[used]
    count = np.bincount(group)
    mean = np.stack([np.bincount(group, value) for value in values.T], axis=1) / count[:, None]
    place, color = (_smoothed(x, faces, random.integers(0, 3)) for x in (mean[:, :3], mean[:, 3:]))
    return SplitSurface.of(place, faces, color)


def _smoothed(values: np.ndarray, faces: np.ndarray, passes: int) -> np.ndarray:
    """Return values of vertices, moved half way to the mean of their neighbours so many times."""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = np.concatenate([ends, ends[:, ::-1]])
    links = coo_array((np.ones(len(ends)), ends.T), shape=(len(values), len(values))).tocsr()
    for _ in range(passes):
        values = 0.5 * values + 0.5 * (links @ values) / np.maximum(links.sum(axis=1), 1.0)[:, None]
    return values


def lit(surface: SplitSurface, random: np.random.Generator) -> SplitSurface:
    """Return a surface in uneven light, with highlights, and with seams where the camera's exposure changed."""
    places, color = surface.vertices, surface.colors / 255.0
    color = color * np.exp(random.uniform(0.0, 0.3) * _waves(places, random))[:, None]
    for place in places[random.integers(0, len(places), random.integers(0, 6))]:
        way = random.normal(size=3)
        beyond = np.tanh((places - place) @ way / np.linalg.norm(way) / random.uniform(0.01, 0.2))
        gain = random.normal(0.0, 0.08) + random.normal(0.0, 0.05, 3)
        color = color * np.exp(beyond[:, None] * gain)
    for place in places[random.integers(0, len(places), random.integers(0, SPOTS + 1))]:
        far = np.linalg.norm(places - place, axis=1) / random.uniform(*SPOT)
        color = color + random.uniform(0.0, 0.5) * np.exp(-(far**2))[:, None]
    color = color.clip(0.0, 1.0) ** random.uniform(0.7, 1.4)
    return replace(surface, colors=255.0 * color)


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
