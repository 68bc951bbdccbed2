"""The data of a page: parts with their surfaces, and what moves with which joint; the same for scans and all stages."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from s2a.scene.articulation import transform
from s2a.scene.scene import Joint, Mesh, Motion

GOLDEN = 0.618
"""Steps of the golden section around the circle of hues keep neighbours apart, however many there are."""
SATURATION, VALUE = 0.55, 0.95


def hue(number: int) -> tuple[int, int, int]:
    """Return the sRGB colour of the item with this number, 0 to 255."""
    red, green, blue = colorsys.hsv_to_rgb(number * GOLDEN % 1.0, SATURATION, VALUE)
    return int(255 * red), int(255 * green), int(255 * blue)


@dataclass(frozen=True)
class PagePart:
    """One row of the page's tree.

    Attributes:
        label: the annotator's name for it.
        surface: its mesh in scene coordinates, at the scanned pose; may be empty.
        parent: id of the part that it belongs to, or None.
        mover: id of the jointed part that it moves with, itself included; None for what stands still.
        motion: "fixed", "free" or its Joint.
        mass: [kg], or None where nothing says it.
    """

    label: str
    surface: Mesh
    parent: str | None = None
    mover: str | None = None
    motion: Motion = "fixed"
    mass: float | None = None


@dataclass(frozen=True)
class Extra:
    """What a layer other than the surfaces shows of a part.

    Attributes:
        part: id of the part.
        mover: id of the jointed part that it moves with, or None.
        mesh: in scene coordinates, at the scanned pose.
        structure: It is of a wall, the floor or the ceiling.
    """

    part: str
    mover: str | None
    mesh: Mesh
    structure: bool = False


@dataclass(frozen=True)
class RobotStand:
    """Where a robot stands to open a part.

    Attributes:
        part: id of the part.
        position: of its base [m], scene coordinates, shape [3].
        shoulder: of the axis about which the arm lifts first [m], scene coordinates, shape [3].
        reach: of the stretched arm, from the shoulder to the gripper body [m].
        radius: of the column that base and shoulder fill [m].
        free: The arm reaches along the part's whole path, and collides with nothing.
    """

    part: str
    position: np.ndarray
    shoulder: np.ndarray
    reach: float
    radius: float
    free: bool


@dataclass(frozen=True)
class PageRoom:
    """Everything that a page shows.

    Attributes:
        name: the scan's name.
        parts: every part by its id, parents before children.
        carriers: for each jointed part, the id of the jointed part that it hangs on, or None.
        colliders: convex hulls; none but in a simulation-ready stage.
        grasps: where a gripper grasps each jointed part.
        stands: where a robot stands to open the jointed parts; none but in a simulation-ready stage.
        boxes: The surfaces are the boxes of a description, which are shown translucent.
        notes: what a validation report or an insertion says of parts, by their ids: names and values.
        inserted: ids of the objects that an insertion put there, in its order; their notes are its steps.
    """

    name: str
    parts: dict[str, PagePart]
    carriers: dict[str, str | None]
    colliders: tuple[Extra, ...] = ()
    grasps: tuple[Extra, ...] = ()
    boxes: bool = False
    notes: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    inserted: tuple[str, ...] = ()
    stands: tuple[RobotStand, ...] = ()

    @cached_property
    def joints(self) -> dict[str, Joint]:
        """The joints by the ids of the parts that they move."""
        return {i: part.motion for i, part in self.parts.items() if isinstance(part.motion, Joint)}

    @cached_property
    def faces(self) -> int:
        """Number of faces of all surfaces."""
        return sum(len(part.surface.faces) for part in self.parts.values())

    @cached_property
    def children(self) -> dict[str | None, tuple[str, ...]]:
        """Ids of the direct children of every part; of None: the parts that belong to no other."""
        found: dict[str | None, list[str]] = {}
        for part_id, part in self.parts.items():
            found.setdefault(part.parent, []).append(part_id)
        return {i: tuple(c) for i, c in found.items()}

    def with_inserted(self, ids: tuple[str, ...]) -> PageRoom:
        """Return the room with objects that an insertion put there, which can be hidden: each moves with itself."""
        return replace(self.with_movers(ids), inserted=tuple(i for i in ids if i in self.parts))

    def with_movers(self, ids: Iterable[str]) -> PageRoom:
        """Return the room with some parts that stand still, or free objects, each as something that moves with itself."""
        still = [i for i in ids if i in self.parts and self.parts[i].mover is None]
        return replace(self, parts=self.parts | {i: replace(self.parts[i], mover=i) for i in still})

    def poses(self, q: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Return the displacement [4 4] of every jointed part: scene pose = displacement @ scanned pose.

        Args:
            q: joint coordinates by part [m] or [rad]; 0 where none is given.
        """
        return {part: self.pose(part, q) for part in self.joints}

    def pose(self, mover: str | None, q: Mapping[str, float]) -> np.ndarray:
        """Return the displacement [4 4] of what moves with a jointed part; the identity for None."""
        found = np.eye(4)
        while mover is not None:
            found = transform(self.joints[mover], q.get(mover, 0.0)) @ found
            mover = self.carriers[mover]
        return found

    def carried(self, mover: str) -> tuple[str, ...]:
        """Return the ids of the jointed parts that a joint moves: its own, and those that hang on it."""
        return tuple(i for i in self.joints if mover in self._chain(i))

    def _chain(self, mover: str) -> tuple[str, ...]:
        carrier = self.carriers[mover]
        return (mover, *(self._chain(carrier) if carrier else ()))


@dataclass
class Coordinates:
    """Where the joints of a page stand.

    Attributes:
        room: the page's data.
        q: joint coordinates by part [m] or [rad]; the scanned pose where none is given.
        moved: displacements [4 4] of free objects that have a mover of their own, by their ids.
    """

    room: PageRoom
    q: dict[str, float] = field(default_factory=dict)
    moved: dict[str, np.ndarray] = field(default_factory=dict)

    def set(self, part: str, shown: float) -> None:
        """Move a joint to a coordinate in the units that people read [mm] or [deg]."""
        self.q[part] = shown * unit(self.room.joints[part])[1]

    def pose(self, mover: str | None) -> np.ndarray:
        """Return the displacement [4 4] of what moves with a jointed part."""
        if mover is not None and mover not in self.room.joints:
            return self.moved.get(mover, np.eye(4))
        return self.room.pose(mover, self.q)


def unit(joint: Joint) -> tuple[str, float]:
    """Return the unit that people read a joint's coordinate in, and its size in [m] or [rad]."""
    return ("mm", 1e-3) if joint.kind == "prismatic" else ("deg", float(np.pi / 180.0))


@dataclass(frozen=True)
class PlayedWorld:
    """One world.

    Attributes:
        name: what the page calls it.
        q: joint coordinates by part [m] or [rad], shape [frame].
        moved: displacement of each free object by its id: scene pose = displacement @ scanned pose, shape [frame 4 4].
        links: poses of the robot's links: position [m], quaternion xyzw, scene frame, shape [frame link 7].
    """

    name: str
    q: Mapping[str, np.ndarray]
    moved: Mapping[str, np.ndarray]
    links: np.ndarray

    @property
    def frames(self) -> int:
        """Number of frames; the last one stays."""
        return len(self.links)


@dataclass(frozen=True)
class Played:
    """Worlds that are shown side by side.

    Attributes:
        rate: frames a second.
        links: surfaces of the robot's links, each in its own frame.
        worlds: all of them are in the same room.
    """

    rate: float
    links: tuple[Mesh, ...]
    worlds: tuple[PlayedWorld, ...]

    @property
    def frames(self) -> int:
        """Number of frames of the longest."""
        return max(world.frames for world in self.worlds)
