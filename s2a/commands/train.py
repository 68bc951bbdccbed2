"""sim.usd -> a policy, learned."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from s2a.commands.trained import write_world
from s2a.env.vec_env import OpenDrawerEnv
from s2a.errors import InputError
from s2a.evaluate import rate, warn_of_trouble
from s2a.outputs import aside
from s2a.planner.motion import PlannerConfig, grasping_motion
from s2a.provenance import provenance
from s2a.ranges import Count, CountFromZero, Share
from s2a.rl import ppo, processes, run_folder
from s2a.rl.checkpoint import load_model
from s2a.rl.config import PpoConfig
from s2a.rl.export import export
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks.open_part.config import OpenDrawerConfig, RewardWeights

METRICS = "metrics.json"


@dataclass(frozen=True)
class Config:
    """Keys of `s2a train`.

    Attributes:
        stage: the sim.usd.
        part: id of the articulated part; null: the only one of the stage.
        out: folder for checkpoints, the TensorBoard log and metrics.json.
        resume: whether to go on from the last checkpoint in `out`, if there is one, with the same settings.
        export: whether to write the last checkpoint as TorchScript and ONNX too.
        worlds: copies of the stage that are stepped together; under torchrun, of each process.
        device: cpu, cuda:0, or auto: a GPU where there is one, and each process of torchrun its own.
        seed: of the start noise and of the network.
        sim: how physics is stepped.
        task: what the robot has to do.
        reward: weight of each reward term.
        policy: what rsl-rl is told.
        starts_ahead: share of episodes that start on the way to the handle or in the planner's grasp; evaluation has none.
        plan: the planner's motion, on which those episodes start.
    """

    stage: Path
    part: str | None
    out: Path
    resume: bool
    export: bool
    worlds: Count
    device: str
    seed: CountFromZero
    sim: SimConfig
    task: OpenDrawerConfig
    reward: RewardWeights
    policy: PpoConfig
    starts_ahead: Share
    plan: PlannerConfig


def run(config: Config) -> str:
    """Train, write metrics.json beside the checkpoints, and return how far it came."""
    lead = processes.rank() == 0
    checkpoint = _start_of(config)
    first = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    torch.manual_seed(processes.own_seed(config.seed, first))
    sim = simulation(config.stage, config.sim, config.worlds, processes.own_device(config.device), config.part)
    motion = (grasping_motion(sim, config.plan), config.starts_ahead) if config.starts_ahead > 0.0 else None
    env = OpenDrawerEnv(sim, config.task, config.reward, processes.own_seed(config.seed, first), ahead=motion)
    if lead:
        config.out.mkdir(parents=True, exist_ok=True)
        run_folder.keep_settings(asdict(config), config.out)
        starts = run_folder.keep_start(config.out, first, config.stage, provenance(sim.device))
        write_world(config.sim, config.task, config.out)
    metrics = ppo.train(env, config.policy, config.out, checkpoint)
    return _report(config, env, metrics | {"starts": starts}) if lead else ""


def _start_of(config: Config) -> Path | None:
    """Return the checkpoint to go on from, None to begin.

    Raises:
        InputError: there are more mini-batches than samples; `out` is a file; it holds something, and the run is not to go
            on; or it has done all its iterations.
    """
    samples = config.worlds * config.policy.steps
    if config.policy.mini_batches > samples:
        raise InputError(
            f"key 'policy.mini_batches' is {config.policy.mini_batches}, and an iteration collects worlds x policy.steps = "
            f"{samples} samples; give {samples} or less"
        )
    if config.out.exists() and not config.out.is_dir():
        raise InputError(f"out {str(config.out)!r} is a file where a folder should be written; choose another place")
    if processes.rank() == 0 and config.out.exists() and any(config.out.iterdir()):
        if not config.resume:
            raise InputError(
                f"out {str(config.out)!r} holds files; a run is never overwritten: choose another, delete it, "
                "or go on with resume=true"
            )
        run_folder.keep_settings(asdict(config), config.out)
    checkpoint = run_folder.latest(config.out) if config.resume else None
    done = run_folder.iteration(checkpoint) + 1 if checkpoint else 0
    if done >= config.policy.iterations and (config.out / METRICS).is_file():
        raise InputError(f"{config.out} has done its {done} iterations; to go on, give policy.iterations more of them")
    return checkpoint


def _report(config: Config, env: OpenDrawerEnv, metrics: dict[str, Any]) -> str:
    """Write metrics.json and, if asked for, the policy as others can load it; return how far the training came."""
    warn_of_trouble(metrics, env)
    metrics["recent"] = _rates(metrics["recent"])
    metrics |= {"seed": config.seed, "worlds": config.worlds, "processes": processes.count(), "reward": config.reward}
    with aside(config.out / METRICS) as out:
        out.write_text(json.dumps(metrics | provenance(env.sim.device), indent=1))
    last = metrics["curve"][-1] if metrics["curve"] else {}
    said = ", ".join(f"{name} {value:.3g}" for name, value in last.items()) or "no episode has ended yet"
    lines = [f"{config.out}: {metrics['env_steps_per_second']:.0f} env steps/s; {said}"]
    if config.export and (checkpoint := run_folder.latest(config.out)):
        lines += [f"  {file}" for file in export(load_model(env, checkpoint), checkpoint)]
    return "\n".join(lines)


def _rates(recent: dict[str, float]) -> dict[str, Any]:
    """Return the rates of the recent episodes, exploration's noise included, with intervals; no rates before there are any.

    The older an episode is the less it counts. "episodes" is the sum of these weights and the intervals are of so many; there
    were more, so that they are rather too wide.
    """
    episodes = recent["episodes"]
    names = [name for name in recent if name not in ("episodes", "opening")] if episodes >= 1.0 else []
    return {"episodes": episodes, **{name: rate(recent[name], episodes) for name in names}}


def simulation(stage: Path, config: SimConfig, worlds: int, device: str, part: str | None = None) -> Simulation:
    """Return the worlds that a user's keys mean.

    Raises:
        InputError: a device that this machine does not have, or not a sim.usd.
    """
    known = ["cpu", *(f"cuda:{i}" for i in range(torch.cuda.device_count()))]
    chosen = known[:2][-1] if device == "auto" else device
    if chosen not in known:
        raise InputError(f"key 'device' is {device!r}; on this machine one of: auto, {', '.join(known)}")
    return Simulation(read_stage(stage, part), config, worlds, chosen)
