"""States of worlds over time, and their file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import newton
import numpy as np
import torch
import warp as wp
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.robot.model import add_robot
from s2a.robot.tool_path import matrices
from s2a.scene.artefacts import DATASET, DATASET_STAGE
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.simulation import Simulation
from s2a.view.page.glb import clustered
from s2a.view.page.room import Played, PlayedWorld

T = TypeVar("T")


@dataclass(frozen=True)
class States:
    """What moved in worlds of one room."""

    rate: float  # frames a second
    robot: str  # its name
    # pose of its base, of one that drives that of the arm's root link at first with the lift down, position [m] and
    # quaternion xyzw, scene frame, shape [7]
    base: np.ndarray
    sha256: str  # of the room's file
    names: list[str]  # of the worlds
    # coordinates of the robot's joints [rad, m], those of a base that drives first, for each world of shape [frame joint]
    joints: list[np.ndarray]
    # coordinates of articulated parts by id [m or rad], for each world of shape [frame]
    parts: dict[str, list[np.ndarray]]
    objects: dict[str, list[np.ndarray]]  # poses of free objects by id, for each world of shape [frame 7]
    success: list[bool] | None = None  # The episode of each world succeeded; None: the file does not say

    def of_worlds(self, chosen: Sequence[int]) -> States:
        """Return the states of some worlds, by their indices."""

        def some(every: Sequence[T]) -> list[T]:
            return [every[k] for k in chosen]

        return replace(
            self,
            names=some(self.names),
            joints=some(self.joints),
            parts={part: some(each) for part, each in self.parts.items()},
            objects={part: some(each) for part, each in self.objects.items()},
            success=None if self.success is None else some(self.success),
        )


class Watch:
    """Samples each world's first episode, after every control step."""

    def __init__(self, sim: Simulation) -> None:
        """Watch the worlds of a simulation, which are all of one room."""
        self._sim, stage = sim, sim.stage
        self._parts = [i for i in stage.active if i in stage.room.articulations]
        self._objects = [i for i in stage.active if i in stage.room.free]
        self._columns = [*range(sim.layout.robot_joints)]
        self._columns += [sim.axis_of(i)[0] for i in self._parts]
        self._bodies = [sim.body(i) for i in self._objects]
        self._q: list[np.ndarray] = []
        self._poses: list[np.ndarray] = []
        self._alive: list[np.ndarray] = []

    def sample(self, done: torch.Tensor) -> None:
        """Keep where everything is; `done` [world]: which worlds were reset in this step, and have nothing to add."""
        sim = self._sim
        before = self._alive[-1] if self._alive else np.ones(sim.num_envs, bool)
        self._alive.append(before & ~done.cpu().numpy().astype(bool))
        self._q.append(sim.joint_q[:, self._columns].cpu().numpy().copy())
        self._poses.append(sim.body_q[:, self._bodies].cpu().numpy().copy())

    def states(self, success: torch.Tensor | None = None) -> States:
        """Return what was seen; `success` [world]: 1 where the episode succeeded, or None."""
        sim, count = self._sim, self._sim.layout.robot_joints
        lasting = np.maximum(np.array(self._alive).sum(axis=0), 1)
        q, poses = np.stack(self._q, axis=1), np.stack(self._poses, axis=1)
        worlds = range(sim.num_envs)
        return States(
            sim.config.control_frequency,
            sim.stage.robot,
            np.asarray(sim.stage.base),
            layer_hash(sim.stage.path),
            [f"world {k}" for k in worlds],
            [q[k, : lasting[k], :count] for k in worlds],
            {part: [q[k, : lasting[k], count + i] for k in worlds] for i, part in enumerate(self._parts)},
            {part: [poses[k, : lasting[k], i] for k in worlds] for i, part in enumerate(self._objects)},
            None if success is None else [bool(value == 1) for value in success],
        )


def write(states: States, path: Path) -> None:
    """Write states as an npz file: frames of all worlds one after the other, and how many each has."""
    arrays: dict[str, Any] = {f"part.{i}": np.concatenate(each) for i, each in states.parts.items()}
    arrays |= {f"object.{i}": np.concatenate(each) for i, each in states.objects.items()}
    arrays |= {"joints": np.concatenate(states.joints), "frames": np.array([len(each) for each in states.joints])}
    arrays |= {name: getattr(states, name) for name in ("rate", "robot", "base", "sha256", "names")}
    arrays |= {} if states.success is None else {"success": np.array(states.success)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


def read(path: Path) -> States:
    """Read a file that `write` wrote; InputError where it is another, or damaged."""
    try:
        with np.load(path, allow_pickle=False) as file:
            content = {name: file[name] for name in file.files}
        ends = np.cumsum(content["frames"])[:-1]
        groups: dict[str, dict[str, list[np.ndarray]]] = {"part.": {}, "object.": {}}
        for name in content:
            group = name.partition(".")[0] + "."
            if group in groups and "." in name:
                groups[group][name.removeprefix(group)] = np.split(content[name], ends)
        joints = np.split(content["joints"], ends)
        names = [str(name) for name in content["names"]]
        success = [bool(value) for value in content["success"]] if "success" in content else None
        _check(content, len(names), success)
        rate, robot, sha256 = float(content["rate"]), str(content["robot"]), str(content["sha256"])
        moved = groups["part."], groups["object."]
        return States(rate, robot, content["base"], sha256, names, joints, *moved, success)
    except (*UNREADABLE, IndexError, TypeError) as error:
        raise InputError(f"{path}: no file of s2a evaluate states=... ({error})") from error


def _check(content: Mapping[str, np.ndarray], worlds: int, success: list[bool] | None) -> None:
    """Raise a ValueError unless the arrays of a file go together, and are finite numbers."""
    frames, rate = content["frames"], float(content["rate"])
    if len(frames) != worlds or not worlds or (frames < 1).any() or (success is not None and len(success) != worlds):
        raise ValueError(f"{worlds} worlds, and frames of {len(frames)}")
    moved = {name: each for name, each in content.items() if name == "joints" or name.startswith(("part.", "object."))}
    if other := [name for name, each in moved.items() if len(each) != frames.sum()]:
        raise ValueError(f"{other[0]} has {len(moved[other[0]])} frames of {frames.sum()}")
    if content["base"].shape != (7,) or not (np.isfinite(rate) and rate > 0.0):
        raise ValueError("no pose of a base, or no rate")
    if infinite := [name for name, each in moved.items() if not np.isfinite(each).all()]:
        raise ValueError(f"{infinite[0]} is not finite")


INFO = "meta/info.json"
POSE = 7
PARTS, OBJECTS = "observation.part", "observation.objects"


def read_demonstrations(root: Path, first: int, count: int) -> States:
    """Read some episodes. `count`: of them at most; InputError: another folder or format, or no such episode."""
    try:
        about, info, stage = (json.loads((root / name).read_text()) for name in (DATASET, INFO, DATASET_STAGE))
        total = int(info["total_episodes"])
        chosen = range(first, min(first + count, total))
        if not chosen:
            raise InputError(f"{root} has {total} episodes; there is none with index {first}: give a smaller 'first'")
        episodes = [_columns(root, info, index) for index in chosen]
        names = {key: feature["names"] for key, feature in info["features"].items() if key in (PARTS, OBJECTS)}
        joints = len(robot.load(about["robot"]).joints)
        objects = [name.rpartition(".")[0] for name in names.get(OBJECTS, [])[::POSE]]
        return States(
            float(info["fps"]),
            about["robot"],
            np.array(stage["base"], dtype=float),
            about["stage_sha256"],
            [f"episode {index}" for index in chosen],
            [each["observation.state"][:, :joints] for each in episodes],
            {part: [each[PARTS][:, i] for each in episodes] for i, part in enumerate(names.get(PARTS, []))},
            {part: [each[OBJECTS][:, POSE * i :][:, :POSE] for each in episodes] for i, part in enumerate(objects)},
            [True] * len(chosen),  # others are not kept
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{root}: no LeRobotDataset of s2a collect that can be played ({error!r})") from error


def _columns(root: Path, info: dict[str, Any], index: int) -> dict[str, np.ndarray]:
    """Return the numbers of an episode's frames, shape [frame n] each."""
    import pyarrow.parquet as pq  # of the extra "collect"

    size = info["chunks_size"]
    file = root / info["data_path"].format(chunk_index=index // size, file_index=index % size)
    table = pq.read_table(file)
    wanted = [name for name in table.column_names if name.startswith("observation.")]
    columns = {name: np.array(table[name].to_pylist(), dtype=float) for name in wanted}
    return {name: each.reshape(len(each), -1) for name, each in columns.items()}


DETAIL = 0.006  # [m] Of the robot's surface: its visual meshes have 140,000 faces
SHINY = 0.9  # Brightness of white paint: the page's light would bleach it


def read_played(path: Path, stage: Path, first: int, count: int) -> States:
    """Read what some worlds did in a room.

    `count`: of them at most.

    Raises:
        InputError: another file, no such world, or another room.
    """
    record = read_demonstrations(path, first, count) if path.is_dir() else _some(read(path), path, first, count)
    _check_room(record, path, stage)
    return record


def one_of_each(path: Path, stage: Path) -> States:
    """Read the first world that succeeded and the first that did not; the first one where a file does not say which did.

    `path`: a file of states, or a dataset.

    Raises:
        InputError: another file, or another room.
    """
    every = read_demonstrations(path, 0, 1) if path.is_dir() else read(path)
    _check_room(every, path, stage)
    outcomes = every.success or [True]
    return every.of_worlds([outcomes.index(value) for value in (True, False) if value in outcomes])


def _check_room(record: States, path: Path, stage: Path) -> None:
    if record.sha256 != layer_hash(stage):
        raise InputError(f"{stage} is not the room that {path} is of, or was prepared again")


def of_states(record: States, room: SimRoom) -> Played:
    """Return what a page plays of states in a room.

    Raises:
        InputError: coordinates of another robot, or parts that the room does not have.
    """
    if other := {*record.parts} - {*room.articulations} | {*record.objects} - {*room.free}:
        raise InputError(f"{room.name} has no part {min(other)!r} that moves; give the room that the states are of")
    spec = robot.load(record.robot)
    if (count := spec.base_joints + len(spec.joints)) != record.joints[0].shape[-1]:
        raise InputError(
            f"the states have {record.joints[0].shape[-1]} joints, and {record.robot} has {count}; evaluate again"
        )
    with wp.ScopedDevice("cpu"):
        builder = newton.ModelBuilder()
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
        base, height = wp.transform(*record.base[:3], *record.base[3:]), spec.drive.mount[2] if spec.drive else 0.0
        add_robot(builder, spec, base, visuals=True, height=height)
        bodies, links = _links(builder)
        model = builder.finalize()
        worlds = tuple(
            PlayedWorld(
                name,
                {part: each[k] for part, each in record.parts.items()},
                {part: _moved(each[k], room, part) for part, each in record.objects.items()},
                _poses(model, record.joints[k])[:, bodies],
            )
            for k, name in enumerate(record.names)
        )
    return Played(record.rate, tuple(links), worlds)


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
    state, poses = model.state(), []
    for q in joints.astype(np.float32):
        model.joint_q.assign(q)
        newton.eval_fk(model, model.joint_q, model.joint_qd, state)
        poses.append(state.body_q.numpy().copy())
    return np.array(poses)


def _moved(poses: np.ndarray, room: SimRoom, part: str) -> np.ndarray:
    """Return the displacements [frame 4 4] of a free object from its scanned pose, for its poses [frame 7]."""
    body = room.free[part]
    return matrices(poses) @ np.linalg.inv(matrices(np.array([[*body.position, *body.orientation]])))
