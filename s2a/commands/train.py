"""Command `s2a train`: train a policy by reinforcement learning (PPO)."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import torch

from s2a.commands.worlds import WorldsConfig
from s2a.core.bounds import Fraction
from s2a.core.errors import InputError
from s2a.core.locks import contents
from s2a.core.outputs import Output, atomic_write, full_disk_reported
from s2a.core.provenance import provenance
from s2a.learn.evaluate import rate, warn_of_errors
from s2a.learn.rl import config as processes
from s2a.learn.rl import ppo, run_folder
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.policy_file import export
from s2a.learn.rl.ppo import load_model
from s2a.learn.rl.run_folder import write_world
from s2a.motion.open import demonstration
from s2a.motion.policy import TEACHING_BEHIND, TEACHING_GAIN, Planner
from s2a.motion.trajectory import Demonstration
from s2a.sim.simulation import Simulation, device_of
from s2a.sim.world import SimStage
from s2a.tasks import RewardWeights, make_env, pool, task
from s2a.tasks.env import DemoStarts, VecEnv

METRICS = "metrics.json"


@dataclass(frozen=True)
class Config(WorldsConfig):
    """Keys of `s2a train`.

    Attributes:
        out: folder for checkpoints, the TensorBoard log and metrics.json.
        init: policy that this one begins with, of networks of the same widths: a checkpoint of another run, with its critic; or
            pretrained, or an exported .onnx, without. null: none.
        resume: continue from the last checkpoint in `out`, if there is one, with the same settings.
        export: write the last checkpoint as TorchScript and ONNX too.
        reward: weight of each reward term.
        ppo: rsl-rl's settings.
        demo_reset_fraction: fraction of the episodes that start on the planner's motion to the handle or in its grasp; evaluation
            has none.
        demo_moved_fraction: of these, the fraction that starts with the part in the grip and already moved; such an episode is
            not counted.
    """

    out: Output
    init: Path | None
    resume: bool
    export: bool
    reward: RewardWeights
    ppo: PpoConfig
    demo_reset_fraction: Fraction
    demo_moved_fraction: Fraction


def run(config: Config) -> str:
    """Train, write metrics.json beside the checkpoints, and return how far it came."""
    lead = processes.rank() == 0
    checkpoint = _start_of(config)
    first = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    seed = processes.own_seed(config.seed, first)
    torch.manual_seed(seed)
    device = device_of(processes.own_device(config.device))
    sim = Simulation(processes.own_items(config.read_stages()), config.sim, config.num_envs, device)
    ppo_config = _ppo_of(config)
    imitates = first < ppo_config.imitation_iterations and (config.init is None or config.ppo.target is not None)
    motions = _motions(config, sim) if config.demo_reset_fraction > 0.0 or imitates else []
    demo = (
        DemoStarts(motions, config.demo_reset_fraction, config.demo_moved_fraction)
        if config.demo_reset_fraction
        else None
    )
    env = make_env(sim, config.task, config.metrics, config.reward, seed, demo=demo)
    with full_disk_reported(config.out):  # checkpoints and logs are not written by atomic_write
        if lead:
            config.out.mkdir(parents=True, exist_ok=True)
            run_folder.keep_settings(asdict(config), config.out, lambda: _without_effect(sim.stages))
            begun = run_folder.keep_start(config.out, first, config.stage, provenance(sim.device))
            write_world(config.sim, config.task, config.out)
        metrics = ppo.train(
            env,
            ppo_config,
            config.out,
            checkpoint,
            config.init,
            partial(_teacher, config, env, motions) if imitates else None,
        )
        return _report(config, env, metrics | {"starts": begun}) if lead else ""


def _teacher(config: Config, env: VecEnv, motions: list[Demonstration]) -> Planner:
    """Return the planner as a policy is to imitate it."""
    teacher = Planner(env, config.planner, motions, TEACHING_GAIN, TEACHING_BEHIND, knows_grasp=True)
    teacher.warn_of_cut()
    return teacher


def _ppo_of(config: Config) -> PpoConfig:
    """Return rsl-rl's settings; who begins with a policy does not imitate, but may need time for a critic."""
    if config.init is None:
        return config.ppo
    without_critic = config.init.suffix != ".pt"
    return replace(config.ppo, imitation_iterations=config.ppo.critic_iterations if without_critic else 0)


def _start_of(config: Config) -> Path | None:
    """Return the checkpoint to go on from, None to begin.

    Raises:
        InputError: a setting needs another; there are more mini-batches than samples; `out` is a file; it holds something, and
            the run is not to go on; or it has done all its iterations.
    """
    if _ppo_of(config).imitation_iterations and not config.ppo.cuda_graph:
        key = "critic_iterations" if config.init else "imitation_iterations"
        raise InputError(f"key 'ppo.{key}' needs ppo.cuda_graph=true; rsl-rl's own update does not imitate")
    if config.ppo.critic_learning_rate is not None and not config.ppo.cuda_graph:
        raise InputError("key 'ppo.critic_learning_rate' needs ppo.cuda_graph=true; rsl-rl's own update has one rate")
    if config.ppo.target is not None and processes.count() > 1:
        raise InputError("key 'ppo.target' ends a training of one process; give ppo.target=null under torchrun")
    if config.ppo.target is not None and config.demo_reset_fraction == 1.0:
        raise InputError(
            "key 'ppo.target' is measured in episodes from the start pose; give demo_reset_fraction below 1"
        )
    samples = config.num_envs * config.ppo.num_steps_per_env
    if config.ppo.num_mini_batches > samples:
        raise InputError(
            f"key 'ppo.num_mini_batches' is {config.ppo.num_mini_batches}, and an iteration collects num_envs x "
            f"ppo.num_steps_per_env = {samples} samples; give {samples} or less"
        )
    if config.out.exists() and not config.out.is_dir():
        raise InputError(f"out {str(config.out)!r} is a file where a folder should be written; choose another place")
    if processes.rank() == 0 and config.out.exists() and contents(config.out):
        if not config.resume:
            raise InputError(
                f"out {str(config.out)!r} holds files; a run is never overwritten: choose another, delete it, "
                "or continue with resume=true"
            )
        run_folder.keep_settings(asdict(config), config.out, lambda: _without_effect(config.read_stages()))
    checkpoint = run_folder.latest(config.out) if config.resume else None
    done = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    if checkpoint and config.ppo.target is not None and (why := _ended(config.out, config.ppo.target)):
        raise InputError(f"{config.out} has ended ({why}); give another ppo.target, or null, to continue")
    if done >= config.ppo.iterations and (config.out / METRICS).is_file():
        raise InputError(f"{config.out} has completed its {done} iterations; to continue, give a larger ppo.iterations")
    return checkpoint


def _ended(out: Path, target: float) -> str:
    """Return why a run with this target ended before its last iteration, "" where it did not."""
    try:
        metrics = json.loads((out / METRICS).read_text())
        return str(metrics["ended"]) if metrics["target"] == target else ""
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _motions(config: Config, sim: Simulation) -> list[Demonstration]:
    """Return a motion for each stage: those of the pool, or the planner's."""
    if pool.is_index(config.stage):
        return processes.own_items(pool.motions(config.stage))
    return [demonstration(sim, config.planner, partial(task(config.task.name).tool_path, config=config.task))]


def _without_effect(stages: Sequence[SimStage]) -> tuple[str, ...]:
    """Return the keys that change nothing of these stages: for slides, to what the spring's stiffness refers."""
    moving = [part.joint for stage in stages for name, part in stage.room.articulations.items() if name in stage.active]
    return ("sim.joint.spring",) if all(joint.kind == "prismatic" for joint in moving) else ()


def _report(config: Config, env: VecEnv, metrics: dict[str, Any]) -> str:
    """Write metrics.json and, if asked for, the policy as others can load it; return how far the training came."""
    warn_of_errors(metrics, env)
    metrics["recent"] = _rates(metrics["recent"], tuple(env.task.RESULTS.values))
    metrics |= {
        "seed": config.seed,
        "num_envs": config.num_envs,
        "processes": processes.count(),
        "reward": config.reward,
    }
    metrics["metrics_version"] = env.task.RESULTS.version
    with atomic_write(config.out / METRICS) as out:
        out.write_text(json.dumps(metrics | provenance(env.sim.device), indent=1))
    last = metrics["curve"][-1] if metrics["curve"] else {}
    came_to = ", ".join(f"{name} {value:.3g}" for name, value in last.items()) or "no episode has ended yet"
    lines = [f"{config.out}: {metrics['env_steps_per_second']:.0f} env steps/s; {came_to}"]
    checkpoint = run_folder.latest(config.out)
    if measured := metrics.get("measured"):
        checkpoint = config.out / run_folder.BEST
        why = metrics["ended"] or f"the target of {config.ppo.target:.0%} was not reached"
        lines = [] if not metrics["curve"] else lines
        lines.append(
            f"{checkpoint}: {env.task.RESULTS.logged[0]} {measured['rate']:.1%} [{measured['low']:.1%}, {measured['high']:.1%}] "
            f"of {measured['episodes']} episodes without exploration noise; {why}"
        )
    if config.export and checkpoint:
        lines += [f"  {file}" for file in export(load_model(env, checkpoint), checkpoint)]
    return "\n".join(lines)


def _rates(recent: dict[str, float], values: tuple[str, ...]) -> dict[str, Any]:
    """Return the rates of the recent episodes, exploration's noise included, with intervals; no rates before there are any.

    The older an episode is the less it counts. "episodes" is the sum of these weights and the intervals are of so many; there
    were more, so that they are rather too wide.
    """
    episodes = recent["episodes"]
    names = [name for name in recent if name not in ("episodes", *values)] if episodes >= 1.0 else []
    return {"episodes": episodes, **{name: rate(recent[name], episodes) for name in names}}
