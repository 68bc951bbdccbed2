"""Predictions -> Articulate3D's files, so that a predicted scan is read as an annotated one."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from s2a.scan.predictions import Prediction


def choose(found: Sequence[Prediction], min_score: float, overlap: float) -> list[Prediction]:
    """Return the predictions with a score, best first, without those that mostly repeat a better one.

    Networks predict the same part several times; USDNet's authors leave that to the evaluation.

    Args:
        found: all predictions.
        min_score: lowest score.
        overlap: fraction of the smaller mask's faces that a better prediction may hold.
    """
    kept: list[Prediction] = []
    for prediction in sorted(found, key=lambda one: -one.score):
        if prediction.score >= min_score and all(_overlap(prediction, other) <= overlap for other in kept):
            kept.append(prediction)
    return kept


def write(folder: Path, scene: str, kept: Sequence[Prediction], fixed: Sequence[tuple[str, np.ndarray]] = ()) -> None:
    """Write `<scene>_parts.json` and `<scene>_artic.json`; a part gets its handle as a child.

    Args:
        folder: of the scan.
        scene: name of the scan.
        kept: predictions, in the coordinates of the scan's file.
        fixed: names and faces of what does not move.
    """
    parts: list[dict[str, Any]] = []
    joints: list[dict[str, Any]] = []
    for index, one in enumerate(kept, start=1):
        number = len(parts) + 1
        name = one.label.split(".")[0].strip() or "part"
        parts.append(_part(number, f"{name}.{index}", np.setdiff1d(one.faces, one.handle)))
        joints.append(_joint(number, one))
        if len(one.handle):
            parts.append(_part(number + 1, f"handle.{index}.1", one.handle))
    for index, (name, faces) in enumerate(fixed, start=len(kept) + 1):
        parts.append(_part(len(parts) + 1, f"{name}.{index}", faces))
    _write(folder / f"{scene}_parts.json", {"annotations": parts})
    _write(folder / f"{scene}_artic.json", {"articulations": joints})


def _part(number: int, label: str, faces: np.ndarray) -> dict[str, Any]:
    return {"partId": number, "label": label, "triIndices": faces.tolist()}


def _joint(number: int, one: Prediction) -> dict[str, Any]:
    return {
        "pid": number,
        "type": one.kind,
        "axis": one.axis.tolist(),
        "origin": one.origin.tolist(),
        "rangeMin": one.limits[0],
        "rangeMax": one.limits[1],
        "score": one.score,
    }


def _write(path: Path, data: dict[str, Any]) -> None:
    path.write_text(json.dumps({"data": data}, separators=(",", ":")), encoding="utf-8")


def _overlap(one: Prediction, other: Prediction) -> float:
    """Return the fraction of the smaller mask that both hold."""
    return len(np.intersect1d(one.faces, other.faces)) / min(len(one.faces), len(other.faces))
