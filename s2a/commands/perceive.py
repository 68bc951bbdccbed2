"""Command `s2a perceive`: train a policy that observes parts with depth cameras."""

from __future__ import annotations

import copy
import json
import math
import re
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from s2a import tasks
from s2a.core import config as settings
from s2a.core.bounds import Count, CountFromZero, Fraction, Positive
from s2a.core.check import as_json
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.learn.evaluate import by_part
from s2a.learn.perception.follow import (
    DEPTH,
    EVERY,
    Follower,
    Sighting,
    StatePolicy,
    cells,
    export,
    read_network,
    state_world,
    write_network,
)
from s2a.learn.perception.sight import (
    SIDEWAYS,
    C,
    SightFrame,
    SightNetwork,
    fractions,
    loss,
    observed,
    truths,
    turned,
    turned_estimate,
)
from s2a.learn.rl.policy_file import PRETRAINED
from s2a.robot.tool_path import matrices
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT
from s2a.sim.depth_cameras import DepthCameraConfig, WorldCameras, tool_poses
from s2a.sim.simulation import Simulation, device_of
from s2a.tasks import make_env, pool
from s2a.tasks.base import active, columns_of
from s2a.tasks.env import VecEnv

STORE = 0.5  # Fraction of the worlds whose frames are kept
ACTION_WEIGHT = 2.0  # Of the difference of the actions in the loss
TURN, SCALE = 0.5, 1.1  # Frames are turned about the vertical by at most this [rad], and scaled by at most this factor
EMA = 0.995  # Fraction of the averaged weights, which act, that an update leaves
WARM_UP, FALL = 200, 0.4  # Updates in which the rate rises; last fraction of the frames in which it falls
TAUGHT_FIRST = 0.25  # Fraction of the frames within which the policy of states drives fewer and fewer worlds


@dataclass(frozen=True, kw_only=True)
class SightConfig:
    """How the network is trained.

    Attributes:
        capacity: number of frames that are kept.
        batch: frames per step of the optimiser.
        updates: steps of the optimiser per frame of all worlds.
        learning_rate: the maximum.
        teacher: fraction of the worlds that the policy of states drives by the truth.
        width: width of the network's first layers.
    """

    capacity: Count
    batch: Count
    updates: Count
    learning_rate: Positive = 0.001
    teacher: Fraction = 0.25
    width: Count = 64


@dataclass(frozen=True)
class Config:
    """Keys of `s2a perceive`.

    Attributes:
        stage: the index of a pool that was made with visuals.
        out: folder of policy.depth, for policy=; policy_estimate.onnx and policy_act.onnx; and metrics.json. While it runs,
            unfinished.depth is the policy so far.
        init: policy to begin with: pretrained_depth, or a .depth; null: none.
        held_out: regular expression of rooms to measure on, which are not trained on; null: none.
        frames: number of frames to train on, each of all worlds; 0: only measure.
        num_envs: worlds that are stepped together.
        steps: control steps of an episode.
        network: the network and its training.
        depth_camera: the depth cameras and their errors.
        device: cpu, cuda:0, or auto: a GPU where there is one.
        seed: seed of the network and of the samples.
    """

    stage: Path
    out: Output
    init: Path | None
    held_out: str | None
    frames: CountFromZero
    num_envs: Count
    steps: Count
    network: SightConfig
    depth_camera: DepthCameraConfig
    device: str
    seed: CountFromZero


def run(config: Config) -> str:
    """Train, measure on the rooms that are held out, write the policy, and return the rates."""
    entries, stages = pool.read(config.stage), pool.stages(config.stage, DEFAULT_ROBOT)
    try:
        held = np.array([bool(config.held_out and re.search(config.held_out, entry.room)) for entry in entries])
    except re.error as error:
        text = f"key 'held_out' is {config.held_out!r}: no regular expression ({error}); give one, such as _1\\d\\d"
        raise InputError(text) from error
    if not config.frames and not config.init:
        raise InputError("key 'frames' is 0, and there is no policy to measure; give init=pretrained_depth or a .depth")
    if held.all() and config.frames:
        raise InputError(
            f"key 'held_out' is {config.held_out!r}, which leaves no room to train on; give a narrower pattern"
        )
    if config.num_envs < len(stages):
        raise InputError(
            f"key 'num_envs' is {config.num_envs}, and {config.stage} has {len(stages)} parts; give as many"
        )
    physics, task = state_world()
    torch.manual_seed(config.seed)
    metrics = settings.load(tasks.task(task.name).Metrics, settings.file(f"metrics/{task.name}"))
    network = read_network(config.init) if config.init else SightNetwork(config.network.width)
    device = device_of(config.device)
    sim = Simulation(stages, physics, config.num_envs, device)
    env = make_env(sim, replace(task, episode_steps=config.steps), metrics, {}, config.seed)
    cameras = WorldCameras(sim, config.depth_camera, config.seed)
    trainer = Trainer(env, cameras, network, config.network, torch.tensor(held[sim.stage_of_env]), config.seed)
    history: list[dict[str, float]] = []
    _stagger(env, config.seed)
    begun, unfinished = time.perf_counter(), config.out / f"unfinished{DEPTH}"
    for frame in track(range(config.frames), "perceive"):
        done = frame / config.frames
        trainer.drive(taught=0.0 if config.init else max(0.0, 1.0 - done / TAUGHT_FIRST))
        trainer.learn(min(1.0, max(0.05, (1.0 - done) / FALL)))
        if frame % max(1, config.frames // 50) == 0 and trainer.losses:
            history.append({name: round(float(term), 4) for name, term in trainer.losses.items()})
        if frame % max(1, config.frames // 10) == 0:
            config.out.mkdir(parents=True, exist_ok=True)
            write_network(trainer.acting, unfinished)
    trained = time.perf_counter() - begun
    config.out.mkdir(parents=True, exist_ok=True)
    write_network(trainer.acting, config.out / f"policy{DEPTH}")
    unfinished.unlink(missing_ok=True)
    export(trainer.acting, config.out / f"policy{DEPTH}")
    measured = _measured(trainer, entries, config, held)
    about = {"settings": json.loads(json.dumps(as_json(asdict(config)), default=str)), "train_seconds": round(trained)}
    with atomic_write(config.out / "metrics.json") as file:
        file.write_text(json.dumps({**about, **measured, "losses": history, **provenance(device)}, indent=1))
    rates = [
        f"{name} {row['rate']:.1%} [{row['low']:.1%}, {row['high']:.1%}]" for name, row in measured["rates"].items()
    ]
    where = "rooms that were held out" if held.any() else "rooms that it was trained on"
    return f"{config.out / f'policy{DEPTH}'}: in {where}: {', '.join(rates)}"


def _stagger(env: VecEnv, seed: int) -> None:
    """Let the first episodes of the worlds end at different times, uncounted."""
    generator = torch.Generator().manual_seed(seed)
    steps = torch.randint(env.max_episode_length, (env.num_envs,), generator=generator)
    env.episode_step.copy_(steps.to(env.episode_step))
    env.uncounted.fill_(1)


def _measured(trainer: Trainer, entries: list[pool.PoolPart], config: Config, held: np.ndarray) -> dict[str, Any]:
    """Return what one episode in every world comes to, of the parts that were held out where there are any."""
    env = trainer.env
    env.reset_all(config.seed + 1)
    trainer.follower.forget(torch.ones_like(trainer.held_out))
    trainer.counts.zero_()
    errors = []
    for _ in track(range(math.ceil(config.steps / EVERY)), "measure"):
        trainer.drive(taught=-1.0)
        errors.append(trainer.errors().cpu().numpy())
    counts, stage = trainer.counts.cpu().numpy(), env.sim.stage_of_env
    chosen = held if held.any() else ~held
    worlds = chosen[stage] & (counts[:, 0] > 0)
    rows = np.flatnonzero(chosen)
    index = np.searchsorted(rows, stage[worlds])
    rates = {name: counts[worlds, i] / counts[worlds, 0] for i, name in ((1, "success"), (2, "grasp_success"))}
    tables = by_part(rates, [entries[i] for i in rows], index, config.seed)
    over = tables["over_parts"]["all"]
    quantiles = np.quantile(np.concatenate([each[chosen[stage]] for each in errors]), (0.5, 0.95))
    return {"rates": {name: over[name] for name in rates}, "grasp_error_m": quantiles.tolist(), **tables}


class Replay:
    """Frames of some worlds with what was true in them; the oldest are overwritten."""

    def __init__(self, capacity: int) -> None:
        """Begin empty; memory is taken with the first frames."""
        self._capacity, self._next, self.count = capacity, 0, 0
        self._of: dict[str, torch.Tensor] = {}

    def add(self, values: dict[str, torch.Tensor]) -> None:
        """Add rows; of more than there is room for, the last."""
        values = {name: value[-self._capacity :] for name, value in values.items()}
        if not self._of:
            self._of = {n: v.new_zeros(self._capacity, *v.shape[1:]) for n, v in values.items()}
        rows, device = len(values["truth"]), values["truth"].device
        index = torch.arange(self._next, self._next + rows, device=device) % self._capacity
        for name, value in values.items():
            self._of[name][index] = value
        self._next = (self._next + rows) % self._capacity
        self.count = min(self._capacity, self.count + rows)

    def sample(self, batch: int) -> dict[str, torch.Tensor]:
        """Return rows, drawn evenly."""
        index = torch.randint(self.count, (batch,), device=self._of["truth"].device)
        return {name: value[index] for name, value in self._of.items()}


class Trainer:
    """Trains while the worlds go on, in the states to which the policy comes by its own estimates (DAgger, Ross et al. 2011)."""

    def __init__(
        self,
        env: VecEnv,
        cameras: WorldCameras,
        network: SightNetwork,
        config: SightConfig,
        held_out: torch.Tensor,
        seed: int,
    ) -> None:
        """Begin; `held_out`: worlds whose parts are not trained on, shape [world], bool."""
        self.env, self.config, self.device = env, config, env.sim.device
        self.network = network.to(self.device).train().requires_grad_(True)
        self.acting = copy.deepcopy(network).requires_grad_(False)
        self.policy = StatePolicy(Path(PRETRAINED)).to(self.device)
        self.optimizer = torch.optim.AdamW(self.network.parameters(), config.learning_rate, weight_decay=0.01)
        self.follower = Follower(env, cameras, self.acting, self.policy, seed)
        self.replay, self.held_out = Replay(config.capacity), held_out.to(self.device)
        self._lot = torch.rand(env.num_envs, generator=torch.Generator().manual_seed(seed)).to(self.device)
        critic = columns_of(active(env.task.CRITIC, env.task.config), env.num_actions)
        self._grasped = critic["grasped"].start
        self._flip = _flips(env.sim).to(self.device)
        self.updates = 0
        self.losses: dict[str, torch.Tensor] = {}
        self._columns = [env.task.RESULTS.names.index(name) for name in ("success", "grasp_success")]
        self.counts = torch.zeros(env.num_envs, 3, device=self.device)

    def exact(self) -> torch.Tensor:
        """Return what the task observes of the truth, of both directions across a handle that of SIDEWAYS."""
        out = self.env.observation.clone()
        out[:, self.env.task.columns["grasp_y"]] *= self._flip
        return out

    def truth(self) -> torch.Tensor:
        """Return the true estimates, base frame, shape [world WIDTH]."""
        grasped = self.env.privileged[:, self._grasped]
        return truths(self.exact(), self.env.task.columns, tool_poses(self.env.sim, self.follower.cameras), grasped)

    def errors(self) -> torch.Tensor:
        """Return the distance of the estimated grasp from the true one [m], shape [world]."""
        return (self.follower.estimate[:, C["point"]] - self.truth()[:, C["point"]]).norm(dim=1)

    def drive(self, taught: float) -> None:
        """Take a frame and go on to the next; the policy of states drives at least this fraction of the worlds, below 0 none.

        Worlds whose parts are held out are never driven by it, nor stored.
        """
        env, truth = self.env, self.truth()
        sighting = self.follower.observe()
        if taught >= 0.0:
            self._store(sighting, truth)
        teacher = (self._lot < (max(taught, self.config.teacher) if taught >= 0.0 else 0.0)) & ~self.held_out
        for _ in range(EVERY):
            with torch.no_grad():
                action = self.follower.act(env.observation.clone())
                best = self.policy(self.exact()).clamp(-1.0, 1.0)
                action = torch.where(teacher[:, None], best, action)
            counted = env.uncounted == 0
            env.step(action)
            done = env.done == 1
            ended = (done & counted).float()[:, None]
            self.counts += torch.cat([ended, torch.nan_to_num(env.result[:, self._columns] * ended)], dim=1)
            self.follower.forget(done)

    def _store(self, sighting: Sighting, truth: torch.Tensor) -> None:
        """Keep a frame of some worlds."""
        truth = truth.clone()
        truth[:, C["point"]] -= sighting.about
        rows = {
            "points": sighting.frame.points.half(),
            "target": sighting.frame.target,
            "before": sighting.frame.before,
            "tool": sighting.frame.tool,
            "truth": truth,
            "about": sighting.about,
            "is_part": (255.0 * sighting.is_part).to(torch.uint8),
            "observation": self.exact(),
            "pose": tool_poses(self.env.sim, self.follower.cameras),
        }
        some = self.follower.started & ~self.held_out & (torch.rand(len(truth), device=self.device) < STORE)
        self.replay.add({name: value[some] for name, value in rows.items()})

    def learn(self, rate: float) -> None:
        """Take steps of the optimiser at a fraction of the learning rate, once enough is stored."""
        if self.replay.count < min(4 * self.config.batch, self.config.capacity // 2):
            return
        for _ in range(self.config.updates):
            for group in self.optimizer.param_groups:
                group["lr"] = self.config.learning_rate * rate * min(1.0, (self.updates + 1) / WARM_UP)
            self._update(self.replay.sample(self.config.batch))

    def _update(self, row: dict[str, torch.Tensor]) -> None:
        truth, n = row["truth"], len(row["truth"])

        def uniform(most: float) -> torch.Tensor:
            return (2.0 * torch.rand(n, 1, device=self.device) - 1.0) * most

        angle, scale, mirror = uniform(TURN), torch.exp(uniform(math.log(SCALE))), uniform(1.0).sign()
        zero, one = torch.zeros_like(angle), torch.ones_like(angle)
        rows = [angle.cos(), -angle.sin() * mirror, zero, angle.sin(), angle.cos() * mirror, zero, zero, zero, one]
        turn = torch.cat(rows, dim=1).view(n, 3, 3)
        frame = SightFrame(row["points"].float(), row["target"], row["before"], row["tool"])
        varied, wanted = turned(frame, truth, turn, scale, mirror)
        with torch.autocast(kind := torch.device(self.device).type, torch.bfloat16, enabled=kind == "cuda"):
            numbers, guess, mask = self.network(varied)
        numbers, guess, mask = numbers.float(), guess.float(), mask.float()
        there = (cells(row["points"][..., 0].isfinite()) > 0.0).float()
        terms = loss(numbers, guess, mask, wanted, row["is_part"].float() / 255.0, there)
        hinge = truth[:, C["slides"]] < 0.5
        back = turned_estimate(fractions(numbers), turn.transpose(1, 2), 1.0 / scale, mirror, hinge)
        terms["action"] = ACTION_WEIGHT * self._action_loss(back, row)
        self.optimizer.zero_grad()
        sum(terms.values()).backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 1.0)
        self.optimizer.step()
        keep = min(EMA, self.updates / (self.updates + 10.0))
        with torch.no_grad():
            for mine, new in zip(self.acting.parameters(), self.network.parameters(), strict=True):
                mine.lerp_(new, 1.0 - keep)
        self.updates += 1
        for name, term in terms.items():
            mean = self.losses.get(name, term.detach())
            self.losses[name] = mean + 0.02 * (term.detach() - mean)

    def _action_loss(self, estimate: torch.Tensor, row: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return how far the policy's action on estimates is from that on the truth."""
        absolute = torch.cat([estimate[:, :3] + row["about"], estimate[:, 3:]], dim=1)
        believed = observed(row["observation"], self.env.task.columns, row["pose"], absolute, 0.0)
        # The coordinate's sign is the joint's own, which an estimate does not have; it tells the policy nothing else.
        action = self.policy(believed.clamp(-5.0, 5.0)).clamp(-1.5, 1.5)
        wanted = self.policy(row["observation"]).clamp(-1.0, 1.0)
        return nn.functional.huber_loss(action, wanted, reduction="none").sum(dim=1).mean()


def _flips(sim: Simulation) -> torch.Tensor:
    """Return -1 where a stage's grasp has the other of the two directions across its handle than SIDEWAYS, shape [world 1]."""
    signs = []
    for stage in sim.stages:
        base, grasp = (matrices(pose[None])[0][:3, :3] for pose in (stage.base, stage.grasp))
        signs.append(1.0 if (base.T @ grasp[:, 1]) @ SIDEWAYS >= 0.0 else -1.0)
    return torch.tensor(np.array(signs)[sim.stage_of_env], dtype=torch.float32)[:, None]
