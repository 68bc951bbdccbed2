"""A Quest scene: its mesh where its pose puts it, and its labelled boxes and planes as objects of the scan."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import furnished_room
import numpy as np
import pytest
import trimesh

from s2a import scan as scans
from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.scan import labelled_boxes
from s2a.scan import labelled_boxes as quest_file

Z_TO_Y = trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
"""From z up to the scene's y up."""
Y_TO_Z = np.linalg.inv(Z_TO_Y)


def place(matrix: np.ndarray) -> dict[str, Any]:
    w, x, y, z = trimesh.transformations.quaternion_from_matrix(matrix)
    position = dict(zip("xyz", matrix[:3, 3].tolist(), strict=True))
    return {"orientation": {"x": x, "y": y, "z": z, "w": w}, "position": position}


def text(values: np.ndarray, kind: str) -> str:
    return base64.b64encode(values.astype(kind).tobytes()).decode()


def scene(path: Path) -> trimesh.Trimesh:
    """Write the furnished room, its mesh in a frame of its own; return it, subdivided, z up."""
    mesh = furnished_room.room().subdivide_to_size(0.2)
    pose = Z_TO_Y @ trimesh.transformations.rotation_matrix(0.7, (1, 2, 3), (0.2, 0.3, 0.1))
    local = trimesh.transform_points(mesh.vertices, np.linalg.inv(pose) @ Z_TO_Y)
    bed = Z_TO_Y @ trimesh.transformations.translation_matrix((-1.45, 1.5, 0.25))
    # WebXR's planes: y is the normal, the extent is along x and z.
    top = Z_TO_Y @ trimesh.transformations.translation_matrix((-1.45, 1.5, 0.5)) @ Y_TO_Z
    floor = Z_TO_Y @ Y_TO_Z
    entities = [
        {
            "semanticLabel_META": "BED",
            "locatable_META": place(bed),
            "bounded3D_META": {
                "offset": {"x": -1.0, "y": -0.45, "z": -0.25},
                "extent": {"width": 2.0, "height": 0.9, "depth": 0.5},
            },
        },
        {
            "semanticLabel_META": "BED",
            "locatable_META": place(top),
            "bounded2D_META": {"offset": {"x": -1.0, "y": -0.45}, "extent": {"width": 2.0, "height": 0.9}},
        },
        {
            "semanticLabel_META": "FLOOR",
            "locatable_META": place(floor),
            "bounded2D_META": {"offset": {"x": -2.5, "y": -2.0}, "extent": {"width": 5.0, "height": 4.0}},
        },
        {
            "semanticLabel_META": "GLOBAL_MESH",
            "locatable_META": place(pose),
            "triangleMesh_META": {"vertices": text(local, "<f4"), "indices": text(mesh.faces, "<u4")},
        },
    ]
    path.write_text(json.dumps({"type": "scene", "version": 1, "spatialEntities": entities}))
    return mesh


def test_mesh_and_boxes_lie_where_they_are(tmp_path: Path) -> None:
    mesh = scene(tmp_path / "room.json")
    assert quest_file.recognise_quest(tmp_path / "room.json")
    found, boxes = quest_file.read_quest(tmp_path / "room.json")
    y_up = trimesh.transform_points(mesh.vertices, Z_TO_Y)
    assert found.vertices == pytest.approx(y_up, abs=1e-5) and (found.faces == mesh.faces).all()
    assert (found.stated.up, found.stated.unit) == ("y", 1.0)
    assert [(box.label, box.is_flat) for box in boxes] == [
        ("bed", False),
        ("floor", True),
    ]  # the bed's top is no second bed
    assert boxes[1].axes[np.argmin(boxes[1].size)] @ [0, 1, 0] == pytest.approx(1.0)
    assert boxes[1].holds(np.array([[2.4, 0.0, 1.9], [0.0, 1.0, 0.0]])).tolist() == [True, False]
    assert boxes[0].center == pytest.approx([-1.45, 0.25, -1.5]) and sorted(boxes[0].size) == pytest.approx(
        [0.5, 0.9, 2.0]
    )


def test_labelled_boxes_become_objects(tmp_path: Path) -> None:
    scene(tmp_path / "room.json")
    assert cli.main(["import", f"mesh={tmp_path / 'room.json'}", f"out={tmp_path / 'scan'}"]) == 0
    parts = {part.label: part.mesh for part in scans.read(tmp_path / "scan").parts.values()}
    assert set(parts) == {"bed", "floor", "unannotated"}
    low, high = parts["bed"].bounds
    size, edge = np.array([2.0, 0.9, 0.5]), 0.2  # a face goes where two of its corners are
    assert (high - low > size - 2 * edge).all() and (high - low < size + 2 * (labelled_boxes.MARGIN + edge)).all()
    assert (
        np.abs(parts["floor"].vertices[:, 2]).max() < labelled_boxes.FLAT_MARGIN + edge
        and np.ptp(parts["floor"].vertices[:, 0]) > 4.5
    )


@pytest.mark.parametrize("keep", [0.5, 0.98])
def test_a_cut_file_is_one_line(tmp_path: Path, keep: float) -> None:
    scene(tmp_path / "room.json")
    data = (tmp_path / "room.json").read_bytes()
    (tmp_path / "room.json").write_bytes(data[: int(keep * len(data))])
    with pytest.raises(InputError, match="truncated or damaged") as error:
        quest_file.read_quest(tmp_path / "room.json")
    assert "\n" not in str(error.value)


def test_another_json_file_is_none(tmp_path: Path) -> None:
    (tmp_path / "room.json").write_text('{"walls": []}')
    assert not quest_file.recognise_quest(tmp_path / "room.json")
