"""Reading MultiScan's annotations: both schemas, and a real one."""

from __future__ import annotations

import math
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import tiny_multiscan as tiny
import tiny_scan
from tiny_scan import COLORS, assert_refused, corners, triangles

from s2a import scan
from s2a.scan import rest
from s2a.scan.formats import multiscan
from s2a.scan.ply import ScanMesh
from s2a.scene.scene import Joint
from s2a.scene.usd import geometric

REAL_DATA = os.environ.get("S2A_REAL_DATA")
TURN = Joint("revolute", (0, 0, -1), (1, 0.5, 0.25), (0, 1.5))
SLIDE = Joint("prismatic", (0, 1, 0), (1, 0.5, 0.25), (-0.25, 0.5))


def test_objects_carry_their_parts_and_parts_their_joints(tmp_path):
    scene = tiny.read_released(tmp_path)
    assert [(i, part.parent) for i, part in scene.parts.items()] == [
        ("wall_cabinet_1", None),
        ("door_6", "wall_cabinet_1"),
        ("shelf_7", "wall_cabinet_1"),
        ("bag_2", None),
        ("door_3", None),
        ("door_frame_10", "door_3"),
        ("door_9", "door_frame_10"),
        ("unannotated_11", None),
    ]
    assert scene.movable == ("door_6", "door_9")
    assert (scene.joint("door_6"), scene.joint("door_9")) == (TURN, SLIDE)
    assert scene.name == tiny.NAME


def test_the_older_schema_gives_the_same_joints_and_surfaces(tmp_path):
    scene, new = tiny.read_older(tmp_path), tiny.read_released(tmp_path)
    assert [(i, part.parent) for i, part in scene.parts.items()] == [
        ("wall_cabinet_1", None),
        ("door_5", "wall_cabinet_1"),
        ("shelf_6", "wall_cabinet_1"),
        ("bag_2", None),
        ("door_3", None),
        ("door_8", "door_3"),
        ("door_frame_9", "door_3"),
        ("unannotated_10", None),
    ]
    twin = {"door_5": "door_6", "door_8": "door_9", "shelf_6": "shelf_7", "door_frame_9": "door_frame_10"}
    twin["unannotated_10"] = "unannotated_11"
    for part_id, part in scene.parts.items():
        other = new.parts[twin.get(part_id, part_id)]
        assert (part.mesh, part.motion, part.graspable, part.label) == (
            other.mesh,
            other.motion,
            other.graspable,
            other.label,
        )


def test_every_face_goes_where_its_ids_say(tmp_path):
    scene = tiny.read_released(tmp_path)
    faces = {"wall_cabinet_1": (0, 1), "door_6": (2, 3), "shelf_7": (4,), "bag_2": (5,)}
    faces |= {"door_9": (6,), "door_frame_10": (7,), "unannotated_11": (9,)}
    for part_id, expected in faces.items():
        assert np.array_equal(triangles(scene.parts[part_id]), corners(*expected))
    assert not len(scene.parts["door_3"].mesh.faces)
    assert np.array_equal(scene.parts["door_6"].mesh.colors, COLORS[2:6])


def test_what_annotators_named_remove_is_left_out_with_a_warning(tmp_path, caplog):
    scene = tiny.read_released(tmp_path)
    assert sum(len(part.mesh.faces) for part in scene.parts.values()) == 9
    assert "remove" in caplog.text and not any("remove" in part_id for part_id in scene.parts)


def test_the_parts_of_what_is_removed_are_left_out_too(tmp_path, caplog):
    annotation = tiny.released()
    annotation["objects"][3]["partIds"] = [7, 8]
    annotation["parts"].append({"partId": 8, "label": "lid.1", "parentId": 7})
    assert not [i for i in tiny.read_released(tmp_path, annotation).parts if i.startswith(("remove", "lid"))]
    assert "1 faces that annotators named 'remove'" in caplog.text


def test_a_part_of_the_objects_name_that_belongs_to_another_part_stays_a_part(tmp_path):
    annotation = tiny.released()
    del annotation["parts"][4]["articulations"]
    assert tiny.read_released(tmp_path, annotation).parts["door_9"].parent == "door_frame_10"


def test_a_jointed_part_is_grasped_itself_and_nothing_is_free(tmp_path):
    scene = tiny.read_released(tmp_path)
    assert [i for i, part in scene.parts.items() if part.graspable] == ["door_6", "door_9"]
    assert scene.grasp_parts("door_6") == ("door_6",)
    assert not [i for i, part in scene.parts.items() if part.motion == "free"]


def test_an_object_whose_only_part_moves_moves_itself(tmp_path):
    annotation = tiny.released()
    annotation["parts"][3]["articulations"] = [tiny.TURN]
    scene = tiny.read_released(tmp_path, annotation)
    assert scene.movable == ("door_6", "bag_2", "door_9") and scene.parts["bag_2"].graspable
    other = tiny.older()
    other["articulations"]["bag.1"] = tiny.TURN
    assert tiny.read_older(tmp_path, other).joint("bag_2") == TURN


def test_of_several_articulations_the_first_counts(tmp_path, caplog):
    annotation = tiny.released()
    annotation["parts"][1]["articulations"].append(tiny.SLIDE)
    assert tiny.read_released(tmp_path, annotation).joint("door_6") == TURN
    assert "first" in caplog.text and "part 2 'door.1'" in caplog.text


def test_parts_of_no_object_are_left_out_with_a_warning(tmp_path, caplog):
    annotation = tiny.released()
    annotation["objects"][0]["partIds"] = [1, 2]
    scene = tiny.read_released(tmp_path, annotation)
    assert "shelf_7" not in scene.parts and "shelf.1" in caplog.text
    assert np.array_equal(triangles(scene.parts["unannotated_11"]), corners(4, 9))


def test_a_face_of_an_object_without_a_part_is_the_objects_own(tmp_path):
    ids = tiny.IDS.copy()
    ids[4] = (1, 0)
    scene = tiny.read_released(tmp_path, ids=ids)
    assert np.array_equal(triangles(scene.parts["wall_cabinet_1"]), corners(0, 1, 4))


def test_an_ascii_mesh_and_one_far_from_zero_are_read_alike(tmp_path):
    shift = (450_000.0, 5_200_000.0, 141.0)
    annotation = tiny.released()
    for part in (annotation["parts"][1], annotation["parts"][4]):
        part["articulations"][0]["origin"] = (np.array(shift) + (1, 0.5, 0.25)).tolist()
    far = scan.read(tiny.write(tmp_path / "far", annotation, tiny.ply(shift=shift)))
    near = tiny.read_released(tmp_path)
    text = scan.read(tiny.write(tmp_path / "text", tiny.released(), tiny.ply(text=True)))
    assert text == near
    assert far.origin == shift and far.joint("door_9") == SLIDE
    assert np.allclose(triangles(far.parts["door_6"]), corners(2, 3), rtol=0, atol=1e-6)


def test_the_scene_survives_the_geometric_stage(tmp_path):
    scene = tiny.read_released(tmp_path)
    geometric.write(scene, tmp_path / "geometric.usd")
    assert geometric.read(tmp_path / "geometric.usd") == scene


def annotated(path):
    """Return the annotation in a folder as a scene without surfaces: what is to be had of real data without meshes."""
    (file,) = path.glob("*.annotations.json")
    items = multiscan.read_objects(file).items
    names = {number: item.label for number, item in items.items()}
    parent_of = {number: item.parent for number, item in items.items()}
    nothing = ScanMesh(path, np.empty((0, 3)), np.empty((0, 3), int), None, np.zeros(3))
    facts = multiscan.facts(items, items, nothing.origin)
    return rest.scene(path.name, nothing, np.empty(0, int), names, parent_of, facts, None)


def test_an_annotation_without_its_mesh_is_refused(tmp_path):
    folder = tiny.write_released(tmp_path / "scan")
    (folder / tiny.PLY).unlink()
    assert_refused(folder, tiny.PLY, "missing", "4 objects, 2 joints", "no surface")
    scene = annotated(folder)
    assert scene.movable == ("door_6", "door_9") and "remove_4" in scene.parts


@pytest.mark.skipif(not REAL_DATA, reason="real annotation not at hand: set S2A_REAL_DATA to the folder that holds it")
def test_a_real_annotation_has_its_objects_and_joints():
    folder = Path(REAL_DATA or "") / "multiscan_scene_00000_00"
    scene = annotated(folder)
    objects = [i for i, part in scene.parts.items() if part.parent is None]
    assert len(objects) == 28 and objects[0] == "bag_1" and objects[-1] == "wall_cabinet_28"
    joints = {i: scene.joint(i) for i in scene.movable}
    assert len(joints) == 21
    # A door with its frame, two refrigerators, a sliding door, 15 doors of one wall cabinet and one of another.
    roots = [scene.root(i) for i in joints]
    assert [roots.count(i) for i in dict.fromkeys(roots)] == [1, 1, 2, 1, 15, 1]
    slides = [joint for joint in joints.values() if joint.kind == "prismatic"]
    assert [joint.limits for joint in slides] == [(0.0, pytest.approx(0.734, abs=1e-12))]
    uppers = sorted(round(joint.limits[1], 6) for joint in joints.values() if joint.kind == "revolute")
    assert uppers == [1.553343] + [round(math.pi / 2, 6)] * 15 + [1.58825] * 4
    assert all(joint.limits[0] == 0 for joint in joints.values())
    assert_refused(folder, "scene_00000_00.ply", "missing", "28 objects, 21 joints")


@pytest.mark.skipif(not REAL_DATA, reason="real annotation not at hand: set S2A_REAL_DATA to the folder that holds it")
def test_the_faces_of_a_real_annotation_find_their_parts(tmp_path):
    source = Path(REAL_DATA or "") / "multiscan_scene_00000_00"
    for file in source.glob("scene_00000_00.*.json"):
        shutil.copy(file, tmp_path)
    faces = np.tile([[0, 1, 2]], (295_662, 1))  # as many as the real mesh has, which is not at hand
    (tmp_path / "scene_00000_00.ply").write_bytes(tiny_scan.ply(np.eye(3), faces, colors=None))
    scene = scan.read(tmp_path)
    counts = {i: len(part.mesh.faces) for i, part in scene.parts.items()}
    assert (counts["bag_1"], counts["wall_cabinet_27"], counts["ceiling_5"]) == (693, 9563, 33168)
    assert [counts[i] for i in scene.movable if scene.root(i) == "refrigerator_17"] == [3158, 2681]
    assert sum(counts.values()) == 295_662 - 60  # without "remove"
    unannotated = [count for i, count in counts.items() if i.startswith("unannotated")]
    assert unannotated == [295_662 - 244_068]
