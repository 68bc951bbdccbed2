"""Untidy scans: what is forgiven, and what the user is warned of."""

from __future__ import annotations

import logging
import math

import numpy as np
import pytest
import tiny_scan
from tiny_scan import corners, read, triangles

from s2a import scan
from s2a.core.errors import InputError
from s2a.scene.scene import Joint


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32"])
def test_a_byte_order_mark_and_wide_letters_are_read(encoding, tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    for file in folder.glob("*.json"):
        file.write_bytes(file.read_text().replace(",", ",\r\n").encode(encoding))
    assert scan.read(folder).parts == read(tmp_path / "plain").parts


@pytest.mark.parametrize("name", [tiny_scan.PARTS, tiny_scan.ARTIC])
def test_a_key_that_an_object_has_twice_is_refused(name, tmp_path):
    folder = tiny_scan.write(tmp_path / "scan")
    key = {tiny_scan.PARTS: "label", tiny_scan.ARTIC: "rangeMax"}[name]
    text = (folder / name).read_text().replace(f'"{key}":', f'"{key}": 0, "{key}":')
    (folder / name).write_text(text)
    with pytest.raises(InputError, match=f"{name}.*key '{key}' twice"):
        scan.read(folder)


def test_the_folder_may_be_a_scannetpp_one(tmp_path):
    folder = tiny_scan.write(tmp_path / "scan" / "scans").parent
    (folder / "scans" / tiny_scan.PARTS).rename(folder / tiny_scan.PARTS)
    assert scan.read(folder).parts == read(tmp_path / "plain").parts


def test_without_scannetpp_the_rest_is_one_part(tmp_path):
    files = tiny_scan.contents()
    del files["segments.json"], files["segments_anno.json"]
    scene = read(tmp_path, files)
    assert list(scene.parts)[-1] == "unannotated_6"
    assert np.array_equal(triangles(scene.parts["unannotated_6"]), corners(6, 7, 8, 9))


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
    assert np.array_equal(triangles(read(tmp_path, files).parts["handle_5"]), corners(5, 6))


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


@pytest.mark.parametrize(
    ("kind", "low", "high", "says"),
    [
        ("translation", 0.25, 0.5, "do not hold 0"),
        ("translation", -0.5, -0.25, "do not hold 0"),
        ("translation", 0.0, 0.0, "0.01 to 3 m"),
        ("translation", 0.0, 400, "0.01 to 3 m"),
        ("rotation", -math.pi, 3.5, "0.01 to 6.28319 rad"),
    ],
)
def test_a_range_that_no_robot_opens_is_kept_and_warned_of(tmp_path, kind, low, high, says, caplog):
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"][0].update(type=kind, rangeMin=low, rangeMax=high)
    assert read(tmp_path, files).joint("door_3").limits == (low, high)
    (message,) = caplog.messages
    assert says in message and tiny_scan.ARTIC in message and "part 3" in message and "\n" not in message


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


def test_one_rotation_beyond_a_full_turn_leaves_the_radians_of_all_others(tmp_path, caplog):
    files = tiny_scan.contents()
    files[tiny_scan.ARTIC]["data"]["articulations"] = [
        dict(pid=3, type="rotation", origin=[0, 0, 0], axis=[0, 0, 1], rangeMin=0, rangeMax=1.57),
        dict(pid=4, type="rotation", origin=[0, 0, 0], axis=[0, 0, 1], rangeMin=0, rangeMax=90),
    ]
    scene = read(tmp_path, files)
    assert scene.joint("door_3").limits == (0, 1.57)
    assert scene.joint("handle_base_4").limits == pytest.approx((0, math.pi / 2))
    assert "it alone is taken as degrees" in caplog.text
