"""Pulls replayed under full contact physics: a world for each time law, the part's motion and the force on its handle."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import warp as wp

from s2a import tasks
from s2a.commands.evaluate import Config
from s2a.motion import trajectory
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig, PullLaw
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.base import Task
from s2a.tasks.env import VecEnv
from s2a.tasks.mdp.grasp import opening_force
from s2a.tasks.state import World


@dataclass(frozen=True)
class Replay:
    """A pull from its first control step on, a sample after each.

    Attributes:
        opening: of the part [m], shape [step].
        speed: [m/s], shape [step].
        force: of the whole robot on the part, along its path [N]; mean over the control step, shape [step].
        highest: of its physics steps [N], among which it ripples since targets move once a control step, shape [step].
        seconds: until the set-point stands.
        stretched: the robot's limits made that later than the law says.
    """

    opening: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    highest: np.ndarray
    seconds: float
    stretched: bool


@wp.kernel
def _add_force(w: World, steps: float, force: wp.array2d(dtype=float)):
    world = wp.tid()
    now = opening_force(w.target[world], w.contacts.pull[world, 0]) + opening_force(
        w.target[world], w.contacts.pull[world, 1]
    )
    force[world, 0] += now / steps
    force[world, 1] = wp.max(force[world, 1], now)


def replay(stage: SimStage, settings: Config, laws: Sequence[PullLaw | float], hold: float, seed: int) -> list[Replay]:
    """Return a pull of a stage's part for each law, or time [s] of the planner's own ease, and what follows for `hold` [s]."""
    sim = Simulation(stage, settings.sim, len(laws))
    ends = {"termination_opening": 10.0} if hasattr(settings.task, "termination_opening") else {}
    endless = replace(settings.task, episode_steps=10**6, **ends)
    task = tasks.task(endless.name)(sim, endless, settings.metrics)
    force, seen = _sum_forces(sim, task), []  # before the environment captures its step
    env = VecEnv(sim, task, {}, seed)
    with tempfile.TemporaryDirectory() as folder:
        planners = [Planner(env, _planner(settings.planner, law, Path(folder))) for law in laws]
    rate = 1.0 / (sim.config.dt * sim.config.substeps)
    coord, dof, lever = sim.layout.part_coord, sim.layout.part_dof, sim.stage.lever_arm
    sign = np.sign(sum(stage.joint.limits))
    for _ in range(max(planner.steps for planner in planners) + round(hold * rate)):
        force.zero_()
        env.step(torch.stack([planner(env.observation)[i] for i, planner in enumerate(planners)]))
        moved = (sim.joint_q[:, coord], sim.joint_qd[:, dof])
        seen.append([*(sign * lever * x.numpy() for x in moved), *force.numpy().T.copy()])
    rows = np.array(seen)
    return [
        _replay(rows[:, :, i], planner, law, rate, hold)
        for i, (planner, law) in enumerate(zip(planners, laws, strict=True))
    ]


def _replay(rows: np.ndarray, planner: Planner, law: PullLaw | float, rate: float, hold: float) -> Replay:
    pull = planner.steps - planner.grasp_steps
    asked = law.seconds if isinstance(law, PullLaw) else law
    motion = rows[planner.grasp_steps : planner.steps + round(hold * rate)].T
    return Replay(*motion, seconds=pull / rate, stretched=pull > np.ceil(asked * rate))


def _planner(config: PlannerConfig, law: PullLaw | float, folder: Path) -> PlannerConfig:
    if not isinstance(law, PullLaw):
        return replace(config, pull_time=law)
    trajectory.write(law, folder / "law.json")
    return replace(config, pull_law=folder / "law.json")


def _sum_forces(sim: Simulation, task: Task) -> torch.Tensor:
    """Let every physics step add to the forces on the parts that are returned: mean and maximum, shape [world 2]."""
    kernels, force = task.after_substep, wp.zeros((sim.num_envs, 2), dtype=float)

    def after_substep(state: object) -> None:
        kernels(state)
        wp.launch(_add_force, dim=sim.num_envs, inputs=[task.world, float(sim.config.substeps), force])

    task.after_substep = after_substep
    return wp.to_torch(force)
