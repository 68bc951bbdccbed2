"""Bases from which a robot can do all of a task with a part: hold its handle, or push its outer face with the closed gripper."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.motion.floor import FreeFloor
from s2a.motion.gripper import gripper_boxes, gripper_spheres
from s2a.motion.obstacles import Obstacles, moved_room
from s2a.motion.open import beside_part, moving_part
from s2a.motion.search import IK_SEEDS, Follow, Miss, Search, Stand, Unreachable, around, chunks
from s2a.motion.workcell import MovingPart, Workcell, lines, noisy_starts
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.spec import GripperSpec, RobotSpec
from s2a.robot.tool_path import ToolPath, matrix
from s2a.scene.articulation import opening_direction
from s2a.scene.geometry.mesh_ops import merge, normals
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh
from s2a.sim.world import SimStage

PRESS = 0.003  # [m] By which the gripper is led into the face: the arm lags, and presses by so much
FAR = (0.9, 0.75, 0.6, 0.45)  # Where on the face it pushes, as fractions of its extent from the hinge on
ALONG = (0.5, 0.3, 0.7, 0.1, 0.9)  # Likewise along the hinge
# [degree] Between the gripper and the normal of the face, where it does not come along that. Flatter ones would push
# with the gripper body, beside the wrist: an oven's lid was not lifted so
TILTS = (35.0, 60.0)
FACING = 0.7  # Cosine of the angle between the normal of the face and the direction in which it opens, at least
BEFORE = 0.5  # [m] Before the handle, from where the face is looked for


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


BRANCHES, AT_ONCE = 4, 24  # Joint paths that are looked at from each base, and bases that are tried together
PEDESTALS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # [m] Heights of what the robot may stand on; as `s2a prepare` has them
BENT = 12  # Bases for which a motion around what is in the way is searched, where from none the straight line is free
STOPS = 5  # Coordinates of the part at which the base must be clear of it
PUSHES = 24  # Pushes with the gripper clear for which a base is searched


def ready_to_move(
    stage: SimStage,
    path_of: Callable[[SimStage], ToolPath],
    spec: RobotSpec,
    noise: float,
    seed: int = 0,
    *,
    may_push: bool = False,
    floor: FreeFloor | None = None,
) -> SimStage:
    """Return a stage with the robot where it can do a task with its part; see `with_base`.

    Args:
        stage: of the part.
        path_of: returns the tool path of the task in a stage.
        spec: the robot.
        noise: how far from home an episode may start [rad].
        seed: of the searches.
        may_push: the part may be pushed where its handle cannot be held on all of the path.
        floor: on which the robot drives there; None: its base is put there.

    Raises:
        Unreachable: no base does, with the base and the segment that come nearest to it.
    """
    try:
        return with_base(stage, path_of(stage), spec, noise, seed, floor)
    except Unreachable as error:
        if not may_push:
            raise
        pushed_stages = clear_pushes(stage, path_of, spec, beside_part(stage), moving_part(stage))
        for pushed in itertools.islice(pushed_stages, PUSHES):
            try:
                return with_base(pushed, path_of(pushed), spec, noise, seed, floor)
            except Unreachable:
                continue
        raise Unreachable(f"{error}; nor can it be pushed") from error


def with_base(
    stage: SimStage, path: ToolPath, spec: RobotSpec, noise: float, seed: int = 0, floor: FreeFloor | None = None
) -> SimStage:
    """Return a stage with the robot where it can follow a tool path with the part, and reach its beginning from home.

    The prepared base is taken if it serves. Bases from which the straight line to the beginning is free come first.

    Args:
        stage: of the part.
        path: of a task, to the part's handle and with it; the part stands at its first coordinate.
        spec: the robot.
        noise: how far from home an episode may start [rad].
        seed: of the searches.
        floor: on which the robot drives there; None: its base is put there.

    Raises:
        Unreachable: no base does, with the base and the segment that come nearest to it.
    """
    about, part = (path.poses[0, :3, 3] + path.poses[-1, :3, 3]) / 2, moving_part(stage)
    beside = Workcell(spec, beside_part(stage, about=about), floor)
    now = moved_room(stage.room, stage.target, float(path.q[0]), {})
    cell = Workcell(spec, Obstacles.of_room(now, (), about), floor)
    search, starts = Search(spec, cell.kin, seed), noisy_starts(spec, noise, seed)
    opened = 0.0 if path.pushes or stage.internal else None

    def meets(stand: Stand, joints: np.ndarray) -> tuple[float, str]:
        return beside.met(joints, stand.base, part, path.q)

    handle = Follow("handle", 1, path.poses, meets, IK_SEEDS, tried=BRANCHES)
    prepared = Stand(matrix(stage.base), stage.pedestal[0])
    every = around(cell, path.poses[0], path.poses[-1], PEDESTALS)
    bent: list[tuple[Stand, np.ndarray]] = []
    for some in itertools.chain([] if floor else [[prepared]], chunks(every, AT_ONCE)):
        some = [stand for stand in some if _is_beside(stand, part, path, spec, search, floor)]
        for k, joints in search.followed(some, handle):
            depth = cell.empty(some[k].base, opened)
            if cell.all_free(depth, starts) and cell.all_free(depth, lines(starts, joints[0])):
                return _based(stage, some[k], prepared, spec)
            bent.append((some[k], joints[0]))
    for stand, first in bent[:BENT]:
        depth = cell.empty(stand.base, opened)
        if depth(starts, 0.0).max() > SLACK:
            search.misses.note(Miss(2, float(depth(starts, 0.0).max()), "reach: the arm starts in something", stand))
        elif search.joined(cell, stand, starts[0], first, depth, "reach", 2) is not None:
            return _based(stage, stand, prepared, spec)
    raise search.unreachable(f"{stage.target!r} cannot be moved so far")


def _is_beside(
    stand: Stand, part: MovingPart, path: ToolPath, spec: RobotSpec, search: Search, floor: FreeFloor | None
) -> bool:
    """Return whether a base, what it stands on and the shoulder are beside the part's way."""
    column = np.arange(0.05 - stand.pedestal, spec.base.shoulder_height, spec.base.radius)
    points = stand.base[:3, 3] + column[:, None] * [0.0, 0.0, 1.0]
    radii = np.full(len(points), spec.base.radius)
    if floor is not None:
        centers, wide = floor.body(stand.base)
        points, radii = np.concatenate([points, centers]), np.concatenate([radii, wide])
    stops = np.linspace(path.q[0], path.q[-1], STOPS)
    depth = part.depth(np.tile(points, (STOPS, 1, 1)), radii, stops).max()
    if depth > 0.0:
        search.misses.note(Miss(0, float(depth), "base: the part would move into the robot", stand))
    return bool(depth <= 0.0)


def _based(stage: SimStage, stand: Stand, prepared: Stand, spec: RobotSpec) -> SimStage:
    """Return a stage with the robot on a base; as it is with the prepared one."""
    if stand is prepared:
        return stage
    return replace(stage, base=stand.vector, pedestal=(stand.pedestal, spec.base.radius))
