"""sim.usd -> a policy, learned."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import torch

from s2a.errors import InputError
from s2a.policy import ppo
from s2a.policy.planner import PlannerConfig, approach_position
from s2a.provenance import provenance
from s2a.sim.build import read_stage
from s2a.sim.simulation import SimConfig, Simulation
from s2a.task.env import OpenDrawerEnv
from s2a.task.open_drawer import OpenDrawerConfig
from s2a.verbs.trained import write_world


@dataclass(frozen=True)
class Config:
    """Keys of `s2a train`.

    Attributes:
        stage: the sim.usd.
        out: folder for checkpoints, the TensorBoard log and metrics.json.
        worlds: copies of the stage that are stepped together.
        device: cpu, cuda:0, or auto: a GPU where there is one.
        seed: of the start noise and of the network.
        sim: how physics is stepped.
        task: what the robot has to do.
        reward: weight of each reward term.
        policy: what rsl-rl is told.
        starts_ahead: share of episodes that start somewhere on the way to the planner's point of approach; evaluation has none.
        plan: the planner's motion, for that point.
    """

    stage: Path
    out: Path
    worlds: int
    device: str
    seed: int
    sim: SimConfig
    task: OpenDrawerConfig
    reward: dict[str, float]
    policy: ppo.PpoConfig
    starts_ahead: float
    plan: PlannerConfig


def run(config: Config) -> str:
    """Train, write metrics.json beside the checkpoints, and return how far it came."""
    if config.out.exists() and any(config.out.iterdir()):
        raise InputError(
            f"out {str(config.out)!r} holds files; a run is never overwritten: choose another or delete it"
        )
    torch.manual_seed(config.seed)
    sim = simulation(config.stage, config.sim, config.worlds, config.device)
    approach = (approach_position(sim, config.plan), config.starts_ahead) if config.starts_ahead > 0.0 else None
    env = OpenDrawerEnv(sim, config.task, config.reward, config.seed, ahead=approach)
    config.out.mkdir(parents=True, exist_ok=True)
    write_world(config.sim, config.task, config.out)
    metrics = ppo.train(env, config.policy, config.out)
    metrics |= {"seed": config.seed, "worlds": config.worlds, "reward": config.reward, **provenance(sim.device)}
    (config.out / "metrics.json").write_text(json.dumps(metrics, indent=1))
    last = metrics["curve"][-1] if metrics["curve"] else {}
    curve = ", ".join(f"{name} {value:.3g}" for name, value in last.items())
    return f"{config.out}: {metrics['env_steps_per_second']:.0f} env steps/s; {curve}"


def simulation(stage: Path, config: SimConfig, worlds: int, device: str) -> Simulation:
    """Return the worlds that a user's keys mean.

    Raises:
        InputError: no world, a device that this machine does not have, or not a sim.usd.
    """
    if worlds < 1:
        raise InputError(f"key 'worlds' is {worlds}; give 1 or more")
    known = ["cpu", *(f"cuda:{i}" for i in range(torch.cuda.device_count()))]
    chosen = known[:2][-1] if device == "auto" else device
    if chosen not in known:
        raise InputError(f"key 'device' is {device!r}; on this machine one of: auto, {', '.join(known)}")
    return Simulation(read_stage(stage), config, worlds, chosen)
