"""Reading Articulate3D scans: hierarchy, motion, the rest of the room, and what is forgiven."""

from __future__ import annotations

import json
import logging
import math
import os
import random
from pathlib import Path

import numpy as np
import pytest
import tiny_scan

from s2a import scan
from s2a.scan import labels, ply
from s2a.scan.cut import cut
from s2a.scan.ply import Surface
from s2a.scene import Joint, Part, Scene

REAL_DATA = os.environ.get("S2A_REAL_DATA")


def read(tmp_path: Path, files: dict | None = None, mesh: bytes | None = None) -> Scene:
    return scan.read(tiny_scan.write(tmp_path / "scan", files, mesh))


def triangles(part: Part) -> np.ndarray:
    """Corners of a part's faces, shape [face 3 3]."""
    return part.mesh.vertices[part.mesh.faces]


def tiny(*faces: int) -> np.ndarray:
    """Corners of some faces of the tiny scan."""
    return tiny_scan.VERTICES[tiny_scan.FACES[list(faces)]].astype(np.float32)


# -- what a scan says ------------------------------------------------------------------------------------------------


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
    assert np.array_equal(triangles(scene.parts["door_frame_1"]), tiny(0, 1))
    assert np.array_equal(triangles(scene.parts["door_3"]), tiny(2, 3))
    assert np.array_equal(triangles(scene.parts["handle_5"]), tiny(5))
    # Of face 6 (vertices 6, 7, 8) one vertex is the chair's, of faces 7 to 9 two or three.
    assert np.array_equal(triangles(scene.parts["office_chair_6"]), tiny(7, 8, 9))
    assert np.array_equal(triangles(scene.parts["unannotated_7"]), tiny(6))
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
        assert np.array_equal(found["cushion"], tiny(8, 9))
        assert np.array_equal(found["sofa"], tiny(6, 7))


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


def test_only_the_deepest_descendants_are_graspable():
    parent_of = {1: None, 2: 1, 3: 2, 4: 3, 5: 3, 6: 2}  # 6 is a hinge beside the handle base 3 with two handles
    assert labels.grasped({2}, parent_of) == {4, 5}
    assert labels.grasped({2, 6}, parent_of) == {4, 5, 6}
    assert labels.grasped(set(), parent_of) == set()


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
    assert np.allclose(triangles(scene.parts["door_3"]), tiny(2, 3), rtol=0, atol=1e-6)
    assert scene.joint("door_3").origin == (1.0, 0.5, 0.25)


# -- hierarchy -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("label", "name", "path"),
    [
        ("handle base.1.2.1", "handle base", ("1", "2", "1")),
        ("door.1.1.2_1", "door", ("1", "1", "2_1")),
        ("cabnet.", "cabnet", ()),
        ("  box   lid .3. 1.", "box lid", ("3", "1")),
        ("door..1", "door", ("1",)),
        ("lamp", "lamp", ()),
        ("", "", ()),
    ],
)
def test_labels_split_into_name_and_index_path(label, name, path):
    assert labels.split(label) == (name, path)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("handle base", "handle_base_4"), ("3d printer", "_3d_printer_4"), ("Tür/links", "T_r_links_4"), ("", "part_4")],
)
def test_part_ids_are_names_that_usd_accepts(name, expected):
    assert labels.part_id(name, 4) == expected


def test_the_nearest_existing_ancestor_is_the_parent_and_names_play_no_role():
    found = labels.parents(
        {7: "handle.1.2.1.1", 1: "door frame.1", 2: "knob.1.2", 10: "lamp.10", 5: "shade.10.2_1", 6: "x.1.20"}
    )
    assert found == {7: 2, 1: None, 2: 1, 10: None, 5: 10, 6: 1}
    assert labels.depths(found) == {7: 2, 1: 0, 2: 1, 10: 0, 5: 1, 6: 1}


def test_an_underscore_does_not_nest():
    assert labels.parents({1: "a.1", 2: "b.1.2", 3: "c.1.2_1", 4: "d.1.2_1.3"}) == {1: None, 2: 1, 3: 1, 4: 3}


def random_tree(seed: int) -> dict[int, int | None]:
    """Return the parents of 60 parts, in random order with random numbers."""
    chance = random.Random(seed)
    numbers = chance.sample(range(1000), 60)
    tree = {n: chance.choice([None, *numbers[:i]]) for i, n in enumerate(numbers)}
    return dict(chance.sample(sorted(tree.items()), len(tree)))


def labels_of(tree: dict[int, int | None], names: dict[int, str] | None = None) -> dict[int, str]:
    """Label parts by their place in a tree, as annotators do: "name.1", "name.1.1", "name.1.2" ..."""
    position: dict[int, int] = {}
    counted: dict[int | None, int] = {}
    for number, parent in tree.items():
        counted[parent] = position[number] = counted.get(parent, 0) + 1

    def path(number: int) -> str:
        parent = tree[number]
        return f"{'' if parent is None else path(parent)}.{position[number]}"

    return {number: f"{(names or {}).get(number, 'thing')}{path(number)}" for number in tree}


@pytest.mark.parametrize("seed", range(20))
def test_any_tree_survives_being_written_as_labels(seed):
    tree = random_tree(seed)
    assert labels.parents(labels_of(tree)) == tree
    order = labels.parents_first(tree)
    assert sorted(order) == sorted(tree)
    assert all(tree[n] is None or order.index(tree[n]) < order.index(n) for n in order)


@pytest.mark.skipif(not REAL_DATA, reason="real label tree not at hand: set S2A_REAL_DATA to the folder that holds it")
def test_the_tree_of_a_real_scan_is_read_as_its_authors_wrote_it(tmp_path):
    listed = json.loads((Path(REAL_DATA or "") / "articulate3d_listing" / f"{tiny_scan.NAME}_prims.json").read_text())
    annotated = [row for row in listed if row["part_id"] <= 72]
    flat = sorted((row for row in listed if row["part_id"] > 72), key=lambda row: row["part_id"])
    tree = {row["part_id"]: row["parent_id"] for row in annotated}
    names = {row["part_id"]: row["label"].replace("_", " ") for row in listed}
    label_of = labels_of(dict(random.Random(0).sample(sorted(tree.items()), len(tree))), names)
    corners = np.arange(3 * len(listed)).reshape(-1, 3)
    files = {
        tiny_scan.PARTS: {"data": {"annotations": [
            {"partId": n, "label": label, "triIndices": [n - 1]} for n, label in label_of.items()
        ]}},
        tiny_scan.ARTIC: {"data": {"articulations": []}},
        "segments.json": {"segIndices": list(range(3 * len(listed)))},
        "segments_anno.json": {"segGroups": [
            {"label": names[row["part_id"]], "segments": corners[row["part_id"] - 1].tolist()} for row in flat
        ]},
    }  # fmt: skip
    vertices = np.random.default_rng(0).random((3 * len(listed), 3))
    scene = read(tmp_path, files, tiny_scan.ply(vertices, corners, colors=None))
    prims = {row["prim_path"].split("/")[-1]: row for row in listed}
    parent_of = {name: row["prim_path"].split("/")[-2] for name, row in prims.items()}
    assert len(scene.parts) == 171
    assert {i: part.parent or "SceneRoot" for i, part in scene.parts.items()} == parent_of
    assert {i: scene.depth(i) + 1 for i in scene.parts} == {name: row["depth"] for name, row in prims.items()}


# -- what is forgiven ------------------------------------------------------------------------------------------------


def test_every_kind_of_ply_reads_the_same(tmp_path):
    plain = read(tmp_path / "plain").parts
    for i, kind in enumerate(({"double": True}, {"extras": True}, {"text": True}, {"text": True, "extras": True})):
        assert read(tmp_path / str(i), mesh=tiny_scan.ply(**kind)).parts == plain


def test_a_mesh_without_colors_is_read(tmp_path):
    assert all(part.mesh.colors is None for part in read(tmp_path, mesh=tiny_scan.ply(colors=None)).parts.values())


def test_texture_coordinates_do_not_reorder_the_vertices(tmp_path):
    mesh = tiny_scan.ply(faces=np.array([[11, 5, 3]]), extras=True)
    (tmp_path / "mesh.ply").write_bytes(mesh.replace(b"float nx", b"float s").replace(b"float ny", b"float t"))
    surface = ply.read(tmp_path / "mesh.ply")
    assert np.array_equal(surface.vertices, tiny_scan.VERTICES.astype(np.float32))
    assert surface.faces.tolist() == [[11, 5, 3]]


def test_a_byte_order_mark_is_skipped(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    for file in folder.glob("*.json"):
        file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    assert scan.read(folder).parts == read(tmp_path / "plain").parts


def test_the_folder_may_be_a_scannetpp_one(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan" / "scans").parent
    (folder / "scans" / tiny_scan.PARTS).rename(folder / tiny_scan.PARTS)
    assert scan.read(folder).parts == read(tmp_path / "plain").parts


def test_without_scannetpp_the_rest_is_one_part(tmp_path):
    files = tiny_scan.contents()
    del files["segments.json"], files["segments_anno.json"]
    scene = read(tmp_path, files)
    assert list(scene.parts)[-1] == "unannotated_6"
    assert np.array_equal(triangles(scene.parts["unannotated_6"]), tiny(6, 7, 8, 9))


def test_optional_keys_may_be_missing_and_unknown_ones_present(tmp_path):
    files = tiny_scan.contents()
    data = files[tiny_scan.PARTS]["data"]
    del files[tiny_scan.PARTS]["modelId"], files[tiny_scan.PARTS]["labels"], data["stats"]
    files[tiny_scan.ARTIC]["data"]["articulations"][0].pop("base")
    files[tiny_scan.ARTIC]["data"]["articulations"][0].update(ref=None, motionStates={}, surprise=[1])
    for part in data["annotations"]:
        del part["objectId"], part["vertIndices"]
        part["obb"] = "whatever"
    assert read(tmp_path, files).parts == read(tmp_path / "plain").parts


def test_without_faces_a_part_takes_those_whose_three_vertices_it_lists(tmp_path):
    files = tiny_scan.contents()
    handle = files[tiny_scan.PARTS]["data"]["annotations"][3]
    del handle["triIndices"]
    assert read(tmp_path, files).parts == read(tmp_path / "plain").parts
    handle.update(triIndices=[], vertIndices=[7, 6, 5, 8])
    assert np.array_equal(triangles(read(tmp_path, files).parts["handle_5"]), tiny(5, 6))


def test_an_empty_part_is_kept_and_warned_of(tmp_path, caplog):
    files = tiny_scan.contents()
    files[tiny_scan.PARTS]["data"]["annotations"][2].update(triIndices=[], vertIndices=[])
    scene = read(tmp_path, files)
    assert len(scene.parts["handle_base_4"].mesh.vertices) == 0
    assert scene.parts["handle_5"].parent == "handle_base_4"
    assert "handle base.1.2.1" in caplog.text


def test_of_several_articulations_of_a_part_the_last_counts(tmp_path, caplog):
    files = tiny_scan.contents()
    records = files[tiny_scan.ARTIC]["data"]["articulations"]
    records.append(dict(pid=3, type="translation", origin=[0, 0, 0], axis=[1, 0, 0], rangeMin=-0.1, rangeMax=0.4))
    assert read(tmp_path, files).joint("door_3") == Joint("prismatic", (1, 0, 0), (0, 0, 0), (-0.1, 0.4))
    assert "several articulations of part 3" in caplog.text


def test_degrees_are_recognised_converted_and_warned_of(tmp_path, caplog):
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"] = [
        dict(pid=3, type="rotation", origin=[0, 0, 0], axis=[0, 0, 1], rangeMin=-90, rangeMax=45),
        dict(pid=4, type="rotation", origin=[0, 0, 0], axis=[0, 0, 1], rangeMin=0, rangeMax=6),
        dict(pid=5, type="translation", origin=[0, 0, 0], axis=[0, 0, 1], rangeMin=0, rangeMax=0.5),
    ]
    scene = read(tmp_path, files)
    assert scene.joint("door_3").limits == pytest.approx((-math.pi / 2, math.pi / 4))
    assert scene.joint("handle_base_4").limits == pytest.approx((0, math.radians(6)))
    assert scene.joint("handle_5").limits == (0, 0.5)
    assert "degrees" in caplog.text


@pytest.mark.parametrize("full_turn", [2 * math.pi, 6.284, -6.2832])
def test_a_full_turn_in_radians_stays_in_radians(tmp_path, full_turn, caplog):
    files = tiny_scan.contents()
    limits = sorted((0, full_turn))
    files[tiny_scan.ARTIC]["data"]["articulations"][0].update(rangeMin=limits[0], rangeMax=limits[1])
    assert read(tmp_path, files).joint("door_3").limits == tuple(limits)
    assert "degrees" not in caplog.text


def test_untidy_labels_are_read_and_warned_of(tmp_path, caplog):
    files = tiny_scan.contents()
    for part, label in zip(
        files[tiny_scan.PARTS]["data"]["annotations"],
        ("door  frame.1.", "door .1.2", "cabnet.", "handle.1.2.1.1"),
        strict=True,
    ):
        part["label"] = label
    tree = {part_id: part.parent for part_id, part in read(tmp_path, files).parts.items()}
    assert tree["handle_5"] == "door_3" and tree["door_3"] == "door_frame_1" and tree["cabnet_4"] is None
    assert "cabnet." in caplog.text


def test_parts_that_share_an_index_path_are_kept_and_warned_of(tmp_path, caplog):
    files = tiny_scan.contents()
    files[tiny_scan.PARTS]["data"]["annotations"].append(tiny_scan.annotation(8, "window.1", [6]))
    scene = read(tmp_path, files)
    assert scene.parts["window_8"].parent is None and scene.parts["door_3"].parent == "door_frame_1"
    assert "window.1" in caplog.text and list(scene.parts)[-1] == "office_chair_9"


def test_an_unknown_base_is_ignored_and_warned_of(tmp_path, caplog):
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"][0]["base"] = [77]
    assert read(tmp_path, files).parts == read(tmp_path / "plain").parts
    assert "77" in caplog.text


def test_a_tidy_scan_is_read_without_a_warning(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        read(tmp_path)
    assert not caplog.records


# -- cutting ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_the_pieces_of_a_cut_are_the_surface_in_its_order(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = rng.random((200, 3)).astype(np.float32).astype(np.float64), rng.integers(0, 200, (500, 3))
    colors = rng.integers(0, 256, (200, 3)).astype(np.uint8)
    surface = Surface(Path("x.ply"), vertices, faces.astype(np.int32), colors, np.zeros(3))
    owner = rng.integers(-1, 7, 500)
    pieces = cut(surface, owner, 8)
    for i, piece in enumerate(pieces):
        assert np.array_equal(piece.vertices[piece.faces], vertices[faces[owner == i]])
        assert np.array_equal(piece.colors[piece.faces], colors[faces[owner == i]])
        assert np.array_equal(piece.vertices, vertices[np.unique(faces[owner == i])])
    assert len(pieces[7].faces) == 0
