"""Does the collider decide whether a gripper can use the handle? The planner opens scanned drawers, collider by collider.

    python experiments/planner_opening.py STAGE ... [--targets drawer_7 ...] [--colliders handle coacd one_hull]
        [--num-envs 16] [--seed 0] [--processes 1] [--out FILE]

STAGE is a geometric.usd. Every target (without --targets every part that slides) is prepared with each kind of colliders and
opened by the planner from noisy starts. Renews these rows of experiments/results/planner_opening.json, keeps its others, and
prints the new ones. "handle" counts the openings with both fingers on the annotated grasp region, "grasp" those in which they
pinched it along the whole path.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.provenance import provenance
from s2a.learn.evaluate import evaluate
from s2a.motion.policy import Planner
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.scene import Scene
from s2a.scene.usd import geometric, sim_stage
from s2a.sim.simulation import Simulation
from s2a.sim.world import read_stage
from s2a.tasks import make_env

RESULTS = Path(__file__).parent / "results/planner_opening.json"
COLLIDERS = ("handle", "coacd", "one_hull")


def main() -> None:
    """Run every target with every kind of colliders."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stages", nargs="+", type=Path)
    parser.add_argument("--targets", nargs="+")
    parser.add_argument("--colliders", nargs="+", default=COLLIDERS, choices=COLLIDERS)
    parser.add_argument("--num-envs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    cases = [
        (stage, target, colliders, args.num_envs, args.seed)
        for stage in args.stages
        for target in args.targets or _drawers(geometric.read(stage))
        for colliders in args.colliders
    ]
    known = json.loads(args.out.read_text())["rows"] if args.out.exists() else []
    rows = list(known)
    print(
        f"{'target':26} {'colliders':10} {'pieces':>6} {'success':>8} {'handle':>8} {'grasp':>8} {'opening mean / min [m]':>26}"
    )
    with ProcessPoolExecutor(args.processes, multiprocessing.get_context("spawn")) as pool:
        for row in pool.map(_row, cases):
            rows = [other for other in rows if _key(other) != _key(row)] + [row]
            print(_line(row), flush=True)
            report = {"scans": "virtual", "seed": args.seed, **provenance("cpu"), "rows": rows}
            args.out.parent.mkdir(exist_ok=True)
            args.out.write_text(json.dumps(report, indent=1) + "\n")


def _key(row: dict) -> tuple[str, str, str]:
    return row["scan"], row["target"], row["colliders"]


def _drawers(scene: Scene) -> list[str]:
    """Return the parts that slide."""
    return [i for i in scene.movable if scene.joint(i).kind == "prismatic"]


def _row(case: tuple[Path, str, str, int, int]) -> dict:
    """Prepare one target with one kind of colliders, and let the planner open it."""
    stage, target, colliders, num_envs, seed = case
    scene = geometric.read(stage)
    settings = config.load(PrepareConfig, config.compose("prepare", [f"prepare={colliders}"])["prepare"])
    row = {"scan": scene.name, "target": target, "colliders": colliders, "pieces": 0}
    with tempfile.TemporaryDirectory() as folder:
        try:
            ready = prepare(scene, target, settings)
            sim_stage.write(ready, Path(folder) / "sim.usd")
            return (
                row | {"pieces": len(ready.bodies[target].colliders)} | _open(Path(folder) / "sim.usd", num_envs, seed)
            )
        except InputError as error:
            return row | {"error": str(error).removeprefix(f"{folder}/sim.usd: ")}


def _open(stage: Path, num_envs: int, seed: int) -> dict:
    """Return what the planner reaches."""
    settings = config.load(Config, config.compose("evaluate", [f"stage={stage}", "out=-"]))
    env = make_env(Simulation(read_stage(stage), settings.sim, num_envs), settings.task, settings.metrics, {}, seed)
    return evaluate(env, Planner(env, settings.planner))


def _line(row: dict) -> str:
    """Return a row of the table."""
    start = f"{row['scan']} {row['target']:15} {row['colliders']:10} {row['pieces']:6}"
    if "error" in row:
        return f"{start} {row['error']}"
    count, opening = row["episodes"], row["opening"]
    hits = [f"{round(row[name]['rate'] * count)}/{count}" for name in ("success", "handle_success", "grasp_success")]
    return f"{start} {hits[0]:>8} {hits[1]:>8} {hits[2]:>8} {opening['mean']:17.3f} / {opening['min']:.3f}"


if __name__ == "__main__":
    main()
