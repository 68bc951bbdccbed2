"""The vocabulary of the project: Mesh, Joint, Part, Scene, and what always holds for them.

World frame: z up, metres, radians, seconds, kilograms. A joint's coordinate 0 is the pose in which the room was scanned.
"""

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from s2a.core.cache import Arrays
from s2a.core.errors import InputError

UNANNOTATED = "unannotated"  # label of the part that takes the faces nobody annotated


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
        blocks = [np.linalg.norm(cross, axis=1) for cross in crosses(self.vertices, self.faces)]
        return 0.5 * np.concatenate([np.zeros(0), *blocks])

    @cached_property
    def bounds(self) -> np.ndarray:
        """Smallest and largest corner [m], shape [2 3], float64; nan for a mesh without vertices."""
        if not len(self.vertices):
            return np.full((2, 3), np.nan)
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)]).astype(np.float64)


BLOCK = 1 << 14  # Triangles whose corners are in double precision at a time: those of a whole scan take 200 bytes each


def crosses(vertices: np.ndarray, faces: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the cross products of two sides of triangles [face 3], twice their area long, BLOCK after BLOCK, float64."""
    for start in range(0, len(faces), BLOCK):
        a, b, c = np.moveaxis(vertices[faces[start : start + BLOCK]].astype(np.float64), 1, 0)
        yield np.cross(b - a, c - a)


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


__all__ = ["Joint", "Mesh", "Motion", "Part", "Scene", "Vec3"]

Vec3 = tuple[float, float, float]
HANDLE_GAP = 0.03  # [m] Grasp parts nearer to each other than this are one handle, such as a bar and its posts


@dataclass(frozen=True)
class Joint:
    """The joint of a part with its parent.

    Attributes:
        kind: "prismatic" (slides along the axis) or "revolute" (turns about the axis, right-handed).
        axis: unit direction in scene coordinates.
        origin: a point on the axis [m], scene coordinates.
        limits: lowest and highest coordinate, [m] or [rad], relative to the scanned pose.

    Raises:
        ValueError: unknown kind, axis not of unit length, limits not finite or in the wrong order.
    """

    kind: Literal["prismatic", "revolute"]
    axis: Vec3
    origin: Vec3
    limits: tuple[float, float]

    def __post_init__(self) -> None:
        if self.kind not in ("prismatic", "revolute"):
            raise ValueError(f"joint kind {self.kind!r}; possible: prismatic, revolute")
        for name, length in (("axis", 3), ("origin", 3), ("limits", 2)):
            value = tuple(float(x) for x in getattr(self, name))
            if len(value) != length or not all(map(math.isfinite, value)):
                raise ValueError(f"joint {name} {value} is not {length} finite numbers")
            object.__setattr__(self, name, value)
        if abs(math.hypot(*self.axis) - 1.0) > 1e-9:
            raise ValueError(f"joint axis {self.axis} is not of unit length")
        if self.limits[0] > self.limits[1]:
            raise ValueError(f"joint limits {self.limits}: lower is above upper")


Motion = Joint | Literal["fixed", "free"]


@dataclass(frozen=True)
class Part:
    """One annotated part of the scan, with its own surface, without its children's."""

    label: str  # name given by the annotator ("handle base")
    mesh: Mesh  # its surface in scene coordinates; may be empty
    parent: str | None = None  # id of the part it belongs to, or None for an object
    motion: Motion = "fixed"  # "fixed" to its parent, "free", or its Joint
    graspable: bool = False  # Annotated as the place where a gripper grasps the moving part
    mass: float | None = None  # [kg] if annotated, else None


@dataclass(frozen=True)
class Scene:
    """A room: its parts by id ("drawer_7": the label's name, then the annotation's number), parents before children.

    Attributes:
        name: the scan's name.
        parts: every part by its id.
        origin: translation [m] that the reader took off all coordinates, in float64, where a scan lies far from its zero point;
            scan coordinates = scene coordinates + origin.

    Raises:
        ValueError: a parent that is missing or comes after its child.
    """

    name: str
    parts: dict[str, Part]
    origin: Vec3 = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        seen: set[str] = set()
        for part_id, part in self.parts.items():
            if part.parent is not None and part.parent not in seen:
                raise ValueError(f"part {part_id!r}: its parent {part.parent!r} is missing or comes after it")
            seen.add(part_id)

    def part(self, part_id: str) -> Part:
        """Return a part, or raise an InputError that names the closest ids, if any is close."""
        if part_id in self.parts:
            return self.parts[part_id]
        near = ", ".join(difflib.get_close_matches(part_id, self.parts, n=3))
        remedy = f"did you mean: {near}" if near else "s2a view path=STAGE lists its parts"
        raise InputError(f"part {part_id!r} is not in scene {self.name!r}; {remedy}")

    def joint(self, part_id: str) -> Joint:
        """Return the joint of a movable part, or raise an InputError that lists the movable ones."""
        motion = self.part(part_id).motion
        if isinstance(motion, Joint):
            return motion
        raise InputError(
            f"part {part_id!r} of scene {self.name!r} does not move; jointed parts: {', '.join(self.movable) or 'none'}"
        )

    @cached_property
    def movable(self) -> tuple[str, ...]:
        """Ids of the parts with a joint of their own."""
        return tuple(i for i, part in self.parts.items() if isinstance(part.motion, Joint))

    @cached_property
    def children(self) -> dict[str, tuple[str, ...]]:
        """Ids of the direct children of every part."""
        ids: dict[str, list[str]] = {i: [] for i in self.parts}
        for part_id, part in self.parts.items():
            if part.parent is not None:
                ids[part.parent].append(part_id)
        return {i: tuple(c) for i, c in ids.items()}

    def descendants(self, part_id: str) -> tuple[str, ...]:
        """Ids of everything below a part, parents before children."""
        below: list[str] = []
        waiting = [*reversed(self.children[part_id])]  # no recursion: chains may be longer than a stack is deep
        while waiting:
            below.append(waiting.pop())
            waiting += reversed(self.children[below[-1]])
        return tuple(below)

    def ancestors(self, part_id: str) -> tuple[str, ...]:
        """Ids of what a part belongs to, its parent first."""
        above: list[str] = []
        while (parent := self.parts[above[-1] if above else part_id].parent) is not None:
            above.append(parent)
        return tuple(above)

    def depth(self, part_id: str) -> int:
        """Number of ancestors of a part."""
        return len(self.ancestors(part_id))

    def root(self, part_id: str) -> str:
        """Id of the object a part belongs to."""
        return (part_id, *self.ancestors(part_id))[-1]

    def body(self, part_id: str) -> str | None:
        """Id of the rigid body a part belongs to; None if it is part of the immovable room.

        A body is a jointed part with its unjointed descendants, or the object (root part) that carries jointed parts, with
        all its unjointed parts above them: the cabinet body.
        """
        line = (part_id, *self.ancestors(part_id))
        for i in line:
            if self.parts[i].motion != "fixed":
                return i
        return line[-1] if line[-1] in self._carriers else None

    def parent_body(self, part_id: str) -> str | None:
        """Id of the body that a jointed part moves against; None if it has no parent part."""
        parent = self.part(part_id).parent
        return None if parent is None else self.body(parent)

    def members(self, body_id: str) -> tuple[str, ...]:
        """Ids of the parts that make up a body, itself first."""
        return self._members.get(body_id, ())

    @cached_property
    def _carriers(self) -> frozenset[str]:
        """Objects (root parts) with a jointed part below."""
        return frozenset(
            self.root(i) for i, part in self.parts.items() if isinstance(part.motion, Joint) and part.parent
        )

    @cached_property
    def _members(self) -> dict[str, tuple[str, ...]]:
        """Parts of each body, in the scene's order: one pass over the room, since many ask."""
        members: dict[str, list[str]] = {}
        for i in self.parts:
            if (body := self.body(i)) is not None:
                members.setdefault(body, []).append(i)
        return {body: tuple(parts) for body, parts in members.items()}

    def grasp_parts(self, part_id: str) -> tuple[str, ...]:
        """Ids of the grasp region of a movable part: its deepest graspable descendants, or itself if it has none.

        What is below another jointed part is that one's.
        """
        below = [i for i in self.descendants(part_id) if self.parts[i].graspable and self.body(i) == self.body(part_id)]
        if not below:
            return (part_id,)
        deepest = max(self.depth(i) for i in below)
        return tuple(i for i in below if self.depth(i) == deepest)

    def handle_parts(self, part_id: str) -> tuple[str, ...]:
        """Ids of the grasp parts that make up one handle: the largest of several, with what is nearer to it than HANDLE_GAP."""
        parts = self.grasp_parts(part_id)
        if len(parts) == 1:
            return parts
        rest = sorted(parts, key=lambda i: -self.parts[i].mesh.face_areas.sum())
        held = [rest.pop(0)]
        while near := [i for i in rest if any(self._gap(i, j) < HANDLE_GAP for j in held)]:
            held += near
            rest = [i for i in rest if i not in near]
        return tuple(i for i in parts if i in held)

    def _gap(self, one: str, other: str) -> float:
        """Distance between the bounding boxes of two parts [m]; inf where one has no surface."""
        meshes = self.parts[one].mesh, self.parts[other].mesh
        if not all(len(mesh.faces) for mesh in meshes):
            return float("inf")
        (low, high), (other_low, other_high) = (mesh.bounds for mesh in meshes)
        return float(np.linalg.norm(np.maximum(np.maximum(low - other_high, other_low - high), 0.0)))

    def grasp_point(self, part_id: str) -> np.ndarray:
        """Mean of the surface of a part's handle [m], shape [3], float64 (area-weighted: scans are unevenly dense)."""
        meshes = [self.parts[i].mesh for i in self.handle_parts(part_id)]
        areas = np.concatenate([mesh.face_areas for mesh in meshes])
        if not areas.sum() > 0:
            raise InputError(f"part {part_id!r} of scene {self.name!r} has no surface to grasp; annotate its faces")
        centroids = np.concatenate([mesh.vertices[mesh.faces].mean(axis=1, dtype=np.float64) for mesh in meshes])
        return np.average(centroids, axis=0, weights=areas)


# No drawer is longer [m], no door turns further [rad]; degrees read as radians are
WIDEST = {"prismatic": 3.0, "revolute": 2.0 * math.pi}
NARROWEST = 0.01  # Smallest range of a joint [m or rad] that is worth a robot
# Of a part [kg], and of a point [m]: scans may lie far from their zero point, as maps do
MAX_MASS, MAX_COORDINATE = 1e5, 1e7
UNITS = {"prismatic": "m", "revolute": "rad"}


def problems(kind: str, low: float, high: float) -> list[str]:
    """Return in words what is wrong with a joint's limits; nothing for those that a robot can move it between.

    `low` and `high` are coordinates [m] or [rad] relative to the scanned pose; they may be NaN.
    """
    unit, texts = UNITS[kind], []
    if not low <= 0.0 <= high:
        texts.append(f"limits {low:g} to {high:g} {unit} do not hold 0, the scanned pose")
    if not NARROWEST <= high - low <= WIDEST[kind]:
        texts.append(f"a range of {high - low:g} {unit}, possible: {NARROWEST:g} to {WIDEST[kind]:g} {unit}")
    return texts
