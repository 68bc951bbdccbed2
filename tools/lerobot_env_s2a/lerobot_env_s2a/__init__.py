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
import warp as wp
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv

from s2a import tasks
from s2a.commands.collect import Config, worlds
from s2a.core import config
from s2a.core.errors import InputError
from s2a.tasks import pool

PACKAGE = "lerobot_env_s2a"
# Worlds of a pool at once: lerobot-eval makes those of all its parts before the first episode. Of a cabinet alone, one takes
# 60 MB and 2 s, or 0.9 GB as a process of its own.
LIMIT = 64


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
        size: int | None = None,
        render_mode: str = "rgb_array",
    ) -> None:
        """Build the world.

        Args:
            room: the sim.usd of `s2a prepare`.
            task: its name, as "open_part".
            part: what moves, of a room with several.
            keys: further keys of `s2a collect`, as "task.start_noise=0"; none that the other arguments set.
            robot: that the room was prepared for.
            device: "cpu" or "cuda:0".
            size: width and height of the images [pixel]; None: as the keys `views.width` and `views.height` say.
            render_mode: "rgb_array", as the scene's camera sees it.

        Raises:
            InputError: of s2a: an unknown task, part or key; not a simulation-ready room.
        """
        wp.config.log_level = wp.LOG_WARNING  # its lines of versions and modules go to stdout
        given: dict[str, Any] = {
            "task": task,
            "stage": room,
            "part": part or "null",
            "robot": robot,
            "device": device,
            "num_envs": 1,
            "out": "-",
            **({} if size is None else {"views.width": size, "views.height": size}),
        }
        names = [key.partition("=")[0].lstrip("+") for key in keys]
        if again := [name for name in names if name in {*given, "seed"}]:
            raise InputError(
                f"keys has {again[0]!r}, which an argument of the environment or of its reset sets; give that"
            )
        overrides = [*(f"{key}={value}" for key, value in given.items()), *keys]
        settings = config.load(Config, config.compose("collect", overrides, Config))
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
        """Begin an episode; `seed` is that of the start, the cameras and the light. Without one, no two episodes are alike."""
        super().reset(seed=seed)
        self._worlds.reset_all(int(self.np_random.integers(2**31)) if seed is None else seed)
        self._views.begin(self.np_random)
        self._collector.recorder.sample()
        return self._look(self._collector.at_rest()), {}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Move the joint targets to an action within a frame, as far as their speed allows."""
        before = self._last
        worlds, target = self._worlds, torch.as_tensor(np.asarray(action, np.float32), device=self._worlds.sim.device)
        for left in range(self._every, 0, -1):
            now = worlds.sim.joint_target_q[:, : worlds.num_actions]
            worlds.step(((target - now) / (worlds.action_step * left)).clamp(-1.0, 1.0))
            seen = self._collector.recorder.sample()
            if worlds.done.item():
                is_success = bool(worlds.result[0, self._success] > 0.5)
                is_late = bool(worlds.time_out.item())
                return before, float(is_success), not is_late, is_late, {"is_success": is_success}
        return self._look(seen), 0.0, False, False, {"is_success": False}

    def render(self) -> np.ndarray:
        """Return what the scene's camera saw last, shape [height width 3], uint8."""
        image: np.ndarray = self._last["pixels"]["scene"]
        return image

    @property
    def _last(self) -> dict[str, Any]:
        """The last observation."""
        if not self._seen:
            raise ResetNeeded("no episode has begun; call reset first")
        return self._seen

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
    """Return environments as LeRobot orders them: of a room one task; of the index of a pool, one for each of its parts.

    Raises:
        InputError: a part of an index is given; the parts would be more than LIMIT worlds; as of S2aEnv.
    """
    path, parts = Path(room), [{"room": room, **given}]
    if pool.is_index(path):
        if given.get("part"):
            raise InputError(
                f"part={given['part']} chooses from a room, and {room} is a pool; give the sim.usd of its room"
            )
        parts = [{**given, "room": str(path.parent / each.room), "part": each.part} for each in pool.read(path)]
    if len(parts) > 1 and len(parts) * count > LIMIT:
        raise InputError(
            f"{len(parts)} parts of {room} x {count} worlds are more than {LIMIT} at once; "
            "give a smaller batch, or a room and a part at a time"
        )
    return {"s2a": {k: vector(count, asynchronous, **part) for k, part in enumerate(parts)}}


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg: Any = None) -> dict[str, dict[int, VectorEnv]]:
    """Return environments for EnvHub, whose `env.py` imports this.

    Args:
        n_envs: worlds of each task.
        use_async_envs: each in a process of its own.
        cfg: its attributes are arguments of S2aEnv; room, part, task, robot and device may be variables, as S2A_ROOM.

    Raises:
        InputError: no room; as of `vectors`.
    """
    names = ("room", "part", "task", "robot", "device")
    values = {name: getattr(cfg, name, None) or os.environ.get(f"S2A_{name.upper()}") for name in names}
    values |= {name: getattr(cfg, name, None) for name in ("keys", "size")}
    given = {name: value for name, value in values.items() if value}
    if "room" not in given:
        raise InputError("no room; set the variable S2A_ROOM to a sim.usd or to the index of a pool")
    return vectors(count=n_envs, asynchronous=use_async_envs, **given)


for name in tasks.names():
    gymnasium.register(f"{PACKAGE}/{name}", entry_point=S2aEnv, kwargs={"task": name})

if importlib.util.find_spec("lerobot") is not None:  # without it, the environments serve all the same
    from lerobot_env_s2a import lerobot_config as lerobot_config
