"""Pushing a part where its handle cannot be held: with the closed gripper, against the outer face of the part at rest."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.motion.gripper import gripper_boxes, gripper_spheres
from s2a.motion.obstacles import Obstacles
from s2a.motion.workcell import MovingPart
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.spec import GripperSpec, RobotSpec
from s2a.robot.tool_path import ToolPath
from s2a.scene.articulation import displace, opening_direction
from s2a.scene.geometry.mesh_ops import merge, normals
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh
from s2a.sim.world import SimStage

PRESS = 0.003
"""[m] By which the gripper is led into the face: the arm lags, and presses by so much."""
FAR = (0.9, 0.75, 0.6, 0.45)
"""Where on the face it pushes, as fractions of its extent from the hinge on."""
ALONG = (0.5, 0.3, 0.7, 0.1, 0.9)
"""Likewise along the hinge."""
TILTS = (35.0, 60.0)
"""[degree] Between the gripper and the normal of the face, where it does not come along that. Flatter ones would push with
the gripper body, beside the wrist: an oven's lid was not lifted so."""
FACING = 0.7
"""Cosine of the angle between the normal of the face and the direction in which it opens, at least."""
BEFORE = 0.5
"""[m] Before the handle, from where the face is looked for."""
GRAVITY = 9.81
"""[m/s^2]"""
TURN = math.radians(0.5)
"""[rad] Between coordinates at which the weight's moment is looked at."""


def at_rest(stage: SimStage, coordinate: float) -> float:
    """Return the coordinate [m] or [rad] at which a stage's part comes to rest that is let go at one.

    It moves where its weight exceeds its dry friction, until that holds it, or to the end of its range. What else draws it,
    such as a spring, is not known here; nor does momentum carry it past its rest.
    """
    joint, part = stage.joint, stage.room.articulations[stage.target]
    friction = part.friction + (part.resistance.breakaway if part.resistance else 0.0)
    if joint.kind == "prismatic":
        force = -_weight(stage) * joint.axis[2]
        return coordinate if abs(force) <= friction else joint.limits[int(force > 0.0)]
    sense = math.copysign(1.0, _moment(stage, coordinate))
    while sense * _moment(stage, coordinate) > friction:
        following = coordinate + sense * TURN
        if not joint.limits[0] < following < joint.limits[1]:
            return joint.limits[int(sense > 0.0)]
        coordinate = following
    return coordinate


def _weight(stage: SimStage) -> float:
    """Return the weight of a stage's part [N]."""
    return GRAVITY * stage.room.bodies[stage.target].mass.mass


def _moment(stage: SimStage, coordinate: float) -> float:
    """Return the moment of the weight of a hinged part about its axis at a coordinate [N m]."""
    center = displace(np.array([stage.room.bodies[stage.target].mass.center]), stage.joint, coordinate)[0]
    arm = np.cross(stage.joint.axis, center - np.array(stage.joint.origin))
    return -_weight(stage) * float(arm[2])


def clear_pushes(
    stage: SimStage, path_of: Callable[[SimStage], ToolPath], spec: RobotSpec, around: Obstacles, part: MovingPart
) -> Iterator[SimStage]:
    """Yield a stage with a push of its part on which gripper and wrist meet neither the room nor the part.

    Args:
        stage: of the part.
        path_of: returns the tool path of the task in a stage.
        spec: the robot.
        around: the room without the part and what hangs on it.
        part: the part alone.
    """
    gripper, shape = gripper_spheres(spec.gripper), robot_shape(spec)
    radii = np.concatenate([gripper.radii, shape.wrist_radii])
    for pose in pushes(stage, spec.gripper):
        pushed = replace(stage, push=pose)
        path = path_of(pushed)
        turned = path.poses[:, :3, :3].transpose(0, 2, 1)
        wrist = shape.wrist @ turned + path.poses[:, None, :3, 3]
        centers = np.concatenate([gripper.placed(path.poses, np.zeros(len(path.poses))), wrist], axis=1)
        if around.depth(centers, radii).max() > SLACK:
            continue
        if part.depth(centers, radii, path.q).max() <= PRESS + SLACK:
            yield pushed


def pushes(stage: SimStage, gripper: GripperSpec) -> Iterator[np.ndarray]:
    """Yield poses of the tool, as 7-vectors with the part at zero, at which a closed gripper touches the outer face of a part.

    Those with the longest lever arm come first. At each spot the gripper comes along the normal of the face, then inclined: from
    the edge that opens, from either side, and from between.
    """
    outwards, aside, along = _face(stage)
    for spot, normal in _spots(stage, outwards, aside, along):
        flat = [side - side @ normal * normal for side in (aside, along, -along, aside + along, aside - along)]
        sides = [side / np.linalg.norm(side) for side in flat]
        for tilt, side in [(0.0, sides[0]), *itertools.product(np.radians(TILTS), sides)]:
            forward, wide = -np.cos(tilt) * normal - np.sin(tilt) * side, np.cross(normal, side)
            for across in (wide, np.cross(forward, wide)):
                frame = np.stack([np.cross(across, forward), across, forward], axis=1)
                yield _touching(spot, frame, normal, gripper)


def _face(stage: SimStage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit vectors of a part at zero: as it opens first, on the face away from the hinge, and along the hinge."""
    joint, point = stage.joint, stage.grasp[:3]
    normal = opening_direction(joint, point)
    if joint.kind == "prismatic":
        upright = np.eye(3)[0 if abs(normal[2]) > 0.9 else 2]
        aside = np.cross(upright, normal) / np.linalg.norm(np.cross(upright, normal))
        return normal, aside, np.cross(normal, aside)
    along = np.array(joint.axis)
    aside = np.cross(normal, along)
    return normal, aside * (1.0 if aside @ (point - np.array(joint.origin)) > 0.0 else -1.0), along


def _spots(
    stage: SimStage, outwards: np.ndarray, aside: np.ndarray, along: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return points [3] of a part's outer face at zero, with its normals there; those farthest from the hinge first."""
    surface = merge([c.mesh for c in stage.room.bodies[stage.target].colliders])
    hinged, point = stage.joint.kind == "revolute", stage.grasp[:3]
    origin = np.array(stage.joint.origin) if hinged else point
    extents = []
    for axis in (aside, along):
        reach = (surface.vertices - origin) @ axis
        extents.append((0.0 if hinged and axis is aside else float(reach.min()), float(reach.max())))
    grid = [[low + f * (high - low) for f in places] for (low, high), places in zip(extents, (FAR, ALONG), strict=True)]
    before = float((point - origin) @ outwards) + BEFORE
    starts = np.array([origin + a * aside + b * along + before * outwards for a in grid[0] for b in grid[1]])
    tree = ray_mesh(surface.vertices, surface.faces)
    gaps = first_hits(tree, starts, np.tile(-outwards, (len(starts), 1)))
    spots = starts[np.isfinite(gaps)] - gaps[np.isfinite(gaps), None] * outwards
    facing = normals(surface)[nearest_faces(tree, spots)[0]]
    return [(a, b) for a, b in zip(spots, facing, strict=True) if b @ outwards > FACING]


def _touching(spot: np.ndarray, frame: np.ndarray, normal: np.ndarray, gripper: GripperSpec) -> np.ndarray:
    """Return the pose of a closed gripper with axes [3 3] whose foremost edge presses on a spot [3] of a face; 7-vector."""
    half = gripper.max_opening / 2
    corners = []
    for (low, high), side in zip(gripper_boxes(gripper), (1, -1, 0), strict=True):
        box = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij")).reshape(3, -1).T
        corners.append(box - [0.0, side * half, 0.0])
    points = np.concatenate(corners) @ frame.T
    ahead = -points @ normal
    foremost = points[ahead >= ahead.max() - 1e-3].mean(axis=0)
    return np.array([*(spot - PRESS * normal - foremost), *Rotation.from_matrix(frame).as_quat()])
