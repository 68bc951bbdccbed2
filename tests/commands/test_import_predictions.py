"""`s2a import scan=... predictions=...`: predicted parts become an annotation; a pickle runs no code."""

from __future__ import annotations

import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
import textured_room

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.scan import ply
from s2a.scan import predictions as safe_pickle


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """Return the folder of an imported scan."""
    assert (
        cli.main(["import", f"mesh={textured_room.glb(tmp_path / 'room.glb')}", f"out={tmp_path / 'scan'}", "texel=9"])
        == 0
    )
    return tmp_path / "scan"


def predict(scan: Path, predictions: Path) -> dict[str, list[dict]]:
    """Import predictions and return what was written, by the files' last words."""
    out = scan.parent / "predicted"
    assert cli.main(["import", f"scan={scan}", f"predictions={predictions}", f"out={out}"]) == 0
    found = {}
    for kind, key in (("parts", "annotations"), ("artic", "articulations")):
        (path,) = out.glob(f"*_{kind}.json")
        found[kind] = json.loads(path.read_text())["data"][key]
    return found


def drawer(**more: object) -> dict[str, object]:
    return {"type": "translation", "axis": [1, 0, 0], "origin": [0, 0, 1], "faces": [0, 1], "score": 0.9} | more


def test_json_becomes_parts_joints_and_handles(scan: Path, tmp_path: Path) -> None:
    records = [
        drawer(rangeMax=0.3, handle={"faces": [1]}, label="drawer"),
        drawer(score=0.8),  # the same faces again
        {"type": "rotation", "axis": [0, 0, 1], "origin": [1, 0, 0], "faces": [4, 5], "score": 0.7, "rangeMax": 1.5},
        drawer(faces=[2, 3], score=0.2),  # below min_score
    ]
    (tmp_path / "p.json").write_text(json.dumps({"predictions": records}))
    found = predict(scan, tmp_path / "p.json")
    assert [(part["label"], part["triIndices"]) for part in found["parts"]] == [
        ("drawer.1", [0]),
        ("handle.1.1", [1]),
        ("door.2", [4, 5]),
    ]
    assert [(joint["pid"], joint["type"], joint["rangeMax"]) for joint in found["artic"]] == [
        (1, "translation", 0.3),
        (3, "rotation", 1.5),
    ]


def test_a_predicted_scan_is_exported_as_an_annotated_one(scan: Path, tmp_path: Path) -> None:
    (tmp_path / "p.json").write_text(json.dumps({"predictions": [drawer(rangeMax=0.3)]}))
    predict(scan, tmp_path / "p.json")
    assert cli.main(["export", f"scan={tmp_path / 'predicted'}", f"out={tmp_path / 'usd'}"]) == 0
    assert "drawer" in (tmp_path / "usd/descriptive.usda").read_text()


def usdnet(scan: Path, **more: object) -> dict[str, object]:
    """Return a prediction of one part: all vertices of the first face."""
    surface = ply.read(next(scan.glob("*.ply")))
    masks = np.zeros((len(surface.vertices), 1), np.float32)
    masks[surface.faces[0]] = 1.0
    arrays = {"pred_masks": masks, "pred_classes": np.array([1]), "pred_scores": np.array([0.9])}
    arrays |= {"pred_axises": np.array([[0.0, 0, 1]]), "pred_origins": np.array([[1.0, 0, 0]])}
    return arrays | more


def test_a_pickle_of_usdnet_is_read_and_its_assumed_range_said(
    scan: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "p.pkl").write_bytes(pickle.dumps({"any_scene": usdnet(scan)}))
    found = predict(scan, tmp_path / "p.pkl")
    assert 0 in found["parts"][0]["triIndices"]
    assert found["artic"][0]["rangeMax"] == pytest.approx(np.pi / 2)
    assert "1 of 1 joints have no range" in caplog.text


def test_masks_of_another_mesh_are_refused(scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p.pkl").write_bytes(pickle.dumps(usdnet(scan, pred_masks=np.ones((7, 1)))))
    assert cli.main(["import", f"scan={scan}", f"predictions={tmp_path / 'p.pkl'}", f"out={tmp_path / 'out'}"]) == 2
    message = capsys.readouterr().err
    assert "pred_masks is float64 of shape [7, 1]" in message and message.count("\n") == 1
    assert not (tmp_path / "out").exists()


class Shell:
    """What runs a command when it is unpickled."""

    def __init__(self, command: str) -> None:
        self.command = command

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (self.command,)


class Evaluated:
    """What evaluates text when it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return eval, ("__import__('os').getcwd()",)


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_a_pickle_runs_no_code(tmp_path: Path, protocol: int) -> None:
    proof = tmp_path / "proof"
    for bad in (Shell(f"touch {proof}"), {"a": [Evaluated()]}, np.array([Shell(f"touch {proof}")], dtype=object), Path):
        (tmp_path / "p.pkl").write_bytes(pickle.dumps(bad, protocol))
        with pytest.raises(InputError, match="may run code|array of objects"):
            safe_pickle.read_pickle(tmp_path / "p.pkl")
    assert not proof.exists()


@pytest.mark.parametrize(
    "text", [b"cnumpy\nload\n.", b"cnumpy.core.multiarray\n_reconstruct.__globals__\n.", b"cbuiltins\ngetattr\n."]
)
def test_other_functions_of_allowed_modules_are_refused(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "p.pkl").write_bytes(text)
    with pytest.raises(InputError, match="may run code"):
        safe_pickle.read_pickle(tmp_path / "p.pkl")


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_plain_arrays_come_through(tmp_path: Path, protocol: int) -> None:
    content = {"a": np.arange(6.0).reshape(2, 3), "b": [np.float32(1.5), "text", {"c": (1, None, True)}]}
    (tmp_path / "p.pkl").write_bytes(pickle.dumps(content, protocol))
    found = safe_pickle.read_pickle(tmp_path / "p.pkl")
    assert np.array_equal(found["a"], content["a"]) and found["b"] == content["b"]


def forged(state: tuple[object, ...], data: object) -> bytes:
    """Return the pickle of an array of two whose type claims a state of its own."""

    def plain(value: object) -> bytes:
        return pickle.dumps(value, 2)[2:-1]

    array = b"cnumpy._core.multiarray\n_reconstruct\n(cnumpy\nndarray\n" + plain((0,)) + plain("b") + b"tR"
    dtype = b"cnumpy\ndtype\n" + plain(("i8", False, True)) + b"R" + plain(state) + b"b"
    return b"\x80\x02" + array + b"(" + plain(1) + plain((2,)) + dtype + b"\x89" + plain(data) + b"tb."


def test_an_array_that_claims_to_hold_objects_holds_numbers(tmp_path: Path) -> None:
    """By the flags (63) numpy's own type takes the numbers for addresses."""
    (tmp_path / "p.pkl").write_bytes(forged((3, "|", None, None, None, 8, 8, 63), np.array([1, 2]).tobytes()))
    found = safe_pickle.read_pickle(tmp_path / "p.pkl")
    assert found.tolist() == [1, 2] and not found.dtype.hasobject
    (tmp_path / "p.pkl").write_bytes(forged((3, "|", None, None, None, 8, 8, 63), [1, 2]))
    with pytest.raises(InputError, match="not a pickle"):
        safe_pickle.read_pickle(tmp_path / "p.pkl")


def test_byte_orders_and_fortran_order_are_kept(tmp_path: Path) -> None:
    for content in (
        np.arange(6, dtype=">i4").reshape(2, 3),
        np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        np.zeros((0, 3)),
    ):
        (tmp_path / "p.pkl").write_bytes(pickle.dumps(content))
        assert np.array_equal(safe_pickle.read_pickle(tmp_path / "p.pkl"), content)


@pytest.mark.parametrize("data", [b"", b"not a pickle", pickle.dumps(np.arange(9))[:-20]])
def test_what_is_damaged_is_said(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "p.pkl").write_bytes(data)
    with pytest.raises(InputError, match="truncated or not a pickle"):
        safe_pickle.read_pickle(tmp_path / "p.pkl")
