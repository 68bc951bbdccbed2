"""The vocabulary of the simulation-ready flavour."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from s2a.scene import Joint, Mesh, Vec3

Quat = tuple[float, float, float, float]


@dataclass(frozen=True)
class Collider:
    """One convex piece.

    Attributes:
        part: id of the part it stands for.
        mesh: a closed convex mesh in scene coordinates.
    """

    part: str
    mesh: Mesh


@dataclass(frozen=True)
class Mass:
    """How a body resists motion.

    Attributes:
        mass: [kg].
        center: centre of mass [m], scene coordinates.
        inertia: principal moments about the centre [kg m^2].
        axes: orientation of the principal axes in the scene, quaternion xyzw.
        source: where the mass comes from, such as "annotated".
    """

    mass: float
    center: Vec3
    inertia: Vec3
    axes: Quat = (0.0, 0.0, 0.0, 1.0)
    source: str = ""


@dataclass(frozen=True)
class SimBody:
    """A rigid body.

    Attributes:
        id: id of the part that gives it its name.
        visual: everything that moves with it, at full resolution; may be empty.
        colliders: its convex pieces.
        mass: mass, centre, inertia.
        completed: how many faces at the end of the visual were added, because the scan could not show them.
    """

    id: str
    visual: Mesh
    colliders: tuple[Collider, ...]
    mass: Mass
    completed: int = 0


@dataclass(frozen=True)
class Grasp:
    """Where and how a parallel gripper takes hold of the moving part.

    Attributes:
        point: mean of the grasp region [m], scene coordinates.
        orientation: quaternion xyzw of the grasp frame: z into the furniture, y across the region's thin section
            (fingers close along it), x along the region.
        size: extent of the region along x, y, z of that frame [m].
        region: the annotated surface, as scanned.
    """

    point: Vec3
    orientation: Quat
    size: Vec3
    region: Mesh


@dataclass(frozen=True)
class Reduction:
    """What decimation did to a group of surfaces.

    Attributes:
        group: "shell" (walls, floor, ceiling) or "other".
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
class SimScene:
    """Everything that a simulation-ready file holds.

    Attributes:
        name: the scan's name.
        carcass: the immovable body that the target moves against.
        target: the moving body.
        joint: how it moves.
        grasp: where to take hold of it.
        static_visual: the rest of the room as one decimated mesh.
        static_colliders: convex pieces of the room within the arm's reach.
        base_position: where the robot stands [m], scene coordinates.
        base_orientation: how it is turned, quaternion xyzw; its x axis points at the furniture.
        friction: dry friction of the joint [N] or [N m].
        base_reason: why the robot stands there, in words.
        base_free: whether its arm reaches the whole way of the handle from there and touches nothing else.
        robot: name of the robot that the base pose is for.
        notes: what was changed beyond what was scanned, in sentences.
        filtered: whether target and carcass do not collide, because their pieces overlap somewhere on the target's way.
        static_parts: ids of the room's parts, to which `static_face_part` points.
        static_face_part: index of the part that each face of `static_visual` belongs to, shape [face], int32.
        reductions: what decimation did to the room's looks.
        free: objects that lie about freely.
    """

    name: str
    carcass: SimBody
    target: SimBody
    joint: Joint
    grasp: Grasp
    static_visual: Mesh
    static_colliders: tuple[Collider, ...]
    base_position: Vec3
    base_orientation: Quat
    friction: float = 0.0
    base_reason: str = ""
    base_free: bool = True
    robot: str = "panda"
    notes: tuple[str, ...] = ()
    filtered: bool = False
    static_parts: tuple[str, ...] = ()
    static_face_part: np.ndarray | None = field(default=None, compare=False)
    reductions: tuple[Reduction, ...] = ()
    free: tuple[SimBody, ...] = ()
