"""Bases from which a robot can do all of a task with a part: hold its handle, or push it."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from s2a.motion.obstacles import Obstacles, moved_room
from s2a.motion.open import beside_part, moving_part
from s2a.motion.push import clear_pushes
from s2a.motion.search import Follow, Miss, Search, Stand, Unreachable, around, chunks
from s2a.motion.workcell import MovingPart, Workcell, lines, noisy_starts
from s2a.robot.collision import SLACK
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import ToolPath, matrix
from s2a.sim.world import SimStage

IK_SEEDS, BRANCHES, AT_ONCE = 12, 4, 24
"""Starts of the inverse kinematics at each base, joint paths that are looked at there, and bases that are tried together."""
PEDESTALS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""[m] Heights of what the robot may stand on; as `s2a prepare` has them."""
BENT = 12
"""Bases for which a motion around what is in the way is searched, where from none the straight line is free."""
STOPS = 5
"""Coordinates of the part at which the base must be clear of it."""
PUSHES = 24
"""Pushes with the gripper clear for which a base is searched."""


def ready_to_move(
    stage: SimStage,
    path_of: Callable[[SimStage], ToolPath],
    spec: RobotSpec,
    noise: float,
    seed: int = 0,
    *,
    may_push: bool = False,
) -> SimStage:
    """Return a stage with the robot where it can do a task with its part; see `with_base`.

    Args:
        stage: of the part.
        path_of: returns the tool path of the task in a stage.
        spec: the robot.
        noise: how far from home an episode may start [rad].
        seed: of the searches.
        may_push: the part may be pushed where its handle cannot be held on all of the path.

    Raises:
        Unreachable: no base does, with the base and the segment that come nearest to it.
    """
    try:
        return with_base(stage, path_of(stage), spec, noise, seed)
    except Unreachable as error:
        if not may_push:
            raise
        pushed_stages = clear_pushes(stage, path_of, spec, beside_part(stage), moving_part(stage))
        for pushed in itertools.islice(pushed_stages, PUSHES):
            try:
                return with_base(pushed, path_of(pushed), spec, noise, seed)
            except Unreachable:
                continue
        raise Unreachable(f"{error}; nor can it be pushed") from error


def with_base(stage: SimStage, path: ToolPath, spec: RobotSpec, noise: float, seed: int = 0) -> SimStage:
    """Return a stage with the robot where it can follow a tool path with the part, and reach its beginning from home.

    The prepared base is taken if it serves. Bases from which the straight line to the beginning is free come first.

    Args:
        stage: of the part.
        path: of a task, to the part's handle and with it; the part stands at its first coordinate.
        spec: the robot.
        noise: how far from home an episode may start [rad].
        seed: of the searches.

    Raises:
        Unreachable: no base does, with the base and the segment that come nearest to it.
    """
    about, part = (path.poses[0, :3, 3] + path.poses[-1, :3, 3]) / 2, moving_part(stage)
    beside = Workcell(spec, beside_part(stage, about=about))
    cell = Workcell(spec, Obstacles.of_room(moved_room(stage.room, stage.target, float(path.q[0]), {}), (), about))
    search, starts = Search(spec, cell.kin, seed), noisy_starts(spec, noise, seed)
    opened = 0.0 if path.pushes or stage.internal else None

    def meets(stand: Stand, joints: np.ndarray) -> tuple[float, str]:
        return beside.met(joints, stand.base, part, path.q)

    handle = Follow("handle", 1, path.poses, meets, IK_SEEDS, tried=BRANCHES)
    prepared = Stand(matrix(stage.base), stage.pedestal[0])
    every = around(cell, path.poses[0], path.poses[-1], PEDESTALS)
    bent: list[tuple[Stand, np.ndarray]] = []
    for some in itertools.chain([[prepared]], chunks(every, AT_ONCE)):
        some = [stand for stand in some if _is_beside(stand, part, path, spec, search)]
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


def _is_beside(stand: Stand, part: MovingPart, path: ToolPath, spec: RobotSpec, search: Search) -> bool:
    """Return whether a base, what it stands on and the shoulder are beside the part's way."""
    column = np.arange(0.05 - stand.pedestal, spec.base.shoulder_height, spec.base.radius)
    points = stand.base[:3, 3] + column[:, None] * [0.0, 0.0, 1.0]
    stops = np.linspace(path.q[0], path.q[-1], STOPS)
    depth = part.depth(np.tile(points, (STOPS, 1, 1)), np.full(len(points), spec.base.radius), stops).max()
    if depth > 0.0:
        search.misses.note(Miss(0, float(depth), "base: the part would move into the robot", stand))
    return bool(depth <= 0.0)


def _based(stage: SimStage, stand: Stand, prepared: Stand, spec: RobotSpec) -> SimStage:
    """Return a stage with the robot on a base; as it is with the prepared one."""
    if stand is prepared:
        return stage
    return replace(stage, base=stand.vector, pedestal=(stand.pedestal, spec.base.radius))
