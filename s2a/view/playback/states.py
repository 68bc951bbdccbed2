"""States of worlds over time, and their file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import torch

from s2a import robot
from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.learn.collect.episode import ABOUT, FILE
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.simulation import Simulation
from s2a.sim.world import axis_of

T = TypeVar("T")


@dataclass(frozen=True)
class States:
    """What moved in worlds of one room.

    Attributes:
        rate: frames a second.
        robot: its name.
        base: pose of its base, position [m] and quaternion xyzw, scene frame, shape [7].
        sha256: of the room's file.
        names: of the worlds.
        joints: coordinates of the robot's joints [rad, m], for each world of shape [frame joint].
        parts: coordinates of articulated parts by id [m or rad], for each world of shape [frame].
        objects: poses of free objects by id, for each world of shape [frame 7].
        success: The episode of each world succeeded; None: the file does not say.
    """

    rate: float
    robot: str
    base: np.ndarray
    sha256: str
    names: list[str]
    joints: list[np.ndarray]
    parts: dict[str, list[np.ndarray]]
    objects: dict[str, list[np.ndarray]]
    success: list[bool] | None = None

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
        joints = stage.room.articulations
        self._columns = [*range(sim.layout.robot_joints)]
        self._columns += [axis_of(sim.world, i, joints[i].joint.kind)[0] for i in self._parts]
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
        groups = {
            group: {
                name.removeprefix(group): np.split(content[name], ends) for name in content if name.startswith(group)
            }
            for group in ("part.", "object.")
        }
        joints = np.split(content["joints"], ends)
        names = [str(name) for name in content["names"]]
        success = [bool(value) for value in content["success"]] if "success" in content else None
        _check(content, len(names), success)
        robot, sha256 = str(content["robot"]), str(content["sha256"])
        return States(
            float(content["rate"]),
            robot,
            content["base"],
            sha256,
            names,
            joints,
            groups["part."],
            groups["object."],
            success,
        )
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


def read_demonstrations(root: Path, first: int, count: int) -> States:
    """Read some episodes.

    Args:
        root: the dataset's folder.
        first: index of the first one.
        count: of them at most.

    Raises:
        InputError: another folder or format, or no such episode.
    """
    try:
        about, info, stage = (json.loads((root / name).read_text()) for name in (ABOUT, INFO, FILE))
        total = int(info["total_episodes"])
        chosen = range(first, min(first + count, total))
        if not chosen:
            raise InputError(f"{root} has {total} episodes; there is none with index {first}: give a smaller 'first'")
        episodes = [_columns(root, info, index) for index in chosen]
        names = {
            key: info["features"][key]["names"]
            for key in ("observation.part", "observation.objects")
            if key in info["features"]
        }
        joints = len(robot.load(about["robot"]).joints)
        objects = [name.rpartition(".")[0] for name in names.get("observation.objects", [])[::POSE]]
        return States(
            float(info["fps"]),
            about["robot"],
            np.array(stage["base"], dtype=float),
            about["stage_sha256"],
            [f"episode {index}" for index in chosen],
            [each["observation.state"][:, :joints] for each in episodes],
            {
                part: [each["observation.part"][:, i] for each in episodes]
                for i, part in enumerate(names.get("observation.part", []))
            },
            {
                part: [each["observation.objects"][:, POSE * i : POSE * (i + 1)] for each in episodes]
                for i, part in enumerate(objects)
            },
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
    found = {name: np.array(table[name].to_pylist(), dtype=float) for name in wanted}
    return {name: each.reshape(len(each), -1) for name, each in found.items()}
