"""An articulated part, as all of the preparation sees it, and which part belongs to which body."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.prepare.grasp import find_grasp
from s2a.robot.spec import RobotSpec
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Scene, problems
from s2a.scene.usd.sim_scene import Grasp


@dataclass(frozen=True)
class Target:
    """An articulated part.

    Attributes:
        id: of the part.
        joint: how it moves, scene coordinates.
        grasp: where a gripper takes hold of it.
        grasp_parts: ids of the parts that make up the grasp region.
        base_plate: id of the part that these are fixed to, if that is another one than the target; else None.
        surfaces: surface of each part of its body by id, the target first; nested articulated parts are bodies of their own.
        carried: surface of all that moves when its joint does, nested articulated parts included.
        cabinet: surface of the object that it belongs to, without that of the object's parts; empty if it is an object itself.
    """

    id: str
    joint: Joint
    grasp: Grasp
    grasp_parts: tuple[str, ...]
    base_plate: str | None
    surfaces: dict[str, Mesh]
    carried: Mesh
    cabinet: Mesh

    @cached_property
    def frame(self) -> np.ndarray:
        """The grasp frame's axes as columns, shape [3 3]: z into the furniture."""
        return Rotation.from_quat(self.grasp.orientation).as_matrix()

    @cached_property
    def point(self) -> np.ndarray:
        """The grasp point [m], shape [3]."""
        return np.array(self.grasp.point)

    @property
    def front(self) -> Mesh:
        """The part's own surface."""
        return self.surfaces[self.id]

    @property
    def surface(self) -> Mesh:
        """The surface of its body."""
        return merge(list(self.surfaces.values()))


def find_target(
    scene: Scene,
    part: str,
    members: Sequence[str] | None = None,
    grasp: Grasp | None = None,
    spec: RobotSpec | None = None,
    approach: float | None = None,
) -> Target:
    """Return an articulated part of a scene.

    Args:
        scene: the room.
        part: its id.
        members: ids of the parts of its body, itself first; None: all below it that hang on no joint of their own.
        grasp: where to grasp it, where that is known already.
        spec: the robot that grasps it; None: the Panda.
        approach: straight path before the grasp [m]; see `find_grasp`.

    Raises:
        InputError: the part is unknown, does not move, has limits that no robot can use, or has no surface.
    """
    joint, grasp = target_joint(scene, part), grasp or find_grasp(scene, part, spec, approach)
    held, root = scene.handle_parts(part), scene.root(part)
    plate = scene.parts[held[0]].parent
    return Target(
        id=part,
        joint=joint,
        grasp=grasp,
        grasp_parts=held,
        base_plate=plate if plate != part and held[0] != part else None,
        surfaces={i: scene.parts[i].mesh for i in members or scene.members(part)},
        carried=merge([scene.parts[i].mesh for i in (part, *scene.descendants(part))]),
        cabinet=merge([]) if root == part else scene.parts[root].mesh,
    )


def target_joint(scene: Scene, target: str) -> Joint:
    """Return the joint of a part that a robot is to move.

    Raises:
        InputError: the part is unknown, does not move, or its limits leave out the scanned pose, in which every episode
            begins (the joint would throw the part open), or are too near or too far apart for any furniture.
    """
    joint = scene.joint(target)
    if wrong := problems(joint.kind, *joint.limits):
        raise InputError(
            f"part {target!r} of scene {scene.name!r}: {' and '.join(wrong)}; correct rangeMin and rangeMax in the scan's "
            "annotation (metres or radians from the scanned pose) and run s2a export again"
        )
    return joint


def bodies(scene: Scene, articulated: Collection[str]) -> dict[str, str | None]:
    """Return the body that each part of a scene belongs to; None for the static room.

    A body is an articulated part with what is fixed to it, or the object that such parts belong to with all its others;
    joints that are not among the `articulated` are frozen.
    """
    roots = {scene.root(i) for i in articulated}
    found: dict[str, str | None] = {}
    for i, part in scene.parts.items():  # parents before children
        above = None if part.parent is None else found[part.parent]
        found[i] = i if i in articulated or (part.parent is None and i in roots) else above
    return found


def parent_body(scene: Scene, part: str, owners: dict[str, str | None]) -> str:
    """Return the body that an articulated part moves against: an anchor of its own if it is an object itself."""
    above = scene.parts[part].parent
    return f"{part}_anchor" if above is None else str(owners[above])
