"""A room's mesh as its file holds it, in the file's own frame and unit: triangles, also of polygons, materials, textures."""

import io
import logging
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from s2a.core.color_space import to_linear, to_srgb
from s2a.core.errors import InputError
from s2a.scan.folder import formats

_log = logging.getLogger(__name__)


def beside(folder: Path, name: str) -> Path | None:
    """Return the file that a name in another file means, or None if there is none.

    Tried are the name as it is, without quotes, with slashes for backslashes, without percent signs' escapes, as the bare name
    of a path of the machine that wrote it, and each in another case.
    """
    plain = name.strip().strip('"').strip("'")
    slashed = plain.replace("\\", "/")
    bare = [path.rsplit("/", 1)[-1] for path in (slashed, unquote(slashed))]
    names = [name.strip(), plain, slashed, unquote(slashed), *bare]
    for each in dict.fromkeys(names):
        if each and "\0" not in each and (file := _existing(folder, each)):
            return file
    return None


def read_image(mesh: Path, folder: Path, name: str) -> np.ndarray | None:
    """Return an image file of a mesh, sRGB, shape [row column 3], uint8; None, and a warning, if it cannot be read."""
    file = beside(folder, name)
    if file is None:
        _log.warning("%s: the texture %s is missing; its faces become grey", mesh, name)
        return None
    return decode(mesh, file.name, file.read_bytes())


def decode(mesh: Path, name: str, data: bytes) -> np.ndarray | None:
    """Return the image that bytes hold, sRGB, shape [row column 3], uint8; None, and a warning, if they are damaged."""
    from PIL import Image  # of the extra sim; files without textures do without

    try:
        with Image.open(io.BytesIO(data)) as opened:
            if opened.mode.startswith("I"):  # Pillow clips 16 bits to 8 instead of scaling them
                grey = np.asarray(opened).astype(np.float64) / 257
                return np.repeat(np.clip(np.round(grey), 0, 255).astype(np.uint8)[..., None], 3, axis=2)
            return np.asarray(opened.convert("RGB"))
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        _log.warning("%s: the texture %s cannot be read (%s); its faces become grey", mesh, name, error)
        return None


def has_holes(data: bytes) -> bool:
    """Return whether an image has texels that one sees through; one that cannot be read has none."""
    from PIL import Image  # of the extra sim; files without textures do without

    try:
        with Image.open(io.BytesIO(data)) as opened:
            return opened.has_transparency_data and bool(np.asarray(opened.convert("RGBA"))[..., 3].min() < 255)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        return False


def _existing(folder: Path, name: str) -> Path | None:
    """Return a file in a folder, whose name may be in another case."""
    file = folder / name
    try:
        if file.is_file():
            return file
        fits = [other for other in file.parent.iterdir() if other.name.lower() == file.name.lower() and other.is_file()]
    except OSError:  # no such folder, or a name that is too long
        return None
    return fits[0] if fits else None


GREY = 170  # Level of what has no colour


_FARTHEST = 1e9  # Texture coordinate from where on float64 tells no texels apart
REPEAT, CLAMP, MIRROR, BLACK = "repeat", "clamp", "mirror", "black"  # What a texture shows beyond coordinates of 0 to 1


@dataclass(frozen=True)
class Material:
    """What colours some faces."""

    color: np.ndarray  # linear RGB from 0 to 1, shape [3]; multiplies texture and corners
    texture: np.ndarray | None = None  # sRGB, shape [row column 3], uint8, first row on top; None without one
    wrap: tuple[str, str] = (REPEAT, REPEAT)  # of the texture, along u and v: REPEAT, CLAMP, MIRROR or BLACK


PLAIN = Material(to_linear(np.full(3, GREY / 255)))  # What has no colour, or lost it


@dataclass(frozen=True)
class Stated:
    """What a file states about its frame."""

    up: str | None = None  # "x", "y" or "z"; None where the format does not say
    unit: float | None = None  # metres a unit; None where the format does not say
    by: str = ""  # who says so ("glTF")


@dataclass(frozen=True)
class SourceMesh:
    """All triangles of a file in its order, node transforms applied."""

    vertices: np.ndarray  # in the file's unit, shape [vertex 3], float64
    faces: np.ndarray  # vertex indices, shape [face 3], int64
    uv: np.ndarray  # texture coordinates of the corners, v upwards, shape [face 3 2]; NaN where there are none
    colors: np.ndarray  # linear RGB of the corners, shape [face 3 3], 0 to 1, float32; NaN where there are none
    material: np.ndarray  # index into `materials`, shape [face]; -1 for none
    materials: tuple[Material, ...]  # the materials
    stated: Stated  # the file's own statement of frame and unit


def joined(parts: list[SourceMesh], stated: Stated) -> SourceMesh:
    """Return the meshes of one file as one, in their order."""
    vertex = np.cumsum([0] + [len(part.vertices) for part in parts])
    first = np.cumsum([0] + [len(part.materials) for part in parts])
    return SourceMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + vertex[i] for i, part in enumerate(parts)]),
        np.concatenate([part.uv for part in parts]),
        np.concatenate([part.colors for part in parts]),
        np.concatenate([np.where(part.material < 0, -1, part.material + first[i]) for i, part in enumerate(parts)]),
        tuple(material for part in parts for material in part.materials),
        stated,
    )


def colored(vertices: np.ndarray, faces: np.ndarray, colors: np.ndarray | None, stated: Stated) -> SourceMesh:
    """Return a mesh without textures, of vertices [vertex 3], faces [face 3] and sRGB of the vertices, 0 to 255, or None."""
    corners = np.full((len(faces), 3, 3), np.nan, np.float32) if colors is None else to_linear(colors[faces] / 255)
    uv, material = np.full((len(faces), 3, 2), np.nan), np.full(len(faces), -1)
    return SourceMesh(vertices.astype(np.float64), faces.astype(np.int64), uv, corners, material, (), stated)


def sample(
    mesh_uv: np.ndarray, corner_colors: np.ndarray, material: np.ndarray, materials: tuple[Material, ...]
) -> np.ndarray:
    """Return colours at points of faces: texture times factor times the corners' colour; grey where there is none of them.

    Args:
        mesh_uv: texture coordinates, shape [face point 2].
        corner_colors: linear RGB of the vertices there, shape [face point 3].
        material: shape [face].
        materials: the materials.

    Returns:
        sRGB from 0 to 255, shape [face point 3], float32.
    """
    plain = np.isnan(corner_colors)
    result = np.where(plain, np.float32(GREY), 255 * to_srgb(corner_colors))
    for index in np.unique(material[material >= 0]):
        mine, used = material == index, materials[index]
        light = used.color * np.where(plain[mine], 1.0, corner_colors[mine])
        if used.texture is None:
            result[mine] = 255 * to_srgb(light)
            continue
        uv = mesh_uv[mine]
        texels = bilinear(used.texture, np.nan_to_num(uv), used.wrap)
        if (light != 1).any():
            texels = 255 * to_srgb(to_linear(texels / 255) * light)
        result[mine] = np.where(np.isnan(uv).any(axis=-1, keepdims=True), 255 * to_srgb(light), texels)
    return result


def bilinear(texture: np.ndarray, uv: np.ndarray, wrap: tuple[str, str] = (REPEAT, REPEAT)) -> np.ndarray:
    """Return a texture's colours at coordinates [... 2], v upwards; shape [... 3], float32."""
    height, width = texture.shape[:2]
    uv = np.clip(uv, -_FARTHEST, _FARTHEST)
    # glTF, OBJ and USD alike: texel centres lie at half numbers.
    x, y = uv[..., 0] * width - 0.5, (1.0 - uv[..., 1]) * height - 0.5
    column, row = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    right, down = (x - column)[..., None].astype(np.float32), (y - row)[..., None].astype(np.float32)
    rows = [_wrapped(row + i, height, wrap[1]) for i in (0, 1)]
    columns = [_wrapped(column + j, width, wrap[0]) for j in (0, 1)]
    texture = np.pad(texture, ((0, 1), (0, 1), (0, 0))) if BLACK in wrap else texture
    at = [[texture[r, c].astype(np.float32) for c in columns] for r in rows]
    top, bottom = (line[0] * (1 - right) + line[1] * right for line in at)
    mixed: np.ndarray = top * (1 - down) + bottom * down
    return mixed


def _wrapped(texel: np.ndarray, count: int, wrap: str) -> np.ndarray:
    """Return the texels of an image that stand for those beyond it."""
    if wrap == CLAMP:
        return np.clip(texel, 0, count - 1)
    if wrap == BLACK:  # which the row behind the last one is
        return np.where((texel >= 0) & (texel < count), texel, count)
    if wrap == MIRROR:
        turned = texel % (2 * count)
        return np.where(turned < count, turned, 2 * count - 1 - turned)
    return texel % count


def endings() -> tuple[str, ...]:
    """Return the endings of the names of files that can be read."""
    return tuple(ending for reader in formats("s2a.scan.meshes") for ending in reader.ENDINGS)  # type: ignore[attr-defined]


def read(path: Path) -> SourceMesh:
    """Read all triangles of a mesh file, in its order, with its own statement of frame and unit.

    A missing texture or material file is a warning; its faces become grey.

    Raises:
        InputError: no such file, another format, a damaged or compressed one, no faces, a vertex in use is not finite.
    """
    mesh = read_unchecked(path)
    _check(path, mesh)
    return mesh


def read_unchecked(path: Path) -> SourceMesh:
    """Read a mesh file whose vertices may not be finite, and whose faces may name vertices that do not exist."""
    if not path.is_file():
        what = "is a folder" if path.is_dir() else "does not exist"
        raise InputError(f"mesh {str(path)!r} {what}; give one mesh file: {', '.join(endings())}")
    reader = next((each for each in formats("s2a.scan.meshes") if each.recognise(path)), None)
    if reader is None:
        raise InputError(f"mesh {str(path)!r}: the ending {path.suffix!r} is unknown; possible: {', '.join(endings())}")
    if not path.stat().st_size:
        raise InputError(f"{path}: is empty; copy or export it again")
    mesh: SourceMesh = reader.read(path)
    return mesh


def _check(path: Path, mesh: SourceMesh) -> None:
    """Raise an InputError for a mesh that holds nothing, or numbers that cannot be right."""
    if not len(mesh.faces):
        raise InputError(f"{path}: holds no faces; export a mesh, not a point cloud")
    if not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        wrong = mesh.faces.max() if mesh.faces.min() >= 0 else mesh.faces.min()
        raise InputError(f"{path}: a face names vertex {wrong} of {len(mesh.vertices)}; export it again")
    finite = np.isfinite(mesh.vertices).all(axis=1)[mesh.faces].all(axis=1)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        raise InputError(
            f"{path}: face {bad[0]} has a corner that is not finite ({len(bad)} such faces); remove them, or export it again"
        )
    if not np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max() > 0:
        raise InputError(f"{path}: all vertices lie in one point; export it again")


_FLAT = 1e-9  # fraction of a polygon's own size squared below which a triangle has no area


def triangulate(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut polygons into triangles, `count - 2` each, in the order of the polygons.

    Args:
        points: shape [vertex 3].
        counts: corners of each polygon, shape [polygon]; those with fewer than 3 give nothing.
        indices: vertices of the corners of all polygons, one after the other; those out of range make their polygon a fan.

    Returns:
        Positions in `indices` of the triangles' corners, shape [triangle 3], and the polygon of each triangle, shape [triangle].
    """
    counts = np.asarray(counts, dtype=np.int64)
    corners, polygon = _fans(counts)
    first = np.cumsum(counts) - counts
    start = np.concatenate([[0], np.cumsum(np.maximum(counts - 2, 0))])
    valid = np.append((indices >= 0) & (indices < len(points)), True)
    for count in np.unique(counts[counts > 3]):
        mine = np.flatnonzero(counts == count)
        places = first[mine][:, None] + np.arange(count)
        inside = valid[places].all(axis=1)
        mine, places = mine[inside], places[inside]
        outlines = points[indices[places]].astype(np.float64)
        fan = _smallest(outlines)
        if count == 4:  # there is one other way to cut
            turned = mine[_smallest(np.roll(outlines, -1, axis=1)) > np.maximum(fan, _FLAT)]
            turned = turned[fan[np.searchsorted(mine, turned)] <= _FLAT]
            for k, corner in enumerate([(1, 2, 3), (1, 3, 0)]):
                corners[start[turned] + k] = first[turned][:, None] + corner
            continue
        for each in np.flatnonzero(fan <= _FLAT):
            corners[start[mine[each]] : start[mine[each] + 1]] = places[each][ears(outlines[each])]
    return corners, polygon


def ears(outline: np.ndarray) -> np.ndarray:
    """Return the triangles of a polygon [corner 3] that need not be convex nor quite flat, as corners, shape [corner - 2, 3].

    Ear clipping (Meisters 1975), the best-shaped ear first. A polygon that crosses itself gets the triangles that are left over.
    """
    flat = _projected(outline)
    size = float(np.ptp(flat, axis=0).max()) ** 2
    left = list(range(len(flat)))
    triangles: list[tuple[int, ...]] = []
    while len(left) > 3:
        ring = flat[left]
        before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
        area = _cross(ring - before, after - ring)
        longest = np.maximum(np.sum((after - before) ** 2, axis=1), np.finfo(float).tiny)
        order = np.argsort(-area / longest)
        convex = next((i for i in order if area[i] > _FLAT * size and _is_ear(ring, i)), None)
        # Without an ear a corner on a straight line, or a spike, goes; a polygon that crosses itself loses any corner.
        level = [i for i in order if abs(area[i]) <= _FLAT * size]
        chosen = int((level or list(order))[0] if convex is None else convex)
        triangles.append((left[chosen - 1], left[chosen], left[(chosen + 1) % len(left)]))
        del left[chosen]
    triangles.append(tuple(left))
    return np.array(triangles)


def _fans(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners [triangle 3] of polygons with so many corners, and each triangle's polygon."""
    first = np.cumsum(counts) - counts
    many = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), many)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(many) - many, many)
    start = first[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def _smallest(outlines: np.ndarray) -> np.ndarray:
    """Return the smallest triangle of each fan, as a fraction of its polygon's area, shape [polygon].

    It is below 0 where the triangle looks the other way, and infinite for polygons without area, whose cut does not matter.
    """
    spokes = outlines[:, 1:] - outlines[:, :1]
    triangles = np.cross(spokes[:, :-1], spokes[:, 1:])
    normal = triangles.sum(axis=1)
    square = np.sum(normal**2, axis=1)
    facing = np.sum(triangles * normal[:, None], axis=2).min(axis=1)
    return np.where(square > 0, facing / np.where(square > 0, square, 1.0), np.inf)


def _projected(outline: np.ndarray) -> np.ndarray:
    """Return an outline in its own plane, counterclockwise, shape [corner 2]."""
    following = np.roll(outline - outline[0], -1, axis=0)
    normal = np.cross(outline - outline[0], following).sum(axis=0)  # Newell
    length = np.linalg.norm(normal)
    if not length > 0:
        return np.asarray(outline[:, :2] - outline[0, :2])
    normal /= length
    aside = np.eye(3)[np.abs(normal).argmin()]
    u = np.cross(aside, normal)
    u /= np.linalg.norm(u)
    return np.asarray((outline - outline[0]) @ np.stack([u, np.cross(normal, u)], axis=1))


def _is_ear(ring: np.ndarray, corner: int) -> bool:
    """Return whether no other corner of a ring [corner 2] lies in the triangle at a corner, or on its sides."""
    a, b, c = ring[corner - 1], ring[corner], ring[(corner + 1) % len(ring)]
    others = ring[~((ring == a).all(axis=1) | (ring == b).all(axis=1) | (ring == c).all(axis=1))]
    sides = [_cross(q - p, others - p) >= 0 for p, q in ((a, b), (b, c), (c, a))]
    return not np.logical_and.reduce(sides).any()


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
