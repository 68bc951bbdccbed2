"""How good a policy is: one episode a world, counted once, with intervals."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, Literal

import torch

from s2a.env.vec_env import OpenDrawerEnv
from s2a.progress import track
from s2a.tasks.open_part.config import RESULTS, TROUBLES

_log = logging.getLogger(__name__)
Policy = Callable[[torch.Tensor], torch.Tensor]
"""Observation [world 23] -> action [world 9]."""


@torch.inference_mode()
def evaluate(env: OpenDrawerEnv, policy: Policy, watch: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """Run one episode in every world from a fresh reset.

    Args:
        env: the worlds.
        policy: what acts in them.
        watch: called after the reset and after every step.

    Returns:
        Number of episodes; what counts as opened in this stage [m]; the rate of every 0-or-1 column of RESULTS
        (s2a.tasks.open_part.config says what they mean) with its Wilson 95 % interval; handle_use_of_successes and
        side_grasps_of_successes; largest openings [m] (mean, min); the number of episodes with each of TROUBLES.
    """
    env.reset_all()
    watch()
    result = torch.full((env.num_envs, len(RESULTS)), torch.nan, device=env.result.device)
    pending = torch.ones(env.num_envs, dtype=torch.bool, device=env.result.device)
    for _ in track(range(env.max_episode_length), "evaluate"):
        env.step(policy(env.observation.clone()))
        watch()
        finished = pending & (env.done == 1)
        result[finished] = env.result[finished]
        pending &= ~finished
        if not pending.any():
            break
    column = dict(zip(RESULTS, result.cpu().unbind(dim=1), strict=True))
    successes = column["success"].sum().clamp(min=1.0)
    opening = column.pop("opening")
    troubles = {name: int(column.pop(name).sum()) for name in TROUBLES}
    return {
        "episodes": env.num_envs,
        "openings": env.openings,
        **{name: rate(float(hits.sum()), env.num_envs) for name, hits in column.items()},
        "handle_use_of_successes": float(column["handle_success"].sum() / successes),
        "side_grasps_of_successes": float(column["side_success"].sum() / successes),
        "opening": {"mean": float(opening.mean()), "min": float(opening.min())},
        **troubles,
    }


def rate(hits: float, episodes: float) -> dict[str, float]:
    """Return how many of the episodes were hits, as a share with its Wilson 95 % interval (of whole numbers)."""
    from scipy.stats import binomtest  # 0.9 s to import, which no start of a training should pay

    low, high = binomtest(round(hits), round(episodes)).proportion_ci(0.95, method="wilson")
    return {"rate": hits / episodes, "low": float(low), "high": float(high)}


def baseline(agent: Literal["zero", "random"], env: OpenDrawerEnv, seed: int) -> Policy:
    """Return a policy that has learned nothing: actions of zero, or uniform ones in [-1, 1]."""
    device = env.observation.device
    if agent == "zero":
        return lambda observation: torch.zeros(env.num_envs, env.num_actions, device=device)
    generator = torch.Generator(device).manual_seed(seed)
    return lambda observation: torch.rand(env.num_envs, env.num_actions, generator=generator, device=device) * 2.0 - 1.0


def warn_of_trouble(counts: Mapping[str, float], env: OpenDrawerEnv) -> None:
    """Log a warning for each of TROUBLES that befell `trouble_share` of the episodes or more.

    Args:
        counts: "episodes", and how many of them had each of TROUBLES.
        env: whose settings the remedy names.
    """
    sim = env.sim.config
    causes = {
        "invalid": f"were ended by a value that is not finite; make sim.dt (now {sim.dt:.4g} s) smaller",
        "row_overflow": f"dropped constraint rows; make sim.njmax (now {sim.njmax}) larger",
        "contact_overflow": f"dropped contacts; make sim.nconmax (now {sim.nconmax}) larger",
    }
    for name in TROUBLES:
        if counts[name] > 0 and counts[name] >= env.config.trouble_share * counts["episodes"]:
            _log.warning("%d of %d episodes %s", counts[name], counts["episodes"], causes[name])
