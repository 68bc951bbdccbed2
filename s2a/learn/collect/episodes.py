"""Episodes that are collected: what all worlds saw and did, their folder, and what it takes to play each of them again."""

import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

import dacite
import numpy as np
import torch

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.core.locks import contents
from s2a.core.outputs import atomic_write, replace_file
from s2a.learn.collect.video import CHANNELS, Encoders, FrameMemory, ImageFile, Images, Key
from s2a.robot.urdf import position_limits
from s2a.scene.artefacts import DATASET, DATASET_STAGE
from s2a.scene.usd import sim_stage
from s2a.sim.camera import CAMERAS, Views
from s2a.sim.recorder import Recorder
from s2a.sim.world import SimStage
from s2a.tasks.env import Policy, VecEnv

UNFINISHED = ".unfinished_"  # What the names of folders with images of episodes that are not finished begin with
REPLAY = "replay/episode_{index:06d}.npz"


@dataclass(frozen=True)
class Episode:
    """What one world saw and did."""

    columns: dict[str, np.ndarray]  # numbers of every frame by the name of their feature, shape [frame n]
    images: dict[Key, Images]  # finished files
    task: str  # what the robot was to do, in words
    result: dict[str, float]  # the task's metrics by name
    origin: dict[str, int]  # "seed" of its batch, "world" in it, and "worlds": how many there were
    actions: np.ndarray  # of every control step, shape [step action]
    start: dict[str, np.ndarray]  # what `VecEnv.state_dict` has of its world at the start


@dataclass(frozen=True)
class Features:
    """What every frame holds."""

    robot: str  # its name
    fps: int  # frames a second
    columns: Mapping[str, Sequence[str]]  # names of the numbers of each feature
    cameras: Sequence[str]  # their names
    size: tuple[int, int]  # width and height of the images [pixel]
    action_range: np.ndarray  # least and greatest joint target [rad, m], shape [2 joint]
    world: Mapping[str, object]  # physics and task, as plain values


class Dataset(Protocol):
    """A folder that grows by whole episodes.

    Attributes:
        FILES: how images of each kind are kept.
        root: the folder.
        count: finished episodes.
        frames: in all of them.
    """

    FILES: ClassVar[Mapping[str, type[ImageFile]]]
    root: Path

    def __init__(self, root: Path, features: Features) -> None:
        """Begin a dataset or go on with one; InputError where the folder holds something else."""

    @property
    def count(self) -> int:
        """Number of finished episodes."""

    @property
    def frames(self) -> int:
        """Number of frames in all of them."""

    def add(self, episode: Episode) -> None:
        """Write an episode; it counts when all of it is there."""


def is_foreign(root: Path) -> bool:
    """Return whether a folder holds files, and none that a run of `s2a collect` began with, even if it was killed at once."""
    names = [path for path in contents(root) if not path.name.startswith(UNFINISHED)] if root.is_dir() else []
    return bool(names) and not (root / DATASET).is_file()


def write_replay(root: Path, index: int, episode: Episode) -> None:
    """Write what it takes to play an episode again."""
    path = root / REPLAY.format(index=index)
    groups: dict[str, Mapping[str, Any]] = {"start": episode.start, "origin": episode.origin, "result": episode.result}
    content: dict[str, Any] = {"actions": episode.actions}
    content |= {f"{group}.{name}": value for group, values in groups.items() for name, value in values.items()}
    replace_file(path, lambda part: _save(part, content))


def _save(path: Path, content: Mapping[str, Any]) -> None:
    with path.open("wb") as file:  # to a path, NumPy adds an ending of its own
        np.savez_compressed(file, **content)


def read_replay(root: Path, index: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return how an episode began, by name, and its actions [step action]; InputError where the file is damaged."""
    path = root / REPLAY.format(index=index)
    try:
        with np.load(path) as file:
            names = [name for name in file.files if name.startswith("start.")]
            return {name.removeprefix("start."): file[name] for name in names}, file["actions"]
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read ({error})") from error


Stage = TypeVar("Stage", bound=SimStage)
OF_THE_ROOM = ("path", "room")  # What is read of the room's file


def write_stage(stage: SimStage, root: Path) -> None:
    """Write all of a stage but its room into a dataset's folder."""
    own = {each.name: getattr(stage, each.name) for each in fields(stage) if each.name not in OF_THE_ROOM}
    empty = replace(stage, room=None)  # type: ignore[arg-type]  # not to be copied
    values = {name: value for name, value in asdict(empty).items() if name in own}
    (root / DATASET_STAGE).parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(root / DATASET_STAGE) as out:
        out.write_text(json.dumps(values, default=_plain) + "\n")


def read_stage(kind: type[Stage], path: Path, root: Path) -> Stage:
    """Return a stage of a task's kind in a room's file; InputError where the dataset's file is missing or damaged."""
    file = root / DATASET_STAGE
    rules = dacite.Config(type_hooks={np.ndarray: np.asarray, Path: Path}, cast=[tuple])
    try:
        values = json.loads(file.read_text())
        return dacite.from_dict(kind, {**values, "path": path, "room": sim_stage.read(path, visuals=False)}, rules)
    except (OSError, ValueError, TypeError, dacite.DaciteError) as error:
        raise InputError(f"{file}: not of this version's s2a collect ({error}); collect again") from error


def _plain(value: object) -> object:
    """Return arrays and paths as JSON has them."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


class Collector:
    """Runs episodes, and yields those that succeed.

    Attributes:
        features: what every frame holds.
        recorder: of the sensors.
        encoded: frames of all worlds in the last batch, whether kept or not.
    """

    def __init__(
        self,
        env: VecEnv,
        recorder: Recorder,
        views: Views,
        size: tuple[int, int],
        every: int,
        world: Mapping[str, object],
    ) -> None:
        """Keep what is watched.

        Args:
            env: the worlds.
            recorder: of their sensors, made before the environment.
            views: their cameras.
            size: width and height of the images [pixel].
            every: control steps per frame.
            world: physics and task, as plain values.
        """
        self._env, self.recorder, self._views, self._every = env, recorder, views, every
        sim = env.sim
        rate = sim.config.control_frequency
        fps = round(rate / every)
        if abs(fps * every - rate) > 1e-3 * rate:
            raise InputError(
                f"key 'every' is {every}, and {rate:.4g} control steps a second are no whole number of frames"
            )
        stage, spec = sim.stage, sim.robot
        self._parts = [i for i in stage.active if i in stage.room.articulations]
        self._objects = [i for i in stage.active if i in stage.room.free]
        self._tool = torch.tensor([*spec.tool_offset, 0.0, 0.0, 0.0, 1.0], device=sim.device)
        columns = {
            "observation.state": spec.recorded[1:],
            "observation.tool": POSE,
            "observation.part": self._parts,
            "observation.objects": [f"{i}.{name}" for i in self._objects for name in POSE],
            "action": spec.joints,
        }
        columns = {name: tuple(each) for name, each in columns.items() if len(each)}
        self.features = Features(spec.name, fps, columns, CAMERAS, size, position_limits(spec), world)
        self.encoded = 0
        self._coords = [sim.axis_of(i)[0] for i in self._parts]
        self._bodies = [sim.body(i) for i in self._objects]

    @property
    def device(self) -> str:
        """Where it is simulated."""
        return str(self._env.sim.device)

    def encoders(self, dataset: Dataset | type[Dataset]) -> Encoders:
        """Return the processes that write the images of a batch as a dataset keeps them."""
        keys = tuple((camera, kind) for camera in CAMERAS for kind in CHANNELS)
        layout = FrameMemory(keys, self._env.num_envs, self.features.size)
        return Encoders(layout, dataset.FILES, self.features.fps)

    @torch.inference_mode()
    def run(self, policy: Policy, seed: int, folder: Path, encoders: Encoders, task: str) -> Iterator[Episode]:
        """Run one episode in every world, and yield those that succeed.

        `seed`: of where the episodes start, and of cameras and light.
        """
        env, count = self._env, self._env.num_envs
        env.reset_all(seed)
        self._views.begin(np.random.default_rng(seed))
        start = each_world(env.state_dict(), count)
        encoders.begin(folder)
        watch = _Watch(env)
        frames: list[dict[str, np.ndarray]] = []
        lengths = np.zeros(count, dtype=int)
        self.recorder.sample()
        seen = self.at_rest()
        while watch.alive.any():
            self.render(encoders)
            frame = self.observed(seen)
            for _ in range(self._every):
                seen = watch.step(policy, self.recorder)
            frame["action"] = _numbers(env.sim.joint_target_q[:, : env.num_actions])
            frames.append(frame)
            encoders.add(watch.alive)
            lengths += watch.alive
        self.encoded = int(lengths.sum())
        columns = {name: np.stack([each[name] for each in frames], axis=1) for name in self.features.columns}
        files, actions = encoders.end(), np.stack(watch.actions)
        for world in np.flatnonzero(watch.result[:, env.columns.index(env.task.RESULTS.logged[0])] > 0.5):
            yield Episode(
                {name: each[world, : lengths[world]] for name, each in columns.items()},
                files[world],
                task,
                dict(zip(env.columns, watch.result[world].tolist(), strict=True)),
                {"seed": seed, "world": int(world), "worlds": count},
                actions[: watch.steps[world], world],
                {name: each[world] for name, each in start.items()},
            )

    def render(self, encoders: Encoders) -> None:
        """Put what all cameras see where it is encoded from."""
        slot = encoders.slot()
        for camera in self._views.render(self._env.sim.joint_q):
            for kind, image in self._views.images().items():
                target = slot[camera, kind]
                torch.from_numpy(target.view(np.int16) if kind != "image" else target).copy_(image)

    def observed(self, seen: torch.Tensor) -> dict[str, np.ndarray]:
        """Return what is observed now by the name of its feature, shape [world n] each; `seen`: what the recorder observed."""
        sim = self._env.sim
        links = sim.body_q[:, sim.layout.tool_body]
        columns = {"observation.state": seen, "observation.tool": _composed(links, self._tool)}
        if self._coords:
            columns["observation.part"] = sim.joint_q[:, self._coords]
        if self._bodies:
            columns["observation.objects"] = sim.body_q[:, self._bodies].flatten(1)
        return {name: _numbers(values) for name, values in columns.items()}

    def at_rest(self) -> torch.Tensor:
        """Return what the robot's sensors would tell of the start, had it stood there: no torques are known yet."""
        sim = self._env.sim
        sensors = torch.zeros(sim.num_envs, len(sim.robot.recorded) - 1, device=sim.device)
        sensors[:, : sim.layout.robot_joints] = sim.joint_q[:, : sim.layout.robot_joints]
        return sensors


class _Watch:
    """Which worlds are still in their first episode, and how that of the others ended."""

    def __init__(self, env: VecEnv) -> None:
        self._env = env
        self.alive = np.ones(env.num_envs, dtype=bool)
        self.steps = np.zeros(env.num_envs, dtype=int)
        self.result = np.zeros((env.num_envs, len(env.columns)), dtype=np.float32)
        self.actions: list[np.ndarray] = []

    def step(self, policy: Policy, recorder: Recorder) -> torch.Tensor:
        """Do a control step; return what the robot's sensors told."""
        action = policy(self._env.observation.clone())
        self.actions.append(_numbers(action))
        self._env.step(action)
        self.steps += self.alive
        ended = self.alive & (self._env.done.cpu().numpy() == 1)
        if ended.any():
            self.result[ended] = self._env.result.cpu().numpy()[ended]
            self.alive &= ~ended
        return recorder.sample()


def _numbers(values: torch.Tensor) -> np.ndarray:
    """Return a copy."""
    return values.to(torch.float32).cpu().numpy().copy()


def _composed(pose: torch.Tensor, local: torch.Tensor) -> torch.Tensor:
    """Return the pose of a frame that is moved by a vector in poses [... 7], position and quaternion xyzw."""
    v, w = pose[..., 3:6], pose[..., 6:]
    offset = local[:3].expand_as(v)
    turned = offset + 2.0 * torch.cross(v, torch.cross(v, offset, dim=-1) + w * offset, dim=-1)
    return torch.cat([pose[..., :3] + turned, pose[..., 3:]], dim=-1)


def each_world(state: Mapping[str, torch.Tensor], count: int) -> dict[str, np.ndarray]:
    """Return those arrays of `VecEnv.state_dict` that have a row a world, shape [world ...]; sums over worlds are left out."""
    rows = {name: value for name, value in state.items() if name != "counts" and len(value) % count == 0 and len(value)}
    return {name: value.reshape(count, -1, *value.shape[1:]).cpu().numpy() for name, value in rows.items()}


def temporary(root: Path) -> tempfile.TemporaryDirectory[str]:
    """Return a folder in a dataset for files of episodes that are not finished; those of a run that was killed are deleted."""
    root.mkdir(parents=True, exist_ok=True)
    for left in root.glob(f"{UNFINISHED}*"):
        shutil.rmtree(left, ignore_errors=True)
    return tempfile.TemporaryDirectory(prefix=UNFINISHED, dir=root)


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
