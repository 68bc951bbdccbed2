"""A texture as colours of vertices: triangles are split until their corners are close enough for what the texture shows.

A room's parts carry colours on their vertices, and so do the objects that are added to it: they are rendered, weighed and
simulated with one kind of surface.
"""

from __future__ import annotations

import numpy as np
import trimesh
from PIL import Image

SHOWN = 12.0
"""Difference of a texture from the colour between the corners, of 255, at which a triangle is split."""
EDGE = 2.0
"""Texels along a triangle's longest edge below which it is not split."""
ROUNDS = 7
"""Splits of a triangle, each into four."""
WEIGHTS = np.array([[1, 1, 0], [0, 1, 1], [1, 0, 1]]) / 2
"""Middles of a triangle's edges, where the texture is compared; its middle is compared too."""


def textured(shape: trimesh.Trimesh, budget: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the vertices [vertex 3], triangles [face 3] and colours [vertex 3], uint8, of a shape with a texture.

    Args:
        shape: as trimesh reads it, with texture coordinates.
        budget: largest number of triangles.

    Returns:
        None if it has no texture coordinates or no image.
    """
    uv, image = getattr(shape.visual, "uv", None), _image(shape)
    if uv is None or image is None or len(uv) != len(shape.vertices):
        return None
    vertices, faces, uv = np.asarray(shape.vertices, np.float64), np.asarray(shape.faces), np.asarray(uv, np.float64)
    if uv.min(initial=0.0) >= 0.0 and uv.max(initial=1.0) <= 1.0:
        # What does not repeat has no colours of the opposite border at its own.
        half = 0.5 / np.array(image.shape[1::-1])
        uv = np.clip(uv, half, 1.0 - half)
    for _ in range(ROUNDS):
        rough = _rough(faces, uv, image)
        room = (budget - len(faces)) // 3
        if not rough.any() or room < 1:
            break
        # All or none where they do not fit: an even picture is better than a sharp corner of it.
        if rough.sum() > room:
            break
        vertices, faces, uv = _split(vertices, faces, uv, rough)
    return vertices, faces, np.round(_sampled(image, uv)).astype(np.uint8)


def _image(shape: trimesh.Trimesh) -> np.ndarray | None:
    """Return a shape's texture in RGB, shape [row column 3]; None if it has none."""
    material = getattr(shape.visual, "material", None)
    image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    if not isinstance(image, Image.Image):
        return None
    pixels = np.asarray(image.convert("RGB"), np.float64)
    factor = getattr(material, "baseColorFactor", None)
    if factor is not None:
        values = np.asarray(factor, np.float64)[:3]
        pixels = pixels * (values / 255.0 if values.max() > 1.0 else values)
    return pixels


def _sampled(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Return the colours at texture coordinates [point 2], repeated beyond 0 to 1, v upwards, shape [point 3]."""
    rows, columns = image.shape[:2]
    place = np.stack([(1.0 - uv[:, 1]) * rows - 0.5, uv[:, 0] * columns - 0.5], axis=1)
    low = np.floor(place).astype(int)
    part = place - low
    found = np.zeros((len(uv), 3))
    for down in (0, 1):
        for right in (0, 1):
            share = np.abs(1 - down - part[:, 0]) * np.abs(1 - right - part[:, 1])
            found += share[:, None] * image[(low[:, 0] + down) % rows, (low[:, 1] + right) % columns]
    return found


def _rough(faces: np.ndarray, uv: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Return which triangles the texture differs in from the colours between their corners, shape [face]."""
    corners = uv[faces]
    texels = (corners - np.roll(corners, 1, axis=1)) * image.shape[1::-1]
    long = np.linalg.norm(texels, axis=2).max(axis=1) > EDGE
    found = np.zeros(len(faces), bool)
    colors = _sampled(image, corners[long].reshape(-1, 2)).reshape(-1, 3, 3)
    off = np.zeros(len(colors))
    for weights in (*WEIGHTS, *_inner()):
        there = _sampled(image, np.einsum("c,fcd->fd", weights, corners[long]))
        off = np.maximum(off, np.abs(there - np.einsum("c,fcd->fd", weights, colors)).max(axis=1))
    found[long] = off > SHOWN
    return found


def _inner() -> np.ndarray:
    """Return barycentric coordinates inside a triangle, fixed ones: a picture may hide between the middles of edges."""
    return np.random.default_rng(0).dirichlet(np.ones(3), 24)


def _split(
    vertices: np.ndarray, faces: np.ndarray, uv: np.ndarray, some: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a mesh in which some triangles are four, and their neighbours are split so that no crack opens."""
    # Along a seam of the texture two vertices are in one place: both sides are split, or a crack would open.
    place = np.unique(vertices, axis=0, return_inverse=True)[1].ravel()
    joined, own = _edges(place[faces], len(vertices)), _edges(faces, len(vertices))
    is_cut = np.isin(joined, joined[some])
    cut = np.unique(own[is_cut])
    new = len(vertices) + np.searchsorted(cut, own)
    first, second = cut // len(vertices), cut % len(vertices)
    vertices = np.concatenate([vertices, (vertices[first] + vertices[second]) / 2])
    uv = np.concatenate([uv, (uv[first] + uv[second]) / 2])
    found = [faces[~is_cut.any(axis=1)]]
    for count in (1, 2, 3):
        found += _pieces(faces, new, is_cut, count)
    return vertices, np.concatenate(found), uv


def _edges(faces: np.ndarray, count: int) -> np.ndarray:
    """Return a number for each edge of triangles, whatever its direction, shape [face 3]."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).astype(np.int64)
    return np.asarray(edges[..., 0] * count + edges[..., 1])


def _pieces(faces: np.ndarray, new: np.ndarray, is_cut: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the pieces of the triangles that have some number of cut edges."""
    chosen = np.flatnonzero(is_cut.sum(axis=1) == count)
    if count == 3:
        (a, b, c), (ab, bc, ca) = faces[chosen].T, new[chosen].T
        return [np.stack(piece, 1) for piece in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    # Turned so that the edge from the first corner is cut (of two, the other is the next one).
    flags = is_cut[chosen]
    shift = np.argmax(flags & np.roll(flags, -1, axis=1) if count == 2 else flags, axis=1)
    turn = (shift[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, _) = (np.take_along_axis(table[chosen], turn, axis=1).T for table in (faces, new))
    pieces = ((a, ab, c), (ab, b, c)) if count == 1 else ((ab, b, bc), (a, ab, bc), (a, bc, c))
    return [np.stack(piece, 1) for piece in pieces]
