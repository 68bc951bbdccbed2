"""A soft teddy bear is picked up from a bench and put on the bed of a virtual bedroom, many times.

    s2a sample  room=bedroom seed=1 detail=demo out=runs/soft/scan
    s2a export  scan=runs/soft/scan out=runs/soft
    s2a prepare stage=runs/soft/geometric.usd targets=all out=runs/soft/room.usd
    python experiments/soft_bear.py --room runs/soft/room.usd --trials 20 --device cuda:0 --cpu-trials 1

Every trial has its own start, place and noise of the arm, drawn by its number, and its own plan; one without a plan failed.
Writes experiments/results/soft_bear.json after every trial, and what is needed to render them to --states (tools/soft_images.py).
`soft.KEY=VALUE` and `planner.KEY=VALUE` change the settings.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from s2a import config, robot
from s2a.errors import InputError
from s2a.outputs import atomic_write
from s2a.planner.motion import PlannerConfig
from s2a.planner.obstacles import RoomHulls
from s2a.provenance import provenance
from s2a.sim.soft import SoftConfig, SoftSimulation
from s2a.sim.soft_body import SoftBody, soft_body
from s2a.tasks.pick_place.soft import SoftTrial, plan_trial, run_trial
from s2a.tasks.pick_place.soft_metrics import SoftMetrics
from s2a.tasks.pick_place.soft_stage import standing
from s2a.usd import sim_stage

RESULTS = Path(__file__).parent / "results/soft_bear.json"
START, PLACE = ("lid_45", (3.53, 3.51)), ("blanket_62", (3.81, 3.0))
"""Supports in bedroom 1 (lid of the storage bench, blanket on the bed), and spots on them [m]."""
YAW, TURN, APART = 0.6, 0.8, 0.03
"""[rad] Of the bear about z, by how much more or less it is turned, and how far from its spot it may stand in x and y [m]."""
DRAWS = 20
"""Of a pose, until the bear stands at it."""
EVERY = 15
"""Control steps between two states that are kept for images."""


def main() -> None:
    """Plan in other processes, simulate here, and write after every trial."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--room", type=Path, required=True)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--cpu-trials", type=int, default=0, help="of the same ones, again on the CPU")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--planners", type=int, default=1, help="processes that plan")
    parser.add_argument("--states", type=Path, default=None)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("settings", nargs="*")
    args = parser.parse_args()
    rows: dict[str, list[dict]] = {}
    again = []
    for number, trial in _trials(args):
        _add(rows, _run(number, trial, args.device, args), args.device, args)
        if number < args.cpu_trials:
            again.append((number, trial))
    for number, trial in again:
        _add(rows, _run(number, trial, "cpu", args), "cpu", args)


def _add(rows: dict[str, list[dict]], row: dict, device: str, args: argparse.Namespace) -> None:
    """Add a trial's row to those of a device, print and write it."""
    rows.setdefault(device, []).append(row)
    print(json.dumps({"device": device, **row}), flush=True)
    write(rows, args)


def _settings(overrides: list[str]) -> tuple[SoftConfig, SoftMetrics, PlannerConfig]:
    """Return the settings, changed by `soft.KEY=VALUE` and the like."""
    found = []
    for kind, group, file in (
        (SoftConfig, "soft", "bear"),
        (SoftMetrics, "soft_metrics", "default"),
        (PlannerConfig, "planner", "default"),
    ):
        own = [each for each in overrides if each.startswith(f"{group}.")]
        found.append(config.load(kind, config.compose(f"{group}/{file}", own)[group]))
    return tuple(found)  # type: ignore[return-value]


def _plan(job: tuple[Path, int, list[str]]) -> SoftTrial | str:
    """Return a planned trial by its number, or why there is no plan."""
    path, number, overrides = job
    settings = _settings(overrides)[0]
    room, body = sim_stage.read(path, visuals=False), soft_body(settings.shape)
    rng = np.random.default_rng(number)
    near = RoomHulls(room, set(), np.array([*START[1], 0.5]))
    try:
        start, goal = (_stands(near, body, rng, *end) for end in (START, PLACE))
        return plan_trial(room, body, settings, robot.load("panda"), (start, goal), number)
    except InputError as error:
        return str(error)


def _stands(
    near: RoomHulls, body: SoftBody, rng: np.random.Generator, support: str, spot: tuple[float, float]
) -> np.ndarray:
    """Return the first pose that is drawn about a spot at which all of the body is on its support, 7-vector."""
    for left in reversed(range(DRAWS)):
        at, yaw = np.array(spot) + rng.uniform(-APART, APART, 2), YAW + rng.uniform(-TURN, TURN)
        try:
            return standing(near, support, body, at, yaw)
        except InputError:
            if not left:
                raise
    raise AssertionError("the last draw returns or raises")


def _trials(args: argparse.Namespace) -> Iterator[tuple[int, SoftTrial | str]]:
    """Yield the trials in their order, as they are planned."""
    jobs = [(args.room, number, args.settings) for number in range(args.trials)]
    if args.planners < 2:
        yield from enumerate(map(_plan, jobs))
        return
    with ProcessPoolExecutor(args.planners, mp_context=get_context("spawn")) as pool:
        yield from enumerate(pool.map(_plan, jobs))


def _run(number: int, trial: SoftTrial | str, device: str, args: argparse.Namespace) -> dict:
    """Simulate a trial; return its row."""
    row: dict = {"trial": number}
    if isinstance(trial, str):
        return row | {"success": False, "cause": trial}
    _, metrics, planner = _settings(args.settings)
    joints, particles = [], []

    def watch(step: int, sim: SoftSimulation) -> None:
        if step % EVERY == 0:
            joints.append(sim.joints)
            particles.append(sim.particles)

    begun = time.perf_counter()
    row |= run_trial(trial, planner, metrics, number, device, watch)
    row["seconds"] = round(time.perf_counter() - begun, 2)
    if args.states is not None:
        args.states.mkdir(parents=True, exist_ok=True)
        name = f"{number:02d}{'_cpu' if device != args.device else ''}.npz"
        plan = trial.plan
        relative = (np.array(particles) - trial.goal[:3]).astype(np.float16)
        np.savez_compressed(
            args.states / name, joints=np.array(joints, np.float32), particles=relative, start=trial.start,
            goal=trial.goal, base=plan.base, pedestal=plan.pedestal,
        )  # fmt: skip
    return row


def write(rows: dict[str, list[dict]], args: argparse.Namespace) -> None:
    """Write the rows that there are, and what they come to."""
    found = {}
    for device, some in rows.items():
        hits = sum(row["success"] for row in some)
        low, high = binomtest(hits, len(some)).proportion_ci(0.95, method="wilson")
        seconds = [row["stepped_in"] for row in some if "stepped_in" in row]
        found[device] = {
            "success": hits, "trials": len(some), "low": round(low, 4), "high": round(high, 4),
            "median_seconds_stepped": float(np.median(seconds)) if seconds else None, **provenance(device), "rows": some,
        }  # fmt: skip
    about = {"room": args.room.name, "of": args.trials, "settings": args.settings}
    args.out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(args.out) as out:
        out.write_text(json.dumps(about | {"devices": found}, indent=1) + "\n")


if __name__ == "__main__":
    main()
