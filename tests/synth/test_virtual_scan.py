"""Virtual scans: the room is furnished as asked, scanned like a real one, and annotated with stated errors."""

from __future__ import annotations

import ctypes
import filecmp
import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from s2a import scan
from s2a.core import config
from s2a.homes.furniture import main_cabinet
from s2a.homes.sample import SampleConfig, sample
from s2a.homes.solids import Piece
from s2a.scan import ply
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd import geometric

COARSE = ("scanner.demo.spacing=0.006", "scanner.demo.fusion.voxel=0.014", "scanner.demo.thin.merge=1")
"""A scanner for tests: seconds; bars are a blur to it."""
EARLIER = {
    "03631912c2_artic.json": "495eff3733cb4e0d",
    "03631912c2_parts.json": "288cc59b9cfe723f",
    "mesh_aligned_0.05.ply": "29682536667b310e",
    "segments.json": "ba711d00b9cb514e",
    "segments_anno.json": "ed48344e40e9963c",
    "truth/truth.json": "fe3a990d0215f040",
    "truth/truth.usda": "fb220737350b9d78",
}
"""First 16 hexadecimal digits of the SHA-256 of office 0, written before there were varied homes."""


def take(out: Path, *overrides: str) -> Path:
    """Write a coarse scan and return its folder."""
    settings = config.load(SampleConfig, config.compose("sample", [*COARSE, f"out={out}", *overrides]))
    sample(settings, out)
    return out


@pytest.fixture(scope="module")
def coarse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A coarse scan of office 0."""
    return take(tmp_path_factory.mktemp("virtual") / "scan")


@pytest.fixture(scope="module")
def truth(coarse: Path) -> Scene:
    """What that scan is of."""
    return geometric.read(coarse / "truth" / "truth.usda")


def facts(folder: Path) -> dict[str, Any]:
    """Return the truth's figures."""
    return json.loads((folder / "truth" / "truth.json").read_text())


def record(folder: Path, ending: str) -> dict[str, Any]:
    """Return the JSON file with a given ending."""
    (path,) = folder.glob(f"*{ending}")
    return json.loads(path.read_text())


def scanned(folder: Path) -> Mesh:
    """Return the scanned surface."""
    surface = ply.read(folder / "mesh_aligned_0.05.ply")
    return Mesh(surface.vertices, surface.faces)


def clean(truth: Scene) -> Mesh:
    """Return all clean surfaces as one mesh."""
    meshes = [part.mesh for part in truth.parts.values()]
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    faces = np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)])
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), faces)


def in_frame_of(folder: Path, part_id: str, points: np.ndarray) -> np.ndarray:
    """Return points in the frame in which a part was built, shape [point 3]."""
    pose = np.array(facts(folder)["parts"][part_id]["pose"])
    return (points - pose[:3, 3]) @ pose[:3, :3]


def test_the_same_seed_gives_the_same_bytes(coarse: Path, tmp_path: Path) -> None:
    again = take(tmp_path / "again")
    names = sorted(str(p.relative_to(coarse)) for p in coarse.rglob("*") if p.is_file())
    assert names == sorted(str(p.relative_to(again)) for p in again.rglob("*") if p.is_file())
    assert filecmp.cmpfiles(coarse, again, names, shallow=False) == (names, [], [])


SINE = np.lib.introspect.opt_func_info(func_name="^sin$", signature="float64")["sin"]["dd"]["current"]
"""Instructions by which NumPy computes a sine; the last digits depend on them, and with them which noisy ray hits what."""


def blas_core() -> str | None:
    """Return the processor for which OpenBLAS multiplies matrices here, on which the last digits depend too; None: unknown."""
    for file in (Path(np.__file__).parents[1] / "numpy.libs").glob("libscipy_openblas64*"):
        core = ctypes.CDLL(str(file)).scipy_openblas_get_corename64_
        core.restype = ctypes.c_char_p
        return core().decode()
    return None


WIDE = SINE in ("X86_V4", "AVX512_SKX") and blas_core() in ("SkylakeX", "Cooperlake", "SapphireRapids")
"""AVX-512 in both. On some processors with AVX-512 OpenBLAS takes its kernels for Haswell (OPENBLAS_CORETYPE chooses others)."""


@pytest.mark.skipif(not WIDE, reason=f"the bytes are of AVX-512; NumPy has {SINE}, OpenBLAS {blas_core()} here")
def test_the_classic_office_is_the_same_byte_for_byte(coarse: Path) -> None:
    """Published figures are of these very files, made with AVX-512; to the micrometre the solids are the same everywhere."""
    files = [path for path in coarse.rglob("*") if path.is_file()]
    found = {str(f.relative_to(coarse)): hashlib.sha256(f.read_bytes()).hexdigest()[:16] for f in files}
    assert found == EARLIER


@pytest.mark.slow
def test_another_seed_furnishes_another_room(coarse: Path, tmp_path: Path) -> None:
    other = take(tmp_path / "other", "seed=1")
    assert facts(other)["yaw"] != facts(coarse)["yaw"]
    assert facts(other)["name"] != facts(coarse)["name"]
    assert facts(other)["parts"]["drawer_7"]["joint"] != facts(coarse)["parts"]["drawer_7"]["joint"]


def test_no_triangle_of_the_clean_room_survives(coarse: Path, truth: Scene) -> None:
    points = {tuple(v) for v in scanned(coarse).vertices.tolist()}
    assert points.isdisjoint(map(tuple, clean(truth).vertices.tolist()))


def test_the_surface_is_off_by_about_a_millimetre_at_demo_detail(office_scan: Path) -> None:
    true = geometric.read(office_scan / "truth" / "truth.usda")
    room, mesh = clean(true), scanned(office_scan)
    gap = nearest_faces(ray_mesh(room.vertices, room.faces), mesh.vertices[mesh.faces].mean(axis=1))[1]
    assert 0.5e-3 < np.sqrt(np.average(gap**2, weights=mesh.face_areas)) < 3e-3


def test_what_no_scanner_saw_is_missing(coarse: Path) -> None:
    points = scanned(coarse).vertices
    x, y, z = in_frame_of(coarse, "cabinet_5", points).T
    within = np.abs(y) < 0.33
    front = within & (np.abs(x - 0.325) < 0.02) & (z > 0.1) & (z < 0.7)
    back = within & (np.abs(x + 0.305) < 0.015) & (z > 0.1) & (z < 0.7)
    under = within & (np.abs(x) < 0.2) & (np.abs(z) < 0.05)
    assert front.sum() > 50
    assert not back.any()
    assert not under.any()


def test_each_face_belongs_to_at_most_one_part_and_brings_its_vertices(coarse: Path) -> None:
    mesh = scanned(coarse)
    data = record(coarse, "_parts.json")["data"]
    faces = np.concatenate([a["triIndices"] for a in data["annotations"]])
    assert len(np.unique(faces)) == len(faces) == data["stats"]["annotatedFaces"]
    assert 0 <= faces.min() <= faces.max() < len(mesh.faces) == data["stats"]["totalFaces"]
    assert data["stats"]["totalVertices"] == len(mesh.vertices)
    for annotation in data["annotations"]:
        assert annotation["vertIndices"] == np.unique(mesh.faces[annotation["triIndices"]]).tolist()


def test_scannets_segments_are_vertices_and_cover_every_object(coarse: Path) -> None:
    count = len(scanned(coarse).vertices)
    assert record(coarse, "segments.json")["segIndices"] == list(range(count))
    groups = record(coarse, "segments_anno.json")["segGroups"]
    assert len({group["objectId"] for group in groups}) == len(groups) >= 30
    assert set(range(count)) == {v for group in groups for v in group["segments"]}


def test_the_reader_finds_the_parts_of_the_truth(coarse: Path, truth: Scene) -> None:
    read = scan.read(coarse)
    assert set(read.parts) == set(truth.parts)
    for part_id, part in truth.parts.items():
        found = read.part(part_id)
        assert (found.label, found.parent, found.graspable) == (part.label, part.parent, part.graspable)
    assert read.movable == truth.movable


def test_annotated_joints_err_as_little_as_stated(coarse: Path, truth: Scene) -> None:
    read = scan.read(coarse)
    for part_id in truth.movable:
        found, true = read.joint(part_id), truth.joint(part_id)
        angle = np.degrees(np.arccos(min(1.0, np.dot(found.axis, true.axis))))
        assert 0.0 < angle <= 0.5
        assert 0.0 < np.linalg.norm(np.subtract(found.origin, true.origin)) <= 0.006
        assert found.limits[0] == true.limits[0] == 0.0
        assert abs(found.limits[1] / true.limits[1] - 1.0) <= 0.02


def test_snapping_an_axis_to_the_world_is_wrong(truth: Scene) -> None:
    axes = np.array([truth.joint(i).axis for i in truth.movable if truth.joint(i).kind == "prismatic"])
    assert np.degrees(np.arccos(np.abs(axes).max(axis=1))).min() > 1.0


def test_joints_open_towards_positive_coordinates(truth: Scene, coarse: Path) -> None:
    """A point at the middle of the grasp region first moves away from the wall behind, towards the first scanner."""
    scanner = np.array(facts(coarse)["scanners"][0])
    for part_id in truth.movable:
        joint, grasp = truth.joint(part_id), truth.grasp_point(part_id)
        away = np.array(joint.axis)
        if joint.kind == "revolute":
            away = np.cross(joint.axis, grasp - joint.origin)
        assert np.dot(away, scanner - grasp) > 0.0, part_id


def test_the_main_cabinet_has_its_published_sizes() -> None:
    cabinet = main_cabinet(np.random.default_rng(0))
    drawer, door = cabinet.children[0], cabinet.children[2]
    bar, knob = drawer.children[0], door.children[0]
    assert np.allclose(cabinet.size, (0.6298, 0.762, 0.802), atol=1e-3)
    assert np.allclose(drawer.size, (0.5307, 0.7588, 0.1238), atol=1e-9)
    assert np.allclose(bar.size, (0.0381, 0.1682, 0.0238), atol=1e-9)
    assert np.allclose(door.size, (0.02, 0.381, 0.508), atol=1e-9)
    assert np.allclose(knob.size, (0.0265, 0.03, 0.03), atol=1e-9)
    assert drawer.joint is not None
    assert drawer.joint.limits == (0.0, 0.4)


def test_fronts_are_tilted_with_their_joints() -> None:
    cabinet = main_cabinet(np.random.default_rng(3))
    angles = [np.degrees(np.arccos(_axis(front)[2 if front.name == "door" else 0])) for front in cabinet.children]
    assert 0.0 < min(angles) < max(angles) <= 0.5
    for drawer in cabinet.children[:2]:
        assert np.allclose(drawer.pose[:3, 0], _axis(drawer), atol=1e-12)


def _axis(piece: Piece) -> np.ndarray:
    """Return a joint's axis without its sign along the largest coordinate."""
    assert piece.joint is not None
    axis = np.array(piece.joint.axis)
    return axis * np.sign(axis[np.argmax(np.abs(axis))])


def test_the_office_is_furnished_with_room_for_a_robot(truth: Scene, coarse: Path) -> None:
    assert sum(part.parent is None for part in truth.parts.values()) >= 25
    assert len(truth.movable) >= 6
    for part_id, part in truth.parts.items():
        if part.label not in ("floor", "ceiling", "wall") and truth.root(part_id) != "cabinet_5":
            x, y, z = in_frame_of(coarse, "cabinet_5", part.mesh.vertices.astype(np.float64)).T
            assert not ((x > 0.34) & (x < 1.3) & (np.abs(y) < 0.4) & (z < 2.0)).any(), part_id


def test_a_bar_keeps_its_shape_at_demo_detail(office_scan: Path) -> None:
    """Its front stands 38 mm before the drawer and is 24 mm high; behind it there are holes, or webs, but no solid block."""
    mesh = scanned(office_scan)
    centroids = mesh.vertices[mesh.faces].mean(axis=1)
    x, y, z = in_frame_of(office_scan, "handle_11", centroids).T
    middle = (np.abs(y) < 0.04) & (np.abs(z) < 0.03)
    bar = middle & (x > 0.02) & (x < 0.05)
    assert abs(np.percentile(x[bar], 95) - 0.0381) < 0.003
    assert abs(np.percentile(z[bar], 98) - 0.0119) < 0.004
    assert -0.020 < np.percentile(z[bar], 2) < -0.010
    assert mesh.face_areas[middle & (x > 0.008) & (x < 0.018)].sum() < 0.5 * mesh.face_areas[bar].sum()


@pytest.mark.slow
def test_a_full_scan_is_as_dense_as_a_real_one(tmp_path: Path) -> None:
    mesh = scanned(take_full(tmp_path / "full"))
    assert len(mesh.vertices) > 1_000_000
    assert 8_000 < len(mesh.vertices) / mesh.face_areas.sum() < 20_000


def take_full(out: Path) -> Path:
    """Write a scan in full detail and return its folder."""
    sample(config.load(SampleConfig, config.compose("sample", ["detail=full", f"out={out}"])), out)
    return out
