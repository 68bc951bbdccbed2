"""Does the collider decide whether a hand can use the handle? The planner opens scanned drawers, collider by collider.

    python experiments/planner_opening.py STAGE [TARGET ...] [--worlds 16] [--seed 0]

STAGE is a geometric.usd. Every target is prepared with each kind of colliders and opened by the planner from noisy starts.
Writes experiments/results/planner_opening.json and prints its table. "handle" counts the openings with both fingers on the
annotated grasp region.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

from s2a import config
from s2a.errors import InputError
from s2a.evaluate import evaluate
from s2a.policy.planner import Planner, PlannerConfig
from s2a.prepare import PrepareConfig, prepare
from s2a.provenance import provenance
from s2a.sim.build import read_stage
from s2a.sim.simulation import SimConfig, Simulation
from s2a.task.env import OpenDrawerEnv
from s2a.task.open_drawer import OpenDrawerConfig
from s2a.usd import geometric, simready

RESULTS = Path(__file__).parent / "results/planner_opening.json"


def main() -> None:
    """Run every target with every kind of colliders."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path)
    parser.add_argument("targets", nargs="*", default=["drawer_7"])
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    scene = geometric.read(args.stage)
    print(f"{'target':12} {'colliders':10} {'pieces':>6} {'success':>8} {'handle':>8} {'opening mean / least [m]':>26}")
    rows = []
    for target in args.targets:
        for colliders in ("handle", "coacd", "one_hull"):
            settings = config.load(PrepareConfig, config.compose("prepare", [f"prepare={colliders}"])["prepare"])
            with tempfile.TemporaryDirectory() as folder:
                ready = prepare(scene, target, settings)
                simready.write(ready, Path(folder) / "sim.usd")
                row = {"target": target, "colliders": colliders, "pieces": len(ready.target.colliders)}
                row |= _open(Path(folder) / "sim.usd", args.worlds, args.seed)
            rows.append(row)
            print(_line(row), flush=True)
    report = {"scan": f"virtual, {scene.name}", "seed": args.seed, **provenance("cpu"), "rows": rows}
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(report, indent=1) + "\n")


def _open(stage: Path, worlds: int, seed: int) -> dict:
    """Return what the planner reaches, or why it could not start."""
    values = config.compose("evaluate")
    sim = Simulation(read_stage(stage), config.load(SimConfig, values["sim"]), worlds)
    env = OpenDrawerEnv(sim, config.load(OpenDrawerConfig, values["task"]), values["reward"], seed)
    try:
        return evaluate(env, Planner(env, config.load(PlannerConfig, values["policy"])))
    except InputError as error:
        return {"error": str(error).removeprefix(f"{stage}: ")}


def _line(row: dict) -> str:
    """Return a row of the table."""
    start = f"{row['target']:12} {row['colliders']:10} {row['pieces']:6}"
    if "error" in row:
        return f"{start} {row['error']}"
    count, opening = row["episodes"], row["opening"]
    hits = [f"{round(row[name]['rate'] * count)}/{count}" for name in ("success", "handle_success")]
    return f"{start} {hits[0]:>8} {hits[1]:>8} {opening['mean']:17.3f} / {opening['min']:.3f}"


if __name__ == "__main__":
    main()
