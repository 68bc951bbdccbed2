"""Parts whose pulls are optimised: drawn from prepared rooms, half of them with dynamics as `s2a identify` writes them."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from identification import LEAST, MOST

from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.core.errors import InputError
from s2a.joints.commands.identify import write_layer
from s2a.joints.dynamics import Dynamics
from s2a.joints.pulled import Pulled, moving, pulled
from s2a.motion.open import Skill, opening_path, plan, planned_path
from s2a.motion.trajectory import Trajectory
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage, read_stage

SPARE = 2
"""Of each kind, parts that are optimised beyond those asked for, in the place of those that the planner does not open."""

SOFT_CLOSE = ((0.0, 4.0, 30.0), (2.0, 10.0, 80.0))
"""[N], [N], [N s/m] Least and most breakaway, and of a soft close force and damping; dynamics drawn with these have no spring."""


def pull_and_motion(stage: SimStage, settings: Config, skill: Skill) -> tuple[Pulled, Trajectory]:
    """Return what pulls a stage's part along a tool path, and the planner's motion; InputError: out of reach."""
    sim = Simulation(stage, settings.sim, 1)
    return pulled(sim, *planned_path(sim, settings.planner, skill)), plan(sim, settings.planner, skill)


def planned(
    rooms: Sequence[Path], joints: int, seed: int, folder: Path, only: Container[str] | None = None
) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Return the first parts drawn, SPARE more of each kind than asked for, and why others were skipped; or `only` those."""
    parts, skipped = [], {}
    for name, kind, stage, identified in drawn(rooms, seed, folder):
        if sum(part["kind"] == kind for part in parts) >= joints / 2 + SPARE or not (only is None or name in only):
            continue
        settings = settings_of(stage)
        try:
            target, motion = pull_and_motion(stage, settings, opening_path)
        except InputError as error:
            skipped[name] = str(error).split(": ", 1)[-1]
            continue
        seconds = (len(motion.targets) - motion.closed) * settings.sim.dt * settings.sim.substeps
        keys = {"part": name, "kind": kind, "identified": identified}
        parts.append({**keys, "stage": stage, "pulled": target, "seconds": seconds})
    return parts, skipped


def drawn(
    rooms: Sequence[Path], seed: int, folder: Path, soft_close: bool = False
) -> Iterator[tuple[str, str, SimStage, bool]]:
    """Yield parts in a drawn order, slides and hinges in turn, every second one of each with drawn dynamics; see SOFT_CLOSE."""
    rng, kinds = np.random.default_rng(seed), {"prismatic": [], "revolute": []}
    for path in rooms:
        room = sim_stage.read(path, visuals=False)
        for part, found in room.articulations.items():
            kinds[found.joint.kind].append((path, room, part))
    orders = {kind: rng.permutation(len(parts)) for kind, parts in kinds.items()}
    for k in range(max(map(len, kinds.values()))):
        for kind, parts in kinds.items():
            truth = np.exp(rng.uniform(np.log(LEAST), np.log(MOST)))
            breakaway, *soft = rng.uniform(*SOFT_CLOSE) if soft_close else (0.0, 0.0, 0.0)
            if k >= len(parts):
                continue
            path, room, part = parts[orders[kind][k]]
            name = f"{path.parent.name}/{part}"
            if k % 2:
                path, below = folder / f"{kind}_{k}.usda", path
                values = np.array([*truth[:3], breakaway, 0.0 if soft_close else truth[3], *soft])
                write_layer(below, path, path, part, Dynamics(values, np.zeros(7), 1.0), moving(room, part))
            yield name, kind, read_stage(path, part), bool(k % 2)


def settings_of(stage: SimStage, more: Sequence[str] = ()) -> Config:
    """Return the settings of s2a evaluate for a stage; `more` are further keys."""
    keys = [f"stage={stage.path}", f"part={stage.target}", "out=-", *more]
    return config.load(Config, config.compose("evaluate", keys))
