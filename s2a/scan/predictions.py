"""Predicted parts and joints of a scan, from JSON or a network's pickle, and as Articulate3D's files."""

import json
import math
import pickle
import reprlib
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh


def read_pickle(path: Path) -> Any:
    """Return what a pickle file holds.

    Raises:
        InputError: it cannot be read, is damaged, or needs anything but arrays, numbers, strings, lists and dictionaries.
    """
    try:
        with path.open("rb") as file:
            return _resolved(_Restricted(file).load())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except Exception as error:  # damage provokes any: EOFError, KeyError, ValueError, AttributeError, MemoryError ...
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{path}: truncated or not a pickle ({reason}); save it again") from error


class _Restricted(pickle.Unpickler):
    """An unpickler that finds stand-ins of numpy's constructors and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return what stands for an allowed constructor."""
        stand_in = _STAND_INS.get((module.replace("numpy.core", "numpy._core"), name))
        if stand_in is None:
            raise InputError(
                f"the pickle loads {reprlib.repr(module + '.' + name)}, which may run code; "
                "save numpy arrays in dictionaries (tensor.cpu().numpy()), or JSON"
            )
        return stand_in


class _Dtype:
    """A type of numbers or strings. numpy's own takes flags from a pickle by which it reads numbers as addresses of objects."""

    def __init__(self, code: str, align: bool = False, copy: bool = False) -> None:
        self.plain = np.dtype(code)
        if self.plain.hasobject:
            raise InputError("the pickle holds an array of objects; save arrays of numbers, or JSON")
        if self.plain.kind not in "biufcSU":
            raise InputError(f"the pickle holds an array of {self.plain}; save arrays of numbers, or JSON")

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Take the byte order, which is all that a plain type has."""
        if state[1] in ("<", ">"):
            self.plain = self.plain.newbyteorder(state[1])


class _Array:
    """An array whose contents follow."""

    value: np.ndarray = np.zeros(0)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        _, shape, dtype, fortran, data = state
        self.value = _from_buffer(data, dtype, shape, "F" if fortran else "C").value


def _from_buffer(data: bytes, dtype: _Dtype, shape: tuple[int, ...], order: str) -> _Array:
    array = _Array()
    flat = np.frombuffer(data, dtype.plain) if data else np.zeros(0, dtype.plain)
    array.value = flat.reshape(shape, order="F" if order == "F" else "C").copy()
    return array


def _latin(text: str, encoding: str) -> bytes:
    """Return bytes that a pickle of a protocol below 3 holds as text."""
    if encoding != "latin1":
        raise InputError(f"the pickle holds bytes as {encoding!r}; save it with protocol 4, or JSON")
    return text.encode("latin1")


def _resolved(value: Any) -> Any:
    """Return contents with arrays in the place of what stands for them."""
    if isinstance(value, _Array):
        return value.value
    if isinstance(value, dict):
        return {key: _resolved(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_resolved(each) for each in value)
    return value


_STAND_INS = {
    ("numpy._core.multiarray", "_reconstruct"): lambda *_: _Array(),
    ("numpy._core.multiarray", "scalar"): lambda dtype, data: np.frombuffer(data, dtype.plain)[0],
    ("numpy._core.numeric", "_frombuffer"): _from_buffer,
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Dtype,
    ("_codecs", "encode"): _latin,
    ("collections", "OrderedDict"): OrderedDict,
}

KINDS = ("rotation", "translation")
# Upper limit [rad, m] where a prediction has none: a door's quarter turn, a usual drawer's travel
USUAL_RANGE = {"rotation": math.pi / 2, "translation": 0.4}
USUAL_LABEL = {"rotation": "door", "translation": "drawer"}
_USDNET = {1: "rotation", 2: "translation"}
_INSIDE = 1e-3  # above it a vertex is in a mask, in USDNet's own evaluation


@dataclass(frozen=True)
class Prediction:
    """One predicted part that moves."""

    label: str  # name ("drawer")
    kind: str  # "rotation" or "translation"
    axis: np.ndarray  # shape [3], in the scan file's coordinates, as are the others
    origin: np.ndarray  # a point on the axis [m], shape [3]
    limits: tuple[float, float]  # joint coordinates [m or rad]
    score: float  # confidence, 0 to 1
    faces: np.ndarray  # of the scan, shape [n], int64
    handle: np.ndarray  # faces of the part to grasp, shape [n], int64; may be empty
    assumed_range: bool = False  # the upper limit was not predicted, and is the usual one


def read(path: Path, surface: ScanMesh, scene: str) -> list[Prediction]:
    """Read the predictions for a scan; those whose mask is empty are left out.

    `scene`: name of the scan, by which a pickle of several scenes is searched.

    Raises:
        InputError: the file is damaged, belongs to another mesh, or would run code.
    """
    if path.suffix.lower() == ".json":
        predictions = [_record(record, surface) for record in fields.load(path).records("predictions", "prediction")]
    elif path.suffix.lower() in (".pkl", ".pickle"):
        predictions = _from_usdnet(path, surface, scene)
    else:
        raise InputError(
            f"predictions {str(path)!r}: the ending {path.suffix!r} is unknown; possible: .json, .pkl, .pickle"
        )
    return [prediction for prediction in predictions if len(prediction.faces)]


def faces_of_vertices(inside: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces with at least two corners in a mask of vertices, shape [n], int64."""
    return np.flatnonzero(inside[faces].sum(axis=1) >= 2)


def _record(record: Record, surface: ScanMesh) -> Prediction:
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
    axis, origin = record.vector("axis"), record.vector("origin")
    if not np.linalg.norm(axis) > 1e-6:
        record.refuse("axis", "expected a direction of length 1")
    assumed = not record.has("rangeMax")
    return Prediction(label, kind, axis, origin, (low, high), score, _mask(record, surface), handle, assumed)


def _mask(record: Record, surface: ScanMesh) -> np.ndarray:
    """Return the faces that a record lists, or whose vertices it lists."""
    if record.has("faces"):
        return np.unique(record.indices("faces", len(surface.faces), "faces"))
    inside = np.zeros(len(surface.vertices), dtype=bool)
    inside[record.indices("vertices", len(inside), "vertices")] = True
    return faces_of_vertices(inside, surface.faces)


def _from_usdnet(path: Path, surface: ScanMesh, scene: str) -> list[Prediction]:
    """Read USDNet's dictionary of a scene, alone or by the scene's name."""
    content = read_pickle(path)
    if isinstance(content, Mapping) and "pred_masks" not in content:
        if scene not in content and len(content) != 1:
            scenes = ", ".join(map(str, list(content)[:6])) or "none"
            raise InputError(
                f"{path}: holds no scene {scene!r} (scenes found: {scenes}); name the scan's folder like its scene"
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
    predictions = []
    for i in np.flatnonzero(np.linalg.norm(axes, axis=1) > 1e-6):
        kind, faces = _USDNET[int(classes[i])], faces_of_vertices(masks[:, i] > _INSIDE, surface.faces)
        limits, handle = (0.0, USUAL_RANGE[kind]), np.empty(0, dtype=np.int64)  # USDNet predicts neither
        score = float(scores[i])
        predictions.append(Prediction(USUAL_LABEL[kind], kind, axes[i], origins[i], limits, score, faces, handle, True))
    return predictions


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


def choose(predictions: Sequence[Prediction], min_score: float, overlap: float) -> list[Prediction]:
    """Return the predictions with a score, best first, without those that mostly repeat a better one.

    Networks predict the same part several times; USDNet's authors leave that to the evaluation.

    `overlap`: fraction of the smaller mask's faces that a better prediction may hold.
    """
    best: list[Prediction] = []
    for prediction in sorted(predictions, key=lambda one: -one.score):
        if prediction.score >= min_score and all(_overlap(prediction, other) <= overlap for other in best):
            best.append(prediction)
    return best


def write(
    folder: Path, scene: str, predictions: Sequence[Prediction], fixed: Sequence[tuple[str, np.ndarray]] = ()
) -> None:
    """Write `<scene>_parts.json` and `<scene>_artic.json`; a part gets its handle as a child.

    `predictions`: predictions, in the coordinates of the scan's file.
    """
    parts: list[dict[str, Any]] = []
    joints: list[dict[str, Any]] = []
    for index, one in enumerate(predictions, start=1):
        number = len(parts) + 1
        name = one.label.split(".")[0].strip() or "part"
        parts.append(_part(number, f"{name}.{index}", np.setdiff1d(one.faces, one.handle)))
        joint = {"pid": number, "type": one.kind, "axis": one.axis.tolist(), "origin": one.origin.tolist()}
        joints.append(joint | {"rangeMin": one.limits[0], "rangeMax": one.limits[1], "score": one.score})
        if len(one.handle):
            parts.append(_part(number + 1, f"handle.{index}.1", one.handle))
    for index, (name, faces) in enumerate(fixed, start=len(predictions) + 1):
        parts.append(_part(len(parts) + 1, f"{name}.{index}", faces))
    for ending, data in (("parts", {"annotations": parts}), ("artic", {"articulations": joints})):
        text = json.dumps({"data": data}, separators=(",", ":"))
        (folder / f"{scene}_{ending}.json").write_text(text, encoding="utf-8")


def _part(number: int, label: str, faces: np.ndarray) -> dict[str, Any]:
    return {"partId": number, "label": label, "triIndices": faces.tolist()}


def _overlap(one: Prediction, other: Prediction) -> float:
    """Return the fraction of the smaller mask that both hold."""
    return len(np.intersect1d(one.faces, other.faces)) / min(len(one.faces), len(other.faces))
