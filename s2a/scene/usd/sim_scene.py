"""The data of a simulation-ready room: bodies, joints, grasps, base poses, colliders."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from s2a.core.errors import InputError
from s2a.scene.scene import Joint, Mesh, Vec3
from s2a.scene.usd.joints import Refinement, Resistance

Quat = tuple[float, float, float, float]
DEFAULT_ROBOT = "panda"
"""The robot that a base pose is of where none is named."""
PREPARE_AGAIN = "run s2a prepare again"
"""The remedy for a room that is damaged."""


@dataclass(frozen=True)
class Collider:
    """One convex hull.

    Attributes:
        part: id of the part it stands for.
        mesh: a closed convex mesh in the frame of its body: scene coordinates, but for free objects.
        structure: It is of a wall, the floor or the ceiling.
    """

    part: str
    mesh: Mesh
    structure: bool = False


@dataclass(frozen=True)
class Mass:
    """Mass properties of a body, rounded to float32, the precision of UsdPhysics.

    Attributes:
        mass: [kg].
        center: centre of mass in the body's frame [m].
        inertia: principal moments about the centre [kg m^2].
        axes: orientation of the principal axes in the body's frame, quaternion xyzw.
        source: where the mass comes from, such as "annotated".
    """

    mass: float
    center: Vec3
    inertia: Vec3
    axes: Quat = (0.0, 0.0, 0.0, 1.0)
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", single(self.mass))
        for name in ("center", "inertia", "axes"):
            object.__setattr__(self, name, tuple(map(single, getattr(self, name))))


@dataclass(frozen=True)
class SimBody:
    """A rigid body.

    Attributes:
        id: id of the part that gives it its name.
        visual: everything that moves with it, at full resolution, in its own frame; may be empty.
        colliders: its convex hulls, in its own frame.
        mass: mass, centre, inertia.
        completed: number of faces at the end of the visual that were added, because the scan could not show them.
        position: origin of its frame in the scene [m]: the scene's origin for what hangs on a joint, the centre of mass for
            a free object. (Far from its centre of mass, a body's rotation and translation are coupled so strongly that an
            object of 50 g diverges.)
        orientation: of that frame, quaternion xyzw.
    """

    id: str
    visual: Mesh
    colliders: tuple[Collider, ...]
    mass: Mass
    completed: int = 0
    position: Vec3 = (0.0, 0.0, 0.0)
    orientation: Quat = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Grasp:
    """Where and how a parallel gripper grasps an articulated part.

    Attributes:
        point: mean of the grasp region [m], scene coordinates, the part at zero.
        orientation: quaternion xyzw of the grasp frame: z into the furniture, y across the region's thin section
            (fingers close along it), x along the region.
        size: extent of the region along x, y, z of that frame [m].
        region: the annotated surface, as scanned.
        internal: the fingers go in closed and hold the region from within, by opening: a recessed pull. Then the point is where
            the tool frame is while the fingertips are just before the pocket's floor, and size is that of the pocket.
    """

    point: Vec3
    orientation: Quat
    size: Vec3
    region: Mesh
    internal: bool = False


@dataclass(frozen=True)
class Base:
    """Where a robot stands to reach a part.

    Attributes:
        position: of its base [m], scene coordinates.
        orientation: quaternion xyzw; its x axis points at the furniture.
        reason: why there, in words.
        free: The arm reaches along the whole path and collides with nothing.
        pedestal: height of the column under it [m]; 0 on the floor.
        radius: of that column [m].
        assumed_floor: The floor below it was not scanned: the scan has a hole there, amid floor at the same height.
    """

    position: Vec3
    orientation: Quat
    reason: str = ""
    free: bool = True
    pedestal: float = 0.0
    radius: float = 0.12
    assumed_floor: bool = False


@dataclass(frozen=True)
class Articulation:
    """How one body moves against another, and how a robot takes hold of it.

    Attributes:
        joint: axis, origin, limits in scene coordinates.
        parent: id of the body that it moves against.
        grasp: where to grasp it.
        bases: where a robot stands, by the robot's name.
        friction: dry friction of the joint [N] or [N m], rounded to float32.
        filtered: ids of the bodies with which it does not collide, because their colliders overlap somewhere on its path.
        notes: what was changed beyond what was scanned, in sentences.
        resistance: what else resists, if it was identified; None: what the simulation's settings say.
        refinement: how far the joint is from its annotation; None: it is as annotated.
    """

    joint: Joint
    parent: str
    grasp: Grasp
    bases: dict[str, Base]
    friction: float = 0.0
    filtered: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    resistance: Resistance | None = None
    refinement: Refinement | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction", single(self.friction))


@dataclass(frozen=True)
class Reduction:
    """What decimation did to a group of surfaces.

    Attributes:
        group: "structure" (walls, floor, ceiling) or "other".
        before: faces that it had.
        after: faces that it has.
        asked: faces that it should have.
        mean: mean distance of the surfaces before and after [m], the larger one of both directions.
        p99: what 99 % of the points stay below [m], likewise.
        max: largest distance found [m], likewise.
    """

    group: str
    before: int
    after: int
    asked: int
    mean: float
    p99: float
    max: float

    @property
    def reached(self) -> bool:
        """Whether the number of faces is within 1 % of what was asked for."""
        return abs(self.after - self.asked) <= 0.01 * self.asked


@dataclass(frozen=True)
class SimRoom:
    """Everything that a simulation-ready file holds.

    Attributes:
        name: the scan's name.
        bodies: fixed bodies (cabinets and anchors) and articulated parts by id, parents before children.
        articulations: how the articulated ones of these move, by the same id.
        free: objects that lie about freely, by id.
        static_visual: the rest of the room as one decimated mesh.
        static_colliders: its convex hulls.
        notes: what was changed beyond what was scanned, in sentences.
        static_parts: ids of the room's parts, to which `static_face_part` points.
        static_face_part: index of the part that each face of `static_visual` belongs to, shape [face], int32.
        reductions: what decimation did to the static visual.
    """

    name: str
    bodies: dict[str, SimBody]
    articulations: dict[str, Articulation]
    static_visual: Mesh
    static_colliders: tuple[Collider, ...]
    free: dict[str, SimBody] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    static_parts: tuple[str, ...] = ()
    static_face_part: np.ndarray | None = field(default=None, compare=False)
    reductions: tuple[Reduction, ...] = ()

    @cached_property
    def fixed(self) -> tuple[str, ...]:
        """Ids of the bodies that are fixed to the world."""
        return tuple(i for i in self.bodies if i not in self.articulations)

    def carriers(self, part: str) -> tuple[str, ...]:
        """Return the bodies that carry an articulated part, from its parent to the one that is fixed to the world."""
        parent = self.articulations[part].parent
        return (parent, *(self.carriers(parent) if parent in self.articulations else ()))

    def part(self, part: str | None) -> str:
        """Return the id of an articulated part; None stands for the only one.

        Raises:
            InputError: there is no such part, or several where none is named; it lists them.
        """
        possible = ", ".join(self.articulations) or "none"
        if part is None and len(self.articulations) == 1:
            return next(iter(self.articulations))
        if part is None:
            raise InputError(
                f"room {self.name!r} has {len(self.articulations)} articulated parts; give part= one of: {possible}"
            )
        if part not in self.articulations:
            raise InputError(f"part {part!r} is no articulated part of room {self.name!r}; possible: {possible}")
        return part


def single(value: float) -> float:
    """Return a number rounded to float32."""
    return float(np.float32(value))


def in_scene(body: SimBody, mesh: Mesh) -> np.ndarray:
    """Return the vertices of a body's visual or collider at the scanned pose [m], shape [vertex 3], scene coordinates."""
    points, orientation = mesh.vertices.astype(np.float64), np.array(body.orientation)
    if not orientation[:3].any():
        return points + body.position
    return rotate(orientation, points) + body.position


def rotate(orientation: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points rotated by unit quaternions.

    Args:
        orientation: xyzw, shape [... 4]; broadcast against `points`.
        points: shape [... 3].
    """
    v, w = orientation[..., :3], orientation[..., 3:]
    return points + 2.0 * np.cross(v, np.cross(v, points) + w * points)
