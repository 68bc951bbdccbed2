"""Wrong annotations against `s2a certify`: how many rooms that are prepared with one are caught, by class.

    python experiments/certified_annotations.py SCAN ... [--count 25] [--seed 0] [--out FILE]

The classes and the draws are those of wrong_annotations.py. Each room is prepared with the wrong annotation, for the part
concerned (where all of the room is wrong, for one that is drawn), and certified. It counts as caught if `s2a prepare` refuses it,
or a check fails that does not for the right annotation. Physics is asked only where the file and the surface tell nothing.
Writes experiments/results/certified_annotations.json and prints a table.
"""

from __future__ import annotations

import functools
import json
import logging
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from room_defects import named_by
from wrong_annotations import CLASSES, Wrong, arguments, case, row, summary

from s2a.certify.check_suite import CertifyConfig
from s2a.commands import certify as command
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scan.evidence import Bounds
from s2a.scene.scene import Scene
from s2a.scene.usd import sim_stage

RESULTS = Path(__file__).parent / "results/certified_annotations.json"


def main() -> None:
    """Prepare and certify with wrong annotations, write the figures and print a table."""
    args = arguments(__doc__, RESULTS)
    logging.disable(logging.WARNING)
    bounds = Bounds()
    cases = [case(path, bounds) for path in args.scans]
    random = np.random.default_rng(args.seed)
    drawn = [(name, pick(cases, random)) for name, pick in CLASSES.items() for _ in range(args.count)]
    ordered = [drawn[i] for i in random.permutation(len(drawn))]  # so that a run that is cut off has some of each
    known: dict[tuple[str, str, bool], set[str]] = {}
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in CLASSES}
    for name, wrong in track(ordered, "certifying", len(ordered)):
        movable = wrong.case.surface.scene.movable
        part = wrong.part or movable[random.integers(len(movable))]
        found = _failed(wrong.scene, part, physics=False)
        found -= _right(wrong, part, known, physics=False)
        if not found:
            found = _failed(wrong.scene, part) - _right(wrong, part, known)
        rows[name].append(row(wrong, found) | {"part": part})
        every = [one for group in rows.values() for one in group]
        result = {
            "seed": args.seed,
            "scans": [one.name for one in cases],
            "classes": {group: summary(found) for group, found in rows.items()},
            "all": summary(every),
            "missed": [one for one in every if not one["caught"]],
            **provenance("cpu"),
        }
        with atomic_write(args.out) as file:
            file.write_text(json.dumps(result, indent=1) + "\n")
    for group, figures in {**result["classes"], "all": result["all"]}.items():
        print(f"{group:28}{figures['caught']:4} of {figures['wrong']:4}  {figures['fraction']:.0%}")
    for one in result["missed"]:
        print(f"missed: {one['scan']} {one['part']} {one['how']}")


def _right(wrong: Wrong, part: str, known: dict[tuple[str, str, bool], set[str]], *, physics: bool = True) -> set[str]:
    """Return the checks that fail on a part as it is rightly annotated; `known` keeps them by scan, part and physics."""
    key = (wrong.case.name, part, physics)
    if key not in known:
        known[key] = _failed(wrong.case.surface.scene, part, physics=physics)
    return known[key]


def _failed(scene: Scene, part: str, *, physics: bool = True) -> set[str]:
    """Prepare a scene for a part and certify it, with physics if asked for; return the checks that fail."""
    with tempfile.TemporaryDirectory() as folder:
        path, settings = Path(folder, "room.usd"), _prepare()
        try:
            sim_stage.write(prepare(scene, part, settings), path)
        except InputError:
            return {"prepare"}
        return set(named_by(path, part, _settings(), physics=physics))


@functools.cache
def _prepare() -> PrepareConfig:
    return config.load(PrepareConfig, config.compose("prepare", ["stage=-", "out=-"])["prepare"])


@functools.cache
def _settings() -> CertifyConfig:
    return config.load(command.Config, config.compose("certify", ["stage=-", "out=-"])).certify


if __name__ == "__main__":
    main()
