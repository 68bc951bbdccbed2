"""Labelled boxes of RoomPlan and ARKitScenes: where they are, and one line where they are damaged."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pxr import Gf, Usd, UsdGeom

from s2a.core.errors import InputError
from s2a.scan import labelled_boxes

POSE = trimesh.transformations.rotation_matrix(0.6, (0, 1, 0), (1.0, 0.4, -2.0))
"""Of a storage of 0.8 x 0.9 x 0.5, y up."""
POSE[:3, 3] = [1.0, 0.4, -2.0]
SIZE = [0.8, 0.9, 0.5]


def roomplan_json(path: Path) -> Path:
    """Write a captured room as Apple encodes it: transforms column by column."""
    storage = {"category": {"storage": {}}, "dimensions": SIZE, "transform": POSE.T.ravel().tolist()}
    washer = {"category": {"washerDryer": {}}, "dimensions": [0.6, 0.8, 0.6], "transform": np.eye(4).ravel().tolist()}
    wall = {"category": {"wall": {}}, "dimensions": [4.0, 2.5, 0.0], "transform": np.eye(4).ravel().tolist()}
    path.write_text(json.dumps({"objects": [storage, washer], "walls": [wall], "version": 2}))
    return path


def roomplan_usdz(path: Path) -> Path:
    """Write the storage as RoomPlan's USDZ does: a unit mesh, or a cube, below groups, placed and scaled by its prim."""
    stage = Usd.Stage.CreateNew(str(path.with_suffix(".usdc")))
    UsdGeom.SetStageUpAxis(stage, "Y")
    placed = POSE @ np.diag([*SIZE, 1.0])
    if path.stem == "parametric":  # what most users export: cubes, scaled by an operation of their own, beside walls
        cube = UsdGeom.Cube.Define(stage, "/Room/Parametric_grp/Object_grp/Storage_grp/Storage0")
        cube.CreateSizeAttr(1.0)
        cube.AddTransformOp().Set(Gf.Matrix4d(*POSE.T.ravel().tolist()))
        cube.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d(*SIZE))
        wall = UsdGeom.Cube.Define(stage, "/Room/Parametric_grp/Arch_grp/Wall_2_grp/Wall2")
        wall.CreateSizeAttr(1.0)
        wall.AddScaleOp().Set(Gf.Vec3f(4.0, 2.5, 1e-4))
    else:
        mesh = UsdGeom.Mesh.Define(stage, "/Room/Mesh_grp/Object_grp/Storage_grp/Storage0")
        box = trimesh.creation.box((1, 1, 1))
        mesh.CreatePointsAttr([Gf.Vec3f(*map(float, point)) for point in box.vertices])
        mesh.CreateFaceVertexCountsAttr([3] * len(box.faces))
        mesh.CreateFaceVertexIndicesAttr(box.faces.ravel().tolist())
        mesh.AddTransformOp().Set(Gf.Matrix4d(*placed.T.ravel().tolist()))
        UsdGeom.Mesh.Define(stage, "/Room/Mesh_grp/Arch_grp/Wall0")
    stage.Save()
    from pxr import UsdUtils

    assert UsdUtils.CreateNewUsdzPackage(str(path.with_suffix(".usdc")), str(path))
    return path


def arkitscenes(path: Path) -> Path:
    """Write the storage as ARKitScenes does, its axes row by row."""
    box = {"centroid": POSE[:3, 3].tolist(), "axesLengths": SIZE, "normalizedAxes": POSE[:3, :3].T.ravel().tolist()}
    path.write_text(json.dumps({"skipped": False, "data": [{"label": "storage", "segments": {"obbAligned": box}}]}))
    return path


WRITERS = {"a.json": roomplan_json, "a.usdz": roomplan_usdz, "parametric.usdz": roomplan_usdz, "b.json": arkitscenes}


@pytest.mark.parametrize("name", WRITERS)
def test_every_layout_gives_the_same_box(tmp_path: Path, name: str) -> None:
    path = WRITERS[name](tmp_path / name)
    assert labelled_boxes.recognise_boxes(path)
    box = labelled_boxes.read_boxes(path)[0]
    assert box.label == "storage" and box.center == pytest.approx(POSE[:3, 3], abs=1e-6)
    assert box.axes == pytest.approx(POSE[:3, :3].T, abs=1e-6) and box.size == pytest.approx(SIZE, abs=1e-6)


def test_labels_are_words_and_walls_are_flat(tmp_path: Path) -> None:
    boxes = labelled_boxes.read_boxes(roomplan_usdz(tmp_path / "parametric.usdz"))
    assert [(box.label, box.is_flat) for box in boxes] == [("storage", False), ("wall", True)]
    boxes = labelled_boxes.read_boxes(roomplan_json(tmp_path / "room.json"))
    assert [(box.label, box.is_flat) for box in boxes] == [("storage", False), ("washer dryer", False), ("wall", True)]


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('{"objects": [{"category": {"bed": {}}, "dimensions": [1, 1], "transform": []}]}', "truncated or damaged"),
        ('{"data": [{"label": "bed"}]}', "truncated or damaged"),
        ('{"objects": []}', "holds no box"),
        ('{"rooms": []}', "holds no labelled boxes"),
        ('{"objects": [', "holds no labelled boxes"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, text: str, word: str) -> None:
    (tmp_path / "room.json").write_text(text)
    with pytest.raises(InputError, match=word) as error:
        labelled_boxes.read_boxes(tmp_path / "room.json")
    assert "\n" not in str(error.value)


def box(label: str, height: float, size: tuple[float, float, float], turn: np.ndarray) -> labelled_boxes.LabelledBox:
    return labelled_boxes.LabelledBox(label, turn @ np.array([0.5, 0.2, height]), turn.T, np.array(size))


def test_a_labelled_floor_says_where_up_is_in_any_frame() -> None:
    for number in range(4):
        turn = trimesh.transformations.random_rotation_matrix(np.random.default_rng(number).random(3))[:3, :3]
        floor, table = box("floor", 0.1, (4.0, 3.0, 0.0), turn), box("table", 0.5, (1.0, 1.0, 0.8), turn)
        ceiling, rug = box("ceiling", 2.5, (4.0, 3.0, 0.0), turn), box("floor", 2.0, (1.0, 1.0, 0.0), turn)
        up = labelled_boxes.upwards([ceiling, rug, table, floor])
        assert up is not None and up == pytest.approx(turn[:, 2])
        below = box("couch", -0.9, (1.0, 1.0, 0.8), turn)
        assert labelled_boxes.upwards([floor, table, below]) is None
    assert labelled_boxes.upwards([]) is None
