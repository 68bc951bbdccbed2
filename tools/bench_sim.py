"""Throughput of a sim.usd on one device: physics alone, the whole environment step, PPO; with and without the room.

    python tools/bench_sim.py STAGE [--num-envs 4096 ...] [--ppo 8x8x40 5x4x24 ...] [--iterations 20] [--out FILE]
    python tools/bench_sim.py STAGE --live --part drawer_15 --num-envs 1024 4096

`--live` compares a part that alone moves with the whole room live, without PPO and grasp.

An environment step is one control step (4 physics steps) of one world. Actions are uniform random, resets included. PPO is
timed from its third iteration on: the first two compile and capture. Its worlds touch more as it learns, which is slower. The
policy that it begins with is drawn with a fixed seed: another one touches more or less.
"grasp_physics" is physics alone while every world's gripper holds the handle, where the planner brought it (so the arm is that
of conf/sim/planner.yaml), and "contacts_ms" what it then takes in a physics step to read the robot's contacts with the
part. Contacts and constraint rows are counted after the random steps, and in the grasp. Rates are compared within one run
only.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import torch
import warp as wp

from s2a.core import config
from s2a.core.provenance import provenance, scalars
from s2a.learn.rl.config import PpoConfig
from s2a.learn.rl.ppo import train
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.scene.usd.sim_scene import ALL
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks import make_env
from s2a.tasks.env import VecEnv
from s2a.tasks.open_part import OpenPartConfig, OpenPartMetrics
from s2a.tasks.state import ERRORS

STEPS = 200
WARM_UP = 2
"""Iterations of PPO that are not timed."""


def main() -> None:
    """Print a row for every number of worlds, with and without the room's colliders."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path)
    parser.add_argument("--part", help="articulated part of a room that has several")
    parser.add_argument("--live", action="store_true", help="compare one part that moves with the whole room")
    parser.add_argument("--num-envs", type=int, nargs="+", default=[4096])
    parser.add_argument(
        "--ppo",
        nargs="*",
        default=["8x8x40", "8x8x40:cuda_graph=true"],
        help="what to train: epochs x mini-batches x steps, and keys of conf/ppo after a colon",
    )
    parser.add_argument("--iterations", type=int, default=20, help="of PPO")
    parser.add_argument("--device", default="cuda:0" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--out", type=Path, help="write the rows as JSON")
    args = parser.parse_args()
    if args.live:
        rows = [bench_live(args, n, also) for n in args.num_envs for also in ((), (ALL,))]
    else:
        rows = [bench(args, n, room) for n in args.num_envs for room in (True, False)]
    if args.out:
        report = {**provenance(args.device), "stage": args.stage.name, "rows": rows}
        args.out.write_text(json.dumps(report, indent=1) + "\n")


def bench(args: argparse.Namespace, num_envs: int, room: bool) -> dict:
    """Measure one number of worlds."""
    begin = time.perf_counter()
    stage = read_stage(args.stage, args.part)
    sim = Simulation(stage, replace(_load(SimConfig, "sim/planner"), load_static_colliders=room), num_envs, args.device)
    env = _env(sim)
    _sync(args.device)
    row: dict = {"num_envs": num_envs, "room": room, "build_and_compile_s": time.perf_counter() - begin}
    actions = torch.rand(STEPS, num_envs, env.num_actions, device=args.device) * 2.0 - 1.0
    for action in actions:  # spreads the worlds over their episodes
        env.step(action)
    steps = iter([*actions, *actions])
    row["env_step"] = num_envs * _rate(args.device, lambda: env.step(next(steps)))
    row |= _contacts(sim)
    physics = _physics(sim)
    row["physics"] = num_envs * _rate(args.device, physics)
    for shape in args.ppo:
        with tempfile.TemporaryDirectory() as folder:
            row[f"ppo_{shape}"] = _training_rate(env, _policy(shape, args.iterations), Path(folder))
    _grasp(env)
    row |= {f"grasp_{name}": value for name, value in _contacts(sim).items()}
    row["grasp_physics"] = num_envs * _rate(args.device, physics)
    row["contacts_ms"] = 1e3 / _rate(args.device, sim.capture(lambda: _read_contacts(env)))
    if args.device.startswith("cuda"):
        free, total = torch.cuda.mem_get_info(args.device)
        row["gpu_memory_gb"] = (total - free) / 1e9
    print(json.dumps({k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()}), flush=True)
    return row


def bench_live(args: argparse.Namespace, num_envs: int, also: Sequence[str]) -> dict:
    """Measure one number of worlds of a part, and of further ones that move."""
    begin = time.perf_counter()
    sim = Simulation(
        read_stage(args.stage, args.part, also=also), _load(SimConfig, "sim/planner"), num_envs, args.device
    )
    env, m = _env(sim), sim.solver.mjw_model
    _sync(args.device)
    row: dict = {"num_envs": num_envs, "moving": len(sim.stage.active), "coordinates": m.nv, "shapes": m.ngeom}
    row |= {"pairs": len(m.nxn_geom_pair_filtered), "build_and_compile_s": time.perf_counter() - begin}
    actions = torch.rand(STEPS, num_envs, env.num_actions, device=args.device) * 2.0 - 1.0
    for action in actions:
        env.step(action)
    steps = iter([*actions, *actions])
    row["env_step"] = num_envs * _rate(args.device, lambda: env.step(next(steps)))
    row |= _contacts(sim)
    row["physics"] = num_envs * _rate(args.device, _physics(sim))
    row |= {name: int(env.result[:, env.columns.index(name)].sum()) for name in ERRORS}
    print(json.dumps({k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()}), flush=True)
    return row


def _env(sim: Simulation) -> VecEnv:
    """Return the environment of the reference's task."""
    task, metrics = _load(OpenPartConfig, "task/open_part"), _load(OpenPartMetrics, "metrics/open_part")
    return make_env(sim, task, metrics, config.compose("reward/paper")["reward"], 0)


def _read_contacts(env: VecEnv) -> None:
    """Read the contacts of the last physics step once more."""
    with wp.ScopedDevice(env.sim.device):
        env.task.sensor.update()


def _physics(sim: Simulation) -> Callable[[], object]:
    """Return a control step of physics alone, without what the task feels."""
    feel, sim.after_substep = sim.after_substep, []
    captured = sim.capture(sim.step)
    sim.after_substep = feel
    return captured


def _training_rate(env: VecEnv, settings: PpoConfig, folder: Path) -> float:
    """Return environment steps a second of training, logging included, without the iterations that compile and capture."""
    torch.manual_seed(0)
    env.reset_all(0)
    train(env, settings, folder)
    begin, *rest = [event.wall_time for event in scalars(folder, "Perf/total_fps")][WARM_UP - 1 :]
    return len(rest) * settings.num_steps_per_env * env.num_envs / (rest[-1] - begin)


def _policy(shape: str, iterations: int) -> PpoConfig:
    """Return rsl-rl's settings for EPOCHSxBATCHESxSTEPS[:KEY=VALUE,...]."""
    numbers, _, keys = shape.partition(":")
    values = dict(
        zip(("num_learning_epochs", "num_mini_batches", "num_steps_per_env"), numbers.split("x"), strict=True)
    )
    values |= dict(item.split("=") for item in keys.split(",") if item)
    overrides = [f"ppo.{key}={value}" for key, value in values.items()]
    settings = config.load(PpoConfig, config.compose("ppo/default", overrides)["ppo"])
    return replace(settings, iterations=iterations, save_interval=10**6)


def _grasp(env: VecEnv) -> None:
    """Bring every world's gripper to the handle and close it."""
    planner = Planner(env, _load(PlannerConfig, "planner/default"))
    env.reset_all()
    while int(env.episode_step.max()) < planner.grasp_steps:
        env.step(planner(env.observation))


def _rate(device: str, function: Callable[[], object]) -> float:
    """Return calls a second."""
    function()
    _sync(device)
    begin = time.perf_counter()
    for _ in range(STEPS):
        function()
    _sync(device)
    return STEPS / (time.perf_counter() - begin)


def _contacts(sim: Simulation) -> dict[str, float]:
    """Return contacts and constraint rows a world, mean and 95th percentile, as physics last saw them."""
    data = sim.solver.mjw_data
    count = int(data.nacon.numpy()[0])
    world = wp.to_torch(data.contact.worldid)[:count].long()
    contacts = torch.bincount(world, minlength=sim.num_envs).float()
    rows = wp.to_torch(data.nefc).float()
    found = {"contacts": contacts, "rows": rows}
    return {f"{n}_{k}": float(f) for n, x in found.items() for k, f in (("mean", x.mean()), ("p95", x.quantile(0.95)))}


def _load(cls: type, name: str):  # noqa: ANN202
    """Return the settings of one file of conf/."""
    return config.load(cls, config.compose(name)[name.split("/")[0]])


def _sync(device: str) -> None:
    """Wait for the device."""
    if device.startswith("cuda"):
        torch.cuda.synchronize(device)


if __name__ == "__main__":
    main()
