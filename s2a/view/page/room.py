"""The data of a page: parts with their surfaces, and what moves with which joint; the same for scans and all stages."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from s2a.core import config
from s2a.scan import visuals
from s2a.scene import artefacts
from s2a.scene.artefacts import DATASET, Artefact
from s2a.scene.articulation import transform
from s2a.scene.geometry.mesh_ops import keep
from s2a.scene.scene import Joint, Mesh, Motion, Scene
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimBody, SimRoom, in_scene

GOLDEN = 0.618  # Steps of the golden section around the circle of hues keep neighbours apart, however many there are
SATURATION, VALUE = 0.55, 0.95


def hue(number: int) -> tuple[int, int, int]:
    """Return the sRGB colour of the item with this number, 0 to 255."""
    red, green, blue = colorsys.hsv_to_rgb(number * GOLDEN % 1.0, SATURATION, VALUE)
    return int(255 * red), int(255 * green), int(255 * blue)


@dataclass(frozen=True)
class PagePart:
    """One row of the page's tree."""

    label: str  # the annotator's name for it
    surface: Mesh  # its mesh in scene coordinates, at the scanned pose; may be empty
    parent: str | None = None  # id of the part that it belongs to, or None
    mover: str | None = None  # id of the jointed part that it moves with, itself included; None for what stands still
    motion: Motion = "fixed"  # "fixed", "free" or its Joint
    mass: float | None = None  # [kg], or None where nothing says it


@dataclass(frozen=True)
class Extra:
    """What a layer other than the surfaces shows of a part."""

    part: str  # id of the part
    mover: str | None  # id of the jointed part that it moves with, or None
    mesh: Mesh  # in scene coordinates, at the scanned pose
    structure: bool = False  # It is of a wall, the floor or the ceiling


@dataclass(frozen=True)
class RobotStand:
    """Where a robot stands to open a part."""

    part: str  # id of the part
    position: np.ndarray  # of its base [m], scene coordinates, shape [3]
    shoulder: np.ndarray  # of the axis about which the arm lifts first [m], scene coordinates, shape [3]
    reach: float  # of the stretched arm, from the shoulder to the gripper body [m]
    radius: float  # of the column that base and shoulder fill [m]
    free: bool  # The arm reaches along the part's whole path, and collides with nothing


@dataclass(frozen=True)
class PageRoom:
    """Everything that a page shows."""

    name: str  # the scan's name
    parts: dict[str, PagePart]  # every part by its id, parents before children
    carriers: dict[str, str | None]  # for each jointed part, the id of the jointed part that it hangs on, or None
    colliders: tuple[Extra, ...] = ()  # convex hulls; none but in a simulation-ready stage
    grasps: tuple[Extra, ...] = ()  # where a gripper grasps each jointed part
    boxes: bool = False  # The surfaces are the boxes of a description, which are shown translucent
    # what a validation report or an insertion says of parts, by their ids: names and values
    notes: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    # ids of the objects that an insertion put there, in its order; their notes are its steps
    inserted: tuple[str, ...] = ()
    # where a robot stands to open the jointed parts; none but in a simulation-ready stage
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
        children: dict[str | None, list[str]] = {}
        for part_id, part in self.parts.items():
            children.setdefault(part.parent, []).append(part_id)
        return {i: tuple(c) for i, c in children.items()}

    def with_inserted(self, ids: tuple[str, ...]) -> PageRoom:
        """Return the room with objects that an insertion put there, which can be hidden: each moves with itself."""
        return replace(self.with_movers(ids), inserted=tuple(i for i in ids if i in self.parts))

    def with_movers(self, ids: Iterable[str]) -> PageRoom:
        """Return the room with some parts that stand still, or free objects, each as something that moves with itself."""
        still = [i for i in ids if i in self.parts and self.parts[i].mover is None]
        return replace(self, parts=self.parts | {i: replace(self.parts[i], mover=i) for i in still})

    def poses(self, q: Mapping[str, float]) -> dict[str, np.ndarray]:
        """Return the displacement [4 4] of every jointed part: scene pose = displacement @ scanned pose.

        `q`: joint coordinates by part [m] or [rad]; 0 where none is given.
        """
        return {part: self.pose(part, q) for part in self.joints}

    def pose(self, mover: str | None, q: Mapping[str, float]) -> np.ndarray:
        """Return the displacement [4 4] of what moves with a jointed part; the identity for None."""
        pose = np.eye(4)
        while mover is not None:
            pose = transform(self.joints[mover], q.get(mover, 0.0)) @ pose
            mover = self.carriers[mover]
        return pose

    def carried(self, mover: str) -> tuple[str, ...]:
        """Return the ids of the jointed parts that a joint moves: its own, and those that hang on it."""
        return tuple(i for i in self.joints if mover in self._chain(i))

    def _chain(self, mover: str) -> tuple[str, ...]:
        carrier = self.carriers[mover]
        return (mover, *(self._chain(carrier) if carrier else ()))


@dataclass
class Coordinates:
    """Where the joints of a page stand."""

    room: PageRoom  # the page's data
    # joint coordinates by part [m] or [rad]; the scanned pose where none is given
    q: dict[str, float] = field(default_factory=dict)
    # displacements [4 4] of free objects that have a mover of their own, by their ids
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
    """One world."""

    name: str  # what the page calls it
    q: Mapping[str, np.ndarray]  # joint coordinates by part [m] or [rad], shape [frame]
    # displacement of each free object by its id: scene pose = displacement @ scanned pose, shape [frame 4 4]
    moved: Mapping[str, np.ndarray]
    links: np.ndarray  # poses of the robot's links: position [m], quaternion xyzw, scene frame, shape [frame link 7]

    @property
    def frames(self) -> int:
        """Number of frames; the last one stays."""
        return len(self.links)


@dataclass(frozen=True)
class Played:
    """Worlds that are shown side by side."""

    rate: float  # frames a second
    links: tuple[Mesh, ...]  # surfaces of the robot's links, each in its own frame
    worlds: tuple[PlayedWorld, ...]  # all of them are in the same room

    @property
    def frames(self) -> int:
        """Number of frames of the longest."""
        return max(world.frames for world in self.worlds)


THINNEST = 1e-3  # [m] Of a box that is shown


def read(path: Path) -> PageRoom:
    """Read a scan's folder, a stage, or another artefact with a room (`s2a.scene.artefacts`).

    Raises:
        InputError: another file, or a damaged one.
    """
    match visuals.read(path):
        case Scene() as scene:
            return of_scene(scene)
        case SimRoom() as room:
            return of_sim_room(room)
        case parts:
            return of_description(path.stem, parts)


def of_scene(scene: Scene) -> PageRoom:
    """Return the page of a scene."""
    movers = {i: _moving(scene, scene.body(i)) for i in scene.parts}
    return PageRoom(
        scene.name,
        {
            i: PagePart(part.label, part.mesh, part.parent, movers[i], part.motion, part.mass)
            for i, part in scene.parts.items()
        },
        {i: _moving(scene, scene.parent_body(i)) for i in scene.movable},
        grasps=tuple(
            Extra(i, i, scene.parts[handle].mesh)
            for i in scene.movable
            for handle in scene.handle_parts(i)
            if handle != i  # else it has none
        ),
    )


def of_sim_room(room: SimRoom) -> PageRoom:
    """Return the page of a simulation-ready room."""
    bodies = {i: body for i, body in room.bodies.items() if len(body.visual.faces) or body.colliders}
    shown = {i: _body(room, body, bodies) for i, body in (bodies | room.free).items()}
    return PageRoom(
        room.name,
        shown | {i: PagePart(label_of(i), mesh) for i, mesh in _static(room).items() if i not in shown},
        {i: part.parent if part.parent in room.articulations else None for i, part in room.articulations.items()},
        tuple(
            [
                Extra(collider.part, _jointed(room, body.id), Mesh(in_scene(body, collider.mesh), collider.mesh.faces))
                for body in (*room.bodies.values(), *room.free.values())
                for collider in body.colliders
            ]
            + [Extra(collider.part, None, collider.mesh, collider.structure) for collider in room.static_colliders]
        ),
        tuple(Extra(i, i, part.grasp.region) for i, part in room.articulations.items()),
        stands=tuple(_stands(room)),
    )


def of_description(name: str, parts: Mapping[str, DescribedPart]) -> PageRoom:
    """Return the page of a description: the box of every part, which holds those inside it, too."""
    return PageRoom(
        name,
        {i: _described_part(parts, i) for i in parts},
        {i: _described_mover(parts, part.against) for i, part in parts.items() if part.joint},
        boxes=True,
    )


def label_of(part_id: str) -> str:
    """Return the label in an id ("kitchen drawer" of kitchen_drawer_7), for stages that keep no other."""
    return part_id.rpartition("_")[0].replace("_", " ") or part_id


def _moving(scene: Scene, body: str | None) -> str | None:
    return body if body in scene.movable else None


def _jointed(room: SimRoom, body: str) -> str | None:
    return body if body in room.articulations else None


def _body(room: SimRoom, body: SimBody, shown: dict[str, SimBody]) -> PagePart:
    surface = Mesh(in_scene(body, body.visual), body.visual.faces, body.visual.colors)
    articulation = room.articulations.get(body.id)
    if articulation is None:
        free = body.id in room.free
        return PagePart(label_of(body.id), surface, None, None, "free" if free else "fixed", body.mass.mass)
    parent = articulation.parent if articulation.parent in shown else None
    return PagePart(label_of(body.id), surface, parent, body.id, articulation.joint, body.mass.mass)


def _static(room: SimRoom) -> dict[str, Mesh]:
    """Return the surfaces of the room that stands still, by part; as one where the stage does not tell its parts."""
    visual, owners = room.static_visual, room.static_face_part
    if owners is None or not room.static_parts:
        return {"static": visual}
    order = np.argsort(owners, kind="stable")
    ends = np.searchsorted(owners[order], np.arange(len(room.static_parts) + 1))
    faces = {part: order[ends[i] : ends[i + 1]] for i, part in enumerate(room.static_parts)}
    return {part: keep(visual, those) for part, those in faces.items() if len(those)}


def _stands(room: SimRoom) -> Iterator[RobotStand]:
    """Yield where robots stand whose sizes a file of s2a/robot tells."""
    for part, articulation in room.articulations.items():
        for robot, base in articulation.bases.items():
            file = Path(__file__).parents[2] / "robot" / robot / "robot.yaml"
            if file.is_file():
                size = config.read(file)["base"]
                foot = np.array(base.position)
                shoulder = foot + [0.0, 0.0, size["shoulder_height"]]
                yield RobotStand(part, foot, shoulder, size["reach"], size["radius"], base.free)


def _described_part(parts: Mapping[str, DescribedPart], part_id: str) -> PagePart:
    part = parts[part_id]
    motion: Motion = part.joint or ("free" if part.motion == "free" else "fixed")
    return PagePart(part.label, _box(part), part.parent, _described_mover(parts, part_id), motion, part.mass)


def _described_mover(parts: Mapping[str, DescribedPart], part: str | None) -> str | None:
    """Return the jointed part that a part moves with: itself, or the nearest one that it is inside of."""
    while part is not None and part in parts and parts[part].joint is None:
        part = parts[part].parent
    return part if part in parts else None  # "world" is none


def _box(part: DescribedPart) -> Mesh:
    if part.center is None or part.size is None:
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    from s2a.scene.geometry.convex import box  # brings scipy, which no other flavour needs

    cos, sin = math.cos(part.yaw), math.sin(part.yaw)
    axes = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return box(np.array(part.center), axes, np.maximum(part.size, THINNEST))


def _play(path: Path) -> str:
    return "is played in its room; give stage= the sim.usd, too, and page=true"


artefacts.register(
    Artefact("states of s2a evaluate", lambda path: path.suffix == ".npz", instead=_play),
    Artefact("a dataset of s2a collect", lambda path: (path / DATASET).is_file(), instead=_play),
)
