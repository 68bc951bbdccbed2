"""Predicted parts and joints for a scan: JSON of s2a's own schema, or a pickle as USDNet writes it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, safe_pickle
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh

KINDS = ("rotation", "translation")
USUAL_RANGE = {"rotation": math.pi / 2, "translation": 0.4}
"""Upper limit [rad, m] where a prediction has none: a door's quarter turn, a usual drawer's travel."""
USUAL_LABEL = {"rotation": "door", "translation": "drawer"}
_USDNET = {1: "rotation", 2: "translation"}
_INSIDE = 1e-3  # above it a vertex is in a mask, in USDNet's own evaluation


@dataclass(frozen=True)
class Prediction:
    """One predicted part that moves.

    Attributes:
        label: name ("drawer").
        kind: "rotation" or "translation".
        axis: shape [3], in the scan file's coordinates, as are the others.
        origin: a point on the axis [m], shape [3].
        limits: joint coordinates [m or rad].
        score: confidence, 0 to 1.
        faces: of the scan, shape [n], int64.
        handle: faces of the part to grasp, shape [n], int64; may be empty.
        assumed_range: the upper limit was not predicted, and is the usual one.
    """

    label: str
    kind: str
    axis: np.ndarray
    origin: np.ndarray
    limits: tuple[float, float]
    score: float
    faces: np.ndarray
    handle: np.ndarray
    assumed_range: bool = False


def read(path: Path, surface: ScanMesh, scene: str) -> list[Prediction]:
    """Read the predictions for a scan; those whose mask is empty are left out.

    Args:
        path: .json, or .pkl, .pickle.
        surface: the scan's mesh.
        scene: name of the scan, by which a pickle of several scenes is searched.

    Raises:
        InputError: the file is damaged, belongs to another mesh, or would run code.
    """
    if path.suffix.lower() == ".json":
        found = _from_json(path, surface)
    elif path.suffix.lower() in (".pkl", ".pickle"):
        found = _from_usdnet(path, surface, scene)
    else:
        raise InputError(
            f"predictions {str(path)!r}: the ending {path.suffix!r} is unknown; possible: .json, .pkl, .pickle"
        )
    return [prediction for prediction in found if len(prediction.faces)]


def faces_of_vertices(inside: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces with at least two corners in a mask of vertices, shape [n], int64."""
    return np.flatnonzero(inside[faces].sum(axis=1) >= 2)


def _from_json(path: Path, surface: ScanMesh) -> list[Prediction]:
    """Read s2a's schema."""
    return [_record(record, surface) for record in fields.load(path).records("predictions", "prediction")]


def _record(record: Record, surface: ScanMesh) -> Prediction:
    """Return one record of the JSON schema."""
    kind = record.text("type")
    if kind not in KINDS:
        record.refuse("type", f"possible: {', '.join(KINDS)}")
    low = record.number("rangeMin") if record.has("rangeMin") else 0.0
    high = record.number("rangeMax") if record.has("rangeMax") else USUAL_RANGE[kind]
    if low > high:
        record.refuse("rangeMin", f"above rangeMax {high:g}; swap them")
    score = record.number("score") if record.has("score") else 1.0
    label = record.text("label") if record.has("label") else USUAL_LABEL[kind]
    handle = _mask(record.record("handle"), surface) if record.has("handle") else np.empty(0, dtype=np.int64)
    axis, origin = _axis(record), record.vector("origin")
    assumed = not record.has("rangeMax")
    return Prediction(label, kind, axis, origin, (low, high), score, _mask(record, surface), handle, assumed)


def _axis(record: Record) -> np.ndarray:
    """Return the axis, not 0."""
    axis = record.vector("axis")
    if not np.linalg.norm(axis) > 1e-6:
        record.refuse("axis", "expected a direction of length 1")
    return axis


def _mask(record: Record, surface: ScanMesh) -> np.ndarray:
    """Return the faces that a record lists, or whose vertices it lists."""
    if record.has("faces"):
        return np.unique(record.indices("faces", len(surface.faces), "faces"))
    inside = np.zeros(len(surface.vertices), dtype=bool)
    inside[record.indices("vertices", len(inside), "vertices")] = True
    return faces_of_vertices(inside, surface.faces)


def _from_usdnet(path: Path, surface: ScanMesh, scene: str) -> list[Prediction]:
    """Read USDNet's dictionary of a scene, alone or by the scene's name."""
    content = safe_pickle.read(path)
    if isinstance(content, Mapping) and "pred_masks" not in content:
        if scene not in content and len(content) != 1:
            known = ", ".join(map(str, list(content)[:6])) or "none"
            raise InputError(
                f"{path}: holds no scene {scene!r} (scenes found: {known}); name the scan's folder like its scene"
            )
        content = content[scene] if scene in content else next(iter(content.values()))
    if not isinstance(content, Mapping):
        raise InputError(f"{path}: holds a {type(content).__name__}; expected a dictionary with pred_masks ...")
    masks = _array(path, content, "pred_masks", (len(surface.vertices), None))
    count = masks.shape[1]
    classes, scores = (_array(path, content, key, (count,)) for key in ("pred_classes", "pred_scores"))
    axes, origins = (_array(path, content, key, (count, 3)) for key in ("pred_axises", "pred_origins"))
    if unknown := set(classes.astype(int).tolist()) - set(_USDNET):
        raise InputError(f"{path}: pred_classes holds {min(unknown)}; possible: 1 (rotation), 2 (translation)")
    return [
        _usdnet(masks[:, i] > _INSIDE, _USDNET[int(classes[i])], axes[i], origins[i], float(scores[i]), surface)
        for i in range(count)
        if np.linalg.norm(axes[i]) > 1e-6
    ]


def _usdnet(
    inside: np.ndarray, kind: str, axis: np.ndarray, origin: np.ndarray, score: float, surface: ScanMesh
) -> Prediction:
    """Return one part of USDNet's, which predicts no range."""
    faces = faces_of_vertices(inside, surface.faces)
    limits = (0.0, USUAL_RANGE[kind])
    return Prediction(USUAL_LABEL[kind], kind, axis, origin, limits, score, faces, np.empty(0, dtype=np.int64), True)


def _array(path: Path, content: Mapping[str, Any], key: str, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return an array of finite numbers of the given shape; None is any length."""
    if key not in content:
        raise InputError(f"{path}: key {key!r} is missing; keys found: {', '.join(map(str, list(content)[:8]))}")
    try:
        array = np.asarray(content[key])
    except ValueError:  # lists of different lengths
        array = np.empty(0, dtype=object)
    fits = array.ndim == len(shape) and all(want in (None, have) for want, have in zip(shape, array.shape, strict=True))
    if not fits or array.dtype.kind not in "biuf":
        raise InputError(
            f"{path}: {key} is {array.dtype} of shape {list(array.shape)}; expected numbers of shape "
            f"{['any' if want is None else want for want in shape]}, vertices as in the scan's mesh"
        )
    if not np.isfinite(array).all():
        raise InputError(f"{path}: {key} holds numbers that are not finite; predict again")
    return array
