"""Command `s2a bench`: measure a policy on held-out furniture, part by part, or verify such a measurement."""

import hashlib
import json
import logging
import math
import secrets
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from s2a import tasks
from s2a.commands.worlds import EpisodesConfig
from s2a.core.bounds import Count, NotNegative
from s2a.core.check import as_json
from s2a.core.errors import CheckFailed, InputError
from s2a.core.outputs import Output, atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.learn.evaluate import baseline, by_part, overstated, run_episodes, unsound
from s2a.learn.perception import follow
from s2a.learn.perception.follow import read_policy
from s2a.learn.rl.ppo import load_policy
from s2a.learn.rl.run_folder import read_world
from s2a.motion.policy import Planner
from s2a.motion.trajectory import Demonstration
from s2a.sim.depth_cameras import DepthCameraConfig
from s2a.sim.simulation import Simulation, device_of
from s2a.sim.world import SimStage
from s2a.tasks import make_env, pool
from s2a.tasks.base import MdpConfig
from s2a.tasks.env import Policy, VecEnv

_log = logging.getLogger(__name__)

PLANNER, RANDOM = "planner", "random"
# Keys in which a verification may differ; and hashes that a result holds, with the keys they are of
FREE = "out", "device", "num_envs", "seed", "stage", "policy", "verify"
HASHES = {"policy_sha256": "policy", "parts_sha256": "stage"}
TENTH, LEAST = 10, 10  # Of so many parts, a verification measures one again; and at least so many, or all
# An environment and the planner's motions of its parts -> the policy that drives it
Actor = Callable[[VecEnv, Sequence[Demonstration]], Policy]


@dataclass(frozen=True)
class Config(EpisodesConfig):
    """Keys of `s2a bench`.

    Attributes:
        stage: the index of the parts, as `s2a pool +split=test` writes it.
        policy: planner, random, pretrained, pretrained_depth, or the file of a trained policy: model_N.onnx, model_N.pt, or a
            .depth of s2a perceive, which needs a pool with visuals.
        out: the results, a JSON file.
        verify: results of the same policy on the same parts: a randomly drawn tenth of the parts is measured again.
        episodes: number of episodes per part.
        steps: control steps of an episode, the same for all policies.
        num_envs: worlds that are stepped together, at most.
        device: cpu, cuda:0, or auto: a GPU where there is one.
        seed: seed of start noise and of the differences between worlds.
        task: task settings; a trained policy has its own settings of its observations.
        depth_camera: the cameras of a policy with depth cameras.
        grasp_error: distance of the observed grasp from the true one [m], in a random direction; null: as in a
            trained policy's training, and the planner observes the true one.
        grasp_turn: its rotation off the true one [degree], about a random axis; null: likewise.
    """

    policy: str
    out: Output
    verify: Path | None
    episodes: Count
    steps: Count
    grasp_error: NotNegative | None
    grasp_turn: NotNegative | None
    depth_camera: DepthCameraConfig


def run(config: Config) -> str:
    """Run the episodes, write the results, and return a table of them; CheckFailed: they contradict what is verified."""
    if config.num_envs < config.episodes:
        raise InputError(
            f"key 'num_envs' is {config.num_envs}, and a part has {config.episodes} episodes; give num_envs={config.episodes} "
            "or more, or fewer episodes"
        )
    who, task, act = _actor(config)
    entries, motions = pool.read(config.stage), pool.motions(config.stage)
    device, stages = device_of(config.device), pool.stages(config.stage, config.robot.name)
    made = _made(config, entries)
    claim = _claim(config.verify, made, entries, tasks.task(task.name).RESULTS.rates) if config.verify else None
    draw = secrets.randbits(64)  # nobody knows before which parts are measured again
    drawn = np.arange(len(entries))
    if claim:
        drawn = np.sort(np.random.default_rng(draw).permutation(drawn)[: max(LEAST, math.ceil(len(drawn) / TENTH))])
    entries, motions, stages = [entries[i] for i in drawn], [motions[i] for i in drawn], [stages[i] for i in drawn]
    longest = 0
    batches = list(_batches(stages, config.num_envs // config.episodes))
    columns: dict[str, list[torch.Tensor]] = {}
    cut: list[str] = []
    for first, stages in track(batches, "bench"):
        sim = Simulation(stages, config.sim, len(stages) * config.episodes, device)
        env = make_env(sim, task, config.metrics, {}, config.seed + first)
        actor = act(env, motions[first : first + len(stages)])
        if isinstance(actor, Planner):
            cut += [entries[first + i].part for i in actor.cut]
            longest = max(longest, actor.episode_steps)
        done = run_episodes(env, actor)
        for name in env.task.RESULTS.rates:
            columns.setdefault(name, []).append(_by_stage(done[name], sim.stage_of_env))
    rates = {name: torch.cat(values).numpy() for name, values in columns.items()}
    tables = by_part(rates, entries, np.repeat(np.arange(len(entries)), config.episodes), config.seed)
    about = {"policy": who, "episodes_a_part": config.episodes, "steps": config.steps, "seed": config.seed}
    about |= {
        "grasp_error": config.grasp_error,
        "grasp_turn": config.grasp_turn,
        **made,
    }
    shown = [name for name in rates if name in env.task.RESULTS.logged[:2]]
    if cut:
        about["plans_cut"] = cut
        text = "%d of %d plans are longer than an episode of %d steps and count as failures; give steps=%d"
        _log.warning(text, len(cut), len(entries), config.steps, longest)
    why: list[str] = []
    if claim:
        why = overstated(claim["parts"], tables["parts"], list(rates))
        about |= {"verifies": str(config.verify), "draw": draw, "doubts": why}
    with atomic_write(config.out) as file:
        file.write_text(json.dumps({**about, **tables, **provenance(device)}, indent=1))
    lines = [f"{config.out}: {who}, episodes per part: {config.episodes}", *_table(tables["over_parts"], shown)]
    if claim:
        lines.insert(1, f"  {config.verify}: {'refused' if why else 'confirmed'} by {len(entries)} drawn parts")
        lines[2:2] = [f"    {each}" for each in why]
    if why:
        raise CheckFailed("\n".join(lines))
    return "\n".join(lines)


def _made(config: Config, entries: Sequence[pool.PoolPart]) -> dict[str, Any]:
    """Return what a measurement is of: HASHES of files (None: there is none), and the settings."""
    files = [name for each in entries for name in (each.room, each.motion) if name]
    digest = hashlib.sha256(json.dumps(as_json(entries)).encode())
    for name in dict.fromkeys(files):
        digest.update((config.stage.parent / name).read_bytes())
    policy = None if config.policy in (PLANNER, RANDOM) else follow.file_of(Path(config.policy))
    settings = {name: value for name, value in asdict(config).items() if name not in FREE}
    return {
        "policy_sha256": policy and hashlib.sha256(policy.read_bytes()).hexdigest(),
        "parts_sha256": digest.hexdigest(),
        "settings": json.loads(json.dumps(as_json(settings), default=str)),
    }


def _claim(path: Path, made: dict[str, Any], entries: Sequence[pool.PoolPart], rates: Iterable[str]) -> dict[str, Any]:
    """Return the results that are verified.

    Raises:
        InputError: they are none, or of another policy, other parts or settings.
        CheckFailed: they contradict themselves.
    """
    try:
        claim = json.loads(path.read_text())
        claimed = {name: claim[name] for name in (*HASHES, "settings")}
        claim["parts"][0]["episodes"], claim["over_parts"]["all"]
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise InputError(f"verify {str(path)!r}: no results of s2a bench of this version ({error!r})") from error
    for name, what in HASHES.items():
        if claimed[name] != made[name]:
            raise InputError(
                f"verify {str(path)!r} is of another {what}: the files of key {what!r} differ; give those it was measured with"
            )
    for key, value in made["settings"].items():
        other = claimed["settings"].get(key)
        if other != value:
            short = (
                other
                if not isinstance(value, dict) or not isinstance(other, dict)
                else {k: other.get(k) for k in value if other.get(k) != value[k]}
            )
            raise InputError(f"verify {str(path)!r} was measured with another key {key!r}: {short}; give the same")
    try:
        why = unsound(claim, entries, made["settings"]["episodes"], list(rates))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"verify {str(path)!r}: no results of s2a bench of this version ({error!r})") from error
    if why:
        raise CheckFailed("\n    ".join([f"{path}: refused before a part was measured", *why]))
    return dict(claim)


def _actor(config: Config) -> tuple[str, MdpConfig, Actor]:
    """Return the policy's name, the task as it observes it, and the policy that drives it.

    Raises:
        InputError: there is no such policy, or it was trained on an arm with other limits.
    """
    plain = _asked(config, config.task)
    if config.policy == PLANNER:
        return PLANNER, plain, lambda env, motions: Planner(env, config.planner, motions)
    if config.policy == RANDOM:
        return RANDOM, plain, lambda env, motions: baseline("random", env, config.seed)
    path = Path(config.policy)
    if path.suffix == ".pt":
        world, name = read_world(path), f"{path.absolute().parent.name}_{path.stem}"
    else:
        file = read_policy(path, config.depth_camera)
        if follow.is_depth(path) and (config.grasp_error is not None or config.grasp_turn is not None):
            raise InputError(
                "keys 'grasp_error' and 'grasp_turn' apply to policies that observe true poses; leave them out"
            )
        world, name = file.worlds(config.sim, config.task), Path(file.name).stem
    if world is None:
        raise InputError(
            f"policy {config.policy!r}: no world.json beside it; give a checkpoint in the folder of its run"
        )
    sim, task = world
    if sim.limits != config.sim.limits:
        raise InputError(
            f"policy {config.policy!r}: trained on an arm with limits {sim.limits}, and the benchmark's has {config.sim.limits}; "
            "train with sim=real or sim=varied"
        )
    task = _asked(config, task)
    if path.suffix == ".pt":
        return name, task, lambda env, motions: load_policy(env, path)
    return name, task, lambda env, motions: file.bound(env)


def _asked(config: Config, task: MdpConfig) -> MdpConfig:
    """Return a policy's task with what the benchmark asks instead: length of episodes, error of the grasp that is seen."""
    errors = {name: getattr(config, name) for name in ("grasp_error", "grasp_turn")}
    bounds: dict[str, Any] = {name: (value, value) for name, value in errors.items() if value is not None}
    return replace(task, episode_steps=config.steps, **bounds)


def _batches(stages: Sequence[SimStage], most: int) -> Iterator[tuple[int, list[SimStage]]]:
    """Yield the stages in batches of at most `most`, with the index of each one's first."""
    for first in range(0, len(stages), most):
        yield first, list(stages[first : first + most])


def _by_stage(values: torch.Tensor, stage: np.ndarray) -> torch.Tensor:
    """Return the episodes' values in the order of their stages."""
    return values[torch.from_numpy(np.argsort(stage, kind="stable"))]


def _table(over_parts: dict[str, Any], names: Sequence[str]) -> list[str]:
    """Return lines of some rates, with intervals."""
    groups = [("all", over_parts["all"])]
    groups += [(f"{by} {name}", row) for by in ("kind", "handle", "room") for name, row in over_parts[by].items()]
    lines = [f"  {'':24}{'parts':>6}  {''.join(f'{name:25}' for name in names)}".rstrip()]
    for name, row in groups:
        cells = [f"{r['rate']:6.1%} [{r['low']:.1%}, {r['high']:.1%}]" for r in (row[each] for each in names)]
        lines.append(f"  {name:24}{row['parts']:6}  {''.join(f'{cell:25}' for cell in cells)}".rstrip())
    return lines
