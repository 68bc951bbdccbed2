"""Which articulated parts of a room are prepared: those that are named, or all that can be."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np

from s2a.core.errors import InputError
from s2a.prepare.part import PartConfig, PartResult, part_results
from s2a.prepare.target import bodies, target_joint
from s2a.scene.scene import Scene

_log = logging.getLogger(__name__)

ALL = "all"
"""Stands for every articulated part of a room."""
MAX_LENGTH = 100.0
"""[m] No scan of rooms is longer; in centimetres or inches every room is, and would be cut into millions of cells."""


def refuse_other_units(scene: Scene) -> None:
    """Raise an InputError for a scene that cannot be in metres."""
    boxes = np.array([part.mesh.bounds for part in scene.parts.values() if len(part.mesh.faces)])
    length = float((boxes[:, 1].max(axis=0) - boxes[:, 0].min(axis=0)).max()) if len(boxes) else 0.0
    if length > MAX_LENGTH:
        raise InputError(
            f"scene {scene.name!r} is {length:.0f} m long; expected metres, and {MAX_LENGTH:g} of them or less: "
            "`s2a check scan=...` names the unit; scale the scan to metres"
        )


Ahead = Callable[[Sequence[str]], object]
"""Work that can be done beside that on the parts with these ids."""


def selected_parts(
    scene: Scene, targets: Sequence[str], config: PartConfig, ahead: Ahead | None = None
) -> dict[str, PartResult]:
    """Return the results of parts by id.

    Args:
        scene: the room.
        targets: ids of the parts, or only "all": every part that can be prepared; of the others a warning is logged.
        config: settings of each part.
        ahead: done by this process while others begin with the parts.

    Raises:
        InputError: a part that is named cannot be prepared; of all parts, none can; the scene is not in metres.
    """
    refuse_other_units(scene)
    return _all(scene, config, ahead) if tuple(targets) == (ALL,) else _exactly(scene, targets, config, ahead)


def _exactly(scene: Scene, parts: Sequence[str], config: PartConfig, ahead: Ahead | None) -> dict[str, PartResult]:
    """Return the results of parts that were asked for by their ids."""
    for part in parts:
        target_joint(scene, part)  # one that cannot move is refused before the first is worked on
    results = _results(scene, parts, config, ahead)
    for result in results.values():
        if isinstance(result, InputError):
            raise result
    return {part: result for part, result in results.items() if isinstance(result, PartResult)}


def _all(scene: Scene, config: PartConfig, ahead: Ahead | None) -> dict[str, PartResult]:
    """Return the results of all articulated parts that can be prepared; warn of the others, which are frozen."""
    parts = scene.movable
    while True:
        results = _results(scene, parts, config, ahead)
        refused = {part: result for part, result in results.items() if isinstance(result, InputError)}
        for part, error in refused.items():
            _log.warning("%s is left out: %s", part, error)
        # Without those, what they carried belongs to other bodies.
        parts = tuple(part for part in parts if part not in refused)
        if not parts:
            raise InputError(f"scene {scene.name!r} has no articulated part that can be prepared")
        if not refused:
            return {part: result for part, result in results.items() if isinstance(result, PartResult)}


def _results(
    scene: Scene, parts: Sequence[str], config: PartConfig, ahead: Ahead | None
) -> dict[str, PartResult | InputError]:
    meanwhile = None if ahead is None else lambda: ahead(parts)
    return part_results(scene, _with_members(scene, parts), config, meanwhile)


def _with_members(scene: Scene, parts: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Return articulated parts with the parts of their bodies."""
    owners = bodies(scene, parts)
    return [(part, tuple(i for i, owner in owners.items() if owner == part)) for part in parts]
