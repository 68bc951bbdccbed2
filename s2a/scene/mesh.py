"""Triangle meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from s2a.core.cache import Arrays


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh in scene coordinates.

    Attributes:
        vertices: [m], shape [vertex 3], float32 (the precision of scans and of USD points).
        faces: vertex indices, shape [face 3], int32.
        colors: RGB, shape [vertex 3], uint8, or None.

    Raises:
        ValueError: wrong shape, a non-finite coordinate, an index out of range.
    """

    vertices: np.ndarray
    faces: np.ndarray
    colors: np.ndarray | None = None

    def __post_init__(self) -> None:
        _freeze(self, "vertices", np.float32, "[vertex 3]")
        _freeze(self, "faces", np.int32, "[face 3]")
        if self.colors is not None:
            _freeze(self, "colors", np.uint8, "[vertex 3]")
            if len(self.colors) != len(self.vertices):
                raise ValueError(f"{len(self.colors)} colors for {len(self.vertices)} vertices")
        if not np.isfinite(self.vertices).all():
            raise ValueError("a vertex coordinate is not finite")
        if len(self.faces) and not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise ValueError(
                f"face indices {self.faces.min()} to {self.faces.max()} do not fit {len(self.vertices)} vertices"
            )

    def __eq__(self, other: object) -> bool:
        """Whether both meshes hold the same arrays, bit for bit."""
        if not isinstance(other, Mesh):
            return NotImplemented
        if self.colors is None or other.colors is None:
            same_colors = self.colors is other.colors
        else:
            same_colors = np.array_equal(self.colors, other.colors)
        same_shape = np.array_equal(self.vertices, other.vertices) and np.array_equal(self.faces, other.faces)
        return same_colors and same_shape

    __hash__ = None  # type: ignore[assignment]

    @cached_property
    def face_areas(self) -> np.ndarray:
        """Area of each triangle [m^2], shape [face], float64."""
        a, b, c = np.moveaxis(self.vertices[self.faces].astype(np.float64), 1, 0)
        return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)

    @cached_property
    def bounds(self) -> np.ndarray:
        """Smallest and largest corner [m], shape [2 3], float64; nan for a mesh without vertices."""
        if not len(self.vertices):
            return np.full((2, 3), np.nan)
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)]).astype(np.float64)


def _freeze(mesh: Mesh, name: str, dtype: np.typing.DTypeLike, shape: str) -> None:
    """Store an attribute of a mesh as a read-only array [n 3] of the given type."""
    array: np.ndarray = np.array(getattr(mesh, name), dtype=dtype)
    if array.size == 0:
        array = array.reshape(0, 3)
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} has shape {array.shape}, expected {shape}")
    array.setflags(write=False)
    object.__setattr__(mesh, name, array)


def pack(meshes: Sequence[Mesh]) -> Arrays:
    """Return meshes as named arrays."""
    arrays: Arrays = {"count": np.array(len(meshes))}
    for k, mesh in enumerate(meshes):
        arrays |= {f"vertices_{k}": mesh.vertices, f"faces_{k}": mesh.faces}
        arrays |= {} if mesh.colors is None else {f"colors_{k}": mesh.colors}
    return arrays


def unpack(arrays: Mapping[str, np.ndarray]) -> list[Mesh]:
    """Return the meshes that `pack` packed."""
    names = [[f"{name}_{k}" for name in ("vertices", "faces", "colors")] for k in range(int(arrays["count"]))]
    return [Mesh(arrays[v], arrays[f], arrays.get(c)) for v, f, c in names]
