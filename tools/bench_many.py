"""Throughput of worlds with many parts in one batch, beside worlds of one part, in one run.

    python tools/bench_many.py POOL/pool.json [--stages 1 64 ...] [--singles 8] [--num-envs 4096 8192]
        [--ppo "" "tf32=true" ...] [--out FILE]

The environment is that of `+experiment=many`. "env_step" is environment steps a second under uniform random actions, resets
included. For each line of --ppo (keys of conf/ppo over the experiment's) follow environment steps a second of PPO from its
fourth iteration on, the seconds of an iteration and of the update in it, for the largest number of stages. Stages are
taken evenly from the index; a single one may be easier or harder than others, so that --singles measures several. Rates are
compared within one run only.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from s2a.commands.train import Config
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.learn.rl.adapter import RslRlEnv
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import make_runner
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks import make_env
from s2a.tasks.env import VecEnv

STEPS = 200
WARM_UP = 3
"""Iterations of PPO that are not timed: they compile and capture."""
UPDATES = 5


def main() -> None:
    """Print a row for every number of worlds and stages."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pool", type=Path)
    parser.add_argument("--stages", type=int, nargs="+", default=[1, 64])
    parser.add_argument("--num-envs", type=int, nargs="+", default=[4096, 8192])
    parser.add_argument("--singles", type=int, default=1, help="rows of one stage each, where --stages has 1")
    parser.add_argument("--ppo", nargs="*", default=["", "tf32=true"], help="keys of conf/ppo, separated by commas")
    parser.add_argument("--iterations", type=int, default=10, help="of PPO that are timed")
    parser.add_argument("--device", default="cuda:0" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--out", type=Path, help="write the rows as JSON")
    args = parser.parse_args()
    values = config.compose("train", ["+experiment=many", f"stage={args.pool}", "out=unused"])
    settings = replace(config.load(Config, values), demo_reset_fraction=0.0, device=args.device)
    stages, rows = settings.read_stages(), []
    for num_envs in args.num_envs:
        for count in args.stages:
            shapes = args.ppo if count == max(args.stages) else []
            for chosen in batches(stages, count, args.singles):
                rows.append(bench(settings, chosen, num_envs, shapes, args.iterations))
                if args.out:
                    args.out.write_text(json.dumps({**provenance(args.device), "rows": rows}, indent=1) + "\n")


def batches(stages: Sequence[SimStage], count: int, singles: int) -> list[list[SimStage]]:
    """Return what is stepped together, evenly from the stages: one batch of `count`, or where that is 1 `singles` of one."""
    many = singles if count == 1 else count
    chosen = [stages[i] for i in np.linspace(0, len(stages) - 1, many).round().astype(int)]
    return [[stage] for stage in chosen] if count == 1 else [chosen]


def bench(
    settings: Config, stages: Sequence[SimStage], num_envs: int, shapes: Sequence[str], iterations: int
) -> dict[str, object]:
    """Measure a batch of these stages."""
    begin = time.perf_counter()
    sim = Simulation(stages, settings.sim, num_envs, settings.device)
    env = make_env(sim, settings.task, settings.metrics, settings.reward, settings.seed)
    row: dict[str, object] = {"num_envs": num_envs, "stages": len(stages), "build_s": time.perf_counter() - begin}
    actions = torch.rand(STEPS, num_envs, env.num_actions, device=settings.device) * 2.0 - 1.0
    for action in actions:  # spreads the worlds over their episodes
        env.step(action)
    row["env_step"] = num_envs / seconds(settings.device, [lambda a=a: env.step(a) for a in actions])
    for shape in shapes:
        row[f"ppo {shape}".strip()] = training(env, ppo_settings(settings.ppo, shape), iterations)
    print(json.dumps(row), flush=True)
    return row


def training(env: VecEnv, settings: PpoConfig, iterations: int) -> dict[str, float]:
    """Return environment steps a second of PPO, and seconds of an iteration and of the update in it."""
    runner = make_runner(RslRlEnv(env, settings.reward_scale, log_every=settings.num_steps_per_env), settings, None)
    runner.learn(WARM_UP)
    device = str(env.sim.device)
    iteration = seconds(device, [lambda: runner.learn(iterations)]) / iterations
    update = seconds(device, [lambda: runner.alg.update()] * UPDATES)  # of the steps that are stored still
    steps = settings.num_steps_per_env * env.num_envs
    return {"env_steps_per_second": steps / iteration, "iteration_s": iteration, "update_s": update}


def ppo_settings(settings: PpoConfig, shape: str) -> PpoConfig:
    """Return settings with KEY=VALUE,... of conf/ppo changed; nobody is imitated."""
    changes = dict(item.split("=") for item in shape.split(",") if item)
    overrides = [f"ppo.{key}={value}" for key, value in changes.items()]
    chosen = config.load(PpoConfig, config.compose("ppo/default", overrides)["ppo"])
    return replace(settings, imitation_iterations=0, **{key: getattr(chosen, key) for key in changes})


def seconds(device: str, calls: Sequence[Callable[[], object]]) -> float:
    """Return the mean seconds of a call."""
    if device.startswith("cuda"):
        torch.cuda.synchronize(device)
    begin = time.perf_counter()
    for call in calls:
        call()
    if device.startswith("cuda"):
        torch.cuda.synchronize(device)
    return (time.perf_counter() - begin) / len(calls)


if __name__ == "__main__":
    main()
