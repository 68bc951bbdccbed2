"""Trials with a soft body: where it stands and where it is put in each, and the plan for that."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.motion.obstacles import Obstacles
from s2a.motion.places import NEAR, first_planned, place_poses
from s2a.robot.spec import RobotSpec
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.sim.soft_body import SoftBody
from s2a.sim.soft_config import SoftConfig
from s2a.tasks.pick_place.config import PickPlaceConfig
from s2a.tasks.pick_place.soft import SoftTrial, plan_trial
from s2a.tasks.pick_place.soft_stage import EVEN, NAME, standing, with_body

DRAWS = 20
"""Of a pose, until the body stands at it."""
Ends = tuple[np.ndarray, np.ndarray]


def trials(
    room: SimRoom,
    body: SoftBody,
    config: SoftConfig,
    task: PickPlaceConfig,
    robot: RobotSpec,
    approach: float,
    count: int,
    seed: int,
) -> Iterator[SoftTrial | str]:
    """Yield trials, each planned for itself, or why there is no plan for one.

    In each, start and place are shifted by up to `task.start_shift` along x and y and turned by up to `task.start_turn`.

    Raises:
        InputError: a start or a place that is missing or where the body does not stand.
    """
    candidates = _candidates(room, body, config, task)
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        try:
            drawn = ((_drawn(room, body, a, task, rng), _drawn(room, body, b, task, rng)) for a, b in candidates)
            _, trial = first_planned(
                with_body(room, body, config, candidates[0][0]),
                NAME,
                robot,
                drawn,
                lambda ends: plan_trial(room, body, config, robot, ends, approach, number),  # noqa: B023 - it is called at once
            )
            yield trial
        except InputError as error:
            yield str(error)


def _candidates(room: SimRoom, body: SoftBody, config: SoftConfig, task: PickPlaceConfig) -> list[Ends]:
    """Return starts and places of the body's frame, 7-vectors, those to be tried first first."""
    start, place = task.start, task.place
    if start is None or place is None or start == place or any(each.endswith(".json") for each in (start, place)):
        raise InputError(
            f"task.start={start} and task.place={place}: with physics=soft the body stands nowhere in the room; give the id "
            "of a support or a pose for each, two different ones"
        )
    known = [each for each in (start, place) if each != NEAR]
    about = {each: _about(room, each) for each in known}
    with_it = with_body(room, body, config, about[known[0]])
    goal = next(place_poses(with_it, NAME, place, about[known[0]], EVEN))
    return [(each, goal) for each in place_poses(with_it, NAME, start, goal, EVEN)]


def _about(room: SimRoom, said: str) -> np.ndarray:
    """Return a pose, 7-vector, on the middle of a support, or the one that is said."""
    try:
        return np.array([*(float(x) for x in said.replace(",", " ").split()[:3]), 0.0, 0.0, 0.0, 1.0])
    except ValueError:
        pass
    points = [np.asarray(c.mesh.vertices) for c in room.static_colliders if c.part == said]
    for each in (*room.bodies.values(), *room.free.values()):
        points += [in_scene(each, c.mesh) for c in each.colliders if c.part == said]
    if not points:
        raise InputError(f"{said!r} is neither a pose nor a part of room {room.name!r} that supports anything")
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    return np.array([*(low + high)[:2] / 2, high[2], 0.0, 0.0, 0.0, 1.0])


def _drawn(
    room: SimRoom, body: SoftBody, pose: np.ndarray, task: PickPlaceConfig, rng: np.random.Generator
) -> np.ndarray:
    """Return the first pose that is drawn about one, 7-vectors, at which all of the body is on the same support."""
    near = Obstacles.of_room(room, set(), pose[:3])
    support, yaw = near.below(pose[None, :3])[1][0], Rotation.from_quat(pose[3:]).as_euler("zyx")[0]
    for left in reversed(range(DRAWS)):
        at = pose[:2] + rng.uniform(-1.0, 1.0, 2) * task.start_shift
        try:
            return standing(near, support, body, at, yaw + rng.uniform(-1.0, 1.0) * task.start_turn)
        except InputError:
            if not left:
                raise
    raise AssertionError("the last draw returns or raises")
