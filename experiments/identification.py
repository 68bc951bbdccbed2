"""How well are joints identified from recorded pulls? Parts of prepared rooms, pulled in plain MuJoCo with random dynamics.

    python experiments/identification.py ROOM.usd ... [--each 2] [--pulls 4] [--seed 0] [--out FILE]

Every articulated part is drawn --each times with a mass of 0.5 to 2 times the stage's, a damping of 1 to 15 N s/m, a dry friction
of 0.5 to 5 N and a spring of 1 to 20 N/m at its grasp point; a hand pulls it back and forth for some seconds, --pulls times.
Recordings have noise of 1 mm and 0.5 N. The file has truth, estimate and deviation of every joint, medians of relative errors,
and how many of the 90 % intervals hold the truth.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
from recorded_pulls import Truth, record

from s2a.diff.identify import identify
from s2a.diff.joint_kernels import PARAMETERS
from s2a.diff.moving_body import Moving, moving
from s2a.diff.pull import Noise
from s2a.outputs import atomic_write
from s2a.provenance import provenance
from s2a.usd import sim_stage

RESULTS = Path(__file__).parent / "results/identification.json"
NOISE = Noise(0.001, 0.5)
LEAST, MOST = (0.5, 1.0, 0.5, 1.0), (2.0, 15.0, 5.0, 20.0)
"""Of mass factor, damping, friction, spring."""


def main() -> None:
    """Identify all joints together, write the file, and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("rooms", type=Path, nargs="+", metavar="ROOM")
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--pulls", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    names, bodies = [], []
    for path in given.rooms:
        room = sim_stage.read(path, visuals=False)
        for part in room.articulations:
            names += [f"{room.name}/{part}"] * given.each
            bodies += [moving(room, part)] * given.each
    truths = [Truth(*np.exp(rng.uniform(np.log(LEAST), np.log(MOST))).tolist()) for _ in bodies]
    pulls = [
        [record(body, truth, NOISE, seed=1000 * i + k) for k in range(given.pulls)]
        for i, (body, truth) in enumerate(zip(bodies, truths, strict=True))
    ]
    began = time.monotonic()
    found = identify(bodies, pulls, NOISE, given.device)
    seconds = time.monotonic() - began
    rows = [
        {
            "part": name,
            "kind": body.joint.kind,
            "kg_at_grasp": body.inertia,
            "truth": asdict(truth),
            "found": dict(zip(PARAMETERS, each.values.tolist(), strict=True)),
            "deviation": dict(zip(PARAMETERS, each.deviations.tolist(), strict=True)),
            "misfit": each.misfit,
        }
        for name, body, truth, each in zip(names, bodies, truths, found, strict=True)
    ]
    figures = {
        kind: _figures([row for row in rows if kind in ("all", row["kind"])]) for kind in ("all", *_kinds(bodies))
    }
    about = {"each": given.each, "pulls": given.pulls, "seed": given.seed, "seconds_a_joint": seconds / len(rows)}
    with atomic_write(given.out) as out:
        out.write_text(
            json.dumps({**about, "noise": asdict(NOISE), "figures": figures, **provenance(given.device), "rows": rows})
        )
    print(json.dumps({**about, **figures}, indent=1))


def _kinds(bodies: list[Moving]) -> list[str]:
    return sorted({body.joint.kind for body in bodies})


def _figures(rows: list[dict]) -> dict[str, object]:
    """Return median and 90th percentile of the relative errors, and the share of the 90 % intervals that hold the truth."""
    figures: dict[str, object] = {"joints": len(rows)}
    for name in Truth.__dataclass_fields__:
        truth, found, deviation = (
            np.array([row[key][name] for row in rows]) for key in ("truth", "found", "deviation")
        )
        error = np.abs(found - truth)
        figures[name] = {
            "median": float(np.median(error / truth)),
            "p90": float(np.percentile(error / truth, 90)),
            "held_by_90": float((error <= 1.6449 * deviation).mean()),
        }
    return figures


if __name__ == "__main__":
    main()
