"""Reading Articulate3D scans: hierarchy, motion, faces, and the rest of the room."""

from __future__ import annotations

import json
import os
import random
from pathlib import Path

import numpy as np
import pytest
import tiny_scan
from tiny_scan import corners, read, triangles

from s2a.scan.ply import ScanMesh
from s2a.scan.rest import cut
from s2a.scene.scene import Joint

REAL_DATA = os.environ.get("S2A_REAL_DATA")


def test_the_labels_make_the_tree_and_the_articulation_makes_the_joint(tmp_path):
    scene = read(tmp_path)
    tree = {part_id: part.parent for part_id, part in scene.parts.items()}
    assert list(tree.items()) == [
        ("door_frame_1", None),
        ("door_3", "door_frame_1"),
        ("handle_base_4", "door_3"),
        ("handle_5", "handle_base_4"),
        ("office_chair_6", None),
        ("unannotated_7", None),
    ]
    assert scene.movable == ("door_3",)
    assert scene.joint("door_3") == Joint("revolute", (0, 0, 1), (1, 0.5, 0.25), (0, 1.57))
    assert [part_id for part_id, part in scene.parts.items() if part.graspable] == ["handle_5"]
    assert scene.members("door_3") == ("door_3", "handle_base_4", "handle_5")
    assert (scene.name, scene.origin) == (tiny_scan.NAME, (0, 0, 0))
    assert scene.parts["handle_base_4"].label == "handle base"


def test_every_face_goes_to_one_part_with_its_place_and_colors(tmp_path):
    scene = read(tmp_path)
    assert np.array_equal(triangles(scene.parts["door_frame_1"]), corners(0, 1))
    assert np.array_equal(triangles(scene.parts["door_3"]), corners(2, 3))
    assert np.array_equal(triangles(scene.parts["handle_5"]), corners(5))
    # Of face 6 (vertices 6, 7, 8) one vertex is the chair's, of faces 7 to 9 two or three.
    assert np.array_equal(triangles(scene.parts["office_chair_6"]), corners(7, 8, 9))
    assert np.array_equal(triangles(scene.parts["unannotated_7"]), corners(6))
    assert np.array_equal(scene.parts["door_3"].mesh.colors, tiny_scan.COLORS[2:6])


def test_an_object_that_articulate3d_covers_already_is_not_taken_from_scannetpp_again(tmp_path):
    assert [part.label for part in read(tmp_path).parts.values()].count("door") == 1


def test_of_nested_scannetpp_objects_the_smallest_takes_the_vertex(tmp_path):
    files = tiny_scan.contents()
    cushion = {"label": "cushion", "segments": [9, 10, 11]}
    sofa = {"label": "sofa", "segments": [6, 7, 8, 9, 10, 11, 11]}
    for order in ([cushion, sofa], [sofa, cushion]):
        files["segments_anno.json"]["segGroups"] = order
        scene = read(tmp_path, files)
        found = {part.label: triangles(part) for part in scene.parts.values()}
        assert np.array_equal(found["cushion"], corners(8, 9))
        assert np.array_equal(found["sofa"], corners(6, 7))


def test_segments_of_several_vertices_are_looked_up(tmp_path):
    files = tiny_scan.contents()
    files["segments.json"]["segIndices"] = [50] * 8 + [7] * 3 + [9]
    files["segments_anno.json"]["segGroups"][0]["segments"] = [50]
    files["segments_anno.json"]["segGroups"][1]["segments"] = [7]
    assert read(tmp_path, files).parts == read(tmp_path / "other").parts


def test_where_parts_list_the_same_face_the_deeper_one_owns_it(tmp_path):
    files = tiny_scan.contents()
    parts = files[tiny_scan.PARTS]["data"]["annotations"]
    parts[0]["triIndices"] = [0, 1, 2, 3, 4, 5]
    parts[1]["triIndices"] = [2, 3, 4, 5]
    for order in (parts, parts[::-1]):
        files[tiny_scan.PARTS]["data"]["annotations"] = order
        assert {i: p.mesh for i, p in read(tmp_path, files).parts.items()} == {
            i: p.mesh for i, p in read(tmp_path / "other").parts.items()
        }


def test_a_movable_part_without_descendants_is_grasped_itself(tmp_path):
    files = tiny_scan.contents()
    files[tiny_scan.PARTS]["data"]["annotations"] = files[tiny_scan.PARTS]["data"]["annotations"][:2]
    scene = read(tmp_path, files)
    assert scene.parts["door_3"].graspable and scene.grasp_parts("door_3") == ("door_3",)


def test_a_mass_is_kept(tmp_path):
    files = tiny_scan.contents()
    files[tiny_scan.PARTS]["data"]["annotations"][1]["mass"] = 12.5
    assert [part.mass for part in read(tmp_path, files).parts.values()] == [None, 12.5, None, None, None, None]


def test_an_axis_is_renormalised(tmp_path):
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"][0]["axis"] = [3, 0, -4]
    assert read(tmp_path, files).joint("door_3").axis == pytest.approx((0.6, 0, -0.8), abs=1e-15)


def test_coordinates_far_from_zero_lose_nothing(tmp_path):
    shift = np.array([450_000.0, 5_200_000.0, 141.0])
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"][0]["origin"] = [450_001.0, 5_200_000.5, 141.25]
    scene = read(tmp_path, files, tiny_scan.ply(tiny_scan.VERTICES + shift, double=True))
    assert scene.origin == tuple(shift)
    assert np.allclose(triangles(scene.parts["door_3"]), corners(2, 3), rtol=0, atol=1e-6)
    assert scene.joint("door_3").origin == (1.0, 0.5, 0.25)


@pytest.mark.skipif(not REAL_DATA, reason="real label tree not at hand: set S2A_REAL_DATA to the folder that holds it")
def test_the_tree_of_a_real_scan_is_read_as_its_authors_wrote_it(tmp_path):
    listed = json.loads((Path(REAL_DATA or "") / "articulate3d_listing" / f"{tiny_scan.NAME}_prims.json").read_text())
    annotated = [row for row in listed if row["part_id"] <= 72]
    flat = sorted((row for row in listed if row["part_id"] > 72), key=lambda row: row["part_id"])
    tree = {row["part_id"]: row["parent_id"] for row in annotated}
    names = {row["part_id"]: row["label"].replace("_", " ") for row in listed}
    label_of = tiny_scan.labels_of(dict(random.Random(0).sample(sorted(tree.items()), len(tree))), names)
    faces = np.arange(3 * len(listed)).reshape(-1, 3)
    files = {
        tiny_scan.PARTS: {"data": {"annotations": [
            {"partId": n, "label": label, "triIndices": [n - 1]} for n, label in label_of.items()
        ]}},
        tiny_scan.ARTIC: {"data": {"articulations": []}},
        "segments.json": {"segIndices": list(range(3 * len(listed)))},
        "segments_anno.json": {"segGroups": [
            {"label": names[row["part_id"]], "segments": faces[row["part_id"] - 1].tolist()} for row in flat
        ]},
    }  # fmt: skip
    vertices = np.random.default_rng(0).random((3 * len(listed), 3))
    scene = read(tmp_path, files, tiny_scan.ply(vertices, faces, colors=None))
    prims = {row["prim_path"].split("/")[-1]: row for row in listed}
    parent_of = {name: row["prim_path"].split("/")[-2] for name, row in prims.items()}
    assert len(scene.parts) == 171
    assert {i: part.parent or "SceneRoot" for i, part in scene.parts.items()} == parent_of
    assert {i: scene.depth(i) + 1 for i in scene.parts} == {name: row["depth"] for name, row in prims.items()}


@pytest.mark.parametrize("seed", range(5))
def test_the_pieces_of_a_cut_are_the_surface_in_its_order(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = rng.random((200, 3)).astype(np.float32).astype(np.float64), rng.integers(0, 200, (500, 3))
    colors = rng.integers(0, 256, (200, 3)).astype(np.uint8)
    surface = ScanMesh(Path("x.ply"), vertices, faces.astype(np.int32), colors, np.zeros(3))
    owner = rng.integers(-1, 7, 500)
    pieces = cut(surface, owner, 8)
    for i, piece in enumerate(pieces):
        assert np.array_equal(piece.vertices[piece.faces], vertices[faces[owner == i]])
        assert np.array_equal(piece.colors[piece.faces], colors[faces[owner == i]])
        assert np.array_equal(piece.vertices, vertices[np.unique(faces[owner == i])])
    assert len(pieces[7].faces) == 0
