"""The data of a simulation-ready room: bodies, joints, grasps, base poses, colliders."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from s2a.core.errors import InputError
from s2a.scene.scene import Joint, Mesh, Vec3
from s2a.scene.usd.joints import Refinement, Resistance

Quat = tuple[float, float, float, float]
DEFAULT_ROBOT = "panda"  # The robot that a base pose is of where none is named
ALL = "all"  # Stands for every articulated part and free object
PREPARE_AGAIN = "run s2a prepare again"  # The remedy for a room that is damaged


@dataclass(frozen=True)
class Collider:
    """One convex hull."""

    part: str  # id of the part it stands for
    mesh: Mesh  # a closed convex mesh in the frame of its body: scene coordinates, but for free objects
    structure: bool = False  # It is of a wall, the floor or the ceiling


@dataclass(frozen=True)
class Mass:
    """Mass properties of a body, rounded to float32, the precision of UsdPhysics."""

    mass: float  # [kg]
    center: Vec3  # centre of mass in the body's frame [m]
    inertia: Vec3  # principal moments about the centre [kg m^2]
    axes: Quat = (0.0, 0.0, 0.0, 1.0)  # orientation of the principal axes in the body's frame, quaternion xyzw
    source: str = ""  # where the mass comes from, such as "annotated"

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", single(self.mass))
        for name in ("center", "inertia", "axes"):
            object.__setattr__(self, name, tuple(map(single, getattr(self, name))))


@dataclass(frozen=True)
class SimBody:
    """A rigid body."""

    id: str  # id of the part that gives it its name
    visual: Mesh  # everything that moves with it, at full resolution, in its own frame; may be empty
    colliders: tuple[Collider, ...]  # its convex hulls, in its own frame
    mass: Mass  # mass, centre, inertia
    completed: int = 0  # number of faces at the end of the visual that were added, because the scan could not show them
    # origin of its frame in the scene [m]: the scene's origin for what hangs on a joint, the centre of mass for a
    # free object. (Far from its centre of mass, a body's rotation and translation are coupled so strongly that an
    # object of 50 g diverges.)
    position: Vec3 = (0.0, 0.0, 0.0)
    orientation: Quat = (0.0, 0.0, 0.0, 1.0)  # of that frame, quaternion xyzw


@dataclass(frozen=True)
class Grasp:
    """Where and how a parallel gripper grasps an articulated part."""

    point: Vec3  # mean of the grasp region [m], scene coordinates, the part at zero
    # quaternion xyzw of the grasp frame: z into the furniture, y across the region's thin section (fingers close
    # along it), x along the region
    orientation: Quat
    size: Vec3  # extent of the region along x, y, z of that frame [m]
    region: Mesh  # the annotated surface, as scanned
    # the fingers go in closed and hold the region from within, by opening: a recessed pull. Then the point is
    # where the tool frame is while the fingertips are just before the pocket's floor, and size is that of the pocket
    internal: bool = False


@dataclass(frozen=True)
class Base:
    """Where a robot stands to reach a part."""

    position: Vec3  # of its base [m], scene coordinates
    orientation: Quat  # quaternion xyzw; its x axis points at the furniture
    reason: str = ""  # why there, in words
    free: bool = True  # The arm reaches along the whole path and collides with nothing
    pedestal: float = 0.0  # height of the column under it [m]; 0 on the floor
    radius: float = 0.12  # of that column [m]
    # The floor below it was not scanned: the scan has a hole there, amid floor at the same height
    assumed_floor: bool = False


@dataclass(frozen=True)
class Articulation:
    """How one body moves against another, and how a robot takes hold of it."""

    joint: Joint  # axis, origin, limits in scene coordinates
    parent: str  # id of the body that it moves against
    grasp: Grasp  # where to grasp it
    bases: dict[str, Base]  # where a robot stands, by the robot's name
    friction: float = 0.0  # dry friction of the joint [N] or [N m], rounded to float32
    # ids of the bodies with which it does not collide, because their colliders overlap somewhere on its path
    filtered: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()  # what was changed beyond what was scanned, in sentences
    # what else resists, if it was identified; None: what the simulation's settings say
    resistance: Resistance | None = None
    refinement: Refinement | None = None  # how far the joint is from its annotation; None: it is as annotated

    def __post_init__(self) -> None:
        object.__setattr__(self, "friction", single(self.friction))


@dataclass(frozen=True)
class Reduction:
    """What decimation did to a group of surfaces."""

    group: str  # "structure" (walls, floor, ceiling) or "other"
    before: int  # faces that it had
    after: int  # faces that it has
    asked: int  # faces that it should have
    mean: float  # mean distance of the surfaces before and after [m], the larger one of both directions
    p99: float  # what 99 % of the points stay below [m], likewise
    max: float  # largest distance found [m], likewise

    @property
    def reached(self) -> bool:
        """Whether the number of faces is within 1 % of what was asked for."""
        return abs(self.after - self.asked) <= 0.01 * self.asked


@dataclass(frozen=True)
class SimRoom:
    """Everything that a simulation-ready file holds."""

    name: str  # the scan's name
    # fixed bodies (cabinets and anchors) and articulated parts by id, parents before children
    bodies: dict[str, SimBody]
    articulations: dict[str, Articulation]  # how the articulated ones of these move, by the same id
    static_visual: Mesh  # the rest of the room as one decimated mesh
    static_colliders: tuple[Collider, ...]  # its convex hulls
    free: dict[str, SimBody] = field(default_factory=dict)  # objects that lie about freely, by id
    notes: tuple[str, ...] = ()  # what was changed beyond what was scanned, in sentences
    static_parts: tuple[str, ...] = ()  # ids of the room's parts, to which `static_face_part` points
    # index of the part that each face of `static_visual` belongs to, shape [face], int32
    static_face_part: np.ndarray | None = field(default=None, compare=False)
    reductions: tuple[Reduction, ...] = ()  # what decimation did to the static visual

    @cached_property
    def fixed(self) -> tuple[str, ...]:
        """Ids of the bodies that are fixed to the world."""
        return tuple(i for i in self.bodies if i not in self.articulations)

    @property
    def movable(self) -> tuple[str, ...]:
        """Ids of all that can move: articulated parts, parents before children, then free objects."""
        return (*self.articulations, *self.free)

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
            raise InputError(f"part {part!r} is not an articulated part of room {self.name!r}; possible: {possible}")
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
