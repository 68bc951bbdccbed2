"""Do the rules turn the right axis up? The fifty kinds of other_kinds.py, freshly drawn, without a room.

    python experiments/up_axes.py [--runs runs/up_axes] [--seeds 41 42]

Compares the axis that the rules turn up, and the front of what hangs, with the truth. Prints the wrong ones, and writes one
row an object to experiments/results/up_axes.json. What lies as well on another side counts as wrong here.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from insertion_study import RESULTS
from other_kinds import other_objects

from s2a.core import config
from s2a.core.provenance import provenance
from s2a.language.ask import Request
from s2a.language.insert.object_file import ObjectConfig, colour_spread, read_object
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import InsertSettings
from s2a.language.insert.stable_pose import concavities, cross_sections, tilt_margins

FLOOR = {
    "id": "floor_1",
    "label": "floor",
    "supports": [{"kind": "horizontal", "height": 0.0, "free": 9.0, "circle": 2.0}],
}
WALL = {"id": "wall_2", "label": "wall", "size": [4.0, 0.1, 2.5]}


def main() -> None:
    """Ask the rules about every object and write what they said."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs/up_axes"))
    parser.add_argument("--seeds", nargs="*", type=int, default=[41, 42])
    args = parser.parse_args()
    settings = config.load(InsertSettings, config.compose("insert", ["stage=none", "out=none", "llm=rules"]))
    rows = []
    for seed in args.seeds:
        for found in other_objects(args.runs / str(seed), seed, 1).values():
            rows += [{"seed": seed, **_row(path, truth, settings.placement.object)} for path, truth in found]
    wrong = [row for row in rows if not row["right"]]
    print("\n".join(f"{row['label']}: {row['said']} for {row['truth']}" for row in wrong))
    report = {
        "seeds": args.seeds,
        **provenance("cpu"),
        "objects": len(rows),
        "right": len(rows) - len(wrong),
        "rows": rows,
    }
    (RESULTS / "up_axes.json").write_text(json.dumps(report, indent=1) + "\n")


def _row(path: Path, truth: dict, settings: ObjectConfig) -> dict:
    """Return what the rules say of one object, in a room of a floor and a wall."""
    file = read_object(path, settings)
    facts = {
        "label": truth["label"],
        "sides": np.ptp(file.mesh.bounds, axis=0).tolist(),
        "up": file.up,
        "room": [FLOOR, WALL],
    }
    facts |= {"feet": tilt_margins(file.mesh), "hollow": concavities(file.mesh)}
    facts |= {"slices": cross_sections(file.mesh), "varied": colour_spread(file.mesh)}
    plan = json.loads(rules(Request("plan", "", (), None, facts)).text)
    names = ("up", "front") if truth["placement"] == "hanging" else ("up",)
    said, true = ({name: one[name] for name in names} for one in (plan, truth))
    return {"label": truth["label"], "said": said, "truth": true, "right": said == true}


if __name__ == "__main__":
    main()
