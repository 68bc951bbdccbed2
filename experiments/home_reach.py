"""Base poses for parts of virtual homes: the planner's search on parts of many rooms, without scanning them.

    python experiments/home_reach.py [--rooms 100] [--each 2] [--first 100] [--out experiments/results/home_reach.json]

Draws --each movable parts of each room and searches a base pose in the room as it is, not as it is scanned: from there the
arm follows the first 0.3 m of the handle's path without a collision. Rooms go kind by kind, seeds from --first, which are those
of the slow test of a hundred rooms. Parts that are in the file at the same commit are not searched again.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from s2a import robot
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.homes.furnishing import HOMES, home
from s2a.homes.room import catalog, clean_scene
from s2a.prepare.grasp import bodies
from s2a.prepare.part import PartConfig, part_results
from s2a.prepare.room import PrepareConfig
from s2a.scene.scene import Scene
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT

RESULTS = Path(__file__).parent / "results/home_reach.json"
Row = dict[str, Any]


def main() -> None:
    """Search, writing after each room, and print the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", type=int, default=100)
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--first", type=int, default=100)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    settings = config.load(PrepareConfig, config.compose("prepare")["prepare"]).part(robot.load(DEFAULT_ROBOT))
    head = {"rooms": args.rooms, "each": args.each, "first_seed": args.first, **provenance("cpu")}
    rows: list[Row] = []
    if args.out.exists() and (known := json.loads(args.out.read_text()))["commit"] == head["commit"]:
        rows = known["rows"]
    done = {(row["room"], row["seed"]) for row in rows}
    for i in track(range(args.rooms), "rooms"):
        room, seed = list(HOMES)[i % len(HOMES)], args.first + i // len(HOMES)
        if (room, seed) not in done:
            rows += [{"room": room, "seed": seed, **row} for row in searched(room, seed, args.each, settings)]
            with atomic_write(args.out) as out:
                lines = ",\n".join(json.dumps(row) for row in rows)
                table = json.dumps(counts(rows))
                out.write_text(f'{json.dumps(head, indent=1)[:-2]},\n "table": {table},\n "rows": [\n{lines}\n]}}\n')
    print(json.dumps(counts(rows), indent=1))


def searched(room: str, seed: int, each: int, settings: PartConfig) -> Iterator[Row]:
    """Yield a row for some movable parts of a room, drawn by its seed."""
    scene = clean_scene("room", catalog(home(room, seed).pieces))
    parts = np.random.default_rng(seed).permutation(scene.movable)[:each].tolist()
    owners = bodies(scene, parts)
    asked = [(part, tuple(i for i, owner in owners.items() if owner == part)) for part in parts]
    for part, found in part_results(scene, asked, settings).items():
        if isinstance(found, InputError):
            why: Row = {"outcome": "refused", "why": str(found)}
        else:
            why = {"outcome": "free" if found.base.free else "no_base", "why": found.base.reason}
        yield {"part": part, "joint": scene.joint(part).kind, "handle": has_handle(scene, part), **why}


def has_handle(scene: Scene, part: str) -> bool:
    """Whether something other than the front itself is grasped."""
    return part not in scene.grasp_parts(part)


def counts(rows: list[Row]) -> dict[str, dict[str, int]]:
    """Count the outcomes of all parts, and of those with and without a handle."""
    groups = {"all": rows, "with a handle": [row for row in rows if row["handle"]]}
    groups["without"] = [row for row in rows if not row["handle"]]
    return {name: {"parts": len(own), **Counter(row["outcome"] for row in own)} for name, own in groups.items()}


if __name__ == "__main__":
    main()
