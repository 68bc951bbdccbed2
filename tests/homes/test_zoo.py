"""The object zoo: what it holds, that it can stand, and that its files say what the truth says."""

from __future__ import annotations

import json
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from pxr import Usd, UsdGeom
from scipy.spatial import ConvexHull

from s2a.core.color_space import to_bytes
from s2a.homes.commands.zoo import Config, run
from s2a.homes.zoo import ZooObject, zoo
from s2a.homes.zoo.download import FLAWS, UNITS, WRITERS, download
from s2a.scan import source
from s2a.scan.source import sample

OBJECTS = zoo()
NAMES = [item.slug for item in OBJECTS]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("zoo") / "zoo"
    run(Config(out, 0))
    return out


@pytest.fixture(scope="module")
def truth(folder: Path) -> dict[str, dict]:
    return json.loads((folder / "truth.json").read_text())["objects"]


@cache
def load(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces and colours (of vertices) of any of the files."""
    if path.suffix == ".usda":
        stage = Usd.Stage.Open(str(path))
        mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/thing/mesh"))
        colors = to_bytes(np.array(mesh.GetDisplayColorPrimvar().Get()))
        faces = np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
        return np.array(mesh.GetPointsAttr().Get(), float), faces, colors
    mesh = source.read(path)
    colors = np.empty((len(mesh.vertices), 3))
    colors[mesh.faces] = sample(mesh.uv, mesh.colors, mesh.material, mesh.materials)
    return mesh.vertices, mesh.faces, np.round(colors)


def test_there_are_twenty_things_in_each_of_five_categories_and_ten_rare_labels():
    assert set(Counter(item.category for item in OBJECTS).values()) == {20}
    assert len({item.category for item in OBJECTS}) == 5
    assert sum(item.rare for item in OBJECTS) == 10
    assert len(set(NAMES)) == 100


@pytest.mark.parametrize("item", OBJECTS, ids=NAMES)
def test_surfaces_are_closed_with_their_faces_outwards(item: ZooObject):
    places, index = np.unique(np.round(item.surface.vertices, 8), axis=0, return_inverse=True)
    faces = index.ravel()[item.surface.faces]
    there, n = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), len(places)
    # Every edge is run along as often one way as the other; those between coinciding vertices do not count.
    there = there[there[:, 0] != there[:, 1]]
    assert np.array_equal(np.sort(there[:, 0] * n + there[:, 1]), np.sort(there[:, 1] * n + there[:, 0]))
    a, b, c = np.moveaxis(item.surface.vertices[item.surface.faces], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


@pytest.mark.parametrize("item", [t for t in OBJECTS if t.placement == "on"], ids=lambda t: t.slug)
def test_what_stands_has_its_centre_of_mass_above_its_feet(item: ZooObject):
    vertices = item.surface.vertices
    size = np.ptp(vertices, axis=0)
    feet = vertices[vertices[:, 2] < 1e-3 * size.max()][:, :2]
    hull = trimesh.convex.convex_hull(vertices)
    outline = ConvexHull(feet)
    margins = -(outline.equations[:, :2] @ hull.center_mass[:2] + outline.equations[:, 2])
    # It may be tilted by 5 degrees before it falls.
    assert margins.min() > np.tan(np.radians(5)) * hull.center_mass[2]


def test_the_list_names_every_object_with_its_label_and_nothing_of_the_truth(folder: Path, truth: dict):
    entries = yaml.safe_load((folder / "list.yaml").read_text())
    assert len(entries) == 100
    assert {frozenset(entry) for entry in entries} == {frozenset(("object", "label", "category"))}
    assert all((folder / entry["object"]).is_file() for entry in entries)
    assert [entry["label"] for entry in entries] == [record["label"] for record in truth.values()]


def test_units_axes_formats_and_flaws_are_mixed(truth: dict):
    counts = {
        key: Counter(record[key] for record in truth.values()) for key in ("unit", "up", "front", "format", "flaw")
    }
    assert set(counts["unit"].values()) == {25}
    assert counts["up"] == {"+y": 40, "+z": 40, "+x": 20}
    assert set(counts["format"].values()) == {20}
    assert len(counts["front"]) >= 5
    assert Counter(FLAWS) == {flaw: n for flaw, n in counts["flaw"].items() if flaw}


@pytest.mark.slow
def test_each_file_undone_by_the_truth_is_the_upright_thing(folder: Path, truth: dict):
    for item in OBJECTS:
        record = truth[item.slug]
        vertices, _, _ = load(folder / record["object"])
        back = np.linalg.inv(record["transform"])
        upright = vertices @ back[:3, :3].T + back[:3, 3]
        assert np.ptp(upright, axis=0) == pytest.approx(record["size"], abs=2e-5), item.slug
        assert upright.min(axis=0) == pytest.approx(item.surface.vertices.min(axis=0), abs=2e-5), item.slug
        axis = "xyz".index(record["up"][1])
        assert np.ptp(vertices, axis=0)[axis] * UNITS[record["unit"]] == pytest.approx(record["size"][2], abs=2e-5)


def test_colours_survive_in_every_format(folder: Path, truth: dict):
    for item in OBJECTS:
        _, faces, colors = load(folder / truth[item.slug]["object"])
        wanted = Counter(map(tuple, item.surface.mesh.colors[item.surface.faces[:, 0]].tolist()))
        found = Counter(map(tuple, np.rint(colors[faces[:, 0]]).astype(int).tolist()))
        spread = sum(abs(found[c] - wanted[c]) for c in {*found, *wanted})
        # Triangles that were turned over start at another vertex; a fin is one more.
        assert spread <= 0.02 * len(item.surface.faces), item.slug


def test_dirty_meshes_are_as_dirty_as_the_truth_says(folder: Path, truth: dict):
    for record in truth.values():
        if record["flaw"] is None:
            continue
        vertices, faces, _ = load(folder / record["object"])
        edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        undirected = Counter(map(tuple, np.sort(edges, axis=1).tolist()))
        if record["flaw"] == "duplicated vertices":
            assert len(vertices) >= len(faces) * 3 or len(np.unique(vertices, axis=0)) < 0.5 * len(vertices)
        elif record["flaw"] == "inconsistent winding":
            assert max(Counter(map(tuple, edges.tolist())).values()) >= 2
        else:
            assert max(undirected.values()) == 3


def test_the_same_seed_gives_the_same_files_and_another_seed_others(tmp_path: Path):
    objects = OBJECTS[:7]
    once, again, other = (download(objects, np.random.default_rng(seed)) for seed in (0, 0, 1))
    assert once == again
    assert once != other
    for name, (ending, write) in WRITERS.items():
        mesh = once[0].mesh(np.random.default_rng(0))
        for copy in "ab":
            (tmp_path / copy).mkdir(exist_ok=True)
            write(tmp_path / copy / f"thing{ending}", mesh, 1.0, "+y")
        a, b = ((tmp_path / copy / f"thing{ending}").read_bytes() for copy in "ab")
        assert a == b, name
