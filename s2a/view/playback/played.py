"""States of worlds as what a page plays: poses of the robot's links, and how far free objects were moved."""

from __future__ import annotations

from pathlib import Path

import newton
import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.errors import InputError
from s2a.robot.model import add_robot
from s2a.robot.tool_path import matrices
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stamp import layer_hash
from s2a.view.page.room import Played, PlayedWorld
from s2a.view.page.thin import clustered
from s2a.view.playback import states
from s2a.view.playback.states import States, read_demonstrations

DETAIL = 0.006
"""[m] Of the robot's surface: its visual meshes have 140,000 faces."""
SHINY = 0.9
"""Brightness of white paint: the page's light would bleach it."""


def read(path: Path, stage: Path, first: int, count: int) -> States:
    """Read what some worlds did in a room.

    Args:
        path: a file of states, or a dataset.
        stage: the room's file.
        first: index of the first world or episode.
        count: of them at most.

    Raises:
        InputError: another file, no such world, or another room.
    """
    found = read_demonstrations(path, first, count) if path.is_dir() else _some(states.read(path), path, first, count)
    _check_room(found, path, stage)
    return found


def one_of_each(path: Path, stage: Path) -> States:
    """Read the first world that succeeded and the first that did not; the first one where a file does not say which did.

    Args:
        path: a file of states, or a dataset.
        stage: the room's file.

    Raises:
        InputError: another file, or another room.
    """
    every = read_demonstrations(path, 0, 1) if path.is_dir() else states.read(path)
    _check_room(every, path, stage)
    outcomes = every.success or [True]
    return every.of_worlds([outcomes.index(value) for value in (True, False) if value in outcomes])


def _check_room(found: States, path: Path, stage: Path) -> None:
    """Raise an InputError unless states are of a room."""
    if found.sha256 != layer_hash(stage):
        raise InputError(f"{stage} is not the room that {path} is of, or was prepared again")


def of_states(found: States, room: SimRoom) -> Played:
    """Return what a page plays of states in a room.

    Raises:
        InputError: coordinates of another robot, or parts that the room does not have.
    """
    if other := {*found.parts} - {*room.articulations} | {*found.objects} - {*room.free}:
        raise InputError(f"{room.name} has no part {min(other)!r} that moves; give the room that the states are of")
    if (count := len(robot.load(found.robot).joints)) != found.joints[0].shape[-1]:
        raise InputError(
            f"the states have {found.joints[0].shape[-1]} joints, and {found.robot} has {count}; evaluate again"
        )
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        add_robot(builder, robot.load(found.robot), wp.transform(*found.base[:3], *found.base[3:]), visuals=True)
        bodies, links = _links(builder)
        model = builder.finalize()
        worlds = tuple(
            PlayedWorld(
                name,
                {part: each[k] for part, each in found.parts.items()},
                {part: _moved(each[k], room, part) for part, each in found.objects.items()},
                _poses(model, found.joints[k])[:, bodies],
            )
            for k, name in enumerate(found.names)
        )
    return Played(found.rate, tuple(links), worlds)


def _some(every: States, path: Path, first: int, count: int) -> States:
    chosen = slice(first, first + count)
    if not every.names[chosen]:
        raise InputError(
            f"{path} has {len(every.names)} worlds; there is none with index {first}: give a smaller 'first'"
        )
    return every.of_worlds(range(len(every.names))[chosen])


def _links(builder: newton.ModelBuilder) -> tuple[list[int], list[Mesh]]:
    """Return the bodies of a robot that are seen, and their surfaces, each in the body's frame."""
    pieces: dict[int, list[Mesh]] = {}
    for i in range(builder.shape_count):
        source = builder.shape_source[i]
        if source is None or not int(builder.shape_flags[i]) & int(newton.ShapeFlags.VISIBLE):
            continue
        pose = np.array(builder.shape_transform[i], dtype=float)
        points = np.asarray(source.vertices, dtype=float) * np.array(builder.shape_scale[i])
        points = Rotation.from_quat(pose[3:]).apply(points) + pose[:3]
        red, green, blue = (int(255 * SHINY * value) for value in builder.shape_color[i])
        mesh = clustered(Mesh(points, np.asarray(source.indices).reshape(-1, 3)), DETAIL)
        if len(mesh.faces):
            pieces.setdefault(builder.shape_body[i], []).append(painted(mesh, (red, green, blue)))
    return list(pieces), [merge(each) for each in pieces.values()]


def _poses(model: newton.Model, joints: np.ndarray) -> np.ndarray:
    """Return the poses of all bodies, shape [frame body 7], for joint coordinates [frame joint]."""
    state, found = model.state(), []
    for q in joints.astype(np.float32):
        model.joint_q.assign(q)
        newton.eval_fk(model, model.joint_q, model.joint_qd, state)
        found.append(state.body_q.numpy().copy())
    return np.array(found)


def _moved(poses: np.ndarray, room: SimRoom, part: str) -> np.ndarray:
    """Return the displacements [frame 4 4] of a free object from its scanned pose, for its poses [frame 7]."""
    body = room.free[part]
    return matrices(poses) @ np.linalg.inv(matrices(np.array([[*body.position, *body.orientation]])))
