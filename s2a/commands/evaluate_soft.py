"""`s2a evaluate physics=soft`: the planner picks and places a soft body."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.learn.evaluate_soft import SoftStates, evaluate_soft
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import device_of
from s2a.sim.soft_body import soft_body
from s2a.tasks.soft import NAME, SOFT_TASK, SoftTask, trials
from s2a.tasks.soft_metrics import COLUMNS, VALUES

if TYPE_CHECKING:
    from s2a.commands.evaluate import Config

REFUSED = ("also", "checkpoint", "policy", "agent", "perception", "export", "images", "search_base", "recordings")


def run_soft(config: Config) -> tuple[dict[str, Any], tuple[str, ...], tuple[str, ...]]:
    """Run the trials one after the other, writing metrics and states after each; return the metrics, their rates and values."""
    task = config.task
    if type(task) is not SoftTask:
        raise InputError(f"physics=soft is for task={SOFT_TASK}, not for task={task.name}")
    if config.part not in (None, NAME):
        raise InputError(f"part={config.part}: with physics=soft the object is the {NAME}; leave the key out")
    if given := [key for key in REFUSED if getattr(config, key)]:
        raise InputError(f"keys not possible with physics=soft: {', '.join(given)}; leave them out")
    room, body = sim_stage.read(config.stage, visuals=False), soft_body(config.soft.shape)
    every = trials(room, body, config.soft, task, config.robot, config.planner.approach, config.num_envs, config.seed)
    device, states = device_of(config.device), SoftStates()
    origin = {"stage": config.stage.name, "policy": "planner", "physics": "soft", "seed": config.seed}
    origin |= {"start": task.start, "place": task.place, **provenance(device)}
    metrics: dict[str, Any] = {}
    for found in evaluate_soft(
        every, config.num_envs, config.planner, config.soft_metrics, config.seed, device, states
    ):
        metrics = found | origin
        with atomic_write(config.out) as out:
            out.write_text(json.dumps(metrics, indent=1))
        if config.states:
            with atomic_write(config.states) as out, out.open("wb") as file:
                np.savez_compressed(file, **states.arrays())  # type: ignore[arg-type]
    return metrics, COLUMNS, VALUES
