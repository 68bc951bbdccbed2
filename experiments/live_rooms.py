"""Whole rooms live: what moves without a robot, how parts move beside each other, which ones the planner opens.

    python experiments/live_rooms.py ROOM.usd ... [--steps rest pull open] [--parts 3] [--device cuda:0] [--out FILE]

ROOM.usd is of `s2a prepare ... targets=all`. `rest` watches everything for ten seconds without a robot. `pull` pulls parts with
30 N at the grasp point for half a second, each in a world of its own with all else live, and each in a room where it alone
moves. `open` lets the planner open parts in worlds where they alone move and in live ones, and tells the largest displacement
of anything else in these. Renews these rooms' rows of FILE and keeps its others.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from room_file import Displaced, open_part

from s2a.core import config
from s2a.core.provenance import provenance
from s2a.scene.articulation import lever_arm, opening_sign
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import ALL, SimRoom
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import axis_of, read_stage

RESULTS = Path(__file__).parent / "results/live_rooms.json"
REST, PULL, FORCE = 10.0, 0.5, 30.0
"""[s], [s], [N]"""
WORST = 3


def main() -> None:
    """Measure each room, and write after each figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+", type=Path)
    parser.add_argument("--steps", nargs="+", default=["rest", "pull", "open"], choices=["rest", "pull", "open"])
    parser.add_argument("--parts", type=int, help="of a room, evenly spread; all by default")
    parser.add_argument("--num-envs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    rooms: dict[str, dict[str, Any]] = json.loads(args.out.read_text())["rooms"] if args.out.exists() else {}
    for file in args.rooms:
        room = sim_stage.read(file, visuals=False)
        count = {"parts": len(room.articulations), "objects": len(room.free)}
        row = rooms.setdefault(room.name, {"room": file.parent.name, **count})
        names = list(room.articulations)
        picked = np.linspace(0, len(names) - 1, min(args.parts or len(names), len(names))).round().astype(int)
        for step in args.steps:
            for name in [names[i] for i in picked] if step == "open" else [""]:
                if step == "open":
                    row.setdefault("open", {})[name] = _open(file, name, args)
                else:
                    row[step] = (
                        _rest(file, room, args)
                        if step == "rest"
                        else _pull(file, room, [names[i] for i in picked], args)
                    )
                print(room.name, step, name, json.dumps(row[step][name] if name else row[step]), flush=True)
                report = {"seed": args.seed, **provenance(args.device), "rooms": rooms}
                args.out.write_text(json.dumps(report, indent=1) + "\n")


def _settings() -> SimConfig:
    settings: SimConfig = config.load(SimConfig, config.compose("sim/planner")["sim"])
    return settings


def _rest(file: Path, room: SimRoom, args: argparse.Namespace) -> dict[str, Any]:
    """Return the largest displacements in a room without a robot, target included."""
    sim = Simulation(
        read_stage(file, next(iter(room.articulations)), also=(ALL,)), _settings(), 1, args.device, with_robot=False
    )
    watch = Displaced(sim)
    watch.paths |= {sim.stage.target: 0.0}
    watch.turns |= {sim.stage.target: 0.0}
    step, steps = sim.capture(sim.step), round(REST * sim.config.control_frequency)
    watch()
    begun = time.perf_counter()
    for _ in range(steps):
        step()
        watch()
    worst = sorted(watch.paths, key=lambda i: watch.paths[i])[-WORST:]
    return {
        "seconds": REST,
        "path_mm": round(1000.0 * max(watch.paths.values()), 4),
        "turn_degree": round(max(watch.turns.values()), 4),
        "worst_mm": {i: round(1000.0 * watch.paths[i], 4) for i in worst},
        "wall_seconds": round(time.perf_counter() - begun, 1),
    }


def _pull(file: Path, room: SimRoom, parts: list[str], args: argparse.Namespace) -> dict[str, Any]:
    """Return by how much parts that are pulled move beside live ones, and alone."""
    beside = _pulled(file, room, parts, (ALL,), args)
    alone = {part: _pulled(file, room, [part], (), args)[part] for part in parts}
    off = {i: abs(beside[i] - alone[i]) / max(alone[i], 1e-6) for i in parts}
    rows = {i: [round(1000.0 * each, 3) for each in (beside[i], alone[i])] for i in parts}
    return {
        "newton": FORCE,
        "seconds": PULL,
        "largest_difference": round(max(off.values()), 5),
        "live_and_alone_mm": rows,
    }


def _pulled(
    file: Path, room: SimRoom, parts: list[str], also: tuple[str, ...], args: argparse.Namespace
) -> dict[str, float]:
    """Return the path [m] of the grasp point of each part, which is pulled in a world of its own."""
    stage = read_stage(file, parts[0], also=also)
    sim = Simulation(stage, _settings(), len(parts), args.device, with_robot=False)
    force = sim.control.joint_f.numpy().reshape(len(parts), -1)
    levers, coords = {}, {}
    for world, part in enumerate(parts):
        moving = room.articulations[part]
        coords[part], dof = axis_of(sim.world, part, moving.joint.kind)
        levers[part] = lever_arm(moving.joint, np.array(moving.grasp.point))
        force[world, dof] = FORCE * levers[part] * opening_sign(moving.joint)
    sim.control.joint_f.assign(force.ravel())
    start, step = sim.joint_q.clone(), sim.capture(sim.step)
    sim.joint_q.copy_(start)
    sim.joint_qd.zero_()
    for _ in range(round(PULL * sim.config.control_frequency)):
        step()
    moved = (sim.joint_q - start).abs().cpu()
    return {part: float(moved[world, coords[part]]) * levers[part] for world, part in enumerate(parts)}


def _open(file: Path, part: str, args: argparse.Namespace) -> dict[str, Any]:
    """Return what the planner reaches with a part, where all else stands and where all is live."""
    worlds = {"alone": (), "live": (ALL,)}
    return {name: open_part(file, part, args.num_envs, args.seed, also, args.device) for name, also in worlds.items()}


if __name__ == "__main__":
    main()
