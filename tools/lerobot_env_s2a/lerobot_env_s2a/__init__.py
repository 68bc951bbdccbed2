"""Rooms of s2a as environments of LeRobot: one world each, with the frames of the datasets that `s2a collect` writes."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from s2a import tasks
from s2a.commands.collect import Config, worlds
from s2a.core import config
from s2a.core.errors import InputError
from s2a.tasks import pool

PACKAGE = "lerobot_env_s2a"


class S2aEnv(gymnasium.Env[dict[str, Any], np.ndarray]):
    """A task in one world.

    Observations: "pixels" of the cameras by name, shape [height width 3], uint8; "agent_pos", "tool", "part" and "objects" as
    `observation.state` and so on of a dataset. Actions are joint targets [rad, m], of one frame. The reward is 1 in the step
    that ends an episode with success, which `info["is_success"]` tells too.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(
        self,
        room: str,
        task: str = "open_part",
        part: str | None = None,
        keys: Sequence[str] = (),
        robot: str = "panda",
        device: str = "cpu",
        render_mode: str = "rgb_array",
    ) -> None:
        """Build the world.

        Args:
            room: the sim.usd of `s2a prepare`.
            task: its name, as "open_part".
            part: what moves, of a room with several.
            keys: further keys of `s2a collect`, as "task.start_noise=0".
            robot: that the room was prepared for.
            device: "cpu" or "cuda:0".
            render_mode: "rgb_array", as the scene's camera sees it.

        Raises:
            InputError: of s2a: an unknown task, part or key; not a simulation-ready room.
        """
        given = {
            "task": task,
            "stage": room,
            "part": part or "null",
            "robot": robot,
            "device": device,
            "num_envs": 1,
            "out": "-",
        }
        settings = config.load(
            Config, config.compose("collect", [*(f"{key}={value}" for key, value in given.items()), *keys])
        )
        self._every, self.render_mode, self.task = settings.every, render_mode, task
        self._worlds, self._views, self._collector, self.task_description = worlds(
            settings, settings.sim, settings.task
        )
        self._success = self._worlds.columns.index(self._worlds.task.RESULTS.logged[0])
        self._max_episode_steps = -(-self._worlds.max_episode_length // self._every)
        features = self._collector.features
        self.metadata = {**self.metadata, "render_fps": features.fps}
        low, high = features.action_range.astype(np.float32)
        self.action_space = Box(low, high)
        (width, height), columns = features.size, features.columns
        numbers = {
            name: Box(-np.inf, np.inf, (len(columns[key]),), np.float32) for key, name in _names(columns).items()
        }
        pixels = {camera: Box(0, 255, (height, width, 3), np.uint8) for camera in features.cameras}
        self.observation_space = Dict({"pixels": Dict(pixels), **numbers})
        self._seen: dict[str, Any] = {}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode; `seed` is that of the start, the cameras and the light."""
        super().reset(seed=seed)
        self._worlds.reset_all(seed)
        self._views.begin(self.np_random)
        self._collector.recorder.sample()
        return self._look(self._collector.at_rest()), {}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Move the joint targets to an action within a frame, as far as their speed allows."""
        worlds, target = self._worlds, torch.as_tensor(np.asarray(action, np.float32), device=self._worlds.sim.device)
        for left in range(self._every, 0, -1):
            now = worlds.sim.joint_target_q[:, : worlds.num_actions]
            worlds.step(((target - now) / (worlds.action_step * left)).clamp(-1.0, 1.0))
            seen = self._collector.recorder.sample()
            if worlds.done.item():
                is_success = bool(worlds.result[0, self._success] > 0.5)
                is_late = bool(worlds.time_out.item())
                return self._seen, float(is_success), not is_late, is_late, {"is_success": is_success}
        return self._look(seen), 0.0, False, False, {"is_success": False}

    def render(self) -> np.ndarray:
        """Return what the scene's camera saw last, shape [height width 3], uint8."""
        image: np.ndarray = self._seen["pixels"]["scene"]
        return image

    def _look(self, seen: torch.Tensor) -> dict[str, Any]:
        columns = self._collector.observed(seen)
        numbers = {name: columns[key][0] for key, name in _names(columns).items()}
        views, joints = self._views, self._worlds.sim.joint_q
        pixels = {
            camera: views.images()["image"][0].cpu().numpy().copy() for camera in views.render(joints, instances=False)
        }
        self._seen = {"pixels": pixels, **numbers}
        return self._seen


def _names(columns: Any) -> dict[str, str]:
    """Return LeRobot's name of each column that is observed, by its name in a dataset."""
    observed = [key for key in columns if key.startswith("observation.")]
    return {key: key.removeprefix("observation.").replace("state", "agent_pos") for key in observed}


def vector(count: int, asynchronous: bool = False, **given: Any) -> VectorEnv:
    """Return `count` environments, each in a process of its own where `asynchronous`; `given` as S2aEnv takes it."""
    kind = AsyncVectorEnv if asynchronous and count > 1 else SyncVectorEnv
    extra: dict[str, Any] = {"context": "forkserver"} if kind is AsyncVectorEnv else {}
    return kind([partial(S2aEnv, **given)] * count, autoreset_mode=AutoresetMode.SAME_STEP, **extra)


def vectors(room: str, count: int, asynchronous: bool = False, **given: Any) -> dict[str, dict[int, VectorEnv]]:
    """Return environments as LeRobot orders them: of a room one task; of the index of a pool, one for each of its parts."""
    path, parts = Path(room), [{"room": room, **given}]
    if pool.is_index(path):
        parts = [{**given, "room": str(path.parent / each.room), "part": each.part} for each in pool.read(path)]
    return {"s2a": {k: vector(count, asynchronous, **part) for k, part in enumerate(parts)}}


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None) -> dict[str, dict[int, VectorEnv]]:
    """Return environments for EnvHub, whose `env.py` imports this; the room is in S2A_ROOM where `cfg` does not name it."""
    names = ("room", "part", "task")
    given = {name: getattr(cfg, name, None) or os.environ.get(f"S2A_{name.upper()}") for name in names}
    if not given["room"]:
        raise InputError("no room; set the variable S2A_ROOM to a sim.usd or to the index of a pool")
    given["task"] = given["task"] or "open_part"
    return vectors(count=n_envs, asynchronous=use_async_envs, **given)


for name in tasks.names():
    gymnasium.register(f"{PACKAGE}/{name}", entry_point=S2aEnv, kwargs={"task": name})

if importlib.util.find_spec("lerobot") is not None:  # without it, the environments serve all the same
    from lerobot_env_s2a import lerobot_config as lerobot_config
