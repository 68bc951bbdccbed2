"""Parts that are closed by gradient, replayed under full contact physics, beside the planner's own motion.

    python experiments/closing.py ROOM.usd ... [--joints 8] [--seed 0] [--out FILE]

Parts of prepared rooms are drawn as `motions` draws them, slides and hinges in turn, without a closing spring; every second one
gets dynamics as `s2a identify` would write them, with a soft close and breakaway (`motion_parts.SOFT_CLOSE`). Each stands open by
`task.start_opening`, and is closed in the planner's own time and in a free one. Parts that the arm cannot follow are skipped and
named. An end error is how far the part still stands open; the speed is that towards shut.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from motion_parts import drawn, pull_and_motion, settings_of
from replayed import Replay, replay

from s2a import tasks
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.joints.pull_optimize import PullConfig, optimize

RESULTS = Path(__file__).parent / "results/closing.json"
TASK = ("task=close_part", "sim.joint.stiffness=0")
"""Without a spring that closes a part before the gripper is there."""
HOLD = 1.0
"""[s] For which the set-point stands after its motion."""
RATE = 60.0
"""[Hz] Of control steps."""
SHUT, REST = 0.003, 0.005
"""[m, m/s] Within which a part is closed, and at rest."""
NEAR = 0.005
"""[m] From shut, where the speed of the arrival is taken."""


def main() -> None:
    """Optimise all motions, replay them, write the file, and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("rooms", type=Path, nargs="+", metavar="ROOM")
    parser.add_argument("--joints", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    pulls = config.load(PullConfig, config.compose("optimize", ["stage=-", "out=-"])["pull"])
    with tempfile.TemporaryDirectory() as folder:
        parts, skipped = planned(given.rooms, given.joints, given.seed, Path(folder))
        targets, seconds = [part["pulled"] for part in parts], np.array([part["seconds"] for part in parts])
        same, free = optimize(targets, pulls, seconds)[0], optimize(targets, pulls)[0]
        rows = []
        for part, own, quick in zip(parts, same, free, strict=True):
            laws = [part["seconds"], own.law, quick.law]
            found = replay(part["stage"], settings_of(part["stage"], TASK), laws, HOLD, given.seed)
            keys = ("planner", "gradient_same_time", "gradient_free_time")
            motions = {key: figures(motion) for key, motion in zip(keys, found, strict=True)}
            rows.append({key: part[key] for key in ("part", "kind", "soft_close")} | {"motions": motions})
            print(rows[-1], flush=True)
    summaries = {
        name: {key: summary([row["motions"][key] for row in chosen]) for key in keys}
        for name, chosen in (("all", rows), ("soft_close", [row for row in rows if row["soft_close"]]))
    }
    about = {"seed": given.seed, "skipped": skipped, "figures": summaries, **provenance("cpu")}
    with atomic_write(given.out) as out:
        out.write_text(json.dumps({**about, "rows": rows}))
    print(json.dumps(summaries, indent=1))


def planned(rooms: Sequence[Path], joints: int, seed: int, folder: Path) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Return the first parts drawn, half of them of each kind, and why others were skipped."""
    parts, skipped = [], {}
    for name, kind, stage, identified in drawn(rooms, seed, folder, soft_close=True):
        if sum(part["kind"] == kind for part in parts) >= joints / 2:
            continue
        settings = settings_of(stage, TASK)
        tool_path = partial(tasks.task("close_part").tool_path, config=settings.task)
        try:
            target, motion = pull_and_motion(stage, settings, tool_path)
        except InputError as error:
            skipped[name] = str(error).split(": ", 1)[-1]
            continue
        seconds = (len(motion.targets) - motion.closed) / RATE
        keys = {"part": name, "kind": kind, "soft_close": identified}
        parts.append({**keys, "stage": stage, "pulled": target, "seconds": seconds})
    return parts, skipped


def figures(motion: Replay) -> dict[str, Any]:
    """Return what a motion came to when its set-point stands, and later; forces close where they are above 0."""
    end, near = round(motion.seconds * RATE) - 1, np.flatnonzero(motion.opening <= NEAR)
    return {
        "seconds": motion.seconds,
        "stretched": bool(motion.stretched),
        "end_mm": 1e3 * float(motion.opening[end]),
        "end_mm_s": -1e3 * float(motion.speed[end]),
        "later_mm": 1e3 * float(motion.opening[-1]),
        "arrives_mm_s": -1e3 * float(motion.speed[near[0]]) if len(near) else None,
        "peak_N": float(np.abs(motion.force).max()),
    }


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return medians over parts, and how many end within SHUT at REST."""
    if not rows:
        return {}
    there = [abs(row["end_mm"]) <= 1e3 * SHUT and abs(row["end_mm_s"]) <= 1e3 * REST for row in rows]
    arrives = [row["arrives_mm_s"] for row in rows if row["arrives_mm_s"] is not None]
    keys = ("seconds", "end_mm", "end_mm_s", "later_mm", "peak_N")
    return {
        "parts": len(rows),
        "shut_at_rest": sum(there),
        "shut_later": sum(abs(row["later_mm"]) <= 1e3 * SHUT for row in rows),
        **{f"median_{key}": float(np.median([row[key] for row in rows])) for key in keys},
        "median_arrives_mm_s": float(np.median(arrives)) if arrives else None,
        "worst_end_mm": max(abs(row["end_mm"]) for row in rows),
    }


if __name__ == "__main__":
    main()
