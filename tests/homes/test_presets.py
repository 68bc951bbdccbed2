"""Scanners, annotators and second scans of virtual homes: what each changes, and that the truth says so."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from settings import load
from solid_sweep import overlaps

from s2a import scan
from s2a.core import config
from s2a.core.errors import InputError
from s2a.homes import files
from s2a.homes.capture import AnnotationConfig, annotated_joints, overlooked, reversed_joints, swallowed, without
from s2a.homes.furnishing import home
from s2a.homes.room import catalog
from s2a.homes.sample import HEAD_AIR, MAX_TURN, STEP, SampleConfig, again, revisited, sample, scan_room, truth_record
from s2a.homes.scanner import DriftConfig, drifts, smoothed
from s2a.homes.solids import box, join
from s2a.scan import ply
from s2a.scene.articulation import displace
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.geometry.surface_nets import Net
from s2a.scene.usd import geometric

ROOM = ("laundry", 10)


def facts(folder: Path) -> dict[str, Any]:
    """Return the truth's figures."""
    return json.loads((folder / "truth" / "truth.json").read_text())


def take(out: Path) -> Path:
    """Write a coarse phone scan by a hasty annotator with a drawer open, and return its folder."""
    drawer = next(e.part_id for e in catalog(home(*ROOM).pieces) if e.piece.name == "detergent drawer")
    keys = [f"room={ROOM[0]}", f"seed={ROOM[1]}", "detail=phone", "annotator=hasty", "moved=1"]
    keys += ["detail.poses=6", "detail.fusion.voxel=0.05", f"open={{{drawer}: 0.1}}", f"out={out}"]
    sample(config.load(SampleConfig, config.compose("sample", keys)), out)
    return out


@pytest.fixture(scope="module")
def phone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A coarse phone scan."""
    return take(tmp_path_factory.mktemp("phone") / "scan")


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(phone: Path, tmp_path: Path) -> None:
    again = take(tmp_path / "again")
    files = sorted(path.relative_to(phone) for path in phone.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(again) for path in again.rglob("*") if path.is_file())
    for file in files:
        assert (phone / file).read_bytes() == (again / file).read_bytes(), file


def test_a_phone_writes_a_glb_with_y_up_and_one_image(phone: Path) -> None:
    data = (phone / "scan.glb").read_bytes()
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, _ = struct.unpack("<I4s", data[12:20])
    content = json.loads(data[20 : 20 + size])
    mesh = ply.read(phone / "mesh_aligned_0.05.ply")
    position = content["accessors"][0]
    assert position["count"] == 3 * len(mesh.faces)
    assert np.isclose(position["max"][1], mesh.vertices[:, 2].max(), atol=1e-5), "z became y"
    assert np.isclose(position["min"][2], -mesh.vertices[:, 1].max(), atol=1e-5), "y became -z"
    assert content["images"][0]["mimeType"] == "image/png"
    assert len(content["buffers"]) == 1


def test_a_dark_surface_swallows_rays_and_a_light_one_none() -> None:
    plates = [box((0, 1), (0, 1), (i, i + 0.1), (grey,) * 3) for i, grey in enumerate((0, 38, 77, 255))]
    glass = box((0, 1), (0, 1), (5, 5.1), (255, 255, 255), dropout=0.8)
    lost = swallowed(join(*plates, glass), 1.0)
    assert lost[::12] == pytest.approx([1.0, 0.503, 0.0, 0.0, 0.8], abs=0.001)
    assert swallowed(join(*plates, glass), 0.0)[::12] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.8])


def test_a_texture_shows_each_triangle_its_own_colours(tmp_path: Path) -> None:
    vertices = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], float)
    faces = np.array([(0, 1, 2), (1, 3, 2)])
    image = files._texture(vertices[faces], 1, lambda points, _: np.clip(255 * points, 0, 255).astype(np.uint8))
    corners = files._coordinates(2, 1) * files.TEXELS
    texels = image[corners[:, 1].astype(int), corners[:, 0].astype(int)] / 255.0
    assert np.allclose(texels[:3], vertices[faces[0]], atol=0.01)
    assert np.allclose(texels[3:], vertices[faces[1]], atol=0.01)


def test_the_truth_of_a_second_scan_says_what_is_open_and_what_moved(phone: Path) -> None:
    record = facts(phone)
    (drawer, q), *others = record["again"]["open"].items()
    assert q == 0.1 and not others and len(record["again"]["moved"]) == 1
    truth = geometric.read(phone / "truth" / "truth.usda")
    lower, upper = truth.joint(drawer).limits
    assert lower == pytest.approx(-0.1) and upper > 0.0
    (moved, motion), *_ = record["again"]["moved"].items()
    width, depth, _ = record["size"]
    assert width > 0 and depth > 0 and moved in truth.parts
    # A turn about the vertical: the object stays on its level.
    assert np.allclose(np.array(motion)[2], (0.0, 0.0, 1.0, 0.0), atol=1e-9)


def test_overlooked_handles_are_no_parts_of_the_annotation_but_of_the_truth(phone: Path) -> None:
    record = facts(phone)["annotator"]
    assert record["name"] == "hasty"
    parts = json.loads(next(phone.glob("*_parts.json")).read_text())["data"]["annotations"]
    numbers = {int(part_id.rsplit("_", 1)[1]) for part_id in record["overlooked"]}
    assert numbers.isdisjoint(part["partId"] for part in parts)
    assert set(record["overlooked"]) <= set(facts(phone)["parts"])
    assert scan.read(phone).movable == geometric.read(phone / "truth" / "truth.usda").movable


def test_a_hasty_annotator_overlooks_and_a_wrong_one_reverses() -> None:
    entries = catalog(home("kitchen", 0).pieces)
    wrong = config.load(SampleConfig, config.compose("sample", ["out=nowhere", "annotator=wrong"])).annotator
    exact = annotated_joints(entries, load(AnnotationConfig, "annotator/careful"), np.random.default_rng(0))
    flipped = [reversed_joints(exact, wrong, np.random.default_rng(seed)) for seed in range(30)]
    share = np.mean([len(numbers) / len(exact) for _, numbers in flipped])
    assert 0.05 < share < 0.15
    joints, numbers = flipped[0]
    for number, joint in joints.items():
        assert np.allclose(joint.axis, np.array(exact[number].axis) * (-1 if number in numbers else 1))
    missed = overlooked(entries, wrong, np.random.default_rng(1))
    owners = np.array([entry.number for entry in entries])
    annotated, changed = without(entries, owners, missed)
    assert missed and len(annotated) == len(entries) - len(missed)
    assert not np.isin(changed, list(missed)).any()
    assert all(e.piece.style is not None for e in entries if e.number in missed)


def test_an_open_drawer_takes_its_contents_along_and_counts_from_there() -> None:
    room = home("kitchen", 0)
    before = {e.number: e for e in catalog(room.pieces)}
    drawer = next(before[e.carrier] for e in before.values() if e.carrier and before[e.carrier].piece.name == "drawer")
    opened, motions = again(room, {drawer.part_id: 0.15}, 0, np.random.default_rng(0))
    after = {e.number: e for e in catalog(opened.pieces)}
    joint = drawer.piece.joint
    assert joint is not None and motions == {}
    moved = [n for n in before if not np.array_equal(before[n].piece.surface.vertices, after[n].piece.surface.vertices)]
    expected = {n for n, e in before.items() if drawer.number in (n, e.parent, e.carrier)}
    assert set(moved) == expected
    for number in moved:
        there = displace(before[number].piece.surface.vertices, joint, 0.15)
        assert np.allclose(after[number].piece.surface.vertices, there)
    limits = after[drawer.number].piece.joint.limits
    assert np.allclose(limits, (-0.15, joint.limits[1] - 0.15))


def test_moved_objects_stand_free_on_the_same_level() -> None:
    room = home("kitchen", 0)
    before = {e.part_id: e.piece for e in catalog(room.pieces)}
    changed, motions = again(room, {}, 4, np.random.default_rng(0))
    after = {e.part_id: e.piece for e in catalog(changed.pieces)}
    assert len(motions) == 4
    for part_id, motion in motions.items():
        assert np.linalg.norm(motion[:3, 3]) > 0 and np.isclose(motion[2, 3], 0.0)
        assert np.allclose(after[part_id].pose, motion @ before[part_id].pose)
    assert set(overlaps(changed, 0.002)) <= set(overlaps(room, 0.002))


def test_at_another_visit_the_scanner_stands_elsewhere_in_free_air() -> None:
    room = home("office", 3)
    other = revisited(room, np.random.default_rng(0))
    far = np.linalg.norm(other.scanners - room.scanners, axis=1)
    assert other.pieces == room.pieces and (far > 0.9 * STEP[0]).all() and (far < 1.1 * STEP[1]).all()
    surface = join(*(entry.piece.surface for entry in catalog(room.pieces)))
    assert nearest_faces(ray_mesh(surface.vertices, surface.faces), other.scanners)[1].min() > HEAD_AIR


@pytest.mark.slow
def test_a_visit_has_its_own_frame_errors_and_name_and_says_so_in_the_truth() -> None:
    keys = ["room=hallway", "detail.fusion.voxel=0.05", "detail.spacing=0.02", "out=none"]
    configs = [config.load(SampleConfig, config.compose("sample", [*keys, f"visit={n}"])) for n in (0, 1, 2)]
    scans = [scan_room(c) for c in configs]
    assert len({s.name for s in scans}) == 3 and len({s.room.yaw for s in scans}) == 3
    assert all(abs(s.room.yaw - scans[0].room.yaw) <= MAX_TURN for s in scans)
    assert [truth_record(s, c).get("visit") for s, c in zip(scans, configs, strict=True)] == [None, 1, 2]
    assert len({s.mesh.vertices.tobytes() for s in scans}) == 3


def test_what_cannot_be_opened_is_refused() -> None:
    room = home("kitchen", 0)
    with pytest.raises(InputError, match="is not a part that moves"):
        again(room, {"wall_1": 0.1}, 0, np.random.default_rng(0))
    drawer = next(e.part_id for e in catalog(room.pieces) if e.piece.name == "drawer")
    with pytest.raises(InputError, match="outside of its range"):
        again(room, {drawer: 3.0}, 0, np.random.default_rng(0))


def test_drift_walks_and_loops_close() -> None:
    walk = DriftConfig(step=0.01, turn=0.002, closure=1.0)
    places, turns = drifts(20, walk, np.random.default_rng(0))
    assert np.allclose(places[-1], 0.0) and np.allclose(turns[-1], 0.0)
    assert 0.005 < np.abs(places).max() < 0.1
    still, _ = drifts(5, DriftConfig(0.0, 0.0, 0.0), np.random.default_rng(0))
    assert (still == 0.0).all()


def test_smoothing_flattens_a_spike_and_keeps_a_plane() -> None:
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), np.zeros(81)], axis=1).astype(np.float32)
    index = np.arange(81).reshape(9, 9)
    a, b, c, d = index[:-1, :-1].ravel(), index[1:, :-1].ravel(), index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    flat = Net(points, np.tile(np.float32((0, 0, 1)), (81, 1)), faces, np.arange(81))
    assert np.allclose(smoothed(flat, 3).points[:, 2], 0.0)
    spiky = points.copy()
    spiky[40, 2] = 1.0
    assert smoothed(Net(spiky, flat.normals, faces, flat.cells), 2).points[:, 2].max() < 0.5
