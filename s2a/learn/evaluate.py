"""Evaluation of a policy: one episode a world, counted once, with intervals, over parts and part by part; and of soft bodies."""

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Literal

import numpy as np
import torch

from s2a.core.progress import track
from s2a.motion.trajectory import PlannerConfig
from s2a.sim.soft import SoftSimulation
from s2a.tasks.env import Policy, VecEnv
from s2a.tasks.pool import PoolPart
from s2a.tasks.soft import COLUMNS, VALUES, SoftMetrics, SoftTrial, run_trial
from s2a.tasks.state import ERRORS

_log = logging.getLogger(__name__)


def evaluate(env: VecEnv, policy: Policy, watch: Callable[[], None] = lambda: None) -> dict[str, Any]:
    """Run one episode in every world from a fresh reset.

    `policy`: what acts in them; `watch`: called after the reset and after every step.

    Returns:
        Number of episodes; the task's thresholds and the version of its metrics; the rate of every 0-or-1 column (the task's
        metrics tell what they mean) with its Wilson 95 % interval; mean, min and max of the others; the number of episodes with
        each of ERRORS.
    """
    return {"episodes": env.num_envs, **summary(env, run_episodes(env, policy, watch))}


@torch.inference_mode()
def run_episodes(env: VecEnv, policy: Policy, watch: Callable[[], None] = lambda: None) -> dict[str, torch.Tensor]:
    """Return how the first episode of every world went, by column [world]; see `evaluate`. Warns of failed physics."""
    env.reset_all()
    watch()
    result = torch.full((env.num_envs, len(env.columns)), torch.nan, device=env.result.device)
    pending = torch.ones(env.num_envs, dtype=torch.bool, device=env.result.device)
    for _ in track(range(env.max_episode_length), "evaluate"):
        env.step(policy(env.observation.clone()))
        watch()
        finished = pending & (env.done == 1)
        result[finished] = env.result[finished]
        pending &= ~finished
        if not pending.any():
            break
    columns = dict(zip(env.columns, result.cpu().unbind(dim=1), strict=True))
    warn_of_errors({"episodes": env.num_envs, **{name: float(columns[name].sum()) for name in ERRORS}}, env)
    return columns


def summary(env: VecEnv, column: Mapping[str, torch.Tensor]) -> dict[str, Any]:
    """Return what finished episodes came to, from their results by column [episode]; see `evaluate`."""
    task, results = env.task, env.task.RESULTS
    return {
        "metrics_version": results.version,
        "thresholds": dict(task.thresholds),
        **{name: rate(float(column[name].sum()), len(column[name])) for name in results.rates},
        **{name: spread(column[name]) for name in results.values},
        **{name: int(column[name].sum()) for name in ERRORS},
    }


def spread(values: torch.Tensor) -> dict[str, float]:
    """Return mean, min and max of values, shape [episode]."""
    return {"mean": float(values.mean()), "min": float(values.min()), "max": float(values.max())}


def rate(hits: float, episodes: float) -> dict[str, float]:
    """Return how many of the episodes were hits, as a share with its Wilson 95 % interval (of whole numbers)."""
    from scipy.stats import binomtest  # 0.9 s to import, which no start of a training should pay

    low, high = binomtest(round(hits), round(episodes)).proportion_ci(0.95, method="wilson")
    return {"rate": hits / episodes, "low": float(low), "high": float(high)}


Agent = Literal["zero", "random", "extreme"]
# [control steps] For which the extreme agent holds an action, by world: noise, pushes of a second, from end to end
HELD = (1, 60, 240)


def baseline(agent: Agent, env: VecEnv, seed: int) -> Policy:
    """Return a policy that has learned nothing: actions of zero, uniform ones in [-1, 1], or -1 and 1 held for HELD."""
    device = env.observation.device
    if agent == "zero":
        return lambda observation: torch.zeros(env.num_envs, env.num_actions, device=device)
    generator = torch.Generator(device).manual_seed(seed)

    def uniform(observation: torch.Tensor) -> torch.Tensor:
        return torch.rand(env.num_envs, env.num_actions, generator=generator, device=device) * 2.0 - 1.0

    if agent == "random":
        return uniform
    held = torch.tensor(HELD, device=device)[torch.arange(env.num_envs, device=device) % len(HELD)]
    signs = torch.zeros(env.num_envs, env.num_actions, device=device)

    def extreme(observation: torch.Tensor) -> torch.Tensor:
        anew = env.episode_step % held == 0
        signs[anew] = uniform(observation)[anew].sign()
        return signs.clone()

    return extreme


def warn_of_errors(counts: Mapping[str, float], env: VecEnv) -> None:
    """Log a warning for each of ERRORS that befell `metrics.error_fraction` of the episodes or more.

    `counts`: "episodes", and how many of them had each of ERRORS.
    """
    sim = env.sim.config
    causes = {
        "invalid": f"were ended by a value that is not finite; make sim.dt (now {sim.dt:.4g} s) smaller",
        "row_overflow": f"dropped constraint rows; make sim.njmax (now {sim.njmax}) larger",
        "contact_overflow": f"dropped contacts; make sim.nconmax (now {sim.nconmax}) larger",
    }
    for name in ERRORS:
        if counts[name] > 0 and counts[name] >= env.task.metrics.error_fraction * counts["episodes"]:
            _log.warning("%d of %d episodes %s", counts[name], counts["episodes"], causes[name])


RESAMPLES = 2000  # Of the parts, for an interval


def by_part(
    rates: Mapping[str, np.ndarray], entries: Sequence[PoolPart], stage_of_env: np.ndarray, seed: int
) -> dict[str, Any]:
    """Return what the episodes of a pool's parts came to.

    Args:
        rates: columns of 0 and 1 by name, shape [episode].
        entries: the parts.
        stage_of_env: index of each episode's part, shape [episode].
        seed: of the intervals' draws.

    Returns:
        "parts": each part's rates; "over_parts": the mean of these rates with its bootstrap 95 % interval over parts, for all,
        and by kind of joint, of handle and of room.
    """
    count = np.bincount(stage_of_env, minlength=len(entries))
    each = {n: np.bincount(stage_of_env, v, len(entries)) / np.maximum(count, 1) for n, v in rates.items()}
    rows = [
        {**asdict(entry), "episodes": int(count[i]), **{name: float(values[i]) for name, values in each.items()}}
        for i, entry in enumerate(entries)
    ]
    groups: dict[str, Callable[[PoolPart], str]] = {
        "kind": lambda entry: entry.kind,
        "handle": lambda entry: entry.handle,
        "room": lambda entry: entry.room.rsplit("_", 1)[0],
    }
    tables: dict[str, Any] = {"all": _group(each, np.arange(len(entries)), seed)}
    for name, key in groups.items():
        keys = np.array([key(entry) for entry in entries])
        tables[name] = {value: _group(each, np.flatnonzero(keys == value), seed) for value in sorted(set(keys))}
    return {"parts": rows, "over_parts": tables}


CERTAIN = 0.002  # Chance at most of a doubt about an honest result, of each test


def unsound(claim: Mapping[str, Any], entries: Sequence[PoolPart], episodes: int, rates: Sequence[str]) -> list[str]:
    """Return why a benchmark's results contradict themselves: rows that are not of all parts, or means that are not the rows'.

    Args:
        claim: what `by_part` returned to who claims.
        entries: the parts, in order.
        episodes: of each part.
        rates: columns that a row has.
    """
    rows: Sequence[Mapping[str, Any]] = claim["parts"]
    if [(row.get("room"), row.get("part")) for row in rows] != [(each.room, each.part) for each in entries]:
        return [f"its {len(rows)} rows are not those of the {len(entries)} parts"]
    if any(row.get("episodes") != episodes for row in rows):
        return [f"a row is not of {episodes} episodes"]
    values = {name: np.array([float(row.get(name, np.nan)) for row in rows]) for name in rates}
    out = [
        f"{name}: a row is no rate of its episodes"
        for name, each in values.items()
        if not ((np.abs(each * episodes - (each * episodes).round()) < 1e-6) & (each >= 0.0) & (each <= 1.0)).all()
    ]
    tables, stated = by_part(values, entries, np.arange(len(entries)), 0)["over_parts"], claim["over_parts"]
    for by, table in tables.items():
        mine, theirs = ({"": table}, {"": stated.get(by)}) if by == "all" else (table, stated.get(by, {}))
        same = mine.keys() == theirs.keys() and all(
            np.isclose(row[name]["rate"], theirs[key][name]["rate"]) for key, row in mine.items() for name in rates
        )
        out += [] if same else [f"the means over {by} are not those of the rows"]
    return out


def overstated(
    rows: Sequence[Mapping[str, Any]], again: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> list[str]:
    """Return which rates are claimed to be higher than new episodes of some parts show, by more than chance.

    Tested over all of these parts by flipping signs, and part by part by Fisher's exact test, corrected after Bonferroni.

    Args:
        rows: the claimed ones, of all parts.
        again: those of the parts that were measured again.
        names: columns that are compared.
    """
    from scipy.stats import fisher_exact, permutation_test  # as in `rate`

    by_key = {(row["room"], row["part"]): row for row in rows}
    pairs = [(by_key[row["room"], row["part"]], row) for row in again]
    out = []
    for name in names:
        before, now = (np.array([row[name] for row in each]) for each in zip(*pairs, strict=True))
        chance = 1.0
        if len(pairs) > 1:
            keys = {"permutation_type": "samples", "alternative": "greater", "vectorized": True, "rng": 0}
            chance = float(permutation_test((before, now), lambda a, b, axis: (a - b).mean(axis), **keys).pvalue)
        if chance < CERTAIN:
            out.append(f"{name}: {before.mean():.1%} claimed, {now.mean():.1%} measured (p = {chance:.1g})")
        for old, new in pairs:
            counts = [[round(rate * row["episodes"]) for rate in (row[name], 1.0 - row[name])] for row in (old, new)]
            chance = float(fisher_exact(counts, alternative="greater").pvalue) * len(pairs)
            if chance < CERTAIN:
                where = f"{old['room']} {old['part']}"
                out.append(f"{name}: {old[name]:.1%} of {where} claimed, {new[name]:.1%} measured (p = {chance:.1g})")
    return out


def _group(each: Mapping[str, np.ndarray], members: np.ndarray, seed: int) -> dict[str, Any]:
    """Return how many parts a group has, and the mean of every rate over them with its interval."""
    return {"parts": len(members), **{name: interval(values[members], seed) for name, values in each.items()}}


def interval(values: np.ndarray, seed: int) -> dict[str, float]:
    """Return the mean of some parts' rates with its bootstrap 95 % interval: of the means of parts drawn with replacement."""
    random = np.random.default_rng(seed)
    means = values[random.integers(0, len(values), (RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return {"rate": float(values.mean()), "low": float(low), "high": float(high)}


STATES_EVERY = 15  # Control steps between two states that are kept
SOFT_VERSION = 2  # Of the metrics


class SoftStates:
    """Where robot and body were in every trial, at every EVERYth control step."""

    def __init__(self) -> None:
        self._trials: list[dict[str, Any]] = []

    def begin(self, trial: SoftTrial) -> None:
        """Begin a trial."""
        self._trials.append({"trial": trial, "joints": [], "particles": []})

    def watch(self, step: int, sim: SoftSimulation) -> None:
        """Look at a trial after a control step."""
        if step % STATES_EVERY == 0:
            self._trials[-1]["joints"].append(sim.joints)
            self._trials[-1]["particles"].append(sim.particles)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return all of it, frames of all trials one after the other: `frames` says how many each has.

        Joints [frame joint] and vertices against the place [frame vertex 3]; of each trial start, goal and base (7-vectors) and
        the height of the pedestal [m].
        """
        every = [(each["trial"], np.array(each["joints"]), np.array(each["particles"])) for each in self._trials]
        return {
            "frames": np.array([len(joints) for _, joints, _ in every]),
            "joints": np.concatenate([joints for _, joints, _ in every]).astype(np.float32),
            "particles": np.concatenate([at - trial.goal[:3] for trial, _, at in every]).astype(np.float16),
            "start": np.array([trial.start for trial, *_ in every]),
            "goal": np.array([trial.goal for trial, *_ in every]),
            "base": np.array([trial.plan.base for trial, *_ in every]),
            "pedestal": np.array([trial.plan.pedestal for trial, *_ in every]),
        }


def evaluate_soft(
    trials: Iterable[SoftTrial | str],
    count: int,
    planner: PlannerConfig,
    metrics: SoftMetrics,
    seed: int,
    device: str,
    states: SoftStates,
) -> Iterator[dict[str, Any]]:
    """Simulate trials; yield after each what all of them so far came to.

    Args:
        trials: each planned, or why it is not: it failed.
        count: of them.
        planner: times of the motion, and the noise of the arm's start.
        metrics: the thresholds.
        seed: of the noise, with the trial's number.
        device: of Warp.
        states: are told of every trial.

    Yields:
        Number of trials; version and thresholds of the metrics; the rate of every COLUMN with its Wilson 95 % interval; mean, min
        and max of VALUES over the trials that were simulated; the largest fraction of each of the robot's limits; a row a trial.
    """
    rows: list[dict[str, Any]] = []
    for number, trial in zip(track(range(count), "evaluate"), trials, strict=False):
        begun = time.perf_counter()
        row: dict[str, Any] = {"trial": number}
        if isinstance(trial, str):
            row |= {"success": False, "cause": trial}
        else:
            states.begin(trial)
            row |= run_trial(trial, planner, metrics, [seed, number], device, states.watch)
        rows.append(row | {"seconds": round(time.perf_counter() - begun, 2)})
        yield _soft_summary(rows, metrics)


def _soft_summary(rows: list[dict[str, Any]], metrics: SoftMetrics) -> dict[str, Any]:
    simulated = [row for row in rows if "limit_use" in row]
    limits = simulated[0]["limit_use"] if simulated else ()
    return {
        "episodes": len(rows),
        "metrics_version": SOFT_VERSION,
        "thresholds": asdict(metrics),
        **{name: rate(sum(row.get(name, False) for row in rows), len(rows)) for name in COLUMNS},
        **{
            name: spread(torch.tensor([row[name] for row in simulated], dtype=torch.float64))
            for name in VALUES
            if simulated
        },
        "limit_use": {name: max(row["limit_use"][name] for row in simulated) for name in limits},
        "trials": rows,
    }
