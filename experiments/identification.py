"""How well are joints identified from recorded pulls? Parts of prepared rooms, pulled in plain MuJoCo with random dynamics.

    python experiments/identification.py ROOM.usd ... [--by hand|robot] [--each 2] [--seed 0] [--jobs 2] [--out FILE]

Every articulated part is drawn --each times with a mass of 0.5 to 2 times the stage's, a damping of 1 to 15 N s/m, a dry friction
of 0.5 to 5 N and a spring of 1 to 20 N/m at its grasp point. A hand pulls it back and forth for some seconds, four times, and the
recordings have noise of 1 mm and 0.5 N; or the planner's robot opens it at four speeds, and tells its joints and torques
(`robot_pulls`). The file has truth, estimate and deviation of every joint, medians of relative errors, and how many of the 90 %
intervals hold the truth; and for another pull by a hand that is a spring, how far the opening is from the truth at most.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
import robot_pulls
from recorded_pulls import Truth, record

from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.joints.dynamics import PARAMETERS, Dynamics
from s2a.joints.identify import fit, identify
from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving, moving
from s2a.scene.usd import sim_stage

RESULTS = Path(__file__).parent / "results/identification.json"
NOISE = Noise(0.001, 0.5)
NOISES = {"hand": NOISE, "robot": Noise(0.0002, 0.3)}
LEAST, MOST = (0.5, 1.0, 0.5, 1.0), (2.0, 15.0, 5.0, 20.0)
"""Of DRAWN."""
DRAWN = ("mass", "damping", "friction", "spring")
PULLS = 4
"""Recordings of a hand."""


def main() -> None:
    """Identify all joints together, write the file, and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("rooms", type=Path, nargs="+", metavar="ROOM")
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--by", choices=list(NOISES), default="hand")
    parser.add_argument("--jobs", type=int, default=2, help="pulls recorded at once")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, default=RESULTS)
    given = parser.parse_args()
    names, bodies, truths = drawn(given.rooms, given.each, given.seed)
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        pulls = list(pool.map(pulled, [given.by] * len(names), names, bodies, truths, range(len(names))))
    done = [i for i, own in enumerate(pulls) if own]
    names, bodies, truths, pulls = ([each[i] for i in done] for each in (names, bodies, truths, pulls))
    began = time.monotonic()
    found = identified(given.by, bodies, pulls, given.device)
    seconds = time.monotonic() - began
    rows = [
        {
            "part": f"{Path(name[0]).parent.name}/{name[1]}",
            "kind": body.joint.kind,
            "kg_at_grasp": body.inertia,
            "truth": asdict(truth),
            "found": dict(zip(PARAMETERS, each.values.tolist(), strict=True)),
            "deviation": dict(zip(PARAMETERS, each.deviations.tolist(), strict=True)),
            "misfit": each.misfit,
            "held_out": held_out(body, truth, each, 7777 + i),
        }
        for i, (name, body, truth, each) in enumerate(zip(names, bodies, truths, found, strict=True))
    ]
    figures = {
        kind: _figures([row for row in rows if kind in ("all", row["kind"])]) for kind in ("all", *_kinds(bodies))
    }
    about = {"by": given.by, "each": given.each, "seed": given.seed, "seconds_a_joint": seconds / len(rows)}
    with atomic_write(given.out) as out:
        noise = asdict(NOISES[given.by])
        out.write_text(
            json.dumps({**about, "noise": noise, "figures": figures, **provenance(given.device), "rows": rows})
        )
    print(json.dumps({**about, **figures}, indent=1))


def drawn(rooms: Sequence[Path], each: int, seed: int) -> tuple[list[tuple[str, str]], list[Moving], list[Truth]]:
    """Return the articulated parts of rooms, each so many times: room and part, body, and random dynamics."""
    rng, names, bodies = np.random.default_rng(seed), [], []
    for path in rooms:
        room = sim_stage.read(path, visuals=False)
        for part in room.articulations:
            names += [(str(path), part)] * each
            bodies += [moving(room, part)] * each
    values = np.exp([rng.uniform(np.log(LEAST), np.log(MOST)) for _ in bodies]).tolist()
    return names, bodies, [Truth(**dict(zip(DRAWN, each, strict=True))) for each in values]


def pulled(by: str, name: tuple[str, str], body: Moving, truth: Truth, seed: int) -> list[Pull]:
    """Return recordings of a part; none where the robot cannot open it."""
    if by == "hand":
        return [record(body, truth, NOISE, seed=1000 * seed + k) for k in range(PULLS)]
    return robot_pulls.record(Path(name[0]), name[1], body, truth, seed)


def identified(by: str, bodies: list[Moving], pulls: list[list[Pull]], device: str) -> list[Dynamics]:
    """Return the dynamics that a hand's pulls tell, or a robot's."""
    if by == "hand":
        return identify(bodies, pulls, NOISE, device)
    return [fit(body, own, NOISES[by].force) for body, own in zip(bodies, pulls, strict=True)]


def held_out(body: Moving, truth: Truth, found: Dynamics, seed: int) -> float:
    """Return how far apart [m] the true part and that of the dynamics found come, at most, when a hand pulls anew."""
    silent, same = Noise(0.0, 0.0), Truth(*found.values.tolist())
    true, predicted = (record(body, each, silent, seed) for each in (truth, same))
    return float(np.abs(true.opening - predicted.opening).max())


def _kinds(bodies: list[Moving]) -> list[str]:
    return sorted({body.joint.kind for body in bodies})


def _figures(rows: list[dict]) -> dict[str, object]:
    """Return median and 90th percentile of the relative errors, and the share of the 90 % intervals that hold the truth."""
    apart = [row["held_out"] for row in rows]
    figures: dict[str, object] = {
        "joints": len(rows),
        "held_out": {"median": float(np.median(apart)), "within_3mm": float((np.array(apart) <= 0.003).mean())},
    }
    for name in DRAWN:
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
