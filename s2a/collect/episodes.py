"""Episodes as they are collected: what all worlds saw and did, and what it takes to play each of them again."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from s2a.collect.lerobot import LeRobotDataset, Stats
from s2a.collect.video import ColourVideo, DepthVideo
from s2a.env.vec_env import VecEnv
from s2a.errors import InputError
from s2a.evaluate import Policy
from s2a.outputs import atomic_write
from s2a.sim.recorder import Recorder
from s2a.sim.views import CAMERAS, Views

REPLAY = "replay/episode_{index:06d}.npz"
DEPTH = "depth/{camera}/episode_{index:06d}.mkv"
IMAGES = "observation.images.{camera}"


@dataclass
class Batch:
    """What one episode in every world came to.

    Attributes:
        success: True where it is kept, shape [world].
        columns: of the dataset's features, shape [world frame n].
        actions: of every control step, shape [step world action].
        start: what `VecEnv.state_dict` has of each world at the start, shape [world ...].
        colour, depth: file of each world and camera.
        stats: of the pixels of each world and camera.
    """

    success: np.ndarray
    columns: dict[str, np.ndarray]
    actions: np.ndarray
    start: dict[str, np.ndarray]
    colour: list[dict[str, Path]]
    depth: list[dict[str, Path]]
    stats: list[Stats]


class Collector:
    """Runs episodes and writes those that succeed."""

    def __init__(self, env: VecEnv, recorder: Recorder, views: Views, size: tuple[int, int], every: int) -> None:
        """Keep what is watched.

        Args:
            env: the worlds.
            recorder: of their sensors, made before the environment.
            views: their cameras.
            size: width and height of the images [pixel].
            every: control steps a frame.
        """
        self._env, self._recorder, self._views, self._size, self._every = env, recorder, views, size, every
        sim = env.sim
        rate = 1.0 / (sim.config.dt * sim.config.substeps)
        self.fps = round(rate / every)
        if abs(self.fps * every - rate) > 1e-3 * rate:
            raise InputError(
                f"key 'every' is {every}, and {rate:.4g} control steps a second are no whole number of frames"
            )

    def features(self) -> dict[str, dict[str, object]]:
        """Return the dataset's features."""
        spec, (width, height) = self._env.sim.robot, self._size
        video = {"dtype": "video", "shape": [height, width, 3], "names": ["height", "width", "channels"]}
        about = {
            "video.fps": float(self.fps),
            "video.height": height,
            "video.width": width,
            "video.channels": 3,
            "video.codec": "h264",
            "video.pix_fmt": "yuv420p",
            "video.is_depth_map": False,
            "has_audio": False,
        }
        names = {
            "observation.state": list(spec.recorded[1:]),
            "observation.part": ["position"],
            "action": list(spec.joints),
        }
        numbers: dict[str, dict[str, object]] = {
            name: {"dtype": "float32", "shape": [len(each)], "names": each} for name, each in names.items()
        }
        return {**numbers, **{IMAGES.format(camera=camera): {**video, "info": about} for camera in CAMERAS}}

    @torch.inference_mode()
    def run(self, policy: Policy, seed: int, folder: Path) -> Batch:
        """Run one episode in every world, and write its videos into a folder.

        Args:
            policy: who acts.
            seed: of where the episodes start, and of cameras and light.
            folder: for the videos.
        """
        env, sim, count = self._env, self._env.sim, self._env.num_envs
        env.reset_all(seed)
        self._views.begin(np.random.default_rng(seed))
        start = each_world(env.state_dict(), count)
        joints = sim.layout.robot_joints
        colour = [
            {c: ColourVideo(folder / f"{i}_{c}.mp4", *self._size, self.fps) for c in CAMERAS} for i in range(count)
        ]
        depth = [{c: DepthVideo(folder / f"{i}_{c}.mkv", *self._size, self.fps) for c in CAMERAS} for i in range(count)]
        at_rest = torch.zeros(count, len(sim.robot.recorded) - 1, device=sim.device)
        at_rest[:, :joints] = sim.joint_q[:, :joints]
        self._recorder.sample()
        seen = at_rest
        frames: dict[str, list[np.ndarray]] = {"observation.state": [], "observation.part": [], "action": []}
        actions: list[np.ndarray] = []
        last = env.max_episode_length - 2  # which resets the worlds: a frame is over before it
        for step in range(last + 1):
            whole = step - step % self._every + self._every <= last
            if whole and step % self._every == 0:
                self._look(colour, depth)
                frames["observation.state"].append(seen.cpu().numpy().copy())
                frames["observation.part"].append(self._part())
            action = policy(env.observation.clone())
            actions.append(action.cpu().numpy().copy())
            env.step(action)
            seen = self._recorder.sample()
            if whole and step % self._every == self._every - 1:
                frames["action"].append(sim.joint_target_q[:, :joints].cpu().numpy().copy())
        if not bool(env.done.all()):
            raise InputError("an episode ended before the others; set task.termination_opening so high that none does")
        kept = env.result[:, env.columns.index(env.task.LOGGED[0])].cpu().numpy() > 0.5
        stats = [{IMAGES.format(camera=c): video.close() for c, video in each.items()} for each in colour]
        for each in depth:
            for video in each.values():
                video.close()
        columns = {name: np.stack(values, axis=1).astype(np.float32) for name, values in frames.items()}
        colours = [{IMAGES.format(camera=c): video.path for c, video in each.items()} for each in colour]
        depths = [{c: video.path for c, video in each.items()} for each in depth]
        return Batch(kept, columns, np.stack(actions), start, colours, depths, stats)

    def _look(self, colour: list[dict[str, ColourVideo]], depth: list[dict[str, DepthVideo]]) -> None:
        """Append a frame to all videos."""
        images = self._views.images(self._env.sim.joint_q)
        for camera, (rgb, millimetres) in images.items():
            for i in range(self._env.num_envs):
                colour[i][camera].add(rgb[i])
                depth[i][camera].add(millimetres[i])

    def _part(self) -> np.ndarray:
        """Return the coordinate of each world's part [m or rad], shape [world 1]."""
        sim = self._env.sim
        return sim.joint_q[:, sim.layout.part_coord : sim.layout.part_coord + 1].cpu().numpy().copy()


def each_world(state: Mapping[str, torch.Tensor], count: int) -> dict[str, np.ndarray]:
    """Return those arrays of `VecEnv.state_dict` that have a row a world, shape [world ...]; sums over worlds are left out."""
    rows = {name: value for name, value in state.items() if name != "counts" and len(value) % count == 0 and len(value)}
    return {name: value.reshape(count, -1, *value.shape[1:]).cpu().numpy() for name, value in rows.items()}


def write(dataset: LeRobotDataset, batch: Batch, world: int, task: str) -> None:
    """Add a world's episode to a dataset: what plays it again and its depth first, the episode itself last."""
    index = dataset.count
    replay = dataset.root / REPLAY.format(index=index)
    replay.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(replay) as out, out.open("wb") as file:
        np.savez_compressed(
            file, actions=batch.actions[:, world], **{f"start.{k}": v[world] for k, v in batch.start.items()}
        )
    for camera, source in batch.depth[world].items():
        target = dataset.root / DEPTH.format(camera=camera, index=index)
        target.parent.mkdir(parents=True, exist_ok=True)
        source.replace(target)
    columns = {name: values[world] for name, values in batch.columns.items()}
    dataset.add(columns, batch.colour[world], batch.stats[world], task)


def temporary(root: Path) -> tempfile.TemporaryDirectory[str]:
    """Return a folder in a dataset for files of episodes that are not finished."""
    root.mkdir(parents=True, exist_ok=True)
    return tempfile.TemporaryDirectory(prefix=".unfinished_", dir=root)


def restored(env: VecEnv, episodes: list[dict[str, np.ndarray]]) -> None:
    """Put each world where the episode of the same index in a list began."""
    now = env.state_dict()
    starts = {name: np.stack([each[name] for each in episodes]) for name in episodes[0]}
    state = {
        name: torch.from_numpy(starts[name]).reshape(value.shape).to(value) if name in starts else value
        for name, value in now.items()
    }
    env.load_state_dict(state)
    env.done.zero_()
