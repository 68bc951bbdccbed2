"""Throughput of mjlab's own training of lifting a cube with an arm, to stand beside tools/bench_many.py on the same machine.

    pip install mjlab==1.6.0        # in an environment of its own: it pins other versions of MuJoCo and rsl-rl
    python tools/bench_peer.py [--num-envs 4096 8192] [--iterations 20] [--out FILE]

Task, networks and PPO settings are mjlab's (Mjlab-Lift-Cube-Yam); saving, logging to a server and video are off. An
environment step is one control step of one world: here `physics_steps` steps of physics of `physics_dt` seconds.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

import torch

TASK = "Mjlab-Lift-Cube-Yam"
WARM_UP = 5
"""Iterations that are not timed."""


def main() -> None:
    """Print a row for every number of worlds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--num-envs", type=int, nargs="+", default=[4096, 8192])
    parser.add_argument("--iterations", type=int, default=20)
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--out", type=Path, help="write the rows as JSON")
    args = parser.parse_args()
    from mjlab.utils.torch import configure_torch_backends  # of another environment; --help needs none

    configure_torch_backends()
    rows = [bench(args.device, num_envs, args.iterations) for num_envs in args.num_envs]
    about = {name: version(name) for name in ("mjlab", "mujoco-warp", "rsl-rl-lib", "torch")}
    if args.out:
        report = {"task": TASK, "device": torch.cuda.get_device_name(args.device), "versions": about, "rows": rows}
        args.out.write_text(json.dumps(report, indent=1) + "\n")


def bench(device: str, num_envs: int, iterations: int) -> dict[str, float]:
    """Measure one number of worlds."""
    import mjlab.tasks  # noqa: F401  (registers the tasks)
    from mjlab.envs import ManagerBasedRlEnv
    from mjlab.rl import MjlabOnPolicyRunner, RslRlVecEnvWrapper
    from mjlab.tasks.registry import load_env_cfg, load_rl_cfg

    scene, agent = load_env_cfg(TASK), load_rl_cfg(TASK)
    scene.scene.num_envs, agent.logger = num_envs, "tensorboard"
    env = RslRlVecEnvWrapper(ManagerBasedRlEnv(cfg=scene, device=device), clip_actions=agent.clip_actions)
    with tempfile.TemporaryDirectory() as folder:
        runner = MjlabOnPolicyRunner(env, asdict(agent), folder, device)
        runner.save = lambda *_, **__: None
        runner.learn(WARM_UP, init_at_random_ep_len=True)
        torch.cuda.synchronize()
        begin = time.perf_counter()
        runner.learn(iterations)
        torch.cuda.synchronize()
        spent = time.perf_counter() - begin
    steps = iterations * agent.num_steps_per_env * num_envs
    row = {
        "num_envs": num_envs,
        "env_steps_per_second": steps / spent,
        "iteration_s": spent / iterations,
        "physics_steps": scene.decimation,
        "physics_dt": scene.sim.mujoco.timestep,
    }
    print(json.dumps(row), flush=True)
    return row


if __name__ == "__main__":
    main()
